//! Specifications of the whole planner, on small invented roads.

use std::f64::consts::{FRAC_PI_4, PI};

use super::{RolloutMemory, RolloutSettings, candidates, plan};
use crate::geometry::Point;
use crate::geometry::shape::{Lcg, Shape};
use crate::plan::PlanResult;
use crate::plan::comfort::Comfort;
use crate::plan::testing::{Car, Drive};
use crate::road::testing::{arc, lane, open, straight};
use crate::trajectory::PlanStatus;

fn planned(drive: &Drive) -> PlanResult {
    let settings = RolloutSettings::default();
    drive.with_request(|request| plan(request, &settings, &mut RolloutMemory::default()).expect("beside its path"))
}

/// Drives for some seconds without touching anything; the lowest speed on the way [m/s].
fn drive_on(drive: &mut Drive, seconds: f64) -> f64 {
    let mut slowest = f64::INFINITY;
    for _ in 0..(seconds / drive.dt).round() as usize {
        let result = planned(drive);
        drive.step(result);
        assert!(!drive.is_in_contact(), "{:?}", drive.place());
        slowest = slowest.min(drive.state.velocity);
    }
    slowest
}

/// One lane along x of a width [m], at 50 m with a speed [m/s], to a goal at 200 m.
fn in_a_lane(width: f64, velocity: f64) -> Drive {
    let (left, right) =
        (straight((0.0, 0.5 * width), (300.0, 0.5 * width)), straight((0.0, -0.5 * width), (300.0, -0.5 * width)));
    let one = crate::road::LaneletInput { left, right, ..lane(1, &straight((0.0, 0.0), (300.0, 0.0))) };
    Drive::on(open(vec![one]), &straight((0.0, 0.0), (300.0, 0.0)), 50.0, velocity).with_goal(
        (200.0, 210.0),
        (0, 400),
        None,
    )
}

#[test]
fn a_vehicle_that_stands_45_degrees_askew_drives_off_along_its_lane() {
    for heading in [-FRAC_PI_4, FRAC_PI_4] {
        let mut drive = in_a_lane(8.0, 0.0);
        drive.state.orientation = heading;
        drive_on(&mut drive, 8.0);
        let (s, d) = drive.place();
        assert!(s > 65.0 && d.abs() < 0.5, "{heading} rad: {s} m, {d} m");
    }
}

#[test]
fn a_parked_van_is_passed_where_there_is_room_beside_it_and_waited_for_elsewhere() {
    // The van is 2 m wide; the agent, 1.61 m wide, has 0.3 m on each side, or lacks 0.1 m.
    for (room, is_passed) in [(1.61 + 0.6, true), (1.61 - 0.1, false)] {
        let width = 2.0 + room;
        let van =
            Car { shape: Shape::rectangle(5.0, 2.0), is_static: true, ..Car::at(90.0, -0.5 * width + 1.0, 0.0, 0.0) };
        let mut drive = in_a_lane(width, 8.0).with_cars(vec![van]);
        let slowest = drive_on(&mut drive, 12.0);
        let (s, _) = drive.place();
        assert_eq!(s > 100.0, is_passed, "{room} m of room: {s} m");
        assert!(!is_passed || slowest > 1.5, "{slowest} m/s");
    }
}

#[test]
fn a_parked_van_is_passed_fast_with_a_margin_for_the_speed_where_there_is_room() {
    // In the middle of the lane the agent, 1.61 m wide, has 0.15 m to the van, which is 2 m wide.
    let beside = |margin_time: f64| {
        let settings = RolloutSettings { margin_time, ..RolloutSettings::default() };
        let y = -0.5 * 1.61 - 0.15 - 1.0;
        let van = Car { shape: Shape::rectangle(5.0, 2.0), is_static: true, ..Car::at(90.0, y, 0.0, 0.0) };
        let mut drive = in_a_lane(6.0, 15.0).with_cars(vec![van]);
        let mut nearest = f64::INFINITY;
        for _ in 0..40 {
            let result = drive.with_request(|r| plan(r, &settings, &mut RolloutMemory::default()).expect("a plan"));
            drive.step(result);
            let (s, d) = drive.place();
            nearest = if (86.0..94.0).contains(&s) { nearest.min(d + 0.15) } else { nearest };
        }
        nearest
    };
    let (without, with) = (beside(0.0), beside(0.02));
    assert!(without < 0.3 && with > 0.1 + 0.02 * 12.0, "{without} m without, {with} m with it");
}

