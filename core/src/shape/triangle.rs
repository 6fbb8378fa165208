//! The triangle: an intersection test whose verdict is exact.
//!
//! With A, B, C the corners relative to the ray's origin o and d its direction, the ray's line passes inside when the
//! signed volumes d.(B x C), d.(C x A), d.(A x B) have no two opposite signs (Plücker's test, as in Woop, Benthin, Wald
//! 2013, *Watertight ray/triangle intersection*, before their shear). Two triangles that share an edge see the same
//! volume with the opposite sign, so a test that gets the signs right leaks neither at edges nor at vertices.
//!
//! The signs are right because each volume is computed in f64 with a bound on its rounding error, and where the bound
//! cannot decide, in exact arithmetic (in integers, or [`Expansion`]). Woop's test alone, the simpler alternative, is
//! watertight too, but decides for corners that its shear has rounded: it names a neighbour on a ray that passes near
//! an edge.
//!
//! A zero volume counts as inside; a ray in the triangle's plane and a triangle without an area miss.

use super::distance::Support;
use super::exactly;
use crate::math::expansion::{Expansion, count_decision};
use crate::math::number::dot;
use crate::math::{Affine3, DVec3, Vec3, gamma64};
use crate::ray::Ray;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance in units of the ray's direction, off by at most 2^-26 of itself.
    pub t: f64,
    /// Weight of the second corner.
    pub u: f64,
    /// Weight of the third corner.
    pub v: f64,
}

impl TriangleHit {
    /// With weights of which rounding makes none negative.
    #[inline]
    pub(crate) fn within(self) -> Self {
        let [u, v] = weights_within(self.u, self.v);
        Self { u, v, ..self }
    }
}

/// The weights of the second and the third corner, off by rounding, so that none of the three is negative: these are
/// not below 0, and their sum, unrounded, is not above 1.
#[inline]
pub(crate) fn weights_within(u: f64, v: f64) -> [f64; 2] {
    // Of the two zeros the one without a sign.
    let (u, v) = (u.clamp(0.0, 1.0) + 0.0, v.clamp(0.0, 1.0) + 0.0);
    let (large, small) = (u.max(v), u.min(v));
    // From a half on the difference is not rounded, and below there is no doubt.
    if small <= 1.0 - large {
        return [u, v];
    }
    // The larger one gives way, by some of its last digits, so that the smaller one keeps all of its own.
    let most = 1.0 - small;
    let large = if small > 1.0 - most { most.next_down() } else { most };
    if u < v { [small, large] } else { [large, small] }
}

/// Three corners in world coordinates.
pub trait Corners {
    /// Whether `rounded` has an error at all.
    const IS_ROUNDED: bool;
    /// The relative error of t that is let pass before exact arithmetic is asked.
    const T_PRECISION: f64 = T_PRECISION;
    /// How far u and v may be off before they are computed anew.
    const WEIGHT_PRECISION: f64 = f64::INFINITY;
    /// The corners, each component off by at most `gamma64(8)` times its [`slack`](Corners::slack).
    fn rounded(&self) -> [DVec3; 3];
    /// What the error of `rounded` is relative to; zero where it has none.
    fn slack(&self) -> [DVec3; 3];
    /// The corners as they are.
    fn exact(&self) -> [[Expansion; 3]; 3];
    /// The same where f64 holds them.
    fn in_f64(&self) -> Option<[DVec3; 3]> {
        Some(self.rounded())
    }
    /// What the t of a hit follows from.
    fn support(&self) -> Support;
}

impl Corners for [Vec3; 3] {
    const IS_ROUNDED: bool = false;
    #[inline]
    fn rounded(&self) -> [DVec3; 3] {
        [self[0].as_dvec3(), self[1].as_dvec3(), self[2].as_dvec3()]
    }
    #[inline]
    fn slack(&self) -> [DVec3; 3] {
        [DVec3::ZERO; 3]
    }
    fn exact(&self) -> [[Expansion; 3]; 3] {
        self.map(|p| p.to_array().map(Expansion::from))
    }
    #[inline]
    fn support(&self) -> Support {
        Support::Triangle(*self)
    }
}

