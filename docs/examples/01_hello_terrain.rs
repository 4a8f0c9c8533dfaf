//! Hello, terrain: learn the style of a real landscape and turn a drawing into new terrain of that style.
//!
//!     cargo run --release --example 01_hello_terrain
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::{
    Control, Dem, Method, Recipe, Result, Seed, Source, Stop, WriteOptions, dem::bundled, learn,
    sketch::samples, write_dem,
};
use std::path::Path;

fn main() -> Result<()> {
    // A gorge in California that comes with the program. Few strokes need no training.
    let exemplar = bundled::load("sierra")?;
    let recipe = Recipe::drawings(Seed(1))?;
    let style = learn(&Source::whole("sierra", &exemplar)?, &recipe, Control::new(&mut |_| ()))?;

    // The drawing's heights are 0 to 1; here they become the exemplar's metres.
    let range = style.origin.normalization;
    let drawing = samples::load("lambda-ring")?.sketch.scaled_to(128, 128);
    let lines = drawing.map_heights(|z| range.to_metres(z)).rasterize();
    let heights = style.generate(&lines, &Method::Auto, None, Seed(1), &Stop::new())?;

    let terrain = Dem::new(heights, exemplar.cell_size())?;
    write_dem(&terrain, Path::new("hello.tif"), &WriteOptions::default())?;
    let (low, high) = terrain.range();
    println!("hello.tif: 128x128 cells, {low:.0} to {high:.0} m, {} of them drawn", lines.line_count());
    Ok(())
}