/// A straight lane along x that turns left at 60 m, in a quarter circle of a radius [m]; the agent, with 20 m/s, is 35 m
/// before it. Its lateral accelerations and its changes of speed [m/s²] over 4 s.
fn towards_a_bend(radius: f64, settings: &RolloutSettings) -> (Vec<f64>, Vec<f64>) {
    let mut center = straight((0.0, 0.0), (60.0, 0.0));
    center.extend(arc((60.0, radius), radius, -0.5 * PI, 0.0).into_iter().skip(1));
    center.extend(straight((60.0 + radius, radius), (60.0 + radius, 100.0)).into_iter().skip(1));
    let mut drive = Drive::on(open(vec![lane(1, &center)]), &center, 25.0, 20.0);
    let step = |_| {
        let before = drive.state.velocity;
        let plan = drive.with_request(|request| plan(request, settings, &mut RolloutMemory::default()));
        drive.step(plan.expect("beside its path"));
        ((drive.state.velocity * drive.state.yaw_rate).abs(), (drive.state.velocity - before) / drive.dt)
    };
    (0..40).map(step).unzip()
}

#[test]
fn a_vehicle_that_comes_much_too_fast_to_a_bend_brakes_firmly_before_it() {
    // At 35 m before a bend of 10 m, 6.3 m/s (4 m/s² across) need 5.1 m/s².
    let (across, changes) = towards_a_bend(10.0, &RolloutSettings::default());
    let most = across.into_iter().fold(0.0, f64::max);
    let hardest = -changes.into_iter().fold(0.0, f64::min);
    assert!(most < 5.0, "{most} m/s² across");
    assert!((4.5..8.0).contains(&hardest), "{hardest} m/s²");
}

#[test]
fn a_driver_of_any_style_brakes_once_before_a_bend() {
    // Brisk drivers brake nearly as hard for comfort as they do firmly, and accept up to 3.5 m/s² across; one accepts 6.
    let brisk = Comfort { deceleration: 3.0, lateral_acceleration: 3.5, ..Comfort::default() };
    let bold = Comfort { lateral_acceleration: 6.0, ..Comfort::default() };
    for comfort in [Comfort::default(), brisk, bold] {
        for radius in [8.0, 12.0, 20.0, 30.0] {
            let (_, changes) = towards_a_bend(radius, &RolloutSettings { comfort, ..RolloutSettings::default() });
            // While it brakes, it lets go of the brakes for good.
            let braking = &changes[..changes.iter().rposition(|change| *change < -2.0).unwrap_or(0)];
            let firmer = |pair: &&[f64]| pair[1] < pair[0] - 0.3;
            let softer = braking.windows(2).position(|pair| pair[1] > pair[0] + 0.3).unwrap_or(braking.len());
            let again = braking[softer.min(braking.len())..].windows(2).filter(firmer).count();
            assert_eq!(again, 0, "{comfort:?}, {radius} m: {braking:.2?}");
        }
    }
}

#[test]
fn what_stands_is_evaded_at_23_mps_where_the_next_lane_is_free() {
    let lanes = |n: i64| -> Vec<_> {
        (0..n).map(|i| lane(i + 1, &straight((0.0, 3.5 * i as f64), (600.0, 3.5 * i as f64)))).collect()
    };
    for (n, distance) in [(2, 45.0), (1, 45.0)] {
        let center = straight((0.0, 0.0), (600.0, 0.0));
        let car = Car { is_static: true, ..Car::at(50.0 + distance, 0.0, 0.0, 0.0) };
        let mut drive = Drive::on(open(lanes(n)), &center, 40.0, 23.0).with_cars(vec![car]);
        drive_on(&mut drive, 6.0);
        let (s, _) = drive.place();
        assert_eq!(s > 120.0, n == 2, "{n} lanes: {s} m");
    }
}

#[test]
fn a_follower_keeps_clear_of_a_leader_that_it_catches_up_with() {
    let mut drive = in_a_lane(3.5, 15.0).with_cars(vec![Car::at(90.0, 0.0, 0.0, 6.0)]);
    drive_on(&mut drive, 15.0);
    // 2 m and 0.85 s behind it, from bumper to bumper.
    let gap = drive.cars[0].pose.position.x - drive.state.x - 4.508;
    assert!((gap - (2.0 + 0.85 * 6.0)).abs() < 1.0, "{gap} m");
}

