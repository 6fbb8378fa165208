//! The coordinates in which f64 meshes are traced, and how far rays and corners are off there.
//!
//! Meshes are moved so that zero is where most corners are, and scaled by a power of two so that the largest distance
//! from it is in [1, 2): f32 then keeps of them what it can, the most around zero, and neither overflows nor
//! underflows, however small or large they are. With u = 2^-24 a corner is off by u times its largest coordinate, and
//! by what f64 rounds at the distance from zero where they were, m. Its coordinate is at most that of a ray's origin
//! and what is between both. By u times the latter it is off as a hit is by a direction that is off; and by the rest,
//! c, in any case. The filter wants 3 c more than the origin of a ray is off by, and 3 u more than its direction is
//! ([`super::super::bvh`]). What is large and far away thus leaves what is small as sharp as it is: only m knows of it.
//!
//! A ray that starts farther away than 4 R, R being the farthest coordinate, is started anew before it comes near;
//! otherwise its rounding would count by its distance. Its direction is scaled to a largest component in [1, 2). A
//! range of t is widened by the rounding.

use super::{PreciseMesh, PreciseRay, is_traceable};
use crate::math::{DAabb, DVec3, UNIT_ROUNDOFF, UNIT_ROUNDOFF_64, Vec3};
use crate::ray::Ray;
use crate::scene::choose_origin;
use crate::trace::bvh::Blur;

/// From the coordinates of the meshes to those of the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    centre: DVec3,
    /// A power of two.
    scale: f64,
    /// R, of everything in the tree.
    reach: f64,
    /// m: what f64 rounds a point by that is as far away as the meshes are, in the tree's coordinates. Zero if nothing
    /// is moved or rounded.
    moving_error: f64,
}

/// A ray in the coordinates of the tree.
pub(super) struct LocalRay {
    pub ray: Ray,
    /// The blur of this one ray.
    pub blur: Blur,
    /// Whether [`Frame::blur`] may cover it, as one of many.
    pub is_common: bool,
    /// By how much it is off for what f64 rounds of its way from where it is moved.
    pub off: f64,
    /// Whether that is so much that f32 has no numbers for it, and every triangle may be hit.
    pub is_lost: bool,
    /// t is that of the local ray and this,
    start: f64,
    /// times this.
    stretch: f64,
}

/// More than the rounding of a component to f32, relative to the largest.
const ROUNDING: f32 = 1.01 * UNIT_ROUNDOFF;

/// What corners that are rounded count for besides.
const CORNERS: f32 = 3.03 * UNIT_ROUNDOFF;

/// By what a ray is off at most that is [common](LocalRay::is_common), relative to R, of what f64 rounds of its way
/// from where it is moved. Those that come from farther away than some ten million R would make all others coarse.
const MOVED: f64 = 0.25 / (1u64 << 24) as f64;

/// Rays that are farther [off](LocalRay::off) than this are held against every triangle: they come from some 1e30 R
/// away, and what is much larger, or the square of it, has no room in f32.
const LOST: f64 = 1e15;

/// Less than this many times R is a ray's origin away, or it is moved.
const NEAR: f64 = 4.0;

/// Smaller meshes are not scaled to 1, so that products with the scale stay finite.
const SMALLEST: f64 = 1e-140;

/// Rounding of t, in f64 and to f32.
const RANGE: f64 = 1e-6;

