//! What it costs a point of a sample to be near where other participants are expected: the prediction cost.

use super::gaussian::{Footprint, Normal2};
use crate::geometry::Point;
use crate::simd::multiversion;

/// Participants count for the prediction cost within this distance of the agent's box [m] (squared: 50 m²).
pub(super) const COST_REACH: f64 = 7.071_067_811_865_476;

/// Where one mode of a participant is expected to be at one point.
#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedFootprint {
    mean: Point,
    /// From the mean to the front left and front right corner of the footprint with margin [m].
    front_left: Point,
    front_right: Point,
    /// 1000 times the probability of the mode.
    weight: f64,
    covariance: [f64; 3],
}

impl PredictedFootprint {
    /// Around a mean, along an axis; half length and width with margin [m], covariance [m²], probability of the mode.
    pub(super) fn new((mean, axis): (Point, Point), half: (f64, f64), covariance: [f64; 3], probability: f64) -> Self {
        // To the corners single precision does.
        let (length, width) = (half.0 as f32, half.1 as f32);
        let (x, y) = (axis.x as f32, axis.y as f32);
        let (long_x, long_y, wide_x, wide_y) = (length * x, length * y, -width * y, width * x);
        let corner = |x: f32, y: f32| Point::new(x.into(), y.into());
        Self {
            mean,
            front_left: corner(long_x + wide_x, long_y + wide_y),
            front_right: corner(long_x - wide_x, long_y - wide_y),
            weight: 1000.0 * probability,
            covariance,
        }
    }

    /// The weight times the probabilities of the centre and, at half weight, of the four corners.
    #[inline(always)]
    fn cost(&self, view: &View, half: (f64, f64)) -> f64 {
        let center = view.in_body(self.mean - view.center);
        let positive = |x: f64| if x > 0.0 { x } else { 0.0 };
        let (x, y) = (positive(center.x.abs() - half.0), positive(center.y.abs() - half.1));
        if x * x + y * y > COST_REACH * COST_REACH {
            return 0.0;
        }
        let [xx, xy, yy] = view.covariance_in_body(self.covariance);
        let mean = Footprint {
            center,
            front_left: view.in_body(self.front_left),
            front_right: view.in_body(self.front_right),
        };
        self.weight * f64::from(Normal2::new(xx, xy, yy).centre_and_corners(&mean, half))
    }
}

/// A point of a sample from which expectations are seen.
#[derive(Debug, Clone, Copy)]
struct View {
    center: Point,
    axis: Point,
}

impl View {
    /// A vector in the body frame.
    #[inline(always)]
    fn in_body(&self, v: Point) -> Point {
        let (cos, sin) = (self.axis.x, self.axis.y);
        Point::new(v.x * cos + v.y * sin, v.y * cos - v.x * sin)
    }

    /// A covariance in the body frame.
    #[inline(always)]
    fn covariance_in_body(&self, [xx, xy, yy]: [f64; 3]) -> [f64; 3] {
        let (cos, sin) = (self.axis.x, self.axis.y);
        [
            cos * cos * xx + 2.0 * cos * sin * xy + sin * sin * yy,
            cos * sin * (yy - xx) + (cos * cos - sin * sin) * xy,
            sin * sin * xx - 2.0 * cos * sin * xy + cos * cos * yy,
        ]
    }
}

multiversion! {
    /// The prediction cost of a point of a sample, its centre and axis, for half the length and width of the agent. Footprints:
    /// (modes, points).
    pub(super) fn summed_cost = cost_at, (
        expected: &[Option<PredictedFootprint>],
        place: (usize, usize),
        point: (Point, Point),
        half: (f64, f64),
    ) -> f64
}

#[inline(always)]
fn cost_at(
    expected: &[Option<PredictedFootprint>],
    (mut place, n_points): (usize, usize),
    (center, axis): (Point, Point),
    half: (f64, f64),
) -> f64 {
    let view = View { center, axis };
    let mut sum = 0.0;
    while place < expected.len() {
        if let Some(footprint) = &expected[place] {
            sum += footprint.cost(&view, half);
        }
        place += n_points;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    /// Half length and width of the agent [m].
    const HALF: (f64, f64) = (2.254, 0.805);

    #[test]
    fn the_cost_of_a_point_is_that_of_each_footprint_with_and_without_avx2() {
        let mut random = Lcg::new(6);
        let mut n_positive = 0;
        for _ in 0..2000 {
            let mut expected: Vec<Option<PredictedFootprint>> = Vec::new();
            for _ in 0..random.within(0.0, 8.0) as usize {
                let mean = Point::new(random.within(-12.0, 12.0), random.within(-8.0, 8.0));
                // From hardly any spread to a wide one, with any correlation.
                let mut sigma = || 10_f64.powf(random.within(-3.5, 1.3));
                let (x, y) = (sigma(), sigma());
                let covariance = [x * x, random.within(-1.0, 1.0) * x * y, y * y];
                let axis = Point::from_angle(random.within(-4.0, 4.0));
                let footprint = PredictedFootprint::new((mean, axis), (2.5, 0.9), covariance, 0.3);
                expected.extend([Some(footprint), None]);
            }
            let point = (Point::default(), Point::from_angle(random.within(-4.0, 4.0)));
            let wide = summed_cost(&expected, (0, 2), point, HALF);
            let view = View { center: point.0, axis: point.1 };
            let one_by_one: f64 = expected.iter().flatten().map(|footprint| footprint.cost(&view, HALF)).sum();
            assert_eq!(wide.to_bits(), cost_at(&expected, (0, 2), point, HALF).to_bits());
            assert!((wide - one_by_one).abs() <= 1e-12 * wide);
            assert_eq!(summed_cost(&expected, (1, 2), point, HALF), 0.0, "nothing is expected at the next point");
            n_positive += usize::from(wide > 0.0);
        }
        assert!(n_positive > 500, "{n_positive} cost anything");
    }

    #[test]
    fn a_footprint_costs_nothing_further_away_than_its_reach() {
        let cost = |x: f64| {
            let axis = Point::new(1.0, 0.0);
            let footprint = PredictedFootprint::new((Point::new(x, 0.0), axis), (2.5, 0.9), [30.0, 0.0, 0.1], 1.0);
            summed_cost(&[Some(footprint)], (0, 1), (Point::default(), axis), HALF)
        };
        assert!(cost(HALF.0 + COST_REACH - 1e-6) > 1.0);
        assert_eq!(cost(HALF.0 + COST_REACH + 1e-6), 0.0);
    }
}
