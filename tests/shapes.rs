//! All kinds of shapes together, and among triangles: every engine names the same hits.

use std::sync::Arc;

use twincast::lab::oracle::{self, Primitive};
use twincast::math::{DAffine3, DQuat, DVec3, Mat3, Vec3};
use twincast::scene::{Geometry, Group, Instance, Material, Scene};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::Bvh;
use twincast::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Plane, Polygon, Ray, Shape, Sphere, Tracer, World};

use crate::brute_force::assert_parity;
use crate::scenes::{self, Random};

/// `count` shapes of every bounded kind, without order, in the cube [-1, 1]^3.
fn shapes(count: usize, size: f32, seed: u64) -> Vec<Shape> {
    let mut random = Random::new(seed);
    let mut shape = |i: usize| {
        let centre = random.vec3();
        let radius = size * (0.2 + random.unit());
        let end = centre + random.vec3() * size * 2.0;
        match i % 9 {
            0 => Shape::Sphere(Sphere { centre, radius }),
            1 => Shape::Disk(Disk::new(centre, random.vec3(), radius).expect("a disk")),
            2 => Shape::Cuboid(Cuboid::new(centre.min(end), centre.max(end)).expect("a box")),
            3 | 4 => {
                Shape::Cylinder(Cylinder::new(centre, end, radius * 0.5, i.is_multiple_of(2)).expect("a cylinder"))
            }
            5 | 6 => {
                let tip = [0.0, radius * 0.3][i % 2];
                Shape::Cone(Cone::new(centre, radius, end, tip, i % 4 < 2).expect("a cone"))
            }
            7 => {
                let axes = Mat3::from_cols(random.vec3(), random.vec3(), random.vec3()) * size;
                Shape::Ellipsoid(Ellipsoid::new(centre, axes).expect("an ellipsoid"))
            }
            _ => {
                let (x, y, n) = (random.vec3() * size, random.vec3() * size, 3 + random.below(12));
                let corner = |k: usize| {
                    let angle = k as f32 / n as f32 * std::f32::consts::TAU;
                    centre + (x * angle.cos() + y * angle.sin()) * (0.4 + random.unit())
                };
                Shape::Polygon(Arc::new(Polygon::new((0..n).map(corner).collect()).expect("a polygon")))
            }
        }
    };
    (0..count).map(&mut shape).collect()
}

/// Shapes and triangles in world coordinates, shapes placed several times, planes in both.
fn mixed(count: usize, size: f32, seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let plane = |point, normal| Shape::Plane(Plane::new(point, normal).expect("a plane"));
    let mut fixed = shapes(count, size, seed + 1);
    fixed.insert(count / 2, plane(Vec3::new(0.0, -1.3, 0.0), Vec3::Y));
    let mut placed = shapes(count / 3, size, seed + 2);
    placed.insert(0, plane(Vec3::NEG_Z * 2.0, Vec3::new(0.3, 0.2, 1.0)));
    let group = |geometries| Group { name: String::new(), geometries };
    let mut instances =
        vec![Instance { name: "all".into(), group: 0, transform: DAffine3::IDENTITY, transform_end: None }];
    for i in 0..4 {
        let v = |p: Vec3| p.as_dvec3();
        let transform = DAffine3::from_scale_rotation_translation(
            DVec3::splat(1.0) + v(random.vec3()) * 0.5,
            DQuat::from_rotation_y(f64::from(random.unit()) * 6.0),
            v(random.vec3()) * 2.0,
        );
        instances.push(Instance { name: format!("node {i}"), group: 1, transform, transform_end: None });
    }
    Scene {
        geometries: vec![
            Geometry::Mesh(scenes::soup(count, size, seed + 3)),
            Geometry::Shapes { shapes: fixed, material: 0 },
            Geometry::Shapes { shapes: placed, material: 0 },
        ],
        groups: vec![group(0..2), group(2..3)],
        instances,
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let targets: Vec<Vec3> = (0..300).map(|_| random.vec3()).collect();
    scenes::rays(count, &targets, seed)
}

#[test]
fn native_is_brute_force() {
    for (count, size, seed) in [(300, 0.1, 1), (40, 0.8, 2), (9, 0.3, 3)] {
        let hits = assert_parity(&mixed(count, size, seed), &rays(1200, seed));
        assert!(hits > 600, "{hits} hits");
    }
}

/// Bundles: rays from one point.
#[test]
fn bundles_meet_shapes_and_planes() {
    let eye = Vec3::new(0.3, 0.4, 3.0);
    let pixel = |i: usize| Vec3::new((i % 32) as f32 / 32.0 - 0.5, (i / 32) as f32 / 32.0 - 0.6, -1.0);
    let rays: Vec<Ray> = (0..1024).map(|i| Ray::new(eye, pixel(i))).collect();
    assert!(assert_parity(&mixed(100, 0.2, 4), &rays) > 600);
}

/// A plane alone, under a transform, and as what the nearest of several hits is.
#[test]
fn planes_are_met_however_they_are_placed() {
    let floor = Shape::Plane(Plane::new(Vec3::ZERO, Vec3::Y).expect("a plane"));
    let mut scene =
        Scene::from_geometries(vec![Geometry::Shapes { shapes: vec![floor], material: 0 }], vec![Material::default()]);
    let quarter = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let wall = DAffine3::from_rotation_translation(quarter, DVec3::new(5.0, 0.0, 0.0));
    scene.instances.push(Instance { name: "wall".into(), group: 0, transform: wall, transform_end: None });
    let world = World::new(&scene).expect("sound");
    let bvh = Bvh::build(&world);
    let ray = Ray::new(Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, -0.1, 0.0));
    let hit = bvh.closest(&ray).expect("the wall is hit");
    assert_eq!(hit.instance, 1);
    assert!((hit.t - 5.0).abs() < 1e-5);
    let mut all = Vec::new();
    bvh.all_hits(&ray, &mut all);
    assert_eq!(all.iter().map(|hit| (hit.instance, hit.t.round())).collect::<Vec<_>>(), [(1, 5.0), (0, 10.0)]);
    assert!(bvh.occluded(&ray) && !bvh.occluded(&Ray { tmax: 4.9, ..ray }));
    assert!(bvh.closest(&Ray::new(ray.origin, Vec3::new(-1.0, 0.1, 0.0))).is_none());
    assert!(scene.bounds().is_empty(), "a plane has no bounds");
}

