//! Agents that enter a world in which others have not driven as recorded: they wait for room, or in a queue for a gap.

use std::sync::Arc;

use super::{Agent, Drive, World};
use crate::conduct::FIRM_DECELERATION;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose, wrap_angle};
use crate::recording::OutcomeKind;
use crate::trajectory::State;

/// A vehicle ahead leads if it is at most this far beside the way of the agent, of the sum of both widths, ...
const LEADER_WIDTHS: f64 = 0.4;
/// ... heads elsewhere by at most this [rad] ...
const LEADER_ANGLE: f64 = 0.6;
/// ... and is nearer than this [m].
const LEADER_DISTANCE: f64 = 100.0;
/// Who enters keeps this far from others, ahead and behind, and at its sides [m], ...
const ROOM: (f64, f64) = (1.0, 0.3);
/// ... and enters beside nobody whom it would touch within this time [s], looked at so many times, if both went on along
/// the lane at their speed; ...
const GOING_ON: f64 = 1.0;
const LOOKS: u32 = 10;
/// ... who is farther beside the way [m] goes straight on.
const ALONG: f64 = 8.0;
/// From a queue an agent enters this far [s] ...
const HEADWAY: f64 = 1.0;
/// ... and so much besides [m] behind the vehicle ahead, with the way that both need to brake firmly to a stop; ...
const GAP: f64 = 2.0;
/// ... looks so far ahead [m], more than anybody needs for that; ...
const SIGHT: f64 = 300.0;
/// ... and a little more along the way, which may bend [m]; ...
const SIGHT_MARGIN: f64 = 10.0;
/// ... counts those in its lane that come nearer than this to its sides [m]; ...
const BESIDE: f64 = 0.3;
/// ... and enters no slower than this [m/s] and than this share of the speed of the vehicle ahead, unless it wants to be
/// slower: whoever enters more slowly slows down the whole queue.
const ENTRY_VELOCITY: f64 = 1.0;
const LEADER_SHARE: f64 = 0.9;

/// Where agents wait for a gap before they enter, one after the other in the order of their time and id. Each enters at
/// the largest speed up to that of its initial state at which neither it nor the vehicle behind has to brake firmly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Queue {
    /// Number of the queue; at each time step at most one of its agents enters.
    pub lane: i64,
    /// Last time step at which it may enter.
    pub until: i64,
}

impl World {
    /// Agents that would enter at this time step, but find no room, enter one time step later, and so does the time at
    /// which they are to be somewhere; or not at all once they have waited for too long. Those whose recording was
    /// replayed until now have their room, and whoever enters takes it from those that come after.
    pub(super) fn let_wait(&mut self, time_step: i64) {
        let most = self.settings.step.entry_wait;
        if most <= 0.0 || time_step == self.first_time_step {
            return;
        }
        for index in 0..self.drives.len() {
            let drive = &self.drives[index];
            let enters = drive.agent.start_time_step == time_step
                && drive.outcome.kind == OutcomeKind::Running
                && drive.agent.queue.is_none();
            let was_there = drive.replayed.is_some() && self.states[drive.row].is_some();
            if !enters {
                continue;
            }
            if was_there || self.has_room(index) {
                let drive = &self.drives[index];
                self.states[drive.row] = Some(drive.agent.initial_state);
                continue;
            }
            let waits = (drive.waited + 1) as f64 * self.scenario.dt <= most;
            let drive = &mut self.drives[index];
            if waits {
                drive.waited += 1;
                let agent = Arc::make_mut(&mut drive.agent);
                agent.start_time_step += 1;
                // An agent without a place to be at is done when the recording is over.
                for goal in agent.goal.states.iter_mut().filter(|goal| !goal.areas.is_empty()) {
                    goal.time_step = (goal.time_step.0 + 1, goal.time_step.1 + 1);
                }
            } else {
                drive.outcome.kind = OutcomeKind::TimeLimit;
                drive.outcome.time_step = time_step;
                drive.outcome.message = format!("found no room to enter within {most} s");
            }
        }
    }

