//! ESRI ASCII grids (`.asc`).
//!
//! In: `ncols`, `nrows`, the lower left corner (`xllcorner`, `yllcorner`, or `xllcenter`, `yllcenter`), `cellsize` or
//! `dx` and `dy`, optionally `nodata_value` (or `nodata`), in any order and case; then the numbers, row by row from the north.
//! Out: a DEM in the system of the `.prj` beside it, else in metres (a grid that looks like degrees is refused).
//! `nan` and infinite numbers are voids. Cost: one pass.

use super::mask::FileMask;
use super::place::{Place, Said, unless_given};
use super::reading::Source;
use super::samples::{Rule, Samples, check_size, is_no_nodata, nodata_number};
use super::{Description, Format, Nodata};
use crate::dem::{Dem, RasterSpace};
use crate::error::{Error, Result};
use crate::file::Output;
use std::io::Write;
use std::path::Path;

/// The header's keys, lower case.
const KEYS: [&str; 10] = [
    "ncols",
    "nrows",
    "xllcorner",
    "xllcenter",
    "yllcorner",
    "yllcenter",
    "cellsize",
    "dx",
    "dy",
    "nodata_value",
];

/// What some editors put before a text in UTF-8.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Words with the number of their line, from 1.
struct Words<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            let (&first, rest) = self.rest.split_first()?;
            if !first.is_ascii_whitespace() {
                break;
            }
            self.line += usize::from(first == b'\n');
            self.rest = rest;
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        Some(word)
    }
}

fn show(word: &[u8]) -> String {
    let cut = if word.len() > 24 { "..." } else { "" };
    format!("\"{}{cut}\"", word[..word.len().min(24)].escape_ascii())
}

fn number(path: &Path, field: &str, line: usize, word: Option<&[u8]>) -> Result<f64> {
    let field = || format!("{field} (line {line})");
    let word = word.ok_or_else(|| Error::file(path, field(), "missing", "the file ends here: truncated?"))?;
    let parsed = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    parsed.ok_or_else(|| Error::file(path, field(), show(word), "allowed: a number, with a decimal point"))
}

