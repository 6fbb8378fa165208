//! Every accelerator gives the hits of brute force, to the bit; and what is said about them: tables, charts, refusals.

use std::process::{Command, Output};
use std::time::Duration;

use twincast::lab::all::{Report, Setup};
use twincast::lab::{Entrant, bench};
use twincast::math::{DAffine3, DMat3, DVec3, UVec3, Vec3};
use twincast::render::Control;
use twincast::scene::{Camera, Geometry, Group, Instance, Material, Mesh, Scene};
use twincast::trace::accel::{Accel, Methods, Options, Resolution};
use twincast::trace::brute::Brute;
use twincast::{Batch, Hit, Ray, Renderer, Settings, Shape, Sphere, SphereMethod, Tracer, TriangleMethod, World};

use crate::scenes::{self, Random};

/// All but the native BVH, which has tests of its own, and brute force.
fn accelerators() -> impl Iterator<Item = Accel> {
    Accel::ALL.into_iter().filter(|accel| !matches!(accel, Accel::Bvh | Accel::Brute))
}

/// Closest hits, occlusion and occlusion of batches against what brute force found.
#[track_caller]
pub(crate) fn assert_accelerators(world: &World, rays: &[Ray], expected: &[Option<Hit>]) {
    for accel in accelerators() {
        assert_accelerator(world, accel, &Options::default(), rays, expected);
    }
}

#[track_caller]
fn assert_accelerator(world: &World, accel: Accel, options: &Options, rays: &[Ray], expected: &[Option<Hit>]) {
    let (tracer, name) = (accel.build(world, options).tracer, accel.name());
    for (ray, expected) in rays.iter().zip(expected) {
        assert_eq!(tracer.closest(ray), *expected, "{name} {ray:?}");
        assert_eq!(tracer.occluded(ray), expected.is_some(), "occluded {name} {ray:?}");
    }
    let mut occluded = vec![false; rays.len()];
    tracer.occluded_batch(rays, &mut occluded, Batch::default());
    for ((ray, occluded), expected) in rays.iter().zip(occluded).zip(expected) {
        assert_eq!(occluded, expected.is_some(), "occluded batch {name} {ray:?}");
    }
}

/// The same, with brute force to find what is right; the number of hits.
#[track_caller]
fn assert_brute(scene: &Scene, rays: &[Ray]) -> usize {
    let world = World::new(scene).expect("sound");
    let brute = Brute::new(&world);
    let expected: Vec<Option<Hit>> = rays.iter().map(|ray| brute.closest(ray)).collect();
    assert_accelerators(&world, rays, &expected);
    expected.iter().flatten().count()
}

/// A teapot in a stadium: a dense mesh in a corner of a large one.
fn mixed_scales() -> Mesh {
    let small = scenes::bumpy_sphere(40, 0.2, 3);
    let large = scenes::soup(60, 1.0, 4);
    let mut positions: Vec<Vec3> = small.positions.iter().map(|p| *p * 0.01 + Vec3::new(0.5, -0.3, 0.2)).collect();
    let first = positions.len() as u32;
    positions.extend(large.positions.iter());
    let triangles = small.triangles.iter().copied().chain(large.triangles.iter().map(|t| t.map(|i| i + first)));
    Mesh::new(positions, triangles.collect())
}

#[test]
fn mixed_scales_nest_grids() {
    let mesh = mixed_scales();
    let targets = mesh.positions.to_vec();
    let scene = scenes::of_mesh(mesh);
    let mut rays = scenes::rays(2000, &targets, 6);
    // Some from next to the small mesh.
    for ray in rays.iter_mut().step_by(3) {
        ray.origin = Vec3::new(0.5, -0.3, 0.2) + ray.origin * 0.008;
    }
    assert!(assert_brute(&scene, &rays) > 500);
    let world = World::new(&scene).expect("sound");
    let notes = Accel::Grid.build(&world, &Options::default()).notes.join(" ");
    let nested = notes.split(", ").nth(1).and_then(|rest| rest.split(' ').next()?.parse::<u32>().ok());
    assert!(nested.is_some_and(|nested| nested > 0), "{notes}");
}

