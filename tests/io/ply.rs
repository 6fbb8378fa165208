//! PLY, in its three encodings.

use twincast::math::{DVec3, Vec2, Vec3, Vec4};
use twincast::scene::Mesh;

use super::{Files, corners, meshes, refused_bytes};

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

fn header(format: &str, vertices: u64, faces: u64) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn ascii() -> String {
    let vertices: String = SQUARE.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    format!("{}{vertices}3 0 1 2\n3 0 2 3\n", header("ascii", 4, 2))
}

pub fn binary(big: bool) -> Vec<u8> {
    let mut bytes = header(if big { "binary_big_endian" } else { "binary_little_endian" }, 4, 2).into_bytes();
    let word = |w: u32| if big { w.to_be_bytes() } else { w.to_le_bytes() };
    bytes.extend(SQUARE.iter().flatten().flat_map(|x| word(x.to_bits())));
    for face in [[0, 1, 2], [0, 2, 3]] {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|&i| word(i)));
    }
    bytes
}

#[test]
fn all_encodings_hold_the_same() {
    let [a, b, c, d] = SQUARE.map(Vec3::from);
    for bytes in [ascii().into_bytes(), ascii().replace('\n', "\r\n").into_bytes(), binary(false), binary(true)] {
        let scene = Files::one("a.ply", bytes).scene("a.ply");
        assert_eq!(corners(meshes(&scene)[0]), [[a, b, c], [a, c, d]]);
        assert_eq!(meshes(&scene)[0].positions.len(), 4);
    }
}

#[test]
fn attributes_and_what_is_skipped() {
    let text = "ply\nformat ascii 1.0\nelement camera 1\nproperty list int float extra\nproperty uchar q\n\
        element vertex 3\nproperty float z\nproperty double x\nproperty float y\nproperty float nx\nproperty float ny\n\
        property float nz\nproperty list uchar int junk\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
        property uchar alpha\nproperty float s\nproperty float t\nelement edge 1\nproperty int a\nproperty int b\n\
        element face 1\nproperty int flags\nproperty list uint ushort vertex_index\nend_header\n\
        2 0.5 0.5 9\n\
        0 0 0 0 0 2 1 7 255 0 119 51 0.25 0.5\n0 1 0 0 0 1 0 0 0 0 255 0 0\n0 0 1 0 0 1 0 0 0 0 255 1 1\n5 6\n7 3 0 1 2\n";
    let scene = Files::one("a.ply", text).scene("a.ply");
    let mesh = meshes(&scene)[0];
    assert_eq!(corners(mesh), [[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    assert_eq!((&mesh.normals[..], mesh.uvs[0]), (&[Vec3::Z; 3][..], Vec2::new(0.25, 0.5)));
    assert!(mesh.colors[0].abs_diff_eq(Vec4::new(1.0, 0.0, 0.1845, 0.2), 1e-3), "{}", mesh.colors[0]);
    assert_eq!(scene.materials[0].diffuse, Vec3::ONE);
}

/// NumPy's whole numbers, as meshio and trimesh write them: skipped where they mean nothing here, and as indices.
#[test]
fn whole_numbers_of_64_bits() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property int64 label\nelement face 2\nproperty list uint8 uint64 vertex_indices\nproperty int64 part\nend_header\n";
    let mut bytes = header.as_bytes().to_vec();
    for (corner, label) in SQUARE.iter().zip(-2i64..) {
        bytes.extend(corner.iter().flat_map(|x| x.to_le_bytes()).chain(label.to_le_bytes()));
    }
    for face in [[0u64, 1, 2], [0, 2, 3]] {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|i| i.to_le_bytes()).chain(7i64.to_le_bytes()));
    }
    let text = header.replace("binary_little_endian", "ascii")
        + "0 0 0 -2\n1 0 0 -1\n1 1 0 0\n0 1 0 9000000000\n3 0 1 2 7\n3 0 2 3 7\n";
    let [a, b, c, d] = SQUARE.map(Vec3::from);
    for bytes in [bytes, text.into_bytes()] {
        let scene = Files::one("a.ply", bytes).scene("a.ply");
        assert_eq!(corners(meshes(&scene)[0]), [[a, b, c], [a, c, d]]);
    }
}

