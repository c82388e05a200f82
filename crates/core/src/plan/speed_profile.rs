//! How fast a path may be driven: speed limits and curves, on a grid of arc lengths.

use crate::geometry::polyline::ReferencePath;
use crate::road::RoadNetwork;

/// Spacing of the grid [m].
const SPACING: f64 = 2.0;

/// Speed limits along a path.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SpeedLimits {
    /// Limit [m/s] from every multiple of the spacing on; infinite where there is none.
    values: Vec<f64>,
}

impl SpeedLimits {
    /// Of the lanelets of a route that the path lies on; the highest where several overlap.
    pub fn along(path: &ReferencePath, lanelets: &[usize], road: &RoadNetwork) -> Self {
        let limit_of = |lanelet: &usize| {
            let limit = road.lanelets()[*lanelet].speed_limit;
            if limit.is_nan() { f64::INFINITY } else { limit }
        };
        if lanelets.iter().all(|lanelet| limit_of(lanelet).is_infinite()) {
            return Self::default();
        }
        let limit_at = |i: usize| {
            let here = road.lanelets_at(path.at(i as f64 * SPACING).position);
            here.iter().filter(|lanelet| lanelets.contains(lanelet)).map(limit_of).reduce(f64::max)
        };
        let n = (path.length() / SPACING) as usize + 1;
        Self { values: (0..n).map(|i| limit_at(i).unwrap_or(f64::INFINITY)).collect() }
    }

    /// The limit at an arc length [m/s].
    pub(super) fn at(&self, s: f64) -> f64 {
        let index = (s / SPACING).max(0.0) as usize;
        self.values.get(index.min(self.values.len().max(1) - 1)).copied().unwrap_or(f64::INFINITY)
    }
}

/// Speeds from which every limit ahead can be met with comfortable braking; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct SpeedProfile {
    from: f64,
    values: Vec<f64>,
}

impl SpeedProfile {
    /// From arc length `s` over `reach` [m].
    pub(super) fn fill(
        &mut self,
        path: &ReferencePath,
        limits: &SpeedLimits,
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
            let beyond = at > path.length();
            self.values.push(if beyond { limits.at(at) } else { curve.min(limits.at(at)) });
        }
        for i in (0..n - 1).rev() {
            let reachable = (self.values[i + 1].powi(2) + 2.0 * deceleration * SPACING).sqrt();
            self.values[i] = self.values[i].min(reachable);
        }
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
    use crate::road::testing::{arc, lane, open, straight};

    #[test]
    fn before_a_bend_the_pace_falls_with_the_comfortable_deceleration() {
        let mut points = straight((0.0, 0.0), (60.0, 0.0));
        points.extend(arc((60.0, 20.0), 20.0, -std::f64::consts::FRAC_PI_2, 0.0).into_iter().skip(1));
        let path = ReferencePath::through(&points).expect("a path");
        let mut profile = SpeedProfile::default();
        profile.fill(&path, &SpeedLimits::default(), (0.0, 90.0), 2.0, 1.5);
        let bend = 40_f64.sqrt();
        assert!((profile.at(75.0) - bend).abs() < 0.2, "{}", profile.at(75.0));
        // 40 m before the bend: sqrt(40 + 2 * 1.5 * 40)
        assert!((profile.at(20.0) - 160_f64.sqrt()).abs() < 0.6, "{}", profile.at(20.0));
    }

    #[test]
    fn whoever_is_too_fast_for_any_road_looks_no_further_than_its_end() {
        let path = ReferencePath::through(&[Point::new(0.0, 0.0), Point::new(100.0, 0.0)]).expect("a path");
        let mut profile = SpeedProfile::default();
        profile.fill(&path, &SpeedLimits { values: vec![8.0] }, (0.0, 1e12), 2.0, 1.5);
        assert!(profile.values.len() < 60);
        assert_eq!(profile.at(1e9), 8.0);
    }

    #[test]
    fn a_speed_limit_holds_on_its_lanelet() {
        let mut first = lane(1, &straight((0.0, 0.0), (50.0, 0.0)));
        first.successors = vec![2];
        let mut second = lane(2, &straight((50.0, 0.0), (100.0, 0.0)));
        second.speed_limit = 8.0;
        let road = open(vec![first, second]);
        let path = ReferencePath::through(&[Point::new(0.0, 0.0), Point::new(100.0, 0.0)]).expect("a path");
        let limits = SpeedLimits::along(&path, &[0, 1], &road);
        assert_eq!((limits.at(20.0), limits.at(60.0)), (f64::INFINITY, 8.0));
    }
}
