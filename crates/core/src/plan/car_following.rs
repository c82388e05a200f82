//! The Intelligent Driver Model (IDM): how hard to accelerate, from the own speed and what is ahead.
//!
//! Sources: Treiber, Hennecke, Helbing, "Congested traffic states in empirical observations and microscopic
//! simulations", Phys. Rev. E 62, 2000, doi 10.1103/PhysRevE.62.1805; Treiber, Kesting, "Traffic Flow
//! Dynamics", Springer 2013, section 11.3 (table of parameters, improved model).

use crate::settings::{between, positive, settings};
use crate::vehicle::Vehicle;

/// A moving leader heads within 60 degrees of the path (cosine).
pub(super) const LEADER_HEADING_COSINE: f64 = 0.5;

/// Smaller gaps count as this one [m].
const GAP_MIN: f64 = 0.1;
/// Slower desired speeds count as this one [m/s].
const DESIRED_VELOCITY_MIN: f64 = 0.01;

settings! {
    /// Parameters of the Intelligent Driver Model.
    ///
    /// Defaults: Treiber and Kesting, "Traffic Flow Dynamics", 2013, table 11.2.
    pub struct CarFollowing as CarFollowing {
        /// Time gap T to a leader.
        time_gap: f64 ["s"] = 1.0, positive(60.0);
        /// Gap s0 to a standing leader.
        minimum_gap: f64 ["m"] = 2.0, between(0.0, 100.0);
        /// Acceleration a from standstill on a free road.
        acceleration: f64 ["m/s²"] = 1.0, positive(100.0);
        /// Comfortable deceleration b; where necessary it brakes up to the vehicle's limit.
        deceleration: f64 ["m/s²"] = 1.5, positive(100.0);
        /// Exponent of v / v0: how the acceleration falls as the speed nears the desired one.
        exponent: f64 = 4.0, positive(100.0);
    }
}

impl CarFollowing {
    /// Desired gap s* [m]: s0 + v T + v (v - vl) / (2 sqrt(a b)), where the part behind s0 is not
    /// negative (2013).
    pub fn desired_gap(&self, velocity: f64, leader_velocity: f64) -> f64 {
        let approach = (velocity - leader_velocity) / (2.0 * (self.acceleration * self.deceleration).sqrt());
        self.minimum_gap + (velocity * (self.time_gap + approach)).max(0.0)
    }

    /// Acceleration on a free road [m/s²]: a (1 - (v / v0)^delta); above the desired speed the braking of
    /// the improved model (2013): -b (1 - (v0 / v)^(a delta / b)).
    pub fn free(&self, velocity: f64, desired_velocity: f64) -> f64 {
        let v0 = desired_velocity.max(DESIRED_VELOCITY_MIN);
        if velocity <= v0 {
            self.acceleration * (1.0 - (velocity / v0).powf(self.exponent))
        } else {
            let exponent = self.acceleration * self.exponent / self.deceleration;
            -self.deceleration * (1.0 - (v0 / velocity).powf(exponent))
        }
    }

    /// What the leader takes away from the free acceleration [m/s²]: -a (s* / s)², not positive.
    pub fn interaction(&self, velocity: f64, gap: f64, leader_velocity: f64) -> f64 {
        let ratio = self.desired_gap(velocity, leader_velocity) / gap.max(GAP_MIN);
        -self.acceleration * ratio * ratio
    }

    /// The acceleration behind a leader without a desired speed [m/s²]: what is left of the model if the road ahead of it were
    /// free.
    pub(super) fn following(&self, velocity: f64, gap: f64, leader_velocity: f64) -> f64 {
        self.acceleration + self.interaction(velocity, gap, leader_velocity)
    }

    /// The free acceleration with what leaders and barriers take away from it [m/s²]. `allowed` is the acceleration if the
    /// road ahead of them were free, see `following`. The plain model adds both; the improved one, of which this is a share,
    /// does so only above the desired speed: below it, a follower at the wanted distance keeps its speed.
    pub(super) fn combined(&self, free: f64, allowed: f64, improved: f64) -> f64 {
        let taken = (allowed - self.acceleration).min(0.0);
        let plain = free + taken;
        if improved <= 0.0 {
            return plain;
        }
        let ratio = -taken / self.acceleration; // (s* / s)²
        let other = if ratio >= 1.0 {
            self.acceleration + taken + free.min(0.0)
        } else if free > 0.0 {
            free * (1.0 - ratio.powf(self.acceleration / free))
        } else {
            free
        };
        plain + improved * (other - plain)
    }

