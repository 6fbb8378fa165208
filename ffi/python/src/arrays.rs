//! Rays and points as NumPy holds them: f32 or f64, of any strides, read in place; and arrays for the answers.

use std::ops::Range;

use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::slice::{ChunksMut, ParallelSliceMut};
use twincast::Ray;
use twincast::math::{DVec3, Vec3};
use twincast::trace::precise::PreciseRay;

/// Rays, or points, that a thread takes at a time.
pub const CHUNK: usize = 1024;

/// Shorter directions in f32, and origins farther away, are traced in f64: without them t is below 1e38, as meshes that
/// are traced in f32 lie nearer than 1e14 (`trace::precise`); and no direction is denormal.
const SHORTEST: f32 = 1e-18;
const FARTHEST: f32 = 1e19;

/// What threads answer, of each ray or point so many numbers: an array that they write to a chunk at a time, and that
/// is Python's afterwards.
pub struct Answers<'py, T: Element> {
    numbers: PyReadwriteArray1<'py, T>,
    width: usize,
}

impl<'py, T: Element + Send> Answers<'py, T> {
    /// `count` times `width` zeros, which nobody has to write: pages that the system gives when they are touched, by
    /// the thread that answers.
    ///
    /// # Errors
    /// `MemoryError` where there is no room. For that NumPy makes them: a vector would end the process.
    pub fn new(py: Python<'py>, count: usize, width: usize) -> PyResult<Self> {
        let zeros = py.import("numpy")?.call_method1("zeros", (count * width, T::get_dtype(py)))?;
        Ok(Self { numbers: zeros.cast_into::<PyArray1<T>>()?.readwrite(), width })
    }

    /// Those of each [`CHUNK`] of rays or points.
    pub fn chunks(&mut self) -> PyResult<ChunksMut<'_, T>> {
        Ok(self.numbers.as_slice_mut()?.par_chunks_mut(self.width * CHUNK))
    }

    /// All of them.
    pub fn flat(self) -> Bound<'py, PyArray1<T>> {
        Bound::clone(&self.numbers)
    }

    /// The same, a row for each ray or point.
    pub fn rows(self) -> PyResult<Bound<'py, PyArray2<T>>> {
        let (width, flat) = (self.width, self.flat());
        flat.reshape([flat.len() / width, width])
    }
}

/// The nearest f32, but no infinite one, which would be a miss.
#[inline]
pub fn finite_f32(x: f64) -> f32 {
    (x as f32).min(f32::MAX)
}

/// The weights of a hit's second and third corner in f32, none below 0, and their sum, unrounded, not above 1.
#[inline]
pub fn weights_f32(u: f64, v: f64) -> [f32; 2] {
    let (u, v) = (u.clamp(0.0, 1.0) as f32 + 0.0, v.clamp(0.0, 1.0) as f32 + 0.0);
    let (large, small) = (u.max(v), u.min(v));
    // From a half on the difference is not rounded, and below there is no doubt.
    if small <= 1.0 - large {
        return [u, v];
    }
    let most = 1.0 - small;
    let large = if small > 1.0 - most { most.next_down() } else { most };
    if u < v { [small, large] } else { [large, small] }
}

/// An array of three columns.
#[derive(FromPyObject)]
pub enum Points<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

/// Where a ray ends: for all the same, or each its own.
#[derive(FromPyObject)]
pub enum Ends<'py> {
    F32(PyReadonlyArray1<'py, f32>),
    F64(PyReadonlyArray1<'py, f64>),
    All(f64),
}

/// Vectors, one a row.
#[derive(Clone, Copy)]
pub enum Rows<'a> {
    F32(ArrayView2<'a, f32>),
    F64(ArrayView2<'a, f64>),
}

#[derive(Clone, Copy)]
enum Reach<'a> {
    F32(ArrayView1<'a, f32>),
    F64(ArrayView1<'a, f64>),
    All(f64),
}

impl Points<'_> {
    /// The rows.
    ///
    /// # Errors
    /// `ValueError` with the argument's name, unless there are three columns.
    pub fn rows(&self, name: &str) -> PyResult<Rows<'_>> {
        let shape = match self {
            Self::F32(array) => array.shape(),
            Self::F64(array) => array.shape(),
        };
        if shape[1] != 3 {
            return Err(PyValueError::new_err(format!("{name} must have the shape (n, 3), not {shape:?}")));
        }
        Ok(match self {
            Self::F32(array) => Rows::F32(array.as_array()),
            Self::F64(array) => Rows::F64(array.as_array()),
        })
    }
}

impl Rows<'_> {
    pub fn len(&self) -> usize {
        match self {
            Self::F32(rows) => rows.nrows(),
            Self::F64(rows) => rows.nrows(),
        }
    }

    pub fn is_f32(&self) -> bool {
        matches!(self, Self::F32(_))
    }

    #[inline]
    pub fn at(&self, row: usize) -> DVec3 {
        match self {
            Self::F32(rows) => vector(rows, row).as_dvec3(),
            Self::F64(rows) => DVec3::new(rows[[row, 0]], rows[[row, 1]], rows[[row, 2]]),
        }
    }

    /// The same in f32.
    #[inline]
    fn rounded(&self, row: usize) -> Vec3 {
        match self {
            Self::F32(rows) => vector(rows, row),
            Self::F64(_) => self.at(row).as_vec3(),
        }
    }
}

