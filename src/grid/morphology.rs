//! Dilation, erosion and closing with a square.
//!
//! Mask -> mask. The square has side 2 `radius` + 1; past the frame there is nothing to find and nothing to miss
//! (windows are cut at the frame). Separable running counts: time and memory linear in the cells, whatever the radius.

use super::Mask;
use rayon::prelude::*;

/// True where any cell within `radius` rows and columns is true.
#[must_use]
pub(crate) fn dilate(mask: &Mask, radius: usize) -> Mask {
    separable(mask, radius, |count, _| count > 0)
}

/// True where every cell within `radius` rows and columns is true.
#[must_use]
pub(crate) fn erode(mask: &Mask, radius: usize) -> Mask {
    separable(mask, radius, |count, window| count == window)
}

/// Dilation, then erosion: bridges gaps up to 2 `radius` cells wide; never removes a cell.
#[must_use]
pub(crate) fn close(mask: &Mask, radius: usize) -> Mask {
    if radius == 0 { mask.clone() } else { erode(&dilate(mask, radius), radius) }
}

/// Applies `keep(true cells, cells)` of the window along rows, then along columns.
fn separable(mask: &Mask, radius: usize, keep: impl Fn(usize, usize) -> bool + Sync) -> Mask {
    let (rows, cols) = mask.shape();
    let mut across = mask.clone();
    across.as_mut_slice().par_chunks_mut(cols).zip(mask.as_slice().par_chunks(cols)).for_each(
        |(out, line)| {
            let mut count = line[..radius.min(cols)].iter().filter(|&&v| v).count();
            for col in 0..cols {
                count += usize::from(col + radius < cols && line[col + radius]);
                count -= usize::from(col > radius && line[col - radius - 1]);
                out[col] = keep(count, (col + radius).min(cols - 1) - col.saturating_sub(radius) + 1);
            }
        },
    );

    // Down the columns by bands of rows, each band counting its own first window.
    let band = rows.div_ceil(rayon::current_num_threads()).max(64);
    let source = across.as_slice();
    let mut down = mask.clone();
    down.as_mut_slice().par_chunks_mut(cols * band).enumerate().for_each(|(index, out)| {
        let first = index * band;
        let mut counts = vec![0usize; cols];
        let add = |counts: &mut [usize], row: usize| {
            for (count, &v) in counts.iter_mut().zip(&source[row * cols..(row + 1) * cols]) {
                *count += usize::from(v);
            }
        };
        for row in first.saturating_sub(radius)..(first + radius).min(rows) {
            add(&mut counts, row);
        }
        for (line, row) in out.chunks_mut(cols).zip(first..) {
            if row + radius < rows {
                add(&mut counts, row + radius);
            }
            if row > first && row > radius {
                let gone = row - radius - 1;
                for (count, &v) in counts.iter_mut().zip(&source[gone * cols..(gone + 1) * cols]) {
                    *count -= usize::from(v);
                }
            }
            let window = (row + radius).min(rows - 1) - row.saturating_sub(radius) + 1;
            for (out, &count) in line.iter_mut().zip(&counts) {
                *out = keep(count, window);
            }
        }
    });
    down
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, Grid};
    use proptest::prelude::*;

    fn brute(mask: &Mask, radius: usize, all: bool) -> Mask {
        Grid::from_fn(mask.rows(), mask.cols(), |c| {
            let mut window = mask
                .cells()
                .filter(|(o, _)| o.row.abs_diff(c.row) <= radius && o.col.abs_diff(c.col) <= radius)
                .map(|(_, &v)| v);
            if all { window.all(|v| v) } else { window.any(|v| v) }
        })
    }

    proptest! {
        #[test]
        fn equals_the_definition(rows in 1usize..90, cols in 1usize..12, radius in 0usize..4, seed in any::<u64>()) {
            let mask = Grid::from_fn(rows, cols, |c| {
                let turned = seed.rotate_left((c.row * 13 + c.col * 7) as u32);
                (turned ^ (c.row * c.col) as u64).is_multiple_of(3)
            });
            prop_assert_eq!(dilate(&mask, radius), brute(&mask, radius, false));
            prop_assert_eq!(erode(&mask, radius), brute(&mask, radius, true));
            let closed = close(&mask, radius);
            for (cell, &v) in mask.cells() {
                prop_assert!(!v || closed[cell]);
            }
        }
    }

    #[test]
    fn closing_bridges_a_gap_of_two_and_not_of_three() {
        let row = |gap: usize| {
            let mask = Grid::from_fn(7, 20, |c| c.row == 3 && !(8..8 + gap).contains(&c.col));
            close(&mask, 1)[Cell::new(3, 9)]
        };
        assert!(row(2));
        assert!(!row(3));
    }
}
