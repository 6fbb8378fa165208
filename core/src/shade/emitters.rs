//! Surfaces that glow, as lights.
//!
//! Triangles, disks and boxes are patches: one light, of which a patch is chosen by its power and a point by area.
//! Spheres, and ellipsoids that are round, are lights of their own, sampled by the cone they fill. What stands in a
//! light's place is that light's body. Of all other shapes, of what moves, and of what a texture lights or cuts out, no
//! points are chosen: rays find them by chance, which is as right, and noisier.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use super::area::short_of;
use super::bodies;
use super::light::{LightSample, LightSource};
use crate::math::{Aabb, DAffine3, DMat3, DVec2, DVec3, Vec3, similarity, tangents};
use crate::ray::Hit;
use crate::scene::{Alpha, AreaShape, Light, Material, Scene};
use crate::shape::Shape;
use crate::trace::{Primitives, World};

/// The share of a flat light's area that bodies have to take to cover it: files round.
const COVERED: f64 = 0.99;

/// Flat pieces of surfaces that glow to both sides, in world coordinates.
#[derive(Clone, Debug, Default)]
pub(super) struct Patches {
    patches: Vec<Patch>,
    /// Sums of the patches' areas times their brightness.
    cumulative: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Patch {
    corner: Vec3,
    /// Two sides of a triangle, or two radii of a disk that are perpendicular.
    sides: [Vec3; 2],
    /// Unit, to one of its sides.
    normal: DVec3,
    is_disk: bool,
    emission: Vec3,
}

/// What of what glows is a light, by (instance, geometry).
pub(super) type Glowing = HashMap<(u32, u32), Seats>;

/// How the primitives of a geometry glow.
#[derive(Clone, Debug)]
pub(super) enum Seats {
    /// All alike.
    All(Seat),
    /// Each in its own way.
    Each(Vec<Seat>),
}

/// How a primitive glows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seat {
    /// No light stands for it.
    Alone,
    /// As one of the patches, of this brightness.
    Patch(f64),
    /// It is the body of the light with this number.
    Body(u32),
}

impl Seats {
    /// Of the primitives, in their order.
    fn by_turns(mut seats: impl Iterator<Item = Seat>) -> Self {
        let Some(first) = seats.next() else { return Self::Each(Vec::new()) };
        for (alike, seat) in (1..).zip(seats.by_ref()) {
            if seat != first {
                return Self::Each(std::iter::repeat_n(first, alike).chain([seat]).chain(seats).collect());
            }
        }
        Self::All(first)
    }

    pub(super) fn of(&self, primitive: u32) -> Seat {
        match self {
            Self::All(seat) => *seat,
            Self::Each(seats) => seats[primitive as usize],
        }
    }

    /// The lights that have a body among them.
    pub(super) fn bodies(&self) -> impl Iterator<Item = u32> {
        let seats = match self {
            Self::All(seat) => std::slice::from_ref(seat),
            Self::Each(seats) => seats,
        };
        seats.iter().filter_map(|seat| match seat {
            Seat::Body(light) => Some(*light),
            Seat::Alone | Seat::Patch(_) => None,
        })
    }
}

/// What glows.
pub(super) struct Emitters {
    pub(super) patches: Patches,
    pub(super) glowing: Glowing,
    /// For each light whether its bodies, if it has any, cover it: whether every way to it ends on one.
    pub(super) covered: Vec<bool>,
}

