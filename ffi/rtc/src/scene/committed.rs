//! A committed scene: what rays are traced in. It does not change; of a scene that is dynamic the next commit takes it
//! apart.

use std::sync::{Arc, OnceLock};

use smallvec::SmallVec;
use twincast_core::math::{Aabb, DAffine3};
use twincast_core::once::made_outside;
use twincast_core::trace::bvh::{BoxTree, Preset};

use crate::abi::{INVALID_ID, RTCBounds};
use crate::device::Device;
use crate::geometry::{self, Ball, Functions, Geometry, Linear, Motion, Surface, TimeSteps};

use super::Scene;
use super::near::Near;
use super::solid::Solid;

/// A geometry, as it was when the scene was committed.
pub struct Record {
    pub geometry: Arc<Geometry>,
    /// Of what was read, and how many buffers had been set.
    pub version: u64,
    pub buffers: u64,
    pub quality: u32,
    pub mask: u32,
    pub functions: Functions,
    pub body: Body,
    /// Whether it is another than at the commit before.
    pub is_new: bool,
}

impl Record {
    pub fn new(geometry: &Arc<Geometry>, state: &geometry::State, body: Body) -> Self {
        let &geometry::State { version, buffers, quality, mask, functions, .. } = state;
        Self { geometry: Arc::clone(geometry), version, buffers, quality, mask, functions, body, is_new: true }
    }
}

/// What can be hit.
pub enum Body {
    Surface(Surface),
    Linear(Linear),
    /// User geometry: boxes of each primitive.
    User(TimeSteps<Vec<Aabb>>),
    Instances(SmallVec<[Instance; 1]>),
}

/// A scene in its place.
pub struct Instance {
    pub scene: Arc<Scene>,
    pub motion: Motion,
    /// From the world to the scene, for what stands still.
    to_scene: Option<DAffine3>,
}

impl Instance {
    pub fn new(scene: Arc<Scene>, motion: Motion) -> Self {
        let to_scene = motion.is_still().then(|| motion.at(0.0).as_daffine3().inverse());
        Self { scene, motion, to_scene }
    }

    /// From the world to the scene at a time; not finite where the transform is singular.
    pub fn to_scene(&self, time: f32) -> DAffine3 {
        self.to_scene.unwrap_or_else(|| self.motion.at(time).as_daffine3().inverse())
    }
}

/// What is in a box of the second tree.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    pub geometry: u32,
    /// A primitive; of a surface, a triangle.
    pub primitive: u32,
    /// Of an instance that stands still, its index in [`Committed::placed`]; [`INVALID_ID`] of all else.
    pub placed: u32,
}

impl Item {
    pub fn new(geometry: u32, primitive: u32) -> Self {
        Self { geometry, primitive, placed: INVALID_ID }
    }
}

/// All that a ray needs of an instance that stands still to go on in its scene, in one place: by way of its record it
/// would wait for memory four times.
#[repr(align(64))]
pub struct Placed {
    pub to_scene: DAffine3,
    pub scene: Arc<Scene>,
    pub mask: u32,
    /// Which instance it is.
    pub geometry: u32,
    pub primitive: u32,
}

impl Placed {
    /// None of what is no instance, or moves.
    pub fn new(record: &Record, item: Item) -> Option<Self> {
        let Body::Instances(instances) = &record.body else { return None };
        let Instance { scene, to_scene, .. } = instances.get(item.primitive as usize)?;
        let Item { geometry, primitive, .. } = item;
        Some(Self { to_scene: (*to_scene)?, scene: Arc::clone(scene), mask: record.mask, geometry, primitive })
    }
}

/// What a query has to look at besides distances.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heeded {
    /// The mask of all geometries, if they have the same.
    pub mask: Option<u32>,
    pub intersect_filter: bool,
    pub occluded_filter: bool,
}

