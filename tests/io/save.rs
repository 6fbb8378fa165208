//! Scenes that are written and read again.

use std::sync::Arc;

use twincast::io::save;
use twincast::math::{DAffine3, DVec2, DVec3, Vec3, Vec4};
use twincast::scene::{
    Absorption, Camera, DefaultLighting, Fov, Geometry, Interface, Material, Mesh, Projection, RECIPES, Scene,
};
use twincast::shade::{Attributes, SurfacePoint};
use twincast::trace::brute::Brute;
use twincast::trace::{Tracer, World};
use twincast::{Error, Polygon, Ray, Shape};

use super::Files;

/// Shapes as texts and triangles as corners in scene coordinates, each sorted; groups, names and order do not matter.
fn contents(scene: &Scene) -> (Vec<String>, Vec<[[u32; 3]; 3]>) {
    let (mut shapes, mut triangles) = (Vec::new(), Vec::new());
    for instance in &scene.instances {
        for (_, geometry) in scene.group_geometries(instance.group) {
            let color = scene.materials[geometry.material() as usize].diffuse;
            match geometry {
                Geometry::Mesh(mesh) => triangles.extend(mesh.triangles.iter().map(|corners| {
                    corners.map(|i| {
                        let p = mesh.origin + mesh.positions[i as usize].as_dvec3();
                        (instance.transform.transform_point3(p).as_vec3() + 0.0).to_array().map(f32::to_bits)
                    })
                })),
                Geometry::Shapes { shapes: list, .. } => {
                    assert_eq!(instance.transform, Default::default(), "none of the recipes moves shapes");
                    // A polygon's own numbers follow from its corners.
                    shapes.extend(list.iter().map(|shape| match shape {
                        Shape::Polygon(polygon) => format!("{color} {:?}", polygon.corners()),
                        other => format!("{color} {other:?}"),
                    }));
                }
            }
        }
    }
    shapes.sort();
    triangles.sort();
    (shapes, triangles)
}

fn angle(camera: &Camera) -> f64 {
    match camera.projection {
        Projection::Perspective(Fov::Vertical(angle)) => angle,
        other => panic!("{other:?}"),
    }
}

fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() <= 1e-9 * (1.0 + a.length())
}

#[test]
fn scenes_come_back_from_nff_and_toml() {
    let files = Files::one("empty", "");
    for recipe in RECIPES {
        let scene = recipe.make(2);
        for suffix in ["nff", "toml"] {
            let name = format!("{}.{suffix}", recipe.name);
            save(&scene, &files.path(&name)).unwrap();
            let again = files.scene(&name);
            assert!(contents(&again) == contents(&scene), "{name}");
            assert_eq!((again.lights, again.background), (scene.lights.clone(), scene.background), "{name}");
            assert_eq!(again.request.size, scene.request.size);
            let [a, b] = [&again.cameras[0], &scene.cameras[0]];
            assert!(close(a.eye, b.eye) && (angle(a) - angle(b)).abs() < 1e-12, "{name}: {a:?} {b:?}");
            assert!((0..3).all(|k| close(a.frame.col(k), b.frame.col(k))), "{name}");
            let looks = |m: &Material| (m.specular, m.shininess, m.reflection, m.transmission, m.model);
            let expected: Vec<_> = scene.materials.iter().map(looks).collect();
            assert!(again.materials.iter().map(looks).all(|look| expected.contains(&look)), "{name}");
        }
    }
}

/// However far away it stands, a camera looks where it looked.
#[test]
fn far_cameras_come_back() {
    let files = Files::one("empty", "");
    for far in [1e3, 1e10, 1e17] {
        let mut scene = RECIPES[0].make(1);
        let eye = DVec3::new(far, -far, 0.5 * far);
        let camera = Camera::look_at(eye, eye + DVec3::new(3.0, 1.0, -2.0) * far, DVec3::Y, 1.0).unwrap();
        scene.cameras = vec![Camera { name: "far".into(), ..camera.clone() }];
        for name in ["far.nff", "far.toml"] {
            save(&scene, &files.path(name)).unwrap();
            let again = &files.scene(name).cameras[0];
            assert!((0..3).all(|k| close(again.frame.col(k), camera.frame.col(k))), "{name} {far}: {again:?}");
        }
    }
}

#[test]
fn a_lattice_stays_one_mesh_in_toml() {
    let files = Files::one("empty", "");
    let scene = RECIPES.iter().find(|recipe| recipe.name == "lattice").unwrap().make(3);
    save(&scene, &files.path("a.toml")).unwrap();
    let again = files.scene("a.toml");
    assert_eq!((again.geometries.len(), again.instances.len()), (1, 27));
    assert_eq!(again.instances[5].name, scene.instances[5].name);
    assert_eq!(again.instances[5].transform, scene.instances[5].transform);
}

