//! All hits, against the rule applied to every triangle in exact arithmetic.

use std::collections::BTreeMap;

use twincast::lab::exact::{Approx, Dyadic, Rational, Ring, Vector, cross, dot, vector, zip};
use twincast::math::{Affine3, Vec3};
use twincast::scene::{Geometry, Material, Mesh, Scene};
use twincast::trace::Primitives;
use twincast::trace::bvh::{Bvh, Isa, Options, Preset};
use twincast::{Hit, Ray, Shape, Sphere, Tracer, World};

use super::{Id, Triangle, cube, grid_sphere, on_grid, triangles};
use crate::scenes::{self, Random};

/// The three signed volumes of a ray and a triangle.
fn volumes<R: Ring>(origin: &Vector<R>, d: &Vector<R>, corners: &[Vector<R>; 3]) -> [R; 3] {
    let p = [0, 1, 2].map(|k| zip(&corners[k], origin, R::sub));
    [dot(d, &cross(&p[1], &p[2])), dot(d, &cross(&p[2], &p[0])), dot(d, &cross(&p[0], &p[1]))]
}

/// How the rule applies to one ray: ids and t of the crossings, and how many triangles it touches on an edge or in a
/// corner.
fn crossings(triangles: &[Triangle], ray: &Ray) -> (BTreeMap<Id, f64>, usize) {
    // The infinitesimal, as a number: far below whatever products of the tests' coordinates are multiples of.
    let tiny = Dyadic::from_f64(2f64.powi(-900));
    let square = tiny.mul(&tiny);
    let aside = [tiny.clone(), square.clone(), square.mul(&tiny)];

    let (origin, d) = (vector::<Dyadic>(ray.origin), vector::<Dyadic>(ray.direction));
    let moved = zip(&origin, &aside, Dyadic::add);
    let mut crossed = BTreeMap::new();
    let mut groups: BTreeMap<_, (usize, Vec<(Id, f64)>)> = BTreeMap::new();
    for triangle in triangles {
        let rough = volumes::<Approx>(&vector(ray.origin), &vector(ray.direction), &triangle.in_world());
        let rough = rough.map(|volume| volume.signum());
        if rough.contains(&Some(1)) && rough.contains(&Some(-1)) {
            continue;
        }
        let corners = triangle.in_world::<Dyadic>();
        let exact = volumes(&origin, &d, &corners);
        let signs = exact.each_ref().map(Dyadic::signum);
        if signs.contains(&1) == signs.contains(&-1) {
            continue;
        }
        let normal = cross(&zip(&corners[1], &corners[0], Dyadic::sub), &zip(&corners[2], &corners[0], Dyadic::sub));
        let height = dot(&zip(&corners[0], &origin, Dyadic::sub), &normal);
        let t = Rational::new(height, dot(&d, &normal)).expect("it is not parallel").to_f64();
        if t < 0.0 || !(ray.tmin..=ray.tmax).contains(&(t as f32)) {
            continue;
        }
        let is_crossed = volumes(&moved, &d, &corners).iter().map(Dyadic::signum).collect::<Vec<_>>();
        let is_crossed = is_crossed == [1; 3] || is_crossed == [-1; 3];
        if signs.contains(&0) {
            let mut at: Vec<u32> = (0..3).filter(|&k| signs[k] != 0).map(|k| triangle.indices[k]).collect();
            at.sort_unstable();
            let (instance, geometry, _) = triangle.id;
            let group = groups.entry((instance, geometry, at, signs.contains(&1))).or_default();
            group.0 += usize::from(is_crossed);
            group.1.push((triangle.id, t));
        } else {
            assert!(is_crossed, "what is hit inside is crossed");
            crossed.insert(triangle.id, t);
        }
    }
    let touching = groups.values().map(|group| group.1.len()).sum();
    for (count, mut hits) in groups.into_values() {
        hits.sort_by_key(|hit| hit.0);
        crossed.extend(hits.into_iter().take(count));
    }
    (crossed, touching)
}

fn is_mesh(world: &World, hit: &Hit) -> bool {
    matches!(world.locate(hit).0.primitives, Primitives::Triangles { .. })
}

