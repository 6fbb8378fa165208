//! Rays one at a time, and boxes of the caller's, against brute force.

use std::collections::BTreeSet;

use twincast::math::{Aabb, Vec3};
use twincast::scene::{Geometry, Material, Mesh, Scene};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::{BoxTree, Bvh, Isa, Options, Preset, SingleRay, TriangleFound, VisitFlow};
use twincast::{Ray, Tracer, TriangleMethod, World};

use super::{Triangle, closest_triangle, grid_sphere, triangles};
use crate::scenes::Random;

/// Two spheres of triangles, one in the other, and rays from everywhere, also through their corners.
fn world_and_rays() -> (World, Vec<Ray>) {
    let sphere = grid_sphere(9, 1);
    let larger: Vec<Vec3> = sphere.positions.iter().map(|&p| p * 2.0).collect();
    let larger = Mesh::new(larger, sphere.triangles.to_vec());
    let mut random = Random::new(5);
    let mut rays = Vec::new();
    for i in 0..3000 {
        let origin = random.vec3() * 3.0;
        let target = match i % 3 {
            0 => larger.positions[i % larger.positions.len()],
            1 => sphere.positions[i % sphere.positions.len()],
            _ => random.vec3(),
        };
        rays.push(Ray::new(origin, target - origin));
    }
    // Along axes, all but along them, short, long, from far away, and none at all.
    for i in 0..600 {
        let target = sphere.positions[i % sphere.positions.len()];
        let mut direction = target - random.vec3() * 3.0;
        direction[i % 3] *= [0.0, -0.0, 1e-20, -1e-17, 1e-15][i % 5];
        direction *= [1.0, 1e-30, 1e25, 1e-37][i % 4];
        rays.push(Ray::new(target - direction * [1.0, 1e30, 1e-25, 1e37][i % 4] * [1.0, 1.0, 1e4][i % 3], direction));
    }
    let infinite = Vec3::splat(f32::INFINITY);
    for direction in [Vec3::NAN, Vec3::ZERO, infinite, Vec3::new(0.0, f32::NAN, 1.0), Vec3::splat(1e-42)] {
        rays.extend([Ray::new(Vec3::ZERO, direction), Ray::new(infinite, Vec3::X), Ray::new(Vec3::NAN, Vec3::ONE)]);
    }
    rays.push(Ray { tmin: 2.0, tmax: 1.0, ..Ray::new(Vec3::ZERO, Vec3::ONE) });
    rays.push(Ray { tmax: f32::NAN, ..Ray::new(Vec3::ZERO, Vec3::ONE) });
    let geometries = vec![Geometry::Mesh(sphere), Geometry::Mesh(larger)];
    let scene = Scene::from_geometries(geometries, vec![Material::default()]);
    (World::new(&scene).expect("a world"), rays)
}

#[test]
fn single_rays_meet_what_brute_force_meets_with_its_normal() {
    let (world, rays) = world_and_rays();
    let brute = Brute::new(&world);
    let all = triangles(&world);
    let isas = Isa::available();
    for (isa, preset) in isas.flat_map(|isa| Preset::ALL.map(|preset| (isa, preset))) {
        let bvh = Bvh::build_with(&world, Options { isa, preset, ..Options::default() });
        for (i, ray) in rays.iter().enumerate() {
            let found = closest_triangle(&bvh, ray);
            assert_eq!(found.map(|found| found.hit), brute.closest(ray));
            assert_eq!(bvh.occludes(&SingleRay::from(ray)), found.is_some());
            if let Some(found) = found
                && i % 50 == 0
            {
                let triangle = all.iter().find(|triangle| triangle.id == found.hit.id());
                let normal = triangle.map(|Triangle { corners: [a, b, c], .. }| (b - a).cross(c - a));
                assert_eq!(Some(found.normal), normal);
            }
        }
    }
}

#[test]
fn a_ray_begins_at_its_origin_at_the_earliest() {
    let (world, rays) = world_and_rays();
    let bvh = Bvh::build(&world);
    for ray in rays.iter().step_by(5) {
        let ray = &Ray { tmin: 0.0, ..*ray };
        for tmin in [-1.0, f32::NEG_INFINITY, -0.0] {
            let early = SingleRay { tmin, ..SingleRay::from(ray) };
            let mut found = TriangleFound::NONE;
            let hit = bvh.closest_triangle(&early, &mut found).then_some(found);
            assert_eq!(hit, closest_triangle(&bvh, ray));
            assert_eq!(bvh.occludes(&early), hit.is_some());
            assert_eq!(early.ray().tmin, 0.0);
        }
        // What begins at no number begins nowhere.
        let never = SingleRay { tmin: f32::NAN, ..SingleRay::from(ray) };
        let mut nothing = TriangleFound::NONE;
        assert!(!bvh.closest_triangle(&never, &mut nothing) && !bvh.occludes(&never));
    }
}

