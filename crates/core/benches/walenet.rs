//! WALENET with random weights, on one thread: everybody on a wide motorway, and what of it is the picture.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use interdrive_core::geometry::shape::Shape;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::predict::walenet::{Network, Tensor, Walenet, WalenetSettings};
use interdrive_core::predict::{Predictor, predict};
use interdrive_core::road::{LaneletInput, RoadNetwork, RoadSettings};
use interdrive_core::scene::{Participants, Scene};
use interdrive_core::trajectory::{State, States};
use interdrive_core::vehicle::ParticipantKind;

const LANES: usize = 6;

/// Numbers in (-0.1, 0.1), the same at every run.
fn weights() -> Vec<Tensor> {
    let mut state = 5_u64;
    let mut tensor = |name: String, shape: &[usize]| {
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f32 / (1_u64 << 30) as f32 - 1.0) * 0.1
        };
        Tensor { name, shape: shape.to_vec(), values: (0..shape.iter().product()).map(|_| next()).collect() }
    };
    let mut tensors = Vec::new();
    for (name, inputs, size) in [("enc_lstm", 16, 32), ("dec_lstm", 88, 64)] {
        for (part, shape) in [("weight_ih", vec![3 * size, inputs]), ("weight_hh", vec![3 * size, size])] {
            tensors.push(tensor(format!("{name}.{part}_l0"), &shape));
        }
        for part in ["bias_ih", "bias_hh"] {
            tensors.push(tensor(format!("{name}.{part}_l0"), &[3 * size]));
        }
    }
    let mut layers = vec![
        ("ip_emb".to_string(), vec![16, 2]),
        ("dyn_emb".to_string(), vec![16, 32]),
        ("op".to_string(), vec![5, 64]),
        ("soc_conv".to_string(), vec![32, 32, 3, 3]),
        ("conv_3x1".to_string(), vec![8, 32, 3, 1]),
        ("sc_conv1".to_string(), vec![32, 1, 3, 3]),
    ];
    layers.extend((2..=8).map(|layer| (format!("sc_conv{layer}"), vec![32, 32, 3, 3])));
    for (name, shape) in layers {
        tensors.push(tensor(format!("{name}.bias"), &shape[..1]));
        tensors.push(tensor(format!("{name}.weight"), &shape));
    }
    tensors
}

/// A motorway that bends slightly.
fn motorway() -> RoadNetwork {
    let bound = |offset: f64| {
        (0..=200).map(move |i| {
            let x = 5.0 * f64::from(i);
            Point::new(x, offset + 40.0 * (x / 400.0).sin())
        })
    };
    let lane = |i: usize| LaneletInput {
        id: i as i64 + 1,
        left: bound(3.7 * (i + 1) as f64).collect(),
        right: bound(3.7 * i as f64).collect(),
        predecessors: Vec::new(),
        successors: Vec::new(),
        adjacent_left: (i + 1 < LANES).then_some((i as i64 + 2, true)),
        adjacent_right: (i > 0).then_some((i as i64, true)),
        speed_limit: f64::NAN,
    };
    RoadNetwork::new((0..LANES).map(lane).collect(), RoadSettings::default()).expect("a road")
}

/// Cars with 3 s of past, `shift` metres further on.
fn traffic(n: usize, shift: f64) -> Scene {
    const N_PAST: usize = 31;
    let ids: Vec<i64> = (0..n as i64).collect();
    let mut past = States::absent(ids.clone(), 0, N_PAST);
    for i in 0..n {
        let (velocity, lane) = (12.0 + (i % 7) as f64, i % LANES);
        for column in 0..N_PAST {
            let x = 100.0 + (800.0 * i as f64 / n as f64) + shift - velocity * 0.1 * (N_PAST - 1 - column) as f64;
            let y = 3.7 * (lane as f64 + 0.5) + 40.0 * (x / 400.0).sin();
            let orientation = (0.1 * (x / 400.0).cos()).atan();
            past.set(i, column, &State { x, y, orientation, velocity, ..State::default() });
        }
    }
    let participants = Participants {
        ids,
        kind: vec![ParticipantKind::Car; n],
        shape: vec![Shape::rectangle(4.5, 1.8); n],
        is_static: vec![false; n],
        is_agent: vec![false; n],
    };
    Scene {
        time_step: N_PAST as i64 - 1,
        dt: 0.1,
        participants: Arc::new(participants),
        present: (0..n).collect(),
        past,
    }
}

fn everybody(c: &mut Criterion) {
    let network = Arc::new(Network::new(&weights()).expect("complete"));
    let road = Arc::new(motorway());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut group = c.benchmark_group("walenet");
    group.sample_size(10);
    for n in [1, 25, 50, 200] {
        let walenet = Walenet::new(Arc::clone(&network), WalenetSettings::default(), Arc::clone(&road));
        let predictor = Predictor::Walenet(Arc::new(walenet));
        // Two scenes in turn: nobody is where it was in the call before.
        let scenes = [traffic(n, 0.0), traffic(n, 1.3)];
        let mut turn = 0;
        group.bench_with_input(BenchmarkId::new("vehicles", n), &scenes, |b, scenes| {
            b.iter(|| {
                turn = 1 - turn;
                pool.install(|| predict(black_box(&predictor), &scenes[turn], &road, 30).expect("possible"))
            });
        });
    }
    group.bench_function("drawing", |b| b.iter(|| Walenet::picture(black_box(&road), Pose::new(300.0, 40.0, 0.1))));
    group.finish();
}

criterion_group!(benches, everybody);
criterion_main!(benches);
