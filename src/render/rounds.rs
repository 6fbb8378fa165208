//! Pictures that are taken in rounds: with what stands beside the colours, to a noise threshold, or with checkpoints.
//!
//! Between rounds all pixels are at rest, and it is decided which of them go on. Within one, each tile adds its samples
//! to what is known of its pixels. A plain render has none of this: each tile is finished at once, and what a picture
//! holds is its pixels alone.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;

use super::adaptive;
use super::canvas::Canvas;
use super::checkpoint::{Checkpoint, Keeper};
use super::{Control, Renderer};
use crate::error::{Error, Result};
use crate::image::{Channel, Image};
use crate::trace::Tracer;

/// Samples of a round where nothing but checkpoints asks for rounds.
const ROUND: u32 = 16;

/// A picture with all that was asked for.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The colours.
    pub image: Image,
    /// What stands beside them: see [`Settings::aovs`](super::Settings::aovs).
    pub channels: Vec<Channel>,
    /// What a file says of the channels: entries of [`Metadata::texts`](crate::image::Metadata::texts).
    pub texts: Vec<(String, String)>,
    /// Samples of all pixels.
    pub samples: u64,
    /// Camera rays that were traced for it; after an interruption, since then.
    pub camera_rays: u64,
}

/// What threads share.
struct Shared<'k> {
    canvas: Canvas,
    keeper: Option<Keeper<'k>>,
    /// Samples that were added, and pixels that this is counted as for whoever watches.
    added: u64,
    reported: u64,
    /// What went wrong with a checkpoint.
    error: Option<Error>,
}

