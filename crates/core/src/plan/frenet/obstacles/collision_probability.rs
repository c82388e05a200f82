//! Where other participants are expected to be, and what it costs a point of a sample to be near: the prediction cost.

use super::super::settings::FrenetSettings;
use super::gaussian::{self, Footprint, Normal2};
use super::poses::{Poses, PredictedSteps};
use super::reach::{GROUP, ROUNDING, Reach};
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;
use crate::plan::PlanRequest;
use crate::plan::frame::Waypoint;
use crate::simd::multiversion;
use crate::trajectory::Predictions;

/// Participants count for the prediction cost within this distance of the agent's box [m] (squared: 50 m²).
pub(super) const COST_REACH: f64 = 7.071_067_811_865_476;

/// Where one mode of a participant is expected to be at one point. To the corners single precision does.
#[derive(Debug, Clone, Copy)]
struct PredictedFootprint {
    mean: Point,
    /// From the mean to the front left and front right corner of the footprint with margin [m].
    front_left: Point,
    front_right: Point,
    probability: f64,
    covariance: [f64; 3],
}

/// One mode of a participant.
#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedMode {
    /// Where it is predicted; `None` for what never moves.
    pub(super) steps: Option<PredictedSteps>,
    /// Its box now.
    pub(super) now: OrientedBox,
    /// Of the mode.
    pub(super) probability: f64,
    /// It counts only where the determinant of its covariance is not larger [m⁴].
    pub(super) determinant_max: f64,
    /// Covariance of what never moves [m²].
    pub(super) covariance: [f64; 3],
    /// From its position to the middle of its footprint, body frame [m].
    pub(super) offset: Point,
    /// Half length and width with margin [m].
    pub(super) half: (f64, f64),
}

/// Numbers of an expectation in single precision: mean from the origin, front left and right corner, covariance.
const N_NUMBERS: usize = 9;

/// Those of the expectations of a group of sources at one point.
type Cell = [[f32; GROUP]; N_NUMBERS];

/// The expectations of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct PredictedFootprints {
    sources: Vec<PredictedMode>,
    /// (points from 1 on, groups of sources)
    cells: Vec<Cell>,
    /// Which sources of a cell are expected there, a bit each.
    occupied: Vec<u8>,
    n_groups: usize,
    n_points: usize,
    origin: Point,
}

impl PredictedMode {
    pub(super) fn new(now: OrientedBox, settings: &FrenetSettings) -> Self {
        let half_length = now.half_length + 0.5 * settings.prediction_margin_length;
        let half_width = now.half_width + 0.5 * settings.prediction_margin_width;
        Self {
            steps: None,
            now,
            probability: 1.0,
            determinant_max: f64::INFINITY,
            covariance: [0.0; 3],
            offset: Point::default(),
            half: (half_length, half_width),
        }
    }

    /// Where it is expected at a point, and its covariance.
    #[inline(always)]
    fn at(&self, point: usize, request: &PlanRequest) -> (Point, [f64; 3]) {
        let Some(PredictedSteps { first, .. }) = self.steps else { return (self.now.center, self.covariance) };
        let (predictions, place) = (request.predictions, first + point - 1);
        let position = Point::new(predictions.x[place], predictions.y[place]);
        let [xx, xy, yy] = [&predictions.covariance_xx, &predictions.covariance_xy, &predictions.covariance_yy];
        let covariance = [xx[place], xy[place], yy[place]];
        if self.offset == Point::default() {
            return (position, covariance);
        }
        let axis = request.prediction_index.axis(place);
        (position + axis * self.offset.x + axis.left() * self.offset.y, covariance)
    }

