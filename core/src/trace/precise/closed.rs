//! Whether meshes have an inside, and how far around a point that is the same.

use rayon::prelude::*;

use super::{PreciseScene, is_traceable};
use crate::math::DVec3;
use crate::once::made_outside;

/// More than distances in f64 are off by, relative to the largest coordinate of what they were computed from.
const ROUNDING: f64 = 1e-13;

impl PreciseScene {
    /// Whether the triangles leave no opening: at every edge an even number of them meet, those of all meshes together.
    /// Corners are the same where they are at the same place. Then every ray from a point crosses them an odd number of
    /// times, or each an even number; crossings are those of [`count_batch`](Self::count_batch).
    pub fn is_closed(&self) -> bool {
        *made_outside(&self.closed, || self.edges_are_even())
    }

    fn edges_are_even(&self) -> bool {
        let corners: usize = self.meshes.iter().map(|mesh| mesh.positions.len()).sum();
        let Ok(corners) = u32::try_from(corners) else { return false };
        // Of each mesh the number of its first corner, among those of all.
        let firsts = self.meshes.iter().scan(0, |next, mesh| {
            let first = *next;
            *next += mesh.positions.len() as u32;
            Some(first)
        });
        let firsts: Vec<u32> = firsts.collect();
        let positions: Vec<DVec3> = self.meshes.iter().flat_map(|mesh| mesh.positions.iter().copied()).collect();
        // Zeros of both signs are one place.
        let place = |i: u32| (positions[i as usize] + 0.0).to_array().map(f64::to_bits);
        let mut sorted: Vec<u32> = (0..corners).collect();
        sorted.par_sort_unstable_by_key(|&i| place(i));
        // Each corner by the first that is at its place.
        let mut same = vec![0; corners as usize];
        for run in sorted.chunk_by(|&a, &b| place(a) == place(b)) {
            run.iter().for_each(|&i| same[i as usize] = run[0]);
        }
        let mut edges: Vec<u64> = Vec::new();
        for (mesh, first) in self.meshes.iter().zip(firsts) {
            for triangle in &mesh.triangles {
                if triangle.iter().all(|&i| is_traceable(mesh.positions[i as usize])) {
                    let [a, b, c] = triangle.map(|i| same[(first + i) as usize]);
                    let between = |a: u32, b: u32| u64::from(a.min(b)) << 32 | u64::from(a.max(b));
                    edges.extend([(a, b), (b, c), (c, a)].iter().filter(|(a, b)| a != b).map(|&(a, b)| between(a, b)));
                }
            }
        }
        edges.par_sort_unstable();
        edges.chunk_by(|a, b| a == b).all(|run| run.len() % 2 == 0)
    }

    /// How far around a point there is surely no triangle, by the squared distance that
    /// [`Self::distance_squared_batch`] tells of it. 0 where nothing is sure, as if that is NaN.
    pub fn clearance(&self, point: DVec3, distance_squared: f64) -> f64 {
        let rounding = ROUNDING * (point.abs().max_element() + self.frame.farthest());
        // The larger number: NaN is none.
        (distance_squared.sqrt() * (1.0 - ROUNDING) - rounding).max(0.0)
    }
}
