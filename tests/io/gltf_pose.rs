//! Animations, skins and morph targets of glTF, against closed forms.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use serde_json::{Value, json};
use twincast::Scene;
use twincast::io::{Animation, LoadOptions, load};
use twincast::math::{DMat3, DVec3, Vec2, Vec3, Vec4};

use super::gltf_maker::{Maker, U8};
use super::{Files, corners, meshes, model};

fn at(time: f64) -> Animation {
    Animation { time: Some(time), ..Animation::default() }
}

fn posed(files: &Files, animation: Animation) -> Scene {
    let options = LoadOptions { animation, ..LoadOptions::default() };
    load(&files.path("a.gltf"), &options).unwrap_or_else(|e| panic!("{e}")).0
}

fn fault(files: &Files, animation: Animation, place: &str, words: &str) {
    let options = LoadOptions { animation, ..LoadOptions::default() };
    let error = load(&files.path("a.gltf"), &options).map(|_| ()).expect_err("an error").to_string();
    assert!(error.contains(place) && error.contains(words), "{error} has no {place} {words}");
}

fn origin(scene: &Scene) -> DVec3 {
    scene.instances[0].transform.translation
}

/// What shrinks to nothing is not there at that time, which is no fault of the file.
#[test]
fn at_some_time_there_may_be_nothing() {
    let files = Maker::animated("scale", "LINEAR", &[0., 1.], "VEC3", &[1., 1., 1., 0., 0., 0.]).files();
    let count = |time| posed(&files, at(time)).primitive_count();
    assert_eq!((count(0.0), count(0.5), count(1.0)), (1, 1, 0));
}

#[test]
fn values_between_keys() {
    let values = [0., 0., 0., 4., 2., 0., 4., 2., 8.];
    let times = [1., 3., 4.];
    let linear = Maker::animated("translation", "LINEAR", &times, "VEC3", &values).files();
    for (time, expected) in [
        (0.0, [0., 0., 0.]),
        (1.0, [0., 0., 0.]),
        (1.5, [1., 0.5, 0.]),
        (3.0, [4., 2., 0.]),
        (3.75, [4., 2., 6.]),
        (4.0, [4., 2., 8.]),
        (100.0, [4., 2., 8.]),
    ] {
        assert_eq!(origin(&posed(&linear, at(time))), DVec3::from(expected), "at {time}");
    }
    let step = Maker::animated("translation", "STEP", &times, "VEC3", &values).files();
    for (time, x) in [(0.0, 0.), (2.999, 0.), (3.0, 4.), (3.999, 4.)] {
        assert_eq!(origin(&posed(&step, at(time))).x, x, "at {time}");
    }
    assert_eq!(origin(&posed(&step, Animation::default())), DVec3::ZERO, "as it is stored");
}

/// The cubic t^3 over two seconds, whose tangents are 3 t^2, is its own spline.
#[test]
fn splines_are_exact_for_cubics() {
    let key = |t: f32| [3.0 * t * t, 0.0, 0.0, t * t * t, 0.0, 0.0, 3.0 * t * t, 0.0, 0.0];
    let values: Vec<f32> = [1.0, 3.0, 4.0].into_iter().flat_map(key).collect();
    let files = Maker::animated("translation", "CUBICSPLINE", &[1., 3., 4.], "VEC3", &values).files();
    for time in [1.0, 1.25, 2.0, 2.875, 3.0, 3.5, 4.0f64] {
        let got = origin(&posed(&files, at(time))).x;
        assert!((got - time.powi(3)).abs() < 1e-12, "{got} at {time}");
    }
}

