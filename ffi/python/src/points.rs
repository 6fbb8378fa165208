//! What can be asked of points: the nearest point of the meshes, and whether they are inside.

use std::sync::atomic::{AtomicBool, Ordering};

use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use twincast::math::DVec3;
use twincast::trace::precise::NearestPoint;

use crate::arrays::{CHUNK, Points, Rows};
use crate::inside::are_inside;
use crate::order::{self, Order};
use crate::pool;
use crate::scene::{INVALID, Scene, table};

/// The nearest points: where they are, primitive, geometry, (u, v), unit normal, distance.
type Nearest<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// What `ask` answers of the points, in their order; it gets some that are near each other at a time, and answers that say `none`, as all do once it
/// is called off.
fn along<T: Copy + Send + Sync>(
    rows: &Rows<'_>,
    cancel: &AtomicBool,
    none: T,
    ask: impl Fn(&[DVec3], &mut [T]) + Sync,
) -> Vec<T> {
    let order = Order::of_points(rows);
    order::along(rows.len(), order.as_ref(), CHUNK, none, |which, answers| {
        if !cancel.load(Ordering::Relaxed) {
            let points: Vec<DVec3> = which.iter().map(|&i| rows.at(i)).collect();
            ask(&points, answers);
        }
    })
}

#[pymethods]
impl Scene {
    /// The nearest point of any triangle to each point; ids `INVALID` and NaN where there is none.
    #[pyo3(signature = (points, threads = 0))]
    fn nearest<'py>(&self, py: Python<'py>, points: Points<'py>, threads: usize) -> PyResult<Nearest<'py>> {
        let rows = points.rows("points")?;
        let count = rows.len();
        let found: Vec<Option<NearestPoint>> = pool::interruptible(py, threads, |cancel| {
            self.precise.prepare_for_points();
            along(&rows, cancel, None, |points, found| self.precise.nearest_point_batch(points, found))
        })?;
        let id = |id: fn(&NearestPoint) -> u32| -> Vec<u32> {
            found.iter().map(|found| found.as_ref().map_or(INVALID, id)).collect()
        };
        let (primitive, geometry) = (id(|found| found.primitive), id(|found| found.geometry));
        let (mut point, mut uv) = (Vec::with_capacity(3 * count), Vec::with_capacity(2 * count));
        let (mut normal, mut distance) = (Vec::with_capacity(3 * count), Vec::with_capacity(count));
        for found in &found {
            let n = found.map_or(DVec3::ZERO, |found| self.normal(found.geometry, found.primitive, true));
            point.extend(found.map_or(DVec3::NAN, |found| found.point).to_array());
            uv.extend(found.map_or([0.0; 2], |found| [found.u, found.v]));
            normal.extend(n.to_array());
            distance.push(found.map_or(f64::NAN, |found| found.distance_squared.sqrt()));
        }
        let ids = (primitive.into_pyarray(py), geometry.into_pyarray(py));
        let (point, uv, normal) = (table(py, point, 3)?, table(py, uv, 2)?, table(py, normal, 3)?);
        Ok((point, ids.0, ids.1, uv, normal, distance.into_pyarray(py)))
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
        let distances = pool::interruptible(py, threads, |cancel| {
            self.precise.prepare_for_points();
            // Distances alone need no more than they did.
            let counted = if samples > 0 { self.precise.distinct() } else { &self.precise };
            let is_closed = samples > 0 && counted.is_closed();
            along(&rows, cancel, f64::NAN, |points, distances| {
                let mut inside = vec![false; points.len()];
                self.precise.distance_squared_batch(points, distances);
                if is_closed {
                    self.are_inside_closed(counted, points, distances, &mut inside);
                } else if samples > 0 {
                    are_inside(counted, points, samples, false, &mut inside);
                }
                for (distance, inside) in distances.iter_mut().zip(inside) {
                    *distance = if inside { -distance.sqrt() } else { distance.sqrt() };
                }
            })
        })?;
        Ok(distances.into_pyarray(py))
    }

    /// Whether each point is inside: the majority of `samples` rays from it cross the meshes an odd number of times. With `both_ways`
    /// a ray and its opposite must, which keeps points before the holes of an open mesh outside.
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
        let inside = pool::interruptible(py, threads, |cancel| {
            let counted = self.precise.distinct();
            along(&rows, cancel, false, |points, inside| are_inside(counted, points, samples, both_ways, inside))
        })?;
        Ok(inside.into_pyarray(py))
    }
}
