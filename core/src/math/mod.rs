//! Vectors, boxes and rounding-error bounds.
//!
//! Vectors and matrices are glam's. What is added here is what a ray tracer needs of them: [`Aabb`], and the
//! machinery of rounding-error analysis in Higham's notation (Higham 2002, *Accuracy and Stability of Numerical
//! Algorithms*): [`gamma`] bounds the relative error of `n` chained f32 operations, [`gamma64`] that of f64.

#[doc(hidden)]
pub mod expansion;
pub(crate) mod integers;
#[doc(hidden)]
pub mod number;
mod random;

pub use random::Random;

pub use glam::{
    Affine2, Affine3, BVec3, BVec4A, DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Mat2, Mat3, Mat4, UVec2, UVec3, Vec2,
    Vec3, Vec4,
};

/// Half the distance from 1 to the next f32: the largest relative error of one rounded operation.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;

/// Half the distance from 1 to the next f64.
pub const UNIT_ROUNDOFF_64: f64 = f64::EPSILON / 2.0;

/// Coordinates of a larger magnitude count as infinite, as in Embree (its `FLT_LARGE`): products of three such
/// numbers with a direction still fit into f64, and reciprocals into f32.
pub const MAX_COORDINATE: f32 = 1.844e18;

/// Bounds the relative error of `n` chained f32 operations: n u / (1 - n u).
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// Bounds the relative error of `n` chained f64 operations.
pub const fn gamma64(n: u32) -> f64 {
    let nu = n as f64 * UNIT_ROUNDOFF_64;
    nu / (1.0 - nu)
}

/// The matrix that turns normals as `m` turns surfaces: the inverse transpose times the determinant's magnitude. Needs
/// no division, and keeps outward normals outward under a mirroring.
pub fn cofactor(m: &DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -cofactors } else { cofactors }
}

/// The turn by an angle in degrees, counter-clockwise, about an axis of length 1.
pub fn rotation(axis: DVec3, degrees: f64) -> DQuat {
    let (sin, cos) = libm::sincos(degrees.to_radians() / 2.0);
    DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos).normalize()
}

/// By what a map makes all lengths longer; none where it does not do so alike in all directions, by more than
/// `tolerance` of the squares of lengths.
pub fn similarity(m: &DMat3, tolerance: f64) -> Option<f64> {
    let square = m.x_axis.length_squared();
    let is_alike = (m.transpose() * *m).abs_diff_eq(DMat3::from_diagonal(DVec3::splat(square)), square * tolerance);
    is_alike.then(|| square.sqrt())
}

/// Two unit vectors that make a right-handed frame with the unit vector `n` (Duff et al. 2017, *Building an orthonormal
/// basis, revisited*).
pub fn tangents(n: DVec3) -> [DVec3; 2] {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y)]
}

/// Whether a transform can be undone.
pub fn is_invertible(transform: &DAffine3) -> bool {
    transform.is_finite() && transform.matrix3.determinant().is_normal() && transform.inverse().is_finite()
}

/// Whether things can be placed by a transform: it can be undone, and so can what it is as f32, which is what tracers
/// place them by.
pub fn can_place(transform: &DAffine3) -> bool {
    is_invertible(transform) && is_invertible(&transform.as_affine3().as_daffine3())
}

/// Why nothing [can be placed](can_place) by a transform, and what would do: what follows the name of the thing in a
/// message.
pub fn placement_fault(transform: &DAffine3) -> Option<&'static str> {
    if !transform.as_affine3().is_finite() {
        return Some(
            "is placed, or moves, to where f32 does not reach; bring it within 3.4e38 of zero, and its scale below that",
        );
    }
    let is_singular = !can_place(transform);
    is_singular.then_some("has a singular transform; give it a scale that is neither zero nor beyond what f32 holds")
}

/// The normal of a triangle, (b - a) x (c - a): not of unit length, and on the side from which a, b, c run
/// counterclockwise.
#[inline(always)]
pub fn triangle_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a)
}

/// Whether a vertex may take part in tracing: finite, and small enough not to overflow.
pub fn is_traceable(p: Vec3) -> bool {
    // Written so that NaN gives false.
    p.abs().max_element() <= MAX_COORDINATE && !p.is_nan()
}

/// An axis-aligned box. Empty where `min > max` on any axis; [`Aabb::EMPTY`] is the neutral element of
/// [`Aabb::union`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner, in the units of the scene.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around the points; empty for none.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::include)
    }

    /// The smallest box around `self` and `point`.
    #[inline]
    #[must_use]
    pub fn include(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether it contains no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether it contains points, but none without end.
    pub fn is_bounded(&self) -> bool {
        !self.is_empty() && self.min.is_finite() && self.max.is_finite()
    }

    /// Its corners: of number k, each axis whose bit is set in k has its largest coordinate, the others their smallest.
    #[inline]
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|k| {
            let pick = |axis: usize| if k >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The middle. Halves before it adds, so that large boxes do not overflow.
    #[inline]
    pub fn centre(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Edge lengths; negative where empty.
    #[inline]
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// How far it reaches along each row of a matrix, and against it: the largest scalar products of these with any of
    /// its points.
    #[inline(always)]
    pub fn extents(&self, rows: &DMat3) -> [DVec3; 2] {
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        let products = |axis: usize| (rows.col(axis) * min[axis], rows.col(axis) * max[axis]);
        let ((ax, bx), (ay, by), (az, bz)) = (products(0), products(1), products(2));
        [ax.max(bx) + ay.max(by) + az.max(bz), -(ax.min(bx) + ay.min(by) + az.min(bz))]
    }

    /// Half the surface area, the measure of the surface area heuristic; 0 where empty.
    #[inline]
    pub fn half_area(&self) -> f32 {
        let d = self.size().max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// An axis-aligned box in f64: the bounds of a scene before it is recentred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DAabb {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl DAabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box around `self` and `point`.
    #[must_use]
    pub fn include(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether all points of `other` are in it.
    pub fn contains(&self, other: &Self) -> bool {
        self.min.cmple(other.min).all() && other.max.cmple(self.max).all()
    }

    /// Whether it contains no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The middle; the origin where empty.
    pub fn centre(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min * 0.5 + self.max * 0.5 }
    }

    /// Half the length of the diagonal; 0 where empty.
    pub fn radius(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max * 0.5 - self.min * 0.5).length() }
    }
}
