//! OBJ and MTL.

use twincast::math::{DVec3, Vec2, Vec3};
use twincast::scene::{Specular, Wrap};

use super::{Files, corners, meshes, refused, refused_bytes};

const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";

/// A picture of 2 x 1 pixels, red and half-transparent blue.
pub fn picture() -> Vec<u8> {
    let pixels = image::RgbaImage::from_raw(2, 1, vec![255, 0, 0, 255, 0, 0, 255, 128]).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    pixels.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn every_form_of_index() {
    let expected = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
    let attributes = "vt 0.25 0.75\nvt 1\nvn 0 0 2\n";
    for face in ["1 2 3", "1/1 2/2 3/1", "1//1 2//1 3//-1", "1/1/1 2/2/1 3/-2/1", "-4 -3 -2", "1 2 \\\n 3 # c"] {
        let scene = Files::one("a.obj", format!("{VERTICES}{attributes}f {face}\n")).scene("a.obj");
        let mesh = meshes(&scene)[0];
        assert_eq!(corners(mesh), expected, "{face}");
        assert_eq!(mesh.positions.len(), 3, "only what is used");
        let slashes = face.split(' ').next().unwrap().split('/').collect::<Vec<_>>();
        let has = |k: usize| slashes.get(k).is_some_and(|s| !s.is_empty());
        assert_eq!(mesh.uvs.len(), if has(1) { 3 } else { 0 }, "{face}");
        assert_eq!(mesh.normals, if has(2) { vec![Vec3::Z; 3] } else { vec![] }, "{face}");
        if has(1) {
            assert_eq!(mesh.uvs, [Vec2::new(0.25, 0.75), Vec2::new(1.0, 0.0), Vec2::new(0.25, 0.75)]);
        }
    }
    // A face before its vertices.
    assert_eq!(corners(meshes(&Files::one("a.obj", format!("f 1 2 3\n{VERTICES}")).scene("a.obj"))[0]), expected);
}

/// Editors put it before UTF-8: in front of the first vertex it must not lose that.
#[test]
fn a_byte_order_mark_is_passed_over() {
    let marked = |text: &str| format!("\u{feff}{text}");
    let text = marked("v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib a.mtl\nusemtl red\nf 1 2 3\n");
    let files = Files::one("a.obj", text).and("a.mtl", marked("newmtl red\nKd 1 0 0\n"));
    let (scene, warnings) = files.load("a.obj");
    assert_eq!((corners(meshes(&scene)[0]), warnings.len()), (vec![[Vec3::ZERO, Vec3::X, Vec3::Y]], 0));
    assert_eq!(scene.materials[meshes(&scene)[0].material as usize].diffuse, Vec3::X);
    let nff = "f 1 0 0 1 0 1 0 1\ns 0 0 0 1\n";
    let scenes = [nff.to_owned(), marked(nff)].map(|text| Files::one("a.nff", text).scene("a.nff"));
    assert_eq!(scenes[0].primitive_count(), scenes[1].primitive_count());
}

/// Pictures must not become NaN by them.
#[test]
fn colours_and_texture_coordinates_that_are_no_numbers_count_as_nothing() {
    let text = "v 0 0 0 nan 0 1\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nvt 0 0\nvt 1e39 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    let (scene, warnings) = Files::one("a.obj", text).load("a.obj");
    let mesh = meshes(&scene)[0];
    assert!(mesh.colors.iter().all(|color| color.is_finite()) && mesh.uvs.iter().all(|uv| uv.is_finite()), "{mesh:?}");
    assert_eq!((mesh.colors[0], mesh.colors[1].truncate()), (Vec3::Z.extend(1.0), Vec3::ONE));
    assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::ZERO, Vec2::Y]);
    assert!(warnings.len() == 1 && warnings[0].message.contains("2 colours or texture coordinates"), "{warnings:?}");
}

