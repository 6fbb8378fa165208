//! Every shape against exact arithmetic, on rays made to be difficult. Here, since the yardstick
//! ([`exact_shapes`](super::exact_shapes)) is here.

use std::sync::Arc;

use crate::lab::exact_shapes::crossings;
use crate::math::{DVec3, Mat3, Random, Vec3};
use crate::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Plane, Polygon, Ray, Shape, ShapeHit, Sphere};

/// What is made at random. A new shape is listed here, and the compiler asks for the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Sphere,
    Plane,
    LevelDisk,
    Disk,
    Cuboid,
    UprightCylinder,
    Cylinder,
    UprightCone,
    Cone,
    Ellipsoid,
    GridPolygon,
    Star,
}

impl Kind {
    const ALL: [Self; 12] = [
        Self::Sphere,
        Self::Plane,
        Self::LevelDisk,
        Self::Disk,
        Self::Cuboid,
        Self::UprightCylinder,
        Self::Cylinder,
        Self::UprightCone,
        Self::Cone,
        Self::Ellipsoid,
        Self::GridPolygon,
        Self::Star,
    ];

    /// Whether centres and radii are on a grid, so that rays along the axes touch exactly.
    const fn is_on_grid(self) -> bool {
        matches!(self, Self::Sphere | Self::LevelDisk | Self::UprightCylinder | Self::UprightCone)
    }

    /// Whether rays touch edges, rims and silhouettes often: corners are f32 numbers, or on a grid.
    const fn touches(self) -> bool {
        !matches!(self, Self::Plane | Self::Disk | Self::Cylinder | Self::Cone | Self::Ellipsoid)
    }

    /// Those with an inside, of which capped ones are closed.
    fn solid() -> impl Iterator<Item = Self> {
        let is_flat =
            |kind: &Self| matches!(kind, Self::Plane | Self::LevelDisk | Self::Disk | Self::GridPolygon | Self::Star);
        Self::ALL.into_iter().filter(move |kind| !is_flat(kind))
    }
}

/// One of a kind, of about the size 1, near zero; points that rays are aimed at: corners, rims, poles.
fn sample(kind: Kind, random: &mut Random) -> (Shape, Vec<Vec3>) {
    let v = |random: &mut Random| random.vector();
    let is_grid = kind.is_on_grid();
    let centre = if is_grid { (v(random) * 8.0).round() / 8.0 } else { v(random) };
    let radius = if is_grid { (1 + random.below(8)) as f32 / 8.0 } else { 0.05 + random.unit() };
    let (shape, mut targets) = match kind {
        Kind::Sphere => {
            (Shape::Sphere(Sphere { centre, radius }), vec![centre + Vec3::X * radius, centre - Vec3::Z * radius])
        }
        Kind::Plane => (Shape::Plane(Plane::new(centre, v(random)).unwrap()), vec![centre]),
        Kind::LevelDisk => (Shape::Disk(Disk::new(centre, Vec3::Y, radius).unwrap()), vec![centre + Vec3::X * radius]),
        Kind::Disk => (Shape::Disk(Disk::new(centre, v(random), radius).unwrap()), vec![centre]),
        Kind::Cuboid => {
            let (p, q) = (v(random), v(random));
            let cuboid = Cuboid::new(p.min(q), p.max(q)).unwrap();
            (Shape::Cuboid(cuboid), vec![p, q, Vec3::new(p.x, q.y, p.z), Vec3::new(q.x, q.y, p.z)])
        }
        Kind::UprightCylinder | Kind::Cylinder => {
            let (base, apex) = (centre, if kind == Kind::UprightCylinder { centre + Vec3::Y } else { v(random) });
            let capped = random.below(2) == 0;
            let cylinder = Cylinder::new(base, apex, radius, capped).unwrap();
            (Shape::Cylinder(cylinder), vec![base, apex, base + Vec3::X * radius, base - Vec3::Z * radius])
        }
        Kind::UprightCone | Kind::Cone => {
            let (base, apex) = (centre, if kind == Kind::UprightCone { centre + Vec3::Y } else { v(random) });
            let apex_radius = if random.below(2) == 0 { 0.0 } else { random.unit() };
            let cone = Cone::new(base, radius, apex, apex_radius, random.below(2) == 0).unwrap();
            (Shape::Cone(cone), vec![base, apex, base + Vec3::X * radius, base - Vec3::Z * radius])
        }
        Kind::Ellipsoid => {
            let axes = Mat3::from_cols(v(random), v(random), v(random));
            (Shape::Ellipsoid(Ellipsoid::new(centre, axes).unwrap()), vec![centre + axes.x_axis])
        }
        Kind::GridPolygon => {
            // Flat, concave, with corners on a grid: many are in a row.
            let corners =
                [(0, 0), (2, 0), (2, 1), (3, 0), (4, 0), (4, 3), (3, 3), (3, 1), (2, 2), (1, 2), (1, 1), (0, 1)];
            let corners: Vec<Vec3> = corners.map(|(x, y)| Vec3::new(x as f32 / 4.0, y as f32 / 4.0, 0.25)).to_vec();
            (Shape::Polygon(Arc::new(Polygon::new(corners.clone()).unwrap())), corners)
        }
        Kind::Star => {
            // A star in a plane at random, so that its corners are off it by their rounding.
            let n = 5 + random.below(30) as usize;
            let (x, y) = (v(random), v(random));
            let corner = |i: usize| {
                let angle = i as f32 / n as f32 * std::f32::consts::TAU;
                centre + (x * angle.cos() + y * angle.sin()) * (0.3 + 0.7 * random.unit())
            };
            let corners: Vec<Vec3> = (0..n).map(corner).collect();
            (Shape::Polygon(Arc::new(Polygon::new(corners.clone()).unwrap())), corners)
        }
    };
    targets.push(centre);
    (shape, targets)
}

