//! Where nodes are: as the file stores them, or at a time of an animation.
//!
//! Everything is f64, as transforms are; matrices of nodes are never decomposed.

mod clip;
mod curve;
mod hierarchy;

use std::collections::HashMap;

pub(super) use hierarchy::Hierarchy;

use clip::Clip;

use super::document::Document;
use super::schema::Node;
use crate::error::{Result, Warning};
use crate::io::Animation;
use crate::math::{DAffine3, DMat4, DQuat, DVec3};

/// A state of all nodes.
pub(super) struct Pose {
    /// From each node's coordinates to the scene's; none for nodes that the scene does not have.
    worlds: Vec<Option<DAffine3>>,
    animated: HashMap<usize, Animated>,
}

/// What an animation says about a node, in place of what the node says.
#[derive(Default)]
struct Animated {
    translation: Option<DVec3>,
    rotation: Option<DQuat>,
    scale: Option<DVec3>,
    weights: Option<Vec<f32>>,
}

/// The states of all nodes when the shutter may open, and when it may close if they are to move.
pub(super) struct Poses {
    pub(super) start: Pose,
    pub(super) end: Option<Pose>,
}

/// What is asked for.
pub(super) fn poses(
    document: &Document<'_>,
    hierarchy: &Hierarchy,
    animation: &Animation,
    warnings: &mut Vec<Warning>,
) -> Result<Poses> {
    let clips = Clip::choose(document, animation)?;
    let at = |time: f64, warnings: &mut Vec<Warning>| {
        let mut animated = HashMap::new();
        clips.iter().try_for_each(|clip| clip.add(time, &mut animated, warnings))?;
        Pose::new(document, hierarchy, animated)
    };
    let time = animation.time.unwrap_or(0.0);
    let start = at(time, warnings)?;
    let moves = !clips.is_empty() && animation.exposure > 0.0;
    // What was warned of once is enough.
    let end = moves.then(|| at(time + animation.exposure, &mut Vec::new()));
    Ok(Poses { start, end: end.transpose()? })
}

impl Pose {
    fn new(document: &Document<'_>, hierarchy: &Hierarchy, animated: HashMap<usize, Animated>) -> Result<Self> {
        let nodes = &document.root.nodes;
        let mut pose = Self { worlds: vec![None; nodes.len()], animated };
        for &node in &hierarchy.order {
            let parent = hierarchy.parents[node].and_then(|parent| pose.worlds[parent]);
            let pointer = format!("/nodes/{node}");
            let world = parent.unwrap_or(DAffine3::IDENTITY) * pose.local(document, node, &pointer)?;
            if !world.is_finite() {
                let message = "the transform is not finite, or its product with the parents' is not";
                return Err(document.error(pointer, message));
            }
            pose.worlds[node] = Some(world);
        }
        Ok(pose)
    }

    /// From the coordinates of a node of the scene to the scene's; none for other nodes.
    pub(super) fn world(&self, node: usize) -> Option<DAffine3> {
        self.worlds.get(node).copied().flatten()
    }

    /// The weights of the morph targets of a node's mesh, where an animation or the node says them.
    pub(super) fn weights<'p>(&'p self, index: usize, node: &'p Node) -> Option<&'p [f32]> {
        let animated = self.animated.get(&index).and_then(|animated| animated.weights.as_deref());
        animated.or(node.weights.as_deref())
    }

    fn local(&self, document: &Document<'_>, index: usize, pointer: &str) -> Result<DAffine3> {
        let node = &document.root.nodes[index];
        let still = Animated::default();
        let animated = self.animated.get(&index).unwrap_or(&still);
        if let Some(matrix) = node.matrix {
            let matrix = DMat4::from_cols_array(&matrix);
            // Products and inverses of matrices are seldom exact.
            if !matrix.row(3).abs_diff_eq(DMat4::IDENTITY.row(3), 1e-6) {
                return Err(document.error(format!("{pointer}/matrix"), "the last row has to be 0 0 0 1"));
            }
            return Ok(DAffine3::from_mat4(matrix));
        }
        let rotation = match (animated.rotation, node.rotation) {
            (Some(rotation), _) => rotation,
            (None, None) => DQuat::IDENTITY,
            (None, Some(q)) => {
                let q = DQuat::from_array(q);
                if !(q.length() > 1e-6 && q.is_finite()) {
                    let message = "the rotation has to be a unit quaternion";
                    return Err(document.error(format!("{pointer}/rotation"), message));
                }
                q.normalize()
            }
        };
        let scale = animated.scale.unwrap_or_else(|| node.scale.map_or(DVec3::ONE, DVec3::from));
        let translation = animated.translation.unwrap_or_else(|| node.translation.map_or(DVec3::ZERO, DVec3::from));
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }
}
