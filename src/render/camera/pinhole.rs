//! Rays of the camera that most pictures are taken with: they meet in one point, and many are made at a time.

use crate::math::{DMat3, DVec2, DVec3, Vec3};
use crate::ray::Ray;
use crate::scene::Camera;

/// A pinhole camera in front of a film of given size, in world coordinates.
///
/// Directions are computed in f64 and rounded once; every ray starts at the eye, rounded once.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Pinhole {
    origin: Vec3,
    frame: DMat3,
    /// Pixels.
    size: DVec2,
    /// Half the film at distance 1.
    half: DVec2,
    /// The camera's lens shift, in halves of the film, y down.
    shift: DVec2,
}

impl Pinhole {
    /// `centre` is [`World::centre`](crate::World), `half` half the film at distance 1, `size` the film's in pixels.
    pub(super) fn new(camera: &Camera, centre: DVec3, size: DVec2, half: DVec2) -> Self {
        let shift = camera.shift * DVec2::new(2.0, -2.0);
        Self { origin: (camera.eye - centre).as_vec3(), frame: camera.frame, size, half, shift }
    }

    /// The ray through a point of the film in pixels, from its top left corner; with a unit direction.
    pub(in crate::render) fn ray(&self, film: DVec2) -> Ray {
        let [ray] = self.rays(&[film]);
        ray
    }

    /// The rays through several points, each the same to the bit as alone.
    ///
    /// Written number by number, because loops over arrays become vector code, and operations on `DVec3` do not.
    #[inline]
    pub(in crate::render) fn rays<const N: usize>(&self, film: &[DVec2; N]) -> [Ray; N] {
        let (x, y) = (film.map(|at| at.x), film.map(|at| at.y));
        let [right, up, back] = self.frame.to_cols_array_2d();
        let mut direction = [[0.0; N]; 3];
        for i in 0..N {
            let x = (x[i] / self.size.x * 2.0 - 1.0 + self.shift.x) * self.half.x;
            let y = (y[i] / self.size.y * 2.0 - 1.0 + self.shift.y) * self.half.y;
            let [a, b, c] = [0, 1, 2].map(|axis| right[axis] * x - up[axis] * y - back[axis]);
            let reciprocal = 1.0 / (a * a + b * b + c * c).sqrt();
            direction[0][i] = (a * reciprocal) as f32;
            direction[1][i] = (b * reciprocal) as f32;
            direction[2][i] = (c * reciprocal) as f32;
        }
        std::array::from_fn(|i| Ray::new(self.origin, Vec3::new(direction[0][i], direction[1][i], direction[2][i])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_rays_are_each_alone_and_those_of_vector_algebra() {
        let eye = DVec3::new(3.0, 1.0 / 3.0, -7.1);
        for (i, up) in [DVec3::Y, DVec3::new(0.3, -1.0, 0.2)].into_iter().enumerate() {
            let camera = Camera::look_at(eye, DVec3::splat(0.1), up, 0.3 + i as f64).expect("a view");
            let pinhole = Pinhole::new(&camera, DVec3::ONE, DVec2::new(1000.0, 77.0), DVec2::new(1.3, 0.1));
            for step in 0..500 {
                let film: [DVec2; 16] = std::array::from_fn(|k| {
                    DVec2::new(f64::from(step) * 2.0 + 0.37, k as f64 * 4.9 + f64::from(step) / 97.0)
                });
                let rays = pinhole.rays(&film);
                for (at, ray) in film.into_iter().zip(rays) {
                    assert_eq!(ray, pinhole.ray(at));
                    let at = (at / pinhole.size * 2.0 - 1.0) * pinhole.half;
                    let direction = pinhole.frame * DVec3::new(at.x, -at.y, -1.0);
                    assert_eq!(ray, Ray::new(pinhole.origin, direction.normalize().as_vec3()));
                }
            }
        }
    }
}
