//! The Embree engine against closed forms and a plain f64 loop over all triangles.

use std::sync::Arc;

use twincast::math::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use twincast::scene::{Geometry, Group, Instance, Mesh};
use twincast::trace::Primitives;
use twincast::trace::embree::{self, Embree, Options, Quality};
use twincast::{Batch, Error, Hit, Ray, Scene, Shape, Sphere, Tracer, Width, World};

/// Barycentric weights and sines of less than this are too close to call in f32.
const MARGIN: f64 = 1e-3;

struct Random(u32);

impl Random {
    /// Over [-1, 1).
    fn signed(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// From outside the unit cube to somewhere near its middle; not a unit direction.
    fn ray(&mut self) -> Ray {
        let origin = self.point().normalize_or(Vec3::X) * 4.0;
        Ray::new(origin, self.point() - origin)
    }

    fn rays(&mut self, count: usize) -> Vec<Ray> {
        (0..count).map(|_| self.ray()).collect()
    }

    /// Triangles of any direction in the unit cube.
    fn soup(&mut self, count: u32, size: f32) -> Mesh {
        let corners = (0..count).flat_map(|_| {
            let middle = self.point();
            [(); 3].map(|()| middle + self.point() * size)
        });
        Mesh::new(corners.collect(), (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }
}

/// A triangle as placed, in f64.
struct Triangle {
    id: (u32, u32, u32),
    corners: [DVec3; 3],
}

/// Where a ray's line meets a triangle's plane.
struct Crossing {
    t: f64,
    u: f64,
    v: f64,
    /// Cosine of the angle to the normal.
    cosine: f64,
}

impl Triangle {
    fn cross(&self, ray: &Ray) -> Option<Crossing> {
        let [a, b, c] = self.corners;
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let matrix = DMat3::from_cols(b - a, c - a, -direction);
        let cosine = matrix.determinant() / ((b - a).cross(c - a).length() * direction.length());
        let solution = matrix.inverse() * (origin - a);
        let crossing = Crossing { t: solution.z, u: solution.x, v: solution.y, cosine: cosine.abs() };
        (crossing.cosine > 0.0 && solution.is_finite()).then_some(crossing)
    }

    /// By how much the ray hits: the smallest weight, and the distance to the ends of its range.
    fn inside(ray: &Ray, c: &Crossing) -> f64 {
        let (tmin, tmax) = (f64::from(ray.tmin), f64::from(ray.tmax));
        c.u.min(c.v).min(1.0 - c.u - c.v).min(c.t - tmin).min(tmax - c.t)
    }
}

fn triangles(world: &World) -> Vec<Triangle> {
    let mut all = Vec::new();
    let mut add = |part: &twincast::trace::Part, instance: u32, to_world: DAffine3| {
        let Primitives::Triangles { positions, triangles } = &part.primitives else { return };
        for (primitive, corners) in triangles.iter().enumerate() {
            let corners = corners.map(|i| to_world.transform_point3(positions[i as usize].as_dvec3()));
            all.push(Triangle { id: (instance, part.geometry, primitive as u32), corners });
        }
    };
    world.parts[world.fixed.clone()].iter().for_each(|part| add(part, part.instance, DAffine3::IDENTITY));
    for placement in &world.placements {
        for part in &world.parts[world.objects[placement.object as usize].clone()] {
            add(part, placement.instance, placement.to_world.as_daffine3());
        }
    }
    all
}

/// Holds an answer to the f64 loop, with room for f32 rounding at edges and at equal t.
fn check(triangles: &[Triangle], ray: &Ray, hit: Option<Hit>) {
    let mut nearest_clear = f64::INFINITY;
    for triangle in triangles {
        let clear = |c: &Crossing| c.cosine > MARGIN && Triangle::inside(ray, c) > MARGIN;
        if let Some(crossing) = triangle.cross(ray).filter(clear) {
            nearest_clear = nearest_clear.min(crossing.t);
        }
    }
    let Some(hit) = hit else {
        assert!(nearest_clear == f64::INFINITY, "{ray:?} misses what it hits at {nearest_clear}");
        return;
    };
    let named =
        triangles.iter().find(|triangle| triangle.id == hit.id()).expect("a hit names a triangle that is there");
    let crossing = named.cross(ray).expect("the ray crosses the plane of what it hit");
    let close = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-4 / crossing.cosine.max(1e-9);
    assert!(Triangle::inside(ray, &crossing) >= -MARGIN / crossing.cosine, "{ray:?} does not meet {hit:?}");
    assert!(close(hit.t, crossing.t) && close(hit.u, crossing.u) && close(hit.v, crossing.v), "{ray:?} {hit:?}");
    assert!(crossing.t <= nearest_clear + MARGIN / crossing.cosine, "{ray:?}: {hit:?} hides {nearest_clear}");
}

/// The same for an occlusion test, where it is clear.
fn check_occluded(triangles: &[Triangle], ray: &Ray, occluded: bool) {
    let crossings = triangles.iter().filter_map(|triangle| triangle.cross(ray));
    let (mut clear, mut possible) = (false, false);
    for crossing in crossings {
        let inside = Triangle::inside(ray, &crossing);
        clear |= crossing.cosine > MARGIN && inside > MARGIN;
        possible |= inside > -MARGIN || crossing.cosine < MARGIN;
    }
    assert!(if occluded { possible } else { !clear }, "{ray:?}: occluded is {occluded}");
}

fn world(geometries: Vec<Geometry>) -> World {
    World::new(&Scene::from_geometries(geometries, Vec::new())).unwrap()
}

fn build(world: &World) -> Embree {
    Embree::new(world, &Options::default()).unwrap()
}

fn closest(tracer: &Embree, rays: &[Ray], batch: Batch) -> Vec<Option<Hit>> {
    let mut hits = vec![None; rays.len()];
    tracer.closest_batch(rays, &mut hits, batch);
    hits
}

fn occluded(tracer: &Embree, rays: &[Ray], batch: Batch) -> Vec<bool> {
    let mut answers = vec![false; rays.len()];
    tracer.occluded_batch(rays, &mut answers, batch);
    answers
}

fn batches() -> impl Iterator<Item = Batch> {
    Width::ALL.into_iter().flat_map(|width| [false, true].map(|coherent| Batch { width, coherent }))
}

fn square() -> Mesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Mesh::new(corners.iter().map(|&(x, y)| Vec3::new(x, y, 0.0)).collect(), vec![[0, 1, 2], [0, 2, 3]])
}

/// Straight down, at (x, y).
fn down(x: f32, y: f32) -> Ray {
    Ray::new(Vec3::new(x, y, 5.0), -Vec3::Z)
}

/// Whether a number of Embree's is the one that is expected. Where that divides it multiplies by an approximate
/// reciprocal, which after a step of Newton's is off in the last place on some processors (AMD's without AVX-512).
fn rounds_to(found: f32, expected: f32) -> bool {
    (found - expected).abs() <= 2.0 * f32::EPSILON * expected
}

#[test]
fn ids_and_parameters_are_the_scenes() {
    let tracer = build(&world(vec![Geometry::Shapes { shapes: vec![], material: 0 }, Geometry::Mesh(square())]));
    // Between corners 0, 2 and 3: a quarter of the way from corner 0 to corner 3, and no part of corner 2.
    let hit = tracer.closest(&down(-0.75, -0.25)).unwrap();
    assert_eq!((hit.primitive, hit.geometry, hit.instance), (1, 1, 0));
    assert!(rounds_to(hit.t, 5.0) && rounds_to(hit.u, 0.125) && rounds_to(hit.v, 0.25), "{hit:?}");
    let short = Ray { tmax: 4.5, ..down(-0.75, -0.25) };
    let late = Ray { tmin: 5.5, ..down(-0.75, -0.25) };
    assert!(tracer.occluded(&down(-0.75, -0.25)));
    for ray in [short, late, down(1.5, 0.0)] {
        assert!(tracer.closest(&ray).is_none() && !tracer.occluded(&ray), "{ray:?}");
    }
}

#[test]
fn wrong_index_is_an_error_that_names_geometry_and_triangle() {
    let mut mesh = square();
    Arc::make_mut(&mut mesh.triangles).push([1, 4, 2]);
    let world = world(vec![Geometry::Mesh(square()), Geometry::Mesh(mesh)]);
    let error = Embree::new(&world, &Options::default()).err().unwrap();
    assert!(matches!(error, Error::Backend { backend: "embree", .. }));
    assert_eq!(
        error.to_string(),
        "embree: geometry 1: triangle 2 has corner 4, but there are 4 vertices; corners count from 0"
    );
}

#[test]
fn nan_infinite_and_huge_vertices_leave_the_other_triangles_alone() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        for quality in [Quality::Low, Quality::Medium, Quality::High] {
            let mut mesh = square();
            Arc::make_mut(&mut mesh.positions)[3].y = bad;
            let options = Options { quality, robust: false, ..Options::default() };
            let tracer = Embree::new(&world(vec![Geometry::Mesh(mesh)]), &options).unwrap();
            assert_eq!(tracer.closest(&down(0.5, -0.5)).map(|hit| hit.primitive), Some(0), "{bad}");
            assert_eq!(tracer.closest(&down(-0.5, 0.5)), None, "{bad}");
        }
    }
}

