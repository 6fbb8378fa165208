//! Pictures: against closed forms, and against themselves under everything that must not change them.

mod adaptive;
mod alpha;
mod aov;
mod camera;
mod checkpoint;
mod closed_forms;
mod determinism;
mod explain;
mod fog;
mod glass;
mod media;
mod shading;
mod toy;
mod transport;
mod whitted;

use twincast::math::{DVec3, Vec2, Vec3};
use twincast::scene::{Camera, Geometry, Material, Mesh};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::Bvh;
use twincast::{Image, Renderer, Scene, Settings, Tracer, World};

/// Any engine, and what it is called.
struct Engine<'a> {
    name: &'static str,
    tracer: Box<dyn Tracer + 'a>,
}

/// Every engine of this build, for `world`.
fn engines(world: &World) -> Vec<Engine<'_>> {
    let mut engines = vec![
        Engine { name: "toy", tracer: Box::new(toy::Toy(world)) },
        Engine { name: "native", tracer: Box::new(Bvh::build(world)) },
    ];
    #[cfg(feature = "embree")]
    {
        use twincast::trace::embree::{Embree, Options};
        let embree = Embree::new(world, &Options::default()).expect("embree takes a valid scene");
        engines.push(Engine { name: "embree", tracer: Box::new(embree) });
    }
    engines.push(Engine { name: "brute", tracer: Box::new(Brute::new(world)) });
    engines
}

/// A picture without anything but itself to wait for.
fn render(scene: &Scene, camera: &Camera, settings: &Settings, engine: &Engine) -> Image {
    let world = World::new(scene).expect("a valid scene");
    let renderer = Renderer::new(scene, &world, camera.clone(), settings.clone()).expect("valid settings");
    renderer.render(&*engine.tracer, twincast::render::Control::default()).expect("nobody interrupts")
}

/// A square in the plane y = 0 with sides of 2 `half`, facing up, with uv from (0, 0) at -x, +z to (1, 1) at +x, -z.
fn floor(half: f32, material: u32) -> Geometry {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z) * half;
    let positions = vec![corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)];
    let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    Geometry::Mesh(Mesh { uvs, material, ..Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]) })
}

/// A torus of `n` x `n` quads about the y axis, with smooth normals.
fn torus(n: u32, centre: DVec3) -> Mesh {
    let turn = |i: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let point = |i: u32, j: u32| {
        let (a, b) = (turn(i), turn(j));
        let r = 2.0 + 0.7 * b.cos();
        centre + DVec3::new(r * a.cos(), 0.7 * b.sin(), r * a.sin())
    };
    let positions: Vec<_> = (0..n * n).map(|k| point(k / n, k % n)).collect();
    let quad = |i: u32, j: u32| {
        let at = |i: u32, j: u32| i % n * n + j % n;
        [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]
    };
    let triangles = (0..n * n).flat_map(|k| quad(k / n, k % n)).collect();
    let mut mesh = Mesh::new(Vec::new(), triangles);
    mesh.set_positions(&positions);
    mesh.smooth_normals();
    mesh
}

fn matte(reflectance: f32) -> Material {
    Material { diffuse: Vec3::splat(reflectance), ..Material::default() }
}

/// From 10 above the origin straight down, -z up in the picture; half the picture is 1 wide at the floor.
fn from_above() -> Camera {
    Camera::look_at(DVec3::Y * 10.0, DVec3::ZERO, DVec3::NEG_Z, 2.0 * 0.1f64.atan()).expect("a valid view")
}

fn settings(width: u32, height: u32, spp: u32) -> Settings {
    Settings { width, height, spp, ..Settings::default() }
}
