//! Camera rays, against the three ways in which lectures derive them.

use twincast::math::{DMat3, DVec2, DVec3, Vec3};
use twincast::scene::{Camera, Distortion, Fov, Geometry, Mesh, Pose, Projection, ThinLens};
use twincast::{Error, Renderer, Scene, World};

use super::settings;

/// Directions of some pixels' rays, as the renderer has them.
fn rays(camera: &Camera, width: u32, height: u32) -> Vec<(u32, u32, DVec3)> {
    let (scene, world) = (Scene::default(), World::default());
    let renderer = Renderer::new(&scene, &world, camera.clone(), settings(width, height, 1)).unwrap();
    let pixels = [(0, 0), (width - 1, 0), (0, height - 1), (width / 2, height / 3), (width - 1, height - 1)];
    pixels.map(|(x, y)| (x, y, renderer.camera_ray(x, y, 0).direction.as_dvec3())).to_vec()
}

fn assert_along(got: DVec3, expected: DVec3, what: &str) {
    let off = (got - expected.normalize()).length();
    assert!(off < 2e-7, "{what}: {got} is off by {off}");
}

const VIEWS: [(DVec3, DVec3, f64, [u32; 2]); 4] = [
    (DVec3::new(1.0, 2.0, 8.0), DVec3::new(0.0, 0.5, -1.0), 40.0, [64, 48]),
    (DVec3::new(-7.0, 0.1, 0.3), DVec3::new(3.0, 1.0, 0.0), 90.0, [31, 77]),
    (DVec3::new(0.0, 9.0, 0.5), DVec3::ZERO, 5.0, [640, 360]),
    (DVec3::new(4.0, -3.0, 2.0), DVec3::new(4.5, 8.0, 2.0), 150.0, [10, 10]),
];

#[test]
fn the_world_is_to_be_the_scenes() {
    let scene = Scene::from_geometries(
        vec![Geometry::Mesh(Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]))],
        vec![],
    );
    let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0).unwrap();
    let other = World::new(&Scene::default()).unwrap();
    let error = Renderer::new(&scene, &other, camera.clone(), settings(4, 4, 1)).expect_err("another scene's");
    assert!(error.to_string().contains("another scene's"), "{error}");
    assert!(Renderer::new(&scene, &World::new(&scene).unwrap(), camera.clone(), settings(4, 4, 1)).is_ok());
    assert!(Renderer::new(&scene, &World::placed(&scene).unwrap(), camera, settings(4, 4, 1)).is_ok());
}

#[test]
fn axes_must_be_unit_vectors_at_right_angles() {
    let (scene, world) = (Scene::default(), World::default());
    let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0).unwrap();
    let skew = DMat3::from_cols(DVec3::X, DVec3::new(0.1, 1.0, 0.0), DVec3::Z);
    for by in [DMat3::IDENTITY * 5.0, DMat3::IDENTITY * 0.999, skew, DMat3::ZERO, DMat3::IDENTITY * f64::NAN] {
        let bent = Camera { frame: camera.frame * by, ..camera.clone() };
        let error = Renderer::new(&scene, &world, bent, settings(4, 4, 1)).expect_err("a camera that is none");
        assert!(error.to_string().contains("unit vectors"), "{error}");
    }
}

/// R. Ramamoorthi's lectures: w backwards, u to the right, v up; alpha and beta from the tangents.
#[test]
fn as_from_the_look_at_frame() {
    for (eye, target, fov, [width, height]) in VIEWS {
        let w = (eye - target).normalize();
        let u = DVec3::Y.cross(w).normalize();
        let v = w.cross(u);
        let (half_width, half_height) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let tan_y = (fov.to_radians() / 2.0).tan();
        let tan_x = tan_y * f64::from(width) / f64::from(height);
        let camera = Camera::look_at(eye, target, DVec3::Y, fov.to_radians()).unwrap();
        for (x, y, got) in rays(&camera, width, height) {
            let alpha = tan_x * (f64::from(x) + 0.5 - half_width) / half_width;
            let beta = tan_y * (half_height - f64::from(y) - 0.5) / half_height;
            assert_along(got, u * alpha + v * beta - w, "frame");
        }
    }
}

