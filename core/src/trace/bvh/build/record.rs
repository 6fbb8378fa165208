//! What the builder moves about: a box and whose it is, in 32 bytes.

use rayon::prelude::*;

use crate::math::{Aabb, Vec3, is_traceable};
use crate::memory::room;
use crate::trace::bvh::meshes::Meshes;

/// A box as [-min, max]: one eight-wide maximum joins two of them (Fuetterling, Lojewski, Pfreundt, Hamann, Ebert 2017,
/// *Accelerated single ray tracing for wide vector units*, among others). Lanes 3 and 7 carry two numbers that are not
/// f32; whatever is computed of them is never looked at.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(in crate::trace::bvh) struct Record(pub [f32; 8]);

/// Lane of the primitive's number.
const PRIMITIVE: usize = 3;
/// Lane of the part's number.
const PART: usize = 7;

/// The box of nothing, as [-min, max].
pub(super) const EMPTY: [f32; 8] = [f32::NEG_INFINITY; 8];

impl Record {
    /// `bounds` is not empty.
    #[inline(always)]
    pub fn new(bounds: &Aabb, part: u32, primitive: u32) -> Self {
        // 0 - x and x + 0 are never -0, so that joining boxes in another order gives the same bits.
        let (low, high) = (Vec3::ZERO - bounds.min, bounds.max + Vec3::ZERO);
        Self([low.x, low.y, low.z, f32::from_bits(primitive), high.x, high.y, high.z, f32::from_bits(part)])
    }

    /// Of something that cannot be hit, to be dropped.
    pub const NOTHING: Self = Self(EMPTY);

    /// Whether it is [`Record::NOTHING`].
    pub fn is_nothing(&self) -> bool {
        self.0[0] == f32::NEG_INFINITY
    }

    /// The box.
    pub fn bounds(&self) -> Aabb {
        aabb(&self.0)
    }

    /// Index in its part.
    #[inline(always)]
    pub fn primitive(&self) -> u32 {
        self.0[PRIMITIVE].to_bits()
    }

    /// Index of the part.
    #[inline(always)]
    pub fn part(&self) -> u32 {
        self.0[PART].to_bits()
    }
}

/// The box as others know it.
#[inline(always)]
pub(super) fn aabb(bounds: &[f32; 8]) -> Aabb {
    let &[x, y, z, _, max_x, max_y, max_z, _] = bounds;
    Aabb { min: Vec3::new(0.0 - x, 0.0 - y, 0.0 - z), max: Vec3::new(max_x, max_y, max_z) }
}

/// One item for each traceable triangle of `meshes`, in order.
pub(in crate::trace::bvh) fn triangle_items(meshes: &Meshes) -> Vec<Record> {
    let mut items = room::fill(meshes.stretches(), |(mesh, range), room| {
        for i in range {
            let corners = mesh.corners(i);
            room.push(if corners.into_iter().all(is_traceable) {
                Record::new(&Aabb::around(corners), mesh.part, i)
            } else {
                Record::NOTHING
            });
        }
    });
    if items.par_iter().with_min_len(room::few::<Record>()).any(Record::is_nothing) {
        items.retain(|item| !item.is_nothing());
    }
    items
}
