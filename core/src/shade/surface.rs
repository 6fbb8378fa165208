//! What stands where a ray hit: position, normals, parameters.
//!
//! A [`Hit`] is trusted for its ids alone. Position and parameters are computed again from the primitive, in f64 and by
//! one piece of code, so where two engines name the same primitive they give the same [`SurfacePoint`] to the bit. The
//! simpler way, `origin + t * direction` from the engine's t, would carry every engine's own rounding into the picture
//! and put the point off the surface by an error that grows with the distance travelled.

use crate::math::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3, Vec4, cofactor, gamma, gamma64};
use crate::ray::{Hit, Ray};
use crate::scene::{Geometry, Mesh, Scene, Texture};
use crate::shape::{Shape, ShapeHit};
use crate::trace::{Placement, Primitives, World};

/// Chained roundings of an f32 ray-triangle test, in both its forms (Möller and Trumbore 1997; Woop, Benthin and Wald
/// 2013): differences from the ray's origin or a corner, a cross product, a dot product; doubled for the sums over
/// three axes and rounded up.
const TEST_ROUNDINGS: u32 = 32;

/// Roundings by which such a test may be off in the height of a ray's origin above the plane, in units of the longest
/// edge cubed over twice the area. Added up as if all were as large as they can be and on the same side they are 13; on
/// planes of 1 to 10,000 units, seen and lit at all angles, Embree's rays met the plane again with a quarter (one
/// in 160) and a half (one in 36,000), and not with 1. What is added here is missing from shadows of what stands on the
/// triangle.
const HEIGHT_ROUNDINGS: u32 = 4;

/// What of a surface is wanted besides its position and its geometric normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attributes {
    /// Interpolated shading normals.
    pub normals: bool,
    /// Texture coordinates.
    pub uvs: bool,
    /// Vertex colours.
    pub colors: bool,
}

impl Attributes {
    /// Everything that the scene has.
    pub const ALL: Self = Self { normals: true, uvs: true, colors: true };
}

/// A point on a surface, as seen along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Distance from the ray's origin in units of its direction.
    pub t: f64,
    /// The hit's parameters: weights of a triangle's second and third corner; a shape's own.
    pub parameters: [f64; 2],
    /// Where, in world coordinates (recentred scene units).
    pub position: DVec3,
    /// How far along the normal the surface may seem to be from `position` to an f32 intersection test.
    pub error: f64,
    /// Unit geometric normal, turned towards the viewer.
    pub normal: DVec3,
    /// Unit shading normal, on the same side; the geometric normal where the mesh has none or it is zero.
    pub shading_normal: DVec3,
    /// From `position` to the smooth surface that normals of vertices stand for; zero where there is none, or where the
    /// triangle bulges more than it does.
    pub lift: DVec3,
    /// Unit normal of the surface by which it is told on which side a direction leaves: where the surface is lifted,
    /// that between the vertices; else the geometric one.
    pub horizon: DVec3,
    /// Whether the viewer sees the front: triangles wind counter-clockwise (clockwise under a mirroring transform),
    /// shapes are seen from outside.
    pub front: bool,
    /// Texture coordinates, v up; zero where there are none.
    pub uv: Vec2,
    /// Those of the second set.
    pub second_uv: Vec2,
    /// Linear RGBA of the vertices; white where there is none.
    pub color: Vec4,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// When it was seen, which is when rays that leave it look: see [`Ray::time`].
    pub time: f32,
}

/// A triangle of a mesh where it stands.
struct Facet {
    corners: [DVec3; 3],
    /// The linear part of its transform.
    linear: DMat3,
    /// Along which it is seen.
    direction: DVec3,
}

