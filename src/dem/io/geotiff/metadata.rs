//! What GDAL keeps beside the raster: nodata (tag 42113), band scale, offset and unit (tag 42112, an XML list of items).
//!
//! Only items with a role are used, and one item of our own: the cell size on the ground, in metres, written when it
//! does not follow from the georeference (a cropped tile in degrees keeps the size of the whole). It names the steps of
//! the transform that it belongs to, and counts only with these: other programs copy items into resampled files.

use super::directory::Directory;
use super::tag;
use crate::dem::CellSize;
use crate::dem::io::place::{Said, unless_given};
use crate::dem::io::samples::{is_no_nodata, nodata_number};
use crate::dem::io::sidecars::named_unit;
use crate::dem::io::{Nodata, ReadOptions};
use crate::error::{Error, Result};
use std::path::Path;

/// Name of our own item.
const CELL_SIZE_ITEM: &str = "MONADNOCK_CELL_SIZE";

/// GDAL's words about one band.
#[derive(Debug)]
pub(super) struct Metadata {
    pub(super) nodata: Option<f64>,
    pub(super) scale: f64,
    pub(super) offset: f64,
    /// Metres in a vertical unit.
    pub(super) unit: Option<f64>,
    pub(super) cell_size: Option<RecordedCellSize>,
}

/// Our own item: a cell size and the transform's steps (column, row) that it belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordedCellSize {
    size: CellSize,
    steps: [f64; 2],
}

impl RecordedCellSize {
    /// The size, if `transform` still has the steps that it was recorded for.
    pub(super) fn for_transform(self, transform: [f64; 6]) -> Option<CellSize> {
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs();
        let [x, y] = steps(transform);
        (same(self.steps[0], x) && same(self.steps[1], y)).then_some(self.size)
    }
}

fn steps([a, b, _, d, e, _]: [f64; 6]) -> [f64; 2] {
    [a.hypot(d), b.hypot(e)]
}

impl Metadata {
    pub(super) fn parse(
        path: &Path,
        directory: &Directory<'_>,
        band: usize,
        options: &ReadOptions,
        said: &mut Said,
    ) -> Result<Self> {
        let nodata = match options.nodata {
            Nodata::AsDeclared | Nodata::Numbers => {
                declared(path, &directory.text(tag::GDAL_NODATA)?.unwrap_or_default(), said)?
            }
            _ => None,
        };
        let mut found = Self { nodata, scale: 1.0, offset: 0.0, unit: None, cell_size: None };
        let text = directory.text(tag::GDAL_METADATA)?.unwrap_or_default();
        for item in text.split("<Item").skip(1) {
            let Some((attributes, rest)) = item.split_once('>') else { continue };
            let value = rest.split('<').next().unwrap_or_default();
            if attribute(attributes, "name") == Some(CELL_SIZE_ITEM) {
                found.cell_size = unless_given(cell_size(path, value).map(Some), options, None, said)?;
            }
            let sample = attribute(attributes, "sample").unwrap_or("0");
            if sample.parse() != Ok(band) {
                continue;
            }
            match attribute(attributes, "role") {
                Some("scale") => found.scale = finite(path, "GDAL_METADATA scale", value)?,
                Some("offset") => found.offset = finite(path, "GDAL_METADATA offset", value)?,
                Some("unittype") if options.metres_per_unit.is_none() => {
                    found.unit = match value.trim() {
                        "" => None,
                        name => Some(named_unit(path, name)?),
                    };
                }
                _ => {}
            }
        }
        if found.scale == 0.0 {
            return Err(Error::file(path, "GDAL_METADATA scale", 0, "allowed: not 0"));
        }
        Ok(found)
    }
}

/// The XML that records a cell size for a transform.
pub(super) fn record_cell_size(size: CellSize, transform: [f64; 6]) -> String {
    let ([x, y], [dx, dy]) = ([size.x(), size.y()], steps(transform));
    format!("<GDALMetadata>\n  <Item name=\"{CELL_SIZE_ITEM}\">{x} {y} {dx} {dy}</Item>\n</GDALMetadata>\n")
}

fn attribute<'a>(attributes: &'a str, name: &str) -> Option<&'a str> {
    let start = attributes.find(&format!("{name}=\""))? + name.len() + 2;
    attributes[start..].split('"').next()
}

fn number(path: &Path, field: &str, text: &str) -> Result<f64> {
    text.trim().parse().map_err(|_| Error::file(path, field, format!("{text:?}"), "allowed: a number"))
}

fn finite(path: &Path, field: &str, text: &str) -> Result<f64> {
    number(path, field, text).and_then(|v| {
        if v.is_finite() { Ok(v) } else { Err(Error::file(path, field, v, "allowed: a finite number")) }
    })
}

fn cell_size(path: &Path, text: &str) -> Result<RecordedCellSize> {
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    match numbers[..] {
        [x, y, dx, dy] => {
            let size = CellSize::new(x, y).map_err(|e| e.in_file(path))?;
            Ok(RecordedCellSize { size, steps: [dx, dy] })
        }
        _ => Err(Error::file(path, CELL_SIZE_ITEM, format!("{text:?}"), "allowed: four numbers")),
    }
}

/// The nodata number that a text declares.
fn declared(path: &Path, text: &str, said: &mut Said) -> Result<Option<f64>> {
    if is_no_nodata(text) {
        if !text.trim().is_empty() {
            said.notes.push(format!("GDAL_NODATA is {text:?}: no number marks missing heights"));
        }
        return Ok(None);
    }
    let allowed = "allowed: a number; or say it with --nodata";
    nodata_number(text)
        .map(Some)
        .ok_or_else(|| Error::file(path, "GDAL_NODATA", format!("{text:?}"), allowed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_and_units() {
        let attributes = r#" name="SCALE" sample="1" role="scale""#;
        assert_eq!(attribute(attributes, "sample"), Some("1"));
        assert_eq!(attribute(attributes, "role"), Some("scale"));
        assert_eq!(attribute(attributes, "domain"), None);
        let path = Path::new("x");
        assert_eq!(named_unit(path, "ft").unwrap(), 0.3048);
        assert!(named_unit(path, "furlong").unwrap_err().to_string().contains("furlong"));
    }
}
