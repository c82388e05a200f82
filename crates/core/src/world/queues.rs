//! Agents that wait in queues before the map for a gap in which no vehicle has to brake firmly, the entrant included.
//!
//! Vehicles count whatever lane they are on: those that are in the way of the entrant, or have it in theirs, now or within
//! some seconds, if all go on along their lanes at their speeds.

use std::sync::Arc;

use super::encounter::{LEADER_ANGLE, Moving, leading};
use super::{Agent, Drive, World};
use crate::conduct::FIRM_DECELERATION;
use crate::geometry::shape::Shape;
use crate::recording::OutcomeKind;

/// An agent enters this far [s] ...
const HEADWAY: f64 = 1.0;
/// ... and so much besides [m] behind the vehicle ahead, with the way that both need to brake firmly to a stop, ...
const GAP: f64 = 2.0;
/// ... looks so far ahead [m], more than any vehicle needs for that, ...
const SIGHT: f64 = 300.0;
/// ... has those in its way that come nearer than this to its sides [m], ...
const BESIDE: f64 = 0.4;
/// ... and enters no slower than this [m/s] and than this share of the speed of the vehicle ahead, unless it wants to be
/// slower: whoever enters more slowly slows down the whole queue.
const ENTRY_VELOCITY: f64 = 1.0;
const LEADER_SHARE: f64 = 0.9;
/// Ways that come together or cross count if vehicles meet there within this time [s], ...
const AHEAD: f64 = 3.0;
/// ... looked at so many times for who comes before whom, ...
const LOOKS: u32 = 6;
/// ... and so many times for who touches whom.
const FINE_LOOKS: u32 = 15;

/// Where agents wait for a gap before they enter, one after the other in the order of their time and id. Each enters at
/// the largest speed up to that of its initial state at which neither it nor the vehicle behind has to brake firmly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Queue {
    /// Number of the queue; at each time step at most one of its agents enters.
    pub lane: i64,
    /// Last time step at which it may enter.
    pub until: i64,
}

/// Speeds at which an agent may enter [m/s].
struct Speeds {
    least: f64,
    most: f64,
    /// How far the nearest vehicle ahead is [m], and the least speed behind it.
    leader: (f64, f64),
}

impl Speeds {
    /// Stays behind a vehicle that is in its way at a distance, with a gap [m] now, and is first seen after a time [s].
    fn stay_behind(&mut self, (distance, gap): (f64, f64), velocity: f64, time: f64) {
        self.most = self.most.min(follower_velocity(gap, velocity, HEADWAY + time));
        if distance < self.leader.0 {
            self.leader = (distance, (LEADER_SHARE * velocity).max(ENTRY_VELOCITY));
        }
    }

    /// Enters before a vehicle at a gap [m], from which it can brake to a stop: whoever appears may be noticed late. `turn`
    /// is how much the entrant heads elsewhere [rad]; if it crosses the way, it counts as standing.
    fn enter_before(&mut self, gap: f64, follower: f64, turn: f64) -> Option<()> {
        let is_far = gap >= GAP + follower * follower / (2.0 * FIRM_DECELERATION);
        let least = leader_velocity(gap, follower, 0.0).filter(|_| is_far)?;
        (turn.abs() < LEADER_ANGLE || least <= 0.0).then(|| self.least = self.least.max(least))
    }

    /// Comes before or behind a vehicle whose way joins its own, and which is so far along it after a time [s], with so
    /// much of it taken by both [m].
    fn merge(&mut self, (at, lengths): (f64, f64), velocity: f64, time: f64) {
        let before = leader_velocity(-at - 0.5 * lengths, velocity, time).filter(|least| *least <= self.most);
        match before {
            Some(least) => self.least = self.least.max(least),
            None => self.stay_behind((at - velocity * time, at - 0.5 * lengths), velocity, time),
        }
    }

    fn chosen(&self, wish: f64) -> Option<f64> {
        (self.most >= self.least.max(wish.min(self.leader.1))).then_some(self.most)
    }
}

