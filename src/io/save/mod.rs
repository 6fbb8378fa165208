//! Writing scenes: `.nff`, `.toml` and binary `.ply`, by the suffix.
//!
//! Numbers are written as the shortest decimals that give them back to the bit. What a format cannot say is an error
//! before anything is written, not an approximation: [`Unsayable`] names it, and a format that can.

mod nff;
mod ply;
mod toml;

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};
use crate::math::{DAffine3, DVec3, Vec3};
use crate::output::{suffix, write_atomically};
use crate::scene::{Geometry, Mesh, Scene};

/// The suffixes that [`save`] knows.
pub const SAVE_SUFFIXES: [&str; 3] = ["nff", "ply", "toml"];

/// What a format has no words for, in words.
type Unsayable = String;

/// A writer that does not fail for lack of words.
type Writer = fn(&Scene, &mut dyn Write) -> io::Result<()>;

/// Writes `scene` to `path`. The suffix, in any case, decides the format: one of [`SAVE_SUFFIXES`].
///
/// PLY holds one mesh of everything, positions and triangles: materials, normals, texture coordinates, lights and
/// cameras are left out, as are from NFF names, and what of [`Scene::request`] is not the size.
///
/// # Errors
/// [`Error::Scene`] for what [`Scene::check`] refuses; [`Error::Usage`] for another suffix, and for what the format
/// cannot say (spheres in PLY, corners that are NaN in text); [`Error::Output`] where the file cannot be written, which
/// leaves an old one whole.
pub fn save(scene: &Scene, path: &Path) -> Result<()> {
    save_until(scene, path, &AtomicBool::new(false))
}

/// The same, until another thread sets `cancel`.
///
/// # Errors
/// As [`save`], and [`Error::Interrupted`], which leaves an old file whole and no part of a new one.
pub fn save_until(scene: &Scene, path: &Path, cancel: &AtomicBool) -> Result<()> {
    let suffix = suffix(path);
    type Check = fn(&Scene) -> std::result::Result<(), Unsayable>;
    let (check, write): (Check, Writer) = match suffix.as_str() {
        "nff" => (nff::check, nff::write),
        "ply" => (ply::check, ply::write),
        "toml" => (toml::check, toml::write),
        _ => {
            let known = SAVE_SUFFIXES.map(|suffix| format!(".{suffix}")).join(", ");
            return Err(Error::Usage(format!("{}: scenes are written as {known}", path.display())));
        }
    };
    scene.check()?;
    check(scene).map_err(|message| Error::Usage(format!("{}: {message}", path.display())))?;
    write_atomically(path, |part| {
        let write_all = || {
            let mut file = BufWriter::with_capacity(1 << 16, Until { file: File::create(part)?, cancel });
            write(scene, &mut file)?;
            file.flush()
        };
        write_all().map_err(|error: io::Error| match cancel.load(Ordering::Relaxed) {
            true => Error::Interrupted,
            false => Error::output(path, format!("cannot be written: {error}")),
        })
    })
}

/// A file that takes nothing more once it is cancelled.
struct Until<'a> {
    file: File,
    cancel: &'a AtomicBool,
}

impl Write for Until<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.cancel.load(Ordering::Relaxed) {
            // Not the kind that is called interrupted, after which writers try again.
            return Err(io::Error::other("cancelled"));
        }
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Whether something moves.
fn moves(scene: &Scene) -> bool {
    scene.instances.iter().any(|instance| instance.transform_end.is_some())
}

/// Whether vertices have colours.
fn is_colored(scene: &Scene) -> bool {
    scene.geometries.iter().any(|geometry| matches!(geometry, Geometry::Mesh(mesh) if !mesh.colors.is_empty()))
}

/// Whether all numbers of the meshes are finite, as those of text formats have to be.
fn check_finite(scene: &Scene) -> std::result::Result<(), Unsayable> {
    let is_whole = |mesh: &Mesh| {
        let vectors = mesh.positions.iter().chain(&mesh.normals).all(|v| v.is_finite());
        vectors && mesh.origin.is_finite() && mesh.uvs.iter().all(|uv| uv.is_finite())
    };
    let broken = scene.geometries.iter().find_map(|geometry| match geometry {
        Geometry::Mesh(mesh) if !is_whole(mesh) => Some(mesh),
        Geometry::Mesh(_) | Geometry::Shapes { .. } => None,
    });
    broken.map_or(Ok(()), |mesh| {
        Err(format!(
            "mesh {:?} has numbers that are not finite, which text cannot hold; write .ply, or leave these out",
            mesh.name
        ))
    })
}

/// Every geometry where it is placed.
fn placed(scene: &Scene) -> impl Iterator<Item = (&Geometry, &DAffine3)> {
    scene.instances.iter().flat_map(|instance| {
        scene.group_geometries(instance.group).map(|(_, geometry)| (geometry, &instance.transform))
    })
}

/// A triangle's corners in the order that has its front, once they are moved by `transform`, where it is before: a
/// mirroring turns the winding.
fn wound(corners: [u32; 3], transform: &DAffine3) -> [u32; 3] {
    let [a, b, c] = corners;
    if transform.matrix3.determinant() < 0.0 { [a, c, b] } else { corners }
}

/// Numbers with spaces between.
fn spaced(v: Vec3) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}

/// The same in double precision.
fn spaced_f64(v: DVec3) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}