#[test]
fn polygons_concave_ones_too() {
    // An arrow head whose fan from the first corner would cover area outside it.
    let files = Files::one("a.obj", "v 2 1 0\nv 0 2 0\nv 0.5 1 0\nv 0 0 0\nf 2 3 4 1\n");
    let scene = files.scene("a.obj");
    let area: f32 = corners(meshes(&scene)[0]).iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).length() / 2.0).sum();
    assert_eq!((scene.primitive_count(), area), (2, 1.5));
}

#[test]
fn smoothing_groups() {
    // Two triangles at a right angle over the edge 1-2.
    let fold = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let normals = |faces: &str| {
        let scene = Files::one("a.obj", format!("{fold}{faces}")).scene("a.obj");
        meshes(&scene)[0].normals.clone()
    };
    assert_eq!(normals("f 1 2 3\nf 2 1 4\n"), []);
    assert_eq!(normals("s off\nf 1 2 3\nf 2 1 4\n"), []);
    let joined = normals("s 1\nf 1 2 3\nf 2 1 4\n");
    assert_eq!(joined.len(), 4);
    // The faces' normals are +z and +y; both have the same angle at vertex 1.
    assert!(joined[0].abs_diff_eq(Vec3::new(0.0, 1.0, 1.0).normalize(), 1e-6), "{joined:?}");
    assert_eq!((joined[2], joined[3]), (Vec3::Z, Vec3::Y));
    let apart = normals("s 1\nf 1 2 3\ns 2\nf 2 1 4\n");
    assert_eq!(apart, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Y, Vec3::Y, Vec3::Y]);
    let mixed = normals("s 1\nf 1 2 3\ns off\nf 2 1 4\n");
    assert_eq!(mixed, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO]);
}

/// Slips that other readers pass over: a comment behind fewer numbers than there may be, a map without a name, a
/// comment that ends in a path of Windows, and libraries that have nothing of what is named.
#[test]
fn slips_cost_no_more_than_what_they_are() {
    let obj = format!("# C:\\models\\\n{VERTICES}mtllib a.mtl\nvt 0.5 # c\nusemtl red\nf 1/1 2/1 3/1\n");
    let files = Files::one("a.obj", &obj).and("a.mtl", "newmtl red\nKd 0.25 # grey\nmap_Kd\nKs 0.5\nNs 9\n");
    let (scene, warnings) = files.load("a.obj");
    let (mesh, material) = (meshes(&scene)[0], &scene.materials[0]);
    assert_eq!((mesh.triangles.len(), mesh.uvs[0]), (1, Vec2::new(0.5, 0.0)));
    assert_eq!((material.diffuse, material.specular), (Vec3::splat(0.25), Vec3::splat(0.5)));
    assert!(warnings.len() == 1 && warnings[0].message.contains("map_Kd without a file name"), "{warnings:?}");
    let commented = obj.replace("usemtl red", "usemtl red # the first").replace("a.mtl", "a.mtl # all of them");
    let library = "newmtl red # ripe\nKd 0.25\nmap_Kd a.png # a picture\n";
    let files = Files::one("a.obj", commented).and("a.mtl", library).and("a.png", picture());
    let (scene, warnings) = files.load("a.obj");
    let red = &scene.materials[0];
    assert!(warnings.is_empty() && red.diffuse == Vec3::splat(0.25) && red.diffuse_texture == Some(0), "{warnings:?}");
    for (library, words) in [(Some("# none\n"), "in no material library"), (None, "\"my red.mtl\" is missing")] {
        let files = Files::one("a.obj", obj.replace("a.mtl", "my red.mtl"));
        let files = if let Some(text) = library { files.and("my red.mtl", text) } else { files };
        let (_, warnings) = files.load("a.obj");
        assert!(warnings.len() == 1, "{warnings:?}");
        assert!(warnings[0].message.replace(&*files.path("").to_string_lossy(), "").contains(words), "{warnings:?}");
    }
}

