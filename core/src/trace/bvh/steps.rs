//! What a ray cannot but look at: a measure of how well a tree suits it.

use serde::Serialize;

use super::Bvh;
use super::levels::Level;
use super::levels::place::Place;
use super::levels::placements::among_boxes;
use super::node::Child;
use super::reject::Blur;
use super::reject::slab::SlabRay;
use super::simd::{Mask, Portable};
use super::tree::Tree;
use super::walk::Enter;
use crate::ray::Ray;
use crate::trace::Tracer;

/// Parts of the trees that a ray enters no farther than its nearest hit: the least that any order of traversal looks
/// at. What it does look at may be more, by what it enters before it has found the hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Steps {
    /// Nodes of eight boxes, in all trees.
    pub nodes: u32,
    /// Placed objects, each of which is a tree of its own.
    pub objects: u32,
    /// Blocks of up to eight triangles.
    pub blocks: u32,
    /// Shapes that are not triangles.
    pub shapes: u32,
}

impl Bvh {
    /// Counts for a ray that looks for its nearest hit. For few rays: it counts one by one.
    pub fn steps(&self, ray: &Ray) -> Steps {
        let mut steps = Steps::default();
        if !ray.is_valid() {
            return steps;
        }
        let limit = self.closest(ray).map_or(ray.tmax, |hit| hit.t);
        count_level(&mut steps, &self.fixed, (ray, Blur::NONE), Some(ray), limit);
        let world = among_boxes::<Portable>(self.placements.tree(), ray, self.placements.spread());
        for number in items(&mut steps, self.placements.tree(), &world, limit) {
            self.count_object(&mut steps, self.placements.at(number), ray, limit);
        }
        let boxes = self.moving.boxes();
        let world = boxes.slab::<Portable>(ray, self.moving.strayed(ray));
        let moving = match boxes.at_its_time(world, ray) {
            Some(moving) => items(&mut steps, boxes.tree(), &moving, limit),
            None => items(&mut steps, boxes.tree(), &world, limit),
        };
        for number in moving {
            let placement = self.moving.at(number).at(ray.moment());
            let reach = self.objects[placement.object as usize].triangles.tree().reach();
            self.count_object(&mut steps, &Place::new(&placement, reach), ray, limit);
        }
        steps
    }

    fn count_object(&self, steps: &mut Steps, place: &Place, ray: &Ray, limit: f32) {
        steps.objects += 1;
        let shapes = place.object_ray(ray);
        let (local, blur) = place.local::<Portable>(ray);
        let level = &self.objects[place.object as usize];
        count_level(steps, level, (&local, blur), shapes.is_valid().then_some(&shapes), limit);
    }
}

/// Triangles and shapes of a level, for the ray in its coordinates as either of them takes it.
fn count_level(steps: &mut Steps, level: &Level, (ray, blur): (&Ray, Blur), for_shapes: Option<&Ray>, limit: f32) {
    let tree = level.triangles.tree();
    steps.blocks += items(steps, tree, &SlabRay::new::<Portable>(ray, tree.reach(), blur), limit).len() as u32;
    if let Some(ray) = for_shapes {
        let tree = level.shapes.tree();
        steps.shapes +=
            items(steps, tree, &SlabRay::new::<Portable>(ray, tree.reach(), Blur::NONE), limit).len() as u32;
    }
}

