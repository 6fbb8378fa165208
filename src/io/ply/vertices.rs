//! The element vertex: positions, and what else a mesh has at its vertices.

use super::header::{Element, Scalar};
use super::{Items, TELL, read_item};
use crate::image::srgb;
use crate::io::Placeless;
use crate::math::{DVec3, Vec2, Vec3, Vec4};

/// Which of an element's properties is what.
pub(super) struct Layout {
    pub(super) position: [usize; 3],
    /// As all other attributes, none unless all its parts are there.
    pub(super) normal: Option<[usize; 3]>,
    pub(super) uv: Option<[usize; 2]>,
    pub(super) rgb: Option<[usize; 3]>,
    alpha: Option<usize>,
    /// The types of all properties.
    scalars: Vec<Scalar>,
}

impl Layout {
    /// An error where x, y or z is missing.
    pub(super) fn new(element: &Element) -> Placeless<Self> {
        let index = |names: &[&str]| element.index(names);
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|axis| index(&[axis])) else {
            return Err("element vertex needs the properties x, y and z".into());
        };
        let normal = ["nx", "ny", "nz"].map(|axis| index(&[axis]));
        let uv = [["u", "s", "texture_u", "texcoord_u"], ["v", "t", "texture_v", "texcoord_v"]];
        let rgb = [["red", "r", "diffuse_red"], ["green", "g", "diffuse_green"], ["blue", "b", "diffuse_blue"]];
        Ok(Self {
            position: [x, y, z],
            normal: all(normal),
            uv: all(uv.map(|names| index(&names))),
            rgb: all(rgb.map(|names| index(&names))),
            alpha: index(&["alpha", "a", "diffuse_alpha"]),
            scalars: element.properties.iter().map(|p| p.scalar).collect(),
        })
    }

    /// Whether positions are f64.
    pub(super) fn is_double(&self) -> bool {
        self.position.iter().any(|&i| self.scalars[i] == Scalar::F64)
    }

    // Each takes a function that gives the values of properties by their index.

    pub(super) fn position(&self, value: impl Fn(usize) -> f64) -> DVec3 {
        self.position.map(value).into()
    }

    pub(super) fn normal(normal: [usize; 3], value: impl Fn(usize) -> f64) -> Vec3 {
        DVec3::from(normal.map(value)).normalize_or_zero().as_vec3()
    }

    pub(super) fn uv(uv: [usize; 2], value: impl Fn(usize) -> f64) -> Vec2 {
        Vec2::from(uv.map(|i| value(i) as f32))
    }

    pub(super) fn color(&self, rgb: [usize; 3], value: impl Fn(usize) -> f64) -> Vec4 {
        let alpha = self.alpha.map_or(1.0, |i| value(i) / self.scalars[i].full());
        Vec3::from(rgb.map(|i| channel(self.scalars[i], value(i)))).extend(alpha.clamp(0.0, 1.0) as f32)
    }
}

fn all<const N: usize>(indices: [Option<usize>; N]) -> Option<[usize; N]> {
    indices.iter().all(Option::is_some).then(|| indices.map(Option::unwrap_or_default))
}

/// A colour channel as linear light: whole numbers are sRGB-encoded, floats linear already.
fn channel(scalar: Scalar, value: f64) -> f32 {
    match scalar {
        Scalar::U8 => srgb::srgb_to_linear(value as u8),
        Scalar::F32 | Scalar::F64 => (value / scalar.full()).max(0.0) as f32,
        _ => srgb::decode((value / scalar.full()).clamp(0.0, 1.0)) as f32,
    }
}

/// As precise as the file has them.
pub(super) enum Positions {
    Single(Vec<Vec3>),
    Double(Vec<DVec3>),
}

impl Positions {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Single(positions) => positions.len(),
            Self::Double(positions) => positions.len(),
        }
    }

    /// The position with an index below the length.
    pub(super) fn get(&self, index: u32) -> DVec3 {
        match self {
            Self::Single(positions) => positions[index as usize].as_dvec3(),
            Self::Double(positions) => positions[index as usize],
        }
    }
}

impl Default for Positions {
    fn default() -> Self {
        Self::Single(Vec::new())
    }
}

/// All vertices; attributes that the file does not have are empty.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Positions,
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) colors: Vec<Vec4>,
}

impl Vertices {
    /// Reads the element, whose promised size the caller has compared with what is left of the file.
    pub(super) fn read(element: &Element, items: &mut impl Items) -> Placeless<Self> {
        let layout = Layout::new(element)?;
        if let Some(vertices) = items.vertices(element, &layout) {
            return Ok(vertices);
        }
        let mut vertices = Self::default();
        if layout.is_double() {
            vertices.positions = Positions::Double(Vec::new());
        }
        vertices.reserve(element.count as usize, &layout);
        let mut values = vec![0.0; element.properties.len()];
        for i in 0..element.count as usize {
            read_item(element, items, |_| false, |index, value| values[index] = value)?;
            vertices.push(&layout, |index| values[index]);
            if i % TELL == 0 {
                items.tell();
            }
        }
        Ok(vertices)
    }

    fn reserve(&mut self, count: usize, layout: &Layout) {
        match &mut self.positions {
            Positions::Single(positions) => positions.reserve_exact(count),
            Positions::Double(positions) => positions.reserve_exact(count),
        }
        self.normals.reserve_exact(layout.normal.map_or(0, |_| count));
        self.uvs.reserve_exact(layout.uv.map_or(0, |_| count));
        self.colors.reserve_exact(layout.rgb.map_or(0, |_| count));
    }

    fn push(&mut self, layout: &Layout, value: impl Fn(usize) -> f64) {
        match &mut self.positions {
            Positions::Single(positions) => positions.push(layout.position(&value).as_vec3()),
            Positions::Double(positions) => positions.push(layout.position(&value)),
        }
        self.normals.extend(layout.normal.map(|normal| Layout::normal(normal, &value)));
        self.uvs.extend(layout.uv.map(|uv| Layout::uv(uv, &value)));
        self.colors.extend(layout.rgb.map(|rgb| layout.color(rgb, &value)));
    }
}
