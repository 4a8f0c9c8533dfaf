//! A folder of terrain with a manifest: what each raster is, where it is from, and the hash that tells whether it is still it.
//!
//! `manifest.toml` holds an `[[area]]` for each raster (`data/manifest.toml`, whose entries are called `[[tile]]`, is read
//! too). Only `name` and `file` are needed; what else is stated is compared with the raster when it is read, so that a
//! swapped or spoiled file is found out before anything is computed from it.

use super::Dem;
use super::io::{self, Description, ReadOptions};
use crate::error::{Error, Result};
use crate::file;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Name of the manifest in its folder.
pub(crate) const FILE_NAME: &str = "manifest.toml";
/// A manifest is a short text.
const LARGEST: u64 = 1 << 22;

/// What a manifest says about one raster.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Area {
    /// Name to ask for it by: letters, digits, `-` and `_`.
    pub(crate) name: String,
    /// Its file, relative to the manifest's folder.
    pub(crate) file: PathBuf,
    /// The place, for people.
    #[serde(default, alias = "title", skip_serializing_if = "String::is_empty")]
    pub(crate) what: String,
    /// Rows and columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shape: Option<[usize; 2]>,
    /// Side of a cell on the ground, metres.
    #[serde(default, alias = "cell_size", skip_serializing_if = "Option::is_none")]
    pub(crate) metres_per_pixel: Option<f64>,
    /// Lowest and highest height, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) elevation: Option<[f64; 2]>,
    /// Whole 128x128 patches, down and across.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) patches: Option<[usize; 2]>,
    /// Where the heights come from.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) source: String,
    /// Terms of use.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) licence: String,
    /// Whom to credit, in the words to use.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) credit: String,
    /// What was done to the source.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) note: String,
    /// SHA-256 of the file, hexadecimal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) sha256: Option<String>,
    /// Whether the terms allow to ship it with the program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) embed: Option<bool>,
}

/// The rasters of a folder.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Manifest {
    /// The folder.
    pub(crate) folder: PathBuf,
    /// Its rasters, in the order of the file.
    pub(crate) areas: Vec<Area>,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default, alias = "tile")]
    area: Vec<Area>,
}

impl Manifest {
    /// Reads `manifest.toml` of a folder.
    ///
    /// # Errors
    /// When the file cannot be read or understood, a name is empty, has other signs or stands twice.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        Self::read_file(&folder.join(FILE_NAME))
    }

    /// Reads a manifest file; the rasters are beside it.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub(crate) fn read_file(path: &Path) -> Result<Self> {
        let text = String::from_utf8(file::read_whole(path, LARGEST)?)
            .map_err(|e| Error::file(path, "text", e, "allowed: TOML in UTF-8"))?;
        let document: Document = toml::from_str(&text).map_err(|e| {
            Error::file(
                path,
                "manifest",
                "not understood",
                format!("the reader says: {}", e.to_string().trim_end()),
            )
        })?;
        let mut known: Vec<&str> = Vec::new();
        for area in &document.area {
            check_name(&area.name).map_err(|e| e.in_file(path))?;
            if known.contains(&area.name.as_str()) {
                return Err(Error::file(path, "name of an area", &area.name, "allowed: each name once"));
            }
            known.push(&area.name);
        }
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        Ok(Self { folder, areas: document.area })
    }

    /// The raster called `name`, checked against everything that the manifest says about it, with what its file said about itself.
    ///
    /// # Errors
    /// When there is no such name, its file cannot be read, or the file is not what the manifest says.
    pub(crate) fn load_described(&self, name: &str) -> Result<(Dem, Description)> {
        let manifest = self.folder.join(FILE_NAME);
        let Some(area) = self.areas.iter().find(|area| area.name == name) else {
            let names: Vec<&str> = self.areas.iter().map(|area| area.name.as_str()).collect();
            return Err(Error::file(&manifest, "area", name, format!("allowed: {}", names.join(", "))));
        };
        let path = self.folder.join(&area.file);
        let bytes = file::read_whole(&path, io::MAX_FILE_BYTES)?;
        let differs = |field: &str, found: String, stated: String| {
            Error::file(&path, field, found, format!("{} says {stated}", manifest.display()))
        };
        let hash = sha256(&bytes);
        if let Some(stated) = area.sha256.as_ref().filter(|stated| !stated.eq_ignore_ascii_case(&hash)) {
            return Err(differs("sha256", hash, stated.clone()));
        }
        let read =
            io::read_with_sidecars(&path, &bytes, &io::sidecars_beside(&path)?, &ReadOptions::default())?;
        let (dem, description) = read;
        let shape: [usize; 2] = dem.shape().into();
        if let Some(stated) = area.shape.filter(|stated| *stated != shape) {
            return Err(differs("shape", format!("{shape:?}"), format!("{stated:?}")));
        }
        let (low, high) = dem.range();
        let range = [f64::from(low), f64::from(high)];
        // Manifests round to a tenth.
        let near = |a: f64, b: f64| (a - b).abs() <= 0.051;
        if let Some(stated) = area.elevation.filter(|s| !near(s[0], range[0]) || !near(s[1], range[1])) {
            return Err(differs("elevation", format!("{range:?}"), format!("{stated:?}")));
        }
        let side = dem.cell_size().mean();
        if let Some(stated) = area.metres_per_pixel.filter(|m| (m - side).abs() > 1e-3 * side) {
            return Err(differs("cell size", side.to_string(), stated.to_string()));
        }
        Ok((dem, description))
    }
}

