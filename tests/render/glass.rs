//! Glass by Fresnel's equations, absorption, gloss and what ray casting shows of them: against closed forms.

use twincast::math::{DVec3, Vec3, Vec4};
use twincast::scene::{Absorption, Camera, Environment, Geometry, Integrator, Interface, Material};
use twincast::{Cuboid, Image, Plane, Scene, Settings, Shape, World};

use super::{engines, render, settings};

/// Red above the horizon, green below it.
fn sky() -> Environment {
    let color = |y: u32| if y < 32 { Vec4::new(1.0, 0.0, 0.0, 1.0) } else { Vec4::new(0.0, 1.0, 0.0, 1.0) };
    Environment::new(Image { width: 4, height: 64, pixels: (0..64 * 4).map(|i| color(i / 4)).collect() })
}

fn scene(shape: Shape, material: Material) -> Scene {
    let geometry = Geometry::Shapes { shapes: vec![shape], material: 0 };
    Scene { environment: Some(sky()), ..Scene::from_geometries(vec![geometry], vec![material]) }
}

fn ground() -> Shape {
    Shape::Plane(Plane::new(Vec3::ZERO, Vec3::Y).unwrap())
}

/// Towards the origin, at an angle to the vertical, from above or from below.
fn towards_origin(degrees: f64, above: bool) -> Camera {
    let a = degrees.to_radians();
    let eye = DVec3::new(-a.sin(), if above { a.cos() } else { -a.cos() }, 0.0);
    Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 1e-4).unwrap()
}

fn pixel(scene: &Scene, camera: &Camera, settings: &Settings) -> Vec3 {
    let world = World::new(scene).unwrap();
    let pixels: Vec<_> = engines(&world).iter().map(|e| render(scene, camera, settings, e).pixels[0]).collect();
    assert!(pixels.windows(2).all(|pair| pair[0] == pair[1]), "engines differ: {pixels:?}");
    pixels[0].truncate()
}

fn by(integrator: Integrator, spp: u32) -> Settings {
    Settings { integrator: Some(integrator), ..settings(1, 1, spp) }
}

/// r for light that is not polarised, from the sines and tangents of Fresnel's own form.
fn fresnel(degrees: f64, ior: f64) -> f64 {
    let (a, b) = (degrees.to_radians(), (degrees.to_radians().sin() / ior).asin());
    0.5 * (((a - b).sin() / (a + b).sin()).powi(2) + ((a - b).tan() / (a + b).tan()).powi(2))
}

#[test]
fn water_mirrors_the_sky_by_fresnels_equations_and_everything_beyond_the_critical_angle() {
    let n = 1.33f64;
    let water = scene(ground(), Material::glass(n as f32));
    for degrees in [10.0, 45.0, 70.0, 85.0] {
        let r = fresnel(degrees, n) as f32;
        // Radiance below is n^2 times that above.
        let expected = Vec3::new(r, (1.0 - r) / (n * n) as f32, 0.0);
        let got = pixel(&water, &towards_origin(degrees, true), &by(Integrator::Whitted, 1));
        assert!((got - expected).length() < 1e-5, "{degrees}: {got} {expected}");
        let faked = pixel(&water, &towards_origin(degrees, true), &by(Integrator::RayCast, 1));
        assert!((faked - Vec3::new(r, 1.0 - r, 0.0)).length() < 1e-5, "no ray enters the water: {faked}");
    }
    for degrees in [49.0, 60.0, 80.0] {
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let got = pixel(&water, &towards_origin(degrees, false), &by(integrator, 1));
            assert_eq!(got, Vec3::Y, "{degrees}: all of what is below, nothing of the sky");
        }
    }
    // Straight up from below: r = ((n - 1) / (n + 1))^2, and n^2 times the sky.
    let r = ((n - 1.0) / (n + 1.0)).powi(2) as f32;
    let got = pixel(&water, &towards_origin(0.1, false), &by(Integrator::Whitted, 1));
    assert!((got - Vec3::new((1.0 - r) * (n * n) as f32, r, 0.0)).length() < 1e-5, "{got}");
}

/// The path tracer takes one of the two ways at a time: the mean is that of both.
#[test]
fn paths_mirror_as_often_as_fresnel_has_it() {
    let water = scene(ground(), Material::glass(1.5));
    let camera = towards_origin(75.0, true);
    let [whitted, path] =
        [(Integrator::Whitted, 1), (Integrator::Path, 4096)].map(|(i, spp)| pixel(&water, &camera, &by(i, spp)));
    // The standard error of a share p is sqrt(p (1 - p) / n); samples are stratified, and much better than that.
    let p = f64::from(whitted.x);
    let limit = 3.0 * (p * (1.0 - p) / 4096.0).sqrt();
    assert!((whitted - path).length() < limit as f32, "{whitted} {path}");
}

