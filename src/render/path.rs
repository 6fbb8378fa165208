//! Path tracing (Kajiya 1986, *The rendering equation*): from each surface a ray goes on in one direction that is
//! chosen at random, so that light is found however often it was scattered.
//!
//! At each surface one light is asked directly, and what the ray that goes on finds glowing is weighed against that
//! question by the power heuristic (Veach and Guibas 1995, *Optimally combining sampling techniques for Monte Carlo
//! rendering*). Paths that matter little end by chance, and those that go on count for them (Arvo and Kirk
//! 1990, *Particle transport and image synthesis*), so that nothing is lost on average.
//!
//! Every ray sends on one at most: a wave is never larger than the tile, and two are enough. Each depth has its own
//! dimensions of the sampler, so that every choice is well spread over the samples of a pixel.

use std::mem;

use crate::math::{DVec2, DVec3, Vec3};
use crate::plan::ROULETTE_MIN_DEPTH;
use crate::ray::{Hit, Ray};
use crate::scene::Material;
use crate::shade::SurfacePoint;
use crate::shade::light::LightSample;
use crate::shade::lights::{Chosen, Found};
use crate::shade::scattering::{Bsdf, BsdfValue, Shading, SpecularDirections};
use crate::trace::Tracer;

use super::Renderer;
use super::aov::{Event, Parts, Route, Tally};
use super::explain::Answer;
use super::sampler::{Bounces, Choice, Dimension, Pattern};
use super::shadows::Sent;
use super::wavefront::{Buffers, Path, Wave};

/// The surface that a path has come to.
struct Vertex<'a> {
    path: Path,
    point: &'a SurfacePoint,
    bsdf: Bsdf<'a>,
    pattern: &'a Pattern,
    bounces: &'a Bounces,
    sample: u32,
    depth: u32,
}

/// What a light answered.
struct Asked<'a> {
    chosen: Chosen<'a>,
    arriving: LightSample,
    value: BsdfValue,
    /// What is left of its light on the way; none for all of it.
    left: Option<Vec3>,
    /// What the answer counts, by the choice of this light and of this way to find it.
    share: f32,
    /// What the pixel gets if nothing is in between.
    contribution: Vec3,
}

