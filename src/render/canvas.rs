//! Every pixel of a picture that is taken in rounds, as far as it is.
//!
//! What is added up is kept undivided: a render that goes on adds its samples to the very sums where it left off, so
//! that neither the rounds nor an interruption change a bit.

use super::Crop;
use super::adaptive::Estimate;
use super::aov::{Coverage, Request};
use super::film::too_large;
use super::finished::Finished;
use super::tiles::Tile;
use super::wavefront::Buffers;
use crate::error::Result;
use crate::image::{Channel, Image};
use crate::math::Vec4;

/// Sums of every pixel, row by row.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Canvas {
    /// The part of the picture that it is.
    pub(super) window: Crop,
    pub(super) sums: Vec<Vec4>,
    pub(super) weights: Vec<f32>,
    /// Samples so far.
    pub(super) counts: Vec<u32>,
    /// Whether it gets more of them.
    pub(super) active: Vec<bool>,
    /// Of the first samples, as [`Estimate::first`] has it; empty where the error need not be known.
    pub(super) firsts: Vec<Vec4>,
    /// What is told beside the colours, of each pixel as many as [`Request::stride`].
    pub(super) beside: Vec<f32>,
    pub(super) objects: Vec<Coverage>,
    pub(super) materials: Vec<Coverage>,
}

impl Canvas {
    /// Without any sample.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory) where it does not fit into memory.
    pub(super) fn new(window: Crop, with_firsts: bool, request: Option<&Request>) -> Result<Self> {
        let (pixels, Crop { width, height, .. }) = (window.len(), window);
        let mattes = request.and_then(|request| request.mattes.as_deref());
        let only = |wanted: bool| if wanted { pixels } else { 0 };
        Ok(Self {
            window,
            sums: zeros(width, height, pixels)?,
            weights: zeros(width, height, pixels)?,
            counts: zeros(width, height, pixels)?,
            active: filled(true, width, height, pixels)?,
            firsts: zeros(width, height, only(with_firsts))?,
            beside: zeros(width, height, pixels.saturating_mul(request.map_or(0, |request| request.stride)))?,
            objects: zeros(width, height, only(mattes.is_some_and(|mattes| mattes.has_objects)))?,
            materials: zeros(width, height, only(mattes.is_some_and(|mattes| mattes.has_materials)))?,
        })
    }

    fn index(&self, pixel: (u32, u32)) -> usize {
        self.window.index(pixel)
    }

    /// The pixels of a tile that have so many samples and are to get more, in the order of [`Tile::pixels`].
    pub(super) fn waiting(&self, tile: &Tile, count: u32) -> Vec<(u32, u32)> {
        let waits = |&pixel: &(u32, u32)| self.active[self.index(pixel)] && self.counts[self.index(pixel)] == count;
        tile.pixels().filter(waits).collect()
    }

    /// Gives a tile what is known of the pixels that it goes on with.
    pub(super) fn load(&self, pixels: &[(u32, u32)], request: Option<&Request>, buffers: &mut Buffers) {
        buffers.sums.clear();
        buffers.weights.clear();
        if let (Some(request), Some(tally)) = (request, &mut buffers.tally) {
            tally.begin(request, pixels.len());
        }
        for (k, &pixel) in pixels.iter().enumerate() {
            let i = self.index(pixel);
            buffers.sums.push(self.sums[i]);
            buffers.weights.push(self.weights[i]);
            let (Some(request), Some(tally)) = (request, &mut buffers.tally) else { continue };
            let stride = request.stride;
            tally.sums[k * stride..(k + 1) * stride].copy_from_slice(&self.beside[i * stride..(i + 1) * stride]);
            for (own, all) in [(&mut tally.objects, &self.objects), (&mut tally.materials, &self.materials)] {
                if let Some(coverage) = all.get(i) {
                    own[k].clone_from(coverage);
                }
            }
        }
    }

    /// Takes back what a tile has added to pixels, which now have `count` samples and took `seconds` each.
    pub(super) fn store(
        &mut self,
        pixels: &[(u32, u32)],
        count: u32,
        seconds: f32,
        request: Option<&Request>,
        buffers: &mut Buffers,
    ) {
        for (k, &pixel) in pixels.iter().enumerate() {
            let i = self.index(pixel);
            if let Some(first) = self.firsts.get_mut(i)
                && self.counts[i].is_power_of_two()
            {
                *first = self.sums[i];
            }
            self.sums[i] = buffers.sums[k];
            self.weights[i] = buffers.weights[k];
            self.counts[i] = count;
            let (Some(request), Some(tally)) = (request, &mut buffers.tally) else { continue };
            let stride = request.stride;
            let beside = &mut self.beside[i * stride..(i + 1) * stride];
            beside.copy_from_slice(&tally.sums[k * stride..(k + 1) * stride]);
            if let Some(at) = request.time {
                beside[at] += seconds;
            }
            for (own, all) in [(&mut tally.objects, &mut self.objects), (&mut tally.materials, &mut self.materials)] {
                if let Some(coverage) = all.get_mut(i) {
                    std::mem::swap(coverage, &mut own[k]);
                }
            }
        }
    }

    /// What tells the error of a pixel.
    pub(super) fn estimate(&self, i: usize) -> Estimate {
        Estimate { sum: self.sums[i], first: self.firsts[i], weight: self.weights[i], count: self.counts[i] }
    }

    /// All samples so far.
    pub(super) fn samples(&self) -> u64 {
        self.counts.iter().map(|&count| u64::from(count)).sum()
    }

    /// The picture as far as it is.
    pub(super) fn image(&self) -> Image {
        let pixels = (0..self.sums.len()).map(|i| self.pixel(i));
        Image { width: self.window.width, height: self.window.height, pixels: pixels.collect() }
    }

    /// As a tile divides: by 1 where the weights cancel out.
    fn pixel(&self, i: usize) -> Vec4 {
        self.sums[i] / self.weights[i].max(1.0)
    }

    /// A tile of the picture as far as it is.
    pub(super) fn finished(&self, tile: &Tile) -> Finished {
        let pixels: Vec<_> = tile.pixels().map(|at| self.pixel(self.index(at))).collect();
        Finished::new(&tile.within(&self.window), &pixels)
    }

    /// What was averaged beside it, as far as it was asked for.
    pub(super) fn channels(&self, request: &Request) -> Vec<Channel> {
        request.averages(&self.beside, &self.weights)
    }
}

fn zeros<T: Clone + Default>(width: u32, height: u32, count: usize) -> Result<Vec<T>> {
    filled(T::default(), width, height, count)
}

fn filled<T: Clone>(value: T, width: u32, height: u32, count: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| too_large(width, height))?;
    values.resize(count, value);
    Ok(values)
}
