//! Trees in files: what is built once is read the next time.
//!
//! | file | idea |
//! | --- | --- |
//! | `digest` | what a tree is of, and whether bytes are as they were |
//! | `file` | arrays in a file, and what can be wrong with one |
//! | `check` | whether a tree that was read is one over these triangles |
//!
//! A file is for one world: the trees over the triangles of all its levels, by a digest of the triangles as traced and
//! of the preset. Those over shapes and placements are small and built anew, so that objects may move, and cameras,
//! lights and materials change, without another file. A file for each mesh, the alternative, could be shared between
//! scenes, and would make ten thousand files of a city.
//!
//! The file is mapped and used where it lies. It is not trusted: a damaged or foreign one gives a warning, is ignored,
//! and is written anew.

mod check;
mod digest;
mod file;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::block::LANES;
use super::build::preset::{Options, Preset};
use super::levels::leaves::Leaves;
use super::levels::triangles::TriangleTree;
use super::meshes::Meshes;
use super::node::Node;
use super::tree::Tree;
use super::{Bvh, levels};
use crate::error::{Error, Result, Warning};
use crate::trace::{Part, World};
use digest::Digest;
use file::Arrays;

/// A folder in which trees are kept.
///
/// A file must not be changed while a program uses it: shortening it ends the program. The folder only grows; its
/// files may be deleted at any time.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

/// What became of a tree that the cache was asked for.
#[derive(Clone, Debug)]
pub struct CacheReport {
    /// The tree's file, whether it is there or not.
    pub path: PathBuf,
    /// What was done with it.
    pub used: CacheUse,
    /// Bytes of the file.
    pub bytes: u64,
    /// Seconds that this took beside building: to digest the triangles, to read and check, to write.
    pub seconds: f64,
    /// What was wrong with a file that was there, and why none could be written.
    pub warnings: Vec<Warning>,
}

/// What was done with a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheUse {
    /// The tree was read from it.
    Read,
    /// The tree was built and written to it.
    Written,
    /// The tree was built and could not be written.
    Failed,
}

impl Cache {
    /// Of a folder, which is made if it is missing.
    ///
    /// # Errors
    /// [`Error::Output`] where it cannot be made.
    pub fn open(folder: &Path) -> Result<Self> {
        let failed = |error| Error::output(folder, format!("cannot be made a folder for trees: {error}"));
        fs::create_dir_all(folder).map_err(failed)?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// The tracer that [`Bvh::build_with`] gives, from its file where there is one; otherwise it is built, and the file
    /// written. Whatever is wrong with the file or the folder is a warning, and the tracer is the same.
    ///
    /// # Panics
    /// Where this processor does not have `options.isa`.
    pub fn bvh(&self, world: &World, options: Options<'_>) -> (Bvh, CacheReport) {
        let (begin, levels, mut warnings) = (Instant::now(), levels(world), Vec::new());
        let key = digest::of_levels(&levels, options.preset);
        let path = self.path(&key);
        match read(&path, &key, &levels, options.preset) {
            Ok(Some((trees, bytes))) => {
                trees.iter().for_each(|tree| options.report(tree.count()));
                let bvh = Bvh::over(trees, world, &options);
                let seconds = begin.elapsed().as_secs_f64();
                return (bvh, CacheReport { path, used: CacheUse::Read, bytes, seconds, warnings });
            }
            Ok(None) => {}
            Err(problem) => warnings.push(Warning::new(&path, "", format!("{problem}; ignored, to be written anew"))),
        }
        let before = begin.elapsed();
        let bvh = Bvh::build_with(world, options);
        let begin = Instant::now();
        let (used, bytes) = match write(&path, &key, &bvh) {
            Ok(bytes) => (CacheUse::Written, bytes),
            Err(error) => {
                warnings.push(Warning::new(&path, "", format!("the tree is not kept: {}", bare(&error))));
                (CacheUse::Failed, 0)
            }
        };
        let seconds = (before + begin.elapsed()).as_secs_f64();
        (bvh, CacheReport { path, used, bytes, seconds, warnings })
    }

    fn path(&self, key: &Digest) -> PathBuf {
        let key: String = key.iter().map(|byte| format!("{byte:02x}")).collect();
        self.folder.join(format!("{key}.bvh"))
    }
}

/// Without the path, which a warning names.
fn bare(error: &Error) -> String {
    match error {
        Error::Output { message, .. } => message.clone(),
        other => other.to_string(),
    }
}

/// Two arrays a level: nodes, and blocks.
fn write(path: &Path, key: &Digest, bvh: &Bvh) -> Result<u64> {
    let levels = std::iter::once(&bvh.fixed).chain(&bvh.objects);
    let arrays: Vec<&[u8]> = levels
        .flat_map(|level| [bytemuck::cast_slice(level.triangles.tree().nodes()), level.triangles.leaves().as_bytes()])
        .collect();
    file::write(path, key, &arrays)
}

/// The trees in a file and its length; none where there is no file.
///
/// # Errors
/// What is wrong with it.
fn read(
    path: &Path,
    key: &Digest,
    levels: &[&[Part]],
    preset: Preset,
) -> std::result::Result<Option<(Vec<TriangleTree>, u64)>, String> {
    let Some(arrays) = Arrays::open(path, key, 2 * levels.len())? else { return Ok(None) };
    let tree = |(level, parts): (usize, &&[Part])| {
        let meshes = Meshes::new(parts);
        let tree = Tree::new(arrays.get::<Node>(2 * level)?);
        let blocks = 2 * level + 1;
        let leaves = if preset.is_compact() {
            Leaves::of_numbers(arrays.get::<[u32; LANES]>(blocks)?, meshes.clone())
        } else {
            Leaves::of_blocks(arrays.get(blocks)?)
        };
        let count = check::check(&tree, &leaves, &meshes, preset == Preset::High)?;
        Ok(TriangleTree::new(parts, tree, leaves, count))
    };
    let trees: std::result::Result<Vec<_>, String> = levels.iter().enumerate().map(tree).collect();
    Ok(Some((trees?, arrays.len())))
}
