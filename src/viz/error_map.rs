//! Signed differences between two terrains as a picture.
//!
//! (estimate, truth) -> blue where the estimate is too low, red where it is too high, paper where it is right.
//! Pictures that are to be compared need one limit: take the largest of [`error_limit`] over them.

use super::palette::Palette;
use super::relief::void_color;
use super::upsample::{check_scale, upsample};
use super::{Picture, Rgb};
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask};

/// A round limit for the colours: 1, 2 or 5 times a power of ten, at least the 98th percentile of |estimate - truth|
/// over valid cells. 1 when the terrains are equal.
///
/// # Errors
/// When the shapes differ, a difference is not finite or no cell is valid.
pub(crate) fn error_limit(estimate: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    let difference = differences(estimate, truth, valid)?;
    let known = difference.as_slice().iter().zip(valid.as_slice()).filter(|(_, ok)| **ok);
    let mut sizes: Vec<f64> = known.map(|(d, _)| f64::from(d.abs())).collect();
    if sizes.is_empty() {
        return Err(Error::value("number of valid cells", 0, "a map of errors needs at least one"));
    }
    sizes.sort_by(f64::total_cmp);
    let high = sizes[((sizes.len() - 1) as f64 * 0.98).round() as usize];
    Ok(if high > 0.0 { super::ticks::round_up(high) } else { 1.0 })
}

/// The map of estimate - truth at `scale` pixels per cell. `-limit` and less is the deepest blue, `limit` and more the
/// deepest red ([`ColorBar::difference`](super::ColorBar::difference) says so); voids are hatched.
///
/// # Errors
/// When the shapes differ, a difference at a valid cell is not finite, or `limit` or `scale` is out of range.
pub(crate) fn error_map(
    estimate: &Grid<f32>,
    truth: &Grid<f32>,
    valid: &Mask,
    limit: f64,
    scale: usize,
) -> Result<Picture> {
    if !(limit.is_finite() && limit > 0.0) {
        return Err(Error::value("limit of the differences", limit, "allowed: positive and finite"));
    }
    check_scale(truth.rows(), truth.cols(), scale)?;
    let difference = upsample(&differences(estimate, truth, valid)?, valid, scale);
    let colours: Vec<Rgb> = Palette::Difference.table().iter().map(|c| c.to_rgb()).collect();
    let last = (colours.len() - 1) as f64;
    let (rows, cols) = difference.shape();
    Ok(Picture::from_fn(rows, cols, |at| {
        if valid[Cell::new(at.row / scale, at.col / scale)] {
            let t = (f64::from(difference[at]) / limit * 0.5 + 0.5).clamp(0.0, 1.0);
            colours[(t * last).round() as usize]
        } else {
            void_color(at)
        }
    }))
}

fn differences(estimate: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<Grid<f32>> {
    for (name, shape) in [("estimate", estimate.shape()), ("mask", valid.shape())] {
        if shape != truth.shape() {
            let allowed = format!("allowed: {:?}, the shape of the truth", truth.shape());
            return Err(Error::value(format!("shape of the {name}"), format!("{shape:?}"), allowed));
        }
    }
    let mut difference = Grid::filled(truth.rows(), truth.cols(), 0.0f32);
    for (cell, &ok) in valid.cells() {
        if ok {
            let d = estimate[cell] - truth[cell];
            if !d.is_finite() {
                let name = format!("difference at row {}, column {}", cell.row, cell.col);
                return Err(Error::value(name, d, "allowed: finite"));
            }
            difference[cell] = d;
        }
    }
    Ok(difference)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(rows: usize, cols: usize, per_row: f32) -> Grid<f32> {
        Grid::from_fn(rows, cols, |c| c.row as f32 * per_row)
    }

    #[test]
    fn zero_is_paper_and_signs_have_their_colours() {
        let truth = slope(9, 9, 0.0);
        let estimate = Grid::from_fn(9, 9, |c| [-30.0, 0.0, 30.0][c.col / 3]);
        let mut valid = truth.map(|_| true);
        valid[Cell::new(0, 0)] = false;
        let picture = error_map(&estimate, &truth, &valid, 20.0, 1).unwrap();
        let at = |row, col| picture.pixels()[Cell::new(row, col)];
        assert_eq!(at(4, 1), Palette::Difference.color(0.0));
        assert!(at(4, 4).lightness() > 0.95);
        assert_eq!(at(4, 7), Palette::Difference.color(1.0));
        assert!(at(4, 1).b > at(4, 1).r && at(4, 7).r > at(4, 7).b);
        assert_eq!(at(0, 0), void_color(Cell::new(0, 0)));
    }

    #[test]
    fn the_limit_is_round_and_ignores_voids_and_outliers() {
        // 100 known rows with errors up to 10.1, of which one is absurd, then 100 voids. The 98th percentile of the known
        // ones is 10.006; voids counted as right would make it 9.8.
        let truth = slope(200, 1, 0.0);
        let mut estimate = slope(200, 1, 0.1021);
        let valid = Grid::from_fn(200, 1, |c| c.row < 100);
        estimate[Cell::new(0, 0)] = 1e6;
        estimate[Cell::new(150, 0)] = f32::NAN;
        assert_eq!(error_limit(&estimate, &truth, &valid).unwrap(), 20.0);
        assert_eq!(error_limit(&truth, &truth, &valid).unwrap(), 1.0);
    }

    #[test]
    fn bad_input_is_named() {
        let truth = slope(4, 4, 1.0);
        let valid = truth.map(|_| true);
        let mut broken = truth.clone();
        broken[Cell::new(2, 3)] = f32::NAN;
        let message = error_map(&broken, &truth, &valid, 1.0, 1).unwrap_err().to_string();
        assert!(message.contains("row 2, column 3"), "{message}");
        assert!(error_map(&slope(4, 5, 1.0), &truth, &valid, 1.0, 1).is_err());
        assert!(error_map(&truth, &truth, &valid, 0.0, 1).is_err());
        assert!(error_limit(&truth, &truth, &truth.map(|_| false)).is_err());
    }
}
