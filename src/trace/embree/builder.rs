//! Trees by Embree's own builder, `rtcBuildBVH`: boxes in, and nodes and leaves handed over through callbacks.
#![allow(unsafe_code, reason = "Embree's C interface: its builder and the callbacks it fills a tree through")]

use std::ffi::c_void;
use std::ptr::{null_mut, without_provenance_mut};

use super::device::Device;
use super::{Quality, sys};
use crate::error::Result;
use crate::math::{Aabb, Vec3};

pub(super) use sys::RTCBuildPrimitive as Item;

/// Children of a node, as in the native tree.
const WIDTH: usize = 8;
/// Bits of an item's `geomID` that are its own. The builder keeps numbers in the others.
const PART_BITS: u32 = (1 << 27) - 1;
/// New items for each one, at most, where items are split: what Embree allows its scenes.
const REPLICATIONS: f64 = 0.2;

/// What trees are made of, and what is counted.
pub(super) struct Rule<'a> {
    pub quality: Quality,
    /// Items that are tested together.
    pub block: u32,
    /// Most items in a leaf.
    pub most: u32,
    /// What a leaf costs.
    pub leaf: &'a (dyn Fn(&[Item]) -> f64 + Sync),
    /// What a node costs.
    pub node: f64,
    /// The corners of a triangle by its part and number; high quality splits those that have some.
    pub corners: &'a (dyn Fn(u32, u32) -> Option<[Vec3; 3]> + Sync),
}

/// Builds a tree over `items`, and adds up what it costs: in half areas, times what `rule` says of nodes and leaves.
/// 0 for no items.
pub(super) fn cost(device: &Device, mut items: Vec<Item>, rule: &Rule<'_>) -> Result<f64> {
    let count = items.len();
    if count == 0 {
        return Ok(0.0);
    }
    let whole = items.iter().map(bounds).fold(Aabb::EMPTY, Aabb::union).half_area();
    let (quality, more) = match rule.quality {
        Quality::Low => (sys::RTC_BUILD_QUALITY_LOW, 0),
        Quality::Medium => (sys::RTC_BUILD_QUALITY_MEDIUM, 0),
        Quality::High => (sys::RTC_BUILD_QUALITY_HIGH, (count as f64 * REPLICATIONS) as usize),
    };
    items.reserve_exact(more);
    let bvh = Handle::new(device)?;
    let arguments = sys::RTCBuildArguments {
        byteSize: size_of::<sys::RTCBuildArguments>(),
        buildQuality: quality,
        buildFlags: sys::RTC_BUILD_FLAG_NONE,
        maxBranchingFactor: WIDTH as u32,
        maxDepth: 32,
        sahBlockSize: rule.block,
        minLeafSize: rule.block.min(rule.most),
        maxLeafSize: rule.most,
        traversalCost: 1.0,
        intersectionCost: 1.0,
        bvh: bvh.0,
        primitives: items.as_mut_ptr(),
        primitiveCount: count,
        primitiveArrayCapacity: count + more,
        createNode: Some(create_node),
        setNodeChildren: Some(set_children),
        setNodeBounds: Some(set_bounds),
        createLeaf: Some(create_leaf),
        splitPrimitive: Some(split),
        buildProgress: None,
        userPtr: (&raw const *rule).cast_mut().cast(),
    };
    // SAFETY: the arguments live through the call. `items` has room for as many as it is said to, and Embree writes
    // what it adds before it reads it. The callbacks only read `rule`, which is Sync.
    let root = unsafe { sys::rtcBuildBVH(&raw const arguments) };
    device.check("building a tree to be measured")?;
    if root.is_null() {
        return Err(super::backend("building a tree to be measured: Embree returned none"));
    }
    // A native tree has a node even above a single leaf.
    let above = if leaf_cost(root).is_some() { rule.node * f64::from(whole) } else { 0.0 };
    let (mut sum, mut open) = (above, vec![Child { pointer: root, area: whole }]);
    while let Some(Child { pointer, area }) = open.pop() {
        let cost = leaf_cost(pointer).unwrap_or_else(|| {
            // SAFETY: neither null nor a leaf, so it is a node that `create_node` made; it is `bvh`'s, which is alive.
            let node = unsafe { &*pointer.cast::<Node>() };
            open.extend(node.children[..node.count].iter().filter(|child| !child.pointer.is_null()));
            rule.node
        });
        sum += cost * f64::from(area);
    }
    Ok(sum)
}

