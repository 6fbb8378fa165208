//! One test binary.
mod image;
