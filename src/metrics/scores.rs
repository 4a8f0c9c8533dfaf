//! All scores of one patch.

use super::lines::check_lines;
use super::{
    curvature_distance, line_agreement, mean_slope_ratio, pit_share, psnr, rmse, slope_distance,
    spectrum_distance, ssim, stroke_height_error,
};
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use crate::sketch::{LineMap, StrokeKind};

/// Width of the border strip that is scored apart from the interior, in cells: lines are often missing there.
pub(crate) const BORDER_WIDTH: usize = 8;

/// How far a line found again may lie from one that was asked for, in cells.
pub(crate) const LINE_TOLERANCE: f64 = 2.0;

/// Scores of one output against the truth, both in the unit interval of the truth's own range.
///
/// The output is clipped to [0, 1] first, for every score, as in the study that the figures of this project are compared
/// with; [`clipped_share`](Self::clipped_share) says how much that changed. Voids are left out everywhere.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// Mean structural similarity, range 1; 1 is perfect. `None` where voids leave no window of 11x11 cells.
    pub ssim: Option<f64>,
    /// Peak signal-to-noise ratio, decibels, range 1. Infinite for a perfect copy (written as `"inf"`).
    #[serde(with = "unbounded")]
    pub psnr: f64,
    /// Root mean square error, unit heights.
    pub rmse: f64,
    /// [`psnr`](Self::psnr) of the strip of [`BORDER_WIDTH`] cells along the frame; `None` when all of it is void.
    #[serde(with = "unbounded_option")]
    pub border_psnr: Option<f64>,
    /// [`psnr`](Self::psnr) of the rest; `None` when there is none.
    #[serde(with = "unbounded_option")]
    pub interior_psnr: Option<f64>,
    /// [`ssim`](Self::ssim) of the same, windows that reach into the strip left out; `None` when no window is left.
    pub interior_ssim: Option<f64>,
    /// Share of the valid cells whose height lay outside [0, 1].
    pub clipped_share: f64,
    /// Mean slope over that of the truth: see [`mean_slope_ratio`].
    pub mean_slope_ratio: f64,
    /// Distance of the slopes' distributions: see [`slope_distance`].
    pub slope_distance: f64,
    /// Distance of the curvatures' distributions: see [`curvature_distance`].
    pub curvature_distance: f64,
    /// Distance of the radial power spectra, decibels: see [`spectrum_distance`].
    pub spectrum_distance: f64,
    /// Share of cells that are pits: see [`pit_share`].
    pub pit_share: f64,
    /// The same in the truth.
    pub truth_pit_share: f64,
    /// Root mean square height error on the lines, unit heights; `None` without lines.
    pub stroke_height_error: Option<f64>,
    /// F1 of the ridges found again; `None` before [`with_lines`](Self::with_lines), and without ridges.
    pub ridge_f1: Option<f64>,
    /// F1 of the valleys found again, likewise.
    pub valley_f1: Option<f64>,
    /// Share of the line cells found again that nobody asked for (no asked cell of that kind near), likewise.
    pub unasked_share: Option<f64>,
}

impl Scores {
    /// Scores `output` against `truth`, the lines' heights being in the same unit.
    ///
    /// # Errors
    /// When the shapes differ, a valid value is not finite, the truth leaves [0, 1] or is flat, or the valid part is too
    /// small for a score (no 11x11 window).
    pub fn of(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask, lines: &LineMap) -> Result<Self> {
        super::check_pair(output, truth, valid)?;
        check_lines("sketch", lines, truth.shape())?;
        // Rounding of the normalisation is forgiven, another unit is not.
        let allowed = -1e-4..=1.0 + 1e-4;
        if let Some((cell, z)) = truth.cells().find(|(cell, z)| valid[*cell] && !allowed.contains(*z)) {
            return Err(Error::value(
                format!("truth at row {}, column {}", cell.row, cell.col),
                z,
                "allowed: 0 to 1, by the truth's own range",
            ));
        }
        let outside = |(z, ok): (&f32, &bool)| *ok && !(0.0..=1.0).contains(z);
        let clipped = output.as_slice().iter().zip(valid.as_slice()).filter(|pair| outside(*pair)).count();
        let cells = valid.as_slice().iter().filter(|ok| **ok).count();
        let output = &output.map(|z| z.clamp(0.0, 1.0));
        let border = strip(valid, true);
        let interior = strip(valid, false);
        let part = |part: &Mask| -> Result<Option<f64>> {
            if part.as_slice().contains(&true) { psnr(output, truth, part, 1.0).map(Some) } else { Ok(None) }
        };
        Ok(Self {
            // The shapes and values are checked by the next: this fails only when no window is left.
            ssim: ssim(output, truth, valid, 1.0).ok(),
            psnr: psnr(output, truth, valid, 1.0)?,
            rmse: rmse(output, truth, valid)?,
            border_psnr: part(&border)?,
            interior_psnr: part(&interior)?,
            // The shapes and values are checked: this fails only when no window is left.
            interior_ssim: ssim(output, truth, &interior, 1.0).ok(),
            clipped_share: clipped as f64 / cells as f64,
            mean_slope_ratio: mean_slope_ratio(output, truth, valid)?,
            slope_distance: slope_distance(output, truth, valid)?,
            curvature_distance: curvature_distance(output, truth, valid)?,
            spectrum_distance: spectrum_distance(output, truth, valid)?,
            pit_share: pit_share(output, valid)?,
            truth_pit_share: pit_share(truth, valid)?,
            stroke_height_error: stroke_height_error(output, valid, lines)?,
            ridge_f1: None,
            valley_f1: None,
            unasked_share: None,
        })
    }

