//! Edges of a polygon that are gone along and straight back: they bound no area, and a polygon clipped with them gets
//! some.
//!
//! A way back has to come by the same corners. One that is divided otherwise, and a tip that stands twice, is left to
//! the clipping.

use crate::math::DVec3;

/// Whether the outline turns back on itself somewhere: the corners beside a tip are the same point.
pub(super) fn are_there(corners: &[DVec3]) -> bool {
    let count = corners.len();
    (0..count).any(|i| corners[i] == corners[(i + 2) % count])
}

/// The corners of the outline without them, two or fewer where no area is left; and triangles without area, as many as
/// the outline's has more than what is left.
pub(super) fn cut(corners: &[DVec3]) -> (Vec<u32>, Vec<[u32; 3]>) {
    let is_same = |a: u32, b: u32| corners[a as usize] == corners[b as usize];
    let (mut kept, mut flat) = (Vec::with_capacity(corners.len()), Vec::new());
    for corner in 0..corners.len() as u32 {
        match kept[..] {
            // Back at the corner before the tip: both go.
            [.., before, tip] if is_same(before, corner) => {
                flat.extend([[before, tip, corner], [before, corner, tip]]);
                kept.pop();
            }
            _ => kept.push(corner),
        }
    }
    // The outline is closed: its last corner or its first may be a tip.
    let (mut begin, mut end) = (0, kept.len());
    while let [first, second, .., before, last] = kept[begin..end] {
        if is_same(before, first) {
            flat.extend([[before, last, first], [before, first, last]]);
            end -= 2;
        } else if is_same(last, second) {
            flat.extend([[last, first, second], [last, second, first]]);
            begin += 2;
        } else {
            break;
        }
    }
    // Of a single corner that is left there is one too many.
    flat.truncate(corners.len() - 2);
    (kept[begin..end].to_vec(), flat)
}
