//! Twincast's own scene format.

use twincast::math::{DVec2, DVec3, UVec3, Vec2, Vec3};
use twincast::scene::{
    Absorption, Accel, AcceleratorRequest, Alpha, AreaShape, Distortion, Fov, Geometry, Interface, Light, Projection,
    Resolution, Scene, Specular, ThinLens,
};
use twincast::{Shape, SphereMethod, TriangleMethod, World};

use super::{Files, obj, refused, refused_bytes};

/// The examples of the documentation, without their fences.
fn examples() -> Vec<String> {
    let text = include_str!("../../docs/SCENES.md");
    text.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

const SPHERE: &str = "\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";

/// A scene that has most of what there is.
pub fn text() -> String {
    let with_files = |example: &&String| {
        !example.contains("wood.png") && !example.contains("sky.exr") && !example.contains("[[file]]")
    };
    examples().iter().filter(with_files).map(String::as_str).collect()
}

/// A folder with the scene and with what the examples refer to.
fn files(text: &str) -> Files {
    Files::one("a.toml", text).and("wood.png", obj::picture()).and("sky.exr", obj::picture()).and("mesh.obj", TRIANGLE)
}

fn scene(text: &str) -> Scene {
    files(text).scene("a.toml")
}

#[test]
fn every_example_of_the_documentation_is_a_scene() {
    let examples = examples();
    assert!(examples.len() >= 7, "{}", examples.len());
    for example in &examples {
        let has_primitives = ["[[sphere]]", "[[file]]", "[[instance]]"].iter().any(|word| example.contains(word));
        let scene = scene(&if has_primitives { example.clone() } else { format!("{example}{SPHERE}") });
        World::new(&scene).expect("it can be traced");
    }
    // All of them at once.
    assert_eq!(scene(&examples.concat()).materials.len(), 8);
}

#[test]
fn the_documentation_has_every_key() {
    let text = include_str!("../../docs/SCENES.md");
    // What a table of this kind says when it is asked for a key it does not know.
    for table in [
        "[render]",
        "[[camera]]\neye = [0, 0, 1]\nlook_at = [0, 0, 0]",
        "[[light]]\ntype = \"point\"\nposition = [0, 0, 0]",
        "[[light]]\ntype = \"spot\"\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\nouter_angle = 3",
        "[[light]]\ntype = \"directional\"\ndirection = [1, 0, 0]",
        "[[light]]\ntype = \"sphere\"\nposition = [0, 0, 0]\nradius = 1\nradiance = 1",
        "[[light]]\ntype = \"rectangle\"\nposition = [0, 0, 0]\nhalf_edges = [[1, 0, 0], [0, 1, 0]]\nradiance = 1",
        "[material.a]",
        "[environment]\nimage = \"sky.exr\"",
        "[fog]\nabsorption = 1",
        "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1",
        "[[plane]]\npoint = [0, 0, 0]\nnormal = [1, 0, 0]",
        "[[disk]]\ncentre = [0, 0, 0]\nnormal = [1, 0, 0]\nradius = 1",
        "[[box]]\nmin = [0, 0, 0]\nmax = [1, 1, 1]",
        "[[cylinder]]\nbase = [0, 0, 0]\napex = [1, 1, 1]\nradius = 1",
        "[[cone]]\nbase = [0, 0, 0]\napex = [1, 1, 1]\nbase_radius = 1",
        "[[ellipsoid]]\ncentre = [0, 0, 0]\nradii = [1, 1, 1]",
        "[[polygon]]\ncorners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
        "[[triangle]]\ncorners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
        "[[mesh]]\npositions = []\ntriangles = []",
        "[[file]]\npath = \"mesh.obj\"",
        "[[instance]]\ngroup = \"a\"",
        "[group.a]",
    ] {
        let source = files(&format!("{table}\nzzzzzz = 1\n"));
        let options = twincast::io::LoadOptions::default();
        let message = twincast::io::load(&source.path("a.toml"), &options).unwrap_err().to_string();
        let (_, keys) = message.split_once("it knows ").unwrap_or_else(|| panic!("{message}"));
        for key in keys.split(", ") {
            let documented = [format!("{key} = "), format!("[[{key}]]"), format!(".{key}]]")];
            assert!(documented.iter().any(|form| text.contains(form)), "{key} of {table}");
        }
    }
}

#[test]
fn what_the_file_asks_of_a_render() {
    let scene = scene(&(examples()[0].clone() + &examples()[1] + SPHERE));
    let request = &scene.request;
    assert_eq!((request.size, request.spp, request.seed), (Some([640, 480]), Some(16), Some(7)));
    assert_eq!((request.max_depth, request.output.as_deref()), (Some(5), Some("picture.png")));
    let search = AcceleratorRequest {
        accel: Some(Accel::Grid),
        grid: Some(Resolution::Axes(UVec3::new(20, 10, 20))),
        triangle_method: Some(TriangleMethod::Woop),
        sphere_method: Some(SphereMethod::Accurate),
    };
    assert_eq!(request.search, search);
    assert_eq!((scene.background, scene.ambient), (Some(Vec3::new(0.1, 0.2, 0.4)), Vec3::splat(0.1)));
    let camera = &scene.cameras[0];
    assert_eq!(
        (camera.name.as_str(), camera.eye, camera.shift),
        ("front", DVec3::new(0.0, 1.0, 5.0), DVec2::new(0.25, 0.0))
    );
    let both = Fov::Both { horizontal: 60f64.to_radians(), vertical: 40f64.to_radians() };
    assert_eq!(camera.projection, Projection::Perspective(both));
    assert_eq!(camera.lens, Some(ThinLens { radius: 0.02, focus: 5.0, blades: 6 }));
    assert_eq!(camera.distortion, Some(Distortion { k1: -0.28, k2: 0.07, k3: 0.0, p1: 0.001, p2: 0.0 }));
    let plan = &scene.cameras[1];
    assert_eq!((plan.name.as_str(), plan.projection), ("plan", Projection::Orthographic(3.0)));
    assert_eq!((plan.frame.y_axis, plan.lens, plan.distortion), (DVec3::NEG_Z, None, None));
    assert!(scene.lights.is_empty());
    let only = scene_of_camera("fov_x = 60\n");
    assert_eq!(only.cameras[0].projection, Projection::Perspective(Fov::Horizontal(60f64.to_radians())));
    assert_eq!(scene_of_camera("").cameras[0].projection, Projection::Perspective(Fov::Vertical(40f64.to_radians())));
}

fn scene_of_camera(keys: &str) -> Scene {
    scene(&format!("[[camera]]\neye = [0, 1, 5]\nlook_at = [0, 0, 0]\n{keys}{SPHERE}"))
}

#[test]
fn lights_and_materials() {
    let scene = scene(&(examples()[2].clone() + &examples()[3] + SPHERE));
    let [
        Light::Directional { direction, .. },
        Light::Point { radius, range, .. },
        Light::Area { shape: AreaShape::Rectangle { centre, half_edges }, radiance },
        Light::Area { shape: AreaShape::Disk { normal, .. }, .. },
        Light::Area { shape: AreaShape::Sphere { radius: ball, .. }, .. },
        Light::Spot { inner_angle, outer_angle, .. },
    ] = scene.lights.as_slice()
    else {
        panic!("{:?}", scene.lights)
    };
    assert!((*direction - DVec3::new(-1.0, -2.0, -1.0).normalize()).length() < 1e-15);
    assert_eq!((*range, (*radius * 10.0).round()), (30.0, 1.0));
    assert!((inner_angle.to_degrees() - 20.0).abs() < 1e-4 && (outer_angle.to_degrees() - 30.0).abs() < 1e-4);
    assert_eq!((*centre, *half_edges), (DVec3::Y * 3.0, [DVec3::X * 0.5, DVec3::Z * 0.5]));
    assert_eq!((*radiance, *normal, *ball), (Vec3::new(10.0, 9.0, 8.0), DVec3::NEG_Y, 0.25));
    let glass = &scene.materials[1];
    assert_eq!((glass.name.as_str(), glass.diffuse, glass.ambient), ("glass", Vec3::splat(0.02), Vec3::splat(0.02)));
    assert_eq!((glass.transmission, glass.ior, glass.shininess), (Vec3::splat(0.85), 1.5, 100.0));
    assert_eq!((glass.model, glass.emission), (Specular::BlinnPhong, Vec3::new(0.0, 0.0, 0.01)));
    let wood = &scene.materials[4];
    let slots = [wood.diffuse_texture, wood.emission_texture, wood.normal_texture];
    assert_eq!((slots, scene.textures.len()), ([Some(0); 3], 1), "a picture is read once");
    assert_eq!((wood.alpha, wood.opacity, wood.normal_scale), (Alpha::Mask { cutoff: 0.5 }, 1.0, 1.0));
    let [bottle, pane, sign] = [0, 2, 3].map(|i| &scene.materials[i]);
    assert_eq!((bottle.interface, bottle.reflection, bottle.diffuse), (Interface::Fresnel, Vec3::ONE, Vec3::ZERO));
    let green = Absorption { color: Vec3::new(0.3, 0.8, 0.4), distance: 0.02 };
    assert_eq!((bottle.absorption, bottle.ior, pane.interface), (Some(green), 1.52, Interface::Thin));
    assert_eq!((sign.unlit, sign.diffuse), (true, Vec3::new(1.0, 0.9, 0.1)));
    assert_eq!((glass.gloss, glass.energy_conserving, glass.interface), (Some(500.0), true, Interface::Shares));
}

#[test]
fn every_primitive_arrives() {
    let scene = scene(&examples()[4]);
    let mut kinds = Vec::new();
    for geometry in &scene.geometries {
        match geometry {
            Geometry::Mesh(mesh) => kinds.push(if mesh.name.is_empty() { "triangle" } else { "mesh" }),
            Geometry::Shapes { shapes, .. } => kinds.extend(shapes.iter().map(Shape::name)),
        }
    }
    kinds.sort_unstable();
    let expected =
        ["box", "cone", "cylinder", "disk", "ellipsoid", "ellipsoid", "mesh", "plane", "polygon", "sphere", "triangle"];
    assert_eq!(kinds, expected);
    let red = scene.materials.iter().position(|m| m.name == "red").unwrap() as u32;
    assert_eq!(scene.geometries.iter().filter(|g| g.material() == red).count(), 1);
}

/// Textures lie on single triangles by their parameters, on those of a mesh by what it says.
#[test]
fn triangles_have_parameters_where_something_reads_them() {
    let wood = "[material.wood]\ntexture = \"wood.png\"\n";
    let two = "[[triangle]]\ncorners = [[0, 0, 4], [1, 0, 4], [0, 1, 4]]\nmaterial = \"wood\"\n\
        [[triangle]]\ncorners = [[1, 0, 4], [1, 1, 4], [0, 1, 4]]\n";
    let read = |text: String| files(&text).and("wood.png", obj::picture()).scene("a.toml");
    let textured = read(format!("{wood}{two}material = \"wood\"\n"));
    let [Geometry::Mesh(mesh)] = &textured.geometries[..] else { panic!("{:?}", textured.geometries) };
    assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ZERO, Vec2::X, Vec2::Y]);
    let corners = super::corners(mesh);
    assert_eq!((corners[0][1], corners[1][0]), (Vec3::new(1.0, 0.0, 4.0), Vec3::new(1.0, 0.0, 4.0)));
    let one = read(format!("{wood}{two}"));
    let uvs: Vec<usize> = super::meshes(&one).iter().map(|mesh| mesh.uvs.len()).collect();
    assert_eq!(uvs, [3, 0], "the other is of the plain material");
}