impl World {
    /// Lets agents in at the heads of queues that find a gap. All others wait for one more time step, and so does the time
    /// of their goals; once it is too late they do not enter at all.
    pub(super) fn enter_from_queues(&mut self, time_step: i64, entered: &mut Vec<usize>) {
        let mut blocked: Vec<i64> = Vec::new();
        let mut drive_of = Vec::new();
        for index in 0..self.drives.len() {
            let drive = &self.drives[index];
            let Some(queue) = drive.agent.queue else { continue };
            if drive.agent.start_time_step != time_step || drive.outcome.kind != OutcomeKind::Running {
                continue;
            }
            if drive_of.is_empty() {
                drive_of = self.drives_by_row();
            }
            let is_first = !blocked.contains(&queue.lane);
            let velocity = is_first.then(|| self.entry_velocity(index, &drive_of)).flatten();
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

    /// Index of the agent that drives in each row.
    fn drives_by_row(&self) -> Vec<Option<usize>> {
        let mut found = vec![None; self.states.len()];
        for (index, drive) in self.drives.iter().enumerate() {
            found[drive.row] = Some(index);
        }
        found
    }

    /// The speed at which an agent at the head of a queue enters now [m/s]; `None` without a gap.
    fn entry_velocity(&self, index: usize, drive_of: &[Option<usize>]) -> Option<f64> {
        let Drive { agent, row: own_row, s, .. } = &self.drives[index];
        let Agent { vehicle, route, .. } = &**agent;
        let own = agent.initial_state;
        let (pose, wish) = (own.pose(), own.velocity);
        let room = Shape::rectangle(vehicle.length + 2.0 * GAP, vehicle.width);
        let center = s + vehicle.rear_axle_to_center;
        let entrant = Moving::along(&route.path, center, &own, &agent.shape);
        let mut speeds = Speeds { least: 0.0, most: wish, leader: (f64::INFINITY, ENTRY_VELOCITY) };
        let mut beside = Vec::new();
        for (row, state) in self.states.iter().enumerate() {
            let Some(state) = state.filter(|_| row != *own_row) else { continue };
            let place = state.pose();
            let away = place.position.distance(pose.position);
            if away > SIGHT || self.participants.storeys.are_apart(pose, place) {
                continue;
            }
            let shape = &self.participants.shape[row];
            if room.overlaps(pose, shape, place) {
                return None;
            }
            let drive = drive_of[row].map(|other| &self.drives[other]);
            let other = match drive {
                Some(Drive { agent, s, .. }) => {
                    Moving::along(&agent.route.path, s + agent.vehicle.rear_axle_to_center, &state, shape)
                }
                None => Moving::along(&route.path, center, &state, shape),
            };
            let follower = state.velocity.max(0.0);
            let lengths = entrant.size.0 + other.size.0;
            // Others from outside, or off their way, are expected to go on as they head.
            let behind = drive.and_then(|_| other.in_its_way(pose, entrant.size, BESIDE)).or_else(|| {
                let widths = entrant.size.1 + other.size.1;
                leading(&state, &own, widths, SIGHT).map(|distance| (distance, 0.0))
            });
            let behind = behind.filter(|(distance, _)| *distance > 0.0);
            if let Some((distance, turn)) = behind {
                speeds.enter_before(distance - 0.5 * lengths, follower, turn)?;
            }
            let ahead = entrant.in_its_way(place, other.size, BESIDE).filter(|(distance, _)| *distance > 0.0);
            if let Some((distance, turn)) = ahead {
                let velocity = (state.velocity * turn.cos()).max(0.0);
                speeds.stay_behind((distance, distance - 0.5 * lengths), velocity, 0.0);
            }
            if behind.is_none() && ahead.is_none() {
                beside.push((other, drive.is_some()));
            }
        }
        speeds.chosen(wish)?;
        beside.retain(|(other, has_way)| !meets(&entrant, other, *has_way, &mut speeds));
        let entrant = entrant.at_speed(speeds.chosen(wish)?);
        let is_free = !beside.iter().any(|(other, has_way)| {
            entrant.touches(other, AHEAD, FINE_LOOKS) || *has_way && appears_before(&entrant, other)
        });
        is_free.then_some(entrant.velocity)
    }
}

/// Whether the way of another vehicle joins that of the entrant within the time, and then at which speeds that may enter.
fn meets(entrant: &Moving<'_>, other: &Moving<'_>, has_way: bool, speeds: &mut Speeds) -> bool {
    let away = other.pose.position.distance(entrant.pose.position);
    let lengths = entrant.size.0 + other.size.0;
    let braking = HEADWAY * speeds.most + speeds.most * speeds.most / (2.0 * FIRM_DECELERATION);
    if !has_way || away > (speeds.most + other.velocity.abs()) * AHEAD + braking + GAP + lengths {
        return false;
    }
    (1..=LOOKS).any(|look| {
        let time = AHEAD * f64::from(look) / f64::from(LOOKS);
        let joined = entrant.in_its_way(other.after(time), other.size, BESIDE);
        let joined = joined.filter(|(_, turn)| turn.abs() < LEADER_ANGLE);
        if let Some((at, turn)) = joined {
            speeds.merge((at, lengths), (other.velocity * turn.cos()).max(0.0), time);
        }
        joined.is_some()
    })
}

/// Whether the entrant comes into the way of another vehicle so near before it that this one has to brake firmly.
fn appears_before(entrant: &Moving<'_>, other: &Moving<'_>) -> bool {
    let lengths = entrant.size.0 + other.size.0;
    let velocity = other.velocity.max(0.0);
    (1..=LOOKS).any(|look| {
        let time = AHEAD * f64::from(look) / f64::from(LOOKS);
        let place = other.in_its_way(entrant.after(time), entrant.size, BESIDE);
        place.filter(|(at, turn)| *at > velocity * time && turn.abs() < LEADER_ANGLE).is_some_and(|(at, turn)| {
            let least = leader_velocity(at - velocity * time - 0.5 * lengths, velocity, 0.0);
            least.is_none_or(|least| entrant.velocity * turn.cos() < least)
        })
    })
}

/// Largest speed [m/s] behind a vehicle with a speed [m/s] at a gap [m] that needs no firm braking after the headway [s].
fn follower_velocity(gap: f64, leader: f64, headway: f64) -> f64 {
    let even = gap - GAP;
    if even <= leader * headway {
        return even / headway;
    }
    // gap = GAP + v headway + (v² - leader²) / (2 b)
    let lag = FIRM_DECELERATION * headway;
    (lag * lag + leader * leader + 2.0 * FIRM_DECELERATION * even).sqrt() - lag
}

/// Least speed [m/s] before a vehicle with a speed [m/s] at a gap [m] behind which that needs no firm braking if it goes on
/// for a time [s] at first; `None`: at none.
fn leader_velocity(gap: f64, follower: f64, time: f64) -> Option<f64> {
    let missing = GAP + follower * HEADWAY - gap;
    if missing <= follower * time {
        // gap + v time = GAP + follower HEADWAY + (follower² - v²) / (2 b)
        let lag = FIRM_DECELERATION * time;
        let squared = lag * lag + follower * follower + 2.0 * FIRM_DECELERATION * missing;
        return Some((squared.max(0.0).sqrt() - lag).max(0.0));
    }
    (time > 0.0).then(|| missing / time)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behind_a_vehicle_the_entry_speed_leaves_headway_gap_and_the_way_to_brake() {
        for (gap, leader) in [(12.0, 15.0), (30.0, 0.0), (60.0, 10.0), (200.0, 20.0)] {
            let v = follower_velocity(gap, leader, HEADWAY);
            let needed = GAP + v * HEADWAY + (v * v - leader * leader).max(0.0) / (2.0 * FIRM_DECELERATION);
            assert!((needed - gap).abs() < 1e-9, "{v} m/s");
        }
        assert!(follower_velocity(1.0, 20.0, HEADWAY) < 0.0);
    }

    #[test]
    fn before_a_vehicle_the_entry_speed_is_what_that_one_can_adapt_to() {
        // 20² - 2 · 4 · (52 - 2 - 20)
        assert!((leader_velocity(52.0, 20.0, 0.0).expect("room") - 160_f64.sqrt()).abs() < 1e-9);
        assert_eq!(leader_velocity(80.0, 20.0, 0.0), Some(0.0));
        assert_eq!(leader_velocity(21.0, 20.0, 0.0), None);
    }

    #[test]
    fn before_a_vehicle_that_joins_later_the_speed_makes_the_gap_until_then() {
        for (gap, follower, time) in [(-5.0, 10.0, 3.0), (10.0, 12.0, 1.0), (-25.0, 8.0, 2.0)] {
            let v = leader_velocity(gap, follower, time).expect("a speed");
            let braking = (follower * follower - v * v).max(0.0) / (2.0 * FIRM_DECELERATION);
            assert!((gap + v * time - GAP - follower * HEADWAY - braking).abs() < 1e-9, "{v} m/s");
        }
        assert_eq!(leader_velocity(21.0, 20.0, 0.0), None);
    }
}
