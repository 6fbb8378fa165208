//! One test binary: what crosses modules, file by file.

mod cli;
mod parity;
mod render;
mod scenes;
