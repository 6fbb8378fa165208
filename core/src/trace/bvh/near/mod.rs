//! The triangle that is nearest to each of many points: the others are left out in f32, those that remain are measured
//! in f64.
//!
//! The nearest child is gone down to first, the others wait with the distance of their boxes and discs (Roussopoulos,
//! Kelley, Vincent 1995, *Nearest neighbor queries*), eight at a time. [`closest_point`](self::closest_point) opens
//! boxes strictly by distance: it opens fewer, and pays for a queue. Of the eight triangles of a block those are left
//! out whose distance, in f32 with a bound on its error, is larger than what was measured ([`bounds`]).
//!
//! Points are in flight together, as rays are ([`super::flight`]): alone, one waits for each node until it knows the
//! next.

pub(super) mod ball;
mod bounds;
pub(super) mod closest_point;
pub(super) mod discs;
mod measure;
mod point_stack;
mod seeker;

use self::discs::Discs;
use super::Bvh;
use super::flight::addresses::Addresses;
use super::flight::set::{IN_FLIGHT, Set};
use super::levels::triangles::TriangleTree;
use super::node::Child;
use super::simd::isa::{self, Kernel};
use super::simd::{Doubles, Simd};
use crate::math::{DVec3, UNIT_ROUNDOFF, Vec3};
use crate::shape::closest::TrianglePoint;
use bounds::{Lower, lower_bounds};
use measure::{by_axis, of_block};
use seeker::Seeker;

/// A point that is asked for, finite.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace) struct Sought {
    /// In the coordinates of the corners as they were given.
    pub point: DVec3,
    /// In the coordinates of the tree; no component above 1e18, so that squares of distances hold in f32.
    pub local: Vec3,
    /// The local point and the corners may be off by so much in each component, both together; and corners that are not
    /// [exact](Surveyor::is_exact) by a unit of f32 of their distance from the point.
    pub error: f32,
}

/// The triangle that is nearest to a point; of those as near that with the lowest ids.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace) struct NearestTriangle {
    /// How far it is, squared, in the coordinates of the corners as they were given.
    pub distance_squared: f64,
    /// The nearest of its points, in the same coordinates; if [it is wanted](Surveyor::wants_points).
    pub on: Option<TrianglePoint>,
    pub geometry: u32,
    pub primitive: u32,
}

/// Who asks for points, and has the corners as they were given.
pub(in crate::trace) trait Surveyor {
    /// Is told what is nearest to the seeker's last point, if it had one, and says its next one. After None it is not
    /// asked for that seeker again.
    fn next(&mut self, seeker: usize, last: Option<NearestTriangle>) -> Option<Sought>;
    /// The corners of a triangle as they were given, by its geometry and its primitive.
    fn corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3];
    /// Whether those in the tree are just these.
    fn is_exact(&self) -> bool;
    /// Whether the nearest points are wanted, besides their distances.
    fn wants_points(&self) -> bool {
        true
    }
    /// Lengths in the tree are so many times those that were given: a power of two.
    fn scale(&self) -> f64;
}

impl Bvh {
    /// Points in flight.
    pub(in crate::trace) const POINTS: usize = IN_FLIGHT;

    /// What [`nearest_triangles`](Self::nearest_triangles) looks at besides boxes.
    pub(in crate::trace) fn discs(&self) -> Discs {
        Discs::new(&self.fixed.triangles)
    }

    /// Finds the nearest fixed triangle of each point that is asked for, by `count` seekers, no more than
    /// [`Self::POINTS`]; where there are no triangles nobody is asked. `discs` are this tree's.
    pub(in crate::trace) fn nearest_triangles(&self, discs: &Discs, count: usize, surveyor: &mut impl Surveyor) {
        debug_assert!(count <= Self::POINTS, "{count} seekers");
        let triangles = &self.fixed.triangles;
        if !triangles.tree().is_empty() {
            let mut seekers = vec![Seeker::IDLE; count.min(Self::POINTS)];
            isa::dispatch_narrow(self.isa, Near { triangles, discs, seekers: &mut seekers, surveyor });
        }
    }
}

/// What a seeker has seen at a leaf.
#[derive(Clone, Copy)]
struct LeafTest<V> {
    seeker: usize,
    leaf: Child,
    lower: Lower<V>,
    /// The triangles that may be near.
    open: u32,
}

/// What comes next will be needed soon.
#[inline(always)]
fn fetch<S: Simd>(addresses: &Addresses, discs: &Discs, next: Child) {
    S::prefetch(addresses.of(next));
    S::prefetch(discs.address::<S>(next));
}

struct Near<'a, Y> {
    triangles: &'a TriangleTree,
    discs: &'a Discs,
    /// One for each seeker.
    seekers: &'a mut [Seeker],
    surveyor: &'a mut Y,
}

