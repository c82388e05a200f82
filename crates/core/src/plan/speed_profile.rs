//! How fast a path may be driven: speed limits and curves, on a grid of arc lengths.

use crate::geometry::polyline::ReferencePath;
use crate::rules::SpeedLimits;

/// Spacing of the grid [m].
const SPACING: f64 = 2.0;

/// Speeds from which every limit ahead can be met with a given deceleration; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct SpeedProfile {
    from: f64,
    values: Vec<f64>,
}

impl SpeedProfile {
    /// From arc length `s` over `reach` [m]; limits count so far ahead [m].
    pub(super) fn fill(
        &mut self,
        path: &ReferencePath,
        (limits, ahead): (&SpeedLimits, f64),
        (s, reach): (f64, f64),
        lateral_acceleration: f64,
        deceleration: f64,
    ) {
        self.fill_below(path, |s| limits.at(s + ahead), (s, reach), lateral_acceleration, deceleration);
    }

    /// As [`SpeedProfile::fill`], with a limit [m/s] for every arc length [m].
    pub(super) fn fill_below(
        &mut self,
        path: &ReferencePath,
        limit: impl Fn(f64) -> f64,
        (s, reach): (f64, f64),
        lateral_acceleration: f64,
        deceleration: f64,
    ) {
        self.from = s;
        self.values.clear();
        let n = path.steps_from(s, SPACING, (reach / SPACING).ceil()) + 2;
        for i in 0..n {
            let at = s + i as f64 * SPACING;
            let curve = (lateral_acceleration / path.curvature_at(at).abs().max(1e-9)).sqrt();
            let (limit, beyond) = (limit(at), at > path.length());
            self.values.push(if beyond { limit } else { curve.min(limit) });
        }
        self.brake(deceleration);
    }

    /// Also slow enough to turn the wheels as fast as a line bends, for a steering rate [rad/s] and a wheelbase [m].
    pub(super) fn steer(&mut self, curvature: impl Fn(f64) -> f64, (rate, wheelbase): (f64, f64), deceleration: f64) {
        /// The change of curvature is that over twice this length [m].
        const HALF: f64 = 1.5;
        let n = self.values.len();
        for i in 0..n {
            let at = self.from + i as f64 * SPACING;
            let (before, after) = (curvature(at - HALF), curvature(at + HALF));
            let change = (after - before).abs() / (2.0 * HALF);
            // The tangent of the steering angle.
            let tangent = wheelbase * 0.5 * (before + after);
            let fastest = rate * (1.0 + tangent * tangent) / (wheelbase * change).max(1e-6);
            self.values[i] = self.values[i].min(fastest);
        }
        self.brake(deceleration);
    }

    /// Lowers speeds from which those ahead cannot be reached.
    fn brake(&mut self, deceleration: f64) {
        for i in (0..self.values.len() - 1).rev() {
            let reachable = (self.values[i + 1].powi(2) + 2.0 * deceleration * SPACING).sqrt();
            self.values[i] = self.values[i].min(reachable);
        }
    }

    /// Acceleration that brings an agent down to what is allowed ahead in time [m/s²]; infinite while it need not brake. The
    /// car-following model alone comes to bends too fast: it brakes the less, the nearer it is to its desired speed.
    pub(super) fn braking(&self, s: f64, velocity: f64, deceleration: f64) -> f64 {
        /// It follows falling speeds with this lag [s], ...
        const LAG: f64 = 1.0;
        /// ... and brakes with at most so many times the deceleration of the profile.
        const HARDEST: f64 = 2.0;
        let ahead = self.at(s + velocity * LAG);
        if ahead < velocity { ((ahead - velocity) / LAG).max(-HARDEST * deceleration) } else { f64::INFINITY }
    }

    /// Largest speed at an arc length [m/s].
    pub(super) fn at(&self, s: f64) -> f64 {
        let along = ((s - self.from) / SPACING).clamp(0.0, (self.values.len() - 1) as f64);
        let i = (along as usize).min(self.values.len() - 2);
        let (a, b) = (self.values[i], self.values[i + 1]);
        if a.is_finite() && b.is_finite() { a + (b - a) * (along - i as f64) } else { a.min(b) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::road::testing::{arc, straight};

    #[test]
    fn before_a_bend_the_pace_falls_with_the_comfortable_deceleration() {
        let mut points = straight((0.0, 0.0), (60.0, 0.0));
        points.extend(arc((60.0, 20.0), 20.0, -std::f64::consts::FRAC_PI_2, 0.0).into_iter().skip(1));
        let path = ReferencePath::through(&points).expect("a path");
        let mut profile = SpeedProfile::default();
        profile.fill(&path, (&SpeedLimits::default(), 0.0), (0.0, 90.0), 2.0, 1.5);
        let bend = 40_f64.sqrt();
        assert!((profile.at(75.0) - bend).abs() < 0.2, "{}", profile.at(75.0));
        // 40 m before the bend: sqrt(40 + 2 * 1.5 * 40)
        assert!((profile.at(20.0) - 160_f64.sqrt()).abs() < 0.6, "{}", profile.at(20.0));
    }

    #[test]
    fn braking_follows_a_falling_profile_without_lag() {
        let mut points = straight((0.0, 0.0), (60.0, 0.0));
        points.extend(arc((60.0, 20.0), 20.0, -std::f64::consts::FRAC_PI_2, 0.0).into_iter().skip(1));
        let path = ReferencePath::through(&points).expect("a path");
        let mut profile = SpeedProfile::default();
        profile.fill(&path, (&SpeedLimits::default(), 0.0), (0.0, 90.0), 2.0, 1.5);
        let braking = profile.braking(20.0, profile.at(20.0), 1.5);
        assert!((braking + 1.5).abs() < 0.15, "{braking}");
        assert_eq!(profile.braking(0.0, 5.0, 1.5), f64::INFINITY);
        assert_eq!(profile.braking(40.0, 30.0, 1.5), -3.0);
    }

    #[test]
    fn a_vehicle_too_fast_for_any_road_looks_no_further_than_its_end() {
        let path = ReferencePath::through(&[Point::new(0.0, 0.0), Point::new(100.0, 0.0)]).expect("a path");
        let mut profile = SpeedProfile::default();
        profile.fill(&path, (&SpeedLimits::uniform(8.0), 0.0), (0.0, 1e12), 2.0, 1.5);
        assert!(profile.values.len() < 60);
        assert_eq!(profile.at(1e9), 8.0);
    }
}
