//! glTF and GLB.

use std::f64::consts::FRAC_1_SQRT_2;

use serde_json::{Value, json};
use twincast::io::{LoadOptions, load};
use twincast::math::{DVec3, Vec2, Vec3};
use twincast::scene::{Absorption, Alpha, Attenuation, Filter, Fov, Interface, Light, Mesh, Pixels, Projection, Wrap};

use super::gltf_maker::Maker;
use super::{Files, corners, meshes, obj, refused};

/// Three positions (36 bytes), three 16-bit indices and padding (8), three normals (36), three uvs (24).
pub fn triangle_bytes() -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut bytes = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    bytes.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    bytes.extend(floats(&[0., 0., 1., 0., 0., 1., 0., 0., 2.]));
    bytes.extend(floats(&[0., 0., 1., 0., 0., 0.25]));
    bytes
}

pub fn data_uri(kind: &str, bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digit = |group: &[u8], k: usize| {
        let byte = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        if k > group.len() { '=' } else { char::from(DIGITS[(bits >> (18 - 6 * k) & 63) as usize]) }
    };
    let text: String = bytes.chunks(3).flat_map(|group| (0..4).map(move |k| digit(group, k))).collect();
    format!("data:{kind};base64,{text}")
}

/// A good file with most of what is read.
fn document() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "directional", "intensity": 3.0},
            {"type": "point", "color": [1.0, 0.5, 0.0], "intensity": 2.0, "range": 7.0},
            {"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}},
        ]}},
        "scene": 1,
        "scenes": [{}, {"nodes": [0, 3]}],
        "nodes": [
            {"name": "root", "translation": [10000000.25, 0.0, 0.0], "children": [1, 2]},
            {"name": "turned", "rotation": [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], "scale": [1.0, -2.0, 1.0], "mesh": 0},
            {"name": "lamp", "matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 5, 0, 1],
             "extensions": {"KHR_lights_punctual": {"light": 2}}},
            {"name": "eye", "translation": [0.0, 0.0, 4.0], "camera": 0, "children": [4, 5]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
        "meshes": [{"name": "patch", "primitives": [
            {"attributes": {"POSITION": 0, "NORMAL": 2, "TEXCOORD_0": 3}, "indices": 1, "material": 0},
            {"attributes": {"POSITION": 0}, "mode": 5},
        ]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 3, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
            {"buffer": 0, "byteOffset": 44, "byteLength": 36, "byteStride": 12},
            {"buffer": 0, "byteOffset": 80, "byteLength": 24},
        ],
        "buffers": [{"byteLength": 104, "uri": data_uri("application/octet-stream", &triangle_bytes())}],
        "materials": [{
            "name": "gold",
            "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.5, 0.25, 1.0], "metallicFactor": 0.5,
                "roughnessFactor": 0.5, "baseColorTexture": {"index": 0}},
            "emissiveFactor": [0.0, 0.5, 0.0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
        }],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}],
        "images": [{"name": "two", "uri": data_uri("image/png", &obj::picture())}],
    })
}

/// The good file as text.
pub fn rich() -> String {
    document().to_string()
}

/// The same for a GLB.
pub fn rich_with_binary() -> String {
    let mut document = document();
    document["buffers"] = json!([{"byteLength": 104}]);
    document.to_string()
}

/// A GLB file.
pub fn glb(json: impl AsRef<[u8]>, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_ref().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let mut bytes = b"glTF".to_vec();
    bytes.extend([word(2), word(28 + json.len() + binary.len()), word(json.len())].concat());
    bytes.extend(b"JSON");
    bytes.extend(&json);
    bytes.extend(word(binary.len()));
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

/// The good file, changed: each pointer's value is replaced.
fn changed(changes: &[(&str, Value)]) -> Files {
    let mut document = document();
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        let parent = document.pointer_mut(parent).unwrap_or_else(|| panic!("no {pointer}"));
        match key.parse::<usize>() {
            Ok(index) => parent[index] = value.clone(),
            Err(_) => parent[key] = value.clone(),
        }
    }
    Files::one("a.gltf", document.to_string())
}

