//! Hot paths to be counted instruction by instruction: `instructions NAME N` does one of them N times and nothing else.
//! `benchmarks/instructions.py` runs it under callgrind and subtracts what preparing takes. One thread, no clock.

use std::hint::black_box;
use std::sync::Arc;

use interdrive_core::collision::{Mover, contacts};
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::observation::ObservationSettings;
use interdrive_core::plan::Planner;
use interdrive_core::predict::neural::Neural;
use interdrive_core::predict::{LaneFollowing, Predictor};
use interdrive_core::v2x::V2xSettings;
use interdrive_core::world::{Forecast, Step, World, WorldSettings};

#[path = "../tests/learning/mod.rs"]
mod learning;
mod network;
#[path = "../tests/shipped/mod.rs"]
mod shipped;

/// Steps of predictions and plans: 3 s.
const HORIZON: usize = 30;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (Some(name), Some(times)) = (arguments.next(), arguments.next().and_then(|n| n.parse().ok())) else {
        return; // `cargo bench` calls it without arguments
    };
    let following = Predictor::LaneFollowing(LaneFollowing::default());
    match name.as_str() {
        // One agent in reach of seven others; `frenet` evaluates 800 samples.
        "plan" => plan(Planner::Rollout(Box::default()), &following, times),
        "plan_frenet" => plan(Planner::Frenet(Box::default()), &following, times),
        "predict_lane_following" => predict(&following, times),
        "predict_neural" => {
            let network = Arc::new(network::network());
            predict(&Predictor::Neural(Neural { network, modes_max: 4 }), times);
        }
        // A hundred cars during one step.
        "contacts" => {
            let world = world(shipped::TOWN, 100);
            let scene = world.scene();
            let shapes = &world.participants().shape;
            let movers: Vec<Mover> = (0..shapes.len())
                .map(|row| {
                    let (state, from) = (scene.state(row), scene.state(row).pose());
                    let to = from.position + Point::from_angle(state.orientation) * (0.1 * state.velocity);
                    Mover { shape: &shapes[row], from, to: Pose { position: to, orientation: state.orientation } }
                })
                .collect();
            (0..times).for_each(|_| drop(black_box(contacts(black_box(&movers), |_| true))));
        }
        // Whole steps, all vehicles plan.
        "step" => {
            let mut world = world(shipped::T_JUNCTION, usize::MAX);
            steps(&mut world, &following, 10 + times);
        }
        // The same traffic with messages. No plan of a sender in sight is believed, because rounding puts it farther off
        // than that; plans of those out of sight are, but they are far away.
        "step_messages" => {
            let v2x = V2xSettings { penetration: 1.0, deviation: 1e-6, ..V2xSettings::default() };
            cooperate(v2x, &following, 10 + times);
        }
        // Messages, requests and what agents expect because of them.
        "step_v2x" => {
            let v2x = V2xSettings { penetration: 1.0, negotiate: true, ..V2xSettings::default() };
            cooperate(v2x, &following, 10 + times);
        }
        // The steps of 25 agents in a part of the town.
        "step_town" => {
            let mut world = world(shipped::TOWN, 25);
            steps(&mut world, &following, 10 + times);
        }
        // Steps of four worlds with eight learners each, observations included.
        "learn" => learn(times),
        _ => panic!("no hot path {name}"),
    }
}

fn world(document: &str, agents: usize) -> World {
    shipped::world(document, agents, &Planner::Rollout(Box::default()), WorldSettings::default())
}

/// Plans of one agent at the T-junction in the same scene.
fn plan(planner: Planner, predictor: &Predictor, times: usize) {
    let mut world = shipped::world(shipped::T_JUNCTION, 1, &planner, WorldSettings::default());
    steps(&mut world, predictor, 10);
    let mut step = Step::begin(&world);
    step.expect(&world, Forecast::Core(predictor, HORIZON)).expect("predictions");
    (0..times).for_each(|_| black_box(step.plan(&world)).expect("plans"));
}

/// Steps of learners at the T-junction, within one episode, after some so that there is a past.
fn learn(times: usize) {
    const WORLDS: usize = 4;
    const LEARNERS: usize = 8;
    let observation = ObservationSettings::default();
    let mut worlds = learning::worlds(&learning::stage(), (WORLDS, LEARNERS), 100, 1, observation);
    let mut arrays = learning::Arrays::new(WORLDS * LEARNERS, &observation);
    learning::refill(&mut worlds, LEARNERS);
    worlds.reset(&[true; WORLDS], arrays.buffers()).expect("a reset");
    learning::refill(&mut worlds, LEARNERS);
    (0..5 + times).for_each(|_| black_box(worlds.step(arrays.buffers())).expect("a step"));
}

/// Steps of all vehicles at the T-junction with messages.
fn cooperate(v2x: V2xSettings, predictor: &Predictor, n: usize) {
    let settings = WorldSettings { v2x, ..WorldSettings::default() };
    let mut world = shipped::world(shipped::T_JUNCTION, usize::MAX, &Planner::Rollout(Box::default()), settings);
    steps(&mut world, predictor, n);
}

fn steps(world: &mut World, predictor: &Predictor, n: usize) {
    for _ in 0..n {
        let mut step = Step::begin(world);
        step.expect(world, Forecast::Core(predictor, HORIZON)).expect("predictions");
        step.plan(world).expect("plans");
        world.step(&step.plans).expect("a step");
    }
}

/// All participants in one part of the town, after some steps, so that there is a past.
fn predict(predictor: &Predictor, times: usize) {
    let mut world = world(shipped::TOWN, 25);
    steps(&mut world, &Predictor::LaneFollowing(LaneFollowing::default()), 5);
    let scene = world.scene();
    (0..times).for_each(|_| drop(black_box(world.predict(predictor, black_box(&scene), HORIZON))));
}
