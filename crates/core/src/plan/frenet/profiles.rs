//! Motions along the path: arc length as a function of time.

use super::super::polynomial::Polynomial;
use super::feasibility::Rejection;

/// One motion along the path, which the samples of a row share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LongitudinalProfile {
    /// When the motion ends [s]; from then on the speed is constant.
    pub(super) end_time: f64,
    /// Speed at the end, along the path [m/s].
    pub(super) end_velocity: f64,
    /// Root of the integral of the squared jerk over the horizon.
    pub(super) jerk: f64,
    /// Its lateral polynomials are of arc length, its own; otherwise of time, shared by all profiles of an end time.
    pub(super) is_over_arc: bool,
    /// Table of the lateral polynomials.
    pub(super) table: usize,
    /// Why all its samples are rejected.
    pub(super) rejection: Rejection,
}

/// Arc length and its derivatives by time at one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ProfilePoint {
    pub(super) s: f64,
    pub(super) s_dot: f64,
    pub(super) s_ddot: f64,
    pub(super) jerk: f64,
}

impl ProfilePoint {
    pub(super) fn new([s, s_dot, s_ddot, jerk]: [f64; 4]) -> Self {
        Self { s, s_dot, s_ddot, jerk }
    }

    /// On a polynomial up to its end, then at constant speed.
    pub(super) fn keeping_velocity(s: &Polynomial, (end_time, end_velocity): (f64, f64), time: f64) -> Self {
        Self::new(if time < end_time + 1e-9 {
            s.at(time)
        } else {
            [s.at(end_time)[0] + end_velocity * (time - end_time), end_velocity, 0.0, 0.0]
        })
    }
}

/// Motions that reach some speed at the same time. Whatever that speed is, arc length, speed and acceleration at a time
/// are those of the motion that ends at rest and that speed times what each m/s at the end adds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Family {
    rest: ProfilePoint,
    rise: ProfilePoint,
}

impl Family {
    /// From (arc length, speed, acceleration), at some times.
    pub(super) fn along(from: [f64; 3], end_time: f64, times: &[f64]) -> impl Iterator<Item = Self> {
        let to_rest = Polynomial::to_slope(from, 0.0, end_time);
        let more = Polynomial::to_slope([0.0; 3], 1.0, end_time);
        times.iter().map(move |time| Self {
            rest: ProfilePoint::keeping_velocity(&to_rest, (end_time, 0.0), *time),
            rise: ProfilePoint::keeping_velocity(&more, (end_time, 1.0), *time),
        })
    }

    /// The motion that ends at a speed.
    pub(super) fn member(&self, end_velocity: f64, jerk: f64) -> ProfilePoint {
        let Self { rest, rise } = self;
        ProfilePoint {
            s: rest.s + end_velocity * rise.s,
            s_dot: rest.s_dot + end_velocity * rise.s_dot,
            s_ddot: rest.s_ddot + end_velocity * rise.s_ddot,
            jerk,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    #[test]
    fn members_of_a_family_are_the_polynomials_with_their_end_speeds() {
        let mut random = Lcg::new(4);
        let times: Vec<f64> = (0..32).map(|i| 0.1 * f64::from(i)).collect();
        for _ in 0..100 {
            let from = [random.within(0.0, 500.0), random.within(0.0, 30.0), random.within(-5.0, 3.0)];
            let (end_time, end_velocity) = (random.within(0.5, 3.0), random.within(0.0, 30.0));
            let polynomial = Polynomial::to_slope(from, end_velocity, end_time);
            for (family, time) in Family::along(from, end_time, &times).zip(times.iter().copied()) {
                let found = family.member(end_velocity, 0.0);
                let [mut s, mut s_dot, mut s_ddot, _] = polynomial.at(time.min(end_time));
                if time > end_time {
                    (s, s_dot, s_ddot) = (s + end_velocity * (time - end_time), end_velocity, 0.0);
                }
                for (found, expected) in [(found.s, s), (found.s_dot, s_dot), (found.s_ddot, s_ddot)] {
                    assert!((found - expected).abs() < 1e-11 * expected.abs().max(100.0), "{found} {expected}");
                }
            }
        }
    }
}
