//! Where a line crosses a shape, in exact arithmetic, by other formulas than the tracers'.
//!
//! Planes are met at a quotient. Round shapes are quadratics in t, expanded, with the discriminant b^2 - a c as it
//! stands: the numbers are integers, so nothing is lost; roots have 256 bits. Surfaces are tested one by one (the side
//! of a cylinder, each of its caps), and no solid is an intersection of intervals.
//!
//! A placed shape is not moved: the ray is, by the adjugate of the transform, and the shape's lengths are multiplied by
//! the determinant, so that nothing is divided.

use std::sync::Arc;

use super::exact::{Dyadic, Rational, Ring, Vector, cross, det, dot, vector, zip};
use crate::math::{Affine3, DVec3, Vec3};
use crate::ray::Ray;
use crate::shape::{Cone, Cuboid, Disk, Ellipsoid, Plane, Polygon, Shape, Sphere};

/// A crossing: t, and whether the line merely touches there (a silhouette, a rim, an edge or a corner).
pub(crate) type Crossing = (Rational, bool);

/// Every crossing, by rising t; none for a shape that cannot be hit. The ray is valid.
pub(crate) fn crossings(ray: &Ray, shape: &Shape, to_world: Option<&Affine3>) -> Vec<Crossing> {
    Line::new(ray, to_world).crossings(shape)
}

/// The same for a ray in the shape's own coordinates.
pub(crate) fn crossings_of(origin: DVec3, direction: DVec3, shape: &Shape) -> Vec<Crossing> {
    let [origin, direction] = [origin, direction].map(|v| v.to_array().map(number));
    Line { origin, direction, scale: number(1.0) }.crossings(shape)
}

/// A ray in a shape's own coordinates, times `scale`.
struct Line {
    origin: Vector<Dyadic>,
    direction: Vector<Dyadic>,
    scale: Dyadic,
}

fn number(x: f64) -> Dyadic {
    Dyadic::from_f64(x)
}

fn minus(a: &Vector<Dyadic>, b: &Vector<Dyadic>) -> Vector<Dyadic> {
    zip(a, b, Dyadic::sub)
}

fn times(v: &Vector<Dyadic>, x: &Dyadic) -> Vector<Dyadic> {
    v.each_ref().map(|component| component.mul(x))
}

impl Line {
    fn new(ray: &Ray, to_world: Option<&Affine3>) -> Self {
        let (origin, direction) = (vector(ray.origin), vector(ray.direction));
        let Some(m) = to_world else { return Self { origin, direction, scale: number(1.0) } };
        let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(vector::<Dyadic>);
        let rows = [cross(&y, &z), cross(&z, &x), cross(&x, &y)];
        let adjugate = |v: &Vector<Dyadic>| rows.each_ref().map(|row| dot(row, v));
        let from = minus(&origin, &vector(m.translation));
        Self { origin: adjugate(&from), direction: adjugate(&direction), scale: det(&x, &y, &z) }
    }

    fn crossings(&self, shape: &Shape) -> Vec<Crossing> {
        if shape.check().is_err() || shape.bounds().is_empty() && !shape.is_unbounded() {
            return Vec::new();
        }
        let mut found = match shape {
            Shape::Sphere(sphere) => self.sphere(sphere),
            Shape::Plane(plane) => self.plane(plane),
            Shape::Disk(disk) => self.disk(disk.centre, &vector(disk.normal), disk),
            Shape::Cuboid(cuboid) => self.cuboid(cuboid),
            Shape::Cylinder(c) => {
                let (radius, capped) = (c.radius, c.capped);
                self.cone(&Cone { base: c.base, base_radius: radius, apex: c.apex, apex_radius: radius, capped })
            }
            Shape::Cone(cone) => self.cone(cone),
            Shape::Ellipsoid(ellipsoid) => self.ellipsoid(ellipsoid),
            Shape::Polygon(polygon) => self.polygon(polygon),
        };
        found.sort_by(|a, b| a.0.cmp(&b.0));
        found
    }

    /// From a point of the shape to the line's origin.
    fn from(&self, p: Vec3) -> Vector<Dyadic> {
        minus(&self.origin, &times(&vector(p), &self.scale))
    }