/// Any resolution gives the same hits, and the one that was asked for.
#[test]
fn grids_of_any_resolution() {
    let mesh = scenes::soup(500, 0.2, 8);
    let rays = scenes::rays(600, &mesh.positions.to_vec(), 2);
    let world = World::new(&scenes::of_mesh(mesh)).expect("sound");
    let expected: Vec<Option<Hit>> = rays.iter().map(|ray| Brute::new(&world).closest(ray)).collect();
    for (resolution, said) in [
        (Resolution::Longest(1), " 1 x 1 x 1 "),
        (Resolution::Axes(UVec3::new(3, 50, 1)), " 3 x 50 x 1 "),
        (Resolution::Axes(UVec3::splat(90)), " 90 x 90 x 90 "),
    ] {
        let options = Options { grid: Some(resolution), ..Options::default() };
        let notes = Accel::Grid.build(&world, &options).notes.join(" ");
        assert!(notes.contains(said), "{notes}");
        assert_accelerator(&world, Accel::Grid, &options, &rays, &expected);
    }
}

/// Rays from where coordinates are a billion times those of the scene, and beyond.
#[test]
fn rays_from_far_away() {
    let mesh = scenes::bumpy_sphere(20, 0.2, 5);
    let targets = mesh.positions.to_vec();
    let mut random = Random::new(7);
    let mut rays = Vec::new();
    for distance in [1e3f32, 1e6, 1e9, 1e15] {
        for i in 0..300 {
            let direction = if i % 3 == 0 { Vec3::AXES[i / 3 % 3] } else { random.vec3() };
            let target = targets[random.below(targets.len())] * 0.9;
            rays.push(Ray::new(target - direction * distance, direction));
        }
    }
    let hits = assert_brute(&scenes::of_mesh(mesh), &rays);
    assert!(hits > 300, "{hits} hits");
}

/// Objects under transforms that shear, mirror, and scale to next to nothing along one axis or to a million times the size.
#[test]
fn odd_transforms() {
    let mut scene = scenes::instanced(11);
    let shear = |k: f64| DMat3::from_cols(DVec3::X, DVec3::new(k, 1.0, 0.0), DVec3::new(0.0, -k, 1.0));
    let matrices = [
        shear(3.0),
        shear(300.0),
        DMat3::from_diagonal(DVec3::new(1.0, 1e-5, -1.0)),
        DMat3::from_diagonal(DVec3::splat(1e-4)) * shear(1.0),
        DMat3::from_diagonal(DVec3::splat(1e6)),
    ];
    for (i, matrix) in matrices.into_iter().enumerate() {
        for group in 0..3 {
            let transform =
                DAffine3 { matrix3: matrix, translation: DVec3::new(i as f64 - 2.0, f64::from(group), 0.3) };
            scene.instances.push(Instance { name: format!("odd {i}"), group, transform, transform_end: None });
        }
    }
    let targets: Vec<Vec3> = (0..200).scan(Random::new(2), |random, _| Some(random.vec3() * 2.5)).collect();
    let hits = assert_brute(&scene, &scenes::rays(1500, &targets, 3));
    assert!(hits > 200, "{hits} hits");
}

/// A setup of a small scene of meshes, spheres and instances.
fn report_of(scene: &Scene, random: u64, longest: Duration) -> Report {
    let world = World::new(scene).expect("sound");
    let camera = Camera::framing(&scene.bounds(), 1.0);
    let settings = Settings { width: 24, height: 24, ..Settings::default() };
    let renderer = Renderer::new(scene, &world, camera, settings).expect("a renderer");
    let options = Options::default();
    let size = (24, 24);
    let setup = Setup { scene: "instances", renderer: &renderer, size, random, seed: 1, longest, options: &options };
    setup.run(Control::default()).expect("nothing stops it")
}

