//! The files a command writes: checked before the work, written whole after it.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::{Error, Result, Warning};
use crate::image::{self, Channel, Image, Metadata, WriteOptions};
use crate::output::{self, AtomicWrites, WriteOutcome};

/// Whether every picture and the other files can be written, before anything is done for them; and whether none of them
/// would replace another, nor one of the `inputs`.
pub(super) fn check<'a>(
    pictures: &'a [PathBuf],
    others: impl IntoIterator<Item = &'a PathBuf>,
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<()> {
    check_places(pictures, others, inputs)?;
    try_out(pictures)
}

/// As far as [`check`] can say without OpenImageIO, which takes time to load. [`try_out`] says the rest.
pub(super) fn check_places<'a>(
    pictures: &'a [PathBuf],
    others: impl IntoIterator<Item = &'a PathBuf>,
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<()> {
    let others: Vec<&PathBuf> = others.into_iter().collect();
    let inputs: Vec<PathBuf> = inputs.into_iter().map(|path| place(path)).collect();
    let mut taken: Vec<PathBuf> = Vec::new();
    for path in pictures.iter().chain(others.iter().copied()) {
        let place = place(path);
        // What is no file, as /dev/null, holds nothing that could be lost.
        let is_file = || path.metadata().map_or(true, |found| found.is_file());
        let [is_read, is_written] = [&inputs, &taken].map(|places| places.contains(&place));
        if (is_read || is_written) && is_file() {
            let why = if is_read { "this file is read" } else { "this file is named twice" };
            let path = path.display();
            return Err(Error::Usage(format!(
                "{path}: {why}; an output must not replace another file of the run, choose another name"
            )));
        }
        taken.push(place);
    }
    // Of an uncommon suffix it has to be known at once whether it is one.
    let check = |path: &PathBuf| {
        if image::has_common_suffix(path) { output::check_writable(path) } else { image::check_writable(path) }
    };
    pictures.iter().try_for_each(check)?;
    others.into_iter().try_for_each(|path| output::check_writable(path))
}

/// Whether the outputs leave alone the files that a scene was read from, textures and all, which are known once it is
/// there.
pub(super) fn spare<'a>(outputs: impl IntoIterator<Item = &'a PathBuf>, files: &[PathBuf]) -> Result<()> {
    let files: HashSet<PathBuf> = files.iter().map(|file| place(file)).collect();
    match outputs.into_iter().find(|path| files.contains(&place(path))) {
        None => Ok(()),
        Some(path) => Err(Error::Usage(format!(
            "{}: the scene is read from this file, which an output must not replace; choose another name",
            path.display()
        ))),
    }
}

/// Where a file really is; one that does not exist yet has the place of its folder.
fn place(path: &Path) -> PathBuf {
    let path = &output::through_links(path);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let in_folder = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

/// Whether pictures of these names can be made: that OpenImageIO is there, and a small picture finds room.
pub(super) fn try_out(pictures: &[PathBuf]) -> Result<()> {
    let mut common = pictures.iter().filter(|path| image::has_common_suffix(path));
    common.try_for_each(|path| image::check_writable(path))
}

/// Puts files in place. Where there are some that cannot be written, the others are told.
pub(super) fn commit(files: AtomicWrites) -> Result<()> {
    let WriteOutcome { paths, faults } = files.commit();
    let mut faults = faults.into_iter();
    let Some(first) = faults.next() else { return Ok(()) };
    let whole = paths.iter().map(|path| Warning::new(path, "", "is written, unlike another output"));
    super::warn(&whole.collect::<Vec<_>>());
    faults.for_each(|fault| super::complain("error", &fault));
    Err(first)
}

/// Writes one picture to each path, in the format its suffix says, with the channels where that holds any; to be put in
/// place with `files`.
pub(super) fn write_pictures(
    files: &mut AtomicWrites,
    paths: &[PathBuf],
    picture: &Image,
    channels: &[Channel],
    metadata: &Metadata,
    options: &WriteOptions,
) {
    for path in paths {
        let channels = if image::holds_channels(path) { channels } else { &[] };
        if let Err(fault) = image::write_beside(files, path, picture, channels, metadata, options) {
            files.fail(fault);
        }
    }
}

/// Writes a JSON document, to be put in place with `files`.
pub(super) fn write_json(files: &mut AtomicWrites, path: &Path, document: &impl Serialize) {
    match serde_json::to_string_pretty(document) {
        Ok(text) => write_beside(files, path, &(text + "\n")),
        Err(error) => files.fail(Error::output(path, error.to_string())),
    }
}

/// Writes a text, likewise.
pub(super) fn write_beside(files: &mut AtomicWrites, path: &Path, text: &str) {
    files.write(path, |part| fill(path, part, text));
}

/// Writes a text.
pub(super) fn write_text(path: &Path, text: &str) -> Result<()> {
    output::write_atomically(path, |part| fill(path, part, text))
}

fn fill(path: &Path, part: &Path, text: &str) -> Result<()> {
    std::fs::write(part, text).map_err(|error| Error::output(path, error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_replaces_neither_an_input_nor_another_output() {
        let folder = tempfile::tempdir().expect("a folder");
        let [scene, picture, stats] = ["scene.obj", "picture.png", "stats.json"].map(|name| folder.path().join(name));
        std::fs::write(&scene, "v 0 0 0").expect("written");
        let pictures = std::slice::from_ref(&picture);
        assert!(check(pictures, [&stats], [&scene]).is_ok());
        #[cfg(unix)]
        {
            let link = folder.path().join("link.json");
            std::os::unix::fs::symlink("picture.png", &link).expect("a link");
            assert!(check(pictures, [&link], [&scene]).is_err(), "to what is not there yet");
        }
        // Of what is below /dev, files are files.
        if let Ok(shared) = tempfile::NamedTempFile::new_in("/dev/shm") {
            let shared = shared.path().to_owned();
            assert!(check(std::slice::from_ref(&shared), [], [&shared]).is_err());
        }
        let nowhere = PathBuf::from("/dev/null");
        assert!(check(&[], [&nowhere, &nowhere], [&scene]).is_ok());
        let same = folder.path().join(".").join("scene.obj");
        for (others, inputs) in [([&same], [&scene]), ([&picture], [&scene]), ([&stats], [&picture])] {
            let refused = check(pictures, others, inputs).expect_err("one file has two parts");
            assert!(matches!(refused, Error::Usage(_)), "{refused}");
        }
        assert_eq!(std::fs::read_to_string(&scene).expect("still there"), "v 0 0 0");
    }
}