impl<Y: Surveyor> Near<'_, Y> {
    /// Goes through the triangles of a block that may be near enough to a seeker. What it reaches next, if that is
    /// another child now.
    #[inline(always)]
    fn measure<S: Simd>(&mut self, test: &LeafTest<S::V8>) -> Option<Child> {
        let LeafTest { seeker: k, leaf, lower, open } = test;
        let (seeker, mut open, mut scratch) = (&mut self.seekers[*k], *open, None);
        let block = self.triangles.block::<S>(leaf.first(), &mut scratch);
        let (before, scale) = (seeker.limit, self.surveyor.scale());
        while open != 0 {
            let lane = lower.nearest(open);
            open &= !(1 << lane);
            let (geometry, primitive) = (self.triangles.part(block.part[lane]).geometry, block.primitive[lane]);
            let corners = if self.surveyor.is_exact() {
                of_block::<S>(block, lane)
            } else {
                let [x, y, z] = by_axis(self.surveyor.corners(geometry, primitive));
                [S::D4::load(&x), S::D4::load(&y), S::D4::load(&z)]
            };
            if seeker.take(corners, (geometry, primitive), scale) {
                seeker.limit = seeker.rounded_limit();
                open &= lower.within(seeker.limit);
            }
        }
        let limit = seeker.limit;
        (limit < before).then(
            #[inline(always)]
            || seeker.waiting.pass_within::<S>(*leaf, limit * limit),
        )
    }
}

