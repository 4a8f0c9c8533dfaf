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
    let channels = plane.channels();
    let [sums] = sums(plane.rows(), channels, |row, [sum]| {
        for pixel in plane.row(row).chunks_exact(channels) {
            for (s, v) in sum.iter_mut().zip(pixel) {
                *s += v;
            }
        }
    });
    sums
}

/// Sums of `u`, and of `u` times `unit`, by channel.
fn sums_along(unit: &Plane, u: &Plane) -> [Vec<f32>; 2] {
    let channels = unit.channels();
    sums(unit.rows(), channels, |row, [sum, product]| {
        for (x, u) in pixels(unit, row).zip(pixels(u, row)) {
            for (((s, p), u), x) in sum.iter_mut().zip(product.iter_mut()).zip(u).zip(x) {
                *s += u;
                *p += u * x;
            }
        }
    })
}

/// The pixels of a row.
fn pixels(plane: &Plane, row: usize) -> impl Iterator<Item = &[f32]> {
    plane.row(row).chunks_exact(plane.channels())
}

/// `N` sums by channel, in pieces of rows; `add` gets a row and where to add it.
fn sums<const N: usize>(
    rows: usize,
    channels: usize,
    add: impl Fn(usize, [&mut [f32]; N]) + Sync,
) -> [Vec<f32>; N] {
    let zeros = || [(); N].map(|()| vec![0.0; channels]);
    let pieces: Vec<[Vec<f32>; N]> = (0..rows.div_ceil(ROWS))
        .into_par_iter()
        .map(|piece| {
            let mut sums = zeros();
            for row in piece * ROWS..rows.min((piece + 1) * ROWS) {
                add(row, sums.each_mut().map(|sum| &mut sum[..]));
            }
            sums
        })
        .collect();
    let mut total = zeros();
    for piece in &pieces {
        for (t, p) in total.iter_mut().flatten().zip(piece.iter().flatten()) {
            *t += p;
        }
    }
    total
}

/// Calls `change` with every row inside the frames of two planes of one size.
fn for_rows(a: &mut Plane, b: &mut Plane, change: impl Fn(usize, &mut [f32], &mut [f32]) + Sync) {
    let rows = inner_rows(a).zip(inner_rows(b));
    rows.enumerate().for_each(|(row, (a, b))| change(row, a, b));
}

/// The rows inside a plane's frame.
fn inner_rows(plane: &mut Plane) -> impl IndexedParallelIterator<Item = &mut [f32]> {
    let (border, channels) = (plane.border(), plane.channels());
    let (rows, length) = (plane.rows(), plane.cols() * channels);
    let stride = plane.stored().1 * channels;
    let inside = &mut plane.values_mut()[border * stride..(border + rows) * stride];
    inside.par_chunks_mut(stride).map(move |row| &mut row[border * channels..border * channels + length])
}

/// Gains and offsets of a normalised layer, and the leak of its activation.
#[derive(Clone, Copy)]
pub(super) struct Activation<'a> {
    pub(super) gains: &'a [f32],
    pub(super) offsets: &'a [f32],
    pub(super) leak: f32,
}

/// Takes away the mean and divides by the deviation, channel by channel, in place; `out` is the leaky ReLU of gain x unit +
/// offset. Gives what was taken away.
pub(super) fn normalise(z: &mut Plane, activation: Activation<'_>, out: &mut Plane) -> Moments {
    let channels = z.channels();
    let count = (z.rows() * z.cols()) as f32;
    let mean: Vec<f32> = channel_sums(z).iter().map(|s| s / count).collect();
    let [squares] = sums(z.rows(), channels, |row, [sum]| {
        for z in pixels(z, row) {
            for ((s, z), m) in sum.iter_mut().zip(z).zip(&mean) {
                *s += (z - m) * (z - m);
            }
        }
    });
    let moments = Moments { mean, variance: squares.iter().map(|s| s / count).collect() };
    let scales = moments.scales();
    let (mean, scales) = (&moments.mean[..channels], &scales[..channels]);
    let Activation { gains, offsets, leak } = activation;
    let (gains, offsets) = (&gains[..channels], &offsets[..channels]);
    for_rows(z, out, |_, z, out| {
        for (z, out) in z.chunks_exact_mut(channels).zip(out.chunks_exact_mut(channels)) {
            let unit = z.iter_mut().zip(mean).zip(scales);
            for (((z, m), s), (out, (g, b))) in unit.zip(out.iter_mut().zip(gains.iter().zip(offsets))) {
                *z = (*z - m) * s;
                // The leak is below 1: the larger of the two.
                let y = g * *z + b;
                *out = if y > leak * y { y } else { leak * y };
            }
        }
    });
    moments
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
    let channels = unit.channels();
    let count = (unit.rows() * unit.cols()) as f32;
    let [offset, gain] = sums_along(unit, delta);
    let times_gain = |sums: &[f32]| sums.iter().zip(gains).map(|(s, g)| g * s / count).collect::<Vec<f32>>();
    let (mean, along) = (times_gain(&offset), times_gain(&gain));
    let (mean, along) = (&mean[..channels], &along[..channels]);
    let (scales, gains) = (&scales[..channels], &gains[..channels]);
    for_rows(delta, unit_delta, |row, delta, w| {
        let both = delta.chunks_exact_mut(channels).zip(w.chunks_exact_mut(channels));
        for ((d, w), x) in both.zip(pixels(unit, row)) {
            for c in 0..channels {
                w[c] = gains[c] * d[c];
                d[c] = scales[c] * (w[c] - mean[c] - x[c] * along[c]);
            }
        }
    });
    Sums { gain, offset }
}

