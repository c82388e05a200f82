//! Obstructions that are passed, and the side on which there is room.

mod detour;

use std::cell::OnceCell;

use super::car_following::LEADER_HEADING_COSINE;
use super::conflicts::LINE_GAP;
use super::lane_change::required_deceleration;
use super::{Other, PlanRequest};
use crate::barrier::{Barrier, BarrierReason};
use crate::conduct::{FOLLOWER_COSINE, STATIONARY_SPEED};
use crate::geometry::Point;
use crate::vehicle::ParticipantKind;
pub(super) use detour::{Detour, Leader};

/// Clearances to a passed obstruction [m]: the first with enough room counts.
pub(super) const CLEARANCES: [f64; 2] = [0.3, 0.2];
/// An agent keeps this more, where there is room, for each m/s of its speed [s]: its steering lags, and people keep more,
/// too.
const CLEARANCE_TIME: f64 = 0.02;
/// Room needed before and behind the obstruction [m], examined at this step [m].
pub(super) const LEAD: f64 = 1.0;
pub(super) const ROOM_STEP: f64 = 2.0;
/// Time before the obstruction at which the agent moves to the side [s], but at least this distance [m].
const SWING_TIME: f64 = 3.0;
/// The same on lanelets of its own direction [s]: from there on it would brake for what stands.
const OWN_SWING_TIME: f64 = 6.0;
pub(super) const SWING_LENGTH: f64 = 10.0;
/// Vehicles that stand nearer to the path than this [m] and head along it wait in a queue.
pub(super) const QUEUE_OFFSET: f64 = 1.0;
/// Vehicles that stand so near before a stop line or behind another one [m] wait there.
const WAITING_REACH: f64 = 15.0;

/// An agent that has moved by this share of the offset is under way: vehicles behind it follow.
const UNDER_WAY: f64 = 0.5;
/// After this time its body is in the way of those behind [s].
const MOVING_TIME: f64 = 2.5;
/// Vehicles from behind are looked at up to this distance [m], on the path this far around where it is expected [m].
const FOLLOWER_REACH: f64 = 150.0;
const FOLLOWER_WINDOW: f64 = 12.0;
/// The room that they keep [m], the time after which they brake [s], as for changes of lane, and how hard [m/s²]: there is
/// time to let others pass first, some of whom replay a recording and do not react.
const FOLLOWER_GAP: f64 = 1.0;
const FOLLOWER_REACTION: f64 = 1.0;
const FOLLOWER_DECELERATION: f64 = 1.0;

/// Largest offset at which something is passed [m].
const OFFSET_MAX: f64 = 3.0;
/// What leaves a vehicle this much room beside its middle is not in the way [m].
const SIDE_ROOM: f64 = 0.4;
/// How far away leaders are looked for [m], and for how long at the present speed [s].
const LEADER_REACH: (f64, f64) = (40.0, 4.0);

/// Distance ahead of its front within which the agent looks for a place beside an obstruction [m].
pub(super) fn reach(velocity: f64) -> f64 {
    SWING_LENGTH.max(SWING_TIME * velocity)
}

/// Where the agent is on its path: arc length and offset of the rear axle [m], speed [m/s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) s: f64,
    pub(super) d: f64,
    pub(super) velocity: f64,
}

/// What stands on the way and can be passed.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Obstructions {
    /// Offsets at which it can be passed now [m].
    pub(super) beside: Vec<f64>,
    /// Where the agent waits until it may pass over the lane of the other direction.
    pub(super) wait: Option<Barrier>,
}