#[test]
fn groups_in_groups_are_unrolled() {
    let scene = scene(&examples()[6]);
    let names: Vec<_> = scene.instances.iter().map(|instance| instance.name.as_str()).collect();
    assert_eq!(names, ["forest/left", "forest/right", "twin/left", "twin/right", "blown over"]);
    assert!(scene.instances.iter().all(|i| i.group == scene.instances[0].group) && scene.groups.len() == 1);
    // The tree's top, (0, 3, 0): scaled to (0, 4.5, 0), turned about y, moved; then halved and moved back by 6.
    let top = |i: usize| scene.instances[i].transform.transform_point3(DVec3::new(0.0, 3.0, 0.0));
    for (i, expected) in
        [[-2.0, 3.0, 0.0], [2.0, 4.5, 0.0], [-1.0, 1.5, -6.0], [1.0, 2.25, -6.0]].into_iter().enumerate()
    {
        assert!((top(i) - DVec3::from(expected)).length() < 1e-12, "{i}: {}", top(i));
    }
    let ends: Vec<bool> = scene.instances.iter().map(|instance| instance.transform_end.is_some()).collect();
    assert_eq!(ends, [false, false, false, false, true]);
    // Turned by 30 degrees about y: x goes to (cos, 0, -sin).
    let x = scene.instances[1].transform.matrix3.x_axis;
    assert!((x - DVec3::new(0.75f64.sqrt(), 0.0, -0.5)).length() < 1e-12, "{x}");
}

