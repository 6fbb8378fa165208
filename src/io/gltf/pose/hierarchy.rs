//! Which node hangs on which.
//!
//! Walked with a list of our own: a hierarchy may be deeper than the call stack.

use crate::error::Result;
use crate::io::gltf::document::Document;

/// The nodes of the document's scene (the first, where it names none).
pub(in crate::io::gltf) struct Hierarchy {
    /// Each node of the scene, its parent before it.
    pub(in crate::io::gltf) order: Vec<usize>,
    /// Of each node.
    pub(super) parents: Vec<Option<usize>>,
}

impl Hierarchy {
    /// # Errors
    /// Where nodes do not form trees, or do not exist.
    pub(in crate::io::gltf) fn new(document: &Document<'_>) -> Result<Self> {
        let root = &document.root;
        let first = root.scene.unwrap_or(0);
        if root.scenes.is_empty() {
            return Err(document.error("/scenes", "nothing to render: the file has no scene"));
        }
        document.check_index("/scene", first, root.scenes.len(), "scene")?;
        let mut hierarchy = Self { order: Vec::new(), parents: vec![None; root.nodes.len()] };
        let mut seen = vec![false; root.nodes.len()];
        let mut left = Vec::new();
        for (k, &node) in root.scenes[first].nodes.iter().enumerate().rev() {
            let pointer = format!("/scenes/{first}/nodes/{k}");
            document.check_index(&pointer, node, root.nodes.len(), "node")?;
            left.push((node, None, pointer));
        }
        while let Some((index, parent, named_by)) = left.pop() {
            if std::mem::replace(&mut seen[index], true) {
                let message = format!("node {index} is a child of itself or of two nodes; nodes have to form trees");
                return Err(document.error(named_by, message));
            }
            hierarchy.order.push(index);
            hierarchy.parents[index] = parent;
            for (k, &child) in root.nodes[index].children.iter().enumerate().rev() {
                let pointer = format!("/nodes/{index}/children/{k}");
                document.check_index(&pointer, child, root.nodes.len(), "node")?;
                left.push((child, Some(index), pointer));
            }
        }
        Ok(hierarchy)
    }
}
