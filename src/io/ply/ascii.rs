//! The body of a text PLY file: words, whatever lines they stand in.

use super::Items;
use super::header::{Element, Scalar};
use crate::io::Placeless;
use crate::io::text::{Words, quoted};
use crate::memory::Mapped;

pub(super) struct Ascii<'a> {
    file: &'a Mapped<'a>,
    words: Words<'a>,
    /// Bytes that the file has been told of.
    told: usize,
}

impl<'a> Ascii<'a> {
    /// The body, which begins at the given byte of the file, in a line of the given number.
    pub(super) fn new(file: &'a Mapped<'a>, begin: usize, line: usize) -> Self {
        Self { file, words: Words::new(&file[begin..], line), told: begin }
    }
}

impl Items for Ascii<'_> {
    fn place(&self) -> String {
        format!("line {}", self.words.line)
    }

    fn remaining(&self) -> usize {
        // The last word needs no space after it.
        self.words.remaining() + 1
    }

    fn rest(&self) -> usize {
        self.words.rest().len()
    }

    fn tell(&mut self) {
        let read = self.file.len() - self.words.remaining();
        self.file.done(&self.file[self.told..read]);
        self.told = read;
    }

    fn least_size(&self, element: &Element) -> usize {
        2 * element.properties.len()
    }

    fn scalar(&mut self, scalar: Scalar) -> Placeless<f64> {
        let value: f64 = self.words.number_or_word().map_err(|word| match word {
            Some(word) => format!("{} is not a number", quoted(word)),
            None => "the file ends before its last element".to_owned(),
        })?;
        // As the binary file would hold it.
        Ok(if scalar == Scalar::F32 { f64::from(value as f32) } else { value })
    }
}