/// T. Funkhouser's lectures: points between the corners of the view plane.
#[test]
fn as_from_the_corners_of_the_view_plane() {
    for (eye, target, fov, [width, height]) in VIEWS {
        let towards = (target - eye).normalize();
        let right = towards.cross(DVec3::Y).normalize();
        let up = right.cross(towards);
        let distance = 3.0;
        let tan_y = (fov.to_radians() / 2.0).tan();
        let tan_x = tan_y * f64::from(width) / f64::from(height);
        let corner = |x: f64, y: f64| eye + (towards + right * (x * tan_x) + up * (y * tan_y)) * distance;
        let (top_left, top_right, bottom_left) = (corner(-1.0, 1.0), corner(1.0, 1.0), corner(-1.0, -1.0));
        let camera = Camera::look_at(eye, target, DVec3::Y, fov.to_radians()).unwrap();
        for (x, y, got) in rays(&camera, width, height) {
            let (s, t) = ((f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height));
            let point = top_left + (top_right - top_left) * s + (bottom_left - top_left) * t;
            assert_along(got, point - eye, "corners");
        }
    }
}

/// F. Durand's lectures: a ray of the camera that looks along -z, turned by the rotation that the view's angles give.
#[test]
fn as_from_the_rotation_of_the_view() {
    for (eye, target, fov, [width, height]) in VIEWS {
        let d = (target - eye).normalize();
        let (yaw, pitch) = ((-d.x).atan2(-d.z), d.y.asin());
        let rotation = DMat3::from_rotation_y(yaw) * DMat3::from_rotation_x(pitch);
        let focal = 1.0 / (fov.to_radians() / 2.0).tan();
        let aspect = f64::from(width) / f64::from(height);
        let camera = Camera::look_at(eye, target, DVec3::Y, fov.to_radians()).unwrap();
        for (x, y, got) in rays(&camera, width, height) {
            let s = (2.0 * (f64::from(x) + 0.5) / f64::from(width) - 1.0) * aspect;
            let t = 1.0 - 2.0 * (f64::from(y) + 0.5) / f64::from(height);
            assert_along(got, rotation * DVec3::new(s, t, -focal), "rotation");
        }
    }
}

#[test]
fn an_up_along_the_view_is_resolved() {
    let towards = |target: DVec3, up: DVec3| Camera::look_at(DVec3::ZERO, target, up, 1.0).expect("resolved");
    // What a camera along -z comes to when it is tilted all the way.
    let tilted = |y: f64| towards(DVec3::new(0.0, y, -1e-6), DVec3::Y);
    for sign in [1.0, -1.0] {
        let straight = towards(DVec3::Y * sign, DVec3::Y).frame;
        let off = straight - tilted(sign).frame;
        assert!(off.to_cols_array().iter().all(|x| x.abs() < 1e-5), "{straight}");
    }
    for up in [DVec3::X, DVec3::Z, DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 1.0, 1e-12)] {
        for sign in [1.0, -1.0] {
            let frame = towards(up * sign, up).frame;
            assert!((frame.determinant() - 1.0).abs() < 1e-12 && frame.is_finite());
            assert!((frame.z_axis + up.normalize() * sign).length() < 1e-12);
        }
    }
    assert_eq!(Camera::look_at(DVec3::X, DVec3::X, DVec3::Y, 1.0), None);
    assert_eq!(Camera::look_at(DVec3::X, DVec3::Y, DVec3::ZERO, 1.0), None);
}

#[test]
fn angles_of_view_span_the_picture() {
    let base = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0).unwrap();
    // Whole pixels are so small that the rays of those on the edges are the edges.
    let (width, height) = (60_000, 30_000);
    for (fov, half) in [
        (Fov::Vertical(1.0), [2.0 * 0.5f64.tan(), 0.5f64.tan()]),
        (Fov::Horizontal(1.0), [0.5f64.tan(), 0.5 * 0.5f64.tan()]),
        (Fov::Both { horizontal: 0.5, vertical: 2.0 }, [0.25f64.tan(), 1f64.tan()]),
    ] {
        for shift in [DVec2::ZERO, DVec2::new(0.5, -0.25)] {
            let camera = Camera { projection: Projection::Perspective(fov), shift, ..base.clone() };
            let (_, _, edge) = rays(&camera, width, height)[4];
            let expected = DVec2::new(half[0], -half[1]) + 2.0 * shift * DVec2::new(half[0], half[1]);
            let got = edge.truncate() / -edge.z;
            assert!((got - expected).abs().max_element() < 1e-4, "{fov} {shift}: {got} against {expected}");
        }
    }
}

