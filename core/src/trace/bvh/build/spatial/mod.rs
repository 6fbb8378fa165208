//! Triangles referenced from several places, where that is cheaper: the high preset.
//!
//! Splits of space and of objects are weighed by the surface area heuristic, range by range (Stich, Friedrich, Dietrich
//! 2009, *Spatial splits in bounding volume hierarchies*). Of that only the pieces are kept, and the tree is built over
//! these anew, as over anything else, but that large ranges are not judged by samples: which branches become nodes is
//! chosen over more of it than a range sees. Where boxes are small and cover little but their surface, as in a scan or
//! a terrain, no plane is looked for.
//!
//! Cut beforehand, where planes pass that will divide the scene anyway (Ernst, Greiner 2007, *Early split clipping for
//! bounding volume hierarchies*; Karras, Aila 2013, *Fast parallel construction of high-quality bounding volume
//! hierarchies*), which is simpler and takes less time, a soup of large triangles over a mesh was traced at half the
//! rate that it had uncut.
//!
//! | file | idea |
//! | --- | --- |
//! | `mod` | large ranges, and which pieces each may have |
//! | `task` | small ranges, by one thread |
//! | `plane` | a plane that cuts: whether it is better, and what is on its sides |
//! | `slabs` | the best one |
//! | `clip` | what of a triangle is on each side of it |

mod clip;
mod plane;
mod slabs;
mod task;

use rayon::prelude::*;

use super::bins;
use super::record::Record;
use super::split::{PrimitiveRange, Rule};
use super::top::Shared;
use crate::memory::room;
use crate::trace::bvh::block::LANES;
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::node::Child;
use crate::trace::bvh::simd::boxes::half_area;
use crate::trace::bvh::simd::isa::{self, Kernel, Present};
use crate::trace::bvh::simd::{Portable, Simd};
use slabs::{Grid, Plane, Slabs};
use task::TaskKernel;

/// New references for each triangle, at most.
const BUDGET: f64 = 0.3;

/// A range is left as it is where its boxes have no more than this many times the surface of the box around them, and
/// none is large.
const COVERED: f64 = 4.0;

/// A box is large that has this many times the mean surface of its range's boxes, and this share of that of the box
/// around them.
const LARGE_BOX: (f64, f64) = (4.0, 1.0 / 32.0);

/// What of the whole surface the sides of a division may have in common before a plane is looked for that cuts.
const OVERLAP: f32 = 1e-5;

/// Where fewer new references are left than one for so many items, no plane is looked for: hardly one cuts as few.
const SCARCE: usize = 64;

/// Items gone through by one thread at a time; fixed, so that nothing depends on threads.
const CHUNK: usize = 1 << 13;

/// Ranges of at most this many items, those among them that may be added, are one thread's.
const SMALL: usize = 1 << 14;

/// Divisions below each other, at most; no mesh but one made for it gets there.
const MAX_DEPTH: usize = 64;

/// What the tree's leaves hold.
const RULE: Rule = Rule { block: LANES as u32, leaf: LANES as u32 * Child::MAX, samples: false };

/// `items`, triangles of `meshes`, and for what is cut one item for each piece; at most 1.3 times as many.
pub(in crate::trace::bvh) fn pieces(items: Vec<Record>, meshes: &Meshes, isa: Present) -> Vec<Record> {
    let spare = ((items.len() as f64 * BUDGET) as usize).min(Child::NAMES.saturating_sub(items.len()));
    let whole = Extent::of_many(&items, isa);
    let overlap = OVERLAP * whole.range.half_area();
    let mut parts = Splitter { meshes, isa, overlap }.divide(items, &whole, spare, 0);
    if parts.len() == 1 {
        return parts.remove(0);
    }
    let counted = parts.into_iter().map(|part| (part.len(), part)).collect();
    room::fill(counted, |part: Vec<Record>, room| part.into_iter().for_each(|piece| room.push(piece)))
}

/// A range, and how much surface its items have.
#[derive(Clone, Copy, Debug)]
struct Extent {
    range: PrimitiveRange,
    surface: f64,
    largest: f32,
}

impl Extent {
    #[inline(always)]
    fn new<S: Simd>(items: &[Record]) -> Self {
        let (mut surface, mut largest) = (0.0, 0f32);
        for item in items {
            let area = half_area(&item.0);
            surface += f64::from(area);
            largest = largest.max(area);
        }
        Self { range: PrimitiveRange::new::<S>(items, 0), surface, largest }
    }