    /// Lets agents in at the heads of queues that find a gap. All others wait for one more time step, and so does the time
    /// of their goals; once it is too late they do not enter at all.
    pub(super) fn enter_from_queues(&mut self, time_step: i64, entered: &mut Vec<usize>) {
        let mut blocked: Vec<i64> = Vec::new();
        for index in 0..self.drives.len() {
            let drive = &self.drives[index];
            let Some(queue) = drive.agent.queue else { continue };
            if drive.agent.start_time_step != time_step || drive.outcome.kind != OutcomeKind::Running {
                continue;
            }
            let velocity = if blocked.contains(&queue.lane) { None } else { self.entry_velocity(index) };
            blocked.push(queue.lane);
            let drive = &mut self.drives[index];
            if let Some(velocity) = velocity {
                let agent = Arc::make_mut(&mut drive.agent);
                agent.initial_state.velocity = velocity;
                let center = drive.s + agent.vehicle.rear_axle_to_center;
                agent.initial_state.yaw_rate = velocity * agent.route.path.at(center).curvature;
                let state = agent.initial_state;
                drive.was_on_road = self.scenario.road.covers(&agent.shape, state.pose());
                self.states[drive.row] = Some(state);
                entered.push(drive.row);
            } else if time_step < queue.until {
                drive.waited += 1;
                let agent = Arc::make_mut(&mut drive.agent);
                agent.start_time_step += 1;
                for goal in &mut agent.goal.states {
                    goal.time_step = (goal.time_step.0 + 1, goal.time_step.1 + 1);
                }
            } else {
                let waited = drive.waited as f64 * self.scenario.dt;
                drive.outcome.kind = OutcomeKind::TimeLimit;
                drive.outcome.time_step = time_step;
                drive.outcome.message = format!("found no room to enter within {waited:.1} s");
            }
        }
    }

    /// The speed at which an agent at the head of a queue enters now [m/s]; `None` without a gap.
    fn entry_velocity(&self, index: usize) -> Option<f64> {
        let Drive { agent, row, s, .. } = &self.drives[index];
        let Agent { vehicle, route, .. } = &**agent;
        let own = agent.initial_state;
        let (pose, wish) = (own.pose(), own.velocity);
        let room = Shape::rectangle(vehicle.length + 2.0 * GAP, vehicle.width);
        let center = s + vehicle.rear_axle_to_center;
        let (mut least, mut most) = (0.0_f64, wish);
        let mut leader = (f64::INFINITY, ENTRY_VELOCITY);
        for (other, state) in self.states.iter().enumerate() {
            let Some(state) = state.filter(|_| other != *row) else { continue };
            let place = state.pose();
            let away = place.position.distance(pose.position);
            if away > SIGHT || self.participants.storeys.are_apart(pose, place) {
                continue;
            }
            let shape = &self.participants.shape[other];
            if room.overlaps(pose, shape, place) {
                return None;
            }
            let extent = shape.aabb(Pose::default());
            let (length, width) = (extent.max.x - extent.min.x, extent.max.y - extent.min.y);
            let (lengths, widths) = (vehicle.length + length, vehicle.width + width);
            if let Some(distance) = leading(&state, &own, widths, SIGHT) {
                let behind = state.velocity.max(0.0);
                least = least.max(leader_velocity(distance - 0.5 * lengths, behind)?);
            }
            let window = 1.5 * away + SIGHT_MARGIN;
            let Some((at, beside)) = route.path.project_near(place.position, center, window) else { continue };
            if at > center && beside.abs() < 0.5 * widths + BESIDE {
                let turn = place.orientation - route.path.at(at).theta;
                let ahead = (state.velocity * turn.cos()).max(0.0);
                most = most.min(follower_velocity(at - center - 0.5 * lengths, ahead));
                if at < leader.0 {
                    leader = (at, (LEADER_SHARE * ahead).max(ENTRY_VELOCITY));
                }
            }
        }
        (most >= least.max(wish.min(leader.1))).then_some(most)
    }