/// The header: each key's number of line and word, in the order of [`KEYS`].
struct Header<'a> {
    words: [Option<(usize, &'a [u8])>; KEYS.len()],
}

impl<'a> Header<'a> {
    fn parse(path: &Path, words: &mut Words<'a>) -> Result<Self> {
        let mut found = [None; KEYS.len()];
        loop {
            let (before, line) = (words.rest, words.line);
            let Some(word) = words.next() else { break };
            if !word[0].is_ascii_alphabetic() || is_number(word) {
                (words.rest, words.line) = (before, line);
                break;
            }
            let name: &[u8] = if word.eq_ignore_ascii_case(b"nodata") { b"nodata_value" } else { word };
            let key = KEYS.iter().position(|key| name.eq_ignore_ascii_case(key.as_bytes()));
            let Some(key) = key else {
                let allowed = format!("allowed: {}", KEYS.join(", "));
                let field = format!("header key (line {})", words.line);
                return Err(Error::file(path, field, show(word), allowed));
            };
            let value = words.next().map(|word| (words.line, word));
            let field = || format!("{} (line {})", KEYS[key], words.line);
            let value = value
                .ok_or_else(|| Error::file(path, field(), "missing", "the file ends here: truncated?"))?;
            if found[key].replace(value).is_some() {
                return Err(Error::file(path, field(), "given twice", "allowed: once"));
            }
        }
        Ok(Self { words: found })
    }

    fn word(&self, key: &str) -> Option<(usize, &'a [u8])> {
        KEYS.iter().position(|k| *k == key).and_then(|i| self.words[i])
    }

    /// The number of a key.
    fn get(&self, path: &Path, key: &str) -> Result<Option<f64>> {
        self.word(key).map(|(line, word)| number(path, key, line, Some(word))).transpose()
    }

    fn required(&self, path: &Path, key: &str) -> Result<f64> {
        self.get(path, key)?.ok_or_else(|| Error::file(path, key, "absent", "the header must give it"))
    }

    /// What marks missing heights.
    fn nodata_word(&self) -> Option<&'a [u8]> {
        self.word("nodata_value").map(|(_, word)| word)
    }

    /// The number that marks missing heights.
    fn nodata(&self, path: &Path, said: &mut Said) -> Result<Option<f64>> {
        let Some((line, word)) = self.word("nodata_value") else { return Ok(None) };
        let text = text_of(word);
        if is_no_nodata(&text) {
            said.notes.push(format!("nodata_value is {}: no number marks missing heights", show(word)));
            return Ok(None);
        }
        let refused = || {
            let allowed = "allowed: a number, null; or say it with --nodata";
            Error::file(path, format!("nodata_value (line {line})"), show(word), allowed)
        };
        nodata_number(&text).map(Some).ok_or_else(refused)
    }

    /// Where the raster lies.
    fn place(&self, path: &Path, rows: usize) -> Result<Place> {
        let (dx, dy) = self.steps(path)?;
        let (west, point_x) = self.edge(path, "xllcorner", "xllcenter", dx)?;
        let (south, point_y) = self.edge(path, "yllcorner", "yllcenter", dy)?;
        let raster_space =
            if point_x && point_y { RasterSpace::PixelIsPoint } else { RasterSpace::PixelIsArea };
        let north = south + dy * rows as f64;
        Ok(Place { transform: Some([dx, 0.0, west, 0.0, -dy, north]), raster_space, ..Place::NOWHERE })
    }

    fn side(&self, path: &Path, key: &str) -> Result<u64> {
        let value = self.required(path, key)?;
        if value.fract() != 0.0 || !(1.0..=1e15).contains(&value) {
            return Err(Error::file(
                path,
                key,
                show(format!("{value:?}").as_bytes()),
                "allowed: a positive whole number",
            ));
        }
        Ok(value as u64)
    }

    /// (dx, dy).
    fn steps(&self, path: &Path) -> Result<(f64, f64)> {
        let check = |key: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(value);
            }
            Err(Error::file(path, key, value, "allowed: a positive finite number"))
        };
        match (self.get(path, "cellsize")?, self.get(path, "dx")?, self.get(path, "dy")?) {
            (Some(size), None, None) => check("cellsize", size).map(|s| (s, s)),
            (None, Some(dx), Some(dy)) => Ok((check("dx", dx)?, check("dy", dy)?)),
            (None, None, None) => Err(Error::file(
                path,
                "cellsize",
                "absent",
                "the header must give it; or say it with --cell-size M",
            )),
            _ => Err(Error::file(
                path,
                "cell size",
                "incomplete or given twice",
                "allowed: cellsize, or dx and dy",
            )),
        }
    }

    /// The outer west or south edge in one direction, and whether the file gave the centre of a cell.
    fn edge(&self, path: &Path, corner: &str, centre: &str, step: f64) -> Result<(f64, bool)> {
        let (edge, point) = match (self.get(path, corner)?, self.get(path, centre)?) {
            (Some(edge), None) => (edge, false),
            (None, Some(middle)) => (middle - step / 2.0, true),
            (None, None) => return Err(Error::file(path, corner, "absent", "the header must give it")),
            (Some(_), Some(_)) => {
                let allowed = format!("allowed: {corner} or {centre}, not both");
                return Err(Error::file(path, corner, "given twice", allowed));
            }
        };
        if !edge.is_finite() {
            return Err(Error::file(path, corner, edge, "allowed: a finite number"));
        }
        Ok((edge, point))
    }
}

fn text_of(word: &[u8]) -> String {
    String::from_utf8_lossy(word).into_owned()
}

/// `nan` and `inf` are numbers although they begin with a letter.
fn is_number(word: &[u8]) -> bool {
    std::str::from_utf8(word).is_ok_and(|text| text.parse::<f64>().is_ok())
}

