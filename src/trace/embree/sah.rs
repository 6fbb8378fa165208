//! What trees of Embree's own builder cost by the surface area heuristic, so that trees can be compared and not only
//! rates.
//!
//! Embree does not show the trees of its scenes. But `rtcBuildBVH` runs the same builder on boxes. It is given the
//! boxes of the triangles and the settings that Embree 3.13 and 4 use for scenes of eight children a node and blocks of
//! four triangles (`kernels/bvh/bvh_builder_sah.cpp`), and what it makes is counted as
//! [`Bvh::sah_cost`](crate::trace::bvh::Bvh::sah_cost) counts. To read nodes out of Embree's private memory, the
//! alternative, depends on the version.

use super::builder::{self, Item, Rule, item};
use super::device::Device;
use super::{Options, Quality};
use crate::error::Result;
use crate::math::{Aabb, Vec3, is_traceable};
use crate::trace::bvh::Bvh;
use crate::trace::{Part, Primitives, World};

/// Triangles in a block of Embree's.
const BLOCK: u32 = 4;
/// Most items in a leaf of a scene: seven blocks.
const MAX_IN_LEAF: u32 = 7 * BLOCK;

/// The surface area heuristic's cost of the trees that Embree's builder makes for `world`: in tests of a block as the
/// native tree has them ([`Bvh::BLOCK`](crate::trace::bvh::Bvh::BLOCK)), of which a node costs `node_cost`. High
/// quality splits triangles, except where scenes are robust or compact: there it is medium, as in Embree. 0 for an
/// empty world.
///
/// # Errors
/// [`Error::Backend`](crate::Error::Backend) for what Embree reports.
pub fn sah_cost(world: &World, options: &Options, node_cost: f64) -> Result<f64> {
    let device = Device::new(options.threads, options.instructions)?;
    let quality = match options.quality {
        Quality::High if options.robust || options.compact => Quality::Medium,
        quality => quality,
    };
    let level = |parts: &[Part]| Level::new(&device, parts, quality, node_cost);
    let objects = world.objects.iter().map(|parts| level(&world.parts[parts.clone()]));
    let objects = objects.collect::<Result<Vec<_>>>()?;
    let fixed = level(&world.parts[world.fixed.clone()])?;

    let boxes: Vec<Aabb> =
        world.placements.iter().map(|placement| placement.bounds(objects[placement.object as usize].bounds)).collect();
    let items = boxes.iter().zip(0..).filter(|(bounds, _)| !bounds.is_empty()).map(|(bounds, i)| item(bounds, 0, i));
    let of_object = |item: &Item| {
        let object = &objects[world.placements[item.primID as usize].object as usize];
        object.cost / area(object.bounds).max(f64::MIN_POSITIVE)
    };
    let leaf = |items: &[Item]| items.iter().map(of_object).sum();
    let rule = Rule {
        quality: quality.min(Quality::Medium),
        block: 1,
        most: 1,
        leaf: &leaf,
        node: node_cost,
        corners: &|_, _| None,
    };
    let placed = builder::cost(&device, items.collect(), &rule)?;
    let whole = area(boxes.into_iter().fold(fixed.bounds, Aabb::union));
    Ok(if whole > 0.0 { (fixed.cost + placed) / whole } else { 0.0 })
}

/// Everything in one coordinate system: a tree of triangles, and one of shapes.
struct Level {
    /// Tests times half areas.
    cost: f64,
    bounds: Aabb,
}

impl Level {
    fn new(device: &Device, parts: &[Part], quality: Quality, node_cost: f64) -> Result<Self> {
        let corners = |part: u32, primitive: u32| corners(parts, part, primitive);
        let (mut triangles, mut shapes, mut bounds) = (Vec::new(), Vec::new(), Aabb::EMPTY);
        for (part, p) in parts.iter().zip(0..) {
            let mut add = |items: &mut Vec<Item>, own: Aabb, i: u32| {
                items.push(item(&own, p, i));
                bounds = bounds.union(own);
            };
            match &part.primitives {
                Primitives::Triangles { triangles: list, .. } => {
                    for i in 0..list.len() as u32 {
                        let traceable = |corners: &[Vec3; 3]| corners.iter().all(|&corner| is_traceable(corner));
                        if let Some(corners) = corners(p, i).filter(traceable) {
                            add(&mut triangles, Aabb::around(corners), i);
                        }
                    }
                }
                Primitives::Shapes(list) => {
                    for (shape, i) in list.iter().zip(0..).filter(|(shape, _)| !shape.bounds().is_empty()) {
                        add(&mut shapes, shape.bounds(), i);
                    }
                }
            }
        }
        let blocks = |items: &[Item]| items.len().div_ceil(Bvh::BLOCK) as f64;
        let rule = Rule { quality, block: BLOCK, most: MAX_IN_LEAF, leaf: &blocks, node: node_cost, corners: &corners };
        let of_triangles = builder::cost(device, triangles, &rule)?;
        let count = |items: &[Item]| items.len() as f64;
        let rule = Rule { quality: quality.min(Quality::Medium), block: 1, leaf: &count, ..rule };
        Ok(Self { cost: of_triangles + builder::cost(device, shapes, &rule)?, bounds })
    }
}

