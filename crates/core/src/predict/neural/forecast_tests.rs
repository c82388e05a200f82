//! What comes out for networks whose answer is known, and for any network.

use super::feature_table::{N_AGENT, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH};
use super::network::{MODE_OUTPUTS, Network, Tail, Tensor};
use super::paths::N_PATHS;
use super::tests::{Track, car, scene};
use super::{Inputs, N_KNOTS, Neural};
use crate::error::Error;
use crate::predict::{Predictor, predict};
use crate::road::RoadNetwork;
use crate::road::testing::{fork, straight_road};
use crate::scene::Scene;
use crate::trajectory::{Predictions, State};
use crate::vehicle::ParticipantKind;

const N_STEPS: usize = 30;

/// Numbers between -1 and 1 that depend on the seed alone.
fn numbers(n: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    (0..n)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        })
        .collect()
}

fn tensor(name: &str, shape: &[usize], values: Vec<f32>) -> Tensor {
    Tensor { name: name.to_string(), shape: shape.to_vec(), values }
}

/// Tensors of a small network with `n_modes` modes per path and weights of this size.
fn tensors(n_modes: usize, size: f32) -> Vec<Tensor> {
    let mut tensors = vec![
        tensor("calibration.s", &[N_KNOTS], vec![1.0; N_KNOTS]),
        tensor("calibration.d", &[N_KNOTS], vec![1.0; N_KNOTS]),
    ];
    for (k, (name, n_in, n_out)) in [
        ("agent.0", N_AGENT, 12),
        ("agent.1", 12, 8),
        ("neighbour.0", N_NEIGHBOUR, 9),
        ("neighbour.1", 9, 5),
        ("path.0", N_PATH + 13, 16),
        ("path.1", 16, 10),
        ("head.0", 20, 11),
        ("head.1", 11, n_modes * MODE_OUTPUTS),
    ]
    .into_iter()
    .enumerate()
    {
        let values = |n: usize, seed: u32| numbers(n, seed).iter().map(|x| size * x).collect();
        tensors.push(tensor(&format!("{name}.weight"), &[n_out, n_in], values(n_out * n_in, 2 * k as u32)));
        tensors.push(tensor(&format!("{name}.bias"), &[n_out], values(n_out, 2 * k as u32 + 1)));
    }
    tensors
}

fn random_network() -> Network {
    Network::new(tensors(2, 0.4)).expect("a network")
}

/// A network that says the same of every path: for each mode its logit, speeds beside the present one at the knots
/// [m/s], lateral speeds [m/s]; standard deviations grow by 1 m/s.
fn constant_network(modes: &[(f32, [f32; N_KNOTS], [f32; N_KNOTS])]) -> Network {
    let mut tensors = tensors(modes.len(), 0.0);
    let bias = tensors.iter_mut().find(|tensor| tensor.name == "head.1.bias").expect("there");
    for (values, (logit, speeds, laterals)) in bias.values.chunks_exact_mut(MODE_OUTPUTS).zip(modes) {
        values[0] = *logit;
        for j in 0..N_KNOTS {
            values[1 + 4 * j..][..4].copy_from_slice(&[speeds[j], laterals[j], 0.0, 0.0]);
        }
    }
    Network::new(tensors).expect("a network")
}

fn predicted(network: Network, modes_max: usize, scene: &Scene, road: &RoadNetwork, n_steps: usize) -> Predictions {
    let predictor = Predictor::Neural(Neural { network: network.into(), modes_max });
    let predictions = predict(&predictor, scene, road, n_steps).expect("possible");
    predictions.validate().expect("numbers, probabilities that add up to 1, positive definite covariances");
    predictions
}

const NOTHING: [f32; N_KNOTS] = [0.0; N_KNOTS];

