//! How long the extraction of ridges and valleys takes on a 3601 x 3601 tile, step by step.
//!
//! `cargo bench --bench extraction [-- TILE.hgt]`: without a tile (raw big-endian 16-bit heights, square) it makes one of
//! the same size and roughness. Checks what it timed: drained cells sum to the tile, lines are thin, two runs agree.

#![allow(clippy::print_stdout, reason = "a bench reports on standard output")]

use monadnock::extract::{ExtractionConfig, ridges_and_valleys};
use monadnock::flow::{self, Flow, Surface};
use monadnock::grid::{Cell, Grid, Mask};
use std::hint::black_box;
use std::time::Instant;

const SIDE: usize = 3601;

fn main() {
    let tile = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let heights = match &tile {
        Some(path) => to_side(&read_hgt(path)),
        None => synthetic(),
    };
    let valid = heights.map(|&z| z > -32768.0);
    println!(
        "{} {SIDE} x {SIDE}, {} threads",
        tile.as_deref().unwrap_or("synthetic"),
        rayon::current_num_threads()
    );

    let surface = timed("surface", || Surface::new(heights.clone(), valid.clone())).expect("a valid tile");
    let directions = timed("route, one kind", || flow::route(&surface));
    let accumulation = timed("accumulate", || flow::accumulate(&directions));
    let channels = accumulation.channels(12);
    timed("strahler", || flow::strahler(&directions, &channels));
    let filled = timed("fill, one kind", || flow::fill(&surface));
    timed("d8 on filled", || flow::d8(&filled));

    let known = valid.as_slice().iter().filter(|&&v| v).count();
    let out = directions_out(&directions, &valid);
    let drained: u64 = out.iter().map(|&c| u64::from(accumulation.counts()[c])).sum();
    assert_eq!(drained, known as u64, "every cell drains out once");

    let config = ExtractionConfig::default();
    let run = || ridges_and_valleys(&heights, &valid, &config).expect("a valid tile");
    let lines = timed("WHOLE: ridges and valleys", run);
    let share = lines.line_count() as f64 / known as f64;
    println!("lines on {:.1} % of the cells", 100.0 * share);
    assert!((0.02..0.3).contains(&share), "a plausible share of line cells");
    assert_eq!(timed("WHOLE: again", run), lines, "two runs agree");
}

fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let out = black_box(work());
    println!("{what:>28}: {:7.0} ms", start.elapsed().as_secs_f64() * 1e3);
    out
}

fn directions_out(directions: &flow::FlowDirections, valid: &Mask) -> Vec<Cell> {
    valid.cells().map(|(c, _)| c).filter(|&c| directions.flow(c) == Flow::Out).collect()
}

fn read_hgt(path: &str) -> Grid<f32> {
    let bytes = std::fs::read(path).expect("readable tile");
    let side = ((bytes.len() / 2) as f64).sqrt() as usize;
    let values = bytes.chunks_exact(2).map(|b| f32::from(i16::from_be_bytes([b[0], b[1]]))).collect();
    Grid::from_vec(side, side, values).expect("square tile")
}

/// Bilinear resampling; a void spreads to the cells between it and its neighbours. Rounded to metres as tiles are.
fn to_side(tile: &Grid<f32>) -> Grid<f32> {
    if tile.rows() == SIDE {
        return tile.clone();
    }
    let step = (tile.rows() - 1) as f64 / (SIDE - 1) as f64;
    Grid::from_fn(SIDE, SIDE, |c| {
        let (y, x) = (c.row as f64 * step, c.col as f64 * step);
        let (row, col) = ((y as usize).min(tile.rows() - 2), (x as usize).min(tile.cols() - 2));
        let (v, u) = (y - row as f64, x - col as f64);
        let at = |dr: usize, dc: usize| f64::from(tile[Cell::new(row + dr, col + dc)]);
        let corners = [at(0, 0), at(0, 1), at(1, 0), at(1, 1)];
        if corners.iter().any(|&z| z <= -32768.0) {
            return -32768.0;
        }
        let north = corners[0] * (1.0 - u) + corners[1] * u;
        let south = corners[2] * (1.0 - u) + corners[3] * u;
        (north * (1.0 - v) + south * v).round() as f32
    })
}

/// Sums of value noise over eleven octaves, 0 to about 3000 m in whole metres.
fn synthetic() -> Grid<f32> {
    let hash = |x: u64, y: u64, octave: u64| {
        let mut h = (x << 40 ^ y << 16 ^ octave).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h ^= h >> 29;
        h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (h >> 40) as f64 / (1u64 << 24) as f64
    };
    Grid::from_fn(SIDE, SIDE, |c| {
        let height: f64 = (1..=11)
            .map(|octave| {
                let size = f64::from(1 << octave);
                let (y, x) = (c.row as f64 / size, c.col as f64 / size);
                let (row, col) = (y as u64, x as u64);
                let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
                let (v, u) = (smooth(y.fract()), smooth(x.fract()));
                let at = |dr, dc| hash(col + dc, row + dr, octave);
                let north = at(0, 0) * (1.0 - u) + at(0, 1) * u;
                let south = at(1, 0) * (1.0 - u) + at(1, 1) * u;
                size * (north * (1.0 - v) + south * v)
            })
            .sum();
        (height * 0.75).round() as f32
    })
}
