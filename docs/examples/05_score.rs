//! Scores: a network against the classical interpolators on patches that it has not seen.
//!
//!     cargo run --release --example 05_score
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::dem::bundled;
use monadnock::evaluate::{EvaluationConfig, aggregate, evaluate};
use monadnock::style::StyleConfig;
use monadnock::{Cell, Control, Recipe, Registry, Result, Seed, Source, Stop, Window, learn};

fn main() -> Result<()> {
    let dem = bundled::load("sierra")?;
    let source = Source::new("sierra", &dem, Window::square(Cell::new(0, 0), 128))?;
    let style =
        learn(&source, &Recipe::network(&StyleConfig::default(), Seed(1))?, Control::new(&mut |_| ()))?;

    // Each patch's own ridges and valleys are given; how near does each system come to the patch?
    let systems = Registry::default().select(&style, "all")?;
    let unseen = [Cell::new(256, 0), Cell::new(256, 192)];
    let result =
        evaluate(&dem, &unseen, &systems, &EvaluationConfig::default(), Seed(1), &Stop::new(), || ())?;
    println!("{:24} {:>6} {:>8}", "system", "SSIM", "PSNR, dB");
    for system in aggregate(&result.rows) {
        let of = |name| system.summary.get(name).map_or(f64::NAN, |spread| spread.mean);
        println!("{:24} {:6.4} {:8.2}", system.system, of("ssim"), of("psnr"));
    }
    Ok(())
}