impl Obstructions {
    /// Ahead of an agent that brakes comfortably with a deceleration [m/s²] and keeps a gap to what stands [m].
    pub(super) fn ahead(request: &PlanRequest, place: &Place, (deceleration, gap): (f64, f64)) -> Self {
        let Place { s, velocity, .. } = *place;
        let front = s + request.vehicle.rear_axle_to_center + 0.5 * request.vehicle.length;
        let soon = front + reach(velocity);
        let near = front + SWING_LENGTH.max(OWN_SWING_TIME * velocity);
        let (mut found, mut leaders, mut blocks) = (Self::default(), Vec::new(), Vec::new());
        for other in request.others {
            let Some((standing, velocity)) = Standing::of(other, request, place, 0.0) else { continue };
            let passage = if velocity == 0.0 { standing.passage(other, request, OFFSET_MAX) } else { None };
            match passage {
                // Where it is near, contacts decide.
                Some(Passage::Here(offset))
                    if standing.rear < soon || standing.rear < near && has_gap(request, place, offset) =>
                {
                    found.beside.push(offset);
                }
                Some(Passage::Here(_)) => {}
                Some(Passage::Opposite(offset)) => blocks.push((standing.rear, standing.front, offset)),
                None => leaders.push(Leader { rear: standing.rear, velocity }),
            }
        }
        let Some(detour) = Detour::past(&mut blocks, request.vehicle.length) else { return found };
        // Where the agent has to stop there is no room to return, as behind a leader that stands; before it may enter a
        // narrow place it does not move over.
        let stops = request.barriers(request.rules.way, s);
        let counts = |one: &&Barrier| one.until.is_infinite() || one.s < detour.rear();
        leaders.extend(stops.iter().filter(counts).map(|one| Leader { rear: one.s, velocity: 0.0 }));
        match detour.wait(request, place, &leaders, (deceleration, gap)) {
            Some(leader) => {
                found.wait = Some(Barrier::lasting(leader.rear - gap + LINE_GAP, BarrierReason::Yield));
            }
            None if detour.rear() < soon => found.beside.push(detour.offset),
            None => {}
        }
        found
    }
}

/// Arc lengths between which things stand that an agent has to pass over the lane of the other direction, or is passing
/// now, with its rear axle at an arc length [m].
pub(crate) fn narrow_place(request: &PlanRequest, s: f64) -> Option<(f64, f64)> {
    let d = request.route.path.project_near(request.state.pose().position, s, SWING_LENGTH)?.1;
    let place = Place { s, d, velocity: request.state.velocity };
    let block = |other: &Other| {
        let (standing, velocity) = Standing::of(other, request, &place, request.vehicle.length + SWING_LENGTH)?;
        match standing.passage(other, request, OFFSET_MAX).filter(|_| velocity == 0.0)? {
            Passage::Opposite(offset) => Some((standing.rear, standing.front, offset)),
            Passage::Here(_) => None,
        }
    };
    let mut blocks: Vec<(f64, f64, f64)> = request.others.iter().filter_map(block).collect();
    Detour::past(&mut blocks, request.vehicle.length).map(|detour| detour.stretch())
}

/// An obstruction, along and across the path.
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
    /// Over the lane of the other direction, at an offset [m], while no vehicle is oncoming there.
    Opposite(f64),
}

impl Standing {
    /// A participant that stands or moves along the path ahead, or this far behind [m], at least partly in the way, and its
    /// speed [m/s], 0 if it stands. Structures of several parts are no leaders.
    fn of(other: &Other, request: &PlanRequest, place: &Place, behind: f64) -> Option<(Self, f64)> {
        if other.is_static && other.shape.parts().len() > 1 {
            return None;
        }
        let (path, vehicle) = (&request.route.path, request.vehicle);
        let body = other.shape.oriented_box(other.pose);
        let distance = body.center.distance(request.state.pose().position);
        let reach = LEADER_REACH.0 + LEADER_REACH.1 * place.velocity;
        if distance > reach + body.half_length + body.half_width {
            return None;
        }
        let (at, d) = path.project_near(body.center, place.s + 0.5 * distance, 0.5 * distance + 10.0 + behind)?;
        let tangent = path.at(at).tangent();
        let (cos, sin) = (tangent.dot(body.axis), tangent.cross(body.axis));
        let half_s = body.half_length * cos.abs() + body.half_width * sin.abs();
        let half_d = body.half_length * sin.abs() + body.half_width * cos.abs();
        let side = 0.5 * vehicle.width + SIDE_ROOM;
        let is_beside = d - half_d > place.d.max(0.0) + side || d + half_d < place.d.min(0.0) - side;
        let stands = other.is_static || other.velocity.abs() < STATIONARY_SPEED;
        if is_beside || at < place.s + vehicle.rear_axle_to_center - behind || !(stands || other.leads(cos)) {
            return None;
        }
        let velocity = if stands { 0.0 } else { other.velocity_along(cos) };
        Some((Self { rear: at - half_s, front: at + half_s, d, half_d, cos }, velocity))
    }

