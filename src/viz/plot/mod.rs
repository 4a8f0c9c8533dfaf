//! Plots as SVG: [`Curves`] (training curves), [`ScorePlot`] (scores of several systems) and [`Scatter`] (points in a plane), each
//! readable alone.

mod axis;
mod canvas;
mod curves;
mod scatter;
mod scores;
mod svg;

pub(crate) use curves::{Curves, Panel};
pub(crate) use scatter::Scatter;
pub(crate) use scores::{Better, ScorePlot};
pub(crate) use svg::Svg;
