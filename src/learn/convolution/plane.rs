//! Images for convolution: channels last, with a frame of zeros where a kernel reaches past the edge.

/// Values of (rows, cols, channels), the channels of a pixel side by side, inside a frame of `border` cells of zeros.
///
/// The gradient of a convolution's output wears a frame of two: the input's gradient is then a convolution like any other.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    values: Vec<f32>,
    rows: usize,
    cols: usize,
    channels: usize,
    border: usize,
}

impl Plane {
    /// Zeros.
    ///
    /// # Panics
    /// When a side is 0.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize, channels: usize, border: usize) -> Self {
        assert!(rows > 0 && cols > 0 && channels > 0, "a plane has at least one value");
        let values = vec![0.0; (rows + 2 * border) * (cols + 2 * border) * channels];
        Self { values, rows, cols, channels, border }
    }

    /// A plane without a frame.
    ///
    /// # Panics
    /// When the number of values does not fit.
    #[must_use]
    pub fn from_values(rows: usize, cols: usize, channels: usize, values: Vec<f32>) -> Self {
        assert_eq!(values.len(), rows * cols * channels, "a plane of {rows}x{cols}x{channels}");
        Self { values, rows, cols, channels, border: 0 }
    }

    /// Rows inside the frame.
    #[must_use]
    pub(crate) const fn rows(&self) -> usize {
        self.rows
    }

    /// Columns inside the frame.
    #[must_use]
    pub(crate) const fn cols(&self) -> usize {
        self.cols
    }

    /// Channels of a pixel.
    #[must_use]
    pub(crate) const fn channels(&self) -> usize {
        self.channels
    }

    /// Width of the frame, cells.
    #[must_use]
    pub(crate) const fn border(&self) -> usize {
        self.border
    }

    /// (rows, columns) with the frame.
    #[must_use]
    pub(crate) const fn stored(&self) -> (usize, usize) {
        (self.rows + 2 * self.border, self.cols + 2 * self.border)
    }

    /// All values with the frame, row by row.
    #[must_use]
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// All values with the frame. Who writes into the frame is its own judge.
    pub(crate) fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// All values with the frame, row by row.
    #[must_use]
    pub(crate) fn into_values(self) -> Vec<f32> {
        self.values
    }

    /// The values of a row inside the frame, (cols, channels).
    #[must_use]
    pub(crate) fn row(&self, row: usize) -> &[f32] {
        let start = self.start_of(row);
        &self.values[start..start + self.cols * self.channels]
    }

    /// The values of a row inside the frame, (cols, channels).
    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let start = self.start_of(row);
        &mut self.values[start..start + self.cols * self.channels]
    }

    fn start_of(&self, row: usize) -> usize {
        ((row + self.border) * (self.cols + 2 * self.border) + self.border) * self.channels
    }
}

/// What a convolution reads: an image as it is stored, its frame included, wherever it is.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    pub(super) values: &'a [f32],
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) channels: usize,
}

impl<'a> Image<'a> {
    /// Values of (rows, cols, channels).
    ///
    /// # Panics
    /// When the number of values does not fit.
    #[must_use]
    pub(crate) fn new(rows: usize, cols: usize, channels: usize, values: &'a [f32]) -> Self {
        assert_eq!(values.len(), rows * cols * channels, "an image of {rows}x{cols}x{channels}");
        Self { values, rows, cols, channels }
    }
}

impl<'a> From<&'a Plane> for Image<'a> {
    fn from(plane: &'a Plane) -> Self {
        let (rows, cols) = plane.stored();
        Self { values: plane.values(), rows, cols, channels: plane.channels }
    }
}
