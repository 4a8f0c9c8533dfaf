//! Which symmetries of the square an exemplar may be laid in.
//!
//! Mountains look alike from all sides, but wind has a direction: dunes that are turned or mirrored are no dunes. Measured on the
//! exemplar: how much of its slope would face elsewhere in a symmetry, as the total variation between the distribution of the
//! directions in which it falls, weighted by the square of the slope, and the same distribution turned. (Weighted by the slope itself the two sides
//! of any closed form weigh the same, however steep the one and gentle the other.)

use super::source::{TURNS, step};
use crate::grid::Grid;
use std::f64::consts::TAU;

/// Directions that are told apart.
const SECTORS: usize = 16;
/// A symmetry is left out when more than this share would face elsewhere. Of nine areas of rivers, craters, star dunes and plains none has more
/// than .36 (halves of them, at twice the cell size); a range of parallel dunes has .6 and more.
const MOST_TURNED: f64 = 0.45;

/// The symmetries of an exemplar.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetries {
    /// Share of the slope that would face elsewhere in each of the eight; 0 for the first, which changes nothing.
    pub turned: [f64; TURNS as usize],
    /// Those that are used.
    pub used: Vec<u8>,
}

/// Measures the symmetries of `heights` (any unit).
pub(super) fn measure(heights: &Grid<f32>) -> Symmetries {
    let (rows, cols) = heights.shape();
    let z = heights.as_slice();
    let mut falls = Vec::with_capacity(rows * cols);
    for row in 1..rows.saturating_sub(1) {
        for col in 1..cols.saturating_sub(1) {
            let i = row * cols + col;
            falls.push((f64::from(z[i + cols] - z[i - cols]), f64::from(z[i + 1] - z[i - 1])));
        }
    }
    let histogram = |turn: u8| {
        let mut sums = [0.0; SECTORS];
        for &(down, right) in &falls {
            let length = down.hypot(right);
            if length > 0.0 {
                let (a, b) = step(turn, 1, 0);
                let (c, d) = step(turn, 0, 1);
                let turned =
                    (down * f64::from(a) + right * f64::from(c), down * f64::from(b) + right * f64::from(d));
                let sector = (turned.0.atan2(turned.1) / TAU).rem_euclid(1.0) * SECTORS as f64;
                sums[sector as usize % SECTORS] += length * length;
            }
        }
        let total: f64 = sums.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        sums.map(|sum| sum / total)
    };
    let own = histogram(0);
    let mut turned = [0.0; TURNS as usize];
    for turn in 1..TURNS {
        let other = histogram(turn);
        turned[turn as usize] = 0.5 * own.iter().zip(other).map(|(a, b)| (a - b).abs()).sum::<f64>();
    }
    let used = (0..TURNS).filter(|t| turned[*t as usize] <= MOST_TURNED).collect();
    Symmetries { turned, used }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hills_may_be_turned_and_dunes_may_not() {
        let hills = Grid::from_fn(80, 80, |c| {
            let (y, x) = (c.row as f32 * 0.3, c.col as f32 * 0.3);
            y.sin() + x.sin() + 0.5 * (0.7 * (x + y)).sin() + 0.5 * (0.7 * (x - y)).sin()
        });
        assert_eq!(measure(&hills).used.len(), 8);
        // Gentle from the west, steep to the east: mirroring north and south is the only other symmetry.
        let dunes = Grid::from_fn(80, 80, |c| {
            let phase = (c.col + c.row / 20) % 16;
            if phase < 13 { phase as f32 } else { (16 - phase) as f32 * 13.0 / 3.0 }
        });
        let found = measure(&dunes);
        assert!(found.used.len() < TURNS as usize);
        assert!(found.used.contains(&0) && !found.used.contains(&3) && !found.used.contains(&4), "{found:?}");
    }
}
