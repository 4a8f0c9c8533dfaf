//! How large a cell is on the ground.

use crate::error::{Error, Result};

/// Side lengths of a cell on the ground, in metres: both positive and finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSize {
    x: f64,
    y: f64,
}

impl CellSize {
    /// `x`: west to east, `y`: north to south, metres.
    ///
    /// # Errors
    /// When a side is not a positive finite number.
    pub fn new(x: f64, y: f64) -> Result<Self> {
        if !(x.is_finite() && y.is_finite() && x > 0.0 && y > 0.0) {
            return Err(Error::value("cell size", format!("{x} x {y} m"), "allowed: positive and finite"));
        }
        Ok(Self { x, y })
    }

    /// A square cell.
    ///
    /// # Errors
    /// When `side` is not a positive finite number.
    pub fn square(side: f64) -> Result<Self> {
        Self::new(side, side)
    }

    /// West to east, metres.
    #[must_use]
    pub const fn x(self) -> f64 {
        self.x
    }

    /// North to south, metres.
    #[must_use]
    pub const fn y(self) -> f64 {
        self.y
    }

    /// The side of the square cell with the same area, metres.
    #[must_use]
    pub fn mean(self) -> f64 {
        (self.x * self.y).sqrt()
    }

    /// For people: "30 m", or "77.82 m west-east, 78.33 m north-south" where the sides differ.
    #[must_use]
    pub fn in_words(self) -> String {
        let text = |side: f64| {
            let text = format!("{side:.2}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        };
        let (x, y) = (text(self.x), text(self.y));
        if x == y { format!("{x} m") } else { format!("{x} m west-east, {y} m north-south") }
    }
}
