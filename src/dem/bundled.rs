//! The tiles that ship inside the program, so that it has real terrain to show without any file.
//!
//! `data/manifest.toml` says what each tile is, where it comes from and under which terms; the tiles are GeoTIFFs
//! beside it. A test checks their hashes and that the manifest's figures are those of the rasters.

use super::Dem;
use super::io::{self, CellSizeSource, Description, ReadOptions};
use crate::error::{Error, Result};
use std::path::Path;
use std::sync::OnceLock;

const MANIFEST: &str = include_str!("../../data/manifest.toml");

/// File name and content of every tile.
const TILES: [(&str, &[u8]); 2] = [
    ("sierra.tif", include_bytes!("../../data/sierra.tif")),
    ("grand-canyon.tif", include_bytes!("../../data/grand-canyon.tif")),
];

/// What the manifest says about a tile.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BundledTile {
    /// Name to [`load`] it by.
    pub(crate) name: String,
    /// The place, for people.
    pub(crate) title: String,
    /// File name inside `data/`.
    pub(crate) file: String,
    /// Where the heights come from.
    pub(crate) source: String,
    /// Terms of use.
    pub(crate) licence: String,
    /// Whom to credit, in the words to use.
    pub(crate) credit: String,
    /// What was done to the source.
    pub(crate) note: String,
    /// Rows and columns.
    pub(crate) shape: [usize; 2],
    /// Side of a square cell, metres.
    pub(crate) cell_size: f64,
    /// Lowest and highest height, metres.
    pub(crate) elevation: [f64; 2],
    /// SHA-256 of the file, hexadecimal.
    pub(crate) sha256: String,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    tile: Vec<BundledTile>,
}

/// All tiles, the default exemplar first.
///
/// # Panics
/// Never in a released build: the manifest is compiled in, and a test parses it.
#[must_use]
pub(crate) fn manifest() -> &'static [BundledTile] {
    static PARSED: OnceLock<Vec<BundledTile>> = OnceLock::new();
    PARSED.get_or_init(|| toml::from_str::<Manifest>(MANIFEST).expect("data/manifest.toml is valid").tile)
}

/// The names of all tiles, the default exemplar first.
pub fn names() -> impl Iterator<Item = &'static str> {
    manifest().iter().map(|tile| tile.name.as_str())
}

/// The tile called `name`.
///
/// # Errors
/// When there is no such tile.
///
/// # Panics
/// Never in a released build: every tile of the manifest is compiled in, and a test loads them all.
pub fn load(name: &str) -> Result<Dem> {
    read(name, &ReadOptions::default()).map(|(dem, _)| dem)
}

/// The tile called `name` as [`io::read_described`] would read its file.
///
/// # Errors
/// When there is no such tile, or the options do not fit it.
///
/// # Panics
/// Never in a released build: every tile of the manifest is compiled in, and a test loads them all.
pub fn read(name: &str, options: &ReadOptions) -> Result<(Dem, Description)> {
    let tile = manifest().iter().find(|tile| tile.name == name).ok_or_else(|| {
        let known: Vec<_> = names().collect();
        Error::value("name of a bundled tile", format!("{name:?}"), format!("allowed: {}", known.join(", ")))
    })?;
    let (_, bytes) = TILES.iter().find(|(file, _)| *file == tile.file).expect("every tile is compiled in");
    let (dem, mut description) = io::read_bytes(Path::new(&tile.file), bytes, options)?;
    if options.cell_size.is_none() {
        // What the file leaves open, the manifest says: its cells are in metres.
        description.cell_size_source = CellSizeSource::File;
        description.notes.clear();
    }
    Ok((dem, description))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};

    #[test]
    fn the_manifest_tells_the_truth() {
        assert_eq!(manifest().len(), TILES.len());
        for tile in manifest() {
            let (_, bytes) = TILES.iter().find(|(file, _)| *file == tile.file).unwrap();
            let hash = crate::file::hex(&Sha256::digest(bytes));
            assert_eq!(hash, tile.sha256, "{}", tile.name);
            let dem = load(&tile.name).unwrap();
            assert_eq!(<[usize; 2]>::from(dem.shape()), tile.shape);
            assert_eq!((dem.cell_size().x(), dem.cell_size().y()), (tile.cell_size, tile.cell_size));
            let (low, high) = dem.range();
            assert_eq!([f64::from(low), f64::from(high)], tile.elevation);
            assert_eq!(dem.void_count(), 0);
        }
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let message = load("atlantis").unwrap_err().to_string();
        assert!(message.contains("atlantis") && message.contains("sierra, grand-canyon"), "{message}");
    }
}
