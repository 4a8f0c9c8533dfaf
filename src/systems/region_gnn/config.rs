//! Every choice of the model in one struct: `Default` is `anchored` (ours), [`RegionGnnConfig::paper`] is Liu & Benes 2025.

use crate::error::{Error, Result};
use crate::sketch::PartLengths;
use serde::{Deserialize, Serialize};

/// The system's name in files and on the command line.
pub(super) const NAME: &str = "gnn";

/// The two named configurations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Heights relative to an interpolation of the sketch, losses through the correction: transfers between patches.
    Anchored,
    /// Absolute heights from an embedding a part, as published.
    Paper,
}

/// What an edge knows of where its pixel lies beside the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeGeometry {
    /// Projection index and distance (paper, A.4).
    Projection,
    /// Also the position in the part's own frame, along and across, at three frequencies; rotation-invariant, and unlike
    /// the distance it tells left from right.
    LocalFrame,
}

/// What a height of 1/2 out of the network means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeightFrame {
    /// The network's output is the height in the unit interval (paper).
    Absolute,
    /// The output is a deviation from an interpolation of the sketch ([`Base`]), in units of the sketch's own relief, and
    /// edges carry the height of their part in the same units: offset- and scale-free.
    Anchored,
}

/// The surface from which an anchored model deviates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Base {
    /// Laplace interpolation of the sketch.
    Laplace,
    /// Natural-neighbour interpolation of the sketch.
    NaturalNeighbour,
}

/// How messages arriving at a node are pooled inside `Enc` (paper, A.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pooling {
    /// Mean over the neighbours.
    Mean,
    /// Sum over the neighbours, as printed.
    Sum,
}

/// Which code moves the messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// One pass over the edges, nothing stored per edge.
    #[default]
    Fused,
    /// The literal formula in tensor operations: slow, the oracle of the fused one.
    Plain,
}

/// Weights of the six losses (paper, Eq. 3; the paper gives no values).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossWeights {
    /// Mean squared height difference (Eq. 4, as a mean).
    pub(crate) ground_truth: f64,
    /// 1 - SSIM.
    pub(crate) ssim: f64,
    /// Sum over pixels and neighbours of the squared difference of squared slopes.
    pub(crate) gradient: f64,
    /// Ridges above, valleys below their surroundings (Eq. 5).
    pub(crate) sketch: f64,
    /// Mean height difference of pixel pairs at offsets up to 2.
    pub(crate) smooth: f64,
    /// Influence of lines at pixels more than 6 px away; only where heights are absolute.
    pub(crate) further: f64,
}

impl Default for LossWeights {
    fn default() -> Self {
        Self { ground_truth: 10.0, ssim: 1.0, gradient: 0.5, sketch: 0.01, smooth: 0.01, further: 0.01 }
    }
}

/// Everything that decides how the model is built, trained and used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegionGnnConfig {
    /// Meaning of the network's output.
    pub frame: HeightFrame,
    /// The surface from which an anchored model deviates.
    pub base: Base,
    /// Features of an edge.
    pub geometry: EdgeGeometry,
    /// Nearest parts of a pixel (4.2: 10).
    pub neighbours: usize,
    /// Random pixel-part edges, drawn anew each epoch (4.2: 10,000 at 128x128).
    pub random_edges: usize,
    /// Message-passing iterations T (Eq. 1).
    pub iterations: usize,
    /// Width of the hidden states (4.3: 32).
    pub width: usize,
    /// Length of a part's trainable embedding (A.4); 0 for none.
    pub embedding: usize,
    /// Sum or mean inside `Enc` (A.5).
    pub pooling: Pooling,
    /// Layer normalisation after each gather (`paper` only; `docs/papers/region_gnn.md`).
    pub normalize: bool,
    /// Standard deviation of the noise on edges and first region states (A.3, A.4: 1).
    pub noise: f64,
    /// Share of the parts that are masked in a training step (A.2: 5 %).
    pub masked: f64,
    /// Different extractions of the exemplar to train on; 1 is the paper's. From the ninth to the sixteenth they are
    /// thin: a model that is to work from few lines needs them.
    pub extractions: usize,
    /// Training steps.
    pub epochs: usize,
    /// Ends the training when the smoothed loss has not fallen by a thousandth for so many epochs; 0 never does.
    pub patience: usize,
    /// Highest learning rate.
    pub learning_rate: f64,
    /// Weights of the losses.
    pub losses: LossWeights,
    /// Take the losses after the natural-neighbour correction, so that the network learns only what the correction
    /// cannot do.
    pub loss_after_correction: bool,
    /// Part splits of the same lines that are averaged when terrain is generated.
    pub splits: usize,
    /// How lines are cut into parts (4.1: 5 to 10 cells). Runs shorter than that are kept, so that what a user drew
    /// counts; the paper drops them. Ours have 2 to 4 cells (`docs/papers/region_gnn.md`).
    pub parts: PartLengths,
    /// Which code moves the messages; no effect on the result beyond rounding.
    pub kernel: Kernel,
}

