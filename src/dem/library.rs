//! Terrain by name: a folder with a manifest, then the bundled tiles.

use super::io::{Description, ReadOptions};
use super::manifest::Manifest;
use super::{Dem, bundled};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Where terrain comes from by name: a folder with a manifest, then the bundled tiles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Terrain {
    manifest: Option<Manifest>,
}

/// A piece of terrain, on square cells.
#[derive(Clone, Debug)]
pub(crate) struct Loaded {
    /// Its file; the name of a bundled tile.
    pub(crate) file: PathBuf,
    /// The terrain.
    pub(crate) dem: Dem,
    /// What was assumed about it.
    pub(crate) description: Description,
}

impl Terrain {
    /// The bundled tiles, and before them the rasters of `folder` if one is given.
    ///
    /// # Errors
    /// When the folder's manifest cannot be read.
    pub(crate) fn new(folder: Option<&Path>) -> Result<Self> {
        Ok(Self { manifest: folder.map(Manifest::read).transpose()? })
    }

    /// The terrain called `name`.
    ///
    /// # Errors
    /// When there is none, or its file is not what the manifest says.
    pub(crate) fn load(&self, name: &str) -> Result<Loaded> {
        let in_folder = |m: &&Manifest| m.areas.iter().any(|area| area.name == name);
        if let Some(manifest) = self.manifest.as_ref().filter(in_folder) {
            let (dem, mut description) = manifest.load_described(name)?;
            let area = manifest.areas.iter().find(|area| area.name == name);
            let file = manifest.folder.join(area.map_or(Path::new(name), |area| &area.file));
            // On square cells, as every command has it.
            let Some(square) = dem.on_square_cells().map_err(|e| e.in_file(&file))? else {
                return Ok(Loaded { file, dem, description });
            };
            let ((rows, cols), from, to) = (square.shape(), dem.cell_size(), square.cell_size());
            description.notes.push(format!(
                "cells are {}: resampled to {rows}x{cols} square cells of {}, in which exemplars and patches are counted",
                from.in_words(),
                to.in_words()
            ));
            return Ok(Loaded { file, dem: square, description });
        }
        if bundled::names().any(|known| known == name) {
            let (dem, description) = bundled::read(name, &ReadOptions::default())?;
            return Ok(Loaded { file: name.into(), dem, description });
        }
        let mut known: Vec<&str> =
            self.manifest.iter().flat_map(|m| &m.areas).map(|area| area.name.as_str()).collect();
        bundled::names().for_each(|name| known.push(name));
        let hint = if self.manifest.is_none() {
            "; others with --data and a folder with a manifest.toml"
        } else {
            ""
        };
        Err(Error::value("area", format!("{name:?}"), format!("allowed: {}{hint}", known.join(", "))))
    }
}
