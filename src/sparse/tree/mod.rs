//! Sparse construction trees (Guérin et al. 2016, 4.1): terrain as a text of operators and primitives, evaluated at any place and cell size.
//!
//! A [`Tree`] is one TOML file that people read and edit, and one safetensors file of the same name with the numbers of its sparse
//! primitives. [`fit`] makes sparse primitives of terrain.

mod bounds;
mod curve;
mod evaluate;
mod field;
mod fit;
mod node;
mod noise;
mod store;

#[cfg(test)]
mod tests;

pub(crate) use field::Field;
pub(crate) use fit::{AtomSource, FitConfig, fit};
pub(crate) use node::{Node, Pair};
pub(crate) use noise::NoiseKind;

use crate::arrays::Arrays;
use crate::control::Stop;
use crate::dem::{CellSize, Dem};
use crate::error::{Error, Result};
use crate::file;
use evaluate::{Ready, raster};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Key of the description in the file of numbers.
const KEY: &str = "monadnock-tree";
/// Largest text.
const LARGEST_TEXT: u64 = 1 << 26;
/// Most cells of a raster.
const MOST_CELLS: usize = 1 << 30;

/// A construction tree over a rectangle of ground.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    text: Text,
    fields: BTreeMap<String, Field>,
}

/// The text file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    /// Metres from west to east and from north to south.
    extent: [f64; 2],
    /// Metres of the cells at which it is drawn unless others are asked for.
    cell: f64,
    root: Node,
}

impl Tree {
    /// The tree of one field, which it calls "terrain".
    pub(crate) fn of(field: Field) -> Self {
        let text = Text {
            extent: field.extent(),
            cell: field.cell,
            root: Node::Sparse { field: "terrain".to_owned() },
        };
        Self { text, fields: BTreeMap::from([("terrain".to_owned(), field)]) }
    }

    /// The root.
    pub(crate) const fn root(&self) -> &Node {
        &self.text.root
    }

    /// Its sparse primitives by name.
    pub(crate) const fn fields(&self) -> &BTreeMap<String, Field> {
        &self.fields
    }

    /// Metres of its own cells.
    pub(crate) const fn cell(&self) -> f64 {
        self.text.cell
    }

    /// Metres from west to east and from north to south.
    pub(crate) const fn extent(&self) -> [f64; 2] {
        self.text.extent
    }

    /// The same with another root.
    ///
    /// # Errors
    /// When a number of it is out of range, or it names a field that is not there.
    pub(crate) fn with_root(mut self, root: Node) -> Result<Self> {
        self.text.root = root;
        self.checked()
    }

    fn checked(self) -> Result<Self> {
        let [x, y] = self.text.extent;
        for (name, value) in [("extent", x), ("extent", y), ("cell", self.text.cell)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::value(name, value, "allowed: finite, above 0"));
            }
        }
        self.text.root.validate(&|name| self.fields.contains_key(name), "root")?;
        Ok(self)
    }

    /// Height at a point, metres east and south of the north-west corner, as cells of `cell` metres show it; none where nothing is.
    #[cfg(test)]
    pub(crate) fn height(&self, point: [f64; 2], cell: f64) -> Option<f64> {
        Ready::new(&self.text.root, &self.fields, cell).at(point).map(|(height, _)| height)
    }

    /// The tree as terrain with cells of so many metres. `window`: west, north, width and height in metres; all of it without.
    ///
    /// # Errors
    /// When the window or the cells are out of range, nothing is there, or the work is stopped.
    pub(crate) fn render(&self, cell: f64, window: Option<[f64; 4]>, stop: &Stop) -> Result<Dem> {
        let [width, height] = self.text.extent;
        let [west, north, width, height] = window.unwrap_or([0.0, 0.0, width, height]);
        let side = |metres: f64| (metres / cell).round();
        let (rows, cols) = (side(height), side(width));
        let allowed = format!("allowed: 1 to {MOST_CELLS} cells of that size, from a finite corner");
        let fits = rows >= 1.0 && cols >= 1.0 && rows * cols <= MOST_CELLS as f64;
        if !(cell > 0.0 && fits && west.is_finite() && north.is_finite()) {
            return Err(Error::value(
                "window",
                format!("{width} x {height} m in cells of {cell} m"),
                allowed,
            ));
        }
        let ready = Ready::new(&self.text.root, &self.fields, cell);
        let (heights, valid) = raster(&ready, [west, north], (rows as usize, cols as usize), cell, stop)?;
        Dem::with_voids(heights, valid, CellSize::square(cell)?)
    }

    /// Writes the text and, beside it, the numbers, rounded to within `precision` metres. Bytes of both.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn write(&self, path: &Path, precision: f64) -> Result<usize> {
        let text =
            toml::to_string(&self.text).map_err(|e| Error::value("tree", e, "it must be plain data"))?;
        let (infos, arrays) = store::pack(&self.fields, precision)?;
        let description =
            serde_json::to_string(&infos).map_err(|e| Error::value("tree", e, "it must be plain data"))?;
        let numbers = numbers(path);
        arrays.write(&numbers, KEY, description)?;
        file::write_bytes(path, text.as_bytes())?;
        Ok(text.len() + file::read_whole(&numbers, u64::MAX)?.len())
    }

    /// The text alone.
    ///
    /// # Errors
    /// Never: it is plain data.
    pub(crate) fn text_of(&self) -> Result<String> {
        toml::to_string(&self.text).map_err(|e| Error::value("tree", e, "it must be plain data"))
    }

    /// Reads both files.
    ///
    /// # Errors
    /// When one is missing or damaged, or a number is out of range.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = file::read_text(path, LARGEST_TEXT)?;
        let text: Text = toml::from_str(&text).map_err(|e| {
            Error::file(path, "tree", e.to_string().trim_end(), "allowed: what `tree fit` writes")
        })?;
        let beside = numbers(path);
        let (description, mut arrays) = Arrays::read(&beside, KEY, "the numbers of a tree")?;
        let infos = serde_json::from_str(&description)
            .map_err(|e| Error::file(&beside, "description", e, "allowed: what `tree fit` writes"))?;
        let fields = store::unpack(infos, &mut arrays).map_err(|e| e.in_file(&beside))?;
        arrays.finish().map_err(|e| e.in_file(&beside))?;
        Self { text, fields }.checked().map_err(|e| e.in_file(path))
    }
}

/// The file of numbers beside a text.
pub(crate) fn numbers(path: &Path) -> PathBuf {
    path.with_extension("safetensors")
}