/// The means of P(u) = u - mean u - x mean(x u), by channel.
pub(super) struct Projection {
    /// mean u
    mean: Vec<f32>,
    /// mean(x u)
    along: Vec<f32>,
}

impl Projection {
    fn new(unit: &Plane, u: &Plane) -> Self {
        let count = (unit.rows() * unit.cols()) as f32;
        let [mean, along] = sums_along(unit, u).map(|sums| sums.iter().map(|s| s / count).collect());
        Self { mean, along }
    }
}

/// A tangent through the normalisation, in place: z' -> x' = s P(z'). `out` is the tangent of the activation: gain x', times
/// the leak where `active`, the activation, is not positive. Gives the projection's means.
pub(super) fn tangent(
    unit: &Plane,
    scales: &[f32],
    activation: Activation<'_>,
    active: &Plane,
    z: &mut Plane,
    out: &mut Plane,
) -> Projection {
    let project = Projection::new(unit, z);
    let channels = unit.channels();
    let (mean, along) = (&project.mean[..channels], &project.along[..channels]);
    let scales = &scales[..channels];
    let Activation { gains, leak, .. } = activation;
    for_rows(z, out, |row, z, out| {
        let both = z.chunks_exact_mut(channels).zip(out.chunks_exact_mut(channels));
        for ((z, out), (x, active)) in both.zip(pixels(unit, row).zip(pixels(active, row))) {
            for c in 0..channels {
                z[c] = scales[c] * (z[c] - mean[c] - x[c] * along[c]);
            }
            for (((out, z), active), g) in out.iter_mut().zip(z.iter()).zip(active).zip(gains) {
                // Without a branch, which nothing could foresee.
                let positive = f32::from(*active > 0.0);
                *out = g * z * (positive + leak * (1.0 - positive));
            }
        }
    });
    project
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
        let channels = self.unit.channels();
        let count = (self.unit.rows() * self.unit.cols()) as f32;
        let [offset, gain] = sums_along(self.unit, mu);
        let [wx, moved] = sums(self.unit.rows(), channels, |row, [wx, moved]| {
            let values = pixels(self.unit, row).zip(pixels(self.moved, row));
            for (w, (x, m)) in pixels(self.w, row).zip(values) {
                for ((((wx, moved), w), x), m) in wx.iter_mut().zip(moved.iter_mut()).zip(w).zip(x).zip(m) {
                    *wx += w * x;
                    *moved += w * m;
                }
            }
        });
        let over = |sums: &[f32]| sums.iter().map(|s| s / count).collect::<Vec<f32>>();
        let (wx, moved_mean) = (over(&wx), over(&moved));
        let (scales, gains) = (&self.scales[..channels], &self.gains[..channels]);
        let (mean, along) = (&self.projection.mean[..channels], &self.projection.along[..channels]);
        let wx = &wx[..channels];
        let deviations: Vec<f32> = scales.iter().map(|s| s.recip()).collect();
        let deviations = &deviations[..channels];
        for_rows(mu, scratch, |row, mu, u| {
            let planes = pixels(self.unit, row).zip(pixels(self.moved, row)).zip(pixels(self.w, row));
            let both = mu.chunks_exact(channels).zip(u.chunks_exact_mut(channels));
            for ((mu, u), ((x, moved), w)) in both.zip(planes) {
                for c in 0..channels {
                    let z = moved[c] * deviations[c] + mean[c] + x[c] * along[c];
                    u[c] = gains[c] * mu[c] - scales[c] * (w[c] * along[c] + z * wx[c]);
                }
            }
        });
        let Projection { mean, along } = Projection::new(self.unit, scratch);
        let along: Vec<f32> = along.iter().zip(moved_mean).map(|(a, m)| a + m).collect();
        let (mean, along) = (&mean[..channels], &along[..channels]);
        for_rows(mu, scratch, |row, mu, u| {
            let both = mu.chunks_exact_mut(channels).zip(u.chunks_exact(channels));
            for ((mu, u), x) in both.zip(pixels(self.unit, row)) {
                for c in 0..channels {
                    mu[c] = scales[c] * (u[c] - mean[c] - x[c] * along[c]);
                }
            }
        });
        // The gain also scales the tangent: sum of lambda x' with lambda = w / gain.
        let gain = (0..channels).map(|c| gain[c] + moved[c] / self.gains[c]).collect();
        Sums { gain, offset }
    }
}
