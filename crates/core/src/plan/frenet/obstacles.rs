//! The other participants as the planner sees them: swept boxes per time interval for the collision test, expected
//! positions per point for the prediction cost. Made once per plan, only for what the samples can reach.

use std::f64::consts::TAU;

use super::super::frame::{Start, Waypoint};
use super::super::{Other, PlanRequest};
use super::by_time::{ByTime, GROUP};
use super::expectations::{COST_REACH, Expectations};
use super::sample::Samples;
use super::settings::FrenetSettings;
use crate::geometry::shape::{ConvexPart, OrientedBox};
use crate::geometry::{Aabb, Point, Pose};
use crate::wide::for_wide_machines;

/// Variance of the position of static obstacles [m²].
const STATIC_VARIANCE: f64 = 0.02;
/// Somebody behind may be left to keep their own distance while the agent stays this close to its lateral position [m].
pub(super) const OWN_LANE: f64 = 1.0;
/// Somebody faster than this [m/s] can be expected to yield ...
const YIELDING_SPEED: f64 = 0.2;
/// ... if this deceleration [m/s²] from now on stops it before the contact.
const YIELDING_DECELERATION: f64 = 5.0;
/// A follower heads within 45 degrees of the agent (cosine).
const FOLLOWER_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// One mode of one participant.
#[derive(Debug, Clone, Copy)]
struct Track {
    /// Position in the request's `others`.
    other: usize,
    /// Its footprint overlaps the agent's now: nothing can be done about that, it only must not get worse.
    overlaps_now: bool,
    /// Confirm overlaps of boxes with the exact shapes: a static structure that is not made of rectangles.
    exact: bool,
}

/// What a track covers during one interval.
#[derive(Debug, Clone, Copy)]
struct Sweep {
    track: u32,
    /// A circle around the swept box.
    radius: f64,
    swept: OrientedBox,
    /// The box at the end of the interval.
    end: OrientedBox,
    /// Displacement during the interval [m].
    displacement: Point,
}

/// First contact of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contact {
    /// Position in the request's `others`.
    pub(super) other: usize,
    /// Interval in which it happens; interval `i` ends at point `i + 1`.
    pub(super) interval: usize,
    /// Difference of the velocities [m/s].
    pub(super) closing_speed: f64,
}

/// All obstacles of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Obstacles {
    tracks: Vec<Track>,
    sweeps: Vec<Sweep>,
    expectations: Expectations,
    /// The swept boxes, by interval: centre from the origin, axis, half length and width.
    sweeps_by_interval: ByTime<6>,
    /// Where the agent is: numbers in single precision are relative to it.
    origin: Point,
    /// Box of the region that the agent's footprint can reach up to each point.
    reach: Vec<Aabb>,
    /// What the sample at hand covers during each interval.
    steps: Vec<OrientedBox>,
    /// Tracks whose contacts the sample at hand may ignore.
    ignored: Vec<bool>,
    half_length: f64,
    half_width: f64,
}

impl Obstacles {
    /// Prepares all participants of the request.
    pub(super) fn prepare(
        &mut self,
        request: &PlanRequest,
        start: &Start,
        samples: &Samples,
        settings: &FrenetSettings,
    ) {
        self.tracks.clear();
        self.sweeps.clear();
        self.origin = request.state.pose().position;
        self.expectations.clear(self.origin);
        self.sweeps_by_interval.clear();
        let vehicle = request.vehicle;
        (self.half_length, self.half_width) = (0.5 * vehicle.length, 0.5 * vehicle.width);
        let ego = OrientedBox::new(request.state.pose(), vehicle.length, vehicle.width);
        self.find_reach(request, start, samples);
        for (index, other) in request.others.iter().enumerate() {
            if other.is_static {
                self.add_static(index, other, &ego, settings);
            } else {
                self.add_moving(index, other, request, &ego, settings);
            }
        }
        self.sweeps_by_interval.sort(samples.n_points);
        self.expectations.sort(samples.n_points);
    }

