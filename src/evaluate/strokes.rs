//! A few strokes of terrain that no system has seen, as a hand would draw them, and how far from it is what becomes of them.
//!
//! Terrain -> [`StrokeCase`]: a truth with its longest valleys and ridges ([`MainLines`]). Made terrain -> scores, as an answer to the
//! strokes and as a landscape; only SSIM and PSNR compare cell by cell. Heights are metres, nothing is clipped.

use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::extract::{MainLines, MainLinesConfig};
use crate::flow::{Surface, ponded_share};
use crate::grid::{Cell, Grid, Window};
use crate::metrics::{
    Contract, StrokeCheck, curvature_distance, geomorphon_distance, mean_slope_ratio, psnr,
    sliced_wasserstein, slope_distance, spectrum_distance, ssim,
};
use crate::seed::Seed;
use crate::sketch::{Sketch, StrokeKind};

/// Names of the scores of [`StrokeCase::scores`].
pub(crate) const STROKE_SCORES: [&str; 14] = [
    "stroke_height_error",
    "ridge_recall",
    "valley_recall",
    "carried_recall",
    "ponded_share",
    "truth_ponded_share",
    "mean_slope_ratio",
    "slope_distance",
    "spectrum_distance",
    "curvature_distance",
    "patch_distance",
    "landform_distance",
    "ssim",
    "psnr",
];

/// Fewest columns to learn from that are left for the sake of large truths.
const LEAST_WEST: usize = 256;

/// A truth and what a hand draws of it.
pub(crate) struct StrokeCase {
    /// The truth.
    pub(crate) truth: Dem,
    /// Metres of its lowest and highest height.
    pub(crate) range: Normalization,
    /// The strokes.
    pub(crate) drawn: Sketch,
}

impl StrokeCase {
    /// How many columns of terrain may be learned from where truths lie in its east: half of them, or as many as the `largest` truths leave
    /// where these are 256 or more.
    pub(crate) fn west_of(cols: usize, largest: usize) -> usize {
        let beside = cols.saturating_sub(largest);
        if beside >= LEAST_WEST { beside.min(cols / 2) } else { cols / 2 }
    }

    /// Where truths of a side lie beside what was learned: at the eastern frame, in its north and south, or in the middle where the two
    /// would overlap; nowhere where they do not fit.
    pub(crate) fn places(dem: &Dem, learned_columns: usize, side: usize) -> Vec<Cell> {
        let (rows, cols) = dem.shape();
        if side > rows || learned_columns + side > cols {
            return Vec::new();
        }
        let tops = if rows >= 2 * side { vec![0, rows - side] } else { vec![(rows - side) / 2] };
        tops.into_iter().map(|row| Cell::new(row, cols - side)).collect()
    }

    /// Draws at most `strokes` lines, half of them valleys, of the `side` x `side` cells at `origin`, each of which drains at least `share` of
    /// them (the usual one when none). Every seed is another hand.
    ///
    /// # Errors
    /// When the truth reaches past the frame, is all void or level, or shows no line.
    pub(crate) fn new(
        dem: &Dem,
        origin: Cell,
        side: usize,
        strokes: Option<usize>,
        share: Option<f64>,
        seed: Seed,
    ) -> Result<Self> {
        let truth = dem.crop(Window::square(origin, side))?;
        let (low, high) = truth.range();
        if low == high {
            return Err(Error::value("relief of the truth", "0 m", "level ground has no range to score in"));
        }
        let usual = MainLinesConfig::default();
        let share = share.unwrap_or(usual.share);
        // Lines that drain less are shorter.
        let min_length = (usual.min_length as f64 * (share / usual.share).sqrt()).clamp(4.0, 24.0) as usize;
        let config = MainLinesConfig { share, min_length, ..usual };
        let most = strokes.unwrap_or(usize::MAX).div_ceil(2);
        let found = MainLines::of(truth.heights(), truth.valid(), &config, most, seed)?;
        let drawn = Sketch::new(side, side, [found.valleys, found.ridges].concat())?;
        if drawn.strokes.is_empty() {
            return Err(Error::value("number of strokes", 0, "the truth shows no valley and no ridge"));
        }
        Ok(Self { range: Normalization::of(&truth), truth, drawn })
    }

