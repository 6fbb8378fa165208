//! Haines's Neutral File Format.

use twincast::Shape;
use twincast::math::{DVec3, Vec3};
use twincast::scene::{Fov, Geometry, Light, Projection, Scene, Specular};

use super::{Files, corners, refused_bytes};

/// Every statement once at least.
pub const TEXT: &str = "# made by hand\nv\nfrom 0 -8 2\nat 0 0 0\nup 0 0 1\nangle 40\nhither 1\nresolution 80 60\n\
    b 0.1 0.2 0.3\nl 10 0 10\nl 0 -10 5 0.9 0.8 0.7\nl 1 1 1\nl 2 2 2\n\
    f 1 0.5 0.25 0.8 0.2 30 0 0\ns 0 0 0 1\nc\n2 0 0 0.5\n2 0 2 0.25\nc\n3 0 0 0.5\n3 0 2 0.5\n\
    p 4\n-5 -5 -1\n5 -5 -1\n5 5 -1\n-5 5 -1\np 3\n0 0 3\n1 0 3\n0 1 3\n\
    f 1 1 1 0 0.1 3 0.9 1.5\ns 0 -2 0 0.5\npp 4\n0 0 4 0 0 1\n1 0 4 0 0 2\n1 1 4 1 0 0\n0 1 4 0 1 0\n";

fn scene(text: &str) -> Scene {
    Files::one("a.nff", text).scene("a.nff")
}

fn shapes(scene: &Scene, index: usize) -> &[Shape] {
    match &scene.geometries[index] {
        Geometry::Shapes { shapes, .. } => shapes,
        Geometry::Mesh(_) => panic!("shapes are expected"),
    }
}

#[test]
fn everything_arrives() {
    let scene = scene(TEXT);
    assert_eq!((scene.background, scene.request.size), (Some(Vec3::new(0.1, 0.2, 0.3)), Some([80, 60])));
    let kinds = scene.geometries.iter().flat_map(|geometry| match geometry {
        Geometry::Mesh(mesh) => vec![if mesh.normals.is_empty() { "flat" } else { "smooth" }],
        Geometry::Shapes { shapes, .. } => shapes.iter().map(Shape::name).collect(),
    });
    let kinds: Vec<_> = kinds.into_iter().collect();
    assert_eq!(kinds, ["flat", "sphere", "cone", "cylinder", "polygon", "smooth", "sphere"]);
    let Shape::Cone(cone) = shapes(&scene, 1)[1] else { panic!("a cone") };
    assert_eq!((cone.base, cone.base_radius, cone.apex_radius, cone.capped), (Vec3::X * 2.0, 0.5, 0.25, false));
    let Geometry::Mesh(patch) = &scene.geometries[2] else { panic!("a patch") };
    assert_eq!((patch.triangles.len(), corners(patch)[0][2]), (2, Vec3::new(1.0, 1.0, 4.0)));
    assert_eq!(patch.normals, [Vec3::Z, Vec3::Z, Vec3::X, Vec3::Z, Vec3::X, Vec3::Y]);
}

#[test]
fn fills_are_materials() {
    let materials = scene(TEXT).materials;
    let [matte, glass] = materials.as_slice() else { panic!("{materials:?}") };
    assert_eq!((matte.diffuse, matte.shininess), (Vec3::new(1.0, 0.5, 0.25) * 0.8, 30.0));
    assert_eq!(
        (matte.specular, matte.reflection, matte.transmission),
        (Vec3::splat(0.2), Vec3::splat(0.2), Vec3::ZERO)
    );
    assert_eq!((glass.diffuse, glass.transmission, glass.ior), (Vec3::ZERO, Vec3::splat(0.9), 1.5));
    assert!(matte.model == Specular::Phong && matte.ambient == Vec3::ZERO);
}

