//! Everything that can go wrong, and the exit code each kind ends the program with.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Result with this library's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong. Its `Display` is one line that names the file, the place, what is wrong and what would be right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A check that was asked for did not hold: the backends differ, or a reference image does.
    #[error("{0}")]
    Check(String),
    /// Arguments that make no sense together.
    #[error("{0}")]
    Usage(String),
    /// A scene or another input file that cannot be used.
    #[error("{}: {place}{}{message}", path.display(), if place.is_empty() { "" } else { ": " })]
    Input {
        /// The file.
        path: PathBuf,
        /// Where in it: `line 12`, `/accessors/3`, `byte 80`; empty for the file as a whole.
        place: String,
        /// What is wrong, and what would be right.
        message: String,
    },
    /// An output file that could not be written.
    #[error("{}: {message}", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what would be right.
        message: String,
    },
    /// A scene that no backend could take, with what is wrong and what would be right: an index past the vertices, a
    /// singular transform.
    #[error("scene: {0}")]
    Scene(String),
    /// A picture that there is not the memory for.
    #[error("{0}")]
    Memory(String),
    /// A scene that one backend refuses, or a backend that failed (out of memory, say).
    #[error("{backend}: {message}")]
    Backend {
        /// Which one: `embree` or `native`, the denoiser's library, or `display server` for a viewer.
        backend: &'static str,
        /// Its own words, with the error code's name.
        message: String,
    },
    /// A backend or a feature that this build or this machine does not have.
    #[error("{0}")]
    Unavailable(String),
    /// Stopped by the user.
    #[error("interrupted; what was not finished is not written")]
    Interrupted,
}

/// What a library says, in one line.
pub fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What the system says of a file that is to be read, in words.
#[doc(hidden)]
pub fn system_message(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "there is no such file; mind its name and its folder".to_owned(),
        // These are our own words.
        ErrorKind::IsADirectory | ErrorKind::InvalidInput => error.to_string(),
        _ => {
            let words = error.to_string();
            // The number says no more.
            format!("cannot be read: {}", words.split(" (os error").next().unwrap_or_default())
        }
    }
}

impl Error {
    /// An [`Error::Input`] about `path`, at `place` (may be empty).
    pub fn input(path: impl Into<PathBuf>, place: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Input { path: path.into(), place: place.into(), message: message.into() }
    }

    /// The same where the file was opened because `path` names it, at `place`: which is where a mended name belongs.
    #[doc(hidden)]
    pub fn named_in(self, path: &Path, place: &str) -> Self {
        match self {
            Self::Input { path: file, place: at, message } => {
                Self::input(file, at, format!("{message} (named in {}, {place})", path.display()))
            }
            other => other,
        }
    }

    /// The same with the file that the scene came from, where it is [about a scene](Self::Scene), and came from a file.
    pub(crate) fn told_of(self, file: Option<&PathBuf>) -> Self {
        match (self, file) {
            (Self::Scene(message), Some(file)) => Self::input(file, "", message),
            (other, _) => other,
        }
    }

    /// An [`Error::Output`] about `path`.
    pub fn output(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self::Output { path: path.into(), message: message.into() }
    }

    /// The program's exit code for it.
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Check(_) => 1,
            Self::Usage(_) => 2,
            Self::Input { .. } | Self::Scene(_) | Self::Memory(_) | Self::Backend { .. } => 3,
            Self::Output { .. } => 4,
            Self::Unavailable(_) => 5,
            Self::Interrupted => 130,
        }
    }
}

/// Something odd in an input that does not stop the work: a missing texture, triangles with NaN corners.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file it is about.
    pub path: PathBuf,
    /// Where in it; empty for the file as a whole.
    pub place: String,
    /// What is odd, and what was done about it.
    pub message: String,
}

impl Warning {
    /// A warning about `path`, at `place` (may be empty).
    pub fn new(path: impl Into<PathBuf>, place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), place: place.into(), message: message.into() }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let colon = if self.place.is_empty() { "" } else { ": " };
        write!(f, "{}: {}{colon}{}", self.path.display(), self.place, self.message)
    }
}