    /// Where the agent can pass it; not if it waits in a queue.
    pub(super) fn passage(&self, other: &Other, request: &PlanRequest, d_max: f64) -> Option<Passage> {
        let is_parked = is_parked(other);
        if !is_parked && self.cos > LEADER_HEADING_COSINE && self.d.abs() < QUEUE_OFFSET {
            return None;
        }
        if let Some(offset) = self.sides(request, d_max, |place, road| road.is_own(place)) {
            return Some(Passage::Here(offset));
        }
        let settings = request.rules.settings;
        let may_be_passed = !is_person(other) && (is_parked || self.stands_aside(request));
        if !(settings.enabled && settings.passing && may_be_passed) {
            return None;
        }
        let is_road = |place, road: &Section| road.is_own(place) || road.is_open(place);
        let found = self.sides(request, d_max, is_road);
        found.filter(|offset| is_parked || offset * self.d < 0.0).map(Passage::Opposite)
    }

    /// A vehicle at the side that waits neither before a line or a crosswalk nor behind others.
    fn stands_aside(&self, request: &PlanRequest) -> bool {
        let before = |s: f64| (self.rear..self.front + WAITING_REACH).contains(&s);
        let follows = |other: &Other| {
            let found = request.route.path.project_near(other.pose.position, self.front, WAITING_REACH);
            found.is_some_and(|(s, d)| s > self.front && before(s) && (d - self.d).abs() < QUEUE_OFFSET)
        };
        let way = request.rules.way;
        let mut places = way.lines().map(|(s, _)| s).chain(way.crosswalks().iter().map(|crosswalk| crosswalk.entry));
        self.d.abs() >= QUEUE_OFFSET
            && self.cos.abs() > LEADER_HEADING_COSINE
            && !places.any(before)
            && !request.others.iter().any(follows)
    }

    /// The nearest offset beside it whose ground is admitted.
    fn sides(&self, request: &PlanRequest, d_max: f64, admits: impl Fn(Point, &Section) -> bool) -> Option<f64> {
        let [wide, least] = CLEARANCES;
        let widest = wide + CLEARANCE_TIME * request.state.velocity.max(0.0);
        let near = if self.d > 0.0 { -1.0 } else { 1.0 };
        let beside = |side: f64, clearance: f64| {
            let half_gap = self.half_d + 0.5 * request.vehicle.width + clearance;
            let offset = self.d + side * half_gap;
            let offset = if side < 0.0 { offset.min(0.0) } else { offset.max(0.0) };
            (offset.abs() <= d_max && self.has_room(request, offset, &admits)).then_some(offset)
        };
        let on = |side: f64| beside(side, widest).or_else(|| beside(side, wide));
        on(near).or_else(|| on(-near)).or_else(|| beside(near, least)).or_else(|| beside(-near, least))
    }

    /// The ground is admitted on which the agent passes at an offset of its rear axle.
    fn has_room(&self, request: &PlanRequest, d: f64, admits: impl Fn(Point, &Section) -> bool) -> bool {
        let (path, vehicle) = (&request.route.path, request.vehicle);
        let length = self.front - self.rear + 2.0 * LEAD + vehicle.length;
        let n = (length / ROOM_STEP).ceil();
        let first = self.rear - LEAD - vehicle.length;
        (0..=n as usize).all(|i| {
            let at = path.at((first + length * i as f64 / n).max(0.0));
            let section = Section::new(request, at.tangent(), at.position);
            let left = section.tangent.left();
            [-0.5, 0.5].iter().all(|side| admits(at.position + left * (d + side * vehicle.width), &section))
        })
    }
}

/// No vehicle from behind will have to brake noticeably for an agent that moves over early to an offset [m].
fn has_gap(request: &PlanRequest, place: &Place, offset: f64) -> bool {
    let (path, vehicle) = (&request.route.path, request.vehicle);
    let is_under_way = (offset - place.d).abs() < (1.0 - UNDER_WAY) * offset.abs();
    let middle = place.s + vehicle.rear_axle_to_center;
    let side = 0.5 * vehicle.width + CLEARANCES[0];
    let is_held_up = |other: &Other| {
        let from = other.pose.position - request.state.pose().position;
        let axis = Point::from_angle(other.pose.orientation);
        let along = from.dot(Point::from_angle(request.state.orientation));
        if other.is_static || other.velocity < STATIONARY_SPEED || !(-FOLLOWER_REACH..vehicle.length).contains(&along) {
            return false;
        }
        let body = other.shape.oriented_box(other.pose);
        let Some((s, d)) = path.project_near(body.center, middle + along, FOLLOWER_WINDOW) else { return false };
        let is_in = |y: f64| (d - y).abs() < side + body.half_width;
        let is_follower = axis.dot(path.at(s).tangent()) > FOLLOWER_COSINE && is_in(offset) && d.abs() > QUEUE_OFFSET;
        let faster = other.velocity - place.velocity;
        let room = middle - s - 0.5 * vehicle.length - body.half_length - MOVING_TIME * faster.max(0.0);
        is_follower && required_deceleration(room - FOLLOWER_GAP, faster, FOLLOWER_REACTION) > FOLLOWER_DECELERATION
    };
    is_under_way || !request.others.iter().any(is_held_up)
}

