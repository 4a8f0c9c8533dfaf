//! Whole files in and out; a reader never sees half a file.

use crate::error::{Error, Result};
use std::io::{Read, Write};
use std::path::Path;

/// Reads a file of at most `limit` bytes.
pub(super) fn read_whole(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let file = std::fs::File::open(path).map_err(Error::io(path, "open the file"))?;
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(Error::io(path, "read the file"))?;
    if bytes.len() as u64 > limit {
        return Err(Error::file(path, "file size", "too large", format!("allowed: at most {limit} bytes")));
    }
    Ok(bytes)
}

/// Writes beside `path` and renames when everything is on the disk.
pub(super) fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut std::io::BufWriter<&mut std::fs::File>) -> Result<()>,
) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The permissions of any new file; the system takes the umask away from them.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut temporary = builder.tempfile_in(folder).map_err(Error::io(path, "create a file beside it"))?;
    let mut out = std::io::BufWriter::new(temporary.as_file_mut());
    fill(&mut out)?;
    out.flush().map_err(Error::io(path, "write the file"))?;
    drop(out);
    temporary.persist(path).map_err(|e| Error::io(path, "replace the file")(e.error))?;
    Ok(())
}
