//! The meshes of a level, their triangles numbered through.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::block::Block;
use crate::math::{Aabb, Vec3, is_traceable};
use crate::trace::{Part, Primitives};

/// Meshes, shared with the scene.
#[derive(Clone)]
pub(super) struct Meshes {
    meshes: Vec<Mesh>,
    /// Of each part its mesh, if it is one.
    of_part: Vec<u32>,
    /// Triangles of all.
    count: usize,
}

/// Triangles gone through by one thread at a time.
const STRETCH: usize = 1 << 14;

/// Meshes of a few triangles gone through by one thread at a time: to share out each by itself would take longer than
/// to go through it.
const TOGETHER: usize = 64;

/// A mesh and its numbers.
#[derive(Clone)]
pub(super) struct Mesh {
    /// Number of its first triangle.
    pub first: u32,
    pub part: u32,
    pub positions: Arc<Vec<Vec3>>,
    pub triangles: Arc<Vec<[u32; 3]>>,
}

impl Mesh {
    /// The corners of a triangle.
    #[inline(always)]
    pub fn corners(&self, primitive: u32) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[primitive as usize];
        let positions = &self.positions[..];
        [positions[a as usize], positions[b as usize], positions[c as usize]]
    }
}

impl Meshes {
    /// Those among `parts`, which have fewer than 2^32 triangles together.
    pub fn new(parts: &[Part]) -> Self {
        let mut all = Self { meshes: Vec::new(), of_part: vec![0; parts.len()], count: 0 };
        let mut first = 0;
        for (part, description) in parts.iter().enumerate() {
            let Primitives::Triangles { positions, triangles } = &description.primitives else { continue };
            let (positions, triangles) = (Arc::clone(positions), Arc::clone(triangles));
            let len = triangles.len();
            all.of_part[part] = all.meshes.len() as u32;
            all.meshes.push(Mesh { first: first as u32, part: part as u32, positions, triangles });
            first += len;
        }
        assert!(u32::try_from(first).is_ok(), "more triangles than 32-bit indices can name");
        all.count = first;
        all
    }

    /// All triangles in stretches of a mesh, each with how many it has: what all threads make something of.
    pub fn stretches(&self) -> Vec<(usize, (&Mesh, Range<u32>))> {
        let of = |mesh: &'_ Mesh| {
            let len = mesh.triangles.len();
            (0..len).step_by(STRETCH).map(move |first| first as u32..len.min(first + STRETCH) as u32)
        };
        let of = |mesh| of(mesh).map(move |range: Range<u32>| (range.len(), (mesh, range)));
        self.meshes.iter().flat_map(of).collect()
    }

    /// How many triangles can be hit.
    pub fn traceable_count(&self) -> usize {
        let of = |(_, (mesh, range)): (usize, (&Mesh, Range<u32>))| {
            range.filter(|&i| mesh.corners(i).into_iter().all(is_traceable)).count()
        };
        let stretches = self.stretches();
        let together = (STRETCH * stretches.len() / self.count.max(1)).clamp(1, TOGETHER);
        stretches.into_par_iter().with_min_len(together).map(of).sum()
    }

    /// The box around all vertices, those of no triangle among them, that are numbers.
    pub fn bounds(&self) -> Aabb {
        let include = |bounds: Aabb, &p: &Vec3| if is_traceable(p) { bounds.include(p) } else { bounds };
        let around = |positions: &[Vec3]| positions.iter().fold(Aabb::EMPTY, include);
        let of = |mesh: &Mesh| mesh.positions.par_chunks(STRETCH).map(around).reduce(|| Aabb::EMPTY, Aabb::union);
        self.meshes.par_iter().with_min_len(TOGETHER).map(of).reduce(|| Aabb::EMPTY, Aabb::union)
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.count
    }

    /// Bytes of all vertices and triangles.
    pub fn bytes(&self) -> usize {
        self.meshes.iter().map(|mesh| size_of_val(&mesh.positions[..]) + size_of_val(&mesh.triangles[..])).sum()
    }

    /// The mesh that a part is.
    #[inline(always)]
    pub fn of_part(&self, part: u32) -> &Mesh {
        &self.meshes[self.of_part[part as usize] as usize]
    }

    /// The number of a triangle.
    #[inline(always)]
    pub fn number(&self, part: u32, primitive: u32) -> u32 {
        self.of_part(part).first + primitive
    }

    /// The number of a triangle, if there is one by these names.
    pub fn checked_number(&self, part: u32, primitive: u32) -> Option<u32> {
        let mesh = self.meshes.get(*self.of_part.get(part as usize)? as usize)?;
        (mesh.part == part && (primitive as usize) < mesh.triangles.len()).then(|| mesh.first + primitive)
    }

    /// The mesh of a triangle, and the triangle's index in it.
    #[inline(always)]
    pub fn find(&self, number: u32) -> (&Mesh, u32) {
        let mesh = match &self.meshes[..] {
            [mesh] => mesh,
            meshes => &meshes[meshes.partition_point(|mesh| mesh.first <= number) - 1],
        };
        (mesh, number - mesh.first)
    }

    /// As [`Self::find`], where the mesh is likely to be `last`, of which the last one was.
    #[inline(always)]
    pub fn find_near<'a>(&'a self, number: u32, last: &mut &'a Mesh) -> (&'a Mesh, u32) {
        if number.wrapping_sub(last.first) as usize >= last.triangles.len() {
            *last = self.find(number).0;
        }
        (last, number - last.first)
    }

    /// Adds a triangle to a block.
    #[inline(always)]
    pub fn push(&self, block: &mut Block, number: u32) {
        let (mesh, primitive) = self.find(number);
        block.push(mesh.corners(primitive), mesh.part, primitive);
    }
}