/// MeshLab names its texture in a comment.
#[test]
fn a_texture_that_a_comment_names() {
    let text = |comments: &str, of_face: &str, values: &str| {
        format!(
            "ply\nformat ascii 1.0\n{comments}element vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property float texture_u\nproperty float texture_v\nelement face 1\n\
             property list uchar int vertex_indices\n{of_face}end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2{values}\n"
        )
    };
    let named = "comment TextureFile my picture.png\n";
    let scene = Files::one("a.ply", text(named, "", "")).and("my picture.png", super::obj::picture()).scene("a.ply");
    assert_eq!((scene.materials[0].diffuse_texture, scene.textures.len()), (Some(0), 1));
    assert_eq!((scene.materials[0].diffuse, meshes(&scene)[0].uvs[1]), (Vec3::ONE, Vec2::X));
    for (text, place, words) in [
        (text(named, "", ""), "line 3", "my picture.png\" is missing"),
        (text(named, "", "").replace("texture_u", "other"), "line 3", "neither vertices nor faces have them"),
        (text(&named.repeat(2), "", ""), "line 3", "several textures"),
    ] {
        let (scene, warnings) = Files::one("a.ply", text).load("a.ply");
        assert_eq!((scene.primitive_count(), scene.textures.len()), (1, 0));
        let [warning] = &warnings[..] else { panic!("{words}: {warnings:?}") };
        assert!(warning.place == place && warning.message.contains(words), "{warning}");
    }
}

/// Faces over two squares side by side, in the three encodings: their corners, and the values of the properties that
/// are declared. Vertices may have properties that are bytes, which are 200.
fn with_faces(comments: &str, of_vertex: &str, of_face: &str, faces: [(&[u32], &[Value]); 3]) -> [Vec<u8>; 3] {
    let vertices = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0], [2.0, 1.0]];
    let mut values = Vec::new();
    for [x, y] in vertices {
        values.extend([x, y, 0.0].map(Value::Float));
        values.extend(of_vertex.lines().map(|_| Value::Byte(200)));
    }
    for (corners, of_face) in faces {
        values.extend(list(corners));
        values.extend(of_face);
    }
    let head = format!(
        "{comments}element vertex 6\nproperty float x\nproperty float y\nproperty float z\n{of_vertex}element face 3\n\
         property list uchar int vertex_indices\n{of_face}"
    );
    encoded(&head, &values)
}

/// A file of these values, in the three encodings.
fn encoded(head: &str, values: &[Value]) -> [Vec<u8>; 3] {
    let all = |encoding: &str, bytes: &dyn Fn(&Value) -> Vec<u8>| {
        let head = format!("ply\nformat {encoding} 1.0\n{head}end_header\n");
        head.bytes().chain(values.iter().flat_map(bytes)).collect()
    };
    let reversed = |value: &Value| value.bytes().into_iter().rev().collect();
    [
        all("ascii", &|value| value.text().into()),
        all("binary_little_endian", &|value| value.bytes()),
        all("binary_big_endian", &reversed),
    ]
}

fn list(corners: &[u32]) -> Vec<Value> {
    [Value::Byte(corners.len() as u8)].into_iter().chain(corners.iter().map(|&i| Value::Int(i as i32))).collect()
}

/// A value in a PLY file.
#[derive(Clone, Copy)]
enum Value {
    Byte(u8),
    Int(i32),
    Float(f32),
}

impl Value {
    fn text(self) -> String {
        match self {
            Self::Byte(value) => format!("{value} "),
            Self::Int(value) => format!("{value} "),
            Self::Float(value) => format!("{value}\n"),
        }
    }

    /// Little-endian.
    fn bytes(self) -> Vec<u8> {
        match self {
            Self::Byte(value) => vec![value],
            Self::Int(value) => value.to_le_bytes().to_vec(),
            Self::Float(value) => value.to_le_bytes().to_vec(),
        }
    }
}

