//! Mirrors and glass: against closed forms.

use twincast::math::{DVec3, Vec3, Vec4};
use twincast::render::{Control, Counted};
use twincast::scene::{Attenuation, Camera, Geometry, Light, MAX_DEPTH, Material};
use twincast::{Cuboid, Disk, Plane, Renderer, Scene, Settings, Shape, Sphere, World};

use super::{engines, from_above, render, settings};

fn black() -> Material {
    Material { ambient: Vec3::ZERO, diffuse: Vec3::ZERO, ..Material::default() }
}

fn scene(parts: Vec<(Shape, Material)>) -> Scene {
    let (shapes, materials): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let geometry = |(shape, material)| Geometry::Shapes { shapes: vec![shape], material };
    Scene::from_geometries(shapes.into_iter().zip(0..).map(geometry).collect(), materials)
}

fn plane(y: f32, normal: Vec3) -> Shape {
    Shape::Plane(Plane::new(Vec3::Y * y, normal).unwrap())
}

fn sphere(x: f32, y: f32, z: f32, radius: f32) -> Shape {
    Shape::Sphere(Sphere { centre: Vec3::new(x, y, z), radius })
}

/// One pixel, the same for every engine.
fn pixel(scene: &Scene, camera: &Camera, settings: &Settings) -> Vec4 {
    let world = World::new(scene).unwrap();
    let pixels: Vec<_> = engines(&world).iter().map(|e| render(scene, camera, settings, e).pixels[0]).collect();
    assert!(pixels.windows(2).all(|pair| pair[0] == pair[1]), "engines differ: {pixels:?}");
    pixels[0]
}

fn deep(max_depth: u32) -> Settings {
    Settings { max_depth: Some(max_depth), ..settings(1, 1, 1) }
}

/// Each of two facing mirrors gives off e and reflects r: n mirrors deep it is e (1 + r + ... + r^n).
#[test]
fn two_mirrors_make_a_geometric_series() {
    let (e, r) = (Vec3::new(0.25, 0.5, 1.0), Vec3::new(0.5, 0.75, 0.25));
    let mirror = Material { emission: e, reflection: r, ..black() };
    let scene = scene(vec![(plane(0.0, Vec3::Y), mirror.clone()), (plane(20.0, Vec3::NEG_Y), mirror)]);
    let mut sum = Vec3::ZERO;
    let mut power = Vec3::ONE;
    for depth in 0..8 {
        sum += e * power;
        power *= r;
        let got = pixel(&scene, &from_above(), &deep(depth));
        assert!((got - sum.extend(1.0)).abs().max_element() < 1e-6, "{depth} deep: {got} against {sum}");
    }
}

/// As often as a ray may be sent on at all, the stack has room: each mirror adds what it gives off, for it reflects
/// all. More is refused.
#[test]
fn rays_are_sent_on_as_often_as_can_be_asked_for() {
    let mirror = Material { emission: Vec3::new(0.25, 0.5, 1.0), reflection: Vec3::ONE, ..black() };
    let scene = scene(vec![(plane(0.0, Vec3::Y), mirror.clone()), (plane(20.0, Vec3::NEG_Y), mirror)]);
    let times = (MAX_DEPTH + 1) as f32;
    let seen = pixel(&scene, &from_above(), &deep(MAX_DEPTH));
    assert_eq!(seen, (Vec3::new(0.25, 0.5, 1.0) * times).extend(1.0));
    let world = World::new(&scene).unwrap();
    let refused = Renderer::new(&scene, &world, from_above(), deep(MAX_DEPTH + 1)).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("1000 times at most"), "{refused}");
}

/// Seen obliquely through a pane of thickness d, things stand aside by d sin(a) (1 - cos(a) / sqrt(n^2 - sin(a)^2)).
#[test]
fn a_pane_moves_what_stands_behind_it() {
    let (n, d, a) = (1.5f64, 2.0f64, 50f64.to_radians());
    let direction = DVec3::new(a.sin(), -a.cos(), 0.0);
    let eye = -direction * 10.0;
    // The ray meets the pane's upper side y = 0 at the origin, and goes on along its line, moved aside, to y = -10.
    let aside = d * a.sin() * (1.0 - a.cos() / (n * n - a.sin() * a.sin()).sqrt());
    // A step aside, across the ray, is a step of 1 / cos(a) along the horizontal, towards the normal.
    let landing = DVec3::new(10.0 * a.tan() - aside / a.cos(), -10.0, 0.0);
    let glass = Material { transmission: Vec3::splat(0.5), ior: n as f32, ..black() };
    let pane = Shape::Cuboid(Cuboid::new(Vec3::new(-50.0, -d as f32, -50.0), Vec3::new(50.0, 0.0, 50.0)).unwrap());
    let glowing = Material { emission: Vec3::new(4.0, 8.0, 12.0), ..black() };
    let target = Shape::Disk(Disk::new(landing.as_vec3(), Vec3::Y, 1e-3).unwrap());
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.01).unwrap();
    let seen = pixel(&scene(vec![(pane, glass), (target.clone(), glowing.clone())]), &camera, &deep(5));
    assert_eq!(seen, Vec4::new(1.0, 2.0, 3.0, 1.0), "two surfaces let through half each");
    let without = pixel(&scene(vec![(target, glowing)]), &camera, &deep(5));
    assert_eq!(without, Vec4::ZERO, "without the pane the line of sight passes beside the target");
}

