//! Adversarial training: the losses of both players, the gradient penalty, and the loop in which they take turns.

use super::layers::{LayerId, Moments, Net, Tape};
use super::{Adam, in_pool};
use crate::control::Stop;
use crate::error::Result;
use crate::learn::convolution::Plane;
use crate::learn::{Numbers, exp, ln};
use std::time::{Duration, Instant};

/// What a critic's scores are worth to both players; means over all scores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Loss {
    /// max(0, 1 - s) on the real and max(0, 1 + s) on the made; the generator's is -s (Lim & Ye 2017).
    Hinge,
    /// Binary cross-entropy of sigmoid(s); the generator's is the one that does not saturate (Goodfellow et al. 2014).
    Bce,
    /// -s on the real and s on the made; the generator's is -s (Arjovsky et al. 2017).
    Wasserstein,
}

/// Whose loss, on what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// The critic's, on the exemplar.
    Real,
    /// The critic's, on what the generator made.
    Made,
    /// The generator's.
    Generator,
}

impl Loss {
    /// The loss of some scores. `delta` (of their size, in any frame) becomes `weight` times its gradient.
    ///
    /// # Panics
    /// When the sizes differ.
    pub(crate) fn of(self, turn: Turn, scores: &Plane, weight: f32, delta: &mut Plane) -> f64 {
        let size = |p: &Plane| (p.rows(), p.cols(), p.channels());
        assert_eq!(size(scores), size(delta), "a gradient for each score");
        let share = weight / (scores.rows() * scores.cols() * scores.channels()) as f32;
        let mut sum = 0.0;
        for row in 0..scores.rows() {
            for (d, s) in delta.row_mut(row).iter_mut().zip(scores.row(row)) {
                let (loss, slope) = self.at(turn, *s);
                sum += f64::from(loss);
                *d = share * slope;
            }
        }
        sum / (scores.rows() * scores.cols() * scores.channels()) as f64
    }

    /// Loss and derivative at one score.
    fn at(self, turn: Turn, s: f32) -> (f32, f32) {
        let sign = if turn == Turn::Made { 1.0 } else { -1.0 };
        match (self, turn) {
            (Self::Wasserstein, _) | (Self::Hinge, Turn::Generator) => (sign * s, sign),
            (Self::Hinge, _) => {
                let loss = 1.0 + sign * s;
                if loss > 0.0 { (loss, sign) } else { (0.0, 0.0) }
            }
            // ln(1 + e^x) and its derivative without overflow.
            (Self::Bce, _) => {
                let x = sign * s;
                let small = exp(-x.abs());
                let sigmoid = if x > 0.0 { 1.0 } else { small } / (1.0 + small);
                (x.max(0.0) + ln(1.0 + small), sign * sigmoid)
            }
        }
    }
}

/// Over what the norm of a gradient penalty is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NormOver {
    /// The channels of a pixel (SinGAN's published code).
    Pixel,
    /// A whole image (Gulrajani et al. 2017).
    Image,
}

/// The gradient penalty of WGAN-GP (Gulrajani et al. 2017) at the inputs in `tape`: with g the gradient of the sum of the
/// critic's scores by the input `layer`, the mean of (|g| - 1)^2. `weight` times its gradient by the parameters is added to
/// `gradient`.
///
/// Exact, without a second derivative: with v = 2 (|g| - 1) g / (n |g|) held constant, the gradient is that of the directional
/// derivative of the critic along v, which a tangent carries forward beside the values. Where g is 0 the norm has no
/// derivative: 0 stands for it. Other inputs count as constants.
pub(crate) fn add_gradient_penalty(
    tape: &mut Tape,
    values: &[f32],
    layer: LayerId,
    over: NormOver,
    weight: f32,
    gradient: &mut [f32],
) -> f64 {
    tape.forward(values, None);
    for image in 0..tape.images() {
        let last = tape.output_delta(image);
        (0..last.rows()).for_each(|row| last.row_mut(row).fill(1.0));
    }
    tape.backward(values, None, true);
    let others: Vec<LayerId> = tape.net().inputs().filter(|other| *other != layer).collect();
    let (images, mut penalty) = (tape.images(), 0.0);
    for image in 0..images {
        for other in &others {
            tape.direction_mut(*other, image).values_mut().fill(0.0);
        }
        let g = tape.delta(layer, image).clone();
        let length = if over == NormOver::Pixel { g.channels() } else { g.values().len() };
        let n = (images * g.values().len() / length) as f32;
        let out = tape.direction_mut(layer, image).values_mut();
        let mut sum = 0.0;
        for (g, v) in g.values().chunks_exact(length).zip(out.chunks_exact_mut(length)) {
            let norm = g.iter().map(|g| g * g).sum::<f32>().sqrt();
            sum += f64::from((norm - 1.0) * (norm - 1.0));
            let factor = if norm > 0.0 { weight * 2.0 * (norm - 1.0) / (n * norm) } else { 0.0 };
            for (v, g) in v.iter_mut().zip(g) {
                *v = factor * g;
            }
        }
        penalty += sum / f64::from(n);
    }
    tape.tangent(values);
    tape.add_tangent_gradient(values, gradient);
    penalty
}

