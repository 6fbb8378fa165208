//! Cases that are hard for what searches: boxes without thickness, planes that triangles lie in, trees as deep as they
//! get.

use super::triangles::bumpy_sphere;
use super::{Case, Gate, Probe, loose, nudged, towards};
use crate::math::{Random, Vec3};
use crate::ray::Ray;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "flat-boxes",
        about: "squares along the axes, rays at their rims and corners, with directions of two zeros",
        source: "Ize 2013, Robust BVH ray traversal; Williams and others 2005",
        gate: Gate::Hits,
        t_relative: None,
        make: flat_boxes,
    },
    Case {
        name: "soups",
        about: "random triangles of three sizes, rays from around and along the axes",
        source: "Ize 2013, Robust BVH ray traversal",
        gate: Gate::Hits,
        t_relative: None,
        make: soups,
    },
    Case {
        name: "depth",
        about: "triangles at x = 2^-i, and 1500 that are equal",
        source: "tinybvh #192",
        gate: Gate::Hits,
        t_relative: None,
        make: depth,
    },
    Case {
        name: "grid-corners",
        about: "a lattice of small squares, rays along diagonals through every corner of cells",
        source: "Amanatides, Woo 1987, A fast voxel traversal algorithm for ray tracing",
        gate: Gate::Hits,
        t_relative: None,
        make: grid_corners,
    },
    Case {
        name: "split-planes",
        about: "triangles in the planes that a tree splits at, rays within these planes and just beside",
        source: "-",
        gate: Gate::Hits,
        t_relative: None,
        make: split_planes,
    },
    Case {
        name: "not-finite",
        about: "a mesh with NaN, infinite and huge corners: everything else is hit as if these were not there",
        source: "Embree's verify, NaN and inf tests",
        gate: Gate::Hits,
        t_relative: None,
        make: not_finite,
    },
];

/// Squares at whole numbers across each axis.
fn squares(count: u32) -> Vec<[Vec3; 3]> {
    let mut corners = Vec::new();
    for i in 0..count {
        let axis = i as usize % 3;
        let at = (i / 3) as f32;
        let point = |a: f32, b: f32| {
            let mut p = Vec3::splat(at);
            p[(axis + 1) % 3] += a;
            p[(axis + 2) % 3] += b;
            p - Vec3::splat(count as f32 / 6.0)
        };
        corners.push([point(0.0, 0.0), point(1.0, 0.0), point(1.0, 1.0)]);
        corners.push([point(0.0, 0.0), point(1.0, 1.0), point(0.0, 1.0)]);
    }
    corners
}

/// Along an axis, with zeros of both signs, so as to pass through `target`.
fn along_axis(target: Vec3, random: &mut Random) -> Ray {
    let axis = random.below(3) as usize;
    let mut direction = Vec3::from_array([(); 3].map(|()| [0.0, -0.0][random.below(2) as usize]));
    direction[axis] = [1.0, -1.0][random.below(2) as usize];
    let mut from = target;
    from[axis] -= direction[axis] * 32.0;
    Ray::new(from, direction)
}