#[test]
fn everything_is_where_it_belongs() {
    let text = Files::one("a.gltf", rich()).scene("a.gltf");
    let bytes = glb(rich_with_binary(), &triangle_bytes());
    let (_, warnings) = Files::one("a.glb", [&bytes[..], b"more"].concat()).load("a.glb");
    assert!(warnings.iter().any(|warning| warning.to_string().contains("4 bytes after the end")), "{warnings:?}");
    let binary = Files::one("a.glb", bytes).scene("a.glb");
    for scene in [text, binary] {
        let triangle = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
        let shapes = meshes(&scene);
        assert!(shapes.len() == 2 && shapes.iter().all(|m| corners(m) == triangle && m.name == "patch"));
        assert_eq!(shapes[0].normals, [Vec3::Z; 3]);
        assert_eq!(shapes[0].uvs, [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.75)], "v points up");
        assert_eq!((scene.groups.len(), scene.groups[0].geometries.clone(), scene.instances.len()), (1, 0..2, 1));
        // x is turned to -z, y is mirrored and doubled, and f32 would have lost the quarter.
        let place = |p| scene.instances[0].transform.transform_point3(p);
        assert!(place(DVec3::X).abs_diff_eq(DVec3::new(10_000_000.25, 0.0, -1.0), 1e-9), "{}", place(DVec3::X));
        assert!(place(DVec3::Y).abs_diff_eq(DVec3::new(10_000_000.25, -2.0, 0.0), 1e-9));

        let gold = &scene.materials[0];
        assert_eq!((gold.name.as_str(), gold.diffuse), ("gold", Vec3::new(0.75, 0.375, 0.1875)));
        // The mean of plastic's 0.04 and of half of gold's colour, times the picture's mean: half red and half blue.
        assert!(gold.specular.abs_diff_eq(Vec3::new(0.145, 0.02, 0.05125), 1e-6), "{}", gold.specular);
        assert_eq!((gold.shininess, gold.emission), (30.0, Vec3::new(0.0, 2.0, 0.0)));
        let texture = &scene.textures[gold.diffuse_texture.unwrap() as usize];
        assert_eq!((texture.wrap_u, texture.wrap_v, texture.filter), (Wrap::Clamp, Wrap::Mirror, Filter::Nearest));
        assert_eq!(
            (texture.name.as_str(), &texture.pixels),
            ("two", &vec![[255u8, 0, 0, 255], [0, 0, 255, 128]].into())
        );

        let eye = &scene.cameras[0];
        assert_eq!(
            (eye.name.as_str(), eye.eye, eye.projection),
            ("eye", DVec3::new(0.0, 0.0, 4.0), Projection::Perspective(Fov::Vertical(0.5)))
        );
        assert_eq!(eye.frame, twincast::math::DMat3::IDENTITY);
        let pi = std::f32::consts::PI;
        let [Light::Spot { position, direction, color, inner_angle, outer_angle, .. }, sun, bulb] = &scene.lights[..]
        else {
            panic!("{:?}", scene.lights)
        };
        assert_eq!((*position, *direction), (DVec3::new(10_000_000.25, 5.0, 0.0), DVec3::Y));
        assert!((color.x - 1.0 / pi).abs() < 1e-7 && (*inner_angle, *outer_angle) == (0.25, 0.5));
        let Light::Directional { direction, color } = sun else { panic!("{sun:?}") };
        assert!(*direction == DVec3::NEG_Z && color.abs_diff_eq(Vec3::splat(3.0 / pi), 1e-6));
        let Light::Point { position, color, attenuation, range, radius: 0.0 } = bulb else { panic!("{bulb:?}") };
        assert!(color.abs_diff_eq(Vec3::new(2.0, 1.0, 0.0) / pi, 1e-6));
        let expected = (DVec3::new(0.0, 0.0, 4.0), Attenuation::INVERSE_SQUARE, 7.0);
        assert_eq!((*position, *attenuation, *range), expected);
    }
}

