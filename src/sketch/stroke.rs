//! Strokes and the sketch that they make.

use crate::error::{Error, Result};

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

impl Sketch {
    /// The largest map that is accepted, in cells: the size may come from a file that nobody has checked.
    pub const LARGEST: usize = 1 << 28;

    /// A sketch that is sure to be [valid](Self::validate).
    ///
    /// # Errors
    /// See [`validate`](Self::validate).
    pub fn new(rows: usize, cols: usize, strokes: Vec<Stroke>) -> Result<Self> {
        let sketch = Self { rows, cols, strokes };
        sketch.validate()?;
        Ok(sketch)
    }

    /// Checks what every step after this relies on. A sketch without strokes is valid (the lines of a plain); strokes
    /// may lie off the map.
    ///
    /// # Errors
    /// When a side of the map is 0, the map has more than [`LARGEST`](Self::LARGEST) cells, a stroke has no vertex, or
    /// a coordinate or height is not finite (heights: as a 32-bit number).
    pub fn validate(&self) -> Result<()> {
        let cells = self.rows.checked_mul(self.cols);
        if !cells.is_some_and(|n| (1..=Self::LARGEST).contains(&n)) {
            return Err(Error::value(
                "size of the sketch",
                format!("{}x{}", self.rows, self.cols),
                format!("allowed: at least 1x1, at most {} cells", Self::LARGEST),
            ));
        }
        for (i, stroke) in self.strokes.iter().enumerate() {
            if stroke.vertices.is_empty() {
                return Err(Error::value(
                    format!("number of vertices of stroke {}", i + 1),
                    0,
                    "allowed: at least one",
                ));
            }
            for (j, v) in stroke.vertices.iter().enumerate() {
                let name = |what| format!("{what} of stroke {}, vertex {}", i + 1, j + 1);
                if !(v.x.is_finite() && v.y.is_finite()) {
                    return Err(Error::value(
                        name("position"),
                        format!("({}, {})", v.x, v.y),
                        "allowed: finite",
                    ));
                }
                if !(v.z as f32).is_finite() {
                    return Err(Error::value(name("height"), v.z, "allowed: finite"));
                }
            }
        }
        Ok(())
    }

    /// Lowest and highest vertex; `None` without strokes.
    #[must_use]
    pub fn height_range(&self) -> Option<(f64, f64)> {
        let mut heights = self.strokes.iter().flat_map(|s| &s.vertices).map(|v| v.z);
        let first = heights.next()?;
        Some(heights.fold((first, first), |(lo, hi), z| (lo.min(z), hi.max(z))))
    }

    /// The same drawing stretched onto a map of another size, frame to frame; heights stay.
    #[must_use]
    pub fn scaled_to(&self, rows: usize, cols: usize) -> Self {
        let (sy, sx) = (rows as f64 / self.rows as f64, cols as f64 / self.cols as f64);
        let mut scaled = Self { rows, cols, ..self.clone() };
        for v in scaled.strokes.iter_mut().flat_map(|s| &mut s.vertices) {
            (v.x, v.y) = ((v.x + 0.5) * sx - 0.5, (v.y + 0.5) * sy - 0.5);
        }
        scaled
    }

    /// The same drawing with `f` applied to every height (for example metres to unit).
    #[must_use]
    pub fn map_heights(&self, mut f: impl FnMut(f64) -> f64) -> Self {
        let mut mapped = self.clone();
        mapped.strokes.iter_mut().flat_map(|s| &mut s.vertices).for_each(|v| v.z = f(v.z));
        mapped
    }
}
