//! Eight rays of a packet against one triangle after the other, and what they have hit.
//!
//! A lane a ray, so that a triangle is looked at once for all of them. What is in doubt is told, a bit a ray; the
//! caller decides it as for a single ray ([`Found`](crate::trace::bvh::hits::found::Found)).

use super::{Packet, RAYS};
use crate::trace::bvh::block::Block;
use crate::trace::bvh::hits::found::NONE;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::planes;
use crate::trace::bvh::reject::woop::{self, Aim, Judged, Margin, SLACK, Sheared, Sides};
use crate::trace::bvh::simd::{Array, Mask, Vector};

/// Eight rays made ready for triangles, and what they have hit so far.
#[derive(Clone, Copy)]
pub(super) struct Octet<V> {
    /// In the order of the beam's axes.
    origin: [V; 3],
    /// Direction along the first two axes over that along the third, negative.
    shear: [V; 2],
    margin: Margin<V>,
    aim: Aim<V>,
    tmin: V,
    /// No hit beyond this is wanted; rounded up. Minus infinity for a ray that wants none any more.
    pub limit: [f32; RAYS],
    /// A hit nearer than this is the nearest for sure; likewise.
    pub sure: [f32; RAYS],
    /// Bits of the number of a triangle that was found without doubt, but not computed yet: block and lane.
    noted: [f32; RAYS],
    /// A bit for each ray that is asked for.
    asked: u32,
    /// A bit for each ray that has a hit noted, or where any will do that was decided to have one.
    pub hit: u32,
}

/// `limit` and `sure` of a ray that wants no more.
const DONE: f32 = f32::NEG_INFINITY;

/// What a triangle did.
pub(super) struct Met {
    /// Whether a limit has changed.
    pub changed: bool,
    /// A bit for each ray of which it is in doubt.
    pub open: u32,
    /// And for each that hits it for sure: only the order is.
    pub sure: u32,
}

impl Met {
    const NOTHING: Self = Self { changed: false, open: 0, sure: 0 };
}

impl<V: Vector + Array<RAYS>> Octet<V> {
    /// No ray.
    #[inline(always)]
    pub fn nothing() -> Self {
        let zero = V::splat(0.0);
        Self {
            origin: [zero; 3],
            shear: [zero; 2],
            margin: Margin { width: zero, of_depth: zero, of_size: zero },
            aim: Aim { against: zero, shorten: zero, begin: zero },
            tmin: zero,
            limit: [DONE; RAYS],
            sure: [DONE; RAYS],
            noted: [f32::from_bits(NONE); RAYS],
            asked: 0,
            hit: 0,
        }
    }

    /// Takes the rays of a packet: in place, as it is large for a value that is returned.
    #[inline(always)]
    pub fn fill(&mut self, packet: &Packet, lanes: u32, axes: [usize; 3]) {
        let [x, y, z] = axes;
        self.origin = [V::load(&packet.origin[x]), V::load(&packet.origin[y]), V::load(&packet.origin[z])];
        let [dx, dy, along] =
            [V::load(&packet.direction[x]), V::load(&packet.direction[y]), V::load(&packet.direction[z])];
        let reciprocal = V::splat(1.0).div(along);
        let negative = V::splat(0.0).sub(reciprocal);
        let shear = [dx.mul(negative), dy.mul(negative)];
        let (tmin, tmax) = (V::load(&packet.tmin).max(V::splat(0.0)), V::load(&packet.tmax));
        (self.shear, self.tmin) = (shear, tmin);
        self.margin = Margin::new(shear[0].abs().max(shear[1].abs()).add(V::splat(1.0)), V::splat(0.0));
        self.aim = Aim {
            against: V::splat(0.0).sub(along),
            shorten: reciprocal.abs(),
            begin: tmin.mul(along.abs()).mul(V::splat(1.0 - SLACK)),
        };
        // Rounded up, for t is rounded before it is held against it.
        self.limit = tmax.mul_add(V::splat(1.0 + SLACK), V::splat(f32::MIN_POSITIVE)).to_array();
        // As of single rays.
        self.sure = tmax.min(V::splat(f32::MAX)).to_array();
        self.asked = lanes;
        if lanes != 0xff {
            super::each(!lanes).for_each(|lane| self.finish(lane));
        }
    }

