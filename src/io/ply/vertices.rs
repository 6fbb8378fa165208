//! The element vertex: positions, and what else a mesh has at its vertices.

use std::sync::Arc;

use super::color::Color;
use super::header::{Element, Scalar};
use super::item::Item;
use super::{Items, TELL};
use crate::io::Placeless;
use crate::math::{DVec3, Vec2, Vec3, Vec4};
use crate::scene::Mesh;
use crate::scene::compact::{choose, pick};

/// Which of an element's properties is what.
pub(super) struct Layout {
    pub(super) position: [usize; 3],
    /// As all other attributes, none unless all its parts are there.
    pub(super) normal: Option<[usize; 3]>,
    pub(super) uv: Option<[usize; 2]>,
    pub(super) color: Option<Color>,
    is_double: bool,
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
        Ok(Self {
            position: [x, y, z],
            normal: all(normal),
            uv: all(uv.map(|names| index(&names))),
            color: Color::of(element),
            is_double: [x, y, z].iter().any(|&i| element.properties[i].scalar == Scalar::F64),
        })
    }

    /// Whether positions are f64.
    pub(super) fn is_double(&self) -> bool {
        self.is_double
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
}

/// The indices, unless one is missing.
pub(super) fn all<const N: usize>(indices: [Option<usize>; N]) -> Option<[usize; N]> {
    indices.iter().all(Option::is_some).then(|| indices.map(Option::unwrap_or_default))
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
        let mut item = Item::of(element);
        for i in 0..element.count as usize {
            item.read(element, items, &[])?;
            vertices.push(&layout, |index| item.values[index]);
            if i % TELL == 0 {
                items.tell();
            }
        }
        Ok(vertices)
    }

    /// Those with these indices.
    pub(super) fn of(self, indices: &[u32]) -> Self {
        Self {
            positions: match self.positions {
                Positions::Single(positions) => Positions::Single(pick(indices, |i| positions[i])),
                Positions::Double(positions) => Positions::Double(pick(indices, |i| positions[i])),
            },
            normals: choose(indices, &self.normals),
            uvs: choose(indices, &self.uvs),
            colors: choose(indices, &self.colors),
        }
    }

    /// The mesh of triangles over them.
    pub(super) fn mesh(self, triangles: Vec<[u32; 3]>) -> Mesh {
        let Self { positions, normals, uvs, colors } = self;
        let mut mesh = Mesh { triangles: Arc::new(triangles), normals, uvs, colors, ..Mesh::default() };
        match positions {
            Positions::Single(positions) => mesh.positions = Arc::new(positions),
            Positions::Double(positions) => mesh.set_positions(&positions),
        }
        mesh
    }

    fn reserve(&mut self, count: usize, layout: &Layout) {
        match &mut self.positions {
            Positions::Single(positions) => positions.reserve_exact(count),
            Positions::Double(positions) => positions.reserve_exact(count),
        }
        self.normals.reserve_exact(layout.normal.map_or(0, |_| count));
        self.uvs.reserve_exact(layout.uv.map_or(0, |_| count));
        self.colors.reserve_exact(layout.color.as_ref().map_or(0, |_| count));
    }

    fn push(&mut self, layout: &Layout, value: impl Fn(usize) -> f64) {
        match &mut self.positions {
            Positions::Single(positions) => positions.push(layout.position(&value).as_vec3()),
            Positions::Double(positions) => positions.push(layout.position(&value)),
        }
        self.normals.extend(layout.normal.map(|normal| Layout::normal(normal, &value)));
        self.uvs.extend(layout.uv.map(|uv| Layout::uv(uv, &value)));
        self.colors.extend(layout.color.as_ref().map(|color| color.linear(&value)));
    }
}
