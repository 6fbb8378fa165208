//! What is added up for the pixels of a tile, sample by sample, beside their colours.
//!
//! Light is told apart by the route of each path: a state of the [`Automaton`] for each colour. Where a path goes on by
//! chance, its direction could have come from several lobes, and what it carries is light of each of them. Which lobe
//! that light is counted for is chosen by their shares, for red, green and blue apart, so that on average each gets
//! what is its own, and all together exactly what the picture gets. To count it for the lobe that proposed the
//! direction, which is simpler, would be wrong wherever lobes overlap; to follow each lobe's share would double the
//! paths at each surface.

use std::sync::Arc;

use super::{Automaton, Coverage, Event, Request};
use crate::math::Vec3;
use crate::ray::{Hit, Ray};
use crate::render::Renderer;
use crate::render::wavefront::Buffers;
use crate::shade::SurfacePoint;
use crate::shade::scattering::{Shading, SpecularDirections};
use crate::shade::{Attributes, normal_map};

/// How light of each colour came from where a path is to the eye: states of the [`Automaton`].
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::render) struct Route([u8; 3]);

/// Light of one source, by what a surface did with it: diffuse, specular, transmitted.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Parts {
    route: Route,
    light: [Vec3; 3],
}

impl Parts {
    /// Of `light` in all, as `shares` have it.
    pub(in crate::render) fn new(route: Route, light: Vec3, shares: [Vec3; 3]) -> Self {
        let sum = shares[0] + shares[1] + shares[2];
        // Where nothing is shared out there is nothing to share.
        let scale = Vec3::select(sum.cmpgt(Vec3::ZERO), light / sum, Vec3::ZERO);
        Self { route, light: shares.map(|share| share * scale) }
    }
}

/// The sums of a tile's pixels.
#[derive(Debug, Default)]
pub(in crate::render) struct Tally {
    automaton: Option<Arc<Automaton>>,
    stride: usize,
    light_at: usize,
    kinds: usize,
    /// Of each pixel `stride`.
    pub(in crate::render) sums: Vec<f32>,
    /// Of the present sample: of each pixel the light of each kind of paths.
    light: Vec<Vec3>,
    pub(in crate::render) objects: Vec<Coverage>,
    pub(in crate::render) materials: Vec<Coverage>,
}

impl Tally {
    /// For as many pixels, of which nothing is known yet.
    pub(in crate::render) fn begin(&mut self, request: &Request, pixels: usize) {
        self.automaton = request.automaton.clone();
        (self.stride, self.light_at, self.kinds) = (request.stride, request.light, request.kinds.len());
        self.sums.clear();
        self.sums.resize(pixels * self.stride, 0.0);
        self.light.clear();
        self.light.resize(pixels * self.kinds, Vec3::ZERO);
        let mattes = request.mattes.as_deref();
        for (coverage, wanted) in [
            (&mut self.objects, mattes.is_some_and(|m| m.has_objects)),
            (&mut self.materials, mattes.is_some_and(|m| m.has_materials)),
        ] {
            coverage.clear();
            coverage.resize(if wanted { pixels } else { 0 }, Vec::new());
        }
    }

    /// Whether light is told apart.
    pub(in crate::render) fn follows(&self) -> bool {
        self.automaton.is_some()
    }

    /// Adds light that a path by this route has found.
    #[inline]
    pub(in crate::render) fn add(&mut self, pixel: u32, route: Route, light: Vec3) {
        let Some(automaton) = &self.automaton else { return };
        for (axis, state) in route.0.into_iter().enumerate() {
            for &kind in automaton.ends(state) {
                self.light[pixel as usize * self.kinds + kind as usize][axis] += light[axis];
            }
        }
    }

    /// Adds a share of what a light gives.
    pub(in crate::render) fn add_parts(&mut self, pixel: u32, parts: &Parts, share: f32) {
        for (event, light) in Event::ALL.into_iter().zip(parts.light) {
            self.add(pixel, self.after(parts.route, event), light * share);
        }
    }

    /// The route of a path after an event.
    pub(in crate::render) fn after(&self, route: Route, event: Event) -> Route {
        match &self.automaton {
            Some(automaton) => Route(route.0.map(|state| automaton.after(state, event))),
            None => route,
        }
    }

