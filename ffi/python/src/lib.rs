//! `twincast._native`: the native tracer for Python. Arrays in, arrays out; what users see is the Python package over
//! it (`python/twincast/`), which checks shapes, converts types and has the documentation.
//!
//! | file | what |
//! | --- | --- |
//! | `arrays` | rays and points as NumPy holds them, read in place |
//! | `pool` | the threads that queries run on, without the interpreter's lock |
//! | `stack` | whether a thread that Python has made has room for a query |
//! | `scene` | meshes, and what can be asked of them |
//! | `crossings` | all hits of many rays, as flat arrays |
//! | `points`, `order`, `inside` | what can be asked of points, in which order it is done, and which of them are inside |
//! | `render` | pictures |
//!
//! There is no unsafe code here: a panic becomes a Python exception in PyO3's wrappers, so it never crosses the
//! boundary. An array that another thread writes to while it is read gives numbers that are neither the old nor the new
//! ones; its length cannot change.
#![forbid(unsafe_code)]

mod arrays;
mod crossings;
mod inside;
mod order;
mod points;
mod pool;
mod render;
mod scene;
mod stack;

use pyo3::prelude::*;

/// The native part of the package `twincast`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::scene::Scene;

    #[pymodule_export]
    use super::render::{main, render_file, render_meshes};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::stack::learn();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("DEBUG_ASSERTIONS", cfg!(debug_assertions))?;
        module.add("ISA", twincast::trace::bvh::Isa::detect().name())
    }
}

/// What the library says is wrong with the arguments.
fn value_error(error: twincast::Error) -> PyErr {
    pyo3::exceptions::PyValueError::new_err(error.to_string())
}
