//! l_sketch (Eq. 5): ground is lower than the ridges beside it and higher than the valleys.

use super::super::graph::RegionGraph;
use crate::seed::Seed;
use crate::sketch::StrokeKind;
use rand::RngExt;
use rayon::prelude::*;

/// Heights are divided by this before the softmax.
const TEMPERATURE: f64 = 0.05;
/// The Gumbel noise is multiplied by this: unit noise on heights in [0, 1] cannot reach the paper's values.
const NOISE: f64 = 0.3;
/// Number of partial sums, whatever the number of threads.
const CHUNKS: usize = 16;

/// Mean cross-entropy, over the fixed edges of positive length, between the Gumbel-softmax of (pixel, projection) heights
/// and the side that should be higher. Adds `weight` times its gradient.
///
/// Of two classes only the difference of the logits counts, and the difference of two Gumbel variables is logistic.
pub fn sketch_order(y: &[f64], graph: &RegionGraph, seed: Seed, weight: f64, gradient: &mut [f64]) -> f64 {
    let k = graph.k();
    let chunk = y.len().div_ceil(CHUNKS);
    let count = graph.distances().iter().filter(|d| **d > 0.0).count().max(1) as f64;
    let partials: Vec<(f64, Vec<f64>)> = (0..y.len().div_ceil(chunk))
        .into_par_iter()
        .map(|c| {
            let mut stream = seed.derive_indexed("sketch order", c).stream("logistic noise");
            let mut gradient = vec![0.0; y.len()];
            let mut sum = 0.0;
            for edge in c * chunk * k..y.len().min((c + 1) * chunk) * k {
                if graph.distances()[edge] == 0.0 {
                    continue;
                }
                let (pixel, line) = (edge / k, graph.projected_pixel(edge));
                let uniform: f64 = stream.random_range(1e-9..1.0 - 1e-9);
                let noise = NOISE * (uniform / (1.0 - uniform)).ln();
                let sign = match graph.regions()[graph.nearest()[edge] as usize].kind() {
                    StrokeKind::Ridge => 1.0,
                    StrokeKind::Valley => -1.0,
                };
                // The logit of the wrong side being higher.
                let logit = sign * (y[pixel] - y[line]) / TEMPERATURE + noise;
                sum += if logit > 0.0 { logit + (-logit).exp().ln_1p() } else { logit.exp().ln_1p() };
                let g = weight * sign / (1.0 + (-logit).exp()) / TEMPERATURE / count;
                gradient[pixel] += g;
                gradient[line] -= g;
            }
            (sum, gradient)
        })
        .collect();
    let mut total = 0.0;
    for (sum, partial) in &partials {
        total += sum;
        for (g, p) in gradient.iter_mut().zip(partial) {
            *g += p;
        }
    }
    total / count
}

#[cfg(test)]
mod tests {
    use super::super::{bumpy, gradient_error};
    use super::*;
    use crate::grid::Cell;
    use crate::sketch::{LineMap, SketchPart};
    use crate::systems::region_gnn::RegionGnnConfig;

    fn graph() -> RegionGraph {
        let mut lines = LineMap::empty(12, 14);
        let mut parts = Vec::new();
        for (row, kind) in [(2, StrokeKind::Ridge), (9, StrokeKind::Valley)] {
            let cells: Vec<Cell> = (3..10).map(|col| Cell::new(row, col)).collect();
            let heights = vec![if row == 2 { 0.9 } else { 0.1 }; cells.len()];
            cells.iter().zip(&heights).for_each(|(&c, &z)| lines.set(c, kind, z));
            parts.push(SketchPart { kind, cells, heights });
        }
        RegionGraph::new(&lines, &parts, None, &RegionGnnConfig::paper()).unwrap()
    }

    #[test]
    fn gradient_equals_finite_differences() {
        let (y, graph) = (bumpy(12, 14, 0.4), graph());
        let error =
            gradient_error(&y, 1e-5, |y, g| sketch_order(y, &graph, Seed(4), 1.0, g), (0..y.len()).step_by(3));
        assert!(error < 1e-6, "{error}");
    }

    #[test]
    fn a_roof_costs_less_than_a_trough() {
        let graph = graph();
        let roof: Vec<f64> = (0..12 * 14).map(|i| 1.0 - (i as f64 / 14.0 - 2.0).abs() / 10.0).collect();
        let trough: Vec<f64> = roof.iter().map(|z| 1.0 - z).collect();
        let mut g = vec![0.0; roof.len()];
        let cost = |y: &[f64], g: &mut [f64]| sketch_order(y, &graph, Seed(4), 1.0, g);
        assert!(cost(&roof, &mut g) < 0.5 * cost(&trough, &mut g));
    }
}
