//! The others over the time of a plan: whom a roll-out hits first, and how near it comes to the rest.

use super::super::driven_point::DrivenPoint;
use super::super::{Other, PlanRequest};
use super::settings::RolloutSettings;
use super::start::Start;
use crate::conduct::{FOLLOWER_COSINE, STATIONARY_SPEED};
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;

/// A follower keeps its distance while the agent stays within this of its offset [m].
const OWN_LANE: f64 = 1.0;
/// Being nearer than this is a risk, along and across the other's heading [m], and this much more for each second ahead
/// [m/s]: so predictions spread.
const RISK_ALONG: (f64, f64) = (1.0, 0.5);
const RISK_ACROSS: (f64, f64) = (0.3, 0.1);
/// The risk is examined at every so many points.
const RISK_STEP: usize = 3;
/// The vehicle can accelerate by this on its way to what it may meet [m/s²].
const ACCELERATION: f64 = 3.0;
/// Shares of the margins to which it is known how much a plan keeps.
const SHARES: [f64; 3] = [0.75, 0.5, 0.25];
/// Being nearer to others than the margin by up to this costs what any missing margin costs [m].
const MISSING_MIN: f64 = 0.1;
/// Room around what the vehicle can cover [m].
const ROOM: f64 = 2.0;
/// It moves to the side by at most this share of its way.
const SIDE_SHARE: f64 = 0.3;

/// The first contact of a roll-out, or where it leaves the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contact {
    /// The point at which it is found.
    pub(super) point: usize,
    /// Closing speed [m/s].
    pub(super) speed: f64,
    /// Position in the request's `others`; `None`: the edge of the road.
    pub(super) other: Option<usize>,
}

impl Contact {
    /// How bad it is, as [`super::RolloutWeights::contact`] says.
    pub(super) fn severity(&self, dt: f64) -> f64 {
        (1.0 + self.speed) / (self.point as f64 * dt).powi(2)
    }
}

/// A mode of a participant, or a part of a structure.
#[derive(Debug, Clone, Copy)]
struct Body {
    other: usize,
    probability: f64,
    /// It must not be hit.
    is_hard: bool,
    /// Its boxes: the first, and how many.
    first: usize,
    n: usize,
    is_static: bool,
    /// It is where it will be.
    stands: bool,
    overlaps_now: bool,
    /// Kept along and across [m], and more across for the relative speed [s].
    margin: [f64; 3],
    /// Of its box [m].
    radius: f64,
    /// Its longest way from one point to the next [m].
    way: f64,
}

impl Body {
    /// What is hard, as it is now, without boxes, with the margins to keep to it where it is passed at a speed [m/s]; none
    /// where the vehicle is nearer now.
    fn now(
        other: usize,
        (body, stands): (&OrientedBox, bool),
        (own, passing): (&OrientedBox, f64),
        settings: &RolloutSettings,
    ) -> Self {
        let margins = [settings.margin_length, settings.margin_width, settings.margin_time];
        let half_length = body.half_length + margins[0];
        let half_width = body.half_width + margins[1] + margins[2] * passing.abs();
        let is_near = own.overlaps(&OrientedBox { half_length, half_width, ..*body });
        Self {
            other,
            probability: 1.0,
            is_hard: true,
            first: 0,
            n: 0,
            is_static: false,
            stands,
            overlaps_now: is_near && own.overlaps(body),
            margin: if is_near { [0.0; 3] } else { margins },
            radius: body.radius(),
            way: 0.0,
        }
    }
}

/// All that the vehicle can meet; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Surroundings {
    bodies: Vec<Body>,
    boxes: Vec<OrientedBox>,
}

impl Surroundings {
    pub(super) fn prepare(
        &mut self,
        request: &PlanRequest,
        settings: &RolloutSettings,
        start: &Start,
        n_points: usize,
    ) {
        self.bodies.clear();
        self.boxes.clear();
        let vehicle = request.vehicle;
        let time = (n_points - 1) as f64 * request.dt;
        let way = start.velocity * time + 0.5 * ACCELERATION * time * time;
        let own = OrientedBox::new(request.state.pose(), vehicle.length, vehicle.width);
        // A box ahead that holds all that the vehicle can cover.
        let reach = OrientedBox {
            center: own.center + own.axis * (0.5 * way),
            axis: own.axis,
            half_length: 0.5 * way + vehicle.length + ROOM,
            half_width: (SIDE_SHARE * way).max(vehicle.length + ROOM),
        };
        for (index, other) in request.others.iter().enumerate() {
            if other.is_static {
                self.add_static((index, other), (settings, start.velocity), (&own, &reach));
            } else {
                let moving = Point::from_angle(other.pose.orientation) * other.velocity;
                let passing = (own.axis * start.velocity - moving).norm();
                self.add_moving((index, other), (request, settings, passing), (&own, &reach), n_points);
            }
        }
    }

