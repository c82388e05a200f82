//! One plan call for 24 agents of each native kind, at once, on a three-lane road; one thread.

use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use interdrive_core::geometry::shape::Shape;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::plan::{IdmSettings, LawfulSettings, Planner, VelocityAdjustingSettings};
use interdrive_core::predict::{LaneFollowing, Predictor};
use interdrive_core::road::{LaneletInput, RoadNetwork, RoadSettings};
use interdrive_core::route::{RouteSettings, find_route};
use interdrive_core::rules::RulesSettings;
use interdrive_core::scenario::{Goal, GoalState, Obstacles, Scenario};
use interdrive_core::scene::ViewLimits;
use interdrive_core::trajectory::{State, States};
use interdrive_core::vehicle::{ParticipantKind, Vehicle};
use interdrive_core::world::{Agent, Forecast, Step, World, WorldSettings};

const N_AGENTS: i64 = 24;
const N_STEPS: usize = 100;
const VELOCITY: f64 = 14.0;

/// Three lanes of 3.5 m and 900 m along a slight bend.
fn road() -> RoadNetwork {
    let lane = |id: i64, radius: f64, left: Option<i64>, right: Option<i64>| {
        let along = |r: f64| (0..=180).map(|i| Point::from_angle(f64::from(i) * 0.001) * r).collect::<Vec<_>>();
        LaneletInput {
            adjacent_left: left.map(|id| (id, true)),
            adjacent_right: right.map(|id| (id, true)),
            ..LaneletInput::between(id, along(radius - 1.75), along(radius + 1.75))
        }
    };
    let lanes = vec![lane(1, 5003.5, Some(2), None), lane(2, 5000.0, Some(3), Some(1)), lane(3, 4996.5, None, Some(2))];
    RoadNetwork::new(lanes, RoadSettings::default()).expect("a road")
}

/// Where car `i` is at a time step: eight rows of three, 24 m apart.
fn state(i: i64, time_step: usize) -> State {
    let radius = [5003.5, 5000.0, 4996.5][(i % 3) as usize];
    let s = 60.0 + 24.0 * (i / 3) as f64 + 3.0 * (i % 3) as f64 + VELOCITY * 0.1 * time_step as f64;
    let position = Point::from_angle(s / radius) * radius;
    State {
        x: position.x,
        y: position.y,
        orientation: s / radius + std::f64::consts::FRAC_PI_2,
        velocity: VELOCITY,
        acceleration: 0.0,
        yaw_rate: VELOCITY / radius,
    }
}

fn world(planner: &Planner) -> World {
    let road = Arc::new(road());
    let mut states = States::absent((0..N_AGENTS).collect(), 0, N_STEPS);
    for i in 0..N_AGENTS {
        for step in 0..N_STEPS {
            states.set(i as usize, step, &state(i, step));
        }
    }
    let (n, shape) = (N_AGENTS as usize, Shape::rectangle(4.508, 1.61));
    let obstacles = Obstacles {
        kind: vec![ParticipantKind::Car; n],
        shape: vec![shape.clone(); n],
        is_static: vec![false; n],
        states,
    };
    // Not before the bench is over.
    let anywhere = GoalState { areas: [].into(), time_step: (400, 500), velocity: None, orientation: None };
    let agents = (0..N_AGENTS).map(|id| {
        let initial_state = state(id, 0);
        let start = Pose::new(initial_state.x, initial_state.y, initial_state.orientation);
        let route = find_route(&road, start, VELOCITY, &[], &RouteSettings::default()).expect("a route");
        Agent {
            id,
            kind: ParticipantKind::Car,
            shape: shape.clone(),
            vehicle: Vehicle::BMW_320I,
            initial_state,
            start_time_step: 0,
            replays_before: false,
            queue: None,
            goal: Goal { states: vec![anywhere.clone()], pace: None },
            route: Arc::new(route),
            planner: planner.clone(),
            view: ViewLimits { sensor_radius: 80.0, ..ViewLimits::default() },
            rules: RulesSettings::default(),
            v2x: None,
        }
    });
    let agents = agents.collect();
    let scenario = Scenario::new(0.1, road, obstacles).expect("a scenario");
    World::new(Arc::new(scenario), agents, WorldSettings::default()).expect("a world")
}

fn benches(c: &mut Criterion) {
    let mut group = c.benchmark_group("24 agents");
    group.measurement_time(std::time::Duration::from_secs(2)).sample_size(20);
    for (name, planner) in [
        ("recorded", Planner::Recorded),
        ("velocity_adjusting", Planner::VelocityAdjusting(VelocityAdjustingSettings::default())),
        ("idm", Planner::Idm(IdmSettings::default())),
        ("lawful", Planner::Lawful(LawfulSettings::default())),
        ("idm_mobil", Planner::IdmMobil(Box::default())),
        ("pdm", Planner::Pdm(Box::default())),
        ("frenet", Planner::Frenet(Box::default())),
        ("rollout", Planner::Rollout(Box::default())),
    ] {
        let mut world = world(&planner);
        let predictor = Predictor::LaneFollowing(LaneFollowing::default());
        let begin = |world: &World| {
            let mut step = Step::begin(world);
            step.expect(world, Forecast::Core(&predictor, 30)).expect("predictions");
            step
        };
        // After the first steps, as in the middle of a run.
        for _ in 0..5 {
            let mut step = begin(&world);
            step.plan(&world).expect("plans");
            world.step(&step.plans).expect("a step");
        }
        let mut step = begin(&world);
        group.bench_function(name, |b| b.iter(|| step.plan(&world).expect("plans")));
    }
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);
