//! Meshes in f64 against every triangle in whole numbers: 128 bits hold every volume, so the verdicts are exact.

use twincast::math::DVec3;
use twincast::trace::precise::{PreciseHit, PreciseMesh, PreciseRay, PreciseScene};

use crate::scenes::Random;

type Whole = [i128; 3];

fn sub(a: Whole, b: Whole) -> Whole {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn volume(d: Whole, a: Whole, b: Whole) -> i128 {
    d[0] * (a[1] * b[2] - a[2] * b[1]) + d[1] * (a[2] * b[0] - a[0] * b[2]) + d[2] * (a[0] * b[1] - a[1] * b[0])
}

/// Whether the ray hits, whether it does so in the interior, and t.
fn hit(origin: Whole, d: Whole, corners: [Whole; 3]) -> Option<(bool, f64)> {
    let [a, b, c] = corners.map(|p| sub(p, origin));
    let volumes = [volume(d, b, c), volume(d, c, a), volume(d, a, b)];
    let sum: i128 = volumes.iter().sum();
    if volumes.iter().any(|v| *v > 0) == volumes.iter().any(|v| *v < 0) {
        return None;
    }
    let t = volume(a, b, c) as f64 / sum as f64;
    (t >= 0.0).then_some((!volumes.contains(&0), t))
}

struct Case {
    corners: Vec<[Whole; 3]>,
    rays: Vec<(Whole, Whole)>,
    precise: PreciseScene,
    traced: Vec<PreciseRay>,
}

/// Triangles and rays on a grid, among them some that coincide and rays through corners and along axes, then placed far
/// away and scaled.
fn case(random: &mut Random, away: i64, scale: f64) -> Case {
    case_beside(random, away, scale, &[])
}

/// The same with some triangles more.
fn case_beside(random: &mut Random, away: i64, scale: f64, others: &[[Whole; 3]]) -> Case {
    let mut point =
        |size: i32| -> Whole { [0; 3].map(|_| i128::from((random.unit() * size as f32) as i32 - size / 2)) };
    let mut corners: Vec<[Whole; 3]> = (0..200)
        .map(|_| {
            let first = point(400);
            let mut near = || {
                let step = point(100);
                [0, 1, 2].map(|i| first[i] + step[i])
            };
            [first, near(), near()]
        })
        .collect();
    // Some lie there twice, and some more often than a ray keeps hits.
    corners.extend_from_within(..40);
    for i in 40..50 {
        corners.extend([corners[i]; 30]);
    }
    corners.extend(others);
    let rays = (0..400).map(|i| {
        let origin = point(800);
        let target = if i % 3 == 0 { corners[i / 3][i % 2] } else { point(400) };
        let along = [[1, 0, 0], [0, -1, 0], [0, 0, 1]][i % 3];
        (origin, if i % 7 == 0 { along } else { sub(target, origin) })
    });
    let rays: Vec<(Whole, Whole)> = rays.filter(|(_, d)| *d != [0; 3]).collect();
    let place = |p: Whole| DVec3::from(p.map(|x| (x as i64 + away) as f64 * scale));
    let mesh = PreciseMesh {
        positions: corners.iter().flatten().map(|&p| place(p)).collect(),
        triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
    };
    let traced =
        rays.iter().map(|&(o, d)| PreciseRay::new(place(o), DVec3::from(d.map(|x| x as f64 * scale)))).collect();
    Case { precise: PreciseScene::new(vec![mesh]).expect("a mesh"), corners, rays, traced }
}

#[test]
fn every_hit_is_that_of_exact_arithmetic() {
    let mut random = Random::new(5);
    // Triangles that reach far beyond the others, beside and between them, and leave these in a corner of what is
    // traced.
    let far = |size: i128| {
        let wall = |x: i128| [[x, -size, -size / 7], [x, 3 * size, size / 5], [x + 1, size / 3, 5 * size]];
        let turned = |[x, y, z]: Whole| [z, x, y];
        vec![wall(-320), wall(310).map(turned), wall(1000).map(turned).map(turned), wall(size)]
    };
    for (away, scale, far) in [
        (0, 1.0, vec![]),
        (0, 2f64.powi(-10), vec![]),
        (1 << 40, 1.0, vec![]),
        (-(1 << 30), 2f64.powi(-90), vec![]),
        (0, 2f64.powi(50), vec![]),
        (0, 1.0, far(1 << 18)),
        (0, 1.0, far(1 << 27)),
        (1 << 40, 1.0, far(1 << 22)),
        (12_345, 2f64.powi(-10), far(1 << 34)),
    ] {
        let Case { corners, rays, precise, traced } = case_beside(&mut random, away, scale, &far);
        let mut first = vec![None; rays.len()];
        precise.closest_batch(&traced, &mut first);
        let mut names = vec![None; rays.len()];
        precise.closest_ids_batch(&traced, &mut names);
        assert_eq!(names, first.iter().map(|hit| hit.map(|hit| (hit.geometry, hit.primitive))).collect::<Vec<_>>());
        let mut any = vec![false; rays.len()];
        precise.occluded_batch(&traced, &mut any);
        let (mut ends, mut all) = (Vec::new(), Vec::new());
        precise.all_hits_batch(&traced, &mut ends, &mut all);
        let (mut ends_of_names, mut all_names) = (Vec::new(), Vec::new());
        precise.all_ids_batch(&traced, &mut ends_of_names, &mut all_names);
        assert_eq!(ends_of_names, ends);
        assert_eq!(all_names, all.iter().map(|hit| (hit.geometry, hit.primitive)).collect::<Vec<_>>());
        let mut counts = vec![0; rays.len()];
        precise.count_batch(&traced, &mut counts);
        let (mut hits, mut twins, mut many) = (0, 0, 0);
        for (i, &(origin, d)) in rays.iter().enumerate() {
            let expected: Vec<Option<(bool, f64)>> = corners.iter().map(|&c| hit(origin, d, c)).collect();
            let least = expected.iter().flatten().map(|&(_, t)| t).reduce(f64::min);
            let from = if i == 0 { 0 } else { ends[i - 1] };
            let crossed: &[PreciseHit] = &all[from..ends[i]];
            assert_eq!(counts[i] as usize, crossed.len());
            assert_eq!(any[i], least.is_some(), "ray {i} at {away} times {scale}");
            match (first[i], least) {
                (Some(found), Some(least)) => {
                    let (_, t) = expected[found.primitive as usize].expect("what is named is hit");
                    assert!((t - least).abs() <= 1e-13 * least && (found.t - least).abs() <= 1e-11 * least);
                    let twin = corners.iter().position(|c| *c == corners[found.primitive as usize]);
                    assert_eq!(twin, Some(found.primitive as usize), "of two that coincide the first one is hit");
                    hits += 1;
                    twins += u32::from((0..40).contains(&found.primitive));
                    many += u32::from((40..50).contains(&found.primitive));
                }
                (found, least) => assert!(found.is_none() && least.is_none(), "{found:?}, {least:?}"),
            }
            assert!(crossed.is_sorted_by(|a, b| a.t <= b.t));
            for (primitive, expected) in expected.iter().enumerate() {
                let times = crossed.iter().filter(|hit| hit.primitive as usize == primitive).count();
                match expected {
                    None => assert_eq!(times, 0),
                    Some((true, _)) => assert_eq!(times, 1, "passed in the interior"),
                    Some((false, _)) => assert!(times <= 1),
                }
            }
        }
        assert!(
            hits > 100 && twins > 10 && many > 5,
            "{hits}, {twins} of one that is there twice, {many} of one that is there more often"
        );
    }
}

/// A range that ends just before the first hit has none of it; one that ends there or behind, or begins there, names
/// it.
#[test]
fn names_are_those_of_hits_within_the_range() {
    let mut random = Random::new(7);
    for (away, scale) in [(0, 1.0), (1 << 40, 1.0)] {
        let Case { precise, traced, .. } = case(&mut random, away, scale);
        let mut first = vec![None; traced.len()];
        precise.closest_batch(&traced, &mut first);
        let (mut rays, mut expected) = (Vec::new(), Vec::new());
        for (&ray, PreciseHit { t, geometry, primitive, .. }) in
            traced.iter().zip(first).filter_map(|(r, h)| Some((r, h?)))
        {
            let name = Some((geometry, primitive));
            let ranges =
                [(0.0, t.next_down(), None), (0.0, t, name), (0.0, t.next_up(), name), (t, f64::INFINITY, name)];
            for (tmin, tmax, name) in ranges.into_iter().filter(|(tmin, tmax, _)| tmin <= tmax) {
                rays.push(PreciseRay { tmin, tmax, ..ray });
                expected.push(name);
            }
        }
        let mut names = vec![None; rays.len()];
        precise.closest_ids_batch(&rays, &mut names);
        assert_eq!(names, expected);
        // One by one: a range in f32 is traced as it is, but not among others that are none.
        for (ray, expected) in rays.iter().zip(&expected) {
            let mut name = [None];
            precise.closest_ids_batch(&[*ray], &mut name);
            assert_eq!(name[0], *expected, "{ray:?}");
        }
        assert!(expected.iter().filter(|name| name.is_none()).count() > 50, "{}", expected.len());
    }
}

#[test]
fn indices_that_are_not_there_are_an_error() {
    let mesh = PreciseMesh { positions: vec![DVec3::ZERO; 3], triangles: vec![[0, 1, 2], [0, 1, 3]] };
    let error = PreciseScene::new(vec![mesh]).expect_err("no fourth vertex");
    assert!(error.to_string().contains("triangle 1 of mesh 0"), "{error}");
}

#[test]
fn points_beyond_the_squares_of_f32_have_a_nearest_point() {
    let Case { corners, precise, .. } = case(&mut Random::new(6), 0, 1.0);
    for away in [1e10, 1e18, 1e19, 1e25, 1e38, 1e100] {
        let point = DVec3::new(away, -0.5 * away, 0.25 * away);
        let found = precise.closest_point(point).expect("there are triangles");
        let distance = |corner: &Whole| (DVec3::from(corner.map(|x| x as f64)) - point).length();
        let least = corners.iter().flatten().map(distance).fold(f64::INFINITY, f64::min);
        let error = (found.distance_squared.sqrt() - least).abs();
        // From so far away nothing is nearer than a corner, but for rounding and the size of a triangle against 1e10.
        assert!(error <= 1e-6 * least, "{away}: {found:?}, {least}");
    }
}

/// A tetrahedron, each triangle with corners of its own.
fn tetrahedron() -> PreciseMesh {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let sides = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    PreciseMesh {
        positions: sides.as_flattened().iter().map(|&i: &usize| corners[i]).collect(),
        triangles: (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
    }
}

#[test]
fn meshes_are_closed_where_an_even_number_of_triangles_meet_at_every_edge() {
    let is_closed = |meshes: &[PreciseMesh]| PreciseScene::new(meshes.to_vec()).expect("meshes").is_closed();
    let whole = tetrahedron();
    assert!(is_closed(std::slice::from_ref(&whole)), "corners at one place are one");
    let mut signed = whole.clone();
    signed.positions[..3].iter_mut().for_each(|p| *p = p.map(|x| if x == 0.0 { -0.0 } else { x }));
    assert!(is_closed(&[signed]), "and so are zeros of both signs");

    let mut open = whole.clone();
    let lid = PreciseMesh { positions: whole.positions.clone(), triangles: open.triangles.split_off(3) };
    assert!(!is_closed(&[open.clone()]));
    assert!(is_closed(&[open, lid]), "another mesh may be what closes it");

    let mut doubled = whole.clone();
    doubled.triangles.push([0, 1, 2]);
    assert!(!is_closed(&[doubled.clone()]), "three triangles at an edge");
    doubled.triangles.push([2, 1, 0]);
    assert!(is_closed(&[doubled]), "four of them");

    let mut degenerate = whole.clone();
    degenerate.triangles.push([0, 0, 1]);
    assert!(is_closed(&[degenerate]), "an edge there and back, and a point");

    let mut lost = whole;
    lost.positions.push(DVec3::NAN);
    lost.triangles[0][0] = 12;
    assert!(!is_closed(&[lost]), "a triangle that cannot be hit leaves a hole");
}

/// The squared distance of a triangle: the least of those of its edges, and of its plane where the point is above it.
fn square(point: DVec3, corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - point);
    let edge = |a: DVec3, b: DVec3| {
        let along = b - a;
        (a + along * (-a.dot(along) / along.length_squared()).clamp(0.0, 1.0)).length_squared()
    };
    let normal = (b - a).cross(c - a).normalize();
    let is_above = [(a, b), (b, c), (c, a)].iter().all(|(a, b)| a.cross(*b).dot(normal) >= 0.0);
    let edges = edge(a, b).min(edge(b, c)).min(edge(c, a));
    if is_above { edges.min(a.dot(normal).powi(2)) } else { edges }
}

/// Points of a batch travel together; each has the answer that it gets by itself, and no triangle is nearer.
#[test]
fn points_that_travel_together_have_each_their_nearest() {
    let mut random = Random::new(9);
    let mut anywhere = |size: f64| {
        let [x, y, z] = [0; 3].map(|_| f64::from(random.unit()) - 0.5);
        DVec3::new(x, y, z) * size
    };
    let corners: Vec<[DVec3; 3]> = (0..500)
        .map(|_| {
            let a = anywhere(2.0);
            [a, a + anywhere(0.2), a + anywhere(0.2)]
        })
        .collect();
    let triangles = (0..500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let precise = PreciseScene::new(vec![PreciseMesh { positions: corners.concat(), triangles }]).expect("a mesh");
    let mut points: Vec<DVec3> = (0..333).map(|_| anywhere(4.0)).collect();
    // At corners, which are nearest at a distance of 0; and what cannot travel.
    points.extend(corners.iter().take(20).map(|triangle| triangle[0]));
    points[10] = DVec3::NAN;
    points[11] = DVec3::splat(f64::INFINITY);
    points[50] = DVec3::splat(1e40);
    points[352] = DVec3::NAN;
    for count in [0, 1, 7, 32, 33, 353] {
        let points = &points[..count];
        let mut together = vec![None; count];
        precise.closest_point_batch(points, &mut together);
        let mut distances = vec![0.0; count];
        precise.distance_squared_batch(points, &mut distances);
        for ((&point, together), distance) in points.iter().zip(&together).zip(distances) {
            assert_eq!(*together, precise.closest_point(point), "{point}");
            let expected = together.map_or(f64::NAN, |found| found.distance_squared);
            assert_eq!(distance.to_bits(), expected.to_bits(), "{point}");
            assert_eq!(together.is_some(), point.is_finite(), "{point}");
            if let Some(found) = together {
                let nearest = corners.iter().map(|&corners| square(point, corners)).fold(f64::INFINITY, f64::min);
                let off = (found.distance_squared - nearest).abs();
                assert!(off <= 1e-9 * nearest + 1e-15, "{point}: {} and {nearest}", found.distance_squared);
            }
        }
    }
}

/// However small a triangle is, its inside is nearer than its edges to a point above it.
#[test]
fn small_triangles_have_an_inside() {
    for exponent in [-1, -80, -200, -400] {
        let size = 2f64.powi(exponent);
        let positions = vec![DVec3::ZERO, DVec3::X * size, DVec3::Y * size];
        let precise = PreciseScene::new(vec![PreciseMesh { positions, triangles: vec![[0, 1, 2]] }]).expect("a mesh");
        let found = precise.closest_point(DVec3::new(0.25, 0.25, 1.0) * size).expect("a point");
        assert_eq!((found.u, found.v, found.distance_squared), (0.25, 0.25, size * size), "2^{exponent}");
        assert_eq!(found.point, DVec3::new(0.25, 0.25, 0.0) * size);
    }
}

#[test]
fn nothing_is_within_a_clearance() {
    let mesh = tetrahedron();
    let precise = PreciseScene::new(vec![mesh.clone()]).expect("a mesh");
    let mut random = Random::new(7);
    let sides = mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize]));
    let sides: Vec<[DVec3; 3]> = sides.collect();
    for _ in 0..1000 {
        let [x, y, z] = [0; 3].map(|_| f64::from(random.unit()) * 3.0 - 1.0);
        let point = DVec3::new(x, y, z);
        let nearest = precise.closest_point(point).expect("there are triangles");
        let clearance = precise.clearance(point, nearest.distance_squared);
        assert_eq!(precise.clearance(point, f64::NAN), 0.0);
        // The ball is no larger than to that point, no smaller than rounding asks for, and none of the tetrahedron's
        // own points is in it.
        let distance = (nearest.point - point).length();
        assert!(clearance <= distance && clearance >= distance * (1.0 - 1e-9) - 1e-11, "{clearance}, {distance}");
        for [a, b, c] in &sides {
            let [u, v] = [0; 2].map(|_| f64::from(random.unit()));
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            let on = a + (b - a) * u + (c - a) * v;
            assert!((on - point).length() >= clearance, "{point}: {on}, {clearance}");
        }
    }
}

