//! Measures on hand-built roads, with numbers computed by hand (docs/reference/criticality.md, "Examples").

mod approach;
pub(super) mod conflicts;
mod encounters;
mod following;
mod invariance;
mod odd_input;
mod straight;

use std::sync::Arc;

use super::*;
use crate::geometry::Point;
use crate::geometry::shape::Shape;
use crate::road::testing::{open, straight, tapered_lane, with_successors};
use crate::trajectory::{State, States};

pub(super) const INF: f64 = f64::INFINITY;

pub(super) fn state(x: f64, y: f64, orientation: f64, velocity: f64) -> State {
    State { x, y, orientation, velocity, ..State::default() }
}

/// A participant with a state per time step.
#[derive(Clone)]
pub(super) struct Actor {
    pub id: i64,
    pub shape: Shape,
    pub is_static: bool,
    pub states: Vec<Option<State>>,
}

impl Actor {
    /// A car of 5 m by 2 m.
    pub(super) fn car(id: i64, states: impl IntoIterator<Item = State>) -> Self {
        let states = states.into_iter().map(Some).collect();
        Self { id, shape: Shape::rectangle(5.0, 2.0), is_static: false, states }
    }

    /// A car that goes straight on for `n` steps of 0.1 s with constant acceleration.
    pub(super) fn going(id: i64, start: State, n: usize) -> Self {
        let at = |k: usize| {
            let t = 0.1 * k as f64;
            let way = start.velocity * t + 0.5 * start.acceleration * t * t;
            let position = start.pose().world_from_body(Point::new(way, 0.0));
            let velocity = start.velocity + start.acceleration * t;
            State { x: position.x, y: position.y, velocity, ..start }
        };
        Self::car(id, (0..n).map(at))
    }

    pub(super) fn shaped(mut self, shape: Shape) -> Self {
        self.shape = shape;
        self
    }
}

pub(super) fn traffic(road: RoadNetwork, actors: &[Actor]) -> Traffic {
    try_traffic(road, actors).expect("a test's traffic")
}

pub(super) fn try_traffic(road: RoadNetwork, actors: &[Actor]) -> Result<Traffic> {
    let n = actors.iter().map(|actor| actor.states.len()).max().unwrap_or(0);
    let mut states = States::absent(actors.iter().map(|actor| actor.id).collect(), 0, n);
    for (row, actor) in actors.iter().enumerate() {
        for (column, state) in actor.states.iter().enumerate() {
            if let Some(state) = state {
                states.set(row, column, state);
            }
        }
    }
    let shapes = actors.iter().map(|actor| actor.shape.clone()).collect();
    Traffic::new(0.1, Arc::new(road), states, shapes, actors.iter().map(|actor| actor.is_static).collect())
}

pub(super) fn request(ids: &[i64]) -> Request {
    Request {
        ids: ids.to_vec(),
        deceleration: Vec::new(),
        settings: Settings::default(),
        conflict_areas: ConflictAreas::Stated(Vec::new()),
        contacts: Vec::new(),
        threads: 1,
    }
}

pub(super) fn judged(traffic: &Traffic, id: i64) -> Criticality {
    evaluate(traffic, &request(&[id])).expect("a test's request")
}

/// Value of the first judged participant at a column.
pub(super) fn at(found: &Criticality, measure: Measure, column: usize) -> f64 {
    found.series[measure as usize].value[column]
}

/// Its most critical value.
pub(super) fn extreme(found: &Criticality, measure: Measure) -> f64 {
    found.extremes[measure as usize][0].value
}

#[track_caller]
pub(super) fn near(found: f64, expected: f64, tolerance: f64) {
    let same = found == expected || (found.is_nan() && expected.is_nan()) || (found - expected).abs() <= tolerance;
    assert!(same, "{found} instead of {expected}");
}

/// Two roads of three lanelets each that cross at right angles in the origin, 4 m wide: ids 1, 2, 3 along x and
/// 11, 12, 13 along y, with their connectors.
pub(super) fn right_angles() -> (RoadNetwork, Vec<Connector>) {
    let lane = |id, from, to, next: &[i64]| with_successors(tapered_lane(id, &straight(from, to), 4.0, 4.0), next);
    let road = open(vec![
        lane(1, (-100.0, 0.0), (-10.0, 0.0), &[2]),
        lane(2, (-10.0, 0.0), (10.0, 0.0), &[3]),
        lane(3, (10.0, 0.0), (100.0, 0.0), &[]),
        lane(11, (0.0, -100.0), (0.0, -10.0), &[12]),
        lane(12, (0.0, -10.0), (0.0, 10.0), &[13]),
        lane(13, (0.0, 10.0), (0.0, 100.0), &[]),
    ]);
    let connector = |id, incoming| Connector { lanelet: road.index_of(id).expect("a lanelet"), incoming };
    let connectors = vec![connector(2, 0), connector(12, 1)];
    (road, connectors)
}

/// A car along x and one along y, both with 10 m/s, 1 m per step; the second one starts at this y.
pub(super) fn crossing_cars(y: f64, n: usize) -> [Actor; 2] {
    let first = (0..n).map(|k| state(-34.55 + k as f64, 0.0, 0.0, 10.0));
    let second = (0..n).map(|k| state(0.0, y + k as f64, std::f64::consts::FRAC_PI_2, 10.0));
    [Actor::car(1, first), Actor::car(2, second)]
}
