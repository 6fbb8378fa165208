//! The best of all divisions of a few items: along each axis they are sorted by their centres, and every place between
//! two neighbours is tried.
//!
//! Bins would put neighbours together, and blocks could not be filled: of eight triangles, four go to each side.

use super::record::Record;
use super::split::{Cheapest, Cut, Rule, Split, join};
use crate::trace::bvh::simd::boxes::{Boxes, RANKED};
use crate::trace::bvh::simd::{Array, Simd, Vector};

/// The largest number of items.
pub(super) const MAX: usize = RANKED;

/// The cheapest division of 2 to [`MAX`] items; None where none costs a finite amount.
#[inline(always)]
pub(super) fn best<S: Simd>(items: &[Record], rule: &Rule) -> Option<Split> {
    let n = items.len();
    let orders = sorted::<S>(items);
    let mut right_areas = [[0.0; 4]; MAX];
    let mut right = [S::V8::splat(f32::NEG_INFINITY); 3];
    for k in (1..n).rev() {
        right = join(right, at::<S>(items, &orders, k));
        right_areas[k] = S::V8::half_areas(right);
    }
    let mut cheapest = Cheapest::<S>::new();
    let mut left = [S::V8::splat(f32::NEG_INFINITY); 3];
    for (k, right_areas) in right_areas.iter().enumerate().take(n).skip(1) {
        left = join(left, at::<S>(items, &orders, k - 1));
        let left_cost = S::V4::load(&S::V8::half_areas(left)).mul(S::V4::splat(rule.blocks(k)));
        cheapest.offer(k, S::V4::load(right_areas).mul(S::V4::splat(rule.blocks(n - k))).add(left_cost));
    }
    let (axis, k, cost) = cheapest.found()?;
    let mask = orders[axis][..k].iter().fold(0, |mask, &i| mask | 1 << i);
    Some(Split { cut: Cut::Mask(mask), cost })
}

/// Of each axis' order the item in that place.
#[inline(always)]
fn at<S: Simd>(items: &[Record], orders: &[[u8; MAX]; 3], k: usize) -> [S::V8; 3] {
    // Written out: what is mapped over an array, or is a closure, is not always compiled for the instruction set.
    let [x, y, z] = orders;
    let [x, y, z] = [&items[usize::from(x[k])], &items[usize::from(y[k])], &items[usize::from(z[k])]];
    [S::V8::load(&x.0), S::V8::load(&y.0), S::V8::load(&z.0)]
}

/// The items' numbers by rising centre, for each axis.
#[inline(always)]
fn sorted<S: Simd>(items: &[Record]) -> [[u8; MAX]; 3] {
    let mut keys = [[0.0; MAX]; 3];
    for (i, item) in items.iter().enumerate() {
        let bounds = S::V8::load(&item.0);
        // Finite, for an infinite box has no centre.
        let finite = bounds.sub(bounds.swap_halves()).max(S::V8::splat(-1e38)).min(S::V8::splat(1e38)).to_array();
        for axis in 0..3 {
            // The number in the last five bits makes every key another one.
            keys[axis][i] = f32::from_bits(finite[axis + 4].to_bits() & !(MAX as u32 - 1) | i as u32);
        }
    }
    let mut orders = [[0; MAX]; 3];
    for axis in 0..3 {
        let ranks = S::V8::ranks(&keys[axis], items.len());
        for i in 0..items.len() {
            orders[axis][ranks[i] as usize % MAX] = i as u8;
        }
    }
    orders
}