/// Every preset and instruction set against the rule. How many triangles each ray crosses, and touches.
#[track_caller]
fn assert_crossings(scene: &Scene, rays: &[Ray]) -> Vec<(usize, usize)> {
    let world = World::new(scene).expect("the scene is sound");
    let triangles = triangles(&world);
    let expected: Vec<_> = rays.iter().map(|ray| crossings(&triangles, ray)).collect();
    let every = Preset::ALL.into_iter().flat_map(|preset| Isa::ALL.map(|isa| (preset, isa)));
    let mut first: Vec<Vec<Hit>> = Vec::new();
    for (preset, isa) in every.filter(|(_, isa)| isa.is_available()) {
        let bvh = Bvh::build_with(&world, Options { preset, isa, progress: None });
        // What is in the list before must not matter.
        let mut hits = vec![Hit { t: 0.0, u: 0.0, v: 0.0, primitive: 7, geometry: 7, instance: 7 }];
        for (i, (ray, (expected, _))) in rays.iter().zip(&expected).enumerate() {
            bvh.all_hits(ray, &mut hits);
            assert!(hits.is_sorted_by_key(|hit| hit.t), "{preset:?} {isa:?} {ray:?} {hits:?}");
            match first.get(i) {
                None => first.push(hits.clone()),
                Some(first) => assert_eq!(*first, hits, "{preset:?} {isa:?} {ray:?}"),
            }
            let of_meshes: Vec<Hit> = hits.iter().copied().filter(|hit| is_mesh(&world, hit)).collect();
            let mut ids: Vec<Id> = of_meshes.iter().map(Hit::id).collect();
            ids.sort_unstable();
            assert_eq!(ids, expected.keys().copied().collect::<Vec<_>>(), "{preset:?} {isa:?} {ray:?} {hits:?}");
            for hit in of_meshes {
                let t = expected[&hit.id()];
                assert!((f64::from(hit.t) - t).abs() <= 2e-7 * t, "{hit:?} is at {t}");
            }
        }
    }
    expected.iter().map(|(crossed, touching)| (crossed.len(), *touching)).collect()
}

/// From `origin(random)` exactly through corners and middles of edges, at random, and along axes.
fn exact_rays(mesh: &Mesh, count: usize, seed: u64, origin: impl Fn(&mut Random) -> Vec3) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let make = |i: usize| {
        let from = on_grid(origin(&mut random));
        let [a, b, _] = mesh.triangles[random.below(mesh.triangles.len())].map(|i| mesh.positions[i as usize]);
        let axis = [Vec3::X, Vec3::Y, Vec3::Z][random.below(3)];
        match i % 5 {
            0 => Ray::new(from, a - from),
            1 => Ray::new(from, (a + b) * 0.5 - from),
            2 => Ray::new(from, random.vec3() - from),
            // In two coordinates of a corner: through it along an axis, where `origin` is outside.
            3 => Ray::new(from * axis + a * (Vec3::ONE - axis), axis * -from.dot(axis).signum()),
            _ => Ray::new(from, axis),
        }
    };
    (0..count).map(make).collect()
}

fn outside(random: &mut Random) -> Vec3 {
    let p = random.vec3();
    p + 3.0 * Vec3::ONE.copysign(p)
}

#[test]
fn a_closed_mesh_is_crossed_an_even_number_of_times_from_outside_and_an_odd_one_from_inside() {
    let mut touched = 0;
    for mesh in [grid_sphere(6, 1), grid_sphere(14, 2), cube()] {
        let from_outside = exact_rays(&mesh, 400, 3, outside);
        for (ray, (crossed, touching)) in
            from_outside.iter().zip(assert_crossings(&scenes::of_mesh(mesh.clone()), &from_outside))
        {
            assert!(crossed % 2 == 0, "{crossed} from outside, {ray:?}");
            touched += usize::from(touching > 0);
        }
        let mut from_inside = exact_rays(&mesh, 400, 4, |random| random.vec3() * 0.3);
        from_inside.retain(|ray| ray.origin.abs().max_element() < 0.35);
        for (ray, (crossed, touching)) in from_inside.iter().zip(assert_crossings(&scenes::of_mesh(mesh), &from_inside))
        {
            assert!(crossed % 2 == 1, "{crossed} from inside, {ray:?}");
            touched += usize::from(touching > 0);
        }
    }
    assert!(touched > 700, "only {touched} rays went through an edge or a corner");
}

#[test]
fn rays_along_sides_and_edges_of_a_cube() {
    let mut rays = Vec::new();
    for y in [-1.0, -0.5, 0.0, 1.0] {
        for z in [-1.0, 0.25, 1.0] {
            rays.push(Ray::new(Vec3::new(-3.0, y, z), Vec3::X));
            rays.push(Ray::new(Vec3::new(-3.0, y, z), Vec3::new(1.0, 1.0, 0.0)));
            rays.push(Ray::new(Vec3::new(z, -3.0, y), Vec3::new(0.0, 1.0, 0.5)));
        }
    }
    for (ray, (crossed, _)) in rays.iter().zip(assert_crossings(&scenes::of_mesh(cube()), &rays)) {
        assert!(crossed == 0 || crossed == 2, "{crossed} {ray:?}");
    }
}

