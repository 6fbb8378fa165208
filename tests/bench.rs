//! The benchmark: its rays are those of `benches/embree_ref.cpp`, its figures hang together, and it finds wrong
//! answers.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use twincast::io::UpAxis;
use twincast::lab::bench::{Built, Contender, Kind, RaySet, SIDE, Setup, Subject};
use twincast::math::Vec3;
use twincast::trace::bvh::{Bvh, Isa, Options};
use twincast::{Batch, Error, Hit, Ray, Tracer, World};

use crate::skip::skip;

/// How many rays of each kind hit something.
fn hits(subject: &Subject) -> [usize; 3] {
    let bvh = Bvh::build(&subject.world);
    let sets = subject.view.rays(&subject.world, &bvh, &Kind::ALL, SIDE);
    assert_eq!(sets.iter().map(|set| set.kind).collect::<Vec<_>>(), Kind::ALL[..5], "the prepared ones");
    let counts: Vec<usize> = sets
        .iter()
        .map(|set| {
            if set.kind.is_shadow() {
                let mut occluded = vec![false; set.rays.len()];
                bvh.occluded_batch(&set.rays, &mut occluded, Batch::default());
                return occluded.iter().filter(|occluded| **occluded).count();
            }
            let mut hits = vec![None; set.rays.len()];
            bvh.closest_batch(&set.rays, &mut hits, Batch::default());
            hits.iter().flatten().count()
        })
        .collect();
    assert_eq!(sets[0].rays.len(), SIDE * SIDE);
    assert_eq!((sets[1].rays.len(), sets[2].rays.len()), (counts[0], counts[0]), "one of each from every hit");
    [counts[0], counts[1], counts[2]]
}

/// What `embree_ref` prints, robust, ray by ray. Secondary rays differ from it by the rounding of their origins, and a
/// few by what they hit; a random number out of step would change tens of thousands.
#[track_caller]
fn assert_hits(subject: &Subject, embree_ref: [usize; 3]) {
    let ours = hits(subject);
    assert_eq!(ours[0], embree_ref[0], "primary");
    for k in [1, 2] {
        assert!(ours[k].abs_diff(embree_ref[k]) <= 10, "{ours:?}, embree_ref {embree_ref:?}");
    }
}

#[test]
fn the_rays_on_a_terrain_are_those_of_embree_ref() {
    let (subject, _) = Subject::new("terrain300", UpAxis::Y).unwrap();
    assert_hits(&subject, [716_788, 336_739, 297_638]);
}

#[test]
fn rays_of_a_direction_are_where_those_of_a_point_are() {
    let (subject, _) = Subject::new("terrain20", UpAxis::Y).unwrap();
    let bvh = Bvh::build(&subject.world);
    let kinds = [Kind::Primary, Kind::Shadow, Kind::Orthographic, Kind::Sun];
    let sets = subject.view.rays(&subject.world, &bvh, &kinds, 64);
    let [primary, shadow, orthographic, sun] = <[RaySet; 4]>::try_from(sets).ok().unwrap().map(|set| set.rays);
    assert_eq!((primary.len(), orthographic.len(), shadow.len()), (4096, 4096, sun.len()));
    for (near, far) in primary.iter().zip(&orthographic) {
        // They start in a plane across, through the camera, and cross in another one.
        let way = orthographic[0].direction;
        assert_eq!(far.direction, way);
        assert!((far.origin - near.origin).dot(way).abs() < 1e-5, "{near:?}, {far:?}");
        let crossing = (far.origin + way - near.origin).normalize();
        assert!(crossing.distance(near.direction) < 1e-5, "{near:?}, {far:?}");
    }
    // Both look at the centre, where the camera is as far away as a direction is long.
    let middle = orthographic.iter().map(|ray| ray.origin).sum::<Vec3>() / 4096.0;
    assert!(middle.distance(primary[0].origin) < 1e-4, "{middle}");
    for (near, far) in shadow.iter().zip(&sun) {
        assert_eq!((far.direction, far.origin), (sun[0].direction, near.origin));
        // From everywhere but the centre the light is beside the sun.
        assert!(far.direction.normalize().dot(near.direction.normalize()) > 0.9, "{near:?}, {far:?}");
    }
}

