//! Shapes as scene files give them, in f64, and the local origins that they are rounded relative to.
//!
//! Tracers take shapes in f32. Near zero nobody sees what that rounds; at 4500000.3, a northing in metres, it is 0.2 m. So a shape that
//! rounding would move by more than its size allows is kept relative to a local origin, an f64 point near it that an instance
//! translates it by, as a [`Mesh`](crate::scene::Mesh) is kept relative to its own. [`World`](crate::World) adds both up in f64 once it
//! knows where the scene's middle is.
//!
//! Local origins lie on grids whose edges are powers of two, so that neighbours of like size share one, and an origin and what is left
//! of a coordinate are exact. An origin for each shape, the simpler way, would make a group and a part for each; f64 coordinates in
//! [`Shape`], the plainer one, would cost every scene twice the memory, and every test of a ray the conversion, for the few that lie
//! far from zero.

use std::slice;
use std::sync::Arc;

use super::Placeless;
use crate::math::{DAabb, DMat3, DVec3, LARGEST_COORDINATE, Vec3};
use crate::shape::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Plane, Polygon, Shape, Sphere};

/// How far rounding may move a shape from where its file has it, in units of its size: what f32 is off by at most 4096 sizes from zero.
const TOLERANCE: f64 = 1.0 / 8192.0;
/// Most edges of a grid, in units of a shape's size: whatever shares its origin is then off by at most 2^-17 of its size on each axis.
const EDGE: f64 = 512.0;
/// The same in units of how far a shape reaches: closer origins would not have less to round.
const EDGE_BY_REACH: f64 = 8.0;

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

/// A shape in f32, relative to a local origin.
#[derive(Clone, Debug)]
pub(super) struct LocalShape {
    /// Zero where f32 holds the shape as it stands.
    pub(super) origin: DVec3,
    pub(super) shape: Shape,
}

impl DShape {
    /// Whether it can be hit, as the file has it. What does not depend on where it stands is left to [`Shape::check`].
    ///
    /// # Errors
    /// What is wrong with it, with its numbers as they were written, and what would be right.
    pub(super) fn check(&self) -> Placeless<()> {
        // Written so that NaN is refused, which transforms can give.
        let is_near_enough = |p: &&DVec3| p.abs().max_element() <= LARGEST_COORDINATE.into() && !p.is_nan();
        if let Some(point) = self.points().iter().find(|p| !is_near_enough(p)) {
            return Err(format!("the point {point} is too far away; coordinates may be up to {LARGEST_COORDINATE:e}"));
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

    /// The shape in f32: relative to zero where that moves it by next to nothing, else to a local origin.
    ///
    /// # Errors
    /// Those of [`DShape::check`], and what f32 cannot hold anywhere.
    pub(super) fn local(&self) -> Placeless<LocalShape> {
        self.check()?;
        let points = self.points();
        let rounding = |p: &DVec3| (*p - p.as_vec3().as_dvec3()).abs().max_element();
        // No size is less than what f32 holds, or it would be refused.
        let size = self.size().max(f32::MIN_POSITIVE.into());
        if points.iter().map(rounding).fold(0.0, f64::max) <= size * TOLERANCE {
            return self.relative_to(DVec3::ZERO);
        }
        if let Self::Plane { point, .. } = self {
            // It has neighbours of every size, and there are few planes. So its point, where its parameters start, is its own origin:
            // nothing is rounded. A point nearer to zero would be no better, for it is the scene's middle that matters, which nobody
            // knows yet, and who writes such a scene takes a point that is there.
            return self.relative_to(*point);
        }
        let bounds = points.iter().fold(DAabb::EMPTY, |all, &p| all.include(p));
        let middle = bounds.centre();
        let shared = on_grid(middle, (EDGE * size).max(EDGE_BY_REACH * bounds.radius()));
        // What is so thin that even there nothing of it is left stands by itself.
        self.relative_to(shared).or_else(|_| self.relative_to(on_grid(middle, size)))
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

    /// The smallest of its measures, which is what rounding spoils first; of a plane, which has none, that of most things which stand on
    /// planes: one metre.
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
    fn relative_to(&self, origin: DVec3) -> Placeless<LocalShape> {
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
        Ok(LocalShape { origin, shape })
    }
}

fn check_radius(radius: f64) -> Placeless<()> {
    // That of the shape is f32.
    let rounded = radius as f32;
    if rounded > 0.0 && rounded <= LARGEST_COORDINATE {
        return Ok(());
    }
    let also = if radius > 0.0 && rounded == 0.0 { ", in f32 too" } else { "" };
    Err(format!("the radius is {radius}; it must be above 0 and finite{also}"))
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

/// The nearest point of the grid whose edge is the largest power of two up to `edge`. Nothing is rounded but to the grid.
fn on_grid(p: DVec3, edge: f64) -> DVec3 {
    // The bits of the exponent alone.
    let edge = f64::from_bits(edge.to_bits() & f64::INFINITY.to_bits());
    // Adding 0 makes one zero of the two.
    (p / edge).round() * edge + 0.0
}
