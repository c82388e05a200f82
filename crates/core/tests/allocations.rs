//! Memory that steps allocate once the world is warm.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use interdrive_core::plan::Planner;
use interdrive_core::predict::neural::Neural;
use interdrive_core::predict::{LaneFollowing, Predictor};
use interdrive_core::world::WorldSettings;

#[path = "../benches/network/mod.rs"]
mod network;
mod shipped;

/// Counts every request for memory, in all threads.
struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code, reason = "an allocator is unsafe by its nature; this one hands everything on")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations since the last time.
fn taken(before: &mut usize) -> usize {
    let now = ALLOCATIONS.load(Ordering::Relaxed);
    let since = now - *before;
    *before = now;
    since
}

/// Most allocations in a phase of a step, over some steps after warm-up: observe, predict (`lane_following`, `neural`), plan,
/// step.
fn most_per_phase(agents: usize) -> [usize; 5] {
    const WARM_UP: usize = 10;
    let planner = Planner::Frenet(Box::default());
    let mut world = shipped::world(shipped::TOWN, agents, &planner, WorldSettings::default());
    let predictor = Predictor::LaneFollowing(LaneFollowing::default());
    let neural = Predictor::Neural(Neural { network: Arc::new(network::network()), modes_max: 4 });
    let mut most = [0; 5];
    for step in 0..WARM_UP + 10 {
        let mut before = ALLOCATIONS.load(Ordering::Relaxed);
        let scene = world.scene();
        let observe = taken(&mut before);
        let predictions = world.predict(&predictor, &scene, 30).expect("predictions");
        let predict = taken(&mut before);
        drop(world.predict(&neural, &scene, 30).expect("predictions"));
        let predict_neural = taken(&mut before);
        let plans = world.plan(&scene, &predictions).expect("plans");
        let plan = taken(&mut before);
        world.step(&plans).expect("a step");
        let advance = taken(&mut before);
        if step >= WARM_UP {
            for (most, now) in most.iter_mut().zip([observe, predict, predict_neural, plan, advance]) {
                *most = now.max(*most);
            }
        }
    }
    most
}

/// Allocations that each phase may make for every further agent. The aim is none; whoever removes some lowers the number.
const PER_AGENT: [(&str, f64); 5] =
    [("observe", 0.1), ("predict", 0.1), ("predict, neural,", 0.1), ("plan", 1.2), ("step", 0.2)];

/// One test, so that nothing else allocates meanwhile.
#[test]
#[allow(clippy::print_stdout, reason = "whoever lowers the numbers wants to see them: --nocapture")]
fn a_step_allocates_no_more_than_it_did() {
    let (few, many) = (most_per_phase(25), most_per_phase(100));
    println!("allocations per step (observe, predict, neural, plan, step): {few:?} for 25 agents, {many:?} for 100");
    for (phase, (name, limit)) in PER_AGENT.into_iter().enumerate() {
        let per_agent = (many[phase] as f64 - few[phase] as f64) / 75.0;
        assert!(per_agent <= limit, "{name} allocates {per_agent:.2} times more for every agent, at most {limit}");
    }
}
