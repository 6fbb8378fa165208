//! How pictures have to be turned to be seen: what cameras write into JPEG files, and Radiance into its line of sizes.

use super::samples::{Samples, Values};

/// The picture as it is seen, where `orientation` says how it lies in the file: 1 to 8 as EXIF counts (CIPA
/// DC-008, *Exif 2.32*, tag 274); everything else is 1, as it is seen.
pub(super) fn upright(samples: Samples, orientation: u32) -> Samples {
    if !(2..=8).contains(&orientation) {
        return samples;
    }
    let Samples { width, height, channels, values } = samples;
    let (last_x, last_y) = (width as usize - 1, height as usize - 1);
    let size = if orientation < 5 { [width, height] } else { [height, width] };
    // Where a pixel of the upright picture lies in the file.
    let source = |x: usize, y: usize| match orientation {
        2 => (last_x - x, y),
        3 => (last_x - x, last_y - y),
        4 => (x, last_y - y),
        5 => (y, x),
        6 => (y, last_y - x),
        7 => (last_x - y, last_y - x),
        _ => (last_x - y, x),
    };
    let places: Vec<usize> = (0..size[1] as usize)
        .flat_map(|y| (0..size[0] as usize).map(move |x| (x, y)))
        .map(|(x, y)| source(x, y))
        .map(|(x, y)| y * width as usize + x)
        .collect();
    let count = channels.count();
    let values = match values {
        Values::U8(v) => Values::U8(taken(&v, &places, count)),
        Values::U16(v) => Values::U16(taken(&v, &places, count)),
        Values::Half(v) => Values::Half(taken(&v, &places, count)),
        Values::Float(v) => Values::Float(taken(&v, &places, count)),
    };
    Samples { width: size[0], height: size[1], channels, values }
}

/// The pixels at these places, of `count` values each.
fn taken<T: Copy>(values: &[T], places: &[usize], count: usize) -> Vec<T> {
    places.iter().flat_map(|&place| values[place * count..][..count].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::samples::Channels;

    /// EXIF says where the first row and the first column of the file are seen.
    #[test]
    fn first_row_and_first_column_are_where_exif_says() {
        for (orientation, row, column) in [
            (1, "top", "left"),
            (2, "top", "right"),
            (3, "bottom", "right"),
            (4, "bottom", "left"),
            (5, "left", "top"),
            (6, "right", "top"),
            (7, "right", "bottom"),
            (8, "left", "bottom"),
        ] {
            // Two columns, three rows; each pixel tells its own.
            let values = (0..3u8).flat_map(|y| (0..2).flat_map(move |x| [x, y, 7])).collect();
            let channels = Channels { colour: true, alpha: None };
            let turned = upright(Samples { width: 2, height: 3, channels, values: Values::U8(values) }, orientation);
            let [width, height] = [turned.width, turned.height].map(|n| n as usize);
            assert_eq!([width, height], if orientation < 5 { [2, 3] } else { [3, 2] });
            let Values::U8(v) = &turned.values else { panic!("other values") };
            let side = |name: &str| -> Vec<[u8; 2]> {
                let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
                let there = all.filter(|&(x, y)| match name {
                    "top" => y == 0,
                    "bottom" => y == height - 1,
                    "left" => x == 0,
                    _ => x == width - 1,
                });
                there.map(|(x, y)| [v[3 * (y * width + x)], v[3 * (y * width + x) + 1]]).collect()
            };
            assert!(side(row).iter().all(|pixel| pixel[1] == 0), "{orientation}");
            assert!(side(column).iter().all(|pixel| pixel[0] == 0), "{orientation}");
        }
    }
}
