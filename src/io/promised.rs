//! What the head of a large file promises of its mesh, before anything of the rest is read.
//!
//! Where memory is limited, a mesh that cannot fit is refused at once instead of after minutes of loading. Only heads
//! that are no work to read are asked; of the other formats nothing is known before all of it is.

use std::path::Path;

use super::Format;
use crate::memory::Mapped;

/// At least so much is in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Promised {
    /// Triangles.
    pub triangles: u64,
    /// Bytes that the mesh takes in memory.
    pub bytes: u64,
}

/// What is promised by a PLY file or a binary STL file that is long enough to keep it; none by any other. Whatever is
/// wrong with the file is for [`load`](super::load) to say.
pub fn promised(path: &Path) -> Option<Promised> {
    let file = Mapped::open(path).ok()?;
    Format::of(path)?.promised(path, &file)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    /// What is promised by a file of this name and content.
    fn of(name: &str, content: &[u8]) -> Option<Promised> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("a file in it");
        promised(&path)
    }

    /// A binary file of a pentagon and a triangle, each with a byte for another property where there is one, and so
    /// many edges.
    fn polygons(property: &str, edges: u32) -> Vec<u8> {
        let other = if edges > 0 {
            format!("element edge {edges}\nproperty int vertex1\nproperty int vertex2\n")
        } else {
            String::new()
        };
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
            element face 2\nproperty list uchar int vertex_indices\n{property}{other}end_header\n"
        )
        .into_bytes();
        bytes.extend([0; 6 * 12]);
        for corners in [5_u8, 3] {
            bytes.push(corners);
            bytes.extend((0..u32::from(corners)).flat_map(u32::to_le_bytes));
            bytes.extend(vec![0; usize::from(!property.is_empty())]);
        }
        bytes.extend(vec![0; 8 * edges as usize]);
        bytes
    }

    /// A binary file that promises so many triangles, and has room for so many.
    fn stl(count: u32, room: usize) -> Vec<u8> {
        let mut bytes = vec![0; 84 + 50 * room];
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        bytes
    }

    #[test]
    fn heads_promise_vertices_and_triangles() {
        // Three floats or three indices each: of PLY vertices and faces, of STL faces alone.
        let one = Promised { triangles: 1, bytes: 4 * 12 };
        assert_eq!(of("a.ply", PLY.as_bytes()), Some(one));
        assert_eq!(of("a.PLY", PLY.as_bytes()), Some(one));
        assert_eq!(of("a.ply", &polygons("", 0)), Some(Promised { triangles: 4, bytes: (6 + 4) * 12 }));
        // With a colour of each face; edges behind them are no corners.
        let colored = "property uchar red\n";
        assert_eq!(of("a.ply", &polygons(colored, 2)), Some(Promised { triangles: 4, bytes: (6 + 4) * 12 }));
        // What else takes room is not known.
        let lists = "property list uchar float texcoord\n";
        assert_eq!(of("a.ply", &polygons(lists, 2)), Some(Promised { triangles: 2, bytes: (6 + 2) * 12 }));
        let seven = Promised { triangles: 7, bytes: 7 * 12 };
        assert_eq!(of("a.stl", &stl(7, 7)), Some(seven));
        assert_eq!(of("a.stl", &stl(7, 9)), Some(seven), "what follows the last one is no triangle");
        // The first word of a text, in a file that is as long as its header says.
        let mut solid = stl(7, 7);
        solid[..11].copy_from_slice(b"solid facet");
        assert_eq!(of("a.stl", &solid), Some(seven));
    }

    #[test]
    fn what_is_not_there_is_not_promised() {
        assert_eq!(of("a.ply", PLY.replace("face 1", "face 99999").as_bytes()), None);
        assert_eq!(of("a.ply", PLY.replace("vertex 3", "vertex 18446744073709551615").as_bytes()), None);
        assert_eq!(of("a.ply", b"nothing of the kind"), None);
        assert_eq!(of("a.stl", &stl(7, 6)), None);
        assert_eq!(of("a.stl", &[0; 83]), None);
        assert_eq!(promised(Path::new("no/such/file.ply")), None);
    }

    #[test]
    fn texts_and_other_formats_promise_nothing() {
        let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
        let mut text = format!("solid a\n{}endsolid a\n", facet.repeat(3)).into_bytes();
        assert_eq!(of("a.stl", &text), None);
        // Where a binary file has its number, one that the file would keep.
        text[80..84].fill(0);
        assert_eq!(of("a.stl", &text), None);
        assert_eq!(of("a.obj", PLY.as_bytes()), None);
        assert_eq!(of("ply", PLY.as_bytes()), None);
    }
}
