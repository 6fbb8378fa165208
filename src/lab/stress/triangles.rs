//! Cases of triangles: edges, corners, grazing rays, triangles that are tiny, thin, or none.

use std::collections::BTreeMap;

use super::{Case, Gate, Probe, loose, nudged, towards};
use crate::math::{Random, Vec3};
use crate::ray::Ray;
use crate::scene::Mesh;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "edge-leak",
        about: "closed bumpy spheres, rays at points of their edges",
        source: "Woop, Benthin, Wald 2013, Watertight ray/triangle intersection",
        gate: Gate::Hits,
        t_relative: None,
        make: edge_leak,
    },
    Case {
        name: "vertex-leak",
        about: "a bumpy sphere of 16 x 16, rays from inside at its corners",
        source: "pbrt's watertight test; Embree #174",
        gate: Gate::Hits,
        t_relative: None,
        make: vertex_leak,
    },
    Case {
        name: "far-from-origin",
        about: "a sphere of radius 2 at 1e4 to 1e7 from zero, rays from inside",
        source: "Embree's verify, watertight_sphere",
        gate: Gate::Hits,
        t_relative: None,
        make: far_from_origin,
    },
    Case {
        name: "grazing",
        about: "a strip of thin triangles, leaning by 0.5 to 1e-6 degrees",
        source: "Embree #387",
        gate: Gate::Hits,
        t_relative: None,
        make: grazing,
    },
    Case {
        name: "in-plane",
        about: "rays within the plane of a triangle, which miss it",
        source: "Embree #298",
        gate: Gate::Hits,
        t_relative: None,
        make: in_plane,
    },
    Case {
        name: "tiny",
        about: "right triangles with edges of 2e-4 to 2e-20, from a distance of 1",
        source: "tinybvh #283",
        gate: Gate::Hits,
        t_relative: None,
        make: tiny,
    },
    Case {
        name: "sliver",
        about: "edges of 1, 1 and 1e-6",
        source: "Embree #387",
        gate: Gate::Hits,
        t_relative: None,
        make: sliver,
    },
    Case {
        name: "degenerate",
        about: "corners that are in a row, or equal: nothing is hit",
        source: "pbrt's shapes tests",
        gate: Gate::Hits,
        t_relative: None,
        make: degenerate,
    },
    Case {
        name: "denormal",
        about: "corners of 1e-40, directions with components of 1e-40",
        source: "Embree's manual, on denormals",
        gate: Gate::Hits,
        t_relative: None,
        make: denormal,
    },
    Case {
        name: "mixed-scale",
        about: "a cube of 0.1 mm on a sphere of 1.27e7 m",
        source: "-",
        gate: Gate::Hits,
        t_relative: None,
        make: mixed_scale,
    },
    Case {
        name: "near-coplanar",
        about: "squares one to 64 steps of f32 behind each other, from a distance of 1000",
        source: "-",
        gate: Gate::Exact,
        t_relative: None,
        make: near_coplanar,
    },
    Case {
        name: "coincident",
        about: "the same triangle six times, its corners in every order: the first one is hit",
        source: "-",
        gate: Gate::Exact,
        t_relative: None,
        make: coincident,
    },
];