#[test]
fn all_of_them_are_compared_and_none_is_wrong() {
    let report = report_of(&scenes::instanced(5), 3000, Duration::from_secs(60));
    assert_eq!((report.rays, report.compared), (24 * 24 + 3000, 24 * 24 + 3000));
    report.check().expect("nothing is wrong");
    assert_eq!(report.rows.len(), Entrant::all().len());
    let native = report.rows.iter().filter(|row| row.name != "embree");
    for row in native {
        assert_eq!((row.differing, row.native_wrong), (0, 0), "{}", row.name);
        assert!(row.mrays_per_s > 0.0 && row.bytes > 0, "{}", row.name);
    }
    let table = report.to_string();
    for words in ["all 3576 rays", "brute ", "groups ", "binary-bvh ", "octree ", "kd-tree ", "bsp ", "grid: a grid of"]
    {
        assert!(table.contains(words), "{words} in {table}");
    }
}

#[test]
fn brute_force_without_time_compares_a_sample_and_says_so() {
    let report = report_of(&scenes::of_mesh(scenes::soup(2000, 0.1, 1)), 30_000, Duration::ZERO);
    assert!(report.compared > 0 && report.compared < report.rays, "{} of {}", report.compared, report.rays);
    let table = report.to_string();
    assert!(table.contains("a random sample") && table.contains(&format!("of {} rays", report.rays)), "{table}");
}

#[test]
fn a_wrong_accelerator_fails_the_check() {
    let mut report = report_of(&scenes::of_mesh(scenes::soup(20, 0.5, 1)), 10, Duration::from_secs(1));
    report.check().expect("nothing is wrong");
    report.rows[3].native_wrong = 2;
    let error = report.check().expect_err("one is wrong");
    assert!(error.exit_code() == 1 && error.to_string().contains(report.rows[3].name), "{error}");
    report.rows[3].native_wrong = 0;
    report.rows[4].embree_wrong = 2;
    report.check().expect("only Embree's own");
}

/// Geometries of one group each, far apart: what a list of boxes is for.
#[test]
fn groups_are_the_scenes_own() {
    let meshes: Vec<Geometry> = (0..5)
        .map(|i| {
            let mut mesh = scenes::bumpy_sphere(8, 0.2, i);
            let moved: Vec<Vec3> = mesh.positions.iter().map(|p| *p + Vec3::X * 3.0 * i as f32).collect();
            mesh.positions = moved.into();
            Geometry::Mesh(mesh)
        })
        .collect();
    let groups = (0..5).map(|i| Group { name: String::new(), geometries: i..i + 1 }).collect();
    let instance = |group| Instance { name: String::new(), group, transform: DAffine3::IDENTITY, transform_end: None };
    let instances = (0..5).map(instance).collect();
    let scene =
        Scene { geometries: meshes, groups, instances, materials: vec![Material::default()], ..Scene::default() };
    let targets: Vec<Vec3> = (0..50).map(|i| Vec3::X * 0.3 * i as f32).collect();
    assert!(assert_brute(&scene, &scenes::rays(1500, &targets, 4)) > 300);
}

/// Point location through what is public: the cell holds the point, and names few of the items.
#[test]
fn trees_that_divide_space_know_where_points_are() {
    let mesh = scenes::soup(3000, 0.05, 2);
    let world = World::new(&scenes::of_mesh(mesh)).expect("sound");
    let mut random = Random::new(1);
    for accel in Accel::ALL {
        let tracer = accel.build(&world, &Options::default()).tracer;
        let divides_space = matches!(accel, Accel::Kd | Accel::Bsp);
        assert!(tracer.locate(Vec3::splat(50.0)).is_none());
        for _ in 0..100 {
            let point = random.vec3() * 0.9;
            let cell = tracer.locate(point);
            assert_eq!(cell.is_some(), divides_space, "{}", accel.name());
            if let Some(cell) = cell {
                assert!(cell.contains(point.as_dvec3()) && cell.items.len() < 300, "{point} {cell:?}");
            }
        }
    }
}

fn twincast(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_twincast")).args(args).output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn pyramid(folder: &tempfile::TempDir) -> String {
    let path = folder.path().join("scene.obj");
    let scene = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1.5 0\nf 1 2 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n";
    std::fs::write(&path, scene).expect("a file");
    path.to_str().expect("UTF-8").to_owned()
}

