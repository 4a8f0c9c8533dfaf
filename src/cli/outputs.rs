//! What a verb is going to write, checked as a whole before any work.
//!
//! A verb names its outputs and what it reads, and calls [`Outputs::check`] first of all. A name with the wrong ending, two
//! outputs at one path, an output in the place of an input, and a folder that cannot be written are then told at once
//! rather than after minutes of training.

use crate::dem::io;
use crate::error::{Error, Result};
use crate::file;
use std::path::{Path, PathBuf};

/// What an output is, which decides the endings that its name may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OutputKind {
    /// A terrain file in any format that is written.
    Terrain,
    /// A PNG.
    Picture,
    /// GeoJSON.
    Sketch,
    /// A trained style.
    Style,
    /// A table as comma-separated values.
    Csv,
    /// One JSON value.
    Json,
    /// Arrays or a picture of sources.
    Sources,
    /// TOML.
    Toml,
    /// A folder, made when it is not there.
    Folder,
    /// A document of the user's, in which something is replaced.
    Document,
}

impl OutputKind {
    /// The endings that are allowed, without dots; none where any is.
    fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Picture => &["png"],
            Self::Sketch => &["geojson", "json"],
            Self::Style => &["safetensors"],
            Self::Csv => &["csv"],
            Self::Json => &["json"],
            Self::Sources => &["npz", "png"],
            Self::Toml => &["toml"],
            // Terrain files are told apart by their own reader and writer.
            Self::Terrain | Self::Folder | Self::Document => &[],
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Terrain => "terrain",
            Self::Picture => "a picture",
            Self::Sketch => "a sketch",
            Self::Style => "a style",
            Self::Csv => "a table",
            Self::Json => "JSON",
            Self::Sources => "arrays or a picture",
            Self::Toml => "a manifest",
            Self::Folder => "a folder",
            Self::Document => "a document",
        }
    }
}

struct Output<'a> {
    option: &'static str,
    path: &'a Path,
    kind: OutputKind,
}

/// The outputs of a run, and what it reads.
#[derive(Default)]
pub(super) struct Outputs<'a> {
    outputs: Vec<Output<'a>>,
    inputs: Vec<&'a Path>,
}

impl<'a> Outputs<'a> {
    /// A run that writes nothing yet.
    pub(super) fn new() -> Self {
        Self::default()
    }

    /// With the output that `option` names.
    pub(super) fn writes(
        mut self,
        option: &'static str,
        path: impl Into<Option<&'a PathBuf>>,
        kind: OutputKind,
    ) -> Self {
        self.outputs.extend(path.into().map(|path| Output { option, path, kind }));
        self
    }

    /// With a file that is read, unless it is none (the name of something that comes with the program).
    pub(super) fn reads(mut self, path: impl Into<Option<&'a PathBuf>>) -> Self {
        self.inputs.extend(path.into().map(PathBuf::as_path));
        self
    }

    /// Checks all of it; writes nothing.
    ///
    /// # Errors
    /// What is wrong first, in the order in which the outputs were named.
    pub(super) fn check(&self) -> Result<()> {
        for (i, output) in self.outputs.iter().enumerate() {
            // A document is read and written; a folder may hold what is read.
            if !matches!(output.kind, OutputKind::Document | OutputKind::Folder) {
                keep_inputs(output, &self.inputs)?;
            }
            output.check_name()?;
            for other in &self.outputs[..i] {
                if place(output.path) == place(other.path) {
                    let found = format!("the same as that of {}", other.option);
                    let field = format!("path of {}", output.option);
                    return Err(Error::file(output.path, field, found, "allowed: a path of its own"));
                }
            }
            output.check_folder()?;
        }
        Ok(())
    }
}

impl Output<'_> {
    fn check_name(&self) -> Result<()> {
        let Self { option, path, kind } = *self;
        if kind == OutputKind::Folder {
            return match path.metadata() {
                Ok(found) if !found.is_dir() => {
                    Err(Error::file(path, option, "a file", "allowed: a folder, which may be there already"))
                }
                _ => Ok(()),
            };
        }
        if path.is_dir() {
            return Err(Error::file(path, option, "a folder", "allowed: a file"));
        }
        if kind == OutputKind::Terrain {
            return io::check_name(path).map(|_| ());
        }
        // A device takes whatever is written.
        if kind.endings().is_empty() || (path.exists() && !path.is_file()) {
            return Ok(());
        }
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        if ending.as_deref().is_some_and(|e| kind.endings().contains(&e)) {
            return Ok(());
        }
        let found = ending.map_or_else(|| "absent".to_owned(), |e| format!(".{e}"));
        let allowed: Vec<_> = kind.endings().iter().map(|e| format!(".{e}")).collect();
        let allowed = format!("allowed: {} ({option} writes {})", allowed.join(", "), kind.words());
        Err(Error::file(path, "file extension", found, allowed))
    }

    fn check_folder(&self) -> Result<()> {
        let Self { option, path, kind } = *self;
        let above = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if kind == OutputKind::Folder {
            let standing = path.ancestors().find(|p| p.as_os_str().is_empty() || p.exists());
            let standing = standing.filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            if !standing.is_dir() {
                let found = format!("below {}, which is a file", standing.display());
                return Err(Error::file(path, option, found, "allowed: a folder, or a path below folders"));
            }
            return file::check_folder(standing).map_err(|e| unwritable(path, option, standing, e));
        }
        if !above.is_dir() {
            let found =
                format!("{} ({})", above.display(), if above.exists() { "a file" } else { "not there" });
            return Err(Error::file(path, "folder", found, "allowed: an existing one"));
        }
        if path.exists() && !path.is_file() {
            return Ok(()); // a device, which nothing is created beside
        }
        file::check_folder(above).map_err(|e| unwritable(path, option, above, e))
    }
}