#[test]
fn metalness_and_roughness_are_the_means_of_their_texture() {
    // Red and blue on average: all of the metalness in one half, no roughness.
    let texture = json!({"index": 0});
    let scene =
        changed(&[("/materials/0/pbrMetallicRoughness/metallicRoughnessTexture", texture.clone())]).scene("a.gltf");
    let gold = &scene.materials[0];
    assert_eq!(gold.diffuse, Vec3::new(1.0, 0.5, 0.25) * 0.875, "metalness 1/4");
    assert!((gold.shininess - 19_998.0).abs() < 1.0, "{}", gold.shininess);

    let missing = [
        ("/materials/0/pbrMetallicRoughness", json!({"metallicFactor": 0.0, "metallicRoughnessTexture": texture})),
        ("/images/0/uri", json!("none.png")),
    ];
    let (scene, warnings) = changed(&missing).load("a.gltf");
    assert_eq!((scene.materials[0].shininess, warnings.len()), (0.0, 1));
}

#[test]
fn alpha_and_emission_of_materials() {
    let with = |changes: &[(&str, Value)]| changed(changes).scene("a.gltf").materials[0].clone();
    let color = ("/materials/0/pbrMetallicRoughness/baseColorFactor", json!([1, 1, 1, 0.25]));
    let blend = with(&[("/materials/0/alphaMode", json!("BLEND")), color.clone()]);
    assert_eq!((blend.alpha, blend.opacity), (Alpha::Blend, 0.25));
    let mask = |cutoff: &[(&str, Value)]| with(&[&[("/materials/0/alphaMode", json!("MASK"))], cutoff].concat()).alpha;
    assert_eq!(mask(&[]), Alpha::Mask { cutoff: 0.5 });
    assert_eq!(mask(&[("/materials/0/alphaCutoff", json!(0.125))]), Alpha::Mask { cutoff: 0.125 });
    assert_eq!(with(&[color]).alpha, Alpha::Opaque);
    let glowing = with(&[("/materials/0/emissiveTexture", json!({"index": 0}))]);
    assert!(glowing.emission_texture.is_some() && glowing.emission_texture == glowing.diffuse_texture);
    let rough = with(&[("/materials/0/normalTexture", json!({"index": 0, "scale": 0.5}))]);
    assert_eq!((rough.normal_texture, rough.normal_scale), (rough.diffuse_texture, 0.5));
}

