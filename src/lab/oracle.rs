//! The exact answer for a ray and a primitive of the recentred f32 scene, sharing no code with the tracers.
//!
//! **Triangles.** With corners a, b, c relative to the ray's origin and its direction d, the signs of the edge
//! determinants det(d, b, c), det(d, c, a), det(d, a, b) tell on which side of the edges the ray's line passes. It
//! meets the triangle where none is negative or none is positive, and their sum, which is the scalar product of d and
//! the triangle's normal, is not zero: a ray within the triangle's plane and a triangle without area are misses. A
//! zero among them is a ray through an edge or a corner, and a hit. Then t = det(a, b, c) / sum. The corners of an
//! instanced triangle are `to_world` times its f32 positions, not rounded.
//!
//! **Shapes** are in `exact_shapes`.
//!
//! The determinants are formed from the corners and not from points along the ray, because o + d need not be an f64.
//! Nothing here is tuned for speed but the f64 filter in front of the integers of triangles ([`Approx`]).

use std::cmp::Ordering;

use super::exact::{Approx, Dyadic, Rational, Ring, Vector, det, vector, zip};
use super::exact_shapes::crossings;
use crate::math::{Affine3, Vec3, is_traceable};
use crate::ray::{Hit, Ray};
use crate::shape::Shape;
use crate::trace::{Part, Primitives, World};

/// The order of [`Hit::id`]: instance, geometry, primitive.
pub type Id = (u32, u32, u32);

/// One primitive, where it stands.
#[derive(Clone, Copy, Debug)]
pub struct Primitive<'a> {
    /// What it is, in its own coordinates.
    pub body: Body<'a>,
    /// From its own coordinates to the world's; None where they are the same.
    pub to_world: Option<Affine3>,
}

impl Primitive<'_> {
    /// Whether the native engine's verdict on it is that of exact arithmetic. It is not of shapes that are placed, to
    /// which rays are brought in f64.
    pub fn is_decided_exactly(&self) -> bool {
        match self.body {
            Body::Triangle(_) => true,
            Body::Shape(_) => self.to_world.is_none(),
        }
    }
}

/// What a primitive is.
#[derive(Clone, Copy, Debug)]
pub enum Body<'a> {
    /// Three corners.
    Triangle([Vec3; 3]),
    /// Anything else.
    Shape(&'a Shape),
}

/// Where the line of a ray meets a primitive, in exact arithmetic.
#[derive(Clone, Debug)]
pub struct Meeting {
    /// Distance in units of the ray's direction.
    pub t: Rational,
    /// Whether it merely touches: a triangle's edge or corner, a shape's silhouette.
    pub touches: bool,
    /// Whether t, rounded to f32, lies in the ray's range.
    pub in_range: bool,
    /// Whether t lies within one f32 of an end of the range, so that rounding may decide.
    pub at_range_end: bool,
}

/// The primitive that a hit names, where it stands at a time; None where there is none of that number.
pub fn primitive<'a>(world: &'a World, hit: &Hit, time: f32) -> Option<Primitive<'a>> {
    let (part, placement) = world.locate(hit);
    let body = body(part, hit.primitive as usize)?;
    Some(Primitive { body, to_world: placement.map(|p| p.at(time).to_world) })
}

/// Every primitive as placed at a time, with its id.
pub fn primitives(world: &World, time: f32) -> impl Iterator<Item = (Id, Primitive<'_>)> {
    let fixed = world.parts[world.fixed.clone()].iter().map(|part| (part, part.instance, None));
    let placed = world.placements.iter().flat_map(move |placement| {
        let to_world = placement.at(time).to_world;
        let parts = &world.parts[world.objects[placement.object as usize].clone()];
        parts.iter().map(move |part| (part, placement.instance, Some(to_world)))
    });
    fixed.chain(placed).flat_map(|(part, instance, to_world)| {
        (0..part.primitives.len()).filter_map(move |i| {
            let body = body(part, i)?;
            Some(((instance, part.geometry, i as u32), Primitive { body, to_world }))
        })
    })
}

/// Where the line of `ray` meets the primitive: for a shape that it meets twice, the first time within the ray's range
/// or else the first time. None where it does not, for a ray that is not valid, and for a primitive that cannot be hit.
pub fn meet(ray: &Ray, primitive: &Primitive) -> Option<Meeting> {
    if !ray.is_valid() {
        return None;
    }
    match primitive.body {
        Body::Triangle(corners) => meet_triangle(ray, corners, primitive.to_world.as_ref()),
        Body::Shape(shape) => meet_shape(ray, shape, primitive.to_world.as_ref()),
    }
}

