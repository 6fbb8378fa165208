//! A case in a file: triangles and spheres, and rays, to the bit.
//!
//! JSON, with every number a hexadecimal float in a string, because a decimal number in a JSON file passes through f64
//! and whatever the program that wrote it thinks is short enough. Scene files, the alternative, hold what a scene is
//! for, and are moved to their middle when they are read.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Probe;
use crate::error::{Error, Result, system_message};
use crate::lab::hex;
use crate::lab::oracle::{self, Body};
use crate::math::{DVec3, Vec3};
use crate::memory::Mapped;
use crate::ray::Ray;
use crate::scene::{Geometry, Material, Mesh, Scene};
use crate::shape::{Shape, Sphere};
use crate::trace::World;

/// The file's content.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    /// What it is, and how it was found.
    note: String,
    /// Corners, three coordinates each.
    #[serde(default)]
    triangles: Vec<[[String; 3]; 3]>,
    /// Centre and radius.
    #[serde(default)]
    spheres: Vec<[String; 4]>,
    /// As `--ray` takes them.
    rays: Vec<String>,
}

/// Whether a path names such a file, by its suffix.
pub fn is_case_file(path: &Path) -> bool {
    path.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("json"))
}

/// The text of a case of triangles and spheres in world coordinates; None where the world has anything else.
pub fn to_text(note: &str, world: &World, rays: &[Ray]) -> Option<String> {
    let mut document = Document {
        note: note.to_owned(),
        triangles: Vec::new(),
        spheres: Vec::new(),
        rays: rays.iter().map(hex::ray_to_hex).collect(),
    };
    for (_, primitive) in oracle::primitives(world, 0.0) {
        match primitive {
            oracle::Primitive { body: Body::Triangle(corners), to_world: None } => {
                document.triangles.push(corners.map(|corner| corner.to_array().map(hex::to_hex)));
            }
            oracle::Primitive { body: Body::Shape(Shape::Sphere(sphere)), to_world: None } => {
                let Sphere { centre: c, radius } = *sphere;
                document.spheres.push([c.x, c.y, c.z, radius].map(hex::to_hex));
            }
            _ => return None,
        }
    }
    serde_json::to_string_pretty(&document).ok()
}

/// Reads a case; its name is that of the file.
///
/// # Errors
/// [`Error::Input`] for a file that is no case, naming the place.
pub fn read(path: &Path) -> Result<(String, Probe)> {
    let file = Mapped::open(path).map_err(|error| Error::input(path, "", system_message(&error)))?;
    let document: Document = serde_json::from_slice(&file).map_err(|error| {
        let place = format!("line {}", error.line());
        Error::input(path, place, format!("is no stress case: {error}; one has note, triangles, spheres and rays"))
    })?;
    let bad = |place: String, message: String| Error::input(path, place, message);
    let number = |text: &String, place: &dyn Fn() -> String| {
        let expected = "is no number; expected one such as 0x1.8p+1 or 3.0";
        hex::from_text(text).ok_or_else(|| bad(place(), format!("{text:?} {expected}")))
    };
    let mut positions = Vec::new();
    for (i, corners) in document.triangles.iter().enumerate() {
        for [x, y, z] in corners {
            let place = || format!("/triangles/{i}");
            positions.push(Vec3::new(number(x, &place)?, number(y, &place)?, number(z, &place)?));
        }
    }
    let mut shapes = Vec::new();
    for (i, [x, y, z, r]) in document.spheres.iter().enumerate() {
        let place = || format!("/spheres/{i}");
        let centre = Vec3::new(number(x, &place)?, number(y, &place)?, number(z, &place)?);
        shapes.push(Shape::Sphere(Sphere { centre, radius: number(r, &place)? }));
    }
    let rays = document.rays.iter().enumerate();
    let rays: Vec<Ray> = rays
        .map(|(i, ray)| hex::ray_from_text(ray).map_err(|message| bad(format!("/rays/{i}"), message)))
        .collect::<Result<_>>()?;
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let scene = scene(Mesh::new(positions, triangles), shapes);
    let world = World::new(&scene)?;
    if world.centre != DVec3::ZERO {
        let message = "is so far from zero for its size that it would be moved; add a point on the other side of zero, \
                       as a triangle of three equal corners";
        return Err(bad(String::new(), message.to_owned()));
    }
    let name = path.file_stem().map_or_else(|| "case".into(), |stem| stem.to_string_lossy().into_owned());
    Ok((name, Probe { label: String::new(), world, rays }))
}

/// Of what a file can hold.
pub(super) fn scene(mesh: Mesh, shapes: Vec<Shape>) -> Scene {
    let mut geometries = Vec::new();
    if !mesh.triangles.is_empty() {
        geometries.push(Geometry::Mesh(mesh));
    }
    if !shapes.is_empty() {
        geometries.push(Geometry::Shapes { shapes, material: 0 });
    }
    Scene::from_geometries(geometries, vec![Material::default()])
}
