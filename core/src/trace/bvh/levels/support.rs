//! How far objects reach in any direction: their support functions (Rockafellar 1970, *Convex analysis*), for the boxes
//! around them where they are placed.
//!
//! Of a box around a placed object each side is the object's support in one direction of its own coordinates. That of
//! its own box would do, but is half as wide again for a ball that is turned. So the object's tree is searched for what
//! lies farthest, down to corners, which takes a third of a microsecond and more.
//!
//! For an object that is placed often it is [tabulated](Table) instead.

use rayon::prelude::*;

use super::Level;
use super::table::Table;
use crate::math::{Aabb, DMat3, DVec3};
use crate::trace::Placement;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::simd::isa::{self, Kernel, Present};

/// Nodes and leaves that are visited at most for all that is placed, so that many objects that are placed now and then
/// do not take long; where objects hold shapes as well, as many again for these.
const ALL_VISITS: usize = 1 << 20;

/// But no fewer than these for an entry of a table, which is worth it: each serves many placements.
const MIN_VISITS: usize = 16;

/// The boxes around objects where they are placed.
pub(super) struct Outlines<'a> {
    objects: &'a [Level],
    isa: Present,
    /// One for each object that is placed often.
    tables: Vec<Option<Table>>,
    /// For each search of other objects.
    visits: usize,
}

impl<'a> Outlines<'a> {
    /// For `placements` of `objects`.
    pub fn new<'b>(objects: &'a [Level], isa: Present, placements: impl Iterator<Item = &'b Placement>) -> Self {
        // What moves has two boxes, at its start and at its end.
        let mut boxes = vec![0; objects.len()];
        for placement in placements.filter(|placement| !objects[placement.object as usize].bounds().is_empty()) {
            boxes[placement.object as usize] += if placement.motion.is_some() { 2 } else { 1 };
        }
        let searches = boxes.iter().map(|&boxes| Table::cells(boxes).map_or(6 * boxes, Table::entries));
        let visits = ALL_VISITS / searches.sum::<usize>().max(1);
        let table = |(level, &boxes): (&Level, &usize)| {
            let support = |ways: &[_], values: &mut _| level.farthest(isa, ways, visits.max(MIN_VISITS), values);
            Table::cells(boxes).map(|cells| Table::new(cells, support))
        };
        Self { objects, isa, tables: objects.par_iter().zip(&boxes).map(table).collect(), visits }
    }

    /// The box around `placement`, at all times.
    pub fn around(&self, placement: &Placement) -> Aabb {
        let [start, end] = self.ends(placement);
        start.union(end)
    }

    /// The boxes around it at time 0 and at time 1, as [`Placement::ends_of`] says.
    pub fn ends(&self, placement: &Placement) -> [Aabb; 2] {
        isa::dispatch_narrow(self.isa, Ends { outlines: self, placement })
    }
}

/// [`Outlines::ends`].
struct Ends<'a> {
    outlines: &'a Outlines<'a>,
    placement: &'a Placement,
}

impl Kernel for Ends<'_> {
    type Output = [Aabb; 2];
    #[inline(always)]
    fn run<S: Simd>(self) -> [Aabb; 2] {
        let Self { outlines: Outlines { objects, tables, visits, .. }, placement } = self;
        let level = &objects[placement.object as usize];
        let (bounds, table) = (level.bounds(), &tables[placement.object as usize]);
        placement.ends_of(
            bounds,
            #[inline(always)]
            |rows| {
                let [along, against] = match table {
                    Some(table) => table.extents::<S>(rows),
                    None => searched::<S>(level, rows, *visits),
                };
                let [most, most_against] = bounds.extents(rows);
                // Of what is not a number the second counts.
                [along.min(most), against.min(most_against)]
            },
        )
    }
}

