//! Meshes, and what rays can ask of them.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;
use twincast::math::DVec3;
use twincast::trace::precise::{PreciseHit, PreciseMesh, PreciseScene};
use twincast::{Batch, Hit, Tracer};

use crate::arrays::{Answers, CHUNK, Ends, Points, Rays, finite_f32, weights_f32};
use crate::{pool, value_error};

/// No triangle, or no mesh, in arrays of unsigned numbers.
pub const INVALID: u32 = u32::MAX;

/// Triangle meshes, ready to be asked; never changes.
#[pyclass(frozen, module = "twincast._native")]
pub struct Scene {
    pub precise: PreciseScene,
}

/// Hits in f32: t, (u, v), primitive, geometry, normal.
type Cast<'py> = (
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<f32>>,
);

/// Hits in f64: t, (u, v), primitive, geometry.
type Closest<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>);

/// A mesh: vertices (v, 3), triangles (t, 3).
type Mesh<'py> = (Points<'py>, PyReadonlyArray2<'py, u32>);

/// `flat`, `columns` a row.
pub fn table<'py, T: numpy::Element>(
    py: Python<'py>,
    flat: Vec<T>,
    columns: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let rows = flat.len() / columns;
    flat.into_pyarray(py).reshape([rows, columns])
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (meshes, threads = 0))]
    fn new(py: Python<'_>, meshes: Vec<Mesh<'_>>, threads: usize) -> PyResult<Self> {
        let read = |(vertices, triangles): &Mesh<'_>| -> PyResult<PreciseMesh> {
            let vertices = vertices.rows("vertices")?;
            let triangles = triangles.as_array();
            if triangles.ncols() != 3 {
                let message = format!("triangles must have the shape (n, 3), not {:?}", triangles.shape());
                return Err(PyValueError::new_err(message));
            }
            Ok(PreciseMesh {
                positions: (0..vertices.len()).map(|i| vertices.at(i)).collect(),
                triangles: triangles.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect(),
            })
        };
        let meshes: Vec<PreciseMesh> = meshes.iter().map(read).collect::<PyResult<_>>()?;
        let precise = pool::run(py, threads, || PreciseScene::new(meshes))?.map_err(value_error)?;
        Ok(Self { precise })
    }

    /// The triangle that each ray hits first, int64, -1 for none.
    #[pyo3(signature = (origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), threads = 0))]
    fn first<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        let mut answers = Answers::new(py, rays.len(), 1)?;
        pool::each(py, threads, answers.chunks()?.enumerate(), |(chunk, first)| {
            let mut hits = [None; CHUNK];
            if let Some(hits) = self.exact_hits(&rays, chunk, &mut hits) {
                first.iter_mut().zip(hits).for_each(|(first, hit)| *first = hit.map_or(-1, |hit| hit.primitive.into()));
            } else {
                let mut names = [None; CHUNK];
                self.precise.closest_ids_batch(&rays.some(rays.chunk(chunk)), &mut names[..first.len()]);
                first.iter_mut().zip(names).for_each(|(first, name)| *first = name.map_or(-1, |(_, i)| i.into()));
            }
        })?;
        Ok(answers.flat())
    }

    /// Whether each ray hits anything.
    #[pyo3(signature = (origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), threads = 0))]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        let exact = self.precise.exact().filter(|_| rays.are_f32());
        let mut answers = Answers::new(py, rays.len(), 1)?;
        pool::each(py, threads, answers.chunks()?.enumerate(), |(chunk, occluded)| {
            let which = rays.chunk(chunk);
            match exact.and_then(|bvh| Some((bvh, rays.rounded(which.clone())?))) {
                Some((bvh, rays)) => bvh.occluded_batch(&rays, occluded, Batch::of(&rays)),
                None => self.precise.occluded_batch(&rays.some(which), occluded),
            }
        })?;
        Ok(answers.flat())
    }

    /// The nearest hits in f32; a miss has t infinite, ids `INVALID` and zeros. Normals are those of triangles, of unit
    /// length if `normalize`.
    #[pyo3(signature = (origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), normalize = true, threads = 0))]
    #[allow(clippy::too_many_arguments)] // Python's keywords.
    fn cast<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        normalize: bool,
        threads: usize,
    ) -> PyResult<Cast<'py>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        let count = rays.len();
        let (mut t, mut uv) = (Answers::new(py, count, 1)?, Answers::new(py, count, 2)?);
        let (mut primitive, mut geometry) = (Answers::new(py, count, 1)?, Answers::new(py, count, 1)?);
        let mut normal = Answers::new(py, count, 3)?;
        let tasks = (t.chunks()?, uv.chunks()?, primitive.chunks()?, geometry.chunks()?, normal.chunks()?);
        let tasks = tasks.into_par_iter().enumerate();
        pool::each(py, threads, tasks, |(chunk, (t, uv, primitive, geometry, normal))| {
            let mut hits = [None; CHUNK];
            for (i, hit) in self.hits(&rays, chunk, &mut hits).iter().enumerate() {
                (t[i], primitive[i], geometry[i]) = (f32::INFINITY, INVALID, INVALID);
                if let Some(hit) = hit {
                    // Of the two zeros the one without a sign.
                    t[i] = hit.t + 0.0;
                    uv[2 * i..2 * i + 2].copy_from_slice(&weights_f32(hit.u.into(), hit.v.into()));
                    (primitive[i], geometry[i]) = (hit.primitive, hit.geometry);
                }
            }
            self.normals_of(primitive, geometry, normalize, normal, |x| x as f32);
        })?;
        Ok((t.flat(), uv.rows()?, primitive.flat(), geometry.flat(), normal.rows()?))
    }

    /// The nearest hits in f64; a miss has t infinite, ids -1 and zeros.
    #[pyo3(signature = (origins, directions, tmin = 0.0, tmax = Ends::All(f64::INFINITY), threads = 0))]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        origins: Points<'py>,
        directions: Points<'py>,
        tmin: f64,
        tmax: Ends<'py>,
        threads: usize,
    ) -> PyResult<Closest<'py>> {
        let rays = Rays::new(&origins, &directions, tmin, &tmax)?;
        let count = rays.len();
        let (mut t, mut uv) = (Answers::new(py, count, 1)?, Answers::new(py, count, 2)?);
        let (mut primitive, mut geometry) = (Answers::new(py, count, 1)?, Answers::new(py, count, 1)?);
        let tasks = (t.chunks()?, uv.chunks()?, primitive.chunks()?, geometry.chunks()?);
        pool::each(py, threads, tasks.into_par_iter().enumerate(), |(chunk, (t, uv, primitive, geometry))| {
            let mut hits = [None; CHUNK];
            for (i, hit) in self.precise_hits(&rays, chunk, &mut hits).iter().enumerate() {
                (t[i], primitive[i], geometry[i]) = (f64::INFINITY, -1, -1);
                if let Some(hit) = hit {
                    t[i] = hit.t;
                    uv[2 * i..2 * i + 2].copy_from_slice(&[hit.u, hit.v]);
                    (primitive[i], geometry[i]) = (hit.primitive.into(), hit.geometry.into());
                }
            }
        })?;
        Ok((t.flat(), uv.rows()?, primitive.flat(), geometry.flat()))
    }

    /// The normals of triangles, of unit length; zero for `INVALID`, for what is not there, and for triangles without
    /// an area.
    #[pyo3(signature = (geometry, primitive, threads = 0))]
    fn normals<'py>(
        &self,
        py: Python<'py>,
        geometry: PyReadonlyArray1<'py, u32>,
        primitive: PyReadonlyArray1<'py, u32>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (geometry, primitive) = (geometry.as_array(), primitive.as_array());
        let count = geometry.len();
        if primitive.len() != count {
            return Err(PyValueError::new_err(format!(
                "primitive: {} of them, but {count} geometries",
                primitive.len()
            )));
        }
        let meshes = self.precise.meshes();
        let exists = |geometry: u32, primitive: u32| {
            meshes.get(geometry as usize).is_some_and(|mesh| (primitive as usize) < mesh.triangles.len())
        };
        let mut answers = Answers::new(py, count, 3)?;
        pool::each(py, threads, answers.chunks()?.enumerate(), |(chunk, normals)| {
            let (mut geometries, mut primitives) = ([INVALID; CHUNK], [INVALID; CHUNK]);
            let count = normals.len() / 3;
            for i in 0..count {
                let (geometry, primitive) = (geometry[chunk * CHUNK + i], primitive[chunk * CHUNK + i]);
                if exists(geometry, primitive) {
                    (geometries[i], primitives[i]) = (geometry, primitive);
                }
            }
            self.normals_of(&primitives[..count], &geometries[..count], true, normals, |x| x);
        })?;
        answers.rows()
    }
}