#[test]
fn triangles_come_back_from_ply() {
    let files = Files::one("empty", "");
    for (name, triangles) in [("terrain", 2 * 25), ("gears", 125 * (2 * 94 + 96 * 2) + 2), ("lattice", 0)] {
        let scene = RECIPES.iter().find(|recipe| recipe.name == name).unwrap().make(5);
        save(&scene, &files.path("a.ply")).unwrap();
        let again = files.scene("a.ply");
        if triangles > 0 {
            assert_eq!(again.primitive_count(), triangles, "{name}");
        } else {
            assert_eq!(contents(&again), contents(&scene));
        }
        let [a, b] = [again.bounds(), scene.bounds()];
        assert!((a.min - b.min).length() + (a.max - b.max).length() < 1e-5 * b.radius(), "{name}: {a:?} {b:?}");
    }
}

#[test]
fn what_could_not_be_read_again_is_not_written() {
    let files = Files::one("old.toml", "old");
    let scene = |mesh: Mesh| Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
    let triangle = |corner: Vec3, last: u32| Mesh::new(vec![corner, Vec3::X, Vec3::Y], vec![[0, 1, last]]);
    let few = Mesh { normals: vec![Vec3::Z], ..triangle(Vec3::ZERO, 2) };
    let bent = Mesh { normals: vec![Vec3::NAN; 3], ..triangle(Vec3::ZERO, 2) };
    let unlike = [
        (triangle(Vec3::ZERO, 3), "index 3 is past its 3 vertices", 3),
        (few, "1 normals for 3 positions", 3),
        (triangle(Vec3::NAN, 2), "not finite", 2),
        (triangle(Vec3::INFINITY, 2), "not finite", 2),
        (bent, "not finite", 2),
    ];
    for (mesh, words, code) in unlike {
        let scene = scene(mesh);
        for name in ["old.toml", "a.nff"] {
            let error = save(&scene, &files.path(name)).unwrap_err();
            assert!(error.to_string().contains(words) && error.exit_code() == code, "{name}: {error}");
        }
        if code == 3 {
            assert_eq!(save(&scene, &files.path("a.ply")).unwrap_err().exit_code(), 3);
        }
    }
    assert_eq!(std::fs::read(files.path("old.toml")).unwrap(), b"old");
    assert!(!files.path("a.nff").exists() && !files.path("a.ply").exists());
}

#[test]
fn what_a_format_cannot_say_is_bad_usage() {
    let files = Files::one("old.ply", "old");
    let refused = |scene: &Scene, name: &str, words: &str| {
        let error = save(scene, &files.path(name)).unwrap_err();
        assert!(matches!(&error, Error::Usage(message) if message.contains(words)), "{error}");
        assert_eq!(error.exit_code(), 2);
    };
    let flake = RECIPES[0].make(1);
    refused(&flake, "old.ply", "this scene has a sphere; write .nff or .toml");
    assert_eq!(std::fs::read(files.path("old.ply")).unwrap(), b"old");
    refused(&flake, "a.obj", "scenes are written as .nff, .ply, .toml");
    refused(&flake, "a", "scenes are written as");

    let disk = Shape::Disk(twincast::Disk { centre: Vec3::ZERO, normal: Vec3::Y, radius: 1.0 });
    let shapes = Geometry::Shapes { shapes: vec![disk], material: 0 };
    refused(&Scene::from_geometries(vec![shapes], vec![Material::default()]), "a.nff", "NFF has no disks");
    let glowing = Material { emission: Vec3::ONE, ..Material::default() };
    let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    refused(&Scene::from_geometries(vec![Geometry::Mesh(mesh.clone())], vec![glowing]), "a.nff", "emission");
    let colored = Mesh { colors: vec![Vec4::ONE; 3], ..mesh.clone() };
    let colored = Scene::from_geometries(vec![Geometry::Mesh(colored)], vec![Material::default()]);
    ["a.nff", "a.ply", "a.toml"].iter().for_each(|name| refused(&colored, name, "colours of vertices"));
    let mut moving = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
    moving.instances[0].transform_end = Some(DAffine3::from_translation(DVec3::X));
    refused(&moving, "a.nff", "motion");
    refused(&moving, "a.ply", "moves");
    let negative =
        Mesh { colors: vec![Vec4::NEG_ONE; 3], ..Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]) };
    let negative = Scene::from_geometries(vec![Geometry::Mesh(negative)], vec![Material::default()]);
    assert!(save(&negative, &files.path("a.ply")).unwrap_err().to_string().contains("negative"));
}

