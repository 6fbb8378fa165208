//! The accelerators by name.

use super::binary::Binary;
use super::grid::Grid;
use super::kd::KdTree;
use super::octree::Octree;
use super::{Accelerated, Options};
use crate::trace::brute::Brute;
use crate::trace::bvh::Bvh;
use crate::trace::{Tracer, World};

/// How a scene is searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accel {
    /// The native [`Bvh`], which is what renders.
    #[default]
    Bvh,
    /// Nothing: every primitive for every ray.
    Brute,
    /// A binary BVH.
    Binary,
    /// A uniform grid, nested where it is crowded.
    Grid,
    /// An octree.
    Octree,
    /// A kd-tree.
    Kd,
}

/// An accelerator that is ready to trace.
pub struct Built {
    /// The tracer. It is called once a batch; what is inside is compiled for each accelerator.
    pub tracer: Box<dyn Tracer + Send>,
    /// Memory it holds, in bytes.
    pub bytes: usize,
}

impl Accel {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Bvh, Self::Brute, Self::Binary, Self::Grid, Self::Octree, Self::Kd];

    /// As flags and reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bvh => "bvh",
            Self::Brute => "brute",
            Self::Binary => "binary-bvh",
            Self::Grid => "grid",
            Self::Octree => "octree",
            Self::Kd => "kd-tree",
        }
    }

    /// Builds it.
    pub fn build(self, world: &World, options: &Options) -> Built {
        let (tracer, bytes): (Box<dyn Tracer + Send>, usize) = match self {
            Self::Bvh => {
                let bvh = Bvh::build(world);
                let bytes = bvh.bytes();
                (Box::new(bvh), bytes)
            }
            Self::Brute => {
                let brute = Brute::new(world);
                let bytes = brute.bytes();
                (Box::new(brute), bytes)
            }
            Self::Binary => accelerated::<Binary>(world, options),
            Self::Grid => accelerated::<Grid>(world, options),
            Self::Octree => accelerated::<Octree>(world, options),
            Self::Kd => accelerated::<KdTree>(world, options),
        };
        Built { tracer, bytes }
    }
}

fn accelerated<I: super::Index + 'static>(world: &World, options: &Options) -> (Box<dyn Tracer + Send>, usize) {
    let tracer = Accelerated::<I>::build(world, options);
    let bytes = tracer.bytes();
    (Box::new(tracer), bytes)
}
