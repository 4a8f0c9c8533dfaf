//! The network as a part of a style: what is learned from an exemplar, how it is used, and how it is stored.
//!
//! Stored are the weights and the exemplar's parts as arrays, and settings and training as the description.

use super::config::{HeightFrame, NAME, RegionGnnConfig};
use super::generate::{GenerationConfig, RegionGnn, RegionGnnSystem, needs_correction};
use super::network::Network;
use super::record::{EpochReport, TrainingRecord};
use super::train::{DrawnExemplar, train};
use crate::arrays::Arrays;
use crate::checked::{Checked, Settings};
use crate::control::{Control, Stop};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use crate::machine;
use crate::metrics::{psnr, ssim};
use crate::seed::Seed;
use crate::sketch::{LineMap, SketchPart, StrokeKind};
use crate::systems::task::{Account, Exemplar, Part, SketchToTerrain, System, Use};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// More groups of held-out strokes cost time and tell nothing new.
const MOST_FOLDS: usize = 16;

/// Everything that can be set: the sections `[model]` and `[generation]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegionNetworkConfig {
    /// The network and its training.
    pub(crate) model: RegionGnnConfig,
    /// What happens around the network when terrain is generated.
    pub(crate) generation: GenerationConfig,
}

impl RegionNetworkConfig {}

impl Settings for RegionNetworkConfig {
    fn validate(&self) -> Result<()> {
        self.model.validate()?;
        self.generation.matching.validate()?;
        if self.generation.folds == 1 || self.generation.folds > MOST_FOLDS {
            let allowed = format!("allowed: 0, or 2 to {MOST_FOLDS}");
            return Err(Error::value("generation.folds", self.generation.folds, allowed));
        }
        if needs_correction(&self.model) && self.generation.correction.is_none() {
            let allowed =
                "a model with anchored heights needs one: its own output means nothing on the lines";
            return Err(Error::value("generation.correction", "none", allowed));
        }
        Ok(())
    }
}

/// How well the model rebuilds its exemplar, and what the training cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingSummary {
    /// Epochs run.
    pub epochs: usize,
    /// Seconds of the training loop.
    pub seconds: f64,
    /// Seconds before the loop: regions, nearest parts, correction weights.
    pub(crate) preparation_seconds: f64,
    /// Median seconds of an epoch.
    pub(crate) seconds_per_epoch: f64,
    /// SSIM of the exemplar rebuilt from its own lines; `None` where voids leave no window of 11x11 cells.
    pub ssim: Option<f64>,
    /// PSNR of the same, decibels.
    pub(crate) psnr: f64,
    /// l_gt of the same: mean squared error in the unit interval.
    pub(crate) l_gt: f64,
    /// Largest memory of the process, bytes; absent where the system does not tell.
    pub(crate) peak_memory: Option<u64>,
    /// A sample of the epochs.
    pub history: Vec<EpochReport>,
}

/// What a style file says of the network.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkDescription {
    config: Checked<RegionNetworkConfig>,
    training: TrainingSummary,
}

/// A network that has learned an exemplar, with its settings and its training.
#[derive(Clone, Debug)]
pub struct RegionNetwork {
    config: Checked<RegionNetworkConfig>,
    training: TrainingSummary,
    model: Arc<RegionGnn>,
}

impl RegionNetwork {
    /// The model.
    #[must_use]
    pub fn model(&self) -> &Arc<RegionGnn> {
        &self.model
    }

    /// What the training did.
    #[must_use]
    pub const fn training(&self) -> &TrainingSummary {
        &self.training
    }

    /// The same network with other settings of generation.
    ///
    /// # Errors
    /// When they are out of range or do not go with the model.
    pub(crate) fn with_generation(&self, generation: GenerationConfig) -> Result<Self> {
        let config = RegionNetworkConfig { generation, ..self.config.clone().into_inner() };
        Ok(Self { config: Checked::new(config)?, ..self.clone() })
    }

    fn with(&self, fine_tuning: bool) -> GenerationConfig {
        let own = &self.config.generation;
        let fine_tuning = fine_tuning.then(|| own.fine_tuning.unwrap_or_default());
        GenerationConfig { fine_tuning, correction: None, ..own.clone() }
    }
}

