//! A bundle meets a block of eight triangles: pairs of a triangle and a group of rays, one after the other in one loop
//! without branches.
//!
//! Which rows of rays may see which triangles is told for all of them at once, by
//! [`Footprints`](super::footprint::Footprints). A loop over the triangles, in it one over each one's groups, in it a
//! branch for a group that misses and another for one that hits, was ended or taken nobody could tell when: what such a
//! branch has let begin in vain is known late, and took as long as all that was computed. Now whatever a pair may need
//! is computed of every pair, but for triangles of which a bundle sees both sides. A hit without doubt is noted in
//! place; what is left in doubt is kept in a row, and decided when all pairs are through.

use super::edges::Edges;
use super::found::DONE;
use super::pencil::Pencil;
use super::rays::{Bundle, TINY};
use super::rows;
use super::walk::Walk;
use crate::trace::bvh::block::LANES;
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::isa::Kernel;
use crate::trace::bvh::simd::{Group, Mask, Simd, Vector, axes};

/// Block `index` of a leaf that rays of these rows enter, before `most`.
pub(super) struct Meeting<'a, 'b, Q, P> {
    pub walk: &'a mut Walk<'b, Q, P>,
    pub index: u32,
    pub rows: u32,
    pub most: f32,
}

impl<Q: Query, P: Pencil> Kernel for Meeting<'_, '_, Q, P> {
    /// Whether a limit has changed.
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { walk, index, rows, most } = self;
        let (tree, bundle, mut scratch) = (walk.tree, walk.bundle, None);
        let block = tree.block::<S>(index, &mut scratch);
        let Some((lanes, edges)) = P::edges::<S>(block, bundle, most) else { return false };
        // A byte for each triangle, in it a bit for each row.
        let seen = P::footprints::<S>(&block.corners, bundle).rows::<S>(&bundle.rows);
        let wanted = (u64::from(rows & 0xff) * 0x0101_0101_0101_0101) & rows::bytes(lanes);
        let seen = seen & wanted;
        let vague = seen & rows::bytes(edges.is_vague);
        let first = LANES as u32 * index;
        let changed = walk.meet::<S>(&edges, first, Pairs::new::<S>(seen & !vague));
        changed | (vague != 0 && walk.meet_vague::<S>(&edges, first, Pairs::new::<S>(vague)))
    }
}

/// Pairs of a triangle and a group of rays: a byte for each triangle, in it a bit for the first row of each group.
struct Pairs(u64);

impl Pairs {
    /// Of a byte for each triangle, in it a bit for each row.
    #[inline(always)]
    const fn new<S: Simd>(rows: u64) -> Self {
        Self(if S::Wide::LANES == 16 { (rows | rows >> 1) & 0x5555_5555_5555_5555 } else { rows })
    }
}

impl Iterator for Pairs {
    type Item = Pair;

    #[inline(always)]
    fn next(&mut self) -> Option<Pair> {
        let pair = Pair(self.0.trailing_zeros() as u16);
        (self.0 != 0).then(
            #[inline(always)]
            || {
                self.0 &= self.0 - 1;
                pair
            },
        )
    }
}

/// One of them: which bit it is.
#[derive(Clone, Copy)]
struct Pair(u16);

impl Pair {
    #[inline(always)]
    fn lane(self) -> usize {
        usize::from(self.0) / 8 % LANES
    }

    #[inline(always)]
    fn group<S: Simd>(self) -> usize {
        usize::from(self.0) % 8 / (S::Wide::LANES / 8)
    }

    /// The edge functions.
    #[inline(always)]
    fn sides<S: Simd>(self, edges: &Edges, bundle: &Bundle) -> [S::Wide; 3] {
        [self.along::<S>(edges, 0, bundle), self.along::<S>(edges, 1, bundle), self.along::<S>(edges, 2, bundle)]
    }

    /// The scalar product of normal k with (p, q, 1).
    #[inline(always)]
    fn along<S: Simd>(self, edges: &Edges, k: usize, bundle: &Bundle) -> S::Wide {
        let (p, q) =
            (S::Wide::at(&bundle.across[0], self.group::<S>()), S::Wide::at(&bundle.across[1], self.group::<S>()));
        let [x, y, z] = self.normal::<S>(edges, k);
        p.mul_add(x, q.mul_add(y, z))
    }

    #[inline(always)]
    fn normal<S: Simd>(self, edges: &Edges, k: usize) -> [S::Wide; 3] {
        let ([x, y, z], lane) = (&edges.normals[k], self.lane());
        [S::Wide::splat(x[lane]), S::Wide::splat(y[lane]), S::Wide::splat(z[lane])]
    }
}

/// A pair of which a bit is set for each ray that is in doubt.
#[derive(Clone, Copy)]
struct Doubt {
    pair: Pair,
    open: u16,
}

/// Of eight triangles and eight groups.
const MAX_PAIRS: usize = 64;

