//! Output files: all or nothing.
//!
//! A file is written beside its place under another name and renamed when it is whole, so that whoever reads it sees
//! the old file or the new one, never half of one. The other name keeps the suffix, because image writers choose the
//! format by it, and holds the process's number, so that two programs that write the same file do not write into each
//! other's. Writing in place and restoring a backup on failure was rejected: it leaves half a file where the program is
//! killed.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::{Error, Result};

/// Has `write` make a file, and puts it at `path` if that succeeds.
///
/// `write` gets the name to write to: in the same folder as `path`, with the same suffix, not yet there. What stands at
/// `path` keeps its permissions; a symbolic link stays one and its target is replaced. A device or a pipe
/// (`/dev/stdout`) cannot be replaced and is written to directly.
///
/// # Errors
/// What `write` returns, and [`Error::Output`] where the file cannot be put in place. The old file is then whole, and
/// nothing is left beside it.
pub fn write_atomically(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let mut files = AtomicWrites::default();
    files.write(path, write);
    files.commit().into_result()
}

/// The same for what can be made again: a loss of power may leave an empty file.
///
/// # Errors
/// As of [`write_atomically`].
pub fn write_passing(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let mut files = AtomicWrites { is_passing: true, ..AtomicWrites::default() };
    files.write(path, write);
    files.commit().into_result()
}

/// Files that are put in place together, once the work is done. One that cannot be written does not cost the others.
/// Devices and pipes are written to at once.
#[derive(Default)]
pub struct AtomicWrites {
    parts: Vec<Part>,
    faults: Vec<Error>,
    is_passing: bool,
}

/// What became of them.
#[derive(Debug, Default)]
pub struct WriteOutcome {
    /// Those that are in place.
    pub paths: Vec<PathBuf>,
    /// Why others are not: what was there before is still there.
    pub faults: Vec<Error>,
}

impl WriteOutcome {
    /// # Errors
    /// The first of those that there were.
    pub fn into_result(self) -> Result<()> {
        self.faults.into_iter().next().map_or(Ok(()), Err)
    }
}

impl AtomicWrites {
    /// Has `write` make a file, as for [`write_atomically`], which is put in place with the others.
    pub fn write(&mut self, path: &Path, write: impl FnOnce(&Path) -> Result<()>) {
        let written = Part::beside(path).and_then(|target| match target {
            Target::Special => write(path).map(|()| None),
            Target::File(part) => write(&part.name).map(|()| Some(part)),
        });
        match written {
            Ok(part) => self.parts.extend(part),
            Err(fault) => self.fail(fault),
        }
    }

    /// Keeps that there is a file which cannot be written.
    pub fn fail(&mut self, fault: Error) {
        self.faults.push(fault);
    }

    /// Puts those in place that are whole, each of them that can be.
    pub fn commit(self) -> WriteOutcome {
        let mut written = WriteOutcome { paths: Vec::new(), faults: self.faults };
        for part in &self.parts {
            match part.commit(self.is_passing) {
                Ok(()) => written.paths.push(part.path.clone()),
                Err(error) => {
                    let message = reason("cannot put the finished file in place", &error);
                    written.faults.push(Error::output(&part.path, message));
                }
            }
        }
        written
    }
}

/// Checks, before long work whose result goes to `path`, that a file can be created there.
///
/// It creates one beside it, and removes it again: only that is proof on every file system and for every user.
///
/// # Errors
/// [`Error::Output`] where the folder does not exist or takes no new file, or where `path` is a folder.
pub fn check_writable(path: &Path) -> Result<()> {
    probe(path, |part| fs::write(part, b"").map_err(|e| cannot_create(path, &e)))
}

/// As [`check_writable`], but with a file that `write` makes.
#[doc(hidden)]
pub fn probe(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    match Part::beside(path)? {
        Target::Special => Ok(()),
        // Dropping the part removes it.
        Target::File(part) => write(&part.name),
    }
}

/// The message for a file that could not be created.
fn cannot_create(path: &Path, error: &io::Error) -> Error {
    Error::output(path, reason("cannot create the file", error))
}

