//! Scenes and rays for tests, from a seed.

use twincast::math::{DAffine3, DQuat, DVec3, Vec3};
use twincast::scene::{Geometry, Group, Instance, Material, Mesh, Scene};
use twincast::{Ray, Shape, Sphere};

/// A generator that is the same everywhere (Marsaglia 2003, *Xorshift RNGs*).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// In [-1, 1) on each axis.
    pub fn vec3(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

/// `triangles` triangles without order, with edges of about `size`, in the cube [-1, 1]^3.
pub fn soup(triangles: usize, size: f32, seed: u64) -> Mesh {
    let mut random = Random::new(seed);
    let mut positions = Vec::new();
    for _ in 0..triangles {
        let centre = random.vec3();
        positions.extend((0..3).map(|_| centre + random.vec3() * size));
    }
    let indices = (0..triangles as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(positions, indices)
}

/// A closed sphere of 2 n (n - 1) triangles with bumps, radius about 1.
pub fn bumpy_sphere(n: usize, bump: f32, seed: u64) -> Mesh {
    let mut random = Random::new(seed);
    let mut positions = vec![Vec3::Y];
    for row in 1..n {
        let latitude = std::f32::consts::PI * row as f32 / n as f32;
        for column in 0..n {
            let turn = std::f32::consts::TAU * column as f32 / n as f32;
            let p = Vec3::new(latitude.sin() * turn.cos(), latitude.cos(), latitude.sin() * turn.sin());
            positions.push(p * (1.0 + bump * (random.unit() - 0.5)));
        }
    }
    positions.push(Vec3::NEG_Y);
    let at = |row: usize, column: usize| (1 + (row - 1) * n + column % n) as u32;
    let last = positions.len() as u32 - 1;
    let mut triangles = Vec::new();
    for column in 0..n {
        triangles.push([0, at(1, column + 1), at(1, column)]);
        triangles.push([last, at(n - 1, column), at(n - 1, column + 1)]);
        for row in 1..n - 1 {
            let (a, b, c, d) = (at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1));
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    Mesh::new(positions, triangles)
}

/// A scene of one mesh.
pub fn of_mesh(mesh: Mesh) -> Scene {
    Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
}

/// Two meshes and a list of spheres, each group placed several times, one of them once.
pub fn instanced(seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let spheres = (0..40).map(|_| Shape::Sphere(Sphere { centre: random.vec3(), radius: 0.02 + 0.1 * random.unit() }));
    let geometries = vec![
        Geometry::Mesh(soup(200, 0.2, seed + 1)),
        Geometry::Mesh(bumpy_sphere(12, 0.3, seed + 2)),
        Geometry::Shapes { shapes: spheres.collect(), material: 0 },
    ];
    let group = |geometries| Group { name: String::new(), geometries };
    let mut instances = Vec::new();
    for (i, group) in [0u32, 1, 1, 2, 2, 2, 1].into_iter().enumerate() {
        let v = |p: Vec3| p.as_dvec3();
        let transform = DAffine3::from_scale_rotation_translation(
            DVec3::splat(1.0) + v(random.vec3()) * 0.5,
            DQuat::from_rotation_y(f64::from(random.unit()) * 6.0),
            v(random.vec3()) * 3.0,
        );
        instances.push(Instance { name: format!("node {i}"), group, transform, transform_end: None });
    }
    Scene {
        geometries,
        groups: vec![group(0..1), group(1..2), group(2..3)],
        instances,
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

/// Rays around a scene of size 1: some aimed at random, some at corners and edges of the mesh, some along axes.
pub fn rays(count: usize, targets: &[Vec3], seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let mut ray = |i: usize| {
        let origin = random.vec3() * if i.is_multiple_of(5) { 0.5 } else { 4.0 };
        let direction = match i % 4 {
            0 => random.vec3(),
            1 => targets[random.below(targets.len())] - origin,
            2 => targets[random.below(targets.len())].lerp(targets[random.below(targets.len())], 0.5) - origin,
            _ => [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z][random.below(6)],
        };
        Ray::new(origin, direction)
    };
    (0..count).map(&mut ray).collect()
}
