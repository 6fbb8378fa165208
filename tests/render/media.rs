//! Light inside of things that absorb it: against Beer's law.

use twincast::math::{DVec3, Vec3};
use twincast::scene::{Absorption, Attenuation, Camera, Geometry, Integrator, Interface, Light, Material};
use twincast::{Cuboid, Disk, Ellipsoid, Scene, Settings, Shape, Sphere, World};

use super::{engines, render, settings};

/// What is left of light after a metre of the water.
const LEFT: f32 = 0.5;

/// A disk in the middle of a cube of water of four metres, as seen from above, with `more` in it.
fn in_water(disk: Material, absorption: bool, lights: Vec<Light>, more: Vec<(Shape, Material)>) -> Scene {
    let absorption = absorption.then_some(Absorption { color: Vec3::splat(LEFT), distance: 1.0 });
    let water = Material { absorption, ..Material::glass(1.0) };
    let cube = Cuboid::new(Vec3::splat(-2.0), Vec3::splat(2.0)).unwrap();
    let mut parts = vec![(cube.into(), water), (Disk::new(Vec3::ZERO, Vec3::Y, 0.5).unwrap().into(), disk)];
    parts.extend(more);
    let (shapes, materials): (Vec<Shape>, Vec<_>) = parts.into_iter().unzip();
    let geometry = |(shape, material)| Geometry::Shapes { shapes: vec![shape], material };
    let geometries = shapes.into_iter().zip(0..).map(geometry).collect();
    Scene { lights, ..Scene::from_geometries(geometries, materials) }
}

/// What the middle of the disk shows.
fn seen(scene: &Scene, integrator: Integrator, spp: u32) -> f32 {
    let camera = Camera::look_at(DVec3::new(0.0, 5.0, 1e-3), DVec3::ZERO, DVec3::Z, 0.01).unwrap();
    let settings = Settings { integrator: Some(integrator), max_depth: Some(20), ..settings(4, 4, spp) };
    let world = World::new(scene).unwrap();
    let engines = engines(&world);
    let native = engines.iter().find(|engine| engine.name == "native").unwrap();
    let image = render(scene, &camera, &settings, native);
    image.pixels.iter().map(|pixel| pixel.x).sum::<f32>() / image.pixels.len() as f32
}

fn dark() -> Vec<Light> {
    vec![Light::Directional { direction: DVec3::X, color: Vec3::ZERO }]
}

fn shown() -> Material {
    Material { unlit: true, diffuse: Vec3::ONE, ..Material::default() }
}

/// What light goes through on its way from a lamp counts as what it goes through on its way to the eye.
#[test]
fn light_from_lamps_in_water_is_absorbed() {
    let white = Material { diffuse: Vec3::ONE, ambient: Vec3::ZERO, specular: Vec3::ZERO, ..Material::default() };
    let lamp = Light::Point {
        position: DVec3::new(0.0, 1.0, 1.0),
        color: Vec3::ONE,
        attenuation: Attenuation::NONE,
        range: f64::INFINITY,
        radius: 0.0,
    };
    let way = LEFT.powf(2.0 + 2f32.sqrt());
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let [clear, absorbing] = [false, true]
            .map(|absorbs| seen(&in_water(white.clone(), absorbs, vec![lamp.clone()], Vec::new()), integrator, 1));
        assert!((clear - 0.5f32.sqrt()).abs() < 1e-3, "{integrator}: {clear}");
        assert!((absorbing / clear / way - 1.0).abs() < 2e-3, "{integrator}: {absorbing} of {clear}");
    }
    // A lamp that is asked, and one that paths find.
    let glow = Material { emission: Vec3::ONE, diffuse: Vec3::ZERO, ambient: Vec3::ZERO, ..Material::default() };
    let centre = Vec3::new(0.0, 0.8, 0.9);
    let asked = Sphere { centre, radius: 0.5 }.into();
    let axes = twincast::math::Mat3::from_diagonal(Vec3::new(0.5, 0.5, 0.501));
    let found = Ellipsoid::new(centre, axes).unwrap().into();
    let [asked, found] = [asked, found].map(|shape: Shape| {
        seen(&in_water(white.clone(), true, dark(), vec![(shape, glow.clone())]), Integrator::Path, 4096)
    });
    assert!((asked / found - 1.0).abs() < 0.03, "{asked} asked, {found} found");
}

/// The headlight is where the eye is: how far away in the air is nothing to the water, whose way to the eye counts
/// alone.
#[test]
fn the_headlight_is_not_absorbed() {
    let white = Material { diffuse: Vec3::ONE, ambient: Vec3::ZERO, specular: Vec3::ZERO, ..Material::default() };
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let [clear, absorbing] =
            [false, true].map(|absorbs| seen(&in_water(white.clone(), absorbs, Vec::new(), Vec::new()), integrator, 1));
        assert!(clear > 0.9 && (absorbing / clear - LEFT.powi(2)).abs() < 1e-3, "{integrator}: {absorbing} of {clear}");
    }
}

