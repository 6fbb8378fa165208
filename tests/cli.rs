//! The command line, as a user meets it: the binary is run.

use std::process::{Command, Output};

use clap::CommandFactory;
use twincast::cli::Cli;

use crate::program::{command, text, twincast};

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
    let help = text(&twincast(&["--help"]).stdout);
    assert!(help.contains("Exit codes:") && help.contains("--version"), "{help}");
    let definition = Cli::command();
    let commands: Vec<_> = definition.get_subcommands().collect();
    assert!(commands.len() > 9, "{commands:?}");
    for command in commands {
        let name = command.get_name();
        assert!(help.contains(&format!("\n  {name} ")), "{name} in {help}");
        let help = text(&twincast(&[name, "--help"]).stdout);
        assert!(help.contains("\nExample"), "{help}");
        assert!(help.lines().all(|line| line.chars().count() <= 110), "{help}");
        for argument in command.get_arguments() {
            let id = argument.get_id().as_str();
            assert!(argument.get_help().is_some(), "{name} {id}");
            if let Some(flag) = argument.get_long() {
                assert!(help.contains(&format!("--{flag}")), "--{flag} in {help}");
            }
            // What is chosen by name is offered, but for what the scene's file names, and for AOVs, which may be
            // expressions.
            let is_chosen = argument.get_value_names().is_some_and(|names| ["NAME", "NAME,..."].contains(&&*names[0]));
            if is_chosen && !["camera", "animation", "variant", "aov"].contains(&id) {
                assert!(!argument.get_possible_values().is_empty(), "{name} {id}");
            }
            // What is all of it unless some is asked for.
            let all = argument.get_possible_values();
            if !all.is_empty() && ["rays", "modes", "charts"].contains(&id) {
                let all: Vec<_> = all.iter().map(|value| value.get_name()).collect();
                assert_eq!(argument.get_default_values(), [all.join(",").as_str()], "{name} {id}");
            }
        }
    }
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
        &["render", "x.glb", "-o", "x.png", "--sun", "0,0,0"],
        &["render", "x.glb", "-o", "x.png", "--build", "slow"],
        &["render", "x.glb", "-o", "x.png", "--max-memory", "much"],
        &["render", "x.glb", "-o", "x.png", "-v", "-q"],
        &["bench", "--repeat", "0"],
        &["bench", "terrain10", "--max", "100"],
        &["bench", "terrain10", "--max-memory", "1G"],
        &["compare", "x.glb", "--accel", "grid", "--seconds", "1"],
        &["render", "x.glb", "-o", "x.png", "--explain"],
        &["render", "x.glb", "--pixel", "1,1", "--frames", "1-3", "--skip-existing"],
        &["render", "x.glb", "--pixel", "1,1", "--threshold", "0.1"],
        &["render", "x.glb", "--pixel", "1,1", "--noise", "0.1"],
        &["render", "x.glb", "-o", "x.png", "--max-spp", "4"],
        #[cfg(feature = "embree")]
        &["render", "x.glb", "-o", "x.png", "--backend", "embree", "--build", "fast"],
        &["bench", "--size", "2"],
        &["bench", "--rays", "cosmic"],
        &["bench", "--modes", "default,slow"],
        &["completions", "dos"],
    ] {
        let (code, message) = fails(args);
        assert!(code == 2 && message.starts_with("error: "), "{args:?}: {code} {message}");
    }
}

