//! What the extraction of lines can be told.

use crate::error::{Error, Result};

/// Highest order that can be asked for; no network on fewer than 2^32 cells reaches it.
pub(super) const MAX_ORDER: u8 = 30;

/// How water finds its way over terrain with pits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Routing {
    /// Along the lowest pass, without raising anything ([`flow::route`](crate::flow::route)).
    LeastCost,
    /// Over terrain whose pits are filled ([`flow::fill`](crate::flow::fill), then [`flow::d8`](crate::flow::d8)).
    Filled,
}

/// Parameters of the extraction of ridges and valleys. Lengths are in cells.
///
/// `Default` holds the values that served best in our measurements; [`paper`](Self::paper) the reading of Liu & Benes
/// 2025, section 4.1, which names the steps and two filters but no other number.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExtractionConfig {
    /// Standard deviation of the Gaussian that smooths the heights before routing, 0 to 100. Not in the paper.
    pub smoothing: f64,
    /// How water gets out of pits. The paper says nothing about pits.
    pub routing: Routing,
    /// Width of the strip by which the terrain is continued past its frame before routing, 0 to 1000; see
    /// [`ridges_and_valleys`](super::ridges_and_valleys). 0 stops all water at the frame. Not in the paper.
    pub margin: usize,
    /// A line cell drains at least this many cells, at least 1. The paper gives no number.
    pub min_accumulation: u32,
    /// Lowest Strahler order that is kept, 1 to 30. The paper orders the lines but names no limit.
    pub min_order: u8,
    /// Reach of the closing's square: 1 is 3x3, 0 closes nothing, up to 100. Paper 4.1, step 1, size not given.
    pub closing: usize,
    /// Connected lines with fewer cells are dropped, at least 1. Paper 4.1: 10.
    pub min_length: usize,
    /// Connected lines whose mean gradient is not above this quantile of all lines' are dropped, 0 (none) to below 1; with
    /// up to 20 lines none are. Paper 4.1: 0.01.
    pub gradient_quantile: f64,
}

impl Default for ExtractionConfig {
    fn default() -> Self {
        Self {
            smoothing: 0.7,
            routing: Routing::LeastCost,
            margin: 32,
            min_accumulation: 12,
            min_order: 2,
            closing: 1,
            min_length: 10,
            gradient_quantile: 0.01,
        }
    }
}

impl ExtractionConfig {
    /// The paper's steps and nothing else: no smoothing, filled pits, no margin; where it gives no number, ours.
    #[must_use]
    pub fn paper() -> Self {
        Self { smoothing: 0.0, routing: Routing::Filled, margin: 0, ..Self::default() }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of range, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        let check = |ok: bool, name: &str, value: &dyn std::fmt::Display, allowed: &str| {
            if ok {
                Ok(())
            } else {
                Err(Error::value(format!("extraction.{name}"), value, format!("allowed: {allowed}")))
            }
        };
        check((0.0..=100.0).contains(&self.smoothing), "smoothing", &self.smoothing, "0 to 100 cells")?;
        check(self.margin <= 1000, "margin", &self.margin, "0 to 1000 cells")?;
        check(self.min_accumulation >= 1, "min_accumulation", &self.min_accumulation, "at least 1 cell")?;
        check((1..=MAX_ORDER).contains(&self.min_order), "min_order", &self.min_order, "1 to 30")?;
        check(self.closing <= 100, "closing", &self.closing, "0 to 100 cells")?;
        check(self.min_length >= 1, "min_length", &self.min_length, "at least 1 cell")?;
        let quantile = self.gradient_quantile;
        check((0.0..1.0).contains(&quantile), "gradient_quantile", &quantile, "0 to below 1")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_is_checked_and_named() {
        type Spoil = fn(&mut ExtractionConfig);
        let bad: [(&str, Spoil); 8] = [
            ("smoothing", |c| c.smoothing = f64::NAN),
            ("smoothing", |c| c.smoothing = -0.1),
            ("margin", |c| c.margin = 1001),
            ("min_accumulation", |c| c.min_accumulation = 0),
            ("min_order", |c| c.min_order = 0),
            ("closing", |c| c.closing = 101),
            ("min_length", |c| c.min_length = 0),
            ("gradient_quantile", |c| c.gradient_quantile = 1.0),
        ];
        for (field, spoil) in bad {
            let mut config = ExtractionConfig::default();
            spoil(&mut config);
            let message = config.validate().unwrap_err().to_string();
            assert!(message.contains(&format!("extraction.{field}")), "{message}");
        }
        ExtractionConfig::default().validate().unwrap();
        ExtractionConfig::paper().validate().unwrap();
    }

    #[test]
    fn files_name_what_they_change_and_nothing_unknown() {
        let config: ExtractionConfig = toml::from_str("min_order = 3\nrouting = \"filled\"").unwrap();
        assert_eq!(config, ExtractionConfig { min_order: 3, routing: Routing::Filled, ..Default::default() });
        assert!(toml::from_str::<ExtractionConfig>("min_ordr = 3").is_err());
    }
}
