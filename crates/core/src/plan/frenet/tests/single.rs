//! Samples whose ends are given.

use std::f64::consts::PI;

use super::Drive;
use crate::plan::PlanRequest;
use crate::plan::frenet::FrenetTarget;
use crate::road::testing::arc;
use crate::vehicle::single_track::Moved;

fn driven(drive: &Drive, numbers: [f64; 3]) -> Moved {
    drive.with_request(|request| FrenetTarget::default().drive(request, numbers))
}

#[test]
fn the_first_state_is_that_of_the_polynomials_in_closed_form() {
    let drive = Drive::on_three_lanes(50.0, 10.0);
    let Moved { state, limited } = driven(&drive, [0.5, 0.2, 1.0]);
    // 1.5 m to the left and 1 m/s faster in 3 s, from a start without acceleration, after 0.1 s.
    let share: f64 = 0.1 / 3.0;
    let along = 50.0 + 1.0 + 3.0 * (share.powi(3) - 0.5 * share.powi(4));
    let speed = 10.0 + 3.0 * share.powi(2) - 2.0 * share.powi(3);
    let aside = 1.5 * (10.0 * share.powi(3) - 15.0 * share.powi(4) + 6.0 * share.powi(5));
    let drift = 1.5 * 30.0 * share.powi(2) * (1.0 - share).powi(2) / 3.0;
    let heading = (drift / speed).atan();
    let center = drive.vehicle.rear_axle_to_center;
    assert!(!limited);
    assert!((state.x - (along + center * heading.cos())).abs() < 1e-9);
    assert!((state.y - (aside + center * heading.sin())).abs() < 1e-9);
    assert!((state.orientation - heading).abs() < 1e-9);
    assert!((state.velocity - speed.hypot(drift)).abs() < 1e-9);
}

#[test]
fn numbers_beyond_one_count_as_one_and_speeds_end_at_zero_and_at_the_top() {
    let slow = Drive::on_three_lanes(50.0, 3.0);
    assert_eq!(driven(&slow, [0.0, -2.0, 3.0]).state, driven(&slow, [0.0, -1.0, 1.0]).state);
    // Nothing below standstill is aimed at: 3 m/s less is all that the vehicle can lose.
    assert_eq!(driven(&slow, [0.0, -1.0, 1.0]).state, driven(&slow, [0.0, -0.6, 1.0]).state);
    let fast = Drive::on_three_lanes(50.0, 50.8);
    let Moved { state, limited } = driven(&fast, [0.0, 1.0, 1.0]);
    assert!(!limited && (state.velocity - 50.8).abs() < 1e-9);
}

#[test]
fn a_sample_that_cannot_be_driven_takes_longer_or_ends_in_braking_and_both_count() {
    let drive = Drive::on_three_lanes(50.0, 15.0);
    // 3 m aside in 1.1 s would need more than the tyres hold, 3 m in 3 s need 1.9 m/s².
    let slower = driven(&drive, [1.0, 0.0, -1.0]);
    assert_eq!(slower, Moved { limited: true, ..driven(&drive, [1.0, 0.0, 1.0]) });
    // On a path of 20 m radius, 20 m/s are 20 m/s² to the side.
    let fast = Drive::along(&arc((0.0, 20.0), 20.0, -0.5 * PI, 0.5 * PI), 10.0, 20.0);
    let braking = driven(&fast, [0.0, 0.0, 1.0]);
    assert!(braking.limited && braking.state.velocity < 20.0);
}

#[test]
fn a_vehicle_that_stands_drives_off_and_one_without_speed_to_lose_stays() {
    let standing = Drive::on_three_lanes(50.0, 0.0);
    let off = driven(&standing, [0.0, 0.4, 0.0]);
    assert!(!off.limited && off.state.velocity > 0.0 && off.state.y.abs() < 1e-9);
    let stays = driven(&standing, [0.0, -1.0, 0.0]);
    assert!((stays.state.x - standing.state.x).abs() < 1e-9 && stays.state.velocity == 0.0);
}

#[test]
fn the_drive_goes_on_where_the_sample_led() {
    let mut drive = Drive::on_three_lanes(50.0, 10.0);
    for _ in 0..80 {
        let next = driven(&drive, [0.5, 0.0, 0.0]);
        assert!(!next.limited);
        drive.state = next.state;
    }
    // Half of 3 m beside the path, at the speed it had.
    assert!((drive.state.y - 1.5).abs() < 0.02 && drive.state.orientation.abs() < 0.01);
    assert!((drive.state.velocity - 10.0).abs() < 0.1);
}

#[test]
fn states_beyond_the_end_of_the_path_are_no_samples() {
    let drive = Drive::on_three_lanes(290.0, 10.0);
    let checked = |request: &PlanRequest<'_>| FrenetTarget::default().drive(request, [0.0; 3]);
    assert!(drive.with_request(checked).limited);
}