    /// The path from the start to 2 m beyond the furthest arc length of any sample at each point, grown by the lateral
    /// range and the agent's size.
    fn find_reach(&mut self, request: &PlanRequest, start: &Start, samples: &Samples) {
        let vehicle = request.vehicle;
        let size = (vehicle.rear_axle_to_center + self.half_length).hypot(self.half_width);
        let sideways = samples.lanes.iter().fold(start.d.abs(), |widest, d| widest.max(d.abs()));
        let path = &request.route.path;
        let mut region = Aabb::around([path.at(start.s).position]);
        let mut s = start.s;
        self.reach.clear();
        for i in 0..samples.n_points {
            let furthest = (samples.furthest[i] + 2.0).max(s).min(path.length());
            while s < furthest {
                s = (s + 2.0).min(furthest);
                region = region.including(path.at(s).position);
            }
            // Between two samples of the path the curve bulges by less than 0.25 m at the tightest radius of 2 m.
            self.reach.push(region.grown(size + sideways + 0.25));
        }
    }

    fn add_static(&mut self, index: usize, other: &Other, ego: &OrientedBox, settings: &FrenetSettings) {
        let body = other.shape.oriented_box(other.pose);
        let whole = *self.reach.last().expect("a plan has at least two points");
        if !body.aabb().overlaps(&whole.grown(COST_REACH + settings.prediction_margin_length)) {
            return;
        }
        for part in other.shape.parts() {
            let (plain, exact) = part_box(part, other.pose);
            let margin = [settings.prediction_margin_length, settings.prediction_margin_width];
            let (box_, overlaps_now) = with_margin(&plain, margin, ego);
            let track = self.push_track(Track { other: index, overlaps_now, exact });
            let sweep = Sweep { track, radius: box_.radius(), swept: box_, end: box_, displacement: Point::default() };
            let aabb = box_.aabb();
            for i in 0..self.reach.len() - 1 {
                if aabb.overlaps(&self.reach[i + 1]) {
                    self.push_sweep(i, sweep);
                }
            }
        }
        let covariance = [STATIC_VARIANCE, 0.0, STATIC_VARIANCE];
        for point in 1..self.reach.len() {
            if self.reach[point].grown(COST_REACH).contains(body.center) {
                self.expectations.push(point, &body, covariance, 1.0, settings);
            }
        }
    }

