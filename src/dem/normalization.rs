//! The map between metres and the unit interval in which the models work.

use super::Dem;
use crate::error::{Error, Result};
use crate::grid::Grid;

/// Heights in metres from `low` to `high` as 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Normalization {
    low: f64,
    high: f64,
}

impl Normalization {
    /// `low` becomes 0 and `high` becomes 1.
    ///
    /// # Errors
    /// When a bound is not finite or `high <= low`.
    pub fn new(low: f64, high: f64) -> Result<Self> {
        if !(low.is_finite() && high.is_finite() && high > low) {
            return Err(Error::value(
                "elevation range",
                format!("{low},{high}"),
                "allowed: two finite heights, the lower one first",
            ));
        }
        Ok(Self { low, high })
    }

    /// The range of a DEM's valid heights; a flat DEM gets a range of one metre.
    #[must_use]
    pub fn of(dem: &Dem) -> Self {
        let (low, high) = dem.range();
        let (low, high) = (f64::from(low), f64::from(high));
        Self { low, high: if high > low { high } else { low + 1.0 } }
    }

    /// The height that becomes 0, metres.
    #[must_use]
    pub const fn low(self) -> f64 {
        self.low
    }

    /// The height that becomes 1, metres.
    #[must_use]
    pub const fn high(self) -> f64 {
        self.high
    }

    /// Metres to unit.
    #[must_use]
    pub fn to_unit(self, metres: f64) -> f64 {
        (metres - self.low) / (self.high - self.low)
    }

    /// Unit to metres.
    #[must_use]
    pub fn to_metres(self, unit: f64) -> f64 {
        self.low + unit * (self.high - self.low)
    }

    /// A DEM's heights in the unit interval; 0 at voids.
    #[must_use]
    pub fn normalize(self, dem: &Dem) -> Grid<f32> {
        let mut unit = dem.heights().map(|&z| self.to_unit(f64::from(z)) as f32);
        for (u, &ok) in unit.as_mut_slice().iter_mut().zip(dem.valid().as_slice()) {
            if !ok {
                *u = 0.0;
            }
        }
        unit
    }

    /// Unit heights in metres: the inverse of [`normalize`](Self::normalize).
    #[must_use]
    pub fn denormalize(self, unit: &Grid<f32>) -> Grid<f32> {
        unit.map(|&z| self.to_metres(f64::from(z)) as f32)
    }
}
