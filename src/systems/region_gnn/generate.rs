//! From lines to terrain with a trained network (Liu & Benes 2025, 5.3 and 5.4).

use super::blend::{Blend, BlendUse};
use super::config::{HeightFrame, RegionGnnConfig};
use super::edges::Spare;
use super::graph::RegionGraph;
use super::losses::smooth;
use super::network::Network;
use super::train::{LineFrame, Prepared, SMOOTH_PAIRS};
use super::trust::{Evidence, without_each_fold};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::interpolation::{Correction, CorrectionKind};
use crate::learn::{Adam, Decay, Schedule, in_pool};
use crate::matching::{MatchConfig, align};
use crate::seed::Seed;
use crate::sketch::{LineMap, SketchPart, StrokeKind};
use crate::systems::task::SketchToTerrain;
use candle_core::{Device, Tensor, Var};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How the embeddings of a sketch's parts are refined before generation (5.4: "fine-tuning").
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FineTuning {
    /// Steps of Adam on the embeddings; everything else is frozen.
    pub steps: usize,
    /// Highest learning rate.
    pub learning_rate: f64,
    /// Weight of l_gt on the line cells.
    pub ground_truth: f64,
    /// Weight of l_smooth.
    pub smooth: f64,
}

impl Default for FineTuning {
    fn default() -> Self {
        Self { steps: 60, learning_rate: 0.05, ground_truth: 10.0, smooth: 0.01 }
    }
}

/// What happens around the network when terrain is generated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GenerationConfig {
    /// How drawn parts find their exemplar part; used by models with an embedding.
    pub matching: MatchConfig,
    /// Refinement of the matched embeddings; none keeps them.
    pub fine_tuning: Option<FineTuning>,
    /// Groups into which the strokes of a sketch are dealt; each in turn is kept from an anchored model, to see how
    /// much of its deviation from the base these strokes confirm (`trust`); only where the blend fades or is not taken. 0
    /// trusts the model as it is.
    pub folds: usize,
    /// When the model's deviation is weighted by place and blended with other surfaces (`blend`); anchored models only.
    pub blend: BlendUse,
    /// The last step that makes sketch heights exact; none leaves the network's own heights on the lines.
    pub correction: Option<CorrectionKind>,
}

impl Default for GenerationConfig {
    fn default() -> Self {
        Self {
            matching: MatchConfig::default(),
            fine_tuning: None,
            folds: 4,
            blend: BlendUse::Always,
            correction: Some(CorrectionKind::NaturalNeighbour),
        }
    }
}

impl GenerationConfig {
    /// For drawings, whose strokes are no evidence of the terrain between them.
    pub(super) fn for_drawings(&self) -> Self {
        let blend = if self.blend == BlendUse::Always { BlendUse::Dense } else { self.blend };
        Self { folds: 0, blend, ..self.clone() }
    }
}

/// A trained model: the network and the exemplar parts that its embeddings stand for.
#[derive(Debug)]
pub struct RegionGnn {
    network: Network,
    parts: Vec<SketchPart>,
}

impl RegionGnn {
    /// Joins a network with the parts on which it was trained (heights in the unit interval).
    #[must_use]
    pub fn new(network: Network, parts: Vec<SketchPart>) -> Self {
        Self { network, parts }
    }

    /// The network.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The exemplar's parts, heights in the unit interval.
    #[must_use]
    pub fn parts(&self) -> &[SketchPart] {
        &self.parts
    }

    /// The configuration.
    #[must_use]
    pub(crate) fn config(&self) -> &RegionGnnConfig {
        self.network.config()
    }

