//! Steady-state landscapes: terrain whose slopes follow the slope-area law of an exemplar and that passes through drawn lines.
//!
//! Heights of an exemplar -> [`LandscapeFit`]; fit + [`LineMap`](crate::sketch::LineMap) -> `solve` -> heights.
//! Where rivers and slopes have had their time, slope falls with drained area, S = k A^-theta (Flint 1974), and terrain is
//! the solution of that law upwards from its base levels (Whipple and Tucker 1999; Braun and Willett 2013; Cordonnier et
//! al. 2016). Here the curve S(A) is read off the exemplar without assuming a power law, drawn valleys are base levels and
//! drawn ridges divides with heights, and the factor k gives way until both are met.
//!
//! `pin` makes any terrain pass through its lines to the bit; `breach` opens what dams its water. Equations and
//! departures: `docs/papers/landscape.md`. Linear in the cells but for the ranking of heights (n log n).

mod breach;
mod config;
mod domain;
mod envelope;
mod fit;
mod noise;
mod pin;
mod slope_area;
mod solve;
mod steady;
#[cfg(test)]
mod tests;

pub(crate) use breach::Breached;
pub use breach::{BreachConfig, breach};
pub use config::LandscapeConfig;
#[cfg(test)]
pub(crate) use config::Level;
pub use fit::LandscapeFit;
pub use pin::pin;
pub use solve::solve;
pub(crate) use solve::solve_until;
