//! Whose fault a contact is: which of both entered the other one's way, and how much room that left to react. Definitions:
//! docs/reference/scoring.md.

use std::f64::consts::{FRAC_PI_2, PI};

use super::footing::{is_against_the_lane, is_along_a_lane, is_within_another_lane, is_within_one_lane, lanes_at};
use super::traffic::Traffic;
use crate::collision::{first_contact, pose_between};
use crate::conduct::REST_SPEED;
use crate::error::{Error, Result};
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose, wrap_angle};
use crate::road::RoadNetwork;

/// Ways are wider than footprints by this on each side [m].
const WAY_MARGIN: f64 = 0.1;
/// ... and longer by this in front and behind [m]: a contact is found a little before bodies share a point.
const CONTACT_MARGIN: f64 = 1e-3;
/// Beyond this difference of headings traffic is oncoming.
pub(super) const ONCOMING_ANGLE: f64 = 0.75 * PI;
/// Up to this difference two drive side by side.
pub(super) const ALONGSIDE_ANGLE: f64 = 0.25 * PI;
/// Of two vehicles that meet where lanelets cross, the turning one is the vehicle that turned more within this time
/// before [s].
const TURN_TIME: f64 = 3.0;
/// Touching within this [m] is touching with the front edge.
const EDGE_TOLERANCE: f64 = 2e-3;

/// Time [s] and deceleration [m/s²] in which a driver reacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reaction {
    /// Until the brakes act.
    pub delay: f64,
    /// From then on.
    pub deceleration: f64,
}

impl Reaction {
    /// Distance in which a driver takes back a difference of speeds [m].
    pub fn room(&self, difference: f64) -> f64 {
        difference * self.delay + difference * difference / (2.0 * self.deceleration)
    }
}

/// Reactions expected of the judged agent and of others.
#[derive(Debug, Clone, PartialEq)]
pub struct BlameRequest {
    /// Agent and partner, as ids, the time step of the first states after the contact, and whether the partner drives
    /// on lanes, so that it can be oncoming traffic.
    pub contacts: Vec<(i64, i64, i64, bool)>,
    /// Asked of the agent.
    pub agent: Reaction,
    /// Asked of others.
    pub others: Reaction,
    /// Lanelets that cross others, by index.
    pub crossing: Vec<bool>,
}

/// Why a contact is the agent's fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// It is not.
    None,
    /// It entered the way of the other one with too little room left.
    CutOff,
    /// It had enough room to brake before the other.
    RanInto,
    /// It met oncoming traffic outside the lanes that lead its way.
    WrongSide,
    /// It reversed, and its rear touched.
    Reversed,
}

impl FaultKind {
    /// Names used outside.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::CutOff => "cut_off",
            Self::RanInto => "ran_into",
            Self::WrongSide => "wrong_side",
            Self::Reversed => "reversed",
        }
    }
}

/// Collision types of nuPlan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CollisionType {
    /// The agent stands.
    StoppedAgent,
    /// The other one stands.
    StoppedOther,
    /// The other one is behind.
    Rear,
    /// The front edge of the agent touches.
    Front,
    /// Anything else.
    Lateral,
}

impl CollisionType {
    /// Names used outside.
    pub fn name(self) -> &'static str {
        match self {
            Self::StoppedAgent => "stopped_agent",
            Self::StoppedOther => "stopped_other",
            Self::Rear => "rear",
            Self::Front => "front",
            Self::Lateral => "lateral",
        }
    }
}

/// One contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Why it is the agent's fault.
    pub kind: FaultKind,
    /// Distance left at the step that decided [m]; NaN if none was measured.
    pub gap: f64,
    /// Distance needed there [m].
    pub needed: f64,
    /// Time step that decided; -1 if none was measured.
    pub decided_at: i64,
    /// The contact itself, as a time step with a fraction.
    pub instant: f64,
    /// Angle between the headings, without sign [rad].
    pub angle: f64,
    /// Side of the agent: 0 front, 1 left, 2 right, 3 rear.
    pub side: usize,
    /// nuPlan's class.
    pub collision_type: CollisionType,
    /// nuPlan's verdict.
    pub fault_nuplan: bool,
    /// The contact happened where lanelets cross.
    pub is_crossing: bool,
}

/// Verdicts on contacts, in the order given.
///
/// # Errors
/// `InvalidInput` or `UnknownId` naming the contact that cannot be judged.
pub fn blame(traffic: &Traffic, request: &BlameRequest) -> Result<Vec<Verdict>> {
    let one = |(agent, other, time_step, drives): &(i64, i64, i64, bool)| {
        Ok(judged(&Pair::new(traffic, (*agent, *other, *time_step))?, *drives, request))
    };
    request.contacts.iter().map(one).collect()
}

