//! The other participants as the planner sees them: what they cover during each interval for the collision test, and where
//! they are expected at each point for the prediction cost. Made once per plan, for those that the samples can get near.

mod contact;
mod collision_probability;
mod gaussian;

pub(super) use contact::Contact;

use std::f64::consts::{SQRT_2, TAU};

use super::super::frame::Waypoint;
use super::super::{Other, PlanRequest};
use super::Problem;
use super::grid::SampleGrid;
use super::settings::FrenetSettings;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;
use crate::predict::STATIONARY_VARIANCE;
use collision_probability::{COST_REACH, PredictedFootprint, summed_cost};

/// The vehicle accelerates on its way by less than this multiple of its largest acceleration.
const ACCELERATION_FACTOR: f64 = 2.0;

/// One mode of one participant, or one part of a static structure.
#[derive(Debug, Clone, Copy)]
struct Obstacle {
    /// Position in the request's `others`.
    other: usize,
    /// Place of the first of its intervals.
    first: usize,
    /// It overlaps the agent's footprint now: nothing can be done about that, it only must not get worse.
    overlaps_now: bool,
    /// Confirm overlaps of boxes with the exact shapes: a static structure that is not made of rectangles.
    exact: bool,
}

/// What an obstacle covers during one interval.
#[derive(Debug, Clone, Copy)]
struct SweptInterval {
    swept: OrientedBox,
    /// The box at the end of the interval.
    end: OrientedBox,
    /// Displacement during the interval [m].
    displacement: Point,
}

/// All obstacles of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Obstacles {
    obstacles: Vec<Obstacle>,
    /// `None` where nothing is known; (obstacles, intervals).
    intervals: Vec<Option<SweptInterval>>,
    /// Where modes that cost something are expected from point 1 on; (modes, intervals).
    expected: Vec<Option<PredictedFootprint>>,
    /// Intervals of a plan.
    n: usize,
    /// Circles that hold the agent's centre at the ends of the intervals, and radius of one around it that holds what it covers
    /// [m].
    reach: Vec<(Point, f64)>,
    covered: f64,
    /// What the sample at hand covers during each of them.
    own: Vec<OrientedBox>,
    half_length: f64,
    half_width: f64,
}

impl Obstacles {
    /// Prepares all participants of the request.
    pub(super) fn prepare(&mut self, problem: &Problem, samples: &SampleGrid) {
        let Problem { request, start, limits, .. } = problem;
        let vehicle = request.vehicle;
        (self.half_length, self.half_width) = (0.5 * vehicle.length, 0.5 * vehicle.width);
        self.n = samples.n_points - 1;
        self.obstacles.clear();
        self.intervals.clear();
        self.expected.clear();
        let ego = OrientedBox::new(request.state.pose(), vehicle.length, vehicle.width);
        let fastest = start.velocity + ACCELERATION_FACTOR * limits.acceleration_max * limits.horizon();
        self.covered = swept_radius(ego.radius(), fastest * request.dt);
        self.reach.clear();
        self.reach.extend((1..=self.n).map(|i| {
            let (center, radius) = samples.reach(i, &request.route.path);
            (center, radius + vehicle.rear_axle_to_center)
        }));
        for (index, other) in request.others.iter().enumerate() {
            let body = other.shape.oriented_box(other.pose);
            if other.is_static {
                self.add_static(index, (&body, &ego), problem);
            } else {
                self.add_moving(index, (&body, &ego), problem);
            }
        }
    }

    fn add_static(&mut self, index: usize, (body, ego): (&OrientedBox, &OrientedBox), problem: &Problem) {
        let Self { reach, intervals, obstacles, expected, covered, .. } = self;
        let (other, settings) = (&problem.request.others[index], problem.settings);
        for part in other.shape.parts() {
            let (plain, exact) = part.tightest_box(other.pose);
            let (now, overlaps_now) = with_margin(&plain, settings, ego);
            let (first, room) = (intervals.len(), *covered + swept_radius(now.radius(), 0.0));
            let standing = SweptInterval { swept: now, end: now, displacement: Point::default() };
            intervals.extend(reach.iter().map(|circle| is_near(circle, now.center, room).then_some(standing)));
            if keep_any(intervals, first) {
                obstacles.push(Obstacle { other: index, first, overlaps_now, exact });
            }
        }
        let (first, room) = (expected.len(), ego.radius() + body.radius() + COST_REACH);
        let covariance = [STATIONARY_VARIANCE, 0.0, STATIONARY_VARIANCE];
        let half = half_with_margin(body, settings);
        let footprint = PredictedFootprint::new((body.center, body.axis), half, covariance, 1.0);
        expected.extend(reach.iter().map(|circle| is_near(circle, body.center, room).then_some(footprint)));
        keep_any(expected, first);
    }

