//! Cells of the trees that divide space, as point location finds them.

use crate::math::{Aabb, DVec3, Vec3};

/// A convex polyhedron of a kd-tree or a BSP tree, and what is in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Tells it from the tree's other cells.
    pub number: u32,
    /// The half-spaces whose intersection it is: points p with normal . p <= offset. First the six sides of
    /// everything's box, then the planes from the root down. A point within one of these belongs to the cell above, or
    /// in front.
    pub sides: Vec<(DVec3, f64)>,
    /// Items that reach into it, among them those within planes that bound it: triangles in the order of parts and of
    /// their meshes, then shapes.
    pub items: Vec<u32>,
}

impl Cell {
    /// All of `bounds`, before anything divides it; None where the point is outside.
    pub(super) fn within(bounds: &Aabb, point: Vec3) -> Option<Self> {
        let Aabb { min, max } = bounds;
        if !(point.cmpge(*min) & point.cmple(*max)).all() {
            return None;
        }
        let (min, max) = (min.as_dvec3(), max.as_dvec3());
        let sides = (0..3).flat_map(|axis| {
            let normal = DVec3::AXES[axis];
            [(-normal, -min[axis]), (normal, max[axis])]
        });
        Some(Self { number: 0, sides: sides.collect(), items: Vec::new() })
    }

    /// Whether a point is in it or on its surface.
    pub fn contains(&self, point: DVec3) -> bool {
        self.sides.iter().all(|(normal, offset)| normal.dot(point) <= *offset)
    }
}
