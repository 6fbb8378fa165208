use super::*;
use crate::math::{Affine3, Random};
use crate::scene::{Group, Instance, Material};
use crate::shape::{Plane, Sphere};
use crate::trace::Tracer;
use crate::trace::brute::Brute;

/// In [0, 1).
fn unit(random: &mut Random) -> f64 {
    random.unit().into()
}

/// In the cube [-0.5, 0.5)^3.
fn vector(random: &mut Random) -> DVec3 {
    0.5 * random.vector().as_dvec3()
}

fn mesh_scene(corners: [Vec3; 3], transform: DAffine3) -> Scene {
    let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]]);
    let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
    scene.instances[0].transform = transform;
    scene
}

fn hit(t: f32) -> Hit {
    Hit { t, u: 0.9, v: 0.9, primitive: 0, geometry: 0, instance: 0 }
}

/// Möller and Trumbore's test as engines run it, in f32.
fn meets_f32(ray: &Ray, [a, b, c]: [Vec3; 3]) -> bool {
    let (e1, e2) = (b - a, c - a);
    let p = ray.direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin - a;
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = ray.direction.dot(q) * inverse;
    let t = e2.dot(q) * inverse;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= ray.tmin && t <= ray.tmax
}

fn meets_f64(ray: &Ray, corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let d = ray.direction.as_dvec3();
    let p = d.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin.as_dvec3() - a;
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = d.dot(q) * inverse;
    let t = e2.dot(q) * inverse;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0
}

/// A ray from a random side at a random point of the triangle.
fn ray_at(random: &mut Random, [a, b, c]: [Vec3; 3]) -> Ray {
    let (u, v) = (unit(random), unit(random));
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
    let target = a + (b - a) * u + (c - a) * v;
    let origin = target + vector(random) * (b - a).length() * 5.0;
    Ray::new(origin.as_vec3(), (target - origin).as_vec3())
}

#[test]
fn spawned_rays_leave_their_triangle() {
    let mut random = Random::new(0, 0);
    let mut spawned = 0;
    for scale in -8..=8 {
        for _ in 0..2000 {
            let size = 10f64.powi(scale);
            // Near zero, and away from it by up to 100 times its size.
            let place = vector(&mut random) * size * if unit(&mut random) < 0.5 { 0.0 } else { 100.0 };
            let [a, b] = [(); 2].map(|()| place + vector(&mut random) * size);
            // Half of them slivers, down to a height of 10^-4 of their length.
            let sliver = 10f64.powf(-4.0 * unit(&mut random));
            let c = if unit(&mut random) < 0.5 { place } else { a.lerp(b, unit(&mut random)) }
                + vector(&mut random) * size * sliver;
            let corners = [a, b, c].map(|p| p.as_vec3());
            let scene = mesh_scene(corners, DAffine3::IDENTITY);
            let world = World::new(&scene).unwrap();
            let Primitives::Triangles { positions, .. } = &world.parts[0].primitives else { unreachable!() };
            let corners = [positions[0], positions[1], positions[2]];
            let ray = ray_at(&mut random, corners);
            let point = SurfacePoint::new(&scene, &world, &ray, &hit(1.0), Attributes::ALL);
            for _ in 0..4 {
                let direction = vector(&mut random).normalize().as_vec3();
                let away = point.spawn(direction, f32::INFINITY);
                assert!(!meets_f32(&away, corners), "f32: {corners:?} {away:?} {}", point.error);
                assert!(!meets_f64(&away, corners), "f64: {corners:?} {away:?} {}", point.error);
                let target = point.position + direction.as_dvec3() * size;
                assert!(!meets_f32(&point.spawn_to(target), corners), "to a point: {corners:?}");
                spawned += 1;
            }
        }
    }
    assert_eq!(spawned, 17 * 2000 * 4);
}

