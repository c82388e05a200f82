//! Distance of and time to the closest encounter, and which participants count.

use std::f64::consts::PI;

use super::*;
use crate::road::testing::{crossing, parallel_lanes, straight_road};

#[test]
fn the_closest_encounter_is_the_earliest_one() {
    let own = Actor::car(1, (0..60).map(|k| state(k as f64, 0.0, 0.0, 10.0)));
    let other = Actor::car(2, (0..60).map(|_| state(50.05, 4.0, 0.0, 0.0)));
    let found = judged(&traffic(straight_road(2), &[own, other]), 1);
    near(at(&found, Measure::Dce, 0), 2.0, 1e-9);
    near(at(&found, Measure::Ttce, 0), 4.6, 1e-9);
    // The encounter is over after the last overlap along x.
    assert!(at(&found, Measure::Dce, 56) > 2.0);
}

#[test]
fn of_equal_encounters_the_earliest_one_counts_however_the_road_runs() {
    // Passing a standing car of the same length on the next lane: the distance is 2 m from step 46 to step 55.
    for turn in [0.1, 0.3, 1.0, 2.0, -2.5] {
        let place = |x: f64, y: f64| Point::from_angle(turn) * x + Point::from_angle(turn).left() * y;
        let there = |x: f64, y: f64, velocity: f64| state(place(x, y).x, place(x, y).y, turn, velocity);
        let (from, to) = (place(0.0, 0.0), place(200.0, 0.0));
        let road = open(vec![tapered_lane(1, &straight((from.x, from.y), (to.x, to.y)), 3.5, 3.5)]);
        let own = Actor::car(1, (0..60).map(|k| there(f64::from(k), 0.0, 10.0)));
        let other = Actor::car(2, (0..60).map(|_| there(50.05, 4.0, 0.0)));
        let found = judged(&traffic(road, &[own, other]), 1);
        near(found.series[Measure::Dce as usize].value[0], 2.0, 1e-9);
        near(found.series[Measure::Ttce as usize].value[0], 4.6, 1e-9);
        assert_eq!(found.extremes[Measure::Dce as usize][0].time_step, 46);
    }
}

#[test]
fn who_touches_counts_also_beyond_the_radius() {
    let long = |id, x: f64| Actor::car(id, [state(x, 0.0, 0.0, 0.0)]).shaped(Shape::rectangle(20.0, 2.5));
    let scene = traffic(straight_road(1), &[long(1, 50.0), long(2, 69.0)]);
    let mut wanted = request(&[1]);
    wanted.settings.radius = 15.0;
    let found = evaluate(&scene, &wanted).expect("valid");
    assert_eq!((at(&found, Measure::Dce, 0), at(&found, Measure::Ttc, 0)), (0.0, 0.0));
    let apart = traffic(straight_road(1), &[long(1, 50.0), long(2, 71.0)]);
    assert_eq!(at(&evaluate(&apart, &wanted).expect("valid"), Measure::Dce, 0), INF);
}

#[test]
fn crossing_cars_meet_when_they_are_nearest() {
    let found = judged(&traffic(crossing(), &crossing_cars(-64.55, 90)), 1);
    near(at(&found, Measure::Dce, 0), 16.275902, 1e-6);
    near(at(&found, Measure::Ttce, 0), 5.0, 1e-9);
    let dce = &found.extremes[Measure::Dce as usize][0];
    assert_eq!((dce.time_step, dce.partner), (50, 2));
}

#[test]
fn a_crash_is_a_distance_of_zero_at_the_first_contact() {
    let found = judged(&traffic(crossing(), &crossing_cars(-34.55, 90)), 1);
    near(at(&found, Measure::Dce, 0), 0.0, 0.0);
    near(at(&found, Measure::Ttce, 0), 3.2, 1e-9);
    for column in 32..=38 {
        for measure in [Measure::Hw, Measure::Thw, Measure::Ttc, Measure::Dce] {
            assert_eq!(at(&found, measure, column), 0.0, "{measure:?} at {column}");
        }
        assert_eq!(at(&found, Measure::Btn, column), 0.0);
    }
    assert_eq!(at(&found, Measure::Ttc, 31), INF);
    assert_eq!(extreme(&found, Measure::Ttce), 0.0);
}

#[test]
fn a_contact_within_a_step_counts_although_nothing_touches_at_its_end() {
    let mut wanted = request(&[1]);
    wanted.contacts = vec![(2, 1, 7)];
    let scene = traffic(crossing(), &crossing_cars(-64.55, 10));
    let found = evaluate(&scene, &wanted).expect("valid");
    assert_eq!((at(&found, Measure::Dce, 0), at(&found, Measure::Ttc, 7)), (0.0, 0.0));
    near(at(&found, Measure::Ttce, 0), 0.7, 1e-12);
}

/// Two lanes of 3.5 m side by side, the left one in the opposite direction.
fn two_ways() -> RoadNetwork {
    let mut lanes = parallel_lanes(2, 200.0);
    let lane = &mut lanes[1];
    lane.left.reverse();
    lane.right.reverse();
    std::mem::swap(&mut lane.left, &mut lane.right);
    open(lanes)
}

fn oncoming(y: f64) -> [Actor; 2] {
    [Actor::going(1, state(40.0, 0.0, 0.0, 10.0), 80), Actor::going(2, state(160.0, y, PI, 10.0), 80)]
}

