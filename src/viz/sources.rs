//! A picture of where terrain comes from.
//!
//! Terrain, its [`Provenance`], its strokes and the exemplar -> two panels. On the right every place of the exemplar has a colour of
//! its own, by row and column; on the left every cell has the colour of the place that gave its form, and pieces end at dark seams.
//! Both are shaded by their own relief.

use super::color::Oklab;
use super::hillshade::hillshade;
use super::{Exaggeration, LineArt, LineStyle, Picture, Relief, Rgb, Sheet, Sun};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use crate::metrics::{Origin, Provenance};
use crate::sketch::Sketch;

/// Sides of a panel come near to this, pixels.
const PANEL: usize = 640;
/// How colourful the frame of the exemplar is in OKLab; its middle is grey.
const CHROMA: f32 = 0.15;
/// Lightness of ground in the shade, and how much lighter it is in the sun.
const LIGHT: (f32, f32) = (0.42, 0.46);
/// Opacity of the seams.
const SEAM: f32 = 0.45;

/// Draws the sources of `terrain` beside the places of `exemplar`.
///
/// # Errors
/// When the shapes of terrain, provenance and sketch differ, or a place lies outside the exemplar.
pub(crate) fn sources(
    terrain: &Dem,
    provenance: &Provenance,
    sketch: &Sketch,
    exemplar: &Dem,
) -> Result<Picture> {
    let origins = provenance.origins();
    if origins.shape() != terrain.shape() {
        let allowed = format!("the terrain has {:?} cells", terrain.shape());
        return Err(Error::value("shape of the sources", format!("{:?}", origins.shape()), allowed));
    }
    let outside = |origin: &&Origin| match origin {
        Origin::Exemplar { cell, .. } => cell.row >= exemplar.shape().0 || cell.col >= exemplar.shape().1,
        Origin::Stroke => false,
    };
    if let Some(origin) = origins.as_slice().iter().find(outside) {
        let allowed = format!("the exemplar has {:?} cells", exemplar.shape());
        return Err(Error::value("source", format!("{origin:?}"), allowed));
    }
    let (pieces, _) = provenance.pieces();
    let shade = shades(terrain);
    let mut map = Picture::from_fn(terrain.shape().0, terrain.shape().1, |c| {
        let place = match origins[c] {
            Origin::Exemplar { cell, .. } => colour(cell, exemplar.shape()),
            Origin::Stroke => Oklab { l: 0.0, a: 0.0, b: 0.0 },
        };
        let lit = Oklab { l: LIGHT.0 + LIGHT.1 * shade[c], ..place }.to_rgb();
        let is_seam = |row: usize, col: usize| {
            let there = Cell::new(row, col);
            row < origins.rows() && col < origins.cols() && pieces[there] != pieces[c]
        };
        if is_seam(c.row + 1, c.col) || is_seam(c.row, c.col + 1) { Rgb::BLACK.over(lit, SEAM) } else { lit }
    });
    let scale = (PANEL / terrain.shape().0.max(terrain.shape().1)).clamp(1, 8);
    map = enlarged(&map, scale);
    let style = LineStyle::default();
    LineArt::try_from(sketch)?.overlay(&mut map, &style)?;
    let shade = shades(exemplar);
    let places = Picture::from_fn(exemplar.shape().0, exemplar.shape().1, |c| {
        Oklab { l: LIGHT.0 + LIGHT.1 * shade[c], ..colour(c, exemplar.shape()) }.to_rgb()
    });
    let (rows, cols) = (exemplar.shape().0, exemplar.shape().1);
    let larger = (map.rows() / rows).min(map.cols() / cols);
    let places = if larger > 0 {
        enlarged(&places, larger)
    } else {
        places.shrunk((rows.div_ceil(map.rows())).max(cols.div_ceil(map.cols())))
    };
    let mut beside = Picture::filled(map.rows(), map.cols(), Rgb::WHITE);
    beside.paste(&places, 0, 0);
    Sheet::new(2)
        .panel(map, "terrain, in the colours of the places that gave its forms")
        .panel(beside, format!("the exemplar: {rows} rows, {cols} columns"))
        .key([
            (style.ridge, "drawn ridge"),
            (style.valley, "drawn valley"),
            (Rgb::BLACK, "seam of two pieces"),
        ])
        .draw()
}

