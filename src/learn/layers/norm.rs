//! Normalisation of images: forward, backward, and the derivative of the pair of value and tangent that a gradient penalty needs.
//!
//! Batch normalisation (Ioffe & Szegedy 2015) takes the moments of a channel over all images, instance normalisation (Ulyanov,
//! Vedaldi & Lempitsky 2016) over one, layer normalisation (Ba, Kiros & Hinton 2016) those of one image over all channels.
//! With n pixels, unit x = s (z - mean z), s = (var z + 1e-5)^-1/2, and the projection P(u) = u - mean u - x mean(x u), a
//! tangent goes forward as x' = s P(z') and a gradient goes back as s P(w). Sums run in the order of rows, in pieces that do
//! not depend on the number of threads.

use crate::learn::convolution::Plane;
use rayon::prelude::*;

const EPSILON: f32 = 1e-5;
/// Share of a new batch in the running moments (PyTorch's default).
const MOMENTUM: f32 = 0.1;
/// Rows of one piece of a sum.
const ROWS: usize = 8;

/// What shares its mean and variance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Norm {
    /// A channel of all images of a pass.
    Batch,
    /// A channel of one image.
    Instance,
    /// One image with all of its channels.
    Layer,
}

impl Norm {
    /// The images that share moments, of `count`.
    pub(super) fn sets(self, count: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        let size = if self == Self::Batch { count } else { 1 };
        (0..count / size).map(move |set| set * size..(set + 1) * size)
    }

    /// Means by channel as this kind takes them.
    fn pooled(self, mut means: Vec<f32>) -> Vec<f32> {
        if self == Self::Layer {
            let mean = means.iter().sum::<f32>() / means.len() as f32;
            means.fill(mean);
        }
        means
    }
}

/// Mean and variance of every channel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    /// Means.
    pub(crate) mean: Vec<f32>,
    /// Variances.
    pub(crate) variance: Vec<f32>,
}

impl Moments {
    /// Mean 0, variance 1.
    #[must_use]
    pub(crate) fn unit(channels: usize) -> Self {
        Self { mean: vec![0.0; channels], variance: vec![1.0; channels] }
    }

