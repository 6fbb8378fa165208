//! The command line, as a user meets it: the binary is run.

use std::process::{Command, Output};

use clap::CommandFactory;
use twincast::cli::Cli;

fn twincast(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_twincast")).args(args).output().expect("the binary runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// Exit code and stderr.
fn fails(args: &[&str]) -> (i32, String) {
    let output = twincast(args);
    (output.status.code().expect("no signal"), text(&output.stderr))
}

#[test]
fn the_definition_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn help_names_every_command_and_flag() {
    let help = twincast(&["--help"]);
    assert!(help.status.success());
    let help = text(&help.stdout);
    for word in ["render", "completions", "man", "Exit codes:", "--version"] {
        assert!(help.contains(word), "{word} in {help}");
    }
    let help = text(&twincast(&["render", "--help"]).stdout);
    for flag in [
        "--output",
        "--backend",
        "--size",
        "--spp",
        "--camera",
        "--eye",
        "--look-at",
        "--up",
        "--fov",
        "--up-axis",
        "--unit",
        "--normals",
        "--print-camera",
        "--reference",
        "--threshold",
        "--threads",
        "--seed",
        "--stats",
        "--packet",
        "--tile-order",
        "--background",
        "--verbose",
        "--quiet",
        "Examples:",
    ] {
        assert!(help.contains(flag), "{flag} in {help}");
    }
    assert!(help.lines().all(|line| line.chars().count() <= 110), "{help}");
}

#[test]
fn bad_usage_ends_with_2() {
    for args in [
        &["frobnicate"][..],
        &["render"],
        &["render", "x.glb"],
        &["render", "x.glb", "-o", "x.png", "--size", "0x5"],
        &["render", "x.glb", "-o", "x.png", "--size", "5"],
        &["render", "x.glb", "-o", "x.png", "--spp", "0"],
        &["render", "x.glb", "-o", "x.png", "--packet", "3"],
        &["render", "x.glb", "-o", "x.png", "--backend", "cuda"],
        &["render", "x.glb", "-o", "x.png", "--eye", "1,2"],
        &["render", "x.glb", "-o", "x.png", "--fov", "40"],
        &["render", "x.glb", "-o", "x.png", "--eye", "1,2,3", "--fov", "180"],
        &["render", "x.glb", "-o", "x.png", "--camera", "front", "--eye", "1,2,3"],
        &["render", "x.glb", "-o", "x.png", "--threshold", "0.1"],
        &["render", "x.glb", "-o", "x.png", "--background", "-1,0,0"],
        &["render", "x.glb", "-o", "x.png", "-v", "-q"],
        &["completions", "dos"],
    ] {
        let (code, message) = fails(args);
        assert!(code == 2 && message.starts_with("error: "), "{args:?}: {code} {message}");
    }
}

#[test]
fn a_missing_scene_ends_with_3_and_touches_no_output() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("out.png");
    std::fs::write(&picture, "old").unwrap();
    let scene = folder.path().join("missing.glb");
    let (code, message) = fails(&["render", scene.to_str().unwrap(), "-o", picture.to_str().unwrap()]);
    assert_eq!(code, 3, "{message}");
    assert!(message.starts_with("error: ") && message.contains("missing.glb"), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_eq!(std::fs::read_to_string(&picture).unwrap(), "old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
}

#[test]
fn outputs_are_checked_before_the_scene_is_read() {
    for place in ["/no/such/folder/out.png", "/tmp"] {
        let (code, message) = fails(&["render", "missing.glb", "-o", place]);
        assert!(code == 4 && message.contains(place), "{code} {message}");
    }
}

#[cfg(not(feature = "embree"))]
#[test]
fn a_backend_that_is_not_built_ends_with_5() {
    for backend in ["embree", "both"] {
        let (code, message) = fails(&["render", "missing.glb", "-o", "out.png", "--backend", backend]);
        assert!(code == 5 && message.contains("--features embree"), "{code} {message}");
    }
}

#[test]
fn completions_and_manual_come_from_the_same_definition() {
    for shell in ["bash", "zsh", "fish"] {
        let script = text(&twincast(&["completions", shell]).stdout);
        assert!(script.contains("tile-order") && script.contains("print-camera"), "{shell}");
    }
    let page = text(&twincast(&["man"]).stdout);
    assert!(page.starts_with(".ie") && page.contains(".TH twincast 1"), "{page}");
    let folder = tempfile::tempdir().unwrap();
    assert!(twincast(&["man", "--out", folder.path().to_str().unwrap()]).status.success());
    let render = std::fs::read_to_string(folder.path().join("twincast-render.1")).unwrap();
    assert!(render.contains("tile\\-order"), "{render}");
    assert!(folder.path().join("twincast.1").is_file());
    assert_eq!(fails(&["man", "--out", "/no/such/folder"]).0, 4);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let binary = env!("CARGO_BIN_EXE_twincast");
    let script = format!("set -o pipefail; '{binary}' completions bash | true; exit ${{PIPESTATUS[0]}}");
    let output = Command::new("bash").args(["-c", &script]).output().expect("bash runs");
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
}
