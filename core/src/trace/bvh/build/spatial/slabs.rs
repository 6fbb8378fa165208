//! The best plane that cuts what it passes: parts of triangles between equidistant planes, on all three axes in one
//! pass.

use super::super::bins::{add_up, join_boxes, swept};
use super::super::record::Record;
use super::super::split::Rule;
use crate::math::Vec3;
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::simd::boxes::Boxes;
use crate::trace::bvh::simd::{Array, Simd, Vector};

/// From a coordinate to the slab it is in, for boxes as [-min, max].
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid<const N: usize> {
    /// As boxes are: [-o, o], and [-s, s].
    origin: [f32; 8],
    scale: [f32; 8],
    size: [f32; 8],
}

impl<const N: usize> Grid<N> {
    /// `N` slabs of a box.
    #[inline(always)]
    pub fn new<S: Simd>(bounds: &[f32; 8]) -> Self {
        let zero = S::V8::splat(0.0);
        let max = S::V8::load(bounds);
        // Of each half what belongs to it: [-min, min], and [-size, size].
        let opposite = max.swap_halves();
        let is_high = zero.less(S::V8::load(&HIGH));
        let size = max.add(opposite);
        let size = S::V8::select(is_high, size, zero.sub(size));
        let origin = S::V8::select(is_high, zero.sub(opposite), max);
        // Where a box has no extent all is in slab 0, and nothing can be cut.
        let scale = S::V8::select(zero.less(size.mul(size)), S::V8::splat(N as f32).div(size), zero);
        Self { origin: origin.to_array(), scale: scale.to_array(), size: size.to_array() }
    }

    /// Where a slab begins.
    #[inline(always)]
    pub fn border(&self, axis: usize, slab: usize) -> f32 {
        self.origin[axis + 4] + self.size[axis + 4] * (slab as f32 / N as f32)
    }

    /// The slab of a coordinate.
    #[inline(always)]
    fn slab(&self, axis: usize, x: f32) -> usize {
        // The cast saturates.
        (((x - self.origin[axis + 4]) * self.scale[axis + 4]) as usize).min(N - 1)
    }

    /// Of a box on each axis the first slab, and behind a fourth number the last one.
    #[inline(always)]
    fn slabs<S: Simd>(&self, bounds: S::V8) -> [usize; 8] {
        let last = S::V8::splat((N - 1) as f32);
        let slabs = bounds.sub(S::V8::load(&self.origin)).mul(S::V8::load(&self.scale));
        // What is not a number is in the last slab.
        let slabs = slabs.min(last).max(S::V8::splat(0.0)).truncate();
        let mut found = [0; 8];
        for (found, slab) in found.iter_mut().zip(slabs) {
            *found = slab as usize % N;
        }
        found
    }
}

/// Positive in the upper half.
const HIGH: [f32; 8] = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];

/// Items whose corners are fetched together.
const TOGETHER: usize = 64;

/// Parts of triangles in slabs, on each axis.
#[repr(align(64))]
pub(super) struct Slabs<const N: usize> {
    boxes: [[[f32; 8]; 3]; N],
    /// How many begin in a slab, and how many end.
    begun: [[u32; 4]; N],
    ended: [[u32; 4]; N],
}

impl<const N: usize> Slabs<N> {
    /// With nothing in them.
    pub const EMPTY: Self = Self { boxes: [[[f32::NEG_INFINITY; 8]; 3]; N], begun: [[0; 4]; N], ended: [[0; 4]; N] };

    /// Adds the parts of all `items`, triangles of `meshes`.
    #[inline(always)]
    pub fn add_all<S: Simd>(&mut self, items: &[Record], grid: &Grid<N>, meshes: &Meshes) {
        for items in items.chunks(TOGETHER) {
            let (mut cut, mut count) = ([0u8; TOGETHER], 0);
            for (i, item) in items.iter().enumerate() {
                cut[count] = i as u8;
                count += usize::from(self.add_whole::<S>(item, grid));
            }
            // Corner numbers, and then corners, are on their way together: one by one they took half of the time.
            let cut = || cut[..count].iter().map(|&i| &items[usize::from(i)]);
            for item in cut() {
                S::prefetch_line(&meshes.of_part(item.part()).triangles[item.primitive() as usize]);
            }
            for item in cut() {
                let mesh = meshes.of_part(item.part());
                for corner in mesh.triangles[item.primitive() as usize] {
                    S::prefetch_line(&mesh.positions[corner as usize]);
                }
            }
            for item in cut() {
                let corners = meshes.of_part(item.part()).corners(item.primitive());
                let slabs = grid.slabs::<S>(S::V8::load(&item.0));
                for axis in 0..3 {
                    if slabs[axis] < slabs[axis + 4] {
                        self.add_parts::<S>(&item.0, &corners, axis, slabs[axis]..slabs[axis + 4] + 1, grid);
                    }
                }
            }
        }
    }

