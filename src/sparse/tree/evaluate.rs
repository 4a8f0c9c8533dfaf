//! Evaluation: height and weight of a tree at any point, and rasters of any window and cell size.
//!
//! Every node has a height f and a weight alpha (Génevaux et al. 2015). Blend: sum alpha_i f_i / sum alpha_i; replace: f_A + alpha_B (f_B - f_A);
//! carve: the same where it lowers; add: f_A + alpha_B f_B; the last three have the weight of A. A hierarchy of boxes
//! says which nodes of a blend are asked.

use super::bounds::{Bounds, Hierarchy};
use super::curve::Curve;
use super::field::{Field, FieldLevel};
use super::node::Node;
use super::noise::{NoiseKind, noise};
use crate::control::Stop;
use crate::error::Result;
use crate::grid::{Cell, Grid, Mask};
use crate::sparse::disc::falloff;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Rows of a task.
const BAND: usize = 8;

/// A tree that is ready to be asked at a cell size.
pub(super) enum Ready<'a> {
    Field(FieldLevel<'a>, Bounds),
    Plane(f64, [f64; 2]),
    Noise {
        kind: NoiseKind,
        seed: u32,
        wavelength: f64,
        octaves: usize,
        finest: f64,
        amplitude: f64,
        height: f64,
    },
    Disc([f64; 2], f64, f64),
    Curve(Curve),
    Blend(Vec<Ready<'a>>, Hierarchy),
    Pair(Operator, f64, Box<[Ready<'a>; 2]>),
}

/// The operators on two sub-trees.
#[derive(Clone, Copy)]
pub(super) enum Operator {
    Replace,
    Carve,
    Add,
}

impl<'a> Ready<'a> {
    /// For rasters with cells of so many metres.
    ///
    /// # Panics
    /// When a field is not there: trees are checked when they are made.
    pub(super) fn new(node: &Node, fields: &'a BTreeMap<String, Field>, cell: f64) -> Self {
        let pair = |operator, pair: &super::node::Pair| {
            let both = [Self::new(&pair.terrain, fields, cell), Self::new(&pair.by, fields, cell)];
            Self::Pair(operator, pair.weight, Box::new(both))
        };
        match node {
            Node::Sparse { field } => {
                let field = &fields[field];
                let [x, y] = field.extent();
                Self::Field(field.level(cell), Bounds { from: [0.0; 2], to: [x, y] })
            }
            Node::Plane { height, slope } => Self::Plane(*height, *slope),
            Node::Noise { noise: kind, wavelength, amplitude, octaves, seed, height } => Self::Noise {
                kind: *kind,
                seed: *seed,
                wavelength: *wavelength,
                octaves: *octaves,
                finest: 0.5 * cell / wavelength,
                amplitude: *amplitude,
                height: *height,
            },
            Node::Disc { centre, radius, height } => Self::Disc(*centre, *radius, *height),
            Node::Curve { points, section, reach } => Self::Curve(Curve::new(points, section, *reach)),
            Node::Blend { of } => {
                let of: Vec<Self> = of.iter().map(|node| Self::new(node, fields, cell)).collect();
                let hierarchy = Hierarchy::new(of.iter().map(Self::bounds));
                Self::Blend(of, hierarchy)
            }
            Node::Replace(p) => pair(Operator::Replace, p),
            Node::Carve(p) => pair(Operator::Carve, p),
            Node::Add(p) => pair(Operator::Add, p),
        }
    }

    /// Where it may have weight.
    fn bounds(&self) -> Bounds {
        match self {
            Self::Field(_, bounds) => *bounds,
            Self::Plane(..) | Self::Noise { .. } => Bounds::EVERYWHERE,
            Self::Disc(centre, radius, _) => Bounds::around([*centre], *radius),
            Self::Curve(curve) => curve.bounds(),
            Self::Blend(_, hierarchy) => hierarchy.bounds(),
            Self::Pair(_, _, both) => both[0].bounds(),
        }
    }

    /// Height and weight at a point; none where it has no weight.
    pub(super) fn at(&self, point: [f64; 2]) -> Option<(f64, f64)> {
        match self {
            Self::Field(field, _) => field.at(point).map(|height| (height, 1.0)),
            Self::Plane(height, slope) => Some((height + slope[0] * point[0] + slope[1] * point[1], 1.0)),
            Self::Noise { kind, seed, wavelength, octaves, finest, amplitude, height } => {
                let place = point.map(|v| v / wavelength);
                Some((height + amplitude * noise(*kind, *seed, place, *octaves, *finest), 1.0))
            }
            Self::Disc(centre, radius, height) => {
                let squared = (point[0] - centre[0]).powi(2) + (point[1] - centre[1]).powi(2);
                Some((*height, falloff(squared / (radius * radius)))).filter(|(_, weight)| *weight > 0.0)
            }
            Self::Curve(curve) => curve.at(point),
            Self::Blend(of, hierarchy) => {
                let (mut sum, mut weights) = (0.0, 0.0);
                hierarchy.meeting(&Bounds { from: point, to: point }, &mut |i| {
                    if let Some((height, weight)) = of[i].at(point) {
                        sum += weight * height;
                        weights += weight;
                    }
                });
                (weights > 0.0).then(|| (sum / weights, weights.min(1.0)))
            }
            Self::Pair(operator, strength, both) => {
                let (terrain, alpha) = both[0].at(point)?;
                let Some((by, weight)) = both[1].at(point) else { return Some((terrain, alpha)) };
                let weight = strength * weight;
                let height = match operator {
                    Operator::Replace => terrain + weight * (by - terrain),
                    Operator::Carve => terrain + weight * (by - terrain).min(0.0),
                    Operator::Add => terrain + weight * by,
                };
                Some((height, alpha))
            }
        }
    }
}

/// Heights of `rows` x `cols` cells from a corner on; cells without weight are false in the mask.
///
/// # Errors
/// When the work is stopped.
pub(super) fn raster(
    tree: &Ready<'_>,
    corner: [f64; 2],
    (rows, cols): (usize, usize),
    cell: f64,
    stop: &Stop,
) -> Result<(Grid<f32>, Mask)> {
    let bands = (0..rows.div_ceil(BAND)).into_par_iter().map(|band| {
        stop.check()?;
        let end = rows.min((band + 1) * BAND);
        let place = |row: usize, col: usize| {
            [corner[0] + (col as f64 + 0.5) * cell, corner[1] + (row as f64 + 0.5) * cell]
        };
        let cells = (band * BAND..end).flat_map(|row| (0..cols).map(move |col| (row, col)));
        Ok(cells.map(|(row, col)| tree.at(place(row, col)).map(|(height, _)| height as f32)).collect())
    });
    let bands: Vec<Vec<Option<f32>>> = bands.collect::<Result<_>>()?;
    let all = Grid::from_vec(rows, cols, bands.concat())?;
    let valid = Grid::from_fn(rows, cols, |c: Cell| all[c].is_some());
    Ok((all.map(|z| z.unwrap_or(0.0)), valid))
}
