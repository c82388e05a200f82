//! What stands beside the way: passed where there is room, waited for elsewhere.

use std::f64::consts::PI;

use super::{Car, Drive};
use crate::plan::frenet::FrenetSettings;
use crate::road::testing::{lane, open, straight};

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
