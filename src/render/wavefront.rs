//! The samples of one tile, stage by stage: all camera rays, then all surfaces, all shadow rays, all rays that are sent
//! on, and so forth, as the integrator has it ([`whitted`](super::whitted), [`path`](super::path)).
//!
//! Taking a tile through each stage at once keeps packets full and their rays alike; following one pixel to its end
//! before the next would trace shadow rays one by one. What a pixel adds up, and in which order, does not depend on
//! its neighbours.

use std::borrow::Cow;
use std::ops::Range;

use crate::math::{DVec3, Vec3, Vec4};
use crate::plan::Lighting;
use crate::ray::{Hit, Ray};
use crate::scene::{Integrator, Material};
use crate::shade::light::LightSource;
use crate::shade::lights::Lights;
use crate::shade::{SurfacePoint, appearance, normal_map};
use crate::trace::{Batch, Tracer};

use super::aov::{Request, Route, Tally};
use super::camera::View;
use super::explain::Trail;
use super::filter::Balance;
use super::media::Media;
use super::sampler::{Bounces, Dimension, Pattern};
use super::shadows::Shadows;
use super::whitted::Lit;
use super::{Renderer, tiles::Tile};

/// Camera rays that are made at a time: enough for vectors of any width, few enough for registers and a little stack.
const LANES: usize = 16;

/// Room for one tile, used again for each sample and for the tiles that follow.
#[derive(Default)]
pub(super) struct Buffers {
    /// In the order of [`Tile::pixels`], as `sums`, `weights` and `radiance`.
    pub(super) patterns: Vec<Pattern>,
    /// As many where paths are traced; else empty.
    pub(super) bounces: Vec<Bounces>,
    /// As many where the filter is negative somewhere; else empty.
    pub(super) balances: Vec<Balance>,
    pub(super) sums: Vec<Vec4>,
    /// Of each pixel's samples so far, added up.
    pub(super) weights: Vec<f32>,
    /// What is added up beside the colours; none where nothing is asked for.
    pub(super) tally: Option<Box<Tally>>,
    pub(super) radiance: Vec<Vec4>,
    /// The rays of each depth, those of a pixel side by side; the camera's first.
    pub(super) waves: Vec<Wave>,
    pub(super) hits: Vec<Option<Hit>>,
    pub(super) lit: Vec<Lit>,
    pub(super) shadows: Shadows,
    pub(super) occluded: Vec<bool>,
    /// Laid where a pixel is to be explained.
    pub(super) trail: Trail,
}

/// Rays to trace, and what for.
#[derive(Default)]
pub(super) struct Wave {
    pub(super) rays: Vec<Ray>,
    pub(super) paths: Vec<Path>,
    /// As many where light is told apart; else empty.
    pub(super) routes: Vec<Route>,
}

impl Wave {
    pub(super) fn clear(&mut self) {
        self.rays.clear();
        self.paths.clear();
        self.routes.clear();
    }

    /// How a ray's light came from there to the eye; camera rays have none, and where light is not told apart it means
    /// nothing.
    #[inline]
    pub(super) fn route(&self, ray: usize) -> Route {
        self.routes.get(ray).copied().unwrap_or_default()
    }
}

/// What a ray contributes to.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// Index in the tile.
    pub(super) pixel: u32,
    /// Share of what the ray sees that reaches the pixel.
    pub(super) throughput: Vec3,
    /// Number of the ray in the sample's tree of rays: 0 for the camera's, 2 n + 1 and 2 n + 2 for those that n sends
    /// on.
    pub(super) branch: u32,
    /// What the ray is inside of.
    pub(super) media: Media,
    /// How densely its direction was chosen, per steradian; 0 where no other could have been.
    pub(super) pdf: f32,
    /// By how much radiance grew where it was refracted, all in all: the product of squared relative indices of
    /// refraction.
    pub(super) eta_scale: f32,
    /// How large a share of the pixel may be left out of what the ray and those that follow from it see.
    pub(super) error_budget: f32,
    /// How much of its way, from the surface that it leaves, lies before its origin.
    pub(super) spawn_offset: f32,
}

