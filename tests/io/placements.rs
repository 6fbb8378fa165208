//! Very many placements and primitives in a `.toml` scene, which are read in pieces: what arrives, and where faults are
//! told.

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

const MATERIALS: &str = "[material.red]\ndiffuse = [1, 0, 0]\n[material.blue]\ndiffuse = [0, 0, 1]\n";

/// Primitive i, in six lines, of which the last is free.
fn primitive(within: &str, i: usize, last: &str) -> String {
    let (key, what) = [
        ("sphere", "centre = [1, 0, I]\nradius = 0.5"),
        ("triangle", "corners = [[0, 0, I], [1, 0, I],\n[0, 1, I]]"),
        ("plane", "point = [0, 0, I]\nnormal = [0, 0.5, 1]"),
        ("disk", "centre = [1, 0, I]\nnormal = [0, 1, 1]\nradius = 0.5"),
        ("box", "min = [0, 0, I]\nmax = [1, 1, 6001]"),
        ("cylinder", "base = [0, 0, I]\napex = [0, 1, I] # upwards\nradius = 0.1"),
        ("cone", "base = [0, 0, I]\napex = [0, 1, I]\nbase_radius = 0.1"),
        ("ellipsoid", "centre = [0, 0, I]\nradii = [1, 2, 3]"),
        ("polygon", "corners = [[0, 0, I], [1, 0, I],\n[1, 1, I], [0, 1, I]]"),
    ][i % 9];
    let material = ["", "material = 'red'", "material = \"blue\""][i / 9 % 3];
    let text = format!("[[{within}{key}]]\n{}\n{material}", what.replace('I', &i.to_string()));
    let mut lines: Vec<&str> = text.lines().collect();
    lines.resize(5, "");
    lines.join("\n") + "\n" + last + "\n"
}

fn primitives(within: &str) -> impl Iterator<Item = String> {
    (0..MANY).map(move |i| primitive(within, i, ""))
}

#[test]
fn primitives_are_what_they_would_be_one_by_one() {
    let half = primitives("").take(MANY / 2).collect::<String>();
    let rest = primitives("").skip(MANY / 2).collect::<String>();
    let at_top = scene(&format!("{half}{MATERIALS}{rest}"));
    let grouped: String = primitives("group.all.").collect();
    let in_group = scene(&format!("{MATERIALS}{grouped}[[instance]]\ngroup = \"all\"\n"));
    let told = |scene: &Scene| format!("{:?} {:?}", scene.geometries, scene.materials);
    assert!(told(&at_top) == told(&in_group));
    assert_eq!((at_top.primitive_count(), at_top.materials.len()), (MANY as u64, 3));
}

/// As if it were alone in the file, in its line.
#[test]
fn faults_of_primitives_are_told_with_their_line() {
    for (at, last, words) in [
        (5000, "size = 3", "has no key \"size\""),
        (4997, "material = 'green'", "no [material.green]"),
        (4500, "colour = ", "not TOML"),
        (5001, "apex_radius = -1", "[[cone]]: "),
    ] {
        let refusal = |text: String| {
            let files = Files::one("a.toml", text);
            twincast::io::load(&files.path("a.toml"), &Default::default()).map(|_| ()).unwrap_err()
        };
        let text = |others: bool| {
            let each = (0..MANY).map(|i| match others || i == at {
                true => primitive("", i, if i == at { last } else { "" }),
                false => "\n".repeat(6),
            });
            MATERIALS.to_owned() + &each.collect::<String>()
        };
        let twincast::Error::Input { place, message, .. } = refusal(text(true)) else { panic!("{words}") };
        let twincast::Error::Input { place: alone, message: expected, .. } = refusal(text(false)) else { panic!() };
        assert_eq!((place, &message), (alone, &expected), "{words}");
        assert!(message.contains(words), "{message}");
    }
    // The last sphere is not in this triangle's piece.
    let text: String = (0..MANY).map(|i| primitive("", i, if i == 5 * 1027 { "[sphere.size]" } else { "" })).collect();
    let files = Files::one("a.toml", text);
    refused(&files, "a.toml", &format!("line {}", 6 * 5 * 1027 + 6), "[[sphere]] has no key \"size\"");
}
