//! What a training logs and remembers of itself.

use serde::{Deserialize, Serialize};

/// The unweighted losses of one epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossValues {
    /// l_gt, mean.
    pub ground_truth: f64,
    /// 1 - SSIM.
    pub(crate) ssim: f64,
    /// l_gradient, mean over pixels.
    pub(crate) gradient: f64,
    /// l_sketch.
    pub(crate) sketch: f64,
    /// l_smooth.
    pub(crate) smooth: f64,
    /// l_further.
    pub further: f64,
}

/// One line of the training log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochReport {
    /// Epoch, counted from 1.
    pub epoch: usize,
    /// Epochs in all.
    pub(crate) epochs: usize,
    /// Losses of this epoch, with its noise and masked parts.
    pub losses: LossValues,
    /// Seconds since the training began.
    pub(crate) seconds: f64,
}

/// What a training did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingRecord {
    /// Epochs run.
    pub(crate) epochs: usize,
    /// Seconds of the loop, preparation excluded.
    pub(crate) seconds: f64,
    /// Seconds to extract regions and weights before the loop.
    pub(crate) preparation_seconds: f64,
    /// Median seconds of an epoch.
    pub seconds_per_epoch: f64,
    /// A sample of the epochs, evenly spaced, the last included.
    pub history: Vec<EpochReport>,
}