    /// Adds those modes of a participant that count.
    fn add_moving(&mut self, index: usize, (body, ego): (&OrientedBox, &OrientedBox), problem: &Problem) {
        let Problem { request, settings, .. } = problem;
        let (other, predictions) = (&request.others[index], request.predictions);
        let Ok(shift) = usize::try_from(request.time_step - predictions.time_step) else { return };
        let modes = probabilities(other, request);
        let likeliest = likeliest(modes);
        let is_left_alone = is_in_rear_cone(ego, body, settings);
        let (now, overlaps_now) = with_margin(body, settings, ego);
        // All of it, with margin, is within this distance of its position.
        let margin = settings.prediction_margin_length + settings.prediction_margin_width;
        let radius = other.shape.bounding_radius() + 0.5 * margin;
        for (mode, probability) in modes.iter().copied().enumerate() {
            let first = predictions.offset(other.row, mode);
            let known = (shift..predictions.n_steps).map(|step| first + step).take(self.n);
            let places = known.map(|place| predictions.valid[place].then_some(place));
            let is_hard = probability >= settings.collision_mode_probability || mode == likeliest;
            if is_hard && self.cover(other, (&now, radius), places.clone(), request) {
                let first = self.intervals.len() - self.n;
                self.obstacles.push(Obstacle { other: index, first, overlaps_now, exact: false });
            }
            if probability > 0.0 && !is_left_alone {
                // The density in the middle is the probability over 2 pi times the root of the determinant.
                let dense = (probability / (TAU * settings.expectation_density_min)).powi(2);
                let counts = (probability, if is_hard { f64::INFINITY } else { dense });
                let half = half_with_margin(body, settings);
                self.expect(other, (half, ego.radius() + radius + COST_REACH), places, counts, request);
            }
        }
    }

    /// Adds what a participant covers, whose box is as large as it is now, between places in the predictions, if it comes near.
    fn cover(
        &mut self,
        other: &Other,
        (now, radius): (&OrientedBox, f64),
        places: impl Iterator<Item = Option<usize>>,
        request: &PlanRequest,
    ) -> bool {
        let Self { reach, intervals, covered, .. } = self;
        let (first, predictions) = (intervals.len(), request.predictions);
        let position = |place: usize| Point::new(predictions.x[place], predictions.y[place]);
        let at = |place: usize| {
            let body = other.shape.oriented_box_along(position(place), request.prediction_index.axis(place));
            OrientedBox { half_length: now.half_length, half_width: now.half_width, ..body }
        };
        // Where it was before, if that is known; `None` is now.
        let mut before = Some((other.pose.position, None));
        for (circle, place) in reach.iter().zip(places) {
            let end = place.map(|place| (position(place), Some(place)));
            let near = before.zip(end).filter(|((from, _), (to, _))| {
                is_near(circle, *to, *covered + swept_radius(radius, from.distance(*to)))
            });
            intervals.push(near.map(|((_, from), (_, to))| {
                let (from, end) = (from.map_or(*now, at), to.map_or(*now, at));
                let displacement = end.center - from.center;
                SweptInterval { swept: OrientedBox::spanning(&from, &end), end, displacement }
            }));
            before = end;
        }
        intervals.resize(first + self.n, None);
        keep_any(intervals, first)
    }

    /// Adds where a mode is expected from point 1 on, as far as it comes near and the determinant of its covariance is small
    /// enough [m⁴].
    fn expect(
        &mut self,
        other: &Other,
        (half, room): ((f64, f64), f64),
        places: impl Iterator<Item = Option<usize>>,
        (probability, determinant_max): (f64, f64),
        request: &PlanRequest,
    ) {
        let (first, predictions) = (self.expected.len(), request.predictions);
        let bounds = other.shape.bounding_box();
        let offset = bounds.min.lerp(bounds.max, 0.5);
        self.expected.extend(self.reach.iter().zip(places).map(|(circle, place)| {
            let k = place?;
            let position = Point::new(predictions.x[k], predictions.y[k]);
            let [xx, xy, yy] =
                [predictions.covariance_xx[k], predictions.covariance_xy[k], predictions.covariance_yy[k]];
            let counts = is_near(circle, position, room) && xx * yy - xy * xy <= determinant_max;
            counts.then(|| {
                let axis = request.prediction_index.axis(k);
                let mean = position + axis * offset.x + axis.left() * offset.y;
                PredictedFootprint::new((mean, axis), half, [xx, xy, yy], probability)
            })
        }));
        self.expected.resize(first + self.n, None);
        keep_any(&mut self.expected, first);
    }

