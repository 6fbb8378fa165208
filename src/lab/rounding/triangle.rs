//! What may be answered for a triangle: the bounds of its edges and of t, term by term as the parent has them.

use super::super::exact::{Approx, Ring, cross, det, dot, vector, zip};
use super::super::oracle::place;
use super::*;

pub(super) fn outcome(
    ray: &Ray,
    corners: [Vec3; 3],
    to_world: Option<&Affine3>,
    local: &LocalRay,
    precision: Precision,
) -> Outcome {
    let (g, u) = (precision.gamma(), precision.unit());
    // Values are formed in the world, where they can be had with an error bound, and brought to the triangle's own
    // coordinates, where the engine's errors arise.
    let world = WorldValues::new(ray, corners, to_world);
    let scale = local.determinant.abs().recip();
    let value = |x: Approx| (x.value * scale, x.error * scale);

    let [pa, pb, pc] = corners.map(|p| p.as_dvec3());
    let sides = [pc - pb, pa - pc, pb - pa];
    let [a, b, c] = [pa, pb, pc].map(|p| p - local.origin);
    let (d, size) = (local.direction, [a.abs(), b.abs(), c.abs()]);
    let (o_error, d_error) = (local.origin_error, local.direction_error);
    // Of what is small times small, with room to spare.
    let second_order = |x: DVec3, y: DVec3, side: DVec3| {
        permanent(d.abs(), x + y, x + y) * g * u + permanent(d_error, o_error, side.abs())
    };

    let (sum, sum_own) = value(world.sum);
    let (mut negative, mut positive, mut unsure) = (false, false, false);
    let mut weights = [0.0; 3];
    for k in 0..3 {
        let (e, own) = value(world.edges[k]);
        let ((x, y), side) = ([(b, c), (c, a), (a, b)][k], sides[k]);
        let corners_rounded = u * (x.abs().dot(d.cross(y).abs()) + y.abs().dot(d.cross(x).abs()));
        let computed = g * permanent(d.abs(), side.abs(), x.abs() + y.abs());
        let ray_moved = o_error.dot(d.cross(side).abs()) + d_error.dot(x.cross(y).abs());
        let accepted = 4.0 * u * sum.abs();
        let bound = corners_rounded + computed + ray_moved + second_order(x.abs(), y.abs(), side) + accepted + own;
        negative |= e < -bound;
        positive |= e > bound;
        // Written so that NaN, from an overflow, gives true.
        unsure |= !(e.abs() > bound);
        weights[k] = e.abs() + bound;
    }

    let (n, longest) = (sides[0].cross(sides[1]).abs(), sides[0].abs().max(sides[1].abs()).max(sides[2].abs()));
    let farthest = size[0].max(size[1]).max(size[2]);
    let corners_rounded: f64 = (0..3).map(|k| u * size[k].dot(d.cross(sides[k]).abs())).sum();
    let computed = g * permanent(d.abs(), longest, longest);
    let sum_error =
        corners_rounded + computed + n.dot(d_error) + g * u * permanent(d.abs(), farthest, farthest) + sum_own;
    let slack = sum.abs() - sum_error;
    let grazing = !(slack > 0.0);
    let root = if grazing {
        ANYWHERE
    } else {
        let (volume, volume_own) = value(world.volume);
        let t = volume / sum;
        // A corner that is moved moves the hit by its weight there.
        let corners_rounded: f64 = (0..3).map(|k| u * n.dot(size[k]) * weights[k] / slack).sum();
        let computed = g * (permanent(farthest, longest, longest) + t.abs() * permanent(d.abs(), longest, longest));
        let ray_moved = n.dot(o_error) + t.abs() * n.dot(d_error);
        let second_order = g * u * permanent(farthest, farthest, farthest);
        let own = volume_own + t.abs() * sum_own;
        around(t, (corners_rounded + computed + ray_moved + second_order + own) / slack + 8.0 * u * t.abs())
    };
    let mixed = negative && positive;
    Outcome { may_meet: !mixed, may_pass: mixed || unsure || grazing, roots: [root; 2] }
}

/// What a triangle's answer is made of, in the world, in f64.
struct WorldValues {
    /// Opposite to each corner.
    edges: [Approx; 3],
    /// Of the edges; also the product of direction and normal.
    sum: Approx,
    /// t times the sum.
    volume: Approx,
}

impl WorldValues {
    fn new(ray: &Ray, corners: [Vec3; 3], to_world: Option<&Affine3>) -> Self {
        let (origin, d) = (vector::<Approx>(ray.origin), vector::<Approx>(ray.direction));
        let p = corners.map(|p| place::<Approx>(p, to_world));
        let [a, b, c] = p.each_ref().map(|p| zip(p, &origin, Approx::sub));
        let side = |i: usize, j: usize| zip(&p[j], &p[i], Approx::sub);
        let (ab, bc, ca) = (side(0, 1), side(1, 2), side(2, 0));
        let n = cross(&ab, &bc);
        // Sides instead of second corners: far from the origin the corners are nearly parallel.
        Self { edges: [det(&d, &b, &bc), det(&d, &c, &ca), det(&d, &a, &ab)], sum: dot(&d, &n), volume: dot(&a, &n) }
    }
}
