//! The fused pass against the literal one, gradients, and independence of the number of threads.

use super::config::{EdgeGeometry, Kernel, RegionGnnConfig};
use super::correction_op::LineCorrection;
use super::edges::Spare;
use super::network::Network;
use super::train::{LineFrame, Prepared};
use crate::control::Stop;
use crate::grid::Cell;
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind};
use candle_core::{Device, Tensor};

/// Two ridges and a valley on 24 x 30 cells.
fn lines() -> LineMap {
    let mut lines = LineMap::empty(24, 30);
    for col in 3..26 {
        lines.set(Cell::new(4, col), StrokeKind::Ridge, 0.6 + 0.01 * col as f32);
        lines.set(Cell::new(12 + col / 9, col), StrokeKind::Valley, 0.3 - 0.01 * col as f32);
    }
    for row in 15..23 {
        lines.set(Cell::new(row, row - 2), StrokeKind::Ridge, 0.5 + 0.02 * row as f32);
    }
    lines
}

fn config(base: RegionGnnConfig) -> RegionGnnConfig {
    RegionGnnConfig { random_edges: 4000, masked: 0.3, ..base }
}

/// Heights and all gradients of a weighted sum of the heights, for one kernel.
fn run(config: &RegionGnnConfig, kernel: Kernel) -> (Vec<f32>, Vec<(String, Vec<f32>)>) {
    let config = RegionGnnConfig { kernel, ..config.clone() };
    let frame = LineFrame::new(&lines(), &config, true, &Stop::new()).unwrap();
    let sketch = Prepared::new(&lines(), &frame, &config, Seed(1), &Stop::new()).unwrap();
    let network = Network::new(&config, sketch.parts.len(), Seed(2)).unwrap();
    let edges = sketch.draw(&config, config.masked, Seed(3), &Spare::default());
    assert!(edges.masked().iter().any(|m| *m) && edges.masked().iter().any(|m| !*m));
    let heights = network.forward(&edges, None, Seed(4)).unwrap().heights;
    let n = heights.elem_count();
    let weights: Vec<f32> = (0..n).map(|i| (i as f32 * 0.7).sin()).collect();
    let corrected = frame.correction.as_ref().unwrap().apply(&heights).unwrap();
    let loss = (corrected * Tensor::from_vec(weights, n, &Device::Cpu).unwrap()).unwrap().sum_all().unwrap();
    let gradients = loss.backward().unwrap();
    let flat = |t: &Tensor| t.flatten_all().unwrap().to_vec1::<f32>().unwrap();
    let of = |(name, var): (&str, &candle_core::Var)| {
        let gradient = gradients.get(var).unwrap_or_else(|| panic!("{name} receives a gradient"));
        (name.to_owned(), flat(gradient))
    };
    (flat(&heights), network.params().iter().map(of).collect())
}

fn relative(a: &[f32], b: &[f32]) -> f32 {
    let scale = b.iter().fold(1e-6f32, |m, v| m.max(v.abs()));
    a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs())) / scale
}

#[test]
fn fused_equals_plain_forward_and_backward() {
    let bare =
        RegionGnnConfig { geometry: EdgeGeometry::Projection, normalize: false, ..RegionGnnConfig::paper() };
    let wide = RegionGnnConfig { width: 64, ..RegionGnnConfig::default() };
    let narrow = RegionGnnConfig { width: 16, iterations: 3, ..RegionGnnConfig::default() };
    for base in [RegionGnnConfig::default(), RegionGnnConfig::paper(), bare, wide, narrow] {
        let config = config(base);
        let (fused, plain) = (run(&config, Kernel::Fused), run(&config, Kernel::Plain));
        assert!(relative(&fused.0, &plain.0) < 1e-5, "{}", relative(&fused.0, &plain.0));
        for ((name, a), (_, b)) in fused.1.iter().zip(&plain.1) {
            if name == "last.out.bias" {
                // The correction takes every constant off again: the true gradient is zero, the sums rounding.
                assert!(a[0].abs().max(b[0].abs()) < 1e-5);
                continue;
            }
            assert!(b.iter().any(|g| *g != 0.0), "{name} has a gradient");
            // Softmax does not see a common shift, so some gradients are zero but for rounding.
            let largest = plain.1.iter().flat_map(|(_, g)| g).fold(0.0f32, |m, g| m.max(g.abs()));
            let scale = b.iter().fold(1e-2 * largest, |m, g| m.max(g.abs()));
            let worst = a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs())) / scale;
            assert!(worst < 1e-4, "{name}: {worst}");
        }
    }
}

