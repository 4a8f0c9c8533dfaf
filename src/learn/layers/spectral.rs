//! Spectral normalisation of weights (Miyato, Kataoka, Koyama & Yoshida 2018): divided by their largest singular value, which
//! one step of power iteration a training step follows.

use super::{LayerId, Net};
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use std::ops::Range;

/// The largest singular values of a net's weights, and their vectors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SpectralNorm {
    layers: Vec<Matrix>,
}

/// A layer's weights as (taps x input channels, output channels).
#[derive(Clone, Debug, PartialEq)]
struct Matrix {
    place: Range<usize>,
    left: Vec<f32>,
    right: Vec<f32>,
    sigma: f32,
}

impl SpectralNorm {
    /// For all layers with weights, from random vectors.
    #[must_use]
    pub(crate) fn new(net: &Net, seed: Seed) -> Self {
        let matrix = |(number, layer): (usize, LayerId)| {
            let [place, biases, _] = net.places(layer);
            let mut stream = seed.stream(&format!("spectrum of layer {number}"));
            let mut left: Vec<f32> =
                (0..place.len() / biases.len()).map(|_| stream.sample(StandardNormal)).collect();
            unit(&mut left);
            Matrix { place, left, right: vec![0.0; biases.len()], sigma: 1.0 }
        };
        Self { layers: net.weighted().enumerate().map(matrix).collect() }
    }

    /// The values of a net with every layer's weights over their largest singular value, after `steps` more of the power
    /// iteration (one in training; the first time at least one).
    pub(crate) fn normalise(&mut self, values: &[f32], steps: usize) -> Vec<f32> {
        let mut out = values.to_vec();
        for matrix in &mut self.layers {
            let weights = &mut out[matrix.place.clone()];
            let steps = if matrix.right.iter().all(|v| *v == 0.0) { steps.max(1) } else { steps };
            (0..steps).for_each(|_| matrix.step(weights));
            matrix.sigma = matrix.along(weights);
            weights.iter_mut().for_each(|w| *w /= matrix.sigma);
        }
        out
    }

    /// Turns the gradient by what [`normalise`](Self::normalise) gave into that by the values: the singular vectors count as
    /// constants.
    pub(crate) fn back(&self, normalised: &[f32], gradient: &mut [f32]) {
        for matrix in &self.layers {
            let (weights, gradient) =
                (&normalised[matrix.place.clone()], &mut gradient[matrix.place.clone()]);
            let along: f64 = weights.iter().zip(gradient.iter()).map(|(w, g)| f64::from(w * g)).sum();
            let columns = matrix.right.len();
            for (row, left) in gradient.chunks_exact_mut(columns).zip(&matrix.left) {
                for (g, right) in row.iter_mut().zip(&matrix.right) {
                    *g = (*g - along as f32 * left * right) / matrix.sigma;
                }
            }
        }
    }

    /// The largest singular values as last found.
    pub(crate) fn sigmas(&self) -> impl Iterator<Item = f32> {
        self.layers.iter().map(|matrix| matrix.sigma)
    }
}

impl Matrix {
    fn step(&mut self, weights: &[f32]) {
        let columns = self.right.len();
        self.right.fill(0.0);
        for (row, left) in weights.chunks_exact(columns).zip(&self.left) {
            self.right.iter_mut().zip(row).for_each(|(r, w)| *r += left * w);
        }
        unit(&mut self.right);
        for (left, row) in self.left.iter_mut().zip(weights.chunks_exact(columns)) {
            *left = row.iter().zip(&self.right).map(|(w, r)| w * r).sum();
        }
        unit(&mut self.left);
    }

    /// left . W right
    fn along(&self, weights: &[f32]) -> f32 {
        let rows = weights.chunks_exact(self.right.len()).zip(&self.left);
        let sum: f32 =
            rows.map(|(row, left)| left * row.iter().zip(&self.right).map(|(w, r)| w * r).sum::<f32>()).sum();
        sum.max(f32::MIN_POSITIVE)
    }
}

fn unit(vector: &mut [f32]) {
    let norm = vector.iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    vector.iter_mut().for_each(|v| *v /= norm);
}