/// The same shape, times a power of two, which rounds nothing.
fn scaled(shape: &Shape, s: f32) -> Shape {
    match shape {
        Shape::Sphere(x) => Shape::Sphere(Sphere { centre: x.centre * s, radius: x.radius * s }),
        Shape::Plane(x) => Shape::Plane(Plane { point: x.point * s, ..*x }),
        Shape::Disk(x) => Shape::Disk(Disk { centre: x.centre * s, radius: x.radius * s, ..*x }),
        Shape::Cuboid(x) => Shape::Cuboid(Cuboid { min: x.min * s, max: x.max * s }),
        Shape::Cylinder(x) => {
            Shape::Cylinder(Cylinder { base: x.base * s, apex: x.apex * s, radius: x.radius * s, ..*x })
        }
        Shape::Cone(x) => Shape::Cone(Cone {
            base: x.base * s,
            apex: x.apex * s,
            base_radius: x.base_radius * s,
            apex_radius: x.apex_radius * s,
            ..*x
        }),
        Shape::Ellipsoid(x) => Shape::Ellipsoid(Ellipsoid { centre: x.centre * s, axes: x.axes * s }),
        Shape::Polygon(x) => {
            Shape::Polygon(Arc::new(Polygon::new(x.corners().iter().map(|p| *p * s).collect()).unwrap()))
        }
    }
}

/// A ray at a shape with these targets: aimed at them, past them by a hair, along axes through them, from inside, at
/// random.
fn nasty(targets: &[Vec3], random: &mut Random) -> Ray {
    let target = targets[random.below(targets.len() as u64) as usize];
    let other = targets[random.below(targets.len() as u64) as usize];
    let far = [0.3, 3.0, 3.0, 3.0, 1e3, 1e6][random.below(6) as usize];
    let origin = random.vector() * far;
    let axis = Vec3::AXES[random.below(3) as usize] * if random.below(2) == 0 { 1.0 } else { -1.0 };
    let direction = match random.below(8) {
        0 => random.vector(),
        1 | 2 => target - origin,
        3 => target + random.vector() * 1e-6 - origin,
        4 => target + random.vector() - origin,
        5 => (target + other) * 0.5 - origin,
        6 => return Ray::new(target - axis * 4.0, axis),
        // In a plane of the axes, on a grid: corners in a row.
        _ => {
            let step = |random: &mut Random| (random.below(9) as f32 - 4.0) * 0.25;
            let way = Vec3::new(step(random), step(random), step(random)) - axis;
            return Ray::new(target - way * 4.0, way);
        }
    };
    Ray::new(origin, direction)
}

