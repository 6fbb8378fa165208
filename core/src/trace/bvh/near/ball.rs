//! Boxes that a ball reaches, near ones first: for callers who measure distances themselves (Embree's point queries).
//!
//! Squared distances are computed in f32, each within 4 units in the last place, and the ball is larger by more than
//! that. Those beyond f32 are the largest number, which a ball reaches that is as large.

use crate::math::Vec3;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::alone::VisitFlow;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::node::{Child, Node};
use crate::trace::bvh::query::Closest;
use crate::trace::bvh::simd::isa::{self, Kernel};
use crate::trace::bvh::simd::{Mask, Simd, Vector};
use crate::trace::bvh::tree::Tree;
use crate::trace::bvh::walk::{self, Enter, Visit};

impl Bvh {
    /// Names fixed triangles, by geometry and primitive, whose box is no farther from `point` than the radius that
    /// `visitor` returns last (at first `radius`), near ones mostly first, until it has seen enough; and some that are
    /// farther by a millionth. What is placed by transforms, and what is no triangle, is not named. In the high preset
    /// a triangle may come several times.
    pub fn visit_near(&self, point: Vec3, radius: f32, visitor: &mut dyn FnMut(u32, u32) -> VisitFlow) {
        if self.has_fixed() && point.is_finite() {
            let triangles = &self.fixed.triangles;
            isa::dispatch(self.isa, NearTriangles { triangles, ball: Ball { point }, radius, visitor });
        }
    }
}

/// A point, and boxes within some distance of it, squared.
pub(in crate::trace::bvh) struct Ball {
    pub point: Vec3,
}

/// What squared distances are held against; less than 0 for what is no distance.
#[inline(always)]
fn limit(radius: f32) -> f32 {
    if radius >= 0.0 { (radius * radius * (1.0 + 1e-6) + f32::MIN_POSITIVE).min(f32::MAX) } else { -1.0 }
}

impl Ball {
    /// Shows `leaf` the leaves of `tree` that the ball reaches; it returns the radius from there on, none where it has
    /// seen enough.
    #[inline(always)]
    pub fn walk<S: Simd>(&self, tree: &Tree, radius: f32, mut leaf: impl FnMut(Child) -> Option<f32>) {
        walk::single::<S, Closest>(
            tree,
            self,
            limit(radius),
            #[inline(always)]
            |child| leaf(child).map_or(Visit::Stop, |radius| Visit::Until(limit(radius))),
        );
    }

    /// The squared distance of what is between `low` and `high`, a box a lane.
    #[inline(always)]
    fn squared<V: Vector>(&self, low: [V; 3], high: [V; 3]) -> V {
        let zero = V::splat(0.0);
        let mut square = zero;
        for axis in 0..3 {
            let p = V::splat(self.point[axis]);
            let outside = low[axis].sub(p).max(p.sub(high[axis])).max(zero);
            square = outside.mul_add(outside, square);
        }
        square.min(V::splat(f32::MAX))
    }

    /// A bit for each triangle of a block whose box is reached.
    #[inline(always)]
    fn reached<S: Simd>(&self, block: &Block, radius: f32) -> u32 {
        let [x, y, z] = [S::corners(block, 0), S::corners(block, Block::AXIS), S::corners(block, 2 * Block::AXIS)];
        let low = [lowest(x), lowest(y), lowest(z)];
        let high = [highest(x), highest(y), highest(z)];
        self.squared(low, high).at_most(S::V8::splat(limit(radius))).bits() & block.lanes
    }
}

#[inline(always)]
fn row<S: Simd>(node: &Node, k: u32) -> S::V8 {
    S::row(node, k * Node::ROW)
}

#[inline(always)]
fn lowest<V: Vector>([a, b, c]: [V; 3]) -> V {
    a.min(b).min(c)
}

#[inline(always)]
fn highest<V: Vector>([a, b, c]: [V; 3]) -> V {
    a.max(b).max(c)
}

impl Enter for Ball {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        let low = [row::<S>(node, 0), row::<S>(node, 2), row::<S>(node, 4)];
        let high = [row::<S>(node, 1), row::<S>(node, 3), row::<S>(node, 5)];
        let square = self.squared(low, high);
        (square.at_most(S::V8::splat(limit)), square)
    }

    /// Slots without a child are as far away as anything can be, which may be near enough.
    #[inline(always)]
    fn select<S: Simd>(&self, node: &Node, children: u32) -> u32 {
        node.occupied() & children
    }
}

struct NearTriangles<'a, 'v> {
    triangles: &'a TriangleTree,
    ball: Ball,
    radius: f32,
    visitor: &'a mut (dyn FnMut(u32, u32) -> VisitFlow + 'v),
}

