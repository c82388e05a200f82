//! Polynomials of time (or arc length) that join a state to an end condition, and the braking profile.

/// `c0 + c1 x + ... + c5 x^5`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Polynomial {
    pub(super) c: [f64; 6],
}

impl Polynomial {
    /// Quartic from (value, slope, second derivative) to slope `end_slope` with second derivative 0 at `length`.
    pub(super) fn to_slope(start: [f64; 3], end_slope: f64, length: f64) -> Self {
        let [c0, c1, a0] = start;
        let w = end_slope - c1 - a0 * length;
        let e = -a0;
        let per_length = length.recip();
        let squared = per_length * per_length;
        let c3 = (w - e * length * (1.0 / 3.0)) * squared;
        let c4 = (0.25 * e * length - 0.5 * w) * squared * per_length;
        Self { c: [c0, c1, 0.5 * a0, c3, c4, 0.0] }
    }

    /// Quintic from (value, slope, second derivative) to rest at the value `end` at `length`.
    pub(super) fn to_rest(start: [f64; 3], end: f64, length: f64) -> Self {
        let [c0, c1, a0] = start;
        let h = length;
        let g = end - c0 - c1 * h - 0.5 * a0 * h * h;
        let w = -c1 - a0 * h;
        let e = -a0;
        let c3 = (10.0 * g - 4.0 * w * h + 0.5 * e * h * h) / h.powi(3);
        let c4 = (-15.0 * g + 7.0 * w * h - e * h * h) / h.powi(4);
        let c5 = (6.0 * g - 3.0 * w * h + 0.5 * e * h * h) / h.powi(5);
        Self { c: [c0, c1, 0.5 * a0, c3, c4, c5] }
    }

    /// Quartic from (value, slope) to rest at the value `end` at `length`; its second derivative at the start is what
    /// suits it.
    pub(super) fn to_rest_from_free(start: [f64; 2], end: f64, length: f64) -> Self {
        let [c0, c1] = start;
        let h = length;
        let (rise, run) = (end - c0, c1 * h);
        // end + a y³ + b y⁴ with y = length - x, expanded.
        let (a, b) = (run - 4.0 * rise, 3.0 * rise - run);
        Self { c: [c0, c1, (3.0 * a + 6.0 * b) / h.powi(2), (-a - 4.0 * b) / h.powi(3), b / h.powi(4), 0.0] }
    }

    /// Value and first three derivatives.
    #[inline(always)]
    pub(super) fn at(&self, x: f64) -> [f64; 4] {
        let [c0, c1, c2, c3, c4, c5] = self.c;
        [
            c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))),
            c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5))),
            2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)),
            6.0 * c3 + x * (24.0 * c4 + x * 60.0 * c5),
        ]
    }

    /// Integral of the squared third derivative from 0 to `x`.
    pub(super) fn squared_jerk(&self, x: f64) -> f64 {
        let [_, _, _, c3, c4, c5] = self.c;
        let x2 = x * x;
        36.0 * c3 * c3 * x
            + 144.0 * c3 * c4 * x2
            + (192.0 * c4 * c4 + 240.0 * c3 * c5) * x2 * x
            + 720.0 * c4 * c5 * x2 * x2
            + 720.0 * c5 * c5 * x2 * x2 * x
    }
}

/// Braking to rest: the acceleration goes to `-deceleration` with a limited rate, stays there and is 0 at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Braking {
    velocity: f64,
    acceleration: f64,
    deceleration: f64,
    /// Rate of the acceleration in the first phase [m/s³], negative or 0.
    rate: f64,
    /// End of the first phase [s].
    ramp_end: f64,
    /// Time at rest [s].
    stop_time: f64,
}

/// Rate at which brakes take hold [m/s³].
const BRAKE_RATE: f64 = 40.0;

impl Braking {
    /// From a speed (not negative) and an acceleration. An agent that already brakes harder keeps braking as hard.
    pub(super) fn new(velocity: f64, acceleration: f64, deceleration: f64) -> Self {
        let deceleration = deceleration.max(-acceleration);
        let ramp_end = (acceleration + deceleration) / BRAKE_RATE;
        let after_ramp = velocity + (acceleration - 0.5 * BRAKE_RATE * ramp_end) * ramp_end;
        let stop_time = if after_ramp > 0.0 {
            ramp_end + after_ramp / deceleration
        } else {
            // Zero of velocity + acceleration t - rate t² / 2.
            (acceleration + (acceleration * acceleration + 2.0 * BRAKE_RATE * velocity).sqrt()) / BRAKE_RATE
        };
        Self { velocity, acceleration, deceleration, rate: -BRAKE_RATE, ramp_end, stop_time }
    }

    /// Distance, speed, acceleration and its rate at a time [s].
    pub(super) fn at(&self, t: f64) -> [f64; 4] {
        if t >= self.stop_time {
            return [self.moving_at(self.stop_time)[0], 0.0, 0.0, 0.0];
        }
        self.moving_at(t)
    }

