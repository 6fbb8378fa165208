//! Pictures of scenes whose every pixel has a formula: how light weakens, how wide shadows and blurs are. Furnaces,
//! form factors and caustics are in `transport`, Fresnel's equations in `glass`, the rays of lenses in `camera`.

use twincast::math::{DVec3, Vec3, Vec4};
use twincast::render::{Filter, Sampling};
use twincast::scene::{
    AreaShape, Attenuation, Camera, DefaultLighting, Fov, Geometry, Integrator, Light, Material, Mesh, Projection,
    ThinLens,
};
use twincast::{Image, Scene, Settings, Shape, Sphere, World};

use super::{engines, floor, from_above, matte, render, settings};

fn picture(scene: &Scene, camera: &Camera, settings: &Settings) -> Image {
    let world = World::new(scene).unwrap();
    let engines = engines(&world);
    render(scene, camera, settings, engines.iter().find(|engine| engine.name == "native").unwrap())
}

fn by(integrator: Integrator, settings: Settings) -> Settings {
    // Only light that comes straight from the lights.
    Settings { integrator: Some(integrator), max_depth: Some(0), ..settings }
}

/// E = I cos(a) / d^2 (Lambert 1760, *Photometria*), for lamps without extent and, by the form factor of a ball, pi L
/// (r / d)^2, for one that has some: under a lamp at twice the distance it is a quarter as bright.
#[test]
fn light_weakens_with_the_square_of_the_distance() {
    let aside = DVec3::new(2.0, 0.0, 2.0);
    let lamps = |height: f64| {
        let (position, color) = (DVec3::Y * height, Vec3::splat(9.0));
        let (attenuation, range) = (Attenuation::INVERSE_SQUARE, f64::INFINITY);
        let (inner_angle, outer_angle) = (1.5, 1.55);
        [
            Light::Point { position, color, attenuation, range, radius: 0.0 },
            Light::Spot { position, direction: DVec3::NEG_Y, color, attenuation, range, inner_angle, outer_angle },
            // L r^2 = 9.
            Light::Area { shape: AreaShape::Sphere { centre: position, radius: 0.5 }, radiance: Vec3::splat(36.0) },
        ]
    };
    for place in [DVec3::ZERO, aside] {
        for height in [1.0, 2.0, 4.0, 8.0, 16.0] {
            for (i, lamp) in lamps(height).into_iter().enumerate() {
                let scene =
                    Scene { lights: vec![lamp], ..Scene::from_geometries(vec![floor(50.0, 0)], vec![matte(0.5)]) };
                let eye = place + DVec3::new(0.1, 0.7, 0.2);
                let camera = Camera::look_at(eye, place, DVec3::Y, 1e-4).unwrap();
                let squared = height * height + place.length_squared();
                let expected = (0.5 * 9.0 / squared * (height / squared.sqrt())) as f32;
                for integrator in [Integrator::RayCast, Integrator::Path] {
                    let samples = if i == 2 { 256 } else { 1 };
                    let got = picture(&scene, &camera, &by(integrator, settings(1, 1, samples))).pixels[0].x;
                    let off = (got / expected - 1.0).abs();
                    // All of the ball must be above the horizon for its form factor, which it is.
                    assert!(
                        off < if i == 2 { 5e-3 } else { 1e-4 },
                        "{integrator}, lamp {i} at {height}: {got} {expected}"
                    );
                }
            }
        }
    }
}