/// The nearest primitive of brute force is that of exact arithmetic, for shapes in world coordinates.
#[test]
fn brute_force_is_the_oracle() {
    let shapes = shapes(45, 0.3, 9);
    let scene = Scene::from_geometries(vec![Geometry::Shapes { shapes, material: 0 }], vec![Material::default()]);
    let world = World::new(&scene).expect("sound");
    let brute = Brute::new(&world);
    let (mut hits, mut ties) = (0, 0);
    for ray in rays(600, 10) {
        let exact = oracle::closest(&world, &ray);
        let found = brute.closest(&ray);
        hits += usize::from(found.is_some());
        let is_one_of_them = match &found {
            Some(hit) => exact.iter().any(|(id, _)| *id == hit.id()),
            None => exact.is_empty(),
        };
        // Two t within their bounds.
        let hit = found.and_then(|hit| Some((hit, oracle::primitive(&world, &hit, ray.time)?)));
        let t = hit.and_then(|(hit, p): (_, Primitive)| Some((hit.t, oracle::meet(&ray, &p)?.t.to_f64())));
        if !is_one_of_them {
            ties += 1;
        } else if let Some((t, exact)) = t {
            assert!((f64::from(t) - exact).abs() <= exact.abs() * 2e-7, "{t} {exact}");
        }
    }
    assert!(hits > 250 && ties < 2, "{hits} hits, {ties} ties");
}

/// Cylinders and cones are hit where a ray goes exactly through a rim, however far from, and missed a hair beyond it,
/// as exact arithmetic has it.
#[test]
fn rims_are_decided_exactly() {
    let mut random = Random::new(11);
    let (mut hits, mut misses) = (0, 0);
    for case in 0..8000 {
        let capped = case >= 4000;
        let eighths = |random: &mut Random| (random.vec3() * 8.0).round() / 8.0;
        let (base, radius) = (eighths(&mut random), (1 + random.below(8)) as f32 / 8.0);
        let (axis, side) = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)][case % 3];
        let (apex, apex_radius) = (base + axis * 0.625, radius * [1.0, 0.5, 1.5, 0.0][case / 3 % 4]);
        let shape = if apex_radius == radius {
            Shape::Cylinder(Cylinder::new(base, apex, radius, capped).expect("a cylinder"))
        } else {
            Shape::Cone(Cone::new(base, radius, apex, apex_radius, capped).expect("a cone"))
        };
        let rim = [base + side * radius, apex + side * apex_radius][case % 2];
        // Steps on a grid, so that most rays pass the rim at t = 1 without rounding; a quarter goes past it by one step
        // of f32.
        let way = eighths(&mut random) * 2f32.powi(random.below(16) as i32);
        let mut origin = rim - way;
        if case % 4 == 0 {
            let k = random.below(3);
            origin[k] = if random.below(2) == 0 { origin[k].next_up() } else { origin[k].next_down() };
        }
        let ray = Ray::new(origin, way);
        if !ray.is_valid() {
            continue;
        }
        let found = shape.intersect(&ray).map(|hit| hit.t);
        let body = oracle::Body::Shape(&shape);
        let exact = oracle::meet(&ray, &Primitive { body, to_world: None }).filter(|meeting| meeting.in_range);
        let exact = exact.map(|meeting| meeting.t.to_f64());
        assert_eq!(found.is_some(), exact.is_some(), "{shape:?} {ray:?}: {found:?}, exactly {exact:?}");
        if let (Some(found), Some(exact)) = (found, exact) {
            assert!((found - exact).abs() <= exact / f64::from(1 << 26), "{shape:?} {ray:?}: {found}, exactly {exact}");
        }
        *if found.is_some() { &mut hits } else { &mut misses } += 1;
    }
    assert!(hits > 2000 && misses > 200, "{hits} hits, {misses} misses");
    // The one that was missed.
    let (base, apex) = (Vec3::new(0.625, 0.875, 0.375), Vec3::new(0.625, 1.5, 0.375));
    let cone = Shape::Cone(Cone::new(base, 0.625, apex, 0.3125, false).expect("a cone"));
    let (origin, direction) = (Vec3::new(10121.935, -97659.4, -86222.95), Vec3::new(-10121.31, 97660.9, 86223.64));
    assert_eq!(cone.intersect(&Ray::new(origin, direction)).map(|hit| hit.t as f32), Some(1.0));
}

