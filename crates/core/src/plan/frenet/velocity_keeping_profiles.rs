//! Motions along the path that reach some speed at the same time (a family). Whatever that speed v is, arc length, speed
//! and acceleration at each point are `rest + v rise`, also after the end.

use super::super::polynomial::Polynomial;
use super::feasibility::LongitudinalLimits;
use crate::simd::multiversion;

/// Numbers per point of a motion: arc length, speed, acceleration.
pub(super) const N_MOTION: usize = 3;
/// Points that are worked on at once.
pub(super) const SIMD_POINTS: usize = 8;

/// All families of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct VelocityKeepingProfiles {
    /// The motion that ends at rest, then what each m/s at the end adds; (families, 2, `N_MOTION`, points with padding).
    motions: Vec<f64>,
    /// Speed and acceleration of both in single precision; (families, 2, 2, points with padding).
    coarse: Vec<f32>,
    stride: usize,
}

/// Speeds at all points in single precision: `rest + end_velocity rise`.
#[derive(Debug, Clone, Copy)]
pub(super) struct CoarseSpeeds<'a> {
    pub(super) rest: &'a [f32],
    pub(super) rise: &'a [f32],
    pub(super) end_velocity: f32,
}

/// Values at the points of a motion along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ProfileCheck {
    /// It may break a limit of the vehicle.
    pub(super) is_doubtful: bool,
    /// Its speed is below that for polynomials of time somewhere.
    pub(super) is_slow: bool,
}

impl VelocityKeepingProfiles {
    /// Begins anew, with tables of `stride` points.
    pub(super) fn clear(&mut self, stride: usize) {
        self.motions.clear();
        self.coarse.clear();
        self.stride = stride;
    }

    /// Adds motions from (arc length, speed, acceleration) that end at `end_time`; its number.
    pub(super) fn push(&mut self, from: [f64; 3], end_time: f64, times: &[f64]) -> usize {
        let polynomials = [Polynomial::to_slope(from, 0.0, end_time), Polynomial::to_slope([0.0; 3], 1.0, end_time)];
        let (n, first, first_coarse) = (self.stride, self.motions.len(), self.coarse.len());
        self.motions.resize(first + 2 * N_MOTION * n, 0.0);
        self.coarse.resize(first_coarse + 4 * n, 0.0);
        write_family(&polynomials, end_time, times, &mut self.motions[first..], &mut self.coarse[first_coarse..]);
        first / (2 * N_MOTION * n)
    }

    /// Motion that ends at rest, and what each m/s at the end adds.
    fn parts(&self, family: usize) -> (&[f64], &[f64]) {
        let n = N_MOTION * self.stride;
        self.motions[family * 2 * n..(family + 1) * 2 * n].split_at(n)
    }

    /// Writes arc lengths, speeds and accelerations at all points with padding.
    pub(super) fn write(&self, family: usize, end_velocity: f64, out: &mut [f64]) {
        let (rest, rise) = self.parts(family);
        write_sums(rest, rise, end_velocity, out);
    }

    /// Arc length at a point [m].
    #[inline]
    pub(super) fn arc_length(&self, family: usize, end_velocity: f64, point: usize) -> f64 {
        let (rest, rise) = self.parts(family);
        rest[point] + end_velocity * rise[point]
    }

    /// Raises arc lengths to those of a motion.
    pub(super) fn raise(&self, family: usize, end_velocity: f64, furthest: &mut [f64]) {
        let (rest, rise) = self.parts(family);
        raise_to_sums(&rest[..self.stride], &rise[..self.stride], end_velocity, furthest);
    }

    /// Looks at a motion in single precision.
    pub(super) fn check(&self, family: usize, end_velocity: f64, limits: &LongitudinalLimits) -> ProfileCheck {
        checked(&self.coarse[family * 4 * self.stride..(family + 1) * 4 * self.stride], end_velocity as f32, limits)
    }

    /// Speeds of a motion.
    #[inline]
    pub(super) fn speeds(&self, family: usize, end_velocity: f64) -> CoarseSpeeds<'_> {
        let part = |k: usize| &self.coarse[(family * 4 + k) * self.stride..][..self.stride];
        CoarseSpeeds { rest: part(0), rise: part(2), end_velocity: end_velocity as f32 }
    }
}

multiversion! {
    fn write_family = family_at, (
        polynomials: &[Polynomial; 2],
        end_time: f64,
        times: &[f64],
        motions: &mut [f64],
        coarse: &mut [f32],
    )
}