#[test]
fn every_accelerator_renders_the_same_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = pyramid(&folder);
    let render = |name: &str, more: &[&str]| {
        let path = folder.path().join(name);
        let args = ["render", &scene, "-o", path.to_str().expect("UTF-8"), "--size", "60x40"];
        let output = twincast(&[&args[..], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let picture = twincast::image::read(&path).expect("a picture");
        (picture, text(&output.stdout))
    };
    let (expected, _) = render("bvh.exr", &[]);
    for accel in Accel::ALL {
        let name = accel.name();
        let (picture, summary) = render(&format!("{name}.exr"), &["--accel", name]);
        assert!(picture == expected, "{name}");
        assert!(accel == Accel::Bvh || summary.contains(&format!("native ({name})")), "{summary}");
    }
    let (picture, summary) = render("grid.exr", &["--accel", "grid", "--grid", "7"]);
    assert!(picture == expected && summary.contains("a grid of 7 x 5 x 7 cells"), "{summary}");
}

#[test]
fn what_does_not_go_together_ends_with_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let kept = folder.path().join("kept");
    let kept = kept.to_str().expect("UTF-8");
    for (more, words) in [
        (&["--accel", "kd-tree", "--cache", kept][..], "--cache"),
        (&["--accel", "grid", "--build", "high"], "--build"),
        (&["--accel", "grid", "--max-memory", "1G"], "--max-memory"),
        (&["--grid", "5"], "--accel grid"),
        (&["--accel", "octree", "--grid", "5"], "--accel grid"),
        (&["--accel", "grid", "--grid", "0"], "1 to 2048"),
        (&["--accel", "grid", "--grid", "1x2"], "XxYxZ"),
        (&["--accel", "quadtree"], "kd-tree"),
    ] {
        let output = twincast(&[&["render", "x.glb", "-o", "x.png"][..], more].concat());
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains(words), "{more:?}: {message}");
    }
    if cfg!(feature = "embree") {
        for backend in ["embree", "both"] {
            let output = twincast(&["render", "x.glb", "-o", "x.png", "--accel", "grid", "--backend", backend]);
            let message = text(&output.stderr);
            assert!(output.status.code() == Some(2) && message.contains("--accel grid"), "{message}");
        }
    }
    for args in [
        &["compare", "x.glb", "--all", "--accel", "grid"][..],
        &["compare", "x.glb", "--seconds", "3"],
        &["bench", "--max", "100"],
        &["bench", "--scaling", "--modes", "fast"],
        &["bench", "--scaling", "--max", "5"],
    ] {
        assert_eq!(twincast(args).status.code(), Some(2), "{args:?}");
    }
}

#[test]
fn compare_all_prints_a_table_or_one_document() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = pyramid(&folder);
    let args = ["compare", &scene, "--all", "--size", "40x30", "--random", "1000"];
    let output = twincast(&args);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    assert!(Accel::ALL.iter().all(|accel| table.contains(accel.name())), "{table}");
    let output = twincast(&[&args[..], &["--json"]].concat());
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    assert_eq!(document["rays"], 40 * 30 + 1000);
    assert_eq!(document["rows"].as_array().map(Vec::len), Some(Entrant::all().len()));
    assert_eq!(document["rows"][0]["name"], "brute");
}

#[cfg(feature = "embree")]
#[test]
fn an_accelerator_is_compared_with_embree() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = pyramid(&folder);
    let output = twincast(&["compare", &scene, "--accel", "octree", "--size", "40x30", "--random", "1000"]);
    let table = text(&output.stdout);
    assert!(output.status.success() && table.contains("native_wrong                   0"), "{table}");
}

