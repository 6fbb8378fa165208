//! OpenImageIO is loaded by whoever writes or reads a picture, by nobody else; and what is said where it cannot be.
//!
//! What is loaded is told by the loader of the GNU C library (ld.so(8), `LD_DEBUG`).
#![cfg(all(feature = "oiio", target_os = "linux", target_env = "gnu"))]

use std::ffi::OsString;
use std::path::Path;

use crate::program::{command, text};
use crate::skip::skip;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/box/box.toml");

/// The libraries that a run of the program asks for.
fn libraries(args: &[&str]) -> Vec<String> {
    let output = command().env("LD_DEBUG", "files").args(args).output().expect("the program runs");
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {words}");
    let names = words.lines().filter(|line| line.contains("needed by")).filter_map(|line| line.split("file=").nth(1));
    let names: Vec<_> = names.filter_map(|rest| rest.split_whitespace().next()).map(str::to_owned).collect();
    assert!(names.iter().any(|name| name.starts_with("libc.so")), "the loader says what it loads: {words}");
    names
}

/// The name under which the program asks for OpenImageIO, found in a run that writes a picture.
fn openimageio() -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png").to_string_lossy().into_owned();
    let libraries = libraries(&["render", SCENE, "-o", &picture, "--size", "8x8", "--spp", "1"]);
    libraries.into_iter().find(|name| name.starts_with("libOpenImageIO.so")).expect("a picture takes OpenImageIO")
}

/// One of the libraries behind it starts threads, and crashes if it is destroyed before they have begun.
#[test]
fn the_program_ends_without_destroying_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png").to_string_lossy().into_owned();
    let args = ["render", SCENE, "-o", &picture, "--size", "8x8", "--spp", "1"];
    let output = command().env("LD_DEBUG", "files").args(args).output().expect("the program runs");
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && words.contains("calling init: "), "{words}");
    let ends: Vec<_> = words.lines().filter(|line| line.contains("calling fini: ")).collect();
    assert!(ends.is_empty(), "{ends:?}");
}

#[test]
fn it_is_loaded_for_pictures_and_for_nothing_else() {
    let asked_for = openimageio();
    for args in [&["--version"][..], &["render", "--help"], &["info", SCENE], &["render", SCENE, "--print-camera"]] {
        let libraries = libraries(args);
        assert!(!libraries.iter().any(|name| name.contains("OpenImageIO")), "{args:?} loads {asked_for}");
    }
}

#[test]
fn where_it_cannot_be_loaded_the_reason_and_the_remedy_are_told_and_the_rest_goes_on() {
    let name = openimageio();
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(&name), "not a library, whatever its name; ".repeat(9)).expect("written");
    let before = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let path = [folder.path().as_os_str(), &before].join(&OsString::from(":"));
    let run = |args: &[&str]| {
        let output = command().env("LD_LIBRARY_PATH", &path).args(args).output().expect("the program runs");
        (output.status.code(), text(&output.stderr))
    };
    for args in [&["--version"][..], &["info", SCENE], &["render", SCENE, "--print-camera"]] {
        assert_eq!(run(args), (Some(0), String::new()), "{args:?}");
    }

    let [picture, uncommon, reference] =
        ["a.png", "a.tif", "b.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    std::fs::write(&reference, "never looked at").expect("written");
    for args in [
        &["render", SCENE, "-o", &picture][..],
        &["render", SCENE, "-o", &uncommon],
        // What was always found first is told first, whichever is found first now.
        &["render", "missing.glb", "-o", &picture],
        &["render", SCENE, "-o", &picture, "--max-memory", "1T"],
        &["render", SCENE, "-o", &picture, "--reference", &reference],
    ] {
        let (code, message) = run(args);
        assert_eq!(code, Some(5), "{args:?}: {message}");
        for words in ["error: OpenImageIO cannot be loaded (", &name, "invalid ELF header", "LD_LIBRARY_PATH"] {
            assert!(message.contains(words), "{args:?}: {words} in {message}");
        }
        assert_eq!(message.lines().count(), 1, "{args:?}: {message}");
        assert!(!Path::new(&picture).exists() && !Path::new(&uncommon).exists(), "{args:?}");
    }
}

