//! Where the coordinates of a sketch file lie on the raster, and how large that is.
//!
//! The map comes from the caller, else from the file's own member. Coordinates that name a system, or look like longitude
//! and latitude, are never taken for columns and rows unless the caller says so.

use super::crs::{NamedSystem, is_same, system_of};
use super::features::RawLine;
use super::member::MapMember;
use super::notes::Notes;
use super::options::{Coordinates, ReadOptions};
use crate::dem::Georeference;
use crate::error::{Error, Result};
use crate::sketch::{Sketch, Stroke};
use serde_json::{Map, Value};

/// What helps where no map is known.
const REMEDY: &str = "--like DEM lays it on that terrain, --bounds strokes on a map around its strokes; --pixels takes x and \
                      y as columns and rows";

/// How coordinates in the file become positions on the raster.
pub(super) struct Place {
    /// Whether coordinates are model coordinates of `target`.
    pub(super) is_model: bool,
    /// The map's place.
    pub(super) target: Option<Georeference>,
}

impl Place {
    pub(super) fn of(
        root: &Map<String, Value>,
        member: Option<&MapMember>,
        lines: &[RawLine],
        options: &ReadOptions,
        notes: &mut Notes,
    ) -> Result<Self> {
        let own = member.and_then(|m| m.georeference);
        let target = options.georeference.or(own);
        let stated = options.epsg.map(NamedSystem::Epsg).or_else(|| system_of(root));
        let named = stated.clone().or_else(|| own.and_then(|g| g.epsg).map(NamedSystem::Epsg));
        let pixels = options.coordinates == Coordinates::Pixels;
        let is_model = target.is_some() && member.is_none_or(|m| m.georeference.is_some()) && !pixels;
        if let Some(target) = target.filter(|_| is_model) {
            check_system(&target, named.as_ref(), notes)?;
        } else if !pixels && member.is_none() {
            check_pixels(stated.as_ref(), lines)?;
        } else if let (Some(found), false) = (stated, pixels) {
            notes.say(format!(
                "The file names the coordinate system {found}, but its map is in columns and rows: so are its coordinates \
                 taken."
            ));
        }
        let singular = |g: &Georeference| g.to_raster(0.0, 0.0).is_none();
        if let Some(g) = target.filter(singular) {
            return Err(Error::value(
                "georeference transform",
                format!("{:?}", g.transform),
                "allowed: one that can be inverted",
            ));
        }
        Ok(Self { is_model, target })
    }

    /// Raster position with cell centres at whole numbers; not finite where the numbers do not suffice.
    pub(super) fn to_raster(&self, x: f64, y: f64) -> (f64, f64) {
        match self.target.filter(|_| self.is_model) {
            None => (x, y),
            Some(g) => g.to_raster(x, y).map_or((f64::NAN, f64::NAN), |(col, row)| (col - 0.5, row - 0.5)),
        }
    }

    /// What may be wrong when nothing lies on the map, to be said after that.
    pub(super) fn advice(&self, lines: &[RawLine], (rows, cols): (usize, usize)) -> String {
        let on_map = |(col, row): (f64, f64)| {
            (-0.5..=cols as f64 - 0.5).contains(&col) && (-0.5..=rows as f64 - 0.5).contains(&row)
        };
        let points = || lines.iter().flat_map(|line| &line.points);
        let exchanged = points().filter(|p| on_map(self.to_raster(p.y, p.x))).count();
        if 2 * exchanged > points().count() {
            return "; with x and y exchanged they lie on it: write x (longitude) first".to_owned();
        }
        let projected = self.target.and_then(|g| g.epsg).filter(|code| *code != super::crs::WGS84);
        match projected {
            Some(code) if self.is_model && like_degrees(lines) => {
                format!(
                    "; their coordinates look like longitude and latitude: save the sketch in EPSG:{code}"
                )
            }
            _ if !self.is_model && !lines.is_empty() => format!("; {REMEDY}"),
            _ => String::new(),
        }
    }
}

/// Refuses coordinates of another system than the map's.
fn check_system(target: &Georeference, named: Option<&NamedSystem>, notes: &mut Notes) -> Result<()> {
    let system = |code: u32| format!("EPSG:{code}");
    match (named, target.epsg) {
        (Some(NamedSystem::Epsg(found)), Some(expected)) if is_same(*found, expected) => Ok(()),
        (Some(found), Some(expected)) => Err(Error::value(
            "coordinate system of the sketch",
            found,
            format!(
                "the map is in {0}: save the sketch in that system, or say with --crs {expected} that its coordinates are \
                 in {0} already",
                system(expected)
            ),
        )),
        (None, Some(expected)) => {
            notes.say(format!(
                "The file names no coordinate system; its coordinates are taken as those of the map ({}).",
                system(expected)
            ));
            Ok(())
        }
        (None, None) => Ok(()),
        (Some(found), None) => {
            notes.say(format!(
                "The file names the coordinate system {found}, the map none: the sketch's coordinates are taken as the map's \
                 (--crs CODE says which it is)."
            ));
            Ok(())
        }
    }
}

