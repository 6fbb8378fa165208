//! Primitives of every kind, each with the places where methods fail, and rays of every class aimed there.

use std::sync::Arc;

use twincast::math::{DAffine3, Mat3, Vec3};
use twincast::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Plane, Polygon, Ray, Shape, Sphere};

use crate::scenes::Random;

/// A kind of primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Triangle,
    Sphere,
    Plane,
    Disk,
    Box,
    Cylinder,
    OpenCylinder,
    Cone,
    OpenCone,
    Ellipsoid,
    ConvexPolygon,
    ConcavePolygon,
}

/// What a primitive is.
#[derive(Clone, Debug)]
pub enum Body {
    Triangle([Vec3; 3]),
    Shape(Shape),
}

/// A primitive and where it is difficult.
#[derive(Clone, Debug)]
pub struct Subject {
    pub body: Body,
    /// Corners, and points of rims and silhouettes; each is joined to the next by an edge, if there are edges.
    pub corners: Vec<Vec3>,
    /// Points, and a direction in which a line touches there or lies in the surface.
    pub tangents: Vec<(Vec3, Vec3)>,
    /// Inside of what is closed, and on what is flat.
    pub middle: Vec3,
}

/// Where rays go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// From around to near the primitive: nothing about it is special.
    Random,
    /// From inside.
    Inside,
    /// Along the surface, some of them moved by the last bit of a coordinate.
    Tangent,
    /// Through corners, tips and rims.
    Corner,
    /// Through edges.
    Edge,
    /// Through a corner and along an axis, with zeros of both signs.
    Axis,
    /// Through a corner, with one component of the direction that is zero.
    Zero,
    /// From a point of the surface.
    Surface,
    /// From so far away that f32 has few digits left.
    Far,
}

impl Class {
    pub const ALL: [Self; 9] = [
        Self::Random,
        Self::Inside,
        Self::Tangent,
        Self::Corner,
        Self::Edge,
        Self::Axis,
        Self::Zero,
        Self::Surface,
        Self::Far,
    ];
}

/// A multiple of 1/8, so that what is meant to touch does so to the last bit.
fn on_grid(p: Vec3) -> Vec3 {
    (p * 8.0).round() / 8.0
}

/// Three directions at right angles: axes in any order, or, rounded, any others.
fn frame(random: &mut Random) -> [Vec3; 3] {
    let turn = random.below(3);
    if random.below(2) == 0 {
        return [0, 1, 2].map(|i| Vec3::AXES[(i + turn) % 3]);
    }
    let z = random.vec3().normalize_or(Vec3::Z);
    let (x, y) = z.any_orthonormal_pair();
    [x, y, z]
}

/// Where edges start, and their directions.
fn edges(corners: &[Vec3]) -> Vec<(Vec3, Vec3)> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(&from, &to)| (from, to - from)).collect()
}

impl Subject {
    /// A primitive of about the size 1, within 2 of zero on each axis.
    pub fn new(kind: Kind, random: &mut Random) -> Self {
        let middle = on_grid(random.vec3());
        let length = |random: &mut Random| (2 + random.below(5)) as f32 / 8.0;
        let (r, h) = (length(random), length(random));
        let [x, y, z] = frame(random);
        let flat =
            |points: &[(f32, f32)]| points.iter().map(|&(a, b)| middle + (x * a + y * b) * r).collect::<Vec<_>>();
        let tip = middle + z * h;
        let rim = vec![middle + x * r, middle - y * r, middle - x * r];
        match kind {
            Kind::Triangle => {
                let corners = [(); 3].map(|()| middle + on_grid(random.vec3()));
                if (corners[1] - corners[0]).cross(corners[2] - corners[0]) == Vec3::ZERO {
                    return Self::new(kind, random);
                }
                let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
                Self { body: Body::Triangle(corners), corners: corners.to_vec(), tangents: edges(&corners), middle }
            }
            Kind::Sphere => {
                let body = Body::Shape(Shape::Sphere(Sphere { centre: middle, radius: r }));
                let tangents = vec![(rim[0], y), (rim[1], x), (rim[2], z)];
                Self { body, corners: rim, tangents, middle }
            }
            Kind::Plane => {
                let body = Body::Shape(Shape::Plane(Plane::new(middle, z * h).expect("a plane")));
                Self { body, tangents: vec![(middle, x), (rim[0], y), (tip, x)], corners: rim, middle }
            }
            Kind::Disk => {
                let body = Body::Shape(Shape::Disk(Disk::new(middle, z * h, r).expect("a disk")));
                // In its plane, and across it through the edge.
                Self { body, tangents: vec![(rim[0], y), (rim[1], z), (middle, x)], corners: rim, middle }
            }
            Kind::Box => {
                let (low, high) = (middle - Vec3::new(r, h, r), middle + Vec3::new(h, r, h));
                let body = Body::Shape(Shape::Cuboid(Cuboid::new(low, high).expect("a box")));
                let corners = vec![low, low.with_x(high.x), high.with_z(low.z), high];
                let tangents =
                    vec![(low, Vec3::X), (high, Vec3::NEG_Z), (low, Vec3::new(0.0, 1.0, 2.0)), (high, x + y)];
                Self { body, corners, tangents, middle }
            }
            Kind::Cylinder | Kind::OpenCylinder => {
                let capped = kind == Kind::Cylinder;
                let body = Body::Shape(Shape::Cylinder(Cylinder::new(middle, tip, r, capped).expect("a cylinder")));
                // Along the side, across it, and in the plane of an end.
                let tangents = vec![(rim[0], z), (rim[1] + z * (h / 2.0), x), (tip, y), (rim[2], y)];
                Self { body, corners: rim, tangents, middle: middle + z * (h / 2.0) }
            }
            Kind::Cone | Kind::OpenCone => {
                let end = if random.below(2) == 0 { 0.0 } else { r / 2.0 };
                let cone = Cone::new(middle, r, tip, end, kind == Kind::Cone).expect("a cone");
                let slope = tip + x * end - rim[0];
                let tangents = vec![(rim[0], slope), (tip, y), (rim[1], x), (middle, x)];
                let corners = [rim, vec![tip + x * end]].concat();
                Self { body: Body::Shape(Shape::Cone(cone)), corners, tangents, middle: middle + z * (h / 4.0) }
            }
            Kind::Ellipsoid => {
                let axes = Mat3::from_cols(x * r, y * h, z * (r + h));
                let body = Body::Shape(Shape::Ellipsoid(Ellipsoid::new(middle, axes).expect("an ellipsoid")));
                let corners = vec![middle + axes.x_axis, middle - axes.y_axis, middle + axes.z_axis];
                let tangents = vec![(corners[0], y), (corners[1], z), (corners[2], x)];
                Self { body, corners, tangents, middle }
            }
            Kind::ConvexPolygon => Self::polygon(
                middle,
                flat(&[(2.0, 0.0), (1.0, 1.5), (-1.0, 1.5), (-2.0, 0.0), (-1.0, -1.5), (1.0, -1.5)]),
            ),
            Kind::ConcavePolygon => {
                // A comb, of which several corners are in a row.
                let comb = [(-1.0, -2.0), (2.0, -2.0), (2.0, -1.0), (1.0, -1.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0)];
                let rest = [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (0.0, 2.5), (-1.0, 2.0), (-1.5, 0.0)];
                Self::polygon(middle, flat(&[&comb[..], &rest[..]].concat()))
            }
        }
    }

