//! docs/JSON.md against what the program prints: every field is told of, and every field that is told of is there.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::program::{text, twincast};

/// What the page says: for each command, as it writes it, the paths of its fields.
fn page() -> Vec<(String, BTreeSet<String>)> {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/JSON.md")).expect("the page");
    let mut documents: Vec<(String, BTreeSet<String>)> = Vec::new();
    for line in page.lines() {
        if let Some(rest) = line.strip_prefix("`twincast ") {
            let (command, _) = rest.split_once('`').expect("code ends");
            documents.push((command.to_owned(), BTreeSet::new()));
        } else if let (Some(rest), Some((_, fields))) = (line.strip_prefix("| `"), documents.last_mut()) {
            let (names, _) = rest.split_once('|').expect("a second cell");
            let mut parent = String::new();
            for name in names.split('`').step_by(2) {
                let path = if name.starts_with('.') { format!("{parent}{name}") } else { name.to_owned() };
                parent = path.rsplit_once('.').map_or_else(String::new, |(parent, _)| parent.to_owned());
                assert!(fields.insert(path.clone()), "{path} is told of twice");
            }
        }
    }
    documents
}

/// The paths of all fields of a document, objects and lists among them.
fn paths(value: &Value, at: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let path = if at.is_empty() { name.clone() } else { format!("{at}.{name}") };
                paths(value, &path, found);
                found.insert(path);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| paths(value, &format!("{at}[]"), found)),
        _ => {}
    }
}

/// Runs `command` of the page with other words for those in capitals, and compares what it prints with what is said of
/// it; `elsewhere` are fields that other scenes have.
fn check(command: &str, arguments: &[&str], elsewhere: &[&str]) {
    let page = page();
    let (_, told) = page.iter().find(|(name, _)| name == command).expect("a command of the page");
    let output = twincast(arguments);
    let mut printed = BTreeSet::new();
    let document = text(&output.stdout);
    let value: Value = serde_json::from_str(&document).unwrap_or_else(|error| {
        panic!("{command}: {error}: {document}{}", text(&output.stderr));
    });
    paths(&value, "", &mut printed);
    let is_below = |path: &str, above: &str| path.strip_prefix(above).is_some_and(|rest| rest.starts_with(['.', '[']));
    for path in &printed {
        // An object whose fields are told of needs no line of its own; of one that has a line and no others, that says
        // all.
        let is_told = told.contains(path)
            || told.iter().any(|other| is_below(other, path))
            || told.iter().any(|other| is_below(path, other) && !told.iter().any(|third| is_below(third, other)));
        assert!(is_told, "{command}: docs/JSON.md says nothing of {path}");
    }
    for path in told {
        let is_printed = printed.contains(path);
        let is_elsewhere = elsewhere.iter().any(|other| path == other || is_below(path, other));
        assert!(is_printed != is_elsewhere, "{command}: {path} is printed: {is_printed}");
    }
}

/// A scene of the repository.
macro_rules! scene {
    ($path:literal) => {
        concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/", $path)
    };
}

#[test]
fn of_scenes() {
    check("info SCENE --json", &["info", scene!("gallery/gallery.glb"), "--json"], &["textures"]);
    let plan = ["plan", scene!("gallery/gallery.glb"), "--json", "--size", "16x8", "--spp", "1", "--measure", "1"];
    check("plan SCENE --json", &plan, &[]);
    let explain = ["render", scene!("gallery/gallery.glb"), "--pixel", "100,100", "--explain", "--json"];
    check("render SCENE --pixel X,Y --explain --json", &explain, &[]);
}

#[cfg(feature = "embree")]
#[test]
fn of_comparisons() {
    let scene = scene!("gallery/gallery.glb");
    check("compare SCENE --json", &["compare", scene, "--json", "--size", "16x8"], &[]);
    check("compare SCENE --all --json", &["compare", scene, "--all", "--json", "--size", "16x8"], &[]);
    let bench = ["bench", "terrain10", "--json", "--size", "16", "--repeat", "1", "--threads", "1"];
    check("bench SCENE --json", &bench, &[]);
}

#[test]
fn of_growth() {
    let scaling = ["bench", "--scaling", "--json", "--max", "10"];
    check("bench --scaling --json", &scaling, &[]);
}

#[test]
fn of_cases() {
    check("stress --json", &["stress", "--case", "huge-sphere", "--case", "edge-leak", "--json"], &[]);
    check("stress --search SECONDS --json", &["stress", "--search", "1", "--json"], &["found[]"]);
    let trace = ["trace", "case:edge-leak/6", "--ray", "0x1p-2,0,0,1,0,0", "--oracle", "--json"];
    check("trace SCENE --ray RAY --json", &trace, &[]);
}
