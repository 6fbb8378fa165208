//! The rays that are timed: those of `benches/embree_ref.cpp`, formula by formula, in f32.
//!
//! 1024 x 1024 camera rays in blocks of 4 x 4, so that 8 or 16 neighbours make a packet; the blocks in tiles of 8 x 8
//! as a renderer would have them, not in rows across the picture, which is all the same to a packet. From each point
//! they hit one diffuse ray, cosine-distributed about the normal, and one shadow ray towards a point light. Rays are
//! made before any clock starts. Two more kinds, which `embree_ref` lacks, have a direction in common: those of an
//! orthographic camera in the same place, and those towards a sun in the point light's direction.

use serde::Serialize;

use crate::io::UpAxis;
use crate::math::{DAabb, DVec3, Vec3};
use crate::ray::{Hit, Ray};
use crate::scene::Camera;
use crate::trace::{Batch, Primitives, Tracer, Width, World};

/// Camera rays to a side, where figures are to be compared with those of `embree_ref`.
pub const SIDE: usize = 1024;
/// Rays to a side of a block.
pub const BLOCK: usize = 4;
/// Rays to a side of a tile.
pub const TILE: usize = 8;
/// Tangent of half the camera's angle.
const TANGENT: f32 = 0.45;
/// Where a ray without an end ends.
const FAR: f32 = 1e30;

/// What rays are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// From the camera.
    Primary,
    /// From a surface, in a random direction.
    Diffuse,
    /// From a surface to the light; whether anything is hit, not what.
    Shadow,
    /// From an orthographic camera, as large as the other where it looks.
    Orthographic,
    /// From a surface that the camera sees to a distant light; whether anything is hit, not what.
    Sun,
    /// From the camera, made from pixels within the time that is measured; all others are made before.
    Pixel,
}

impl Kind {
    /// All of them, in the order of the reports.
    pub const ALL: [Self; 6] = [Self::Primary, Self::Diffuse, Self::Shadow, Self::Orthographic, Self::Sun, Self::Pixel];

    /// As in the reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Diffuse => "diffuse",
            Self::Shadow => "shadow",
            Self::Orthographic => "orthographic",
            Self::Sun => "sun",
            Self::Pixel => "pixel",
        }
    }

    /// Whether it is asked if anything is hit, and not what.
    pub const fn is_shadow(self) -> bool {
        match self {
            Self::Shadow | Self::Sun => true,
            Self::Primary | Self::Diffuse | Self::Orthographic | Self::Pixel => false,
        }
    }

    /// How such rays are traced at a width: single rays know no neighbours, and diffuse ones have none alike.
    pub fn batch(self, width: Width) -> Batch {
        Batch { width, coherent: self != Self::Diffuse && width != Width::One }
    }
}

/// Rays of one kind.
pub struct RaySet {
    /// What they are for.
    pub kind: Kind,
    /// The rays.
    pub rays: Vec<Ray>,
}

/// Camera, light and floor, by the bounds of what is looked at.
#[derive(Clone, Copy, Debug)]
pub struct View {
    centre: Vec3,
    /// Half the diagonal of the bounds.
    radius: f32,
    /// The height of the floor below the centre, negative.
    bottom: f32,
    up: UpAxis,
    /// From the centre.
    eye: Vec3,
}

impl View {
    /// A view of `bounds`, in coordinates whose zero is at `zero`: from above at the corner if `near` (for terrains of
    /// unit size), else from a distance.
    pub fn new(bounds: &DAabb, zero: DVec3, up: UpAxis, near: bool) -> Self {
        let (lo, hi) = ((bounds.min - zero).as_vec3(), (bounds.max - zero).as_vec3());
        let centre = (lo + hi) * 0.5;
        let radius = 0.5 * (hi - lo).length();
        let bottom = match up {
            UpAxis::Y => lo.y - centre.y,
            UpAxis::Z => lo.z - centre.z,
        };
        let view = Self { centre, radius, bottom, up, eye: Vec3::ZERO };
        let eye = if near { Vec3::new(0.3, 0.35, 0.9) } else { view.frame(Vec3::new(0.6, 0.5, 1.6)) * radius };
        Self { eye, ..view }
    }

    /// (right, up, front) in the scene's coordinates.
    fn frame(&self, v: Vec3) -> Vec3 {
        match self.up {
            UpAxis::Y => v,
            UpAxis::Z => Vec3::new(v.x, -v.z, v.y),
        }
    }

