//! Light that was asked for, and waits for whether anything is in its way.

use crate::math::{Vec3, Vec4};
use crate::ray::Ray;
use crate::shade::SurfacePoint;
use crate::shade::light::{LightSample, LightSource};
use crate::trace::{Batch, Tracer};

use super::Renderer;
use super::aov::{Parts, Tally};
use super::wavefront::Buffers;

/// The shadow rays of a tile, and what each is for.
#[derive(Default)]
pub(super) struct Shadows {
    pub(super) rays: Vec<Ray>,
    /// To which pixel each ray brings light, and how much.
    light: Vec<(u32, Vec3)>,
    /// The same by kinds of paths; empty where light is not told apart.
    parts: Vec<Parts>,
}

/// What a light sends to a pixel by way of a surface.
pub(super) struct Sent<'a> {
    pub(super) source: &'a LightSource,
    pub(super) arriving: &'a LightSample,
    pub(super) point: &'a SurfacePoint,
    pub(super) pixel: u32,
    /// What the pixel gets if nothing is in between.
    pub(super) contribution: Vec3,
}

impl Shadows {
    pub(super) fn clear(&mut self) {
        self.rays.clear();
        self.light.clear();
        self.parts.clear();
    }

    /// Keeps it until the shadow rays are traced; what casts no shadows is there at once. `tally` is what light is told
    /// apart in, if it is, and by what parts.
    #[inline]
    pub(super) fn add(&mut self, sent: &Sent<'_>, radiance: &mut [Vec4], tally: Option<(&mut Tally, Parts)>) {
        let Sent { source, arriving, point, pixel, contribution } = *sent;
        if source.casts_shadows {
            self.rays.push(LightSource::shadow_ray(point, arriving));
            self.light.push((pixel, contribution));
            self.parts.extend(tally.map(|(_, parts)| parts));
        } else {
            radiance[pixel as usize] += contribution.extend(0.0);
            if let Some((tally, parts)) = tally {
                tally.add_parts(pixel, &parts, 1.0);
            }
        }
    }

    /// Adds what arrives: of each ray the share that nothing is in the way of.
    pub(super) fn settle(&self, free: impl Fn(usize) -> f32, radiance: &mut [Vec4], mut tally: Option<&mut Tally>) {
        for (i, &(pixel, contribution)) in self.light.iter().enumerate() {
            let share = free(i);
            if share <= 0.0 {
                continue;
            }
            radiance[pixel as usize] += (contribution * share).extend(0.0);
            // There are parts where light is told apart, and not for other channels.
            if let (Some(tally), Some(parts)) = (&mut tally, self.parts.get(i)) {
                tally.add_parts(pixel, parts, share);
            }
        }
    }
}

impl Renderer<'_> {
    /// Traces the shadow rays, and adds what those that are free contribute.
    pub(super) fn add_unshadowed<T: Tracer + ?Sized>(&self, tracer: &T, batch: Batch, buffers: &mut Buffers) {
        let Buffers { radiance, shadows, tally, occluded, trail, .. } = buffers;
        if shadows.rays.is_empty() {
            return;
        }
        let tally = tally.as_deref_mut();
        if self.plan.alpha {
            let left = self.left_through(tracer, &mut shadows.rays);
            trail.free(|i| left[i]);
            shadows.settle(|i| left[i], radiance, tally);
            return;
        }
        occluded.clear();
        occluded.resize(shadows.rays.len(), false);
        tracer.occluded_batch(&shadows.rays, occluded, batch);
        let free = |i: usize| f32::from(u8::from(!occluded[i]));
        trail.free(free);
        shadows.settle(free, radiance, tally);
    }
}
