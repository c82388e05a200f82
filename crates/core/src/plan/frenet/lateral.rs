//! Lateral motion: quintics of time or of arc length that come to rest at an end offset. They are
//! linear in their end value: value and two derivatives are `home + end_offset step`, where `home` ends at 0 and `step` goes
//! from 0 to 1.

use std::ops::Range;

use super::super::polynomial::Polynomial;
use crate::simd::multiversion;

/// Numbers per point: value and two derivatives of home, then of step.
pub(super) const N_PARTS: usize = 6;

/// Tables of lateral motions; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct LateralTables {
    /// (tables, parts, points with padding)
    points: Vec<f64>,
    /// Root of the integral of the squared lateral jerk over the horizon; (tables, end offsets).
    pub(super) jerk: Vec<f64>,
    /// Root of the summed squares of the last half of the offsets from where the agent wants to be; (tables, end offsets).
    pub(super) offset: Vec<f64>,
    stride: usize,
    n_points: usize,
    /// Offset where the agent wants to be [m].
    desired: f64,
    /// Third derivatives of home and step by time.
    rates: [Vec<f64>; 2],
}

/// One table: for every point, value and two derivatives.
#[derive(Debug, Clone, Copy)]
pub(super) struct LateralPoints<'a> {
    pub(super) home: [&'a [f64]; 3],
    pub(super) step: [&'a [f64]; 3],
}

impl<'a> LateralPoints<'a> {
    /// Offset and two derivatives.
    #[inline(always)]
    pub(super) fn at(&self, point: usize, end_offset: f64) -> [f64; 3] {
        let ([h0, h1, h2], [s0, s1, s2]) = (self.home, self.step);
        [h0[point] + end_offset * s0[point], h1[point] + end_offset * s1[point], h2[point] + end_offset * s2[point]]
    }

    /// Some points.
    #[inline(always)]
    pub(super) fn cut(&self, range: Range<usize>) -> Self {
        let ([h0, h1, h2], [s0, s1, s2]) = (self.home, self.step);
        let cut = |part: &'a [f64]| &part[range.clone()];
        Self { home: [cut(h0), cut(h1), cut(h2)], step: [cut(s0), cut(s1), cut(s2)] }
    }
}

/// A motion along the path at all points, relative to its start: arc length, speed, acceleration, jerk.
#[derive(Debug, Clone, Copy)]
pub(super) struct LongitudinalMotion<'a> {
    pub(super) s: &'a [f64],
    pub(super) s_dot: &'a [f64],
    pub(super) s_ddot: &'a [f64],
    pub(super) jerk: &'a [f64],
}

impl LateralTables {
    /// Begins anew, for plans of so many points in tables of `stride`, of an agent that wants to be at an offset [m].
    pub(super) fn clear(&mut self, (n_points, stride): (usize, usize), desired: f64) {
        self.points.clear();
        self.jerk.clear();
        self.offset.clear();
        (self.n_points, self.stride, self.desired) = (n_points, stride, desired);
        for rates in &mut self.rates {
            rates.clear();
            rates.resize(stride, 0.0);
        }
    }

    /// Number of tables.
    pub(super) fn len(&self) -> usize {
        self.points.len() / (N_PARTS * self.stride).max(1)
    }

    /// A table.
    pub(super) fn points(&self, table: usize) -> LateralPoints<'_> {
        let part = |k: usize| &self.points[(table * N_PARTS + k) * self.stride..][..self.stride];
        LateralPoints { home: [part(0), part(1), part(2)], step: [part(3), part(4), part(5)] }
    }

    /// Adds quintics of time from a state that arrive at `end_time`.
    pub(super) fn push_over_time(
        &mut self,
        from: [f64; 3],
        end_time: f64,
        times: &[f64],
        end_offsets: &[f64],
    ) -> usize {
        let home = Polynomial::to_rest(from, 0.0, end_time);
        let step = Polynomial::to_rest([0.0; 3], 1.0, end_time);
        let table = self.push();
        let points = &mut self.points[table * N_PARTS * self.stride..];
        write_parts((&home, &step), times, end_time + 1e-9, points);
        for end_offset in end_offsets {
            let polynomial = Polynomial { c: std::array::from_fn(|k| home.c[k] + end_offset * step.c[k]) };
            self.jerk.push(polynomial.squared_jerk(end_time).max(0.0).sqrt());
        }
        self.sum_offsets(table, end_offsets);
        table
    }

    /// Adds polynomials of arc length that arrive after `length`, for a motion along the path. Their second derivative
    /// at the start may be free.
    ///
    /// The lateral jerk is d''' s_dot³ + 3 d'' s_dot s_ddot + d' s_dddot, integrated by the trapezoidal rule; linear in
    /// the end position like d itself.
    pub(super) fn push_over_arc(
        &mut self,
        [d, d_1, d_2]: [f64; 3],
        is_free: bool,
        length: f64,
        motion: &LongitudinalMotion,
        dt: f64,
        end_offsets: &[f64],
    ) -> usize {
        let polynomial = |[d, d_1, d_2]: [f64; 3], end: f64| {
            if is_free {
                Polynomial::to_rest_from_free([d, d_1], end, length)
            } else {
                Polynomial::to_rest([d, d_1, d_2], end, length)
            }
        };
        let home = polynomial([d, d_1, d_2], 0.0);
        let step = polynomial([0.0; 3], 1.0);
        let table = self.push();
        let points = &mut self.points[table * N_PARTS * self.stride..];
        // A point at the full length has arrived.
        write_parts((&home, &step), motion.s, length, points);
        write_rates((&home, &step), motion, length, &mut self.rates);
        let (mut constant, mut linear, mut square) = (0.0, 0.0, 0.0);
        for (i, (a, b)) in self.rates[0].iter().zip(&self.rates[1]).take(self.n_points).enumerate() {
            let weight = if i == 0 || i + 1 == self.n_points { 0.5 * dt } else { dt };
            constant += weight * a * a;
            linear += weight * 2.0 * a * b;
            square += weight * b * b;
        }
        for end_offset in end_offsets {
            self.jerk.push((constant + end_offset * (linear + end_offset * square)).max(0.0).sqrt());
        }
        self.sum_offsets(table, end_offsets);
        table
    }

    /// Room for one more table.
    fn push(&mut self) -> usize {
        let table = self.len();
        self.points.resize((table + 1) * N_PARTS * self.stride, 0.0);
        table
    }

    fn sum_offsets(&mut self, table: usize, end_offsets: &[f64]) {
        let part = |k: usize| &self.points[(table * N_PARTS + k) * self.stride..][..self.n_points];
        let last_half = self.n_points - self.n_points / 2;
        // Sums of (home + end_offset step - desired offset)².
        let (mut constant, mut linear, mut square) = (0.0, 0.0, 0.0);
        for (home, step) in part(0)[last_half..].iter().zip(&part(3)[last_half..]) {
            let home = home - self.desired;
            constant += home * home;
            linear += 2.0 * home * step;
            square += step * step;
        }
        for end_offset in end_offsets {
            self.offset.push((constant + end_offset * (linear + end_offset * square)).max(0.0).sqrt());
        }
    }
}

