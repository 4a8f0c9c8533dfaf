//! The floor: interpolators that know nothing of landscapes, each from the same lines with heights.
//!
//! A researcher tries these first, and a model that does not beat them is not done. None of them is random (the seed is
//! not read); each keeps the heights of the lines exactly and needs at least one line cell.

mod distance;
#[cfg(test)]
mod oracle_tests;
mod surface;

pub(crate) use distance::{InverseDistance, Nearest};
pub(crate) use surface::{Biharmonic, DelaunayLinear, Laplace, NaturalNeighbour};

use super::task::SketchToTerrain;
use std::sync::Arc;

/// Every classical system with its best values, by name, from the simplest to the best.
#[must_use]
pub(crate) fn all() -> Vec<(&'static str, Arc<dyn SketchToTerrain>)> {
    vec![
        ("nearest", Arc::new(Nearest)),
        ("inverse-distance", Arc::new(InverseDistance::default())),
        ("laplace", Arc::new(Laplace)),
        ("biharmonic", Arc::new(Biharmonic)),
        ("delaunay-linear", Arc::new(DelaunayLinear)),
        ("natural-neighbour", Arc::new(NaturalNeighbour)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Stop;
    use crate::grid::Cell;
    use crate::seed::Seed;
    use crate::sketch::{LineMap, StrokeKind};

    fn lines(rows: usize, cols: usize, cells: &[(usize, usize, f32)]) -> LineMap {
        let mut map = LineMap::empty(rows, cols);
        for &(row, col, z) in cells {
            map.set(Cell::new(row, col), StrokeKind::Ridge, z);
        }
        map
    }

    /// Sketches that leave an interpolator without a triangle, without a second point, or without anything free.
    #[test]
    fn every_sketch_but_the_empty_one_is_answered() {
        let straight: Vec<(usize, usize, f32)> = (0..600).map(|row| (row, 2, row as f32)).collect();
        let all_cells: Vec<(usize, usize, f32)> =
            (0..35).map(|i| (i / 5, i % 5, (i * i % 13) as f32)).collect();
        let sketches = [
            lines(7, 5, &[(3, 3, 8.5)]),
            lines(7, 5, &[(3, 3, 8.5), (0, 4, -2.0)]),
            lines(7, 5, &[(1, 1, 1.0), (2, 2, 2.0), (3, 3, 3.0)]),
            lines(600, 5, &straight),
            lines(7, 5, &all_cells),
            lines(1, 1, &[(0, 0, 3.0)]),
            lines(1, 9, &[(0, 2, 3.0), (0, 7, 4.0)]),
        ];
        for (name, system) in all() {
            for sketch in &sketches {
                let got = system.generate(sketch, Seed(1), &Stop::new()).unwrap();
                assert_eq!(got.shape(), sketch.shape(), "{name}");
                for (cell, z) in got.cells() {
                    assert!(z.is_finite(), "{name} {cell:?}");
                    if sketch.kinds()[cell].is_some() {
                        assert_eq!(*z, sketch.heights()[cell], "{name} keeps its lines");
                    }
                }
            }
            let message =
                system.generate(&LineMap::empty(4, 4), Seed(1), &Stop::new()).unwrap_err().to_string();
            assert!(message.contains("line cells is 0"), "{name}: {message}");
        }
    }

    /// All but the plate stay between the lowest and the highest line.
    #[test]
    fn heights_stay_within_those_of_the_lines() {
        let cells: Vec<(usize, usize, f32)> =
            (0..60).map(|i| (i * 37 % 50, i * 61 % 40, (i * 29 % 17) as f32)).collect();
        let sketch = lines(50, 40, &cells);
        for (name, system) in all().into_iter().filter(|(name, _)| *name != "biharmonic") {
            let got = system.generate(&sketch, Seed(1), &Stop::new()).unwrap();
            assert!(got.as_slice().iter().all(|&z| (-1e-4..=16.0001).contains(&z)), "{name}");
        }
    }
}
