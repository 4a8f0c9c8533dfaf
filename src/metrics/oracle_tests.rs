//! Metrics against scikit-image, scipy and numpy on two real patches (`tests/oracle/interpolation_and_metrics.py`).
#![allow(clippy::unwrap_used, reason = "a test: the fixture is ours")]

use crate::grid::{Cell, Grid};
use crate::metrics;
use serde_json::Value;

#[test]
fn metrics_agree_with_independent_tools() {
    let fixture: Value =
        serde_json::from_str(include_str!("../../tests/oracle/interpolation_and_metrics.json")).unwrap();
    let side = |name: &str| fixture[name].as_u64().unwrap() as usize;
    let (rows, cols) = (side("rows"), side("cols"));
    let mut compared = 0;
    for (name, patch) in fixture["patches"].as_object().unwrap() {
        let metres: Vec<f64> =
            patch["decimetres"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap() / 10.0).collect();
        let low = metres.iter().copied().fold(f64::INFINITY, f64::min);
        let high = metres.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let unit = metres.iter().map(|z| ((z - low) / (high - low)) as f32).collect();
        let truth = Grid::from_vec(rows, cols, unit).unwrap();
        let everywhere = truth.map(|_| true);
        let around_void = Grid::from_fn(rows, cols, |c| Cell::new(20, 9).distance_squared(c) > 9);
        for (kind, oracle) in patch["scores"].as_object().unwrap() {
            let output = match kind.as_str() {
                "squared" => truth.map(|&z| (f64::from(z) * f64::from(z)) as f32),
                "moved one column" => {
                    Grid::from_fn(rows, cols, |c| truth[Cell::new(c.row, c.col.saturating_sub(1))])
                }
                other => panic!("unknown output {other}"),
            };
            let mut holed = output.clone();
            for (cell, _) in around_void.cells().filter(|(_, ok)| !**ok) {
                holed[cell] = f32::NAN;
            }
            for (score, got) in [
                ("ssim", metrics::ssim(&output, &truth, &everywhere, 1.0)),
                ("ssim_with_voids", metrics::ssim(&holed, &truth, &around_void, 1.0)),
                ("psnr", metrics::psnr(&output, &truth, &everywhere, 1.0)),
                ("psnr_with_voids", metrics::psnr(&holed, &truth, &around_void, 1.0)),
                ("mean_slope_ratio", metrics::mean_slope_ratio(&output, &truth, &everywhere)),
                ("slope_distance", metrics::slope_distance(&output, &truth, &everywhere)),
                ("curvature_distance", metrics::curvature_distance(&output, &truth, &everywhere)),
                ("spectrum_distance", metrics::spectrum_distance(&output, &truth, &everywhere)),
            ] {
                let (got, want) = (got.unwrap(), oracle[score].as_f64().unwrap());
                assert!((got - want).abs() < 1e-8, "{score} of {kind} on {name}: {got}, oracle {want}");
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 32);
}
