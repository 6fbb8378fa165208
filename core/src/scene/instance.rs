//! Sets of geometries, and where they stand.

use std::ops::Range;

use crate::math::DAffine3;

/// Geometries that are placed together.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// Name in the file, for messages; may be empty.
    pub name: String,
    /// Indices into [`Scene::geometries`](crate::Scene::geometries).
    pub geometries: Range<u32>,
}

/// One placement of a group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name in the file, for messages; may be empty.
    pub name: String,
    /// Index into [`Scene::groups`](crate::Scene::groups).
    pub group: u32,
    /// From the group's coordinates to the scene's; of what moves, at time 0.
    pub transform: DAffine3,
    /// Of what moves, the transform at time 1. In between the entries of the matrices are interpolated.
    pub transform_end: Option<DAffine3>,
}

impl Instance {
    /// Whether it moves while a shutter may be open.
    pub const fn moves(&self) -> bool {
        self.transform_end.is_some()
    }
}