/// One of both: its footprints at the common steps and at the contact, which comes last.
pub(super) struct Track<'a> {
    pub(super) shape: &'a Shape,
    wide: Shape,
    pub(super) poses: Vec<Pose>,
    pub(super) speeds: Vec<f64>,
}

impl Track<'_> {
    pub(super) fn contact(&self) -> Pose {
        self.poses[self.poses.len() - 1]
    }

    pub(super) fn speed(&self) -> f64 {
        self.speeds[self.speeds.len() - 1]
    }

    /// It reverses at the contact.
    fn reverses(&self) -> bool {
        self.speed() < -REST_SPEED
    }

    /// First step of the unbroken stretch up to the contact in which it reverses.
    fn reverses_since(&self) -> usize {
        self.speeds.len() - self.speeds.iter().rev().take_while(|speed| **speed < -REST_SPEED).count()
    }

    /// Change of the heading over the last steps, without sign [rad].
    fn turned(&self, steps: usize) -> f64 {
        let before = self.poses[(self.poses.len() - 1).saturating_sub(steps)];
        wrap_angle(self.contact().orientation - before.orientation).abs()
    }

    /// The other one's footprint at a step meets the way from that step on.
    fn way_meets(&self, other: &Self, step: usize) -> bool {
        self.poses[step..].iter().any(|pose| self.wide.overlaps(*pose, other.shape, other.poses[step]))
    }

    /// Distance that it can still drive along its own track from a step until it would touch the other's footprint
    /// there [m].
    fn gap(&self, other: &Self, step: usize) -> f64 {
        let mut driven = 0.0;
        for pair in self.poses[step..].windows(2) {
            let length = pair[0].position.distance(pair[1].position);
            let still = other.poses[step];
            if let Some(fraction) = first_contact(&self.wide, pair[0], pair[1], other.shape, still, still) {
                return driven + fraction * length;
            }
            driven += length;
        }
        driven
    }
}

/// The two of a contact.
pub(super) struct Pair<'a> {
    traffic: &'a Traffic,
    pub(super) agent: Track<'a>,
    pub(super) other: Track<'a>,
    /// Time step of the first pose.
    pub(super) first: i64,
    pub(super) instant: f64,
}

/// When one entered the other's way, and what that left.
struct Entry {
    /// Position in the tracks.
    step: usize,
    gap: f64,
    needed: f64,
}

impl<'a> Pair<'a> {
    /// The road that both drive on.
    pub(super) fn road(&self) -> &'a RoadNetwork {
        &self.traffic.road
    }

    pub(super) fn new(traffic: &'a Traffic, (agent, other, time_step): (i64, i64, i64)) -> Result<Self> {
        let states = &traffic.states;
        let row = |id: i64| states.row(id).ok_or(Error::UnknownId { what: "participant", id });
        let rows = [row(agent)?, row(other)?];
        let column = usize::try_from(time_step.wrapping_sub(states.first_time_step))
            .ok()
            .filter(|column| *column > 0 && *column < states.n_steps)
            .ok_or_else(|| Error::invalid(format!("a contact at time step {time_step} is outside the recording")))?;
        let common = |column: usize| rows.iter().all(|row| traffic.is_there(*row, column));
        if !common(column) || !common(column - 1) {
            return Err(Error::invalid(format!(
                "participants {agent} and {other} are not both there around the contact at time step {time_step}"
            )));
        }
        let first = (0..column).rev().take_while(|column| common(*column)).last().unwrap_or(column - 1);
        let [a, b] = rows.map(|row| (traffic.pose(row, column - 1), traffic.pose(row, column)));
        let shapes = rows.map(|row| &traffic.shape[row]);
        let fraction = first_contact(shapes[0], a.0, a.1, shapes[1], b.0, b.1).unwrap_or(1.0);
        let track = |row: usize| {
            let shape = &traffic.shape[row];
            let (length, width) = shape.extent();
            let around = shape.bounding_box();
            let center = around.min.lerp(around.max, 0.5);
            let speed = |column: usize| states.velocity[traffic.index(row, column)];
            let (from, to) = (traffic.pose(row, column - 1), traffic.pose(row, column));
            let mut poses: Vec<Pose> = (first..column).map(|column| traffic.pose(row, column)).collect();
            let mut speeds: Vec<f64> = (first..column).map(speed).collect();
            poses.push(pose_between(from, to, fraction));
            speeds.push(speed(column - 1) + fraction * (speed(column) - speed(column - 1)));
            let wide = Shape::rectangle_at(length + 2.0 * CONTACT_MARGIN, width + 2.0 * WAY_MARGIN, center, 0.0);
            Track { shape, wide, poses, speeds }
        };
        Ok(Self {
            traffic,
            agent: track(rows[0]),
            other: track(rows[1]),
            first: states.first_time_step + first as i64,
            instant: (time_step - 1) as f64 + fraction,
        })
    }

    /// First step of the unbroken stretch up to the contact in which `intruder` is in the way of `owner`, and what that
    /// left; the last position is the contact itself.
    fn entry(intruder: &Track<'_>, owner: &Track<'_>, reaction: Reaction) -> Entry {
        let contact = owner.poses.len() - 1;
        let step = (0..contact).rev().take_while(|step| owner.way_meets(intruder, *step)).last().unwrap_or(contact);
        // What reverses along the owner's way comes into it when it begins to.
        let turn = wrap_angle(intruder.contact().orientation - owner.contact().orientation);
        let comes_back = intruder.reverses() && turn.abs() < ALONGSIDE_ANGLE;
        let step = if comes_back { intruder.reverses_since() } else { step };
        let speed = owner.speeds[step];
        let along = Point::from_angle(owner.poses[step].orientation) * if speed < 0.0 { -1.0 } else { 1.0 };
        let velocity = Point::from_angle(intruder.poses[step].orientation) * intruder.speeds[step];
        let difference = (speed.abs() - velocity.dot(along).max(0.0)).max(0.0);
        Entry { step, gap: owner.gap(intruder, step), needed: reaction.room(difference) }
    }
}

