//! Stored numbers on their way to becoming heights: voids told apart, units applied, absurdities refused.

use super::super::{CellSize, Dem};
use super::place::Said;
use super::{Nodata, ReadOptions, markers};
use crate::error::{Error, Result};
use crate::grid::Grid;
use std::path::Path;

/// The largest raster that is read: 2^28 cells (16384 x 16384), about 1.3 GB as a [`Dem`].
pub(crate) const MAX_CELLS: u64 = 1 << 28;

/// Heights beyond this many metres are taken for undeclared nodata markers (3.4e38, 2^31 - 1, ...): an error.
const MAX_HEIGHT: f64 = 1e6;

/// A nodata number beyond this stands for every number beyond it on the same side of 0: none of them can be a height.
const HUGE_MARKER: f64 = 1e30;

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

/// The number that a nodata text means, as C and C++ programs write it ("-1.#QNAN", "nan(ind)" are NaN); `None` when it is
/// none.
pub(super) fn nodata_number(text: &str) -> Option<f64> {
    let text = text.trim();
    let not_a_number = |t: &str| {
        let t = t.trim_start_matches(['-', '+']).to_ascii_lowercase();
        t.starts_with("1.#qnan")
            || t.starts_with("1.#snan")
            || t.starts_with("1.#ind")
            || t.starts_with("nan")
    };
    if not_a_number(text) { Some(f64::NAN) } else { text.parse().ok() }
}

/// Whether a nodata text says that there is none.
pub(super) fn is_no_nodata(text: &str) -> bool {
    let text = text.trim();
    text.is_empty() || ["null", "none", "no", "n/a", "undefined"].iter().any(|w| text.eq_ignore_ascii_case(w))
}

/// How a stored number becomes metres: `(number * scale + offset) * metres_per_unit`, unless it is nodata.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    nodata: [Option<f64>; 2],
    single_precision: bool,
    /// Nobody but the file says which numbers are voids, so that strange ones are refused and not only told.
    strict: bool,
    /// The numbers are heights, and checked to be such.
    heights: bool,
    scale: f64,
    offset: f64,
}

impl Rule {
    /// `declared`: the file's own nodata number. `unit`: the file's own vertical unit in metres.
    pub(super) fn new(path: &Path, options: &ReadOptions, declared: Option<f64>, unit: f64) -> Result<Self> {
        let nodata = match options.nodata {
            Nodata::AsDeclared | Nodata::Numbers => [declared, None],
            Nodata::Value(value) => [Some(value), None],
            Nodata::Either(values) => values.map(Some),
            Nodata::None => [None; 2],
        };
        let scale = options.metres_per_unit.unwrap_or(unit);
        if !(scale.is_finite() && scale != 0.0) {
            return Err(Error::value("metres per unit", scale, "allowed: finite and not 0").in_file(path));
        }
        let strict = options.nodata == Nodata::AsDeclared;
        let heights = options.nodata != Nodata::Numbers;
        Ok(Self { nodata, single_precision: false, strict, heights, scale, offset: 0.0 })
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

    /// The stored number behind a height, as people would write it.
    pub(super) fn stored(&self, metres: f64) -> f64 {
        let stored = (metres - self.offset) / self.scale;
        let whole = stored.round();
        if (stored - whole).abs() <= 1e-6 * whole.abs().max(100.0) { whole } else { stored }
    }

    /// Whether strange numbers are refused.
    pub(super) fn is_strict(&self) -> bool {
        self.strict
    }

    /// Told rather than refused: the numbers have no other meaning than that of heights.
    pub(super) fn lenient(mut self) -> Self {
        self.strict = false;
        self
    }

    /// The nodata number that the file declared, or the caller gave.
    pub(super) fn nodata(&self) -> Option<f64> {
        self.nodata[0]
    }

    fn is_void(&self, value: f64) -> bool {
        let is_marker = |n: f64| {
            n == value
                || (self.single_precision && n as f32 == value as f32)
                // Written by hand or rounded, as -3.4e38 for the lowest float.
                || (n.abs() > HUGE_MARKER && value.abs() > HUGE_MARKER && n.signum() == value.signum())
        };
        !value.is_finite() || self.nodata.into_iter().flatten().any(is_marker)
    }
}

/// A raster being filled; cells that are never set are voids.
pub(super) struct Samples {
    rows: usize,
    cols: usize,
    heights: Vec<f32>,
    valid: Vec<bool>,
    rule: Rule,
    /// Where the first number lies that is beyond all heights, the number, and how many there are.
    absurd: Option<(usize, f64, usize)>,
}

impl Samples {
    /// An empty raster whose size has been checked against the file.
    pub(super) fn new(rows: usize, cols: usize, rule: Rule) -> Self {
        let cells = rows * cols;
        Self { rows, cols, heights: vec![0.0; cells], valid: vec![false; cells], rule, absurd: None }
    }