/// What is in the leaves that the ray enters up to `limit`; nodes on the way are counted.
fn items(steps: &mut Steps, tree: &Tree, ray: &impl Enter, limit: f32) -> Vec<u32> {
    let mut found = Vec::new();
    let mut waiting = if tree.is_empty() { Vec::new() } else { vec![Child::ROOT] };
    while let Some(child) = waiting.pop() {
        if child.is_leaf() {
            found.extend(child.blocks());
            continue;
        }
        steps.nodes += 1;
        let node = tree.node(child);
        let (entered, _) = ray.enter::<Portable>(node, limit);
        let entered = entered.bits();
        waiting.extend(node.children().filter(|(slot, _)| entered >> slot & 1 == 1).map(|(_, child)| child));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::scene::{Geometry, Mesh, Scene};
    use crate::trace::World;

    /// A ball on a ground that reaches a million times as far: rays at the ball look at no more than without the
    /// ground, and a few boxes of it.
    #[test]
    fn what_is_far_away_makes_nothing_near_uncertain() {
        const SIDE: u32 = 64;
        let angle = |k: u32| k as f32 * std::f32::consts::PI / SIDE as f32;
        let at = |i: u32, j: u32| {
            let ((sin, cos), (x, z)) = (angle(i).sin_cos(), (2.0 * angle(j)).sin_cos());
            Vec3::new(sin * x, cos, sin * z)
        };
        let quads = (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]));
        let corners = quads.flatten().map(|(i, j)| at(i, j)).collect();
        let ball = Mesh::new(
            corners,
            (0..SIDE * SIDE).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| 4 * k + i))).collect(),
        );
        let far = 1e6;
        let corners = [(-far, -far), (far, -far), (far, far), (-far, far)].map(|(x, z)| Vec3::new(x, -1.0, z));
        let ground = Mesh::new(corners.to_vec(), vec![[0, 2, 1], [0, 3, 2]]);
        let mut random = crate::trace::bvh::random::Random::new(5);
        let rays: Vec<Ray> = (0..500)
            .map(|_| {
                let origin = random.vec3().normalize() * 3.0;
                Ray::new(origin, random.vec3() * 0.7 - origin)
            })
            .collect();
        let [without, with] = [vec![ball.clone()], vec![ball, ground]].map(|meshes| {
            let scene = Scene::from_geometries(meshes.into_iter().map(Geometry::Mesh).collect(), Vec::new());
            let world = World::new(&scene).expect("sound");
            let bvh = Bvh::build(&world);
            rays.iter()
                .map(|ray| bvh.steps(&world.ray(ray.origin.as_dvec3(), ray.direction)))
                .fold((0, 0), |sum, steps| (sum.0 + steps.nodes, sum.1 + steps.blocks))
        });
        let few = rays.len() as u32 * 2;
        assert!(with.0 <= without.0 + few && with.1 <= without.1 + few, "{with:?} instead of {without:?}");
    }

    /// A row of squares across the ray: what is behind the nearest is not counted, and what is beside them neither.
    #[test]
    fn only_what_lies_before_the_hit_is_counted() {
        let square = |z: f32, x: f32| {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            corners.map(|(a, b)| Vec3::new(a + x, b, z))
        };
        let squares: Vec<_> = (0..100).flat_map(|i| [square(-(i as f32), 0.0), square(-(i as f32), 50.0)]).collect();
        let triangles = (0..squares.len() as u32).flat_map(|i| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| 4 * i + k)));
        let mesh = Mesh::new(squares.concat(), triangles.collect());
        let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], Vec::new());
        let world = World::new(&scene).expect("sound");
        let bvh = Bvh::build(&world);
        let ray = |z: f32| Ray::new(Vec3::new(0.1, 0.2, z) - world.centre.as_vec3(), Vec3::NEG_Z);
        let (near, far, miss) = (bvh.steps(&ray(0.5)), bvh.steps(&ray(-98.5)), bvh.steps(&ray(-99.5)));
        for steps in [near, far] {
            assert!(steps.blocks >= 1 && steps.blocks <= 4 && steps.nodes >= 1, "{near:?} {far:?}");
        }
        assert_eq!((miss.blocks, miss.shapes, miss.objects), (0, 0, 0), "{miss:?}");
        // From the side, between two squares, and missing all of them.
        let beside = bvh.steps(&Ray { origin: ray(0.5).origin + Vec3::Y * 9.0, ..ray(0.5) });
        assert_eq!(beside.blocks, 0, "{beside:?}");
        let whole = bvh.steps(&Ray { tmin: 0.0, direction: Vec3::ZERO, ..ray(0.5) });
        assert_eq!(whole, Steps::default(), "no ray, no steps");
    }
}
