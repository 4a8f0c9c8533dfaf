//! Stored numbers on their way to becoming heights: voids told apart, units applied, absurdities refused.

use super::super::{CellSize, Dem};
use super::{Nodata, ReadOptions};
use crate::error::{Error, Result};
use crate::grid::Grid;
use std::path::Path;

/// The largest raster that is read: 2^28 cells (16384 x 16384), about 1.3 GB as a [`Dem`].
pub const MAX_CELLS: u64 = 1 << 28;

/// Heights beyond this many metres are taken for undeclared nodata markers (3.4e38, 2^31 - 1, ...): an error.
const MAX_HEIGHT: f64 = 1e6;

/// A nodata number beyond this stands for every number beyond it on the same side of 0: none of them can be a height.
const HUGE_MARKER: f64 = 1e30;

/// Numbers that are popular as undeclared nodata markers, and how far from every other height one of them must be
/// to be taken for a marker.
const MARKERS: [f64; 8] = [-9999.0, -32768.0, -32767.0, -99999.0, -999_999.0, 9999.0, 32767.0, 65535.0];
const MARKER_GAP: f64 = 1000.0;

/// Checks a raster size that a header claims.
///
/// A single row or column has no slope, so two of each are the least that is terrain.
pub(super) fn check_size(path: &Path, rows: u64, cols: u64) -> Result<(usize, usize)> {
    let fits = rows >= 2 && cols >= 2 && rows.checked_mul(cols).is_some_and(|n| n <= MAX_CELLS);
    match (usize::try_from(rows), usize::try_from(cols)) {
        (Ok(rows), Ok(cols)) if fits => Ok((rows, cols)),
        _ => Err(Error::file(
            path,
            "raster size",
            format!("{rows} rows x {cols} columns"),
            format!("allowed: at least 2 x 2, at most {MAX_CELLS} cells"),
        )),
    }
}

/// How a stored number becomes metres: `(number * scale + offset) * metres_per_unit`, unless it is nodata.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    nodata: Option<f64>,
    single_precision: bool,
    undeclared: bool,
    scale: f64,
    offset: f64,
}

impl Rule {
    /// `declared`: the file's own nodata number. `unit`: the file's own vertical unit in metres.
    pub(super) fn new(path: &Path, options: &ReadOptions, declared: Option<f64>, unit: f64) -> Result<Self> {
        let nodata = match options.nodata {
            Nodata::AsDeclared => declared,
            Nodata::Value(value) => Some(value),
            Nodata::None => None,
        };
        let scale = options.metres_per_unit.unwrap_or(unit);
        if !(scale.is_finite() && scale != 0.0) {
            return Err(Error::value("metres per unit", scale, "allowed: finite and not 0").in_file(path));
        }
        Ok(Self {
            nodata,
            single_precision: false,
            undeclared: options.nodata == Nodata::AsDeclared && declared.is_none(),
            scale,
            offset: 0.0,
        })
    }

    /// With GDAL's scale and offset of the band, applied before the unit.
    pub(super) fn scaled(mut self, scale: f64, offset: f64) -> Self {
        self.offset = offset * self.scale;
        self.scale *= scale;
        self
    }

    /// For numbers stored as 32-bit floats, whose nodata text (-3.40282e38) need only agree to that precision.
    pub(super) fn single_precision(mut self, single: bool) -> Self {
        self.single_precision = single;
        self
    }

    fn is_void(&self, value: f64) -> bool {
        let is_marker = |n: f64| {
            n == value
                || (self.single_precision && n as f32 == value as f32)
                // Written by hand or rounded, as -3.4e38 for the lowest float.
                || (n.abs() > HUGE_MARKER && value.abs() > HUGE_MARKER && n.signum() == value.signum())
        };
        !value.is_finite() || self.nodata.is_some_and(is_marker)
    }
}

/// A raster being filled; cells that are never set are voids.
pub(super) struct Samples {
    rows: usize,
    cols: usize,
    heights: Vec<f32>,
    valid: Vec<bool>,
    rule: Rule,
    absurd: Option<(usize, f64)>,
    marker: Option<f64>,
}

impl Samples {
    /// An empty raster whose size has been checked against the file.
    pub(super) fn new(rows: usize, cols: usize, rule: Rule) -> Self {
        let cells = rows * cols;
        Self {
            rows,
            cols,
            heights: vec![0.0; cells],
            valid: vec![false; cells],
            rule,
            absurd: None,
            marker: None,
        }
    }