/// The normal by the right-hand rule; zero for a triangle without an area.
#[inline]
fn normal([a, b, c]: [DVec3; 3], normalize: bool) -> DVec3 {
    let normal = (b - a).cross(c - a);
    if normalize { normal.normalize_or_zero() } else { normal }
}

impl Scene {
    /// What counts are taken of: the meshes without triangles that repeat others. When it is first asked it is looked
    /// for these, on so many threads, without the interpreter's lock.
    pub fn counted(&self, py: Python<'_>, threads: usize) -> PyResult<&PreciseScene> {
        if self.precise.knows_distinct() {
            return Ok(self.precise.distinct());
        }
        pool::run(py, threads, || self.precise.distinct())
    }

    /// The normals of triangles, of which all but the `INVALID` ones exist, into three times as many numbers, as `real`
    /// has them. In steps, in each of which the processor waits for many cache lines together: the indices of some
    /// triangles, then their corners, and only then is anything computed.
    pub fn normals_of<F>(
        &self,
        primitive: &[u32],
        geometry: &[u32],
        normalize: bool,
        normals: &mut [F],
        real: impl Fn(f64) -> F,
    ) {
        const TOGETHER: usize = 64;
        let meshes = self.precise.meshes();
        let ids = primitive.chunks(TOGETHER).zip(geometry.chunks(TOGETHER));
        for ((primitive, geometry), normals) in ids.zip(normals.chunks_mut(3 * TOGETHER)) {
            let (mut indices, mut corners) = ([[0; 3]; TOGETHER], [[DVec3::ZERO; 3]; TOGETHER]);
            for (indices, (&primitive, &geometry)) in indices.iter_mut().zip(primitive.iter().zip(geometry)) {
                if geometry != INVALID {
                    *indices = meshes[geometry as usize].triangles[primitive as usize];
                }
            }
            for (corners, (indices, &geometry)) in corners.iter_mut().zip(indices.iter().zip(geometry)) {
                if geometry != INVALID {
                    let positions = &meshes[geometry as usize].positions;
                    *corners = indices.map(|i| positions[i as usize]);
                }
            }
            for (three, corners) in normals.chunks_exact_mut(3).zip(corners) {
                // Zero where there is no triangle.
                let normal = normal(corners, normalize).to_array();
                three.iter_mut().zip(normal).for_each(|(to, from)| *to = real(from));
            }
        }
    }

