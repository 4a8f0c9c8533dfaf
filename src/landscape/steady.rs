//! One resolution of the solver: water is routed, heights rise from the bases by the slope-area law, and where lines are missed
//! the factor on the law gives way.

use super::config::LandscapeConfig;
use super::domain::{COARSEST, Ground, Witness};
use super::fit::LandscapeFit;
use crate::error::Result;
use crate::flow::{Drainage, Role, Surface, drain};
use crate::grid::resample::Resampling;
use crate::grid::{Grid, Mask, gaussian};
use crate::seed::Seed;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// Share of the new heights in each step.
const RELAXATION: f32 = 0.6;
/// Share of the missing ln k that a step adds.
const GIVE: f32 = 0.7;
/// Largest miss of ln k that a line may claim in a step.
const LARGEST_MISS: f32 = 0.8;
/// Heights above the base below which ratios say nothing, relative to the exemplar's relief.
const LEAST_HEIGHT: f32 = 0.02;
/// Range of ln k.
const LOG_FACTOR: (f32, f32) = (-2.5, 1.8);
/// Share by which ln k returns in a step to what it was drawn as, where no line speaks.
const RETURN: f32 = 0.02;
/// Standard deviation of the smoothing of ln k's misses, cells of the map.
const SMOOTHING: f64 = 10.0;

/// What changes from step to step, at one resolution.
pub(super) struct State {
    /// Heights, metres.
    pub(super) heights: Grid<f32>,
    /// ln k, at the coarsest cells.
    pub(super) log_factor: Grid<f32>,
    /// ln k as drawn at random.
    pub(super) first_log_factor: Grid<f32>,
    /// Heights of the outer bases, metres; read at the outer cells alone.
    pub(super) shore: Grid<f32>,
}

/// One resolution.
pub(super) struct Stage<'a> {
    config: &'a LandscapeConfig,
    factor: usize,
    /// Side of a cell, metres.
    cell_size: f32,
    /// Area of a cell, cells of the exemplar.
    cell_area: f32,
    /// Relief of 128 x 128 cells of the map, metres.
    relief: f32,
    law: Law,
    ground: Ground,
    roles: Grid<Role>,
    witnesses: Vec<Witness>,
    preferences: Grid<[f32; 8]>,
    everywhere: Mask,
    finer: Resampling,
}

/// The fit as tables of 32-bit numbers.
struct Law {
    steps_per_log: f32,
    slopes: Vec<f32>,
    lowest: f32,
    steps_per_metre: f32,
    factors: Vec<f32>,
}

impl Law {
    fn of(fit: &LandscapeFit) -> Self {
        let narrow = |values: &[f64]| values.iter().map(|&v| v as f32).collect::<Vec<_>>();
        Self {
            steps_per_log: 1.0 / fit.slope_area.log_step as f32,
            slopes: narrow(&fit.slope_area.slopes),
            lowest: fit.height_law.lowest as f32,
            steps_per_metre: 1.0 / fit.height_law.step as f32,
            factors: narrow(&fit.height_law.factors),
        }
    }

    fn slope(&self, area: f32, height: f32) -> f32 {
        between(&self.slopes, area.max(1.0).ln() * self.steps_per_log)
            * between(&self.factors, (height - self.lowest) * self.steps_per_metre)
    }
}

fn between(knots: &[f32], at: f32) -> f32 {
    let last = knots.len() - 1;
    let at = at.clamp(0.0, last as f32);
    let below = (at as usize).min(last.saturating_sub(1));
    let share = at - below as f32;
    knots[below] * (1.0 - share) + knots[(below + 1).min(last)] * share
}

/// Heights by the law, and what they stand on.
struct Risen {
    heights: Grid<f32>,
    bases: Vec<f32>,
    areas: Vec<f32>,
    drainage: Drainage,
}