/// Texture coordinates as MeshLab and OpenMVS write them: at a face's corners.
fn coordinates(uvs: &[[f32; 2]], number: Option<i32>) -> Vec<Value> {
    let list =
        [Value::Byte(2 * uvs.len() as u8)].into_iter().chain(uvs.as_flattened().iter().map(|&x| Value::Float(x)));
    list.chain(number.map(Value::Int)).collect()
}

const TEXCOORD: &str = "property list uchar float texcoord\n";

/// A seam runs between the triangles, none between the second and the square.
#[test]
fn texture_coordinates_of_faces() {
    let uvs: [&[[f32; 2]]; 3] = [
        &[[0.0, 0.0], [0.5, 0.0], [0.5, 0.5]],
        &[[0.75, 0.0], [0.875, 0.5], [0.75, 0.5]],
        &[[0.5, 0.0], [1.0, 0.0], [1.0, 0.5], [0.875, 0.5]],
    ];
    let values = uvs.map(|uvs| coordinates(uvs, None));
    let faces = [(&[0, 1, 2][..], &values[0][..]), (&[0, 2, 3], &values[1]), (&[1, 4, 5, 2], &values[2])];
    let named = "comment TextureFile my picture.png\n";
    for bytes in with_faces(named, "", TEXCOORD, faces) {
        let scene = Files::one("a.ply", bytes).and("my picture.png", super::obj::picture()).scene("a.ply");
        let mesh = meshes(&scene)[0];
        let found: Vec<_> = mesh.triangles.iter().map(|t| t.map(|i| mesh.uvs[i as usize].to_array())).collect();
        let [a, b, c] = uvs;
        assert_eq!(found[..2], [[a[0], a[1], a[2]], [b[0], b[1], b[2]]]);
        // However the square is divided, its corners are where they were.
        for (&corner, uv) in mesh.triangles[2..].as_flattened().iter().zip(found[2..].as_flattened()) {
            let place = mesh.positions[corner as usize].truncate();
            let k = [Vec2::X, Vec2::new(2.0, 0.0), Vec2::new(2.0, 1.0), Vec2::ONE].iter().position(|p| *p == place);
            assert_eq!(*uv, c[k.unwrap()]);
        }
        // Two vertices at (0, 0), two at (1, 1), one at each of the others.
        assert_eq!((mesh.positions.len(), found.len()), (8, 4));
        assert_eq!((scene.materials[0].diffuse_texture, scene.materials[0].diffuse), (Some(0), Vec3::ONE));
    }
    // A list of another length is none.
    for bytes in with_faces(named, "", TEXCOORD, [faces[0], (&[0, 2, 3, 1], &values[1]), faces[2]]) {
        let (scene, warnings) = Files::one("a.ply", bytes).and("my picture.png", super::obj::picture()).load("a.ply");
        let [warning] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(warning.message.starts_with("1 faces whose texcoord"), "{warning}");
        assert_eq!((scene.primitive_count(), scene.textures.len()), (5, 1));
    }
}

#[test]
fn several_textures() {
    let uvs: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let [one, none, two] = [Some(1), Some(-1), Some(2)].map(|number| coordinates(&uvs[..3], number));
    let zero = coordinates(&uvs, Some(0));
    let property = format!("{TEXCOORD}property int texnumber\n");
    let named = "comment TextureFile a.png\ncomment TextureFile b.png\n";
    let load = |second: &[Value], bytes: usize| {
        let faces = [(&[0, 1, 2][..], &one[..]), (&[0, 2, 3], second), (&[1, 4, 5, 2], &zero)];
        let bytes = with_faces(named, "", &property, faces)[bytes].clone();
        Files::one("a.ply", bytes).and("a.png", super::obj::picture()).and("b.png", super::obj::picture()).load("a.ply")
    };
    for encoding in 0..3 {
        let (scene, warnings) = load(&none, encoding);
        assert_eq!(warnings, []);
        let names: Vec<_> = scene.files[scene.files.len() - 2..].iter().map(|file| file.file_name().unwrap()).collect();
        assert_eq!(names, ["a.png", "b.png"]);
        // The square, the first triangle, and the one that has no texture.
        let [square, first, bare] = meshes(&scene)[..] else { panic!("three meshes are expected") };
        let of = |mesh: &Mesh| scene.materials[mesh.material as usize].diffuse_texture;
        assert_eq!([square, first, bare].map(of), [Some(0), Some(1), None]);
        assert_eq!(corners(first), [[Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)]]);
        assert_eq!(corners(bare), [[Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]]);
        assert_eq!((square.positions.len(), square.triangles.len(), first.positions.len()), (4, 2, 3));
        let (scene, warnings) = load(&two, encoding);
        let [warning] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(warning.message.contains("1 triangles have a texnumber past the last TextureFile, 1"), "{warning}");
        assert_eq!((scene.textures.len(), scene.materials[2].diffuse_texture), (2, None));
    }
}

