//! What ends the program while it reads, measures or renders.

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::program::{Running, command};

/// Materials that no library has, each of which becomes a mesh: it takes seconds to read, and there is a warning when
/// that is done.
const MATERIALS: usize = 400_000;

/// It ends there and then, whoever reads: what is told of a scene once it is read, is not.
#[test]
fn reading_ends_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = "mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    for k in 0..MATERIALS {
        writeln!(text, "usemtl {k}\nf 1 2 3").expect("memory");
    }
    std::fs::write(folder.path().join("many.obj"), text).expect("room");
    let of_embree: &[(&str, &[&str])] =
        if cfg!(feature = "embree") { &[("compare", &[]), ("bench", &["--repeat", "1"])] } else { &[] };
    for (name, flags) in [("render", &["-o", "a.png"][..]), ("plan", &[])].iter().chain(of_embree) {
        let child = command().current_dir(&folder).args([name, "many.obj"]).args(*flags).stderr(Stdio::piped()).spawn();
        let child = Running::new(child.expect("it runs"));
        let maps = || std::fs::read_to_string(format!("/proc/{}/maps", child.id())).expect("its mappings");
        loop {
            let mapped = maps();
            if mapped.contains("many.obj") {
                break;
            }
            // As those of a program that has ended are.
            assert!(!mapped.is_empty(), "{name} does not read");
            std::thread::sleep(Duration::from_millis(1));
        }
        // As schedulers of batches do it, too.
        child.signal(if *name == "plan" { "TERM" } else { "INT" });
        let (code, said) = child.end();
        assert_eq!(code, Some(130), "{name}: {said}");
        assert!(said.contains("interrupted") && !said.contains("missing.mtl"), "{name}: {said}");
        assert!(!folder.path().join("a.png").exists());
    }
}

/// Measuring for a chart takes long, and writes nothing meanwhile.
#[test]
fn charts_end_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = command();
    command.current_dir(&folder).args(["chart", "--charts", "triangles", "-q", "-o", "out"]);
    let child = Running::new(command.stderr(Stdio::piped()).spawn().expect("it runs"));
    let begin = Instant::now();
    while !folder.path().join("out").is_dir() {
        assert!(begin.elapsed().as_secs() < 60, "it makes its folder");
        std::thread::sleep(Duration::from_millis(1));
    }
    // After the check of its outputs.
    std::thread::sleep(Duration::from_millis(300));
    let begin = Instant::now();
    child.interrupt();
    let (code, said) = child.end();
    // Its first step alone takes a minute of an optimised build.
    assert!(begin.elapsed().as_secs() < 15, "it went on");
    assert!(code == Some(130) && said.contains("interrupted"), "{code:?}: {said}");
    assert_eq!(std::fs::read_dir(folder.path().join("out")).expect("a folder").count(), 0);
}

/// A scene that is made leaves no part of itself, and the old file whole.
#[test]
fn writing_a_scene_ends_and_tidies_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("old.ply");
    std::fs::write(&path, "old").expect("written");
    let child = command()
        .args(["make", "terrain", "--size", "3000", "-o"])
        .arg(&path)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn();
    let child = Running::new(child.expect("it runs"));
    let begin = Instant::now();
    let written = || {
        let files = std::fs::read_dir(folder.path()).expect("a folder").flatten();
        files.filter_map(|file| file.metadata().ok()).map(|file| file.len()).sum::<u64>()
    };
    while written() < 1 << 20 {
        assert!(begin.elapsed().as_secs() < 120, "it writes");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.interrupt();
    let (code, said) = child.end();
    assert!(code == Some(130) && said.contains("interrupted"), "{code:?}: {said}");
    assert_eq!(std::fs::read_to_string(&path).expect("it is there"), "old");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
}

/// What a search has found until then is told, and that it did not come to its end.
#[test]
fn a_search_tells_what_it_found() {
    let mut command = command();
    command.args(["stress", "--search", "600", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it runs");
    let mut document = child.stdout.take().expect("piped");
    let child = Running::new(child);
    std::thread::sleep(Duration::from_secs(2));
    child.interrupt();
    let mut text = String::new();
    document.read_to_string(&mut text).expect("UTF-8");
    let (code, said) = child.end();
    assert!(code == Some(130) && said.contains("interrupted"), "{code:?}: {said}");
    assert!(text.contains("\"rays\"") && text.contains("\"found\""), "{text}");
}

/// A mapped file that becomes shorter while it is read. Whether it was read before that is chance.
#[test]
fn a_file_that_is_cut_short_is_told() {
    const TRIANGLES: u32 = 2_000_000;
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("large.stl");
    let tell = || {
        let file = std::fs::File::create(&path).expect("a file");
        (&file).write_all(&[&[0; 80][..], &TRIANGLES.to_le_bytes()].concat()).expect("written");
        // Zeros, which take no room.
        file.set_len(84 + 50 * u64::from(TRIANGLES)).expect("room");
        let child = command().args(["info"]).arg(&path).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
        let child = Running::new(child.expect("it runs"));
        let maps = || std::fs::read_to_string(format!("/proc/{}/maps", child.id())).unwrap_or_default();
        while !maps().contains("large.stl") && !maps().is_empty() {
            std::thread::yield_now();
        }
        file.set_len(1000).expect("it is shorter");
        child.end()
    };
    let told = (0..20).map(|_| tell()).find(|(_, said)| said.contains("became shorter"));
    assert_eq!(told.map(|(code, _)| code), Some(Some(3)));
}
