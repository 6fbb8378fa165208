//! An ellipsoid: the unit sphere under an affine map.
//!
//! The map's matrix is M, its adjugate N = det(M) M^-1. With f from the centre to the ray's origin, |N (f + t d)| =
//! |det M| on the surface: no division. Since (N f) x (N d) = det(M) M^T (f x d), the discriminant is det(M)^2 (|N d|^2
//! - |M^T (f x d)|^2).

use super::line::{Line, NO_ROOTS, Roots};
use super::quadric::{Inside, Quadric};
use super::round::{outwards, spherical};
use super::{InvalidShape, in_f32};
use crate::math::number::{Formula, Number, cross, dot, minus, vector};
use crate::math::{Aabb, DVec2, DVec3, MAX_COORDINATE, Mat3, Vec3, is_traceable};
use crate::ray::Ray;

/// An ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// The middle.
    pub centre: Vec3,
    /// Half axes, in its columns: what the axes of the unit sphere become. They need not be perpendicular, but not lie
    /// in one plane.
    pub axes: Mat3,
}

impl Ellipsoid {
    /// The ellipsoid that the matrix `axes` makes of the unit sphere, around `centre`.
    ///
    /// # Errors
    /// For half axes that lie in one plane, and for what is not finite.
    pub fn new(centre: Vec3, axes: Mat3) -> Result<Self, InvalidShape> {
        let ellipsoid = Self { centre, axes };
        ellipsoid.check().map(|()| ellipsoid)
    }

    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        let Mat3 { x_axis, y_axis, z_axis } = self.axes;
        InvalidShape::unless(is_traceable(self.centre), || format!("the centre {} is not finite", self.centre))?;
        InvalidShape::unless([x_axis, y_axis, z_axis].into_iter().all(is_traceable), || {
            format!(
                "the half axes {x_axis:?}, {y_axis:?}, {z_axis:?} are not finite, or longer than {MAX_COORDINATE:e}"
            )
        })?;
        InvalidShape::unless(Volume(self.axes).signs() != [0], || {
            format!("the half axes {x_axis}, {y_axis}, {z_axis} lie in one plane; an ellipsoid needs three that do not")
        })
    }

    pub(super) fn bounds(&self) -> Aabb {
        let [x, y, z] = self.axes.as_dmat3().transpose().to_cols_array_2d().map(DVec3::from_array);
        outwards(self.centre.as_dvec3(), DVec3::new(x.length(), y.length(), z.length()))
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        Self { centre: in_f32(self.centre.as_dvec3() + offset), ..*self }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let [x, y, z] = [self.axes.x_axis, self.axes.y_axis, self.axes.z_axis];
        let size = self.centre.abs().max(x.abs()).max(y.abs()).max(z.abs()).max_element();
        let line = Line::new(ray, size);
        let seen = Seen { line, centre: line.place(self.centre), axes: [x, y, z].map(|axis| line.place(axis)) };
        match seen.solve() {
            Inside::Between(roots) => roots.ends().map(|t| t.map(|t| line.t(t))),
            Inside::Nothing | Inside::Along | Inside::All | Inside::Beyond(_) => NO_ROOTS,
        }
    }

    /// The point of the unit sphere.
    fn on_sphere(&self, point: DVec3) -> DVec3 {
        (self.axes.as_dmat3().inverse() * (point - self.centre.as_dvec3())).normalize_or(DVec3::Y)
    }

    pub(super) fn normal(&self, point: DVec3) -> DVec3 {
        (self.axes.as_dmat3().inverse().transpose() * self.on_sphere(point)).normalize_or(DVec3::Y)
    }

    /// Those of the unit sphere.
    pub(super) fn uv(&self, point: DVec3) -> DVec2 {
        spherical(self.on_sphere(point))
    }
}

/// The determinant.
struct Volume(Mat3);

impl Formula<1> for Volume {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let Mat3 { x_axis, y_axis, z_axis } = self.0;
        let [x, y, z] = [x_axis, y_axis, z_axis].map(|axis| vector::<N>(axis.as_dvec3()));
        [dot(&x, &cross(&y, &z))]
    }
}

/// From the ray's line.
struct Seen {
    line: Line,
    centre: DVec3,
    axes: [DVec3; 3],
}

impl Formula<5> for Seen {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 5] {
        let d = vector::<N>(self.line.direction);
        let f = minus(&vector::<N>(self.line.origin), &vector(self.centre));
        let axes = self.axes.map(vector::<N>);
        let [x, y, z] = &axes;
        let rows = [cross(y, z), cross(z, x), cross(x, y)];
        let apply = |rows: &[[N; 3]; 3], v: &[N; 3]| rows.each_ref().map(|row| dot(row, v));
        let (nf, nd, moment) = (apply(&rows, &f), apply(&rows, &d), apply(&axes, &cross(&f, &d)));
        let (a, determinant) = (dot(&nd, &nd), dot(x, &rows[0]));
        let c = dot(&nf, &nf).sub(&determinant.mul(&determinant));
        let e = a.sub(&dot(&moment, &moment));
        [a, dot(&nf, &nd), c, e, determinant]
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadric::tests::assert_discriminants;
    use super::*;

    #[test]
    fn the_short_discriminant_is_the_discriminant() {
        assert_discriminants(|line, v| Seen { centre: v(0.3), axes: [v(3.3), v(4.1), v(5.7)], line });
    }
}
