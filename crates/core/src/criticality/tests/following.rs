//! Headway, time headway, time to collision, brake and steer threat.

use super::*;
use crate::road::testing::{arc, fork, lane, parallel_lanes, straight_road};

fn pair(own: State, other: State) -> Traffic {
    traffic(straight_road(2), &[Actor::car(1, [own]), Actor::car(2, [other])])
}

#[test]
fn headway_is_the_gap_along_the_path() {
    for (turn, expected) in [(0.0, 30.0), (0.3, 35.0 - 2.5 - (2.5 * 0.3_f64.cos() + 0.3_f64.sin()))] {
        let found = judged(&pair(state(50.0, 0.0, 0.0, 10.0), state(85.0, 0.0, turn, 10.0)), 1);
        near(at(&found, Measure::Hw, 0), expected, 1e-9);
    }
    near(35.0 - 2.5 - (2.5 * 0.3_f64.cos() + 0.3_f64.sin()), 29.816139, 1e-6);
}

#[test]
fn headway_follows_a_curve() {
    let on = |angle: f64| {
        let p = Point::from_angle(angle) * 50.0;
        state(p.x, p.y, angle + std::f64::consts::FRAC_PI_2, 10.0)
    };
    let road = open(vec![lane(1, &arc((0.0, 0.0), 50.0, 0.0, 2.0))]);
    let found = judged(&traffic(road, &[Actor::car(1, [on(0.5)]), Actor::car(2, [on(1.3)])]), 1);
    near(at(&found, Measure::Hw, 0), 35.0, 1e-3);
}

#[test]
fn the_nearest_vehicle_on_any_branch_counts_with_its_path() {
    let branch = |angle: f64| Point::new(50.0, 20.0) + Point::from_angle(angle - std::f64::consts::FRAC_PI_2) * 20.0;
    let on_branch = branch(0.5);
    let actors = [
        Actor::car(1, [state(30.0, 0.0, 0.0, 10.0)]),
        Actor::car(2, [state(65.0, 0.0, 0.0, 10.0)]),
        Actor::car(3, [state(on_branch.x, on_branch.y, 0.5, 10.0)]),
    ];
    let found = judged(&traffic(fork(), &actors), 1);
    // 20 m to the fork, 10 m of arc, one car length.
    near(at(&found, Measure::Hw, 0), 25.0, 5e-3);
    let hw = &found.extremes[Measure::Hw as usize][0];
    assert_eq!((hw.partner, &found.ways[hw.way as usize].lanelets), (3, &vec![1, 3]));
    let without = judged(&traffic(fork(), &actors[..2]), 1);
    near(at(&without, Measure::Hw, 0), 30.0, 1e-9);
}

#[test]
fn a_leader_after_many_lanelets_and_after_a_lane_change_is_found() {
    let mut lanes = Vec::new();
    for i in 0..5_i64 {
        for (offset, y) in [(0, 0.0), (100, 3.5)] {
            let (from, to) = (60.0 * i as f64, 60.0 * (i + 1) as f64);
            let next = if i < 4 { vec![i + 2 + offset] } else { vec![] };
            lanes.push(with_successors(lane(i + 1 + offset, &straight((from, y), (to, y))), &next));
        }
    }
    let along = |x: f64, y: f64| state(x, y, 0.0, 10.0);
    let own = Actor::car(1, [along(10.0, 0.0), along(170.0, 0.0), along(230.0, 3.5)]);
    let other = Actor::car(2, [along(35.0, 0.0), along(195.0, 0.0), along(255.0, 3.5)]);
    let old_lane = Actor::car(3, [along(90.0, 3.5), along(290.0, 3.5), along(240.0, 0.0)]);
    let found = judged(&traffic(open(lanes), &[own, other, old_lane]), 1);
    for column in 0..3 {
        near(at(&found, Measure::Hw, column), 20.0, 1e-9);
    }
}

