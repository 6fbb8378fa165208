//! Cases of everything that is not a triangle.

use std::sync::Arc;

use super::{Case, Gate, Probe, loose, nudged, towards};
use crate::math::{Mat3, Random, Vec3};
use crate::ray::Ray;
use crate::scene::{Geometry, Material, Scene};
use crate::shape::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Polygon, Shape, Sphere};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "far-sphere",
        about: "a sphere of radius 1, missed by half its radius from 16 to 1e6 away",
        source: "Haines, Günther, Akenine-Möller 2019, Precision improvements for ray/sphere intersection",
        gate: Gate::Hits,
        t_relative: None,
        make: far_sphere,
    },
    Case {
        name: "huge-sphere",
        about: "a sphere of radius 1e4 or 1e6 as the ground, from a height of 1",
        source: "Haines, Günther, Akenine-Möller 2019, Precision improvements for ray/sphere intersection",
        gate: Gate::Hits,
        t_relative: Some(1e-5),
        make: huge_sphere,
    },
    Case {
        name: "tangency",
        about: "rays that pass the unit sphere, an ellipsoid, and a cylinder's side by 2^-k, inside and out",
        source: "-",
        gate: Gate::Hits,
        t_relative: None,
        make: tangency,
    },
    Case {
        name: "cone-cylinder",
        about: "rays parallel to sides, along axes, and through the apex",
        source: "-",
        gate: Gate::Hits,
        t_relative: None,
        make: cone_cylinder,
    },
    Case {
        name: "polygon",
        about: "rays through reflex corners and along the lines of edges of a comb",
        source: "Haines 1994, Point in polygon strategies (in Graphics gems IV)",
        gate: Gate::Hits,
        t_relative: None,
        make: polygon,
    },
    Case {
        name: "flush",
        about: "boxes, a disk, a polygon and triangles in one plane: the first of those that are hit is",
        source: "-",
        gate: Gate::Exact,
        t_relative: None,
        make: flush,
    },
    Case {
        name: "box-rims",
        about: "boxes and disks, rays exactly at rims and along faces, with zeros of both signs",
        source: "Williams, Barrus, Morley, Shirley 2005, An efficient and robust ray-box intersection algorithm",
        gate: Gate::Hits,
        t_relative: None,
        make: box_rims,
    },
];

fn flush(rays: usize, random: &mut Random) -> Vec<Probe> {
    let p = |x: f32, y: f32| Vec3::new(x, y, 0.3);
    let square = [p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)];
    let [a, b, c, d] = square;
    let shapes = vec![
        Shape::Disk(Disk::new(p(0.0, 0.0), Vec3::new(0.0, 0.0, 0.7), 1.0).expect("a disk")),
        Shape::Cuboid(Cuboid::new(Vec3::new(-0.8, -0.8, -1.0), p(0.8, 0.8)).expect("a box")),
        Shape::Polygon(Arc::new(Polygon::new(square.to_vec()).expect("a square"))),
        Shape::Cuboid(Cuboid::new(Vec3::new(-0.5, -0.5, 0.3), Vec3::new(0.5, 0.5, 1.0)).expect("a box")),
    ];
    let shapes = |material| Geometry::Shapes { shapes: shapes.clone(), material };
    let mesh = || Geometry::Mesh(loose(&[[c, a, b], [a, c, d], [b, d, a], [d, b, c]]));
    let probe = |(label, geometries): (&str, Vec<Geometry>)| {
        let ray = |_| {
            let target = Vec3::new(random.unit() - 0.5, random.unit() - 0.5, 0.15) * 2.0;
            towards(random.vector() * 3.0, target)
        };
        let rays = (0..rays / 2).map(ray).collect();
        Probe::new(label, &Scene::from_geometries(geometries, vec![Material::default()]), rays)
    };
    [("shapes-first", vec![shapes(0), mesh()]), ("triangles-first", vec![mesh(), shapes(0)])].map(probe).into()
}

fn far_sphere(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |distance: f32| {
        // A point on the other side of zero keeps the world where it is.
        let sphere = Shape::Sphere(Sphere { centre: Vec3::new(0.0, 0.0, -distance), radius: 1.0 });
        let anchor = loose(&[[Vec3::new(0.0, 0.0, distance); 3]]);
        let geometries = vec![Geometry::Shapes { shapes: vec![sphere], material: 0 }, Geometry::Mesh(anchor)];
        let ray = |i: usize| {
            let (sin, cos) = libm::sincosf(random.unit() * std::f32::consts::TAU);
            let offset = if i.is_multiple_of(2) { 1.5 } else { 0.5 };
            Ray::new(Vec3::new(cos, sin, 0.0) * offset, Vec3::new(0.0, 0.0, -(1.0 + random.unit())))
        };
        let rays = (0..rays / 5).map(ray).collect();
        Probe::new(format!("{distance}"), &Scene::from_geometries(geometries, vec![Material::default()]), rays)
    };
    [16.0, 256.0, 4097.0, 65_537.0, 1e6].into_iter().map(probe).collect()
}

fn huge_sphere(rays: usize, random: &mut Random) -> Vec<Probe> {
    let probe = |radius: f32| {
        let sphere = Shape::Sphere(Sphere { centre: Vec3::new(0.0, -radius, 0.0), radius });
        let ray = |_| {
            let down = -0.05 - random.unit();
            Ray::new(Vec3::Y, Vec3::new(random.unit() * 2.0 - 1.0, down, random.unit() * 2.0 - 1.0))
        };
        let rays = (0..rays / 2).map(ray).collect();
        Probe::of_shapes(format!("{radius:e}"), vec![sphere], rays)
    };
    [1e4, 1e6].into_iter().map(probe).collect()
}

