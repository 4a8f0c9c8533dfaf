//! Whether terrain does what its sketch asks.

use super::check_one;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask};
use crate::sketch::{LineMap, StrokeKind};

/// Root mean square difference between the terrain and the lines' heights at valid line cells, in the unit of the heights;
/// `None` when no line cell is valid.
///
/// # Errors
/// When the shapes differ or a valid height is not finite.
pub(crate) fn stroke_height_error(output: &Grid<f32>, valid: &Mask, lines: &LineMap) -> Result<Option<f64>> {
    check_one("output", output, valid)?;
    check_lines("sketch", lines, valid.shape())?;
    let (mut sum, mut count) = (0.0, 0usize);
    for (cell, _) in lines.kinds().cells().filter(|(cell, kind)| kind.is_some() && valid[*cell]) {
        sum += (f64::from(output[cell]) - f64::from(lines.heights()[cell])).powi(2);
        count += 1;
    }
    Ok((count > 0).then(|| (sum / count as f64).sqrt()))
}

/// How well lines that were found again in the terrain agree with those that were asked for.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LineAgreement {
    /// Share of the found cells that lie near an asked cell; 1 when none was found.
    pub(crate) precision: f64,
    /// Share of the asked cells that lie near a found cell; 1 when none was asked for.
    pub(crate) recall: f64,
}

impl LineAgreement {
    /// Harmonic mean of precision and recall; 0 when both are 0.
    #[must_use]
    pub(crate) fn f1(self) -> f64 {
        let sum = self.precision + self.recall;
        if sum > 0.0 { 2.0 * self.precision * self.recall / sum } else { 0.0 }
    }
}

/// Agreement of the lines of one kind, where *near* is at most `tolerance` cells between centres; `None` when neither map
/// has a line of that kind.
///
/// # Errors
/// When the shapes differ or `tolerance` is negative or not finite.
pub(crate) fn line_agreement(
    asked: &LineMap,
    found: &LineMap,
    kind: StrokeKind,
    tolerance: f64,
) -> Result<Option<LineAgreement>> {
    check_lines("lines found again", found, asked.shape())?;
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        return Err(Error::value("line tolerance", tolerance, "allowed: 0 cells or more"));
    }
    let (asked, found) = (asked.mask_of(kind), found.mask_of(kind));
    if !asked.as_slice().contains(&true) && !found.as_slice().contains(&true) {
        return Ok(None);
    }
    Ok(Some(LineAgreement {
        precision: share_near(&found, &asked, tolerance),
        recall: share_near(&asked, &found, tolerance),
    }))
}

/// Share of the cells of `of` within `tolerance` of a cell of `to`; 1 when `of` is empty.
pub(super) fn share_near(of: &Mask, to: &Mask, tolerance: f64) -> f64 {
    let reach = tolerance.floor() as usize;
    let near = |cell: Cell| {
        let rows = cell.row.saturating_sub(reach)..=cell.row.saturating_add(reach).min(to.rows() - 1);
        let cols = cell.col.saturating_sub(reach)..=cell.col.saturating_add(reach).min(to.cols() - 1);
        rows.flat_map(|row| cols.clone().map(move |col| Cell { row, col }))
            .any(|other| to[other] && cell.distance_squared(other) as f64 <= tolerance * tolerance)
    };
    let (mut hits, mut count) = (0usize, 0usize);
    for (cell, _) in of.cells().filter(|(_, line)| **line) {
        count += 1;
        hits += usize::from(near(cell));
    }
    if count == 0 { 1.0 } else { hits as f64 / count as f64 }
}

pub(super) fn check_lines(name: &str, lines: &LineMap, shape: (usize, usize)) -> Result<()> {
    if lines.shape() == shape {
        Ok(())
    } else {
        Err(Error::value(name, format!("{:?}", lines.shape()), format!("the raster is {shape:?}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(col: usize, rows: std::ops::Range<usize>, kind: StrokeKind) -> LineMap {
        let mut lines = LineMap::empty(20, 20);
        rows.for_each(|row| lines.set(Cell::new(row, col), kind, 0.5));
        lines
    }

    #[test]
    fn lines_within_two_cells_agree() {
        use StrokeKind::{Ridge, Valley};
        let asked = column(5, 0..20, Ridge);
        let at = |found: &LineMap| line_agreement(&asked, found, Ridge, 2.0).unwrap().unwrap();
        assert_eq!(at(&asked).f1(), 1.0);
        assert_eq!(at(&column(7, 0..20, Ridge)).f1(), 1.0);
        assert_eq!(at(&column(8, 0..20, Ridge)).f1(), 0.0);
        // Half of the line: all that is found was asked for; ten cells and two more are near it.
        let half = at(&column(5, 0..10, Ridge));
        assert_eq!((half.precision, half.recall), (1.0, 0.6));
        assert!((half.f1() - 0.75).abs() < 1e-12);
        let nothing = at(&LineMap::empty(20, 20));
        assert_eq!((nothing.precision, nothing.recall, nothing.f1()), (1.0, 0.0, 0.0));
        assert_eq!(at(&column(5, 0..20, Valley)).f1(), 0.0);
        assert!(line_agreement(&asked, &asked, Valley, 2.0).unwrap().is_none());
        assert!(line_agreement(&asked, &LineMap::empty(3, 3), Ridge, 2.0).is_err());
        assert!(line_agreement(&asked, &asked, Ridge, -1.0).is_err());
    }

    #[test]
    fn diagonal_steps_count_their_length() {
        let dot = |row, col| {
            let mut lines = LineMap::empty(9, 9);
            lines.set(Cell::new(row, col), StrokeKind::Ridge, 0.0);
            lines
        };
        let f1 = |found: LineMap| {
            line_agreement(&dot(4, 4), &found, StrokeKind::Ridge, 2.0).unwrap().unwrap().f1()
        };
        assert_eq!((f1(dot(5, 5)), f1(dot(4, 6)), f1(dot(5, 6))), (1.0, 1.0, 0.0));
    }

    #[test]
    fn stroke_heights_are_read_at_valid_line_cells() {
        let lines = column(5, 0..4, StrokeKind::Valley);
        let mut output = Grid::filled(20, 20, 0.9);
        (0..4).for_each(|row| output[Cell::new(row, 5)] = [0.5, 0.8, 0.5, 7.0][row]);
        let mut valid = Mask::filled(20, 20, true);
        valid[Cell::new(3, 5)] = false;
        let error = stroke_height_error(&output, &valid, &lines).unwrap().unwrap();
        assert!((error - (0.09f64 / 3.0).sqrt()).abs() < 1e-6);
        assert_eq!(stroke_height_error(&output, &valid, &LineMap::empty(20, 20)).unwrap(), None);
    }
}