    /// Adds an item on those axes where it is in one slab, and counts it on all; whether there are others.
    #[inline(always)]
    fn add_whole<S: Simd>(&mut self, item: &Record, grid: &Grid<N>) -> bool {
        let bounds = S::V8::load(&item.0);
        let slabs = grid.slabs::<S>(bounds);
        let mut is_cut = false;
        for axis in 0..3 {
            let (first, last) = (slabs[axis], slabs[axis + 4]);
            self.begun[first][axis] += 1;
            self.ended[last][axis] += 1;
            if first >= last {
                let sum = &mut self.boxes[first][axis];
                *sum = bounds.max(S::V8::load(sum)).to_array();
            } else {
                is_cut = true;
            }
        }
        is_cut
    }

    /// Adds its parts on one axis: of each edge what lies between two planes. That is for a choice only, and may be off
    /// by rounding.
    #[inline(always)]
    fn add_parts<S: Simd>(
        &mut self,
        bounds: &[f32; 8],
        corners: &[Vec3; 3],
        axis: usize,
        slabs: std::ops::Range<usize>,
        grid: &Grid<N>,
    ) {
        let mut parts = [[f32::NEG_INFINITY; 8]; N];
        let (from, to) = (-bounds[axis], bounds[axis + 4]);
        for k in 0..3 {
            let edge = Edge::<S>::new(corners[k], corners[(k + 1) % 3], axis);
            if edge.high < from || to < edge.low {
                continue;
            }
            // What of it is within the item's box, which may be a piece's.
            let (mut slab, mut start) = (slabs.start, edge.start);
            if edge.low < from {
                start = edge.at(from);
            } else {
                slab = grid.slab(axis, edge.low);
            }
            let (mut last, mut end) = (slabs.end - 1, edge.end);
            if edge.high > to {
                end = edge.at(to);
            } else {
                last = grid.slab(axis, edge.high);
            }
            while slab < last {
                let border = edge.at(grid.border(axis, slab + 1));
                parts[slab % N] = start.max(border).max(S::V8::load(&parts[slab % N])).to_array();
                (slab, start) = (slab + 1, border);
            }
            parts[slab % N] = start.max(end).max(S::V8::load(&parts[slab % N])).to_array();
        }
        let bounds = S::V8::load(bounds);
        for slab in slabs {
            let sum = &mut self.boxes[slab][axis];
            *sum = S::V8::load(&parts[slab]).min(bounds).max(S::V8::load(sum)).to_array();
        }
    }

    /// What is in either.
    pub fn join<S: Simd>(&mut self, other: &Self) {
        join_boxes::<S, N>(&mut self.boxes, &other.boxes);
        for slab in 0..N {
            add_up(&mut self.begun[slab], &other.begun[slab]);
            add_up(&mut self.ended[slab], &other.ended[slab]);
        }
    }

    /// The cheapest plane, and what is on its sides; none where there is only one slab.
    #[inline(always)]
    pub fn best<S: Simd>(&self, grid: &Grid<N>, rule: &Rule) -> Option<Plane> {
        let (axis, bin, cost) = swept::<S, N>(&self.boxes, [&self.begun, &self.ended], rule)?;
        let sides = [self.side::<S>(axis, 0..bin, &self.begun), self.side::<S>(axis, bin..N, &self.ended)];
        Some(Plane { axis, at: grid.border(axis, bin), cost, sides })
    }

    /// What is in some slabs of an axis, and how many by `counts`.
    #[inline(always)]
    fn side<S: Simd>(&self, axis: usize, slabs: std::ops::Range<usize>, counts: &[[u32; 4]; N]) -> Side {
        let (mut bounds, mut count) = (S::V8::splat(f32::NEG_INFINITY), 0);
        for slab in slabs {
            bounds = S::V8::load(&self.boxes[slab][axis]).max(bounds);
            count += counts[slab][axis];
        }
        Side { bounds: bounds.to_array(), count }
    }
}

/// An edge of a triangle, upwards along an axis. Points are boxes.
struct Edge<S: Simd> {
    start: S::V8,
    end: S::V8,
    low: f32,
    high: f32,
}

impl<S: Simd> Edge<S> {
    #[inline(always)]
    fn new(a: Vec3, b: Vec3, axis: usize) -> Self {
        let (a, b) = if a[axis] > b[axis] { (b, a) } else { (a, b) };
        Self { start: Self::point(a), end: Self::point(b), low: a[axis], high: b[axis] }
    }

    #[inline(always)]
    fn point(p: Vec3) -> S::V8 {
        S::V8::load(&[-p.x, -p.y, -p.z, 0.0, p.x, p.y, p.z, 0.0])
    }

    /// Where it passes a plane between its ends.
    #[inline(always)]
    fn at(&self, x: f32) -> S::V8 {
        let share = (x - self.low) / (self.high - self.low);
        self.start.add(self.end.sub(self.start).mul(S::V8::splat(share)))
    }
}

/// A plane that cuts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub axis: usize,
    pub at: f32,
    /// Blocks times areas of the two sides.
    pub cost: f32,
    pub sides: [Side; 2],
}

