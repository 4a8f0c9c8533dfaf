//! Where a raster lies on the Earth.

use super::crs::Crs;

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
    /// The coordinate system itself, where no code names it or the file says more than the code does (a unit of its own).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definition: Option<Crs>,
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
    pub(crate) fn to_raster(self, x: f64, y: f64) -> Option<(f64, f64)> {
        let [a, b, c, d, e, f] = self.transform;
        let det = a * e - b * d;
        if det == 0.0 || !det.is_finite() {
            return None;
        }
        let (x, y) = (x - c, y - f);
        Some(((e * x - b * y) / det, (a * y - d * x) / det))
    }

    /// Whether raster and model coordinates determine each other.
    #[must_use]
    pub(crate) fn is_invertible(&self) -> bool {
        self.transform.iter().all(|v| v.is_finite()) && self.to_raster(0.0, 0.0).is_some()
    }

    /// The same ground on a raster of another shape, frame to frame; shapes are (rows, columns).
    #[must_use]
    pub(crate) fn on_raster(&self, from: (usize, usize), to: (usize, usize)) -> Self {
        let (down, across) = (from.0 as f64 / to.0 as f64, from.1 as f64 / to.1 as f64);
        let [a, b, c, d, e, f] = self.transform;
        Self { transform: [a * across, b * down, c, d * across, e * down, f], ..*self }
    }

    /// The same raster after cutting away `rows` in the north and `cols` in the west.
    #[must_use]
    pub(crate) fn shifted(&self, rows: usize, cols: usize) -> Self {
        let (x, y) = self.to_model(cols as f64, rows as f64);
        let [a, b, _, d, e, _] = self.transform;
        Self { transform: [a, b, x, d, e, y], ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_raster_covers_the_same_ground() {
        let g = Georeference {
            transform: [30.0, 2.0, 500.0, -1.0, -40.0, 900.0],
            epsg: Some(32611),
            definition: None,
            raster_space: RasterSpace::PixelIsArea,
        };
        let fine = g.on_raster((64, 80), (128, 40));
        for (col, row) in [(0.0, 0.0), (80.0, 64.0), (80.0, 0.0), (12.0, 20.0)] {
            assert_eq!(fine.to_model(col / 2.0, row * 2.0), g.to_model(col, row));
        }
    }
}
