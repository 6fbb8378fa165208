//! The body of a text PLY file: words, whatever lines they stand in.

use super::Items;
use super::header::{Element, Scalar};
use crate::io::Placeless;
use crate::io::text::{Words, number, quoted};

pub(super) struct Ascii<'a>(Words<'a>);

impl<'a> Ascii<'a> {
    /// The body, whose first line has the given number.
    pub(super) fn new(body: &'a [u8], line: usize) -> Self {
        Self(Words::new(body, line))
    }
}

impl Items for Ascii<'_> {
    fn place(&self) -> String {
        format!("line {}", self.0.line)
    }

    fn remaining(&self) -> usize {
        // The last word needs no space after it.
        self.0.remaining() + 1
    }

    fn least_size(&self, element: &Element) -> usize {
        2 * element.properties.len()
    }

    fn scalar(&mut self, scalar: Scalar) -> Placeless<f64> {
        let word = self.0.next().ok_or("the file ends before its last element")?;
        let value: f64 = number(word).ok_or_else(|| format!("{} is not a number", quoted(word)))?;
        // As the binary file would hold it.
        Ok(if scalar == Scalar::F32 { f64::from(value as f32) } else { value })
    }
}