fn with_projection(projection: Projection) -> Camera {
    let base = Camera::look_at(DVec3::new(3.0, -1.0, 2.0), DVec3::new(1.0, 4.0, -2.0), DVec3::Y, 1.0).unwrap();
    Camera { projection, ..base }
}

#[test]
fn parallel_rays_cover_the_height() {
    let camera = with_projection(Projection::Orthographic(6.0));
    let (scene, world) = (Scene::default(), World::default());
    let renderer = Renderer::new(&scene, &world, camera.clone(), settings(30, 10, 1)).unwrap();
    let [right, up, back] = [camera.frame.x_axis, camera.frame.y_axis, camera.frame.z_axis];
    for (x, y) in [(0, 0), (29, 9), (15, 2)] {
        let ray = renderer.camera_ray(x, y, 0);
        assert_along(ray.direction.as_dvec3(), -back, "parallel");
        // Pixels are 0.6 wide: 6 over 10 rows.
        let expected = camera.eye + right * (0.6 * (f64::from(x) - 14.5)) + up * (0.6 * (4.5 - f64::from(y)));
        assert!((ray.origin.as_dvec3() - expected).length() < 1e-6, "{ray:?}");
    }
}

#[test]
fn the_whole_sphere_by_longitude_and_latitude() {
    let camera = with_projection(Projection::Equirectangular);
    let (width, height) = (72, 36);
    for (x, y, got) in rays(&camera, width, height) {
        let longitude = (f64::from(x) + 0.5 - 36.0) * 5f64.to_radians();
        let latitude = (18.0 - f64::from(y) - 0.5) * 5f64.to_radians();
        let local = DMat3::from_rotation_y(-longitude) * DMat3::from_rotation_x(latitude) * DVec3::NEG_Z;
        assert_along(got, camera.frame * local, "sphere");
    }
}

