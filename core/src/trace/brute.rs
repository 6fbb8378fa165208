//! Every primitive for every ray: the yardstick the accelerators are held against.
//!
//! Nothing is skipped but by a plain f64 sign test, eight triangles at a time, that leaves anything doubtful to
//! `triangle::intersect`.

use std::fmt;
use std::sync::Arc;

use super::leaf::{offer_shape, offer_triangle};
use super::nearest::Nearest;
use super::{Part, Primitives, Tracer, World};
use crate::math::{Affine3, DVec3, Vec3, is_traceable};
use crate::ray::{Hit, Ray};
use crate::shape::Shape;
use crate::shape::triangle::Placed;

/// A tracer without an accelerator.
pub struct Brute {
    world: World,
    parts: Vec<Prepared>,
    /// Of each placement, for each part of its object: the triangles where they stand; nothing of what moves.
    placed: Vec<Vec<Option<Vec<Lanes>>>>,
}

impl fmt::Debug for Brute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Brute").field("parts", &self.parts.len()).finish_non_exhaustive()
    }
}

/// A part's primitives, laid out for a linear scan.
enum Prepared {
    Triangles { corners: Vec<[Vec3; 3]>, lanes: Vec<Lanes>, primitives: Vec<u32> },
    Shapes(Arc<Vec<Shape>>),
}

/// Eight triangles in world coordinates.
struct Lanes {
    /// Component i of corner k is `corners[3 * k + i]`.
    corners: [[f64; 8]; 9],
    /// What the rounding of a corner is relative to, where a transform has rounded it.
    slack: f64,
}

impl Brute {
    /// Takes the primitives of `world` as they are.
    pub fn new(world: &World) -> Self {
        let parts: Vec<Prepared> = world.parts.iter().map(Prepared::new).collect();
        let placed = world.placements.iter().map(|placement| {
            let object = &parts[world.objects[placement.object as usize].clone()];
            let is_still = placement.motion.is_none();
            object.iter().map(|part| is_still.then(|| part.placed(&placement.to_world))).collect()
        });
        Self { world: world.clone(), placed: placed.collect(), parts }
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        let part = |part: &Prepared| match part {
            Prepared::Triangles { corners, lanes, primitives } => {
                size_of_val(&corners[..]) + size_of_val(&lanes[..]) + size_of_val(&primitives[..])
            }
            Prepared::Shapes(shapes) => shapes.iter().map(Shape::bytes).sum(),
        };
        let placed = self.placed.iter().flatten().flatten().map(|lanes| size_of_val(&lanes[..]));
        self.parts.iter().map(part).sum::<usize>() + placed.sum::<usize>()
    }

