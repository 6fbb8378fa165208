//! Which formats are read, and how that of a file is told.
//!
//! Given a path alone, OpenImageIO has its readers try the file one after the other, whatever the suffix says, and some
//! of them write past their memory where a file is damaged (IFF, ICO and Maya's Z among them). So the first bytes
//! decide here, and no reader but one that is listed gets to see the file. To run the others in a process of their own
//! would cost one for each picture, for formats that nobody keeps light in.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::bridge::Result;
use crate::image::format::Format;
use crate::output::suffix;

/// What a file begins with, after so many other bytes.
type Mark = (usize, &'static [u8]);

/// The formats that are read, OpenImageIO's names of them, and how their files begin. Those of the formats that are not
/// (BMP, DDS, DPX, GIF, JPEG 2000, SGI, Targa ...) have written or read past their memory in versions that Debian has.
const READ: [(Format, &str, &[Mark]); 7] = [
    (Format::OpenExr, "openexr", &[(0, b"\x76\x2f\x31\x01")]),
    (Format::Radiance, "hdr", &[(0, b"#?")]),
    (Format::Png, "png", &[(0, b"\x89PNG\r\n\x1a\n")]),
    (Format::Jpeg, "jpeg", &[(0, b"\xff\xd8")]),
    (Format::Tiff, "tiff", &[(0, b"II*\0"), (0, b"MM\0*"), (0, b"II+\0"), (0, b"MM\0+")]),
    (Format::WebP, "webp", &[(8, b"WEBP")]),
    (
        Format::Netpbm,
        "pnm",
        &[(0, b"P1"), (0, b"P2"), (0, b"P3"), (0, b"P4"), (0, b"P5"), (0, b"P6"), (0, b"Pf"), (0, b"PF")],
    ),
];

/// The format that a file is in, and OpenImageIO's name of it.
///
/// # Errors
/// Words and a remedy for a format that is not read.
pub(super) fn of(path: &Path) -> Result<(Format, &'static str)> {
    let start = start(path).map_err(|error| error.to_string())?;
    told(&start).ok_or_else(|| {
        let is_read = |format| READ.iter().any(|&(read, ..)| read == format);
        let what = match suffix(path) {
            suffix if suffix.is_empty() => "no picture of a format that is read".to_owned(),
            suffix if Format::of(path).is_some_and(is_read) => {
                format!("no .{suffix} picture, nor another of a format that is read")
            }
            suffix => format!("pictures of the format .{suffix} are not read"),
        };
        format!("{what}; convert it to EXR, HDR, PNG, JPEG or TIFF")
    })
}

fn told(start: &[u8]) -> Option<(Format, &'static str)> {
    let begins = |&(at, bytes): &Mark| start.get(at..).is_some_and(|rest| rest.starts_with(bytes));
    READ.iter().find(|(.., marks)| marks.iter().any(begins)).map(|&(format, name, _)| (format, name))
}

fn start(path: &Path) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    File::open(path)?.take(16).read_to_end(&mut start)?;
    Ok(start)
}
