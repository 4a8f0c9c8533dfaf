//! Training on one exemplar (Liu & Benes 2025, 4 and 6).
//!
//! Each epoch draws one of the extractions, random edges, noise and masked parts, takes one step of Adam on the weighted
//! losses, and reports. Cost: a forward and a backward pass an epoch, linear in pixels.

use super::checkpoint::{self, Progress};
use super::config::{Base, HeightFrame, LossWeights, NAME, RegionGnnConfig};
use super::correction_op::LineCorrection;
use super::edges::{PassEdges, Spare};
use super::graph::RegionGraph;
use super::losses::{Target, further, ground_truth, sketch_order, slope, smooth};
use super::network::{Network, Output};
use super::record::{EpochReport, LossValues, TrainingRecord};
use crate::control::{Control, Progress as Told, Stage, Stop};
use crate::error::{Error, Result};
use crate::file;
use crate::grid::{Grid, Mask};
use crate::interpolation::harmonic_until;
use crate::learn::{Adam, Decay, Schedule, SsimLoss, in_pool};
use crate::seed::Seed;
use crate::sketch::{LineMap, SketchPart, split_parts};
use candle_core::{Device, Tensor};
use rand::RngExt;
use sha2::{Digest, Sha256};
use std::sync::Arc;
use std::time::Instant;

/// l_further looks at pixels farther from any line than this, in cells (`docs/papers/region_gnn.md`).
const FAR: f32 = 6.0;
/// Far pixels sampled for l_further in an epoch.
const FAR_SAMPLES: usize = 1000;
/// Pixel pairs sampled for l_smooth in an epoch.
pub(super) const SMOOTH_PAIRS: usize = 10_000;
/// Pixels for which [`RegionGnnConfig::random_edges`] is meant.
const REFERENCE_PIXELS: usize = 128 * 128;
/// An l_gt beyond this, heights off by a hundred times the relief, is a divergence although the numbers are finite.
const LARGEST_GROUND_TRUTH: f64 = 1e4;
/// Smallest side of an exemplar: below it neither SSIM nor lines mean anything.
pub(crate) const SMALLEST_EXEMPLAR: usize = 32;

/// What the model learns from: one piece of terrain and the lines found on it.
#[derive(Clone, Debug)]
pub struct DrawnExemplar {
    /// (rows, cols) heights in the unit interval.
    pub heights: Grid<f32>,
    /// False at voids.
    pub valid: Mask,
    /// Extractions of the same terrain, the standard one first; heights in the unit interval.
    pub lines: Vec<LineMap>,
}

impl DrawnExemplar {
    /// What the losses compare with, voids filled.
    fn target(&self) -> Target {
        let (rows, cols) = self.heights.shape();
        let heights = self.heights.as_slice().iter().map(|&z| f64::from(z)).collect();
        Target { rows, cols, heights, valid: self.valid.as_slice().to_vec() }.without_voids()
    }
}

/// What a sketch's lines alone decide, whatever their parts.
#[derive(Clone, Debug)]
pub(super) struct LineFrame {
    /// Present when losses go through the correction or the model deviates from the natural-neighbour interpolation.
    pub(super) correction: Option<LineCorrection>,
    /// The base of an anchored model.
    base: Option<Vec<f32>>,
}

impl LineFrame {
    ///
    /// # Errors
    /// When there is no line, or it is stopped.
    pub(super) fn new(
        lines: &LineMap,
        config: &RegionGnnConfig,
        corrected: bool,
        stop: &Stop,
    ) -> Result<Self> {
        let anchored = config.frame == HeightFrame::Anchored;
        let natural = anchored && config.base == Base::NaturalNeighbour;
        let correction = if corrected || natural { Some(LineCorrection::new(lines, stop)?) } else { None };
        let base = match &correction {
            Some(correction) if natural => Some(correction.interpolate()),
            _ if anchored => {
                let base = harmonic_until(&lines.mask(), &lines.heights().map(|&z| f64::from(z)), stop)?;
                Some(base.as_slice().iter().map(|&z| z as f32).collect())
            }
            _ => None,
        };
        Ok(Self { correction, base })
    }

    /// The base of an anchored model, one value a pixel.
    pub(super) fn base(&self) -> Option<&[f32]> {
        self.base.as_deref()
    }
}

/// A sketch made ready for training or inference.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    pub(super) graph: Arc<RegionGraph>,
    pub(super) parts: Vec<SketchPart>,
}

