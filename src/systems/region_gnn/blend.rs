//! How much of an anchored model's deviation to take where, and how much of three other surfaces beside it.
//!
//! ```text
//! z = b + (r c g(x) + (1 - r) g'(x)) (m - b) + sum over j of h_j(r) (u_j - b)
//! c = sqrt(2 rms(u_0 - b) / rms(m - b)), cut to .4 to 1.6; over the inside
//! ```
//!
//! b base, m model, u_j the membrane, the Delaunay planes and the thin plate through the lines; x distance to the nearest line
//! over its mean in the sketch, r 0 at the frame and 1 inside; c takes a model back that moves much farther than the surfaces
//! disagree. Ours, not in the paper: a model of one exemplar moves too far between close lines and not far enough beyond the
//! outermost ones, and where the surfaces differ their differences tell something that the model does not know. The numbers are
//! least squares, of heights and of slopes, over patches of three areas that no training saw (`docs/papers/region_gnn.md`), one
//! set for all sketches; for very thin ones the blend fades (`FADE`). Lines keep their heights, because every surface passes
//! through them.

use crate::control::Stop;
use crate::error::Result;
use crate::grid::{Cell, distance};
use crate::interpolation::{biharmonic_until, delaunay_linear, harmonic_until};
use crate::sketch::LineMap;
use serde::{Deserialize, Serialize};

/// When the blend is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BlendUse {
    /// The model as it is.
    Never,
    /// Where lines lie close ([`DENSE`]): between few drawn strokes it would take the style away.
    Dense,
    /// For every sketch but very thin ones, for which it fades.
    #[default]
    Always,
}

/// A sketch is dense when the mean distance to its nearest line is below this, in cells.
pub(crate) const DENSE: f64 = 3.0;

/// Mean distances to the nearest line, in cells, between which the blend fades: thinner sketches are left to the model and its
/// trust, which are better there.
const FADE: [f64; 2] = [4.5, 7.0];

/// Frame distances, in cells, between which the numbers for the border give way to those for the inside.
const BORDER: [f64; 2] = [4.0, 12.0];
/// Knots of x, between which the shares run evenly in its logarithm.
const KNOTS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Share of the model's deviation at the knots, inside.
const INSIDE: [f64; 4] = [0.78, 0.67, 0.55, 0.38];
/// The same at the border.
const AT_BORDER: [f64; 4] = [0.82, 0.83, 0.97, 1.23];
/// Shares of membrane, Delaunay planes and plate, inside.
const SURFACES_INSIDE: [f64; 3] = [-0.31, 0.0, -0.09];
/// The same at the border.
const SURFACES_AT_BORDER: [f64; 3] = [-0.13, 0.26, -0.06];

/// rms(u_0 - b) / rms(m - b) at which c is 1.
const TYPICAL: f64 = 0.5;
/// Least and greatest c.
const CAUTION: [f64; 2] = [0.4, 1.6];

/// What the blend needs to know of a sketch.
#[derive(Clone, Debug)]
pub(super) struct Blend {
    /// How much of the blend is taken, above 0; 1 but for thin sketches.
    amount: f32,
    /// (inside, at the border) shares of the model's deviation, one a pixel; the first without the caution c.
    share: Vec<[f32; 2]>,
    /// 1 inside, 0 at the border, between them between; 0 on lines.
    inside: Vec<f32>,
    /// Membrane above the base, one height a pixel.
    membrane: Vec<f32>,
    /// What the other surfaces add, one height a pixel.
    others: Vec<f32>,
}

