//! What an agent does when every way ahead ends in a contact.

use std::f64::consts::{FRAC_PI_2, PI};

use super::super::super::emergency_braking::last_resort;
use super::{Car, Drive};
use crate::geometry::Point;
use crate::plan::external_plan::{check_motion, check_plan};
use crate::plan::frenet::FrenetSettings;
use crate::road::testing::{arc, open, straight, tapered_lane};
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
fn full_braking_turns_the_wheels_within_the_steering_rate_and_the_friction_circle() {
    // A plan that turns left as tightly as the tyres hold, then an emergency.
    let mut center = straight((0.0, 0.0), (30.0, 0.0));
    center.extend(arc((30.0, 18.0), 18.0, -FRAC_PI_2, 0.0).into_iter().skip(1));
    for velocity in [3.0, 6.0, 9.0, 11.0] {
        let mut drive = Drive::along(&center, 36.0, velocity);
        drive.state.yaw_rate = velocity / 18.0;
        let result = drive.plan(&FrenetSettings::default());
        drive.step(result);
        let points = braking_from(&drive);
        let vehicle = &drive.vehicle;
        let steering = |p: &State| (vehicle.wheelbase * p.yaw_rate / p.velocity).atan();
        for pair in points.windows(2).take_while(|pair| pair[1].velocity > 0.1) {
            let rate = (steering(&pair[1]) - steering(&pair[0])).abs() / drive.dt;
            assert!(rate < vehicle.steering_rate_max + 1e-6, "{velocity} m/s: {rate} rad/s");
            let held = vehicle.lateral_acceleration_beside(pair[1].acceleration);
            let lateral = (pair[1].yaw_rate * pair[1].velocity).abs();
            let opens = steering(&pair[1]).abs() < steering(&pair[0]).abs();
            assert!(lateral < held + 1e-6 || opens, "{velocity} m/s: {lateral} of {held} m/s²");
        }
    }
}

#[test]
fn full_braking_before_a_bend_turns_the_wheels_into_it_as_fast_as_they_turn() {
    // 20 m straight on, then a bend of 12 m radius to the left; no earlier plan, the wheels point straight ahead.
    let mut center = straight((0.0, 0.0), (20.0, 0.0));
    center.extend(arc((20.0, 12.0), 12.0, -FRAC_PI_2, 0.0).into_iter().skip(1));
    let drive = Drive::along(&center, 18.0, 9.0);
    let points = braking_from(&drive);
    let pose = points[30].pose();
    let offset = |place| drive.route.path.project(place).expect("beside it").1.abs();
    let on_the_path = offset(drive.vehicle.rear_axle_from_center(pose));
    // Straight on it would come to rest here.
    let way = points.windows(2).map(|pair| pair[0].pose().position.distance(pair[1].pose().position)).sum::<f64>();
    let straight_on = offset(drive.vehicle.rear_axle_from_center(drive.state.pose()) + Point::new(way, 0.0));
    assert!(on_the_path < 0.5 * straight_on && pose.orientation > 0.1, "{on_the_path} m, {straight_on} m");
    let steering = |p: &State| (drive.vehicle.wheelbase * p.yaw_rate / p.velocity).atan();
    let moving: Vec<f64> = points.iter().filter(|p| p.velocity > 0.1).map(steering).collect();
    let rate = moving.windows(2).map(|w| (w[1] - w[0]).abs() / 0.1).fold(0.0, f64::max);
    assert!(rate > 0.1 && rate <= drive.vehicle.steering_rate_max + 1e-9, "{rate} rad/s");
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