#[track_caller]
fn assert_exact(shape: &Shape, ray: &Ray) -> usize {
    let whole = |ray: &Ray| shape.intersect_all(ray).map(|hit| hit.t).collect::<Vec<f64>>();
    let backwards = |mut t: Vec<f64>| {
        t.reverse();
        t.iter().map(|t| -t).collect::<Vec<_>>()
    };
    // Both halves of the line; a t of zero is in both.
    let mut found = backwards(whole(&Ray { direction: -ray.direction, ..*ray }));
    found.retain(|&t| t as f32 != 0.0);
    found.extend(whole(ray));
    let exact = crossings(ray, shape, None);
    let t: Vec<f64> = exact.iter().map(|(t, _)| t.to_f64()).filter(|t| (*t as f32).is_finite()).collect();
    // A solid's crossings of an edge or a rim count for each face: the first and the last remain.
    let is_solid = matches!(shape, Shape::Cuboid(_))
        || matches!(shape, Shape::Cylinder(Cylinder { capped: true, .. }) | Shape::Cone(Cone { capped: true, .. }));
    let t: Vec<f64> = if is_solid { [t.first(), t.last()].into_iter().flatten().copied().collect() } else { t };
    // At its tip a whole cone is crossed once, or each half of the double one is: twice at the same t.
    let is_whole = matches!(shape, Shape::Cone(cone) if cone.base_radius.min(cone.apex_radius) == 0.0);
    let mut t = t;
    if is_whole && found.len() < t.len() {
        t.dedup();
    }
    assert_eq!(found.len(), t.len(), "{shape:?} {ray:?}: {found:?}, exactly {t:?}");
    for (found, exact) in found.iter().zip(&t) {
        assert!(
            (found - exact).abs() <= exact.abs() / f64::from(1 << 26),
            "{shape:?} {ray:?}: {found}, exactly {exact}"
        );
    }
    t.len()
}

#[test]
fn verdicts_are_exact_and_t_is_within_its_bound_at_every_scale() {
    for kind in Kind::ALL {
        let (mut hits, mut touches) = (0, 0);
        for case in 0..3000 {
            let mut random = Random::new(kind as u64, case);
            let (shape, targets) = sample(kind, &mut random);
            let ray = nasty(&targets, &mut random);
            if !ray.is_valid() {
                continue;
            }
            let scale = 2f32.powi([0, 0, -40, 40, 17][random.below(5) as usize]);
            let shape = scaled(&shape, scale);
            let ray = Ray::new(ray.origin * scale, ray.direction * 2f32.powi(random.below(60) as i32 - 30));
            hits += usize::from(assert_exact(&shape, &ray) > 0);
            touches += usize::from(crossings(&ray, &shape, None).iter().any(|(_, touches)| *touches));
        }
        assert!(hits > 800, "{kind:?}: {hits} hits");
        if kind.touches() {
            assert!(touches > 20, "{kind:?}: {touches} rays touch an edge, a rim or a silhouette");
        }
    }
}

fn at(x: f32, y: f32, z: f32, direction: Vec3) -> Ray {
    Ray::new(Vec3::new(x, y, z), direction)
}

#[track_caller]
fn t_of(shape: &Shape, ray: &Ray) -> Vec<f64> {
    shape.intersect_all(ray).map(|hit| hit.t).collect()
}

