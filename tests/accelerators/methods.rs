//! The textbooks' methods: right on rays of no special kind, and wrong where they are known to be.

use twincast::lab::oracle::{self, Id};
use twincast::math::Vec3;
use twincast::scene::{Geometry, Mesh, Scene};
use twincast::trace::accel::{Accel, Methods, Options};
use twincast::{Ray, Shape, Sphere, SphereMethod, Tracer, TriangleMethod, World};

use super::accelerators;
use super::matrix::{Matrix, of_kind};
use super::subjects::{Class, Kind};
use crate::scenes::Random;

/// A textbook's method misses rays at the edges that triangles share, and the accelerator shows it; the exact one does
/// not.
#[test]
fn methods_can_be_chosen_and_show_what_they_miss() {
    // A fan of slivers around the origin, in a plane that leans; rays at points of the shared edges.
    let corner = |i: u32| {
        let angle = f64::from(i) / 50.0 * std::f64::consts::TAU;
        Vec3::new(angle.cos() as f32 * 0.7, angle.sin() as f32 * 0.9, (angle.cos() * 0.3 + angle.sin() * 0.1) as f32)
    };
    let positions: Vec<_> = (0..50).map(corner).chain([Vec3::new(1e-3, 2e-3, 0.0)]).collect();
    let triangles = (0..50).map(|i| [i, (i + 1) % 50, 50]).collect();
    let scene = Scene::from_geometries(vec![Geometry::Mesh(Mesh::new(positions.clone(), triangles))], Vec::new());
    let world = World::new(&scene).unwrap();
    let origin = Vec3::new(0.37, -0.21, 5.3);
    let rays: Vec<_> = (0..50)
        .flat_map(|i| (1..200).map(move |k| (i, k as f32 / 200.0)))
        .map(|(i, s)| Ray::new(origin, positions[50].lerp(positions[i], s) - origin))
        .collect();
    let misses = |triangle: TriangleMethod| {
        let options = Options { methods: Methods { triangle, ..Methods::default() }, ..Options::default() };
        let tracer = Accel::Binary.build(&world, &options);
        rays.iter().filter(|ray| tracer.closest(ray).is_none()).count()
    };
    assert_eq!(misses(TriangleMethod::Exact), 0);
    assert!(misses(TriangleMethod::MoellerTrumbore) > 0, "it is not watertight");
}

/// Where nothing cancels, every sphere method sees the same sphere from outside and from inside.
#[test]
fn sphere_methods_agree_on_plain_rays() {
    let sphere = Shape::Sphere(Sphere { centre: Vec3::new(1.0, 2.0, 3.0), radius: 2.0 });
    let geometry = Geometry::Shapes { shapes: vec![sphere], material: 0 };
    let world = World::new(&Scene::from_geometries(vec![geometry], Vec::new())).unwrap();
    for method in SphereMethod::ALL {
        let options = Options { methods: Methods { sphere: method, ..Methods::default() }, ..Options::default() };
        let tracer = Accel::Kd.build(&world, &options);
        let t = |z: f32| tracer.closest(&Ray::new(Vec3::new(1.0, 2.0, z), Vec3::Z)).map(|hit| hit.t);
        assert_eq!([t(-3.0), t(3.0), t(6.0)], [Some(4.0), Some(2.0), None], "{method:?}");
    }
}

/// Rays of each class on each accelerator.
const RAYS: usize = 300;

/// How often an accelerator with a method differs from exact arithmetic on rays of each class: it hits something else,
/// or nothing, or at a t that is off by more than a thousandth.
fn differing(matrix: &Matrix, rays: &[Vec<(Ray, Exact)>], accel: Accel, methods: Methods) -> Vec<usize> {
    let tracer = accel.build(&matrix.world, &Options { methods, ..Options::default() });
    let is_right = |(ray, exact): &&(Ray, Exact)| {
        let found = tracer.closest(ray);
        assert_eq!(tracer.occluded(ray), found.is_some(), "{methods:?} {} {ray:?}", accel.name());
        match found {
            None => exact.is_empty(),
            Some(hit) => exact.iter().any(|&(id, t)| {
                // A hit next to the origin is all rounding.
                let near = 1e-5 / f64::from(ray.direction.length());
                id == hit.id() && (f64::from(hit.t) - t).abs() <= 1e-3 * t + near
            }),
        }
    };
    rays.iter().map(|rays| rays.len() - rays.iter().filter(is_right).count()).collect()
}

/// The nearest primitives and their t.
type Exact = Vec<(Id, f64)>;

/// Holds a method's row of the table.
fn hold(kind: Kind, methods: &[(&'static str, Methods, &str)]) {
    let mut random = Random::new(5);
    let matrix = of_kind(kind, 30, 0, &mut random);
    let rays: Vec<Vec<(Ray, Exact)>> = Class::ALL
        .iter()
        .map(|&class| {
            let ray = |i: usize| matrix.targets[i % matrix.targets.len()].ray(class, &mut random);
            let rays: Vec<Ray> = (0..RAYS).map(ray).collect();
            let exact = |ray: Ray| {
                let nearest = oracle::closest(&matrix.world, &ray);
                (ray, nearest.into_iter().map(|(id, meeting)| (id, meeting.t.to_f64())).collect())
            };
            rays.into_iter().map(exact).collect()
        })
        .collect();
    let row = |&(name, methods, _): &(&'static str, Methods, &str)| {
        let counts: Vec<Vec<usize>> = accelerators().map(|accel| differing(&matrix, &rays, accel, methods)).collect();
        let mark = |class: usize| {
            let of_class = || counts.iter().map(|counts| counts[class]);
            if of_class().all(|count| count == 0) {
                '.'
            } else if of_class().all(|count| count > RAYS / 30) {
                'x'
            } else {
                '-'
            }
        };
        (name, (0..Class::ALL.len()).map(mark).collect::<String>())
    };
    let found: Vec<(&str, String)> = methods.iter().map(row).collect();
    let expected: Vec<(&str, String)> = methods.iter().map(|&(name, _, row)| (name, row.to_owned())).collect();
    assert_eq!(found, expected, "{kind:?}: {:?}", Class::ALL);
}

/// In the order of [`Class::ALL`]: random, inside, tangent, corner, edge, axis, zero, surface, far. A dot where the
/// method is wrong on no accelerator, a cross where it is on every one for more than one ray in thirty, a dash between.
/// So a method that is mended shows as well.
#[test]
fn where_the_textbooks_methods_of_triangles_fail() {
    let row = |triangle, row| (TriangleMethod::name(triangle), Methods { triangle, ..Methods::default() }, row);
    hold(
        Kind::Triangle,
        &[
            row(TriangleMethod::SidePlanes, ".x-xx--xx"),
            row(TriangleMethod::SameSide, ".x-xx--xx"),
            row(TriangleMethod::Areas, ".x.xx.-xx"),
            row(TriangleMethod::MoellerTrumbore, ".x.xx.-xx"),
            row(TriangleMethod::Woop, ".xxxx.-xx"),
            row(TriangleMethod::Exact, "........."),
        ],
    );
}

#[test]
fn where_the_textbooks_methods_of_spheres_fail() {
    let row = |sphere, row| (SphereMethod::name(sphere), Methods { sphere, ..Methods::default() }, row);
    hold(
        Kind::Sphere,
        &[
            row(SphereMethod::Algebraic, "..x....xx"),
            row(SphereMethod::Geometric, "..x...-xx"),
            row(SphereMethod::Accurate, "..x....xx"),
            row(SphereMethod::Exact, "........."),
        ],
    );
}
