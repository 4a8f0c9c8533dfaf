//! Training scale by scale, from coarse to fine (SinGAN, section 2.2).
//!
//! Exemplar heights -> [`train`] -> [`Detail`]. At every scale a critic and a generator take turns (WGAN-GP), the generator also
//! rebuilds the exemplar from one fixed noise; then the generator is frozen and the next finer scale begins from its weights.
//! Every random number is drawn from the seed by the name of its scale and use, so that the same bytes come out for any number
//! of threads.

use super::checkpoint;
use super::config::{DetailConfig, NAME, View};
use super::detail::Detail;
use super::network::{Network, Shape, input_delta, input_mut, tape};
use super::scale::{FIXED_NOISE, Inputs, Noise, Residual, Scale, noise_field};
use crate::checked::Settings;
use crate::control::{Control, Progress, Stage};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid};
use crate::learn::gan::{Game, Length, Loss, NormOver, Player, Turn, add_gradient_penalty, play};
use crate::learn::layers::Tape;
use crate::metrics::{mean_square_slope, psnr};
use crate::seed::{Seed, Stream};
use rand::RngExt;
use std::time::Instant;

/// What a step of a scale was.
struct Step {
    /// Mean of the critic's map on the exemplar minus that on the generated map.
    critic: f64,
    /// The gradient penalty, unweighted.
    penalty: f64,
    /// Mean squared reconstruction error in the loss's unit.
    reconstruction: f64,
}

