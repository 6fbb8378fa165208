//! Trees over the triangles that stand still.
//!
//! A scene has one. A scene that is dynamic has more once something in it has changed: a commit takes what changed out
//! of the trees it was in, builds one over that, and keeps the others. What has come to rest is merged with what is not
//! much larger, as in a log-structured merge tree (O'Neil, Cheng, Gawlick, O'Neil 1996), so that there are few trees,
//! and what rests is built again a few times at most.

use std::sync::Arc;

use twincast_core::World;
use twincast_core::math::Aabb;
use twincast_core::trace::bvh::{Bvh, Options, Preset};
use twincast_core::trace::{Part, Primitives};

use super::committed::{Body, Record};
use crate::abi::quality;

/// What is at rest is merged with the next larger tree unless that has more than so many times its triangles. Each tree
/// costs every ray some 30 ns.
const MERGED: usize = 4;

/// Trees that are refitted by themselves, at most.
const REFITTED: usize = 8;

/// What has changed once soon does so again: it is not merged before it has seen so many commits go by.
const REST: u32 = 4;

/// A tree, and of what.
#[derive(Debug)]
pub struct Solid {
    pub bvh: Bvh,
    /// By rising id; without those that were taken out.
    members: Vec<Member>,
    /// Triangles that were taken out.
    gone: usize,
    /// Commits since it was made.
    rest: u32,
}

/// A geometry in a tree, as it was when that was built.
#[derive(Clone, Copy, Debug)]
struct Member {
    id: u32,
    triangles: usize,
    bounds: Aabb,
}

/// How a commit comes to a tree.
#[derive(Debug)]
pub enum Making {
    /// It is as it was, but for what was taken out.
    Kept(Solid),
    /// Vertices have moved, and the geometries ask for no more than that boxes follow. What it is built with where that
    /// is not enough.
    Refitted(Solid, Preset),
    /// Over these geometries, by rising id, which have so many triangles.
    Built(Vec<u32>, usize, Preset),
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
    /// How the trees are made, the largest first. `old` are those of the last commit; none where they are not to be
    /// looked at.
    pub fn plan(&self, old: Vec<Solid>) -> Vec<Making> {
        let all = (0..self.records.len() as u32).filter(|&id| still_triangles(self.records, id) > 0);
        let mut changed: Vec<u32> = all.filter(|&id| !old.iter().any(|solid| solid.has(id))).collect();
        let is_first = old.is_empty();
        let (mut made, mut calm, mut refitted) = (Vec::new(), Vec::new(), Vec::new());
        for mut solid in old {
            solid.rest = solid.rest.saturating_add(1);
            let (stay, leave): (Vec<Member>, Vec<Member>) =
                solid.members.iter().partition(|member| !self.has_changed(member.id));
            let is_there = |member: &Member| still_triangles(self.records, member.id) > 0;
            if self.is_refitted(&solid, &leave) {
                let preset = self.preset_of(&solid.ids());
                refitted.push(Making::Refitted(solid, preset));
                continue;
            }
            changed.extend(leave.iter().filter(|member| is_there(member)).map(|member| member.id));
            if stay.is_empty() {
                continue;
            }
            let list = if solid.rest >= REST { &mut calm } else { &mut made };
            let is_kept = leave.is_empty() || solid.take_out(&leave);
            let stay = || stay.iter().map(|member| member.id).collect();
            list.push(if is_kept { Making::Kept(solid) } else { self.built(stay()) });
        }
        made.extend(self.merged(calm));
        if refitted.len() > REFITTED {
            // Together, and refitted together from then on.
            refitted = vec![self.built(refitted.iter().flat_map(Making::ids).collect())];
        }
        made.append(&mut refitted);
        // What asks for different things is built apart, so that each has it; but for what is all new.
        let groups = if is_first { vec![changed] } else { self.by_quality(changed) };
        made.extend(groups.into_iter().filter(|group| !group.is_empty()).map(|group| self.built(group)));
        made.sort_by_key(|making| std::cmp::Reverse(making.triangles()));
        made
    }

    /// Those that are to be refitted, those of low quality and the others.
    fn by_quality(&self, ids: Vec<u32>) -> Vec<Vec<u32>> {
        let (refit, others): (Vec<u32>, Vec<u32>) = ids.iter().partition(|&&id| self.asks_for(id, quality::REFIT));
        let (low, others): (Vec<u32>, Vec<u32>) = others.iter().partition(|&&id| self.asks_for(id, quality::LOW));
        vec![refit, low, others]
    }

