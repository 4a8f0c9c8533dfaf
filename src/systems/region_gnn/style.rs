//! A trained style: one piece of terrain turned into a model that draws more of its kind.
//!
//! [`Dem`] and a window -> [`learn`] -> [`Style`] -> one `.safetensors` file that holds all that generation needs. The file's
//! tensors are the weights and the exemplar's parts; everything else is JSON under the one metadata key [`KEY`].

use super::blend::BlendUse;
use super::config::{Preset, RegionGnnConfig};
use super::generate::{GenerationConfig, RegionGnn, needs_correction};
use super::network::Network;
use super::train::{Control, EpochReport, Exemplar, TrainingRecord, train};
use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::extract::{self, ExtractionConfig};
use crate::file;
use crate::grid::{Cell, Grid};
use crate::machine;
use crate::metrics::{mean_valid_slope, psnr, ssim};
use crate::seed::Seed;
use crate::sketch::{LineMap, SketchPart, StrokeKind};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Metadata key of the style's description.
pub const KEY: &str = "monadnock";
/// Version of the file format that this program writes and reads.
const VERSION: u32 = 1;
/// More groups of held-out strokes cost time and tell nothing new.
const MOST_FOLDS: usize = 16;
/// No style comes near this size; a larger file is something else.
const LARGEST_FILE: u64 = 1 << 30;

/// Everything that a user can set, as one TOML file: `[extraction]`, `[model]`, `[generation]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StyleConfig {
    /// How lines are found.
    pub extraction: ExtractionConfig,
    /// The network and its training.
    pub model: RegionGnnConfig,
    /// What happens around the network when terrain is generated.
    pub generation: GenerationConfig,
}

impl StyleConfig {
    /// A named configuration.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        Self { model: RegionGnnConfig::preset(preset), ..Self::default() }
    }

    /// Checks every section.
    ///
    /// # Errors
    /// Names the first field that is out of range, or settings that do not go together.
    pub fn validate(&self) -> Result<()> {
        self.extraction.validate()?;
        self.model.validate()?;
        self.generation.matching.validate()?;
        if self.generation.folds == 1 || self.generation.folds > MOST_FOLDS {
            let allowed = format!("allowed: 0, or 2 to {MOST_FOLDS}");
            return Err(Error::value("generation.folds", self.generation.folds, allowed));
        }
        if needs_correction(&self.model) && self.generation.correction.is_none() {
            return Err(Error::value(
                "generation.correction",
                "none",
                "a model with anchored heights needs one: its own output means nothing on the lines",
            ));
        }
        Ok(())
    }
}

/// Where a style comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExemplarInfo {
    /// Name of the DEM: a file name or a bundled tile.
    pub name: String,
    /// First row of the window in that DEM.
    pub row: usize,
    /// First column of the window.
    pub col: usize,
    /// Rows of the window.
    pub rows: usize,
    /// Columns of the window.
    pub cols: usize,
    /// Cell size on the ground, (x, y) metres.
    pub cell_size: [f64; 2],
    /// SHA-256 of the whole DEM's heights and voids ([`fingerprint`]).
    pub source_sha256: String,
    /// SHA-256 of the window's heights and voids.
    pub sha256: String,
}

/// How well the model rebuilds its exemplar, and what the training cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingSummary {
    /// Epochs run.
    pub epochs: usize,
    /// Seconds of the training loop.
    pub seconds: f64,
    /// Seconds before the loop: regions, nearest parts, correction weights.
    pub preparation_seconds: f64,
    /// Median seconds of an epoch.
    pub seconds_per_epoch: f64,
    /// SSIM of the exemplar rebuilt from its own lines.
    pub ssim: f64,
    /// PSNR of the same, decibels.
    pub psnr: f64,
    /// l_gt of the same: mean squared error in the unit interval.
    pub l_gt: f64,
    /// Largest memory of the process, bytes; absent where the system does not tell.
    pub peak_memory: Option<u64>,
    /// A sample of the epochs.
    pub history: Vec<EpochReport>,
}

/// The description of a style: all but weights and parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StyleInfo {
    /// Version of the file format.
    pub version: u32,
    /// The resolved configuration.
    pub config: StyleConfig,
    /// Seed of the training.
    pub seed: Seed,
    /// Metres of the unit interval: the exemplar's range.
    pub normalization: Normalization,
    /// Where the style comes from.
    pub exemplar: ExemplarInfo,
    /// Mean slope of the exemplar, unit heights a cell; absent in styles of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_slope: Option<f64>,
    /// What the training did.
    pub training: TrainingSummary,
    /// Description of the detail model, for whom it concerns; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<serde_json::Value>,
}

