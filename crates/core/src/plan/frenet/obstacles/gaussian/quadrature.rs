//! Gauss-Legendre rules, computed by the compiler.

/// Nodes in [-1, 1] with their weights: zeros of the Legendre polynomial of degree `N` by Newton's method from the usual
/// cosine guesses.
pub(super) const fn gauss_legendre<const N: usize>() -> [(f64, f64); N] {
    let mut rule = [(0.0, 0.0); N];
    let mut i = 0;
    while i < N {
        let mut x = cos_series(std::f64::consts::PI * (i as f64 + 0.75) / (N as f64 + 0.5));
        let mut slope = 1.0;
        let mut round = 0;
        while round < 8 {
            let (mut before, mut value, mut k) = (1.0, x, 1);
            while k < N {
                let next = ((2 * k + 1) as f64 * x * value - k as f64 * before) / (k + 1) as f64;
                (before, value) = (value, next);
                k += 1;
            }
            slope = N as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
            round += 1;
        }
        rule[i] = (x, 2.0 / ((1.0 - x * x) * slope * slope));
        i += 1;
    }
    rule
}

const fn cos_series(angle: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    let mut n = 1.0;
    while n < 40.0 {
        term *= -angle * angle / (n * (n + 1.0));
        sum += term;
        n += 2.0;
    }
    sum
}
