//! Dense algebra on a few hundred rows: regions, embeddings, the three first states; compiled for every instruction set.

use crate::machine;

const NORM_EPSILON: f32 = 1e-5;

/// `out += x W`. `x`: (rows, inner); `weights`: (inner, width); `out`: (rows, width).
pub(super) fn add_product(x: &[f32], weights: &[f32], width: usize, out: &mut [f32]) {
    let inner = weights.len() / width;
    machine::arch().dispatch(
        #[inline(always)]
        || {
            for (x, out) in x.chunks_exact(inner).zip(out.chunks_exact_mut(width)) {
                for (x, w) in x.iter().zip(weights.chunks_exact(width)) {
                    add_row(out, w, *x);
                }
            }
        },
    );
}

/// `out += x^T d`. `x`: (rows, inner); `d`: (rows, width); `out`: (inner, width).
pub(super) fn add_outer(x: &[f32], d: &[f32], width: usize, out: &mut [f32]) {
    let inner = out.len() / width;
    machine::arch().dispatch(
        #[inline(always)]
        || {
            for (x, d) in x.chunks_exact(inner).zip(d.chunks_exact(width)) {
                for (x, out) in x.iter().zip(out.chunks_exact_mut(width)) {
                    add_row(out, d, *x);
                }
            }
        },
    );
}

/// `out += x * factor`
pub(super) fn add_scaled(out: &mut [f32], x: &[f32], factor: f32) {
    machine::arch().dispatch(
        #[inline(always)]
        || add_row(out, x, factor),
    );
}

#[inline(always)]
fn add_row(out: &mut [f32], x: &[f32], factor: f32) {
    for (o, v) in out.iter_mut().zip(x) {
        *o += v * factor;
    }
}

/// `out += x`
pub(super) fn add(out: &mut [f32], x: &[f32]) {
    add_scaled(out, x, 1.0);
}

/// Sum of the rows: `out += 1^T x`.
pub(super) fn add_rows(x: &[f32], out: &mut [f32]) {
    for row in x.chunks_exact(out.len()) {
        add(out, row);
    }
}

pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// (rows, columns) -> (columns, rows)
pub(super) fn transposed(x: &[f32], columns: usize) -> Vec<f32> {
    let rows = x.len() / columns;
    (0..x.len()).map(|i| x[i % rows * columns + i / rows]).collect()
}

/// Layer normalisation of every row, in place.
pub(super) fn normalize(x: &mut [f32], gain: &[f32], offset: &[f32]) {
    for row in x.chunks_exact_mut(gain.len()) {
        let (mean, scale) = moments(row);
        for ((v, g), b) in row.iter_mut().zip(gain).zip(offset) {
            *v = (*v - mean) * scale * g + b;
        }
    }
}

/// Gradient by the rows that [`normalize`] took, in place of `d`, the gradient by what it gave; adds those of gain and
/// offset.
pub(super) fn normalize_gradient(
    x: &[f32],
    gain: &[f32],
    d: &mut [f32],
    d_gain: &mut [f32],
    d_offset: &mut [f32],
) {
    let width = gain.len();
    for (row, d) in x.chunks_exact(width).zip(d.chunks_exact_mut(width)) {
        let (mean, scale) = moments(row);
        let (mut sum, mut along) = (0.0, 0.0);
        for i in 0..width {
            let unit = (row[i] - mean) * scale;
            d_gain[i] += d[i] * unit;
            d_offset[i] += d[i];
            sum += d[i] * gain[i];
            along += d[i] * gain[i] * unit;
        }
        let (sum, along) = (sum / width as f32, along / width as f32);
        for i in 0..width {
            d[i] = scale * (d[i] * gain[i] - sum - (row[i] - mean) * scale * along);
        }
    }
}

/// Mean and reciprocal deviation of a row.
fn moments(row: &[f32]) -> (f32, f32) {
    let n = row.len() as f32;
    let mean = row.iter().sum::<f32>() / n;
    let variance = row.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / n;
    (mean, (variance + NORM_EPSILON).sqrt().recip())
}
