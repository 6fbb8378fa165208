//! How light goes round: furnaces, form factors, a caustic, and integrators against each other.

use std::f32::consts::{PI, TAU};

use twincast::math::{DAffine3, DMat3, DVec3, Mat3, Vec3, Vec4};
use twincast::render::Control;
use twincast::scene::{
    AreaShape, Camera, Environment, Geometry, Integrator, Interface, Light, Material, Mesh, Specular,
};
use twincast::{Cuboid, Disk, Image, Plane, Renderer, Scene, Settings, Shape, Sphere, World};

use super::{Engine, engines, floor, matte, render, settings};

fn sphere(centre: Vec3, radius: f32) -> Shape {
    Shape::Sphere(Sphere { centre, radius })
}

fn scene(parts: Vec<(Shape, Material)>) -> Scene {
    let (shapes, materials): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    let geometry = |(shape, material)| Geometry::Shapes { shapes: vec![shape], material };
    let mut scene = Scene::from_geometries(shapes.into_iter().zip(0..).map(geometry).collect(), materials);
    // No headlight.
    scene.lights = vec![Light::Directional { direction: DVec3::X, color: Vec3::ZERO }];
    scene
}

fn black() -> Material {
    Material { ambient: Vec3::ZERO, ..matte(0.0) }
}

fn glowing(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..black() }
}

fn paths(width: u32, spp: u32) -> Settings {
    Settings { integrator: Some(Integrator::Path), ..settings(width, width, spp) }
}

fn mean(image: &Image) -> Vec3 {
    let sum = image.pixels.iter().fold(Vec4::ZERO, |sum, pixel| sum + *pixel);
    (sum / image.pixels.len() as f32).truncate()
}

/// The mean of the picture, by the native engine and by Embree.
fn means(scene: &Scene, camera: &Camera, settings: &Settings) -> Vec<(&'static str, Vec3)> {
    let world = World::new(scene).unwrap();
    let fast = |engine: &&Engine| ["native", "embree"].contains(&engine.name);
    let means: Vec<_> =
        engines(&world).iter().filter(fast).map(|e| (e.name, mean(&render(scene, camera, settings, e)))).collect();
    assert_eq!(means.len(), 1 + usize::from(cfg!(feature = "embree")));
    means
}

/// A ball that glows shows what it sends out and no more, whatever it is made of: it is convex, and nothing of it
/// lights it, be it a lamp by itself, in the place of one, or turned and scaled.
#[test]
fn a_glowing_ball_does_not_light_itself() {
    let lamp = Material { emission: Vec3::splat(3.0), ..matte(0.8) };
    for (centre, radius, scale) in
        [(DVec3::ZERO, 1.0, 1.0), (DVec3::new(7.0, -2.0, 30.0), 0.5, 0.7), (DVec3::ZERO, 0.01, 1.0)]
    {
        let mut scene = scene(vec![(sphere(Vec3::ZERO, radius), lamp.clone())]);
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7) * scale;
        scene.instances[0].transform =
            DAffine3 { matrix3: if scale == 1.0 { DMat3::IDENTITY } else { turn }, translation: centre };
        let radius = f64::from(radius) * scale;
        let camera = Camera::look_at(centre + DVec3::new(1.0, 2.0, 3.0) * radius, centre, DVec3::Y, 0.1).unwrap();
        let shape = AreaShape::Sphere { centre, radius };
        let in_its_place = Light::Area { shape, radiance: Vec3::splat(3.0) };
        for (lights, integrators) in [
            (scene.lights.clone(), &[Integrator::Path][..]),
            (vec![in_its_place], &[Integrator::RayCast, Integrator::Whitted, Integrator::Path]),
        ] {
            let scene = Scene { lights, ..scene.clone() };
            for &integrator in integrators {
                let settings = Settings { integrator: Some(integrator), ..settings(8, 8, 16) };
                for (engine, found) in means(&scene, &camera, &settings) {
                    assert!((found - 3.0).abs().max_element() < 1e-5, "{engine}, {integrator}, {centre}: {found}");
                }
            }
        }
    }
}

/// Howell's B-3: what a square metre above an element, from the place over it to (a, b), at distance 1, sends it, as a
/// share of all.
fn over_corner(a: f64, b: f64) -> f64 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / p * (b / p).atan() + b / q * (a / q).atan()) / std::f64::consts::TAU
}

