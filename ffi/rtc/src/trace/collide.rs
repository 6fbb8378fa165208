//! Which primitives of two scenes may touch: those whose boxes overlap.

use std::ffi::c_void;

use twincast_core::math::Vec3;
use twincast_core::trace::bvh::Search;

use crate::abi::{RTCCollideFunc, RTCCollision};
use crate::failure::{Failure, Result};
use crate::scene::{Body, Committed, Record};

/// Collisions told at a time.
const MOST: usize = 16;

/// Tells of each pair of user primitives, one of each scene, whose boxes overlap at time 0; in a scene with itself no primitive meets itself.
///
/// # Errors
/// Where there is other geometry: its boxes would have to be those of the primitives that the caller knows, which only user geometry has.
pub fn collide(first: &Committed, second: &Committed, function: RTCCollideFunc, user: *mut c_void) -> Result<()> {
    let function = function.ok_or_else(|| Failure::argument("invalid argument"))?;
    let is_user = |record: &Record| matches!(record.body, Body::User(_));
    if ![first, second].iter().all(|scene| scene.records.iter().flatten().all(is_user)) {
        return Err(Failure::operation("scenes must only contain user geometries"));
    }
    let is_same = std::ptr::eq(first, second);
    let mut waiting: Vec<RTCCollision> = Vec::with_capacity(MOST);
    let tell = |waiting: &mut Vec<RTCCollision>| {
        if !waiting.is_empty() {
            // SAFETY: the caller promised a function of this type; the list lives until it returns.
            unsafe { function(user, waiting.as_mut_ptr(), waiting.len() as u32) };
            waiting.clear();
        }
    };
    let near = second.near();
    for (geometry0, record) in first.records.iter().enumerate() {
        let Some(Body::User(own)) = record.as_ref().map(|record| &record.body) else { continue };
        for (primitive0, bounds) in own[0].iter().enumerate() {
            if !bounds.min.cmple(bounds.max).all() {
                continue;
            }
            // A ball around the box finds all boxes that overlap it, and some more.
            let centre = bounds.min.midpoint(bounds.max);
            let radius = (bounds.max - centre).max(centre - bounds.min).length() * (1.0 + 1e-6);
            near.visit(centre, radius, None, &mut |item| {
                let other = second.record(item.geometry).map(|record| &record.body);
                let is_itself = is_same && item.geometry == geometry0 as u32 && item.primitive == primitive0 as u32;
                if let Some(Body::User(other)) = other
                    && !is_itself
                {
                    let box1 = &other[0][item.primitive as usize];
                    let overlaps = |a: Vec3, b: Vec3| a.cmple(b).all();
                    if overlaps(bounds.min, box1.max) && overlaps(box1.min, bounds.max) {
                        waiting.push(RTCCollision {
                            geometry0: geometry0 as u32,
                            primitive0: primitive0 as u32,
                            geometry1: item.geometry,
                            primitive1: item.primitive,
                        });
                        if waiting.len() == MOST {
                            tell(&mut waiting);
                        }
                    }
                }
                Search::Continue(radius)
            });
        }
    }
    tell(&mut waiting);
    Ok(())
}