/// A number below what may be is told to be that, and not an unknown flag.
#[test]
fn numbers_below_zero_are_numbers() {
    for (flag, value, words) in [
        ("--spp", "-1", "-1 is not in 1..=65536"),
        ("--noise", "-0.5", "-0.5"),
        ("--crop", "-1,0,4x4", "expected X,Y,WIDTHxHEIGHT"),
        ("--background", "-1,0,0", "-1,0,0"),
        ("--threads", "-1", "expected a number from 0"),
    ] {
        let (code, message) = fails(&["render", "x.glb", "-o", "x.png", flag, value]);
        assert!(code == 2 && message.contains(words) && !message.contains("unexpected"), "{flag}: {message}");
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

/// A picture that is finished is not lost with figures that cannot be written, nor with another picture.
#[cfg(target_os = "linux")]
#[test]
fn where_one_output_fails_the_others_are_kept() {
    use crate::io::Files;
    let files = Files::one("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").and("a.png", "old");
    let path = |name: &str| files.path(name).to_str().expect("UTF-8").to_owned();
    let full = path("full.png");
    std::os::unix::fs::symlink("/dev/full", &full).expect("a link");
    for more in [&["--stats", "/dev/full"][..], &["-o", &full, "-o", &path("b.png")]] {
        std::fs::write(path("a.png"), "old").expect("written");
        let usual = ["render", &path("a.obj"), "-o", &path("a.png"), "--size", "8x8", "--backend", "native", "-q"];
        let (code, message) = fails(&[&usual[..], more].concat());
        assert!(code == 4 && message.contains("full") && message.contains("a.png: is written"), "{code} {message}");
        assert!(std::fs::read(files.path("a.png")).expect("replaced").starts_with(b"\x89PNG"));
        assert_eq!(message.contains("b.png: is written"), more.len() == 4, "{message}");
    }
    assert!(files.path("b.png").is_file());
}

/// What no output can hold is told before the work, and so are folders that take no report.
#[test]
fn outputs_that_cannot_be_are_refused_before_the_work() {
    use crate::io::Files;
    let files = Files::one("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    std::fs::create_dir(files.path("failing.txt")).expect("a folder");
    let path = |name: &str| files.path(name).to_str().expect("UTF-8").to_owned();
    let long = format!("{}=LDE", "a".repeat(254));
    let render = |more: &[&str]| {
        let usual = ["render", &path("a.obj"), "--backend", "native", "-q", "--size", "70x65536", "--spp", "65536"];
        fails(&[&usual[..], more].concat())
    };
    let (code, message) = render(&["-o", &path("a.exr"), "-o", &path("a.jpg")]);
    assert!(code == 4 && message.contains("a.jpg: 70 x 65536 pixels are too many"), "{code} {message}");
    for (aovs, words) in [(long.as_str(), "up to 253 bytes"), ("CryptoObject00=LDE", "that of another layer")] {
        let (code, message) = render(&["-o", &path("a.exr"), "--aov", aovs]);
        assert!(code == 2 && message.contains(words), "{code} {message}");
    }
    let folder = files.path("failing.txt").parent().expect("a folder").to_str().expect("UTF-8").to_owned();
    let (code, message) = fails(&["stress", "-o", &folder, "--rays", "1000000000"]);
    assert!(code == 4 && message.contains("failing.txt: is a folder"), "{code} {message}");
    assert!(!files.path("matrix.json").exists() && !files.path("a.exr").exists());
}

/// Help that nobody gets is no success.
#[cfg(target_os = "linux")]
#[test]
fn what_cannot_be_printed_ends_with_4() {
    for args in [&["--version"][..], &["help", "render"], &["render", "--help"], &["make", "--list"]] {
        let full = std::fs::File::create("/dev/full").expect("a device");
        let output = command().args(args).stdout(full).output().expect("it runs");
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(4) && message.contains("<stdout>"), "{args:?}: {message}");
    }
}

/// A camera that cannot be is the file's fault or the command line's.
#[test]
fn what_is_wrong_with_a_camera_is_told_of_where_it_is_from() {
    use crate::io::Files;
    let camera = "[[camera]]\nname = \"near\"\neye = [0, 0, 5]\nlook_at = [0, 0, 0]\nfov = 1e-9\n";
    let files = Files::one("a.toml", format!("{camera}[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n"));
    let scene = files.path("a.toml");
    let render = |more: &[&str]| {
        let scene = scene.to_str().expect("UTF-8");
        fails(&[&["render", scene, "--pixel", "0,0", "--size", "8x8", "--backend", "native", "-q"], more].concat())
    };
    let (code, message) = render(&[]);
    assert!(code == 3 && message.contains("a.toml: camera \"near\": an angle of view so small"), "{code} {message}");
    let (code, message) = render(&["--eye", "0,0,5", "--fov", "1e-9"]);
    assert!(code == 2 && message.starts_with("error: an angle of view so small"), "{code} {message}");
}

/// Names in a scene are not on the command line, where a slip of the finger is to be expected.
#[test]
fn what_a_scene_is_read_from_is_not_replaced() {
    use crate::io::{Files, obj};
    let mesh = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    let files = Files::one("a.obj", mesh)
        .and("a.mtl", "newmtl a\nmap_Kd a.png\n")
        .and("a.png", obj::picture())
        .and("b.png", obj::picture())
        .and("a.toml", "[[file]]\npath = \"a.obj\"\n[material.b]\ntexture = \"b.png\"\n");
    let path = |name: &str| files.path(name).to_str().expect("UTF-8").to_owned();
    let render = |scene: &str, outputs: &[&str]| {
        fails(&[&["render", &path(scene), "--size", "8x8", "--backend", "native", "-q"][..], outputs].concat())
    };
    for (scene, outputs, file) in [
        ("a.obj", &["-o", &path("a.png")][..], "a.png"),
        ("a.obj", &["-o", &path("c.png"), "--stats", &path("a.mtl")], "a.mtl"),
        ("a.toml", &["-o", &path("a.png")], "a.png"),
        ("a.toml", &["-o", &path("c.png"), "-o", &path("b.png")], "b.png"),
        ("a.toml", &["-o", &path("c.png"), "--stats", &path("a.obj")], "a.obj"),
    ] {
        let before = std::fs::read(files.path(file)).expect("it is there");
        let (code, message) = render(scene, outputs);
        assert!(code == 2 && message.contains(file) && message.contains("is read from"), "{code} {message}");
        assert_eq!(std::fs::read(files.path(file)).expect("still there"), before);
        assert!(!files.path("c.png").exists(), "nothing is written");
    }
    assert_eq!(render("a.toml", &["-o", &path("c.png")]), (0, String::new()));
}

#[test]
fn a_picture_that_the_scene_names_is_the_scenes_to_name_well() {
    let ball = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    let scene = format!("[render]\noutput = \"picture.xyz\"\nsize = [8, 8]\n\n{ball}");
    let files = crate::io::Files::one("a.toml", &scene);
    let path = |name: &str| files.path(name).to_str().expect("UTF-8").to_owned();
    let (code, message) = fails(&["render", &path("a.toml"), "-q", "--backend", "native"]);
    let words = "a.toml: names the picture picture.xyz: unknown suffix .xyz; this build writes ";
    assert!(code == 3 && message.contains(words) && message.contains("; -o FILE chooses another"), "{code} {message}");
    let chosen = fails(&["render", &path("a.toml"), "-q", "--backend", "native", "-o", &path("b.png")]);
    assert_eq!(chosen, (0, String::new()));
    let (code, message) = fails(&["render", &path("a.toml"), "-q", "--backend", "native", "-o", &path("b.xyz")]);
    assert!(code == 4 && message.contains("b.xyz: unknown suffix .xyz"), "{code} {message}");
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

/// A folder with a small scene, and paths in it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder for temporary files"));
        let pyramid =
            "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1.5 0\nf 1 2 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n";
        std::fs::write(folder.path("scene.obj"), pyramid).expect("a file in it");
        folder
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("UTF-8").to_owned()
    }

    /// Renders the scene small, to the file of that name.
    fn render(&self, output: &str, more: &[&str]) -> Output {
        let (scene, output) = (self.path("scene.obj"), self.path(output));
        let mut args = vec!["render", &scene, "-o", &output];
        if !more.contains(&"--size") {
            args.extend(["--size", "60x40"]);
        }
        args.extend(more);
        twincast(&args)
    }

    fn picture(&self, name: &str) -> twincast::Image {
        twincast::image::read(self.path(name).as_ref()).expect("a picture")
    }
}

#[test]
fn a_render_writes_pictures_and_statistics_and_says_so() {
    let folder = Folder::new();
    let (png, stats) = (folder.path("out.png"), folder.path("stats.json"));
    let output = folder.render("out.exr", &["-o", &png, "--stats", &stats, "-v", "-t", "1", "--spp", "3"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "no bar where there is no terminal: {}", text(&output.stderr));
    let summary = text(&output.stdout);
    for words in ["6 triangles", "native", "60x40, 3 samples a pixel, 1 thread\n", "7,200 camera + 0 shadow", "out.png"]
    {
        assert!(summary.contains(words), "{words} in {summary}");
    }
    let (linear, codes) = (folder.picture("out.exr"), folder.picture("out.png"));
    assert_eq!((linear.width, linear.height), (60, 40));
    assert!(linear.pixels.iter().any(|p| p.w == 1.0) && linear.pixels.iter().any(|p| p.w == 0.0));
    assert!(linear.difference(&codes).expect("one size").rmse < 0.01);

    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(stats).unwrap()).expect("JSON");
    assert_eq!((&stats["triangles"], &stats["threads"], &stats["spp"]), (&6.into(), &1.into(), &3.into()));
    assert_eq!(stats["engines"][0]["rays"]["camera"], 7200);
    for number in ["load_seconds", "write_seconds", "peak_memory"] {
        assert!(stats[number].as_f64().is_some_and(|x| x > 0.0), "{number}: {stats}");
    }
    assert!(stats["engines"][0]["bytes_per_triangle"].as_f64().is_some_and(|x| x > 12.0), "{stats}");
}

/// Faces that a file holds twice, a floor upon a floor, and one group twice in one place: every ray that hits one hits
/// another at the same t, and that is no reason to reckon exactly, whoever looks at the corners first.
#[test]
fn surfaces_that_lie_on_each_other_ask_for_no_exact_decisions() {
    let folder = Folder::new();
    let faces = "f 1 2 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n";
    let turned = "f 2 5 1\nf 5 3 2\nf 5 3 4\nf 1 4 5\n";
    let corners = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1.5 0\n";
    let floors = "v -4 0 -4\nv 5 0 -4\nv 4 0 6\nv -5 0 3\nf 6 8 7\nf 6 9 8\nf 6 9 7\nf 9 8 7\n";
    std::fs::write(folder.path("scene.obj"), format!("{corners}{faces}{turned}{floors}")).expect("a file");
    let instance = "[[instance]]\ngroup = \"m\"\ntransform = { rotate = [1, 2, 3, 40] }\n";
    let placed = format!("[[group.m.file]]\npath = \"scene.obj\"\n{}", instance.repeat(2));
    std::fs::write(folder.path("twice.toml"), placed).expect("a file");
    for scene in ["scene.obj", "twice.toml"] {
        let (scene, picture, stats) = (folder.path(scene), folder.path("out.png"), folder.path("stats.json"));
        let output =
            twincast(&["render", &scene, "-o", &picture, "--stats", &stats, "--size", "128x128", "--spp", "1"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(stats).unwrap()).expect("JSON");
        let rays = &stats["engines"][0]["rays"];
        assert!(rays["exact"].as_u64().is_some_and(|exact| exact < 100), "{rays}");
        assert_eq!(rays["camera"], 128 * 128);
    }
}

#[test]
fn threads_tile_orders_and_packets_give_the_same_file() {
    let folder = Folder::new();
    folder.render("a.exr", &["-t", "1", "--tile-order", "scanline"]);
    for flags in [&["-t", "2"][..], &["-t", "3", "--tile-order", "spiral"], &["--packet", "16", "-q"]] {
        assert!(folder.render("b.exr", flags).status.success());
        assert_eq!(folder.picture("a.exr"), folder.picture("b.exr"), "{flags:?}");
    }
    assert!(folder.render("c.exr", &["--seed", "1", "-q"]).stdout.is_empty(), "-q says nothing");
    assert_ne!(folder.picture("a.exr"), folder.picture("c.exr"));
}

#[test]
fn builds_never_change_a_picture_and_memory_is_kept() {
    let folder = Folder::new();
    let auto = folder.render("auto.exr", &["-v"]);
    assert!(text(&auto.stdout).contains("rays a triangle are"), "{}", text(&auto.stdout));
    for build in ["fast", "default", "high", "compact", "fast-compact"] {
        let output = folder.render("other.exr", &["-v", "--build", build, "--max-memory", "1T"]);
        let summary = text(&output.stdout);
        assert!(summary.contains(&format!("{build}: asked for")), "{summary}");
        assert_eq!(folder.picture("auto.exr"), folder.picture("other.exr"), "{build}");
    }
    let output = folder.render("none.exr", &["--max-memory", "1M"]);
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.lines().count()), (Some(3), 1), "{message}");
    assert!(message.contains("fast-compact build") && message.contains("give at least --max-memory"), "{message}");
    // Channels beside the colours count: some ten gigabytes of them, beside half of one.
    let large = ["--size", "4000x4000", "--max-memory", "4G"];
    let (code, message) = fails(&[&["plan", &folder.path("scene.obj")], &large[..]].concat());
    assert_eq!(code, 0, "{message}");
    let output = folder.render("none.exr", &[&large[..], &["--aov", "all"]].concat());
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
    assert!(!std::fs::exists(folder.path("none.exr")).unwrap());
}

