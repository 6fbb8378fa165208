//! Scenes made by rule, at any size, with camera, lights and materials.
//!
//! Six follow the descriptions of Haines's Standard Procedural Databases (Haines 1987, *A proposal for standard
//! graphics environments*), which have measured ray tracers ever since; the code and the proportions are this project's
//! own. All stand with +y up and are the same on every system: their only randomness is a hash of whole numbers, and
//! sines come from libm.
//!
//! Materials keep to what the Neutral File Format can say, so that every scene can be written in it.

mod city;
mod gears;
mod lattice;
mod mount;
mod rings;
mod sphereflake;
mod teapot;
mod tetra;
mod tree;

use std::sync::Arc;

use super::{Attenuation, Camera, Geometry, Light, Material, Request, Scene, Specular, terrain};
use crate::math::{DAabb, DVec3, Vec3};
use crate::shape::{Polygon, Shape};

/// A kind of scene.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    /// What it is called.
    pub name: &'static str,
    /// What it shows, in a line.
    pub about: &'static str,
    /// What its size counts.
    pub size: &'static str,
    /// The size where none is asked for.
    pub usual: u32,
    /// The largest size that is made: a few gigabytes of memory.
    pub largest: u32,
    make: fn(u32) -> Scene,
}

/// Every kind of scene that can be made.
pub const RECIPES: [Recipe; 9] = [
    Recipe {
        name: "sphereflake",
        about: "spheres on spheres, each with nine of a third of its size",
        size: "generations",
        usual: 4,
        largest: 8,
        make: sphereflake::make,
    },
    Recipe {
        name: "tetra",
        about: "a tetrahedron of tetrahedra, as Sierpinski's triangle",
        size: "generations",
        usual: 6,
        largest: 12,
        make: tetra::make,
    },
    Recipe {
        name: "gears",
        about: "layers of gears that mesh, each with two concave faces of 96 corners",
        size: "gears along each side",
        usual: 4,
        largest: 60,
        make: gears::make,
    },
    Recipe {
        name: "mount",
        about: "a fractal mountain under four balls of glass",
        size: "generations; 2 * 4^size triangles",
        usual: 7,
        largest: 13,
        make: mount::make,
    },
    Recipe {
        name: "rings",
        about: "a pyramid of dodecahedra made of cylinders and spheres",
        size: "storeys",
        usual: 4,
        largest: 120,
        make: rings::make,
    },
    Recipe {
        name: "tree",
        about: "a tree of cones and spheres, every branch with two more",
        size: "generations",
        usual: 9,
        largest: 22,
        make: tree::make,
    },
    Recipe {
        name: "terrain",
        about: "a landscape of eight octaves of sines",
        size: "squares along each side; 2 * size^2 triangles",
        usual: 256,
        largest: 8192,
        make: land,
    },
    Recipe {
        name: "lattice",
        about: "one teapot, placed on a grid of three dimensions, each turned in its own way",
        size: "teapots along each side",
        usual: 6,
        largest: 200,
        make: lattice::make,
    },
    Recipe {
        name: "city",
        about: "towers with pleated fronts: long thin triangles, all upright",
        size: "towers along each side",
        usual: 8,
        largest: 400,
        make: city::make,
    },
];

impl Recipe {
    /// The scene of this size, from 1 to [`Recipe::largest`].
    pub fn make(&self, size: u32) -> Scene {
        (self.make)(size.clamp(1, self.largest))
    }
}

/// The terrain, ten metres wide, and less steep.
fn land(n: u32) -> Scene {
    let mut mesh = terrain(n);
    let positions =
        mesh.positions.iter().map(|p| (*p - Vec3::new(0.5, 0.0, 0.5)) * Vec3::new(10.0, 4.0, 10.0)).collect();
    mesh.positions = Arc::new(positions);
    staged(vec![Geometry::Mesh(mesh)], vec![fill([0.55, 0.6, 0.35], 1.0, 0.0, 1.0)], None)
}

/// A matte surface of which the share `ks` is a mirror, with a highlight of exponent `shine`.
fn fill(color: [f32; 3], kd: f32, ks: f32, shine: f32) -> Material {
    Material {
        ambient: Vec3::ZERO,
        diffuse: Vec3::from(color) * kd,
        specular: Vec3::splat(ks),
        shininess: shine,
        reflection: Vec3::splat(ks),
        ior: 1.0,
        model: Specular::Phong,
        ..Material::default()
    }
}

/// The scene of these geometries, seen as a whole and lit from three sides, on a floor of the given material if any.
fn staged(geometries: Vec<Geometry>, materials: Vec<Material>, floor: Option<Material>) -> Scene {
    let mut scene = Scene::from_geometries(geometries, materials);
    stage(&mut scene, floor);
    scene
}

