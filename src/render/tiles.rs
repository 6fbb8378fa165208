//! Which part of the picture is rendered when.

use super::Crop;

/// Largest edge of a tile in pixels; edges are powers of two.
pub const MAX_TILE: u32 = 64;

/// 1024 rays fill packets of any width and fit into the cache.
pub(super) const DEFAULT_TILE: u32 = 32;

/// The order in which tiles are begun. Never changes a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileOrder {
    /// Row by row from the top.
    Scanline,
    /// Along Hilbert's curve (1891, *Über die stetige Abbildung einer Linie auf ein Flächenstück*): the next tile is a
    /// neighbour, so that it finds the scene's nodes in the cache.
    #[default]
    Hilbert,
    /// From the middle outwards, so that what matters is seen first.
    Spiral,
}

impl TileOrder {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Scanline, Self::Hilbert, Self::Spiral];

    /// As flags have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scanline => "scanline",
            Self::Hilbert => "hilbert",
            Self::Spiral => "spiral",
        }
    }
}

/// A rectangle of pixels, not empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Tile {
    /// Its pixels along a Z-order curve (Morton 1966): every 64 are a block of 8 x 8, every 16 one of 4 x 4.
    pub(super) fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let Self { x, y, width, height } = *self;
        // Beyond its square the curve does not come back.
        let edge = width.max(height).next_power_of_two() as usize;
        Z_ORDER[..edge * edge].iter().filter_map(move |&[px, py]| {
            let (px, py) = (u32::from(px), u32::from(py));
            (px < width && py < height).then_some((x + px, y + py))
        })
    }

    /// Where it is in a part of the picture.
    pub(super) fn within(&self, window: &Crop) -> Self {
        Self { x: self.x - window.x, y: self.y - window.y, ..*self }
    }

    /// How many pixels.
    pub(super) fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Column and row of every place along the curve.
static Z_ORDER: [[u8; 2]; (MAX_TILE * MAX_TILE) as usize] = {
    let mut order = [[0; 2]; (MAX_TILE * MAX_TILE) as usize];
    let mut place = 0;
    while place < MAX_TILE * MAX_TILE {
        order[place as usize] = [every_other_bit(place), every_other_bit(place >> 1)];
        place += 1;
    }
    order
};

/// Bits 0, 2, 4 ... of a number below 2^12, side by side.
const fn every_other_bit(number: u32) -> u8 {
    let (mut bits, mut i) = (0, 0);
    while i < 6 {
        bits |= (number >> (2 * i) & 1) << i;
        i += 1;
    }
    bits as u8
}

/// All tiles of a picture, with edges of `edge` pixels, in the given order.
pub(super) fn tiles(width: u32, height: u32, edge: u32, order: TileOrder) -> Vec<Tile> {
    let (columns, rows) = (width.div_ceil(edge), height.div_ceil(edge));
    let mut places: Vec<_> = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).collect();
    match order {
        TileOrder::Scanline => {}
        TileOrder::Hilbert => {
            let side = columns.max(rows).next_power_of_two();
            places.sort_by_key(|&(x, y)| hilbert(side, x, y));
        }
        TileOrder::Spiral => places.sort_by_key(|&place| spiral(columns, rows, place)),
    }
    let tile = |(cx, cy): (u32, u32)| {
        let (x, y) = (cx * edge, cy * edge);
        Tile { x, y, width: edge.min(width - x), height: edge.min(height - y) }
    };
    places.into_iter().map(tile).collect()
}

/// The distance along Hilbert's curve through a square of `side` cells (a power of two).
fn hilbert(side: u32, mut x: u32, mut y: u32) -> u64 {
    let mut distance = 0;
    let mut s = side / 2;
    while s > 0 {
        let (right, up) = (u32::from(x & s > 0), u32::from(y & s > 0));
        distance += u64::from(s) * u64::from(s) * u64::from((3 * right) ^ up);
        // Turn the quadrant so that its curve starts at its own origin.
        if up == 0 {
            if right == 1 {
                (x, y) = (side - 1 - x, side - 1 - y);
            }
            (x, y) = (y, x);
        }
        s /= 2;
    }
    distance
}

/// The ring around the middle, and the place on it.
fn spiral(columns: u32, rows: u32, (x, y): (u32, u32)) -> (i64, i64) {
    // Twice the offset from the middle, so that even sizes have a middle too.
    let dx = 2 * i64::from(x) + 1 - i64::from(columns);
    let dy = 2 * i64::from(y) + 1 - i64::from(rows);
    let ring = dx.abs().max(dy.abs());
    let along = if dy == -ring {
        dx + ring
    } else if dx == ring {
        2 * ring + dy + ring
    } else if dy == ring {
        4 * ring + ring - dx
    } else {
        6 * ring + ring - dy
    };
    (ring, along)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILE: u32 = DEFAULT_TILE;

    #[test]
    fn every_order_covers_every_pixel_once() {
        for (width, height) in [(1, 1), (31, 33), (200, 100), (64, 7)] {
            for order in [TileOrder::Scanline, TileOrder::Hilbert, TileOrder::Spiral] {
                let edge = 4 << ((width + height) % 5);
                let tiles = tiles(width, height, edge, order);
                let mut pixels: Vec<_> = tiles.iter().flat_map(Tile::pixels).collect();
                assert_eq!(pixels.len(), tiles.iter().map(Tile::len).sum::<usize>());
                pixels.sort_unstable();
                let all: Vec<_> = (0..width).flat_map(|x| (0..height).map(move |y| (x, y))).collect();
                assert_eq!(pixels, all, "{width}x{height} {order:?}");
            }
        }
    }

    #[test]
    fn hilberts_curve_steps_to_neighbours() {
        let tiles = tiles(8 * TILE, 8 * TILE, TILE, TileOrder::Hilbert);
        for pair in tiles.windows(2) {
            assert_eq!(pair[0].x.abs_diff(pair[1].x) + pair[0].y.abs_diff(pair[1].y), TILE, "{pair:?}");
        }
    }

    #[test]
    fn spirals_begin_in_the_middle_and_end_at_the_rim() {
        let tiles = tiles(5 * TILE, 3 * TILE, TILE, TileOrder::Spiral);
        assert_eq!((tiles[0].x, tiles[0].y), (2 * TILE, TILE));
        let last = tiles.last().unwrap();
        assert!(last.x == 0 || last.x == 4 * TILE);
    }

    #[test]
    fn pixels_in_a_row_are_squares() {
        let tile = Tile { x: 32, y: 0, width: 32, height: 32 };
        let pixels: Vec<_> = tile.pixels().collect();
        assert_eq!(pixels.len(), 1024);
        assert!(pixels[..16].iter().all(|&(x, y)| (32..36).contains(&x) && y < 4));
        assert!(pixels[64..128].iter().all(|&(x, y)| (40..48).contains(&x) && y < 8));
    }
}