    fn add_moving(
        &mut self,
        index: usize,
        other: &Other,
        request: &PlanRequest,
        ego: &OrientedBox,
        settings: &FrenetSettings,
    ) {
        let (predictions, outlook) = (request.predictions, request.outlook);
        let Ok(shift) = usize::try_from(request.time_step - predictions.time_step) else { return };
        let margin = [settings.prediction_margin_length, settings.prediction_margin_width];
        let radius = other.shape.bounding_radius() + margin[0].max(margin[1]);
        let whole = self.reach.last().expect("a plan has at least two points").grown(COST_REACH + radius);
        let extents = &outlook.extents[other.row * predictions.n_modes..][..predictions.n_modes];
        let is_reached = |extent: &Aabb| extent.including(other.pose.position).overlaps(&whole);
        if !extents.iter().any(is_reached) {
            return;
        }
        let now = other.shape.oriented_box(other.pose);
        let (box_now, overlaps_now) = with_margin(&now, margin, ego);
        let (half_length, half_width) = (box_now.half_length, box_now.half_width);
        let [xx, xy, yy] = [&predictions.covariance_xx, &predictions.covariance_xy, &predictions.covariance_yy];
        let is_left_alone = is_in_rear_cone(ego, &now, settings);
        let modes = probabilities(other, request);
        for (mode, probability) in modes.iter().enumerate().filter(|(mode, _)| is_reached(&extents[*mode])) {
            let hard = *probability >= settings.collision_mode_probability || mode == likeliest(modes);
            let counts = *probability > 0.0 && !is_left_alone;
            let first = predictions.offset(other.row, mode);
            // The density in the middle is the probability over 2 pi times the root of the determinant.
            let dense = (probability / (TAU * settings.expectation_density_min)).powi(2);
            let determinant_max = if hard { f64::INFINITY } else { dense };
            let mut track = None;
            // Boxes are worked out where they are needed.
            let body_at = |k: usize, position: Point| other.shape.oriented_box_along(position, outlook.axes[k]);
            let mut before = Some((other.pose.position, Some(now)));
            for point in 1..self.reach.len() {
                let k = first + point + shift - 1;
                if point + shift > predictions.n_steps {
                    break;
                }
                if !predictions.valid[k] {
                    before = None;
                    continue;
                }
                let counts = counts && xx[k] * yy[k] - xy[k] * xy[k] <= determinant_max;
                if !hard && !counts {
                    continue;
                }
                let to = Point::new(predictions.x[k], predictions.y[k]);
                let (reach, near) = (self.reach[point], self.reach[point].grown(radius));
                let from = before.filter(|(from, _)| hard && (near.contains(*from) || near.contains(to)));
                let is_expected = counts && near.grown(COST_REACH).contains(to);
                let body = (from.is_some() || is_expected).then(|| body_at(k, to));
                if let (Some((from, a)), Some(b)) = (from, body) {
                    let a = a.unwrap_or_else(|| body_at(k - 1, from));
                    let track = *track
                        .get_or_insert_with(|| self.push_track(Track { other: index, overlaps_now, exact: false }));
                    let a = OrientedBox { half_length, half_width, ..a };
                    let b = OrientedBox { half_length, half_width, ..b };
                    let swept = OrientedBox::spanning(&a, &b);
                    let displacement = b.center - a.center;
                    self.push_sweep(point - 1, Sweep { track, radius: swept.radius(), swept, end: b, displacement });
                }
                if let (true, Some(body)) = (is_expected, body)
                    && reach.grown(COST_REACH).contains(body.center)
                {
                    self.expectations.push(point, &body, [xx[k], xy[k], yy[k]], *probability, settings);
                }
                before = Some((to, body));
            }
        }
    }

    fn push_sweep(&mut self, interval: usize, sweep: Sweep) {
        self.sweeps_by_interval.push(interval, rough(&sweep.swept, self.origin));
        self.sweeps.push(sweep);
    }

    fn push_track(&mut self, track: Track) -> u32 {
        self.tracks.push(track);
        self.tracks.len() as u32 - 1
    }

    /// First contact of a sample with a mode that counts, if any.
    ///
    /// Not a contact: somebody behind the agent's rear who heads the same way while the agent stays in its lane (they
    /// would hit the agent, and keeping distance is up to them) or who comes second and must yield, from then on for
    /// good; an overlap that exists from the start, until it first ends, as long as the centres do not approach.
    pub(super) fn first_contact(&mut self, points: &[Waypoint], dt: f64, request: &PlanRequest) -> Option<Contact> {
        if self.sweeps.is_empty() {
            return None;
        }
        self.ignored.clear();
        self.ignored.resize(self.tracks.len(), false);
        cover(points, (self.half_length, self.half_width), &mut self.steps);
        let mut interval = 0;
        while let Some(found) = next_overlap(self, interval) {
            if let Some(contact) = self.contact_during(found, points, dt, request) {
                return Some(contact);
            }
            interval = found + 1;
        }
        None
    }

