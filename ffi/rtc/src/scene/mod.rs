//! Scenes: which geometries there are, and what was last committed.

mod boxes;
mod commit;
mod committed;
mod near;
mod path;
mod progress;
mod solid;

use std::ffi::c_void;
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::abi::{INVALID_ID, RTCProgressMonitorFunction, quality};
use crate::device::{Callback, Device};
use crate::failure::{Failure, Result};
use crate::geometry::Geometry;

pub use committed::{Body, Committed, Instance, Item, Placed, Record};
pub use near::Near;

/// What the caller has set.
pub struct State {
    /// By geometry id.
    pub geometries: Vec<Option<Arc<Geometry>>>,
    pub flags: u32,
    pub quality: u32,
    pub progress: Callback<RTCProgressMonitorFunction>,
    /// No lower id is free.
    lowest: usize,
    /// Of what the committed scene was made; none where it has to be made.
    made_of: Option<Vec<(usize, u64)>>,
    /// Whether geometries were added or taken out since it was made, if it was.
    is_changed: bool,
}

/// A scene.
pub struct Scene {
    pub device: Arc<Device>,
    state: Mutex<State>,
    /// Held while a commit is under way: the next one waits.
    committing: Mutex<()>,
    /// What rays are traced in; null before the first commit. A box's pointer.
    committed: AtomicPtr<Committed>,
}

impl Scene {
    pub fn new(device: Arc<Device>) -> Self {
        let state = State {
            geometries: Vec::new(),
            flags: 0,
            quality: quality::MEDIUM,
            progress: Callback::default(),
            lowest: 0,
            made_of: None,
            is_changed: true,
        };
        Self { device, state: Mutex::new(state), committing: Mutex::new(()), committed: AtomicPtr::default() }
    }

    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What rays are traced in, after the first commit.
    ///
    /// # Safety
    /// The scene is not committed again while the result is used: that queries and commits do not meet is the
    /// interface's rule.
    #[inline(always)]
    pub unsafe fn committed(&self) -> Option<&Committed> {
        // SAFETY: it is null, or a box that `replace` made and only `replace` and `drop` free.
        unsafe { self.committed.load(Ordering::Acquire).as_ref() }
    }

    /// The same.
    ///
    /// # Safety
    /// As for [`Scene::committed`].
    ///
    /// # Errors
    /// Where there is none.
    #[inline(always)]
    pub unsafe fn traceable(&self) -> Result<&Committed> {
        // SAFETY: as the caller promises.
        unsafe { self.committed() }.ok_or_else(not_committed)
    }

    /// The same, unless geometries were added or taken out since.
    ///
    /// # Safety
    /// As for [`Scene::committed`].
    pub unsafe fn unchanged(&self) -> Result<&Committed> {
        // SAFETY: as the caller promises.
        let committed = unsafe { self.committed() }.filter(|_| !self.state().is_changed);
        committed.ok_or_else(not_committed)
    }

    /// Puts a committed scene in place, or none; what was there.
    fn replace(&self, committed: Option<Committed>) -> Option<Box<Committed>> {
        let new = committed.map_or(std::ptr::null_mut(), |committed| Box::into_raw(Box::new(committed)));
        let old = self.committed.swap(new, Ordering::AcqRel);
        // SAFETY: made by `Box::into_raw` here, and taken out before; nobody uses it, by the interface's rule.
        (!old.is_null()).then(|| unsafe { Box::from_raw(old) })
    }

    fn free(&self, old: Option<Box<Committed>>) {
        if let Some(old) = old {
            // Giving back is never refused.
            _ = self.device.account(-(old.bytes as isize), true);
        }
    }

    /// Adds a geometry under the lowest id that is free.
    pub fn attach(&self, geometry: Arc<Geometry>) -> Result<u32> {
        let mut state = self.state();
        let lowest = state.lowest;
        let free = state.geometries.iter().skip(lowest).position(Option::is_none);
        let id = free.map_or(state.geometries.len(), |above| lowest + above);
        if id >= INVALID_ID as usize {
            return Err(Failure::operation("too many geometries"));
        }
        state.set(id, geometry);
        state.lowest = id + 1;
        Ok(id as u32)
    }

