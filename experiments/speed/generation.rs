//! What one 128 x 128 terrain costs from lines to heights, by every way to use a model; checked while it is timed.
//!
//!     cargo bench --bench generation
//!
//! The model learns a patch of the bundled `sierra` for a few epochs, the lines are those of another patch. Checked: the
//! terrain meets its lines where it is corrected, two runs give the same bytes, and fine-tuning brings the uncorrected
//! terrain closer to the lines. Medians. Bias: other work on the machine counts.
#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use monadnock::control::{Control, Stop};
use monadnock::dem::Normalization;
use monadnock::dem::bundled;
use monadnock::extract;
use monadnock::grid::{Cell, Grid, Window};
use monadnock::seed::Seed;
use monadnock::sketch::LineMap;
use monadnock::style::{Recipe, Source, Style, StyleConfig, learn};
use monadnock::systems::region_gnn::{FineTuning, GenerationConfig, Preset};
use std::time::Instant;

fn main() {
    let dem = bundled::load("sierra").expect("the tile is bundled");
    let other = dem.crop(Window::square(Cell::new(0, 128), 128)).expect("a patch");
    let unit = Normalization::of(&other).normalize(&other);
    let style = |preset| {
        let mut config = StyleConfig::preset(preset);
        config.model.epochs = 40;
        let source = Source::new("sierra", &dem, Window::square(Cell::new(192, 192), 128)).expect("a patch");
        let recipe = Recipe::network(&config, Seed(1)).expect("valid settings");
        learn(&source, &recipe, Control::new(&mut |_| ())).expect("a training")
    };
    let (anchored, paper) = (style(Preset::Anchored), style(Preset::Paper));
    let extraction = &anchored.origin.extraction;
    let lines = extract::ridges_and_valleys(&unit, other.valid(), extraction).expect("lines");
    println!("128 x 128, {} line cells, {} threads", lines.line_count(), rayon::current_num_threads());

    let own = &anchored.config().generation;
    time("anchored, as `generate` has it", &anchored, &lines, &GenerationConfig { folds: 0, ..own.clone() });
    time("anchored, with trust, as `eval` has it", &anchored, &lines, own);
    let own = GenerationConfig { correction: None, ..paper.config().generation };
    let aligned = time("paper, aligned", &paper, &lines, &own);
    let fine_tuning = Some(FineTuning::default());
    let tuned = time("paper, fine-tuned", &paper, &lines, &GenerationConfig { fine_tuning, ..own });
    let (before, after) = (off_lines(&aligned, &lines), off_lines(&tuned, &lines));
    assert!(after < 0.9 * before, "fine-tuning moves the heights on lines from {before} off to {after}");
    println!("heights on lines, rms off: {before:.4} aligned, {after:.4} fine-tuned");
}

fn time(what: &str, style: &Style, lines: &LineMap, config: &GenerationConfig) -> Grid<f32> {
    let model = style.network().expect("a network").model();
    let run = || model.generate(lines, config, Seed(5), &Stop::new()).expect("terrain");
    let first = run();
    let mut times = Vec::new();
    for _ in 0..5 {
        let begun = Instant::now();
        let again = run();
        times.push(begun.elapsed().as_secs_f64());
        assert!(again == first, "the same seed gives the same heights");
    }
    times.sort_by(f64::total_cmp);
    if config.correction.is_some() {
        let off = off_lines(&first, lines);
        assert!(off < 1e-4, "corrected terrain meets its lines: {off}");
    }
    println!("{what:<40} {:>9.1} ms", times[times.len() / 2] * 1e3);
    first
}

/// Root of the mean squared difference to the heights on the lines.
fn off_lines(terrain: &Grid<f32>, lines: &LineMap) -> f64 {
    let on = lines.heights().cells().filter(|(cell, _)| lines.kinds()[*cell].is_some());
    let squares: Vec<f64> = on.map(|(cell, z)| f64::from(terrain[cell] - z).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}