impl SurfacePoint {
    /// The point that `hit` names on `ray`.
    pub fn new(scene: &Scene, world: &World, ray: &Ray, hit: &Hit, attributes: Attributes) -> Self {
        let (part, placement) = world.locate(hit);
        let placement = placement.map(|placement| placement.at(ray.moment()));
        let placement = placement.as_deref();
        let geometry = &scene.geometries[hit.geometry as usize];
        let instance = &scene.instances[hit.instance as usize];
        let linear = match placement {
            Some(placement) if instance.transform_end.is_some() => placement.to_world.as_daffine3().matrix3,
            _ => instance.transform.matrix3,
        };
        let mut point = match &part.primitives {
            Primitives::Triangles { positions, triangles } => {
                let local = triangles[hit.primitive as usize].map(|i| positions[i as usize].as_dvec3());
                let corners = placement.map_or(local, |placement| {
                    let to_world = placement.to_world.as_daffine3();
                    local.map(|p| to_world.transform_point3(p))
                });
                let mut point = on_triangle(ray, placement, corners);
                if linear.determinant() < 0.0 {
                    point.front = !point.front;
                }
                if let Geometry::Mesh(mesh) = geometry {
                    let seen = Facet { corners, linear, direction: ray.direction.as_dvec3() };
                    point.interpolate(mesh, hit.primitive, &seen, attributes);
                }
                point
            }
            Primitives::Shapes(shapes) => on_shape(ray, placement, &shapes[hit.primitive as usize], hit.t),
        };
        point.material = geometry.material();
        point
    }

    /// A point with everything that follows from where it is and which way it faces.
    fn facing(ray: &Ray, position: DVec3, outwards: DVec3, error: f64) -> Self {
        let direction = ray.direction.as_dvec3();
        let front = outwards.dot(direction) <= 0.0;
        let normal = if front { outwards } else { -outwards };
        Self {
            t: (position - ray.origin.as_dvec3()).dot(direction) / direction.length_squared(),
            parameters: [0.0; 2],
            position,
            error,
            normal,
            shading_normal: normal,
            lift: DVec3::ZERO,
            horizon: normal,
            front,
            uv: Vec2::ZERO,
            second_uv: Vec2::ZERO,
            color: Vec4::ONE,
            material: 0,
            time: ray.moment(),
        }
    }

    /// Fills in what the mesh gives at its vertices.
    fn interpolate(&mut self, mesh: &Mesh, triangle: u32, seen: &Facet, attributes: Attributes) {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let [u, v] = self.parameters;
        let weights = [1.0 - u - v, u, v];
        if attributes.normals && !mesh.normals.is_empty() {
            let to_world = cofactor(&seen.linear);
            let normals = corners.map(|i| mesh.normals[i].as_dvec3());
            let normal = (0..3).map(|k| normals[k] * weights[k]).sum::<DVec3>();
            if let Some(normal) = (to_world * normal).try_normalize() {
                let side = if normal.dot(self.normal) < 0.0 { -1.0 } else { 1.0 };
                self.shading_normal = normal * side;
                // Not where the normal leans away from the viewer, to whom no smooth surface would show that side.
                if seen.direction.dot(self.shading_normal) < 0.0 {
                    self.lift_over(&seen.corners, normals.map(|normal| to_world * normal * side), weights);
                }
            }
        }
        if attributes.uvs {
            let at = |uvs: &[Vec2]| (0..3).map(|k| uvs[corners[k]].as_dvec2() * weights[k]).sum::<DVec2>().as_vec2();
            for (uv, uvs) in [(&mut self.uv, &mesh.uvs), (&mut self.second_uv, &mesh.second_uvs)] {
                if !uvs.is_empty() {
                    *uv = at(uvs);
                }
            }
        }
        if attributes.colors && !mesh.colors.is_empty() {
            let color = (0..3).map(|k| mesh.colors[corners[k]].as_dvec4() * weights[k]).sum::<glam::DVec4>();
            self.color = color.as_vec4();
        }
    }

    /// Lifts the point to the smooth surface: to between the planes through the vertices, across their normals, where
    /// they are above it (Hanika 2021, *Hacking the shadow terminator*, in Ray tracing gems II). Rays that left the
    /// triangle itself would meet its neighbours where light grazes, and show them as dark facets.
    fn lift_over(&mut self, corners: &[DVec3; 3], normals: [DVec3; 3], weights: [f64; 3]) {
        let mut lift = DVec3::ZERO;
        for k in 0..3 {
            let (normal, square) = (normals[k], normals[k].length_squared());
            let below = (corners[k] - self.position).dot(normal);
            if below > 0.0 && square > 0.0 {
                lift += normal * (weights[k] * below / square);
            }
        }
        if lift != DVec3::ZERO && lift.is_finite() {
            (self.lift, self.horizon) = (lift, self.shading_normal);
        }
    }