/// A trained style.
#[derive(Clone, Debug)]
pub struct Style {
    /// The description.
    pub info: StyleInfo,
    /// The model.
    pub model: Arc<RegionGnn>,
    /// Tensors of the detail model by name, stored as `detail.<name>` and not looked into here.
    pub detail_tensors: Vec<(String, Vec<f32>)>,
}

/// The exemplar window of a DEM, ready to be learned.
#[derive(Clone, Debug)]
pub struct Source {
    /// The window.
    pub dem: Dem,
    /// Its description.
    pub info: ExemplarInfo,
}

impl Source {
    /// Cuts the window of `rows` x `cols` at `origin` out of a DEM called `name`.
    ///
    /// # Errors
    /// When the window reaches past the frame or holds voids only.
    pub fn new(name: &str, dem: &Dem, origin: Cell, rows: usize, cols: usize) -> Result<Self> {
        let window = dem.crop(origin, rows, cols)?;
        let cell = window.cell_size();
        let info = ExemplarInfo {
            name: name.to_owned(),
            row: origin.row,
            col: origin.col,
            rows,
            cols,
            cell_size: [cell.x(), cell.y()],
            source_sha256: fingerprint(dem),
            sha256: fingerprint(&window),
        };
        Ok(Self { dem: window, info })
    }
}

/// SHA-256 over shape, heights and voids of a DEM, as hexadecimal digits.
#[must_use]
pub fn fingerprint(dem: &Dem) -> String {
    let mut hasher = Sha256::new();
    let (rows, cols) = dem.shape();
    hasher.update((rows as u64).to_le_bytes());
    hasher.update((cols as u64).to_le_bytes());
    for (z, &ok) in dem.heights().as_slice().iter().zip(dem.valid().as_slice()) {
        hasher.update(z.to_le_bytes());
        hasher.update([u8::from(ok)]);
    }
    file::hex(&hasher.finalize())
}

/// Learns a style from an exemplar.
///
/// # Errors
/// When the configuration is out of range, the window is too small, level or without lines, or the training diverges.
pub fn learn(
    source: &Source,
    config: &StyleConfig,
    seed: Seed,
    mut progress: impl FnMut(&EpochReport),
) -> Result<Style> {
    learn_with(source, config, seed, Control::new(&mut progress))
}

/// As [`learn`], within a budget of time or with checkpoints.
///
/// # Errors
/// As [`learn`], and when a checkpoint cannot be written or does not belong to this training.
pub fn learn_with(source: &Source, config: &StyleConfig, seed: Seed, control: Control<'_>) -> Result<Style> {
    config.validate()?;
    let dem = &source.dem;
    let normalization = Normalization::of(dem);
    let heights = normalization.normalize(dem);
    let lines = extract::variants(&heights, dem.valid(), &config.extraction, config.model.extractions, seed)?;
    if lines[0].line_count() == 0 {
        let allowed = "the exemplar shows no ridge or valley; choose a window with relief, or lower \
                       extraction.min_accumulation, min_order or min_length";
        return Err(Error::value("number of line cells", 0, allowed));
    }
    let exemplar = Exemplar { heights, valid: dem.valid().clone(), lines };
    let (network, parts, record) = train(&exemplar, &config.model, seed, control)?;
    let model = RegionGnn::new(network, parts);
    let correction = config.generation.correction.filter(|_| needs_correction(&config.model));
    let rebuilt = model.reconstruct(&exemplar.lines[0], correction, seed)?;
    let training = summary(record, &rebuilt, &exemplar)?;
    // A budget decides the number of epochs; the configuration then tells how many it was.
    let model_config = RegionGnnConfig { epochs: training.epochs, ..config.model.clone() };
    let info = StyleInfo {
        version: VERSION,
        config: StyleConfig { model: model_config, ..config.clone() },
        seed,
        normalization,
        exemplar: source.info.clone(),
        mean_slope: Some(mean_valid_slope(&exemplar.heights, &exemplar.valid)?),
        training,
        detail: None,
    };
    Ok(Style { info, model: Arc::new(model), detail_tensors: Vec::new() })
}

fn summary(record: TrainingRecord, rebuilt: &Grid<f32>, exemplar: &Exemplar) -> Result<TrainingSummary> {
    let (truth, valid) = (&exemplar.heights, &exemplar.valid);
    let rebuilt = rebuilt.map(|z| z.clamp(0.0, 1.0));
    let psnr = psnr(&rebuilt, truth, valid, 1.0)?;
    Ok(TrainingSummary {
        epochs: record.epochs,
        seconds: record.seconds,
        preparation_seconds: record.preparation_seconds,
        seconds_per_epoch: record.seconds_per_epoch,
        ssim: ssim(&rebuilt, truth, valid, 1.0)?,
        psnr,
        l_gt: 10f64.powf(-psnr / 10.0),
        peak_memory: machine::peak_memory(),
        history: record.history,
    })
}