/// Finds what glows. Spheres are added to `lights`, which may have bodies among what is found.
pub(super) fn find(scene: &Scene, world: &World, lights: &mut Vec<LightSource>) -> Emitters {
    let mut search = Search { covers: vec![0.0; lights.len()], lights, patches: Patches::default() };
    let mut glowing = Glowing::new();
    for (instance, geometry) in placed(scene, is_emitter) {
        let material = &scene.materials[scene.geometries[geometry as usize].material() as usize];
        let moves = scene.instances[instance as usize].transform_end.is_some();
        // Where it is bright only its texture knows, whether it is there at all its alpha, and where it is only the
        // time: such a surface may be a light's body, but is no light of its own.
        let is_known = material.emission_texture.is_none() && material.alpha == Alpha::Opaque && !moves;
        let emission = is_known.then_some(material.emission);
        let hit = Hit { t: 0.0, u: 0.0, v: 0.0, primitive: 0, geometry, instance };
        let (part, placement) = world.locate(&hit);
        let to_world = placement.map_or(DAffine3::IDENTITY, |p| p.to_world.as_daffine3());
        let seats = match &part.primitives {
            Primitives::Triangles { positions, triangles } => {
                let corners = |t: &[u32; 3]| t.map(|i| to_world.transform_point3(positions[i as usize].as_dvec3()));
                let ball = search.ball(|light| triangles.iter().all(|t| bodies::has_triangle(light, corners(t))));
                ball.map_or_else(|| Seats::by_turns(search.triangles(triangles, corners, emission)), Seats::All)
            }
            Primitives::Shapes(shapes) => {
                Seats::Each(shapes.iter().map(|shape| search.seat(shape, &to_world, emission)).collect())
            }
        };
        glowing.insert((instance, geometry), seats);
    }
    let Search { lights, covers, patches, .. } = search;
    // What is round has a whole body or none.
    let is_covered = |(i, light): (usize, &LightSource)| match (covers.get(i), light.light()) {
        (Some(area), Some(Light::Area { shape, .. })) => shape.area().is_none_or(|whole| *area >= COVERED * whole),
        _ => true,
    };
    let covered = lights.iter().enumerate().map(is_covered).collect();
    Emitters { patches, glowing, covered }
}

/// Whether anything glows that is no body of `lights`.
pub(super) fn any(scene: &Scene, world: &World, lights: &[LightSource]) -> bool {
    if !lights.iter().filter_map(LightSource::light).any(bodies::may_have) {
        // Then the first that has an area will do, and nothing needs to be gathered.
        return placed(scene, is_emitter)
            .into_iter()
            .any(|(_, geometry)| scene.geometries[geometry as usize].has_area());
    }
    let mut all = lights.to_vec();
    let Emitters { patches, glowing, .. } = find(scene, world, &mut all);
    let is_alone = |seats: &Seats| match seats {
        Seats::All(seat) => *seat == Seat::Alone,
        Seats::Each(seats) => seats.contains(&Seat::Alone),
    };
    patches.total() > 0.0 || all.len() > lights.len() || glowing.values().any(is_alone)
}

/// Whether a material lights others.
pub(super) fn is_emitter(material: &Material) -> bool {
    material.emission != Vec3::ZERO && !material.unlit
}

/// Instance and geometry of everything of certain materials.
fn placed(scene: &Scene, wanted: impl Fn(&Material) -> bool) -> Vec<(u32, u32)> {
    let wanted: Vec<bool> = scene.materials.iter().map(wanted).collect();
    if !wanted.contains(&true) {
        return Vec::new();
    }
    let mut found = Vec::new();
    for (instance, i) in scene.instances.iter().zip(0..) {
        let geometries = scene.group_geometries(instance.group);
        let glow = geometries.filter(|(_, g)| wanted.get(g.material() as usize) == Some(&true));
        found.extend(glow.map(|(g, _)| (i, g)));
    }
    found
}

/// What was found so far.
struct Search<'a> {
    /// The scene's own lights, and after them those of spheres that glow.
    lights: &'a mut Vec<LightSource>,
    /// How much of the area of each of the scene's own flat bodies take.
    covers: Vec<f64>,
    patches: Patches,
}

