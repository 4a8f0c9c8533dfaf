//! What an epoch of training costs, and where its time goes; the answers are checked while they are timed.
//!
//!     cargo bench --bench epoch                    # stages at 128 x 128, then epochs from 64 x 64 to 1024 x 1024
//!     cargo bench --bench epoch -- stages          # only the first
//!     cargo bench --bench epoch -- sizes 512       # only the second, up to a side
//!
//! The terrain is the bundled `sierra`, mirrored where it is too small. Medians. Sizes run in a process each, so that the
//! peak memory is theirs. Bias: other work on the machine counts.
#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use candle_core::{Device, Tensor};
use monadnock::control::{Control, Progress};
use monadnock::dem::{Normalization, bundled};
use monadnock::extract::{self, ExtractionConfig};
use monadnock::grid::{Grid, Mask};
use monadnock::machine;
use monadnock::seed::Seed;
use monadnock::sketch::{LineMap, split_parts};
use monadnock::systems::region_gnn::config::Kernel;
use monadnock::systems::region_gnn::{
    DrawnExemplar, Network, PassEdges, Preset, RegionGnn, RegionGnnConfig, RegionGraph, train,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

fn main() {
    // `cargo bench` itself passes `--bench`.
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match args[..] {
        [] => {
            stages();
            sizes(1024);
        }
        ["stages"] => stages(),
        ["sizes", side] => sizes(side.parse().expect("a side in cells")),
        ["one", preset, side] => one(preset, side.parse().expect("a side in cells")),
        _ => println!("arguments: [stages] or [sizes SIDE]"),
    }
}

/// A square of the bundled tile in its own range, mirrored beyond its frame.
fn terrain(side: usize) -> (Grid<f32>, Mask) {
    let dem = bundled::load("sierra").expect("the tile is bundled");
    let unit = Normalization::of(&dem).normalize(&dem);
    let (rows, cols) = unit.shape();
    let mirrored = |i: usize, n: usize| if (i / n).is_multiple_of(2) { i % n } else { n - 1 - i % n };
    let heights =
        Grid::from_fn(side, side, |c| unit.as_slice()[mirrored(c.row, rows) * cols + mirrored(c.col, cols)]);
    (heights, Grid::from_fn(side, side, |_| true))
}

fn lines_on(heights: &Grid<f32>, valid: &Mask) -> LineMap {
    extract::ridges_and_valleys(heights, valid, &ExtractionConfig::default()).expect("the terrain has lines")
}

/// Median time of several runs, after one that is not counted.
fn median<T>(runs: usize, mut work: impl FnMut() -> T) -> (Duration, T) {
    let mut result = work();
    let mut times: Vec<Duration> = (0..runs)
        .map(|_| {
            let begun = Instant::now();
            result = work();
            begun.elapsed()
        })
        .collect();
    times.sort();
    (times[runs / 2], result)
}

fn line(what: &str, time: Duration, check: &str) {
    println!("{what:<44} {:>9.2} ms   {check}", time.as_secs_f64() * 1e3);
}

fn stages() {
    println!("128 x 128, the paper's setting (k = 10, 10,000 random edges, T = 2, width 32), {} threads", {
        rayon::current_num_threads()
    });
    let (heights, valid) = terrain(128);
    let config = RegionGnnConfig::paper();
    let (time, lines) = median(11, || lines_on(&heights, &valid));
    line("extraction", time, &format!("{} line cells", lines.line_count()));
    let parts = split_parts(&lines, config.parts, Seed(1));
    let (time, graph) = median(11, || RegionGraph::new(&lines, &parts, None, &config).expect("parts"));
    line("region graph", time, &format!("{} regions", graph.region_count()));
    let graph = Arc::new(graph);
    let (time, edges) = median(21, || PassEdges::draw(&graph, 10_000, 1.0, 0.05, Seed(2)));
    line("random edges, noise, masks", time, "");
    let edges = Arc::new(edges);
    let network = Network::new(&config, parts.len(), Seed(3)).expect("valid");
    let plain_config = RegionGnnConfig { kernel: Kernel::Plain, ..config.clone() };
    let plain = Network::new(&plain_config, parts.len(), Seed(3)).expect("valid");

    let heights_of = |n: &Network| n.forward(&edges, None, Seed(4)).expect("a pass").heights;
    let (fused_time, fused) = median(21, || heights_of(&network));
    let (plain_time, oracle) = median(3, || heights_of(&plain));
    let error = relative(&fused, &oracle);
    assert!(error < 1e-5, "fused and plain heights differ by {error}");
    line("forward", fused_time, &format!("equals the plain one to {error:.1e}"));
    line("forward, plain", plain_time, &ratio(plain_time, fused_time));

    let weights: Vec<f32> = (0..128 * 128).map(|i| (i as f32 * 0.7).sin()).collect();
    let weights = Tensor::from_vec(weights, 128 * 128, &Device::Cpu).expect("a vector");
    let both = |n: &Network| {
        let loss = (heights_of(n) * &weights).and_then(|t| t.sum_all()).expect("a sum");
        let gradients = loss.backward().expect("gradients");
        let of = |(_, var): (&str, &candle_core::Var)| gradients.get(var).expect("a gradient").clone();
        n.params().iter().map(of).collect::<Vec<_>>()
    };
    let (fused_time, fused) = median(21, || both(&network));
    let (plain_time, oracle) = median(3, || both(&plain));
    let largest = oracle.iter().map(magnitude).fold(0.0, f64::max);
    let worst = fused.iter().zip(&oracle).map(|(a, b)| difference(a, b) / largest).fold(0.0, f64::max);
    assert!(worst < 1e-4, "fused and plain gradients differ by {worst}");
    line("forward and backward", fused_time, &format!("gradients equal the plain ones to {worst:.1e}"));
    line("forward and backward, plain", plain_time, &ratio(plain_time, fused_time));

    for (name, config) in [("paper", RegionGnnConfig::paper()), ("anchored", RegionGnnConfig::default())] {
        let (seconds, model) = epochs(config, &heights, &valid, 40);
        line(&format!("epoch, {name}"), Duration::from_secs_f64(seconds), "losses and Adam included");
        let generation = monadnock::systems::region_gnn::GenerationConfig::default();
        let (time, made) = median(5, || model.generate(&lines, &generation, Seed(5)).expect("terrain"));
        let finite = made.as_slice().iter().all(|z| z.is_finite());
        assert!(finite, "generated heights are finite");
        line(&format!("generation, {name}"), time, "");
    }
}

/// Median seconds of an epoch, and the model.
fn epochs(config: RegionGnnConfig, heights: &Grid<f32>, valid: &Mask, epochs: usize) -> (f64, RegionGnn) {
    let config = RegionGnnConfig { epochs, extractions: 1, ..config };
    let exemplar = DrawnExemplar {
        heights: heights.clone(),
        valid: valid.clone(),
        lines: vec![lines_on(heights, valid)],
    };
    let mut ignore = |_: &Progress<'_>| ();
    let (network, parts, record) =
        train(&exemplar, &config, Seed(1), Control::new(&mut ignore)).expect("a training");
    let first = record.history[0].losses.ground_truth;
    let last = record.history[record.history.len() - 1].losses.ground_truth;
    assert!(last < first, "it learns: {first} to {last}");
    (record.seconds_per_epoch, RegionGnn::new(network, parts))
}

fn sizes(largest: usize) {
    println!(
        "\n| side | paper, s an epoch | us a pixel | peak memory, MB | anchored, s | us a pixel | peak memory, MB |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|");
    for side in [64, 128, 256, 512, 1024].into_iter().filter(|&side| side <= largest) {
        let program = std::env::current_exe().expect("this program");
        let run = |preset: &str| {
            let output = std::process::Command::new(&program)
                .args(["one", preset, &side.to_string()])
                .output()
                .expect("this program runs");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            String::from_utf8(output.stdout).expect("text").trim().to_owned()
        };
        println!("| {side} | {} | {} |", run("paper"), run("anchored"));
    }
}

/// One size in a process of its own.
fn one(preset: &str, side: usize) {
    let preset = if preset == "paper" { Preset::Paper } else { Preset::Anchored };
    let (heights, valid) = terrain(side);
    let count = if side > 256 { 4 } else { 20 };
    let (seconds, _) = epochs(RegionGnnConfig::preset(preset), &heights, &valid, count);
    let memory = machine::peak_memory().map_or(f64::NAN, |bytes| bytes as f64 / 1e6);
    println!("{seconds:.4} | {:.2} | {memory:.0}", seconds * 1e6 / (side * side) as f64);
}

fn ratio(slow: Duration, fast: Duration) -> String {
    format!("{:.0} times as long", slow.as_secs_f64() / fast.as_secs_f64())
}

fn values(t: &Tensor) -> Vec<f32> {
    t.flatten_all().and_then(|t| t.to_vec1()).expect("numbers")
}

fn magnitude(t: &Tensor) -> f64 {
    values(t).iter().fold(0.0, |m, v| m.max(f64::from(v.abs())))
}

fn difference(a: &Tensor, b: &Tensor) -> f64 {
    values(a).iter().zip(values(b)).fold(0.0, |m, (a, b)| m.max(f64::from((a - b).abs())))
}

fn relative(a: &Tensor, b: &Tensor) -> f64 {
    difference(a, b) / magnitude(b).max(1e-12)
}
