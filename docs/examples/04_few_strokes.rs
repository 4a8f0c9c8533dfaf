//! A drawing of one's own: a ridge and a river, three seeds, three layouts between the same strokes.
//!
//!     cargo run --release --example 04_few_strokes
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::dem::bundled;
use monadnock::{
    Control, Dem, Method, Recipe, Result, Seed, Sketch, Source, Stop, Stroke, StrokeKind, Vertex,
    WriteOptions, learn, write_dem,
};
use std::path::Path;

/// A stroke through (column, row, height in metres).
fn stroke(kind: StrokeKind, points: &[(f64, f64, f64)]) -> Stroke {
    Stroke { kind, vertices: points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect() }
}

fn main() -> Result<()> {
    let dem = bundled::load("sierra")?;
    let source = Source::whole("sierra", &dem)?;
    let style = learn(&source, &Recipe::drawings(Seed(1))?, Control::new(&mut |_| ()))?;

    let ridge =
        stroke(StrokeKind::Ridge, &[(20.0, 15.0, 1900.0), (90.0, 60.0, 2300.0), (170.0, 80.0, 2000.0)]);
    let river =
        stroke(StrokeKind::Valley, &[(10.0, 120.0, 1500.0), (100.0, 140.0, 1300.0), (191.0, 170.0, 1100.0)]);
    let lines = Sketch::new(192, 192, vec![ridge, river])?.rasterize();
    for seed in 1..=3 {
        let heights = style.generate(&lines, &Method::Auto, None, Seed(seed), &Stop::new())?;
        // Strokes are met to the bit.
        let drawn = lines.mask();
        let met = heights.as_slice().iter().zip(lines.heights().as_slice()).zip(drawn.as_slice());
        assert!(met.filter(|(_, on)| **on).all(|((z, wanted), _)| z == wanted));
        let file = format!("variant-{seed}.tif");
        write_dem(&Dem::new(heights, dem.cell_size())?, Path::new(&file), &WriteOptions::default())?;
        println!("{file}: {} cells drawn, all met", lines.line_count());
    }
    Ok(())
}
