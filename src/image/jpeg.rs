//! JPEG files that are cut short. Decoders fill up what is missing with grey, and say nothing, or say it where nobody looks.

/// Starts the compressed rows.
const SCAN: [u8; 2] = [0xff, 0xda];
/// Ends the picture. Neither is among compressed bytes, where a zero follows each 0xff.
const END: [u8; 2] = [0xff, 0xd9];

/// Whether these are the bytes of a JPEG file without its end. A thumbnail before the rows has an end of its own.
pub(crate) fn is_cut_short(bytes: &[u8]) -> bool {
    let last = |marker: &[u8]| memchr::memmem::rfind(bytes, marker);
    bytes.starts_with(&[0xff, 0xd8]) && last(&END) < last(&SCAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_stands_behind_the_rows() {
        let whole = [0xff, 0xd8, 0xff, 0xe1, 0xff, 0xd9, 0xff, 0xda, 7, 0xff, 0, 9, 0xff, 0xd9, 0];
        assert!(!is_cut_short(&whole) && !is_cut_short(&whole[..14]));
        assert!(is_cut_short(&whole[..13]) && is_cut_short(&whole[..8]));
        assert!(!is_cut_short(b"\x89PNG"), "no JPEG");
    }
}
