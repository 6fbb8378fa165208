//! One test binary: what crosses modules, file by file.

mod allocation;
mod cli;
#[cfg(feature = "embree")]
mod embree;
mod image;
mod io;
mod mutation;
mod parity;
mod render;
mod scenes;
