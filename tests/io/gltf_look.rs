//! glTF's materials: textures in every slot and place, specular, specular-glossiness, variants.

use serde_json::{Value, json};
use twincast::io::{LoadOptions, load};
use twincast::math::{DVec3, Vec2, Vec3};
use twincast::render::{Control, Renderer, Settings};
use twincast::scene::{Camera, Light, Material};
use twincast::trace::bvh::Bvh;
use twincast::{Scene, World};

use super::gltf::data_uri;
use super::gltf_maker::Maker;
use super::{Files, meshes, obj, refused};

/// The square from (-1, -1) to (1, 1) in the plane z = 0, which faces +z, with the picture of two pixels: red and
/// opaque, blue and half there. The first set of coordinates lies the picture over the square; by the second all of it
/// is at the corner (1, 0), v down.
fn square(material: Value) -> Maker {
    let mut maker = Maker::new();
    let positions = maker.floats("VEC3", &[-1., -1., 0., 1., -1., 0., 1., 1., 0., -1., 1., 0.]);
    let uvs = maker.floats("VEC2", &[0., 1., 1., 1., 1., 0., 0., 0.]);
    let corner = maker.floats("VEC2", &[0.75, 0.5, 0.75, 0.5, 0.75, 0.5, 0.75, 0.5]);
    let indices = maker.accessor("SCALAR", 5121, false, 6, &[0, 1, 2, 0, 2, 3]);
    let attributes = json!({"POSITION": positions, "TEXCOORD_0": uvs, "TEXCOORD_1": corner});
    maker.json["meshes"] = json!([{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}]);
    maker.json["nodes"] = json!([{"mesh": 0}]);
    maker.json["materials"] = json!([material]);
    maker.json["textures"] = json!([{"source": 0, "sampler": 0}]);
    maker.json["samplers"] = json!([{"magFilter": 9728}]);
    maker.json["images"] = json!([{"uri": data_uri("image/png", &obj::picture())}]);
    maker
}

/// What is seen of the left and of the right half of the square, from straight above, under a light from there.
fn halves(scene: &Scene) -> [Vec3; 2] {
    let mut scene = scene.clone();
    scene.lights = vec![Light::Directional { direction: DVec3::NEG_Z, color: Vec3::ONE }];
    let world = World::new(&scene).unwrap();
    let camera = Camera::look_at(DVec3::Z * 2.0, DVec3::ZERO, DVec3::Y, 0.5).unwrap();
    let settings = Settings { width: 2, height: 1, spp: 1, ..Settings::default() };
    let renderer = Renderer::new(&scene, &world, camera, settings).unwrap();
    let image = renderer.render(&Bvh::build(&world), Control::default()).unwrap();
    [image.pixels[0].truncate(), image.pixels[1].truncate()]
}

fn seen(material: Value) -> [Vec3; 2] {
    halves(&square(material).files().scene("a.gltf"))
}

fn only(material: Value) -> Material {
    square(material).files().scene("a.gltf").materials[0].clone()
}

/// Exporters write a little more than 1, and what is more than all there is all there.
#[test]
fn more_than_opaque_is_opaque() {
    for alpha in [1.000_000_1, 2.0] {
        let both = [
            json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, alpha]}, "alphaMode": "BLEND"}),
            json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.5, 0.5, 0.5, alpha]}}}),
        ];
        for material in both {
            assert_eq!(only(material).opacity, 1.0);
        }
    }
}