impl Style {
    /// Terrain in metres for lines in metres. `range`: the elevations that stand for the exemplar's lowest and highest
    /// height; none takes the exemplar's own.
    ///
    /// The model is trusted as it is, without [`GenerationConfig::folds`]: a drawing asks for the style, and its few smooth
    /// strokes would confirm none of it. For the same reason only dense sketches are blended ([`BlendUse::Dense`]).
    /// Evaluations, where heights on lines are real, use the folds and always blend.
    ///
    /// # Errors
    /// When there is no line.
    pub fn generate(&self, lines: &LineMap, range: Option<Normalization>, seed: Seed) -> Result<Grid<f32>> {
        let range = range.unwrap_or(self.info.normalization);
        let unit = lines.map_heights(|z| range.to_unit(f64::from(z)) as f32);
        let generation = GenerationConfig {
            folds: 0,
            blend: match self.info.config.generation.blend {
                BlendUse::Always => BlendUse::Dense,
                other => other,
            },
            ..self.info.config.generation.clone()
        };
        let terrain = self.model.generate(&unit, &generation, seed)?;
        Ok(terrain.map(|&z| range.to_metres(f64::from(z)) as f32))
    }

    /// Writes the style to a file, all or nothing.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// Never: names are unique and lengths fit by construction.
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
        let params = self.model.network().params();
        for ((name, var), values) in params.iter().zip(params.snapshot()?) {
            tensors.push((
                format!("weights.{name}"),
                Dtype::F32,
                var.dims().to_vec(),
                bytes_of(&values, f32::to_le_bytes),
            ));
        }
        let parts = self.model.parts();
        let lengths: Vec<u32> = parts.iter().map(|p| p.cells.len() as u32).collect();
        let kinds: Vec<u8> = parts.iter().map(|p| u8::from(p.kind == StrokeKind::Valley)).collect();
        let cells: Vec<u32> =
            parts.iter().flat_map(|p| &p.cells).flat_map(|c| [c.row as u32, c.col as u32]).collect();
        let heights: Vec<f32> = parts.iter().flat_map(|p| p.heights.iter().copied()).collect();
        let count = heights.len();
        tensors.push((
            "parts.lengths".into(),
            Dtype::U32,
            vec![parts.len()],
            bytes_of(&lengths, u32::to_le_bytes),
        ));
        tensors.push(("parts.valley".into(), Dtype::U8, vec![parts.len()], kinds));
        tensors.push(("parts.cells".into(), Dtype::U32, vec![count, 2], bytes_of(&cells, u32::to_le_bytes)));
        tensors.push(("parts.heights".into(), Dtype::F32, vec![count], bytes_of(&heights, f32::to_le_bytes)));
        for (name, values) in &self.detail_tensors {
            let bytes = bytes_of(values, f32::to_le_bytes);
            tensors.push((format!("detail.{name}"), Dtype::F32, vec![values.len()], bytes));
        }
        let views = tensors.iter().map(|(name, dtype, shape, bytes)| {
            let view = TensorView::new(*dtype, shape.clone(), bytes).expect("the length fits the shape");
            (name.as_str(), view)
        });
        let info = serde_json::to_string(&self.info).expect("a description is plain data");
        // One key only: the order of several would not be the same in every run.
        let metadata = HashMap::from([(KEY.to_owned(), info)]);
        let bytes = safetensors::serialize(views, Some(metadata)).expect("names are unique");
        file::write_bytes(path, &bytes)
    }

    /// Reads a style.
    ///
    /// # Errors
    /// When the file is not a style, is damaged, or was written by a newer program.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = file::read_whole(path, LARGEST_FILE)?;
        let (info, tensors) = open(path, &bytes)?;
        let parts = read_parts(path, &tensors)?;
        info.config.validate().map_err(|e| e.in_file(path))?;
        let network =
            Network::new(&info.config.model, parts.len(), info.seed).map_err(|e| e.in_file(path))?;
        let known: Vec<String> = network.params().iter().map(|(name, _)| format!("weights.{name}")).collect();
        let mut names: Vec<&str> = tensors.names();
        names.sort_unstable();
        if let Some(extra) =
            names.iter().find(|n| n.starts_with("weights.") && !known.iter().any(|k| k == *n))
        {
            return Err(Error::file(path, "tensor", extra, "the style's configuration has no such weight"));
        }
        for name in &known {
            let values = floats(path, &tensors, name)?;
            network.params().assign(&name["weights.".len()..], &values).map_err(|e| e.in_file(path))?;
        }
        let mut detail_tensors = Vec::new();
        for name in names.iter().filter_map(|name| name.strip_prefix("detail.")) {
            let values = floats(path, &tensors, &format!("detail.{name}"))?;
            detail_tensors.push((name.to_owned(), values));
        }
        Ok(Self { info, model: Arc::new(RegionGnn::new(network, parts)), detail_tensors })
    }
}

