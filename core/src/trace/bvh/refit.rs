//! The same tree for vertices that have moved: boxes are computed again from the leaves up.
//!
//! Much faster than to build, but the tree stays the one of the old places: where neighbours have drifted apart, boxes
//! overlap and rays take longer. As a rule, build anew once [`Bvh::sah_cost`] has grown by half. Moving branches about
//! while refitting (Kopta, Ize, Spjut, Brunvand, Davis, Kensler 2012, *Fast, effective BVH updates for animated
//! scenes*), the alternative, would change the tree's layout under a cached file.

use std::fmt;

use super::Bvh;
use super::build::preset::Options;
use super::levels::Level;
use super::levels::moving::MovingTree;
use super::levels::placements::PlacementTree;
use super::levels::shapes::ShapeTree;
use crate::error::{Error, Result};
use crate::trace::unbounded::Unbounded;
use crate::trace::{Part, World};

impl Bvh {
    /// Fits the trees to `world`, which differs from the one they were built for in positions of vertices, in shapes
    /// and in transforms of placements only. Hits are those of a tree built for `world`, and rays are in its
    /// coordinates, of which [`World::centre`] may be another than before: [`World::ray`] heeds that. [`World::new`]
    /// makes part of what is fixed of a group that is placed once and stands still, shapes only where they are not
    /// turned or scaled, and an object of all others: where that may change, both worlds are to be made by
    /// [`World::placed`].
    ///
    /// # Errors
    /// [`Error::Backend`] where `world` has other triangles, parts or objects, or where a triangle has become, or
    /// ceased to be, one that can be hit; then the trees may be partly fitted, and are to be built anew.
    pub fn refit(&mut self, world: &World) -> Result<()> {
        if self.objects.len() != world.objects.len() {
            return Err(changed(format!("{} objects, not {}", world.objects.len(), self.objects.len())));
        }
        let options = Options { preset: self.preset, isa: self.isa(), progress: None };
        self.fixed.refit(&world.parts[world.fixed.clone()], &options)?;
        for (level, parts) in self.objects.iter_mut().zip(&world.objects) {
            level.refit(&world.parts[parts.clone()], &options)?;
        }
        self.placements = PlacementTree::build(&world.placements, &self.objects, &options);
        self.moving = MovingTree::build(&world.placements, &self.objects, &options);
        self.unbounded = Unbounded::new(world);
        Ok(())
    }
}

impl Level {
    fn refit(&mut self, parts: &[Part], options: &Options<'_>) -> Result<()> {
        self.triangles.refit(parts).map_err(changed)?;
        self.shapes = ShapeTree::build(parts, options);
        Ok(())
    }
}

/// The error for a world that is not the one a tree was built for.
fn changed(what: impl fmt::Display) -> Error {
    Error::Backend {
        backend: "native",
        message: format!("cannot refit: the world now has {what}; build the tree anew"),
    }
}