fn tangency(rays: usize, random: &mut Random) -> Vec<Probe> {
    let sphere = Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 1.0 });
    let axes = Mat3::from_diagonal(Vec3::new(2.0, 1.0, 0.5));
    let ellipsoid = Ellipsoid::new(Vec3::ZERO, axes).expect("three lengths");
    let cylinder = Cylinder::new(Vec3::new(0.0, 0.0, -2.0), Vec3::new(0.0, 0.0, 2.0), 1.0, false).expect("a length");
    let probe = |(label, shape): (&str, Shape)| {
        let ray = |i: usize| {
            let gap = libm::scalbnf(1.0, -((i % 25) as i32));
            let y = match i / 25 % 3 {
                0 => 1.0 + gap,
                1 => 1.0 - gap,
                _ => nudged(1.0, random),
            };
            // Across the axis of the cylinder.
            let from = Vec3::new(-libm::scalbnf(1.0, random.below(8) as i32), y, 0.0);
            Ray::new(from, Vec3::X * (0.5 + random.unit()))
        };
        Probe::of_shapes(label, vec![shape], (0..rays / 3).map(ray).collect())
    };
    let shapes =
        [("sphere", sphere), ("ellipsoid", Shape::Ellipsoid(ellipsoid)), ("cylinder", Shape::Cylinder(cylinder))];
    shapes.into_iter().map(probe).collect()
}

fn cone_cylinder(rays: usize, random: &mut Random) -> Vec<Probe> {
    let tip = Vec3::new(0.0, 2.0, 0.0);
    let cone = Cone::new(Vec3::ZERO, 1.0, tip, 0.0, false).expect("a cone");
    let cylinder = Cylinder::new(Vec3::ZERO, tip, 1.0, false).expect("a cylinder");
    let shapes = [("cone", Shape::Cone(cone)), ("cylinder", Shape::Cylinder(cylinder))];
    let probe = |(label, shape): (&str, Shape)| {
        let ray = |i: usize| {
            let from = random.vector() * 3.0;
            // Points of the rim whose coordinates are f32.
            let side = [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8)][random.below(3) as usize];
            let slope = tip - side;
            match i % 5 {
                0 => towards(from, tip),
                1 => Ray::new(side * nudged(1.0, random) - Vec3::Y * 3.0, Vec3::Y),
                2 => Ray::new(side * 0.5 - Vec3::Y, slope),
                3 => Ray::new(Vec3::new(0.0, -3.0, 0.0), Vec3::Y),
                _ => Ray::new(from, slope),
            }
        };
        Probe::of_shapes(label, vec![shape], (0..rays / 2).map(ray).collect())
    };
    shapes.into_iter().map(probe).collect()
}

fn polygon(rays: usize, random: &mut Random) -> Vec<Probe> {
    let comb = [(-1.0, -2.0), (2.0, -2.0), (2.0, -1.0), (1.0, -1.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0)];
    let rest = [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (0.0, 2.5), (-1.0, 2.0), (-1.5, 0.0)];
    let corners: Vec<Vec3> = comb.iter().chain(&rest).map(|&(x, y)| Vec3::new(x, y, 0.0)).collect();
    let shape = Shape::Polygon(Arc::new(Polygon::new(corners.clone()).expect("an area")));
    let ray = |i: usize| {
        let k = random.below(corners.len() as u64) as usize;
        let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
        let mut target = match i % 3 {
            0 => a,
            // On the line of an edge, before, in and behind it.
            1 => a + (b - a) * (random.below(13) as f32 / 4.0 - 1.0),
            _ => a.lerp(b, 0.5),
        };
        if i.is_multiple_of(2) {
            target.x = nudged(target.x, random);
        }
        match i % 4 {
            0 => Ray::new(target + Vec3::Z * 2.0, Vec3::NEG_Z),
            _ => towards(random.vector() * 3.0 + Vec3::Z * 4.0, target),
        }
    };
    let rays = (0..rays).map(ray).collect();
    vec![Probe::of_shapes("", vec![shape], rays)]
}

fn box_rims(rays: usize, random: &mut Random) -> Vec<Probe> {
    let unit = Cuboid::new(Vec3::ZERO, Vec3::ONE).expect("a box");
    let flat = Cuboid::new(Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 1.0, 2.0)).expect("a flat box");
    let disk = Disk::new(Vec3::new(0.5, 0.5, 3.0), Vec3::Z, 0.5).expect("a disk");
    let shapes = vec![Shape::Cuboid(unit), Shape::Cuboid(flat), Shape::Disk(disk)];
    let ray = |i: usize| {
        let corner = |random: &mut Random| {
            let mut pick = || random.below(2) as f32;
            Vec3::new(pick(), pick(), pick())
        };
        let (a, b) = (corner(random), corner(random));
        let target = a.lerp(b, [0.0, 0.5, random.unit()][random.below(3) as usize]);
        match i % 4 {
            0 => towards(random.vector() * 5.0, target),
            1 => towards(random.vector() * 5.0, target + Vec3::Z * 2.0),
            _ => {
                // Along an axis, with zeros of both signs.
                let axis = random.below(3) as usize;
                let mut direction = Vec3::from_array([(); 3].map(|()| [0.0, -0.0][random.below(2) as usize]));
                direction[axis] = [1.0, -1.0][random.below(2) as usize];
                let mut from = target;
                from[axis] -= direction[axis] * 4.0;
                Ray::new(from, direction)
            }
        }
    };
    let first = Ray::new(Vec3::new(0.0, 0.5, -1.0), Vec3::Z);
    let rays = std::iter::once(first).chain((1..rays).map(ray)).filter(Ray::is_valid).collect();
    vec![Probe::of_shapes("", shapes, rays)]
}
