//! What stands beside the way: passed where there is room, waited for elsewhere.

use std::f64::consts::PI;

use super::{Car, Drive};
use crate::control::Control;
use crate::geometry::shape::Shape;
use crate::plan::frenet::FrenetSettings;
use crate::road::LaneletInput;
use crate::road::testing::{lane, open, straight};
use crate::rules::RulesSettings;
use crate::trajectory::State;

/// One lane, 3.5 m wide, with a lane beside it for the other direction.
fn on_a_street(cars: Vec<Car>) -> Drive {
    let (own, opposite) = (straight((0.0, 0.0), (300.0, 0.0)), straight((300.0, 3.5), (0.0, 3.5)));
    let drive = Drive::on(open(vec![lane(1, &own), lane(2, &opposite)]), &own, 40.0, 8.0);
    drive.with_goal((200.0, 210.0), (0, 300), None).with_cars(cars)
}

/// Where the agent is after some seconds [m], and its lowest speed [m/s]; it touches nothing.
fn driven(mut drive: Drive, seconds: f64) -> (f64, f64) {
    let mut slowest = f64::INFINITY;
    for _ in 0..(seconds / drive.dt) as usize {
        let result = drive.plan(&FrenetSettings::default());
        drive.step(result);
        assert!(!drive.is_in_contact(), "{:?}", drive.place());
        slowest = slowest.min(drive.state.velocity);
    }
    (drive.place().0, slowest)
}

#[test]
fn what_stands_at_the_side_of_the_lane_is_passed_and_what_stands_in_its_middle_is_not() {
    // The lane leaves 0.945 m on each side of the agent; passing takes 1.81 to 1.91 m from middle to middle.
    for (offset, heading, is_passed) in
        [(1.9, PI, true), (1.9, 0.0, true), (1.2, PI, true), (-1.2, 0.0, true), (0.4, PI, false), (0.0, 0.0, false)]
    {
        let (s, slowest) = driven(on_a_street(vec![Car::at(80.0, offset, heading, 0.0)]), 10.0);
        assert_eq!(s > 100.0, is_passed, "{offset} m: {s} m");
        assert!(!is_passed || slowest > 3.0, "{offset} m: {slowest} m/s");
    }
}

#[test]
fn what_never_moves_is_passed_on_a_lane_of_the_same_direction_and_a_queue_is_not() {
    for (is_static, is_passed) in [(true, true), (false, false)] {
        let car = Car { is_static, ..Car::at(90.0, 0.3, 0.0, 0.0) };
        let drive = Drive::on_three_lanes(40.0, 8.0).with_goal((200.0, 210.0), (0, 300), None);
        let (s, _) = driven(drive.with_cars(vec![car]), 10.0);
        assert_eq!(s > 100.0, is_passed, "{s} m");
    }
}

/// A street on which 8 m/s fast agents obey the rules; a parked car reaches from y = -1.5 m to 0.3 m. The line between the
/// lanes is closed from some lanelets.
fn on_a_blocked_street(closed: &[usize], passing: bool, cars: &[Car]) -> Drive {
    let (own, opposite) = (straight((0.0, 0.0), (300.0, 0.0)), straight((300.0, 3.5), (0.0, 3.5)));
    let own_lane = LaneletInput { adjacent_left: Some((2, false)), ..lane(1, &own) };
    let other_lane = LaneletInput { adjacent_left: Some((1, false)), ..lane(2, &opposite) };
    let mut drive = Drive::on(open(vec![own_lane, other_lane]), &own, 30.0, 8.0);
    let control = Control { closed: [closed.to_vec(), vec![]], ..Control::default() };
    drive.rules = Some((control, RulesSettings { passing, ..RulesSettings::default() }));
    let parked = Car { shape: Shape::rectangle(4.5, 1.8), is_static: true, ..Car::at(90.0, -0.6, 0.0, 0.0) };
    drive.with_goal((250.0, 260.0), (0, 600), None).with_cars([&[parked], cars].concat())
}

