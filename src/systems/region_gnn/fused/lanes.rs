//! States in vector registers and the few operations on them; everything is inlined into a task of one instruction set.
//!
//! `pulp` picks the instruction set at run time, so no `target-cpu` flag is needed. Loops stand where an iterator with a
//! closure would be shorter: a closure handed to the standard library is compiled for the baseline processor, and every
//! vector operation in it becomes a call.

use pulp::Simd;
use pulp::bytemuck::{cast_slice, cast_slice_mut};

/// A hidden state of `N` registers.
pub(super) type State<S, const N: usize> = [<S as Simd>::f32s; N];

/// Calls `$run::<S, N, B>`: N registers hold a state of the width, B states are worked on at once so that a row of
/// weights is loaded once for all and the sums still fit the register file (32 wide registers, else 16). The number of lanes
/// is in every pattern, so that for each instruction set only its own arms are compiled.
macro_rules! with_registers {
    ($simd:ident, $self:ident, $width:expr) => {
        match (S::F32_LANES, $width / S::F32_LANES) {
            (16, 1) => $self.run::<S, 1, 8>($simd),
            (16, 2) => $self.run::<S, 2, 8>($simd),
            (16, 4) => $self.run::<S, 4, 4>($simd),
            (8, 2) => $self.run::<S, 2, 4>($simd),
            (8, 4) => $self.run::<S, 4, 2>($simd),
            (8, 8) => $self.run::<S, 8, 1>($simd),
            (4, 4) => $self.run::<S, 4, 2>($simd),
            (4, 8) => $self.run::<S, 8, 1>($simd),
            (4, 16) => $self.run::<S, 16, 1>($simd),
            (1, 16) => $self.run::<S, 16, 1>($simd),
            (1, 32) => $self.run::<S, 32, 1>($simd),
            (1, 64) => $self.run::<S, 64, 1>($simd),
            (lanes, n) => unreachable!("a width of {n} registers of {lanes} passed validation"),
        }
    };
}
pub(super) use with_registers;

#[inline(always)]
pub(super) fn zero<S: Simd, const N: usize>(simd: S) -> State<S, N> {
    [simd.splat_f32s(0.0); N]
}

/// Row `row` of (rows, H).
#[inline(always)]
pub(super) fn load<S: Simd, const N: usize>(values: &[f32], row: usize) -> State<S, N> {
    let width = N * S::F32_LANES;
    let lanes: &[S::f32s] = cast_slice(&values[row * width..(row + 1) * width]);
    let mut state = [lanes[0]; N];
    state.copy_from_slice(lanes);
    state
}

#[inline(always)]
pub(super) fn store<S: Simd, const N: usize>(values: &mut [f32], row: usize, x: &State<S, N>) {
    let width = N * S::F32_LANES;
    let lanes: &mut [S::f32s] = cast_slice_mut(&mut values[row * width..(row + 1) * width]);
    lanes.copy_from_slice(x);
}

/// `values[row] += x`
#[inline(always)]
pub(super) fn add_to<S: Simd, const N: usize>(simd: S, values: &mut [f32], row: usize, x: &State<S, N>) {
    let width = N * S::F32_LANES;
    let lanes: &mut [S::f32s] = cast_slice_mut(&mut values[row * width..(row + 1) * width]);
    for i in 0..N {
        lanes[i] = simd.add_f32s(lanes[i], x[i]);
    }
}

/// `sum + x`
#[inline(always)]
pub(super) fn add<S: Simd, const N: usize>(simd: S, sum: &State<S, N>, x: &State<S, N>) -> State<S, N> {
    let mut out = *sum;
    for i in 0..N {
        out[i] = simd.add_f32s(sum[i], x[i]);
    }
    out
}

/// `sum + x * factor`
#[inline(always)]
pub(super) fn add_scaled<S: Simd, const N: usize>(
    simd: S,
    sum: &State<S, N>,
    x: &State<S, N>,
    factor: f32,
) -> State<S, N> {
    let factor = simd.splat_f32s(factor);
    let mut out = *sum;
    for i in 0..N {
        out[i] = simd.mul_add_e_f32s(x[i], factor, sum[i]);
    }
    out
}

/// Element by element.
#[inline(always)]
pub(super) fn times<S: Simd, const N: usize>(simd: S, a: &State<S, N>, b: &State<S, N>) -> State<S, N> {
    let mut out = *a;
    for i in 0..N {
        out[i] = simd.mul_f32s(a[i], b[i]);
    }
    out
}

#[inline(always)]
pub(super) fn relu<S: Simd, const N: usize>(simd: S, x: &State<S, N>) -> State<S, N> {
    let nothing = simd.splat_f32s(0.0);
    let mut out = *x;
    for i in 0..N {
        out[i] = simd.max_f32s(x[i], nothing);
    }
    out
}