impl Part for RegionNetwork {
    const NAME: &'static str = NAME;
    type Config = RegionNetworkConfig;
    type Description = NetworkDescription;

    fn learn(exemplar: &Exemplar, config: &Checked<Self::Config>, control: Control<'_>) -> Result<Self> {
        let drawn = DrawnExemplar {
            heights: exemplar.heights.clone(),
            valid: exemplar.source.dem.valid().clone(),
            lines: exemplar.variants(config.model.extractions)?,
        };
        let stop = control.stop.clone();
        let (network, parts, record) = train(&drawn, &config.model, exemplar.seed, control)?;
        let model = RegionGnn::new(network, parts);
        let correction = config.generation.correction.filter(|_| needs_correction(&config.model));
        let rebuilt = model.reconstruct(&drawn.lines[0], correction, exemplar.seed, &stop)?;
        let training = summary(record, &rebuilt, &drawn)?;
        // A budget decides the number of epochs; the configuration then tells how many it was.
        let settings = RegionGnnConfig { epochs: training.epochs, ..config.model.clone() };
        let config = RegionNetworkConfig { model: settings, generation: config.generation.clone() };
        Ok(Self { config: Checked::new(config)?, training, model: Arc::new(model) })
    }

    fn config(&self) -> &RegionNetworkConfig {
        &self.config
    }

    fn account(&self) -> Account {
        let t = &self.training;
        let ssim = t.ssim.map(|ssim| format!("SSIM {ssim:.4}, ")).unwrap_or_default();
        let text = format!(
            "{} epochs in {:.1} s ({:.3} s each); exemplar rebuilt with {ssim}PSNR {:.2} dB, l_gt {:.2e}",
            t.epochs, t.seconds, t.seconds_per_epoch, t.psnr, t.l_gt
        );
        let figures = t.ssim.map(|ssim| ("SSIM", ssim)).into_iter();
        let figures = figures.chain([("PSNR", t.psnr), ("l_gt", t.l_gt)]).collect();
        Account { text, seconds: t.seconds, figures }
    }

    fn save(&self) -> Result<(NetworkDescription, Arrays)> {
        let mut arrays = Arrays::default();
        let params = self.model.network().params();
        for ((name, var), values) in params.iter().zip(params.snapshot()?) {
            arrays.put_f32(&format!("weights.{name}"), var.dims(), &values);
        }
        let parts = self.model.parts();
        let lengths: Vec<u32> = parts.iter().map(|p| p.cells.len() as u32).collect();
        let valleys: Vec<u8> = parts.iter().map(|p| u8::from(p.kind == StrokeKind::Valley)).collect();
        let cells: Vec<u32> =
            parts.iter().flat_map(|p| &p.cells).flat_map(|c| [c.row as u32, c.col as u32]).collect();
        let heights: Vec<f32> = parts.iter().flat_map(|p| p.heights.iter().copied()).collect();
        arrays.put_u32("parts.lengths", &[parts.len()], &lengths);
        arrays.put_u8("parts.valley", &[parts.len()], &valleys);
        arrays.put_u32("parts.cells", &[heights.len(), 2], &cells);
        arrays.put_f32("parts.heights", &[heights.len()], &heights);
        let description = NetworkDescription { config: self.config.clone(), training: self.training.clone() };
        Ok((description, arrays))
    }

    fn load(description: NetworkDescription, arrays: &mut Arrays, _: Option<&Arc<Dem>>) -> Result<Self> {
        let NetworkDescription { config, training } = description;
        let parts = read_parts(arrays)?;
        // Every weight is replaced: the seed does not matter.
        let network = Network::new(&config.model, parts.len(), Seed::default())?;
        for (name, _) in network.params().iter() {
            network.params().assign(name, &arrays.take_f32(&format!("weights.{name}"))?)?;
        }
        Ok(Self { config, training, model: Arc::new(RegionGnn::new(network, parts)) })
    }
}

