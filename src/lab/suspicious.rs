//! What about a mesh looks like a mistake.
//!
//! A mesh's vertices are first merged by position, since files repeat a vertex for each normal and texture coordinate:
//! two triangles are neighbours where their edges join the same two points. Vertices, triangles and edges are sorted
//! and then read in runs. Hash maps would do the same, with a random access for each of the three edges of a triangle;
//! sorting runs on all cores and reads memory in order.

use rayon::prelude::*;
use serde::Serialize;

use super::exact::{Approx, Dyadic, Ring, cross, vector, zip};
use crate::math::{Vec3, is_traceable};
use crate::scene::Mesh;

/// Counts of what looks like a mistake in a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Suspicious {
    /// Triangles with an area of exactly zero.
    pub degenerate: u64,
    /// Triangles with a corner that is NaN, infinite or too large to trace.
    pub not_finite: u64,
    /// Triangles at the same three points as another one, beyond the first; in any order of the corners.
    pub duplicate: u64,
    /// Edges of one triangle only.
    pub open_edges: u64,
    /// Edges of three or more triangles.
    pub non_manifold_edges: u64,
    /// Edges that their two triangles run along in the same direction, so that one of them faces the wrong way.
    pub flipped_edges: u64,
}

impl Suspicious {
    /// The counts of both.
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            degenerate: self.degenerate + other.degenerate,
            not_finite: self.not_finite + other.not_finite,
            duplicate: self.duplicate + other.duplicate,
            open_edges: self.open_edges + other.open_edges,
            non_manifold_edges: self.non_manifold_edges + other.non_manifold_edges,
            flipped_edges: self.flipped_edges + other.flipped_edges,
        }
    }

    /// Counts with what they count, in the order of the reports.
    pub fn rows(&self) -> [(&'static str, u64); 6] {
        let named = |count, one, several| (if count == 1 { one } else { several }, count);
        [
            named(self.degenerate, "degenerate triangle", "degenerate triangles"),
            named(self.not_finite, "NaN or infinite triangle", "NaN or infinite triangles"),
            named(self.duplicate, "duplicate triangle", "duplicate triangles"),
            named(self.open_edges, "open edge", "open edges"),
            named(self.non_manifold_edges, "non-manifold edge", "non-manifold edges"),
            named(self.flipped_edges, "edge with flipped winding", "edges with flipped winding"),
        ]
    }
}

/// Counts what looks like a mistake.
pub fn suspicious(mesh: &Mesh) -> Suspicious {
    let points = merge(&mesh.positions);
    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
    let is_finite = |t: &&[u32; 3]| corners(t).into_iter().all(is_traceable);
    let finite: Vec<[u32; 3]> = mesh.triangles.par_iter().filter(is_finite).copied().collect();
    // Distinct points: a triangle that repeats one has no third edge, and its neighbours share the other two.
    let merged: Vec<[u32; 3]> = (finite.par_iter().map(|t| t.map(|i| points[i as usize])))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let mut result = Suspicious {
        degenerate: finite.par_iter().filter(|t| !has_area(corners(t))).count() as u64,
        not_finite: (mesh.triangles.len() - finite.len()) as u64,
        duplicate: count_duplicates(&merged),
        ..Suspicious::default()
    };
    count_edges(&merged, &mut result);
    result
}

/// For each vertex the number of its point: vertices at the same position have the same.
fn merge(positions: &[Vec3]) -> Vec<u32> {
    // Adding zero makes one of the two zeros.
    let key = |i: &u32| positions[*i as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(key);
    let mut points = vec![0; positions.len()];
    for (point, run) in order.chunk_by(|a, b| key(a) == key(b)).enumerate() {
        for &vertex in run {
            points[vertex as usize] = point as u32;
        }
    }
    points
}

/// Whether the area is not zero, exactly.
fn has_area(corners: [Vec3; 3]) -> bool {
    fn normal<R: Ring>(corners: [Vec3; 3]) -> [R; 3] {
        let [a, b, c] = corners.map(vector::<R>);
        cross(&zip(&b, &a, R::sub), &zip(&c, &a, R::sub))
    }
    let signs = normal::<Approx>(corners).map(|x| x.signum());
    let certain = signs.iter().any(|sign| matches!(sign, Some(1 | -1)));
    certain || normal::<Dyadic>(corners).iter().any(|x| x.signum() != 0)
}

fn count_duplicates(triangles: &[[u32; 3]]) -> u64 {
    let sorted = triangles.par_iter().map(|t| {
        let mut t = *t;
        t.sort_unstable();
        t
    });
    let mut keys: Vec<[u32; 3]> = sorted.collect();
    keys.par_sort_unstable();
    keys.chunk_by(|a, b| a == b).map(|run| run.len() as u64 - 1).sum()
}

fn count_edges(triangles: &[[u32; 3]], result: &mut Suspicious) {
    // The two points in rising order, and whether the triangle runs from the higher to the lower.
    let edge = |a: u32, b: u32| (a.min(b), a.max(b), a > b);
    let edges = triangles.par_iter().flat_map_iter(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]);
    let mut edges: Vec<(u32, u32, bool)> = edges.collect();
    edges.par_sort_unstable();
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        match run {
            [_] => result.open_edges += 1,
            [one, other] => result.flipped_edges += u64::from(one.2 == other.2),
            _ => result.non_manifold_edges += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    fn with(change: impl FnOnce(&mut Vec<Vec3>, &mut Vec<[u32; 3]>)) -> Suspicious {
        let Mesh { positions, triangles, .. } = tetrahedron();
        let (mut positions, mut triangles) = (positions.to_vec(), triangles.to_vec());
        change(&mut positions, &mut triangles);
        suspicious(&Mesh::new(positions, triangles))
    }

    #[test]
    fn a_closed_mesh_is_clean_and_each_fault_is_found_alone() {
        let clean = Suspicious::default();
        assert_eq!(with(|_, _| ()), clean);
        assert_eq!(with(|_, t| t.truncate(3)), Suspicious { open_edges: 3, ..clean });
        assert_eq!(with(|_, t| t[3] = [1, 3, 2]), Suspicious { flipped_edges: 3, ..clean });
        // Again, with other corners first: its three edges now have three triangles each.
        assert_eq!(with(|_, t| t.push([2, 3, 1])), Suspicious { duplicate: 1, non_manifold_edges: 3, ..clean });
        assert_eq!(with(|_, t| t.push([1, 1, 2])), Suspicious { degenerate: 1, ..clean });
    }

    #[test]
    fn faces_that_cannot_be_hit_leave_holes() {
        let found = with(|p, _| p[3].x = f32::NAN);
        assert_eq!(found, Suspicious { not_finite: 3, open_edges: 3, ..Suspicious::default() });
    }

    #[test]
    fn vertices_are_merged_by_position_and_both_zeros_are_one() {
        let split = with(|p, t| {
            p.push(Vec3::new(-0.0, 0.0, -0.0));
            t[0][0] = 4;
        });
        assert_eq!(split, Suspicious::default());
    }

    #[test]
    fn area_is_judged_exactly() {
        let line = |k: f32| Vec3::new(1.0, 3.0, 5.0) * k;
        assert!(!has_area([line(1.0), line(3.0), line(7.0)]));
        assert!(has_area([line(1.0), line(3.0), line(7.0) + Vec3::X * 1e-6]));
        assert!(has_area([Vec3::ZERO, Vec3::X * 1e-40, Vec3::Y * 1e-40]));
        assert!(!has_area([Vec3::ZERO, Vec3::X * 1e-40, Vec3::X * 1e18]));
    }
}