#[test]
fn files_are_included_once() {
    let file = "[[group.g.file]]\npath = \"mesh.obj\"\nname = \"m\"\n";
    let twice = "[[instance]]\ngroup = \"g\"\ntransform = {translate = [0, 5, 0]}\n[[file]]\npath = \"mesh.obj\"\n";
    let red =
        "[material.red]\ndiffuse = [1, 0, 0]\n[[file]]\npath = \"mesh.obj\"\nmaterial = \"red\"\nup_axis = \"z\"\n";
    let scene = scene(&format!("{red}{twice}{file}"));
    let groups: Vec<_> = scene.instances.iter().map(|i| (i.name.as_str(), i.group)).collect();
    assert_eq!(groups.len(), 3);
    assert_eq!((groups[1].1, groups[2].0), (groups[2].1, "g/m"), "one mesh, placed twice: {groups:?}");
    assert_eq!(scene.instances[2].transform.translation, DVec3::Y * 5.0);
    let Geometry::Mesh(turned) = &scene.geometries[groups[0].1 as usize] else { panic!() };
    assert_eq!(scene.materials[turned.material as usize].diffuse, Vec3::X);
    assert_eq!(super::corners(turned)[0][2], Vec3::Y, "z is up in the file");
    assert!(scene.files[0].ends_with("a.toml") && scene.files[1].ends_with("mesh.obj"), "{:?}", scene.files);
}