impl Prepared {
    pub(super) fn new(
        lines: &LineMap,
        frame: &LineFrame,
        config: &RegionGnnConfig,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Self> {
        let parts = split_parts(lines, config.parts, seed);
        let graph = Arc::new(RegionGraph::until(lines, &parts, frame.base.as_deref(), config, stop)?);
        Ok(Self { graph, parts })
    }

    /// Random edges, noise and masks of one pass.
    pub(super) fn draw(
        &self,
        config: &RegionGnnConfig,
        masked: f64,
        seed: Seed,
        spare: &Spare,
    ) -> Arc<PassEdges> {
        let random = config.random_edges * self.graph.pixel_count() / REFERENCE_PIXELS;
        Arc::new(PassEdges::draw_into(spare, &self.graph, random, config.noise, masked, seed))
    }
}

/// Trains a network on an exemplar; returns it with the parts of its first extraction and a record.
///
/// An interrupted training that is resumed ends with the same weights as one that was not, unless a budget ties the
/// schedule to the clock.
///
/// # Errors
/// When the exemplar is too small, has no lines, the training diverges, or a checkpoint cannot be written or does not belong
/// to this training, or it is stopped. After a divergence or a stop the last checkpoint is still there.
pub fn train(
    exemplar: &DrawnExemplar,
    config: &RegionGnnConfig,
    seed: Seed,
    control: Control<'_>,
) -> Result<(Network, Vec<SketchPart>, TrainingRecord)> {
    config.validate()?;
    let (rows, cols) = exemplar.heights.shape();
    if rows.min(cols) < SMALLEST_EXEMPLAR {
        let allowed = format!("both sides must be at least {SMALLEST_EXEMPLAR}");
        return Err(Error::value("exemplar size", format!("{rows}x{cols}"), allowed));
    }
    let started = Instant::now();
    let samples = prepare(exemplar, config, seed, &control.stop)?;
    let Some((first, _)) = samples.first() else {
        return Err(Error::value("number of extractions", 0, "the exemplar needs at least one"));
    };
    let target = exemplar.target();
    let objective = Objective { ssim: target.ssim(), target, config };
    let weights = sample_weights(samples.iter().map(|(sample, _)| &*sample.graph), &objective.target);
    let network = Network::new(config, first.parts.len(), seed)?;
    let preparation_seconds = started.elapsed().as_secs_f64();

    let mut adam = Adam::over(network.params());
    let mut progress = Progress::start(identity(exemplar, config, seed));
    if let Some(c) = control.checkpoints.as_ref().filter(|c| c.resume && c.path.exists()) {
        progress = checkpoint::load(&c.path, &progress.identity, network.params(), &mut adam)?;
    }
    let (begun, spent) = (Instant::now(), progress.seconds);
    let elapsed = || spent + begun.elapsed().as_secs_f64();
    let budget = control.budget.map(|b| b.as_secs_f64() - preparation_seconds);
    let schedule = Schedule {
        peak: config.learning_rate,
        steps: config.epochs,
        warm_up: 0.03,
        decay: Decay::Cosine { floor: 0.01 },
    };
    let spare = Spare::default();
    let draw = |epoch: usize| {
        let seed = seed.derive_indexed("epoch", epoch);
        let choice = seed.stream("extraction").random_range(0..samples.len());
        (choice, samples[choice].0.draw(config, config.masked, seed, &spare))
    };
    let mut drawn = None;
    let mut times = Vec::new();
    let mut last = None;
    let mut kept = Instant::now();
    loop {
        control.stop.check()?;
        let epoch = progress.epoch;
        // Of a budget at least one epoch is done, and none is begun that would not end in time.
        let typical = times.last().copied().unwrap_or(0.0);
        let over = match budget {
            Some(budget) => epoch > 0 && elapsed() + typical > budget,
            None => epoch >= config.epochs,
        };
        let stale = config.patience > 0 && epoch - progress.lowest_epoch >= config.patience;
        if over || stale {
            break;
        }
        let phase = budget.map(|budget| elapsed() / budget.max(1e-9));
        let rate = phase.map_or_else(|| schedule.at(epoch), |phase| schedule.at_phase(phase.max(1e-3)));
        let epoch_begun = Instant::now();
        let seed = seed.derive_indexed("epoch", epoch);
        let (choice, edges) = drawn.take().unwrap_or_else(|| draw(epoch));
        let (sample, correction) = &samples[choice];
        let forward = || -> Result<_> {
            let output = network.forward(&edges, None, seed)?;
            // The next edges are drawn while the losses, which do not fill all threads, are taken.
            let evaluate = || objective.evaluate(sample, correction.as_ref(), &output, seed);
            let (evaluated, next) = rayon::join(evaluate, || draw(epoch + 1));
            Ok((evaluated?, next))
        };
        let ((losses, surrogate), next) = in_pool(forward)?;
        drawn = Some(next);
        if let Some((what, value)) = losses.first_absurd() {
            return Err(Error::Diverged { epoch, what, value });
        }
        // Here and not at the end of an epoch: this state has just been seen to give losses that are in order, so that one
        // that diverges never replaces one that does not.
        if let Some(c) = control.checkpoints.as_ref().filter(|c| epoch > 0 && kept.elapsed() >= c.interval) {
            checkpoint::save(&c.path, &progress, network.params(), &adam)?;
            kept = Instant::now();
        }
        in_pool(|| -> Result<()> {
            let gradients = (surrogate * weights[choice])?.backward()?;
            adam.update(network.params().iter().map(|(_, var)| var), &gradients, rate)
        })?;
        times.push(epoch_begun.elapsed().as_secs_f64());
        let report = EpochReport {
            epoch: epoch + 1,
            epochs: match phase {
                Some(phase) => ((epoch + 1) as f64 / phase.max(1e-3)).round() as usize,
                None => config.epochs,
            },
            losses,
            seconds: elapsed(),
        };
        progress.count(report, weights[choice] * losses.weighted(&config.losses));
        (control.progress)(&Told {
            stage: Stage::Coarse(NAME),
            step: report.epoch,
            steps: report.epochs,
            share: phase.unwrap_or(report.epoch as f64 / report.epochs as f64).min(1.0),
            seconds: report.seconds,
            figures: &[("SSIM", 1.0 - losses.ssim), ("l_gt", losses.ground_truth)],
        });
        last = Some(report);
    }
    // The last step, after which no loss was taken.
    let weights = network.params().snapshot()?;
    if let Some(&value) = weights.iter().flatten().find(|v| !v.is_finite()) {
        return Err(Error::Diverged { epoch: progress.epoch, what: "a weight", value: value.into() });
    }
    times.sort_by(f64::total_cmp);
    let seconds_per_epoch =
        times.get(times.len() / 2).copied().unwrap_or(progress.seconds / progress.epoch.max(1) as f64);
    let mut history = progress.history;
    if history.last().map(|h| h.epoch) != Some(progress.epoch) {
        history.extend(last);
    }
    let record = TrainingRecord {
        epochs: progress.epoch,
        seconds: progress.seconds,
        preparation_seconds,
        seconds_per_epoch,
        history,
    };
    let parts = first.parts.clone();
    Ok((network, parts, record))
}

/// Weight of each extraction's losses: the error of its base against that of the first one's, so that thin sketches, whose
/// errors are larger, do not drown dense ones. All 1 without a base.
fn sample_weights<'a>(graphs: impl Iterator<Item = &'a RegionGraph>, target: &Target) -> Vec<f64> {
    let error = |graph: &RegionGraph| -> f64 {
        let Some(anchor) = graph.anchor_frame() else { return 1.0 };
        let cells = anchor.base.iter().zip(&target.heights).zip(&target.valid).filter(|(_, ok)| **ok);
        let sum: f64 = cells.map(|((&base, z), _)| (f64::from(base) - z).powi(2)).sum();
        // A base without error gives no measure; the floor keeps the quotient finite.
        (sum / target.valid_count() as f64).max(1e-12)
    };
    let errors: Vec<f64> = graphs.map(error).collect();
    errors.iter().map(|e| errors[0] / e).collect()
}

