//! Linear maps along rows and columns of images: resampling to another size and frames around an image, with their adjoints.
//!
//! An [`Axis`] holds what one side needs: for every output the inputs that it is a weighted sum of. Two of them make an image,
//! and their transposes are the way back, exact for any factor.

use super::norm::inner_rows;
use crate::learn::convolution::Plane;
use rayon::prelude::*;

/// What stands around an image before a convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Padding {
    /// Nothing: the output is smaller.
    Valid,
    /// Zeros, so many cells on each side.
    Zero(usize),
    /// The image mirrored in its outer cells.
    Reflect(usize),
    /// The outer cells repeated.
    Repeat(usize),
}

/// How an image comes to another size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Resampling {
    /// The input cell in which the output cell's north-west corner lies.
    Nearest,
    /// Linear between the two nearest centres, the outer ones repeated (PyTorch's `align_corners=False`).
    Bilinear,
    /// The mean of the input over the output cell.
    Mean,
}

/// A linear map along one side: (output, inputs with weights).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    inputs: usize,
    sums: Vec<Vec<(usize, f32)>>,
}

impl Axis {
    /// From `inputs` cells to `outputs` on the same ground.
    pub(super) fn resampling(how: Resampling, inputs: usize, outputs: usize) -> Self {
        let cell = inputs as f64 / outputs as f64;
        let sum = |i: usize| match how {
            Resampling::Nearest => vec![(i * inputs / outputs, 1.0)],
            Resampling::Bilinear => {
                let at = ((i as f64 + 0.5) * cell - 0.5).max(0.0);
                let (low, share) = (at as usize, (at - at.floor()) as f32);
                let last = inputs - 1;
                merged(vec![(low.min(last), 1.0 - share), ((low + 1).min(last), share)])
            }
            Resampling::Mean => {
                let (from, to) = (i as f64 * cell, (i + 1) as f64 * cell);
                let covered = |k: usize| (to.min((k + 1) as f64) - from.max(k as f64)) / cell;
                let cells = (from.floor() as usize..to.ceil() as usize).filter(|&k| k < inputs);
                cells.map(|k| (k, covered(k) as f32)).filter(|(_, w)| *w > 0.0).collect()
            }
        };
        Self { inputs, sums: (0..outputs).map(sum).collect() }
    }

    /// A frame around `inputs` cells.
    ///
    /// # Panics
    /// When a mirrored frame is as wide as the image.
    pub(super) fn padding(padding: Padding, inputs: usize) -> Self {
        let (width, last) = (padding.width(), inputs as isize - 1);
        assert!(
            !matches!(padding, Padding::Reflect(w) if w >= inputs),
            "a mirrored frame is narrower than {inputs}"
        );
        let sum = |i: usize| {
            let at = i as isize - width as isize;
            let at = match padding {
                Padding::Reflect(_) => last - (last - at.abs()).abs(),
                Padding::Repeat(_) => at.clamp(0, last),
                Padding::Valid | Padding::Zero(_) => at,
            };
            if (0..=last).contains(&at) { vec![(at as usize, 1.0)] } else { Vec::new() }
        };
        Self { inputs, sums: (0..inputs + 2 * width).map(sum).collect() }
    }

    /// The adjoint map.
    pub(super) fn transposed(&self) -> Self {
        let mut sums = vec![Vec::new(); self.inputs];
        for (output, sum) in self.sums.iter().enumerate() {
            for &(input, weight) in sum {
                sums[input].push((output, weight));
            }
        }
        Self { inputs: self.sums.len(), sums }
    }

    pub(super) fn outputs(&self) -> usize {
        self.sums.len()
    }
}

fn merged(mut sum: Vec<(usize, f32)>) -> Vec<(usize, f32)> {
    if sum[0].0 == sum[1].0 {
        sum[0].1 += sum[1].1;
        sum.truncate(1);
    }
    sum
}

impl Padding {
    /// Cells on each side.
    #[must_use]
    pub(crate) const fn width(self) -> usize {
        match self {
            Self::Valid => 0,
            Self::Zero(w) | Self::Reflect(w) | Self::Repeat(w) => w,
        }
    }
}

/// A linear map of images and its adjoint.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Resampler {
    rows: Axis,
    cols: Axis,
    back: (Axis, Axis),
}

impl Resampler {
    pub(super) fn new(rows: Axis, cols: Axis) -> Self {
        let back = (rows.transposed(), cols.transposed());
        Self { rows, cols, back }
    }

    /// (rows, columns) of what comes out.
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.rows.outputs(), self.cols.outputs())
    }

    pub(super) fn forward(&self, from: &Plane, to: &mut Plane) {
        apply(&self.rows, &self.cols, from, to, false);
    }

    /// The adjoint, in place of `to` or added to it.
    pub(super) fn backward(&self, from: &Plane, to: &mut Plane, add: bool) {
        apply(&self.back.0, &self.back.1, from, to, add);
    }
}

