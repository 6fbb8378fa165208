//! Micro-benchmarks of the native tracer: `cargo bench --bench native [FILTER]`.
//!
//! They tell whether a change of one part is felt there; what a user gains, and how Embree does, is `twincast bench`'s
//! to tell. Parts are reached through the public interface, in worlds where nearly all time goes into one of them.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use twincast::io::UpAxis;
use twincast::lab::bench::{Kind, Subject};
use twincast::math::Vec3;
use twincast::scene::{Geometry, Material, Mesh, terrain};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::{Bvh, Options, Preset, Travel};
use twincast::{Batch, Ray, Scene, Shape, Sphere, Tracer, Width, World};

fn world(mesh: Mesh) -> World {
    World::new(&Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])).expect("a plain mesh")
}

/// Of rays made before the clock starts.
const KINDS: [Kind; 5] = [Kind::Primary, Kind::Diffuse, Kind::Shadow, Kind::Orthographic, Kind::Sun];

/// The exact test, by brute force: each ray meets each triangle.
fn triangles(c: &mut Criterion) {
    let (world, rays) = (world(terrain(16)), across(64));
    let brute = Brute::new(&world);
    let mut hits = vec![None; rays.len()];
    let mut group = c.benchmark_group("triangle");
    group.throughput(Throughput::Elements(rays.len() as u64 * world.primitive_count()));
    group.bench_function("exact", |b| b.iter(|| brute.closest_batch(black_box(&rays), &mut hits, Batch::default())));
    group.finish();
}

/// Spheres that overlap, so that a ray meets several of them before it knows the nearest.
fn shapes(c: &mut Criterion) {
    let ball = |i: u16| {
        let place = |step: f32| (f32::from(i) * step).fract();
        Shape::Sphere(Sphere { centre: Vec3::new(place(0.754_877_6), place(0.569_840_3), place(0.3)), radius: 0.06 })
    };
    let geometry = Geometry::Shapes { shapes: (0..2000).map(ball).collect(), material: 0 };
    let world = World::new(&Scene::from_geometries(vec![geometry], vec![Material::default()])).expect("plain spheres");
    let (bvh, rays) = (Bvh::build(&world), across(64));
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    let mut group = c.benchmark_group("spheres");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function("closest", |b| b.iter(|| bvh.closest_batch(black_box(&rays), &mut hits, Batch::default())));
    group.bench_function("occluded", |b| {
        b.iter(|| bvh.occluded_batch(black_box(&rays), &mut occluded, Batch::default()));
    });
    group.finish();
}

/// Rays down on the unit square, in rows.
fn across(side: u16) -> Vec<Ray> {
    let at = |i: u16| (f32::from(i) + 0.5) / f32::from(side);
    let ray = |i, j| Ray::new(Vec3::new(at(i), 2.0, at(j)), Vec3::new(0.1, -1.0, 0.2));
    (0..side).flat_map(|j| (0..side).map(move |i| ray(i, j))).collect()
}

/// Boxes: rays that pass between the small triangles of a lattice, through many boxes and to no leaf.
fn boxes(c: &mut Criterion) {
    const SIDE: u16 = 20;
    let places = (0..SIDE).flat_map(|x| (0..SIDE).flat_map(move |y| (0..SIDE).map(move |z| [x, y, z].map(f32::from))));
    let corners = |place| [Vec3::ZERO, Vec3::X, Vec3::ONE].map(|corner| Vec3::from_array(place) + corner * 0.01);
    let positions: Vec<Vec3> = places.flat_map(corners).collect();
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let bvh =
        Bvh::build(&world(Mesh { positions: Arc::new(positions), triangles: Arc::new(triangles), ..Mesh::default() }));
    let between = |i: u16| {
        let (y, z) = (f32::from(i % SIDE) + 0.5, f32::from(i / SIDE) + 0.5);
        Ray::new(Vec3::new(-1.0, y, z), Vec3::new(1.0, 0.001, 0.002))
    };
    let rays: Vec<Ray> = (0..SIDE * SIDE).map(between).collect();
    let mut hits = vec![None; rays.len()];
    let mut group = c.benchmark_group("boxes");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function("misses", |b| b.iter(|| bvh.closest_batch(black_box(&rays), &mut hits, Batch::default())));
    group.finish();
    assert!(hits.iter().all(Option::is_none), "what was measured are boxes");
}

/// Rays of `twincast bench` on a terrain of 180,000 triangles, alone, in flight and in bundles.
fn rays(c: &mut Criterion) {
    let (subject, _) = Subject::new("terrain300", UpAxis::Y).expect("made by rule");
    let mut bvh = Bvh::build(&subject.world);
    let mut group = c.benchmark_group("rays");
    for set in subject.view.rays(&subject.world, &bvh, &KINDS, 256) {
        group.throughput(Throughput::Elements(set.rays.len() as u64));
        let (mut hits, mut occluded) = (vec![None; set.rays.len()], vec![false; set.rays.len()]);
        let ways = [
            ("alone", Travel::Alone, Width::One),
            ("flights", Travel::InFlight, Width::One),
            ("bundles", Travel::Auto, Width::Eight),
        ];
        for (name, travel, width) in ways {
            bvh = bvh.travelling(travel);
            let batch = set.kind.batch(width);
            if width != Width::One && !batch.coherent {
                continue;
            }
            group.bench_function(format!("{} {name}", set.kind.name()), |b| {
                if set.kind.is_shadow() {
                    b.iter(|| bvh.occluded_batch(black_box(&set.rays), &mut occluded, batch));
                } else {
                    b.iter(|| bvh.closest_batch(black_box(&set.rays), &mut hits, batch));
                }
            });
        }
    }
    group.finish();
}

/// Every preset, on a terrain of 80,000 triangles and one thread.
fn builds(c: &mut Criterion) {
    let world = world(terrain(200));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut group = c.benchmark_group("build");
    group.throughput(Throughput::Elements(world.primitive_count())).sample_size(20);
    for preset in Preset::ALL {
        group.bench_function(preset.name(), |b| {
            b.iter(|| pool.install(|| Bvh::build_with(black_box(&world), Options { preset, ..Options::default() })));
        });
    }
    group.finish();
}

criterion_group!(native, triangles, shapes, boxes, rays, builds);
criterion_main!(native);
