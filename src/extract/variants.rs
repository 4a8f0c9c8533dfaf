//! Several different extractions of one DEM, so that a model sees its exemplar drawn in more than one way.

use super::ExtractionConfig;
use super::lines::Drained;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use crate::seed::Seed;
use crate::sketch::LineMap;
use rand::Rng;

/// (accumulation as a multiple of the base's, change of the lowest order) of the eight extractions with which our study
/// trained; the base stands first. The base's 12 cells and order 2 give 12, 20, 40, 8, 12 (order 3), 30 (order 1), 16,
/// 60 (order 1).
const STUDIED: [(f64, i8); 8] = [
    (1.0, 0),
    (20.0 / 12.0, 0),
    (40.0 / 12.0, 0),
    (8.0 / 12.0, 0),
    (1.0, 1),
    (30.0 / 12.0, -1),
    (16.0 / 12.0, 0),
    (60.0 / 12.0, -1),
];

/// `count` extractions of the same heights: first the one that `base` describes, then denser and sparser ones. The first
/// eight are those of our study and the same for every seed; further ones draw their accumulation between 8/12 and 60/12
/// of the base's (evenly in the logarithm) and their lowest order within one of the base's.
///
/// Routing is done once for all of them.
///
/// # Errors
/// As [`extract`](super::extract), or when `count` is 0.
pub fn variants(
    heights: &Grid<f32>,
    valid: &Mask,
    base: &ExtractionConfig,
    count: usize,
    seed: Seed,
) -> Result<Vec<LineMap>> {
    if count == 0 {
        return Err(Error::value("number of extractions", count, "allowed: at least 1"));
    }
    let drained = Drained::new(heights, valid, base)?;
    Ok((0..count).map(|i| drained.lines(heights, &base.variant(i, seed)).lines).collect())
}

impl ExtractionConfig {
    /// The configuration of extraction number `index`; number 0 is this one. See [`variants`].
    #[must_use]
    pub fn variant(&self, index: usize, seed: Seed) -> Self {
        let (factor, order) = STUDIED.get(index).copied().unwrap_or_else(|| {
            let mut stream = seed.derive_indexed("extraction", index).stream("limits");
            let (low, high) = ((8.0f64 / 12.0).ln(), (60.0f64 / 12.0).ln());
            let share = stream.next_u32() as f64 / u32::MAX as f64;
            ((low + (high - low) * share).exp(), (stream.next_u32() % 3) as i8 - 1)
        });
        Self {
            min_accumulation: ((f64::from(self.min_accumulation) * factor).round() as u32).max(1),
            min_order: self.min_order.saturating_add_signed(order).max(1),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_eight_are_the_studied_ones() {
        let base = ExtractionConfig::default();
        let limits: Vec<_> = (0..8)
            .map(|i| base.variant(i, Seed(i as u64)))
            .map(|c| (c.min_accumulation, c.min_order))
            .collect();
        assert_eq!(limits, [(12, 2), (20, 2), (40, 2), (8, 2), (12, 3), (30, 1), (16, 2), (60, 1)]);
    }

    #[test]
    fn further_ones_follow_the_seed() {
        let base = ExtractionConfig::default();
        let drawn = |seed| (8..40).map(|i| base.variant(i, Seed(seed))).collect::<Vec<_>>();
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
        for config in drawn(3) {
            config.validate().unwrap();
            assert!((8..=60).contains(&config.min_accumulation) && (1..=3).contains(&config.min_order));
        }
    }
}