/// The nearest hits of a ray among all primitives: one, none, or several at exactly the same t, by rising id.
pub fn closest(world: &World, ray: &Ray) -> Vec<(Id, Meeting)> {
    let mut nearest: Vec<(Id, Meeting)> = Vec::new();
    for (id, primitive) in primitives(world, ray.moment()) {
        let Some(meeting) = meet(ray, &primitive).filter(|m| m.in_range) else { continue };
        match nearest.first().map(|(_, first)| meeting.t.cmp_root(&first.t)) {
            Some(Ordering::Greater) => continue,
            Some(Ordering::Less) => nearest.clear(),
            Some(Ordering::Equal) | None => {}
        }
        nearest.push((id, meeting));
    }
    nearest.sort_by_key(|(id, _)| *id);
    nearest
}

fn body(part: &Part, index: usize) -> Option<Body<'_>> {
    match &part.primitives {
        Primitives::Triangles { positions, triangles } => {
            triangles.get(index).map(|corners| Body::Triangle(corners.map(|i| positions[i as usize])))
        }
        Primitives::Shapes(shapes) => shapes.get(index).map(Body::Shape),
    }
}

impl Meeting {
    fn new(ray: &Ray, t: Rational, touches: bool) -> Self {
        let rounded = t.to_f64() as f32;
        let near = |end: f32| {
            let (below, above) = (end.next_down(), end.next_up());
            let is_above = |x: f32| x.is_finite() && t >= exact(x);
            let is_below = |x: f32| !x.is_finite() || t <= exact(x);
            end.is_finite() && is_above(below) && is_below(above)
        };
        Self {
            touches,
            in_range: t.to_f64() >= 0.0 && (ray.tmin..=ray.tmax).contains(&rounded),
            at_range_end: near(ray.tmin) || near(ray.tmax),
            t,
        }
    }
}

fn exact(x: f32) -> Rational {
    Rational::new(Dyadic::new(x), Dyadic::new(1.0)).expect("one is not zero")
}

/// A point in the world.
pub(super) fn place<R: Ring>(p: Vec3, to_world: Option<&Affine3>) -> Vector<R> {
    let Some(m) = to_world else { return vector(p) };
    let [x, y, z] = m.matrix3.to_cols_array_2d().map(|column| column.map(R::new));
    let [px, py, pz] = vector::<R>(p);
    let moved = |i: usize| x[i].mul(&px).add(&y[i].mul(&py)).add(&z[i].mul(&pz));
    zip(&[moved(0), moved(1), moved(2)], &vector(m.translation), R::add)
}

/// The corners of a triangle relative to the ray's origin.
pub(super) fn relative<R: Ring>(ray: &Ray, corners: [Vec3; 3], to_world: Option<&Affine3>) -> [Vector<R>; 3] {
    let origin = vector::<R>(ray.origin);
    corners.map(|p| zip(&place(p, to_world), &origin, R::sub))
}

/// The edge determinants opposite to a, b and c, in units of the world.
fn edges<R: Ring>(ray: &Ray, corners: [Vec3; 3], to_world: Option<&Affine3>) -> [R; 3] {
    let d = vector::<R>(ray.direction);
    let [a, b, c] = relative::<R>(ray, corners, to_world);
    [det(&d, &b, &c), det(&d, &c, &a), det(&d, &a, &b)]
}

fn meet_triangle(ray: &Ray, corners: [Vec3; 3], to_world: Option<&Affine3>) -> Option<Meeting> {
    if !corners.into_iter().all(is_traceable) {
        return None;
    }
    let signs = edges::<Approx>(ray, corners, to_world).map(|e| e.signum());
    if signs.contains(&Some(1)) && signs.contains(&Some(-1)) {
        return None;
    }
    let edges = edges::<Dyadic>(ray, corners, to_world);
    let signs = edges.each_ref().map(Dyadic::signum);
    if signs.contains(&1) && signs.contains(&-1) {
        return None;
    }
    let [a, b, c] = relative::<Dyadic>(ray, corners, to_world);
    let t = Rational::new(det(&a, &b, &c), edges[0].add(&edges[1]).add(&edges[2]))?;
    Some(Meeting::new(ray, t, signs.contains(&0)))
}