/// The extractions of an exemplar as graphs, with their corrections where the losses go through them.
fn prepare(
    exemplar: &DrawnExemplar,
    config: &RegionGnnConfig,
    seed: Seed,
    stop: &Stop,
) -> Result<Vec<(Prepared, Option<LineCorrection>)>> {
    exemplar
        .lines
        .iter()
        .take(config.extractions)
        .enumerate()
        .filter(|(i, lines)| *i == 0 || lines.line_count() > 0)
        .map(|(i, lines)| {
            let frame = LineFrame::new(lines, config, config.loss_after_correction, stop)?;
            let sketch =
                Prepared::new(lines, &frame, config, seed.derive_indexed("exemplar parts", i), stop)?;
            Ok((sketch, frame.correction.filter(|_| config.loss_after_correction)))
        })
        .collect()
}

/// SHA-256 of all that decides a training, but how long and how fast it learns.
fn identity(exemplar: &DrawnExemplar, config: &RegionGnnConfig, seed: Seed) -> String {
    let (epochs, learning_rate, patience) = (1, 1.0, 0);
    let config = RegionGnnConfig { epochs, learning_rate, patience, ..config.clone() };
    let mut hasher = Sha256::new();
    hasher.update(serde_json::to_vec(&(config, seed)).expect("a configuration is plain data"));
    for (height, valid) in exemplar.heights.as_slice().iter().zip(exemplar.valid.as_slice()) {
        hasher.update(height.to_le_bytes());
        hasher.update([u8::from(*valid)]);
    }
    for lines in &exemplar.lines {
        for (height, kind) in lines.heights().as_slice().iter().zip(lines.kinds().as_slice()) {
            hasher.update(height.to_le_bytes());
            hasher.update([kind.map_or(0, |kind| 1 + kind as u8)]);
        }
    }
    file::hex(&hasher.finalize())
}

