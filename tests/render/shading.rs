//! Pixels with a known value.

use twincast::image::Image;
use twincast::math::{Affine2, DVec3, Vec2, Vec3, Vec4};
use twincast::scene::{
    AreaShape, Attenuation, Camera, Filter, Geometry, Light, Material, Mesh, Specular, Texture, Wrap,
};
use twincast::{Disk, Renderer, Scene, Settings, Shape, Sphere, World};

use super::{engines, floor, from_above, matte, render, settings};

/// The single pixel of a picture of the floor's middle, taken from straight above, by every engine.
fn middle(scene: &Scene) -> Vec4 {
    let world = World::new(scene).unwrap();
    let pixels: Vec<_> =
        engines(&world).iter().map(|e| render(scene, &from_above(), &settings(1, 1, 1), e).pixels[0]).collect();
    assert!(pixels.windows(2).all(|pair| pair[0] == pair[1]), "engines differ: {pixels:?}");
    pixels[0]
}

fn floor_scene(material: Material, lights: Vec<Light>) -> Scene {
    Scene { lights, ..Scene::from_geometries(vec![floor(5.0, 0)], vec![material]) }
}

fn assert_close(got: Vec4, expected: Vec3, what: &str) {
    assert!((got - expected.extend(1.0)).abs().max_element() < 1e-5, "{what}: {got} against {expected}");
}

fn towards(degrees: f64) -> DVec3 {
    DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0)
}

#[test]
fn a_matte_floor_follows_lamberts_law() {
    for degrees in [0.0, 30.0, 60.0, 89.0] {
        let color = Vec3::new(1.0, 2.0, 3.0);
        let light = Light::Directional { direction: -towards(degrees), color };
        let expected = color * 0.5 * degrees.to_radians().cos() as f32;
        assert_close(middle(&floor_scene(matte(0.5), vec![light])), expected, "lit from above");
    }
    let below = Light::Directional { direction: DVec3::Y, color: Vec3::ONE };
    assert_close(middle(&floor_scene(matte(0.5), vec![below])), Vec3::ZERO, "lit from below");
}

#[test]
fn ambient_and_emission_need_no_light() {
    let material = Material {
        ambient: Vec3::new(0.5, 0.25, 1.0),
        emission: Vec3::new(0.0, 1.0, 2.0),
        diffuse: Vec3::ZERO,
        ..Material::default()
    };
    let mut scene = floor_scene(material, Vec::new());
    scene.ambient = Vec3::splat(0.5);
    assert_close(middle(&scene), Vec3::new(0.25, 1.125, 2.5), "ambient and emission");
}

#[test]
fn lights_add_up_and_weaken_with_distance() {
    let attenuation = Attenuation { constant: 1.0, linear: 0.25, quadratic: 0.125 };
    let point = |degrees| Light::Point {
        position: towards(degrees) * 4.0,
        color: Vec3::splat(2.0),
        attenuation,
        range: f64::INFINITY,
        radius: 0.0,
    };
    // 1 / (1 + 0.25 * 4 + 0.125 * 16) = 1/4.
    let one = 2.0 * 0.25 * 0.8;
    assert_close(middle(&floor_scene(matte(0.8), vec![point(0.0)])), Vec3::splat(one), "one light");
    let both = one * (1.0 + 60f32.to_radians().cos());
    assert_close(middle(&floor_scene(matte(0.8), vec![point(0.0), point(60.0)])), Vec3::splat(both), "two lights");
}

#[test]
fn a_scene_without_lights_has_a_headlight() {
    assert_close(middle(&floor_scene(matte(0.7), Vec::new())), Vec3::splat(0.7), "headlight");
}

#[test]
fn highlights_follow_their_model() {
    // Seen along the normal, lit at 40 degrees: 40 off the mirrored light, the half vector 20 off the normal.
    for (model, degrees) in [(Specular::Phong, 40f64), (Specular::BlinnPhong, 20.0)] {
        let material =
            Material { diffuse: Vec3::ZERO, specular: Vec3::splat(0.5), shininess: 8.0, model, ..Material::default() };
        let light = Light::Directional { direction: -towards(40.0), color: Vec3::splat(3.0) };
        let expected = 1.5 * degrees.to_radians().cos().powi(8) as f32;
        assert_close(middle(&floor_scene(material, vec![light])), Vec3::splat(expected), "highlight");
    }
}

