//! Packets of eight rays, and two of them at once, against single rays to the last bit, and against brute force.

use twincast::math::Vec3;
use twincast::scene::{Geometry, Material, Mesh, Scene};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::{Asked, Bvh, Isa, Options, Packet, PacketHits, Preset, SingleRay};
use twincast::{Hit, Ray, Tracer, World};

use super::{closest_triangle, grid_sphere};
use crate::scenes::{Random, soup};

/// Spheres whose corners are exact, a copy of one with its faces in another order and turned, and triangles without
/// order.
fn world() -> (World, Vec<Vec3>) {
    let sphere = grid_sphere(9, 1);
    let larger: Vec<Vec3> = sphere.positions.iter().map(|&p| p * 2.0).collect();
    let larger = Mesh::new(larger, sphere.triangles.to_vec());
    let turned = larger.triangles.iter().rev().map(|&[a, b, c]| [c, b, a]);
    let copy = Mesh::new(larger.positions.to_vec(), turned.collect());
    let mut corners = sphere.positions.to_vec();
    corners.extend(&larger.positions[..]);
    let geometries = [sphere, larger, copy, soup(300, 0.2, 3)].map(Geometry::Mesh).to_vec();
    let scene = Scene::from_geometries(geometries, vec![Material::default()]);
    (World::new(&scene).expect("a world"), corners)
}

/// Sixteen rays that have something in common, or nothing.
fn families(corners: &[Vec3]) -> Vec<[Ray; 16]> {
    let mut random = Random::new(11);
    let mut all = Vec::new();
    for round in 0..60 {
        let (eye, towards) = (random.vec3() * 4.0, random.vec3());
        let corner = corners[random.below(corners.len())];
        let other = corners[random.below(corners.len())];
        let mut add = |ray: &mut dyn FnMut(&mut Random, usize) -> Ray| {
            all.push(std::array::from_fn(|i| ray(&mut random, i)));
        };
        // Of a camera: neighbours, and some farther apart.
        for width in [0.002, 0.05, 0.5] {
            add(&mut |random, _| Ray::new(eye, towards + random.vec3() * width - eye));
        }
        // Through a corner and near it, where bounds leave doubts.
        add(&mut |random, i| Ray::new(eye, corner + random.vec3() * [0.0, 1e-7, 1e-5][i % 3] - eye));
        // Along an edge, or through the sphere from corner to corner.
        add(&mut |_, i| Ray::new(eye, corner.lerp(other, i as f32 / 16.0) - eye));
        // From a surface to a light.
        add(&mut |random, _| {
            let start = corner + random.vec3() * 0.01;
            Ray { tmax: 0.999, ..Ray::new(start, eye - start) }
        });
        // Side by side, along an axis as well; there a component is zero, and some are not quite.
        let along = if round % 2 == 0 { towards } else { [Vec3::X, Vec3::NEG_Y, Vec3::Z][round % 3] };
        add(&mut |random, i| {
            let tilt = [0.0, -0.0, 1e-30, -1e-30][i % 4];
            Ray::new(corner + random.vec3() * 0.05 - along * 5.0, along + Vec3::splat(tilt))
        });
        // From a corner, in the planes of its triangles.
        add(&mut |random, i| Ray::new(corner, corners[i * 7 % corners.len()] - corner + random.vec3() * 1e-6));
        // Nothing in common.
        add(&mut |random, _| Ray::new(random.vec3() * 3.0, random.vec3()));
        // Of one direction and many lengths, within a range.
        add(&mut |random, i| {
            let direction = (towards + random.vec3() * 0.01 - eye) * (1.0 + i as f32 * [0.01, 1.0][round % 2]);
            Ray { tmin: 0.3, tmax: 0.9, ..Ray::new(eye, direction) }
        });
        // Some that are not valid among others.
        add(&mut |random, i| {
            let ray = Ray::new(eye, towards + random.vec3() * 0.01 - eye);
            match i {
                1 => Ray { origin: Vec3::NAN, ..ray },
                3 => Ray { direction: Vec3::ZERO, ..ray },
                4 => Ray { direction: Vec3::splat(f32::INFINITY), ..ray },
                6 => Ray { tmin: 2.0, tmax: 1.0, ..ray },
                9 => Ray { tmin: f32::NAN, ..ray },
                10 => Ray { direction: Vec3::splat(1e-42), ..ray },
                12 => Ray { direction: ray.direction * 1e35, ..ray },
                _ => ray,
            }
        });
    }
    all
}