    /// Terrain for the exemplar's own lines with its own embeddings: how well the model fits.
    ///
    /// # Errors
    /// When there is no line, or it is stopped.
    pub(crate) fn reconstruct(
        &self,
        lines: &LineMap,
        correction: Option<CorrectionKind>,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Grid<f32>> {
        let frame = LineFrame::new(lines, self.config(), false, stop)?;
        let parts = seed.derive_indexed("exemplar parts", 0);
        let sketch = Prepared::new(lines, &frame, self.config(), parts, stop)?;
        let heights = self.run(&sketch, None, seed)?;
        finish(lines, heights, correction, stop)
    }

    /// Terrain for any lines; heights in and out in the unit interval (an anchored model takes any unit).
    ///
    /// The mean over [`RegionGnnConfig::splits`] part splits of the same lines, then the correction.
    ///
    /// # Errors
    /// When there is no line, or it is stopped.
    pub fn generate(
        &self,
        lines: &LineMap,
        config: &GenerationConfig,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Grid<f32>> {
        let splits = self.config().splits;
        let (rows, cols) = lines.shape();
        let frame = LineFrame::new(lines, self.config(), false, stop)?;
        let mut sum = vec![0.0f32; rows * cols];
        for split in 0..splits {
            let seed = seed.derive_indexed("split", split);
            let sketch = Prepared::new(lines, &frame, self.config(), seed, stop)?;
            let embedding = self.embedding_for(&sketch, config, seed)?;
            let heights = self.run(&sketch, embedding.as_ref(), seed)?;
            sum.iter_mut().zip(&heights).for_each(|(sum, z)| *sum += z / splits as f32);
        }
        let corrected = match (&frame.correction, config.correction) {
            // The same weights, already at hand.
            (Some(correction), Some(CorrectionKind::NaturalNeighbour)) => {
                Grid::from_vec(rows, cols, correction.correct(&sum))?
            }
            (_, correction) => finish(lines, sum, correction, stop)?,
        };
        let Some(base) = frame.base() else { return Ok(corrected) };
        let blend = Blend::new(config.blend, lines, base, stop)?;
        let blended = match &blend {
            Some(blend) => Grid::from_vec(rows, cols, blend.apply(base, corrected.as_slice()))?,
            None => corrected,
        };
        // Where lines lie close the blend has its own caution, and strokes held out say little of them.
        let doubt = blend.map_or(1.0, |blend| 1.0 - blend.amount());
        if config.folds == 0 || doubt == 0.0 {
            return Ok(blended);
        }
        let trust = 1.0 - doubt * (1.0 - self.trust(lines, config, seed, stop)?);
        Ok(Grid::from_fn(rows, cols, |c| {
            let base = base[c.row * cols + c.col];
            base + trust * (blended[c] - base)
        }))
    }

    /// The share of the deviation from the base that the sketch's own lines confirm; see [`super::trust`].
    fn trust(&self, lines: &LineMap, config: &GenerationConfig, seed: Seed, stop: &Stop) -> Result<f32> {
        let seed = seed.derive("held-out strokes");
        let kept = without_each_fold(lines, config.folds, seed);
        let rebuilt =
            kept.par_iter()
                .enumerate()
                .map(|(fold, kept)| {
                    let seed = seed.derive_indexed("fold", fold);
                    let frame = LineFrame::new(&kept.lines, self.config(), false, stop)?;
                    let sketch = Prepared::new(&kept.lines, &frame, self.config(), seed, stop)?;
                    let embedding = self.embedding_for(&sketch, config, seed)?;
                    let heights = self.run(&sketch, embedding.as_ref(), seed)?;
                    let corrected = match &frame.correction {
                        Some(correction) => correction.correct(&heights),
                        None => finish(&kept.lines, heights, config.correction, stop)?.into_vec(),
                    };
                    let blended = match frame.base() {
                        Some(base) => Blend::new(config.blend, &kept.lines, base, stop)?
                            .map(|b| b.apply(base, &corrected)),
                        None => None,
                    };
                    Ok((frame, blended.unwrap_or(corrected)))
                })
                .collect::<Result<Vec<_>>>()?;
        let mut evidence = Evidence::default();
        for (kept, (frame, corrected)) in kept.iter().zip(&rebuilt) {
            if let Some(base) = frame.base() {
                evidence.add(lines, kept, base, corrected);
            }
        }
        Ok(evidence.trust())
    }

    /// The state of every part of a sketch after message passing, with its kind (Fig. 13): what of the network can be
    /// looked at. Parts in the order in which they were cut, states as long as the network is wide.
    ///
    /// # Errors
    /// When there is no line.
    pub(crate) fn region_states(
        &self,
        lines: &LineMap,
        config: &GenerationConfig,
        seed: Seed,
    ) -> Result<Vec<(StrokeKind, Vec<f32>)>> {
        let stop = &Stop::new();
        let frame = LineFrame::new(lines, self.config(), false, stop)?;
        let sketch = Prepared::new(lines, &frame, self.config(), seed, stop)?;
        let embedding = self.embedding_for(&sketch, config, seed)?;
        let edges = sketch.draw(self.config(), 0.0, seed, &Spare::default());
        let states = self.network.region_states(&edges, embedding.as_ref(), seed)?;
        Ok(sketch.parts.iter().map(|part| part.kind).zip(states).collect())
    }

    /// Terrain for lines that are cut already; otherwise one split of [`generate`](Self::generate), trusted as it is.
    ///
    /// # Errors
    /// When there is no line or part, or a part is not valid.
    pub(crate) fn generate_from_parts(
        &self,
        lines: &LineMap,
        parts: Vec<SketchPart>,
        config: &GenerationConfig,
        seed: Seed,
    ) -> Result<Grid<f32>> {
        let stop = &Stop::new();
        parts.iter().try_for_each(SketchPart::validate)?;
        let frame = LineFrame::new(lines, self.config(), false, stop)?;
        let graph = Arc::new(RegionGraph::new(lines, &parts, frame.base(), self.config())?);
        let sketch = Prepared { graph, parts };
        let embedding = self.embedding_for(&sketch, config, seed)?;
        finish(lines, self.run(&sketch, embedding.as_ref(), seed)?, config.correction, stop)
    }

    fn run(&self, sketch: &Prepared, embedding: Option<&Tensor>, seed: Seed) -> Result<Vec<f32>> {
        let edges = sketch.draw(self.config(), 0.0, seed, &Spare::default());
        Ok(self.network.forward(&edges, embedding, seed)?.heights.detach().to_vec1::<f32>()?)
    }

    /// The embedding of every part of a sketch: its match's, fine-tuned if asked. None for models without embeddings.
    fn embedding_for(
        &self,
        sketch: &Prepared,
        config: &GenerationConfig,
        seed: Seed,
    ) -> Result<Option<Tensor>> {
        let Some(exemplar) = self.network.embedding() else { return Ok(None) };
        let matches = align(&sketch.parts, &self.parts, &config.matching, seed)?;
        let ids: Vec<u32> = matches.iter().map(|m| m.part.0).collect();
        let index = Tensor::from_slice(&ids, ids.len(), &Device::Cpu)?;
        let matched = exemplar.index_select(&index, 0)?.detach();
        match &config.fine_tuning {
            Some(tuning) => in_pool(|| self.fine_tune(sketch, &matched, tuning, seed)).map(Some),
            None => Ok(Some(matched)),
        }
    }

    /// Minimises l_gt on the line cells + l_smooth over the embeddings alone (5.4).
    fn fine_tune(
        &self,
        sketch: &Prepared,
        start: &Tensor,
        tuning: &FineTuning,
        seed: Seed,
    ) -> Result<Tensor> {
        let embedding = Var::from_tensor(start)?;
        let mut adam = Adam::new(std::iter::once(&embedding));
        let schedule = Schedule {
            peak: tuning.learning_rate,
            steps: tuning.steps,
            warm_up: 0.0,
            decay: Decay::Cosine { floor: 0.1 },
        };
        let graph = &sketch.graph;
        let shape = graph.shape();
        let lines = graph.line_cells().iter().map(|&i| i as usize).zip(graph.line_heights());
        let lines: Vec<(usize, f64)> = lines.map(|(i, &z)| (i, f64::from(z))).collect();
        let spare = Spare::default();
        for step in 0..tuning.steps {
            let seed = seed.derive_indexed("fine-tuning", step);
            let edges = sketch.draw(self.config(), 0.0, seed, &spare);
            let heights = self.network.forward(&edges, Some(embedding.as_tensor()), seed)?.heights;
            let y: Vec<f64> = heights.to_vec1::<f32>()?.into_iter().map(f64::from).collect();
            let mut gradient = vec![0.0; y.len()];
            for &(i, z) in &lines {
                gradient[i] += tuning.ground_truth * 2.0 * (y[i] - z) / lines.len() as f64;
            }
            // A sketch has no voids: its whole map is to become terrain.
            let value = smooth(&y, shape, None, SMOOTH_PAIRS, seed, tuning.smooth, &mut gradient);
            if !value.is_finite() {
                return Err(Error::Diverged { epoch: step, what: "l_smooth of the fine-tuning", value });
            }
            let gradient = gradient.into_iter().map(|g| g as f32).collect();
            let surrogate = (&heights * Tensor::from_vec(gradient, y.len(), &Device::Cpu)?)?.sum_all()?;
            adam.update(std::iter::once(&embedding), &surrogate.backward()?, schedule.at(step))?;
        }
        Ok(embedding.as_tensor().detach())
    }
}

/// Values of a map, corrected to meet the lines.
fn finish(
    lines: &LineMap,
    heights: Vec<f32>,
    correction: Option<CorrectionKind>,
    stop: &Stop,
) -> Result<Grid<f32>> {
    let (rows, cols) = lines.shape();
    let coarse = Grid::from_vec(rows, cols, heights)?;
    match correction {
        Some(kind) => Correction::new(kind, lines)?.apply_until(&coarse, stop),
        None => Ok(coarse),
    }
}

/// A trained model with its generation settings, as a system beside the interpolators.
#[derive(Clone, Debug)]
pub(crate) struct RegionGnnSystem {
    /// The model.
    pub(crate) model: Arc<RegionGnn>,
    /// Its use.
    pub(crate) generation: GenerationConfig,
}

impl SketchToTerrain for RegionGnnSystem {
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        self.model.generate(lines, &self.generation, seed, stop)
    }
}

/// Whether a model's heights mean nothing before the correction: true for the anchored one.
#[must_use]
pub(crate) fn needs_correction(config: &RegionGnnConfig) -> bool {
    config.frame == HeightFrame::Anchored
}
