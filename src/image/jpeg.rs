//! What JPEG files are asked before a decoder gets to see them: whether they are cut short, and what is not the
//! picture.
//!
//! Of what is missing decoders say nothing and fill it up with grey, or say it where nobody looks.

#[cfg(feature = "oiio")]
use image::metadata::Orientation;

/// Begins a file.
const START: [u8; 2] = [0xff, 0xd8];
/// The second byte of the marker that begins the compressed rows.
const SCAN: u8 = 0xda;
/// Ends the picture. It is not among compressed bytes, where a zero follows each 0xff.
const END: [u8; 2] = [0xff, 0xd9];

/// Whether these are the bytes of a JPEG file that has rows and no end. What comes after the end, such as a phone's
/// film, does not matter.
pub(crate) fn is_cut_short(bytes: &[u8]) -> bool {
    rows(bytes).is_some_and(|rows| memchr::memmem::find(rows, &END).is_none())
}

/// From the first rows on, after all segments before them, of which one may hold a thumbnail with rows and an end of
/// its own. None where there are none.
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

/// A JPEG file with nothing beside the picture.
#[cfg(feature = "oiio")]
pub(super) struct Plain {
    pub bytes: Vec<u8>,
    /// How it has to be turned to be seen, 1 to 8, which stood beside it.
    pub orientation: u32,
}

/// What applications write, and comments: all but JFIF's and Adobe's segments, which say how colours are stored.
#[cfg(feature = "oiio")]
const BESIDE: [u8; 15] = [0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xeb, 0xec, 0xed, 0xef, 0xfe];

/// The file without what stands beside the picture. None where no rows are found.
#[cfg(feature = "oiio")]
pub(super) fn plain(bytes: &[u8]) -> Option<Plain> {
    let (mut picture, mut orientation) = (START.to_vec(), None);
    let mut rest = bytes.strip_prefix(&START)?;
    loop {
        let [0xff, marker, high, low, ..] = *rest else { return None };
        if marker == SCAN {
            picture.extend_from_slice(rest);
            return Some(Plain { bytes: picture, orientation: orientation.unwrap_or(1) });
        }
        let length = if marker == 0xff { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
        let (segment, next) = rest.split_at_checked(length)?;
        if !BESIDE.contains(&marker) {
            picture.extend_from_slice(segment);
        } else if let Some(exif) = segment.get(4..).and_then(|contents| contents.strip_prefix(b"Exif\0\0")) {
            // Of several the first: that is where cameras have to write it.
            orientation = orientation.or(Orientation::from_exif_chunk(exif).map(|found| found.to_exif().into()));
        }
        rest = next;
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

    #[cfg(feature = "oiio")]
    #[test]
    fn what_stands_beside_the_picture_is_left_out() {
        let exif = b"\xff\xe1\0\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        let [jfif, adobe, comment, rows] =
            [&b"\xff\xe0\0\x02"[..], b"\xff\xee\0\x03a", b"\xff\xfe\0\x02", b"\xff\xda\0\x02\xff\xe1\0\x02"];
        let found = plain(&[&START[..], jfif, exif, comment, adobe, rows].concat()).expect("a picture");
        assert_eq!((found.bytes, found.orientation), ([&START[..], jfif, adobe, rows].concat(), 6));
        // Segments that end before they begin, or with the file, or say nothing.
        for broken in [&b"\xff\xe1\0\x02"[..], b"\xff\xe1\0\x08Exif\0\0"] {
            let found = plain(&[&START[..], broken, rows].concat()).map(|found| found.orientation);
            assert_eq!(found, Some(1), "{broken:?}");
        }
        for broken in [&b"\xff\xe1\xff\xff"[..], b"\xff\xe1\0\0"] {
            assert!(plain(&[&START[..], broken, rows].concat()).is_none());
        }
        assert!(plain(b"\xff\xd8\xff").is_none() && plain(b"").is_none());
    }
}
