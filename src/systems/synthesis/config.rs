//! What the synthesis can be told.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Widest patch of the search: rows of 2 x 3 + 1 cells fill one register of eight.
pub(super) const WIDEST: usize = 3;

/// One size of the pyramid. Lengths are in cells of that size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LevelConfig {
    /// A patch reaches so far around its centre, 1 to 3.
    pub(crate) radius: usize,
    /// Rounds of search and vote, 1 to 50.
    pub(crate) rounds: usize,
    /// Sweeps of a search, 1 to 50.
    pub(crate) sweeps: usize,
    /// The random search begins with a window of this reach and halves it; absent: the whole exemplar, in any symmetry.
    pub(crate) reach: Option<usize>,
    /// Cost of a neighbour whose source does not go on from the cell's own, as a share of all four (Potts), 0 to 10.
    pub(crate) coherence: f32,
    /// Share of the weights of `guide` that counts here, 0 to 10.
    pub(crate) guide: f32,
    /// Weight of the surface without forms below `flow_sigma`, which says where slopes fall, 0 to 100.
    pub(crate) flow: f32,
    /// Standard deviation of that surface's Gaussian, 0 to 100.
    pub(crate) flow_sigma: f64,
    /// Standard deviation of the votes around a patch's centre, above 0 to 10.
    pub(crate) spread: f64,
    /// Weight of a stroke's height beside a squared gradient, above 0 to 1e6.
    pub(crate) strokes: f64,
    /// Whether the surface is pulled towards the large forms of its guide.
    pub(crate) screened: bool,
}

/// What patches are compared by, beside heights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GuideConfig {
    /// Weight of the membrane through the strokes, beside a landscape model.
    pub(crate) membrane: f32,
    /// The same where there is no landscape model.
    pub(crate) membrane_alone: f32,
    /// Weight of the landscape model's surface.
    pub(crate) landscape: f32,
    /// Weight of the squared difference of the nearness of strokes.
    pub(crate) strokes: f32,
    /// Weight of the squared difference of mean heights: forms stand at the heights where the exemplar has them.
    pub(crate) elevation: f32,
    /// Nearness of a stroke falls to 1/e at this distance, cells of the level.
    pub(crate) nearness: f64,
}

/// The layout of the coarsest size, from large patches placed one by one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct QuiltingConfig {
    /// A patch reaches so far around its centre, 1 to 16 cells.
    pub(crate) radius: usize,
    /// From one patch to the next, 1 to 2 x radius cells.
    pub(crate) step: usize,
    /// Places of the exemplar that are tried for each patch, 1 to 1e7.
    pub(crate) candidates: usize,
    /// One of those within this share of the least cost is drawn, 0 to 10.
    pub(crate) tolerance: f32,
    /// Weight of a stroke's cell beside a cell that a patch has laid.
    pub(crate) strokes: f32,
    /// Cost of a place that is used as often as all would be if use were even.
    pub(crate) usage: f32,
}

/// Every parameter of the synthesis; `Default` holds the values that served best in our measurements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthesisConfig {
    /// From the finest size (cells of the map) to the coarsest, each twice as coarse as the one before: 1 to 6.
    pub(crate) levels: Vec<LevelConfig>,
    /// What patches are compared by.
    pub(crate) guide: GuideConfig,
    /// The coarsest size.
    pub(crate) quilting: QuiltingConfig,
    /// Energy that is added to that of two patches when their difference is divided by it, in the exemplar's mean.
    pub(crate) floor: f32,
    /// A place that is used as often as all would be if use were even costs so much more, as a share.
    pub(crate) usage: f32,
    /// Votes fall to 1/e at this distance between patches.
    pub(crate) vote_scale: f32,
    /// Least and most that the heights of a patch are stretched to fit where the landscape model guides: from .1 to 1, and from 1
    /// to 10.
    pub(crate) stretch: [f32; 2],
    /// Drawings of the exemplar by its own main lines, 1 to 8.
    pub(crate) self_sketches: usize,
    /// Length of strokes, in cells on a map of 256x256, that makes one line a self-sketch.
    pub(crate) line_length: f64,
    /// Most lines of a kind on 256x256 cells of a self-sketch.
    pub(crate) most_lines: usize,
    /// Strokes are displaced by a smooth random field of this root mean square inside the synthesis, cells.
    pub(crate) warp: f64,
    /// Forms larger than this are the landscape model's where the surface is screened, cells.
    pub(crate) cut: f64,
    /// Forms larger than this are the smoothed membrane's where there is no landscape model, cells.
    pub(crate) cut_alone: f64,
    /// Slopes that disagreeing patches lose are given back at most so many times; 1 gives back nothing.
    pub(crate) most_gain: f64,
    /// Weight that keeps the surface where it was where nothing else says its height.
    pub(crate) hold: f64,
}

