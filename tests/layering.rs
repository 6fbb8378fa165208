//! Holds the source to the layers of the architecture: imports only ever point down, and `unsafe` stays where it may
//! be.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The layers, from the bottom up. A module may use those in the layers below its own, and itself. `main` is the
/// program.
const LAYERS: &[&[&str]] = &[
    &["error"],
    &["output", "memory", "once"],
    &["math"],
    &["ray"],
    &["shape", "image"],
    &["scene"],
    &["io", "trace"],
    &["shade"],
    &["plan"],
    &["render"],
    &["lab"],
    &["cli"],
    &["main"],
];

/// Files and folders that may say `unsafe`.
const UNSAFE: &[&str] = &[
    "core/src/memory/",
    "core/src/trace/bvh/simd/",
    "core/src/trace/bvh/walk/stack.rs",
    "src/cli/leave.rs",
    "src/cli/signals.rs",
    "src/image/denoise/device.rs",
    "src/image/denoise/library.rs",
    "src/image/loading.rs",
    "src/image/oiio/bridge.rs",
    "src/image/oiio/shim.rs",
    "src/image/oiio/unnamed.rs",
    "src/trace/embree/",
];

/// Where the two crates' source is, below the repository. A module is in the same layer in both.
const SOURCES: [&str; 2] = ["core/src/", "src/"];

/// The crate below, as the one above names it.
const CORE: &str = "twincast_core::";

/// Every source file, by its path below the repository, without comments.
fn files() -> Vec<(String, String)> {
    fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).expect("a readable folder") {
            let path = entry.expect("a readable entry").path();
            if path.is_dir() {
                walk(&path, files);
            } else if path.extension().is_some_and(|suffix| suffix == "rs") {
                files.push(path);
            }
        }
    }
    let of_one = |source: &str| {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut paths = Vec::new();
        walk(&root.join(source), &mut paths);
        paths.sort();
        assert!(paths.len() > 100, "the scan found the source below {source}");
        let relative = |path: &Path| {
            let parts = path.strip_prefix(root).expect("below it").components();
            parts.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect::<Vec<_>>().join("/")
        };
        let text = |path: &Path| without_comments(&fs::read_to_string(path).expect("readable text"));
        paths.iter().map(|path| (relative(path), text(path))).collect::<Vec<_>>()
    };
    SOURCES.iter().flat_map(|source| of_one(source)).collect()
}

fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// Without its tests, which may look up: they compare with the oracle and render whole scenes.
fn without_tests(text: &str) -> &str {
    // A module in a file of its own is only declared, wherever modules are: what follows is no test.
    let is_here = |&(start, mark): &(usize, &str)| {
        let rest = &text[start + mark.len()..];
        rest.find(['{', ';']).is_some_and(|end| rest[end..].starts_with('{'))
    };
    text.match_indices("#[cfg(test)]\nmod ").find(is_here).map_or(text, |(start, _)| &text[..start])
}

/// The modules of a file's path: `src/trace/bvh/mod.rs` is `trace::bvh`.
fn module_path(file: &str) -> Vec<&str> {
    let below = SOURCES.iter().find_map(|source| file.strip_prefix(source)).expect("a source file");
    below.trim_end_matches(".rs").split('/').filter(|part| !matches!(*part, "mod" | "lib")).collect()
}

