//! Skins: vertices that follow several nodes at once (Lander 1998, *Skin them bones*: linear blending).
//!
//! A skinned mesh lies where its joints are, whatever its own node's transform is.

use super::accessor::View;
use super::attributes::Attributes;
use super::document::Document;
use super::pose::Pose;
use crate::error::Result;
use crate::math::{DAffine3, DMat3, DVec3};

/// For each joint, from the coordinates of the mesh to those of the scene.
pub(super) fn matrices(document: &Document<'_>, index: usize, pose: &Pose, pointer: &str) -> Result<Vec<DAffine3>> {
    let skins = &document.root.skins;
    document.check_index(pointer, index, skins.len(), "skin")?;
    let skin = &skins[index];
    let inverses = match skin.inverse_bind_matrices {
        None => None,
        Some(accessor) => {
            let view = View::new(document, accessor, &["MAT4"])?;
            if view.count < skin.joints.len() {
                let message = format!("{} matrices for {} joints", view.count, skin.joints.len());
                return Err(document.error(format!("/skins/{index}/inverseBindMatrices"), message));
            }
            Some(view)
        }
    };
    let joint = |(k, &node): (usize, &usize)| {
        let pointer = format!("/skins/{index}/joints/{k}");
        document.check_index(&pointer, node, document.root.nodes.len(), "node")?;
        let world = pose.world(node);
        let world = world.ok_or_else(|| document.error(&pointer, format!("node {node} is not in the scene")))?;
        let inverse = inverses.as_ref().map_or(DAffine3::IDENTITY, |view| matrix(view.floats(k)));
        let matrix = world * inverse;
        match matrix.is_finite() {
            true => Ok(matrix),
            false => Err(document.error(pointer, "the joint's matrix is not finite")),
        }
    };
    skin.joints.iter().enumerate().map(joint).collect()
}

/// The first three rows of a matrix that is stored by columns.
fn matrix(m: [f32; 16]) -> DAffine3 {
    let column = |k: usize| DVec3::new(m[4 * k].into(), m[4 * k + 1].into(), m[4 * k + 2].into());
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// Which joints each vertex of a primitive follows.
pub(super) struct Skin<'v> {
    matrices: &'v [DAffine3],
    /// Joints and weights, four of each a set.
    sets: Vec<[View<'v>; 2]>,
}

impl<'v> Skin<'v> {
    /// # Errors
    /// Where the primitive has no joints, or follows joints that the skin does not have.
    pub(super) fn new(
        document: &Document<'_>,
        attributes: &Attributes<'v>,
        matrices: &'v [DAffine3],
        pointer: &str,
    ) -> Result<Self> {
        let mut sets = Vec::new();
        let views = |k: usize| -> Result<Option<[View<'v>; 2]>> {
            let joints = attributes.find(&format!("JOINTS_{k}"), &["VEC4"])?;
            Ok(joints.zip(attributes.find(&format!("WEIGHTS_{k}"), &["VEC4"])?).map(|(j, w)| [j, w]))
        };
        while let Some(set) = views(sets.len())? {
            sets.push(set);
        }
        if sets.is_empty() {
            let message = "the node has a skin, and the primitive no JOINTS_0 and WEIGHTS_0";
            return Err(document.error(format!("{pointer}/attributes"), message));
        }
        let skin = Self { matrices, sets };
        let highest = |vertex: usize| skin.heeded(vertex).map(|(joint, _)| joint).fold(0.0, f32::max);
        let highest = attributes.each(highest).into_iter().fold(0.0, f32::max);
        // Negative numbers and NaN become 0 below.
        if highest >= matrices.len() as f32 {
            let message = format!("joint {highest} of a skin that has {}", matrices.len());
            return Err(document.error(format!("{pointer}/attributes/JOINTS_0"), message));
        }
        Ok(skin)
    }

    /// What a vertex of the primitive is moved by: the mean of its joints, by their weights. Those that weigh nothing
    /// follow the first.
    pub(super) fn at(&self, vertex: usize) -> DAffine3 {
        let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        let mut total = 0.0;
        for (joint, weight) in self.heeded(vertex) {
            let (matrix, weight) = (&self.matrices[joint as usize], f64::from(weight));
            sum.matrix3 += matrix.matrix3 * weight;
            sum.translation += matrix.translation * weight;
            total += weight;
        }
        if total > 0.0 && total.is_finite() {
            return DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total };
        }
        // Whose number may be any where it weighs nothing.
        let first = self.sets[0][0].floats::<4>(vertex)[0];
        *self.matrices.get(first as usize).unwrap_or(&self.matrices[0])
    }

    /// The joints of a vertex that weigh anything, each with its weight: some exporters leave any number where the
    /// weight is 0.
    fn heeded(&self, vertex: usize) -> impl Iterator<Item = (f32, f32)> {
        let joints = self.sets.iter().flat_map(move |[joints, _]| joints.floats::<4>(vertex));
        let weights = self.sets.iter().flat_map(move |[_, weights]| weights.floats::<4>(vertex));
        joints.zip(weights).filter(|(_, weight)| *weight > 0.0)
    }
}