#[test]
fn empty_worlds_and_meshes_are_missed() {
    let empty = Mesh::new(vec![], vec![]);
    let unused = Mesh::new(vec![Vec3::ZERO], vec![]);
    let degenerate = Mesh::new(vec![Vec3::splat(f32::NAN)], vec![[0, 0, 0]]);
    let shapes = vec![Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: f32::NAN })];
    let geometries = [
        vec![],
        vec![Geometry::Mesh(empty.clone())],
        vec![Geometry::Mesh(unused)],
        vec![Geometry::Mesh(degenerate)],
        vec![Geometry::Shapes { shapes: vec![], material: 0 }],
        vec![Geometry::Shapes { shapes, material: 0 }],
    ];
    let rays = Random(5).rays(50);
    for geometries in geometries {
        // Once as it is, and twice as an instance.
        let mut scene = Scene::from_geometries(geometries, Vec::new());
        for copies in 0..2 {
            let tracer = build(&World::new(&scene).unwrap());
            for batch in batches() {
                assert!(closest(&tracer, &rays, batch).iter().all(Option::is_none), "{copies} copies");
                assert!(!occluded(&tracer, &rays, batch).contains(&true));
            }
            scene.instances.push(scene.instances[0].clone());
        }
    }
    // An empty mesh does not shift the ids of the next.
    let tracer = build(&world(vec![Geometry::Mesh(empty), Geometry::Mesh(square())]));
    assert_eq!(tracer.closest(&down(0.5, -0.5)).map(|hit| hit.geometry), Some(1));
}

