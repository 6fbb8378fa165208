//! What the head of a large file promises of its mesh, before anything of the rest is read.
//!
//! Where memory is limited, a mesh that cannot fit is refused at once instead of after minutes of loading. Only heads that are no
//! work to read are asked; of the other formats nothing is known before all of it is.

use std::path::Path;

use super::{ply, stl, suffix};
use crate::memory::Mapped;

/// At least so much is in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Promised {
    /// Triangles.
    pub triangles: u64,
    /// Bytes that the mesh takes in memory.
    pub bytes: u64,
}

/// What is promised by a PLY file or a binary STL file that is long enough to keep it; none by any other. Whatever is wrong with the
/// file is for [`load`](super::load) to say.
pub fn promised(path: &Path) -> Option<Promised> {
    let file = Mapped::open(path).ok()?;
    match suffix(path).as_str() {
        "ply" => ply::promised(path, &file),
        "stl" => stl::promised_mesh(&file),
        _ => None,
    }
}