/// Corners that are not rounded to f32: of a scene in f64.
impl Corners for [DVec3; 3] {
    const IS_ROUNDED: bool = false;
    const T_PRECISION: f64 = 1.0 / (1u64 << 40) as f64;
    const WEIGHT_PRECISION: f64 = 1.0 / (1u64 << 34) as f64;
    #[inline]
    fn rounded(&self) -> [DVec3; 3] {
        *self
    }
    #[inline]
    fn slack(&self) -> [DVec3; 3] {
        [DVec3::ZERO; 3]
    }
    fn exact(&self) -> [[Expansion; 3]; 3] {
        self.map(|p| p.to_array().map(Expansion::from))
    }
    /// Their rays are in f64, too, and t has 40 bits at least.
    #[inline]
    fn support(&self) -> Support {
        Support::Itself
    }
}

/// Corners of an object under the transform that places it.
pub struct Placed<'a> {
    /// Corners in the object's coordinates.
    pub corners: [Vec3; 3],
    /// From there to the world's.
    pub to_world: &'a Affine3,
}

impl Corners for Placed<'_> {
    const IS_ROUNDED: bool = true;
    #[inline]
    fn rounded(&self) -> [DVec3; 3] {
        let to_world = self.to_world.as_daffine3();
        self.corners.map(|p| to_world.transform_point3(p.as_dvec3()))
    }
    #[inline]
    fn slack(&self) -> [DVec3; 3] {
        let to_world = self.to_world.as_daffine3();
        let magnitudes = to_world.matrix3.abs();
        self.corners.map(|p| magnitudes * p.as_dvec3().abs() + to_world.translation.abs())
    }
    fn exact(&self) -> [[Expansion; 3]; 3] {
        let rows = self.to_world.matrix3.transpose();
        let translation = self.to_world.translation.to_array();
        self.corners.map(|p| {
            let p = p.to_array().map(Expansion::from);
            [0, 1, 2].map(|i| {
                let row = rows.col(i).to_array().map(Expansion::from);
                &dot(&row, &p) + &translation[i].into()
            })
        })
    }
    fn in_f64(&self) -> Option<[DVec3; 3]> {
        let (matrix, translation) = (self.to_world.matrix3, self.to_world.translation);
        let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(Vec3::as_dvec3);
        let mut exact = [translation.as_dvec3(); 3];
        for (sum, corner) in exact.iter_mut().zip(&self.corners) {
            for (axis, &length) in axes.iter().zip(&corner.to_array()) {
                // Products of f32 are exact.
                let term = *axis * f64::from(length);
                let next = *sum + term;
                if next - *sum != term || next - term != *sum {
                    return None;
                }
                *sum = next;
            }
        }
        Some(exact)
    }
    #[inline]
    fn support(&self) -> Support {
        Support::Placed(self.corners, *self.to_world)
    }
}

/// The intersection, if it is not behind the origin and `tmin <= t <= tmax` for t rounded to f32.
///
/// A function of the ray's line and the corners alone: whoever calls it, in whatever order, gets the same bits.
#[inline]
pub fn intersect<Co: Corners>(ray: &Ray, corners: &Co) -> Option<TriangleHit> {
    intersect_line(ray.origin.as_dvec3(), ray.direction.as_dvec3(), corners).filter(|hit| ray.reaches(hit.t))
}

