//! STL, text and binary.

use twincast::math::Vec3;

use super::{Files, corners, meshes, refused_bytes};

const FACETS: [[[f32; 3]; 3]; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-0.0, 1.0, 0.0]]];

pub fn binary(title: &[u8]) -> Vec<u8> {
    let mut bytes = title.to_vec();
    bytes.resize(80, 0);
    bytes.extend((FACETS.len() as u32).to_le_bytes());
    for facet in FACETS {
        bytes.extend([0u8; 12]);
        bytes.extend(facet.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

pub fn text() -> String {
    let vertex = |[x, y, z]: [f32; 3]| format!("    vertex {x} {y:e} {z}\n");
    let facet = |f: [[f32; 3]; 3]| {
        format!("  facet normal 0 0 1\n   outer loop\n{}   endloop\n  endfacet\n", f.map(vertex).concat())
    };
    format!("solid two words\n{}endsolid two words\n", FACETS.map(facet).concat())
}

#[test]
fn both_kinds_hold_the_same() {
    let upper = text().to_uppercase();
    let kinds = [binary(b"made by hand"), binary(b"solid facet"), text().into_bytes(), upper.into_bytes()];
    for bytes in kinds {
        let scene = Files::one("a.stl", bytes).scene("a.stl");
        let mesh = meshes(&scene)[0];
        assert_eq!(corners(mesh), FACETS.map(|f| f.map(Vec3::from)));
        assert_eq!((mesh.positions.len(), mesh.normals.len()), (4, 0), "equal corners are one vertex");
    }
    assert_eq!(meshes(&Files::one("a.stl", text()).scene("a.stl"))[0].name, "two words");
    // Normals are not read, whatever a program makes of none; and some programs put a mark before the text.
    let odd = format!("\u{feff}{}", text().replace("normal 0 0 1", "normal -nan(ind) -1.#IND nan"));
    assert_eq!(corners(meshes(&Files::one("a.stl", odd).scene("a.stl"))[0]), FACETS.map(|f| f.map(Vec3::from)));
}

#[test]
fn solids_of_a_text_are_meshes() {
    let all = format!("solid nothing\nendsolid nothing\n{}{}", text(), text().replace("two words", "other"));
    let scene = Files::one("a.stl", all).scene("a.stl");
    let names: Vec<_> = meshes(&scene).iter().map(|mesh| mesh.name.as_str()).collect();
    assert_eq!(names, ["two words", "other"]);
    for mesh in meshes(&scene) {
        assert_eq!((mesh.positions.len(), corners(mesh)), (4, FACETS.map(|f| f.map(Vec3::from)).to_vec()));
    }
}

#[test]
fn bytes_after_the_end_are_a_warning() {
    let mut bytes = binary(b"x");
    bytes.extend([0; 7]);
    let (scene, warnings) = Files::one("a.stl", bytes).load("a.stl");
    assert_eq!(scene.primitive_count(), 2);
    assert!(warnings.len() == 1 && warnings[0].message.contains("7 bytes"), "{warnings:?}");
}

#[test]
fn faults_are_told_with_their_place() {
    let mut bytes = binary(b"solid");
    bytes.pop();
    refused_bytes("a.stl", &bytes, "byte 80", "promises 2 triangles of 50 bytes, but the file has room for 1");
    bytes[80..84].fill(0xff);
    refused_bytes("a.stl", &bytes, "byte 80", "promises 4294967295 triangles");
    refused_bytes("a.stl", "short\x01", "byte 0", "no STL file");
    // Texts of other kinds, short and long, and one that says nothing.
    let wavefront = "v 0.5 0.25 0.125\n".repeat(50);
    for text in ["short", "solid", "# exported\nsolid a\n", &wavefront] {
        refused_bytes("a.stl", text, "line 1", "is text, but no STL");
    }
    refused_bytes(
        "a.stl",
        text().replacen("vertex 0 0e0 0", "vertex 0 0 zero", 1),
        "line 4",
        "\"zero\" where a number",
    );
    refused_bytes("a.stl", text().replacen("outer", "inner", 1), "line 3", "\"inner\" where outer");
    let cut = text();
    refused_bytes("a.stl", &cut[..cut.len() - 30], "line 14", "the file ends where endfacet");
}

/// The one place where a text may be cut and still be read.
#[test]
fn a_solid_without_an_end_is_told() {
    let whole = text();
    let cut = whole.replace("endsolid two words\n", "");
    let (scene, warnings) = Files::one("a.stl", &cut).load("a.stl");
    assert_eq!(scene.primitive_count(), FACETS.len() as u64);
    assert!(warnings.len() == 1 && warnings[0].message.contains("without endsolid"), "{warnings:?}");
}