/// Triangles alone are read at once from binary files, and one by one from text; whatever comes first in a face.
#[test]
fn triangles_with_texture_coordinates_at_once() {
    let head = "comment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 3\n";
    let [texcoord, number, indices] =
        [TEXCOORD, "property uchar texnumber\n", "property list uchar int vertex_indices\n"];
    let vertices = SQUARE.as_flattened().iter().map(|&x| Value::Float(x));
    let faces =
        [([0, 1, 2], [[0.0, 0.0], [0.5, 0.0], [0.5, 0.5]], 1), ([0, 2, 3], [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]], 1)];
    let faces = faces.into_iter().chain([([1, 2, 3], [[0.25, 0.0], [0.5, 0.5], [1.0, 0.0]], 0)]);
    for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
        let head = order.iter().fold(head.to_owned(), |head, &k| head + [texcoord, number, indices][k]);
        let of_face = |(corners, uvs, number): ([u32; 3], [[f32; 2]; 3], u8)| {
            let parts = [coordinates(&uvs, None), vec![Value::Byte(number)], list(&corners)];
            order.iter().flat_map(|&k| parts[k].clone()).collect::<Vec<_>>()
        };
        let values: Vec<_> = vertices.clone().chain(faces.clone().flat_map(of_face)).collect();
        let found = encoded(&head, &values).map(|bytes| {
            let files =
                Files::one("a.ply", bytes).and("a.png", super::obj::picture()).and("b.png", super::obj::picture());
            let scene = files.scene("a.ply");
            meshes(&scene)
                .iter()
                .map(|mesh| (corners(mesh), mesh.triangles.to_vec(), mesh.uvs.clone()))
                .collect::<Vec<_>>()
        });
        let [text, little, big] = &found;
        assert!(text == little && text == big, "{found:?}");
        // Of texture 0 the last face; of texture 1 the others, which share two vertices.
        assert_eq!((text[0].0.len(), text[0].2.len(), text[1].0.len(), text[1].2.len()), (1, 3, 2, 4));
        assert_eq!(text[1].2[3], Vec2::X);
    }
}

/// As of segmented meshes.
#[test]
fn colours_of_faces() {
    let colors = ["red", "green", "blue"].map(|name| format!("property uchar {name}\n")).concat();
    let [red, blue] = [[255, 0, 0], [0, 0, 255]].map(|rgb: [u8; 3]| rgb.map(Value::Byte));
    let faces = [(&[0, 1, 2][..], &red[..]), (&[0, 2, 3], &blue), (&[1, 4, 5, 2], &red)];
    for bytes in with_faces("", "", &colors, faces) {
        let scene = Files::one("a.ply", bytes).scene("a.ply");
        let mesh = meshes(&scene)[0];
        let of = |i: u32| mesh.colors[i as usize].truncate();
        let found: Vec<_> = mesh.triangles.iter().map(|t| t.map(of)).collect();
        assert_eq!(found, [[Vec3::X; 3], [Vec3::Z; 3], [Vec3::X; 3], [Vec3::X; 3]]);
        // The square shares two vertices with the red triangle, the blue one none.
        assert_eq!((mesh.positions.len(), scene.materials[0].diffuse), (8, Vec3::ONE));
    }
    // Triangles alone are read at once from binary files.
    let alpha = format!("{colors}property uchar alpha\n");
    let clear = [[255, 0, 0, 255], [0, 128, 255, 51], [255, 0, 0, 255]].map(|rgba: [u8; 4]| rgba.map(Value::Byte));
    let faces_alone = [(&[0, 1, 2][..], &clear[0][..]), (&[0, 2, 3], &clear[1]), (&[1, 4, 5], &clear[2])];
    let found = with_faces("", "", &alpha, faces_alone).map(|bytes| {
        let scene = Files::one("a.ply", bytes).scene("a.ply");
        let mesh = meshes(&scene)[0];
        (corners(mesh), mesh.triangles.to_vec(), mesh.colors.clone())
    });
    assert!(found[0] == found[1] && found[0] == found[2], "{found:?}");
    let colors_of: Vec<Vec4> = [0, 3, 6].map(|k| found[0].2[k.min(found[0].2.len() - 1)]).to_vec();
    assert!(colors_of[0].abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-6), "{colors_of:?}");
    assert!(colors_of[1].abs_diff_eq(Vec4::new(0.0, 0.2159, 1.0, 0.2), 1e-3), "{colors_of:?}");
    for bytes in with_faces("", &colors, &colors, faces) {
        let (scene, warnings) = Files::one("a.ply", bytes).load("a.ply");
        let [warning] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(warning.place == "line 10" && warning.message.contains("vertices have colours as well"), "{warning}");
        let mesh = meshes(&scene)[0];
        assert!(
            mesh.positions.len() == 6 && mesh.colors.iter().all(|c| *c == mesh.colors[0] && c.x == c.y && c.x < 1.0)
        );
    }
}