/// The hue and colourfulness of a place: its direction and distance from the middle.
fn colour(cell: Cell, (rows, cols): (usize, usize)) -> Oklab {
    let at = |i: usize, side: usize| CHROMA * (2.0 * (i as f32 + 0.5) / side as f32 - 1.0);
    Oklab { l: 0.0, a: at(cell.col, cols), b: at(cell.row, rows) }
}

/// Brightness of a DEM, 0 to 1.
fn shades(dem: &Dem) -> Grid<f32> {
    let exaggeration = match Relief::default().fixed_for(dem).exaggeration {
        Exaggeration::By(factor) => factor,
        Exaggeration::Auto => 1.0,
    };
    hillshade(dem.heights(), dem.valid(), dem.cell_size(), Sun::default(), exaggeration)
}

fn enlarged(picture: &Picture, scale: usize) -> Picture {
    Picture::from_fn(picture.rows() * scale, picture.cols() * scale, |c| {
        picture.pixels()[Cell::new(c.row / scale, c.col / scale)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::CellSize;
    use crate::sketch::{Stroke, StrokeKind, Vertex};

    fn dem(rows: usize, cols: usize) -> Dem {
        let heights = Grid::from_fn(rows, cols, |c| c.row as f32 + (c.col % 7) as f32);
        Dem::new(heights, CellSize::square(10.0).unwrap()).unwrap()
    }

    #[test]
    fn places_and_seams_are_seen() {
        let place = |row, col| Origin::Exemplar { cell: Cell::new(row, col), symmetry: 0 };
        let sketch = Sketch::new(40, 40, Vec::new()).unwrap();
        let draw = |f: &dyn Fn(Cell) -> Origin| {
            let provenance = Provenance::new(Grid::from_fn(40, 40, f));
            sources(&dem(40, 40), &provenance, &sketch, &dem(60, 50)).unwrap()
        };
        let whole = draw(&|c| place(c.row, c.col));
        let other = draw(&|c| place(c.row + 20, c.col + 10));
        let cut = draw(&|c| if c.col < 20 { place(c.row, c.col) } else { place(c.row, c.col + 1) });
        assert_ne!(whole, other);
        let pixels = cut.pixels().as_slice().iter().zip(whole.pixels().as_slice());
        let darker = pixels.filter(|(cut, whole)| cut.lightness() < whole.lightness() - 0.1).count();
        assert!(darker >= 40, "a seam on 40 rows: {darker} darker pixels");
        let drawn = Stroke {
            kind: StrokeKind::Ridge,
            vertices: [3.0, 30.0].map(|x| Vertex { x, y: 9.0, z: 1.0 }).to_vec(),
        };
        let sketch = Sketch::new(40, 40, vec![drawn]).unwrap();
        let provenance = Provenance::new(Grid::from_fn(40, 40, |c| place(c.row, c.col)));
        assert_ne!(sources(&dem(40, 40), &provenance, &sketch, &dem(60, 50)).unwrap(), whole);
    }

    #[test]
    fn sources_of_another_map_are_refused() {
        let provenance =
            Provenance::new(Grid::filled(8, 8, Origin::Exemplar { cell: Cell::new(60, 2), symmetry: 0 }));
        let sketch = Sketch::new(8, 8, Vec::new()).unwrap();
        let refused =
            |terrain: &Dem| sources(terrain, &provenance, &sketch, &dem(60, 50)).unwrap_err().to_string();
        assert!(refused(&dem(8, 9)).contains("shape of the sources"));
        assert!(refused(&dem(8, 8)).contains("60"));
    }
}