#[test]
fn a_network_that_adds_nothing_keeps_the_speed_and_settles_on_the_lane() {
    let now = scene(&[car(20.0, 0.8, 0.0, 10.0, 30, 0.1)], 0.1);
    let found = predicted(constant_network(&[(0.0, NOTHING, NOTHING)]), 1, &now, &straight_road(1), 60);
    for k in 0..60 {
        let time = 0.1 * (k + 1) as f64;
        assert!((found.x[k] - 20.0 - 10.0 * time).abs() < 1e-6, "x = {} m after {time} s", found.x[k]);
        assert!(
            (found.covariance_xx[k].sqrt() - if time < 3.0 { 0.05 + time } else { 3.05 * time / 3.0 }).abs() < 1e-6
        );
    }
    assert!(found.y[..40].windows(2).all(|pair| pair[1] < pair[0]), "{:?}", &found.y[..40]);
    assert!((found.y[0] - 0.8).abs() < 0.01 && found.y[40].abs() < 1e-6, "{} m and {} m", found.y[0], found.y[40]);
    assert!(found.velocity.iter().all(|v| (v - 10.0).abs() < 0.1));
    assert!(found.orientation[5] < -0.01 && found.orientation[59].abs() < 1e-6);
}

#[test]
fn a_braking_vehicle_never_goes_back_and_knots_are_met() {
    // 10 m/s, but 8 m/s on average until 0.5 s, and so on; then back, which is not possible.
    let speeds = [-2.0, -4.0, -6.0, -7.0, -9.0, -12.0];
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let found = predicted(constant_network(&[(0.0, speeds, NOTHING)]), 1, &now, &straight_road(1), 40);
    let after = |time: f64| found.x[(time / 0.1).round() as usize - 1] - 20.0;
    for (time, distance) in [(0.5, 4.0), (1.0, 6.0), (1.5, 6.0), (2.0, 6.0), (2.5, 6.0), (3.0, 6.0), (4.0, 6.0)] {
        assert!((after(time) - distance).abs() < 1e-6, "{} m after {time} s", after(time));
    }
    assert!(found.x.windows(2).all(|pair| pair[1] >= pair[0] - 1e-9));
    assert!(found.velocity.iter().all(|v| *v >= 0.0) && found.velocity[39] == 0.0);
}

#[test]
fn lateral_speeds_move_to_the_left_and_turn_the_vehicle() {
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let found = predicted(constant_network(&[(0.0, NOTHING, [0.5; N_KNOTS])]), 1, &now, &straight_road(1), N_STEPS);
    assert!((found.y[9] - 0.5).abs() < 1e-6 && (found.y[29] - 1.5).abs() < 1e-6);
    assert!((found.orientation[14] - 0.05).abs() < 2e-3, "0.5 m/s beside 10 m/s: {} rad", found.orientation[14]);
}

#[test]
fn within_the_dead_zone_a_vehicle_goes_on_as_expected() {
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let mut network = constant_network(&[(0.0, [-0.1, 0.2, 0.1, -0.2, 0.5, 0.5], [0.04; N_KNOTS])]);
    network.dead_zone = [0.2, 0.05];
    let found = predicted(network, 1, &now, &straight_road(1), N_STEPS);
    assert!((found.x[19] - 40.0).abs() < 1e-6 && found.y[29] == 0.0, "2 s at 10 m/s: {} m", found.x[19]);
    assert!((found.x[29] - 20.0 - 3.0 * 10.3).abs() < 1e-6, "0.5 m/s less 0.2 m/s: {} m", found.x[29]);
}