/// Through frosted ink a lamp is seen that is in the air behind it, where nothing is absorbed; whether it is asked, or
/// found.
#[test]
fn a_lamp_behind_frosted_ink_is_in_the_air() {
    let glow = Material { emission: Vec3::ONE, diffuse: Vec3::ZERO, ambient: Vec3::ZERO, ..Material::default() };
    let ink = Material {
        gloss: Some(20.0),
        absorption: Some(Absorption { color: Vec3::splat(LEFT), distance: 1.0 }),
        ..Material::glass(1.0)
    };
    let slab = Cuboid::new(Vec3::new(-9.0, -0.25, -9.0), Vec3::new(9.0, 0.25, 9.0)).unwrap();
    let centre = Vec3::new(0.5, -4.0, 0.0);
    let axes = twincast::math::Mat3::from_diagonal(Vec3::new(1.0, 1.0, 1.001));
    let lamps: [Shape; 2] = [Sphere { centre, radius: 1.0 }.into(), Ellipsoid::new(centre, axes).unwrap().into()];
    let [asked, found] = lamps.map(|lamp| {
        let geometries = [Shape::from(slab), lamp].into_iter().zip(0..);
        let geometries = geometries.map(|(shape, material)| Geometry::Shapes { shapes: vec![shape], material });
        let scene = Scene::from_geometries(geometries.collect(), vec![ink.clone(), glow.clone()]);
        seen(&Scene { lights: dark(), ..scene }, Integrator::Path, 4096)
    });
    assert!(found > 0.05 && (asked / found - 1.0).abs() < 0.05, "{asked} asked, {found} found");
}

/// Behind a pane and behind a bubble there is water again.
#[test]
fn what_is_in_water_does_not_end_it() {
    let above = |y: f32, size: f32| {
        let half = Vec3::new(1.0, size / 2.0, 1.0);
        Shape::from(Cuboid::new(Vec3::Y * y - half, Vec3::Y * y + half).unwrap())
    };
    let clear = Material::glass(1.0);
    let pane = Material { interface: Interface::Thin, ..Material::glass(1.0) };
    let sheet = |normal| Shape::from(Disk::new(Vec3::Y, normal, 1.0).unwrap());
    let red =
        Material { absorption: Some(Absorption { color: Vec3::splat(0.1), distance: 1.0 }), ..Material::glass(1.0) };
    for (what, more, expected) in [
        ("water alone", vec![], LEFT.powi(2)),
        ("a pane", vec![(sheet(Vec3::Y), pane.clone())], LEFT.powi(2)),
        ("a pane from behind", vec![(sheet(Vec3::NEG_Y), pane)], LEFT.powi(2)),
        ("a bubble", vec![(above(1.0, 0.5), clear.clone())], LEFT.powf(1.5)),
        ("two bubbles", vec![(above(0.4, 0.2), clear.clone()), (above(1.0, 0.5), clear)], LEFT.powf(1.3)),
        ("ink", vec![(above(1.0, 0.5), red)], LEFT.powf(1.5) * 0.1f32.powf(0.5)),
    ] {
        let scene = in_water(shown(), true, dark(), more);
        // Paths of many steps may end by chance.
        for (integrator, spp, tolerance) in [(Integrator::Whitted, 1, 1e-3), (Integrator::Path, 4096, 0.01)] {
            let got = seen(&scene, integrator, spp);
            assert!((got - expected).abs() < tolerance, "{what}, {integrator}: {got}, not {expected}");
        }
    }
}

/// Of a thin sheet of something large, rays start a millionth of its size within: the way of the light is the whole one
/// nevertheless. Against what Fresnel's equations leave at both faces, however often light goes to and fro between
/// them.
#[test]
fn thin_sheets_of_large_bodies_absorb() {
    for (half, thick) in [(1.0, 0.01f32), (10.0, 0.001), (100.0, 0.01)] {
        let absorption = Some(Absorption { color: Vec3::splat(LEFT), distance: thick });
        let sheet = Cuboid::new(Vec3::new(-half, -thick, -half), Vec3::new(half, 0.0, half)).unwrap();
        let shapes = |shape: Shape, material| Geometry::Shapes { shapes: vec![shape], material };
        let below = twincast::Plane::new(Vec3::NEG_Y, Vec3::Y).unwrap();
        let geometries = vec![shapes(sheet.into(), 0), shapes(below.into(), 1)];
        let scene = Scene::from_geometries(geometries, vec![Material { absorption, ..Material::glass(1.5) }, shown()]);
        let scene = Scene { lights: dark(), ..scene };
        let lost = 0.04f32;
        let expected = (1.0 - lost).powi(2) * LEFT / (1.0 - (lost * LEFT).powi(2));
        let found = seen(&scene, Integrator::Whitted, 1);
        assert!((found / expected - 1.0).abs() < 1e-3, "{thick} of {half}: {found}, not {expected}");
    }
}
