//! When the lane of the other direction is free to pass what stands.

use super::super::car_following::LEADER_HEADING_COSINE;
use super::super::conflicts::MODE_PROBABILITY;
use super::super::{Other, PlanRequest};
use super::{CLEARANCES, LEAD, Place, ROOM_STEP, SWING_LENGTH, Section, is_parked, reach};
use crate::conduct::STATIONARY_SPEED;
use crate::geometry::Point;
use crate::rules::{EARLY_ACCELERATION, travel_time};

/// Least time between leaving the oncoming lane and the next oncoming vehicle [s]; less if the agent is already on its
/// way.
const GAP: f64 = 2.0;
const GAP_UNDER_WAY: f64 = 0.5;
/// Distance behind the obstruction at which an agent waits [m]: from there it can swing out.
const WAITING_GAP: f64 = 7.0;
/// An agent that passes over the other lane accelerates at least so [m/s²], up to this speed [m/s].
const ACCELERATION: f64 = 1.0;
const SPEED: f64 = 6.0;
/// An agent that has moved by this share of the offset is under way.
const UNDER_WAY: f64 = 0.3;
/// Oncoming vehicles are looked for up to this distance from where they meet the agent [m].
const SIGHT: f64 = 250.0;
/// More than any rounding of a distance [m].
const ROUNDING: f64 = 1e-6;
/// Largest offset of an oncoming vehicle from its lane while it passes something itself [m].
const PASSING_OFFSET: f64 = 2.0;

/// A participant that the agent follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::plan) struct Leader {
    /// Arc length of its nearest point [m].
    pub(in crate::plan) rear: f64,
    /// Its speed along the path [m/s], not negative.
    pub(in crate::plan) velocity: f64,
}

/// All that stands in a row and is passed over the lane of the other direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::plan) struct Detour {
    /// Arc lengths between which it stands [m].
    rear: f64,
    front: f64,
    /// Offset beside the first of them [m]. The agent aims at no more than that: once the first one lies behind, the next
    /// one is the first.
    pub(in crate::plan) offset: f64,
    /// The largest offset [m]: before the agent enters, nothing may stand there either.
    widest: f64,
}

impl Detour {
    /// Past the nearest of some (arc lengths, offset), together with those so near behind it that the agent does not
    /// return in between.
    pub(in crate::plan) fn past(blocks: &mut [(f64, f64, f64)], vehicle_length: f64) -> Option<Self> {
        blocks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (&(rear, front, offset), others) = blocks.split_first()?;
        let mut detour = Self { rear, front, offset, widest: offset };
        for (rear, front, offset) in others {
            if *rear > detour.front + vehicle_length + 2.0 * SWING_LENGTH {
                break;
            }
            detour.front = detour.front.max(*front);
            if offset.abs() > detour.widest.abs() {
                detour.widest = *offset;
            }
        }
        Some(detour)
    }

    /// Arc length of its nearest point [m].
    pub(in crate::plan) fn rear(&self) -> f64 {
        self.rear
    }

    /// Arc lengths between which it stands [m].
    pub(in crate::plan) fn stretch(&self) -> (f64, f64) {
        (self.rear, self.front)
    }

    /// What the agent follows at a gap [m] until it may pass; `None` if it may pass now. It depends on nothing but what the
    /// agent sees: once beside what stands, or too fast to stop before it, the agent goes on; when it has begun to move
    /// over, smaller gaps suffice.
    pub(in crate::plan) fn wait(
        &self,
        request: &PlanRequest,
        start: &Place,
        leaders: &[Leader],
        (deceleration, gap): (f64, f64),
    ) -> Option<Leader> {
        let behind = |s: f64, distance: f64| Some(Leader { rear: s - (distance - gap).max(0.0), velocity: 0.0 });
        let vehicle = request.vehicle;
        let front = start.s + vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let moved = start.d * self.offset.signum();
        let is_under_way = moved > UNDER_WAY * self.offset.abs();
        let can_stop = front + 0.5 * start.velocity.powi(2) / deceleration < self.rear - LEAD;
        if is_under_way && !can_stop {
            return None;
        }
        // Both ways of the swing are half on the lane of the other direction.
        let swing = 0.5 * reach(start.velocity);
        let (from, to) = (self.rear - swing, self.front + swing);
        let largest = start.velocity.max(SPEED);
        let enter = travel_time(from - front, start.velocity, largest, EARLY_ACCELERATION);
        let leave = travel_time(to + vehicle.length - front, start.velocity, largest, ACCELERATION);
        let room = to + vehicle.length;
        let is_held =
            leaders.iter().any(|leader| leader.rear < self.rear || leader.rear + leader.velocity * leave < room);
        let reserve = if is_under_way { GAP_UNDER_WAY } else { GAP };
        let has_room = !is_held && !self.is_blocked(request);
        if has_room && !self.meets_oncoming(request, (from, to), (enter, leave + reserve)) {
            return None;
        }
        behind(self.rear, WAITING_GAP)
    }

