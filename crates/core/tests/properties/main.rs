//! Properties of any input: roads, curves, shapes, drives and recordings made of any numbers end in a result or in an
//! error in words, soon, with little memory; never in a panic.
//!
//! `PROPTEST_CASES` sets the number of cases. The seed is fixed; cases that failed once are in `regressions/` and come
//! first. The same checks run under a fuzzer: `make fuzz-core`.

#![allow(
    clippy::disallowed_methods,
    reason = "the environment says how many cases are tried, files hold what failed once"
)]

mod curves;
mod drives;
mod judged;
mod memory;
#[path = "../../benches/network/mod.rs"]
mod network;
mod roads;
mod shapes;
mod source;
mod traffic;

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::test_runner::{FileFailurePersistence, RngSeed};
use source::Source;

#[global_allocator]
static COUNTING: memory::Counting = memory::Counting;

/// Worlds of this size need no more memory [bytes], whatever their numbers are.
const MEMORY_MAX: usize = 128 << 20;
/// Nor more time; a hundred times what they take alone on a machine.
const TIME_MAX: Duration = Duration::from_secs(20);

fn config(cases: u32) -> ProptestConfig {
    let stated = std::env::var("PROPTEST_CASES").is_ok();
    let default = ProptestConfig::default();
    ProptestConfig {
        cases: if stated { default.cases } else { cases },
        rng_seed: RngSeed::Fixed(2025),
        failure_persistence: Some(Box::new(FileFailurePersistence::Direct(
            "tests/properties/regressions/proptest.txt",
        ))),
        max_shrink_time: 60_000,
        ..default
    }
}

fn bytes(n: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..n)
}

/// Runs a check alone, so that its memory and its time are its own.
fn alone(check: impl FnOnce()) {
    static ALONE: Mutex<()> = Mutex::new(());
    let _guard = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let start = Instant::now();
    let ((), peak) = memory::peak(check);
    assert!(peak <= MEMORY_MAX, "{} MB", peak >> 20);
    assert!(start.elapsed() <= TIME_MAX, "{:?}", start.elapsed());
}

/// A check of what some bytes make.
type Check = fn(&[u8]);

/// The checks that the fuzzer makes, too, by the names of its targets.
const CHECKS: [(&str, Check); 4] = [
    ("road_network", |bytes| roads::check(&mut Source::new(bytes))),
    ("curves", |bytes| {
        curves::check(&mut Source::new(bytes));
        shapes::check(&mut Source::new(bytes));
    }),
    ("drives", drives::check),
    ("criticality", |bytes| judged::check(&mut Source::new(bytes))),
];

/// What the fuzzer found, as files of bytes.
#[test]
fn what_failed_once_does_not_fail_again() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/properties/regressions");
    let mut n_files = 0;
    for (target, check) in CHECKS {
        let Ok(entries) = std::fs::read_dir(folder.join(target)) else { continue };
        for entry in entries {
            let bytes = std::fs::read(entry.expect("an entry").path()).expect("a file");
            alone(|| check(&bytes));
            n_files += 1;
        }
    }
    assert!(n_files > 0, "no regressions in {}", folder.display());
}

/// Otherwise all that follows would say nothing.
#[test]
fn most_generated_worlds_have_agents_that_drive() {
    let mut random = 1_u64;
    let mut byte = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 56) as u8
    };
    let worlds = 200;
    let driven = (0..worlds).filter(|_| drives::n_planned(&(0..1500).map(|_| byte()).collect::<Vec<_>>()) >= 3).count();
    assert!(2 * driven >= worlds, "only {driven} of {worlds}");
}

proptest! {
    #![proptest_config(config(3000))]

    #[test]
    fn any_lanelets_make_a_road_or_a_reason(bytes in bytes(600)) {
        alone(|| roads::check(&mut Source::new(&bytes)));
    }

    #[test]
    fn any_points_make_a_curve_or_a_reason(bytes in bytes(200)) {
        alone(|| curves::check(&mut Source::new(&bytes)));
    }

    #[test]
    fn any_two_shapes_have_a_distance(bytes in bytes(200)) {
        alone(|| shapes::check(&mut Source::new(&bytes)));
    }

    #[test]
    fn any_world_is_driven_to_its_end(bytes in bytes(1500)) {
        alone(|| drives::check(&bytes));
    }

    #[test]
    fn any_recording_is_judged(bytes in bytes(1200)) {
        alone(|| judged::check(&mut Source::new(&bytes)));
    }
}
