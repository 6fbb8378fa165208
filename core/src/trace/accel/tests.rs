//! Every index on boxes and rays whose coordinates are small whole numbers, so that it is known exactly what is met and
//! when.

use std::collections::BTreeSet;
use std::time::Duration;

use super::binary::Binary;
use super::bsp::Bsp;
use super::grid::Grid;
use super::groups::Groups;
use super::items::{Boxes, Input, reach};
use super::kd::KdTree;
use super::octree::Octree;
use super::ray::IndexRay;
use super::{Accel, Index, Level, Nearest, Options, Resolution};
use crate::math::{Aabb, DVec3, Random, UVec3, Vec3};
use crate::ray::Ray;
use crate::scene::{Geometry, Mesh, Scene};
use crate::trace::World;

/// Calls a check of one index, which is told its name, for each of them.
macro_rules! for_every_index {
    ($check:ident) => {
        $check::<Groups>("groups");
        $check::<Binary>("binary");
        $check::<Grid>("grid");
        $check::<Octree>("octree");
        $check::<KdTree>("kd");
        $check::<Bsp>("bsp");
    };
}

/// A whole number from -n to n.
fn whole(random: &mut Random, n: u64) -> f32 {
    random.below(2 * n + 1) as f32 - n as f32
}

fn whole_vector(random: &mut Random, n: u64) -> Vec3 {
    Vec3::new(whole(random, n), whole(random, n), whole(random, n))
}

/// Boxes of all kinds on a lattice: cubes, plates, bars and points, many of them touching; some of them large.
fn lattice(count: u64, seed: u64) -> Vec<Aabb> {
    let mut random = Random::new(seed, 0);
    let boxes = (0..count).map(|i| {
        let size = if i % 50 == 0 { 16 } else { 2 };
        let a = whole_vector(&mut random, 32);
        Aabb::around([a, a + whole_vector(&mut random, size)])
    });
    boxes.collect()
}

/// A ray through a lattice point of a box, which it reaches at a whole t; all of it is exact in f32.
fn ray_through(random: &mut Random, boxes: &[Aabb]) -> (Vec3, Vec3, f32, Vec3) {
    let Aabb { min, max } = boxes[random.below(boxes.len() as u64) as usize];
    let pick = |random: &mut Random, axis: usize| min[axis] + random.below((max[axis] - min[axis]) as u64 + 1) as f32;
    let point = Vec3::new(pick(random, 0), pick(random, 1), pick(random, 2));
    let mut direction = whole_vector(random, 3);
    if direction == Vec3::ZERO {
        direction[random.below(3) as usize] = -1.0;
    }
    // Zeros of both signs.
    for axis in 0..3 {
        if direction[axis] == 0.0 && random.below(2) == 0 {
            direction[axis] = -0.0;
        }
    }
    let t = [0, 1, 7, 40, 1000, 1 << 20][random.below(6) as usize] as f32;
    (point - direction * t, direction, t, point)
}

fn visited<I: Index>(index: &I, ray: &IndexRay, limit: f64) -> BTreeSet<u32> {
    let mut items = BTreeSet::new();
    index.visit(ray, limit, &mut |item| {
        items.insert(item);
        limit
    });
    items
}