#[test]
fn time_headway_divides_by_the_own_speed_or_waits_for_the_recording() {
    let own = Actor::going(1, state(20.0, 0.0, 0.0, 20.0), 40);
    let other = Actor::going(2, state(55.5, 0.0, 0.0, 20.0), 40);
    let scene = traffic(straight_road(1), &[own, other]);
    near(at(&judged(&scene, 1), Measure::Thw, 0), 1.525, 1e-9);
    let mut wanted = request(&[1]);
    wanted.settings.thw_mode = ThwMode::Recorded;
    let recorded = evaluate(&scene, &wanted).expect("a test's request");
    near(at(&recorded, Measure::Thw, 0), 1.6, 1e-9);
    // The recording ends before the place is reached.
    assert_eq!(at(&recorded, Measure::Thw, 30), INF);
    let standing = judged(&pair(state(50.0, 0.0, 0.0, 0.0), state(85.0, 0.0, 0.0, 0.0)), 1);
    assert_eq!(at(&standing, Measure::Thw, 0), INF);
    assert_eq!(at(&standing, Measure::Ttc, 0), INF);
    assert_eq!(at(&standing, Measure::Msd, 0), 0.0);
}

#[test]
fn time_to_collision_uses_accelerations_and_oncoming_speeds() {
    let braking = State { acceleration: -2.0, ..state(85.0, 0.0, 0.0, 10.0) };
    let found = judged(&pair(state(50.0, 0.0, 0.0, 20.0), braking), 1);
    near(at(&found, Measure::Ttc, 0), 2.416198, 1e-6);
    near(at(&found, Measure::ALongReq, 0), -2.0 - 5.0 / 3.0, 1e-9);
    near(at(&found, Measure::Btn, 0), 0.318841, 1e-6);
    // On the own lane, against it.
    let oncoming = state(85.0, 0.0, std::f64::consts::PI, 10.0);
    let found = judged(&pair(state(50.0, 0.0, 0.0, 10.0), oncoming), 1);
    near(at(&found, Measure::Ttc, 0), 1.5, 1e-9);
}

#[test]
fn who_is_behind_or_on_another_lane_is_no_leader() {
    for other in [state(15.0, 0.0, 0.0, 30.0), state(85.0, 3.5, 0.0, 0.0), state(49.0, 3.5, 0.0, 0.0)] {
        let found = judged(&pair(state(50.0, 0.0, 0.0, 10.0), other), 1);
        for (measure, expected) in
            [(Measure::Hw, INF), (Measure::Ttc, INF), (Measure::Btn, 0.0), (Measure::Stn, 0.0), (Measure::Tet, 0.0)]
        {
            assert_eq!(at(&found, measure, 0), expected, "{measure:?} {other:?}");
        }
    }
}

#[test]
fn who_reaches_into_the_lane_is_a_leader_if_footprints_decide() {
    // The centre is on the left lane, 0.45 m of the body on the right one: 0.15 m beyond the erosion.
    let scene = pair(state(50.0, 0.0, 0.0, 10.0), state(85.0, 2.3, 0.0, 5.0));
    assert_eq!(at(&judged(&scene, 1), Measure::Hw, 0), INF);
    let mut wanted = request(&[1]);
    wanted.settings.lead_membership = LeadMembership::Footprint;
    near(at(&evaluate(&scene, &wanted).expect("a test's request"), Measure::Hw, 0), 30.0, 1e-9);
}

#[test]
fn steering_past_takes_the_easier_side_with_the_offset_at_the_collision() {
    for (offset, drift, expected) in
        [(0.0, 0.0, 4.0 / 9.0), (0.8, 0.0, 2.4 / 9.0), (-0.8, 0.0, 2.4 / 9.0), (0.0, 0.1, 0.0)]
    {
        let mut other = state(85.0, offset, 0.0, 10.0);
        let mut gap = 30.0;
        if drift > 0.0 {
            // Turned by 0.1: narrower gap, wider body, moves to the left.
            other.orientation = drift;
            other.velocity = 10.0 / drift.cos();
            gap = 35.0 - 2.5 - (2.5 * drift.cos() + drift.sin());
        }
        let found = judged(&pair(state(50.0, 0.0, 0.0, 20.0), other), 1);
        let ttc: f64 = gap / 10.0;
        let y = offset + 10.0 * drift.tan() * ttc;
        let w = 1.0 + 2.5 * drift.sin() + drift.cos();
        let by_hand = if y.abs() >= w { 0.0 } else { 2.0 * (w - y.abs()) / (ttc * ttc) };
        near(at(&found, Measure::ALatReq, 0), by_hand, 1e-9);
        near(at(&found, Measure::Stn, 0), by_hand / 8.0, 1e-9);
        if drift == 0.0 {
            near(by_hand, expected, 1e-9);
        }
    }
}

