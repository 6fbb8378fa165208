//! What a render tells of each pixel beside its colour: against rays that are cast by hand, against sums and closed
//! forms.

use std::collections::BTreeMap;

use twincast::image::{self, Channels, Metadata, Plane, WriteOptions};
use twincast::math::{DAffine3, DVec3, Vec3, Vec4};
use twincast::render::{Aov, Control, Crop, Filter, Picture};
use twincast::scene::{
    Alpha, Camera, Environment, Fog, Geometry, Integrator, Light, Material, MetallicRoughness, Physical,
    PhysicalTextures, Pixels, Projection, Specular, Texels, Texture, Workflow,
};
use twincast::{Image, Renderer, Scene, Settings, Sphere, World};

use super::determinism::{bits, busier_scene};
use super::{engines, floor, from_above, matte, settings};

fn aovs(names: &str) -> Vec<Aov> {
    names.split(',').map(|name| name.parse().expect("an AOV")).collect()
}

fn picture(scene: &Scene, camera: &Camera, settings: &Settings) -> Picture {
    let world = World::new(scene).unwrap();
    let renderer = Renderer::new(scene, &world, camera.clone(), settings.clone()).unwrap();
    let engines = engines(&world);
    let native = engines.iter().find(|engine| engine.name == "native").unwrap();
    renderer.picture(&*native.tracer, Control::default(), None).unwrap()
}

/// The channels of a picture, by way of a file.
fn through_a_file(picture: &Picture) -> (Channels, Metadata) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let metadata = Metadata { texts: picture.texts.clone(), ..Metadata::default() };
    image::write_channels(&path, &picture.image, &picture.channels, &metadata, &WriteOptions::default()).unwrap();
    (image::read_channels(&path).unwrap(), image::read_metadata(&path).unwrap())
}

/// A layer of three channels, from the picture itself.
fn layer(picture: &Picture, name: &str, components: [&str; 3]) -> Vec<Vec3> {
    let plane = |component: &str| {
        let name = format!("{name}.{component}");
        let channel = picture.channels.iter().find(|channel| channel.name == name);
        match &channel.unwrap_or_else(|| panic!("no {name}")).plane {
            Plane::Float(values) => values.clone(),
            Plane::Uint(_) => panic!("{name} is no float"),
        }
    };
    let [x, y, z] = components.map(plane);
    x.into_iter().zip(y).zip(z).map(|((x, y), z)| Vec3::new(x, y, z)).collect()
}

fn light(picture: &Picture, name: &str) -> Vec<Vec3> {
    layer(picture, name, ["R", "G", "B"])
}

fn mean(values: &[Vec3]) -> Vec3 {
    values.iter().sum::<Vec3>() / values.len() as f32
}

#[test]
fn geometry_is_that_of_rays_cast_by_hand() {
    let mut scene = busier_scene();
    scene.transform(&twincast::math::DAffine3::from_translation(DVec3::new(100.0, -20.0, 7.0)));
    let world = World::new(&scene).unwrap();
    let wanted = aovs("depth,position,uv,primitive,geometry,instance,samples");
    let settings = Settings { aovs: wanted, ..settings(60, 40, 2) };
    let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings.clone()).unwrap();
    let (channels, _) = through_a_file(&picture(&scene, &scene.cameras[0], &settings));
    let ids = ["primitive", "geometry", "instance"].map(|name| channels.uints(name).unwrap());
    let depth = channels.floats("depth.Z").unwrap();
    let position = ["X", "Y", "Z"].map(|axis| channels.floats(&format!("position.{axis}")).unwrap());
    assert!(channels.uints("samples").unwrap().iter().all(|&n| n == 2));
    let brute = &engines(&world).pop().unwrap().tracer;
    let mut hits = 0;
    for (x, y) in (0..40).flat_map(|y| (0..60).map(move |x| (x, y))) {
        let at = (y * 60 + x) as usize;
        let ray = renderer.middle_ray(x, y);
        let found = ids.map(|plane| plane[at]);
        let Some(hit) = brute.closest(&ray) else {
            assert_eq!((found, depth[at]), ([u32::MAX; 3], f32::INFINITY), "{x},{y}");
            continue;
        };
        hits += 1;
        assert_eq!(found, [hit.primitive, hit.geometry, hit.instance], "{x},{y}");
        let distance = hit.t * ray.direction.length();
        assert!((depth[at] / distance - 1.0).abs() < 1e-5, "{x},{y}: {} against {distance}", depth[at]);
        let place = ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(hit.t) + world.centre;
        let told = DVec3::from_array(position.map(|plane| f64::from(plane[at])));
        assert!((told - place).length() < 1e-4 * f64::from(distance), "{x},{y}: {told} against {place}");
    }
    assert!((400..2390).contains(&hits), "{hits}: some hit and some do not");
    // Where a ray through the middle of a pixel's first sample goes is where the only sample of a render with one goes.
    let single = Settings { spp: 1, ..settings };
    let single = Renderer::new(&scene, &world, scene.cameras[0].clone(), single).unwrap();
    assert_eq!(single.camera_ray(7, 9, 0).direction, renderer.middle_ray(7, 9).direction);
}

