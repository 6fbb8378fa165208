//! Embree's C interface over Twincast's native tracer.
//!
//! The crate is one shared library that exports what Embree 3.13 exports (feature `v3`) or what Embree 4.3 exports
//! (feature `v4`), so that programs which were linked with Embree run on Twincast as they are. No Embree is needed, not
//! even its headers.
//!
//! | module | what |
//! | --- | --- |
//! | `abi` | Embree's C structures and numbers, written by hand, their layout asserted at compile time |
//! | `failure` | error codes, and how nothing unwinds into the caller |
//! | `handle` | what C holds: counted pointers |
//! | `device`, `buffer`, `geometry`, `scene` | the four kinds of objects, as the caller describes them |
//! | `scene::commit` | from what is described to what rays are traced in |
//! | `trace` | what a ray does there |
//! | `api` | the exported functions: a few lines each, over all that |
//!
//! A committed scene is a thing of its own, and never changes. Triangles, quads and grids that stand still are one
//! native [`Bvh`](twincast_core::trace::bvh::Bvh), everything else are boxes in a second tree, whose leaves call the
//! caller's functions, go through instances into other scenes, or meet curves and points. One tree with mixed leaves,
//! the simpler structure, would have every ray of a plain mesh ask at each leaf what it holds. Masks and filters are
//! heeded only where the scene has any that matter to the ray: other rays never look at a geometry.
#![warn(missing_docs)]
#![warn(clippy::undocumented_unsafe_blocks)]

#[cfg(all(feature = "v3", feature = "v4"))]
compile_error!("the library is that of one version: build v4 with --no-default-features");
#[cfg(not(any(feature = "v3", feature = "v4")))]
compile_error!("choose the version: feature v3 or v4");

mod abi;
mod api;
mod buffer;
mod device;
mod failure;
mod geometry;
mod handle;
mod scene;
mod trace;
