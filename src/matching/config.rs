//! The choices that the paper leaves open, or answers twice.

use crate::error::{Error, Result};

/// To which angles a part may be turned before shapes are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RotationStep {
    /// Multiples of pi/4, as the text says (5.3).
    #[default]
    EighthTurn,
    /// Multiples of pi/2, as Algorithm A1, line 11, says.
    QuarterTurn,
}

/// Which of the finalists is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Choice {
    /// Any, with equal chances, by the seed (Algorithm A2, line 12; a source of variety, 7.3).
    #[default]
    Random,
    /// The one with the smallest height difference (Algorithm A2, line 13).
    Closest,
}

/// How drawn parts find their exemplar parts. The defaults are the paper's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MatchConfig {
    /// Angles by which a part may be turned.
    pub(crate) rotation: RotationStep,
    /// How many parts with the longest common shape go on (Algorithm A2, line 10): 10.
    pub(crate) candidates: usize,
    /// How many of those, with the smallest height difference, the answer is chosen from (Algorithm A2, line 12): 5.
    pub(crate) finalists: usize,
    /// How one of them is chosen.
    pub(crate) choice: Choice,
    /// Whether a ridge may only match a ridge and a valley a valley. The paper does not say; a ridge's neighbourhood
    /// falls away on both sides, so another kind makes no sense as a model.
    pub(crate) same_kind: bool,
}

impl Default for MatchConfig {
    fn default() -> Self {
        Self {
            rotation: RotationStep::default(),
            candidates: 10,
            finalists: 5,
            choice: Choice::default(),
            same_kind: true,
        }
    }
}

impl MatchConfig {
    /// # Errors
    /// When `finalists` is 0 or above `candidates`.
    pub(crate) fn validate(&self) -> Result<()> {
        if self.finalists == 0 || self.finalists > self.candidates {
            return Err(Error::value(
                "match.finalists",
                self.finalists,
                format!("allowed: 1 to match.candidates ({})", self.candidates),
            ));
        }
        Ok(())
    }
}