fn reason(what: &str, error: &io::Error) -> String {
    format!("{what}: {error}")
}

enum Target {
    /// A device, a pipe or a socket, of which none can be replaced, or [synced](fs::File::sync_all).
    Special,
    /// A file, or nothing yet.
    File(Part),
}

/// A file that is not yet whole. It is removed when dropped.
struct Part {
    name: PathBuf,
    /// As it was called.
    path: PathBuf,
    /// Where it belongs, links resolved.
    place: PathBuf,
    /// Those of the file that it replaces.
    permissions: Option<fs::Permissions>,
}

impl Part {
    fn beside(path: &Path) -> Result<Target> {
        let Some(file_name) = path.file_name() else {
            return Err(Error::output(path, "not the name of a file"));
        };
        let (place, permissions) = match fs::metadata(path) {
            Ok(old) if old.is_dir() => return Err(Error::output(path, "is a folder; give the name of a file in it")),
            Ok(old) if !old.is_file() => return Ok(Target::Special),
            Ok(old) => match fs::canonicalize(path) {
                Ok(place) => (place, Some(old.permissions())),
                // Removed meanwhile by someone else.
                Err(e) if e.kind() == io::ErrorKind::NotFound => (path.to_owned(), None),
                Err(e) => return Err(cannot_create(path, &e)),
            },
            Err(e) if e.kind() == io::ErrorKind::NotFound => (through_links(path), None),
            Err(e) => return Err(cannot_create(path, &e)),
        };
        let folder = match place.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        if !folder.is_dir() {
            return Err(Error::output(path, format!("the folder {} does not exist", folder.display())));
        }
        let name = folder.join(part_name(Path::new(file_name)));
        Ok(Target::File(Self { name, path: path.to_owned(), place, permissions }))
    }

    fn commit(&self, is_passing: bool) -> io::Result<()> {
        if !is_passing {
            self.sync()?;
        }
        if let Some(permissions) = &self.permissions {
            fs::set_permissions(&self.name, permissions.clone())?;
        }
        fs::rename(&self.name, &self.place)
    }

    /// Waits until the disk has it: what follows a loss of power would be an empty file otherwise.
    fn sync(&self) -> io::Result<()> {
        match fs::OpenOptions::new().write(true).open(&self.name)?.sync_all() {
            // Not every file system can tell.
            Err(error) if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
            synced => synced,
        }
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // Gone after a successful rename, and never there if `write` failed early: neither is an error.
        let _ = fs::remove_file(&self.name);
    }
}

/// Where a link leads at whose end there is nothing yet.
#[doc(hidden)]
pub fn through_links(path: &Path) -> PathBuf {
    // As many as Linux follows.
    const MAX: usize = 40;
    let mut place = path.to_owned();
    for _ in 0..MAX {
        let Ok(target) = fs::read_link(&place) else { break };
        place = place.parent().map_or(target.clone(), |folder| folder.join(&target));
    }
    place
}

