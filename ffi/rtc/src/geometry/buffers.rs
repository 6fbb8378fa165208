//! Which buffers which kind of geometry has, and in what format.

use std::sync::Arc;

use super::{Geometry, Kind, Shape, State};
use crate::abi::{buffer_type, format};
use crate::buffer::{Buffer, Items, View};
use crate::failure::{Failure, Result};

/// Embree's own limit.
const MAX_VERTEX_BYTES: usize = 16 << 30;

impl Geometry {
    /// Sets a buffer. What was committed stands until scenes are made anew: unlike other changes, this one needs no
    /// commit for that, as in Embree, while there are as many primitives as before.
    pub fn set_buffer(&self, name: (u32, u32), buffer: Arc<Buffer>, items: Items) -> Result<()> {
        self.check(name, &items, buffer.data() as usize)?;
        let view = View::new(buffer, items)?;
        let count = view.count();
        let mut state = self.state();
        let before = slot(self.kind, &mut state, name)?.replace(view);
        state.buffers += 1;
        if name == self.kind.primitives() && before.is_none_or(|before| before.count() != count) {
            state.is_committed = false;
        }
        Ok(())
    }

    /// A new buffer of the library's own, set; null where it has no bytes.
    pub fn new_buffer(&self, name: (u32, u32), items: Items) -> Result<*mut u8> {
        // Before memory is taken.
        self.check(name, &items, 0)?;
        let Items { stride, count, .. } = items;
        // Callers may read a whole vector at the last vertex.
        let is_wide = matches!(name.0, buffer_type::VERTEX | buffer_type::VERTEX_ATTRIBUTE);
        let more = if is_wide { stride.wrapping_neg() % 16 } else { 0 };
        let bytes = stride.checked_mul(count).and_then(|bytes| bytes.checked_add(more));
        let bytes = bytes.ok_or_else(|| Failure::argument("buffer range out of bounds"))?;
        let (bytes, count) = if bytes == 0 { (0, 0) } else { (bytes.max(items.end()?), count) };
        let buffer = Arc::new(Buffer::new(Arc::clone(&self.device), bytes)?);
        let data = buffer.data();
        self.set_buffer(name, buffer, Items { count, ..items })?;
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

    /// Whether the geometry takes such a buffer, which begins at an address; looked at in Embree's order, which decides
    /// what is told.
    fn check(&self, name: (u32, u32), items: &Items, address: usize) -> Result<()> {
        if items.count > u32::MAX as usize {
            return Err(Failure::argument("buffer too large"));
        }
        if matches!(self.kind, Kind::User | Kind::Instance) {
            return slot(self.kind, &mut self.state(), name).map(|_| ());
        }
        let is_of_words = match self.kind {
            Kind::Absent => false,
            Kind::Linear(_) => name.0 != buffer_type::FLAGS,
            _ => true,
        };
        if is_of_words && !items.is_aligned(address) {
            return Err(Failure::operation("data must be 4 bytes aligned"));
        }
        let found = slot(self.kind, &mut self.state(), name).map(|_| ());
        let format = self.check_format(name, items.format);
        let has_normals = self.kind == Kind::Linear(Shape::OrientedDisc);
        match name.0 {
            buffer_type::VERTEX => {
                format.and(found)?;
                let is_small = items.stride.checked_mul(items.count).is_some_and(|bytes| bytes <= MAX_VERTEX_BYTES);
                let too_large = || Failure::operation("vertex buffer can be at most 16GB large");
                is_small.then_some(()).ok_or_else(too_large)
            }
            buffer_type::NORMAL if !has_normals => found,
            buffer_type::VERTEX_ATTRIBUTE | buffer_type::NORMAL => {
                format.and(found).map_err(|failure| Failure::operation(failure.message))
            }
            _ => found.and(format),
        }
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
