//! The fractal mountain, "mount" of the databases.

use super::{Scene, fill, noise, staged};
use crate::math::Vec3;
use crate::scene::{Geometry, Material, Mesh};
use crate::shape::{Shape, Sphere};

/// A square of two triangles, each divided into four again and again, where the middle of every edge is lifted at
/// random by up to its length times this (Fournier, Fussell, Carpenter 1982, *Computer rendering of stochastic
/// models*). What lifts a point is a hash of its place in the grid, so that triangles that share an edge agree.
const ROUGHNESS: f64 = 0.35;

pub(super) fn make(generations: u32) -> Scene {
    let side = 1u32 << generations;
    let heights = heights(side);
    let at = |k: u32| 2.0 * k as f32 / side as f32 - 1.0;
    let index = |x: u32, y: u32| y * (side + 1) + x;
    let grid = (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y)));
    let positions = grid.map(|(x, y)| Vec3::new(at(x), heights[index(x, y) as usize] as f32, at(y)));
    let squares = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [index(x, y), index(x + 1, y), index(x, y + 1), index(x + 1, y + 1)];
        [[a, c, d], [a, d, b]]
    });
    // Above the ground, wherever that is.
    let ball = |x: f32, z: f32| {
        let at = |place: f32| ((place + 1.0) / 2.0 * side as f32) as u32;
        let ground = heights[index(at(x), at(z)) as usize] as f32;
        Shape::Sphere(Sphere { centre: Vec3::new(x, ground + 0.4, z), radius: 0.18 })
    };
    let balls = vec![ball(-0.5, 0.5), ball(0.1, -0.3), ball(0.6, 0.2), ball(0.1, 0.7)];
    let mesh = Mesh::new(positions.collect(), triangles.collect());
    let glass = Material { transmission: Vec3::splat(0.85), ior: 1.5, ..fill([1.0, 0.95, 0.9], 0.0, 0.12, 60.0) };
    let geometries = vec![Geometry::Mesh(mesh), Geometry::Shapes { shapes: balls, material: 1 }];
    staged(geometries, vec![fill([0.5, 0.45, 0.35], 1.0, 0.0, 1.0), glass], None)
}

/// Heights over a grid of `side` squares a side.
fn heights(side: u32) -> Vec<f64> {
    let row = side as usize + 1;
    let mut heights = vec![0.0; row * row];
    let mut step = side;
    while step > 1 {
        let half = step / 2;
        let length = 2.0 * f64::from(step) / f64::from(side);
        let mut lift = |a: (u32, u32), b: (u32, u32), length: f64| {
            let place = |(x, y): (u32, u32)| y as usize * row + x as usize;
            let middle = ((a.0 + b.0) / 2, (a.1 + b.1) / 2);
            // In units of the whole, so that a finer mountain is the same one.
            let unit = (1 << 13) / side;
            let random = noise(middle.0 * unit, middle.1 * unit) * 2.0 - 0.7;
            heights[place(middle)] = (heights[place(a)] + heights[place(b)]) / 2.0 + random * length * ROUGHNESS;
        };
        for y in (0..=side).step_by(step as usize) {
            for x in (0..=side).step_by(step as usize) {
                if x < side {
                    lift((x, y), (x + step, y), length);
                }
                if y < side {
                    lift((x, y), (x, y + step), length);
                }
                if x < side && y < side {
                    lift((x, y), (x + step, y + step), length * 2f64.sqrt());
                }
            }
        }
        step = half;
    }
    heights
}