impl Default for SynthesisConfig {
    fn default() -> Self {
        let level = |radius, rounds, sweeps, reach, coherence, guide, spread, strokes| LevelConfig {
            radius,
            rounds,
            sweeps,
            reach,
            coherence,
            guide,
            flow: 0.0,
            flow_sigma: 0.0,
            spread,
            strokes,
            screened: true,
        };
        Self {
            levels: vec![
                LevelConfig {
                    flow: 0.3,
                    flow_sigma: 8.0,
                    screened: false,
                    ..level(2, 1, 1, Some(4), 0.1, 0.0, 0.8, 2.0)
                },
                LevelConfig { flow: 0.3, flow_sigma: 4.0, ..level(2, 3, 2, Some(16), 0.15, 0.25, 1.0, 4.0) },
                level(3, 4, 2, None, 0.15, 1.0, 1.2, 8.0),
                level(3, 4, 4, None, 0.15, 1.0, 1.5, 20.0),
            ],
            guide: GuideConfig {
                membrane: 0.25,
                membrane_alone: 0.5,
                landscape: 0.5,
                strokes: 6.0,
                elevation: 0.02,
                nearness: 1.5,
            },
            quilting: QuiltingConfig {
                radius: 5,
                step: 5,
                candidates: 15_000,
                tolerance: 0.1,
                strokes: 8.0,
                usage: 0.15,
            },
            floor: 0.3,
            usage: 0.1,
            vote_scale: 0.3,
            stretch: [1.0, 2.0],
            self_sketches: 2,
            line_length: 140.0,
            most_lines: 12,
            warp: 0.7,
            cut: 48.0,
            cut_alone: 96.0,
            most_gain: 1.3,
            hold: 1e-3,
        }
    }
}

impl SynthesisConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of range, its value and what is allowed.
    pub(crate) fn validate(&self) -> Result<()> {
        let number = |name: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            let allowed = format!("allowed: {low} to {high}");
            Err(Error::value(format!("synthesis.{name}"), value, allowed))
        };
        let count = |name: &str, value: usize, low: usize, high: usize| {
            number(name, value as f64, low as f64, high as f64)
        };
        count("levels", self.levels.len(), 1, 6)?;
        for (l, level) in self.levels.iter().enumerate() {
            let own = |name: &str| format!("levels[{l}].{name}");
            count(&own("radius"), level.radius, 1, WIDEST)?;
            count(&own("rounds"), level.rounds, 1, 50)?;
            count(&own("sweeps"), level.sweeps, 1, 50)?;
            count(&own("reach"), level.reach.unwrap_or(1), 1, 1 << 15)?;
            number(&own("coherence"), level.coherence.into(), 0.0, 10.0)?;
            number(&own("guide"), level.guide.into(), 0.0, 10.0)?;
            number(&own("flow"), level.flow.into(), 0.0, 100.0)?;
            number(&own("flow_sigma"), level.flow_sigma, 0.0, 100.0)?;
            number(&own("spread"), level.spread, 0.05, 10.0)?;
            number(&own("strokes"), level.strokes, 1e-6, 1e6)?;
        }
        for (name, value) in [
            ("guide.membrane", self.guide.membrane),
            ("guide.membrane_alone", self.guide.membrane_alone),
            ("guide.landscape", self.guide.landscape),
            ("guide.strokes", self.guide.strokes),
            ("guide.elevation", self.guide.elevation),
            ("quilting.strokes", self.quilting.strokes),
            ("quilting.usage", self.quilting.usage),
            ("usage", self.usage),
        ] {
            number(name, value.into(), 0.0, 1000.0)?;
        }
        number("guide.nearness", self.guide.nearness, 0.1, 100.0)?;
        count("quilting.radius", self.quilting.radius, 1, 16)?;
        count("quilting.step", self.quilting.step, 1, 2 * self.quilting.radius)?;
        count("quilting.candidates", self.quilting.candidates, 1, 10_000_000)?;
        number("quilting.tolerance", self.quilting.tolerance.into(), 0.0, 10.0)?;
        number("floor", self.floor.into(), 1e-6, 100.0)?;
        number("vote_scale", self.vote_scale.into(), 1e-3, 100.0)?;
        number("stretch[0]", self.stretch[0].into(), 0.1, 1.0)?;
        number("stretch[1]", self.stretch[1].into(), 1.0, 10.0)?;
        count("self_sketches", self.self_sketches, 1, 8)?;
        number("line_length", self.line_length, 1.0, 1e6)?;
        count("most_lines", self.most_lines, 1, 1000)?;
        number("warp", self.warp, 0.0, 10.0)?;
        number("cut", self.cut, 1.0, 1e6)?;
        number("cut_alone", self.cut_alone, 1.0, 1e6)?;
        number("most_gain", self.most_gain, 1.0, 10.0)?;
        number("hold", self.hold, 1e-6, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_is_checked_and_named() {
        type Spoil = fn(&mut SynthesisConfig);
        let bad: [(&str, Spoil); 10] = [
            ("levels is 0", |c| c.levels.clear()),
            ("levels[2].radius", |c| c.levels[2].radius = 4),
            ("levels[0].spread", |c| c.levels[0].spread = f64::NAN),
            ("levels[1].reach", |c| c.levels[1].reach = Some(0)),
            ("guide.strokes", |c| c.guide.strokes = -1.0),
            ("quilting.step", |c| c.quilting.step = 11),
            ("floor", |c| c.floor = 0.0),
            ("most_gain", |c| c.most_gain = 0.5),
            ("hold", |c| c.hold = 0.0),
            ("cut_alone", |c| c.cut_alone = 0.5),
        ];
        for (field, spoil) in bad {
            let mut config = SynthesisConfig::default();
            spoil(&mut config);
            let message = config.validate().unwrap_err().to_string();
            assert!(message.contains(&format!("synthesis.{field}")), "{message}");
        }
        SynthesisConfig::default().validate().unwrap();
    }

    #[test]
    fn files_name_what_they_change_and_nothing_unknown() {
        let config: SynthesisConfig = toml::from_str("usage = 0.2").unwrap();
        assert_eq!(config, SynthesisConfig { usage: 0.2, ..Default::default() });
        assert!(toml::from_str::<SynthesisConfig>("usages = 0.2").is_err());
    }
}