impl Search<'_> {
    /// The first of the scene's own lights that this is true of.
    fn own(&self, is_it: impl Fn(&Light) -> bool) -> Option<usize> {
        self.lights[..self.covers.len()].iter().position(|light| light.light().is_some_and(&is_it))
    }

    /// The scene's own light, of those that are balls, that something `is_body` of.
    fn ball(&self, is_body: impl Fn(&Light) -> bool) -> Option<Seat> {
        let light = self.own(|light| !bodies::is_flat(light) && is_body(light))?;
        Some(Seat::Body(light as u32))
    }

    /// The same of those that are flat, for something of this area.
    fn panel(&mut self, area: f64, is_body: impl Fn(&Light) -> bool) -> Option<Seat> {
        let light = self.own(|light| bodies::is_flat(light) && is_body(light))?;
        self.covers[light] += area;
        Some(Seat::Body(light as u32))
    }

    /// Of triangles that are no body of a ball, one after the other.
    fn triangles(
        &mut self,
        triangles: &[[u32; 3]],
        corners: impl Fn(&[u32; 3]) -> [DVec3; 3],
        emission: Option<Vec3>,
    ) -> impl Iterator<Item = Seat> {
        triangles.iter().map(move |triangle| {
            let corners = corners(triangle);
            self.panel(area(&corners), |light| bodies::has_triangle(light, corners)).unwrap_or_else(|| {
                self.light(emission, |emission, Self { patches, .. }| {
                    patches.add_triangle(corners, emission);
                    Seat::Patch(brightness(emission))
                })
            })
        })
    }

    /// What `add` makes a light of, where it is known what it sends.
    fn light(&mut self, emission: Option<Vec3>, add: impl FnOnce(Vec3, &mut Self) -> Seat) -> Seat {
        emission.map_or(Seat::Alone, |emission| add(emission, self))
    }

    /// Makes a light of what the matrix `axes` makes of the unit sphere, if that is a ball and no body.
    fn round(&mut self, centre: DVec3, axes: &DMat3, emission: Option<Vec3>) -> Seat {
        let Some(radius) = similarity(axes, ALIKE) else { return Seat::Alone };
        self.ball(|light| bodies::has_sphere(light, centre, radius)).unwrap_or_else(|| {
            self.light(emission, |radiance, Self { lights, .. }| {
                let light = Light::Area { shape: AreaShape::Sphere { centre, radius }, radiance };
                lights.push(LightSource::new(&light, DVec3::ZERO));
                Seat::Body(lights.len() as u32 - 1)
            })
        })
    }

    /// Makes a light or patches of a shape that is no body.
    fn seat(&mut self, shape: &Shape, to_world: &DAffine3, emission: Option<Vec3>) -> Seat {
        let at = |p: Vec3| to_world.transform_point3(p.as_dvec3());
        match shape {
            Shape::Sphere(sphere) => {
                let axes = to_world.matrix3 * f64::from(sphere.radius);
                self.round(at(sphere.centre), &axes, emission)
            }
            Shape::Ellipsoid(ellipsoid) => {
                let axes = to_world.matrix3 * ellipsoid.axes.as_dmat3();
                self.round(at(ellipsoid.centre), &axes, emission)
            }
            Shape::Disk(disk) => {
                if similarity(&to_world.matrix3, ALIKE).is_none() {
                    return Seat::Alone;
                }
                let across = tangents(disk.normal.as_dvec3().normalize())
                    .map(|axis| to_world.matrix3 * axis * f64::from(disk.radius));
                let centre = at(disk.centre);
                let area = PI * across[0].cross(across[1]).length();
                self.panel(area, |light| bodies::has_disk(light, centre, across)).unwrap_or_else(|| {
                    self.light(emission, |emission, search| search.patches.add_disk(centre, across, emission))
                })
            }
            Shape::Cuboid(cuboid) => self.light(emission, |emission, Self { patches, .. }| {
                let corners = Aabb { min: cuboid.min, max: cuboid.max }.corners();
                let corner = |i: usize| at(corners[i]);
                for [a, b, c, d] in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
                {
                    patches.add_triangle([a, b, c].map(corner), emission);
                    patches.add_triangle([a, c, d].map(corner), emission);
                }
                Seat::Patch(brightness(emission))
            }),
            Shape::Polygon(polygon) => {
                let corners: Vec<DVec3> = polygon.corners().iter().map(|&corner| at(corner)).collect();
                self.panel(area(&corners), |light| bodies::has_polygon(light, &corners)).unwrap_or(Seat::Alone)
            }
            Shape::Plane(_) | Shape::Cylinder(_) | Shape::Cone(_) => Seat::Alone,
        }
    }
}

impl Patches {
    fn add_triangle(&mut self, corners: [DVec3; 3], emission: Vec3) {
        let [a, b, c] = corners;
        self.add(a, [b - a, c - a], area(&corners), false, emission);
    }