/// All rays of a pixel meet in the plane of focus; at distance d from the lens they are 2 r |d - f| / f apart.
#[test]
fn the_circle_of_confusion_is_that_of_a_thin_lens() {
    let (radius, focus) = (0.25, 8.0);
    let base = with_projection(Projection::Perspective(Fov::Vertical(0.8)));
    let lens = ThinLens { radius, focus, blades: 0 };
    for camera in [base.clone(), Camera { projection: Projection::Orthographic(3.0), ..base }] {
        let camera = Camera { lens: Some(lens), ..camera };
        let (scene, world) = (Scene::default(), World::default());
        let spp = 4000;
        let renderer = Renderer::new(&scene, &world, camera.clone(), settings(1000, 1000, spp)).unwrap();
        let at_depth = |depth: f64| {
            let point = |sample| {
                let ray = renderer.camera_ray(700, 300, sample);
                let (origin, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
                let ahead = -camera.frame.z_axis;
                origin + d * ((depth - (origin - camera.eye).dot(ahead)) / d.dot(ahead))
            };
            let points: Vec<_> = (0..spp).map(point).collect();
            let middle = points.iter().sum::<DVec3>() / f64::from(spp);
            points.iter().map(|p| 2.0 * (*p - middle).length()).fold(0.0, f64::max)
        };
        // The pixel itself is as wide as 8 * 2 tan(0.4) / 1000 in the plane of focus.
        assert!(at_depth(focus) < 0.012, "{}", at_depth(focus));
        for depth in [2.0, 5.0, 16.0] {
            let expected = 2.0 * radius * (depth - focus).abs() / focus;
            assert!((at_depth(depth) - expected).abs() < 0.02, "{depth}: {} against {expected}", at_depth(depth));
        }
    }
}

/// Points that OpenCV's formula moves to a pixel must lie on that pixel's ray.
#[test]
fn distortion_is_undone() {
    let base = with_projection(Projection::Perspective(Fov::Vertical(0.9)));
    let distortion = Distortion { k1: -0.2, k2: 0.05, k3: 0.001, p1: 1e-3, p2: -2e-3 };
    let camera = Camera { distortion: Some(distortion), ..base };
    let half = camera.projection.half_extent(64.0 / 48.0).unwrap();
    for (px, py, got) in rays(&camera, 64, 48) {
        let local = camera.frame.transpose() * got;
        let (x, y) = (local.x / -local.z, local.y / local.z);
        let r2 = x * x + y * y;
        let Distortion { k1, k2, k3, p1, p2 } = distortion;
        let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
        let seen_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let seen_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        let pixel = DVec2::new((seen_x / half.x + 1.0) * 32.0, (seen_y / half.y + 1.0) * 24.0);
        assert!((pixel - DVec2::new(f64::from(px) + 0.5, f64::from(py) + 0.5)).length() < 1e-4, "{pixel}");
    }
    // Folded over before the picture's edge: there is nothing to see there, and no panic.
    let fold = Distortion { k1: -2.0, ..Distortion::default() };
    let (_, _, edge) = rays(&Camera { distortion: Some(fold), ..camera }, 64, 48)[0];
    assert_eq!(edge, DVec3::ZERO);
}

#[test]
fn cameras_that_cannot_be_are_bad_usage() {
    let base = with_projection(Projection::Perspective(Fov::Vertical(0.9)));
    let lens = |radius, focus| Some(ThinLens { radius, focus, blades: 6 });
    let narrow = Projection::Perspective(Fov::Vertical(1e-5));
    for (camera, words) in [
        (Camera { lens: lens(0.0, 1.0), ..base.clone() }, "opening"),
        (Camera { lens: lens(0.1, f64::NAN), ..base.clone() }, "focus"),
        (Camera { projection: Projection::Orthographic(0.0), ..base.clone() }, "height 0"),
        (Camera { projection: Projection::Equirectangular, lens: lens(0.1, 1.0), ..base.clone() }, "whole sphere"),
        (Camera { projection: Projection::Equirectangular, shift: DVec2::X, ..base.clone() }, "no lens shift"),
        (Camera { projection: narrow, ..base.clone() }, "neighbouring pixels"),
        (Camera { eye: DVec3::NAN, ..base.clone() }, "its place must be finite"),
        (Camera { eye: DVec3::X * 1e40, ..base.clone() }, "at most 1.844e18"),
        (Camera { lens: lens(1e300, 1.0), ..base.clone() }, "at most 1.844e18"),
        (Camera { shift: DVec2::X * 1e300, ..base.clone() }, "at most 1000 pictures"),
        (Camera { frame: DMat3::ZERO, ..base.clone() }, "unit vectors"),
        (Camera { frame: DMat3::from_cols(DVec3::X, DVec3::NAN, DVec3::Z), ..base.clone() }, "unit vectors"),
        (Camera { end: Some(Pose { eye: DVec3::INFINITY, frame: base.frame }), ..base.clone() }, "its place"),
        (Camera { shift: DVec2::NAN, ..base.clone() }, "lens shift"),
        (
            Camera { distortion: Some(Distortion { k1: f64::NAN, ..Distortion::default() }), ..base.clone() },
            "distortion",
        ),
    ] {
        let (scene, world) = (Scene::default(), World::default());
        let error = Renderer::new(&scene, &world, camera, settings(400, 300, 1)).expect_err("refused");
        assert!(matches!(error, Error::Usage(_)) && error.to_string().contains(words), "{error}");
    }
    // The smallest that the message names does work.
    let (scene, world) = (Scene::default(), World::default());
    let camera = Camera { projection: Projection::Perspective(Fov::Vertical(2.1e-3f64.to_radians())), ..base };
    let renderer = Renderer::new(&scene, &world, camera, settings(400, 300, 1)).unwrap();
    let mut directions: Vec<_> = (0..400 * 300)
        .map(|i| renderer.camera_ray(i % 400, i / 400, 0).direction.to_array().map(f32::to_bits))
        .collect();
    directions.sort_unstable();
    directions.dedup();
    assert_eq!(directions.len(), 400 * 300);
}
