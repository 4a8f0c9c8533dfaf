//! A detail training that was interrupted, in a file: the finished scales, both networks of the one in work, moments of Adam.

use super::config::DetailConfig;
use super::scale::{Scale, ScaleInfo};
use crate::error::{Error, Result};
use crate::file;
use crate::grid::Grid;
use crate::learn::{Numbers, Resumable};
use crate::seed::Seed;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// How far a training has come, its weights apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Progress {
    /// Which training: exemplar, twins, seed and configuration.
    pub(super) identity: String,
    /// Steps of the finished scales.
    pub(super) steps: Vec<usize>,
    /// Steps done at the scale in work.
    pub(super) step: usize,
    /// Seconds spent in all, and at the scale in work.
    pub(super) seconds: f64,
    pub(super) scale_seconds: f64,
    /// The finished scales.
    pub(super) scales: Vec<ScaleInfo>,
    /// Steps that Adam has counted: generator, critic.
    pub(super) optimizer_steps: [usize; 2],
}

impl Resumable for Progress {
    const KEY: &'static str = "monadnock-detail-training";
    const TRAINING: &'static str = "detail training";

    fn identity(&self) -> &str {
        &self.identity
    }
}

/// A state that was read.
#[derive(Debug)]
pub(super) struct State {
    pub(super) progress: Progress,
    pub(super) scales: Vec<Scale>,
    pub(super) numbers: Numbers,
}

/// SHA-256 of all that decides a training, but how long and how fast it learns.
pub(super) fn identity(
    heights: &Grid<f32>,
    twins: &[Grid<f32>],
    config: &DetailConfig,
    seed: Seed,
) -> String {
    let config = DetailConfig { steps: 1, learning_rate: 1e-3, ..config.clone() };
    let mut hasher = Sha256::new();
    hasher.update(serde_json::to_vec(&(config, seed, heights.shape())).expect("plain data"));
    for map in std::iter::once(heights).chain(twins) {
        map.as_slice().iter().for_each(|z| hasher.update(z.to_le_bytes()));
    }
    file::hex(&hasher.finalize())
}

/// Writes the state of a training, all or nothing.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn save(
    path: &Path,
    progress: &Progress,
    scales: &[Scale],
    state: &[(String, &[f32])],
) -> Result<()> {
    let finished = scales.iter().enumerate().map(|(i, s)| (format!("scale.{i}"), &s.net.values[..]));
    progress.save(path, finished.chain(state.iter().cloned()))
}

/// Reads the state of a training.
///
/// # Errors
/// When the file is damaged or belongs to another training.
pub(super) fn load(path: &Path, identity: &str, config: &DetailConfig) -> Result<State> {
    let (progress, mut numbers) = Progress::load(path, identity)?;
    let (steps, finished) = (progress.steps.len(), progress.scales.len());
    if finished != steps {
        let allowed = format!("allowed: {steps}, as many as have their number of steps");
        return Err(Error::file(path, "finished scales", finished, allowed));
    }
    let mut scale = |(i, info)| {
        let values = numbers.take_all(&format!("scale.{i}"));
        Scale::from_info(config, i, info, values).map_err(|e| e.in_file(path))
    };
    let scales = progress.scales.iter().enumerate().map(&mut scale).collect::<Result<_>>()?;
    Ok(State { progress, scales, numbers })
}
