//! l_sketch (Eq. 5): ground is lower than the ridges beside it and higher than the valleys.

use super::super::graph::RegionGraph;
use crate::learn::{exp, ln};
use crate::machine;
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
/// and the side that should be higher. Adds `weight` times its gradient. Edges with an end that is not `valid` are left out.
///
/// Of two classes only the difference of the logits counts, and the difference of two Gumbel variables is logistic.
pub(crate) fn sketch_order(
    y: &[f64],
    graph: &RegionGraph,
    valid: &[bool],
    seed: Seed,
    weight: f64,
    gradient: &mut [f64],
) -> f64 {
    let k = graph.k();
    let chunk = y.len().div_ceil(CHUNKS);
    // Known once, so that terrain without voids, which is most, is not asked at every edge.
    let whole = valid.iter().all(|v| *v);
    let counts = |edge: usize| {
        graph.distances()[edge] > 0.0 && (whole || valid[edge / k] && valid[graph.projected_pixel(edge)])
    };
    let signs: Vec<f32> = graph
        .regions()
        .iter()
        .map(|region| if region.kind() == StrokeKind::Ridge { 1.0 } else { -1.0 })
        .collect();
    let count = if whole { graph.long_edges() } else { (0..y.len() * k).filter(|&e| counts(e)).count() };
    let count = count.max(1) as f64;
    let factor = (weight / TEMPERATURE / count) as f32;
    let partials: Vec<(f64, Vec<f32>)> = (0..y.len().div_ceil(chunk))
        .into_par_iter()
        .map(|c| {
            let mut stream = seed.derive_indexed("sketch order", c).stream("logistic noise");
            let mut gradient = vec![0.0; y.len()];
            let mut total = 0.0;
            let mut batch = Batch::default();
            let edges = c * chunk * k..y.len().min((c + 1) * chunk) * k;
            let mut rest = edges.filter(|&edge| counts(edge)).peekable();
            while rest.peek().is_some() {
                batch.len = 0;
                for edge in rest.by_ref().take(BATCH) {
                    let (pixel, line) = (edge / k, graph.projected_pixel(edge));
                    let sign = signs[graph.nearest()[edge] as usize];
                    batch.push(pixel, line, sign, (y[pixel] - y[line]) as f32, stream.random());
                }
                total += batch.evaluate();
                for i in 0..batch.len {
                    let g = factor * batch.signs[i] * batch.wrong[i];
                    gradient[batch.pixels[i] as usize] += g;
                    gradient[batch.lines[i] as usize] -= g;
                }
            }
            (total, gradient)
        })
        .collect();
    let mut total = 0.0;
    for (sum, partial) in &partials {
        total += sum;
        for (g, p) in gradient.iter_mut().zip(partial) {
            *g += f64::from(*p);
        }
    }
    total / count
}

/// Edges whose exponentials and logarithms are taken together.
const BATCH: usize = 64;

/// Some edges, a column a quantity.
struct Batch {
    len: usize,
    pixels: [u32; BATCH],
    lines: [u32; BATCH],
    /// 1 at ridges, -1 at valleys.
    signs: [f32; BATCH],
    /// Pixel above line.
    rises: [f32; BATCH],
    /// Uniform in (0, 1).
    uniforms: [f32; BATCH],
    /// Probability of the wrong side being higher: the gradient by the logit.
    wrong: [f32; BATCH],
}

impl Default for Batch {
    fn default() -> Self {
        let (zeros, ids) = ([0.0; BATCH], [0; BATCH]);
        let uniforms = [0.5; BATCH];
        Self { len: 0, pixels: ids, lines: ids, signs: zeros, rises: zeros, uniforms, wrong: zeros }
    }
}

impl Batch {
    fn push(&mut self, pixel: usize, line: usize, sign: f32, rise: f32, bits: u32) {
        let i = self.len;
        (self.pixels[i], self.lines[i]) = (pixel as u32, line as u32);
        (self.signs[i], self.rises[i]) = (sign, rise);
        // The middles of 2^23 equal parts of the unit interval.
        self.uniforms[i] = ((bits >> 9) as f32 + 0.5) / 8_388_608.0;
        self.len += 1;
    }

    /// Fills `wrong` and returns the sum of the cross-entropies; compiled for every instruction set.
    fn evaluate(&mut self) -> f64 {
        let mut costs = [0.0f32; BATCH];
        machine::arch().dispatch(
            #[inline(always)]
            || {
                #[allow(clippy::needless_range_loop, reason = "five columns of one batch")]
                for i in 0..BATCH {
                    let u = self.uniforms[i];
                    let noise = NOISE as f32 * ln(u / (1.0 - u));
                    // The logit of the wrong side being higher.
                    let logit = self.signs[i] * self.rises[i] / TEMPERATURE as f32 + noise;
                    let small = exp(-logit.abs());
                    costs[i] = logit.max(0.0) + ln(1.0 + small);
                    self.wrong[i] = if logit > 0.0 { 1.0 } else { small } / (1.0 + small);
                }
            },
        );
        costs[..self.len].iter().map(|c| f64::from(*c)).sum()
    }
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
        let error = gradient_error(
            &y,
            1e-3,
            |y, g| sketch_order(y, &graph, &[true; 12 * 14], Seed(4), 1.0, g),
            (0..y.len()).step_by(3),
        );
        assert!(error < 1e-3, "{error}");
    }

    #[test]
    fn a_roof_costs_less_than_a_trough() {
        let graph = graph();
        let roof: Vec<f64> = (0..12 * 14).map(|i| 1.0 - (i as f64 / 14.0 - 2.0).abs() / 10.0).collect();
        let trough: Vec<f64> = roof.iter().map(|z| 1.0 - z).collect();
        let mut g = vec![0.0; roof.len()];
        let cost = |y: &[f64], g: &mut [f64]| sketch_order(y, &graph, &[true; 12 * 14], Seed(4), 1.0, g);
        assert!(cost(&roof, &mut g) < 0.5 * cost(&trough, &mut g));
    }

    #[test]
    fn voids_take_no_part() {
        let (y, graph) = (bumpy(12, 14, 0.4), graph());
        // Ground beside the ridge, and a cell of the ridge itself.
        let voids = [5 * 14 + 6, 2 * 14 + 5];
        let mut valid = vec![true; y.len()];
        voids.iter().for_each(|&i| valid[i] = false);
        let cost = |y: &[f64], valid: &[bool]| {
            let mut g = vec![0.0; y.len()];
            (sketch_order(y, &graph, valid, Seed(4), 1.0, &mut g), g)
        };
        let mut absurd = y.clone();
        voids.iter().for_each(|&i| absurd[i] = -1e6);
        let (value, gradient) = cost(&y, &valid);
        assert_eq!((value, &gradient), (cost(&absurd, &valid).0, &cost(&absurd, &valid).1));
        assert!(voids.iter().all(|&i| gradient[i] == 0.0));
        let whole = vec![true; y.len()];
        assert!((cost(&y, &whole).0 - cost(&absurd, &whole).0).abs() > 1.0, "they count unless left out");
    }
}
