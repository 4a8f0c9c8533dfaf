//! What happens to images between convolutions: rows of values, sums, channels, dropout, curved activations.

use super::Activation;
use super::norm::inner_rows;
use super::resample::Resampler;
use crate::learn::convolution::Plane;
use rayon::prelude::*;

/// What a convolution reads, where that is no layer's own image: mapped, or copied into a frame of zeros.
pub(super) fn fill_frames(map: Option<&Resampler>, from: &[Plane], to: &mut [Plane]) {
    for (from, to) in from.iter().zip(to) {
        match map {
            Some(map) => map.forward(from, to),
            None => add_part(from, 0, to, false),
        }
    }
}

/// Images as rows of values.
pub(super) fn flat(planes: &[Plane]) -> Plane {
    let length = planes[0].rows() * planes[0].cols() * planes[0].channels();
    let mut values = Vec::with_capacity(planes.len() * length);
    for plane in planes {
        (0..plane.rows()).for_each(|row| values.extend_from_slice(plane.row(row)));
    }
    Plane::from_values(planes.len(), 1, length, values)
}

/// Rows of values as images, in place of what is there or added to it.
pub(super) fn unflatten(from: &Plane, to: &mut [Plane], add: bool) {
    for (image, to) in to.iter_mut().enumerate() {
        let (values, length) = (from.row(image), to.cols() * to.channels());
        for (row, values) in values.chunks_exact(length).enumerate() {
            for (to, value) in to.row_mut(row).iter_mut().zip(values) {
                *to = if add { *to + value } else { *value };
            }
        }
    }
}

pub(super) fn add_two(a: &[Plane], b: &[Plane], to: &mut [Plane]) {
    for ((a, b), to) in a.iter().zip(b).zip(to) {
        inner_rows(to).enumerate().for_each(|(row, to)| {
            for ((to, a), b) in to.iter_mut().zip(a.row(row)).zip(b.row(row)) {
                *to = a + b;
            }
        });
    }
}

pub(super) fn join(a: &[Plane], b: &[Plane], to: &mut [Plane]) {
    for ((a, b), to) in a.iter().zip(b).zip(to) {
        let (first, channels) = (a.channels(), to.channels());
        inner_rows(to).enumerate().for_each(|(row, to)| {
            let both = a.row(row).chunks_exact(first).zip(b.row(row).chunks_exact(channels - first));
            for (to, (a, b)) in to.chunks_exact_mut(channels).zip(both) {
                to[..first].copy_from_slice(a);
                to[first..].copy_from_slice(b);
            }
        });
    }
}

/// The channels of `from` from `at` on, in place of `to` or added to it.
pub(super) fn part(from: &[Plane], at: usize, to: &mut [Plane], add: bool) {
    from.iter().zip(to).for_each(|(from, to)| add_part(from, at, to, add));
}

pub(super) fn add_part(from: &Plane, at: usize, to: &mut Plane, add: bool) {
    let (channels, wide) = (to.channels(), from.channels());
    inner_rows(to).enumerate().for_each(|(row, to)| {
        for (to, from) in to.chunks_exact_mut(channels).zip(from.row(row).chunks_exact(wide)) {
            for (to, from) in to.iter_mut().zip(&from[at..]) {
                *to = if add { *to + from } else { *from };
            }
        }
    });
}

/// Values times the factors of a dropout; all of them where nothing was drawn.
pub(super) fn drop_some(from: &[Plane], kept: &[Vec<f32>], to: &mut [Plane], add: bool) {
    for (image, (from, to)) in from.iter().zip(to).enumerate() {
        let length = from.cols() * from.channels();
        let factors = kept.get(image);
        inner_rows(to).enumerate().for_each(|(row, to)| {
            for (i, (to, from)) in to.iter_mut().zip(from.row(row)).enumerate() {
                let value = factors.map_or(*from, |factors| factors[row * length + i] * from);
                *to = if add { *to + value } else { value };
            }
        });
    }
}

/// A curved activation, in place.
pub(super) fn bend(activation: Activation, planes: &mut [Plane]) {
    if activation.is_curved() {
        for plane in planes {
            inner_rows(plane).for_each(|row| row.iter_mut().for_each(|v| *v = activation.curved(*v)));
        }
    }
}

/// Gradients, or tangents, of an activation's output times its derivative.
pub(super) fn damp(activation: Activation, values: &[Plane], grads: &mut [Plane]) {
    for (value, grad) in values.iter().zip(grads) {
        inner_rows(grad).enumerate().for_each(|(row, grad)| {
            grad.iter_mut().zip(value.row(row)).for_each(|(g, y)| *g *= activation.slope(*y));
        });
    }
}

pub(super) fn bend_tangent(activation: Activation, values: &[Plane], moved: &[Plane], to: &mut [Plane]) {
    for ((value, moved), to) in values.iter().zip(moved).zip(to) {
        inner_rows(to).enumerate().for_each(|(row, to)| {
            for ((to, m), y) in to.iter_mut().zip(moved.row(row)).zip(value.row(row)) {
                *to = m * activation.slope(*y);
            }
        });
    }
}

pub(super) fn add(sum: &mut [f32], more: &[f32]) {
    sum.iter_mut().zip(more).for_each(|(s, m)| *s += m);
}