/// A colour at all vertices is the same as in the material, whatever the material makes of it: matte, metal, glass.
#[test]
fn colours_of_vertices_multiply_the_base_colour() {
    let physical = |color: [f32; 4], metallic: f32, transmission: f32| {
        json!({
            "pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": metallic, "roughnessFactor": 0.4},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission}},
        })
    };
    let color = [0.75f32, 0.5, 0.25, 1.0];
    for (metallic, transmission) in [(0.0, 0.0), (1.0, 0.0), (0.5, 0.0), (0.0, 1.0), (0.25, 0.5)] {
        let by_factor = square(physical(color, metallic, transmission)).files().scene("a.gltf");
        let mut maker = square(physical([1.0; 4], metallic, transmission));
        let colors = maker.floats("VEC4", &[color; 4].concat());
        maker.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
        let by_vertices = maker.files().scene("a.gltf");
        let [expected, got] = [by_factor, by_vertices].map(|mut scene| {
            scene.background = Some(Vec3::splat(0.5));
            halves(&scene)[0]
        });
        assert!(got.abs_diff_eq(expected, 1e-6), "{metallic} metal, {transmission} glass: {got}, {expected}");
    }
    // What is no share of light is cut.
    let mut maker = square(json!({"extensions": {UNLIT: {}}}));
    let colors = maker.floats("VEC3", &[2.0, 0.5, -1.0].repeat(4));
    maker.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
    assert_eq!(halves(&maker.files().scene("a.gltf"))[0], Vec3::new(1.0, 0.5, 0.0));
    // Without a material it is glTF's own, a rough metal.
    let bare = |material: Option<Value>| {
        let mut maker = square(material.clone().unwrap_or(json!({})));
        let colors = maker.floats("VEC3", &[1.0, 0.0, 0.0].repeat(4));
        let primitive = &mut maker.json["meshes"][0]["primitives"][0];
        match material {
            Some(_) => {}
            None => {
                primitive["attributes"]["COLOR_0"] = json!(colors);
                primitive.as_object_mut().unwrap().remove("material");
            }
        }
        halves(&maker.files().scene("a.gltf"))[0]
    };
    let red = bare(Some(json!({"pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.0, 0.0, 1.0]}})));
    assert!(bare(None).abs_diff_eq(red, 1e-6) && red.x > 0.1 && red.y == 0.0, "{red}");
}

const UNLIT: &str = "KHR_materials_unlit";
const PLACE: &str = "KHR_texture_transform";

fn placed(transform: Value) -> [Vec3; 2] {
    let texture = json!({"index": 0, "extensions": {PLACE: transform}});
    seen(json!({"extensions": {UNLIT: {}}, "pbrMetallicRoughness": {"baseColorTexture": texture}}))
}

#[test]
fn textures_lie_where_they_are_placed() {
    let [red, blue] = [Vec3::X, Vec3::Z];
    assert_eq!(placed(json!({})), [red, blue]);
    assert_eq!(placed(json!({"offset": [0.5, 0]})), [blue, red], "moved by half of the picture, which repeats");
    assert_eq!(placed(json!({"scale": [0.25, 1]})), [red, red], "its left quarter over all");
    assert_eq!(placed(json!({"offset": [1, 0], "scale": [-1, 1]})), [blue, red], "mirrored");
    assert_eq!(placed(json!({"offset": [1, 1], "rotation": std::f32::consts::PI})), [blue, red], "upside down");
    assert_eq!(placed(json!({"texCoord": 1})), [blue, blue], "by the second coordinates");
    let files = square(
        json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {PLACE: {"scale": 1}}}}}),
    );
    refused(&files.files(), "a.gltf", "/materials/0/pbrMetallicRoughness/baseColorTexture", PLACE);
}

#[test]
fn a_second_set_of_coordinates_is_read_where_it_is_used() {
    let with = |emissive: Value| {
        let material = json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": emissive,
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        square(material).files().scene("a.gltf")
    };
    let scene = with(json!({"index": 0}));
    assert_eq!((meshes(&scene)[0].second_uvs.len(), scene.textures.len()), (0, 1), "nothing is paid for");
    let scene = with(json!({"index": 0, "texCoord": 1}));
    assert_eq!(meshes(&scene)[0].second_uvs, [Vec2::new(0.75, 0.5); 4]);
    assert_eq!(scene.textures.len(), 2);
    assert!(
        scene.textures[0].pixels.bytes().as_ptr_range() == scene.textures[1].pixels.bytes().as_ptr_range(),
        "one picture"
    );
    // Lit from above, red or blue of matte metal, and blue glow all over.
    let [left, right] = halves(&scene);
    assert!(left.z == 1.0 && left.x > 0.4 && right.z > 1.4, "{left} {right}");
}

