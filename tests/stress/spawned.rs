//! Rays that start on surfaces, from 1e-8 to 1e8: none meets what it leaves, and none passes what is near.

use twincast::math::Random;
use twincast::math::{DVec3, Vec3};
use twincast::scene::{Geometry, Material, Mesh, Scene};
use twincast::shade::surface::{Attributes, SurfacePoint};
use twincast::trace::bvh::Bvh;
use twincast::{Ray, Shape, Sphere, Tracer, World};

/// Eight faces, each cut in four as often as `levels` says, on the unit sphere.
fn ball(levels: u32) -> Vec<[DVec3; 3]> {
    let mut faces = Vec::new();
    for sides in 0..8u32 {
        let side = |axis: u32| if sides >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let [x, y, z] = [DVec3::X * side(0), DVec3::Y * side(1), DVec3::Z * side(2)];
        faces.push(if sides.count_ones().is_multiple_of(2) { [x, y, z] } else { [x, z, y] });
    }
    for _ in 0..levels {
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [(a + b), (b + c), (c + a)].map(DVec3::normalize);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    faces
}

/// A square plate that stands off by `gap` from where `point` is, across `normal`.
fn plate(point: DVec3, normal: DVec3, gap: f64, size: f64) -> [[DVec3; 3]; 2] {
    let (x, y) = normal.any_orthonormal_pair();
    let corner = |a: f64, b: f64| point + normal * gap + (x * a + y * b) * size;
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    [[a, b, c], [a, c, d]]
}

fn scene(faces: &[[DVec3; 3]], sphere: Option<Sphere>) -> Scene {
    let positions = faces.concat().iter().map(|p| p.as_vec3()).collect();
    let triangles = (0..faces.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let shapes = sphere.map(|sphere| Geometry::Shapes { shapes: vec![Shape::Sphere(sphere)], material: 0 });
    let geometries = [Geometry::Mesh(Mesh::new(positions, triangles))].into_iter().chain(shapes).collect();
    Scene::from_geometries(geometries, vec![Material::default()])
}

/// From a convex surface, outwards: everything is free but for a plate 20 millionths of the size away, which hides it
/// all. Farther from zero f32 itself moves the plate by a tenth of that.
#[test]
fn nothing_is_met_again_and_nothing_near_is_passed() {
    let mut random = Random::new(1, 0);
    let (mut free, mut hidden) = (0, 0);
    for decade in -8..=8 {
        let size = 10f64.powi(decade);
        for (is_round, place) in [(false, 0.0), (false, 30.0), (true, 0.0), (true, 30.0)] {
            let centre = DVec3::new(0.3, -0.7, 0.5) * place * size;
            let faces: Vec<_> = ball(3).into_iter().map(|face| face.map(|p| centre + p * size)).collect();
            let sphere = Sphere { centre: centre.as_vec3(), radius: size as f32 };
            let (mesh, sphere) = if is_round { (&faces[..0], Some(sphere)) } else { (&faces[..], None) };
            let alone = scene(mesh, sphere);
            let world = World::new(&alone).expect("sound");
            let bvh = Bvh::build(&world);
            let mut asked = 0;
            while asked < 60 {
                let start = centre - world.centre + random.direction().as_dvec3() * size * 4.0;
                let target = centre - world.centre + random.vector().as_dvec3() * size * 0.5;
                let ray = Ray::new(start.as_vec3(), (target - start).as_vec3());
                let Some(hit) = bvh.closest(&ray) else { continue };
                asked += 1;
                let point = SurfacePoint::new(&alone, &world, &ray, &hit, Attributes::ALL);
                let towards_normal = |v: DVec3| if v.dot(point.normal) < 0.0 { -v } else { v };
                let outwards = towards_normal(random.direction().as_dvec3());
                // At a tangent to a round surface there is nothing to be sure of.
                if outwards.dot(point.normal) < 0.05 {
                    continue;
                }
                let away = point.spawn(outwards.as_vec3(), f32::INFINITY);
                assert!(!bvh.occluded(&away), "1e{decade}: {away:?} meets what it leaves");
                let light = point.position + outwards * size * 3.0;
                assert!(!bvh.occluded(&point.spawn_to(light)), "1e{decade}: a light is hidden by what it shines on");
                free += 1;

                // Seen from the same side, since the plate stands where the ray came from.
                let cover = plate(point.position + world.centre, point.normal, 2e-5 * size, 0.5 * size);
                let covered = scene(&[mesh, &cover[..]].concat(), sphere);
                let covered = World::new(&covered).expect("sound");
                let move_over = (world.centre - covered.centre).as_vec3();
                let covered_bvh = Bvh::build(&covered);
                let shadow = point.spawn_to(light);
                let shadow = Ray { origin: shadow.origin + move_over, ..shadow };
                assert!(covered_bvh.occluded(&shadow), "1e{decade}: the plate's shadow has left its place");
                hidden += 1;
            }
        }
    }
    assert!(free > 2000 && hidden == free, "{free} {hidden}");
}

/// The test above can fail: rays that start where f32 says the surface is meet it again.
#[test]
fn without_an_offset_surfaces_are_met_again() {
    let faces = ball(3);
    let alone = scene(&faces, None);
    let world = World::new(&alone).expect("sound");
    let bvh = Bvh::build(&world);
    let mut random = Random::new(2, 0);
    let mut again = 0;
    for _ in 0..400 {
        let start = random.direction() * 4.0;
        let ray = Ray::new(start, random.vector() * 0.5 - start);
        let Some(hit) = bvh.closest(&ray) else { continue };
        let point = ray.origin + ray.direction * hit.t;
        let outwards = point.normalize() + random.direction() * 0.5;
        again +=
            usize::from(bvh.occluded(&Ray { origin: point, direction: outwards, ..Ray::new(Vec3::ZERO, Vec3::X) }));
    }
    assert!(again > 50, "{again}");
}

/// A sphere of 16 by 8 faces that normals make smooth, lit from the side.
fn smooth_sphere() -> Scene {
    let (around, down) = (16u32, 8u32);
    let point = |column: u32, row: u32| {
        let (a, b) = (f64::from(column) / f64::from(around), f64::from(row) / f64::from(down));
        let (x, z) = (std::f64::consts::TAU * a).sin_cos();
        let (r, y) = (std::f64::consts::PI * b).sin_cos();
        DVec3::new(x * r, y, z * r).as_vec3()
    };
    let positions: Vec<Vec3> =
        (0..=down).flat_map(|row| (0..=around).map(move |column| (column, row))).map(|(c, r)| point(c, r)).collect();
    let at = |column: u32, row: u32| row * (around + 1) + column;
    let mut triangles = Vec::new();
    for row in 0..down {
        for column in 0..around {
            let [a, b] = [at(column, row), at(column + 1, row)];
            let [c, d] = [at(column, row + 1), at(column + 1, row + 1)];
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    let mut mesh = Mesh::new(positions.clone(), triangles);
    mesh.normals = positions;
    Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
}

/// Of the points that the normals say are lit, the share that is in shadow, and of those that are hit.
fn wrongly_dark(attributes: Attributes) -> f64 {
    let scene = smooth_sphere();
    let world = World::new(&scene).expect("sound");
    let bvh = Bvh::build(&world);
    // Not along the edges between columns, where facets are as bright as what they stand for.
    let light = Vec3::new(0.97, 0.1, 0.2);
    let (mut dark, mut seen) = (0, 0);
    for y in 0..200u8 {
        for x in 0..200u8 {
            let from = Vec3::new((f32::from(x) - 99.5) / 95.0, (f32::from(y) - 99.5) / 95.0, 4.0);
            let ray = Ray::new(from, Vec3::NEG_Z);
            let Some(hit) = bvh.closest(&ray) else { continue };
            seen += 1;
            let smooth = SurfacePoint::new(&scene, &world, &ray, &hit, Attributes::ALL).shading_normal;
            let point = SurfacePoint::new(&scene, &world, &ray, &hit, attributes);
            let is_lit = point.is_above(light.as_dvec3()) && !bvh.occluded(&point.spawn(light, f32::INFINITY));
            dark += u32::from(smooth.dot(light.as_dvec3()) > 0.0 && !is_lit);
        }
    }
    f64::from(dark) / f64::from(seen)
}

/// Shadows end where the light does on the smooth surface (Hanika 2021, *Hacking the shadow terminator*), and do not
/// where rays leave from the facets.
#[test]
fn the_shadow_terminator_is_that_of_the_smooth_surface() {
    let (smooth, faceted) = (wrongly_dark(Attributes::ALL), wrongly_dark(Attributes::default()));
    assert!(smooth < 0.01, "{smooth}");
    assert!(faceted > 0.02, "{faceted}");
}