impl Blend {
    /// The blend for `lines`; none when it is not to be taken. `base`: heights, one a pixel.
    ///
    /// # Errors
    /// When a surface cannot be found, or it is stopped.
    pub(super) fn new(wanted: BlendUse, lines: &LineMap, base: &[f32], stop: &Stop) -> Result<Option<Self>> {
        if wanted == BlendUse::Never {
            return Ok(None);
        }
        let mask = lines.mask();
        let distances = distance::squared(&mask).map(|&d| f64::from(d).sqrt());
        let mean = distances.as_slice().iter().sum::<f64>() / distances.len() as f64;
        // Lines everywhere leave nothing to blend.
        let amount = ((FADE[1] - mean) / (FADE[1] - FADE[0])).clamp(0.0, 1.0);
        if mean == 0.0 || amount == 0.0 || wanted == BlendUse::Dense && mean >= DENSE {
            return Ok(None);
        }
        let heights = lines.heights().map(|&z| f64::from(z));
        let membrane = harmonic_until(&mask, &heights, stop)?;
        let plate = biharmonic_until(&mask, &heights, stop)?;
        let planes = delaunay_linear(lines)?;
        let (rows, cols) = lines.shape();
        let mut blend = Self {
            amount: amount as f32,
            share: Vec::new(),
            inside: Vec::new(),
            membrane: Vec::new(),
            others: Vec::new(),
        };
        for ((cell, &d), &base) in distances.cells().zip(base) {
            let inside = inside(cell, (rows, cols));
            let x = d / mean;
            let (inner, border) = (inside * at_knots(&INSIDE, x), (1.0 - inside) * at_knots(&AT_BORDER, x));
            blend.share.push([amount * inner, 1.0 - amount + amount * border].map(|s| s as f32));
            blend.inside.push(if d > 0.0 { inside as f32 } else { 0.0 });
            let above = [membrane[cell], f64::from(planes[cell]), plate[cell]].map(|z| z - f64::from(base));
            blend.membrane.push(above[0] as f32);
            let weights = SURFACES_AT_BORDER.iter().zip(SURFACES_INSIDE);
            let weights = weights.map(|(border, inner)| border + inside * (inner - border));
            blend.others.push((amount * weights.zip(above).map(|(w, z)| w * z).sum::<f64>()) as f32);
        }
        Ok(Some(blend))
    }

    /// How much of the blend is taken: 1, or less for thin sketches.
    pub(super) fn amount(&self) -> f32 {
        self.amount
    }

    /// The blended heights of a model's, one a pixel.
    pub(super) fn apply(&self, base: &[f32], model: &[f32]) -> Vec<f32> {
        let deviation: Vec<f32> = model.iter().zip(base).map(|(m, b)| m - b).collect();
        let caution = self.caution(&deviation);
        let shares = self.share.iter().map(|[inner, border]| caution * inner + border);
        let moved = shares.zip(&deviation).zip(&self.others).map(|((share, d), other)| share * d + other);
        base.iter().zip(moved).map(|(b, moved)| b + moved).collect()
    }

    /// c of the head of this file; 1 where the model does not move at all.
    fn caution(&self, deviation: &[f32]) -> f32 {
        let energy = |heights: &[f32]| -> f64 {
            heights.iter().zip(&self.inside).map(|(z, inside)| f64::from(inside * z * z)).sum()
        };
        let (surfaces, moved) = (energy(&self.membrane), energy(deviation));
        if moved == 0.0 {
            return 1.0;
        }
        ((surfaces / moved).sqrt() / TYPICAL).sqrt().clamp(CAUTION[0], CAUTION[1]) as f32
    }
}

/// 0 near the frame, 1 inside.
fn inside(cell: Cell, (rows, cols): (usize, usize)) -> f64 {
    let to_frame = cell.row.min(cell.col).min(rows - 1 - cell.row).min(cols - 1 - cell.col);
    ((to_frame as f64 - BORDER[0]) / (BORDER[1] - BORDER[0])).clamp(0.0, 1.0)
}