/// What decides a file's format: what stands behind the last dot of its name, in lower case; empty where there is none.
pub fn suffix(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// `.STEM.PROCESS-NUMBER.part.SUFFIX`.
fn part_name(file_name: &Path) -> String {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    // At most 60 bytes of the stem: with all of it the name could be longer than a file system takes.
    let stem = file_name.file_stem().unwrap_or_default().to_string_lossy();
    let stem = &stem[..(0..=60.min(stem.len())).rfind(|&end| stem.is_char_boundary(end)).unwrap_or(0)];
    let suffix = file_name.extension().map(|s| format!(".{}", s.to_string_lossy())).unwrap_or_default();
    format!(".{stem}.{}-{}.part{suffix}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn success_replaces_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "old").unwrap();
        write_atomically(&path, |part| {
            assert_eq!(part.extension().unwrap(), "json");
            assert_eq!(part.parent(), path.canonicalize().unwrap().parent());
            fs::write(part, "new").unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), "old");
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn failure_and_panic_leave_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "old").unwrap();
        let failing = |part: &Path| {
            fs::write(part, "half").unwrap();
            Err(Error::output(&path, "disk full"))
        };
        assert!(write_atomically(&path, failing).is_err());
        let panicking = std::panic::catch_unwind(|| {
            write_atomically(&path, |part| {
                fs::write(part, "half").unwrap();
                panic!("on purpose")
            })
        });
        assert!(panicking.is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn a_writer_that_writes_nothing_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        assert_eq!(write_atomically(&path, |_| Ok(())).unwrap_err().exit_code(), 4);
    }

    #[test]
    fn impossible_places() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        for (path, words) in [
            (folder.path().to_owned(), "is a folder"),
            (folder.path().join("missing/a.json"), "does not exist"),
            (file.join("a.json"), "Not a directory"),
            (folder.path().join(".."), "not the name of a file"),
        ] {
            let error = check_writable(&path).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
            assert_eq!(error.exit_code(), 4);
        }
        check_writable(&folder.path().join("a.json")).unwrap();
        assert_eq!(names(folder.path()), ["file"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_devices_stay_devices() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("there")).unwrap();
        let (target, link) = (folder.path().join("there/a.txt"), folder.path().join("a.txt"));
        fs::write(&target, "old").unwrap();
        fs::set_permissions(&target, fs::Permissions::from_mode(0o640)).unwrap();
        symlink(&target, &link).unwrap();
        write_atomically(&link, |part| fs::write(part, "new").map_err(|e| cannot_create(part, &e))).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(fs::metadata(&target).unwrap().permissions().mode() & 0o777, 0o640);

        // A link to what is not there yet makes that; one into a folder that is not there says so.
        symlink("there/b.txt", folder.path().join("b.txt")).unwrap();
        symlink("nowhere/c.txt", folder.path().join("c.txt")).unwrap();
        let write = |name: &str| {
            let link = folder.path().join(name);
            let written = write_atomically(&link, |part| fs::write(part, "new").map_err(|e| cannot_create(part, &e)));
            assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
            written
        };
        write("b.txt").unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("there/b.txt")).unwrap(), "new");
        assert!(write("c.txt").unwrap_err().to_string().contains("nowhere does not exist"));

        let null = Path::new("/dev/null");
        check_writable(null).unwrap();
        write_atomically(null, |name| {
            assert_eq!(name, null);
            Ok(())
        })
        .unwrap();
        assert!(!fs::metadata(null).unwrap().is_file());
    }

    #[test]
    fn of_several_those_are_put_in_place_that_can_be() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b, c] = ["a.txt", "b.txt", "c.txt"].map(|name| folder.path().join(name));
        fs::write(&b, "old").unwrap();
        let mut files = AtomicWrites::default();
        let new = |part: &Path| fs::write(part, "new").map_err(|e| cannot_create(part, &e));
        files.write(&a, new);
        files.write(&b, |part| new(part).and(Err(Error::output(part, "full"))));
        files.write(&c, new);
        // Something that cannot be replaced has come to the first one's place meanwhile.
        fs::create_dir_all(a.join("in")).unwrap();
        let written = files.commit();
        assert_eq!(written.paths, std::slice::from_ref(&c));
        assert!(written.faults[0].to_string().contains("full"), "{:?}", written.faults);
        assert!(written.faults[1].to_string().contains("a.txt: cannot put"), "{:?}", written.faults);
        assert_eq!([&b, &c].map(|path| fs::read_to_string(path).unwrap()), ["old", "new"]);
        assert_eq!(names(folder.path()), ["a.txt", "b.txt", "c.txt"]);
    }

    /// Whoever may not read a file may replace it.
    #[cfg(unix)]
    #[test]
    fn what_cannot_be_read_is_replaced_all_the_same() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o200)).unwrap();
        write_atomically(&path, |part| fs::write(part, "new").map_err(|e| cannot_create(part, &e))).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o200);
        assert_eq!(fs::metadata(&path).unwrap().len(), 3);
    }

    #[test]
    fn long_names_fit() {
        let folder = tempfile::tempdir().unwrap();
        check_writable(&folder.path().join(format!("{}.json", "é".repeat(120)))).unwrap();
        check_writable(&folder.path().join(format!("{}.json", "😀".repeat(62)))).unwrap();
    }
}