/// Arc length and offset of the rear axle [m] at every time step; the agent touches nothing.
fn places(mut drive: Drive, seconds: f64) -> Vec<(f64, f64)> {
    let step = |_| {
        let result = drive.plan(&FrenetSettings::default());
        drive.step(result);
        assert!(!drive.is_in_contact(), "{:?}", drive.place());
        drive.place()
    };
    (0..(seconds / 0.1) as usize).map(step).collect()
}

/// Offset at an arc length [m], or `None` if the agent does not get there.
fn offset_at(places: &[(f64, f64)], s: f64) -> Option<f64> {
    places.iter().find(|place| place.0 >= s).map(|place| place.1)
}

#[test]
fn what_is_parked_in_the_lane_is_passed_over_the_other_lane_if_the_line_may_be_crossed() {
    let driven = places(on_a_blocked_street(&[], true, &[]), 20.0);
    let beside = offset_at(&driven, 88.6).expect("it passes");
    assert!((beside - 1.6).abs() <= 0.2, "{beside} m");
    let behind = offset_at(&driven, 92.25 + 30.0).expect("it drives on");
    assert!(behind.abs() <= 0.3, "{behind} m");
    for drive in [on_a_blocked_street(&[0], true, &[]), on_a_blocked_street(&[], false, &[])] {
        let driven = places(drive, 20.0);
        let (s, d) = driven.last().expect("a place");
        assert!(*s < 86.0 && d.abs() < 0.3, "{s} m, {d} m");
    }
}

#[test]
fn an_agent_waits_until_an_oncoming_vehicle_is_past() {
    for x in [160.0, 170.0, 180.0] {
        let driven = places(on_a_blocked_street(&[], true, &[Car::at(x, 3.5, PI, 10.0)]), 30.0);
        let met = |(i, place): (usize, &(f64, f64))| place.0 + 1.4 > x - 1.0 * (i + 1) as f64;
        let met = driven.iter().enumerate().position(met).expect("they meet");
        let widest = driven[..met].iter().fold(0.0_f64, |widest, place| widest.max(place.1.abs()));
        assert!(widest < 0.3 && driven[met].0 < 85.0, "{x} m: {widest} m, {:?}", driven[met]);
        assert!(offset_at(&driven, 110.0).is_some(), "{x} m: then it passes");
    }
}

#[test]
fn nobody_passes_over_the_other_lane_while_others_wait_or_stand_there() {
    let waiting = Car { is_static: false, ..Car::at(75.0, 0.0, 0.0, 0.0) };
    let opposite = Car::at(92.0, 3.0, PI, 0.0);
    for car in [waiting, opposite] {
        let driven = places(on_a_blocked_street(&[], true, &[car]), 20.0);
        let (s, d) = driven.last().expect("a place");
        assert!(*s < 86.0 && d.abs() < 0.3, "{s} m, {d} m");
    }
}

#[test]
fn a_queue_beside_an_open_line_is_not_passed() {
    let queue = [130.0, 137.0].map(|x| Car { is_static: false, ..Car::at(x, -0.6, 0.0, 0.0) });
    let mut drive = on_a_blocked_street(&[], true, &queue);
    drive.cars.remove(0);
    let driven = places(drive, 20.0);
    let (s, d) = driven.last().expect("a place");
    assert!(*s < 126.0 && d.abs() < 0.3, "{s} m, {d} m");
}

#[test]
fn an_agent_that_stands_behind_what_is_parked_swings_out() {
    for gap in [5.0, 6.0, 7.0, 9.0] {
        let mut drive = on_a_blocked_street(&[], true, &[]);
        drive.state = State { x: 87.75 - gap - 0.5 * drive.vehicle.length, velocity: 0.0, ..drive.state };
        let driven = places(drive, 20.0);
        assert!(offset_at(&driven, 100.0).is_some(), "{gap} m: {:?}", driven.last());
        let widest = driven.iter().fold(0.0_f64, |widest, place| widest.max(place.1));
        assert!(widest < 3.0, "{gap} m: {widest} m");
    }
}