impl Frame {
    /// Of meshes with this box around all that can be traced of them.
    pub fn around(meshes: &[PreciseMesh], bounds: DAabb) -> Self {
        let is_f32 = |p: DVec3| p.as_vec3().as_dvec3() == p || p.is_nan();
        let is_handy =
            bounds.is_empty() || choose_origin(&bounds) == DVec3::ZERO && (1e-12..1e12).contains(&bounds.radius());
        if is_handy && meshes.iter().flat_map(PreciseMesh::corners).all(is_f32) {
            let reach = if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() };
            return Self { centre: DVec3::ZERO, scale: 1.0, reach, moving_error: 0.0 };
        }
        let (mut centre, mut radius) = (DVec3::ZERO, 0.0);
        if !bounds.is_empty() {
            centre = middle(meshes).clamp(bounds.min, bounds.max);
            radius = (bounds.max - centre).max(centre - bounds.min).max_element();
        }
        let scale = power_of_two_below(radius.max(SMALLEST)).recip();
        let moving_error = 4.0 * UNIT_ROUNDOFF_64 * (centre.abs().max_element() + radius) * scale;
        // Not zero for a single point either.
        let moving_error = moving_error.max(f64::MIN_POSITIVE);
        Self { centre, scale, reach: 2.0, moving_error }
    }

    /// Whether everything is traced as it is.
    pub fn is_identity(&self) -> bool {
        self.moving_error == 0.0
    }

    /// A corner that can be traced.
    pub fn point(&self, p: DVec3) -> Vec3 {
        self.local(p).as_vec3()
    }

    fn local(&self, p: DVec3) -> DVec3 {
        (p - self.centre) * self.scale
    }

    /// A point, and by how much each component is off from what is meant, corners included but for u times their
    /// distance from it.
    pub fn blurred_point(&self, p: DVec3) -> (Vec3, f64) {
        let local = self.local(p);
        let rounded = local.as_vec3();
        let off = (local - rounded.as_dvec3()).abs().max_element();
        if self.is_identity() {
            return (rounded, off);
        }
        let moved = 4.0 * UNIT_ROUNDOFF_64 * (p.abs().max_element() + self.centre.abs().max_element()) * self.scale;
        let corners = self.moving_error + f64::from(UNIT_ROUNDOFF) * local.abs().max_element();
        (rounded, off + moved + corners)
    }

    /// Lengths there are so many times those of the meshes.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// At least the largest coordinate of the meshes, as they were given.
    pub fn farthest(&self) -> f64 {
        self.centre.abs().max_element() + self.reach / self.scale
    }

    /// Of many rays that are not [exact](Self::exact_ray), and [off](LocalRay::off) by so much at most, to be used as
    /// [`slab::ready`](super::super::bvh) does: in the second part relative to their own size.
    pub fn blur(&self, off: f64) -> Blur {
        let base = 4.0 * self.moving_error + off;
        let direction = if self.is_identity() { ROUNDING } else { ROUNDING + CORNERS };
        Blur { origin: (base * 1.01) as f32 + f32::MIN_POSITIVE, direction }
    }

    /// The ray as it is, if it can be traced so.
    pub fn exact_ray(&self, ray: &PreciseRay) -> Option<Ray> {
        let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
        let (tmin, tmax) = (ray.tmin as f32, ray.tmax as f32);
        let is_f32 = origin.as_dvec3() == ray.origin && direction.as_dvec3() == ray.direction;
        let is_same = is_f32 && f64::from(tmin) == ray.tmin && f64::from(tmax) == ray.tmax;
        let local = Ray { origin, direction, tmin, tmax, time: 0.0 };
        (self.is_identity() && is_same && local.is_valid()).then_some(local)
    }

    /// Bounds on the local t of a hit.
    pub fn bounds(&self, ray: &PreciseRay, t: f64) -> Option<[f32; 2]> {
        let LocalRay { start, stretch, .. } = self.ray(ray)?;
        let whole = t / stretch;
        bounds(whole - start, (whole.abs() + start) * T_ROUNDING)
    }

    /// The ray, rounded; none for one that hits nothing.
    pub fn ray(&self, ray: &PreciseRay) -> Option<LocalRay> {
        if !ray.is_valid() {
            return None;
        }
        let size = power_of_two_below(ray.direction.abs().max_element());
        let direction = ray.direction / size;
        let stretch = (size * self.scale).recip();
        let mut origin = self.local(ray.origin);
        let far = origin.abs().max_element();
        let mut start = 0.0;
        if far > NEAR * self.reach {
            let along = -origin.dot(direction) / direction.length_squared();
            // Everything is within sqrt(3) R of zero, so within 1.8 R of where the ray is nearest to zero.
            let before = along - 2.5 * self.reach / direction.length();
            if before > 0.0 {
                start = before;
                origin += direction * before;
            }
        }
        let begin = (ray.tmin / stretch * (1.0 - RANGE) - start * (1.0 + RANGE)).max(0.0);
        let end = ray.tmax / stretch * (1.0 + RANGE) - start * (1.0 - RANGE);
        if end < begin {
            return None;
        }
        let local = Ray {
            origin: origin.as_vec3(),
            direction: direction.as_vec3(),
            tmin: begin as f32,
            tmax: (end as f32).next_up(),
            time: 0.0,
        };
        let off = 8.0 * UNIT_ROUNDOFF_64 * (far + start);
        let is_lost = off > LOST;
        // Even where it is nearest to zero, or it starts, it is far from everything.
        if is_lost && origin.abs().max_element() > 8.0 * self.reach + 4.0 * off {
            return None;
        }
        let is_common = off <= MOVED * self.reach && local.is_valid();
        let mut blur = self.blur(off);
        blur.origin += blur.direction * local.origin.abs().max_element();
        Some(LocalRay { ray: local, blur, is_common, off, is_lost, start, stretch })
    }
}

/// Triangles whose corners are looked at for where most are.
const SAMPLE: usize = 4096;

/// On each axis a coordinate that as many corners are below as above, of some of those that can be traced; zero if
/// there are none.
fn middle(meshes: &[PreciseMesh]) -> DVec3 {
    let count = meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
    // Only corners of triangles that are taken are fetched.
    let triangles = meshes.iter().flat_map(|mesh| mesh.triangles.iter().map(move |triangle| (mesh, triangle)));
    let some = triangles.step_by(count.div_ceil(SAMPLE).max(1));
    let corners = some.flat_map(|(mesh, triangle)| triangle.map(|i| mesh.positions[i as usize]));
    let mut corners: Vec<DVec3> = corners.filter(|&p| is_traceable(p)).collect();
    if corners.is_empty() {
        return DVec3::ZERO;
    }
    let half = corners.len() / 2;
    DVec3::from([0, 1, 2].map(|axis| corners.select_nth_unstable_by(half, |a, b| a[axis].total_cmp(&b[axis])).1[axis]))
}

/// f32 below and above a number that may be off by the rounding of t; none where that is not finite.
pub(super) fn around(t: f64) -> Option<[f32; 2]> {
    bounds(t, t.abs() * T_ROUNDING)
}

/// Relative to the numbers that t is computed from.
const T_ROUNDING: f64 = 1e-11;

fn bounds(t: f64, error: f64) -> Option<[f32; 2]> {
    let [low, high] = [((t - error) as f32).next_down(), ((t + error) as f32).next_up()];
    (low.is_finite() && high.is_finite()).then_some([low.max(0.0), high])
}

impl LocalRay {
    /// At least the local t of one that is given.
    pub fn limit(&self, t: f64) -> f32 {
        let local = t / self.stretch;
        ((local * (1.0 + RANGE) - self.start * (1.0 - RANGE)) as f32).next_up()
    }
}

/// The largest power of two that is no larger; 1 for what is not a positive number.
fn power_of_two_below(x: f64) -> f64 {
    if x.is_normal() && x > 0.0 { f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000) } else { 1.0 }
}
