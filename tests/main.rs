//! One test binary: what crosses modules, file by file.

mod accelerators;
mod allocation;
mod bench;
mod brute_force;
mod cache;
mod camera_flags;
mod cli;
mod compare;
mod denoise;
mod documents;
#[cfg(feature = "embree")]
mod embree;
mod image;
#[cfg(target_os = "linux")]
mod interrupt;
mod io;
mod kernels;
mod layering;
mod minray;
mod motion;
mod mutation;
mod openimageio;
mod program;
mod queries;
mod references;
mod render;
mod resume;
mod scenes;
mod shapes;
mod skip;
mod stress;
