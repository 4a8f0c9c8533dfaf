//! Strokes and the sketch that they make.

/// Ridge or valley.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StrokeKind {
    /// A line of locally highest ground.
    Ridge,
    /// A line of locally lowest ground.
    Valley,
}

/// A point of a stroke: raster position with cell centres at whole numbers, and a height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Column; 0 is the centre of the westernmost column.
    pub x: f64,
    /// Row; 0 is the centre of the northernmost row.
    pub y: f64,
    /// Height in metres (or in the unit of whoever built the sketch); finite.
    pub z: f64,
}

/// One line.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// What the line is.
    pub kind: StrokeKind,
    /// Its points in order; at least one.
    pub vertices: Vec<Vertex>,
}

/// Ridges and valleys on a map of `rows` x `cols` cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// Rows of the map.
    pub rows: usize,
    /// Columns of the map.
    pub cols: usize,
    /// The lines.
    pub strokes: Vec<Stroke>,
}
