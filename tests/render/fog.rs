//! Fog, against Beer's law: of radiance L, T L + (1 - T) C arrives after d metres, T = exp(-a d).

use twincast::math::{DVec3, Vec3, Vec4};
use twincast::scene::{Camera, DefaultLighting, Environment, Fog, Geometry, Integrator, Light, Material};
use twincast::{Cuboid, Image, Plane, Scene, Settings, Shape, Sphere, World};

use super::{engines, matte, render, settings};

const ABSORPTION: Vec3 = Vec3::new(0.1, 0.3, 0.0);
const COLOR: Vec3 = Vec3::new(0.5, 0.25, 2.0);

fn fog(reach: f32) -> Option<Fog> {
    Some(Fog { absorption: ABSORPTION, color: COLOR, reach })
}

/// Radiance after so many metres of it.
fn through(metres: f32, light: Vec3) -> Vec3 {
    let left = Vec3::from_array(ABSORPTION.to_array().map(|a| (-a * metres).exp()));
    left * light + (1.0 - left) * COLOR
}

fn black() -> Material {
    Material { ambient: Vec3::ZERO, ..matte(0.0) }
}

fn glowing(radiance: Vec3) -> Material {
    Material { emission: radiance, ..black() }
}

fn wall(z: f32) -> Shape {
    Shape::Plane(Plane::new(Vec3::Z * z, Vec3::Z).unwrap())
}

fn scene(parts: Vec<(Shape, Material)>, reach: f32) -> Scene {
    let (shapes, materials): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let geometry = |(shape, material)| Geometry::Shapes { shapes: vec![shape], material };
    let geometries = shapes.into_iter().zip(0..).map(geometry).collect();
    Scene { fog: fog(reach), default_lighting: DefaultLighting::None, ..Scene::from_geometries(geometries, materials) }
}

/// From 5 before the origin along -z.
fn ahead() -> Camera {
    Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1e-3).unwrap()
}

/// One pixel, by both integrators and all engines, is `expected`.
fn assert_seen(scene: &Scene, camera: &Camera, expected: Vec3, what: &str) {
    assert_seen_to(None, scene, camera, expected, what);
}

/// The same with rays sent on so often at most.
fn assert_seen_to(max_depth: Option<u32>, scene: &Scene, camera: &Camera, expected: Vec3, what: &str) {
    let world = World::new(scene).unwrap();
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let settings = Settings { integrator: Some(integrator), max_depth, ..settings(1, 1, 1) };
        for engine in engines(&world) {
            let got = render(scene, camera, &settings, &engine).pixels[0];
            let off = (got - expected.extend(1.0)).abs().max_element();
            assert!(
                off < 2e-5 * (1.0 + expected.max_element()),
                "{what}, {integrator}, {}: {got} {expected}",
                engine.name
            );
        }
    }
}

#[test]
fn what_glows_fades_into_the_fog() {
    let light = Vec3::new(3.0, 2.0, 1.0);
    for z in [4.0, 0.0, -20.0] {
        let seen = scene(vec![(wall(z), glowing(light))], f32::INFINITY);
        assert_seen(&seen, &ahead(), through(5.0 - z, light), "a wall");
    }
}

#[test]
fn mirrors_lengthen_the_way() {
    let mirror = Material { reflection: Vec3::splat(0.5), ..black() };
    let light = Vec3::new(3.0, 2.0, 1.0);
    let behind = Shape::Plane(Plane::new(Vec3::Z * 12.0, Vec3::NEG_Z).unwrap());
    let seen = scene(vec![(wall(0.0), mirror), (behind, glowing(light))], f32::INFINITY);
    assert_seen(&seen, &ahead(), through(5.0, 0.5 * through(12.0, light)), "a wall in a mirror");
}

/// A block of index 1 bends nothing and mirrors nothing: only the fog in front of and behind it is left.
#[test]
fn glass_keeps_the_fog_out() {
    let light = Vec3::new(3.0, 2.0, 1.0);
    let block = Shape::Cuboid(Cuboid::new(Vec3::splat(-1.0), Vec3::ONE).unwrap());
    for material in [Material::glass(1.0), Material { transmission: Vec3::ONE, ior: 1.0, ..black() }] {
        let seen = scene(vec![(block.clone(), material), (wall(-9.0), glowing(light))], f32::INFINITY);
        assert_seen(&seen, &ahead(), through(14.0 - 2.0, light), "a wall behind glass");
    }
    // A wall within it, and glass that absorbs as well.
    let dye = twincast::scene::Absorption { color: Vec3::splat(0.5), distance: 1.0 };
    let dyed = Material { absorption: Some(dye), ..Material::glass(1.0) };
    let disk = Shape::Disk(twincast::Disk::new(Vec3::ZERO, Vec3::Z, 0.5).unwrap());
    let seen = scene(vec![(block, dyed), (disk, glowing(light))], f32::INFINITY);
    assert_seen(&seen, &ahead(), through(4.0, 0.5 * light), "a disk in glass");
    let pane = Material { interface: twincast::scene::Interface::Thin, ..Material::glass(1.0) };
    let seen = scene(vec![(wall(0.0), pane), (wall(-9.0), glowing(light))], f32::INFINITY);
    assert_seen(&seen, &ahead(), through(14.0, light), "a wall behind a pane");
}