    fn add_disk(&mut self, centre: DVec3, [x, y]: [DVec3; 2], emission: Vec3) -> Seat {
        self.add(centre, [x, y], x.cross(y).length() * PI, true, emission);
        Seat::Patch(brightness(emission))
    }

    fn add(&mut self, corner: DVec3, sides: [DVec3; 2], area: f64, is_disk: bool, emission: Vec3) {
        if area > 0.0 && area.is_finite() {
            self.cumulative.push(self.total() + area * brightness(emission));
            let sides = sides.map(|side| side.as_vec3());
            let normal = sides[0].as_dvec3().cross(sides[1].as_dvec3()).normalize_or_zero();
            self.patches.push(Patch { corner: corner.as_vec3(), sides, normal, is_disk, emission });
        }
    }

    /// All areas times their brightness.
    pub(super) fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// What arrives at `point` from a place on a patch that `xi` chooses.
    pub(super) fn sample(&self, point: DVec3, xi: DVec2) -> Option<LightSample> {
        let wanted = xi.x * self.total();
        let index = self.cumulative.partition_point(|&sum| sum <= wanted).min(self.patches.len().checked_sub(1)?);
        let before = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        let within = ((wanted - before) / (self.cumulative[index] - before)).clamp(0.0, 1.0);
        let Patch { corner, sides, normal, is_disk, emission } = self.patches[index];
        let [a, b] = sides.map(|side| side.as_dvec3());
        let (x, y) = if is_disk {
            let (radius, angle) = (within.sqrt(), xi.y * TAU);
            (radius * libm::cos(angle), radius * libm::sin(angle))
        } else {
            // Evenly over a triangle (Turk 1990, *Generating random points in triangles*).
            let root = within.sqrt();
            (root * (1.0 - xi.y), root * xi.y)
        };
        let at = corner.as_dvec3() + a * x + b * y;
        let offset = at - point;
        let to_light = offset.try_normalize()?;
        let cosine = normal.dot(to_light).abs();
        let pdf = brightness(emission) / self.total() * offset.length_squared() / cosine;
        let color = emission * (1.0 / (PI * pdf)) as f32;
        let end = Some(short_of(at, to_light, point, cosine));
        (pdf.is_finite() && color.is_finite()).then_some(LightSample { to_light, color, end, pdf: Some(pdf) })
    }
}

/// The area of a flat polygon.
fn area(corners: &[DVec3]) -> f64 {
    let sides = corners.windows(2).map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]));
    sides.sum::<DVec3>().length() / 2.0
}

/// What a map may be off by that is said to scale alike in all directions, which is made of f32.
const ALIKE: f64 = 1e-5;

/// What patches are chosen by, beside their area.
fn brightness(emission: Vec3) -> f64 {
    f64::from(emission.max_element())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The irradiance of two triangles against that of the rectangle they make.
    #[test]
    fn patches_light_like_the_surface_they_make() {
        let corner = |x: f64, z: f64| DVec3::new(x, 2.0, z);
        let mut patches = Patches::default();
        let bright = Vec3::new(1.0, 2.0, 0.5);
        patches.add_triangle([corner(0.0, 0.0), corner(1.5, 0.0), corner(1.5, 0.8)], bright);
        patches.add_triangle([corner(0.0, 0.0), corner(1.5, 0.8), corner(0.0, 0.8)], bright);
        let side = 300;
        let xi = |k: i32| (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
        let each = (0..side * side).filter_map(|k| patches.sample(DVec3::ZERO, xi(k)));
        let mean = each.map(|l| f64::from(l.color.y) * l.to_light.y).sum::<f64>() / f64::from(side * side);
        // Howell's B-3: a parallel rectangle with a corner over the element.
        let (x, y) = (0.75f64, 0.4f64);
        let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        let expected = 2.0 * (x / p * (y / p).atan() + y / q * (x / q).atan()) / TAU;
        assert!((mean / expected - 1.0).abs() < 1e-3, "{mean} {expected}");
    }

    #[test]
    fn similarities_are_told() {
        assert_eq!(similarity(&DMat3::from_diagonal(DVec3::splat(-3.0)), ALIKE), Some(3.0));
        assert_eq!(similarity(&DMat3::from_diagonal(DVec3::new(1.0, 1.0, 2.0)), ALIKE), None);
    }
}
