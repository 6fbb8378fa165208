//! Which formats are read, and how that of a file is told.
//!
//! Given a path alone, OpenImageIO has its readers try the file one after the other, whatever the suffix says, and some of them write past their
//! memory where a file is damaged (IFF, ICO and Maya's Z among them). So the first bytes decide here, and no reader but one that is listed gets to see the
//! file. To run the others in a process of their own would cost one for each picture, for formats that nobody keeps light in.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::bridge::Result;

/// OpenEXR, by OpenImageIO's name.
pub(super) const OPENEXR: &str = "openexr";
/// Radiance, by OpenImageIO's name.
pub(super) const RADIANCE: &str = "hdr";

/// By OpenImageIO's names, too.
pub(super) const PNG: &str = "png";
pub(super) const JPEG: &str = "jpeg";

/// What a file begins with, after so many other bytes.
type Mark = (usize, &'static [u8]);

/// OpenImageIO's names of the formats that are read, and how their files begin. Those of the formats that are not (BMP, DDS, DPX, GIF, JPEG 2000, SGI, Targa ...)
/// have written or read past their memory in versions that Debian has.
const READ: [(&str, &[Mark]); 7] = [
    (OPENEXR, &[(0, b"\x76\x2f\x31\x01")]),
    (RADIANCE, &[(0, b"#?")]),
    (PNG, &[(0, b"\x89PNG\r\n\x1a\n")]),
    (JPEG, &[(0, b"\xff\xd8")]),
    ("tiff", &[(0, b"II*\0"), (0, b"MM\0*"), (0, b"II+\0"), (0, b"MM\0+")]),
    ("webp", &[(8, b"WEBP")]),
    ("pnm", &[(0, b"P1"), (0, b"P2"), (0, b"P3"), (0, b"P4"), (0, b"P5"), (0, b"P6"), (0, b"Pf"), (0, b"PF")]),
];

/// Suffixes of files in these formats, for messages.
const SUFFIXES: [&str; 20] = [
    "exr", "hdr", "jfi", "jfif", "jif", "jpe", "jpeg", "jpg", "mxr", "pbm", "pfm", "pgm", "png", "pnm", "ppm", "rgbe",
    "sxr", "tif", "tiff", "webp",
];

/// OpenImageIO's name of the format that a file is in.
///
/// # Errors
/// Words and a remedy for a format that is not read.
pub(super) fn of(path: &Path) -> Result<&'static str> {
    let start = start(path).map_err(|error| error.to_string())?;
    told(&start).ok_or_else(|| {
        let suffix = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let what = match suffix.as_str() {
            "" => "no picture of a format that is read".to_owned(),
            _ if SUFFIXES.contains(&suffix.as_str()) => {
                format!("no .{suffix} picture, nor another of a format that is read")
            }
            _ => format!("pictures of the format .{suffix} are not read"),
        };
        format!("{what}; convert it to EXR, HDR, PNG, JPEG or TIFF")
    })
}

fn told(start: &[u8]) -> Option<&'static str> {
    let begins = |&(at, bytes): &Mark| start.get(at..).is_some_and(|rest| rest.starts_with(bytes));
    READ.iter().find(|(_, marks)| marks.iter().any(begins)).map(|&(name, _)| name)
}

fn start(path: &Path) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    File::open(path)?.take(16).read_to_end(&mut start)?;
    Ok(start)
}
