//! What comes of planning again and again: an agent among others.

use super::{Car, Drive};
use crate::geometry::Point;
use crate::plan::frenet::FrenetSettings;
use crate::road::testing::{arc, lane, open, straight};
use crate::trajectory::PlanStatus;

/// Steps of driving; checks after each that there is no contact. Returns the number of emergency plans.
fn drive_on(drive: &mut Drive, n_steps: usize) -> usize {
    let settings = FrenetSettings::default();
    let mut irregular = 0;
    for step in 0..n_steps {
        let result = drive.plan(&settings);
        irregular += usize::from(result.status != PlanStatus::Planned);
        drive.step(result);
        assert!(!drive.is_in_contact(), "contact at step {step}: {:?}", drive.state);
    }
    irregular
}

fn lane_of_400_m() -> Vec<Point> {
    straight((0.0, 0.0), (400.0, 0.0))
}

#[test]
fn a_standing_car_ahead_is_not_hit_and_the_agent_stands_one_gap_behind_it() {
    for velocity in [6.0, 12.0, 18.0] {
        let mut drive = Drive::along(&lane_of_400_m(), 40.0, velocity).with_cars(vec![Car::at(120.0, 0.0, 0.0, 0.0)]);
        let irregular = drive_on(&mut drive, 250);
        assert_eq!(irregular, 0);
        let gap = 120.0 - drive.state.x - 4.508;
        assert!((1.5..4.0).contains(&gap), "from {velocity} m/s: gap {gap}");
        assert!(drive.state.velocity < 0.1, "{}", drive.state.velocity);
    }
}

#[test]
fn the_agent_follows_a_slower_leader_at_the_time_gap() {
    let mut drive = Drive::along(&lane_of_400_m(), 30.0, 12.0).with_cars(vec![Car::at(70.0, 0.0, 0.0, 8.0)]);
    assert_eq!(drive_on(&mut drive, 250), 0);
    let gap = drive.cars[0].pose.position.x - drive.state.x - 4.508;
    assert!((drive.state.velocity - 8.0).abs() < 0.3, "{}", drive.state.velocity);
    assert!((8.0..14.0).contains(&gap), "{gap}");
}

#[test]
fn a_sudden_obstacle_leads_to_hard_braking_not_to_a_crash() {
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 14.0).with_cars(vec![Car::at(62.5, 0.0, 0.0, 0.0)]);
    drive_on(&mut drive, 60);
    assert!(drive.state.velocity < 0.5);
}

#[test]
fn a_follower_does_not_forbid_braking() {
    // A follower close behind at the same speed, a stationary car ahead.
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 12.0);
    drive.cars = vec![Car::at(drive.state.x - 9.0, 0.0, 0.0, 12.0), Car::at(62.0, 0.0, 0.0, 0.0)];
    let result = drive.plan(&FrenetSettings::default());
    assert_eq!(result.status, PlanStatus::Planned);
    assert!(result.trajectory.points[30].velocity < 8.0);
}

#[test]
fn a_parked_car_at_the_side_is_passed() {
    let mut drive = Drive::on_three_lanes(40.0, 10.0).with_cars(vec![Car::at(100.0, -2.4, 0.0, 0.0)]);
    drive_on(&mut drive, 120);
    assert!(drive.state.x > 130.0, "{}", drive.state.x);
}

#[test]
fn the_agent_arrives_at_its_goal_in_time_and_with_its_speed() {
    for (velocity, entry, time_step, goal_velocity) in [
        (10.0, 140.0, (80, 120), None),
        (4.0, 140.0, (90, 100), None),
        (15.0, 160.0, (120, 150), None),
        (10.0, 120.0, (80, 110), Some((4.0, 6.0))),
        // It is early and waits in the area.
        (8.0, 60.0, (150, 180), None),
    ] {
        let goal = (entry, entry + 12.0);
        let mut drive = Drive::along(&lane_of_400_m(), 40.0, velocity).with_goal(goal, time_step, goal_velocity);
        let mut arrived = false;
        for _ in 0..time_step.1 {
            drive_on(&mut drive, 1);
            arrived |= drive.goal.states[0].is_met(&drive.state, drive.time_step);
        }
        assert!(arrived, "{velocity} {entry} {time_step:?}: ended at {:?}", drive.state);
    }
}