    /// Adds a geometry under an id of the caller's.
    pub fn attach_by_id(&self, geometry: Arc<Geometry>, id: u32) -> Result<()> {
        // Ids are places in a list; one of a thousand million would be a slip.
        const MAX: u32 = 1 << 28;
        valid(id)?;
        if id >= MAX {
            return Err(Failure::operation("invalid geometry ID"));
        }
        let mut state = self.state();
        if state.geometries.get(id as usize).is_some_and(Option::is_some) {
            return Err(Failure::operation("geometry ID already in use"));
        }
        state.set(id as usize, geometry);
        Ok(())
    }

    pub fn detach(&self, id: u32) -> Result<()> {
        valid(id)?;
        let mut state = self.state();
        let slot = state.geometries.get_mut(id as usize).filter(|slot| slot.is_some());
        let slot = slot.ok_or_else(|| Failure::operation("invalid geometry ID"))?;
        *slot = None;
        state.lowest = state.lowest.min(id as usize);
        (state.made_of, state.is_changed) = (None, true);
        Ok(())
    }

    /// The geometry with an id; none if there is none.
    pub fn geometry(&self, id: u32) -> Option<Arc<Geometry>> {
        self.state().geometries.get(id as usize).and_then(Clone::clone)
    }

    pub fn set_flags(&self, flags: u32) {
        let mut state = self.state();
        (state.flags, state.made_of) = (flags, None);
    }

    pub fn set_quality(&self, quality: u32) -> Result<()> {
        if !matches!(quality, quality::LOW | quality::MEDIUM | quality::HIGH) {
            return Err(Failure::unknown("invalid build quality"));
        }
        let mut state = self.state();
        (state.quality, state.made_of) = (quality, None);
        Ok(())
    }

    pub fn set_progress(&self, function: RTCProgressMonitorFunction, user: *mut c_void) {
        self.state().progress = Callback { function, user };
    }

    /// Makes what is set the scene that rays are traced in. Several threads may call it at the same time: one works,
    /// the others wait.
    pub fn commit(&self) -> Result<()> {
        let _turn = self.committing.lock().unwrap_or_else(PoisonError::into_inner);
        let (made_of, plan) = {
            let state = self.state();
            let made_of: Vec<_> = state.geometries.iter().map(identity).collect();
            if state.made_of.as_ref() == Some(&made_of) {
                return Ok(());
            }
            (made_of, commit::Plan::new(&state))
        };
        // Taken out first, for the new one is made of its parts: meanwhile there is nothing to trace rays in, which
        // nobody may do while a scene is committed.
        let mut old = if plan.is_dynamic() { self.replace(None) } else { None };
        let result = commit::commit(self, &plan, old.as_deref_mut());
        let (committed, result) = match result {
            Ok(committed) => (committed, Ok(())),
            Err(failure) => (Committed::empty(Arc::clone(&self.device)), Err(failure)),
        };
        let replaced = self.replace(Some(committed));
        [old, replaced].into_iter().for_each(|old| self.free(old));
        let mut state = self.state();
        state.is_changed = result.is_err();
        state.made_of = (!state.is_changed).then_some(made_of);
        result
    }
}

#[cold]
fn not_committed() -> Failure {
    Failure::operation("scene not committed")
}

/// Whether it may be the id of a geometry.
fn valid(id: u32) -> Result<()> {
    if id == INVALID_ID { Err(Failure::argument("invalid argument")) } else { Ok(()) }
}

/// Which geometry it is, as it was committed last.
fn identity(geometry: &Option<Arc<Geometry>>) -> (usize, u64) {
    geometry.as_ref().map_or((0, 0), |geometry| {
        let state = geometry.state();
        // What is not committed must be looked at.
        let version = if state.is_committed { state.version } else { u64::MAX };
        (Arc::as_ptr(geometry) as usize, version)
    })
}

impl State {
    fn set(&mut self, id: usize, geometry: Arc<Geometry>) {
        if self.geometries.len() <= id {
            self.geometries.resize(id + 1, None);
        }
        self.geometries[id] = Some(geometry);
        (self.made_of, self.is_changed) = (None, true);
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        let old = self.replace(None);
        self.free(old);
    }
}
