//! Primitives: one file each, with its bounds, its intersection, its normal and its parameters.
//!
//! Triangles go to the accelerators as meshes; every other shape is a variant of [`Shape`], which answers
//! [`bounds`](Shape::bounds) and [`intersect`](Shape::intersect) for the native leaves and for Embree's user geometry
//! alike. A closed family is an enum and not a trait object: the compiler lists every place a new shape must reach.

pub mod closest;
pub mod crossing;
mod sphere;
pub mod triangle;

pub use sphere::Sphere;

use crate::math::{Aabb, DVec3, Vec2, Vec3};
use crate::ray::Ray;

/// A primitive that is not a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere(Sphere),
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Distance in units of the ray's direction, in f64 so that near hits can be told apart.
    pub t: f64,
    /// The shape's own parameters at the hit.
    pub uv: Vec2,
}

impl Shape {
    /// A box that contains the shape; empty where the shape cannot be hit.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Sphere(sphere) => sphere.bounds(),
        }
    }

    /// The nearest intersection with `tmin <= t <= tmax`.
    pub fn intersect(&self, ray: &Ray) -> Option<ShapeHit> {
        match self {
            Self::Sphere(sphere) => sphere.intersect(ray),
        }
    }

    /// Every intersection with `tmin <= t <= tmax`; an even number over the whole line.
    pub fn intersect_all(&self, ray: &Ray) -> impl Iterator<Item = ShapeHit> {
        match self {
            Self::Sphere(sphere) => sphere.intersect_all(ray),
        }
    }

    /// The unit normal, outwards, at `point` on the surface.
    pub fn normal(&self, point: DVec3) -> DVec3 {
        match self {
            Self::Sphere(sphere) => sphere.normal(point),
        }
    }

    /// The same shape, moved.
    #[must_use]
    pub fn translated(&self, offset: DVec3) -> Self {
        let moved = |p: Vec3| (p.as_dvec3() + offset).as_vec3();
        match self {
            Self::Sphere(sphere) => Self::Sphere(Sphere { centre: moved(sphere.centre), ..*sphere }),
        }
    }
}
