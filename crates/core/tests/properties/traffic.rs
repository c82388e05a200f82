//! Recorded traffic: obstacles that drive, jump, stand, come and go.

use std::f64::consts::PI;
use std::sync::Arc;

use interdrive_core::geometry::{Point, Pose};
use interdrive_core::road::RoadNetwork;
use interdrive_core::scenario::{Obstacles, Scenario};
use interdrive_core::trajectory::{State, States};
use interdrive_core::vehicle::ParticipantKind;

use crate::source::Source;
use crate::{roads, shapes};

pub fn kind(source: &mut Source) -> ParticipantKind {
    if source.chance(160) { ParticipantKind::Car } else { ParticipantKind::ALL[source.below(13)] }
}

pub fn state(source: &mut Source, pose: Pose) -> State {
    State {
        x: pose.position.x,
        y: pose.position.y,
        orientation: pose.orientation,
        velocity: source.finite(0.0, 20.0),
        acceleration: source.finite(-2.0, 2.0),
        yaw_rate: source.finite(-0.3, 0.3),
    }
}

/// Up to six obstacles over up to 30 time steps.
fn obstacles(source: &mut Source, road: &RoadNetwork, dt: f64) -> Obstacles {
    let (n, n_steps) = (source.below(7), source.below(31));
    let mut ids: Vec<i64> =
        (0..n).map(|i| if source.is_odd() { source.whole(-5, 20) } else { 100 + i as i64 }).collect();
    if !source.is_odd() {
        ids.sort_unstable();
        ids.dedup();
    }
    let mut states = States::absent(ids, source.whole(0, 10), n_steps);
    let n = states.ids.len();
    let is_static: Vec<bool> = (0..n).map(|_| source.chance(40)).collect();
    for (row, &is_static) in is_static.iter().enumerate() {
        let pose = roads::pose(source, road);
        let mut state = state(source, pose);
        let (first, last) = if source.chance(100) { (source.below(30), source.below(31)) } else { (0, n_steps) };
        for column in 0..n_steps {
            let is_there = is_static || (first..last).contains(&column) && !source.is_odd();
            if is_there {
                if source.is_odd() {
                    state.x += source.any(-30.0, 30.0);
                    state.velocity = source.any(-5.0, 30.0);
                    state.orientation = source.any(-PI, PI);
                }
                states.set(row, column, &state);
            }
            if !is_static {
                let moved = Point::from_angle(state.orientation) * (state.velocity * dt);
                (state.x, state.y) = (state.x + moved.x, state.y + moved.y);
                state.orientation += state.yaw_rate * dt;
            }
        }
    }
    Obstacles {
        kind: (0..n).map(|_| kind(source)).collect(),
        shape: (0..n).map(|_| shapes::shape(source)).collect(),
        is_static,
        states,
    }
}

/// A scenario, if the parts make one; otherwise the reason was text.
pub fn scenario(source: &mut Source) -> Option<Scenario> {
    let road = roads::network(source)?;
    let dt = if source.is_odd() { source.any(0.01, 1.0) } else { [0.1, 0.04, 0.2, 1.0][source.below(4)] };
    let obstacles = obstacles(source, &road, if dt.is_finite() { dt } else { 0.1 });
    match Scenario::new(dt, Arc::new(road), obstacles) {
        Ok(scenario) => Some(scenario),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            None
        }
    }
}