/// Metal in blue, roughness in green: the left half is not metal and smooth, the right half is metal.
#[test]
fn metalness_and_roughness_vary_over_the_surface() {
    let pbr = |extra: Value| {
        let mut pbr = json!({"baseColorFactor": [0.5, 0.25, 1, 1], "roughnessFactor": 0.5});
        pbr.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        json!({"pbrMetallicRoughness": pbr})
    };
    // Green is 0 in both pixels, so the texture takes all roughness away: the exponent is that of the least.
    let [left, right] = seen(pbr(json!({"metallicRoughnessTexture": {"index": 0}})));
    let smooth = json!({"roughnessFactor": 0, "metallicFactor": 0});
    let metal = json!({"roughnessFactor": 0, "metallicFactor": 1});
    assert_eq!([left, right], [seen(pbr(smooth))[0], seen(pbr(metal))[1]]);
    assert_ne!(left, right);
}

#[test]
fn what_is_not_metal_mirrors_as_its_specular_says() {
    let with = |specular: Value| {
        let material = json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.5},
            "extensions": {"KHR_materials_specular": specular}});
        only(material).specular
    };
    assert_eq!(with(json!({})), Vec3::splat(0.04));
    assert_eq!(with(json!({"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2]})), Vec3::new(0.02, 0.01, 0.04));
    // Of the picture's two pixels, alpha is 1 and 128 / 255, red is 1 and 0, on average.
    let mean = with(json!({"specularTexture": {"index": 0}}));
    assert!((mean.x - 0.04 * (1.0 + 128.0 / 255.0) / 2.0).abs() < 1e-7, "{mean}");
    assert_eq!(with(json!({"specularColorTexture": {"index": 0}})), Vec3::new(0.02, 0.0, 0.02));
    let bad = json!({"extensions": {"KHR_materials_specular": {"specularFactor": 2}}});
    refused(&square(bad).files(), "a.gltf", "/materials/0/extensions", "KHR_materials_specular");
}

#[test]
fn specular_and_glossiness() {
    const NAME: &str = "KHR_materials_pbrSpecularGlossiness";
    let with = |values: Value| json!({"extensions": {NAME: values}});
    let plastic = only(with(json!({"diffuseFactor": [0.5, 0.25, 1, 0.5], "specularFactor": [0.04, 0.04, 0.04],
        "glossinessFactor": 0.5})));
    assert_eq!((plastic.diffuse, plastic.specular), (Vec3::new(0.5, 0.25, 1.0) * 0.96, Vec3::splat(0.04)));
    assert_eq!((plastic.shininess, plastic.opacity), (30.0, 0.5));
    // A texture of both: what is mirrored is red at the left, blue at the right, and there half as glossy.
    let [left, right] = seen(with(json!({"diffuseFactor": [0, 0, 0, 1], "specularGlossinessTexture": {"index": 0}})));
    assert!(left.x > 0.4 && left.z == 0.0 && right.x == 0.0 && right.z > 0.4, "{left} {right}");
    let textured = seen(with(json!({"diffuseTexture": {"index": 0}, "specularFactor": [0, 0, 0]})));
    assert_eq!(textured, [Vec3::X, Vec3::Z]);
    let bad = with(json!({"glossinessFactor": 2}));
    refused(&square(bad).files(), "a.gltf", "/materials/0/extensions", NAME);
}

#[test]
fn transmission_varies_over_the_surface() {
    let glass = json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": {"index": 0}}}});
    // The left half lets all light through, and nothing is behind; the right half is matte.
    let [left, right] = seen(glass);
    assert!(left.max_element() < 0.1 && right.min_element() > 0.9, "{left} {right}");
}

#[test]
fn variants_of_materials() {
    let mut maker = square(json!({"name": "first"}));
    maker.json["materials"] = json!([{"name": "first"}, {"name": "second"}, {"name": "third"}]);
    maker.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    maker.json["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}, {"name": "dusk"}]}});
    maker.json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_materials_variants": {"mappings": [
        {"material": 1, "variants": [0]}, {"material": 2, "variants": [1]}]}});
    let files = maker.files();
    let with = |files: &Files, variant: Option<&str>| {
        let options = LoadOptions { variant: variant.map(str::to_owned), ..LoadOptions::default() };
        load(&files.path("a.gltf"), &options).map(|(scene, _)| scene.materials[0].name.clone())
    };
    for (variant, expected) in
        [(None, "first"), (Some("day"), "second"), (Some("night"), "third"), (Some("dusk"), "first")]
    {
        assert_eq!(with(&files, variant).unwrap(), expected);
    }
    let error = with(&files, Some("noon")).unwrap_err();
    assert!(
        error.exit_code() == 3 && error.to_string().contains("the file has \"day\", \"night\", \"dusk\""),
        "{error}"
    );
    let error = with(&Maker::triangle().files(), Some("day")).unwrap_err();
    assert!(error.to_string().contains("the file has none"), "{error}");
    let mapped = "/meshes/0/primitives/0/extensions/KHR_materials_variants/mappings/0/material";
    *maker.json.pointer_mut(mapped).expect("a mapping") = json!(7);
    let error = with(&maker.files(), Some("day")).unwrap_err().to_string();
    assert!(error.contains(&format!("{mapped}: there is no material 7")), "{error}");
}