#[test]
fn every_width_agrees_with_the_f64_loop_and_with_width_one() {
    let mut random = Random(1);
    let world = world(vec![Geometry::Mesh(random.soup(300, 0.3)), Geometry::Mesh(random.soup(100, 0.5))]);
    let truth = triangles(&world);
    let tracer = build(&world);
    // No multiple of a width, and with rays that end early or start late.
    let mut rays = random.rays(1003);
    for (i, ray) in rays.iter_mut().enumerate() {
        match i % 4 {
            0 => ray.tmax = 0.9,
            1 => ray.tmin = 0.8,
            _ => {}
        }
    }
    let single = closest(&tracer, &rays, Batch::default());
    assert!(single.iter().flatten().count() > 300 && single.iter().any(Option::is_none));
    for batch in batches() {
        let (hits, shadows) = (closest(&tracer, &rays, batch), occluded(&tracer, &rays, batch));
        for (i, ray) in rays.iter().enumerate() {
            check(&truth, ray, hits[i]);
            check_occluded(&truth, ray, shadows[i]);
        }
        let renamed = hits.iter().zip(&single).filter(|(a, b)| a.map(|hit| hit.id()) != b.map(|hit| hit.id()));
        assert!(renamed.count() <= 2, "{batch:?}: only ties may name another triangle");
    }
}