#[test]
fn lights_share_one_intensity() {
    let lights = scene(TEXT).lights;
    let colors: Vec<_> = lights
        .iter()
        .map(|light| match light {
            Light::Point { color, .. } => *color,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(colors, [Vec3::splat(0.5), Vec3::new(0.9, 0.8, 0.7), Vec3::splat(0.5), Vec3::splat(0.5)]);
}

/// The ray through the middle of the first row is half the angle above the axis.
#[test]
fn the_angle_is_between_the_centres_of_rows() {
    for rows in [2, 3, 60] {
        let text = TEXT.replace("resolution 80 60", &format!("resolution 7 {rows}"));
        let camera = &scene(&text).cameras[0];
        let Projection::Perspective(Fov::Vertical(angle)) = camera.projection else { panic!("{camera:?}") };
        let half = (angle / 2.0).tan();
        let first = half * (1.0 - 1.0 / f64::from(rows));
        assert!((first.atan() - 20f64.to_radians()).abs() < 1e-14, "{rows}: {first}");
        assert!((-camera.frame.z_axis - DVec3::new(0.0, 8.0, -2.0).normalize()).length() < 1e-14);
    }
}

#[test]
fn what_is_no_flat_polygon_is_divided_and_told() {
    let text = "f 1 1 1 1 0 0 0 0\np 4\n0 0 0\n1 0 0\n1 1 1\n0 1 0\np 4\n0 0 0\n1 0 0\n2 0 0\n3 0 0\n";
    let (scene, warnings) = Files::one("a.nff", text).load("a.nff");
    assert_eq!(scene.primitive_count(), 4);
    assert!(matches!(scene.geometries[..], [Geometry::Mesh(_)]));
    let [warning] = warnings.as_slice() else { panic!("{warnings:?}") };
    assert_eq!(warning.place, "line 2");
    assert!(
        warning.message.contains("2 polygons are divided") && warning.message.contains("off the plane"),
        "{warning}"
    );
}

#[test]
fn insides_out_are_told_for_glass() {
    let matte = "f 1 1 1 1 0 0 0 0\ns 0 0 0 -2\n";
    let Shape::Sphere(sphere) = shapes(&scene(matte), 0)[0] else { panic!("a sphere") };
    assert_eq!(sphere.radius, 2.0);
    let glass = "f 1 1 1 0 0 0 1 1.5\ns 0 0 0 -2\nc\n0 0 0 -1\n0 0 1 -1\n";
    let (_, warnings) = Files::one("a.nff", glass).load("a.nff");
    assert!(
        matches!(&warnings[..], [w] if w.message.starts_with("2 surfaces of glass are inside out")),
        "{warnings:?}"
    );
}

#[test]
fn faults_are_told_with_line_word_and_remedy() {
    let fill = "f 1 1 1 1 0 0 0 0\n";
    for (text, line, words) in [
        ("x 1\n", 1, "\"x\" is no statement of an NFF file; expected v, b, l"),
        ("s 0 0 0 1\n", 1, "before any \"f r g b"),
        ("from 0 0 0\n", 1, "\"from\" before any v"),
        ("v\nfrom 0 0 1\nat 0 0 0\nup 0 1 0\nangle 45\nresolution 4 4\nb 0 0 0\n", 7, "lacks the line \"hither\""),
        ("v\nfrom 0 0 1\nat 0 0 1\nup 0 0 1\nangle 45\nhither 0\nresolution 4 4\n", 7, "are one point"),
        ("v\nangle 200\n", 2, "below 180"),
        ("f 1 1 1 1 0 0 0.5 0\n", 1, "an index of 0, but T is 0.5"),
        ("f 1 1 1 1 0 0 0\n", 1, "expected f r g b Kd Ks Shine T index"),
        (&format!("{fill}s 0 0 0 0\n"), 2, "radius"),
        (&format!("{fill}p 2\n0 0 0\n1 0 0\n"), 2, "needs three"),
        (&format!("{fill}p 4\n0 0 0\n1 0 0\n"), 4, "the file ends too early"),
        (&format!("{fill}p 3\n0 0 0\n1 0 0 0\n0 1 0\n"), 4, "\"0\" is one word too many"),
        (&format!("{fill}pp 3\n0 0 0\n1 0 0\n0 1 0\n"), 3, "x y z nx ny nz"),
        (&format!("{fill}c\n0 0 0 1\n0 0 1 -1\n"), 4, "one sign"),
        (&format!("{fill}c\n0 0 0 1\n0 0 0 1\n"), 4, ""),
        ("l 1 2 3 4\n", 1, "l x y z [r g b]"),
    ] {
        refused_bytes("a.nff", text, &format!("line {line}"), words);
    }
}
