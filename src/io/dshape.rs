//! Shapes as scene files give them, in f64, and the local origins that they are rounded relative to.
//!
//! Tracers take shapes in f32. Near zero nobody sees what that rounds; at 4500000.3, a northing in metres, it is 0.2 m.
//! So where rounding moves a shape by more than its size allows, and all that stands with it is far from zero, the
//! shapes are kept relative to a local origin, an f64 point in their middle that an instance translates them by, as a
//! [`Mesh`](crate::scene::Mesh) is kept relative to its own. [`World`](crate::World) adds both up in f64 once it knows
//! where the scene's middle is.
//!
//! All shapes of a group have one, so that polygons which share a corner share it after rounding, too, and that a group
//! of small things about zero, which is rounded to f32 there anyway, stays one. f64 coordinates in [`Shape`], the
//! plainer way, would cost every scene twice the memory, and every test of a ray the conversion, for the few that lie
//! far from zero.

use std::slice;
use std::sync::Arc;

use super::Placeless;
use crate::math::{DAabb, DMat3, DVec3, MAX_COORDINATE, Vec3};
use crate::scene::choose_origin;
use crate::shape::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Plane, Polygon, Shape, Sphere};

/// How far rounding may move a shape from where its file has it, in units of its size: what f32 is off by at most 4096
/// sizes from zero.
const TOLERANCE: f64 = 1.0 / 8192.0;

/// A shape in f64, with the fields of the [`Shape`] that it becomes.
#[derive(Clone, Debug)]
pub(super) enum DShape {
    Sphere {
        centre: DVec3,
        radius: f64,
    },
    Plane {
        point: DVec3,
        normal: DVec3,
    },
    Disk {
        centre: DVec3,
        normal: DVec3,
        radius: f64,
    },
    Cuboid {
        /// The smallest and the largest.
        corners: [DVec3; 2],
    },
    Cylinder {
        /// Base and apex.
        ends: [DVec3; 2],
        radius: f64,
        capped: bool,
    },
    Cone {
        /// Base and apex.
        ends: [DVec3; 2],
        /// One for each end.
        radii: [f64; 2],
        capped: bool,
    },
    Ellipsoid {
        centre: DVec3,
        axes: DMat3,
    },
    Polygon {
        corners: Vec<DVec3>,
    },
}

/// The local origin of shapes that stand together: zero where f32 holds them as they are, or a middle would not serve
/// them better. Planes, which are everywhere, have no say.
pub(super) fn local_origin<'a>(shapes: impl Iterator<Item = &'a DShape> + Clone) -> DVec3 {
    let mut bounded = shapes.filter(|shape| !matches!(shape, DShape::Plane { .. }));
    let bounds = bounded.clone().flat_map(DShape::points).fold(DAabb::EMPTY, |all, &p| all.include(p));
    if bounds.is_empty() || !bounded.any(DShape::is_moved) { DVec3::ZERO } else { choose_origin(&bounds) }
}

impl DShape {
    /// Whether it can be hit: as the file has it, and in f32.
    ///
    /// # Errors
    /// What is wrong with it, with its numbers as they were written, and what would be right.
    pub(super) fn check(&self) -> Placeless<()> {
        self.check_numbers()?;
        self.relative_to(if self.is_moved() { self.middle() } else { DVec3::ZERO }).map(drop)
    }

    /// What does not depend on where it stands is left to [`Shape::check`].
    fn check_numbers(&self) -> Placeless<()> {
        // Written so that NaN is refused, which transforms can give.
        let is_near_enough = |p: &&DVec3| p.abs().max_element() <= MAX_COORDINATE.into() && !p.is_nan();
        if let Some(point) = self.points().iter().find(|p| !is_near_enough(p)) {
            return Err(format!("the point {point} is too far away; coordinates may be up to {MAX_COORDINATE:e}"));
        }
        match self {
            Self::Sphere { radius, .. } | Self::Disk { radius, .. } => check_radius(*radius),
            Self::Cylinder { ends, radius, .. } => check_ends(ends).and_then(|()| check_radius(*radius)),
            Self::Cone { ends, radii: [base, apex], .. } => {
                check_ends(ends)?;
                let smaller = base.min(*apex);
                if smaller < 0.0 {
                    return Err(format!("a radius is {smaller}; it must not be below 0"));
                }
                check_radius(base.max(*apex))
            }
            Self::Cuboid { corners: [min, max] } => {
                if !min.cmple(*max).all() {
                    let remedy = "give it first, and the other second, on every axis";
                    return Err(format!("the corner {min} is not the smallest, beside {max}; {remedy}"));
                }
                if min.cmplt(*max).bitmask().count_ones() < 2 {
                    return Err(format!("between {min} and {max} is no area; let them differ on two axes at least"));
                }
                Ok(())
            }
            Self::Plane { .. } | Self::Ellipsoid { .. } | Self::Polygon { .. } => Ok(()),
        }
    }

    /// The shape in f32, relative to `origin`; or to a point in its own middle, which is then given, where nothing of
    /// it is left there.
    ///
    /// # Errors
    /// Those of [`DShape::check`].
    pub(super) fn local(&self, origin: DVec3) -> Placeless<(DVec3, Shape)> {
        // At the last two it was checked, at one of them or the other.
        let there = |place: DVec3| self.relative_to(place).map(|shape| (place, shape));
        there(origin).or_else(|_| there(self.middle())).or_else(|_| there(DVec3::ZERO))
    }

