//! Cases of objects under transforms.

use super::triangles::bumpy_sphere;
use super::{Case, Gate, Probe, towards};
use crate::math::{DAffine3, DMat3, DVec3, Random, Vec3};
use crate::scene::{Geometry, Group, Instance, Material, Scene};

pub(super) const CASES: &[Case] = &[Case {
    name: "instances",
    about: "a closed mesh scaled by 1e-16 to 1e9, flattened by 1e5, sheared by 1e4, mirrored; rays at corners and edges",
    source: "pbrt and Embree on nearly singular transforms",
    gate: Gate::Hits,
    t_relative: None,
    make: instances,
}];

fn transforms() -> [(&'static str, DMat3); 5] {
    let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(0.4);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1e4, 1.0, 0.0), DVec3::Z);
    [
        ("1e-16", turn * DMat3::from_diagonal(DVec3::splat(1e-16))),
        ("1e9", turn * DMat3::from_diagonal(DVec3::splat(1e9))),
        ("flat", turn * DMat3::from_diagonal(DVec3::new(1.0, 1e-5, 1.0))),
        ("shear", shear),
        ("mirror", turn * DMat3::from_diagonal(DVec3::new(-1.0, 2.0, 0.5))),
    ]
}

fn instances(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |(label, matrix3): (&str, DMat3)| {
        let mesh = bumpy_sphere(12, 0.2, 4);
        let (positions, triangles) = (mesh.positions.to_vec(), mesh.triangles.to_vec());
        // Twice, on both sides of zero, so that it is placed and not baked.
        let reach = matrix3.to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let placed = [-1.5, 1.5].map(|side| DAffine3 { matrix3, translation: DVec3::X * side * reach });
        let instance = |transform| Instance { name: String::new(), group: 0, transform, transform_end: None };
        let scene = Scene {
            geometries: vec![Geometry::Mesh(mesh)],
            groups: vec![Group { name: String::new(), geometries: 0..1 }],
            instances: placed.map(instance).to_vec(),
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let ray = |i: usize| {
            let place = |p: Vec3| placed[i % 2].transform_point3(p.as_dvec3()).as_vec3();
            let [a, b, c] = triangles[random.below(triangles.len() as u64) as usize].map(|k| positions[k as usize]);
            let target = match i / 2 % 3 {
                0 => a,
                1 => a.lerp(b, 0.5),
                _ => (a + b + c) / 3.0,
            };
            towards(place(random.vector() * if (i / 6).is_multiple_of(2) { 0.3 } else { 3.0 }), place(target))
        };
        let rays = (0..rays / 5).map(ray).filter(crate::ray::Ray::is_valid).collect();
        Probe::new(label, &scene, rays)
    };
    transforms().into_iter().map(probe).collect()
}