#[test]
fn an_agent_on_a_free_road_keeps_its_speed_although_its_goal_leaves_it_more_time() {
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 10.0).with_goal((240.0, 250.0), (0, 600), None);
    for _ in 0..150 {
        drive_on(&mut drive, 1);
        assert!(drive.state.velocity > 9.5, "{:?}", drive.state);
    }
}

#[test]
fn a_late_agent_drives_on_at_the_speed_at_which_it_entered() {
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 10.0).with_goal((340.0, 350.0), (0, 20), Some((0.0, 12.0)));
    (drive.time_step, drive.state.velocity) = (30, 3.0);
    drive_on(&mut drive, 60);
    assert!(drive.state.velocity > 9.0, "{:?}", drive.state);
}

#[test]
fn the_agent_slows_down_for_a_bend_and_stays_in_its_lane() {
    // 60 m straight, a quarter circle of 12 m radius, straight on.
    let mut points = straight((0.0, 0.0), (60.0, 0.0));
    points.extend(arc((60.0, 12.0), 12.0, -std::f64::consts::FRAC_PI_2, 0.0).into_iter().skip(1));
    points.extend(straight((72.0, 12.0), (72.0, 80.0)).into_iter().skip(1));
    let mut drive = Drive::along(&points, 10.0, 12.0);
    let mut irregular = 0;
    for _ in 0..200 {
        irregular += drive_on(&mut drive, 1);
        let (s, d) = drive.place();
        if (68.0..72.0).contains(&s) {
            assert!(drive.state.velocity < 7.0, "{}", drive.state.velocity);
        }
        assert!(d.abs() < 0.8, "{s} {d}");
        if s > 110.0 {
            break;
        }
    }
    assert_eq!(irregular, 0);
    assert!(drive.place().0 > 110.0);
}

#[test]
fn crossing_the_low_speed_threshold_changes_nothing_abruptly() {
    // Accelerating from standstill with an offset from the lane's centre: the heading stays smooth.
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 0.0);
    drive.state.y = 0.6;
    let mut last = drive.state;
    for _ in 0..60 {
        drive_on(&mut drive, 1);
        assert!((drive.state.yaw_rate - last.yaw_rate).abs() < 0.12, "{last:?} {:?}", drive.state);
        assert!((drive.state.acceleration - last.acceleration).abs() < 4.0, "{last:?} {:?}", drive.state);
        last = drive.state;
    }
    assert!(drive.place().1.abs() < 0.1 && drive.state.velocity > 4.0, "{:?}", drive.state);
}

#[test]
fn an_agent_beside_the_road_comes_back() {
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 8.0);
    drive.state.y = 1.6;
    assert_eq!(drive_on(&mut drive, 40), 0);
    assert!(drive.state.y.abs() < 0.3, "{}", drive.state.y);
}

#[test]
fn an_overlap_at_the_start_does_not_end_the_drive() {
    // The margin of the neighbour touches; and a plain overlap.
    for y in [1.65, 1.5] {
        let mut drive = Drive::on_three_lanes(40.0, 8.0);
        drive.cars = vec![Car::at(drive.state.x, y, 0.0, 8.0)];
        let result = drive.plan(&FrenetSettings::default());
        assert_eq!(result.status, PlanStatus::Planned, "{y}");
    }
}

#[test]
fn with_nowhere_to_go_the_agent_brakes_as_hard_as_it_can() {
    // A wall across the road 12 m ahead at 15 m/s.
    let mut drive = Drive::along(&lane_of_400_m(), 40.0, 15.0);
    drive.cars = vec![Car::at(drive.state.x + 12.0, 0.0, std::f64::consts::FRAC_PI_2, 0.0)];
    let result = drive.plan(&FrenetSettings::default());
    assert_eq!(result.status, PlanStatus::EmergencyBraking);
    assert!(result.trajectory.points[10].velocity < 7.0, "{:?}", result.trajectory.points[10]);
}

#[test]
fn a_slow_leader_around_a_bend_is_followed_too() {
    let points = arc((0.0, 0.0), 60.0, 0.0, 4.0);
    let mut drive = Drive::on(open(vec![lane(1, &points)]), &points, 20.0, 10.0);
    let at = drive.route.path.at(60.0);
    drive.cars = vec![Car::at(at.position.x, at.position.y, at.theta, 0.0)];
    assert_eq!(drive_on(&mut drive, 150), 0);
    assert!(drive.state.velocity < 0.1);
}
