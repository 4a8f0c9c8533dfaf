//! The map that a sketch becomes terrain on: its size in cells, its place, and how large a cell is on the ground.
//!
//! In order of precedence: `--like DEM` or `--bounds`, then what the sketch file says of itself, then its strokes. The size of
//! a cell follows from the place; a sketch without one has the style's cells. `--cell-size` overrules all of it.

use super::args::{cell_size, read_numbers, size, tell};
use super::console::Console;
use super::sketch_input::{Map, outline, read_on_map, read_sized, read_sketch, scaled};
use crate::dem::{CellSize, Georeference, RasterSpace};
use crate::error::{Error, Result};
use crate::sketch::geojson::{Bounds, Outline, ReadOptions, SketchReading};
use std::path::{Path, PathBuf};

/// Heading in the help.
const PLACING: &str = "Placing the sketch";
/// What `--bounds strokes` leaves free around the strokes, as a share of the longer side.
const MARGIN: f64 = 0.1;
/// Cell sizes that differ by more than this factor are worth a warning: forms are learned in cells.
const FAR: f64 = 3.0;

// Where the sketch lies. No doc comment, see args.rs.
#[derive(Debug, clap::Args)]
pub(super) struct MapOptions {
    /// Lay the sketch on the map of this terrain: its cells, place and coordinate system
    #[arg(long, help_heading = PLACING, value_name = "DEM", conflicts_with = "bounds")]
    like: Option<PathBuf>,
    /// Lay the sketch on a map between these coordinates of its own, or around its `strokes` with a tenth to spare
    #[arg(long, help_heading = PLACING, value_name = "W,S,E,N|strokes", value_parser = bounds,
          allow_hyphen_values = true, conflicts_with = "pixels")]
    bounds: Option<BoundsOption>,
    /// Cells of the map, as HEIGHTxWIDTH or one side: a sketch drawn on another size is scaled, heights stay
    #[arg(long, help_heading = PLACING, value_name = "HxW", value_parser = size)]
    size: Option<(usize, usize)>,
    /// Cell size on the ground, metres: one side, or west-east and north-south; overrules every file
    #[arg(long, help_heading = PLACING, value_name = "M[,M]", value_parser = cell_size, allow_hyphen_values = true)]
    cell_size: Option<CellSize>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum BoundsOption {
    Given(Bounds),
    Strokes,
}

fn bounds(text: &str) -> Result<BoundsOption, String> {
    if text.trim().eq_ignore_ascii_case("strokes") {
        return Ok(BoundsOption::Strokes);
    }
    let allowed = "allowed: `strokes`, or WEST,SOUTH,EAST,NORTH as in 7.5,46.1,7.7,46.3";
    let numbers: Option<Vec<f64>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[west, south, east, north]) if east - west > 0.0 && north - south > 0.0 => {
            let all = [west, south, east, north];
            if all.iter().all(|v| v.is_finite()) {
                return Ok(BoundsOption::Given(Bounds { west, south, east, north }));
            }
            Err(allowed.to_owned())
        }
        _ => Err(allowed.to_owned()),
    }
}

/// A sketch on its map.
pub(super) struct SketchOnMap {
    pub(super) reading: SketchReading,
    pub(super) cell_size: CellSize,
}

impl MapOptions {
    /// The terrain that the map is taken from, for the check of outputs.
    pub(super) fn like(&self) -> Option<&PathBuf> {
        self.like.as_ref()
    }

    /// The sketch in `path` on its map, in the style's cells where nobody says how large they are; tells what was assumed.
    ///
    /// # Errors
    /// Whatever is wrong with the sketch, the terrain that it is to lie on, or its place.
    pub(super) fn read(
        &self,
        path: &Path,
        options: &ReadOptions,
        style: CellSize,
        console: &Console,
    ) -> Result<SketchOnMap> {
        let found = if let Some(dem) = &self.like {
            self.on_terrain(path, dem, options, console)?
        } else if let Some(bounds) = self.bounds {
            self.in_bounds(path, bounds, options, style, console)?
        } else {
            self.as_stated(path, options, style, console)?
        };
        for warning in &found.reading.warnings {
            console.warning(format!("{}: {warning}", path.display()));
        }
        let cell_size = found.cell_size;
        let (ours, theirs) = (cell_size.mean(), style.mean());
        if ours / theirs > FAR || theirs / ours > FAR {
            console.warning(format!(
                "{}: its cells are {ours:.2} m on the ground, those that the style was learned from {theirs:.2} m: the forms \
                 will be as many cells large as there, not as many metres (--size HxW or --cell-size M changes the map's)",
                path.display()
            ));
        }
        if !cell_size.is_square() {
            console.warning(format!(
                "{}: cells of {} are worked on as if they were square",
                path.display(),
                cell_size.in_words()
            ));
        }
        Ok(found)
    }

