//! Values at vertices, interpolated over a primitive as its position is.

use super::{Geometry, Kind, Shape, State};
use crate::abi::{Outputs, buffer_type};
use crate::buffer::View;
use crate::failure::{Failure, Result};

/// Where in a geometry, and what.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub primitive: u32,
    pub u: f32,
    pub v: f32,
    pub buffer_type: u32,
    pub slot: u32,
}

/// Three vertices, and how values change with u and v between them.
struct Patch {
    vertices: [u32; 3],
    u: f32,
    v: f32,
    /// What one of u, and of v, is in terms of the patch's own.
    scale: [f32; 2],
}

/// Values of `count` components at a place, component k of value i at `k * stride + i` of each output that is not null.
///
/// # Safety
/// The outputs have room for that.
pub unsafe fn interpolate(
    geometry: &Geometry,
    place: &Place,
    outputs: &Outputs,
    count: u32,
    stride: usize,
) -> Result<()> {
    geometry.demand(geometry.kind.is_surface() || geometry.kind == Kind::Linear(Shape::RoundCurve))?;
    let state = geometry.state();
    let view = match place.buffer_type {
        buffer_type::VERTEX => state.vertices.get(place.slot as usize),
        buffer_type::VERTEX_ATTRIBUTE => state.attributes.get(place.slot as usize),
        _ => None,
    };
    let view = view.and_then(Option::as_ref).ok_or_else(|| Failure::argument("invalid buffer"))?;
    let missing = || Failure::argument("primitive out of range");
    let patch = patch(geometry.kind, &state, place).ok_or_else(missing)?;
    for k in 0..count as usize {
        let [p0, p1, p2] = patch.vertices.map(|vertex| component(view, vertex, k));
        let (p0, p1, p2) = (p0.ok_or_else(missing)?, p1.ok_or_else(missing)?, p2.ok_or_else(missing)?);
        let value = (1.0 - patch.u - patch.v) * p0 + (patch.u * p1 + patch.v * p2);
        let put = |output: *mut f32, value: f32| {
            if !output.is_null() {
                // SAFETY: the caller promised that much room.
                unsafe { output.wrapping_add(k * stride).write(value) };
            }
        };
        put(outputs.value, value);
        put(outputs.du, (p1 - p0) * patch.scale[0]);
        put(outputs.dv, (p2 - p0) * patch.scale[1]);
        put(outputs.dudu, 0.0);
        put(outputs.dvdv, 0.0);
        put(outputs.dudv, 0.0);
    }
    Ok(())
}

fn component(view: &View, vertex: u32, k: usize) -> Option<f32> {
    if vertex as usize >= view.count() {
        return None;
    }
    let at = view.data().wrapping_add(vertex as usize * view.stride() + 4 * k);
    // SAFETY: callers may ask for as many components as are in the buffer, which is theirs to know; the interface has
    // no other rule.
    Some(unsafe { at.cast::<f32>().read_unaligned() })
}

fn patch(kind: Kind, state: &State, place: &Place) -> Option<Patch> {
    let (u, v) = (place.u, place.v);
    match kind {
        Kind::Triangles => {
            let vertices = state.index.as_ref()?.words::<3>(place.primitive as usize)?;
            Some(Patch { vertices, u, v, scale: [1.0; 2] })
        }
        Kind::Quads => {
            let [a, b, c, d] = state.index.as_ref()?.words::<4>(place.primitive as usize)?;
            Some(half([a, b, c, d], u, v, [1.0; 2]))
        }
        Kind::Grids => {
            let [first, stride, size] = state.grids.as_ref()?.words::<3>(place.primitive as usize)?;
            let (columns, rows) = ((size & 0xffff).checked_sub(1)?, (size >> 16).checked_sub(1)?);
            let (x, y) = (u * columns as f32, v * rows as f32);
            let column = (x.floor().max(0.0) as u32).min(columns.checked_sub(1)?);
            let row = (y.floor().max(0.0) as u32).min(rows.checked_sub(1)?);
            let at = |x: u32, y: u32| first.wrapping_add(y.wrapping_mul(stride)).wrapping_add(x);
            let corners = [at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1)];
            Some(half(corners, x - column as f32, y - row as f32, [columns as f32, rows as f32]))
        }
        Kind::Linear(Shape::RoundCurve) => {
            let [first] = state.index.as_ref()?.words::<1>(place.primitive as usize)?;
            let next = first.checked_add(1)?;
            Some(Patch { vertices: [first, next, first], u, v: 0.0, scale: [1.0, 0.0] })
        }
        Kind::Linear(_) | Kind::User | Kind::Instance | Kind::InstanceArray | Kind::Absent => None,
    }
}

/// The half of a quad that a place is in.
fn half([a, b, c, d]: [u32; 4], u: f32, v: f32, [x, y]: [f32; 2]) -> Patch {
    if u + v <= 1.0 {
        Patch { vertices: [a, b, d], u, v, scale: [x, y] }
    } else {
        Patch { vertices: [c, d, b], u: 1.0 - u, v: 1.0 - v, scale: [-x, -y] }
    }
}
