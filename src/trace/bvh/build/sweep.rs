//! The best of all divisions of a few items: along each axis they are sorted by their centres, and every place between
//! two neighbours is tried.
//!
//! Bins would put neighbours together, and blocks could not be filled: of eight triangles, four go to each side.

use super::lanes::{Boxes, RANKED};
use super::record::Record;
use super::split::{Cheapest, Cut, Rule, Split};
use crate::trace::bvh::simd::{Array, Simd, Vector};

/// The largest number of items.
pub(super) const MOST: usize = RANKED;

/// The cheapest division of 2 to [`MOST`] items; None where none costs a finite amount.
#[inline(always)]
pub(super) fn best<S: Simd>(items: &[Record], rule: &Rule) -> Option<Split> {
    let n = items.len();
    let orders = sorted::<S>(items);
    // Written out, for what is mapped over an array is not always compiled for the instruction set.
    let item = |order: &[u8; MOST], k: usize| S::V8::load(&items[usize::from(order[k])].0);
    let at = |k: usize| [item(&orders[0], k), item(&orders[1], k), item(&orders[2], k)];
    let join = |a: [S::V8; 3], b: [S::V8; 3]| [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])];
    let mut right_areas = [[0.0; 4]; MOST];
    let mut right = [S::V8::splat(f32::NEG_INFINITY); 3];
    for k in (1..n).rev() {
        right = join(right, at(k));
        right_areas[k] = S::V8::half_areas(right);
    }
    let mut cheapest = Cheapest::<S>::new();
    let mut left = [S::V8::splat(f32::NEG_INFINITY); 3];
    for (k, right_areas) in right_areas.iter().enumerate().take(n).skip(1) {
        left = join(left, at(k - 1));
        let left_cost = S::V4::load(&S::V8::half_areas(left)).mul(S::V4::splat(rule.blocks(k)));
        cheapest.offer(k, S::V4::load(right_areas).mul(S::V4::splat(rule.blocks(n - k))).add(left_cost));
    }
    let (axis, k, cost) = cheapest.found()?;
    let mask = orders[axis][..k].iter().fold(0, |mask, &i| mask | 1 << i);
    Some(Split { cut: Cut::Mask(mask), cost })
}

/// The items' numbers by rising centre, for each axis.
#[inline(always)]
fn sorted<S: Simd>(items: &[Record]) -> [[u8; MOST]; 3] {
    let mut keys = [[0.0; MOST]; 3];
    for (i, item) in items.iter().enumerate() {
        let bounds = S::V8::load(&item.0);
        // Finite, for an infinite box has no centre.
        let finite = bounds.sub(bounds.swap_halves()).max(S::V8::splat(-1e38)).min(S::V8::splat(1e38)).to_array();
        for axis in 0..3 {
            // The number in the last five bits makes every key another one.
            keys[axis][i] = f32::from_bits(finite[axis + 4].to_bits() & !(MOST as u32 - 1) | i as u32);
        }
    }
    let mut orders = [[0; MOST]; 3];
    for axis in 0..3 {
        let ranks = S::V8::ranks(&keys[axis], items.len());
        for i in 0..items.len() {
            orders[axis][ranks[i] as usize % MOST] = i as u8;
        }
    }
    orders
}
