//! The body of a binary PLY file, of either byte order.

use bytemuck::Zeroable;

use super::Items;
use super::color::Color;
use super::header::{Element, Scalar};
use super::vertices::{Layout, Positions, Vertices};
use crate::io::Placeless;
use crate::io::records::Records;
use crate::math::Vec3;
use crate::memory::Mapped;

/// Values, big-endian or little-endian.
pub(super) struct Binary<'a, const BIG: bool> {
    file: &'a Mapped<'a>,
    rest: &'a [u8],
    /// Bytes that are left beyond those that the file has been told of.
    untold: usize,
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    /// The body, which begins at the given byte of the file.
    pub(super) fn new(file: &'a Mapped<'a>, begin: usize) -> Self {
        Self { file, rest: &file[begin..], untold: file.len() - begin }
    }

    /// The next `count` records of `stride` bytes, of which bytes from `offset` on are wanted.
    fn records(&self, count: usize, stride: usize, offset: usize) -> Records<'a> {
        // Beyond the last record there is nothing to read, be there room or not.
        let bytes = self.rest.get(offset..).unwrap_or_default();
        Records { file: Some(self.file), bytes, count, stride }
    }

    /// Goes on behind records that were read at once, and that the file knows of.
    fn skip(&mut self, bytes: usize) {
        self.rest = &self.rest[bytes..];
        self.untold = self.rest.len();
    }

    /// Makes something of every one of the next `count` records, whose fields have these types and offsets.
    fn each<T: Zeroable + Send>(
        &self,
        count: usize,
        stride: usize,
        fields: &[(Scalar, usize)],
        make: impl Fn(&dyn Fn(usize) -> f64) -> T + Sync,
    ) -> Vec<T> {
        let records = self.records(count, stride, 0);
        records.read_slices(|record| make(&|index| decode::<BIG>(fields[index].0, &record[fields[index].1..])))
    }
}

/// A value at the beginning of bytes that hold it.
#[inline]
fn decode<const BIG: bool>(scalar: Scalar, bytes: &[u8]) -> f64 {
    match scalar {
        Scalar::I8 => i8::from_le_bytes(word::<BIG, 1>(bytes)).into(),
        Scalar::U8 => u8::from_le_bytes(word::<BIG, 1>(bytes)).into(),
        Scalar::I16 => i16::from_le_bytes(word::<BIG, 2>(bytes)).into(),
        Scalar::U16 => u16::from_le_bytes(word::<BIG, 2>(bytes)).into(),
        Scalar::I32 => i32::from_le_bytes(word::<BIG, 4>(bytes)).into(),
        Scalar::U32 => u32::from_le_bytes(word::<BIG, 4>(bytes)).into(),
        Scalar::I64 => i64::from_le_bytes(word::<BIG, 8>(bytes)) as f64,
        Scalar::U64 => u64::from_le_bytes(word::<BIG, 8>(bytes)) as f64,
        Scalar::F32 => f32::from_le_bytes(word::<BIG, 4>(bytes)).into(),
        Scalar::F64 => f64::from_le_bytes(word::<BIG, 8>(bytes)),
    }
}

/// The first N bytes, in little-endian order.
#[inline]
fn word<const BIG: bool, const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut word = [0; N];
    word.copy_from_slice(&bytes[..N]);
    if BIG {
        word.reverse();
    }
    word
}

impl<const BIG: bool> Items for Binary<'_, BIG> {
    fn place(&self) -> String {
        format!("byte {}", self.file.len() - self.rest.len())
    }

    fn remaining(&self) -> usize {
        self.rest.len()
    }

    fn rest(&self) -> usize {
        self.rest.trim_ascii().len()
    }

    fn tell(&mut self) {
        let [from, to] = [self.untold, self.rest.len()].map(|left| self.file.len() - left);
        self.file.done(&self.file[from..to]);
        self.untold = self.rest.len();
    }

    fn least_size(&self, element: &Element) -> usize {
        element.properties.iter().map(|p| p.list.unwrap_or(p.scalar).size()).sum()
    }

    #[inline]
    fn scalar(&mut self, scalar: Scalar) -> Placeless<f64> {
        let size = scalar.size();
        let Some((bytes, rest)) = self.rest.split_at_checked(size) else {
            return Err(format!("the file ends before its last element; {size} more bytes are needed"));
        };
        self.rest = rest;
        Ok(decode::<BIG>(scalar, bytes))
    }

    /// Each attribute in a pass of its own: a pass over what is in the system's cache costs less than a loop that
    /// chooses among attributes.
    fn vertices(&mut self, element: &Element, layout: &Layout) -> Option<Vertices> {
        if element.properties.iter().any(|p| p.list.is_some()) {
            return None;
        }
        let (count, stride) = (element.count as usize, self.least_size(element));
        let offset = |index: usize| element.properties[..index].iter().map(|p| p.scalar.size()).sum::<usize>();
        let fields: Vec<_> = element.properties.iter().enumerate().map(|(i, p)| (p.scalar, offset(i))).collect();
        let [x, y, z] = layout.position.map(|i| fields[i]);
        let is_plain = [x, y, z].iter().enumerate().all(|(k, field)| *field == (Scalar::F32, x.1 + 4 * k));
        let positions = if is_plain {
            let float = |bytes: &[u8]| f32::from_le_bytes(word::<BIG, 4>(bytes));
            let position = |p: &[u8; 12]| Vec3::new(float(p), float(&p[4..]), float(&p[8..]));
            Positions::Single(self.records(count, stride, x.1).read(position))
        } else if layout.is_double() {
            Positions::Double(self.each(count, stride, &fields, |value| layout.position(value)))
        } else {
            Positions::Single(self.each(count, stride, &fields, |value| layout.position(value).as_vec3()))
        };
        let normal = |normal| self.each(count, stride, &fields, |value| Layout::normal(normal, value));
        let uv = |uv| self.each(count, stride, &fields, |value| Layout::uv(uv, value));
        let color = |color: &Color| self.each(count, stride, &fields, |value| color.linear(value));
        let vertices = Vertices {
            positions,
            normals: layout.normal.map_or(Vec::new(), normal),
            uvs: layout.uv.map_or(Vec::new(), uv),
            colors: layout.color.as_ref().map_or(Vec::new(), color),
        };
        self.skip(count * stride);
        Some(vertices)
    }

    fn triangles(&mut self, element: &Element, vertices: usize) -> Vec<[u32; 3]> {
        let lists: Vec<_> = element.properties.iter().enumerate().filter(|(_, p)| p.list.is_some()).collect();
        let [(index, list)] = lists[..] else { return Vec::new() };
        let plain = matches!(list.list, Some(Scalar::U8 | Scalar::I8))
            && matches!(list.scalar, Scalar::U32 | Scalar::I32)
            && super::faces::indices(element) == Ok(index);
        if !plain {
            return Vec::new();
        }
        // A byte for the length of the list, which least_size has, and three indices.
        let stride = self.least_size(element) + 12;
        let offset = element.properties[..index].iter().map(|p| p.scalar.size()).sum();
        let count = (element.count as usize).min(self.rest.len() / stride);
        let triangle = |face: &[u8; 13]| {
            let [3, corners @ ..] = face else { return None };
            let corner = |k: usize| u32::from_le_bytes(word::<BIG, 4>(&corners[4 * k..]));
            let triangle = [corner(0), corner(1), corner(2)];
            triangle.iter().all(|&i| (i as usize) < vertices).then_some(triangle)
        };
        let triangles = self.records(count, stride, offset).read_while(triangle);
        self.skip(triangles.len() * stride);
        triangles
    }
}