/// Arc length [m], `least` or more, over which a quintic from (d, d', d'') comes to rest at 0 with a third derivative of
/// at most `rate` [1/m²] at its start and end; at most 60 m are tried.
pub(super) fn turning_length([d, d_1, d_2]: [f64; 3], rate: f64, least: f64) -> f64 {
    /// Factor from one length that is tried to the next, and the longest one [m].
    const STEP: f64 = 1.1;
    const LENGTH_MAX: f64 = 60.0;
    let mut length = least;
    while length < LENGTH_MAX {
        let first = 60.0 * d + (36.0 * d_1 + 9.0 * d_2 * length) * length;
        let last = 60.0 * d + (24.0 * d_1 + 3.0 * d_2 * length) * length;
        if first.abs().max(last.abs()) <= rate * length.powi(3) {
            break;
        }
        length *= STEP;
    }
    length
}

multiversion! {
    /// Value and two derivatives of both polynomials below `end`, where they have arrived.
    fn write_parts = parts_at, (polynomials: (&Polynomial, &Polynomial), at: &[f64], end: f64, out: &mut [f64])
}

#[inline(always)]
fn parts_at((home, step): (&Polynomial, &Polynomial), at: &[f64], end: f64, out: &mut [f64]) {
    let n = at.len();
    let (h, s) = out[..N_PARTS * n].split_at_mut(3 * n);
    for (polynomial, arrived, out) in [(home, 0.0, h), (step, 1.0, s)] {
        let (value, rest) = out.split_at_mut(n);
        let (first, second) = rest.split_at_mut(n);
        for (((x, value), first), second) in at.iter().zip(value).zip(first).zip(second) {
            let [p0, p1, p2, _] = polynomial.at(*x);
            let moving = *x < end;
            *value = if moving { p0 } else { arrived };
            *first = if moving { p1 } else { 0.0 };
            *second = if moving { p2 } else { 0.0 };
        }
    }
}

multiversion! {
    /// Third derivatives by time of polynomials of arc length.
    fn write_rates = rates_at, (
        polynomials: (&Polynomial, &Polynomial),
        motion: &LongitudinalMotion,
        length: f64,
        out: &mut [Vec<f64>; 2],
    )
}

#[inline(always)]
fn rates_at(
    (home, step): (&Polynomial, &Polynomial),
    motion: &LongitudinalMotion,
    length: f64,
    out: &mut [Vec<f64>; 2],
) {
    let LongitudinalMotion { s, s_dot, s_ddot, jerk } = *motion;
    for (polynomial, out) in [home, step].into_iter().zip(out) {
        for ((((s, s_dot), s_ddot), jerk), out) in s.iter().zip(s_dot).zip(s_ddot).zip(jerk).zip(out.iter_mut()) {
            let d = polynomial.at(*s);
            let rate = (d[3] * s_dot * s_dot + 3.0 * d[2] * s_ddot) * s_dot + d[1] * jerk;
            *out = if *s < length { rate } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_as_long_as_the_largest_third_derivative_demands() {
        for (start, rate) in [([2.0, 0.0, 0.0], 0.05), ([1.0, 0.3, 0.0], 0.1), ([-0.5, 0.2, 0.1], 0.2)] {
            let ends = |length: f64| {
                let turn = Polynomial::to_rest(start, 0.0, length);
                turn.at(0.0)[3].abs().max(turn.at(length)[3].abs())
            };
            let length = turning_length(start, rate, 5.0);
            assert!(ends(length) <= rate && ends(length / 1.1) > rate, "{start:?}: {length} m");
        }
    }

    #[test]
    fn on_the_path_turns_have_the_least_length() {
        assert_eq!(turning_length([0.0; 3], 0.1, 5.0), 5.0);
        assert_eq!(turning_length([2.0, 0.3, 0.1], f64::INFINITY, 5.0), 5.0);
    }
}
