//! The upper level: a tree over placed objects that stand still.

use rayon::prelude::*;

use super::build::{self, Record};
use super::level::Level;
use super::node::Tree;
use super::place::{Blur, Place};
use super::preset::Options;
use super::query::Query;
use super::simd::Simd;
use super::slab::SlabRay;
use super::walk::{self, Visit};
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::Placement;
use crate::trace::spread::Spread;

/// All that stand still, in the order of the tree's leaves.
pub(super) struct PlacementTree {
    tree: Tree,
    places: Vec<Place>,
    has_triangles: bool,
    has_shapes: bool,
    spread: Spread,
}

/// Visits of nodes for the boxes of all placements together, so that many of them do not take long: some 50 for each of 2,500
/// in each of six directions, more than are needed, and none for 200,000.
const VISITS: usize = 1 << 17;

/// A tree over those placements that `is_wanted`, and which each of them is, in the order of its leaves: one a leaf, for to enter an
/// object costs many times what the test of its box does.
pub(super) fn tree_over(
    placements: &[Placement],
    is_wanted: impl Fn(&Placement) -> bool + Sync,
    objects: &[Level],
    options: &Options<'_>,
) -> (Tree, Vec<usize>) {
    let visits = VISITS / placements.len().max(1);
    let item = |(i, placement): (usize, &Placement)| {
        let bounds = objects[placement.object as usize].placed_bounds(placement, visits);
        (!bounds.is_empty()).then_some(Record::new(&bounds, 0, i as u32))
    };
    let wanted = placements.par_iter().enumerate().filter(|(_, placement)| is_wanted(placement));
    let mut items: Vec<Record> = wanted.filter_map(item).collect();
    let tree = build::build(&mut items, 1, 1, options);
    (tree, items.iter().map(|item| item.primitive() as usize).collect())
}

/// How far rays of placed shapes stray from where they are in the world.
pub(super) fn spread_over<'a>(placements: impl IntoIterator<Item = &'a Placement>, objects: &[Level]) -> Spread {
    placements.into_iter().fold(Spread::NONE, |spread, placement| {
        let shapes = objects[placement.object as usize].shapes.tree();
        if shapes.is_empty() { spread } else { spread.include(placement, &shapes.bounds()) }
    })
}

/// A ray made ready for the boxes of what is placed, which strays by `spread`.
#[inline(always)]
pub(super) fn among_boxes<S: Simd>(tree: &Tree, ray: &Ray, spread: &Spread) -> SlabRay {
    // Rounded up.
    let origin = (spread.of(ray).max_element() * 1.01) as f32;
    SlabRay::new::<S>(ray, tree.reach(), Blur { origin, ..Blur::NONE })
}

/// Calls `enter` with the number of every placement whose box the ray enters, or may enter where it strays by `spread`; it says how far
/// the ray still looks.
#[inline(always)]
pub(super) fn walk_over<S: Simd, Q: Query>(
    tree: &Tree,
    ray: &Ray,
    spread: &Spread,
    limit: f32,
    mut enter: impl FnMut(u32) -> Visit,
) {
    let slab = among_boxes::<S>(tree, ray, spread);
    walk::single::<S, Q>(
        tree,
        &slab,
        limit,
        #[inline(always)]
        |leaf| {
            let mut visit = Visit::Until(limit);
            for number in leaf.blocks() {
                visit = enter(number);
            }
            visit
        },
    );
}

/// The place of what is not placed: the fixed triangles. No placement has this number, since a leaf could not name it.
pub(super) const FIXED: u32 = u32::MAX;

