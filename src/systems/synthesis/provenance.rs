//! Where every cell of a synthesis comes from.

use super::source::Source;
use crate::grid::Grid;
use crate::metrics::{Origin, Provenance};
use crate::sketch::LineMap;

/// Sources as cells of the exemplar; strokes come from the drawing.
pub(super) fn provenance(sources: &Grid<Source>, lines: &LineMap) -> Provenance {
    let (rows, cols) = sources.shape();
    Provenance::new(Grid::from_fn(rows, cols, |c| {
        if lines.kinds()[c].is_some() {
            return Origin::Stroke;
        }
        let source = sources[c];
        Origin::Exemplar { cell: source.cell(), symmetry: source.turn }
    }))
}

#[cfg(test)]
mod tests {
    use super::super::source::{TURNS, step};
    use super::*;

    #[test]
    fn symmetries_are_those_that_are_documented() {
        for turn in 0..TURNS {
            for (down, right) in [(1, 0), (0, 1), (-3, 2)] {
                assert_eq!(step(turn, down, right), Provenance::step(turn, down, right), "symmetry {turn}");
            }
        }
    }
}
