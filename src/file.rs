//! Whole files, read within a limit and written so that a reader never sees half of one.
//!
//! In: a path. Out: its bytes, or the finished file in its place. Cost: one pass; reading holds the whole file.

use crate::error::{Error, Result};
use lzma_rust2::{XzOptions, XzReader, XzWriter};
use serde::Serialize;
use std::fs::{self, File};
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// What [`write_atomically`] hands out: buffered and seekable.
pub(crate) type Output<'a> = BufWriter<&'a mut File>;

/// Reads a regular file of at most `limit` bytes.
///
/// # Errors
/// When the file cannot be read, is a directory, or is larger than `limit` (found out before anything is allocated).
pub(crate) fn read_whole(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let metadata = fs::metadata(path).map_err(Error::io(path, "open the file"))?;
    if metadata.is_dir() {
        return Err(Error::file(path, "kind of file", "a directory", "allowed: a file"));
    }
    let too_large = |size: u64| {
        Error::file(path, "file size", format!("{size} bytes"), format!("allowed: at most {limit}"))
    };
    if metadata.len() > limit {
        return Err(too_large(metadata.len()));
    }
    let file = File::open(path).map_err(Error::io(path, "open the file"))?;
    let mut bytes = Vec::new();
    // A pipe has no length beforehand, hence the second limit.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(Error::io(path, "read the file"))?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Reads a text file of at most `limit` bytes.
///
/// # Errors
/// As [`read_whole`]; when it is not UTF-8.
pub(crate) fn read_text(path: &Path, limit: u64) -> Result<String> {
    String::from_utf8(read_whole(path, limit)?).map_err(|e| Error::file(path, "text", e, "allowed: UTF-8"))
}

/// Writes `bytes` to `path`, all or nothing; see [`write_atomically`].
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |out| out.write_all(bytes).map_err(Error::io(path, "write the file")))
}

/// Writes `path` by filling a temporary file beside it, which takes its place only when `fill` has succeeded.
///
/// On failure the temporary file is removed and an existing `path` is left as it was. A symbolic link is followed; a
/// device or pipe (`/dev/null`) is written directly, as it must not be replaced. The new file has the permissions
/// that any new file would get. Survives a crash of the program; a power cut may still lose the newest bytes.
///
/// # Errors
/// Those of `fill`; when the directory does not exist or cannot be written; when `path` is a directory.
pub(crate) fn write_atomically<F>(path: &Path, fill: F) -> Result<()>
where
    F: FnOnce(&mut Output<'_>) -> Result<()>,
{
    let target: PathBuf = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if let Ok(metadata) = fs::metadata(&target) {
        if metadata.is_dir() {
            return Err(Error::file(path, "kind of file", "a directory", "allowed: a file to write"));
        }
        if !metadata.is_file() {
            let mut device =
                File::options().write(true).open(&target).map_err(Error::io(path, "open for writing"))?;
            return fill_and_flush(path, &mut device, fill);
        }
    }
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".monadnock-");
    #[cfg(unix)]
    let ordinary = {
        use std::os::unix::fs::PermissionsExt;
        fs::Permissions::from_mode(0o666)
    };
    #[cfg(unix)]
    builder.permissions(ordinary);
    let mut temporary =
        builder.tempfile_in(directory).map_err(Error::io(path, "create a file in its directory"))?;
    fill_and_flush(path, temporary.as_file_mut(), fill)?;
    temporary.persist(&target).map_err(|e| Error::io(path, "move the finished file into place")(e.error))?;
    Ok(())
}

/// Makes the folder `path` and all above it, unless they are there.
///
/// # Errors
/// When that is not allowed, or a file is in the way.
pub(crate) fn create_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(Error::io(path, "create the folder"))
}

/// Whether files can be created in the folder `path`, found out by creating one, which goes away at once.
///
/// # Errors
/// When they cannot; the system's reason is in it.
pub(crate) fn check_folder(path: &Path) -> Result<()> {
    let made = tempfile::Builder::new().prefix(".monadnock-").tempfile_in(path);
    made.map(drop).map_err(Error::io(path, "create a file in the folder"))
}

/// Adds `text` at the end of a file, which begins empty, and waits until it is on the disk.
///
/// What was there before stays whatever happens; a crash may leave a part of `text`, which the reader must leave out.
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn append(path: &Path, text: &str) -> Result<()> {
    let failed = |action| Error::io(path, action);
    let mut file =
        File::options().append(true).create(true).open(path).map_err(failed("open for writing"))?;
    file.write_all(text.as_bytes()).map_err(failed("write the file"))?;
    file.sync_data().map_err(failed("write the file"))
}

/// Removes a file, or a folder with all that is in it; nothing when there is neither.
///
/// # Errors
/// When that is not allowed.
pub(crate) fn remove(path: &Path) -> Result<()> {
    let Ok(metadata) = fs::symlink_metadata(path) else { return Ok(()) };
    let removed = if metadata.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    removed.map_err(Error::io(path, "remove"))
}

