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

pub use graph::{SketchEdge, SketchGraph, SketchNode};
pub use line_map::LineMap;
pub use motion::Motion;
pub use part::{PartId, SketchPart};
pub use split::{PartLengths, split_parts};
pub use stroke::{Sketch, Stroke, StrokeKind, Vertex};
pub(crate) use wander::Displacement;