#[cfg(feature = "embree")]
#[test]
fn embree_differs_where_rounding_may_decide_only() {
    use twincast::lab::{Answers, Class, classify_closest};
    use twincast::trace::embree::{Embree, Options};
    use twincast::{Batch, Width};
    for (count, size, seed) in [(300, 0.1, 1), (40, 0.8, 2)] {
        let world = World::new(&mixed(count, size, seed)).expect("sound");
        let (bvh, brute) = (Bvh::build(&world), Brute::new(&world));
        let embree = Embree::new(&world, &Options::default()).expect("Embree builds");
        let rays = rays(4000, seed);
        for width in Width::ALL {
            let batch = Batch { width, coherent: false };
            let mut hits = vec![None; rays.len()];
            embree.closest_batch(&rays, &mut hits, batch);
            let mut occluded = vec![false; rays.len()];
            embree.occluded_batch(&rays, &mut occluded, batch);
            let mut differ = 0;
            for (i, ray) in rays.iter().enumerate() {
                let native = bvh.closest(ray);
                let class = classify_closest(&world, ray, &Answers { native, embree: hits[i], brute: None });
                assert!(class < Class::NativeWrong, "{class:?} {ray:?} {native:?} {:?}", hits[i]);
                differ += usize::from(class != Class::Agree || occluded[i] != native.is_some());
                assert_eq!(brute.occluded(ray), native.is_some());
            }
            assert!(differ < 40, "{differ} of {} differ", rays.len());
        }
    }
}

#[test]
fn what_makes_no_shape_is_refused_with_a_reason() {
    let nan = f32::NAN;
    let corners =
        |points: &[(f32, f32, f32)]| Polygon::new(points.iter().map(|&(x, y, z)| Vec3::new(x, y, z)).collect());
    let square = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.2)];
    let in_line = [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 2.0, 0.0)];
    let bow = [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)];
    let refused = [
        (Plane::new(Vec3::ZERO, Vec3::ZERO).map(Shape::Plane), "normal"),
        (Disk::new(Vec3::ZERO, Vec3::Y, 0.0).map(Shape::Disk), "above 0"),
        (Disk::new(Vec3::NAN, Vec3::Y, 1.0).map(Shape::Disk), "not finite"),
        (Cuboid::new(Vec3::ONE, Vec3::ZERO).map(Shape::Cuboid), "smallest"),
        (Cuboid::new(Vec3::ZERO, Vec3::X).map(Shape::Cuboid), "no area"),
        (Cylinder::new(Vec3::ONE, Vec3::ONE, 1.0, true).map(Shape::Cylinder), "apart"),
        (Cylinder::new(Vec3::ONE, Vec3::ZERO, nan, true).map(Shape::Cylinder), "above 0"),
        (Cone::new(Vec3::ONE, 0.0, Vec3::ZERO, 0.0, true).map(Shape::Cone), "above 0"),
        (Cone::new(Vec3::ONE, -1.0, Vec3::ZERO, 2.0, true).map(Shape::Cone), "below 0"),
        (Ellipsoid::new(Vec3::ONE, Mat3::from_diagonal(Vec3::X)).map(Shape::Ellipsoid), "one plane"),
        (corners(&square[..2]).map(|p| Shape::Polygon(Arc::new(p))), "three"),
        (corners(&square).map(|p| Shape::Polygon(Arc::new(p))), "off the plane"),
        (corners(&in_line).map(|p| Shape::Polygon(Arc::new(p))), "no area"),
        (corners(&bow).map(|p| Shape::Polygon(Arc::new(p))), "no area"),
        (
            corners(&[(nan, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]).map(|p| Shape::Polygon(Arc::new(p))),
            "corner 0",
        ),
    ];
    for (shape, reason) in refused {
        let message = shape.expect_err(reason).to_string();
        assert!(message.contains(reason), "{message}");
    }
    // Made without a check, they are not hit.
    let flat = Shape::Disk(Disk { centre: Vec3::ZERO, normal: Vec3::Y, radius: nan });
    assert!(flat.check().is_err() && flat.bounds().is_empty());
    assert!(flat.intersect(&Ray::new(Vec3::Y, Vec3::NEG_Y)).is_none());
}
