//! Large triangles referenced from several places, so that their boxes are less empty: the high preset.
//!
//! Before the tree is built, boxes are cut where planes pass that will divide the scene anyway (Ernst, Greiner 2007, *Early
//! split clipping for bounding volume hierarchies*; priorities and planes by Karras, Aila 2013, *Fast parallel
//! construction of high-quality bounding volume hierarchies*). Splits chosen while building (Stich, Friedrich, Dietrich 2009,
//! *Spatial splits in bounding volume hierarchies*), the alternative, know better which are worth it, but need a second kind of
//! bins, room for new references in every range, and several times the time.

use rayon::prelude::*;

use super::record::Record;
use crate::math::{Aabb, Vec3};
use crate::memory::room;
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::node::Child;

/// New references for each triangle, at most.
const BUDGET: f64 = 0.3;

/// Only a triangle is cut that wastes more than this many times the mean surface of a box. Measured: without a limit a scan on a
/// floor spent its budget where nothing is won, and camera rays took a third longer.
const LARGE: f64 = 4.0;

/// Most times that one triangle is cut.
const MOST: u32 = 255;

/// Triangles that are cut by one thread at a time; fixed, so that the order does not depend on threads.
const CHUNK: usize = 1 << 13;

/// `items` and, for what is cut, one item for each piece; at most 1.3 times as many.
pub(in crate::trace::bvh) fn presplit(items: &[Record], meshes: &Meshes) -> Vec<Record> {
    let whole = items.par_iter().map(Record::bounds).reduce(|| Aabb::EMPTY, Aabb::union);
    let grid = Grid { origin: whole.min, size: whole.size().max_element() };
    let corners = |item: &Record| meshes.of_part(item.part()).corners(item.primitive());
    // Chunk by chunk and in order, so that the sum does not depend on threads.
    let area = |items: &[Record]| items.iter().map(|item| f64::from(item.bounds().half_area())).sum();
    let areas: Vec<f64> = items.par_chunks(CHUNK).map(area).collect();
    let area: f64 = areas.iter().sum();
    let least = (LARGE * area / items.len().max(1) as f64) as f32;
    let priorities: Vec<f32> =
        items.par_iter().map(|item| grid.priority(&item.bounds(), &corners(item), least)).collect();
    let budget = (items.len() as f64 * BUDGET) as u64;
    let scale = scale(&priorities, budget.min(Child::NAMES.saturating_sub(items.len()) as u64));
    let chunks = items.par_chunks(CHUNK).zip(priorities.par_chunks(CHUNK));
    let pieces: Vec<Vec<Record>> = chunks
        .map(|(items, priorities)| {
            let mut pieces = Vec::with_capacity(items.len());
            for (item, &priority) in items.iter().zip(priorities) {
                let emit = |bounds: Aabb| pieces.push(Record::new(&bounds, item.part(), item.primitive()));
                grid.cut(item.bounds(), &corners(item), cuts(priority, scale), emit);
            }
            pieces
        })
        .collect();
    let counted = pieces.into_iter().map(|pieces| (pieces.len(), pieces)).collect();
    room::fill(counted, |pieces: Vec<Record>, room| pieces.into_iter().for_each(|piece| room.push(piece)))
}

/// How often a triangle is cut.
fn cuts(priority: f32, scale: f64) -> u32 {
    // The cast saturates.
    ((f64::from(priority) * scale) as u32).min(MOST)
}

/// By what priorities are multiplied so that the cuts add up to at most `budget`.
fn scale(priorities: &[f32], budget: u64) -> f64 {
    let total = |scale: f64| priorities.par_iter().map(|&priority| u64::from(cuts(priority, scale))).sum::<u64>();
    let largest = priorities.par_iter().copied().reduce(|| 0.0, f32::max);
    if largest <= 0.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, f64::from(MOST + 1) / f64::from(largest));
    // Where most priorities are small, the largest is not what bounds the scale.
    while total(high) < budget && high < 1e30 {
        (low, high) = (high, 4.0 * high);
    }
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if total(middle) <= budget { low = middle } else { high = middle }
    }
    low
}

/// Halves of halves of the cube around the scene: the planes that cut.
struct Grid {
    origin: Vec3,
    size: f32,
}

/// Halvings that are told apart.
const LEVELS: u32 = 20;

impl Grid {
    /// The coarsest plane strictly inside the box: its level (0 for the middle of the scene), axis and place.
    fn plane(&self, bounds: &Aabb) -> Option<(u32, usize, f32)> {
        let cells = (1 << LEVELS) as f32;
        let cell = |x: f32, axis: usize| (((x - self.origin[axis]) / self.size * cells) as u32).min((1 << LEVELS) - 1);
        let on = |axis: usize| {
            let (low, high) = (cell(bounds.min[axis], axis), cell(bounds.max[axis], axis));
            let bit = (low ^ high).checked_ilog2()?;
            let at = self.origin[axis] + (high >> bit << bit) as f32 / cells * self.size;
            (bounds.min[axis] < at && at < bounds.max[axis]).then_some((LEVELS - 1 - bit, axis, at))
        };
        (0..3).filter_map(on).min_by_key(|&(level, ..)| level)
    }

