//! All hits of many rays, and how many they are.

use std::sync::atomic::{AtomicBool, Ordering};

use numpy::{Element, IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use rayon::prelude::*;
use twincast::trace::precise::{PreciseRay, PreciseScene};

use crate::arrays::{Answers, CHUNK, Ends, Points, Rays, finite_f32, weights_f32};
use crate::pool;
use crate::scene::{Scene, table};

/// All hits, by ray, then by t: ray, primitive, location.
type Crossings<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray2<f64>>);

/// All hits, by ray, then by t: where those of each ray begin and the last ones end; ray, primitive, geometry; t, (u,
/// v).
type List<'py> = (
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
);

#[pymethods]
impl Scene {
    /// How often each ray crosses a triangle, int32.
    #[pyo3(signature = (origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), threads = 0))]
    fn count<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        let counted = self.counted(py, threads)?;
        let mut answers = Answers::new(py, rays.len(), 1)?;
        pool::each(py, threads, answers.chunks()?.enumerate(), |(chunk, counts)| {
            let mut found = [0; CHUNK];
            counted.count_batch(&rays.some(rays.chunk(chunk)), &mut found[..counts.len()]);
            counts.iter_mut().zip(found).for_each(|(count, found)| *count = found as i32);
        })?;
        Ok(answers.flat())
    }

    /// All hits; of each ray the first `most`. Locations only where they are asked for, else without rows.
    #[pyo3(signature = (
        origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), most = usize::MAX, locations = false, threads = 0
    ))]
    #[allow(clippy::too_many_arguments)] // Python's keywords.
    fn crossings<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        most: usize,
        locations: bool,
        threads: usize,
    ) -> PyResult<Crossings<'py>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        let counted = self.counted(py, threads)?;
        let (ray, primitive, location) = pool::interruptible(py, threads, |cancel| {
            let found = if locations {
                found(counted, &rays, cancel, PreciseScene::all_hits_batch, |task| {
                    let mut columns = Columns::default();
                    for (i, hits) in task.by_ray() {
                        let PreciseRay { origin, direction, .. } = task.rays[i];
                        for hit in &hits[..hits.len().min(most)] {
                            columns.push(task.first + i, hit.primitive);
                            columns.location.extend((origin + direction * hit.t).to_array());
                        }
                    }
                    columns
                })
            } else {
                found(counted, &rays, cancel, PreciseScene::all_ids_batch, |task| {
                    let mut columns = Columns::default();
                    for (i, names) in task.by_ray() {
                        for &(_, primitive) in &names[..names.len().min(most)] {
                            columns.push(task.first + i, primitive);
                        }
                    }
                    columns
                })
            };
            let (ray, primitive) = (joined(&found, |found| &found.ray), joined(&found, |found| &found.primitive));
            (ray, primitive, joined(&found, |found| &found.location))
        })?;
        Ok((ray.into_pyarray(py), primitive.into_pyarray(py), table(py, location, 3)?))
    }

    /// All hits, as Open3D has them: numbers of 32 bits, but t, u and v in f64 where rays or their range are.
    #[pyo3(signature = (origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), threads = 0))]
    fn list<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        threads: usize,
    ) -> PyResult<List<'py>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        if rays.are_f32() {
            self.list_in(py, &rays, threads, finite_f32, weights_f32)
        } else {
            self.list_in(py, &rays, threads, |t| t, |u, v| [u, v])
        }
    }
}

/// Columns of [`Crossings`], of one task.
#[derive(Default)]
struct Columns {
    ray: Vec<i64>,
    primitive: Vec<i64>,
    location: Vec<f64>,
}

impl Columns {
    fn push(&mut self, ray: usize, primitive: u32) {
        self.ray.push(ray as i64);
        self.primitive.push(i64::from(primitive));
    }
}

/// What one task has found.
struct Task<'a, H> {
    /// The number of its first ray.
    first: usize,
    rays: &'a [PreciseRay],
    /// Of each ray where its hits end.
    ends: &'a [usize],
    hits: &'a [H],
}

