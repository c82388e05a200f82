//! Visibility among all agents of dense traffic, by distance alone and with line of sight.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use interdrive_core::geometry::shape::Shape;
use interdrive_core::scene::{Participants, Scene, ViewLimits};
use interdrive_core::trajectory::{State, States};
use interdrive_core::vehicle::ParticipantKind;

/// Eight lanes, four in either direction, in each a car or a truck every 20 m.
fn traffic(n: usize) -> Scene {
    let ids: Vec<i64> = (0..n as i64).collect();
    let is_truck = |i: usize| i.is_multiple_of(5);
    let participants = Participants {
        ids: ids.clone(),
        kind: (0..n).map(|i| if is_truck(i) { ParticipantKind::Truck } else { ParticipantKind::Car }).collect(),
        shape: (0..n)
            .map(|i| if is_truck(i) { Shape::rectangle(12.0, 2.5) } else { Shape::rectangle(4.5, 1.8) })
            .collect(),
        is_static: vec![false; n],
        is_agent: vec![true; n],
        ..Participants::default()
    };
    let mut past = States::absent(ids, 0, 1);
    for i in 0..n {
        let (lane, place) = ((i % 8) as f64, (i / 8) as f64);
        let orientation = if i % 8 < 4 { 0.01 } else { -3.13 };
        past.set(
            i,
            0,
            &State { x: 20.0 * place + 2.5 * lane, y: 3.5 * lane, orientation, velocity: 15.0, ..State::default() },
        );
    }
    let turns = vec![None; n];
    Scene { time_step: 0, dt: 0.1, participants: Arc::new(participants), present: (0..n).collect(), turns, past }
}

fn views(c: &mut Criterion) {
    let mut group = c.benchmark_group("all agents look");
    for n in [24, 50, 200] {
        let scene = traffic(n);
        for (name, occlusion) in [("distance", false), ("line of sight", true)] {
            let limits = ViewLimits { occlusion, ..ViewLimits::default() };
            group.bench_with_input(BenchmarkId::new(name, n), &limits, |b, limits| {
                b.iter(|| (0..n).map(|row| black_box(&scene).visible_from(row, limits).len()).sum::<usize>());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, views);
criterion_main!(benches);