/// A ball of flat facets with the normals of a round one: `rings` from pole to pole, of four thirds as many facets.
fn faceted_ball(rings: u32) -> Mesh {
    let meridians = rings * 4 / 3;
    let place = |ring: u32, meridian: u32| {
        let (down, around) = (PI * ring as f32 / rings as f32, TAU * meridian as f32 / meridians as f32);
        Vec3::new(down.sin() * around.cos(), down.cos(), down.sin() * around.sin())
    };
    let positions: Vec<Vec3> = (0..=rings).flat_map(|r| (0..meridians).map(move |m| place(r, m))).collect();
    let index = |ring: u32, meridian: u32| ring * meridians + meridian % meridians;
    let quads = (0..rings).flat_map(|r| (0..meridians).map(move |m| (r, m)));
    let triangles = quads.flat_map(|(r, m)| {
        let [a, b, c, d] = [index(r, m), index(r, m + 1), index(r + 1, m + 1), index(r + 1, m)];
        [[a, b, c], [a, c, d]]
    });
    Mesh { normals: positions.clone(), ..Mesh::new(positions, triangles.collect()) }
}

/// A room whose walls are all as bright: whatever is convex and matte in it shows its albedo, however its facets are
/// smoothed. Walls that are asked, and found by chance, are both near, so that a point that is another for one of the
/// two would be seen.
#[test]
fn the_two_ways_to_a_near_light_add_up_to_one_on_smooth_facets() {
    let walls = Geometry::Shapes {
        shapes: vec![Cuboid::new(Vec3::splat(-1.2), Vec3::splat(1.2)).unwrap().into()],
        material: 1,
    };
    let scene = Scene::from_geometries(vec![Geometry::Mesh(faceted_ball(6)), walls], vec![matte(0.8), glowing(1.0)]);
    let camera = Camera::look_at(DVec3::Z * 1.15, DVec3::ZERO, DVec3::Y, 70f64.to_radians()).unwrap();
    for (engine, mean) in means(&scene, &camera, &paths(16, 256)) {
        assert!((mean - Vec3::splat(0.8)).abs().max_element() < 2e-3, "{engine}: {mean}");
    }
}

