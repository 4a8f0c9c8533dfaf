//! Terrain by name: a folder with a manifest, then the bundled tiles.

use super::manifest::Manifest;
use super::{Dem, bundled};
use crate::error::{Error, Result};
use std::path::Path;

/// Where terrain comes from by name: a folder with a manifest, then the bundled tiles.
#[derive(Clone, Debug, Default)]
pub struct Terrain {
    manifest: Option<Manifest>,
}

impl Terrain {
    /// The bundled tiles, and before them the rasters of `folder` if one is given.
    ///
    /// # Errors
    /// When the folder's manifest cannot be read.
    pub fn new(folder: Option<&Path>) -> Result<Self> {
        Ok(Self { manifest: folder.map(Manifest::read).transpose()? })
    }

    /// The terrain called `name`.
    ///
    /// # Errors
    /// When there is none, or its file is not what the manifest says.
    pub fn load(&self, name: &str) -> Result<Dem> {
        let in_folder = |m: &&Manifest| m.areas.iter().any(|area| area.name == name);
        if let Some(manifest) = self.manifest.as_ref().filter(in_folder) {
            // On square cells, as every command has it.
            let dem = manifest.load(name)?;
            return Ok(dem.on_square_cells()?.unwrap_or(dem));
        }
        if bundled::names().any(|known| known == name) {
            return bundled::load(name);
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
