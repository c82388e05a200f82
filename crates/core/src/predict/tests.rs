//! What native predictors expect in small worlds.

use std::borrow::Cow;
use std::sync::Arc;

use super::{LaneFollowing, Predictor, Spread, completed, predict};
use crate::geometry::Point;
use crate::geometry::shape::Shape;
use crate::road::testing::{closed, lane, straight, with_successors};
use crate::road::{LaneletInput, RoadNetwork};
use crate::scene::{Participants, Scene};
use crate::trajectory::{Predictions, State, States};
use crate::vehicle::ParticipantKind;

const DT: f64 = 0.1;
const N_STEPS: usize = 30;

/// Cars with these states now, ids from 1, without a past.
fn scene(states: &[State]) -> Scene {
    let n = states.len();
    let ids: Vec<i64> = (1..=n as i64).collect();
    let mut past = States::absent(ids.clone(), 0, 1);
    for (row, state) in states.iter().enumerate() {
        past.set(row, 0, state);
    }
    let participants = Participants {
        ids,
        kind: vec![ParticipantKind::Car; n],
        shape: vec![Shape::rectangle(4.5, 1.8); n],
        is_static: vec![false; n],
        is_agent: vec![true; n],
        ..Participants::default()
    };
    let turns = vec![None; n];
    Scene { time_step: 0, dt: DT, participants: Arc::new(participants), present: (0..n).collect(), turns, past }
}

fn at(x: f64, y: f64, velocity: f64) -> State {
    State { x, y, velocity, ..State::default() }
}

fn lane_following(states: &[State], road: &RoadNetwork) -> Predictions {
    predict(&Predictor::LaneFollowing(LaneFollowing::default()), &scene(states), road, N_STEPS).expect("possible")
}

fn probabilities(predictions: &Predictions, row: usize) -> &[f64] {
    &predictions.probability[row * predictions.n_modes..(row + 1) * predictions.n_modes]
}

/// Lanelet 1 from x = 0 to 50 m, then 2 straight on and 3 to the left.
fn fork() -> RoadNetwork {
    let left = [(50.0, 0.0), (60.0, 1.0), (70.0, 4.0), (80.0, 9.0), (110.0, 30.0)].map(|(x, y)| Point::new(x, y));
    closed(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 3]),
        lane(2, &straight((50.0, 0.0), (150.0, 0.0))),
        lane(3, &left),
    ])
}

fn one_after_the_other() -> Vec<LaneletInput> {
    vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]),
        lane(2, &straight((50.0, 0.0), (150.0, 0.0))),
    ]
}

#[test]
fn a_lane_in_two_lanelets_is_one_mode_wherever_the_car_is() {
    let road = closed(one_after_the_other());
    for x in [20.0, 48.0, 49.9, 50.0, 50.1, 52.0, 80.0] {
        let predictions = lane_following(&[at(x, 0.0, 10.0)], &road);
        assert_eq!(probabilities(&predictions, 0), [1.0, 0.0, 0.0], "at x = {x} m");
        let last = predictions.offset(0, 0) + N_STEPS - 1;
        assert!((predictions.x[last] - (x + 30.0)).abs() < 1e-6, "{} m", predictions.x[last]);
    }
}

#[test]
fn every_branch_of_a_fork_within_reach_is_a_mode() {
    let road = fork();
    assert_eq!(probabilities(&lane_following(&[at(40.0, 0.0, 10.0)], &road), 0), [0.5, 0.5, 0.0]);
    // 10 m/s for 3 s and a reserve of 10 m do not reach the fork from x = 5 m.
    assert_eq!(probabilities(&lane_following(&[at(5.0, 0.0, 10.0)], &road), 0), [1.0, 0.0, 0.0]);
}

