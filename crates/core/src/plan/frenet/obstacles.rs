//! The other participants as the planner sees them: swept boxes per time interval for the collision test, expected
//! positions per point for the prediction cost. Made once per plan, only for what the samples can reach.

mod contact;
mod poses;
mod collision_probability;
mod gaussian;
mod reach;
mod swept_boxes;

pub(super) use contact::Contact;

use std::f64::consts::TAU;

use super::super::frame::{Start, Waypoint};
use super::super::{Other, PlanRequest};
use super::grid::SampleGrid;
use super::settings::FrenetSettings;
use crate::geometry::shape::{ConvexPart, OrientedBox};
use crate::geometry::{Point, Pose};
use crate::predict::STATIONARY_VARIANCE;
use collision_probability::{COST_REACH, PredictedFootprints, PredictedMode};
use poses::{Poses, PredictedSteps};
use reach::Reach;
use swept_boxes::SweptBoxes;

/// One mode of one participant, or one part of a static structure.
#[derive(Debug, Clone, Copy)]
struct Obstacle {
    /// Position in the request's `others`.
    other: usize,
    /// Where it is predicted; `None` for what never moves.
    steps: Option<PredictedSteps>,
    /// Its box now, as large as all that follow.
    now: OrientedBox,
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
    /// Of the obstacles above, in their order.
    swept_boxes: SweptBoxes,
    predicted_footprints: PredictedFootprints,
    reach: Reach,
    /// Modes of participants that may come within reach.
    reached: Vec<Reached>,
    /// The poses of the one at hand.
    poses: Poses,
    /// The sample at hand, and what it covers during each interval.
    own: Poses,
    own_swept_boxes: SweptBoxes,
    /// Tracks whose contacts the sample at hand may ignore.
    ignored: Vec<bool>,
    half_length: f64,
    half_width: f64,
}

/// A mode that may come within reach.
#[derive(Debug, Clone, Copy)]
struct Reached {
    /// Position in the request's `others`.
    other: usize,
    mode: usize,
    /// It may meet the agent; otherwise it only comes near.
    may_meet: bool,
}

impl Obstacle {
    /// Exactly what it covers during an interval.
    fn swept_interval(&self, interval: usize, request: &PlanRequest) -> SweptInterval {
        let Some(PredictedSteps { first, .. }) = self.steps else {
            return SweptInterval { swept: self.now, end: self.now, displacement: Point::default() };
        };
        let OrientedBox { half_length, half_width, .. } = self.now;
        let at = |place: usize| {
            let position = Point::new(request.predictions.x[place], request.predictions.y[place]);
            let body =
                request.others[self.other].shape.oriented_box_along(position, request.prediction_index.axis(place));
            OrientedBox { half_length, half_width, ..body }
        };
        let before = if interval == 0 { self.now } else { at(first + interval - 1) };
        let end = at(first + interval);
        SweptInterval { swept: OrientedBox::spanning(&before, &end), end, displacement: end.center - before.center }
    }
}

impl Obstacles {
    /// Prepares all participants of the request.
    pub(super) fn prepare(
        &mut self,
        request: &PlanRequest,
        start: &Start,
        samples: &SampleGrid,
        settings: &FrenetSettings,
    ) {
        let vehicle = request.vehicle;
        (self.half_length, self.half_width) = (0.5 * vehicle.length, 0.5 * vehicle.width);
        self.reach.find(request, start, samples);
        self.begin(request, settings);
        let ego = OrientedBox::new(request.state.pose(), vehicle.length, vehicle.width);
        let reached = std::mem::take(&mut self.reached);
        for modes in reached.chunk_by(|a, b| a.other == b.other) {
            let other = &request.others[modes[0].other];
            if other.is_static {
                self.add_static(modes[0].other, other, request, &ego, settings);
            } else {
                self.add_moving(modes, other, request, &ego, settings);
            }
        }
        self.reached = reached;
    }

