//! Every setting of the detail model's training; [`DetailConfig::default`] is ours, [`DetailConfig::paper`] the published one.

use crate::checked::Settings;
use crate::error::{Error, Result};
pub(crate) use crate::learn::layers::Start;
use serde::{Deserialize, Serialize};

/// The system's name in files and on the command line.
pub(super) const NAME: &str = "generators";

/// What the networks are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum View {
    /// Heights themselves, -1 to 1, padded with zeros; noise is added to them (SinGAN, Eq. 3).
    Heights,
    /// Differences to the eastern and southern neighbour over the exemplar's root mean square slope at that scale, the frame
    /// repeated outwards; the generator has noise as a third channel. Ours: blind to elevation, so that what was learned at the
    /// foot of a mountain also fits its top, and as loud at fine scales as at coarse ones.
    Slopes,
}

/// Learning rate over the steps of a scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Decay {
    /// A tenth after 80 % of the steps (SinGAN's published code).
    Late,
    /// Half a cosine down to a hundredth.
    Cosine,
}

/// Settings of the pyramid, the networks and their training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DetailConfig {
    /// Shorter side of the coarsest scale, cells (25).
    pub coarsest: usize,
    /// Size of a scale over that of the next finer one, near which the real factor is chosen (.75).
    pub factor: f64,
    /// Channels of the four coarsest scales: 32 or 64 (32).
    pub(crate) width: usize,
    /// Channels of the finer scales (64 in the paper).
    pub(crate) fine_width: usize,
    /// Batch normalisation in both networks (yes in the paper).
    pub(crate) batch_norm: bool,
    /// What the networks are shown.
    pub(crate) view: View,
    /// How weights begin; a generator's last layer at a tenth of it in `scaled`, so that a scale begins near the identity.
    pub(crate) start: Start,
    /// Whether the exemplar's rotations and reflections count as its own.
    pub(crate) symmetric: bool,
    /// Share of the training samples that begin with the exemplar at some coarser scale instead of noise (0 in the paper).
    pub(crate) injected: f32,
    /// Share of the reconstructions that begin with a coarse twin of the exemplar instead of the fixed noise (0 in the paper).
    pub(crate) paired: f32,
    /// Training steps of a scale (2000).
    pub steps: usize,
    /// Critic updates a step (3).
    pub(crate) critic_steps: usize,
    /// Generator updates a step (3).
    pub(crate) generator_steps: usize,
    /// Learning rate (5e-4).
    pub(crate) learning_rate: f32,
    /// Adam's first beta (.5); the second is .999.
    pub(crate) momentum: f32,
    /// How the learning rate falls.
    pub(crate) decay: Decay,
    /// Weight of the gradient penalty (.1).
    pub(crate) penalty: f32,
    /// Weight of the squared reconstruction error (10). Heights are -1 to 1; in the view of slopes, multiples of the
    /// root mean square slope a cell.
    pub(crate) reconstruction: f32,
    /// Weight of the paper's l_gradient in the reconstruction (Liu & Benes, 4.4 and 6.1; they give no weight).
    pub(crate) gradient: f32,
    /// Noise over the root mean square error of the enlarged reconstruction (.1), in the view of heights.
    pub(crate) noise: f32,
}

impl Default for DetailConfig {
    fn default() -> Self {
        Self {
            coarsest: 25,
            factor: 0.75,
            width: 32,
            fine_width: 32,
            batch_norm: false,
            view: View::Slopes,
            start: Start::Scaled,
            symmetric: true,
            injected: 0.75,
            paired: 0.5,
            steps: 600,
            critic_steps: 1,
            generator_steps: 1,
            learning_rate: 1e-3,
            momentum: 0.5,
            decay: Decay::Cosine,
            penalty: 0.1,
            reconstruction: 3.0,
            gradient: 0.0,
            noise: 0.1,
        }
    }
}

impl DetailConfig {
    /// SinGAN as published, one channel, with the paper's gradient loss (Liu & Benes 2025, 4.4).
    #[must_use]
    pub(crate) fn paper() -> Self {
        Self {
            fine_width: 64,
            batch_norm: true,
            view: View::Heights,
            start: Start::Published,
            symmetric: false,
            injected: 0.0,
            paired: 0.0,
            steps: 2000,
            critic_steps: 3,
            generator_steps: 3,
            learning_rate: 5e-4,
            decay: Decay::Late,
            reconstruction: 10.0,
            gradient: 1.0,
            ..Self::default()
        }
    }

