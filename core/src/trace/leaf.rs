//! What one primitive gives to the nearest hit: the leaf of every tracer that asks them one by one.

use super::Part;
use super::nearest::Nearest;
use crate::math::Affine3;
use crate::ray::{Hit, Ray};
use crate::shape::distance::Distance;
use crate::shape::triangle::{self, Corners};
use crate::shape::{Shape, ShapeHit, SphereMethod, TriangleMethod};

/// How primitives are met: exactly, or by a textbook's method where there are several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Methods {
    /// Of triangles.
    pub triangle: TriangleMethod,
    /// Of spheres.
    pub sphere: SphereMethod,
}

/// Whose hit it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Id {
    pub instance: u32,
    pub geometry: u32,
    pub primitive: u32,
}

impl Id {
    /// A hit with this id; a triangle's parameters are the weights of its second and third corner.
    #[inline]
    fn hit(self, t: f64, u: f32, v: f32) -> Hit {
        let Self { instance, geometry, primitive } = self;
        Hit { t: t as f32, u, v, primitive, geometry, instance }
    }

    /// The order that decides between hits at equal t.
    #[inline]
    fn order(self) -> (u32, u32, u32) {
        (self.instance, self.geometry, self.primitive)
    }

    /// A hit of a shape.
    #[inline]
    pub fn of_shape(self, hit: &ShapeHit) -> Hit {
        self.hit(hit.t, hit.uv.x, hit.uv.y)
    }
}

impl Part {
    /// The id of one of its primitives, in its place.
    #[inline]
    pub(super) fn id(&self, instance: u32, primitive: u32) -> Id {
        Id { instance, geometry: self.geometry, primitive }
    }
}

/// The instance through which a ray came to an object's primitives.
#[derive(Clone, Copy)]
pub(super) struct InstanceTransform<'a> {
    pub instance: u32,
    pub to_world: &'a Affine3,
}

/// Offers where `ray`, in the world, meets a triangle.
#[inline]
pub(super) fn offer_triangle(nearest: &mut Nearest, ray: &Ray, corners: &impl Corners, id: Id) {
    if let Some(hit) = triangle::intersect(ray, corners) {
        let distance = Distance { t: hit.t, support: corners.support() };
        nearest.offer(ray, distance, id.hit(hit.t, hit.u as f32, hit.v as f32));
    }
}

/// Offers where `ray`, in the world, meets a shape; `local` is the ray in the coordinates of a shape that is placed.
#[inline]
pub(super) fn offer_shape(nearest: &mut Nearest, ray: &Ray, local: Option<&Ray>, shape: &Shape, id: Id) {
    if let Some(t) = shape.crossings(local.unwrap_or(ray)).next() {
        offer_crossing(nearest, ray, local, shape, t, id);
    }
}

/// Offers the hit at a t at which a shape is met; its parameters are computed only if it is taken.
#[inline]
pub(super) fn offer_crossing(nearest: &mut Nearest, ray: &Ray, local: Option<&Ray>, shape: &Shape, t: f64, id: Id) {
    let distance = match local {
        Some(_) => Distance::itself(t),
        None => Distance { t, support: shape.support(ray, t) },
    };
    if nearest.takes(ray, &distance, id.order()) {
        nearest.take(distance, id.of_shape(&shape.hit_at(local.unwrap_or(ray), t)));
    }
}

impl Methods {
    /// [`offer_triangle`] by the chosen method, which sees corners in f32.
    #[inline]
    pub(super) fn offer_triangle(self, nearest: &mut Nearest, ray: &Ray, corners: &impl Corners, id: Id) {
        if self.triangle == TriangleMethod::Exact {
            offer_triangle(nearest, ray, corners, id);
        } else if let Some(hit) = self.triangle.intersect(ray, corners.rounded().map(|corner| corner.as_vec3())) {
            nearest.offer(ray, Distance::itself(hit.t), id.hit(hit.t, hit.u as f32, hit.v as f32));
        }
    }

    /// [`offer_shape`] by the chosen method.
    #[inline]
    pub(super) fn offer_shape(self, nearest: &mut Nearest, ray: &Ray, local: Option<&Ray>, shape: &Shape, id: Id) {
        match shape {
            Shape::Sphere(sphere) if self.sphere != SphereMethod::Exact => {
                let of_shape = local.unwrap_or(ray);
                let mut roots = self.sphere.roots(of_shape, sphere).into_iter().flatten();
                if let Some(t) = roots.find(|&t| of_shape.reaches(t)) {
                    offer_crossing(nearest, ray, local, shape, t, id);
                }
            }
            _ => offer_shape(nearest, ray, local, shape, id),
        }
    }
}
