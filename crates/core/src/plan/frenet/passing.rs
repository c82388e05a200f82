//! What stands in the way and is passed: on which side there is room, and when the lane of the other direction is free.

use super::super::car_following::{LEADER_HEADING_COSINE, LEADER_STATIONARY_SPEED};
use super::super::frame::Start;
use super::super::{Other, PlanRequest};
use crate::geometry::Point;
use crate::rules::{EARLY, travel_time};
use crate::vehicle::ParticipantKind;

/// Distance to what stands and is passed [m]: the first one for which there is room.
const CLEARANCES: [f64; 2] = [0.3, 0.2];
/// Room is needed from so far before it to so far behind it [m], examined at such steps [m].
const LEAD: f64 = 1.0;
const STEP: f64 = 2.0;
/// The agent moves to the side so long before it [s], but no less than this [m].
const TIME: f64 = 3.0;
const LENGTH: f64 = 10.0;
/// Vehicles that stand nearer to the path than this [m] and head along it wait in a queue.
const QUEUE_OFFSET: f64 = 1.0;
/// Vehicles that stand so near before a stop line or behind another one [m] wait there.
const WAITING_REACH: f64 = 15.0;
/// The agent has left the lane of the other direction so long before an oncoming vehicle comes [s]; less if it is on its
/// way already.
const GAP: f64 = 2.0;
const GAP_UNDER_WAY: f64 = 0.5;
/// Who waits to pass stands so far behind [m]: from there it can swing out.
const WAITING_GAP: f64 = 7.0;
/// Its swing ends when its front is so far beside [m], but is neither shorter nor longer than this.
const SWING_BESIDE: f64 = 2.0;
const SWING: (f64, f64) = (6.0, 12.0);
/// An agent that passes over the other lane accelerates at least so [m/s²], up to this speed [m/s].
const ACCELERATION: f64 = 1.0;
const SPEED: f64 = 6.0;
/// Whoever has moved by this share of the offset is under way.
const UNDER_WAY: f64 = 0.3;
/// Oncoming vehicles are looked for up to this distance from where they meet the agent [m].
const SIGHT: f64 = 250.0;
/// Modes that are less probable do not count.
const PROBABILITY_MIN: f64 = 0.2;
/// More than any rounding of a distance [m].
const ROUNDING: f64 = 1e-6;

/// How far ahead of its front the agent looks for a place beside what it passes [m].
pub(super) fn reach(start: &Start) -> f64 {
    LENGTH.max(TIME * start.velocity)
}

/// A participant that the agent follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leader {
    /// Arc length of its nearest point [m].
    pub(super) rear: f64,
    /// Its speed along the path [m/s], not negative.
    pub(super) velocity: f64,
}

/// What stands in the way, along and across the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Standing {
    /// Arc lengths of its nearest and furthest point [m].
    pub(super) rear: f64,
    pub(super) front: f64,
    /// Offset of its middle [m], and half its width across the path.
    pub(super) d: f64,
    pub(super) half_d: f64,
    /// Cosine of its heading to the path's.
    pub(super) cos: f64,
}

/// How something that stands may be passed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Passage {
    /// On lanelets of the agent's direction, at an offset [m].
    Here(f64),
    /// Over the lane of the other direction, at an offset [m], while nobody comes there.
    Opposite(f64),
}

impl Standing {
    /// Where the agent can pass it; not if it waits in a queue.
    pub(super) fn passage(&self, other: &Other, request: &PlanRequest, d_max: f64) -> Option<Passage> {
        let is_left = other.is_static || other.kind == ParticipantKind::ParkedVehicle;
        if !is_left && self.cos > LEADER_HEADING_COSINE && self.d.abs() < QUEUE_OFFSET {
            return None;
        }
        let found = self.sides(request, d_max, |place, road| road.is_own(place));
        if let Some(offset) = found {
            return Some(Passage::Here(offset));
        }
        let settings = request.rules.settings;
        if !(settings.enabled && settings.passing) || !(is_left || self.is_parked(request)) {
            return None;
        }
        let found = self.sides(request, d_max, |place, road| road.is_own(place) || road.is_open(place));
        found.filter(|offset| is_left || offset * self.d < 0.0).map(Passage::Opposite)
    }

    /// A vehicle at the side that waits neither before a line nor behind others.
    fn is_parked(&self, request: &PlanRequest) -> bool {
        let before = |s: f64| (self.rear..self.front + WAITING_REACH).contains(&s);
        let follows = |other: &Other| {
            let found = request.route.path.project_near(other.pose.position, self.front, WAITING_REACH);
            found.is_some_and(|(s, d)| s > self.front && before(s) && (d - self.d).abs() < QUEUE_OFFSET)
        };
        self.d.abs() >= QUEUE_OFFSET
            && self.cos.abs() > LEADER_HEADING_COSINE
            && !request.rules.way.lines().any(|(s, _)| before(s))
            && !request.others.iter().any(follows)
    }