    /// The whole model [m/s²]: a (1 - (v / v0)^delta - (s* / s)²).
    pub fn acceleration(&self, velocity: f64, desired_velocity: f64, gap: f64, leader_velocity: f64) -> f64 {
        self.free(velocity, desired_velocity) + self.interaction(velocity, gap, leader_velocity)
    }
}

/// The desired acceleration within the vehicle's limits [m/s²].
pub(super) fn limited(acceleration: f64, velocity: f64, vehicle: &Vehicle) -> f64 {
    acceleration.clamp(-vehicle.acceleration_max, vehicle.forward_acceleration_max(velocity))
}

/// The drive at one point of a plan: way (counted from the arc length of the start), speed and acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PathMotion {
    pub(super) s: f64,
    pub(super) velocity: f64,
    /// Constant up to the next point (or until the vehicle stands).
    pub(super) acceleration: f64,
}

/// Integrates an acceleration law over `n_points` points: constant acceleration in between (ballistic update, Treiber
/// and Kanagaraj, Physica A 419, 2015), standing exactly where the speed becomes zero.
pub(super) fn integrate(
    (s, velocity): (f64, f64),
    n_points: usize,
    dt: f64,
    out: &mut Vec<PathMotion>,
    mut law: impl FnMut(usize, f64, f64) -> f64,
) {
    out.clear();
    let (mut s, mut velocity) = (s, velocity);
    for point in 0..n_points {
        let acceleration = law(point, s, velocity);
        let next = velocity + acceleration * dt;
        if next >= 0.0 {
            out.push(PathMotion { s, velocity, acceleration });
            s += (velocity + 0.5 * acceleration * dt) * dt;
            velocity = next;
        } else {
            // It stands within the interval; the mean acceleration is what its speeds show.
            out.push(PathMotion { s, velocity, acceleration: -velocity / dt });
            s += 0.5 * velocity * velocity / -acceleration;
            velocity = 0.0;
        }
    }
}

