//! Slope and the light that falls on it.
//!
//! Heights with a cell size -> gradients (Horn's 3x3 kernel) -> brightness of a matt surface under the sun (Lambert).
//! Sources: B. K. P. Horn, "Hill shading and the reflectance map", Proc. IEEE 69 (1981); the weights of the
//! multidirectional light are R. Mark's (USGS Open-File Report 92-422). Cost: O(cells).

use crate::dem::CellSize;
use crate::grid::{Cell, Grid, Mask};
use rayon::prelude::*;

/// Rise in metres per metre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gradient {
    /// Rise towards the east.
    pub east: f32,
    /// Rise towards the north.
    pub north: f32,
}

impl Gradient {
    /// Steepness: tangent of the slope angle.
    #[must_use]
    pub fn steepness(self) -> f32 {
        self.east.hypot(self.north)
    }
}

/// Where the light comes from.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Compass direction of the sun in degrees, clockwise from north.
    pub azimuth: f64,
    /// Height above the horizon in degrees, above 0 up to 90.
    pub altitude: f64,
    /// Share of multidirectional light, 0 (one sun) to 1 (four suns, 45 degrees apart, from 90 degrees before to 45
    /// degrees behind the main one, each weighted by how much a slope lies across it).
    pub multidirectional: f64,
}

impl Default for Sun {
    /// North-west at 45 degrees, as relief maps have it, with a third of multidirectional light that opens the slopes
    /// which one sun leaves flat.
    fn default() -> Self {
        Self { azimuth: 315.0, altitude: 45.0, multidirectional: 0.33 }
    }
}

impl Sun {
    /// One sun from the north-west at 45 degrees.
    #[must_use]
    pub fn single() -> Self {
        Self { multidirectional: 0.0, ..Self::default() }
    }

    /// The brightness of flat ground: the sine of the sun's height.
    #[must_use]
    pub fn flat_brightness(self) -> f32 {
        self.altitude.to_radians().sin() as f32
    }

    /// Brightness of a slope, 0 (in its own shadow) to 1 (facing the sun).
    #[must_use]
    pub fn brightness(self, slope: Gradient) -> f32 {
        let (east, north) = (f64::from(slope.east), f64::from(slope.north));
        let length = (1.0 + east * east + north * north).sqrt();
        let (sin_altitude, cos_altitude) = self.altitude.to_radians().sin_cos();
        let from = |azimuth: f64| {
            let (sin, cos) = azimuth.to_radians().sin_cos();
            ((sin_altitude - cos_altitude * (east * sin + north * cos)) / length).max(0.0)
        };
        let single = from(self.azimuth);
        if self.multidirectional == 0.0 {
            return single as f32;
        }
        // The downhill direction; on flat ground the four suns are equal, and the weights sum to 2 for any direction.
        let aspect = (-east).atan2(-north);
        let many = [-90.0, -45.0, 0.0, 45.0].map(|turn| {
            let azimuth = self.azimuth + turn;
            (aspect - azimuth.to_radians()).sin().powi(2) * from(azimuth)
        });
        let many = many.iter().sum::<f64>() / 2.0;
        (single + self.multidirectional * (many - single)) as f32
    }
}

/// Gradient at every cell by Horn's kernel; 0 at voids.
///
/// The kernel is the mean, weighted 1-2-1, of the central differences along three neighbouring rows (or columns). Where
/// the frame or a void takes a neighbour away, that line gives its one-sided difference, or nothing when its middle is
/// missing too: so a plane has one gradient up to its border. `heights` and the sides of `cell_size` are in the same
/// unit; `heights` and `valid` have one shape.
///
/// # Panics
/// When the shapes differ.
#[must_use]
pub fn gradients(heights: &Grid<f32>, valid: &Mask, cell_size: CellSize) -> Grid<Gradient> {
    assert_eq!(heights.shape(), valid.shape(), "heights and mask have one shape");
    let (rows, cols) = heights.shape();
    let mut slopes = Grid::filled(rows, cols, Gradient::default());
    slopes.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, line)| {
        for (col, slope) in line.iter_mut().enumerate() {
            if valid[Cell::new(row, col)] {
                *slope = horn(heights, valid, Cell::new(row, col), cell_size);
            }
        }
    });
    slopes
}

fn horn(heights: &Grid<f32>, valid: &Mask, cell: Cell, size: CellSize) -> Gradient {
    let known = |south: isize, east: isize| {
        let row = cell.row.checked_add_signed(south)?;
        let col = cell.col.checked_add_signed(east)?;
        let there = Cell::new(row, col);
        (row < heights.rows() && col < heights.cols() && valid[there]).then(|| f64::from(heights[there]))
    };
    Gradient {
        east: (weighted_difference(|line, step| known(line, step)) / size.x()) as f32,
        north: (weighted_difference(|line, step| known(-step, line)) / size.y()) as f32,
    }
}

