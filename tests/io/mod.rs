//! Scene files: what is in the scene, and what is said about files that are wrong.

pub mod course;
pub mod gltf;
mod gltf_look;
pub mod gltf_maker;
mod gltf_packed;
mod gltf_pose;
mod local_origins;
mod models;
pub mod nff;
pub mod obj;
mod placements;
pub mod ply;
mod save;
pub mod stl;
pub mod toml;

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use twincast::io::{LoadOptions, Normals, Unit, UpAxis, load};
use twincast::math::{DVec3, Vec3};
use twincast::scene::{Geometry, Mesh};
use twincast::{Error, Scene, Warning};

use crate::skip::skip;

/// A folder with files, which goes away with it.
pub struct Files(TempDir);

impl Files {
    /// A folder with one file.
    pub fn one(name: &str, bytes: impl AsRef<[u8]>) -> Self {
        Self(tempfile::tempdir().expect("a temporary folder")).and(name, bytes)
    }

    /// With one more file.
    pub fn and(self, name: &str, bytes: impl AsRef<[u8]>) -> Self {
        fs::write(self.path(name), bytes).expect("a file in a temporary folder");
        self
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Loads a file that is expected to be good.
    pub fn load(&self, name: &str) -> (Scene, Vec<Warning>) {
        load(&self.path(name), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Loads a file that is expected to be good, and to give no warnings.
    pub fn scene(&self, name: &str) -> Scene {
        let (scene, warnings) = self.load(name);
        assert_eq!(warnings, []);
        scene
    }
}

/// Loads a file that is expected to be bad: an input error about the file itself, at the place, whose message has the
/// words. Its exit code is 3 and it takes one line.
#[track_caller]
pub fn refused(files: &Files, name: &str, place: &str, words: &str) {
    let error = load(&files.path(name), &LoadOptions::default()).map(|_| ()).expect_err("an error");
    assert_eq!(error.exit_code(), 3);
    assert_eq!(error.to_string().lines().count(), 1, "{error}");
    let Error::Input { path, place: found, message } = &error else { panic!("{error}") };
    assert_eq!((path, found.as_str()), (&files.path(name), place), "{error}");
    assert!(message.contains(words), "{message:?} has no {words:?}");
}

/// The same for a file that is given as its bytes.
#[track_caller]
pub fn refused_bytes(name: &str, bytes: impl AsRef<[u8]>, place: &str, words: &str) {
    refused(&Files::one(name, bytes), name, place, words);
}

pub fn meshes(scene: &Scene) -> Vec<&Mesh> {
    fn mesh(geometry: &Geometry) -> &Mesh {
        match geometry {
            Geometry::Mesh(mesh) => mesh,
            Geometry::Shapes { .. } => panic!("a mesh is expected"),
        }
    }
    scene.geometries.iter().map(mesh).collect()
}

/// The corners of a mesh's triangles.
pub fn corners(mesh: &Mesh) -> Vec<[Vec3; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A vertex that no face uses, far away, neither frames the scene nor takes from the others' precision.
#[test]
fn strays_change_nothing() {
    let far = 1_000_000.1;
    let corners = [[far, 0.0, far], [far + 2.0, 0.0, far], [far, 2.0, far]];
    let text = |stray: bool, vertex: &dyn Fn([f64; 3]) -> String| {
        let all = stray.then_some([0.0; 3]).into_iter().chain(corners).chain(stray.then_some([-3e7, 0.0, 9.0]));
        all.map(vertex).collect::<String>()
    };
    let files = |stray: bool| {
        let [a, b, c] = if stray { [1, 2, 3] } else { [0, 1, 2] };
        let obj = text(stray, &|[x, y, z]| format!("v {x} {y} {z}\n"));
        let rows = text(stray, &|[x, y, z]| format!("{x} {y} {z}\n"));
        let lists = text(stray, &|[x, y, z]| format!("[{x:?}, {y:?}, {z:?}], "));
        let count = if stray { 5 } else { 3 };
        let ply = |kind: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex {count}\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
                 element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}3 {a} {b} {c}\n"
            )
        };
        Files::one("a.obj", format!("{obj}f {} {} {}\n", a + 1, b + 1, c + 1))
            .and("double.ply", ply("double"))
            .and("single.ply", ply("float"))
            .and("a.toml", format!("[[mesh]]\npositions = [{lists}]\ntriangles = [[{a}, {b}, {c}]]\n"))
    };
    let (clean, strayed) = (files(false), files(true));
    for name in ["a.obj", "double.ply", "single.ply", "a.toml"] {
        let [clean, strayed] = [&clean, &strayed].map(|files| files.scene(name));
        let [found, expected] = [&strayed, &clean].map(|scene| {
            let mesh = meshes(scene)[0];
            (mesh.positions.iter().map(|&p| mesh.point(p)).collect::<Vec<_>>(), scene.bounds().min, scene.bounds().max)
        });
        assert_eq!(found, expected, "{name}");
        let exact = if name == "single.ply" { 0.1 } else { 1e-6 };
        for (found, corner) in found.0.iter().zip(corners) {
            assert!((*found - DVec3::from(corner)).length() < exact, "{name}: {found}");
        }
    }
}

/// Nor does a triangle that no ray can hit.
#[test]
fn what_cannot_be_hit_changes_nothing_either() {
    let far = 5e6;
    let vertices = [[far, 0.0, -far], [far + 0.25, 0.0, -far], [far, 0.25, 0.125 - far], [far + 0.25, 0.25, -far]];
    for (bad, smoothing) in ["1e30", "1e300"].into_iter().zip(["s 1\n", ""]) {
        let text = |more: bool, vertex: &dyn Fn(&str) -> String| {
            let own = vertices.map(|[x, y, z]| vertex(&format!("{x} {y} {z}"))).concat();
            if more { own + &vertex("0 0 0") + &vertex(&format!("{bad} 0 0")) } else { own }
        };
        let files = |more: bool| {
            let faces = ["f 1 2 3\nf 2 4 3\n", "f 1 2 3\nf 2 4 3\nf 1 5 6\n"][usize::from(more)];
            let obj = text(more, &|vertex| format!("v {vertex}\n")) + smoothing + faces;
            let rows = text(more, &|vertex| format!("{vertex}\n"));
            let triangles = ["3 0 1 2\n3 1 3 2\n", "3 0 1 2\n3 1 3 2\n3 0 4 5\n"][usize::from(more)];
            let ply = format!(
                "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
                 element face {}\nproperty list uchar int vertex_indices\nend_header\n{rows}{triangles}",
                4 + 2 * usize::from(more),
                2 + usize::from(more)
            );
            Files::one("a.obj", obj).and("a.ply", ply)
        };
        let (clean, spoilt) = (files(false), files(true));
        for name in ["a.obj", "a.ply"] {
            let ((spoilt, warnings), clean) = (spoilt.load(name), clean.scene(name));
            assert!(warnings.iter().any(|w| w.message.starts_with("1 triangles have corners")), "{name}: {warnings:?}");
            let [found, expected] = [&spoilt, &clean].map(|scene| meshes(scene)[0]);
            assert_eq!(
                (found.origin, &found.positions[..4]),
                (expected.origin, &expected.positions[..4]),
                "{name} {bad}"
            );
            assert_eq!(found.normals.get(..4), expected.normals.get(..4), "{name} {bad}");
            let [found, expected] = [spoilt.bounds(), clean.bounds()];
            assert_eq!((found.min, found.max), (expected.min, expected.max), "{name} {bad}");
        }
    }
}

/// Where no ray hits anything, that is told, and nothing is framed that no ray hits.
#[test]
fn meshes_without_an_area_are_told() {
    let ply = |corners: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n{corners}3 0 1 2\n"
        )
    };
    for (corners, is_bounded) in [("0 0 0\n1 0 0\n2 0 0\n", true), ("0 0 0\nnan 0 0\n0 1 0\n", false)] {
        let files = Files::one("a.ply", ply(corners));
        let (scene, warnings) = files.load("a.ply");
        assert!(warnings.iter().any(|warning| warning.message.starts_with("no ray hits anything")), "{warnings:?}");
        assert_eq!(!scene.bounds().is_empty(), is_bounded, "{corners}");
    }
    let plain = ply("0 0 0\n1 0 0\n0 1 0\n");
    let (_, warnings) = Files::one("a.ply", &plain).load("a.ply");
    assert_eq!(warnings, []);
    // With the mark that some editors put before a text.
    let (marked, warnings) = Files::one("a.ply", format!("\u{feff}{plain}")).load("a.ply");
    assert_eq!((marked.primitive_count(), warnings), (1, vec![]));
}