fn packets(rays: &[Ray; 16]) -> [Packet; 2] {
    let mut packets = [Packet::NONE; 2];
    for (i, ray) in rays.iter().enumerate() {
        packets[i / 8].set(i % 8, ray);
    }
    packets
}

fn closest<const N: usize>(bvh: &Bvh, asked: &Asked<'_, N>) -> [PacketHits; N] {
    let mut told = None;
    bvh.closest_packets(asked, |hits| told = Some(hits.clone()));
    told.expect("it tells")
}

/// Hit and normal of a lane, as bits.
fn lane(hits: &PacketHits, i: usize) -> Option<(Hit, [u32; 3])> {
    let hit = Hit {
        t: hits.t[i],
        u: hits.u[i],
        v: hits.v[i],
        primitive: hits.primitive[i],
        geometry: hits.geometry[i],
        instance: hits.instance[i],
    };
    (hits.lanes >> i & 1 != 0).then(|| (hit, hits.normal.map(|n| n[i].to_bits())))
}

/// Both packets, together and each by itself, against single rays and brute force. How many rays hit.
#[track_caller]
fn assert_packets(bvh: &Bvh, brute: &Brute, rays: &[Ray; 16], asked: u32, name: &str) -> u32 {
    let packets = packets(rays);
    let lanes = [asked & 0xff, asked >> 8];
    let asked = Asked { packets: packets.each_ref(), lanes };
    let together = closest(bvh, &asked);
    let occluded = bvh.occluded_packets(&asked);
    let mut hit_count = 0;
    for (half, packet) in packets.iter().enumerate() {
        let asked = Asked { packets: [packet], lanes: [lanes[half]] };
        let by_itself = closest(bvh, &asked);
        let [occluded_by_itself] = bvh.occluded_packets(&asked);
        for i in 0..8 {
            let own = &rays[8 * half + i];
            let ray = &Ray { tmin: if own.tmin < 0.0 { 0.0 } else { own.tmin }, ..*own };
            let is_asked = lanes[half] >> i & 1 != 0;
            let single = closest_triangle(bvh, ray).filter(|_| is_asked);
            let expected = single.map(|found| (found.hit, found.normal.to_array().map(f32::to_bits)));
            let name = format!("{name}, ray {half} {i}");
            assert_eq!(lane(&together[half], i), expected, "{name}");
            assert_eq!(lane(&by_itself[0], i), expected, "{name}");
            assert_eq!(occluded[half] >> i & 1 != 0, expected.is_some(), "{name}");
            assert_eq!(occluded_by_itself >> i & 1 != 0, expected.is_some(), "{name}");
            if is_asked {
                assert_eq!(single.map(|found| found.hit), brute.closest(ray), "{name}");
                assert_eq!(bvh.occludes(&SingleRay::from(ray)), single.is_some(), "{name}");
                hit_count += u32::from(single.is_some());
            }
        }
    }
    hit_count
}

#[test]
fn packets_meet_what_single_rays_and_brute_force_meet() {
    let (world, corners) = world();
    let brute = Brute::new(&world);
    let families = families(&corners);
    let mut hit_count = 0;
    let isas = Isa::available();
    for (isa, preset) in isas.flat_map(|isa| [Preset::Default, Preset::Compact].map(|preset| (isa, preset))) {
        let bvh = Bvh::build_with(&world, Options { isa, preset, ..Options::default() });
        for (number, rays) in families.iter().enumerate() {
            let asked = [0xffff, 0xffff, 0x0ff0, 0x8421, 0xff00][number % 5];
            hit_count += assert_packets(&bvh, &brute, rays, asked, &format!("{isa:?} {preset:?}, family {number}"));
        }
    }
    assert!(hit_count > 5000, "{hit_count} hits");
}

