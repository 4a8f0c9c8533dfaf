//! The smoothest surfaces through known cells: membranes and thin plates.
//!
//! A mask of known cells and their values -> a value at every cell. With L the five-point Laplacian of the raster, free
//! (Neumann) at the frame, and u fixed at the known cells, the other cells solve L u = 0 ([`harmonic`]) or L^2 u = 0
//! ([`biharmonic`]). The raster is connected, so one known cell is enough for a unique answer; voids are not part of it.
//!
//! Cost: a direct solver needs more than linear time and memory; here conjugate gradients with a multigrid V-cycle
//! (`multigrid/`) take about 10 steps for the membrane whatever the size and the lines, which is 0.5 s at 1024x1024 on two
//! cores, and some 200 bytes a cell. The plate takes 15 to 50 steps (1 to 2 s at 1024x1024), but where lines leave regions
//! D cells wide empty the number grows with D: a line is a hinge there, which coarse rasters cannot turn (1024x1024 with
//! one ring of 700 cells diameter: 120 steps, 3 to 5 s).

use super::multigrid::{Energy, solve};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};

/// The membrane: Laplace's equation at the unknown cells. Values outside `known` are not read; known cells keep theirs to
/// the bit; the answer lies between the lowest and the highest known value (up to the solver's tolerance).
///
/// Residual: 1e-10 of the initial one, checked.
///
/// # Errors
/// When the shapes differ, nothing is known, or a known value is not finite.
pub fn harmonic(known: &Mask, values: &Grid<f64>) -> Result<Grid<f64>> {
    harmonic_until(known, values, &Stop::new())
}

/// As [`harmonic`], unless it is stopped.
///
/// # Errors
/// As there, and when it is stopped.
pub fn harmonic_until(known: &Mask, values: &Grid<f64>, stop: &Stop) -> Result<Grid<f64>> {
    surface(Energy::Membrane, known, values, stop)
}

/// The thin plate: the squared Laplacian at the unknown cells. Smoother across lines than [`harmonic`], and not bounded by
/// the known values.
///
/// Residual: 1e-10 of the initial one, checked.
///
/// # Errors
/// When the shapes differ, nothing is known, a known value is not finite, or the solver does not reach its tolerance.
pub fn biharmonic(known: &Mask, values: &Grid<f64>) -> Result<Grid<f64>> {
    biharmonic_until(known, values, &Stop::new())
}

/// As [`biharmonic`], unless it is stopped.
///
/// # Errors
/// As there, and when it is stopped.
pub fn biharmonic_until(known: &Mask, values: &Grid<f64>, stop: &Stop) -> Result<Grid<f64>> {
    surface(Energy::Plate, known, values, stop)
}

