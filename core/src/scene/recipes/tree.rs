//! A tree, "tree" of the databases (after Aono, Kunii 1984, *Botanical tree image generation*).

use super::{Scene, fill, staged};
use crate::math::DVec3;
use crate::scene::Geometry;
use crate::shape::{Cone, Shape, Sphere};

/// How much shorter and thinner a branch is than what it grows from, and the angle between them in degrees; for both
/// branches.
const BRANCHES: [(f64, f64, f64); 2] = [(0.82, 0.75, 22.0), (0.7, 0.6, 48.0)];
/// The second branch is on the other side of the first; every generation is turned by this, in degrees, close to the
/// golden angle.
const TURN: f64 = 137.5;

/// Branches are cones, closed by a sphere at their upper end; 2^(n + 1) - 1 of each.
pub(super) fn make(generations: u32) -> Scene {
    let (mut cones, mut spheres) = (Vec::new(), Vec::new());
    let trunk = Branch { foot: DVec3::ZERO, along: DVec3::Y, side: DVec3::X, length: 1.0, radius: 0.12 };
    trunk.grow(generations, &mut cones, &mut spheres);
    let materials = vec![fill([0.5, 0.33, 0.2], 1.0, 0.0, 1.0), fill([0.35, 0.6, 0.25], 1.0, 0.0, 1.0)];
    let floor = fill([0.55, 0.6, 0.4], 1.0, 0.0, 1.0);
    let geometry = |(shapes, material)| Geometry::Shapes { shapes, material };
    staged([(cones, 0), (spheres, 1)].map(geometry).to_vec(), materials, Some(floor))
}

struct Branch {
    foot: DVec3,
    /// Unit vectors along it and across.
    along: DVec3,
    side: DVec3,
    length: f64,
    /// At its foot.
    radius: f64,
}

impl Branch {
    fn grow(&self, generations: u32, cones: &mut Vec<Shape>, spheres: &mut Vec<Shape>) {
        let tip = self.foot + self.along * self.length;
        let tip_radius = self.radius * BRANCHES[0].1;
        let (base, apex, radius) = (self.foot.as_vec3(), tip.as_vec3(), tip_radius as f32);
        cones.push(Shape::Cone(Cone {
            base,
            base_radius: self.radius as f32,
            apex,
            apex_radius: radius,
            capped: false,
        }));
        spheres.push(Shape::Sphere(Sphere { centre: apex, radius }));
        if generations == 0 {
            return;
        }
        for (k, (length, radius, degrees)) in BRANCHES.into_iter().enumerate() {
            let turn = (TURN + 180.0 * k as f64).to_radians();
            let (sin, cos) = libm::sincos(turn);
            let side = self.side * cos + self.along.cross(self.side) * sin;
            let (sin, cos) = libm::sincos(degrees.to_radians());
            let branch = Self {
                foot: tip,
                along: self.along * cos + side * sin,
                side: side * cos - self.along * sin,
                length: self.length * length,
                radius: self.radius * radius,
            };
            branch.grow(generations - 1, cones, spheres);
        }
    }
}
