//! The examples of docs/reference/scoring.md. Footprints of 5 m by 2 m, steps of 0.1 s.

use super::*;
use crate::criticality::crossing_lanelets;
use crate::criticality::tests::{Actor, state, traffic};
use crate::road::RoadNetwork;
use crate::road::testing::{closed, crossing, lane, parallel_lanes, straight};
use crate::trajectory::State;

const AGENT: i64 = 1;
const OTHER: i64 = 2;

fn two_lanes() -> RoadNetwork {
    closed(parallel_lanes(2, 300.0))
}

/// Lane 1 towards +x, and lane 2 beside it towards -x.
fn two_way() -> RoadNetwork {
    closed(vec![lane(1, &straight((0.0, 0.0), (300.0, 0.0))), lane(2, &straight((300.0, 3.5), (0.0, 3.5)))])
}

/// A car that drives straight on at a speed; its y is that of each step.
fn car(id: i64, x: f64, velocity: f64, orientation: f64, y: impl Fn(usize) -> f64) -> Actor {
    let along = orientation.cos() * velocity * 0.1;
    Actor::car(id, (0..120).map(|k| state(x + along * k as f64, y(k), orientation, velocity)))
}

/// The verdict on the agent at the first step whose recorded footprints overlap.
fn verdict(road: RoadNetwork, agent: Actor, other: Actor) -> Verdict {
    let crossing = crossing_lanelets(&road, 0.3, 0.1);
    let pose = |state: &Option<State>| state.expect("present").pose();
    let both = agent.states.iter().zip(&other.states);
    let touches = both.map(|(a, b)| agent.shape.overlaps(pose(a), &other.shape, pose(b)));
    let step = touches.into_iter().position(|touches| touches).expect("they touch") as i64;
    let request = BlameRequest {
        contacts: vec![(AGENT, OTHER, step, true)],
        agent: Reaction { delay: 0.25, deceleration: 6.0 },
        others: Reaction { delay: 0.75, deceleration: 4.0 },
        crossing,
    };
    blame(&traffic(road, &[agent, other]), &request).expect("a contact")[0]
}

#[test]
fn f1_who_is_hit_from_behind_in_its_lane_is_not_at_fault() {
    let found = verdict(two_lanes(), car(AGENT, 60.0, 10.0, 0.0, |_| 0.0), car(OTHER, 30.0, 15.0, 0.0, |_| 0.0));
    assert_eq!((found.kind, found.collision_type, found.fault_nuplan), (FaultKind::None, CollisionType::Rear, false));
}

#[test]
fn f2_cutting_in_five_metres_per_second_slower_needs_6_875_metres() {
    for (gap, kind) in [(6.8, FaultKind::CutOff), (6.9, FaultKind::None)] {
        // At step 20 the follower is at 30 + 20 * 1.5.
        let agent = car(AGENT, 60.0 + 5.0 + gap - 20.0, 10.0, 0.0, |k| if k < 20 { 3.5 } else { 1.5 });
        let found = verdict(two_lanes(), agent, car(OTHER, 30.0, 15.0, 0.0, |_| 0.0));
        assert_eq!((found.kind, found.decided_at), (kind, 20), "gap {gap}");
        assert!((found.gap - gap).abs() < 2e-3 && (found.needed - 6.875).abs() < 1e-9, "{found:?}");
    }
}

#[test]
fn f3_standing_in_the_way_of_12_metres_per_second_needs_27_metres() {
    for (gap, kind) in [(26.0, FaultKind::CutOff), (28.0, FaultKind::None)] {
        let x = 20.0 + 12.0 + 2.5 + gap + 1.0;
        let across = |k: usize| state(x, if k < 10 { -8.0 } else { 0.0 }, FRAC_PI_2, 0.0);
        let found = verdict(two_lanes(), Actor::car(AGENT, (0..120).map(across)), car(OTHER, 20.0, 12.0, 0.0, |_| 0.0));
        assert_eq!((found.kind, found.needed), (kind, 27.0), "gap {gap}");
        assert_eq!((found.collision_type, found.fault_nuplan), (CollisionType::StoppedAgent, false));
    }
}