#[test]
fn materials_and_textures() {
    let obj = format!(
        "mtllib a b.mtl\n{VERTICES}vt 0 0\no left\nusemtl red\nf 1 2 3\ng right\nusemtl shiny\nf 2/1 3/1 4/1\nusemtl red\nf 1 2 4\n"
    );
    let mtl = "newmtl red\nKd 1 0.5 0.25\nKa 0.1 0.2 0.3\nKs 1 1 1\nNs 50\nillum 1\nKe 0 0 2\n\
        newmtl shiny\nKs 0.5 0.5 0.5\nNs 100\nillum 2\nNi 1.5\nmap_Kd -s 2 3 1 -o 0.5 -clamp on my pic.png\n";
    let files = Files::one("a.obj", obj).and("a b.mtl", mtl).and("my pic.png", picture());
    let scene = files.scene("a.obj");
    let [red, shiny] = &scene.materials[..] else { panic!("{:?}", scene.materials) };
    assert_eq!(
        (red.name.as_str(), red.diffuse, red.ambient),
        ("red", Vec3::new(1.0, 0.5, 0.25), Vec3::new(0.1, 0.2, 0.3))
    );
    assert_eq!((red.specular, red.emission, red.diffuse_texture), (Vec3::ZERO, Vec3::new(0.0, 0.0, 2.0), None));
    assert_eq!((shiny.specular, shiny.shininess, shiny.model), (Vec3::splat(0.5), 100.0, Specular::BlinnPhong));
    assert_eq!((shiny.diffuse, shiny.diffuse_texture), (Vec3::ONE, Some(0)));
    let texture = &scene.textures[0];
    assert_eq!(
        (texture.width, texture.height, &texture.pixels),
        (2, 1, &vec![[255u8, 0, 0, 255], [0, 0, 255, 128]].into())
    );
    assert_eq!(texture.transform.transform_point2(Vec2::ONE), Vec2::new(2.5, 3.0), "scaled, then moved");
    assert_eq!((texture.wrap_u, texture.wrap_v), (Wrap::Clamp, Wrap::Clamp));
    let shapes: Vec<_> = meshes(&scene).iter().map(|m| (m.name.as_str(), m.material, m.triangles.len())).collect();
    assert_eq!(shapes, [("left", 0, 2), ("left", 1, 1)]);
}

/// What exporters write beside a `Ks` that none of them shows: MeshLab 0, trimesh 1, Blender's physical materials
/// nothing but a roughness.
#[test]
fn highlights_without_an_edge_are_none() {
    let of = |lines: &str| {
        let obj = format!("mtllib a.mtl\n{VERTICES}usemtl a\nf 1 2 3\n");
        let files = Files::one("a.obj", obj).and("a.mtl", format!("newmtl a\nKs 1 1 1\nillum 2\n{lines}"));
        let material = files.scene("a.obj").materials.swap_remove(0);
        (material.specular != Vec3::ZERO).then_some(material.shininess)
    };
    assert_eq!(
        ["", "Ns 0\n", "Ns 1\n", "Ns 1.5\n", "Pr 0.5\nNs 20\n"].map(of),
        [None, None, None, Some(1.5), Some(20.0)]
    );
    // 2 / Pr^4 - 2.
    assert_eq!(["Pr 0.5\n", "Pr 1\n", "Pr 0\n"].map(of), [Some(30.0), None, Some(1000.0)]);
}

#[test]
fn what_is_missing_is_a_warning() {
    let obj = format!("mtllib none.mtl\n{VERTICES}usemtl a\nf 1 2 3\np 1\nl 1 2\nf 1 2\ncurv 0 1 2\n");
    let (scene, warnings) = Files::one("a.obj", obj).load("a.obj");
    assert_eq!(scene.primitive_count(), 1);
    let said: Vec<_> = warnings.iter().map(|w| (w.place.as_str(), w.message.as_str())).collect();
    assert_eq!(said.len(), 4, "{said:?}");
    for ((place, message), (at, words)) in said.iter().zip([
        ("line 8", "2 points or lines"),
        ("line 10", "fewer than 3"),
        ("line 11", "curv"),
        ("line 1", "none.mtl"),
    ]) {
        assert!(*place == at && message.contains(words), "{place}: {message}");
    }
    let obj = format!("mtllib a.mtl\n{VERTICES}usemtl a\nf 1 2 3\n");
    let files = Files::one("a.obj", obj).and("a.mtl", "newmtl a\nd 0.5\nmap_Kd sub\\none.png\nmap_Bump b.png\n");
    let (scene, warnings) = files.load("a.obj");
    assert_eq!((scene.materials[0].diffuse_texture, scene.materials[0].diffuse), (None, Vec3::splat(0.8)));
    let said: Vec<_> = warnings.iter().map(|w| (w.place.as_str(), w.message.as_str())).collect();
    for ((place, message), (at, words)) in
        said.iter().zip([("line 4", "map_Bump"), ("line 3", "sub/none.png"), ("line 2", "opaque")])
    {
        assert!(*place == at && message.contains(words), "{place}: {message}");
    }
    assert_eq!(said.len(), 3);
}

