//! Runs of one step, late and lost vehicles, vehicles off the road, impossible requests.

use super::*;
use crate::road::testing::straight_road;

#[test]
fn one_time_step_is_enough() {
    let found = judged(&traffic(straight_road(1), &[Actor::car(1, [state(20.0, 0.0, 0.0, 10.0)])]), 1);
    for (measure, expected) in [
        (Measure::Hw, INF),
        (Measure::Ttc, INF),
        (Measure::Tet, 0.0),
        (Measure::Dce, INF),
        (Measure::Et, INF),
        (Measure::Pet, INF),
        (Measure::Btn, 0.0),
        (Measure::Stn, 0.0),
        (Measure::Psd, INF),
    ] {
        assert_eq!(extreme(&found, measure), expected, "{measure:?}");
    }
    near(extreme(&found, Measure::Msd), 100.0 / 23.0, 1e-12);
}

#[test]
fn before_it_enters_and_after_it_is_gone_nothing_is_known() {
    let mut own = Actor::going(1, state(20.0, 0.0, 0.0, 10.0), 5);
    own.states[0] = None;
    own.states[4] = None;
    let found = judged(&traffic(straight_road(1), &[own, Actor::going(2, state(40.0, 0.0, 0.0, 5.0), 5)]), 1);
    for (measure, _) in Measure::ALL {
        for column in [0, 4] {
            assert!(at(&found, measure, column).is_nan(), "{measure:?}");
            assert_eq!(found.series[measure as usize].partner[column], -1);
        }
    }
    assert_eq!(found.extremes[Measure::Ttc as usize][0].time_step, 3);
}

#[test]
fn a_crash_at_the_first_step_is_seen() {
    let found = judged(
        &traffic(
            straight_road(1),
            &[Actor::car(1, [state(20.0, 0.0, 0.0, 10.0)]), Actor::car(2, [state(22.0, 0.0, 0.0, 0.0)])],
        ),
        1,
    );
    for measure in [Measure::Hw, Measure::Thw, Measure::Ttc, Measure::Dce, Measure::Ttce] {
        assert_eq!((extreme(&found, measure), found.extremes[measure as usize][0].partner), (0.0, 2), "{measure:?}");
    }
    assert_eq!(extreme(&found, Measure::Tet), 1.0);
}

#[test]
fn off_the_road_there_is_no_path_but_a_distance() {
    let found = judged(
        &traffic(
            straight_road(1),
            &[Actor::car(1, [state(20.0, 30.0, 0.0, 10.0)]), Actor::car(2, [state(40.0, 30.0, 0.0, 0.0)])],
        ),
        1,
    );
    for measure in [Measure::Hw, Measure::Thw, Measure::Ttc, Measure::ALongReq, Measure::Btn, Measure::Stn] {
        assert!(extreme(&found, measure).is_nan(), "{measure:?}");
    }
    assert_eq!((extreme(&found, Measure::Dce), extreme(&found, Measure::Tet)), (15.0, 0.0));
}

#[test]
fn states_that_are_no_numbers_are_refused_with_participant_and_time_step() {
    let mut bad = state(20.0, 0.0, 0.0, 10.0);
    bad.orientation = f64::NAN;
    let error = try_traffic(straight_road(1), &[Actor::car(7, [state(0.0, 0.0, 0.0, 0.0), bad])]).expect_err("refused");
    assert_eq!(error.to_string(), "participant 7 has a state that is not a number at time step 1, or beyond 1e9");
}

#[test]
fn impossible_requests_are_refused_with_a_reason() {
    let mut parked = Actor::car(2, [state(60.0, 0.0, 0.0, 0.0)]);
    parked.is_static = true;
    let mut absent = Actor::car(3, [state(60.0, 0.0, 0.0, 0.0)]);
    absent.states[0] = None;
    let scene = traffic(straight_road(1), &[Actor::car(1, [state(20.0, 0.0, 0.0, 10.0)]), parked, absent]);
    let refused = |change: &dyn Fn(&mut Request)| {
        let mut wanted = request(&[1]);
        change(&mut wanted);
        evaluate(&scene, &wanted).expect_err("refused").to_string()
    };
    assert_eq!(refused(&|r| r.ids = vec![9]), "there is no participant with id 9");
    assert_eq!(refused(&|r| r.ids = vec![2]), "participant 2 is static: there is nothing to evaluate");
    assert_eq!(refused(&|r| r.ids = vec![3]), "participant 3 is never there: there is nothing to evaluate");
    assert_eq!(refused(&|r| r.ids = vec![1, 1]), "participant 1 is requested twice");
    assert_eq!(refused(&|r| r.threads = 0), "threads must be at least 1 and at most 1024, not 0");
    assert!(refused(&|r| r.settings.radius = -1.0).contains("radius must be positive"));
    assert!(refused(&|r| r.settings.opposite_angle = 3.2).contains("opposite_angle must be at most pi"));
    assert!(refused(&|r| r.settings.erosion = f64::NAN).contains("erosion"));
    assert!(refused(&|r| r.deceleration = vec![0.0]).contains("participant 1 must be positive"));
    assert!(refused(&|r| r.deceleration = vec![1.0, 2.0]).contains("2 available decelerations"));
    assert!(refused(&|r| r.contacts = vec![(1, 2, 5)]).contains("time step 5 is outside"));
}