#[inline(always)]
fn family_at(polynomials: &[Polynomial; 2], end_time: f64, times: &[f64], motions: &mut [f64], coarse: &mut [f32]) {
    let n = times.len();
    let (rest, rise) = motions[..2 * N_MOTION * n].split_at_mut(N_MOTION * n);
    for ((polynomial, end_slope), out) in polynomials.iter().zip([0.0, 1.0]).zip([rest, rise]) {
        let end = polynomial.at(end_time)[0];
        let (s, out) = out.split_at_mut(n);
        let (s_dot, s_ddot) = out.split_at_mut(n);
        for i in 0..n {
            let after = end + end_slope * (times[i] - end_time);
            s[i] = if times[i] < end_time + 1e-9 { polynomial.at(times[i])[0] } else { after };
        }
        for i in 0..n {
            s_dot[i] = if times[i] < end_time + 1e-9 { polynomial.at(times[i])[1] } else { end_slope };
        }
        for i in 0..n {
            s_ddot[i] = if times[i] < end_time + 1e-9 { polynomial.at(times[i])[2] } else { 0.0 };
        }
    }
    for k in 0..2 {
        // Speeds and accelerations.
        let (exact, out) =
            (&motions[(k * N_MOTION + 1) * n..(k + 1) * N_MOTION * n], &mut coarse[2 * k * n..2 * (k + 1) * n]);
        for i in 0..2 * n {
            out[i] = exact[i] as f32;
        }
    }
}

multiversion! {
    fn write_sums = sums_of, (rest: &[f64], rise: &[f64], factor: f64, out: &mut [f64])
}

#[inline(always)]
fn sums_of(rest: &[f64], rise: &[f64], factor: f64, out: &mut [f64]) {
    let n = out.len();
    let (rest, rise) = (&rest[..n], &rise[..n]);
    for i in 0..n {
        out[i] = rest[i] + factor * rise[i];
    }
}

multiversion! {
    fn raise_to_sums = raise_all, (rest: &[f64], rise: &[f64], factor: f64, out: &mut [f64])
}

#[inline(always)]
fn raise_all(rest: &[f64], rise: &[f64], factor: f64, out: &mut [f64]) {
    let n = out.len();
    let (rest, rise) = (&rest[..n], &rise[..n]);
    for i in 0..n {
        let sum = rest[i] + factor * rise[i];
        out[i] = if sum > out[i] { sum } else { out[i] };
    }
}

multiversion! {
    fn checked = check_at, (coarse: &[f32], end_velocity: f32, limits: &LongitudinalLimits) -> ProfileCheck
}

#[inline(always)]
fn check_at(coarse: &[f32], end_velocity: f32, limits: &LongitudinalLimits) -> ProfileCheck {
    let n = coarse.len() / 4;
    let (speed, acceleration) = (&coarse[..n], &coarse[n..2 * n]);
    let (more_speed, more_acceleration) = (&coarse[2 * n..3 * n], &coarse[3 * n..4 * n]);
    let (mut doubts, mut slow) = (0_u32, 0_u32);
    for i in 0..n {
        let v = speed[i] + end_velocity * more_speed[i];
        let a = acceleration[i] + end_velocity * more_acceleration[i];
        doubts |= u32::from(!limits.surely_holds(v, a));
        slow |= u32::from(v < limits.low_velocity);
    }
    ProfileCheck { is_doubtful: doubts != 0, is_slow: slow != 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    #[test]
    fn members_of_a_family_are_the_polynomials_with_their_end_speeds() {
        let mut random = Lcg::new(4);
        let times: Vec<f64> = (0..32).map(|i| 0.1 * f64::from(i)).collect();
        let mut profiles = VelocityKeepingProfiles::default();
        for _ in 0..100 {
            let from = [random.within(0.0, 500.0), random.within(0.0, 30.0), random.within(-5.0, 3.0)];
            let (end_time, end_velocity) = (random.within(0.5, 3.0), random.within(0.0, 30.0));
            let polynomial = Polynomial::to_slope(from, end_velocity, end_time);
            profiles.clear(times.len());
            let family = profiles.push(from, end_time, &times);
            let mut motion = [0.0; 32 * N_MOTION];
            profiles.write(family, end_velocity, &mut motion);
            for (i, time) in times.iter().enumerate() {
                let [mut s, mut s_dot, mut s_ddot, _] = polynomial.at(time.min(end_time));
                if *time > end_time {
                    (s, s_dot, s_ddot) = (s + end_velocity * (time - end_time), end_velocity, 0.0);
                }
                let found = [motion[i], motion[32 + i], motion[64 + i]];
                for (found, expected) in found.into_iter().zip([s, s_dot, s_ddot]) {
                    assert!((found - expected).abs() < 1e-11 * expected.abs().max(100.0), "{found} {expected}");
                }
                assert_eq!(profiles.arc_length(family, end_velocity, i), motion[i]);
            }
            assert_eq!(motion[0], from[0]);
        }
    }
}
