//! From standstill beside the path to traffic speed.

use super::Drive;
use crate::plan::frenet::FrenetSettings;
use crate::trajectory::PlanStatus;

/// A car that stands beside the path; offset [m] to the left and heading [degrees] relative to the path.
fn standing(offset: f64, heading: f64) -> Drive {
    let mut drive = Drive::on_three_lanes(50.0, 0.0).with_goal((250.0, 260.0), (0, 200), None);
    drive.state.y = offset;
    drive.state.orientation = heading.to_radians();
    drive
}

/// Time until it drives 5 m/s [s].
fn time_to_5_mps(offset: f64, heading: f64) -> f64 {
    let mut drive = standing(offset, heading);
    for step in 0..100 {
        if drive.state.velocity >= 5.0 {
            return f64::from(step) * drive.dt;
        }
        let result = drive.plan(&FrenetSettings::default());
        assert_eq!(result.status, PlanStatus::Planned, "{offset} m, {heading} degrees");
        drive.step(result);
    }
    f64::INFINITY
}

#[test]
fn from_standstill_beside_the_path_5_mps_take_little_longer_than_on_it() {
    let on_the_path = time_to_5_mps(0.0, 0.0);
    assert!((0.6..1.2).contains(&on_the_path), "{on_the_path} s");
    for heading in [-20.0, -10.0, 0.0, 10.0, 20.0] {
        for offset in [-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0] {
            let time = time_to_5_mps(offset, heading);
            assert!(time <= on_the_path + 0.65, "{offset} m, {heading} degrees: {time} s");
        }
    }
}

#[test]
fn from_standstill_the_agent_returns_to_its_path_without_swinging() {
    for (offset, heading) in [(2.0, 0.0), (-1.0, -20.0), (0.5, 20.0)] {
        let mut drive = standing(offset, heading);
        let mut furthest = 0.0_f64;
        for _ in 0..80 {
            let result = drive.plan(&FrenetSettings::default());
            drive.step(result);
            let (_, d) = drive.place();
            furthest = furthest.max(-d * offset.signum());
        }
        let (_, d) = drive.place();
        assert!(d.abs() < 0.2 && furthest < 0.5, "{offset} m, {heading} degrees: {d} m, {furthest} m beyond");
    }
}

#[test]
fn recorded_yaw_rates_of_slow_vehicles_do_not_turn_their_wheels() {
    // 0.07 rad/s at 0.22 m/s would be the curvature of wheels that are turned all the way.
    let mut drive = standing(-0.4, 0.0);
    (drive.state.velocity, drive.state.yaw_rate) = (0.22, 0.07);
    for _ in 0..20 {
        let result = drive.plan(&FrenetSettings::default());
        drive.step(result);
        assert!(drive.place().1.abs() < 0.5, "{:?}", drive.place());
    }
    assert!(drive.state.velocity > 4.0, "{} m/s", drive.state.velocity);
}

#[test]
fn lateral_end_positions_are_closer_to_each_other_near_the_path() {
    let mut found = standing(0.0, 0.0).candidates(&FrenetSettings::default()).end_offset;
    found.sort_by(f64::total_cmp);
    found.dedup();
    assert_eq!(found, [-3.0, -1.6875, -0.75, -0.1875, 0.0, 0.1875, 0.75, 1.6875, 3.0]);
}
