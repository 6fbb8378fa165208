//! The comparison, on engines with planted faults: each fault must be found, and named as what it is.

use std::sync::atomic::{AtomicU64, Ordering};

use twincast::lab::compare::shoot;
use twincast::lab::exact::{Dyadic, Rational, Ring};
use twincast::lab::hex;
use twincast::lab::oracle::{self, Body, Primitive};
use twincast::lab::rays::{Aim, Query};
use twincast::lab::{Asked, Class, Paired, PixelReport, Report};
use twincast::math::Random;
use twincast::math::{DAffine3, DMat3, DVec3, Vec3};
use twincast::render::Control;
use twincast::scene::{Geometry, Mesh};
use twincast::{Hit, Ray, Scene, Shape, Sphere, Tracer, World};

const RAYS: u64 = 4_000;

/// A bumpy height field of `n` by `n` squares, two triangles each, over [0, 1]^2.
fn terrain(n: u32) -> Mesh {
    let mut random = Random::new(5, 0);
    let height = |random: &mut Random| random.unit() * 0.3;
    let vertices = (0..=n).flat_map(|y| (0..=n).map(move |x| (x, y)));
    let positions = vertices.map(|(x, y)| Vec3::new(x as f32 / n as f32, height(&mut random), y as f32 / n as f32));
    let positions = positions.collect();
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let squares = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        [[a, c, b], [b, c, d]]
    });
    Mesh::new(positions, triangles.collect())
}

fn scene(mesh: Mesh) -> Scene {
    Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Default::default()])
}

fn world() -> World {
    World::new(&scene(terrain(12))).unwrap()
}

/// Brute force on the oracle, with a fault where `fault` says so.
struct Toy<'a, F> {
    world: &'a World,
    fault: F,
}

type Fault = fn(&Ray, Option<Hit>) -> Option<Hit>;

impl<F: Fn(&Ray, Option<Hit>) -> Option<Hit> + Sync> Tracer for Toy<'_, F> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let nearest = oracle::closest(self.world, ray).into_iter().next();
        let hit = nearest.map(|((instance, geometry, primitive), meeting)| {
            let t = meeting.t.to_f64() as f32;
            Hit { t, u: 0.0, v: 0.0, primitive, geometry, instance }
        });
        (self.fault)(ray, hit)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}

/// An f32 engine with nothing exact about it: Embree's robust triangle test, for every triangle.
struct Pluecker<'a>(&'a World);

impl Tracer for Pluecker<'_> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for ((instance, geometry, primitive), Primitive { body, .. }) in oracle::primitives(self.0, ray.time) {
            let Body::Triangle(corners) = body else { continue };
            let [v0, v1, v2] = corners.map(|p| p - ray.origin);
            let (e0, e1, e2) = (v2 - v0, v0 - v1, v1 - v2);
            let u = e0.cross(v2 + v0).dot(ray.direction);
            let v = e1.cross(v0 + v1).dot(ray.direction);
            let w = e2.cross(v1 + v2).dot(ray.direction);
            let eps = f32::EPSILON * (u + v + w).abs();
            let n = e0.cross(e1);
            let den = n.dot(ray.direction);
            let t = n.dot(v0) / den;
            let inside = u.min(v).min(w) >= -eps || u.max(v).max(w) <= eps;
            let nearest = best.map_or(ray.tmax, |hit| hit.t);
            if inside && den != 0.0 && ray.tmin <= t && t <= nearest {
                best = Some(Hit { t, u: 0.0, v: 0.0, primitive, geometry, instance });
            }
        }
        best
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}

const RIGHT: Fault = |_, hit| hit;

fn report<A: Tracer, B: Tracer>(world: &World, native: &A, embree: &B, brute: Option<&dyn Tracer>) -> Report {
    let paired = Paired::new(world, native, embree, brute);
    shoot(&paired, world, RAYS, 3, Control::default()).unwrap();
    Report::new("toy", world, paired.tally(), &PixelReport::default())
}

