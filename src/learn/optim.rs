//! [`Adam`] (Kingma & Ba 2015), learning rates over a training, and running averages of weights.

use super::ParamStore;
use crate::error::Result;
use candle_core::backprop::GradStore;
use candle_core::{Device, Tensor, Var};

/// How a learning rate falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Decay {
    /// Not at all.
    Constant,
    /// Half a cosine down to a share of the peak.
    Cosine {
        /// Last learning rate as a share of the peak.
        floor: f64,
    },
    /// Constant for a share of the training, then linear down to a share of the peak (pix2pix: half, 0).
    Linear {
        /// Share of the training before it falls.
        after: f64,
        /// Last learning rate as a share of the peak.
        floor: f64,
    },
    /// To a share of the peak at once, when so much of the training is over (SinGAN: .1 after .8).
    Step {
        /// Share of the training before it falls.
        after: f64,
        /// Learning rate from then on as a share of the peak.
        factor: f64,
    },
}

/// Learning rate over a training: linear warm-up, then a decay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule {
    /// Highest learning rate.
    pub(crate) peak: f64,
    /// Number of steps.
    pub(crate) steps: usize,
    /// Share of the steps that warm up.
    pub(crate) warm_up: f64,
    /// How it falls.
    pub(crate) decay: Decay,
}

impl Schedule {
    /// Learning rate at `step`, counted from 0.
    #[must_use]
    pub(crate) fn at(&self, step: usize) -> f64 {
        self.at_phase((step as f64 + 0.5) / self.steps.max(1) as f64)
    }

    /// Learning rate when `phase` of the training is over, 0 to 1.
    #[must_use]
    pub(crate) fn at_phase(&self, phase: f64) -> f64 {
        let phase = phase.clamp(0.0, 1.0);
        let warm = if self.warm_up > 0.0 { (phase / self.warm_up).min(1.0) } else { 1.0 };
        let share = match self.decay {
            Decay::Constant => 1.0,
            Decay::Cosine { floor } => {
                let cosine = 0.5 * (1.0 + (std::f64::consts::PI * phase).cos());
                cosine * (1.0 - floor) + floor
            }
            Decay::Linear { after, floor } if after < 1.0 => {
                1.0 - (1.0 - floor) * ((phase - after) / (1.0 - after)).max(0.0)
            }
            Decay::Linear { .. } => 1.0,
            Decay::Step { after, factor } => {
                if phase < after {
                    1.0
                } else {
                    factor
                }
            }
        };
        self.peak * warm * share
    }
}

/// Adam without weight decay: the second beta is .999, epsilon 1e-8.
#[derive(Debug)]
pub(crate) struct Adam {
    beta: f32,
    step: i32,
    moments: Vec<Moments>,
}

#[derive(Debug)]
struct Moments {
    mean: Vec<f32>,
    square: Vec<f32>,
}

const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.999;
const EPSILON: f32 = 1e-8;

