//! Plots as SVG: [`Curves`] (training curves) and [`ScorePlot`] (scores of several systems), each readable alone.

mod axis;
mod canvas;
mod curves;
mod scores;
mod svg;

pub use canvas::{GRID, INK, SERIES, SOFT_INK};
pub use curves::{Curves, Panel};
pub use scores::{Better, ScorePlot};
pub use svg::Svg;