/// A closed sphere of `2 n (n - 1)` triangles with bumps, of about radius 1.
pub(super) fn bumpy_sphere(n: u32, bump: f32, seed: u64) -> Mesh {
    let mut random = Random::new(seed, 1);
    let mut positions = vec![Vec3::Y];
    for row in 1..n {
        let (y, r) = angle(f64::from(row) / f64::from(2 * n));
        for column in 0..n {
            let (z, x) = angle(f64::from(column) / f64::from(n));
            // `angle` gives cosine and sine: latitude from the pole, then around.
            let p = Vec3::new((r * z) as f32, y as f32, (r * x) as f32);
            positions.push(p * (1.0 + bump * (random.unit() - 0.5)));
        }
    }
    positions.push(Vec3::NEG_Y);
    let at = |row: u32, column: u32| 1 + (row - 1) * n + column % n;
    let last = positions.len() as u32 - 1;
    let mut triangles = Vec::new();
    for column in 0..n {
        triangles.push([0, at(1, column + 1), at(1, column)]);
        triangles.push([last, at(n - 1, column), at(n - 1, column + 1)]);
        for row in 1..n - 1 {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    Mesh::new(positions, triangles)
}

/// Cosine and sine of a part of a full turn, the same everywhere.
fn angle(part: f64) -> (f64, f64) {
    let (sin, cos) = libm::sincos(part * std::f64::consts::TAU);
    (cos, sin)
}

/// Edges that two triangles share.
fn shared_edges(mesh: &Mesh) -> Vec<[u32; 2]> {
    let mut uses = BTreeMap::new();
    for &[a, b, c] in mesh.triangles.iter() {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            *uses.entry([p.min(q), p.max(q)]).or_insert(0u32) += 1;
        }
    }
    uses.into_iter().filter(|&(_, count)| count == 2).map(|(edge, _)| edge).collect()
}

/// A point of an edge: its middle, a quarter, or anywhere.
fn on_edge(mesh: &Mesh, [a, b]: [u32; 2], random: &mut Random) -> Vec3 {
    let part = [0.5, 0.25, random.unit()][random.below(3) as usize];
    mesh.positions[a as usize].lerp(mesh.positions[b as usize], part)
}

fn edge_leak(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |(n, bump): (u32, f32)| {
        let mesh = bumpy_sphere(n, bump, u64::from(n));
        let edges = shared_edges(&mesh);
        let ray = |i: usize| {
            let target = on_edge(&mesh, edges[random.below(edges.len() as u64) as usize], random);
            let from = random.vector() * if i.is_multiple_of(2) { 0.3 } else { 4.0 };
            towards(from, target)
        };
        let rays = (0..rays / 3).map(ray).collect();
        Probe::of_mesh(format!("{n}"), mesh, rays)
    };
    [(6, 0.5), (16, 0.2), (24, 0.02)].into_iter().map(probe).collect()
}

fn vertex_leak(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mesh = bumpy_sphere(16, 0.2, 5);
    let ray = |_| {
        let target = mesh.positions[random.below(mesh.positions.len() as u64) as usize];
        towards(random.vector() * 0.3, target)
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", mesh.clone(), rays)]
}

fn far_from_origin(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |distance: f32| {
        let mesh = bumpy_sphere(32, 0.0, 1);
        let centre = Vec3::new(148_376.0, 1234.0, -223_423.0) / 268_200.0 * distance;
        let mut positions: Vec<Vec3> = mesh.positions.iter().map(|p| *p * 2.0 + centre).collect();
        let edges = shared_edges(&mesh);
        let moved = Mesh::new(positions.clone(), Vec::new());
        let ray = |i: usize| {
            let target = match i % 2 {
                0 => moved.positions[random.below(moved.positions.len() as u64) as usize],
                _ => on_edge(&moved, edges[random.below(edges.len() as u64) as usize], random),
            };
            towards(centre, target)
        };
        let rays = (0..rays / 4).map(ray).filter(Ray::is_valid).collect();
        // A point on the other side of zero, so that the world is not moved to where the sphere is.
        let mut triangles = mesh.triangles.to_vec();
        triangles.push([positions.len() as u32; 3]);
        positions.push(-centre);
        Probe::of_mesh(format!("{distance:e}"), Mesh::new(positions, triangles), rays)
    };
    [1e4, 1e5, 1e6, 1e7].into_iter().map(probe).collect()
}

fn grazing(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |degrees: f64| {
        let slope = libm::tan(degrees.to_radians()) as f32;
        // Across x and z, rising with x.
        let point = |x: f32, z: f32| Vec3::new(x, x * slope, z);
        let mut corners = Vec::new();
        for i in 0..32u8 {
            let (z, next) = (f32::from(i) / 32.0 - 0.5, f32::from(i + 1) / 32.0 - 0.5);
            corners.push([point(-1.0, z), point(1.0, z), point(1.0, next)]);
            corners.push([point(-1.0, z), point(1.0, next), point(-1.0, next)]);
        }
        let ray = |i: usize| {
            let from = Vec3::new(-8.0, 0.0, random.unit() - 0.5);
            let target = point(random.unit() * 2.4 - 1.2, random.unit() * 1.2 - 0.6);
            match i % 3 {
                0 => Ray::new(from, Vec3::X),
                1 => towards(from, target),
                _ => Ray::new(target - Vec3::X * 4.0, Vec3::X),
            }
        };
        let rays = (0..rays / 4).map(ray).collect();
        Probe::of_mesh(format!("{degrees:e}"), loose(&corners), rays)
    };
    [0.5, 1e-2, 1e-4, 1e-6].into_iter().map(probe).collect()
}

fn in_plane(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mesh = loose(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    let first = Ray::new(Vec3::new(-1.0, 0.5, 0.0), Vec3::X);
    let ray = |_| {
        let flat = |v: Vec3| v.with_z(0.0);
        Ray::new(flat(random.vector() * 2.0), flat(random.vector()))
    };
    let rays = std::iter::once(first).chain((1..rays).map(ray)).filter(Ray::is_valid).collect();
    vec![Probe::of_mesh("", mesh, rays)]
}

fn tiny(rays: usize, random: &mut Random) -> Vec<Probe> {
    let mut probe = |decade: i32| {
        let size = (2.0 * libm::exp10(-f64::from(decade))) as f32;
        let corners = [Vec3::ZERO, Vec3::X * size, Vec3::Y * size];
        let ray = |_| {
            let target = Vec3::new(random.unit() - 0.1, random.unit() - 0.1, 0.0) * size;
            Ray::new(target + Vec3::Z, Vec3::NEG_Z)
        };
        let rays = (0..rays / 9).map(ray).collect();
        Probe::of_mesh(format!("2e-{decade}"), loose(&[corners]), rays)
    };
    (2..=10).map(|half| probe(2 * half)).collect()
}

fn sliver(rays: usize, random: &mut Random) -> Vec<Probe> {
    // A fan, so that what one sliver does not take the next one must.
    let rim: Vec<Vec3> = (0..64u8).map(|i| Vec3::new(1.0, f32::from(i) * 1e-6, f32::from(i % 5) * 2e-7)).collect();
    let corners: Vec<[Vec3; 3]> = rim.windows(2).map(|pair| [Vec3::ZERO, pair[0], pair[1]]).collect();
    let ray = |i: usize| {
        let k = random.below(63) as usize;
        let part = random.unit();
        let target = if i.is_multiple_of(2) { rim[k] * part } else { rim[k].lerp(rim[k + 1], random.unit()) * part };
        towards(Vec3::new(0.3, -0.2, 1.0) + random.vector() * 0.2, target)
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}

fn degenerate(rays: usize, random: &mut Random) -> Vec<Probe> {
    let (p, q) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.7, -0.4, 0.5));
    let corners = [
        [p; 3],
        [p, p, q],
        [p, q, q],
        [Vec3::ZERO, Vec3::X * 0.5, Vec3::X],
        [Vec3::ZERO, Vec3::ONE, Vec3::splat(-0.25)],
        [Vec3::X, Vec3::new(2.0, 1.0, 0.0), Vec3::new(4.0, 3.0, 0.0)],
    ];
    let ray = |_| {
        let [a, b, _] = corners[random.below(6) as usize];
        towards(random.vector() * 3.0, a.lerp(b, [0.0, 0.5, random.unit()][random.below(3) as usize]))
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}

fn denormal(rays: usize, random: &mut Random) -> Vec<Probe> {
    let small = 1e-40f32;
    let corners = [Vec3::ZERO, Vec3::X * small, Vec3::Y * small];
    let at_small = |_| {
        let target = Vec3::new(random.unit(), random.unit(), 0.0) * small;
        Ray::new(target + Vec3::Z, Vec3::NEG_Z)
    };
    let smalls = (0..rays / 2).map(at_small).collect();
    let square = [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::ONE.with_z(0.0), Vec3::Y, Vec3::X]];
    let across = |_| {
        let from = Vec3::new(random.unit(), random.unit(), 1.0);
        let sides = [small, -small, 0.0, -0.0];
        Ray::new(from, Vec3::new(sides[random.below(4) as usize], sides[random.below(4) as usize], -1.0))
    };
    let bent = (0..rays / 2).map(across).collect();
    vec![Probe::of_mesh("corners", loose(&[corners]), smalls), Probe::of_mesh("directions", loose(&square), bent)]
}

/// The twelve triangles of a box.
pub(super) fn cube(low: Vec3, high: Vec3) -> Mesh {
    let corner = |i: u32| Vec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 0 { low[k] } else { high[k] }));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new((0..8).map(corner).collect(), triangles)
}