    /// The roots of a t^2 + 2 b t + c.
    fn roots(a: &Dyadic, b: &Dyadic, c: &Dyadic) -> Vec<Crossing> {
        let discriminant = b.mul(b).sub(&a.mul(c));
        if discriminant.signum() < 0 {
            return Vec::new();
        }
        if a.signum() == 0 {
            return Rational::new(c.neg(), b.add(b)).map(|t| (t, false)).into_iter().collect();
        }
        let root = discriminant.sqrt();
        // The sum of two numbers of one sign, so that no digits cancel; the other root follows from their product c /
        // a.
        let q = if b.signum() > 0 { b.add(&root).neg() } else { root.sub(b) };
        let touches = discriminant.signum() == 0;
        let one = Rational::new(q.clone(), a.clone());
        // q is 0 only where both roots are.
        let other = Rational::new(c.clone(), q).or_else(|| one.clone());
        [one, other].into_iter().flatten().map(|t| (t, touches)).collect()
    }

    fn sphere(&self, sphere: &Sphere) -> Vec<Crossing> {
        let (f, d, r) = (self.from(sphere.centre), &self.direction, number(sphere.radius.into()).mul(&self.scale));
        Self::roots(&dot(d, d), &dot(&f, d), &dot(&f, &f).sub(&r.mul(&r)))
    }

    fn ellipsoid(&self, ellipsoid: &Ellipsoid) -> Vec<Crossing> {
        let m = ellipsoid.axes;
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(vector::<Dyadic>);
        let rows = [cross(&y, &z), cross(&z, &x), cross(&x, &y)];
        let adjugate = |v: &Vector<Dyadic>| rows.each_ref().map(|row| dot(row, v));
        let (f, d) = (adjugate(&self.from(ellipsoid.centre)), adjugate(&self.direction));
        let r = det(&x, &y, &z).mul(&self.scale);
        Self::roots(&dot(&d, &d), &dot(&f, &d), &dot(&f, &f).sub(&r.mul(&r)))
    }

    /// Where the line meets the plane through a point that is `from` the origin: t as a fraction.
    fn meet(&self, normal: &Vector<Dyadic>, from: &Vector<Dyadic>) -> Option<[Dyadic; 2]> {
        let (way, speed) = (dot(normal, from).neg(), dot(normal, &self.direction));
        (speed.signum() != 0).then_some([way, speed])
    }

    fn plane(&self, plane: &Plane) -> Vec<Crossing> {
        let met = self.meet(&vector(plane.normal), &self.from(plane.point));
        met.and_then(|[way, speed]| Rational::new(way, speed)).map(|t| (t, false)).into_iter().collect()
    }

    /// Of the disk around `centre`, but across `normal`.
    fn disk(&self, centre: Vec3, normal: &Vector<Dyadic>, disk: &Disk) -> Vec<Crossing> {
        let from = self.from(centre);
        let Some([way, speed]) = self.meet(normal, &from) else { return Vec::new() };
        // From the centre to the point that is met, times the speed.
        let out = zip(&times(&from, &speed), &times(&self.direction, &way), Dyadic::add);
        let r = number(disk.radius.into()).mul(&self.scale).mul(&speed);
        let outside = dot(&out, &out).sub(&r.mul(&r)).signum();
        let t = Rational::new(way, speed).filter(|_| outside <= 0);
        t.map(|t| (t, outside == 0)).into_iter().collect()
    }

    fn cuboid(&self, cuboid: &Cuboid) -> Vec<Crossing> {
        // Each face by itself: its plane, and the two other coordinates of the point there.
        let mut found = Vec::new();
        for axis in 0..3 {
            for corner in [cuboid.min, cuboid.max] {
                let from = self.from(corner);
                let Some(t) = Rational::new(from[axis].neg(), self.direction[axis].clone()) else { continue };
                let (mut is_inside, mut touches) = (true, false);
                for other in [(axis + 1) % 3, (axis + 2) % 3] {
                    let sign = |corner: Vec3| t.sign_of(&self.from(corner)[other], &self.direction[other]);
                    // Under a negative scale the order is turned.
                    let (low, high) = (sign(cuboid.min), sign(cuboid.max));
                    is_inside &= low * high <= 0;
                    touches |= low * high == 0;
                }
                if is_inside {
                    found.push((t, touches));
                }
            }
        }
        found
    }

