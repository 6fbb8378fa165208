//! Ray casting, and Whitted's recursion (1980, *An improved illumination model for shaded display*): at each surface
//! every light is asked, then all rays that mirrors and glass send on are followed.
//!
//! A pixel adds up camera ray by sample, then lights in the scene's order, then the rays sent on, depth by depth.
//!
//! Every ray may send on two, so that their number may double with each depth. They are followed in batches: breadth
//! first within a batch, so that packets stay full; one batch to its end before the next, so that memory grows with
//! the depth and not with the number of rays. A pixel's rays are divided by their own count alone, never by what its
//! neighbours add to the batch.

use std::ops::Range;

use crate::math::{DVec2, Vec3};
use crate::scene::Integrator;
use crate::shade::SurfacePoint;
use crate::shade::scattering::{Shading, SpecularDirections};
use crate::trace::{Batch, Tracer};

use super::Renderer;
use super::aov::{Event, Parts, Route};
use super::explain::Answer;
use super::sampler::Dimension;
use super::shadows::Sent;
use super::wavefront::{Buffers, Path, Wave};

/// Most rays that are followed at once below the camera's.
const BATCH: usize = 4096;

/// Which rays are followed.
#[derive(Clone, Copy)]
struct Stage {
    /// Of each pixel's samples.
    sample: u32,
    /// How often they were sent on.
    depth: u32,
}

/// A ray that hit something.
pub(super) struct Lit {
    path: Path,
    route: Route,
    direction: Vec3,
    point: SurfacePoint,
    shading: Shading,
}