/// What is in a folder, in the order of the names; nothing when there is no such folder.
///
/// # Errors
/// When the folder cannot be read.
pub(crate) fn list(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let entries = fs::read_dir(path).map_err(Error::io(path, "read the folder"))?;
    let paths = entries.map(|entry| entry.map(|e| e.path())).collect::<std::io::Result<Vec<_>>>();
    let mut paths = paths.map_err(Error::io(path, "read the folder"))?;
    paths.sort();
    Ok(paths)
}

fn fill_and_flush<F>(path: &Path, file: &mut File, fill: F) -> Result<()>
where
    F: FnOnce(&mut Output<'_>) -> Result<()>,
{
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    writer.flush().map_err(Error::io(path, "write the file"))
}

/// Bytes in hexadecimal: how hashes are written.
#[must_use]
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes text as `.xz`, packed as well as it goes.
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn write_packed(path: &Path, text: &[u8]) -> Result<()> {
    write_atomically(path, |out| {
        let packed = XzWriter::new(out, XzOptions::with_preset(9)).and_then(|mut xz| {
            xz.write_all(text)?;
            xz.finish()
        });
        packed.map(|_| ()).map_err(Error::io(path, "compress"))
    })
}

/// Reads the text of an `.xz` file, as far as `limit` bytes packed and unpacked.
///
/// # Errors
/// As [`read_whole`]; when it is not whole, or no text.
pub(crate) fn read_packed(path: &Path, limit: u64) -> Result<String> {
    let bytes = read_whole(path, limit)?;
    let mut text = String::new();
    let mut reader = XzReader::new(bytes.as_slice(), false).take(limit);
    reader.read_to_string(&mut text).map_err(Error::io(path, "decompress"))?;
    Ok(text)
}

/// Lines of CSV without a header.
///
/// # Errors
/// When a line is not plain data.
pub(crate) fn csv_lines<T: Serialize>(lines: impl IntoIterator<Item = T>) -> Result<String> {
    let mut writer = csv::WriterBuilder::new().has_headers(false).flexible(true).from_writer(Vec::new());
    finish_csv(lines.into_iter().try_for_each(|line| writer.serialize(line)), writer)
}

/// A table of CSV whose header names the fields of its rows.
///
/// # Errors
/// As [`csv_lines`].
pub(crate) fn csv_table<T: Serialize>(rows: &[T]) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    finish_csv(rows.iter().try_for_each(|row| writer.serialize(row)), writer)
}

fn finish_csv(written: csv::Result<()>, writer: csv::Writer<Vec<u8>>) -> Result<String> {
    let plain = |e: &dyn std::fmt::Display| Error::value("table", e, "allowed: plain rows");
    written.map_err(|e| plain(&e))?;
    String::from_utf8(writer.into_inner().map_err(|e| plain(&e))?).map_err(|e| plain(&e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_litter() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("terrain.tif");
        write_atomically(&path, |w| w.write_all(b"old").map_err(Error::io(&path, "write"))).unwrap();
        let failed = write_atomically(&path, |w| {
            w.write_all(b"half of the new").map_err(Error::io(&path, "write"))?;
            Err(Error::value("number", 3, "allowed: 4"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_directory_and_a_directory_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let missing = dir.path().join("no/such/a.tif");
        let message = write_atomically(&missing, |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("a.tif"), "{message}");
        let message = write_atomically(dir.path(), |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("directory"), "{message}");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_survive() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        let dir = tempfile::tempdir().unwrap();
        let (real, link) = (dir.path().join("real"), dir.path().join("link"));
        fs::write(&real, "old").unwrap();
        symlink(&real, &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"new").map_err(Error::io(&link, "write"))).unwrap();
        assert_eq!(fs::read(&real).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&real).unwrap().permissions().mode() & 0o400, 0o400);
        let null = Path::new("/dev/null");
        write_atomically(null, |w| w.write_all(b"gone").map_err(Error::io(null, "write"))).unwrap();
        assert!(fs::metadata(null).unwrap().file_type().is_char_device());
    }

    #[test]
    fn appending_adds_lines_and_removing_nothing_is_fine() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b/journal");
        assert!(append(&path, "x").unwrap_err().to_string().contains("journal"));
        create_folder(path.parent().unwrap()).unwrap();
        append(&path, "one\n").unwrap();
        append(&path, "two\n").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "one\ntwo\n");
        fs::write(dir.path().join("a/b/a"), "").unwrap();
        assert_eq!(list(&dir.path().join("a/b")).unwrap(), [dir.path().join("a/b/a"), path.clone()]);
        assert!(list(&dir.path().join("gone")).unwrap().is_empty());
        remove(&path).unwrap();
        remove(&path).unwrap();
        remove(&dir.path().join("a")).unwrap();
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        assert!(create_folder(Path::new("/dev/null/a")).is_err());
    }

    #[test]
    fn files_over_the_limit_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("big");
        fs::write(&path, [0; 100]).unwrap();
        assert_eq!(read_whole(&path, 100).unwrap().len(), 100);
        assert!(read_whole(&path, 99).unwrap_err().to_string().contains("100 bytes"));
        assert!(read_whole(dir.path(), 99).unwrap_err().to_string().contains("directory"));
    }
}