#[test]
fn rotations_turn_evenly_and_normalised() {
    let half = std::f32::consts::FRAC_PI_4;
    let turn = [0., 0., 0., 1., 0., 0., half.sin(), half.cos()];
    let files = Maker::animated("rotation", "LINEAR", &[0., 1.], "VEC4", &turn).files();
    for time in [0.0, 0.25, 0.5, 1.0] {
        let matrix = posed(&files, at(time)).instances[0].transform.matrix3;
        assert!(matrix.abs_diff_eq(DMat3::from_rotation_z(FRAC_PI_2 * time), 1e-7), "{matrix} at {time}");
    }
    // Normalised shorts: (0, 0, 0, 1) and (0, 0, 1, 0), half a turn.
    let mut maker = Maker::animated("rotation", "LINEAR", &[0., 1.], "VEC4", &turn);
    let shorts: Vec<u8> = [0i16, 0, 0, 32767, 0, 0, 32767, 0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let output = maker.accessor("VEC4", 5122, true, 8, &shorts);
    maker.json["animations"][0]["samplers"][0]["output"] = json!(output);
    let matrix = posed(&maker.files(), at(0.5)).instances[0].transform.matrix3;
    assert!(matrix.abs_diff_eq(DMat3::from_rotation_z(FRAC_PI_2), 1e-12), "{matrix}");
}

#[test]
fn which_animation_is_meant() {
    let mut maker = Maker::animated("translation", "STEP", &[0.], "VEC3", &[1., 0., 0.]);
    let first = maker.json["animations"][0].clone();
    let moved = maker.floats("VEC3", &[2., 0., 0.]);
    let mut second = first.clone();
    second["name"] = json!("Walk");
    second["samplers"][0]["output"] = json!(moved);
    maker.json["animations"] = json!([first, second]);
    let files = maker.files();
    let named = |name: &str| Animation { names: vec![name.into()], ..Animation::default() };
    assert_eq!(origin(&posed(&files, named("Walk"))).x, 2.0);
    assert_eq!(origin(&posed(&files, named("0"))).x, 1.0);
    fault(&files, at(0.0), "/animations", "the file has 0, \"Walk\"");
    // All at once, as Blender writes one for each object; of two that move the same the later one counts.
    let several =
        |names: &[&str]| Animation { names: names.iter().map(|&n| n.into()).collect(), ..Animation::default() };
    assert_eq!(["all", "0"].map(|name| origin(&posed(&files, several(&[name]))).x), [2.0, 1.0]);
    assert_eq!(origin(&posed(&files, several(&["Walk", "0"]))).x, 1.0);
    let size = maker.floats("VEC3", &[2.; 3]);
    maker.json["animations"][1]["channels"][0]["target"]["path"] = json!("scale");
    maker.json["animations"][1]["samplers"][0]["output"] = json!(size);
    let scene = posed(&maker.files(), several(&["all"]));
    assert_eq!((origin(&scene).x, scene.instances[0].transform.matrix3.x_axis.x), (1.0, 2.0));
    fault(&files, named("Run"), "/animations", "no animation \"Run\"");
    fault(&Maker::triangle().files(), at(0.0), "/animations", "the file has none");
}

#[test]
fn faults_of_animations() {
    let broken = |pointer: &str, value: Value, place: &str, words: &str| {
        let mut maker = Maker::animated("translation", "LINEAR", &[0., 1.], "VEC3", &[0.; 6]);
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        maker.json.pointer_mut(parent).unwrap()[key] = value;
        fault(&maker.files(), at(0.5), place, words);
    };
    broken("/animations/0/channels/0/sampler", json!(1), "/animations/0/channels/0/sampler", "no sampler 1");
    let animation = |channel: Value, sampler: Value| json!([{"channels": [channel], "samplers": [sampler]}]);
    let channel = |node: usize, path: &str| json!({"sampler": 0, "target": {"node": node, "path": path}});
    let sampler = json!({"input": 1, "output": 2});
    broken(
        "/animations",
        animation(channel(9, "scale"), sampler.clone()),
        "/animations/0/channels/0/target/node",
        "no node 9",
    );
    broken(
        "/animations",
        animation(channel(0, "scale"), json!({"input": 1, "output": 1})),
        "/accessors/1/type",
        "VEC3",
    );
    let cubic = json!({"input": 1, "output": 2, "interpolation": "CUBICSPLINE"});
    broken(
        "/animations",
        animation(channel(0, "scale"), cubic),
        "/animations/0/samplers/0/output",
        "2 values, where 2 keys need 6",
    );
    let odd = json!({"input": 1, "output": 2, "interpolation": "BEZIER"});
    broken("/animations", animation(channel(0, "scale"), odd), "/animations/0/samplers/0/interpolation", "BEZIER");
    let matrix = json!([{"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]);
    broken("/nodes", matrix, "/animations/0/channels/0/target/path", "has a matrix");
    let falling = Maker::animated("translation", "LINEAR", &[0., 2., 1., 3.], "VEC3", &[0.; 12]).files();
    fault(&falling, at(1.5), "/animations/0/samplers/0/input", "have to rise");
    let odd = Animation { time: Some(0.0), ..Animation::default() };
    let obj = Files::one("a.gltf", "").and("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let options = LoadOptions { animation: odd, ..LoadOptions::default() };
    let error = load(&obj.path("a.obj"), &options).map(|_| ()).expect_err("it has no animations").to_string();
    assert!(error.contains("only glTF"), "{error}");
}

/// A node that moves by 2 m a second, with a child: what hangs on it moves too, what stands beside it does not.
#[test]
fn things_move_while_the_shutter_is_open() {
    let mut maker = Maker::animated("translation", "LINEAR", &[0., 1.], "VEC3", &[0., 0., 0., 2., 0., 0.]);
    maker.json["nodes"] = json!([
        {"mesh": 0, "children": [1]}, {"mesh": 0, "translation": [0, 1, 0]}, {"mesh": 0},
        {"camera": 0, "translation": [0, 0, 5]},
    ]);
    maker.json["scenes"] = json!([{"nodes": [0, 2, 3]}]);
    maker.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}]);
    let open = Animation { time: Some(0.25), exposure: 0.25, names: Vec::new() };
    let scene = posed(&maker.files(), open);
    let ends: Vec<_> = scene.instances.iter().map(|i| (i.transform, i.transform_end)).collect();
    assert_eq!(ends[0].0.translation, DVec3::new(0.5, 0.0, 0.0));
    assert_eq!(ends[0].1.expect("it moves").translation, DVec3::new(1.0, 0.0, 0.0));
    assert_eq!(ends[1].1.expect("it moves along").translation, DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(ends[2].1, None);
    let still = posed(&maker.files(), at(0.25));
    assert!(still.instances.iter().all(|i| i.transform_end.is_none()));
    // A camera is where it is then.
    maker.json["animations"][0]["channels"][0]["target"]["node"] = json!(3);
    assert_eq!(posed(&maker.files(), at(0.5)).cameras[0].eye, DVec3::X);
}

/// Three vertices on two joints: the first follows the one, the second the other, the third both by halves. Which
/// joints weigh nothing does not matter.
fn skinned() -> Maker {
    let mut maker = Maker::triangle();
    let joints = maker.accessor("VEC4", U8, false, 12, &[0, 0, 0, 0, 1, 200, 0, 0, 0, 1, 0, 99]);
    let weights = maker.floats("VEC4", &[1., 0., 0., 0., 1., 0., 0., 0., 0.5, 0.5, 0., 0.]);
    let normals = maker.floats("VEC3", &[0., 0., 1., 0., 0., 1., 1., 0., 0.]);
    // The second joint is bound at (1, 0, 0): its inverse moves by (-1, 0, 0).
    let mut matrices = [0.0; 32];
    for joint in [0, 16] {
        (0..4).for_each(|k| matrices[joint + 5 * k] = 1.0);
    }
    matrices[16 + 12] = -1.0;
    let matrices = maker.floats("MAT4", &matrices);
    let attributes = &mut maker.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    attributes["NORMAL"] = json!(normals);
    maker.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": matrices}]);
    maker.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 100, 100]},
        {"translation": [0, 0, 3]},
        {"translation": [1, 0, 0], "rotation": [0, 0, FRAC_PI_4.sin(), FRAC_PI_4.cos()]},
    ]);
    maker.json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    maker
}

