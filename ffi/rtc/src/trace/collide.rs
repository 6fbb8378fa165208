//! Which primitives of two scenes may touch: those whose boxes overlap.

use std::ffi::c_void;

use rayon::prelude::*;
use twincast_core::math::{Aabb, Vec3};
use twincast_core::trace::bvh::BoxTree;

use crate::abi::{RTCCollideFunc, RTCCollision};
use crate::failure::{Failure, Result};
use crate::scene::{Body, Committed, Item, Near};

/// Collisions told at a time.
const MAX: usize = 16;

/// Primitives whose collisions one thread looks for at a time: fewer are not worth waking another.
const TASK: usize = 1 << 6;

/// Collisions that are there at the same time, about.
const WAVE: usize = 1 << 18;

/// Tells of each pair of user primitives, one of each scene, whose boxes overlap at their first time steps; in a scene
/// with itself no primitive meets itself. They are looked for by the device's threads, and told by the caller's own,
/// always in the same order.
///
/// # Errors
/// Where there is other geometry: its boxes would have to be those of the primitives that the caller knows, which only
/// user geometry has.
pub fn collide(first: &Committed, second: &Committed, function: RTCCollideFunc, user: *mut c_void) -> Result<()> {
    let function = function.ok_or_else(|| Failure::argument("invalid argument"))?;
    let is_user = |scene: &Committed| {
        let mut records = scene.records.iter().flatten();
        records.all(|record| matches!(record.body, Body::User(_)))
    };
    if !is_user(first) || !is_user(second) {
        return Err(Failure::operation("scenes must only contain user geometries"));
    }
    let theirs = Theirs::new(second);
    let items: Vec<Item> = all(first).collect();
    let (mut rest, mut len) = (&items[..], 2 * TASK);
    while !rest.is_empty() {
        let (wave, others) = rest.split_at(len.min(rest.len()));
        rest = others;
        let find = || wave.par_chunks(TASK).map(|items| collisions(first, &theirs, items)).collect();
        let mut found: Vec<Vec<RTCCollision>> = first.device.install(find)?;
        let count: usize = found.iter().map(Vec::len).sum();
        // As many more as there is room for, or fewer.
        len = if 2 * count < WAVE { 2 * len } else { (len / 2).max(TASK) };
        for collisions in found.iter_mut().flat_map(|found| found.chunks_mut(MAX)) {
            // SAFETY: the caller promised a function of this type; the list lives until it returns.
            unsafe { function(user, collisions.as_mut_ptr(), collisions.len() as u32) };
        }
    }
    Ok(())
}

/// All user primitives.
fn all(scene: &Committed) -> impl Iterator<Item = Item> {
    let count = |id: usize| match scene.record(id as u32).map(|record| &record.body) {
        Some(Body::User(steps)) => steps[0].len() as u32,
        _ => 0,
    };
    let of = move |id: usize| (0..count(id)).map(move |primitive| Item::new(id as u32, primitive));
    (0..scene.records.len()).flat_map(of)
}

/// The box of a user primitive at its first time step.
fn bounds(scene: &Committed, item: Item) -> Aabb {
    match scene.record(item.geometry).map(|record| &record.body) {
        Some(Body::User(steps)) => steps[0][item.primitive as usize],
        _ => Aabb::EMPTY,
    }
}

/// The second scene, and a tree of its boxes.
struct Theirs<'a> {
    scene: &'a Committed,
    tree: Tree<'a>,
}

enum Tree<'a> {
    /// That of rays, whose boxes are those of the primitives where nothing moves.
    OfRays(&'a BoxTree),
    OfPoints(&'a Near),
}

impl<'a> Theirs<'a> {
    fn new(scene: &'a Committed) -> Self {
        let mut records = scene.records.iter().flatten();
        let is_still = records.all(|record| matches!(&record.body, Body::User(steps) if steps.is_still()));
        let of_rays = scene.others.as_ref().filter(|_| is_still).map(Tree::OfRays);
        Self { scene, tree: of_rays.unwrap_or_else(|| Tree::OfPoints(scene.near())) }
    }

    fn overlapping(&self, bounds: &Aabb, visitor: &mut dyn FnMut(Item)) {
        match self.tree {
            Tree::OfRays(tree) => tree.visit_overlapping(bounds, &mut |i| visitor(self.scene.items[i as usize])),
            Tree::OfPoints(near) => near.overlapping(bounds, visitor),
        }
    }
}

/// What some primitives of the first scene meet of the second.
fn collisions(first: &Committed, theirs: &Theirs<'_>, items: &[Item]) -> Vec<RTCCollision> {
    let is_same = std::ptr::eq(first, theirs.scene);
    let mut found = Vec::new();
    for &item in items {
        let own = bounds(first, item);
        // What has no end is in no tree either.
        if !own.is_bounded() {
            continue;
        }
        theirs.overlapping(&own, &mut |other| {
            let box1 = bounds(theirs.scene, other);
            let overlaps = |a: Vec3, b: Vec3| a.cmple(b).all();
            let is_itself = is_same && (other.geometry, other.primitive) == (item.geometry, item.primitive);
            if !is_itself && overlaps(own.min, box1.max) && overlaps(box1.min, own.max) {
                found.push(RTCCollision {
                    geometry0: item.geometry,
                    primitive0: item.primitive,
                    geometry1: other.geometry,
                    primitive1: other.primitive,
                });
            }
        });
    }
    found
}
