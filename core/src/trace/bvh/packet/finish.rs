//! What a packet has hit, computed: four rays at a time, with the bits that a single ray would get.

use super::octet::Octet;
use super::{Doubts, Packet, PacketHits, RAYS};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::Lane;
use crate::trace::bvh::hits::noted::{Rays, widen};
use crate::trace::bvh::hits::quad::{Quad, QuadHits};
use crate::trace::bvh::simd::{Array, Simd, Vector};

/// Tells of all hits of packet `number`.
#[inline(always)]
pub(super) fn finish<S: Simd>(
    bvh: &Bvh,
    number: usize,
    packet: &Packet,
    lanes: u32,
    octet: &Octet<S::V8>,
    doubts: &Doubts<'_>,
    hits: &mut PacketHits,
) {
    hits.lanes = octet.hit;
    if octet.hit != 0 {
        let mut ids = octet.all_noted();
        if octet.hit != 0xff {
            // Anything that can be computed will do for the others.
            let some = ids[octet.hit.trailing_zeros() as usize % RAYS];
            super::each(!octet.hit).for_each(|lane| ids[lane] = some);
        }
        let [a, b, c, d, e, f, g, h] = ids;
        if octet.hit & 0x0f != 0 {
            four::<S>(bvh, packet, 0, [a, b, c, d], hits);
        }
        if octet.hit & 0xf0 != 0 {
            four::<S>(bvh, packet, 1, [e, f, g, h], hits);
        }
    }
    doubts.tell(bvh, number, lanes & !hits.lanes, hits);
}

/// Four rays, each with a triangle that it hits for sure.
#[inline(always)]
fn four<S: Simd>(bvh: &Bvh, packet: &Packet, half: usize, ids: [u32; 4], hits: &mut PacketHits) {
    let (mut a, mut b, mut c, mut d) = (None, None, None, None);
    let leaves = bvh.fixed.triangles.leaves();
    let triangles = [
        leaves.lane(ids[0], &mut a),
        leaves.lane(ids[1], &mut b),
        leaves.lane(ids[2], &mut c),
        leaves.lane(ids[3], &mut d),
    ];
    let corners = if ids == [ids[0]; 4] {
        // The same four times: one load each, not four.
        let triangle = triangles[0];
        [same(triangle, 0), same(triangle, 1), same(triangle, 2)]
    } else {
        [corner(&triangles, 0), corner(&triangles, 1), corner(&triangles, 2)]
    };
    let [x, y, z] = &packet.origin;
    let origin = [lanes::<S>(x, half), lanes::<S>(y, half), lanes::<S>(z, half)];
    let [x, y, z] = &packet.direction;
    let rays: Rays<S::D4> = Rays { origin, direction: [lanes::<S>(x, half), lanes::<S>(y, half), lanes::<S>(z, half)] };
    let wide = [doubles::<S>(&corners[0]), doubles::<S>(&corners[1]), doubles::<S>(&corners[2])];
    let QuadHits { t32, u, v, .. } = Quad::new(rays.origin, rays.direction, wide).hits();
    put(&mut hits.t, half, t32);
    put(&mut hits.u, half, u);
    put(&mut hits.v, half, v);
    let [nx, ny, nz] = normal::<S>(&corners);
    put(&mut hits.normal[0], half, nx.to_array());
    put(&mut hits.normal[1], half, ny.to_array());
    put(&mut hits.normal[2], half, nz.to_array());
    for (i, triangle) in triangles.iter().enumerate() {
        let (part, primitive) = triangle.number();
        let part = bvh.fixed.triangles.part(part);
        let lane = 4 * half + i;
        (hits.primitive[lane], hits.geometry[lane], hits.instance[lane]) = (primitive, part.geometry, part.instance);
    }
}

/// Corner k of four triangles, component by component.
#[inline(always)]
fn corner(triangles: &[Lane<'_>; 4], k: usize) -> [[f32; 4]; 3] {
    [row(triangles, 0, k), row(triangles, 1, k), row(triangles, 2, k)]
}

#[inline(always)]
fn same(triangle: Lane<'_>, k: usize) -> [[f32; 4]; 3] {
    [[triangle.component(0, k); 4], [triangle.component(1, k); 4], [triangle.component(2, k); 4]]
}

#[inline(always)]
fn row([a, b, c, d]: &[Lane<'_>; 4], axis: usize, k: usize) -> [f32; 4] {
    [a.component(axis, k), b.component(axis, k), c.component(axis, k), d.component(axis, k)]
}

#[inline(always)]
fn lanes<S: Simd>(values: &[f32; RAYS], half: usize) -> S::D4 {
    widen::<S>(&values.as_chunks().0[half % 2])
}

#[inline(always)]
fn doubles<S: Simd>([x, y, z]: &[[f32; 4]; 3]) -> [S::D4; 3] {
    [widen::<S>(x), widen::<S>(y), widen::<S>(z)]
}

#[inline(always)]
fn put(values: &mut [f32; RAYS], half: usize, four: [f32; 4]) {
    values.as_chunks_mut().0[half % 2] = four;
}

/// Normals as of [`TriangleFound::normal`](crate::trace::bvh::TriangleFound::normal), with its bits: nothing is fused.
#[inline(always)]
fn normal<S: Simd>([a, b, c]: &[[[f32; 4]; 3]; 3]) -> [S::V4; 3] {
    let (p, q) = (edge::<S>(b, a), edge::<S>(c, a));
    [p[1].mul(q[2]).sub(q[1].mul(p[2])), p[2].mul(q[0]).sub(q[2].mul(p[0])), p[0].mul(q[1]).sub(q[0].mul(p[1]))]
}

#[inline(always)]
fn edge<S: Simd>(to: &[[f32; 4]; 3], from: &[[f32; 4]; 3]) -> [S::V4; 3] {
    [
        S::V4::load(&to[0]).sub(S::V4::load(&from[0])),
        S::V4::load(&to[1]).sub(S::V4::load(&from[1])),
        S::V4::load(&to[2]).sub(S::V4::load(&from[2])),
    ]
}
