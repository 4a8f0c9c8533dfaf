//! Training scale by scale, from coarse to fine (SinGAN, section 2.2).
//!
//! Exemplar heights -> [`train`] -> [`Detail`]. At every scale a critic and a generator take turns (WGAN-GP), the generator also
//! rebuilds the exemplar from one fixed noise; then the generator is frozen and the next finer scale begins from its weights.
//! Every random number is drawn from the seed by the name of its scale and use, so that the same bytes come out for any number
//! of threads.

use super::checkpoint;
use super::config::{DetailConfig, NAME, View};
use super::detail::Detail;
use super::network::{LAYERS, Network, Shape, Tape};
use super::optimizer::Adam;
use super::penalty::Penalty;
use super::scale::{Lens, Noise, Residual, Scale};
use crate::checked::Settings;
use crate::control::{Control, Progress, Stage};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid};
use crate::learn::convolution::Plane;
use crate::learn::in_pool;
use crate::metrics::{mean_square_slope, psnr};
use crate::seed::{Seed, Stream};
use rand::RngExt;
use rand_distr::StandardNormal;
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
pub fn train(
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
    let mut before: Option<(Network, Network)> = None;
    let mut saved = Instant::now();
    for scale in first..sizes.len() {
        let seed = seed.derive_indexed("scale", scale);
        let up = match scale {
            0 => pyramid[0].map(|_| 0.0),
            _ => resample(&detail.rebuilt(), sizes[scale].0, sizes[scale].1),
        };
        let mut room = Room::new(config, &pyramid[..=scale], &twins, &detail, up, seed);
        if let Some((generator, critic)) = &before {
            room.begin(generator, critic);
        }
        let (mut step, mut scale_spent) = (0, 0.0);
        if let Some(state) = resumed.take() {
            (step, scale_spent) = (state.progress.step, state.progress.scale_seconds);
            room.restore(state)?;
        }
        let scale_begun = Instant::now();
        let time = control.budget.map(|b| b.as_secs_f64() * work[scale] as f64 / all_work);
        loop {
            let seconds = scale_spent + scale_begun.elapsed().as_secs_f64();
            // Of a budget every scale gets at least one step.
            let share = time.map_or(step as f64 / config.steps as f64, |t| seconds / t.max(1e-9));
            if share >= 1.0 && (step > 0 || time.is_none()) {
                break;
            }
            let done = in_pool(|| room.step(step, share.min(1.0) as f32));
            let losses = [done.critic, done.penalty, done.reconstruction];
            if let Some(&value) = losses.iter().find(|v| !v.is_finite()) {
                let epoch = scale * config.steps + step;
                return Err(Error::Diverged { epoch, what: "a loss of the detail model", value });
            }
            step += 1;
            let before: u64 = work[..scale].iter().sum();
            let share = match time {
                Some(time) => (scale_spent + scale_begun.elapsed().as_secs_f64()) / time.max(1e-9),
                None => step as f64 / config.steps as f64,
            };
            (control.progress)(&Progress {
                stage: Stage::Detail(NAME),
                step: detail.record.steps.iter().sum::<usize>() + step,
                steps: sizes.len() * config.steps,
                share: (before as f64 + work[scale] as f64 * share.min(1.0)) / all_work,
                seconds: elapsed(),
                figures: &[
                    ("scale", (scale + 1) as f64),
                    ("critic", done.critic),
                    ("penalty", done.penalty),
                    ("reconstruction", done.reconstruction),
                ],
            });
            if let Some(c) = control.checkpoints.as_ref().filter(|c| saved.elapsed() >= c.interval) {
                let progress = checkpoint::Progress {
                    identity: identity.clone(),
                    steps: detail.record.steps.clone(),
                    step,
                    seconds: elapsed(),
                    scale_seconds: scale_spent + scale_begun.elapsed().as_secs_f64(),
                    scales: detail.scales.iter().map(Scale::info).collect(),
                    optimizer_steps: [0, 1].map(|i: usize| room.optimizers[i].state().0),
                };
                checkpoint::save(&c.path, &progress, &detail.scales, &room.state())?;
                saved = Instant::now();
            }
        }
        let trained = room.trained();
        before = Some((room.generator, room.critic));
        detail.scales.push(trained);
        detail.record.steps.push(step);
    }
    detail.record.seconds = elapsed();
    let rebuilt = detail.reconstruct().map(|z| z.clamp(0.0, 1.0));
    detail.record.psnr = psnr(&rebuilt, heights, &heights.map(|_| true), 1.0)?;
    Ok(detail)
}

