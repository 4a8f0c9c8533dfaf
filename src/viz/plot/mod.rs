//! Plots as SVG: [`Curves`] (training curves), [`ScorePlot`] (scores of several systems) and [`Scatter`] (points in a plane), each
//! readable alone.

mod axis;
mod canvas;
mod curves;
mod scatter;
mod scores;
mod svg;

pub use canvas::{GRID, INK, SERIES, SOFT_INK};
pub use curves::{Curves, Panel};
pub use scatter::Scatter;
pub use scores::{Better, ScorePlot};
pub use svg::Svg;
