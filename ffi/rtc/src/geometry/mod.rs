//! Geometry as the caller describes it.
//!
//! Everything is behind one lock, and read once when a scene is committed; but the user pointer, which callers change
//! at any time, is given to callbacks as it is at that moment.

mod buffers;
mod interpolate;
mod linear;
mod steps;
mod surface;
mod transform;

use std::ffi::c_void;
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use smallvec::smallvec;

use crate::abi::*;
use crate::buffer::View;
use crate::device::Device;
use crate::failure::{Code, Failure, Result};
use crate::scene::Scene;

pub use interpolate::{Place, interpolate};
pub use linear::{Ball, Linear, Segment, Shape};
pub use steps::{PerStep, TimeSteps, around};
pub use surface::{Named, Surface};
pub use transform::{Motion, Transform, read as read_transform, words as transform_words, write as write_transform};

/// What a geometry is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Triangles,
    Quads,
    Grids,
    Linear(Shape),
    User,
    Instance,
    InstanceArray,
    /// What this library does not have: it takes everything and is never hit. Its making is an error, but programs that
    /// do not ask for errors write to its buffers all the same.
    Absent,
}

impl Kind {
    /// Of a number of the interface.
    fn new(number: u32) -> Result<Self> {
        Ok(match number {
            geometry_type::TRIANGLE => Self::Triangles,
            geometry_type::QUAD => Self::Quads,
            geometry_type::GRID => Self::Grids,
            geometry_type::ROUND_LINEAR_CURVE => Self::Linear(Shape::RoundCurve),
            geometry_type::SPHERE_POINT => Self::Linear(Shape::Sphere),
            geometry_type::DISC_POINT => Self::Linear(Shape::Disc),
            geometry_type::ORIENTED_DISC_POINT => Self::Linear(Shape::OrientedDisc),
            geometry_type::USER => Self::User,
            geometry_type::INSTANCE => Self::Instance,
            #[cfg(feature = "v4")]
            geometry_type::INSTANCE_ARRAY => Self::InstanceArray,
            geometry_type::SUBDIVISION => return Err(Failure::unsupported("subdivision geometry is")),
            geometry_type::CONE_LINEAR_CURVE | geometry_type::FLAT_LINEAR_CURVE => {
                return Err(Failure::unsupported("cone and flat linear curves are"));
            }
            24..=26 | 32..=34 | 40..=42 | 58..=60 => return Err(Failure::unsupported("smooth curves are")),
            _ => return Err(Failure::unknown("invalid geometry type")),
        })
    }

    /// The buffer that says how many primitives there are, by type and slot; of what has none, a name that no buffer
    /// has.
    fn primitives(self) -> (u32, u32) {
        match self {
            Self::Triangles | Self::Quads | Self::Linear(Shape::RoundCurve) => (buffer_type::INDEX, 0),
            Self::Grids => (buffer_type::GRID, 0),
            Self::Linear(Shape::Sphere | Shape::Disc | Shape::OrientedDisc) => (buffer_type::VERTEX, 0),
            Self::User | Self::Instance | Self::InstanceArray | Self::Absent => (u32::MAX, 0),
        }
    }

    /// Whether it has vertices.
    fn is_mesh(self) -> bool {
        self.is_surface() || matches!(self, Self::Linear(_))
    }

    /// Whether it is made of triangles.
    fn is_surface(self) -> bool {
        matches!(self, Self::Triangles | Self::Quads | Self::Grids)
    }
}

/// Functions of the caller's for user geometry, and for filters.
#[derive(Clone, Copy, Default)]
pub struct Functions {
    pub bounds: RTCBoundsFunction,
    pub intersect: RTCIntersectFunctionN,
    pub occluded: RTCOccludedFunctionN,
    pub point_query: RTCPointQueryFunction,
    pub intersect_filter: RTCFilterFunctionN,
    pub occluded_filter: RTCFilterFunctionN,
    /// Version 4: whether the filter that comes with a query is run, too.
    pub heeds_argument_filter: bool,
}

/// What the caller has set.
#[derive(Clone)]
pub struct State {
    pub index: Option<View>,
    /// One a time step.
    pub vertices: PerStep<Option<View>>,
    /// One a time step, of oriented discs.
    pub normals: PerStep<Option<View>>,
    pub attributes: Vec<Option<View>>,
    pub flags: Option<View>,
    pub grids: Option<View>,
    pub time_range: (f32, f32),
    /// How many were set: those of a scene that is made for another reason are read, whether the geometry was committed
    /// or not.
    pub buffers: u64,
    pub quality: u32,
    pub mask: u32,
    pub functions: Functions,
    /// Of user geometry.
    pub primitive_count: u32,
    /// One of an instance, several of an instance array.
    pub scenes: Vec<Arc<Scene>>,
    /// One a time step.
    pub transforms: PerStep<Transform>,
    /// The same when the geometry was committed.
    pub placed: PerStep<Transform>,
    /// Of instance arrays: one a time step.
    pub transform_buffers: PerStep<Option<View>>,
    /// Buffers of a geometry that this library does not have, by type and slot.
    pub absent: Vec<((u32, u32), Option<View>)>,
    pub is_enabled: bool,
    pub is_committed: bool,
    /// Counts commits, and all else that has a scene built again.
    pub version: u64,
}

/// A geometry.
pub struct Geometry {
    pub device: Arc<Device>,
    pub kind: Kind,
    user: AtomicPtr<c_void>,
    state: Mutex<State>,
}