#[test]
fn the_rays_on_a_scan_with_z_up_are_those_of_embree_ref() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/models/nefertiti.obj");
    if !path.exists() {
        skip(format_args!("{} is missing", path.display()));
        return;
    }
    let (subject, _) = Subject::new(path.to_str().expect("UTF-8"), UpAxis::Z).unwrap();
    assert_eq!(subject.world.primitive_count(), 99_938 + 2, "with a floor");
    assert_hits(&subject, [797_159, 161_277, 180_042]);
}

#[test]
fn a_subject_is_a_rule_or_a_file() {
    let triangles =
        |name| Subject::new(name, UpAxis::Y).map(|(s, _)| (s.world.primitive_count(), s.world.stored_triangles()));
    assert_eq!(triangles("terrain7").unwrap(), (98, 98));
    assert_eq!(triangles("architecture3").unwrap(), (3 * 4140 + 2, 3 * 4140 + 2), "on a floor");
    assert_eq!(triangles("instances5").unwrap(), (5 * 8192 + 2, 8192 + 2), "one mesh, and a floor");
    assert_eq!(triangles("instances1").unwrap(), (8192 + 2, 8192 + 2));
    for name in ["terrain0", "terrain", "terrain999999999", "architecture-1", "instances0", "no-such.obj"] {
        let error = triangles(name).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().starts_with(name), "{error}");
    }
    let error = triangles("terrain20001").unwrap_err().to_string();
    assert_eq!(error, "terrain20001: must be terrainN with N from 1 to 20000");
    let folder = tempfile::tempdir().unwrap();
    let point = folder.path().join("point.obj");
    std::fs::write(&point, "v 1 2 3\nf 1 1 1\n").unwrap();
    let error = triangles(point.to_str().expect("UTF-8")).unwrap_err();
    assert!(error.exit_code() == 3 && error.to_string().contains("nothing to look at"), "{error}");
}

/// A native tracer, and what becomes of each of its answers.
struct Bent<F>(Bvh, F);

impl<F: Fn(&Ray, Option<Hit>, Batch) -> Option<Hit> + Sync> Tracer for Bent<F> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        (self.1)(ray, self.0.closest(ray), Batch::default())
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], batch: Batch) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = (self.1)(ray, self.0.closest(ray), batch);
        }
    }
}

fn contender(
    backend: &'static str,
    mode: &'static str,
    bend: impl Fn(&Ray, Option<Hit>, Batch) -> Option<Hit> + Copy + Send + Sync + 'static,
) -> Contender {
    let build = move |world: &World| {
        let bvh = Bvh::build_with(world, Options { isa: Isa::Portable, ..Options::default() });
        Ok(Built { seconds: 0.5, bytes: 8000, sah_cost: None, tracer: Box::new(Bent(bvh, bend)) })
    };
    Contender { backend, mode, is_exact: backend == "native", build: Box::new(build) }
}

fn setup<'a>(subject: &'a Subject, contenders: &'a [Contender], kinds: &'a [Kind]) -> Setup<'a> {
    Setup { subject, contenders, kinds, side: 32, threads: 1, isa: "any", repeat: 2, cancel: None, on_step: None }
}

/// Two engines of which each says that its builds take so many seconds.
#[test]
fn builds_that_take_no_time_are_repeated() {
    let (subject, _) = Subject::new("terrain2", UpAxis::Y).unwrap();
    for (seconds, expected) in [(0.5, 2), (0.1, 2), (0.05, 3), (0.001, 41)] {
        let builds = Arc::new(AtomicUsize::new(0));
        let engine = |backend, mode| {
            let builds = builds.clone();
            let build = move |world: &World| {
                builds.fetch_add(1, Ordering::Relaxed);
                Ok(Built { seconds, bytes: 0, sah_cost: None, tracer: Box::new(Bvh::build(world)) })
            };
            Contender { backend, mode, is_exact: backend == "native", build: Box::new(build) }
        };
        let contenders = [engine("native", "default"), engine("embree", "robust")];
        setup(&subject, &contenders, &[Kind::Primary]).run().unwrap();
        assert_eq!(builds.load(Ordering::Relaxed), 2 * expected, "of {seconds} seconds each");
    }
}