/// Trains every scale on `heights` (0 to 1). `twins` are coarse versions of the same ground, such as a coarse model makes them
/// (any number, also none): the samples that begin at a coarser scale begin with one of them as often as with the exemplar
/// itself, and part of the reconstruction begins with one.
///
/// A training that was interrupted and resumed ends with the same weights as one that was not, unless a budget ties the
/// schedule to the clock.
///
/// # Errors
/// When a setting is out of range, the exemplar is smaller than 16 cells or level, a loss stops being finite, or a checkpoint
/// cannot be written or does not belong to this training.
pub(crate) fn train(
    heights: &Grid<f32>,
    twins: &[Grid<f32>],
    config: &DetailConfig,
    seed: Seed,
    control: Control<'_>,
) -> Result<Detail> {
    config.validate()?;
    let (rows, cols) = heights.shape();
    if rows.min(cols) < 16 {
        return Err(Error::value("exemplar for detail", format!("{rows}x{cols}"), "allowed: at least 16x16"));
    }
    if let Some(twin) = twins.iter().find(|twin| twin.shape() != heights.shape()) {
        let allowed = format!("the exemplar is {rows}x{cols}");
        return Err(Error::value("coarse twin of the exemplar", format!("{:?}", twin.shape()), allowed));
    }
    let sizes = config.pyramid(rows, cols);
    let scaled = |heights: &Grid<f32>| -> Vec<Grid<f32>> {
        let heights = heights.map(|z| 2.0 * z - 1.0);
        sizes.iter().map(|&(r, c)| resample(&heights, r, c)).collect()
    };
    let pyramid = scaled(heights);
    let identity = checkpoint::identity(heights, twins, config, seed);
    let twins: Vec<Vec<Grid<f32>>> = twins.iter().map(scaled).collect();
    if mean_square_slope(heights) <= 0.0 {
        return Err(Error::value("relief of the exemplar", 0, "level ground has no detail to learn"));
    }
    let mut detail = Detail::empty(config.clone(), sizes.clone());
    detail.fixed_noise = seed.derive_indexed("scale", 0);
    let kept = control.checkpoints.as_ref().filter(|c| c.resume && c.path.exists());
    let mut resumed = kept.map(|c| checkpoint::load(&c.path, &identity, config)).transpose()?;
    let (mut first, mut spent) = (0, 0.0);
    if let Some(state) = &mut resumed {
        (first, spent) = (state.progress.steps.len(), state.progress.seconds);
        detail.scales = std::mem::take(&mut state.scales);
        detail.record.steps.clone_from(&state.progress.steps);
    }
    let begun = Instant::now();
    let elapsed = || spent + begun.elapsed().as_secs_f64();
    let work = config.work(rows, cols);
    let all_work = work.iter().sum::<u64>() as f64;
    let mut before: Option<[Player; 2]> = None;
    let mut saved = Instant::now();
    for scale in first..sizes.len() {
        let seed = seed.derive_indexed("scale", scale);
        let up = match scale {
            0 => pyramid[0].map(|_| 0.0),
            _ => resample(&detail.rebuilt(), sizes[scale].0, sizes[scale].1),
        };
        let mut trainer = ScaleTrainer::new(config, &pyramid[..=scale], &twins, &detail, up, seed);
        if let Some(before) = &before {
            trainer.begin(before);
        }
        let mut done = (0, 0.0);
        if let Some(state) = resumed.take() {
            done = (state.progress.step, state.progress.scale_seconds);
            trainer.restore(state)?;
        }
        let time = control.budget.map(|b| b.mul_f64(work[scale] as f64 / all_work));
        let length = Length { steps: config.steps, time, done };
        let work_before: u64 = work[..scale].iter().sum();
        let steps = play(&mut trainer, length, &control.stop, |trainer, step, scale_seconds, told| {
            let losses = [told.critic, told.penalty, told.reconstruction];
            if let Some(&value) = losses.iter().find(|v| !v.is_finite()) {
                let epoch = scale * config.steps + step;
                return Err(Error::Diverged { epoch, what: "a loss of the detail model", value });
            }
            let share = match time {
                Some(time) => scale_seconds / time.as_secs_f64().max(1e-9),
                None => (step + 1) as f64 / config.steps as f64,
            };
            (control.progress)(&Progress {
                stage: Stage::Detail(NAME),
                step: detail.record.steps.iter().sum::<usize>() + step + 1,
                steps: sizes.len() * config.steps,
                share: (work_before as f64 + work[scale] as f64 * share.min(1.0)) / all_work,
                seconds: elapsed(),
                figures: &[
                    ("scale", (scale + 1) as f64),
                    ("critic", told.critic),
                    ("penalty", told.penalty),
                    ("reconstruction", told.reconstruction),
                ],
            });
            if let Some(c) = control.checkpoints.as_ref().filter(|c| saved.elapsed() >= c.interval) {
                let progress = checkpoint::Progress {
                    identity: identity.clone(),
                    steps: detail.record.steps.clone(),
                    step: step + 1,
                    seconds: elapsed(),
                    scale_seconds,
                    scales: detail.scales.iter().map(Scale::info).collect(),
                    optimizer_steps: [trainer.generator.steps(), trainer.critic.steps()],
                };
                checkpoint::save(&c.path, &progress, &detail.scales, &trainer.state())?;
                saved = Instant::now();
            }
            Ok(())
        })?;
        let trained = trainer.trained();
        before = Some([trainer.generator, trainer.critic]);
        detail.scales.push(trained);
        detail.record.steps.push(steps);
    }
    detail.record.seconds = elapsed();
    let rebuilt = detail.reconstruct().map(|z| z.clamp(0.0, 1.0));
    detail.record.psnr = psnr(&rebuilt, heights, &heights.map(|_| true), 1.0)?;
    Ok(detail)
}

/// Everything that one scale's training needs.
struct ScaleTrainer<'a> {
    config: &'a DetailConfig,
    /// The exemplar at the scales so far, this one last.
    pyramid: &'a [Grid<f32>],
    /// The coarse twins at all scales.
    twins: &'a [Vec<Grid<f32>>],
    coarser: &'a Detail,
    inputs: Inputs,
    residual: Residual,
    noise: f32,
    rec_up: Grid<f32>,
    rec_noise: Option<Grid<f32>>,
    generator: Player,
    critic: Player,
    makes: Tape,
    judges: Tape,
    seed: Seed,
    draws: Stream,
}

