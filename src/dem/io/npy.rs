//! NumPy arrays (`.npy`).
//!
//! In: format version 1 to 3, two dimensions, C or Fortran order, either byte order, integers of 8 to 64 bits,
//! floats of 16 to 64; numbers are metres, not finite ones are voids. Out: a DEM; place and cell size
//! come from the options or a file beside it, else there is no place and a cell is 1 m. Written as little-endian float32 in C order with NaN for voids. Cost: one pass.
//! Source: numpy.lib.format.

use super::numbers::{NumberKind, NumberType};
use super::place::{Place, Said};
use super::reading::Source;
use super::samples::{Rule, Samples, check_size};
use super::{Description, Format};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file::Output;
use std::io::Write;
use std::path::Path;

/// Type and byte order (true: big-endian) of NumPy's type code.
fn number_type(path: &Path, descr: &str) -> Result<(NumberType, bool)> {
    let refused = || refused_type(path, descr);
    let (order, code) = descr.split_at_checked(1).ok_or_else(refused)?;
    let (kind, size) = code.split_at_checked(1).ok_or_else(refused)?;
    let kind = match kind {
        "u" => NumberKind::Unsigned,
        "i" => NumberKind::Signed,
        "f" => NumberKind::Float,
        _ => return Err(refused()),
    };
    let numbers = size.parse().ok().and_then(|size| NumberType::new(kind, size)).ok_or_else(refused)?;
    match order {
        "<" => Ok((numbers, false)),
        ">" => Ok((numbers, true)),
        "|" if numbers.size() == 1 => Ok((numbers, false)),
        "=" => Ok((numbers, cfg!(target_endian = "big"))),
        _ => Err(refused()),
    }
}

fn refused_type(path: &Path, descr: &str) -> Error {
    let allowed = "allowed: integers of 8 to 64 bits and floats of 16 to 64 bits";
    Error::file(path, "dtype", format!("{descr:?}"), allowed)
}

/// The header's dictionary, and the data after it.
struct Header<'a> {
    descr: String,
    fortran: bool,
    shape: Vec<u64>,
    data: &'a [u8],
}

impl<'a> Header<'a> {
    fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let short =
            || Error::file(path, "header", format!("cut off after {} bytes", bytes.len()), "truncated?");
        let version = *bytes.get(6).ok_or_else(short)?;
        let (length, start) = match version {
            1 => {
                let raw: [u8; 2] = bytes.get(8..10).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
                (usize::from(u16::from_le_bytes(raw)), 10)
            }
            2 | 3 => {
                let raw: [u8; 4] = bytes.get(8..12).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
                (u32::from_le_bytes(raw) as usize, 12)
            }
            _ => return Err(Error::file(path, "format version", version, "allowed: 1, 2 or 3")),
        };
        let rest = bytes.get(start..).ok_or_else(short)?;
        if length > rest.len() {
            let allowed = format!("the file has {} bytes left: truncated?", rest.len());
            return Err(Error::file(path, "header length", length, allowed));
        }
        let (header, data) = rest.split_at(length);
        let text = std::str::from_utf8(header)
            .map_err(|_| Error::file(path, "header", "not text", "allowed: a Python dictionary"))?;
        let entry = |key: &str| {
            let at = text.find(&format!("'{key}'"))? + key.len() + 2;
            text[at..].trim_start().strip_prefix(':').map(str::trim_start)
        };
        let missing =
            |key: &str| Error::file(path, format!("header entry {key:?}"), "absent", "it is required");
        let descr = entry("descr").ok_or_else(|| missing("descr"))?;
        let descr = match descr.strip_prefix('\'').and_then(|t| t.split_once('\'')) {
            Some((code, _)) => code.to_owned(),
            None => return Err(refused_type(path, descr.split('}').next().unwrap_or_default())),
        };
        let order = entry("fortran_order").ok_or_else(|| missing("fortran_order"))?;
        let fortran = match (order.starts_with("True"), order.starts_with("False")) {
            (true, _) => true,
            (_, true) => false,
            _ => {
                let found = format!("{:?}", order.chars().take(12).collect::<String>());
                return Err(Error::file(path, "fortran_order", found, "allowed: True or False"));
            }
        };
        let shape = entry("shape").ok_or_else(|| missing("shape"))?;
        let inside = shape.strip_prefix('(').and_then(|t| t.split_once(')')).map(|(inside, _)| inside);
        let sides = inside.map(|t| t.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::parse));
        let shape = match sides.map(Iterator::collect::<Result<Vec<u64>, _>>) {
            Some(Ok(sides)) => sides,
            _ => {
                let found = format!("{:?}", shape.chars().take(40).collect::<String>());
                return Err(Error::file(path, "shape", found, "allowed: (rows, columns)"));
            }
        };
        Ok(Self { descr, fortran, shape, data })
    }
}

pub(super) fn read(source: &Source<'_>, bytes: &[u8], said: &mut Said) -> Result<(Dem, Description)> {
    let Source { path, options, sidecars } = *source;
    let header = Header::parse(path, bytes)?;
    let (numbers, big_endian) = number_type(path, &header.descr)?;
    let [rows, cols] = header.shape[..] else {
        let found = format!("{} dimensions", header.shape.len());
        return Err(Error::file(path, "shape", found, "allowed: two, (rows, columns)"));
    };
    let (rows, cols) = check_size(path, rows, cols)?;
    let needed = rows * cols * numbers.size();
    if header.data.len() != needed {
        return Err(Error::file(
            path,
            "data",
            format!("{} bytes", header.data.len()),
            format!("{rows} x {cols} numbers of type {} are {needed} bytes", numbers.name()),
        ));
    }
    let rule = Rule::new(path, options, None, 1.0)?.single_precision(numbers.name() == "f32");
    let mut samples = Samples::new(rows, cols, rule);
    if header.fortran {
        numbers.each(header.data, big_endian, |i, value| samples.set((i % rows) * cols + i / rows, value));
    } else {
        numbers.each(header.data, big_endian, |i, value| samples.set(i, value));
    }
    let settled = Place::NOWHERE.settle(path, options, sidecars, (rows, cols), |_| None, said)?;
    samples.flip(settled.flip_rows, settled.flip_cols);
    let description = Description::new(Format::Npy, numbers.name(), "", &settled);
    Ok((samples.into_dem(path, settled.cell_size, said)?.at(settled.georeference), description))
}

pub(super) fn write(path: &Path, out: &mut Output<'_>, dem: &Dem) -> Result<()> {
    let (rows, cols) = dem.shape();
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {cols}), }}");
    // The data start at a multiple of 64 bytes.
    let padding = 63 - (10 + header.len()) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let failed = |e| Error::io(path, "write the file")(e);
    out.write_all(b"\x93NUMPY\x01\x00").map_err(failed)?;
    out.write_all(&(header.len() as u16).to_le_bytes()).map_err(failed)?;
    out.write_all(header.as_bytes()).map_err(failed)?;
    for (&z, &ok) in dem.heights().as_slice().iter().zip(dem.valid().as_slice()) {
        let stored = if ok { z } else { f32::NAN };
        out.write_all(&stored.to_le_bytes()).map_err(failed)?;
    }
    Ok(())
}