/// A picture of the floor: rows of pixels whose middles are the middles of texels.
#[test]
fn textures_lie_the_right_way_up() {
    let codes: Vec<u8> = (0..16).map(|i| i * 16 + 8).collect();
    let texture = Texture {
        width: 4,
        height: 4,
        pixels: codes.iter().map(|&c| [c, 255 - c, 0, 255]).collect::<Vec<_>>().into(),
        wrap_u: Wrap::Clamp,
        filter: Filter::Linear,
        ..Texture::default()
    };
    let material = Material { diffuse_texture: Some(0), ..matte(1.0) };
    let sun = Light::Directional { direction: DVec3::NEG_Y, color: Vec3::ONE };
    let scene = Scene {
        textures: vec![texture],
        lights: vec![sun],
        ..Scene::from_geometries(vec![floor(1.0, 0)], vec![material])
    };
    let linear = |code: u8| ((f32::from(code) / 255.0 + 0.055) / 1.055).powf(2.4);
    let world = World::new(&scene).unwrap();
    for engine in engines(&world) {
        let image = render(&scene, &from_above(), &settings(4, 4, 1), &engine);
        for (i, pixel) in image.pixels.iter().enumerate() {
            // Below 0.04045 the curve is a line.
            let expected = if codes[i] > 10 { linear(codes[i]) } else { f32::from(codes[i]) / 255.0 / 12.92 };
            assert!((pixel.x - expected).abs() < 1e-4, "{}: texel {i}: {pixel} against {expected}", engine.name);
        }
    }
}

/// One colour all over: the normal leans by as much, towards +x where u grows, and towards -z where v does.
#[test]
fn normal_maps_lean_along_u_and_v() {
    // (0.8, 0, 0.6) and (0, -0.6, 0.8), as codes: x = 2 code / 255 - 1.
    let code = |x: f64| ((x + 1.0) * 127.5).round() as u8;
    let [plain, mirrored_mesh, mirrored_texture, second] = [0, 1, 2, 3];
    let red = [0.8, 0.0, 0.6];
    for (texel, case) in
        [(red, plain), ([0.0, -0.6, 0.8], plain), (red, mirrored_mesh), (red, mirrored_texture), (red, second)]
    {
        let mirrored = case == mirrored_mesh || case == mirrored_texture;
        let texture = Texture {
            width: 1,
            height: 1,
            pixels: vec![[code(texel[0]), code(texel[1]), code(texel[2]), 255]].into(),
            transform: Affine2::from_scale(Vec2::new(if case == mirrored_texture { -1.0 } else { 1.0 }, 1.0)),
            on_second_uvs: case == second,
            ..Texture::default()
        };
        let material = Material { normal_texture: Some(0), ..matte(1.0) };
        let mut scene = floor_scene(material, vec![Light::Directional { direction: -towards(30.0), color: Vec3::ONE }]);
        scene.textures = vec![texture];
        let Geometry::Mesh(mesh) = &mut scene.geometries[0] else { unreachable!() };
        if case == mirrored_mesh {
            // u grows along -x.
            mesh.uvs.iter_mut().for_each(|uv| uv.x = 1.0 - uv.x);
        }
        if case == second {
            // The first set would turn the bump around.
            mesh.second_uvs = mesh.uvs.clone();
            mesh.uvs.iter_mut().for_each(|uv| uv.x = 1.0 - uv.x);
        }
        let decoded = texel.map(|x| f64::from(code(x)) / 127.5 - 1.0);
        let across = if mirrored { -decoded[0] } else { decoded[0] };
        let normal = DVec3::new(across, decoded[2], -decoded[1]).normalize();
        let expected = normal.dot(towards(30.0)).max(0.0) as f32;
        assert_close(middle(&scene), Vec3::splat(expected), "bent");
    }
}

