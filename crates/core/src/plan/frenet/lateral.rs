//! Lateral motion: quintics of time or of arc length that come to rest at an end offset. They are linear in their end value:
//! value and two derivatives are `home + end_offset step`, where `home` ends at 0 and `step` goes from 0 to 1.

use super::super::polynomial::Polynomial;
use super::profiles::ProfilePoint;

/// Offset and two derivatives at one point, as parts of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LateralPoint {
    pub(super) home: [f64; 3],
    pub(super) step: [f64; 3],
}

impl LateralPoint {
    /// Offset and two derivatives of the motion that ends at an offset.
    #[inline]
    pub(super) fn to(&self, end_offset: f64) -> [f64; 3] {
        let ([h0, h1, h2], [s0, s1, s2]) = (self.home, self.step);
        [h0 + end_offset * s0, h1 + end_offset * s1, h2 + end_offset * s2]
    }
}

/// The two polynomials that a lateral motion is made of, and where they have arrived.
#[derive(Debug, Clone, Copy)]
struct Parts {
    home: Polynomial,
    step: Polynomial,
    end: f64,
}

impl Parts {
    fn at(&self, x: f64) -> LateralPoint {
        if x < self.end {
            let ([h0, h1, h2, _], [s0, s1, s2, _]) = (self.home.at(x), self.step.at(x));
            LateralPoint { home: [h0, h1, h2], step: [s0, s1, s2] }
        } else {
            LateralPoint { home: [0.0; 3], step: [1.0, 0.0, 0.0] }
        }
    }

    /// Third derivatives by time of both, for polynomials of arc length: d''' s_dot³ + 3 d'' s_dot s_ddot + d' s_dddot.
    fn jerks(&self, along: f64, motion: &ProfilePoint) -> [f64; 2] {
        let ProfilePoint { s_dot, s_ddot, jerk, .. } = *motion;
        [self.home, self.step].map(|part| {
            let d = part.at(along);
            let rate = (d[3] * s_dot * s_dot + 3.0 * d[2] * s_ddot) * s_dot + d[1] * jerk;
            if along < self.end { rate } else { 0.0 }
        })
    }
}

/// A weighted sum of (a + end_offset b)², for any end offset.
#[derive(Debug, Clone, Copy, Default)]
struct SummedSquares {
    constant: f64,
    linear: f64,
    square: f64,
}

impl SummedSquares {
    fn add(&mut self, weight: f64, [a, b]: [f64; 2]) {
        self.constant += weight * a * a;
        self.linear += weight * 2.0 * a * b;
        self.square += weight * b * b;
    }

    fn root(&self, end_offset: f64) -> f64 {
        (self.constant + end_offset * (self.linear + end_offset * self.square)).max(0.0).sqrt()
    }
}

/// Tables of lateral motions; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct LateralTables {
    /// (tables, points)
    points: Vec<LateralPoint>,
    /// Root of the integral of the squared lateral jerk over the horizon; (tables, end offsets).
    pub(super) jerk: Vec<f64>,
    /// Root of the summed squares of the last half of the offsets from where the agent wants to be; (tables, end offsets).
    pub(super) offset: Vec<f64>,
    n_points: usize,
    /// Offset where the agent wants to be [m].
    desired: f64,
}

impl LateralTables {
    /// Begins anew, for plans of so many points of an agent that wants to be at an offset [m].
    pub(super) fn clear(&mut self, n_points: usize, desired: f64) {
        self.points.clear();
        self.jerk.clear();
        self.offset.clear();
        (self.n_points, self.desired) = (n_points, desired);
    }

    /// A table.
    pub(super) fn points(&self, table: usize) -> &[LateralPoint] {
        &self.points[table * self.n_points..][..self.n_points]
    }

    /// Furthest from the path at a point, for some end offsets [m].
    pub(super) fn widest(&self, i: usize, end_offsets: [f64; 2]) -> f64 {
        let points = self.points.iter().skip(i).step_by(self.n_points);
        let offsets = points.flat_map(|point| end_offsets.map(|end_offset| point.to(end_offset)[0].abs()));
        offsets.fold(0.0, f64::max)
    }

    /// Adds quintics of time from a state that arrive at `end_time`; the number of the table.
    pub(super) fn push_over_time(
        &mut self,
        from: [f64; 3],
        end_time: f64,
        times: &[f64],
        end_offsets: &[f64],
    ) -> usize {
        let home = Polynomial::to_rest(from, 0.0, end_time);
        let step = Polynomial::to_rest([0.0; 3], 1.0, end_time);
        self.jerk.extend(end_offsets.iter().map(|end_offset| {
            let polynomial = Polynomial { c: std::array::from_fn(|k| home.c[k] + end_offset * step.c[k]) };
            polynomial.squared_jerk(end_time).max(0.0).sqrt()
        }));
        self.push(&Parts { home, step, end: end_time + 1e-9 }, times.iter().copied(), end_offsets)
    }

    /// Adds polynomials of arc length that arrive after `length`, for a motion along the path with points `dt` apart. Their
    /// second derivative at the start may be free. Jerks are integrated by the trapezoidal rule.
    pub(super) fn push_over_arc(
        &mut self,
        [d, d_1, d_2]: [f64; 3],
        is_free: bool,
        length: f64,
        (motion, dt): (&[ProfilePoint], f64),
        (start, end_offsets): (f64, &[f64]),
    ) -> usize {
        let polynomial = |[d, d_1, d_2]: [f64; 3], end: f64| {
            if is_free {
                Polynomial::to_rest_from_free([d, d_1], end, length)
            } else {
                Polynomial::to_rest([d, d_1, d_2], end, length)
            }
        };
        let parts = Parts { home: polynomial([d, d_1, d_2], 0.0), step: polynomial([0.0; 3], 1.0), end: length };
        let mut jerks = SummedSquares::default();
        for (i, point) in motion.iter().enumerate() {
            let weight = if i == 0 || i + 1 == self.n_points { 0.5 * dt } else { dt };
            jerks.add(weight, parts.jerks(point.s - start, point));
        }
        self.jerk.extend(end_offsets.iter().map(|end_offset| jerks.root(*end_offset)));
        self.push(&parts, motion.iter().map(|point| point.s - start), end_offsets)
    }

    fn push(&mut self, parts: &Parts, at: impl Iterator<Item = f64>, end_offsets: &[f64]) -> usize {
        let first = self.points.len();
        self.points.extend(at.map(|x| parts.at(x)));
        let mut sums = SummedSquares::default();
        for point in &self.points[first + self.n_points - self.n_points / 2..] {
            sums.add(1.0, [point.home[0] - self.desired, point.step[0]]);
        }
        self.offset.extend(end_offsets.iter().map(|end_offset| sums.root(*end_offset)));
        first / self.n_points
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
        for (start, rate) in [([0.0; 3], 0.1), ([2.0, 0.3, 0.1], f64::INFINITY)] {
            assert_eq!(turning_length(start, rate, 5.0), 5.0);
        }
    }
}