/// The intersection with the line from `origin` along `d`, at any t. Whether there is one is exact for these f64, too.
#[inline]
pub fn intersect_line<Co: Corners>(origin: DVec3, d: DVec3, corners: &Co) -> Option<TriangleHit> {
    let seen = Seen::new(origin, d, corners.rounded());
    let [sa, sb, sc] = corners.slack();
    let difference = |of: DVec3, slack: DVec3| Difference { size: of.abs(), slack };
    let [pa, pb, pc] = seen.corners;
    let [a, b, c] = [difference(pa, sa), difference(pb, sb), difference(pc, sc)];
    let [ea, eb, ec] = seen.edges;
    let [ea, eb, ec] = [difference(ea, sb + sc), difference(eb, sc + sa), difference(ec, sa + sb)];

    let absolute = d.abs();
    let is_rounded = Co::IS_ROUNDED;
    let bounds = [
        ROUNDING * absolute.dot(b.cross_error(&ea, is_rounded)),
        ROUNDING * absolute.dot(c.cross_error(&eb, is_rounded)),
        ROUNDING * absolute.dot(a.cross_error(&ec, is_rounded)),
    ];
    let positive = (0..3).any(|k| seen.volumes[k] > bounds[k]);
    let negative = (0..3).any(|k| seen.volumes[k] < -bounds[k]);
    if positive && negative {
        return None;
    }
    let undecided = (0..3).any(|k| seen.volumes[k].abs() <= bounds[k]);

    let (normal, normal_error) = (permanent_cross(eb.size, ec.size), eb.cross_error(&ec, is_rounded));
    // |t| (relative error of both) against an eighth of f32's precision; false for NaN too.
    let height_error = a.size.dot(normal_error) + a.slack.dot(normal + ROUNDING * normal_error);
    let slope_error = absolute.dot(normal_error);
    let t_error = ROUNDING * (height_error + slope_error * (seen.height / seen.slope).abs());
    let is_precise = t_error <= seen.height.abs() * Co::T_PRECISION;
    if !is_precise || undecided {
        return intersect_exactly(origin, d, corners);
    }
    if Co::WEIGHT_PRECISION < f64::INFINITY {
        let weight_error = bounds[1].max(bounds[2]) + ROUNDING * slope_error;
        if weight_error > seen.slope.abs() * Co::WEIGHT_PRECISION {
            return seen.hit_of_sliver(d).or_else(|| intersect_exactly(origin, d, corners));
        }
    }
    Some(seen.hit())
}

/// What u and v of a sliver, or of a triangle that is small for its distance, may be off by: then they are computed
/// exactly.
const SLIVER_PRECISION: f64 = 1.0 / (1u64 << 20) as f64;

/// The magnitude of a difference of corners, or of a corner and the origin, and of what its error is relative to
/// besides: with u = 2^-53 it errs by 9 u (size + slack) at most, 8 for the corners and 1 for the subtraction.
struct Difference {
    size: DVec3,
    slack: DVec3,
}

impl Difference {
    /// What the error of the cross product, in f64, is relative to, by [`ROUNDING`].
    ///
    /// The slack of a corner is as large as its coordinates, the sizes of two edges may be as small as the triangle:
    /// multiplying sums of both would count slack times slack, which is an error of the second order.
    #[inline(always)]
    fn cross_error(&self, other: &Self, is_rounded: bool) -> DVec3 {
        if !is_rounded {
            return permanent_cross(self.size, other.size);
        }
        let (left, right) = (self.size + self.slack, other.size + other.slack);
        let first_order = permanent_cross(self.size, right) + permanent_cross(self.slack, other.size);
        first_order + ROUNDING * permanent_cross(left, right)
    }
}

/// Relative errors: 9 in a corner (8 of its own, 1 of the subtraction), as many in an edge; 2 in the cross product, 3
/// in the dot product; and the bound's own rounding.
pub(crate) const ROUNDING: f64 = gamma64(32);

/// A triangle as seen from the origin of a ray, in f64.
struct Seen {
    corners: [DVec3; 3],
    /// Opposite to each corner.
    edges: [DVec3; 3],
    /// The signed volumes of the module's documentation, opposite to each corner. With the edge in place of its second
    /// corner, their terms are as small as the triangle, however far it is.
    volumes: [f64; 3],
    /// The sum of the volumes: the product of direction and normal.
    slope: f64,
    /// t times the slope.
    height: f64,
}

impl Seen {
    #[inline(always)]
    fn new(origin: DVec3, d: DVec3, [pa, pb, pc]: [DVec3; 3]) -> Self {
        let [a, b, c] = [pa - origin, pb - origin, pc - origin];
        let [ea, eb, ec] = [pc - pb, pa - pc, pb - pa];
        let normal = eb.cross(ec);
        Self {
            corners: [a, b, c],
            edges: [ea, eb, ec],
            volumes: [d.dot(b.cross(ea)), d.dot(c.cross(eb)), d.dot(a.cross(ec))],
            slope: d.dot(normal),
            height: a.dot(normal),
        }
    }

    #[inline(always)]
    fn hit(&self) -> TriangleHit {
        let &Self { volumes, slope, height, .. } = self;
        let inverse = 1.0 / slope;
        TriangleHit { t: height * inverse, u: volumes[1] * inverse, v: volumes[2] * inverse }
    }