    fn moving_at(&self, t: f64) -> [f64; 4] {
        let ramp = t.min(self.ramp_end);
        let speed = self.velocity + ramp * (self.acceleration + 0.5 * self.rate * ramp);
        let distance = ramp * (self.velocity + ramp * (0.5 * self.acceleration + self.rate * ramp / 6.0));
        if t <= self.ramp_end {
            return [distance, speed, self.acceleration + self.rate * ramp, self.rate];
        }
        let rest = t - self.ramp_end;
        [
            distance + rest * (speed - 0.5 * self.deceleration * rest),
            speed - self.deceleration * rest,
            -self.deceleration,
            0.0,
        ]
    }

    /// Time at which the agent stands [s].
    pub(super) fn stop_time(&self) -> f64 {
        self.stop_time
    }

    /// Integral of the squared jerk from 0 to `t`; the jolt at the stop counts like a ramp.
    pub(super) fn squared_jerk(&self, t: f64) -> f64 {
        let jolt = if t >= self.stop_time { -self.moving_at(self.stop_time)[2] / BRAKE_RATE } else { 0.0 };
        self.rate * self.rate * (t.min(self.ramp_end).min(self.stop_time) + jolt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quartic_meets_its_end_conditions() {
        let q = Polynomial::to_slope([20.0, 10.0, 0.4], 8.0, 2.0);
        assert_eq!(q.at(0.0)[..3], [20.0, 10.0, 0.4]);
        assert!((q.at(2.0)[1] - 8.0).abs() < 1e-12 && q.at(2.0)[2].abs() < 1e-12);
    }

    #[test]
    fn the_quintic_meets_its_end_conditions() {
        let q = Polynomial::to_rest([0.5, 1.0, -0.3], 1.25, 1.7);
        let end = q.at(1.7);
        assert!((end[0] - 1.25).abs() < 1e-12 && end[1].abs() < 1e-12 && end[2].abs() < 1e-12);
    }

    #[test]
    fn the_free_quartic_meets_its_end_conditions() {
        let q = Polynomial::to_rest_from_free([0.5, -0.3], 1.25, 1.7);
        assert_eq!(q.at(0.0)[..2], [0.5, -0.3]);
        let end = q.at(1.7);
        assert!((end[0] - 1.25).abs() < 1e-12 && end[1].abs() < 1e-12 && end[2].abs() < 1e-12);
    }

    #[test]
    fn squared_jerk_agrees_with_the_values_of_the_published_planner_over_its_first_tenth_of_a_second() {
        // Cases A and B: longitudinal start 20, 10, 0.4; lateral start by time 0.5, 0.1, 0.05.
        let lateral = [0.5, 0.1, 0.05];
        for (end_time, v1, d1, j_lat, j_lon) in
            [(2.0, 8.0, 1.25, 1.214875, 1.145216), (1.4, 12.0, -0.75, 7.517354, 1.457373)]
        {
            let s = Polynomial::to_slope([20.0, 10.0, 0.4], v1, end_time);
            let d = Polynomial::to_rest(lateral, d1, end_time);
            assert!((s.squared_jerk(0.1).sqrt() - j_lon).abs() < 1e-6);
            assert!((d.squared_jerk(0.1).sqrt() - j_lat).abs() < 1e-6);
        }
        // Case C, lateral over arc length.
        let s = Polynomial::to_slope([20.0, 1.5, 0.2], 3.0, 3.0);
        let d = Polynomial::to_rest([0.3, 0.02, 0.01], 0.75, s.at(3.0)[0] - 20.0);
        assert!((s.squared_jerk(0.1).sqrt() - 0.223521).abs() < 1e-6);
        assert!((d.squared_jerk(0.1).sqrt() - 0.016273).abs() < 1e-6);
    }

    #[test]
    fn squared_jerk_agrees_with_numerical_integration() {
        let q = Polynomial::to_rest([0.5, 1.0, -0.3], 1.25, 1.7);
        let n = 10_000;
        let h = 1.7 / f64::from(n);
        let sum: f64 = (0..n).map(|i| q.at((f64::from(i) + 0.5) * h)[3].powi(2) * h).sum();
        assert!((q.squared_jerk(1.7) - sum).abs() < 1e-5 * sum);
    }

    #[test]
    fn braking_ends_at_rest_and_its_parts_fit_together() {
        for (v, a) in [(10.0, 0.0), (10.0, 3.0), (0.3, 2.0), (0.2, 0.0), (0.0, 0.0), (15.0, -9.5), (0.0, 1.0)] {
            let braking = Braking::new(v, a, 8.0);
            assert!(braking.stop_time() >= 0.0 && braking.stop_time().is_finite());
            assert!(braking.moving_at(braking.stop_time())[1].abs() < 1e-9, "{v} {a}");
            assert_eq!(braking.at(braking.stop_time() + 1.0)[1..], [0.0, 0.0, 0.0]);
            let h = 1e-5;
            for i in 1..40 {
                let t = braking.stop_time() * f64::from(i) / 40.0;
                let (low, high) = (braking.at(t - h), braking.at(t + h));
                assert!((high[0] - low[0] - 2.0 * h * braking.at(t)[1]).abs() < 1e-8);
            }
        }
    }
}