#[test]
fn f4_driving_12_metres_per_second_into_a_standing_car_needs_15_metres() {
    for (gap, kind) in [(15.1, FaultKind::RanInto), (14.9, FaultKind::None)] {
        let standing = car(OTHER, 20.0 + 5.0 + gap, 0.0, 0.0, |_| 0.0);
        let found = verdict(two_lanes(), car(AGENT, 20.0, 12.0, 0.0, |_| 0.0), standing);
        assert_eq!((found.kind, found.needed, found.side), (kind, 15.0, 0), "gap {gap}");
        assert_eq!(found.collision_type, CollisionType::StoppedOther);
    }
}

#[test]
fn f5_who_is_cut_off_five_metres_per_second_slower_has_room_from_3_333_metres_on() {
    for (gap, kind) in [(3.0, FaultKind::None), (3.5, FaultKind::RanInto)] {
        let cutting_in = car(OTHER, 60.0 + 5.0 + gap - 20.0, 10.0, 0.0, |k| if k < 20 { 3.5 } else { 1.5 });
        let found = verdict(two_lanes(), car(AGENT, 30.0, 15.0, 0.0, |_| 0.0), cutting_in);
        assert_eq!((found.kind, found.collision_type, found.fault_nuplan), (kind, CollisionType::Front, true));
        assert!((found.needed - 10.0 / 3.0).abs() < 1e-9);
    }
}

#[test]
fn f6_a_neighbour_that_drifts_into_the_lane_is_at_fault_and_who_keeps_the_lane_is_not() {
    let drifting = |id| car(id, 31.0, 15.0, 0.0, |k| 3.5 - 0.1 * k as f64);
    let keeping = |id| car(id, 30.0, 15.0, 0.0, |_| 0.0);
    assert_eq!(verdict(two_lanes(), keeping(AGENT), drifting(OTHER)).kind, FaultKind::None);
    let found = verdict(two_lanes(), drifting(AGENT), keeping(OTHER));
    assert_eq!((found.kind, found.side), (FaultKind::CutOff, 2));
}

#[test]
fn a_faster_neighbour_that_leaves_its_lane_is_not_cut_off_by_who_keeps_the_lane() {
    let drifting = |id| car(id, 17.0, 18.0, 0.0, |k| 3.5 - 0.1 * k as f64);
    let keeping = |id| car(id, 30.0, 10.0, 0.0, |_| 0.0);
    assert_eq!(verdict(two_lanes(), keeping(AGENT), drifting(OTHER)).kind, FaultKind::None);
    assert_eq!(verdict(two_lanes(), drifting(AGENT), keeping(OTHER)).kind, FaultKind::CutOff);
    // A vehicle that changes to a lane does not keep it, even if it is in it in the end, and the follower swerves.
    let changing = car(AGENT, 36.0, 10.0, 0.0, |k| if k < 10 { 3.5 } else { 1.5 - 0.15 * (k - 10).min(10) as f64 });
    let swerving = car(OTHER, 22.0, 15.0, 0.0, |k| if k < 15 { 0.0 } else { -1.0 });
    assert_eq!(verdict(two_lanes(), changing, swerving).kind, FaultKind::CutOff);
}

#[test]
fn where_lanes_join_keeping_one_s_lane_is_no_right_to_go_first() {
    // Lane 3 joins lane 1 at a flat angle; a vehicle on it is in its lane all the way, and the other one swerves.
    let mut lanes = parallel_lanes(2, 300.0);
    lanes.push(lane(3, &straight((0.0, -6.0), (60.0, -0.5))));
    let joining = Actor::car(
        AGENT,
        (0..120).map(|k| {
            let x = 30.0 + 0.8 * k as f64;
            state(x, -6.0 + x / 60.0 * 5.5, 0.0914, 8.0)
        }),
    );
    let swerving = car(OTHER, 0.0, 18.0, 0.0, |k| 0.03 * k as f64);
    let found = verdict(closed(lanes), joining, swerving);
    assert_eq!(found.kind, FaultKind::CutOff, "{found:?}");
}

