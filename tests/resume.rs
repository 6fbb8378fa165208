//! The program is killed while it renders, and started again.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::program::{Running, command};

fn render(output: &Path, flags: &[&str]) -> Running {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box/box.toml");
    let child = command()
        .arg("render")
        .arg(scene)
        .args(["--integrator", "path", "--size", "64x48", "--spp", "768"])
        .args(["--threads", "2", "--tile-size", "16", "-q", "-o"])
        .arg(output)
        .args(flags)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn();
    Running::new(child.expect("the binary runs"))
}

/// Until a checkpoint is there that was not there before.
fn wait_for_a_checkpoint(kept: &Path) {
    let written = || std::fs::read(kept).ok();
    let (before, begin) = (written(), Instant::now());
    while written() == before {
        assert!(begin.elapsed().as_secs() < 120, "there is a checkpoint");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_render_that_is_killed_goes_on_to_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, killed] = ["whole.png", "killed.png"].map(|name| folder.path().join(name));
    let kept = folder.path().join("killed.checkpoint.exr");
    assert_eq!(render(&whole, &[]).end(), (Some(0), String::new()));

    // Killed as each of the first checkpoints has been written, and then left to end.
    for kills in 0..3 {
        let flags: &[&str] =
            if kills == 0 { &["--checkpoint", "0.02s"] } else { &["--checkpoint", "0.02s", "--resume"] };
        let mut child = render(&killed, flags);
        let is_killed = kills < 2;
        if is_killed {
            wait_for_a_checkpoint(&kept);
            child.kill();
        }
        let (code, said) = child.end();
        assert_eq!(code, if is_killed { None } else { Some(0) }, "after {kills} kills: {said}");
        assert_eq!(kept.exists(), is_killed, "after {kills} kills");
    }
    assert_eq!(std::fs::read(&whole).unwrap(), std::fs::read(&killed).unwrap());
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let whole_files = left.iter().filter(|name| !name.to_string_lossy().starts_with('.')).count();
    assert_eq!(whole_files, 2, "{left:?}");

    let (code, said) = render(&killed, &["--resume"]).end();
    assert!(code == Some(3) && said.contains("no checkpoint to resume"), "{said}");
}

/// What a render is kept in takes the place of nothing else: neither of an output, nor of what the scene is read from,
/// nor of a file that is no checkpoint.
#[test]
fn a_checkpoint_replaces_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let run = |scene: &str, flags: &[&str]| {
        let output = command().arg("render").arg(scene).args(["--size", "8x8", "-q"]).args(flags).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let plain = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    std::fs::write(path("plain.toml"), plain).unwrap();
    let [scene, picture, kept] = ["plain.toml", "a.png", "a.checkpoint.exr"].map(path);
    let often = ["-o", &picture, "--checkpoint", "1h"];

    for flag in ["-o", "--stats"] {
        let (code, said) = run(&scene, &[&often[..], &[flag, &kept]].concat());
        assert!(code == Some(2) && said.contains("the render is kept in this file"), "{said}");
    }
    let (code, said) = run(&scene, &["-o", &kept]);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let before = std::fs::read(&kept).unwrap();
    let (code, said) = run(&scene, &often);
    assert!(code == Some(4) && said.contains("is no checkpoint"), "{code:?}: {said}");
    let (code, said) = run(&scene, &["-o", &picture, "--resume"]);
    assert!(code == Some(3) && said.contains("leave out --resume"), "{code:?}: {said}");
    let sky = format!("[environment]\nimage = \"a.checkpoint.exr\"\n{plain}");
    std::fs::write(path("sky.toml"), sky).unwrap();
    let (code, said) = run(&path("sky.toml"), &often);
    assert!(code == Some(2) && said.contains("the scene is read from this file"), "{said}");
    let (code, said) = run(&scene, &["-o", &kept, "--camera", &kept]);
    assert!(code == Some(2) && said.contains("this file is read"), "{said}");
    assert_eq!(std::fs::read(&kept).unwrap(), before);
}

/// Ctrl-C ends it with 130 and leaves a checkpoint, where one was asked for.
#[cfg(unix)]
#[test]
fn an_interrupted_render_leaves_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("a.png");
    let kept = folder.path().join("a.checkpoint.exr");
    let begin = Instant::now();
    let mut ready = None;
    for (flags, is_kept) in [(&["--checkpoint", "0.01s"][..], true), (&[], false)] {
        let child = command()
            .arg("render")
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box/box.toml"))
            .args(["--integrator", "path", "--size", "1600x1200", "--spp", "256", "--tile-size", "8", "-o"])
            .arg(&output)
            .args(flags)
            .stdout(std::fs::File::create(folder.path().join("said")).expect("a file"))
            .stderr(Stdio::piped())
            .spawn();
        let child = Running::new(child.expect("the binary runs"));
        // While it renders: what the first took until there was a checkpoint is enough for the second.
        match ready {
            None => {
                wait_for_a_checkpoint(&kept);
                ready = Some(begin.elapsed());
            }
            Some(time) => std::thread::sleep(2 * time + Duration::from_secs(1)),
        }
        child.interrupt();
        let (code, said) = child.end();
        assert_eq!(code, Some(130), "{said}");
        assert_eq!((kept.exists(), output.exists()), (is_kept, false));
        let told = std::fs::read_to_string(folder.path().join("said")).expect("text");
        assert_eq!(told.contains("a.checkpoint.exr: --resume goes on from there"), is_kept, "{told}");
        if is_kept {
            std::fs::remove_file(&kept).unwrap();
        }
    }
}
