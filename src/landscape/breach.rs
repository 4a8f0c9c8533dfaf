//! Ways out for what is dammed: pits are drained by cutting, not by filling.
//!
//! Terrain and lines -> terrain. Every pit follows its least-cost route to a lower cell or a base (drawn valley or frame) and
//! the ground on the way is cut to just below the pit (Lindsay 2016, with a bound on the depth that grows pass by pass). Cells
//! of lines keep their heights; ground beside a drawn river that lies lower than the river is raised to it.

use super::fit::LandscapeFit;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::flow::{Drainage, Role, Surface, drain, ponded_share};
use crate::grid::{Cell, Grid, Mask, d8};
use crate::sketch::{LineMap, StrokeKind};
use serde::{Deserialize, Serialize};

/// Fall from cell to cell of a cut, relative to the relief; never so small that heights cannot tell it.
const FALL: f32 = 1e-6;
/// How far breaching may go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BreachConfig {
    /// Deepest cut of each pass, relative to the relief.
    pub(crate) depths: Vec<f32>,
    /// Longest cut, cells.
    pub(crate) longest: usize,
    /// Passes end when less than this share of the cells lies in ponds; 0 runs all of them.
    pub(crate) pit_share: f64,
}

impl Default for BreachConfig {
    /// Cuts of up to 7 % of the relief until .3 % of the cells are left in pits.
    fn default() -> Self {
        Self { depths: vec![0.01, 0.02, 0.04, 0.07], longest: 96, pit_share: 0.003 }
    }
}

impl BreachConfig {
    /// Cuts until no more of the terrain lies in pits than of an exemplar.
    #[must_use]
    pub fn like(fit: &LandscapeFit) -> Self {
        let config = Self::default();
        Self { pit_share: fit.pit_share.max(config.pit_share), ..config }
    }
}

/// Terrain with its dams cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Breached {
    /// Heights, metres.
    pub heights: Grid<f32>,
    /// Share of the cells in ponds ([`ponded_share`]) before.
    pub pits_before: f64,
    /// Share of the cells in ponds now.
    pub pits_after: f64,
    /// Number of cuts.
    pub(crate) cuts: usize,
}

/// Cuts the dams of `heights`. Line cells keep their heights to the bit.
///
/// # Errors
/// When the shapes differ, a height is not finite, a depth is not between 0 and 1, or when it is stopped.
pub fn breach(heights: &Grid<f32>, lines: &LineMap, config: &BreachConfig, stop: &Stop) -> Result<Breached> {
    let (rows, cols) = heights.shape();
    if let Some(depth) = config.depths.iter().find(|depth| !(0.0..=1.0).contains(*depth)) {
        return Err(Error::value("depth of a breach", depth, "allowed: 0 to 1"));
    }
    if lines.shape() != (rows, cols) {
        let allowed = format!("the lines are {:?}", lines.shape());
        return Err(Error::value("terrain to breach", format!("{:?}", (rows, cols)), allowed));
    }
    let roles = lines.kinds().map(|kind| match kind {
        Some(StrokeKind::Valley) => Role::Base,
        Some(StrokeKind::Ridge) => Role::Divide,
        None => Role::Ground,
    });
    let fixed = lines.mask();
    let everywhere = Mask::filled(rows, cols, true);
    let surface = |z: &Grid<f32>| Surface::new(z.clone(), everywhere.clone());
    let (low, high) =
        heights.as_slice().iter().fold((f32::MAX, f32::MIN), |(low, high), &z| (low.min(z), high.max(z)));
    let relief = high - low;
    let fall = (FALL * relief).max(2.0 * f32::EPSILON * low.abs().max(high.abs()));
    let mut breached = Breached { heights: heights.clone(), pits_before: 0.0, pits_after: 0.0, cuts: 0 };
    let mut current = surface(heights)?;
    breached.pits_before = ponded_share(&current);
    breached.pits_after = breached.pits_before;
    for &depth in &config.depths {
        if breached.pits_after < config.pit_share {
            break;
        }
        let drainage = drain(&current, &roles, None, stop)?;
        let limits = Limits { depth: depth * relief, longest: config.longest, fall };
        breached.cuts += cut_all(&mut breached.heights, &drainage, &fixed, &limits);
        current = surface(&breached.heights)?;
        breached.pits_after = ponded_share(&current);
    }
    Ok(breached)
}

/// Bounds of a cut, metres and cells.
struct Limits {
    depth: f32,
    longest: usize,
    fall: f32,
}

/// One pass over all pits, from low to high; returns the number of cuts.
fn cut_all(heights: &mut Grid<f32>, drainage: &Drainage, fixed: &Mask, limits: &Limits) -> usize {
    let (rows, cols) = heights.shape();
    let mut cuts = 0;
    for &pit in drainage.order() {
        let cell = Cell::new(pit as usize / cols, pit as usize % cols);
        let is_inner = cell.row > 0 && cell.col > 0 && cell.row + 1 < rows && cell.col + 1 < cols;
        if !is_inner || fixed[cell] {
            continue;
        }
        let is_lowest = (0..8)
            .all(|code| d8::neighbour(cell, code, rows, cols).is_none_or(|n| heights[n] >= heights[cell]));
        if is_lowest {
            cuts +=
                usize::from(cut(heights.as_mut_slice(), drainage, fixed.as_slice(), pit as usize, limits));
        }
    }
    cuts
}

/// Cuts the way from `pit` to the first lower cell, if the limits allow.
fn cut(z: &mut [f32], drainage: &Drainage, fixed: &[bool], pit: usize, limits: &Limits) -> bool {
    let bottom = z[pit];
    let floor = |step: usize| bottom - limits.fall * step as f32;
    let mut here = pit;
    let mut length = 0;
    loop {
        length += 1;
        // An outlet that stands higher than the pit is cut as well.
        let Some(next) = drainage.receiver(here) else { break };
        if z[next] < floor(length) {
            break;
        }
        if z[next] - bottom > limits.depth || length == limits.longest {
            return false;
        }
        if fixed[next] && drainage.receiver(next).is_none() {
            // A line is not cut. What lies lower beside the river that it runs to is a moat: it is filled.
            fill_way(z, drainage, fixed, pit, length, z[next], limits.fall);
            return true;
        }
        if fixed[next] && z[next] > bottom + 0.02 * limits.depth {
            return false;
        }
        here = next;
    }
    here = pit;
    for step in 1..length {
        let Some(next) = drainage.receiver(here) else { break };
        if !fixed[next] {
            z[next] = floor(step);
        }
        here = next;
    }
    true
}

/// Raises the way from `pit` to a river `length` cells away, so that it falls to the river's `level`.
fn fill_way(
    z: &mut [f32],
    drainage: &Drainage,
    fixed: &[bool],
    pit: usize,
    length: usize,
    level: f32,
    fall: f32,
) {
    let mut here = Some(pit);
    for step in (1..=length).rev() {
        let Some(cell) = here else { break };
        if !fixed[cell] {
            z[cell] = z[cell].max(level + fall * step as f32);
        }
        here = drainage.receiver(cell);
    }
}
