//! The last check of a scene: what everything after the loaders relies on.
//!
//! Loaders check as they go, and can name the place in the file; this is the net beneath them, so that no index of any
//! format, old or new, reaches a tracer unchecked. Whoever makes a scene by hand has nothing else.

use rayon::prelude::*;

use super::{Geometry, Mesh, Scene};
use crate::error::{Error, Result};
use crate::math::Vec3;

impl Scene {
    /// Whether all indices are in range, attributes match, and materials, shapes and placements can be. What [`io::load`](crate::io::load) gives
    /// has been checked; what is made by hand should be, for the tracers rely on it. Corners of triangles may be NaN or infinite: those are never hit.
    ///
    /// # Errors
    /// [`Error::Backend`] with the first thing that is wrong.
    pub fn check(&self) -> Result<()> {
        fault(self).map_err(|message| Error::Backend { backend: "scene", message })
    }

    /// Whether there is a group of this index, of geometries that are there.
    fn has_group(&self, group: u32) -> bool {
        let range = self.groups.get(group as usize).map(|group| &group.geometries);
        range.is_some_and(|range| self.geometries.get(range.start as usize..range.end as usize).is_some())
    }
}

/// What [`Scene::check`] says, as a message alone.
pub(crate) fn fault(scene: &Scene) -> std::result::Result<(), String> {
    if let Some(instance) = scene.instances.iter().find(|instance| !scene.has_group(instance.group)) {
        return Err(format!("instance {:?} places a group that does not exist", instance.name));
    }
    for geometry in &scene.geometries {
        if geometry.material() as usize >= scene.materials.len() {
            return Err(format!("material {} of {} does not exist", geometry.material(), scene.materials.len()));
        }
        match geometry {
            Geometry::Mesh(mesh) => check_mesh(mesh).map_err(|message| format!("mesh {:?}: {message}", mesh.name))?,
            Geometry::Shapes { shapes, .. } => {
                shapes
                    .iter()
                    .try_for_each(|shape| shape.check().map_err(|wrong| format!("{}: {wrong}", shape.name())))?;
            }
        }
    }
    for material in &scene.materials {
        let finite = |color: Vec3| color.is_finite() && color.min_element() >= 0.0;
        let colors = [
            material.ambient,
            material.diffuse,
            material.specular,
            material.reflection,
            material.transmission,
            material.emission,
            Vec3::new(material.shininess, material.ior, material.gloss.unwrap_or(0.0)),
            Vec3::splat(material.opacity),
            material.absorption.map_or(Vec3::ZERO, |medium| medium.color / medium.distance),
        ];
        if !colors.into_iter().all(finite) || material.ior == 0.0 {
            return Err(format!("material {:?} has values that are negative or not finite", material.name));
        }
        if material.textures().any(|t| t as usize >= scene.textures.len()) {
            return Err(format!("material {:?} has a texture that does not exist", material.name));
        }
    }
    for texture in &scene.textures {
        let pixels = u64::from(texture.width) * u64::from(texture.height);
        if pixels == 0 || pixels != texture.pixels.len() as u64 {
            return Err(format!("texture {:?} has {} of {pixels} pixels", texture.name, texture.pixels.len()));
        }
    }
    match scene
        .instances
        .iter()
        .find(|instance| !instance.transform.is_finite() || instance.transform_end.is_some_and(|end| !end.is_finite()))
    {
        Some(instance) => Err(format!("instance {:?} has a transform that is not finite", instance.name)),
        None => Ok(()),
    }
}

fn check_mesh(mesh: &Mesh) -> std::result::Result<(), String> {
    let count = mesh.positions.len();
    let attributes = [
        ("normals", mesh.normals.len()),
        ("uvs", mesh.uvs.len()),
        ("second uvs", mesh.second_uvs.len()),
        ("colors", mesh.colors.len()),
    ];
    for (name, length) in attributes {
        if length != 0 && length != count {
            return Err(format!("{length} {name} for {count} positions"));
        }
    }
    if u32::try_from(count.max(mesh.triangles.len())).is_err() {
        return Err(format!("{count} vertices, {} triangles; at most 2^32 - 1 of each", mesh.triangles.len()));
    }
    if !mesh.origin.is_finite() {
        return Err("its origin is not finite".into());
    }
    let highest = mesh.triangles.as_flattened().par_chunks(1 << 14).filter_map(|part| part.iter().max()).max();
    match highest.filter(|&&i| i as usize >= count) {
        Some(i) => Err(format!("index {i} is past its {count} vertices")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::scene::{Material, Texture};
    use crate::shape::{Shape, Sphere};

    fn good() -> Scene {
        let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
    }

    #[test]
    fn finds_every_fault() {
        assert_eq!(fault(&good()), Ok(()));
        type Breaks = fn(&mut Scene, &mut Mesh);
        let faults: [(&str, Breaks); 10] = [
            ("sphere: the radius is -1", |scene, _| {
                let shapes = vec![Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: -1.0 })];
                scene.geometries.push(Geometry::Shapes { shapes, material: 0 });
            }),
            ("does not exist", |_, mesh| mesh.material = 1),
            ("past its 3 vertices", |_, mesh| mesh.triangles = vec![[0, 1, 3]].into()),
            ("2 normals for 3", |_, mesh| mesh.normals = vec![Vec3::X; 2]),
            ("1 uvs for 3", |_, mesh| mesh.uvs = vec![Default::default()]),
            ("not finite", |_, mesh| mesh.origin = DVec3::NAN),
            ("does not exist", |scene, _| scene.instances[0].group = 1),
            ("does not exist", |scene, _| scene.groups[0].geometries = 0..2),
            ("negative or not finite", |scene, _| scene.materials[0].diffuse = Vec3::NEG_ONE),
            ("0 of 1 pixels", |scene, _| scene.textures.push(Texture { width: 1, height: 1, ..Texture::default() })),
        ];
        for (expected, fault) in faults {
            let mut scene = good();
            let Geometry::Mesh(mut mesh) = scene.geometries.remove(0) else { unreachable!() };
            fault(&mut scene, &mut mesh);
            scene.geometries.push(Geometry::Mesh(mesh));
            let message = scene.check().unwrap_err().to_string();
            assert!(message.contains(expected), "{message} has no {expected}");
        }
    }
}
