//! A training that was interrupted, in a file: weights, moments of Adam, what was logged.

use super::record::EpochReport;
use crate::error::Result;
use crate::learn::{Adam, ParamStore, Resumable};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How far a training has come, its weights apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Progress {
    /// Which training: exemplar, seed and configuration.
    pub(super) identity: String,
    /// Epochs done.
    pub(super) epoch: usize,
    /// Seconds spent.
    pub(super) seconds: f64,
    /// A sample of the epochs: every `every`-th.
    pub(super) history: Vec<EpochReport>,
    pub(super) every: usize,
    /// Loss, smoothed over epochs, its lowest value and when that was.
    pub(super) smoothed: Option<f64>,
    pub(super) lowest: Option<f64>,
    pub(super) lowest_epoch: usize,
}

/// Most epochs in a log; beyond it every second one is dropped.
const LONGEST_LOG: usize = 400;
/// Share of the newest epoch in the smoothed loss.
const NEWEST: f64 = 0.05;
/// A loss counts as lower when it is by this share.
const LOWER: f64 = 1e-3;

impl Progress {
    pub(super) fn start(identity: String) -> Self {
        let none = None;
        Self {
            identity,
            epoch: 0,
            seconds: 0.0,
            history: Vec::new(),
            every: 1,
            smoothed: none,
            lowest: none,
            lowest_epoch: 0,
        }
    }

    /// Counts one epoch with its report and its weighted loss.
    pub(super) fn count(&mut self, report: EpochReport, loss: f64) {
        self.epoch = report.epoch;
        self.seconds = report.seconds;
        if (report.epoch - 1).is_multiple_of(self.every) {
            self.history.push(report);
        }
        if self.history.len() > LONGEST_LOG {
            let mut index = 0;
            self.history.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.every *= 2;
        }
        let smoothed = self.smoothed.map_or(loss, |s| s + NEWEST * (loss - s));
        self.smoothed = Some(smoothed);
        if self.lowest.is_none_or(|lowest| smoothed < lowest * (1.0 - LOWER)) {
            (self.lowest, self.lowest_epoch) = (Some(smoothed), report.epoch);
        }
    }
}

impl Resumable for Progress {
    const KEY: &'static str = "monadnock-training";
    const TRAINING: &'static str = "training";

    fn identity(&self) -> &str {
        &self.identity
    }
}

/// Writes the state of a training, all or nothing.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn save(path: &Path, progress: &Progress, params: &ParamStore, adam: &Adam) -> Result<()> {
    let weights = params.snapshot()?;
    let (mean, square): (Vec<&[f32]>, Vec<&[f32]>) = adam.moments().unzip();
    let kinds = [("weights", weights.iter().map(|w| &w[..]).collect()), ("mean", mean), ("square", square)];
    let named = kinds.iter().flat_map(|(kind, all)| {
        params.iter().zip(all).map(move |((name, _), values)| (format!("{kind}.{name}"), *values))
    });
    progress.save(path, named)
}

/// Reads the state of a training into parameters and moments.
///
/// # Errors
/// When the file is damaged or belongs to another training.
pub(super) fn load(path: &Path, identity: &str, params: &ParamStore, adam: &mut Adam) -> Result<Progress> {
    let (progress, mut numbers) = Progress::load(path, identity)?;
    let mut read = |kind: &str| -> Result<Vec<Vec<f32>>> {
        params.iter().map(|(name, var)| numbers.take(&format!("{kind}.{name}"), var.elem_count())).collect()
    };
    params.restore(&read("weights")?)?;
    adam.restore(progress.epoch, read("mean")?, read("square")?);
    Ok(progress)
}