impl<Q: Query, P: Pencil> Walk<'_, Q, P> {
    /// Triangles of the block whose first is `first`, whose fronts all rays see; true where a limit has changed.
    #[inline(always)]
    fn meet<S: Simd>(&mut self, edges: &Edges, first: u32, pairs: Pairs) -> bool {
        let (splat, zero) = (S::Wide::splat, S::Wide::splat(0.0));
        let (bundle, found) = (self.bundle, &mut *self.found);
        let (first_t, place) = (splat(bundle.first), splat(f32::from_bits(self.place)));
        let (mut doubts, mut count) = ([Doubt { pair: Pair(0), open: 0 }; MAX_PAIRS], 0);
        let mut hit = zero.less(zero);
        for pair in pairs {
            let (lane, group) = (pair.lane(), pair.group::<S>());
            let [u, v, w] = pair.sides::<S>(edges, bundle);
            let (least, bound) = (u.min(v).min(w), splat(edges.edge_error[lane]));
            let inside = zero.sub(bound).at_most(least);
            let [low, high] = P::depths(edges, lane, pair.along::<S>(edges, 3, bundle));
            let (limit, before) = (S::Wide::at(&found.limit, group), S::Wide::at(&found.sure, group));
            let in_range = high.less(before).and(S::Wide::at(&bundle.begin, group).less(low));
            let sure = bound.less(least).and(in_range);
            let outside = limit.less(low).or(high.less(first_t));
            let open = inside.without(sure).without(outside).bits();
            let (low, high) = if Q::ANY { (splat(DONE), splat(DONE)) } else { (low, high) };
            high.put_where(sure, &mut found.limit.0, group);
            low.put_where(sure, &mut found.sure.0, group);
            if !Q::ANY {
                let id = splat(f32::from_bits(first + lane as u32));
                id.put_where(sure, bytemuck::cast_mut(&mut found.noted), group);
            }
            // What is fixed comes first, when nothing else is noted yet.
            if !Q::ANY && self.place != FIXED {
                place.put_where(sure, bytemuck::cast_mut(&mut found.place), group);
            }
            hit = hit.or(sure);
            doubts[count % MAX_PAIRS] = Doubt { pair, open: open as u16 };
            count += usize::from(open != 0);
        }
        let mut changed = hit.bits() != 0;
        for &Doubt { pair, open } in &doubts[..count.min(MAX_PAIRS)] {
            let mut open = open.into();
            if P::IS_PARALLEL || self.bundle.is_turned {
                open &= !self.behind_starts::<S>(edges, pair);
            }
            if !Q::ANY {
                let sure = open & self.inside::<S>(edges, pair);
                if sure != 0 {
                    open &= !self.settle(first + pair.lane() as u32, pair.group::<S>() * S::Wide::LANES, sure);
                }
            }
            changed |= self.decide_all::<S>(first, pair, open);
        }
        changed
    }

    /// Triangles of which rays may see either side: where signs agree, it is decided at once. They are so few that
    /// branches do no harm.
    #[inline(always)]
    fn meet_vague<S: Simd>(&mut self, edges: &Edges, first: u32, pairs: Pairs) -> bool {
        let mut changed = false;
        for pair in pairs {
            let [u, v, w] = pair.sides::<S>(edges, self.bundle);
            let bound = S::Wide::splat(edges.edge_error[pair.lane()]);
            let below = S::Wide::splat(0.0).sub(bound);
            let open = below.at_most(u.min(v).min(w)).or(u.max(v).max(w).at_most(bound)).bits();
            changed |= self.decide_all::<S>(first, pair, open);
        }
        changed
    }

    #[inline(always)]
    fn decide_all<S: Simd>(&mut self, first: u32, pair: Pair, mut open: u32) -> bool {
        let mut changed = false;
        while open != 0 {
            let ray = pair.group::<S>() * S::Wide::LANES + open.trailing_zeros() as usize;
            open &= open - 1;
            changed |= self.decide(ray, first + pair.lane() as u32);
        }
        changed
    }

    /// A bit for each ray that passes within the triangle for sure.
    #[inline(always)]
    fn inside<S: Simd>(&self, edges: &Edges, pair: Pair) -> u32 {
        let [u, v, w] = pair.sides::<S>(edges, self.bundle);
        S::Wide::splat(edges.edge_error[pair.lane()]).less(u.min(v).min(w)).bits()
    }

    /// A bit for each ray with an origin of its own, as those of turned and of parallel bundles, that starts beyond the
    /// triangle's plane.
    #[inline(always)]
    fn behind_starts<S: Simd>(&self, edges: &Edges, pair: Pair) -> u32 {
        let (splat, lane, group) = (S::Wide::splat, pair.lane(), pair.group::<S>());
        let corner = [splat(edges.corner[0][lane]), splat(edges.corner[1][lane]), splat(edges.corner[2][lane])];
        let n = pair.normal::<S>(edges, 3);
        let ([x, y, z], n) = if P::IS_PARALLEL {
            let [a, b, c] = &self.bundle.start;
            let start = [S::Wide::at(a, group), S::Wide::at(b, group), S::Wide::at(c, group)];
            // Turned so that the product is more than 0 where the plane lies behind.
            let back = [corner[0].sub(start[0]), corner[1].sub(start[1]), start[2].sub(corner[2])];
            (back, [n[0], n[1], splat(edges.facing[lane])])
        } else {
            let [p, q, along] = axes(self.bundle.axis);
            let direction = &self.bundle.direction;
            // The bundle's direction is the given one, turned round.
            let x = corner[0].add(S::Wide::at(&direction[p], group));
            let y = corner[1].add(S::Wide::at(&direction[q], group));
            let z = S::Wide::at(&direction[along], group).mul_add(splat(self.bundle.forward), corner[2]);
            ([x, y, z], n)
        };
        let side = x.mul(n[0]).add(y.mul(n[1])).add(z.mul(n[2]));
        let size = x.abs().add(y.abs()).add(z.abs());
        let steep = n[0].abs().add(n[1].abs()).add(n[2].abs());
        let error = size.mul_add(splat(edges.normal_error[lane]), steep.mul(splat(edges.corner_error[lane])));
        // A length of a ray may leave f32 where those of the bundle do not: then nothing is known.
        error.add(splat(TINY)).less(side).and(side.less(splat(f32::INFINITY))).bits()
    }
}