#[cfg(feature = "embree")]
#[test]
fn accelerators_are_measured_beside_the_engines() {
    let args =
        ["bench", "terrain20", "--modes", "default", "--rays", "primary,shadow", "--size", "64", "--repeat", "1"];
    let output = twincast(&[&args[..], &["--accel", "grid,kd-tree", "--grid", "9"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    assert!(table.contains("native grid") && table.contains("native kd-tree"), "{table}");
    let output = twincast(&[&args[..], &["--accel", "octree", "--grid", "9"]].concat());
    assert_eq!(output.status.code(), Some(2), "a resolution without a grid");
}

#[test]
fn scaling_prints_a_table_or_one_document_and_draws() {
    let folder = tempfile::tempdir().expect("a folder");
    let chart = folder.path().join("scaling.svg");
    let args = ["bench", "--scaling", "--max", "100", "--threads", "1"];
    let output = twincast(&[&args[..], &["--json", "--chart", chart.to_str().expect("UTF-8")]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    let points = document["points"].as_array().expect("points");
    assert_eq!(points.len(), 2 * 3 * Entrant::all().len(), "families, numbers, accelerators");
    assert!(points.iter().all(|p| p["microseconds_a_ray"].as_f64().is_some_and(|t| t > 0.0)), "{document}");
    assert_eq!(document["grids"].as_array().map(Vec::len), Some(10));
    let drawn = std::fs::read_to_string(&chart).expect("a chart");
    assert!(drawn.contains("terrain: microseconds a ray") && drawn.contains(">kd-tree<"), "{drawn}");
    let report = bench::ScalingReport::default();
    assert!(bench::scaling_chart(&report, &[]).contains("</svg>"), "an empty report is drawn, too");
}

/// A textbook's method misses rays at the edges that triangles share, and the accelerator shows it; the exact one does not.
#[test]
fn methods_can_be_chosen_and_show_what_they_miss() {
    // A fan of slivers around the origin, in a plane that leans; rays at points of the shared edges.
    let corner = |i: u32| {
        let angle = f64::from(i) / 50.0 * std::f64::consts::TAU;
        Vec3::new(angle.cos() as f32 * 0.7, angle.sin() as f32 * 0.9, (angle.cos() * 0.3 + angle.sin() * 0.1) as f32)
    };
    let positions: Vec<_> = (0..50).map(corner).chain([Vec3::new(1e-3, 2e-3, 0.0)]).collect();
    let triangles = (0..50).map(|i| [i, (i + 1) % 50, 50]).collect();
    let scene = Scene::from_geometries(vec![Geometry::Mesh(Mesh::new(positions.clone(), triangles))], Vec::new());
    let world = World::new(&scene).unwrap();
    let origin = Vec3::new(0.37, -0.21, 5.3);
    let rays: Vec<_> = (0..50)
        .flat_map(|i| (1..200).map(move |k| (i, k as f32 / 200.0)))
        .map(|(i, s)| Ray::new(origin, positions[50].lerp(positions[i], s) - origin))
        .collect();
    let misses = |triangle: TriangleMethod| {
        let options = Options { methods: Methods { triangle, ..Methods::default() }, ..Options::default() };
        let tracer = Accel::Binary.build(&world, &options);
        rays.iter().filter(|ray| tracer.closest(ray).is_none()).count()
    };
    assert_eq!(misses(TriangleMethod::Exact), 0);
    assert!(misses(TriangleMethod::MoellerTrumbore) > 0, "it is not watertight");
}

/// Where nothing cancels, every sphere method sees the same sphere from outside and from inside.
#[test]
fn sphere_methods_agree_on_plain_rays() {
    let sphere = Shape::Sphere(Sphere { centre: Vec3::new(1.0, 2.0, 3.0), radius: 2.0 });
    let geometry = Geometry::Shapes { shapes: vec![sphere], material: 0 };
    let world = World::new(&Scene::from_geometries(vec![geometry], Vec::new())).unwrap();
    for method in SphereMethod::ALL {
        let options = Options { methods: Methods { sphere: method, ..Methods::default() }, ..Options::default() };
        let tracer = Accel::Kd.build(&world, &options);
        let t = |z: f32| tracer.closest(&Ray::new(Vec3::new(1.0, 2.0, z), Vec3::Z)).map(|hit| hit.t);
        assert_eq!([t(-3.0), t(3.0), t(6.0)], [Some(4.0), Some(2.0), None], "{method:?}");
    }
}
