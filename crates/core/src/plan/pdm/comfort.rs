//! Whether a proposal is comfortable: bounds of the closed-loop benchmark of nuPlan, as the published planner applies them.

use super::super::driven_point::DrivenPoint;

/// Acceleration along the heading [m/s²].
const ACCELERATION: (f64, f64) = (-4.05, 2.40);
/// Acceleration across it [m/s²].
const LATERAL_MAX: f64 = 4.89;
/// Change of the size of the acceleration, and of that along the heading [m/s³].
const JERK_MAX: f64 = 8.37;
const JERK_ALONG_MAX: f64 = 4.13;
/// Turning [rad/s], and its change [rad/s²].
const YAW_RATE_MAX: f64 = 0.95;
const YAW_ACCELERATION_MAX: f64 = 1.93;
/// Changes of the yaw rate are slopes over this many points.
const YAW_WINDOW: usize = 5;

/// The parabola of least squares through values at equal steps: value in the middle, slope and half the curvature there,
/// by steps.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Parabola {
    half: f64,
    middle: f64,
    slope: f64,
    bend: f64,
}

impl Parabola {
    fn through(values: impl ExactSizeIterator<Item = f64>) -> Self {
        let n = values.len() as f64;
        let half = 0.5 * (n - 1.0);
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        let (mut squares, mut fourths) = (0.0, 0.0);
        for (i, value) in values.enumerate() {
            let at = i as f64 - half;
            let square = at * at;
            sum += value;
            first += at * value;
            second += square * value;
            squares += square;
            fourths += square * square;
        }
        let spread = fourths - squares * squares / n;
        let bend = if spread > 0.0 { (second - squares * sum / n) / spread } else { 0.0 };
        let slope = if squares > 0.0 { first / squares } else { 0.0 };
        Self { half, middle: (sum - bend * squares) / n, slope, bend }
    }

    /// Least and largest value.
    fn range(&self) -> (f64, f64) {
        let at = |x: f64| self.middle + (self.slope + self.bend * x) * x;
        let ends = (at(-self.half), at(self.half));
        let apex = -0.5 * self.slope / self.bend;
        let third = if apex.abs() <= self.half { at(apex) } else { ends.0 };
        (ends.0.min(ends.1).min(third), ends.0.max(ends.1).max(third))
    }

    /// Largest slope in size, per step.
    fn steepest(&self) -> f64 {
        (self.slope - 2.0 * self.bend * self.half).abs().max((self.slope + 2.0 * self.bend * self.half).abs())
    }
}

/// All bounds are kept, for points this far apart [s].
pub(super) fn is_comfortable(points: &[DrivenPoint], step: f64) -> bool {
    let across = |point: &DrivenPoint| point.velocity * point.velocity * point.curvature;
    let along = Parabola::through(points.iter().map(|point| point.acceleration));
    let lateral = Parabola::through(points.iter().map(across)).range();
    let size = Parabola::through(points.iter().map(|point| point.acceleration.hypot(across(point))));
    let (least, most) = along.range();
    let yaw_rate = |point: &DrivenPoint| point.velocity * point.curvature;
    let changes = points.windows(YAW_WINDOW.min(points.len())).map(|window| {
        let slope = Parabola::through(window.iter().map(yaw_rate)).slope;
        slope.abs() / step
    });
    least > ACCELERATION.0
        && most < ACCELERATION.1
        && lateral.0 > -LATERAL_MAX
        && lateral.1 < LATERAL_MAX
        && size.steepest() / step < JERK_MAX
        && along.steepest() / step < JERK_ALONG_MAX
        && points.iter().all(|point| yaw_rate(point).abs() < YAW_RATE_MAX)
        && changes.fold(0.0, f64::max) < YAW_ACCELERATION_MAX
}

#[cfg(test)]
mod tests {
    use super::super::super::driven_point::DrivenPoint;
    use super::{Parabola, is_comfortable};
    use crate::geometry::Point;

    fn points(n: usize, of: impl Fn(f64) -> (f64, f64, f64)) -> Vec<DrivenPoint> {
        let point = |i: usize| {
            let (velocity, acceleration, curvature) = of(i as f64 * 0.1);
            let (center, axis) = (Point::default(), Point::new(1.0, 0.0));
            DrivenPoint { center, axis, theta: 0.0, curvature, velocity, acceleration, s: 0.0, d: 0.0 }
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn a_parabola_is_found_again() {
        let of = |x: f64| 2.0 + 3.0 * x - 0.5 * x * x;
        let found = Parabola::through((0..7).map(|i| of(f64::from(i) - 3.0)));
        for (value, expected) in [(found.middle, 2.0), (found.slope, 3.0), (found.bend, -0.5)] {
            assert!((value - expected).abs() < 1e-12, "{found:?}");
        }
        // The apex is at 3, the steepest end at -3.
        assert!((found.range().1 - 6.5).abs() < 1e-12 && (found.range().0 + 11.5).abs() < 1e-12);
        assert!((found.steepest() - 6.0).abs() < 1e-12);
        assert_eq!(Parabola::through([4.0].into_iter()).range(), (4.0, 4.0));
    }

    #[test]
    fn each_bound_counts() {
        assert!(is_comfortable(&points(41, |_| (10.0, 2.3, 0.0)), 0.1));
        assert!(!is_comfortable(&points(41, |_| (10.0, 2.5, 0.0)), 0.1), "acceleration");
        assert!(!is_comfortable(&points(41, |_| (10.0, -4.1, 0.0)), 0.1), "braking");
        // 10² · 0.05 = 5 m/s², 0.5 rad/s
        assert!(!is_comfortable(&points(41, |_| (10.0, 0.0, -0.05)), 0.1), "across");
        // 5 · 0.2 = 1 rad/s, 5 m/s²; 2 m/s alone: 0.8 m/s², 0.4 rad/s
        assert!(!is_comfortable(&points(41, |_| (4.0, 0.0, 0.25)), 0.1), "yaw rate");
        // -2.5 to 2 m/s² within 0.9 s: 5 m/s³
        assert!(!is_comfortable(&points(10, |t| (10.0, 5.0 * t - 2.5, 0.0)), 0.1), "jerk");
        // 0.1 to 0.7 rad/s in 0.3 s, and back
        assert!(!is_comfortable(&points(41, |t| (3.0, 0.0, 0.2 * (7.0 * t).sin())), 0.1), "yaw acceleration");
    }
}