/// `x` where `gate` is positive, else 0: the gradient of a ReLU whose value is `gate`.
#[inline(always)]
pub(super) fn gated<S: Simd, const N: usize>(simd: S, x: &State<S, N>, gate: &State<S, N>) -> State<S, N> {
    let nothing = simd.splat_f32s(0.0);
    let mut out = *x;
    for i in 0..N {
        out[i] = simd.select_f32s(simd.greater_than_f32s(gate[i], nothing), x[i], nothing);
    }
    out
}

#[inline(always)]
pub(super) fn dot<S: Simd, const N: usize>(simd: S, a: &State<S, N>, b: &State<S, N>) -> f32 {
    let mut sum = simd.mul_f32s(a[0], b[0]);
    for i in 1..N {
        sum = simd.mul_add_e_f32s(a[i], b[i], sum);
    }
    simd.reduce_sum_f32s(sum)
}

#[inline(always)]
pub(super) fn sum<S: Simd, const N: usize>(simd: S, x: &State<S, N>) -> f32 {
    let mut sum = x[0];
    for i in 1..N {
        sum = simd.add_f32s(sum, x[i]);
    }
    simd.reduce_sum_f32s(sum)
}

/// `sums[b] += rows[b] W`. `rows`: B of (inner); `weights`: (inner, H).
#[inline(always)]
pub(super) fn dense<S: Simd, const N: usize, const B: usize>(
    simd: S,
    sums: &mut [State<S, N>; B],
    rows: &[&[f32]; B],
    weights: &[f32],
) {
    let weights: &[S::f32s] = cast_slice(weights);
    let inner = weights.len() / N;
    let mut rows = *rows;
    for row in &mut rows {
        *row = &row[..inner];
    }
    let weights = &weights[..inner * N];
    for k in 0..inner {
        let mut w = [weights[k * N]; N];
        w.copy_from_slice(&weights[k * N..k * N + N]);
        for b in 0..B {
            let x = simd.splat_f32s(rows[b][k]);
            for i in 0..N {
                sums[b][i] = simd.mul_add_e_f32s(x, w[i], sums[b][i]);
            }
        }
    }
}

/// `out[r] = init[r] + x[r] W` for every row; `x`: (rows, inner), `weights`: (inner, H), `out`: (rows, H) holding init.
#[inline(always)]
pub(super) fn dense_rows<S: Simd, const N: usize, const B: usize>(
    simd: S,
    x: &[f32],
    inner: usize,
    weights: &[f32],
    out: &mut [f32],
) {
    let rows = x.len() / inner;
    let mut row = 0;
    while row + B <= rows {
        let mut inputs: [&[f32]; B] = [&[]; B];
        let mut sums = [zero::<S, N>(simd); B];
        for b in 0..B {
            inputs[b] = &x[(row + b) * inner..(row + b + 1) * inner];
            sums[b] = load::<S, N>(out, row + b);
        }
        dense::<S, N, B>(simd, &mut sums, &inputs, weights);
        for b in 0..B {
            store::<S, N>(out, row + b, &sums[b]);
        }
        row += B;
    }
    while row < rows {
        let mut sums = [load::<S, N>(out, row)];
        dense::<S, N, 1>(simd, &mut sums, &[&x[row * inner..(row + 1) * inner]], weights);
        store::<S, N>(out, row, &sums[0]);
        row += 1;
    }
}

/// `sums[b] += columns[.., first + b] W`. `columns`: (inner, stride), `weights`: (inner, H).
#[inline(always)]
pub(super) fn dense_columns<S: Simd, const N: usize, const B: usize>(
    simd: S,
    sums: &mut [State<S, N>; B],
    columns: &[f32],
    stride: usize,
    first: usize,
    weights: &[f32],
) {
    let weights: &[S::f32s] = cast_slice(weights);
    for (x, w) in columns.chunks_exact(stride).zip(weights.chunks_exact(N)) {
        let Some(x) = x[first..].first_chunk::<B>() else { break };
        for b in 0..B {
            let x = simd.splat_f32s(x[b]);
            for i in 0..N {
                sums[b][i] = simd.mul_add_e_f32s(x, w[i], sums[b][i]);
            }
        }
    }
}

/// `out += columns d`. `columns`: (inner, stride) of which the first rows of `d` count; `d`: (rows, H), `out`: (inner, H).
#[inline(always)]
pub(super) fn outer_columns<S: Simd, const N: usize>(
    simd: S,
    columns: &[f32],
    stride: usize,
    d: &[f32],
    out: &mut [f32],
) {
    let inner = columns.len() / stride;
    // As many rows at a time as their sums, factors and a row of `d` fit the registers, as even as can be: a tile of one row would
    // read all of `d` for itself.
    let most = if S::F32_LANES == 16 { if N > 2 { 4 } else { 8 } } else { (12 / N).clamp(1, 3) };
    let tiles = inner.div_ceil(most);
    let mut k = 0;
    for tile in 0..tiles {
        let rows = inner / tiles + usize::from(tile < inner % tiles);
        match rows {
            8 => outer_columns_tile::<S, N, 8>(simd, columns, stride, d, out, k),
            7 => outer_columns_tile::<S, N, 7>(simd, columns, stride, d, out, k),
            6 => outer_columns_tile::<S, N, 6>(simd, columns, stride, d, out, k),
            5 => outer_columns_tile::<S, N, 5>(simd, columns, stride, d, out, k),
            4 => outer_columns_tile::<S, N, 4>(simd, columns, stride, d, out, k),
            3 => outer_columns_tile::<S, N, 3>(simd, columns, stride, d, out, k),
            2 => outer_columns_tile::<S, N, 2>(simd, columns, stride, d, out, k),
            _ => outer_columns_tile::<S, N, 1>(simd, columns, stride, d, out, k),
        }
        k += rows;
    }
}

