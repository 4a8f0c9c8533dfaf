//! Ways for water in terrain that is made with a style: drawn valleys keep their rivers, and what is dammed gets out.
//!
//! Beside a drawn valley the ground is raised to the level of its river where it lies lower, so that the river does not leave it for a
//! hollow alongside; then dams are cut ([`breach`]). Heights of strokes are kept to the bit.

use super::Style;
use crate::control::Stop;
use crate::error::Result;
use crate::grid::{Cell, Grid};
use crate::landscape::{BreachConfig, Breached, LandscapeFit, breach};
use crate::sketch::{Sketch, StrokeKind};
use crate::systems::landscape::LandscapeSystem;

/// Cells beside a drawn valley that are raised: as far as its river is looked for ([`Contract`](crate::metrics::Contract)).
const BANK: isize = 3;
/// Rise of a bank from cell to cell, relative to the relief of the terrain.
const RISE: f32 = 1e-4;

/// Where water is given ways out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drain {
    /// Where rivers made the exemplar.
    #[default]
    LikeExemplar,
    /// Whatever made the exemplar.
    Always,
    /// Nowhere.
    Never,
}

impl Style {
    /// The laws of the exemplar's landscape; none where the style keeps no terrain, or too little of it.
    pub fn landscape(&self) -> Option<LandscapeFit> {
        if let Some(system) = self.system::<LandscapeSystem>() {
            return Some(system.0.fit.clone());
        }
        let terrain = self.terrain.as_ref()?;
        LandscapeFit::of(terrain.heights(), terrain.valid(), terrain.cell_size().mean()).ok()
    }

    /// `terrain` (metres) with banks along the drawn valleys, and with its dams cut until no more of it lies in ponds than of the
    /// exemplar, or than .3 % where that is less. None where it is not to be drained.
    ///
    /// # Errors
    /// When the shapes differ, a height is not finite, or it is stopped.
    pub fn drained(
        &self,
        terrain: &Grid<f32>,
        sketch: &Sketch,
        drain: Drain,
        stop: &Stop,
    ) -> Result<Option<Breached>> {
        let fit = self.landscape();
        let is_wanted = match drain {
            Drain::LikeExemplar => fit.as_ref().is_some_and(LandscapeFit::is_fluvial),
            Drain::Always => true,
            Drain::Never => false,
        };
        // An exemplar full of closed hollows is no measure of what was asked for all the same.
        let config = match fit.filter(LandscapeFit::is_fluvial) {
            Some(fit) => BreachConfig::like(&fit),
            None => BreachConfig::default(),
        };
        let drained = || breach(&banked(terrain, sketch), &sketch.rasterize(), &config, stop);
        is_wanted.then(drained).transpose()
    }
}

/// The terrain with banks along the valleys of `sketch`. Around the lower end of a valley nothing is raised: there its river goes on.
fn banked(terrain: &Grid<f32>, sketch: &Sketch) -> Grid<f32> {
    let (rows, cols) = terrain.shape();
    let lines = sketch.rasterize();
    let range = terrain.as_slice().iter().fold((f32::MAX, f32::MIN), |(a, b), &z| (a.min(z), b.max(z)));
    let rise = RISE * (range.1 - range.0);
    // Squared distance to the nearest cell of a valley, and the level of its river; none at a lower end.
    let mut nearest: Grid<Option<(isize, Option<f32>)>> = Grid::filled(rows, cols, None);
    for stroke in sketch.strokes.iter().filter(|stroke| stroke.kind == StrokeKind::Valley) {
        let mut cells = stroke.cells(rows, cols);
        if cells.first().map(|c| c.1) > cells.last().map(|c| c.1) {
            cells.reverse();
        }
        let mut level = f32::MIN;
        for (i, (cell, z)) in cells.into_iter().enumerate() {
            // Where a valley rises on its way down, its river stands as high as what lies below.
            level = level.max(z as f32);
            for (down, right) in
                (-BANK..=BANK).flat_map(|down| (-BANK..=BANK).map(move |right| (down, right)))
            {
                let (Some(row), Some(col)) =
                    (cell.row.checked_add_signed(down), cell.col.checked_add_signed(right))
                else {
                    continue;
                };
                let distance = down * down + right * right;
                if row < rows && col < cols && distance <= BANK * BANK {
                    let known = &mut nearest[Cell::new(row, col)];
                    if known.is_none_or(|(other, _)| distance < other) {
                        *known = Some((distance, (i > 0).then_some(level)));
                    }
                }
            }
        }
    }
    let mut banked = terrain.clone();
    for (cell, known) in nearest.cells() {
        if let (Some((distance, Some(level))), None) = (*known, lines.kinds()[cell]) {
            banked[cell] = banked[cell].max(level + rise * (distance as f32).sqrt());
        }
    }
    banked
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Contract;
    use crate::sketch::{Stroke, Vertex};

    fn valley(points: &[(f64, f64, f64)]) -> Sketch {
        let vertices = points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect();
        Sketch::new(80, 60, vec![Stroke { kind: StrokeKind::Valley, vertices }]).unwrap()
    }

    /// Ground that falls to the south and more to the west: a river leaves any line across it.
    fn slope(sketch: &Sketch) -> Grid<f32> {
        let lines = sketch.rasterize();
        Grid::from_fn(80, 60, |c| match lines.kinds()[c] {
            Some(_) => lines.heights()[c],
            None => 2.0 * c.col as f32 + (80 - c.row) as f32,
        })
    }

    fn carries(terrain: &Grid<f32>, sketch: &Sketch) -> f64 {
        Contract::of(terrain, &terrain.map(|_| true), sketch).unwrap().strokes[0].carries.unwrap()
    }

    #[test]
    fn a_drawn_valley_keeps_its_river() {
        // On its way down it rises by 2 m in the middle; drawn upwards or downwards is all the same.
        let mut points = [(30.0, 79.0, 61.0), (31.0, 45.0, 97.0), (30.0, 35.0, 95.0), (30.0, 4.0, 140.0)];
        for _ in 0..2 {
            let sketch = valley(&points);
            let before = slope(&sketch);
            let after = banked(&before, &sketch);
            assert!(carries(&before, &sketch) < 0.5, "{}", carries(&before, &sketch));
            assert!(carries(&after, &sketch) > 0.95, "{}", carries(&after, &sketch));
            let lines = sketch.rasterize();
            for (cell, z) in after.cells() {
                let near =
                    lines.kinds().cells().any(|(c, kind)| kind.is_some() && c.distance_squared(cell) <= 9);
                assert!(*z >= before[cell] && (near || *z == before[cell]), "{cell:?}");
                assert!(lines.kinds()[cell].is_none() || *z == before[cell], "{cell:?}");
            }
            points.reverse();
        }
    }

    #[test]
    fn the_lower_end_is_left_open() {
        let sketch = valley(&[(30.0, 40.0, 100.0), (30.0, 4.0, 136.0)]);
        let before = slope(&sketch);
        let after = banked(&before, &sketch);
        assert_eq!(after[Cell::new(42, 29)], before[Cell::new(42, 29)]);
        assert!(after[Cell::new(20, 28)] > before[Cell::new(20, 28)]);
    }
}