/// Gipps' safe speed [m/s]: the agent can stop without contact if the leader brakes as hard as the agent finds comfortable
/// (`b`, m/s²) and the agent reacts after `reaction` [s]. `gap` is what may be used up [m].
pub(super) fn safe_velocity(gap: f64, leader_velocity: f64, (reaction, b): (f64, f64)) -> f64 {
    let lag = b * reaction;
    let radicand = lag * lag + leader_velocity * leader_velocity.abs() + 2.0 * b * gap;
    (radicand.max(0.0).sqrt() - lag).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: CarFollowing =
        CarFollowing { time_gap: 1.5, minimum_gap: 2.0, acceleration: 1.0, deceleration: 4.0, exponent: 4.0 };

    #[test]
    fn who_has_its_time_gap_keeps_its_speed_in_the_improved_model_alone() {
        let (v, v0) = (18.0, 20.0);
        let free = LAW.free(v, v0);
        let behind = |gap: f64| LAW.following(v, gap, v);
        let wanted = LAW.desired_gap(v, v);
        assert!((LAW.combined(free, behind(wanted), 0.0) - (free - LAW.acceleration)).abs() < 1e-12);
        assert!(LAW.combined(free, behind(wanted), 1.0).abs() < 1e-12);
        assert!(LAW.combined(free, behind(0.9 * wanted), 1.0) < 0.0);
        assert!(LAW.combined(free, behind(1.1 * wanted), 1.0) > 0.0);
        let half = LAW.combined(free, behind(wanted), 0.5);
        assert!((half - 0.5 * (free - LAW.acceleration)).abs() < 1e-12);
    }

    #[test]
    fn both_models_are_one_without_a_leader_and_nearly_so_above_the_desired_speed() {
        for (v, v0, gap) in [(18.0, 20.0, f64::INFINITY), (22.0, 20.0, f64::INFINITY), (22.0, 20.0, 10.0)] {
            let (free, allowed) = (LAW.free(v, v0), LAW.following(v, gap, v));
            let (plain, improved) = (LAW.combined(free, allowed, 0.0), LAW.combined(free, allowed, 1.0));
            let expected = if gap.is_finite() { plain + LAW.acceleration } else { plain };
            assert!((improved - expected).abs() < 1e-12, "{v} {gap}");
        }
    }

    #[test]
    fn the_safe_speed_keeps_the_time_gap_to_a_leader_of_the_same_speed() {
        for v in [3.0, 10.0, 25.0] {
            assert!((safe_velocity(v * 0.85, v, (0.85, 3.0)) - v).abs() < 1e-9);
        }
        assert_eq!(safe_velocity(-5.0, 0.0, (1.0, 3.0)), 0.0);
        assert_eq!(safe_velocity(0.0, 0.0, (1.0, 3.0)), 0.0);
    }

    #[test]
    fn a_leader_that_reverses_takes_the_way_to_its_stop_from_the_gap() {
        // 2² / (2 · 3) m
        let standing = safe_velocity(10.0 - 4.0 / 6.0, 0.0, (0.85, 3.0));
        assert!((safe_velocity(10.0, -2.0, (0.85, 3.0)) - standing).abs() < 1e-9);
    }

    #[test]
    fn the_desired_gap_is_that_of_the_formula() {
        // 2 + v 1.5 + v (v - vl) / (2 sqrt(4)) = 2 + 1.5 v + v (v - vl) / 4
        for (v, vl, gap) in
            [(0.0, 0.0, 2.0), (10.0, 10.0, 17.0), (20.0, 10.0, 82.0), (20.0, 0.0, 132.0), (10.0, 16.0, 2.0)]
        {
            assert!((LAW.desired_gap(v, vl) - gap).abs() < 1e-12, "{v} {vl}");
        }
    }

    #[test]
    fn the_free_acceleration_is_that_of_the_formula() {
        for (v, v0, expected) in [
            (0.0, 20.0, 1.0),
            (10.0, 20.0, 1.0 - 1.0 / 16.0),
            (20.0, 20.0, 0.0),
            // above: -4 (1 - (v0 / v)^1)
            (25.0, 20.0, -0.8),
            (10.0, 0.0, -4.0 * (1.0 - 0.001)),
        ] {
            assert!((LAW.free(v, v0) - expected).abs() < 1e-12, "{v} {v0}");
        }
    }

    #[test]
    fn the_acceleration_behind_a_leader_is_that_of_the_formula() {
        for (v, v0, gap, vl, expected) in [
            // s* = 17
            (10.0, 20.0, 34.0, 10.0, 1.0 - 1.0 / 16.0 - 0.25),
            (10.0, 20.0, 17.0, 10.0, -1.0 / 16.0),
            // s* = 132
            (20.0, 20.0, 66.0, 0.0, -4.0),
            // s* = 2: the leader pulls away
            (10.0, 20.0, 4.0, 16.0, 1.0 - 1.0 / 16.0 - 0.25),
            (0.0, 20.0, 2.0, 0.0, 0.0),
        ] {
            assert!((LAW.acceleration(v, v0, gap, vl) - expected).abs() < 1e-12, "{v} {gap} {vl}");
        }
    }

    #[test]
    fn the_ballistic_update_is_exact_and_stops_where_the_parabola_does() {
        let mut out = Vec::new();
        integrate((5.0, 1.0), 4, 0.5, &mut out, |_, _, _| -1.5);
        // 1, 0.25, then rest after 0.25 / 1.5 s: 0.25² / 3 further.
        let s: Vec<f64> = out.iter().map(|m| m.s).collect();
        let rest = 5.3125 + 0.0625 / 3.0;
        for (found, expected) in s.iter().zip([5.0, 5.3125, rest, rest]) {
            assert!((found - expected).abs() < 1e-12, "{s:?}");
        }
        assert_eq!(out.iter().map(|m| m.velocity).collect::<Vec<_>>(), [1.0, 0.25, 0.0, 0.0]);
        assert_eq!(out[1].acceleration, -0.5);
    }

    #[test]
    fn an_impossible_parameter_is_named() {
        for (change, name) in [
            (CarFollowing { time_gap: 0.0, ..LAW }, "time_gap"),
            (CarFollowing { minimum_gap: -1.0, ..LAW }, "minimum_gap"),
            (CarFollowing { acceleration: f64::NAN, ..LAW }, "acceleration"),
            (CarFollowing { deceleration: -2.0, ..LAW }, "deceleration"),
            (CarFollowing { exponent: 0.0, ..LAW }, "exponent"),
        ] {
            assert!(change.validate().expect_err(name).to_string().starts_with(name));
        }
    }
}