/// The reference is read while the output is tried out, and either may be OpenImageIO's first call.
#[test]
fn reading_and_writing_may_begin_together() {
    let folder = tempfile::tempdir().expect("a folder");
    let [picture, reference] = ["a.exr", "b.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let small = ["render", SCENE, "--size", "8x8", "--spp", "1", "-q"];
    let run = |rest: &[&str]| {
        let output = command().args(small).args(rest).output().expect("the program runs");
        (output.status.code(), text(&output.stderr))
    };
    assert_eq!(run(&["-o", &reference]), (Some(0), String::new()));
    for _ in 0..8 {
        assert_eq!(run(&["-o", &picture, "--reference", &reference, "--threshold", "0.001"]), (Some(0), String::new()));
    }
}

/// On a disk that is full the old picture stays, and nothing else.
#[test]
fn a_full_disk_keeps_the_old_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let (disk, program) = (folder.path().display(), env!("CARGO_BIN_EXE_twincast"));
    for suffix in ["bmp", "tga", "sgi", "png"] {
        // Of a megabyte 200 kB are left; the picture has 900.
        let mounted = format!(
            "mount -t tmpfs -o size=1m tmpfs {disk} && head -c 800000 /dev/zero >{disk}/full && echo old >{disk}/a.{suffix} || exit 99
             {program} render {SCENE} -o {disk}/a.{suffix} --size 600x500 --spp 1; status=$?
             cat {disk}/a.{suffix}; ls -A {disk}; exit $status"
        );
        let run = std::process::Command::new("unshare").args(["--mount", "sh", "-c", &mounted]).output();
        let Ok(output) = run.map_err(|error| skip(format_args!("no unshare: {error}"))) else { return };
        let words = text(&output.stderr);
        if output.status.code() == Some(99) || words.starts_with("unshare:") {
            return skip(format_args!("no file system may be mounted: {words}"));
        }
        assert_eq!(output.status.code(), Some(4), "{suffix}: {words}");
        assert!(words.contains("writ") && words.contains("No space left on device"), "{words}");
        assert_eq!(text(&output.stdout), format!("old\na.{suffix}\nfull\n"));
    }
}

/// A limit to the size of files holds in memory, too: what is cut off is found where it is read again, and the old
/// picture stays.
#[test]
fn writers_that_do_not_tell_what_goes_wrong_are_found_out() {
    let folder = tempfile::tempdir().expect("a folder");
    for (suffix, size, fits) in [("bmp", "600x500", false), ("fits", "600x500", false), ("bmp", "200x200", true)] {
        let picture = folder.path().join("a").with_extension(suffix);
        std::fs::write(&picture, "the old one").expect("written");
        let program = env!("CARGO_BIN_EXE_twincast");
        // 600 x 500 pixels are 900 kB, and OpenImageIO's own files are smaller than 400.
        let line = format!(
            "trap '' XFSZ; ulimit -f 800; exec '{program}' render '{SCENE}' -o '{}' --size {size} --spp 1",
            picture.display()
        );
        let output = std::process::Command::new("sh").args(["-c", &line]).output().expect("the shell runs");
        let words = text(&output.stderr);
        if fits {
            assert!(output.status.success(), "{words}");
            continue;
        }
        assert_eq!(output.status.code(), Some(4), "{suffix}: {words}");
        assert!(words.contains("cannot be read again") && words.contains(&picture.display().to_string()), "{words}");
        assert_eq!(std::fs::read_to_string(&picture).expect("kept"), "the old one");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "nothing is left beside it");
        std::fs::remove_file(&picture).expect("removed");
    }
}

/// What a format does not hold is an error, though OpenImageIO says that it has written it.
#[test]
fn sizes_that_a_format_does_not_hold_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (suffix, size, is_held) in [
        ("jp2", "33x17", false),
        ("jp2", "40x40", true),
        ("gif", "65536x1", false),
        ("gif", "40x40", true),
        ("webp", "33x17", true),
        ("tga", "33x17", true),
        ("sgi", "33x17", true),
        ("bmp", "1x1", true),
    ] {
        let picture = folder.path().join("a").with_extension(suffix).to_string_lossy().into_owned();
        let output = command().args(["render", SCENE, "-o", &picture, "--size", size, "--spp", "1"]).output();
        let output = output.expect("the program runs");
        let words = text(&output.stderr);
        // Which formats there are is up to the OpenImageIO that is installed.
        if ["webp", "jp2"].contains(&suffix) && words.contains("unknown suffix") {
            continue;
        }
        assert_eq!(output.status.code(), Some(if is_held { 0 } else { 4 }), "{suffix} {size}: {words}");
        // Newer writers tell some of it themselves.
        assert!(is_held || words.contains(&picture) && words.len() > picture.len() + 20, "{words}");
        assert_eq!(Path::new(&picture).exists(), is_held);
        if is_held {
            std::fs::remove_file(&picture).expect("removed");
        }
    }
}
