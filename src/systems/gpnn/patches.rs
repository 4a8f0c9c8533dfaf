//! Patches as rows of numbers: cosine waves of a few maps, by which the search compares them.
//!
//! A patch of the ground is smooth, so that its slow waves say nearly all of it: 14 numbers in place of 49, and squared
//! distances of patches are those of their waves. Ground and residual are divided by the patch's own contrast: gentle and
//! steep slopes are compared by their form, and what is copied is scaled back.

use super::search::Table;
use crate::grid::{Cell, Grid};
use crate::machine;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Side of a patch, cells (7 in the paper's code).
pub(super) const SIDE: usize = 7;
const AREA: usize = SIDE * SIDE;
/// Waves that are kept: half periods down and across together. The fastest are mostly noise of the resampling.
const FASTEST: usize = 4;
/// Number of waves with the constant one.
const WAVES: usize = (FASTEST + 1) * (FASTEST + 2) / 2;
/// Share of the exemplar's mean contrast that is added to every patch's, so that level ground is not blown up.
const LEVEL: f32 = 0.3;
/// Weight of the marks of lines beside the ground, whose patches have a root mean square of about 1/2.
const MARKS: f32 = 2.0;
/// Unit of the ground, root mean square slopes.
const GROUND_UNIT: f32 = 2.0;

/// What patches are cut from: maps of one shape.
pub(super) struct Layers {
    /// The smooth map. Compared without the patch's mean.
    pub(super) ground: Grid<f32>,
    /// What the scale before has added, enlarged; none at the first scale.
    pub(super) residual: Option<Grid<f32>>,
    /// 1 on ridges, -1 in valleys, 0 elsewhere, shrunk with the map; none without lines.
    pub(super) marks: Option<Grid<f32>>,
}

/// Units of the layers, and the mean contrast of the exemplar's patches.
#[derive(Clone, Copy)]
pub(super) struct Units {
    /// Root mean square slope of the exemplar's smooth map.
    pub(super) slope: f32,
    /// Root mean square of the exemplar's residual.
    pub(super) residual: f32,
    /// Mean norm of the ground's waves over the exemplar's patches.
    pub(super) contrast: f32,
}

/// The slow cosine waves of a patch, the constant one first: of every cell its share of each.
pub(super) struct Waves([[f32; WAVES]; AREA]);

impl Waves {
    pub(super) fn new() -> Self {
        let along = |u: usize, i: usize| {
            let norm = if u == 0 { 1.0 } else { 2.0 } / SIDE as f64;
            norm.sqrt() * (PI * (i as f64 + 0.5) * u as f64 / SIDE as f64).cos()
        };
        let pairs: Vec<_> = (0..=FASTEST).flat_map(|u| (0..=FASTEST - u).map(move |v| (u, v))).collect();
        let shares = |i: usize| {
            std::array::from_fn(|w| (along(pairs[w].0, i / SIDE) * along(pairs[w].1, i % SIDE)) as f32)
        };
        Self(std::array::from_fn(shares))
    }

    /// The waves of the patch whose north-west cell is (`row`, `col`), times `weight`.
    #[inline(always)]
    fn of(&self, map: &Grid<f32>, row: usize, col: usize, weight: f32) -> [f32; WAVES] {
        let (cols, z) = (map.cols(), map.as_slice());
        // Without the first height: on top of a mountain the sums would round the forms away.
        let first = z[row * cols + col];
        let mut waves = [0.0; WAVES];
        for (i, shares) in self.0.chunks_exact(SIDE).enumerate() {
            let start = (row + i) * cols + col;
            for (shares, z) in shares.iter().zip(&z[start..start + SIDE]) {
                waves.iter_mut().zip(shares).for_each(|(wave, share)| *wave += share * (z - first));
            }
        }
        waves.iter_mut().for_each(|wave| *wave *= weight);
        waves[0] += weight * first * SIDE as f32;
        waves
    }
}

impl Layers {
    /// All maps in one of the eight symmetries.
    pub(super) fn turned(&self, turn: usize) -> Self {
        let all = |map: &Option<Grid<f32>>| map.as_ref().map(|map| turned(map, turn));
        Self { ground: turned(&self.ground, turn), residual: all(&self.residual), marks: all(&self.marks) }
    }

    /// (rows, columns) of places where a patch fits.
    pub(super) fn places(&self) -> (usize, usize) {
        let (rows, cols) = self.ground.shape();
        ((rows + 1).saturating_sub(SIDE), (cols + 1).saturating_sub(SIDE))
    }

    /// Numbers of a patch.
    fn depth(&self) -> usize {
        let constant = usize::from(self.residual.is_some()) * WAVES;
        WAVES - 1 + constant + usize::from(self.marks.is_some()) * (WAVES - 1)
    }

    /// Mean norm of the ground's waves, in `slope`'s unit.
    pub(super) fn mean_contrast(&self, waves: &Waves, slope: f32) -> f32 {
        let (rows, cols) = self.places();
        let weight = (GROUND_UNIT * slope).recip();
        let norms: Vec<f64> = (0..rows)
            .into_par_iter()
            .map(|row| {
                let norm = |col| f64::from(norm(&waves.of(&self.ground, row, col, weight)[1..]));
                (0..cols).map(norm).sum::<f64>()
            })
            .collect();
        (norms.iter().sum::<f64>() / (rows * cols).max(1) as f64) as f32
    }

    /// The patches at `places` as rows that end in their squared norm and 1, and each patch's contrast.
    pub(super) fn table(&self, waves: &Waves, units: Units, places: &[(usize, usize)]) -> (Table, Vec<f32>) {
        let depth = self.depth() + 2;
        let (ground, added) =
            ((GROUND_UNIT * units.slope).recip(), units.residual.max(f32::MIN_POSITIVE).recip());
        let mut values = vec![0.0; places.len() * depth];
        let fill = |(out, &(row, col)): (&mut [f32], &(usize, usize))| {
            let form = waves.of(&self.ground, row, col, ground);
            let contrast = norm(&form[1..]) + LEVEL * units.contrast;
            let scale = units.contrast / contrast;
            let mut numbers = out.iter_mut();
            let mut push = |waves: &[f32], scale: f32| {
                for (out, wave) in numbers.by_ref().zip(waves) {
                    *out = scale * wave;
                }
            };
            push(&form[1..], scale);
            if let Some(residual) = &self.residual {
                push(&waves.of(residual, row, col, added), scale);
            }
            if let Some(marks) = &self.marks {
                push(&waves.of(marks, row, col, MARKS)[1..], 1.0);
            }
            let square = out[..depth - 2].iter().map(|v| v * v).sum();
            (out[depth - 2], out[depth - 1]) = (square, 1.0);
            contrast
        };
        let arch = machine::arch();
        let wide = |row| {
            arch.dispatch(
                #[inline(always)]
                || fill(row),
            )
        };
        let contrasts = values.par_chunks_mut(depth).zip(places).map(wide).collect();
        (Table { depth, values }, contrasts)
    }
}

fn norm(values: &[f32]) -> f32 {
    values.iter().map(|v| v * v).sum::<f32>().sqrt()
}

/// Rows (.., |k|^2, 1) as keys of squared distances times a weight each.
pub(super) fn as_keys(rows: &Table, weights: &[f32]) -> Table {
    let depth = rows.depth;
    let mut values = rows.values.clone();
    values.par_chunks_mut(depth).zip(weights).for_each(|(row, &weight)| {
        row[..depth - 2].iter_mut().for_each(|v| *v *= -2.0 * weight);
        // In the order of a query's ends: its square meets the weight, its 1 the key's own square.
        (row[depth - 2], row[depth - 1]) = (weight, weight * row[depth - 2]);
    });
    Table { depth, values }
}

/// One of the eight symmetries of a raster.
pub(super) fn turned(map: &Grid<f32>, turn: usize) -> Grid<f32> {
    let (rows, cols) = map.shape();
    let across = turn & 4 != 0;
    let shape = if across { (cols, rows) } else { (rows, cols) };
    Grid::from_fn(shape.0, shape.1, |cell| {
        let (row, col) = if across { (cell.col, cell.row) } else { (cell.row, cell.col) };
        let row = if turn & 1 != 0 { rows - 1 - row } else { row };
        map[Cell::new(row, if turn & 2 != 0 { cols - 1 - col } else { col })]
    })
}
