//! Whether windows of terrain can be told from windows of real terrain: a classifier two-sample test (Lopez-Paz & Oquab 2017).
//!
//! Terrain -> features of its 32x32 windows; features of real and of made terrain, case by case -> for each case the share of its
//! windows that a random forest (Breiman 2001) tells right which was trained on other cases. A half cannot be told. The share grows with
//! the number of cases: compare figures of the same cases only. Cost: 5 forests of 100 trees.

use super::landforms::sights;
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, d8, gaussian};
use crate::seed::Seed;
use rand::Rng;
use rayon::prelude::*;
use smartcore::ensemble::random_forest_classifier::{
    RandomForestClassifier, RandomForestClassifierParameters,
};
use smartcore::linalg::basic::matrix::DenseMatrix;

/// Side of a window, cells.
const SIDE: usize = 32;
/// Trees of a forest.
const TREES: u16 = 100;
/// The cases are told by forests that were trained on the other ones of so many parts.
const FOLDS: usize = 5;
/// Standard deviations of the Gaussians whose residuals are looked at, cells.
const SIGMAS: [f64; 3] = [1.0, 2.0, 4.0];
/// Quantiles of slope and of curvature.
const QUANTILES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];
/// Slope below which a line of sight is level: one degree (Jasiewicz & Stepinski 2013).
const LEVEL: f64 = 0.017_455;

/// What is known of a window: quantiles of slope and curvature over the mean slope (5 + 5), the logarithm of that slope, how much the
/// slopes have one axis, strength, skewness and kurtosis of what each of three Gaussians takes away (9), and the shares of cells that see
/// 0 to 8 higher and 0 to 8 lower neighbours (9 + 9).
pub(crate) type WindowFeatures = Vec<f32>;
/// How many features a window has.
pub(crate) const WINDOW_FEATURES: usize = 39;

/// The features of every whole window without a void, row by row.
///
/// # Errors
/// When no window is whole.
pub fn window_features(terrain: &Dem) -> Result<Vec<WindowFeatures>> {
    let (z, valid) = (terrain.heights(), terrain.valid());
    let (rows, cols) = z.shape();
    let side = terrain.cell_size().mean();
    let residuals = SIGMAS.map(|sigma| {
        let smooth = gaussian::smooth(z, valid, sigma);
        Grid::from_fn(rows, cols, |c| f64::from(z[c]) - f64::from(smooth[c]))
    });
    let views = sights(z, valid, LEVEL * side);
    let mut windows = Vec::new();
    for row in (0..(rows + 1).saturating_sub(SIDE)).step_by(SIDE) {
        for col in (0..(cols + 1).saturating_sub(SIDE)).step_by(SIDE) {
            let cells: Vec<Cell> =
                (0..SIDE * SIDE).map(|i| Cell::new(row + i / SIDE, col + i % SIDE)).collect();
            if cells.iter().all(|cell| valid[*cell]) {
                windows.push(features(z, side, &residuals, &views, &cells));
            }
        }
    }
    if windows.is_empty() {
        let allowed = format!("a whole window of {SIDE}x{SIDE} cells without voids is needed");
        return Err(Error::value("windows", 0, allowed));
    }
    Ok(windows)
}

fn features(
    z: &Grid<f32>,
    side: f64,
    residuals: &[Grid<f64>; 3],
    views: &Grid<(u8, u8)>,
    cells: &[Cell],
) -> WindowFeatures {
    let (rows, cols) = z.shape();
    let (mut slopes, mut curvatures, mut axis) = (Vec::new(), Vec::new(), [0.0; 3]);
    for &cell in cells {
        // One-sided at the frame.
        let at = |code: u8| f64::from(z[d8::neighbour(cell, code, rows, cols).unwrap_or(cell)]);
        let span = |a: usize, last: usize| if a == 0 || a == last { side } else { 2.0 * side };
        let (east, north) =
            ((at(0) - at(4)) / span(cell.col, cols - 1), (at(2) - at(6)) / span(cell.row, rows - 1));
        let square = east * east + north * north;
        // Twice the angle: an axis has no direction.
        axis = [axis[0] + east * east - north * north, axis[1] + 2.0 * east * north, axis[2] + square];
        slopes.push(square.sqrt());
        curvatures.push((at(0) + at(2) + at(4) + at(6) - 4.0 * f64::from(z[cell])) / side);
    }
    let mean = slopes.iter().sum::<f64>() / slopes.len() as f64 + 1e-9;
    let mut found = Vec::new();
    for values in [&mut slopes, &mut curvatures] {
        values.sort_unstable_by(f64::total_cmp);
        found.extend(QUANTILES.map(|q| values[(q * (values.len() - 1) as f64).round() as usize] / mean));
    }
    found.extend([mean.ln(), axis[0].hypot(axis[1]) / axis[2].max(1e-18)]);
    for residual in residuals {
        let power = |n: i32| cells.iter().map(|c| residual[*c].powi(n)).sum::<f64>() / cells.len() as f64;
        let centre = power(1);
        let spread = (power(2) - centre * centre).max(0.0).sqrt();
        let unit = spread.max(1e-9);
        found.extend([(spread / side / mean + 1e-6).ln(), power(3) / unit.powi(3), power(4) / unit.powi(4)]);
    }
    let mut shares = [[0.0; 9]; 2];
    for cell in cells {
        let (higher, lower) = views[*cell];
        shares[0][usize::from(higher)] += 1.0 / cells.len() as f64;
        shares[1][usize::from(lower)] += 1.0 / cells.len() as f64;
    }
    found.extend(shares.concat());
    found.into_iter().map(|value| value as f32).collect()
}

