//! One test binary.

#[cfg(feature = "embree")]
mod embree;