#[test]
fn a_part_of_a_picture_has_that_part_of_the_channels() {
    let scene = busier_scene();
    let names = "depth,position,normal,uv,primitive,instance,albedo,samples,crypto-object,direct,indirect";
    let whole = Settings { aovs: aovs(names), ..settings(90, 70, 2) };
    let window = Crop { x: 31, y: 17, width: 40, height: 23 };
    let part = Settings { crop: Some(window), ..whole.clone() };
    let [whole, part] = [whole, part].map(|settings| picture(&scene, &scene.cameras[0], &settings));
    assert!(!part.channels.is_empty());
    for (own, all) in part.channels.iter().zip(&whole.channels) {
        assert_eq!(own.name, all.name);
        let bits = |plane: &Plane, at: usize| match plane {
            Plane::Float(values) => values[at].to_bits(),
            Plane::Uint(values) => values[at],
        };
        for (y, x) in (0..window.height).flat_map(|y| (0..window.width).map(move |x| (y, x))) {
            let (at, in_all) = (y * window.width + x, (window.y + y) * 90 + window.x + x);
            assert_eq!(bits(&own.plane, at as usize), bits(&all.plane, in_all as usize), "{} at {x},{y}", own.name);
        }
    }
    assert_eq!(part.channels.len(), whole.channels.len());
}

#[test]
fn uv_normals_and_albedo_of_a_floor() {
    // Of a classic highlight 2 / (n + 1) is sent on.
    let material = Material { specular: Vec3::splat(0.2), model: Specular::Phong, shininess: 9.0, ..matte(0.3) };
    let scene = Scene::from_geometries(vec![floor(0.5, 0)], vec![material]);
    let settings = Settings { aovs: aovs("uv,normal,albedo"), ..settings(64, 64, 4) };
    let picture = picture(&scene, &from_above(), &settings);
    let (channels, _) = through_a_file(&picture);
    let [u, v] = ["uv.U", "uv.V"].map(|name| channels.floats(name).unwrap());
    let (normals, albedo) = (layer(&picture, "normal", ["X", "Y", "Z"]), light(&picture, "albedo"));
    for (x, y) in [(16, 16), (40, 20), (47, 47), (3, 30), (32, 60)] {
        let at = y * 64 + x;
        // The picture is 2 wide at the floor, which covers half of it.
        let middle = |k: usize| (k as f32 + 0.5) / 32.0 - 1.0;
        let inside = middle(x).abs() < 0.5 && middle(y).abs() < 0.5;
        let expected = if inside { [middle(x) + 0.5, 0.5 - middle(y)] } else { [0.0; 2] };
        assert!(
            (u[at] - expected[0]).abs() < 1e-4 && (v[at] - expected[1]).abs() < 1e-4,
            "{x},{y}: {} {}",
            u[at],
            v[at]
        );
        assert!((normals[at] - if inside { Vec3::Y } else { Vec3::ZERO }).length() < 1e-6);
        assert!((albedo[at] - if inside { Vec3::splat(0.34) } else { Vec3::ZERO }).length() < 1e-6);
    }
}

/// Where textures say what a surface is, its albedo is that of what it is there.
#[test]
fn albedo_is_as_varied_as_textures() {
    let values = MetallicRoughness { base: Vec3::new(0.8, 0.2, 0.1), roughness: 0.5, ..MetallicRoughness::default() };
    let textures = PhysicalTextures { metallic_roughness: Some(0), ..PhysicalTextures::default() };
    let physical = Physical { workflow: Workflow::MetallicRoughness(values), textures };
    let constant =
        |metalness| Material { ambient: Vec3::ZERO, ..physical.phong(&Texels { metalness, ..Texels::default() }) };
    let texture = Texture {
        width: 2,
        height: 1,
        pixels: Pixels::from(vec![[255_u8, 255, 0, 255], [255, 255, 255, 255]]),
        filter: twincast::scene::Filter::Nearest,
        ..Texture::default()
    };
    let varied = Material { physical: Some(physical), ..constant(0.5) };
    let albedo = |material: Material| {
        let scene =
            Scene { textures: vec![texture.clone()], ..Scene::from_geometries(vec![floor(0.5, 0)], vec![material]) };
        let settings = Settings { aovs: aovs("albedo"), ..settings(8, 8, 1) };
        light(&picture(&scene, &from_above(), &settings), "albedo")
    };
    let (got, [plastic, metal]) = (albedo(varied), [0.0, 1.0].map(|metalness| albedo(constant(metalness))));
    let [left, right] = [3 * 8 + 2, 3 * 8 + 5];
    assert!((plastic[left] - metal[left]).length() > 0.02);
    assert_eq!((got[left], got[right]), (plastic[left], metal[right]));
}