/// It never moves, or is a parked vehicle.
pub(super) fn is_parked(other: &Other) -> bool {
    other.is_static || other.kind == ParticipantKind::ParkedVehicle
}

/// People on foot or on a bicycle need more room than the other lane leaves.
pub(super) fn is_person(other: &Other) -> bool {
    matches!(other.kind, ParticipantKind::Pedestrian | ParticipantKind::Bicycle)
}

/// The road across the path at a place.
pub(super) struct Section<'a> {
    request: &'a PlanRequest<'a>,
    tangent: Point,
    middle: Point,
    opposite: OnceCell<Vec<usize>>,
    beyond_lines: OnceCell<Vec<usize>>,
}

impl<'a> Section<'a> {
    pub(super) fn new(request: &'a PlanRequest<'a>, tangent: Point, middle: Point) -> Self {
        Self { request, tangent, middle, opposite: OnceCell::new(), beyond_lines: OnceCell::new() }
    }

    /// Cosine of a lanelet's direction to the path's, beside a place.
    fn cosine(&self, lanelet: usize, place: Point) -> f64 {
        let road = self.request.road;
        let foot = road.lanelets()[lanelet].center.project(place).s;
        Point::from_angle(road.heading_at(lanelet, foot)).dot(self.tangent)
    }

    /// A place lies on a lanelet of the agent's direction that is a lane for it.
    fn is_own(&self, place: Point) -> bool {
        let here = self.request.road.lanelets_at(place);
        let (road, route) = (self.request.road, self.request.route);
        let is_own =
            |lanelet: usize| route.may_use(road, lanelet) && self.cosine(lanelet, place) > LEADER_HEADING_COSINE;
        here.iter().any(|lanelet| is_own(*lanelet) && !self.beyond_lines().contains(lanelet))
    }

    /// A place lies on a lane of the other direction beside the agent's, with a line between them that may be crossed.
    fn is_open(&self, place: Point) -> bool {
        let here = self.request.road.lanelets_at(place);
        self.opposite().iter().any(|lanelet| here.contains(lanelet))
    }

    /// Lanes of the other direction beside the agent's that may be entered; worked out when they are first asked for.
    pub(super) fn opposite(&self) -> &[usize] {
        self.opposite.get_or_init(|| {
            let may_use = |lanelet| self.request.route.may_use(self.request.road, lanelet);
            let found = self.beside().filter(|(_, is_same, is_open)| !is_same && *is_open);
            found.map(|(lanelet, ..)| lanelet).filter(|lanelet| may_use(*lanelet)).collect()
        })
    }

    /// Lanes of the agent's direction beyond a line that must not be crossed.
    fn beyond_lines(&self) -> &[usize] {
        self.beyond_lines.get_or_init(|| {
            if !self.request.rules.settings.enabled {
                return Vec::new();
            }
            let found = self.beside().filter(|(_, is_same, is_open)| *is_same && !is_open);
            found.map(|(lanelet, ..)| lanelet).collect()
        })
    }

    /// Lanelets beside the agent's, whether they have its direction, and whether the line between may be crossed.
    fn beside(&self) -> impl Iterator<Item = (usize, bool, bool)> {
        let (road, closed) = (self.request.road, &self.request.rules.control.closed);
        let mut own = road.lanelets_at(self.middle);
        own.retain(|lanelet| self.cosine(*lanelet, self.middle) > LEADER_HEADING_COSINE);
        let beside = move |lanelet: usize| {
            let found = &road.lanelets()[lanelet];
            let sides = [found.adjacent_left, found.adjacent_right].into_iter().zip(closed);
            sides.filter_map(move |(beside, closed)| {
                beside.map(|(beside, is_same)| (beside, is_same, closed.binary_search(&lanelet).is_err()))
            })
        };
        own.into_iter().flat_map(beside)
    }
}
