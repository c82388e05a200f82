//! The input: road, recorded obstacles, planning problems, goals. Immutable once built.

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use crate::control::Control;
use crate::error::{Error, Result};
use crate::geometry::shape::{PlacedShape, Shape};
use crate::geometry::wrap_angle;
use crate::junctions::Junctions;
use crate::limits::NUMBER_MAX;
use crate::road::RoadNetwork;
use crate::trajectory::{State, States};
use crate::vehicle::ParticipantKind;

/// One alternative of a goal. Everything that is stated must hold at once.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalState {
    /// The centre must lie in one of these areas; empty: anywhere.
    pub areas: Arc<[PlacedShape]>,
    /// First and last time step, both included.
    pub time_step: (i64, i64),
    /// Speed interval [m/s], both ends included.
    pub velocity: Option<(f64, f64)>,
    /// Interval of headings [rad]: from the first counter-clockwise to the second, both included.
    pub orientation: Option<(f64, f64)>,
}

/// The goal of a planning problem: any one of its alternatives.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Goal {
    /// The alternatives.
    pub states: Vec<GoalState>,
    /// Speed that the agent wants on its way, however much time it has [m/s]; `None`: what the time demands.
    pub pace: Option<f64>,
}

impl GoalState {
    /// The position satisfies this alternative.
    pub fn contains(&self, state: &State) -> bool {
        self.areas.is_empty() || self.areas.iter().any(|area| area.contains(state.pose().position))
    }

    /// Everything but time is satisfied.
    pub fn is_met_at_any_time(&self, state: &State) -> bool {
        let velocity = self.velocity.is_none_or(|(low, high)| (low..=high).contains(&state.velocity));
        velocity
            && self.orientation.is_none_or(|interval| orientation_within(state.orientation, interval))
            && self.contains(state)
    }

    /// Everything is satisfied.
    pub fn is_met(&self, state: &State, time_step: i64) -> bool {
        (self.time_step.0..=self.time_step.1).contains(&time_step) && self.is_met_at_any_time(state)
    }
}

impl Goal {
    /// Some alternative is satisfied at a time step.
    pub fn is_met(&self, state: &State, time_step: i64) -> bool {
        self.states.iter().any(|alternative| alternative.is_met(state, time_step))
    }

    /// Some alternative is satisfied except for its time.
    pub fn is_met_at_any_time(&self, state: &State) -> bool {
        self.states.iter().any(|alternative| alternative.is_met_at_any_time(state))
    }

    /// First time step at which the goal can be reached; `None` without any alternative.
    pub fn earliest_time_step(&self) -> Option<i64> {
        self.states.iter().map(|state| state.time_step.0).min()
    }

    /// Last time step at which the goal can be reached in time; `None` without any alternative.
    pub fn latest_time_step(&self) -> Option<i64> {
        self.states.iter().map(|state| state.time_step.1).max()
    }
}

/// The heading lies in the interval [rad], wherever the interval was cut.
pub fn orientation_within(orientation: f64, (low, high): (f64, f64)) -> bool {
    /// More than the rounding of an angle [rad].
    const TOLERANCE: f64 = 1e-9;
    let half = 0.5 * (high - low);
    half >= std::f64::consts::PI || wrap_angle(orientation - (low + half)).abs() <= half + TOLERANCE
}

/// Recorded traffic: one row per obstacle, sorted by id. A static obstacle has one state that holds for ever.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Obstacles {
    /// Kind per obstacle.
    pub kind: Vec<ParticipantKind>,
    /// Footprint per obstacle, in its body frame.
    pub shape: Vec<Shape>,
    /// Never moves and never leaves.
    pub is_static: Vec<bool>,
    /// Recorded states; the ids are here. A static obstacle is valid at every step of the table.
    pub states: States,
}

/// Everything a CommonRoad file says about a drive, ready to be simulated.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Time between steps [s].
    pub dt: f64,
    /// The roads.
    pub road: Arc<RoadNetwork>,
    /// Recorded traffic.
    pub obstacles: Obstacles,
    /// Traffic lights, stop lines and priorities of its roads.
    pub control: Control,
    /// Pairs of ids, the smaller one first, whose recordings are in each other: their contacts are no collisions.
    pub overlaps: BTreeSet<(i64, i64)>,
    /// Per obstacle whether its acceleration and its yaw rate were derived from later positions; empty: none was.
    pub derived: Vec<[bool; 2]>,
    /// Once they were needed.
    junctions: OnceLock<Junctions>,
}

