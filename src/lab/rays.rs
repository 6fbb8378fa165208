//! Rays made to be difficult, as a function of their number.
//!
//! Uniform rays find next to nothing: they pass edges by thousands of roundings. So most of these are aimed: at
//! corners, at the middles of edges, along the axes through a corner, from far away, and from one surface to another.

use crate::lab::oracle::{Body, Primitive};
use crate::math::{Aabb, Random, Vec3, is_traceable};
use crate::ray::Ray;
use crate::trace::{Primitives, World};

/// Makes rays for one world.
pub struct Aim<'a> {
    world: &'a World,
    centre: Vec3,
    /// Half of the longest side of the bounds.
    reach: f32,
    /// Part and placement, and how many primitives come before it.
    runs: Vec<(usize, Option<usize>, u64)>,
    count: u64,
}

/// What a ray is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Query {
    /// The nearest hit.
    Closest(Ray),
    /// Any hit, as between a surface and a light.
    Occluded(Ray),
}

impl<'a> Aim<'a> {
    /// None for a world without anything to hit.
    pub fn new(world: &'a World) -> Option<Self> {
        let bounds: Aabb = world.bounds();
        if bounds.is_empty() {
            return None;
        }
        let (mut runs, mut count) = (Vec::new(), 0);
        let placed = world.placements.iter().enumerate().flat_map(|(i, placement)| {
            world.objects[placement.object as usize].clone().map(move |part| (part, Some(i)))
        });
        for (part, placement) in world.fixed.clone().map(|part| (part, None)).chain(placed) {
            runs.push((part, placement, count));
            count += world.parts[part].primitives.len() as u64;
        }
        let reach = (bounds.size() * 0.5).max_element().max(f32::MIN_POSITIVE);
        Some(Self { world, centre: bounds.centre(), reach, runs, count })
    }

    /// Ray number `index`, the same every time.
    pub fn ray(&self, seed: u64, index: u64) -> Query {
        let mut random = Random::new(seed, index);
        let around = |random: &mut Random| self.centre + random.vector() * (1.5 * self.reach);
        let time = if self.world.moves() { random.unit() } else { 0.0 };
        let between = |from: Vec3, to: Vec3| Ray { time, ..Ray::new(from, to - from) };
        let origin = around(&mut random);
        Query::Closest(match index % 8 {
            0 => Ray { time, ..Ray::new(origin, random.direction()) },
            1 => between(self.centre + random.direction() * (1000.0 * self.reach), origin),
            2 => between(origin, self.corners(&mut random, time)[0]),
            3 => {
                let corners = self.corners(&mut random, time);
                between(origin, corners[0].midpoint(corners[1]))
            }
            4 => {
                // Two coordinates of the corner, and a direction with zeros of both signs.
                let axis = random.below(3) as usize;
                let mut from = self.corners(&mut random, time)[0];
                let mut direction = Vec3::splat(if random.unit() < 0.5 { 0.0 } else { -0.0 });
                direction[axis] = if random.unit() < 0.5 { 1.0 } else { -1.0 };
                from[axis] = self.centre[axis] - direction[axis] * 2.0 * self.reach;
                Ray { time, ..Ray::new(from, direction) }
            }
            5 => Ray { time, ..Ray::new(self.inside(&mut random, time), random.direction()) },
            6 => between(origin, self.inside(&mut random, time)),
            _ => {
                let (from, to) = (self.inside(&mut random, time), self.inside(&mut random, time));
                return Query::Occluded(Ray { tmax: 1.0, ..between(from, to) });
            }
        })
    }

    /// Points of a random primitive at a time, in the world; a triangle's corners, the first of which is any of the
    /// three.
    fn corners(&self, random: &mut Random, time: f32) -> [Vec3; 3] {
        // Untraceable corners are no targets; a few draws find others in any mesh that has them.
        for _ in 0..8 {
            let primitive = self.primitive(random.below(self.count.max(1)), time);
            let turn = random.below(3) as usize;
            let points = match primitive.body {
                Body::Triangle(corners) => [corners[turn], corners[(turn + 1) % 3], corners[(turn + 2) % 3]],
                Body::Shape(shape) => {
                    let b = shape.bounds();
                    [b.centre().with_x(b.max.x), b.centre().with_y(b.max.y), b.centre().with_z(b.min.z)]
                }
            };
            let placed = points.map(|p| primitive.to_world.map_or(p, |m| m.transform_point3(p)));
            if placed.into_iter().all(is_traceable) {
                return placed;
            }
        }
        [self.centre; 3]
    }

    /// A point of a random primitive, up to rounding.
    fn inside(&self, random: &mut Random, time: f32) -> Vec3 {
        let [a, b, c] = self.corners(random, time);
        let (u, v) = (random.unit(), random.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        a + (b - a) * u + (c - a) * v
    }

    fn primitive(&self, index: u64, time: f32) -> Primitive<'a> {
        let run = self.runs.partition_point(|&(.., first)| first <= index) - 1;
        let (part, placement, first) = self.runs[run];
        let body = match &self.world.parts[part].primitives {
            Primitives::Triangles { positions, triangles } => {
                Body::Triangle(triangles[(index - first) as usize].map(|i| positions[i as usize]))
            }
            Primitives::Shapes(shapes) => Body::Shape(&shapes[(index - first) as usize]),
        };
        Primitive { body, to_world: placement.map(|i| self.world.placements[i].at(time).to_world) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::oracle;
    use crate::scene::{Geometry, Mesh};

    #[test]
    fn rays_repeat_and_most_of_the_aimed_ones_hit() {
        let mesh =
            Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]);
        let scene = crate::Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Default::default()]);
        let world = World::new(&scene).unwrap();
        let aim = Aim::new(&world).unwrap();
        let (mut hits, mut touches) = (0, 0);
        for index in 0..800 {
            assert_eq!(aim.ray(7, index), aim.ray(7, index));
            if let Query::Closest(ray) = aim.ray(7, index) {
                assert!(ray.is_valid());
                let nearest = oracle::closest(&world, &ray);
                hits += usize::from(!nearest.is_empty());
                touches += usize::from(nearest.iter().any(|(_, m)| m.touches));
            }
        }
        assert!(hits > 300 && touches > 50, "{hits} {touches}");
        assert_ne!(aim.ray(7, 0), aim.ray(8, 0));
        assert!(Aim::new(&World::default()).is_none());
    }
}
