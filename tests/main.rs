//! One test binary: what crosses modules, file by file.

mod cli;
mod image;
mod parity;
mod render;
mod scenes;