fn meet_shape(ray: &Ray, shape: &Shape, to_world: Option<&Affine3>) -> Option<Meeting> {
    let meetings = crossings(ray, shape, to_world).into_iter().map(|(t, touches)| Meeting::new(ray, t, touches));
    let meetings: Vec<Meeting> = meetings.collect();
    meetings.iter().find(|meeting| meeting.in_range).or(meetings.first()).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Mat3;
    use crate::shape::Sphere;

    const UNIT: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    fn triangle(corners: [Vec3; 3]) -> Primitive<'static> {
        Primitive { body: Body::Triangle(corners), to_world: None }
    }

    fn down(x: f32, y: f32) -> Ray {
        Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z)
    }

    #[test]
    fn inside_edge_corner_and_outside() {
        let inside = meet(&down(0.25, 0.25), &triangle(UNIT)).unwrap();
        assert_eq!((inside.t.to_f64(), inside.touches, inside.in_range), (1.0, false, true));
        assert!(meet(&down(0.5, 0.5), &triangle(UNIT)).unwrap().touches);
        assert!(meet(&down(0.0, 0.0), &triangle(UNIT)).unwrap().touches);
        assert!(meet(&down(0.5, 0.5f32.next_up()), &triangle(UNIT)).is_none());
        assert!(meet(&down(0.5, (-0.0f32).next_down()), &triangle(UNIT)).is_none());
    }

    #[test]
    fn rays_within_the_plane_and_triangles_without_area_miss() {
        let along = Ray::new(Vec3::new(-1.0, 0.5, 0.0), Vec3::X);
        assert!(meet(&along, &triangle(UNIT)).is_none());
        assert!(meet(&down(0.5, 0.0), &triangle([Vec3::ZERO, Vec3::X, Vec3::X * 0.5])).is_none());
        assert!(meet(&down(0.0, 0.0), &triangle([Vec3::ZERO; 3])).is_none());
        assert!(meet(&down(0.25, 0.25), &triangle([Vec3::NAN, Vec3::X, Vec3::Y])).is_none());
        assert!(meet(&down(0.25, 0.25), &triangle([Vec3::ZERO, Vec3::X * 2e18, Vec3::Y])).is_none());
    }

    #[test]
    fn the_range_is_closed_and_its_ends_are_marked() {
        let with = |tmin: f32, tmax: f32| {
            let m = meet(&Ray { tmin, tmax, ..down(0.25, 0.25) }, &triangle(UNIT)).unwrap();
            (m.in_range, m.at_range_end)
        };
        assert_eq!(with(0.0, 1.0), (true, true));
        assert_eq!(with(1.0, f32::INFINITY), (true, true));
        assert_eq!(with(0.0, 1.0f32.next_down()), (false, true));
        assert_eq!(with(0.0, 0.9), (false, false));
        assert_eq!(with(0.0, f32::MAX), (true, false));
        assert!(meet(&Ray { tmin: 2.0, tmax: 1.0, ..down(0.2, 0.2) }, &triangle(UNIT)).is_none());
    }

    #[test]
    fn scale_does_not_matter() {
        // 1e-44 is a handful of the smallest denormal steps.
        for scale in [1e-44f32, 1e-38, 1e-20, 1.0, 1e10, 9e17] {
            let corners = [Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale];
            let ray = |x: f32, d: f32| Ray::new(Vec3::new(x, scale / 4.0, scale), Vec3::NEG_Z * d);
            for d in [f32::MIN_POSITIVE, 1.0, f32::MAX] {
                let m = meet(&ray(scale / 4.0, d), &triangle(corners)).unwrap();
                assert!(!m.touches);
                assert_eq!(m.t.to_f64(), f64::from(scale) / f64::from(d));
                assert!(meet(&ray(-scale / 4.0, d), &triangle(corners)).is_none(), "{scale} {d}");
            }
        }
    }

    #[test]
    fn a_placed_triangle_is_the_moved_triangle() {
        // Powers of two: the moved corners are f32.
        let m =
            Affine3 { matrix3: Mat3::from_diagonal(Vec3::new(2.0, 4.0, -1.0)), translation: Vec3::new(8.0, 0.0, 2.0) };
        let placed = Primitive { body: Body::Triangle(UNIT), to_world: Some(m) };
        let moved = triangle(UNIT.map(|p| m.transform_point3(p)));
        for (x, y) in [(8.5, 0.5), (9.0, 2.0), (9.0, 2.1), (8.0, 0.0), (7.9, 1.0)] {
            let ray = Ray::new(Vec3::new(x, y, 3.5), Vec3::new(0.0, 0.0, -3.0));
            let (a, b) = (meet(&ray, &placed), meet(&ray, &moved));
            assert_eq!(a.map(|m| (m.t, m.touches)), b.map(|m| (m.t, m.touches)));
        }
    }

    #[test]
    fn spheres_in_closed_form() {
        let sphere = Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 1.0 });
        let ball = Primitive { body: Body::Shape(&sphere), to_world: None };
        let at = |y: f32| Ray::new(Vec3::new(-3.0, y, 0.0), Vec3::X);
        assert_eq!(meet(&at(0.0), &ball).unwrap().t.to_f64(), 2.0);
        assert!(meet(&at(1.0), &ball).unwrap().touches);
        assert!(meet(&at(1f32.next_up()), &ball).is_none());
        // 3 - sqrt(1 - (1 - 2^-24)^2), a hair within the silhouette.
        let y = f64::from(1f32.next_down());
        let t = meet(&at(y as f32), &ball).unwrap().t.to_f64();
        assert!((t - (3.0 - ((1.0 - y) * (1.0 + y)).sqrt())).abs() < 1e-15);
        assert_eq!(meet(&Ray::new(Vec3::ZERO, Vec3::X), &ball).unwrap().t.to_f64(), 1.0);

        let m = Affine3 { matrix3: Mat3::from_diagonal(Vec3::new(2.0, 1.0, 1.0)), translation: Vec3::X };
        let egg = Primitive { to_world: Some(m), ..ball };
        assert_eq!(meet(&at(0.0), &egg).unwrap().t.to_f64(), 2.0);
        assert_eq!(meet(&Ray::new(Vec3::new(1.0, 4.0, 0.0), Vec3::NEG_Y), &egg).unwrap().t.to_f64(), 3.0);
    }

    #[test]
    fn a_huge_sphere_keeps_every_digit_of_t() {
        let ground = Shape::Sphere(Sphere { centre: Vec3::new(0.0, -1e6, 0.0), radius: 1e6 });
        let ball = Primitive { body: Body::Shape(&ground), to_world: None };
        let t = meet(&Ray::new(Vec3::Y, Vec3::NEG_Y), &ball).unwrap().t.to_f64();
        assert_eq!(t, 1.0);
        // Start exactly on it, look up along the outside: t = 0, or the far side is behind.
        let t = meet(&Ray::new(Vec3::ZERO, Vec3::Y), &ball).unwrap().t.to_f64();
        assert_eq!(t, 0.0);
    }

    #[test]
    fn closest_names_all_that_tie() {
        let mesh = crate::scene::Mesh::new(
            vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::NEG_Z],
            vec![[0, 1, 2], [1, 2, 0], [3, 1, 2]],
        );
        let scene = crate::Scene::from_geometries(vec![crate::scene::Geometry::Mesh(mesh)], vec![Default::default()]);
        let world = World::new(&scene).unwrap();
        let ids: Vec<Id> = closest(&world, &down(0.25, 0.25)).into_iter().map(|(id, _)| id).collect();
        assert_eq!(ids, [(0, 0, 0), (0, 0, 1)]);
        assert!(closest(&world, &down(2.0, 0.25)).is_empty());
    }

    #[test]
    fn spheres_tie_where_their_roots_are_one_though_not_rational() {
        let ball = |x: f32, z: f32| Shape::Sphere(Sphere { centre: Vec3::new(x, -0.75, z), radius: 0.625 });
        let shapes = vec![ball(1.0, 0.75), ball(0.875, 0.375), ball(0.875, 0.375f32.next_down())];
        let scene = crate::Scene::from_geometries(
            vec![crate::scene::Geometry::Shapes { shapes, material: 0 }],
            vec![Default::default()],
        );
        let world = World::new(&scene).unwrap();
        // Both axes pass it at sqrt(5 / 64), so that it meets both at (63.375 - sqrt(5 / 16)) / 4.
        let found = closest(&world, &Ray::new(Vec3::new(0.75, -64.125, 0.625), Vec3::Y * 4.0));
        assert_eq!(found.iter().map(|(id, _)| id.2).collect::<Vec<_>>(), [0, 1]);
    }
}