#[test]
fn skins_follow_their_joints() {
    let files = skinned().files();
    let scene = posed(&files, Animation::default());
    let mesh = meshes(&scene)[0];
    // The first is lifted by 3. The second is at its joint, which only turns. The third, at (0, 1, 0), is lifted by the
    // one, and by the other turned about (1, 0, 0), from (-1, 1, 0) to (-1, -1, 0) from there: the mean of (0, 1, 3)
    // and (0, -1, 0).
    let expected = [[0., 0., 3.], [1., 0., 0.], [0., 0., 1.5]];
    for (got, expected) in corners(mesh)[0].iter().zip(expected) {
        let got = got.as_dvec3() + mesh.origin;
        assert!((got - DVec3::from(expected)).length() < 1e-6, "{got} where {expected:?} belongs");
    }
    assert_eq!(mesh.normals[0], Vec3::Z);
    // The mean of no turn and of a right angle: along (1, 1, 0).
    assert!(mesh.normals[2].abs_diff_eq(Vec3::new(1.0, 1.0, 0.0).normalize(), 1e-6), "{}", mesh.normals[2]);
    assert_eq!(scene.instances[0].transform, twincast::math::DAffine3::IDENTITY, "its own place does not count");
}

/// Its node's place does not matter to a skinned mesh, but whether that is mirrored decides which side of a triangle is
/// its front.
#[test]
fn skins_of_mirrored_nodes_keep_their_front() {
    let order = |scale: [f64; 3]| {
        let mut maker = skinned();
        maker.json["nodes"][0]["scale"] = json!(scale);
        corners(meshes(&posed(&maker.files(), Animation::default()))[0])[0]
    };
    let [a, b, c] = order([1.0; 3]);
    assert_eq!(order([-1.0, 1.0, 1.0]), [a, c, b]);
    assert_eq!(order([-2.0, -1.0, 1.0]), [a, b, c]);
}

