//! Why a pixel is as bright as it is: the rays it depends on, what each of them met, and every share of light.
//!
//! The integrators themselves tell it: where a [`Trail`] is laid they note what they do, so that there is no second
//! account of them that could say something else. A picture has no trail, and pays a branch for each surface and for
//! each light asked. Recomputing the pixel in a slower renderer of its own, the alternative, would have every formula
//! twice.

mod trail;

use serde::Serialize;

use super::Renderer;
use super::tiles::Tile;
use super::wavefront::Buffers;
use crate::math::{DVec3, Vec3, Vec4};
use crate::ray::Ray;
use crate::trace::Tracer;
use crate::trace::bvh::Steps;

pub(super) use trail::{Answer, Trail};

/// A pixel, and where its light comes from. Colours are linear RGB, places in scene coordinates.
#[derive(Clone, Debug, Serialize)]
pub struct Explanation {
    /// Column and row.
    pub pixel: [u32; 2],
    /// What the picture has there: the mean of the samples by weight; RGB, premultiplied, and coverage.
    pub value: [f32; 4],
    /// Its samples.
    pub samples: Vec<SampleTrail>,
}

/// One of a pixel's samples.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SampleTrail {
    /// Where on the film, pixels from its top left corner.
    pub film: [f64; 2],
    /// What it counts in the pixel, by the filter.
    pub weight: f32,
    /// RGB and coverage, all of what follows together.
    pub value: [f32; 4],
    /// Its rays, in the order in which they were followed; the camera's first.
    pub rays: Vec<RayTrail>,
}

/// A ray that was sent from the camera, or from a surface.
#[derive(Clone, Debug, Serialize)]
pub struct RayTrail {
    /// How often light was sent on since the camera.
    pub depth: u32,
    /// Number in the tree of rays: those that ray n sends on are 2 n + 1, mirrored, and 2 n + 2, refracted; 0 for all
    /// of a path.
    pub number: u32,
    /// Where it starts.
    pub origin: [f64; 3],
    /// Unit vector.
    pub direction: [f32; 3],
    /// When, from 0 to 1.
    pub time: f32,
    /// Share of what it sees at its end that reaches the sample; fog and absorption on its way are taken off.
    pub weight: [f32; 3],
    /// What it met; none where it left the scene.
    pub hit: Option<HitTrail>,
    /// What the sample gets from there without asking any light: what glows, the ambient light, what is behind
    /// everything, the fog on the way.
    pub own: [f32; 3],
    /// The lights that were asked there.
    pub lights: Vec<LightTrail>,
    /// What its search took, where the engine tells.
    pub steps: Option<Steps>,
    #[serde(skip)]
    ray: Ray,
}

/// Where a ray met something.
#[derive(Clone, Debug, Serialize)]
pub struct HitTrail {
    /// Metres from the ray's start.
    pub distance: f64,
    /// Index of the instance, and its name.
    pub instance: u32,
    /// Of the placement.
    pub instance_name: String,
    /// Index of the geometry.
    pub geometry: u32,
    /// Index of the triangle in its mesh, or of the shape in its list.
    pub primitive: u32,
    /// The hit's parameters.
    pub parameters: [f64; 2],
    /// Where.
    pub position: [f64; 3],
    /// Unit geometric normal, on the viewer's side.
    pub normal: [f64; 3],
    /// Unit shading normal.
    pub shading_normal: [f64; 3],
    /// Whether the front is seen.
    pub front: bool,
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Index of the material.
    pub material: u32,
    /// Its name in the file.
    pub material_name: String,
}

/// A light that was asked from a surface.
#[derive(Clone, Debug, Serialize)]
pub struct LightTrail {
    /// Which, as the renderer numbers them.
    pub light: u32,
    /// What kind.
    pub kind: &'static str,
    /// Unit vector towards it.
    pub direction: [f64; 3],
    /// Metres; none for what is infinitely far.
    pub distance: Option<f64>,
    /// What a white matte surface that faces it would show, without shadows and fog.
    pub radiance: [f32; 3],
    /// Between the shading normal and the light.
    pub cosine: f64,
    /// Share of it that is scattered to the viewer, pi f cos: by Lambert's lobe, ...
    pub diffuse: [f32; 3],
    /// ... by the highlight, ...
    pub highlight: [f32; 3],
    /// ... and by glossy mirroring and refraction.
    pub glossy: [f32; 3],
    /// What fog, or absorption inside of something, leaves of the light on its way.
    pub fog: [f32; 3],
    /// What its answer counts: 1 / the number of questions, or what the choice of one light, and of this way to find
    /// it, makes of it.
    pub share: f32,
    /// How much of the way is free, 0 to 1.
    pub visibility: f32,
    /// What the sample gets: the product of it all and of the ray's weight.
    pub contribution: [f32; 3],
}

impl Renderer<'_> {
    /// Renders a pixel, the same to the bit as in the whole picture, and tells why it is as it is. `steps` counts what
    /// a ray asks of the engine, as [`Bvh::steps`](crate::trace::bvh::Bvh::steps) does.
    pub fn explain<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        [x, y]: [u32; 2],
        steps: Option<&dyn Fn(&Ray) -> Steps>,
    ) -> Explanation {
        let mut buffers = Buffers { trail: Trail::laid(self.settings.spp), ..Buffers::default() };
        let value = self.tile(tracer, &Tile { x, y, width: 1, height: 1 }, &mut buffers)[0];
        let mut samples = std::mem::take(&mut buffers.trail).into_samples();
        let pattern = self.sampler.pattern(x, y);
        for (sample, number) in samples.iter_mut().zip(0..) {
            sample.film = self.place(&pattern, number).0.to_array();
            sample.weight = self.weight(&buffers.balances, &pattern, 0, number);
            for ray in &mut sample.rays {
                ray.steps = steps.map(|steps| steps(&ray.ray));
            }
        }
        Explanation { pixel: [x, y], value: value.to_array(), samples }
    }

    /// A point of the world, where the scene has it.
    fn in_scene(&self, point: DVec3) -> [f64; 3] {
        self.world.to_scene(point).to_array()
    }
}

impl SampleTrail {
    /// The sum of all that its rays add.
    pub fn sum(&self) -> Vec3 {
        let of = |ray: &RayTrail| {
            let lights = ray.lights.iter().map(|light| Vec3::from(light.contribution));
            Vec3::from(ray.own) + lights.sum::<Vec3>()
        };
        self.rays.iter().map(of).sum()
    }
}

impl Explanation {
    /// The pixel, added up from everything that is told.
    pub fn sum(&self) -> Vec3 {
        let sum: Vec3 = self.samples.iter().map(|sample| sample.sum() * sample.weight).sum();
        let weights: f32 = self.samples.iter().map(|sample| sample.weight).sum();
        sum / weights.max(1.0)
    }

    /// The value's colour.
    pub fn color(&self) -> Vec3 {
        Vec4::from(self.value).truncate()
    }
}
