//! The textbooks' methods: right on rays of no special kind, and wrong where they are known to be.

use twincast::lab::oracle::{self, Id};
use twincast::lab::rounding::{Precision, outcome};
use twincast::math::Vec3;
use twincast::scene::{Geometry, Mesh, Scene};
use twincast::trace::accel::{Accel, Methods, Options};
use twincast::{Ray, Shape, Sphere, SphereMethod, Tracer, TriangleMethod, World};

use super::accelerators;
use super::subjects::{Class, Kind};
use super::matrix::{Matrix, of_kind};
use crate::scenes::Random;

/// A textbook's method misses rays at the edges that triangles share, and the accelerator shows it; the exact one does not.
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

/// How often an accelerator with a textbook's method differs from exact arithmetic on rays of each class.
fn differing(kind: Kind, accel: Accel, methods: Methods) -> [usize; Class::ALL.len()] {
    let mut random = Random::new(5);
    let Matrix { world, targets } = &of_kind(kind, 30, 0, &mut random);
    let tracer = accel.build(world, &Options { methods, ..Options::default() });
    Class::ALL.map(|class| {
        let mut wrong = 0;
        for i in 0..300 {
            let ray = targets[i % targets.len()].ray(class, &mut random);
            let exact = oracle::closest(world, &ray);
            let right = match tracer.closest(&ray) {
                None => exact.is_empty(),
                Some(hit) => exact.iter().any(|(id, m)| {
                    let t = m.t.to_f64();
                    *id == hit.id() && (f64::from(hit.t) - t).abs() <= 1e-3 * t.abs()
                }),
            };
            wrong += usize::from(!right);
        }
        wrong
    })
}

#[test]
fn table() {
    println!("{:?}", Class::ALL);
    for triangle in TriangleMethod::ALL {
        for accel in accelerators() {
            let methods = Methods { triangle, ..Methods::default() };
            println!("{:>18} {:>12} {:?}", triangle.name(), accel.name(), differing(Kind::Triangle, accel, methods));
        }
    }
    for sphere in SphereMethod::ALL {
        for accel in accelerators() {
            let methods = Methods { sphere, ..Methods::default() };
            println!("{:>18} {:>12} {:?}", sphere.name(), accel.name(), differing(Kind::Sphere, accel, methods));
        }
    }
}
