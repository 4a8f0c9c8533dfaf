//! How far vectors of two kinds lie apart, and their places in two dimensions.

use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;

/// Nearest states that are looked at.
const NEAREST: usize = 10;
/// Steps of the t-SNE, and of its beginning with stronger attraction (van der Maaten & Hinton 2008: 1000, 50).
const STEPS: usize = 500;
const EARLY: usize = 100;
/// Effective number of neighbours (there: 5 to 50).
const PERPLEXITY: f64 = 20.0;

/// How far labelled vectors lie apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Separation {
    /// Share of the ten nearest vectors that have a vector's own label, mean over all.
    pub(crate) purity: f64,
    /// What chance gives.
    pub(crate) chance: f64,
    /// Silhouette (Rousseeuw 1987), mean over all.
    pub(crate) silhouette: f64,
}

/// A vector with its label.
pub(crate) type Labelled<L> = (L, Vec<f32>);

/// (n x n) squared distances.
fn squared_distances<L>(states: &[Labelled<L>]) -> Vec<Vec<f64>> {
    let square = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    states.iter().map(|(_, a)| states.iter().map(|(_, b)| square(a, b)).collect()).collect()
}

/// How far vectors of two labels lie apart.
#[must_use]
pub(crate) fn separation<L: PartialEq>(states: &[Labelled<L>]) -> Separation {
    let n = states.len();
    let distances = squared_distances(states);
    let (mut pure, mut chance, mut silhouette) = (0.0, 0.0, 0.0);
    for (i, (kind, _)) in states.iter().enumerate() {
        let mut others: Vec<usize> = (0..n).filter(|&j| j != i).collect();
        others.sort_by(|&a, &b| distances[i][a].total_cmp(&distances[i][b]).then(a.cmp(&b)));
        let near = &others[..NEAREST.min(others.len())];
        pure += near.iter().filter(|&&j| states[j].0 == *kind).count() as f64 / near.len().max(1) as f64;
        let own = states.iter().filter(|(other, _)| other == kind).count();
        chance += (own - 1) as f64 / (n - 1).max(1) as f64;
        let mean = |same: bool| {
            let of: Vec<f64> = others
                .iter()
                .filter(|&&j| (states[j].0 == *kind) == same)
                .map(|&j| distances[i][j].sqrt())
                .collect();
            if of.is_empty() { 0.0 } else { of.iter().sum::<f64>() / of.len() as f64 }
        };
        let (within, beyond) = (mean(true), mean(false));
        // A state alone in its kind has silhouette 0.
        if own > 1 && within.max(beyond) > 0.0 {
            silhouette += (beyond - within) / within.max(beyond);
        }
    }
    let count = n as f64;
    Separation { purity: pure / count, chance: chance / count, silhouette: silhouette / count }
}

/// t-SNE in two dimensions, exact: all pairs, no tree. The same bytes for the same states and seed.
#[must_use]
pub(crate) fn tsne<L>(states: &[Labelled<L>], seed: Seed) -> Vec<(f64, f64)> {
    let n = states.len();
    if n < 3 {
        return (0..n).map(|i| (i as f64, 0.0)).collect();
    }
    let p = affinities(&squared_distances(states));
    let mut stream = seed.stream("t-SNE");
    let mut draw = || 1e-2 * stream.sample::<f64, _>(StandardNormal);
    let mut y: Vec<[f64; 2]> = (0..n).map(|_| [draw(), draw()]).collect();
    let mut speed = vec![[0.0f64; 2]; n];
    let mut gain = vec![[1.0f64; 2]; n];
    let rate = (n as f64 / 12.0).max(50.0);
    for step in 0..STEPS {
        let (attraction, momentum) = if step < EARLY { (12.0, 0.5) } else { (1.0, 0.8) };
        let mut total = 0.0;
        let q: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let weight = |j: usize| {
                    let square = (y[i][0] - y[j][0]).powi(2) + (y[i][1] - y[j][1]).powi(2);
                    if i == j { 0.0 } else { 1.0 / (1.0 + square) }
                };
                (0..n).map(weight).collect::<Vec<f64>>()
            })
            .inspect(|row| total += row.iter().sum::<f64>())
            .collect();
        let gradient: Vec<[f64; 2]> = (0..n)
            .map(|i| {
                let mut sum = [0.0; 2];
                for j in 0..n {
                    let pull = 4.0 * (attraction * p[i][j] - q[i][j] / total) * q[i][j];
                    sum[0] += pull * (y[i][0] - y[j][0]);
                    sum[1] += pull * (y[i][1] - y[j][1]);
                }
                sum
            })
            .collect();
        for i in 0..n {
            for d in 0..2 {
                let against = gradient[i][d] * speed[i][d] <= 0.0;
                gain[i][d] = if against { gain[i][d] + 0.2 } else { (gain[i][d] * 0.8f64).max(0.01) };
                speed[i][d] = momentum * speed[i][d] - rate * gain[i][d] * gradient[i][d];
                y[i][d] += speed[i][d];
            }
        }
    }
    y.into_iter().map(|[a, b]| (a, b)).collect()
}