    /// The agent touches no participant in its first state or right afterwards, and can follow the vehicle ahead.
    fn has_room(&self, index: usize) -> bool {
        let Drive { agent, s, .. } = &self.drives[index];
        let own = agent.initial_state;
        let (path, center) = (&agent.route.path, s + agent.vehicle.rear_axle_to_center);
        let pose = own.pose();
        let half = 0.5 * agent.vehicle.length;
        let room = Shape::rectangle(agent.vehicle.length + 2.0 * ROOM.0, agent.vehicle.width + 2.0 * ROOM.1);
        self.states.iter().enumerate().filter(|(row, _)| *row != self.drives[index].row).all(|(row, state)| {
            let Some(other) = state else { return true };
            let (shape, place) = (&self.participants.shape[row], other.pose());
            if self.participants.storeys.are_apart(pose, place) {
                return true;
            }
            let extent = shape.aabb(Pose::default());
            let (length, width) = (extent.max.x - extent.min.x, extent.max.y - extent.min.y);
            let reach = (own.velocity.abs() + other.velocity.abs()) * GOING_ON;
            let may_meet = place.position.distance(pose.position) < reach + agent.vehicle.length + length + width;
            let meets = |look: u32| {
                let time = GOING_ON * f64::from(look) / f64::from(LOOKS);
                let [ours, theirs] = [&own, other].map(|state| going_on(path, center, state, time));
                agent.shape.overlaps(ours, shape, theirs)
            };
            if room.overlaps(pose, shape, place) || may_meet && (1..=LOOKS).any(meets) {
                return false;
            }
            let Some(distance) = leading(&own, other, agent.vehicle.width + width, LEADER_DISTANCE) else {
                return true;
            };
            let closing = own.velocity - other.velocity * (other.orientation - own.orientation).cos();
            let gap = distance - half - 0.5 * length;
            closing <= 0.0 || gap > 0.0 && closing * closing <= 2.0 * FIRM_DECELERATION * gap
        })
    }
}

/// Where a vehicle near an arc length of a path [m] is after a time [s] if it keeps its speed, and its place and heading
/// relative to the path, whichever way it drives along it; straight on if it crosses the path.
fn going_on(path: &ReferencePath, near: f64, state: &State, time: f64) -> Pose {
    let pose = state.pose();
    let way = state.velocity * time;
    let window = 1.5 * pose.position.distance(path.at(near).position) + SIGHT_MARGIN;
    if let Some((s, offset)) = path.project_near(pose.position, near, window).filter(|foot| foot.1.abs() < ALONG) {
        let turn = wrap_angle(pose.orientation - path.at(s).theta);
        let there = s + way * turn.cos() / (1.0 - offset * path.at(s).curvature).max(0.5);
        let is_along = turn.sin().abs() < LEADER_ANGLE.sin() && (0.0..=path.length()).contains(&there);
        if is_along {
            let at = path.at(there);
            let aside = offset + way * turn.sin();
            let position = at.position + Point::from_angle(at.theta).left() * aside;
            return Pose { position, orientation: at.theta + turn };
        }
    }
    Pose { position: pose.position + Point::from_angle(pose.orientation) * way, ..pose }
}

/// Largest speed [m/s] behind a vehicle with a speed [m/s] at a gap [m] that needs no firm braking after the headway.
fn follower_velocity(gap: f64, leader: f64) -> f64 {
    let even = gap - GAP;
    if even <= leader * HEADWAY {
        return even / HEADWAY;
    }
    // gap = GAP + v HEADWAY + (v² - leader²) / (2 b)
    let lag = FIRM_DECELERATION * HEADWAY;
    (lag * lag + leader * leader + 2.0 * FIRM_DECELERATION * even).sqrt() - lag
}

/// Least speed [m/s] before a vehicle with a speed [m/s] at a gap [m] behind which that needs no firm braking; `None`: at
/// none.
fn leader_velocity(gap: f64, follower: f64) -> Option<f64> {
    let spare = gap - GAP - follower * HEADWAY;
    (spare >= 0.0).then(|| (follower * follower - 2.0 * FIRM_DECELERATION * spare).max(0.0).sqrt())
}

