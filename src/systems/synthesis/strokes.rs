//! Strokes as the synthesis reads them: how long they are, displaced a little, and at every size of the pyramid.

use super::config::GuideConfig;
use crate::error::Result;
use crate::grid::{Cell, Grid, distance};
use crate::interpolation::harmonic;
use crate::seed::Seed;
use crate::sketch::{Displacement, LineMap, Sketch, StrokeKind};

/// Length of a line over its number of cells, in the mean over its directions: 4 / pi ln(1 + sqrt 2).
const LENGTH_OF_CELL: f64 = 1.122;
/// Standard deviation of the field that displaces strokes, cells.
const WARP_SIGMA: f64 = 7.0;
/// Kinds in the order of the arrays here.
pub(super) const KINDS: [StrokeKind; 2] = [StrokeKind::Ridge, StrokeKind::Valley];

/// Lines of each kind that a self-sketch gets on 256x256 cells so that it is drawn as `lines` is: one for every `line_length`
/// cells, at least one of a kind that is drawn at all.
pub(super) fn density(lines: &LineMap, line_length: f64, most: usize) -> [usize; 2] {
    let (rows, cols) = lines.shape();
    KINDS.map(|kind| {
        let cells = lines.kinds().as_slice().iter().filter(|k| **k == Some(kind)).count();
        if cells == 0 {
            return 0;
        }
        let length = cells as f64 * LENGTH_OF_CELL * 65_536.0 / (rows * cols) as f64;
        ((length / line_length).round() as usize).clamp(1, most)
    })
}

/// The lines displaced by a smooth random field of this root mean square: what is drawn is a simplified trace.
///
/// # Errors
/// Never for lines that a raster holds.
pub(super) fn displaced(lines: &LineMap, amount: f64, seed: Seed) -> Result<LineMap> {
    if amount == 0.0 {
        return Ok(lines.clone());
    }
    let mut sketch = Sketch::trace(lines);
    Displacement::new(lines.shape(), WARP_SIGMA, amount, seed).apply(&mut sketch, 0.0);
    sketch.validate()?;
    Ok(sketch.rasterize())
}

/// The strokes at one size.
pub(super) struct LevelStrokes {
    pub(super) shape: (usize, usize),
    /// (cell, mean height, index of [`KINDS`]); a cell of both kinds is there twice.
    pub(super) cells: Vec<(Cell, f32, usize)>,
}

impl LevelStrokes {
    /// The strokes of `lines`, whose cells are 1/`factor` of this size, on a raster of `shape`.
    pub(super) fn new(lines: &LineMap, factor: usize, shape: (usize, usize)) -> Self {
        let mut sums = Grid::filled(shape.0, shape.1, [(0.0f64, 0u32); 2]);
        for (cell, kind) in lines.kinds().cells() {
            if let Some(kind) = kind {
                let at =
                    Cell::new((cell.row / factor).min(shape.0 - 1), (cell.col / factor).min(shape.1 - 1));
                let (sum, count) = &mut sums[at][usize::from(*kind == KINDS[1])];
                *sum += f64::from(lines.heights()[cell]);
                *count += 1;
            }
        }
        let mut cells = Vec::new();
        for kind in 0..KINDS.len() {
            let there = sums.cells().filter(|(_, both)| both[kind].1 > 0);
            cells.extend(there.map(|(c, both)| (c, (both[kind].0 / f64::from(both[kind].1)) as f32, kind)));
        }
        Self { shape, cells }
    }

    /// Nearness of ridges and of valleys: 1 on them, 1/e at the distance of the configuration.
    pub(super) fn nearness(&self, config: &GuideConfig) -> [Grid<f32>; 2] {
        [0, 1].map(|kind| {
            let mut mask = Grid::filled(self.shape.0, self.shape.1, false);
            self.cells.iter().filter(|c| c.2 == kind).for_each(|(cell, ..)| mask[*cell] = true);
            distance::squared(&mask).map(|&d| {
                if d == distance::NOWHERE {
                    0.0
                } else {
                    (-f64::from(d).sqrt() / config.nearness).exp() as f32
                }
            })
        })
    }

    /// The membrane through the strokes; where a cell has both kinds, through their mean.
    ///
    /// # Errors
    /// When there is no stroke.
    pub(super) fn membrane(&self) -> Result<Grid<f32>> {
        let mut sums = Grid::filled(self.shape.0, self.shape.1, (0.0f64, 0u32));
        for (cell, height, _) in &self.cells {
            let (sum, count) = &mut sums[*cell];
            *sum += f64::from(*height);
            *count += 1;
        }
        let known = sums.map(|(_, count)| *count > 0);
        let values = sums.map(|(sum, count)| sum / f64::from((*count).max(1)));
        Ok(harmonic(&known, &values)?.map(|z| *z as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cross() -> LineMap {
        let mut lines = LineMap::empty(64, 64);
        for i in 0..64 {
            lines.set(Cell::new(20, i), StrokeKind::Ridge, 10.0);
        }
        for i in 0..64 {
            lines.set(Cell::new(i, 33), StrokeKind::Valley, 2.0);
        }
        lines
    }

    #[test]
    fn density_counts_length_per_area() {
        // 63 cells of a ridge on a sixteenth of 256x256.
        assert_eq!(density(&cross(), 140.0, 12), [8, 8]);
        assert_eq!(density(&cross(), 140.0, 5), [5, 5]);
        assert_eq!(density(&cross(), 1e6, 12), [1, 1]);
        assert_eq!(density(&LineMap::empty(9, 9), 140.0, 12), [0, 0]);
    }

    #[test]
    fn displacement_is_small_smooth_and_seeded() {
        let lines = cross();
        let moved = displaced(&lines, 1.0, Seed(1)).unwrap();
        assert_eq!(displaced(&lines, 0.0, Seed(1)).unwrap(), lines);
        assert_ne!(moved, lines);
        assert_ne!(moved, displaced(&lines, 1.0, Seed(2)).unwrap());
        let near = distance::squared(&lines.mask());
        for (cell, kind) in moved.kinds().cells().filter(|(_, k)| k.is_some()) {
            assert!(near[cell] <= 25, "{cell:?} {kind:?}");
        }
    }

    #[test]
    fn a_coarse_cell_has_the_mean_of_its_strokes() {
        let level = LevelStrokes::new(&cross(), 4, (16, 16));
        let at = |cell: Cell| level.cells.iter().filter(|c| c.0 == cell).count();
        assert_eq!(at(Cell::new(5, 8)), 2);
        assert_eq!(at(Cell::new(5, 3)), 1);
        assert_eq!(level.cells.len(), 32);
        let membrane = level.membrane().unwrap();
        assert_eq!(membrane[Cell::new(5, 8)], 6.0);
        let [ridges, valleys] = level.nearness(&crate::systems::synthesis::SynthesisConfig::default().guide);
        assert_eq!((ridges[Cell::new(5, 0)], valleys[Cell::new(0, 8)]), (1.0, 1.0));
        assert!((ridges[Cell::new(8, 0)] - (-2.0f32).exp()).abs() < 1e-6);
    }
}
