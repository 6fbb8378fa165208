//! Who is asked: a column of the matrix is a way to answer rays, in all the forms that must answer alike.

use std::time::Duration;

use super::Gate;
use crate::error::Result;
use crate::shape::{Shape, SphereMethod, TriangleMethod};
use crate::trace::accel::{Accel, Methods, Options};
use crate::trace::bvh::{self, Bvh, Isa, Preset, Travel};
use crate::trace::{Batch, Primitives, Tracer, Width, World};

/// Of a BSP tree, which takes what it gets. Hits do not depend on it.
const BSP_TIME: Duration = Duration::from_millis(200);

/// How the native tracer may be asked. To it widths of batches are nothing.
const NATIVE_WAYS: [(&str, Travel, bool); 4] = [
    ("alone", Travel::Alone, false),
    ("flights", Travel::InFlight, false),
    ("bundles, alone", Travel::Alone, true),
    ("bundles, flights", Travel::InFlight, true),
];

/// A column of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// The native tracer: every preset, instruction set of this processor and way of batches.
    Native,
    /// An accelerator with the exact methods.
    Accel(Accel),
    /// A textbook's method of triangles, on every accelerator that has a choice.
    Triangle(TriangleMethod),
    /// A textbook's method of spheres, likewise.
    Sphere(SphereMethod),
    /// Embree, in packets of every width.
    #[cfg(feature = "embree")]
    Embree(EmbreeMode),
}

/// How Embree builds and traces.
#[cfg(feature = "embree")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmbreeMode {
    /// `RTC_SCENE_FLAG_ROBUST`, as this program uses it.
    Robust,
    /// Without flags.
    Fast,
    /// `RTC_SCENE_FLAG_COMPACT`.
    Compact,
}

/// Every column of this build, in the order of the table.
pub fn columns() -> Vec<Column> {
    let accels = Accel::ALL.into_iter().filter(|&accel| accel != Accel::Bvh).map(Column::Accel);
    let triangles = TriangleMethod::ALL.into_iter().filter(|&method| method != TriangleMethod::Exact);
    let spheres = SphereMethod::ALL.into_iter().filter(|&method| method != SphereMethod::Exact);
    let all = [Column::Native].into_iter().chain(accels).chain(triangles.map(Column::Triangle));
    let all = all.chain(spheres.map(Column::Sphere));
    #[cfg(feature = "embree")]
    let all = all.chain([EmbreeMode::Robust, EmbreeMode::Fast, EmbreeMode::Compact].map(Column::Embree));
    all.collect()
}

impl Column {
    /// As in reports, and as `--method` has it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::Accel(accel) => accel.name(),
            Self::Triangle(method) => method.name(),
            Self::Sphere(method) => method.name(),
            #[cfg(feature = "embree")]
            Self::Embree(EmbreeMode::Robust) => "embree-robust",
            #[cfg(feature = "embree")]
            Self::Embree(EmbreeMode::Fast) => "embree-fast",
            #[cfg(feature = "embree")]
            Self::Embree(EmbreeMode::Compact) => "embree-compact",
        }
    }

    /// Whether it is exact, and so held to [`Gate::Exact`] whatever a case asks of others.
    pub const fn is_exact(self) -> bool {
        matches!(self, Self::Native | Self::Accel(_))
    }

    /// Whether it is one of this program.
    pub const fn is_native(self) -> bool {
        matches!(self, Self::Native | Self::Accel(_) | Self::Triangle(_) | Self::Sphere(_))
    }

    /// What it is held to in a case with this gate.
    pub const fn gate(self, of_case: Gate) -> Gate {
        if self.is_exact() { Gate::Exact } else { of_case }
    }

    /// Whether there is something in the world that it is about, and that it does not refuse.
    pub fn applies(self, world: &World) -> bool {
        let any = |has: fn(&Primitives) -> bool| world.parts.iter().any(|part| has(&part.primitives));
        match self {
            Self::Triangle(_) => any(|primitives| matches!(primitives, Primitives::Triangles { .. })),
            Self::Sphere(_) => any(|primitives| match primitives {
                Primitives::Shapes(shapes) => shapes.iter().any(|shape| matches!(shape, Shape::Sphere(_))),
                Primitives::Triangles { .. } => false,
            }),
            #[cfg(feature = "embree")]
            Self::Embree(_) => crate::trace::embree::Embree::check(world).is_ok(),
            Self::Native | Self::Accel(_) => true,
        }
    }

    /// How many forms it has in this build, on this processor.
    pub fn forms(self) -> usize {
        let classics = || Accel::ALL.into_iter().filter(|accel| accel.has_methods()).count();
        match self {
            Self::Native => {
                let isas = Isa::available().count();
                Preset::ALL.len() * isas * NATIVE_WAYS.len()
            }
            Self::Accel(_) => 1,
            Self::Triangle(_) | Self::Sphere(_) => classics(),
            #[cfg(feature = "embree")]
            Self::Embree(_) => Width::ALL.len(),
        }
    }

    /// Builds each of its forms, one after the other, and calls `ask` with its name for every way of batches.
    ///
    /// # Errors
    /// Those of Embree, and those of `ask`.
    pub fn each(self, world: &World, ask: &mut dyn FnMut(&str, &dyn Tracer, Batch) -> Result<()>) -> Result<()> {
        let alone = Batch { width: Width::One, coherent: false };
        let with = |accel: Accel, methods: Methods| {
            accel.build(world, &Options { methods, bsp_time: Some(BSP_TIME), ..Options::default() })
        };
        let mut on_classics = |methods: Methods| -> Result<()> {
            for accel in Accel::ALL.into_iter().filter(|accel| accel.has_methods()) {
                ask(accel.name(), &with(accel, methods), alone)?;
            }
            Ok(())
        };
        match self {
            Self::Native => {
                for (preset, isa) in Preset::ALL.into_iter().flat_map(|preset| Isa::ALL.map(|isa| (preset, isa))) {
                    if !isa.is_available() {
                        continue;
                    }
                    let mut bvh = Bvh::build_with(world, bvh::Options { preset, isa, progress: None });
                    let name = |way: &str| format!("{}/{}/{way}", preset.name(), isa.name());
                    for (way, travel, coherent) in NATIVE_WAYS {
                        bvh = bvh.travelling(travel);
                        ask(&name(way), &bvh, Batch { width: Width::One, coherent })?;
                    }
                }
                Ok(())
            }
            Self::Accel(accel) => ask("", &with(accel, Methods::default()), alone),
            Self::Triangle(triangle) => on_classics(Methods { triangle, ..Methods::default() }),
            Self::Sphere(sphere) => on_classics(Methods { sphere, ..Methods::default() }),
            #[cfg(feature = "embree")]
            Self::Embree(mode) => {
                use crate::trace::embree::{Embree, Options};
                let (robust, compact) = (mode == EmbreeMode::Robust, mode == EmbreeMode::Compact);
                let embree = Embree::new(world, &Options { robust, compact, ..Options::default() })?;
                for width in Width::ALL {
                    ask(&width.rays().to_string(), &embree, Batch { width, coherent: false })?;
                }
                Ok(())
            }
        }
    }
}