/// A ball of radius 1 above the floor, lit from straight above: the shadow is a disc of radius 1, to the last pixel.
#[test]
fn a_ball_casts_a_round_shadow() {
    let ball = Shape::Sphere(Sphere { centre: Vec3::new(0.0, 3.0, 0.0), radius: 1.0 });
    let shapes = Geometry::Shapes { shapes: vec![ball.clone()], material: 0 };
    let sun = Light::Directional { direction: DVec3::NEG_Y, color: Vec3::ONE };
    let scene = Scene { lights: vec![sun], ..Scene::from_geometries(vec![floor(5.0, 0), shapes], vec![matte(0.5)]) };
    let camera = Camera::look_at(DVec3::new(0.0, 2.0, 9.0), DVec3::ZERO, DVec3::Y, 0.5).unwrap();
    let world = World::new(&scene).unwrap();
    let renderer = Renderer::new(&scene, &world, camera.clone(), settings(80, 60, 1)).unwrap();
    for engine in engines(&world) {
        let image: Image = render(&scene, &camera, &settings(80, 60, 1), &engine);
        let (mut dark, mut bright) = (0, 0);
        for (i, pixel) in image.pixels.iter().enumerate() {
            let ray = renderer.camera_ray(i as u32 % 80, i as u32 / 80, 0);
            let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let at = o - d * (o.y / d.y);
            let on_floor = d.y < 0.0 && at.x.abs() < 5.0 && at.z.abs() < 5.0 && ball.intersect(&ray).is_none();
            let radius = at.x.hypot(at.z);
            if !on_floor || (radius - 1.0).abs() < 1e-4 {
                continue;
            }
            let shadow = radius < 1.0;
            let expected = Vec3::splat(if shadow { 0.0 } else { 0.5 }).extend(1.0);
            assert_eq!(*pixel, expected, "{}: pixel {i} at {at}", engine.name);
            if shadow { dark += 1 } else { bright += 1 }
        }
        assert!(dark > 100 && bright > 1000, "{dark} {bright}");
    }
}

/// A closed surface under a light of its own: no pixel that faces the light may be in its own shadow.
#[test]
fn surfaces_do_not_shadow_themselves() {
    for (size, place) in [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 3000.0)] {
        let ball = Shape::Sphere(Sphere { centre: Vec3::new(place, 0.0, 0.0), radius: size });
        let light = Light::Directional { direction: DVec3::new(-1.0, -1.0, -1.0).normalize(), color: Vec3::ONE };
        let geometries = vec![Geometry::Shapes { shapes: vec![ball.clone()], material: 0 }];
        let scene = Scene { lights: vec![light], ..Scene::from_geometries(geometries, vec![matte(1.0)]) };
        let (s, centre) = (f64::from(size), DVec3::X * f64::from(place));
        let camera = Camera::look_at(centre + DVec3::new(2.0, 1.0, 3.0) * s, centre, DVec3::Y, 0.6).unwrap();
        let world = World::new(&scene).unwrap();
        let renderer = Renderer::new(&scene, &world, camera.clone(), settings(50, 50, 1)).unwrap();
        for engine in engines(&world) {
            let image = render(&scene, &camera, &settings(50, 50, 1), &engine);
            let mut lit = 0;
            for (i, pixel) in image.pixels.iter().enumerate() {
                let ray = renderer.camera_ray(i as u32 % 50, i as u32 / 50, 0);
                let Some(hit) = ball.translated(-world.centre).intersect(&ray) else { continue };
                let on_ball = ray.origin.as_dvec3() + ray.direction.as_dvec3() * hit.t + world.centre;
                let cosine = ((on_ball - centre) / s).dot(DVec3::ONE.normalize());
                if cosine > 1e-3 {
                    assert!((f64::from(pixel.x) - cosine).abs() < 1e-3, "{}: {pixel} {cosine}", engine.name);
                    lit += 1;
                }
            }
            assert!(lit > 500, "{lit}");
        }
    }
}

#[test]
fn alpha_is_coverage_and_a_background_is_opaque() {
    let mut scene = floor_scene(matte(1.0), Vec::new());
    scene.geometries = vec![floor(0.5, 0)];
    let world = World::new(&scene).unwrap();
    for engine in engines(&world) {
        // The floor covers the middle quarter: with 2 x 2 pixels a quarter of each.
        let image = render(&scene, &from_above(), &settings(2, 2, 16), &engine);
        for pixel in &image.pixels {
            assert_eq!(pixel.w, 0.25, "{}", engine.name);
            assert!(pixel.x > 0.24 && pixel.x <= 0.25, "premultiplied: {pixel}");
        }
        let red = twincast::Settings { background: Some(Vec3::X), ..settings(2, 2, 16) };
        let image = render(&scene, &from_above(), &red, &engine);
        assert!(image.pixels.iter().all(|p| p.w == 1.0 && p.x > 0.99 && p.y <= 0.25), "{:?}", image.pixels);
    }
}