/// For each case (windows of real terrain, windows of made terrain) the share of both that is told right from the other cases.
///
/// # Errors
/// With fewer than two cases, a case without windows, or values that are not finite.
pub fn told_share(cases: &[(Vec<WindowFeatures>, Vec<WindowFeatures>)], seed: Seed) -> Result<Vec<f64>> {
    if cases.len() < 2 || cases.iter().any(|(real, made)| real.is_empty() || made.is_empty()) {
        let allowed = "at least 2, each with windows of real and of made terrain";
        return Err(Error::value("cases to tell apart", cases.len(), allowed));
    }
    let folds = FOLDS.min(cases.len());
    let failed = |e: smartcore::error::Failed| Error::value("windows to tell apart", e, "finite features");
    let told: Vec<Vec<(usize, f64)>> = (0..folds)
        .into_par_iter()
        .map(|fold| {
            let (mut windows, mut labels) = (Vec::new(), Vec::new());
            for (_, (real, made)) in cases.iter().enumerate().filter(|(i, _)| i % folds != fold) {
                windows.extend(real.iter().chain(made).cloned());
                labels.extend((0..real.len() + made.len()).map(|i| u32::from(i >= real.len())));
            }
            let drawn = seed.derive_indexed("forest", fold).stream("trees").next_u64();
            let settings = RandomForestClassifierParameters::default().with_n_trees(TREES).with_seed(drawn);
            let matrix = DenseMatrix::from_2d_vec(&windows).map_err(failed)?;
            let forest = RandomForestClassifier::fit(&matrix, &labels, settings).map_err(failed)?;
            let mut shares = Vec::new();
            for (i, (real, made)) in cases.iter().enumerate().filter(|(i, _)| i % folds == fold) {
                let windows: Vec<WindowFeatures> = real.iter().chain(made).cloned().collect();
                let found =
                    forest.predict(&DenseMatrix::from_2d_vec(&windows).map_err(failed)?).map_err(failed)?;
                let is_right = |(j, label): (usize, &u32)| usize::from(*label == u32::from(j >= real.len()));
                let right: usize = found.iter().enumerate().map(is_right).sum();
                shares.push((i, right as f64 / windows.len() as f64));
            }
            Ok(shares)
        })
        .collect::<Result<_>>()?;
    let mut shares = told.concat();
    shares.sort_unstable_by_key(|(i, _)| *i);
    Ok(shares.into_iter().map(|(_, share)| share).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::CellSize;
    use crate::grid::Window;
    use rand::RngExt;

    /// Hills of random places; `grain` metres of noise over them.
    fn hills(seed: u64, grain: f32) -> Dem {
        let mut stream = Seed(seed).stream("hills");
        let waves: Vec<[f32; 4]> = (0..12)
            .map(|_| {
                std::array::from_fn(|k| {
                    stream.sample::<f32, _>(rand::distr::StandardUniform) * [0.5, 0.5, 6.3, 30.0][k]
                })
            })
            .collect();
        let heights = Grid::from_fn(128, 128, |c| {
            let sum: f32 =
                waves.iter().map(|w| w[3] * (w[0] * c.row as f32 + w[1] * c.col as f32 + w[2]).sin()).sum();
            sum + grain * stream.sample::<f32, _>(rand::distr::StandardUniform)
        });
        Dem::new(heights, CellSize::square(30.0).unwrap()).unwrap()
    }

    fn told(grain: f32) -> f64 {
        let windows = |seed: u64, grain: f32| window_features(&hills(seed, grain)).unwrap();
        let cases: Vec<_> = (0..6).map(|i| (windows(2 * i, 0.0), windows(2 * i + 1, grain))).collect();
        let shares = told_share(&cases, Seed(1)).unwrap();
        assert_eq!(shares, told_share(&cases, Seed(1)).unwrap());
        shares.iter().sum::<f64>() / shares.len() as f64
    }

    #[test]
    fn grain_is_told_and_more_of_the_same_is_not() {
        let (same, other) = (told(0.0), told(25.0));
        assert!((0.3..0.7).contains(&same), "{same}");
        assert!(other > 0.95, "{other}");
    }

    #[test]
    fn windows_are_whole_and_features_finite() {
        let dem = hills(1, 5.0);
        let windows = window_features(&dem).unwrap();
        assert_eq!((windows.len(), windows[0].len()), (16, WINDOW_FEATURES));
        assert!(windows.iter().flatten().all(|value| value.is_finite()));
        let mut valid = dem.valid().clone();
        valid[Cell::new(40, 70)] = false;
        let holed = Dem::with_voids(dem.heights().clone(), valid, dem.cell_size()).unwrap();
        assert_eq!(window_features(&holed).unwrap().len(), 15);
        let level = Dem::new(Grid::filled(32, 40, 7.0), dem.cell_size()).unwrap();
        assert!(window_features(&level).unwrap()[0].iter().all(|value| value.is_finite()));
        assert!(window_features(&dem.crop(Window::new(Cell::new(0, 0), 31, 128)).unwrap()).is_err());
        assert!(told_share(&[(windows.clone(), windows)], Seed(1)).is_err());
    }

    /// Slopes all along one axis have coherence 1; a cone's have none.
    #[test]
    fn axes_of_slopes_are_seen() {
        let at = |f: &dyn Fn(f32, f32) -> f32| {
            let heights = Grid::from_fn(32, 32, |c| f(c.col as f32 - 15.5, c.row as f32 - 15.5));
            window_features(&Dem::new(heights, CellSize::square(1.0).unwrap()).unwrap()).unwrap()[0][11]
        };
        assert!(at(&|x, _| x.abs()) > 0.999);
        assert!(at(&|x, y| x.hypot(y)) < 0.02);
        assert!(at(&|x, y| (x + y).abs()) > 0.98);
    }
}
