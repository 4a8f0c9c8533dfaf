//! A training that was interrupted, in a file: weights, moments of Adam, what was logged.

use super::train::EpochReport;
use crate::error::{Error, Result};
use crate::file;
use crate::learn::{Adam, ParamStore};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::Path;

/// Key of the description in the file's metadata.
const KEY: &str = "monadnock-training";
/// Largest file that is read: weights three times over and a log.
const LARGEST_FILE: u64 = 1 << 30;

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

/// Writes the state of a training, all or nothing.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn save(path: &Path, progress: &Progress, params: &ParamStore, adam: &Adam) -> Result<()> {
    let mut tensors = Vec::new();
    let (mean, square) = adam.moments();
    for (kind, values) in [("weights", params.snapshot()?), ("mean", mean), ("square", square)] {
        for ((name, _), values) in params.iter().zip(values) {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            tensors.push((format!("{kind}.{name}"), values.len(), bytes));
        }
    }
    let views = tensors.iter().map(|(name, length, bytes)| {
        let view = TensorView::new(Dtype::F32, vec![*length], bytes).expect("the length fits the shape");
        (name.as_str(), view)
    });
    let text = serde_json::to_string(progress).expect("progress is plain data");
    let metadata = HashMap::from([(KEY.to_owned(), text)]);
    let bytes = safetensors::serialize(views, Some(metadata)).expect("names are unique");
    file::write_bytes(path, &bytes)
}

/// Reads the state of a training into parameters and moments.
///
/// # Errors
/// When the file is damaged or belongs to another training.
pub(super) fn load(path: &Path, identity: &str, params: &ParamStore, adam: &mut Adam) -> Result<Progress> {
    let allowed = "allowed: a checkpoint written by `train`";
    let damaged = |e: safetensors::SafeTensorError| Error::file(path, "safetensors header", e, allowed);
    let bytes = file::read_whole(path, LARGEST_FILE)?;
    let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(damaged)?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(damaged)?;
    let Some(text) = metadata.metadata().as_ref().and_then(|m| m.get(KEY)) else {
        return Err(Error::file(path, "metadata", "without a description", allowed));
    };
    let progress: Progress =
        serde_json::from_str(text).map_err(|e| Error::file(path, format!("metadata {KEY}"), e, allowed))?;
    if progress.identity != identity {
        let allowed = "to resume, exemplar, seed and configuration must be those of the interrupted training (the \
                       learning rate, the epochs and the budget may differ); remove the file to begin anew";
        return Err(Error::file(path, "training", "another one", allowed));
    }
    let read = |kind: &str| -> Result<Vec<Vec<f32>>> {
        let one = |(name, var): (&str, &candle_core::Var)| {
            let name = format!("{kind}.{name}");
            let view = tensors.tensor(&name).map_err(|e| Error::file(path, &name, e, allowed))?;
            let values: Vec<f32> =
                view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
            if values.len() != var.elem_count() || values.iter().any(|v| !v.is_finite()) {
                let found = format!("{} values", values.len());
                let allowed = format!("allowed: {} finite ones", var.elem_count());
                return Err(Error::file(path, name, found, allowed));
            }
            Ok(values)
        };
        params.iter().map(one).collect()
    };
    params.restore(&read("weights")?)?;
    adam.restore(progress.epoch, read("mean")?, read("square")?);
    Ok(progress)
}
