//! Least squares on few unknowns: conjugate gradients on the normal equations, in one thread.

/// Equations `sum of c_i x_i = value`, each already divided by its scatter.
#[derive(Debug, Default)]
pub(super) struct Equations {
    starts: Vec<usize>,
    terms: Vec<(usize, f64)>,
    values: Vec<f64>,
}

/// Residual of the normal equations, beside the first one, at which the solution stands.
const TOLERANCE: f64 = 1e-10;

impl Equations {
    /// Adds the equation `sum of terms = value`, known to `scatter` (above 0).
    pub(super) fn add(&mut self, terms: &[(usize, f64)], value: f64, scatter: f64) {
        self.starts.push(self.terms.len());
        self.terms.extend(terms.iter().map(|&(i, c)| (i, c / scatter)));
        self.values.push(value / scatter);
    }

    fn row(&self, i: usize) -> &[(usize, f64)] {
        let end = self.starts.get(i + 1).copied().unwrap_or(self.terms.len());
        &self.terms[self.starts[i]..end]
    }

    /// The matrix and then its transpose, times `x`.
    fn normal(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        for i in 0..self.values.len() {
            let product: f64 = self.row(i).iter().map(|&(j, c)| c * x[j]).sum();
            for &(j, c) in self.row(i) {
                out[j] += c * product;
            }
        }
        out
    }

    /// The `x` nearest to all equations, from `start` on; unknowns in `fixed` keep what they are.
    pub(super) fn solve(&self, start: &[f64], fixed: &[bool]) -> Vec<f64> {
        let mut x = start.to_vec();
        let free = |mut v: Vec<f64>| {
            v.iter_mut().zip(fixed).filter(|(_, fixed)| **fixed).for_each(|(v, _)| *v = 0.0);
            v
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut diagonal = vec![0.0; x.len()];
        let mut right = vec![0.0; x.len()];
        for i in 0..self.values.len() {
            for &(j, c) in self.row(i) {
                diagonal[j] += c * c;
                right[j] += c * self.values[i];
            }
        }
        let scaled = |v: &[f64]| -> Vec<f64> {
            v.iter().zip(&diagonal).map(|(v, d)| if *d > 0.0 { v / d } else { *v }).collect()
        };
        let mut residual = free(right.iter().zip(self.normal(&x)).map(|(b, a)| b - a).collect());
        let mut preconditioned = scaled(&residual);
        let mut direction = preconditioned.clone();
        let mut energy = dot(&residual, &preconditioned);
        let first = energy;
        // In exact arithmetic as many steps as unknowns suffice.
        for _ in 0..4 * x.len() + 100 {
            if energy <= TOLERANCE * TOLERANCE * first || energy == 0.0 {
                break;
            }
            let moved = free(self.normal(&direction));
            let step = energy / dot(&direction, &moved);
            if !step.is_finite() {
                break;
            }
            for ((x, d), (r, m)) in x.iter_mut().zip(&direction).zip(residual.iter_mut().zip(&moved)) {
                *x += step * d;
                *r -= step * m;
            }
            preconditioned = scaled(&residual);
            let next = dot(&residual, &preconditioned);
            let keep = next / energy;
            direction.iter_mut().zip(&preconditioned).for_each(|(d, p)| *d = p + keep * *d);
            energy = next;
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_between_fixed_ends_is_a_line() {
        let mut equations = Equations::default();
        let n = 300;
        for i in 1..n {
            equations.add(&[(i, 1.0), (i - 1, -1.0)], 0.0, 2.0);
        }
        let mut start = vec![0.0; n];
        start[n - 1] = 299.0;
        let fixed: Vec<bool> = (0..n).map(|i| i == 0 || i == n - 1).collect();
        let x = equations.solve(&start, &fixed);
        assert!(x.iter().enumerate().all(|(i, x)| (x - i as f64).abs() < 1e-6), "{x:?}");
        assert_eq!((x[0], x[n - 1]), (0.0, 299.0));
        // Two opinions of one number: the surer one counts more.
        let mut equations = Equations::default();
        equations.add(&[(0, 1.0)], 10.0, 1.0);
        equations.add(&[(0, 1.0)], 20.0, 2.0);
        let x = equations.solve(&[0.0], &[false]);
        assert!((x[0] - 12.0).abs() < 1e-9, "{x:?}");
    }
}