    /// Stores the number at position `index`, row by row.
    pub(super) fn set(&mut self, index: usize, value: f64) {
        if self.rule.is_void(value) {
            return;
        }
        let metres = value * self.rule.scale + self.rule.offset;
        if self.rule.heights && metres.abs() > MAX_HEIGHT {
            self.absurd.get_or_insert((index, value, 0)).2 += 1;
            return;
        }
        self.heights[index] = metres as f32;
        self.valid[index] = true;
    }

    /// Makes the cells void where `known` is false, in the file's own order; returns how many had a height.
    pub(super) fn mask(&mut self, known: impl Fn(usize) -> bool) -> usize {
        let mut masked = 0;
        for (i, valid) in self.valid.iter_mut().enumerate() {
            if *valid && !known(i) {
                *valid = false;
                masked += 1;
            }
        }
        masked
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

    /// The finished DEM. Says in `said` which heights are strange.
    pub(super) fn into_dem(self, path: &Path, cell_size: CellSize, said: &mut Said) -> Result<Dem> {
        if let Some((index, value, count)) = self.absurd {
            let cells =
                if count == 1 { String::new() } else { format!(" (and of {} cells more)", count - 1) };
            return Err(Error::file(
                path,
                format!("height at row {}, column {}{cells}", index / self.cols, index % self.cols),
                format!("{value:e}"),
                format!(
                    "allowed: up to {MAX_HEIGHT} m from 0; if the number marks missing heights, say so: --nodata {value:e}"
                ),
            ));
        }
        if self.rule.heights {
            markers::check(path, &self.rule, &self.heights, &self.valid, said)?;
        }
        let heights = Grid::from_vec(self.rows, self.cols, self.heights)?;
        let valid = Grid::from_vec(self.rows, self.cols, self.valid)?;
        Dem::with_voids(heights, valid, cell_size).map_err(|e| e.in_file(path))
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
        samples.into_dem(path, CellSize::square(1.0)?, &mut Said::default())
    }

    #[test]
    fn nodata_texts() {
        for text in ["nan", "-1.#QNAN", "1.#IND", "-nan(ind)", " NaN "] {
            assert!(nodata_number(text).unwrap().is_nan(), "{text}");
        }
        assert_eq!(
            (nodata_number("-9999.0 "), nodata_number("null"), nodata_number("-9999,0")),
            (Some(-9999.0), None, None)
        );
        assert!(is_no_nodata("NULL") && is_no_nodata(" ") && !is_no_nodata("-1"));
    }

    #[test]
    fn two_numbers_can_be_voids() {
        let values = [1.0, 2.0, -9999.0, 32767.0];
        let dem = fill(&values, Nodata::Either([-9999.0, 32767.0]), Some(2.0)).unwrap();
        assert_eq!((dem.void_count(), dem.range()), (2, (1.0, 2.0)));
    }

    #[test]
    fn absurd_heights_name_their_cell() {
        let message = fill(&[1.0, 2.0, 3.0, -3.4e38], Nodata::AsDeclared, None).unwrap_err().to_string();
        assert!(message.contains("row 1, column 1") && message.contains("--nodata -3.4e38"), "{message}");
        let dem = fill(&[1.0, f64::NAN, f64::INFINITY, 4.0], Nodata::AsDeclared, None).unwrap();
        assert_eq!(dem.void_count(), 2);
    }
}
