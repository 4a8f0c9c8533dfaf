//! What a style is learned from: a window of a DEM, its lines, and the coarse surfaces through them.

use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::extract::{self, ExtractionConfig};
use crate::file;
use crate::grid::{Cell, Grid, Window};
use crate::interpolation::{NaturalNeighbours, harmonic};
use crate::seed::Seed;
use crate::sketch::LineMap;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// Longest side of the terrain around an exemplar that is kept, cells.
const LONGEST_TERRAIN: usize = 1024;

/// Where a style comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExemplarInfo {
    /// Name of the DEM: a file name or a bundled tile.
    pub name: String,
    /// First row of the window in that DEM.
    pub row: usize,
    /// First column of the window.
    pub col: usize,
    /// Rows of the window.
    pub rows: usize,
    /// Columns of the window.
    pub cols: usize,
    /// Cell size on the ground, (x, y) metres.
    pub cell_size: [f64; 2],
    /// SHA-256 of the whole DEM's heights and voids ([`fingerprint`]).
    pub source_sha256: String,
    /// SHA-256 of the window's heights and voids.
    pub sha256: String,
}

/// The exemplar window of a DEM, ready to be learned.
#[derive(Clone, Debug)]
pub struct Source {
    /// The window.
    pub dem: Dem,
    /// Its description.
    pub info: ExemplarInfo,
    /// The terrain around the window, and with it: the whole DEM, or its nearest 1024 x 1024 cells.
    pub terrain: Arc<Dem>,
}

impl Source {
    /// A window of a DEM called `name`.
    ///
    /// # Errors
    /// When the window reaches past the frame or holds voids only.
    pub fn new(name: &str, dem: &Dem, window: Window) -> Result<Self> {
        let Window { origin, rows, cols } = window;
        let window = dem.crop(window)?;
        let cell = window.cell_size();
        let info = ExemplarInfo {
            name: name.to_owned(),
            row: origin.row,
            col: origin.col,
            rows,
            cols,
            cell_size: [cell.x(), cell.y()],
            source_sha256: fingerprint(dem),
            sha256: fingerprint(&window),
        };
        // The window in the middle as far as the frame allows.
        let around = |at: usize, side: usize, all: usize| {
            let wide = all.min(LONGEST_TERRAIN.max(side));
            ((at + side / 2).saturating_sub(wide / 2).min(all - wide), wide)
        };
        let (row, tall) = around(origin.row, rows, dem.shape().0);
        let (col, wide) = around(origin.col, cols, dem.shape().1);
        let terrain = Arc::new(dem.crop(Window::new(Cell::new(row, col), tall, wide))?);
        Ok(Self { dem: window, info, terrain })
    }

    /// The whole of a DEM called `name`.
    ///
    /// # Errors
    /// When it holds voids only.
    pub fn whole(name: &str, dem: &Dem) -> Result<Self> {
        Self::new(name, dem, Window::whole(dem.shape()))
    }

    /// The same with a smaller window: `cols` of its columns from `first` on.
    ///
    /// # Errors
    /// When the columns hold voids only.
    pub fn columns(&self, first: usize, cols: usize) -> Result<Self> {
        Self::new(&self.info.name, &self.dem, Window::new(Cell::new(0, first), self.info.rows, cols))
    }
}

/// SHA-256 over shape, heights and voids of a DEM, as hexadecimal digits.
#[must_use]
pub(crate) fn fingerprint(dem: &Dem) -> String {
    let mut hasher = Sha256::new();
    let (rows, cols) = dem.shape();
    hasher.update((rows as u64).to_le_bytes());
    hasher.update((cols as u64).to_le_bytes());
    for (z, &ok) in dem.heights().as_slice().iter().zip(dem.valid().as_slice()) {
        hasher.update(z.to_le_bytes());
        hasher.update([u8::from(ok)]);
    }
    file::hex(&hasher.finalize())
}

/// What every part of a style learns from.
#[derive(Clone, Debug)]
pub struct Exemplar {
    /// The window and the terrain around it, metres.
    pub(crate) source: Source,
    /// Metres of the unit interval: the window's range.
    pub(crate) normalization: Normalization,
    /// (rows, cols) of the window, unit interval.
    pub heights: Grid<f32>,
    /// How lines are found.
    pub(crate) extraction: ExtractionConfig,
    /// From which everything random is drawn.
    pub(crate) seed: Seed,
    /// Variants of the lines that the coarse system learns from: detail sees the exemplar drawn as often.
    pub(crate) extractions: usize,
    /// What the coarse system makes of the exemplar's lines where it has not seen the exemplar, unit interval; for detail, and
    /// none where that is not measured.
    pub(crate) unseen: Option<Grid<f32>>,
}

impl Exemplar {
    /// The exemplar as `extraction` shows it.
    ///
    /// # Errors
    /// When a setting of the extraction is out of range.
    pub fn new(source: &Source, extraction: &ExtractionConfig, seed: Seed) -> Result<Self> {
        extraction.validate()?;
        let normalization = Normalization::of(&source.dem);
        Ok(Self {
            source: source.clone(),
            normalization,
            heights: normalization.normalize(&source.dem),
            extraction: extraction.clone(),
            seed,
            extractions: 1,
            unseen: None,
        })
    }

    /// The terrain around the window, and with it.
    #[must_use]
    pub(crate) fn terrain(&self) -> &Arc<Dem> {
        &self.source.terrain
    }

    /// Its lines in `count` variants of the extraction, the standard one first; unit heights.
    ///
    /// # Errors
    /// When the standard one shows no line.
    pub(crate) fn variants(&self, count: usize) -> Result<Vec<LineMap>> {
        let valid = self.source.dem.valid();
        let variants = extract::variants(&self.heights, valid, &self.extraction, count, self.seed)?;
        if variants[0].line_count() == 0 {
            let allowed = "the exemplar shows no ridge or valley; choose a window with relief, or lower \
                           extraction.min_accumulation, min_order or min_length";
            return Err(Error::value("number of line cells", 0, allowed));
        }
        Ok(variants)
    }

    /// Its heights without voids, which are filled harmonically; unit interval.
    ///
    /// # Errors
    /// When the solver fails.
    pub(crate) fn filled(&self) -> Result<Grid<f32>> {
        let valid = self.source.dem.valid();
        if !valid.as_slice().contains(&false) {
            return Ok(self.heights.clone());
        }
        Ok(harmonic(valid, &self.heights.map(|z| f64::from(*z)))?.map(|z| *z as f32))
    }

    /// Its coarse twins: natural-neighbour surfaces through its lines in `count` variants, with those lines; at least one.
    ///
    /// # Errors
    /// As [`variants`](Self::variants).
    pub(crate) fn twins(&self, count: usize) -> Result<Vec<(Grid<f32>, LineMap)>> {
        let variants = self.variants(count)?.into_iter().filter(|lines| lines.line_count() > 0);
        variants.map(|lines| Ok((natural_surface(&lines)?, lines))).collect()
    }
}

/// The natural-neighbour surface through lines.
fn natural_surface(lines: &LineMap) -> Result<Grid<f32>> {
    let mask = lines.mask();
    let on_lines = lines.heights().as_slice().iter().zip(mask.as_slice());
    let values: Vec<f64> = on_lines.filter(|(_, line)| **line).map(|(z, _)| f64::from(*z)).collect();
    Ok(NaturalNeighbours::new(&mask)?.interpolate(&values).map(|z| *z as f32))
}