    fn contact_during(
        &mut self,
        interval: usize,
        points: &[Waypoint],
        dt: f64,
        request: &PlanRequest,
    ) -> Option<Contact> {
        let (half_length, half_width) = (self.half_length, self.half_width);
        let body = |p: &Waypoint| OrientedBox { center: p.center, axis: p.axis, half_length, half_width };
        let pair = [&points[interval], &points[interval + 1]];
        let middle = (pair[0].center + pair[1].center) * 0.5;
        let reach = half_length.hypot(half_width) + 0.5 * (pair[1].center - pair[0].center).norm();
        for index in self.sweeps_by_interval.of(interval) {
            let sweep = &self.sweeps[*index];
            let distance = reach + sweep.radius;
            let track = sweep.track as usize;
            if (sweep.swept.center - middle).norm_squared() > distance * distance || self.ignored[track] {
                continue;
            }
            if !self.steps[interval].overlaps(&sweep.swept) {
                continue;
            }
            let Track { other, overlaps_now, exact } = self.tracks[track];
            let ego = body(pair[1]);
            if overlaps_now && is_separating(points, interval, &ego, sweep, &body) {
                continue;
            }
            if exact && !touches(&request.others[other], request, pair[1]) {
                continue;
            }
            let keeps_lane = (pair[1].d - points[0].d).abs() < OWN_LANE;
            let time = (interval + 1) as f64 * dt;
            if keeps_lane && (is_follower(&ego, &sweep.end) || must_yield(&ego, sweep, dt, time)) {
                self.ignored[track] = true;
                continue;
            }
            let closing_speed = (pair[1].center - pair[0].center - sweep.displacement).norm() / dt;
            return Some(Contact { other, interval, closing_speed });
        }
        None
    }

    /// No sample can get near anybody's expected position.
    pub(super) fn nobody_is_expected(&self) -> bool {
        self.expectations.is_empty()
    }

    /// Prediction cost of point number `i` (from 1 on) of a sample.
    pub(super) fn prediction_cost(&self, point: &Waypoint, i: usize) -> f64 {
        self.expectations.cost(point, i, (self.half_length, self.half_width))
    }

