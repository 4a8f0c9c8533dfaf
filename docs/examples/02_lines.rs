//! The ridges and valleys of a DEM, as cells and as GeoJSON that a GIS opens.
//!
//!     cargo run --release --example 02_lines
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::sketch::geojson::{self, HeightUnit};
use monadnock::{
    Cell, ExtractionConfig, Normalization, Result, Sketch, StrokeKind, Window, ridges_and_valleys,
};
use std::path::Path;

fn main() -> Result<()> {
    let patch =
        monadnock::dem::bundled::load("grand-canyon")?.crop(Window::square(Cell::new(128, 128), 128))?;
    let range = Normalization::of(&patch);
    let lines = ridges_and_valleys(&range.normalize(&patch), patch.valid(), &ExtractionConfig::default())?;
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        let cells = lines.mask_of(kind).as_slice().iter().filter(|drawn| **drawn).count();
        println!("{kind:?}: {cells} of {} cells", 128 * 128);
    }

    // Lines of cells become strokes with vertices, in metres and at their place on the earth.
    let sketch = Sketch::trace(&lines.to_metres(range));
    geojson::write(Path::new("lines.geojson"), &sketch, HeightUnit::Metres, patch.georeference())?;
    println!("lines.geojson: {} strokes", sketch.strokes.len());
    Ok(())
}
