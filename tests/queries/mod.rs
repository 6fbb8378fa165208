//! All hits, closest points and single rays, against a look at every primitive.

mod all_hits;
mod alone;
mod closest_point;
mod packets;
mod precise;

use twincast::lab::exact::{Ring, Vector, dot, vector};
use twincast::math::{Affine3, Vec3};
use twincast::scene::Mesh;
use twincast::trace::Primitives;
use twincast::trace::bvh::{Bvh, SingleRay, TriangleFound};
use twincast::{Ray, World};

use crate::scenes;

type Id = (u32, u32, u32);

/// A triangle of the world: corners in the part's coordinates, where the part is placed, and names.
struct Triangle {
    corners: [Vec3; 3],
    indices: [u32; 3],
    to_world: Option<Affine3>,
    id: Id,
}

/// The nearest triangle that a ray by itself hits.
fn closest_triangle(bvh: &Bvh, ray: &Ray) -> Option<TriangleFound> {
    let mut found = TriangleFound::NONE;
    bvh.closest_triangle(&SingleRay::from(ray), &mut found).then_some(found)
}

/// Every triangle, placed ones as often as they are placed.
fn triangles(world: &World) -> Vec<Triangle> {
    let mut all = Vec::new();
    let mut add = |p: usize, placed: Option<(u32, Affine3)>| {
        let part = &world.parts[p];
        let Primitives::Triangles { positions, triangles } = &part.primitives else { return };
        for (i, &indices) in triangles.iter().enumerate() {
            all.push(Triangle {
                corners: indices.map(|i| positions[i as usize]),
                indices,
                to_world: placed.map(|(_, to_world)| to_world),
                id: (placed.map_or(part.instance, |(instance, _)| instance), part.geometry, i as u32),
            });
        }
    };
    world.fixed.clone().for_each(|p| add(p, None));
    for placement in &world.placements {
        let parts = world.objects[placement.object as usize].clone();
        parts.for_each(|p| add(p, Some((placement.instance, placement.to_world))));
    }
    all
}

impl Triangle {
    fn in_world<R: Ring>(&self) -> [Vector<R>; 3] {
        self.corners.map(|p| {
            let p = vector::<R>(p);
            let Some(to_world) = &self.to_world else { return p };
            let rows = to_world.matrix3.transpose();
            [0, 1, 2].map(|i| dot(&vector(rows.col(i)), &p).add(&R::new(to_world.translation[i])))
        })
    }
}

/// On a grid of 1/512, so that differences of positions and middles of edges are exact.
fn on_grid(p: Vec3) -> Vec3 {
    (p * 512.0).round() / 512.0
}

fn grid_sphere(n: usize, seed: u64) -> Mesh {
    let mut mesh = scenes::bumpy_sphere(n, 0.4, seed);
    let positions: Vec<Vec3> = mesh.positions.iter().map(|&p| on_grid(p)).collect();
    mesh.positions = positions.into();
    mesh
}

/// A box from -1 to 1, two triangles a side.
fn cube() -> Mesh {
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * 2.0 - 1.0;
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Mesh::new((0..8).map(corner).collect(), halves.collect())
}