#[test]
fn files_that_are_no_scenes() {
    let files = Files::one("empty.obj", "").and("scene.xyz", "x").and("none", "x");
    fs::create_dir(files.path("folder.obj")).unwrap();
    refused(&files, "folder.obj", "", "directory");
    refused(&files, "empty.obj", "", "empty");
    refused(&files, "absent.obj", "", "there is no such file");
    refused(&files, "scene.xyz", "", "glb, gltf, nff, obj, ply, stl, test, toml");
    refused(&files, "none", "", "glb, gltf, nff, obj, ply, stl, test, toml");
    for name in ["empty.ply", "empty.stl", "empty.gltf", "empty.glb", "empty.nff", "empty.test", "empty.toml"] {
        refused_bytes(name, "", "", "empty");
    }
    refused_bytes("a.obj", "ply\nformat", "", "this is a .ply file");
    refused_bytes("a.stl", "glTF\x02\0\0\0", "", "this is a .glb file");
    for suffix in ["obj", "ply", "stl", "glb", "gltf", "nff", "test", "toml"] {
        let files = Files::one(&format!("noise.{suffix}"), [0x9e, 0, 0xff, b'\n', 7, 0x80, 0]);
        assert!(load(&files.path(&format!("noise.{suffix}")), &LoadOptions::default()).is_err(), "{suffix}");
    }
}