    /// The floor's corners; its triangles are 0 1 2 and 1 3 2.
    pub fn floor(&self) -> [Vec3; 4] {
        let bottom = self.frame(Vec3::new(0.0, self.bottom, 0.0));
        [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
            .map(|(x, z)| self.centre + self.frame(Vec3::new(x, 0.0, z) * (4.0 * self.radius)) + bottom)
    }

    /// The same view for a renderer; None where the bounds are too small or too large to be looked at.
    pub fn camera(&self, zero: DVec3) -> Option<Camera> {
        let target = zero + self.centre.as_dvec3();
        let fov = 2.0 * libm::atan(f64::from(TANGENT));
        Camera::look_at(target + self.eye.as_dvec3(), target, self.frame(Vec3::Y).as_dvec3(), fov)
    }

    /// Rays of each kind of `kinds` but [`Kind::Pixel`], made of `side` x `side` camera rays, whole tiles; `tracer`
    /// finds where those from surfaces start.
    pub fn rays(&self, world: &World, tracer: &dyn Tracer, kinds: &[Kind], side: usize) -> Vec<RaySet> {
        let side = side.next_multiple_of(TILE);
        let mut primary = self.primary(side);
        let orthographic = if kinds.contains(&Kind::Orthographic) { self.orthographic(&primary) } else { Vec::new() };
        let (mut diffuse, mut shadow, mut sun) = (Vec::new(), Vec::new(), Vec::new());
        if kinds.iter().any(|kind| matches!(kind, Kind::Diffuse | Kind::Shadow | Kind::Sun)) {
            let mut hits = vec![None; primary.len()];
            tracer.closest_batch(&primary, &mut hits, Kind::Primary.batch(Width::One));
            let to_light = self.frame(Vec3::new(2.0, 3.0, 1.0));
            let light = self.centre + to_light * self.radius;
            let mut random = Xorshift(12345);
            // In the order of `embree_ref`, for the sake of the random numbers.
            for (i, (ray, hit)) in primary.iter().zip(&hits).enumerate() {
                let Some(hit) = hit else { continue };
                let normal = normal(world, ray, hit);
                let normal = if normal.dot(ray.direction) > 0.0 { normal * -1.0 } else { normal };
                let point = ray.origin + ray.direction * hit.t + normal * (1e-4 * self.radius);
                let direction = (random.in_ball().normalize() + normal * 1.001).normalize();
                let place = place_in_tiles(i, side);
                diffuse.push((place, Ray { tmax: FAR, ..Ray::new(point, direction) }));
                shadow.push((place, Ray { tmax: 0.999, ..Ray::new(point, light - point) }));
                sun.push((place, Ray { tmax: FAR, ..Ray::new(point, to_light) }));
            }
        }
        let in_tiles = |rays: Vec<Ray>| {
            in_order(rays.into_iter().enumerate().map(|(i, ray)| (place_in_tiles(i, side), ray)).collect())
        };
        primary = in_tiles(primary);
        let [diffuse, shadow, sun] = [diffuse, shadow, sun].map(in_order);
        let mut sets = [primary, diffuse, shadow, in_tiles(orthographic), sun].map(Some);
        let set = |&kind: &Kind| sets.get_mut(kind as usize)?.take().map(|rays| RaySet { kind, rays });
        kinds.iter().filter_map(set).collect()
    }

    /// Through the same points of the plane across the camera's way at the centre, from a plane through the eye.
    fn orthographic(&self, primary: &[Ray]) -> Vec<Ray> {
        let way = -self.eye;
        let at_centre = |ray: &Ray| ray.direction * (way.length_squared() / ray.direction.dot(way));
        primary.iter().map(|ray| Ray { origin: ray.origin + at_centre(ray) - way, direction: way, ..*ray }).collect()
    }

    /// Block by block, the blocks in rows across the picture.
    fn primary(&self, side: usize) -> Vec<Ray> {
        let eye = self.centre + self.eye;
        let forward = (self.centre - eye).normalize();
        let right = forward.cross(self.frame(Vec3::Y)).normalize();
        let up = right.cross(forward);
        let of = |pixel: usize| (pixel as f32 + 0.5) / side as f32 * 2.0;
        let mut rays = Vec::with_capacity(side * side);
        for (block_y, block_x) in (0..side).step_by(BLOCK).flat_map(|y| (0..side).step_by(BLOCK).map(move |x| (y, x))) {
            for (y, x) in (0..BLOCK).flat_map(|y| (0..BLOCK).map(move |x| (y, x))) {
                let (a, b) = ((of(block_x + x) - 1.0) * TANGENT, (1.0 - of(block_y + y)) * TANGENT);
                let direction = (forward + right * a + up * b).normalize();
                rays.push(Ray { tmax: FAR, ..Ray::new(eye, direction) });
            }
        }
        rays
    }
}

/// Where a camera ray, by its number among blocks in rows, stands among blocks in tiles.
fn place_in_tiles(ray: usize, side: usize) -> usize {
    const ACROSS: usize = TILE / BLOCK;
    let (block, within) = (ray / (BLOCK * BLOCK), ray % (BLOCK * BLOCK));
    let (x, y) = (block % (side / BLOCK), block / (side / BLOCK));
    let tile = y / ACROSS * (side / TILE) + x / ACROSS;
    tile * TILE * TILE + (y % ACROSS * ACROSS + x % ACROSS) * BLOCK * BLOCK + within
}

fn in_order(mut rays: Vec<(usize, Ray)>) -> Vec<Ray> {
    rays.sort_unstable_by_key(|(place, _)| *place);
    rays.into_iter().map(|(_, ray)| ray).collect()
}

/// The unit normal of what was hit, of either sign.
fn normal(world: &World, ray: &Ray, hit: &Hit) -> Vec3 {
    let (part, placement) = world.locate(hit);
    match &part.primitives {
        Primitives::Triangles { positions, triangles } => {
            let corners = triangles[hit.primitive as usize].map(|i| positions[i as usize]);
            let [a, b, c] = corners.map(|p| placement.map_or(p, |at| at.to_world.transform_point3(p)));
            (b - a).cross(c - a).normalize()
        }
        Primitives::Shapes(shapes) => {
            let shape = &shapes[hit.primitive as usize];
            let point = (ray.origin + ray.direction * hit.t).as_dvec3();
            let Some(at) = placement else { return shape.normal(point).as_vec3() };
            let normal = shape.normal(at.to_object.transform_point3(point));
            (at.to_object.matrix3.transpose() * normal).normalize().as_vec3()
        }
    }
}

/// Marsaglia 2003, *Xorshift RNGs*, with 32 bits.
struct Xorshift(u32);

impl Xorshift {
    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in the unit ball, but not at its centre.
    fn in_ball(&mut self) -> Vec3 {
        loop {
            let [x, y, z] = [(); 3].map(|()| self.unit() * 2.0 - 1.0);
            let v = Vec3::new(x, y, z);
            if (1e-4..=1.0).contains(&v.length_squared()) {
                return v;
            }
        }
    }
}
