//! The shim over OpenImageIO (`ffi/oiio`), a shared library that the program carries inside, and how it is opened.
//!
//! Debian's OpenImageIO brings 260 libraries, which take a quarter of a second and 130 MB: linked with the program,
//! they would cost that at every start. The shim alone is linked with it, and opened when the first image file is. It
//! stands in the program so that this stays one file, wherever it is copied to; the loader gets it as a file in memory,
//! or as a temporary one.
//!
//! The simpler way, to look up OpenImageIO's functions by their names as `image/denoise` does for its library, needs a
//! C interface, and this one has classes with virtual functions, templates and data.
#![allow(unsafe_code, reason = "opening a shared library, and saying of which type its function is")]

use std::fs;
use std::io::{self, Write};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use libloading::os::unix::RTLD_LAZY;

use super::bridge::Functions;
#[cfg(target_os = "linux")]
use super::unnamed;
use crate::image::loading;

/// The shim as `build/oiio.rs` has made it.
static SHIM: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/oiio-shim"));

/// The OpenImageIO that the shim asks for: major and minor.
const VERSION: &str = env!("TWINCAST_OIIO_VERSION");

/// The shim's functions. The first call opens it, and OpenImageIO with it; it is never closed.
///
/// # Errors
/// One line with the loader's words and the remedy, the same at every call.
pub(super) fn functions() -> Result<&'static Functions, String> {
    static OPENED: OnceLock<Result<&'static Functions, String>> = OnceLock::new();
    OPENED.get_or_init(open).clone()
}

fn open() -> Result<&'static Functions, String> {
    let ways: &[fn() -> Result<&'static Functions, String>] = &[
        #[cfg(target_os = "linux")]
        from_memory,
        || from_file(&std::env::temp_dir()),
    ];
    let mut reasons = Vec::new();
    for way in ways {
        match way() {
            Ok(functions) => return Ok(functions),
            Err(reason) if reasons.contains(&reason) => {}
            Err(reason) => reasons.push(reason),
        }
    }
    Err(format!(
        "OpenImageIO cannot be loaded ({}): image files need version {VERSION}, which this program was built with. Install it (Debian: apt-get \
         install libopenimageio{VERSION}), have LD_LIBRARY_PATH name its folder, or build the program anew with the version that is installed",
        reasons.join("; ")
    ))
}

/// By a file that has no name, and is nowhere but in memory.
#[cfg(target_os = "linux")]
fn from_memory() -> Result<&'static Functions, String> {
    let (mut file, path) = unnamed::create(c"twincast-oiio").map_err(|error| error.to_string())?;
    file.write_all(SHIM).map_err(|error| error.to_string())?;
    // It stays open. The loader takes files of one name for one file, and another library must not get this number.
    let _open = ManuallyDrop::new(file);
    load(&path)
}

/// By a file in a new folder that nobody else may enter. Both are removed once it is open.
fn from_file(parent: &Path) -> Result<&'static Functions, String> {
    let refused = |error: io::Error| format!("no file in {}: {error}", parent.display());
    let folder = private_folder(parent).map_err(refused)?;
    let path = folder.join("oiio-shim");
    let opened = fs::write(&path, SHIM).map_err(refused).and_then(|()| load(&path));
    // A folder that cannot be removed again does no harm, and says nothing about pictures.
    let _ = fs::remove_dir_all(&folder);
    opened
}

fn private_folder(parent: &Path) -> io::Result<PathBuf> {
    use std::os::unix::fs::DirBuilderExt;

    // What stands there under the name already may be anybody's: another name, then.
    for number in 0..1000 {
        let folder = parent.join(format!("twincast-{}-{number}", std::process::id()));
        match fs::DirBuilder::new().mode(0o700).create(&folder) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made.map(|()| folder),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// Opens the shim at this path.
fn load(path: &Path) -> Result<&'static Functions, String> {
    // SAFETY: the file has just been written here, from what the program carries, where nobody else writes. What
    // OpenImageIO does when it is loaded is up to whoever installed it, as with every library that a program is linked
    // with.
    let library = ManuallyDrop::new(unsafe { loading::open(path, RTLD_LAZY) }?);
    // SAFETY: the shim defines the function so in `ffi/oiio/shim.h`, and is never closed.
    let table: extern "C" fn() -> &'static Functions = unsafe { loading::function(&library, &["twincast_oiio"]) }?;
    Ok(table())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_open_it_and_leave_nothing_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        for functions in [open(), from_file(folder.path())] {
            let suffixes = functions.and_then(Functions::suffixes).expect("it opens");
            assert!(suffixes.split(',').any(|suffix| suffix == "exr"), "{suffixes}");
        }
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_needs_no_file() {
        assert!(from_memory().is_ok());
    }

    #[test]
    fn a_folder_that_takes_no_file_is_named() {
        let refused = from_file(Path::new("/no/such/folder")).expect_err("nothing can be written there");
        assert!(refused.contains("/no/such/folder"), "{refused}");
    }
}
