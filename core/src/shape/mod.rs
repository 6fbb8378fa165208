//! Primitives: one file each, with its bounds, its intersection, its normal and its parameters.
//!
//! Triangles go to the accelerators as meshes; every other shape is a variant of [`Shape`], which answers
//! [`bounds`](Shape::bounds) and [`intersect`](Shape::intersect) for the native leaves and for Embree's user geometry
//! alike. A closed family is an enum and not a trait object, so that the compiler lists what a new shape must reach. It
//! does not list how it is made a [`Shape`] (`from_kinds` below) and named to users of the crates (both `lib.rs`), how
//! it is read from a file (`DShape` and, if it is unbounded, `local_origin` in `src/io/dshape.rs`; `SINGLES` in
//! `src/io/toml/primitives.rs`, under the name that [`Shape::name`] gives it, by which it is written as well), what
//! other formats have for it (`check` in `src/io/save/nff.rs`), which kinds tests go through (`Kind` in
//! `src/lab/shape_tests.rs`, `shapes` in `tests/shapes.rs`, `Kind` in `tests/accelerators/subjects.rs` and the lists in
//! `matrix.rs` beside it, `TABLES` in `tests/io/local_origins.rs`, `primitive` in `tests/io/placements.rs`, the shapes
//! in `core/src/shade/normal_map.rs`; `src/lab/stress/quadrics.rs`), what `scenes/primitives` shows, and what
//! docs/SCENES.md says of it.

mod axis;
pub mod closest;
mod cone;
pub mod crossing;
mod cuboid;
mod cylinder;
mod disk;
pub mod distance;
mod ellipsoid;
mod exactly;
mod flat;
mod line;
mod outline;
mod plane;
mod polygon;
mod quadric;
mod round;
mod sphere;
mod sphere_methods;
pub mod triangle;
mod triangle_methods;

use std::sync::Arc;

pub use cone::Cone;
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use ellipsoid::Ellipsoid;
pub use plane::Plane;
pub use polygon::Polygon;
pub use sphere::Sphere;
pub use sphere_methods::SphereMethod;
pub use triangle_methods::TriangleMethod;

use crate::error::Error;
use crate::math::{Aabb, DVec2, DVec3, MAX_COORDINATE, Vec2, Vec3, is_traceable};
use crate::ray::Ray;
use distance::Support;
use line::{NO_ROOTS, Roots};

/// A primitive that is not a triangle.
///
/// Whether a line hits is decided exactly, for the shape and the ray that stand there in f32: where f64 leaves a doubt,
/// in exact arithmetic. What touches hits; a line within a plane, a disk, a polygon or an open side does not.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere(Sphere),
    /// An unbounded plane.
    Plane(Plane),
    /// A disk.
    Disk(Disk),
    /// A box along the axes.
    Cuboid(Cuboid),
    /// A cylinder, open or capped.
    Cylinder(Cylinder),
    /// A cone or a part of one, open or capped.
    Cone(Cone),
    /// An ellipsoid.
    Ellipsoid(Ellipsoid),
    /// A polygon, convex or not.
    Polygon(Arc<Polygon>),
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Distance in units of the ray's direction, in f64 so that near hits can be told apart; off by at most 2^-26 of
    /// itself.
    pub t: f64,
    /// The shape's own parameters at the hit.
    pub uv: Vec2,
}

/// Why numbers make no shape, and what would.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct InvalidShape(String);

impl InvalidShape {
    fn unless(holds: bool, message: impl FnOnce() -> String) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self(message())) }
    }

    fn unless_radius(radius: f32) -> Result<(), Self> {
        let holds = radius > 0.0 && is_traceable(Vec3::splat(radius));
        Self::unless(holds, || format!("the radius is {radius:?}; it must be above 0 and at most {MAX_COORDINATE:e}"))
    }

    fn unless_direction(name: &str, v: Vec3) -> Result<(), Self> {
        let holds = v.is_finite() && v.abs().max_element() >= f32::MIN_POSITIVE;
        Self::unless(holds, || format!("the {name} is {v}; it must be finite and not zero"))
    }
}

impl From<InvalidShape> for Error {
    fn from(wrong: InvalidShape) -> Self {
        Self::Usage(wrong.0)
    }
}

