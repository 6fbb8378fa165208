//! Files with right digests and wrong trees: what a digest cannot find.

use std::mem::offset_of;

use super::*;
use crate::math::{Random, UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;
use crate::scene::{Geometry, Material, Mesh, Scene, architecture, terrain};
use crate::trace::bvh::block::Block;
use crate::trace::bvh::node::{Child, WIDTH};
use crate::trace::{Batch, Tracer};

/// Below `end`, 0 where that is 0.
fn below(random: &mut Random, end: usize) -> usize {
    random.below(end.max(1) as u64) as usize
}

/// A world, the tree over it, and rays whose hits are known.
struct Case {
    world: World,
    preset: Preset,
    folder: tempfile::TempDir,
    rays: Vec<Ray>,
    hits: Vec<Option<crate::Hit>>,
    nodes: Vec<Node>,
    /// Blocks, word by word.
    words: Vec<u32>,
}

fn hits(bvh: &Bvh, rays: &[Ray]) -> Vec<Option<crate::Hit>> {
    let mut hits = vec![None; rays.len()];
    bvh.closest_batch(rays, &mut hits, Batch::default());
    hits
}

impl Case {
    fn new(mesh: Mesh, preset: Preset) -> Self {
        let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
        let world = World::new(&scene).expect("a sound scene");
        let bvh = Bvh::build_with(&world, preset.into());
        let (bounds, mut random) = (world.bounds(), Random::new(7, 0));
        let mut point = |scale: f32| {
            let unit = random.vector();
            bounds.centre() + unit * bounds.size() * scale
        };
        let rays: Vec<Ray> = (0..300)
            .map(|_| {
                let origin = point(1.5);
                Ray::new(origin, point(0.4) - origin)
            })
            .collect();
        let hits = hits(&bvh, &rays);
        assert!(hits.iter().flatten().count() > 100);
        let tree = &bvh.fixed.triangles;
        let (nodes, words) = (tree.tree().nodes().to_vec(), bytemuck::cast_slice(tree.leaves().as_bytes()).to_vec());
        Self { world, preset, folder: tempfile::tempdir().expect("a folder"), rays, hits, nodes, words }
    }

    /// What becomes of a file with these arrays and the right digests; hits are the right ones in any case.
    #[track_caller]
    fn read(&self, nodes: &[Node], words: &[u32]) -> CacheReport {
        let cache = Cache::open(self.folder.path()).expect("a folder");
        let key = digest::of_levels(&levels(&self.world), self.preset);
        file::write(&cache.path(&key), &key, &[bytemuck::cast_slice(nodes), bytemuck::cast_slice(words)])
            .expect("written");
        let (bvh, report) = cache.bvh(&self.world, self.preset.into());
        assert_eq!(hits(&bvh, &self.rays), self.hits, "{report:?}");
        report
    }

    /// That the tree after `change` is refused with these words.
    #[track_caller]
    fn refuses(&self, words: &str, change: impl FnOnce(&mut Vec<Node>, &mut Vec<u32>)) {
        let (mut nodes, mut blocks) = (self.nodes.clone(), self.words.clone());
        change(&mut nodes, &mut blocks);
        let report = self.read(&nodes, &blocks);
        assert_eq!(report.used, CacheUse::Written, "{words}");
        let [warning] = &report.warnings[..] else { panic!("one warning: {report:?}") };
        assert!(warning.message.contains(words), "{words} in {}", warning.message);
        assert_eq!(self.read(&self.nodes, &self.words).used, CacheUse::Read);
    }

    /// A slot of a node, neither the root nor in it, that holds such a child.
    fn slot(&self, wanted: impl Fn(Child) -> bool) -> (usize, usize) {
        let all = (1..self.nodes.len()).flat_map(|node| (0..WIDTH).map(move |slot| (node, slot)));
        let found = all.into_iter().find(|&(node, slot)| wanted(self.nodes[node].child[slot]));
        found.expect("there is one")
    }
}

fn is_leaf(child: Child) -> bool {
    child != Child::NONE && child.is_leaf()
}

#[test]
fn wrong_nodes_are_refused() {
    for preset in Preset::ALL {
        let case = Case::new(terrain(40), preset);
        let count = case.nodes.len() as u32;
        let (leaf, leaf_slot) = case.slot(is_leaf);
        let (empty, empty_slot) = case.slot(|child| child == Child::NONE);
        let root_slot = (0..WIDTH).find(|&slot| !case.nodes[0].child[slot].is_leaf()).expect("an inner child");
        let other = case.nodes[0].child.iter().rposition(|child| !child.is_leaf()).expect("an inner child");

        let child = |node: usize, slot: usize, child: Child| {
            move |nodes: &mut Vec<Node>, _: &mut Vec<u32>| nodes[node].child[slot] = child
        };
        case.refuses("cannot be one", child(0, root_slot, Child::ROOT));
        case.refuses("cannot be one", child(leaf, leaf_slot, Child::inner(leaf as u32)));
        case.refuses("cannot be one", child(0, root_slot, Child::inner(count)));
        case.refuses("which are not there", child(leaf, leaf_slot, Child::leaf(1 << 28, 1)));
        case.refuses("impossible box", child(empty, empty_slot, Child::leaf(0, 1)));
        case.refuses("impossible box", child(0, root_slot, Child::NONE));
        case.refuses("no other leads to", |nodes, _| {
            let none = Node::empty();
            (0..6).for_each(|row| nodes[0].bounds[row][root_slot] = none.bounds[row][0]);
            nodes[0].child[root_slot] = Child::NONE;
        });
        case.refuses("leads to", |nodes, _| {
            // Twice below one node, and another node nowhere.
            let all = nodes[0].bounds();
            let same = nodes[0].child[other];
            nodes[0].set(root_slot, &all, same);
            nodes[0].set(other, &all, same);
        });
        for (component, value, words) in [
            (0, f32::NAN, "impossible box"),
            (1, f32::INFINITY, "impossible box"),
            (2, f32::NEG_INFINITY, "impossible box"),
            (0, 1e9, "does not hold its child"),
            (5, -1e9, "does not hold its child"),
        ] {
            case.refuses(words, |nodes, _| nodes[0].bounds[component][root_slot] = value);
        }
        let words = if preset == Preset::High { "lacks a piece" } else { "does not hold its triangles" };
        case.refuses(words, |nodes, _| {
            // The triangles are in it, but on the side that is farthest from zero it is not wide.
            let size = |row: usize| nodes[leaf].bounds[row][leaf_slot].abs();
            let row = (0..6).max_by(|&a, &b| size(a).total_cmp(&size(b))).expect("six");
            let inwards = if row % 2 == 0 { 6.0 } else { -6.0 };
            let side = &mut nodes[leaf].bounds[row][leaf_slot];
            *side += side.abs() * inwards * UNIT_ROUNDOFF;
        });
        case.refuses(words, |nodes, _| {
            let low = nodes[leaf].bounds[0][leaf_slot];
            nodes[leaf].bounds[1][leaf_slot] = low;
        });
        case.refuses("hangs in two places", |nodes, _| blocks_twice(nodes));
        case.refuses("too deep", |nodes, _| {
            let root = (nodes[0].bounds(), nodes.clone());
            let added = 40;
            for child in nodes.iter_mut().flat_map(|node| &mut node.child).filter(|child| !child.is_leaf()) {
                *child = Child::inner(child.node() + added);
            }
            let chain = (1..=added).map(|next| {
                let mut node = Node::empty();
                node.set(0, &root.0, Child::inner(next));
                node
            });
            *nodes = chain.chain(std::mem::take(nodes)).collect();
        });
        case.refuses("no array", |_, words| words.truncate(3));
        case.refuses("lacks triangle 0", |nodes, words| {
            nodes.clear();
            words.clear();
        });
    }
}

/// One more leaf, in an empty slot, of the blocks that another leaf of the same node has.
fn blocks_twice(nodes: &mut [Node]) {
    let twice = nodes.iter_mut().find_map(|node| {
        let leaf = node.child.iter().position(|&child| is_leaf(child))?;
        let empty = node.child.iter().position(|&child| child == Child::NONE)?;
        node.bounds.iter_mut().for_each(|row| row[empty] = row[leaf]);
        node.child[empty] = node.child[leaf];
        Some(())
    });
    twice.expect("a node with a leaf and with room");
}

#[test]
fn wrong_blocks_are_refused() {
    let case = Case::new(terrain(40), Preset::Compact);
    let none = u32::MAX;
    let full = case.words.chunks(LANES).position(|block| !block.contains(&none)).expect("a full block") * LANES;
    let partial = case.words.chunks(LANES).position(|block| block.contains(&none)).expect("a partial one") * LANES;
    case.refuses("is not of this mesh", |_, words| words[full] = 3200);
    case.refuses("is not of this mesh", |_, words| words[full + 1] = none);
    case.refuses("is not of this mesh", |_, words| words[partial..partial + LANES].fill(none));
    case.refuses("lacks triangle", |_, words| words[full + LANES - 1] = none);
    case.refuses("in two leaves", |_, words| {
        let block = words[partial..].iter().position(|&word| word == none).expect("it is partial");
        words[partial + block] = words[partial];
    });
    case.refuses("does not hold its triangles", |_, words| words.swap(0, case.words.len() / 2));

    let case = Case::new(terrain(40), Preset::Default);
    let word = |offset: usize| offset / size_of::<u32>();
    let (corner, primitive) = (word(offset_of!(Block, corners)), word(offset_of!(Block, primitive)));
    let (part, size, lanes) =
        (word(offset_of!(Block, part)), word(offset_of!(Block, size)), word(offset_of!(Block, lanes)));
    for word in [corner, primitive, part, size, lanes] {
        case.refuses("is not of this mesh", |_, words| words[word] ^= 1);
    }
    case.refuses("is not of this mesh", |_, words| words[primitive] = none);
    case.refuses("is not of this mesh", |_, words| words[part] = none);
    case.refuses("is not of this mesh", |_, words| words[lanes] = 0);
}

#[test]
fn triangles_that_cannot_be_hit_are_in_no_leaf() {
    let mut mesh = terrain(30);
    std::sync::Arc::make_mut(&mut mesh.positions)[40] = Vec3::NAN;
    let case = Case::new(mesh, Preset::Compact);
    assert_eq!(case.read(&case.nodes, &case.words).used, CacheUse::Read);
    let lost = case.world.parts.iter().find_map(|part| match &part.primitives {
        crate::trace::Primitives::Triangles { triangles, .. } => triangles.iter().position(|t| t.contains(&40)),
        crate::trace::Primitives::Shapes(_) => None,
    });
    let lost = lost.expect("a triangle has the corner") as u32;
    case.refuses("cannot be hit", |_, words| words[0] = lost);
}

#[test]
fn whatever_is_accepted_gives_the_right_hits() {
    let (mut accepted, mut refused) = (0, 0);
    for (preset, mesh) in Preset::ALL.into_iter().flat_map(|preset| [(preset, terrain(12)), (preset, architecture(1))])
    {
        let case = Case::new(mesh, preset);
        let mut random = Random::new(preset as u64, 0);
        for _ in 0..200 {
            let (mut nodes, mut words) = (case.nodes.clone(), case.words.clone());
            for _ in 0..1 + below(&mut random, 2) {
                let (node, slot, other) =
                    (below(&mut random, nodes.len()), below(&mut random, WIDTH), below(&mut random, nodes.len()));
                match below(&mut random, 10) {
                    0 => nodes[node].child[slot] = Child(random.bits() as u32),
                    1 => nodes[node].child[slot] = nodes[other].child[below(&mut random, WIDTH)],
                    2 => nodes[node].child[slot] = Child::inner(other as u32),
                    3 => nodes.swap(node, other),
                    4 => nodes[node].bounds[below(&mut random, 6)][slot] = f32::from_bits(random.bits() as u32),
                    5 | 6 => {
                        let component = below(&mut random, 6);
                        let grown = nodes[node].bounds[component][slot] * (0.8 + 0.4 * random.unit());
                        nodes[node].bounds[component][slot] = grown;
                    }
                    7 => {
                        let (a, b) = (below(&mut random, words.len()), below(&mut random, words.len()));
                        words[a] = words[b];
                    }
                    8 => {
                        let (a, b) = (below(&mut random, words.len()), below(&mut random, words.len()));
                        words.swap(a, b);
                    }
                    _ => {
                        let word = below(&mut random, words.len());
                        words[word] = words[word].wrapping_add(1);
                    }
                }
            }
            match case.read(&nodes, &words).used {
                CacheUse::Read => accepted += 1,
                CacheUse::Written => refused += 1,
                CacheUse::Failed => panic!("the folder can be written to"),
            }
        }
    }
    assert!(accepted > 50 && refused > 750, "{accepted} accepted, {refused} refused");
}