fn unwritable(path: &Path, option: &str, folder: &Path, error: Error) -> Error {
    let reason = match error {
        Error::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    };
    let found = format!("{} (cannot be written: {reason})", folder.display());
    Error::file(path, format!("folder of {option}"), found, "allowed: one in which files can be created")
}

/// Refuses an output that would take the place of a file which is read.
fn keep_inputs(output: &Output<'_>, inputs: &[&Path]) -> Result<()> {
    let Ok(real) = std::fs::canonicalize(output.path) else { return Ok(()) };
    match inputs.iter().find(|input| std::fs::canonicalize(input).is_ok_and(|input| input == real)) {
        Some(input) => {
            let allowed = "allowed: another file than those that are read";
            let found = format!("the same file as {}", input.display());
            Err(Error::file(output.path, "output", found, allowed))
        }
        None => Ok(()),
    }
}

/// A path by which the same file is recognised under other names, whether it is there or not.
fn place(path: &Path) -> PathBuf {
    // As far as it is there, then by its names.
    let mut rest = PathBuf::new();
    for part in path.ancestors() {
        let here = if part.as_os_str().is_empty() { Path::new(".") } else { part };
        if let Ok(real) = std::fs::canonicalize(here) {
            return if rest.as_os_str().is_empty() { real } else { real.join(rest) };
        }
        if let Some(name) = part.file_name() {
            rest = if rest.as_os_str().is_empty() { name.into() } else { Path::new(name).join(&rest) };
        }
    }
    path.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(outputs: Outputs<'_>, words: &[&str]) {
        let message = outputs.check().unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "{word:?} is missing in: {message}");
        }
    }

    #[test]
    fn false_endings_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let kinds = [
            (OutputKind::Terrain, "x.TIF", "x.jpg"),
            (OutputKind::Picture, "x.PNG", "x.jpg"),
            (OutputKind::Sketch, "x.GeoJSON", "x.shp"),
            (OutputKind::Style, "x.safetensors", "x.pt"),
            (OutputKind::Csv, "x.csv", "x.xlsx"),
            (OutputKind::Json, "x.json", "x"),
            (OutputKind::Sources, "x.npz", "x.npy"),
            (OutputKind::Toml, "x.toml", "x.yaml"),
        ];
        for (kind, right, wrong) in kinds {
            let (right, wrong) = (folder.path().join(right), folder.path().join(wrong));
            Outputs::new().writes("--output", &right, kind).check().unwrap();
            let ending = if wrong.extension().is_some() { "." } else { "absent" };
            refusal(
                Outputs::new().writes("--output", &wrong, kind),
                &[&wrong.display().to_string(), "file extension", ending, "allowed: ."],
            );
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a check leaves nothing behind");
    }

    #[test]
    fn two_outputs_at_one_path_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::create_dir(at.join("a")).unwrap();
        for (one, two) in [("x.json", "x.json"), ("x.json", "a/../x.json"), ("a/./x.json", "a/x.json")] {
            let (one, two) = (at.join(one), at.join(two));
            let outputs = Outputs::new().writes("--csv", &one, OutputKind::Json).writes(
                "--json",
                &two,
                OutputKind::Json,
            );
            refusal(outputs, &["--json", "--csv", "x.json"]);
        }
        let (file, folder_too) = (at.join("new/x.csv"), at.join("new"));
        let apart = at.join("y.csv");
        Outputs::new()
            .writes("--csv", &apart, OutputKind::Csv)
            .writes("--save", &folder_too, OutputKind::Folder)
            .check()
            .unwrap();
        refusal(
            Outputs::new().writes("--csv", &file, OutputKind::Csv),
            &["new/x.csv", "folder", "not there"],
        );
    }

    #[test]
    fn folders_that_cannot_be_written_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let file = at.join("file");
        std::fs::write(&file, "x").unwrap();
        let below = file.join("x.png");
        refusal(Outputs::new().writes("-o", &below, OutputKind::Picture), &["x.png", "a file"]);
        refusal(Outputs::new().writes("--save", &below, OutputKind::Folder), &["x.png", "below", "a file"]);
        refusal(Outputs::new().writes("--save", &file, OutputKind::Folder), &["file", "--save", "a folder"]);
        let as_file = at.to_owned();
        refusal(
            Outputs::new().writes("-o", &as_file, OutputKind::Document),
            &["a folder", "allowed: a file"],
        );
        if cfg!(target_os = "linux") {
            // Not even the superuser creates files there.
            let (file, folder) = (PathBuf::from("/proc/x.png"), PathBuf::from("/proc/x/y"));
            refusal(
                Outputs::new().writes("-o", &file, OutputKind::Picture),
                &["/proc/x.png", "cannot be written"],
            );
            refusal(
                Outputs::new().writes("--save", &folder, OutputKind::Folder),
                &["/proc/x/y", "cannot be written"],
            );
        }
    }

    #[test]
    fn what_is_read_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (dem, other) = (folder.path().join("dem.tif"), folder.path().join("other.tif"));
        std::fs::write(&dem, b"heights").unwrap();
        Outputs::new().writes("-o", &other, OutputKind::Terrain).reads(&dem).check().unwrap();
        let by_another_name = folder.path().join(".").join("dem.tif");
        refusal(
            Outputs::new().writes("-o", &by_another_name, OutputKind::Terrain).reads(&other).reads(&dem),
            &["the same file as", "dem.tif"],
        );
    }
}