    /// Covariances at points `GROUP * group + 1` and the following; beyond what is known they are not numbers.
    #[inline(always)]
    fn covariances(&self, group: usize, predictions: &Predictions) -> [[f64; GROUP]; 3] {
        let Some(PredictedSteps { first, n }) = self.steps else {
            return self.covariance.map(|number| [number; GROUP]);
        };
        let columns = [&predictions.covariance_xx, &predictions.covariance_xy, &predictions.covariance_yy];
        let mut out = [[f64::NAN; GROUP]; 3];
        for (out, column) in out.iter_mut().zip(columns) {
            let known = &column[first..first + n];
            if let Some([a, b, c, d, e, f, g, h]) = known.get(group * GROUP..(group + 1) * GROUP) {
                *out = [*a, *b, *c, *d, *e, *f, *g, *h];
            } else if let Some(rest) = known.get(group * GROUP..) {
                out[..rest.len()].copy_from_slice(rest);
            }
        }
        out
    }
}

impl PredictedFootprints {
    /// Clears everything and reserves `n_sources` sources.
    pub(super) fn begin(&mut self, n_sources: usize, reach: &Reach) {
        const NOTHING: Cell = [[f32::NAN; GROUP]; N_NUMBERS];
        self.sources.clear();
        self.origin = reach.origin;
        (self.n_points, self.n_groups) = (reach.stride(), n_sources.div_ceil(GROUP));
        self.occupied.clear();
        self.occupied.resize(self.n_points * self.n_groups, 0);
        // What is left in a cell from the plan before is hidden by its bits.
        self.cells.resize(self.n_points * self.n_groups, NOTHING);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Adds a source, which follows a poses, where the samples can get near it.
    pub(super) fn push(&mut self, source: PredictedMode, poses: &Poses, reach: &Reach, predictions: &Predictions) {
        if write_cells(self, &source, poses, reach, predictions) {
            self.sources.push(source);
        }
    }

    /// Prediction cost of point number `i` (from 1 on) of a sample, for half the length and width of the agent.
    pub(super) fn cost(&self, point: &Waypoint, i: usize, half: (f64, f64), request: &PlanRequest) -> f64 {
        summed_cost(self, point, i, half, request)
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
}

impl PredictedFootprint {
    /// One of a cell, of which the corners are taken.
    #[inline(always)]
    fn of((mean, covariance): (Point, [f64; 3]), probability: f64, cell: &Cell, lane: usize) -> Self {
        let number = |k: usize| f64::from(cell[k][lane]);
        Self {
            mean,
            front_left: Point::new(number(2), number(3)),
            front_right: Point::new(number(4), number(5)),
            probability,
            covariance,
        }
    }

    /// 1000 times the probability of the mode times those of the centre and, at half weight, of the four corners.
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
        let probability = Normal2::new(xx, xy, yy).centre_and_corners(&mean, half);
        1000.0 * self.probability * f64::from(probability)
    }
}

/// The same view in single precision: it sees at least what costs anything.
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

    /// Which expectations of a cell may cost anything, one bit each.
    #[expect(clippy::needless_range_loop, reason = "functions of iterators that are not inlined know no wide machines")]
    #[inline(always)]
    fn passing(&self, cell: &Cell) -> u32 {
        let mut bits = [0; GROUP];
        for k in 0..GROUP {
            bits[k] = self.may_count(cell, k).wrapping_neg() & 1 << k;
        }
        let mut passing = 0;
        for k in 0..GROUP {
            passing |= bits[k];
        }
        passing
    }