impl Area {
    /// The entry of the raster in `path`, which lies in `folder` or below it and says of itself all that is needed to read it.
    ///
    /// # Errors
    /// When the name has other signs than letters, digits, `-` and `_`, the raster cannot be read or lies elsewhere.
    pub(crate) fn of_file(name: &str, path: &Path, folder: &Path) -> Result<(Self, Description)> {
        check_name(name)?;
        let resolved = |path: &Path| path.canonicalize().map_err(Error::io(path, "find the file"));
        let here = resolved(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })?;
        let whole = resolved(path)?;
        let Ok(inside) = whole.strip_prefix(&here) else {
            let allowed = format!("allowed: a file in the manifest's folder, {}", folder.display());
            return Err(Error::file(path, "place", "outside", allowed));
        };
        let bytes = file::read_whole(path, io::MAX_FILE_BYTES)?;
        let read =
            io::read_with_sidecars(path, &bytes, &io::sidecars_beside(path)?, &ReadOptions::default())?;
        let (dem, description) = read;
        let (low, high) = dem.range();
        let rounded = |z: f32| (f64::from(z) * 10.0).round() / 10.0;
        let area = Self {
            name: name.to_owned(),
            file: inside.to_owned(),
            shape: Some(dem.shape().into()),
            metres_per_pixel: Some(dem.cell_size().mean()),
            elevation: Some([rounded(low), rounded(high)]),
            sha256: Some(sha256(&bytes)),
            ..Self::default()
        };
        Ok((area, description))
    }

    /// The entry as it stands in a manifest.
    ///
    /// # Panics
    /// Never: an entry is plain data.
    #[must_use]
    pub(crate) fn to_toml(&self) -> String {
        toml::to_string(&Document { area: vec![self.clone()] }).expect("an entry is plain data")
    }

    /// Adds the entry to a manifest file, which begins with it when there is none; what stands there stays as it is.
    ///
    /// # Errors
    /// When the file is not a manifest, has the name already, or cannot be written.
    pub(crate) fn add_to(&self, path: &Path) -> Result<()> {
        let mut text = String::new();
        if path.exists() {
            let manifest = Manifest::read_file(path)?;
            if manifest.areas.iter().any(|area| area.name == self.name) {
                let allowed = "allowed: a name that is not there yet";
                return Err(Error::file(path, "name of an area", &self.name, allowed));
            }
            text = String::from_utf8_lossy(&file::read_whole(path, LARGEST)?).trim_end().to_owned();
            text += "\n\n";
        }
        file::write_bytes(path, (text + &self.to_toml()).as_bytes())
    }
}