    /// [`STROKE_SCORES`] of what was made of the strokes. `stroke_height_error` is a share of the truth's relief; a `recall` is the share of stroke
    /// cells with a line of their kind within 3 cells, and `carried_recall` with their main stem ([`StrokeCheck`]).
    ///
    /// # Errors
    /// When the shapes differ.
    pub(crate) fn scores(&self, made: &Dem) -> Result<[(&'static str, Option<f64>); STROKE_SCORES.len()]> {
        let valid = self.truth.valid();
        let (output, truth) = (self.range.normalize(made), self.range.normalize(&self.truth));
        let contract = Contract::of(made.heights(), valid, &self.drawn)?;
        let recall = |kind: StrokeKind, share: fn(&StrokeCheck) -> f64| {
            let of = || contract.strokes.iter().filter(|stroke| stroke.kind == kind);
            let cells: usize = of().map(|stroke| stroke.cells).sum();
            let found = || of().map(|stroke| stroke.cells as f64 * share(stroke)).sum::<f64>();
            (cells > 0).then(|| found() / cells as f64)
        };
        let ponds =
            |heights: &Grid<f32>| Surface::new(heights.clone(), valid.clone()).map(|s| ponded_share(&s));
        let values = [
            contract.height_error.map(|error| error / (self.range.high() - self.range.low())),
            recall(StrokeKind::Ridge, |stroke| stroke.found),
            recall(StrokeKind::Valley, |stroke| stroke.found),
            recall(StrokeKind::Valley, |stroke| stroke.carries.unwrap_or(0.0)),
            Some(contract.pits),
            Some(ponds(self.truth.heights())?),
            Some(mean_slope_ratio(&output, &truth, valid)?),
            Some(slope_distance(&output, &truth, valid)?),
            Some(spectrum_distance(&output, &truth, valid)?),
            Some(curvature_distance(&output, &truth, valid)?),
            Some(sliced_wasserstein(&output, &truth, valid)?),
            Some(geomorphon_distance(&output, &truth, valid)?),
            Some(ssim(&output, &truth, valid, 1.0)?),
            Some(psnr(&output, &truth, valid, 1.0)?),
        ];
        let mut values = values.into_iter();
        Ok(STROKE_SCORES.map(|name| (name, values.next().flatten())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::bundled;

    fn case(strokes: usize, seed: u64) -> StrokeCase {
        let dem = bundled::load("sierra").unwrap();
        StrokeCase::new(&dem, Cell::new(0, 384), 128, Some(strokes), None, Seed(seed)).unwrap()
    }

    #[test]
    fn truths_lie_beside_what_is_learned() {
        assert_eq!([512, 640, 896].map(|cols| StrokeCase::west_of(cols, 256)), [256, 320, 448]);
        assert_eq!([512, 640, 896].map(|cols| StrokeCase::west_of(cols, 512)), [256, 320, 384]);
        let dem = bundled::load("sierra").unwrap();
        let places = |learned, side| StrokeCase::places(&dem, learned, side);
        assert_eq!(places(256, 256), [Cell::new(0, 256), Cell::new(256, 256)]);
        assert_eq!(places(200, 300), [Cell::new(106, 212)]);
        assert!(places(256, 257).is_empty() && places(0, 513).is_empty());
    }

    #[test]
    fn hands_differ_and_the_truth_is_its_own_best_answer() {
        let (case, other) = (case(4, 1), case(4, 2));
        assert!(case.drawn.strokes.len() <= 4 && case.drawn.strokes.len() > 1);
        assert_ne!(case.drawn, other.drawn);
        let score = |made: &Dem, name: &str| {
            case.scores(made).unwrap().into_iter().find(|(known, _)| *known == name).unwrap().1.unwrap()
        };
        assert_eq!(score(&case.truth, "landform_distance"), 0.0);
        assert_eq!(score(&case.truth, "ponded_share"), score(&case.truth, "truth_ponded_share"));
        assert!(score(&case.truth, "psnr").is_infinite() && score(&case.truth, "valley_recall") > 0.6);
        // Upside down its valleys are elsewhere.
        let (low, high) = case.truth.range();
        let turned = Dem::new(case.truth.heights().map(|z| low + high - z), case.truth.cell_size()).unwrap();
        assert!(score(&turned, "valley_recall") < score(&case.truth, "valley_recall") - 0.2);
        assert!(score(&turned, "stroke_height_error") > 10.0 * score(&case.truth, "stroke_height_error"));
        assert!((score(&turned, "mean_slope_ratio") - 1.0).abs() < 1e-3);
    }

    #[test]
    fn fewer_cells_to_drain_are_more_lines() {
        let dem = bundled::load("sierra").unwrap();
        let count = |share| {
            let case = StrokeCase::new(&dem, Cell::new(0, 384), 128, None, Some(share), Seed(1)).unwrap();
            case.drawn.rasterize().line_count()
        };
        assert!(count(0.001) > 2 * count(0.006), "{} {}", count(0.001), count(0.006));
        let level = Dem::new(Grid::filled(64, 64, 3.0), dem.cell_size()).unwrap();
        let refused = StrokeCase::new(&level, Cell::new(0, 0), 64, None, None, Seed(1)).err().unwrap();
        assert!(refused.to_string().contains("relief of the truth"));
    }
}
