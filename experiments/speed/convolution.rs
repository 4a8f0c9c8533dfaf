//! How fast the 3x3 convolution is beside candle's own, and whether both give the same answer.
//!
//!     cargo bench --bench convolution            # 1->32, 32->32, 64->64, 32->1 at 128x128
//!     cargo bench --bench convolution -- 256     # another side
//!
//! Each line: channels, the best of the runs in milliseconds of forward and of forward + both gradients for ours and for
//! candle's `conv2d` (through its graph, as training uses it), and the ratio. Ours is also timed as bare functions on reused
//! buffers. A relative difference above 1e-4 ends the program with an error. Bias: candle's layout is channels first and ours
//! channels last, each in its own; other work on the machine counts for both.
#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use candle_core::{Device, Tensor, Var};
use monadnock::learn::convolution::{Finish, Plane, add_weight_gradient, convolve, convolve3, turned};
use rand::RngExt;
use std::time::Instant;

const RUNS: usize = 15;

fn main() {
    let side = std::env::args().find_map(|a| a.parse::<usize>().ok()).unwrap_or(128);
    println!("{side}x{side}, {} threads", rayon::current_num_threads());
    println!(
        "{:>9} {:>10} {:>10} | {:>9} {:>9} | {:>9} {:>9} | {:>7} {:>8}",
        "channels", "bare f ms", "bare f+b", "op f", "op f+b", "candle f", "candle f+b", "ratio", "GFLOP/s"
    );
    for (channels, out_channels) in [(1, 32), (32, 32), (64, 64), (32, 1)] {
        line(side, channels, out_channels);
    }
}

fn line(side: usize, channels: usize, out_channels: usize) {
    let mut stream = monadnock::seed::Seed(1).stream("bench");
    let mut draw = |n: usize| (0..n).map(|_| stream.random_range(-1.0f32..1.0)).collect::<Vec<f32>>();
    let (image, weights) = (draw((side + 2) * (side + 2) * channels), draw(9 * channels * out_channels));
    let toward = draw(side * side * out_channels);

    let plane = Plane::from_values(side + 2, side + 2, channels, image.clone());
    let mut out = Plane::zeros(side, side, out_channels, 0);
    let mut delta = Plane::zeros(side, side, out_channels, 2);
    for (row, values) in toward.chunks_exact(side * out_channels).enumerate() {
        delta.row_mut(row).copy_from_slice(values);
    }
    let mut d_image = Plane::zeros(side + 2, side + 2, channels, 0);
    let bare_forward = best(|| convolve(&plane, &weights, &mut out, Finish::Store));
    let bare = best(|| {
        convolve(&plane, &weights, &mut out, Finish::Store);
        let mut gradient = vec![0.0; weights.len()];
        add_weight_gradient(&plane, &delta, &mut gradient);
        convolve(&delta, &turned(&weights, channels, out_channels), &mut d_image, Finish::Store);
    });

    let cpu = &Device::Cpu;
    let var = |values: &[f32], shape: &[usize]| {
        Var::from_tensor(&Tensor::from_slice(values, shape, cpu).expect("shape")).expect("variable")
    };
    let x = var(&image, &[side + 2, side + 2, channels]);
    let w = var(&weights, &[9, channels, out_channels]);
    let t = Tensor::from_slice(&toward, (side, side, out_channels), cpu).expect("shape");
    let op_forward = best(|| convolve3(&x, &w).expect("shapes fit"));
    let op_loss = || {
        let y = convolve3(&x, &w).expect("shapes fit");
        (y * &t).and_then(|y| y.sum_all()).and_then(|y| y.backward()).expect("gradients")
    };
    // From a gradient of ones: only the convolution's own passes.
    let op = best(|| convolve3(&x, &w).expect("shapes fit").backward().expect("gradients"));

    // The same numbers in candle's order.
    let order = |t: &Tensor| t.permute((2, 0, 1)).and_then(|t| t.unsqueeze(0)).and_then(|t| t.contiguous());
    let cx = Var::from_tensor(&order(&x).expect("order")).expect("variable");
    let cw = w.reshape((3, 3, channels, out_channels)).and_then(|w| w.permute((3, 2, 0, 1)));
    let cw = Var::from_tensor(&cw.and_then(|w| w.contiguous()).expect("order")).expect("variable");
    let ct = order(&t).expect("order");
    let candle_forward = best(|| cx.conv2d(&cw, 0, 1, 1, 1).expect("shapes fit"));
    let candle_loss = || {
        let y = cx.conv2d(&cw, 0, 1, 1, 1).expect("shapes fit");
        (y * &ct).and_then(|y| y.sum_all()).and_then(|y| y.backward()).expect("gradients")
    };
    let candle = best(|| cx.conv2d(&cw, 0, 1, 1, 1).and_then(|y| y.backward()).expect("gradients"));

    let (ours, theirs) = (op_loss(), candle_loss());
    let d_x = order(ours.get(&x).expect("gradient")).expect("order");
    check("input gradient", &d_x, theirs.get(&cx).expect("gradient"));
    let d_w = ours.get(&w).expect("gradient").reshape((3, 3, channels, out_channels));
    let d_w = d_w.and_then(|w| w.permute((3, 2, 0, 1))).expect("order");
    check("weight gradient", &d_w, theirs.get(&cw).expect("gradient"));
    let y = order(&convolve3(&x, &w).expect("shapes fit")).expect("order");
    check("output", &y, &cx.conv2d(&cw, 0, 1, 1, 1).expect("shapes fit"));

    let flops = 2.0 * 9.0 * (side * side * channels * out_channels) as f64;
    println!(
        "{:>9} {:>10.2} {:>10.2} | {:>9.2} {:>9.2} | {:>9.2} {:>9.2} | {:>7.1} {:>8.0}",
        format!("{channels}->{out_channels}"),
        bare_forward,
        bare,
        op_forward,
        op,
        candle_forward,
        candle,
        candle / op,
        3.0 * flops / bare / 1e6
    );
}

fn best<T>(mut run: impl FnMut() -> T) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let started = Instant::now();
        std::hint::black_box(run());
        best = best.min(started.elapsed().as_secs_f64() * 1e3);
    }
    best
}

fn check(what: &str, ours: &Tensor, theirs: &Tensor) {
    let flat = |t: &Tensor| t.flatten_all().and_then(|t| t.to_vec1::<f32>()).expect("f32 values");
    let (ours, theirs) = (flat(ours), flat(theirs));
    let scale = theirs.iter().fold(0f32, |m, v| m.max(v.abs()));
    let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
    assert!(ours.len() == theirs.len() && worst <= 1e-4 * scale, "{what}: off by {worst} of {scale}");
}