#[test]
fn suffixes_are_known_in_any_case() {
    assert_eq!(Files::one("a.OBJ", TRIANGLE).scene("a.OBJ").primitive_count(), 1);
}

/// Files of Windows end their lines in `\r\n`, of the old Macintosh in `\r`: both hold the same scene, and what is
/// wrong is in the same line.
#[test]
fn lines_end_in_any_way() {
    let ply = "ply\nformat ascii 1.0\ncomment \\\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let stl = "solid a b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a b\n";
    let nff = "# a b\nf 1 0 0 1 0 1 0 1\np 3\n0 0 0\n1 0 0\n0 1 0\n";
    let course = "# a b\nsize 10 10\ncamera 0 0 5 0 0 0 0 1 0 40\nmaxverts 3\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\ntri 0 1 2\n";
    let obj = "# a b\nmtllib a.mtl\nv 0 0 0\nv 1 \\\n0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    let mtl = "newmtl grey\nKd 1 1 1\nnewmtl red\nKd 1 0 0\n";
    for end in ["\n", "\r\n", "\r"] {
        let ended = |text: &str| text.replace('\n', end);
        for (name, text) in [("a.ply", ply), ("a.stl", stl), ("a.nff", nff), ("a.test", course), ("a.obj", obj)] {
            let files = Files::one(name, ended(text)).and("a.mtl", ended(mtl));
            let scene = files.scene(name);
            assert_eq!(corners(meshes(&scene)[0]), [[Vec3::ZERO, Vec3::X, Vec3::Y]], "{name}, {end:?}");
            if name == "a.obj" {
                assert_eq!(scene.materials[meshes(&scene)[0].material as usize].diffuse, Vec3::X);
            }
            let at = text.rfind("0 1 0").expect("a vertex");
            let wrong = format!("{}0 x 0{}", &text[..at], &text[at + 5..]);
            let line = 1 + text[..at].matches('\n').count();
            let words = if name == "a.obj" { "v needs 3 numbers" } else { "\"x\"" };
            refused_bytes(name, ended(&wrong), &format!("line {line}"), words);
        }
    }
    // Behind a header whose lines end in `\r`, a `\n` belongs to the body.
    let header = "ply\rformat binary_little_endian 1.0\relement vertex 3\rproperty uchar x\rproperty uchar y\rproperty uchar z\relement face 1\r\
                  property list uchar uchar vertex_indices\rend_header\r";
    let body = [b'\n', 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2];
    let scene = Files::one("a.ply", [header.as_bytes(), &body].concat()).scene("a.ply");
    assert_eq!(corners(meshes(&scene)[0]), [[Vec3::X * 10.0, Vec3::X, Vec3::Y]]);
}

#[test]
fn a_scene_without_triangles_is_refused() {
    refused_bytes("a.obj", "v 0 0 0\n", "", "nothing to render");
    refused_bytes("a.stl", "solid a\nendsolid a\n", "", "nothing to render");
    // What was left out may be why.
    refused_bytes("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\nfo 1\n", "", "line 3: 1 points or lines");
}

