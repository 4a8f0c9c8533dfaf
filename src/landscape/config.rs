//! What the solver may be asked.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// One resolution of the solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Level {
    /// Cells of the map along the side of a cell: 1, 2 or 4.
    pub(crate) factor: usize,
    /// Steps of the iteration.
    pub(crate) iterations: usize,
}

/// How a landscape is solved. Lengths are in cells of the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LandscapeConfig {
    /// From coarse to fine.
    pub(crate) levels: Vec<Level>,
    /// Hillslopes end where this many cells of the exemplar drain through a cell.
    pub(crate) channel_head: f64,
    /// Standard deviation of the smoothing that stands for creep on hillslopes.
    pub(crate) creep: f64,
    /// Spread of the preferences by which a cell chooses its receiver (ln).
    pub(crate) scatter: f64,
    /// Spread of ln k between the lines, relative to the exemplar's.
    pub(crate) variety: f64,
    /// Height of the first surface's relief between the lines, relative to the room between ridges and valleys.
    pub(crate) amplitude: f64,
}

impl Default for LandscapeConfig {
    /// To the map's own cells.
    fn default() -> Self {
        let levels = [(4, 24), (2, 12), (1, 8)];
        Self {
            levels: levels.map(|(factor, iterations)| Level { factor, iterations }).to_vec(),
            channel_head: 20.0,
            creep: 0.8,
            scatter: 0.5,
            variety: 0.25,
            amplitude: 0.35,
        }
    }
}

impl LandscapeConfig {
    /// Down to cells of twice the map's side: the large forms at a fraction of the time, to guide another system.
    #[must_use]
    pub fn guide() -> Self {
        let mut config = Self::default();
        config.levels.pop();
        config
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of range.
    pub(crate) fn validate(&self) -> Result<()> {
        let falls = self.levels.windows(2).all(|pair| pair[0].factor > pair[1].factor);
        let known = self.levels.iter().all(|l| [1, 2, 4].contains(&l.factor) && l.iterations > 0);
        if self.levels.is_empty() || !falls || !known {
            return Err(Error::value(
                "landscape levels",
                format!("{:?}", self.levels),
                "allowed: factors 4, 2, 1 in this order, each with at least one iteration",
            ));
        }
        let ranges = [
            ("channel_head", self.channel_head, 1.0, 1e6),
            ("creep", self.creep, 0.0, 8.0),
            ("scatter", self.scatter, 0.0, 2.0),
            ("variety", self.variety, 0.0, 4.0),
            ("amplitude", self.amplitude, 0.0, 2.0),
        ];
        match ranges.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => {
                Err(Error::value(format!("landscape {name}"), value, format!("allowed: {low} to {high}")))
            }
            None => Ok(()),
        }
    }
}