impl Renderer<'_> {
    /// One sample of each pixel, whose camera rays are traced.
    pub(super) fn whitted<T: Tracer + ?Sized>(&self, tracer: &T, sample: u32, buffers: &mut Buffers) {
        self.radiance(tracer, Stage { sample, depth: 0 }, 0, buffers);
    }

    /// Adds what the rays that `buffers.hits` belongs to see, those of `waves[depth]` from `first` on, and follows what
    /// is sent on from there.
    fn radiance<T: Tracer + ?Sized>(&self, tracer: &T, stage: Stage, first: usize, buffers: &mut Buffers) {
        let Stage { sample, depth } = stage;
        self.shade(depth, first, buffers);
        let batch = if depth == 0 { self.settings.batch } else { self.incoherent() };
        for light in 0..self.lights.sources().len() {
            self.add_light(tracer, light, sample, batch, buffers);
        }
        if depth == self.plan.depth {
            self.fake_reflections(buffers);
            return;
        }
        self.send_on(stage, buffers);
        let mut begin = 0;
        while let Some(range) = buffers.waves[depth as usize + 1].batch(begin) {
            begin = range.end;
            let Buffers { patterns, waves, hits, .. } = &mut *buffers;
            let Wave { rays, paths, .. } = &mut waves[depth as usize + 1];
            let (rays, paths) = (&mut rays[range.clone()], &paths[range.clone()]);
            hits.clear();
            hits.resize(rays.len(), None);
            self.closest(tracer, rays, hits, self.incoherent(), |i| {
                let Path { pixel, branch, .. } = paths[i];
                self.sampler.pair(&patterns[pixel as usize], sample, Dimension::alpha(branch))
            });
            self.radiance(tracer, Stage { sample, depth: depth + 1 }, range.start, buffers);
        }
    }

    /// What surfaces are where the rays hit, with what they give off without any light.
    fn shade(&self, depth: u32, first: usize, buffers: &mut Buffers) {
        let Buffers { waves, hits, radiance, lit, tally, trail, .. } = buffers;
        let wave = &waves[depth as usize];
        let Wave { rays, paths, .. } = wave;
        let coverage = if depth == 0 { 1.0 } else { 0.0 };
        lit.clear();
        for (i, ((ray, path), hit)) in (first..).zip(rays[first..].iter().zip(&paths[first..]).zip(hits)) {
            let (mut path, route) = (*path, wave.route(i));
            let pixel = &mut radiance[path.pixel as usize];
            let Some(hit) = hit else {
                let fog = path.pass(self.fog_beyond(&path));
                let seen = path.throughput.extend(1.0) * self.behind(ray.direction, depth == 0) + fog.extend(0.0);
                trail.ray(self, depth, ray, &path, None, seen.truncate());
                *pixel += seen;
                if let Some(tally) = tally {
                    tally.add(path.pixel, route, seen.truncate());
                }
                continue;
            };
            let point = self.surface(ray, hit);
            let material = &*self.appearance(&point);
            let shading = Shading::new(&point, ray.direction, material, &self.scene.textures, self.ambient);
            path.throughput *= self.transmittance(&path, ray.direction, &point);
            let fog = path.pass(self.fog_on(&path, ray, &point));
            let own = path.throughput * shading.base + fog;
            trail.ray(self, depth, ray, &path, Some((hit, &point)), own);
            *pixel += own.extend(coverage);
            if let Some(tally) = tally.as_deref_mut().filter(|tally| tally.follows()) {
                // Ambient light is scattered, what a surface gives off is not.
                let dark = Shading::new(&point, ray.direction, material, &self.scene.textures, Vec3::ZERO);
                tally.add(path.pixel, route, path.throughput * dark.base + fog);
                let scattered = tally.after(route, Event::Diffuse);
                tally.add(path.pixel, scattered, path.throughput * (shading.base - dark.base));
            }
            lit.push(Lit { path, route, direction: ray.direction, point, shading });
        }
    }

    /// The mirrored and refracted rays of all surfaces that were hit at a depth, into the wave below.
    fn send_on(&self, Stage { sample, depth }: Stage, buffers: &mut Buffers) {
        let Buffers { patterns, waves, lit, tally, .. } = buffers;
        let below = depth as usize + 1;
        waves.resize_with(waves.len().max(below + 1), Wave::default);
        let wave = &mut waves[below];
        wave.clear();
        for Lit { path, route, direction, point, shading } in lit {
            let material = &*self.appearance(point);
            let on = SpecularDirections::new(material, point, direction.as_dvec3().normalize());
            let throughputs = [&on.mirrored, &on.refracted]
                .map(|way| way.as_ref().map_or(Vec3::ZERO, |way| path.throughput * way.share * way.scale));
            let (is_followed, error_budget) = followed(throughputs.map(Vec3::max_element), path.error_budget);
            let ways = [(1, on.mirrored, Event::Specular), (2, on.refracted, Event::Transmitted)];
            for (k, (which, way, event)) in ways.into_iter().enumerate() {
                let Some(way) = way.filter(|_| is_followed[k]) else { continue };
                let throughput = throughputs[k];
                let branch = path.branch.wrapping_mul(2).wrapping_add(which);
                let direction = match material.gloss {
                    None => Some(way.direction),
                    Some(gloss) => {
                        let pattern = &patterns[path.pixel as usize];
                        way.spread(gloss, self.sampler.pair(pattern, sample, Dimension::gloss(branch)), shading)
                    }
                };
                let Some(direction) = direction else { continue };
                let ray = point.spawn(direction.as_vec3(), f32::INFINITY);
                let media = if which == 2 { self.media_behind(path, point) } else { path.media };
                wave.paths.push(Path {
                    throughput,
                    branch,
                    media,
                    error_budget,
                    spawn_offset: point.ahead(&ray),
                    ..*path
                });
                wave.rays.push(ray);
                if let Some(tally) = tally {
                    wave.routes.push(tally.after(*route, event));
                }
            }
        }
    }

    /// In place of rays that ray casting does not send on: what they would see if nothing but the environment were
    /// there (Blinn and Newell 1976, *Texture and reflection in computer generated images*).
    fn fake_reflections(&self, buffers: &mut Buffers) {
        let (Integrator::RayCast, Some(environment)) = (self.plan.integrator, &self.environment) else { return };
        let Buffers { radiance, lit, tally, trail, .. } = buffers;
        for Lit { path, route, direction, point, .. } in lit.iter() {
            let ways = SpecularDirections::new(&self.appearance(point), point, direction.as_dvec3().normalize());
            for (way, event) in [(ways.mirrored, Event::Specular), (ways.refracted, Event::Transmitted)] {
                let Some(way) = way else { continue };
                let mut path = Path { throughput: path.throughput * way.share, ..*path };
                let fog = path.pass(self.fog_beyond(&path));
                let seen = path.throughput * environment.radiance(way.direction) + fog;
                let faked = point.spawn(way.direction.as_vec3(), f32::INFINITY);
                trail.ray(self, 1, &faked, &path, None, seen);
                radiance[path.pixel as usize] += seen.extend(0.0);
                if let Some(tally) = tally {
                    tally.add(path.pixel, tally.after(*route, event), seen);
                }
            }
        }
    }

    /// Adds what of a light reaches what was hit.
    fn add_light<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        light: usize,
        sample: u32,
        batch: Batch,
        buffers: &mut Buffers,
    ) {
        let Buffers { patterns, radiance, lit, shadows, tally, trail, .. } = &mut *buffers;
        let (index, light) = (light as u32, &self.lights.sources()[light]);
        let count = if light.is_extended() { self.settings.light_samples } else { 1 };
        shadows.clear();
        let mut tally = tally.as_deref_mut().filter(|tally| tally.follows());
        for Lit { path, route, point, shading, .. } in lit.iter() {
            let weight = if count == 1 { path.throughput } else { path.throughput / count as f32 };
            for k in 0..count {
                let xi = if light.is_extended() {
                    let dimension = Dimension::light(index, path.branch);
                    self.light_sampler.pair(&patterns[path.pixel as usize], sample * count + k, dimension)
                } else {
                    DVec2::ZERO
                };
                let Some(arriving) = light.sample(point.position, xi) else { continue };
                if !shading.faces(arriving.to_light) {
                    continue;
                }
                let left = self.light_transmittance(path, point, light, &arriving);
                let [diffuse, highlight] = shading.lobes(arriving.to_light);
                let mut reflected = weight * ((diffuse + highlight) * arriving.color);
                if let Some(left) = left {
                    reflected *= left;
                }
                trail.light(path, point, || Answer {
                    light: index,
                    source: light,
                    arriving: &arriving,
                    lobes: [diffuse, highlight, Vec3::ZERO],
                    left: left.unwrap_or(Vec3::ONE),
                    share: 1.0 / count as f32,
                    contribution: reflected,
                });
                let sent =
                    Sent { source: light, arriving: &arriving, point, pixel: path.pixel, contribution: reflected };
                let told = tally
                    .as_deref_mut()
                    .map(|tally| (tally, Parts::new(*route, reflected, [diffuse, highlight, Vec3::ZERO])));
                shadows.add(&sent, radiance, told);
            }
        }
        self.add_unshadowed(tracer, batch, buffers);
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

/// Which of two ways are followed, and what each of these may leave out: the smaller ones are not as long as they fit
/// into what may be left out, and the rest of that is shared. So all that is left out of a tree of rays, however large,
/// stays below what its first ray may leave out.
fn followed(shares: [f32; 2], error_budget: f32) -> ([bool; 2], f32) {
    let (mut is_followed, mut left) = ([true; 2], error_budget);
    let smaller = usize::from(shares[1] < shares[0]);
    for k in [smaller, 1 - smaller] {
        if shares[k] <= left {
            left -= shares[k];
            is_followed[k] = false;
        }
    }
    (is_followed, if is_followed == [true; 2] { left / 2.0 } else { left })
}