/// Both ends of a range belong to it: whoever rounds either of them inwards loses these hits. At 0, no slack that is
/// relative helps.
#[test]
fn packets_meet_what_lies_at_the_ends_of_their_ranges() {
    let (world, corners) = world();
    let brute = Brute::new(&world);
    let mut hit_count = 0;
    for isa in Isa::available() {
        let bvh = Bvh::build_with(&world, Options { isa, ..Options::default() });
        for (number, rays) in families(&corners).iter().enumerate() {
            let hits: Vec<Ray> =
                rays.iter().filter_map(|ray| Some(Ray { tmax: brute.closest(ray)?.t, ..*ray })).collect();
            if !hits.is_empty() {
                let at_ends = std::array::from_fn(|i| {
                    let ray = hits[i % hits.len()];
                    Ray { tmin: if i % 2 == 0 { ray.tmax } else { ray.tmin }, ..ray }
                });
                // Several with ranges of their own, or one by itself that has nowhere else to go.
                let asked = [0xffff, 0x0101][number % 2];
                hit_count += assert_packets(&bvh, &brute, &at_ends, asked, &format!("{isa:?}, family {number}"));
            }
            let corner = corners[number % corners.len()];
            let at_origin = rays.map(|ray| Ray { origin: corner, tmin: 0.0, tmax: 0.0, ..ray });
            hit_count += assert_packets(&bvh, &brute, &at_origin, 0xffff, &format!("{isa:?}, family {number} at 0"));
        }
    }
    assert!(hit_count > 5000, "{hit_count} hits");
}

/// A plate that is the least number or some of them away from where rays start: what is a share of that vanishes.
#[test]
fn packets_meet_what_is_the_least_number_away() {
    let mut random = Random::new(5);
    let mut hit_count = 0;
    for _ in 0..100 {
        let plate = random.below(1 << 20) as u32;
        let (below, height) = (f32::from_bits(plate.saturating_sub(1 + random.below(8) as u32)), f32::from_bits(plate));
        let corner = |x: f32, y: f32| [Vec3::new(x, y, height), Vec3::new(x, y, -height)];
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 1.0)].concat();
        let scene = Scene::from_geometries(
            vec![Geometry::Mesh(Mesh::new(corners, vec![[0, 2, 4], [1, 3, 5]]))],
            vec![Material::default()],
        );
        let world = World::new(&scene).expect("a world");
        let brute = Brute::new(&world);
        let steepness = 10.0_f32.powf(-15.0 * random.unit());
        let rays = std::array::from_fn(|i| {
            let along = f32::from_bits(steepness.to_bits() + i as u32 % 3);
            Ray::new(Vec3::new(0.25, -0.5, below), Vec3::new(0.948_278, 0.913_099_1, along))
        });
        for isa in Isa::available() {
            let bvh = Bvh::build_with(&world, Options { isa, ..Options::default() });
            hit_count += assert_packets(&bvh, &brute, &rays, 0xffff, &format!("{isa:?} {plate} {steepness:e}"));
        }
    }
    assert!(hit_count > 1000, "{hit_count} hits");
}

#[test]
fn packets_in_an_empty_world_hit_nothing() {
    let world = World::new(&Scene::from_geometries(Vec::new(), vec![Material::default()])).expect("a world");
    let bvh = Bvh::build(&world);
    let packets = packets(&[Ray::new(Vec3::ZERO, Vec3::X); 16]);
    let asked = Asked { packets: packets.each_ref(), lanes: [0xff; 2] };
    assert_eq!(closest(&bvh, &asked).map(|hits| hits.lanes), [0, 0]);
    assert_eq!(bvh.occluded_packets(&asked), [0, 0]);
}

/// Plates of many sizes in one plane, packets past their corners and edges.
#[test]
fn packets_past_plates_of_one_plane() {
    let mut random = Random::new(77);
    let (mut corners, mut plates) = (Vec::new(), Vec::new());
    for i in 0..120u32 {
        let size = [0.01, 0.1, 1.0, 100.0][random.below(4)];
        let middle = Vec3::new(random.unit(), 0.0, random.unit());
        corners.extend((0..3).map(|_| (middle + random.vec3() * size).with_y(0.3)));
        plates.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let scene = Scene::from_geometries(
        vec![Geometry::Mesh(Mesh::new(corners.clone(), plates.clone()))],
        vec![Material::default()],
    );
    let world = World::new(&scene).expect("a world");
    let brute = Brute::new(&world);
    for isa in Isa::available() {
        let bvh = Bvh::build_with(&world, Options { isa, ..Options::default() });
        for round in 0..600 {
            let eye = Vec3::new(0.3, 2.0, 0.4) + random.vec3() * 0.2;
            let plate = plates[random.below(plates.len())].map(|i| corners[i as usize]);
            let near = [0.0, 1e-7, 1e-6, 1e-5][round % 4] * (plate[1] - plate[0]).length();
            let at = random.unit();
            let rays: [Ray; 16] = std::array::from_fn(|i| {
                Ray::new(eye, plate[0].lerp(plate[1], at + i as f32 * 1e-3) + random.vec3() * near - eye)
            });
            assert_packets(&bvh, &brute, &rays, 0xffff, &format!("{isa:?} {round}"));
        }
    }
}
