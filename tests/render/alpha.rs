//! Surfaces that are not all there: seen through, and in shadows.

use twincast::math::{DVec3, Vec3, Vec4};
use twincast::scene::{Alpha, Filter, Geometry, Integrator, Light, Material, Mesh, Texture, Wrap};
use twincast::{Disk, Scene, Settings, Shape, World};

use super::{engines, floor, from_above, matte, render, settings};

fn flat(color: Vec3) -> Material {
    Material { unlit: true, diffuse: color, ..Material::default() }
}

/// A floor, and sheets above it at rising heights.
fn sheets(ground: Material, materials: Vec<Material>) -> Scene {
    let disk = |y: f32| Shape::Disk(Disk::new(Vec3::Y * y, Vec3::Y, 4.0).unwrap());
    let sheet = |i: u32| Geometry::Shapes { shapes: vec![disk(i as f32)], material: i };
    let count = materials.len() as u32;
    let geometries = std::iter::once(floor(50.0, 0)).chain((1..=count).map(sheet)).collect();
    Scene::from_geometries(geometries, std::iter::once(ground).chain(materials).collect())
}

fn pixel(scene: &Scene, settings: &Settings) -> Vec4 {
    let world = World::new(scene).unwrap();
    let pixels: Vec<_> = engines(&world).iter().map(|e| render(scene, &from_above(), settings, e).pixels[0]).collect();
    assert!(pixels.windows(2).all(|pair| pair[0] == pair[1]), "engines differ: {pixels:?}");
    pixels[0]
}

#[test]
fn sheets_are_met_as_often_as_they_cover() {
    let sheet = |opacity, color| Material { alpha: Alpha::Blend, opacity, ..flat(color) };
    let scene = sheets(flat(Vec3::Z), vec![sheet(0.5, Vec3::Y), sheet(0.25, Vec3::X)]);
    for integrator in Integrator::ALL {
        let got = pixel(&scene, &Settings { integrator: Some(integrator), ..settings(1, 1, 4096) });
        // The upper first: a quarter, half of the rest, the rest.
        let expected = Vec4::new(0.25, 0.375, 0.375, 1.0);
        assert!((got - expected).abs().max_element() < 0.01, "{integrator}: {got}");
    }
    // Opaque surfaces have no use for their alpha.
    let opaque = sheets(flat(Vec3::Z), vec![Material { opacity: 0.0, ..flat(Vec3::X) }]);
    assert_eq!(pixel(&opaque, &settings(1, 1, 4)), Vec4::new(1.0, 0.0, 0.0, 1.0));
    let nothing = sheets(flat(Vec3::Z), vec![sheet(0.0, Vec3::X)]);
    assert_eq!(pixel(&nothing, &settings(1, 1, 4)), Vec4::new(0.0, 0.0, 1.0, 1.0));
}

#[test]
fn shadows_lose_what_is_covered() {
    let sheet = |opacity| Material { alpha: Alpha::Blend, opacity, ..matte(0.0) };
    let mut scene = sheets(matte(0.5), vec![sheet(0.5), sheet(0.25)]);
    scene.lights = vec![Light::Directional { direction: DVec3::NEG_Y, color: Vec3::splat(2.0) }];
    // Seen from beside the sheets.
    scene.cameras =
        vec![twincast::scene::Camera::look_at(DVec3::new(9.0, 0.5, 0.0), DVec3::ZERO, DVec3::Y, 0.01).unwrap()];
    let world = World::new(&scene).unwrap();
    for integrator in Integrator::ALL {
        let settings = Settings { integrator: Some(integrator), max_depth: Some(0), ..settings(1, 1, 1) };
        for engine in engines(&world) {
            let got = render(&scene, &scene.cameras[0], &settings, &engine).pixels[0];
            assert_eq!(got, Vec4::new(0.375, 0.375, 0.375, 1.0), "{}: 0.5 of 0.75 of 1", engine.name);
        }
    }
}

/// A picture whose left half is there, over a square: masked, it is seen and casts a shadow there alone.
#[test]
fn masks_cut_out_and_so_do_their_shadows() {
    let texture = Texture {
        width: 2,
        height: 1,
        pixels: vec![[255u8, 255, 255, 200], [255, 255, 255, 100]].into(),
        wrap_u: Wrap::Clamp,
        filter: Filter::Nearest,
        ..Texture::default()
    };
    let masked = |cutoff| Material { diffuse_texture: Some(0), alpha: Alpha::Mask { cutoff }, ..matte(1.0) };
    let square = |cutoff| {
        let Geometry::Mesh(leaf) = floor(1.0, 0) else { unreachable!() };
        let corners = leaf.positions.iter().map(|p| *p + Vec3::Y * 2.0).collect();
        let leaf = Mesh { uvs: leaf.uvs, ..Mesh::new(corners, leaf.triangles.to_vec()) };
        let mut scene =
            Scene::from_geometries(vec![Geometry::Mesh(leaf), floor(50.0, 1)], vec![masked(cutoff), matte(0.5)]);
        scene.textures = vec![texture.clone()];
        scene.lights = vec![Light::Directional { direction: DVec3::new(0.0, -1.0, 0.0), color: Vec3::ONE }];
        scene
    };
    // Alphas of 0.78 and 0.39.
    for (cutoff, seen) in [(0.5, [1.0, 0.5]), (0.3, [1.0, 1.0]), (0.9, [0.5, 0.5])] {
        let scene = square(cutoff);
        let world = World::new(&scene).unwrap();
        for engine in engines(&world) {
            let image = render(&scene, &from_above(), &settings(2, 1, 1), &engine);
            assert_eq!([image.pixels[0].x, image.pixels[1].x], seen, "{}: {cutoff}", engine.name);
            // Below the square, from the side.
            for (x, part) in [(-0.5, 0), (0.5, 1)] {
                let eye = DVec3::new(x, 0.5, 9.0);
                let camera = twincast::scene::Camera::look_at(eye, DVec3::X * x, DVec3::Y, 0.01).unwrap();
                let shadow = render(&scene, &camera, &settings(1, 1, 1), &engine).pixels[0].x;
                assert_eq!(shadow, if seen[part] == 1.0 { 0.0 } else { 0.5 }, "{}: {cutoff} at {x}", engine.name);
            }
        }
    }
}