#[test]
fn every_branch_has_its_modes_and_the_most_probable_are_kept() {
    let now = scene(&[car(45.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let network = || constant_network(&[(0.0, NOTHING, NOTHING), (2.0, [-1.0; N_KNOTS], NOTHING)]);
    let all = predicted(network(), 8, &now, &fork(), N_STEPS);
    // Straight on, to the left, and the free path, which leads where the straight branch does.
    let share = 2.0_f64.exp() / (1.0 + 2.0_f64.exp()) / 3.0;
    let rest = 1.0 / 3.0 - share;
    for (p, expected) in all.probability.iter().zip([2.0 * share, share, 2.0 * rest, rest, 0.0, 0.0, 0.0, 0.0]) {
        assert!((p - expected).abs() < 1e-6, "{:?}", all.probability);
    }
    let last = |k: usize| all.offset(0, k) + N_STEPS - 1;
    assert!(all.y[last(0)].abs() < 0.01 && all.y[last(1)] > 10.0, "straight on and to the left");
    assert!((all.x[last(0)] - 72.0).abs() < 1e-3, "9 m/s");
    assert!(!all.valid[last(4)] && all.x[last(4)].is_nan(), "two modes on two branches");
    let few = predicted(network(), 2, &now, &fork(), N_STEPS);
    assert_eq!(few.n_modes, 2);
    assert!((few.probability[0] - 2.0 / 3.0).abs() < 1e-6, "made to add up to 1");
}

#[test]
fn the_same_drive_twice_is_one_mode_between_with_the_spread_of_both() {
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let drives = [(0.0, NOTHING, NOTHING), (0.0, [0.1; N_KNOTS], NOTHING)];
    let one = predicted(constant_network(&drives[..1]), 8, &now, &straight_road(1), N_STEPS);
    let both = predicted(constant_network(&drives), 8, &now, &straight_road(1), N_STEPS);
    assert!((both.probability[0] - 1.0).abs() < 1e-9 && both.probability[1] == 0.0);
    // 0.1 m/s are 0.3 m after 3 s.
    let ahead = both.x[N_STEPS - 1] - one.x[N_STEPS - 1];
    assert!((ahead - 0.15).abs() < 1e-6, "equally probable, equally certain: {ahead} m");
    let wider = both.covariance_xx[N_STEPS - 1] - one.covariance_xx[N_STEPS - 1];
    assert!((wider - 0.15 * 0.15).abs() < 1e-6, "{wider} m²");
}

#[test]
fn drives_that_differ_by_less_than_is_known_of_them_are_one() {
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let modes = |share: f64| {
        let mut network = constant_network(&[(0.0, NOTHING, NOTHING), (1.0, [0.5; N_KNOTS], NOTHING)]);
        network.merging.share = share;
        predicted(network, 8, &now, &straight_road(1), N_STEPS).probability.iter().filter(|p| **p > 0.0).count()
    };
    // 1.5 m apart after 3 s, where the standard deviation is 3 m.
    assert_eq!((modes(0.0), modes(0.4), modes(0.6)), (2, 2, 1));
}

#[test]
fn an_uneven_past_widens_the_spread_as_the_weights_say() {
    let states = |rough: f64| {
        let Track(kind, mut states) = car(60.0, 0.0, 0.0, 10.0, 30, 0.1);
        for (k, state) in states.iter_mut().enumerate() {
            state.as_mut().expect("present").y += rough * f64::from(u8::from(k % 4 < 2));
        }
        scene(&[Track(kind, states)], 0.1)
    };
    let spread = |rough: f64| {
        let mut network = constant_network(&[(0.0, NOTHING, NOTHING)]);
        network.motion_smoothness[1] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0];
        let found = predicted(network, 1, &states(rough), &straight_road(1), N_STEPS);
        (found.covariance_xx[9], found.covariance_yy[9])
    };
    let (exact, rough) = (spread(0.0), spread(0.05));
    assert!(rough.1 > 1.5 * exact.1, "across: {} and {} m²", exact.1, rough.1);
    assert!((rough.0 - exact.0).abs() < 0.1 * exact.0, "not along");
}

#[test]
fn who_stands_stays_exactly_or_goes() {
    let network = || constant_network(&[(1.0, [0.1; N_KNOTS], [0.05; N_KNOTS]), (0.0, [2.0; N_KNOTS], NOTHING)]);
    let now = scene(&[car(20.0, 0.7, 0.1, 0.0, 30, 0.1)], 0.1);
    let found = predicted(network(), 3, &now, &straight_road(1), N_STEPS);
    let stays = 1.0_f64.exp() / (1.0 + 1.0_f64.exp());
    assert!((found.probability[0] - stays).abs() < 1e-6, "{:?}", found.probability);
    for k in 0..N_STEPS {
        assert_eq!((found.x[k], found.y[k], found.orientation[k], found.velocity[k]), (20.0, 0.7, 0.1, 0.0));
        assert_eq!((found.covariance_xx[k], found.covariance_xy[k]), (0.02, 0.0));
    }
    let end = found.offset(0, 1) + N_STEPS - 1;
    assert!((found.x[end] - 26.0).abs() < 0.3, "the mode that goes is there: {} m", found.x[end]);
    // A rolling vehicle is not held.
    let rolling = scene(&[car(20.0, 0.0, 0.0, 1.0, 30, 0.1)], 0.1);
    let found = predicted(network(), 3, &rolling, &straight_road(1), N_STEPS);
    assert!((found.x[N_STEPS - 1] - 23.3).abs() < 0.01, "{} m", found.x[N_STEPS - 1]);
}

#[test]
fn the_horizon_and_the_time_step_are_free() {
    for (dt, n_steps) in [(0.1, 1), (0.2, 25), (0.04, 100), (1.0, 8)] {
        let now = scene(&[car(40.0, 0.3, 0.05, 8.0, (2.0 / dt) as usize, dt)], dt);
        let found = predicted(constant_network(&[(0.0, NOTHING, NOTHING)]), 1, &now, &straight_road(1), n_steps);
        let end = 40.0 + 8.0 * dt * n_steps as f64;
        assert!((found.x[n_steps - 1] - end).abs() < 0.1, "{} m, {end} m", found.x[n_steps - 1]);
    }
}

/// Traffic of all kinds around a fork.
fn crowd(n: usize) -> Scene {
    let values = numbers(4 * n, 7);
    let track = |i: usize| {
        let [x, y, turn, speed] = [0, 1, 2, 3].map(|k| f64::from(values[4 * i + k]));
        let Track(kind, states) = car(50.0 + 60.0 * x, 12.0 * y, 0.4 * turn, 6.0 + 7.0 * speed, i % 40, 0.1);
        let kinds = [kind, ParticipantKind::Pedestrian, kind, ParticipantKind::ParkedVehicle, ParticipantKind::Bicycle];
        Track(kinds[i % 5], states)
    };
    scene(&(0..n).map(track).collect::<Vec<Track>>(), 0.1)
}

fn bits(predictions: &Predictions) -> Vec<u64> {
    let fields = [&predictions.probability, &predictions.x, &predictions.y, &predictions.covariance_xy];
    fields.iter().flat_map(|field| field.iter().map(|value| value.to_bits())).collect()
}

#[test]
fn the_same_bits_come_out_on_any_number_of_threads() {
    let (now, road) = (crowd(120), fork());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| bits(&predicted(random_network(), 4, &now, &road, N_STEPS)))
    };
    let alone = on(1);
    assert!(alone == on(2) && alone == on(5));
}

