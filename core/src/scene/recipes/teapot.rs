//! A teapot, after Newell's (Crow 1987, *The origins of the teapot*).
//!
//! Body and lid are turned from his profile, six cubic Bezier curves; spout and handle are tubes along curves near his.
//! So it is his teapot in outline, and half the data of his 32 patches.

use std::f64::consts::TAU;

use crate::math::{DVec2, DVec3, Vec3};
use crate::scene::Mesh;

/// Radius and height of the control points, from the lid's knob to its rim, and from the body's rim to its foot.
const LID: [[[f64; 2]; 4]; 2] =
    [[[0.0, 3.15], [0.8, 3.15], [0.0, 2.7], [0.2, 2.55]], [[0.2, 2.55], [0.4, 2.4], [1.3, 2.4], [1.3, 2.25]]];
const BODY: [[[f64; 2]; 4]; 4] = [
    [[1.4, 2.25], [1.3375, 2.38125], [1.4375, 2.38125], [1.5, 2.25]],
    [[1.5, 2.25], [1.75, 1.725], [2.0, 1.2], [2.0, 0.75]],
    [[2.0, 0.75], [2.0, 0.3], [1.5, 0.075], [1.5, 0.0]],
    [[1.5, 0.0], [1.0, -0.05], [0.5, -0.05], [0.0, -0.05]],
];

/// A tube: the curve of its middle in the plane of handle and spout, and the radius at each control point.
struct Tube([[f64; 2]; 4], [f64; 4]);

const TUBES: [Tube; 3] = [
    // The spout widens to the body and bends outwards at its lip.
    Tube([[1.4, 0.7], [2.6, 0.8], [2.3, 1.9], [3.0, 2.25]], [0.5, 0.35, 0.2, 0.2]),
    // The handle's upper and lower half.
    Tube([[-1.55, 1.9], [-2.3, 1.95], [-2.8, 1.9], [-2.75, 1.5]], [0.15; 4]),
    Tube([[-2.75, 1.5], [-2.7, 1.1], [-2.4, 0.8], [-1.9, 0.6]], [0.15; 4]),
];

/// Steps along each curve, and around.
const STEPS: u32 = 8;
const AROUND: u32 = 24;

/// Standing on y = 0 about, 3.2 high, with smooth normals; the spout along +x.
pub(super) fn mesh() -> Mesh {
    let mut surfaces = Surfaces::default();
    for curve in LID.into_iter().chain(BODY) {
        let curve = curve.map(DVec2::from_array);
        surfaces.add(AROUND, |share, angle| {
            let p = bezier(curve, share);
            let (sin, cos) = libm::sincos(angle);
            DVec3::new(p.x * cos, p.y, p.x * sin)
        });
    }
    for Tube(curve, radii) in TUBES {
        let curve = curve.map(DVec2::from_array);
        let radii = radii.map(|r| DVec2::new(r, 0.0));
        surfaces.add(AROUND / 2, |share, angle| {
            let (p, radius) = (bezier(curve, share), bezier(radii, share).x);
            // Near the ends a finite difference is the direction, too.
            let along = (bezier(curve, (share + 1e-3).min(1.0)) - bezier(curve, (share - 1e-3).max(0.0))).normalize();
            let (sin, cos) = libm::sincos(angle);
            let across = along.perp() * (cos * radius);
            DVec3::new(p.x + across.x, p.y + across.y, sin * radius)
        });
    }
    let mut mesh = Mesh::new(surfaces.positions, surfaces.triangles);
    mesh.name = "teapot".to_owned();
    mesh.smooth_normals();
    mesh
}

/// By de Casteljau's algorithm.
fn bezier(mut points: [DVec2; 4], share: f64) -> DVec2 {
    for count in (1..4).rev() {
        for k in 0..count {
            points[k] = points[k].lerp(points[k + 1], share);
        }
    }
    points[0]
}

#[derive(Default)]
struct Surfaces {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Surfaces {
    /// Adds a surface over shares of a curve and angles around, closed in the angle.
    fn add(&mut self, around: u32, point: impl Fn(f64, f64) -> DVec3) {
        let first = self.positions.len() as u32;
        for step in 0..=STEPS {
            let share = f64::from(step) / f64::from(STEPS);
            let angle = |k: u32| TAU * f64::from(k) / f64::from(around);
            self.positions.extend((0..around).map(|k| point(share, angle(k)).as_vec3()));
        }
        for (step, k) in (0..STEPS).flat_map(|step| (0..around).map(move |k| (step, k))) {
            let at = |step: u32, k: u32| first + step * around + k % around;
            let [a, b, c, d] = [at(step, k), at(step, k + 1), at(step + 1, k), at(step + 1, k + 1)];
            // At a pole all corners of a row are one point.
            let is_real = |t: &[u32; 3]| {
                let [p, q, r] = t.map(|i| self.positions[i as usize]);
                p != q && q != r && r != p
            };
            let real: Vec<_> = [[a, b, c], [b, d, c]].into_iter().filter(is_real).collect();
            self.triangles.extend(real);
        }
    }
}
