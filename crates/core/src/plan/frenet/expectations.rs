//! Where other participants are expected to be, and what it costs a point of a sample to be near: the prediction cost.

use super::super::frame::Waypoint;
use super::by_time::ByTime;
use super::gaussian::{self, Normal2};
use super::settings::FrenetSettings;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;
use crate::wide::for_wide_machines;

/// Participants count for the prediction cost within this distance of the agent's box [m] (squared: 50 m²).
pub(super) const COST_REACH: f64 = 7.071_067_811_865_476;

/// Where one mode of a participant is expected to be at one point.
#[derive(Debug, Clone, Copy)]
struct Expectation {
    mean: Point,
    /// From the mean to the front left and front right corner of the footprint with margin [m].
    front_left: Point,
    front_right: Point,
    probability: f64,
    covariance: [f64; 3],
    /// Boxes farther than this from the mean have no probability or do not count [m], squared.
    reach_squared: f64,
}

/// The expectations of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Expectations {
    list: Vec<Expectation>,
    /// By point: mean, front left and right corner, covariance, squared reach.
    by_point: ByTime<10>,
}

impl Expectations {
    pub(super) fn clear(&mut self) {
        self.list.clear();
        self.by_point.clear();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// A footprint with a covariance (xx, xy, yy) [m²], world frame, at a point, with the probability of its mode.
    pub(super) fn push(
        &mut self,
        point: usize,
        body: &OrientedBox,
        covariance: [f64; 3],
        probability: f64,
        settings: &FrenetSettings,
    ) {
        let ahead = body.axis * (body.half_length + 0.5 * settings.prediction_margin_length);
        let left = body.axis.left() * (body.half_width + 0.5 * settings.prediction_margin_width);
        let [xx, xy, yy] = covariance;
        let largest_variance = 0.5 * (xx + yy) + (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let reach =
            (ahead.norm_squared() + left.norm_squared()).sqrt() + gaussian::REACH * largest_variance.max(0.0).sqrt();
        let expectation = Expectation {
            reach_squared: reach.min(COST_REACH).powi(2),
            mean: body.center,
            front_left: ahead + left,
            front_right: ahead - left,
            probability,
            covariance,
        };
        let Expectation { mean, front_left: a, front_right: b, reach_squared, .. } = expectation;
        self.by_point.push(point, [mean.x, mean.y, a.x, a.y, b.x, b.y, xx, xy, yy, reach_squared]);
        self.list.push(expectation);
    }

    /// To be called when all have been pushed.
    pub(super) fn sort(&mut self, n_points: usize) {
        self.by_point.sort(n_points);
    }

    /// Prediction cost of point number `i` (from 1 on) of a sample, for half the length and width of the agent.
    pub(super) fn cost(&self, point: &Waypoint, i: usize, half: (f64, f64)) -> f64 {
        summed_cost(&self.by_point, &self.list, point, i, half)
    }
}

/// A point of a sample from which expectations are seen.
#[derive(Debug, Clone, Copy)]
struct View {
    center: Point,
    axis: Point,
}

impl View {
    #[inline(always)]
    fn of(point: &Waypoint) -> Self {
        Self { center: point.center, axis: point.axis }
    }

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

    /// An expectation is in reach, and its centre or a corner may be in the agent's box: the nearest of them is not
    /// beyond what is left of the distribution, neither ahead nor aside.
    #[inline(always)]
    fn counts(
        &self,
        mean: Point,
        (front_left, front_right): (Point, Point),
        covariance: [f64; 3],
        reach_squared: f64,
        half: (f64, f64),
    ) -> bool {
        /// Rounding.
        const REACH_SQUARED: f64 = gaussian::REACH * gaussian::REACH * (1.0 + 1e-9);
        let positive = |x: f64| if x > 0.0 { x } else { 0.0 };
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let mean = self.in_body(mean - self.center);
        let (x, y) = (positive(mean.x.abs() - half.0), positive(mean.y.abs() - half.1));
        let (left, right) = (self.in_body(front_left), self.in_body(front_right));
        let ahead = positive(x - larger(left.x.abs(), right.x.abs()));
        let aside = positive(y - larger(left.y.abs(), right.y.abs()));
        let [xx, _, yy] = self.covariance_in_body(covariance);
        (x * x + y * y <= reach_squared)
            & (ahead * ahead <= REACH_SQUARED * larger(xx, gaussian::VARIANCE_MIN))
            & (aside * aside <= REACH_SQUARED * larger(yy, gaussian::VARIANCE_MIN))
    }
}

impl Expectation {
    /// 1000 times the probability of the mode times those of the centre and, at half weight, of the four corners.
    #[inline(always)]
    fn cost(&self, view: &View, half: (f64, f64)) -> f64 {
        if !view.counts(self.mean, (self.front_left, self.front_right), self.covariance, self.reach_squared, half) {
            return 0.0;
        }
        let mean = view.in_body(self.mean - view.center);
        let [xx, xy, yy] = view.covariance_in_body(self.covariance);
        let (front_left, front_right) = (view.in_body(self.front_left), view.in_body(self.front_right));
        let places = [-mean, -(mean - front_left), -(mean - front_right), -(mean + front_left), -(mean + front_right)];
        let [center, a, b, c, d] = Normal2::new(xx, xy, yy).probabilities_of_boxes(&places, half);
        1000.0 * self.probability * (center + 0.5 * (a + b + c + d))
    }
}

for_wide_machines! {
    /// The prediction cost of a point.
    fn summed_cost = cost_at, (
        by_point: &ByTime<10>,
        expectations: &[Expectation],
        point: &Waypoint,
        i: usize,
        half: (f64, f64),
    ) -> f64
}

#[inline(always)]
fn cost_at(by_point: &ByTime<10>, expectations: &[Expectation], point: &Waypoint, i: usize, half: (f64, f64)) -> f64 {
    let view = View::of(point);
    let is_far = !by_point.any(i, |[x, y, left_x, left_y, right_x, right_y, xx, xy, yy, reach_squared], k| {
        let corners = (Point::new(left_x[k], left_y[k]), Point::new(right_x[k], right_y[k]));
        u64::from(view.counts(Point::new(x[k], y[k]), corners, [xx[k], xy[k], yy[k]], reach_squared[k], half))
    });
    if is_far {
        return 0.0;
    }
    let mut sum = 0.0;
    for index in by_point.of(i) {
        sum += expectations[*index].cost(&view, half);
    }
    sum
}