#[test]
fn equal_engines_agree_on_every_ray() {
    let world = world();
    let right = Toy { world: &world, fault: RIGHT };
    let report = report(&world, &right, &right, Some(&right));
    assert_eq!((report.rays, report.agree, report.max_t_ulp), (RAYS, RAYS, 0));
    assert_eq!(report.triangles, 288);
    assert!(report.differences.is_empty() && report.check().is_ok());
}

#[test]
fn f32_rounding_is_never_called_a_fault() {
    let world = world();
    let right = Toy { world: &world, fault: RIGHT };
    let report = report(&world, &right, &Pluecker(&world), Some(&right));
    assert_eq!((report.native_wrong, report.embree_wrong), (0, 0), "{report}");
    // Rays aimed at corners and edges: ties between neighbours, and boundary rays at the rim.
    assert!(report.tie > 100 && report.boundary > 2, "{report}");
    assert!(report.max_t_ulp > 0);
}

#[test]
fn a_planted_fault_is_found_and_blamed_on_who_has_it() {
    let world = world();
    let hits = AtomicU64::new(0);
    let right = Toy {
        world: &world,
        fault: |_: &Ray, hit: Option<Hit>| {
            hits.fetch_add(u64::from(hit.is_some()), Ordering::Relaxed);
            hit
        },
    };
    let wrong_primitive: Fault = |_, hit| hit.map(|h| Hit { primitive: (h.primitive + 100) % 288, ..h });
    let missing: Fault = |_, hit| hit.filter(|h| h.primitive % 16 != 3);
    let too_far: Fault = |_, hit| hit.map(|h| Hit { t: h.t * 1.000_001, ..h });
    for (name, fault, rare) in [("primitive", wrong_primitive, false), ("miss", missing, true)] {
        let faulty = Toy { world: &world, fault };
        let native = report(&world, &faulty, &right, None);
        assert!(native.native_wrong > if rare { 60 } else { 1_000 }, "{name}: {native}");
        assert_eq!(native.embree_wrong, 0, "{name}: {native}");
        assert!(native.check().is_err_and(|e| e.exit_code() == 1 && e.to_string().contains("native")));
        let embree = report(&world, &right, &faulty, None);
        assert!(embree.embree_wrong > if rare { 60 } else { 1_000 }, "{name}: {embree}");
        assert_eq!(embree.native_wrong, 0, "{name}: {embree}");
        assert!(embree.check().is_ok());
        // Both have it: only brute force can tell.
        let both = report(&world, &faulty, &faulty, Some(&right));
        assert_eq!(both.native_wrong, native.native_wrong, "{name}: {both}");
        assert_eq!(report(&world, &faulty, &faulty, None).native_wrong, 0);
    }
    let far = report(&world, &Toy { world: &world, fault: too_far }, &right, None);
    assert!(far.native_wrong > 1_000 && far.max_t_ulp >= 8, "{far}");
    assert!(hits.into_inner() > RAYS);
}

#[test]
fn coincident_copies_are_ties() {
    let mesh = terrain(12);
    let copies = [mesh.clone(), mesh].map(Geometry::Mesh).to_vec();
    let world = World::new(&Scene::from_geometries(copies, vec![Default::default()])).unwrap();
    let other_copy: Fault = |_, hit| hit.map(|h| Hit { geometry: 1 - h.geometry, ..h });
    let right = Toy { world: &world, fault: RIGHT };
    let report = report(&world, &right, &Toy { world: &world, fault: other_copy }, None);
    assert_eq!(report.agree + report.tie, RAYS, "{report}");
    assert!(report.tie > 1_000);
}

#[test]
fn instances_and_spheres_are_judged_too() {
    let mut scene = scene(terrain(6));
    let mut second = scene.instances[0].clone();
    second.transform = DAffine3 {
        matrix3: DMat3::from_rotation_x(0.3) * DMat3::from_diagonal(DVec3::new(2.0, 0.5, -1.0)),
        translation: DVec3::new(0.3, 2.0, 0.1),
    };
    scene.instances.push(second);
    let ball = Shape::Sphere(Sphere { centre: Vec3::new(0.5, 0.4, 0.5), radius: 0.25 });
    scene.geometries.push(Geometry::Shapes { shapes: vec![ball], material: 0 });
    scene.groups[0].geometries.end = 2;
    let world = World::new(&scene).unwrap();
    assert_eq!(world.placements.len(), 2);

    let right = Toy { world: &world, fault: RIGHT };
    let missing: Fault = |_, hit| hit.filter(|h| (h.instance, h.geometry) != (1, 1));
    let report = report(&world, &right, &Toy { world: &world, fault: missing }, None);
    assert_eq!((report.native_wrong, report.tie), (0, 0), "{report}");
    assert!(report.embree_wrong > 60 && report.boundary < report.embree_wrong / 10, "{report}");
}

