//! What can be asked of points: the nearest point of the meshes, and whether they are inside.

use std::sync::atomic::{AtomicBool, Ordering};

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;
use rayon::slice::ChunksMut;
use twincast::math::DVec3;
use twincast::trace::precise::PreciseClosestPoint;

use crate::arrays::{Answers, CHUNK, Points, Rows, weights_f32};
use crate::inside::are_inside;
use crate::order::{self, Order};
use crate::pool;
use crate::scene::{INVALID, Scene};

/// The nearest points: where they are, primitive, geometry, (u, v), unit normal, distance.
type Nearest<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// The distance of a point whose square is told, which is infinite from 1e154 on: from there all that can be met is as
/// near as zero.
fn root(squared: f64, point: DVec3) -> f64 {
    let most = point.abs().max_element();
    if squared == f64::INFINITY && most.is_finite() { (point / most).length() * most } else { squared.sqrt() }
}

/// What `ask` answers of the points, in their order; it gets some that are near each other at a time, and answers that
/// say `none`, as all do once it is called off.
fn along<T: Copy + Send + Sync>(
    rows: &Rows<'_>,
    cancel: &AtomicBool,
    none: T,
    ask: impl Fn(&[DVec3], &mut [T]) + Sync,
) -> Vec<T> {
    let order = Order::of_points(rows);
    let answers = along_order(rows, order.as_ref(), cancel, none, ask);
    match order {
        None => answers,
        Some(order) => order.undone(&answers, CHUNK),
    }
}

/// The same as they come in this order.
fn along_order<T: Copy + Send + Sync>(
    rows: &Rows<'_>,
    order: Option<&Order>,
    cancel: &AtomicBool,
    none: T,
    ask: impl Fn(&[DVec3], &mut [T]) + Sync,
) -> Vec<T> {
    order::along(rows.len(), order, CHUNK, none, |which, answers| {
        if !cancel.load(Ordering::Relaxed) {
            let points: Vec<DVec3> = which.iter().map(|&i| rows.at(i)).collect();
            ask(&points, answers);
        }
    })
}

/// Writes answers where Python gets them, whose room was asked for beforehand.
fn tell<T: Copy + Send + Sync>(chunks: ChunksMut<'_, T>, answers: &[T]) {
    chunks.zip(answers.par_chunks(CHUNK)).for_each(|(told, answers)| told.copy_from_slice(answers));
}

#[pymethods]
impl Scene {
    /// The nearest point of any triangle to each point; ids `INVALID` and NaN where there is none.
    #[pyo3(signature = (points, threads = 0))]
    fn nearest<'py>(&self, py: Python<'py>, points: Points<'py>, threads: usize) -> PyResult<Nearest<'py>> {
        let rows = points.rows("points")?;
        let count = rows.len();
        let (mut point, mut uv, mut normal) =
            (Answers::new(py, count, 3)?, Answers::new(py, count, 2)?, Answers::new(py, count, 3)?);
        let (mut primitive, mut geometry, mut distance) =
            (Answers::new(py, count, 1)?, Answers::new(py, count, 1)?, Answers::new(py, count, 1)?);
        let tasks = (point.chunks()?, uv.chunks()?, normal.chunks()?);
        let others = (primitive.chunks()?, geometry.chunks()?, distance.chunks()?);
        let is_f32 = rows.is_f32();
        pool::interruptible(py, threads, |cancel| {
            self.precise.prepare_for_points();
            let order = Order::of_points(&rows);
            let found = along_order(&rows, order.as_ref(), cancel, None, |points, found| {
                self.precise.closest_point_batch(points, found)
            });
            let tasks = tasks.into_par_iter().zip(others.into_par_iter()).enumerate();
            tasks.for_each(|(chunk, ((point, uv, normal), (primitive, geometry, distance)))| {
                if cancel.load(Ordering::Relaxed) {
                    return;
                }
                for i in 0..distance.len() {
                    let number = chunk * CHUNK + i;
                    let found: &Option<PreciseClosestPoint> =
                        &found[order.as_ref().map_or(number, |order| order.place(number))];
                    point[3 * i..3 * i + 3].fill(f64::NAN);
                    (primitive[i], geometry[i], distance[i]) = (INVALID, INVALID, f64::NAN);
                    if let Some(found) = found {
                        point[3 * i..3 * i + 3].copy_from_slice(&found.point.to_array());
                        (primitive[i], geometry[i]) = (found.primitive, found.geometry);
                        // Who asks in f32 has them rounded so.
                        let (u, v) = (found.u, found.v);
                        let weights = if is_f32 { weights_f32(u, v).map(f64::from) } else { [u, v] };
                        uv[2 * i..2 * i + 2].copy_from_slice(&weights);
                        distance[i] = root(found.distance_squared, rows.at(number));
                    }
                }
                self.normals_of(primitive, geometry, true, normal, |x| x);
            });
        })?;
        Ok((point.rows()?, primitive.flat(), geometry.flat(), uv.rows()?, normal.rows()?, distance.flat()))
    }

    /// How far each point is from the nearest triangle; NaN where there is none. With `samples` above 0, negative where
    /// [`Scene::inside`] says so.
    #[pyo3(signature = (points, samples = 0, threads = 0))]
    fn distance<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        samples: usize,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let rows = points.rows("points")?;
        let mut told = Answers::new(py, rows.len(), 1)?;
        let chunks = told.chunks()?;
        pool::interruptible(py, threads, |cancel| {
            self.precise.prepare_for_points();
            // Distances alone need no more than they did.
            let counted = if samples > 0 { self.precise.distinct() } else { &self.precise };
            let is_closed = samples > 0 && counted.is_closed();
            tell(
                chunks,
                &along(&rows, cancel, f64::NAN, |points, distances| {
                    let mut inside = vec![false; points.len()];
                    self.precise.distance_squared_batch(points, distances);
                    if is_closed {
                        self.are_inside_closed(counted, points, distances, &mut inside);
                    } else if samples > 0 {
                        are_inside(counted, points, samples, false, &mut inside);
                    }
                    for ((distance, inside), &point) in distances.iter_mut().zip(inside).zip(points) {
                        let length = root(*distance, point);
                        *distance = if inside { -length } else { length };
                    }
                }),
            );
        })?;
        Ok(told.flat())
    }

    /// Whether each point is inside: the majority of `samples` rays from it cross the meshes an odd number of times.
    /// With `both_ways` a ray and its opposite must, which keeps points before the holes of an open mesh outside.
    #[pyo3(signature = (points, samples = 1, both_ways = false, threads = 0))]
    fn inside<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        samples: usize,
        both_ways: bool,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let rows = points.rows("points")?;
        let mut told = Answers::new(py, rows.len(), 1)?;
        let chunks = told.chunks()?;
        pool::interruptible(py, threads, |cancel| {
            let counted = self.precise.distinct();
            let ask = |points: &[DVec3], inside: &mut [bool]| are_inside(counted, points, samples, both_ways, inside);
            tell(chunks, &along(&rows, cancel, false, ask));
        })?;
        Ok(told.flat())
    }
}
