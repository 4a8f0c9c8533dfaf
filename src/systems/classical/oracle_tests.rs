//! The classical systems against scipy on two real patches (`tests/oracle/interpolation_and_metrics.py`).
#![allow(clippy::unwrap_used, reason = "a test: the fixture is ours")]

use crate::control::Stop;
use crate::grid::{Cell, Grid};
use crate::interpolation::{biharmonic, harmonic};
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind};
use crate::systems::classical;
use serde_json::Value;

fn fixture() -> Value {
    serde_json::from_str(include_str!("../../../tests/oracle/interpolation_and_metrics.json")).unwrap()
}

struct Patch {
    name: String,
    metres: Grid<f64>,
    lines: LineMap,
    oracle: Value,
}

fn patches() -> Vec<Patch> {
    let fixture = fixture();
    let side = |name: &str| fixture[name].as_u64().unwrap() as usize;
    let (rows, cols) = (side("rows"), side("cols"));
    let patch = |(name, patch): (&String, &Value)| {
        let metres = patch["decimetres"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap() / 10.0);
        let metres = Grid::from_vec(rows, cols, metres.collect()).unwrap();
        let mut lines = LineMap::empty(rows, cols);
        for row in 0..rows {
            for (col, _) in patch["lines"][row].as_str().unwrap().match_indices('#') {
                let cell = Cell::new(row, col);
                lines.set(cell, StrokeKind::Ridge, metres[cell] as f32);
            }
        }
        assert!(lines.line_count() > 50);
        Patch { name: name.clone(), metres, lines, oracle: patch["interpolated"].clone() }
    };
    fixture["patches"].as_object().unwrap().iter().map(patch).collect()
}

/// Largest difference from the oracle's samples, and how many of them are unambiguous.
fn compare(got: impl Fn(usize) -> f64, oracle: &Value) -> (f64, usize) {
    let every = fixture()["every"].as_u64().unwrap() as usize;
    let samples = oracle.as_array().unwrap().iter().enumerate();
    let sure = samples.filter_map(|(i, want)| Some((i * every, want.as_f64()?)));
    sure.fold((0.0, 0), |(worst, count), (i, want)| (f64::max(worst, (got(i) - want).abs()), count + 1))
}

#[test]
fn the_solver_agrees_with_a_direct_one() {
    for patch in patches() {
        let known = patch.lines.mask();
        for (name, surface) in
            [("laplace", harmonic(&known, &patch.metres)), ("biharmonic", biharmonic(&known, &patch.metres))]
        {
            let surface = surface.unwrap();
            let (worst, count) = compare(|i| surface.as_slice()[i], &patch.oracle[name]);
            // The fixture is rounded to a millionth of a metre.
            assert!(count == 461 && worst < 2e-6, "{name} on {}: {worst} m", patch.name);
        }
    }
}

#[test]
fn classical_systems_agree_with_scipy() {
    for patch in patches() {
        for (name, system) in classical::all() {
            if patch.oracle[name].is_null() {
                continue;
            }
            let terrain = system.generate(&patch.lines, Seed(1), &Stop::new()).unwrap();
            let (worst, count) = compare(|i| f64::from(terrain.as_slice()[i]), &patch.oracle[name]);
            // Heights of up to 3000 m in f32.
            assert!(count > 350 && worst < 1e-3, "{name} on {}: {worst} m at {count} cells", patch.name);
        }
    }
}