#[test]
fn f7_overtaking_into_oncoming_traffic_is_the_wrong_side() {
    let overtaking = |id| car(id, 20.0, 15.0, 0.0, |k| if k < 10 { 0.0 } else { 3.5 });
    let oncoming = |id| car(id, 150.0, 12.0, PI, |_| 3.5);
    assert_eq!(verdict(two_way(), overtaking(AGENT), oncoming(OTHER)).kind, FaultKind::WrongSide);
    assert_eq!(verdict(two_way(), oncoming(AGENT), overtaking(OTHER)).kind, FaultKind::None);
}

#[test]
fn who_scrapes_along_a_car_that_stands_in_the_oncoming_lane_ran_into_it() {
    let standing = car(OTHER, 60.0, 0.0, PI, |_| 3.5);
    let agent = car(AGENT, 20.0, 8.0, 0.0, |k| if k < 48 { 1.0 } else { (1.0 + 0.15 * (k - 48) as f64).min(2.5) });
    let found = verdict(two_way(), agent, standing);
    assert_eq!((found.kind, found.side, found.collision_type), (FaultKind::RanInto, 1, CollisionType::StoppedOther));
}

#[test]
fn a_parked_car_that_faces_the_agent_is_not_oncoming_traffic() {
    let parked = car(OTHER, 100.0, 0.0, PI, |_| 0.0);
    let found = verdict(two_way(), car(AGENT, 20.0, 12.0, 0.0, |_| 0.0), parked);
    assert_eq!((found.kind, found.needed), (FaultKind::RanInto, 15.0));
}

/// On lane 1 at 12 m/s.
fn along(id: i64, x: f64) -> Actor {
    car(id, x, 12.0, 0.0, |_| 0.0)
}

/// On lane 2 at walking speed; its front is in the way of lane 1 from step 44 on.
fn across(id: i64) -> Actor {
    Actor::car(id, (0..120).map(|k| state(0.0, -8.0 + 0.1 * k as f64, FRAC_PI_2, 1.0)))
}

#[test]
fn at_a_crossing_both_may_be_at_fault() {
    let first = verdict(crossing(), along(AGENT, -76.0), across(OTHER));
    let second = verdict(crossing(), across(AGENT), along(OTHER, -76.0));
    assert_eq!((first.kind, first.is_crossing, second.kind), (FaultKind::RanInto, true, FaultKind::CutOff));
    assert!(first.gap > 15.0 && second.gap < 27.0, "{first:?} {second:?}");
}

#[test]
fn who_could_do_nothing_when_another_one_came_from_the_side_is_not_at_fault() {
    let first = verdict(crossing(), along(AGENT, -66.0), across(OTHER));
    assert_eq!((first.kind, first.needed, first.fault_nuplan), (FaultKind::None, 15.0, true));
    assert_eq!(verdict(crossing(), across(AGENT), along(OTHER, -66.0)).kind, FaultKind::CutOff);
}

#[test]
fn of_oncoming_traffic_at_a_crossing_only_the_one_that_turns_is_judged() {
    // Lane 2 leads back beside lane 1; lane 3 leaves it to the left, across lane 1.
    let road = || {
        let turn: Vec<_> =
            (0..=30).map(|k| f64::from(k) / 30.0).map(|t| Point::new(60.0 - 30.0 * t, 3.5 - 12.0 * t * t)).collect();
        closed(vec![
            lane(1, &straight((0.0, 0.0), (120.0, 0.0))),
            lane(2, &straight((120.0, 3.5), (0.0, 3.5))),
            lane(3, &turn),
        ])
    };
    let ahead = |id| car(id, 2.0, 8.0, 0.0, |_| 0.0);
    let turning = |id| {
        let at = |k: usize| {
            let t = 0.013 * k as f64;
            state(60.0 - 30.0 * t, 3.5 - 12.0 * t * t, PI + (0.8 * t).atan(), 4.0)
        };
        Actor::car(id, (0..120).map(at))
    };
    assert_eq!(verdict(road(), ahead(AGENT), turning(OTHER)).kind, FaultKind::None);
    let found = verdict(road(), turning(AGENT), ahead(OTHER));
    assert!(found.angle > ONCOMING_ANGLE && found.is_crossing, "{found:?}");
    assert_eq!(found.kind, FaultKind::CutOff);
}