/// A frame of unit normal values for a scale's generator.
pub(super) fn noise_field(lens: Lens, rows: usize, cols: usize, stream: &mut Stream) -> Grid<f32> {
    let (framed_rows, framed_cols) = lens.framed(rows, cols);
    let inside = |i: usize, side: usize| (super::network::REACH..super::network::REACH + side).contains(&i);
    Grid::from_fn(framed_rows, framed_cols, |c| {
        // The published padding is zeros around noise and map alike.
        if lens.view == View::Heights && !(inside(c.row, rows) && inside(c.col, cols)) {
            return 0.0;
        }
        stream.sample::<f32, _>(StandardNormal)
    })
}

/// The name of the stream that draws the reconstruction's noise.
pub(super) const FIXED_NOISE: &str = "fixed noise";

/// Everything that one scale's training needs.
struct Room<'a> {
    config: &'a DetailConfig,
    /// The exemplar at the scales so far, this one last.
    pyramid: &'a [Grid<f32>],
    /// The coarse twins at all scales.
    twins: &'a [Vec<Grid<f32>>],
    coarser: &'a Detail,
    lens: Lens,
    residual: Residual,
    noise: f32,
    rec_up: Grid<f32>,
    rec_noise: Option<Grid<f32>>,
    generator: Network,
    critic: Network,
    optimizers: [Adam; 2],
    makes: Tape,
    judges: Tape,
    penalty: Penalty,
    d_judged: Plane,
    seed: Seed,
    draws: Stream,
}

