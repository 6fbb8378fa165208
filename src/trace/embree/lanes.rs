//! Four rays side by side.

use super::reach::Reach;
use crate::math::{BVec4A, Mat4, Vec3, Vec4};
use crate::ray::Ray;

/// Stands in for rays that are not traced: even if it were, it would hit nothing.
pub(super) const NOWHERE: Ray = Ray { tmin: f32::INFINITY, tmax: 0.0, ..Ray::new(Vec3::ZERO, Vec3::Z) };

/// Four rays, component by component.
pub(super) struct Lanes {
    pub origin: [Vec4; 3],
    pub direction: [Vec4; 3],
    pub tmin: Vec4,
    pub tmax: Vec4,
}

impl Lanes {
    /// Transposed in registers.
    #[inline(always)]
    pub fn new(rays: &[Ray; 4]) -> Self {
        // In the order of memory, so that each column is one load.
        let [a, b, c, d] = rays.each_ref().map(|r| Vec4::new(r.origin.x, r.origin.y, r.origin.z, r.direction.x));
        let starts = Mat4::from_cols(a, b, c, d).transpose();
        let [a, b, c, d] = rays.each_ref().map(|r| Vec4::new(r.direction.y, r.direction.z, r.tmin, r.tmax));
        let ends = Mat4::from_cols(a, b, c, d).transpose();
        Self {
            origin: [starts.x_axis, starts.y_axis, starts.z_axis],
            direction: [starts.w_axis, ends.x_axis, ends.y_axis],
            tmin: ends.z_axis,
            tmax: ends.w_axis,
        }
    }

    /// Where [`Reach::has`] holds for certain. Coordinates close to the reach and directions shorter than 1e-19 are
    /// left undecided: the exact conditions take half as many instructions again.
    #[inline(always)]
    pub fn surely_traceable(&self, reach: &Reach) -> BVec4A {
        let square = |[x, y, z]: [Vec4; 3]| x * x + y * y + z * z;
        let (distance, length) = (square(self.origin), square(self.direction));
        let most = Vec4::splat(reach.square);
        // False for NaN.
        distance.cmple(most)
            & length.cmple(most)
            & length.cmpge(Vec4::splat(f32::MIN_POSITIVE))
            & self.tmin.cmpge(Vec4::ZERO)
            & self.tmin.cmple(self.tmax)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_surely_traceable_is_traceable() {
        const ODD: [f32; 14] = [
            0.0,
            -0.0,
            1.0,
            -1e-15,
            1e18,
            1.844e18,
            -2e18,
            f32::MAX,
            f32::MIN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            f32::MIN_POSITIVE,
            f32::MIN_POSITIVE / 2.0,
        ];
        let good = Ray { tmin: 0.5, ..Ray::new(Vec3::ONE, Vec3::Y) };
        let mut rays = Vec::new();
        for x in ODD {
            for axis in 0..3 {
                let mut ray = good;
                ray.origin[axis] = x;
                rays.push(ray);
                let mut ray = good;
                ray.direction[axis] = x;
                rays.push(ray);
                let mut ray = Ray { direction: Vec3::ZERO, ..good };
                ray.direction[axis] = x;
                rays.push(ray);
            }
            rays.extend([Ray { tmin: x, ..good }, Ray { tmax: x, ..good }]);
        }
        let mut surely = 0;
        for ray in &rays {
            for lane in 0..4 {
                let mut four = [good; 4];
                four[lane] = *ray;
                let bits = Lanes::new(&four).surely_traceable(&Reach::WORLD).bitmask();
                assert_eq!(bits | 1 << lane, 0b1111, "the others do not matter: {ray:?}");
                surely += bits >> lane & 1;
                assert!(bits >> lane & 1 == 0 || Reach::WORLD.has(ray), "{ray:?}");
                // Nothing ordinary is left undecided.
                let numbers = [ray.origin, ray.direction].map(|v| v.to_array()).concat();
                if Reach::WORLD.has(ray) && numbers.iter().all(|x| *x == 0.0 || (1e-18..=1e18).contains(&x.abs())) {
                    assert!(bits >> lane & 1 != 0, "{ray:?}");
                }
            }
        }
        assert!(surely > 4 * 30 && surely < 4 * (rays.len() as u32 - 50), "{surely} of {}", 4 * rays.len());
    }
}
