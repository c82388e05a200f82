//! What an agent does when every way ahead ends in a contact.

use std::f64::consts::{FRAC_PI_2, PI};

use super::super::super::emergency_braking::last_resort;
use super::{Car, Drive};
use crate::plan::external_plan::{check_motion, check_plan};
use crate::plan::frenet::FrenetSettings;
use crate::road::testing::{open, straight, tapered_lane};
use crate::trajectory::{PlanStatus, State};

/// Full braking from now on.
fn braking_from(drive: &Drive) -> Vec<State> {
    drive.with_request(|request| last_resort(request, 31, "")).trajectory.points
}

/// Own speed at the contact [m/s], and that which full braking from the first emergency on would have left there; `None`
/// if there is no contact within 3 s.
fn contact_speeds(mut drive: Drive) -> Option<(f64, f64)> {
    let mut braking = None;
    for _ in 0..30 {
        let result = drive.plan(&FrenetSettings::default());
        if braking.is_none() && result.status == PlanStatus::EmergencyBraking {
            braking = Some((drive.time_step, braking_from(&drive)));
        }
        drive.step(result);
        if drive.is_in_contact() {
            let (from, full) = braking.expect("an emergency before a contact");
            let at = (drive.time_step - from) as usize;
            return Some((drive.state.velocity, full[at].velocity));
        }
    }
    None
}

fn on_a_lane(velocity: f64, car: Car) -> Drive {
    Drive::along(&straight((0.0, 0.0), (400.0, 0.0)), 40.0, velocity).with_cars(vec![car])
}

#[test]
fn no_contact_has_more_kinetic_energy_than_full_braking_would_leave() {
    let mut n_contacts = 0;
    for velocity in [4.0, 8.0, 12.0, 16.0] {
        for gap in [5.0, 8.0, 12.0, 16.0] {
            let x = 41.4 + gap;
            let others = [
                ("a wall", Car::at(x, 0.0, FRAC_PI_2, 0.0)),
                ("an oncoming car", Car::at(x, 0.3, PI, 6.0)),
                ("a car that crosses", Car::at(x, -6.0, FRAC_PI_2, 4.0)),
                ("a slow car", Car::at(x, 0.8, 0.0, 1.0)),
            ];
            for (name, other) in others {
                let Some((speed, bound)) = contact_speeds(on_a_lane(velocity, other)) else { continue };
                n_contacts += 1;
                assert!(
                    speed <= bound + 0.2,
                    "{name}, {gap} m ahead at {velocity} m/s: {speed} instead of {bound} m/s"
                );
            }
        }
    }
    assert!(n_contacts > 20, "{n_contacts}");
}

#[test]
fn an_agent_with_a_faster_car_ahead_of_it_in_its_way_does_not_accelerate_into_it() {
    // It comes from the right and cuts in closely ahead.
    let mut n_emergencies = 0;
    for (x, y, velocity) in
        [(46.0, -1.7, 7.0), (46.0, -1.4, 5.0), (46.5, -1.7, 5.0), (47.0, -1.7, 4.0), (48.0, -1.7, 3.0)]
    {
        let mut drive = on_a_lane(7.0, Car::at(x, y, 0.25, velocity));
        for _ in 0..10 {
            let before = drive.state.velocity;
            let result = drive.plan(&FrenetSettings::default());
            let is_emergency = result.status == PlanStatus::EmergencyBraking;
            n_emergencies += usize::from(is_emergency);
            drive.step(result);
            assert!(!is_emergency || drive.state.velocity < before, "{:?}", drive.state);
        }
    }
    assert!(n_emergencies > 0);
}

#[test]
fn an_emergency_names_what_rejected_most_samples_and_where() {
    let obstruction = |drive: &Drive| drive.plan(&FrenetSettings::default()).obstruction;
    let center = straight((0.0, 0.0), (100.0, 0.0));
    assert_eq!(obstruction(&Drive::along(&center, 30.0, 10.0)), None);
    // A car across the lane, its side 12 m ahead of the agent's centre, at 15 m/s.
    let blocked = Drive::along(&center, 30.0, 15.0);
    let blocked = blocked.clone().with_cars(vec![Car::at(blocked.state.x + 12.805, 0.0, FRAC_PI_2, 0.0)]);
    let found = obstruction(&blocked).expect("no sample stops in time");
    assert_eq!(found.rejection, "collision with 100");
    assert!((found.at.x - blocked.state.x).abs() < 15.0 && found.overhang.is_nan(), "{found:?}");
    // The lane narrows from 3.5 m to 1.2 m; the agent is 1.61 m wide and has 20 m/s.
    let narrowing = Drive::on(open(vec![tapered_lane(1, &center, 3.5, 1.2)]), &center, 70.0, 20.0);
    let found = obstruction(&narrowing).expect("no sample stops in time");
    assert_eq!(found.rejection, "off the road");
    assert!(found.at.x > narrowing.state.x && (0.1..0.4).contains(&found.overhang), "{found:?}");
    // Against the direction of the path there are no samples.
    let mut turned = Drive::along(&center, 30.0, 10.0);
    turned.state.orientation = PI;
    assert_eq!(obstruction(&turned).expect("no samples").rejection, "the agent heads away from its reference path");
}

#[test]
fn rolling_backwards_is_braked_to_a_stop_by_a_motion_that_its_speeds_tell() {
    for (velocity, yaw_rate) in [(-5.0, 0.0), (-3.0, 0.15), (-1.5, -0.1), (-0.3, 0.02)] {
        let mut drive = Drive::along(&straight((0.0, 0.0), (400.0, 0.0)), 40.0, velocity);
        drive.state.yaw_rate = yaw_rate;
        let (now, vehicle) = (drive.state, drive.vehicle);
        let result = drive.plan(&FrenetSettings::default());
        assert_eq!(result.status, PlanStatus::EmergencyBraking, "{}", result.message);
        let points = &result.trajectory.points;
        assert_eq!(check_plan(points, &now, &vehicle, drive.dt), Ok(()));
        assert_eq!(check_motion(points, &vehicle, drive.dt), Ok(()));
        let back = now.pose().position.distance(points[30].pose().position);
        let least = 0.5 * velocity * velocity / (0.9 * vehicle.acceleration_max);
        // The brakes build up within 0.2 s.
        assert!((least..least - 0.2 * velocity).contains(&back), "{velocity} m/s: {back} m");
        assert_eq!(points[30].velocity, 0.0);
        assert!(points[30].x < now.x && points[1].acceleration > 0.0);
        // The wheels stay where they are: the heading turns with the way that is driven backwards.
        assert!((points[30].orientation - now.orientation).signum() == yaw_rate.signum() || yaw_rate == 0.0);
    }
}
