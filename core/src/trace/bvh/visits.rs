//! What callers ask of a tree over their boxes: which of them a ray enters, and which are near to a point or to another
//! box.

use std::marker::PhantomData;

use super::alone::VisitFlow;
use super::boxes::BoxTree;
use super::near::ball::Ball;
use super::overlap::visit_overlapping;
use super::query::{Closest, Occluded, Query};
use super::reject::Blur;
use super::simd::Simd;
use super::simd::isa::{self, Kernel};
use super::tree::Tree;
use super::walk::Visit;
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;

impl BoxTree {
    /// Names boxes that `ray` enters at its time, or nearly, up to the t that `visitor` returns last (at first the
    /// ray's tmax), near ones mostly first, until it has seen enough. The search takes each box that the ray enters; it
    /// may take others.
    pub fn visit(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> VisitFlow) {
        self.visit_as::<Closest>(ray, visitor);
    }

    /// The same for a visitor to whom it does not matter which are near.
    pub fn visit_any(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> VisitFlow) {
        self.visit_as::<Occluded>(ray, visitor);
    }

    fn visit_as<Q: Query>(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> VisitFlow) {
        if !self.is_empty() && ray.is_valid() {
            isa::dispatch(self.isa(), VisitBoxes { boxes: self, ray, visitor, query: PhantomData::<Q> });
        }
    }

    /// Names boxes that have a point in common with `bounds`, and some that are only near it: in the same leaves, or by
    /// a millionth of coordinates. What moves is at time 0.
    pub fn visit_overlapping(&self, bounds: &Aabb, visitor: &mut dyn FnMut(u32)) {
        visit_overlapping(self.tree(), self.isa(), bounds, visitor);
    }

    /// Names boxes whose distance from `point` is at most the radius that `visitor` returns last (at first `radius`),
    /// near ones mostly first, until it has seen enough; and some that are farther, in the same leaves or by a
    /// millionth of coordinates. What moves is at time 0.
    pub fn visit_near(&self, point: Vec3, radius: f32, visitor: &mut dyn FnMut(u32) -> VisitFlow) {
        if !self.is_empty() && point.is_finite() {
            isa::dispatch(self.isa(), NearBoxes { tree: self.tree(), point, radius, visitor });
        }
    }
}

struct NearBoxes<'a, 'v> {
    tree: &'a Tree,
    point: Vec3,
    radius: f32,
    visitor: &'a mut (dyn FnMut(u32) -> VisitFlow + 'v),
}

impl Kernel for NearBoxes<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, point, mut radius, visitor } = self;
        Ball { point }.walk::<S>(
            tree,
            radius,
            #[inline(always)]
            |leaf| {
                for item in leaf.blocks() {
                    match visitor(item) {
                        VisitFlow::Continue(wanted) => radius = wanted,
                        VisitFlow::Break(()) => return None,
                    }
                }
                Some(radius)
            },
        );
    }
}

struct VisitBoxes<'a, 'v, Q> {
    boxes: &'a BoxTree,
    ray: &'a Ray,
    visitor: &'a mut (dyn FnMut(u32) -> VisitFlow + 'v),
    query: PhantomData<Q>,
}

impl<Q: Query> Kernel for VisitBoxes<'_, '_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { boxes, ray, visitor, .. } = self;
        boxes.walk::<S, Q>(
            ray,
            Blur::NONE,
            ray.tmax.next_up(),
            #[inline(always)]
            |item| match visitor(item) {
                VisitFlow::Continue(t) => Visit::Until(t),
                VisitFlow::Break(()) => Visit::Stop,
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::trace::bvh::build::preset::Options;

    /// Every box in which a ray is at its own time is named, and few of the others, however far they move.
    #[test]
    fn what_moves_is_found_where_it_is() {
        let mut random = Random::new(62, 0);
        for far in [0.0, 0.01, 1.0, 100.0, 1e6] {
            let mut boxes: Vec<[Aabb; 2]> = Vec::new();
            for i in 0..3000 {
                let centre = random.vector() * 10.0;
                // All one way, or each its own.
                let way = if i % 2 == 0 { Vec3::new(1.0, 0.5, -0.25) } else { random.vector() };
                let sizes = [0, 1].map(|_| Vec3::splat(random.unit()) * 0.1);
                let centres = [centre, centre + way * far];
                boxes.push([0, 1].map(|k| Aabb { min: centres[k] - sizes[k], max: centres[k] + sizes[k] }));
            }
            boxes[7][1] = Aabb::EMPTY;
            // Some stand still, and some are flat.
            boxes.iter_mut().skip(10).step_by(9).for_each(|ends| ends[1] = ends[0]);
            boxes.iter_mut().skip(10).step_by(4).flatten().for_each(|bounds| bounds.max.y = bounds.min.y);
            let (tree, order) = BoxTree::moving(&boxes, Options::default());
            let mut named = 0;
            let rays = 2000;
            for k in 0..rays {
                let time = [random.unit(), 0.0, 1.0, random.unit()][k % 4];
                // Through the middle of one of them, or through a corner.
                let [start, end] = boxes[random.below(3000) as usize];
                let point = |bounds: &Aabb| if k % 2 == 0 { bounds.min.midpoint(bounds.max) } else { bounds.max };
                let (a, b) = (point(&start), point(&end));
                let target = if b.is_finite() { a.lerp(b, time) } else { a };
                let direction = random.direction();
                let ray = Ray { time, ..Ray::new(target - direction * (random.unit() * 20.0), direction) };
                let mut seen = vec![false; boxes.len()];
                tree.visit(&ray, &mut |i| {
                    seen[order[i as usize] as usize] = true;
                    VisitFlow::Continue(f32::INFINITY)
                });
                assert!(!seen[7], "it is nowhere at the end");
                named += seen.iter().filter(|seen| **seen).count();
                for (i, [start, end]) in boxes.iter().enumerate().filter(|(i, _)| *i != 7) {
                    assert!(seen[i] || !is_entered(&ray, start, end), "far {far}, box {i}, ray {ray:?}");
                }
            }
            assert!(named < 60 * rays, "far {far}: {named} of {rays} rays");
        }
    }

    /// In f64.
    fn is_entered(ray: &Ray, start: &Aabb, end: &Aabb) -> bool {
        let time = f64::from(ray.time);
        let between = |a: Vec3, b: Vec3| a.as_dvec3() * (1.0 - time) + b.as_dvec3() * time;
        let (min, max) = (between(start.min, end.min), between(start.max, end.max));
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (a, b) = ((min[axis] - o[axis]) / d[axis], (max[axis] - o[axis]) / d[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near <= far
    }
}