    /// Whether a direction leaves the surface on the viewer's side.
    #[inline]
    pub fn is_above(&self, direction: DVec3) -> bool {
        direction.dot(self.horizon) >= 0.0
    }

    /// The coordinates by which `texture` lies on the surface.
    pub fn uv_of(&self, texture: &Texture) -> Vec2 {
        if texture.on_second_uvs { self.second_uv } else { self.uv }
    }

    /// A ray that leaves the surface and does not meet it again at once.
    ///
    /// It starts beside `position`, lifted to the smooth surface if it leaves above, by the error bound, on the side
    /// `direction` points to, and every coordinate is rounded away from the surface (Pharr, Jakob and Humphreys
    /// 2016, *Physically Based Rendering* 3.9; Wächter and Binder 2019, *A fast and robust method for avoiding
    /// self-intersection*). A fixed epsilon would be too small for large scenes and would lose the shadows of small
    /// ones.
    pub fn spawn(&self, direction: Vec3, tmax: f32) -> Ray {
        Ray { origin: self.start(direction.as_dvec3()), direction, tmin: 0.0, tmax, time: self.time }
    }

    /// How far beyond `position` a ray starts, along itself, that left the surface: by how much its way is longer than
    /// its t says.
    pub fn ahead(&self, ray: &Ray) -> f32 {
        let direction = ray.direction.as_dvec3();
        ((ray.origin.as_dvec3() - self.position).dot(direction) / direction.length()) as f32
    }

    /// A ray that leaves the surface and ends just short of `target` (world coordinates), at t = 1.
    pub fn spawn_to(&self, target: DVec3) -> Ray {
        let origin = self.start(target - self.position);
        let direction = (target - origin.as_dvec3()).as_vec3();
        Ray { origin, direction, tmin: 0.0, tmax: 1.0 - gamma(TEST_ROUNDINGS), time: self.time }
    }

    fn start(&self, direction: DVec3) -> Vec3 {
        let (from, away) = match self.is_above(direction) {
            true => (self.position + self.lift, self.normal),
            false => (self.position, -self.normal),
        };
        let exact = from + away * self.error;
        Vec3::new(round_towards(exact.x, away.x), round_towards(exact.y, away.y), round_towards(exact.z, away.z))
    }
}

/// The nearest f32 that is not on the other side of `x` than `side` points to.
fn round_towards(x: f64, side: f64) -> f32 {
    let rounded = x as f32;
    if side > 0.0 && f64::from(rounded) < x {
        rounded.next_up()
    } else if side < 0.0 && f64::from(rounded) > x {
        rounded.next_down()
    } else {
        rounded
    }
}

fn on_triangle(ray: &Ray, placement: Option<&Placement>, [a, b, c]: [DVec3; 3]) -> SurfacePoint {
    let (e1, e2) = (b - a, c - a);
    let [u, v] = barycentrics(ray, a, e1, e2);
    let position = a + e1 * u + e2 * v;
    let cross = e1.cross(e2);
    // Without an area the triangle faces the viewer.
    let outwards = cross.try_normalize().unwrap_or_else(|| -ray.direction.as_dvec3().normalize());

    // An f32 test takes the distance from the plane as a triple product of edges and origin - corner. Its rounding
    // error is proportional to the longest edge cubed, over twice the area: for slivers, more than the edge. Where
    // that leaves no sensible offset, an eighth of the edge is the most that is spent.
    let longest = e1.length_squared().max(e2.length_squared()).max((c - b).length_squared()).sqrt();
    let condition = longest * longest / cross.length();
    let relative = (f64::from(gamma(HEIGHT_ROUNDINGS)) * condition).min(0.125);
    let terms = a.abs() + e1.abs() + e2.abs();
    let error = relative * longest + rounding_error(position, outwards, placement, terms);
    SurfacePoint { parameters: [u, v], ..SurfacePoint::facing(ray, position, outwards, error) }
}

