//! Embree's C interface, as bindgen reads it in the header that is installed. Nothing here is called from outside
//! `device`, `scene` and `query`.
#![allow(unsafe_code, reason = "declarations of foreign functions")]
#![allow(missing_docs, non_camel_case_types, non_snake_case, non_upper_case_globals, dead_code)]
#![allow(clippy::all, clippy::pedantic)]

include!(concat!(env!("OUT_DIR"), "/embree.rs"));

/// The version of the header that this build was made with, as in `4.3.0`.
pub const VERSION: &str = match RTC_VERSION_STRING.to_str() {
    Ok(version) => version,
    Err(_) => panic!("RTC_VERSION_STRING is not UTF-8"),
};

/// `RTC_INVALID_GEOMETRY_ID`: a macro with a cast, which bindgen passes over.
pub(super) const INVALID_ID: u32 = u32::MAX;