/// Images that are the same bytes, in one view or in several, or the same file, are decoded once.
#[test]
fn a_picture_is_decoded_once_however_many_images_it_is() {
    let mut maker = square(json!({}));
    let views = [maker.view(&obj::picture()), maker.view(&obj::picture())];
    let file = json!({"uri": "p.png"});
    maker.json["images"] =
        json!([{"bufferView": views[0]}, {"bufferView": views[0]}, {"bufferView": views[1]}, file, file]);
    maker.json["images"].as_array_mut().unwrap().iter_mut().for_each(|image| image["mimeType"] = json!("image/png"));
    maker.json["textures"] = (0..5).map(|source| json!({"source": source})).collect();
    let material = |i| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}});
    maker.json["materials"] = (0..5).map(material).collect();
    let primitive = maker.json["meshes"][0]["primitives"][0].clone();
    let primitives = (0..5).map(|i| {
        let mut primitive = primitive.clone();
        primitive["material"] = json!(i);
        primitive
    });
    maker.json["meshes"][0]["primitives"] = primitives.collect();
    let scene = maker.files().and("p.png", obj::picture()).scene("a.gltf");
    let mut places: Vec<_> = scene.textures.iter().map(|texture| texture.pixels.bytes().as_ptr()).collect();
    assert_eq!(places.len(), 5);
    places.sort();
    places.dedup();
    assert_eq!(places.len(), 2, "one of bytes, one of the file");
}

/// A file may hold words of any length, messages may not.
#[test]
fn what_a_message_quotes_is_cut() {
    let long = "x".repeat(100_000);
    for json in [
        json!({"asset": {"version": "2.0"}, "nodes": long}),
        json!({"asset": {"version": long}}),
        json!({"asset": {"version": "2.0"}, "images": [{"name": long, "uri": "data:,x"}], "textures": [{"source": 0}]}),
        json!({"asset": {"version": "2.0"}, "extensionsRequired": [long]}),
        json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": long}]}),
    ] {
        let files = Files::one("a.gltf", json.to_string());
        let words = match load(&files.path("a.gltf"), &LoadOptions::default()) {
            Ok((_, warnings)) => warnings.iter().map(ToString::to_string).collect(),
            Err(error) => error.to_string(),
        };
        assert!(words.len() < 1000, "{words}");
    }
}
