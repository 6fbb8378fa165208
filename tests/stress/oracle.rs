//! The oracle behind its tree against the oracle without one.

use twincast::lab::oracle::{self, Id};
use twincast::lab::rays::{Aim, Query};
use twincast::lab::stress::catalogue;
use twincast::lab::tree::Oracle;
use twincast::math::Vec3;
use twincast::scene::{Geometry, Material, Mesh, Scene};
use twincast::{Ray, World};

use crate::scenes::Random;

/// The tree and its filter against every primitive met exactly, on the catalogue's own scenes and rays, and on aimed
/// ones.
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

/// Rays from the origin to an edge, exactly, where f64 rounds and may tell either side of it: those are not passed by.
#[test]
fn an_edge_that_is_met_exactly_is_not_passed_by() {
    let mut random = Random::new(5);
    for _ in 0..2000 {
        // Whole numbers of 21 bits: a sum of six is exact in f32, and the volume of three is not in f64.
        let mut corner = || (random.vec3() * 2f32.powi(21)).round();
        let corners = [corner(), corner(), corner()];
        // With its mirror image behind the ray the triangle's middle is the origin, and nothing is moved there.
        let positions = corners.into_iter().chain(corners.map(|corner| -corner)).collect();
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [3, 4, 5]]);
        let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
        let world = World::new(&scene).expect("a world");
        let along = [1.0, 2.0, 3.0];
        let ray = Ray::new(Vec3::ZERO, corners[0] * along[random.below(3)] + corners[1] * along[random.below(3)]);
        let found = Oracle::new(&world, 0.0).closest(&ray);
        let expected: Vec<Id> = oracle::closest(&world, &ray).into_iter().map(|(id, _)| id).collect();
        assert_eq!(found.nearest, expected, "{corners:?} {ray:?}");
        assert!(found.touches && expected.len() == 1, "{corners:?} {ray:?}");
    }
}
