//! Numbers at the ends of what f32 has: too large, too small, and next to zero.

use super::*;

/// Directions so short that 1/d overflows on an axis, in trees whose nodes are mostly empty.
#[test]
fn short_directions() {
    let mut hits = 0;
    for count in [1, 9, 20, 60, 150] {
        let mesh = scenes::soup(count, 0.3, count as u64);
        let mut rays = Vec::new();
        for (i, target) in mesh.positions.iter().enumerate() {
            let along = [Vec3::X, Vec3::NEG_Y, Vec3::new(1e-3, 0.0, -1.0), Vec3::new(0.0, 1.0, 1.0)][i % 4];
            let length = [1e-20, 1e-36, 1e-37, 2e-38][i / 4 % 4];
            rays.push(Ray::new(target.lerp(Vec3::ZERO, 0.01) - along * 3.0, along * length));
        }
        hits += assert_parity(&scenes::of_mesh(mesh), &rays);
    }
    assert!(hits > 300, "{hits} hits");
}

/// A t beyond all numbers is no hit: of rays that start in one point, or run the same way.
#[test]
fn a_t_that_overflows_is_no_hit() {
    let corners = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|[x, y]| Vec3::new(x, y, 0.0) * 1e8);
    let world = World::new(&scenes::of_mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]))).expect("sound");
    let way = Vec3::new(1e-33, 2e-33, -1e-29);
    for (height, expected) in [(1e10, 0), (1e9, 64)] {
        let at = |i: u8| Vec3::new(f32::from(i % 8), f32::from(i / 8), 0.0);
        let from = Vec3::new(1e6, 1e6, height);
        let side_by_side: Vec<Ray> = (0..64).map(|i| Ray::new(from + at(i) * 1e4, way)).collect();
        let fan: Vec<Ray> = (0..64).map(|i| Ray::new(from, way + at(i) * (1e-4 * way.length()))).collect();
        for rays in [side_by_side, fan] {
            assert_eq!(assert_parity_of_batches(&world, &Brute::new(&world), &[rays]), expected, "from {height:e}");
        }
    }
}

/// What lies behind a ray by a t that rounds to -0 is no hit, and ahead of it by one that rounds to 0 is one: alone, of
/// one point, side by side.
#[test]
fn a_t_that_vanishes_keeps_its_side() {
    let corners = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let scene = scenes::of_mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]));
    let world = World::placed(&scene).expect("sound");
    for long in [1e19, 1e20, 1e24, 1e30] {
        for (height, expected) in [(-1e-26, 0), (1e-26, 64), (-1e-30, 0), (1e-30, 64), (0.0, 64)] {
            let at = |i: u8| Vec3::new(f32::from(i % 8), f32::from(i / 8), 0.0) / 16.0;
            let (from, way) = (Vec3::new(0.0, 0.0, height), Vec3::new(0.1, 0.2, -1.0) * long);
            let side_by_side: Vec<Ray> = (0..64).map(|i| Ray::new(from + at(i), way)).collect();
            let fan: Vec<Ray> = (0..64).map(|i| Ray::new(from, way + at(i) * long)).collect();
            for rays in [side_by_side, fan] {
                assert_eq!(assert_parity(&scene, &rays), expected, "alone, from {height:e}, length {long:e}");
                let hits = assert_parity_of_batches(&world, &Brute::new(&world), &[rays]);
                assert_eq!(hits, expected, "from {height:e}, length {long:e}");
            }
        }
    }
}

