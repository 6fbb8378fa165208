//! Eight triangles, laid out component by component for eight-wide arithmetic.

use bytemuck::{Pod, Zeroable};

use crate::math::{Aabb, Vec3};

/// Triangles in a block.
pub(super) const LANES: usize = 8;

/// Eight triangles, component by component.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Block {
    /// At least the largest component of an edge. With the corners, for whoever tests them needs it: at the end it cost
    /// a cache line more.
    pub size: f32,
    /// A bit for every lane that has a triangle.
    pub lanes: u32,
    /// Component by component: that of the first corners, the second, the third.
    pub corners: [[[f32; LANES]; 3]; 3],
    pub primitive: [u32; LANES],
    pub part: [u32; LANES],
}

impl Block {
    /// Bytes of one axis's components of all corners.
    pub const AXIS: u32 = size_of::<[[f32; LANES]; 3]>() as u32;

    /// Without triangles.
    pub const EMPTY: Self =
        Self { size: 0.0, lanes: 0, corners: [[[0.0; LANES]; 3]; 3], primitive: [0; LANES], part: [0; LANES] };

    /// Adds a triangle, the eighth at most.
    #[inline(always)]
    pub fn push(&mut self, corners: [Vec3; 3], part: u32, primitive: u32) {
        let lane = self.lanes.trailing_ones() as usize % LANES;
        for (k, corner) in corners.into_iter().enumerate() {
            for axis in 0..3 {
                self.corners[axis][k][lane] = corner[axis];
            }
        }
        let [a, b, c] = corners;
        let size = (b - a).abs().max((c - b).abs()).max((a - c).abs()).max_element();
        self.size = self.size.max(rounded_up(size));
        self.primitive[lane] = primitive;
        self.part[lane] = part;
        self.lanes |= 1 << lane;
    }

    /// The lanes that have a triangle.
    #[inline(always)]
    pub fn used(&self) -> impl Iterator<Item = usize> + use<> {
        let lanes = self.lanes;
        (0..LANES).filter(move |lane| lanes >> lane & 1 != 0)
    }

    /// The box around its triangles.
    #[inline(always)]
    pub fn bounds(&self) -> Aabb {
        Aabb::around(self.used().flat_map(|lane| self.triangle(lane)))
    }

    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = &self.corners;
        [
            Vec3::new(ax[lane], ay[lane], az[lane]),
            Vec3::new(bx[lane], by[lane], bz[lane]),
            Vec3::new(cx[lane], cy[lane], cz[lane]),
        ]
    }
}

/// At least a size that was rounded.
#[inline(always)]
pub(super) fn rounded_up(size: f32) -> f32 {
    size * (1.0 + f32::EPSILON)
}

/// One triangle of a block.
#[derive(Clone, Copy)]
pub(super) struct Lane<'a> {
    pub block: &'a Block,
    /// Less than [`LANES`].
    pub lane: usize,
}

impl Lane<'_> {
    /// Component `axis` of corner `k`.
    #[inline(always)]
    pub fn component(&self, axis: usize, k: usize) -> f32 {
        self.block.corners[axis][k][self.lane % LANES]
    }

    /// The number of the part, and that of the triangle in it.
    #[inline(always)]
    pub fn number(&self) -> (u32, u32) {
        let lane = self.lane % LANES;
        (self.block.part[lane], self.block.primitive[lane])
    }
}
