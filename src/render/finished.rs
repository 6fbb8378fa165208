//! Pixels that are done, for who watches a render.

use super::tiles::Tile;
use crate::math::Vec4;

/// A rectangle of the picture that is rendered, done.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// Columns to the left of it.
    pub x: u32,
    /// Rows above it.
    pub y: u32,
    /// Pixels in a row.
    pub width: u32,
    /// Linear RGB, premultiplied, and coverage, row by row.
    pub pixels: Vec<Vec4>,
}

impl Finished {
    /// Of pixels in the order of [`Tile::pixels`].
    pub(super) fn new(tile: &Tile, pixels: &[Vec4]) -> Self {
        let Tile { x, y, width, .. } = *tile;
        let mut rows = vec![Vec4::ZERO; tile.len()];
        for ((column, row), pixel) in tile.pixels().zip(pixels) {
            rows[((row - y) * width + column - x) as usize] = *pixel;
        }
        Self { x, y, width, pixels: rows }
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.pixels.len() as u32 / self.width
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_row_by_row() {
        let tile = Tile { x: 64, y: 32, width: 5, height: 3 };
        let pixels: Vec<Vec4> = tile.pixels().map(|(x, y)| Vec4::new(x as f32, y as f32, 0.0, 1.0)).collect();
        let finished = Finished::new(&tile, &pixels);
        assert_eq!((finished.x, finished.y, finished.width, finished.height()), (64, 32, 5, 3));
        for (i, pixel) in finished.pixels.iter().enumerate() {
            assert_eq!(*pixel, Vec4::new((64 + i % 5) as f32, (32 + i / 5) as f32, 0.0, 1.0));
        }
    }
}