impl Path {
    /// A camera ray's.
    const CAMERA: Self = Self {
        pixel: 0,
        throughput: Vec3::ONE,
        branch: 0,
        media: Media::OUTSIDE,
        pdf: 0.0,
        eta_scale: 1.0,
        error_budget: 0.0,
        spawn_offset: 0.0,
    };
}

impl Renderer<'_> {
    /// The pixels of a tile, in the order of [`Tile::pixels`].
    pub(super) fn tile<'b, T: Tracer + ?Sized>(&self, tracer: &T, tile: &Tile, buffers: &'b mut Buffers) -> &'b [Vec4] {
        self.begin(tile.pixels(), buffers);
        buffers.sums.clear();
        buffers.sums.resize(tile.len(), Vec4::ZERO);
        buffers.weights.clear();
        buffers.weights.resize(tile.len(), 0.0);
        self.add_samples(tracer, 0..self.settings.spp, None, buffers);
        for (sum, total) in buffers.sums.iter_mut().zip(&buffers.weights) {
            // Divided, not multiplied by the reciprocal: full coverage is 1 for any number of samples. By 1 where the
            // weights cancel out.
            *sum /= total.max(1.0);
        }
        &buffers.sums
    }

    /// Adds samples of the pixels that were begun to their sums; and what is asked for beside.
    pub(super) fn add_samples<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        samples: Range<u32>,
        request: Option<&Request>,
        buffers: &mut Buffers,
    ) {
        for sample in samples {
            buffers.trail.begin(sample);
            self.camera_hits(tracer, sample, buffers);
            buffers.radiance.clear();
            buffers.radiance.resize(buffers.patterns.len(), Vec4::ZERO);
            if let Some(request) = request {
                self.observe(request, sample, buffers);
            }
            match self.plan.integrator {
                Integrator::RayCast | Integrator::Whitted => self.whitted(tracer, sample, buffers),
                Integrator::Path => self.paths(tracer, sample, buffers),
            }
            let Buffers { patterns, balances, sums, weights, radiance, tally, trail, .. } = &mut *buffers;
            trail.end(radiance[0]);
            let weight = |i: usize| self.weight(balances, &patterns[i], i, sample);
            for (i, ((sum, total), radiance)) in sums.iter_mut().zip(weights).zip(radiance).enumerate() {
                let weight = weight(i);
                *sum += *radiance * weight;
                *total += weight;
            }
            if let Some(tally) = tally.as_deref_mut().filter(|tally| tally.follows()) {
                (0..patterns.len()).for_each(|i| tally.close(i, weight(i)));
            }
        }
    }

    /// What a sample of the `i`th pixel counts.
    #[inline]
    pub(super) fn weight(&self, balances: &[Balance], pixel: &Pattern, i: usize, sample: u32) -> f32 {
        balances.get(i).map_or(1.0, |balance| balance.of(self.place(pixel, sample).1))
    }

    /// How many camera rays of a tile hit something.
    pub(super) fn tile_hits<T: Tracer + ?Sized>(&self, tracer: &T, tile: &Tile, buffers: &mut Buffers) -> u64 {
        self.begin(tile.pixels(), buffers);
        let hits = (0..self.settings.spp).map(|sample| {
            self.camera_hits(tracer, sample, buffers);
            buffers.hits.iter().flatten().count() as u64
        });
        hits.sum()
    }

    /// What all samples of a pixel have in common, for each pixel.
    pub(super) fn begin(&self, pixels: impl Iterator<Item = (u32, u32)>, buffers: &mut Buffers) {
        buffers.patterns.clear();
        buffers.patterns.extend(pixels.map(|(x, y)| self.sampler.pattern(x, y)));
        buffers.balances.clear();
        if self.filter.has_negative() {
            buffers.balances.extend(buffers.patterns.iter().map(|pixel| self.balance(pixel)));
        }
        buffers.bounces.clear();
        if self.plan.integrator == Integrator::Path {
            buffers.bounces.extend(buffers.patterns.iter().map(|pixel| self.sampler.bounces(pixel)));
        }
    }

    /// One sample of each pixel: its camera ray, and what that hits.
    fn camera_hits<T: Tracer + ?Sized>(&self, tracer: &T, sample: u32, buffers: &mut Buffers) {
        let Buffers { patterns, waves, hits, .. } = buffers;
        waves.resize_with(waves.len().max(1), Wave::default);
        let Wave { rays, paths, .. } = &mut waves[0];
        let place = |pixel: &Pattern| self.place(pixel, sample).0;
        // Neither is cleared: every one is written.
        rays.resize(patterns.len(), Ray::new(Vec3::ZERO, Vec3::ZERO));
        hits.resize(patterns.len(), None);
        // Camera paths differ in their pixel alone, and nobody changes them: those of the last sample stay.
        let known = paths.len();
        paths.resize(patterns.len(), Path { error_budget: self.plan.faint, ..Path::CAMERA });
        paths.iter_mut().zip(0..).skip(known).for_each(|(path, pixel)| path.pixel = pixel);
        let (groups, rest) = match &self.view {
            View::Pinhole(pinhole) => {
                let (groups, rest) = patterns.as_chunks::<LANES>();
                for (group, rays) in groups.iter().zip(rays.as_chunks_mut::<LANES>().0) {
                    *rays = pinhole.rays(&group.each_ref().map(place));
                }
                (groups.len(), rest)
            }
            View::General(_) => (0, &patterns[..]),
        };
        for (pixel, ray) in rest.iter().zip(&mut rays[groups * LANES..]) {
            *ray = self.ray(pixel, sample);
        }
        if self.plan.motion {
            for (pixel, ray) in patterns.iter().zip(&mut rays[..groups * LANES]) {
                ray.time = self.time(pixel, sample);
            }
        }
        let xi = |i: usize| self.sampler.pair(&patterns[i], sample, Dimension::alpha(0));
        self.closest(tracer, rays, hits, self.settings.batch, xi);
    }

    /// What a ray sees that hits nothing, and how much it covers; the background hides an environment from camera rays.
    pub(super) fn behind(&self, direction: Vec3, is_camera: bool) -> Vec4 {
        let coverage = if is_camera { 1.0 } else { 0.0 };
        match (&self.environment, self.plan.background) {
            (Some(_), Some(color)) if is_camera => color.extend(coverage),
            (Some(environment), _) => environment.radiance(direction.as_dvec3()).extend(coverage),
            (None, Some(color)) => color.extend(coverage),
            // Fog is opaque.
            (None, None) => Vec3::ZERO.extend(if self.plan.fog.is_some() { coverage } else { 0.0 }),
        }
    }

    /// What is where a ray hit.
    pub(super) fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let mut point = SurfacePoint::new(self.scene, self.world, ray, hit, self.plan.attributes);
        if self.plan.normal_maps {
            let material = self.material(&point);
            normal_map::bend(&mut point, self.scene, self.world, hit, material);
        }
        point
    }

    /// What the surface at `point` is there, by all its textures.
    pub(super) fn appearance(&self, point: &SurfacePoint) -> Cow<'_, Material> {
        appearance::at(self.material(point), point, &self.scene.textures)
    }

    pub(super) fn material(&self, point: &SurfacePoint) -> &Material {
        self.scene.materials.get(point.material as usize).unwrap_or(&self.fallback)
    }

    /// How rays are traced that neither start nor point alike.
    pub(super) fn incoherent(&self) -> Batch {
        Batch { coherent: false, ..self.settings.batch }
    }

    /// The planned lights in world coordinates.
    pub(super) fn plan_lights(&self, eye: DVec3) -> Lights {
        let mut sources = match &self.plan.lighting {
            Lighting::None => Vec::new(),
            Lighting::Headlight => vec![LightSource::headlight(eye)],
            Lighting::Lights(lights) => {
                lights.iter().map(|&i| LightSource::new(&self.scene.lights[i], self.world.centre)).collect()
            }
        };
        let environment = self.environment.as_ref().filter(|_| self.plan.lighting != Lighting::None);
        match self.plan.integrator {
            Integrator::RayCast | Integrator::Whitted => {
                sources.extend(environment.cloned().map(LightSource::environment));
                Lights::all(sources)
            }
            Integrator::Path => Lights::chosen(self.scene, self.world, sources, environment),
        }
    }
}
