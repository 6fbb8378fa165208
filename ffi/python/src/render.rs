//! Pictures: of a scene file, or of meshes that Python has; and the command line.

use std::ffi::OsString;
use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use twincast::io::{self, LoadOptions, Normals, Unit, UpAxis};
use twincast::math::{DVec3, Vec3};
use twincast::render::Control;
use twincast::scene::{Camera, Geometry, Integrator, Material, Mesh};
use twincast::trace::Batch;
use twincast::trace::bvh::Bvh;
use twincast::{Image, Renderer, Scene, Settings, World};

use crate::arrays::Points;
use crate::{pool, value_error};

/// Linear RGBA, rows from the top: (height, width, 4).
type Picture<'py> = Bound<'py, PyArray3<f32>>;

/// Where the camera is, what it looks at, what is up, and its vertical field of view in degrees.
type View = ([f64; 3], [f64; 3], [f64; 3], f64);

/// What is to be made of a scene; what is not given the scene says, or is usual.
#[derive(FromPyObject)]
pub struct RenderOptions {
    #[pyo3(item)]
    size: Option<(u32, u32)>,
    #[pyo3(item)]
    spp: Option<u32>,
    #[pyo3(item)]
    seed: Option<u64>,
    #[pyo3(item)]
    view: Option<View>,
    #[pyo3(item)]
    camera: Option<String>,
    #[pyo3(item)]
    integrator: Option<String>,
    #[pyo3(item)]
    max_depth: Option<u32>,
    #[pyo3(item)]
    background: Option<[f32; 3]>,
    #[pyo3(item)]
    threads: usize,
}

impl RenderOptions {
    fn settings(&self, scene: &Scene) -> PyResult<Settings> {
        let asked = Settings::of_request(&scene.request);
        let (width, height) = self.size.unwrap_or((asked.width, asked.height));
        let integrator = match self.integrator.as_deref() {
            None => asked.integrator,
            Some(name) => {
                let [a, b, c] = Integrator::ALL.map(|it| (it.name(), Some(it)));
                by_name("integrator", name, [a, b, c, ("auto", None)])?
            }
        };
        Ok(Settings {
            width,
            height,
            spp: self.spp.unwrap_or(asked.spp),
            seed: self.seed.unwrap_or(asked.seed),
            integrator,
            max_depth: self.max_depth.or(asked.max_depth),
            background: self.background.map(Vec3::from),
            batch: Batch { coherent: true, ..Batch::default() },
            ..asked
        })
    }

    /// The camera that is wished for, or the scene's; none where that has none.
    fn camera(&self, scene: &Scene) -> PyResult<Option<Camera>> {
        if let Some((eye, target, up, fov)) = self.view {
            let [eye, target, up] = [eye, target, up].map(DVec3::from);
            let camera = Camera::look_at(eye, target, up, fov.to_radians());
            let message = || Camera::no_look(["eye", "look_at", "up"], [eye, target, up]);
            return camera.map(Some).ok_or_else(|| PyValueError::new_err(message()));
        }
        if let Some(name) = &self.camera {
            let found = scene.cameras.iter().find(|camera| camera.name == *name);
            let names: Vec<&str> = scene.cameras.iter().map(|camera| &camera.name[..]).collect();
            let unknown = || PyValueError::new_err(format!("camera {name:?} is not one of {names:?}"));
            return found.cloned().map(Some).ok_or_else(unknown);
        }
        Ok(scene.cameras.first().cloned())
    }

    fn render<'py>(&self, py: Python<'py>, scene: &Scene) -> PyResult<Picture<'py>> {
        let settings = self.settings(scene)?;
        let camera = self.camera(scene)?;
        let aspect = f64::from(settings.width) / f64::from(settings.height.max(1));
        let image = pool::interruptible(py, self.threads, |cancel| {
            let camera = camera.unwrap_or_else(|| Camera::framing(&scene.bounds(), aspect));
            let world = World::new(scene)?;
            let renderer = Renderer::new(scene, &world, camera, settings)?;
            renderer.render(&Bvh::build(&world), Control { cancel: Some(cancel), ..Control::default() })
        })?;
        let image = image.map_err(value_error)?;
        let Image { width, height, pixels } = image;
        let flat: Vec<f32> = pixels.into_iter().flat_map(|pixel| pixel.to_array()).collect();
        flat.into_pyarray(py).reshape([height as usize, width as usize, 4])
    }
}

fn by_name<T: Copy, const N: usize>(argument: &str, name: &str, known: [(&str, T); N]) -> PyResult<T> {
    let found = known.iter().find(|(known, _)| *known == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        PyValueError::new_err(format!("{argument} must be one of {}, not {name:?}", names.join(", ")))
    })
}

/// Renders a scene file; also the warnings about it.
#[pyfunction]
#[pyo3(signature = (path, render_options, up_axis = "y", unit = "m", normals = "file"))]
pub fn render_file<'py>(
    py: Python<'py>,
    path: PathBuf,
    render_options: RenderOptions,
    up_axis: &str,
    unit: &str,
    normals: &str,
) -> PyResult<(Picture<'py>, Vec<String>)> {
    let options = LoadOptions {
        up_axis: by_name("up_axis", up_axis, UpAxis::ALL.map(|axis| (axis.name(), axis)))?,
        unit: by_name("unit", unit, Unit::ALL.map(|unit| (unit.name(), unit)))?,
        normals: by_name("normals", normals, Normals::ALL.map(|kind| (kind.name(), kind)))?,
        ..LoadOptions::default()
    };
    let loaded = pool::run(py, render_options.threads, || io::load(&path, &options))?;
    let (scene, warnings) = loaded.map_err(value_error)?;
    Ok((render_options.render(py, &scene)?, warnings.iter().map(ToString::to_string).collect()))
}

/// Renders meshes: vertices, triangles, and their diffuse colour, linear.
#[pyfunction]
#[pyo3(signature = (meshes, render_options, normals = "flat"))]
pub fn render_meshes<'py>(
    py: Python<'py>,
    meshes: Vec<(Points<'py>, PyReadonlyArray2<'py, u32>, [f32; 3])>,
    render_options: RenderOptions,
    normals: &str,
) -> PyResult<Picture<'py>> {
    let is_smooth = by_name("normals", normals, [("flat", false), ("smooth", true)])?;
    let (mut geometries, mut materials) = (Vec::new(), Vec::new());
    for (number, (vertices, triangles, color)) in meshes.iter().enumerate() {
        let (vertices, triangles) = (vertices.rows("vertices")?, triangles.as_array());
        let positions: Vec<DVec3> = (0..vertices.len()).map(|i| vertices.at(i)).collect();
        let triangles: Vec<[u32; 3]> = triangles.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect();
        if let Some(i) = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= positions.len())) {
            let message = format!("triangle {i} of mesh {number} names a vertex that is not there: {:?}", triangles[i]);
            return Err(PyValueError::new_err(message));
        }
        let mut mesh = Mesh { material: number as u32, ..Mesh::new(Vec::new(), triangles) };
        pool::run(py, render_options.threads, || {
            mesh.set_positions(&positions);
            mesh.drop_strays();
            if is_smooth {
                mesh.smooth_normals();
            }
        })?;
        geometries.push(Geometry::Mesh(mesh));
        materials.push(Material { diffuse: Vec3::from(*color), ..Material::default() });
    }
    render_options.render(py, &Scene::from_geometries(geometries, materials))
}

/// The command line, on these arguments, of which the first is the program's name; returns the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| twincast::cli::main_with(arguments))
}