fn judged(pair: &Pair<'_>, other_drives: bool, request: &BlameRequest) -> Verdict {
    let (agent, other) = (&pair.agent, &pair.other);
    let (here, there) = (agent.contact(), other.contact());
    let road = &pair.traffic.road;
    let angle = wrap_angle(there.orientation - here.orientation).abs();
    let side = side(agent, other);
    let is_one_lane = is_within_one_lane(road, agent.shape, here);
    let crosses = |lanelet: &usize| request.crossing.get(*lanelet).copied().unwrap_or(false);
    let is_crossing = road.lanelets_at(here.position).iter().any(crosses);
    let collision_type = collision_type(agent, other);
    let fault_nuplan = match collision_type {
        CollisionType::StoppedOther | CollisionType::Front => true,
        CollisionType::Lateral => !is_one_lane,
        CollisionType::StoppedAgent | CollisionType::Rear => false,
    };
    let verdict = |kind: FaultKind, entry: Option<&Entry>| Verdict {
        kind,
        gap: entry.map_or(f64::NAN, |entry| entry.gap),
        needed: entry.map_or(f64::NAN, |entry| entry.needed),
        decided_at: entry.map_or(-1, |entry| pair.first + entry.step as i64),
        instant: pair.instant,
        angle,
        side,
        collision_type,
        fault_nuplan,
        is_crossing,
    };
    // A vehicle that reverses answers for what its rear touches, however late the other one came.
    if agent.reverses() && side == 3 {
        return verdict(FaultKind::Reversed, None);
    }
    if angle > ONCOMING_ANGLE && other_drives && other.speed() > REST_SPEED {
        if is_against_the_lane(road, agent.shape, here) {
            return verdict(FaultKind::WrongSide, None);
        }
        // Where lanelets cross, a turn may cross an oncoming way although both are on lanelets that lead their way:
        // then the turning vehicle is judged.
        let steps = (TURN_TIME / pair.traffic.dt).round() as usize;
        if !is_crossing || agent.turned(steps) <= other.turned(steps) {
            return verdict(FaultKind::None, None);
        }
    }
    let into_theirs = Pair::entry(agent, other, request.others);
    let into_ours = Pair::entry(other, agent, request.agent);
    let entered = into_theirs.step > 0;
    let is_flank = side == 1 || side == 2;
    if entered && is_flank && angle < ALONGSIDE_ANGLE && !is_one_lane {
        return verdict(FaultKind::CutOff, Some(&into_theirs));
    }
    // One that leaves its lane beside an agent that keeps its own is not cut off, however much faster it is.
    if other_drives
        && other.speed().abs() > REST_SPEED
        && into_ours.step >= into_theirs.step
        && !is_within_one_lane(road, other.shape, there)
        && keeps_lane_beside(pair, into_theirs.step)
    {
        return verdict(FaultKind::None, Some(&into_ours));
    }
    // A vehicle that drives across a lane without a lane of its own has no way that the lane's traffic could enter, nor has
    // one that reverses.
    let owns_a_way = !other_drives
        || other.speed().abs() <= REST_SPEED
        || is_along_a_lane(road, there)
        || !keeps_its_lane(pair, into_theirs.step);
    let cuts_off = entered && owns_a_way && !other.reverses() && into_theirs.gap < into_theirs.needed;
    // The other one came first, and so late that nothing could be done.
    if into_ours.step > 0 && into_ours.step < into_theirs.step && into_ours.gap < into_ours.needed {
        return verdict(FaultKind::None, Some(&into_ours));
    }
    if cuts_off && into_ours.step >= into_theirs.step {
        return verdict(FaultKind::CutOff, Some(&into_theirs));
    }
    let is_front = side == 0;
    // One that stands is run into with whatever side touches it.
    if (is_front || other.speed().abs() <= REST_SPEED)
        && agent.speed() > REST_SPEED
        && into_ours.gap >= into_ours.needed
    {
        return verdict(FaultKind::RanInto, Some(&into_ours));
    }
    if cuts_off {
        return verdict(FaultKind::CutOff, Some(&into_theirs));
    }
    verdict(FaultKind::None, if is_front { Some(&into_ours) } else { entered.then_some(&into_theirs) })
}

