//! Every primitive for every ray: the yardstick the accelerators are held against.
//!
//! Nothing is skipped but by a plain f64 sign test, eight triangles at a time, that leaves anything doubtful to
//! `triangle::intersect`.

use std::sync::Arc;

use super::nearest::Nearest;
use super::{Part, Primitives, Tracer, World};
use crate::math::{DVec3, Vec3, is_traceable};
use crate::ray::{Hit, Ray};
use crate::shape::Shape;
use crate::shape::triangle::{self, Placed};

/// A tracer without an accelerator.
pub struct Brute {
    world: World,
    parts: Vec<Prepared>,
}

/// A part's primitives, laid out for a linear scan.
enum Prepared {
    Triangles { corners: Vec<[Vec3; 3]>, lanes: Vec<Lanes>, primitives: Vec<u32> },
    Shapes(Arc<Vec<Shape>>),
}

/// Eight triangles: component i of corner k is `0[3 * k + i]`.
struct Lanes([[f64; 8]; 9]);

impl Brute {
    /// Takes the primitives of `world` as they are.
    pub fn new(world: &World) -> Self {
        Self { world: world.clone(), parts: world.parts.iter().map(Prepared::new).collect() }
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        let part = |part: &Prepared| match part {
            Prepared::Triangles { corners, lanes, primitives } => {
                size_of_val(&corners[..]) + size_of_val(&lanes[..]) + size_of_val(&primitives[..])
            }
            Prepared::Shapes(shapes) => size_of_val(&shapes[..]),
        };
        self.parts.iter().map(part).sum()
    }

    /// Offers every intersection within the range to `nearest`; stops at the first one if `any`.
    fn trace(&self, ray: &Ray, any: bool) -> Nearest {
        let mut nearest = Nearest::new(ray);
        if !ray.is_valid() {
            return nearest;
        }
        for i in self.world.fixed.clone() {
            let part = &self.world.parts[i];
            match &self.parts[i] {
                Prepared::Triangles { corners, lanes, primitives } => {
                    for (chunk, lanes) in lanes.iter().enumerate() {
                        let mut candidates = lanes.candidates(ray.origin.as_dvec3(), ray.direction.as_dvec3());
                        while candidates != 0 {
                            let k = chunk * 8 + candidates.trailing_zeros() as usize;
                            candidates &= candidates - 1;
                            let Some(corners) = corners.get(k) else { continue };
                            let Some(hit) = triangle::intersect(ray, corners) else { continue };
                            nearest.offer(hit.t, triangle_hit(&hit, part, part.instance, primitives[k]));
                        }
                    }
                }
                Prepared::Shapes(shapes) => offer_shapes(&mut nearest, ray, shapes, part, part.instance),
            }
            if any && nearest.hit().is_some() {
                return nearest;
            }
        }
        for placement in &self.world.placements {
            let object_ray = placement.object_ray(ray);
            for i in self.world.objects[placement.object as usize].clone() {
                let part = &self.world.parts[i];
                match &self.parts[i] {
                    Prepared::Triangles { corners, primitives, .. } => {
                        for (k, &corners) in corners.iter().enumerate() {
                            let placed = Placed { corners, to_world: &placement.to_world };
                            let Some(hit) = triangle::intersect(ray, &placed) else { continue };
                            nearest.offer(hit.t, triangle_hit(&hit, part, placement.instance, primitives[k]));
                        }
                    }
                    Prepared::Shapes(shapes) => {
                        offer_shapes(&mut nearest, &object_ray, shapes, part, placement.instance);
                    }
                }
            }
        }
        nearest
    }
}

impl Tracer for Brute {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.trace(ray, false).hit()
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.trace(ray, true).hit().is_some()
    }
}

fn triangle_hit(hit: &triangle::TriangleHit, part: &Part, instance: u32, primitive: u32) -> Hit {
    Hit { t: hit.t as f32, u: hit.u as f32, v: hit.v as f32, primitive, geometry: part.geometry, instance }
}

fn offer_shapes(nearest: &mut Nearest, ray: &Ray, shapes: &[Shape], part: &Part, instance: u32) {
    for (primitive, shape) in shapes.iter().enumerate() {
        if let Some(hit) = shape.intersect(ray) {
            let (primitive, geometry) = (primitive as u32, part.geometry);
            nearest.offer(hit.t, Hit { t: hit.t as f32, u: hit.uv.x, v: hit.uv.y, primitive, geometry, instance });
        }
    }
}

impl Prepared {
    fn new(part: &Part) -> Self {
        match &part.primitives {
            Primitives::Triangles { positions, triangles } => {
                let mut corners = Vec::new();
                let mut primitives = Vec::new();
                for (primitive, indices) in triangles.iter().enumerate() {
                    let triangle = indices.map(|i| positions[i as usize]);
                    if triangle.iter().all(|&p| is_traceable(p)) {
                        corners.push(triangle);
                        primitives.push(primitive as u32);
                    }
                }
                let lanes = corners.chunks(8).map(Lanes::new).collect();
                Self::Triangles { corners, lanes, primitives }
            }
            Primitives::Shapes(shapes) => Self::Shapes(Arc::clone(shapes)),
        }
    }
}

impl Lanes {
    fn new(corners: &[[Vec3; 3]]) -> Self {
        let mut lanes = [[0.0; 8]; 9];
        for (lane, triangle) in corners.iter().enumerate() {
            for (k, corner) in triangle.iter().enumerate() {
                for axis in 0..3 {
                    lanes[3 * k + axis][lane] = f64::from(corner[axis]);
                }
            }
        }
        Self(lanes)
    }

    /// A bit for every triangle that the ray's line may pass.
    ///
    /// The signs of the three volumes, with a bound of 32 roundings on products of the largest components.
    fn candidates(&self, origin: DVec3, d: DVec3) -> u32 {
        let mut mask = 0;
        for lane in 0..8 {
            let p =
                |k: usize| DVec3::new(self.0[3 * k][lane], self.0[3 * k + 1][lane], self.0[3 * k + 2][lane]) - origin;
            let (a, b, c) = (p(0), p(1), p(2));
            let w = DVec3::new(d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b)));
            let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
            let bound = 64.0 * f64::EPSILON * d.abs().max_element() * reach * reach;
            let outside = w.min_element() < -bound && w.max_element() > bound;
            mask |= u32::from(!outside) << lane;
        }
        mask
    }
}