    /// Learning rate after a share of a scale's training.
    pub(super) fn rate(&self, share: f32) -> f32 {
        self.learning_rate
            * match self.decay {
                Decay::Late => {
                    if share < 0.8 {
                        1.0
                    } else {
                        0.1
                    }
                }
                Decay::Cosine => 0.01 + 0.99 * 0.5 * (1.0 + (std::f32::consts::PI * share).cos()),
            }
    }

    /// Relative cost of a training step at every scale, the coarsest first: for progress bars.
    #[must_use]
    pub(crate) fn work(&self, rows: usize, cols: usize) -> Vec<u64> {
        let cost = |(i, (r, c)): (usize, (usize, usize))| {
            let width = if i < 4 { self.width } else { self.fine_width };
            ((r + 6) * (c + 6) * width * width / 4096) as u64 + 1
        };
        self.pyramid(rows, cols).into_iter().enumerate().map(cost).collect()
    }

    /// (rows, columns) of every scale of an exemplar, the coarsest first (SinGAN's published code).
    pub(super) fn pyramid(&self, rows: usize, cols: usize) -> Vec<(usize, usize)> {
        let ratio = self.coarsest as f64 / rows.min(cols) as f64;
        if ratio >= 1.0 {
            return vec![(rows, cols)];
        }
        let steps = (ratio.ln() / self.factor.ln()).ceil() as i32 + 1;
        let factor = ratio.powf(1.0 / f64::from(steps));
        (0..=steps).rev().map(|n| shrunk((rows, cols), factor.powi(n))).collect()
    }
}

/// A size times a factor, rounded up but for rounding errors.
pub(super) fn shrunk((rows, cols): (usize, usize), factor: f64) -> (usize, usize) {
    let side = |n: usize| ((n as f64 * factor - 1e-6).ceil() as usize).max(1);
    (side(rows), side(cols))
}

impl Settings for DetailConfig {
    fn validate(&self) -> Result<()> {
        let count = |name: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::value(format!("detail.{name}"), value, format!("allowed: {low} to {high}")))
        };
        count("coarsest", self.coarsest, 16, 256)?;
        count("steps", self.steps, 1, 1_000_000)?;
        count("critic_steps", self.critic_steps, 1, 100)?;
        count("generator_steps", self.generator_steps, 1, 100)?;
        for (name, width) in [("width", self.width), ("fine_width", self.fine_width)] {
            if width != 32 && width != 64 {
                return Err(Error::value(format!("detail.{name}"), width, "allowed: 32, 64"));
            }
        }
        let number = |name: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::value(format!("detail.{name}"), value, format!("allowed: {low} to {high}")))
        };
        number("factor", self.factor, 0.3, 0.9)?;
        number("injected", f64::from(self.injected), 0.0, 1.0)?;
        number("paired", f64::from(self.paired), 0.0, 1.0)?;
        number("learning_rate", f64::from(self.learning_rate), 1e-7, 1.0)?;
        number("momentum", f64::from(self.momentum), 0.0, 0.999)?;
        number("penalty", f64::from(self.penalty), 0.0, 1e6)?;
        number("reconstruction", f64::from(self.reconstruction), 0.0, 1e6)?;
        number("gradient", f64::from(self.gradient), 0.0, 1e6)?;
        number("noise", f64::from(self.noise), 0.0, 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_pyramid() {
        let sides: Vec<usize> = DetailConfig::paper().pyramid(128, 128).iter().map(|s| s.0).collect();
        assert_eq!(sides, [25, 32, 40, 51, 64, 81, 102, 128]);
        assert_eq!(DetailConfig::default().pyramid(20, 30), [(20, 30)]);
    }

    #[test]
    fn presets_are_valid_and_bad_fields_are_named() {
        DetailConfig::default().validate().unwrap();
        DetailConfig::paper().validate().unwrap();
        let bad = DetailConfig { fine_width: 48, ..DetailConfig::default() };
        assert!(bad.validate().unwrap_err().to_string().contains("detail.fine_width is 48"));
        let text = toml::to_string(&DetailConfig::paper()).unwrap();
        assert_eq!(toml::from_str::<DetailConfig>(&text).unwrap(), DetailConfig::paper());
        assert!(toml::from_str::<DetailConfig>("stepps = 3").is_err());
    }
}
