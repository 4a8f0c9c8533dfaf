//! Interpolation by distance alone: the nearest line cell, or the nearest few.
//!
//! Lines with heights -> terrain. A k-d tree over the line cells answers for every cell: (cells) log (line cells) in time.

use super::super::task::SketchToTerrain;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::interpolation::line_cells::{LineCells, position};
use crate::seed::Seed;
use crate::sketch::LineMap;
use kiddo::SquaredEuclidean;
use std::num::NonZero;

/// Each cell takes the height of the nearest line cell; among equally near ones, of the first in row-major order.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Nearest;

impl SketchToTerrain for Nearest {
    fn generate(&self, lines: &LineMap, _seed: Seed, _stop: &Stop) -> Result<Grid<f32>> {
        LineCells::of(lines)?.fill(|line_cells, cell| line_cells.nearest(cell))
    }
}

/// Shepard's method: the mean of the nearest `neighbours` line cells, weighted by distance to the power -`power`.
///
/// Which of several equally far cells make up the number is the tree's choice, the same every time for one sketch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InverseDistance {
    /// How many of the nearest line cells count.
    pub(crate) neighbours: NonZero<usize>,
    /// How fast their weight falls; positive and finite.
    pub(crate) power: f64,
}

impl Default for InverseDistance {
    /// 12 neighbours and power 2: what GIS programs offer first.
    fn default() -> Self {
        Self { neighbours: NonZero::<usize>::MIN.saturating_add(11), power: 2.0 }
    }
}

impl SketchToTerrain for InverseDistance {
    fn generate(&self, lines: &LineMap, _seed: Seed, _stop: &Stop) -> Result<Grid<f32>> {
        if !(self.power.is_finite() && self.power > 0.0) {
            return Err(Error::value(
                "power of inverse distance",
                self.power,
                "allowed: positive and finite",
            ));
        }
        LineCells::of(lines)?.fill(|line_cells, cell| {
            let near = line_cells
                .tree
                .query(&position(cell))
                .nearest_n::<SquaredEuclidean<f64>>(self.neighbours)
                .execute();
            let (mut sum, mut total) = (0.0, 0.0);
            for item in near {
                let weight = item.distance.powf(-0.5 * self.power);
                sum += weight * f64::from(line_cells.heights[item.item as usize]);
                total += weight;
            }
            (sum / total) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use crate::sketch::StrokeKind;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_agree_with_a_search_through_all(
            cells in proptest::collection::btree_map((0usize..23, 0usize..19), -5.0f32..5.0, 1..120),
        ) {
            let mut lines = LineMap::empty(23, 19);
            for (&(row, col), &z) in &cells {
                lines.set(Cell::new(row, col), StrokeKind::Valley, z);
            }
            let nearest = Nearest.generate(&lines, Seed(1), &Stop::new()).unwrap();
            let weighted = InverseDistance::default().generate(&lines, Seed(1), &Stop::new()).unwrap();
            for (cell, got) in nearest.cells() {
                let mut all: Vec<(usize, f32)> = cells
                    .iter()
                    .map(|(&(row, col), &z)| (cell.distance_squared(Cell::new(row, col)), z))
                    .collect();
                all.sort_by_key(|a| a.0);
                prop_assert_eq!(*got, all[0].1, "the first of the nearest in row-major order");
                // The twelfth neighbour is ambiguous when the thirteenth is as far.
                if lines.kinds()[cell].is_none() && (all.len() <= 12 || all[11].0 != all[12].0) {
                    all.truncate(12);
                    let total: f64 = all.iter().map(|a| 1.0 / a.0 as f64).sum();
                    let mean = all.iter().map(|a| f64::from(a.1) / a.0 as f64).sum::<f64>() / total;
                    prop_assert!((f64::from(weighted[cell]) - mean).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn a_power_must_be_positive() {
        let mut lines = LineMap::empty(3, 3);
        lines.set(Cell::new(1, 1), StrokeKind::Ridge, 1.0);
        for power in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let system = InverseDistance { power, ..InverseDistance::default() };
            assert!(
                system.generate(&lines, Seed(1), &Stop::new()).unwrap_err().to_string().contains("power")
            );
        }
    }
}
