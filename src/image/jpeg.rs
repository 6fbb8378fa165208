//! JPEG files that are cut short. Decoders fill up what is missing with grey, and say nothing, or say it where nobody looks.

/// Begins a file.
const START: [u8; 2] = [0xff, 0xd8];
/// The second byte of the marker that begins the compressed rows.
const SCAN: u8 = 0xda;
/// Ends the picture. It is not among compressed bytes, where a zero follows each 0xff.
const END: [u8; 2] = [0xff, 0xd9];

/// Whether these are the bytes of a JPEG file that has rows and no end. What comes after the end, such as a phone's film, does not matter.
pub(crate) fn is_cut_short(bytes: &[u8]) -> bool {
    rows(bytes).is_some_and(|rows| memchr::memmem::find(rows, &END).is_none())
}

/// From the first rows on, after all segments before them, of which one may hold a thumbnail with rows and an end of its own. None where there are none.
fn rows(bytes: &[u8]) -> Option<&[u8]> {
    let mut rest = bytes.strip_prefix(&START)?;
    loop {
        let [0xff, marker, high, low, ..] = *rest else { return None };
        let skipped = match marker {
            SCAN => return Some(rest),
            // One that fills up.
            0xff => 1,
            _ => 2 + usize::from(u16::from_be_bytes([high, low])),
        };
        rest = rest.get(skipped..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_stands_behind_the_rows() {
        // A thumbnail, a filling byte, rows, the end, and something else, which looks like rows.
        let thumbnail = [0xff, 0xe1, 0, 6, 0xff, 0xda, 0xff, 0xd9];
        let rows = [0xff, 0xff, 0xda, 7, 0xff, 0, 9];
        let whole = [&START[..], &thumbnail, &rows, &END, &[1, 0xff, 0xda, 2]].concat();
        let end = whole.len() - 4;
        assert!(!is_cut_short(&whole) && !is_cut_short(&whole[..end]));
        assert!(is_cut_short(&whole[..end - 1]) && is_cut_short(&whole[..end - 4]));
        assert!(!is_cut_short(&whole[..9]) && !is_cut_short(b"\x89PNG"), "of which decoders know it");
    }
}
