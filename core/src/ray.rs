//! What is asked of a tracer, and what it answers.

use crate::math::Vec3;

/// A half-line with a valid range. A hit counts if it is not behind the origin, and for `tmin <= t <= tmax`, t being
/// rounded to f32.
///
/// In memory in the order of the fields, so that what a tree is asked for, the first eight f32, is loaded as two
/// vectors of four.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Ray {
    /// Start, in world coordinates (recentred scene units): [`World::ray`](crate::World::ray) makes rays of the
    /// scene's.
    pub origin: Vec3,
    /// Direction; need not be a unit vector.
    pub direction: Vec3,
    /// Nearest valid t, at least 0.
    pub tmin: f32,
    /// Farthest valid t; may be infinite. A ray with `tmax < tmin` hits nothing.
    pub tmax: f32,
    /// When it looks: from 0, where things start to move, to 1, where they end; a camera's shutter is open for a part
    /// of it. Only scenes in which something moves heed it.
    pub time: f32,
}

impl Ray {
    /// A ray over [0, infinity], at time 0.
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, tmin: 0.0, tmax: f32::INFINITY, time: 0.0 }
    }

    /// Its time as tracers take it: before 0, and NaN, is 0, after 1 is 1.
    #[inline]
    pub fn moment(&self) -> f32 {
        if self.time > 0.0 { self.time.min(1.0) } else { 0.0 }
    }

    /// Whether it can hit anything: finite origin and direction, a direction that is not zero (nor denormal on every
    /// axis, where too few bits are left to tell it from others), a range that is not empty. Every tracer answers a
    /// miss for any other ray.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction.abs().max_element() >= f32::MIN_POSITIVE
            && self.tmin >= 0.0
            && self.tmin <= self.tmax
    }

    /// Whether a hit at `t` counts: not behind the origin, however little, and within the range once it is rounded to
    /// f32.
    #[inline]
    pub(crate) fn reaches(&self, t: f64) -> bool {
        let rounded = t as f32;
        // Behind by less than f32 can tell would round to -0, which is no less than 0.
        t >= 0.0 && self.tmin <= rounded && rounded <= self.tmax && rounded.is_finite()
    }
}

/// Where a ray met the scene: ids and parameters, nothing else. [`SurfacePoint::new`](crate::shade::SurfacePoint::new)
/// computes the rest.
///
/// Six words in the order of the fields, so that the hits of a packet can be written as vectors.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Hit {
    /// Distance in units of the ray's direction; finite.
    pub t: f32,
    /// Weight of a triangle's second corner; a shape's own first parameter.
    pub u: f32,
    /// Weight of a triangle's third corner; a shape's own second parameter.
    pub v: f32,
    /// Index of the triangle in its mesh, or of the shape in its list.
    pub primitive: u32,
    /// Index into [`Scene::geometries`](crate::Scene::geometries).
    pub geometry: u32,
    /// Index into [`Scene::instances`](crate::Scene::instances).
    pub instance: u32,
}

impl Hit {
    /// The order that decides between hits at equal t: the lowest wins.
    #[inline]
    pub const fn id(&self) -> (u32, u32, u32) {
        (self.instance, self.geometry, self.primitive)
    }
}
