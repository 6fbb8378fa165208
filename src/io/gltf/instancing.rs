//! `EXT_mesh_gpu_instancing`: a node's mesh in many places.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::accessor::View;
use super::document::Document;
use super::schema::Node;
use crate::error::Result;
use crate::math::{DAffine3, DQuat, DVec3};

const NAME: &str = "EXT_mesh_gpu_instancing";

#[derive(Deserialize)]
struct Instancing {
    attributes: BTreeMap<String, usize>,
}

/// From the coordinates of each placement to the node's; none where the node has its mesh once.
///
/// # Errors
/// What is wrong with the extension or its accessors.
pub(super) fn placements(document: &Document<'_>, node: &Node, pointer: &str) -> Result<Option<Vec<DAffine3>>> {
    let Some(value) = node.extensions.get(NAME) else { return Ok(None) };
    let pointer = format!("{pointer}/extensions/{NAME}");
    let told = |error| document.error(&pointer, format!("not valid: {error}"));
    let Instancing { attributes } = Instancing::deserialize(value).map_err(told)?;
    let view = |name: &str, kind: &str| {
        let index = attributes.get(name);
        index.map(|&index| View::new(document, index, &[kind])).transpose()
    };
    let (translations, rotations, scales) =
        (view("TRANSLATION", "VEC3")?, view("ROTATION", "VEC4")?, view("SCALE", "VEC3")?);
    let counts = [&translations, &rotations, &scales].map(|view| view.as_ref().map(|view| view.count));
    let mut known = counts.into_iter().flatten();
    let Some(count) = known.next() else {
        return Err(document.error(pointer, "none of TRANSLATION, ROTATION and SCALE; one says how many there are"));
    };
    if let Some(other) = known.find(|&other| other != count) {
        return Err(document.error(pointer, format!("{count} of one attribute, {other} of another")));
    }
    document.spend(&pointer, count as u64 * 3 * size_of::<DAffine3>() as u64)?;
    let vector = |view: &Option<View<'_>>, i: usize, usual: DVec3| {
        view.as_ref().map_or(usual, |view| DVec3::from(view.floats::<3>(i).map(f64::from)))
    };
    let place = |i: usize| {
        let rotation = match &rotations {
            None => DQuat::IDENTITY,
            Some(view) => {
                let q = DQuat::from_array(view.floats::<4>(i).map(f64::from));
                if !(q.length() > 1e-6 && q.is_finite()) {
                    return Err(document.error(&pointer, format!("rotation {i} is no unit quaternion")));
                }
                q.normalize()
            }
        };
        let (scale, translation) = (vector(&scales, i, DVec3::ONE), vector(&translations, i, DVec3::ZERO));
        let place = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        match place.is_finite() {
            true => Ok(place),
            false => Err(document.error(&pointer, format!("instance {i} is somewhere that is not finite"))),
        }
    };
    (0..count).map(place).collect::<Result<_>>().map(Some)
}
