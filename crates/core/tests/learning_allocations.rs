//! Memory that worlds with learners allocate once they are warm: none while episodes last.

use std::sync::Arc;

use interdrive_core::observation::ObservationSettings;
use interdrive_core::worlds::Stage;

mod counting;
mod learning;
mod shipped;

use counting::allocations;
use learning::{Arrays, refill};

/// Allocations of a step within episodes, and of those in which all worlds begin anew, or have just begun and keep their
/// first plans: the most over some steps after warm-up with one thread, the least with more.
fn taken(stage: &Arc<Stage>, learners: usize, threads: usize, observation: ObservationSettings) -> (usize, usize) {
    const WORLDS: usize = 8;
    const EPISODE: usize = 10;
    let mut worlds = learning::worlds(stage, (WORLDS, learners), EPISODE, threads, observation);
    let mut arrays = Arrays::new(WORLDS * learners, &observation);
    refill(&mut worlds, learners);
    worlds.reset(&[true; WORLDS], arrays.buffers()).expect("a reset");
    refill(&mut worlds, learners);
    let (mut driving, mut beginning) = (None, None);
    for step in 0..6 * EPISODE {
        let before = allocations();
        worlds.step(arrays.buffers()).expect("a step");
        let now = allocations() - before;
        let begins = step % EPISODE == EPISODE - 1 || step % EPISODE == 0;
        assert_eq!(arrays.flags[1].iter().all(|cut| *cut), step % EPISODE == EPISODE - 1);
        assert!(!arrays.flags[0].iter().any(|ended| *ended), "no learner is to end in a second");
        refill(&mut worlds, learners);
        if step >= 2 * EPISODE {
            let kept = if begins { &mut beginning } else { &mut driving };
            let before: usize = kept.unwrap_or(now);
            *kept = Some(if threads == 1 { before.max(now) } else { before.min(now) });
        }
    }
    (driving.expect("steps"), beginning.expect("resets"))
}

/// One test, so that nothing else allocates meanwhile.
#[test]
#[allow(clippy::print_stdout, reason = "to lower the numbers you need to see them: --nocapture")]
fn a_step_of_learners_among_recorded_vehicles_allocates_nothing() {
    let stage = learning::stage();
    let usual = ObservationSettings::default();
    let all = ObservationSettings { edges: 32, raster: true, ..usual };
    for (learners, threads, observation) in
        [(1, 1, usual), (8, 1, usual), (1, 2, usual), (8, 2, usual), (8, 1, all), (8, 2, all)]
    {
        let (driving, beginning) = taken(&stage, learners, threads, observation);
        println!("{learners} learners, {threads} threads: {driving} per step, {beginning} if 8 worlds begin anew");
        // Two threads share a list of worlds, made anew in every step.
        assert!(driving <= [0, 2][threads - 1], "{learners} learners, {threads} threads: {driving}");
    }
}
