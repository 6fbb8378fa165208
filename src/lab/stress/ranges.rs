//! Cases of a ray's range, length and start.

use super::triangles::{bumpy_sphere, cube};
use super::{Case, Gate, Probe, loose, towards};
use crate::math::{Random, Vec3};
use crate::ray::Ray;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "t-range",
        about: "hits exactly at tmin and tmax, and one step of f32 beyond",
        source: "pbrt and Embree, which mix < and <=",
        gate: Gate::Hits,
        t_relative: None,
        make: t_range,
    },
    Case {
        name: "lengths",
        about: "directions from 1e-37 to 1e37 long",
        source: "-",
        gate: Gate::Hits,
        t_relative: None,
        make: lengths,
    },
    Case {
        name: "starts",
        about: "rays that start on a surface, at its corners and along its edges",
        source: "Wächter, Binder 2019, A fast and robust method for avoiding self-intersection",
        gate: Gate::Hits,
        t_relative: None,
        make: starts,
    },
];

fn t_range(rays: usize, random: &mut Random) -> Vec<Probe> {
    // Squares at z = -1, -2, ... of which t is exact.
    let square = |z: f32| {
        let p = |x: f32, y: f32| Vec3::new(x, y, z);
        [[p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]]
    };
    let corners: Vec<[Vec3; 3]> = (0..16u8).flat_map(|i| square(8.0 - f32::from(i))).collect();
    let ray = |i: usize| {
        let pace = [1.0, 0.5, 4.0][random.below(3) as usize];
        let ray = Ray::new(Vec3::new(random.unit() - 0.5, random.unit() * 0.1 - 0.7, 9.0), Vec3::NEG_Z * pace);
        let t = (1 + random.below(16)) as f32 / pace;
        let (tmin, tmax) = match i % 6 {
            0 => (t, f32::INFINITY),
            1 => (t.next_up(), f32::INFINITY),
            2 => (0.0, t),
            3 => (0.0, t.next_down()),
            4 => (t, t),
            _ => (t.next_up(), (t + 1.0 / pace).next_down()),
        };
        Ray { tmin, tmax, ..ray }
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}

fn lengths(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mesh = bumpy_sphere(16, 0.2, 6);
    let ray = |_| {
        let from = random.vector() * 4.0;
        let way = random.vector() * 0.9 - from;
        Ray::new(from, way * libm::exp10f(random.unit() * 74.0 - 37.0))
    };
    let rays = (0..rays).map(ray).filter(Ray::is_valid).collect();
    vec![Probe::of_mesh("", mesh, rays)]
}

fn starts(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mesh = cube(Vec3::NEG_ONE, Vec3::ONE);
    let (positions, triangles) = (mesh.positions.to_vec(), mesh.triangles.to_vec());
    let ray = |i: usize| {
        let [a, b, c] = triangles[random.below(12) as usize].map(|k| positions[k as usize]);
        let from = match i % 4 {
            0 => a,
            1 => a.lerp(b, 0.25),
            _ => a.lerp(b, random.unit()).lerp(c, random.unit()),
        };
        match i % 3 {
            0 => Ray::new(from, b - a),
            1 => towards(from, random.vector()),
            _ => Ray { tmin: 1e-6, ..towards(from, random.vector()) },
        }
    };
    let rays = (0..rays).map(ray).filter(Ray::is_valid).collect();
    vec![Probe::of_mesh("", mesh, rays)]
}