/// What overflows in f32 on the way is neither lost for it nor believed.
#[test]
fn products_that_overflow() {
    let mesh = |triangles: &[[[f32; 3]; 3]]| {
        let corners = triangles.as_flattened().iter().map(|&p| Vec3::from(p)).collect();
        Mesh::new(corners, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    };
    let ahead = |z: f32, w: f32| [[-w, -w, z], [3.0 * w, -w, z], [-w, 3.0 * w, z]];
    // Edges of 1e12 far up along a ray as steep as a bundle takes it, beside a triangle that makes the ray enter their
    // leaf.
    let beyond = [[-1.7e18, -1.7e18, 1.7e18], [-1.7e18 + 1e12, -1.7e18, 1.7e18], [-1.7e18, -1.7e18 + 1e12, 1.7e18]];
    let steep = [[1.8e18, -1.8e18, 0.0], [1.8e18, 1.8e18, -1.8e18], [-1.8e18, -1.7e18, 1.8e18]];
    // As many as make a bundle, from the one to the other.
    let many = |first: Vec3, second: Vec3| -> Vec<Ray> {
        (0..64_u8).map(|i| Ray::new(Vec3::ZERO, first.lerp(second, f32::from(i) / 63.0))).collect()
    };
    let level = many(Vec3::new(0.3, 0.2, 1.0), Vec3::new(0.31, 0.2, 1.0));
    let oblique = many(Vec3::new(0.9, 0.9, 1.0), Vec3::new(16.0, 16.0, 1.0));
    let short = many(Vec3::new(0.3, 0.2, 1.0) * 1e-30, Vec3::new(0.3, 0.21, 1.0) * 1e-30);
    // To the edge, and to a corner, of triangles whose volumes just stay within f32.
    let edge = many(Vec3::new(0.5, 0.5, 0.5), Vec3::new(0.499_999_7, 0.500_000_3, 0.500_000_1));
    let corner = many(Vec3::new(3.0, -1.0, 1.0), Vec3::new(2.999_999, -0.999_999, 1.0));
    // And how many rays hit something, however far off.
    let cases = [
        (mesh(&[ahead(1e13, 2e13), ahead(2e13, 4e13)]), level.clone(), 64),
        (mesh(&[ahead(2e13, 4e13), ahead(1e13, 2e13)]), level.clone(), 64),
        (mesh(&[ahead(2e11, 2e11)]), edge.clone(), 45),
        (mesh(&[ahead(2e11, 2e11)]), corner.clone(), 11),
        (mesh(&[ahead(5e11, 4e11), ahead(3e11, 3e11)]), edge, 64),
        (mesh(&[ahead(6e11, 6e11)]), corner, 45),
        (mesh(&[ahead(3e8, 3e7)]), many(Vec3::new(0.1, 0.05, 1.0), Vec3::new(0.1, 0.06, 1.0)), 64),
        // Their t is no number that f32 has.
        (mesh(&[ahead(1e10, 2e10)]), short, 0),
        (mesh(&[ahead(0.01, 5e9)]), level, 64),
        (mesh(&[steep]), oblique.clone(), 64),
        (mesh(&[steep, beyond]), oblique, 64),
    ];
    for (mesh, rays, expected) in cases {
        let scene = scenes::of_mesh(mesh);
        for tmax in [f32::INFINITY, 1e9, 1e10, 1e14, 3e13] {
            for tmin in [0.0, 1e-3] {
                let within: Vec<Ray> = rays.iter().map(|ray| Ray { tmin, tmax, ..*ray }).collect();
                let hits = assert_parity(&scene, &within);
                assert!(tmax < f32::INFINITY || hits == expected, "{hits} hits of {:?}", rays[0]);
            }
        }
    }
}

/// Shadow rays that are so much longer than the scene is wide that only products with their lengths overflow.
#[test]
fn shadow_rays_from_far_away() {
    // What all coordinates of rays are multiples of, so that they end in one point indeed.
    const STEP: f32 = 33_554_432.0;
    let (across, high) = (439_999_266_816.0, 549_990_694_912.0);
    let corners = [[across, high, -high], [across, -high, high], [-across, -high, -high]].map(Vec3::from);
    let light = Vec3::new(2459.0, 0.0, 1639.0) * STEP;
    let mut random = Random::new(6);
    // Close to the edges, some outside.
    let rays = (0..64 * 60).map(|_| {
        let side = random.below(3);
        let along = corners[side].lerp(corners[(side + 1) % 3], random.unit());
        let towards = along + (corners[(side + 2) % 3] - along) * (random.unit() - 0.2) * 0.05;
        let direction = ((light - towards) * 600.0 / STEP).round() * STEP;
        Ray { tmax: 1.0, ..Ray::new(light - direction, direction) }
    });
    let mut rays: Vec<Ray> = rays.collect();
    // Next to each other what goes the same way.
    rays.sort_by(|a, b| a.direction.x.total_cmp(&b.direction.x));
    assert!(rays.iter().all(|ray| ray.origin + ray.direction == light));
    let hits = assert_parity(&scenes::of_mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]])), &rays);
    assert!(hits > 2000 && hits < rays.len(), "{hits} of {} hits", rays.len());
}