    /// The route after one of the three events, which `xi` (from 0 to below 1) chooses by their shares for each colour.
    pub(in crate::render) fn choose(&self, route: Route, shares: [Vec3; 3], xi: f64) -> Route {
        let after = Event::ALL.map(|event| self.after(route, event).0);
        let mut chosen = route.0;
        for (axis, state) in chosen.iter_mut().enumerate() {
            // In f64, where `xi` stays below 1 and what it chooses within the shares.
            let shares = shares.map(|share| f64::from(share[axis]));
            let wanted = xi * (shares[0] + shares[1] + shares[2]);
            let event = if wanted < shares[0] {
                0
            } else if wanted < shares[0] + shares[1] || shares[2] == 0.0 {
                1
            } else {
                2
            };
            *state = after[event][axis];
        }
        Route(chosen)
    }

    /// Adds the present sample's light of a pixel to its sums, with the sample's weight.
    pub(in crate::render) fn close(&mut self, pixel: usize, weight: f32) {
        let light = &mut self.light[pixel * self.kinds..(pixel + 1) * self.kinds];
        let sums = &mut self.sums[pixel * self.stride + self.light_at..][..3 * self.kinds];
        for (light, sums) in light.iter_mut().zip(sums.as_chunks_mut::<3>().0) {
            for (sum, light) in sums.iter_mut().zip(light.to_array()) {
                *sum += light * weight;
            }
            *light = Vec3::ZERO;
        }
    }
}

impl Renderer<'_> {
    /// Notes what the camera rays of the present sample have hit.
    pub(in crate::render) fn observe(&self, request: &Request, sample: u32, buffers: &mut Buffers) {
        if !request.observes() {
            return;
        }
        let Buffers { patterns, balances, waves, hits, tally, .. } = buffers;
        let Some(tally) = tally else { return };
        for (i, (ray, hit)) in waves[0].rays.iter().zip(hits).enumerate() {
            let Some(hit) = hit else { continue };
            let weight = self.weight(balances, &patterns[i], i, sample);
            if let Some(mattes) = &request.mattes {
                if mattes.has_objects {
                    cover(&mut tally.objects[i], mattes.object(hit), weight);
                }
                if mattes.has_materials {
                    cover(&mut tally.materials[i], mattes.material(hit), weight);
                }
            }
            if request.normal.is_none() && request.albedo.is_none() {
                continue;
            }
            let point = self.whole_surface(ray, hit);
            let mut add = |at: Option<usize>, value: Vec3| {
                let Some(at) = at else { return };
                let sums = &mut tally.sums[i * request.stride + at..][..3];
                sums.iter_mut().zip((value * weight).to_array()).for_each(|(sum, x)| *sum += x);
            };
            add(request.normal, point.shading_normal.as_vec3());
            if request.albedo.is_some() {
                add(request.albedo, self.albedo(ray, &point));
            }
        }
    }

    /// What is where a ray hit, with all that the scene knows of it.
    pub(super) fn whole_surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let mut point = SurfacePoint::new(self.scene, self.world, ray, hit, Attributes::ALL);
        let material = self.material(&point);
        normal_map::bend(&mut point, self.scene, self.world, hit, material);
        point
    }

    /// How much of the light that comes from everywhere a surface sends on, and what it shows unlit.
    fn albedo(&self, ray: &Ray, point: &SurfacePoint) -> Vec3 {
        let material = &*self.appearance(point);
        let shading = Shading::new(point, ray.direction, material, &self.scene.textures, Vec3::ZERO);
        let ways = SpecularDirections::new(material, point, ray.direction.as_dvec3().normalize());
        let sent_on = [ways.mirrored, ways.refracted].into_iter().flatten().map(|way| way.share).sum::<Vec3>();
        let unlit = if material.unlit { shading.base } else { Vec3::ZERO };
        (shading.albedo() + sent_on + unlit).clamp(Vec3::ZERO, Vec3::ONE)
    }
}

fn cover(coverage: &mut Coverage, id: u32, weight: f32) {
    match coverage.iter_mut().find(|(known, _)| *known == id) {
        Some((_, share)) => *share += weight,
        None => coverage.push((id, weight)),
    }
}