fn surface(energy: Energy, known: &Mask, values: &Grid<f64>, stop: &Stop) -> Result<Grid<f64>> {
    if known.shape() != values.shape() {
        return Err(Error::value(
            "mask of known cells",
            format!("{:?}", known.shape()),
            format!("the values are {:?}", values.shape()),
        ));
    }
    let mut known_values = values.cells().zip(known.as_slice()).filter(|(_, known)| **known).peekable();
    if known_values.peek().is_none() {
        return Err(Error::value("number of known cells", 0, "interpolation needs at least one"));
    }
    if let Some(((cell, value), _)) = known_values.find(|((_, value), _)| !value.is_finite()) {
        return Err(Error::value(
            format!("known value at row {}, column {}", cell.row, cell.col),
            value,
            "allowed: finite",
        ));
    }
    solve(energy, known, values, stop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use proptest::prelude::*;

    /// The surface by elimination on the full matrix.
    fn by_elimination(order: u32, known: &Mask, values: &Grid<f64>) -> Vec<f64> {
        let (rows, cols) = known.shape();
        let n = rows * cols;
        let mut laplacian = vec![vec![0.0_f64; n]; n];
        for (i, row) in laplacian.iter_mut().enumerate() {
            let adjacent = |j: &usize| (i / cols).abs_diff(j / cols) + (i % cols).abs_diff(j % cols) == 1;
            for j in (0..n).filter(adjacent) {
                row[j] -= 1.0;
                row[i] += 1.0;
            }
        }
        let mut a = laplacian.clone();
        if order == 2 {
            for i in 0..n {
                for j in 0..n {
                    a[i][j] = (0..n).map(|k| laplacian[i][k] * laplacian[k][j]).sum();
                }
            }
        }
        let mut x: Vec<f64> = vec![0.0; n];
        for i in (0..n).filter(|&i| known.as_slice()[i]) {
            a[i] = vec![0.0; n];
            a[i][i] = 1.0;
            x[i] = values.as_slice()[i];
        }
        for k in 0..n {
            let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap();
            a.swap(k, pivot);
            x.swap(k, pivot);
            let (above, below) = a.split_at_mut(k + 1);
            for (i, row) in below.iter_mut().enumerate().filter(|(_, row)| row[k] != 0.0) {
                let factor = row[k] / above[k][k];
                row.iter_mut().zip(&above[k]).skip(k).for_each(|(entry, pivot)| *entry -= factor * pivot);
                x[k + 1 + i] -= factor * x[k];
            }
        }
        for k in (0..n).rev() {
            let rest: f64 = (k + 1..n).map(|j| a[k][j] * x[j]).sum();
            x[k] = (x[k] - rest) / a[k][k];
        }
        x
    }

    fn problems() -> impl Strategy<Value = (Mask, Grid<f64>)> {
        (1usize..15, 1usize..15, 0.02f64..0.98).prop_flat_map(|(rows, cols, share)| {
            let cells = proptest::collection::vec((0.0f64..1.0, -50.0f64..80.0), rows * cols);
            (cells, 0..rows * cols).prop_map(move |(cells, sure)| {
                let known = cells.iter().enumerate().map(|(i, cell)| i == sure || cell.0 < share).collect();
                let values = cells.into_iter().map(|cell| cell.1).collect();
                (Grid::from_vec(rows, cols, known).unwrap(), Grid::from_vec(rows, cols, values).unwrap())
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        #[test]
        fn surfaces_are_those_of_elimination((known, values) in problems()) {
            for order in [1, 2] {
                let surface = if order == 1 { harmonic } else { biharmonic };
                let got = surface(&known, &values).unwrap();
                let want = by_elimination(order, &known, &values);
                for (i, (got, want)) in got.as_slice().iter().zip(&want).enumerate() {
                    if known.as_slice()[i] {
                        prop_assert_eq!(*got, values.as_slice()[i]);
                    }
                    prop_assert!((got - want).abs() < 1e-6, "order {} cell {}: {} and {}", order, i, got, want);
                }
            }
        }
    }

    /// A closed curve and a dot: wide empty regions, so that every level of the hierarchy works.
    fn sparse(rows: usize, cols: usize) -> (Mask, Grid<f64>) {
        let known = Mask::from_fn(rows, cols, |c| {
            let (y, x) = (c.row as f64 / rows as f64 - 0.5, c.col as f64 / cols as f64 - 0.4);
            ((y * y + x * x).sqrt() - 0.3).abs() < 0.7 / rows.min(cols) as f64 || (c.row == 3 && c.col == 4)
        });
        (known, Grid::from_fn(rows, cols, |c| 1000.0 + (c.row as f64 * 0.05).sin() * 200.0 + c.col as f64))
    }

    #[test]
    fn a_membrane_between_two_walls_is_a_ramp() {
        for cols in [2, 3, 64, 257] {
            let known = Mask::from_fn(70, cols, |c| c.col == 0 || c.col + 1 == cols);
            let values = Grid::from_fn(70, cols, |c| if c.col == 0 { 3.0 } else { 11.0 });
            let got = harmonic(&known, &values).unwrap();
            for (cell, z) in got.cells() {
                let want = 3.0 + 8.0 * cell.col as f64 / (cols - 1) as f64;
                assert!((z - want).abs() < 1e-7, "{cols}: {cell:?} {z} {want}");
            }
        }
    }

    #[test]
    fn large_sparse_surfaces_obey_the_equation() {
        let (known, values) = sparse(300, 211);
        let on_lines =
            || values.as_slice().iter().zip(known.as_slice()).filter(|(_, k)| **k).map(|(v, _)| *v);
        let (low, high) = on_lines().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        let laplacian = |u: &Grid<f64>, cell: Cell| -> f64 {
            [0, 2, 4, 6]
                .iter()
                .filter_map(|&d| crate::grid::d8::neighbour(cell, d, 300, 211))
                .map(|n| u[cell] - u[n])
                .sum()
        };
        let membrane = harmonic(&known, &values).unwrap();
        let plate = biharmonic(&known, &values).unwrap();
        let bent = Grid::from_fn(300, 211, |cell| laplacian(&plate, cell));
        for (cell, _) in known.cells().filter(|(_, known)| !**known) {
            assert!(laplacian(&membrane, cell).abs() < 1e-6, "membrane at {cell:?}");
            assert!(laplacian(&bent, cell).abs() < 1e-6, "plate at {cell:?}");
            assert!(membrane[cell] > low - 1e-6 && membrane[cell] < high + 1e-6);
        }
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        let (known, values) = sparse(260, 300);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| (harmonic(&known, &values).unwrap(), biharmonic(&known, &values).unwrap()))
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(5));
    }

    #[test]
    fn edge_cases() {
        let values = Grid::from_fn(4, 5, |c| c.row as f64 + 0.1 * c.col as f64);
        let all = Mask::filled(4, 5, true);
        assert_eq!(harmonic(&all, &values).unwrap(), values);
        assert_eq!(biharmonic(&all, &values).unwrap(), values);
        let none = Mask::filled(4, 5, false);
        assert!(harmonic(&none, &values).unwrap_err().to_string().contains("known cells is 0"));
        let one = Mask::from_fn(4, 5, |c| c.row == 2 && c.col == 2);
        assert!(biharmonic(&one, &values).unwrap().as_slice().iter().all(|&z| z == 2.2));
        let bad = values.map(|&z| if z == 2.2 { f64::NAN } else { z });
        assert!(harmonic(&one, &bad).unwrap_err().to_string().contains("row 2, column 2"));
        assert!(harmonic(&one, &Grid::filled(4, 4, 0.0)).is_err());
    }

    /// Terrain of whole metres, as files have it.
    fn rough(c: Cell) -> f64 {
        let noise = (c.row * 7919 + c.col * 104_729) % 97;
        (1800.0 + 300.0 * (c.row as f64 * 0.11).sin() + 200.0 * (c.col as f64 * 0.17).cos() + noise as f64)
            .round()
    }

    /// On coarse rasters a single free cell makes four that are multiples of each other: a singular matrix.
    #[test]
    fn a_single_unknown_cell_anywhere_is_found() {
        let (rows, cols) = (92, 74);
        let values = Grid::from_fn(rows, cols, rough);
        for void in values.cells().map(|(cell, _)| cell).step_by(97).collect::<Vec<_>>() {
            let known = Mask::from_fn(rows, cols, |c| c != void);
            let found = harmonic(&known, &values).unwrap_or_else(|e| panic!("{void:?}: {e}"));
            let beside =
                values.cells().filter(|(c, _)| c.row.abs_diff(void.row) + c.col.abs_diff(void.col) == 1);
            let beside: Vec<f64> = beside.map(|(_, z)| *z).collect();
            let mean = beside.iter().sum::<f64>() / beside.len() as f64;
            assert!((found[void] - mean).abs() < 1e-9, "{void:?}: {} {mean}", found[void]);
            biharmonic(&known, &values).unwrap_or_else(|e| panic!("{void:?}: {e}"));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Any share of unknown cells, anywhere; heights far from 0 with little relief among them.
        #[test]
        fn unknown_cells_anywhere_are_found(
            (rows, cols) in (2usize..40, 2usize..40),
            share in 0.0..0.6f64,
            relief in prop_oneof![Just(1.0), Just(1e-6), Just(0.0)],
            seed in any::<u32>(),
        ) {
            let lot = |c: Cell| {
                let mixed = (c.row as u32 * 131 + c.col as u32 + 1).wrapping_mul(seed | 1).wrapping_mul(2_654_435_761);
                f64::from(mixed >> 8) / f64::from(1u32 << 24)
            };
            let values = Grid::from_fn(rows, cols, |c| 4000.0 + relief * rough(c));
            let known = Mask::from_fn(rows, cols, |c| c == Cell::new(0, 0) || lot(c) >= share);
            let found = harmonic(&known, &values).map_err(|e| TestCaseError::fail(e.to_string()))?;
            biharmonic(&known, &values).map_err(|e| TestCaseError::fail(e.to_string()))?;
            let of_known = values.as_slice().iter().zip(known.as_slice()).filter(|(_, k)| **k).map(|(z, _)| *z);
            let (low, high) = of_known.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
            prop_assert!(found.as_slice().iter().all(|z| (low - 1e-6..=high + 1e-6).contains(z)));
        }
    }
}