/// The weighted sum of the losses against one exemplar.
struct Objective<'a> {
    config: &'a RegionGnnConfig,
    target: Target,
    ssim: SsimLoss,
}

impl Objective<'_> {
    /// The losses, and a scalar whose gradient is theirs: heights times the gradient by the heights, as constants.
    fn evaluate(
        &self,
        sample: &Prepared,
        correction: Option<&LineCorrection>,
        output: &Output,
        seed: Seed,
    ) -> Result<(LossValues, Tensor)> {
        let w = &self.config.losses;
        let graph = &*sample.graph;
        let corrected = match correction {
            Some(correction) => correction.apply(&output.heights)?,
            None => output.heights.clone(),
        };
        let y: Vec<f64> = corrected.to_vec1::<f32>()?.into_iter().map(f64::from).collect();
        let t = &self.target;
        let pixels = y.len() as f64;
        let zeros = || vec![0.0; y.len()];
        let (mut gradient, mut by_ssim, mut by_order) = (zeros(), zeros(), zeros());
        let on_cells = || {
            let shape = (t.rows, t.cols);
            let smooth = smooth(&y, shape, Some(&t.valid), SMOOTH_PAIRS, seed, w.smooth, &mut gradient);
            let ground_truth = ground_truth(&y, t, w.ground_truth, &mut gradient);
            (ground_truth, slope(&y, t, w.gradient * pixels, &mut gradient), smooth)
        };
        let ((ground_truth, gradient_loss, smooth), (ssim, sketch)) = rayon::join(on_cells, || {
            rayon::join(
                || self.ssim.add(&y, w.ssim, &mut by_ssim),
                || sketch_order(&y, graph, &t.valid, seed, w.sketch, &mut by_order),
            )
        });
        for ((g, ssim), order) in gradient.iter_mut().zip(by_ssim).zip(by_order) {
            *g += ssim + order;
        }
        let mut losses =
            LossValues { ground_truth, ssim, gradient: gradient_loss, sketch, smooth, further: 0.0 };
        let constant = |values: Vec<f64>| {
            let n = values.len();
            Tensor::from_vec(values.into_iter().map(|v| v as f32).collect(), n, &Device::Cpu)
        };
        let mut surrogate = (corrected * constant(gradient)?)?.sum_all()?;
        let far = far_pixels(graph, &t.valid);
        if self.config.frame == HeightFrame::Absolute && !far.is_empty() {
            let mut stream = seed.stream("far pixels");
            let chosen: Vec<u32> = (0..FAR_SAMPLES).map(|_| far[stream.random_range(0..far.len())]).collect();
            let index = Tensor::from_slice(&chosen, chosen.len(), &Device::Cpu)?;
            let heights = output.heights.index_select(&index, 0)?;
            let baseline = output.far_height.broadcast_as(chosen.len())?;
            let wide = |t: &Tensor| -> Result<Vec<f64>> {
                Ok(t.to_vec1::<f32>()?.into_iter().map(f64::from).collect())
            };
            let distances: Vec<f64> =
                chosen.iter().map(|&p| f64::from(graph.distances()[p as usize * graph.k()])).collect();
            let (value, by_height, by_baseline) =
                further(&wide(&heights)?, &wide(&baseline)?, &distances, w.further);
            losses.further = value;
            surrogate = (surrogate
                + (heights * constant(by_height)?)?.sum_all()?
                + (baseline * constant(by_baseline)?)?.sum_all()?)?;
        }
        Ok((losses, surrogate))
    }
}

/// Pixels beyond [`FAR`] of every part that are not voids.
fn far_pixels(graph: &RegionGraph, valid: &[bool]) -> Vec<u32> {
    let nearest = graph.distances().chunks_exact(graph.k()).zip(valid);
    nearest.enumerate().filter(|(_, (d, ok))| **ok && d[0] > FAR).map(|(pixel, _)| pixel as u32).collect()
}