/// Adds camera, lights and a floor.
fn stage(scene: &mut Scene, floor: Option<Material>) {
    let subject = scene.bounds();
    // Nearer than where a ball around the subject would fit into the picture: none of them is one.
    let framing = Camera::framing(&subject, 4.0 / 3.0);
    let camera = Camera { eye: subject.centre().lerp(framing.eye, 0.85), ..framing };
    let eye = camera.eye;
    scene.cameras = vec![camera];
    scene.request = Request { size: Some([400, 300]), ..Request::default() };
    scene.background = Some(Vec3::new(0.08, 0.16, 0.3));
    let reach = subject.radius().max(1e-3);
    // From the left, the right and the camera, above all of it.
    let lights = [DVec3::new(-2.0, 3.0, 1.5), DVec3::new(3.0, 2.5, 1.0), (eye - subject.centre()) / reach + DVec3::Y];
    let light = |offset: DVec3| Light::Point {
        position: subject.centre() + offset * reach,
        color: Vec3::splat(0.4),
        attenuation: Attenuation::NONE,
        range: f64::INFINITY,
        radius: 0.0,
    };
    scene.lights = lights.map(light).to_vec();
    if let Some(material) = floor {
        add_floor(scene, &subject, material);
    }
}

/// A square under `subject`, in the first group.
fn add_floor(scene: &mut Scene, subject: &DAabb, material: Material) {
    let (middle, half) = (subject.centre(), 4.0 * subject.radius());
    let y = subject.min.y;
    let corner = |x: f64, z: f64| DVec3::new(middle.x + x * half, y, middle.z + z * half).as_vec3();
    let corners = vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    // A subject without extent has no floor.
    let Ok(polygon) = Polygon::new(corners) else { return };
    let index = scene.materials.len() as u32;
    scene.materials.push(material);
    let shapes = vec![Shape::Polygon(Arc::new(polygon))];
    scene.geometries.push(Geometry::Shapes { shapes, material: index });
    let first = scene.geometries.len() as u32 - 1;
    scene.groups.push(super::Group { name: "floor".to_owned(), geometries: first..first + 1 });
    let group = scene.groups.len() as u32 - 1;
    let transform = crate::math::DAffine3::IDENTITY;
    scene.instances.push(super::Instance { name: "floor".to_owned(), group, transform, transform_end: None });
}

/// A number in [0, 1) for two whole ones, by the finaliser of SplitMix64 (Steele, Lea, Flood 2014, *Fast splittable
/// pseudorandom number generators*).
fn noise(x: u32, y: u32) -> f64 {
    let z = (u64::from(x) << 32 | u64::from(y)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts from the descriptions: 1 + 9 + 81 + 729 spheres, 4^n tetrahedra, and so on; floors apart.
    #[test]
    fn scenes_have_what_their_size_says() {
        let count = |name: &str, size: u32| {
            let recipe = RECIPES.iter().find(|recipe| recipe.name == name).unwrap();
            let scene = recipe.make(size);
            let floor = scene.instances.iter().filter(|instance| instance.name == "floor").count() as u64;
            scene.primitive_count() - floor
        };
        assert_eq!(count("sphereflake", 3), 1 + 9 + 81 + 729);
        assert_eq!(count("tetra", 4), 256 * 4);
        assert_eq!(count("gears", 3), 27 * (96 + 2));
        assert_eq!(count("mount", 5), 2 * 1024 + 4);
        assert_eq!(count("rings", 3), (1 + 4 + 9) * (20 + 30));
        assert_eq!(count("tree", 4), 2 * 31);
        assert_eq!(count("terrain", 9), 162);
        assert_eq!(count("city", 3) % 9, 0);
        assert_eq!(count("lattice", 3), 27 * count("lattice", 1));
    }

    #[test]
    fn every_scene_is_whole_and_the_same_each_time() {
        for recipe in RECIPES {
            let [one, two] = [(), ()].map(|()| recipe.make(2));
            assert_eq!(format!("{one:?}"), format!("{two:?}"), "{}", recipe.name);
            assert!(!one.cameras.is_empty() && one.lights.len() == 3);
            for geometry in &one.geometries {
                assert!((geometry.material() as usize) < one.materials.len());
                match geometry {
                    Geometry::Mesh(mesh) => {
                        let count = mesh.positions.len() as u32;
                        assert!(mesh.triangles.as_flattened().iter().all(|&i| i < count), "{}", recipe.name);
                        assert_eq!(mesh.untraceable_triangles(), 0);
                    }
                    Geometry::Shapes { shapes, .. } => {
                        assert!(shapes.iter().all(|shape| shape.check().is_ok()), "{}", recipe.name);
                    }
                }
            }
            let bounds = one.bounds();
            assert!(bounds.min.is_finite() && bounds.max.is_finite() && bounds.radius() > 0.1, "{}", recipe.name);
        }
    }

    #[test]
    fn noise_is_spread_evenly() {
        let numbers: Vec<f64> = (0..10_000).map(|i| noise(i / 100, i % 100)).collect();
        assert!(numbers.iter().all(|x| (0.0..1.0).contains(x)));
        for tenth in 0..10 {
            let inside = numbers.iter().filter(|x| (**x * 10.0) as u32 == tenth).count();
            assert!((900..1100).contains(&inside), "{inside}");
        }
    }
}