#[test]
fn binary_attributes_are_those_of_the_text() {
    let header = |format: &str, list: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty short q\nproperty float z\nproperty double x\n\
            property float y\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
            property ushort green\nproperty float blue\nproperty uchar alpha\nproperty float s\nproperty float t\n{list}\
            element face 2\nproperty int flags\nproperty list uchar uint vertex_index\nproperty char quality\nend_header\n"
        )
    };
    let floats = |i: f32| [2.0 * i, 0.5 - i, i, i * 0.25];
    let mut text = header("ascii", "");
    for i in 0..3u8 {
        let [a, b, c, d] = floats(f32::from(i));
        text += &format!("-{i} {a} {d}5 {b} {c} 1 {d} {} {} {d} {} {a} {b}\n", 80 * i, 20_000 * u16::from(i), 100 + i);
    }
    let text = Files::one("a.ply", text + "7 3 0 1 2 -1\n9 3 2 1 0 -1\n").scene("a.ply");
    // Without a list among a vertex's properties they are read at once, with one they are read one by one.
    for (big, list) in [(false, false), (true, false), (false, true), (true, true)] {
        let format = if big { "binary_big_endian" } else { "binary_little_endian" };
        let mut bytes = header(format, if list { "property list uchar uchar l\n" } else { "" }).into_bytes();
        let mut put = |word: &[u8]| match big {
            true => bytes.extend(word.iter().rev()),
            false => bytes.extend(word),
        };
        for i in 0..3u8 {
            let [a, b, c, d] = floats(f32::from(i));
            put(&(-i16::from(i)).to_le_bytes());
            put(&a.to_le_bytes());
            put(&format!("{d}5").parse::<f64>().unwrap().to_le_bytes());
            [b, c, 1.0, d].iter().for_each(|x| put(&x.to_le_bytes()));
            put(&[80 * i]);
            put(&(20_000 * u16::from(i)).to_le_bytes());
            put(&d.to_le_bytes());
            put(&[100 + i]);
            [a, b].iter().for_each(|x| put(&x.to_le_bytes()));
            if list {
                [1, 9].iter().for_each(|&x| put(&[x]));
            }
        }
        for (flags, face) in [(7i32, [0u32, 1, 2]), (9, [2, 1, 0])] {
            put(&flags.to_le_bytes());
            put(&[3]);
            face.iter().for_each(|i| put(&i.to_le_bytes()));
            put(&[0xff]);
        }
        let scene = Files::one("a.ply", bytes).scene("a.ply");
        let (mesh, expected) = (meshes(&scene)[0], meshes(&text)[0]);
        assert_eq!(
            (mesh.origin, &mesh.positions, &mesh.triangles),
            (expected.origin, &expected.positions, &expected.triangles)
        );
        assert_eq!((&mesh.normals, &mesh.uvs, &mesh.colors), (&expected.normals, &expected.uvs, &expected.colors));
        assert_eq!(mesh.positions[1], Vec3::new(0.255, -0.5, 2.0));
    }
}