impl Adam {
    /// Zero moments for these variables; the first beta is .9.
    pub(crate) fn new<'a>(vars: impl Iterator<Item = &'a Var>) -> Self {
        Self::of(vars.map(|var| var.elem_count()), BETA_1)
    }

    /// Zero moments for every parameter of a store.
    #[must_use]
    pub(crate) fn over(params: &ParamStore) -> Self {
        Self::new(params.iter().map(|(_, var)| var))
    }

    /// Zero moments for one vector of so many values; `beta`: the first one (.5 for adversarial trainings).
    #[must_use]
    pub(crate) fn flat(values: usize, beta: f32) -> Self {
        Self::of(std::iter::once(values), beta)
    }

    fn of(lengths: impl Iterator<Item = usize>, beta: f32) -> Self {
        let zeros = |length| Moments { mean: vec![0.0; length], square: vec![0.0; length] };
        Self { beta, step: 0, moments: lengths.map(zeros).collect() }
    }

    /// Steps taken.
    #[must_use]
    pub(crate) const fn steps(&self) -> usize {
        self.step as usize
    }

    /// Running means of the gradients and of their squares, in the order of the variables.
    pub(crate) fn moments(&self) -> impl Iterator<Item = (&[f32], &[f32])> {
        self.moments.iter().map(|m| (&m.mean[..], &m.square[..]))
    }

    /// Goes on after `steps` steps that left these moments.
    ///
    /// # Panics
    /// When the lengths are not those of the variables.
    pub(crate) fn restore(&mut self, steps: usize, mean: Vec<Vec<f32>>, square: Vec<Vec<f32>>) {
        assert_eq!((mean.len(), square.len()), (self.moments.len(), self.moments.len()), "one a variable");
        self.step = i32::try_from(steps).expect("fewer than 2^31 steps");
        for ((m, mean), square) in self.moments.iter_mut().zip(mean).zip(square) {
            assert_eq!((mean.len(), square.len()), (m.mean.len(), m.square.len()), "the variable's length");
            *m = Moments { mean, square };
        }
    }

    /// Takes up the next step: what [`Moments::descend`] needs.
    fn next(&mut self, rate: f32) -> [f32; 3] {
        self.step += 1;
        [self.beta, rate / (1.0 - self.beta.powi(self.step)), 1.0 - BETA_2.powi(self.step)]
    }

    /// One step of the only vector against its gradient.
    ///
    /// # Panics
    /// When there are several, or the lengths differ.
    pub(crate) fn descend(&mut self, values: &mut [f32], gradient: &[f32], rate: f32) {
        let step = self.next(rate);
        let [moments] = &mut self.moments[..] else { panic!("one vector of values") };
        moments.descend(values, gradient, step);
    }

    /// One step on the same variables in the same order as at construction. A variable without a gradient stays.
    ///
    /// # Errors
    /// When a tensor cannot be read or written.
    ///
    /// # Panics
    /// When the variables are not those of the construction.
    pub(crate) fn update<'a>(
        &mut self,
        vars: impl Iterator<Item = &'a Var>,
        gradients: &GradStore,
        learning_rate: f64,
    ) -> Result<()> {
        let step = self.next(learning_rate as f32);
        let mut moments = self.moments.iter_mut();
        for var in vars {
            let m = moments.next().expect("the variables of the construction");
            let Some(gradient) = gradients.get(var) else { continue };
            let gradient = gradient.flatten_all()?.to_vec1::<f32>()?;
            let mut values = var.flatten_all()?.to_vec1::<f32>()?;
            m.descend(&mut values, &gradient, step);
            var.set(&Tensor::from_vec(values, var.shape(), &Device::Cpu)?)?;
        }
        assert!(moments.next().is_none(), "the variables of the construction");
        Ok(())
    }
}

impl Moments {
    /// One step; `rate` has the correction of the mean in it, `correction` is that of the squares.
    fn descend(&mut self, values: &mut [f32], gradient: &[f32], [beta, rate, correction]: [f32; 3]) {
        assert_eq!(
            (values.len(), gradient.len()),
            (self.mean.len(), self.mean.len()),
            "the variable's length"
        );
        let moments = self.mean.iter_mut().zip(&mut self.square);
        for ((value, g), (mean, square)) in values.iter_mut().zip(gradient).zip(moments) {
            *mean = beta * *mean + (1.0 - beta) * g;
            *square = BETA_2 * *square + (1.0 - BETA_2) * g * g;
            *value -= rate * *mean / ((*square / correction).sqrt() + EPSILON);
        }
    }
}

/// A running average of values over the steps of a training, which makes better images than the last values do.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Average {
    decay: f32,
    steps: usize,
    values: Vec<f32>,
}

impl Average {
    /// Of `values`; `decay`: how much of the average stays at a step (.998), in the end.
    #[must_use]
    pub(crate) fn new(values: &[f32], decay: f32) -> Self {
        Self { decay, steps: 0, values: values.to_vec() }
    }

    /// Mixes in the values after a step. The first steps count more, so that the beginning is soon forgotten: (1 + i) / (10 + i)
    /// stays at step i, at most `decay`.
    ///
    /// # Panics
    /// When the length differs.
    pub(crate) fn mix(&mut self, values: &[f32]) {
        assert_eq!(values.len(), self.values.len(), "the averaged values");
        let keep = self.decay.min((1 + self.steps) as f32 / (10 + self.steps) as f32);
        self.steps += 1;
        for (average, value) in self.values.iter_mut().zip(values) {
            *average += (1.0 - keep) * (value - *average);
        }
    }

