//! The bounds of a scene: exact for meshes, however often they are placed, at the cost of a few of the placements.
//!
//! Most of what is placed lies within the bounds of the rest, and says so by its box alone; of a mesh that sticks out,
//! so do most pieces of it.

use rayon::prelude::*;

use super::{Geometry, Mesh, Scene};
use crate::math::{Aabb, DAabb, DAffine3, gamma64, is_traceable};

/// Vertices in a piece of a mesh.
const PIECE: usize = 256;

/// Pieces that are worth a task.
const TASK: usize = 64;

impl Scene {
    /// Bounds of everything that has bounds, in scene coordinates, at all times: of all shapes but planes, and of what
    /// [`Mesh::bounds`] counts.
    ///
    /// # Panics
    /// For an instance of a group that there is not.
    pub fn bounds(&self) -> DAabb {
        let mut uses = vec![0usize; self.geometries.len()];
        let geometries = |group| self.group_geometries(group).map(|(i, geometry)| (i as usize, geometry));
        for instance in &self.instances {
            let times = 1 + usize::from(instance.transform_end.is_some());
            geometries(instance.group).for_each(|(i, _)| uses[i] += times);
        }
        let mut outlines: Vec<Option<Outline<'_>>> = (0..uses.len()).map(|_| None).collect();
        let mut all = DAabb::EMPTY;
        for instance in &self.instances {
            for transform in [Some(&instance.transform), instance.transform_end.as_ref()].into_iter().flatten() {
                for (i, geometry) in geometries(instance.group) {
                    let bounds = match geometry {
                        Geometry::Mesh(mesh) if uses[i] > 1 => {
                            outlines[i].get_or_insert_with(|| Outline::new(mesh)).bounds_beyond(&all, transform)
                        }
                        _ => geometry.bounds(transform),
                    };
                    all = all.union(bounds);
                }
            }
        }
        all
    }
}

/// A mesh and the boxes around its traceable vertices, piece by piece and all together.
struct Outline<'a> {
    mesh: &'a Mesh,
    pieces: Vec<Aabb>,
    whole: Aabb,
}

impl<'a> Outline<'a> {
    fn new(mesh: &'a Mesh) -> Self {
        let around = |piece: &[_]| Aabb::around(piece.iter().copied().filter(|&p| is_traceable(p)));
        let pieces: Vec<Aabb> = mesh.positions.par_chunks(PIECE).with_min_len(TASK).map(around).collect();
        let whole = pieces.iter().copied().fold(Aabb::EMPTY, Aabb::union);
        Self { mesh, pieces, whole }
    }

    /// The bounds of the pieces that may stick out of `all` under `transform`: with `all`, those of the mesh.
    fn bounds_beyond(&self, all: &DAabb, transform: &DAffine3) -> DAabb {
        if self.is_within(all, &self.whole, transform) {
            return DAabb::EMPTY;
        }
        let place = |p| transform.transform_point3(self.mesh.point(p));
        let pieces = self.pieces.par_iter().zip(self.mesh.positions.par_chunks(PIECE)).with_min_len(TASK);
        let beyond = pieces.filter(|(piece, _)| !self.is_within(all, piece, transform));
        let bounds = beyond.map(|(_, piece)| {
            piece.iter().copied().filter(|&p| is_traceable(p)).map(place).fold(DAabb::EMPTY, DAabb::include)
        });
        bounds.reduce(|| DAabb::EMPTY, DAabb::union)
    }

    /// Whether all vertices in a box, as they are computed, are within `all` under `transform`.
    fn is_within(&self, all: &DAabb, piece: &Aabb, transform: &DAffine3) -> bool {
        if piece.is_empty() {
            return true;
        }
        let (min, max) = (self.mesh.point(piece.min), self.mesh.point(piece.max));
        let magnitudes = transform.matrix3.abs();
        let (centre, reach) = (transform.transform_point3(0.5 * (min + max)), magnitudes * (0.5 * (max - min)));
        let rounding = (magnitudes * min.abs().max(max.abs()) + transform.translation.abs()) * gamma64(16);
        all.contains(&DAabb { min: centre - reach - rounding, max: centre + reach + rounding })
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::math::{DMat3, DVec3, Vec3};
    use crate::scene::{Group, Instance, terrain};

    /// The same bits as when every vertex is moved by every transform.
    #[test]
    fn bounds_are_those_of_every_vertex() {
        let mut meshes = [terrain(40), terrain(3), Mesh::new(vec![Vec3::NAN; 9], vec![[0, 1, 2]])];
        meshes[1].origin = DVec3::new(1e4, -7.0, 0.1);
        std::sync::Arc::make_mut(&mut meshes[0].positions)[7] = Vec3::INFINITY;
        let turned = |i: usize, away: f64| {
            let i = i as f64;
            DAffine3 {
                matrix3: DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(i, 0.3 * i, -0.7 * i))) * (1.0 + 0.1 * i),
                translation: DVec3::new((7.1 * i).sin(), (3.3 * i).sin(), (5.7 * i).cos()) * away,
            }
        };
        for away in [0.0, 0.5, 30.0] {
            let instance = |i: usize| Instance {
                name: String::new(),
                group: (i % 2) as u32,
                transform: if i.is_multiple_of(5) {
                    DAffine3::from_translation(turned(i, away).translation)
                } else {
                    turned(i, away)
                },
                transform_end: i.is_multiple_of(3).then(|| turned(i + 9, away)),
            };
            let scene = Scene {
                geometries: meshes.clone().map(Geometry::Mesh).to_vec(),
                groups: [0..2, 1..3].map(|geometries| Group { name: String::new(), geometries }).to_vec(),
                instances: (0..60).map(instance).collect(),
                ..Scene::default()
            };
            let mut all = DAabb::EMPTY;
            for instance in &scene.instances {
                for transform in [Some(instance.transform), instance.transform_end].into_iter().flatten() {
                    for (_, geometry) in scene.group_geometries(instance.group) {
                        let Geometry::Mesh(mesh) = geometry else { continue };
                        let traceable = mesh.positions.iter().filter(|p| is_traceable(**p));
                        let place = |&p: &Vec3| transform.transform_point3(mesh.origin + p.as_dvec3());
                        all = traceable.map(place).fold(all, DAabb::include);
                    }
                }
            }
            assert_eq!(scene.bounds(), all, "{away}");
        }
    }
}
