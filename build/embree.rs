//! Finds Embree 4, else 3, and generates bindings from the header that is installed.
//!
//! Why not a crate of ready-made bindings: the layout of a hit depends on how Embree was built. Embree 4.3 with
//! instance arrays writes 96 bytes where 4.2 and 3.13 write 80, and nothing warns a client that has the wrong header.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::exit;
use std::{env, fs, panic};

/// Where to look for `include/` and `lib/`, if the caller says so.
const PREFIX_VARIABLE: &str = "TWINCAST_EMBREE_DIR";

/// An Embree: header and library.
struct Found {
    major: u32,
    include: PathBuf,
    lib: PathBuf,
}

pub fn build() {
    println!("cargo::rustc-check-cfg=cfg(embree4)");
    println!("cargo::rerun-if-changed=ffi/embree.h");
    println!("cargo::rerun-if-env-changed={PREFIX_VARIABLE}");

    let chosen = env::var_os(PREFIX_VARIABLE).filter(|prefix| !prefix.is_empty()).map(PathBuf::from);
    let embree = find(chosen.as_deref());
    let header = embree.include.join(format!("embree{}/rtcore_config.h", embree.major));
    println!("cargo::rerun-if-changed={}", header.display());
    check_version(&header);
    if embree.major == 4 {
        println!("cargo::rustc-cfg=embree4");
    }
    generate_bindings(&embree);

    println!("cargo::rustc-link-search=native={}", embree.lib.display());
    println!("cargo::rustc-link-lib=dylib=embree{}", embree.major);
    if chosen.is_some() {
        // The loader does not look there by itself.
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", embree.lib.display());
    }
}

/// The newest Embree under `chosen`, or under the system's prefixes if that is none.
fn find(chosen: Option<&Path>) -> Found {
    let prefixes = match chosen {
        Some(prefix) => vec![prefix.to_path_buf()],
        None => vec!["/usr/local".into(), "/usr".into()],
    };
    let arch = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let folders = ["lib".to_owned(), "lib64".to_owned(), format!("lib/{arch}-linux-gnu")];
    let mut without_library = Vec::new();
    for major in [4, 3] {
        for prefix in &prefixes {
            let include = prefix.join("include");
            let header = include.join(format!("embree{major}/rtcore.h"));
            if !header.is_file() {
                continue;
            }
            let has_library = |lib: &PathBuf| {
                ["so", "dylib"].iter().any(|suffix| lib.join(format!("libembree{major}.{suffix}")).exists())
            };
            match folders.iter().map(|folder| prefix.join(folder)).find(has_library) {
                Some(lib) => return Found { major, include, lib },
                None => without_library.push(header.display().to_string()),
            }
        }
    }
    let places = prefixes.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(" and ");
    if without_library.is_empty() {
        fail(format!("found neither embree4/rtcore.h nor embree3/rtcore.h in include/ under {places}"))
    }
    fail(format!("found {}, but no library for it in lib/ under {places}", without_library.join(" and ")))
}

/// Embree 3.13 is the oldest that is supported.
fn check_version(header: &Path) {
    let text = fs::read_to_string(header).unwrap_or_else(|e| fail(format!("{}: {e}", header.display())));
    let version = text.lines().find_map(|line| line.strip_prefix("#define RTC_VERSION ")?.trim().parse::<u32>().ok());
    match version {
        Some(version) if version >= 31300 => {}
        Some(version) => fail(format!(
            "{} is Embree {}.{}; 3.13 or later is needed",
            header.display(),
            version / 10000,
            version / 100 % 100
        )),
        None => fail(format!("{} does not define RTC_VERSION", header.display())),
    }
}

fn generate_bindings(embree: &Found) {
    let builder = bindgen::Builder::default()
        .header("ffi/embree.h")
        .clang_arg(format!("-DTWINCAST_EMBREE={}", embree.major))
        .clang_arg(format!("-I{}", embree.include.display()))
        .allowlist_function("rtc(New|Release)(Device|Geometry|Scene)")
        .allowlist_function("rtcGetDevice(Property|Error)")
        .allowlist_function("rtcSetDevice(Error|MemoryMonitor)Function")
        .allowlist_function("rtcSet(Scene(BuildQuality|Flags)|NewGeometryBuffer)")
        .allowlist_function("rtcSetGeometry(InstancedScene|Transform|TimeStepCount|UserData|UserPrimitiveCount)")
        .allowlist_function("rtcSetGeometry(Bounds|Intersect|Occluded)Function")
        .allowlist_function("rtc(CommitGeometry|CommitScene|AttachGeometryByID)")
        .allowlist_function("rtc(Intersect|Occluded)(1|4|8|16)")
        .allowlist_function("rtc((New|Release|Build)BVH|ThreadLocalAlloc)")
        .allowlist_type("RTC(Ray|Hit|RayHit)(4|8|16)?")
        .allowlist_type("RTC(Format|BuildQuality|BufferType|GeometryType|SceneFlags|DeviceProperty|Error)")
        .allowlist_type("RTC(IntersectContextFlags|RayQueryFlags|FeatureFlags|BuildFlags)")
        .allowlist_type("RTC(Intersect|Occluded)FunctionNArguments|RTCBoundsFunctionArguments")
        .allowlist_var("RTC_VERSION.*")
        .default_enum_style(bindgen::EnumVariation::Consts)
        .prepend_enum_name(false)
        .derive_default(true)
        .generate_cstr(true)
        .generate_comments(false)
        .rust_edition(bindgen::RustEdition::Edition2024);
    // Without libclang, bindgen panics; its message is wanted, its backtrace is not.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let generated = panic::catch_unwind(panic::AssertUnwindSafe(|| builder.generate()));
    panic::set_hook(hook);
    let bindings = match generated {
        Ok(Ok(bindings)) => bindings,
        Ok(Err(e)) => fail(format!("bindgen cannot read the header: {e}")),
        Err(payload) => {
            let text = payload.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("it panicked");
            fail(format!("bindgen cannot run: {text}"))
        }
    };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR")).join("embree.rs");
    bindings.write_to_file(&out).unwrap_or_else(|e| fail(format!("{}: {e}", out.display())));
}

/// Ends the build with one message that says what is missing and how to go on.
fn fail(message: impl Display) -> ! {
    for line in message.to_string().lines().filter(|line| !line.trim().is_empty()) {
        println!("cargo::error=embree: {line}");
    }
    println!(
        "cargo::error=embree: install it (Debian, Ubuntu: apt install libembree-dev libclang-dev), or set \
         {PREFIX_VARIABLE} to a folder with include/ and lib/, or build without it: --no-default-features \
         (with --features oiio to keep OpenImageIO)"
    );
    exit(1);
}
