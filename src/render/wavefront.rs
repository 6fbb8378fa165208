//! The samples of one tile, stage by stage: all camera rays, all surfaces, light by light all shadow rays, then all rays
//! that mirrors and glass send on, and so forth.
//!
//! Taking a tile through each stage at once keeps packets full and their rays alike; following one pixel to its end
//! before the next would trace shadow rays one by one. What a pixel adds up, and in which order, does not depend on
//! its neighbours: camera ray by sample, then lights in the scene's order, then the rays sent on, depth by depth.
//!
//! Every ray may send on two, so that their number may double with each depth. They are followed in batches: breadth
//! first within a batch, so that packets stay full; one batch to its end before the next, so that memory grows with
//! the depth and not with the number of rays. A pixel's rays are divided by their own count alone, never by what its
//! neighbours add to the batch.

use std::ops::Range;

use crate::math::{DVec2, DVec3, Vec3, Vec4};
use crate::ray::{Hit, Ray};
use crate::scene::Material;
use crate::shade::light::LightSource;
use crate::shade::phong::Shading;
use crate::shade::{SurfacePoint, whitted};
use crate::trace::{Batch, Tracer};

use super::camera::View;
use super::sampler::{Dimension, Pattern};
use super::{Renderer, tiles::Tile};

/// Camera rays that are made at a time: enough for vectors of any width, few enough for registers and a little stack.
const LANES: usize = 16;

/// Most rays that are followed at once below the camera's.
const BATCH: usize = 4096;

/// A share of the picture, in each channel, that is not worth a ray: far below what 8 bits show.
const FAINT: f32 = 1e-4;

/// Room for one tile, used again for each sample and for the tiles that follow.
#[derive(Default)]
pub(super) struct Buffers {
    /// In the order of [`Tile::pixels`], as `sums`, `weights` and `radiance`.
    patterns: Vec<Pattern>,
    sums: Vec<Vec4>,
    /// Of each pixel's samples so far, added up.
    weights: Vec<f32>,
    radiance: Vec<Vec4>,
    /// The rays of each depth, those of a pixel side by side; the camera's first.
    waves: Vec<Wave>,
    hits: Vec<Option<Hit>>,
    lit: Vec<Lit>,
    shadow_rays: Vec<Ray>,
    shadow_light: Vec<(u32, Vec3)>,
    occluded: Vec<bool>,
}

/// Rays to trace, and what for.
#[derive(Default)]
struct Wave {
    rays: Vec<Ray>,
    paths: Vec<Path>,
}

/// What a ray contributes to.
#[derive(Clone, Copy)]
struct Path {
    /// Index in the tile.
    pixel: u32,
    /// Share of what the ray sees that reaches the pixel.
    weight: Vec3,
    /// Number of the ray in the sample's tree of rays: 0 for the camera's, 2 n + 1 and 2 n + 2 for those that n sends on.
    branch: u32,
}

/// Which rays are followed.
#[derive(Clone, Copy)]
struct Stage {
    /// Of each pixel's samples.
    sample: u32,
    /// How often they were sent on.
    depth: u32,
}

/// A ray that hit something.
struct Lit {
    path: Path,
    direction: Vec3,
    point: SurfacePoint,
    shading: Shading,
}

