//! One test binary: what crosses modules, file by file.

mod allocation;
mod cli;
mod image;
mod io;
mod mutation;
mod parity;
mod render;
mod scenes;