#[test]
fn closed_forms() {
    let cuboid = Shape::Cuboid(Cuboid::new(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)).unwrap());
    assert_eq!(t_of(&cuboid, &at(-1.0, 1.0, 1.0, Vec3::X * 0.5)), [2.0, 4.0]);
    assert_eq!(t_of(&cuboid, &at(0.5, 1.0, 1.0, Vec3::X)), [0.5], "from inside");
    assert_eq!(t_of(&cuboid, &at(-1.0, 2.0, 1.0, Vec3::X)), [1.0, 2.0], "along a face");
    assert_eq!(t_of(&cuboid, &at(-1.0, 2.0, 3.0, Vec3::X)), [1.0, 2.0], "along an edge");
    assert_eq!(t_of(&cuboid, &at(-1.0, 2f32.next_up(), 3.0, Vec3::X)), [0.0; 0]);
    assert_eq!(t_of(&cuboid, &at(-1.0, -1.0, -1.0, Vec3::ONE)), [1.0, 2.0], "through the corner");

    let tube = |capped| Shape::Cylinder(Cylinder::new(Vec3::ZERO, Vec3::Y * 4.0, 1.0, capped).unwrap());
    assert_eq!(t_of(&tube(true), &at(0.0, -1.0, 0.5, Vec3::Y)), [1.0, 5.0], "through both caps");
    assert_eq!(t_of(&tube(false), &at(0.0, -1.0, 0.5, Vec3::Y)), [0.0; 0], "through the tube");
    assert_eq!(t_of(&tube(false), &at(3.0, 1.0, 0.0, Vec3::NEG_X)), [2.0, 4.0]);
    assert_eq!(t_of(&tube(true), &at(3.0, 4.5, 0.0, Vec3::new(-1.0, -0.25, 0.0))), [2.0, 4.0], "in by the rim");
    // In through the open end, out by the side.
    assert_eq!(t_of(&tube(false), &at(0.0, 5.0, 0.0, Vec3::new(0.5, -1.0, 0.0))), [2.0]);
    assert_eq!(t_of(&tube(true), &at(0.0, 5.0, 0.0, Vec3::new(0.5, -1.0, 0.0))), [1.0, 2.0]);

    let cone = |capped| Shape::Cone(Cone::new(Vec3::ZERO, 1.0, Vec3::Y, 0.0, capped).unwrap());
    assert_eq!(t_of(&cone(true), &at(0.0, 2.0, 0.0, Vec3::NEG_Y)), [1.0, 2.0], "down the axis");
    assert_eq!(t_of(&cone(true), &at(2.0, 0.5, 0.0, Vec3::NEG_X)), [1.5, 2.5]);
    // Parallel to the side: in by it, out by the base.
    assert_eq!(t_of(&cone(true), &at(-1.0, 1.0, 0.0, Vec3::new(1.0, -1.0, 0.0))), [0.5, 1.0]);
    assert_eq!(t_of(&cone(false), &at(-1.0, 1.0, 0.0, Vec3::new(1.0, -1.0, 0.0))), [0.5]);
    assert_eq!(t_of(&cone(true), &at(2.0, 1.0, 0.0, Vec3::NEG_X)), [2.0, 2.0], "touches the tip");
    assert_eq!(t_of(&cone(false), &at(2.0, 1.5, 0.0, Vec3::NEG_X)), [0.0; 0], "not the other half of a double cone");

    let egg = Ellipsoid::new(Vec3::X, Mat3::from_diagonal(Vec3::new(3.0, 2.0, 1.0))).unwrap();
    assert_eq!(t_of(&Shape::Ellipsoid(egg), &at(9.0, 0.0, 0.0, Vec3::NEG_X)), [5.0, 11.0]);
    assert_eq!(t_of(&Shape::Ellipsoid(egg), &at(1.0, 2.0, -5.0, Vec3::Z)), [5.0, 5.0], "a tangent");

    let disk = Shape::Disk(Disk::new(Vec3::Z, Vec3::Z * 7.0, 1.0).unwrap());
    assert_eq!(t_of(&disk, &at(0.6, 0.8, 3.0, Vec3::NEG_Z)), [0.0; 0], "in f32, 0.6^2 + 0.8^2 is more than 1");
    assert_eq!(t_of(&disk, &at(1.0, 0.0, 3.0, Vec3::NEG_Z)), [2.0], "the edge");
    assert_eq!(t_of(&disk, &at(1f32.next_up(), 0.0, 3.0, Vec3::NEG_Z)), [0.0; 0]);
    assert_eq!(t_of(&disk, &at(-3.0, 0.0, 1.0, Vec3::X)), [0.0; 0], "in its plane");

    let floor = Shape::Plane(Plane::new(Vec3::NEG_Y, Vec3::Y).unwrap());
    assert_eq!(t_of(&floor, &at(1e6, 1.0, 0.0, Vec3::new(1.0, -0.5, 3.0))), [4.0]);
    assert_eq!(t_of(&floor, &at(0.0, -1.0, 0.0, Vec3::X)), [0.0; 0], "in it");
    assert_eq!(t_of(&floor, &at(0.0, -1.0, 0.0, Vec3::Y)), [0.0], "on it");
}

