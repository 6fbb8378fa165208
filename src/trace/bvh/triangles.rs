//! Leaves of triangles: blocks of four, rejected together in f32, decided one by one.
//!
//! The f32 test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants,
//! without FMA. Here it only rejects: a triangle falls out when two edge functions have opposite signs by more than their
//! rounding error. What remains goes to the exact test.

use super::build::{self, Item};
use super::bundle::Bundle;
use super::edges::Edges;
use super::node::Tree;
use super::simd::{Simd, Vector};
use super::{PartId, Through};
use crate::math::{Aabb, UNIT_ROUNDOFF, Vec3, is_traceable};
use crate::ray::{Hit, Ray};
use crate::shape::triangle::{self, Placed};
use crate::trace::nearest::Nearest;
use crate::trace::{Part, Primitives};

/// Triangles in a block.
const LANES: usize = 4;

/// Four triangles, component by component.
#[derive(Clone, Debug)]
struct Block {
    /// Component i of corner k is `corners[3 * k + i]`.
    corners: [[f32; LANES]; 9],
    primitive: [u32; LANES],
    part: [u32; LANES],
    /// A bit for every lane that has a triangle.
    lanes: u32,
}

/// All triangles of a level.
pub(super) struct TriangleTree {
    tree: Tree,
    blocks: Vec<Block>,
    parts: Vec<PartId>,
}

impl TriangleTree {
    /// Over the traceable triangles of `parts`.
    pub fn build(parts: &[Part]) -> Self {
        let mut items = Vec::with_capacity(parts.iter().map(|part| part.primitives.len()).sum());
        for (p, part) in parts.iter().enumerate() {
            let Primitives::Triangles { positions, triangles } = &part.primitives else { continue };
            for (i, corners) in triangles.iter().enumerate() {
                let corners = corners.map(|i| positions[i as usize]);
                if corners.iter().all(|&corner| is_traceable(corner)) {
                    items.push(Item { bounds: Aabb::around(corners), part: p as u32, primitive: i as u32 });
                }
            }
        }
        let mut tree = build::build(&mut items, LANES);
        let mut blocks = Vec::with_capacity(items.len() / 3);
        tree.rename_leaves(|first, count| {
            let leaf = &items[first as usize..first as usize + count as usize];
            let first_block = blocks.len() as u32;
            blocks.extend(leaf.chunks(LANES).map(|items| Block::new(parts, items)));
            (first_block, leaf.len().div_ceil(LANES) as u8)
        });
        let parts = parts.iter().map(|part| PartId { geometry: part.geometry, instance: part.instance }).collect();
        Self { tree, blocks, parts }
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.blocks[..]) + size_of_val(&self.parts[..])
    }

    /// Offers what `ray` (in the world) hits in a leaf; `filter` is of the ray in this level's coordinates.
    #[inline(always)]
    pub fn offer_leaf<S: Simd>(
        &self,
        first: u32,
        count: u8,
        ray: &Ray,
        filter: &Filter,
        through: Option<Through<'_>>,
        nearest: &mut Nearest,
    ) {
        for block in &self.blocks[first as usize..first as usize + usize::from(count)] {
            let mut candidates = filter.candidates::<S>(block);
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                self.offer(block, lane, ray, through, nearest);
            }
        }
    }

    /// Offers what `ray` hits of one triangle: lane `id % 4` of block `id / 4`.
    #[inline]
    pub fn offer_one(&self, id: u32, ray: &Ray, nearest: &mut Nearest) {
        self.offer(&self.blocks[id as usize / LANES], id as usize % LANES, ray, None, nearest);
    }

    /// The hit of `ray` with a triangle that it is known to hit, numbered as in [`Self::offer_one`].
    #[inline(always)]
    pub fn hit_one(&self, id: u32, ray: &Ray) -> Option<(f64, Hit)> {
        let (block, lane) = (&self.blocks[id as usize / LANES], id as usize % LANES);
        let hit = triangle::intersect_inside(ray, &block.triangle(lane))?;
        let PartId { geometry, instance } = self.parts[block.part[lane] as usize];
        let (t, u, v) = (hit.t as f32, hit.u as f32, hit.v as f32);
        Some((hit.t, Hit { t, u, v, primitive: block.primitive[lane], geometry, instance }))
    }

    /// The triangles of a block that some ray of the bundle may hit up to `most`, as a bit mask, and their edges.
    #[inline(always)]
    pub fn edges<S: Simd>(&self, block: u32, bundle: &Bundle, most: f32) -> (u32, Edges) {
        let block = &self.blocks[block as usize];
        let (lanes, edges) = Edges::new::<S>(&block.corners, bundle, most);
        (lanes & block.lanes, edges)
    }

    #[inline]
    fn offer(&self, block: &Block, lane: usize, ray: &Ray, through: Option<Through<'_>>, nearest: &mut Nearest) {
        let corners = block.triangle(lane);
        let part = self.parts[block.part[lane] as usize];
        let (hit, instance) = match through {
            None => (triangle::intersect(ray, &corners), part.instance),
            Some(Through { instance, to_world }) => (triangle::intersect(ray, &Placed { corners, to_world }), instance),
        };
        if let Some(hit) = hit {
            let (primitive, geometry) = (block.primitive[lane], part.geometry);
            let (t, u, v) = (hit.t as f32, hit.u as f32, hit.v as f32);
            nearest.offer(hit.t, Hit { t, u, v, primitive, geometry, instance });
        }
    }
}