/// A ball that comes four metres nearer is half-way there, whichever kind of camera looks.
#[test]
fn geometry_of_what_moves_is_that_of_the_middle_of_the_shutter() {
    let ball = Sphere { centre: Vec3::ZERO, radius: 0.5 }.into();
    let mut scene =
        Scene::from_geometries(vec![Geometry::Shapes { shapes: vec![ball], material: 0 }], vec![matte(0.5)]);
    scene.instances[0].transform_end = Some(DAffine3::from_translation(DVec3::Z * 4.0));
    let still = Camera::look_at(DVec3::Z * 10.0, DVec3::ZERO, DVec3::Y, 0.02).unwrap();
    let parallel = Camera { projection: Projection::Orthographic(0.02), ..still.clone() };
    for (shutter, expected) in [([0.0, 1.0], 7.5), ([0.5, 1.0], 6.5)] {
        for camera in [&still, &parallel] {
            let camera = Camera { shutter, ..camera.clone() };
            let settings = Settings { aovs: aovs("depth"), ..settings(1, 1, 16) };
            let (channels, _) = through_a_file(&picture(&scene, &camera, &settings));
            let depth = channels.floats("depth.Z").unwrap()[0];
            assert!((depth - expected).abs() < 1e-3, "{depth} for {expected}: {camera:?}");
        }
    }
}

#[test]
fn light_by_its_paths_sums_up_to_the_picture() {
    let mut scene = busier_scene();
    scene.ambient = Vec3::new(0.1, 0.05, 0.2);
    scene.materials[1].alpha = Alpha::Blend;
    scene.materials[1].opacity = 0.7;
    scene.fog = Some(Fog { absorption: Vec3::splat(0.05), color: Vec3::new(0.2, 0.3, 0.4), reach: 3.0 });
    let partitions =
        [&["emission", "direct", "indirect"][..], &["emission", "diffuse", "specular", "transmission"], &["all"]];
    let names = "emission,direct,indirect,diffuse,specular,transmission,all=L.*E";
    for integrator in Integrator::ALL {
        for filter in [Filter::Box, Filter::Mitchell] {
            let integrator = Some(integrator);
            let plain = Settings { integrator, filter, light_samples: 2, ..settings(50, 40, 3) };
            let asked = Settings { aovs: aovs(names), ..plain.clone() };
            let camera = &scene.cameras[0];
            let (plain, asked) = (picture(&scene, camera, &plain), picture(&scene, camera, &asked));
            assert_eq!(bits(&plain.image.pixels), bits(&asked.image.pixels), "{integrator:?} {filter}");
            let brightest = asked.image.pixels.iter().map(|pixel| pixel.truncate().max_element()).fold(0.0, f32::max);
            for names in partitions {
                let parts: Vec<_> = names.iter().map(|name| light(&asked, name)).collect();
                for (i, pixel) in asked.image.pixels.iter().enumerate() {
                    let sum: Vec3 = parts.iter().map(|part| part[i]).sum();
                    // Weights of both signs cancel: what is rounded is as large as the brightest sample near by.
                    let own: f32 = parts.iter().map(|part| part[i].abs().max_element()).sum::<f32>() + 0.01;
                    let size = if filter == Filter::Mitchell { own.max(brightest) } else { own };
                    let off = (sum - pixel.truncate()).abs().max_element() / size;
                    assert!(off < 3e-6, "{integrator:?} {filter} {names:?} pixel {i}: {sum} {pixel}");
                }
            }
            for name in names.split(',').map(|name| name.trim_end_matches("=L.*E")) {
                let is_black = mean(&light(&asked, name)) == Vec3::ZERO;
                let nothing = name == "indirect" && integrator == Some(Integrator::RayCast);
                assert_eq!(is_black, nothing, "{name} by {integrator:?}");
            }
        }
    }
}