pub(super) fn read(source: &Source<'_>, bytes: &[u8], said: &mut Said) -> Result<(Dem, Description)> {
    let Source { path, options, sidecars } = *source;
    let mut words = Words { rest: bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes), line: 1 };
    let header = Header::parse(path, &mut words)?;
    let (cols, rows) = (header.side(path, "ncols")?, header.side(path, "nrows")?);
    let (rows, cols) = check_size(path, rows, cols)?;
    // Every number takes a digit and a separator.
    let room = words.rest.len().div_ceil(2);
    if rows * cols > room {
        return Err(Error::file(
            path,
            "ncols x nrows",
            format!("{cols} x {rows}"),
            format!("the file has room for {room} numbers at most: truncated?"),
        ));
    }
    let place = unless_given(header.place(path, rows), options, Place::NOWHERE, said)?;
    let settled = place.settle(path, options, sidecars, (rows, cols), |_| None, said)?;
    let band = sidecars.band(0);
    let declared = match (band.nodata, options.nodata) {
        (Some(beside), _) => Some(beside),
        (None, Nodata::AsDeclared | Nodata::Numbers) => header.nodata(path, said)?,
        (None, _) => None,
    };
    let unit = sidecars.metres_per_height(path, &band, None, options, said)?;
    let rule = Rule::new(path, options, declared, unit)?
        .scaled(band.scale.unwrap_or(1.0), band.offset.unwrap_or(0.0))
        // Texts of 32-bit floats have more or fewer digits than their nodata.
        .single_precision(true);
    let mut samples = Samples::new(rows, cols, rule);
    for i in 0..rows * cols {
        let word = words.next();
        let Some(word) = word else {
            return Err(Error::file(
                path,
                "number of heights",
                i,
                format!("{cols} columns x {rows} rows are {}: truncated?", rows * cols),
            ));
        };
        let value: Option<f64> = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        let Some(value) = value else {
            // A height may be missing in the words of the header.
            if header.nodata_word().is_some_and(|missing| missing == word && is_no_nodata(&text_of(word))) {
                continue;
            }
            let field = format!("height at row {}, column {} (line {})", i / cols, i % cols, words.line);
            return Err(Error::file(path, field, show(word), "allowed: a number, with a decimal point"));
        };
        samples.set(i, value);
    }
    if let Some(word) = words.next() {
        return Err(Error::file(
            path,
            format!("after the last height (line {})", words.line),
            show(word),
            format!("{cols} columns x {rows} rows end before it"),
        ));
    }
    FileMask { path, options, sidecars, shape: (rows, cols), band: 0 }.apply(&mut samples, said)?;
    samples.flip(settled.flip_rows, settled.flip_cols);
    let description = Description::new(Format::AsciiGrid, "text", "", &settled);
    Ok((samples.into_dem(path, settled.cell_size, said)?.at(settled.georeference), description))
}

/// Writes the grid: the georeference's coordinates when they are metres on the ground, else local ones, because the
/// format cannot say what its unit is.
pub(super) fn write(path: &Path, out: &mut Output<'_>, dem: &Dem) -> Result<()> {
    let (rows, cols) = dem.shape();
    let size = dem.cell_size();
    let metric = dem.georeference().filter(|g| {
        let [a, b, _, d, e, _] = g.transform;
        (a, -e) == (size.x(), size.y()) && (b, d) == (0.0, 0.0)
    });
    let (west, south, space) = match metric {
        Some(g) => (g.transform[2], g.transform[5] - size.y() * rows as f64, g.raster_space),
        None => (0.0, 0.0, RasterSpace::PixelIsArea),
    };
    // A height may be -9999 (never a void's marker then).
    let taken = |marker: f32| dem.heights().as_slice().contains(&marker);
    let mut nodata = -9999.0f32;
    while taken(nodata) {
        nodata = nodata * 10.0 - 9.0;
    }
    let failed = |e| Error::io(path, "write the file")(e);
    let mut text = format!("ncols {cols}\nnrows {rows}\n");
    text += &match space {
        RasterSpace::PixelIsArea => format!("xllcorner {west}\nyllcorner {south}\n"),
        RasterSpace::PixelIsPoint => {
            format!("xllcenter {}\nyllcenter {}\n", west + size.x() / 2.0, south + size.y() / 2.0)
        }
    };
    text += &if size.x() == size.y() {
        format!("cellsize {}\n", size.x())
    } else {
        format!("dx {}\ndy {}\n", size.x(), size.y())
    };
    text += &format!("nodata_value {nodata}\n");
    out.write_all(text.as_bytes()).map_err(failed)?;
    for (heights, valid) in dem.heights().as_slice().chunks(cols).zip(dem.valid().as_slice().chunks(cols)) {
        for (col, (&z, &ok)) in heights.iter().zip(valid).enumerate() {
            let separator = if col + 1 == cols { "\n" } else { " " };
            write!(out, "{}{separator}", if ok { z } else { nodata }).map_err(failed)?;
        }
    }
    Ok(())
}
