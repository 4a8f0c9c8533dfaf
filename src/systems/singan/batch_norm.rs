//! Batch normalisation of one image (Ioffe & Szegedy 2015): forward, backward, and the derivative of the pair of value and
//! tangent that the gradient penalty needs.
//!
//! With n pixels, unit x = s (z - mean z), s = (var z + 1e-5)^-1/2, and the projection P(u) = u - mean u - x mean(x u), a
//! tangent goes forward as x' = s P(z') and a gradient goes back as s P(w). Sums run in the order of rows, in pieces that do
//! not depend on the number of threads.

use crate::learn::convolution::Plane;
use rayon::prelude::*;

const EPSILON: f32 = 1e-5;
/// Share of a new batch in the running moments (the default of the published code's library).
const MOMENTUM: f32 = 0.1;
/// Rows of one piece of a sum.
const ROWS: usize = 8;

/// Mean and variance of every channel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Moments {
    pub(super) mean: Vec<f32>,
    pub(super) variance: Vec<f32>,
}

impl Moments {
    /// Mean 0, variance 1.
    pub(super) fn unit(channels: usize) -> Self {
        Self { mean: vec![0.0; channels], variance: vec![1.0; channels] }
    }

    /// Reciprocal deviations.
    pub(super) fn scales(&self) -> Vec<f32> {
        self.variance.iter().map(|v| (v + EPSILON).sqrt().recip()).collect()
    }

    /// Moves these running moments towards those of a batch of `count` pixels.
    pub(super) fn mix(&mut self, batch: &Self, count: usize) {
        let unbiased = count as f32 / (count as f32 - 1.0).max(1.0);
        for (m, b) in self.mean.iter_mut().zip(&batch.mean) {
            *m += MOMENTUM * (b - *m);
        }
        for (v, b) in self.variance.iter_mut().zip(&batch.variance) {
            *v += MOMENTUM * (b * unbiased - *v);
        }
    }
}

/// Gradients of gains and offsets.
pub(super) struct Sums {
    pub(super) gain: Vec<f32>,
    pub(super) offset: Vec<f32>,
}

/// Sum of every channel over the pixels inside the frame.
pub(super) fn channel_sums(plane: &Plane) -> Vec<f32> {
    sums(plane.rows(), plane.channels(), |row, sum| {
        for pixel in plane.row(row).chunks_exact(plane.channels()) {
            for (s, v) in sum.iter_mut().zip(pixel) {
                *s += v;
            }
        }
    })
}

/// Sum of the products of two planes, by channel.
fn product_sums(a: &Plane, b: &Plane) -> Vec<f32> {
    let channels = a.channels();
    sums(a.rows(), channels, |row, sum| {
        for (a, b) in a.row(row).chunks_exact(channels).zip(b.row(row).chunks_exact(channels)) {
            for ((s, a), b) in sum.iter_mut().zip(a).zip(b) {
                *s += a * b;
            }
        }
    })
}

/// Sums by channel, in pieces of rows.
fn sums(rows: usize, channels: usize, add: impl Fn(usize, &mut [f32]) + Sync) -> Vec<f32> {
    let pieces: Vec<Vec<f32>> = (0..rows.div_ceil(ROWS))
        .into_par_iter()
        .map(|piece| {
            let mut sum = vec![0.0; channels];
            (piece * ROWS..rows.min((piece + 1) * ROWS)).for_each(|row| add(row, &mut sum));
            sum
        })
        .collect();
    let mut total = vec![0.0; channels];
    for piece in pieces {
        for (t, p) in total.iter_mut().zip(piece) {
            *t += p;
        }
    }
    total
}

/// Calls `change` with every row of `plane` inside its frame.
fn for_rows(plane: &mut Plane, change: impl Fn(usize, &mut [f32]) + Sync) {
    let (border, channels) = (plane.border(), plane.channels());
    let (rows, length) = (plane.rows(), plane.cols() * channels);
    let stride = plane.stored().1 * channels;
    let inside = &mut plane.values_mut()[border * stride..(border + rows) * stride];
    inside.par_chunks_mut(stride).enumerate().for_each(|(row, values)| {
        change(row, &mut values[border * channels..border * channels + length]);
    });
}

/// Takes away the mean and divides by the deviation, channel by channel; gives what was taken away.
pub(super) fn normalise(z: &mut Plane) -> Moments {
    let channels = z.channels();
    let count = (z.rows() * z.cols()) as f32;
    let mean: Vec<f32> = channel_sums(z).iter().map(|s| s / count).collect();
    for_rows(z, |_, row| {
        for pixel in row.chunks_exact_mut(channels) {
            for (v, m) in pixel.iter_mut().zip(&mean) {
                *v -= m;
            }
        }
    });
    let variance = product_sums(z, z).iter().map(|s| s / count).collect();
    let moments = Moments { mean, variance };
    let scales = moments.scales();
    for_rows(z, |_, row| {
        for pixel in row.chunks_exact_mut(channels) {
            for (v, s) in pixel.iter_mut().zip(&scales) {
                *v *= s;
            }
        }
    });
    moments
}

/// The leaky ReLU of gain x unit + offset.
pub(super) fn activate(unit: &Plane, gains: &[f32], offsets: &[f32], leak: f32, out: &mut Plane) {
    let channels = gains.len();
    for_rows(out, |row, out| {
        for (out, unit) in out.chunks_exact_mut(channels).zip(unit.row(row).chunks_exact(channels)) {
            for (((o, u), g), b) in out.iter_mut().zip(unit).zip(gains).zip(offsets) {
                let y = g * u + b;
                *o = if y > 0.0 { y } else { leak * y };
            }
        }
    });
}

