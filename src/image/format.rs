//! Formats of pictures, which the suffixes of files tell apart.
//!
//! What is to be known of a format stands where it is needed: what a file of it holds in `file.rs`, how it is told by
//! its first bytes in `oiio/formats.rs`.

use std::path::Path;

use crate::output::suffix;

/// A format of which something is to be known. OpenImageIO writes others as well, by their suffixes alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Bmp,
    Fits,
    Gif,
    Heif,
    Ico,
    Iff,
    Jpeg,
    Jpeg2000,
    Netpbm,
    OpenExr,
    Png,
    Radiance,
    Rla,
    Sgi,
    Targa,
    Tiff,
    WebP,
}

/// In lower case, as OpenImageIO has them.
const SUFFIXES: [(Format, &[&str]); 17] = [
    (Format::Bmp, &["bmp"]),
    (Format::Fits, &["fits"]),
    (Format::Gif, &["gif"]),
    (Format::Heif, &["avif", "heic", "heics", "heif", "heifs", "hif"]),
    (Format::Ico, &["ico"]),
    (Format::Iff, &["iff", "z"]),
    (Format::Jpeg, &["jfi", "jfif", "jif", "jpe", "jpeg", "jpg"]),
    (Format::Jpeg2000, &["j2c", "j2k", "jp2", "jpc"]),
    (Format::Netpbm, &["pbm", "pfm", "pgm", "pnm", "ppm"]),
    (Format::OpenExr, &["exr", "mxr", "sxr"]),
    (Format::Png, &["png"]),
    (Format::Radiance, &["hdr", "rgbe"]),
    (Format::Rla, &["rla"]),
    (Format::Sgi, &["bw", "int", "inta", "rgb", "rgba", "sgi"]),
    (Format::Targa, &["tga", "tpic"]),
    // The last four are what OpenImageIO's texture tools name theirs.
    (Format::Tiff, &["tif", "tiff", "env", "sm", "tx", "vsm"]),
    (Format::WebP, &["webp"]),
];

impl Format {
    /// By the suffix of a file's name; none for one of which nothing is known.
    pub(super) fn of(path: &Path) -> Option<Self> {
        Self::of_suffix(&suffix(path))
    }

    /// As [`Format::of`]; the suffix is in lower case.
    pub(super) fn of_suffix(suffix: &str) -> Option<Self> {
        SUFFIXES.iter().find(|(_, suffixes)| suffixes.contains(&suffix)).map(|&(format, _)| format)
    }

    /// Of files in this format, in lower case.
    #[cfg(any(test, not(feature = "oiio")))]
    pub(super) fn suffixes(self) -> &'static [&'static str] {
        SUFFIXES.iter().find(|&&(format, _)| format == self).map_or(&[], |&(_, suffixes)| suffixes)
    }
}
