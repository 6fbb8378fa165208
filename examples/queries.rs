//! What the library answers, on a mesh made of one's own arrays: `cargo run --release --example queries`.
//!
//! Hills of 131,072 triangles at a northing of 5,000,000 metres, where f32 has steps of half a metre: rays in batches
//! on all cores, how much of the sky each place sees, all hits along a ray, the nearest point, and the same tree after
//! the ground has moved.

use std::sync::Arc;

use rayon::prelude::*;
use twincast::math::{DVec3, Vec3};
use twincast::scene::{Geometry, Material, Mesh};
use twincast::shade::{Attributes, SurfacePoint};
use twincast::trace::bvh::Bvh;
use twincast::{Batch, Hit, Ray, Result, Scene, Tracer, World};

/// Squares along each side.
const SIDE: u32 = 256;
const CORNER: DVec3 = DVec3::new(0.0, 0.0, -5_000_000.0);
/// Rays of a batch: enough to pay, few enough that all cores get some.
const BATCH: usize = 4096;
/// Directions that are asked at each place.
const SKY: u32 = 64;

fn main() -> Result<()> {
    let scene = hills(0.0);
    // For scenes made by hand: tracers rely on what this finds out.
    scene.check()?;
    let world = World::new(&scene)?;
    let mut bvh = Bvh::build(&world);

    // Straight down, one ray a square. Rays are in the world's coordinates, which are f32 around the middle of the
    // scene.
    let above = |i: u32| CORNER + DVec3::new(f64::from(i % SIDE) + 0.4, 100.0, f64::from(i / SIDE) + 0.3);
    let down: Vec<Ray> = (0..SIDE * SIDE).map(|i| world.ray(above(i), Vec3::NEG_Y)).collect();
    let mut hits: Vec<Option<Hit>> = vec![None; down.len()];
    let batches = down.par_chunks(BATCH).zip(hits.par_chunks_mut(BATCH));
    batches.for_each(|(rays, hits)| bvh.closest_batch(rays, hits, Batch::of(rays)));
    println!("{} of {} rays meet the ground", hits.iter().flatten().count(), down.len());

    // Ambient occlusion: from where each of them ends, rays towards the sky that leave the surface without meeting it
    // again.
    let seen = |(ray, hit): (&Ray, &Option<Hit>)| Some(open_sky(&scene, &world, &bvh, ray, hit.as_ref()?));
    let sky: Vec<f64> = down.par_iter().zip(&hits).filter_map(seen).collect();
    println!("on average {:.1} % of the sky is seen", 100.0 * sky.iter().sum::<f64>() / sky.len() as f64);

    // Along the ground: in at one side of each hill and out at the other.
    let along = world.ray(CORNER + DVec3::new(-1.0, 2.0, 100.3), Vec3::X);
    let mut crossings = Vec::new();
    bvh.all_hits(&along, &mut crossings);
    println!("a ray along the ground crosses it {} times", crossings.len());

    let balloon = CORNER + DVec3::new(100.0, 30.0, 100.0);
    let nearest = bvh.closest_point(world.to_world(balloon), f32::INFINITY).expect("there is ground");
    println!("{:.2} m below {balloon}, at {}", nearest.distance, world.to_scene(nearest.point.as_dvec3()));

    // The ground moves: the tree is fitted to it, which takes a fraction of building it anew.
    let moved = World::new(&hills(1.0))?;
    bvh.refit(&moved)?;
    let nearest = bvh.closest_point(moved.to_world(balloon), f32::INFINITY).expect("there is ground");
    println!("{:.2} m after it has moved", nearest.distance);
    Ok(())
}

/// The ground at a time: f64 positions, of which the mesh keeps offsets from an origin in their middle.
fn hills(time: f64) -> Scene {
    let row = SIDE + 1;
    let at = |i: u32| {
        let (x, z) = (f64::from(i % row), f64::from(i / row));
        CORNER + DVec3::new(x, 8.0 * (x / 20.0 + time).sin() * (z / 30.0).cos(), z)
    };
    let positions: Vec<DVec3> = (0..row * row).map(at).collect();
    let square = |i: u32| {
        let a = i / SIDE * row + i % SIDE;
        [[a, a + row, a + 1], [a + 1, a + row, a + row + 1]]
    };
    let mut mesh = Mesh { triangles: Arc::new((0..SIDE * SIDE).flat_map(square).collect()), ..Mesh::default() };
    mesh.set_positions(&positions);
    Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
}

/// The share of directions above the horizon in which nothing stands, where a ray has hit.
fn open_sky(scene: &Scene, world: &World, bvh: &Bvh, ray: &Ray, hit: &Hit) -> f64 {
    let surface = SurfacePoint::new(scene, world, ray, hit, Attributes::ALL);
    // Even over the hemisphere: heights by steps, and turned by the golden angle.
    let direction = |k: u32| {
        let height = (k as f32 + 0.5) / SKY as f32;
        let (sine, cosine) = (k as f32 * 2.399_963).sin_cos();
        Vec3::new(cosine, 0.0, sine) * (1.0 - height * height).sqrt() + Vec3::Y * height
    };
    let rays: Vec<Ray> = (0..SKY).map(|k| surface.spawn(direction(k), f32::INFINITY)).collect();
    let mut occluded = vec![false; rays.len()];
    bvh.occluded_batch(&rays, &mut occluded, Batch::default());
    occluded.iter().filter(|occluded| !**occluded).count() as f64 / f64::from(SKY)
}
