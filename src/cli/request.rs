//! What is to be rendered: what the flags of `render` say, and the scene that they name. Everything that can be refused
//! before the work is refused here.

use std::iter;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::checkpoint::Kept;
use super::denoise::Denoising;
use super::engine::BackendArg;
use super::render::RenderArgs;
use super::{interrupt, outputs, warn};
use crate::error::{Error, Result};
use crate::image::{self, Reference};
use crate::render::{Crop, Settings};
use crate::scene::{Camera, Request, Scene};
use crate::trace::accel::{Accel, Options as AccelOptions};

/// What is to be rendered, by the scene and the flags.
pub(super) struct RenderRequest {
    pub(super) scene: Scene,
    pub(super) load_seconds: f64,
    pub(super) settings: Settings,
    pub(super) accel: (Accel, AccelOptions),
    /// Where it goes.
    pub(super) pictures: Vec<PathBuf>,
    pub(super) kept: Option<Kept>,
    pub(super) camera: Camera,
    /// Where the camera is from, for the summary.
    pub(super) camera_source: String,
}

impl RenderRequest {
    /// Width and height of what is rendered, in pixels.
    pub(super) fn size(&self) -> [u32; 2] {
        let Crop { width, height, .. } = self.settings.window();
        [width, height]
    }

    pub(super) fn pixels(&self) -> u64 {
        self.size().into_iter().map(u64::from).product()
    }
}

impl RenderArgs {
    /// Reads the scene, and says what is to be made of it. Everything that can be refused before the work is.
    pub(super) fn request(
        &self,
        denoising: Option<&Denoising>,
        reference: Option<&Reference>,
    ) -> Result<RenderRequest> {
        let start = Instant::now();
        let (mut scene, warnings) = self.scene.load_with_bar(self.camera.has_shutter(), self.quiet)?;
        warn(&warnings);
        self.light.apply(&mut scene)?;
        let load_seconds = start.elapsed().as_secs_f64();
        interrupt::check()?;

        let accel = self.accel.choose(scene.request.search, self.backend, Some(&self.build), &self.cache)?;
        let mut settings = self.picture.settings(&scene.request, self.backend.best_width());
        settings.aovs = denoising.map_or_else(|| self.aov.aovs(), Denoising::aovs);
        if settings.adaptive.is_some() && self.backend == BackendArg::Both {
            return Err(Error::Usage(
                "--noise is for one engine, not for --backend both: each would choose its samples".into(),
            ));
        }
        let pictures = self.pictures(&scene.request)?;
        outputs::spare(pictures.iter().chain(&self.stats), &scene.files)?;
        self.aov.check(&pictures)?;
        let read = [&self.inputs()[..], &scene.files].concat();
        let kept = self.checkpoint.open(&pictures, self.stats.as_ref(), &read, self.backend)?;
        let aspect = f64::from(settings.width) / f64::from(settings.height);
        let (camera, camera_source) = self.camera.choose(&scene, aspect)?;
        let request = RenderRequest { scene, load_seconds, settings, accel, pictures, kept, camera, camera_source };
        request.pictures.iter().try_for_each(|path| image::check_sides(path, request.size()))?;
        self.check_reference(reference, request.size())?;
        Ok(request)
    }

    /// The pictures to write: those of the flags, else the one that the scene names.
    fn pictures(&self, request: &Request) -> Result<Vec<PathBuf>> {
        if !self.output.is_empty() || self.print_camera || self.explain.is_wanted() {
            return Ok(self.output.clone());
        }
        // Of what a scene names the folder is left out: a scene must not choose whose files are replaced.
        let named = request.output.as_ref().and_then(|name| Path::new(name).file_name());
        let Some(picture) = named.map(PathBuf::from) else {
            return Err(no_picture());
        };
        image::check_suffix(&picture).map_err(|error| match error {
            Error::Output { path, message } => {
                let message = format!("names the picture {}: {message}; -o FILE chooses another", path.display());
                Error::input(&self.scene.scene, "", message)
            }
            other => other,
        })?;
        let pictures = vec![picture];
        outputs::check(&pictures, &self.stats, &self.inputs())?;
        Ok(pictures)
    }

    /// The files it reads.
    pub(super) fn inputs(&self) -> Vec<PathBuf> {
        let files = [self.reference.clone(), self.light.environment.clone(), self.camera.picture()];
        iter::once(self.scene.scene.clone()).chain(files.into_iter().flatten()).collect()
    }

    fn check_reference(&self, reference: Option<&Reference>, [width, height]: [u32; 2]) -> Result<()> {
        let (Some(Reference { image: picture, .. }), Some(path)) = (reference, &self.reference) else { return Ok(()) };
        if [picture.width, picture.height] == [width, height] {
            return Ok(());
        }
        let own = format_args!("{}x{}", picture.width, picture.height);
        let message = format!("--reference {}: it is {own}, and the picture {width}x{height}", path.display());
        Err(Error::Usage(message))
    }
}

pub(super) fn no_picture() -> Error {
    Error::Usage("no picture to write: name one with --output FILE; the scene names none".to_owned())
}
