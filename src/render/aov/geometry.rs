//! What the ray through each pixel's middle hits, and where.
//!
//! It goes through the middle of the lens when the shutter is half open, and passes through what covers less than half:
//! nothing about it is left to chance, so that these channels are the same for any number of samples, and those of a
//! ray that anyone can cast.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use super::{Aov, Request};
use crate::image::Channel;
use crate::math::DVec2;
use crate::ray::{Hit, Ray};
use crate::render::tiles::Tile;
use crate::render::{Control, Renderer};
use crate::trace::Tracer;

/// Where it is, in the order of [`Renderer::place_of`]; the value where nothing is hit.
const PLACES: [(Aov, &str, f32); 6] = [
    (Aov::Depth, "depth.Z", f32::INFINITY),
    (Aov::Position, "position.X", 0.0),
    (Aov::Position, "position.Y", 0.0),
    (Aov::Position, "position.Z", 0.0),
    (Aov::Uv, "uv.U", 0.0),
    (Aov::Uv, "uv.V", 0.0),
];

/// What it is, in the order of [`numbers_of`].
const NUMBERS: [(Aov, &str); 3] =
    [(Aov::Primitive, "primitive"), (Aov::Geometry, "geometry"), (Aov::Instance, "instance")];

/// In place of a number where nothing is hit.
const NOTHING: u32 = u32::MAX;

/// What is known of every pixel: planes, each with its index in the lists above.
struct Planes {
    places: Vec<(usize, Vec<f32>)>,
    numbers: Vec<(usize, Vec<u32>)>,
}

impl Renderer<'_> {
    /// The channels that were asked for; not whole once `control` is cancelled.
    pub(in crate::render) fn geometry<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        request: &Request,
        control: Control<'_>,
    ) -> Vec<Channel> {
        let pixels = self.window().len();
        let places = PLACES.iter().enumerate().filter(|(_, (aov, ..))| request.wants(aov));
        let numbers = NUMBERS.iter().enumerate().filter(|(_, (aov, _))| request.wants(aov));
        let planes = Planes {
            places: places.map(|(k, (.., miss))| (k, vec![*miss; pixels])).collect(),
            numbers: numbers.map(|(k, _)| (k, vec![NOTHING; pixels])).collect(),
        };
        if planes.places.is_empty() && planes.numbers.is_empty() {
            return Vec::new();
        }
        let wants_places = !planes.places.is_empty();
        let planes = Mutex::new(planes);
        self.each_tile(|tile, _| {
            if control.is_cancelled() {
                return ControlFlow::Break(());
            }
            let mut rays: Vec<Ray> = tile.pixels().map(|(x, y)| self.middle_ray(x, y)).collect();
            let mut hits = vec![None; rays.len()];
            self.closest(tracer, &mut rays, &mut hits, self.settings.batch, |_| DVec2::splat(0.5));
            let place = |(ray, hit): (&Ray, &Option<Hit>)| Some(self.place_of(ray, hit.as_ref()?));
            let places = if wants_places { rays.iter().zip(&hits).map(place).collect() } else { Vec::new() };
            self.put(tile, &hits, &places, &mut planes.lock().unwrap_or_else(PoisonError::into_inner));
            ControlFlow::Continue(())
        });
        let Planes { places, numbers } = planes.into_inner().unwrap_or_else(PoisonError::into_inner);
        let places = places.into_iter().map(|(k, values)| Channel::float(PLACES[k].1, values));
        places.chain(numbers.into_iter().map(|(k, values)| Channel::uint(NUMBERS[k].1, values))).collect()
    }

    /// Puts in what a tile's rays have found.
    fn put(&self, tile: &Tile, hits: &[Option<Hit>], places: &[Option<[f32; 6]>], planes: &mut Planes) {
        let window = self.window();
        for (i, pixel) in tile.pixels().enumerate() {
            let at = window.index(pixel);
            if let Some(hit) = &hits[i] {
                planes.numbers.iter_mut().for_each(|(k, plane)| plane[at] = numbers_of(hit)[*k]);
            }
            if let Some(Some(place)) = places.get(i) {
                planes.places.iter_mut().for_each(|(k, plane)| plane[at] = place[*k]);
            }
        }
    }

    /// Distance, position and texture coordinates.
    fn place_of(&self, ray: &Ray, hit: &Hit) -> [f32; 6] {
        let point = self.whole_surface(ray, hit);
        let [x, y, z] = self.world.to_scene(point.position).as_vec3().to_array();
        let depth = point.t * ray.direction.as_dvec3().length();
        [depth as f32, x, y, z, point.uv.x, point.uv.y]
    }

    /// The ray through a pixel's middle, through that of the lens, half-way through the shutter's time.
    pub fn middle_ray(&self, x: u32, y: u32) -> Ray {
        let time = if self.has_times() { self.shutter[0].midpoint(self.shutter[1]) } else { 0.0 };
        self.view.middle_ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), time)
    }
}

fn numbers_of(hit: &Hit) -> [u32; 3] {
    [hit.primitive, hit.geometry, hit.instance]
}