    /// Sum over participants of 1 / (smallest squared distance of the centres), for those that the samples can reach.
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

for_wide_machines! {
    /// What a footprint (half length and width) covers in each interval.
    fn cover = covers_at, (points: &[Waypoint], half: (f64, f64), out: &mut Vec<OrientedBox>)
}

#[inline(always)]
fn covers_at(points: &[Waypoint], (half_length, half_width): (f64, f64), out: &mut Vec<OrientedBox>) {
    const BLOCK: usize = 32;
    out.clear();
    let mut first = 0;
    while first + 1 < points.len() {
        let n = (points.len() - first).min(BLOCK);
        // Local arrays, one per field, can be worked on several at once.
        let (mut x, mut y, mut axis_x, mut axis_y) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        for i in 0..n {
            let point = &points[first + i];
            (x[i], y[i], axis_x[i], axis_y[i]) = (point.center.x, point.center.y, point.axis.x, point.axis.y);
        }
        let (mut lengths, mut widths) = ([0.0; BLOCK], [0.0; BLOCK]);
        let (mut to_x, mut to_y, mut to_axis_x, mut to_axis_y) =
            ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        for i in 0..n - 1 {
            let a = OrientedBox {
                center: Point::new(x[i], y[i]),
                axis: Point::new(axis_x[i], axis_y[i]),
                half_length,
                half_width,
            };
            let b = OrientedBox {
                center: Point::new(x[i + 1], y[i + 1]),
                axis: Point::new(axis_x[i + 1], axis_y[i + 1]),
                half_length,
                half_width,
            };
            let span = OrientedBox::spanning(&a, &b);
            (to_x[i], to_y[i], to_axis_x[i], to_axis_y[i]) = (span.center.x, span.center.y, span.axis.x, span.axis.y);
            (lengths[i], widths[i]) = (span.half_length, span.half_width);
        }
        for i in 0..n - 1 {
            out.push(OrientedBox {
                center: Point::new(to_x[i], to_y[i]),
                axis: Point::new(to_axis_x[i], to_axis_y[i]),
                half_length: lengths[i],
                half_width: widths[i],
            });
        }
        first += n - 1;
    }
}

/// Numbers of a box in single precision: centre from the origin, axis, half length and width.
#[inline(always)]
fn rough(box_: &OrientedBox, origin: Point) -> [f32; 6] {
    let (center, axis) = (box_.center - origin, box_.axis);
    [center.x, center.y, axis.x, axis.y, box_.half_length, box_.half_width].map(|number| number as f32)
}

for_wide_machines! {
    /// The first interval, from one on, in which the sample at hand overlaps some sweep.
    fn next_overlap = overlap_from, (obstacles: &Obstacles, first: usize) -> Option<usize>
}

#[inline(always)]
fn overlap_from(obstacles: &Obstacles, first: usize) -> Option<usize> {
    let Obstacles { sweeps, sweeps_by_interval, origin, steps, .. } = obstacles;
    for (interval, step) in (first..).zip(&steps[first..]) {
        let numbers = rough(step, *origin);
        let (mut group, end) = sweeps_by_interval.groups(interval);
        while group < end {
            let mut passing = sweeps_by_interval.passing(group, |others, k| may_overlap(&numbers, others, k));
            while passing != 0 {
                if step.overlaps(&sweeps[sweeps_by_interval.number(group, passing)].swept) {
                    return Some(interval);
                }
                passing &= passing - 1;
            }
            group += GROUP;
        }
    }
    None
}

/// No side direction of the first box separates it from one of a group; most that are apart are separated by one.
#[inline(always)]
fn may_overlap(a: &[f32; 6], [x, y, axis_x, axis_y, half_length, half_width]: &[[f32; GROUP]; 6], k: usize) -> u32 {
    /// More than coordinates within a kilometre are rounded by [m].
    const SLACK: f32 = 2e-3;
    let [from_x, from_y, ahead_x, ahead_y, length, width] = *a;
    let (x, y) = (x[k] - from_x, y[k] - from_y);
    let cos = (axis_x[k] * ahead_x + axis_y[k] * ahead_y).abs();
    let sin = (axis_y[k] * ahead_x - axis_x[k] * ahead_y).abs();
    let (ahead, aside) = ((x * ahead_x + y * ahead_y).abs(), (y * ahead_x - x * ahead_y).abs());
    u32::from(
        (ahead <= length + half_length[k] * cos + half_width[k] * sin + SLACK)
            & (aside <= width + half_length[k] * sin + half_width[k] * cos + SLACK),
    )
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

/// The other's centre is behind the agent's rear and it heads the same way.
fn is_follower(ego: &OrientedBox, other: &OrientedBox) -> bool {
    (other.center - ego.center).dot(ego.axis) < -ego.half_length && other.axis.dot(ego.axis) > FOLLOWER_COSINE
}

/// The other would run with its front into the agent's rear half, although it can still stop before that: who
/// comes second waits. Without this rule two who meet at walking pace wait for each other.
fn must_yield(ego: &OrientedBox, sweep: &Sweep, dt: f64, time: f64) -> bool {
    let front = sweep.end.center + sweep.end.axis * sweep.end.half_length;
    let speed = sweep.displacement.dot(sweep.end.axis) / dt;
    let is_behind = (front - ego.center).dot(ego.axis) < 0.0;
    is_behind && speed > YIELDING_SPEED && speed <= 2.0 * YIELDING_DECELERATION * time
}

/// A pair that overlapped at the start still does at the end of the interval, has done so ever since, and the centres
/// do not approach.
fn is_separating(
    points: &[Waypoint],
    interval: usize,
    ego: &OrientedBox,
    sweep: &Sweep,
    body: &impl Fn(&Waypoint) -> OrientedBox,
) -> bool {
    let other_before = OrientedBox { center: sweep.end.center - sweep.displacement, ..sweep.end };
    let before = body(&points[interval]);
    let was_together = before.overlaps(&other_before);
    let distance = (ego.center - sweep.end.center).norm();
    was_together && distance >= (before.center - other_before.center).norm() - 1e-6
}

/// The exact shapes touch at the end of the interval.
fn touches(other: &Other, request: &PlanRequest, point: &Waypoint) -> bool {
    other.shape.overlaps(other.pose, request.shape, point.pose())
}

#[cfg(test)]
mod tests;