    /// Stores the number at position `index`, row by row.
    pub(super) fn set(&mut self, index: usize, value: f64) {
        if self.rule.is_void(value) {
            return;
        }
        let metres = value * self.rule.scale + self.rule.offset;
        if metres.abs() > MAX_HEIGHT {
            self.absurd.get_or_insert((index, value));
            return;
        }
        if self.rule.undeclared && !(-9998.0..9999.0).contains(&value) && MARKERS.contains(&value) {
            self.marker.get_or_insert(value);
        }
        self.heights[index] = metres as f32;
        self.valid[index] = true;
    }

    /// Turns the raster so that row 0 is the northern one (see [`super::ground::Placement`]).
    pub(super) fn flip(&mut self, rows: bool, cols: bool) {
        if rows {
            for row in 0..self.rows / 2 {
                let (a, b) = (row * self.cols, (self.rows - 1 - row) * self.cols);
                for col in 0..self.cols {
                    self.heights.swap(a + col, b + col);
                    self.valid.swap(a + col, b + col);
                }
            }
        }
        if cols {
            self.heights.chunks_exact_mut(self.cols).for_each(<[f32]>::reverse);
            self.valid.chunks_exact_mut(self.cols).for_each(<[bool]>::reverse);
        }
    }

    /// The finished DEM.
    pub(super) fn into_dem(self, path: &Path, cell_size: CellSize) -> Result<Dem> {
        if let Some((index, value)) = self.absurd {
            return Err(Error::file(
                path,
                format!("height at row {}, column {}", index / self.cols, index % self.cols),
                format!("{value:e}"),
                format!(
                    "allowed: up to {MAX_HEIGHT} m from 0; if the number marks missing heights, give it as nodata"
                ),
            ));
        }
        self.check_marker(path)?;
        let heights = Grid::from_vec(self.rows, self.cols, self.heights)?;
        let valid = Grid::from_vec(self.rows, self.cols, self.valid)?;
        Dem::with_voids(heights, valid, cell_size).map_err(|e| e.in_file(path))
    }

    fn check_marker(&self, path: &Path) -> Result<()> {
        let Some(marker) = self.marker else { return Ok(()) };
        let metres = (marker * self.rule.scale + self.rule.offset) as f32;
        let gap = (MARKER_GAP * self.rule.scale.abs()) as f32;
        let known = || self.heights.iter().zip(&self.valid).filter(|(_, ok)| **ok).map(|(&z, _)| z);
        if known().any(|z| z != metres && (z - metres).abs() <= gap) {
            return Ok(());
        }
        let count = known().filter(|&z| z == metres).count();
        Err(Error::file(
            path,
            format!("height of {count} cells"),
            format!("{marker}, far from all others, and no nodata value is declared"),
            format!("say what it means: nodata {marker}, or nodata none if it is a height"),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fill(values: &[f64], nodata: Nodata, declared: Option<f64>) -> Result<Dem> {
        let path = Path::new("x");
        let rule = Rule::new(path, &ReadOptions { nodata, ..Default::default() }, declared, 1.0)?;
        let mut samples = Samples::new(2, values.len() / 2, rule);
        for (i, &v) in values.iter().enumerate() {
            samples.set(i, v);
        }
        samples.into_dem(path, CellSize::square(1.0)?)
    }

    #[test]
    fn undeclared_markers_are_refused_until_explained() {
        let values = [1.0, 2.0, -9999.0, 3.0];
        let message = fill(&values, Nodata::AsDeclared, None).unwrap_err().to_string();
        assert!(message.contains("-9999") && message.contains("nodata"), "{message}");
        assert_eq!(fill(&values, Nodata::AsDeclared, Some(-9999.0)).unwrap().void_count(), 1);
        assert_eq!(fill(&values, Nodata::Value(-9999.0), None).unwrap().void_count(), 1);
        assert_eq!(fill(&values, Nodata::None, None).unwrap().void_count(), 0);
        // A trench where -9999 has neighbours is bathymetry, not a marker.
        assert_eq!(fill(&[-9999.0, -9950.0, 2.0, 3.0], Nodata::AsDeclared, None).unwrap().void_count(), 0);
    }

    #[test]
    fn absurd_heights_name_their_cell() {
        let message = fill(&[1.0, 2.0, 3.0, -3.4e38], Nodata::AsDeclared, None).unwrap_err().to_string();
        assert!(message.contains("row 1, column 1") && message.contains("nodata"), "{message}");
        let dem = fill(&[1.0, f64::NAN, f64::INFINITY, 4.0], Nodata::AsDeclared, None).unwrap();
        assert_eq!(dem.void_count(), 2);
    }
}
