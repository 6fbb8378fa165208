//! One test binary: what crosses modules, file by file.

mod parity;
mod scenes;
