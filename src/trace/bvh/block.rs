//! Four triangles, laid out component by component for four-wide arithmetic.

use super::build::Record;
use crate::math::Vec3;
use crate::trace::{Part, Primitives};

/// Triangles in a block.
pub(super) const LANES: usize = 4;

/// Four triangles, component by component.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Component i of corner k is `corners[3 * k + i]`.
    pub corners: [[f32; LANES]; 9],
    pub primitive: [u32; LANES],
    pub part: [u32; LANES],
    /// A bit for every lane that has a triangle.
    pub lanes: u32,
}

impl Block {
    pub fn new(parts: &[Part], items: &[Record]) -> Self {
        let mut block = Self { corners: [[0.0; LANES]; 9], primitive: [0; LANES], part: [0; LANES], lanes: 0 };
        for (lane, item) in items.iter().enumerate() {
            let Primitives::Triangles { positions, triangles } = &parts[item.part() as usize].primitives else {
                unreachable!("items of a triangle tree come from meshes")
            };
            for (k, &corner) in triangles[item.primitive() as usize].iter().enumerate() {
                for axis in 0..3 {
                    block.corners[3 * k + axis][lane] = positions[corner as usize][axis];
                }
            }
            block.primitive[lane] = item.primitive();
            block.part[lane] = item.part();
            block.lanes |= 1 << lane;
        }
        block
    }

    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &self.corners;
        [
            Vec3::new(ax[lane], ay[lane], az[lane]),
            Vec3::new(bx[lane], by[lane], bz[lane]),
            Vec3::new(cx[lane], cy[lane], cz[lane]),
        ]
    }
}
