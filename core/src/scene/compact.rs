//! Leaving out vertices that no triangle uses.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::Mesh;
use crate::math::{Vec3, is_traceable};

/// Corners or vertices that are worth a task of their own.
const TASK: usize = 1 << 14;

impl Mesh {
    /// Leaves out the vertices that no triangle names, if the outermost are among them: a stray one far away would
    /// frame the scene for the camera, and leave f32 little of what is seen. Of a triangle that no ray can hit, since a
    /// corner is NaN, infinite or too far away, that corner alone is kept, three times. How many of these there are.
    ///
    /// # Panics
    /// For a triangle that names a vertex that there is not.
    pub fn drop_strays(&mut self) -> usize {
        let untraceable = self.untraceable_triangles();
        if untraceable > 0 {
            let Self { positions, triangles, .. } = self;
            let bad = |i: u32| !is_traceable(positions[i as usize]);
            Arc::make_mut(triangles).par_iter_mut().with_min_len(TASK).for_each(|corners| {
                if let Some(i) = corners.iter().copied().find(|&i| bad(i)) {
                    *corners = [i; 3];
                }
            });
        }
        if self.triangles.is_empty() || outermost_are_used(&self.positions, self.triangles.as_flattened()) {
            return untraceable;
        }
        let mut triangles = Arc::unwrap_or_clone(std::mem::take(&mut self.triangles));
        *self = match compact(triangles.as_flattened_mut(), self.positions.len()) {
            Some(used) => with_vertices(self, &used, triangles),
            None => Self { triangles: Arc::new(triangles), ..std::mem::take(self) },
        };
        untraceable
    }
}

/// Whether, of those that are farthest along each axis, one each way is a triangle's corner. Most often all vertices
/// are: to look for six of them among the corners takes a tenth of the time that it takes to mark all.
fn outermost_are_used(positions: &[Vec3], corners: &[u32]) -> bool {
    // Six times an index: of the least coordinates, and of the largest.
    let farther = |a: [u32; 6], b: [u32; 6]| -> [u32; 6] {
        std::array::from_fn(|k| {
            // What cannot be traced counts as NaN, which gives way.
            let along = |i: u32| {
                let p = positions[i as usize];
                if is_traceable(p) { p[k % 3] * if k < 3 { -1.0 } else { 1.0 } } else { f32::NAN }
            };
            if along(b[k]) > along(a[k]) || along(a[k]).is_nan() { b[k] } else { a[k] }
        })
    };
    let all = (0..positions.len() as u32).into_par_iter().with_min_len(TASK);
    let Some(outermost) = all.map(|i| [i; 6]).reduce_with(farther) else { return true };
    let seen = corners.par_chunks(TASK).map(|corners| {
        let has = |wanted: u32| corners.iter().fold(false, |found, &corner| found | (corner == wanted));
        outermost.map(has)
    });
    let either = |a: [bool; 6], b: [bool; 6]| std::array::from_fn(|k| a[k] || b[k]);
    seen.reduce(|| [false; 6], either) == [true; 6]
}

/// The vertices that are used, in rising order, and makes the corners indices into those; none, and leaves the corners
/// as they are, where all `count` vertices are used.
pub fn compact(corners: &mut [u32], count: usize) -> Option<Vec<u32>> {
    // A flag for each vertex costs no more than the corners do where there are no more vertices than corners; where
    // there are, a small part of a shared list is used, and is sorted.
    if corners.len() < count {
        let mut used = corners.to_vec();
        used.sort_unstable();
        used.dedup();
        for corner in corners {
            // Found always: `used` has every corner.
            *corner = used.partition_point(|&i| i < *corner) as u32;
        }
        return Some(used);
    }
    let is_used: Vec<AtomicBool> = (0..count).map(|_| AtomicBool::new(false)).collect();
    corners.par_chunks(TASK).flatten_iter().for_each(|&i| is_used[i as usize].store(true, Ordering::Relaxed));
    let is_used: Vec<bool> = is_used.into_iter().map(AtomicBool::into_inner).collect();
    if is_used.iter().all(|&is_used| is_used) {
        return None;
    }
    let used: Vec<u32> = (0..).zip(&is_used).filter(|(_, is_used)| **is_used).map(|(i, _)| i).collect();
    let mut numbers = vec![0; count];
    used.iter().zip(0..).for_each(|(&i, number)| numbers[i as usize] = number);
    corners.par_iter_mut().with_min_len(TASK).for_each(|corner| *corner = numbers[*corner as usize]);
    Some(used)
}

/// What becomes of the vertices with these indices.
pub fn pick<T: Send>(used: &[u32], make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    used.par_iter().with_min_len(TASK).map(|&i| make(i as usize)).collect()
}

/// The values with these indices; none where there are none.
pub fn choose<T: Copy + Send + Sync>(used: &[u32], values: &[T]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { pick(used, |i| values[i]) }
}

/// The mesh of the vertices with these indices, and of triangles over them.
pub fn with_vertices(mesh: &Mesh, used: &[u32], triangles: Vec<[u32; 3]>) -> Mesh {
    Mesh {
        name: mesh.name.clone(),
        origin: mesh.origin,
        positions: Arc::new(choose(used, &mesh.positions)),
        normals: choose(used, &mesh.normals),
        uvs: choose(used, &mesh.uvs),
        second_uvs: choose(used, &mesh.second_uvs),
        colors: choose(used, &mesh.colors),
        triangles: Arc::new(triangles),
        material: mesh.material,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strays do not hide behind what no ray can hit, which is farther out than they are.
    #[test]
    fn strays_are_left_out_beside_what_cannot_be_hit() {
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30] {
            for stray in [Vec3::X * 1e6, Vec3::NEG_ONE * 1e6] {
                let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, stray, Vec3::new(bad, 0.0, bad), stray * 2.0];
                let mut mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 3, 4], [2, 0, 1]]);
                assert_eq!(mesh.drop_strays(), 1);
                assert_eq!(mesh.positions[..3], [Vec3::ZERO, Vec3::X, Vec3::Y]);
                assert_eq!((mesh.positions.len(), &mesh.triangles[..]), (4, &[[0, 1, 2], [3; 3], [2, 0, 1]][..]));
            }
        }
    }

    #[test]
    fn unused_vertices_are_left_out() {
        let compact = |mut corners: Vec<u32>, count| (compact(&mut corners, count), corners);
        assert_eq!(compact(vec![7, 3, 7, 9], 10), (Some(vec![3, 7, 9]), vec![1, 0, 1, 2]));
        assert_eq!(compact(vec![4, 1, 4, 2, 1], 5), (Some(vec![1, 2, 4]), vec![2, 0, 2, 1, 0]));
        assert_eq!(compact(vec![1, 0, 2], 3), (None, vec![1, 0, 2]));
    }
}
