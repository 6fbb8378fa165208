//! A plane that cuts what it passes.

use super::super::record::Record;
use super::super::split::PrimitiveRange;
use super::slabs::{Plane, Side};
use super::{RULE, clip};
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::simd::boxes::half_area;

/// Blocks times areas of the two sides of a division.
#[inline(always)]
pub(super) fn cost(sides: &[PrimitiveRange; 2]) -> f32 {
    let [left, right] = sides.each_ref().map(|side| side.half_area() * RULE.blocks(side.len as usize));
    left + right
}

impl Plane {
    /// Whether it costs less than a division into `sides`, and cuts no more than `spare`.
    #[inline(always)]
    pub fn is_better(&self, sides: &[PrimitiveRange; 2], spare: usize) -> bool {
        let count = u64::from(sides[0].len) + u64::from(sides[1].len);
        let cut = u64::from(self.sides[0].count) + u64::from(self.sides[1].count) - count;
        self.cost < cost(sides) && cut <= spare as u64
    }

    /// What is left of it and what is right of it, of which at most `spare` are on both sides. What costs less when it
    /// is on one side whole is there.
    pub fn sides_of(&self, items: &[Record], meshes: &Meshes, spare: usize) -> [Vec<Record>; 2] {
        let mut found = self.sides.map(|side| Vec::with_capacity(side.count as usize));
        self.part(items, meshes, spare, &mut found);
        found
    }

    /// Adds these to `sides`.
    pub fn part(&self, items: &[Record], meshes: &Meshes, mut spare: usize, sides: &mut [Vec<Record>; 2]) {
        let &Self { axis, at, .. } = self;
        for item in items {
            let bounds = item.bounds();
            let is_whole = if bounds.max[axis] <= at {
                Some(0)
            } else if bounds.min[axis] >= at {
                Some(1)
            } else {
                self.whole_side(item)
            };
            let (part, primitive) = (item.part(), item.primitive());
            let cut = match is_whole {
                None if spare > 0 => clip::sides(&bounds, &meshes.of_part(part).corners(primitive), axis, at),
                _ => None,
            };
            if let Some(cut) = cut {
                for (side, bounds) in sides.iter_mut().zip(cut) {
                    side.push(Record::new(&bounds, part, primitive));
                }
                spare -= 1;
            } else {
                let nearer = || usize::from(bounds.min[axis] + bounds.max[axis] >= 2.0 * at);
                sides[is_whole.unwrap_or_else(nearer)].push(*item);
            }
        }
    }

    /// The side where an item is better off whole than in pieces on both.
    #[inline(always)]
    fn whole_side(&self, item: &Record) -> Option<usize> {
        let [left, right] = &self.sides;
        let grown = |side: &Side| {
            let mut bounds = side.bounds;
            for (side, item) in bounds.iter_mut().zip(&item.0) {
                *side = side.max(*item);
            }
            half_area(&bounds)
        };
        let [left_area, right_area] = [left, right].map(|side| half_area(&side.bounds));
        let (left_count, right_count) = (left.count as f32, right.count as f32);
        let both = left_area * left_count + right_area * right_count;
        let on_left = grown(left) * left_count + right_area * (right_count - 1.0);
        let on_right = left_area * (left_count - 1.0) + grown(right) * right_count;
        if on_left.min(on_right) >= both {
            return None;
        }
        Some(usize::from(on_right < on_left))
    }
}