#[test]
fn light_fades_by_beers_law() {
    let absorption = Some(Absorption { color: Vec3::new(0.5, 0.25, 1.0), distance: 0.5 });
    // Nothing is mirrored and nothing bent where the index is 1: what is left is 0.5^(2 / 0.5) of red.
    let block = |x| Shape::Cuboid(Cuboid::new(Vec3::new(-1.0, -1.0, -1.0), Vec3::new(1.0, 1.0, x)).unwrap());
    let dye = Material { absorption, ..Material::glass(1.0) };
    for (z, length) in [(1.0, 2.0f32), (0.0, 1.0)] {
        let mut scene = scene(block(z), dye.clone());
        scene.environment = None;
        scene.background = Some(Vec3::ONE);
        let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 0.01).unwrap();
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let got = pixel(&scene, &camera, &by(integrator, 1));
            let expected = Vec3::new(0.5f32.powf(length / 0.5), 0.25f32.powf(length / 0.5), 1.0);
            assert!((got - expected).length() < 1e-5, "{integrator}: {got} {expected}");
        }
    }
    // Something that is matte within it is seen through half of it.
    let mut inside = scene(block(1.0), dye);
    let shapes = vec![Shape::Disk(twincast::Disk::new(Vec3::ZERO, Vec3::Z, 0.5).unwrap())];
    inside.geometries.push(Geometry::Shapes { shapes, material: 1 });
    inside.groups[0].geometries = 0..2;
    inside.materials.push(Material { unlit: true, diffuse: Vec3::ONE, ..Material::default() });
    let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 0.01).unwrap();
    let got = pixel(&inside, &camera, &by(Integrator::Whitted, 1));
    assert!((got - Vec3::new(0.25, 0.0625, 1.0)).length() < 1e-5, "{got}");
}

#[test]
fn a_thin_pane_lets_light_straight_through() {
    let pane = Material { interface: Interface::Thin, transmission: Vec3::splat(0.5), ..Material::glass(1.5) };
    let scene = scene(ground(), pane);
    let r = fresnel(60.0, 1.5) as f32;
    let both = 2.0 * r / (1.0 + r);
    for above in [true, false] {
        let got = pixel(&scene, &towards_origin(60.0, above), &by(Integrator::Whitted, 1));
        let (mirrored, through) = if above { (got.x, got.y) } else { (got.y, got.x) };
        assert!((mirrored - both).abs() < 1e-5 && (through - 0.5 * (1.0 - both)).abs() < 1e-5, "{got}");
    }
}

/// Straight above ground whose mirror spreads by cos^n, half of the sphere is red: all of it. At 60 degrees a part of
/// the lobe is lost below the ground, which is counted by hand.
#[test]
fn gloss_spreads_by_its_exponent() {
    let n = 4.0;
    let glossy = Material { gloss: Some(n as f32), reflection: Vec3::ONE, diffuse: Vec3::ZERO, ..Material::default() };
    let scene = scene(ground(), glossy);
    let steps = 400;
    let lost = |degrees: f64| {
        let axis = DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let mut sum = 0.0;
        for i in 0..steps {
            for j in 0..steps {
                // Equal shares of the density (n + 1) / (2 pi) cos^n about the axis.
                let cosine = ((f64::from(i) + 0.5) / f64::from(steps)).powf(1.0 / (n + 1.0));
                let angle = (f64::from(j) + 0.5) / f64::from(steps) * std::f64::consts::TAU;
                let sine = (1.0 - cosine * cosine).sqrt();
                let across = DVec3::new(axis.y, -axis.x, 0.0) * angle.cos() + DVec3::Z * angle.sin();
                sum += f64::from(u8::from((axis * cosine + across * sine).y < 0.0));
            }
        }
        sum / f64::from(steps * steps)
    };
    for degrees in [0.1, 60.0] {
        // A path is weighed against the sky, which makes it noisier here.
        for (integrator, spp) in [(Integrator::Whitted, 1024), (Integrator::Path, 16_384)] {
            let got = pixel(&scene, &towards_origin(degrees, true), &by(integrator, spp));
            let expected = 1.0 - lost(degrees) as f32;
            // The sky fades to green within a pixel of the horizon.
            assert!((got.x + got.y - expected).abs() < 0.01, "{integrator} {degrees}: {got} {expected}");
        }
    }
}

#[test]
fn what_is_unlit_shows_its_colour() {
    let flat = Material { unlit: true, diffuse: Vec3::new(0.1, 0.5, 2.0), specular: Vec3::ONE, ..Material::default() };
    let mut scene = scene(ground(), flat);
    scene.ambient = Vec3::ONE;
    for integrator in Integrator::ALL {
        assert_eq!(pixel(&scene, &towards_origin(30.0, true), &by(integrator, 1)), Vec3::new(0.1, 0.5, 2.0));
    }
}
