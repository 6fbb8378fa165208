//! One item of an element: a vertex, a face.

use super::Items;
use super::header::{Element, Scalar};
use crate::io::Placeless;

/// What the item that was read last holds, by property.
pub(super) struct Item {
    pub(super) values: Vec<f64>,
    /// Those that were wanted.
    pub(super) lists: Vec<Vec<f64>>,
}

impl Item {
    /// Of an element.
    pub(super) fn of(element: &Element) -> Self {
        Self { values: vec![0.0; element.properties.len()], lists: vec![Vec::new(); element.properties.len()] }
    }

    /// Reads the next item, all values of it and some of its lists.
    pub(super) fn read(&mut self, element: &Element, items: &mut impl Items, lists: &[usize]) -> Placeless<()> {
        for (index, property) in element.properties.iter().enumerate() {
            let Some(counter) = property.list else {
                self.values[index] = items.scalar(property.scalar)?;
                continue;
            };
            let is_wanted = lists.contains(&index);
            let list = &mut self.lists[index];
            list.clear();
            for _ in 0..list_length(items, counter)? {
                let value = items.scalar(property.scalar)?;
                if is_wanted {
                    list.push(value);
                }
            }
        }
        Ok(())
    }
}

/// Reads the length of a list and compares it with what is left of the file.
fn list_length(items: &mut impl Items, counter: Scalar) -> Placeless<usize> {
    let length = items.scalar(counter)?;
    let left = items.remaining();
    // Each entry takes a byte at least, in either encoding.
    if length >= 0.0 && length <= left as f64 && length.fract() == 0.0 {
        return Ok(length as usize);
    }
    Err(format!("a list promises {length} entries, but only {left} bytes are left"))
}