#[test]
fn colours_in_xyz_and_options_without_effect() {
    // D65's white, a red beyond the display's, and grey from one number.
    let mtl = "newmtl a\nKa xyz 0.5\nKd xyz 0.9505 1 1.089\nKs xyz 0.5 0.2 0\nKe spectral a.rfl 1\nmap_Kd -mm 0.2 0.5 a.png\nNs 9\n";
    let obj = format!("mtllib a.mtl\n{VERTICES}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    let (scene, warnings) = Files::one("a.obj", &obj).and("a.mtl", mtl).and("a.png", picture()).load("a.obj");
    let material = &scene.materials[0];
    assert!(material.diffuse.abs_diff_eq(Vec3::ONE, 1e-3), "{material:?}");
    // From Lindbloom's matrix for sRGB and D65.
    let red = Vec3::new(3.2404542 * 0.5 - 1.5371385 * 0.2, 0.0, 0.0);
    assert!(material.specular.abs_diff_eq(red, 1e-3) && material.emission == Vec3::ZERO, "{material:?}");
    let said: Vec<_> = warnings.iter().map(|w| (w.place.as_str(), w.message.as_str())).collect();
    assert!(said.len() == 1 && said[0].0 == "line 5" && said[0].1.contains("Ke spectral"), "{said:?}");
    // One number stands for all three.
    let pink = Vec3::new(
        3.2404542 - 1.5371385 - 0.4985314,
        -0.969266 + 1.8760108 + 0.041556,
        0.0556434 - 0.2040259 + 1.0572252,
    );
    assert!(material.ambient.abs_diff_eq(pink * 0.5, 1e-3), "{material:?}");
    let plain = "newmtl a\nillum 3\nmap_Kd -mm 0 1 -t 0 a.png\nmap_Bump -bm 2 my b.png \nKd 1 1 1\n";
    let files =
        Files::one("a.obj", &obj).and("a.mtl", plain).and("a.png", picture()).and("my b.png", picture()).and("1", "");
    let (scene, warnings) = files.load("a.obj");
    let said: Vec<_> = warnings.iter().map(|w| (w.place.as_str(), w.message.as_str())).collect();
    assert!(
        said.len() == 2 && said[0].1.contains("map_Bump") && said[1].0 == "line 2" && said[1].1.contains("illum 3"),
        "{said:?}"
    );
    assert_eq!(scene.files, ["a.obj", "a.png", "my b.png", "a.mtl"].map(|name| files.path(name)));
    let (_, warnings) = Files::one("a.obj", &obj)
        .and("a.mtl", "newmtl a\nmap_Kd -mm 0.2 a.png\n")
        .and("a.png", picture())
        .load("a.obj");
    assert!(warnings.len() == 1 && warnings[0].message.contains("option \"-mm\""), "{warnings:?}");
    // A picture, but nothing that lies it over the surface.
    let bare = obj.replace("/1", "");
    let mesh = "[[mesh]]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\ntriangles = [[0, 1, 2]]\nmaterial = \"a\"\n[material.a]\ntexture = \"a.png\"\n";
    let files = Files::one("a.obj", bare)
        .and("a.mtl", "newmtl a\nmap_Kd a.png\n")
        .and("a.png", picture())
        .and("file.toml", "[[file]]\npath = \"a.obj\"\n")
        .and("mesh.toml", mesh);
    for name in ["a.obj", "file.toml", "mesh.toml"] {
        let (_, warnings) = files.load(name);
        assert!(
            warnings.len() == 1 && warnings[0].message.contains("lack texture coordinates"),
            "{name}: {warnings:?}"
        );
    }
}

#[test]
fn vertex_colours_are_srgb() {
    let files = Files::one("a.obj", "v 0 0 0 1 0 0.5\nv 1 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
    let scene = files.scene("a.obj");
    let colors = &meshes(&scene)[0].colors;
    assert!(colors[0].abs_diff_eq(twincast::math::Vec4::new(1.0, 0.0, 0.214_041, 1.0), 1e-5), "{colors:?}");
    assert_eq!(colors[1].to_array(), [1.0; 4]);
    assert_eq!(scene.materials[0].diffuse, Vec3::ONE);
}

/// Red and green, written in an encoding that is not UTF-8.
#[test]
fn names_in_any_encoding_are_told_apart() {
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl \xba\xec\nf 1 2 3\nusemtl \xc2\xcc\nf 3 2 1\n";
    let mtl = b"newmtl \xba\xec\nKd 1 0 0\nnewmtl \xc2\xcc\nKd 0 1 0\n";
    let scene = Files::one("a.obj", obj).and("a.mtl", mtl).scene("a.obj");
    let colors = meshes(&scene).into_iter().map(|mesh| scene.materials[mesh.material as usize].diffuse);
    assert_eq!(colors.collect::<Vec<_>>(), [Vec3::X, Vec3::Y]);
}

#[test]
fn a_mesh_far_away_keeps_its_shape() {
    let obj = "v 10000000.001 5 0\nv 10000000.002 5 0\nv 10000000.001 5.001 0\nusemtl b\nf 1 2 3\nusemtl a\nf 3 2 1\n";
    let scene = Files::one("a.obj", obj).scene("a.obj");
    let list = meshes(&scene);
    let edge = list[0].positions[1] - list[0].positions[0];
    assert!((f64::from(edge.x) - 0.001).abs() < 1e-8, "{edge}");
    assert_eq!(list[0].origin, list[1].origin);
    assert!((list[0].origin + list[0].positions[2].as_dvec3()).abs_diff_eq(DVec3::new(1e7 + 0.001, 5.001, 0.0), 1e-8));
}

#[test]
fn faults_are_told_with_their_line() {
    let faults = [
        ("f 0 1 2", "index 0; OBJ counts from 1"),
        ("f 1 2 5", "index 5 is past the last vertex, 4"),
        ("f 1 2 -5", "before the first"),
        ("f 1/1 2/1 3/1", "past the last texture coordinate, 0"),
        ("f 1//2 2//2 3//2", "past the last normal, 0"),
        ("f 1 2 x", "whole number"),
        ("f 1 2 99999999999", "past the last"),
        ("f /1 2 3", "not of the form"),
        ("f 1/2/3/4 2 3", "past the last"),
        ("v 1 2", "needs 3 numbers"),
        ("v 1 2 x", "needs 3 numbers"),
        ("vt", "needs a number"),
        ("vn 1 0", "needs 3 numbers"),
        ("s soft", "smoothing group"),
    ];
    for (statement, words) in faults {
        let words = if statement == "f 1/2/3/4 2 3" { "not of the form" } else { words };
        refused_bytes("a.obj", format!("{VERTICES}f 1 2 3\n{statement}\n"), "line 6", words);
    }
}

#[test]
fn faults_in_what_it_refers_to_name_that() {
    let check = |mtl: &str, picture: &[u8], file: &str, place: &str, words: &str| {
        let obj = format!("mtllib a.mtl\n{VERTICES}usemtl a\nf 1 2 3\n");
        let files = Files::one("a.obj", obj).and("a.mtl", mtl).and("a.png", picture);
        let error = twincast::io::load(&files.path("a.obj"), &Default::default()).map(|_| ()).unwrap_err();
        let twincast::Error::Input { path, place: at, message } = &error else { panic!("{error}") };
        assert_eq!((path, at.as_str()), (&files.path(file), place), "{error}");
        assert!(message.contains(words), "{error}");
        assert_eq!(message.contains("a.mtl, line 2)"), file == "a.png", "{error}");
    };
    check("newmtl a\nKd 1 x 1\n", b"x", "a.mtl", "line 2", "3 numbers");
    check("newmtl a\nKd xyzzy 1 2 3\n", b"x", "a.mtl", "line 2", "r g b");
    check("newmtl a\nKd 1 -1 1\n", b"x", "a.mtl", "line 2", "from 0 up");
    check("Kd 1 1 1\n", b"x", "a.mtl", "line 1", "newmtl");
    check("newmtl a\nmap_Kd -s 2\n", b"x", "a.mtl", "line 2", "file name");
    let whole = picture();
    check("newmtl a\nmap_Kd a.png\n", &whole[..whole.len() - 20], "a.png", "", "broken");
    check("newmtl a\nmap_Kd a.png\n", &huge_picture(), "a.png", "", "100000 x 100000");
}

/// A sound picture in a format that is not read keeps nobody from the mesh, as one that is missing does not.
#[test]
fn textures_in_other_formats_are_left_out() {
    let obj = format!("mtllib a.mtl\n{VERTICES}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    // TIFF, which is as long as Targa's header; DDS; Targa in 16 bits of grey; nothing.
    for bytes in [
        &b"II*\0\x08\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"[..],
        b"DDS |\0\0\0\x07\x10\0\0",
        b"\0\0\x03\0\0\0\0\0\0\0\0\0\x01\0\x01\0\x10\0ab",
        b"x",
    ] {
        let files = Files::one("a.obj", &obj).and("a.mtl", "newmtl a\nmap_Kd a.tga\n").and("a.tga", bytes);
        let (scene, warnings) = files.load("a.obj");
        assert_eq!((scene.primitive_count(), scene.textures.len()), (1, 0));
        let [warning] = &warnings[..] else { panic!("{warnings:?}") };
        assert_eq!((&warning.path, warning.place.as_str()), (&files.path("a.mtl"), "line 2"));
        let (is_targa, message) = (bytes.starts_with(b"\0\0\x03"), &warning.message);
        let why = if is_targa { "picture that can be read" } else { "picture; convert it" };
        assert!(message.contains(&format!("a.tga\" is no PNG, JPEG, WebP, BMP or Targa {why}")), "{warning}");
    }
}

/// BMP and Targa, from the top and from the bottom, with a palette and with runs: two pixels a row, red and green above
/// blue and a white that is half transparent where the format has that.
#[test]
fn textures_in_bmp_and_targa() {
    let bmp = [
        &b"BM\x46\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x02\0\0\0\x02\0\0\0\x01\0\x18\0"[..],
        &[0; 24],
        // From the bottom, blue first, rows of a multiple of four bytes.
        b"\xff\0\0\xff\xff\xff\0\0",
        b"\0\0\xff\0\xff\0\0\0",
    ]
    .concat();
    // Palette and its length, kind, size, bits of a pixel, origin.
    let targa = |palette: u16, kind: u8, bits: u8, origin: u8, pixels: &[u8]| {
        let [low, high] = palette.to_le_bytes();
        let header = [0, u8::from(palette > 0), kind, 0, 0, low, high, if palette > 0 { 24 } else { 0 }, 0, 0, 0, 0];
        [&header[..], &[2, 0, 2, 0, bits, origin], pixels].concat()
    };
    let deep = b"\0\0\xff\xff\0\xff\0\xff\xff\0\0\xff\xff\xff\xff\x80";
    let from_below = b"\xff\0\0\xff\xff\xff\0\0\xff\0\xff\0";
    let of_a_palette = b"\0\0\xff\0\xff\0\xff\0\0\xff\xff\xff\0\x01\x02\x03";
    let runs = b"\x01\0\0\xff\0\xff\0\x80\xff\0\0\x80\xff\xff\xff";
    let pictures = [
        ("a.bmp", bmp, 255),
        // Its suffix is all that tells Targa.
        ("a.png", targa(0, 2, 32, 0x28, deep), 128),
        ("a.tga", targa(0, 2, 32, 0x28, deep), 128),
        ("e.tga", targa(0, 2, 32, 0x20, deep), 255),
        ("b.TGA", targa(0, 2, 24, 0, from_below), 255),
        ("c.tga", targa(4, 1, 8, 0x20, of_a_palette), 255),
        ("d.tga", targa(0, 10, 24, 0x20, runs), 255),
    ];
    let obj = format!("mtllib a.mtl\n{VERTICES}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    for (name, bytes, alpha) in pictures {
        let mtl = format!("newmtl a\nmap_Kd {name}\n");
        let files = |bytes: &[u8]| Files::one("a.obj", &obj).and("a.mtl", &mtl).and(name, bytes);
        let (scene, warnings) = files(&bytes).load("a.obj");
        if name == "a.png" {
            assert!(scene.textures.is_empty() && warnings.len() == 1, "{warnings:?}");
            continue;
        }
        assert!(warnings.is_empty(), "{name}: {warnings:?}");
        let [texture] = &scene.textures[..] else { panic!("{name}") };
        let expected = [[255u8, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, alpha]];
        assert_eq!((texture.width, texture.height), (2, 2), "{name}");
        assert_eq!(texture.pixels, twincast::scene::Pixels::from(expected.to_vec()), "{name}");
        let cut = files(&bytes[..bytes.len() - 3]);
        let error = twincast::io::load(&cut.path("a.obj"), &Default::default()).map(|_| ()).unwrap_err();
        assert!(error.to_string().contains("broken picture"), "{name}: {error}");
    }
}

/// A PNG of some 60 bytes that claims 100,000 x 100,000 pixels.
pub fn huge_picture() -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(100_000u32.to_be_bytes());
    header.extend(100_000u32.to_be_bytes());
    header.extend([8, 6, 0, 0, 0]);
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for chunk in [&header[..], b"IDATx", b"IEND"] {
        bytes.extend((chunk.len() as u32 - 4).to_be_bytes());
        bytes.extend(chunk);
        bytes.extend(crc(chunk).to_be_bytes());
    }
    bytes
}

/// PNG's checksum (ISO/IEC 15948, annex D).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

/// Objects stay apart where they have a material in common; the parts of one that have several keep its name. Groups
/// name what is in no object.
#[test]
fn objects_are_meshes() {
    let faces = [
        "g a",
        "f 1 2 3",
        "g b",
        "usemtl red",
        "f 1 2 4",
        "o left",
        "f 1 2 3",
        "usemtl blue",
        "f 1 2 3",
        "g c",
        "f 1 2 4",
    ];
    let more = ["o right", "f 2 3 4", "usemtl red", "f 1 3 4", "o left", "f 2 3 4"];
    let obj = format!("{VERTICES}{}\n{}\n", faces.join("\n"), more.join("\n"));
    let scene = Files::one("a.obj", obj).scene("a.obj");
    let found: Vec<_> = meshes(&scene).iter().map(|m| (m.name.as_str(), m.material, m.triangles.len())).collect();
    assert_eq!(found, [("a", 0, 1), ("b", 1, 1), ("left", 1, 2), ("left", 2, 2), ("right", 2, 1), ("right", 1, 1)]);
    let materials: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(materials, ["", "red", "blue"]);
}

/// As Windows writes them, and words that mean no smoothing.
#[test]
fn numbers_that_are_none_and_words_for_off() {
    let obj = format!("{VERTICES}vn -nan(ind) -1.#IND 0\ns OFF\nf 1//1 2//1 3//1\ns null\nf 2 3 4\n");
    let scene = Files::one("a.obj", obj).scene("a.obj");
    assert_eq!(meshes(&scene)[0].normals, [Vec3::ZERO; 6]);
    refused_bytes("a.obj", "v 0 1,5 2\n", "line 1", "v needs 3 numbers, x y z, and \"1,5\" is none");
}

/// Bytes where shares belong are told, not guessed.
#[test]
fn colours_above_one_are_told() {
    let (scene, warnings) =
        Files::one("a.obj", "v 0 0 0 0 0 0\nv 1 0 0 200 100 50\nv 0 1 0 1 1 1\nf 1 2 3\n").load("a.obj");
    assert_eq!(meshes(&scene)[0].colors[1].truncate(), Vec3::ONE);
    let [warning] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.place == "line 2" && warning.message.contains("1 colours are above 1"), "{warning}");
}

#[test]
fn a_folder_as_a_library_is_refused() {
    let files = Files::one("a.obj", format!("mtllib b.mtl\n{VERTICES}f 1 2 3\n"));
    std::fs::create_dir(files.path("b.mtl")).unwrap();
    let error = twincast::io::load(&files.path("a.obj"), &Default::default()).map(|_| ()).unwrap_err();
    assert!(error.to_string().contains("directory") && error.to_string().contains("a.obj, line 1"), "{error}");
    let files = Files::one("a.obj", "f 1 2 3\n");
    refused(&files, "a.obj", "line 1", "past the last vertex, 0");
}

/// A file of several stretches, which are read apart: what holds from one to the next, and what is told of the last.
#[test]
fn large_files_are_read_as_small_ones() {
    use std::fmt::Write;
    const PATCHES: usize = 50_000;
    let mut text = String::from("s 7\n");
    for i in 0..PATCHES {
        // From here on to far behind the next end of a stretch.
        match i {
            1000 => text += "o first\nusemtl a\ns off\n",
            30_000 => text += "usemtl b\no second\n",
            45_000 => text += "usemtl a\no third\n",
            _ => {}
        }
        let x = i as f32;
        write!(text, "v {x} 0 0\nv {x} 1 0 1 0 0\nv {x} 1 1\nv {x} 0 \\\n 1\n").unwrap();
        let first = 4 * i + 1;
        match i % 3 {
            0 => writeln!(text, "f -4 -3 -2").unwrap(),
            1 => writeln!(text, "f {first} {} {} {}", first + 1, first + 2, first + 3).unwrap(),
            _ => writeln!(text, "f -2 -1 {first}").unwrap(),
        }
    }
    assert!(text.len() > 2 << 20);
    let files = Files::one("a.obj", &text);
    let scene = files.load("a.obj").0;
    let meshes = meshes(&scene);
    // Before the first object, smooth; then of materials a, b, a, flat.
    let names: Vec<_> = meshes.iter().map(|mesh| mesh.name.as_str()).collect();
    assert_eq!(names, ["", "first", "second", "third"]);
    assert_eq!(meshes.iter().map(|mesh| mesh.material).collect::<Vec<_>>(), [0, 1, 2, 1]);
    let has_normals: Vec<_> = meshes.iter().map(|mesh| !mesh.normals.is_empty()).collect();
    assert_eq!(has_normals, [true, false, false, false]);
    let expected = |patches: std::ops::Range<usize>| -> Vec<[Vec3; 3]> {
        let patch = |i: usize| {
            let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(i as f32, y, z));
            match i % 3 {
                0 => vec![[a, b, c]],
                1 => vec![[a, b, c], [a, c, d]],
                _ => vec![[c, d, a]],
            }
        };
        patches.flat_map(patch).collect()
    };
    let ranges = [0..1000, 1000..30_000, 30_000..45_000, 45_000..PATCHES];
    for (mesh, range) in meshes.iter().zip(ranges) {
        assert!(corners(mesh) == expected(range), "{}", mesh.name);
        // Every second corner of a patch is red.
        for (position, color) in mesh.positions.iter().zip(&mesh.colors) {
            let is_red = (position.y, position.z) == (1.0, 0.0);
            assert_eq!(color.y == 0.0, is_red);
        }
    }
    let lines = text.lines().count();
    refused_bytes("a.obj", format!("{text}f 1 2 x\n"), &format!("line {}", lines + 1), "\"x\"");
    refused_bytes("a.obj", format!("{text}f 1 2 200001\n"), &format!("line {}", lines + 1), "index 200001");
    // Of two errors the first, though both stretches are read.
    let two = format!("v x\n{text}v y\n");
    refused_bytes("a.obj", two, "line 1", "v needs 3 numbers");
}