    /// Adds how well lines extracted again from the output agree with those that were asked for.
    ///
    /// # Errors
    /// When the shapes differ.
    pub fn with_lines(mut self, asked: &LineMap, found: &LineMap) -> Result<Self> {
        let ridges = line_agreement(asked, found, StrokeKind::Ridge, LINE_TOLERANCE)?;
        let valleys = line_agreement(asked, found, StrokeKind::Valley, LINE_TOLERANCE)?;
        self.ridge_f1 = ridges.map(super::LineAgreement::f1);
        self.valley_f1 = valleys.map(super::LineAgreement::f1);
        let count = |kind| found.mask_of(kind).as_slice().iter().filter(|line| **line).count() as f64;
        let (mut unasked, mut all) = (0.0, 0.0);
        for (agreement, count) in [(ridges, count(StrokeKind::Ridge)), (valleys, count(StrokeKind::Valley))] {
            unasked += agreement.map_or(0.0, |a| (1.0 - a.precision) * count);
            all += count;
        }
        self.unasked_share = (all > 0.0).then(|| unasked / all);
        Ok(self)
    }

    /// The names of all scores, in the order of the fields.
    #[must_use]
    pub fn names() -> [&'static str; 17] {
        let none = Self {
            ssim: None,
            psnr: 0.0,
            rmse: 0.0,
            border_psnr: None,
            interior_psnr: None,
            interior_ssim: None,
            clipped_share: 0.0,
            mean_slope_ratio: 0.0,
            slope_distance: 0.0,
            curvature_distance: 0.0,
            spectrum_distance: 0.0,
            pit_share: 0.0,
            truth_pit_share: 0.0,
            stroke_height_error: None,
            ridge_f1: None,
            valley_f1: None,
            unasked_share: None,
        };
        none.values().map(|(name, _)| name)
    }

    /// Every score with its name, in the order of the fields.
    #[must_use]
    pub fn values(&self) -> [(&'static str, Option<f64>); 17] {
        [
            ("ssim", self.ssim),
            ("psnr", Some(self.psnr)),
            ("rmse", Some(self.rmse)),
            ("border_psnr", self.border_psnr),
            ("interior_psnr", self.interior_psnr),
            ("interior_ssim", self.interior_ssim),
            ("clipped_share", Some(self.clipped_share)),
            ("mean_slope_ratio", Some(self.mean_slope_ratio)),
            ("slope_distance", Some(self.slope_distance)),
            ("curvature_distance", Some(self.curvature_distance)),
            ("spectrum_distance", Some(self.spectrum_distance)),
            ("pit_share", Some(self.pit_share)),
            ("truth_pit_share", Some(self.truth_pit_share)),
            ("stroke_height_error", self.stroke_height_error),
            ("ridge_f1", self.ridge_f1),
            ("valley_f1", self.valley_f1),
            ("unasked_share", self.unasked_share),
        ]
    }
}

/// The valid cells of the border strip, or those inside it.
fn strip(valid: &Mask, border: bool) -> Mask {
    let (rows, cols) = valid.shape();
    Mask::from_fn(rows, cols, |cell| {
        let inside = |i: usize, side: usize| i >= BORDER_WIDTH && i + BORDER_WIDTH < side;
        valid[cell] && (inside(cell.row, rows) && inside(cell.col, cols)) != border
    })
}

/// Numbers that may be infinite, which JSON cannot write: those become `"inf"` or `"-inf"`.
mod unbounded {
    use serde::{Deserialize, Deserializer, Serializer};

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        Number(f64),
        Text(String),
    }

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() {
            serializer.serialize_f64(*value)
        } else {
            serializer.serialize_str(&value.to_string())
        }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        match Written::deserialize(deserializer)? {
            Written::Number(value) => Ok(value),
            Written::Text(text) => text.parse().map_err(serde::de::Error::custom),
        }
    }
}