/// Refuses to take for columns and rows what belongs on the Earth.
fn check_pixels(stated: Option<&NamedSystem>, lines: &[RawLine]) -> Result<()> {
    if let Some(found) = stated {
        let found = format!("{found}, without a map in it");
        return Err(Error::value(
            "coordinate system of the sketch",
            found,
            format!("a map is needed: {REMEDY}"),
        ));
    }
    let Some(b) = Bounds::of(lines) else { return Ok(()) };
    let (width, height) = (b.east - b.west, b.north - b.south);
    // A drawing on a map that begins at (0, 0) is no larger away from there than it is itself.
    let far = b.west < -0.5 || b.south < -0.5 || b.west > width.max(1.0) || b.south > height.max(1.0);
    let halves = |v: f64| (2.0 * v).fract() == 0.0;
    let whole = lines.iter().flat_map(|line| &line.points).all(|p| halves(p.x) && halves(p.y));
    if like_degrees(lines) && far && !whole {
        let found = format!("from ({}, {}) to ({}, {})", b.west, b.south, b.east, b.north);
        let allowed = format!("these look like longitude and latitude, and no map is known: {REMEDY}");
        return Err(Error::value("coordinates", found, allowed));
    }
    Ok(())
}

/// Whether all coordinates could be longitude and latitude.
fn like_degrees(lines: &[RawLine]) -> bool {
    Bounds::of(lines).is_some_and(|bounds| bounds.is_like_degrees())
}

/// The rectangle around all vertices, in the file's coordinates.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Bounds {
    /// Least x.
    pub(crate) west: f64,
    /// Least y.
    pub(crate) south: f64,
    /// Greatest x.
    pub(crate) east: f64,
    /// Greatest y.
    pub(crate) north: f64,
}

impl Bounds {
    /// Whether all of it could be longitude and latitude, degrees.
    #[must_use]
    pub(crate) fn is_like_degrees(&self) -> bool {
        self.west >= -180.0 && self.east <= 180.0 && self.south >= -90.0 && self.north <= 90.0
    }

    /// Around the vertices of `lines`; `None` without any.
    pub(super) fn of(lines: &[RawLine]) -> Option<Self> {
        let mut points = lines.iter().flat_map(|line| &line.points);
        let first = points.next()?;
        let start = Self { west: first.x, south: first.y, east: first.x, north: first.y };
        Some(points.fold(start, |b, p| Self {
            west: b.west.min(p.x),
            south: b.south.min(p.y),
            east: b.east.max(p.x),
            north: b.north.max(p.y),
        }))
    }
}

/// (rows, columns) of the map: the caller's, the file's, or what holds the strokes.
pub(super) fn size<'a>(
    member: Option<&MapMember>,
    options: &ReadOptions,
    is_model: bool,
    strokes: impl Iterator<Item = &'a Stroke> + Clone,
    notes: &mut Notes,
) -> Result<(usize, usize)> {
    let own = member.and_then(MapMember::size);
    let (rows, cols) = match (options.size, own) {
        (Some(given), own) => {
            // Model coordinates mean the same place on every map.
            if let Some((r, c)) = own.filter(|own| *own != given && !is_model) {
                notes.say(format!(
                    "The sketch was drawn on a map of {r}x{c}; it is used as it is on {}x{}.",
                    given.0, given.1
                ));
            }
            given
        }
        (None, Some(own)) => own,
        (None, None) => {
            let vertices = || strokes.clone().flat_map(|s| &s.vertices);
            let side = |furthest: f64| (furthest + 0.5).floor().max(0.0) as usize; // saturates
            let rows = side(vertices().map(|v| v.y).fold(0.0, f64::max)).saturating_add(1);
            let cols = side(vertices().map(|v| v.x).fold(0.0, f64::max)).saturating_add(1);
            if rows.checked_mul(cols).is_none_or(|cells| cells > Sketch::LARGEST) {
                let found = format!("not stated, and {rows}x{cols} cells would hold the strokes");
                return Err(Error::value(
                    "size of the sketch",
                    found,
                    format!("at most {}; {REMEDY}", Sketch::LARGEST),
                ));
            }
            notes.say(format!(
                "The file states no map size; {rows}x{cols} cells from (0, 0) hold all its strokes."
            ));
            (rows, cols)
        }
    };
    // Before anything is sized by it.
    Sketch::new(rows, cols, Vec::new())?;
    Ok((rows, cols))
}
