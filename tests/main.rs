//! One test binary.

mod cli;
mod render;
