//! Broken files: whatever is in them, loaders answer with a scene or an error, soon, and within memory.
//!
//! Small good files of every format are mutated by a generator with a fixed seed, so that a failure can be repeated;
//! its file is kept and named. Scenes that still load are made ready for tracing too.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use twincast::World;
use twincast::io::{LoadOptions, Normals, load};

use crate::allocation;
use crate::io::{course, gltf, model, nff, obj, ply, stl, toml};

/// Broken files in all, over all seeds of the corpus.
const FILES: usize = 24_000;
/// The longest that one file may take.
const LONGEST: Duration = Duration::from_secs(5);
/// The most memory that one file may take.
const MAX_BYTES: usize = 1 << 30;

/// A good file: the suffix it is loaded by, and its bytes.
struct Seed {
    name: String,
    suffix: String,
    bytes: Vec<u8>,
}

/// SplitMix64 (Steele, Lea, Flood 2014, *Fast splittable pseudorandom number generators*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

fn corpus() -> Vec<Seed> {
    let seed = |name: &str, suffix: &str, bytes: Vec<u8>| Seed { name: name.into(), suffix: suffix.into(), bytes };
    let mut seeds = vec![
        seed("obj", "obj", OBJ.into()),
        seed("ply text", "ply", PLY.into()),
        seed("ply little", "ply", ply::binary(false)),
        seed("ply big", "ply", ply::binary(true)),
        seed("stl text", "stl", stl::text().into()),
        seed("stl binary", "stl", stl::binary(b"solid")),
        seed("course", "test", course::TEXT.into()),
        seed("nff", "nff", nff::TEXT.into()),
        seed("toml", "toml", toml::text().into()),
        seed("gltf", "gltf", gltf::rich().into()),
        seed("glb", "glb", gltf::glb(gltf::rich_with_binary(), &gltf::triangle_bytes())),
    ];
    for name in ["meshopt", "draco"] {
        let path = format!("{}/tests/fixtures/{name}.gltf", env!("CARGO_MANIFEST_DIR"));
        seeds.push(seed(name, "gltf", fs::read(path).unwrap()));
    }
    for name in ["gltf/box_sparse.glb", "gltf/gltf_primitives.glb", "gltf/CornellBox.glb", "gltf/SimpleSkin.gltf"] {
        if let Some(path) = model(name) {
            let suffix = path.extension().unwrap().to_str().unwrap();
            seeds.push(seed(name, suffix, fs::read(&path).unwrap()));
        }
    }
    seeds
}

const OBJ: &str = "mtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0 1 0.5 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.2 0\nvt 0 0\nvt 1 1\nvn 0 0 1\n\
    usemtl a\ns 1\nf 1/1/1 2/2/1 3//1\nf 1 2 3 4 5\ns off\nusemtl b\nf -1 -2 -3\nf 3 4 \\\n 5\nl 1 2\n";
const MTL: &str =
    "newmtl a\nKd 1 0.5 0\nKs 1 1 1\nNs 20\nd 0.5\nmap_Kd -s 2 2 -clamp on a.png\nnewmtl b\nillum 1\nKe 1 1 1\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\nelement face 2\n\
    property list uchar int vertex_indices\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
    0 0 0 255 0 9 0 1\n1 0 0 1 2 3 0 1\n1 1 0 0 0 0 1 1\n0 1 0 5 5 5 0 0\n4 0 1 2 3\n3 0 1 2\n6 0 1 2 -1 3 1\n";

/// Words that decide something in one format or another, and numbers at the edges of types.
const WORDS: [&str; 36] = [
    "0",
    "-1",
    "1",
    "255",
    "65535",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "-9223372036854775808",
    "1e308",
    "1e-320",
    "nan",
    "inf",
    "-0",
    "0.5",
    "",
    "/",
    "//",
    "\\\n",
    "\n",
    " ",
    "{}",
    "[]",
    "null",
    "true",
    "\"x\"",
    "f 1 2 3 4 1 2 3",
    "s 1",
    "list uchar int",
    "float",
    "double",
    "endloop",
    "VEC4",
    "5125",
    "5126",
    "é",
];

fn mutate(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let length = bytes.len();
    let at = random.below(length + 1);
    let few = 1 + random.below(8);
    let end = (at + few).min(length);
    let number = bytes[at..].iter().position(u8::is_ascii_digit).map(|k| at + k);
    match random.below(16) {
        0 => bytes.truncate(at),
        1 if at < length => bytes[at] ^= 1 << random.below(8),
        2 if at < length => bytes[at] = random.next() as u8,
        3 => drop(bytes.drain(at..end)),
        4 => drop(bytes.splice(at..at, (0..few).map(|_| random.next() as u8).collect::<Vec<_>>())),
        5 => {
            let end = (at + random.below(200)).min(length);
            let copy = bytes[at..end].to_vec();
            let to = random.below(length + 1);
            drop(bytes.splice(to..to, copy));
        }
        6 => {
            let edges = [0, 1, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x7fc0_0000, 0x7f80_0000u32];
            let word = edges[random.below(edges.len())].to_le_bytes();
            bytes.iter_mut().skip(at & !3).zip(word).for_each(|(b, w)| *b = w);
        }
        7 => {
            let word = WORDS[random.below(WORDS.len())];
            drop(bytes.splice(at..end, word.bytes()));
        }
        8..=13 => {
            // A whole number in a text: another in its place.
            let Some(begin) = number else { return };
            let digits = bytes[begin..].iter().take_while(|b| b.is_ascii_digit()).count();
            let small = random.below(10).to_string();
            let word = if random.below(2) == 0 { &small } else { WORDS[random.below(WORDS.len())] };
            drop(bytes.splice(begin..begin + digits, word.bytes()));
        }
        _ => {
            let from = random.below(other.len() + 1);
            let part = &other[from..(from + random.below(100)).min(other.len())];
            drop(bytes.splice(at..at, part.iter().copied()));
        }
    }
}

