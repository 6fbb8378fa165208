//! What can be asked of points: the nearest point of the meshes, and whether they are inside.

use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use twincast::math::DVec3;
use twincast::trace::precise::{NearestPoint, PreciseRay};

use crate::arrays::Points;
use crate::scene::{INVALID, Scene, table};
use crate::{curve, pool};

/// The nearest points: where they are, primitive, geometry, (u, v), unit normal, distance.
type Nearest<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Directions without a simple relation to axes or to each other: of a spiral on the sphere. The first is trimesh's.
fn direction(sample: usize) -> DVec3 {
    if sample == 0 {
        return DVec3::new(0.439_506_445_5, 0.617_598_629_942, 0.652_231_566_745);
    }
    let (share, turn) = (sample as f64 * 0.754_877_666_246_692_8, sample as f64 * 3.883_222_077_450_933);
    let z = 1.0 - 2.0 * share.fract();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * turn.cos(), r * turn.sin(), z)
}

#[pymethods]
impl Scene {
    /// The nearest point of any triangle to each point; ids `INVALID` and NaN where there is none.
    #[pyo3(signature = (points, threads = 0))]
    fn nearest<'py>(&self, py: Python<'py>, points: Points<'py>, threads: usize) -> PyResult<Nearest<'py>> {
        let rows = points.rows("points")?;
        let count = rows.len();
        let found: Vec<Option<NearestPoint>> = pool::run(py, threads, || {
            curve::along(&rows, None, |points, found| self.precise.nearest_point_batch(points, found))
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
        let distances = pool::run(py, threads, || {
            curve::along(&rows, f64::NAN, |points, distances| {
                let (mut found, mut inside) = (vec![None; points.len()], vec![false; points.len()]);
                self.precise.nearest_point_batch(points, &mut found);
                if samples > 0 {
                    self.are_inside(points, samples, false, &mut inside);
                }
                for (distance, (found, inside)) in distances.iter_mut().zip(found.iter().zip(inside)) {
                    if let Some(found) = found {
                        let magnitude = found.distance_squared.sqrt();
                        *distance = if inside { -magnitude } else { magnitude };
                    }
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
        let inside = pool::run(py, threads, || {
            curve::along(&rows, false, |points, inside| self.are_inside(points, samples, both_ways, inside))
        })?;
        Ok(inside.into_pyarray(py))
    }
}

impl Scene {
    fn are_inside(&self, points: &[DVec3], samples: usize, both_ways: bool, inside: &mut [bool]) {
        let mut votes = vec![0; points.len()];
        for sample in 0..samples {
            let mut odd = self.are_odd(points, direction(sample));
            if both_ways {
                // Only of those that may still be inside.
                let open: Vec<usize> = (0..points.len()).filter(|&i| odd[i]).collect();
                let some: Vec<DVec3> = open.iter().map(|&i| points[i]).collect();
                for (i, is_odd) in open.into_iter().zip(self.are_odd(&some, -direction(sample))) {
                    odd[i] = is_odd;
                }
            }
            votes.iter_mut().zip(odd).for_each(|(votes, odd)| *votes += usize::from(odd));
        }
        inside.iter_mut().zip(votes).for_each(|(inside, votes)| *inside = 2 * votes > samples);
    }

    /// Whether a ray from each point crosses the meshes an odd number of times.
    fn are_odd(&self, points: &[DVec3], direction: DVec3) -> Vec<bool> {
        let rays: Vec<PreciseRay> = points.iter().map(|&point| PreciseRay::new(point, direction)).collect();
        let mut counts = vec![0; rays.len()];
        self.precise.count_batch(&rays, &mut counts);
        counts.iter().map(|count| count % 2 == 1).collect()
    }
}