#[test]
fn an_agent_waits_for_a_car_that_crosses_and_goes_on_behind_it() {
    let crossing = straight((100.0, -200.0), (100.0, 200.0));
    let own = straight((0.0, 0.0), (300.0, 0.0));
    let cars: Vec<Car> = (0..2).map(|i| Car::at(100.0, -25.0 - 12.0 * f64::from(i), 0.5 * PI, 8.0)).collect();
    let drive = Drive::on(open(vec![lane(1, &own), lane(2, &crossing)]), &own, 70.0, 8.0);
    let mut drive = drive.with_goal((200.0, 210.0), (0, 400), None).with_cars(cars);
    // The second car leaves the crossing after (37 + 1.75 + 2.25) / 8 s.
    drive_on(&mut drive, 5.1);
    assert!(drive.place().0 < 97.0, "{:?}", drive.place());
    drive_on(&mut drive, 3.0);
    assert!(drive.place().0 > 101.0, "{:?}", drive.place());
}

#[test]
fn a_bend_of_12_m_is_taken_at_its_comfortable_speed_and_the_lane_is_kept() {
    let mut center = straight((0.0, 0.0), (60.0, 0.0));
    center.extend(arc((60.0, 12.0), 12.0, -0.5 * PI, 0.0).into_iter().skip(1));
    center.extend(straight((72.0, 12.0), (72.0, 80.0)).into_iter().skip(1));
    let mut drive = Drive::along(&center, 20.0, 10.0);
    let mut hardest = 0.0_f64;
    for _ in 0..120 {
        let result = planned(&drive);
        assert_eq!(result.status, PlanStatus::Planned);
        drive.step(result);
        hardest = hardest.max((drive.state.velocity * drive.state.yaw_rate).abs());
        assert!(drive.place().1.abs() < 0.8, "{:?}", drive.place());
    }
    let comfortable = RolloutSettings::default().comfort.lateral_acceleration;
    assert!((0.7 * comfortable..1.6 * comfortable).contains(&hardest), "{hardest} m/s²");
    assert!(drive.place().0 > 80.0, "{:?}", drive.place());
}

#[test]
fn from_any_state_a_plan_starts_there_and_keeps_the_limits_of_the_vehicle() {
    let mut random = Lcg::new(7);
    let mut between = |low: f64, high: f64| random.within(low, high);
    for _ in 0..1000 {
        let mut drive = Drive::on_three_lanes(100.0, 0.0);
        let velocity = between(-1.0, 30.0);
        drive.state.y += between(-3.0, 3.0);
        drive.state.orientation = between(-1.2, 1.2);
        (drive.state.velocity, drive.state.acceleration) = (velocity, between(-8.0, 4.0));
        drive.state.yaw_rate = between(-0.3, 0.3) * velocity.abs().min(5.0);
        drive.cars =
            (0..3).map(|_| Car::at(between(80.0, 180.0), between(-4.0, 4.0), between(-3.0, 3.0), 5.0)).collect();
        let vehicle = drive.vehicle;
        let points = planned(&drive).trajectory.points;
        assert_eq!(points[0], drive.state);
        let curvature =
            |k: usize| if points[k].velocity > 0.2 { points[k].yaw_rate / points[k].velocity } else { f64::NAN };
        for k in 1..points.len() {
            let (before, now) = (&points[k - 1], &points[k]);
            assert!(now.is_finite());
            assert!(now.velocity >= before.velocity.min(0.0), "{now:?}");
            let acceleration = (now.velocity - before.velocity) / drive.dt;
            assert!(acceleration.abs() <= vehicle.acceleration_max + 1e-9, "{acceleration} m/s²");
            assert!(
                curvature(k).is_nan() || curvature(k).abs() <= vehicle.curvature_max() + 1e-9,
                "{} 1/m",
                curvature(k)
            );
            if k > 1 {
                let angle = |k: usize| (vehicle.wheelbase * curvature(k)).atan();
                let rate = (angle(k) - angle(k - 1)) / drive.dt;
                assert!(rate.is_nan() || rate.abs() <= vehicle.steering_rate_max + 1e-6, "{rate} rad/s at {k}");
            }
            let moved = Point::new(now.x - before.x, now.y - before.y).norm();
            let fastest = now.velocity.abs().max(before.velocity.abs()) * drive.dt;
            // The centre of the footprint is ahead of the rear axle, which has this speed.
            let swing = (now.orientation - before.orientation).abs() * vehicle.rear_axle_to_center;
            assert!(moved <= fastest + swing + 1e-6, "{moved} m at {} m/s", now.velocity);
        }
    }
}