#[test]
fn faults_of_skins() {
    let broken = |change: &dyn Fn(&mut Maker), place: &str, words: &str| {
        let mut maker = skinned();
        change(&mut maker);
        fault(&maker.files(), Animation::default(), place, words);
    };
    broken(&|m| m.json["skins"][0]["joints"] = json!([1]), "JOINTS_0", "joint 1 of a skin that has 1");
    broken(&|m| m.json["skins"][0]["joints"] = json!([1, 9]), "/skins/0/joints/1", "no node 9");
    broken(&|m| m.json["scenes"] = json!([{"nodes": [0, 1]}]), "/skins/0/joints/1", "not in the scene");
    broken(&|m| m.json["nodes"][0]["skin"] = json!(1), "/nodes/0/skin", "no skin 1");
    let none = |m: &mut Maker| {
        m.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("JOINTS_0");
    };
    broken(&none, "/meshes/0/primitives/0/attributes", "no JOINTS_0");
}

/// Two targets: one moves all vertices along z, the other, sparse, only the last, along x.
fn morphing() -> Maker {
    let mut maker = Maker::triangle();
    let lift = maker.floats("VEC3", &[0., 0., 1., 0., 0., 2., 0., 0., 3.]);
    let (index, value) = (maker.view(&[2]), maker.view(&[5.0f32, 0.0, 0.0].map(f32::to_le_bytes).concat()));
    let accessors = maker.json["accessors"].as_array_mut().unwrap();
    accessors.push(json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": index, "componentType": U8}, "values": {"bufferView": value}}}));
    let sparse = accessors.len() - 1;
    maker.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": lift}, {"POSITION": sparse}]);
    maker.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    maker
}

#[test]
fn morph_targets_add_up() {
    let mut maker = morphing();
    let shape = |files: &Files, animation| corners(meshes(&posed(files, animation))[0])[0];
    let lifted = [Vec3::new(0.0, 0.0, 0.5), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.5)];
    assert_eq!(shape(&maker.files(), Animation::default()), lifted, "by the mesh's weights");
    maker.json["nodes"][0]["weights"] = json!([0.0, 2.0]);
    let pulled = [Vec3::ZERO, Vec3::X, Vec3::new(10.0, 1.0, 0.0)];
    assert_eq!(shape(&maker.files(), Animation::default()), pulled, "by the node's");
    // From (0, 0) to (1, 0.2).
    let (input, output) = (maker.floats("SCALAR", &[0., 1.]), maker.floats("SCALAR", &[0., 0., 1., 0.25]));
    maker.json["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        "samplers": [{"input": input, "output": output}],
    }]);
    let both = [Vec3::new(0.0, 0.0, 0.5), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.625, 1.0, 1.5)];
    assert_eq!(shape(&maker.files(), at(0.5)), both, "by the animation's");
    maker.json["nodes"][0]["weights"] = json!([1.0]);
    fault(&maker.files(), Animation::default(), "/nodes/0/weights", "1 weights for 2 morph targets");
    maker.json["nodes"][0].as_object_mut().unwrap().remove("weights");
    maker.json["meshes"][0]["weights"] = json!([1.0]);
    fault(&maker.files(), Animation::default(), "/meshes/0/weights", "1 weights for 2 morph targets");
}

