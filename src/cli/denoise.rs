//! Taking the noise out of a picture that is done: the flag, what it asks of the render, and what becomes of the
//! picture.
//!
//! The network's guides, albedo and normals, are taken down with the picture's own samples, as AOVs; the render and
//! what it keeps in checkpoints are those of these AOVs. Files have them only where they were asked for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::display::Display;
use super::engine::Pass;
use super::progress;
use crate::error::{Error, Result};
use crate::image::denoise::{Denoiser, Guides};
use crate::image::{Channel, Image};
use crate::render::{Aov, Finished};

/// The layer of the picture as it was.
const NOISY: &str = "noisy";

/// What guides the network.
const GUIDES: [Aov; 2] = [Aov::Albedo, Aov::Normal];

/// Bars count in thousandths.
const WHOLE: u64 = 1000;

#[derive(Clone, Debug, Args)]
pub(super) struct DenoiseArgs {
    /// Take the noise out of the finished picture, with Intel's Open Image Denoise where that is installed (or where
    /// the environment variable TWINCAST_OIDN names it); with --aov, OpenEXR outputs keep the picture as it was in a
    /// layer "noisy"
    #[arg(long, conflicts_with = "pixel")]
    denoise: bool,
}

/// A render whose picture is to be denoised.
pub(super) struct Denoising {
    denoiser: Denoiser,
    /// What the files are to hold beside the colours.
    wanted: Vec<Aov>,
}

/// What it took.
#[derive(Debug, Serialize)]
pub(super) struct DenoiseStats {
    /// Name and version.
    pub(super) library: String,
    pub(super) seconds: f64,
}

impl DenoiseArgs {
    /// Finds the library, before any work, for a render that is to tell `wanted`; none where nothing is to be denoised.
    ///
    /// # Errors
    /// [`Error::Unavailable`] where there is no library, [`Error::Usage`] where a kind of light has the name of a layer
    /// of ours.
    pub(super) fn open(&self, wanted: &[Aov]) -> Result<Option<Denoising>> {
        if !self.denoise {
            return Ok(None);
        }
        if wanted.iter().any(|aov| matches!(aov, Aov::Light { name, .. } if name == NOISY)) {
            let message = format!("--aov: with --denoise, \"{NOISY}\" is the picture as it was; take another name");
            return Err(Error::Usage(message));
        }
        let denoiser = Denoiser::find().map_err(|error| match error {
            Error::Unavailable(message) => Error::Unavailable(format!("--denoise: {message}")),
            other => other,
        })?;
        Ok(Some(Denoising { denoiser, wanted: wanted.to_vec() }))
    }
}

impl Denoising {
    /// What the render must tell: what the files are to hold, and the guides.
    pub(super) fn aovs(&self) -> Vec<Aov> {
        with_guides(&self.wanted)
    }

    /// Takes the noise out of a picture, and shows that to whoever watches.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `cancel` is set; those of the library.
    pub(super) fn run(
        &self,
        pass: &mut Pass,
        cancel: &AtomicBool,
        display: Option<&Display>,
        quiet: bool,
    ) -> Result<DenoiseStats> {
        let library = self.denoiser.name();
        let bar = progress::bar(WHOLE, &library, quiet);
        let watch = |done: f64| {
            bar.set_position((done * WHOLE as f64) as u64);
            !cancel.load(Ordering::Relaxed)
        };
        let start = Instant::now();
        let picture = &mut pass.picture;
        let missing = || Error::Usage("--denoise: the render told neither albedo nor normals".to_owned());
        let guides = Guides::of_channels(&picture.channels).ok_or_else(missing)?;
        let clean = self.denoiser.denoise(&picture.image, &guides, &watch);
        bar.finish_and_clear();
        let clean = clean?;
        let seconds = start.elapsed().as_secs_f64();
        if let Some(display) = display {
            display.begin(&format!("{}, denoised", pass.engine), [clean.width, clean.height]);
            for (y, row) in (0..).zip(clean.pixels.chunks_exact(clean.width as usize)) {
                display.show(&Finished { x: 0, y, width: clean.width, pixels: row.to_vec() });
            }
        }
        let noisy = std::mem::replace(&mut picture.image, clean);
        choose_channels(&self.wanted, &mut picture.channels, &noisy);
        picture.texts.push(("twincast/denoiser".to_owned(), library.clone()));
        Ok(DenoiseStats { library, seconds })
    }
}

/// What was asked for, and the guides.
fn with_guides(wanted: &[Aov]) -> Vec<Aov> {
    let missing = GUIDES.into_iter().filter(|guide| !wanted.contains(guide));
    wanted.iter().cloned().chain(missing).collect()
}

/// Leaves out guides that nobody asked for; where anything was asked for, adds the picture as it was.
fn choose_channels(wanted: &[Aov], channels: &mut Vec<Channel>, noisy: &Image) {
    for guide in GUIDES.iter().filter(|guide| !wanted.contains(guide)) {
        let layer = format!("{guide}.");
        channels.retain(|channel| !channel.name.starts_with(&layer));
    }
    if wanted.is_empty() {
        return;
    }
    for (axis, component) in ["R", "G", "B"].into_iter().enumerate() {
        let values = noisy.pixels.iter().map(|pixel| pixel[axis]).collect();
        channels.push(Channel::float(format!("{NOISY}.{component}"), values));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec4;

    #[test]
    fn nothing_is_looked_for_where_nothing_is_to_be_denoised() {
        assert!(DenoiseArgs { denoise: false }.open(&Aov::all()).unwrap().is_none());
    }

    #[test]
    fn guides_are_told_once_and_kept_where_they_were_asked_for() {
        assert_eq!(with_guides(&[]), GUIDES);
        assert_eq!(with_guides(&[Aov::Normal, Aov::Depth]), [Aov::Normal, Aov::Depth, Aov::Albedo]);
        let names = |wanted: &[Aov]| {
            let told = ["depth.Z", "normal.X", "normal.Y", "normal.Z", "albedo.R", "albedo.G", "albedo.B"];
            let mut channels = told.map(|name| Channel::float(name, vec![0.0])).to_vec();
            let noisy = Image { width: 1, height: 1, pixels: vec![Vec4::new(1.0, 2.0, 3.0, 1.0)] };
            choose_channels(wanted, &mut channels, &noisy);
            let blue = channels.iter().find(|channel| channel.name == "noisy.B");
            assert!(blue.is_none_or(|blue| *blue == Channel::float("noisy.B", vec![3.0])));
            channels.into_iter().map(|channel| channel.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&[]), ["depth.Z"]);
        let expected = ["depth.Z", "normal.X", "normal.Y", "normal.Z", "noisy.R", "noisy.G", "noisy.B"];
        assert_eq!(names(&[Aov::Depth, Aov::Normal]), expected);
    }

    #[test]
    fn a_kind_of_light_must_leave_the_name_of_the_layer() {
        let light = "noisy=LDE".parse().unwrap();
        let refused = DenoiseArgs { denoise: true }.open(&[light]).err().unwrap();
        assert!(refused.exit_code() == 2 && refused.to_string().contains("another name"), "{refused}");
    }
}
