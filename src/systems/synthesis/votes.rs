//! Patches vote on gradients.
//!
//! Every patch that covers two neighbouring cells says how much one is above the other in its source; near centres and near
//! patches count more. Gradients of nearly one source keep the exemplar's small forms, where means of heights from several would
//! blur them; where sources change, the surface joins them without a step. Cells gather their votes: rows in parallel.

use super::search::Field;
use super::source::step;
use crate::grid::Grid;
use crate::interpolation::Gradients;
use rayon::prelude::*;

/// Votes below this share of the strongest are left out.
const LEAST: f32 = 1e-5;
/// No patch is without a vote.
const LEAST_VOTE: f32 = 1e-6;

/// One of the patches that cover a gradient.
struct Ballot {
    /// From the cell to the patch's centre.
    down: i32,
    right: i32,
    weight: f32,
}

/// The patches of `radius` that cover a cell and its neighbour (`down`, `right`) away, by the distance of the pair's middle from the
/// patch's centre.
fn ballots(radius: usize, spread: f64, down: i32, right: i32) -> Vec<Ballot> {
    let r = radius as i32;
    let mut all = Vec::new();
    for from in -r..=r - down {
        for beside in -r..=r - right {
            let y = f64::from(from) + 0.5 * f64::from(down);
            let x = f64::from(beside) + 0.5 * f64::from(right);
            let weight = (-(y * y + x * x) / (2.0 * spread * spread)).exp() as f32;
            all.push(Ballot { down: -from, right: -beside, weight });
        }
    }
    let most = all.iter().map(|b| b.weight).fold(0.0, f32::max);
    all.retain(|b| b.weight > LEAST * most);
    all
}

/// The gradients for which the patches of `field` vote: those of `heights` around their sources. `scale`: distance between
/// patches at which a vote counts 1/e.
pub(super) fn votes(field: &Field, heights: &Grid<f32>, radius: usize, spread: f64, scale: f32) -> Gradients {
    let (rows, cols) = field.sources.shape();
    let weights = field.distances.map(|d| (-d / scale).exp() + LEAST_VOTE);
    let one = |down: i32, right: i32| {
        let ballots = ballots(radius, spread, down, right);
        let mut out = Grid::filled(rows, cols, 0.0f32);
        out.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, line)| {
            if row as i32 + down >= rows as i32 {
                return;
            }
            for (col, out) in line.iter_mut().enumerate().take(cols - right as usize) {
                *out = mean(field, &weights, heights, &ballots, (row, col), (down, right));
            }
        });
        out
    };
    Gradients { east: one(0, 1), south: one(1, 0) }
}

#[inline(always)]
fn mean(
    field: &Field,
    weights: &Grid<f32>,
    heights: &Grid<f32>,
    ballots: &[Ballot],
    (row, col): (usize, usize),
    (down, right): (i32, i32),
) -> f32 {
    let (rows, cols) = field.sources.shape();
    let (z, stride) = (heights.as_slice(), heights.cols() as i32);
    let (mut sum, mut total) = (0.0f32, 0.0f32);
    for ballot in ballots {
        let (r, c) = (row as i32 + ballot.down, col as i32 + ballot.right);
        if r < 0 || c < 0 || r >= rows as i32 || c >= cols as i32 {
            continue;
        }
        let i = r as usize * cols + c as usize;
        let source = field.sources.as_slice()[i];
        let here = source.moved(-ballot.down, -ballot.right);
        let (over, beside) = step(source.turn, down, right);
        let at = here.0 * stride + here.1;
        let weight = weights.as_slice()[i] * ballot.weight;
        sum += weight
            * field.stretches.as_slice()[i]
            * (z[(at + over * stride + beside) as usize] - z[at as usize]);
        total += weight;
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use crate::systems::synthesis::source::{Source, TURNS};

    /// Where all sources go on from each other, the gradients are those of the exemplar in that symmetry.
    #[test]
    fn one_piece_votes_for_itself() {
        let heights = Grid::from_fn(40, 40, |c| ((c.row * 17 + c.col * 29 + c.row * c.col) % 53) as f32);
        for turn in 0..TURNS {
            let place = |c: Cell| {
                let (row, col) = step(turn, c.row as i32 - 6, c.col as i32 - 6);
                Source::new((20 + row) as usize, (20 + col) as usize, turn, 0)
            };
            let sources = Grid::from_fn(12, 12, place);
            let distances = Grid::from_fn(12, 12, |c| 0.1 * c.row as f32);
            let field = Field { distances, ..Field::new(sources) };
            let found = votes(&field, &heights, 2, 1.0, 0.3);
            let laid = Grid::from_fn(12, 12, |c| heights[place(c).cell()]);
            let want = Gradients::of(&laid);
            for (cell, east) in want.east.cells() {
                assert!((east - found.east[cell]).abs() < 1e-3, "turn {turn} {cell:?}");
                assert!((want.south[cell] - found.south[cell]).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn a_near_patch_outvotes_a_far_one() {
        let heights = Grid::from_fn(20, 20, |c| if c.col < 10 { 5.0 * c.col as f32 } else { 0.0 });
        let steep = |c: Cell| Source::new(10, 2 + c.col % 5, 0, 0);
        let sources =
            Grid::from_fn(5, 6, |c| if c.col < 3 { steep(c) } else { Source::new(10, 13 + c.col % 3, 0, 0) });
        let distances = Grid::from_fn(5, 6, |c| if c.col < 3 { 0.0 } else { 3.0 });
        let found = votes(&Field { distances, ..Field::new(sources) }, &heights, 2, 1.5, 0.3);
        assert!(found.east[Cell::new(2, 2)] > 4.9, "{}", found.east[Cell::new(2, 2)]);
    }
}