/// Numbers so small that they are multiples of the least: of boxes that are entered so soon none is left out, and of
/// triangles in one place the first is hit.
#[test]
fn numbers_that_are_not_normal() {
    for scale in [0.01, 1e-5] {
        let square = [Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z, Vec3::Y].map(|corner| corner * scale);
        let triangles = (0..40).flat_map(|_| [[0, 1, 2], [0, 2, 3]]).collect();
        let world = World::new(&scenes::of_mesh(Mesh::new(square.to_vec(), triangles))).expect("sound");
        let (mut random, centre) = (Random::new(8), world.centre.as_vec3());
        let rays = (0..2000).map(|i| {
            let beside = 1.0 + (random.unit() - 0.5) * [1e-7, 1e-6, 1e-3][i % 3];
            let origin = (Vec3::new(2.0, -1.25, 1.1) + random.vec3() * 0.2) * scale;
            let target = square[1].lerp(square[2], random.unit()) * Vec3::new(beside, 1.0, 1.0);
            Ray::new(origin - centre, (target - origin) / scale * [9e37, 6e37, 3e37][i / 3 % 3])
        });
        let rays: Vec<Ray> = rays.collect();
        let hits = assert_parity_of(&world, &Brute::new(&world), &rays);
        assert!(hits > 500 && hits < 1500, "{hits} of {} hits", rays.len());
    }

    // Corners as close as that to where rays start.
    let near = [[0.0, 0.0, 2e-39], [1e-38, 1e-38, 4e-39], [2e-38, 1e-38, 4e-39]].map(Vec3::from);
    let mesh = Mesh::new(near.into_iter().chain(near.map(|corner| -corner)).collect(), vec![[0, 1, 2], [3, 4, 5]]);
    let rays = (0..64_u8).map(|i| {
        let (p, q) = (f32::from(i % 8) / 8.0, f32::from(i / 8) / 8.0);
        Ray::new(Vec3::ZERO, Vec3::new(0.1 + p * 0.8, 0.05 + q * 0.8, 1.0))
    });
    let hits = assert_parity(&scenes::of_mesh(mesh), &rays.collect::<Vec<_>>());
    assert!(hits > 10, "{hits} hits");

    // Rays through the corner of a box, at t = 2^-104 and exactly: what is a share of such lengths vanishes.
    let (mut random, least) = (Random::new(12), f32::from_bits(1));
    let mut hits = 0;
    for _ in 0..12 {
        let mut number = || ((random.unit() - 0.5) * 8e5).round();
        let corner = Vec3::new(number(), number(), number());
        let [b, c] = [0.2, 0.7].map(|share| (corner * Vec3::new(share, 0.5, 1.0 - share)).round());
        let corners = [corner, b, c].map(|corner| corner * least);
        let mirrored = corners.map(|corner| -corner);
        let mesh = Mesh::new([corners, mirrored].concat(), vec![[0, 1, 2], [3, 4, 5]]);
        let rays = (0..100).map(|i| {
            let (origin, corner) = (Vec3::new(number(), number(), number()), if i % 2 == 0 { corner } else { -corner });
            Ray::new(origin * least, (corner - origin) * 2.0_f32.powi(-45))
        });
        hits += assert_parity(&scenes::of_mesh(mesh), &rays.collect::<Vec<_>>());
    }
    assert_eq!(hits, 1200);
}