    /// Forgets the last plan and finds the participants that may come within reach.
    fn begin(&mut self, request: &PlanRequest, settings: &FrenetSettings) {
        let predictions = request.predictions;
        let margin = settings.prediction_margin_length.max(settings.prediction_margin_width);
        self.obstacles.clear();
        self.reached.clear();
        let whole = self.reach.whole();
        for (index, other) in request.others.iter().enumerate() {
            let meeting = whole.grown(other.shape.bounding_radius() + margin);
            let near = meeting.grown(COST_REACH);
            if other.is_static {
                if near.contains(other.pose.position) {
                    self.reached.push(Reached { other: index, mode: 0, may_meet: true });
                }
                continue;
            }
            let first = other.row * predictions.n_modes;
            for (mode, region) in
                request.prediction_index.regions[first..first + predictions.n_modes].iter().enumerate()
            {
                if near.overlaps(region) {
                    self.reached.push(Reached { other: index, mode, may_meet: meeting.overlaps(region) });
                }
            }
        }
        self.swept_boxes.begin(self.reach.stride());
        self.predicted_footprints.begin(self.reached.len(), &self.reach);
    }

    fn add_static(
        &mut self,
        index: usize,
        other: &Other,
        request: &PlanRequest,
        ego: &OrientedBox,
        settings: &FrenetSettings,
    ) {
        let Reach { origin, .. } = self.reach;
        let stride = self.reach.stride();
        for part in other.shape.parts() {
            let (plain, exact) = part_box(part, other.pose);
            let margin = [settings.prediction_margin_length, settings.prediction_margin_width];
            let (now, overlaps_now) = with_margin(&plain, margin, ego);
            self.poses.stand(stride, &now, origin);
            if self.swept_boxes.push(&self.poses, (now.half_length, now.half_width), &self.reach) {
                self.obstacles.push(Obstacle { other: index, steps: None, now, overlaps_now, exact });
            }
        }
        let body = other.shape.oriented_box(other.pose);
        self.poses.stand(stride, &body, origin);
        let covariance = [STATIONARY_VARIANCE, 0.0, STATIONARY_VARIANCE];
        let source = PredictedMode { covariance, ..PredictedMode::new(body, settings) };
        self.predicted_footprints.push(source, &self.poses, &self.reach, request.predictions);
    }

    /// Adds those modes of a participant that count.
    fn add_moving(
        &mut self,
        reached: &[Reached],
        other: &Other,
        request: &PlanRequest,
        ego: &OrientedBox,
        settings: &FrenetSettings,
    ) {
        let predictions = request.predictions;
        let Ok(shift) = usize::try_from(request.time_step - predictions.time_step) else { return };
        let n = predictions.n_steps.saturating_sub(shift).min(self.reach.n_points() - 1);
        if n == 0 {
            return;
        }
        let modes = probabilities(other, request);
        let likeliest = likeliest(modes);
        let body = other.shape.oriented_box(other.pose);
        let is_left_alone = is_in_rear_cone(ego, &body, settings);
        let margin = [settings.prediction_margin_length, settings.prediction_margin_width];
        let (now, overlaps_now) = with_margin(&body, margin, ego);
        let bounds = other.shape.bounding_box();
        let offset = bounds.min.lerp(bounds.max, 0.5);
        for Reached { other: index, mode, may_meet } in reached.iter().copied() {
            let probability = modes[mode];
            let hard = probability >= settings.collision_mode_probability || mode == likeliest;
            let counts = probability > 0.0 && !is_left_alone;
            let may_meet = hard && may_meet;
            if !may_meet && !counts {
                continue;
            }
            let steps = PredictedSteps { first: predictions.offset(other.row, mode) + shift, n };
            self.poses.follow((self.reach.stride(), self.reach.origin), &body, steps, offset, request);
            if may_meet && self.swept_boxes.push(&self.poses, (now.half_length, now.half_width), &self.reach) {
                self.obstacles.push(Obstacle { other: index, steps: Some(steps), now, overlaps_now, exact: false });
            }
            if counts {
                // The density in the middle is the probability over 2 pi times the root of the determinant.
                let dense = (probability / (TAU * settings.expectation_density_min)).powi(2);
                let determinant_max = if hard { f64::INFINITY } else { dense };
                let source = PredictedMode::new(body, settings);
                let source = PredictedMode { steps: Some(steps), probability, determinant_max, offset, ..source };
                self.predicted_footprints.push(source, &self.poses, &self.reach, predictions);
            }
        }
    }

    /// Looks during which intervals a sample may overlap which obstacles; false if it is clear of all.
    fn run_broad_phase(&mut self, points: &[Waypoint]) -> bool {
        if self.swept_boxes.is_empty() {
            return false;
        }
        let stride = self.reach.stride();
        self.own.begin(stride);
        for (i, point) in points.iter().enumerate() {
            self.own.set(i, point.center - self.reach.origin, point.axis);
        }
        self.own_swept_boxes.set(stride, &self.own, (self.half_length, self.half_width));
        self.swept_boxes.broad_phase(&self.own_swept_boxes)
    }

