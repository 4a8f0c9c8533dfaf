//! Surfaces through known cells: harmonic and biharmonic.

use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};

/// Laplace.
///
/// # Errors
/// When nothing is known, a known value is not finite, or the shapes differ.
pub fn harmonic(known: &Mask, values: &Grid<f64>) -> Result<Grid<f64>> {
    solve(known, values, 1)
}

/// Biharmonic.
///
/// # Errors
/// When nothing is known, a known value is not finite, or the shapes differ.
pub fn biharmonic(known: &Mask, values: &Grid<f64>) -> Result<Grid<f64>> {
    solve(known, values, 2)
}

fn laplacian(rows: usize, cols: usize, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for r in 0..rows {
        for c in 0..cols {
            let i = r * cols + c;
            let mut s = 0.0;
            if r > 0 {
                s += x[i] - x[i - cols];
            }
            if r + 1 < rows {
                s += x[i] - x[i + cols];
            }
            if c > 0 {
                s += x[i] - x[i - 1];
            }
            if c + 1 < cols {
                s += x[i] - x[i + 1];
            }
            y[i] = s;
        }
    }
    y
}

fn solve(known: &Mask, values: &Grid<f64>, order: usize) -> Result<Grid<f64>> {
    if !known.as_slice().contains(&true) {
        return Err(Error::value("number of known cells", 0, "at least one must be known"));
    }
    let (rows, cols) = known.shape();
    let free: Vec<f64> = known.as_slice().iter().map(|&k| if k { 0.0 } else { 1.0 }).collect();
    let apply = |x: &[f64]| {
        let mut y = laplacian(rows, cols, x);
        if order == 2 {
            y = laplacian(rows, cols, &y);
        }
        y.iter().zip(&free).map(|(a, b)| a * b).collect::<Vec<f64>>()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut u: Vec<f64> =
        values.as_slice().iter().zip(known.as_slice()).map(|(&v, &k)| if k { v } else { 0.0 }).collect();
    let mut r: Vec<f64> = apply(&u).iter().map(|v| -v).collect();
    let mut p = r.clone();
    let mut rr = dot(&r, &r);
    let stop = rr * 1e-20;
    for _ in 0..20_000 {
        if rr <= stop {
            break;
        }
        let ap = apply(&p);
        let a = rr / dot(&p, &ap);
        for i in 0..u.len() {
            u[i] += a * p[i];
            r[i] -= a * ap[i];
        }
        let next = dot(&r, &r);
        let b = next / rr;
        rr = next;
        for i in 0..u.len() {
            p[i] = r[i] + b * p[i];
        }
    }
    Grid::from_vec(rows, cols, u)
}