#[test]
fn the_way_to_a_light_is_in_the_fog_too() {
    let (height, color) = (8.0, Vec3::new(4.0, 2.0, 1.0));
    let point = Light::Point {
        position: DVec3::Z * height,
        color,
        attenuation: twincast::scene::Attenuation::NONE,
        range: f64::INFINITY,
        radius: 0.0,
    };
    let mut lit = scene(vec![(wall(0.0), matte(0.5))], f32::INFINITY);
    lit.lights = vec![point];
    let left = through(height as f32, Vec3::ONE) - through(height as f32, Vec3::ZERO);
    // A path would also find the fog's own light by way of the wall.
    assert_seen_to(Some(0), &lit, &ahead(), through(5.0, 0.5 * color * left), "a lamp");

    // What is infinitely far is `reach` away: never, where that is infinite.
    lit.lights = vec![Light::Directional { direction: DVec3::NEG_Z, color }];
    let clear = Vec3::new(0.0, 0.0, 1.0);
    assert_seen_to(Some(0), &lit, &ahead(), through(5.0, 0.5 * color * clear), "a sun behind endless fog");
    lit.fog = fog(3.0);
    let left = through(3.0, Vec3::ONE) - through(3.0, Vec3::ZERO);
    assert_seen_to(Some(0), &lit, &ahead(), through(5.0, 0.5 * color * left), "a sun behind some fog");
}

#[test]
fn who_looks_past_everything_sees_the_reach() {
    let ball = Shape::Sphere(Sphere { centre: Vec3::Y * 50.0, radius: 1.0 });
    let mut past = scene(vec![(ball, matte(0.5))], f32::INFINITY);
    let clear = Vec3::new(0.0, 0.0, 1.0);
    assert_seen(&past, &ahead(), COLOR * (1.0 - clear), "nothing, which is opaque");
    past.background = Some(Vec3::ONE);
    assert_seen(&past, &ahead(), COLOR * (1.0 - clear) + clear, "a background");
    (past.background, past.fog) = (None, fog(4.0));
    let sky = Image { width: 4, height: 2, pixels: vec![Vec4::new(2.0, 1.0, 3.0, 1.0); 8] };
    past.environment = Some(Environment::new(sky));
    assert_seen(&past, &ahead(), through(4.0, Vec3::new(2.0, 1.0, 3.0)), "a sky");
}

/// Where everything shows 1, white fog shows it, too: in a furnace, and under a white sky.
#[test]
fn white_fog_in_a_furnace_changes_nothing() {
    let grey = Fog { absorption: Vec3::new(0.2, 0.5, 1.0), color: Vec3::ONE, reach: 6.0 };
    let furnace = Material { emission: Vec3::splat(0.5), ..matte(0.5) };
    let ball = |radius| Shape::Sphere(Sphere { centre: Vec3::ZERO, radius });
    let inside = scene(vec![(ball(2.0), furnace)], f32::INFINITY);
    let white = Environment::new(Image { width: 8, height: 4, pixels: vec![Vec4::ONE; 32] });
    let under = |material| Scene { environment: Some(white.clone()), ..scene(vec![(ball(1.0), material)], 1.0) };
    let centre = Camera::look_at(DVec3::new(0.3, 0.2, 0.1), DVec3::X, DVec3::Y, 1.5).unwrap();
    let outside = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 2.0 * 0.19f64.asin()).unwrap();
    for (name, scene, camera) in [
        ("furnace", inside, &centre),
        ("white ball", under(matte(1.0)), &outside),
        ("glass ball", under(Material::glass(1.5)), &outside),
    ] {
        let scene = Scene { fog: Some(grey), ..scene };
        let world = World::new(&scene).unwrap();
        let settings = Settings { integrator: Some(Integrator::Path), ..settings(16, 16, 64) };
        for engine in engines(&world).iter().filter(|engine| engine.name == "native") {
            let image = render(&scene, camera, &settings, engine);
            let mean = image.pixels.iter().sum::<Vec4>() / image.pixels.len() as f32;
            assert!((mean - 1.0).abs().max_element() < 0.005, "{name}: {mean}");
        }
    }
}

/// A transform of the scene takes the fog along.
#[test]
fn fog_is_scaled_with_the_scene() {
    let mut scene = scene(vec![(wall(0.0), matte(0.5))], 8.0);
    scene.transform(&twincast::math::DAffine3::from_scale(DVec3::splat(0.5)));
    assert_eq!(scene.fog, Some(Fog { absorption: ABSORPTION * 2.0, color: COLOR, reach: 4.0 }));
}

#[test]
fn files_say_what_the_fog_is_and_are_told_what_it_hides() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fog.toml");
    let text = |fog: &str| {
        format!(
            "[fog]\n{fog}\n[[light]]\ntype = \"directional\"\ndirection = [0, -1, 0]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n"
        )
    };
    let load = |fog: &str| {
        std::fs::write(&path, text(fog)).unwrap();
        twincast::io::load(&path, &Default::default())
    };
    let (scene, warnings) = load("absorption = [0.1, 0.3, 0]\ncolor = [0.5, 0.25, 2]\nreach = 7").unwrap();
    assert_eq!((scene.fog, warnings.len()), (fog(7.0), 0));
    let (scene, warnings) = load("absorption = 0.5").unwrap();
    assert_eq!(scene.fog, Some(Fog { absorption: Vec3::splat(0.5), color: Vec3::ZERO, reach: f32::INFINITY }));
    assert!(warnings.len() == 1 && warnings[0].to_string().contains("\"reach\""), "{warnings:?}");
    for (fog, words) in [
        ("color = 1", "lacks \"absorption\""),
        ("absorption = -1", "from 0 up"),
        ("absorption = 1\nreach = 0", "metres above 0"),
        ("absorption = 1\ncolour = 1", "did you mean \"color\""),
    ] {
        let error = load(fog).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains(words), "{error}");
    }
}
