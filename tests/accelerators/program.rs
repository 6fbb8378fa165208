//! What the program says and draws of accelerators: flags, refusals, tables, charts.

use twincast::lab::{Entrant, bench};
use twincast::trace::accel::Accel;

use crate::program::{text, twincast};

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
        (&["--accel", "octree", "--grid", "5"], "--accel grid"),
        (&["--accel", "brute", "--triangle-method", "woop"], "--accel binary-bvh"),
        (&["--accel", "grid", "--grid", "0"], "1 to 2048"),
        (&["--accel", "grid", "--grid", "1x2"], "XxYxZ"),
        (&["--accel", "quadtree"], "kd-tree"),
    ] {
        let output = twincast(&[&["render", "x.glb", "-o", "x.png"][..], more].concat());
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains(words), "{more:?}: {message}");
    }
    if cfg!(feature = "embree") {
        let output = twincast(&["render", "x.glb", "-o", "x.png", "--accel", "grid", "--backend", "embree"]);
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains("--accel grid"), "{message}");
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

/// A sphere, and what its file asks for.
fn asking(folder: &tempfile::TempDir, keys: &str) -> String {
    let path = folder.path().join("asking.toml");
    std::fs::write(&path, format!("[render]\n{keys}\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n")).expect("a file");
    path.to_str().expect("UTF-8").to_owned()
}

#[test]
fn scenes_choose_their_accelerator_and_flags_win() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png");
    let picture = picture.to_str().expect("UTF-8");
    let render = |keys: &str, more: &[&str]| {
        let scene = asking(&folder, keys);
        let output = twincast(&[&["render", &scene, "-o", picture, "--size", "20x20"], more].concat());
        (output.status.code(), text(&output.stdout) + &text(&output.stderr))
    };
    let grid = "accel = \"grid\"\ngrid = 5";
    let methods = "accel = \"kd-tree\"\nsphere_method = \"geometric\"";
    for (keys, more, code, words) in [
        ("accel = \"octree\"", &[][..], 0, "native (octree)"),
        ("accel = \"octree\"", &["--accel", "kd-tree"], 0, "native (kd-tree)"),
        ("accel = \"octree\"", &["--accel", "bvh"], 0, "native (BVH)"),
        (grid, &[], 0, "5 x 5 x 5 cells"),
        (grid, &["--grid", "3"], 0, "3 x 3 x 3 cells"),
        (grid, &["--accel", "bsp"], 0, "native (bsp)"),
        ("", &["--grid", "3"], 2, "--accel grid"),
        (methods, &[], 0, "native (kd-tree)"),
        (methods, &["--accel", "bvh"], 2, "sphere_method = \"geometric\""),
        (methods, &["--accel", "bvh", "--sphere-method", "exact"], 0, "native (BVH)"),
        ("accel = \"bsp\"", &["--max-memory", "1G"], 2, "write --accel bvh"),
    ] {
        let (found, said) = render(keys, more);
        assert!(found == Some(code) && said.contains(words), "{keys} {more:?}: {found:?} {said}");
    }
    if cfg!(feature = "embree") {
        assert!(render("accel = \"octree\"", &["--backend", "embree"]).1.contains("embree"));
        let (code, said) = render(methods, &["--backend", "embree"]);
        assert!(code == Some(2) && said.contains("--backend native"), "{said}");
        assert_eq!(render(methods, &["--backend", "embree", "--sphere-method", "exact"]).0, Some(0));
        // Embree beside the scene's accelerator, and beside the flag's.
        let (code, said) = render("accel = \"octree\"", &["--backend", "both"]);
        assert!(code == Some(0) && said.contains("native (octree)") && said.contains("pixels of native"), "{said}");
        let (code, said) = render("", &["--backend", "both", "--accel", "bsp"]);
        assert!(code == Some(0) && said.contains("native (bsp)"), "{said}");
        let output = twincast(&["compare", &asking(&folder, grid), "--size", "20x20", "--random", "500"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
}

/// A limit on memory ends the series before it is passed, and says so.
#[test]
fn scaling_ends_where_memory_would() {
    if cfg!(not(target_os = "linux")) {
        return;
    }
    let args = ["bench", "--scaling", "--max", "300000", "--threads", "1", "--max-memory", "1M", "--json"];
    let output = twincast(&args);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    assert_eq!(document["points"].as_array().map(Vec::len), Some(0), "{document}");
    assert_eq!(document["grids"].as_array().map(Vec::len), Some(0), "{document}");
    let stopped = document["stopped"].to_string();
    assert!(
        stopped.contains("terrain ends at 0: 10 triangles may take") && stopped.contains("of 1049 kB allowed"),
        "{stopped}"
    );
}

/// A sphere above a mirror: how many rays are compared tells how often they were sent on.
#[cfg(feature = "embree")]
#[test]
fn rays_are_followed_as_often_as_the_scene_asks() {
    let folder = tempfile::tempdir().expect("a folder");
    let rays = |depth: u32| {
        let path = folder.path().join("mirrors.toml");
        let mirrors = "[material.m]\nreflection = 1\n[[plane]]\npoint = [0, -1, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n\
            [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n";
        std::fs::write(&path, format!("[render]\nmax_depth = {depth}\n{mirrors}")).expect("a file");
        let path = path.to_str().expect("UTF-8");
        let output = twincast(&["compare", path, "--size", "20x20", "--random", "0", "--json"]);
        let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
        document["rays"].as_u64().expect("a number")
    };
    let counts = [rays(0), rays(1), rays(4)];
    assert!(counts[0] == 400 && counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
}
