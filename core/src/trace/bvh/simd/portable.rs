//! What every processor has that the program was compiled for: SSE2 on x86-64, plain arrays elsewhere.

#[cfg(not(target_arch = "x86_64"))]
use super::arrays::transpose;
use super::isa::{self, Kernel};
#[cfg(target_arch = "x86_64")]
use super::sse2::{D4, V4, V8, transpose};
use super::{Array, Mask, Simd, Vector};
use crate::math::Vec3;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::node::{Child, Node};

/// Whatever the program was compiled for.
pub struct Portable;

#[cfg(not(target_arch = "x86_64"))]
type V4 = [f32; 4];
#[cfg(not(target_arch = "x86_64"))]
type V8 = [f32; 8];
#[cfg(not(target_arch = "x86_64"))]
type D4 = [f64; 4];
type M8 = <V8 as Vector>::Mask;

impl Simd for Portable {
    type V4 = V4;
    type V8 = V8;
    type Wide = V8;
    type D4 = D4;

    #[inline(always)]
    fn apart<K: Kernel>(kernel: K) -> K::Output {
        isa::portable(kernel)
    }

    #[inline(always)]
    fn prefetch(_: *const u8) {}

    const PREFETCHES: bool = false;

    /// Order and masks, which a flight asks for at every step, are made lane by lane.
    const FLIES: bool = false;

    #[inline(always)]
    fn prefetch_line<T>(_: &T) {}

    #[inline(always)]
    fn far_to_near(
        near: V8,
        mask: M8,
        child: &[Child; 8],
        sorted_near: &mut [u32; 8],
        sorted_child: &mut [Child; 8],
    ) -> usize {
        let near = near.to_array();
        for (len, slot) in (0..8).filter(|slot| mask.bits() >> slot & 1 != 0).enumerate() {
            let key = near[slot].to_bits() & !7 | slot as u32;
            let mut at = len;
            while at > 0 && sorted_near[at - 1] < key {
                (sorted_near[at], sorted_child[at]) = (sorted_near[at - 1], sorted_child[at - 1]);
                at -= 1;
            }
            (sorted_near[at], sorted_child[at]) = (key, child[slot]);
        }
        mask.bits().count_ones() as usize
    }

    #[inline(always)]
    fn nearest_apart(
        near: V8,
        mask: M8,
        child: &[Child; 8],
        other_near: &mut [u32; 8],
        other_child: &mut [Child; 8],
    ) -> (Child, usize) {
        let near = near.to_array();
        let key = |slot: usize| near[slot].to_bits() & !7 | slot as u32;
        let named = || (0..8).filter(|slot| mask.bits() >> slot & 1 != 0);
        let nearest = named().min_by_key(|&slot| key(slot)).unwrap_or(0);
        let mut count = 0;
        for slot in named().filter(|&slot| slot != nearest) {
            (other_near[count], other_child[count]) = (key(slot), child[slot]);
            count += 1;
        }
        if count >= 2 && other_near[0] < other_near[1] {
            other_near.swap(0, 1);
            other_child.swap(0, 1);
        }
        (child[nearest], count)
    }

    #[inline(always)]
    fn within(
        limit: f32,
        (nears, children): (&[u32; 8], &[Child; 8]),
        count: usize,
        near: &mut [u32; 8],
        child: &mut [Child; 8],
    ) -> usize {
        let mut kept = 0;
        for i in (0..count.min(8)).filter(|&i| f32::from_bits(nears[i] & !7) <= limit) {
            (near[kept], child[kept]) = (nears[i], children[i]);
            kept += 1;
        }
        kept
    }

    #[inline(always)]
    fn named_first(mask: M8, child: &[Child; 8], named: &mut [Child; 8]) -> usize {
        for (place, slot) in (0..8).filter(|slot| mask.bits() >> slot & 1 != 0).enumerate() {
            named[place] = child[slot];
        }
        mask.bits().count_ones() as usize
    }

    #[inline(always)]
    fn highest_bits(numbers: &[u32; 32]) -> u32 {
        (0..32).fold(0, |bits, k| bits | numbers[k] >> 31 << k)
    }

    #[inline(always)]
    fn equal(numbers: &[u32; 32], number: u32) -> u32 {
        (0..32).fold(0, |bits, k| bits | u32::from(numbers[k] == number) << k)
    }

    #[inline(always)]
    fn row(node: &Node, offset: u32) -> V8 {
        V8::load(&node.bounds[(offset / Node::ROW) as usize % 6])
    }

    #[inline(always)]
    fn corners(block: &Block, offset: u32) -> [V8; 3] {
        block.corners[(offset / Block::AXIS) as usize % 3].map(
            #[inline(always)]
            |row| V8::load(&row),
        )
    }

    #[inline(always)]
    fn by_component(triangles: &[[&Vec3; 3]; 8]) -> [[V8; 3]; 3] {
        let mut corners = [[[0.0; 8]; 3]; 3];
        for (lane, triangle) in triangles.iter().enumerate() {
            for (k, corner) in triangle.iter().enumerate() {
                for axis in 0..3 {
                    corners[axis][k][lane] = corner[axis];
                }
            }
        }
        corners.map(|axis| axis.map(|row| V8::load(&row)))
    }

    #[inline(always)]
    fn transpose(rows: [V8; 8]) -> [V8; 8] {
        transpose(rows)
    }
}
