//! States of the pixels: at first one of three, later one each.

/// Pixel states entering a round.
#[derive(Clone, Copy)]
pub(super) enum PixelStates<'a> {
    /// f^(0) = MLP_0 of the indicator, which takes three values (A.3).
    Table {
        /// (pixels) row of the table.
        class: &'a [u8],
        /// (3, H)
        rows: &'a [f32],
    },
    /// (pixels, H)
    Full(&'a [f32]),
}

/// The values of the indicator, by class: beside the lines, ridge, valley.
pub(super) const INDICATORS: [f32; 3] = [0.0, 1.0, -1.0];

/// Class of every pixel.
pub(super) fn classes(indicator: &[f32]) -> Vec<u8> {
    let class = |value: &f32| match *value {
        v if v > 0.0 => 1,
        v if v < 0.0 => 2,
        _ => 0,
    };
    indicator.iter().map(class).collect()
}

impl PixelStates<'_> {
    /// The state of one pixel: (H).
    #[inline(always)]
    pub(super) fn row(&self, pixel: usize, width: usize) -> &[f32] {
        let (values, row) = match self {
            PixelStates::Table { class, rows } => (*rows, usize::from(class[pixel])),
            PixelStates::Full(values) => (*values, pixel),
        };
        &values[row * width..(row + 1) * width]
    }
}