/// Panels and a ball of light over a floor, each with what makes it visible.
#[test]
fn what_stands_in_a_lights_place_adds_nothing() {
    let panel = |x: f64| Light::Area {
        shape: AreaShape::Rectangle { centre: DVec3::new(x, 1.0, 0.0), half_edges: [DVec3::X * 0.5, DVec3::Z * 0.4] },
        radiance: Vec3::splat(3.0),
    };
    let corners = |x: f32| {
        [(-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4)].map(|(dx, z): (f32, f32)| Vec3::new(x + dx, 1.0, z))
    };
    let polygon = |x| Shape::from(twincast::Polygon::new(corners(x).to_vec()).unwrap());
    let half = twincast::Polygon::new(corners(0.5).map(|p| Vec3::new(p.x.min(0.5), p.y, p.z)).to_vec()).unwrap();
    let both = Geometry::Mesh(Mesh {
        material: 1,
        ..Mesh::new([corners(0.5), corners(-1.5)].concat(), vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    });
    let ground = Geometry::Shapes { shapes: vec![Plane::new(Vec3::ZERO, Vec3::Y).unwrap().into()], material: 0 };
    let shapes = |shapes: Vec<Shape>| Geometry::Shapes { shapes, material: 1 };
    // What the point (0.3, 0, 0.2) sees of each.
    let sum = |xs: [f64; 2], zs: [f64; 2]| {
        let over = |x: f64, z: f64| over_corner(x.abs(), z.abs()) * x.signum() * z.signum();
        over(xs[1], zs[1]) - over(xs[0], zs[1]) - over(xs[1], zs[0]) + over(xs[0], zs[0])
    };
    let (first, second) = (sum([-0.3, 0.7], [-0.6, 0.2]), sum([-2.3, -1.3], [-0.6, 0.2]));
    let centre = DVec3::new(0.3, 1.0, 0.2);
    let ball = Light::Area { shape: AreaShape::Sphere { centre, radius: 0.3 }, radiance: Vec3::splat(3.0) };
    let round = twincast::Ellipsoid::new(centre.as_vec3(), Mat3::from_diagonal(Vec3::splat(0.3))).unwrap();
    let camera = Camera::look_at(DVec3::new(0.3, 0.5, 0.2), DVec3::new(0.3, 0.0, 0.2), DVec3::Z, 0.01).unwrap();
    for (name, lights, body, expected) in [
        ("polygon", vec![panel(0.5)], shapes(vec![polygon(0.5)]), first),
        // It is asked for all that it gives, and what covers a half of it adds nothing.
        ("half a panel", vec![panel(0.5)], shapes(vec![half.into()]), first),
        ("two polygons", vec![panel(0.5), panel(-1.5)], shapes(vec![polygon(-1.5), polygon(0.5)]), first + second),
        ("two panels in a mesh", vec![panel(0.5), panel(-1.5)], both.clone(), first + second),
        ("a panel with a light, and one without", vec![panel(0.5)], both, first + second),
        ("ellipsoid", vec![ball], shapes(vec![round.into()]), 0.09),
    ] {
        let scene =
            Scene { lights, ..Scene::from_geometries(vec![ground.clone(), body], vec![matte(1.0), glowing(3.0)]) };
        for (engine, got) in means(&scene, &camera, &paths(16, 64)) {
            let error = (f64::from(got.x) / (3.0 * expected) - 1.0).abs();
            assert!(error < 0.02, "{name}, {engine}: {got} for {}", 3.0 * expected);
        }
    }
}

/// A light that cannot be seen is in no mirror, and as little in one that is nearly one.
#[test]
fn what_cannot_be_seen_is_not_mirrored() {
    let floor = |gloss| Material { reflection: Vec3::splat(0.5), gloss, ..matte(0.2) };
    let point = Light::Point {
        position: DVec3::new(1.0, 1.0, 0.0),
        color: Vec3::ONE,
        attenuation: twincast::scene::Attenuation::NONE,
        range: f64::INFINITY,
        radius: 0.0,
    };
    let camera = Camera::look_at(DVec3::new(-0.8, 0.8, 0.0), DVec3::ZERO, DVec3::Y, 0.01).unwrap();
    let whitted = |width, spp| Settings { integrator: Some(Integrator::Whitted), ..settings(width, width, spp) };
    for gloss in [None, Some(10.0), Some(10_000.0)] {
        let ground = Geometry::Shapes { shapes: vec![Plane::new(Vec3::ZERO, Vec3::Y).unwrap().into()], material: 0 };
        let scene = Scene { lights: vec![point.clone()], ..Scene::from_geometries(vec![ground], vec![floor(gloss)]) };
        // 0.2 of the light times the cosine of 45 degrees.
        for settings in [whitted(8, 4), paths(8, 64)] {
            for (engine, got) in means(&scene, &camera, &settings) {
                assert!((got.x - 0.2 / 2f32.sqrt()).abs() < 2e-3, "{gloss:?}, {engine}: {got}");
            }
        }
    }
    // With a lamp around it, it can be seen: half of it is mirrored, with the lobe's density where it is highest, pi 11
    // / (2 pi).
    let Light::Point { position, color, attenuation, range, .. } = point else { unreachable!() };
    let lamp = Light::Point { position, color, attenuation, range, radius: 0.1 };
    let ground = Geometry::Shapes { shapes: vec![Plane::new(Vec3::ZERO, Vec3::Y).unwrap().into()], material: 0 };
    let body = Geometry::Shapes { shapes: vec![sphere(position.as_vec3(), 0.1)], material: 1 };
    let scene = Scene {
        lights: vec![lamp],
        ..Scene::from_geometries(vec![ground, body], vec![floor(Some(10.0)), glowing(1.0)])
    };
    for (engine, got) in means(&scene, &camera, &paths(8, 64)) {
        assert!((got.x - 0.2 / 2f32.sqrt() - 0.5 * 5.5).abs() < 0.05, "{engine}: {got}");
    }
}

/// Inside a closed surface that gives off e and sends on a of what arrives, radiance is e / (1 - a) everywhere.
#[test]
fn a_furnace_glows_evenly() {
    let wall = Material { emission: Vec3::splat(0.5), ..matte(0.5) };
    let camera = Camera::look_at(DVec3::new(0.3, 0.2, 0.1), DVec3::X, DVec3::Y, 1.5).unwrap();
    let ball = scene(vec![(sphere(Vec3::ZERO, 2.0), wall.clone())]);
    let cuboid = twincast::Cuboid::new(Vec3::new(-1.0, -2.0, -3.0), Vec3::new(2.0, 1.0, 1.0)).unwrap();
    let boxed = scene(vec![(Shape::Cuboid(cuboid), wall.clone())]);
    // Points of an ellipsoid are not chosen: its light is found by chance alone.
    let axes = Mat3::from_diagonal(Vec3::new(2.0, 1.0, 3.0));
    let round = Shape::Ellipsoid(twincast::Ellipsoid::new(Vec3::ZERO, axes).unwrap());
    let by_chance = scene(vec![(round, wall)]);
    for (name, furnace) in [("ball", ball), ("box", boxed), ("ellipsoid", by_chance)] {
        for (engine, got) in means(&furnace, &camera, &paths(24, 64)) {
            assert!((got - 1.0).abs().max_element() < 0.005, "{name}, {engine}: {got}");
        }
    }
}

/// The share of even light that a highlight of exponent `n` sends to a viewer at so large a cosine to the normal, by
/// quadrature over the hemisphere: Phong's base is the mirrored light's cosine to the viewer, Blinn's that of the half
/// vector to the normal. `normalized`: with the factor that conserves energy (Lafortune, Willems 1994; Blinn-Phong
/// after Giesen 2009), and the cosine of the light.
fn highlight_share(model: Specular, n: f64, normalized: bool, to_viewer: f64) -> f64 {
    const RINGS: i32 = 100;
    let viewer = DVec3::new((1.0 - to_viewer * to_viewer).sqrt(), 0.0, to_viewer);
    let factor = match model {
        _ if !normalized => 1.0,
        Specular::Phong => (n + 2.0) / 2.0,
        Specular::BlinnPhong => (n + 2.0) * (n + 4.0) / (8.0 * ((-n / 2.0).exp2() + n)),
    };
    let at = |ring: i32, step: i32| {
        let z = (f64::from(ring) + 0.5) / f64::from(RINGS);
        let (sine, cosine) = ((f64::from(step) + 0.5) / f64::from(RINGS) * std::f64::consts::PI).sin_cos();
        let light = DVec3::new((1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z);
        let base = match model {
            Specular::Phong => DVec3::new(-light.x, -light.y, light.z).dot(viewer),
            Specular::BlinnPhong => (light + viewer).normalize().z,
        };
        base.max(0.0).powf(n) * if normalized { z } else { 1.0 }
    };
    // Half of the hemisphere is like the other: 2 pi of solid angle, and a pi that divides.
    let sum: f64 = (0..RINGS).flat_map(|ring| (0..RINGS).map(move |step| at(ring, step))).sum();
    2.0 * factor * sum / f64::from(RINGS * RINGS)
}

/// What surrounds everything with 1 shows 1 in whatever loses nothing, of highlights as much as their formula says, and
/// never more.
#[test]
fn a_white_world_shows_what_materials_lose() {
    let plain = |diffuse: f32, specular: f32, shininess: f32, model| Material {
        specular: Vec3::splat(specular),
        shininess,
        model,
        energy_conserving: true,
        ..matte(diffuse)
    };
    let mirror = Material { reflection: Vec3::ONE, ..black() };
    let pane = Material { interface: Interface::Thin, ..Material::glass(1.5) };
    // Their share of all light is known.
    let known = [
        ("mirror", mirror.clone()),
        ("glass", Material::glass(1.5)),
        ("bubble", Material::glass(0.75)),
        ("pane", pane),
        ("white", matte(1.0)),
        ("grey", matte(0.5)),
        ("varnished white", Material { diffuse: Vec3::ONE, transmission: Vec3::ZERO, ..Material::glass(1.5) }),
    ];
    // So is that of highlights.
    let shining = [
        ("phong 0", plain(0.5, 0.5, 0.0, Specular::Phong)),
        ("phong 3", plain(0.0, 1.0, 3.0, Specular::Phong)),
        ("phong 100", plain(0.2, 0.8, 100.0, Specular::Phong)),
        ("blinn 0", plain(0.5, 0.5, 0.0, Specular::BlinnPhong)),
        ("blinn 3", plain(0.0, 1.0, 3.0, Specular::BlinnPhong)),
        ("blinn 100", plain(0.2, 0.8, 100.0, Specular::BlinnPhong)),
        ("more than all", plain(1.0, 1.0, 10.0, Specular::Phong)),
        ("classic", Material { energy_conserving: false, ..plain(0.5, 0.5, 9.0, Specular::Phong) }),
    ];
    let others = [
        ("satin", Material { gloss: Some(5.0), ..mirror }),
        ("frosted", Material { gloss: Some(50.0), ..Material::glass(1.5) }),
    ];
    let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 2.0 * 0.19f64.asin()).unwrap();
    // Of the picture by the ball, whose outline is a circle that its corners are outside of: by strips.
    let (radius, half) = (0.2f32.asin().tan(), 0.19f32.asin().tan());
    let height = |i: u16| (radius * radius - (half * (f32::from(i) + 0.5) / 1000.0).powi(2)).max(0.0).sqrt().min(half);
    let covered = (0..1000).map(height).sum::<f32>() / (1000.0 * half);
    let white = Environment::new(Image { width: 8, height: 4, pixels: vec![Vec4::ONE; 32] });
    // Cosines at which the picture's rays, on a grid, meet the ball.
    let cosines: Vec<f64> = (0..40 * 40)
        .filter_map(|k| {
            let [x, y] = [k % 40, k / 40].map(|i| f64::from(half) * ((f64::from(i) + 0.5) / 20.0 - 1.0));
            let sine = 5.0 * ((x * x + y * y) / (1.0 + x * x + y * y)).sqrt();
            (sine < 1.0).then(|| (1.0 - sine * sine).sqrt())
        })
        .collect();
    let shown = |Material { diffuse, specular, shininess, model, energy_conserving, .. }: &Material| {
        let scale = if *energy_conserving { (diffuse.x + specular.x).max(1.0).recip() } else { 1.0 };
        let table: Vec<f64> = (0..=64)
            .map(|i| highlight_share(*model, f64::from(*shininess), *energy_conserving, f64::from(i) / 64.0))
            .collect();
        let share = |cosine: &f64| table[(cosine * 64.0).round() as usize];
        let highlight = cosines.iter().map(share).sum::<f64>() / cosines.len() as f64;
        let own = scale * (diffuse.x + specular.x * highlight as f32);
        1.0 - covered + covered * own
    };
    let shining = shining.map(|(name, material)| {
        let expected = shown(&material);
        (name, material, Some(expected))
    });
    let known =
        known.map(|(name, material)| (name, material, Some(if name == "grey" { 1.0 - 0.5 * covered } else { 1.0 })));
    let others = others.map(|(name, material)| (name, material, None));
    let are_known = known.len();
    for (i, (name, material, expected)) in known.into_iter().chain(shining).chain(others).enumerate() {
        let mut world = scene(vec![(sphere(Vec3::ZERO, 1.0), material)]);
        world.background = Some(Vec3::ONE);
        // What highlights send on is found by chance.
        let (spp, tolerance) = if i >= are_known { (256, 0.01) } else { (64, 0.005) };
        let constant = means(&world, &camera, &paths(16, spp));
        (world.background, world.environment) = (None, Some(white.clone()));
        let around = means(&world, &camera, &paths(16, spp));
        for (engine, got) in constant.into_iter().chain(around) {
            assert!(got.max_element() < 1.003, "{name}, {engine}: {got}");
            match expected {
                Some(expected) => {
                    assert!(
                        (got - expected).abs().max_element() < tolerance,
                        "{name}, {engine}: {got}, not {expected}"
                    );
                }
                None => assert!(got.min_element() > 0.3, "{name}, {engine}: {got}"),
            }
        }
    }
}

/// A ball of radiance L and radius r, d above a floor of reflectance a, shows a L (r / d)^2 below it (Howell, B-17):
/// the inverse square law, exact even close by.
#[test]
fn a_ball_of_light_has_its_form_factor() {
    let below = Camera::look_at(DVec3::new(4.0, 1.0, 0.0), DVec3::ZERO, DVec3::Y, 1e-3).unwrap();
    for (radius, height) in [(0.5f32, 1.0f32), (0.5, 2.0), (0.5, 4.0), (2.0, 4.0)] {
        let ball = sphere(Vec3::Y * height, radius);
        let mut lit = scene(vec![(ball, glowing(3.0))]);
        lit.geometries.push(floor(50.0, 1));
        lit.groups[0].geometries = 0..2;
        lit.materials.push(matte(0.5));
        let expected = 0.5 * 3.0 * (radius / height).powi(2);
        for (engine, got) in means(&lit, &below, &paths(1, 256)) {
            assert!((got.x / expected - 1.0).abs() < 0.01, "{engine}: {got} {expected}");
        }
    }
}

/// A ball of glass brings light from far away together at n R / (2 (n - 1)) from its middle. There, through a hole of
/// radius h, a source that fills its image shows T L sin^2 a, sin a = h / f; beside the image it is dark.
#[test]
fn a_ball_of_glass_has_its_focus() {
    let (n, hole, focus) = (1.5f32, 0.25f32, 1.5f32);
    let far = 1000.0;
    // 2 degrees to each side.
    let source = Disk::new(Vec3::Y * far, Vec3::NEG_Y, far * 2f32.to_radians().tan()).unwrap();
    let mut lens = scene(vec![
        (sphere(Vec3::ZERO, 1.0), Material::glass(n)),
        (Shape::Disk(source), glowing(100.0)),
        (Shape::Plane(Plane::new(Vec3::Y * -focus, Vec3::Y).unwrap()), matte(1.0)),
    ]);
    // A black board with a hole: a ring of triangles.
    let ring = |i: u32, r: f32| {
        let angle = i as f32 / 64.0 * std::f32::consts::TAU;
        Vec3::new(r * angle.cos(), 1.01, r * angle.sin())
    };
    let corners = (0..64).flat_map(|i| [ring(i, hole), ring(i, 20.0)]).collect();
    let quad = |i: u32| [[2 * i, 2 * i + 1, (2 * i + 3) % 128], [2 * i, (2 * i + 3) % 128, (2 * i + 2) % 128]];
    let board =
        twincast::scene::Mesh { material: 3, ..twincast::scene::Mesh::new(corners, (0..64).flat_map(quad).collect()) };
    lens.geometries.push(Geometry::Mesh(board));
    lens.groups[0].geometries = 0..4;
    lens.materials.push(black());
    let at = |x: f64| {
        let target = DVec3::new(x, -f64::from(focus), 0.0);
        let camera = Camera::look_at(target + DVec3::new(0.9, 0.4, 0.0), target, DVec3::Y, 1e-3).unwrap();
        means(&lens, &camera, &paths(8, 1024))
    };
    let through = (1.0 - ((n - 1.0) / (n + 1.0)).powi(2)).powi(2);
    let expected = 100.0 * through * (hole / focus).powi(2);
    for (engine, got) in at(0.0) {
        assert!((got.x / expected - 1.0).abs() < 0.06, "{engine}: {got} {expected}");
    }
    for (engine, got) in at(1.5 * f64::from(focus) * 2f64.to_radians().tan() + 0.03) {
        assert!(got.x < 0.02 * expected, "beside the image, {engine}: {got}");
    }
}

/// Scenes of which Whitted's recursion and the path tracer see the same.
fn both_see() -> Vec<(&'static str, Scene, Camera)> {
    let with_floor = |mut scene: Scene, material: Material| {
        let count = scene.geometries.len() as u32;
        scene.geometries.push(floor(20.0, count));
        scene.groups[0].geometries = 0..count + 1;
        scene.materials.push(material);
        scene
    };
    let aside = Camera::look_at(DVec3::new(3.0, 4.0, 6.0), DVec3::Y, DVec3::Y, 0.8).unwrap();
    let shiny = Material { specular: Vec3::splat(0.4), shininess: 20.0, ..matte(0.5) };
    // A light that has a body, which must not count twice, and one that has none.
    let ball = sphere(Vec3::new(0.0, 3.0, 0.0), 1.0);
    let mut lamps = with_floor(scene(vec![(ball, glowing(4.0))]), shiny.clone());
    let shape = AreaShape::Sphere { centre: DVec3::Y * 3.0, radius: 1.0 };
    let panel = AreaShape::Rectangle { centre: DVec3::new(-3.0, 2.0, 0.0), half_edges: [DVec3::Y, DVec3::Z * 0.5] };
    lamps.lights = vec![
        Light::Area { shape, radiance: Vec3::splat(4.0) },
        Light::Area { shape: panel, radiance: Vec3::new(5.0, 3.0, 1.0) },
    ];
    // Glossy ground that mirrors what glows, and lights nothing.
    let satin = Material { gloss: Some(30.0), reflection: Vec3::splat(0.8), ..black() };
    let glossy = with_floor(scene(vec![(sphere(Vec3::Y * 1.5, 1.0), glowing(2.0))]), satin);
    // A sky with a sun, and glass in the sun.
    let sky =
        |i: u32| if i == 16 * 9 + 20 { Vec4::splat(60.0) } else { Vec4::new(0.2, 0.3, 0.6, 1.0) * (i % 7) as f32 };
    let image = Image { width: 32, height: 16, pixels: (0..512).map(sky).collect() };
    let around = |material| {
        let mut scene = scene(vec![(sphere(Vec3::Y, 1.5), material)]);
        scene.environment = Some(Environment { rotation: 0.5, ..Environment::new(image.clone()) });
        scene
    };
    vec![
        ("lamps", lamps, aside.clone()),
        ("glossy", glossy, aside.clone()),
        ("sky on matte and shiny", around(shiny), aside.clone()),
        ("sky through glass", around(Material::glass(1.5)), aside),
    ]
}

#[test]
fn integrators_agree_where_they_see_the_same() {
    let runs = 12;
    for (name, scene, camera) in both_see() {
        let world = World::new(&scene).unwrap();
        let engine = &engines(&world)[1];
        let pictures = |integrator| -> Vec<Vec<Vec4>> {
            let one = |seed| {
                let integrator = Some(integrator);
                let settings = Settings { integrator, seed, light_samples: 4, ..settings(8, 8, 64) };
                render(&scene, &camera, &settings, engine).pixels
            };
            (0..runs).map(one).collect()
        };
        let statistics = |pictures: &[Vec<Vec4>], i: usize| {
            let values: Vec<f64> = pictures.iter().map(|picture| f64::from(picture[i].y)).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            (mean, squares / (values.len() * (values.len() - 1)) as f64)
        };
        let [whitted, path] = [Integrator::Whitted, Integrator::Path].map(pictures);
        // Over all pixels: the sum of differences is within three standard errors; no pixel is far beyond.
        let (mut difference, mut variance, mut bright) = (0.0, 0.0, 0.0);
        for i in 0..64 {
            let ((a, va), (b, vb)) = (statistics(&whitted, i), statistics(&path, i));
            difference += a - b;
            variance += va + vb;
            bright += a;
            assert!(
                (a - b).abs() <= 6.0 * (va + vb).sqrt() + 1e-3 * a + 5e-4,
                "{name}: pixel {i}: {a} {b} {}",
                (va + vb).sqrt()
            );
        }
        let error = variance.sqrt();
        assert!(difference.abs() < 3.0 * error + 1e-4 * bright, "{name}: {difference} of {bright}, error {error}");
        assert!(error < 0.01 * bright && bright > 1.0, "{name}: {error} of {bright} says something");
    }
}

/// A light round the corner: nothing but paths shows it.
#[test]
fn auto_traces_paths_where_nothing_else_shows_anything() {
    let ball = sphere(Vec3::Y * 3.0, 1.0);
    let mut lit = scene(vec![(ball, glowing(4.0))]);
    lit.geometries.push(floor(20.0, 1));
    lit.groups[0].geometries = 0..2;
    lit.materials.push(matte(0.5));
    let world = World::new(&lit).unwrap();
    let of = |integrator| {
        let settings = Settings { integrator, ..settings(16, 16, 16) };
        let camera = Camera::look_at(DVec3::new(6.0, 1.0, 0.0), DVec3::X * 2.0, DVec3::Y, 0.1).unwrap();
        let renderer = Renderer::new(&lit, &world, camera, settings).unwrap();
        let image = renderer.render(&*engines(&world)[1].tracer, Control::default()).unwrap();
        (renderer.plan().integrator, renderer.plan().to_string(), image)
    };
    let (integrator, why, image) = of(None);
    assert_eq!((integrator, &image), (Integrator::Path, &of(Some(Integrator::Path)).2));
    assert!(why.starts_with("path (only what glows, or is behind everything, lights the scene)"), "{why}");
    assert_eq!(of(Some(Integrator::Whitted)).2.pixels[0].truncate(), Vec3::ZERO);
    // So it is where nothing glows but what is behind everything.
    let mut under = scene(vec![(sphere(Vec3::ZERO, 1.0), matte(0.5))]);
    under.default_lighting = twincast::scene::DefaultLighting::None;
    let chosen = |scene: &Scene| {
        let world = World::new(scene).unwrap();
        let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 0.5).unwrap();
        let settings = Settings { integrator: None, ..settings(4, 4, 1) };
        Renderer::new(scene, &world, camera, settings).unwrap().plan().integrator
    };
    assert_eq!(chosen(&under), Integrator::RayCast);
    under.background = Some(Vec3::ONE);
    assert_eq!(chosen(&under), Integrator::Path);
}

