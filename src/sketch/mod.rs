//! What a hand draws: [`Stroke`]s of ridges and valleys with heights, the raster of them ([`LineMap`]), and their parts.
//!
//! The path through the room: a [`Sketch`] (read by [`geojson`] or traced from a raster by [`Sketch::trace`])
//! -> [`Sketch::rasterize`] -> [`LineMap`] -> [`split_parts`] -> [`SketchPart`]s.

mod chains;
pub mod geojson;
mod graph;
mod line_map;
mod motion;
mod part;
mod rasterize;
pub mod samples;
mod split;
mod stroke;
mod thinning;
mod trace;
mod wander;

pub(crate) use graph::SketchGraph;
pub use line_map::LineMap;
pub(crate) use motion::Motion;
pub(crate) use part::{PartId, SketchPart};
pub(crate) use split::PartLengths;
pub use split::split_parts;
pub use stroke::{Sketch, Stroke, StrokeKind, Vertex};
pub(crate) use wander::Displacement;
