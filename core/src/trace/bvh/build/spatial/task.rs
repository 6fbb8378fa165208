//! Small ranges, by one thread.

use super::super::bins;
use super::super::record::Record;
use super::super::split::PrimitiveRange;
use super::super::subtree::Finder;
use super::slabs::{Grid, Plane, Slabs};
use super::{Extent, RULE, Splitter, share};
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::simd::isa::Kernel;

/// The pieces of a range.
pub(super) struct TaskKernel<'a> {
    pub splitter: &'a Splitter<'a>,
    pub items: Vec<Record>,
    pub extent: Extent,
    /// New references, at most.
    pub spare: usize,
}

impl Kernel for TaskKernel<'_> {
    type Output = Vec<Record>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Record> {
        let Self { splitter, items, extent, mut spare } = self;
        let mut step = Step { splitter, finder: Finder::<S>::new(), sides: [Vec::new(), Vec::new()] };
        let mut pieces = Vec::with_capacity(items.len());
        // Ranges, and their items: those of the next one last.
        let (mut open, mut waiting) = (vec![extent], items);
        while let Some(extent) = open.pop() {
            let len = extent.range.len as usize;
            let from = waiting.len() - len;
            // What some leave over is for those that come later.
            let others = open.iter().map(Extent::weight).sum();
            let allowed = (spare as f64 * share(extent.weight(), others)).ceil() as usize;
            if !extent.may_be_cut(allowed) {
                pieces.extend_from_slice(&waiting[from..]);
                waiting.truncate(from);
                continue;
            }
            step.divide(&mut waiting[from..], &extent.range, allowed.min(spare));
            waiting.truncate(from);
            let [left, right] = &mut step.sides;
            spare -= left.len() + right.len() - len;
            for side in [right, left] {
                open.push(Extent::new::<S>(side));
                waiting.append(side);
            }
        }
        pieces
    }
}

/// Divides one range after the other.
struct Step<'a, S> {
    splitter: &'a Splitter<'a>,
    finder: Finder<S>,
    /// What came of the last one.
    sides: [Vec<Record>; 2],
}

impl<S: Simd> Step<'_, S> {
    /// Divides `items`, those of `range`, of which there are several and may be `spare` more.
    #[inline(always)]
    fn divide(&mut self, items: &mut [Record], range: &PrimitiveRange, spare: usize) {
        let Self { splitter, finder, sides } = self;
        let halves = finder.find(items, range, &RULE).apply::<S>(items, range);
        let plane = if !splitter.is_worth_a_look(&halves) {
            None
        } else if items.len() < bins::LARGE {
            plane::<S, { bins::FEW }>(splitter, items, range)
        } else {
            plane::<S, { bins::MANY }>(splitter, items, range)
        };
        if let Some(plane) = plane.filter(|plane| plane.is_better(&halves, spare)) {
            plane.part(items, splitter.meshes, spare, sides);
            if sides.iter().all(|side| !side.is_empty()) {
                return;
            }
            sides.iter_mut().for_each(Vec::clear);
        }
        let (left, right) = items.split_at(halves[0].len as usize);
        sides[0].extend_from_slice(left);
        sides[1].extend_from_slice(right);
    }
}

/// The best plane that cuts, between `N` slabs.
#[inline(always)]
fn plane<S: Simd, const N: usize>(splitter: &Splitter<'_>, items: &[Record], range: &PrimitiveRange) -> Option<Plane> {
    let mut slabs = Slabs::<N>::EMPTY;
    let grid = Grid::new::<S>(&range.bounds);
    slabs.add_all::<S>(items, &grid, splitter.meshes);
    slabs.best::<S>(&grid, &RULE)
}