/// The test above can fail: without the offset about half of the rays meet their triangle again.
#[test]
fn rays_without_an_offset_do_not_leave() {
    let mut random = Random::new(7, 0);
    let mut again = 0;
    for _ in 0..1000 {
        let corners = [(); 3].map(|()| (vector(&mut random) + DVec3::splat(3.0)).as_vec3());
        let scene = mesh_scene(corners, DAffine3::IDENTITY);
        let world = World::new(&scene).unwrap();
        let ray = ray_at(&mut random, corners);
        let point = SurfacePoint::new(&scene, &world, &ray, &hit(1.0), Attributes::ALL);
        let away = Ray::new(point.position.as_vec3(), vector(&mut random).normalize().as_vec3());
        again += usize::from(meets_f32(&away, corners));
    }
    assert!(again > 200, "{again}");
}

#[test]
fn the_point_does_not_depend_on_what_the_engine_computed() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let scene = mesh_scene(corners, DAffine3::IDENTITY);
    let world = World::new(&scene).unwrap();
    let ray = Ray::new(Vec3::new(0.25, 0.5, 2.0), Vec3::NEG_Z);
    let point = SurfacePoint::new(&scene, &world, &ray, &hit(2.0), Attributes::ALL);
    let other = Hit { t: 1.9, u: f32::NAN, v: 0.0, ..hit(0.0) };
    assert_eq!(point, SurfacePoint::new(&scene, &world, &ray, &other, Attributes::ALL));
    assert_eq!(point.position, DVec3::new(0.25, 0.5, 0.0));
    assert_eq!((point.t, point.parameters), (2.0, [0.25, 0.5]));
    assert_eq!((point.normal, point.front), (DVec3::Z, true));
    let behind = Ray::new(Vec3::new(0.25, 0.5, -2.0), Vec3::Z);
    let point = SurfacePoint::new(&scene, &world, &behind, &hit(2.0), Attributes::ALL);
    assert_eq!((point.normal, point.front), (DVec3::NEG_Z, false));
}

#[test]
fn a_missed_triangle_is_met_at_its_edge() {
    let scene = mesh_scene([Vec3::ZERO, Vec3::X, Vec3::Y], DAffine3::IDENTITY);
    let world = World::new(&scene).unwrap();
    for (x, y, direction) in [(-0.001, 0.5, Vec3::NEG_Z), (0.6, 0.6, Vec3::NEG_Z), (0.2, 0.2, Vec3::X)] {
        let ray = Ray::new(Vec3::new(x, y, 0.0), direction);
        let point = SurfacePoint::new(&scene, &world, &ray, &hit(0.0), Attributes::ALL);
        let [u, v] = point.parameters;
        assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-15, "{u} {v}");
        assert!(point.position.is_finite() && point.error.is_finite());
    }
}

#[test]
fn shading_normals_follow_a_skewed_mirroring_transform() {
    let transform = DAffine3::from_mat3(DMat3::from_cols(DVec3::X * -2.0, DVec3::Y, DVec3::Z * 3.0));
    let mut scene = mesh_scene([Vec3::ZERO, Vec3::new(1.0, 0.0, -1.0), Vec3::Y], transform);
    let Geometry::Mesh(mesh) = &mut scene.geometries[0] else { unreachable!() };
    let geometric = Vec3::new(1.0, 0.0, 1.0).normalize();
    mesh.normals = vec![geometric; 3];
    let world = World::new(&scene).unwrap();
    let ray = Ray::new(Vec3::new(-10.0, 0.25, 10.0), Vec3::new(9.5, 0.0, -10.75));
    let point = SurfacePoint::new(&scene, &world, &ray, &hit(1.0), Attributes::ALL);
    // The plane's own normal after the transform is the exact answer.
    assert!((point.shading_normal - point.normal).length() < 1e-7, "{point:?}");
    assert!(point.front, "mirrored winding is turned back");
    // Flat where the normal is zero, and where normals are not wanted.
    let Geometry::Mesh(mesh) = &mut scene.geometries[0] else { unreachable!() };
    mesh.normals = vec![Vec3::ZERO; 3];
    let point = SurfacePoint::new(&scene, &world, &ray, &hit(1.0), Attributes::ALL);
    assert_eq!(point.shading_normal, point.normal);
}