    /// Something else stands where the agent would pass.
    fn is_blocked(&self, request: &PlanRequest) -> bool {
        let (path, half) = (&request.route.path, 0.5 * request.vehicle.width + CLEARANCES[1] - ROUNDING);
        let (middle, length) = (0.5 * (self.rear + self.front), self.front - self.rear + 2.0 * request.vehicle.length);
        request.others.iter().any(|other| {
            if !other.is_static && other.velocity.abs() >= STATIONARY_SPEED {
                return false;
            }
            let body = other.shape.oriented_box(other.pose);
            let size = body.half_length + body.half_width;
            let Some((s, d)) = path.project_near(body.center, middle, 0.5 * length + size) else { return false };
            let tangent = path.at(s).tangent();
            let (cos, sin) = (tangent.dot(body.axis).abs(), tangent.cross(body.axis).abs());
            let half_s = body.half_length * cos + body.half_width * sin;
            let half_d = body.half_length * sin + body.half_width * cos;
            let is_beside = (s - middle).abs() < 0.5 * length + half_s;
            is_beside && [self.offset, self.widest].iter().any(|offset| (d - offset).abs() < half + half_d)
        })
    }

    /// An oncoming vehicle is on the stretch of its lane beside the path at the time [s].
    fn meets_oncoming(&self, request: &PlanRequest, (from, to): (f64, f64), (enter, leave): (f64, f64)) -> bool {
        let entries = self.entries(request, (from, to));
        request.others.iter().filter(|other| !is_parked(other)).any(|other| {
            let Some(distance) = distance(other, request, &entries) else { return false };
            let half = other.shape.oriented_box(other.pose).half_length;
            let (arrives, leaves) = (distance - half, distance + (to - from) + half);
            leaves > 0.0 && speeds(other, request).any(|speed| arrives < speed * leave && leaves > speed * enter)
        })
    }

    /// Oncoming lanelets beside the path and their predecessors, with the arc length on each, beyond the end of
    /// predecessors, at which oncoming vehicles reach the stretch [m].
    fn entries(&self, request: &PlanRequest, (from, to): (f64, f64)) -> Vec<(usize, f64)> {
        let (path, road) = (&request.route.path, request.road);
        let mut found: Vec<(usize, f64)> = Vec::new();
        let n = ((to - from) / ROOM_STEP).ceil();
        let last = path.at(to).position;
        for i in 0..=n as usize {
            let at = path.at((from + (to - from) * i as f64 / n).max(0.0));
            let section = Section::new(request, at.tangent(), at.position);
            for &lanelet in section.opposite() {
                if found.iter().all(|(known, _)| *known != lanelet) {
                    found.push((lanelet, road.lanelets()[lanelet].center.project(last).s));
                }
            }
        }
        let mut next = 0;
        while let Some((lanelet, entry)) = found.get(next).copied() {
            next += 1;
            for before in &road.lanelets()[lanelet].predecessors {
                let entry = entry + road.lanelets()[*before].length;
                if entry < SIGHT && found.iter().all(|(known, _)| known != before) {
                    found.push((*before, entry));
                }
            }
        }
        found
    }
}

/// How far the middle of an oncoming vehicle has to go to a stretch of its lane [m], negative behind its beginning.
fn distance(other: &Other, request: &PlanRequest, entries: &[(usize, f64)]) -> Option<f64> {
    let road = request.road;
    let axis = Point::from_angle(other.pose.orientation) * if other.velocity < 0.0 { -1.0 } else { 1.0 };
    let here = road.lanelets_near(other.pose.position, PASSING_OFFSET);
    let entries = entries.iter().filter(|(lanelet, _)| here.binary_search(lanelet).is_ok());
    let along = entries.filter_map(|(lanelet, entry)| {
        let foot = road.lanelets()[*lanelet].center.project(other.pose.position).s;
        let leads = Point::from_angle(road.heading_at(*lanelet, foot)).dot(axis) > LEADER_HEADING_COSINE;
        leads.then_some(entry - foot)
    });
    along.reduce(f64::min)
}

/// Its speed in the mean over each of its predicted modes, and now [m/s], unless it is expected to come to rest.
fn speeds(other: &Other, request: &PlanRequest) -> impl Iterator<Item = f64> {
    let predictions = request.predictions;
    let (row, from) = (other.row, other.pose.position);
    let mean = move |mode: usize| {
        if predictions.probability[row * predictions.n_modes + mode] < MODE_PROBABILITY {
            return None;
        }
        let first = predictions.offset(row, mode);
        let last = (0..predictions.n_steps).rev().find(|step| predictions.valid[first + step])?;
        let place = Point::new(predictions.x[first + last], predictions.y[first + last]);
        let steps = predictions.time_step + last as i64 + 1 - request.time_step;
        let stops = predictions.velocity[first + last].abs() < STATIONARY_SPEED;
        (steps > 0).then(|| (from.distance(place) / (steps as f64 * request.dt), stops))
    };
    let modes = move || (0..predictions.n_modes).filter_map(mean);
    let stops = modes().next().is_some() && modes().all(|(_, stops)| stops);
    let now = (!stops).then(|| other.velocity.abs());
    now.into_iter().chain(modes().map(|(speed, _)| speed))
}