#[test]
fn axes_and_units() {
    let files = Files::one("a.obj", "v 0 0 0\nv 1 2 3\nv 0 1 0\nf 1 2 3\n");
    let bounds = |up_axis, unit| {
        let options = LoadOptions { up_axis, unit, ..LoadOptions::default() };
        let bounds = load(&files.path("a.obj"), &options).unwrap().0.bounds();
        (bounds.min, bounds.max)
    };
    assert_eq!(bounds(UpAxis::Y, Unit::Metre), (DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(bounds(UpAxis::Z, Unit::Metre), (DVec3::new(0.0, 0.0, -2.0), DVec3::new(1.0, 3.0, 0.0)));
    assert_eq!(bounds(UpAxis::Y, Unit::Inch).1, DVec3::new(0.0254, 0.0508, 3.0 * 0.0254));
    assert_eq!(bounds(UpAxis::Z, Unit::Millimetre).1, DVec3::new(0.001, 0.003, 0.0));
}

#[test]
fn a_turn_of_the_axes_copies_nothing() {
    let text = "v 1 2 3\nv 4 5 6\nv 7 8 0\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\n";
    let files = Files::one("a.obj", text);
    let options = LoadOptions { up_axis: UpAxis::Z, ..LoadOptions::default() };
    let scene = load(&files.path("a.obj"), &options).unwrap().0;
    let expected = [[1.0, 3.0, -2.0], [4.0, 6.0, -5.0], [7.0, 0.0, -8.0]].map(Vec3::from);
    assert_eq!(corners(meshes(&scene)[0]), [expected]);
    assert_eq!(meshes(&scene)[0].normals[0], Vec3::new(0.0, 0.8, -0.6));
    let world = twincast::World::new(&scene).unwrap();
    let twincast::trace::Primitives::Triangles { positions, .. } = &world.parts[0].primitives else { panic!() };
    assert!(std::sync::Arc::ptr_eq(positions, &meshes(&scene)[0].positions));
}

#[test]
fn normals_on_request() {
    // A roof whose halves share no vertices: texture coordinates differ.
    let roof =
        "v 0 0 0\nv 0 0 1\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 1\nvn 1 0 0\nf 1/1/1 2/1/1 3/1/1\nf 2/2/1 1/2/1 4/2/1\n";
    let files = Files::one("a.obj", roof);
    let normals = |normals| {
        let options = LoadOptions { normals, ..LoadOptions::default() };
        meshes(&load(&files.path("a.obj"), &options).unwrap().0)[0].normals.clone()
    };
    assert_eq!(normals(Normals::File), [Vec3::X; 6]);
    assert_eq!(normals(Normals::Flat), []);
    let smooth = normals(Normals::Smooth);
    let (left, right) = (Vec3::new(-1.0, 1.0, 0.0).normalize(), Vec3::new(1.0, 1.0, 0.0).normalize());
    // Both halves meet at the first two vertices, where the mean points down or up, as their order has it.
    let mean = smooth[0];
    assert!((mean.x.abs() < 1e-6) && (mean.y.abs() - 1.0).abs() < 1e-6, "{smooth:?}");
    assert_eq!(smooth[0], smooth[4]);
    let along = |n: Vec3, side: Vec3| (n.dot(side).abs() - 1.0).abs() < 1e-6;
    assert!(along(smooth[2], left) && along(smooth[5], right), "{smooth:?}");
}

#[test]
fn triangles_with_corners_that_are_not_finite_are_counted() {
    let obj = format!("{TRIANGLE}v nan 0 0\nv inf 0 0\nf 1 2 4\nf 1 2 5\nf 1 4 5\n");
    let (scene, warnings) = Files::one("a.obj", obj).load("a.obj");
    assert_eq!(scene.primitive_count(), 4);
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].message.contains("3 triangles"), "{}", warnings[0]);
    assert!(scene.bounds().max == DVec3::new(1.0, 1.0, 0.0));
}

/// Models of others, kept beside the project. None, and a message, where they are missing.
pub fn model(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/models").join(name);
    if !path.is_file() {
        skip(format_args!("{} is missing", path.display()));
        return None;
    }
    Some(path)
}