impl PlacementTree {
    /// Takes those that stand still. `objects` are what is placed.
    pub fn build(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> Self {
        let (tree, order) = tree_over(placements, |placement| placement.motion.is_none(), objects, options);
        let place = |i: usize| {
            let placement = placements[i].clone();
            let triangles = &objects[placement.object as usize].triangles;
            let (reach, grain) = (triangles.tree().reach(), triangles.grain());
            Place::new(placement, reach).with_grain(grain)
        };
        let places: Vec<Place> = order.into_iter().map(place).collect();
        let any = |test: fn(&Level) -> bool| places.iter().any(|place| test(&objects[place.placement.object as usize]));
        let has_triangles = any(|level| !level.triangles.tree().is_empty());
        let has_shapes = any(|level| !level.shapes.tree().is_empty());
        let spread = spread_over(places.iter().map(|place| &place.placement), objects);
        Self { tree, places, has_triangles, has_shapes, spread }
    }

    /// Whether nothing is placed.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// How many they are.
    pub fn len(&self) -> u32 {
        self.places.len() as u32
    }

    /// Whether some object that is placed has triangles.
    pub fn has_triangles(&self) -> bool {
        self.has_triangles
    }

    /// Whether some object that is placed has shapes.
    pub fn has_shapes(&self) -> bool {
        self.has_shapes
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// As [`spread_over`] says.
    pub fn spread(&self) -> &Spread {
        &self.spread
    }

    /// As [`Tree::reach`].
    pub fn reach(&self) -> Vec3 {
        self.tree.reach()
    }

    /// All of them, as leaves number them: a leaf holds one.
    #[inline(always)]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The placement with that number.
    #[inline(always)]
    pub fn at(&self, number: u32) -> &Place {
        &self.places[number as usize]
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.places[..])
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::math::{Aabb, DAffine3, DMat3, DVec3};
    use crate::scene::{Geometry, Group, Instance, Mesh, Scene};
    use crate::trace::World;
    use crate::trace::bvh::Bvh;
    use crate::trace::bvh::preset::Preset;
    use crate::trace::bvh::random::Random;

    /// A mesh that is placed once, and may move.
    fn placed(mesh: Mesh, transform: DAffine3, transform_end: Option<DAffine3>) -> World {
        let scene = Scene {
            geometries: vec![Geometry::Mesh(mesh)],
            groups: vec![Group { name: String::new(), geometries: 0..1 }],
            instances: vec![Instance { name: String::new(), group: 0, transform, transform_end }],
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

    /// The same of what moves, at every time.
    #[test]
    fn what_moves_is_held_on_its_way() {
        let mesh = soup(&mut Random::new(3));
        let end = DAffine3 { matrix3: DMat3::from_rotation_y(0.4) * 1.5, translation: DVec3::new(-3.0, 8.0, 1.0) };
        let world = placed(mesh.clone(), turned(), Some(end));
        let placement = &world.placements[0];
        assert!(placement.motion.is_some());
        let bvh = Bvh::build(&world);
        let (object, bounds) = (bvh.objects[0].bounds(), bvh.objects[0].placed_bounds(placement, 1000));
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

    /// Every corner is within what is said to be farthest, however few nodes may be visited; and with many, one of them is there.
    #[test]
    fn nothing_is_farther_than_the_farthest() {
        let mut random = Random::new(5);
        for mesh in [ball(), soup(&mut random)] {
            let world = placed(mesh.clone(), DAffine3::IDENTITY, None);
            for preset in Preset::ALL {
                let bvh = Bvh::build_with(&world, Options { preset, ..Options::default() });
                let level = &bvh.objects[0];
                let mut ways = vec![Vec3::X, Vec3::NEG_Y, Vec3::new(0.0, -0.0, -1.0), Vec3::ONE, Vec3::ZERO];
                ways.extend((0..20).map(|_| random.vec3()));
                for way in ways {
                    let reach = mesh.positions.iter().map(|at| at.as_dvec3().dot(way.as_dvec3()));
                    let most = reach.fold(f64::NEG_INFINITY, f64::max);
                    for visits in [0, 1, 2, 7, 10_000] {
                        let farthest = level.triangles.farthest(way, visits);
                        assert!(farthest >= most, "{farthest} < {most} along {way} after {visits} of {preset:?}");
                    }
                    // The 256th part of the width to spare, and rounding.
                    let wide = f64::from(way.abs().dot(level.bounds().size()));
                    let farthest = level.triangles.farthest(way, 10_000);
                    assert!(farthest <= most + wide / 250.0 + 1e-5, "{farthest} > {most} along {way}, {preset:?}");
                }
            }
        }
    }
}