impl<'a> ScaleTrainer<'a> {
    fn new(
        config: &'a DetailConfig,
        pyramid: &'a [Grid<f32>],
        twins: &'a [Vec<Grid<f32>>],
        coarser: &'a Detail,
        rec_up: Grid<f32>,
        seed: Seed,
    ) -> Self {
        let scale = pyramid.len() - 1;
        let real = &pyramid[scale];
        let (rows, cols) = real.shape();
        let slope = mean_square_slope(real).sqrt() as f32;
        let gain = if config.view == View::Slopes { slope.recip() } else { 1.0 };
        let inputs = Inputs { view: config.view, gain };
        let width = if scale < 4 { config.width } else { config.fine_width };
        let shape = |inputs| Shape { inputs, width, batch_norm: config.batch_norm };
        let (generator, critic) = (shape(inputs.generator_inputs()), shape(inputs.critic_inputs()));
        let missing = rec_up.as_slice().iter().zip(real.as_slice());
        let square: f64 = missing.map(|(u, z)| f64::from(u - z).powi(2)).sum();
        let error = (square / real.len() as f64).sqrt() as f32;
        let noise = match config.view {
            View::Slopes => 1.0,
            View::Heights if scale == 0 => 1.0,
            View::Heights => config.noise * error,
        };
        let squares: f64 = twins.iter().map(|twin| mean_square_slope(&twin[scale])).sum();
        let coarse = (squares / twins.len().max(1) as f64).sqrt() as f32;
        let residual = Residual {
            view: config.view,
            scale: error,
            slope_of_exemplar: slope,
            slope_of_twins: if coarse > 0.0 { coarse } else { slope },
        };
        let rec_noise = (scale == 0).then(|| noise_field(inputs, rows, cols, &mut seed.stream(FIXED_NOISE)));
        let map = (rows - 10 - inputs.loss(), cols - 10 - inputs.loss());
        let player = |shape: Shape, last: f32, name: &str| {
            let net = shape.net();
            let values = net.start(config.start, last, seed.derive(name));
            Player::new(net, values, config.momentum)
        };
        let (generator, critic) = (player(generator, 0.1, "generator"), player(critic, 1.0, "critic"));
        Self {
            config,
            pyramid,
            twins,
            coarser,
            inputs,
            residual,
            noise,
            rec_up,
            rec_noise,
            makes: tape(&generator.net, rows, cols),
            judges: tape(&critic.net, map.0, map.1),
            generator,
            critic,
            draws: seed.stream("training"),
            seed,
        }
    }

    /// Starts from the weights of the scale before where the widths agree (SinGAN's published code).
    fn begin(&mut self, before: &[Player; 2]) {
        for (player, before) in [&mut self.generator, &mut self.critic].into_iter().zip(before) {
            if before.net == player.net {
                player.begin_with(before);
            }
        }
    }

    /// Everything that the steps so far have changed, by name.
    fn state(&self) -> Vec<(String, &[f32])> {
        [self.generator.state("generator"), self.critic.state("critic")].concat()
    }

    /// Continues from a [`state`](Self::state) that was read.
    fn restore(&mut self, state: checkpoint::State) -> Result<()> {
        let checkpoint::State { progress, mut numbers, .. } = state;
        let [made, judged] = progress.optimizer_steps;
        self.generator.restore("generator", made, &mut numbers)?;
        self.critic.restore("critic", judged, &mut numbers)
    }

    fn both_turns(&mut self, step: usize, share: f32) -> Step {
        let rate = self.config.rate(share);
        // A stream of its own for every step: an interrupted training needs no position in it.
        self.draws = self.seed.derive_indexed("training step", step).stream("draws");
        let (mut critic, mut penalty, mut reconstruction) = (0.0, 0.0, 0.0);
        let (mut fake, mut up) = (None, None);
        for _ in 0..self.config.critic_steps {
            let (next_up, field) = self.sample();
            let made = self.make(&next_up, Some(&field));
            (critic, penalty) = self.teach_critic(&made, rate);
            (fake, up) = (Some(made), Some((next_up, field)));
        }
        let up = up.expect("at least one critic step");
        for again in 0..self.config.generator_steps {
            let made = if again == 0 { fake.take() } else { None };
            let made = made.unwrap_or_else(|| self.make(&up.0, Some(&up.1)));
            reconstruction = self.teach_generator(&made, rate);
        }
        Step { critic, penalty, reconstruction }
    }