/// Where f32 does not hold them, coordinates are doubles in PLY, too.
#[test]
fn far_meshes_stay_where_they_are() {
    let corners =
        [[0.25, 0.0, 0.0], [1.0, 0.125, 0.0], [0.0, 1.0, 0.0625]].map(|p| DVec3::from(p) + DVec3::new(5e6, 0.0, -4e6));
    let mut mesh = Mesh { triangles: vec![[0, 1, 2]].into(), ..Mesh::default() };
    mesh.set_positions(&corners);
    let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
    let files = Files::one("none", "");
    for name in ["a.ply", "a.toml"] {
        save(&scene, &files.path(name)).unwrap();
        let again = files.scene(name);
        let Geometry::Mesh(mesh) = &again.geometries[0] else { panic!("a triangle is a mesh") };
        let place = |i: u32| again.instances[0].transform.transform_point3(mesh.point(mesh.positions[i as usize]));
        assert_eq!(mesh.triangles[0].map(place), corners, "{name}");
    }
}

/// What a mirror shows of a mesh is seen from the front where it was: glass would be entered as if it were left.
#[test]
fn mirrored_meshes_keep_their_front() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let polygon = Shape::Polygon(Arc::new(Polygon::new(corners.clone()).unwrap()));
    let things = [
        (Geometry::Mesh(Mesh::new(corners, vec![[0, 1, 2]])), &["a.nff", "a.ply", "a.toml"][..]),
        (Geometry::Shapes { shapes: vec![polygon], material: 0 }, &["a.ply", "a.toml"]),
    ];
    let files = Files::one("none", "");
    // Every format has words for its lights and materials.
    let plain = RECIPES[0].make(1);
    let mirrors = [(DVec3::ONE, true), (DVec3::new(-1.0, 1.0, 1.0), true), (DVec3::new(1.0, 1.0, -1.0), false)];
    for ((thing, names), (mirror, is_front)) in things.iter().flat_map(|thing| mirrors.map(|mirror| (thing, mirror))) {
        let unlit = Scene::from_geometries(vec![thing.clone()], vec![plain.materials[0].clone()]);
        let mut scene = Scene { lights: plain.lights.clone(), cameras: plain.cameras.clone(), ..unlit };
        scene.instances[0].transform = DAffine3::from_scale(mirror);
        let front = |scene: &Scene| {
            let world = World::new(scene).unwrap();
            let ray = Ray::new(Vec3::new(0.25 * mirror.x as f32, 0.25, 3.0), Vec3::NEG_Z);
            let hit = Brute::new(&world).closest(&ray).unwrap();
            SurfacePoint::new(scene, &world, &ray, &hit, Attributes::default()).front
        };
        assert_eq!(front(&scene), is_front, "{mirror}");
        for name in *names {
            save(&scene, &files.path(name)).unwrap();
            assert_eq!(front(&files.scene(name)), is_front, "{name}, {mirror}");
        }
    }
}

/// Materials keep their names where these tell them apart, and no name that is made up takes the place of one.
#[test]
fn materials_keep_their_names() {
    // With a gloss of which nothing is seen, and which is not read again.
    let material = |name: &str| Material { name: name.to_owned(), gloss: Some(9.0), ..Material::default() };
    let names = ["red \"1\"", "", "m1", "red \"1\"", "a.b"];
    let mesh =
        |material| Geometry::Mesh(Mesh { material, ..Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]) });
    let scene = Scene::from_geometries((0..5).map(mesh).collect(), names.map(material).into());
    let files = Files::one("none", "");
    save(&scene, &files.path("a.toml")).unwrap();
    let again = files.scene("a.toml");
    let mut found: Vec<_> = again.geometries.iter().map(|g| &*again.materials[g.material() as usize].name).collect();
    found.sort_unstable();
    assert_eq!(found, ["a.b", "m1", "m1_", "m3", "red \"1\""]);
}

