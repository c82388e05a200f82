//! Memory that steps allocate once the world is warm.

use std::sync::Arc;

use interdrive_core::plan::Planner;
use interdrive_core::predict::neural::Neural;
use interdrive_core::predict::{LaneFollowing, Predictor};
use interdrive_core::world::{Forecast, Step, WorldSettings};

#[path = "../benches/network/mod.rs"]
mod network;
mod counting;
mod shipped;

use counting::allocations;

/// Allocations since the last time.
fn taken(before: &mut usize) -> usize {
    let now = allocations();
    let since = now - *before;
    *before = now;
    since
}

/// Allocations in a phase of a step: observe, predict (`lane_following`, `neural`), plan, step. With one thread the most
/// over some steps after warm-up; with more the least, for it is by chance when the memory of a thread last grows.
fn per_phase(agents: usize, threads: usize) -> [usize; 5] {
    const WARM_UP: usize = 10;
    let planner = Planner::Rollout(Box::default());
    let settings = WorldSettings { threads, ..WorldSettings::default() };
    let mut world = shipped::world(shipped::TOWN, agents, &planner, settings);
    let predictor = Predictor::LaneFollowing(LaneFollowing::default());
    let neural = Predictor::Neural(Neural { network: Arc::new(network::network()), modes_max: 4 });
    let mut found = None;
    for time_step in 0..WARM_UP + 10 {
        let mut before = allocations();
        let mut step = Step::begin(&world);
        let observe = taken(&mut before);
        step.expect(&world, Forecast::Core(&predictor, 30)).expect("predictions");
        let predict = taken(&mut before);
        drop(world.predict(&neural, &step.scene, 30).expect("predictions"));
        let predict_neural = taken(&mut before);
        step.plan(&world).expect("plans");
        let plan = taken(&mut before);
        world.step(&step.plans).expect("a step");
        let advance = taken(&mut before);
        if time_step >= WARM_UP {
            let now = [observe, predict, predict_neural, plan, advance];
            let before = found.unwrap_or(now);
            let kept =
                |phase: usize| if threads == 1 { before[phase].max(now[phase]) } else { before[phase].min(now[phase]) };
            found = Some(std::array::from_fn(kept));
        }
    }
    found.expect("steps")
}

/// Allocations that each phase may make for 25 agents, with one and with two threads, and for every further agent. The aim
/// is none: lower the number if you remove some.
const LIMITS: [(&str, [usize; 2], f64); 5] = [
    ("observe", [23, 24], 0.1),
    // All but 24 for the orders at junctions, which are found once for every set of bodies that agents see there.
    ("predict", [402, 402], 8.1),
    ("predict, neural,", [19, 21], 0.1),
    // About 18 for every plan: proposals are stored until the search ends.
    ("plan", [453, 453], 17.7),
    ("step", [7, 7], 0.1),
];

/// One test, so that nothing else allocates meanwhile.
#[test]
#[allow(clippy::print_stdout, reason = "to lower the numbers you need to see them: --nocapture")]
fn a_step_allocates_no_more_than_it_did() {
    for threads in [1, 2] {
        let (few, many) = (per_phase(25, threads), per_phase(100, threads));
        println!("allocations per step (observe, predict, neural, plan, step) with {threads} threads:");
        println!("{few:?} for 25 agents, {many:?} for 100");
        for (phase, (name, most, limit)) in LIMITS.into_iter().enumerate() {
            let (now, most) = (few[phase], most[threads - 1]);
            assert!(now <= most, "{name} allocates {now} times for 25 agents with {threads} threads, at most {most}");
            let per_agent = (many[phase] as f64 - now as f64) / 75.0;
            assert!(per_agent <= limit, "{name} allocates {per_agent:.2} times more for every agent, at most {limit}");
        }
    }
}
