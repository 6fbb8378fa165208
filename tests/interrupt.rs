//! Ctrl-C while a scene is read.

use std::fmt::Write as _;
use std::process::Stdio;
use std::time::Duration;

use crate::program::{Running, command};

/// Materials that no library has, each of which becomes a mesh: it takes seconds to read, and there is a warning when that is done.
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
        child.interrupt();
        let (code, said) = child.end();
        assert_eq!(code, Some(130), "{name}: {said}");
        assert!(said.contains("interrupted") && !said.contains("missing.mtl"), "{name}: {said}");
        assert!(!folder.path().join("a.png").exists());
    }
}