/// What a scene file refuses is not written: of surfaces that show their colour as it is, of thin glass, of a view of
/// the whole sphere, and a name twice.
#[test]
fn what_is_saved_is_read_again() {
    let unlit =
        Material { unlit: true, diffuse: Vec3::new(0.25, 0.5, 1.0), ior: 1.2, shininess: 3.0, ..Material::default() };
    let pane = Material {
        interface: Interface::Thin,
        absorption: Some(Absorption { color: Vec3::splat(0.5), distance: 1.0 }),
        ..Material::glass(1.5)
    };
    let mesh =
        |material| Geometry::Mesh(Mesh { material, ..Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]) });
    let mut scene = Scene::from_geometries(vec![mesh(0), mesh(1)], vec![unlit, pane]);
    let front = Camera { name: "front".to_owned(), ..Camera::framing(&scene.bounds(), 1.0) };
    let around = Camera { projection: Projection::Equirectangular, shift: DVec2::X, ..front.clone() };
    scene.cameras = vec![front, around];
    let files = Files::one("none", "");
    save(&scene, &files.path("a.toml")).unwrap();
    let again = files.scene("a.toml");
    assert_eq!((again.materials[0].unlit, again.materials[0].diffuse), (true, scene.materials[0].diffuse));
    assert_eq!((again.materials[1].interface, again.materials[1].absorption), (Interface::Thin, None));
    let cameras: Vec<_> = again.cameras.iter().map(|camera| (camera.name.as_str(), camera.shift)).collect();
    assert_eq!(cameras, [("front", DVec2::ZERO), ("", DVec2::ZERO)]);
}

/// All shapes there are, and a name that needs care, through the format that has words for all.
#[test]
fn every_shape_comes_back_from_toml() {
    let files = Files::one("all.toml", super::toml::text());
    let mut scene = files.scene("all.toml");
    scene.instances[1].name = "a \"b\" \\ \u{7} é".to_owned();
    save(&scene, &files.path("again.toml")).unwrap();
    let again = files.scene("again.toml");
    let kinds = |scene: &Scene| {
        let mut kinds = Vec::new();
        for geometry in &scene.geometries {
            match geometry {
                Geometry::Mesh(mesh) => kinds.push(format!("{:?} {:?}", mesh.positions, mesh.triangles)),
                Geometry::Shapes { shapes, .. } => kinds.extend(shapes.iter().map(|shape| format!("{shape:?}"))),
            }
        }
        kinds.sort();
        kinds
    };
    assert_eq!(kinds(&again), kinds(&scene));
    let names = |scene: &Scene| scene.instances.iter().map(|i| (i.name.clone(), i.transform)).collect::<Vec<_>>();
    let placed: Vec<_> = names(&scene).into_iter().skip(1).collect();
    assert!(placed.iter().all(|instance| names(&again).contains(instance)), "{:?}", names(&again));
    assert_eq!(again.cameras.len(), scene.cameras.len());
    for (a, b) in again.cameras.iter().zip(&scene.cameras) {
        assert_eq!((&a.name, a.eye, a.shift, a.lens, a.distortion), (&b.name, b.eye, b.shift, b.lens, b.distortion));
        assert_eq!(a.end.map(|end| end.eye), b.end.map(|end| end.eye));
        let [extent, expected] = [a, b].map(|camera| camera.projection.half_extent(1.5).unwrap());
        assert!((extent - expected).length() < 1e-12, "{:?} {:?}", a.projection, b.projection);
    }
    assert_eq!(again.fog, scene.fog);
    assert!(scene.fog.is_some() && scene.cameras.iter().any(|camera| camera.end.is_some()));
    // Degrees and radians round once each.
    assert_eq!(format!("{:.6?}", again.lights), format!("{:.6?}", scene.lights));
    assert_eq!(
        (again.request, again.ambient, &again.cameras[0].name),
        (scene.request, scene.ambient, &scene.cameras[0].name)
    );
}

/// What a scene without lights is lit by comes back, and is not said where the format has no word for it.
#[test]
fn darkness_stays_dark() {
    let files = Files::one("dark.test", "ambient 0.5 0 0\nsphere 0 0 0 1\n");
    let dark = files.scene("dark.test");
    assert_eq!((dark.lights.len(), dark.default_lighting), (0, DefaultLighting::None));
    save(&dark, &files.path("dark.toml")).unwrap();
    let again = files.scene("dark.toml");
    assert_eq!((again.lights.len(), again.default_lighting), (0, DefaultLighting::None));
    let lit_from_the_eye =
        Scene { default_lighting: DefaultLighting::Headlight, lights: Vec::new(), ..RECIPES[0].make(1) };
    save(&lit_from_the_eye, &files.path("b.toml")).unwrap();
    assert_eq!(files.scene("b.toml").default_lighting, DefaultLighting::Headlight);
    let error = save(&lit_from_the_eye, &files.path("b.nff")).unwrap_err().to_string();
    assert!(error.contains("light from the viewer") && error.contains(".toml"), "{error}");
}