    /// Whether a tree is refitted of which these have changed: where all of them ask for it, and they are most of it.
    fn is_refitted(&self, solid: &Solid, leave: &[Member]) -> bool {
        let moved: usize = leave.iter().map(|member| still_triangles(self.records, member.id)).sum();
        // Of others there is nothing to refit.
        let is_wanted = |member: &Member| {
            self.asks_for(member.id, quality::REFIT) && still_triangles(self.records, member.id) == member.triangles
        };
        !leave.is_empty() && solid.gone == 0 && 2 * moved >= solid.triangles() && leave.iter().all(is_wanted)
    }

    /// Trees of which each has more than [`MERGED`] times the triangles of the next.
    fn merged(&self, mut calm: Vec<Making>) -> Vec<Making> {
        calm.sort_by_key(|making| std::cmp::Reverse(making.triangles()));
        let mut merged: Vec<Making> = Vec::new();
        for making in calm.into_iter().rev() {
            match merged.last() {
                Some(smaller) if making.triangles() <= MERGED * smaller.triangles() => {
                    let ids = [smaller.ids(), making.ids()].concat();
                    merged.pop();
                    merged.push(self.built(ids));
                }
                _ => merged.push(making),
            }
        }
        merged
    }

    fn has_changed(&self, id: u32) -> bool {
        record(self.records, id).is_none_or(|record| record.is_new)
    }

    fn built(&self, mut of: Vec<u32>) -> Making {
        of.sort_unstable();
        let triangles = of.iter().map(|&id| still_triangles(self.records, id)).sum();
        let preset = self.preset_of(&of);
        Making::Built(of, triangles, preset)
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
    fn triangles(&self) -> usize {
        match self {
            Self::Kept(solid) | Self::Refitted(solid, _) => solid.triangles(),
            Self::Built(_, triangles, _) => *triangles,
        }
    }

    fn ids(&self) -> Vec<u32> {
        match self {
            Self::Kept(solid) | Self::Refitted(solid, _) => solid.ids(),
            Self::Built(of, _, _) => of.clone(),
        }
    }

    /// Memory of the tree that is there already, and triangles that another is built of.
    pub fn extent(&self) -> (usize, usize) {
        match self {
            Self::Kept(solid) | Self::Refitted(solid, _) => (solid.bvh.bytes(), 0),
            Self::Built(_, triangles, _) => (0, *triangles),
        }
    }

    /// The tree.
    pub fn make(self, records: &Records, options: Options<'_>) -> Solid {
        match self {
            Self::Kept(solid) => solid,
            Self::Built(of, _, preset) => Solid::build(records, &of, Options { preset, ..options }),
            Self::Refitted(mut solid, preset) => {
                let of = solid.ids();
                let world = world(records, &of);
                match solid.bvh.refit(&world) {
                    Ok(()) => Solid { members: members(&world), rest: 0, ..solid },
                    // Triangles have other corners than before, or others of them can be hit.
                    Err(_) => {
                        drop(solid);
                        Solid::build(records, &of, Options { preset, ..options })
                    }
                }
            }
        }
    }
}

impl Solid {
    fn build(records: &Records, of: &[u32], options: Options<'_>) -> Self {
        let world = world(records, of);
        Self { bvh: Bvh::build_with(&world, options), members: members(&world), gone: 0, rest: 0 }
    }

    /// The box around what can be hit.
    pub fn bounds(&self) -> Aabb {
        self.members.iter().fold(Aabb::EMPTY, |all, member| all.union(member.bounds))
    }

    fn has(&self, id: u32) -> bool {
        self.members.binary_search_by_key(&id, |member| member.id).is_ok()
    }

    fn ids(&self) -> Vec<u32> {
        self.members.iter().map(|member| member.id).collect()
    }

    /// Those that are left.
    fn triangles(&self) -> usize {
        self.members.iter().map(|member| member.triangles).sum()
    }

    /// Takes some members out, unless more would be gone then than left, or it cannot: whether it did. If not, this is
    /// good for nothing but to be built anew.
    fn take_out(&mut self, members: &[Member]) -> bool {
        let leaving = members.iter().map(|member| member.triangles).sum::<usize>();
        if self.gone + leaving > self.triangles() - leaving {
            return false;
        }
        self.members.retain(|own| members.binary_search_by_key(&own.id, |member| member.id).is_err());
        self.gone += leaving;
        self.bvh.take_out(&members.iter().map(|member| (member.id, member.bounds)).collect::<Vec<_>>())
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

fn members(world: &World) -> Vec<Member> {
    let member = |part: &Part| Member { id: part.geometry, triangles: part.primitives.len(), bounds: part.bounds() };
    world.parts.iter().map(member).collect()
}