/// From inside water at a steep angle the surface is a mirror: nothing is let through.
#[test]
fn total_internal_reflection_lets_nothing_through() {
    let water = Material { transmission: Vec3::ONE, ior: 1.33, emission: Vec3::X, ..black() };
    let mut scene = scene(vec![(plane(0.0, Vec3::Y), water)]);
    scene.background = Some(Vec3::Y);
    let critical = (1.0f64 / f64::from(1.33f32)).asin().to_degrees();
    for (degrees, sky) in [(critical - 0.1, 1.0), (critical + 0.1, 0.0)] {
        let up = DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let camera = Camera::look_at(-up, DVec3::ZERO, DVec3::Y, 1e-3).unwrap();
        assert_eq!(pixel(&scene, &camera, &deep(5)), Vec4::new(1.0, sky, 0.0, 1.0), "{degrees} degrees");
    }
}

/// A lamp in a ball that glows lights what is around it, though its own surface is in the way; another ball shades it.
#[test]
fn a_lamp_does_not_shade_itself() {
    let matte = Material { diffuse: Vec3::ONE, ..black() };
    let glow = Material { emission: Vec3::ONE, ..black() };
    let lamp = |radius| Light::Point {
        position: DVec3::new(30.0, 40.0, 0.0),
        color: Vec3::ONE,
        attenuation: Attenuation::NONE,
        range: f64::INFINITY,
        radius,
    };
    let parts = vec![(plane(0.0, Vec3::Y), matte.clone()), (sphere(30.0, 40.0, 0.0, 3.0), glow)];
    let mut lit = scene(parts.clone());
    let cosine = Vec4::new(0.8, 0.8, 0.8, 1.0);
    for (radius, expected) in [(3.0, cosine), (0.0, Vec4::W)] {
        lit.lights = vec![lamp(radius)];
        let got = pixel(&lit, &from_above(), &deep(0));
        assert!((got - expected).abs().max_element() < 1e-6, "radius {radius}: {got}");
    }
    let between = [parts, vec![(sphere(15.0, 20.0, 0.0, 1.0), matte)]].concat();
    let shaded = Scene { lights: vec![lamp(3.0)], ..scene(between) };
    assert_eq!(pixel(&shaded, &from_above(), &deep(0)), Vec4::W);
}

/// Rays that double at every surface, to more than are followed at once: still each pixel as if it were alone. No two
/// of a pixel's rays weigh the same, so that sums show their order; pixels lose rays at the rims of the disks, so that
/// they differ in number.
#[test]
fn a_flood_of_rays_is_followed_to_its_end() {
    let doubling = Material {
        emission: Vec3::new(0.1, 0.7, 1.3),
        reflection: Vec3::new(0.97, 0.99, 0.9),
        transmission: Vec3::new(0.93, 0.96, 1.0),
        ior: 1.0,
        ..black()
    };
    let mirror = Material { reflection: Vec3::splat(0.98), ..black() };
    let disk = |y: f32| Shape::Disk(Disk::new(Vec3::Y * y, Vec3::Y, 30.0).unwrap());
    let disks = [(0.0, &doubling), (20.0, &doubling), (-5.0, &mirror), (25.0, &mirror)];
    let scene = scene(disks.map(|(y, material)| (disk(y), material.clone())).to_vec());
    let world = World::new(&scene).unwrap();
    let settings = Settings { max_depth: Some(20), ..settings(3, 2, 1) };
    let renderer = Renderer::new(&scene, &world, from_above(), settings.clone()).unwrap();
    for engine in engines(&world) {
        let counted = Counted::new(&*engine.tracer);
        renderer.render(&counted, Control::default()).unwrap();
        assert!(counted.closest_rays() > 6 * 8192, "{} rays", counted.closest_rays());
        let picture = render(&scene, &from_above(), &settings, &engine);
        for (i, (x, y)) in (0..6).map(|i| (i, (i % 3, i / 3))) {
            let alone = renderer.pixel(&*engine.tracer, x, y);
            assert_eq!(alone, picture.pixels[i as usize], "{}: pixel {x},{y}", engine.name);
        }
    }
}
