//! A sparse matrix in compressed rows: the form in which interpolation weights are kept and multiplied.
//!
//! Cost of a product: one pass over the entries, rows in parallel. The order of additions inside a row is the order of
//! its columns, so the answer does not depend on the number of threads.

use rayon::prelude::*;

/// `rows` x `cols` numbers, most of them zero, stored row by row (CSR). Columns rise inside a row.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseMatrix {
    rows: usize,
    cols: usize,
    offsets: Vec<u32>,
    indices: Vec<u32>,
    values: Vec<f32>,
}

/// Rows handed to one task: enough work to pay for the hand-over.
const ROWS_PER_TASK: usize = 1024;

impl SparseMatrix {
    /// A matrix from compressed rows: row `r` holds `indices[offsets[r]..offsets[r + 1]]`.
    ///
    /// # Panics
    /// When the arrays do not describe a `rows` x `cols` matrix whose columns strictly rise inside each row: they are
    /// always made by this program.
    #[must_use]
    pub(crate) fn from_compressed_rows(
        rows: usize,
        cols: usize,
        offsets: Vec<u32>,
        indices: Vec<u32>,
        values: Vec<f32>,
    ) -> Self {
        assert_eq!(offsets.len(), rows + 1, "one offset a row and one for the end");
        assert_eq!(offsets[0], 0, "the first row starts at 0");
        assert_eq!(indices.len(), values.len(), "one value an index");
        assert_eq!(offsets[rows] as usize, indices.len(), "the last row ends at the end");
        for span in offsets.windows(2) {
            assert!(span[0] <= span[1], "rows follow one another");
            let row = &indices[span[0] as usize..span[1] as usize];
            assert!(row.windows(2).all(|pair| pair[0] < pair[1]), "columns rise inside a row");
            assert!(row.last().is_none_or(|&c| (c as usize) < cols), "columns lie inside the matrix");
        }
        Self { rows, cols, offsets, indices, values }
    }

    /// Number of rows.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    #[must_use]
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// The entries of one row as (column, value).
    ///
    /// # Panics
    /// When there is no such row.
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let span = self.offsets[row] as usize..self.offsets[row + 1] as usize;
        self.indices[span.clone()].iter().zip(&self.values[span]).map(|(&c, &v)| (c as usize, v))
    }

    /// The matrix times the column `x` of length [`cols`](Self::cols); the answer has length [`rows`](Self::rows).
    ///
    /// # Panics
    /// When the length of `x` does not fit.
    #[must_use]
    pub fn product(&self, x: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; self.rows];
        self.product_into(x, &mut out);
        out
    }

    /// [`product`](Self::product) into a column that exists already. Sums run in `f64`.
    ///
    /// # Panics
    /// When the length of `x` is not `cols` or that of `out` is not `rows`.
    pub(crate) fn product_into(&self, x: &[f32], out: &mut [f32]) {
        assert_eq!(x.len(), self.cols, "the vector has one number a column");
        assert_eq!(out.len(), self.rows, "the answer has one number a row");
        out.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, out)| {
            let first = task * ROWS_PER_TASK;
            for (row, out) in (first..).zip(out) {
                let span = self.offsets[row] as usize..self.offsets[row + 1] as usize;
                let entries = self.indices[span.clone()].iter().zip(&self.values[span]);
                *out = entries.map(|(&c, &v)| f64::from(v) * f64::from(x[c as usize])).sum::<f64>() as f32;
            }
        });
    }

    /// Rows as columns. The gradient of a product is the transpose's product with the gradient of its answer.
    #[must_use]
    pub(crate) fn transpose(&self) -> Self {
        let mut offsets = vec![0u32; self.cols + 1];
        for &c in &self.indices {
            offsets[c as usize + 1] += 1;
        }
        for c in 0..self.cols {
            offsets[c + 1] += offsets[c];
        }
        let mut next = offsets.clone();
        let mut indices = vec![0; self.indices.len()];
        let mut values = vec![0.0; self.values.len()];
        for row in 0..self.rows {
            for (c, v) in self.row(row) {
                let place = next[c] as usize;
                indices[place] = row as u32;
                values[place] = v;
                next[c] += 1;
            }
        }
        Self { rows: self.cols, cols: self.rows, offsets, indices, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A matrix from its dense rows.
    fn compressed(dense: &[Vec<f32>], cols: usize) -> SparseMatrix {
        let (mut offsets, mut indices, mut values) = (vec![0], vec![], vec![]);
        for row in dense {
            for (c, &v) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
                indices.push(c as u32);
                values.push(v);
            }
            offsets.push(indices.len() as u32);
        }
        SparseMatrix::from_compressed_rows(dense.len(), cols, offsets, indices, values)
    }

    fn matrices() -> impl Strategy<Value = Vec<Vec<f32>>> {
        (1usize..12, 1usize..9).prop_flat_map(|(rows, cols)| {
            let entry = prop_oneof![2 => Just(0.0f32), 1 => -4.0f32..4.0];
            proptest::collection::vec(proptest::collection::vec(entry, cols), rows)
        })
    }

    proptest! {
        #[test]
        fn products_agree_with_the_dense_matrix(dense in matrices(), x in proptest::collection::vec(-2.0f32..2.0, 12)) {
            let cols = dense[0].len();
            let sparse = compressed(&dense, cols);
            for (row, got) in dense.iter().zip(sparse.product(&x[..cols])) {
                let want: f64 = row.iter().zip(&x).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
                prop_assert!((want - f64::from(got)).abs() < 1e-5);
            }
            let flipped: Vec<Vec<f32>> = (0..cols).map(|c| dense.iter().map(|row| row[c]).collect()).collect();
            prop_assert_eq!(sparse.transpose(), compressed(&flipped, dense.len()));
            prop_assert_eq!(sparse.transpose().transpose(), sparse);
        }
    }
}