/// Weights of the second and the third corner where the ray meets the triangle's plane (Möller and Trumbore 1997,
/// *Fast, minimum storage ray/triangle intersection*), clamped to the triangle: an f32 engine may name a triangle that
/// the ray misses by a rounding error.
fn barycentrics(ray: &Ray, a: DVec3, e1: DVec3, e2: DVec3) -> [f64; 2] {
    let (from_a, direction) = (ray.origin.as_dvec3() - a, ray.direction.as_dvec3());
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    let (u, v) = (from_a.dot(p) / determinant, direction.dot(from_a.cross(e1)) / determinant);
    if !(u.is_finite() && v.is_finite()) {
        // The ray lies in the plane: any point of the triangle is as good.
        return [1.0 / 3.0; 2];
    }
    let (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
    let sum = (u + v).max(1.0);
    [u / sum, v / sum]
}

fn on_shape(ray: &Ray, placement: Option<&Placement>, shape: &Shape, t: f32) -> SurfacePoint {
    let to_world = placement.map_or(DAffine3::IDENTITY, |p| p.to_world.as_daffine3());
    let local = placement.map_or(*ray, |p| p.object_ray(ray));
    // A named shape that f64 says is missed is met where the ray comes closest to what the engine said.
    let root = select_root(shape, &local, t).unwrap_or(ShapeHit { t: f64::from(t), uv: Vec2::ZERO });
    let (from, along) = (local.origin.as_dvec3(), local.direction.as_dvec3() * root.t);
    let on_shape = from + along;
    let position = to_world.transform_point3(on_shape);
    let normal = cofactor(&to_world.matrix3) * shape.normal(on_shape);
    let outwards = normal.try_normalize().unwrap_or_else(|| -ray.direction.as_dvec3().normalize());
    // Not relative to where the point is, for it may be zero: what f64 rounds off on the way there, and of the shape's
    // own numbers; none of a plane.
    let extent = shape.bounds().size().max(Vec3::ZERO).as_dvec3();
    let terms = to_world.matrix3.abs() * (from.abs() + along.abs() + extent);
    // Every engine tests shapes in f64, so f32 rounds nothing but where rays begin in the coordinates of an object.
    let error = rounding_error(position, outwards, placement, terms);
    SurfacePoint {
        parameters: [f64::from(root.uv.x), f64::from(root.uv.y)],
        uv: root.uv,
        ..SurfacePoint::facing(ray, position, outwards, error)
    }
}

/// Of the first two intersections the one nearest to `t`.
fn select_root(shape: &Shape, ray: &Ray, t: f32) -> Option<ShapeHit> {
    let whole = Ray { tmax: f32::INFINITY, ..*ray };
    let mut crossings = shape.crossings(&whole);
    let first = crossings.next()?;
    let second = crossings.find(|&second| second as f32 > first as f32);
    let distance = |crossing: f64| (crossing - f64::from(t)).abs();
    let nearest = second.filter(|&second| distance(second) < distance(first)).unwrap_or(first);
    Some(shape.hit_at(ray, nearest))
}

/// How far along `normal` f64 may have moved `position`, which was computed of `terms`, and f32 a ray's origin there on
/// its way into the coordinates of a placed object, and back.
fn rounding_error(position: DVec3, normal: DVec3, placement: Option<&Placement>, terms: DVec3) -> f64 {
    let computed = gamma64(TEST_ROUNDINGS) * terms.dot(normal.abs());
    let Some(placement) = placement else { return computed };
    let to_world = placement.to_world.as_daffine3();
    let inverse = &placement.to_object;
    let local = inverse.matrix3.abs() * position.abs() + inverse.translation.abs();
    let error = position.abs() + to_world.matrix3.abs() * local + to_world.translation.abs();
    f64::from(gamma(TEST_ROUNDINGS)) * error.dot(normal.abs()) + computed
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