#[test]
fn extensions_of_materials() {
    let with =
        |extensions: Value| changed(&[("/materials/0/extensions", extensions)]).scene("a.gltf").materials[0].clone();
    let pane =
        with(json!({"KHR_materials_transmission": {"transmissionFactor": 0.5}, "KHR_materials_ior": {"ior": 1.2}}));
    assert_eq!((pane.interface, pane.ior, pane.absorption), (Interface::Thin, 1.2, None));
    // A quarter goes through: half of what is not metal, of the base colour times the picture's mean.
    assert_eq!(pane.transmission, Vec3::new(0.5, 0.0, 0.125) * 0.25);
    assert_eq!((pane.emission, pane.unlit), (Vec3::new(0.0, 0.5, 0.0), false));
    let volume = json!({"thicknessFactor": 0.1, "attenuationDistance": 2.0, "attenuationColor": [0.5, 1.0, 0.25]});
    let block = with(json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": volume}));
    let absorption = Absorption { color: Vec3::new(0.5, 1.0, 0.25), distance: 2.0 };
    assert_eq!((block.interface, block.absorption, block.ior), (Interface::Fresnel, Some(absorption), 1.5));
    let textured = json!({"transmissionFactor": 1, "transmissionTexture": {"index": 0}});
    let textured = with(json!({"KHR_materials_transmission": textured}));
    assert_eq!(textured.transmission, pane.transmission, "half of the picture is red");
    let flat = with(json!({"KHR_materials_unlit": {}}));
    assert_eq!((flat.unlit, flat.diffuse, flat.emission), (true, Vec3::new(1.0, 0.5, 0.25), Vec3::ZERO));
}

/// 16 x 8 pixels, the left half (230, 26, 51), the right one (26, 77, 204), by libwebp, which loses a little.
#[rustfmt::skip]
const WEBP: [u8; 76] = [
    0x52, 0x49, 0x46, 0x46, 0x44, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38, 0x20, 0x38, 0x00, 0x00,
    0x00, 0x10, 0x02, 0x00, 0x9d, 0x01, 0x2a, 0x10, 0x00, 0x08, 0x00, 0x00, 0x00, 0x00, 0x25, 0xa0, 0x02, 0x74, 0xba,
    0x01, 0xf8, 0x01, 0xfa, 0x00, 0x03, 0xc8, 0x00, 0xfe, 0xff, 0x07, 0xbf, 0xff, 0xe7, 0x89, 0xff, 0xff, 0x1c, 0xd7,
    0xfa, 0x98, 0xc5, 0xff, 0xf3, 0xd7, 0xdf, 0xff, 0xce, 0x69, 0xbe, 0xcd, 0x48, 0x08, 0xff, 0xbd, 0xff, 0x00, 0x00,
];

#[test]
fn a_webp_picture_comes_before_the_one_beside_it() {
    let extension = json!([{"sampler": 0, "source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}]);
    let images = json!([{"uri": data_uri("image/png", &obj::picture())}, {"uri": data_uri("image/webp", &WEBP)}]);
    let mut changes = vec![
        ("/textures", extension),
        ("/images", images),
        ("/extensionsUsed", json!(["EXT_texture_webp"])),
        ("/extensionsRequired", json!(["EXT_texture_webp"])),
    ];
    let (scene, warnings) = changed(&changes).load("a.gltf");
    let texture = &scene.textures[0];
    assert_eq!((texture.width, texture.height, warnings.len()), (16, 8, 0));
    let Pixels::Eight(pixels) = &texture.pixels else { panic!("{:?}", texture.pixels) };
    for (i, pixel) in pixels.iter().enumerate() {
        // Away from the edge, along which colours run together.
        let expected = match i % 16 {
            0..6 => [230, 26, 51, 255],
            10..16 => [26, 77, 204, 255],
            _ => continue,
        };
        assert!(pixel.iter().zip(expected).all(|(&a, b)| a.abs_diff(b) < 12), "{i}: {pixel:?}");
    }
    changes[0].1 = json!([{"sampler": 0, "source": 0, "extensions": {"EXT_texture_webp": {"source": 7}}}]);
    refused(&changed(&changes), "a.gltf", "/textures/0/extensions/EXT_texture_webp/source", "no image 7");
    changes[0].1 = json!([{"sampler": 0, "source": 0}]);
    assert_eq!(changed(&changes).scene("a.gltf").textures[0].width, 2, "the other one, where that is all there is");
}

#[test]
fn sixteen_bits_of_a_picture_are_kept() {
    let codes = [0u16, 1, 257, 65_535, 33_000, 32_999, 12_345, 40_000];
    let picture = |format: fn(&[u16]) -> image::DynamicImage| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        format(&codes).write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG");
        let uri = data_uri("image/png", &bytes.into_inner());
        let scene = changed(&[("/images", json!([{"uri": uri}]))]).scene("a.gltf");
        scene.textures[0].pixels.clone()
    };
    let colors =
        picture(|codes| image::ImageBuffer::<image::Rgba<u16>, _>::from_raw(2, 1, codes.to_vec()).unwrap().into());
    assert_eq!(colors, Pixels::from(vec![[0u16, 1, 257, 65_535], [33_000, 32_999, 12_345, 40_000]]));
    let greys =
        picture(|codes| image::ImageBuffer::<image::Luma<u16>, _>::from_raw(8, 1, codes.to_vec()).unwrap().into());
    assert_eq!(greys, Pixels::from(codes.map(|c| [c, c, c, 65_535]).to_vec()));
}

#[test]
fn files_beside_it() {
    let uris = [("/buffers/0/uri", json!("my%20data.bin")), ("/images/0/uri", json!("pic%2Epng"))];
    let files = changed(&uris).and("my data.bin", triangle_bytes()).and("pic.png", obj::picture());
    let scene = files.scene("a.gltf");
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(scene.files, ["a.gltf", "my data.bin", "pic.png"].map(|name| files.path(name)));
    std::fs::remove_file(files.path("pic.png")).unwrap();
    let (scene, warnings) = files.load("a.gltf");
    assert_eq!((scene.materials[0].diffuse_texture, warnings.len()), (None, 1));
    assert!(warnings[0].place == "/images/0/uri" && warnings[0].message.contains("pic.png"), "{}", warnings[0]);
    std::fs::remove_file(files.path("my data.bin")).unwrap();
    refused(&files, "a.gltf", "/buffers/0/uri", "my data.bin");
}

#[test]
fn sparse_accessors() {
    // Two of three positions of an accessor without a view are replaced: from the index bytes 1, 2.
    let sparse = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 2,
        "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 0, "byteOffset": 12}}});
    let mut document = document();
    document["accessors"][0] = sparse;
    let indices = json!({"buffer": 0, "byteOffset": 38, "byteLength": 4});
    document["bufferViews"].as_array_mut().unwrap().push(indices);
    let files = Files::one("a.gltf", document.to_string());
    assert_eq!(corners(meshes(&files.scene("a.gltf"))[0]), [[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    document["accessors"][0]["sparse"]["count"] = json!(4);
    refused(&Files::one("a.gltf", document.to_string()), "a.gltf", "/accessors/0/sparse/count", "4 of only 3");
    document["accessors"][0]["sparse"]["count"] = json!(3);
    refused(&Files::one("a.gltf", document.to_string()), "a.gltf", "/accessors/0/sparse/indices", "past the view's 4");
}

/// Whole numbers may have a fraction of zero or an exponent; of a key that is there twice the last counts.
#[test]
fn numbers_are_what_json_says() {
    let document = document();
    let expected = corners(meshes(&Files::one("a.gltf", document.to_string()).scene("a.gltf"))[0]);
    let text = document.to_string().replace("5126", "5.126e3").replace("\"count\":3", "\"count\":7,\"count\":3.0");
    assert!(text.contains("5.126e3") && text.contains("3.0"), "{text}");
    assert_eq!(corners(meshes(&Files::one("a.gltf", &text).scene("a.gltf"))[0]), expected);
    let broken = document.to_string().replace("5126", "5126.5");
    refused(&Files::one("a.gltf", broken), "a.gltf", "line 1, column 52", "expected");
}

#[test]
fn deep_hierarchies() {
    let mut nodes: Vec<Value> =
        (1..100_000).map(|child| json!({"children": [child], "translation": [1, 0, 0]})).collect();
    nodes.push(json!({"mesh": 0}));
    let files = changed(&[("/nodes", json!(nodes)), ("/scenes/1/nodes", json!([0]))]);
    assert_eq!(files.scene("a.gltf").instances[0].transform.translation.x, 99_999.0);
}

#[test]
fn orthographic_cameras() {
    let camera = json!({"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 1.5, "zfar": 9, "znear": 1}});
    let (scene, warnings) = changed(&[("/cameras/0", camera)]).load("a.gltf");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(scene.cameras[0].projection, Projection::Orthographic(3.0));
    refused(&changed(&[("/cameras/0", json!({"type": "orthographic"}))]), "a.gltf", "/cameras/0", "neither");
    let flat = json!({"type": "orthographic", "orthographic": {"ymag": 0}});
    refused(&changed(&[("/cameras/0", flat)]), "a.gltf", "/cameras/0/orthographic/ymag", "height of 0");
}

/// Exporters write cones whose angles are one; and what no node shows may be as it is.
#[test]
fn lights_that_are_not_quite_right() {
    const LIGHTS: &str = "/extensions/KHR_lights_punctual/lights";
    let angles = |inner: f32, outer: f32| {
        let spot = json!({"innerConeAngle": inner, "outerConeAngle": outer});
        changed(&[(&format!("{LIGHTS}/2/spot"), spot)])
    };
    let scene = angles(0.5, 0.5).scene("a.gltf");
    let Light::Spot { inner_angle, outer_angle, .. } = scene.lights[0] else { panic!("{:?}", scene.lights) };
    assert!(inner_angle < outer_angle && inner_angle > 0.4999 && outer_angle == 0.5);
    for (inner, outer) in [(0.6, 0.5), (0.0, 0.0), (0.1, 1.6)] {
        refused(&angles(inner, outer), "a.gltf", &format!("{LIGHTS}/2"), "0 <= inner <= outer");
    }
    let range = (format!("{LIGHTS}/1/range"), json!(0));
    refused(&changed(&[(&range.0, range.1.clone())]), "a.gltf", &format!("{LIGHTS}/1"), "a range of 0");
    assert_eq!(changed(&[(&range.0, range.1), ("/nodes/5", json!({}))]).scene("a.gltf").lights.len(), 2);
}

#[test]
fn what_is_not_rendered_is_a_warning() {
    let say = |changes: &[(&str, Value)], place: &str, words: &str| {
        let (_, warnings) = changed(changes).load("a.gltf");
        assert!(warnings.len() == 1, "{warnings:?}");
        assert!(warnings[0].place == place && warnings[0].message.contains(words), "{}", warnings[0]);
    };
    let set = |set: u32| json!({"index": 0, "texCoord": set});
    say(&[("/materials/0/normalTexture", set(1))], "/meshes", "1 primitives lack texture coordinates");
    let three = [("/materials/0/normalTexture", set(2)), ("/materials/0/emissiveTexture", set(1))];
    let (_, warnings) = changed(&three).load("a.gltf");
    assert!(
        warnings[1].place == "/materials/0/normalTexture" && warnings[1].message.contains("of set 2"),
        "{warnings:?}"
    );
    say(&[("/meshes/0/primitives/1/mode", json!(1))], "/meshes", "1 primitives are points or lines");
    say(&[("/meshes/0/primitives/1/attributes", json!({"NORMAL": 2}))], "/meshes", "1 primitives have no POSITION");
    say(&[("/extensionsUsed", json!(["EXT_new", "KHR_lights_punctual"]))], "/extensionsUsed", "EXT_new");
    let two = json!([{"attributes": {"POSITION": 0}}]);
    let nodes = json!([{"mesh": 0}, {"mesh": 0, "scale": [1, 0, 1], "name": "flat"}, {}, {}]);
    say(
        &[("/nodes", nodes), ("/scenes/1/nodes", json!([0, 1])), ("/meshes/0/primitives", two)],
        "/nodes/1",
        "\"flat\" is scaled by zero",
    );
    let two = json!([{"attributes": {"POSITION": 0}}]);
    let nodes = json!([{"mesh": 0}, {"mesh": 0, "translation": [1e100, 0, 0], "name": "far"}, {}, {}]);
    say(
        &[("/nodes", nodes), ("/scenes/1/nodes", json!([0, 1])), ("/meshes/0/primitives", two)],
        "/nodes/1",
        "\"far\" is placed farther away",
    );
}

#[test]
fn a_scale_of_zero_along_one_axis_presses_flat() {
    let mut maker = Maker::new();
    let positions = maker.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 2.0]);
    let normals = maker.floats("VEC3", &[0.0, 0.6, 0.8, 0.0, 0.6, 0.8, 0.0, 0.6, 0.8]);
    maker.json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions, "NORMAL": normals}}]}]);
    maker.json["scenes"] = json!([{"nodes": [0, 1]}]);
    maker.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "scale": [2, 3, 0], "translation": [0, 0, 5]}]);
    let scene = maker.files().scene("a.gltf");
    let [slanted, flat] = meshes(&scene)[..] else { panic!("{:?}", scene.geometries) };
    let check_flat = |flat: &Mesh| {
        let placed: Vec<_> = flat.positions.iter().map(|&offset| flat.point(offset)).collect();
        assert_eq!(placed, [DVec3::Z * 5.0, DVec3::new(2.0, 0.0, 5.0), DVec3::new(0.0, 3.0, 5.0)]);
        assert_eq!(flat.normals, [Vec3::Z; 3]);
    };
    assert_eq!(corners(slanted), [[Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 2.0)]]);
    check_flat(flat);
    assert_eq!(scene.group_geometries(scene.instances[1].group).map(|(index, _)| index).collect::<Vec<_>>(), [1]);
    // Where it is nowhere else, the mesh itself is no part of the scene.
    maker.json["scenes"] = json!([{"nodes": [1]}]);
    let scene = maker.files().scene("a.gltf");
    let [flat] = meshes(&scene)[..] else { panic!("{:?}", scene.geometries) };
    check_flat(flat);
    assert_eq!((scene.groups.len(), scene.instances[0].group, scene.groups[0].geometries.clone()), (1, 0, 0..1));
}