#[test]
fn what_comes_out_for_a_vehicle_does_not_depend_on_the_batch() {
    let (now, road, network) = (crowd(60), fork(), random_network());
    let inputs = Inputs::of(&now, &road);
    let valid = inputs.path_valid();
    let all = network.forward(&inputs.agent, &inputs.neighbours, &inputs.paths, &valid);
    assert!(all.iter().any(|value| *value != 0.0));
    let part = |table: &[f32], i: usize, width: usize| table[i * width..(i + 1) * width].to_vec();
    for i in 0..inputs.rows.len() {
        let alone = network.forward(
            &part(&inputs.agent, i, N_AGENT),
            &part(&inputs.neighbours, i, N_NEIGHBOURS * N_NEIGHBOUR),
            &part(&inputs.paths, i, N_PATHS * N_PATH),
            &valid[i * N_PATHS..(i + 1) * N_PATHS],
        );
        assert_eq!(alone, part(&all, i, N_PATHS * network.n_outputs()));
    }
}

#[test]
fn a_thousand_vehicles_and_none_at_all_are_predicted() {
    let found = predicted(random_network(), 4, &crowd(1000), &fork(), N_STEPS);
    assert_eq!(found.ids.len(), 1000);
    assert!((0..1000).all(|row| found.valid[found.offset(row, 0)]), "every vehicle has a mode");
    let absent = Track(ParticipantKind::Car, vec![None]);
    assert!(predicted(random_network(), 4, &scene(&[absent], 0.1), &fork(), N_STEPS).ids.is_empty());
}

