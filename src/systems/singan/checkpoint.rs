//! A detail training that was interrupted, in a file: the finished scales, both networks of the one in work, moments of Adam.

use super::config::DetailConfig;
use super::detail::ScaleInfo;
use super::scale::Scale;
use crate::error::{Error, Result};
use crate::file;
use crate::grid::Grid;
use crate::seed::Seed;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Key of the description in the file's metadata.
const KEY: &str = "monadnock-detail-training";
/// Largest file that is read.
const LARGEST_FILE: u64 = 1 << 30;
const ALLOWED: &str = "allowed: a checkpoint written by `train`";

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

/// A state that was read.
#[derive(Debug)]
pub(super) struct State {
    path: PathBuf,
    pub(super) progress: Progress,
    pub(super) scales: Vec<Scale>,
    tensors: BTreeMap<String, Vec<f32>>,
}

impl State {
    /// The tensor of a name, which must have `count` finite values.
    ///
    /// # Errors
    /// When it is missing or damaged.
    pub(super) fn take(&mut self, name: &str, count: usize) -> Result<Vec<f32>> {
        let values = self.tensors.remove(name).unwrap_or_default();
        if values.len() != count || values.iter().any(|v| !v.is_finite()) {
            let found = format!("{} values", values.len());
            return Err(Error::file(&self.path, name, found, format!("allowed: {count} finite ones")));
        }
        Ok(values)
    }
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
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
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
    let tensors: Vec<(String, usize, Vec<u8>)> = finished
        .chain(state.iter().map(|(name, values)| (name.clone(), *values)))
        .map(|(name, values)| (name, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect()))
        .collect();
    let views = tensors.iter().map(|(name, length, bytes)| {
        let view = TensorView::new(Dtype::F32, vec![*length], bytes).expect("the length fits the shape");
        (name.as_str(), view)
    });
    let text = serde_json::to_string(progress).expect("progress is plain data");
    let metadata = HashMap::from([(KEY.to_owned(), text)]);
    let bytes = safetensors::serialize(views, Some(metadata)).expect("names are unique");
    file::write_bytes(path, &bytes)
}

/// Reads the state of a training.
///
/// # Errors
/// When the file is damaged or belongs to another training.
pub(super) fn load(path: &Path, identity: &str, config: &DetailConfig) -> Result<State> {
    let damaged = |e: safetensors::SafeTensorError| Error::file(path, "safetensors header", e, ALLOWED);
    let bytes = file::read_whole(path, LARGEST_FILE)?;
    let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(damaged)?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(damaged)?;
    let Some(text) = metadata.metadata().as_ref().and_then(|m| m.get(KEY)) else {
        return Err(Error::file(path, "metadata", "without a description", ALLOWED));
    };
    let progress: Progress =
        serde_json::from_str(text).map_err(|e| Error::file(path, format!("metadata {KEY}"), e, ALLOWED))?;
    if progress.identity != identity {
        let allowed = "to resume, exemplar, seed and configuration of the detail must be those of the interrupted \
                       training (its learning rate, steps and budget may differ); remove the file to begin anew";
        return Err(Error::file(path, "detail training", "another one", allowed));
    }
    let mut read = BTreeMap::new();
    for (name, view) in tensors.iter() {
        let values = view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        read.insert(name.to_owned(), values);
    }
    let mut state = State { path: path.to_owned(), progress, scales: Vec::new(), tensors: read };
    if state.progress.scales.len() != state.progress.steps.len() {
        return Err(Error::file(path, "finished scales", state.progress.scales.len(), ALLOWED));
    }
    for (i, info) in state.progress.scales.clone().iter().enumerate() {
        let values = state.tensors.remove(&format!("scale.{i}")).unwrap_or_default();
        state.scales.push(Scale::from_info(config, i, info, values).map_err(|e| e.in_file(path))?);
    }
    Ok(state)
}
