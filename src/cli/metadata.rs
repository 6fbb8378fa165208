//! What a picture's file says about its camera.

use crate::image::{Metadata, Window};
use crate::math::{DAffine3, DMat4, DVec2};
use crate::render::{Crop, Settings};
use crate::scene::{Camera, Pose, Projection};

/// Nearest distance of the depth range that `worldToScreen` maps to -1..1; the far end is infinite. Rays know neither.
const NEAR: f64 = 0.01;

/// What there is to say about a picture that took `seconds` to render.
pub(super) fn metadata(camera: &Camera, settings: &Settings, seconds: f64) -> Metadata {
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
    Metadata {
        world_to_camera: Some(world_to_camera.to_cols_array()),
        world_to_screen: to_screen.map(|matrix| (matrix * world_to_camera).to_cols_array()),
        fovcot: Some(aspect),
        samples_per_pixel: Some(settings.spp),
        render_time_seconds: Some(seconds),
        window: settings.crop.map(|Crop { x, y, .. }| Window { x, y, full: [settings.width, settings.height] }),
        ..Metadata::default()
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
    use crate::math::DVec3;
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

    fn agrees(settings: &Settings, camera: Camera) {
        let metadata = metadata(&camera, settings, 0.0);
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
