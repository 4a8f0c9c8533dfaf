//! What a hand draws: [`Stroke`]s of ridges and valleys with heights, the raster of them, and their parts.

mod line_map;
mod part;
mod stroke;

pub use line_map::LineMap;
pub use part::{PartId, SketchPart};
pub use stroke::{Sketch, Stroke, StrokeKind, Vertex};