impl<'a> Stage<'a> {
    /// `cell_size` is that of the map.
    pub(super) fn new(
        fit: &LandscapeFit,
        config: &'a LandscapeConfig,
        factor: usize,
        cell_size: f64,
        ground: Ground,
        seed: Seed,
    ) -> Self {
        let (rows, cols) = ground.drawn.shape();
        let side = cell_size * factor as f64;
        let seed = seed.derive_indexed("preferences", factor);
        let mut preferences = Grid::filled(rows, cols, [1.0f32; 8]);
        preferences.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, line)| {
            let mut stream = seed.derive_indexed("row", row).stream("preference");
            for preference in line.as_flattened_mut() {
                let z: f64 = StandardNormal.sample(&mut stream);
                *preference = (config.scatter * z).exp() as f32;
            }
        });
        let coarse = (rows * factor / COARSEST, cols * factor / COARSEST);
        Self {
            config,
            factor,
            cell_size: side as f32,
            cell_area: (side / fit.cell_size).powi(2) as f32,
            relief: fit.relief_at(cell_size) as f32,
            law: Law::of(fit),
            roles: ground.roles(),
            witnesses: ground.witnesses(),
            ground,
            preferences,
            everywhere: Mask::filled(rows, cols, true),
            finer: Resampling::new(coarse, (rows, cols)),
        }
    }

    /// Puts the lines into the heights.
    pub(super) fn draw(&self, heights: &mut Grid<f32>) {
        for (z, drawn) in heights.as_mut_slice().iter_mut().zip(self.ground.drawn.as_slice()) {
            if let Some((_, height)) = drawn {
                *z = *height;
            }
        }
    }

    /// One step of the iteration; returns the heights that the law itself gives.
    pub(super) fn step(&self, state: &mut State) -> Result<Grid<f32>> {
        let mut risen = self.rise(state)?;
        self.creep(&mut risen);
        self.give_way(&risen, state);
        let old = state.heights.as_mut_slice();
        for (z, new) in old.iter_mut().zip(risen.heights.as_slice()) {
            *z += RELAXATION * (new - *z);
        }
        self.draw(&mut state.heights);
        Ok(risen.heights)
    }

    /// Heights upwards from the bases: dz = k S(A) along the channels, |grad z| = k S(A) on hillslopes.
    fn rise(&self, state: &State) -> Result<Risen> {
        let (rows, cols) = self.roles.shape();
        let surface = Surface::new(state.heights.clone(), self.everywhere.clone())?;
        let drainage = drain(&surface, &self.roles, Some(&self.preferences))?;
        let mut areas = vec![self.cell_area; rows * cols];
        drainage.gather(&mut areas);
        let mut slopes = self.finer.apply(&state.log_factor);
        slopes.as_mut_slice().par_iter_mut().for_each(|k| *k = k.exp() * self.cell_size);
        let slopes = slopes.as_slice();

        // What is not reached yet is infinitely high.
        let mut heights = Grid::filled(rows, cols, f32::INFINITY);
        let mut bases = vec![0.0f32; rows * cols];
        let z = heights.as_mut_slice();
        let shore = state.shore.as_slice();
        let head = self.config.channel_head as f32;
        for &cell in drainage.order() {
            let i = cell as usize;
            let Some(r) = drainage.receiver(i) else {
                z[i] = self.ground.drawn.as_slice()[i].map_or(shore[i], |(_, height)| height);
                bases[i] = z[i];
                continue;
            };
            bases[i] = bases[r];
            let rise = slopes[i] * self.law.slope(areas[i], z[r]);
            let is_diagonal = !(i.abs_diff(r) == 1 || i.abs_diff(r) == cols);
            let along = z[r] + rise * if is_diagonal { std::f32::consts::SQRT_2 } else { 1.0 };
            z[i] = if areas[i] >= head {
                along
            } else {
                // Not an outer cell: all four neighbours exist.
                along.min(eikonal(z[i - cols].min(z[i + cols]), z[i - 1].min(z[i + 1]), rise))
            };
        }
        Ok(Risen { heights, bases, areas, drainage })
    }

    /// Rounds the hillslopes.
    fn creep(&self, risen: &mut Risen) {
        let smooth = gaussian::smooth(&risen.heights, &self.everywhere, self.config.creep);
        let head = self.config.channel_head as f32;
        let share = if self.factor == 1 { 1.0 } else { 0.5 };
        let heights = risen.heights.as_mut_slice();
        for (i, z) in heights.iter_mut().enumerate() {
            if self.roles.as_slice()[i] != Role::Base {
                *z += (smooth.as_slice()[i] - *z) * share / (1.0 + risen.areas[i] / head);
            }
        }
    }

    /// Moves ln k towards what the lines ask for along the paths of their water.
    fn give_way(&self, risen: &Risen, state: &mut State) {
        let (rows, cols) = self.roles.shape();
        let least = LEAST_HEIGHT * self.relief;
        let mut misses = vec![0.0f32; rows * cols];
        let mut counts = vec![0.0f32; rows * cols];
        let z = risen.heights.as_slice();
        for Witness { index, allowed: (low, high) } in &self.witnesses {
            let target = z[*index].clamp(*low, high.max(*low));
            if target == z[*index] && low < high {
                continue;
            }
            let above = |height: f32| (height - risen.bases[*index]).max(least);
            misses[*index] = (above(target) / above(z[*index])).ln().clamp(-LARGEST_MISS, LARGEST_MISS);
            counts[*index] = 1.0;
        }
        risen.drainage.gather(&mut misses);
        risen.drainage.gather(&mut counts);
        // Means over the coarsest cells; no cell counts for more than two lines.
        let block = COARSEST / self.factor;
        let coarse = state.log_factor.shape();
        let mean = |value: &dyn Fn(usize) -> f32| {
            Grid::from_fn(coarse.0, coarse.1, |c| {
                let cells = (0..block * block)
                    .map(|k| (c.row * block + k / block) * cols + c.col * block + k % block);
                cells.map(value).sum::<f32>() / (block * block) as f32
            })
        };
        let weight = |i: usize| counts[i].min(2.0);
        let asked = mean(&|i| if counts[i] > 0.0 { misses[i] / counts[i] * weight(i) } else { 0.0 });
        let said = mean(&weight);
        let everywhere = asked.map(|_| true);
        let sigma = SMOOTHING / COARSEST as f64;
        let asked = gaussian::smooth(&asked, &everywhere, sigma);
        let said = gaussian::smooth(&said, &everywhere, sigma);
        let first = state.first_log_factor.as_slice();
        for (i, k) in state.log_factor.as_mut_slice().iter_mut().enumerate() {
            *k += GIVE * asked.as_slice()[i] / (said.as_slice()[i] + 0.01);
            if said.as_slice()[i] < 0.02 {
                *k += RETURN * (first[i] - *k);
            }
            *k = k.clamp(LOG_FACTOR.0, LOG_FACTOR.1);
        }
    }

    /// What `heights` miss at lines, beside them and at the outer cells (nothing there): mask and misses, metres.
    pub(super) fn misses(&self, heights: &Grid<f32>) -> (Mask, Grid<f64>) {
        let (rows, cols) = heights.shape();
        let mut known = Mask::from_fn(rows, cols, |c| self.ground.is_outer(c.row * cols + c.col));
        let mut misses = Grid::filled(rows, cols, 0.0);
        let mut tell = |index: usize, target: f32| {
            known.as_mut_slice()[index] = true;
            misses.as_mut_slice()[index] = f64::from(target) - f64::from(heights.as_slice()[index]);
        };
        for Witness { index, allowed: (low, high) } in &self.witnesses {
            let z = heights.as_slice()[*index];
            let target = z.clamp(*low, high.max(*low));
            if target != z {
                tell(*index, target);
            }
        }
        for (index, drawn) in self.ground.drawn.as_slice().iter().enumerate() {
            if let Some((_, height)) = drawn {
                tell(index, *height);
            }
        }
        (known, misses)
    }
}

/// The height that makes the upwind gradient `rise` a cell, from the lower neighbours of both axes (Rouy and Tourin 1992).
fn eikonal(a: f32, b: f32, rise: f32) -> f32 {
    let (low, high) = (a.min(b), a.max(b));
    if high - low < rise {
        0.5 * (low + high + (2.0 * rise * rise - (high - low) * (high - low)).sqrt())
    } else {
        low + rise
    }
}
