//! Which accelerator: its flags, and what they go together with.

use clap::{Args, ValueEnum};

use super::build::BuildArgs;
use super::cache::CacheArgs;
use super::common::by_name;
use super::engine::BackendArg;
use crate::error::{Error, Result};
use crate::math::UVec3;
use crate::shape::{SphereMethod, TriangleMethod};
use crate::trace::accel::{Accel, Methods, Options, Resolution};

#[derive(Debug, Args)]
pub(super) struct AccelArgs {
    /// How the native engine searches the scene; never changes a picture
    #[arg(long, value_enum, default_value_t)]
    pub(super) accel: AccelArg,

    #[command(flatten)]
    pub(super) options: AccelOptions,
}

/// What an accelerator may be told.
#[derive(Debug, Args)]
pub(super) struct AccelOptions {
    /// Cells of the grid: along its longest side, or along each axis (default: by the number of primitives)
    #[arg(long, value_name = "N|XxYxZ", value_parser = parse_grid)]
    grid: Option<Resolution>,

    /// How the classic accelerators meet triangles: exact, or a textbook's side-planes, same-side, areas,
    /// moeller-trumbore or woop, to see what these miss
    #[arg(long, value_name = "NAME", value_parser = parse_triangle_method)]
    triangle_method: Option<TriangleMethod>,

    /// How the classic accelerators meet spheres: exact, or a textbook's algebraic, geometric or accurate
    #[arg(long, value_name = "NAME", value_parser = parse_sphere_method)]
    sphere_method: Option<SphereMethod>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum AccelArg {
    /// The eight-wide BVH
    #[default]
    Bvh,
    /// Every primitive for every ray
    Brute,
    /// A flat list of boxes, one a geometry
    Groups,
    /// A binary BVH
    BinaryBvh,
    /// A uniform grid, nested where it is crowded
    Grid,
    /// An octree
    Octree,
    /// A kd-tree
    KdTree,
    /// A BSP tree of general planes
    Bsp,
}

impl AccelArg {
    pub(super) const fn accel(self) -> Accel {
        match self {
            Self::Bvh => Accel::Bvh,
            Self::Brute => Accel::Brute,
            Self::Groups => Accel::Groups,
            Self::BinaryBvh => Accel::Binary,
            Self::Grid => Accel::Grid,
            Self::Octree => Accel::Octree,
            Self::KdTree => Accel::Kd,
            Self::Bsp => Accel::Bsp,
        }
    }
}

impl AccelOptions {
    /// For these accelerators.
    ///
    /// # Errors
    /// [`Error::Usage`] for a resolution without a grid, and for methods without an accelerator that has a choice.
    pub(super) fn choose(&self, accels: &[Accel]) -> Result<Options> {
        if self.grid.is_some() && !accels.contains(&Accel::Grid) {
            return Err(Error::Usage("--grid is the resolution of --accel grid; give both or neither".to_owned()));
        }
        let has_choice = |accel: &Accel| !matches!(accel, Accel::Bvh | Accel::Brute);
        if (self.triangle_method.is_some() || self.sphere_method.is_some()) && !accels.iter().any(has_choice) {
            let problem =
                "are for the classic accelerators: add --accel binary-bvh or another; bvh and brute are exact";
            return Err(Error::Usage(format!("--triangle-method and --sphere-method {problem}")));
        }
        let methods = Methods {
            triangle: self.triangle_method.unwrap_or_default(),
            sphere: self.sphere_method.unwrap_or_default(),
        };
        Ok(Options { grid: self.grid, methods, ..Options::default() })
    }
}

impl AccelArgs {
    /// The accelerator and its options.
    ///
    /// # Errors
    /// [`Error::Usage`] where Embree alone renders, and where something is said about a native BVH that is not built.
    pub(super) fn choose(
        &self,
        backend: BackendArg,
        build: Option<&BuildArgs>,
        cache: &CacheArgs,
    ) -> Result<(Accel, Options)> {
        let accel = self.accel.accel();
        let options = self.options.choose(&[accel])?;
        if accel == Accel::Bvh {
            return Ok((accel, options));
        }
        let name = accel.name();
        let refuse = |problem: &str| Err(Error::Usage(format!("--accel {name} {problem}; leave one of them out")));
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

fn parse_triangle_method(name: &str) -> std::result::Result<TriangleMethod, String> {
    by_name(TriangleMethod::ALL, TriangleMethod::name, name)
}

fn parse_sphere_method(name: &str) -> std::result::Result<SphereMethod, String> {
    by_name(SphereMethod::ALL, SphereMethod::name, name)
}

fn parse_grid(text: &str) -> std::result::Result<Resolution, String> {
    let side = |text: &str| text.parse().ok().filter(|side| (1..=Resolution::MOST).contains(side));
    let sides: Option<Vec<u32>> = text.split(['x', 'X']).map(side).collect();
    match sides.as_deref() {
        Some(&[n]) => Ok(Resolution::Longest(n)),
        Some(&[x, y, z]) if u64::from(x) * u64::from(y) * u64::from(z) <= Resolution::MOST_CELLS => {
            Ok(Resolution::Axes(UVec3::new(x, y, z)))
        }
        Some(&[_, _, _]) => Err(format!("expected at most {} cells in all", Resolution::MOST_CELLS)),
        _ => Err(format!("expected N or XxYxZ, each 1 to {}, as in 64 or 100x20x100", Resolution::MOST)),
    }
}