/// From a step to the contact both head the same way, and the agent is within a lane that is not the other one's.
fn keeps_lane_beside(pair: &Pair<'_>, step: usize) -> bool {
    let (agent, road) = (&pair.agent, &pair.traffic.road);
    let theirs = lanes_at(road, pair.other.poses[step].position);
    agent.poses[step..].iter().zip(&pair.other.poses[step..]).all(|(here, there)| {
        wrap_angle(there.orientation - here.orientation).abs() < ALONGSIDE_ANGLE
            && is_within_another_lane(road, agent.shape, *here, &theirs)
    })
}

/// From a step to the contact the agent is within a lane and drives along it.
fn keeps_its_lane(pair: &Pair<'_>, step: usize) -> bool {
    let (agent, road) = (&pair.agent, &pair.traffic.road);
    agent.poses[step..].iter().all(|pose| is_along_a_lane(road, *pose) && is_within_one_lane(road, agent.shape, *pose))
}

/// Side of the agent that touches.
pub(super) fn side(agent: &Track<'_>, other: &Track<'_>) -> usize {
    let axis = touching_direction(agent, other);
    if axis.x.abs() >= axis.y.abs() {
        if axis.x > 0.0 { 0 } else { 3 }
    } else if axis.y > 0.0 {
        1
    } else {
        2
    }
}

/// Direction from the agent to what it touches, in its frame: that in which the boxes around both are farthest apart.
fn touching_direction(agent: &Track<'_>, other: &Track<'_>) -> Point {
    let (a, b) = (agent.shape.oriented_box(agent.contact()), other.shape.oriented_box(other.contact()));
    let offset = b.center - a.center;
    let (mut best, mut found) = (f64::NEG_INFINITY, offset);
    for axis in [a.axis, a.axis.left(), b.axis, b.axis.left()] {
        let reach = |body: &crate::geometry::shape::OrientedBox| {
            body.half_length * axis.dot(body.axis).abs() + body.half_width * axis.dot(body.axis.left()).abs()
        };
        let apart = offset.dot(axis).abs() - reach(&a) - reach(&b);
        if apart > best + 1e-9 {
            (best, found) = (apart, if offset.dot(axis) < 0.0 { -axis } else { axis });
        }
    }
    Point::new(found.dot(a.axis), found.dot(a.axis.left()))
}

fn collision_type(agent: &Track<'_>, other: &Track<'_>) -> CollisionType {
    let (here, there) = (agent.contact(), other.contact());
    if agent.speed().abs() <= REST_SPEED {
        return CollisionType::StoppedAgent;
    }
    if other.speed().abs() <= REST_SPEED {
        return CollisionType::StoppedOther;
    }
    let away = there.position - here.position;
    let heading = Point::from_angle(here.orientation);
    if heading.cross(away).atan2(heading.dot(away)).abs() > FRAC_PI_2 + PI / 3.0 {
        return CollisionType::Rear;
    }
    let body = agent.shape.oriented_box(here);
    let edge = Shape::rectangle(EDGE_TOLERANCE, 2.0 * body.half_width);
    let front = Pose { position: body.center + body.axis * body.half_length, orientation: here.orientation };
    if edge.distance(front, other.shape, there) <= EDGE_TOLERANCE {
        CollisionType::Front
    } else {
        CollisionType::Lateral
    }
}

#[cfg(test)]
mod tests;