impl<Y: Surveyor> Kernel for Near<'_, Y> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        let (triangles, discs) = (self.triangles, self.discs);
        let tree = triangles.tree();
        let addresses = Addresses::of_triangles::<S>(triangles);
        let (mut flying, mut next) = (Set::EMPTY, [Child::NONE; IN_FLIGHT]);
        (0..self.seekers.len()).for_each(|k| flying.insert(k));
        let nothing = LeafTest { seeker: 0, leaf: Child::NONE, lower: Lower::none(), open: 0 };
        let mut tests: [LeafTest<S::V8>; IN_FLIGHT] = [nothing; IN_FLIGHT];
        let rounding = if self.surveyor.is_exact() { 0.0 } else { UNIT_ROUNDOFF };
        while !flying.is_empty() {
            let (leaf, none) =
                (S::highest_bits(bytemuck::cast_ref(&next)), S::equal(bytemuck::cast_ref(&next), Child::NONE.0));
            let mut at_nodes = flying.of(!leaf);
            for k in flying.of(none) {
                let (seeker, scale) = (&mut self.seekers[k], self.surveyor.scale());
                let nearest = seeker.nearest::<S>(scale, self.surveyor.wants_points());
                if let Some(sought) = self.surveyor.next(k, nearest) {
                    seeker.start::<S>(sought, scale);
                    next[k] = Child::ROOT;
                    at_nodes.insert(k);
                } else {
                    flying.remove(k);
                }
            }
            for k in at_nodes {
                next[k] = self.seekers[k].enter::<S>(discs, next[k], tree.node(next[k]));
                fetch::<S>(&addresses, discs, next[k]);
            }
            let mut count = 0;
            for k in flying.of(leaf & !none) {
                let (seeker, leaf, mut scratch) = (&mut self.seekers[k], next[k], None);
                let block = triangles.block::<S>(leaf.first(), &mut scratch);
                let lower = lower_bounds::<S>(block, seeker.local, seeker.error, rounding);
                let open = lower.within(seeker.limit) & block.lanes;
                tests[count % IN_FLIGHT] = LeafTest { seeker: k, leaf, lower, open };
                count += usize::from(open != 0);
                next[k] = seeker.waiting.pass(leaf);
                fetch::<S>(&addresses, discs, next[k]);
            }
            for test in &tests[..count.min(IN_FLIGHT)] {
                if let Some(child) = self.measure::<S>(test) {
                    next[test.seeker] = child;
                    fetch::<S>(&addresses, discs, child);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Material, Mesh, Scene};
    use crate::shape::closest::closest_point;
    use crate::trace::World;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::{Isa, Options, Preset};

    /// Seeker k asks for points k, k + [`Bvh::POINTS`] and so on.
    struct Survey<'a> {
        points: &'a [Vec3],
        geometries: &'a [Vec<[Vec3; 3]>],
        /// The corners as they were given are so many times those in the tree.
        size: f64,
        is_exact: bool,
        wants_points: bool,
        asked: [usize; Bvh::POINTS],
        found: Vec<Option<NearestTriangle>>,
    }

    impl Surveyor for Survey<'_> {
        fn next(&mut self, seeker: usize, last: Option<NearestTriangle>) -> Option<Sought> {
            let asked = &mut self.asked[seeker];
            if *asked > 0 {
                self.found[seeker + (*asked - 1) * Bvh::POINTS] = last;
            }
            let &local = self.points.get(seeker + *asked * Bvh::POINTS)?;
            *asked += 1;
            Some(Sought { point: local.as_dvec3() * self.size, local, error: 0.0 })
        }

        fn corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3] {
            self.geometries[geometry as usize][primitive as usize].map(|corner| corner.as_dvec3() * self.size)
        }

        fn is_exact(&self) -> bool {
            self.is_exact
        }

        fn wants_points(&self) -> bool {
            self.wants_points
        }

        fn scale(&self) -> f64 {
            self.size.recip()
        }
    }

    /// Of a hilly grid, all of it in the second geometry, some of it again in the first, in another order.
    fn geometries(random: &mut Random) -> [Vec<[Vec3; 3]>; 2] {
        const SIDE: usize = 9;
        let heights: Vec<f32> = (0..SIDE * SIDE).map(|_| (random.unit() * 2.0).round()).collect();
        let at = |x: usize, y: usize| Vec3::new(x as f32, y as f32, heights[y * SIDE + x]);
        let mut whole: Vec<_> = (0..SIDE - 1)
            .flat_map(|y| (0..SIDE - 1).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
                [[a, b, d], [d, c, a]]
            })
            .collect();
        for i in (1..whole.len()).rev() {
            whole.swap(i, ((random.unit() + 1.0) * 0.5 * (i + 1) as f32) as usize);
        }
        let again = whole.iter().rev().step_by(3).map(|&[a, b, c]| [b, c, a]).collect();
        [again, whole]
    }

    /// Of the triangles that are as near as any the one with the lowest ids, whatever finds it; corners and edges
    /// belong to many.
    #[test]
    fn the_nearest_triangle_has_the_lowest_ids() {
        let mut random = Random::new(21);
        let geometries = geometries(&mut random);
        let mesh = |triangles: &Vec<[Vec3; 3]>| {
            let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
            Geometry::Mesh(Mesh::new(triangles.concat(), indices.collect()))
        };
        let scene = Scene::from_geometries(geometries.iter().map(mesh).collect(), vec![Material::default()]);
        let world = World::new(&scene).expect("meshes");
        let mut points: Vec<Vec3> =
            (0..300).map(|_| (random.vec3() * 12.0).round() * 0.5 + Vec3::new(4.0, 4.0, 0.0)).collect();
        points.extend((0..30).map(|_| random.vec3() * 5.0));
        let mut ties = 0;
        let expected: Vec<_> = points
            .iter()
            .map(|point| {
                let of = |(geometry, triangles): (u32, &Vec<[Vec3; 3]>)| {
                    let on =
                        |corners: &[Vec3; 3]| closest_point(point.as_dvec3(), corners.map(|corner| corner.as_dvec3()));
                    triangles
                        .iter()
                        .map(on)
                        .zip(0..)
                        .map(|(on, primitive)| (on, geometry, primitive))
                        .collect::<Vec<_>>()
                };
                let all: Vec<(TrianglePoint, u32, u32)> = (0..).zip(&geometries).flat_map(of).collect();
                let least = all.iter().map(|(on, ..)| on.distance_squared).fold(f64::INFINITY, f64::min);
                let mut nearest = all.into_iter().filter(|(on, ..)| on.distance_squared == least);
                let first = nearest.next().expect("some triangle");
                ties += usize::from(nearest.next().is_some());
                first
            })
            .collect();
        assert!(ties > 250, "{ties} ties of {}", points.len());

        for isa in Isa::available() {
            for preset in Preset::ALL {
                let bvh = Bvh::build_with(&world, Options { preset, isa, progress: None });
                // Also corners so small that products of four lengths vanish.
                for (size, is_exact, wants_points) in [
                    (1.0, true, true),
                    (1.0, false, true),
                    (2f64.powi(-300), false, true),
                    (2f64.powi(-300), false, false),
                ] {
                    let (asked, found) = ([0; Bvh::POINTS], vec![None; points.len()]);
                    let (points, geometries) = (&points, &geometries);
                    let mut survey = Survey { points, geometries, size, is_exact, wants_points, asked, found };
                    bvh.nearest_triangles(&bvh.discs(), Bvh::POINTS, &mut survey);
                    for ((found, (on, geometry, primitive)), point) in survey.found.iter().zip(&expected).zip(points) {
                        let found = found.expect("there are triangles");
                        let context = format!("{isa:?}, {preset:?}, {size}: {point}");
                        assert_eq!((found.geometry, found.primitive), (*geometry, *primitive), "{context}");
                        assert_eq!(found.distance_squared, on.distance_squared * size * size, "{context}");
                        let (offset, distance_squared) = (on.offset * size, found.distance_squared);
                        let on = TrianglePoint { offset, distance_squared, ..*on };
                        assert_eq!(found.on, wants_points.then_some(on), "{context}");
                    }
                }
            }
        }
    }
}