    /// How much is won by cutting: by the surface of the box that the triangle wastes, if it is more than `least`, and by how
    /// coarse the plane is.
    fn priority(&self, bounds: &Aabb, [a, b, c]: &[Vec3; 3], least: f32) -> f32 {
        let Some((level, ..)) = self.plane(bounds) else { return 0.0 };
        // A triangle fills at most half of each face of its box, and one that does so, a wall say, gains nothing.
        let excess = bounds.half_area() - (*b - *a).cross(*c - *a).abs().element_sum();
        if excess <= least {
            return 0.0;
        }
        let priority = libm::cbrtf(excess * 0.5f32.powi(level as i32));
        if priority.is_finite() { priority } else { 0.0 }
    }

    /// Cuts a triangle's box `times` times, and hands the pieces over.
    fn cut(&self, bounds: Aabb, corners: &[Vec3; 3], times: u32, mut emit: impl FnMut(Aabb)) {
        let mut open = vec![(bounds, times)];
        while let Some((bounds, times)) = open.pop() {
            let plane = if times == 0 { None } else { self.plane(&bounds) };
            let sides = plane.and_then(|(_, axis, at)| sides(&bounds, corners, axis, at));
            let Some([left, right]) = sides else {
                emit(bounds);
                continue;
            };
            // What is left of the cuts goes where the pieces are long.
            let (a, b) = (left.size().max_element(), right.size().max_element());
            let of_left = (((times - 1) as f32 * a / (a + b) + 0.5) as u32).min(times - 1);
            open.extend([(right, times - 1 - of_left), (left, of_left)]);
        }
    }
}

/// The boxes of what lies on each side of a plane, of the triangle within `bounds`; rounded outwards. None where a side would be
/// empty.
fn sides(bounds: &Aabb, corners: &[Vec3; 3], axis: usize, at: f32) -> Option<[Aabb; 2]> {
    let (mut left, mut right) = (Aabb::EMPTY, Aabb::EMPTY);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a[axis] <= at {
            left = left.include(a);
        }
        if a[axis] >= at {
            right = right.include(a);
        }
        if (a[axis] < at) != (b[axis] < at) {
            // In f64, far finer than the step of f32 by which the point is then widened.
            let (a, b) = (a.as_dvec3(), b.as_dvec3());
            let mut point = a + (b - a) * ((f64::from(at) - a[axis]) / (b[axis] - a[axis]));
            point[axis] = f64::from(at);
            let point = point.as_vec3();
            let [mut low, mut high] = [point; 2];
            for other in (0..3).filter(|&other| other != axis) {
                (low[other], high[other]) = (point[other].next_down(), point[other].next_up());
            }
            left = left.include(low).include(high);
            right = right.include(low).include(high);
        }
    }
    let within = |side: Aabb| Aabb { min: side.min.max(bounds.min), max: side.max.min(bounds.max) };
    let mut sides = [within(left), within(right)];
    sides[0].max[axis] = sides[0].max[axis].min(at);
    sides[1].min[axis] = sides[1].min[axis].max(at);
    sides.iter().all(|side| !side.is_empty()).then_some(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_the_triangle_and_waste_less() {
        let corners = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(7.9, 6.1, 5.3), Vec3::new(7.7, 6.5, 1.1)];
        let whole = Aabb::around(corners);
        let grid = Grid { origin: Vec3::ZERO, size: 8.0 };
        let mut pieces = Vec::new();
        grid.cut(whole, &corners, 20, |bounds| pieces.push(bounds));
        assert_eq!(pieces.len(), 21);
        assert!(pieces.iter().all(|piece| piece.union(whole) == whole));
        let area: f32 = pieces.iter().map(Aabb::half_area).sum();
        assert!(area < whole.half_area(), "{area} of {}", whole.half_area());
        // Barycentric points, in f64: exact up to far less than a step of f32.
        for i in 0..=200 {
            for j in 0..=200 - i {
                let (u, v) = (f64::from(i) / 200.0, f64::from(j) / 200.0);
                let [a, b, c] = corners.map(|corner| corner.as_dvec3());
                let point = a + (b - a) * u + (c - a) * v;
                let contains = |piece: &Aabb| {
                    piece.min.as_dvec3().cmple(point + 1e-15).all() && piece.max.as_dvec3().cmpge(point - 1e-15).all()
                };
                assert!(pieces.iter().any(contains), "{point}");
            }
        }
    }

    #[test]
    fn the_budget_is_kept_and_used() {
        let priorities: Vec<f32> = (0..10_000).map(|i| (i % 97) as f32 * (i % 13) as f32).collect();
        for budget in [0, 10, 3000, 30_000] {
            let scale = scale(&priorities, budget);
            let total: u64 = priorities.iter().map(|&priority| u64::from(cuts(priority, scale))).sum();
            assert!(total <= budget && 2 * total >= budget, "{total} of {budget}");
        }
        assert_eq!(scale(&[0.0; 5], 10), 0.0);
    }
}