    /// The same hit with u and v that a corner which is much farther away than another does not spoil: each volume is
    /// that of the nearer end of its edge, and the slope is their sum. None where that is not enough.
    #[cold]
    #[inline(never)]
    fn hit_of_sliver(&self, d: DVec3) -> Option<TriangleHit> {
        let ([a, b, c], [ea, eb, ec]) = (self.corners, self.edges);
        let far = [a, b, c].map(|p| p.abs().max_element());
        let nearer = |p: (DVec3, f64), q: (DVec3, f64)| if p.1 <= q.1 { p.0 } else { q.0 };
        let [a, b, c] = [(a, far[0]), (b, far[1]), (c, far[2])];
        let ends = [(nearer(b, c), ea), (nearer(c, a), eb), (nearer(a, b), ec)];
        // All of one sign, or zero for what rounding makes of the smallest.
        let [x, y, z] = ends.map(|(p, e)| (d.dot(p.cross(e)) * self.slope.signum()).max(0.0));
        let error = ends.iter().map(|(p, e)| d.abs().dot(permanent_cross(p.abs(), e.abs()))).fold(0.0, f64::max);
        let sum = x + y + z;
        let is_enough = ROUNDING * error <= sum * SLIVER_PRECISION;
        is_enough.then(|| TriangleHit { u: y / sum, v: z / sum, ..self.hit() })
    }
}

/// The relative error of t that is let pass: 2^-27, an eighth of an f32 step.
pub(crate) const T_PRECISION: f64 = 1.0 / (1 << 27) as f64;

/// The same by exact arithmetic; t is unbounded.
#[cold]
#[inline(never)]
fn intersect_exactly(origin: DVec3, direction: DVec3, corners: &impl Corners) -> Option<TriangleHit> {
    let in_f64 = corners.in_f64();
    // Without an area nothing hits it, and files hold thousands that are a point.
    if in_f64.is_some_and(|[a, b, c]| a == b || b == c || c == a) {
        return None;
    }
    count_decision();
    #[cfg(test)]
    tests::EXACT.with(|count| count.set(count.get() + 1));
    match exactly::Seen::in_integers(origin, direction, [in_f64]) {
        Some(seen) => seen.hit(),
        None => exactly::Seen::in_expansions(origin, direction, corners).hit(),
    }
}