#[test]
fn counts_and_kept_rays_do_not_depend_on_threads() {
    let world = world();
    let right = Toy { world: &world, fault: RIGHT };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| report(&world, &right, &Pluecker(&world), None))
    };
    let (one, many) = (run(1), run(7));
    assert_eq!(one.to_string(), many.to_string());
    assert!(!one.differences.is_empty());
    assert!(one.differences.iter().all(|d| matches!(d.class, Class::Tie | Class::Boundary)));
    let told = one.differences[0].to_string();
    let (_, ray) = told.split_once("--ray ").expect("a ray to ask for again");
    assert_eq!(hex::ray_from_text(ray), Ok(one.differences[0].ray), "{told}");
    assert!(matches!(one.differences[0].asked, Asked::Closest(_) | Asked::Occluded { .. }));
}

#[test]
fn the_json_document_has_exactly_the_promised_keys() {
    let world = world();
    let engine = Pluecker(&world);
    let paired = Paired::new(&world, &engine, &engine, None);
    let report = Report::new("name", &world, paired.tally(), &PixelReport::default());
    let expected = concat!(
        r#"{"scene":"name","triangles":288,"rays":0,"agree":0,"tie":0,"boundary":0,"native_wrong":0,"#,
        r#""embree_wrong":0,"max_t_ulp":0,"image":{"pixels":0,"differing":0,"unexplained":0,"max_abs":0.0}}"#
    );
    assert_eq!(serde_json::to_string(&report).unwrap(), expected);
}

#[test]
fn the_oracle_equals_f64_where_f64_is_sure() {
    let world = world();
    let aim = Aim::new(&world).unwrap();
    let (mut hits, mut sure) = (0, 0);
    for index in 0..400 {
        let Query::Closest(ray) = aim.ray(11, index) else { continue };
        let (origin, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        for (_, primitive) in oracle::primitives(&world, 0.0) {
            let Body::Triangle(corners) = primitive.body else { unreachable!("only a mesh") };
            // Cramer's rule: another formula than the oracle's.
            let [p, q, r] = corners.map(|p| p.as_dvec3());
            let (e1, e2, s) = (q - p, r - p, origin - p);
            let m = DMat3::from_cols(-d, e1, e2);
            let solution = m.inverse() * s;
            let (t, u, v) = (solution.x, solution.y, solution.z);
            let margin = [u, v, 1.0 - u - v].into_iter().fold(f64::INFINITY, f64::min);
            let meeting = oracle::meet(&ray, &primitive);
            let angle = m.determinant() / (d.length() * e1.length() * e2.length());
            if margin.abs() > 1e-6 && angle.abs() > 1e-6 {
                sure += 1;
                assert_eq!(meeting.is_some(), margin > 0.0, "{ray:?} {corners:?}");
                if let Some(meeting) = meeting {
                    hits += 1;
                    assert!((meeting.t.to_f64() - t).abs() < 1e-7 * (1.0 + t.abs()), "{} {t}", meeting.t.to_f64());
                }
            }
        }
    }
    assert!(hits > 200 && sure > 90_000, "{hits} {sure}");
}

#[test]
fn exact_numbers_neither_overflow_nor_vanish() {
    let (tiny, huge) = (Dyadic::new(f32::from_bits(1)), Dyadic::new(f32::MAX));
    let power = |x: &Dyadic| (0..20).fold(x.clone(), |product, _| product.mul(x));
    assert!(power(&tiny).signum() == 1 && power(&tiny).to_f64() == 0.0 && power(&huge).to_f64() == f64::INFINITY);
    assert_eq!(Rational::new(power(&huge), power(&huge)).unwrap().to_f64(), 1.0);
}
