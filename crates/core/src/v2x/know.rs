//! What an agent knows about others, and how.

use super::message::Object;
use crate::conduct::STANDSTILL_SPEED;
use crate::trajectory::State;

/// How an agent knows of a participant; the discriminant is the code that crosses the Python boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Via {
    /// Its own sensors.
    Sensors = 0,
    /// A message of the other, with its state or plan.
    Cam = 1,
    /// A message of a third agent that sees the other.
    Cpm = 2,
    /// Its own yielding: a bar across its path.
    Hold = 3,
}

impl Via {
    /// All; the position is the code.
    pub const ALL: [Self; 4] = [Self::Sensors, Self::Cam, Self::Cpm, Self::Hold];
}

/// A participant that an agent knows of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Its id.
    pub id: i64,
    /// How the agent knows.
    pub via: Via,
    /// Age of what it was told [s]: 0 for sensors.
    pub age: f64,
    /// Row in the table of expectations.
    pub row: usize,
    /// Row among the present participants; `None` if its sensors do not see it.
    pub seen: Option<usize>,
}

/// Below this rate [rad/s] a participant goes straight on.
const STRAIGHT_YAW_RATE: f64 = 1e-3;

/// Where a participant is some time after a state was told [s], at constant speed and yaw rate.
pub(super) fn moved(told: &Object, age: f64) -> State {
    let state = told.state;
    let (v, w) = (state.velocity, state.yaw_rate);
    if v.abs() < STANDSTILL_SPEED {
        return State { acceleration: 0.0, yaw_rate: 0.0, ..state };
    }
    let (sin, cos) = state.orientation.sin_cos();
    if w.abs() < STRAIGHT_YAW_RATE {
        return State { x: state.x + v * age * cos, y: state.y + v * age * sin, ..state };
    }
    let heading = state.orientation + w * age;
    let (sin_then, cos_then) = heading.sin_cos();
    State {
        x: state.x + v / w * (sin_then - sin),
        y: state.y - v / w * (cos_then - cos),
        orientation: heading,
        ..state
    }
}
