//! One test binary: what crosses modules, file by file.

mod compare;
mod layering;
