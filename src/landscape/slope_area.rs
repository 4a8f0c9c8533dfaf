//! The two curves of a landscape: slope by drained area, and the factor on it by height.

use serde::{Deserialize, Serialize};

/// Mean slope by drained area: piecewise linear over ln(area), constant past its ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SlopeArea {
    /// Distance of the knots in ln(area in cells of the exemplar); the first one lies at one cell.
    pub(crate) log_step: f64,
    /// Slope (metres a metre) at every knot; positive.
    pub(crate) slopes: Vec<f64>,
    /// Concavity: the exponent of the power law S ~ A^-theta through the knots of channels.
    pub(crate) theta: f64,
}

impl SlopeArea {
    /// Slope where `area` cells of the exemplar drain.
    #[must_use]
    pub(crate) fn slope(&self, area: f64) -> f64 {
        between(&self.slopes, area.max(1.0).ln() / self.log_step)
    }
}

/// What height does to slope: cliffs and benches of flat-lying rock, floors and caps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HeightLaw {
    /// Height of the first class, metres.
    pub(crate) lowest: f64,
    /// Distance of the classes, metres; positive.
    pub(crate) step: f64,
    /// Factor on the slope at every class; positive.
    pub(crate) factors: Vec<f64>,
    /// Share of the variance of the slope factor that height explains.
    pub(crate) explained: f64,
}

/// Linear between knots at whole numbers, constant past the ends.
fn between(knots: &[f64], at: f64) -> f64 {
    let last = knots.len() - 1;
    let at = at.clamp(0.0, last as f64);
    let below = (at as usize).min(last.saturating_sub(1));
    let share = at - below as f64;
    knots[below] * (1.0 - share) + knots[(below + 1).min(last)] * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_linear_between_knots() {
        let law = SlopeArea { log_step: 1.0, slopes: vec![0.8, 0.4, 0.2], theta: 0.7 };
        let found = [0.1, 1.0, 1.5f64.exp(), 2f64.exp(), 1e9].map(|area| law.slope(area));
        for (found, expected) in found.iter().zip([0.8, 0.8, 0.3, 0.2, 0.2]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!([-3.0, 0.0, 9.0].map(|at| between(&[1.5], at)), [1.5; 3]);
    }
}