/// Symmetric affinities whose rows have the wanted perplexity.
fn affinities(distances: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = distances.len();
    let wanted = PERPLEXITY.min((n - 1) as f64 / 3.0).max(1.5).ln();
    let row = |i: usize| {
        let nearest = (0..n).filter(|&j| j != i).map(|j| distances[i][j]).fold(f64::INFINITY, f64::min);
        let of = |beta: f64| -> (Vec<f64>, f64) {
            // Shifted by the nearest, which changes nothing but keeps the sum above 0.
            let weight = |j: usize| if j == i { 0.0 } else { (-beta * (distances[i][j] - nearest)).exp() };
            let weights: Vec<f64> = (0..n).map(weight).collect();
            let sum: f64 = weights.iter().sum();
            let p: Vec<f64> = weights.iter().map(|w| w / sum).collect();
            let entropy = -p.iter().filter(|p| **p > 0.0).map(|p| p * p.ln()).sum::<f64>();
            (p, entropy)
        };
        let (mut low, mut high, mut beta) = (0.0, f64::INFINITY, 1.0);
        for _ in 0..60 {
            if of(beta).1 > wanted {
                low = beta;
                beta = if high.is_finite() { (low + high) / 2.0 } else { beta * 2.0 };
            } else {
                high = beta;
                beta = (low + high) / 2.0;
            }
        }
        of(beta).0
    };
    let p: Vec<Vec<f64>> = (0..n).map(row).collect();
    let pair = |i: usize, j: usize| ((p[i][j] + p[j][i]) / (2 * n) as f64).max(1e-12);
    (0..n).map(|i| (0..n).map(|j| pair(i, j)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two clouds `apart` from each other.
    fn clouds(apart: f32) -> Vec<Labelled<bool>> {
        let mut stream = Seed(5).stream("clouds");
        (0..60)
            .map(|i| {
                let kind = i % 3 == 0;
                let shift = if i % 3 == 0 { apart } else { 0.0 };
                (kind, (0..8).map(|_| shift + stream.sample::<f32, _>(StandardNormal)).collect())
            })
            .collect()
    }

    #[test]
    fn clouds_apart_are_pure_and_mixed_ones_are_chance() {
        let Separation { purity, chance, silhouette } = separation(&clouds(10.0));
        assert_eq!(purity, 1.0);
        // (40 x 39 + 20 x 19) / (60 x 59)
        assert!((chance - 1940.0 / 3540.0).abs() < 1e-12);
        assert!(silhouette > 0.8, "{silhouette}");
        let Separation { purity: pure, chance, silhouette } = separation(&clouds(0.0));
        assert!((pure - chance).abs() < 0.1 && silhouette.abs() < 0.05, "{pure} {chance} {silhouette}");
    }

    #[test]
    fn the_embedding_keeps_clouds_apart() {
        let states = clouds(10.0);
        let points = tsne(&states, Seed(1));
        assert_eq!(points, tsne(&states, Seed(1)));
        let flat: Vec<Labelled<bool>> =
            states.iter().zip(&points).map(|((k, _), (x, y))| (*k, vec![*x as f32, *y as f32])).collect();
        assert!(separation(&flat).purity > 0.99);
        assert!(points.iter().all(|(x, y)| x.is_finite() && y.is_finite()));
    }
}