impl Renderer<'_> {
    /// Renders the whole picture with all that was asked for, on rayon's current thread pool.
    ///
    /// # Errors
    /// As of [`Renderer::render`]; and those of [`Checkpoint`].
    pub fn picture<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        control: Control<'_>,
        checkpoint: Option<&Checkpoint<'_>>,
    ) -> Result<Picture> {
        let pixels = self.window().len() as u64;
        if self.request.is_none() && self.settings.adaptive.is_none() && checkpoint.is_none() {
            let image = self.render(tracer, control)?;
            let samples = pixels * u64::from(self.settings.spp);
            return Ok(Picture { image, channels: Vec::new(), texts: Vec::new(), samples, camera_rays: samples });
        }
        // First, so that nothing is lost that took long.
        let mut channels =
            self.request.as_ref().map(|request| self.geometry(tracer, request, control)).unwrap_or_default();
        let middle_rays = if channels.is_empty() { 0 } else { pixels };
        let (canvas, added) = self.rounds(tracer, control, checkpoint)?;
        let (image, samples) = (canvas.image(), canvas.samples());
        let mut texts = Vec::new();
        if let Some(request) = &self.request {
            channels.extend(canvas.channels(request));
            if let Some(mattes) = &request.mattes {
                let (layers, entries) = mattes.layers(self.scene, &canvas.objects, &canvas.materials, &canvas.weights);
                channels.extend(layers);
                texts = entries;
            }
            if request.wants(&super::Aov::Samples) {
                channels.push(Channel::uint("samples", canvas.counts));
            }
        }
        Ok(Picture { image, channels, texts, samples, camera_rays: added + middle_rays })
    }

    /// Takes all rounds. The samples that were added are those of this run.
    pub(super) fn rounds<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        control: Control<'_>,
        checkpoint: Option<&Checkpoint<'_>>,
    ) -> Result<(Canvas, u64)> {
        let adaptive = self.settings.adaptive;
        let canvas = Canvas::new(self.window(), adaptive.is_some(), self.request.as_ref())?;
        let (canvas, mut done, keeper) = match checkpoint {
            None => (canvas, 0, None),
            Some(checkpoint) => self.open_checkpoint(checkpoint, canvas)?,
        };
        let shared = Mutex::new(Shared { canvas, keeper, added: 0, reported: 0, error: None });
        loop {
            let next = self.next_round(done, checkpoint.is_some());
            self.round(tracer, control, done..next, &shared);
            let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            let Shared { canvas, keeper, error, .. } = &mut *shared;
            if let Some(error) = error.take() {
                return Err(error);
            }
            if control.is_cancelled() {
                if let Some(keeper) = keeper {
                    keeper.write(canvas, done)?;
                }
                return Err(Error::Interrupted);
            }
            done = next;
            if done == self.most_samples() || !self.some_need_more(canvas, done) {
                break;
            }
        }
        let Shared { canvas, added, reported, .. } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(on_tile) = control.on_tile {
            on_tile((self.window().len() as u64).saturating_sub(reported));
        }
        Ok((canvas, added))
    }

    /// Samples that no pixel exceeds.
    pub(super) fn most_samples(&self) -> u32 {
        self.settings.adaptive.map_or(self.settings.spp, |adaptive| adaptive.max_spp)
    }

    /// How many samples active pixels have after the round that they enter with `done`.
    pub(super) fn next_round(&self, done: u32, keeps: bool) -> u32 {
        match self.settings.adaptive {
            Some(adaptive) => adaptive.next(done),
            None if keeps => self.settings.spp.min(done + ROUND),
            None => self.settings.spp,
        }
    }

    /// Decides which pixels go on that have `done` samples; whether any does.
    fn some_need_more(&self, canvas: &mut Canvas, done: u32) -> bool {
        let Some(adaptive) = self.settings.adaptive.filter(|adaptive| adaptive.judges(done, self.settings.spp)) else {
            return true;
        };
        let estimate = |i: usize| canvas.estimate(i);
        let deviations = adaptive::deviations(canvas.window.width as usize, canvas.sums.len(), estimate);
        let rate = adaptive.rate(self.settings.spp, &deviations);
        let counts = &canvas.counts;
        canvas.active.par_iter_mut().enumerate().for_each(|(i, active)| {
            *active = *active && counts[i] == done && f64::from(deviations[i]) * rate > f64::from(done);
        });
        canvas.active.contains(&true)
    }

    /// Adds samples to all active pixels that wait for them.
    fn round<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        control: Control<'_>,
        samples: std::ops::Range<u32>,
        shared: &Mutex<Shared<'_>>,
    ) {
        let request = self.request.as_ref();
        let lock = || shared.lock().unwrap_or_else(PoisonError::into_inner);
        self.each_tile(|tile, buffers| {
            if control.is_cancelled() {
                return ControlFlow::Break(());
            }
            if request.is_some() {
                buffers.tally.get_or_insert_default();
            }
            let pixels = {
                let Shared { canvas, error, .. } = &*lock();
                if error.is_some() {
                    return ControlFlow::Break(());
                }
                let pixels = canvas.waiting(tile, samples.start);
                canvas.load(&pixels, request, buffers);
                pixels
            };
            if pixels.is_empty() {
                return ControlFlow::Continue(());
            }
            let start = Instant::now();
            self.begin(pixels.iter().copied(), buffers);
            self.add_samples(tracer, samples.clone(), request, buffers);
            let seconds = start.elapsed().as_secs_f32() / pixels.len() as f32;

            let mut shared = lock();
            let Shared { canvas, keeper, added, reported, error } = &mut *shared;
            canvas.store(&pixels, samples.end, seconds, request, buffers);
            if let Some(keeper) = keeper
                && let Err(failed) = keeper.write_if_due(canvas, samples.start)
            {
                *error = Some(failed);
            }
            *added += pixels.len() as u64 * u64::from(samples.end - samples.start);
            let share = *added / u64::from(self.most_samples());
            if let Some(on_tile) = control.on_tile {
                on_tile(share - *reported);
            }
            *reported = share;
            if let Some(on_pixels) = control.on_pixels {
                on_pixels(canvas.finished(tile));
            }
            ControlFlow::Continue(())
        });
    }
}
