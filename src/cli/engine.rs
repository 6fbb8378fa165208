//! One scene through the engine or engines that were asked for.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::ValueEnum;
use indicatif::ProgressBar;

use super::checkpoint::Kept;
use super::display::Display;
use super::{cache, interrupt, progress};
use crate::error::{Error, Result};
use crate::math::expansion::decisions;
use crate::render::{Control, Counted, Finished, Picture, Renderer};
use crate::trace::accel::{Accel, Built, Options as AccelOptions};
use crate::trace::bvh::{self, Bvh, Cache, CacheReport, Preset};
use crate::trace::{Tracer, Width, World};

/// Which engine renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum BackendArg {
    /// The BVH of this program
    #[default]
    Native,
    /// Intel Embree
    Embree,
    /// Each of them; of pictures, fails where they differ and no tie or boundary ray explains it
    Both,
}

impl BackendArg {
    /// An error where this build lacks it.
    pub(super) fn check_available(self) -> Result<()> {
        if self == Self::Native || cfg!(feature = "embree") {
            return Ok(());
        }
        Err(Error::Unavailable(
            "backend embree is not in this build: install libembree-dev and build with --features embree".to_owned(),
        ))
    }

    /// The packet width that serves it best. Both engines are compared ray by ray, where every answer stands alone.
    pub(super) const fn best_width(self) -> Width {
        match self {
            Self::Native | Self::Both => Width::One,
            Self::Embree => Width::Eight,
        }
    }
}

/// A picture by one engine, and what it took.
pub(super) struct Pass {
    /// The engine, with its version where it has one.
    pub(super) engine: String,
    pub(super) picture: Picture,
    pub(super) build_seconds: f64,
    pub(super) render_seconds: f64,
    /// Bytes the engine uses for the scene.
    pub(super) bytes: usize,
    pub(super) closest_rays: u64,
    pub(super) shadow_rays: u64,
    /// Decisions that were left to exact arithmetic.
    pub(super) exact: u64,
    /// What became of the native tree's file.
    pub(super) cache: Option<CacheReport>,
    /// What there is to say about how the engine was built.
    pub(super) notes: Vec<String>,
}

/// What both engines were made to render.
pub(super) struct Job<'a> {
    pub(super) world: &'a World,
    pub(super) renderer: &'a Renderer<'a>,
    pub(super) pixels: u64,
    pub(super) cancel: &'a AtomicBool,
    pub(super) quiet: bool,
    /// How well the native tree is worth building.
    pub(super) build: Preset,
    /// How the native engine searches the scene.
    pub(super) accel: &'a (Accel, AccelOptions),
    /// Where native trees are kept.
    pub(super) cache: Option<&'a Cache>,
    /// Where the picture is shown while it is made.
    pub(super) display: Option<&'a Display>,
    /// Whether what is done is kept.
    pub(super) kept: Option<&'a Kept>,
}

/// What came of it.
pub(super) struct Outcome {
    /// One pass, or native's and then Embree's.
    pub(super) passes: Vec<Pass>,
    /// Where both rendered: what to say, and whether every difference is explained.
    pub(super) verdict: Option<(String, bool)>,
}

