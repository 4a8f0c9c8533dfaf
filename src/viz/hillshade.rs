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
pub(crate) struct Gradient {
    /// Rise towards the east.
    pub(crate) east: f32,
    /// Rise towards the north.
    pub(crate) north: f32,
}

impl Gradient {
    /// Steepness: tangent of the slope angle.
    #[must_use]
    pub(crate) fn steepness(self) -> f32 {
        self.east.hypot(self.north)
    }
}

/// Where the light comes from.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sun {
    /// Compass direction of the sun in degrees, clockwise from north.
    pub(crate) azimuth: f64,
    /// Height above the horizon in degrees, above 0 up to 90.
    pub(crate) altitude: f64,
    /// Share of multidirectional light, 0 (one sun) to 1 (four suns, 45 degrees apart, from 90 degrees before to 45
    /// degrees behind the main one, each weighted by how much a slope lies across it).
    pub(crate) multidirectional: f64,
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
    #[cfg(test)]
    pub(crate) fn single() -> Self {
        Self { multidirectional: 0.0, ..Self::default() }
    }

    /// The brightness of flat ground: the sine of the sun's height.
    #[must_use]
    pub(crate) fn flat_brightness(self) -> f32 {
        self.altitude.to_radians().sin() as f32
    }

    /// Brightness of a slope, 0 (in its own shadow) to 1 (facing the sun).
    #[must_use]
    #[cfg(test)]
    pub(crate) fn brightness(self, slope: Gradient) -> f32 {
        self.lights().brightness(slope)
    }

    /// The sun with its trigonometry done, for many slopes.
    pub(super) fn lights(self) -> Lights {
        let (sin_altitude, cos_altitude) = self.altitude.to_radians().sin_cos();
        let horizontal =
            [0.0, -90.0, -45.0, 45.0].map(|turn: f64| (self.azimuth + turn).to_radians().sin_cos());
        Lights { horizontal, sin_altitude, cos_altitude, multidirectional: self.multidirectional }
    }
}

/// Directions of light: the main sun first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lights {
    /// (east, north) of unit length.
    horizontal: [(f64, f64); 4],
    sin_altitude: f64,
    cos_altitude: f64,
    multidirectional: f64,
}