/// A network that is being trained, and its optimiser.
#[derive(Debug)]
pub(crate) struct Player {
    /// What it looks like.
    pub(crate) net: Net,
    /// All trainable values.
    pub(crate) values: Vec<f32>,
    /// Running moments of its batch normalisations.
    pub(crate) running: Vec<Moments>,
    adam: Adam,
}

impl Player {
    /// A player that begins with `values`; `beta`: Adam's first.
    #[must_use]
    pub(crate) fn new(net: Net, values: Vec<f32>, beta: f32) -> Self {
        let adam = Adam::flat(values.len(), beta);
        Self { running: net.running(), net, values, adam }
    }

    /// Takes over values and running moments of a player of the same net.
    pub(crate) fn begin_with(&mut self, other: &Self) {
        self.values.clone_from(&other.values);
        self.running.clone_from(&other.running);
    }

    /// One step against `gradient`.
    pub(crate) fn descend(&mut self, gradient: &[f32], rate: f32) {
        self.adam.descend(&mut self.values, gradient, rate);
    }

    /// Steps taken.
    #[must_use]
    pub(crate) const fn steps(&self) -> usize {
        self.adam.steps()
    }

    /// Everything that training has changed, by names that begin with `name`.
    pub(crate) fn state<'a>(&'a self, name: &str) -> Vec<(String, &'a [f32])> {
        let mut state = vec![(format!("{name}.values"), &self.values[..])];
        for (mean, square) in self.adam.moments() {
            state.push((format!("{name}.mean"), mean));
            state.push((format!("{name}.square"), square));
        }
        for (i, moments) in self.running.iter().enumerate() {
            state.push((format!("{name}.running.{i}.mean"), &moments.mean));
            state.push((format!("{name}.running.{i}.variance"), &moments.variance));
        }
        state
    }

    /// Continues from a [`state`](Self::state) after `steps` steps.
    ///
    /// # Errors
    /// When numbers are missing or damaged.
    pub(crate) fn restore(&mut self, name: &str, steps: usize, numbers: &mut Numbers) -> Result<()> {
        let count = self.values.len();
        let mut take = |what: &str, count| numbers.take(&format!("{name}.{what}"), count);
        self.values = take("values", count)?;
        let (mean, square) = (take("mean", count)?, take("square", count)?);
        self.adam.restore(steps, vec![mean], vec![square]);
        for (i, moments) in self.running.iter_mut().enumerate() {
            let count = moments.mean.len();
            moments.mean = take(&format!("running.{i}.mean"), count)?;
            moments.variance = take(&format!("running.{i}.variance"), count)?;
        }
        Ok(())
    }
}

/// An adversarial training, step by step.
pub(crate) trait Game: Send {
    /// What a step says of itself.
    type Report: Send;

    /// One step: the updates of both players. `share`: how much of the training is over, 0 to 1.
    ///
    /// Random numbers are drawn from a stream of the step's own, so that an interrupted training needs no position in it.
    fn step(&mut self, step: usize, share: f32) -> Self::Report;
}

/// How long a game goes on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Length {
    /// Steps, when no time is set.
    pub(crate) steps: usize,
    /// Time instead of steps: the schedule follows the clock.
    pub(crate) time: Option<Duration>,
    /// Steps and seconds of it that lie behind, before an interruption.
    pub(crate) done: (usize, f64),
}

/// Lets both players take turns until the end, at least once. `after` hears of every step, with its number and the seconds so far:
/// where progress is told, losses are checked and checkpoints are kept; its error ends the game. Gives the number of steps.
///
/// # Errors
/// What `after` says, and when `stop` is raised.
pub(crate) fn play<G: Game>(
    game: &mut G,
    length: Length,
    stop: &Stop,
    mut after: impl FnMut(&mut G, usize, f64, G::Report) -> Result<()>,
) -> Result<usize> {
    let (mut step, spent) = length.done;
    let begun = Instant::now();
    let seconds = || spent + begun.elapsed().as_secs_f64();
    loop {
        let share = match length.time {
            Some(time) => seconds() / time.as_secs_f64().max(1e-9),
            None => step as f64 / length.steps as f64,
        };
        // Of a time every game gets at least one step.
        if share >= 1.0 && (step > 0 || length.time.is_none()) {
            return Ok(step);
        }
        stop.check()?;
        let report = in_pool(|| game.step(step, share.min(1.0) as f32));
        after(game, step, seconds(), report)?;
        step += 1;
    }
}

#[cfg(test)]
mod tests;