impl<H> Task<'_, H> {
    /// The number of each of its rays, the first being 0, and its hits.
    fn by_ray(&self) -> impl Iterator<Item = (usize, &[H])> {
        let begins = std::iter::once(&0).chain(self.ends);
        begins.zip(self.ends).map(|(&begin, &end)| &self.hits[begin..end]).enumerate()
    }
}

/// What `keep` keeps of all hits, as `ask` gives them, task by task; of no rays once it is called off.
fn found<H: Send, T: Send>(
    precise: &PreciseScene,
    rays: &Rays<'_>,
    cancel: &AtomicBool,
    ask: fn(&PreciseScene, &[PreciseRay], &mut Vec<usize>, &mut Vec<H>),
    keep: impl Fn(&Task<'_, H>) -> T + Sync,
) -> Vec<T> {
    let chunks = (0..rays.len().div_ceil(CHUNK)).into_par_iter();
    let found = chunks.map_init(<(Vec<usize>, Vec<H>)>::default, |(ends, hits), chunk| {
        let rays = if cancel.load(Ordering::Relaxed) { Vec::new() } else { rays.some(rays.chunk(chunk)) };
        ask(precise, &rays, ends, hits);
        keep(&Task { first: chunk * CHUNK, rays: &rays, ends, hits })
    });
    found.collect()
}

impl Scene {
    /// [`Self::list`], with t, and u and v, as these two have them.
    fn list_in<'py, F: Element + Copy + Default + Sync>(
        &self,
        py: Python<'py>,
        rays: &Rays<'_>,
        threads: usize,
        distance: impl Fn(f64) -> F + Sync,
        weights: impl Fn(f64, f64) -> [F; 2] + Sync,
    ) -> PyResult<List<'py>> {
        let counted = self.counted(py, threads)?;
        let (splits, [ray, primitive, geometry], t, uv) = pool::interruptible(py, threads, |cancel| {
            let found = found(counted, rays, cancel, PreciseScene::all_hits_batch, |task| {
                let (mut ids, mut t, mut uv) = ([const { Vec::new() }; 3], Vec::new(), Vec::new());
                for (i, hits) in task.by_ray() {
                    for hit in hits {
                        let [ray, primitive, geometry] = &mut ids;
                        ray.push((task.first + i) as u32);
                        primitive.push(hit.primitive);
                        geometry.push(hit.geometry);
                        t.push(distance(hit.t));
                        uv.extend(weights(hit.u, hit.v));
                    }
                }
                (task.ends.to_vec(), ids, t, uv)
            });
            let mut splits = Vec::with_capacity(rays.len() + 1);
            splits.push(0);
            let mut base = 0;
            for (ends, _, t, _) in &found {
                splits.extend(ends.iter().map(|end| (base + end) as u32));
                base += t.len();
            }
            if u32::try_from(base.max(rays.len())).is_err() {
                return Err(format!(
                    "{base} hits of {} rays are more than 32 bits count: ask fewer rays at a time",
                    rays.len()
                ));
            }
            let ids = [0, 1, 2].map(|k| joined(&found, |found| &found.1[k]));
            Ok((splits, ids, joined(&found, |found| &found.2), joined(&found, |found| &found.3)))
        })?
        .map_err(PyOverflowError::new_err)?;
        let (ray, primitive, geometry) = (ray.into_pyarray(py), primitive.into_pyarray(py), geometry.into_pyarray(py));
        let (t, uv) = (t.into_pyarray(py).into_any(), table(py, uv, 2)?.into_any());
        Ok((splits.into_pyarray(py), ray, primitive, geometry, t, uv))
    }
}

/// One column of all parts, one after the other.
fn joined<P: Sync, T: Copy + Default + Send + Sync>(parts: &[P], column: impl Fn(&P) -> &Vec<T> + Sync) -> Vec<T> {
    // Zeros that nobody has to write: the threads that copy are the first to touch the pages.
    let mut whole = vec![T::default(); parts.iter().map(|part| column(part).len()).sum()];
    let mut rest = &mut whole[..];
    let mut tasks = Vec::with_capacity(parts.len());
    for part in parts {
        let (here, after) = rest.split_at_mut(column(part).len());
        tasks.push((here, part));
        rest = after;
    }
    tasks.into_par_iter().for_each(|(here, part)| here.copy_from_slice(column(part)));
    whole
}
