//! The catalogue of cases on which ray casters fail: the record of it holds, and what is broken on purpose is caught.

mod mutants;
mod oracle;
mod program;
mod spawned;

use twincast::lab::stress::{Column, Found, Gate, Search, Setup, Tally, catalogue, columns, file};
use twincast::lab::tree::Oracle;
use twincast::render::Control;
use twincast::{Hit, Tracer, TriangleMethod};

/// Everything exact is exact, and everything else fails where it is on record, and nowhere else.
#[test]
fn the_matrix_is_as_it_is_on_record() {
    let (rays, seed) = (Setup::RAYS, Setup::SEED);
    let setup =
        Setup { cases: catalogue().collect(), own: Vec::new(), columns: columns(), rays, seed, in_turns: false };
    let report = setup.run(Control::default()).expect("nothing stops it");
    report.check().unwrap_or_else(|error| panic!("{error}\n{report}"));
    assert_eq!(report.rows.len(), catalogue().count());
    for row in &report.rows {
        // Each case has rays that hit, but those of which the point is that there is nothing to hit.
        let none = ["in-plane", "degenerate"].contains(&row.name.as_str());
        assert!((row.hits == 0) == none && row.rays > 0, "{}: {} hits", row.name, row.hits);
    }
}

/// A million other rays than those on record, each asked of one of the ways in which the native tracer answers.
#[test]
fn native_is_exact_on_a_million_other_rays() {
    let setup = Setup {
        cases: catalogue().collect(),
        own: Vec::new(),
        columns: vec![Column::Native],
        rays: 35_500,
        seed: 77,
        in_turns: true,
    };
    let report = setup.run(Control::default()).expect("nothing stops it");
    report.check().unwrap_or_else(|error| panic!("{error}\n{report}"));
    assert!(report.rows.iter().map(|row| row.rays).sum::<u64>() >= 1_000_000);
}

fn search(columns: Vec<Column>, most: u64) -> Vec<Found> {
    let search = Search { columns, time: None, most, enough: 1, seed: 5 };
    search.run(Control::default()).expect("nothing stops it").1
}

#[test]
fn a_search_finds_what_textbooks_miss_and_nothing_of_the_native_tracer() {
    let found = search(vec![Column::Triangle(TriangleMethod::MoellerTrumbore)], 200_000);
    let [found] = &found[..] else { panic!("it leaks") };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("found.json");
    std::fs::write(&path, &found.text).expect("a file");
    // The file is the case: the same method fails on it again, by the same fault, and the native tracer does not.
    let (name, probe) = file::read(&path).expect("a case");
    assert_eq!(name, "found");
    let oracle = Oracle::new(&probe.world, 0.0);
    let exact: Vec<_> = probe.rays.iter().map(|ray| oracle.closest(ray)).collect();
    let mut faults = Vec::new();
    let mut ask = |_: &str, tracer: &dyn Tracer, _| {
        let hits: Vec<Option<Hit>> = probe.rays.iter().map(|ray| tracer.closest(ray)).collect();
        let occluded: Vec<bool> = probe.rays.iter().map(|ray| tracer.occluded(ray)).collect();
        faults.extend(Tally::default().add(Gate::Hits, &probe.rays, &exact, &hits, &occluded));
        Ok(())
    };
    found.column.each(&probe.world, &mut ask).expect("it builds");
    assert!(faults.contains(&(0, found.fault)), "{faults:?} {}", found.text);
    let own = vec![(name, probe)];
    let setup = Setup { cases: Vec::new(), own, columns: vec![Column::Native], rays: 1, seed: 0, in_turns: false };
    setup.run(Control::default()).expect("nothing stops it").check().expect("native is right");

    assert!(search(vec![Column::Native], 6000).is_empty());
}
