//! Where a raster lies on the Earth.

/// Whether a raster's coordinates name the corner of a cell or its centre (GeoTIFF `GTRasterTypeGeoKey`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RasterSpace {
    /// A height stands for the area of its cell; the tiepoint names the cell's outer corner.
    PixelIsArea,
    /// A height stands for a point; the tiepoint names the cell's centre.
    PixelIsPoint,
}

/// The affine map from raster to model coordinates, and the coordinate system that they are in.
///
/// `transform = [a, b, c, d, e, f]`: x = a col + b row + c, y = d col + e row + f, for raster positions in which the
/// *outer corner* of the north-west cell is (0, 0) and its centre (0.5, 0.5), whatever [`RasterSpace`] the file used.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Georeference {
    /// The affine coefficients.
    pub transform: [f64; 6],
    /// EPSG code of the coordinate system, when the file names one.
    pub epsg: Option<u32>,
    /// How the file placed its heights; kept so that writing gives back what was read.
    pub raster_space: RasterSpace,
}

impl Georeference {
    /// Model coordinates (x, y) of a raster position whose cell centres are at (col + 0.5, row + 0.5).
    #[must_use]
    pub fn to_model(&self, col: f64, row: f64) -> (f64, f64) {
        let [a, b, c, d, e, f] = self.transform;
        (a * col + b * row + c, d * col + e * row + f)
    }

    /// Raster position (col, row) of model coordinates: the inverse of [`to_model`](Self::to_model); `None` when the
    /// transform is singular.
    #[must_use]
    pub fn to_raster(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let [a, b, c, d, e, f] = self.transform;
        let det = a * e - b * d;
        if det == 0.0 || !det.is_finite() {
            return None;
        }
        let (x, y) = (x - c, y - f);
        Some(((e * x - b * y) / det, (a * y - d * x) / det))
    }

    /// The same ground in cells a `factor`-th as large along both sides.
    #[must_use]
    pub fn refined(&self, factor: f64) -> Self {
        let [a, b, x, d, e, y] = self.transform;
        Self { transform: [a / factor, b / factor, x, d / factor, e / factor, y], ..*self }
    }

    /// The same raster after cutting away `rows` in the north and `cols` in the west.
    #[must_use]
    pub fn shifted(&self, rows: usize, cols: usize) -> Self {
        let (x, y) = self.to_model(cols as f64, rows as f64);
        let [a, b, _, d, e, _] = self.transform;
        Self { transform: [a, b, x, d, e, y], ..*self }
    }
}