/// Seen from outside, v grows to the left of where u does, on all sides of everything.
#[test]
fn no_texture_is_mirrored() {
    for kind in Kind::ALL {
        let mut seen = 0;
        for case in 0..200 {
            let mut random = Random::new(kind as u64 + 300, case);
            let (shape, targets) = sample(kind, &mut random);
            let origin = random.vector() * 3.0;
            let ray = Ray::new(origin, targets[0] + random.vector() * 0.3 - origin);
            let Some(hit) = shape.intersect(&ray) else { continue };
            let at = ray.origin.as_dvec3() + ray.direction.as_dvec3() * hit.t;
            let normal = shape.normal(at);
            let (right, up) = normal.any_orthonormal_pair();
            let along = |way: DVec3| (shape.uv(at + way * 1e-6) - shape.uv(at - way * 1e-6)) / 2e-6;
            let (mut p, mut q) = (along(right), along(up));
            // At seams and rims parameters jump.
            if p.abs().max_element().max(q.abs().max_element()) > 1e3 {
                continue;
            }
            if let Shape::Ellipsoid(ellipsoid) = &shape
                && ellipsoid.axes.determinant() < 0.0
            {
                // Its axes say that it is.
                (p, q) = (q, p);
            }
            assert!(p.perp_dot(q) > 0.0, "{shape:?} at {at}: {p} {q}");
            seen += 1;
        }
        assert!(seen > 20, "{kind:?}: {seen}");
    }
}

/// The outward normal is the direction in which the distance from the inside grows, and uv stay in their range.
#[test]
fn normals_and_parameters() {
    let cone = Shape::Cone(Cone::new(Vec3::ZERO, 1.0, Vec3::Y, 0.0, true).unwrap());
    let diagonal = 0.5f64.sqrt();
    let close = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-12, "{a} {b}");
    close(cone.normal(DVec3::new(0.5, 0.5, 0.0)), DVec3::new(diagonal, diagonal, 0.0));
    close(cone.normal(DVec3::new(0.3, 0.0, 0.1)), DVec3::NEG_Y);
    let egg = Ellipsoid::new(Vec3::ZERO, Mat3::from_diagonal(Vec3::new(2.0, 1.0, 1.0))).unwrap();
    close(Shape::Ellipsoid(egg).normal(DVec3::new(2f64.sqrt(), diagonal, 0.0)), DVec3::new(0.5, 1.0, 0.0).normalize());
    let tube = Shape::Cylinder(Cylinder::new(Vec3::ZERO, Vec3::Z * 2.0, 1.0, true).unwrap());
    close(tube.normal(DVec3::new(0.6, 0.8, 1.0)), DVec3::new(0.6, 0.8, 0.0));
    close(tube.normal(DVec3::new(0.6, 0.2, 2.0)), DVec3::Z);
    let cuboid = Shape::Cuboid(Cuboid::new(Vec3::ZERO, Vec3::ONE).unwrap());
    close(cuboid.normal(DVec3::new(0.3, 0.0, 0.7)), DVec3::NEG_Y);

    for kind in Kind::solid() {
        let mut seen = 0;
        for case in 0..400 {
            let mut random = Random::new(kind as u64 + 100, case);
            let (shape, targets) = sample(kind, &mut random);
            let origin = random.vector() * 3.0;
            let ray = Ray::new(origin, targets[0] + random.vector() * 0.3 - origin);
            let hits: Vec<ShapeHit> = shape.intersect_all(&ray).collect();
            let is_closed = !matches!(
                shape,
                Shape::Cylinder(Cylinder { capped: false, .. }) | Shape::Cone(Cone { capped: false, .. })
            );
            for hit in &hits {
                let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * hit.t;
                assert!((shape.normal(point).length() - 1.0).abs() < 1e-12);
                assert!(
                    (0.0..=1.0 + 1e-6).contains(&hit.uv.x) && (-1e-6..=1.0 + 1e-6).contains(&hit.uv.y),
                    "{shape:?} {hit:?}"
                );
                let (bounds, slack) = (shape.bounds(), 1e-6);
                assert!(
                    point.cmpge(bounds.min.as_dvec3() - slack).all()
                        && point.cmple(bounds.max.as_dvec3() + slack).all()
                );
            }
            if let ([enter, exit], true) = (&hits[..], is_closed) {
                let slope = |hit: &ShapeHit| {
                    let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * hit.t;
                    shape.normal(point).dot(ray.direction.as_dvec3())
                };
                if exit.t - enter.t > 1e-3 {
                    assert!(slope(enter) < 1e-9 && slope(exit) > -1e-9, "{shape:?} {ray:?}");
                    seen += 1;
                }
            }
        }
        assert!(seen > 50, "{kind:?}: {seen}");
    }
}

