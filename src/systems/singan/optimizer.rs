//! Adam (Kingma & Ba 2015) over the flat values of one network.

const BETA_2: f32 = 0.999;
const EPSILON: f32 = 1e-8;

/// Adam without weight decay.
#[derive(Debug)]
pub(super) struct Adam {
    beta: f32,
    step: i32,
    mean: Vec<f32>,
    square: Vec<f32>,
}

impl Adam {
    pub(super) fn new(values: usize, beta: f32) -> Self {
        Self { beta, step: 0, mean: vec![0.0; values], square: vec![0.0; values] }
    }

    /// Steps taken, means and squares of the gradients.
    pub(super) fn state(&self) -> (usize, &[f32], &[f32]) {
        (self.step as usize, &self.mean, &self.square)
    }

    /// Continues from a [`state`](Self::state) of the same number of values.
    pub(super) fn restore(&mut self, step: usize, mean: Vec<f32>, square: Vec<f32>) {
        assert_eq!(
            (mean.len(), square.len()),
            (self.mean.len(), self.square.len()),
            "moments of this network"
        );
        (self.step, self.mean, self.square) = (step as i32, mean, square);
    }

    /// One step against `gradient`.
    pub(super) fn update(&mut self, values: &mut [f32], gradient: &[f32], rate: f32) {
        self.step += 1;
        let rate = rate / (1.0 - self.beta.powi(self.step));
        let correction = 1.0 - BETA_2.powi(self.step);
        for i in 0..values.len() {
            let g = gradient[i];
            self.mean[i] = self.beta * self.mean[i] + (1.0 - self.beta) * g;
            self.square[i] = BETA_2 * self.square[i] + (1.0 - BETA_2) * g * g;
            values[i] -= rate * self.mean[i] / ((self.square[i] / correction).sqrt() + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_minimum_of_a_parabola() {
        let mut values = vec![0.0f32, 9.0];
        let mut adam = Adam::new(2, 0.5);
        for _ in 0..600 {
            let gradient: Vec<f32> = values.iter().map(|v| 2.0 * (v - 3.0)).collect();
            adam.update(&mut values, &gradient, 0.05);
        }
        assert!(values.iter().all(|v| (v - 3.0).abs() < 1e-2), "{values:?}");
    }
}
