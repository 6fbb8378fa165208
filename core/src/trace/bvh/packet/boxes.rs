//! A packet among boxes of which the caller knows what is in them, as scenes that are placed in another.

use std::marker::PhantomData;

use super::beam::WIDE;
use super::party::Party;
use super::{Asked, Packet, RAYS, together};
use crate::math::DAffine3;
use crate::trace::bvh::boxes::BoxTree;
use crate::trace::bvh::levels::place::eight_times;
use crate::trace::bvh::node::Child;
use crate::trace::bvh::query::{Closest, Occluded, Query};
use crate::trace::bvh::reject::woop::SLACK;
use crate::trace::bvh::simd::isa::{self, Kernel};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector};
use crate::trace::bvh::walk::stack::{Room, Stack, Waits};
use crate::trace::bvh::walk::{Enter, Near, lowest};

/// What visits boxes: it is told which, and by which rays they are entered, and sets how far each ray still looks.
pub type Visitor<'a> = dyn FnMut(u32, u32, &mut [f32; RAYS]) + 'a;

impl BoxTree {
    /// [`BoxTree::visit`] of those rays of a packet that `lanes` has a bit for, as one: names boxes that they enter,
    /// with a bit for each that does, as long as `visitor` has any look farther than below 0; one that is alone at
    /// once, by whoever is valid. Not where they go different ways, or boxes move: then none is named, and the answer
    /// is no.
    pub fn visit_packet(&self, packet: &Packet, lanes: u32, visitor: &mut Visitor<'_>) -> bool {
        self.visit_packet_as::<Closest>(packet, lanes, visitor)
    }

    /// The same for a visitor to whom it does not matter which are near.
    pub fn visit_packet_any(&self, packet: &Packet, lanes: u32, visitor: &mut Visitor<'_>) -> bool {
        self.visit_packet_as::<Occluded>(packet, lanes, visitor)
    }

    fn visit_packet_as<Q: Query>(&self, packet: &Packet, lanes: u32, visitor: &mut Visitor<'_>) -> bool {
        if self.is_empty() || self.moves() {
            return self.is_empty();
        }
        isa::dispatch(self.isa(), VisitBoxes { boxes: self, packet, lanes, visitor, query: PhantomData::<Q> })
    }

    /// A packet where `place` takes it, in f64; its rays end at `tmax`.
    pub fn placed(&self, packet: &Packet, place: &DAffine3, tmax: &[f32; RAYS]) -> Packet {
        let mut placed = Packet { tmin: packet.tmin, time: packet.time, tmax: *tmax, ..Packet::NONE };
        isa::dispatch(self.isa(), PlacePacket { packet, place, placed: &mut placed });
        placed
    }
}

struct VisitBoxes<'a, 'v, Q> {
    boxes: &'a BoxTree,
    packet: &'a Packet,
    lanes: u32,
    visitor: &'a mut Visitor<'v>,
    query: PhantomData<Q>,
}

/// A child, and which rays enter it.
#[derive(Clone, Copy)]
struct StackEntry {
    near: f32,
    child: Child,
    lanes: u32,
}

impl Waits for StackEntry {
    #[inline(always)]
    fn near(&self) -> f32 {
        self.near
    }
}

impl<Q: Query> Kernel for VisitBoxes<'_, '_, Q> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { boxes, packet, lanes, visitor, .. } = self;
        let mut limits = packet.tmax;
        if boxes.count() == 1 {
            // What is in it looks where rays go, too.
            let valid = packet.valid::<S>() & lanes;
            if valid != 0 {
                visitor(0, valid, &mut limits);
            }
            return true;
        }
        let tree = boxes.tree();
        let mut own = None;
        let asked = Asked { packets: [packet], lanes: [lanes] };
        // Rays that are nearly half as far apart as boxes in a row are enter different ones; and the fewer they are,
        // the less they save each other.
        let share = lanes.count_ones() as f32 / RAYS as f32;
        let wide = WIDE.min(0.4 * share * share / (boxes.count() as f32).cbrt());
        let Some((asked, beam)) = together::<S, 1>(tree.bounds(), wide, &asked, &mut own) else { return false };
        let valid = asked.lanes[0];
        let party = Party::<Q, S::V8, 1>::new(&beam, &asked, tree.reach(), true);
        let mut most = look::<S, Q>(&party, &limits, valid);
        let mut room = Room::new();
        let mut stack = Stack::new(&mut room);
        stack.push(StackEntry { near: 0.0, child: Child::ROOT, lanes: valid });
        while let Some(StackEntry { near, child, lanes }) = stack.pop() {
            if near > most {
                continue;
            }
            if child.is_leaf() {
                for item in child.blocks() {
                    visitor(item, lanes, &mut limits);
                }
                most = look::<S, Q>(&party, &limits, valid);
                if most < 0.0 {
                    break;
                }
                continue;
            }
            let node = tree.node(child);
            let (mask, near) = beam.enter::<S>(node, most);
            let (near, mut open) = (Near(near.to_array()), mask.bits() & node.occupied());
            let base = stack.len();
            while open != 0 {
                let (slot, others) = lowest(open);
                open = others;
                let child = node.child[slot];
                let lanes = if child.is_leaf() { party.entering(node, slot)[0] & valid } else { valid };
                if lanes != 0 {
                    let waiting = StackEntry { near: near.0[slot], child, lanes };
                    if Q::ANY { stack.push(waiting) } else { stack.insert(base, waiting) }
                }
            }
        }
        true
    }
}