#[test]
fn many_geometries_with_large_triangles_and_limited_ranges() {
    let geometries = [cube(), scenes::soup(2000, 0.02, 3), scenes::soup(30, 2.0, 4), cube()].map(Geometry::Mesh);
    let scene = Scene::from_geometries(geometries.into(), vec![Material::default()]);
    let mut rays = exact_rays(&cube(), 300, 8, outside);
    for (i, ray) in rays.iter_mut().enumerate() {
        match i % 3 {
            0 => (ray.tmin, ray.tmax) = (0.7, 1.4),
            1 => ray.tmax = 0.9,
            _ => {}
        }
    }
    let counts = assert_crossings(&scene, &rays);
    assert!(counts.iter().map(|(crossed, _)| crossed).sum::<usize>() > 600, "cubes that coincide count each");
}

#[test]
fn placed_objects_and_spheres() {
    let scene = scenes::instanced(5);
    let world = World::new(&scene).expect("sound");
    let place = |p: Vec3, to_world: &Option<Affine3>| to_world.map_or(p, |to_world| to_world.transform_point3(p));
    let mut targets: Vec<Vec3> = triangles(&world).iter().map(|t| place(t.corners[0], &t.to_world)).collect();
    let corners = targets.len();
    for placement in &world.placements {
        for part in &world.parts[world.objects[placement.object as usize].clone()] {
            let Primitives::Shapes(shapes) = &part.primitives else { continue };
            targets.extend(shapes.iter().map(|shape| placement.to_world.transform_point3(shape.bounds().centre())));
        }
    }
    assert!(targets.len() > corners, "there are spheres");
    let mut random = Random::new(6);
    let rays: Vec<Ray> = (0..200)
        .map(|i| {
            let origin = outside(&mut random) * 5.0;
            let among = if i % 2 == 0 { 0..corners } else { corners..targets.len() };
            Ray::new(origin, targets[among.start + random.below(among.len())] - origin)
        })
        .collect();
    let crossed: usize = assert_crossings(&scene, &rays).iter().map(|(crossed, _)| crossed).sum();
    assert!(crossed > 100, "{crossed}");
    let bvh = Bvh::build(&world);
    let (mut hits, mut spheres) = (Vec::new(), 0);
    for ray in &rays {
        bvh.all_hits(ray, &mut hits);
        let of_spheres = hits.iter().filter(|hit| !is_mesh(&world, hit)).count();
        assert!(of_spheres % 2 == 0, "{of_spheres} {ray:?}");
        spheres += of_spheres;
    }
    assert!(spheres >= 200, "{spheres}");
}

#[test]
fn a_sphere_is_entered_and_left() {
    let sphere = |x: f32, radius: f32| Shape::Sphere(Sphere { centre: Vec3::new(x, 0.0, 0.0), radius });
    let shapes = vec![sphere(0.0, 1.0), sphere(5.0, 2.0), sphere(0.0, 0.5)];
    let scene = Scene::from_geometries(vec![Geometry::Shapes { shapes, material: 0 }], vec![Material::default()]);
    let bvh = Bvh::build(&World::new(&scene).expect("sound"));
    let mut hits = Vec::new();
    let mut found = |ray: Ray| {
        bvh.all_hits(&ray, &mut hits);
        hits.iter().map(|hit| (hit.t, hit.primitive)).collect::<Vec<_>>()
    };
    let ray = Ray::new(Vec3::new(-2.0, 0.0, 0.0), Vec3::X);
    assert_eq!(found(ray), [(1.0, 0), (1.5, 2), (2.5, 2), (3.0, 0), (5.0, 1), (9.0, 1)]);
    assert_eq!(found(Ray { tmin: 1.25, tmax: 5.0, ..ray }), [(1.5, 2), (2.5, 2), (3.0, 0), (5.0, 1)]);
    assert_eq!(
        found(Ray { origin: Vec3::new(-2.0, 1.0, 0.0), ..ray }),
        [(2.0, 0), (2.0, 0), (7.0 - 3f32.sqrt(), 1), (7.0 + 3f32.sqrt(), 1)]
    );
    assert_eq!(found(Ray { direction: Vec3::NAN, ..ray }), []);
}

#[test]
fn the_first_of_all_hits_is_the_closest_where_no_edge_is_touched() {
    let mesh = scenes::soup(3000, 0.2, 11);
    let rays = scenes::rays(4000, &mesh.positions.clone(), 12);
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(mesh)).expect("sound"));
    let (mut hits, mut count) = (Vec::new(), 0);
    // Those at random: a corner of a soup may be touched and not crossed.
    for ray in rays.iter().step_by(4) {
        bvh.all_hits(ray, &mut hits);
        assert_eq!(hits.first().copied(), bvh.closest(ray), "{ray:?}");
        count += hits.len();
    }
    assert!(count > 800, "{count}");
}