#[test]
fn invalid_rays_miss_and_leave_their_neighbours_alone() {
    let world = world(vec![
        Geometry::Mesh(Random(9).soup(200, 0.4)),
        Geometry::Shapes { shapes: vec![Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 0.3 })], material: 0 },
    ]);
    let tracer = build(&world);
    let mut rays = Random(2).rays(61);
    for (i, ray) in rays.iter_mut().enumerate() {
        match i % 11 {
            1 => ray.origin.y = f32::NAN,
            3 => ray.direction = Vec3::ZERO,
            4 => (ray.tmin, ray.tmax) = (2.0, 1.0),
            7 => ray.direction.x = f32::INFINITY,
            8 => ray.tmin = f32::NAN,
            9 => ray.tmin = -1.0,
            _ => {}
        }
    }
    // A whole packet without a valid ray, and a single one in another.
    rays[16..32].fill(Ray::new(Vec3::NAN, Vec3::X));
    rays[33..48].fill(Ray::new(Vec3::NAN, Vec3::X));
    let expected: Vec<_> = rays.iter().map(|ray| tracer.closest(ray)).collect();
    assert!(expected.iter().flatten().count() > 5);
    for batch in batches() {
        let (hits, shadows) = (closest(&tracer, &rays, batch), occluded(&tracer, &rays, batch));
        for (i, ray) in rays.iter().enumerate() {
            assert!(ray.is_valid() || hits[i].is_none());
            assert_eq!(hits[i].map(|hit| hit.id()), expected[i].map(|hit| hit.id()), "{batch:?}, ray {i}");
            assert_eq!(shadows[i], expected[i].is_some(), "{batch:?}, ray {i}");
        }
    }
}

/// Debian's package ends the process when it is given a coordinate above 1.844e18.
#[test]
fn rays_beyond_embrees_numbers_miss_and_leave_their_neighbours_alone() {
    let tracer = build(&world(vec![Geometry::Mesh(Random(9).soup(200, 0.4))]));
    let mut rays = Random(2).rays(48);
    for (i, ray) in rays.iter_mut().enumerate() {
        match i % 7 {
            1 => ray.origin.y = 1.9e18,
            3 => ray.direction *= 1e18,
            4 => ray.origin.x = -f32::MAX,
            6 => ray.direction.z = f32::MAX,
            _ => {}
        }
        assert!(ray.is_valid());
    }
    let near: Vec<usize> = (0..rays.len()).filter(|i| [0, 2, 5].contains(&(i % 7))).collect();
    let expected: Vec<_> = rays.iter().map(|ray| tracer.closest(ray)).collect();
    assert!(near.iter().filter(|&&i| expected[i].is_some()).count() > 5);
    for batch in batches() {
        let (hits, shadows) = (closest(&tracer, &rays, batch), occluded(&tracer, &rays, batch));
        for i in 0..rays.len() {
            let known = if near.contains(&i) { expected[i].map(|hit| hit.id()) } else { None };
            assert_eq!((hits[i].map(|hit| hit.id()), shadows[i]), (known, known.is_some()), "{batch:?}, ray {i}");
        }
    }
}