#[test]
fn the_available_deceleration_can_be_given_per_vehicle() {
    let scene = pair(state(50.0, 0.0, 0.0, 20.0), state(85.0, 0.0, 0.0, 10.0));
    let mut wanted = request(&[1]);
    near(at(&evaluate(&scene, &wanted).expect("valid"), Measure::Btn, 0), 0.144928, 1e-6);
    near(at(&evaluate(&scene, &wanted).expect("valid"), Measure::Msd, 0), 400.0 / 23.0, 1e-9);
    wanted.deceleration = vec![5.0];
    near(at(&evaluate(&scene, &wanted).expect("valid"), Measure::Btn, 0), 1.0 / 3.0, 1e-9);
    near(at(&evaluate(&scene, &wanted).expect("valid"), Measure::Msd, 0), 40.0, 1e-9);
}

#[test]
fn exposure_sums_the_time_below_the_threshold() {
    let own = Actor::going(1, state(20.0, 0.0, 0.0, 20.0), 26);
    let other = Actor::going(2, state(55.05, 0.0, 0.0, 10.0), 26);
    let found = judged(&traffic(straight_road(1), &[own, other]), 1);
    for column in 0..26 {
        near(at(&found, Measure::Ttc, column), 3.005 - 0.1 * column as f64, 1e-9);
    }
    near(extreme(&found, Measure::Tet), 15.0 / 26.0, 1e-9);
    near(found.exposure[0].tet_seconds, 1.5, 1e-9);
    near(extreme(&found, Measure::Tit), 1.1925, 1e-9);
    near(found.exposure[0].tit_mean, 1.1925 / 2.6, 1e-9);
    // The running sum is what is left.
    near(at(&found, Measure::Tet, 25), 1.0 / 26.0, 1e-9);
}

#[test]
fn accelerations_that_are_not_recorded_are_derived_from_the_speeds() {
    let start = State { acceleration: -2.0, ..state(85.0, 0.0, 0.0, 20.0) };
    let mut other = Actor::going(2, start, 3);
    let known = judged(&traffic(straight_road(1), &[Actor::car(1, [state(50.0, 0.0, 0.0, 20.0)]), other.clone()]), 1);
    for state in other.states.iter_mut().flatten() {
        state.acceleration = f64::NAN;
    }
    let derived = judged(&traffic(straight_road(1), &[Actor::car(1, [state(50.0, 0.0, 0.0, 20.0)]), other]), 1);
    near(at(&derived, Measure::Ttc, 0), 30.0_f64.sqrt(), 1e-9);
    near(at(&derived, Measure::Ttc, 0), at(&known, Measure::Ttc, 0), 1e-9);
}

#[test]
fn circles_and_polygons_reach_as_far_as_they_do() {
    let wedge =
        Shape::polygon(&[(3.0, 0.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(x, y)| Point::new(x, y))).expect("a wedge");
    for (shape, turn, expected) in [
        (Shape::circle(1.0), 0.7, 35.0 - 2.5 - 1.0),
        (wedge.clone(), 0.0, 35.0 - 2.5 - 1.0),
        (wedge, std::f64::consts::PI, 35.0 - 2.5 - 3.0),
    ] {
        let other = Actor::car(2, [state(85.0, 0.0, turn, 0.0)]).shaped(shape);
        let scene = traffic(straight_road(2), &[Actor::car(1, [state(50.0, 0.0, 0.0, 10.0)]), other]);
        near(at(&judged(&scene, 1), Measure::Hw, 0), expected, 1e-9);
    }
}

#[test]
fn who_overtakes_against_a_lane_has_a_path_against_it() {
    let mut lanes = parallel_lanes(2, 200.0);
    let lane = &mut lanes[1];
    lane.left.reverse();
    lane.right.reverse();
    std::mem::swap(&mut lane.left, &mut lane.right);
    let scene = traffic(
        open(lanes),
        &[Actor::car(1, [state(50.0, 3.5, 0.0, 10.0)]), Actor::car(2, [state(85.0, 3.5, std::f64::consts::PI, 10.0)])],
    );
    let found = judged(&scene, 1);
    near(at(&found, Measure::Hw, 0), 30.0, 1e-9);
    near(at(&found, Measure::Ttc, 0), 1.5, 1e-9);
}
