//! The first surface: between a floor through the valleys and a roof through the ridges, with relief of its own.

use super::domain::Ground;
use super::noise::octaves;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask, distance};
use crate::interpolation::harmonic;
use crate::seed::Seed;
use crate::sketch::StrokeKind;

/// Cells of the map over which what a line says of floor or roof falls to 1/e.
const HOLD: f64 = 22.0;
/// Room between floor and roof where lines say nothing of one of them, relative to the exemplar's relief.
const ROOM: f64 = 0.6;
/// Least room, relative to the exemplar's relief.
const LEAST_ROOM: f64 = 0.1;
/// Distance to a line, in cells of the map, at which the relief of the first surface is full.
const TAPER: f64 = 192.0;
/// Exponent of the spectrum of the first surface.
const EXPONENT: f64 = 2.2;
/// Longest wavelength of the first surface, cells of the map.
const LONGEST: f64 = 128.0;

/// A first surface at cells `factor` times as large as the map's, metres. `relief` is that of 128 x 128 cells of the map.
///
/// # Errors
/// When nothing is drawn.
pub(super) fn first_surface(
    ground: &Ground,
    factor: usize,
    relief: f64,
    amplitude: f64,
    seed: Seed,
) -> Result<Grid<f32>> {
    let heights = ground.heights();
    let (ridges, valleys) = (ground.mask_of(StrokeKind::Ridge), ground.mask_of(StrokeKind::Valley));
    let drawn = ground.drawn.map(Option::is_some);
    if !drawn.as_slice().contains(&true) {
        return Err(Error::value("number of line cells", 0, "a landscape needs at least one"));
    }
    let through = |lines: &Mask| -> Result<Option<(Grid<f64>, Grid<f64>)>> {
        let any = lines.as_slice().contains(&true);
        any.then(|| Ok((harmonic(lines, &heights)?, hold(lines, factor)))).transpose()
    };
    let (roof, floor) = (through(&ridges)?, through(&valleys)?);
    let room = ROOM * relief;
    let shape = heights.shape();
    // Close to its lines a surface is theirs; far from them it keeps its room to the other one.
    let pair = Grid::from_fn(shape.0, shape.1, |c| match (&floor, &roof) {
        (Some((low, hold_low)), Some((high, hold_high))) => {
            let (mut a, mut b) = (low[c], high[c]);
            for _ in 0..3 {
                a = (b - room) + hold_low[c] * (low[c] - (b - room));
                b = (a + room) + hold_high[c] * (high[c] - (a + room));
            }
            (a, b)
        }
        (Some((low, _)), None) => (low[c], low[c] + room),
        (None, Some((high, _))) => (high[c] - room, high[c]),
        (None, None) => (0.0, 0.0),
    });
    let middle = pair.map(|(low, high)| 0.5 * (low + high));
    let misses = Grid::from_fn(shape.0, shape.1, |c| heights[c] - middle[c]);
    let (misses, held) = (harmonic(&drawn, &misses)?, hold(&drawn, factor));
    let noise = octaves(shape, EXPONENT, LONGEST / factor as f64, seed.derive("first surface"));
    let taper = distance::squared(&drawn).map(|&d| (f64::from(d).sqrt() * factor as f64 / TAPER).min(1.0));
    Ok(Grid::from_fn(shape.0, shape.1, |c| {
        let (low, high) = pair[c];
        let relief = amplitude * (high - low).max(LEAST_ROOM * relief) * f64::from(noise[c]) * taper[c];
        (middle[c] + held[c] * misses[c] + relief) as f32
    }))
}

/// 1 at the lines, falling to 0 far from them.
fn hold(lines: &Mask, factor: usize) -> Grid<f64> {
    distance::squared(lines).map(|&d| (-f64::from(d).sqrt() * factor as f64 / HOLD).exp())
}
