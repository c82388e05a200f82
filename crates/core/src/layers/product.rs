//! Matrix products in single precision for the network. Every sum is taken in the order of the columns, whatever the
//! machine and however rows are grouped, so results are the same bits everywhere.

use crate::simd::multiversion;

/// Columns that are computed together.
const PANEL: usize = 16;

/// A right factor: `rows` x `columns`, in panels of 16 columns; columns are filled up with zeros.
#[derive(Debug, Clone)]
pub(crate) struct Matrix {
    rows: usize,
    panels: Vec<f32>,
}

impl Matrix {
    pub(crate) fn new(rows: usize, columns: usize, at: impl Fn(usize, usize) -> f32) -> Self {
        let n_panels = columns.div_ceil(PANEL);
        let mut panels = Vec::with_capacity(n_panels * rows * PANEL);
        for panel in 0..n_panels {
            for row in 0..rows {
                panels.extend((panel * PANEL..(panel + 1) * PANEL).map(|j| if j < columns { at(row, j) } else { 0.0 }));
            }
        }
        Self { rows, panels }
    }

    /// Number of columns, a multiple of 16.
    pub(crate) fn columns(&self) -> usize {
        self.panels.len() / self.rows
    }
}

multiversion! {
    /// Adds the product of `right` with `n_rows` rows of `left`, which begin `stride` apart, to `out`.
    pub(crate) fn add_product = add_rows, (left: &[f32], stride: usize, n_rows: usize, right: &Matrix, out: &mut [f32])
}

#[inline(always)]
fn add_rows(left: &[f32], stride: usize, n_rows: usize, right: &Matrix, out: &mut [f32]) {
    let width = right.columns();
    let n_panels = width / PANEL;
    let mut row = 0;
    while row + 4 <= n_rows {
        for panel in 0..n_panels {
            block::<4, 1>(&left[row * stride..], stride, right, panel, &mut out[row * width..]);
        }
        row += 4;
    }
    for row in row..n_rows {
        let (left, out) = (&left[row * stride..], &mut out[row * width..]);
        let mut panel = 0;
        // A single row would wait for its own sums; several panels at once do not.
        while panel + 3 <= n_panels {
            block::<1, 3>(left, stride, right, panel, out);
            panel += 3;
        }
        for panel in panel..n_panels {
            block::<1, 1>(left, stride, right, panel, out);
        }
    }
}

/// `R` rows times `P` panels from `first` on.
#[inline(always)]
fn block<const R: usize, const P: usize>(left: &[f32], stride: usize, right: &Matrix, first: usize, out: &mut [f32]) {
    let (depth, width) = (right.rows, right.columns());
    let rows: [&[f32]; R] = std::array::from_fn(|r| &left[r * stride..r * stride + depth]);
    let panels: [&[[f32; PANEL]]; P] =
        std::array::from_fn(|p| &right.panels.as_chunks().0[(first + p) * depth..(first + p + 1) * depth]);
    let mut sums = [[[0.0_f32; PANEL]; P]; R];
    for (r, row) in sums.iter_mut().enumerate() {
        for (p, panel) in row.iter_mut().enumerate() {
            let at = r * width + (first + p) * PANEL;
            panel.copy_from_slice(&out[at..at + PANEL]);
        }
    }
    for k in 0..depth {
        for p in 0..P {
            let weights = panels[p][k];
            for r in 0..R {
                let x = rows[r][k];
                for column in 0..PANEL {
                    sums[r][p][column] += x * weights[column];
                }
            }
        }
    }
    for (r, row) in sums.iter().enumerate() {
        for (p, panel) in row.iter().enumerate() {
            let at = r * width + (first + p) * PANEL;
            out[at..at + PANEL].copy_from_slice(panel);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_machines_give_the_same_bits() {
        let matrix = Matrix::new(32, 96, |i, j| ((i * 7 + j * 13) as f32).sin());
        let left: Vec<f32> = (0..32 * 7).map(|i| (i as f32).cos() * 40.0).collect();
        let (mut wide, mut narrow) = (vec![0.0; 7 * 96], vec![0.0; 7 * 96]);
        add_product(&left, 32, 7, &matrix, &mut wide);
        add_rows(&left, 32, 7, &matrix, &mut narrow);
        assert_eq!(wide, narrow);
    }

    #[test]
    fn a_product_is_added_in_the_order_of_the_columns_however_many_rows_there_are_and_whatever_lies_between_them() {
        let weight = |i: usize, column: usize| if column < 90 { (i * 90 + column) as f32 * 0.37 - 60.0 } else { 0.0 };
        let matrix = Matrix::new(5, 90, weight);
        assert_eq!(matrix.columns(), 96);
        let stride = 7;
        for n_rows in 1..=9 {
            let left: Vec<f32> = (0..n_rows * stride).map(|i| (i as f32 * 1.7).sin()).collect();
            let mut out: Vec<f32> = (0..n_rows * 96).map(|i| i as f32 * 0.1).collect();
            let sum = |at: usize| (0..5).fold(out[at], |sum, i| sum + left[at / 96 * stride + i] * weight(i, at % 96));
            let expected: Vec<f32> = (0..n_rows * 96).map(sum).collect();
            add_product(&left, stride, n_rows, &matrix, &mut out);
            assert_eq!(out, expected, "{n_rows} rows");
        }
    }
}
