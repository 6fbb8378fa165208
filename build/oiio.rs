//! Finds OpenImageIO (2.4 or later) and makes a shared library of the shim over it, for `src/image/oiio/shim.rs` to carry.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::exit;

const OLDEST: (u32, u32) = (2, 4);

const VERSION_HEADER: &str = "OpenImageIO/oiioversion.h";

const SOURCES: [&str; 3] = ["ffi/oiio/shim.cpp", "ffi/oiio/read.cpp", "ffi/oiio/write.cpp"];

const WITHOUT: &str = "To build without it: --no-default-features --features embree (EXR, PNG and JPEG remain), \
    or --no-default-features for no system library at all.";

/// An OpenImageIO: its version, and the folders of headers and library.
struct Found {
    version: (u32, u32),
    include: PathBuf,
    lib: PathBuf,
}

pub fn build() {
    println!("cargo::rerun-if-env-changed=TWINCAST_OIIO_DIR");
    println!("cargo::rerun-if-changed=ffi/oiio");

    let found = find();
    // The shim asks for the library by the name that this version has.
    println!("cargo::rerun-if-changed={}", found.include.join(VERSION_HEADER).display());
    println!("cargo::rustc-env=TWINCAST_OIIO_VERSION={}.{}", found.version.0, found.version.1);
    let mut shim = cc::Build::new();
    shim.cpp(true).std("c++17").warnings(true).pic(true).debug(false).flag("-fvisibility=hidden").files(SOURCES);
    // As a system folder its own warnings stay quiet; the default ones are known to the compiler, and naming them would
    // disturb their order.
    if found.include != Path::new("/usr/include") {
        shim.flag("-isystem").flag(found.include.as_os_str());
    }
    match shim.try_compile_intermediates() {
        Ok(objects) => link(&shim, &objects, &found.lib),
        Err(e) => fail(&format!(
            "the OpenImageIO shim ffi/oiio does not compile: {e}. It needs a C++17 compiler (Debian: g++) and \
             OpenImageIO's headers with those they include (Debian: libopenimageio-dev)."
        )),
    }
}

/// Makes the shared library. It names OpenImageIO itself: nothing has to be said to whoever links the program.
fn link(shim: &cc::Build, objects: &[PathBuf], lib: &Path) {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR")).join("oiio-shim");
    let mut linker = shim.get_compiler().to_command();
    linker.arg("-shared").arg("-o").arg(out).args(objects).arg("-L").arg(lib);
    linker.args(["-lOpenImageIO", "-lOpenImageIO_Util"]);
    if env::var_os("TWINCAST_OIIO_DIR").is_some() {
        // The loader does not look there by itself.
        linker.arg(format!("-Wl,-rpath,{}", lib.display()));
    }
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("macos") {
        // What is missing is told here, as it is elsewhere anyway, and not when the first picture is written.
        linker.arg("-Wl,-z,defs");
    }
    match linker.output() {
        Ok(output) if output.status.success() => {}
        Ok(output) => {
            let words = String::from_utf8_lossy(&output.stderr);
            let words = words.lines().find(|line| !line.trim().is_empty()).unwrap_or("without a word");
            fail(&format!("the OpenImageIO shim cannot be linked with the library in {}: {words}.", lib.display()))
        }
        Err(e) => fail(&format!("the linker of the OpenImageIO shim, {:?}, does not run: {e}.", linker.get_program())),
    }
}

fn find() -> Found {
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
        fail(&format!("the header {VERSION_HEADER} was not found {place}."));
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
    Found { version, include: prefix.join("include"), lib: lib.clone() }
}

/// The version whose headers are under this prefix.
fn version(prefix: &Path) -> Option<(u32, u32)> {
    let header = fs::read_to_string(prefix.join("include").join(VERSION_HEADER)).ok()?;
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
