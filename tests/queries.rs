//! All hits and closest points, against a look at every primitive.

use std::collections::BTreeMap;

use twincast::lab::exact::{Approx, Dyadic, Rational, Ring, Vector, cross, dot, vector, zip};
use twincast::math::{Affine3, DVec3, Vec3};
use twincast::scene::{Geometry, Material, Mesh, Scene};
use twincast::trace::Primitives;
use twincast::trace::bvh::{Bvh, Isa, Options, Preset};
use twincast::{Hit, Ray, Shape, Sphere, Tracer, World};

use crate::scenes::{self, Random};

type Id = (u32, u32, u32);

/// A triangle of the world: corners in the part's coordinates, where the part is placed, and names.
struct Triangle {
    corners: [Vec3; 3],
    indices: [u32; 3],
    to_world: Option<Affine3>,
    id: Id,
}

/// Every triangle, placed ones as often as they are placed.
fn triangles(world: &World) -> Vec<Triangle> {
    let mut all = Vec::new();
    let mut add = |p: usize, placed: Option<(u32, Affine3)>| {
        let part = &world.parts[p];
        let Primitives::Triangles { positions, triangles } = &part.primitives else { return };
        for (i, &indices) in triangles.iter().enumerate() {
            all.push(Triangle {
                corners: indices.map(|i| positions[i as usize]),
                indices,
                to_world: placed.map(|(_, to_world)| to_world),
                id: (placed.map_or(part.instance, |(instance, _)| instance), part.geometry, i as u32),
            });
        }
    };
    world.fixed.clone().for_each(|p| add(p, None));
    for placement in &world.placements {
        let parts = world.objects[placement.object as usize].clone();
        parts.for_each(|p| add(p, Some((placement.instance, placement.to_world))));
    }
    all
}

impl Triangle {
    fn in_world<R: Ring>(&self) -> [Vector<R>; 3] {
        self.corners.map(|p| {
            let p = vector::<R>(p);
            let Some(to_world) = &self.to_world else { return p };
            let rows = to_world.matrix3.transpose();
            [0, 1, 2].map(|i| dot(&vector(rows.col(i)), &p).add(&R::new(to_world.translation[i])))
        })
    }
}

/// The three signed volumes of a ray and a triangle.
fn volumes<R: Ring>(origin: &Vector<R>, d: &Vector<R>, corners: &[Vector<R>; 3]) -> [R; 3] {
    let p = [0, 1, 2].map(|k| zip(&corners[k], origin, R::sub));
    [dot(d, &cross(&p[1], &p[2])), dot(d, &cross(&p[2], &p[0])), dot(d, &cross(&p[0], &p[1]))]
}

/// How the rule applies to one ray: ids and t of the crossings, and how many triangles it touches on an edge or in a corner.
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
        if !(ray.tmin..=ray.tmax).contains(&(t as f32)) {
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

/// On a grid of 1/512, so that differences of positions and middles of edges are exact.
fn on_grid(p: Vec3) -> Vec3 {
    (p * 512.0).round() / 512.0
}

fn grid_sphere(n: usize, seed: u64) -> Mesh {
    let mut mesh = scenes::bumpy_sphere(n, 0.4, seed);
    let positions: Vec<Vec3> = mesh.positions.iter().map(|&p| on_grid(p)).collect();
    mesh.positions = positions.into();
    mesh
}

/// A box from -1 to 1, two triangles a side.
fn cube() -> Mesh {
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * 2.0 - 1.0;
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Mesh::new((0..8).map(corner).collect(), halves.collect())
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
            targets.extend(shapes.iter().map(|Shape::Sphere(s)| placement.to_world.transform_point3(s.centre)));
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

/// The nearest point of a triangle, region by region (Ericson 2005, *Real-Time Collision Detection*, 5.1.5).
fn ericson(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))
}

/// Every preset against every triangle.
#[track_caller]
fn assert_closest_points(scene: &Scene, points: &[Vec3]) {
    let world = World::new(scene).expect("the scene is sound");
    let placed = |t: &Triangle| {
        let to_world = t.to_world.map(|to_world| to_world.as_daffine3());
        t.corners.map(|p| to_world.map_or(p.as_dvec3(), |to_world| to_world.transform_point3(p.as_dvec3())))
    };
    let all: BTreeMap<Id, [DVec3; 3]> = triangles(&world).iter().map(|t| (t.id, placed(t))).collect();
    let distance = |p: Vec3, corners: &[DVec3; 3]| ericson(p.as_dvec3(), *corners).distance(p.as_dvec3());
    let bvhs = Preset::ALL.map(|preset| Bvh::build_with(&world, Options { preset, ..Options::default() }));
    for &p in points {
        let nearest = all.values().map(|corners| distance(p, corners)).fold(f64::INFINITY, f64::min);
        let found = bvhs[0].closest_point(p, f32::INFINITY).expect("there are triangles");
        let id = (found.instance, found.geometry, found.primitive);
        let is_near = |d: f64| (d - nearest).abs() <= 2e-7 * nearest + 1e-12;
        assert!(is_near(found.distance.into()) && is_near(distance(p, &all[&id])), "{p} is at {nearest}: {found:?}");
        let [a, b, c] = all[&id];
        let (u, v) = (f64::from(found.u), f64::from(found.v));
        let there = a * (1.0 - u - v) + b * u + c * v;
        let far = there.abs().max_element() + nearest;
        assert!(there.distance(found.point.as_dvec3()) <= 1e-6 * far, "{found:?} is at {there}");
        assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-7, "{found:?}");
        for bvh in &bvhs {
            assert_eq!(bvh.closest_point(p, f32::INFINITY), Some(found), "{:?} {p}", bvh.preset());
            assert_eq!(bvh.closest_point(p, found.distance), Some(found), "the range is closed");
            if found.distance > 0.0 {
                assert_eq!(bvh.closest_point(p, found.distance.next_down()), None);
            }
        }
    }
}

