//! Very many placements in a `.toml` scene, which are read in pieces: what arrives, and where faults are told.

use std::fmt::Write;

use twincast::math::DVec3;
use twincast::scene::{Instance, Scene};

use super::{Files, refused};

const MANY: usize = 6000;
const GROUPS: &str = "[[group.a.sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
const SPHERE: &str = "[[sphere]]\ncentre = [9, 9, 9]\nradius = 1\n";

/// `MANY` placements, at the top or in a group, three lines each.
fn placements(header: &str, fault: impl Fn(usize) -> Option<&'static str>) -> String {
    (0..MANY).fold(String::new(), |mut text, i| {
        let third = fault(i).unwrap_or("");
        // In every spelling that a table has.
        let transform = match i % 3 {
            0 => format!("transform = {{ translate = [{i}, 0, 1] }}"),
            1 => format!("transform.translate = [{i}, 0, 1] # moved"),
            _ => format!("transform = [{{ translate = [{i}, 0, 1] }}, {{ scale = 2 }}]"),
        };
        writeln!(text, "[[{header}]]\ngroup = \"a\"\nname = 'n{i}'\n{transform} {third}").expect("text grows");
        text
    })
}

fn scene(text: &str) -> Scene {
    Files::one("a.toml", text).scene("a.toml")
}

#[test]
fn they_are_what_they_would_be_one_by_one() {
    let none = |_| None;
    let pieces = placements("instance", none);
    let (first, second) = pieces.split_at(pieces.find("[[instance]]\ngroup = \"a\"\nname = 'n3000'").expect("half"));
    let at_top = scene(&format!("[render]\nspp = 3\n{first}{GROUPS}{second}{SPHERE}"));
    let grouped = placements("group.all.instance", none);
    let in_group = scene(&format!("{GROUPS}{grouped}{SPHERE}[[instance]]\ngroup = \"all\"\nname = \"\"\n"));
    assert_eq!((at_top.request.spp, at_top.instances.len()), (Some(3), MANY + 1));
    let of = |scene: &Scene| -> Vec<(String, u32, DVec3, f64)> {
        let instance =
            |i: &Instance| (i.name.clone(), i.group, i.transform.translation, i.transform.matrix3.determinant());
        scene.instances.iter().map(instance).collect()
    };
    assert_eq!(of(&at_top), of(&in_group));
    let last = &at_top.instances[MANY];
    assert_eq!((last.name.as_str(), last.transform.translation), ("n5999", DVec3::new(5999.0, 0.0, 1.0)));
}

#[test]
fn faults_are_told_with_their_line() {
    let at = 4321;
    for (third, shift, words) in [
        ("\nsize = 3", 4, "[[instance]] has no key \"size\""),
        ("\ngroup = \"b\"", 4, "not TOML"),
        ("\n[instance.grp]", 4, "[[instance]] has no key \"grp\""),
        ("\n[[instance]]\ngroup = \"b\"", 5, "no [group.b]"),
        ("\nx = [", 6, "not TOML"),
    ] {
        let text = placements("instance", |i| (i == at).then_some(third));
        let first = 1 + GROUPS.lines().count() + 4 * at;
        refused(&Files::one("a.toml", format!("{GROUPS}{text}")), "a.toml", &format!("line {}", first + shift), words);
    }
    // Said in two ways, which TOML does not allow.
    let twice = format!("instance = []\n{}{GROUPS}", placements("instance", |_| None));
    refused(&Files::one("a.toml", &twice), "a.toml", "line 2", "not TOML");
}