/// With lights that no path finds by chance, what is scattered once is the picture of a render that stops there, and
/// each lobe's part that of a material with this lobe alone.
#[test]
fn kinds_of_light_are_pictures_of_their_own() {
    let shiny = Material { specular: Vec3::splat(0.4), shininess: 8.0, ..matte(0.6) };
    let mut scene = Scene::from_geometries(
        vec![twincast::scene::Geometry::Mesh(super::torus(20, DVec3::ZERO)), floor(4.0, 0)],
        vec![shiny],
    );
    scene.lights = vec![Light::Directional { direction: DVec3::new(-1.0, -2.0, -0.5).normalize(), color: Vec3::ONE }];
    let only = |change: fn(&mut Material)| {
        let mut scene = scene.clone();
        change(&mut scene.materials[0]);
        scene
    };
    let camera = Camera::look_at(DVec3::new(3.0, 5.0, 6.0), DVec3::ZERO, DVec3::Y, 0.8).unwrap();
    let path = Settings { integrator: Some(Integrator::Path), ..settings(48, 32, 4) };
    let whole = picture(&scene, &camera, &Settings { aovs: aovs("direct,LDE,gloss=LSE"), ..path.clone() });
    let short = Settings { max_depth: Some(0), ..path };
    for (name, scene) in [
        ("direct", scene.clone()),
        ("LDE", only(|m| m.specular = Vec3::ZERO)),
        ("gloss", only(|m| m.diffuse = Vec3::ZERO)),
    ] {
        let alone = picture(&scene, &camera, &short).image;
        for (i, (part, alone)) in light(&whole, name).iter().zip(&alone.pixels).enumerate() {
            assert!((*part - alone.truncate()).abs().max_element() < 1e-5, "{name} {i}: {part} {alone}");
        }
    }
}

/// Under light from everywhere each lobe sends on its own share, however its directions were proposed: known of
/// Lambert's, and of the rest by rendering it alone.
#[test]
fn lobes_that_overlap_get_what_is_theirs() {
    let both = Material {
        specular: Vec3::new(0.1, 0.4, 0.3),
        shininess: 3.0,
        model: Specular::Phong,
        energy_conserving: true,
        ambient: Vec3::ZERO,
        diffuse: Vec3::new(0.5, 0.3, 0.1),
        ..Material::default()
    };
    let lit = |material: Material| {
        let mut scene = Scene::from_geometries(vec![floor(100.0, 0)], vec![material]);
        let even = Image { width: 4, height: 2, pixels: vec![Vec4::ONE; 8] };
        scene.environment = Some(Environment::new(even));
        scene
    };
    let path = Settings { integrator: Some(Integrator::Path), ..settings(32, 32, 256) };
    let camera = Camera::look_at(DVec3::new(0.0, 4.0, 8.0), DVec3::ZERO, DVec3::Y, 0.1).unwrap();
    let asked = picture(&lit(both.clone()), &camera, &Settings { aovs: aovs("diffuse,specular"), ..path.clone() });
    let diffuse = mean(&light(&asked, "diffuse"));
    assert!((diffuse - both.diffuse).abs().max_element() < 0.005, "{diffuse}");
    let alone = picture(&lit(Material { diffuse: Vec3::ZERO, ..both }), &camera, &path).image;
    let alone = mean(&alone.pixels.iter().map(|p| p.truncate()).collect::<Vec<_>>());
    let specular = mean(&light(&asked, "specular"));
    assert!((specular - alone).abs().max_element() < 0.005, "{specular} {alone}");
}

#[test]
fn neither_threads_nor_tiles_show_in_any_channel() {
    let scene = busier_scene();
    for integrator in Integrator::ALL {
        let integrator = Some(integrator);
        let all = Aov::all().into_iter().filter(|aov| *aov != Aov::Time).collect();
        let asked = Settings { integrator, aovs: all, ..settings(70, 45, 2) };
        let by = |threads, tile| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| picture(&scene, &scene.cameras[0], &Settings { tile, ..asked.clone() }))
        };
        let reference = by(1, 32);
        let words = |picture: &Picture| -> Vec<(String, Vec<u32>)> {
            let plane = |plane: &Plane| match plane {
                Plane::Float(values) => values.iter().map(|x| x.to_bits()).collect(),
                Plane::Uint(values) => values.clone(),
            };
            picture.channels.iter().map(|channel| (channel.name.clone(), plane(&channel.plane))).collect()
        };
        for (threads, tile) in [(2, 32), (3, 8), (1, 64), (2, 4)] {
            let other = by(threads, tile);
            assert_eq!(bits(&reference.image.pixels), bits(&other.image.pixels), "{threads} threads, tiles of {tile}");
            for (a, b) in words(&reference).iter().zip(words(&other)) {
                assert!(*a == b, "{}: {threads} threads, tiles of {tile}", a.0);
            }
        }
    }
}

