//! How fast the interpolators are, and whether the answers are right while they are.
//!
//!     cargo bench --bench solver            # sides 256 to 1024
//!     cargo bench --bench solver -- 2048    # up to another side
//!
//! Each line: side, sketch, what, best of the runs in milliseconds, and the largest violation of the answer's own law (the
//! residual in heights of 1; rows of weights that do not sum to 1). A violation above the limit ends the program with an
//! error. Bias: the sketches are drawn by formula, and other work on the machine counts.
#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use monadnock::grid::{Cell, Grid, Mask, d8};
use monadnock::interpolation::{NaturalNeighbours, biharmonic, harmonic, natural_neighbour_weights};
use std::time::Instant;

/// Largest side for which weights are stored: their number grows with the width of empty regions.
const LARGEST_STORED: usize = 512;

fn main() {
    // `cargo bench` itself passes `--bench`.
    let largest = std::env::args().find_map(|a| a.parse::<usize>().ok()).unwrap_or(1024);
    println!("{:>5} {:<7} {:<26} {:>10} {:>10}", "side", "sketch", "what", "ms", "violation");
    for side in [128, 256, 512, 1024, 2048, 4096].into_iter().filter(|&side| side <= largest) {
        for sketch in ["dense", "lambda", "corner"] {
            let lines = draw(sketch, side);
            let heights = Grid::from_fn(side, side, |c| {
                let (y, x) = (c.row as f64 / side as f64, c.col as f64 / side as f64);
                0.5 + 0.3 * (7.0 * y).sin() * (5.0 * x).cos() + 0.2 * (31.0 * x + 17.0 * y).sin()
            });
            let known: Vec<f64> = heights
                .as_slice()
                .iter()
                .zip(lines.as_slice())
                .filter(|(_, l)| **l)
                .map(|(z, _)| *z)
                .collect();
            let share = known.len() as f64 / lines.len() as f64;
            println!("{side:>5} {sketch:<7} {:.2} % of the cells are lines", 100.0 * share);
            let report = Report { side, sketch };
            report.line(
                "membrane",
                1e-8,
                || harmonic(&lines, &heights).expect("there are lines"),
                |surface| residual(&lines, &laplacian(surface)),
            );
            report.line(
                "plate",
                1e-7,
                || biharmonic(&lines, &heights).expect("there are lines"),
                |surface| residual(&lines, &laplacian(&laplacian(surface))),
            );
            if side <= LARGEST_STORED {
                report.line(
                    "natural weights, stored",
                    1e-6,
                    || natural_neighbour_weights(&lines).expect("there are lines"),
                    |weights| {
                        let ones = weights.product(&vec![1.0; weights.cols()]);
                        ones.iter().map(|sum| f64::from((sum - 1.0).abs())).fold(0.0, f64::max)
                    },
                );
            }
            report.line(
                "natural neighbours, direct",
                1e-12,
                || NaturalNeighbours::new(&lines).expect("there are lines").interpolate(&known),
                |surface| {
                    let (low, high) =
                        known.iter().fold((f64::MAX, f64::MIN), |(l, h), &z| (l.min(z), h.max(z)));
                    surface.as_slice().iter().map(|&z| (z - high).max(low - z)).fold(0.0, f64::max)
                },
            );
        }
    }
}

/// Prints the lines of one side and sketch.
struct Report {
    side: usize,
    sketch: &'static str,
}

impl Report {
    /// Times `run` and lets `check` measure how far the answer is from its law, which may be up to `limit`.
    fn line<T>(&self, what: &str, limit: f64, run: impl Fn() -> T, check: impl Fn(&T) -> f64) {
        let (mut best, mut violation) = (f64::INFINITY, 0.0);
        for _ in 0..if self.side > 512 { 2 } else { 5 } {
            let start = Instant::now();
            let answer = run();
            best = f64::min(best, 1e3 * start.elapsed().as_secs_f64());
            violation = check(&answer);
        }
        println!("{:>5} {:<7} {what:<26} {best:>10.1} {violation:>10.1e}", self.side, self.sketch);
        assert!(violation <= limit, "{what}: {violation} is more than {limit}");
    }
}

/// Sketches by formula: as dense as an extraction; a lambda inside a ring; a map whose south-east half is empty.
fn draw(sketch: &str, side: usize) -> Mask {
    let n = side as f64;
    Mask::from_fn(side, side, |Cell { row, col }| {
        let (y, x) = (row as f64, col as f64);
        match sketch {
            "dense" => {
                let (a, b) = (x * 0.35 + (y * 0.11).sin() * 3.0, y * 0.31 + (x * 0.09).cos() * 4.0);
                (a.sin() + b.sin()).abs() < 0.09
            }
            "lambda" => {
                let (u, v) = (x / n - 0.5, y / n - 0.5);
                let ring = (u.hypot(v) - 0.4).abs() < 0.5 / n;
                let leg = v.abs() < 0.25 && (u - 0.4 * v).abs() < 0.5 / n;
                let arm = (0.0..0.25).contains(&v) && (u + 0.5 * v).abs() < 0.5 / n;
                ring || leg || arm
            }
            _ => row + col < side && (row * 7 + col * 3 + row * col) % 61 == 0,
        }
    })
}

fn laplacian(u: &Grid<f64>) -> Grid<f64> {
    let (rows, cols) = u.shape();
    let flow = |cell: Cell, code: u8| d8::neighbour(cell, code, rows, cols).map_or(0.0, |n| u[cell] - u[n]);
    Grid::from_fn(rows, cols, |cell| [0, 2, 4, 6].iter().map(|&code| flow(cell, code)).sum())
}

/// Largest residual at a free cell.
fn residual(lines: &Mask, residuals: &Grid<f64>) -> f64 {
    let free = residuals.as_slice().iter().zip(lines.as_slice()).filter(|(_, line)| !**line);
    free.map(|(r, _)| r.abs()).fold(0.0, f64::max)
}
