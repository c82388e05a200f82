//! One call of the neural predictor for traffic on a six-lane road with a fork; one thread. The layers are as wide as
//! the shipped ones; the weights are arbitrary.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use interdrive_core::geometry::Point;
use interdrive_core::geometry::shape::Shape;
use interdrive_core::predict::neural::{Inputs, Neural};
use interdrive_core::predict::{Predictor, predict};
use interdrive_core::road::{LaneletInput, RoadNetwork, RoadSettings};
use interdrive_core::scene::{Participants, Scene};
use interdrive_core::trajectory::{State, States};
use interdrive_core::vehicle::ParticipantKind;

mod network;

const LANES: usize = 6;
/// Lanelets of a lane.
const PIECES: usize = 20;
const HISTORY: usize = 30;

/// Lanes of 3.5 m in lanelets of 60 m along a bend of 1.5 km radius; from every third lanelet of the rightmost lane an
/// exit leads away.
fn road() -> RoadNetwork {
    let along = |radius: f64, piece: usize| -> Vec<Point> {
        (0..=12).map(|i| Point::from_angle((60.0 * piece as f64 + 5.0 * f64::from(i)) / 1500.0) * radius).collect()
    };
    let id = |lane: usize, piece: usize| (100 * lane + piece) as i64;
    let mut lanelets = Vec::new();
    for lane in 0..LANES {
        let radius = 1500.0 - 3.5 * lane as f64;
        for piece in 0..PIECES {
            lanelets.push(LaneletInput {
                successors: if piece + 1 < PIECES { vec![id(lane, piece + 1)] } else { vec![] },
                adjacent_left: (lane + 1 < LANES).then(|| (id(lane + 1, piece), true)),
                adjacent_right: (lane > 0).then(|| (id(lane - 1, piece), true)),
                speed_limit: 30.0,
                ..LaneletInput::between(id(lane, piece), along(radius - 1.75, piece), along(radius + 1.75, piece))
            });
        }
    }
    for piece in (0..PIECES - 1).step_by(3) {
        let shifted = |radius: f64| -> Vec<Point> {
            let line = along(radius, piece + 1);
            line.iter().enumerate().map(|(i, point)| *point * (1.0 + (i * i) as f64 * 5e-5)).collect()
        };
        lanelets.push(LaneletInput {
            predecessors: vec![id(0, piece)],
            ..LaneletInput::between(1000 + piece as i64, shifted(1498.25), shifted(1501.75))
        });
    }
    RoadNetwork::new(lanelets, RoadSettings::default()).expect("a road")
}

/// Cars at 8 to 12 m/s in all lanes, 18 m apart, with three seconds of the past.
fn scene(n: usize) -> Scene {
    let ids: Vec<i64> = (0..n as i64).collect();
    let mut past = States::absent(ids.clone(), -(HISTORY as i64), HISTORY + 1);
    for i in 0..n {
        let (lane, velocity) = (i % LANES, 8.0 + (i * 7 % 9) as f64 * 0.5);
        let radius = 1500.0 - 3.5 * lane as f64;
        for k in 0..=HISTORY {
            let s = 60.0 + 18.0 * (i / LANES) as f64 + 4.0 * lane as f64 - (HISTORY - k) as f64 * 0.1 * velocity;
            let (angle, wobble) = (s / radius, 0.1 * (0.3 * s).sin());
            let position = Point::from_angle(angle) * (radius + wobble);
            let orientation = angle + std::f64::consts::FRAC_PI_2;
            let state = State { x: position.x, y: position.y, orientation, velocity, ..State::default() };
            past.set(i, k, &state);
        }
    }
    let participants = Participants {
        ids,
        kind: vec![ParticipantKind::Car; n],
        shape: vec![Shape::rectangle(4.6, 1.9); n],
        is_static: vec![false; n],
        is_agent: vec![false; n],
        ..Participants::default()
    };
    let turns = vec![None; n];
    Scene { time_step: 0, dt: 0.1, participants: Arc::new(participants), present: (0..n).collect(), turns, past }
}

fn benches(c: &mut Criterion) {
    let road = road();
    let neural = Neural { network: Arc::new(network::network()), modes_max: 4 };
    let network = Arc::clone(&neural.network);
    let predictor = Predictor::Neural(neural);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut group = c.benchmark_group("neural");
    for n in [1, 25, 50, 200, 1000] {
        let scene = scene(n);
        group.bench_function(format!("{n} vehicles"), |b| {
            pool.install(|| b.iter(|| predict(black_box(&predictor), &scene, &road, 30)));
        });
    }
    let scene = scene(50);
    group.bench_function("50 vehicles, features", |b| b.iter(|| Inputs::of(black_box(&scene), &road)));
    let inputs = Inputs::of(&scene, &road);
    let valid = inputs.path_valid();
    group.bench_function("50 vehicles, network", |b| {
        b.iter(|| network.forward(black_box(&inputs.agent), &inputs.neighbours, &inputs.paths, &valid));
    });
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);