    /// Reciprocal deviations.
    #[must_use]
    pub(crate) fn scales(&self) -> Vec<f32> {
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

/// Sum of every channel over the pixels inside the frames of images.
pub(super) fn channel_sums(planes: &[Plane]) -> Vec<f32> {
    let channels = planes[0].channels();
    let [sums] = over(planes.len(), |i| {
        sums(planes[i].rows(), channels, |row, [sum]| {
            for pixel in pixels(&planes[i], row) {
                for (s, v) in sum.iter_mut().zip(pixel) {
                    *s += v;
                }
            }
        })
    });
    sums
}

/// Sums of `u`, and of `u` times `unit`, by channel.
fn sums_along(unit: &[Plane], u: &[Plane]) -> [Vec<f32>; 2] {
    let channels = unit[0].channels();
    over(unit.len(), |i| {
        sums(unit[i].rows(), channels, |row, [sum, product]| {
            for (x, u) in pixels(&unit[i], row).zip(pixels(&u[i], row)) {
                for (((s, p), u), x) in sum.iter_mut().zip(product.iter_mut()).zip(u).zip(x) {
                    *s += u;
                    *p += u * x;
                }
            }
        })
    })
}

/// The sums of all images.
fn over<const N: usize>(images: usize, of: impl Fn(usize) -> [Vec<f32>; N]) -> [Vec<f32>; N] {
    let mut total = of(0);
    for i in 1..images {
        for (t, more) in total.iter_mut().flatten().zip(of(i).iter().flatten()) {
            *t += more;
        }
    }
    total
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
pub(super) fn for_rows(a: &mut Plane, b: &mut Plane, change: impl Fn(usize, &mut [f32], &mut [f32]) + Sync) {
    let rows = inner_rows(a).zip(inner_rows(b));
    rows.enumerate().for_each(|(row, (a, b))| change(row, a, b));
}

/// The rows inside a plane's frame.
pub(super) fn inner_rows(plane: &mut Plane) -> impl IndexedParallelIterator<Item = &mut [f32]> {
    let (border, channels) = (plane.border(), plane.channels());
    let (rows, length) = (plane.rows(), plane.cols() * channels);
    let stride = plane.stored().1 * channels;
    let inside = &mut plane.values_mut()[border * stride..(border + rows) * stride];
    inside.par_chunks_mut(stride).map(move |row| &mut row[border * channels..border * channels + length])
}

/// Gains and offsets of a normalised layer, and the leak of its activation.
#[derive(Clone, Copy)]
pub(super) struct Affine<'a> {
    pub(super) gains: &'a [f32],
    pub(super) offsets: &'a [f32],
    pub(super) leak: f32,
}

/// Pixels of images of one size.
fn pixel_count(planes: &[Plane]) -> f32 {
    (planes.len() * planes[0].rows() * planes[0].cols()) as f32
}

/// Takes away the mean and divides by the deviation, in place, in images that share them; `out` is the leaky ReLU of gain x unit
/// + offset. Gives what was taken away.
pub(super) fn normalise(norm: Norm, z: &mut [Plane], affine: Affine<'_>, out: &mut [Plane]) -> Moments {
    let channels = z[0].channels();
    let count = pixel_count(z);
    let mean = norm.pooled(channel_sums(z).iter().map(|s| s / count).collect());
    let [squares] = over(z.len(), |i| {
        sums(z[i].rows(), channels, |row, [sum]| {
            for z in pixels(&z[i], row) {
                for ((s, z), m) in sum.iter_mut().zip(z).zip(&mean) {
                    *s += (z - m) * (z - m);
                }
            }
        })
    });
    let variance = norm.pooled(squares.iter().map(|s| s / count).collect());
    let moments = Moments { mean, variance };
    let scales = moments.scales();
    let (mean, scales) = (&moments.mean[..channels], &scales[..channels]);
    let Affine { gains, offsets, leak } = affine;
    let (gains, offsets) = (&gains[..channels], &offsets[..channels]);
    for (z, out) in z.iter_mut().zip(out) {
        for_rows(z, out, |_, z, out| {
            for (z, out) in z.chunks_exact_mut(channels).zip(out.chunks_exact_mut(channels)) {
                let unit = z.iter_mut().zip(mean).zip(scales);
                for (((z, m), s), (out, (g, b))) in unit.zip(out.iter_mut().zip(gains.iter().zip(offsets))) {
                    *z = (*z - m) * s;
                    // The leak is at most 1: the larger of the two.
                    let y = g * *z + b;
                    *out = if y > leak * y { y } else { leak * y };
                }
            }
        });
    }
    moments
}

/// Normalised images that share their moments.
#[derive(Clone, Copy)]
pub(super) struct Unit<'a> {
    pub(super) norm: Norm,
    pub(super) values: &'a [Plane],
    /// Reciprocal deviations by channel.
    pub(super) scales: &'a [f32],
    pub(super) gains: &'a [f32],
}

impl Unit<'_> {
    /// `delta` holds the gradient of gain x unit + offset and becomes that of the values before the normalisation;
    /// `unit_delta` becomes that of the unit values.
    pub(super) fn backward(&self, delta: &mut [Plane], unit_delta: &mut [Plane]) -> Sums {
        let channels = self.gains.len();
        let count = pixel_count(self.values);
        let [offset, gain] = sums_along(self.values, delta);
        let times_gain = |sums: &[f32]| {
            self.norm.pooled(sums.iter().zip(self.gains).map(|(s, g)| g * s / count).collect())
        };
        let (mean, along) = (times_gain(&offset), times_gain(&gain));
        let (mean, along) = (&mean[..channels], &along[..channels]);
        let (scales, gains) = (&self.scales[..channels], &self.gains[..channels]);
        for ((delta, w), unit) in delta.iter_mut().zip(unit_delta).zip(self.values) {
            for_rows(delta, w, |row, delta, w| {
                let both = delta.chunks_exact_mut(channels).zip(w.chunks_exact_mut(channels));
                for ((d, w), x) in both.zip(pixels(unit, row)) {
                    for c in 0..channels {
                        w[c] = gains[c] * d[c];
                        d[c] = scales[c] * (w[c] - mean[c] - x[c] * along[c]);
                    }
                }
            });
        }
        Sums { gain, offset }
    }

    /// The means of P(u).
    fn project(&self, u: &[Plane]) -> Projection {
        let count = pixel_count(self.values);
        let [mean, along] =
            sums_along(self.values, u).map(|sums| self.norm.pooled(sums.iter().map(|s| s / count).collect()));
        Projection { mean, along }
    }