    /// By all threads; sums are of chunks, and do not depend on these.
    fn of_many(items: &[Record], isa: Present) -> Self {
        let of_chunk = |items| isa::dispatch(isa, ExtentKernel(items));
        let chunks: Vec<Self> = items.par_chunks(CHUNK).map(of_chunk).collect();
        let nothing = Self { range: PrimitiveRange::EMPTY, surface: 0.0, largest: 0.0 };
        let join = |all: Self, chunk: Self| Self {
            range: all.range.union(chunk.range),
            surface: all.surface + chunk.surface,
            largest: all.largest.max(chunk.largest),
        };
        let whole = chunks.into_iter().fold(nothing, join);
        Self { range: PrimitiveRange { len: items.len() as u32, ..whole.range }, ..whole }
    }

    /// Whether a plane is looked for where so many new references are left.
    fn may_be_cut(&self, spare: usize) -> bool {
        self.weight() > 0.0 && spare > 0 && spare.saturating_mul(SCARCE) >= self.range.len as usize
    }

    /// Its share in what may be added: none where nothing is looked for.
    fn weight(&self) -> f64 {
        let (area, mean) = (f64::from(self.range.half_area()), self.surface / f64::from(self.range.len));
        let is_fine =
            self.surface <= COVERED * area && f64::from(self.largest) <= (LARGE_BOX.0 * mean).max(LARGE_BOX.1 * area);
        if self.range.len <= RULE.block || is_fine || !self.surface.is_finite() { 0.0 } else { self.surface }
    }
}

/// What all ranges are divided with.
struct Splitter<'a> {
    meshes: &'a Meshes,
    isa: Present,
    /// Surface that two sides may have in common.
    overlap: f32,
}

impl Splitter<'_> {
    /// Pieces of `items`, the range `extent` with so many divisions above it, of which there may be `spare` more.
    fn divide(&self, mut items: Vec<Record>, extent: &Extent, spare: usize, depth: usize) -> Vec<Vec<Record>> {
        let range = &extent.range;
        if !extent.may_be_cut(spare) || depth == MAX_DEPTH {
            return vec![items];
        }
        if items.len() + spare <= SMALL {
            return vec![isa::dispatch(self.isa, TaskKernel { splitter: self, items, extent: *extent, spare })];
        }
        let mut shared = Shared { rule: &RULE, items: &mut items, base: 0, isa: self.isa };
        let split = shared.find(range);
        let halves = shared.apply(range, &split);
        let plane = self.is_worth_a_look(&halves).then(|| self.plane_of_many(&items, range)).flatten();
        let plane = plane.filter(|plane| plane.is_better(&halves, spare));
        // One after the other: how many are cut counts.
        let sides = plane.map(|plane| plane.sides_of(&items, self.meshes, spare));
        let sides = sides.filter(|sides| sides.iter().all(|side| !side.is_empty())).unwrap_or_else(|| {
            let right = items.split_off(halves[0].len as usize);
            // It may stay as it is until the end.
            items.shrink_to_fit();
            [std::mem::take(&mut items), right]
        });
        drop(items);
        let extents = sides.each_ref().map(|side| Extent::of_many(side, self.isa));
        let spare = spare - (sides[0].len() + sides[1].len() - range.len as usize);
        let [left_weight, right_weight] = extents.each_ref().map(Extent::weight);
        let of_left = (spare as f64 * share(left_weight, right_weight)) as usize;
        let [left, right] = sides;
        let (mut pieces, others) = rayon::join(
            || self.divide(left, &extents[0], of_left, depth + 1),
            || self.divide(right, &extents[1], spare - of_left, depth + 1),
        );
        pieces.extend(others);
        pieces
    }

    /// Whether the sides of a division have so much in common that a plane is looked for.
    #[inline(always)]
    fn is_worth_a_look(&self, [left, right]: &[PrimitiveRange; 2]) -> bool {
        half_area_of_common(&left.bounds, &right.bounds) > self.overlap
    }

    /// The best plane that cuts, by all threads.
    fn plane_of_many(&self, items: &[Record], range: &PrimitiveRange) -> Option<Plane> {
        let Self { meshes, isa, .. } = *self;
        let of_chunk = |items| Box::new(isa::dispatch(isa, SlabsKernel { items, bounds: &range.bounds, meshes }));
        let slabs = items.par_chunks(CHUNK).map(of_chunk).reduce_with(|mut all, chunk| {
            all.join::<Portable>(&chunk);
            all
        })?;
        slabs.best::<Portable>(&Grid::new::<Portable>(&range.bounds), &RULE)
    }
}

/// What comes to the first of two weights; nothing where neither has any.
fn share(weight: f64, other: f64) -> f64 {
    weight / (weight + other).max(f64::MIN_POSITIVE)
}

