//! Vertices that do not lie where they are stored: morph targets first, then the skin.

use std::sync::Arc;

use super::accessor::View;
use super::attributes::Attributes;
use super::document::Document;
use super::morph::Displacements;
use super::schema::Primitive;
use super::skin::Skin;
use crate::error::Result;
use crate::math::{DAffine3, DVec3, cofactor};
use crate::scene::Mesh;

/// What a mesh is deformed by.
#[derive(Clone, Copy)]
pub(super) struct Deformation<'d> {
    /// Of morph targets.
    pub(super) weights: &'d [f32],
    /// Matrices of the joints.
    pub(super) skin: Option<&'d [DAffine3]>,
    /// Whether triangles turn about: those of a skinned mesh whose node is mirrored.
    pub(super) is_mirrored: bool,
}

/// What moves the vertices of one primitive.
pub(super) struct Deformer<'v> {
    positions: Option<Displacements<'v>>,
    normals: Option<Displacements<'v>>,
    skin: Option<Skin<'v>>,
}

impl<'v> Deformer<'v> {
    pub(super) fn new(
        document: &Document<'_>,
        attributes: &Attributes<'v>,
        primitive: &Primitive,
        deformation: Deformation<'v>,
        pointer: &str,
    ) -> Result<Self> {
        let of = |name| Displacements::of(attributes, primitive, deformation.weights, name, &["VEC3"]);
        let skin = deformation.skin.map(|matrices| Skin::new(document, attributes, matrices, pointer));
        Ok(Self { positions: of("POSITION")?, normals: of("NORMAL")?, skin: skin.transpose()? })
    }

    /// Sets the positions and the normals of `mesh`.
    pub(super) fn apply(
        &self,
        attributes: &Attributes<'_>,
        positions: &View<'_>,
        normals: Option<&View<'_>>,
        mesh: &mut Mesh,
    ) {
        let displaced = |view: &View<'_>, by: &Option<Displacements<'_>>, vertex: usize| {
            let value = view.floats::<3>(vertex).map(f64::from);
            DVec3::from(by.as_ref().map_or(value, |by| by.apply(vertex, value)))
        };
        let places = attributes.each(|vertex| {
            let place = displaced(positions, &self.positions, vertex);
            self.skin.as_ref().map_or(place, |skin| skin.at(vertex).transform_point3(place))
        });
        // Of a skinned mesh these are places in the scene, which may be far from its origin.
        if self.skin.is_some() {
            mesh.set_positions(&places);
        } else {
            mesh.positions = Arc::new(places.iter().map(|place| place.as_vec3()).collect());
        }
        mesh.normals = normals.map_or(Vec::new(), |view| {
            attributes.each(|vertex| {
                let normal = displaced(view, &self.normals, vertex);
                let turned = self.skin.as_ref().map_or(normal, |skin| cofactor(&skin.at(vertex).matrix3) * normal);
                turned.normalize_or_zero().as_vec3()
            })
        });
    }
}