impl Geometry {
    /// Of a kind by its number. A kind that this library does not have is [`Kind::Absent`], and what is to be told of
    /// it comes with the geometry.
    ///
    /// # Errors
    /// Where there is no such kind in Embree.
    pub fn new(device: Arc<Device>, number: u32) -> Result<(Self, Option<Failure>)> {
        let (kind, absent) = match Kind::new(number) {
            Err(failure) if failure.code == Code::InvalidOperation => (Kind::Absent, Some(failure)),
            kind => (kind?, None),
        };
        let state = State {
            index: None,
            vertices: smallvec![None],
            normals: smallvec![None],
            attributes: Vec::new(),
            flags: None,
            grids: None,
            time_range: (0.0, 1.0),
            buffers: 0,
            quality: quality::MEDIUM,
            mask: if cfg!(feature = "v4") { 1 } else { u32::MAX },
            functions: Functions::default(),
            primitive_count: 0,
            scenes: Vec::new(),
            transforms: smallvec![Transform::IDENTITY],
            placed: smallvec![Transform::IDENTITY],
            transform_buffers: smallvec![None],
            absent: Vec::new(),
            is_enabled: true,
            is_committed: false,
            version: 0,
        };
        Ok((Self { device, kind, user: AtomicPtr::default(), state: Mutex::new(state) }, absent))
    }

    /// What is set.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is set; it then waits for a commit.
    pub fn modify(&self, change: impl FnOnce(&mut State) -> Result<()>) -> Result<()> {
        let mut state = self.state();
        change(&mut state)?;
        state.is_committed = false;
        Ok(())
    }

    /// Has scenes that it is in built again.
    pub fn commit(&self) -> Result<()> {
        let mut state = self.state();
        // None where a step has no buffer, so that some steps without one are an error as well.
        let is_even = |steps: &[Option<View>]| {
            let stride = |step: &Option<View>| step.as_ref().map(View::stride);
            steps.windows(2).all(|pair| stride(&pair[0]) == stride(&pair[1]))
        };
        if !is_even(&state.vertices) || !is_even(&state.normals) {
            return Err(Failure::operation("stride of buffers have to be identical for each time step"));
        }
        let State { placed, transforms, .. } = &mut *state;
        placed.clone_from(transforms);
        state.is_committed = true;
        state.version += 1;
        Ok(())
    }

    pub fn set_enabled(&self, is_enabled: bool) {
        let mut state = self.state();
        if state.is_enabled != is_enabled {
            state.is_enabled = is_enabled;
            state.version += 1;
        }
    }

    pub fn set_time_steps(&self, steps: u32) -> Result<()> {
        if !(1..=MAX_TIME_STEPS).contains(&steps) {
            return Err(Failure::argument("number of time steps is out of range"));
        }
        if self.state().steps() == steps as usize {
            return Ok(());
        }
        self.modify(|state| {
            state.vertices.resize(steps as usize, None);
            state.normals.resize(steps as usize, None);
            state.transforms.resize(steps as usize, Transform::IDENTITY);
            state.transform_buffers.resize(steps as usize, None);
            Ok(())
        })
    }

    /// The caller's pointer.
    pub fn user(&self) -> *mut c_void {
        self.user.load(Ordering::Relaxed)
    }

    pub fn set_user(&self, user: *mut c_void) {
        self.user.store(user, Ordering::Relaxed);
    }

    /// Sets one of the filters.
    pub fn set_filter(&self, set: impl FnOnce(&mut Functions)) -> Result<()> {
        if matches!(self.kind, Kind::Instance | Kind::InstanceArray) {
            return Err(Failure::operation("filter functions not supported for this geometry"));
        }
        self.set_functions(set);
        Ok(())
    }

    /// Sets functions, which have the scene made again, but need no commit of the geometry.
    pub fn set_functions(&self, set: impl FnOnce(&mut Functions)) {
        let mut state = self.state();
        set(&mut state.functions);
        state.version += 1;
    }

    /// For what only some kinds have.
    pub fn demand(&self, is_so: bool) -> Result<()> {
        if is_so { Ok(()) } else { Err(Failure::operation("operation not supported for this geometry")) }
    }

    pub fn set_scenes(&self, scenes: Vec<Arc<Scene>>) -> Result<()> {
        self.demand(matches!(self.kind, Kind::Instance | Kind::InstanceArray))?;
        self.modify(|state| {
            state.scenes = scenes;
            Ok(())
        })
    }

    /// Sets where an instance is at a step, from the next commit on; until then it stays where it was committed.
    pub fn set_transform(&self, step: u32, transform: Transform) -> Result<()> {
        self.demand(self.kind == Kind::Instance)?;
        let mut state = self.state();
        let slot = state.transforms.get_mut(step as usize);
        *slot.ok_or_else(|| Failure::operation("invalid timestep"))? = transform;
        Ok(())
    }

    /// The transform of one instance at a time, as it was set last.
    pub fn transform_at(&self, primitive: u32, time: f32) -> Result<twincast_core::math::Affine3> {
        self.demand(matches!(self.kind, Kind::Instance | Kind::InstanceArray))?;
        let state = self.state();
        Ok(Motion::of(self.kind, &state, &state.transforms, primitive as usize)?.at(time))
    }
}

impl State {
    /// Time steps, at least 1.
    pub fn steps(&self) -> usize {
        self.vertices.len()
    }
}