    fn polygon(middle: Vec3, corners: Vec<Vec3>) -> Self {
        let polygon = Polygon::new(corners.clone()).expect("a polygon");
        Self { body: Body::Shape(Shape::Polygon(Arc::new(polygon))), tangents: edges(&corners), corners, middle }
    }

    /// Where it is difficult, elsewhere; what it is stays as it was.
    pub fn moved(&self, to_world: &DAffine3) -> Self {
        let point = |p: Vec3| to_world.transform_point3(p.as_dvec3()).as_vec3();
        let way = |v: Vec3| to_world.transform_vector3(v.as_dvec3()).as_vec3();
        Self {
            body: self.body.clone(),
            corners: self.corners.iter().map(|&p| point(p)).collect(),
            tangents: self.tangents.iter().map(|&(p, v)| (point(p), way(v))).collect(),
            middle: point(self.middle),
        }
    }

    /// A ray of a class.
    pub fn ray(&self, class: Class, random: &mut Random) -> Ray {
        let around = self.middle + random.vec3() * 4.0;
        let near = self.middle + random.vec3();
        let i = random.below(self.corners.len());
        let corner = self.corners[i];
        let on_edge =
            corner.lerp(self.corners[(i + 1) % self.corners.len()], [0.5, 0.25, random.unit()][random.below(3)]);
        let between = |from: Vec3, to: Vec3| Ray::new(from, to - from);
        // Powers of two round nothing.
        let [step, pace] = [(); 2].map(|()| 2f32.powi(random.below(7) as i32 - 3));
        match class {
            Class::Random => between(around, near),
            Class::Inside => Ray::new(self.middle, random.vec3()),
            Class::Tangent => {
                let (mut point, along) = self.tangents[random.below(self.tangents.len())];
                let axis = random.below(3);
                point[axis] = [point[axis], point[axis].next_up(), point[axis].next_down()][random.below(3)];
                Ray::new(point - along * step * 8.0, along * pace)
            }
            Class::Corner => between(around, corner),
            Class::Edge => between(around, on_edge),
            Class::Axis => {
                let axis = random.below(3);
                let mut direction = Vec3::from_array([(); 3].map(|()| [0.0, -0.0][random.below(2)]));
                direction[axis] = [pace, -pace][random.below(2)];
                let mut from = corner;
                from[axis] -= direction[axis] * 16.0;
                Ray::new(from, direction)
            }
            Class::Zero => {
                let mut direction = Vec3::from_array([(); 3].map(|()| (random.below(7) as f32 - 3.0) * pace));
                direction[random.below(3)] = [0.0, -0.0][random.below(2)];
                Ray::new(corner - direction * 8.0, direction)
            }
            Class::Surface => {
                let from = [corner, on_edge][random.below(2)];
                Ray::new(from, [random.vec3(), self.middle - from, from - self.middle][random.below(3)])
            }
            Class::Far => {
                let target = [corner, on_edge, near][random.below(3)];
                between(target + random.vec3() * [1e3, 1e5, 1e7][random.below(3)], target)
            }
        }
    }
}