/// How far a vehicle is ahead along the way of another one [m], if it leads and is nearer than `most` [m]; `widths` is the
/// sum of both [m].
fn leading(own: &State, other: &State, widths: f64, most: f64) -> Option<f64> {
    let (dx, dy) = (other.x - own.x, other.y - own.y);
    let (sin, cos) = own.orientation.sin_cos();
    let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
    let turn = wrap_angle(other.orientation - own.orientation);
    // On an arc the way bends aside by half the angle.
    let beside = (across - 0.5 * along * turn).abs();
    let leads = along > 0.0 && along < most && turn.abs() < LEADER_ANGLE && beside < LEADER_WIDTHS * widths;
    leads.then_some(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, orientation: f64) -> State {
        State { x, y, orientation, velocity: 10.0, ..State::default() }
    }

    #[test]
    fn a_vehicle_ahead_on_a_bend_leads_and_one_in_the_next_lane_does_not() {
        let angle: f64 = 40.0 / 200.0;
        let on_arc = at(200.0 * angle.sin(), 200.0 * (1.0 - angle.cos()), angle);
        assert!(leading(&at(0.0, 0.0, 0.0), &on_arc, 3.6, LEADER_DISTANCE).is_some());
        let beside = at((200.0 - 3.5) * angle.sin(), 200.0 - (200.0 - 3.5) * angle.cos(), angle);
        assert!(leading(&at(0.0, 0.0, 0.0), &beside, 3.6, LEADER_DISTANCE).is_none());
        assert!(leading(&at(0.0, 0.0, 0.0), &at(-10.0, 0.0, 0.0), 3.6, LEADER_DISTANCE).is_none());
    }

    #[test]
    fn on_a_bend_vehicles_go_on_along_it_either_way_and_straight_across_it() {
        let radius = 30.0;
        let on_bend = |angle: f64| Point::new(radius * angle.sin(), radius * (1.0 - angle.cos()));
        let points: Vec<Point> = (0..=30).map(|i| on_bend(0.05 * f64::from(i))).collect();
        let path = ReferencePath::through(&points).expect("an arc");
        let own = going_on(&path, 0.0, &at(0.0, 0.0, 0.0), 1.0);
        assert!(own.position.distance(on_bend(1.0 / 3.0)) < 0.05 && (own.orientation - 1.0 / 3.0).abs() < 0.02);
        // From the other end in the next lane, 3.5 m outside: it passes, and would not straight on.
        let begin = Point::new(0.0, radius) + Point::from_angle(0.6 - std::f64::consts::FRAC_PI_2) * 33.5;
        let oncoming = at(begin.x, begin.y, 0.6 + std::f64::consts::PI);
        let there = going_on(&path, 18.0, &oncoming, 1.0).position;
        assert!((there.distance(Point::new(0.0, radius)) - 33.5).abs() < 0.1, "{there:?}");
        assert!((there.distance(begin) - 10.0).abs() < 0.1);
        let across = at(5.0, 10.0, -std::f64::consts::FRAC_PI_2);
        let there = going_on(&path, 5.0, &across, 0.5).position;
        assert!(there.distance(Point::new(5.0, 5.0)) < 1e-9);
    }

    #[test]
    fn behind_a_vehicle_the_entry_speed_leaves_headway_gap_and_the_way_to_brake() {
        for (gap, leader) in [(12.0, 15.0), (30.0, 0.0), (60.0, 10.0), (200.0, 20.0)] {
            let v = follower_velocity(gap, leader);
            let needed = GAP + v * HEADWAY + (v * v - leader * leader).max(0.0) / (2.0 * FIRM_DECELERATION);
            assert!((needed - gap).abs() < 1e-9, "{v} m/s");
        }
        assert!(follower_velocity(1.0, 20.0) < 0.0);
    }

    #[test]
    fn before_a_vehicle_the_entry_speed_is_what_that_one_can_adapt_to() {
        // 20² - 2 · 4 · (52 - 2 - 20)
        assert!((leader_velocity(52.0, 20.0).expect("room") - 160_f64.sqrt()).abs() < 1e-9);
        assert_eq!(leader_velocity(80.0, 20.0), Some(0.0));
        assert_eq!(leader_velocity(21.0, 20.0), None);
    }
}
