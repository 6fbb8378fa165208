//! The elements face and tristrips: lists of corners.

use super::header::{Element, Header};
use super::item::Item;
use super::vertices::Positions;
use super::wedges::Wedges;
use super::{Items, TELL};
use crate::io::{Placeless, polygon};

/// The face and tristrips elements.
#[derive(Default)]
pub(super) struct Faces {
    /// Indices of vertices, or of wedges where there are such.
    pub(super) triangles: Vec<[u32; 3]>,
    /// What faces have of their own.
    pub(super) wedges: Option<Wedges>,
    /// Faces with fewer than three corners.
    pub(super) small: u64,
}

impl Faces {
    /// None so far, of a file with this header.
    pub(super) fn new(header: &Header) -> Self {
        Self { wedges: Wedges::of(header), ..Self::default() }
    }

    pub(super) fn read(&mut self, element: &Element, items: &mut impl Items, positions: &Positions) -> Placeless<()> {
        let list = indices(element)?;
        // Bounded by the size of the file: `read` has compared them.
        let count = element.count as usize;
        if let Some(wedges) = &mut self.wedges
            && let Some(triangles) = wedges.read_at_once(element, items, positions.len())
        {
            self.triangles = triangles;
            return Ok(());
        }
        let read = if self.wedges.is_some() { 0 } else { self.read_at_once(element, items, positions) };
        let coordinates = self.wedges.as_ref().and_then(|wedges| wedges.coordinates);
        let lists: Vec<usize> = [list].into_iter().chain(coordinates).collect();
        let mut item = Item::of(element);
        let (mut corners, mut around, mut parts) = (Vec::new(), Vec::new(), Vec::new());
        for i in read..count {
            if i % TELL == 0 {
                items.tell();
            }
            item.read(element, items, &lists)?;
            whole(&item.lists[list], positions.len(), &mut corners)?;
            if corners.len() < 3 {
                self.small += 1;
                continue;
            }
            parts.clear();
            if corners.len() > 3 {
                around.clear();
                around.extend(corners.iter().map(|&i| positions.get(i)));
                polygon::triangulate(&around, &mut parts)?;
            } else {
                parts.push([0, 1, 2]);
            }
            if let Some(wedges) = &mut self.wedges {
                wedges.face(&item, &mut corners, parts.len())?;
            }
            self.triangles.extend(parts.iter().map(|t| t.map(|k| corners[k as usize])));
        }
        Ok(())
    }

    /// Reads the triangles at the beginning that are records of one size, behind those of strips that came first, and
    /// gives their number.
    fn read_at_once(&mut self, element: &Element, items: &mut impl Items, positions: &Positions) -> usize {
        let at_once = items.triangles(element, positions.len());
        let read = at_once.len();
        if self.triangles.is_empty() {
            self.triangles = at_once
        } else {
            self.triangles.extend(at_once)
        }
        read
    }

    /// Strips of triangles, one after the other in each list; -1 ends a strip.
    pub(super) fn read_strips(
        &mut self,
        element: &Element,
        items: &mut impl Items,
        positions: &Positions,
    ) -> Placeless<()> {
        let list = indices(element)?;
        let mut item = Item::of(element);
        let mut strip = Vec::new();
        for _ in 0..element.count {
            item.read(element, items, &[list])?;
            for part in item.lists[list].split(|&i| i == -1.0) {
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
    let index = element.list(&names);
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
