//! Rocks on a plain: one mesh, placed again and again, each time turned and scaled in its own way.

use std::collections::HashMap;
use std::f64::consts::TAU;

use super::{Geometry, Group, Instance, Material, Mesh, Scene};
use crate::math::{DAffine3, DMat3, DQuat, DVec3, Vec3};

/// Times that each triangle of an octahedron is divided into four: 8 * 4^5 triangles.
const DIVISIONS: u32 = 5;

/// The square root of the ground that a rock has to itself, in metres; a rock is about 2 m across.
const SPACING: f64 = 2.2;

/// A scene of `n` placements of one rock of 8,192 triangles, metres, +y up, each of which touches y = 0 from above.
///
/// They stand on a spiral whose turn from rock to rock is the golden angle, so that any number of them fills a disc
/// evenly (Vogel 1979, *A better way to construct the sunflower head*). Attitude and the scale of each axis, 0.6 to
/// 1.4, follow from multiples of irrational numbers: spread as evenly, and the same everywhere.
pub fn rocks(n: u32) -> Scene {
    let rock = rock();
    let instances = (0..n).map(|i| Instance {
        name: format!("rock {i}"),
        group: 0,
        transform: place(&rock, i),
        transform_end: None,
    });
    let instances = instances.collect();
    let group = Group { name: "rock".to_owned(), geometries: 0..1 };
    Scene {
        geometries: vec![Geometry::Mesh(rock)],
        groups: vec![group],
        instances,
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

/// The `i`th rock's place.
fn place(rock: &Mesh, i: u32) -> DAffine3 {
    let i = f64::from(i);
    // Of i times an irrational number the part after the point: even on [0, 1) for any stretch of i.
    let even = |root: f64| (i * root.sqrt()).fract();
    let axis = unit(TAU * even(2.0), 2.0 * even(3.0) - 1.0);
    let scale = DVec3::new(even(5.0), even(6.0), even(7.0)) * 0.8 + 0.6;
    let turn = {
        // Half the angle's sine and cosine from libm: the same everywhere.
        let (sin, cos) = libm::sincos(TAU * even(10.0) / 2.0);
        DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
    };
    let matrix = DMat3::from_quat(turn) * DMat3::from_diagonal(scale);
    let lowest = rock.positions.iter().map(|p| (matrix * p.as_dvec3()).y).fold(f64::INFINITY, f64::min);
    let (sin, cos) = libm::sincos(i * TAU * (2.0 - (1.0 + 5f64.sqrt()) / 2.0));
    let away = SPACING * ((i + 0.5) / std::f64::consts::PI).sqrt();
    DAffine3::from_mat3_translation(matrix, DVec3::new(away * cos, -lowest, away * sin))
}

/// The unit vector at a longitude and a height.
fn unit(longitude: f64, height: f64) -> DVec3 {
    let (sin, cos) = libm::sincos(longitude);
    let around = (1.0 - height * height).sqrt();
    DVec3::new(around * cos, height, around * sin)
}

/// A closed mesh: a sphere of 1 m with dents of three sizes.
fn rock() -> Mesh {
    let (mut positions, mut triangles) = octahedron();
    for _ in 0..DIVISIONS {
        triangles = divided(&mut positions, &triangles);
    }
    for p in &mut positions {
        let dents = [(0.12, 2.3), (0.05, 6.1), (0.02, 15.7)].map(|(depth, frequency)| {
            let wave = |x: f32, phase: f32| libm::sinf(frequency * x + phase);
            depth * (wave(p.x, 0.4) + wave(p.y, 1.9) * wave(p.z, 2.7))
        });
        *p *= 0.8 + dents.iter().sum::<f32>();
    }
    Mesh { name: "rock".to_owned(), ..Mesh::new(positions, triangles) }
}

/// Each triangle as four, all corners on the unit sphere.
fn divided(positions: &mut Vec<Vec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    // One midpoint an edge, so that neighbours share it.
    let mut midpoints = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *midpoints.entry((a.min(b), a.max(b))).or_insert_with(|| {
            positions.push((positions[a as usize] + positions[b as usize]).normalize());
            positions.len() as u32 - 1
        })
    };
    let four = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    triangles.iter().flat_map(four).collect()
}

/// Wound so that normals point outwards.
fn octahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let positions = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let upper = [[0, 2, 4], [4, 2, 1], [1, 2, 5], [5, 2, 0]];
    let lower = upper.map(|[a, _, b]| [b, 3, a]);
    (positions, [upper, lower].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rocks_are_closed_and_stand_on_the_ground() {
        let scene = rocks(300);
        assert_eq!(scene.primitive_count(), 300 * 8192);
        let Geometry::Mesh(rock) = &scene.geometries[0] else { panic!("a mesh") };
        // Each edge once in each direction: closed, and wound alike. Euler: V - E + F = 2.
        let edges: std::collections::HashSet<_> =
            rock.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
        assert_eq!(edges.len(), 3 * 8192);
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
        assert_eq!(rock.positions.len() + 8192, edges.len() / 2 + 2);
        let volume = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| rock.positions[i as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        let volume: f32 = rock.triangles.iter().map(volume).sum();
        assert!((1.0..4.2).contains(&volume), "{volume}, a ball of 1 m has 4.19, outwards");

        for instance in &scene.instances {
            let bounds = scene.geometries[0].bounds(&instance.transform);
            assert!(bounds.min.y.abs() < 1e-5 && bounds.max.y > 0.5, "{}: {bounds:?}", instance.name);
        }
        // Spread over a disc, neither in a heap nor far away: half of them within half of its area.
        let distance = |i: &Instance| i.transform.translation.with_y(0.0).length();
        let edge = SPACING * (300.0 / std::f64::consts::PI).sqrt();
        assert!(scene.instances.iter().all(|i| distance(i) < edge));
        assert_eq!(scene.instances.iter().filter(|i| distance(i) < edge * 0.5f64.sqrt()).count(), 150);
        let determinant = |i: &Instance| i.transform.matrix3.determinant();
        assert!(scene.instances.iter().all(|i| (0.2..2.8).contains(&determinant(i))), "scaled, not mirrored");
    }
}