/// A committed scene.
pub struct Committed {
    pub device: Arc<Device>,
    /// By geometry id; none where nothing is attached or enabled.
    pub records: Vec<Option<Box<Record>>>,
    /// The largest tree over triangles that stand still; none where there are none.
    pub solid: Option<Solid>,
    /// The other ones, of a scene that is dynamic and has changed since the first commit; none larger than the one
    /// before it.
    pub smaller: Vec<Solid>,
    /// Whether each triangle of all these is a primitive.
    pub is_plain: bool,
    /// Whether a ray may come to a triangle of these more than once.
    pub repeats: bool,
    /// Everything else; none where there is nothing.
    pub others: Option<BoxTree>,
    /// What its boxes are, as it names them.
    pub items: Vec<Item>,
    /// Of each of these where it is, where all are points that stand still; else none.
    pub balls: Vec<Ball>,
    /// Instances that stand still, in the same order.
    pub placed: Vec<Placed>,
    pub heeded: Heeded,
    /// The scene's flags, and what its trees are built with.
    pub made_with: (u32, Preset),
    /// At time 0 and at time 1.
    pub bounds: [Aabb; 2],
    /// Whether a triangle does not count where a ray begins: at `tnear` itself Embree finds one only in scenes that are
    /// robust.
    pub excludes_start: bool,
    /// Boxes of primitives that point queries show and no tree over triangles names, made when the first point query
    /// asks for them.
    pub near: OnceLock<Near>,
    /// Memory that was accounted for.
    pub bytes: usize,
}

impl Committed {
    /// A scene in which nothing is hit.
    pub fn empty(device: Arc<Device>) -> Self {
        Self {
            device,
            records: Vec::new(),
            solid: None,
            smaller: Vec::new(),
            is_plain: true,
            repeats: false,
            others: None,
            items: Vec::new(),
            balls: Vec::new(),
            placed: Vec::new(),
            heeded: Heeded { mask: None, intersect_filter: false, occluded_filter: false },
            made_with: (0, Preset::Default),
            bounds: [Aabb::EMPTY; 2],
            excludes_start: false,
            near: OnceLock::new(),
            bytes: 0,
        }
    }

    /// The record of a geometry that was hit.
    #[inline(always)]
    pub fn record(&self, geometry: u32) -> Option<&Record> {
        self.records.get(geometry as usize)?.as_deref()
    }

    /// The trees over triangles that stand still.
    pub fn solids(&self) -> impl Iterator<Item = &Solid> {
        self.solid.iter().chain(&self.smaller)
    }

    /// The same, taken away.
    pub fn take_solids(&mut self) -> Vec<Solid> {
        self.solid.take().into_iter().chain(self.smaller.drain(..)).collect()
    }

    /// All that is no triangle of its own, where that is instances that stand still, in the order of
    /// [`Committed::others`].
    #[inline(always)]
    pub fn only_placed(&self) -> Option<&[Placed]> {
        (self.placed.len() == self.items.len()).then_some(&self.placed[..])
    }

    /// Whether these name each primitive in them, once.
    pub fn names_triangles(&self) -> bool {
        self.is_plain && !self.repeats
    }

    /// Boxes for point queries of what no tree over triangles names, made on the device's threads.
    ///
    /// # Panics
    /// Where the system gives none to a process that was forked; it is told as an error.
    pub fn near(&self) -> &Near {
        let make = || self.device.install(|| Near::new(self)).unwrap_or_else(|failure| panic!("{}", failure.message));
        made_outside(&self.near, make)
    }
}

/// A box as the interface has it.
pub fn to_abi(bounds: &Aabb) -> RTCBounds {
    RTCBounds { lower: bounds.min.to_array(), align0: 0.0, upper: bounds.max.to_array(), align1: 0.0 }
}

impl Committed {
    /// The box around everything at all times.
    pub fn whole(&self) -> RTCBounds {
        to_abi(&self.bounds[0].union(self.bounds[1]))
    }

    /// The boxes at both ends of time.
    pub fn linear(&self) -> [RTCBounds; 2] {
        [to_abi(&self.bounds[0]), to_abi(&self.bounds[1])]
    }
}