    /// A tangent through the normalisation, in place: z' -> x' = s P(z'). `out` is the tangent of the activation: gain x',
    /// times the leak where `active`, the activation, is not positive. Gives the projection's means.
    pub(super) fn tangent(
        &self,
        leak: f32,
        active: &[Plane],
        z: &mut [Plane],
        out: &mut [Plane],
    ) -> Projection {
        let project = self.project(z);
        let channels = self.gains.len();
        let (mean, along) = (&project.mean[..channels], &project.along[..channels]);
        let (scales, gains) = (&self.scales[..channels], &self.gains[..channels]);
        for (((z, out), unit), active) in z.iter_mut().zip(out).zip(self.values).zip(active) {
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
        }
        project
    }

    /// `mu` holds the gradient of gain x unit + offset through the layers above, and becomes that of the values before the
    /// normalisation, with what the tangent of this layer says about them added. `moved` is x', `projection` that of the
    /// tangent, `w` the gradient of the tangent's unit values. Gives the gradients of gains and offsets.
    ///
    /// With m = mean(x z'): u = gain mu - s (w m + z' mean(w x)), and the answer is s (P(u) - x mean(w x')).
    pub(super) fn value_side(
        &self,
        moved: &[Plane],
        projection: &Projection,
        w: &[Plane],
        mu: &mut [Plane],
        scratch: &mut [Plane],
    ) -> Sums {
        let channels = self.gains.len();
        let count = pixel_count(self.values);
        let [offset, gain] = sums_along(self.values, mu);
        let [wx, products] = over(self.values.len(), |i| {
            sums(self.values[i].rows(), channels, |row, [wx, products]| {
                let values = pixels(&self.values[i], row).zip(pixels(&moved[i], row));
                for (w, (x, m)) in pixels(&w[i], row).zip(values) {
                    let sums = wx.iter_mut().zip(products.iter_mut());
                    for ((((wx, moved), w), x), m) in sums.zip(w).zip(x).zip(m) {
                        *wx += w * x;
                        *moved += w * m;
                    }
                }
            })
        });
        let mean = |sums: &[f32]| self.norm.pooled(sums.iter().map(|s| s / count).collect());
        let (wx, products_mean) = (mean(&wx), mean(&products));
        let (scales, gains) = (&self.scales[..channels], &self.gains[..channels]);
        let (mean, along) = (&projection.mean[..channels], &projection.along[..channels]);
        let wx = &wx[..channels];
        let deviations: Vec<f32> = scales.iter().map(|s| s.recip()).collect();
        let deviations = &deviations[..channels];
        for (i, (mu, u)) in mu.iter_mut().zip(scratch.iter_mut()).enumerate() {
            for_rows(mu, u, |row, mu, u| {
                let planes = pixels(&self.values[i], row).zip(pixels(&moved[i], row)).zip(pixels(&w[i], row));
                let both = mu.chunks_exact(channels).zip(u.chunks_exact_mut(channels));
                for ((mu, u), ((x, moved), w)) in both.zip(planes) {
                    for c in 0..channels {
                        let z = moved[c] * deviations[c] + mean[c] + x[c] * along[c];
                        u[c] = gains[c] * mu[c] - scales[c] * (w[c] * along[c] + z * wx[c]);
                    }
                }
            });
        }
        let Projection { mean, along } = self.project(scratch);
        let along: Vec<f32> = along.iter().zip(products_mean).map(|(a, m)| a + m).collect();
        let (mean, along) = (&mean[..channels], &along[..channels]);
        for ((mu, u), unit) in mu.iter_mut().zip(scratch.iter_mut()).zip(self.values) {
            for_rows(mu, u, |row, mu, u| {
                let both = mu.chunks_exact_mut(channels).zip(u.chunks_exact(channels));
                for ((mu, u), x) in both.zip(pixels(unit, row)) {
                    for c in 0..channels {
                        mu[c] = scales[c] * (u[c] - mean[c] - x[c] * along[c]);
                    }
                }
            });
        }
        // The gain also scales the tangent: sum of lambda x' with lambda = w / gain.
        let gain = (0..channels).map(|c| gain[c] + products[c] / self.gains[c]).collect();
        Sums { gain, offset }
    }
}

/// The means of P(u) = u - mean u - x mean(x u), by channel.
pub(super) struct Projection {
    /// mean u
    mean: Vec<f32>,
    /// mean(x u)
    along: Vec<f32>,
}
