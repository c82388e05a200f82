//! Matrix products and activations in single precision. Every sum is taken in the order of the columns, whatever the
//! machine and however rows are grouped, so results are the same bits everywhere.

/// Columns that are computed together.
pub(super) const PANEL: usize = 16;

/// A right factor: `rows` x `columns`, in panels of 16 columns; columns are filled up with zeros.
#[derive(Debug, Clone)]
pub(super) struct Matrix {
    rows: usize,
    panels: Vec<f32>,
}

impl Matrix {
    pub(super) fn new(rows: usize, columns: usize, at: impl Fn(usize, usize) -> f32) -> Self {
        let n_panels = columns.div_ceil(PANEL);
        let mut panels = Vec::with_capacity(n_panels * rows * PANEL);
        for panel in 0..n_panels {
            for row in 0..rows {
                panels.extend((panel * PANEL..(panel + 1) * PANEL).map(|j| if j < columns { at(row, j) } else { 0.0 }));
            }
        }
        Self { rows, panels }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns, a multiple of 16.
    pub(super) fn columns(&self) -> usize {
        self.panels.len() / self.rows
    }
}

/// Compiles a function twice: for every machine, and for those with AVX2, which compute twice as many numbers at once.
/// The operations and their order are the same (the compiler never fuses products and sums), so the bits are, too.
macro_rules! for_wide_machines {
    ($(#[$about:meta])* fn $name:ident = $body:path, ($($argument:ident: $kind:ty),*)) => {
        $(#[$about])*
        pub(super) fn $name($($argument: $kind),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn with_avx2($($argument: $kind),*) {
                    $body($($argument),*);
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    #[expect(unsafe_code, reason = "the one way to call what needs AVX2; the line above has asked for it")]
                    // SAFETY: this machine has AVX2.
                    return unsafe { with_avx2($($argument),*) };
                }
            }
            $body($($argument),*);
        }
    };
}
pub(super) use for_wide_machines;

for_wide_machines! {
    /// `left` (any number of rows, `right.rows()` columns) times `right` into `out` (`right.columns()` columns).
    fn multiply = multiply_panels, (left: &[f32], right: &Matrix, out: &mut [f32])
}

#[inline(always)]
fn multiply_panels(left: &[f32], right: &Matrix, out: &mut [f32]) {
    let (depth, stride) = (right.rows, right.columns());
    let n_rows = left.len() / depth;
    let n_panels = stride / PANEL;
    let mut row = 0;
    while row + 4 <= n_rows {
        for panel in 0..n_panels {
            block::<4, 1>(&left[row * depth..], right, panel, &mut out[row * stride..]);
        }
        row += 4;
    }
    for row in row..n_rows {
        let mut panel = 0;
        // A single row would wait for its own sums; several panels at once do not.
        while panel + 3 <= n_panels {
            block::<1, 3>(&left[row * depth..], right, panel, &mut out[row * stride..]);
            panel += 3;
        }
        for panel in panel..n_panels {
            block::<1, 1>(&left[row * depth..], right, panel, &mut out[row * stride..]);
        }
    }
}

/// `R` rows times `P` panels from `first` on.
#[inline(always)]
fn block<const R: usize, const P: usize>(left: &[f32], right: &Matrix, first: usize, out: &mut [f32]) {
    let (depth, stride) = (right.rows, right.columns());
    let rows: [&[f32]; R] = std::array::from_fn(|r| &left[r * depth..(r + 1) * depth]);
    let panels: [&[f32]; P] =
        std::array::from_fn(|p| &right.panels[(first + p) * depth * PANEL..(first + p + 1) * depth * PANEL]);
    let mut sums = [[[0.0_f32; PANEL]; P]; R];
    for k in 0..depth {
        for p in 0..P {
            let weights = &panels[p][k * PANEL..(k + 1) * PANEL];
            for r in 0..R {
                let x = rows[r][k];
                for (sum, weight) in sums[r][p].iter_mut().zip(weights) {
                    *sum += x * weight;
                }
            }
        }
    }
    for (r, row) in sums.iter().enumerate() {
        for (p, panel) in row.iter().enumerate() {
            let at = r * stride + (first + p) * PANEL;
            out[at..at + PANEL].copy_from_slice(panel);
        }
    }
}

/// Exponential function; relative error below 2e-7. Polynomial of degree 6 after reduction by powers of two (as in
/// Moshier's Cephes library), because the one of the system differs between systems and is slower.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    /// Adding this rounds to whole numbers, which then are the low bits.
    const ROUNDING: f32 = 12_582_912.0;
    let x = x.clamp(-87.0, 88.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUNDING;
    let whole = shifted - ROUNDING;
    let rest = x - whole * LN_2_HIGH - whole * LN_2_LOW;
    let mut sum = 1.987_569_1e-4;
    for coefficient in [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        sum = sum * rest + coefficient;
    }
    let power = f32::from_bits(shifted.to_bits().wrapping_sub(ROUNDING.to_bits()).wrapping_add(127) << 23);
    (sum * rest * rest + rest + 1.0) * power
}

/// Logistic function.
#[inline(always)]
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Hyperbolic tangent; absolute error below 2e-7.
#[inline(always)]
pub(super) fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

/// Leaky rectifier with slope 0.1.
#[inline(always)]
pub(super) fn leaky(x: f32) -> f32 {
    x.max(0.1 * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_is_the_sum_over_columns_however_many_rows_there_are() {
        let matrix = Matrix::new(5, 90, |i, j| (i * 90 + j) as f32 * 0.37 - 60.0);
        assert_eq!((matrix.rows(), matrix.columns()), (5, 96));
        for n_rows in 1..=9 {
            let left: Vec<f32> = (0..n_rows * 5).map(|i| (i as f32 * 1.7).sin()).collect();
            let mut out = vec![f32::NAN; n_rows * 96];
            multiply(&left, &matrix, &mut out);
            for row in 0..n_rows {
                for column in 0..96 {
                    let weight = |i: usize| if column < 90 { (i * 90 + column) as f32 * 0.37 - 60.0 } else { 0.0 };
                    let expected = (0..5).fold(0.0, |sum, i| sum + left[row * 5 + i] * weight(i));
                    assert_eq!(out[row * 96 + column], expected, "row {row} of {n_rows}, column {column}");
                }
            }
        }
    }

    #[test]
    fn wide_machines_give_the_same_bits() {
        let matrix = Matrix::new(32, 96, |i, j| ((i * 7 + j * 13) as f32).sin());
        let left: Vec<f32> = (0..32 * 7).map(|i| (i as f32).cos() * 40.0).collect();
        let (mut wide, mut narrow) = (vec![0.0; 7 * 96], vec![0.0; 7 * 96]);
        multiply(&left, &matrix, &mut wide);
        multiply_panels(&left, &matrix, &mut narrow);
        assert_eq!(wide, narrow);
    }

    #[test]
    fn activations_are_exact_to_single_precision() {
        for i in -20_000..=20_000 {
            let x = i as f32 * 4.3e-3;
            let exact = f64::from(x);
            let relative = (f64::from(exp(x)) - exact.exp()).abs() / exact.exp();
            assert!(relative < 2e-7, "exp({x}): {relative}");
            assert!((f64::from(tanh(x)) - exact.tanh()).abs() < 2e-7, "tanh({x})");
            assert!((f64::from(sigmoid(x)) - 1.0 / (1.0 + (-exact).exp())).abs() < 1e-7, "sigmoid({x})");
        }
        assert!(exp(1e9).is_finite() && exp(-1e9) > 0.0, "no overflow");
    }
}
