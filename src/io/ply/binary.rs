//! The body of a binary PLY file, of either byte order.

use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::Zeroable;

use super::Items;
use super::color::Color;
use super::header::{Element, Scalar};
use super::vertices::{Layout, Positions, Vertices};
use super::wedges::{AtOnce, MAX_CORNERS, Wedges, texture_number};
use crate::io::Placeless;
use crate::io::records::Records;
use crate::io::weld::weld;
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

/// A list of six numbers, in place of texture coordinates where there are none.
const NO_UVS: [u8; 25] = {
    let mut list = [0; 25];
    list[0] = 6;
    list
};

/// Which property of an element is the list of corners, if it has so many lists and that one holds words behind a byte.
fn plain_indices(element: &Element, lists: usize) -> Option<usize> {
    let index = super::faces::indices(element).ok()?;
    let list = &element.properties[index];
    let is_plain =
        matches!(list.list, Some(Scalar::U8 | Scalar::I8)) && matches!(list.scalar, Scalar::U32 | Scalar::I32);
    let count = element.properties.iter().filter(|property| property.list.is_some()).count();
    (is_plain && count == lists).then_some(index)
}

/// A list of three corners, if it is one, and all are below `vertices`.
#[inline]
fn triangle<const BIG: bool>(list: &[u8; 13], vertices: usize) -> Option<[u32; 3]> {
    let [3, corners @ ..] = list else { return None };
    let corner = |k: usize| u32::from_le_bytes(word::<BIG, 4>(&corners[4 * k..]));
    let triangle = [corner(0), corner(1), corner(2)];
    triangle.iter().all(|&i| (i as usize) < vertices).then_some(triangle)
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
        element.least_bytes()
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
        let Some(index) = plain_indices(element, 1) else { return Vec::new() };
        // A byte for the length of the list, which least_size has, and three indices.
        let stride = self.least_size(element) + 12;
        let offset = element.properties[..index].iter().map(|p| p.scalar.size()).sum();
        let count = (element.count as usize).min(self.rest.len() / stride);
        let triangles = self.records(count, stride, offset).read_while(|face| triangle::<BIG>(face, vertices));
        self.skip(triangles.len() * stride);
        triangles
    }

    fn wedges(&mut self, element: &Element, wanted: &Wedges, vertices: usize) -> Option<AtOnce> {
        let indices = plain_indices(element, 1 + usize::from(wanted.coordinates.is_some()))?;
        let is_plain = |list: usize| {
            let list = &element.properties[list];
            matches!(list.list, Some(Scalar::U8 | Scalar::I8)) && list.scalar == Scalar::F32
        };
        if !wanted.coordinates.is_none_or(is_plain) || !wanted.color.as_ref().is_none_or(Color::is_bytes) {
            return None;
        }
        // Behind the length of each list: three indices, six numbers.
        let beyond = [(Some(indices), 12), (wanted.coordinates, 24)];
        let offset = |index: usize| {
            let heads = element.properties[..index].iter().map(|p| p.list.unwrap_or(p.scalar).size());
            let lists = beyond.iter().filter(|(list, _)| list.is_some_and(|list| list < index));
            heads.sum::<usize>() + lists.map(|(_, size)| size).sum::<usize>()
        };
        let (count, stride) = (element.count as usize, offset(element.properties.len()));
        if count as u64 >= MAX_CORNERS / 3 {
            return None;
        }
        let bytes = self.rest.get(..count * stride)?;
        let offsets: Vec<usize> = (0..element.properties.len()).map(offset).collect();
        let (corners_at, uvs_at) = (offsets[indices], wanted.coordinates.map(|list| offsets[list]));
        let is_uniform = AtomicBool::new(true);
        let keys = |face: usize| {
            let face = &bytes[face * stride..][..stride];
            let corners = face[corners_at..].first_chunk().and_then(|list| triangle::<BIG>(list, vertices));
            let uvs = uvs_at.map_or(&NO_UVS[..], |at| &face[at..]);
            // What is read in vain is read no further.
            let (Some(corners), [6, uvs @ ..], true) = (corners, uvs, is_uniform.load(Ordering::Relaxed)) else {
                is_uniform.store(false, Ordering::Relaxed);
                return [[0; 4]; 3];
            };
            let color = wanted.color.as_ref().map_or(0, |color| color.packed(|index| face[offsets[index]].into()));
            let bits = |k: usize| u32::from_le_bytes(word::<BIG, 4>(&uvs[4 * k..]));
            [0, 1, 2].map(|k| [corners[k], bits(2 * k), bits(2 * k + 1), color])
        };
        let file = self.file;
        let (triangles, vertices) =
            weld(count, keys, |faces| file.done(&bytes[faces.start * stride..faces.end * stride]));
        if !is_uniform.into_inner() {
            return None;
        }
        let textures = wanted.texture.map_or(Vec::new(), |number| {
            let field = [(element.properties[number].scalar, offsets[number])];
            self.each(count, stride, &field, |value| texture_number(value(0)))
        });
        self.skip(count * stride);
        Some(AtOnce { triangles, vertices, textures })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::header;
    use super::*;

    /// Whatever comes first, binary triangles take the way that is quick; others do not.
    #[test]
    fn triangles_with_attributes_are_read_at_once() {
        let lists = [
            "property list uchar int vertex_indices\n",
            "property list uchar float texcoord\n",
            "property uchar red\n\
            property uchar green\nproperty uchar blue\n",
        ];
        for (order, corners, is_quick) in [([0, 1, 2], 3u8, true), ([2, 1, 0], 3, true), ([0, 1, 2], 4, false)] {
            let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\n".to_vec();
            order.iter().for_each(|&k| bytes.extend(lists[k].bytes()));
            bytes.extend(b"end_header\n");
            let floats: Vec<u8> = (0..2 * corners).flat_map(|x| f32::from(x).to_le_bytes()).collect();
            let indices: Vec<u8> = (0..corners).flat_map(|i| u32::from(i).to_le_bytes()).collect();
            let parts = [[&[corners][..], &indices].concat(), [&[2 * corners][..], &floats].concat(), vec![1, 2, 3]];
            order.iter().for_each(|&k| bytes.extend(&parts[k]));
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.ply");
            std::fs::write(&path, &bytes).unwrap();
            let file = Mapped::open(&path).unwrap();
            let header = header::parse(Path::new("a.ply"), &file).unwrap();
            let mut wanted = Wedges::of(&header).unwrap();
            let mut items = Binary::<false>::new(&file, header.length);
            let triangles = wanted.read_at_once(&header.elements[1], &mut items, 4);
            assert_eq!(triangles, is_quick.then(|| vec![[0, 1, 2]]), "{order:?}, {corners}");
        }
    }
}