/// Under a bright ceiling panel: what a fan of shadow rays finds free is the share of the panel that is seen.
#[test]
fn soft_shadows_have_the_width_of_similar_triangles() {
    // A panel 2 wide at height 8 (x along the width), a wide board at height 4 whose edge is at x = 0: on the floor the
    // edge of the shadow runs from x = -1, where the whole panel is seen, to x = 1, where none is.
    let panel = Light::Area {
        shape: AreaShape::Rectangle { centre: DVec3::Y * 8.0, half_edges: [DVec3::X, DVec3::Z] },
        radiance: Vec3::splat(50.0),
    };
    let board = |x: f32, z: f32| Vec3::new(x, 4.0, z);
    let corners = vec![board(0.0, 50.0), board(50.0, 50.0), board(50.0, -50.0), board(0.0, -50.0)];
    let board = Geometry::Mesh(Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]));
    let open = Scene { lights: vec![panel], ..Scene::from_geometries(vec![floor(50.0, 0)], vec![matte(1.0)]) };
    let shaded =
        Scene { lights: open.lights.clone(), ..Scene::from_geometries(vec![floor(50.0, 0), board], vec![matte(1.0)]) };
    let settings = Settings { light_samples: 256, ..settings(1, 1, 1) };
    let seen = |scene: &Scene, x: f64| {
        let world = World::new(scene).unwrap();
        // From beside the board, below it.
        let camera = Camera::look_at(DVec3::new(-20.0, 2.0, 0.0), DVec3::X * x, DVec3::Y, 1e-3).unwrap();
        let pixels: Vec<_> = engines(&world).iter().map(|e| render(scene, &camera, &settings, e).pixels[0].x).collect();
        assert!(pixels.windows(2).all(|pair| pair[0] == pair[1]), "engines differ: {pixels:?}");
        f64::from(pixels[0])
    };
    for (x, share) in [(-1.2, 1.0), (-1.02, 1.0), (-0.5, 0.75), (0.0, 0.5), (0.5, 0.25), (1.02, 0.0)] {
        let got = seen(&shaded, x) / seen(&open, x);
        assert!((got - share).abs() < 0.02, "{x}: {got} of the light, not {share}");
    }
}

/// A glowing quad where the light is must not be in its light's way, nor may a glowing ball.
#[test]
fn lights_that_can_be_seen_do_not_shade_themselves() {
    let place = DVec3::new(37.0, 53.0, 11.0);
    let glow = Material { emission: Vec3::ONE, diffuse: Vec3::ZERO, ..Material::default() };
    let ball = Shape::Sphere(Sphere { centre: place.as_vec3(), radius: 6.0 });
    let away = place.normalize();
    let disk = Shape::Disk(Disk::new(place.as_vec3(), -away.as_vec3(), 6.0).unwrap());
    for (shape, light) in [
        (ball, AreaShape::Sphere { centre: place, radius: 6.0 }),
        (disk, AreaShape::Disk { centre: place, normal: -away, radius: 6.0 }),
    ] {
        let light = Light::Area { shape: light, radiance: Vec3::ONE };
        let bare =
            Scene { lights: vec![light.clone()], ..Scene::from_geometries(vec![floor(5.0, 0)], vec![matte(1.0)]) };
        let shapes = Geometry::Shapes { shapes: vec![shape], material: 1 };
        let lamp = Scene {
            lights: vec![light],
            ..Scene::from_geometries(vec![floor(5.0, 0), shapes], vec![matte(1.0), glow.clone()])
        };
        for seed in 0..20 {
            let settings = Settings { light_samples: 16, seed, ..settings(1, 1, 1) };
            let [with, without] = [&lamp, &bare].map(|scene| {
                let world = World::new(scene).unwrap();
                engines(&world)
                    .iter()
                    .map(|e| render(scene, &from_above(), &settings, e).pixels[0].x)
                    .collect::<Vec<_>>()
            });
            assert!(with[0] > 0.0 && with == without, "{with:?} {without:?}");
        }
    }
}