impl Scenario {
    /// Checks and keeps the parts; without traffic lights and stop lines.
    ///
    /// # Errors
    /// `InvalidInput` naming the field: dt not positive, tables of different lengths, ids not ascending, a
    /// number in a valid state that is none or beyond [`crate::limits`].
    pub fn new(dt: f64, road: Arc<RoadNetwork>, obstacles: Obstacles) -> Result<Self> {
        if !(1e-3..=10.0).contains(&dt) {
            return Err(Error::invalid(format!("the time step size must be between 0.001 and 10 seconds, not {dt}")));
        }
        let n = obstacles.states.ids.len();
        if obstacles.kind.len() != n || obstacles.shape.len() != n || obstacles.is_static.len() != n {
            return Err(Error::invalid(format!(
                "{n} obstacle ids, but kinds, shapes or static flags of another length"
            )));
        }
        obstacles.states.check("obstacle")?;
        for (id, shape) in obstacles.states.ids.iter().zip(&obstacles.shape) {
            shape.check_numbers().map_err(|error| Error::invalid(format!("obstacle {id}: {error}")))?;
        }
        for (row, id) in obstacles.states.ids.iter().enumerate() {
            for step in 0..obstacles.states.n_steps {
                let time_step = obstacles.states.first_time_step + step as i64;
                if obstacles.states.get(row, time_step).is_some_and(|state| !state.is_possible()) {
                    return Err(Error::invalid(format!(
                        "obstacle {id} has a state that is not a number at time step {time_step}, or beyond {NUMBER_MAX:e}"
                    )));
                }
            }
        }
        let (overlaps, derived) = (BTreeSet::new(), Vec::new());
        Ok(Self { dt, road, obstacles, control: Control::default(), overlaps, derived, junctions: OnceLock::new() })
    }

    /// State of an obstacle at a time step, NaN for an acceleration or yaw rate that was derived from later positions.
    pub fn stated(&self, row: usize, time_step: i64) -> Option<State> {
        let state = self.obstacles.states.get(row, time_step)?;
        let [acceleration, yaw_rate] = self.derived.get(row).copied().unwrap_or_default();
        let unless = |derived: bool, value: f64| if derived { f64::NAN } else { value };
        Some(State {
            acceleration: unless(acceleration, state.acceleration),
            yaw_rate: unless(yaw_rate, state.yaw_rate),
            ..state
        })
    }

    /// What the ways of its roads share; worked out at the first call.
    pub fn junctions(&self) -> &Junctions {
        self.junctions.get_or_init(|| Junctions::of(&self.road, &self.control))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::testing::straight_road;
    use std::f64::consts::PI;

    #[test]
    fn numbers_beyond_the_limits_are_refused_with_obstacle_and_time_step() {
        let scenario = |x: f64, first_time_step: i64| {
            let mut states = States::absent(vec![7], first_time_step, 2);
            states.set(0, 1, &State { x, ..State::default() });
            let (kind, shape) = (vec![ParticipantKind::Car], vec![Shape::rectangle(4.5, 1.8)]);
            Scenario::new(0.1, Arc::new(straight_road(1)), Obstacles { kind, shape, is_static: vec![false], states })
        };
        assert!(scenario(1e9, 0).is_ok());
        let refused = |x: f64, first: i64| scenario(x, first).expect_err("refused").to_string();
        assert_eq!(refused(1.1e9, 3), "obstacle 7 has a state that is not a number at time step 4, or beyond 1e9");
        assert!(refused(0.0, i64::MAX).starts_with("time step 9223372036854775807 is beyond"));
    }

    #[test]
    fn orientation_intervals_hold_across_the_cut_at_pi() {
        for (orientation, interval, expected) in [
            (0.1, (-0.2, 0.2), true),
            (0.3, (-0.2, 0.2), false),
            (-PI + 0.05, (PI - 0.1, PI + 0.1), true),
            (PI - 0.05, (-PI - 0.1, -PI + 0.1), true),
            (0.0, (PI - 0.1, PI + 0.1), false),
            (2.0, (-PI, PI), true),
            (1.2, (0.5, 1.5), true),
            (-1.2, (0.5, 1.5), false),
            // Both ends belong to it.
            (0.5, (0.5, 1.5), true),
            (1.5, (0.5, 1.5), true),
            (0.49, (0.5, 1.5), false),
            (1.51, (0.5, 1.5), false),
        ] {
            assert_eq!(orientation_within(orientation, interval), expected, "{orientation} in {interval:?}");
        }
    }
}