/// What f32 cannot invert is refused; what it can, by rays that stay below Embree's numbers in the object, is hit.
#[test]
fn objects_are_placed_as_far_as_embrees_numbers_go() {
    let world = |scale: f64| {
        let place = |x: f64| Instance {
            name: String::new(),
            group: 0,
            transform: DAffine3::from_scale_rotation_translation(
                DVec3::splat(scale),
                DQuat::IDENTITY,
                DVec3::X * x * scale,
            ),
            transform_end: None,
        };
        let scene = Scene {
            geometries: vec![Geometry::Mesh(square())],
            groups: vec![Group { name: String::new(), geometries: 0..1 }],
            instances: vec![place(-2.0), place(2.0)],
            materials: vec![Default::default()],
            ..Scene::default()
        };
        World::new(&scene).expect("sound")
    };
    let tiny = world(1e-10);
    let tracer = build(&tiny);
    let ray = Ray { origin: Vec3::new(-1.7e-10, 0.4e-10, 1e-10), ..down(0.0, 0.0) };
    for (direction, hits) in [(1.0f32, true), (1e5, true), (1e9, false), (1e17, false)] {
        let ray = Ray { direction: Vec3::NEG_Z * direction, ..ray };
        assert_eq!(tracer.closest(&ray).is_some(), hits, "{direction}");
        assert_eq!(occluded(&tracer, &[ray; 8], Batch { width: Width::Eight, coherent: false }), [hits; 8]);
    }
    let error = Embree::new(&world(1e-16), &Options::default()).err().expect("it is refused");
    assert!(
        matches!(&error, Error::Backend { backend: "embree", message } if message.contains("instance 0")),
        "{error}"
    );
}

/// Two places, one of them mirrored.
fn places() -> [DAffine3; 2] {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    [
        DAffine3::from_scale_rotation_translation(DVec3::new(0.5, 0.8, 0.6), turn, DVec3::new(-0.4, 0.1, 0.2)),
        DAffine3::from_scale_rotation_translation(DVec3::new(-0.7, 0.4, 0.5), turn, DVec3::new(0.5, 0.0, -0.3)),
    ]
}

#[test]
fn an_instanced_mesh_is_hit_like_a_baked_one() {
    let mesh = Random(3).soup(200, 0.3);
    let scene = |groups: &[u32]| {
        let count = groups.iter().max().unwrap() + 1;
        let instance = |(&group, transform)| Instance { name: String::new(), group, transform, transform_end: None };
        Scene {
            // A mesh before, so that ids are not all zero.
            geometries: std::iter::repeat_n(Geometry::Mesh(mesh.clone()), 2 * count as usize).collect(),
            groups: (0..count).map(|g| Group { name: String::new(), geometries: 2 * g..2 * g + 2 }).collect(),
            instances: groups.iter().zip(places()).map(instance).collect(),
            ..Scene::default()
        }
    };
    let baked = World::new(&scene(&[0, 1])).unwrap();
    let instanced = World::new(&scene(&[0, 0])).unwrap();
    assert_eq!((baked.placements.len(), instanced.placements.len()), (0, 2));
    let rays = Random(4).rays(2000);
    let (truth, baked, instanced) = (triangles(&instanced), build(&baked), build(&instanced));
    let expected = closest(&baked, &rays, Batch::default());
    assert!(expected.iter().flatten().count() > 500);
    for batch in batches() {
        let hits = closest(&instanced, &rays, batch);
        rays.iter().zip(&hits).for_each(|(ray, hit)| check(&truth, ray, *hit));
        // The two meshes of a group coincide, so either may be named.
        let name = |hit: &Option<Hit>| hit.map(|hit| (hit.instance, hit.primitive));
        let different = hits.iter().zip(&expected).filter(|(a, b)| name(a) != name(b)).count();
        assert!(different <= 4, "{batch:?}: {different} rays differ");
        let shadows = occluded(&instanced, &rays, batch);
        rays.iter().zip(shadows).for_each(|(ray, shadow)| check_occluded(&truth, ray, shadow));
    }
}

/// Roots of |o + t d - c| = r for t in the ray's range, by the textbook formula in f64.
fn sphere_root(ray: &Ray, centre: DVec3, radius: f64, to_object: &DAffine3) -> Option<f64> {
    let origin = to_object.transform_point3(ray.origin.as_dvec3()) - centre;
    let direction = to_object.transform_vector3(ray.direction.as_dvec3());
    let (a, b, c) = (direction.dot(direction), origin.dot(direction), origin.dot(origin) - radius * radius);
    let discriminant = b * b - a * c;
    let root = |sign: f64| (-b + sign * discriminant.sqrt()) / a;
    let range = f64::from(ray.tmin)..=f64::from(ray.tmax);
    (discriminant >= 0.0).then(|| [root(-1.0), root(1.0)].into_iter().find(|t| range.contains(t))).flatten()
}