/// The value at `x` of what takes `values` at [`KNOTS`].
fn at_knots(values: &[f64; 4], x: f64) -> f64 {
    let place = (x.max(KNOTS[0]) / KNOTS[0]).log2().min(3.0);
    let low = (place as usize).min(2);
    values[low] + (place - low as f64) * (values[low + 1] - values[low])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;

    /// Columns `apart` cells from each other, on a plane.
    fn columns(apart: usize) -> LineMap {
        let mut lines = LineMap::empty(40, 48);
        for col in (0..48).step_by(apart) {
            (0..40).for_each(|row| lines.set(Cell::new(row, col), StrokeKind::Ridge, (row + 2 * col) as f32));
        }
        lines
    }

    fn mean_distance(lines: &LineMap) -> f64 {
        let squared = distance::squared(&lines.mask());
        squared.as_slice().iter().map(|&d| f64::from(d).sqrt()).sum::<f64>() / squared.len() as f64
    }

    #[test]
    fn shares_run_evenly_between_their_knots() {
        for (knot, value) in KNOTS.iter().zip(INSIDE) {
            assert!((at_knots(&INSIDE, *knot) - value).abs() < 1e-12);
        }
        let between = at_knots(&INSIDE, 2.0f64.sqrt());
        assert!((between - 0.5 * (INSIDE[1] + INSIDE[2])).abs() < 1e-12);
        assert_eq!(at_knots(&INSIDE, 99.0), INSIDE[3]);
        assert_eq!([inside(Cell::new(3, 20), (40, 48)), inside(Cell::new(20, 35), (40, 48))], [0.0, 1.0]);
        assert_eq!(inside(Cell::new(20, 39), (40, 48)), 0.5);
    }

    #[test]
    fn lines_keep_heights_and_models_their_share() {
        let lines = columns(5);
        let blend =
            Blend::new(BlendUse::Always, &lines, lines.heights().as_slice(), &Stop::new()).unwrap().unwrap();
        assert!(blend.inside.iter().zip(lines.kinds().as_slice()).all(|(w, k)| k.is_none() || *w == 0.0));
        // The model moves free cells by 1. Two cells from the lines; the mean distance is about 6 / 5 of a cell.
        let raised = |by: f32| -> Vec<f32> {
            let cells = lines.kinds().as_slice().iter().zip(lines.heights().as_slice());
            cells.map(|(kind, z)| z + if kind.is_some() { 0.0 } else { by }).collect()
        };
        let got = blend.apply(lines.heights().as_slice(), &raised(1.0));
        for (i, kind) in lines.kinds().as_slice().iter().enumerate().filter(|(_, kind)| kind.is_some()) {
            assert!((got[i] - lines.heights().as_slice()[i]).abs() < 1e-3, "{kind:?} {i}");
        }
        let middle = 20 * 48 + 22;
        let still = blend.apply(lines.heights().as_slice(), lines.heights().as_slice());
        let share = f64::from(got[middle] - still[middle]);
        let deviation: Vec<f32> =
            lines.kinds().as_slice().iter().map(|kind| if kind.is_some() { 0.0 } else { 1.0 }).collect();
        let want = f64::from(blend.caution(&deviation)) * at_knots(&INSIDE, 2.0 / mean_distance(&lines));
        assert!((share - want).abs() < 1e-3 * want.max(1.0), "{share} and {want}");
    }

    #[test]
    fn a_model_that_moves_too_far_is_taken_back() {
        let lines = columns(5);
        let blend =
            Blend::new(BlendUse::Always, &lines, lines.heights().as_slice(), &Stop::new()).unwrap().unwrap();
        let caution =
            |factor: f32| blend.caution(&blend.membrane.iter().map(|z| factor * z).collect::<Vec<f32>>());
        assert!((caution(2.0) - 1.0).abs() < 1e-5 && (caution(4.0) - 0.5f32.sqrt()).abs() < 1e-5);
        assert_eq!([caution(100.0), caution(0.1), caution(0.0)], [0.4, 1.6, 1.0]);
    }

    #[test]
    fn thin_sketches_are_left_alone_by_dense_blends() {
        let given = |apart: usize, wanted| {
            let lines = columns(apart);
            Blend::new(wanted, &lines, lines.heights().as_slice(), &Stop::new()).unwrap().is_some()
        };
        assert!(given(5, BlendUse::Dense) && given(16, BlendUse::Always));
        assert!(
            !given(16, BlendUse::Dense)
                && !given(47, BlendUse::Always)
                && !given(5, BlendUse::Never)
                && !given(1, BlendUse::Always)
        );
    }
}
