//! Meshes made by rule, of any size: what is measured need not be stored.

use std::f32::consts::{FRAC_PI_2, TAU};

use rayon::prelude::*;

use super::Mesh;
use crate::math::{Mat3, Vec3};

/// What the terrain takes for a full turn.
const TURN: f32 = 628.0 / 100.0;

/// A terrain of 2 n^2 triangles over the unit square in x and z: eight octaves of sin(x) cos(z), +y up.
///
/// Evaluated in f32 throughout, so that it is the mesh of `benches/embree_ref.cpp` up to the last bits of the sines.
pub fn terrain(n: u32) -> Mesh {
    let height = |x: f32, z: f32| {
        let (mut height, mut amplitude, mut frequency) = (0.0, 0.15, 4.0);
        for octave in 0..8u8 {
            let phase = f32::from(octave);
            height += amplitude
                * libm::sinf(frequency * x * TURN + phase * 1.3)
                * libm::cosf(frequency * z * TURN + phase * 2.1);
            amplitude *= 0.5;
            frequency *= 2.03;
        }
        height
    };
    let at = |i: u32| i as f32 / n as f32;
    let row = |j: u32| (0..=n).map(move |i| Vec3::new(at(i), height(at(i), at(j)), at(j)));
    let positions = (0..=n).into_par_iter().flat_map_iter(row).collect();
    let squares = |j: u32| {
        (0..n).flat_map(move |i| {
            let a = j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
            [[a, b, c], [b, d, c]]
        })
    };
    Mesh::new(positions, (0..n).into_par_iter().flat_map_iter(squares).collect())
}

/// A building of `n` storeys: slabs on round columns, and window bars along every front. Nearly all triangles are long
/// and thin, and the whole is turned about two axes, so that the boxes of the bars are mostly empty: what spatial
/// splits (Stich, Friedrich, Dietrich 2009, *Spatial splits in bounding volume hierarchies*) are for.
///
/// 4,140 triangles a storey, metres, +y up.
pub fn architecture(n: u32) -> Mesh {
    let mut building = Building::default();
    for storey in 0..n {
        let floor = storey as f32 * STOREY;
        building.bar(Vec3::Y * floor, Vec3::new(SIDE / 2.0, 0.15, SIDE / 2.0));
        for (i, j) in (0..6u8).flat_map(|i| (0..6u8).map(move |j| (i, j))) {
            let at = |k: u8| 4.0 * f32::from(k) - 10.0;
            building.column(Vec3::new(at(i), floor, at(j)), 0.25);
        }
        for front in 0..4u8 {
            building.front(Mat3::from_rotation_y(f32::from(front) * FRAC_PI_2), floor);
        }
    }
    let turn = Mat3::from_rotation_y(0.6) * Mat3::from_rotation_x(0.35);
    Mesh::new(building.positions.into_iter().map(|p| turn * p).collect(), building.triangles)
}

/// Length and width of a slab, metres.
const SIDE: f32 = 24.0;
/// From slab to slab, metres.
const STOREY: f32 = 3.0;

#[derive(Default)]
struct Building {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Building {
    /// A box of 12 triangles, `half` to each side of `centre`.
    fn bar(&mut self, centre: Vec3, half: Vec3) {
        let first = self.positions.len() as u32;
        let sign = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
        let corner = |k: u32| Vec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2));
        self.positions.extend((0..8).map(|k| centre + corner(k) * half));
        // Each side as its corners in turn, seen from outside.
        for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            self.triangles.extend([[a, b, c], [a, c, d]].map(|corners| corners.map(|k| first + k)));
        }
    }

    /// The side of an upright column, 48 triangles as high as a storey.
    fn column(&mut self, foot: Vec3, radius: f32) {
        const EDGES: u32 = 24;
        let first = self.positions.len() as u32;
        for k in 0..EDGES {
            let (sin, cos) = libm::sincosf(TAU * k as f32 / EDGES as f32);
            let rim = foot + Vec3::new(cos, 0.0, -sin) * radius;
            self.positions.extend([rim, rim + Vec3::Y * STOREY]);
            let [a, b] = [k, (k + 1) % EDGES].map(|k| first + 2 * k);
            self.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }

    /// The bars of one front, which looks along +z before it is turned: 48 upright, 2 across.
    fn front(&mut self, turn: Mat3, floor: f32) {
        let first = self.positions.len();
        let (middle, face) = (floor + STOREY / 2.0, SIDE / 2.0);
        for k in 0..48u8 {
            let x = (f32::from(k) + 0.5) * (SIDE / 48.0) - SIDE / 2.0;
            self.bar(Vec3::new(x, middle, face), Vec3::new(0.02, STOREY / 2.0, 0.04));
        }
        for height in [0.9, 2.1] {
            self.bar(Vec3::new(0.0, floor + height, face), Vec3::new(SIDE / 2.0, 0.02, 0.04));
        }
        for p in &mut self.positions[first..] {
            *p = turn * *p;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_terrain_is_a_graph_over_the_unit_square() {
        let n = 20;
        let mesh = terrain(n);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (21 * 21, 800));
        for (k, p) in mesh.positions.iter().enumerate() {
            let (i, j) = (k % 21, k / 21);
            assert_eq!((p.x, p.z), (i as f32 / 20.0, j as f32 / 20.0));
            // The same sum in f64: rounding apart, the sines' arguments reach 4 * 2.03^7 * 6.28 = 3569.
            let (x, z) = (f64::from(p.x), f64::from(p.z));
            let octave = |o: i32| {
                let (f, phase) = (4.0 * 2.03f64.powi(o) * f64::from(TURN), f64::from(o));
                0.15 * 0.5f64.powi(o) * (f * x + phase * 1.3).sin() * (f * z + phase * 2.1).cos()
            };
            let exact: f64 = (0..8).map(octave).sum();
            assert!((f64::from(p.y) - exact).abs() < 1e-5, "{p}: {exact}");
        }
        // Every square in two halves, all of one winding: seen from above, the areas add up to the square's.
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            f64::from((b.x - a.x) * (c.z - a.z) - (c.x - a.x) * (b.z - a.z)) / 2.0
        };
        assert!(mesh.triangles.iter().all(|t| area(t) > 0.0));
        assert!((mesh.triangles.iter().map(area).sum::<f64>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn most_of_the_building_is_long_and_thin() {
        let mesh = architecture(2);
        assert_eq!(mesh.triangles.len(), 2 * 4140);
        // Twice the area over the square of the longest side: height by length.
        let slenderness = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
            (b - a).cross(c - a).length() / longest
        };
        let thin = mesh.triangles.iter().filter(|t| slenderness(t) < 0.05).count();
        assert!(thin * 10 > mesh.triangles.len() * 8, "{thin}");
        // Boxes are closed: without the columns, which are not, the signed volumes add up to the volumes of the bars.
        let mut one = Building::default();
        one.bar(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.5, 1.0, 1.5));
        let volume = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| one.positions[i as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        assert!((one.triangles.iter().map(volume).sum::<f32>() - 6.0).abs() < 1e-4);
    }
}