    /// The average.
    #[must_use]
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Steps mixed in.
    #[must_use]
    pub(crate) const fn steps(&self) -> usize {
        self.steps
    }

    /// Goes on after `steps` steps that left this average.
    ///
    /// # Panics
    /// When the length differs.
    pub(crate) fn restore(&mut self, steps: usize, values: Vec<f32>) {
        assert_eq!(values.len(), self.values.len(), "the averaged values");
        (self.steps, self.values) = (steps, values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn schedule_warms_up_peaks_and_ends_at_the_floor() {
        let s = Schedule { peak: 1.0, steps: 100, warm_up: 0.1, decay: Decay::Cosine { floor: 0.01 } };
        assert!(s.at(0) < 0.11 && s.at(10) > 0.95);
        assert!((s.at_phase(1.0) - 0.01).abs() < 1e-12 && s.at(99) < 0.011);
        assert!((10..99).all(|i| s.at(i) > s.at(i + 1)));
    }

    #[test]
    fn decays_are_those_of_their_definitions() {
        let at = |decay, phase| Schedule { peak: 2.0, steps: 10, warm_up: 0.0, decay }.at_phase(phase);
        assert_eq!([0.0, 1.0].map(|phase| at(Decay::Constant, phase)), [2.0, 2.0]);
        let linear = Decay::Linear { after: 0.5, floor: 0.1 };
        let got = [0.2, 0.5, 0.75, 1.0].map(|phase| at(linear, phase));
        assert!(got.iter().zip([2.0, 2.0, 1.1, 0.2]).all(|(a, b)| (a - b).abs() < 1e-12), "{got:?}");
        let step = Decay::Step { after: 0.8, factor: 0.1 };
        assert_eq!([0.79, 0.81].map(|phase| at(step, phase)), [2.0, 0.2]);
    }

    #[test]
    fn adam_finds_the_minimum_of_a_parabola() {
        let mut params = ParamStore::new(Seed(1));
        let x = params.normal("x", 4, 1.0).unwrap();
        let mut adam = Adam::over(&params);
        for _ in 0..400 {
            let loss = (&x - 3.0).unwrap().sqr().unwrap().sum_all().unwrap();
            let gradients = loss.backward().unwrap();
            adam.update(params.iter().map(|(_, v)| v), &gradients, 0.05).unwrap();
        }
        assert!(params.snapshot().unwrap()[0].iter().all(|v| (v - 3.0).abs() < 1e-2));
        let mut values = vec![0.0f32, 9.0];
        let mut adam = Adam::flat(2, 0.5);
        for _ in 0..600 {
            let gradient: Vec<f32> = values.iter().map(|v| 2.0 * (v - 3.0)).collect();
            adam.descend(&mut values, &gradient, 0.05);
        }
        assert!(values.iter().all(|v| (v - 3.0).abs() < 1e-2), "{values:?}");
    }

    /// The first two steps by hand: the first moves every value by the rate, whatever its gradient.
    #[test]
    fn adam_takes_the_published_steps() {
        let mut values = vec![1.0f32, 1.0];
        let mut adam = Adam::flat(2, 0.5);
        adam.descend(&mut values, &[4.0, -0.01], 0.1);
        assert!((values[0] - 0.9).abs() < 1e-6 && (values[1] - 1.1).abs() < 1e-5, "{values:?}");
        adam.descend(&mut values, &[2.0, 0.0], 0.1);
        // mean (.5 x 2 + .5 x 2) / .75, square (.999 x .016 + .001 x 4) / .001999
        let want = 0.9 - 0.1 * (2.0 / 0.75) / (0.019_984f32 / 0.001_999).sqrt();
        assert!((values[0] - want).abs() < 1e-5, "{} {want}", values[0]);
        assert_eq!(adam.steps(), 2);
    }

    #[test]
    fn an_average_follows_and_forgets_its_beginning() {
        let mut average = Average::new(&[0.0], 0.9);
        average.mix(&[1.0]);
        assert!((average.values()[0] - 0.9).abs() < 1e-6, "a tenth stays of the first");
        (0..100).for_each(|_| average.mix(&[1.0]));
        assert!((average.values()[0] - 1.0).abs() < 1e-4);
        let before = average.values()[0];
        average.mix(&[2.0]);
        assert!((average.values()[0] - before - 0.1).abs() < 1e-3);
    }
}