    fn add_static(
        &mut self,
        (index, other): (usize, &Other),
        (settings, passing): (&RolloutSettings, f64),
        (own, reach): (&OrientedBox, &OrientedBox),
    ) {
        for (body, _) in other.shape.parts().iter().map(|part| part.tightest_box(other.pose)) {
            if body.grown(1.0).overlaps(reach) {
                let part = Body::now(index, (&body, true), (own, passing), settings);
                self.push(Body { is_static: true, ..part }, std::iter::once(body));
            }
        }
    }

    fn add_moving(
        &mut self,
        (index, other): (usize, &Other),
        (request, settings, passing): (&PlanRequest, &RolloutSettings, f64),
        (own, reach): (&OrientedBox, &OrientedBox),
        n_points: usize,
    ) {
        let predictions = request.predictions;
        let Ok(shift) = usize::try_from(request.time_step - predictions.time_step) else { return };
        let n = predictions.n_steps.saturating_sub(shift).min(n_points - 1);
        let modes = &predictions.probability[other.row * predictions.n_modes..][..predictions.n_modes];
        let largest = modes.iter().copied().fold(0.0, f64::max);
        let now = other.shape.oriented_box(other.pose);
        let body = Body::now(index, (&now, other.velocity.abs() < STATIONARY_SPEED), (own, passing), settings);
        let room = other.shape.bounding_radius() + 1.0;
        for (mode, &probability) in modes.iter().enumerate() {
            let region = request.prediction_index.regions[other.row * predictions.n_modes + mode];
            if probability <= 0.0 || !region.grown(room).overlaps(reach) {
                continue;
            }
            let is_hard = probability >= settings.collision_mode_probability || probability >= largest;
            let from = predictions.offset(other.row, mode) + shift;
            let boxes = (from..from + n).take_while(|k| predictions.valid[*k]).map(|k| {
                let position = Point::new(predictions.x[k], predictions.y[k]);
                other.shape.oriented_box_along(position, request.prediction_index.axis(k))
            });
            self.push(Body { probability, is_hard, ..body }, std::iter::once(now).chain(boxes));
        }
    }

    /// Adds a body with its boxes.
    fn push(&mut self, body: Body, boxes: impl Iterator<Item = OrientedBox>) {
        let first = self.boxes.len();
        self.boxes.extend(boxes);
        let way = longest(self.boxes[first..].iter().map(|one| one.center));
        self.bodies.push(Body { first, n: self.boxes.len() - first, way, ..body });
    }

    fn at(&self, body: &Body, point: usize) -> Option<&OrientedBox> {
        let place = if body.is_static { 0 } else { point };
        (place < body.n).then(|| &self.boxes[body.first + place])
    }

    /// The first contact that is the vehicle's to avoid, with a share of its margins.
    pub(super) fn first_contact(&self, request: &PlanRequest, points: &[DrivenPoint], share: f64) -> Option<Contact> {
        let mut first: Option<Contact> = None;
        let way = longest(points.iter().map(|point| point.center));
        for body in self.bodies.iter().filter(|body| body.is_hard) {
            let last = first.map_or(points.len(), |contact| contact.point);
            first = self.contact(body, request, (&points[..last], way), share).or(first);
        }
        first
    }

    /// What a roll-out that comes nearer to others than the margins misses beside what stands, in multiples of what any
    /// missing margin costs. Predictions of moving participants are too uncertain for such a measure.
    pub(super) fn missing_margin(
        &self,
        request: &PlanRequest,
        points: &[DrivenPoint],
        settings: &RolloutSettings,
    ) -> f64 {
        let mut missing: f64 = 1.0;
        let way = longest(points.iter().map(|point| point.center));
        for body in self.bodies.iter().filter(|body| body.stands) {
            for share in std::iter::once(1.0).chain(SHARES) {
                let Some(Contact { speed, .. }) = self.contact(body, request, (points, way), share) else { break };
                let margin = settings.margin_width + settings.margin_time * speed;
                missing = missing.max((1.0 - share + SHARES[2]) * margin / MISSING_MIN);
            }
        }
        missing
    }

