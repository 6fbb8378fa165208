//! Long renders: how often they are kept, and going on from what was kept.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;

use super::engine::BackendArg;
use super::{outputs, say};
use crate::error::{Error, Result};
use crate::output;
use crate::render::{Checkpoint, is_checkpoint};

#[derive(Clone, Debug, Args)]
pub(super) struct CheckpointArgs {
    /// Write what is done so far this often (90s, 5m, 1h), but a fifth of the time at most, and on Ctrl-C and SIGTERM,
    /// beside the output: picture.png has picture.checkpoint.exr, which any viewer of OpenEXR shows; it is removed when
    /// the picture is written
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    checkpoint: Option<Duration>,

    /// Go on from that file, to the same bits; an error where it is missing, or of another scene, settings or program.
    /// With --frames the frames that have none begin anew
    #[arg(long)]
    resume: bool,
}

/// A render that is kept.
pub(super) struct Kept {
    path: PathBuf,
    every: Option<Duration>,
    resume: bool,
}

/// Beside the first picture.
fn place(picture: &Path) -> PathBuf {
    picture.with_extension("checkpoint.exr")
}

impl CheckpointArgs {
    /// Goes on only if these pictures' render was kept: of many frames, one at most was interrupted.
    pub(super) fn resume_if_kept(&mut self, pictures: &[PathBuf]) {
        self.resume &= pictures.first().is_none_or(|first| place(first).exists());
    }

    /// How the render of these pictures is kept; none where it is not. Checked before any work.
    ///
    /// # Errors
    /// [`Error::Usage`] where there is no picture or more than one engine, [`Error::Input`] where there is nothing to
    /// resume, and [`Error::Output`] where the file cannot be written.
    ///
    /// Its file must be none of the run's other ones: of the outputs, of which pictures are the first, nor of what is
    /// read.
    pub(super) fn open(
        &self,
        pictures: &[PathBuf],
        stats: Option<&PathBuf>,
        read: &[PathBuf],
        backend: BackendArg,
    ) -> Result<Option<Kept>> {
        if self.checkpoint.is_none() && !self.resume {
            return Ok(None);
        }
        if backend == BackendArg::Both {
            return Err(Error::Usage(
                "--checkpoint and --resume are for one engine, not for --backend both".to_owned(),
            ));
        }
        let Some(first) = pictures.first() else {
            return Err(Error::Usage(
                "--checkpoint and --resume need a picture: name one with --output FILE".to_owned(),
            ));
        };
        let path = place(first);
        if self.resume && !path.exists() {
            let message = "there is no checkpoint to resume: leave out --resume to begin anew";
            return Err(Error::input(path, "", message));
        }
        outputs::spare([&path], read)?;
        let outputs: Vec<PathBuf> = pictures.iter().chain(stats).cloned().collect();
        if outputs::spare([&path], &outputs).is_err() {
            let message = format!("{}: the render is kept in this file; give the output another name", path.display());
            return Err(Error::Usage(message));
        }
        if path.exists() && !is_checkpoint(&path) {
            if self.resume {
                let message = "is no checkpoint, or a damaged one: leave out --resume to begin anew, and move it away";
                return Err(Error::input(path, "", message));
            }
            let message =
                "is no checkpoint, and would be replaced by one; move it away, or give the picture another name";
            return Err(Error::output(&path, message.to_owned()));
        }
        if self.checkpoint.is_some() {
            output::check_writable(&path)?;
        }
        Ok(Some(Kept { path, every: self.checkpoint, resume: self.resume }))
    }
}

impl Kept {
    /// As the library takes it.
    pub(super) fn by<'a>(&'a self, engine: &'a str) -> Checkpoint<'a> {
        Checkpoint { path: &self.path, every: self.every, resume: self.resume, engine }
    }

    /// Says where an interrupted render is kept.
    pub(super) fn tell(&self) -> Result<()> {
        if !self.path.exists() {
            return Ok(());
        }
        say(format_args!("{:<8}  {}: --resume goes on from there", "kept", self.path.display()))
    }

    /// Removes the file, which is of no more use; none may be there.
    pub(super) fn remove(&self) -> Result<()> {
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(Error::output(&self.path, format!("cannot be removed: {error}")))
            }
            _ => Ok(()),
        }
    }
}

/// A time: `90s`, `1.5m`, `2h`; a bare number is seconds.
fn parse_time(text: &str) -> std::result::Result<Duration, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match &text[digits.len()..] {
        "" | "s" => Some(1.0),
        "m" | "min" => Some(60.0),
        "h" => Some(3600.0),
        _ => None,
    };
    let seconds = digits.parse().ok().zip(factor).map(|(number, factor): (f64, f64)| number * factor);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "expected a time as in 90s, 5m or 1h; a bare number is seconds".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times() {
        for (text, seconds) in [("60s", 60.0), ("1.5m", 90.0), ("2h", 7200.0), ("0", 0.0), ("30", 30.0), ("1min", 60.0)]
        {
            assert_eq!(parse_time(text), Ok(Duration::from_secs_f64(seconds)), "{text}");
        }
        for bad in ["", "s", "-1s", "1d", "nan", "inf", "1e300", "5 m m"] {
            assert!(parse_time(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn the_file_stands_beside_the_first_picture() {
        let args = CheckpointArgs { checkpoint: Some(Duration::ZERO), resume: false };
        let folder = tempfile::tempdir().expect("a folder");
        let pictures = [folder.path().join("a.png"), folder.path().join("b.exr")];
        let kept = args.open(&pictures, None, &[], BackendArg::Native).unwrap().unwrap();
        assert_eq!(kept.path, folder.path().join("a.checkpoint.exr"));
        assert!(kept.remove().is_ok(), "there is none");
        let code = |args: &CheckpointArgs, backend| args.open(&pictures, None, &[], backend).err().unwrap().exit_code();
        assert_eq!(code(&args, BackendArg::Both), 2);
        assert_eq!(code(&CheckpointArgs { checkpoint: None, resume: true }, BackendArg::Native), 3);
        assert!(args.open(&[], None, &[], BackendArg::Native).is_err());
    }
}
