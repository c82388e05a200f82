//! Time to contact of footprints that go straight on.

use std::f64::consts::FRAC_PI_2;

use super::*;
use crate::criticality::straight::{StraightRequest, StraightTime, straight_times};
use crate::road::testing::{crossing, straight_road};

fn times(road: RoadNetwork, actors: &[Actor]) -> Vec<StraightTime> {
    let crossing = crossing_lanelets(&road, 0.3, 0.1);
    let request = StraightRequest { judged: vec![(0, 1.5)], crossing, horizon: 3.0, threads: 1 };
    straight_times(&traffic(road, actors), &request)
}

#[test]
fn a_gap_of_25_metres_behind_a_car_10_metres_per_second_slower_lasts_2_5_seconds() {
    let found = times(
        straight_road(1),
        &[Actor::going(1, state(20.0, 0.0, 0.0, 15.0), 3), Actor::going(2, state(50.0, 0.0, 0.0, 5.0), 3)],
    );
    assert!((found[0].time - 2.5).abs() < 1e-4 && found[0].partner == 2, "{found:?}");
    assert!((found[1].time - 2.4).abs() < 1e-4);
}

#[test]
fn a_car_from_the_side_counts_where_lanes_cross() {
    let cars =
        [Actor::going(1, state(-34.55, 0.0, 0.0, 10.0), 24), Actor::going(2, state(0.0, -34.55, FRAC_PI_2, 10.0), 24)];
    let found = times(crossing(), &cars);
    assert!((found[21].time - 1.005).abs() < 1e-4 && (found[22].time - 0.905).abs() < 1e-4, "{:?}", &found[20..]);
    assert_eq!(found[0].time, INF, "3.1 s are beyond the horizon");
}

#[test]
fn for_a_car_that_reverses_what_is_behind_it_is_ahead() {
    let reversing = Actor::going(1, state(50.0, 0.0, 0.0, -5.0), 1);
    let with = |x: f64, velocity: f64| {
        times(straight_road(1), &[reversing.clone(), Actor::going(2, state(x, 0.0, 0.0, velocity), 1)])[0]
    };
    // Bumpers are 10 m apart.
    let found = with(35.0, 0.0);
    assert!((found.time - 2.0).abs() < 1e-4 && found.partner == 2, "{found:?}");
    assert!((with(35.0, 5.0).time - 1.0).abs() < 1e-4, "both close in");
    assert_eq!(with(60.0, -12.0).time, INF, "a vehicle that comes after it has to brake");
}

#[test]
fn within_its_lane_only_what_is_ahead_counts_and_who_stands_has_no_contact() {
    let beside = |y: f64| {
        let merging = Actor::going(2, state(27.0, y + 3.5, -0.2, 15.0), 1);
        times(straight_road(2), &[Actor::going(1, state(27.0, y, 0.0, 15.0), 1), merging])[0].time
    };
    assert_eq!(beside(0.0), INF);
    assert!(beside(1.0) < 1.0, "across two lanes the neighbour counts, too");
    let standing = [Actor::going(1, state(20.0, 0.0, 0.0, 0.0), 1), Actor::going(2, state(30.0, 0.0, 3.1, 9.0), 1)];
    assert_eq!(times(straight_road(1), &standing)[0].time, INF);
}