impl Renderer<'_> {
    /// One sample of each pixel, whose camera rays are traced.
    pub(super) fn paths<T: Tracer + ?Sized>(&self, tracer: &T, sample: u32, buffers: &mut Buffers) {
        buffers.waves.resize_with(3, Wave::default);
        for depth in 0..=self.plan.depth {
            // The camera's, then two in turn.
            let current = if depth == 0 { 0 } else { 2 - depth as usize % 2 };
            let next = 1 + depth as usize % 2;
            let batch = if depth == 0 { self.settings.batch } else { self.incoherent() };
            self.scatter(depth, sample, current, next, buffers);
            self.add_unshadowed(tracer, batch, buffers);
            let Buffers { patterns, waves, hits, .. } = &mut *buffers;
            let Wave { rays, paths, .. } = &mut waves[next];
            if rays.is_empty() {
                return;
            }
            hits.clear();
            hits.resize(rays.len(), None);
            self.closest(tracer, rays, hits, self.incoherent(), |i| {
                let pattern = &patterns[paths[i].pixel as usize];
                self.sampler.pair(pattern, sample, Dimension::bounce(depth, Choice::Alpha))
            });
        }
    }

    /// Adds what the traced rays of a wave see, and makes the shadow rays and the rays that go on.
    fn scatter(&self, depth: u32, sample: u32, current: usize, next: usize, buffers: &mut Buffers) {
        let (wave, mut onwards) = (mem::take(&mut buffers.waves[current]), mem::take(&mut buffers.waves[next]));
        onwards.clear();
        let Buffers { patterns, bounces, radiance, hits, shadows, tally, trail, .. } = &mut *buffers;
        shadows.clear();
        let mut tally = tally.as_deref_mut().filter(|tally| tally.follows());
        let coverage = if depth == 0 { 1.0 } else { 0.0 };
        for (i, ((ray, path), hit)) in wave.rays.iter().zip(&wave.paths).zip(hits.iter()).enumerate() {
            let (mut path, route) = (*path, wave.route(i));
            let pixel = &mut radiance[path.pixel as usize];
            let Some(hit) = hit else {
                let fog = path.pass(self.fog_beyond(&path));
                let share = path.throughput * self.share_of_environment(&path, ray);
                let seen = share.extend(1.0) * self.behind(ray.direction, depth == 0) + fog.extend(0.0);
                trail.ray(self, depth, ray, &path, None, seen.truncate());
                *pixel += seen;
                if let Some(tally) = &mut tally {
                    tally.add(path.pixel, route, seen.truncate());
                }
                continue;
            };
            let point = self.surface(ray, hit);
            let material = &*self.appearance(&point);
            path.throughput *= self.transmittance(&path, ray.direction, &point);
            let fog = path.pass(self.fog_on(&path, ray, &point));
            let shading = Shading::new(&point, ray.direction, material, &self.scene.textures, Vec3::ZERO);
            let own = path.throughput * self.glow(&path, ray, hit, &point, material, shading.base) + fog;
            trail.ray(self, depth, ray, &path, Some((hit, &point)), own);
            *pixel += own.extend(coverage);
            if let Some(tally) = &mut tally {
                tally.add(path.pixel, route, own);
            }
            let ways = SpecularDirections::new(material, &point, shading.direction());
            let Some(bsdf) = Bsdf::new(&shading, ways, material.gloss) else { continue };
            let (pattern, bounces) = (&patterns[path.pixel as usize], &bounces[path.pixel as usize]);
            let vertex = Vertex { path, point: &point, bsdf, pattern, bounces, sample, depth };
            let is_choice = self.lights.is_choice() || vertex.bsdf.is_choice();
            let DVec2 { x: light, y: lobe } = if is_choice { self.choice(&vertex, Choice::Which) } else { DVec2::ZERO };
            if let Some(Asked { chosen, arriving, value, left, share, contribution }) =
                self.sample_light(&vertex, light)
            {
                trail.light(&path, vertex.point, || {
                    let faces = shading.faces(arriving.to_light);
                    let [diffuse, highlight] = if faces { shading.lobes(arriving.to_light) } else { [Vec3::ZERO; 2] };
                    Answer {
                        light: chosen.index,
                        source: chosen.source,
                        arriving: &arriving,
                        lobes: [diffuse, highlight, value.share - diffuse - highlight],
                        left: left.unwrap_or(Vec3::ONE),
                        share,
                        contribution,
                    }
                });
                let sent = Sent {
                    source: chosen.source,
                    arriving: &arriving,
                    point: vertex.point,
                    pixel: path.pixel,
                    contribution,
                };
                let told = tally.as_deref_mut().map(|tally| {
                    (tally, Parts::new(route, contribution, vertex.bsdf.parts(arriving.to_light, chosen.can_be_found)))
                });
                shadows.add(&sent, radiance, told);
            }
            if let (true, Some((ray, path))) = (depth < self.plan.depth, self.extend_path(&vertex, lobe)) {
                if let Some(tally) = &tally {
                    onwards.routes.push(self.route_on(tally, &vertex, route, &ray, &path));
                }
                onwards.rays.push(ray);
                onwards.paths.push(path);
            }
        }
        buffers.waves[current] = wave;
        buffers.waves[next] = onwards;
    }

    fn choice(&self, vertex: &Vertex<'_>, choice: Choice) -> DVec2 {
        self.sampler.bounce(vertex.pattern, vertex.bounces, vertex.sample, vertex.depth, choice)
    }

    /// What share of the light from around the scene counts that a ray finds which hits nothing.
    fn share_of_environment(&self, path: &Path, ray: &Ray) -> f32 {
        match &self.environment {
            Some(environment) if path.pdf > 0.0 => {
                let asked = self.lights.environment_pdf(environment, ray.direction.as_dvec3());
                power_heuristic(f64::from(path.pdf), asked)
            }
            _ => 1.0,
        }
    }

    /// What counts of what a surface gives off.
    fn glow(
        &self,
        path: &Path,
        ray: &Ray,
        hit: &Hit,
        point: &SurfacePoint,
        material: &Material,
        emission: Vec3,
    ) -> Vec3 {
        if path.pdf == 0.0 || emission == Vec3::ZERO || material.unlit {
            return emission;
        }
        match self.lights.found(hit, point, ray.origin.as_dvec3(), emission) {
            Found::Alone => emission,
            Found::Shared { radiance, pdf } => radiance * power_heuristic(f64::from(path.pdf), pdf),
            Found::Dark => Vec3::ZERO,
        }
    }

    /// Light from one of the lights, and what it contributes if nothing is in between.
    fn sample_light(&self, vertex: &Vertex<'_>, choice: f64) -> Option<Asked<'_>> {
        if !vertex.bsdf.has_values() {
            return None;
        }
        let chosen = self.lights.choose(choice)?;
        let xi = if chosen.source.is_extended() { self.choice(vertex, Choice::Light) } else { DVec2::ZERO };
        // From where rays start that find it, or the two estimates would be weighed by different distances.
        let is_found_from_above = chosen.can_be_found && !vertex.bsdf.go_through();
        let lift = if is_found_from_above { vertex.point.lift } else { DVec3::ZERO };
        let arriving = chosen.source.sample(vertex.point.position + lift, xi)?;
        let value = vertex.bsdf.eval(arriving.to_light, chosen.can_be_found);
        let share = match arriving.pdf {
            // Where the path ends, nothing else finds the light.
            Some(pdf) if chosen.can_be_found && vertex.depth < self.plan.depth => {
                power_heuristic(pdf * chosen.chance, value.pdf)
            }
            _ => 1.0,
        };
        let left = self.light_transmittance(&vertex.path, vertex.point, chosen.source, &arriving);
        let share = share / chosen.chance as f32;
        let mut contribution = vertex.path.throughput * value.share * arriving.color * share;
        if let Some(left) = left {
            contribution *= left;
        }
        (contribution != Vec3::ZERO && contribution.is_finite()).then_some(Asked {
            chosen,
            arriving,
            value,
            left,
            share,
            contribution,
        })
    }

    /// How light comes to the eye that the ray finds which goes on.
    fn route_on(&self, tally: &Tally, vertex: &Vertex<'_>, route: Route, ray: &Ray, path: &Path) -> Route {
        let direction = ray.direction.as_dvec3();
        if path.pdf == 0.0 {
            let goes_through = !vertex.point.is_above(direction);
            return tally.after(route, if goes_through { Event::Transmitted } else { Event::Specular });
        }
        // The other number of the pair says whether the path ends.
        let xi = self.choice(vertex, Choice::End).y;
        tally.choose(route, vertex.bsdf.parts(direction.normalize(), true), xi)
    }

    /// The ray that goes on from a surface, if any does.
    fn extend_path(&self, vertex: &Vertex<'_>, choice: f64) -> Option<(Ray, Path)> {
        let Vertex { path, point, bsdf, depth, .. } = vertex;
        let scattered = bsdf.sample(choice, self.choice(vertex, Choice::Direction))?;
        let mut throughput = path.throughput * scattered.weight;
        let eta_scale = path.eta_scale * scattered.scale;
        if *depth >= ROULETTE_MIN_DEPTH {
            // What radiance lost on its way into glass it gains on the way out. What has lost nothing goes on: to end
            // it now and then would make what is left worth more than there is light.
            let chance = (throughput.max_element() / eta_scale).min(1.0);
            if self.choice(vertex, Choice::End).x >= f64::from(chance) {
                return None;
            }
            throughput /= chance;
        }
        let goes_through = !point.is_above(scattered.direction);
        let media = if goes_through { self.media_behind(path, point) } else { path.media };
        let pdf = scattered.pdf.map_or(0.0, |pdf| pdf as f32);
        let ray = point.spawn(scattered.direction.as_vec3(), f32::INFINITY);
        Some((ray, Path { throughput, media, pdf, eta_scale, spawn_offset: point.ahead(&ray), ..*path }))
    }
}

/// What share of an estimate counts that was chosen with pdf `own`, beside one with `other`.
fn power_heuristic(own: f64, other: f64) -> f32 {
    if own.is_infinite() {
        return 1.0;
    }
    (own * own / (own * own + other * other)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_up_to_one() {
        for (a, b) in [(1.0, 1.0), (0.1, 30.0), (5.0, 0.0), (1e-9, 1e9)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6, "{a}, {b}");
        }
        assert_eq!((power_heuristic(2.0, 0.0), power_heuristic(1.0, f64::INFINITY)), (1.0, 0.0));
    }
}