    /// The agent's footprint at a point.
    fn footprint(&self, point: &Waypoint) -> OrientedBox {
        let (half_length, half_width) = (self.half_length, self.half_width);
        OrientedBox { center: point.center, axis: point.axis, half_length, half_width }
    }

    /// Prediction cost of point number `i` (from 1 on) of a sample.
    pub(super) fn prediction_cost(&self, point: &Waypoint, i: usize) -> f64 {
        summed_cost(&self.expected, (i - 1, self.n), (point.center, point.axis), (self.half_length, self.half_width))
    }

    /// Sum over participants of 1 / (smallest squared distance of the centres) [1/m²].
    pub(super) fn distance_cost(&self, points: &[Waypoint], request: &PlanRequest) -> f64 {
        let predictions = request.predictions;
        let Ok(shift) = usize::try_from(request.time_step - predictions.time_step) else { return 0.0 };
        let nearest = |other: &Other| {
            let mode = likeliest(probabilities(other, request));
            let first = predictions.offset(other.row, mode);
            let mut least = f64::INFINITY;
            for (i, point) in points.iter().enumerate() {
                let step = (i + shift).checked_sub(1).filter(|_| !other.is_static);
                let position = match step {
                    None => other.pose.position,
                    Some(step) if step < predictions.n_steps && predictions.valid[first + step] => {
                        Point::new(predictions.x[first + step], predictions.y[first + step])
                    }
                    Some(_) => continue,
                };
                least = least.min((position - point.center).norm_squared());
            }
            least
        };
        request.others.iter().map(|other| 1.0 / nearest(other).max(1e-6)).sum()
    }
}

/// Radius of a circle around a body after a way that holds all that it covers on the way, in boxes along it [m].
fn swept_radius(radius: f64, way: f64) -> f64 {
    SQRT_2 * (radius + way)
}

/// A place is within a distance [m] of a circle.
fn is_near((center, radius): &(Point, f64), place: Point, room: f64) -> bool {
    (place - *center).norm_squared() <= (radius + room).powi(2)
}

/// Keeps what was added from a place on if anything of it is there; says so.
fn keep_any<T>(all: &mut Vec<Option<T>>, first: usize) -> bool {
    let is_any = all[first..].iter().any(Option::is_some);
    if !is_any {
        all.truncate(first);
    }
    is_any
}

/// Probabilities of a participant's modes.
fn probabilities<'a>(other: &Other, request: &PlanRequest<'a>) -> &'a [f64] {
    let n_modes = request.predictions.n_modes;
    &request.predictions.probability[other.row * n_modes..][..n_modes]
}

/// The most probable mode; the first one of equals.
fn likeliest(probabilities: &[f64]) -> usize {
    (1..probabilities.len()).fold(0, |best, mode| if probabilities[mode] > probabilities[best] { mode } else { best })
}

/// Half length and width with margin [m].
fn half_with_margin(body: &OrientedBox, settings: &FrenetSettings) -> (f64, f64) {
    let FrenetSettings { prediction_margin_length, prediction_margin_width, .. } = settings;
    (body.half_length + 0.5 * prediction_margin_length, body.half_width + 0.5 * prediction_margin_width)
}

/// The box with margin on every side, or without if the margin already touches the agent; and whether the plain box
/// overlaps the agent.
fn with_margin(plain: &OrientedBox, settings: &FrenetSettings, ego: &OrientedBox) -> (OrientedBox, bool) {
    let (half_length, half_width) = half_with_margin(plain, settings);
    let grown = OrientedBox { half_length, half_width, ..*plain };
    if ego.overlaps(&grown) { (*plain, ego.overlaps(plain)) } else { (grown, false) }
}

/// Behind the agent within the cone, and further away than its length.
fn is_in_rear_cone(ego: &OrientedBox, other: &OrientedBox, settings: &FrenetSettings) -> bool {
    let offset = other.center - ego.center;
    let distance = offset.norm();
    let behind = -offset.dot(ego.axis);
    distance > settings.rear_cone_distance && behind >= distance * (0.5 * settings.rear_cone_angle).cos()
}