#[test]
fn oncoming_traffic_counts_only_where_the_ways_meet() {
    let beside = traffic(two_ways(), &oncoming(3.5));
    let found = judged(&beside, 1);
    assert_eq!((at(&found, Measure::Dce, 0), at(&found, Measure::Ttce, 0)), (INF, INF));
    let mut wanted = request(&[1]);
    wanted.settings.oncoming_filter = false;
    near(at(&evaluate(&beside, &wanted).expect("valid"), Measure::Dce, 0), 1.5, 1e-9);
    // Half a car on my side of the line.
    let found = judged(&traffic(two_ways(), &oncoming(2.2)), 1);
    near(at(&found, Measure::Dce, 0), 0.2, 1e-9);
    // Wholly on my lane: a leader, too.
    let found = judged(&traffic(two_ways(), &oncoming(0.0)), 1);
    near(at(&found, Measure::Ttc, 20), (80.0 - 5.0) / 20.0, 1e-9);
    assert_eq!(at(&found, Measure::Dce, 0), 0.0);
}

#[test]
fn oncoming_traffic_counts_for_a_vehicle_on_its_lane() {
    let actors = [Actor::going(1, state(40.0, 1.8, 0.0, 10.0), 60), Actor::going(2, state(160.0, 4.9, PI, 10.0), 60)];
    near(at(&judged(&traffic(two_ways(), &actors), 1), Measure::Dce, 0), 1.1, 1e-9);
}

#[test]
fn oncoming_traffic_whose_way_crosses_mine_counts() {
    // The other one turns left across my lane later on: lanelets 4 (its lane), 5 (the turn).
    let lane = |id, points: &[Point], next: &[i64]| with_successors(tapered_lane(id, points, 3.5, 3.5), next);
    let turn: Vec<Point> = (0..=20)
        .map(|i| Point::new(10.0, -3.0) + Point::from_angle(PI / 2.0 + PI / 2.0 * f64::from(i) / 20.0) * 6.5)
        .collect();
    let road = open(vec![
        lane(1, &straight((-100.0, 0.0), (100.0, 0.0)), &[]),
        lane(4, &straight((100.0, 3.5), (10.0, 3.5)), &[5, 7]),
        lane(5, &turn, &[6]),
        lane(6, &straight((3.5, -3.0), (3.5, -60.0)), &[]),
        lane(7, &straight((10.0, 3.5), (-100.0, 3.5)), &[]),
    ]);
    let waits = state(15.0, 3.5, PI, 1.0);
    let turns = |n: usize| {
        (0..n).map(move |i| {
            let angle = PI / 2.0 + PI / 2.0 * i as f64 / (n - 1) as f64;
            let p = Point::new(10.0, -3.0) + Point::from_angle(angle) * 6.5;
            state(p.x, p.y, angle + PI / 2.0, 5.0)
        })
    };
    let own = Actor::car(1, (0..30).map(|_| state(-30.0, 0.0, 0.0, 0.0)));
    let other = Actor::car(2, (0..10).map(|_| waits).chain(turns(20)));
    let found = judged(&traffic(road.clone(), &[own.clone(), other]), 1);
    assert!(at(&found, Measure::Dce, 0).is_finite(), "it will turn across my lane");
    assert_eq!(found.series[Measure::Dce as usize].partner[0], 2);
    let stays = Actor::going(2, state(60.0, 3.5, PI, 10.0), 30);
    assert_eq!(at(&judged(&traffic(road, &[own, stays]), 1), Measure::Dce, 0), INF);
}

#[test]
fn who_is_too_far_away_or_gone_does_not_count() {
    let own = Actor::car(1, (0..3).map(|_| state(20.0, 0.0, 0.0, 0.0)));
    let far = Actor::car(2, (0..3).map(|_| state(120.0, 0.0, 0.0, 0.0)));
    let mut late = Actor::car(3, (0..3).map(|_| state(60.0, 0.0, 0.0, 0.0)));
    late.states[0] = None;
    late.states[2] = None;
    let found = judged(&traffic(straight_road(1), &[own, far, late]), 1);
    near(at(&found, Measure::Dce, 0), 35.0, 1e-9);
    near(at(&found, Measure::Ttce, 0), 0.1, 1e-12);
    assert_eq!(at(&found, Measure::Dce, 2), INF, "exactly 100 m is outside");
    assert_eq!((at(&found, Measure::Hw, 0), at(&found, Measure::Hw, 2)), (INF, INF));
    near(at(&found, Measure::Hw, 1), 35.0, 1e-9);
}

#[test]
fn static_obstacles_and_pedestrians_count() {
    let own = Actor::going(1, state(20.0, 0.0, 0.0, 10.0), 20);
    let mut parked = Actor::car(2, (0..20).map(|_| state(60.0, 0.0, 0.0, 3.0)));
    parked.is_static = true;
    let walker = Actor::car(3, (0..20).map(|k| state(30.0, 6.0 - 0.1 * f64::from(k), -PI / 2.0, 1.0)))
        .shaped(Shape::circle(0.3));
    let found = judged(&traffic(straight_road(2), &[own, parked, walker]), 1);
    near(at(&found, Measure::Ttc, 0), 3.5, 1e-9);
    assert_eq!(found.series[Measure::Dce as usize].partner[0], 3);
}
