//! What integrators note while they render a pixel that is to be explained.

use super::{HitTrail, LightTrail, RayTrail, SampleTrail};
use crate::math::{Vec3, Vec4};
use crate::ray::{Hit, Ray};
use crate::render::Renderer;
use crate::render::wavefront::Path;
use crate::shade::SurfacePoint;
use crate::shade::light::{LightSample, LightSource};

/// Notes of one pixel; none are taken where none are wanted.
#[derive(Default)]
pub(in crate::render) struct Trail(Option<Box<Notes>>);

#[derive(Default)]
struct Notes {
    samples: Vec<SampleTrail>,
    /// The sample that is being rendered.
    sample: usize,
    /// Ray and light of every shadow ray that has no answer yet, in their order.
    pending: Vec<[usize; 2]>,
}

/// A light's answer, as the integrator has it.
pub(in crate::render) struct Answer<'a> {
    pub(in crate::render) light: u32,
    pub(in crate::render) source: &'a LightSource,
    pub(in crate::render) arriving: &'a LightSample,
    /// pi f cos of Lambert's lobe, the highlight, and glossy ways.
    pub(in crate::render) lobes: [Vec3; 3],
    pub(in crate::render) left: Vec3,
    pub(in crate::render) share: f32,
    /// Where nothing is in between.
    pub(in crate::render) contribution: Vec3,
}

impl Trail {
    /// For a pixel of so many samples.
    pub(super) fn laid(samples: u32) -> Self {
        let samples = vec![SampleTrail::default(); samples as usize];
        Self(Some(Box::new(Notes { samples, ..Notes::default() })))
    }

    pub(super) fn into_samples(self) -> Vec<SampleTrail> {
        self.0.map(|notes| notes.samples).unwrap_or_default()
    }

    /// A sample begins.
    pub(in crate::render) fn begin(&mut self, sample: u32) {
        if let Some(notes) = &mut self.0 {
            notes.sample = sample as usize;
        }
    }

    /// A sample is done.
    pub(in crate::render) fn end(&mut self, value: Vec4) {
        if let Some(notes) = &mut self.0 {
            notes.samples[notes.sample].value = value.to_array();
        }
    }

    /// A ray was followed: `path` is what it was for, at its end; `own` what the sample gets of it without asking
    /// lights.
    #[inline]
    pub(in crate::render) fn ray(
        &mut self,
        renderer: &Renderer<'_>,
        depth: u32,
        ray: &Ray,
        path: &Path,
        hit: Option<(&Hit, &SurfacePoint)>,
        own: Vec3,
    ) {
        if let Some(notes) = &mut self.0 {
            let hit = hit.map(|(hit, point)| renderer.hit_trail(ray, hit, point));
            notes.add(RayTrail {
                depth,
                number: path.branch,
                origin: renderer.in_scene(ray.origin.as_dvec3()),
                direction: ray.direction.normalize_or_zero().to_array(),
                time: ray.time,
                weight: path.throughput.to_array(),
                hit,
                own: own.to_array(),
                lights: Vec::new(),
                steps: None,
                ray: *ray,
            });
        }
    }

    /// A light was asked where the ray of `path` ended. What casts shadows waits for [`Trail::free`].
    #[inline]
    pub(in crate::render) fn light<'a>(
        &mut self,
        path: &Path,
        point: &SurfacePoint,
        answer: impl FnOnce() -> Answer<'a>,
    ) {
        if let Some(notes) = &mut self.0 {
            notes.add_light(path.branch, point, &answer());
        }
    }

    /// The shadow rays since the last time have been traced: of each, how much is free.
    #[inline]
    pub(in crate::render) fn free(&mut self, visibility: impl Fn(usize) -> f32) {
        if let Some(notes) = &mut self.0 {
            notes.free(&visibility);
        }
    }
}

impl Notes {
    #[cold]
    fn add(&mut self, ray: RayTrail) {
        self.samples[self.sample].rays.push(ray);
    }

    #[cold]
    fn add_light(&mut self, number: u32, point: &SurfacePoint, answer: &Answer<'_>) {
        let Answer { light, source, arriving, lobes: [diffuse, highlight, glossy], left, share, contribution } = answer;
        let rays = &mut self.samples[self.sample].rays;
        // The last of the number: a path's all have the same, and lights are asked before it goes on.
        let Some(at) = rays.iter().rposition(|ray| ray.number == number) else { return };
        if source.casts_shadows {
            self.pending.push([at, rays[at].lights.len()]);
        }
        rays[at].lights.push(LightTrail {
            light: *light,
            kind: source.kind(),
            direction: arriving.to_light.to_array(),
            distance: arriving.end.map(|end| (end - point.position).length()),
            radiance: arriving.color.to_array(),
            cosine: point.shading_normal.dot(arriving.to_light),
            diffuse: diffuse.to_array(),
            highlight: highlight.to_array(),
            glossy: glossy.to_array(),
            fog: left.to_array(),
            share: *share,
            visibility: 1.0,
            contribution: contribution.to_array(),
        });
    }

    #[cold]
    fn free(&mut self, visibility: &dyn Fn(usize) -> f32) {
        for (i, [ray, light]) in self.pending.drain(..).enumerate() {
            let light = &mut self.samples[self.sample].rays[ray].lights[light];
            light.visibility = visibility(i);
            light.contribution = light.contribution.map(|share| share * light.visibility);
        }
    }
}

impl Renderer<'_> {
    #[cold]
    fn hit_trail(&self, ray: &Ray, hit: &Hit, point: &SurfacePoint) -> HitTrail {
        HitTrail {
            distance: point.t * ray.direction.as_dvec3().length(),
            instance: hit.instance,
            instance_name: self.scene.instances[hit.instance as usize].name.clone(),
            geometry: hit.geometry,
            primitive: hit.primitive,
            parameters: point.parameters,
            position: self.in_scene(point.position),
            normal: point.normal.to_array(),
            shading_normal: point.shading_normal.to_array(),
            front: point.front,
            uv: point.uv.to_array(),
            material: point.material,
            material_name: self.material(point).name.clone(),
        }
    }
}