    /// Whether rounding where it stands would move it by more than its size allows.
    fn is_moved(&self) -> bool {
        let rounding = |p: &DVec3| (*p - p.as_vec3().as_dvec3()).abs().max_element();
        // No size is less than what f32 holds, or it would be refused.
        let size = self.size().max(f32::MIN_POSITIVE.into());
        self.points().iter().any(|p| rounding(p) > size * TOLERANCE)
    }

    fn middle(&self) -> DVec3 {
        self.points().iter().fold(DAabb::EMPTY, |all, &p| all.include(p)).centre()
    }

    /// What is rounded: all that depends on where it stands.
    pub(super) fn points(&self) -> &[DVec3] {
        match self {
            Self::Sphere { centre, .. } | Self::Disk { centre, .. } | Self::Ellipsoid { centre, .. } => {
                slice::from_ref(centre)
            }
            Self::Plane { point, .. } => slice::from_ref(point),
            Self::Cuboid { corners: pair } | Self::Cylinder { ends: pair, .. } | Self::Cone { ends: pair, .. } => pair,
            Self::Polygon { corners } => corners,
        }
    }

    /// The smallest of its measures, which is what rounding spoils first; of a plane, which has none, that of most
    /// things which stand on planes: one metre.
    fn size(&self) -> f64 {
        match self {
            Self::Sphere { radius, .. } | Self::Disk { radius, .. } => *radius,
            Self::Plane { .. } => 1.0,
            Self::Cuboid { corners: [min, max] } => {
                (*max - *min).to_array().into_iter().filter(|&edge| edge > 0.0).fold(f64::INFINITY, f64::min)
            }
            Self::Cylinder { ends: [base, apex], radius, .. } => radius.min(base.distance(*apex)),
            Self::Cone { ends: [base, apex], radii, .. } => radii[0].max(radii[1]).min(base.distance(*apex)),
            Self::Ellipsoid { axes, .. } => axes.x_axis.length().min(axes.y_axis.length()).min(axes.z_axis.length()),
            // Its mean width: edges may be as short as an outline is round.
            Self::Polygon { corners } => {
                let Some((first, rest)) = corners.split_first() else { return 0.0 };
                let bounds = corners.iter().fold(DAabb::EMPTY, |all, &p| all.include(p));
                let sides = rest.windows(2).map(|pair| (pair[0] - *first).cross(pair[1] - *first));
                sides.sum::<DVec3>().length() / (4.0 * bounds.radius())
            }
        }
    }

    /// Rounded once, after `origin` is taken off.
    fn relative_to(&self, origin: DVec3) -> Placeless<Shape> {
        let place = |p: DVec3| (p - origin).as_vec3();
        let shape = match self {
            Self::Sphere { centre, radius } => Shape::Sphere(Sphere { centre: place(*centre), radius: *radius as f32 }),
            Self::Plane { point, normal } => Shape::Plane(Plane { point: place(*point), normal: direction(*normal) }),
            Self::Disk { centre, normal, radius } => {
                Shape::Disk(Disk { centre: place(*centre), normal: direction(*normal), radius: *radius as f32 })
            }
            Self::Cuboid { corners } => {
                let [min, max] = corners.map(place);
                Shape::Cuboid(Cuboid { min, max })
            }
            Self::Cylinder { ends, radius, capped } => {
                let [base, apex] = ends.map(place);
                Shape::Cylinder(Cylinder { base, apex, radius: *radius as f32, capped: *capped })
            }
            Self::Cone { ends, radii, capped } => {
                let ([base, apex], [base_radius, apex_radius]) = (ends.map(place), radii.map(|radius| radius as f32));
                Shape::Cone(Cone { base, base_radius, apex, apex_radius, capped: *capped })
            }
            Self::Ellipsoid { centre, axes } => {
                Shape::Ellipsoid(Ellipsoid { centre: place(*centre), axes: axes.as_mat3() })
            }
            Self::Polygon { corners } => {
                let rounded = corners.iter().map(|&p| place(p)).collect();
                let polygon = Polygon::with_names(rounded, Some(corners));
                Shape::Polygon(Arc::new(polygon.map_err(|problem| problem.to_string())?))
            }
        };
        shape.check().map_err(|problem| problem.to_string())?;
        Ok(shape)
    }
}

fn check_radius(radius: f64) -> Placeless<()> {
    // That of the shape is f32.
    let rounded = radius as f32;
    if rounded > 0.0 && rounded <= MAX_COORDINATE {
        return Ok(());
    }
    let also = if radius > 0.0 && rounded == 0.0 { ", in f32 too" } else { "" };
    Err(format!("the radius is {radius:?}; it must be above 0 and at most {MAX_COORDINATE:e}{also}"))
}

fn check_ends([base, apex]: &[DVec3; 2]) -> Placeless<()> {
    if base == apex { Err(format!("both ends are {base}; let them lie apart")) } else { Ok(()) }
}

/// A direction, whose length does not matter, in f32.
fn direction(v: DVec3) -> Vec3 {
    let rounded = v.as_vec3();
    let longest = v.abs().max_element();
    // Where f32 has no such length, any other serves.
    let is_held = rounded.is_finite() && rounded.abs().max_element() >= f32::MIN_POSITIVE;
    if is_held || longest == 0.0 { rounded } else { (v / longest).as_vec3() }
}
