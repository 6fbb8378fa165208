//! Bounding volumes: a flat list of boxes, one around each group of items (Clark 1976, *Hierarchical geometric models
//! for visible surface algorithms*).
//!
//! A ray that misses a group's box misses all that is in it; one that enters tests every item there. Groups are the
//! scene's own, its geometries and placements: good for a few well separated things, linear in their number all the
//! same. Boxes are entered in the order in which the ray meets them, so that a near hit spares the groups behind it; a
//! ray seldom enters many.

use std::ops::Range;

use super::items::{Input, bounds_of};
use super::ray::IndexRay;
use super::{Index, Options};
use crate::math::Aabb;

/// The index.
pub(super) struct Groups(Vec<Group>);

struct Group {
    bounds: Aabb,
    items: Range<u32>,
}

impl Index for Groups {
    const REPEATS: bool = false;

    fn build(input: &Input<'_>, _: &Options) -> Self {
        let group = |items: &Range<u32>| {
            let boxes = &input.boxes[items.start as usize..items.end as usize];
            Group { bounds: bounds_of(boxes.iter().copied()), items: items.clone() }
        };
        Self(input.groups.iter().map(group).collect())
    }

    fn visit(&self, ray: &IndexRay, mut limit: f64, each: &mut impl FnMut(u32) -> f64) {
        let begin = |group: &Group| {
            let range = ray.within_box(&group.bounds, limit);
            (!range.is_empty()).then_some(range.from)
        };
        if let [group] = &self.0[..] {
            // By far the most frequent list, and it needs no sorting.
            if begin(group).is_some() {
                group.items.clone().try_fold(limit, |_, item| more(each(item)));
            }
            return;
        }
        let mut entered: Vec<(f64, &Group)> = self.0.iter().filter_map(|group| Some((begin(group)?, group))).collect();
        entered.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (from, group) in entered {
            if from > limit {
                return;
            }
            for item in group.items.clone() {
                match more(each(item)) {
                    Some(new) => limit = new,
                    None => return,
                }
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.0[..])
    }
}

/// The limit, unless it says to stop.
fn more(limit: f64) -> Option<f64> {
    (limit > f64::NEG_INFINITY).then_some(limit)
}