fn mixed_scale(rays: usize, random: &mut Random) -> Vec<Probe> {
    let ground = bumpy_sphere(48, 0.0, 1);
    let radius = 1.27e7f32;
    let small = cube(Vec3::new(-5e-5, 0.0, -5e-5), Vec3::new(5e-5, 1e-4, 5e-5));
    // The pole of the sphere is at zero, and the cube on it.
    let mut positions: Vec<Vec3> = ground.positions.iter().map(|p| *p * radius - Vec3::Y * radius).collect();
    let first = positions.len() as u32;
    positions.extend(small.positions.iter());
    let mut triangles = ground.triangles.to_vec();
    triangles.extend(small.triangles.iter().map(|corners| corners.map(|i| i + first)));
    let ray = |_| {
        let target = random.vector() * 1.5e-4;
        towards(Vec3::new(2e-4, 5e-4, 7e-4) + random.vector() * 1e-4, target)
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", Mesh::new(positions, triangles), rays)]
}

fn near_coplanar(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |steps: i32| {
        let delta = steps as f32 * f32::EPSILON;
        let square = |z: f32| {
            let p = |x: f32, y: f32| Vec3::new(x, y, z);
            [[p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]]
        };
        // The one behind comes first, so that a tie would name it.
        let corners = [square(1.0), square(1.0 + delta)].concat();
        let ray = |_| towards(random.vector() * 20.0 + Vec3::Z * 1000.0, random.vector().with_z(1.0));
        let rays = (0..rays / 4).map(ray).collect();
        Probe::of_mesh(format!("{steps}"), loose(&corners), rays)
    };
    [1, 4, 16, 64].into_iter().map(probe).collect()
}

fn coincident(rays: usize, random: &mut Random) -> Vec<Probe> {
    let [a, b, c] = [Vec3::new(-0.7, -0.4, 0.1), Vec3::new(0.9, -0.3, -0.2), Vec3::new(0.1, 0.8, 0.3)];
    // Turned and mirrored: t is the same, but not when it is computed in f64.
    let corners = [[b, a, c], [a, b, c], [c, a, b], [a, c, b], [b, c, a], [c, b, a]];
    let ray = |_| {
        let mut target = a.lerp(b, random.unit()).lerp(c, random.unit());
        target.x = nudged(target.x, random);
        towards(random.vector() * 3.0, target)
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_mesh("", loose(&corners), rays)]
}
