//! The oracle behind its tree against the oracle without one.

use twincast::lab::oracle::{self, Id};
use twincast::lab::rays::{Aim, Query};
use twincast::lab::stress::catalogue;
use twincast::lab::tree::Oracle;

/// The tree and its filter against every primitive met exactly, on the catalogue's own scenes and rays, and on aimed ones.
#[test]
fn the_tree_loses_nothing() {
    let (mut hits, mut ties, mut touching) = (0, 0, 0);
    for case in catalogue() {
        for probe in case.probes(60, 3) {
            // Exact arithmetic on every primitive takes its time.
            if probe.world.primitive_count() > 1200 {
                continue;
            }
            let oracle = Oracle::new(&probe.world, 0.0);
            let aim = Aim::new(&probe.world);
            let aimed = aim.iter().flat_map(|aim| (0..20).map(|i| aim.ray(1, i)));
            let aimed = aimed.map(|(Query::Closest(ray) | Query::Occluded(ray))| ray);
            for ray in probe.rays.iter().copied().chain(aimed) {
                let (found, expected) = (oracle.closest(&ray), oracle::closest(&probe.world, &ray));
                let ids: Vec<Id> = expected.iter().map(|(id, _)| *id).collect();
                assert_eq!(found.nearest, ids, "{} {ray:?}", case.name);
                if let Some((_, first)) = expected.first() {
                    let t = first.t.to_f64();
                    assert!((found.t - t).abs() <= 1e-12 * t.abs(), "{} {} {t}", case.name, found.t);
                    assert_eq!(found.at_range_end, first.at_range_end, "{} {ray:?}", case.name);
                }
                hits += usize::from(!ids.is_empty());
                ties += usize::from(ids.len() > 1);
                touching += usize::from(found.touches);
            }
        }
    }
    assert!(hits > 500 && ties > 20 && touching > 20, "{hits} {ties} {touching}");
}