impl SketchToTerrain for RegionNetwork {
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        self.model.generate(lines, &self.config.generation, seed, stop)
    }

    /// The model is trusted as it is, without [`GenerationConfig::folds`]: a drawing asks for the style, and its few smooth strokes
    /// would confirm none of it. For the same reason only dense sketches are blended ([`BlendUse::Dense`](super::BlendUse::Dense)).
    fn draw(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        self.model.generate(lines, &self.config.generation.for_drawings(), seed, stop)
    }

    /// With the embeddings that the exemplar's parts were given.
    fn rebuild(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        let config = &self.config;
        self.model.reconstruct(
            lines,
            config.generation.correction.filter(|_| needs_correction(&config.model)),
            seed,
            stop,
        )
    }
}

/// The uses of an absolute model beside its lines: matched embeddings as they are, and fine-tuned.
const ALIGNED: &str = "-aligned";
const TUNED: &str = "-tuned";

impl System for RegionNetwork {
    fn uses(config: &RegionNetworkConfig) -> Vec<Use> {
        match config.model.frame {
            HeightFrame::Anchored => vec![Use::default()],
            HeightFrame::Absolute => [ALIGNED, TUNED].map(|suffix| Use { suffix, corrected: true }).into(),
        }
    }

    fn used(self: &Arc<Self>, suffix: &str) -> Arc<dyn SketchToTerrain> {
        let generation = match suffix {
            ALIGNED => self.with(false),
            TUNED => self.with(true),
            _ => return self.clone(),
        };
        Arc::new(RegionGnnSystem { model: self.model.clone(), generation })
    }

    fn extractions(config: &RegionNetworkConfig) -> usize {
        config.model.extractions
    }

    fn untimed(config: &RegionNetworkConfig) -> RegionNetworkConfig {
        let mut untimed = config.clone();
        untimed.model.epochs = 1;
        untimed
    }

    /// Half of the epochs.
    fn for_half(config: &RegionNetworkConfig) -> RegionNetworkConfig {
        let mut half = config.clone();
        half.model.epochs = (half.model.epochs / 2).max(1);
        half
    }

    fn meets_lines(config: &RegionNetworkConfig) -> bool {
        needs_correction(&config.model)
    }
}

fn summary(record: TrainingRecord, rebuilt: &Grid<f32>, drawn: &DrawnExemplar) -> Result<TrainingSummary> {
    let (truth, valid) = (&drawn.heights, &drawn.valid);
    let rebuilt = rebuilt.map(|z| z.clamp(0.0, 1.0));
    let psnr = psnr(&rebuilt, truth, valid, 1.0)?;
    Ok(TrainingSummary {
        epochs: record.epochs,
        seconds: record.seconds,
        preparation_seconds: record.preparation_seconds,
        seconds_per_epoch: record.seconds_per_epoch,
        ssim: ssim(&rebuilt, truth, valid, 1.0).ok(),
        psnr,
        l_gt: 10f64.powf(-psnr / 10.0),
        peak_memory: machine::peak_memory(),
        history: record.history,
    })
}

fn read_parts(arrays: &mut Arrays) -> Result<Vec<SketchPart>> {
    let lengths = arrays.take_u32("parts.lengths")?;
    let kinds = arrays.take_u8("parts.valley")?;
    let cells = arrays.take_u32("parts.cells")?;
    let heights = arrays.take_f32("parts.heights")?;
    let total: u64 = lengths.iter().map(|&n| u64::from(n)).sum();
    if kinds.len() != lengths.len() || total != heights.len() as u64 || 2 * heights.len() != cells.len() {
        let found = format!(
            "{} lengths, {} kinds, {} cells, {} heights",
            lengths.len(),
            kinds.len(),
            cells.len() / 2,
            heights.len()
        );
        return Err(Error::value(
            "exemplar parts",
            found,
            "one kind a part, one cell and height each of its cells",
        ));
    }
    if lengths.contains(&0) || heights.iter().any(|z| !z.is_finite()) {
        let found = "an empty part or a height that is not finite";
        return Err(Error::value("exemplar parts", found, "allowed: neither"));
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