/// The first names in what follows `crate::`: one, or all those in braces.
fn heads(rest: &str) -> Vec<&str> {
    let name = |text: &str| text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    let Some(list) = rest.strip_prefix('{') else { return vec![&rest[..name(rest)]] };
    let (mut depth, mut start, mut names) = (0, 0, Vec::new());
    for (i, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' | ',' if depth == 0 => {
                let item = list[start..i].trim();
                names.push(&item[..name(item)]);
                start = i + 1;
                if c == '}' {
                    break;
                }
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    names
}

/// Every name directly below a module that `text` refers to, which stands in the module `path` from there on. `roots`
/// are the module's own paths.
fn uses<'t>(text: &'t str, path: &[&str], roots: &[&str]) -> Vec<&'t str> {
    let mut found = Vec::new();
    for root in roots {
        for (i, _) in text.match_indices(root) {
            // Not `$crate::` and not another crate's name.
            if !text[..i].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$') {
                found.extend(heads(&text[i + root.len()..]));
            }
        }
    }
    let climb = "super::".repeat(path.len());
    if !path.is_empty() {
        for (i, _) in text.match_indices(&climb) {
            if !text[..i].ends_with("super::") {
                found.extend(heads(&text[i + climb.len()..]));
            }
        }
    }
    found
}

/// From each name that a `lib.rs` re-exports from a module to that module.
fn reexports(lib: &str) -> BTreeMap<&str, &str> {
    let mut map = BTreeMap::new();
    for (i, _) in lib.match_indices("pub use ") {
        let rest = &lib[i + "pub use ".len()..];
        if rest.starts_with(CORE) {
            continue;
        }
        let (module, names) = rest.split_once("::").expect("pub use module::names");
        for name in heads(names) {
            map.insert(name, module);
        }
    }
    map
}

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// What is wrong with the imports of one file.
fn violations(file: &str, text: &str, exports: &BTreeMap<&str, &str>) -> Vec<String> {
    let path = module_path(file);
    let Some(&module) = path.first() else { return Vec::new() };
    let Some(own) = layer(module) else { return vec![format!("{file}: module {module} is in no layer")] };
    let mut wrong = Vec::new();
    for name in uses(without_tests(text), &path, &["crate::", CORE]) {
        let target = exports.get(name).copied().unwrap_or(name);
        match layer(target) {
            Some(other) if target == module || other < own => {}
            Some(_) => wrong.push(format!("{file}: {module} must not use {target} ({name})")),
            // A macro or a name of the crate's root, where nothing is defined: not resolvable by this test.
            None => wrong.push(format!("{file}: {name} is in no layer")),
        }
    }
    wrong
}

#[test]
fn imports_point_down() {
    let files = files();
    let libs = files.iter().filter(|(file, _)| file.ends_with("src/lib.rs"));
    let exports: BTreeMap<&str, &str> = libs.flat_map(|(_, lib)| reexports(lib)).collect();
    // Test modules in files of their own are named so.
    let judged = files.iter().filter(|(file, _)| !file.ends_with("tests.rs"));
    let wrong: Vec<_> = judged.flat_map(|(file, text)| violations(file, text, &exports)).collect();
    assert!(wrong.is_empty(), "imports only ever point down:\n{}", wrong.join("\n"));
    assert_eq!((exports.get("Ray"), exports.get("Renderer")), (Some(&"ray"), Some(&"render")));
}

/// The modules among `parts` that are in a circle of imports, or between two.
fn circular<'a>(parts: &BTreeMap<&'a str, BTreeSet<&str>>) -> Vec<&'a str> {
    let mut left: Vec<&str> = parts.keys().copied().collect();
    loop {
        let before = left.len();
        let still = left.clone();
        let imports = |from: &str, to: &str| from != to && parts[from].contains(to);
        left.retain(|part| {
            still.iter().any(|other| imports(part, other)) && still.iter().any(|other| imports(other, part))
        });
        if left.len() == before {
            return left;
        }
    }
}

#[test]
fn parts_of_the_native_tracer_import_one_way() {
    const ROOT: &str = "crate::trace::bvh::";
    // A query says what is done with a hit, and `hits` does it.
    const EXCEPTION: (&str, &str) = ("query", "hits");
    let files = files();
    let mut parts: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (file, text) in files.iter().filter(|(file, _)| !file.ends_with("tests.rs")) {
        if let ["trace", "bvh", path @ ..] = &module_path(file)[..]
            && let Some(part) = path.first()
        {
            parts.entry(part).or_default().extend(uses(without_tests(text), path, &[ROOT]));
        }
    }
    assert!(parts["walk"].contains("simd") && parts.len() > 20, "{parts:?}");
    let (from, to) = EXCEPTION;
    assert!(parts.get_mut(from).is_some_and(|imports| imports.remove(to)), "the exception is one");
    let circle = circular(&parts);
    assert!(circle.is_empty(), "among these, imports run in a circle: {circle:?}");
}

