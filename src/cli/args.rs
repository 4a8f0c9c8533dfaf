//! Arguments that several verbs share.

use crate::dem::io::{self, Description, Nodata, ReadOptions};
use crate::dem::{CellSize, Dem, Normalization, bundled};
use crate::error::{Error, Result};
use crate::grid::Cell;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A DEM and what its file may not say.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct DemInput {
    /// The DEM: GeoTIFF, SRTM .hgt, ASCII grid, 16-bit PNG or .npy; or a bundled tile: sierra, grand-canyon
    #[arg(value_name = "DEM")]
    pub(super) dem: PathBuf,
    /// PNG: elevations in metres of black and white
    #[arg(long = "png-elevation", value_name = "MIN,MAX", value_parser = Pair::from_str)]
    elevation: Option<Pair>,
    /// Cell size on the ground in metres, one side or X,Y; overrules the file
    #[arg(long, value_name = "M", value_parser = cell_size)]
    cell_size: Option<CellSize>,
    /// Stored number that means "no height"; `none` for none
    #[arg(long, value_name = "V", value_parser = nodata, allow_hyphen_values = true)]
    nodata: Option<Nodata>,
    /// GeoTIFF: the band to read, counted from 1
    #[arg(long, value_name = "N")]
    band: Option<usize>,
}

impl DemInput {
    /// Reads the file, or takes the bundled tile of that name when there is no such file.
    pub(super) fn load(&self) -> Result<Dem> {
        Ok(self.describe()?.0)
    }

    /// As [`load`](Self::load), with what the file says of itself; nothing for a bundled tile.
    pub(super) fn describe(&self) -> Result<(Dem, Option<Description>)> {
        if let Some(name) = bundled_name(&self.dem) {
            return Ok((bundled::load(name)?, None));
        }
        let elevation = match self.elevation {
            Some(Pair(low, high)) => Some(Normalization::new(low, high)?),
            None => None,
        };
        let options = ReadOptions {
            elevation,
            cell_size: self.cell_size,
            band: self.band,
            nodata: self.nodata.unwrap_or_default(),
            ..Default::default()
        };
        let (dem, description) = io::read_described(&self.dem, &options)?;
        Ok((dem, Some(description)))
    }

    /// File name without its folder, or the bundled name.
    pub(super) fn name(&self) -> String {
        self.dem.file_name().unwrap_or(self.dem.as_os_str()).to_string_lossy().into_owned()
    }
}

/// The bundled tile that a path means: one of their names, when no such file exists.
pub(super) fn bundled_name(path: &Path) -> Option<&'static str> {
    if path.exists() { None } else { bundled::names().find(|name| Path::new(name) == path) }
}

/// Two numbers with a comma between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair(f64, f64);

impl FromStr for Pair {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[a, b]) => Ok(Self(a, b)),
            _ => Err("allowed: two numbers with a comma between them".to_owned()),
        }
    }
}

/// MIN,MAX in metres.
pub(super) fn elevation(pair: Pair) -> Result<Normalization> {
    Normalization::new(pair.0, pair.1)
}

fn cell_size(text: &str) -> Result<CellSize, String> {
    let Pair(x, y) = if text.contains(',') { text.parse()? } else { format!("{text},{text}").parse()? };
    CellSize::new(x, y).map_err(|e| e.to_string())
}

fn nodata(text: &str) -> Result<Nodata, String> {
    if text == "none" {
        return Ok(Nodata::None);
    }
    text.parse().map(Nodata::Value).map_err(|_| "allowed: a number, or none".to_owned())
}

/// A piece of a raster: ROW,COL,SIZE with SIZE one side or ROWSxCOLS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) origin: Cell,
    pub(super) rows: usize,
    pub(super) cols: usize,
}

impl FromStr for Window {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = || "allowed: ROW,COL,SIZE, SIZE one side or ROWSxCOLS, such as 128,256,128".to_owned();
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        let &[row, col, size] = fields.as_slice() else { return Err(allowed()) };
        let number = |s: &str| s.trim().parse::<usize>().map_err(|_| allowed());
        let (rows, cols) = match size.split_once(['x', 'X']) {
            Some((rows, cols)) => (number(rows)?, number(cols)?),
            None => (number(size)?, number(size)?),
        };
        if rows == 0 || cols == 0 {
            return Err(allowed());
        }
        Ok(Self { origin: Cell::new(number(row)?, number(col)?), rows, cols })
    }
}

impl Window {
    /// The piece of a DEM.
    pub(super) fn crop(self, dem: &Dem) -> Result<Dem> {
        dem.crop(self.origin, self.rows, self.cols).map_err(|e| {
            Error::value(
                "--crop",
                format!("{},{},{}x{}", self.origin.row, self.origin.col, self.rows, self.cols),
                e.to_string(),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_parsed_and_bad_ones_refused() {
        let window: Window = "3, 4,5x6".parse().unwrap();
        assert_eq!(window, Window { origin: Cell::new(3, 4), rows: 5, cols: 6 });
        assert_eq!("0,0,128".parse::<Window>().unwrap().cols, 128);
        for bad in ["", "1,2", "1,2,0", "1,2,3,4", "-1,2,3", "a,b,c", "1,2,3x"] {
            assert!(bad.parse::<Window>().is_err(), "{bad}");
        }
    }
}