/// `delta` holds the gradient of gain x unit + offset and becomes that of the values before the normalisation;
/// `unit_delta` becomes that of the unit values.
pub(super) fn backward(
    unit: &Plane,
    scales: &[f32],
    gains: &[f32],
    delta: &mut Plane,
    unit_delta: &mut Plane,
) -> Sums {
    let channels = gains.len();
    let offset = channel_sums(delta);
    let gain = product_sums(delta, unit);
    for_rows(unit_delta, |row, w| {
        for (w, d) in w.chunks_exact_mut(channels).zip(delta.row(row).chunks_exact(channels)) {
            for ((w, d), g) in w.iter_mut().zip(d).zip(gains) {
                *w = d * g;
            }
        }
    });
    let project = Projection::new(unit, unit_delta);
    for_rows(delta, |row, d| project.apply(unit.row(row), unit_delta.row(row), scales, d));
    Sums { gain, offset }
}

/// P(u) = u - mean u - x mean(x u), by channel.
pub(super) struct Projection {
    /// mean u
    pub(super) mean: Vec<f32>,
    /// mean(x u)
    pub(super) along: Vec<f32>,
}

impl Projection {
    pub(super) fn new(unit: &Plane, u: &Plane) -> Self {
        let count = (unit.rows() * unit.cols()) as f32;
        Self {
            mean: channel_sums(u).iter().map(|s| s / count).collect(),
            along: product_sums(unit, u).iter().map(|s| s / count).collect(),
        }
    }

    /// s P(u) of one row.
    fn apply(&self, unit: &[f32], u: &[f32], scales: &[f32], out: &mut [f32]) {
        let channels = scales.len();
        let rows =
            out.chunks_exact_mut(channels).zip(unit.chunks_exact(channels)).zip(u.chunks_exact(channels));
        for ((out, x), u) in rows {
            for c in 0..channels {
                out[c] = scales[c] * (u[c] - self.mean[c] - x[c] * self.along[c]);
            }
        }
    }
}

/// A tangent through the normalisation, in place: z' -> x' = s P(z'). Gives the projection's means.
pub(super) fn tangent(unit: &Plane, scales: &[f32], z: &mut Plane) -> Projection {
    let project = Projection::new(unit, z);
    let channels = scales.len();
    for_rows(z, |row, z| {
        for (z, x) in z.chunks_exact_mut(channels).zip(unit.row(row).chunks_exact(channels)) {
            for c in 0..channels {
                z[c] = scales[c] * (z[c] - project.mean[c] - x[c] * project.along[c]);
            }
        }
    });
    project
}

/// The tangent of the activation: gain x', times the leak where the activation is not positive.
pub(super) fn activate_tangent(moved: &Plane, gains: &[f32], active: &Plane, leak: f32, out: &mut Plane) {
    let channels = gains.len();
    for_rows(out, |row, out| {
        let inputs = moved.row(row).chunks_exact(channels).zip(active.row(row).chunks_exact(channels));
        for (out, (moved, active)) in out.chunks_exact_mut(channels).zip(inputs) {
            for c in 0..channels {
                let y = gains[c] * moved[c];
                out[c] = if active[c] > 0.0 { y } else { leak * y };
            }
        }
    });
}

/// What the value side of a normalised layer adds to the gradient of the directional derivative.
pub(super) struct ValueSide<'a> {
    pub(super) unit: &'a Plane,
    pub(super) scales: &'a [f32],
    pub(super) gains: &'a [f32],
    /// x', the tangent of the unit values.
    pub(super) moved: &'a Plane,
    /// The means of the tangent's projection.
    pub(super) projection: &'a Projection,
    /// w, the gradient of the tangent's unit values.
    pub(super) w: &'a Plane,
}

impl ValueSide<'_> {
    /// `mu` holds the gradient of gain x unit + offset through the layers above, and becomes that of the values before
    /// the normalisation, with what the tangent of this layer says about them added. Gives the gradients of gains and offsets.
    ///
    /// With m = mean(x z'): u = gain mu - s (w m + z' mean(w x)), and the answer is s (P(u) - x mean(w x')).
    pub(super) fn backward(&self, mu: &mut Plane, scratch: &mut Plane) -> Sums {
        let channels = self.gains.len();
        let count = (self.unit.rows() * self.unit.cols()) as f32;
        let over = |sums: Vec<f32>| sums.iter().map(|s| s / count).collect::<Vec<f32>>();
        let offset = channel_sums(mu);
        let gain = product_sums(mu, self.unit);
        let wx = over(product_sums(self.w, self.unit));
        let moved = over(product_sums(self.w, self.moved));
        for_rows(scratch, |row, u| {
            let (x, moved, w, mu) = (self.unit.row(row), self.moved.row(row), self.w.row(row), mu.row(row));
            for (i, u) in u.iter_mut().enumerate() {
                let c = i % channels;
                let (s, m) = (self.scales[c], self.projection.along[c]);
                let z = moved[i] / s + self.projection.mean[c] + x[i] * m;
                *u = self.gains[c] * mu[i] - s * (w[i] * m + z * wx[c]);
            }
        });
        let project = Projection::new(self.unit, scratch);
        for_rows(mu, |row, mu| {
            let x = self.unit.row(row);
            project.apply(x, scratch.row(row), self.scales, mu);
            for (i, mu) in mu.iter_mut().enumerate() {
                let c = i % channels;
                *mu -= self.scales[c] * x[i] * moved[c];
            }
        });
        // The gain also scales the tangent: sum of lambda x' with lambda = w / gain.
        let gain = (0..channels).map(|c| gain[c] + moved[c] * count / self.gains[c]).collect();
        Sums { gain, offset }
    }
}