/// The corners of a triangle; None where it has none.
fn corners(parts: &[Part], part: u32, primitive: u32) -> Option<[Vec3; 3]> {
    let Primitives::Triangles { positions, triangles } = &parts.get(part as usize)?.primitives else { return None };
    let [a, b, c] = triangles.get(primitive as usize)?.map(|i| positions.get(i as usize).copied());
    Some([a?, b?, c?])
}

fn area(bounds: Aabb) -> f64 {
    f64::from(bounds.half_area())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Material, Mesh, Scene, architecture, rocks, terrain};
    use crate::shape::{Shape, Sphere};

    fn of_geometry(geometry: Geometry) -> World {
        World::new(&Scene::from_geometries(vec![geometry], vec![Material::default()])).unwrap()
    }

    fn of_mesh(mesh: Mesh) -> World {
        of_geometry(Geometry::Mesh(mesh))
    }

    fn cost(world: &World, quality: Quality, node_cost: f64) -> f64 {
        let options = Options { quality, robust: false, threads: Some(1), ..Options::default() };
        sah_cost(world, &options, node_cost).unwrap()
    }

    #[test]
    fn a_leaf_costs_its_blocks_and_the_node_above_it() {
        let triangle = of_mesh(Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::ONE], vec![[0, 1, 2]]));
        assert_eq!(cost(&triangle, Quality::Medium, 2.0), 3.0);
        assert_eq!(Bvh::build(&triangle).sah_cost(), Bvh::NODE_COST + 1.0);
        // Nothing divides what is in one place: two blocks of triangles, or a leaf of each under one node.
        let nine = of_mesh(Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::ONE], vec![[0, 1, 2]; 9]));
        assert_eq!(cost(&nine, Quality::Medium, 2.0), 4.0);
        let ball = |x| Shape::Sphere(Sphere { centre: Vec3::X * x, radius: 1.0 });
        let balls = of_geometry(Geometry::Shapes { shapes: vec![ball(0.0), ball(98.0)], material: 0 });
        // Boxes of 2 x 2 x 2 in one of 100 x 2 x 2: half areas of 12 and 404.
        assert!((cost(&balls, Quality::Medium, 2.0) - (2.0 + 2.0 * 12.0 / 404.0)).abs() < 1e-6);
        assert_eq!(cost(&World::default(), Quality::Medium, 2.0), 0.0);
    }

    #[test]
    fn native_trees_cost_no_more_than_a_twentieth_more() {
        let worlds = [of_mesh(terrain(80)), of_mesh(architecture(3)), World::new(&rocks(60)).unwrap()];
        // What is placed has a tighter box in a native tree, since not the object's box is turned but what is in it.
        for (world, (name, most)) in worlds.iter().zip([("terrain", 1.5), ("architecture", 1.5), ("rocks", 2.0)]) {
            let (native, embree) = (Bvh::build(world).sah_cost(), cost(world, Quality::Medium, Bvh::NODE_COST));
            assert!(native < 1.05 * embree && embree < most * native, "{name}: {native}, embree {embree}");
        }
        let building = &worlds[1];
        let [low, medium, high] = [Quality::Low, Quality::Medium, Quality::High].map(|q| cost(building, q, 2.0));
        assert!(high < 0.95 * medium && medium < low, "{low} {medium} {high}: splits are worth it");
        let robust = Options { quality: Quality::High, threads: Some(1), ..Options::default() };
        assert_eq!(sah_cost(building, &robust, 2.0).unwrap(), medium, "Embree does not split where it is robust");
    }
}
