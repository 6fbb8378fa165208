//! The attributes of one primitive's vertices, from wherever they are stored.
//!
//! Primitives often share their vertices and index a part of them each; only the vertices that a primitive uses are
//! read, so that sharing costs nothing.

use rayon::prelude::*;

use super::accessor::View;
use super::document::Document;
use super::draco;
use super::schema::Primitive;
use crate::error::Result;
use crate::scene::compact::pick;

/// The attributes of a primitive.
pub(super) struct Attributes<'v> {
    document: &'v Document<'v>,
    primitive: &'v Primitive,
    /// Those that are compressed together.
    packed: Option<&'v draco::Decoded>,
    /// Vertices that the primitive has.
    pub(super) vertices: usize,
    /// Those that its triangles use, in rising order; none where these are all.
    pub(super) used: Option<Vec<u32>>,
}

impl<'v> Attributes<'v> {
    /// The attributes, and the positions, which every primitive has.
    pub(super) fn new(
        document: &'v Document<'v>,
        primitive: &'v Primitive,
        packed: Option<&'v draco::Decoded>,
        pointer: &str,
    ) -> Result<(Self, View<'v>)> {
        let mut attributes = Self { document, primitive, packed, vertices: 0, used: None };
        let positions = attributes.find("POSITION", &["VEC3"])?;
        let missing = || document.error(format!("{pointer}/attributes"), "POSITION is missing");
        let positions = positions.ok_or_else(missing)?;
        attributes.vertices = positions.count;
        Ok((attributes, positions))
    }

    /// An attribute by its name, if the primitive has it.
    pub(super) fn find(&self, name: &str, kinds: &[&str]) -> Result<Option<View<'v>>> {
        let Some(&index) = self.primitive.attributes.get(name) else { return Ok(None) };
        let view = match self.packed.and_then(|packed| packed.attributes.get(name)) {
            Some(bytes) => View::over(self.document, index, kinds, bytes)?,
            None => View::new(self.document, index, kinds)?,
        };
        self.check(view, index, name).map(Some)
    }

    /// The accessor `index` as an attribute, for what lies outside of the list of attributes.
    pub(super) fn accessor(&self, index: usize, name: &str, kinds: &[&str]) -> Result<View<'v>> {
        self.check(View::new(self.document, index, kinds)?, index, name)
    }

    fn check(&self, view: View<'v>, index: usize, name: &str) -> Result<View<'v>> {
        if view.count < self.vertices {
            let message = format!("{name} has {} elements for {} positions", view.count, self.vertices);
            return Err(self.document.error(format!("/accessors/{index}/count"), message));
        }
        Ok(view)
    }

    /// How many vertices are used.
    pub(super) fn count(&self) -> usize {
        self.used.as_ref().map_or(self.vertices, Vec::len)
    }

    /// What becomes of an attribute at each vertex that is used.
    pub(super) fn read<const N: usize, T: Send>(&self, view: &View<'_>, make: impl Fn([f32; N]) -> T + Sync) -> Vec<T> {
        match &self.used {
            None => view.collect(self.vertices, make),
            Some(used) => pick(used, |i| make(view.floats(i))),
        }
    }

    /// What becomes of each vertex that is used, by its number in the primitive.
    pub(super) fn each<T: Send>(&self, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
        match &self.used {
            None => (0..self.vertices).into_par_iter().with_min_len(1 << 12).map(&make).collect(),
            Some(used) => pick(used, make),
        }
    }
}
