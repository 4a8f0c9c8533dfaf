//! Where a raster lies and how large its cells are: what the file says, completed by the files beside it, overruled by the
//! caller.
//!
//! Order of precedence, the same for every format: options; `.aux.xml`; the file itself; for what it leaves open a world file
//! (place) and a `.prj` (coordinate system); then assumptions, which are said. That is GDAL's order. With a cell size from the
//! caller, a place that makes no sense is left out with a warning, where it is an error without.

use super::sidecars::Sidecars;
use super::{CellSizeSource, ReadOptions};
use crate::dem::crs::Crs;
use crate::dem::{CellSize, Georeference, RasterSpace};
use crate::error::{Error, Result};
use std::path::Path;

/// What is told to whoever reads a file: facts, and what may be wrong.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Said {
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

/// Where a file says that it lies; every part may be missing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Raster (col, row), outer corner at (0, 0), to coordinates; see [`Georeference::transform`].
    pub(super) transform: Option<[f64; 6]>,
    pub(super) epsg: Option<u32>,
    pub(super) definition: Option<Crs>,
    pub(super) raster_space: RasterSpace,
}

/// The place that counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settled {
    pub(super) georeference: Option<Georeference>,
    /// Rows must be reversed.
    pub(super) flip_rows: bool,
    /// Columns must be reversed.
    pub(super) flip_cols: bool,
    pub(super) cell_size: CellSize,
    pub(super) source: CellSizeSource,
}

impl Place {
    pub(super) const NOWHERE: Self =
        Self { transform: None, epsg: None, definition: None, raster_space: RasterSpace::PixelIsArea };

    /// Takes from the files beside the raster what they know better, or alone.
    fn complete(mut self, sidecars: &Sidecars, said: &mut Said) -> Self {
        let (pam, world, projection) = (&sidecars.pam, &sidecars.world, &sidecars.projection);
        if let Some(transform) = pam.as_ref().and_then(|pam| pam.transform) {
            self.transform = Some(transform);
        } else if let Some((name, transform)) = world {
            if self.transform.is_some() {
                said.notes.push(format!("{name} is not used: the file itself says where it lies"));
            } else {
                said.notes.push(format!("place and size of cells from {name}"));
                self.transform = Some(*transform);
            }
        }
        let known = |place: &Self| place.epsg.is_some() || place.definition.is_some();
        let mut take = |place: &mut Self, crs: Crs, name: &str| {
            said.notes.push(format!("coordinate system from {name}: {}", crs.in_words()));
            (place.epsg, place.definition) = match crs.epsg() {
                Some(code) if Crs::from_epsg(code).is_some() => (Some(code), None),
                _ => (None, Some(crs.with_heights(None))),
            };
        };
        if let Some(crs) = pam.as_ref().and_then(|pam| pam.crs) {
            take(&mut self, crs, &sidecars.pam_name);
        } else if let Some((name, crs)) = projection.as_ref().filter(|_| !known(&self)) {
            take(&mut self, *crs, name);
        } else if let Some((name, _)) = projection {
            said.notes.push(format!("{name} is not used: the file itself names its coordinate system"));
        }
        if let Some(space) = pam.as_ref().and_then(|pam| pam.raster_space) {
            self.raster_space = space;
        }
        self
    }

    /// The place that counts, and the cell size with it. `recorded`: a cell size that the file states for a
    /// transform, or for a raster without one.
    pub(super) fn settle(
        self,
        path: &Path,
        options: &ReadOptions,
        sidecars: &Sidecars,
        shape: (usize, usize),
        recorded: impl Fn(Option<[f64; 6]>) -> Option<CellSize>,
        said: &mut Said,
    ) -> Result<Settled> {
        let place = self.complete(sidecars, said);
        let turned = place.transform.map(|t| Turned::north_up(t, shape.0, shape.1));
        let georeference = turned.map(|turned| Georeference {
            transform: turned.transform,
            epsg: place.epsg,
            definition: place.definition,
            raster_space: place.raster_space,
        });
        let (flip_rows, flip_cols) = turned.map_or((false, false), |t| (t.flip_rows, t.flip_cols));
        if flip_rows || flip_cols {
            said.notes.push("turned so that row 0 is north".to_owned());
        }
        let settled = |georeference, cell_size, source| {
            Ok(Settled { georeference, flip_rows, flip_cols, cell_size, source })
        };
        if let Some(given) = options.cell_size {
            let sound = georeference.filter(|g| g.is_invertible());
            if georeference.is_some() && sound.is_none() {
                said.warnings.push("the transformation is degenerate: the raster has no place".to_owned());
            }
            return settled(sound, given, CellSizeSource::Caller);
        }
        if let Some(recorded) = recorded(georeference.map(|g| g.transform)) {
            return settled(georeference, recorded, CellSizeSource::File);
        }
        let Some(g) = georeference else {
            said.warnings.push(
                "neither place nor size of cells is stated: cells of 1 m assumed (--cell-size M says it)"
                    .to_owned(),
            );
            return settled(None, CellSize::square(1.0)?, CellSizeSource::Assumed);
        };
        let ground = g.ground(shape).map_err(|e| e.in_file(path))?;
        said.notes.extend(ground.notes);
        let source = if ground.assumed { CellSizeSource::AssumedUnit } else { CellSizeSource::File };
        settled(Some(g), ground.cell_size, source)
    }
}

