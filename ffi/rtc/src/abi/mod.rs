//! Embree's C structures and numbers, as far as both sides of the boundary look into them.
//!
//! Written by hand from the public interface (embree3/rtcore.h of 3.13, embree4/rtcore.h of 4.3), so that the crate
//! builds where no Embree is installed; sizes and offsets are asserted below each structure.

mod call;
mod enums;
mod interpolate;
mod point_query;
mod ray;

pub use call::*;
pub use enums::*;
pub use interpolate::*;
pub use point_query::*;
pub use ray::*;

/// A box, as bounds functions write it.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, Default)]
pub struct RTCBounds {
    pub lower: [f32; 3],
    pub align0: f32,
    pub upper: [f32; 3],
    pub align1: f32,
}

const _: () = assert!(size_of::<RTCBounds>() == 32);

/// A box at time 0 and one at time 1.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, Default)]
pub struct RTCLinearBounds {
    pub bounds: [RTCBounds; 2],
}

/// A grid of vertices in a grid mesh's buffer.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCGrid {
    pub start_vertex: u32,
    pub stride: u32,
    /// Vertices from left to right.
    pub width: u16,
    pub height: u16,
}

const _: () = assert!(size_of::<RTCGrid>() == 12);

/// A transform whose parts are interpolated each for itself.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct RTCQuaternionDecomposition {
    pub scale: [f32; 3],
    /// xy, xz, yz.
    pub skew: [f32; 3],
    pub shift: [f32; 3],
    /// r, i, j, k.
    pub quaternion: [f32; 4],
    pub translation: [f32; 3],
}

const _: () = assert!(size_of::<RTCQuaternionDecomposition>() == 64);

/// Two primitives whose boxes overlap.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCCollision {
    pub geometry0: u32,
    pub primitive0: u32,
    pub geometry1: u32,
    pub primitive1: u32,
}