#[inline(always)]
fn outer_columns_tile<S: Simd, const N: usize, const R: usize>(
    simd: S,
    columns: &[f32],
    stride: usize,
    d: &[f32],
    out: &mut [f32],
    k: usize,
) {
    let d: &[S::f32s] = cast_slice(d);
    let rows = d.len() / N;
    let d = &d[..rows * N];
    let mut x: [&[f32]; R] = [&[]; R];
    let mut sums = [zero::<S, N>(simd); R];
    for r in 0..R {
        x[r] = &columns[(k + r) * stride..][..rows];
        sums[r] = load::<S, N>(out, k + r);
    }
    for (row, d) in d.chunks_exact(N).enumerate().take(rows) {
        let mut factors = [simd.splat_f32s(0.0); R];
        for r in 0..R {
            factors[r] = simd.splat_f32s(x[r][row]);
        }
        for i in 0..N {
            for r in 0..R {
                sums[r][i] = simd.mul_add_e_f32s(factors[r], d[i], sums[r][i]);
            }
        }
    }
    for r in 0..R {
        store::<S, N>(out, k + r, &sums[r]);
    }
}

/// `out += x^T d`. `x`: (rows, inner), `d`: (rows, H), `out`: (inner, H).
#[inline(always)]
pub(super) fn outer<S: Simd, const N: usize, const B: usize>(
    simd: S,
    x: &[f32],
    inner: usize,
    d: &[f32],
    out: &mut [f32],
) {
    let mut k = 0;
    while k + B <= inner {
        outer_tile::<S, N, B>(simd, x, inner, d, out, k);
        k += B;
    }
    while B > 4 && k + 4 <= inner {
        outer_tile::<S, N, 4>(simd, x, inner, d, out, k);
        k += 4;
    }
    while k < inner {
        outer_tile::<S, N, 1>(simd, x, inner, d, out, k);
        k += 1;
    }
}

/// Rows `k..k + R` of [`outer`], in registers throughout.
#[inline(always)]
fn outer_tile<S: Simd, const N: usize, const R: usize>(
    simd: S,
    x: &[f32],
    inner: usize,
    d: &[f32],
    out: &mut [f32],
    k: usize,
) {
    let mut sums = [zero::<S, N>(simd); R];
    for r in 0..R {
        sums[r] = load::<S, N>(out, k + r);
    }
    let d: &[S::f32s] = cast_slice(d);
    for (x, d) in x.chunks_exact(inner).zip(d.chunks_exact(N)) {
        let Some(x) = x[k..].first_chunk::<R>() else { break };
        for r in 0..R {
            let factor = simd.splat_f32s(x[r]);
            for i in 0..N {
                sums[r][i] = simd.mul_add_e_f32s(factor, d[i], sums[r][i]);
            }
        }
    }
    for r in 0..R {
        store::<S, N>(out, k + r, &sums[r]);
    }
}

const NORM_EPSILON: f32 = 1e-5;

/// (x - mean) / sqrt(variance + 1e-5) and the divisor's reciprocal (Ba, Kiros, Hinton 2016).
#[inline(always)]
pub(super) fn unit<S: Simd, const N: usize>(simd: S, x: &State<S, N>) -> (State<S, N>, f32) {
    let width = (N * S::F32_LANES) as f32;
    let mean = simd.splat_f32s(sum(simd, x) / width);
    let mut centred = *x;
    for i in 0..N {
        centred[i] = simd.sub_f32s(x[i], mean);
    }
    let scale = (dot(simd, &centred, &centred) / width + NORM_EPSILON).sqrt().recip();
    (add_scaled(simd, &zero(simd), &centred, scale), scale)
}

/// Gradient by x of what [`unit`] gave, from the gradient by `unit`.
#[inline(always)]
pub(super) fn unit_gradient<S: Simd, const N: usize>(
    simd: S,
    unit: &State<S, N>,
    scale: f32,
    d_unit: &State<S, N>,
) -> State<S, N> {
    let width = (N * S::F32_LANES) as f32;
    let mean = simd.splat_f32s(sum(simd, d_unit) / width);
    let along = simd.splat_f32s(dot(simd, d_unit, unit) / width);
    let scale = simd.splat_f32s(scale);
    let mut out = *d_unit;
    for i in 0..N {
        let centred = simd.sub_f32s(d_unit[i], mean);
        out[i] = simd.mul_f32s(scale, simd.sub_f32s(centred, simd.mul_f32s(unit[i], along)));
    }
    out
}