impl LossValues {
    /// The weighted sum that is trained (Eq. 3); l_gradient counts as its sum over pixels would.
    fn weighted(&self, w: &LossWeights) -> f64 {
        w.ground_truth * self.ground_truth
            + w.ssim * self.ssim
            + w.gradient * self.gradient
            + w.sketch * self.sketch
            + w.smooth * self.smooth
            + w.further * self.further
    }

    /// A loss that is not a number, or heights so far off that no training comes back from there.
    fn first_absurd(&self) -> Option<(&'static str, f64)> {
        [
            ("l_gt", self.ground_truth),
            ("1 - SSIM", self.ssim),
            ("l_gradient", self.gradient),
            ("l_sketch", self.sketch),
            ("l_smooth", self.smooth),
            ("l_further", self.further),
        ]
        .into_iter()
        .find(|(name, value)| !value.is_finite() || (*name == "l_gt" && *value > LARGEST_GROUND_TRUTH))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::{ExtractionConfig, ridges_and_valleys};

    /// A wavy square with a void in it, and what the void is filled with in memory.
    fn exemplar(side: usize, filling: f32) -> DrawnExemplar {
        let wavy = |row: f32, col: f32| 0.5 + 0.3 * (0.35 * row).sin() * (0.2 * col + 0.1 * row).cos();
        let valid = Grid::from_fn(side, side, |c| !(14..26).contains(&c.row) || !(10..24).contains(&c.col));
        let heights = Grid::from_fn(side, side, |c| wavy(c.row as f32, c.col as f32));
        let config = ExtractionConfig { min_accumulation: 8, min_order: 1, ..Default::default() };
        let lines = vec![ridges_and_valleys(&heights, &valid, &config).unwrap()];
        let heights = Grid::from_fn(side, side, |c| if valid[c] { heights[c] } else { filling });
        DrawnExemplar { heights, valid, lines }
    }

    /// All six losses of a network's output, and their gradient by that output and by the far height.
    fn losses_of(
        exemplar: &DrawnExemplar,
        config: &RegionGnnConfig,
        at_voids: f32,
    ) -> (LossValues, Vec<f32>, f32) {
        let (rows, cols) = exemplar.heights.shape();
        let target = exemplar.target();
        let (sample, _) = prepare(exemplar, config, Seed(3), &Stop::new()).unwrap().remove(0);
        let y: Vec<f32> = (0..rows * cols).map(|i| 0.5 + 0.2 * (0.7 * i as f32).sin()).collect();
        let valid = exemplar.valid.as_slice();
        let y: Vec<f32> = y.iter().zip(valid).map(|(y, ok)| if *ok { *y } else { at_voids }).collect();
        let far = candle_core::Var::new(0.4f32, &Device::Cpu).unwrap();
        let heights = candle_core::Var::from_vec(y, rows * cols, &Device::Cpu).unwrap();
        let output = Output { heights: heights.as_tensor().clone(), far_height: far.as_tensor().clone() };
        let objective = Objective { ssim: target.ssim(), target, config };
        let (losses, surrogate) = objective.evaluate(&sample, None, &output, Seed(9)).unwrap();
        let gradients = surrogate.backward().unwrap();
        let by_heights = gradients.get(&heights).unwrap().to_vec1().unwrap();
        let by_far = gradients.get(&far).map_or(0.0, |g| g.to_scalar().unwrap());
        (losses, by_heights, by_far)
    }

    #[test]
    fn numbers_in_voids_change_no_loss_or_gradient() {
        let config = RegionGnnConfig::paper();
        let (losses, gradient, by_far) = losses_of(&exemplar(48, 0.0), &config, 0.5);
        let all =
            [losses.ground_truth, losses.ssim, losses.gradient, losses.sketch, losses.smooth, losses.further];
        assert!(all.iter().all(|value| *value > 0.0) && by_far != 0.0, "each of the six counts: {losses:?}");
        for (filling, at_voids) in [(1e6, 0.5), (0.0, -1e6), (f32::NAN, 1e6)] {
            let other = losses_of(&exemplar(48, filling), &config, at_voids);
            assert_eq!((&losses, &gradient, by_far), (&other.0, &other.1, other.2), "{filling} {at_voids}");
        }
        let valid = exemplar(48, 0.0).valid;
        for (g, ok) in gradient.iter().zip(valid.as_slice()) {
            assert!(*ok || *g == 0.0, "no gradient in a void");
        }
    }
}
