//! Closest points, against the nearest of all triangles by another algorithm.

use std::collections::BTreeMap;

use twincast::World;
use twincast::math::{DVec3, Vec3};
use twincast::scene::{Mesh, Scene};
use twincast::trace::bvh::{Bvh, Options, Preset};

use super::{Id, Triangle, cube, grid_sphere, on_grid, triangles};
use crate::scenes::{self, Random};

/// The nearest point of a triangle, region by region (Ericson 2005, *Real-Time Collision Detection*, 5.1.5).
fn ericson(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))
}

/// Every preset against every triangle.
#[track_caller]
fn assert_closest_points(scene: &Scene, points: &[Vec3]) {
    let world = World::new(scene).expect("the scene is sound");
    let placed = |t: &Triangle| {
        let to_world = t.to_world.map(|to_world| to_world.as_daffine3());
        t.corners.map(|p| to_world.map_or(p.as_dvec3(), |to_world| to_world.transform_point3(p.as_dvec3())))
    };
    let all: BTreeMap<Id, [DVec3; 3]> = triangles(&world).iter().map(|t| (t.id, placed(t))).collect();
    let distance = |p: Vec3, corners: &[DVec3; 3]| ericson(p.as_dvec3(), *corners).distance(p.as_dvec3());
    let bvhs = Preset::ALL.map(|preset| Bvh::build_with(&world, Options { preset, ..Options::default() }));
    for &p in points {
        let nearest = all.values().map(|corners| distance(p, corners)).fold(f64::INFINITY, f64::min);
        let found = bvhs[0].closest_point(p, f32::INFINITY).expect("there are triangles");
        let id = (found.instance, found.geometry, found.primitive);
        let is_near = |d: f64| (d - nearest).abs() <= 2e-7 * nearest + 1e-12;
        assert!(is_near(found.distance.into()) && is_near(distance(p, &all[&id])), "{p} is at {nearest}: {found:?}");
        let [a, b, c] = all[&id];
        let (u, v) = (f64::from(found.u), f64::from(found.v));
        let there = a * (1.0 - u - v) + b * u + c * v;
        let far = there.abs().max_element() + nearest;
        assert!(there.distance(found.point.as_dvec3()) <= 1e-6 * far, "{found:?} is at {there}");
        assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-7, "{found:?}");
        for bvh in &bvhs {
            assert_eq!(bvh.closest_point(p, f32::INFINITY), Some(found), "{:?} {p}", bvh.preset());
            assert_eq!(bvh.closest_point(p, found.distance), Some(found), "the range is closed");
            if found.distance > 0.0 {
                assert_eq!(bvh.closest_point(p, found.distance.next_down()), None);
            }
        }
    }
}

fn points(count: usize, reach: f32, seed: u64) -> Vec<Vec3> {
    let mut random = Random::new(seed);
    (0..count).map(|i| random.vec3() * if i % 2 == 0 { reach } else { 1.0 }).collect()
}

#[test]
fn closest_points_of_soups_and_closed_meshes() {
    for mesh in [scenes::soup(2000, 0.02, 1), scenes::soup(300, 1.0, 2), scenes::bumpy_sphere(24, 0.2, 3), cube()] {
        assert_closest_points(&scenes::of_mesh(mesh), &points(200, 5.0, 4));
    }
}

#[test]
fn closest_points_of_placed_objects() {
    assert_closest_points(&scenes::instanced(5), &points(200, 6.0, 7));
}

#[test]
fn closest_points_of_triangles_without_an_area() {
    let mut mesh = scenes::soup(200, 0.3, 8);
    // On a grid, so that middles are exact: each third corner is between the others, or one of them.
    let mut positions: Vec<Vec3> = mesh.positions.iter().map(|&p| on_grid(p)).collect();
    for i in (0..positions.len()).step_by(3) {
        positions[i + 2] = if i % 2 == 0 { (positions[i] + positions[i + 1]) * 0.5 } else { positions[i] };
    }
    positions[7] = Vec3::NAN;
    mesh.positions = positions.into();
    let world = World::new(&scenes::of_mesh(mesh.clone())).expect("sound");
    let bvh = Bvh::build(&world);
    for p in points(200, 3.0, 9) {
        // All of them are their first edge.
        let edges = triangles(&world).into_iter().filter(|t| !t.corners.iter().any(|p| p.is_nan()));
        let distances = edges.map(|t| {
            let [a, b] = [t.corners[0].as_dvec3(), t.corners[1].as_dvec3()];
            let share = (p.as_dvec3() - a).dot(b - a) / (b - a).length_squared();
            (a + (b - a) * share.clamp(0.0, 1.0)).distance(p.as_dvec3())
        });
        let nearest = distances.fold(f64::INFINITY, f64::min);
        let found = bvh.closest_point(p, f32::INFINITY).expect("there are triangles");
        assert!((f64::from(found.distance) - nearest).abs() <= 2e-7 * nearest, "{p} is at {nearest}: {found:?}");
    }
}

#[test]
fn at_equal_distances_the_lowest_id_is_closest() {
    let mesh = grid_sphere(12, 5);
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(mesh.clone())).expect("sound"));
    for (i, &p) in mesh.positions.iter().enumerate() {
        let lowest = mesh.triangles.iter().position(|corners| corners.contains(&(i as u32))).expect("it is used");
        let found = bvh.closest_point(p, 0.0).expect("it is a corner");
        assert_eq!((found.distance, found.primitive as usize, found.point), (0.0, lowest, p));
    }
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(cube())).expect("sound"));
    let lowest = |p: Vec3| bvh.closest_point(p, 10.0).map(|found| (found.primitive, found.distance));
    assert_eq!(lowest(Vec3::ZERO), Some((0, 1.0)), "all sides, and both halves of each");
    assert_eq!(lowest(Vec3::new(3.0, 0.0, 0.0)), Some((2, 2.0)), "the diagonal of a side");
    assert_eq!(lowest(Vec3::new(4.0, 5.0, 1.0)), Some((2, 5.0)), "an edge");
}

#[test]
fn there_is_no_closest_point() {
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(cube())).expect("sound"));
    for bad in [Vec3::NAN, Vec3::new(0.0, f32::NAN, 0.0), Vec3::INFINITY] {
        assert_eq!(bvh.closest_point(bad, f32::INFINITY), None);
    }
    for max_distance in [-1.0, f32::NAN, 0.5] {
        assert_eq!(bvh.closest_point(Vec3::ZERO, max_distance), None);
    }
    let empty = Bvh::build(&World::new(&scenes::of_mesh(Mesh::new(Vec::new(), Vec::new()))).expect("sound"));
    assert_eq!(empty.closest_point(Vec3::ZERO, f32::INFINITY), None);
}
