//! Mesh files that a scene includes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::table::{Read, Table};
use crate::error::{Error, Result, Warning};
use crate::io::{LoadOptions, Normals, Unit, UpAxis, format, load};
use crate::math::DAffine3;
use crate::output::suffix;
use crate::scene::{Geometry, Scene};

/// What is included once, however often it is named.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Include {
    path: PathBuf,
    up_axis: UpAxis,
    unit: Unit,
    normals: Normals,
    /// In place of the file's own.
    material: Option<u32>,
}

/// A placement within an included file.
#[derive(Clone)]
pub(super) struct Placed {
    pub(super) name: String,
    /// Index into [`Scene::groups`].
    pub(super) group: u32,
    pub(super) transform: DAffine3,
}

/// The files included so far.
#[derive(Default)]
pub(super) struct Includes(HashMap<Include, Vec<Placed>>);

impl Include {
    /// The keys of `[[file]]` that say what is read. `folder` is the scene file's.
    pub(super) fn read(table: &mut Table<'_>, folder: &Path, material: Option<u32>) -> Read<Self> {
        let value = table.need("path")?;
        let name = value.text()?;
        let path = folder.join(name);
        let suffix = suffix(&path);
        if !format::mesh_suffixes().any(|known| known == suffix) {
            let known: Vec<&str> = format::mesh_suffixes().collect();
            return Err(value.fault(format!("{name:?} is no mesh file; known are {}", known.join(", "))));
        }
        Ok(Self {
            path,
            up_axis: table.optional("up_axis", |value| value.one_of(UpAxis::ALL, UpAxis::name))?.unwrap_or_default(),
            unit: table.optional("unit", |value| value.one_of(Unit::ALL, Unit::name))?.unwrap_or_default(),
            normals: table.optional("normals", |value| value.one_of(Normals::ALL, Normals::name))?.unwrap_or_default(),
            material,
        })
    }
}

impl Includes {
    /// Adds what the file holds to `scene`, unless it is there, and gives its placements.
    ///
    /// # Errors
    /// Those of the file, which name it.
    pub(super) fn add(
        &mut self,
        include: Include,
        scene: &mut Scene,
        warnings: &mut Vec<Warning>,
    ) -> Result<Vec<Placed>> {
        if let Some(placed) = self.0.get(&include) {
            return Ok(placed.clone());
        }
        let Include { up_axis, unit, normals, .. } = include;
        let (mut file, odd) = load(&include.path, &LoadOptions { up_axis, unit, normals, ..LoadOptions::default() })?;
        warnings.extend(odd);
        let too_many = |_| Error::input(&include.path, "", "more than 2^32 geometries, together with the scene's");
        let geometries = u32::try_from(scene.geometries.len() + file.geometries.len()).map_err(too_many)?;
        let first = geometries - file.geometries.len() as u32;
        let (groups, materials) = (scene.groups.len() as u32, scene.materials.len() as u32);
        let textures = scene.textures.len() as u32;
        for geometry in &mut file.geometries {
            let (Geometry::Mesh(crate::scene::Mesh { material, .. }) | Geometry::Shapes { material, .. }) = geometry;
            *material = include.material.unwrap_or(*material + materials);
        }
        file.materials.iter_mut().for_each(|material| material.renumber_textures(|index| index + textures));
        for group in &mut file.groups {
            group.geometries = group.geometries.start + first..group.geometries.end + first;
        }
        scene.files.append(&mut file.files);
        scene.geometries.append(&mut file.geometries);
        scene.groups.append(&mut file.groups);
        if include.material.is_none() {
            scene.materials.append(&mut file.materials);
            scene.textures.append(&mut file.textures);
        }
        let place = |instance: crate::scene::Instance| Placed {
            name: instance.name,
            group: instance.group + groups,
            transform: instance.transform,
        };
        let placed: Vec<_> = file.instances.into_iter().map(place).collect();
        self.0.insert(include, placed.clone());
        Ok(placed)
    }
}