    /// The nearest offset beside it whose ground is admitted.
    fn sides(&self, request: &PlanRequest, d_max: f64, admits: impl Fn(Point, &Section) -> bool) -> Option<f64> {
        CLEARANCES.into_iter().find_map(|clearance| {
            let half_gap = self.half_d + 0.5 * request.vehicle.width + clearance;
            let mut sides = [(self.d - half_gap).min(0.0), (self.d + half_gap).max(0.0)];
            sides.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            let has_room = |side: &f64| side.abs() <= d_max && self.has_room(request, *side, &admits);
            sides.into_iter().find(has_room)
        })
    }

    /// The ground is admitted on which the agent passes at an offset of its rear axle.
    fn has_room(&self, request: &PlanRequest, d: f64, admits: impl Fn(Point, &Section) -> bool) -> bool {
        let (path, vehicle) = (&request.route.path, request.vehicle);
        let length = self.front - self.rear + 2.0 * LEAD + vehicle.length;
        let n = (length / STEP).ceil();
        let first = self.rear - LEAD - vehicle.length;
        (0..=n as usize).all(|i| {
            let at = path.at((first + length * i as f64 / n).max(0.0));
            let section = Section { request, tangent: at.tangent(), middle: at.position };
            let left = section.tangent.left();
            [-0.5, 0.5].iter().all(|side| admits(at.position + left * (d + side * vehicle.width), &section))
        })
    }
}

/// The road across the path at a place.
struct Section<'a> {
    request: &'a PlanRequest<'a>,
    tangent: Point,
    middle: Point,
}

impl Section<'_> {
    /// Cosine of a lanelet's direction to the path's, beside a place.
    fn cosine(&self, lanelet: usize, place: Point) -> f64 {
        let road = self.request.road;
        let foot = road.lanelets()[lanelet].center.project(place).s;
        Point::from_angle(road.heading_at(lanelet, foot)).dot(self.tangent)
    }

    /// A place lies on a lanelet of the agent's direction.
    fn is_own(&self, place: Point) -> bool {
        let here = self.request.road.lanelets_at(place);
        here.iter().any(|lanelet| self.cosine(*lanelet, place) > LEADER_HEADING_COSINE)
    }

    /// A place lies on a lane of the other direction beside the agent's, with a line between them that may be crossed.
    fn is_open(&self, place: Point) -> bool {
        self.opposite().any(|lanelet| self.request.road.lanelets_at(place).contains(&lanelet))
    }

    /// Lanes of the other direction beside the agent's that may be entered.
    fn opposite(&self) -> impl Iterator<Item = usize> {
        let (road, closed) = (self.request.road, &self.request.rules.control.closed);
        let mut own = road.lanelets_at(self.middle);
        own.retain(|lanelet| self.cosine(*lanelet, self.middle) > LEADER_HEADING_COSINE);
        own.into_iter().flat_map(move |lanelet| {
            let found = &road.lanelets()[lanelet];
            let beside = [found.adjacent_left, found.adjacent_right].into_iter().zip(closed);
            let open = beside.filter(move |(_, closed)| closed.binary_search(&lanelet).is_err());
            open.filter_map(|(beside, _)| beside.filter(|(_, is_same)| !is_same).map(|(beside, _)| beside))
        })
    }
}

/// All that stands in a row and is passed over the lane of the other direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Detour {
    /// Arc lengths between which it stands [m].
    rear: f64,
    front: f64,
    /// Offset beside the first of them [m], and the largest one.
    pub(super) offset: f64,
    widest: f64,
}

