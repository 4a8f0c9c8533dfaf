//! Training the region network, with progress; a style is one file, and gives the same bytes after loading.
//!
//!     cargo run --release --example 03_train
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::dem::bundled;
use monadnock::style::StyleConfig;
use monadnock::{
    Cell, Control, ExtractionConfig, Method, Progress, Recipe, Result, Seed, Source, Stop, Style, Window,
    learn, ridges_and_valleys,
};
use std::path::Path;

fn main() -> Result<()> {
    let dem = bundled::load("sierra")?;
    let source = Source::new("sierra", &dem, Window::square(Cell::new(0, 0), 96))?;
    let mut config = StyleConfig::default();
    config.model.epochs = 20;
    let recipe = Recipe::network(&config, Seed(1))?;
    let mut tell = |now: &Progress<'_>| {
        if now.step.is_multiple_of(5) {
            let ssim = now.figure("SSIM").unwrap_or(f64::NAN);
            println!("{:3.0} %, {:.1} s, SSIM {ssim:.4}", 100.0 * now.share, now.seconds);
        }
    };
    let style = learn(&source, &recipe, Control::new(&mut tell))?;
    style.save(Path::new("sierra.safetensors"))?;

    // Dense lines of terrain that it has not seen.
    let unseen = dem.crop(Window::square(Cell::new(256, 128), 128))?;
    let range = style.origin.normalization;
    let lines = ridges_and_valleys(&range.normalize(&unseen), unseen.valid(), &ExtractionConfig::default())?;
    let lines = lines.to_metres(range);
    let of = |style: &Style| style.generate(&lines, &Method::Auto, None, Seed(1), &Stop::new());
    let loaded = Style::load(Path::new("sierra.safetensors"))?;
    assert_eq!(of(&style)?.as_slice(), of(&loaded)?.as_slice());
    println!("sierra.safetensors: saved, loaded, the same terrain");
    Ok(())
}