#[test]
fn what_cannot_fit_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // Corners that are not there: what the loader says, once it reads.
    let vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let head = format!(
        "ply\nformat ascii 1.0\n{vertices}element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    );
    std::fs::write(path("broken.ply"), head.clone() + "0 0 0 1 0 0 0 1 0\n3 0 1 9\n").unwrap();
    // Less than it promises, so that the promise is not believed.
    std::fs::write(path("short.ply"), head.replace("face 1", "face 99999999")).unwrap();
    // A byte too many, of which the loader warns.
    let mut stl = vec![0; 84 + 50 + 1];
    stl[80] = 1;
    std::fs::write(path("one.stl"), stl).unwrap();
    let picture = path("x.png");
    for (command, output) in [("render", &["-o", &picture][..]), ("plan", &[])] {
        let fails = |scene: &str, memory: &str| {
            let (code, message) = fails(&[&[command, &path(scene), "--max-memory", memory], output].concat());
            assert_eq!(code, 3, "{command}: {message}");
            message
        };
        for scene in ["broken.ply", "one.stl"] {
            let message = fails(scene, "1M");
            assert!(message.contains("compact build needs") && message.lines().count() == 1, "{command}: {message}");
        }
        assert!(fails("broken.ply", "1T").contains("line 11: index 9"));
        assert!(fails("short.ply", "1M").contains("bytes are left"));
    }
}

