//! What a ray crosses, gathered in any order and put in order.
//!
//! Hits in the interior of triangles count as they come. Those on edges and in corners are gathered, and of the
//! triangles of a part that touch there, in the same place and in the same sense, as many count as the ray crosses when
//! it is moved aside ([`crate::shape::crossing`]): the lowest ids. The place is the edge or the corner itself, by the
//! positions of its ends, not the t, which is rounded differently in each triangle; so no tolerance is needed, walls
//! may be arbitrarily thin, and meshes whose triangles share positions but no indices are served alike.
//!
//! Everything is in f64, which holds f32 exactly: one rule for scenes of either.

use super::precise::PreciseHit;
use crate::math::DVec3;
use crate::shape::crossing::{Crossing, Touch};

/// Crossings of one ray.
#[derive(Default)]
pub(super) struct Crossings {
    found: Vec<PreciseHit>,
    /// On edges and in corners of triangles.
    touching: Vec<Touching>,
}

/// The bits of a corner's position, twice, or of the positions of an edge's ends, the lower first.
type Place = [[u64; 3]; 2];

/// A hit on an edge or in a corner.
struct Touching {
    hit: PreciseHit,
    /// In the coordinates of the part.
    place: Place,
    is_leaving: bool,
    is_crossed: bool,
}

impl Touching {
    /// Equal for those that share a crossing.
    fn group(&self) -> (u32, u32, Place, bool) {
        (self.hit.instance, self.hit.geometry, self.place, self.is_leaving)
    }
}

/// The ends of an edge, or a corner, as keys.
fn place(corners: &[DVec3; 3], touch: &Touch) -> Place {
    // Adding 0 makes one zero of the two.
    let key = |k: usize| (corners[k] + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut ends = (0..3).filter(|&k| touch.between[k]).map(key);
    let first = ends.next().unwrap_or_default();
    let second = ends.next().unwrap_or(first);
    [first.min(second), first.max(second)]
}

impl Crossings {
    pub fn clear(&mut self) {
        self.found.clear();
        self.touching.clear();
    }

    /// Takes a crossing of the triangle with these corners and this (primitive, geometry, instance).
    pub fn take(&mut self, corners: &[DVec3; 3], crossing: Crossing, id: (u32, u32, u32)) {
        let Crossing { hit, touch } = crossing;
        let hit = PreciseHit::new(hit, id);
        match touch {
            None => self.found.push(hit),
            Some(touch) => {
                let Touch { is_leaving, is_crossed, .. } = touch;
                self.touching.push(Touching { hit, place: place(corners, &touch), is_leaving, is_crossed });
            }
        }
    }

    /// Of each group of touching triangles as many as are crossed; then all in order: by t, then by id.
    pub fn finish(&mut self) -> &[PreciseHit] {
        let Self { found, touching } = self;
        let by_place = |a: &Touching, b: &Touching| (a.group(), a.hit.id()).cmp(&(b.group(), b.hit.id()));
        touching.sort_unstable_by(by_place);
        // Triangles that were cut come once from each of their boxes.
        touching.dedup_by_key(|touching| touching.hit.id());
        for group in touching.chunk_by(|a, b| a.group() == b.group()) {
            let crossings = group.iter().filter(|touching| touching.is_crossed).count();
            found.extend(group[..crossings].iter().map(|touching| touching.hit));
        }
        found.sort_unstable_by(PreciseHit::order);
        found.dedup_by_key(|hit| hit.id());
        found
    }
}