    /// The agent's footprint at a point.
    fn footprint(&self, point: &Waypoint) -> OrientedBox {
        let (half_length, half_width) = (self.half_length, self.half_width);
        OrientedBox { center: point.center, axis: point.axis, half_length, half_width }
    }

    /// No sample can get near any predicted position.
    pub(super) fn has_no_prediction_in_reach(&self) -> bool {
        self.predicted_footprints.is_empty()
    }

    /// Prediction cost of point number `i` (from 1 on) of a sample.
    pub(super) fn prediction_cost(&self, point: &Waypoint, i: usize, request: &PlanRequest) -> f64 {
        self.predicted_footprints.cost(point, i, (self.half_length, self.half_width), request)
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

/// Probabilities of a participant's modes.
fn probabilities<'a>(other: &Other, request: &PlanRequest<'a>) -> &'a [f64] {
    let n_modes = request.predictions.n_modes;
    &request.predictions.probability[other.row * n_modes..][..n_modes]
}

/// The most probable mode; the first one of equals.
fn likeliest(probabilities: &[f64]) -> usize {
    (1..probabilities.len()).fold(0, |best, mode| if probabilities[mode] > probabilities[best] { mode } else { best })
}

/// The box with margin on every side, or without if the margin already touches the agent; and whether the plain box
/// overlaps the agent.
fn with_margin(plain: &OrientedBox, margin: [f64; 2], ego: &OrientedBox) -> (OrientedBox, bool) {
    let grown = OrientedBox {
        half_length: plain.half_length + 0.5 * margin[0],
        half_width: plain.half_width + 0.5 * margin[1],
        ..*plain
    };
    if ego.overlaps(&grown) { (*plain, ego.overlaps(plain)) } else { (grown, false) }
}

/// Boxes of the parts of what stands.
pub(in crate::plan) fn part_boxes(other: &Other) -> impl Iterator<Item = OrientedBox> {
    other.shape.parts().iter().map(|part| part_box(part, other.pose).0)
}

/// Smallest box around a convex part along one of its sides, world frame, and whether it is larger than the part.
fn part_box(part: &ConvexPart, pose: Pose) -> (OrientedBox, bool) {
    let vertices = &part.vertices;
    let to_world = |p: Point| pose.world_from_body(p);
    if vertices.len() < 3 {
        let center = to_world(vertices.first().copied().unwrap_or_default());
        let axis = Point::from_angle(pose.orientation);
        return (OrientedBox { center, axis, half_length: part.radius, half_width: part.radius }, false);
    }
    let area: f64 =
        (1..vertices.len() - 1).map(|i| 0.5 * (vertices[i] - vertices[0]).cross(vertices[i + 1] - vertices[0])).sum();
    let mut best: Option<OrientedBox> = None;
    for i in 0..vertices.len() {
        let side = vertices[(i + 1) % vertices.len()] - vertices[i];
        let axis = side * (1.0 / side.norm());
        let (mut low, mut high) =
            (Point::new(f64::INFINITY, f64::INFINITY), Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY));
        for vertex in vertices {
            let local = Point::new(vertex.dot(axis), axis.cross(*vertex));
            low = Point::new(low.x.min(local.x), low.y.min(local.y));
            high = Point::new(high.x.max(local.x), high.y.max(local.y));
        }
        let half = (high - low) * 0.5;
        if best.is_none_or(|b| half.x * half.y < b.half_length * b.half_width - 1e-9) {
            let middle = (low + high) * 0.5;
            let center = to_world(axis * middle.x + axis.left() * middle.y);
            let axis_in_world = to_world(axis) - pose.position;
            best = Some(OrientedBox { center, axis: axis_in_world, half_length: half.x, half_width: half.y });
        }
    }
    let best = best.expect("a polygon has sides");
    (best, 4.0 * best.half_length * best.half_width > 1.02 * area)
}

/// Behind the agent within the cone, and further away than its length.
fn is_in_rear_cone(ego: &OrientedBox, other: &OrientedBox, settings: &FrenetSettings) -> bool {
    let offset = other.center - ego.center;
    let distance = offset.norm();
    let behind = -offset.dot(ego.axis);
    distance > settings.rear_cone_distance && behind >= distance * (0.5 * settings.rear_cone_angle).cos()
}