/// Has rays look as far as these limits, and says how far that is at most, both rounded up; below 0 where none looks
/// any farther.
#[inline(always)]
fn look<S: Simd, Q: Query>(party: &Party<'_, Q, S::V8, 1>, limits: &[f32; RAYS], valid: u32) -> f32 {
    let wide = S::V8::load(limits).mul_add(S::V8::splat(1.0 + SLACK), S::V8::splat(f32::MIN_POSITIVE));
    let wide = wide.to_array();
    party.limit(0, wide);
    let mut most = f32::NEG_INFINITY;
    for (lane, wide) in wide.into_iter().enumerate() {
        // Of what is below 0, a little more may not be.
        if valid >> lane & 1 != 0 && limits[lane] >= 0.0 {
            most = most.max(wide);
        }
    }
    most
}

struct PlacePacket<'a> {
    packet: &'a Packet,
    place: &'a DAffine3,
    placed: &'a mut Packet,
}

impl Kernel for PlacePacket<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { packet, place, placed } = self;
        let [x, y, z, dx, dy, dz, ..] = packet.rows::<S>();
        let [mx, my, mz] = place.matrix3.to_cols_array_2d();
        let columns = [mx, my, mz, place.translation.to_array()];
        (placed.origin, placed.direction) = eight_times::<S>(&columns, [x, y, z], [dx, dy, dz]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Aabb, Random, Vec3};
    use crate::trace::bvh::Isa;
    use crate::trace::bvh::alone::VisitFlow;
    use crate::trace::bvh::build::preset::Options;

    /// Every box that a ray enters by itself is named, with a bit for each ray that is asked for, and rays are placed
    /// as points and vectors are.
    #[test]
    fn what_single_rays_enter_packets_enter() {
        let mut random = Random::new(66, 0);
        let mut together = 0;
        for round in 0..400 {
            let count = [1, 2, 60, 3000][round % 4];
            let boxes: Vec<Aabb> = (0..count)
                .map(|_| {
                    let centre = random.vector() * 10.0;
                    Aabb { min: centre - random.unit(), max: centre + random.unit() }
                })
                .collect();
            let isa = Isa::available().nth(round % Isa::available().count()).expect("one at least");
            let (tree, _) = BoxTree::build(&boxes, Options { isa, ..Options::default() });
            let (eye, ahead) = (random.vector() * 30.0, random.direction());
            let spread = [1e-3, 0.05, 2.0][round % 3];
            let mut packet = Packet::NONE;
            for lane in 0..RAYS {
                let direction = if lane == 5 && round % 5 == 0 { Vec3::ZERO } else { ahead + random.vector() * spread };
                packet.set(lane, &crate::Ray::new(eye, direction));
            }
            let lanes = if round % 7 == 0 { 0b1011_0110 } else { 0xff };
            let mut named = vec![0; count];
            let mut visitor = |i: u32, lanes: u32, _: &mut [f32; RAYS]| named[i as usize] |= lanes;
            let is_together = if round % 2 == 0 {
                tree.visit_packet(&packet, lanes, &mut visitor)
            } else {
                tree.visit_packet_any(&packet, lanes, &mut visitor)
            };
            assert!(is_together || named.iter().all(|lanes| *lanes == 0));
            together += usize::from(is_together);
            for lane in 0..RAYS {
                let is_asked = lanes >> lane & 1 != 0 && packet.ray(lane).is_valid();
                assert!(is_asked || named.iter().all(|lanes| lanes >> lane & 1 == 0), "{round} {lane}");
                if is_together && is_asked {
                    tree.visit(&packet.ray(lane), &mut |i| {
                        assert!(named[i as usize] >> lane & 1 != 0, "{round}: box {i} of ray {lane}");
                        VisitFlow::Continue(f32::INFINITY)
                    });
                }
            }
            let turn = glam::DQuat::from_scaled_axis(random.vector().as_dvec3());
            let place = DAffine3::from_scale_rotation_translation(random.vector().as_dvec3(), turn, ahead.as_dvec3());
            let tmax = [random.unit(); RAYS];
            let placed = tree.placed(&packet, &place, &tmax);
            for (lane, tmax) in tmax.into_iter().enumerate() {
                let (ray, moved) = (packet.ray(lane), placed.ray(lane));
                assert_eq!(moved.origin, place.transform_point3(ray.origin.as_dvec3()).as_vec3());
                assert_eq!(moved.direction, place.transform_vector3(ray.direction.as_dvec3()).as_vec3());
                assert_eq!((moved.tmin, moved.tmax), (ray.tmin, tmax));
            }
        }
        assert!(together > 150, "{together}");
    }
}