    /// An enlarged coarser map to add detail to, and noise.
    fn sample(&mut self) -> (Grid<f32>, Grid<f32>) {
        let here = self.pyramid.len() - 1;
        let (rows, cols) = self.pyramid[here].shape();
        let seed = Seed(self.draws.random());
        let up = if here == 0 {
            self.pyramid[0].map(|_| 0.0)
        } else if self.draws.random::<f32>() < self.config.injected {
            // The exemplar as often as all of its twins.
            let source = if self.twins.is_empty() || self.draws.random::<bool>() {
                self.pyramid
            } else {
                &self.twins[self.draws.random_range(0..self.twins.len())]
            };
            let turn = self.turn();
            self.injected(source, turn, 1.0, seed)
        } else {
            self.coarser.refine(&self.pyramid[0].map(|_| 0.0), 0..here, (rows, cols), 1.0, seed)
        };
        (up, noise_field(self.inputs, rows, cols, &mut self.draws))
    }

    /// A turned map at a random coarser scale, through the scales between, enlarged to this one.
    fn injected(&mut self, source: &[Grid<f32>], turn: usize, amplitude: f32, seed: Seed) -> Grid<f32> {
        let here = self.pyramid.len() - 1;
        let from = self.draws.random_range(0..here);
        let size = self.pyramid[here].shape();
        self.coarser.refine(&turned(&source[from], turn), from + 1..here, size, amplitude, seed)
    }

    /// One of the symmetries that the exemplar is allowed.
    fn turn(&mut self) -> usize {
        if !self.config.symmetric {
            return 0;
        }
        let (rows, cols) = self.pyramid[0].shape();
        self.draws.random_range(0..if rows == cols { 8 } else { 4 })
    }

    /// The generator's map.
    fn make(&mut self, up: &Grid<f32>, field: Option<&Grid<f32>>) -> Grid<f32> {
        let noise = Noise { field, amplitude: self.noise };
        self.inputs.look(&self.inputs.frame(up), &noise, 0, 0, input_mut(&mut self.makes));
        let Player { values, running, .. } = &mut self.generator;
        self.makes.forward(values, Some(running));
        let mut map = up.clone();
        for (z, out) in map.as_mut_slice().iter_mut().zip(self.makes.output(0).values()) {
            *z += self.residual.height(*out);
        }
        map
    }

    /// One update of the critic: the means of its map apart, and the penalty.
    fn teach_critic(&mut self, fake: &Grid<f32>, rate: f32) -> (f64, f64) {
        let turn = self.turn();
        let real = turned(&self.pyramid[self.pyramid.len() - 1], turn);
        let mut gradient = vec![0.0; self.critic.values.len()];
        let mut apart = 0.0;
        for (map, turn) in [(&real, Turn::Real), (fake, Turn::Made)] {
            apart -= self.judge(map, turn);
            self.judges.backward(&self.critic.values, Some(&mut gradient), false);
        }
        // The published code draws one share for the whole map.
        let share: f32 = self.draws.random();
        let mixed = real.as_slice().iter().zip(fake.as_slice()).map(|(r, f)| share * r + (1.0 - share) * f);
        let mixed = Grid::from_vec(real.rows(), real.cols(), mixed.collect()).expect("the real map's shape");
        self.inputs.judge(&mixed, input_mut(&mut self.judges));
        let (weight, over) = (self.config.penalty, NormOver::Pixel);
        let input = self.critic.net.inputs().next().expect("an input");
        let values = &self.critic.values;
        let penalty = add_gradient_penalty(&mut self.judges, values, input, over, weight, &mut gradient);
        self.critic.descend(&gradient, rate);
        (apart, penalty)
    }

    /// The critic's loss of a map, its gradient ready for the way back.
    fn judge(&mut self, map: &Grid<f32>, turn: Turn) -> f64 {
        self.inputs.judge(map, input_mut(&mut self.judges));
        self.judges.forward(&self.critic.values, None);
        let scores = self.judges.output(0).clone();
        Loss::Wasserstein.of(turn, &scores, 1.0, self.judges.output_delta(0))
    }