/// A node of the tree that is measured.
struct Node {
    count: usize,
    children: [Child; WIDTH],
}

/// A child: a node, or the cost of a leaf in place of a pointer.
#[derive(Clone, Copy)]
struct Child {
    pointer: *mut c_void,
    /// Half the surface of its box.
    area: f32,
}

/// The cost of a leaf as a pointer that no node can have: its f32 bits above a one.
fn leaf(cost: f64) -> *mut c_void {
    without_provenance_mut((((cost as f32).to_bits() as usize) << 1) | 1)
}

/// The cost that [`leaf`] made a pointer of; None for a node.
fn leaf_cost(pointer: *mut c_void) -> Option<f64> {
    (pointer.addr() & 1 == 1).then(|| f64::from(f32::from_bits((pointer.addr() >> 1) as u32)))
}

/// `RTCCreateNodeFunction`.
///
/// # Safety
/// Embree's: `allocator` is its own.
unsafe extern "C" fn create_node(
    allocator: sys::RTCThreadLocalAllocator,
    count: u32,
    _context: *mut c_void,
) -> *mut c_void {
    // SAFETY: the allocator is this thread's, during this call.
    let node = unsafe { sys::rtcThreadLocalAlloc(allocator, size_of::<Node>(), 16) };
    let none = Child { pointer: null_mut(), area: 0.0 };
    // SAFETY: new memory of the size and (at least) the alignment of a Node.
    unsafe { node.cast::<Node>().write(Node { count: (count as usize).min(WIDTH), children: [none; WIDTH] }) };
    node
}

/// `RTCSetNodeChildrenFunction`.
///
/// # Safety
/// Embree's: `node` is of [`create_node`], `children` are `count` results of it or of [`create_leaf`].
unsafe extern "C" fn set_children(node: *mut c_void, children: *mut *mut c_void, count: u32, _context: *mut c_void) {
    // SAFETY: one thread at a time fills a node.
    let (node, children) = unsafe { (&mut *node.cast::<Node>(), std::slice::from_raw_parts(children, count as usize)) };
    for (child, pointer) in node.children.iter_mut().zip(children) {
        child.pointer = *pointer;
    }
}

/// `RTCSetNodeBoundsFunction`.
///
/// # Safety
/// Embree's: `node` is of [`create_node`], `bounds` are `count` boxes.
unsafe extern "C" fn set_bounds(
    node: *mut c_void,
    bounds: *mut *const sys::RTCBounds,
    count: u32,
    _context: *mut c_void,
) {
    // SAFETY: one thread at a time fills a node.
    let (node, bounds) = unsafe { (&mut *node.cast::<Node>(), std::slice::from_raw_parts(bounds, count as usize)) };
    for (child, bounds) in node.children.iter_mut().zip(bounds) {
        // SAFETY: Embree passes a box for each child.
        child.area = unsafe { aabb(&**bounds) }.half_area();
    }
}

