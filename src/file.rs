//! Whole files, read within a limit and written so that a reader never sees half of one.
//!
//! In: a path. Out: its bytes, or the finished file in its place. Cost: one pass; reading holds the whole file.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// What [`write_atomically`] hands out: buffered and seekable.
pub type Output<'a> = BufWriter<&'a mut File>;

/// Reads a regular file of at most `limit` bytes.
///
/// # Errors
/// When the file cannot be read, is a directory, or is larger than `limit` (found out before anything is allocated).
pub fn read_whole(path: &Path, limit: u64) -> Result<Vec<u8>> {
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

/// Writes `path` by filling a temporary file beside it, which takes its place only when `fill` has succeeded.
///
/// On failure the temporary file is removed and an existing `path` is left as it was. A symbolic link is followed; a
/// device or pipe (`/dev/null`) is written directly, as it must not be replaced. The new file has the permissions
/// that any new file would get. Survives a crash of the program; a power cut may still lose the newest bytes.
///
/// # Errors
/// Those of `fill`; when the directory does not exist or cannot be written; when `path` is a directory.
pub fn write_atomically<F>(path: &Path, fill: F) -> Result<()>
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

fn fill_and_flush<F>(path: &Path, file: &mut File, fill: F) -> Result<()>
where
    F: FnOnce(&mut Output<'_>) -> Result<()>,
{
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    writer.flush().map_err(Error::io(path, "write the file"))
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
    fn files_over_the_limit_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("big");
        fs::write(&path, [0; 100]).unwrap();
        assert_eq!(read_whole(&path, 100).unwrap().len(), 100);
        assert!(read_whole(&path, 99).unwrap_err().to_string().contains("100 bytes"));
        assert!(read_whole(dir.path(), 99).unwrap_err().to_string().contains("directory"));
    }
}