#[test]
fn unsafe_stays_where_it_may_be() {
    let is_word = |text: &str, i: usize| {
        let (before, after) = (&text[..i], &text[i + "unsafe".len()..]);
        let inside = |c: char| c.is_alphanumeric() || c == '_';
        !before.ends_with(inside) && !after.starts_with(inside)
    };
    for (file, text) in files() {
        let allowed = UNSAFE.iter().any(|place| file.starts_with(place));
        let says_unsafe = text.match_indices("unsafe").any(|(i, _)| is_word(&text, i));
        let may = text.contains("allow(unsafe_code)") || text.contains("expect(unsafe_code)");
        assert!(allowed || !(says_unsafe || may), "{file}: unsafe code has no place here");
    }
}

/// What tells where things are tells of files and folders that are there.
#[test]
fn guides_name_what_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut named = 0;
    for guide in ["core/src/shape/mod.rs", "docs/ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text = fs::read_to_string(root.join(guide)).expect("a guide");
        let quoted = text.split('`').skip(1).step_by(2);
        let is_path = |word: &&str| {
            let is_plain = word.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"/._-".contains(&byte));
            let begins = ["core/", "src/", "ffi/", "tests/", "scripts/", "benches/"];
            is_plain && begins.iter().any(|folder| word.starts_with(folder))
        };
        for path in quoted.filter(is_path) {
            assert!(root.join(path).exists(), "{guide} names {path}");
            named += 1;
        }
    }
    assert!(named > 30, "{named}");
}

#[test]
fn the_scan_itself_finds_what_it_should() {
    let exports = BTreeMap::from([("Renderer", "render"), ("Ray", "ray")]);
    let wrong = |file: &str, text: &str| violations(file, &without_comments(text), &exports).len();
    assert_eq!(wrong("src/trace/bvh/mod.rs", "use crate::math::Vec3; use crate::{Ray, scene::{Scene, Mesh}};"), 0);
    assert_eq!(wrong("src/trace/bvh/mod.rs", "use crate::io::load;"), 1);
    assert_eq!(wrong("src/trace/mod.rs", "use twincast_core::{math, trace, shade};"), 1);
    assert_eq!(wrong("src/trace/bvh/mod.rs", "use crate::{math, Renderer, lab::{a, b}, ray};"), 2);
    assert_eq!(wrong("src/trace/bvh/mod.rs", "use super::super::shade::x; use super::World;"), 1);
    assert_eq!(wrong("src/trace/bvh/walk.rs", "use super::super::super::shade::x; use super::super::World;"), 1);
    assert_eq!(wrong("src/trace/mod.rs", "// crate::render\nlet x = crate::render::y();"), 1);
    assert_eq!(wrong("src/math/mod.rs", "fn f() {}\n#[cfg(test)]\nmod tests { use crate::lab; }"), 0);
    assert_eq!(
        wrong(
            "src/math/mod.rs",
            "#[cfg(test)]\nmod tests;\nuse crate::lab;\n#[cfg(test)]\nmod more { use crate::lab; }"
        ),
        1
    );
    let circle = |of_c| {
        let imports = [("a", vec!["b", "a", "Bvh"]), ("b", vec!["c"]), ("c", of_c)];
        circular(&imports.map(|(part, imports)| (part, imports.into_iter().collect())).into())
    };
    assert_eq!((circle(vec![]), circle(vec!["b"])), (vec![], vec!["b", "c"]));
    assert_eq!(wrong("src/novel.rs", ""), 1);
    assert_eq!(wrong("src/ray.rs", "use crate::novel::x;"), 1);
}
