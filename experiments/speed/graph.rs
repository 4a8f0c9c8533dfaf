//! What it costs to tie every pixel to its nearest parts, once a sketch; checked against brute force while it is timed.
//!
//!     cargo bench --bench graph                 # sides 128, 256, 512
//!     cargo bench --bench graph -- 1024         # one side
//!
//! The terrain is the bundled `sierra`, mirrored where it is too small; dense lines, and thin ones (Strahler order 4 and up).
//! Medians. Bias: other work on the machine counts.
#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use monadnock::dem::{Normalization, bundled};
use monadnock::extract::{self, ExtractionConfig};
use monadnock::grid::{Cell, Grid};
use monadnock::seed::Seed;
use monadnock::sketch::split_parts;
use monadnock::systems::region_gnn::{RegionGnnConfig, RegionGraph};
use std::time::Instant;

fn main() {
    let sides: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let sides = if sides.is_empty() { vec![128, 256, 512] } else { sides };
    println!("{} threads, k = 10", rayon::current_num_threads());
    println!("| side | lines | parts | ms | ns a pixel | checked pixels |");
    println!("|---:|---|---:|---:|---:|---:|");
    for side in sides {
        one(side, 2, "dense");
        one(side, 4, "thin");
    }
}

fn one(side: usize, order: u8, name: &str) {
    let dem = bundled::load("sierra").expect("the tile is bundled");
    let unit = Normalization::of(&dem).normalize(&dem);
    let (rows, cols) = unit.shape();
    let mirrored = |i: usize, n: usize| if (i / n).is_multiple_of(2) { i % n } else { n - 1 - i % n };
    let heights =
        Grid::from_fn(side, side, |c| unit.as_slice()[mirrored(c.row, rows) * cols + mirrored(c.col, cols)]);
    let valid = Grid::from_fn(side, side, |_| true);
    let extraction = ExtractionConfig { min_order: order, ..Default::default() };
    let lines = extract::ridges_and_valleys(&heights, &valid, &extraction).expect("the terrain has lines");
    let config = RegionGnnConfig::paper();
    let parts = split_parts(&lines, config.parts, Seed(1));

    let build = || RegionGraph::new(&lines, &parts, None, &config).expect("parts");
    let graph = build();
    let mut times: Vec<f64> = (0..11)
        .map(|_| {
            let begun = Instant::now();
            std::hint::black_box(build());
            begun.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let seconds = times[times.len() / 2];

    // Every part of some pixels, sorted by distance and index, against the graph's k.
    let k = graph.k();
    let mut checked = 0;
    for pixel in (0..side * side).step_by(61) {
        let cell = Cell::new(pixel / side, pixel % side);
        let ties = graph.regions().iter().enumerate().map(|(id, r)| (r.project(cell).distance, id as u32));
        let mut all: Vec<(f32, u32)> = ties.collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let edges = pixel * k..(pixel + 1) * k;
        let found =
            graph.distances()[edges.clone()].iter().copied().zip(graph.nearest()[edges].iter().copied());
        assert!(found.eq(all[..k].iter().copied()), "the {k} nearest parts of {cell:?}");
        checked += 1;
    }
    let per_pixel = seconds * 1e9 / (side * side) as f64;
    println!(
        "| {side} | {name} | {} | {:.2} | {per_pixel:.0} | {checked} |",
        graph.region_count(),
        seconds * 1e3
    );
}