#[test]
fn pedestrians_and_reversing_vehicles_go_straight_on_and_static_ones_stay() {
    let at = |kind, velocity| Track(kind, car(50.0, 0.0, 0.5, velocity, 30, 0.1).1);
    let now = scene(
        &[
            at(ParticipantKind::Pedestrian, 1.5),
            at(ParticipantKind::ParkedVehicle, 0.0),
            at(ParticipantKind::Car, -2.0),
            Track(ParticipantKind::Car, vec![Some(State { x: f64::NAN, ..State::default() })]),
        ],
        0.1,
    );
    let found = predicted(random_network(), 4, &now, &straight_road(1), N_STEPS);
    let moved = |row: usize| {
        let end = found.offset(row, 0) + N_STEPS - 1;
        (found.x[end] - 50.0) / 0.5_f64.cos()
    };
    assert!((moved(0) - 4.5).abs() < 1e-9 && moved(1).abs() < 1e-9 && (moved(2) + 6.0).abs() < 1e-9);
    assert!((found.covariance_yy[29].sqrt() - 1.05).abs() < 1e-9, "0.15 m and 0.3 m/s");
    assert!(!found.valid[found.offset(3, 0)], "a state that is not a number has no future");
}

#[test]
fn the_wide_mode_has_the_moments_of_all_others_around_the_most_probable_one() {
    let modes = [(1.0, NOTHING, NOTHING), (0.0, [3.0; N_KNOTS], [0.4; N_KNOTS])];
    let scenes = [car(20.0, 0.0, 0.0, 10.0, 30, 0.1), car(80.0, 0.0, 0.0, 0.0, 30, 0.1)];
    let now = scene(&scenes, 0.1);
    let mut network = constant_network(&modes);
    let narrow = predicted(network.clone(), 2, &now, &straight_road(1), N_STEPS);
    network.tail = Some([Tail { probability: 0.1, factor: 3.0 }, Tail { probability: 0.02, factor: 8.0 }]);
    let found = predicted(network, 2, &now, &straight_road(1), N_STEPS);
    assert!((narrow.n_modes, found.n_modes) == (2, 3));
    for (row, (share, factor)) in [(0.1, 3.0), (0.02, 8.0)].into_iter().enumerate() {
        let p = &narrow.probability[2 * row..][..2];
        let with_tail = [p[0] * (1.0 - share), p[1] * (1.0 - share), share];
        let same = found.probability[3 * row..][..3].iter().zip(with_tail).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(same && p[1] > 0.2, "{:?}", found.probability);
        for step in [0, 11, 29] {
            let [a, b] = [0, 1].map(|mode| narrow.offset(row, mode) + step);
            let wide = found.offset(row, 2) + step;
            let (x, y) = (narrow.x[b] - narrow.x[a], narrow.y[b] - narrow.y[a]);
            let expected = [
                p[0] * narrow.covariance_xx[a] + p[1] * (narrow.covariance_xx[b] + x * x),
                p[0] * narrow.covariance_xy[a] + p[1] * (narrow.covariance_xy[b] + x * y),
                p[0] * narrow.covariance_yy[a] + p[1] * (narrow.covariance_yy[b] + y * y),
            ];
            let is = [found.covariance_xx[wide], found.covariance_xy[wide], found.covariance_yy[wide]];
            for (is, expected) in is.into_iter().zip(expected) {
                assert!((is - factor * factor * expected).abs() < 1e-9 * (1.0 + is.abs()), "{is} {expected}");
            }
            assert!((found.x[wide], found.y[wide]) == (narrow.x[a], narrow.y[a]) && found.valid[wide]);
        }
    }
}