fn flat_boxes(rays: usize, random: &mut Random) -> Vec<Probe> {
    let corners = squares(24);
    let ray = |i: usize| {
        let [a, b, c] = corners[random.below(corners.len() as u64) as usize];
        let target = match i % 3 {
            0 => a,
            1 => a.lerp(b, random.unit()),
            _ => b.lerp(c, 0.5),
        };
        if i.is_multiple_of(2) { along_axis(target, random) } else { towards(random.vector() * 12.0, target) }
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}

fn soups(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |size: f32| {
        let mut make = Random::new(3, u64::from(size.to_bits()));
        let triangle = |_| {
            let centre = make.vector();
            [(); 3].map(|()| centre + make.vector() * size)
        };
        let corners: Vec<[Vec3; 3]> = (0..1000).map(triangle).collect();
        let ray = |i: usize| {
            let [a, b, c] = corners[random.below(1000) as usize];
            match i % 4 {
                0 => Ray::new(random.vector() * 3.0, random.direction()),
                1 => along_axis(a, random),
                2 => towards(random.vector() * 3.0, b.lerp(c, 0.5)),
                _ => towards(random.vector(), a),
            }
        };
        let rays = (0..rays / 3).map(ray).collect();
        Probe::of_mesh(format!("{size}"), loose(&corners), rays)
    };
    [0.02, 0.2, 2.0].into_iter().map(probe).collect()
}

fn depth(rays: usize, random: &mut Random) -> Vec<Probe> {
    let at = |x: f32, size: f32| [Vec3::new(x, -size, -size), Vec3::new(x, size, -size), Vec3::new(x, 0.0, size)];
    // To well beyond where f64 tells 1 + x from 1.
    let halves: Vec<[Vec3; 3]> = (0..100).map(|i| libm::scalbnf(1.0, -i)).map(|x| at(x, x)).collect();
    let ray = |i: usize| {
        let x = libm::scalbnf(1.0, -(random.below(100) as i32));
        let target = Vec3::new(x, 0.0, 0.0);
        match i % 2 {
            0 => Ray::new(Vec3::NEG_X, Vec3::X),
            _ => towards(Vec3::new(-x, x * random.unit(), x * 0.25), target),
        }
    };
    let to_halves = (0..rays / 2).map(ray).collect();
    let equal = vec![at(0.5, 1.0); 1500];
    // Every one of them is a tie, which integers must confirm.
    let to_equal = (0..(rays / 100).clamp(2, 40)).map(|_| towards(Vec3::NEG_X * 2.0, random.vector() * 0.4 + Vec3::X));
    let to_equal = to_equal.collect();
    vec![Probe::of_mesh("halves", loose(&halves), to_halves), Probe::of_mesh("equal", loose(&equal), to_equal)]
}

fn grid_corners(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mut corners = Vec::new();
    for x in 0..8u8 {
        for y in 0..8u8 {
            let p = Vec3::new(f32::from(x), f32::from(y), 0.0) - Vec3::new(4.0, 4.0, 0.0);
            // Across the diagonal.
            corners.push([p + Vec3::X * 0.5 - Vec3::Z, p + Vec3::Y * 0.5 - Vec3::Z, p + Vec3::Z]);
        }
    }
    let ray = |i: usize| {
        let mut from = Vec3::new(-16.0, -16.0, 0.0);
        from[random.below(2) as usize] += random.below(17) as f32 / 2.0 - 4.0;
        from.z = [0.0, nudged(0.0, random), random.unit() - 0.5][i % 3];
        Ray::new(from, [Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.7, 0.7, -0.0)][i / 3 % 2])
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}

fn split_planes(rays: usize, random: &mut Random) -> Vec<Probe> {
    let corners = squares(18);
    let ray = |i: usize| {
        let [a, _, c] = corners[random.below(corners.len() as u64) as usize];
        let axis = random.below(3) as usize;
        // In a plane of squares, or by one step of f32 beside it.
        let mut from = a.lerp(c, 0.5) + random.vector() * 6.0;
        from[axis] = nudged(a[axis], random);
        let mut direction = random.vector();
        direction[axis] = [0.0, -0.0, direction[axis] * 1e-7][i % 3];
        Ray::new(from, direction)
    };
    let rays = (0..rays).map(ray).filter(Ray::is_valid).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}

fn not_finite(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mut mesh = bumpy_sphere(16, 0.2, 8);
    let (targets, first) = (mesh.positions.to_vec(), mesh.positions.len() as u32);
    let odd = [Vec3::NAN, Vec3::new(0.1, f32::INFINITY, 0.2), Vec3::splat(f32::NEG_INFINITY), Vec3::splat(3e38)];
    let positions = targets.iter().copied().chain(odd).collect();
    let mut triangles = mesh.triangles.to_vec();
    triangles.extend((0..4).flat_map(|i| [[first + i, 0, 1], [5, first + i, 40], [first + i; 3]]));
    mesh = crate::scene::Mesh::new(positions, triangles);
    let ray = |i: usize| {
        let target = targets[random.below(targets.len() as u64) as usize];
        towards(random.vector() * if i.is_multiple_of(2) { 0.3 } else { 4.0 }, target * 0.99)
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", mesh, rays)]
}