    /// The first contact with a body at points between which the vehicle drives at most a way [m].
    fn contact(
        &self,
        body: &Body,
        request: &PlanRequest,
        (points, longest): (&[DrivenPoint], f64),
        share: f64,
    ) -> Option<Contact> {
        /// Rounding.
        const SAFETY: f64 = 1.0 + 1e-9;
        let [along, across, across_time] = body.margin.map(|margin| share * margin);
        let vehicle = request.vehicle;
        let radii = body.radius + 0.5 * vehicle.length.hypot(vehicle.width) + along;
        let ways = longest + body.way;
        let furthest = SAFETY * (radii + across + across_time * ways / request.dt + ways);
        let mut before = self.at(body, 0)?;
        let mut is_together = body.overlaps_now;
        for i in 1..points.len() {
            let other = self.at(body, i)?;
            let apart = points[i].center - other.center;
            if apart.norm_squared() > furthest * furthest {
                (before, is_together) = (other, false);
                continue;
            }
            let (moved, way) = (other.center - before.center, points[i].center - points[i - 1].center);
            let other_before = std::mem::replace(&mut before, other);
            let passing = (way - moved).norm() / request.dt;
            let beside = across + across_time * passing;
            let reach = radii + beside + way.norm() + moved.norm();
            if apart.norm_squared() > reach * reach {
                is_together = false;
                continue;
            }
            let (from, ego) = (points[i - 1].footprint(request), points[i].footprint(request));
            let swept = OrientedBox::spanning(other_before, other);
            let (half_length, half_width) = (swept.half_length + along, swept.half_width + beside);
            if !OrientedBox::spanning(&from, &ego).overlaps(&OrientedBox { half_length, half_width, ..swept }) {
                is_together = false;
                continue;
            }
            if is_together && apart.norm() >= (from.center - other_before.center).norm() - 1e-6 {
                continue;
            }
            let keeps_lane = (points[i].d - points[0].d).abs() < OWN_LANE;
            let change = &request.lane_change;
            let is_behind = -apart.dot(ego.axis) < -ego.half_length && other.axis.dot(ego.axis) > FOLLOWER_COSINE;
            let is_reversing = points[i - 1].velocity < 0.0 || points[i].velocity < 0.0;
            if !is_reversing && is_behind && !body.stands && (keeps_lane || change.is_accepted) {
                return None;
            }
            return Some(Contact { point: i, speed: passing, other: Some(body.other) });
        }
        None
    }

    /// Integral of the nearness to others [s].
    pub(super) fn nearness(&self, request: &PlanRequest, points: &[DrivenPoint]) -> f64 {
        let mut sum = 0.0;
        let radius = 0.5 * request.vehicle.length.hypot(request.vehicle.width);
        for body in &self.bodies {
            for i in (RISK_STEP..points.len()).step_by(RISK_STEP) {
                let Some(other) = self.at(body, i) else { break };
                let time = i as f64 * request.dt;
                let (long, wide) = (RISK_ALONG.0 + RISK_ALONG.1 * time, RISK_ACROSS.0 + RISK_ACROSS.1 * time);
                let offset = points[i].center - other.center;
                let reach = radius + body.radius + long;
                if offset.norm_squared() > reach * reach {
                    continue;
                }
                let ego = points[i].footprint(request);
                let (cos, sin) = (other.axis.dot(ego.axis).abs(), other.axis.cross(ego.axis).abs());
                let along =
                    offset.dot(other.axis).abs() - other.half_length - ego.half_length * cos - ego.half_width * sin;
                let across =
                    other.axis.cross(offset).abs() - other.half_width - ego.half_length * sin - ego.half_width * cos;
                let nearness = 1.0 - (along / long).max(across / wide).max(0.0);
                if nearness > 0.0 {
                    let is_follower =
                        offset.dot(ego.axis) > ego.half_length && other.axis.dot(ego.axis) > FOLLOWER_COSINE;
                    if is_follower {
                        break;
                    }
                    sum += body.probability * nearness;
                }
            }
        }
        sum * RISK_STEP as f64 * request.dt
    }
}

/// The longest way between consecutive places [m].
fn longest(places: impl Iterator<Item = Point>) -> f64 {
    let mut before = None;
    let squares = places.map(|place| before.replace(place).map_or(0.0, |before| (place - before).norm_squared()));
    squares.fold(0.0, f64::max).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::prediction_index::PredictionIndex;
    use crate::plan::testing::{Car, Drive};
    use crate::trajectory::Predictions;

    #[test]
    fn who_passes_through_the_vehicle_between_two_points_far_away_is_met() {
        let drive = Drive::on_three_lanes(100.0, 0.0)
            .with_cars(vec![Car { is_static: false, ..Car::at(190.0, 0.0, 0.0, 0.0) }]);
        let met = |sideways: f64| {
            drive.with_request(|request| {
                let known = request.predictions;
                let mut jumping = Predictions::empty(known.time_step, known.ids.clone(), 1, known.n_steps);
                jumping.probability[0] = 1.0;
                for k in 0..known.n_steps {
                    (jumping.valid[k], jumping.y[k], jumping.orientation[k]) = (true, sideways, 0.0);
                    jumping.x[k] = if k < 5 { 190.0 } else { 10.0 };
                }
                let prediction_index = PredictionIndex::of(&jumping, &drive.positions());
                let request = &PlanRequest { predictions: &jumping, prediction_index: &prediction_index, ..*request };
                let (settings, start) = (RolloutSettings::default(), Start::new(request, true).expect("on its path"));
                let center = request.state.pose().position;
                let (axis, n_points) = (Point::new(1.0, 0.0), known.n_steps + 1);
                let still = DrivenPoint {
                    center,
                    axis,
                    theta: 0.0,
                    curvature: 0.0,
                    velocity: 0.0,
                    acceleration: 0.0,
                    s: start.s,
                    d: 0.0,
                };
                let mut surroundings = Surroundings::default();
                surroundings.prepare(request, &settings, &start, n_points);
                surroundings.first_contact(request, &vec![still; n_points], 0.0).map(|contact| contact.point)
            })
        };
        assert_eq!(met(0.0), Some(6));
        assert_eq!(met(5.0), None);
    }
}