/// What a style file says of itself, without its weights; with `parameters` and `parts` counted.
///
/// # Errors
/// As [`Style::load`].
pub fn describe(path: &Path) -> Result<serde_json::Value> {
    let style = Style::load(path)?;
    let mut value = serde_json::to_value(&style.info)
        .map_err(|e| Error::file(path, "description", e, "it must be plain data"))?;
    let ridges = style.model.parts().iter().filter(|p| p.kind == StrokeKind::Ridge).count();
    let parts = style.model.parts().len();
    value["parameters"] = style.model.network().params().value_count().into();
    value["parts"] = serde_json::json!({ "ridge": ridges, "valley": parts - ridges });
    Ok(value)
}

fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<(StyleInfo, SafeTensors<'a>)> {
    let damaged = |e: safetensors::SafeTensorError| {
        Error::file(path, "safetensors header", e, "allowed: a style written by `train`")
    };
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(damaged)?;
    let Some(text) = metadata.metadata().as_ref().and_then(|m| m.get(KEY)) else {
        let allowed = format!("a style has the key \"{KEY}\"; this file holds something else");
        return Err(Error::file(path, "metadata", "without a description", allowed));
    };
    let field = |name: &str, e: serde_json::Error| {
        Error::file(path, format!("metadata {name}"), e, format!("allowed: what version {VERSION} writes"))
    };
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| field(KEY, e))?;
    let version = value.get("version").and_then(serde_json::Value::as_u64);
    if version != Some(u64::from(VERSION)) {
        let found = version.map_or_else(|| "missing".to_owned(), |v| v.to_string());
        return Err(Error::file(
            path,
            "format version",
            found,
            format!("this program reads version {VERSION}"),
        ));
    }
    Ok((serde_json::from_value(value).map_err(|e| field(KEY, e))?, tensors))
}

fn read_parts(path: &Path, tensors: &SafeTensors<'_>) -> Result<Vec<SketchPart>> {
    let lengths = integers(path, tensors, "parts.lengths")?;
    let kinds = tensor(path, tensors, "parts.valley", Dtype::U8)?.to_vec();
    let cells = integers(path, tensors, "parts.cells")?;
    let heights = floats(path, tensors, "parts.heights")?;
    let total: u64 = lengths.iter().map(|&n| u64::from(n)).sum();
    if kinds.len() != lengths.len() || total != heights.len() as u64 || 2 * heights.len() != cells.len() {
        let found = format!(
            "{} lengths, {} kinds, {} cells, {} heights",
            lengths.len(),
            kinds.len(),
            cells.len() / 2,
            heights.len()
        );
        return Err(Error::file(
            path,
            "exemplar parts",
            found,
            "one kind a part, one cell and height each of its cells",
        ));
    }
    if lengths.contains(&0) || heights.iter().any(|z| !z.is_finite()) {
        return Err(Error::file(
            path,
            "exemplar parts",
            "an empty part or a height that is not finite",
            "allowed: neither",
        ));
    }
    let mut next = 0;
    let part = |(&length, &valley): (&u32, &u8)| {
        let range = next..next + length as usize;
        next = range.end;
        SketchPart {
            kind: if valley == 0 { StrokeKind::Ridge } else { StrokeKind::Valley },
            cells: range
                .clone()
                .map(|i| Cell::new(cells[2 * i] as usize, cells[2 * i + 1] as usize))
                .collect(),
            heights: heights[range].to_vec(),
        }
    };
    Ok(lengths.iter().zip(&kinds).map(part).collect())
}

fn tensor<'a>(path: &Path, tensors: &SafeTensors<'a>, name: &str, dtype: Dtype) -> Result<&'a [u8]> {
    match tensors.tensor(name) {
        Ok(view) if view.dtype() == dtype => Ok(view.data()),
        Ok(view) => Err(Error::file(
            path,
            format!("type of tensor {name}"),
            format!("{:?}", view.dtype()),
            format!("allowed: {dtype:?}"),
        )),
        Err(_) => Err(Error::file(path, format!("tensor {name}"), "missing", "a style has it")),
    }
}

fn floats(path: &Path, tensors: &SafeTensors<'_>, name: &str) -> Result<Vec<f32>> {
    let bytes = tensor(path, tensors, name, Dtype::F32)?;
    Ok(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
}

fn integers(path: &Path, tensors: &SafeTensors<'_>, name: &str) -> Result<Vec<u32>> {
    let bytes = tensor(path, tensors, name, Dtype::U32)?;
    Ok(bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
}

fn bytes_of<T: Copy>(values: &[T], encode: impl Fn(T) -> [u8; 4]) -> Vec<u8> {
    values.iter().flat_map(|&v| encode(v)).collect()
}
