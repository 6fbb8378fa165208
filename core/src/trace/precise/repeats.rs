//! Triangles that a mesh holds twice.
//!
//! Faces that were exported twice, or merged from two copies, have the same corners in the same winding. A ray that
//! crosses one crosses the other at the same place and in the same sense, so that what is crossed once is counted
//! twice, and the inside of a closed mesh is its outside. So whoever counts asks a tree without the later ones. (A copy
//! with the other winding stays: two closed bodies that touch face to face have both.)
//!
//! Repeats are looked for among 64-bit hashes of corners, sorted: two million take 16 MB for as long as that lasts, a
//! tenth of a second on two threads. Only where two are the same are the triangles themselves compared. A table of all
//! triangles, the simpler alternative, takes several times both.

use std::collections::HashSet;

use rayon::prelude::*;

use super::{PreciseMesh, PreciseScene, is_traceable};
use crate::math::DVec3;
use crate::once::made_outside;

/// So many triangles are hashed by one thread at a time.
const TOGETHER: usize = 4096;

/// The bits of three corners, the lowest first: the same for all that repeat each other.
type Key = [[u64; 3]; 3];

impl PreciseScene {
    /// The same without triangles that repeat an earlier one of their mesh, with the same corners in the same winding,
    /// for whoever counts: these are never hit there. All others keep their numbers. Found out when it is first asked,
    /// on rayon's current thread pool; a second tree, where there are any.
    pub fn distinct(&self) -> &Self {
        made_outside(&self.distinct, || {
            let meshes = without_repeats(&self.meshes)?;
            // No more triangles, and none that names another corner.
            Self::new(meshes).ok().map(Box::new)
        })
        .as_deref()
        .unwrap_or(self)
    }

    /// Whether [`Self::distinct`] is at hand.
    pub fn knows_distinct(&self) -> bool {
        self.distinct.get().is_some()
    }
}

/// None where nothing is repeated.
fn without_repeats(meshes: &[PreciseMesh]) -> Option<Vec<PreciseMesh>> {
    let repeats: Vec<Vec<u32>> = meshes.iter().map(repeats).collect();
    let is_any = repeats.iter().any(|repeats| !repeats.is_empty());
    is_any.then(|| meshes.iter().zip(repeats).map(|(mesh, repeats)| without(mesh, &repeats)).collect())
}

/// The mesh with triangles that are never hit in place of these.
fn without(mesh: &PreciseMesh, repeats: &[u32]) -> PreciseMesh {
    let mut mesh = mesh.clone();
    if repeats.is_empty() {
        return mesh;
    }
    // Such a corner leaves triangles out of the tree. Where no number is left for it, what has no area is not hit
    // either.
    let nowhere = u32::try_from(mesh.positions.len()).unwrap_or(0);
    mesh.positions.push(DVec3::NAN);
    repeats.iter().for_each(|&i| mesh.triangles[i as usize] = [nowhere; 3]);
    mesh
}

/// The numbers of the triangles that repeat an earlier one.
fn repeats(mesh: &PreciseMesh) -> Vec<u32> {
    let hashes = mesh.triangles.par_iter().with_min_len(TOGETHER).map(|&triangle| hash(mesh, triangle));
    let mut sorted: Vec<u64> = hashes.collect();
    sorted.par_sort_unstable();
    let twice = sorted.windows(2).filter(|pair| pair[0] == pair[1] && pair[0] != NEVER).map(|pair| pair[0]);
    let twice: HashSet<u64> = twice.collect();
    if twice.is_empty() {
        return Vec::new();
    }
    drop(sorted);
    let mut seen = HashSet::new();
    let may_repeat = (0..).zip(&mesh.triangles).filter(|(_, triangle)| twice.contains(&hash(mesh, **triangle)));
    may_repeat.filter(|(_, triangle)| !seen.insert(key(mesh, **triangle))).map(|(i, _)| i).collect()
}

/// Of triangles that are never hit.
const NEVER: u64 = 0;

fn key(mesh: &PreciseMesh, triangle: [u32; 3]) -> Key {
    // Zeros of both signs are one place.
    let [a, b, c] = triangle.map(|i| (mesh.positions[i as usize] + 0.0).to_array().map(f64::to_bits));
    if a <= b && a <= c {
        [a, b, c]
    } else if b <= c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

fn hash(mesh: &PreciseMesh, triangle: [u32; 3]) -> u64 {
    let [a, b, c] = key(mesh, triangle);
    let is_flat = a == b || b == c || c == a;
    if is_flat || !triangle.iter().all(|&i| is_traceable(mesh.positions[i as usize])) {
        return NEVER;
    }
    // Of the numbers' differences, which are many bits apart, a multiplication takes care, and of their order the
    // rotation.
    let mix = |hash: u64, bits: &u64| {
        let mixed = (hash.rotate_left(29) ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^ mixed >> 32
    };
    [a, b, c].iter().flatten().fold(1, mix).max(NEVER + 1)
}
