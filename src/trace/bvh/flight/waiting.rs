//! Rays yet to set out, and lists of those that are on their way.

use super::RAYS;
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::place::Blur;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::slab::{self, ReadyRay};

/// Numbers of travellers.
#[derive(Clone, Copy)]
pub(super) struct List {
    slots: [u8; RAYS],
    len: usize,
}

impl List {
    pub const EMPTY: Self = Self { slots: [0; RAYS], len: 0 };

    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    #[inline(always)]
    pub fn push(&mut self, slot: u8) {
        self.slots[self.len % RAYS] = slot;
        self.len += 1;
    }

    #[inline(always)]
    pub fn iter(&self) -> impl Iterator<Item = u8> {
        self.slots[..self.len.min(RAYS)].iter().copied()
    }
}

/// Rays yet to set out, made ready eight at a time.
pub(super) struct Waiting<'a> {
    rays: &'a [Ray],
    reach: Vec3,
    blur: Blur,
    ready: [ReadyRay; 8],
    valid: u32,
    next: usize,
}

impl<'a> Waiting<'a> {
    pub fn new(rays: &'a [Ray], reach: Vec3, blur: Blur) -> Self {
        Self { rays, reach, blur, ready: [ReadyRay::NONE; 8], valid: 0, next: 0 }
    }

    /// The number of the next valid ray.
    #[inline(always)]
    pub fn next<S: Simd>(&mut self) -> Option<usize> {
        while self.next < self.rays.len() {
            let index = self.next;
            if index.is_multiple_of(8) {
                match self.rays[index..].first_chunk() {
                    Some(eight) => (self.ready, self.valid) = slab::ready::<S>(eight, self.reach, self.blur),
                    None => {
                        let some = &self.rays[index..];
                        let mut eight = [some[0]; 8];
                        eight[..some.len()].copy_from_slice(some);
                        (self.ready, self.valid) = slab::ready::<S>(&eight, self.reach, self.blur);
                    }
                }
            }
            self.next += 1;
            if self.valid >> (index % 8) & 1 != 0 {
                return Some(index);
            }
        }
        None
    }

    /// The one that came last.
    #[inline(always)]
    pub fn ready(&self) -> &ReadyRay {
        &self.ready[self.next.wrapping_sub(1) % 8]
    }
}