fn apply(rows: &Axis, cols: &Axis, from: &Plane, to: &mut Plane, add: bool) {
    assert_eq!((from.rows(), from.cols()), (rows.inputs, cols.inputs), "an image of the map's size");
    assert_eq!((to.rows(), to.cols()), (rows.outputs(), cols.outputs()), "an image of the map's size");
    let channels = from.channels();
    inner_rows(to).enumerate().for_each_init(
        || vec![0.0; from.cols() * channels],
        |line, (row, out)| {
            line.fill(0.0);
            for &(input, weight) in &rows.sums[row] {
                for (sum, value) in line.iter_mut().zip(from.row(input)) {
                    *sum += weight * value;
                }
            }
            for (out, sum) in out.chunks_exact_mut(channels).zip(&cols.sums) {
                if !add {
                    out.fill(0.0);
                }
                for &(input, weight) in sum {
                    for (out, value) in out.iter_mut().zip(&line[input * channels..]) {
                        *out += weight * value;
                    }
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(axis: &Axis) -> Vec<Vec<f32>> {
        let row = |sum: &Vec<(usize, f32)>| {
            let mut row = vec![0.0; axis.inputs];
            sum.iter().for_each(|(i, w)| row[*i] += w);
            row
        };
        axis.sums.iter().map(row).collect()
    }

    #[test]
    fn weights_are_those_of_the_definitions() {
        let resample = |how, inputs, outputs| dense(&Axis::resampling(how, inputs, outputs));
        assert_eq!(resample(Resampling::Nearest, 2, 4), [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]);
        let double = resample(Resampling::Bilinear, 2, 4);
        assert_eq!(double, [[1.0, 0.0], [0.75, 0.25], [0.25, 0.75], [0.0, 1.0]]);
        assert_eq!(resample(Resampling::Mean, 4, 2), [[0.5, 0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 0.5]]);
        for (how, inputs, outputs) in
            [(Resampling::Bilinear, 7, 12), (Resampling::Mean, 11, 3), (Resampling::Nearest, 5, 3)]
        {
            for row in resample(how, inputs, outputs) {
                assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{how:?}: {row:?}");
            }
        }
        let first = |padding| -> Vec<Option<usize>> {
            dense(&Axis::padding(padding, 3)).iter().map(|row| row.iter().position(|w| *w == 1.0)).collect()
        };
        let some = |places: [usize; 7]| places.map(Some).to_vec();
        assert_eq!(first(Padding::Reflect(2)), some([2, 1, 0, 1, 2, 1, 0]));
        assert_eq!(first(Padding::Repeat(2)), some([0, 0, 0, 1, 2, 2, 2]));
        assert_eq!(first(Padding::Zero(1)), [None, Some(0), Some(1), Some(2), None]);
    }

    /// <map x, y> = <x, adjoint y>, and adding adds.
    #[test]
    fn the_way_back_is_the_adjoint() {
        let image = |rows: usize, cols: usize, k: usize| {
            let values = (0..rows * cols * 3).map(|i| ((i * k) % 13) as f32 - 6.0).collect();
            Plane::from_values(rows, cols, 3, values)
        };
        let dot = |a: &Plane, b: &Plane| {
            a.values().iter().zip(b.values()).map(|(a, b)| f64::from(a * b)).sum::<f64>()
        };
        let sizes = |how| Resampler::new(Axis::resampling(how, 5, 8), Axis::resampling(how, 6, 4));
        let frames = |p| Resampler::new(Axis::padding(p, 5), Axis::padding(p, 6));
        for map in [
            sizes(Resampling::Bilinear),
            sizes(Resampling::Mean),
            sizes(Resampling::Nearest),
            frames(Padding::Reflect(2)),
            frames(Padding::Repeat(3)),
            frames(Padding::Zero(1)),
        ] {
            let (rows, cols) = map.shape();
            let (x, y) = (image(5, 6, 5), image(rows, cols, 7));
            let (mut forward, mut back) = (Plane::zeros(rows, cols, 3, 0), Plane::zeros(5, 6, 3, 0));
            map.forward(&x, &mut forward);
            map.backward(&y, &mut back, false);
            let (a, b) = (dot(&forward, &y), dot(&x, &back));
            let scale = (dot(&forward, &forward) * dot(&y, &y)).sqrt();
            assert!(scale > 1.0 && (a - b).abs() < 1e-5 * scale, "{a} {b}");
            map.backward(&y, &mut back, true);
            assert!((dot(&x, &back) - 2.0 * b).abs() < 1e-5 * scale);
        }
    }
}