/// By half of a target; colours stay within theirs, and what no target displaces stays.
#[test]
fn coordinates_and_colours_are_displaced_too() {
    let mut maker = morphing();
    let uvs = maker.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    let colors = maker.floats("VEC3", &[0.25, 0.5, 0.75, 0., 0., 0., 1., 1., 1.]);
    let drift = maker.floats("VEC2", &[0.5, 0.25, 0., 0., 0., -1.]);
    let glow = maker.floats("VEC3", &[0.5, 0., -4., 0., 0.5, 0., 1., 0., -1.]);
    let primitive = &mut maker.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
    primitive["attributes"]["COLOR_0"] = json!(colors);
    let still = posed(&maker.files(), Animation::default());
    maker.json["meshes"][0]["primitives"][0]["targets"][0]["TEXCOORD_0"] = json!(drift);
    maker.json["meshes"][0]["primitives"][0]["targets"][0]["COLOR_0"] = json!(glow);
    let moved = posed(&maker.files(), Animation::default());
    let [still, moved] = [&still, &moved].map(|scene| meshes(scene)[0].clone());
    // With v up.
    assert_eq!(still.uvs, [[0., 1.], [1., 1.], [0., 0.]].map(Vec2::from));
    assert_eq!(moved.uvs, [[0.25, 0.875], [1., 1.], [0., 0.5]].map(Vec2::from));
    assert_eq!(still.colors, [[0.25, 0.5, 0.75, 1.], [0., 0., 0., 1.], [1., 1., 1., 1.]].map(Vec4::from));
    assert_eq!(moved.colors, [[0.5, 0.5, 0., 1.], [0., 0.25, 0., 1.], [1., 1., 0.5, 1.]].map(Vec4::from));
    assert_eq!(still.positions, moved.positions);
    let short = maker.floats("VEC2", &[0., 0.]);
    maker.json["meshes"][0]["primitives"][0]["targets"][0]["TEXCOORD_0"] = json!(short);
    fault(&maker.files(), Animation::default(), "/accessors/", "TEXCOORD_0 has 1 elements for 3 positions");
}

/// Zeros that are not stored count once, however many targets they are.
#[test]
fn many_targets_may_move_little() {
    let (vertices, targets) = (25_000, 1_000);
    let mut maker = Maker::triangle();
    let positions = maker.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.].repeat(vertices / 3 + 1));
    let indices = maker.view(&[1, 0, 0, 0]);
    let values = maker.view(&[0.001f32, 0.0, 0.0].map(f32::to_le_bytes).concat());
    let count = 3 * (vertices / 3 + 1);
    let sparse = json!({"componentType": 5126, "count": count, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": indices, "componentType": 5125}, "values": {"bufferView": values}}});
    let accessors = maker.json["accessors"].as_array_mut().unwrap();
    accessors.push(sparse);
    let target = json!({"POSITION": accessors.len() - 1});
    maker.json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions}, "targets": vec![target; targets]}],
        "weights": vec![1; targets]}]);
    let scene = posed(&maker.files(), Animation::default());
    let moved = corners(meshes(&scene)[0])[0][1];
    assert!(moved.abs_diff_eq(Vec3::new(2.0, 0.0, 0.0), 1e-3), "{moved}");
}

#[test]
fn nodes_share_a_shape_where_it_is_the_same() {
    let mut maker = morphing();
    maker.json["nodes"] = json!([
        {"children": [1, 2, 3]}, {"mesh": 0}, {"mesh": 0, "weights": [0.5, 0.0]}, {"mesh": 0, "weights": [0.0, 0.0]},
    ]);
    let scene = posed(&maker.files(), Animation::default());
    let groups: Vec<_> = scene.instances.iter().map(|instance| instance.group).collect();
    assert_eq!((groups, scene.geometries.len()), (vec![0, 0, 1], 2));
}

/// The tutorial's skin (Khronos Group, *glTF tutorial*): ten vertices, the upper ones turned about (0, 1, 0), by 90
/// degrees after one second in their upper half.
#[test]
fn the_tutorials_skin_bends() {
    let Some(path) = model("gltf/SimpleSkin.gltf") else { return };
    let top = |time| {
        let options = LoadOptions { animation: at(time), ..LoadOptions::default() };
        let scene = load(&path, &options).unwrap().0;
        let mesh = meshes(&scene)[0].clone();
        let last = *mesh.positions.last().unwrap();
        mesh.origin + last.as_dvec3()
    };
    // The last vertex, at (0.5, 2, 0), has weights 0 and 1.
    let expected = |angle: f64| DVec3::Y + DMat3::from_rotation_z(angle) * DVec3::new(0.5, 1.0, 0.0);
    assert!((top(0.0) - expected(0.0)).length() < 1e-6, "{}", top(0.0));
    assert!((top(1.0) - expected(FRAC_PI_2)).length() < 1e-3, "{}", top(1.0));
    assert!((top(5.5) - expected(0.0)).length() < 1e-3, "{}", top(5.5));
}