impl Detour {
    /// Past the nearest of some (arc lengths, offset), together with those so near behind it that the agent does not
    /// return in between.
    pub(super) fn past(blocks: &mut [(f64, f64, f64)], vehicle_length: f64) -> Option<Self> {
        blocks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (&(rear, front, offset), others) = blocks.split_first()?;
        let mut detour = Self { rear, front, offset, widest: offset };
        for (rear, front, offset) in others {
            if *rear > detour.front + vehicle_length + 2.0 * LENGTH {
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
    pub(super) fn rear(&self) -> f64 {
        self.rear
    }

    /// Length in which an agent has moved over that starts from rest, with its front at an arc length [m].
    pub(super) fn swing(&self, front: f64) -> f64 {
        (self.rear - front + SWING_BESIDE).clamp(SWING.0, SWING.1)
    }

    /// Who waits to pass follows this.
    pub(super) fn leader(&self, gap: f64) -> Leader {
        Leader { rear: self.rear - (WAITING_GAP - gap).max(0.0), velocity: 0.0 }
    }

    /// The agent may pass now. It depends on nothing but what the agent sees: once beside what stands, or too fast to stop
    /// before it, the agent goes on; when it has begun to move over, smaller gaps suffice.
    pub(super) fn is_free(
        &self,
        request: &PlanRequest,
        start: &Start,
        mut leaders: impl Iterator<Item = Leader>,
        deceleration: f64,
    ) -> bool {
        let vehicle = request.vehicle;
        let front = start.s + vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let moved = start.d * self.offset.signum();
        let is_under_way = moved > UNDER_WAY * self.offset.abs();
        let can_stop = front + 0.5 * start.velocity.powi(2) / deceleration < self.rear - LEAD;
        if is_under_way && !can_stop {
            return true;
        }
        // Both ways of the swing are half on the lane of the other direction.
        let swing = 0.5 * reach(start);
        let (from, to) = (self.rear - swing, self.front + swing);
        let largest = start.velocity.max(SPEED);
        let enter = travel_time(from - front, start.velocity, largest, EARLY);
        let leave = travel_time(to + vehicle.length - front, start.velocity, largest, ACCELERATION);
        let room = to + vehicle.length;
        let is_held = leaders.any(|leader| leader.rear < self.rear || leader.rear + leader.velocity * leave < room);
        let gap = if is_under_way { GAP_UNDER_WAY } else { GAP };
        !is_held && !self.is_blocked(request) && !self.meets(request, (from, to), (enter, leave + gap))
    }

    /// Something else stands where the agent would pass.
    fn is_blocked(&self, request: &PlanRequest) -> bool {
        let (path, half) = (&request.route.path, 0.5 * request.vehicle.width + CLEARANCES[1] - ROUNDING);
        let (middle, length) = (0.5 * (self.rear + self.front), self.front - self.rear + 2.0 * request.vehicle.length);
        request.others.iter().any(|other| {
            if !other.is_static && other.velocity.abs() >= LEADER_STATIONARY_SPEED {
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
    fn meets(&self, request: &PlanRequest, (from, to): (f64, f64), (enter, leave): (f64, f64)) -> bool {
        let entries = self.entries(request, (from, to));
        request.others.iter().filter(|other| !other.is_static).any(|other| {
            let Some(distance) = distance(other, request, &entries) else { return false };
            let half = other.shape.oriented_box(other.pose).half_length;
            let (arrives, leaves) = (distance - half, distance + (to - from) + half);
            leaves > 0.0 && speeds(other, request).any(|speed| arrives < speed * leave && leaves > speed * enter)
        })
    }

    /// Lanelets of the other direction beside the path and those that lead into them, with the arc length on each, beyond
    /// its end on those before, at which oncoming vehicles reach the stretch [m].
    fn entries(&self, request: &PlanRequest, (from, to): (f64, f64)) -> Vec<(usize, f64)> {
        let (path, road) = (&request.route.path, request.road);
        let mut found: Vec<(usize, f64)> = Vec::new();
        let n = ((to - from) / STEP).ceil();
        let last = path.at(to).position;
        for i in 0..=n as usize {
            let at = path.at((from + (to - from) * i as f64 / n).max(0.0));
            let section = Section { request, tangent: at.tangent(), middle: at.position };
            for lanelet in section.opposite() {
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
    let here = road.lanelets_near(other.pose.position, 1.0);
    let entries = entries.iter().filter(|(lanelet, _)| here.binary_search(lanelet).is_ok());
    let along = entries.filter_map(|(lanelet, entry)| {
        let foot = road.lanelets()[*lanelet].center.project(other.pose.position).s;
        let leads = Point::from_angle(road.heading_at(*lanelet, foot)).dot(axis) > LEADER_HEADING_COSINE;
        leads.then_some(entry - foot)
    });
    along.reduce(f64::min)
}

/// Its speed now, and in the mean over each of its predicted modes [m/s].
fn speeds(other: &Other, request: &PlanRequest) -> impl Iterator<Item = f64> {
    let predictions = request.predictions;
    let (row, now) = (other.row, other.pose.position);
    let mean = move |mode: usize| {
        if predictions.probability[row * predictions.n_modes + mode] < PROBABILITY_MIN {
            return None;
        }
        let first = predictions.offset(row, mode);
        let last = (0..predictions.n_steps).rev().find(|step| predictions.valid[first + step])?;
        let place = Point::new(predictions.x[first + last], predictions.y[first + last]);
        let steps = predictions.time_step + last as i64 + 1 - request.time_step;
        (steps > 0).then(|| now.distance(place) / (steps as f64 * request.dt))
    };
    std::iter::once(other.velocity.abs()).chain((0..predictions.n_modes).filter_map(mean))
}
