//! The ray tracer course format.

use twincast::math::{DVec3, Vec3};
use twincast::scene::{Attenuation, DefaultLighting, Fov, Geometry, Light, Projection, Scene};
use twincast::trace::bvh::Bvh;
use twincast::{Ray, Shape, Tracer, World};

use super::{Files, corners, refused_bytes};

/// Every statement once at least.
pub const TEXT: &str = "# a comment\nsize 64 48\nmaxdepth 3\noutput out.png # another\n\
    camera 0 -4 4 0 -1 0 0 1 1 45\nmaxverts 4\nmaxvertnorms 3\n\
    directional 0 0 2 0.5 0.5 0.5\nattenuation 0 0.5 0.25\npoint 1 2 3 1 0.5 0\nattenuation 1 0 0\npoint 4 5 6 1 1 1\n\
    vertex -1 -1 0\nvertex 1 -1 0\nvertex 1 1 0\nvertex -1 1 0\nambient 0.1 0.2 0.3\ndiffuse 1 0 0\n\
    specular 0.5 0.5 0.5\nshininess 20\nemission 0.01 0.02 0.03\ntri 0 1 2\npushTransform\ntranslate 10 0 0\n\
    rotate 0 0 1 90\nscale 2 1 1\ntri 0 2 3\nsphere 1 0 0 0.5\npopTransform\nspecular 0 0 0\nsphere 5 0 0 1\n\
    vertexnormal 0 0 0 0 0 2\nvertexnormal 1 0 0 0 0 1\nvertexnormal 0 1 0 0 1 1\nscale 1 1 2\ntrinormal 0 1 2\n";

fn scene(text: &str) -> Scene {
    Files::one("a.test", text).scene("a.test")
}

fn close(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from(b)).length() < 1e-6
}

#[test]
fn everything_arrives() {
    let scene = scene(TEXT);
    let request = &scene.request;
    assert_eq!(
        (request.size, request.max_depth, request.output.as_deref()),
        (Some([64, 48]), Some(3), Some("out.png"))
    );
    let camera = &scene.cameras[0];
    assert!(
        close(camera.eye, [0.0, -4.0, 4.0])
            && camera.projection == Projection::Perspective(Fov::Vertical(45f64.to_radians()))
    );
    assert!(close(-camera.frame.z_axis * 5.0, [0.0, 3.0, -4.0]), "it looks from eye to at");

    let Light::Directional { direction, color } = scene.lights[0] else { panic!("{:?}", scene.lights[0]) };
    assert_eq!((direction, color), (DVec3::NEG_Z, Vec3::splat(0.5)), "the file has the way to the light");
    let attenuation = |i: usize| match scene.lights[i] {
        Light::Point { position, attenuation, .. } => (position, attenuation),
        ref other => panic!("{other:?}"),
    };
    let first = Attenuation { constant: 0.0, linear: 0.5, quadratic: 0.25 };
    assert_eq!(attenuation(1), (DVec3::new(1.0, 2.0, 3.0), first));
    assert_eq!(attenuation(2), (DVec3::new(4.0, 5.0, 6.0), Attenuation::NONE));

    // Two materials: with and without highlight, each as the statements stood at the primitive.
    assert_eq!((scene.materials.len(), scene.ambient), (2, Vec3::ONE));
    let material = &scene.materials[0];
    assert_eq!((material.ambient, material.diffuse), (Vec3::new(0.1, 0.2, 0.3), Vec3::X));
    assert_eq!((material.specular, material.reflection), (Vec3::splat(0.5), Vec3::splat(0.5)));
    assert_eq!((material.shininess, material.emission), (20.0, Vec3::new(0.01, 0.02, 0.03)));
    assert_eq!(scene.materials[1].reflection, Vec3::ZERO);
}

/// The matrices' product, by hand: scale x by 2, then a quarter turn about z, then 10 along x: (x, y) to (10 - y, 2 x).
#[test]
fn transforms_multiply_from_the_right() {
    let scene = scene(TEXT);
    let Geometry::Mesh(flat) = &scene.geometries[0] else { panic!("triangles first") };
    let [first, second] = corners(flat).try_into().expect("two triangles");
    let place = |p: Vec3| p.as_dvec3() + flat.origin;
    let expected = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]];
    assert!(first.into_iter().zip(expected).all(|(p, e)| close(place(p), e)), "{first:?}");
    let expected = [[11.0, -2.0, 0.0], [9.0, 2.0, 0.0], [9.0, -2.0, 0.0]];
    assert!(second.into_iter().zip(expected).all(|(p, e)| close(place(p), e)), "{second:?}");

    // Normals by the inverse transpose: (0, 1, 1) under a z twice as long is along (0, 1, 1/2).
    let Geometry::Mesh(smooth) = &scene.geometries[1] else { panic!("then those with normals") };
    assert_eq!(smooth.normals[0], Vec3::Z, "of length 1");
    assert!(close(smooth.normals[2].as_dvec3(), [0.0, 0.8f64.sqrt(), 0.2f64.sqrt()]), "{:?}", smooth.normals);
}