    /// On the map of a DEM.
    fn on_terrain(
        &self,
        path: &Path,
        dem: &Path,
        options: &ReadOptions,
        console: &Console,
    ) -> Result<SketchOnMap> {
        let like = Like::read(dem, self.cell_size, console)?;
        let map = Map { size: like.size, georeference: like.georeference };
        let (mut reading, drawn) = read_on_map(path, map, like.size, options)?;
        if let Some((rows, cols)) = drawn {
            let (to_rows, to_cols) = like.size;
            console.note(format!(
                "{}: drawn on {rows}x{cols} cells, stretched over the {to_rows}x{to_cols} of {}",
                path.display(),
                dem.display()
            ));
            reading = scaled(path, reading, like.size)?;
        }
        reading.georeference = like.georeference;
        let mut cell_size = like.cell_size;
        if let Some(size) = self.size.filter(|size| *size != like.size) {
            reading = scaled(path, reading, size)?;
            if self.cell_size.is_none() {
                let across = |from: usize, to: usize| from as f64 / to as f64;
                let (down, right) = (across(like.size.0, size.0), across(like.size.1, size.1));
                cell_size = CellSize::new(cell_size.x() * right, cell_size.y() * down)?;
            }
        }
        console.note(format!(
            "{}: on the map of {}: {}x{} cells of {}",
            path.display(),
            dem.display(),
            reading.sketch.rows,
            reading.sketch.cols,
            cell_size.in_words()
        ));
        Ok(SketchOnMap { reading, cell_size })
    }

    /// On a map between coordinates of the sketch's own system.
    fn in_bounds(
        &self,
        path: &Path,
        bounds: BoundsOption,
        options: &ReadOptions,
        style: CellSize,
        console: &Console,
    ) -> Result<SketchOnMap> {
        let outline = outline(path, options)?;
        if !outline.is_placed {
            let allowed = "this sketch is in columns and rows of its own map: --size HxW scales it";
            return Err(Error::file(path, "--bounds", "given", allowed));
        }
        let b = match bounds {
            BoundsOption::Given(bounds) => bounds,
            BoundsOption::Strokes => {
                let none = || Error::file(path, "number of strokes", 0, "allowed: at least one");
                around(outline.bounds.ok_or_else(none)?).map_err(|e| e.in_file(path))?
            }
        };
        let is_lon_lat = b.is_like_degrees();
        let epsg = outline.epsg.or_else(|| is_lon_lat.then_some(4326));
        if outline.epsg.is_none() && is_lon_lat {
            console.note(format!(
                "{}: names no coordinate system: longitude and latitude (EPSG:4326), as GeoJSON has them",
                path.display()
            ));
        }
        let place = |size| between(b, epsg, size);
        // One cell for all tells how large the map is on the ground.
        let whole = place((1, 1)).ground((1, 1)).map_err(|e| e.in_file(path))?.cell_size;
        let side = self.cell_size.map_or(style.mean(), CellSize::mean);
        let count = |length: f64| ((length / side).round() as usize).max(2);
        let size = self.size.unwrap_or((count(whole.y()), count(whole.x())));
        let georeference = place(size);
        let reading = ReadOptions { size: Some(size), georeference: Some(georeference), ..options.clone() };
        let reading = read_sketch(path, &reading)?;
        let cell_size = match self.cell_size.filter(|_| self.size.is_some()) {
            Some(given) => given,
            None => cell_on_ground(path, &georeference, size, console)?,
        };
        console.note(format!(
            "{}: on a map from ({}, {}) to ({}, {}): {}x{} cells of {}",
            path.display(),
            b.west,
            b.south,
            b.east,
            b.north,
            size.0,
            size.1,
            cell_size.in_words()
        ));
        Ok(SketchOnMap { reading, cell_size })
    }

    /// On the map that the file describes.
    fn as_stated(
        &self,
        path: &Path,
        options: &ReadOptions,
        style: CellSize,
        console: &Console,
    ) -> Result<SketchOnMap> {
        let (mut reading, scaled_from) = read_sized(path, self.size, options)?;
        if let Some((rows, cols)) = scaled_from {
            let (to_rows, to_cols) = (reading.sketch.rows, reading.sketch.cols);
            let text = format!("drawn on {rows}x{cols} cells, scaled to {to_rows}x{to_cols}");
            console.note(format!("{}: {text}", path.display()));
        }
        let Some(georeference) = reading.georeference else {
            let cell_size = self.cell_size.unwrap_or(style);
            if self.cell_size.is_none() {
                console.note(format!(
                    "{}: has no place: cells of {}, as the style's (--cell-size)",
                    path.display(),
                    style.in_words()
                ));
            }
            return Ok(SketchOnMap { reading, cell_size });
        };
        let size = |reading: &SketchReading| (reading.sketch.rows, reading.sketch.cols);
        let mut cell_size = match self.cell_size {
            Some(given) => given,
            None => cell_on_ground(path, &georeference, size(&reading), console)?,
        };
        // As terrain is: on square cells, unless the caller wants these.
        if let (None, Some(square)) = (self.size, cell_size.square_shape(size(&reading))) {
            let from = size(&reading);
            console.note(format!(
                "{}: cells are {}: scaled from {}x{} to {}x{} square ones",
                path.display(),
                cell_size.in_words(),
                from.0,
                from.1,
                square.0,
                square.1
            ));
            reading = scaled(path, reading, square)?;
            let (down, right) = (from.0 as f64 / square.0 as f64, from.1 as f64 / square.1 as f64);
            cell_size = CellSize::new(cell_size.x() * right, cell_size.y() * down)?;
        }
        Ok(SketchOnMap { reading, cell_size })
    }
}