impl Job<'_> {
    /// Renders. The engine is chosen here, once; below everything is generic.
    pub(super) fn run(&self, backend: BackendArg) -> Result<Outcome> {
        backend.check_available()?;
        match backend {
            BackendArg::Native if self.accel.0 == Accel::Bvh => {
                Ok(Outcome { passes: vec![self.native()?.1], verdict: None })
            }
            BackendArg::Native => Ok(Outcome { passes: vec![self.accelerated()?.1], verdict: None }),
            #[cfg(feature = "embree")]
            BackendArg::Embree => Ok(Outcome { passes: vec![self.embree()?.1], verdict: None }),
            #[cfg(feature = "embree")]
            BackendArg::Both if self.accel.0 == Accel::Bvh => self.both(self.native()?),
            #[cfg(feature = "embree")]
            BackendArg::Both => self.both(self.accelerated()?),
            #[cfg(not(feature = "embree"))]
            BackendArg::Embree | BackendArg::Both => unreachable!("check_available refused it"),
        }
    }

    fn native(&self) -> Result<(Bvh, Pass)> {
        let bar =
            progress::bar(self.world.stored_primitives() + self.world.placements.len() as u64, "building", self.quiet);
        let placed = |count| bar.inc(count);
        let options = bvh::Options { preset: self.build, progress: Some(&placed), ..bvh::Options::default() };
        let mut report = None;
        let build = || {
            let (bvh, kept) = cache::bvh(self.cache, self.world, options);
            report = kept;
            Ok(bvh)
        };
        let (bvh, pass) = self.pass(&bar, build, |_| "native (BVH)".to_owned(), Bvh::bytes)?;
        Ok((bvh, Pass { cache: report, ..pass }))
    }

    /// By another accelerator than the native BVH.
    fn accelerated(&self) -> Result<(Built, Pass)> {
        let (accel, options) = self.accel;
        let bar = progress::spinner("building", self.quiet);
        let build = || Ok(accel.build(self.world, options));
        let (built, pass) = self.pass(&bar, build, |_| format!("native ({})", accel.name()), |built| built.bytes)?;
        let notes = built.notes.clone();
        Ok((built, Pass { notes, ..pass }))
    }

    #[cfg(feature = "embree")]
    fn embree(&self) -> Result<(crate::trace::embree::Embree, Pass)> {
        use crate::trace::embree::{Embree, Options};
        let options = Options { threads: Some(rayon::current_num_threads()), ..Options::default() };
        // Embree does not tell how far it is.
        let bar = progress::spinner("building", self.quiet);
        let build = || Embree::new(self.world, &options);
        self.pass(&bar, build, |embree| format!("embree {}", embree.version()), Embree::bytes)
    }

    /// Embree beside a tracer that has rendered, and what the pixels that differ come from.
    #[cfg(feature = "embree")]
    fn both(&self, (native, native_pass): (impl Tracer, Pass)) -> Result<Outcome> {
        let (embree, embree_pass) = self.embree()?;
        let report = crate::lab::explain_pixels(
            self.renderer,
            &native,
            &embree,
            &native_pass.picture.image,
            &embree_pass.picture.image,
        );
        let words = match report.differing {
            0 => format!("all {} pixels of native and embree are equal", report.pixels),
            differing => format!(
                "{differing} pixels of native and embree differ: {} by a tie or a boundary ray, {} by a wrong answer of \
                 embree, {} unexplained",
                report.tie_or_boundary, report.embree_wrong, report.unexplained
            ),
        };
        let holds = report.unexplained == 0;
        Ok(Outcome { passes: vec![native_pass, embree_pass], verdict: Some((words, holds)) })
    }

    fn pass<T: Tracer>(
        &self,
        building: &ProgressBar,
        build: impl FnOnce() -> Result<T>,
        name: impl FnOnce(&T) -> String,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Result<(T, Pass)> {
        let start = Instant::now();
        let tracer = build();
        building.finish_and_clear();
        let tracer = tracer?;
        let build_seconds = start.elapsed().as_secs_f64();
        interrupt::check()?;

        let engine = name(&tracer);
        let bar = progress::bar(self.pixels, &engine, self.quiet);
        let (counted, decided) = (Counted::new(&tracer), decisions());
        let on_tile = |pixels| bar.inc(pixels);
        let start = Instant::now();
        let show = self.display.map(|display| {
            let window = self.renderer.window();
            display.begin(&engine, [window.width, window.height]);
            move |finished: Finished| display.show(&finished)
        });
        let on_pixels = show.as_ref().map(|show| show as &(dyn Fn(Finished) + Sync));
        let checkpoint = self.kept.map(|kept| kept.by(&engine));
        let control = Control { cancel: Some(self.cancel), on_tile: Some(&on_tile), on_pixels };
        let picture = self.renderer.picture(&counted, control, checkpoint.as_ref());
        let render_seconds = start.elapsed().as_secs_f64();
        bar.finish_and_clear();

        let (closest_rays, shadow_rays) = (counted.closest_rays(), counted.occluded_rays());
        let exact = decisions() - decided;
        let bytes = bytes(&tracer);
        let picture = picture?;
        let (cache, notes) = (None, Vec::new());
        let pass = Pass {
            engine,
            picture,
            build_seconds,
            render_seconds,
            bytes,
            closest_rays,
            shadow_rays,
            exact,
            cache,
            notes,
        };
        Ok((tracer, pass))
    }
}
