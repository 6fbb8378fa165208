//! The samples of one tile, stage by stage: all camera rays, all surfaces, then light by light all shadow rays.
//!
//! Taking a tile through each stage at once keeps packets full and their rays alike; following one pixel to its end
//! before the next would trace shadow rays one by one. What a pixel adds up, and in which order, does not depend on
//! its neighbours: camera ray by sample, then lights in the scene's order.

use crate::math::{DVec3, Vec3, Vec4};
use crate::ray::{Hit, Ray};
use crate::shade::SurfacePoint;
use crate::shade::light::LightSource;
use crate::shade::phong::Shading;
use crate::trace::Tracer;

use super::sampler::Pattern;
use super::{Renderer, tiles::Tile};

/// Camera rays that are made at a time: enough for vectors of any width, few enough for registers and a little stack.
const LANES: usize = 16;

/// Room for one tile, used again for each sample and for the tiles that follow.
#[derive(Default)]
pub(super) struct Buffers {
    /// In the order of [`Tile::pixels`], as all others.
    patterns: Vec<Pattern>,
    sums: Vec<Vec4>,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    radiance: Vec<Vec4>,
    lit: Vec<Lit>,
    shadow_rays: Vec<Ray>,
    shadow_light: Vec<(usize, Vec3)>,
    occluded: Vec<bool>,
}

/// A camera ray that hit something.
struct Lit {
    /// Index of the ray in its tile.
    ray: usize,
    point: SurfacePoint,
    shading: Shading,
}

impl Renderer<'_> {
    /// The pixels of a tile, in the order of [`Tile::pixels`].
    pub(super) fn tile<'b, T: Tracer>(&self, tracer: &T, tile: &Tile, buffers: &'b mut Buffers) -> &'b [Vec4] {
        self.begin(tile, buffers);
        buffers.sums.clear();
        buffers.sums.resize(tile.len(), Vec4::ZERO);
        for sample in 0..self.settings.spp {
            self.camera_hits(tracer, sample, buffers);
            self.radiance(tracer, buffers);
            for (sum, radiance) in buffers.sums.iter_mut().zip(&buffers.radiance) {
                *sum += *radiance;
            }
        }
        // Divided, not multiplied by the reciprocal: full coverage is 1 for any number of samples.
        buffers.sums.iter_mut().for_each(|sum| *sum /= self.settings.spp as f32);
        &buffers.sums
    }

    /// How many camera rays of a tile hit something.
    pub(super) fn tile_hits<T: Tracer + ?Sized>(&self, tracer: &T, tile: &Tile, buffers: &mut Buffers) -> u64 {
        self.begin(tile, buffers);
        let hits = (0..self.settings.spp).map(|sample| {
            self.camera_hits(tracer, sample, buffers);
            buffers.hits.iter().flatten().count() as u64
        });
        hits.sum()
    }

    /// What all samples of a pixel have in common, for each pixel of a tile.
    fn begin(&self, tile: &Tile, buffers: &mut Buffers) {
        buffers.patterns.clear();
        buffers.patterns.extend(tile.pixels().map(|(x, y)| self.sampler.pattern(x, y)));
    }

    /// One sample of each pixel: its camera ray, and what that hits.
    fn camera_hits<T: Tracer + ?Sized>(&self, tracer: &T, sample: u32, buffers: &mut Buffers) {
        let Buffers { patterns, rays, hits, .. } = buffers;
        let place = |pixel: &Pattern| self.sampler.place(pixel, sample);
        // Neither is cleared: every one of them is written.
        rays.resize(patterns.len(), Ray::new(Vec3::ZERO, Vec3::ZERO));
        hits.resize(patterns.len(), None);
        let (groups, rest) = patterns.as_chunks::<LANES>();
        let (ray_groups, ray_rest) = rays.as_chunks_mut::<LANES>();
        for (group, rays) in groups.iter().zip(ray_groups) {
            *rays = self.pinhole.rays(&group.each_ref().map(place));
        }
        for (pixel, ray) in rest.iter().zip(ray_rest) {
            *ray = self.pinhole.ray(place(pixel));
        }
        tracer.closest_batch(rays, hits, self.settings.batch);
    }

    /// What each camera ray sees, into `radiance`: linear RGB and coverage.
    fn radiance<T: Tracer>(&self, tracer: &T, buffers: &mut Buffers) {
        let Buffers { rays, hits, radiance, lit, .. } = buffers;
        let behind = self.plan.background.map_or(Vec4::ZERO, |color| color.extend(1.0));
        radiance.clear();
        lit.clear();
        for (i, (ray, hit)) in rays.iter().zip(hits).enumerate() {
            let Some(hit) = hit else {
                radiance.push(behind);
                continue;
            };
            let point = SurfacePoint::new(self.scene, self.world, ray, hit, self.plan.attributes);
            let material = self.scene.materials.get(point.material as usize).unwrap_or(&self.fallback);
            let shading = Shading::new(&point, ray.direction, material, &self.scene.textures, self.ambient);
            radiance.push(shading.base.extend(1.0));
            lit.push(Lit { ray: i, point, shading });
        }
        for light in &self.lights {
            self.add_light(tracer, light, buffers);
        }
    }

    fn add_light<T: Tracer>(&self, tracer: &T, light: &LightSource, buffers: &mut Buffers) {
        let Buffers { radiance, lit, shadow_rays, shadow_light, occluded, .. } = buffers;
        shadow_rays.clear();
        shadow_light.clear();
        for Lit { ray, point, shading } in lit.iter() {
            let Some(arriving) = light.illuminate(point.position) else { continue };
            if !shading.faces(arriving.to_light) {
                continue;
            }
            let reflected = shading.reflect(&arriving);
            if light.casts_shadows {
                shadow_rays.push(light.shadow_ray(point, arriving.to_light));
                shadow_light.push((*ray, reflected));
            } else {
                radiance[*ray] += reflected.extend(0.0);
            }
        }
        if shadow_rays.is_empty() {
            return;
        }
        occluded.clear();
        occluded.resize(shadow_rays.len(), false);
        tracer.occluded_batch(shadow_rays, occluded, self.settings.batch);
        for ((ray, reflected), _) in shadow_light.iter().zip(occluded).filter(|(_, occluded)| !**occluded) {
            radiance[*ray] += reflected.extend(0.0);
        }
    }

    /// The planned lights in world coordinates.
    pub(super) fn light_sources(&self, eye: DVec3) -> Vec<LightSource> {
        use crate::plan::Lighting;
        match &self.plan.lighting {
            Lighting::None => Vec::new(),
            Lighting::Headlight => vec![LightSource::headlight(eye)],
            Lighting::Lights(lights) => {
                lights.iter().map(|&i| LightSource::new(&self.scene.lights[i], self.world.centre)).collect()
            }
        }
    }
}