fn points(count: usize, reach: f32, seed: u64) -> Vec<Vec3> {
    let mut random = Random::new(seed);
    (0..count).map(|i| random.vec3() * if i % 2 == 0 { reach } else { 1.0 }).collect()
}

#[test]
fn closest_points_of_soups_and_closed_meshes() {
    for mesh in [scenes::soup(2000, 0.02, 1), scenes::soup(300, 1.0, 2), scenes::bumpy_sphere(24, 0.2, 3), cube()] {
        assert_closest_points(&scenes::of_mesh(mesh), &points(200, 5.0, 4));
    }
}

#[test]
fn closest_points_of_placed_objects() {
    assert_closest_points(&scenes::instanced(5), &points(200, 6.0, 7));
}

#[test]
fn closest_points_of_triangles_without_an_area() {
    let mut mesh = scenes::soup(200, 0.3, 8);
    // On a grid, so that middles are exact: each third corner is between the others, or one of them.
    let mut positions: Vec<Vec3> = mesh.positions.iter().map(|&p| on_grid(p)).collect();
    for i in (0..positions.len()).step_by(3) {
        positions[i + 2] = if i % 2 == 0 { (positions[i] + positions[i + 1]) * 0.5 } else { positions[i] };
    }
    positions[7] = Vec3::NAN;
    mesh.positions = positions.into();
    let world = World::new(&scenes::of_mesh(mesh.clone())).expect("sound");
    let bvh = Bvh::build(&world);
    for p in points(200, 3.0, 9) {
        // All of them are their first edge.
        let edges = triangles(&world).into_iter().filter(|t| !t.corners.iter().any(|p| p.is_nan()));
        let distances = edges.map(|t| {
            let [a, b] = [t.corners[0].as_dvec3(), t.corners[1].as_dvec3()];
            let share = (p.as_dvec3() - a).dot(b - a) / (b - a).length_squared();
            (a + (b - a) * share.clamp(0.0, 1.0)).distance(p.as_dvec3())
        });
        let nearest = distances.fold(f64::INFINITY, f64::min);
        let found = bvh.closest_point(p, f32::INFINITY).expect("there are triangles");
        assert!((f64::from(found.distance) - nearest).abs() <= 2e-7 * nearest, "{p} is at {nearest}: {found:?}");
    }
}

#[test]
fn at_equal_distances_the_lowest_id_is_closest() {
    let mesh = grid_sphere(12, 5);
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(mesh.clone())).expect("sound"));
    for (i, &p) in mesh.positions.iter().enumerate() {
        let lowest = mesh.triangles.iter().position(|corners| corners.contains(&(i as u32))).expect("it is used");
        let found = bvh.closest_point(p, 0.0).expect("it is a corner");
        assert_eq!((found.distance, found.primitive as usize, found.point), (0.0, lowest, p));
    }
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(cube())).expect("sound"));
    let lowest = |p: Vec3| bvh.closest_point(p, 10.0).map(|found| (found.primitive, found.distance));
    assert_eq!(lowest(Vec3::ZERO), Some((0, 1.0)), "all sides, and both halves of each");
    assert_eq!(lowest(Vec3::new(3.0, 0.0, 0.0)), Some((2, 2.0)), "the diagonal of a side");
    assert_eq!(lowest(Vec3::new(4.0, 5.0, 1.0)), Some((2, 5.0)), "an edge");
}

#[test]
fn there_is_no_closest_point() {
    let bvh = Bvh::build(&World::new(&scenes::of_mesh(cube())).expect("sound"));
    for bad in [Vec3::NAN, Vec3::new(0.0, f32::NAN, 0.0), Vec3::INFINITY] {
        assert_eq!(bvh.closest_point(bad, f32::INFINITY), None);
    }
    for max_distance in [-1.0, f32::NAN, 0.5] {
        assert_eq!(bvh.closest_point(Vec3::ZERO, max_distance), None);
    }
    let empty = Bvh::build(&World::new(&scenes::of_mesh(Mesh::new(Vec::new(), Vec::new()))).expect("sound"));
    assert_eq!(empty.closest_point(Vec3::ZERO, f32::INFINITY), None);
}