#[test]
fn the_wide_mode_is_never_the_most_probable_one() {
    let modes: [_; 8] = std::array::from_fn(|k| (0.0, [2.0 * k as f32 - 8.0; N_KNOTS], NOTHING));
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    for (logit, share) in [(0.0, 1.0 / 9.0), (1.0, 0.12)] {
        let mut modes = modes;
        modes[4].0 = logit;
        let mut network = constant_network(&modes);
        network.tail = Some([Tail { probability: 0.12, factor: 6.0 }; 2]);
        let found = predicted(network, 8, &now, &straight_road(1), N_STEPS);
        assert_eq!(found.n_modes, 9);
        let p = &found.probability[..9];
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12 && p[8] <= p[0], "{p:?}");
        assert!((p[8] - share).abs() < 1e-9 && p[..8].iter().all(|narrow| *narrow > 0.05), "{p:?}");
        let [first, wide] = [0, 8].map(|mode| found.offset(0, mode) + N_STEPS - 1);
        assert!(found.x[wide] == found.x[first], "the drive of the most probable one");
    }
    let network = constant_network(&modes);
    let predictor = Predictor::Neural(Neural { network: network.into(), modes_max: 9 });
    assert!(predict(&predictor, &now, &straight_road(1), N_STEPS).is_err(), "more than can be asked for");
}

#[test]
fn weights_that_overflow_leave_vehicles_to_constant_velocity() {
    let network = Network::new(tensors(2, 1e30)).expect("finite weights");
    let now = scene(&[car(20.0, 0.0, 0.0, 10.0, 30, 0.1)], 0.1);
    let found = predicted(network, 2, &now, &straight_road(1), N_STEPS);
    assert!((found.x[N_STEPS - 1] - 50.0).abs() < 1e-9);
}

#[test]
fn tensors_that_do_not_fit_are_refused_by_their_name() {
    type Change = fn(&mut Vec<Tensor>);
    let cases: [(Change, &str); 11] = [
        (
            |t| t.push(tensor("decode.tail", &[4], vec![0.1, 0.5, 0.02, 8.0])),
            "tensor decode.tail must have probabilities below 0.5 and factors of 1 or more",
        ),
        (
            |t| t.push(tensor("calibration.temperature", &[1], vec![f32::INFINITY])),
            "tensor calibration.temperature has values that are not finite numbers",
        ),
        (|t| t.push(tensor("decode.merging", &[3], vec![0.4, -1.0, 0.5])), "tensor decode.merging has negative values"),
        (
            |t| t.push(tensor("decode.dead_zone", &[3], vec![0.1; 3])),
            "tensor decode.dead_zone has shape [3], (2) is expected",
        ),
        (|t| drop(t.remove(2)), "tensor agent.0.weight is missing"),
        (|t| t[2].shape = vec![12, 53], "tensor agent.0.weight has shape [12, 53], (1 to 4096, 62) is expected"),
        (|t| t[3].shape = vec![13], "tensor agent.0.bias has shape [13], (12) is expected"),
        (|t| t[4].values[0] = f32::NAN, "tensor agent.1.weight has values that are not finite numbers"),
        (|t| t[0].values[2] = 0.0, "tensor calibration.s has values that are not positive"),
        (|t| t.push(tensor("more", &[1], vec![1.0])), "unknown tensor more"),
        (
            |t| {
                let n = t.len();
                t[n - 2] = tensor("head.1.weight", &[26, 11], vec![0.0; 26 * 11]);
                t[n - 1] = tensor("head.1.bias", &[26], vec![0.0; 26]);
            },
            "tensor head.1.weight has 26 outputs, 25 for each of 1 to 8 modes are expected",
        ),
    ];
    for (change, text) in cases {
        let mut changed = tensors(2, 0.1);
        change(&mut changed);
        assert_eq!(Network::new(changed).expect_err(text), Error::invalid(text));
    }
}
