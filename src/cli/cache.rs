//! The folder of built trees: its flag, and what is said about it.

use std::fmt;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::engine::BackendArg;
use super::report::time;
use super::warn;
use crate::error::{Error, Result};
use crate::memory::in_words;
use crate::trace::World;
use crate::trace::bvh::{Bvh, Cache, CacheReport, CacheUse, Options};

#[derive(Clone, Debug, Default, Args)]
pub(super) struct CacheArgs {
    /// Folder where built native trees are kept, to be read the next time; never changes a picture
    ///
    /// It is made if it is missing. The trees of all triangles of a scene are one file for each --build, which is
    /// checked against them before it is used: one that is damaged or foreign is named, ignored and rewritten. Files
    /// must not be changed while in use, and may be deleted at any other time.
    #[arg(long = "cache", value_name = "DIR")]
    folder: Option<PathBuf>,
}

impl CacheArgs {
    pub(super) const fn is_given(&self) -> bool {
        self.folder.is_some()
    }

    /// The folder, if one is named; made where it is missing.
    ///
    /// # Errors
    /// [`Error::Usage`] for an engine that builds no native tree, [`Error::Output`] where it cannot be made.
    pub(super) fn open(&self, backend: BackendArg) -> Result<Option<Cache>> {
        let Some(folder) = &self.folder else { return Ok(None) };
        if backend == BackendArg::Embree {
            let problem = "--cache keeps native trees, of which --backend embree builds none; leave one of them out";
            return Err(Error::Usage(problem.to_owned()));
        }
        Cache::open(folder).map(Some)
    }
}

/// The native tracer, by way of the cache if there is one; what is wrong there is told at once.
pub(super) fn bvh(cache: Option<&Cache>, world: &World, options: Options<'_>) -> (Bvh, Option<CacheReport>) {
    let Some(cache) = cache else { return (Bvh::build_with(world, options), None) };
    let (bvh, report) = cache.bvh(world, options);
    warn(&report.warnings);
    (bvh, Some(report))
}

/// What became of the native tree's file.
#[derive(Debug, Serialize)]
pub(super) struct CacheStats {
    file: String,
    /// `read`, `written` or `failed`.
    used: &'static str,
    bytes: u64,
    seconds: f64,
}

impl CacheStats {
    pub(super) fn new(report: &CacheReport) -> Self {
        let used = match report.used {
            CacheUse::Read => "read",
            CacheUse::Written => "written",
            CacheUse::Failed => "failed",
        };
        Self { file: report.path.display().to_string(), used, bytes: report.bytes, seconds: report.seconds }
    }
}

impl fmt::Display for CacheStats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, used, bytes, seconds } = self;
        let (bytes, seconds) = (in_words(*bytes), time(*seconds));
        match *used {
            "failed" => write!(f, "{used} to write {file}"),
            _ => write!(f, "{used} {file}: {bytes}, {seconds} of the build"),
        }
    }
}
