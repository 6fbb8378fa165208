//! From corners, in one of three orders, to triangles.

use rayon::prelude::*;

use super::accessor::View;
use super::document::Document;
use super::schema::Primitive;
use crate::error::Result;

/// Corners that are worth a task of their own.
const TASK: usize = 1 << 14;

/// The triangles of a primitive, by its indices if it has some; checked.
pub(super) fn read(
    document: &Document<'_>,
    primitive: &Primitive,
    mode: u32,
    vertices: usize,
    pointer: &str,
) -> Result<Vec<[u32; 3]>> {
    let Some(index) = primitive.indices else {
        document.spend(pointer, vertices as u64 * 4)?;
        return Ok(triangles(mode, &(0..vertices as u32).collect::<Vec<_>>()));
    };
    let indices = View::new(document, index, &["SCALAR"])?;
    if !indices.is_index() {
        let message = "indices have to be unsigned: component type 5121, 5123 or 5125";
        return Err(document.error(format!("/accessors/{index}/componentType"), message));
    }
    document.spend(pointer, indices.count as u64 * 4)?;
    let triangles = match mode {
        4 => indices.triples(),
        _ => triangles(mode, &(0..indices.count).map(|i| indices.index(i)).collect::<Vec<_>>()),
    };
    let is_past = |&i: &u32| i as usize >= vertices;
    let tasks = triangles.as_flattened().par_chunks(TASK);
    if let Some(past) = tasks.find_map_first(|part| part.iter().copied().find(is_past)) {
        // Looked for only now, since corners of strips and fans belong to several triangles.
        let at = (0..indices.count).position(|i| is_past(&indices.index(i))).unwrap_or_default();
        let message = format!("index {past} (element {at}) is past the {vertices} vertices");
        return Err(document.error(format!("/accessors/{index}"), message));
    }
    Ok(triangles)
}

/// Triangles of a list (4), a strip (5) or a fan (6); corners that do not complete one are dropped, as they are by
/// graphics hardware.
fn triangles(mode: u32, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        5 => {
            // Every other triangle of a strip turns the other way.
            let turned = |(k, w): (usize, &[u32])| [w[0], w[1 + k % 2], w[2 - k % 2]];
            corners.windows(3).enumerate().map(turned).collect()
        }
        6 => match corners {
            [first, rest @ ..] => rest.windows(2).map(|w| [w[0], w[1], *first]).collect(),
            [] => Vec::new(),
        },
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_make_triangles_as_specified() {
        // Section 3.7.2.1: strips {i, i + (1 + i % 2), i + (2 - i % 2)}, fans {i + 1, i + 2, 0}.
        assert_eq!(triangles(4, &[0, 1, 2, 3, 4]), [[0, 1, 2]]);
        assert_eq!(triangles(5, &[0, 1, 2, 3, 4]), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(6, &[9, 1, 2, 3]), [[1, 2, 9], [2, 3, 9]]);
        assert!([4, 5, 6].iter().all(|&mode| triangles(mode, &[]).is_empty() && triangles(mode, &[1, 2]).is_empty()));
    }
}