/// The cross product with every minus made a plus: bounds the rounding error of the real one.
#[inline]
fn permanent_cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    thread_local! {
        /// How often this thread took the exact path.
        pub(super) static EXACT: std::cell::Cell<u32> = const { std::cell::Cell::new(0) };
    }

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn hits_with_weights_and_distance() {
        let ray = Ray::new(Vec3::new(0.25, 0.5, 2.0), Vec3::new(0.0, 0.0, -2.0));
        let hit = intersect(&ray, &CORNERS).expect("it passes inside");
        assert_eq!((hit.t, hit.u, hit.v), (1.0, 0.25, 0.5));
        assert!(intersect(&Ray { tmax: 0.999, ..ray }, &CORNERS).is_none());
        assert!(intersect(&Ray { tmin: 1.0, tmax: 1.0, ..ray }, &CORNERS).is_some(), "the range is closed");
    }

    #[test]
    fn corners_and_edges_count_as_inside() {
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)] {
            let ray = Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z);
            assert!(intersect(&ray, &CORNERS).is_some(), "({x}, {y})");
        }
    }

    #[test]
    fn one_step_outside_misses_and_inside_hits() {
        // Exact: y = next_down(0) on the bottom edge's line, seen obliquely so that nothing is zero by luck.
        for scale in [1e-12f32, 1.0, 1e9] {
            let corners = CORNERS.map(|p| p * scale);
            let outside = Vec3::new(0.3 * scale, -scale * 1e-7, 0.0);
            let direction = Vec3::new(0.1, 0.7, -1.3);
            // Power-of-two multiples, so that the origin is exact in f32 up to the tested offset.
            let origin = outside - direction * scale;
            let exact_y =
                f64::from(origin.y) + f64::from(direction.y) * (f64::from(origin.z) / f64::from(-direction.z));
            let hit = intersect(&Ray::new(origin, direction), &corners);
            assert_eq!(hit.is_some(), exact_y >= 0.0, "scale {scale}");
        }
    }

    /// Sums are compared without rounding: 1 less what is from a half on is exact.
    #[test]
    fn weights_stay_within() {
        let steps = [0.0, 5e-324, 1e-20, f64::EPSILON / 4.0, f64::EPSILON, 0.1, 1.0 / 3.0, 0.5];
        for (share, more) in steps.iter().flat_map(|&share| steps.map(|more| (share, more * 1e-6))) {
            for (u, v) in
                [(1.0 - share + more, share), (share, 1.0 - share + more), (1.0 + more, share), (-more, share)]
            {
                let [x, y] = weights_within(u, v);
                let (large, small) = (x.max(y), x.min(y));
                assert!(small >= 0.0 && small.is_sign_positive() && small <= 1.0 - large, "{u} {v}: {x} {y}");
                let off = (u + v - 1.0).max(0.0) + (-u).max(0.0) + f64::EPSILON;
                assert!((x - u).abs() <= off && (y - v).abs() <= off, "{u} {v}: {x} {y}");
            }
        }
        for [u, v] in [[0.25, 0.75], [0.1, 0.2], [0.0, 1.0], [1.0, 0.0], [0.3, 0.7]] {
            assert_eq!(weights_within(u, v), [u, v]);
        }
    }

    #[test]
    fn a_ray_in_the_plane_misses_and_a_flat_triangle_is_never_hit() {
        let in_plane = Ray::new(Vec3::new(-1.0, 0.5, 0.0), Vec3::X);
        assert!(intersect(&in_plane, &CORNERS).is_none());
        let ray = Ray::new(Vec3::new(0.5, 0.0, 1.0), Vec3::NEG_Z);
        assert!(intersect(&ray, &[Vec3::ZERO, Vec3::X * 0.5, Vec3::X]).is_none());
        assert!(intersect(&ray, &[Vec3::X * 0.5; 3]).is_none());
    }

    #[test]
    fn a_placed_triangle_equals_the_same_triangle_in_the_world() {
        let to_world = Affine3::from_scale_rotation_translation(
            Vec3::new(2.0, 4.0, 0.5),
            glam::Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
            Vec3::new(1.0, 2.0, 3.0),
        );
        // Exact corners in the world, where the rotation's rounded sine and cosine enter.
        let placed = Placed { corners: CORNERS, to_world: &to_world };
        let world = CORNERS.map(|p| to_world.transform_point3(p));
        let target = (world[0] + world[1] + world[2]) / 3.0;
        let ray = Ray::new(target + Vec3::new(0.3, 0.2, 5.0), Vec3::new(-0.3, -0.2, -5.0));
        let (a, b) = (intersect(&ray, &placed).expect("hit"), intersect(&ray, &world).expect("hit"));
        assert!((a.t - b.t).abs() < 1e-6 && (a.u - b.u).abs() < 1e-6 && (a.v - b.v).abs() < 1e-6, "{a:?} {b:?}");
    }

    /// Small triangles far from the origin, turned and scaled: what their corners are rounded by must not send every
    /// ray to exact arithmetic.
    #[test]
    fn placed_triangles_are_mostly_decided_in_f64() {
        let mut state = 7u32;
        let mut unit = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut point = |size: f32| Vec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5) * size;
        EXACT.set(0);
        let mut hits = 0;
        for _ in 0..1000 {
            let to_world = Affine3::from_scale_rotation_translation(
                Vec3::splat(3.0),
                glam::Quat::from_scaled_axis(point(6.0)),
                point(200.0),
            );
            let place = point(2.0);
            let corners = [place + point(0.01), place + point(0.01), place + point(0.01)];
            let world = corners.map(|p| to_world.transform_point3(p));
            let origin = point(100.0);
            let target = (world[0] + world[1] + world[2]) / 3.0 + point(0.02);
            let hit = intersect(&Ray::new(origin, target - origin), &Placed { corners, to_world: &to_world });
            hits += u32::from(hit.is_some());
        }
        assert!(hits > 100, "{hits}");
        assert!(EXACT.get() < 5, "{} of 1000", EXACT.get());
    }
}
