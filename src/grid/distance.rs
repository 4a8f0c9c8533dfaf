//! Exact Euclidean distance to a mask.
//!
//! Mask -> squared distances in cells. Two separable passes (Meijster, Roerdink and Hesselink 2000), the second one by the
//! lower envelope of parabolas (Felzenszwalb and Huttenlocher 2012). Linear in the cells; rows in parallel.

use super::{Grid, Mask};
use rayon::prelude::*;

/// Squared distance that stands for "there is no such cell".
pub(crate) const NOWHERE: u32 = u32::MAX;

/// Squared distance from every cell to the nearest true cell of `mask`, centre to centre, in cells; [`NOWHERE`]
/// everywhere when the mask is empty.
///
/// # Panics
/// When a side has more than 32,768 cells (the square of the diagonal would not fit).
#[must_use]
pub(crate) fn squared(mask: &Mask) -> Grid<u32> {
    let (rows, cols) = mask.shape();
    assert!(rows.max(cols) <= 1 << 15, "sides up to 32,768 cells");
    let mut out = Grid::filled(rows, cols, NOWHERE);

    // Distance along the column, walking down and then up.
    let flat = out.as_mut_slice();
    for (i, &on) in mask.as_slice().iter().enumerate() {
        flat[i] = match (on, i.checked_sub(cols)) {
            (true, _) => 0,
            (false, Some(above)) => flat[above].saturating_add(1),
            (false, None) => NOWHERE,
        };
    }
    for i in (0..flat.len() - cols).rev() {
        flat[i] = flat[i].min(flat[i + cols].saturating_add(1));
    }

    flat.par_chunks_mut(cols).for_each_init(
        || (Vec::new(), Vec::new()),
        |(heights, hull), line| {
            lower_envelope(line, heights, hull);
        },
    );
    out
}

/// A parabola of the lower envelope: its column and the first column where it is the lowest.
struct Arc {
    apex: usize,
    from: usize,
}

/// Replaces distances along columns by squared distances in the plane.
fn lower_envelope(line: &mut [u32], heights: &mut Vec<u64>, hull: &mut Vec<Arc>) {
    heights.clear();
    heights.extend(line.iter().map(|&d| if d == NOWHERE { u64::MAX } else { u64::from(d) * u64::from(d) }));
    hull.clear();
    let value = |col: usize, apex: usize| heights[apex] + (col.abs_diff(apex) as u64).pow(2);
    for apex in (0..line.len()).filter(|&c| heights[c] != u64::MAX) {
        while hull.last().is_some_and(|arc| value(arc.from, arc.apex) > value(arc.from, apex)) {
            hull.pop();
        }
        // First column at which the new parabola is strictly lower than the last one.
        let from = match hull.last() {
            None => 0,
            Some(last) => {
                let (a, b) = (last.apex as i64, apex as i64);
                let rise = b * b - a * a + heights[apex] as i64 - heights[last.apex] as i64;
                (rise.div_euclid(2 * (b - a)) + 1).max(0) as usize
            }
        };
        if from < line.len() {
            hull.push(Arc { apex, from });
        }
    }
    for (k, arc) in hull.iter().enumerate() {
        let end = hull.get(k + 1).map_or(line.len(), |next| next.from);
        for (d, col) in line[arc.from..end].iter_mut().zip(arc.from..) {
            *d = value(col, arc.apex) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_brute_force(
            rows in 1usize..20, cols in 1usize..20,
            values in proptest::collection::vec(any::<u8>(), 400), rarity in 1u8..60,
        ) {
            let mask = Grid::from_fn(rows, cols, |c| values[c.row * 20 + c.col] % rarity == 0);
            let found = squared(&mask);
            for (cell, &d) in found.cells() {
                let nearest = mask.cells().filter(|(_, v)| **v).map(|(o, _)| cell.distance_squared(o) as u32).min();
                prop_assert_eq!(d, nearest.unwrap_or(NOWHERE));
            }
        }
    }

    #[test]
    fn an_empty_mask_is_nowhere() {
        assert!(squared(&Grid::filled(3, 4, false)).as_slice().iter().all(|&d| d == NOWHERE));
    }
}
