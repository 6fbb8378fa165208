//! Trees over the triangles that stand still.
//!
//! A scene has one. A scene that is dynamic has two once something in it has changed: over what lasts, and over what changed lately, so that a commit builds
//! what changed, and not the whole again.

use std::sync::Arc;

use twincast_core::World;
use twincast_core::math::Aabb;
use twincast_core::trace::bvh::{Bvh, Options, Preset};
use twincast_core::trace::{Part, Primitives};

use super::committed::{Body, Record};
use crate::abi::quality;

/// A tree, and of what.
#[derive(Debug)]
pub struct Solid {
    pub bvh: Bvh,
    /// Geometry ids, rising.
    of: Vec<u32>,
    triangles: usize,
    pub bounds: Aabb,
}

/// How a commit comes to a tree.
#[derive(Debug)]
pub enum Making {
    Nothing,
    /// It is as it was.
    Kept(Solid),
    /// Vertices have moved, and the geometries ask for no more than that boxes follow. What it is built with where that is not enough.
    Refitted(Solid, Preset),
    Built(Vec<u32>, Preset),
}

/// Geometries of a scene, by id, as they are now.
type Records = [Option<Box<Record>>];

/// What trees are to be made over.
pub struct Planner<'a> {
    pub records: &'a Records,
    pub preset: Preset,
    /// Whether geometries may ask for a quality of their own.
    pub is_dynamic: bool,
}

impl Planner<'_> {
    /// How the trees are made: over all, or what lasts, and over what changed lately. `old` are those of the last commit; none where they are not to be looked at.
    pub fn plan(&self, old: Option<[Option<Solid>; 2]>) -> [Making; 2] {
        let Self { records, .. } = *self;
        let all: Vec<u32> = (0..records.len() as u32).filter(|&id| still_triangles(records, id) > 0).collect();
        let Some([Some(lasting), changing]) = old else { return [self.built(all), Making::Nothing] };
        let (others, calm) = (|id: &&u32| lasting.of.binary_search(id).is_err(), |id: &&u32| !self.has_changed(**id));
        if lasting.of.iter().all(|id| calm(&id)) {
            let others: Vec<u32> = all.iter().filter(others).copied().collect();
            let calm: usize = others.iter().filter(calm).map(|&id| still_triangles(records, id)).sum();
            // What came to rest is taken over when there is much of it: to build it again and again would take longer.
            if 2 * calm <= lasting.triangles {
                return [Making::Kept(lasting), self.made(others, changing)];
            }
        }
        let (calm, changed): (Vec<u32>, Vec<u32>) = all.iter().partition(calm);
        if calm.is_empty() {
            return [self.made(all, Some(lasting)), Making::Nothing];
        }
        [self.built(calm), self.made(changed, changing)]
    }

    fn has_changed(&self, id: u32) -> bool {
        record(self.records, id).is_none_or(|record| record.is_new)
    }

    fn built(&self, of: Vec<u32>) -> Making {
        if of.is_empty() {
            return Making::Nothing;
        }
        let preset = self.preset_of(&of);
        Making::Built(of, preset)
    }

    /// Over these geometries, where there was a tree.
    fn made(&self, of: Vec<u32>, old: Option<Solid>) -> Making {
        let Some(old) = old.filter(|old| old.of == of) else { return self.built(of) };
        let mut changed = of.iter().filter(|&&id| self.has_changed(id)).peekable();
        if changed.peek().is_none() {
            return Making::Kept(old);
        }
        if changed.all(|&id| self.asks_for(id, quality::REFIT)) {
            return Making::Refitted(old, self.preset_of(&of));
        }
        self.built(of)
    }

    fn preset_of(&self, of: &[u32]) -> Preset {
        match self.preset {
            Preset::Default if of.iter().all(|&id| self.asks_for(id, quality::LOW)) => Preset::Fast,
            preset => preset,
        }
    }

    fn asks_for(&self, id: u32, quality: u32) -> bool {
        self.is_dynamic && record(self.records, id).is_some_and(|record| record.quality == quality)
    }
}

fn record(records: &Records, id: u32) -> Option<&Record> {
    records.get(id as usize)?.as_deref()
}

/// The triangles of a surface that stands still.
fn still_triangles(records: &Records, id: u32) -> usize {
    match record(records, id) {
        Some(Record { body: Body::Surface(surface), .. }) if surface.steps.is_still() => surface.triangles.len(),
        _ => 0,
    }
}

impl Making {
    /// Memory of the tree that is there already, and triangles that another is built of.
    pub fn extent(&self, records: &Records) -> (usize, usize) {
        match self {
            Self::Nothing => (0, 0),
            Self::Kept(solid) | Self::Refitted(solid, _) => (solid.bvh.bytes(), 0),
            Self::Built(of, _) => (0, of.iter().map(|&id| still_triangles(records, id)).sum()),
        }
    }

    /// The tree.
    pub fn make(self, records: &Records, options: Options<'_>) -> Option<Solid> {
        match self {
            Self::Nothing => None,
            Self::Kept(solid) => Some(solid),
            Self::Built(of, preset) => Some(Solid::build(records, of, Options { preset, ..options })),
            Self::Refitted(mut solid, preset) => {
                let world = world(records, &solid.of);
                match solid.bvh.refit(&world) {
                    Ok(()) => Some(Solid { bounds: bounds(&world), ..solid }),
                    // There are other triangles than before, or others that can be hit.
                    Err(_) => Some(Solid::build(records, solid.of, Options { preset, ..options })),
                }
            }
        }
    }
}

impl Solid {
    fn build(records: &Records, of: Vec<u32>, options: Options<'_>) -> Self {
        let world = world(records, &of);
        let triangles = of.iter().map(|&id| still_triangles(records, id)).sum();
        let bvh = Bvh::build_with(&world, options);
        Self { bvh, of, triangles, bounds: bounds(&world) }
    }
}

/// Geometries in the caller's own coordinates.
fn world(records: &Records, of: &[u32]) -> World {
    let part = |&id: &u32| {
        let Some(Record { body: Body::Surface(surface), .. }) = record(records, id) else { return None };
        let (positions, triangles) = (Arc::clone(&surface.steps[0]), Arc::clone(&surface.triangles));
        Some(Part { geometry: id, instance: 0, primitives: Primitives::Triangles { positions, triangles } })
    };
    let mut world = World::default();
    world.parts = of.iter().filter_map(part).collect();
    world.fixed = 0..world.parts.len();
    world
}

/// The box around what can be hit.
fn bounds(world: &World) -> Aabb {
    world.parts.iter().map(Part::bounds).fold(Aabb::EMPTY, Aabb::union)
}