#[test]
fn glowing_spheres_are_lights() {
    let minray = "[render]\nshading = \"minray\"\nambient = 0.02\n[material.lamp]\nemission = [0.5, 0.4, 0.3]\n\
        [[group.lamp.sphere]]\ncentre = [1, 0, 0]\nradius = 2\nmaterial = \"lamp\"\n\
        [[instance]]\ngroup = \"lamp\"\ntransform = [{translate = [0, 1, 0]}, {scale = 3}]\n";
    let scene = scene(&format!("{minray}{SPHERE}"));
    let [Light::Point { position, color, radius, .. }] = scene.lights[..] else { panic!("{:?}", scene.lights) };
    assert!((position - DVec3::new(3.0, 1.0, 0.0)).length() < 1e-12 && (radius - 6.0).abs() < 1e-9);
    assert_eq!((color, scene.background), (Vec3::new(0.5, 0.4, 0.3), Some(Vec3::splat(0.02))));
}

#[test]
fn faults_are_told_with_line_and_remedy() {
    let deep: String = (0..100).map(|i| format!("[[group.g{i}.instance]]\ngroup = \"g{}\"\n", i + 1)).collect();
    let many: String = (0..9)
        .map(|i| format!("[[group.g{i}.instance]]\ngroup = \"g{}\"\n", i + 1).repeat(10))
        .chain(["[[instance]]\ngroup = \"g0\"\n[[group.g9.sphere]]\ncentre = [0, 0, 0]\nradius = 1\n".to_owned()])
        .collect();
    for (text, line, words) in [
        ("[material.a]\nthin = true\n", 2, "type = \"glass\" alone"),
        ("[material.a]\nattenuation_distance = 2\n", 1, "one of them is missing"),
        ("[material.a]\nattenuation_distance = 0\n", 2, "a number above 0"),
        ("[material.a]\nalpha = \"blend\"\nalpha_cutoff = 0.5\n", 1, "alpha = \"mask\" alone"),
        ("[material.a]\nopacity = 2\n", 2, "from 0 to 1"),
        ("[environment]\nimage = \"none.exr\"\n", 2, "there is no file"),
        ("[render]\nintegrator = \"paths\"\n", 2, "did you mean \"path\""),
        ("[render\n", 1, "not TOML"),
        ("a = 1\n", 1, "the file has no key \"a\""),
        ("[[spheer]]\nradius = 1\n", 1, "did you mean \"sphere\"?"),
        ("[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\ncolour = 1\n", 4, "[[sphere]] has no key \"colour\""),
        (
            "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\n",
            2,
            "[[sphere]] has no key \"center\"; did you mean \"centre\"?",
        ),
        ("[[sphere]]\nradius = 1\n", 1, "[[sphere]] lacks \"centre\""),
        ("[[fog]]\nabsorption = 1\n", 1, "several tables [[fog]] where there is one; write [fog]"),
        ("[[material.red]]\ncolor = 1\n", 1, "write [material.red]"),
        (
            "[[camera]]\neye = [0, 0, 5]\nlook_at = [0, 0, 0]\nlens = [0.1, 7]\n",
            4,
            "[0.1, 7] where \"lens\" wants a table",
        ),
        ("[[cone]]\nbase = [0, 0, 0]\napex = [0, 1, 0]\napex_radius = 0.5\n", 1, "lacks \"base_radius\""),
        ("[[sphere]]\ncentre = [0, 0]\nradius = 1\n", 2, "[0, 0] where \"centre\" wants a list of 3 numbers"),
        ("[[sphere]]\ncentre = [0, 0, nan]\nradius = 1\n", 2, "nan where \"centre\" wants a finite number"),
        (
            "[[sphere]]\ncentre = [0, 0, 0]\nradius = \"1\"\n",
            3,
            "the text \"1\" where \"radius\" wants a finite number",
        ),
        ("[[sphere]]\ncentre = [0, 0, 0]\nradius = -1\n", 1, "the radius is -1"),
        (
            "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = \"rde\"\n[material.red]\n",
            4,
            "did you mean \"red\"?",
        ),
        ("[sphere]\nradius = 1\n", 1, "one table [sphere] where there may be several; write [[sphere]]"),
        ("[material.a]\ndiffuse = [1, -1, 0]\n", 2, "from 0 up"),
        ("[material.a]\nior = 0\n", 2, "above 0"),
        (
            "[[camera]]\neye = [0, 0, 1]\nlook_at = [0, 0, 0]\nprojection = \"equirectangular\"\nlens = { radius = 1, focus = 1 }\n",
            5,
            "no plane of focus",
        ),
        (
            "[[camera]]\neye = [0, 0, 1]\nlook_at = [0, 0, 0]\nprojection = \"equirectangular\"\nshift = [0, 0.25]\n",
            5,
            "see the whole sphere",
        ),
        (
            "[[camera]]\nname = \"a\"\neye = [0, 0, 1]\nlook_at = [0, 0, 0]\n[[camera]]\nname = \"a\"\neye = [0, 1, 1]\nlook_at = [0, 0, 0]\n",
            5,
            "has the name \"a\", too",
        ),
        ("[material.a]\ntype = \"unlit\"\nreflection = 0.5\n", 3, "as it is; leave one of them out"),
        ("[material.a]\ntype = \"unlit\"\nnormal_texture = \"p.png\"\n", 3, "as it is; leave one of them out"),
        (
            "[material.a]\ntype = \"glass\"\nthin = true\nattenuation_color = 1\nattenuation_distance = 1\n",
            1,
            "\"thin\" glass has none",
        ),
        (
            "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1e300\n",
            1,
            "the radius is 1e300; it must be above 0 and at most 1.844e18",
        ),
        ("[[ellipsoid]]\ncentre = [0, 0, 0]\nradii = [1, -1, 1]\n", 3, "three numbers above 0"),
        ("[material.\"a\\u001b[31m\\nb\"]\nred = 1\n", 2, "[material.a\\u{1b}[31m\\nb] has no key \"red\""),
        ("[material.a]\nopacity = 0.5\n", 2, "alpha = \"blend\" or \"mask\""),
        ("[material.a]\nnormal_scale = 2\n", 2, "\"normal_texture\", which is missing"),
        ("[material.a]\nattenuation_color = 1\nattenuation_distance = 1\n", 1, "give it a \"transmission\""),
        ("[material.a]\nmodel = \"phnog\"\n", 2, "did you mean \"phong\"?"),
        ("[material.a]\ntexture = \"none.png\"\n", 2, "none.png\" is missing"),
        ("[render]\nsize = [0, 1]\n", 2, "whole numbers from 1 to"),
        ("[render]\nmax_depth = 1001\n", 2, "wants a whole number from 0 to 1000"),
        ("[render]\noutput = \".\"\n", 2, "\".\" where \"output\" wants the name of a picture"),
        ("[render]\noutput = \"\"\n", 2, "the name of a picture, as in"),
        ("[render]\noutput = \"out/\"\n", 2, "the name of a picture, as in"),
        ("[render]\noutput = \"a.png/.\"\n", 2, "the name of a picture, as in"),
        ("[render]\noutput = \"a\\u0000.png\"\n", 2, "the name of a picture, as in"),
        ("[[light]]\ntype = \"sphere\"\nposition = [0, 0, 3]\nradius = 1e300\n", 4, "wants a length of at most"),
        (
            "[[light]]\ntype = \"rectangle\"\nposition = [0, 0, 3]\nhalf_edges = [[1e200, 0, 0], [0, 1, 0]]\n",
            4,
            "of at most",
        ),
        ("[render]\nspp = 0x10001\n", 2, "0x10001 where \"spp\" wants a whole number from 1 to"),
        ("[render]\nspp = 1.5\n", 2, "1.5 where \"spp\" wants a whole number from 1 to"),
        ("[render]\naccel = \"octre\"\n", 2, "did you mean \"octree\"?"),
        ("[render]\ngrid = 5\n", 2, "write that, too"),
        ("[render]\naccel = \"grid\"\ngrid = [1, 2]\n", 3, "one number of cells or three"),
        ("[render]\naccel = \"grid\"\ngrid = 0\n", 3, "a whole number from 1 to 2048"),
        ("[render]\ntriangle_method = \"woop\"\n", 2, "write accel = \"binary-bvh\" or another"),
        ("[render]\naccel = \"bvh\"\nsphere_method = \"geometric\"\n", 3, "bvh and brute are exact"),
        ("[[light]]\ntype = \"spt\"\n", 2, "did you mean \"spot\"?"),
        ("[[light]]\ntype = \"point\"\nposition = [0, 0, 0]\nattenuation = [0, 0, 0]\n", 4, "divides by zero"),
        ("[[light]]\ntype = \"point\"\nposition = [0, 0, 0]\nattenuation = 2\n", 4, "three numbers [c0, c1, c2]"),
        (
            "[[light]]\ntype = \"rectangle\"\nposition = [0, 0, 0]\nradiance = 1\nhalf_edges = [[1, 0, 0], [2, 0, 0]]\n",
            5,
            "two vectors that are not parallel",
        ),
        (
            "[[light]]\ntype = \"disk\"\nposition = [0, 0, 0]\ndirection = [0, 1, 0]\nradius = -1\n",
            5,
            "a length above 0",
        ),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 1, 0]\n", 1, "are one point"),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, 0]\n", 1, "\"up\" is zero"),
        (
            "[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nup = [0, 1e-300, 0]\n",
            1,
            "\"up\" is too long or too short",
        ),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 1e300]\n", 1, "are too far apart"),
        ("[[camera]]\neye = [0, 1e30, 0]\nlook_at = [0, 0, 0]\n", 2, "coordinates of at most 1.844e18"),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\neye_end = [0, 1e30, 0]\n", 4, "coordinates of at most"),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nlens = { radius = 1e300, focus = 5 }\n", 4, "of at most"),
        (
            "[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nheight = 3\n",
            4,
            "\"height\" is for orthographic cameras alone",
        ),
        (
            "[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nprojection = \"equirectangular\"\nfov_x = 3\n",
            5,
            "\"fov_x\" is for perspective cameras alone",
        ),
        (
            "[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nqqqq = 3\n",
            4,
            "; it knows eye, look_at, up, eye_end, look_at_end, up_end, projection, fov, fov_x, lens, distortion, name, shutter, shift",
        ),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nprojection = \"orthographic\"\n", 1, "\"height\""),
        (
            "[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nprojection = \"equirectangular\"\ndistortion = [1, 0, 0, 0, 0]\n",
            5,
            "perspective cameras alone",
        ),
        ("[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nlens = { radius = 0, focus = 1 }\n", 4, "a length above 0"),
        (
            "[[camera]]\neye = [0, 1, 0]\nlook_at = [0, 0, 0]\nlens = { radius = 1, focus = 1, blades = 2 }\n",
            4,
            "3 or more",
        ),
        ("[[file]]\npath = \"a.toml\"\n", 2, "no mesh file"),
        (
            "[[mesh]]\npositions = [[0, 0, 0]]\ntriangles = [[0, 0, 1]]\n",
            3,
            "1 where \"triangles\" wants a whole number from 0 to 0",
        ),
        ("[[instance]]\ngroup = \"b\"\n", 2, "no [group.b]; there is no [group.NAME] in this file"),
        (
            "[[group.a.instance]]\ngroup = \"b\"\n[[group.b.instance]]\ngroup = \"a\"\n",
            4,
            "group \"a\" contains itself: a > b > a",
        ),
        (&deep, 1, "nested more than 64 deep"),
        (&many, 1, "placements of groups"),
        ("[group.a]\n[[instance]]\ngroup = \"a\"\ntransform = {scale = 0}\n", 3, "\"a\" has a singular transform"),
        ("[group.a]\n[[instance]]\ngroup = \"a\"\ntransform = {}\n", 4, "an empty step"),
        (
            "[group.a]\n[[instance]]\ngroup = \"a\"\ntransform = [{scale = 2, translate = [0, 0, 0]}]\n",
            4,
            "a step does one thing",
        ),
        ("[group.a]\n[[instance]]\ngroup = \"a\"\ntransform = {rotat = [0, 0, 1, 3]}\n", 4, "did you mean \"rotate\"?"),
    ] {
        if text == deep {
            let error = twincast::io::load(&files(text).path("a.toml"), &Default::default()).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
            continue;
        }
        refused(&files(text), "a.toml", &format!("line {line}"), words);
    }
    refused_bytes("a.toml", b"# \xff\n", "line 1", "no UTF-8");
    refused_bytes("a.toml", "[render]\n", "", "nothing to render");
    // What is wrong in an included file is told of that file.
    let files = Files::one("a.toml", "[[file]]\npath = \"b.obj\"\n").and("b.obj", "f 1 2 3\n");
    let error = twincast::io::load(&files.path("a.toml"), &Default::default()).unwrap_err().to_string();
    assert!(error.contains("b.obj: line 1") && error.ends_with("a.toml, line 2)"), "{error}");
}

/// Materials that name one picture share it; and each file is told of once.
#[test]
fn a_picture_is_read_once_however_many_materials_name_it() {
    let mut text = SPHERE.to_owned();
    for i in 0..20 {
        text += &format!("[material.m{i}]\ntexture = \"p.png\"\nemission_texture = \"q.png\"\n");
    }
    let scene = Files::one("a.toml", text).and("p.png", obj::picture()).and("q.png", obj::picture()).scene("a.toml");
    let pictures = scene.files.iter().filter(|file| file.extension().is_some_and(|suffix| suffix == "png"));
    assert_eq!((scene.textures.len(), pictures.count()), (2, 2));
    let slots = scene.materials[..20].iter().map(|m| (m.diffuse_texture, m.emission_texture));
    assert!(slots.eq([(Some(0), Some(1)); 20]));
}