#[inline]
fn vector(rows: &ArrayView2<'_, f32>, row: usize) -> Vec3 {
    Vec3::new(rows[[row, 0]], rows[[row, 1]], rows[[row, 2]])
}

/// Rays of a query.
pub struct Rays<'a> {
    origins: Rows<'a>,
    /// As many, or one for all.
    directions: Rows<'a>,
    tmin: f64,
    tmax: Reach<'a>,
}

impl<'a> Rays<'a> {
    /// # Errors
    /// `ValueError` with the argument's name where lengths do not match.
    pub fn new(origins: &'a Points<'_>, directions: &'a Points<'_>, tmin: f64, tmax: &'a Ends<'_>) -> PyResult<Self> {
        let (origins, directions) = (origins.rows("origins")?, directions.rows("directions")?);
        let (tmax, ends) = match tmax {
            Ends::F32(array) => (Reach::F32(array.as_array()), Some(array.len())),
            Ends::F64(array) => (Reach::F64(array.as_array()), Some(array.len())),
            Ends::All(tmax) => (Reach::All(*tmax), None),
        };
        let count = origins.len();
        for (name, len) in [("directions", (directions.len() != 1).then_some(directions.len())), ("tmax", ends)] {
            if let Some(len) = len.filter(|&len| len != count) {
                let message = format!("{name}: {len} of them, but {count} origins");
                return Err(PyValueError::new_err(message));
            }
        }
        Ok(Self { origins, directions, tmin, tmax })
    }

    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// Whether they are in f32, and their range, too.
    pub fn are_f32(&self) -> bool {
        let range_is_f32 = match self.tmax {
            Reach::F32(_) => true,
            Reach::F64(_) => false,
            Reach::All(tmax) => f64::from(tmax as f32) == tmax,
        };
        self.origins.is_f32() && self.directions.is_f32() && range_is_f32 && f64::from(self.tmin as f32) == self.tmin
    }

    #[inline]
    pub fn at(&self, i: usize) -> PreciseRay {
        let (origin, direction) = (self.origins.at(i), self.directions.at(self.direction(i)));
        PreciseRay { origin, direction, tmin: self.tmin, tmax: self.tmax(i) }
    }

    /// Which row is the direction of ray `i`.
    #[inline]
    fn direction(&self, i: usize) -> usize {
        i.min(self.directions.len() - 1)
    }

    #[inline]
    fn tmax(&self, i: usize) -> f64 {
        match self.tmax {
            Reach::F32(tmax) => tmax[i].into(),
            Reach::F64(tmax) => tmax[i],
            Reach::All(tmax) => tmax,
        }
    }

    /// The numbers of the rays of a chunk.
    pub fn chunk(&self, chunk: usize) -> Range<usize> {
        chunk * CHUNK..self.len().min((chunk + 1) * CHUNK)
    }

    /// Those with these numbers.
    pub fn some(&self, which: Range<usize>) -> Vec<PreciseRay> {
        which.map(|i| self.at(i)).collect()
    }

    /// The same in f32, for those that [are](Self::are_f32); none where f32 is too narrow for what one of them meets.
    pub fn rounded(&self, which: Range<usize>) -> Option<Vec<Ray>> {
        let tmin = self.tmin as f32;
        let rounded = |i| {
            let (origin, direction) = (self.origins.rounded(i), self.directions.rounded(self.direction(i)));
            Ray { origin, direction, tmin, tmax: self.tmax(i) as f32, time: 0.0 }
        };
        let rays: Vec<Ray> = which.map(rounded).collect();
        rays.iter().all(suits_f32).then_some(rays)
    }
}

/// Whether f32 is wide enough for the ray and for where it meets meshes; rays that miss anyway do.
#[inline]
fn suits_f32(ray: &Ray) -> bool {
    let (length, away) = (ray.direction.abs().max_element(), ray.origin.abs().max_element());
    let is_short = length > 0.0 && length < SHORTEST;
    let is_far = away > FARTHEST && away < f32::INFINITY;
    !is_short && !is_far
}