#[test]
fn a_report_has_a_row_for_everything_and_the_steps_it_promised() {
    let (subject, _) = Subject::new("terrain20", UpAxis::Y).unwrap();
    let engines = [("native", "default"), ("embree", "robust"), ("embree", "fast")];
    let contenders = engines.map(|(backend, mode)| contender(backend, mode, |_, hit, _| hit));
    for threads in [1, 3] {
        let steps = AtomicU64::new(0);
        let count = || _ = steps.fetch_add(1, Ordering::Relaxed);
        let setup = Setup { threads, on_step: Some(&count), ..setup(&subject, &contenders, &Kind::ALL) };
        let report = setup.run().unwrap();
        assert_eq!(steps.load(Ordering::Relaxed), setup.steps());

        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(
            (&json["scene"], &json["triangles"], &json["threads"]),
            (&"terrain20".into(), &800.into(), &threads.into())
        );
        let builds = json["builds"].as_array().unwrap();
        assert_eq!(builds.len(), 3);
        assert_eq!(builds[1]["mtris_per_s"]["median"], 0.0016, "800 in half a second");
        assert_eq!(builds[2]["bytes_per_triangle"], 10.0);
        let traversal = json["traversal"].as_array().unwrap();
        assert_eq!(traversal.len(), 3 * 3 * Kind::ALL.len());
        for row in traversal {
            let mut keys: Vec<_> = row.as_object().unwrap().keys().map(String::as_str).collect();
            keys.sort_unstable();
            assert_eq!(keys, ["backend", "hits", "kind", "mode", "mrays_per_s", "rays", "width"]);
            let rate = |which: &str| row["mrays_per_s"][which].as_f64().unwrap();
            assert!(0.0 < rate("min") && rate("min") <= rate("median") && rate("median") <= rate("max"), "{row}");
            let same = traversal.iter().filter(|other| other["kind"] == row["kind"]);
            assert!(same.clone().count() == 9 && same.clone().all(|other| other["hits"] == row["hits"]));
        }
        let ratios = json["ratios"].as_array().unwrap();
        assert_eq!(
            ratios.iter().map(|ratio| &ratio["kind"]).collect::<Vec<_>>(),
            ["primary", "diffuse", "shadow", "orthographic", "sun", "pixel"]
        );
        assert!(ratios.iter().all(|r| r["over_embree_robust"].is_number() && r["over_embree_fast"].is_number()));
        assert_eq!((&json["isa"], &json["size"], &json["repeat"]), (&"any".into(), &32.into(), &2.into()));
        assert!(json["processor"].is_string() && json.as_object().unwrap().len() == 11, "and nothing else: {json}");
        let answers = json["answers"].as_array().unwrap();
        assert_eq!(answers.len(), Kind::ALL.len());
        for (answers, row) in answers.iter().zip(traversal.iter().step_by(9)) {
            assert_eq!((&answers["kind"], &answers["agree"]), (&row["kind"], &row["rays"]));
        }
    }
}

#[test]
fn wrong_answers_end_a_benchmark() {
    let (subject, _) = Subject::new("terrain20", UpAxis::Y).unwrap();
    let check = |native, embree| {
        let contenders = [native, embree];
        match setup(&subject, &contenders, &[Kind::Primary]).run() {
            Err(Error::Check(message)) => message,
            other => panic!("{:?}", other.map(|report| report.to_string())),
        }
    };
    let honest = || contender("embree", "robust", |_, hit, _| hit);
    // Never a hit on the right.
    let blind = contender("native", "default", |ray, hit, _| hit.filter(|_| ray.direction.x < -0.2));
    assert!(check(blind, honest()).contains("the native engine is wrong on"));
    let fickle = contender("native", "default", |_, hit, batch| hit.filter(|_| batch.width.rays() < 16));
    assert!(check(fickle, honest()).contains("answers differently at width 16"));
    // An engine that is not native may be wrong, for every ray.
    let contenders = [contender("native", "default", |_, hit, _| hit), contender("embree", "robust", |_, _, _| None)];
    let report = setup(&subject, &contenders, &[Kind::Primary]).run().unwrap();
    assert_eq!(report.traversal[3].hits, 0);
    assert!(report.answers[0].embree_wrong > 100);
    // Nor need a textbook's method be right, which says nothing of the others.
    let textbook =
        Contender { is_exact: false, ..contender("native", "grid", |_, hit, _| hit.filter(|hit| hit.u > 0.5)) };
    let exact = contender("native", "default", |_, hit, _| hit);
    let contenders = [textbook, exact, honest()];
    let report = setup(&subject, &contenders, &[Kind::Primary]).run().unwrap();
    let [of_textbook, of_exact] = [0, 3].map(|row: usize| report.traversal[row].hits);
    assert!(of_textbook < of_exact && report.answers[0].agree == report.traversal[0].rays);
}
