//! Which accelerator: its flags, and what they go together with.

use clap::Args;
use clap::builder::TypedValueParser;

use super::build::BuildArgs;
use super::cache::CacheArgs;
use super::engine::BackendArg;
use super::named::one_of;
use crate::error::{Error, Result};
use crate::scene::{Accel, AcceleratorRequest, Resolution};
use crate::shape::{SphereMethod, TriangleMethod};
use crate::trace::accel::{Methods, Options};

#[derive(Clone, Debug, Args)]
pub(super) struct AccelArgs {
    /// How the native engine searches the scene (default: as the scene asks, else bvh); never changes a picture
    #[arg(long, value_name = "NAME", value_parser = accels())]
    accel: Option<Accel>,

    #[command(flatten)]
    pub(super) options: AccelOptionArgs,
}

/// What an accelerator may be told.
#[derive(Clone, Debug, Args)]
pub(super) struct AccelOptionArgs {
    /// Cells of the grid: along its longest side, or along each axis (default: by the number of primitives)
    #[arg(long, value_name = "N|XxYxZ", value_parser = parse_grid)]
    grid: Option<Resolution>,

    /// How the classic accelerators meet triangles: exactly, or as textbooks do, to see what these miss
    #[arg(long, value_name = "NAME", value_parser = one_of(TriangleMethod::ALL, TriangleMethod::name, TriangleMethod::source))]
    triangle_method: Option<TriangleMethod>,

    /// How the classic accelerators meet spheres: exactly, or as textbooks do
    #[arg(long, value_name = "NAME", value_parser = one_of(SphereMethod::ALL, SphereMethod::name, SphereMethod::source))]
    sphere_method: Option<SphereMethod>,
}

/// Reads the name of an accelerator.
pub(super) fn accels() -> impl TypedValueParser<Value = Accel> {
    one_of(Accel::ALL, Accel::name, |accel| match accel {
        Accel::Bvh => "The eight-wide BVH",
        Accel::Brute => "Every primitive for every ray",
        Accel::Groups => "A flat list of boxes, one a geometry",
        Accel::Binary => "A binary BVH",
        Accel::Grid => "A uniform grid, nested where it is crowded",
        Accel::Octree => "An octree",
        Accel::Kd => "A kd-tree",
        Accel::Bsp => "A BSP tree of general planes",
    })
}

impl AccelOptionArgs {
    /// What is said here.
    fn search(&self) -> AcceleratorRequest {
        let Self { grid, triangle_method, sphere_method } = *self;
        AcceleratorRequest { accel: None, grid, triangle_method, sphere_method }
    }

    /// For these accelerators; what is not said here, `request` may say.
    ///
    /// # Errors
    /// [`Error::Usage`] for a resolution without a grid, and for methods without an accelerator that has a choice.
    pub(super) fn choose(&self, accels: &[Accel], request: AcceleratorRequest) -> Result<Options> {
        if self.grid.is_some() && !accels.contains(&Accel::Grid) {
            return Err(Error::Usage("--grid is the resolution of --accel grid; give both or neither".to_owned()));
        }
        let said = self.search();
        let has_choice = accels.iter().any(|accel| accel.has_methods());
        if said.asks_for_methods() && !has_choice {
            let problem =
                "are for the classic accelerators: add --accel binary-bvh or another; bvh and brute are exact";
            return Err(Error::Usage(format!("--triangle-method and --sphere-method {problem}")));
        }
        let search = said.or(request);
        if search.asks_for_methods() && !has_choice {
            return Err(Error::Usage(unmet(&search, "bvh and brute are exact", "another --accel")));
        }
        Ok(options(&search))
    }
}

/// What the scene asks for and is not to be had.
fn unmet(search: &AcceleratorRequest, why: &str, instead: &str) -> String {
    let triangle = search.triangle_method.map(|method| format!("triangle_method = {:?}", method.name()));
    let sphere = search.sphere_method.map(|method| format!("sphere_method = {:?}", method.name()));
    let asked: Vec<_> = [triangle, sphere].into_iter().flatten().collect();
    let asked = asked.join(" and ");
    format!("the scene asks for {asked}, and {why}; write {instead}, or --triangle-method exact --sphere-method exact")
}

fn options(search: &AcceleratorRequest) -> Options {
    let AcceleratorRequest { grid, triangle_method, sphere_method, .. } = *search;
    let methods = Methods { triangle: triangle_method.unwrap_or_default(), sphere: sphere_method.unwrap_or_default() };
    Options { grid, methods, ..Options::default() }
}

impl AccelArgs {
    /// What can be told to be wrong before the scene is read.
    ///
    /// # Errors
    /// Those of [`AccelArgs::choose`], where an accelerator is named.
    pub(super) fn check(&self, backend: BackendArg, build: Option<&BuildArgs>, cache: &CacheArgs) -> Result<()> {
        build.map_or(Ok(()), |build| build.check(backend))?;
        match self.accel {
            Some(_) => self.choose(AcceleratorRequest::default(), backend, build, cache).map(drop),
            None => Ok(()),
        }
    }

    /// The accelerator and its options: the flags', else what the scene asks for.
    ///
    /// # Errors
    /// [`Error::Usage`] where Embree alone renders, and where something is said about a native BVH that is not built.
    pub(super) fn choose(
        &self,
        request: AcceleratorRequest,
        backend: BackendArg,
        build: Option<&BuildArgs>,
        cache: &CacheArgs,
    ) -> Result<(Accel, Options)> {
        let flag = self.accel;
        if backend == BackendArg::Embree && flag.is_none() {
            // What a scene asks of the native engine does not concern Embree, but for what it would not see.
            self.options.choose(&[Accel::Bvh], AcceleratorRequest::default())?;
            let search = self.options.search().or(request);
            if search.asks_for_methods() {
                return Err(Error::Usage(unmet(&search, "Embree has its own", "--backend native")));
            }
            return Ok((Accel::Bvh, Options::default()));
        }
        let accel = flag.or(request.accel).unwrap_or_default();
        let options = self.options.choose(&[accel], AcceleratorRequest { accel: Some(accel), ..request })?;
        if accel == Accel::Bvh {
            return Ok((accel, options));
        }
        let name = accel.name();
        let refuse = |problem: &str| {
            Err(Error::Usage(match flag {
                Some(_) => format!("--accel {name} {problem}; leave one of them out"),
                None => format!("the scene's accel = {name:?} {problem}; leave that out, or write --accel bvh"),
            }))
        };
        match backend {
            BackendArg::Embree => refuse("searches the scene in place of --backend embree"),
            _ if cache.is_given() => refuse("is not what --cache keeps: that is native BVHs"),
            _ if build.is_some_and(BuildArgs::is_given) => {
                refuse("is not what --build and --max-memory are about: that is the native BVH")
            }
            BackendArg::Native | BackendArg::Both => Ok((accel, options)),
        }
    }
}

fn parse_grid(text: &str) -> std::result::Result<Resolution, String> {
    let sides: Option<Vec<u32>> = text.split(['x', 'X']).map(|side| side.parse().ok()).collect();
    let resolution = Resolution::of_sides(&sides.unwrap_or_default());
    resolution.map_err(|expected| format!("expected N or XxYxZ, as in 64 or 100x20x100: {expected}"))
}