/// A bicycle that rides towards a point at an angle to the lane; it is there at step 60.
fn bicycle(to: (f64, f64), velocity: f64, orientation: f64) -> Actor {
    let (x, y) = (orientation.cos() * velocity * 0.1, orientation.sin() * velocity * 0.1);
    let at = |k: usize| k as f64 - 60.0;
    Actor::car(OTHER, (0..120).map(|k| state(to.0 + x * at(k), to.1 + y * at(k), orientation, velocity)))
}

#[test]
fn who_rides_across_a_lane_into_the_flank_of_a_car_that_keeps_it_is_not_cut_off() {
    for (degrees, velocity) in [(90.0_f64, 5.0), (60.0, 4.0), (-90.0, 5.0), (120.0, 3.0)] {
        let angle = degrees.to_radians();
        // When the middle of the car is at 108 m, the bicycle is still beside the lane: it comes into the rear half.
        let to = (108.0 - 3.2 * angle.cos(), -3.2 * angle.sin());
        let found = verdict(two_lanes(), car(AGENT, 60.0, 8.0, 0.0, |_| 0.0), bicycle(to, velocity, angle));
        assert_eq!(found.kind, FaultKind::None, "{degrees} degrees, {found:?}");
        assert_ne!(found.side, 0, "{degrees} degrees");
    }
    // A vehicle that leaves its lane for that place is at fault.
    let changing = car(AGENT, 60.0, 8.0, 0.0, |k| if k < 52 { 3.5 } else { 1.5 });
    let found = verdict(two_lanes(), changing, car(OTHER, 60.0, 8.0, 0.0, |_| 0.0));
    assert_eq!(found.kind, FaultKind::CutOff);
}

/// A car in the lane y = 0 that stands until a step, and then reverses.
fn reversing_from(id: i64, x: f64, step: usize, velocity: f64) -> Actor {
    let at = |k: usize| x + velocity * 0.1 * k.saturating_sub(step) as f64;
    Actor::car(id, (0..120).map(|k| state(at(k), 0.0, 0.0, if k < step { 0.0 } else { velocity })))
}

#[test]
fn who_reverses_into_another_one_is_at_fault_whether_that_stands_or_comes() {
    // The other one comes to 1 m behind it when it begins to reverse, or stands 10 m behind it.
    for (velocity, step) in [(0.0, 10), (3.0, 30)] {
        let reversing = |id| reversing_from(id, 60.0, step, -2.0);
        let behind = |id| car(id, 45.0, velocity, 0.0, |_| 0.0);
        let found = verdict(two_lanes(), reversing(AGENT), behind(OTHER));
        assert_eq!((found.kind, found.side), (FaultKind::Reversed, 3), "{velocity} m/s");
        let found = verdict(two_lanes(), behind(AGENT), reversing(OTHER));
        assert_eq!((found.kind, found.side), (FaultKind::None, 0), "{velocity} m/s: {found:?}");
    }
}

#[test]
fn who_has_room_to_brake_for_a_reversing_car_and_does_not_is_at_fault_as_well() {
    let found = verdict(two_lanes(), car(AGENT, 20.0, 10.0, 0.0, |_| 0.0), reversing_from(OTHER, 90.0, 5, -1.0));
    // 10 · 0.25 + 10² / 12 m are needed.
    assert_eq!((found.kind, found.decided_at), (FaultKind::RanInto, 5), "{found:?}");
    assert!(found.gap > 50.0 && (found.needed - 10.833).abs() < 1e-3, "{found:?}");
}

#[test]
fn who_reverses_across_the_way_of_another_one_cuts_it_off() {
    // From the right, heading away from the lane: its rear is 2 m in the lane when the other one is 5 m away.
    let out = |id| {
        let y = |k: usize| -9.0 + 0.15 * k as f64;
        Actor::car(id, (0..120).map(|k| state(100.0, y(k).min(-2.0), -std::f64::consts::FRAC_PI_2, -1.5)))
    };
    let found = verdict(two_lanes(), out(AGENT), car(OTHER, 50.0, 10.0, 0.0, |_| 0.0));
    assert_eq!(found.kind, FaultKind::CutOff, "{found:?}");
}