/// Of triangles that a mesh holds twice, in the same winding, the first counts; flipped ones and those of another mesh
/// count for themselves.
#[test]
fn repeats_are_left_out_of_what_is_distinct() {
    let whole = tetrahedron();
    let precise = PreciseScene::new(vec![whole.clone()]).expect("a tetrahedron");
    assert!(!precise.knows_distinct());
    assert!(std::ptr::eq(precise.distinct(), &precise) && precise.knows_distinct(), "no second tree for nothing");

    let mut twice = whole.clone();
    let turned: Vec<[u32; 3]> = whole.triangles.iter().map(|&[a, b, c]| [c, a, b]).collect();
    twice.triangles.splice(2..2, turned);
    let mut signed = twice.positions.clone();
    signed.iter_mut().for_each(|p| *p = p.map(|x| if x == 0.0 { -0.0 } else { x }));
    twice.positions.extend(signed);
    twice.triangles[3] = twice.triangles[3].map(|i| i + 12);
    let flipped = PreciseMesh {
        positions: whole.positions.clone(),
        triangles: whole.triangles.iter().map(|&[a, b, c]| [b, a, c]).collect(),
    };
    let count = |meshes: &[PreciseMesh]| {
        let precise = PreciseScene::new(meshes.to_vec()).expect("meshes");
        let (mut ends, mut names) = (Vec::new(), Vec::new());
        // In through the side in the plane of y and z, and out through the slanted one.
        let ray = PreciseRay::new(DVec3::new(-1.0, 0.2, 0.3), DVec3::X);
        precise.distinct().all_ids_batch(&[ray], &mut ends, &mut names);
        let mut counts = [0];
        precise.distinct().count_batch(&[ray], &mut counts);
        assert_eq!(counts[0] as usize, names.len());
        names
    };
    assert_eq!(count(std::slice::from_ref(&whole)), [(0, 2), (0, 3)]);
    // The first two, then all four in another turn, then the others.
    assert_eq!(count(std::slice::from_ref(&twice)), [(0, 4), (0, 5)]);
    let doubled = PreciseScene::new(vec![twice.clone()]).expect("a mesh");
    assert!(doubled.is_closed() && doubled.distinct().is_closed(), "four at an edge, or two of them");
    assert_eq!(count(&[twice, flipped]).len(), 4);
    assert_eq!(count(&[whole.clone(), whole]).len(), 4);
}
