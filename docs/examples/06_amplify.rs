//! Amplification: coarse terrain becomes four times as fine with the small forms of an exemplar.
//!
//!     cargo run --release --example 06_amplify
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::dem::{CellSize, bundled};
use monadnock::style::StyleConfig;
use monadnock::systems::task::DetailUse;
use monadnock::{
    Cell, Control, Dem, Grid, Recipe, Result, Seed, Source, Stop, Window, WriteOptions, learn, write_dem,
};
use std::path::Path;

fn main() -> Result<()> {
    let dem = bundled::load("sierra")?;
    let mut config = StyleConfig::default();
    config.model.epochs = 20;
    let recipe = Recipe::network(&config, Seed(1))?.with_patches()?;
    let source = Source::new("sierra", &dem, Window::square(Cell::new(0, 0), 128))?;
    let style = learn(&source, &recipe, Control::new(&mut |_| ()))?;

    // Every fourth cell of another part, as a coarse map that somebody painted.
    let coarse = Grid::from_fn(40, 40, |c| dem.heights()[Cell::new(200 + 4 * c.row, 100 + 4 * c.col)]);
    let coarse = Dem::new(coarse, CellSize::new(4.0 * dem.cell_size().x(), 4.0 * dem.cell_size().y())?)?;
    let fine = style.amplify(&coarse, 4, &DetailUse::default(), Seed(1), &Stop::new())?;
    assert_eq!(fine.shape(), (160, 160));
    write_dem(&fine, Path::new("fine.tif"), &WriteOptions::default())?;
    println!("fine.tif: 40x40 cells of {:.0} m became 160x160", coarse.cell_size().x());
    Ok(())
}
