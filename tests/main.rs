//! One test binary.

mod allocation;
mod io;
mod mutation;