/// Bytes in floating point are told, not guessed.
#[test]
fn colours_above_one_and_clouds_are_told() {
    let colors = ["red", "green", "blue"].map(|name| format!("property float {name}\n")).concat();
    let head = header("ascii", 3, 1).replace("property float z\n", &format!("property float z\n{colors}"));
    let (scene, warnings) =
        Files::one("a.ply", head + "0 0 0 200 100 0\n1 0 0 0 0 0\n0 1 0 1 1 1\n3 0 1 2\n").load("a.ply");
    assert_eq!(meshes(&scene)[0].colors[0], Vec4::new(200.0, 100.0, 0.0, 1.0));
    let [warning] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.message.contains("go up to 200"), "{warning}");
    let cloud = header("ascii", 2, 0) + "0 0 0\n1 0 0\n";
    refused_bytes("a.ply", cloud, "", "2 vertices without faces");
}

/// Some write bytes as words.
#[test]
fn colours_of_32_bits_are_those_of_8() {
    let text = |scalar: &str| {
        let colours = ["red", "green", "blue", "alpha"].map(|name| format!("property {scalar} {name}\n")).concat();
        let head = header("ascii", 3, 1).replace("property float z\n", &format!("property float z\n{colours}"));
        head + "0 0 0 255 128 0 255\n1 0 0 1 2 3 128\n0 1 0 0 0 0 0\n3 0 1 2\n"
    };
    let of = |scalar| meshes(&Files::one("a.ply", text(scalar)).scene("a.ply"))[0].colors.clone();
    let (expected, words) = (of("uchar"), [of("int"), of("uint")]);
    for colors in words {
        assert_eq!(colors.len(), 3);
        let differs = colors.iter().zip(&expected).map(|(a, b)| (*a - *b).abs().max_element());
        assert!(differs.fold(0.0, f32::max) < 1e-6, "{colors:?}, {expected:?}");
    }
}