    /// One triangle, lane `lane` of a block; `id` is its number.
    #[inline(always)]
    pub fn meet<Q: Query>(&mut self, [kx, ky, kz]: [usize; 3], block: &Block, lane: usize, id: u32) -> Met {
        let splat = V::splat;
        let [ox, oy, oz] = self.origin;
        let [sx, sy] = self.shear;
        let (mut x, mut y, mut z) = ([ox; 3], [oy; 3], [oz; 3]);
        for k in 0..3 {
            z[k] = oz.sub(splat(block.corners[kz][k][lane]));
            x[k] = z[k].mul_add(sx, ox.sub(splat(block.corners[kx][k][lane])));
            y[k] = z[k].mul_add(sy, oy.sub(splat(block.corners[ky][k][lane])));
        }
        let size = splat(block.size);
        let sides = Sides::new(&Sheared { x, y, z }, &self.margin, size, None);
        let passed = sides.passed() & self.asked;
        if passed == 0 {
            return Met::NOTHING;
        }
        let judged = woop::judge::<V, false, false>(
            &sides,
            &self.aim,
            V::load(&self.limit),
            size,
            passed,
            Blur::NONE,
            #[inline(always)]
            || {
                let corners = [along(block, lane, kx), along(block, lane, ky), along(block, lane, kz)];
                planes::heights(corners, [ox, oy, oz], 0.0)
            },
        );
        let Some(Judged { lanes, sure, low, high }) = judged else { return Met::NOTHING };
        let (limit, before) = (V::load(&self.limit), V::load(&self.sure));
        let nearest = sure.and(self.tmin.at_most(low)).and(high.at_most(before));
        let beyond = sure.and(limit.less(low));
        let taken = nearest.bits();
        if taken != 0 {
            let (low, high) = if Q::ANY { (splat(DONE), splat(DONE)) } else { (low, high) };
            V::select(nearest, high, limit).overwrite(&mut self.limit);
            V::select(nearest, low, before).overwrite(&mut self.sure);
            V::select(nearest, splat(f32::from_bits(id)), V::load(&self.noted)).overwrite(&mut self.noted);
            self.hit |= taken;
        }
        Met { changed: taken != 0, open: lanes & !taken & !beyond.bits(), sure: sure.bits() }
    }

    /// What is noted for a ray.
    pub fn noted(&self, lane: usize) -> u32 {
        self.noted[lane % RAYS].to_bits()
    }

    /// What is noted for each ray.
    #[inline(always)]
    pub fn all_noted(&self) -> [u32; RAYS] {
        bytemuck::cast(self.noted)
    }

    /// Notes another triangle for a ray that has one noted, in the same plane.
    pub fn note(&mut self, lane: usize, id: u32) {
        self.noted[lane % RAYS] = f32::from_bits(id);
    }

    /// What was noted for a ray has been computed.
    pub fn forget(&mut self, lane: usize) {
        self.noted[lane % RAYS] = f32::from_bits(NONE);
        self.hit &= !(1 << lane);
    }

    /// A ray that wants no more.
    pub fn finish(&mut self, lane: usize) {
        (self.limit[lane % RAYS], self.sure[lane % RAYS]) = (DONE, DONE);
    }
}

/// One component of a triangle's corners.
#[inline(always)]
fn along<V: Vector>(block: &Block, lane: usize, axis: usize) -> [V; 3] {
    let [a, b, c] = &block.corners[axis];
    [V::splat(a[lane]), V::splat(b[lane]), V::splat(c[lane])]
}