/// Every box that holds a point of the ray is visited, with the point's t as the limit and with t below the end; at any
/// scale, and by a ray that strays. And by far not all boxes are visited.
fn finds_what_it_must<I: Index>(name: &str, most_visits: f64, options: &Options) {
    for (seed, count) in [(1, 1), (2, 7), (3, 300), (4, 4000)] {
        let unit = lattice(count, seed);
        for scale in [1.0f32, 2f32.powi(-70), 2f32.powi(30)] {
            let boxes: Vec<Aabb> = unit.iter().map(|b| Aabb { min: b.min * scale, max: b.max * scale }).collect();
            let list = Boxes::single(boxes);
            let index = I::build(&list.input(), options);
            let reach = reach(&list.bounds());
            let mut random = Random::new(seed, 1);
            let mut visits = 0;
            let rays = 1500;
            for i in 0..rays {
                let (origin, direction, t, point) = ray_through(&mut random, &unit);
                // Half of them stray, by what they say.
                let stray =
                    if i % 2 == 0 { DVec3::ZERO } else { DVec3::splat(f64::from(scale) * 0.01 * (i % 3) as f64) };
                let aside = DVec3::new(1.0, -1.0, 1.0) * stray;
                let origin = (origin * scale).as_dvec3() + aside;
                let ray = IndexRay::new(origin, (direction * scale).as_dvec3(), 0.0, reach, stray);
                let limit = [f64::from(t) * (1.0 + 1e-9), f64::INFINITY][i % 4 / 2];
                let found = visited(&index, &ray, limit);
                for (item, bounds) in unit.iter().zip(0u32..).map(|(bounds, item)| (item, bounds)) {
                    let holds = (point.cmpge(bounds.min) & point.cmple(bounds.max)).all();
                    assert!(!holds || found.contains(&item), "{name}: {item} {bounds:?} at {point} by {ray:?}");
                }
                visits += found.len();
            }
            let share = visits as f64 / (rays as f64 * count as f64);
            assert!(count < 1000 || share < most_visits, "{name} visits {share} of {count} boxes");
        }
    }
    let nothing = I::build(&Boxes::single(Vec::new()).input(), options);
    let ray = IndexRay::new(DVec3::ZERO, DVec3::X, 0.0, DVec3::ZERO, DVec3::ZERO);
    assert!(visited(&nothing, &ray, f64::INFINITY).is_empty(), "{name}");
}

#[test]
fn every_index_finds_what_rays_meet() {
    let options = Options::default();
    finds_what_it_must::<Groups>("groups", 0.04, &options);
    finds_what_it_must::<Binary>("binary", 0.05, &options);
    finds_what_it_must::<Grid>("grid", 0.06, &options);
    finds_what_it_must::<Octree>("octree", 0.08, &options);
    finds_what_it_must::<KdTree>("kd", 0.06, &options);
    finds_what_it_must::<Bsp>("bsp", 0.08, &options);
    let [slices, cubes] = [Resolution::Axes(UVec3::new(1, 40, 3)), Resolution::Longest(65)];
    for counts in [Resolution::Longest(1), slices, cubes] {
        finds_what_it_must::<Grid>("given grid", 1.1, &Options { grid: Some(counts), ..options.clone() });
    }
}

/// After a visit that says to stop nothing else is visited; behind the limit that a visit gives nothing either, but for
/// what is in the same cell.
#[test]
fn visits_stop_when_told_and_behind_the_limit() {
    fn check<I: Index>(name: &str) {
        let row: Vec<Aabb> = (0..1000)
            .map(|i| Aabb::around([Vec3::new(i as f32, 0.0, 0.0), Vec3::new(i as f32 + 0.5, 1.0, 1.0)]))
            .collect();
        let list = Boxes::single(row);
        let index = I::build(&list.input(), &Options::default());
        let ray = IndexRay::new(DVec3::new(-1.0, 0.5, 0.5), DVec3::X, 0.0, reach(&list.bounds()), DVec3::ZERO);
        let (mut stopped, mut limited) = (Vec::new(), Vec::new());
        index.visit(&ray, f64::INFINITY, &mut |item| {
            stopped.push(item);
            f64::NEG_INFINITY
        });
        index.visit(&ray, f64::INFINITY, &mut |item| {
            limited.push(item);
            11.0
        });
        // The cell at hand may be finished, though.
        assert!((1..=24).contains(&stopped.len()), "{name}: {stopped:?}");
        assert!((10..60).contains(&limited.len()) && limited.contains(&9), "{name}: {limited:?}");
    }
    for_every_index!(check);
}

/// Small triangles of all directions on a sphere and some large ones.
fn triangles(count: u64) -> Vec<[Vec3; 3]> {
    let mut random = Random::new(9, 0);
    let triangle = |i: u64| {
        let centre = random.direction() * 8.0;
        let size = if i.is_multiple_of(20) { 4.0 } else { 0.3 };
        [0; 3].map(|_| centre + random.vector() * size)
    };
    (0..count).map(triangle).collect()
}

