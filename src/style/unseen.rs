//! What a coarse system leaves open in terrain that it has not seen: by that the strength of detail is measured.

use super::SystemPlan;
use crate::control::{Control, Progress, Stage};
use crate::error::Result;
use crate::extract::ridges_and_valleys;
use crate::grid::Grid;
use crate::seed::Seed;
use crate::systems::task::Exemplar;

/// Smallest side of half an exemplar that a coarse system learns.
const SMALLEST_HALF: usize = 48;
/// Width of the seam in which one half's answer becomes the other's, cells.
const SEAM: f32 = 8.0;

/// Whether [`unseen_surface`] is asked of this system with an exemplar of `rows` x `cols` cells.
#[must_use]
pub(crate) fn has_unseen(plan: &dyn SystemPlan, rows: usize, cols: usize) -> bool {
    plan.meets_lines() && rows.min(cols / 2) >= SMALLEST_HALF
}

/// What the coarse system makes of the exemplar's lines where it has not seen the exemplar, unit interval: it learns each half of
/// the exemplar ([`SystemPlan::halved`]; or both within the budget) and answers in the other one. None where a half is too small or
/// has nothing to learn from, and for a system that does not pass through its lines.
///
/// # Errors
/// When the exemplar has no lines, a training diverges, or the work is stopped.
pub fn unseen_surface(
    plan: &dyn SystemPlan,
    exemplar: &Exemplar,
    control: Control<'_>,
) -> Result<Option<Grid<f32>>> {
    let (rows, cols) = exemplar.heights.shape();
    if !has_unseen(plan, rows, cols) {
        return Ok(None);
    }
    let middle = cols / 2;
    let lines = exemplar.variants(1)?.swap_remove(0);
    let seed = exemplar.seed.derive("held out");
    let plan = plan.halved();
    let Control { progress, budget, stop, .. } = control;
    let range = exemplar.normalization;
    let mut answer = |half: usize, first: usize, width: usize| -> Result<Option<Grid<f32>>> {
        let Some(part) = learnable(exemplar, first, width, seed)? else { return Ok(None) };
        let budget = budget.map(|both| both / 2);
        let mut told = |of_half: &Progress<'_>| {
            let share = budget.map_or(of_half.share, |budget| of_half.seconds / budget.as_secs_f64());
            let share = 0.5 * (half as f64 + share.min(1.0));
            let (step, steps) = (half * of_half.steps + of_half.step, 2 * of_half.steps);
            progress(&Progress { stage: Stage::Calibration, step, steps, share, ..*of_half });
        };
        let control = Control { progress: &mut told, budget, checkpoints: None, stop: stop.clone() };
        let system = plan.learn(&part, control)?;
        // As `Style::generate` has it: metres of the half's range, drawn in that of the whole.
        let there_and_back = lines.map_heights(|z| {
            let metres = range.to_metres(f64::from(z)) as f32;
            range.to_unit(f64::from(metres)) as f32
        });
        let unit = system.draw(&there_and_back, seed, &stop)?;
        let metres = range.denormalize(&unit);
        Ok(Some(metres.map(|z| range.to_unit(f64::from(*z)) as f32)))
    };
    let Some(by_west) = answer(0, 0, middle)? else { return Ok(None) };
    let Some(mut whole) = answer(1, middle, cols - middle)? else { return Ok(None) };
    for (cell, z) in by_west.cells() {
        let share = (0.5 + (cell.col as f32 - middle as f32) / SEAM).clamp(0.0, 1.0);
        whole[cell] += share * (z - whole[cell]);
    }
    Ok(Some(whole))
}

/// The part of the exemplar in `width` columns from `first` on; none when it is void, level or shows no line.
fn learnable(exemplar: &Exemplar, first: usize, width: usize, seed: Seed) -> Result<Option<Exemplar>> {
    let dem = &exemplar.source.dem;
    let inside = |col: usize| (first..first + width).contains(&col);
    if !dem.valid().cells().any(|(cell, ok)| *ok && inside(cell.col)) {
        return Ok(None);
    }
    let part = Exemplar::new(&exemplar.source.columns(first, width)?, &exemplar.extraction, seed)?;
    let lines = ridges_and_valleys(&part.heights, part.source.dem.valid(), &part.extraction)?;
    Ok((lines.line_count() > 0).then_some(part))
}