#[test]
fn attributes_are_interpolated_and_can_be_switched_off() {
    let mut scene = mesh_scene([Vec3::ZERO, Vec3::X, Vec3::Y], DAffine3::IDENTITY);
    let Geometry::Mesh(mesh) = &mut scene.geometries[0] else { unreachable!() };
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
    mesh.colors = vec![Vec4::W, Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0)];
    let world = World::new(&scene).unwrap();
    let ray = Ray::new(Vec3::new(0.25, 0.5, 2.0), Vec3::NEG_Z);
    let point = SurfacePoint::new(&scene, &world, &ray, &hit(2.0), Attributes::ALL);
    assert_eq!((point.uv, point.color), (Vec2::new(0.25, 0.5), Vec4::new(0.25, 0.5, 0.0, 1.0)));
    let bare = SurfacePoint::new(&scene, &world, &ray, &hit(2.0), Attributes::default());
    assert_eq!((bare.uv, bare.color), (Vec2::ZERO, Vec4::ONE));
}

/// A plane has no extent, and zero no rounding of its own: the way there must be enough to leave it.
#[test]
fn rays_leave_a_plane_at_zero() {
    let plane = Shape::Plane(Plane::new(Vec3::ZERO, Vec3::Y).unwrap());
    let geometry = Geometry::Shapes { shapes: vec![plane], material: 0 };
    let scene = Scene::from_geometries(vec![geometry], vec![Material::default()]);
    let world = World::new(&scene).unwrap();
    let brute = Brute::new(&world);
    for direction in [Vec3::NEG_Y, Vec3::new(0.3, -1.0, 0.7)] {
        let ray = Ray::new(direction * -7.0, direction);
        let hit = brute.closest(&ray).unwrap();
        let point = SurfacePoint::new(&scene, &world, &ray, &hit, Attributes::ALL);
        for away in [Vec3::Y, Vec3::NEG_Y, Vec3::new(1.0, 1e-3, 0.0)] {
            assert!(!brute.occluded(&point.spawn(away, f32::INFINITY)), "{point:?}");
        }
    }
}

/// A sphere placed twice is traced as an object, under a transform that makes it an ellipsoid.
#[test]
fn placed_shapes_have_their_exact_point_and_either_root() {
    let sphere = Shape::Sphere(Sphere { centre: Vec3::new(1.0, 0.0, 0.0), radius: 1.0 });
    let mut scene =
        Scene::from_geometries(vec![Geometry::Shapes { shapes: vec![sphere], material: 0 }], vec![Material::default()]);
    let transform = DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.0));
    scene.groups = vec![Group { name: String::new(), geometries: 0..1 }];
    scene.instances = vec![Instance { name: String::new(), group: 0, transform, transform_end: None }; 2];
    let world = World::new(&scene).unwrap();
    assert_eq!(world.placements[0].to_world, Affine3::from_scale(Vec3::new(2.0, 1.0, 1.0)));
    // x = 2 + sqrt(2) is the object's 1 + 1/sqrt(2): the ellipsoid's normal there is (1/2, 1) normalised.
    let ray = Ray::new(Vec3::new(2.0 + 2f32.sqrt(), 4.0, 0.0), Vec3::NEG_Y);
    for (t, sign) in [(3.3f32, 1.0), (4.7, -1.0)] {
        let point = SurfacePoint::new(&scene, &world, &ray, &hit(t), Attributes::ALL);
        let expected = DVec3::new(2.0 + 2f64.sqrt(), sign * 0.5f64.sqrt(), 0.0);
        assert!((point.position - expected).length() < 1e-6, "{point:?}");
        let normal = DVec3::new(sign * 0.5, 1.0, 0.0).normalize();
        assert!((point.normal - normal).length() < 1e-6, "{point:?}");
        assert_eq!(point.front, sign > 0.0);
    }
}