#[test]
fn spheres_are_hit_where_the_closed_form_says() {
    let mut random = Random(6);
    let mut spheres: Vec<_> =
        (0..40).map(|_| Sphere { centre: random.point(), radius: 0.2 + 0.1 * random.signed() }).collect();
    spheres[7].radius = 0.0;
    spheres[8].radius = f32::NAN;
    spheres[9].centre.x = f32::INFINITY;
    let shapes = spheres.iter().map(|&sphere| Shape::Sphere(sphere)).collect();
    let mut scene = Scene::from_geometries(vec![Geometry::Shapes { shapes, material: 0 }], Vec::new());
    let mut rays = random.rays(501);
    // From inside the spheres too.
    rays.extend((0..500).map(|_| Ray::new(random.point(), random.point())));
    rays.iter_mut().step_by(3).for_each(|ray| ray.tmax = 0.8);
    for placed in [false, true] {
        if placed {
            // Scaled spheres, which only an instance can hold.
            let instance = scene.instances.remove(0);
            scene.instances = places().map(|transform| Instance { transform, ..instance.clone() }).into();
        }
        let world = World::new(&scene).unwrap();
        let inverses: Vec<_> = world.placements.iter().map(|placement| placement.to_object).collect();
        let inverses = if placed { inverses } else { vec![DAffine3::IDENTITY] };
        let tracer = build(&world);
        let nearest = |ray: &Ray| {
            let candidates = inverses.iter().enumerate().flat_map(|(instance, inverse)| {
                let usable = spheres.iter().enumerate().filter(|(_, s)| s.radius > 0.0 && s.centre.is_finite());
                usable.filter_map(move |(i, s)| {
                    let t = sphere_root(ray, s.centre.as_dvec3(), f64::from(s.radius), inverse)?;
                    Some((t, instance as u32, i as u32))
                })
            });
            candidates.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let expected: Vec<_> = rays.iter().map(nearest).collect();
        assert!(expected.iter().flatten().count() > 200);
        for batch in batches() {
            let (hits, shadows) = (closest(&tracer, &rays, batch), occluded(&tracer, &rays, batch));
            for (i, (hit, expected)) in hits.iter().zip(&expected).enumerate() {
                let found = hit.map(|hit| (hit.instance, hit.primitive));
                assert_eq!(found, expected.map(|(_, instance, primitive)| (instance, primitive)), "{batch:?} {i}");
                if let (Some(hit), Some((t, ..))) = (hit, expected) {
                    assert!((f64::from(hit.t) - t).abs() <= 1e-5 * t.max(1.0), "{batch:?} {i}: {} {t}", hit.t);
                }
                assert_eq!(shadows[i], expected.is_some(), "{batch:?} {i}");
            }
        }
    }
}

#[test]
fn shapes_and_triangles_hide_each_other() {
    let sphere = Shape::Sphere(Sphere { centre: Vec3::new(0.5, 0.0, 0.0), radius: 0.25 });
    let world =
        world(vec![Geometry::Mesh(square()), Geometry::Shapes { shapes: vec![sphere.clone(), sphere], material: 0 }]);
    let tracer = build(&world);
    let up = Ray::new(Vec3::new(0.5, 0.0, -5.0), Vec3::Z);
    for (ray, geometry, t) in [(down(0.5, 0.0), 1, 4.75), (up, 1, 4.75), (down(-0.5, 0.1), 0, 5.0)] {
        let hit = tracer.closest(&ray).unwrap();
        assert!(hit.geometry == geometry && rounds_to(hit.t, t), "{hit:?}");
    }
    let from_inside = Ray::new(Vec3::new(0.5, 0.0, 0.1), -Vec3::Z);
    let hit = tracer.closest(&from_inside).unwrap();
    assert!(hit.geometry == 0 && rounds_to(hit.t, 0.1), "{hit:?}");
}

#[test]
fn every_option_traces_the_same_scene_and_compact_takes_less_memory() {
    let world = world(vec![Geometry::Mesh(Random(7).soup(20_000, 0.02))]);
    let truth = triangles(&world);
    let rays = Random(8).rays(150);
    let bytes = |options: Options| {
        let tracer = Embree::new(&world, &options).unwrap();
        let hits = closest(&tracer, &rays, Batch { width: Width::Eight, coherent: false });
        rays.iter().zip(&hits).for_each(|(ray, hit)| check(&truth, ray, *hit));
        assert!(hits.iter().flatten().count() > 20, "{options:?}");
        tracer.bytes()
    };
    // 12 bytes a vertex and 12 a triangle, at least.
    let copies = 20_000 * (36 + 12);
    for quality in [Quality::Low, Quality::Medium, Quality::High] {
        for robust in [false, true] {
            // Embree takes memory in blocks, as many as threads come to need: with one thread always as many.
            let options = Options { quality, robust, threads: Some(1), ..Options::default() };
            let (usual, compact) = (bytes(options), bytes(Options { compact: true, ..options }));
            assert!(copies < compact && compact <= usual, "{options:?}: {usual} bytes, compact {compact}");
        }
    }
    assert!(bytes(Options { compact: true, ..Options::default() }) < bytes(Options::default()));
}

/// A placement is a transform and its inverse at least, in f32, and a box in a tree of its own; of the first two
/// Embree's memory monitor tells nothing.
#[test]
fn placements_take_memory() {
    const PLACEMENTS: u32 = 100_000;
    let mut scene = Scene::from_geometries(vec![Geometry::Mesh(Random(9).soup(1, 0.2))], Vec::new());
    let place = |i: u32| DAffine3::from_translation(DVec3::new(f64::from(i % 300), f64::from(i / 300), 0.0));
    scene.instances = (0..PLACEMENTS).map(|i| Instance { transform: place(i), ..scene.instances[0].clone() }).collect();
    let world = World::placed(&scene).unwrap();
    // Other tests allocate and free meanwhile: the middle of several.
    let mut bytes: Vec<_> = (0..3).map(|_| build(&world).bytes() as u32 / PLACEMENTS).collect();
    bytes.sort_unstable();
    assert!((200..1000).contains(&bytes[1]), "{bytes:?}");
}

#[test]
fn thread_counts_give_equal_hits() {
    let world = world(vec![Geometry::Mesh(Random(10).soup(50_000, 0.05))]);
    let rays = Random(11).rays(5000);
    let hits = [Some(1), Some(2), None].map(|threads| {
        let tracer = Embree::new(&world, &Options { threads, ..Options::default() }).unwrap();
        // Queries from two threads of ours, too.
        let (first, second) = rays.split_at(rays.len() / 2);
        std::thread::scope(|scope| {
            let second = scope.spawn(|| closest(&tracer, second, Batch::default()));
            let mut hits = closest(&tracer, first, Batch::default());
            hits.extend(second.join().unwrap());
            hits
        })
    });
    assert!(hits[0].iter().flatten().count() > 1000);
    assert!(hits[0] == hits[1] && hits[0] == hits[2]);
}

#[test]
fn a_tracer_outlives_its_world_and_tells_its_version() {
    let sphere = Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 1.0 });
    let tracer = {
        let mut scene =
            Scene::from_geometries(vec![Geometry::Shapes { shapes: vec![sphere], material: 0 }], Vec::new());
        scene.instances.push(Instance { transform: places()[0], ..scene.instances[0].clone() });
        build(&World::new(&scene).unwrap())
    };
    assert_eq!(tracer.closest(&down(0.0, 0.0)).map(|hit| hit.t), Some(4.0));
    let numbers: Vec<u32> = tracer.version().split('.').map(|n| n.parse().unwrap()).collect();
    let built: Vec<u32> = embree::VERSION.split('.').map(|n| n.parse().unwrap()).collect();
    assert_eq!(numbers.len(), 3);
    assert_eq!(numbers[0], built[0]);
    assert_eq!(numbers[0] == 4, cfg!(embree4));
}