impl Lights {
    pub(super) fn brightness(&self, slope: Gradient) -> f32 {
        let (east, north) = (f64::from(slope.east), f64::from(slope.north));
        let steepness = east * east + north * north;
        let upright = 1.0 / (1.0 + steepness).sqrt();
        // Lambert: the surface's normal (-east, -north, 1) times the direction of the light.
        let from = |(x, y): (f64, f64)| {
            ((self.sin_altitude - self.cos_altitude * (east * x + north * y)) * upright).max(0.0)
        };
        let single = from(self.horizontal[0]);
        // On flat ground all suns are equal.
        if self.multidirectional == 0.0 || steepness == 0.0 {
            return single as f32;
        }
        // Weight: the squared sine of the angle between aspect and sun. Over four suns 45 degrees apart it sums to 2.
        let across = |(x, y): (f64, f64)| (east * y - north * x).powi(2) / steepness;
        let many = self.horizontal.iter().map(|&sun| across(sun) * from(sun)).sum::<f64>() / 2.0;
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
pub(crate) fn gradients(heights: &Grid<f32>, valid: &Mask, cell_size: CellSize) -> Grid<Gradient> {
    assert_eq!(heights.shape(), valid.shape(), "heights and mask have one shape");
    let (rows, cols) = heights.shape();
    let (values, known) = (heights.as_slice(), valid.as_slice());
    let mut slopes = Grid::filled(rows, cols, Gradient::default());
    slopes.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, line)| {
        let inner = row > 0 && row + 1 < rows;
        for (col, slope) in line.iter_mut().enumerate() {
            if !known[row * cols + col] {
                continue;
            }
            let window = |line: usize| line * cols + col - 1..line * cols + col + 2;
            let whole = inner
                && col > 0
                && col + 1 < cols
                && (row - 1..row + 2).all(|line| known[window(line)].iter().all(|&ok| ok));
            *slope = if whole {
                horn_inside([row - 1, row, row + 1].map(|line| &values[window(line)]), cell_size)
            } else {
                horn(heights, valid, Cell::new(row, col), cell_size)
            };
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
        east: (weighted_difference(known) / size.x()) as f32,
        north: (weighted_difference(|line, step| known(-step, line)) / size.y()) as f32,
    }
}

/// [`horn`] where all nine cells are known: `rows` are the northern, own and southern one from the western neighbour on.
fn horn_inside(rows: [&[f32]; 3], size: CellSize) -> Gradient {
    let at = |row: usize, col: usize| f64::from(rows[row][col]);
    let east = (at(0, 2) - at(0, 0)) + 2.0 * (at(1, 2) - at(1, 0)) + (at(2, 2) - at(2, 0));
    let north = (at(0, 0) - at(2, 0)) + 2.0 * (at(0, 1) - at(2, 1)) + (at(0, 2) - at(2, 2));
    Gradient { east: (east / (8.0 * size.x())) as f32, north: (north / (8.0 * size.y())) as f32 }
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
pub(crate) fn hillshade(
    heights: &Grid<f32>,
    valid: &Mask,
    cell_size: CellSize,
    sun: Sun,
    exaggeration: f64,
) -> Grid<f32> {
    let (k, lights) = (exaggeration as f32, sun.lights());
    gradients(heights, valid, cell_size)
        .map(|slope| lights.brightness(Gradient { east: slope.east * k, north: slope.north * k }))
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
    fn a_plane_has_its_gradient_on_oblong_cells_too() {
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
    fn a_tilted_plane_is_as_bright_as_geometry_says() {
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
    fn the_kernel_is_horns_inside_and_next_to_voids() {
        let size = CellSize::new(2.0, 4.0).unwrap();
        let heights = Grid::from_vec(3, 3, vec![1.0, 2.0, 4.0, 3.0, 9.0, 5.0, 0.0, 1.0, 8.0]).unwrap();
        let mut valid = everywhere(&heights);
        let centre = |valid: &Mask| gradients(&heights, valid, size)[Cell::new(1, 1)];
        // (4 + 2*5 + 8 - 1 - 2*3 - 0) / (8*2) and (1 + 2*2 + 4 - 0 - 2*1 - 8) / (8*4).
        assert_eq!(centre(&valid), Gradient { east: 15.0 / 16.0, north: -1.0 / 32.0 });
        // Without the eastern neighbour its line has the one-sided difference 9 - 3.
        valid[Cell::new(1, 2)] = false;
        let east = (1.5 + 2.0 * 6.0 + 4.0) / 4.0 / 2.0;
        assert_eq!(centre(&valid), Gradient { east, north: -1.0 / 32.0 });
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

        /// The multidirectional blend against its definition in angles (Mark 1992).
        #[test]
        fn many_suns_follow_the_published_weights(
            azimuth in 0.0..360.0f64, east in -2.0..2.0f32, north in -2.0..2.0f32,
        ) {
            prop_assume!(east.hypot(north) > 1e-3);
            let single = |azimuth| Sun { azimuth, ..Sun::single() }.brightness(Gradient { east, north });
            let aspect = f64::from(-east).atan2(f64::from(-north));
            let suns = [-90.0, -45.0, 0.0, 45.0].map(|turn| azimuth + turn);
            let weight = |sun: f64| (aspect - sun.to_radians()).sin().powi(2);
            let expected: f64 = suns.iter().map(|&sun| weight(sun) * f64::from(single(sun))).sum::<f64>()
                / suns.iter().map(|&sun| weight(sun)).sum::<f64>();
            let sun = Sun { azimuth, altitude: 45.0, multidirectional: 1.0 };
            let found = f64::from(sun.brightness(Gradient { east, north }));
            prop_assert!((found - expected).abs() < 1e-5, "{found} against {expected}");
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
