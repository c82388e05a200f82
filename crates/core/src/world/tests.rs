//! How drives end, on a straight road along x, with plans written by hand. Steps take 0.1 s.

mod contacts;
mod cooperation;
mod goals;
mod outside;
mod plans;
mod queues;

use super::*;
use crate::geometry::Pose;
use crate::geometry::shape::PlacedShape;
use crate::road::testing::{open, parallel_lanes};
use crate::route::{RouteSettings, find_route};
use crate::scenario::{GoalState, Obstacles};
use crate::trajectory::{PlanStatus, Plans, States};

/// Half the length of the agents [m].
const HALF: f64 = 2.25;

/// On the road along x.
fn at(x: f64, y: f64, velocity: f64) -> State {
    State { x, y, velocity, ..State::default() }
}

/// The stretch of the lane between two places, in an interval of time steps.
fn stretch(from: f64, to: f64, time_step: (i64, i64)) -> GoalState {
    let area = PlacedShape { shape: Shape::rectangle(to - from, 3.5), pose: Pose::new(0.5 * (from + to), 0.0, 0.0) };
    GoalState { areas: [area].into(), time_step, velocity: None, orientation: None }
}

/// Far away, in time.
fn far() -> GoalState {
    stretch(180.0, 190.0, (0, 1000))
}

/// An agent of 4.5 m by 2 m and what it wants; its route leads to the first goal.
fn agent(id: i64, initial_state: State, goals: Vec<GoalState>) -> Agent {
    let road = open(parallel_lanes(2, 200.0));
    // Also for agents that start beside the road.
    let start = Pose::new(initial_state.x, initial_state.y.clamp(-1.0, 4.5), 0.0);
    let route = find_route(&road, start, 10.0, &goals[0].areas, &RouteSettings::default()).expect("a straight road");
    let vehicle = Vehicle::for_footprint(ParticipantKind::Car, 2.0 * HALF, 2.0).expect("a car");
    Agent {
        id,
        kind: ParticipantKind::Car,
        shape: Shape::rectangle(2.0 * HALF, 2.0),
        vehicle,
        initial_state,
        start_time_step: 0,
        replays_before: false,
        queue: None,
        goal: Goal { states: goals, pace: None },
        route: Arc::new(route),
        planner: Planner::External,
        view: ViewLimits::default(),
        rules: RulesSettings::default(),
        v2x: None,
    }
}

/// A recorded participant: a square of 2 m by 2 m with a state per time step, or standing.
struct Recorded {
    id: i64,
    is_static: bool,
    states: Vec<Option<State>>,
}

impl Recorded {
    fn standing(id: i64, x: f64, y: f64) -> Self {
        Self { id, is_static: true, states: vec![Some(at(x, y, 0.0))] }
    }

    fn moving(id: i64, states: impl IntoIterator<Item = Option<State>>) -> Self {
        Self { id, is_static: false, states: states.into_iter().collect() }
    }
}

/// Two lanes of 3.5 m and 200 m, the right one at y = 0.
fn world_with(agents: Vec<Agent>, recorded: &[Recorded], settings: WorldSettings) -> World {
    let n = recorded.iter().map(|one| one.states.len()).max().unwrap_or(1);
    let mut states = States::absent(recorded.iter().map(|one| one.id).collect(), 0, n);
    for (row, one) in recorded.iter().enumerate() {
        for column in 0..n {
            let state = if one.is_static { one.states[0] } else { one.states.get(column).copied().flatten() };
            if let Some(state) = state {
                states.set(row, column, &state);
            }
        }
    }
    let obstacles = Obstacles {
        kind: vec![ParticipantKind::Car; recorded.len()],
        shape: vec![Shape::rectangle(2.0, 2.0); recorded.len()],
        is_static: recorded.iter().map(|one| one.is_static).collect(),
        states,
    };
    let road = Arc::new(open(parallel_lanes(2, 200.0)));
    let scenario = Scenario::new(0.1, road, obstacles).expect("a test's scenario");
    World::new(Arc::new(scenario), agents, settings).expect("a test's world")
}

fn world(agents: Vec<Agent>, recorded: &[Recorded]) -> World {
    world_with(agents, recorded, WorldSettings::default())
}

/// Where an agent is now.
fn state(world: &World, id: i64) -> Option<State> {
    let row = world.participants.ids.binary_search(&id).expect("a participant");
    world.states[row]
}

/// Plans that bring some agents to given positions; all other driving agents stay in place.
fn towards(world: &World, next: &[(i64, State)]) -> Plans {
    let mut plans = Plans::none(world.time_step(), world.driving(), 2);
    for id in world.driving() {
        let now = state(world, id).expect("a driving agent is present");
        let next = next.iter().find(|(agent, _)| *agent == id).map_or(now, |(_, next)| *next);
        plans.set_row(id, &[now, next]).expect("it drives");
    }
    plans
}

fn move_to(world: &mut World, next: &[(i64, State)]) {
    let plans = towards(world, next);
    world.step(&plans).expect("plans of all driving agents");
}

fn outcome(world: &World, id: i64) -> Outcome {
    let of_agent = world.agents().zip(world.outcomes()).find(|(agent, _)| agent.id == id);
    of_agent.expect("an agent").1.clone()
}