#[test]
fn moving_a_shape_moves_its_hits() {
    let way = DVec3::new(4.0, -8.0, 16.0);
    for kind in Kind::ALL {
        let mut compared = 0;
        for case in 0..50 {
            let mut random = Random::new(kind as u64 + 200, case);
            let (shape, targets) = sample(kind, &mut random);
            let origin = random.vector() * 3.0;
            let there = Ray::new(origin + way.as_vec3(), targets[0] * 0.9 + random.vector() * 0.1 - origin);
            let ray = Ray { origin: there.origin - way.as_vec3(), ..there };
            assert_eq!(shape.translated(DVec3::ZERO), shape);
            // There and back, it has only coordinates that f32 has in both places: from here the move rounds nothing.
            let shape = shape.translated(way).translated(-way);
            let (a, b) = (t_of(&shape, &ray), t_of(&shape.translated(way), &there));
            assert_eq!(a.len(), b.len(), "{shape:?} {ray:?}");
            for (a, b) in a.iter().zip(&b) {
                assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{shape:?} {ray:?}: {a} {b}");
            }
            compared += a.len();
        }
        assert!(compared >= 10, "{kind:?}: {compared} hits");
    }
}

/// From inside a closed shape every ray leaves it once, through rims, edges and tips too.
#[test]
fn nothing_leaks_from_inside() {
    for kind in Kind::solid() {
        let mut tried = 0;
        for case in 0..4000 {
            let mut random = Random::new(kind as u64 + 300, case);
            let (shape, targets) = sample(kind, &mut random);
            let is_open = matches!(
                shape,
                Shape::Cylinder(Cylinder { capped: false, .. }) | Shape::Cone(Cone { capped: false, .. })
            );
            let bounds = shape.bounds();
            let through = Ray::new(random.vector() * 4.0, Vec3::ONE);
            let through = Ray { direction: bounds.centre() + random.vector() * 0.01 - through.origin, ..through };
            let &[enter, exit] = &t_of(&shape, &through)[..] else { continue };
            if is_open || exit - enter < 1e-3 {
                continue;
            }
            let origin = through.origin + through.direction * (0.5 * (enter + exit)) as f32;
            let target = targets[random.below(targets.len() as u64) as usize];
            let ray = Ray::new(origin, target - origin);
            if ray.is_valid() {
                assert_eq!(t_of(&shape, &ray).len(), 1, "{shape:?} {ray:?}");
                tried += 1;
            }
        }
        assert!(tried > 300, "{kind:?}: {tried}");
    }
}

/// A comb of two polygons that share a jagged line: rays aimed at it hit one of them at least.
#[test]
fn polygons_that_share_edges_leave_no_gap() {
    let mut random = Random::new(400, 0);
    let jagged: Vec<Vec3> =
        (0..20).map(|i| Vec3::new(i as f32, random.unit() * 3.0 + if i % 2 == 0 { 4.0 } else { 0.0 }, 0.0)).collect();
    let polygon = |ends: [Vec3; 2]| {
        let corners = jagged.iter().copied().chain(ends).collect();
        Shape::Polygon(Arc::new(Polygon::new(corners).unwrap()))
    };
    let above = polygon([Vec3::new(19.0, 20.0, 0.0), Vec3::new(0.0, 20.0, 0.0)]);
    let below = polygon([Vec3::new(19.0, -20.0, 0.0), Vec3::new(0.0, -20.0, 0.0)]);
    for case in 0..20_000 {
        let k = 1 + random.below(17) as usize;
        let target = jagged[k].lerp(jagged[k + 1], if case % 4 == 0 { 0.0 } else { random.unit() });
        let origin = Vec3::new(random.unit() * 40.0 - 10.0, random.unit() * 40.0 - 20.0, 0.1 + random.unit() * 9.0);
        let ray = Ray::new(origin, target - origin);
        assert!(above.intersect(&ray).is_some() || below.intersect(&ray).is_some(), "{ray:?}");
    }
}