/// `RTCCreateLeafFunction`.
///
/// # Safety
/// Embree's: `items` are `count` primitives, `rule` is what was handed to `rtcBuildBVH`.
unsafe extern "C" fn create_leaf(
    _allocator: sys::RTCThreadLocalAllocator,
    items: *const Item,
    count: usize,
    rule: *mut c_void,
) -> *mut c_void {
    // SAFETY: as promised above; `cost` keeps the rule through the build.
    let (items, rule) = unsafe { (std::slice::from_raw_parts(items, count), &*rule.cast::<Rule<'_>>()) };
    leaf((rule.leaf)(items))
}

/// `RTCSplitPrimitiveFunction`: the two sides of a triangle, cut by a plane, within its box.
///
/// # Safety
/// Embree's: pointers to one item each, `rule` is what was handed to `rtcBuildBVH`.
unsafe extern "C" fn split(
    item: *const Item,
    axis: u32,
    at: f32,
    left: *mut sys::RTCBounds,
    right: *mut sys::RTCBounds,
    rule: *mut c_void,
) {
    // SAFETY: as promised above; `cost` keeps the rule through the build.
    let (item, rule) = unsafe { (&*item, &*rule.cast::<Rule<'_>>()) };
    let whole = bounds(item);
    let sides = match (rule.corners)(item.geomID & PART_BITS, item.primID) {
        Some(corners) => sides(&corners, axis as usize % 3, at, &whole),
        None => [whole; 2],
    };
    for (side, out) in sides.into_iter().zip([left, right]) {
        // SAFETY: Embree's to be written: three numbers, one that is not looked at, three more. Nothing else is, for
        // Embree keeps its own numbers between them.
        unsafe {
            out.cast::<[f32; 3]>().write(side.min.to_array());
            (&raw mut (*out).upper_x).cast::<[f32; 3]>().write(side.max.to_array());
        }
    }
}

/// The boxes around a triangle's parts on both sides of a plane, within `whole`.
fn sides(corners: &[Vec3; 3], axis: usize, at: f32, whole: &Aabb) -> [Aabb; 2] {
    let mut sides = [Aabb::EMPTY; 2];
    for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
        let (x, y) = (a[axis], b[axis]);
        if x <= at {
            sides[0] = sides[0].include(a);
        }
        if x >= at {
            sides[1] = sides[1].include(a);
        }
        if x < at && at < y || y < at && at < x {
            let cut = a + (b - a) * ((at - x) / (y - x));
            sides = sides.map(|side| side.include(cut));
        }
    }
    sides.map(|side| Aabb { min: side.min.max(whole.min), max: side.max.min(whole.max) })
}

/// A box, and whose it is: `part` below 2^27.
pub(super) fn item(bounds: &Aabb, part: u32, primitive: u32) -> Item {
    let Aabb { min, max } = *bounds;
    Item {
        lower_x: min.x,
        lower_y: min.y,
        lower_z: min.z,
        geomID: part,
        upper_x: max.x,
        upper_y: max.y,
        upper_z: max.z,
        primID: primitive,
    }
}

fn bounds(item: &Item) -> Aabb {
    Aabb {
        min: Vec3::new(item.lower_x, item.lower_y, item.lower_z),
        max: Vec3::new(item.upper_x, item.upper_y, item.upper_z),
    }
}

fn aabb(bounds: &sys::RTCBounds) -> Aabb {
    Aabb {
        min: Vec3::new(bounds.lower_x, bounds.lower_y, bounds.lower_z),
        max: Vec3::new(bounds.upper_x, bounds.upper_y, bounds.upper_z),
    }
}

/// One reference to a tree; null only where Embree failed to make one.
struct Handle(sys::RTCBVH);

impl Handle {
    fn new(device: &Device) -> Result<Self> {
        // SAFETY: the device is alive.
        let bvh = Self(unsafe { sys::rtcNewBVH(device.raw()) });
        device.check("making a tree to be measured").map(|()| bvh)
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: the one reference that rtcNewBVH gave.
            unsafe { sys::rtcReleaseBVH(self.0) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_is_cut_where_the_plane_passes() {
        let corners = [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 4.0, 0.0)];
        let whole = Aabb::around(corners);
        let [left, right] = sides(&corners, 0, 1.0, &whole);
        assert_eq!(left, Aabb::around([Vec3::ZERO, Vec3::new(1.0, 4.0, 0.0)]));
        assert_eq!(right, Aabb::around([Vec3::new(1.0, 0.0, 0.0), Vec3::new(4.0, 3.0, 0.0)]));
        // Within what was left of it.
        let [left, right] = sides(&corners, 0, 1.0, &Aabb { max: Vec3::new(2.0, 1.0, 0.0), ..whole });
        assert_eq!((left.max, right.max), (Vec3::new(1.0, 1.0, 0.0), Vec3::new(2.0, 1.0, 0.0)));
    }

    #[test]
    fn costs_of_leaves_survive_as_pointers() {
        for cost in [0.0, 1.0, 7.0, 1234.5, 1e30] {
            assert_eq!(leaf_cost(leaf(cost)), Some(f64::from(cost as f32)));
        }
        assert_eq!(leaf_cost(without_provenance_mut(16)), None);
    }
}