    fn cone(&self, cone: &Cone) -> Vec<Crossing> {
        let d = &self.direction;
        let f = self.from(cone.base);
        let axis = times(&minus(&vector(cone.apex), &vector(cone.base)), &self.scale);
        // Lengths are positive, whatever the sign of the scale.
        let length = |r: f32| number(r.into()).mul(&self.scale).mul(&number(self.scale.signum().into()));
        let r = length(cone.base_radius);
        let k = length(cone.apex_radius).sub(&r);
        let (aa, fa, da) = (dot(&axis, &axis), dot(&f, &axis), dot(d, &axis));
        let g = r.mul(&aa).add(&k.mul(&fa));
        let h = k.mul(&da);
        // a^2 (v^2 a^2 - (v . a)^2) - (r a^2 + k v . a)^2 for v = f + t d.
        let coefficient = |u: &Vector<Dyadic>, v: &Vector<Dyadic>, ua: &Dyadic, va: &Dyadic, g: &Dyadic, h: &Dyadic| {
            aa.mul(&dot(u, v).mul(&aa).sub(&ua.mul(va))).sub(&g.mul(h))
        };
        let (a, b, c) = (
            coefficient(d, d, &da, &da, &h, &h),
            coefficient(&f, d, &fa, &da, &g, &h),
            coefficient(&f, &f, &fa, &fa, &g, &g),
        );
        let mut found = Vec::new();
        for (t, touches) in Self::roots(&a, &b, &c) {
            let (base, apex) = (t.sign_of(&fa, &da), t.sign_of(&fa.sub(&aa), &da));
            if base >= 0 && apex <= 0 {
                found.push((t, touches || base == 0 || apex == 0));
            }
        }
        if cone.capped {
            for (centre, radius) in [(cone.base, cone.base_radius), (cone.apex, cone.apex_radius)] {
                let disk = Disk { centre, normal: Vec3::Y, radius };
                found.extend(self.disk(centre, &axis, &disk));
            }
        }
        found
    }

    fn polygon(&self, polygon: &Polygon) -> Vec<Crossing> {
        let exact = |v: DVec3| v.to_array().map(number);
        let (centre, normal) = polygon.plane();
        let from = minus(&self.origin, &times(&exact(centre), &self.scale));
        let met = self.meet(&exact(normal), &from);
        let Some(mut t) = met.and_then(|[way, speed]| Rational::new(way, speed)) else { return Vec::new() };
        // Where the corners are not quite in one plane, hits stay within their bounds.
        let bounds = Shape::Polygon(Arc::new(polygon.clone())).bounds();
        for axis in 0..3 {
            let at = |corner: Vec3| Rational::new(self.from(corner)[axis].neg(), self.direction[axis].clone());
            if let (Some(low), Some(high)) = (at(bounds.min), at(bounds.max)) {
                let (enter, exit) = if low < high { (low, high) } else { (high, low) };
                t = t.max(enter).min(exit);
            }
        }
        let d = &self.direction;
        let corners: Vec<Vector<Dyadic>> = polygon.corners().iter().map(|&p| self.from(p)).collect();
        // An axis that is not along the direction; the corners' coordinate across both, of which 0 counts as below.
        let sizes = d.each_ref().map(|x| x.to_f64().abs());
        let axis = (0..3).max_by(|&i, &j| sizes[i].total_cmp(&sizes[j])).unwrap_or(0);
        let (i, j) = ((axis + 1) % 3, axis);
        let above = |v: &Vector<Dyadic>| d[i].mul(&v[j]).sub(&d[j].mul(&v[i])).signum();
        let dd = dot(d, d);
        let (mut inside, mut touches) = (false, false);
        for k in 0..corners.len() {
            let (p, q) = (&corners[k], &corners[(k + 1) % corners.len()]);
            let volume = dot(d, &cross(p, q)).signum();
            // Seen along the line, the ends are on opposite sides of it: the product of what is across the line is not
            // positive.
            let across = dot(p, q).mul(&dd).sub(&dot(d, p).mul(&dot(d, q))).signum();
            touches |= volume == 0 && across <= 0;
            let (from, to) = (above(p) > 0, above(q) > 0);
            if from != to {
                inside ^= (volume > 0) == to;
            }
        }
        if inside || touches { vec![(t, touches)] } else { Vec::new() }
    }
}