#[test]
fn trees_are_kept_in_a_folder() {
    let folder = Folder::new();
    let kept = folder.path("kept/trees");
    let expected = folder.render("expected.exr", &[]);
    assert!(expected.status.success());
    let render = |more: &[&str]| {
        let output = folder.render("out.exr", &[&["--cache", &kept, "-v"], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert_eq!(folder.picture("out.exr"), folder.picture("expected.exr"), "{more:?}");
        (text(&output.stdout), text(&output.stderr))
    };
    let stats = folder.path("stats.json");
    for (words, more) in [("written", &["--stats", &stats][..]), ("read", &["-t", "1"]), ("read", &["-t", "3"])] {
        let (summary, warnings) = render(more);
        assert!(summary.contains(&format!("cache     {words} {kept}")) && warnings.is_empty(), "{summary}{warnings}");
    }
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(stats).unwrap()).expect("JSON");
    assert_eq!(stats["engines"][0]["cache"]["used"], "written", "{stats}");

    let files: Vec<_> = std::fs::read_dir(&kept).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [file] = &files[..] else { panic!("one file: {files:?}") };
    let bytes = std::fs::read(file).unwrap();
    std::fs::write(file, &bytes[..bytes.len() / 2]).unwrap();
    let (summary, warning) = render(&[]);
    assert_eq!(warning.lines().count(), 1, "{warning}");
    assert!(warning.starts_with("warning: ") && warning.contains(file.to_str().unwrap()), "{warning}");
    assert!(warning.contains("ignored, to be written anew") && summary.contains("written"), "{warning}{summary}");
    assert_eq!(std::fs::read(file).unwrap(), bytes);

    // Another tree, and another mesh.
    assert!(render(&["--build", "fast"]).0.contains("written"));
    std::fs::write(folder.path("scene.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let output = folder.render("other.exr", &["--cache", &kept, "-v"]);
    assert!(text(&output.stdout).contains("written") && output.stderr.is_empty(), "{}", text(&output.stdout));
    assert_eq!(std::fs::read_dir(&kept).unwrap().count(), 3);
}

#[test]
fn a_folder_for_trees_that_cannot_be_made_ends_with_4_before_the_work() {
    let folder = Folder::new();
    let output = folder.render("out.exr", &["--cache", &folder.path("scene.obj")]);
    let message = text(&output.stderr);
    assert_eq!((output.status.code(), message.lines().count()), (Some(4), 1), "{message}");
    assert!(message.contains("scene.obj") && !std::fs::exists(folder.path("out.exr")).unwrap(), "{message}");
}

#[cfg(feature = "embree")]
#[test]
fn embree_alone_keeps_no_tree() {
    let folder = Folder::new();
    let output = folder.render("out.exr", &["--cache", &folder.path("kept"), "--backend", "embree"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
    assert!(!std::fs::exists(folder.path("kept")).unwrap());
    let (scene, kept) = (folder.path("scene.obj"), folder.path("kept"));
    for _ in 0..2 {
        let output = twincast(&["compare", &scene, "--cache", &kept, "--size", "20x20", "--random", "1000"]);
        assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    }
    assert_eq!(std::fs::read_dir(&kept).unwrap().count(), 1);
}

#[test]
fn the_sun_casts_shadows() {
    let folder = Folder::new();
    // Of the pyramid's sides that are seen, one or the other is lit.
    let view = ["--eye", "0,4,6", "--look-at", "0,0.5,0", "-v", "--spp", "1"];
    let halves = |sun: &str| {
        let output = folder.render("sun.exr", &[&view[..], &["--sun", sun]].concat());
        let summary = text(&output.stdout);
        assert!(summary.contains("1 light with shadows") && !summary.contains(" + 0 shadow"), "{summary}");
        let picture = folder.picture("sun.exr");
        let sum = |columns: std::ops::Range<usize>| -> f32 {
            picture.pixels.chunks(60).flat_map(|row| &row[columns.clone()]).map(|p| p.x).sum()
        };
        (sum(0..30), sum(30..60))
    };
    let ((left, dark), (other, right)) = (halves("-3,1,-0.1"), halves("3,1,-0.1"));
    assert!(left > 2.0 * dark && right > 2.0 * other, "{left} {dark} {other} {right}");
}

/// Where white is cut off, and nowhere else; what it advises helps.
#[test]
fn a_picture_that_is_mostly_white_says_so() {
    let folder = Folder::new();
    let lamp = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 10\nmaterial = \"a\"\n[material.a]\nemission = [40, 40, 40]\n";
    std::fs::write(folder.path("lamp.toml"), lamp).unwrap();
    let said = |name: &str, flags: &[&str]| {
        let (scene, picture) = (folder.path("lamp.toml"), folder.path(name));
        let view = ["render", &scene, "-o", &picture, "--size", "16x16", "--eye", "0,0,30", "--look-at", "0,0,0"];
        let output = twincast(&[&view[..], flags].concat());
        assert!(output.status.success());
        text(&output.stderr)
    };
    let told = said("a.png", &[]);
    assert!(told.starts_with("warning: ") && told.contains("a.png: 100 % of what is seen"), "{told}");
    assert!(told.contains("--exposure -7 would"), "{told}");
    assert_eq!(said("a.png", &["--exposure", "-7"]), "");
    assert_eq!(said("a.exr", &[]), "");
}

/// Also where the file holds it as it is.
#[test]
fn light_that_f32_cannot_hold_is_told() {
    let folder = Folder::new();
    let glass = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n[material.m]\nreflection = 1e30\nambient = 1e30\n\
                 [render]\nambient = 1\nintegrator = \"whitted\"\n[[sphere]]\ncentre = [1.5, 0, 0]\nradius = 1\nmaterial = \"m\"\n";
    let (scene, picture) = (folder.path("bright.toml"), folder.path("a.exr"));
    std::fs::write(&scene, glass).unwrap();
    let view = ["render", &scene, "-o", &picture, "--size", "16x16", "--eye", "0,0,4", "--look-at", "0,0,0"];
    let output = twincast(&view);
    let told = text(&output.stderr);
    assert!(output.status.success() && told.starts_with("warning: ") && told.lines().count() == 1, "{told}");
    assert!(told.contains("a.exr: ") && told.contains("are infinite or no number"), "{told}");
}

#[test]
fn a_printed_camera_gives_the_picture_again() {
    let folder = Folder::new();
    let scene = folder.path("scene.obj");
    let output = twincast(&["render", &scene, "--print-camera", "--size", "60x40"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let flags = text(&output.stdout);
    let flags: Vec<_> = flags.split_whitespace().collect();
    assert_eq!(flags.len(), 8, "nothing but the flags: {flags:?}");
    folder.render("framed.exr", &[]);
    assert!(folder.render("again.exr", &flags).status.success());
    assert_eq!(folder.picture("framed.exr").difference(&folder.picture("again.exr")).unwrap().differing, 0);
}

#[test]
fn a_reference_that_differs_ends_with_1_and_the_picture_is_written() {
    let folder = Folder::new();
    assert!(folder.render("reference.exr", &[]).status.success());
    let reference = folder.path("reference.exr");
    let same = folder.render("same.exr", &["--reference", &reference, "--threshold", "0.001"]);
    assert!(same.status.success() && text(&same.stdout).contains("within 0.001"), "{}", text(&same.stderr));
    let other = folder.render("other.exr", &["--reference", &reference, "--eye", "0,3,4"]);
    assert_eq!(other.status.code(), Some(1));
    assert!(text(&other.stderr).contains("above 0.01"), "{}", text(&other.stderr));
    assert_eq!(folder.picture("other.exr").width, 60);
    let larger = folder.render("larger.exr", &["--reference", &reference, "--size", "61x40"]);
    assert_eq!(larger.status.code(), Some(2), "two sizes in one command");
    let missing = folder.render("missing.exr", &["--reference", "no-such.exr"]);
    assert_eq!(missing.status.code(), Some(3));
}

/// Whatever its format leaves out: light above 1, bits, alpha.
#[test]
fn a_picture_is_its_own_reference() {
    let folder = Folder::new();
    let radiance = cfg!(feature = "oiio").then_some(("r.hdr", "0"));
    for (name, limit) in [("r.exr", "0"), ("r.png", "0"), ("r.jpg", "0.02")].into_iter().chain(radiance) {
        let bright = ["--exposure", "3", "--response", "filmic"];
        assert!(folder.render(name, &bright).status.success());
        let reference = folder.path(name);
        let check = ["--reference", &reference, "--threshold", limit];
        let same = folder.render("same.exr", &[&bright[..], &check].concat());
        assert!(same.status.success(), "{name}: {}", text(&same.stderr));
        let darker = folder.render("darker.exr", &check);
        let is_code = !["r.exr", "r.hdr"].contains(&name);
        assert_eq!(darker.status.code(), Some(i32::from(is_code)), "{name}: {}", text(&darker.stderr));
    }
}

#[test]
fn cameras_that_do_not_exist_are_named() {
    let folder = Folder::new();
    let output = folder.render("out.exr", &["--camera", "front"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("no camera \"front\""), "{}", text(&output.stderr));
    assert!(!std::fs::exists(folder.path("out.exr")).unwrap());
}

#[cfg(feature = "embree")]
#[test]
fn a_benchmark_prints_a_table_or_one_document() {
    let folder = Folder::new();
    let scene = folder.path("scene.obj");
    let quick = ["--size", "64", "--repeat", "1", "--threads", "2"];
    let output = twincast(&[&["bench", &scene, "--rays", "shadow,primary"][..], &quick].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    let words =
        ["scene.obj: 8 triangles, 2 threads", "native default", "embree compact", "embree high", "over embree robust"];
    for words in words.iter().chain(&["primary, Mray/s", "shadow, Mray/s", "0 native_wrong"]) {
        assert!(table.contains(words), "{words} in {table}");
    }
    assert!(!table.contains("diffuse"), "{table}");

    let chart = folder.path("rates.svg");
    let both = ["bench", "terrain20", "architecture1", "--json", "--modes", "default,robust", "--chart", &chart];
    let output = twincast(&[&both[..], &quick].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let drawn = std::fs::read_to_string(&chart).expect("a chart");
    for words in ["<svg ", "terrain20: 800 triangles, 2 threads", "architecture1: 4,142 triangles", "</svg>"] {
        assert!(drawn.contains(words), "{words} in {drawn}");
    }
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    assert_eq!((&document[0]["triangles"], &document[1]["triangles"]), (&800.into(), &4142.into()));
    for report in document.as_array().expect("one of each scene") {
        assert_eq!(report["traversal"].as_array().map(Vec::len), Some(2 * 3 * 6), "engines, widths, kinds");
        assert!(report["ratios"][2]["over_embree_robust"].as_f64().is_some_and(|ratio| ratio > 0.0), "{report}");
        assert!(report["ratios"][2]["over_embree_fast"].is_null(), "{report}");
        let cost = |engine: usize| report["builds"][engine]["sah_cost"].as_f64().expect("a cost");
        assert!(cost(0) > 1.0 && cost(0) < 1.05 * cost(1), "{report}");
    }
    let output =
        twincast(&[&["bench", "terrain20", "--isa", "portable", "--modes", "default,robust"][..], &quick].concat());
    assert!(output.status.success() && text(&output.stdout).contains("0 native_wrong"), "{}", text(&output.stderr));
    let refused = |chart: &str| twincast(&[&["bench", &scene, "--chart", chart][..], &quick].concat()).status.code();
    assert_eq!(refused(&folder.path("no/folder.svg")), Some(4), "before anything is measured");
    assert_eq!(refused(&folder.path("rates.png")), Some(2));
    assert_eq!(twincast(&["bench", "terrain0"]).status.code(), Some(3), "neither a terrain nor a file");
}

#[cfg(feature = "embree")]
#[test]
fn both_engines_render_and_agree() {
    let folder = Folder::new();
    let output = folder.render("both.exr", &["--backend", "both"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary = text(&output.stdout);
    assert!(summary.contains("native") && summary.contains("embree") && summary.contains("check"), "{summary}");
    assert!(folder.render("native.exr", &[]).status.success());
    assert_eq!(folder.picture("both.exr"), folder.picture("native.exr"));
}

#[test]
fn scenes_are_made_by_rule() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let list = text(&twincast(&["make", "--list"]).stdout);
    for name in ["sphereflake", "tetra", "gears", "mount", "rings", "tree", "terrain", "lattice", "city"] {
        assert!(list.contains(name), "{name} in {list}");
    }
    let output = twincast(&["make", "sphereflake", "--size", "2", "-o", &path("a.nff")]);
    assert!(output.status.success() && text(&output.stdout).contains("92 primitives"), "{output:?}");
    let output = twincast(&["render", &path("a.nff"), "--size", "20x10", "-q", "-o", &path("a.png")]);
    assert!(output.status.success(), "{output:?}");
    for (args, words) in [
        (["make", "spherflake", "-o", &path("b.nff"), "-q"], "possible values: sphereflake, tetra"),
        (["make", "sphereflake", "-o", &path("b.ply"), "-q"], "PLY holds triangles, and this scene has a sphere"),
        (["make", "tetra", "-o", &path("b.obj"), "-q"], "scenes are written as .nff, .ply, .toml"),
        (["make", "tetra", "-o", &path("b.nff"), "--size=13"], "--size 13: tetra goes to 12"),
    ] {
        let (code, message) = fails(&args);
        assert!(code == 2 && message.contains(words), "{code}: {message}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/null", path("null.ply")).unwrap();
        assert_eq!(fails(&["make", "terrain", "--size", "4", "-o", &path("null.ply"), "-q"]), (0, String::new()));
    }
    let (code, message) = fails(&["make", "tetra", "-o", &path("none/b.nff")]);
    assert!(code == 4 && message.contains("does not exist"), "{message}");
}

/// A triangle that is moved by a metre a second: frames of two a second, each as a picture of its time.
#[test]
fn frames_of_an_animation() {
    use crate::io::gltf_maker::Maker;
    let files = Maker::animated("translation", "LINEAR", &[0.0, 2.0], "VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]).files();
    let path = |name: &str| files.path(name).to_str().expect("UTF-8").to_owned();
    let (scene, numbered) = (path("a.gltf"), path("f.%02d.exr"));
    let view = ["--eye", "1,0.5,4", "--look-at", "1,0.5,0", "--size", "32x16", "--spp", "1", "--backend", "native"];
    let render = |rest: &[&str]| fails(&[&["render", &scene], &view[..], rest].concat());
    assert_eq!(render(&["--frames", "0-2", "--fps", "2", "-o", &numbered]), (0, String::new()));
    for (frame, time) in [("f.00.exr", "0"), ("f.01.exr", "0.5"), ("f.02.exr", "1")] {
        let frame = path(frame);
        let exact = ["--time", time, "-o", &path("t.exr"), "--reference", &frame, "--threshold", "0.001"];
        assert_eq!(render(&exact), (0, String::new()), "{frame}");
    }
    let other = ["--time", "0.5", "-o", &path("t.exr"), "--reference", &path("f.02.exr"), "--threshold", "0.001"];
    assert_eq!(render(&other).0, 1, "it moves");
    // Every frame is made where one is not as it should be.
    let compared = ["--frames", "0-2", "--fps", "2", "-o", &path("n.%d.exr"), "--reference", &path("f.00.exr")];
    let (code, said) = render(&[&compared[..], &["--threshold", "0.001"]].concat());
    assert!(code == 1 && said.contains("frame 1: ") && said.contains("frame 2: "), "{code} {said}");
    assert!(!said.contains("frame 0") && files.path("n.2.exr").is_file(), "{said}");
    // None of them was interrupted: all begin anew.
    assert_eq!(render(&["--frames", "0-1", "--fps", "2", "--resume", "-o", &numbered]), (0, String::new()));
    // What is there stays, what is missing is made.
    std::fs::write(path("f.01.exr"), "kept").expect("written");
    std::fs::remove_file(path("f.02.exr")).expect("it was there");
    assert_eq!(render(&["--frames", "1-2", "--fps", "2", "--skip-existing", "-o", &numbered]).0, 0);
    assert_eq!(std::fs::read(path("f.01.exr")).expect("still there"), b"kept");
    assert!(files.path("f.02.exr").is_file());
    // It shrinks to nothing: the last frame is empty, and made.
    let shrinking = Maker::animated("scale", "LINEAR", &[0.0, 1.0], "VEC3", &[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).files();
    let shrinking_path = |name: &str| shrinking.path(name).to_str().expect("UTF-8").to_owned();
    let (scene, numbered) = (shrinking_path("a.gltf"), shrinking_path("s.%d.exr"));
    let (code, said) =
        fails(&[&["render", &scene], &view[..], &["--frames", "0-1", "--fps", "1", "-o", &numbered]].concat());
    assert!(code == 0 && said.contains("scaled by zero"), "{said}");
    let covered = |name| {
        let picture = twincast::image::read(&shrinking.path(name)).expect("a picture");
        picture.pixels.iter().filter(|pixel| pixel.w > 0.0).count()
    };
    assert!(covered("s.0.exr") > 0 && covered("s.1.exr") == 0);
    let (code, said) = render(&["--frames", "0-1", "-o", &path("one.exr")]);
    assert!(code == 2 && said.contains("put %04d into its name"), "{said}");
    let (code, said) = render(&["--animation", "none", "-o", &path("one.exr")]);
    assert!(code == 3 && said.contains("/animations: no animation \"none\"; the file has 0"), "{said}");
    let (code, said) = render(&["--variant", "red", "-o", &path("one.exr")]);
    assert!(code == 3 && said.contains("the file has none"), "{said}");
}

/// Each of the first twenty, and the others together.
#[test]
fn many_faulty_meshes_are_told_together() {
    let folder = Folder::new();
    let mut obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\n".to_owned();
    for k in 0..25 {
        // A triangle, and one without area.
        obj += &format!("usemtl {k}\nf 1 2 3\nf 1 2 4\n");
    }
    std::fs::write(folder.path("many.obj"), obj).unwrap();
    let output = twincast(&["info", &folder.path("many.obj")]);
    let told = text(&output.stdout);
    assert_eq!(told.lines().filter(|line| line.starts_with("geometry ")).count(), 20, "{told}");
    let (_, others) = told.split_once("5 other geometries (--json has each):\n").expect("the others");
    assert!(others.trim_start().starts_with("5 degenerate triangles\n"), "{told}");
    assert_eq!(told.matches("1 degenerate triangle\n").count(), 20, "{told}");
}