/// How far an object reaches along each row of a matrix and against it, searched for.
#[inline(always)]
fn searched<S: Simd>(level: &Level, rows: &DMat3, visits: usize) -> [DVec3; 2] {
    if visits == 0 {
        return [DVec3::INFINITY; 2];
    }
    // Rows of a matrix of f32, so nothing is lost. They differ much; what one finds first is of little use to the next,
    // and does no harm.
    let [x, y, z] = [0, 1, 2].map(|axis| rows.row(axis).as_vec3());
    let mut values = [0.0; 6];
    level.search::<S>(&[x, y, z, -x, -y, -z], visits, &mut values);
    let [x, y, z, rest @ ..] = values;
    [DVec3::new(x, y, z), DVec3::from_array(rest)]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::math::{DAffine3, Vec3};
    use crate::scene::{Geometry, Group, Instance, Mesh, Scene};
    use crate::shape::{Shape, Sphere};
    use crate::trace::bvh::Bvh;
    use crate::trace::bvh::build::preset::{Options, Preset};
    use crate::trace::bvh::random::Random;
    use crate::trace::{Primitives, World};

    /// A mesh that is placed once, and may move.
    fn placed(mesh: Mesh, transform: DAffine3, transform_end: Option<DAffine3>) -> World {
        let scene = Scene {
            geometries: vec![Geometry::Mesh(mesh)],
            groups: vec![Group { name: String::new(), geometries: 0..1 }],
            instances: vec![instance(0, transform, transform_end)],
            materials: Vec::new(),
            ..Scene::default()
        };
        World::placed(&scene).expect("sound")
    }

    fn turned() -> DAffine3 {
        DAffine3 {
            matrix3: DMat3::from_rotation_z(TAU / 8.0) * DMat3::from_rotation_x(TAU / 8.0),
            translation: DVec3::new(5.0, 0.0, 0.0),
        }
    }

    fn ball() -> Mesh {
        const STEPS: u32 = 48;
        let point = |i: u32, j: u32| {
            let (around, up) = (TAU * f64::from(i) / f64::from(STEPS), TAU * f64::from(j) / f64::from(2 * STEPS));
            DVec3::new(up.sin() * around.cos(), up.sin() * around.sin(), up.cos()).as_vec3()
        };
        let positions = (0..=STEPS).flat_map(|j| (0..STEPS).map(move |i| point(i, j))).collect();
        let faces = (0..STEPS).flat_map(|j| (0..STEPS).map(move |i| (j * STEPS, i, (i + 1) % STEPS)));
        let triangles = faces
            .flat_map(|(row, i, k)| [[row + i, row + k, row + STEPS + k], [row + i, row + STEPS + k, row + STEPS + i]]);
        Mesh::new(positions, triangles.collect())
    }

    /// Triangles of all sizes here and there.
    fn soup(random: &mut Random) -> Mesh {
        let mut positions = Vec::new();
        for _ in 0..300 {
            let (place, size) = (random.vec3() * 10.0, 10.0_f32.powf(2.0 * random.unit() - 1.0));
            positions.extend([random.vec3(), random.vec3(), random.vec3()].map(|corner| place + corner * size));
        }
        Mesh::new(positions, (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }

    /// A ball that is turned by an eighth is no wider than before, though its box would be; and no corner is outside.
    #[test]
    fn what_is_turned_is_held_tightly() {
        let ball = ball();
        let world = placed(ball.clone(), turned(), None);
        let bounds = Bvh::build(&world).placements.tree().bounds();
        let to_world = world.placements[0].to_world.as_daffine3();
        for position in ball.positions.iter() {
            let at = to_world.transform_point3(position.as_dvec3());
            let outside = (bounds.min.as_dvec3() - at).max(at - bounds.max.as_dvec3()).max_element();
            assert!(outside <= 0.0, "{at} is {outside:e} out of {bounds:?}");
        }
        let size = bounds.size();
        assert!(size.max_element() < 2.03, "{size}: the ball's diameter is 2, its turned box's 2.8 and more");
    }

    /// The same of shapes, by the boxes around them.
    #[test]
    fn shapes_that_are_turned_are_held_tightly() {
        let shapes = ball().positions.iter().map(|&centre| Shape::Sphere(Sphere { centre, radius: 0.02 })).collect();
        let scene = Scene {
            geometries: vec![Geometry::Shapes { shapes, material: 0 }],
            groups: vec![Group { name: String::new(), geometries: 0..1 }],
            instances: vec![instance(0, turned(), None)],
            ..Scene::default()
        };
        let world = World::placed(&scene).expect("sound");
        let size = Bvh::build(&world).placements.tree().bounds().size();
        assert!(
            size.max_element() < 2.15,
            "{size}: balls on a ball of diameter 2, whose turned box would be 2.8 and more"
        );
        assert!(size.min_element() > 2.03, "{size}");
    }

    /// The same of what moves, at every time.
    #[test]
    fn what_moves_is_held_on_its_way() {
        let mesh = soup(&mut Random::new(3));
        let end = DAffine3 { matrix3: DMat3::from_rotation_y(0.4) * 1.5, translation: DVec3::new(-3.0, 8.0, 1.0) };
        let world = placed(mesh.clone(), turned(), Some(end));
        let placement = &world.placements[0];
        assert!(placement.motion.is_some());
        let bvh = Bvh::build(&world);
        let (object, bounds) = (bvh.objects[0].bounds(), bvh.moving.boxes().bounds());
        for i in 0..=10_u8 {
            let to_world = placement.at(f32::from(i) / 10.0).to_world.as_daffine3();
            for position in mesh.positions.iter() {
                let at = to_world.transform_point3(position.as_dvec3());
                let outside = (bounds.min.as_dvec3() - at).max(at - bounds.max.as_dvec3()).max_element();
                assert!(outside <= 0.0, "{at} is {outside:e} out of {bounds:?}");
            }
        }
        let loose: Aabb = placement.bounds(object);
        assert!(bounds.half_area() < 0.95 * loose.half_area(), "{bounds:?} for {loose:?}");
    }

    /// Every corner is within what is said to be farthest, however few nodes may be visited, at all sizes, of all ways
    /// together, on every instruction set; and with many visits one of them is there.
    #[test]
    fn nothing_is_farther_than_the_farthest() {
        let mut random = Random::new(5);
        for case in 0..24 {
            let scale = [1.0, 1e-20, 3e-44, 1e15][case % 4];
            let offset = [Vec3::ZERO, Vec3::splat(30.0), Vec3::new(-50.0, 70.0, -20.0)][case / 4 % 3];
            let thickness = Vec3::new(1.0, 1.0, if case < 12 { 1.0 } else { 0.0 });
            let mesh = if case % 8 < 4 { ball() } else { soup(&mut random) };
            let moved = mesh.positions.iter().map(|&at| (at + offset) * thickness * scale).collect();
            let world = placed(Mesh::new(moved, mesh.triangles.to_vec()), DAffine3::IDENTITY, None);
            // Where the tracer has them, which may be nearer to zero.
            let Primitives::Triangles { positions, .. } = &world.parts[world.objects[0].start].primitives else {
                unreachable!("a mesh")
            };
            let mut ways = vec![Vec3::X, Vec3::NEG_Y, Vec3::new(0.0, -0.0, -1.0), Vec3::ONE, Vec3::ZERO, -Vec3::ZERO];
            // Products that underflow, and that overflow.
            ways.extend([Vec3::splat(-1e-45), Vec3::splat(1e20), Vec3::new(1e38, -1e38, 1.0), Vec3::splat(f32::MAX)]);
            ways.extend((0..12).map(|i| random.vec3() * [1.0, 1e-30, 1e18][i % 3]));
            for preset in Preset::ALL {
                let bvh = Bvh::build_with(&world, Options { preset, ..Options::default() });
                let level = &bvh.objects[0];
                for visits in [0, 1, 2, 3, 7, 20, 10_000] {
                    let found = farthest(level, &ways, visits);
                    for (&way, farthest) in ways.iter().zip(found) {
                        let most = reach(positions, way.as_dvec3());
                        let context = format!("{most:e} along {way} after {visits} of {preset:?}, case {case}");
                        assert!(farthest >= most, "{farthest:e} < {context}");
                        // The 256th part of the width to spare, and rounding.
                        let (wide, size) = (level.bounds().size(), level.triangles.tree().reach());
                        let [wide, size] = [wide, size].map(|v| f64::from(way.abs().dot(v)));
                        if visits == 10_000 && scale == 1.0 && farthest.is_finite() {
                            assert!(farthest <= most + wide / 250.0 + size * 2e-6 + 1e-37, "{farthest:e} > {context}");
                        }
                    }
                }
            }
        }
    }

    /// What the search finds, the same on every instruction set.
    fn farthest(level: &Level, ways: &[Vec3], visits: usize) -> Vec<f64> {
        let on = |isa| {
            let mut found = vec![0.0; ways.len()];
            level.farthest(isa, ways, visits, &mut found);
            found
        };
        let found: Vec<Vec<f64>> = Present::all().map(on).collect();
        assert!(found.iter().all(|farthest| *farthest == found[0]), "{found:?} along {ways:?}, {visits} visits");
        found.into_iter().next().expect("the portable one")
    }

    /// The farthest of all corners along `way`, in f64.
    fn reach(positions: &[Vec3], way: DVec3) -> f64 {
        positions.iter().map(|at| at.as_dvec3().dot(way)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn instance(group: u32, transform: DAffine3, transform_end: Option<DAffine3>) -> Instance {
        Instance { name: String::new(), group, transform, transform_end }
    }

    /// Turned, stretched and moved anyhow.
    fn anyhow(random: &mut Random, size: f64) -> DAffine3 {
        let turn = DMat3::from_quat(glam::DQuat::from_scaled_axis(random.vec3().as_dvec3() * 3.0));
        let stretch = DMat3::from_diagonal((random.vec3().as_dvec3() + 1.5) * size);
        DAffine3 { matrix3: turn * stretch, translation: random.vec3().as_dvec3() * 10.0 * size }
    }

    /// Whatever is placed, however often, large or small, whether it moves: no point of it is outside its box, and the
    /// box is no larger than the one around the object's own box; on one thread the same as on several, whatever the
    /// instruction set.
    #[test]
    fn boxes_hold_what_is_placed() {
        let mut random = Random::new(13);
        let soup = soup(&mut random);
        let centre = Vec3::new(12.0, 1.0, -2.0);
        let sphere = || Geometry::Shapes { shapes: vec![Shape::Sphere(Sphere { centre, radius: 3.0 })], material: 0 };
        for (times, size, moves) in
            [(1, 1.0, false), (127, 1.0, true), (128, 1e-12, false), (300, 1.0, true), (4096, 1e12, false)]
        {
            // Triangles, shapes, both, and nothing.
            let geometries = vec![Geometry::Mesh(soup.clone()), sphere(), Geometry::Mesh(soup.clone()), sphere()];
            let groups = [0..1, 1..2, 2..4, 4..4].map(|geometries| Group { name: String::new(), geometries });
            let instances = (0..4 * times).map(|i| {
                let transform = anyhow(&mut random, size);
                let end = DAffine3 { translation: transform.translation * 1.5, ..transform };
                instance(i % 4, transform, moves.then_some(end))
            });
            let scene =
                Scene { geometries, groups: groups.to_vec(), instances: instances.collect(), ..Scene::default() };
            let world = World::placed(&scene).expect("sound");
            let bvh = Bvh::build(&world);
            let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let outlines = |isa| Outlines::new(&bvh.objects, isa, world.placements.iter());
            let again: Vec<Outlines<'_>> = Present::all().map(|isa| pool(1).install(|| outlines(isa))).collect();
            let outlines = pool(4).install(|| outlines(bvh.isa));
            let mut tables = 0;
            for placement in &world.placements {
                let (level, bounds) = (&bvh.objects[placement.object as usize], outlines.around(placement));
                assert!(again.iter().all(|outlines| outlines.around(placement) == bounds), "{bounds:?}");
                tables += usize::from(outlines.tables[placement.object as usize].is_some());
                let loose = placement.bounds(level.bounds());
                assert_eq!(bounds.union(loose), loose);
                let inside = |at: DVec3, to_world: &DAffine3| {
                    let at = to_world.transform_point3(at);
                    let outside = (bounds.min.as_dvec3() - at).max(at - bounds.max.as_dvec3()).max_element();
                    assert!(outside <= 0.0, "{at} is {outside:e} out of {bounds:?}");
                };
                for time in [0.0, 0.3, 1.0] {
                    let to_world = placement.at(time).to_world.as_daffine3();
                    if !level.triangles.tree().is_empty() {
                        soup.positions.iter().step_by(7).for_each(|at| inside(at.as_dvec3(), &to_world));
                    }
                    if !level.shapes.tree().is_empty() {
                        let rows = [0, 1, 2].map(|axis| to_world.matrix3.row(axis));
                        let poles = rows.map(|row| row.normalize() * 3.0);
                        for pole in poles.into_iter().flat_map(|pole| [pole, -pole]) {
                            inside(centre.as_dvec3() + pole * 0.999_999, &to_world);
                        }
                    }
                }
            }
            let has_tables = times >= 128 || moves && times >= 64;
            assert_eq!(tables, if has_tables { 3 * times as usize } else { 0 }, "{times}");
        }
    }

    /// Placed often, an object is held nearly as tightly as where it is placed once.
    #[test]
    fn what_is_placed_often_is_held_tightly() {
        let (ball, mut random) = (ball(), Random::new(11));
        for times in [127, 128, 4096] {
            let placed = |_| {
                let turn = DMat3::from_quat(glam::DQuat::from_scaled_axis(random.vec3().as_dvec3() * 3.0));
                instance(0, DAffine3 { matrix3: turn, translation: DVec3::splat(5.0) }, None)
            };
            let scene = Scene {
                geometries: vec![Geometry::Mesh(ball.clone())],
                groups: vec![Group { name: String::new(), geometries: 0..1 }],
                instances: (0..times).map(placed).collect(),
                ..Scene::default()
            };
            let world = World::placed(&scene).expect("sound");
            let bvh = Bvh::build(&world);
            let outlines = Outlines::new(&bvh.objects, bvh.isa, world.placements.iter());
            assert_eq!(outlines.tables[0].is_some(), times >= 128, "{times}");
            for placement in &world.placements {
                let (bounds, to_world) = (outlines.around(placement), placement.to_world.as_daffine3());
                for position in ball.positions.iter().step_by(13) {
                    let at = to_world.transform_point3(position.as_dvec3());
                    let outside = (bounds.min.as_dvec3() - at).max(at - bounds.max.as_dvec3()).max_element();
                    assert!(outside <= 0.0, "{at} is {outside:e} out of {bounds:?}");
                }
                let size = bounds.size();
                assert!(size.max_element() < 2.08, "{size}: the ball's diameter is 2, its turned box's up to 3.5");
            }
        }
    }
}