/// Half the surface of what two boxes have in common.
#[inline(always)]
fn half_area_of_common(left: &[f32; 8], right: &[f32; 8]) -> f32 {
    let mut common = [0.0; 8];
    for lane in 0..8 {
        common[lane] = left[lane].min(right[lane]);
    }
    let is_empty = (0..3).any(|axis| common[axis] + common[axis + 4] < 0.0);
    if is_empty { 0.0 } else { half_area(&common) }
}

/// [`Extent::new`].
struct ExtentKernel<'a>(&'a [Record]);

impl Kernel for ExtentKernel<'_> {
    type Output = Extent;

    #[inline(always)]
    fn run<S: Simd>(self) -> Extent {
        Extent::new::<S>(self.0)
    }
}

/// Items in the slabs of a box.
struct SlabsKernel<'a> {
    items: &'a [Record],
    bounds: &'a [f32; 8],
    meshes: &'a Meshes,
}

impl Kernel for SlabsKernel<'_> {
    type Output = Slabs<{ bins::MANY }>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { items, bounds, meshes } = self;
        let mut slabs = Slabs::EMPTY;
        slabs.add_all::<S>(items, &Grid::new::<S>(bounds), meshes);
        slabs
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::World;
    use crate::math::{Aabb, Vec3};
    use crate::trace::bvh::build::triangle_items;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::isa::Isa;
    use crate::trace::bvh::{Bvh, Options, Preset};
    use crate::trace::{Part as Mesh, Primitives};

    fn mesh(triangles: &[[Vec3; 3]]) -> Mesh {
        let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let positions = Arc::new(triangles.as_flattened().to_vec());
        Mesh { geometry: 0, instance: 0, primitives: Primitives::Triangles { positions, triangles: Arc::new(indices) } }
    }

    /// Triangles of a size, anywhere.
    fn soup(count: usize, size: f32) -> Vec<[Vec3; 3]> {
        let mut random = Random::new(count as u64);
        let mut triangle = || {
            let middle = random.vec3();
            [(); 3].map(|()| middle + size * random.vec3())
        };
        (0..count).map(|_| triangle()).collect()
    }

    /// A wavy surface of 2 n^2 triangles.
    fn surface(n: u32) -> Vec<[Vec3; 3]> {
        let at = |x: u32, y: u32| {
            let (x, y) = (2.0 * x as f32 / n as f32 - 1.0, 2.0 * y as f32 / n as f32 - 1.0);
            Vec3::new(x, y, 0.05 * libm::sinf(5.0 * x) * libm::cosf(6.0 * y))
        };
        let two = |x, y| [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]];
        (0..n).flat_map(|y| (0..n).flat_map(move |x| two(x, y))).collect()
    }

    fn pieces_of(triangles: &[[Vec3; 3]], isa: Isa) -> Vec<Record> {
        let parts = [mesh(triangles)];
        let meshes = Meshes::new(&parts);
        pieces(triangle_items(&meshes), &meshes, isa.demand())
    }

    fn bits(pieces: &[Record]) -> Vec<[u32; 8]> {
        pieces.iter().map(|piece| piece.0.map(f32::to_bits)).collect()
    }

    /// Every point of a triangle is in a piece, which is no larger than the triangle; and there are not more than there
    /// may be.
    #[test]
    fn pieces_cover_their_triangles() {
        // Of one thread, and of several.
        for (count, size, fineness, least) in [(300, 0.4, 30, 1.1), (2000, 0.3, 90, 1.1), (300, 0.2, 0, 1.0)] {
            let triangles = [soup(count, size), surface(fineness)].concat();
            let mut pieces = pieces_of(&triangles, Isa::detect());
            let share = pieces.len() as f64 / triangles.len() as f64;
            assert!((least..=1.0 + BUDGET).contains(&share), "{count} of size {size}: {share}");
            pieces.sort_by_key(Record::primitive);
            for own in pieces.chunk_by(|a, b| a.primitive() == b.primitive()) {
                let corners = triangles[own[0].primitive() as usize];
                let whole = Aabb::around(corners);
                assert!(own.iter().all(|piece| piece.bounds().union(whole) == whole));
                let [a, b, c] = corners.map(Vec3::as_dvec3);
                for (i, j) in (0..=12).flat_map(|i| (0..=12 - i).map(move |j| (i, j))) {
                    let point = a + (b - a) * (f64::from(i) / 12.0) + (c - a) * (f64::from(j) / 12.0);
                    let contains = |piece: &Record| {
                        let Aabb { min, max } = piece.bounds();
                        min.as_dvec3().cmple(point + 1e-15).all() && max.as_dvec3().cmpge(point - 1e-15).all()
                    };
                    assert!(own.iter().any(contains), "triangle {}: {point}", own[0].primitive());
                }
            }
            let named = pieces.chunk_by(|a, b| a.primitive() == b.primitive()).count();
            assert_eq!(named, triangles.len(), "none is left out");
        }
    }

    /// Meshes that nothing divides, and those of which nothing can be measured.
    #[test]
    fn odd_meshes_are_cut_or_left() {
        let one = [Vec3::new(-1.0, 0.5, 0.2), Vec3::new(0.3, 1.0, -0.4), Vec3::new(0.8, -0.9, 0.9)];
        let scaled = |scale: f32, by: Vec3| move |triangle: &[Vec3; 3]| triangle.map(|corner| corner * scale + by);
        let many = soup(700, 0.7);
        let cases: [Vec<[Vec3; 3]>; 9] = [
            Vec::new(),
            vec![one],
            vec![one; 20_000],
            // Concentric, far from zero: centres are a few steps of f32 apart.
            (1..=500).map(|i| scaled(10.0 + i as f32, Vec3::splat(1e6))(&one)).collect(),
            many.iter().map(scaled(9e17, Vec3::ZERO)).collect(),
            many.iter().map(scaled(1e-30, Vec3::ZERO)).collect(),
            many.iter().map(scaled(1e-42, Vec3::ONE)).collect(),
            many.iter().map(|&[a, b, _]| [a, b, b]).collect(),
            many.iter().map(|triangle| triangle.map(|corner| corner.with_y(0.0))).collect(),
        ];
        for (case, triangles) in cases.into_iter().enumerate() {
            let mut pieces = pieces_of(&triangles, Isa::detect());
            assert!(pieces.len() as f64 <= (1.0 + BUDGET) * triangles.len() as f64, "case {case}");
            pieces.sort_by_key(Record::primitive);
            let groups = pieces.chunk_by(|a, b| a.primitive() == b.primitive());
            assert_eq!(groups.clone().count(), triangles.len(), "case {case}");
            for (own, corners) in groups.zip(&triangles) {
                // What is cut covers all corners, and is within what they span.
                let all = own.iter().fold(Aabb::EMPTY, |all, piece| all.union(piece.bounds()));
                assert_eq!(all, Aabb::around(*corners), "case {case}");
            }
        }
    }

    #[test]
    fn a_surface_is_left_as_it_is() {
        let triangles = surface(100);
        let pieces = pieces_of(&triangles, Isa::detect());
        assert_eq!(bits(&pieces), bits(&triangle_items(&Meshes::new(&[mesh(&triangles)]))));
    }

    #[test]
    fn pieces_are_the_same_for_any_number_of_threads_and_instruction_set() {
        // Several chunks, of bins too.
        let triangles = [soup(9000, 0.3), surface(150)].concat();
        let of = |isa, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            bits(&pool.install(|| pieces_of(&triangles, isa)))
        };
        let first = of(Isa::Portable, 1);
        for isa in Isa::available() {
            for threads in [1, 3] {
                assert!(of(isa, threads) == first, "{isa:?}, {threads} threads");
            }
        }
    }

    /// Cut by planes that are only guessed, triangles over a surface gave a tree that cost more than uncut; a few that
    /// are much larger than all else, among pieces of which a sample sees none, made nodes that cost more than what is
    /// in them.
    #[test]
    fn trees_cost_less_than_of_what_is_whole() {
        let floor = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, y]| Vec3::new(x, y, -0.1));
        let floor = vec![[floor[0], floor[1], floor[2]], [floor[0], floor[2], floor[3]]];
        let cases = [
            ([soup(300, 0.4), surface(30)].concat(), 0.93),
            ([soup(2000, 0.3), surface(90)].concat(), 0.94),
            ([soup(2000, 0.05), surface(90)].concat(), 0.99),
            ([floor.clone(), surface(90)].concat(), 1.001),
            ([floor, soup(1000, 0.2), surface(60)].concat(), 0.995),
            // Little is won here, and hardly anything lost.
            (soup(2000, 0.3), 1.01),
            ([soup(5000, 0.05), surface(150)].concat(), 1.02),
        ];
        for (case, (triangles, most)) in cases.into_iter().enumerate() {
            let mut world = World::default();
            world.parts = vec![mesh(&triangles)];
            world.fixed = 0..1;
            let cost = |preset| Bvh::build_with(&world, Options { preset, ..Options::default() }).sah_cost();
            let share = cost(Preset::High) / cost(Preset::Default);
            assert!(share <= most, "case {case}: {share}");
        }
    }
}