/// A sketch of one part, and that one masked.
#[test]
fn a_pass_without_edges_has_heights_and_gradients() {
    for config in [RegionGnnConfig::default(), RegionGnnConfig::paper()] {
        let frame = LineFrame::new(&lines(), &config, false, &Stop::new()).unwrap();
        let sketch = Prepared::new(&lines(), &frame, &config, Seed(1), &Stop::new()).unwrap();
        let network = Network::new(&config, sketch.parts.len(), Seed(2)).unwrap();
        let edges = sketch.draw(&config, 1.0, Seed(3), &Spare::default());
        assert!(edges.masked().iter().all(|m| *m));
        let heights = network.forward(&edges, None, Seed(4)).unwrap().heights;
        let gradients = heights.sum_all().unwrap().backward().unwrap();
        let heights = heights.to_vec1::<f32>().unwrap();
        // Beside its base, which only an anchored model has, nothing tells pixels apart.
        let base = frame.base().map_or_else(|| vec![0.0; heights.len()], <[f32]>::to_vec);
        let deviation = |(z, base): (&f32, &f32)| z - base;
        let first = deviation((&heights[0], &base[0]));
        assert!(first.is_finite());
        assert!(heights.iter().zip(&base).map(deviation).all(|d| (d - first).abs() < 1e-5));
        let (_, bias) = network.params().iter().find(|(name, _)| *name == "last.out.bias").unwrap();
        let gradient = gradients.get(bias).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        assert!(gradient[0] > 0.0 && gradient[0].is_finite());
    }
}

#[test]
fn parameter_gradients_equal_finite_differences() {
    // A sanity check beside the exact one above: ReLU kinks inside the step leave several per cent.
    let config = config(RegionGnnConfig { noise: 0.1, ..RegionGnnConfig::default() });
    let frame = LineFrame::new(&lines(), &config, false, &Stop::new()).unwrap();
    let sketch = Prepared::new(&lines(), &frame, &config, Seed(1), &Stop::new()).unwrap();
    let network = Network::new(&config, sketch.parts.len(), Seed(2)).unwrap();
    let edges = sketch.draw(&config, config.masked, Seed(3), &Spare::default());
    let value = || {
        let heights = network.forward(&edges, None, Seed(4)).unwrap().heights.to_vec1::<f32>().unwrap();
        heights.iter().enumerate().map(|(i, z)| f64::from(*z) * (i as f64 * 0.7).sin()).sum::<f64>()
    };
    let (_, gradients) = {
        let heights = network.forward(&edges, None, Seed(4)).unwrap().heights;
        let n = heights.elem_count();
        let weights: Vec<f32> = (0..n).map(|i| (i as f64 * 0.7).sin() as f32).collect();
        let loss =
            (heights * Tensor::from_vec(weights, n, &Device::Cpu).unwrap()).unwrap().sum_all().unwrap();
        ((), loss.backward().unwrap())
    };
    for (name, var) in network.params().iter() {
        let gradient = gradients.get(var).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let original = var.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        // Along the gradient the slope is its norm.
        let step = 2e-4;
        let at = |shift: f64| {
            let moved: Vec<f32> = original
                .iter()
                .zip(&gradient)
                .map(|(v, g)| v + (shift * f64::from(*g) / norm) as f32)
                .collect();
            network.params().assign(name, &moved).unwrap();
            value()
        };
        let difference = (at(step) - at(-step)) / (2.0 * step);
        network.params().assign(name, &original).unwrap();
        assert!((difference - norm).abs() < 0.1 * norm + 1e-2, "{name}: {difference} against {norm}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let config = config(RegionGnnConfig::paper());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&config, Kernel::Fused))
    };
    let (one, two, three) = (on(1), on(2), on(3));
    assert!(one == two && one == three);
}

#[test]
fn the_correction_meets_the_lines() {
    let lines = lines();
    let correction = LineCorrection::new(&lines, &Stop::new()).unwrap();
    let heights: Vec<f32> = (0..24 * 30).map(|i| (i as f32 * 0.1).sin()).collect();
    let corrected = correction.correct(&heights);
    for (i, z) in lines.heights().as_slice().iter().enumerate().filter(|(i, _)| lines.mask().as_slice()[*i]) {
        assert!((corrected[i] - z).abs() < 1e-5);
    }
    assert!(relative(&correction.correct(&corrected), &corrected) < 1e-5);
}
