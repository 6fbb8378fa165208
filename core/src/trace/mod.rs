//! Two questions, closest hit and occluded, answered by engines that know nothing of each other.
//!
//! A tracer is built from a [`World`] and answers [`Hit`]s.

pub mod accel;
pub mod brute;
pub mod bvh;
mod crossings;
mod leaf;
mod limits;
mod motion;
#[doc(hidden)]
pub mod nearest;
pub mod precise;
mod spread;
#[doc(hidden)]
pub mod unbounded;
mod world;

pub use motion::Motion;
pub use world::{Part, Placement, Primitives, World};

use crate::ray::{Hit, Ray};

/// An engine that finds where rays meet a scene.
///
/// Every engine obeys the same conventions: a hit counts if it is not behind the origin, and for `tmin <= t <= tmax`;
/// at equal t the lowest (instance, geometry, primitive) wins; a ray that [is not valid](Ray::is_valid) misses.
///
/// The two required methods define the answer; the batch methods give the same answers for many rays at a time, and
/// an engine overrides them where it has something faster.
pub trait Tracer: Sync {
    /// The nearest hit.
    fn closest(&self, ray: &Ray) -> Option<Hit>;

    /// Whether there is any hit.
    fn occluded(&self, ray: &Ray) -> bool;

    /// The nearest hit of each ray, into `hits` of the same length. All by the thread that calls: who has many rays
    /// hands parts of them to several.
    ///
    /// # Panics
    /// Where lengths differ.
    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], _batch: Batch) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest(ray);
        }
    }

    /// Whether each ray has any hit, into `occluded` of the same length; by the thread that calls.
    ///
    /// # Panics
    /// Where lengths differ.
    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], _batch: Batch) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        for (ray, answer) in rays.iter().zip(occluded) {
            *answer = self.occluded(ray);
        }
    }
}

/// How a batch is traced. It changes the speed, never a native answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    /// Rays of a packet, for engines that trace packets; the native tracer chooses by itself: bundles where `coherent`
    /// promises some, else flights of single rays, and each ray alone where they are few.
    pub width: Width,
    /// Whether neighbours in the batch start and point alike.
    pub coherent: bool,
}

/// Of so many pairs of neighbours, or a few more, it is asked whether they are alike.
const SAMPLES: usize = 16;

/// Neighbours point alike where the cosine between them is at least this: that of 5 degrees.
const ALIKE: f32 = 0.996;

/// Neighbours start alike where they are no farther apart than this share of what rays from here and there are.
const NEAR: f32 = 0.05;

impl Batch {
    /// For rays of which nobody says how they lie: coherent where a sample of neighbours starts from the same points
    /// and points alike, as a camera's rays; or points the same way and starts alike, as an orthographic camera's and
    /// those towards the sun.
    #[must_use]
    pub fn of(rays: &[Ray]) -> Self {
        let every = (rays.len() / SAMPLES).max(2);
        let samples = || rays.chunks_exact(every);
        // The next but one as well, for rays may come in twos.
        let are_mostly = |alike: &dyn Fn(&[Ray]) -> bool| {
            let count = samples().filter(|some| some.windows(2).take(2).all(alike)).count();
            count > 0 && 4 * count >= 3 * (rays.len() / every)
        };
        let from_one_point = |pair: &[Ray]| {
            let (a, b) = (pair[0].direction, pair[1].direction);
            pair[0].origin == pair[1].origin && a.dot(b) >= ALIKE * a.length() * b.length()
        };
        let same_way = |pair: &[Ray]| pair[0].direction == pair[1].direction;
        let coherent = are_mostly(&from_one_point)
            || are_mostly(&same_way) && {
                // By the golden section, so that it is not the same place of another row; in the middle of all, so that
                // a ray far off does not count.
                let other = |some: &[Ray]| some[every * 618 / 1000].origin.distance(some[0].origin);
                let mut apart: Vec<f32> = samples().map(other).collect();
                apart.sort_unstable_by(f32::total_cmp);
                let near = NEAR * apart[apart.len() / 2];
                are_mostly(&|pair| same_way(pair) && pair[0].origin.distance(pair[1].origin) <= near)
            };
        Self { coherent, ..Self::default() }
    }
}

/// Rays in a packet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Width {
    /// Ray by ray.
    #[default]
    One,
    /// Packets of 4.
    Four,
    /// Packets of 8.
    Eight,
    /// Packets of 16.
    Sixteen,
}

impl Width {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::One, Self::Four, Self::Eight, Self::Sixteen];

    /// How many rays.
    pub const fn rays(self) -> usize {
        match self {
            Self::One => 1,
            Self::Four => 4,
            Self::Eight => 8,
            Self::Sixteen => 16,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn rays_of_a_camera_are_coherent_and_others_are_not() {
        let grid = || (0..4096).map(|i| Vec3::new((i % 64) as f32 / 64.0, (i / 64) as f32 / 64.0, 1.0));
        let coherent = |rays: Vec<Ray>| Batch::of(&rays).coherent;
        assert!(coherent(grid().map(|way| Ray::new(Vec3::ONE, way)).collect()));
        assert!(coherent(grid().map(|way| Ray::new(Vec3::ONE, way * 1e-3)).collect()));
        // Side by side, in pictures of all widths; here and there, by twos as well, and though one is far off; and each
        // its own way.
        let rows = |wide: usize| (0..4096).map(move |i| Vec3::new((i % wide) as f32, (i / wide) as f32, 0.0));
        for wide in [32, 60, 64, 100, 256, 1000, 1024] {
            assert!(coherent(rows(wide).map(|at| Ray::new(at, Vec3::Z)).collect()), "{wide}");
        }
        let scattered = |i: usize| Vec3::new((i * 37 % 64) as f32, (i * 53 % 67) as f32, 0.0);
        for twos in [1, 2] {
            let mut rays: Vec<Ray> = (0..4096).map(|i| Ray::new(scattered(i / twos), Vec3::Z)).collect();
            assert!(!coherent(rays.clone()));
            rays[512].origin.x = 1e6;
            assert!(!coherent(rays));
        }
        assert!(!coherent(grid().map(|at| Ray::new(at, at)).collect()));
        // To all sides, and too few to have neighbours.
        assert!(!coherent((0..4096).map(|i| Ray::new(Vec3::ONE, Vec3::AXES[i * i % 3])).collect()));
        assert!(!coherent(vec![Ray::new(Vec3::ONE, Vec3::Z)]));
        assert!(!coherent(Vec::new()));
    }
}