/// [`unbounded`] for numbers that may be missing.
mod unbounded_option {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(transparent)]
    struct Unbounded(#[serde(with = "super::unbounded")] f64);

    pub(super) fn serialize<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        value.map(Unbounded).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
        Ok(Option::<Unbounded>::deserialize(deserializer)?.map(|value| value.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, Window};

    fn truth() -> Grid<f32> {
        Grid::from_fn(32, 40, |c| 0.5 + 0.25 * ((c.row as f32 * 0.5).sin() + (c.col as f32 * 0.3).cos()))
    }

    fn lines(shift: usize) -> LineMap {
        let truth = truth();
        let mut lines = LineMap::empty(32, 40);
        for row in 4..28 {
            let (ridge, valley) = (Cell::new(row, 10 + shift), Cell::new(row, 30));
            lines.set(ridge, StrokeKind::Ridge, truth[ridge]);
            lines.set(valley, StrokeKind::Valley, truth[valley]);
        }
        lines
    }

    #[test]
    fn a_copy_is_perfect_and_survives_json() {
        let truth = truth();
        let valid = truth.map(|_| true);
        let scores =
            Scores::of(&truth, &truth, &valid, &lines(0)).unwrap().with_lines(&lines(0), &lines(0)).unwrap();
        assert!((scores.ssim.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!((scores.psnr, scores.border_psnr), (f64::INFINITY, Some(f64::INFINITY)));
        assert_eq!((scores.rmse, scores.mean_slope_ratio, scores.spectrum_distance), (0.0, 1.0, 0.0));
        assert_eq!(
            (scores.ridge_f1, scores.valley_f1, scores.unasked_share),
            (Some(1.0), Some(1.0), Some(0.0))
        );
        let json = serde_json::to_string(&scores).unwrap();
        assert!(json.contains("\"psnr\":\"inf\""));
        assert_eq!(serde_json::from_str::<Scores>(&json).unwrap(), scores);
        let bare = Scores::of(&truth, &truth, &valid, &LineMap::empty(32, 40)).unwrap();
        assert_eq!((bare.stroke_height_error, bare.ridge_f1), (None, None));
        assert_eq!(serde_json::from_str::<Scores>(&serde_json::to_string(&bare).unwrap()).unwrap(), bare);
    }

    #[test]
    fn the_strip_and_the_interior_are_scored_apart() {
        let truth = truth();
        let valid = truth.map(|_| true);
        let output = Grid::from_fn(32, 40, |c| {
            let inside = (8..24).contains(&c.row) && (8..32).contains(&c.col);
            // Towards the middle, so that nothing is clipped.
            truth[c] + (if inside { 0.01 } else { 0.1 }) * (if truth[c] > 0.5 { -1.0 } else { 1.0 })
        });
        let scores = Scores::of(&output, &truth, &valid, &lines(0)).unwrap();
        assert!((scores.border_psnr.unwrap() - 20.0).abs() < 1e-3);
        assert!((scores.interior_psnr.unwrap() - 40.0).abs() < 1e-3);
        // That of the inner cells alone, as if they were all there is.
        let cut = |grid: &Grid<f32>| grid.crop(Window::new(Cell::new(8, 8), 16, 24)).unwrap();
        let alone = ssim(&cut(&output), &cut(&truth), &cut(&truth).map(|_| true), 1.0).unwrap();
        assert!((scores.interior_ssim.unwrap() - alone).abs() < 1e-9, "{scores:?} {alone}");
        assert!(scores.interior_ssim > scores.ssim);
        let small = truth.crop(Window::square(Cell::new(0, 0), 20)).unwrap();
        let none = Scores::of(&small, &small, &small.map(|_| true), &LineMap::empty(20, 20)).unwrap();
        assert_eq!(none.interior_ssim, None);
    }

    #[test]
    fn clipping_is_counted_and_other_units_are_refused() {
        let truth = truth();
        let valid = truth.map(|_| true);
        let mut output = truth.clone();
        (output[Cell::new(3, 3)], output[Cell::new(3, 4)]) = (-7.0, 1.5);
        let scores = Scores::of(&output, &truth, &valid, &lines(0)).unwrap();
        assert_eq!(scores.clipped_share, 2.0 / 1280.0);
        assert!(scores.rmse < 1.0);
        let metres = truth.map(|z| 1000.0 * z);
        let message = Scores::of(&metres, &metres, &valid, &lines(0)).unwrap_err().to_string();
        assert!(message.contains("allowed: 0 to 1"), "{message}");
        let elsewhere = scores.with_lines(&lines(0), &lines(5)).unwrap();
        assert_eq!((elsewhere.ridge_f1, elsewhere.valley_f1), (Some(0.0), Some(1.0)));
        assert_eq!(elsewhere.unasked_share, Some(0.5));
    }

    #[test]
    fn voids_count_in_no_score() {
        let truth = truth();
        let mut valid = truth.map(|_| true);
        let mut output = truth.clone();
        for cell in [Cell::new(2, 10), Cell::new(20, 10), Cell::new(5, 11)] {
            (output[cell], valid[cell]) = (f32::NAN, false);
        }
        let scores = Scores::of(&output, &truth, &valid, &lines(0)).unwrap();
        let copy = Scores::of(&truth, &truth, &valid, &lines(0)).unwrap();
        assert_eq!(scores, copy);
    }
}
