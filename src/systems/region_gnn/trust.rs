//! How far to believe an anchored model on a sketch, from the sketch alone.
//!
//! Strokes are dealt into a few groups. Each group in turn is kept from the model, which then rebuilds the terrain from the
//! others; the heights on the strokes that it did not see say how much of its deviation from the base was right:
//!
//! ```text
//! trust = sum (m - b) (z - b) / sum (m - b)^2       over held-out cells; z height, b base, m model; cut to 0..1
//! ```
//!
//! the least-squares factor of the deviation, drawn towards 1 by as much as [`PRIOR`] strokes would. Ours, not in the
//! paper: a model of one exemplar may meet relief that it does not know, above all between few lines, and there the
//! base is the better answer. Cost: one pass of the model a group.

use crate::grid::Cell;
use crate::seed::Seed;
use crate::sketch::{LineMap, Sketch};
use rand::RngExt;

/// Strokes that a belief in the model is worth before any is held out.
const PRIOR: f64 = 5.0;

/// A sketch without some of its strokes.
pub(super) struct Kept {
    /// What is left, at least one line cell.
    pub(super) lines: LineMap,
    /// Number of strokes left out, at least one.
    held_out: usize,
}

/// `lines` without each of `folds` groups of its strokes in turn. Groups that are empty or hold everything are left out.
pub(super) fn without_each_fold(lines: &LineMap, folds: usize, seed: Seed) -> Vec<Kept> {
    let strokes = Sketch::trace(lines).strokes;
    let mut stream = seed.stream("folds");
    let fold_of: Vec<usize> = strokes.iter().map(|_| stream.random_range(0..folds)).collect();
    let (rows, cols) = lines.shape();
    let without = |fold: usize| {
        let mut kept = LineMap::empty(rows, cols);
        for (stroke, _) in strokes.iter().zip(&fold_of).filter(|(_, f)| **f != fold) {
            for vertex in &stroke.vertices {
                let cell = Cell::new(vertex.y as usize, vertex.x as usize);
                kept.set(cell, stroke.kind, lines.heights()[cell]);
            }
        }
        Kept { lines: kept, held_out: fold_of.iter().filter(|f| **f == fold).count() }
    };
    (0..folds).map(without).filter(|k| k.held_out > 0 && k.lines.line_count() > 0).collect()
}

/// What the held-out strokes said so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    /// Sum of (m - b) (z - b).
    confirmed: f64,
    /// Sum of (m - b)^2.
    moved: f64,
    strokes: usize,
}

impl Evidence {
    /// Adds the line cells of `lines` that `kept` does not have. `base`, `model`: heights, one a pixel.
    pub(super) fn add(&mut self, lines: &LineMap, kept: &Kept, base: &[f32], model: &[f32]) {
        let kinds = lines.kinds().as_slice().iter().zip(kept.lines.kinds().as_slice());
        for (i, _) in kinds.enumerate().filter(|(_, (all, kept))| all.is_some() && kept.is_none()) {
            let deviation = f64::from(model[i]) - f64::from(base[i]);
            self.confirmed += deviation * f64::from(lines.heights().as_slice()[i] - base[i]);
            self.moved += deviation * deviation;
        }
        self.strokes += kept.held_out;
    }

    /// The factor of the deviation, 0 to 1; 1 when nothing was held out.
    pub(super) fn trust(&self) -> f32 {
        if self.moved == 0.0 {
            return 1.0;
        }
        let prior = PRIOR / self.strokes as f64 * self.moved;
        ((self.confirmed + prior) / (self.moved + prior)).clamp(0.0, 1.0) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;

    /// Columns of ten cells, three apart.
    fn columns(count: usize) -> LineMap {
        let mut lines = LineMap::empty(12, 3 * count);
        for i in 0..count {
            for row in 1..11 {
                lines.set(Cell::new(row, 3 * i), StrokeKind::Ridge, i as f32);
            }
        }
        lines
    }

    #[test]
    fn every_stroke_is_held_out_once_and_whole() {
        let lines = columns(30);
        let folds = without_each_fold(&lines, 4, Seed(1));
        let mut missing = vec![0; lines.kinds().len()];
        for kept in &folds {
            let mut cells = 0;
            for (i, kind) in kept.lines.kinds().as_slice().iter().enumerate() {
                let held_out = kind.is_none() && lines.kinds().as_slice()[i].is_some();
                missing[i] += usize::from(held_out);
                cells += usize::from(held_out);
            }
            assert_eq!(cells, 10 * kept.held_out);
        }
        for (n, kind) in missing.iter().zip(lines.kinds().as_slice()) {
            assert_eq!(*n, usize::from(kind.is_some()));
        }
        assert!(without_each_fold(&columns(1), 4, Seed(1)).is_empty());
    }

    #[test]
    fn trust_is_the_confirmed_share_of_the_deviation() {
        let lines = columns(40);
        let folds = without_each_fold(&lines, 4, Seed(1));
        let base: Vec<f32> = lines.kinds().as_slice().iter().map(|_| 5.0).collect();
        let trust = |factor: f32| {
            let truth = lines.heights().as_slice();
            let model: Vec<f32> = base.iter().zip(truth).map(|(b, z)| b + factor * (z - b)).collect();
            let mut evidence = Evidence::default();
            folds.iter().for_each(|kept| evidence.add(&lines, kept, &base, &model));
            evidence.trust()
        };
        assert!((trust(1.0) - 1.0).abs() < 1e-6);
        // Twice too far: one half, drawn towards 1 by 5 strokes against 40.
        assert!((trust(2.0) - (0.5 + 0.125) / 1.125).abs() < 1e-6, "{}", trust(2.0));
        assert_eq!((trust(-1.0), trust(0.5), Evidence::default().trust()), (0.0, 1.0, 1.0));
    }
}