/// Each kind as the shape that it is.
macro_rules! from_kinds {
    ($($kind:ident),*) => {
        $(impl From<$kind> for Shape {
            fn from(shape: $kind) -> Self {
                Self::$kind(shape)
            }
        })*
    };
}

from_kinds!(Sphere, Plane, Disk, Cuboid, Cylinder, Cone, Ellipsoid);

impl From<Polygon> for Shape {
    fn from(polygon: Polygon) -> Self {
        Self::Polygon(Arc::new(polygon))
    }
}

impl Shape {
    /// Whether it can be hit.
    ///
    /// # Errors
    /// What is wrong with it, and what would be right. A shape that fails cannot be hit.
    pub fn check(&self) -> Result<(), InvalidShape> {
        match self {
            Self::Sphere(sphere) => sphere.check(),
            Self::Plane(plane) => plane.check(),
            Self::Disk(disk) => disk.check(),
            Self::Cuboid(cuboid) => cuboid.check(),
            Self::Cylinder(cylinder) => cylinder.check(),
            Self::Cone(cone) => cone.check(),
            Self::Ellipsoid(ellipsoid) => ellipsoid.check(),
            // Nothing else is ever made.
            Self::Polygon(_) => Ok(()),
        }
    }

    /// What it is, in a word.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Sphere(_) => "sphere",
            Self::Plane(_) => "plane",
            Self::Disk(_) => "disk",
            Self::Cuboid(_) => "box",
            Self::Cylinder(_) => "cylinder",
            Self::Cone(_) => "cone",
            Self::Ellipsoid(_) => "ellipsoid",
            Self::Polygon(_) => "polygon",
        }
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        let corners = match self {
            Self::Polygon(polygon) => polygon.bytes(),
            Self::Sphere(_)
            | Self::Plane(_)
            | Self::Disk(_)
            | Self::Cuboid(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Ellipsoid(_) => 0,
        };
        size_of::<Self>() + corners
    }

    /// Whether no box contains it. Accelerators hold no such shape: tracers ask all of them for every ray.
    pub const fn is_unbounded(&self) -> bool {
        match self {
            Self::Plane(_) => true,
            Self::Sphere(_)
            | Self::Disk(_)
            | Self::Cuboid(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Ellipsoid(_)
            | Self::Polygon(_) => false,
        }
    }

    /// A box that contains the shape; empty where the shape cannot be hit, and where it [has no
    /// bounds](Self::is_unbounded).
    pub fn bounds(&self) -> Aabb {
        if self.check().is_err() {
            return Aabb::EMPTY;
        }
        match self {
            Self::Sphere(sphere) => sphere.bounds(),
            Self::Plane(_) => Aabb::EMPTY,
            Self::Disk(disk) => disk.bounds(),
            Self::Cuboid(cuboid) => cuboid.bounds(),
            Self::Cylinder(cylinder) => cylinder.frustum().bounds(),
            Self::Cone(cone) => cone.frustum().bounds(),
            Self::Ellipsoid(ellipsoid) => ellipsoid.bounds(),
            Self::Polygon(polygon) => polygon.bounds(),
        }
    }

    /// The nearest intersection that is not behind the origin, with `tmin <= t <= tmax`, for t rounded to f32.
    pub fn intersect(&self, ray: &Ray) -> Option<ShapeHit> {
        self.intersect_all(ray).next()
    }

    /// Every intersection that is not behind the origin, with `tmin <= t <= tmax`, the nearest first; an even number
    /// over the whole line for closed shapes, of which a line that touches crosses twice in one place.
    pub fn intersect_all(&self, ray: &Ray) -> impl Iterator<Item = ShapeHit> {
        let ray = *ray;
        self.crossings(&ray).map(move |t| self.hit_at(&ray, t))
    }

    /// The t of [`Shape::intersect_all`] by themselves. Angles cost more than the intersection, so tracers ask for the
    /// parameters of what is nearest so far, and of nothing else.
    #[inline]
    #[doc(hidden)]
    pub fn crossings(&self, ray: &Ray) -> impl Iterator<Item = f64> + use<> {
        let ray = *ray;
        self.roots(&ray).into_iter().flatten().filter(move |&t| ray.reaches(t))
    }

    /// The hit at a known `t`.
    #[doc(hidden)]
    pub fn hit_at(&self, ray: &Ray, t: f64) -> ShapeHit {
        ShapeHit { t, uv: self.uv(ray.origin.as_dvec3() + ray.direction.as_dvec3() * t).as_vec2() }
    }

    /// What the `t` of one of its [`crossings`](Self::crossings) follows from.
    pub(crate) fn support(&self, ray: &Ray, t: f64) -> Support {
        match self {
            Self::Plane(plane) => Support::Plane(plane.point.as_dvec3(), plane.normal.as_dvec3()),
            Self::Disk(disk) => Support::Plane(disk.centre.as_dvec3(), disk.normal.as_dvec3()),
            Self::Cuboid(cuboid) => cuboid.support(ray, t),
            Self::Polygon(polygon) => polygon.support(ray, t),
            Self::Sphere(_) | Self::Cylinder(_) | Self::Cone(_) | Self::Ellipsoid(_) => Support::Itself,
        }
    }

    /// Where the line crosses it.
    fn roots(&self, ray: &Ray) -> Roots {
        if !ray.is_valid() || self.check().is_err() {
            return NO_ROOTS;
        }
        match self {
            Self::Sphere(sphere) => sphere.roots(ray),
            Self::Plane(plane) => plane.roots(ray),
            Self::Disk(disk) => disk.roots(ray),
            Self::Cuboid(cuboid) => cuboid.roots(ray),
            Self::Cylinder(cylinder) => cylinder.roots(ray),
            Self::Cone(cone) => cone.roots(ray),
            Self::Ellipsoid(ellipsoid) => ellipsoid.roots(ray),
            Self::Polygon(polygon) => polygon.roots(ray),
        }
    }

    /// The unit normal, outwards, at `point` on the surface. Flat shapes have one side that is outside.
    pub fn normal(&self, point: DVec3) -> DVec3 {
        match self {
            Self::Sphere(sphere) => sphere.normal(point),
            Self::Plane(plane) => plane.normal(),
            Self::Disk(disk) => disk.normal(),
            Self::Cuboid(cuboid) => cuboid.normal(point),
            Self::Cylinder(cylinder) => cylinder.frustum().at(point).0,
            Self::Cone(cone) => cone.frustum().at(point).0,
            Self::Ellipsoid(ellipsoid) => ellipsoid.normal(point),
            Self::Polygon(polygon) => polygon.normal(),
        }
    }

    /// Its parameters at `point` on the surface, before they are rounded.
    #[doc(hidden)]
    pub fn uv(&self, point: DVec3) -> DVec2 {
        match self {
            Self::Sphere(sphere) => sphere.uv(point),
            Self::Plane(plane) => plane.uv(point),
            Self::Disk(disk) => disk.uv(point),
            Self::Cuboid(cuboid) => cuboid.uv(point),
            Self::Cylinder(cylinder) => cylinder.frustum().at(point).1,
            Self::Cone(cone) => cone.frustum().at(point).1,
            Self::Ellipsoid(ellipsoid) => ellipsoid.uv(point),
            Self::Polygon(polygon) => polygon.uv(point),
        }
    }

    /// The same shape, moved.
    #[must_use]
    pub fn translated(&self, offset: DVec3) -> Self {
        match self {
            Self::Sphere(sphere) => Self::Sphere(sphere.translated(offset)),
            Self::Plane(plane) => Self::Plane(plane.translated(offset)),
            Self::Disk(disk) => Self::Disk(disk.translated(offset)),
            Self::Cuboid(cuboid) => Self::Cuboid(cuboid.translated(offset)),
            Self::Cylinder(cylinder) => Self::Cylinder(cylinder.translated(offset)),
            Self::Cone(cone) => Self::Cone(cone.translated(offset)),
            Self::Ellipsoid(ellipsoid) => Self::Ellipsoid(ellipsoid.translated(offset)),
            Self::Polygon(polygon) if offset == DVec3::ZERO => Self::Polygon(Arc::clone(polygon)),
            Self::Polygon(polygon) => Self::Polygon(Arc::new(polygon.translated(offset))),
        }
    }
}

/// A point rounded once.
fn in_f32(p: DVec3) -> Vec3 {
    p.as_vec3()
}