/// What is on one side of a plane, where everything is cut that it passes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// As [-min, max]; about.
    pub bounds: [f32; 8],
    pub count: u32,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::clip;
    use super::*;
    use crate::math::Aabb;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::simd::isa::{Kernel, Present, dispatch};
    use crate::trace::{Part, Primitives};

    const N: usize = 8;

    struct Fill<'a>(&'a [Record], &'a [f32; 8], &'a Meshes);

    impl Kernel for Fill<'_> {
        type Output = (Slabs<N>, Grid<N>);
        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            let (mut slabs, grid) = (Slabs::EMPTY, Grid::new::<S>(self.1));
            slabs.add_all::<S>(self.0, &grid, self.2);
            (slabs, grid)
        }
    }

    /// What is in each slab is what is left of a triangle, or of a piece of it, when it is cut off on either side.
    #[test]
    fn slabs_hold_what_is_cut_off() {
        let mut random = Random::new(3);
        let range = Record::new(&Aabb { min: Vec3::splat(-2.0), max: Vec3::new(2.0, 1.5, 2.5) }, 0, 0);
        for case in 0..300 {
            let corners = [(); 3].map(|()| random.vec3() * [2.0, 0.3][case % 2]).map(|p| p.min(Vec3::splat(1.4)));
            let mut bounds = Aabb::around(corners);
            if case % 3 == 0 {
                let middle = (bounds.min + bounds.max)[case % 2] * 0.5;
                bounds = clip::sides(&bounds, &corners, case % 2, middle).expect("both")[case / 6 % 2];
            }
            let positions = Arc::new(corners.to_vec());
            let primitives = Primitives::Triangles { positions, triangles: Arc::new(vec![[0, 1, 2]]) };
            let meshes = Meshes::new(&[Part { geometry: 0, instance: 0, primitives }]);
            let item = [Record::new(&bounds, 0, 0)];
            for isa in Present::all() {
                let (slabs, grid) = dispatch(isa, Fill(&item, &range.0, &meshes));
                for axis in 0..3 {
                    let mut begun = 0;
                    for slab in 0..N {
                        let (low, high) = (grid.border(axis, slab), grid.border(axis, slab + 1));
                        let is_inside = bounds.min[axis] < high && bounds.max[axis] >= low;
                        begun += slabs.begun[slab][axis];
                        assert_eq!(begun, u32::from(bounds.min[axis] < high), "{case}");
                        let ended: u32 = slabs.ended[..=slab].iter().map(|ended| ended[axis]).sum();
                        assert_eq!(ended, u32::from(bounds.max[axis] < high), "{case}");
                        let found = Record(slabs.boxes[slab][axis]);
                        assert_eq!(!found.is_nothing(), is_inside, "{case}, slab {slab} of axis {axis}");
                        let mut expected = bounds;
                        if bounds.min[axis] < low && is_inside {
                            [_, expected] = clip::sides(&expected, &corners, axis, low).expect("both");
                        }
                        if bounds.max[axis] > high && is_inside {
                            [expected, _] = clip::sides(&expected, &corners, axis, high).expect("both");
                        }
                        let apart = |a: Vec3, b: Vec3| (a - b).abs().max_element();
                        if is_inside {
                            let found = found.bounds();
                            let off = apart(found.min, expected.min).max(apart(found.max, expected.max));
                            assert!(off < 1e-5, "{case}, slab {slab} of axis {axis}: {found:?}, {expected:?}");
                        }
                    }
                }
            }
        }
    }

    /// Two parts of many triangles, joined, are all of them.
    #[test]
    fn slabs_are_joined() {
        let mut random = Random::new(4);
        let positions: Vec<Vec3> = (0..900).map(|_| random.vec3()).collect();
        let corners = |i: u32| [3 * i, 3 * i + 1, 3 * i + 2];
        let around = |i: u32| Aabb::around(corners(i).map(|corner| positions[corner as usize]));
        let items: Vec<Record> = (0..300).map(|i| Record::new(&around(i), 0, i)).collect();
        let triangles = Arc::new((0..300).map(corners).collect());
        let primitives = Primitives::Triangles { positions: Arc::new(positions.clone()), triangles };
        let meshes = Meshes::new(&[Part { geometry: 0, instance: 0, primitives }]);
        let range = Record::new(&Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) }, 0, 0);
        for isa in Present::all() {
            let of = |items: &[Record]| dispatch(isa, Fill(items, &range.0, &meshes)).0;
            let (whole, mut joined) = (of(&items), of(&items[..100]));
            joined.join::<Portable>(&of(&items[100..]));
            assert_eq!((joined.begun, joined.ended), (whole.begun, whole.ended));
            let bounds = |slabs: &Slabs<N>| slabs.boxes.map(|axes| axes.map(|bounds| Record(bounds).bounds()));
            assert_eq!(bounds(&joined), bounds(&whole));
        }
    }
}
