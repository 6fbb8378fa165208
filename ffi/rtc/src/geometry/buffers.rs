//! Which buffers which kind of geometry has, and in what format.

use std::sync::Arc;

use super::{Geometry, Kind, Shape, State};
use crate::abi::{buffer_type, format};
use crate::buffer::{Buffer, View};
use crate::failure::{Failure, Result};

impl Geometry {
    /// Sets a buffer.
    pub fn set_buffer(&self, name: (u32, u32), view: View) -> Result<()> {
        self.check_format(name, view.format)?;
        self.modify(|state| {
            *slot(self.kind, state, name)? = Some(view);
            Ok(())
        })
    }

    /// A new buffer of the library's own, set.
    pub fn new_buffer(&self, name: (u32, u32), format: u32, stride: usize, count: usize) -> Result<*mut u8> {
        // Before memory is taken.
        slot(self.kind, &mut self.state(), name)?;
        let bytes = stride.checked_mul(count).ok_or_else(|| Failure::argument("buffer range out of bounds"))?;
        let buffer = Arc::new(Buffer::new(Arc::clone(&self.device), bytes)?);
        let view = View::new(buffer, format, 0, stride, count)?;
        let data = view.data();
        self.set_buffer(name, view)?;
        Ok(data)
    }

    /// Where a buffer's first item is; null where none is set.
    pub fn buffer_data(&self, name: (u32, u32)) -> Result<*mut u8> {
        let mut state = self.state();
        Ok(slot(self.kind, &mut state, name)?.as_ref().map_or(std::ptr::null_mut(), View::data))
    }

    /// The caller has written to a buffer.
    pub fn update_buffer(&self, name: (u32, u32)) -> Result<()> {
        let has_buffers = self.kind.is_mesh() || self.kind == Kind::InstanceArray;
        // All of a geometry without buffers is new.
        self.modify(|state| if has_buffers { slot(self.kind, state, name).map(|_| ()) } else { Ok(()) })
    }

    fn check_format(&self, (buffer, _): (u32, u32), given: u32) -> Result<()> {
        let is_right = match (buffer, self.kind) {
            (_, Kind::Absent) => true,
            (buffer_type::INDEX, Kind::Triangles) => given == format::UINT3,
            (buffer_type::INDEX, Kind::Quads) => given == format::UINT4,
            (buffer_type::INDEX, _) => given == format::UINT,
            (buffer_type::VERTEX, Kind::Linear(_)) => given == format::FLOAT4,
            (buffer_type::VERTEX, _) => given == format::FLOAT3,
            (buffer_type::NORMAL, _) => given == format::FLOAT3,
            (buffer_type::VERTEX_ATTRIBUTE, _) => (format::FLOAT..=format::FLOAT16).contains(&given),
            (buffer_type::GRID, _) => given == format::GRID,
            (buffer_type::FLAGS, _) => given == format::UCHAR,
            (buffer_type::TRANSFORM, _) => super::transform::words(given).is_some(),
            // Which buffers there are is told by `slot`.
            _ => true,
        };
        let name = match buffer {
            buffer_type::INDEX => "index",
            buffer_type::VERTEX => "vertex",
            buffer_type::VERTEX_ATTRIBUTE => "vertex attribute",
            _ => "",
        };
        if is_right { Ok(()) } else { Err(Failure::operation(format!("invalid {name} buffer format"))) }
    }
}

/// Where a buffer is kept.
fn slot(kind: Kind, state: &mut State, (buffer, slot): (u32, u32)) -> Result<&mut Option<View>> {
    if kind == Kind::Absent {
        let known = state.absent.iter().position(|(name, _)| *name == (buffer, slot));
        let place = known.unwrap_or_else(|| {
            state.absent.push(((buffer, slot), None));
            state.absent.len() - 1
        });
        return Ok(&mut state.absent[place].1);
    }
    let steps = |views| nth(views, slot, "invalid vertex buffer slot");
    let is_curve = kind == Kind::Linear(Shape::RoundCurve);
    match buffer {
        buffer_type::VERTEX if kind.is_mesh() => steps(&mut state.vertices),
        buffer_type::NORMAL if kind == Kind::Linear(Shape::OrientedDisc) => steps(&mut state.normals),
        buffer_type::VERTEX_ATTRIBUTE if kind.is_mesh() => nth(&mut state.attributes, slot, "invalid buffer slot"),
        buffer_type::TRANSFORM if kind == Kind::InstanceArray => steps(&mut state.transform_buffers),
        buffer_type::INDEX if matches!(kind, Kind::Triangles | Kind::Quads | Kind::InstanceArray) || is_curve => {
            only(&mut state.index, slot)
        }
        buffer_type::GRID if kind == Kind::Grids => only(&mut state.grids, slot),
        buffer_type::FLAGS if is_curve => only(&mut state.flags, slot),
        _ if kind.is_mesh() || kind == Kind::InstanceArray => Err(Failure::argument("unknown buffer type")),
        _ => Err(Failure::operation("operation not supported for this geometry")),
    }
}

fn nth<'a>(views: &'a mut [Option<View>], slot: u32, message: &str) -> Result<&'a mut Option<View>> {
    views.get_mut(slot as usize).ok_or_else(|| Failure::argument(message))
}

fn only(view: &mut Option<View>, slot: u32) -> Result<&mut Option<View>> {
    if slot == 0 { Ok(view) } else { Err(Failure::argument("invalid buffer slot")) }
}
