//! `twincast stress` and `twincast trace`.

use crate::program::{text, twincast};

/// A folder with the matrix; a ray of it, traced again, is wrong in the same way.
#[test]
fn what_fails_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_str().expect("UTF-8");
    let args = ["--case", "edge-leak", "--method", "native", "--method", "moeller-trumbore", "--rays", "900"];
    let output = twincast(&[&["stress", "-o", path, "--json"], &args[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    let cells = document["rows"][0]["cells"].as_array().expect("cells").clone();
    let marks: Vec<&str> = cells.iter().map(|cell| cell["mark"].as_str().expect("a mark")).collect();
    assert_eq!(marks, [".", "x"]);
    let map = std::fs::read_to_string(folder.path().join("matrix.svg")).expect("a picture");
    assert!(map.starts_with("<svg") && map.contains("edge-leak") && map.contains("moeller-trumbore"));
    assert!(folder.path().join("matrix.json").exists());
    let failing = std::fs::read_to_string(folder.path().join("failing.txt")).expect("rays");
    assert!(failing.contains("twincast trace case:edge-leak/"), "{failing}");

    let replay = &cells[1]["replay"][0];
    let (scene, ray) = (replay["scene"].as_str().expect("a scene"), replay["ray"].as_str().expect("a ray"));
    let form = replay["form"].as_str().expect("an accelerator");
    let args = ["trace", scene, "--ray", ray, "--accel", form, "--triangle-method", "moeller-trumbore"];
    let output = twincast(&[&args[..], &["--oracle", "--json", "--backend", "native"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
    let answers = said["answers"].as_array().expect("answers");
    assert_eq!((answers[0]["engine"].as_str(), answers[1]["engine"].as_str()), (Some(form), Some("brute")));
    assert_ne!(answers[0]["hit"]["id"], answers[1]["hit"]["id"]);
    assert_eq!(answers[1]["hit"]["id"], said["exact"]["nearest"][0]);
}

#[test]
fn a_ray_is_traced_and_said_to_the_bit() {
    let output =
        twincast(&["trace", "case:in-plane", "--ray", "0.25,0.25,1,0,0,-1", "--oracle", "--backend", "native"]);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(said.contains("bvh          0/0/0      t 1.0 (0x1p+0), u 0x1p-2, v 0x1p-2\n"), "{said}");
    assert!(said.contains("exact        0/0/0      t 1.0\n"), "{said}");
    let along = twincast(&["trace", "case:in-plane", "--ray", "-1,0.5,0,1,0,0", "--oracle", "--backend", "native"]);
    assert!(text(&along.stdout).contains("exact        nothing"), "{}", text(&along.stdout));
}

#[test]
fn what_is_asked_wrongly_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path.to_str().expect("UTF-8").to_owned()
    };
    let number =
        file("number.json", r#"{"note": "", "triangles": [[["0","0","x"],["1","0","0"],["0","1","0"]]], "rays": []}"#);
    let ray = file("ray.json", r#"{"note": "", "rays": ["1,2,3"]}"#);
    let other = file("other.json", "{\"note\": 3}");
    let far = file("far.json", r#"{"note": "", "spheres": [["1e6","0","0","1"]], "rays": ["0,0,0,1,0,0"]}"#);
    for (args, code, words) in [
        (&["stress", "--case", "none"][..], 2, "edge-leak"),
        (&["stress", "--method", "none"], 2, "moeller-trumbore"),
        (
            &["stress", "--method", "woop", "--backend", "embree"],
            if cfg!(feature = "embree") { 2 } else { 5 },
            if cfg!(feature = "embree") { "--backend" } else { "embree" },
        ),
        (&["stress", "--case", &number], 3, "/triangles/0: \"x\""),
        (&["stress", "--case", &ray], 3, "/rays/0: 3 numbers"),
        (&["stress", "--case", &other], 3, "line 1: is no stress case"),
        (&["stress", "--case", &far], 3, "so far from zero"),
        (&["stress", "--case", "missing.json"], 3, "missing.json"),
        (&["trace", "case:none", "--ray", "0,0,0,0,0,1"], 2, "no case \"none\""),
        (&["trace", "case:tiny", "--ray", "0,0,0,0,0,1"], 2, "case:tiny/2e-4"),
        (&["trace", "case:in-plane", "--ray", "0,0,0"], 2, "3 numbers"),
    ] {
        let output = twincast(args);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
    }
}