/// A place that does not parse: an error, unless the caller says how large cells are, who is warned then.
pub(super) fn unless_given<T>(
    found: Result<T>,
    options: &ReadOptions,
    instead: T,
    said: &mut Said,
) -> Result<T> {
    found.or_else(|error| match (options.cell_size, error) {
        (Some(_), Error::File { field, value, .. }) => {
            said.warnings.push(format!("{field} is {value}: not used, as --cell-size is given"));
            Ok(instead)
        }
        (_, error) => Err(error),
    })
}

/// A transform after turning row 0 to the north, and which turns that takes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turned {
    transform: [f64; 6],
    flip_rows: bool,
    flip_cols: bool,
}

impl Turned {
    /// Undoes mirroring (south-up rasters), and a half turn of an axis-parallel raster; a rotated raster that is not
    /// mirrored stays as it is.
    fn north_up(transform: [f64; 6], rows: usize, cols: usize) -> Self {
        let [a, b, c, d, e, f] = transform;
        let mut turned = Self { transform, flip_rows: false, flip_cols: false };
        if b == 0.0 && d == 0.0 {
            turned.flip_rows = e > 0.0;
            turned.flip_cols = a < 0.0;
        } else {
            turned.flip_rows = a * e - b * d > 0.0;
        }
        let (mut a, mut b, mut c, mut d, mut e, mut f) = (a, b, c, d, e, f);
        if turned.flip_rows {
            (c, f) = (c + b * rows as f64, f + e * rows as f64);
            (b, e) = (-b, -e);
        }
        if turned.flip_cols {
            (c, f) = (c + a * cols as f64, f + d * cols as f64);
            (a, d) = (-a, -d);
        }
        turned.transform = [a, b, c, d, e, f].map(|v| v + 0.0);
        turned
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn placed(transform: [f64; 6]) -> Georeference {
        Georeference { transform, epsg: None, definition: None, raster_space: RasterSpace::PixelIsArea }
    }

    #[test]
    fn turning_keeps_every_corner_in_place() {
        for t in [
            [2.0, 0.0, 10.0, 0.0, 3.0, 20.0],
            [-2.0, 0.0, 10.0, 0.0, -3.0, 20.0],
            [-2.0, 0.0, 10.0, 0.0, 3.0, 20.0],
            [2.0, 1.0, 10.0, -1.0, 2.0, 20.0],
        ] {
            let (rows, cols) = (4usize, 6usize);
            let turned = Turned::north_up(t, rows, cols);
            let [a, b, _, d, e, _] = turned.transform;
            assert!(a * e - b * d < 0.0, "mirrored: {turned:?}");
            for (row, col) in [(0, 0), (3, 1), (1, 5)] {
                let new_row = if turned.flip_rows { rows - 1 - row } else { row };
                let new_col = if turned.flip_cols { cols - 1 - col } else { col };
                let old = placed(t).to_model(col as f64 + 0.5, row as f64 + 0.5);
                let new = placed(turned.transform).to_model(new_col as f64 + 0.5, new_row as f64 + 0.5);
                assert_relative_eq!(old.0, new.0);
                assert_relative_eq!(old.1, new.1);
            }
        }
    }

    #[test]
    fn a_given_cell_size_overrules_the_place() {
        let (path, none) = (Path::new("x"), Sidecars::default());
        let place = Place { transform: Some([0.0; 6]), ..Place::NOWHERE };
        let mut said = Said::default();
        let settle = |options: &ReadOptions, said: &mut Said| {
            place.settle(path, options, &none, (4, 4), |_| None, said)
        };
        assert!(settle(&ReadOptions::default(), &mut said).is_err());
        let given = ReadOptions { cell_size: CellSize::square(3.0).ok(), ..Default::default() };
        let settled = settle(&given, &mut said).unwrap();
        assert_eq!((settled.georeference, settled.cell_size.x()), (None, 3.0));
        assert!(said.warnings[0].contains("degenerate"));
    }
}