/// Of all cells that points were found in, exactly one has a point inside, going by the signs of planes alone; and what
/// reaches to a point is in its cell.
#[test]
fn points_are_in_the_one_cell_whose_planes_say_so() {
    let corners = triangles(400);
    let boxes: Vec<Aabb> = corners.iter().map(|&corners| Aabb::around(corners)).collect();
    let list = Boxes::single(boxes.clone());
    let input = Input { triangles: &corners, ..list.input() };
    let kd = KdTree::build(&input, &Options::default());
    let bsp = Bsp::build(&input, &Options::default());
    let mut random = Random::new(10, 0);
    let points: Vec<Vec3> = (0..3000).map(|_| random.vector() * 7.0).collect();
    let middles: Vec<Vec3> = corners.iter().map(|[a, b, c]| (a + b + c) / 3.0).collect();
    for locate in [&(|p| kd.locate(p)) as &dyn Fn(Vec3) -> Option<super::Cell>, &|p| bsp.locate(p)] {
        let cells: Vec<_> = points.iter().map(|&p| locate(p).expect("inside of the bounds")).collect();
        let mut known: Vec<_> = cells.clone();
        known.sort_by_key(|cell| cell.number);
        known.dedup_by_key(|cell| cell.number);
        assert!(known.len() > 100, "{} cells", known.len());
        for (point, cell) in points.iter().zip(&cells) {
            let holding: Vec<u32> =
                known.iter().filter(|cell| cell.contains(point.as_dvec3())).map(|cell| cell.number).collect();
            assert_eq!(holding, [cell.number], "{point}");
        }
        for (&point, i) in middles.iter().zip(0..) {
            let cell = locate(point).expect("inside of the bounds");
            assert!(cell.items.contains(&i), "{point} of {i} in {:?}", cell.items);
        }
        assert!(locate(Vec3::splat(100.0)).is_none());
    }
}

/// A tree without time says so, and still finds everything.
#[test]
fn a_bsp_tree_says_where_it_stopped() {
    let corners = triangles(3000);
    let positions: Vec<Vec3> = corners.iter().flatten().copied().collect();
    let indices = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let scene = Scene::from_geometries(vec![Geometry::Mesh(Mesh::new(positions, indices))], vec![Default::default()]);
    let world = World::new(&scene).expect("sound");
    let whole = Accel::Bsp.build(&world, &Options { bsp_time: Some(Duration::from_secs(600)), ..Options::default() });
    assert!(whole.notes.is_empty(), "{:?}", whole.notes);
    let capped = Accel::Bsp.build(&world, &Options { bsp_time: Some(Duration::ZERO), ..Options::default() });
    assert!(capped.notes[0].contains("time limit") && capped.notes[0].contains("3000 items"), "{:?}", capped.notes);
    let mut random = Random::new(3, 0);
    for _ in 0..200 {
        let ray = crate::Ray::new(random.vector() * 10.0, random.vector());
        assert_eq!(whole.tracer.closest(&ray), capped.tracer.closest(&ray));
    }
}

/// Who asks for any hit gets one, and what is left of the leaf is not tested for a nearer one.
#[test]
fn the_first_hit_is_enough() {
    fn check<I: Index>(name: &str) {
        // Slanted pieces that no plane tells apart, so that most are in one leaf; which is the nearest depends on the
        // ray.
        let mut random = Random::new(5, 0);
        let triangle = |_| {
            let [a, b, c] = [-1.0, 0.0, 1.0].map(|z| z + 0.5 * random.unit());
            [Vec3::new(-9.0, -9.0, a), Vec3::new(9.0, -9.0, b), Vec3::new(0.0, 9.0, c)]
        };
        let positions: Vec<Vec3> = (0..12).flat_map(triangle).collect();
        let mesh = Mesh::new(positions, (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect());
        let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![]);
        let world = World::new(&scene).expect("sound");
        let level = Level::<I>::build(&world.parts, &Options::default());
        for _ in 0..20 {
            let ray = Ray::new(Vec3::new(random.unit(), random.unit(), 9.0), Vec3::NEG_Z);
            let mut found = 0;
            level.trace(&ray, true, &mut Nearest::new(&ray), |_| found += 1);
            assert_eq!(found, 1, "{name}");
        }
    }
    for_every_index!(check);
}
