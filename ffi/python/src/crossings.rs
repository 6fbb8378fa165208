//! All hits of many rays, and how many they are.

use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;
use twincast::trace::precise::{PreciseHit, PreciseRay};

use crate::arrays::{CHUNK, Ends, Points, Rays};
use crate::pool;
use crate::scene::{Scene, table};

/// All hits, by ray, then by t: ray, primitive, geometry, t, (u, v), location.
type Crossings<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// What one task has found: its rays, where the hits of each end, and these.
#[derive(Default)]
struct Found {
    rays: Vec<PreciseRay>,
    ends: Vec<usize>,
    hits: Vec<PreciseHit>,
}

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
        let counts = pool::run(py, threads, || {
            let mut counts = vec![0; rays.len()];
            counts.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, counts)| {
                let mut found = [0; CHUNK];
                self.precise.count_batch(&rays.some(rays.chunk(chunk)), &mut found[..counts.len()]);
                counts.iter_mut().zip(found).for_each(|(count, found)| *count = found as i32);
            });
            counts
        })?;
        Ok(counts.into_pyarray(py))
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
        let (ray, primitive, geometry, t, uv, location) = pool::run(py, threads, || {
            let chunks = (0..rays.len().div_ceil(CHUNK)).into_par_iter();
            let found: Vec<Found> = chunks.map(|chunk| self.found(&rays, chunk, most)).collect();
            let count: usize = found.iter().map(|found| found.hits.len()).sum();
            let (mut ray, mut primitive, mut geometry) = (vec![0i64; count], vec![0i64; count], vec![0u32; count]);
            let (mut t, mut uv) = (vec![0f64; count], vec![0f64; 2 * count]);
            let mut location = vec![0f64; if locations { 3 * count } else { 0 }];
            let mut rest = (&mut ray[..], &mut primitive[..], &mut geometry[..], &mut t[..], &mut uv[..]);
            let mut rest_location = &mut location[..];
            let mut tasks = Vec::with_capacity(found.len());
            for found in &found {
                let len = found.hits.len();
                let (a, b, c, d, e) = rest;
                let ((a, ra), (b, rb), (c, rc)) = (a.split_at_mut(len), b.split_at_mut(len), c.split_at_mut(len));
                let ((d, rd), (e, re)) = (d.split_at_mut(len), e.split_at_mut(2 * len));
                let (f, rf) = rest_location.split_at_mut(if locations { 3 * len } else { 0 });
                (rest, rest_location) = ((ra, rb, rc, rd, re), rf);
                tasks.push((found, (a, b, c, d, e, f)));
            }
            tasks.into_par_iter().enumerate().for_each(
                |(chunk, (found, (ray, primitive, geometry, t, uv, location)))| {
                    let mut from = 0;
                    for (i, &end) in found.ends.iter().enumerate() {
                        for k in from..end {
                            let hit = &found.hits[k];
                            ray[k] = (chunk * CHUNK + i) as i64;
                            (primitive[k], geometry[k], t[k]) = (hit.primitive.into(), hit.geometry, hit.t);
                            uv[2 * k..2 * k + 2].copy_from_slice(&[hit.u, hit.v]);
                            if locations {
                                let PreciseRay { origin, direction, .. } = found.rays[i];
                                location[3 * k..3 * k + 3].copy_from_slice(&(origin + direction * hit.t).to_array());
                            }
                        }
                        from = end;
                    }
                },
            );
            (ray, primitive, geometry, t, uv, location)
        })?;
        let ids = (ray.into_pyarray(py), primitive.into_pyarray(py), geometry.into_pyarray(py));
        Ok((ids.0, ids.1, ids.2, t.into_pyarray(py), table(py, uv, 2)?, table(py, location, 3)?))
    }
}

impl Scene {
    /// The hits of the rays of one task.
    fn found(&self, rays: &Rays<'_>, chunk: usize, most: usize) -> Found {
        let rays = rays.some(rays.chunk(chunk));
        let mut found = Found { rays, ..Found::default() };
        self.precise.all_hits_batch(&found.rays, &mut found.ends, &mut found.hits);
        if most < usize::MAX {
            let (mut kept, mut from) = (Vec::with_capacity(found.hits.len()), 0);
            for end in &mut found.ends {
                let until = (*end).min(from + most);
                kept.extend_from_slice(&found.hits[from..until]);
                (from, *end) = (*end, kept.len());
            }
            found.hits = kept;
        }
        found
    }
}
