//! A tree without some of its triangles: they are taken out of their leaves, and boxes stay.
//!
//! As fast as what is taken out is small, whatever the tree's size. Rays still enter the boxes, so a tree of which much
//! is gone is better built anew.

use super::Bvh;
use super::overlap::visit_overlapping;
use crate::math::Aabb;

impl Bvh {
    /// Takes the fixed triangles of some geometries out, each of which has the box that is given with it around what
    /// can be hit, in the tree's coordinates: no ray hits them any more. By rising geometry. Whether it could: a
    /// compact tree does not hold triangles itself, and stays as it was. What is taken out is not put back by
    /// [`Bvh::refit`], which is an error then.
    pub fn take_out(&mut self, geometries: &[(u32, Aabb)]) -> bool {
        if !self.has_fixed() {
            return true;
        }
        let triangles = &mut self.fixed.triangles;
        let (mut blocks, all) = (Vec::new(), triangles.leaves().len());
        for (_, bounds) in geometries {
            visit_overlapping(triangles.tree(), self.isa, bounds, &mut |block| blocks.push(block));
            // Many, or some that lie in each other: to go through all is less work.
            if blocks.len() > all {
                blocks = (0..all as u32).collect();
                break;
            }
        }
        triangles.take_out(|geometry| geometries.binary_search_by_key(&geometry, |(id, _)| *id).is_ok(), &blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Random, Vec3};
    use crate::ray::Ray;
    use crate::scene::{Geometry, Mesh, Scene};
    use crate::trace::bvh::simd::isa::Isa;
    use crate::trace::bvh::{Options, Preset};
    use crate::trace::{Tracer, World};

    /// Three soups in one place.
    fn soups(random: &mut Random) -> Vec<Geometry> {
        let mut soup = |count: u32| {
            let corner = |random: &mut Random| random.vector();
            let triangles = (0..count).flat_map(|_| {
                let centre = corner(random);
                [(); 3].map(|()| centre + corner(random) * 0.1)
            });
            let positions: Vec<Vec3> = triangles.collect();
            Geometry::Mesh(Mesh::new(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()))
        };
        vec![soup(3000), soup(500), soup(1)]
    }

    /// What is left is hit as in a tree of that alone, by every way of asking.
    #[test]
    fn what_is_taken_out_is_not_hit() {
        let mut random = Random::new(64, 3);
        let soups = soups(&mut random);
        let world = World::new(&Scene::from_geometries(soups.clone(), Vec::new())).expect("sound");
        let bounds: Vec<Aabb> = world.parts.iter().map(crate::trace::Part::bounds).collect();
        let rays: Vec<Ray> = (0..500)
            .map(|_| {
                let origin = random.vector() * 3.0;
                Ray::new(origin, random.vector() - origin)
            })
            .collect();
        for isa in Isa::available() {
            for preset in [Preset::Default, Preset::High, Preset::Fast] {
                let options = Options { preset, isa, ..Options::default() };
                let mut bvh = Bvh::build_with(&world, options);
                let mut left = vec![0, 1, 2];
                // One after the other, and two at once, whose boxes lie in each other.
                let turns = if preset == Preset::Fast { [&[0u32, 2][..], &[1]] } else { [&[1][..], &[0, 2]] };
                for gone in turns {
                    let leaving: Vec<(u32, Aabb)> = gone.iter().map(|&id| (id, bounds[id as usize])).collect();
                    assert!(bvh.take_out(&leaving));
                    left.retain(|geometry| !gone.contains(geometry));
                    let mut rest = world.clone();
                    rest.parts.retain(|part| left.contains(&part.geometry));
                    rest.fixed = 0..rest.parts.len();
                    let expected = Bvh::build_with(&rest, options);
                    for ray in &rays {
                        let hit = expected.closest(ray);
                        assert_eq!(bvh.closest(ray), hit, "{isa:?} {preset:?} without {gone:?}: {ray:?}");
                        assert_eq!(bvh.occluded(ray), hit.is_some());
                    }
                    let batch = crate::trace::Batch::default();
                    let (mut hits, mut others) = (vec![None; rays.len()], vec![None; rays.len()]);
                    bvh.closest_batch(&rays, &mut hits, batch);
                    expected.closest_batch(&rays, &mut others, batch);
                    assert_eq!(hits, others);
                }
                assert!(rays.iter().all(|ray| bvh.closest(ray).is_none()));
                assert!(bvh.refit(&world).is_err());
            }
            let mut compact = Bvh::build_with(&world, Options { preset: Preset::Compact, isa, ..Options::default() });
            let before: Vec<_> = rays.iter().map(|ray| compact.closest(ray)).collect();
            assert!(!compact.take_out(&[(1, bounds[1])]));
            assert!(rays.iter().zip(before).all(|(ray, hit)| compact.closest(ray) == hit));
        }
    }
}