impl Default for RegionGnnConfig {
    fn default() -> Self {
        Self {
            frame: HeightFrame::Anchored,
            base: Base::NaturalNeighbour,
            geometry: EdgeGeometry::LocalFrame,
            neighbours: 10,
            random_edges: 10_000,
            iterations: 1,
            width: 32,
            embedding: 0,
            pooling: Pooling::Mean,
            normalize: false,
            noise: 1.0,
            masked: 0.05,
            extractions: 16,
            epochs: 1200,
            patience: 0,
            learning_rate: 1e-2,
            losses: LossWeights::default(),
            loss_after_correction: true,
            splits: 3,
            parts: PartLengths { min: 2, max: 4, ..PartLengths::drawn() },
            kernel: Kernel::Fused,
        }
    }
}

impl RegionGnnConfig {
    /// The published model; departures (mean pooling, local-frame geometry, learning rate and number of epochs) are
    /// argued in `docs/papers/region_gnn.md`.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            frame: HeightFrame::Absolute,
            iterations: 2,
            embedding: 32,
            normalize: true,
            extractions: 1,
            epochs: 500,
            learning_rate: 2e-2,
            loss_after_correction: false,
            splits: 1,
            parts: PartLengths::drawn(),
            ..Self::default()
        }
    }

    /// A named configuration.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Anchored => Self::default(),
            Preset::Paper => Self::paper(),
        }
    }

    /// Checks every field against its range.
    ///
    /// # Errors
    /// Names the first field that is out of range.
    pub(crate) fn validate(&self) -> Result<()> {
        let count = |name: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(Error::value(name, value, format!("allowed: {low} to {high}")))
            }
        };
        count("neighbours", self.neighbours, 1, 64)?;
        count("random_edges", self.random_edges, 0, 10_000_000)?;
        count("iterations", self.iterations, 1, 8)?;
        count("embedding", self.embedding, 0, 256)?;
        count("extractions", self.extractions, 1, 64)?;
        if self.embedding > 0 && self.extractions > 1 {
            let allowed =
                "a model with an embedding a part learns from one extraction: 1, or model.embedding=0";
            return Err(Error::value("extractions", self.extractions, allowed));
        }
        count("epochs", self.epochs, 1, 1_000_000)?;
        count("patience", self.patience, 0, 1_000_000)?;
        count("splits", self.splits, 1, 64)?;
        if ![16, 32, 64].contains(&self.width) {
            return Err(Error::value("width", self.width, "allowed: 16, 32, 64"));
        }
        self.parts.validate()?;
        let real = |name: &str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(Error::value(name, value, format!("allowed: {low} to {high}")))
            }
        };
        real("learning_rate", self.learning_rate, 1e-8, 1.0)?;
        real("noise", self.noise, 0.0, 100.0)?;
        real("masked", self.masked, 0.0, 0.9)?;
        let w = &self.losses;
        for (name, value) in [
            ("losses.ground_truth", w.ground_truth),
            ("losses.ssim", w.ssim),
            ("losses.gradient", w.gradient),
            ("losses.sketch", w.sketch),
            ("losses.smooth", w.smooth),
            ("losses.further", w.further),
        ] {
            real(name, value, 0.0, 1e6)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid_and_bad_values_are_named() {
        for preset in [Preset::Anchored, Preset::Paper] {
            RegionGnnConfig::preset(preset).validate().unwrap();
        }
        assert_eq!(RegionGnnConfig::paper().parts, PartLengths { min: 5, max: 10, keep_short: true });
        let bad = RegionGnnConfig { width: 33, ..Default::default() };
        assert!(bad.validate().unwrap_err().to_string().contains("width is 33"));
        let bad = RegionGnnConfig { extractions: 8, ..RegionGnnConfig::paper() };
        assert!(bad.validate().unwrap_err().to_string().contains("embedding"));
        let bad = RegionGnnConfig { learning_rate: f64::NAN, ..Default::default() };
        assert!(bad.validate().unwrap_err().to_string().contains("learning_rate"));
    }

    #[test]
    fn round_trips_through_toml_and_refuses_unknown_keys() {
        let text = toml::to_string(&RegionGnnConfig::paper()).unwrap();
        assert_eq!(toml::from_str::<RegionGnnConfig>(&text).unwrap(), RegionGnnConfig::paper());
        assert!(toml::from_str::<RegionGnnConfig>("widht = 3").is_err());
    }
}