#[test]
fn cryptomatte_tells_how_much_of_what_covers_a_pixel() {
    let mut scene = busier_scene();
    for (i, instance) in scene.instances.iter_mut().enumerate() {
        instance.name = ["ring", "floor", "lamp", "tile"][i].to_owned();
    }
    for (material, name) in scene.materials.iter_mut().zip(["glass", "\"wood\"", "glow"]) {
        material.name = name.to_owned();
    }
    let world = World::new(&scene).unwrap();
    let settings = Settings { aovs: aovs("crypto-object,crypto-material"), ..settings(40, 30, 8) };
    let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings.clone()).unwrap();
    let (channels, metadata) = through_a_file(&picture(&scene, &scene.cameras[0], &settings));
    let text = |end: &str, layer: &str| {
        let of = metadata.texts.iter().find(|(key, text)| key.ends_with("/name") && text == layer).unwrap();
        let key = of.0.replace("/name", end);
        assert!(key.starts_with("cryptomatte/") && of.0.len() == "cryptomatte/1234567/name".len(), "{key}");
        metadata.texts.iter().find(|(name, _)| *name == key).unwrap().1.clone()
    };
    let brute = &engines(&world).pop().unwrap().tracer;
    let object_names: Vec<&str> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    let material_names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    for (layer, names) in [("CryptoObject", &object_names), ("CryptoMaterial", &material_names)] {
        assert_eq!(text("/hash", layer), "MurmurHash3_32");
        assert_eq!(text("/conversion", layer), "uint32_to_float32");
        let manifest: BTreeMap<String, String> = serde_json::from_str(&text("/manifest", layer)).unwrap();
        let ids: Vec<Option<u32>> =
            names.iter().map(|name| Some(u32::from_str_radix(manifest.get(*name)?, 16).unwrap())).collect();
        assert_eq!(manifest.len(), ids.iter().flatten().count(), "what is seen, and nothing else");
        assert!(manifest.len() >= 2);
        let plane = |rank: usize, component: usize| {
            let name = format!("{layer}{:02}.{}", rank / 2, ["R", "G", "B", "A"][rank % 2 * 2 + component]);
            channels.floats(&name).unwrap().to_vec()
        };
        let ranks: Vec<_> = (0..6).map(|rank| (plane(rank, 0), plane(rank, 1))).collect();
        let mut mixed = 0;
        for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
            let mut expected: BTreeMap<u32, f32> = BTreeMap::new();
            for sample in 0..8 {
                let Some(hit) = brute.closest(&renderer.camera_ray(x, y, sample)) else { continue };
                let which = if layer == "CryptoObject" {
                    hit.instance
                } else {
                    scene.geometries[hit.geometry as usize].material()
                };
                *expected.entry(ids[which as usize].expect("it is seen")).or_default() += 1.0 / 8.0;
            }
            let at = (y * 40 + x) as usize;
            let mut found = BTreeMap::new();
            let mut before = f32::INFINITY;
            for (id, share) in &ranks {
                assert!(share[at] <= before, "the largest first");
                before = share[at];
                if share[at] > 0.0 {
                    found.insert(id[at].to_bits(), share[at]);
                }
            }
            assert_eq!(found, expected, "{layer} {x},{y}");
            mixed += usize::from(found.len() > 1);
        }
        assert!(mixed > 10, "{mixed} pixels of several things");
    }
}

/// As others see the file.
#[test]
fn oiiotool_finds_names_and_types() {
    let scene = busier_scene();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let picture = picture(&scene, &scene.cameras[0], &Settings { aovs: Aov::all(), ..settings(20, 10, 1) });
    let metadata = Metadata { texts: picture.texts.clone(), ..Metadata::default() };
    image::write_channels(&path, &picture.image, &picture.channels, &metadata, &WriteOptions::default()).unwrap();
    let tool = std::process::Command::new("oiiotool").arg("--info").arg("-v").arg(&path).output();
    let Ok(output) = tool else { return };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8_lossy(&output.stdout);
    for words in [
        "R (half)",
        "A (half)",
        "primitive (uint)",
        "instance (uint)",
        "samples (uint)",
        "depth.Z (float)",
        "position.X (float)",
        "direct.R (float)",
        "CryptoObject02.A (float)",
        "/manifest: \"",
        "uint32_to_float32",
    ] {
        assert!(said.contains(words), "{words} in {said}");
    }
}
