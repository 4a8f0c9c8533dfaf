//! The numbers of fields as bytes: whole multiples of steps, compressed.
//!
//! Means and weights are rounded to steps of twice the precision, atoms to 16 bits; neighbours are subtracted, bytes of one significance lie
//! together, and all is packed with Deflate (flate2).

use super::field::{Field, FunctionAtom, check};
use super::noise::NoiseKind;
use crate::arrays::Arrays;
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::sparse::{Codes, Disc};
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Read, Write};

/// Most cells of a field's raster.
const MOST_CELLS: usize = 1 << 30;

/// What the file says of a field beside its numbers.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FieldInfo {
    shape: (usize, usize),
    cell: f64,
    radius: f64,
    step: usize,
    sparsity: usize,
    grids: usize,
    /// Kinds of the functions, one after another with their numbers.
    functions: Vec<(NoiseKind, usize)>,
    /// Metres of a step of means, of weights; the unit of a step of atoms.
    steps: [f64; 3],
    voids: bool,
}

/// All fields, their numbers rounded to within `precision` metres.
pub(super) fn pack(
    fields: &BTreeMap<String, Field>,
    precision: f64,
) -> Result<(BTreeMap<String, FieldInfo>, Arrays)> {
    let (mut infos, mut arrays) = (BTreeMap::new(), Arrays::default());
    for (name, field) in fields {
        let largest =
            |values: &mut dyn Iterator<Item = f32>| values.fold(0.0, |m, v| f64::from(v.abs()).max(m));
        let step = |values: &mut dyn Iterator<Item = f32>| {
            (2.0 * precision).max(largest(values) / f64::from(i32::MAX >> 1))
        };
        let atoms = || field.grids.iter().flat_map(|g| g.as_slice()).copied();
        let steps = [
            step(&mut field.means.iter().copied()),
            step(&mut field.codes.weights().iter().copied()),
            (largest(&mut atoms()) / f64::from(i16::MAX)).max(f64::MIN_POSITIVE),
        ];
        let whole = |values: &mut dyn Iterator<Item = f32>, step: f64| -> Vec<i32> {
            values.map(|v| (f64::from(v) / step).round() as i32).collect()
        };
        let mut means = whole(&mut field.means.iter().copied(), steps[0]);
        (1..means.len()).rev().for_each(|i| means[i] -= means[i - 1]);
        let numbers: Vec<i32> = field.codes.atoms().iter().map(|a| *a as i32).collect();
        let parts = [
            ("means", means),
            ("atoms", numbers),
            ("weights", whole(&mut field.codes.weights().iter().copied(), steps[1])),
            ("grids", whole(&mut atoms(), steps[2])),
            ("voids", field.voids.iter().flat_map(|v| v.as_slice()).map(|v| i32::from(*v)).collect()),
        ];
        for (part, values) in parts {
            let bytes = packed(&values)?;
            arrays.put_u8(&format!("{name}.{part}"), &[bytes.len()], &bytes);
        }
        let of = |f: &FunctionAtom| {
            [f.wavelength, f.angle, f.offset[0], f.offset[1], f.mean, f.length].map(|v| v as f32)
        };
        let parameters: Vec<f32> = field.functions.iter().flat_map(of).collect();
        arrays.put_f32(&format!("{name}.functions"), &[field.functions.len(), 6], &parameters);
        let seeds: Vec<u32> = field.functions.iter().map(|f| f.seed).collect();
        arrays.put_u32(&format!("{name}.seeds"), &[seeds.len()], &seeds);
        let info = FieldInfo {
            shape: field.shape,
            cell: field.cell,
            radius: field.disc.radius(),
            step: field.disc.step(),
            sparsity: field.codes.each(),
            grids: field.grids.len(),
            functions: kinds(&field.functions),
            steps,
            voids: field.voids.is_some(),
        };
        infos.insert(name.clone(), info);
    }
    Ok((infos, arrays))
}

/// The fields that were packed.
pub(super) fn unpack(
    infos: BTreeMap<String, FieldInfo>,
    arrays: &mut Arrays,
) -> Result<BTreeMap<String, Field>> {
    let mut fields = BTreeMap::new();
    for (name, info) in infos {
        let field = one(&name, info, arrays).map_err(|e| e.renamed(|what| format!("{what} of {name}")))?;
        fields.insert(name, field);
    }
    Ok(fields)
}

/// Runs of one kind.
fn kinds(functions: &[FunctionAtom]) -> Vec<(NoiseKind, usize)> {
    functions.chunk_by(|a, b| a.kind == b.kind).map(|run| (run[0].kind, run.len())).collect()
}

