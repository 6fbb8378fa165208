//! The elements face and tristrips: lists of corners.

use super::header::Element;
use super::vertices::Positions;
use super::{Items, TELL, read_list};
use crate::io::{Placeless, polygon};

/// The face and tristrips elements.
#[derive(Default)]
pub(super) struct Faces {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Faces with fewer than three corners.
    pub(super) small: u64,
}

impl Faces {
    pub(super) fn read(&mut self, element: &Element, items: &mut impl Items, positions: &Positions) -> Placeless<()> {
        let list = indices(element)?;
        // Bounded by the size of the file: `read` has compared them.
        let count = element.count as usize;
        // Behind those of strips that came first.
        let at_once = items.triangles(element, positions.len());
        let read = at_once.len();
        if self.triangles.is_empty() {
            self.triangles = at_once
        } else {
            self.triangles.extend(at_once)
        }
        let (mut values, mut corners) = (Vec::new(), Vec::new());
        let (mut around, mut parts) = (Vec::new(), Vec::new());
        for i in read..count {
            if i % TELL == 0 {
                items.tell();
            }
            read_list(element, items, list, &mut values)?;
            whole(&values, positions.len(), &mut corners)?;
            match corners[..] {
                [a, b, c] => self.triangles.push([a, b, c]),
                [_, _, _, _, ..] => {
                    around.clear();
                    around.extend(corners.iter().map(|&i| positions.get(i)));
                    parts.clear();
                    polygon::triangulate(&around, &mut parts)?;
                    self.triangles.extend(parts.iter().map(|t| t.map(|k| corners[k as usize])));
                }
                _ => self.small += 1,
            }
        }
        Ok(())
    }

    /// Strips of triangles, one after the other in each list; -1 ends a strip.
    pub(super) fn read_strips(
        &mut self,
        element: &Element,
        items: &mut impl Items,
        positions: &Positions,
    ) -> Placeless<()> {
        let list = indices(element)?;
        let (mut values, mut strip) = (Vec::new(), Vec::new());
        for _ in 0..element.count {
            read_list(element, items, list, &mut values)?;
            for part in values.split(|&i| i == -1.0) {
                whole(part, positions.len(), &mut strip)?;
                self.triangles.extend(strip.windows(3).enumerate().filter_map(|(k, w)| {
                    // Every other triangle turns the other way; strips are stitched with triangles without area.
                    let triangle = if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
                    (w[0] != w[1] && w[1] != w[2] && w[0] != w[2]).then_some(triangle)
                }));
            }
        }
        Ok(())
    }
}

/// The list of corners among an element's properties.
pub(super) fn indices(element: &Element) -> Placeless<usize> {
    let names = ["vertex_indices", "vertex_index"];
    let index = element.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()));
    index.ok_or_else(|| format!("element {} needs the list property {}", element.name, names[0]))
}

/// Values as indices of vertices, in place of what `indices` held.
fn whole(values: &[f64], count: usize, indices: &mut Vec<u32>) -> Placeless<()> {
    indices.clear();
    for &value in values {
        let inside = value >= 0.0 && value < count as f64 && value < f64::from(u32::MAX) && value.fract() == 0.0;
        if !inside {
            return Err(past(value, count));
        }
        indices.push(value as u32);
    }
    Ok(())
}

fn past(index: f64, count: usize) -> String {
    format!("index {index} is not one of the {count} vertices (the element vertex comes first)")
}
