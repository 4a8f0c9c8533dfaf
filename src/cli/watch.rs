//! What a long call says of itself, as a progress bar a stage.

use super::Context;
use super::console::Progress as Bar;
use crate::control::{Checkpoints, Control, Progress, Stage};
use crate::error::Result;
use std::time::Duration;

/// Runs `work` under progress bars; Ctrl-C stops it.
pub(super) fn watched<T>(
    context: &Context,
    budget: Option<Duration>,
    checkpoints: Option<Checkpoints>,
    work: impl FnOnce(Control<'_>) -> Result<T>,
) -> Result<T> {
    let mut shown: Option<(Stage, Bar)> = None;
    let mut show = |done: &Progress<'_>| {
        if shown.as_ref().is_none_or(|(stage, _)| *stage != done.stage) {
            // The old one goes away before the new one comes.
            drop(shown.take());
            shown = Some((done.stage, context.console.progress(100, &label(done.stage))));
        }
        if let Some((_, bar)) = &shown {
            let figures = done.figures.iter().map(|(name, value)| format!("{name} {value:.3}"));
            bar.note(figures.collect::<Vec<_>>().join(", "));
            bar.reach((100.0 * done.share) as u64);
        }
    };
    work(Control { progress: &mut show, budget, checkpoints, stop: context.stop() })
}

fn label(stage: Stage) -> String {
    match stage {
        Stage::Coarse(name) => format!("training {name}"),
        Stage::Calibration => "measuring what is left to the detail".to_owned(),
        Stage::Detail(name) => format!("training detail: {name}"),
    }
}