/// Rise a step along three parallel lines, weighted 1-2-1: `at(line, step)`, both -1 to 1, is a height if known.
fn weighted_difference(at: impl Fn(isize, isize) -> Option<f64>) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (line, weight) in [(-1, 1.0), (0, 2.0), (1, 1.0)] {
        let rise = match (at(line, -1), at(line, 0), at(line, 1)) {
            (Some(back), _, Some(ahead)) => (ahead - back) / 2.0,
            (Some(back), Some(here), None) => here - back,
            (None, Some(here), Some(ahead)) => ahead - here,
            _ => continue,
        };
        sum += weight * rise;
        weights += weight;
    }
    if weights > 0.0 { sum / weights } else { 0.0 }
}

/// Brightness at every cell, 0 to 1, of heights times `exaggeration`; voids are as bright as flat ground.
///
/// # Panics
/// When the shapes differ.
#[must_use]
pub fn hillshade(
    heights: &Grid<f32>,
    valid: &Mask,
    cell_size: CellSize,
    sun: Sun,
    exaggeration: f64,
) -> Grid<f32> {
    let k = exaggeration as f32;
    gradients(heights, valid, cell_size)
        .map(|slope| sun.brightness(Gradient { east: slope.east * k, north: slope.north * k }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    /// A plane rising `east` and `north` metres per metre.
    fn plane(rows: usize, cols: usize, size: CellSize, east: f64, north: f64) -> Grid<f32> {
        Grid::from_fn(rows, cols, |c| {
            (100.0 + east * size.x() * c.col as f64 - north * size.y() * c.row as f64) as f32
        })
    }

    fn everywhere(grid: &Grid<f32>) -> Mask {
        grid.map(|_| true)
    }

    #[test]
    fn a_plane_has_its_gradient_everywhere_also_in_the_corners_and_with_oblong_cells() {
        let size = CellSize::new(20.0, 30.0).unwrap();
        let heights = plane(6, 9, size, 0.3, -0.45);
        let mut valid = everywhere(&heights);
        valid[Cell::new(2, 4)] = false;
        for (cell, slope) in gradients(&heights, &valid, size).cells() {
            let expected = if valid[cell] { (0.3, -0.45) } else { (0.0, 0.0) };
            assert_abs_diff_eq!(slope.east, expected.0 as f32, epsilon = 1e-5);
            assert_abs_diff_eq!(slope.north, expected.1 as f32, epsilon = 1e-5);
        }
    }

    #[test]
    fn a_tilted_plane_has_the_brightness_that_geometry_gives() {
        let size = CellSize::square(10.0).unwrap();
        // A slope of 30 degrees that faces the sun (north-west): the angle to a sun at 45 degrees is 15 degrees.
        let tilt = 30f64.to_radians().tan() / 2f64.sqrt();
        let heights = plane(5, 5, size, tilt, -tilt);
        for &light in hillshade(&heights, &everywhere(&heights), size, Sun::single(), 1.0).as_slice() {
            assert_abs_diff_eq!(f64::from(light), 15f64.to_radians().cos(), epsilon = 1e-5);
        }
        // The same slope turned away: 75 degrees.
        let away = plane(5, 5, size, -tilt, tilt);
        for &light in hillshade(&away, &everywhere(&away), size, Sun::single(), 1.0).as_slice() {
            assert_abs_diff_eq!(f64::from(light), 75f64.to_radians().cos(), epsilon = 1e-5);
        }
        // Exaggeration by 2: tan of the slope doubles.
        let steep = (2.0 * 30f64.to_radians().tan()).atan();
        for &light in hillshade(&heights, &everywhere(&heights), size, Sun::single(), 2.0).as_slice() {
            assert_abs_diff_eq!(f64::from(light), (steep - 45f64.to_radians()).cos(), epsilon = 1e-5);
        }
    }

    #[test]
    fn flat_ground_is_uniform_under_any_light() {
        let size = CellSize::square(30.0).unwrap();
        let heights = Grid::filled(4, 7, 812.0f32);
        for multidirectional in [0.0, 0.4, 1.0] {
            let sun = Sun { altitude: 35.0, multidirectional, ..Sun::default() };
            for &light in hillshade(&heights, &everywhere(&heights), size, sun, 3.0).as_slice() {
                assert_abs_diff_eq!(light, sun.flat_brightness(), epsilon = 1e-6);
            }
        }
    }

    proptest! {
        /// Among slopes of one steepness, the one that faces the sun is the brightest.
        #[test]
        fn the_slope_that_faces_the_sun_is_brightest(
            azimuth in 0.0..360.0f64, altitude in 15.0..75.0f64, steepness in 0.05..1.5f64, turn in 5.0..355.0f64,
        ) {
            let sun = Sun { azimuth, altitude, multidirectional: 0.0 };
            let facing = |direction: f64| {
                let (sin, cos) = direction.to_radians().sin_cos();
                Gradient { east: (-steepness * sin) as f32, north: (-steepness * cos) as f32 }
            };
            prop_assert!(sun.brightness(facing(azimuth)) > sun.brightness(facing(azimuth + turn)));
        }

        /// All light stays in 0 to 1, whatever the blend.
        #[test]
        fn brightness_is_bounded(
            east in -50.0..50.0f32, north in -50.0..50.0f32, multidirectional in 0.0..=1.0f64,
        ) {
            let light = Sun { multidirectional, ..Sun::default() }.brightness(Gradient { east, north });
            prop_assert!((0.0..=1.0).contains(&light));
        }
    }
}