/// What would be wrong without a word is refused.
#[test]
fn a_grid_of_samples_is_no_choice_for_paths() {
    let scene = scene(vec![(sphere(Vec3::ZERO, 1.0), glowing(1.0))]);
    let world = World::new(&scene).unwrap();
    let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 0.5).unwrap();
    let settings = Settings { sampling: twincast::render::Sampling::Grid, ..paths(4, 4) };
    let error = Renderer::new(&scene, &world, camera, settings).expect_err("refused");
    assert!(error.exit_code() == 2 && error.to_string().contains("grid"), "{error}");
}

/// Glass of another unit is as dark as before.
#[test]
fn absorption_is_scaled_with_the_scene() {
    let glass = Material {
        absorption: Some(twincast::scene::Absorption { color: Vec3::splat(0.5), distance: 2.0 }),
        ..Material::glass(1.5)
    };
    let mut scene = scene(vec![(sphere(Vec3::ZERO, 1.0), glass)]);
    scene.transform(&twincast::math::DAffine3::from_scale(DVec3::splat(0.25)));
    assert_eq!(scene.materials[0].absorption.map(|absorption| absorption.distance), Some(0.5));
}

/// Between mirrors that lose nothing no path shows more than there is, however often it was sent on: what Whitted's
/// rays see, to rounding.
#[test]
fn mirrors_that_lose_nothing_show_what_there_is() {
    let mirror = Material { reflection: Vec3::ONE, ..black() };
    // A room with a slit along the ceiling, through which light comes in that most rays find after many mirrors only.
    let wall =
        |min: [f32; 3], max: [f32; 3]| (Shape::Cuboid(Cuboid::new(min.into(), max.into()).unwrap()), mirror.clone());
    let mut scene = scene(vec![
        wall([-2.0, -2.0, -2.0], [-1.0, 2.0, 2.0]),
        wall([1.1, -2.0, -2.0], [2.0, 2.0, 2.0]),
        wall([-1.0, -2.0, -2.0], [1.1, -1.0, 2.0]),
        wall([-1.0, -1.0, -2.0], [1.1, 2.0, -1.2]),
        wall([-1.0, -1.0, 1.3], [1.1, 2.0, 2.0]),
        wall([-1.0, 1.0, -1.2], [0.9, 2.0, 1.3]),
    ]);
    scene.background = Some(Vec3::ONE);
    let camera = Camera::look_at(DVec3::new(0.1, -0.2, 0.3), DVec3::new(-0.9, 0.4, -0.5), DVec3::Y, 1.0).unwrap();
    let deep = Settings { max_depth: Some(200), ..paths(24, 4) };
    let world = World::new(&scene).unwrap();
    let native = &engines(&world)[0];
    let whitted = Settings { integrator: Some(Integrator::Whitted), ..deep.clone() };
    let [seen, expected] = [deep, whitted].map(|settings| render(&scene, &camera, &settings, native));
    let found = mean(&expected).x;
    assert!(found > 0.5 && found < 1.0, "{found}");
    let difference = seen.difference(&expected).unwrap();
    assert!(difference.max_abs < 1e-5, "{difference:?}");
}