/// The size of a cell on the ground; tells what it rests on.
fn cell_on_ground(
    path: &Path,
    place: &Georeference,
    shape: (usize, usize),
    console: &Console,
) -> Result<CellSize> {
    let ground = place.ground(shape).map_err(|e| e.in_file(path))?;
    for note in &ground.notes {
        let text = format!("{}: {note}", path.display());
        if ground.assumed { console.warning(text) } else { console.note(text) }
    }
    Ok(ground.cell_size)
}

/// The place of a map of (rows, columns) between coordinates of a system.
fn between(b: Bounds, epsg: Option<u32>, (rows, cols): (usize, usize)) -> Georeference {
    let (right, down) = ((b.east - b.west) / cols as f64, (b.south - b.north) / rows as f64);
    let transform = [right, 0.0, b.west, 0.0, down, b.north];
    Georeference { transform, epsg, definition: None, raster_space: RasterSpace::PixelIsArea }
}

/// A map around the strokes of a sketch that names a system, its longer side so many cells long: (rows, columns) and place.
pub(super) fn around_strokes(outline: &Outline, side: usize) -> Option<((usize, usize), Georeference)> {
    let b = around(outline.bounds.filter(|_| outline.epsg.is_some())?).ok()?;
    let (width, height) = (b.east - b.west, b.north - b.south);
    let cells = |length: f64| ((side as f64 * length / width.max(height)).round() as usize).max(1);
    let size = (cells(height), cells(width));
    Some((size, between(b, outline.epsg, size)))
}

/// The bounds of strokes, with a margin on all sides.
fn around(b: Bounds) -> Result<Bounds> {
    let margin = MARGIN * (b.east - b.west).max(b.north - b.south);
    if margin.is_finite() && margin > 0.0 {
        let Bounds { west, south, east, north } = b;
        return Ok(Bounds {
            west: west - margin,
            south: south - margin,
            east: east + margin,
            north: north + margin,
        });
    }
    let found = format!("({}, {}) to ({}, {})", b.west, b.south, b.east, b.north);
    Err(Error::value(
        "bounds of the strokes",
        found,
        "no map lies around a single point: give --bounds W,S,E,N",
    ))
}

/// What is taken from terrain that a sketch is to be like.
struct Like {
    size: (usize, usize),
    georeference: Option<Georeference>,
    cell_size: CellSize,
}

impl Like {
    /// On square cells, as every command works on terrain; tells what was assumed of its place.
    fn read(path: &Path, cell_size: Option<CellSize>, console: &Console) -> Result<Self> {
        let (dem, description) = read_numbers(path, cell_size)?;
        tell(path, &description, console);
        let dem = dem.on_square_cells().map_err(|e| e.in_file(path))?.unwrap_or(dem);
        Ok(Self { size: dem.shape(), georeference: dem.georeference().copied(), cell_size: dem.cell_size() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_four_numbers_in_order_or_the_strokes() {
        assert_eq!(bounds("Strokes"), Ok(BoundsOption::Strokes));
        let given = Bounds { west: -7.5, south: 46.0, east: -7.0, north: 46.5 };
        assert_eq!(bounds("-7.5, 46, -7,46.5"), Ok(BoundsOption::Given(given)));
        for bad in
            ["", "1,2,3", "1,2,3,4,5", "3,2,1,4", "1,4,3,2", "1,2,1,4", "nan,0,1,1", "0,0,inf,1", "a,b,c,d"]
        {
            assert!(bounds(bad).unwrap_err().contains("WEST,SOUTH,EAST,NORTH"), "{bad}");
        }
        let spared = around(Bounds { west: 0.0, south: 0.0, east: 10.0, north: 4.0 }).unwrap();
        assert_eq!(spared, Bounds { west: -1.0, south: -1.0, east: 11.0, north: 5.0 });
        assert!(around(Bounds { west: 3.0, south: 4.0, east: 3.0, north: 4.0 }).is_err());
    }
}