#[test]
fn a_plan_does_not_depend_on_what_the_memory_was_used_for() {
    let settings = RolloutSettings::default();
    let (here, there) =
        (in_a_lane(3.5, 8.0).with_cars(vec![Car::at(80.0, 0.3, 0.0, 0.0)]), Drive::on_three_lanes(50.0, 20.0));
    let mut used = RolloutMemory::default();
    there.with_request(|request| plan(request, &settings, &mut used));
    let again = here.with_request(|request| plan(request, &settings, &mut used)).expect("a plan");
    assert_eq!(again, planned(&here));
}

#[test]
fn the_chosen_candidate_is_the_plan() {
    let drive = in_a_lane(3.5, 12.0).with_cars(vec![Car::at(95.0, 0.0, 0.0, 3.0)]);
    let found = drive.with_request(|request| candidates(request, &RolloutSettings::default()));
    let (result, chosen) = (planned(&drive), found.chosen.expect("one is chosen"));
    assert_eq!(result.cost, found.cost[chosen]);
    for (k, point) in result.trajectory.points.iter().enumerate() {
        let at = chosen * found.n_points + k;
        assert!((point.x - found.x[at]).hypot(point.y - found.y[at]) < 1e-9, "point {k}");
    }
    assert!(found.cost.iter().zip(&found.rejection).all(|(cost, why)| *cost >= result.cost || !why.is_empty()));
}

#[test]
fn a_plan_names_what_a_better_one_would_touch_and_not_what_it_touches_itself() {
    let rejection = |drive: &Drive| {
        let result = planned(drive);
        assert_eq!(result.status, PlanStatus::Planned);
        result.obstruction.map(|obstruction| obstruction.rejection)
    };
    let standing = in_a_lane(3.5, 0.0);
    let x = standing.state.x;
    assert_eq!(rejection(&standing), None);
    // From the left, 6 m ahead: who drives off at once meets it.
    let crosses = standing.clone().with_cars(vec![Car::at(x + 6.0, 7.1, -0.5 * PI, 2.0)]);
    assert_eq!(rejection(&crosses).as_deref(), Some("collision with 100"));
    // Towards it in its lane: it is touched even where it stands.
    let comes = standing.with_cars(vec![Car::at(x + 7.1, 0.0, PI, 1.0)]);
    assert_eq!(rejection(&comes), None);
}

/// Close behind a car that has broken down, with room beside it.
fn behind_a_broken_down_car(gap: f64) -> Drive {
    let mut drive = in_a_lane(8.0, 0.0);
    let length = drive.vehicle.length;
    let car = Car { is_static: true, ..Car::at(drive.state.x + length + gap, 0.0, 0.0, 0.0) };
    drive.cars.push(car);
    drive
}

#[test]
fn a_vehicle_too_close_to_what_has_broken_down_backs_out_and_passes_it() {
    let mut drive = behind_a_broken_down_car(0.15);
    assert_eq!(drive_on(&mut drive, 4.9), 0.0, "it may be about to drive on");
    let slowest = drive_on(&mut drive, 20.0);
    let (s, _) = drive.place();
    assert!((-1.5..-0.3).contains(&slowest), "{slowest} m/s");
    assert!(s > 80.0, "{s} m");
}

#[test]
fn no_agent_backs_out_where_it_is_switched_off_or_behind_a_car_that_waits() {
    let settings = RolloutSettings { reverse: false, ..RolloutSettings::default() };
    let mut drive = behind_a_broken_down_car(0.15);
    for _ in 0..80 {
        let result = drive.with_request(|r| plan(r, &settings, &mut RolloutMemory::default()).expect("a plan"));
        drive.step(result);
        assert!(drive.state.velocity >= 0.0);
    }
    let mut queue = in_a_lane(3.5, 0.0).with_cars(vec![Car::at(56.5, 0.0, 0.0, 0.0)]);
    assert!(drive_on(&mut queue, 12.0) >= 0.0);
}

#[test]
fn a_reversal_ends_before_what_comes_from_behind() {
    let mut drive = behind_a_broken_down_car(0.15);
    for _ in 0..80 {
        let result = planned(&drive);
        drive.step(result);
        if drive.state.velocity < -0.4 {
            break;
        }
    }
    assert!(drive.state.velocity < -0.4, "{} m/s", drive.state.velocity);
    let near = drive.state.x - drive.vehicle.length - 0.6;
    drive.cars.push(Car { is_static: true, ..Car::at(near, 0.0, 0.0, 0.0) });
    drive_on(&mut drive, 3.0);
    assert!(drive.state.velocity >= 0.0);
}