impl Kernel for NearTriangles<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { triangles, ball, mut radius, visitor } = self;
        ball.walk::<S>(
            triangles.tree(),
            radius,
            #[inline(always)]
            |leaf| {
                for index in leaf.blocks() {
                    let mut scratch = None;
                    let block = triangles.block::<S>(index, &mut scratch);
                    let mut open = ball.reached::<S>(block, radius);
                    while open != 0 {
                        let lane = open.trailing_zeros() as usize % LANES;
                        open &= open - 1;
                        match visitor(triangles.part(block.part[lane]).geometry, block.primitive[lane]) {
                            VisitFlow::Continue(wanted) => {
                                if wanted < radius {
                                    open &= ball.reached::<S>(block, wanted);
                                }
                                radius = wanted;
                            }
                            VisitFlow::Break(()) => return None,
                        }
                    }
                }
                Some(radius)
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Aabb, Random};
    use crate::scene::{Geometry, Mesh, Scene};
    use crate::trace::World;
    use crate::trace::bvh::simd::isa::Isa;
    use crate::trace::bvh::{BoxTree, Options, Preset};

    fn triangles(random: &mut Random, count: usize) -> Vec<[Vec3; 3]> {
        let triangle = |i: usize| {
            let centre = random.vector() * 4.0;
            // On a grid, flat, large, and far from zero.
            let centre = if i.is_multiple_of(3) { (centre * 2.0).round() / 2.0 } else { centre };
            let centre = centre + if i.is_multiple_of(11) { Vec3::X * 1e4 } else { Vec3::ZERO };
            let size = if i.is_multiple_of(50) { 2.0 } else { 0.1 };
            let flat = if i.is_multiple_of(5) { Vec3::new(1.0, 1.0, 0.0) } else { Vec3::ONE };
            [(); 3].map(|()| centre + random.vector() * flat * size)
        };
        (0..count).map(triangle).collect()
    }

    fn bvh(triangles: &[[Vec3; 3]], preset: Preset, isa: Isa) -> Bvh {
        let positions = triangles.as_flattened().to_vec();
        let mesh = Mesh::new(positions, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect());
        let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], Vec::new());
        Bvh::build_with(&World::new(&scene).expect("sound"), Options { preset, isa, ..Options::default() })
    }

    /// From a point to a box, in f64.
    fn distance(bounds: &Aabb, point: Vec3) -> f64 {
        let (min, max, point) = (bounds.min.as_dvec3(), bounds.max.as_dvec3(), point.as_dvec3());
        (min - point).max(point - max).max(crate::math::DVec3::ZERO).length()
    }

    /// What is within the radius is named, and hardly anything else; by all presets and instruction sets, among
    /// triangles and among boxes.
    #[test]
    fn what_a_ball_reaches_is_named() {
        let mut random = Random::new(64, 1);
        let triangles = triangles(&mut random, 3000);
        let boxes: Vec<Aabb> = triangles.iter().map(|&corners| Aabb::around(corners)).collect();
        let points: Vec<(Vec3, f32)> = (0..300)
            .map(|i| {
                let near = boxes[random.below(3000) as usize];
                let point =
                    [random.vector() * 5.0, near.max, near.min - Vec3::X * 0.5, Vec3::splat(1e6), Vec3::X * 3e19]
                        [i % 5];
                (point, [0.0, 0.5, 1.0, 1e-30, 3.0, f32::INFINITY, -1.0, f32::NAN, 1e30][i % 9])
            })
            .collect();
        for isa in Isa::available() {
            let (tree, order) = BoxTree::build(&boxes, Options { isa, ..Options::default() });
            for preset in [Preset::Default, Preset::Fast, Preset::High, Preset::Compact, Preset::FastCompact] {
                // In the coordinates of the world, whose centre is elsewhere.
                let bvh = bvh(&triangles, preset, isa);
                for &(point, radius) in &points {
                    let mut seen = [vec![0; 3000], vec![0; 3000]];
                    bvh.visit_near(point, radius, &mut |geometry, primitive| {
                        assert_eq!(geometry, 0);
                        seen[0][primitive as usize] += 1;
                        VisitFlow::Continue(radius)
                    });
                    tree.visit_near(point, radius, &mut |i| {
                        seen[1][order[i as usize] as usize] += 1;
                        VisitFlow::Continue(radius)
                    });
                    for (i, bounds) in boxes.iter().enumerate() {
                        let (near, radius) = (distance(bounds, point), f64::from(radius));
                        let case = format!("{isa:?} {preset:?} {i} {point} {radius}: {near}");
                        if near <= radius {
                            assert!(seen[0][i] == 1 || seen[0][i] > 1 && preset == Preset::High, "{case}");
                            assert_eq!(seen[1][i], 1, "{case}");
                        }
                        assert!(seen[0][i] == 0 || near <= radius + 1e-6 * (radius + 1.0), "{case}");
                    }
                }
            }
        }
    }

    /// A visitor who measures comes to the nearest, seeing few; and one who has seen enough sees no more.
    #[test]
    fn a_radius_that_shrinks_leaves_the_nearest() {
        let mut random = Random::new(64, 2);
        let triangles = triangles(&mut random, 3000);
        let boxes: Vec<Aabb> = triangles.iter().map(|&corners| Aabb::around(corners)).collect();
        let bvh = bvh(&triangles, Preset::Default, Isa::detect());
        let mut seen = 0;
        for _ in 0..300 {
            let point = random.vector() * 5.0;
            let nearest = boxes.iter().map(|bounds| distance(bounds, point)).fold(f64::INFINITY, f64::min);
            let mut best = f64::INFINITY;
            bvh.visit_near(point, f32::INFINITY, &mut |_, primitive| {
                seen += 1;
                best = best.min(distance(&boxes[primitive as usize], point));
                VisitFlow::Continue(best as f32)
            });
            assert_eq!(best, nearest);
            let mut alone = 0;
            bvh.visit_near(point, f32::INFINITY, &mut |_, _| {
                alone += 1;
                VisitFlow::Break(())
            });
            assert_eq!(alone, 1);
        }
        assert!(seen < 300 * 60, "{seen}");
    }
}