/// Mutates the JSON of a GLB and leaves the container whole, which would otherwise be what is wrong with most.
fn mutate_json(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    let mut json = bytes[20..20 + length].to_vec();
    mutate(random, &mut json, other);
    *bytes = gltf::glb(&json, &bytes[28 + length..]);
}

/// What a broken file led to.
enum Outcome {
    Scene,
    Refused,
    Slow,
    Failed(String),
}

fn run(path: &Path, normals: Normals) -> Outcome {
    let (begin, options) = (Instant::now(), LoadOptions { normals, ..LoadOptions::default() });
    allocation::start();
    let result = catch_unwind(AssertUnwindSafe(|| match load(path, &options) {
        Ok((scene, warnings)) => {
            let text: usize = warnings.iter().map(|w| w.to_string().len()).sum();
            assert!(text < 1 << 20, "{text} bytes of warnings");
            // Singular transforms are refused there, and nothing else.
            let _ = World::new(&scene).map(|world| world.bounds());
            Outcome::Scene
        }
        Err(error) => {
            let text = error.to_string();
            assert!(error.exit_code() == 3 && text.len() < 4096, "{text}");
            Outcome::Refused
        }
    }));
    let (time, bytes) = (begin.elapsed(), allocation::most());
    match result {
        Err(_) => Outcome::Failed("a panic".into()),
        _ if time > LONGEST => Outcome::Slow,
        _ if bytes > MAX_BYTES => Outcome::Failed(format!("it took {bytes} bytes")),
        Ok(outcome) => outcome,
    }
}

#[test]
fn broken_files_do_no_harm() {
    // In memory where the system has that: twelve thousand files are written.
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    let folder = folder.expect("a temporary folder");
    fs::write(folder.path().join("a.mtl"), MTL).unwrap();
    fs::write(folder.path().join("a.png"), obj::picture()).unwrap();
    let place: PathBuf = folder.path().into();
    let (send, receive) = mpsc::channel();
    // A thread of its own, so that a hang is noticed.
    let worker = std::thread::spawn(move || {
        let seeds = corpus();
        let mut random = Random(2026);
        for count in 0..FILES {
            let seed = &seeds[count % seeds.len()];
            let other = &seeds[random.below(seeds.len())];
            let mut bytes = seed.bytes.clone();
            let is_json = seed.suffix == "glb" && random.below(4) > 0;
            for _ in 0..1 + random.below(3) {
                if is_json {
                    mutate_json(&mut random, &mut bytes, &other.bytes);
                } else {
                    mutate(&mut random, &mut bytes, &other.bytes);
                }
            }
            if count < seeds.len() {
                // The seeds themselves have to be good.
                bytes.clone_from(&seed.bytes);
            }
            let path = place.join("broken").with_extension(&seed.suffix);
            fs::write(&path, &bytes).unwrap();
            let normals = [Normals::File, Normals::Flat, Normals::Smooth][random.below(3)];
            // What stalls once may have had to wait for the tests beside this one; what is slow is slow each time.
            let outcome = match (0..3).map(|_| run(&path, normals)).find(|outcome| !matches!(outcome, Outcome::Slow)) {
                Some(outcome) => outcome,
                None => Outcome::Failed(format!("it took more than {LONGEST:?}, three times")),
            };
            let failed = matches!(outcome, Outcome::Failed(_));
            if failed {
                let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("broken-{count}.{}", seed.suffix));
                fs::write(kept, &bytes).unwrap();
            }
            send.send((count, seed.name.clone(), count < seeds.len(), outcome)).unwrap();
            if failed {
                return;
            }
        }
    });
    let (mut scenes, mut refused) = (0, 0);
    for expected in 0..FILES {
        match receive.recv_timeout(4 * LONGEST) {
            Ok((count, name, _, Outcome::Failed(how))) => {
                panic!("broken file {count}, of {name}: {how}; kept in {}", env!("CARGO_TARGET_TMPDIR"))
            }
            Ok((_, name, is_seed, Outcome::Refused)) => {
                assert!(!is_seed, "the seed {name} is refused");
                refused += 1;
            }
            Ok((_, _, _, Outcome::Scene)) => scenes += 1,
            Ok((_, _, _, Outcome::Slow)) => unreachable!("it was run again"),
            Err(problem) => panic!("broken file {expected}: {problem}"),
        }
    }
    worker.join().unwrap();
    eprintln!("{FILES} broken files: {scenes} load, {refused} are refused");
    // Mutations that break everything, or nothing, would test little.
    assert!(scenes > FILES / 20 && refused > FILES / 20, "{scenes} load, {refused} are refused");
}