impl<'a> Room<'a> {
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
        let lens = Lens { view: config.view, gain };
        let width = if scale < 4 { config.width } else { config.fine_width };
        let shape = |inputs| Shape { inputs, width, batch_norm: config.batch_norm };
        let (generator, critic) = (shape(lens.generator_inputs()), shape(lens.critic_inputs()));
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
        let rec_noise = (scale == 0).then(|| noise_field(lens, rows, cols, &mut seed.stream(FIXED_NOISE)));
        let map = (rows - 10 - lens.loss(), cols - 10 - lens.loss());
        let generator = Network::new(generator, config.start, 0.1, seed.derive("generator"));
        let critic = Network::new(critic, config.start, 1.0, seed.derive("critic"));
        Self {
            config,
            pyramid,
            twins,
            coarser,
            lens,
            residual,
            noise,
            rec_up,
            rec_noise,
            optimizers: [&generator, &critic].map(|net| Adam::new(net.values.len(), config.momentum)),
            makes: Tape::new(generator.shape, rows, cols),
            judges: Tape::new(critic.shape, map.0, map.1),
            penalty: Penalty::new(critic.shape, map.0, map.1),
            d_judged: Plane::zeros(rows - lens.loss(), cols - lens.loss(), lens.critic_inputs(), 0),
            generator,
            critic,
            draws: seed.stream("training"),
            seed,
        }
    }

    /// Starts from the weights of the scale before where the widths agree (SinGAN's published code).
    fn begin(&mut self, generator: &Network, critic: &Network) {
        for (net, before) in [(&mut self.generator, generator), (&mut self.critic, critic)] {
            if before.shape == net.shape {
                *net = before.clone();
            }
        }
    }

    /// Everything that the steps so far have changed, by name.
    fn state(&self) -> Vec<(String, &[f32])> {
        let mut state = Vec::new();
        for ((name, net), adam) in self.networks().into_iter().zip(&self.optimizers) {
            let (_, mean, square) = adam.state();
            for (what, values) in [("values", &net.values[..]), ("mean", mean), ("square", square)] {
                state.push((format!("{name}.{what}"), values));
            }
            for (i, moments) in net.running.iter().enumerate() {
                state.push((format!("{name}.running.{i}.mean"), &moments.mean[..]));
                state.push((format!("{name}.running.{i}.variance"), &moments.variance[..]));
            }
        }
        state
    }

    fn networks(&self) -> [(&'static str, &Network); 2] {
        [("generator", &self.generator), ("critic", &self.critic)]
    }

    /// Continues from a [`state`](Self::state) that was read.
    fn restore(&mut self, state: checkpoint::State) -> Result<()> {
        let checkpoint::State { progress, mut numbers, .. } = state;
        let steps = progress.optimizer_steps;
        for (i, (name, net)) in
            [("generator", &mut self.generator), ("critic", &mut self.critic)].into_iter().enumerate()
        {
            let count = net.values.len();
            net.values = numbers.take(&format!("{name}.values"), count)?;
            let mean = numbers.take(&format!("{name}.mean"), count)?;
            self.optimizers[i].restore(steps[i], mean, numbers.take(&format!("{name}.square"), count)?);
            for (l, moments) in net.running.iter_mut().enumerate() {
                let count = moments.mean.len();
                moments.mean = numbers.take(&format!("{name}.running.{l}.mean"), count)?;
                moments.variance = numbers.take(&format!("{name}.running.{l}.variance"), count)?;
            }
        }
        Ok(())
    }

    fn step(&mut self, step: usize, share: f32) -> Step {
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
        (up, noise_field(self.lens, rows, cols, &mut self.draws))
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
        self.lens.look(&self.lens.frame(up), &noise, 0, 0, &mut self.makes.input);
        let mut running = std::mem::take(&mut self.generator.running);
        self.makes.forward(&self.generator, Some(&mut running));
        self.generator.running = running;
        let mut map = up.clone();
        for (z, out) in map.as_mut_slice().iter_mut().zip(self.makes.out.values()) {
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
        for (map, sign) in [(&real, -1.0), (fake, 1.0)] {
            self.lens.judge(map, &mut self.judges.input);
            self.judges.forward(&self.critic, None);
            apart -= f64::from(sign) * mean(self.judges.out.values());
            self.fill_judgement(sign);
            self.judges.backward(&self.critic, Some(&mut gradient), None);
        }
        // The published code draws one share for the whole map.
        let share: f32 = self.draws.random();
        let mixed = real.as_slice().iter().zip(fake.as_slice()).map(|(r, f)| share * r + (1.0 - share) * f);
        let mixed = Grid::from_vec(real.rows(), real.cols(), mixed.collect()).expect("the real map's shape");
        self.lens.judge(&mixed, &mut self.judges.input);
        let weight = self.config.penalty;
        let penalty = self.penalty.add(&self.critic, &mut self.judges, weight, &mut gradient);
        self.optimizers[1].update(&mut self.critic.values, &gradient, rate);
        (apart, penalty)
    }

    /// Fills the gradient of the critic's map with that of `sign` times its mean.
    fn fill_judgement(&mut self, sign: f32) {
        let last = &mut self.judges.deltas[LAYERS - 1];
        let value = sign / (last.rows() * last.cols()) as f32;
        (0..last.rows()).for_each(|row| last.row_mut(row).fill(value));
    }

    /// One update of the generator, whose last pass made `fake`: the squared reconstruction error.
    fn teach_generator(&mut self, fake: &Grid<f32>, rate: f32) -> f64 {
        let (rows, cols) = fake.shape();
        let mut gradient = vec![0.0; self.generator.values.len()];
        self.lens.judge(fake, &mut self.judges.input);
        self.judges.forward(&self.critic, None);
        self.fill_judgement(-1.0);
        self.judges.backward(&self.critic, None, Some(&mut self.d_judged));
        let d_map = self.lens.judge_adjoint(&self.d_judged, rows, cols);
        self.teach(&d_map, &mut gradient);

        let here = self.pyramid.len() - 1;
        let paired = here > 0 && !self.twins.is_empty() && self.draws.random::<f32>() < self.config.paired;
        let (error, d_map) = if paired {
            let (twin, turn) = (self.draws.random_range(0..self.twins.len()), self.turn());
            let twins = self.twins;
            let up = self.injected(&twins[twin], turn, 0.0, Seed(0));
            let rebuilt = self.make(&up, None);
            reconstruction(&rebuilt, &turned(&self.pyramid[here], turn), self.lens.gain, self.config)
        } else {
            let up = std::mem::replace(&mut self.rec_up, Grid::filled(1, 1, 0.0));
            let field = self.rec_noise.take();
            let rebuilt = self.make(&up, field.as_ref());
            (self.rec_up, self.rec_noise) = (up, field);
            reconstruction(&rebuilt, &self.pyramid[here], self.lens.gain, self.config)
        };
        self.teach(&d_map, &mut gradient);
        self.optimizers[0].update(&mut self.generator.values, &gradient, rate);
        error
    }

    /// Backward through the generator's last pass.
    fn teach(&mut self, d_map: &[f32], gradient: &mut [f32]) {
        let cols = self.makes.out.cols();
        let last = &mut self.makes.deltas[LAYERS - 1];
        for (row, d_map) in d_map.chunks_exact(cols).enumerate() {
            let outs = self.makes.out.row(row);
            for ((delta, d), out) in last.row_mut(row).iter_mut().zip(d_map).zip(outs) {
                *delta = d * self.residual.slope(*out);
            }
        }
        self.makes.backward(&self.generator, Some(gradient), None);
    }

    fn trained(&self) -> Scale {
        Scale { net: self.generator.folded(), lens: self.lens, residual: self.residual, noise: self.noise }
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

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}