impl Block {
    fn new(parts: &[Part], items: &[Item]) -> Self {
        let mut block = Self { corners: [[0.0; LANES]; 9], primitive: [0; LANES], part: [0; LANES], lanes: 0 };
        for (lane, item) in items.iter().enumerate() {
            let Primitives::Triangles { positions, triangles } = &parts[item.part as usize].primitives else {
                unreachable!("items of a triangle tree come from meshes")
            };
            for (k, &corner) in triangles[item.primitive as usize].iter().enumerate() {
                for axis in 0..3 {
                    block.corners[3 * k + axis][lane] = positions[corner as usize][axis];
                }
            }
            block.primitive[lane] = item.primitive;
            block.part[lane] = item.part;
            block.lanes |= 1 << lane;
        }
        block
    }

    #[inline(always)]
    fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &self.corners;
        [
            Vec3::new(ax[lane], ay[lane], az[lane]),
            Vec3::new(bx[lane], by[lane], bz[lane]),
            Vec3::new(cx[lane], cy[lane], cz[lane]),
        ]
    }
}

/// A ray made ready for the f32 reject test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    /// Axes such that the direction is largest along the third.
    axes: [usize; 3],
    /// Origin, in the order of `axes`.
    origin: [f32; 3],
    /// Direction along the first two axes over that along the third; at most 1 in magnitude.
    shear: [f32; 2],
    /// Error of a sheared component, relative to the largest component of a corner relative to the origin.
    error: f32,
    /// Added to that largest component: how far the origin itself may be off, in its own roundings.
    blur: f32,
}

impl Filter {
    /// `blur` is by how much more than its own rounding the ray may be off (1: not at all).
    #[inline(always)]
    pub fn new(ray: &Ray, blur: f32) -> Self {
        let d = ray.direction.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let (direction, origin) = (ray.direction.to_array(), ray.origin.to_array());
        let along = direction[z];
        Self {
            axes,
            origin: axes.map(|axis| origin[axis]),
            shear: [direction[axes[0]] / along, direction[axes[1]] / along],
            error: 8.0 * UNIT_ROUNDOFF * blur,
            blur: if blur > 1.0 { ray.origin.abs().max_element() } else { 0.0 },
        }
    }

    /// A bit for every triangle that the ray's line may pass.
    ///
    /// With L the largest component of the corners relative to the origin and S the largest after the shear, a sheared
    /// component errs by e = 8 u L (a subtraction, a quotient, a product and a subtraction, of magnitudes up to L
    /// each), an edge function by 4 e S + 2 e^2 and its own rounding 4 u S^2.
    #[inline(always)]
    fn candidates<S: Simd>(&self, block: &Block) -> u32 {
        let splat = S::V4::splat;
        let [kx, ky, kz] = self.axes;
        let mut x = [splat(0.0); 3];
        let mut y = [splat(0.0); 3];
        let mut largest = splat(self.blur);
        let mut sheared = splat(0.0);
        for k in 0..3 {
            let px = S::V4::load(&block.corners[3 * k + kx]).sub(splat(self.origin[0]));
            let py = S::V4::load(&block.corners[3 * k + ky]).sub(splat(self.origin[1]));
            let pz = S::V4::load(&block.corners[3 * k + kz]).sub(splat(self.origin[2]));
            largest = largest.max(px.abs()).max(py.abs().max(pz.abs()));
            x[k] = px.sub(pz.mul(splat(self.shear[0])));
            y[k] = py.sub(pz.mul(splat(self.shear[1])));
            sheared = sheared.max(x[k].abs().max(y[k].abs()));
        }
        let edge = |a: usize, b: usize| x[a].mul(y[b]).sub(y[a].mul(x[b]));
        let (u, v, w) = (edge(2, 1), edge(0, 2), edge(1, 0));
        let e = largest.mul(splat(self.error));
        // The sum doubled against rounding of the bound; a constant against underflow.
        let edges = e.mul(sheared.mul(splat(8.0)).add(e.mul(splat(4.0))));
        let own = sheared.mul(sheared).mul(splat(8.0 * UNIT_ROUNDOFF));
        let bound = edges.add(own).add(splat(1e-36));
        let low = u.min(v).min(w).add(bound);
        let high = u.max(v).max(w).sub(bound);
        let zero = splat(0.0);
        // Whatever overflowed is not rejected.
        let outside = low.less(zero) & zero.less(high);
        !outside & block.lanes
    }
}
