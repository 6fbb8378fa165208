//! The accelerators by name.

use std::fmt;

use super::binary::Binary;
use super::bsp::Bsp;
use super::grid::Grid;
use super::groups::Groups;
use super::kd::KdTree;
use super::octree::Octree;
use super::{Accelerated, Cell, Index, Options};
use crate::math::Vec3;
use crate::ray::{Hit, Ray};
use crate::scene::Accel;
use crate::trace::brute::Brute;
use crate::trace::bvh::Bvh;
use crate::trace::{Batch, Tracer, World};

/// A tracer that may know where points are.
pub trait Accelerator: Tracer + Send {
    /// The cell of what is fixed in the world that holds a point. None outside of everything, and by accelerators that
    /// do not divide space: all but the kd-tree and the BSP tree.
    fn locate(&self, _point: Vec3) -> Option<Cell> {
        None
    }
}

impl Accelerator for Bvh {}
impl Accelerator for Brute {}

impl<I: Index> Accelerator for Accelerated<I> {
    fn locate(&self, point: Vec3) -> Option<Cell> {
        self.fixed.index.locate(point)
    }
}

/// An accelerator that is ready to trace.
pub struct Built {
    /// The tracer. It is called once a batch; what is inside is compiled for each accelerator.
    pub tracer: Box<dyn Accelerator>,
    /// Memory it holds, in bytes.
    pub bytes: usize,
    /// What there is to say about how it was built: the grid's resolution, or where the BSP tree stopped.
    pub notes: Vec<String>,
}

impl fmt::Debug for Built {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bytes, notes, .. } = self;
        f.debug_struct("Built").field("bytes", bytes).field("notes", notes).finish_non_exhaustive()
    }
}

impl Accel {
    /// Builds it. The BVH has but one method, and takes no options.
    pub fn build(self, world: &World, options: &Options) -> Built {
        match self {
            Self::Bvh => Bvh::build(world).into(),
            Self::Brute => {
                let brute = Brute::new(world);
                Built { bytes: brute.bytes(), notes: Vec::new(), tracer: Box::new(brute) }
            }
            Self::Groups => Built::over::<Groups>(world, options),
            Self::Binary => Built::over::<Binary>(world, options),
            Self::Grid => Built::over::<Grid>(world, options),
            Self::Octree => Built::over::<Octree>(world, options),
            Self::Kd => Built::over::<KdTree>(world, options),
            Self::Bsp => Built::over::<Bsp>(world, options),
        }
    }
}

impl Built {
    fn over<I: Index + 'static>(world: &World, options: &Options) -> Self {
        let tracer = Accelerated::<I>::build(world, options);
        Self { bytes: tracer.bytes(), notes: tracer.notes(), tracer: Box::new(tracer) }
    }
}

impl From<Bvh> for Built {
    fn from(bvh: Bvh) -> Self {
        Self { bytes: bvh.bytes(), notes: Vec::new(), tracer: Box::new(bvh) }
    }
}

impl Tracer for Built {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.tracer.closest(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.tracer.occluded(ray)
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], batch: Batch) {
        self.tracer.closest_batch(rays, hits, batch);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], batch: Batch) {
        self.tracer.occluded_batch(rays, occluded, batch);
    }
}
