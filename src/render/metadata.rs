//! What a picture's file says about its camera.

use super::{Crop, Settings};
use crate::image::{Metadata, Window};
use crate::math::{DAffine3, DMat3, DMat4, DVec2, DVec3};
use crate::scene::{Camera, Fov, Pose, Projection};

/// Nearest distance of the depth range that `worldToScreen` maps to -1..1; the far end is infinite. Rays know neither.
const NEAR: f64 = 0.01;

impl Metadata {
    /// What there is to say about a picture that this camera and these settings make: where the camera stands and what
    /// it sees, the samples of a pixel, and which part it is.
    pub fn of_camera(camera: &Camera, settings: &Settings) -> Self {
        let aspect = f64::from(settings.width) / f64::from(settings.height);
        // Of a camera that moves, as it is when the shutter opens.
        let Pose { eye, frame } = camera.pose(camera.shutter[0].into());
        let world_to_camera = DMat4::from(DAffine3::from_mat3_translation(frame, eye).inverse());
        let half = camera.projection.half_extent(aspect).unwrap_or(DVec2::ONE);
        let to_screen = match camera.projection {
            Projection::Perspective(_) => Some(perspective(half, camera.shift)),
            Projection::Orthographic(_) => Some(orthographic(half, camera.shift)),
            // No matrix does it.
            Projection::Equirectangular => None,
        };
        Self {
            world_to_camera: Some(world_to_camera.to_cols_array()),
            world_to_screen: to_screen.map(|matrix| (matrix * world_to_camera).to_cols_array()),
            fovcot: Some(aspect),
            samples_per_pixel: Some(settings.spp),
            window: settings.crop.map(|Crop { x, y, .. }| Window { x, y, full: [settings.width, settings.height] }),
            ..Self::default()
        }
    }

    /// The camera that it tells of, as exactly as the f32 of a file are; none where it tells of none. Lens, distortion
    /// and shutter are not in it.
    pub fn camera(&self) -> Option<Camera> {
        let to_camera = DMat4::from_cols_array(self.world_to_camera.as_ref()?);
        let from_camera = to_camera.inverse();
        let back = from_camera.z_axis.truncate().try_normalize()?;
        let right = (from_camera.x_axis.truncate().reject_from_normalized(back)).try_normalize()?;
        let usual = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0)?;
        let frame = DMat3::from_cols(right, back.cross(right), back);
        let placed = Camera { eye: from_camera.w_axis.truncate(), frame, ..usual };
        let Some(to_screen) = &self.world_to_screen else {
            return Some(Camera { projection: Projection::Equirectangular, ..placed });
        };
        let screen = DMat4::from_cols_array(to_screen) * from_camera;
        let half = DVec2::new(screen.x_axis.x, screen.y_axis.y).recip();
        // What tells the two apart is whether w depends on z, which is -1 or 0.
        let (projection, shift) = if screen.z_axis.w < -0.5 {
            let [horizontal, vertical] = half.to_array().map(|half| 2.0 * libm::atan(half));
            (Projection::Perspective(Fov::Both { horizontal, vertical }), screen.z_axis.truncate().truncate() / 2.0)
        } else {
            (Projection::Orthographic(2.0 * half.y), screen.w_axis.truncate().truncate() / -2.0)
        };
        let camera = Camera { projection, shift, ..placed };
        (camera.eye.is_finite() && half.is_finite() && half.cmpgt(DVec2::ZERO).all()).then_some(camera)
    }
}

/// OpenGL's perspective with the far plane at infinity, for a picture of the given half extent at distance 1, moved by
/// `shift`.
fn perspective(half: DVec2, shift: DVec2) -> DMat4 {
    DMat4::from_cols_array_2d(&[
        [1.0 / half.x, 0.0, 0.0, 0.0],
        [0.0, 1.0 / half.y, 0.0, 0.0],
        [2.0 * shift.x, 2.0 * shift.y, -1.0, -1.0],
        [0.0, 0.0, -2.0 * NEAR, 0.0],
    ])
}

/// OpenGL's parallel projection, with the depth range of the other one's near end.
fn orthographic(half: DVec2, shift: DVec2) -> DMat4 {
    DMat4::from_cols_array_2d(&[
        [1.0 / half.x, 0.0, 0.0, 0.0],
        [0.0, 1.0 / half.y, 0.0, 0.0],
        [0.0, 0.0, -NEAR, 0.0],
        [-2.0 * shift.x, -2.0 * shift.y, -1.0, 1.0],
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Renderer;
    use crate::scene::Scene;
    use crate::trace::World;

    /// A point along a pixel's ray must be projected to where the pixel is.
    #[test]
    fn the_screen_matrix_agrees_with_the_rays() {
        let settings = Settings { width: 40, height: 20, spp: 1, ..Settings::default() };
        let camera = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.5, 0.0), DVec3::Y, 0.7).unwrap();
        let camera = Camera { shift: DVec2::new(0.25, -0.125), ..camera };
        agrees(&settings, camera.clone());
        agrees(&settings, Camera { projection: Projection::Orthographic(3.0), ..camera });
    }

    /// By way of a file the camera comes back: its rays are the same, but for the rounding to f32.
    #[test]
    fn the_camera_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let (settings, scene, world) =
            (Settings { width: 40, height: 20, ..Settings::default() }, Scene::default(), World::default());
        let camera = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.5, 0.0), DVec3::Y, 0.7).unwrap();
        let shifted = Camera { shift: DVec2::new(0.25, -0.125), ..camera.clone() };
        for camera in [
            Camera { projection: Projection::Orthographic(3.0), ..shifted.clone() },
            Camera { projection: Projection::Equirectangular, ..camera.clone() },
            shifted,
            camera,
        ] {
            let image = crate::Image::new(4, 2);
            crate::image::write(&path, &image, &Metadata::of_camera(&camera, &settings), &Default::default()).unwrap();
            let found = crate::image::read_metadata(&path).unwrap().camera().unwrap();
            let [own, found] = [camera, found].map(|c| Renderer::new(&scene, &world, c, settings.clone()).unwrap());
            for (x, y) in [(0, 0), (39, 3), (17, 19)] {
                let (a, b) = (own.middle_ray(x, y), found.middle_ray(x, y));
                assert!((a.origin - b.origin).length() < 1e-5 && (a.direction - b.direction).length() < 1e-5);
            }
        }
        assert_eq!(Metadata::default().camera(), None);
    }

    fn agrees(settings: &Settings, camera: Camera) {
        let metadata = Metadata::of_camera(&camera, settings);
        let to_camera = DMat4::from_cols_array(&metadata.world_to_camera.unwrap());
        let to_screen = DMat4::from_cols_array(&metadata.world_to_screen.unwrap());
        let (scene, world) = (Scene::default(), World::default());
        let renderer = Renderer::new(&scene, &world, camera, settings.clone()).unwrap();
        for (x, y) in [(0, 0), (39, 3), (17, 19)] {
            let ray = renderer.camera_ray(x, y, 0);
            let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * 7.0;
            let screen = to_screen.project_point3(point);
            let expected_x = (f64::from(x) + 0.5) / 20.0 - 1.0;
            let expected_y = 1.0 - (f64::from(y) + 0.5) / 10.0;
            assert!((screen.x - expected_x).abs() < 1e-5 && (screen.y - expected_y).abs() < 1e-5, "{screen}");
            assert!(to_camera.transform_point3(point).z < 0.0, "ahead is -z");
        }
    }
}
