//! Where other participants are expected to be, and what it costs a point of a sample to be near: the prediction cost.

use super::super::frame::Waypoint;
use super::by_time::{ByTime, GROUP};
use super::gaussian::{self, Footprint, Normal2};
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
}

/// The expectations of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Expectations {
    list: Vec<Expectation>,
    /// By point: mean from the origin, front left and right corner, covariance.
    by_point: ByTime<9>,
    origin: Point,
}

impl Expectations {
    /// Forgets everything. Numbers in single precision are relative to the origin, which should be near.
    pub(super) fn clear(&mut self, origin: Point) {
        self.list.clear();
        self.by_point.clear();
        self.origin = origin;
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
        let expectation = Expectation {
            mean: body.center,
            front_left: ahead + left,
            front_right: ahead - left,
            probability,
            covariance,
        };
        let Expectation { front_left: a, front_right: b, .. } = expectation;
        let mean = expectation.mean - self.origin;
        let numbers = [mean.x, mean.y, a.x, a.y, b.x, b.y, xx, xy, yy];
        self.by_point.push(point, numbers.map(|number| number as f32));
        self.list.push(expectation);
    }

    /// To be called when all have been pushed.
    pub(super) fn sort(&mut self, n_points: usize) {
        self.by_point.sort(n_points);
    }

    /// Prediction cost of point number `i` (from 1 on) of a sample, for half the length and width of the agent.
    pub(super) fn cost(&self, point: &Waypoint, i: usize, half: (f64, f64)) -> f64 {
        summed_cost(self, point, i, half)
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
    fn counts(&self, expectation: &Expectation, half: (f64, f64)) -> bool {
        /// Rounding.
        const REACH_SQUARED: f64 = gaussian::REACH * gaussian::REACH * (1.0 + 1e-9);
        let positive = |x: f64| if x > 0.0 { x } else { 0.0 };
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let mean = self.in_body(expectation.mean - self.center);
        let (x, y) = (positive(mean.x.abs() - half.0), positive(mean.y.abs() - half.1));
        let (left, right) = (self.in_body(expectation.front_left), self.in_body(expectation.front_right));
        let ahead = positive(x - larger(left.x.abs(), right.x.abs()));
        let aside = positive(y - larger(left.y.abs(), right.y.abs()));
        let [xx, _, yy] = self.covariance_in_body(expectation.covariance);
        (x * x + y * y <= COST_REACH * COST_REACH)
            & (ahead * ahead <= REACH_SQUARED * larger(xx, gaussian::VARIANCE_MIN))
            & (aside * aside <= REACH_SQUARED * larger(yy, gaussian::VARIANCE_MIN))
    }
}

impl Expectation {
    /// 1000 times the probability of the mode times those of the centre and, at half weight, of the four corners.
    #[inline(always)]
    fn cost(&self, view: &View, half: (f64, f64)) -> f64 {
        if !view.counts(self, half) {
            return 0.0;
        }
        let [xx, xy, yy] = view.covariance_in_body(self.covariance);
        let mean = Footprint {
            center: view.in_body(self.mean - view.center),
            front_left: view.in_body(self.front_left),
            front_right: view.in_body(self.front_right),
        };
        let probability = Normal2::new(xx, xy, yy).centre_and_corners(&mean, half);
        1000.0 * self.probability * f64::from(probability)
    }
}

/// The same view in single precision: it sees at least what counts.
#[derive(Debug, Clone, Copy)]
struct RoughView {
    center: [f32; 2],
    axis: [f32; 2],
    half: [f32; 2],
}

impl RoughView {
    #[inline(always)]
    fn of(view: &View, origin: Point, half: (f64, f64)) -> Self {
        let center = view.center - origin;
        Self {
            center: [center.x as f32, center.y as f32],
            axis: [view.axis.x as f32, view.axis.y as f32],
            half: [half.0 as f32, half.1 as f32],
        }
    }

    /// As `View::counts`, one of a group.
    #[inline(always)]
    fn may_count(&self, [x, y, left_x, left_y, right_x, right_y, xx, xy, yy]: &[[f32; GROUP]; 9], k: usize) -> u32 {
        /// More than coordinates within a kilometre are rounded by [m].
        const SLACK: f32 = 2e-3;
        /// More than rounding changes a variance by, as a fraction of the sum of both.
        const VARIANCE_SLACK: f32 = 2e-6;
        const REACH_SQUARED: f32 = (gaussian::REACH * gaussian::REACH * 1.001) as f32;
        const VARIANCE_MIN: f32 = (gaussian::VARIANCE_MIN * 1.001) as f32;
        // What is no number stays none, and then no comparison holds.
        let positive = |x: f32| if x < 0.0 { 0.0 } else { x };
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let [cos, sin] = self.axis;
        let ahead = |x: f32, y: f32| (x * cos + y * sin).abs();
        let aside = |x: f32, y: f32| (y * cos - x * sin).abs();
        let (x, y) = (x[k] - self.center[0], y[k] - self.center[1]);
        let (x, y) = (positive(ahead(x, y) - self.half[0] - SLACK), positive(aside(x, y) - self.half[1] - SLACK));
        let (left_x, left_y, right_x, right_y) = (left_x[k], left_y[k], right_x[k], right_y[k]);
        let (xx, xy, yy) = (xx[k], xy[k], yy[k]);
        let beyond = positive(x - larger(ahead(left_x, left_y), ahead(right_x, right_y)));
        let beside = positive(y - larger(aside(left_x, left_y), aside(right_x, right_y)));
        let slack = VARIANCE_SLACK * (xx + yy);
        let (cc, cs, ss) = (cos * cos, 2.0 * cos * sin, sin * sin);
        let along = cc * xx + cs * xy + ss * yy + slack;
        let across = ss * xx - cs * xy + cc * yy + slack;
        u32::from(
            (x * x + y * y <= (COST_REACH * COST_REACH) as f32)
                & (beyond * beyond <= REACH_SQUARED * larger(along, VARIANCE_MIN))
                & (beside * beside <= REACH_SQUARED * larger(across, VARIANCE_MIN)),
        )
    }
}

for_wide_machines! {
    /// The prediction cost of a point.
    fn summed_cost = cost_at, (expectations: &Expectations, point: &Waypoint, i: usize, half: (f64, f64)) -> f64
}

#[inline(always)]
fn cost_at(expectations: &Expectations, point: &Waypoint, i: usize, half: (f64, f64)) -> f64 {
    let Expectations { list, by_point, origin } = expectations;
    let view = View::of(point);
    let rough = RoughView::of(&view, *origin, half);
    let mut sum = 0.0;
    let (mut group, end) = by_point.groups(i);
    while group < end {
        let mut passing = by_point.passing(group, |numbers, k| rough.may_count(numbers, k));
        while passing != 0 {
            sum += list[by_point.number(group, passing)].cost(&view, half);
            passing &= passing - 1;
        }
        group += GROUP;
    }
    sum
}

#[cfg(test)]
mod tests;