    /// One of a group is in reach, and its centre or a corner may be in the agent's box: the nearest of them is not beyond
    /// what is left of the distribution, neither ahead nor aside. 1 for yes.
    #[inline(always)]
    fn may_count(&self, [x, y, left_x, left_y, right_x, right_y, xx, xy, yy]: &[[f32; GROUP]; 9], k: usize) -> u32 {
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
        let (x, y) = (positive(ahead(x, y) - self.half[0] - ROUNDING), positive(aside(x, y) - self.half[1] - ROUNDING));
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

multiversion! {
    /// Writes the cells of the next source; false if it is expected nowhere near the samples.
    fn write_cells = cells_at, (
        out: &mut PredictedFootprints,
        source: &PredictedMode,
        poses: &Poses,
        reach: &Reach,
        predictions: &Predictions,
    ) -> bool
}

#[inline(always)]
fn cells_at(
    out: &mut PredictedFootprints,
    source: &PredictedMode,
    poses: &Poses,
    reach: &Reach,
    predictions: &Predictions,
) -> bool {
    let (slot, lane) = (out.sources.len() / GROUP, out.sources.len() % GROUP);
    /// [m]
    const REACH: f32 = COST_REACH as f32 + ROUNDING;
    let [ahead_x, ahead_y] = reach.axis();
    let mut is_expected = false;
    for group in 0..out.n_points / GROUP {
        let (stretch, [rear, front, right, left]) = (poses.stretch(group), reach.sides(group));
        let [xx, xy, yy] = source.covariances(group, predictions);
        let mut numbers = [[0.0; GROUP]; N_NUMBERS];
        let mut expected = [0; GROUP];
        for k in 0..GROUP {
            let (x, y) = (stretch.x[k + 1], stretch.y[k + 1]);
            let (ahead, aside) = (x * ahead_x + y * ahead_y, y * ahead_x - x * ahead_y);
            let is_near = (ahead >= rear[k] - REACH)
                & (ahead <= front[k] + REACH)
                & (aside >= right[k] - REACH)
                & (aside <= left[k] + REACH);
            let counts = is_near & (xx[k] * yy[k] - xy[k] * xy[k] <= source.determinant_max);
            expected[k] = u32::from(counts).wrapping_neg() & 1 << k;
            let (axis_x, axis_y) = (stretch.axis_x[k + 1], stretch.axis_y[k + 1]);
            let (length, width) = (source.half.0 as f32, source.half.1 as f32);
            let (long_x, long_y, wide_x, wide_y) = (length * axis_x, length * axis_y, -width * axis_y, width * axis_x);
            let corners = [long_x + wide_x, long_y + wide_y, long_x - wide_x, long_y - wide_y];
            (numbers[0][k], numbers[1][k]) = (x, y);
            for (c, corner) in corners.into_iter().enumerate() {
                numbers[2 + c][k] = corner;
            }
            (numbers[6][k], numbers[7][k], numbers[8][k]) = (xx[k] as f32, xy[k] as f32, yy[k] as f32);
        }
        for k in 0..GROUP {
            if expected[k] != 0 {
                let place = (group * GROUP + k) * out.n_groups + slot;
                let cell = &mut out.cells[place];
                for c in 0..N_NUMBERS {
                    cell[c][lane] = numbers[c][k];
                }
                out.occupied[place] |= 1 << lane;
                is_expected = true;
            }
        }
    }
    is_expected
}

multiversion! {
    /// The prediction cost of a point.
    fn summed_cost = cost_at, (
        expectations: &PredictedFootprints,
        point: &Waypoint,
        i: usize,
        half: (f64, f64),
        request: &PlanRequest,
    ) -> f64
}

#[inline(always)]
fn cost_at(
    expectations: &PredictedFootprints,
    point: &Waypoint,
    i: usize,
    half: (f64, f64),
    request: &PlanRequest,
) -> f64 {
    let PredictedFootprints { sources, cells, occupied, n_groups, origin, .. } = expectations;
    let view = View::of(point);
    let rough = RoughView::of(&view, *origin, half);
    let mut sum = 0.0;
    for group in 0..*n_groups {
        let place = (i - 1) * n_groups + group;
        if occupied[place] == 0 {
            continue;
        }
        let mut passing = rough.passing(&cells[place]) & u32::from(occupied[place]);
        while passing != 0 {
            let lane = passing.trailing_zeros() as usize % GROUP;
            let source = &sources[group * GROUP + lane];
            sum += PredictedFootprint::of(source.at(i, request), source.probability, &cells[place], lane)
                .cost(&view, half);
            passing &= passing - 1;
        }
    }
    sum
}

#[cfg(test)]
mod tests;
