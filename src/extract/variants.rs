//! Several different extractions of one DEM, so that a model sees its exemplar drawn in more than one way.

use super::ExtractionConfig;
use super::config::MAX_ORDER;
use super::lines::Drained;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use crate::seed::Seed;
use crate::sketch::LineMap;
use rand::Rng;

/// (accumulation as a multiple of the base's, change of the lowest order). The base stands first, then the other seven
/// extractions with which our study trained, then eight thin ones. The base's 12 cells and order 2 give 12, 20, 40, 8, 12
/// (order 3), 30 (order 1), 16, 60 (order 1); 12 (order 4), 20 (3), 60, 8 (4), 40 (3), 30 (3), 120, 16 (4).
const LISTED: [(f64, i8); 16] = [
    (1.0, 0),
    (20.0 / 12.0, 0),
    (40.0 / 12.0, 0),
    (8.0 / 12.0, 0),
    (1.0, 1),
    (30.0 / 12.0, -1),
    (16.0 / 12.0, 0),
    (60.0 / 12.0, -1),
    (1.0, 2),
    (20.0 / 12.0, 1),
    (60.0 / 12.0, 0),
    (8.0 / 12.0, 2),
    (40.0 / 12.0, 1),
    (30.0 / 12.0, 1),
    (10.0, 0),
    (16.0 / 12.0, 2),
];

/// How often a drawn configuration that is already there is drawn anew before it is accepted.
const PATIENCE: usize = 100;

/// The lines of every configuration of [`ExtractionConfig::variants`], routed once for all of them.
///
/// # Errors
/// As [`extract`](super::extract), or when `count` is 0.
pub(crate) fn variants(
    heights: &Grid<f32>,
    valid: &Mask,
    base: &ExtractionConfig,
    count: usize,
    seed: Seed,
) -> Result<Vec<LineMap>> {
    if count == 0 {
        return Err(Error::value("number of extractions", count, "allowed: at least 1"));
    }
    let stop = &Stop::new();
    let drained = Drained::new(heights, valid, base, stop)?;
    base.variants(count, seed).iter().map(|config| Ok(drained.lines(heights, config, stop)?.lines)).collect()
}

impl ExtractionConfig {
    /// `count` configurations that draw the same terrain more or less densely; the first is this one.
    ///
    /// The first eight are those of our study and the next eight thin ones, the same for every seed. Further ones draw their accumulation between 8/12
    /// and 60/12 of this one's (evenly in the logarithm) and their lowest order within one of this one's; repeats are drawn
    /// anew as long as there is something new to find.
    #[must_use]
    pub fn variants(&self, count: usize, seed: Seed) -> Vec<Self> {
        let with = |factor: f64, order: i8| Self {
            min_accumulation: ((f64::from(self.min_accumulation) * factor).round() as u32).max(1),
            min_order: self.min_order.saturating_add_signed(order).clamp(1, MAX_ORDER),
            ..self.clone()
        };
        let mut all: Vec<Self> =
            LISTED.iter().take(count).map(|&(factor, order)| with(factor, order)).collect();
        let mut stream = seed.stream("extraction variants");
        let (sparse, dense) = ((60.0f64 / 12.0).ln(), (8.0f64 / 12.0).ln());
        while all.len() < count {
            let mut draw = || {
                let share = f64::from(stream.next_u32()) / f64::from(u32::MAX);
                with((dense + (sparse - dense) * share).exp(), (stream.next_u32() % 3) as i8 - 1)
            };
            let drawn = (0..PATIENCE).map(|_| draw()).find(|config| !all.contains(config));
            let next = drawn.unwrap_or_else(draw);
            all.push(next);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_sixteen_are_listed() {
        let base = ExtractionConfig::default();
        let limits = |seed| {
            base.variants(16, seed).iter().map(|c| (c.min_accumulation, c.min_order)).collect::<Vec<_>>()
        };
        let studied = [(12, 2), (20, 2), (40, 2), (8, 2), (12, 3), (30, 1), (16, 2), (60, 1)];
        let thin = [(12, 4), (20, 3), (60, 2), (8, 4), (40, 3), (30, 3), (120, 2), (16, 4)];
        assert_eq!(limits(Seed(1)), [studied, thin].concat());
        assert_eq!(limits(Seed(1)), limits(Seed(2)));
        assert_eq!(base.variants(1, Seed(1))[0], base);
    }

    #[test]
    fn further_ones_follow_the_seed_and_do_not_repeat() {
        let base = ExtractionConfig::default();
        let all = base.variants(40, Seed(1));
        assert_eq!(all, base.variants(40, Seed(1)));
        assert_eq!(all[..20], base.variants(20, Seed(1)));
        assert_ne!(all, base.variants(40, Seed(2)));
        for (i, config) in all.iter().enumerate() {
            config.validate().unwrap();
            let (most, highest) = if i < LISTED.len() { (120, 4) } else { (60, 3) };
            assert!(
                (8..=most).contains(&config.min_accumulation) && (1..=highest).contains(&config.min_order)
            );
            assert!(!all[..i].contains(config));
        }
        // With nothing new to find it still ends.
        let narrow = ExtractionConfig { min_accumulation: 1, min_order: 1, ..base };
        assert_eq!(narrow.variants(60, Seed(1)).len(), 60);
    }
}