    /// The hits of a chunk of the rays, if rays and meshes are in f32, and need no more.
    fn exact_hits<'a>(
        &self,
        rays: &Rays<'_>,
        chunk: usize,
        hits: &'a mut [Option<Hit>; CHUNK],
    ) -> Option<&'a [Option<Hit>]> {
        let bvh = self.precise.exact().filter(|_| rays.are_f32())?;
        let rays = rays.rounded(rays.chunk(chunk))?;
        let hits = &mut hits[..rays.len()];
        bvh.closest_batch(&rays, hits, Batch::of(&rays));
        Some(hits)
    }

    /// The hits of a chunk of the rays.
    fn hits<'a>(&self, rays: &Rays<'_>, chunk: usize, hits: &'a mut [Option<Hit>; CHUNK]) -> &'a [Option<Hit>] {
        if self.exact_hits(rays, chunk, hits).is_some() {
            return &hits[..rays.chunk(chunk).len()];
        }
        let hits = &mut hits[..rays.chunk(chunk).len()];
        let mut precise = [None; CHUNK];
        let rounded = |PreciseHit { t, u, v, primitive, geometry, instance }| Hit {
            t: finite_f32(t),
            u: u as f32,
            v: v as f32,
            primitive,
            geometry,
            instance,
        };
        let precise = self.precise_hits(rays, chunk, &mut precise);
        hits.iter_mut().zip(precise).for_each(|(hit, precise)| *hit = precise.map(rounded));
        hits
    }

    fn precise_hits<'a>(
        &self,
        rays: &Rays<'_>,
        chunk: usize,
        hits: &'a mut [Option<PreciseHit>; CHUNK],
    ) -> &'a [Option<PreciseHit>] {
        let which = rays.chunk(chunk);
        let hits = &mut hits[..which.len()];
        self.precise.closest_batch(&rays.some(which), hits);
        hits
    }
}