/// A ray into the ellipsoid above: centre (10, 2, 0), half axes 0.5 along x, 1 along y (twice 0.5), 0.5 along z.
#[test]
fn spheres_under_other_transforms_are_instances() {
    let scene = scene(TEXT);
    let Geometry::Shapes { shapes, .. } = &scene.geometries[2] else { panic!("the sphere that stays one") };
    let [Shape::Sphere(sphere)] = shapes.as_slice() else { panic!("{shapes:?}") };
    assert_eq!((sphere.centre, sphere.radius), (Vec3::new(5.0, 0.0, 0.0), 1.0));
    assert_eq!(scene.instances[1].name, "sphere of line 28");

    let world = World::new(&scene).unwrap();
    let bvh = Bvh::build(&world);
    let hit = |origin: [f64; 3], direction: Vec3| {
        let origin = (DVec3::from(origin) - world.centre).as_vec3();
        bvh.closest(&Ray::new(origin, direction)).filter(|hit| hit.instance == 1).map(|hit| hit.t)
    };
    for (origin, direction, t) in [
        ([10.0, 10.0, 0.0], Vec3::NEG_Y, 7.0),
        ([20.0, 2.0, 0.0], Vec3::NEG_X, 9.5),
        // Off the axis by half a radius: the rest of the half axis is sqrt(3) / 2 of it.
        ([10.25, 10.0, 0.0], Vec3::NEG_Y, 8.0 - 0.75f32.sqrt()),
    ] {
        let found = hit(origin, direction).expect("it hits the ellipsoid");
        assert!((found - t).abs() < 1e-5, "{found} for {t}");
    }
}

#[test]
fn turned_and_evenly_scaled_spheres_stay_spheres() {
    let scene = scene("rotate 1 2 3 77\nscale 2 -2 2\ntranslate 1 0 0\nsphere 0 0 0 0.5\n");
    let Geometry::Shapes { shapes, .. } = &scene.geometries[0] else { panic!() };
    let [Shape::Sphere(sphere)] = shapes.as_slice() else { panic!("{shapes:?}") };
    assert!((sphere.radius - 1.0).abs() < 1e-6 && (sphere.centre.length() - 2.0).abs() < 1e-6, "{sphere:?}");
    assert_eq!(scene.instances.len(), 1);
}

#[test]
fn equal_materials_are_one() {
    let mut text = String::new();
    for i in 0..100 {
        text += &format!("diffuse 0.{} 0 0\nsphere {i} 0 0 0.4\n", i % 3);
    }
    let scene = scene(&text);
    assert_eq!((scene.materials.len(), scene.geometries.len(), scene.primitive_count()), (3, 3, 100));
}

#[test]
fn without_lights_there_is_no_headlight() {
    let scene = scene("ambient 0.5 0 0\nsphere 0 0 0 1\n");
    assert_eq!((scene.lights.len(), scene.default_lighting), (0, DefaultLighting::None));
}

#[test]
fn faults_are_told_with_line_word_and_remedy() {
    for (text, line, words) in [
        ("size 10 10\nspere 0 0 0 1\n", 2, "\"spere\" is no statement of a .test file; did you mean \"sphere\"?"),
        ("sphere 0 0 0\n", 1, "ends too early; expected sphere x y z radius"),
        ("\n\nsphere 0 0 zero 1\n", 3, "\"zero\" where a finite number is expected"),
        ("sphere 0 0 inf 1\n", 1, "\"inf\" where a finite number is expected"),
        ("sphere 0 0 0 1 7\n", 1, "\"7\" is one word too many"),
        ("sphere 0 0 0 0\n", 1, "radius"),
        ("scale 1 2 3\nsphere 0 0 0 -1\n", 2, "radius"),
        ("vertex 0 0 0\ntri 0 0 1\n", 2, "index 1, but the last vertex above is 0"),
        ("vertex 0 0 0\ntri 0 0 -1\n", 2, "\"-1\" where a whole number"),
        ("trinormal 0 0 0\n", 1, "no vertexnormal stands above"),
        ("pushTransform\npopTransform\npopTransform\n", 3, "no pushTransform is left"),
        ("scale 1 0 1\n", 1, "no factor may be 0"),
        ("rotate 0 0 0 90\n", 1, "no direction"),
        ("camera 0 0 1 0 0 1 0 0 1 45\n", 1, "are one point"),
        ("camera 0 0 1 0 0 0 0 1 0 180\n", 1, "below 180"),
        ("attenuation 0 0 0\n", 1, "divides by zero"),
        ("diffuse -1 0 0\n", 1, "from 0 up"),
        ("size 0 10\n", 1, "each side may be 1 to"),
        ("\nmaxdepth 1001\n", 2, "a depth of 1001; at most 1000"),
        ("directional 0 0 0 1 1 1\n", 1, "no direction"),
    ] {
        refused_bytes("a.test", text, &format!("line {line}"), words);
    }
    refused_bytes("a.test", "size 10 10\n", "", "nothing to render");
}