#[test]
fn a_car_too_fast_for_a_bend_is_expected_to_go_straight_on() {
    // A bend of 90 degrees with a radius of 10 m, which takes 5.5 m/s at 3 m/s².
    let angles = (0..=9).map(|i| f64::from(i) / 9.0 * std::f64::consts::FRAC_PI_2);
    let bend: Vec<Point> = angles.map(|a| Point::new(50.0 + 10.0 * a.sin(), 10.0 - 10.0 * a.cos())).collect();
    let road = closed(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 3]),
        lane(2, &bend),
        lane(3, &straight((50.0, 0.0), (150.0, 0.0))),
    ]);
    // From 12 m/s at 2 m/s²: 25 m before the bend it gets nearly slow enough (4.4 m/s² across), 10 m before it does not (10.4).
    let left_bend = |x: f64| {
        let predictions = lane_following(&[at(x, 0.0, 12.0)], &road);
        let last = |mode: usize| predictions.y[predictions.offset(0, mode) + N_STEPS - 1];
        let mode = (0..2).max_by(|a, b| last(*a).total_cmp(&last(*b))).expect("two");
        (mode, probabilities(&predictions, 0)[mode])
    };
    let (_, early) = left_bend(25.0);
    let (mode, late) = left_bend(40.0);
    assert!(early > 0.3, "{early}");
    assert_eq!(mode, 1, "the most probable mode is the first one");
    assert!(late < 0.05, "{late}");
}

#[test]
fn every_predictor_lets_a_standing_vehicle_stand() {
    let (road, standing) = (fork(), at(40.0, 0.2, 0.1));
    for predictor in
        [Predictor::ConstantVelocity(Spread::default()), Predictor::LaneFollowing(LaneFollowing::default())]
    {
        let predictions = predict(&predictor, &scene(&[standing]), &road, N_STEPS).expect("possible");
        let row = predictions.offset(0, 0)..predictions.offset(0, 0) + N_STEPS;
        assert!(predictions.x[row.clone()].iter().all(|x| *x == 40.0));
        assert!(predictions.y[row].iter().all(|y| *y == 0.2));
    }
}

#[test]
fn constant_velocity_goes_straight_on_with_a_spread_that_grows_along_the_heading() {
    let spread = Spread { position_sigma: 0.1, acceleration_sigma: 1.0, lateral_rate: 0.2 };
    let predictor = Predictor::ConstantVelocity(spread);
    let predictions = predict(&predictor, &scene(&[at(0.0, 0.0, 10.0)]), &fork(), N_STEPS).expect("possible");
    let last = N_STEPS - 1;
    assert!((predictions.x[last] - 30.0).abs() < 1e-9);
    // After 3 s: along 0.1² + (0.5 · 1 · 3²)², across (0.1 + 0.2 · 3)².
    assert!((predictions.covariance_xx[last] - 20.26).abs() < 1e-9);
    assert!((predictions.covariance_yy[last] - 0.49).abs() < 1e-9);
    assert!(predictions.covariance_xy[last].abs() < 1e-9);
}

#[test]
fn an_offset_from_the_lane_is_given_up_and_the_prediction_starts_at_the_car() {
    let predictions = lane_following(&[at(20.0, 0.6, 10.0)], &closed(one_after_the_other()));
    let y = &predictions.y[..N_STEPS];
    assert!((y[0] - 0.6).abs() < 0.01, "{} m after 0.1 s", y[0]);
    assert!(y.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12), "back to the lane: {y:?}");
    assert!(y[N_STEPS - 1] < 0.1, "{} m after 3 s", y[N_STEPS - 1]);
}

#[test]
fn who_is_missing_in_a_table_from_outside_goes_straight_on() {
    let now = scene(&[at(0.0, 0.0, 10.0), at(20.0, 0.0, 0.0)]);
    let absent = Predictions::empty(0, Vec::new(), 2, N_STEPS);
    let all = completed(&absent, &now);
    assert!(matches!(completed(&all, &now), Cow::Borrowed(_)), "what is complete is not copied");
    assert_eq!(all.ids, [1, 2]);
    assert!((all.x[all.offset(0, 0) + 9] - 10.0).abs() < 1e-9, "1 s at 10 m/s");
    assert!((all.x[all.offset(1, 0) + 9] - 20.0).abs() < 1e-9, "it stands");
    assert_eq!(all.probability, [1.0, 0.0, 1.0, 0.0]);
}

#[test]
fn impossible_horizons_and_numbers_of_modes_are_refused() {
    let (road, now) = (fork(), scene(&[at(0.0, 0.0, 10.0)]));
    let many = Predictor::LaneFollowing(LaneFollowing { modes_max: 9, ..LaneFollowing::default() });
    assert!(predict(&many, &now, &road, N_STEPS).is_err());
    assert!(predict(&Predictor::ConstantVelocity(Spread::default()), &now, &road, 0).is_err());
}