    /// The nearest intersection within the range; if `any`, that of the first part that has one.
    fn trace(&self, ray: &Ray, any: bool) -> Nearest {
        let mut nearest = Nearest::new(ray);
        if !ray.is_valid() {
            return nearest;
        }
        for i in self.world.fixed.clone() {
            let part = &self.world.parts[i];
            match &self.parts[i] {
                Prepared::Triangles { corners, lanes, primitives } => {
                    each_candidate(lanes, corners.len(), ray, |k| {
                        offer_triangle(&mut nearest, ray, &corners[k], part.id(part.instance, primitives[k]));
                    });
                }
                Prepared::Shapes(shapes) => offer_shapes(&mut nearest, ray, None, shapes, part, part.instance),
            }
            if any && nearest.hit().is_some() {
                return nearest;
            }
        }
        for (placement, placed) in self.world.placements.iter().zip(&self.placed) {
            let placement = placement.at(ray.moment());
            let object_ray = placement.object_ray(ray);
            for (i, lanes) in self.world.objects[placement.object as usize].clone().zip(placed) {
                let part = &self.world.parts[i];
                match &self.parts[i] {
                    Prepared::Triangles { corners, primitives, .. } => {
                        let offer = |k: usize| {
                            let placed = Placed { corners: corners[k], to_world: &placement.to_world };
                            offer_triangle(&mut nearest, ray, &placed, part.id(placement.instance, primitives[k]));
                        };
                        match lanes {
                            Some(lanes) => each_candidate(lanes, corners.len(), ray, offer),
                            None => (0..corners.len()).for_each(offer),
                        }
                    }
                    Prepared::Shapes(shapes) => {
                        offer_shapes(&mut nearest, ray, Some(&object_ray), shapes, part, placement.instance);
                    }
                }
                if any && nearest.hit().is_some() {
                    return nearest;
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

fn offer_shapes(nearest: &mut Nearest, ray: &Ray, local: Option<&Ray>, shapes: &[Shape], part: &Part, instance: u32) {
    for (primitive, shape) in shapes.iter().enumerate() {
        offer_shape(nearest, ray, local, shape, part.id(instance, primitive as u32));
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
                let lanes = corners.chunks(8).map(|corners| Lanes::new(corners, |p| (p.as_dvec3(), 0.0))).collect();
                Self::Triangles { corners, lanes, primitives }
            }
            Primitives::Shapes(shapes) => Self::Shapes(Arc::clone(shapes)),
        }
    }
}

impl Prepared {
    /// The triangles under `to_world`.
    fn placed(&self, to_world: &Affine3) -> Vec<Lanes> {
        let Self::Triangles { corners, .. } = self else { return Vec::new() };
        let to_world = to_world.as_daffine3();
        let magnitudes = to_world.matrix3.abs();
        let place = |p: Vec3| {
            let slack = magnitudes * p.as_dvec3().abs() + to_world.translation.abs();
            (to_world.transform_point3(p.as_dvec3()), slack.max_element())
        };
        corners.chunks(8).map(|corners| Lanes::new(corners, place)).collect()
    }
}

/// Calls `found` with the index of every triangle that the ray's line may pass.
fn each_candidate(lanes: &[Lanes], count: usize, ray: &Ray, mut found: impl FnMut(usize)) {
    for (chunk, lanes) in lanes.iter().enumerate() {
        let mut candidates = lanes.candidates(ray.origin.as_dvec3(), ray.direction.as_dvec3());
        while candidates != 0 {
            let k = chunk * 8 + candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            if k < count {
                found(k);
            }
        }
    }
}

impl Lanes {
    /// `place` moves a corner into the world, and tells what the rounding of that is relative to.
    fn new(triangles: &[[Vec3; 3]], place: impl Fn(Vec3) -> (DVec3, f64)) -> Self {
        let mut lanes = Self { corners: [[0.0; 8]; 9], slack: 0.0 };
        for (lane, triangle) in triangles.iter().enumerate() {
            for (k, &corner) in triangle.iter().enumerate() {
                let (corner, slack) = place(corner);
                lanes.slack = lanes.slack.max(slack);
                for axis in 0..3 {
                    lanes.corners[3 * k + axis][lane] = corner[axis];
                }
            }
        }
        lanes
    }

    /// A bit for every triangle that the ray's line may pass.
    ///
    /// The signs of the three volumes, with a bound of 32 roundings on products of the largest components.
    fn candidates(&self, origin: DVec3, d: DVec3) -> u32 {
        let mut mask = 0;
        for lane in 0..8 {
            let p = |k: usize| {
                DVec3::new(self.corners[3 * k][lane], self.corners[3 * k + 1][lane], self.corners[3 * k + 2][lane])
                    - origin
            };
            let (a, b, c) = (p(0), p(1), p(2));
            let w = DVec3::new(d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b)));
            let reach = a.abs().max(b.abs()).max(c.abs()).max_element() + self.slack;
            let bound = 64.0 * f64::EPSILON * d.abs().max_element() * reach * reach;
            let outside = w.min_element() < -bound && w.max_element() > bound;
            mask |= u32::from(!outside) << lane;
        }
        mask
    }
}