impl Renderer<'_> {
    /// The pixels of a tile, in the order of [`Tile::pixels`].
    pub(super) fn tile<'b, T: Tracer>(&self, tracer: &T, tile: &Tile, buffers: &'b mut Buffers) -> &'b [Vec4] {
        self.begin(tile, buffers);
        buffers.sums.clear();
        buffers.sums.resize(tile.len(), Vec4::ZERO);
        buffers.weights.clear();
        buffers.weights.resize(tile.len(), 0.0);
        for sample in 0..self.settings.spp {
            self.camera_hits(tracer, sample, buffers);
            buffers.radiance.clear();
            buffers.radiance.resize(tile.len(), Vec4::ZERO);
            self.radiance(tracer, Stage { sample, depth: 0 }, 0, buffers);
            let Buffers { patterns, sums, weights, radiance, .. } = &mut *buffers;
            for (((sum, total), radiance), pixel) in sums.iter_mut().zip(weights).zip(radiance).zip(patterns) {
                let weight = if self.filter.has_negative() { self.place(pixel, sample).1 } else { 1.0 };
                *sum += *radiance * weight;
                *total += weight;
            }
        }
        for (sum, total) in buffers.sums.iter_mut().zip(&buffers.weights) {
            // Divided, not multiplied by the reciprocal: full coverage is 1 for any number of samples. By 1 where the
            // weights cancel out.
            *sum /= total.max(1.0);
        }
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
        let Buffers { patterns, waves, hits, .. } = buffers;
        waves.resize_with(waves.len().max(1), Wave::default);
        let Wave { rays, paths } = &mut waves[0];
        let place = |pixel: &Pattern| self.place(pixel, sample).0;
        // None of them is cleared: every one is written.
        rays.resize(patterns.len(), Ray::new(Vec3::ZERO, Vec3::ZERO));
        hits.resize(patterns.len(), None);
        let known = paths.len();
        paths.resize(patterns.len(), Path { pixel: 0, weight: Vec3::ONE, branch: 0 });
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
        tracer.closest_batch(rays, hits, self.settings.batch);
    }

    /// Adds what the rays that `buffers.hits` belongs to see, those of `waves[depth]` from `first` on, and follows what is
    /// sent on from there.
    fn radiance<T: Tracer>(&self, tracer: &T, stage: Stage, first: usize, buffers: &mut Buffers) {
        let Stage { sample, depth } = stage;
        self.shade(depth, first, buffers);
        let batch = if depth == 0 { self.settings.batch } else { self.incoherent() };
        for light in 0..self.lights.len() {
            self.add_light(tracer, light, sample, batch, buffers);
        }
        if depth == self.plan.depth {
            return;
        }
        self.send_on(depth, buffers);
        let mut begin = 0;
        while let Some(range) = buffers.waves[depth as usize + 1].batch(begin) {
            begin = range.end;
            let Buffers { waves, hits, .. } = buffers;
            let rays = &waves[depth as usize + 1].rays[range.clone()];
            hits.clear();
            hits.resize(rays.len(), None);
            tracer.closest_batch(rays, hits, self.incoherent());
            self.radiance(tracer, Stage { sample, depth: depth + 1 }, range.start, buffers);
        }
    }

    /// What surfaces are where the rays hit, with what they give off without any light.
    fn shade(&self, depth: u32, first: usize, buffers: &mut Buffers) {
        let Buffers { waves, hits, radiance, lit, .. } = buffers;
        let Wave { rays, paths } = &waves[depth as usize];
        let coverage = if depth == 0 { 1.0 } else { 0.0 };
        let behind = self.plan.background.map_or(Vec4::ZERO, |color| color.extend(coverage));
        lit.clear();
        for ((ray, &path), hit) in rays[first..].iter().zip(&paths[first..]).zip(hits) {
            let pixel = &mut radiance[path.pixel as usize];
            let Some(hit) = hit else {
                *pixel += path.weight.extend(1.0) * behind;
                continue;
            };
            let point = SurfacePoint::new(self.scene, self.world, ray, hit, self.plan.attributes);
            let material = self.material(&point);
            let shading = Shading::new(&point, ray.direction, material, &self.scene.textures, self.ambient);
            *pixel += (path.weight * shading.base).extend(coverage);
            lit.push(Lit { path, direction: ray.direction, point, shading });
        }
    }

    /// The mirrored and refracted rays of all surfaces that were hit at `depth`, into the wave below.
    fn send_on(&self, depth: u32, buffers: &mut Buffers) {
        let Buffers { waves, lit, .. } = buffers;
        let below = depth as usize + 1;
        waves.resize_with(waves.len().max(below + 1), Wave::default);
        let wave = &mut waves[below];
        wave.rays.clear();
        wave.paths.clear();
        for Lit { path, direction, point, .. } in lit {
            let material = self.material(point);
            let mut send = |which: u32, share: Vec3, direction: &dyn Fn() -> Option<DVec3>| {
                let weight = path.weight * share;
                if weight.max_element() <= FAINT {
                    return;
                }
                if let Some(direction) = direction() {
                    wave.rays.push(point.spawn(direction.as_vec3(), f32::INFINITY));
                    let branch = path.branch.wrapping_mul(2).wrapping_add(which);
                    wave.paths.push(Path { weight, branch, ..*path });
                }
            };
            let direction = direction.as_dvec3().normalize();
            send(1, material.reflection, &|| Some(whitted::reflected(direction, point)));
            send(2, material.transmission, &|| whitted::refracted(direction, point, f64::from(material.ior)));
        }
    }

    /// Adds what of a light reaches what was hit.
    fn add_light<T: Tracer>(&self, tracer: &T, light: usize, sample: u32, batch: Batch, buffers: &mut Buffers) {
        let Buffers { patterns, radiance, lit, shadow_rays, shadow_light, occluded, .. } = buffers;
        let (index, light) = (light as u32, &self.lights[light]);
        let count = if light.is_extended() { self.settings.light_samples } else { 1 };
        shadow_rays.clear();
        shadow_light.clear();
        for Lit { path, point, shading, .. } in lit.iter() {
            let weight = if count == 1 { path.weight } else { path.weight / count as f32 };
            for k in 0..count {
                let even = if light.is_extended() {
                    let dimension = Dimension::light(index, path.branch);
                    self.light_sampler.pair(&patterns[path.pixel as usize], sample * count + k, dimension)
                } else {
                    DVec2::ZERO
                };
                let Some(arriving) = light.illuminate(point.position, even) else { continue };
                if !shading.faces(arriving.to_light) {
                    continue;
                }
                let reflected = weight * shading.reflect(&arriving);
                if light.casts_shadows {
                    shadow_rays.push(LightSource::shadow_ray(point, &arriving));
                    shadow_light.push((path.pixel, reflected));
                } else {
                    radiance[path.pixel as usize] += reflected.extend(0.0);
                }
            }
        }
        if shadow_rays.is_empty() {
            return;
        }
        occluded.clear();
        occluded.resize(shadow_rays.len(), false);
        tracer.occluded_batch(shadow_rays, occluded, batch);
        for ((pixel, reflected), _) in shadow_light.iter().zip(occluded).filter(|(_, occluded)| !**occluded) {
            radiance[*pixel as usize] += reflected.extend(0.0);
        }
    }

    fn material(&self, point: &SurfacePoint) -> &Material {
        self.scene.materials.get(point.material as usize).unwrap_or(&self.fallback)
    }

    /// How rays are traced that neither start nor point alike.
    fn incoherent(&self) -> Batch {
        Batch { coherent: false, ..self.settings.batch }
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

impl Wave {
    /// The rays from `begin` on that are followed next: those of whole pixels, as many as make a batch; of a pixel that
    /// has more than a batch, that many. None at the end.
    fn batch(&self, begin: usize) -> Option<Range<usize>> {
        let rest = &self.paths[begin..];
        let mut length = 0;
        for pixel in rest.chunk_by(|a, b| a.pixel == b.pixel) {
            if length + pixel.len() > BATCH {
                // A pixel of more than a batch is cut after as many as if it stood alone.
                let alone = length == 0;
                length += if alone { BATCH } else { 0 };
                break;
            }
            length += pixel.len();
        }
        (length > 0).then(|| begin..begin + length)
    }
}