/// An edge at height h below a ball of light of radius r whose middle is D above the edge: the planes through the edge
/// that touch the ball lean by asin(r / D), so that the penumbra is 2 h tan asin(r / D) wide, and half as bright in its
/// middle.
#[test]
fn penumbras_are_as_wide_as_tangents_have_it() {
    let (h, d) = (1.0f64, 4.0f64);
    for r in [0.3, 1.0] {
        let shape = AreaShape::Sphere { centre: DVec3::Y * (h + d), radius: r };
        let light = Light::Area { shape, radiance: Vec3::splat(10.0) };
        let corners = [(0.0, 50.0), (50.0, 50.0), (50.0, -50.0), (0.0, -50.0)];
        let board = Mesh::new(corners.map(|(x, z)| Vec3::new(x, h as f32, z)).to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        let open = Scene { lights: vec![light], ..Scene::from_geometries(vec![floor(50.0, 0)], vec![matte(1.0)]) };
        let parts = vec![floor(50.0, 0), Geometry::Mesh(board)];
        let shaded = Scene { lights: open.lights.clone(), ..Scene::from_geometries(parts, vec![matte(1.0)]) };
        let expected = 2.0 * h * (r / d).asin().tan();
        // Parallel rays from below the board; the row of pixels is twice as wide as the penumbra.
        let columns = 200;
        let camera = Camera::look_at(DVec3::Y * 0.5, DVec3::ZERO, DVec3::NEG_Z, 1.0).unwrap();
        let row = 2.0 * expected;
        let camera = Camera { projection: Projection::Orthographic(row / f64::from(columns)), ..camera };
        let settings = Settings { light_samples: 1024, ..settings(columns, 1, 1) };
        let [lit, shadow] = [&open, &shaded].map(|scene| picture(scene, &camera, &settings).pixels);
        let share = |i: usize| f64::from(shadow[i].x / lit[i].x);
        assert!(share(0) == 1.0 && share(columns as usize - 1) == 0.0);
        let between = (0..columns as usize).filter(|&i| (2e-3..0.998).contains(&share(i))).count();
        let width = between as f64 * row / f64::from(columns);
        // The last hundredths of it are darker, or brighter, by less than 0.2 %.
        assert!((width / expected - 1.0).abs() < 0.05, "{r}: {width} wide, not {expected}");
        let middle = (share(99) + share(100)) / 2.0;
        assert!((middle - 0.5).abs() < 0.01, "{r}: {middle} in the middle");
        let falls = (1..columns as usize).all(|i| share(i) <= share(i - 1) + 0.02);
        assert!(falls, "{r}: darker towards the shadow");
    }
}

/// A ball of light of radius p at distance d from a lens of radius R that is focussed at f: in the plane of focus its
/// picture is a disk of radius R |f - d| / d + p f / d (similar triangles; Potmesil and Chakravarty 1981, *A lens and
/// aperture camera model*), and from its middle the share (p f / (R |f - d|))^2 of the lens sees it.
#[test]
fn a_point_out_of_focus_becomes_a_disk() {
    let (lens, focus, size) = (0.2f64, 5.0f64, 100u32);
    let glow = Material { emission: Vec3::ONE, ambient: Vec3::ZERO, ..matte(0.0) };
    for (distance, point) in [(3.0, 0.03), (10.0, 0.05)] {
        let ball = Shape::Sphere(Sphere { centre: Vec3::Z * -distance as f32, radius: point as f32 });
        let shapes = Geometry::Shapes { shapes: vec![ball], material: 0 };
        let scene = Scene {
            default_lighting: DefaultLighting::None,
            ..Scene::from_geometries(vec![shapes], vec![glow.clone()])
        };
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0).unwrap();
        let blur = lens * (focus - distance).abs() / distance;
        let radius = blur + point * focus / distance;
        // The disk is half as wide as the picture.
        let half = 2.0 * radius / focus;
        let camera = Camera {
            projection: Projection::Perspective(Fov::Vertical(2.0 * half.atan())),
            lens: Some(ThinLens { radius: lens, focus, blades: 0 }),
            ..camera
        };
        let seen = picture(&scene, &camera, &settings(size, size, 256));
        let pixel = 2.0 * half * focus / f64::from(size);
        let (mut farthest, mut sum) = (0f64, 0.0);
        for (i, value) in seen.pixels.iter().enumerate() {
            let offset = |k: u32| (f64::from(k) + 0.5 - f64::from(size) / 2.0) * pixel;
            if value.x > 0.0 {
                farthest = farthest.max(offset(i as u32 % size).hypot(offset(i as u32 / size)));
            }
            sum += f64::from(value.x);
        }
        assert!((farthest - radius).abs() < 2.0 * pixel, "{distance}: {farthest}, not {radius}");
        // Nothing is lost: as much as the sharp disk would have.
        let sharp = std::f64::consts::PI * (point * focus / distance).powi(2) / (pixel * pixel);
        assert!((sum / sharp - 1.0).abs() < 0.02, "{distance}: {sum}, not {sharp}");
        let middle =
            (0..100).map(|k| seen.pixels[((45 + k / 10) * size + 45 + k % 10) as usize].x).sum::<f32>() / 100.0;
        let share = (point * focus / (lens * (focus - distance).abs())).powi(2);
        assert!((f64::from(middle) / share - 1.0).abs() < 0.05, "{distance}: {middle}, not {share}");
    }
}

/// What is alike everywhere stays so by every filter, with however few samples; and what is black and white goes beyond
/// either by no more than the filter's negative lobes weigh.
#[test]
fn few_samples_keep_what_is_even_and_stay_near_what_is_there() {
    let white = Material { unlit: true, diffuse: Vec3::ONE, ..Material::default() };
    let cards = (0..8).map(|k| {
        let corners = [[0.0, -9.0], [0.04, -9.0], [0.04, 9.0], [0.0, 9.0]]
            .map(|[x, z]| Vec3::new(x + 0.1 * k as f32 - 0.4, 0.0, z));
        Geometry::Mesh(Mesh::new(corners.into(), vec![[0, 1, 2], [0, 2, 3]]))
    });
    let stripes = Scene::from_geometries(cards.collect(), vec![white]);
    let grey =
        Scene { background: Some(Vec3::splat(0.5)), ..Scene::from_geometries(vec![floor(1e-6, 0)], vec![matte(0.5)]) };
    let aside = Camera::look_at(DVec3::Y, DVec3::Y * 2.0, DVec3::Z, 1.0).unwrap();
    for filter in Filter::ALL {
        for sampling in Sampling::ALL {
            for spp in [1, 2, 4, 5, 16] {
                let settings = Settings { filter, sampling, ..settings(16, 16, spp) };
                let even = picture(&grey, &aside, &settings);
                let is_even =
                    even.pixels.iter().all(|p| (*p - Vec4::new(0.5, 0.5, 0.5, 1.0)).abs().max_element() < 1e-6);
                assert!(is_even, "{filter}, {sampling}, {spp} samples");
                // Mitchell's, over both axes: 0.0725 of its sum.
                let beyond = if filter == Filter::Mitchell { 0.0735 } else { 1e-6 };
                let image = picture(&stripes, &from_above(), &settings);
                for pixel in &image.pixels {
                    assert!(
                        (-beyond..=1.0 + beyond).contains(&pixel.x),
                        "{filter}, {sampling}, {spp} samples: {pixel}"
                    );
                }
            }
        }
    }
}
