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
use super::walk::{self, Stack, Visit};
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

/// Visits of nodes for the boxes of all placements together, so that many of them do not take long: some 50 for each of 2,500 in each of six
/// directions, more than are needed, and none for 200,000.
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

/// Calls `enter` with the number of every placement whose box the ray enters, or may enter where it strays by `spread`; it says how far
/// the ray still looks.
#[inline(always)]
pub(super) fn walk_over<S: Simd, Q: Query>(
    tree: &Tree,
    ray: &Ray,
    spread: &Spread,
    limit: f32,
    stack: &mut Stack,
    mut enter: impl FnMut(u32) -> Visit,
) {
    // Rounded up.
    let origin = (spread.of(ray).max_element() * 1.01) as f32;
    let slab = SlabRay::new::<S>(ray, tree.reach(), Blur { origin, ..Blur::NONE });
    walk::single::<S, Q>(
        stack,
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
            let reach = objects[placement.object as usize].triangles.tree().reach();
            Place::new(placement, reach)
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
    use crate::math::{DAffine3, DMat3, DVec3};
    use crate::scene::{Geometry, Group, Instance, Mesh, Scene};
    use crate::trace::World;
    use crate::trace::bvh::Bvh;

    /// A ball that is turned by an eighth is no wider than before, though its box would be; and no corner is outside.
    #[test]
    fn what_is_turned_is_held_tightly() {
        const STEPS: u32 = 48;
        let point = |i: u32, j: u32| {
            let (around, up) = (TAU * f64::from(i) / f64::from(STEPS), TAU * f64::from(j) / f64::from(2 * STEPS));
            DVec3::new(up.sin() * around.cos(), up.sin() * around.sin(), up.cos()).as_vec3()
        };
        let positions: Vec<Vec3> = (0..=STEPS).flat_map(|j| (0..STEPS).map(move |i| point(i, j))).collect();
        let faces = (0..STEPS).flat_map(|j| (0..STEPS).map(move |i| (j * STEPS, i, (i + 1) % STEPS)));
        let triangles = faces
            .flat_map(|(row, i, k)| [[row + i, row + k, row + STEPS + k], [row + i, row + STEPS + k, row + STEPS + i]]);
        let transform = DAffine3 {
            matrix3: DMat3::from_rotation_z(TAU / 8.0) * DMat3::from_rotation_x(TAU / 8.0),
            translation: DVec3::new(5.0, 0.0, 0.0),
        };
        let scene = Scene {
            geometries: vec![Geometry::Mesh(Mesh::new(positions.clone(), triangles.collect()))],
            groups: vec![Group { name: String::new(), geometries: 0..1 }],
            instances: vec![Instance { name: String::new(), group: 0, transform, transform_end: None }],
            materials: Vec::new(),
            ..Scene::default()
        };
        let world = World::placed(&scene).expect("sound");
        let bounds = Bvh::build(&world).placements.tree().bounds();
        let place = |p: &Vec3| (transform.transform_point3(p.as_dvec3()) - world.centre).as_vec3();
        // The transform is rounded to f32.
        let outside = |p: Vec3| (bounds.min - p).max(p - bounds.max).max_element();
        assert!(positions.iter().map(place).map(outside).fold(-1.0, f32::max) < 1e-5, "{bounds:?}");
        let size = bounds.size();
        assert!(size.max_element() < 2.03, "{size}: the ball's diameter is 2, its turned box's 2.8 and more");
    }
}
