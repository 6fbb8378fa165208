//! Finds OpenImageIO (2.4 or later) and compiles the shim over it.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::exit;

const OLDEST: (u32, u32) = (2, 4);

const WITHOUT: &str = "To build without it: --no-default-features --features embree (EXR, PNG and JPEG remain), \
    or --no-default-features for no system library at all.";

pub fn build() {
    println!("cargo::rerun-if-env-changed=TWINCAST_OIIO_DIR");
    println!("cargo::rerun-if-changed=ffi/oiio.h");
    println!("cargo::rerun-if-changed=ffi/oiio.cpp");
    println!("cargo::rerun-if-changed=src/image/oiio.rs");

    let (include, lib) = find();
    let mut shim = cxx_build::bridge("src/image/oiio.rs");
    shim.file("ffi/oiio.cpp").std("c++17").warnings(true);
    // As a system folder its own warnings stay quiet; the default ones are known to the compiler, and naming them would
    // disturb their order.
    if include != Path::new("/usr/include") {
        shim.flag("-isystem").flag(include.as_os_str());
    }
    if let Err(e) = shim.try_compile("twincast-oiio") {
        fail(&format!(
            "the OpenImageIO shim ffi/oiio.cpp does not compile: {e}. It needs a C++17 compiler (Debian: g++) and \
             OpenImageIO's headers with those they include (Debian: libopenimageio-dev)."
        ));
    }
    println!("cargo::rustc-link-search=native={}", lib.display());
    println!("cargo::rustc-link-lib=dylib=OpenImageIO");
    println!("cargo::rustc-link-lib=dylib=OpenImageIO_Util");
    if env::var_os("TWINCAST_OIIO_DIR").is_some() {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", lib.display());
    }
}

/// The folders of the header and of the library.
fn find() -> (PathBuf, PathBuf) {
    let given = env::var_os("TWINCAST_OIIO_DIR").filter(|dir| !dir.is_empty()).map(PathBuf::from);
    let prefixes = match &given {
        Some(prefix) => vec![prefix.clone()],
        None => ["/usr", "/usr/local", "/opt/homebrew", "/opt/local"].map(PathBuf::from).to_vec(),
    };
    let place = match &given {
        Some(prefix) => format!("in {} (TWINCAST_OIIO_DIR)", prefix.display()),
        None => "on this system".to_owned(),
    };
    let Some((prefix, version)) = prefixes.iter().find_map(|p| version(p).map(|v| (p, v))) else {
        fail(&format!("the header OpenImageIO/oiioversion.h was not found {place}."));
    };
    if version < OLDEST {
        fail(&format!(
            "OpenImageIO {}.{} was found {place}, but {}.{} is the oldest that serves.",
            version.0, version.1, OLDEST.0, OLDEST.1
        ));
    }
    let arch = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let multiarch = format!("lib/{arch}-linux-gnu");
    let file = if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("macos") {
        "libOpenImageIO.dylib"
    } else {
        "libOpenImageIO.so"
    };
    let folders = [multiarch.as_str(), "lib", "lib64"].map(|folder| prefix.join(folder));
    let Some(lib) = folders.iter().find(|folder| folder.join(file).exists()) else {
        fail(&format!("OpenImageIO's headers were found {place}, but not its library {file}."));
    };
    (prefix.join("include"), lib.clone())
}

/// The version whose headers are under this prefix.
fn version(prefix: &Path) -> Option<(u32, u32)> {
    let header = fs::read_to_string(prefix.join("include/OpenImageIO/oiioversion.h")).ok()?;
    let number = |name: &str| {
        let mut words = header
            .lines()
            .map(str::split_whitespace)
            .find_map(|mut words| (words.next() == Some("#define") && words.next() == Some(name)).then_some(words))?;
        words.next()?.parse().ok()
    };
    Some((number("OIIO_VERSION_MAJOR")?, number("OIIO_VERSION_MINOR")?))
}

fn fail(what: &str) -> ! {
    println!(
        "cargo::error=feature `oiio`: {what} On Debian: apt-get install libopenimageio-dev. Elsewhere: \
         TWINCAST_OIIO_DIR may name the prefix that OpenImageIO is installed under. {WITHOUT}"
    );
    exit(1)
}