fn one(name: &str, info: FieldInfo, arrays: &mut Arrays) -> Result<Field> {
    let FieldInfo { shape, cell, radius, step, sparsity, grids: count, functions, steps, voids } = info;
    let disc = Disc::new(radius, step)?;
    let cells = shape.0.saturating_mul(shape.1);
    if cells == 0 || cells > MOST_CELLS {
        return Err(Error::value("shape", format!("{shape:?}"), format!("allowed: 1 to {MOST_CELLS} cells")));
    }
    if !(cell > 0.0 && cell.is_finite() && steps.iter().all(|s| *s > 0.0 && s.is_finite())) {
        return Err(Error::value("cell or steps", format!("{cell}, {steps:?}"), "allowed: finite, above 0"));
    }
    if !(1..=64).contains(&sparsity) || count > 4096 {
        return Err(Error::value(
            "sparsity or number of atoms",
            format!("{sparsity}, {count}"),
            "allowed: 1 to 64, 0 to 4096",
        ));
    }
    let (down, right) = disc.centres(shape);
    let (primitives, side) = (down * right, disc.side());
    let seeds = arrays.take_u32(&format!("{name}.seeds"))?;
    let parameters = arrays.take_f32(&format!("{name}.functions"))?;
    let total = functions.iter().fold(0usize, |sum, (_, count)| sum.saturating_add(*count));
    if total != seeds.len() || parameters.len() != 6 * total {
        return Err(Error::value("number of functions", seeds.len(), format!("the description has {total}")));
    }
    let kinds = functions.into_iter().flat_map(|(kind, count)| std::iter::repeat_n(kind, count));
    let parameters = parameters.as_chunks::<6>().0.iter().map(|p| p.map(f64::from));
    let functions = kinds.zip(seeds).zip(parameters);
    let functions = functions.map(|((kind, seed), [wavelength, angle, x, y, mean, length])| FunctionAtom {
        kind,
        seed,
        wavelength,
        angle,
        offset: [x, y],
        mean,
        length,
    });
    let functions = functions.collect();
    let mut take =
        |part: &str, count: usize| unpacked(&arrays.take_u8(&format!("{name}.{part}"))?, part, count);
    let mut means = take("means", primitives)?;
    (1..means.len()).for_each(|i| means[i] = means[i].wrapping_add(means[i - 1]));
    let scaled = |values: Vec<i32>, step: f64| -> Vec<f32> {
        values.into_iter().map(|v| (f64::from(v) * step) as f32).collect()
    };
    let atoms = take("atoms", primitives * sparsity)?.into_iter().map(|a| a as u32).collect();
    let weights = scaled(take("weights", primitives * sparsity)?, steps[1]);
    let grids = scaled(take("grids", count * side * side)?, steps[2]);
    let grids = grids.chunks_exact(side * side).map(|g| Grid::from_vec(side, side, g.to_vec()));
    let mask = take("voids", if voids { cells } else { 0 })?;
    let voids = voids.then(|| Grid::from_vec(shape.0, shape.1, mask.into_iter().map(|v| v != 0).collect()));
    let field = Field {
        shape,
        cell,
        disc,
        grids: grids.collect::<Result<_>>()?,
        functions,
        means: scaled(means, steps[0]),
        codes: Codes::from_parts(sparsity, atoms, weights),
        voids: voids.transpose()?,
    };
    check(&field)?;
    Ok(field)
}

/// Whole numbers: small ones of either sign first (zigzag), bytes of one significance together, then Deflate.
fn packed(values: &[i32]) -> Result<Vec<u8>> {
    let zigzag: Vec<u32> = values.iter().map(|v| ((v << 1) ^ (v >> 31)) as u32).collect();
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    let failed = |e: std::io::Error| Error::value("numbers", e, "they must be packed");
    for byte in 0..4 {
        let plane: Vec<u8> = zigzag.iter().map(|v| v.to_le_bytes()[byte]).collect();
        encoder.write_all(&plane).map_err(failed)?;
    }
    encoder.finish().map_err(failed)
}

/// What [`packed`] packed; exactly `count` numbers.
fn unpacked(bytes: &[u8], name: &str, count: usize) -> Result<Vec<i32>> {
    let mut planes = Vec::new();
    let limit = 4 * count as u64 + 1;
    let read = DeflateDecoder::new(bytes).take(limit).read_to_end(&mut planes);
    if let Err(e) = read {
        return Err(Error::value(name, e, "allowed: what `tree fit` writes"));
    }
    if planes.len() != 4 * count {
        return Err(Error::value(name, format!("{} bytes", planes.len()), format!("allowed: {}", 4 * count)));
    }
    let number = |i: usize| {
        let v =
            u32::from_le_bytes([planes[i], planes[count + i], planes[2 * count + i], planes[3 * count + i]]);
        (v >> 1) as i32 ^ -((v & 1) as i32)
    };
    Ok((0..count).map(number).collect())
}