#[test]
fn polygons_and_strips() {
    let vertices = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let text = format!("{}{vertices}4 0 1 2 3\n2 0 1\n", header("ascii", 4, 2));
    let (scene, warnings) = Files::one("a.ply", text).load("a.ply");
    assert_eq!(scene.primitive_count(), 2);
    assert!(warnings.len() == 1 && warnings[0].message.contains("1 faces"), "{warnings:?}");
    let strips = header("ascii", 4, 1).replace("element face", "element tristrips");
    let scene = Files::one("a.ply", format!("{strips}{vertices}7 0 1 2 3 -1 0 1\n")).scene("a.ply");
    let [a, b, c, d] = SQUARE.map(Vec3::from);
    assert_eq!(corners(meshes(&scene)[0]), [[a, b, c], [c, b, d]]);
    // Strips before faces: neither takes the other's place.
    let both = strips.replace("end_header", "element face 1\nproperty list uchar int vertex_indices\nend_header");
    let scene = Files::one("a.ply", format!("{both}{vertices}4 0 1 2 3\n3 0 2 3\n")).scene("a.ply");
    assert_eq!(corners(meshes(&scene)[0]), [[a, b, c], [c, b, d], [a, c, d]]);
    let mut bytes = both.replace("ascii", "binary_big_endian").into_bytes();
    bytes.extend(SQUARE.iter().flatten().flat_map(|x| x.to_be_bytes()));
    for list in [&[0i32, 1, 2, 3][..], &[0, 2, 3]] {
        bytes.push(list.len() as u8);
        bytes.extend(list.iter().flat_map(|i| i.to_be_bytes()));
    }
    let scene = Files::one("a.ply", bytes).scene("a.ply");
    assert_eq!(corners(meshes(&scene)[0]), [[a, b, c], [c, b, d], [a, c, d]]);
    // Triangles, a quadrilateral, then a triangle: from the fast path to the slow one.
    let mut bytes = header("binary_little_endian", 4, 3).into_bytes();
    bytes.extend(SQUARE.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for face in [&[0i32, 1, 2][..], &[0, 1, 2, 3], &[1, 2, 3]] {
        bytes.push(face.len() as u8);
        bytes.extend(face.iter().flat_map(|i| i.to_le_bytes()));
    }
    let scene = Files::one("a.ply", bytes).scene("a.ply");
    assert_eq!(corners(meshes(&scene)[0]), [[a, b, c], [a, b, c], [a, c, d], [b, c, d]]);
}

#[test]
fn doubles_far_away_keep_the_shape() {
    let text = header("ascii", 3, 1).replace("property float", "property double");
    let text = format!("{text}10000000.001 0 0\n10000000.002 0 0\n10000000.001 0.001 0\n3 0 1 2\n");
    let scene = Files::one("a.ply", text).scene("a.ply");
    let mesh = meshes(&scene)[0];
    assert!(mesh.origin.abs_diff_eq(DVec3::new(1e7, 0.0, 0.0), 1.0));
    assert!(((mesh.positions[1] - mesh.positions[0]).x - 0.001).abs() < 1e-8);
}

/// More than the header says is no reason to take less of it without a word.
#[test]
fn what_comes_after_the_last_element_is_told() {
    let warned = |bytes: Vec<u8>| Files::one("a.ply", bytes).load("a.ply").1;
    let more = |mut bytes: Vec<u8>, more: &[u8]| {
        bytes.extend_from_slice(more);
        bytes
    };
    for bytes in [more(ascii().into(), b"3 0 1 3\n"), more(binary(false), b"1234567"), more(binary(true), b"1234567")] {
        let warnings = warned(bytes);
        assert!(warnings.len() == 1 && warnings[0].message.starts_with("7 bytes after"), "{warnings:?}");
    }
    for bytes in [more(ascii().into(), b"\n \n"), binary(false)] {
        assert!(warned(bytes).is_empty());
    }
}

#[test]
fn faults_are_told_with_their_place() {
    let fault = |bytes: Vec<u8>, place: &str, words: &str| refused_bytes("a.ply", bytes, place, words);
    let start = header("binary_little_endian", 4, 2).len();
    fault(header("binary_little_endian", 4_000_000_000, 2).into(), "line 4", "promises 4000000000 items");
    fault(header("ascii", 4_000_000_000, 2).into(), "line 4", "promises 4000000000 items");
    fault(header("binary_big_endian", u64::MAX, 2).into(), "line 4", "promises");
    let mut truncated = binary(false);
    truncated.truncate(truncated.len() - 13);
    fault(truncated, &format!("byte {}", start + 4 * 12 + 13), "ends before its last element");
    let mut far = binary(false);
    far[start + 48 + 1] = 200;
    fault(far, &format!("byte {}", start + 48 + 13), "index 200 is not one of the 4 vertices");
    fault(ascii().replace("3 0 2 3", "3 0 2 4").into(), "line 16", "index 4");
    fault(ascii().replace("3 0 2 3", "3 0 2 -1").into(), "line 16", "index -1");
    fault(ascii().replace("3 0 2 3", "3 0 2").into(), "line 16", "ends before");
    fault(ascii().replace("3 0 2 3", "300000 0 2 3").into(), "line 16", "300000 entries");
    fault(ascii().replace("3 0 2 3", "3 0 two 3").into(), "line 16", "\"two\" is not a number");
    fault(ascii().replace("format ascii", "format text").into(), "line 2", "binary_big_endian");
    fault(ascii().replace("float x", "real x").into(), "line 5", "\"real\" is no type");
    fault(ascii().replace("float x", "float q").into(), "line 4", "x, y and z");
    fault(ascii().replace("vertex_indices", "corners").into(), "line 8", "vertex_indices");
    fault(ascii().replace("end_header", "end_heather").into(), "line 10", "end_heather");
    fault(b"ply\nformat ascii 1.0\n".to_vec(), "line 2", "end_header is missing");
    fault(ascii().replace("comment made by hand", "element face 0").into(), "line 8", "declared twice");
    fault(ascii().replace("float z", "float y").into(), "line 4", "two properties \"y\"");
    fault(b"plywood".to_vec(), "line 1", "\"ply\" belongs");
}