/// A picture that is somewhere else, or in another format, wherever it lies, is left out as one that is missing.
#[test]
fn pictures_that_cannot_be_had_are_told() {
    let gif = data_uri("image/gif", b"GIF89a\x01\0\x01\0\0\0\0;");
    let of_view = [("/images/0", json!({"bufferView": 0, "mimeType": "image/ktx2"}))];
    let of_uri = |uri: &str| [("/images/0/uri", json!(uri))];
    for (changes, place, words) in [
        (of_uri("http://example.org/a.png"), "/images/0/uri", "relative path"),
        (of_uri(""), "/images/0/uri", "empty file name"),
        (of_uri("50%.png"), "/images/0/uri", "hexadecimal"),
        (of_uri(&gif), "/images/0/uri", "image \"two\" is no PNG"),
        (of_view, "/images/0", "the image is no PNG"),
    ] {
        let (scene, warnings) = changed(&changes).load("a.gltf");
        assert_eq!((scene.materials[0].diffuse_texture, scene.textures.len()), (None, 0));
        let [warning] = &warnings[..] else { panic!("{words}: {warnings:?}") };
        assert!(warning.place == place && warning.message.contains(words), "{warning}");
    }
}

#[test]
fn faults_are_told_with_their_pointer() {
    let fault = |pointer: &str, value: Value, place: &str, words: &str| {
        eprintln!("{pointer} = {value}");
        refused(&changed(&[(pointer, value)]), "a.gltf", place, words);
    };
    fault("/extensionsRequired", json!(["KHR_lights_punctual", "EXT_new"]), "/extensionsRequired/1", "\"EXT_new\"");
    fault("/asset/version", json!("1.0"), "/asset/version", "2.x");
    fault("/asset/minVersion", json!("2.1"), "/asset/minVersion", "\"2.1\"");
    fault("/bufferViews/0/byteLength", json!(105), "/accessors/0/bufferView", "past its buffer's 104");
    fault("/bufferViews/0/byteOffset", json!(u64::MAX), "/accessors/0/bufferView", "past its buffer's 104");
    fault("/bufferViews/0/buffer", json!(1), "/accessors/0/bufferView", "buffer 1");
    fault("/bufferViews/2/byteStride", json!(3), "/accessors/2/bufferView", "multiple of 4");
    fault("/bufferViews/2/byteStride", json!(8), "/accessors/2/bufferView", "less than an element's 12");
    fault("/accessors/0/count", json!(4), "/accessors/0/count", "past the view's 36");
    fault("/accessors/0/count", json!(4_000_000_000u32), "/accessors/0/count", "past the view's 36");
    fault("/accessors/0/byteOffset", json!(2), "/accessors/0/byteOffset", "no multiple");
    fault("/accessors/0/type", json!("VEC2"), "/accessors/0/type", "VEC3 belongs");
    fault("/accessors/0/componentType", json!(5127), "/accessors/0/componentType", "5127");
    fault("/accessors/1/componentType", json!(5122), "/accessors/1/componentType", "unsigned");
    fault("/accessors/2/count", json!(2), "/accessors/2/count", "2 elements for 3 positions");
    fault("/bufferViews/1/byteOffset", json!(10), "/accessors/1", "index 16256 (element 2) is past the 3 vertices");
    fault(
        "/accessors/0",
        json!({"componentType": 5126, "count": 100_000_000, "type": "VEC3"}),
        "/accessors/0/count",
        "without data",
    );
    fault("/meshes/0/primitives/0/attributes/POSITION", json!(9), "/accessors", "no accessor 9");
    fault("/meshes/0/primitives/0/mode", json!(7), "/meshes/0/primitives/0/mode", "mode 7");
    fault("/meshes/0/primitives/0/material", json!(1), "/meshes/0/primitives/0/material", "no material 1");
    fault("/nodes/1/children", json!([0]), "/nodes/1/children/0", "child of itself");
    fault("/nodes/3/children", json!([1]), "/nodes/3/children/0", "two nodes");
    fault("/nodes/0/children", json!([6]), "/nodes/0/children/0", "no node 6; there are 6");
    fault("/nodes/1/mesh", json!(1), "/nodes/1/mesh", "no mesh 1");
    fault("/nodes/1/rotation", json!([0, 0, 0, 0]), "/nodes/1/rotation", "unit quaternion");
    fault("/nodes/2/matrix/15", json!(2), "/nodes/2/matrix", "0 0 0 1");
    fault("/nodes/2/matrix/15", json!(1.00001), "/nodes/2/matrix", "0 0 0 1");
    changed(&[("/nodes/2/matrix/15", json!(1.0000001)), ("/nodes/2/matrix/3", json!(-1e-17))]).scene("a.gltf");
    fault("/nodes/3/camera", json!(1), "/nodes/3/camera", "no camera 1");
    fault("/cameras/0/perspective/yfov", json!(4), "/cameras/0/perspective/yfov", "between 0 and pi");
    fault("/scene", json!(2), "/scene", "no scene 2");
    fault("/materials/0/alphaMode", json!("GLASS"), "/materials/0", "expected OPAQUE, BLEND, or MASK");
    for (name, value, words) in [
        ("KHR_materials_ior", json!({"ior": 0.5}), "from 1 up, or 0"),
        ("KHR_materials_transmission", json!({"transmissionFactor": 1.5}), "from 0 to 1"),
        ("KHR_materials_volume", json!({"thicknessFactor": 1, "attenuationDistance": 0}), "above 0"),
        ("KHR_materials_volume", json!({"thicknessFactor": "thick"}), "KHR_materials_volume: invalid type"),
    ] {
        fault("/materials/0/extensions", json!({ name: value }), "/materials/0/extensions", words);
    }
    let metallic = "/materials/0/pbrMetallicRoughness/metallicFactor";
    fault(metallic, json!(2), metallic, "from 0 to 1, and is 2");
    fault(
        "/materials/0/pbrMetallicRoughness/metallicRoughnessTexture",
        json!({"index": 7}),
        "/materials/0/pbrMetallicRoughness/metallicRoughnessTexture/index",
        "no texture 7",
    );
    fault("/textures/0/source", json!(1), "/textures/0/source", "no image 1");
    fault(
        "/images/0/uri",
        json!(data_uri("image/png", &obj::huge_picture())),
        "/images/0",
        "\"two\" claims 100000 x 100000",
    );
    fault("/buffers/0/byteLength", json!(105), "/buffers/0/byteLength", "promises 105 bytes, but has 104");
    fault("/buffers/0", json!({"byteLength": 104}), "/buffers/0/uri", "neither");
    fault("/scenes", json!([]), "/scenes", "nothing to render");
    let files = Files::one("a.gltf", "{\n \"asset\": 3}");
    refused(&files, "a.gltf", "line 2, column 11", "not valid glTF: invalid type");
    for (text, words) in [
        ("{\"scene\": -1}", "invalid value: integer `-1`, expected a whole number from 0 on"),
        (
            "{\"nodes\": [{\"mesh\": \"usize, expected u8\"}]}",
            "string \"usize, expected u8\", expected a whole number from 0 on",
        ),
        ("{\"nodes\": {}}", "invalid type: object, expected an array"),
        ("{\"nodes\": [[3]]}", "expected"),
    ] {
        let files = Files::one("a.gltf", text);
        let error = load(&files.path("a.gltf"), &LoadOptions::default()).expect_err("it is refused");
        assert!(error.exit_code() == 3 && error.to_string().contains(words), "{error}");
    }
}

#[test]
fn truncated_containers() {
    let whole = glb(rich_with_binary(), &triangle_bytes());
    let refused = |bytes: &[u8], place: &str, words: &str| super::refused_bytes("a.glb", bytes, place, words);
    refused(&whole[..whole.len() - 1], "byte 8", "truncated GLB");
    refused(&whole[..6], "byte 4", "truncated GLB");
    let mut long = whole.clone();
    long[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    refused(&long, "byte 12", "promises 4294967295 bytes");
    let mut old = whole;
    old[4] = 1;
    refused(&old, "byte 4", "version 1");
}