#[test]
fn visitors_see_every_hit_up_to_where_they_look() {
    let (world, rays) = world_and_rays();
    let all = triangles(&world);
    for isa in Isa::available() {
        let bvh = Bvh::build_with(&world, Options { isa, ..Options::default() });
        for ray in rays.iter().step_by(7) {
            let mut seen = BTreeSet::new();
            bvh.visit_triangles(ray, &mut |found| {
                seen.insert(found.hit.id());
                VisitFlow::Continue(ray.tmax)
            });
            let is_hit = |triangle: &&Triangle| TriangleMethod::Exact.intersect(ray, triangle.corners).is_some();
            let expected: BTreeSet<_> = all.iter().filter(is_hit).map(|triangle| triangle.id).collect();
            assert_eq!(seen, expected);
            let mut first = 0;
            bvh.visit_triangles(ray, &mut |_| {
                first += 1;
                VisitFlow::Break(())
            });
            assert_eq!(first, usize::from(!expected.is_empty()));
        }
    }
}

#[test]
fn boxes_on_the_way_and_near_a_point_are_named() {
    let mut random = Random::new(3);
    let mut boxes: Vec<Aabb> = Vec::new();
    for _ in 0..500 {
        let min = random.vec3() * 10.0;
        boxes.push(Aabb { min, max: min + random.vec3().abs() });
    }
    boxes.push(Aabb::EMPTY);
    boxes.push(Aabb { min: Vec3::NAN, max: Vec3::ONE });
    let (tree, order) = BoxTree::build(&boxes, Options::default());
    let index = |name: u32| order[name as usize];
    for _ in 0..300 {
        // To the middle of a box: it is on the way, exactly or not.
        let target = &boxes[random.below(500)];
        let origin = random.vec3() * 12.0;
        let ray = Ray::new(origin, (target.min + target.max) * 0.5 - origin);
        let mut named = BTreeSet::new();
        tree.visit(&ray, &mut |i| {
            named.insert(index(i));
            VisitFlow::Continue(f32::INFINITY)
        });
        let mut in_no_order = BTreeSet::new();
        tree.visit_any(&ray, &mut |i| {
            in_no_order.insert(index(i));
            VisitFlow::Continue(f32::INFINITY)
        });
        assert_eq!(named, in_no_order);
        for (i, bounds) in boxes[..500].iter().enumerate() {
            // In f64, and by a margin that rounding does not reach.
            if pierces(&ray, bounds, 1e-4) {
                assert!(named.contains(&(i as u32)), "box {i}");
            }
        }
        // Others are named that share a leaf with these, but not all.
        assert!(named.len() < 250, "{} of 500 boxes", named.len());
        let radius = 2.0;
        let mut near = BTreeSet::new();
        tree.visit_near(origin, radius, &mut |i| {
            near.insert(index(i));
            VisitFlow::Continue(radius)
        });
        let is_near =
            |bounds: &Aabb| origin.clamp(bounds.min, bounds.max).as_dvec3().distance(origin.as_dvec3()) <= 2.0;
        let expected: BTreeSet<_> = (0..500u32).filter(|&i| is_near(&boxes[i as usize])).collect();
        assert!(near.is_superset(&expected) && near.len() < 250, "{} of 500 boxes", near.len());
    }
}

/// Whether a ray passes through a box that is smaller by `margin` on each side.
fn pierces(ray: &Ray, bounds: &Aabb, margin: f64) -> bool {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (origin, direction) = (f64::from(ray.origin[axis]), f64::from(ray.direction[axis]));
        let a = (f64::from(bounds.min[axis]) + margin - origin) / direction;
        let b = (f64::from(bounds.max[axis]) - margin - origin) / direction;
        let is_turned = direction < 0.0;
        near = near.max(if is_turned { b } else { a });
        far = far.min(if is_turned { a } else { b });
    }
    near <= far
}