    /// One update of the generator, whose last pass made `fake`: the squared reconstruction error.
    fn teach_generator(&mut self, fake: &Grid<f32>, rate: f32) -> f64 {
        let (rows, cols) = fake.shape();
        let mut gradient = vec![0.0; self.generator.values.len()];
        self.judge(fake, Turn::Generator);
        self.judges.backward(&self.critic.values, None, true);
        let d_map = self.inputs.judge_adjoint(input_delta(&self.judges), rows, cols);
        self.teach(&d_map, &mut gradient);

        let here = self.pyramid.len() - 1;
        let paired = here > 0 && !self.twins.is_empty() && self.draws.random::<f32>() < self.config.paired;
        let (error, d_map) = if paired {
            let (twin, turn) = (self.draws.random_range(0..self.twins.len()), self.turn());
            let twins = self.twins;
            let up = self.injected(&twins[twin], turn, 0.0, Seed(0));
            let rebuilt = self.make(&up, None);
            reconstruction(&rebuilt, &turned(&self.pyramid[here], turn), self.inputs.gain, self.config)
        } else {
            let up = std::mem::replace(&mut self.rec_up, Grid::filled(1, 1, 0.0));
            let field = self.rec_noise.take();
            let rebuilt = self.make(&up, field.as_ref());
            (self.rec_up, self.rec_noise) = (up, field);
            reconstruction(&rebuilt, &self.pyramid[here], self.inputs.gain, self.config)
        };
        self.teach(&d_map, &mut gradient);
        self.generator.descend(&gradient, rate);
        error
    }

    /// Backward through the generator's last pass.
    fn teach(&mut self, d_map: &[f32], gradient: &mut [f32]) {
        let outs = self.makes.output(0).clone();
        let last = self.makes.output_delta(0);
        for (row, d_map) in d_map.chunks_exact(outs.cols()).enumerate() {
            for ((delta, d), out) in last.row_mut(row).iter_mut().zip(d_map).zip(outs.row(row)) {
                *delta = d * self.residual.slope(*out);
            }
        }
        self.makes.backward(&self.generator.values, Some(gradient), false);
    }

    fn trained(&self) -> Scale {
        let (net, values) = self.generator.net.folded(&self.generator.values, &self.generator.running);
        let net = Network { net, values };
        Scale { net, inputs: self.inputs, residual: self.residual, noise: self.noise }
    }
}

impl Game for ScaleTrainer<'_> {
    type Report = Step;

    fn step(&mut self, step: usize, share: f32) -> Step {
        self.both_turns(step, share)
    }
}

/// Mean squared error in the loss's unit, and the gradient of the weighted reconstruction losses by the map.
fn reconstruction(map: &Grid<f32>, real: &Grid<f32>, gain: f32, config: &DetailConfig) -> (f64, Vec<f32>) {
    let n = map.len() as f32;
    let mut error = 0.0;
    let mut d_map: Vec<f32> = map
        .as_slice()
        .iter()
        .zip(real.as_slice())
        .map(|(y, z)| {
            let miss = gain * (y - z);
            error += f64::from(miss * miss);
            config.reconstruction * 2.0 * gain * miss / n
        })
        .collect();
    if config.gradient > 0.0 {
        // Mean over cells of the sum over the four neighbours of (squared step - true squared step)^2 (Liu & Benes, 6.1);
        // every pair counts from both of its ends.
        let (rows, cols) = map.shape();
        let (y, z) = (map.as_slice(), real.as_slice());
        let mut pair = |a: usize, b: usize| {
            let (step, truth) = (y[b] - y[a], z[b] - z[a]);
            let g = config.gradient * 8.0 * (step * step - truth * truth) * step / n;
            d_map[b] += g;
            d_map[a] -= g;
        };
        for i in 0..rows * cols {
            if i % cols + 1 < cols {
                pair(i, i + 1);
            }
            if i + cols < rows * cols {
                pair(i, i + cols);
            }
        }
    }
    (error / f64::from(n), d_map)
}

/// The map after one of the eight symmetries of the square; 0 is the identity, the first four keep the sides.
pub(super) fn turned(map: &Grid<f32>, turn: usize) -> Grid<f32> {
    let (rows, cols) = map.shape();
    let source = |row: usize, col: usize| {
        let (row, col) = if turn & 4 != 0 { (col, row) } else { (row, col) };
        let row = if turn & 1 != 0 { rows - 1 - row } else { row };
        let col = if turn & 2 != 0 { cols - 1 - col } else { col };
        map[Cell::new(row, col)]
    };
    let (out_rows, out_cols) = if turn & 4 != 0 { (cols, rows) } else { (rows, cols) };
    Grid::from_fn(out_rows, out_cols, |c| source(c.row, c.col))
}
