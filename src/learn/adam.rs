//! Adam (Kingma & Ba 2015) over a [`ParamStore`], with a warm-up and cosine schedule.

use super::ParamStore;
use crate::error::Result;
use candle_core::backprop::GradStore;
use candle_core::{Device, Tensor, Var};

/// Learning rate over a training: linear warm-up, then half a cosine down to a floor.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    /// Highest learning rate.
    pub peak: f64,
    /// Number of steps.
    pub steps: usize,
    /// Share of the steps that warm up.
    pub warm_up: f64,
    /// Last learning rate as a share of `peak`.
    pub floor: f64,
}

impl Schedule {
    /// Learning rate at `step`, counted from 0.
    #[must_use]
    pub fn at(&self, step: usize) -> f64 {
        self.at_phase((step as f64 + 0.5) / self.steps.max(1) as f64)
    }

    /// Learning rate when `phase` of the training is over, 0 to 1.
    #[must_use]
    pub fn at_phase(&self, phase: f64) -> f64 {
        let phase = phase.clamp(0.0, 1.0);
        let warm = if self.warm_up > 0.0 { (phase / self.warm_up).min(1.0) } else { 1.0 };
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * phase).cos());
        self.peak * warm * (cosine * (1.0 - self.floor) + self.floor)
    }
}

/// Adam without weight decay; betas .9 and .999, epsilon 1e-8.
#[derive(Debug)]
pub struct Adam {
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
    /// Zero moments for these variables.
    pub fn new<'a>(vars: impl Iterator<Item = &'a Var>) -> Self {
        let zeros =
            |var: &Var| Moments { mean: vec![0.0; var.elem_count()], square: vec![0.0; var.elem_count()] };
        Self { step: 0, moments: vars.map(zeros).collect() }
    }

    /// Zero moments for every parameter of a store.
    #[must_use]
    pub fn over(params: &ParamStore) -> Self {
        Self::new(params.iter().map(|(_, var)| var))
    }

    /// Running means of the gradients and of their squares, in the order of the variables.
    #[must_use]
    pub fn moments(&self) -> (Vec<Vec<f32>>, Vec<Vec<f32>>) {
        self.moments.iter().map(|m| (m.mean.clone(), m.square.clone())).unzip()
    }

    /// Goes on after `steps` steps that left these moments.
    ///
    /// # Panics
    /// When the lengths are not those of the variables.
    pub fn restore(&mut self, steps: usize, mean: Vec<Vec<f32>>, square: Vec<Vec<f32>>) {
        assert_eq!((mean.len(), square.len()), (self.moments.len(), self.moments.len()), "one a variable");
        self.step = i32::try_from(steps).expect("fewer than 2^31 steps");
        for ((m, mean), square) in self.moments.iter_mut().zip(mean).zip(square) {
            assert_eq!((mean.len(), square.len()), (m.mean.len(), m.square.len()), "the variable's length");
            *m = Moments { mean, square };
        }
    }

    /// One step on the same variables in the same order as at construction. A variable without a gradient stays.
    ///
    /// # Errors
    /// When a tensor cannot be read or written.
    ///
    /// # Panics
    /// When the variables are not those of the construction.
    pub fn update<'a>(
        &mut self,
        vars: impl Iterator<Item = &'a Var>,
        gradients: &GradStore,
        learning_rate: f64,
    ) -> Result<()> {
        self.step += 1;
        let correction_1 = 1.0 - BETA_1.powi(self.step);
        let correction_2 = 1.0 - BETA_2.powi(self.step);
        let rate = learning_rate as f32 / correction_1;
        let mut moments = self.moments.iter_mut();
        for var in vars {
            let m = moments.next().expect("the variables of the construction");
            let Some(gradient) = gradients.get(var) else { continue };
            let gradient = gradient.flatten_all()?.to_vec1::<f32>()?;
            let mut values = var.flatten_all()?.to_vec1::<f32>()?;
            for (((value, g), mean), square) in
                values.iter_mut().zip(&gradient).zip(&mut m.mean).zip(&mut m.square)
            {
                *mean = BETA_1 * *mean + (1.0 - BETA_1) * g;
                *square = BETA_2 * *square + (1.0 - BETA_2) * g * g;
                *value -= rate * *mean / ((*square / correction_2).sqrt() + EPSILON);
            }
            var.set(&Tensor::from_vec(values, var.shape(), &Device::Cpu)?)?;
        }
        assert!(moments.next().is_none(), "the variables of the construction");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn schedule_warms_up_peaks_and_ends_at_the_floor() {
        let s = Schedule { peak: 1.0, steps: 100, warm_up: 0.1, floor: 0.01 };
        assert!(s.at(0) < 0.11 && s.at(10) > 0.95);
        assert!((s.at_phase(1.0) - 0.01).abs() < 1e-12 && s.at(99) < 0.011);
        assert!((10..99).all(|i| s.at(i) > s.at(i + 1)));
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
    }
}