/// Names go into tables and file names.
fn check_name(name: &str) -> Result<()> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || !name.chars().all(allowed) {
        return Err(Error::value(
            "name of an area",
            format!("{name:?}"),
            "allowed: letters, digits, - and _",
        ));
    }
    Ok(())
}

fn sha256(bytes: &[u8]) -> String {
    file::hex(&Sha256::digest(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::bundled;

    fn repository() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("data")
    }

    #[test]
    fn the_projects_own_manifest_is_read_and_true() {
        let manifest = Manifest::read(&repository()).unwrap();
        let names: Vec<&str> = manifest.areas.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, bundled::names().collect::<Vec<_>>());
        for name in names {
            let dem = manifest.load_described(name).unwrap().0;
            assert_eq!(dem.heights(), bundled::load(name).unwrap().heights());
        }
        let message = manifest.load_described("atlantis").unwrap_err().to_string();
        assert!(message.contains("atlantis") && message.contains("sierra, grand-canyon"), "{message}");
    }

    #[test]
    fn entries_are_added_and_spoiled_files_found_out() {
        let folder = tempfile::tempdir().unwrap();
        let (raster, path) = (folder.path().join("hill.tif"), folder.path().join(FILE_NAME));
        std::fs::copy(repository().join("sierra.tif"), &raster).unwrap();
        let (mut area, _) = Area::of_file("hill", &raster, folder.path()).unwrap();
        area.add_to(&path).unwrap();
        assert!(area.add_to(&path).unwrap_err().to_string().contains("hill"));
        std::fs::write(&path, format!("# mine\n{}", std::fs::read_to_string(&path).unwrap())).unwrap();
        area.name = "hill_2".into();
        area.add_to(&path).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("# mine\n[[area]]"));
        let manifest = Manifest::read(folder.path()).unwrap();
        assert_eq!(manifest.areas.len(), 2);
        assert_eq!(manifest.areas[0].elevation, Some([999.0, 2551.0]));
        assert_eq!(manifest.load_described("hill_2").unwrap().0.shape(), (512, 512));

        let refused = |spoil: &dyn Fn(&mut Area), words: &str| {
            let mut manifest = manifest.clone();
            spoil(&mut manifest.areas[0]);
            let message = manifest.load_described("hill").unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("hill.tif"), "{message}");
        };
        refused(&|a| a.shape = Some([512, 511]), "[512, 511]");
        refused(&|a| a.elevation = Some([999.0, 2552.0]), "2552");
        refused(&|a| a.metres_per_pixel = Some(31.0), "31");
        refused(&|a| a.sha256 = Some("0".repeat(64)), "sha256");
        refused(&|a| a.file = "no-hill.tif".into(), "no-hill.tif");

        assert!(Area::of_file("a b", &raster, folder.path()).unwrap_err().to_string().contains("a b"));
        let elsewhere = Area::of_file("x", &repository().join("sierra.tif"), folder.path());
        assert!(elsewhere.unwrap_err().to_string().contains("outside"));
        std::fs::write(&path, "[[area]]\nname = \"a\"\nfile = \"b\"\nheight = 3\n").unwrap();
        let message = Manifest::read(folder.path()).unwrap_err().to_string();
        assert!(message.contains("height") && message.contains("manifest.toml"), "{message}");
        std::fs::write(&path, "[[area]]\nname = \"a\"\nfile = \"b\"\n".repeat(2)).unwrap();
        assert!(Manifest::read(folder.path()).unwrap_err().to_string().contains("once"));
    }
}
