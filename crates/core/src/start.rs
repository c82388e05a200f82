//! The first state of an agent: the stated values, unless path, speed and past contradict them.
//!
//! First yaw rates and accelerations of recordings are differences of noisy positions in many data sets. A planner that
//! takes them at their word swerves or brakes at once.

use std::f64::consts::TAU;

use crate::geometry::polyline::ReferencePath;
use crate::geometry::wrap_angle;
use crate::trajectory::{State, States};
use crate::vehicle::Vehicle;

/// An agent starts with at most this acceleration, either way [m/s²].
const ACCELERATION_MAX: f64 = 3.0;
/// Of what tyres allow, a first yaw rate may use this share.
const TYRE_SHARE: f64 = 0.5;
/// The past that counts [s], and how many states of it are needed.
const PAST_SPAN: f64 = 1.0;
const PAST_STATES: usize = 4;
/// A yaw rate may differ from those of the path by this much [rad/s], and by this lateral acceleration [m/s²].
const YAW_RATE_TOLERANCE: f64 = 0.3;
const LATERAL_TOLERANCE: f64 = 2.5;
/// The path counts as far as it is reached in this time after the start [s], at least this far [m], and behind the start
/// for a share of that.
const PATH_TIME: f64 = 1.0;
const PATH_DISTANCE: f64 = 5.0;
const BEHIND: f64 = 0.3;
/// Curvature is averaged over this distance to both sides [m], where a vehicle starts over that of half a second.
const SMOOTHING_DISTANCE: f64 = 2.5;
/// A vehicle that heads away from its path turns back to it within this time [s].
const RETURN_TIME: f64 = 1.0;

/// A start with acceleration and yaw rate, within the limits of the vehicle. `stated` has NaN for an acceleration or
/// yaw rate that is not stated; `past` are the states right before, oldest first; `s` is where the
/// rear axle is on the path, if that is known.
///
/// A stated acceleration counts; else the slope of the past speeds; else 0. A stated yaw rate counts unless it
/// contradicts path and speed, and past headings do not confirm it; else the slope of those; else speed times curvature
/// of the path.
pub fn first_state(
    stated: &State,
    past: &[State],
    dt: f64,
    path: &ReferencePath,
    s: Option<f64>,
    vehicle: &Vehicle,
) -> State {
    let orientation = wrap_angle(stated.orientation);
    let past = &past[past.len().saturating_sub(past_steps(dt))..];
    let slope_of = |value: fn(&State) -> f64, period: f64| {
        let values = past.iter().chain([stated]).map(value);
        (past.len() + 1 >= PAST_STATES).then(|| slope(values, period, dt))
    };
    let acceleration = if stated.acceleration.is_finite() {
        stated.acceleration
    } else {
        slope_of(|state| state.velocity, f64::INFINITY).unwrap_or(0.0)
    };
    let turned = slope_of(|state| state.orientation, TAU);
    let (expected, low, high) = path_yaw_rates(&State { orientation, ..*stated }, path, s, vehicle);
    let tolerance = YAW_RATE_TOLERANCE.min(LATERAL_TOLERANCE / stated.velocity.abs().max(0.1));
    let fits = |rate: f64| (low - tolerance..=high + tolerance).contains(&rate);
    let confirmed = |rate: f64| turned.is_some_and(|turned| (rate - turned).abs() <= tolerance);
    let yaw_rate = if stated.yaw_rate.is_finite() && (fits(stated.yaw_rate) || confirmed(stated.yaw_rate)) {
        stated.yaw_rate
    } else {
        turned.filter(|turned| fits(*turned)).unwrap_or(expected)
    };
    let most = yaw_rate_max(vehicle, stated.velocity.abs());
    State {
        orientation,
        acceleration: acceleration.clamp(-ACCELERATION_MAX, ACCELERATION_MAX),
        yaw_rate: yaw_rate.clamp(-most, most),
        ..*stated
    }
}

/// The states of a recording right before a time step that count for a start then, oldest first.
pub fn past_states(recorded: &States, row: usize, time_step: i64, dt: f64) -> Vec<State> {
    let mut found: Vec<State> = (1..=past_steps(dt) as i64).map_while(|i| recorded.get(row, time_step - i)).collect();
    found.reverse();
    found
}

/// Number of states of the past that count.
fn past_steps(dt: f64) -> usize {
    (PAST_SPAN / dt).round() as usize
}

/// Largest yaw rate for steering and, with a reserve, tyres at a speed [rad/s].
fn yaw_rate_max(vehicle: &Vehicle, speed: f64) -> f64 {
    (vehicle.curvature_max() * speed).min(TYRE_SHARE * vehicle.lateral_acceleration_max / speed.max(0.1))
}

/// Yaw rate that follows the path at the present speed; the lowest and highest one near the start, returning to the path
/// included [rad/s].
fn path_yaw_rates(state: &State, path: &ReferencePath, s: Option<f64>, vehicle: &Vehicle) -> (f64, f64, f64) {
    let rear_axle = vehicle.rear_axle_from_center(state.pose());
    let Some(s) = s.or_else(|| path.project(rear_axle).map(|(s, _)| s)) else { return (0.0, 0.0, 0.0) };
    // Maps have kinks, so that the curvature at a point says little.
    let yaw_rate = |s: f64, half: f64| {
        let (from, to) = ((s - half).clamp(0.0, path.length()), (s + half).clamp(0.0, path.length()));
        if to > from { state.velocity * (path.at(to).theta - path.at(from).theta) / (to - from) } else { 0.0 }
    };
    let reach = (state.velocity.abs() * PATH_TIME).max(PATH_DISTANCE);
    let steps = reach.ceil();
    let near = (0..=steps as usize)
        .map(|step| yaw_rate(s + reach * ((1.0 + BEHIND) * step as f64 / steps - BEHIND), SMOOTHING_DISTANCE));
    let (low, high) =
        near.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), rate| (low.min(rate), high.max(rate)));
    let back = -wrap_angle(state.orientation - path.at(s).theta) / RETURN_TIME;
    let expected = yaw_rate(s, SMOOTHING_DISTANCE.max(0.5 * PATH_TIME * state.velocity.abs()));
    (expected, low + back.min(0.0), high + back.max(0.0))
}

/// Slope of the straight line through values one time step apart [1/s]; of angles with a period of TAU.
fn slope(values: impl Iterator<Item = f64>, period: f64, dt: f64) -> f64 {
    let mut unwrapped: Vec<f64> = Vec::new();
    for value in values {
        let value = match unwrapped.last() {
            Some(last) if period.is_finite() => last + wrap_angle(value - last),
            _ => value,
        };
        unwrapped.push(value);
    }
    let middle = 0.5 * (unwrapped.len() - 1) as f64;
    let (mut product, mut square) = (0.0, 0.0);
    for (i, value) in unwrapped.iter().enumerate() {
        let time = i as f64 - middle;
        product += time * value;
        square += time * time;
    }
    product / (square * dt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::vehicle::ParticipantKind;

    const DT: f64 = 0.1;
    /// The curvature of a straight path is not exactly 0.
    const YAW_RATE_TOLERANCE: f64 = 2e-3;

    /// A path along x, then a left turn with a radius of 15 m from x = 150 m on.
    fn path() -> ReferencePath {
        let straight = (0..150).map(|x| Point::new(f64::from(x), 0.0));
        let turn =
            (0..24).map(|i| f64::from(i) / 15.0).map(|a| Point::new(150.0 + 15.0 * a.sin(), 15.0 - 15.0 * a.cos()));
        ReferencePath::through(&straight.chain(turn).collect::<Vec<_>>()).expect("a path")
    }

    fn at(x: f64, velocity: f64, yaw_rate: f64) -> State {
        State { x, velocity, acceleration: f64::NAN, yaw_rate, ..State::default() }
    }

    fn yaw_rate(stated: &State, past: &[State]) -> f64 {
        let vehicle = Vehicle::for_footprint(ParticipantKind::Car, 4.5, 1.8).expect("a car");
        first_state(stated, past, DT, &path(), None, &vehicle).yaw_rate
    }

    /// One second of states before `now`, with constant yaw rate and acceleration.
    fn past(now: &State, yaw_rate: f64, acceleration: f64) -> Vec<State> {
        let before = |i: i32| {
            let time = f64::from(i) * DT;
            State {
                x: now.x + now.velocity * time,
                orientation: now.orientation + yaw_rate * time,
                velocity: now.velocity + acceleration * time,
                ..State::default()
            }
        };
        (-10..0).map(before).collect()
    }

    #[test]
    fn a_yaw_rate_that_no_path_explains_is_replaced_by_that_of_the_path() {
        for (velocity, stated, expected) in [
            (10.8, 0.37, 0.0),
            (10.8, -0.37, 0.0),
            (30.0, 0.1, 0.0),
            (3.0, -0.5, 0.0),
            (-3.0, 0.5, 0.0),
            (10.8, 0.2, 0.2),
            (10.8, -0.2, -0.2),
            (30.0, 0.05, 0.05),
            (10.8, f64::NAN, 0.0),
        ] {
            let found = yaw_rate(&at(20.0, velocity, stated), &[]);
            assert!((found - expected).abs() < YAW_RATE_TOLERANCE, "{stated} rad/s at {velocity} m/s became {found}");
        }
    }

    #[test]
    fn a_vehicle_inside_a_turn_keeps_its_yaw_rate_and_one_that_states_none_gets_that_of_the_turn() {
        let (angle, velocity) = (0.5_f64, 5.0);
        let inside = |yaw_rate| State {
            x: 150.0 + 15.0 * angle.sin(),
            y: 15.0 - 15.0 * angle.cos(),
            orientation: angle,
            ..at(0.0, velocity, yaw_rate)
        };
        for stated in [0.2, 0.33, 0.5] {
            assert_eq!(yaw_rate(&inside(stated), &[]), stated, "rad/s");
        }
        for stated in [f64::NAN, -0.4] {
            let found = yaw_rate(&inside(stated), &[]);
            assert!((found - velocity / 15.0).abs() < 0.05, "{stated} rad/s became {found}");
        }
    }

    #[test]
    fn a_vehicle_that_heads_away_may_turn_back_to_its_path_quickly() {
        let askew = |yaw_rate| State { orientation: 0.3, ..at(20.0, 8.0, yaw_rate) };
        assert_eq!(yaw_rate(&askew(-0.42), &[]), -0.42, "back");
        assert!(yaw_rate(&askew(0.55), &[]).abs() < YAW_RATE_TOLERANCE, "further away");
    }

    #[test]
    fn the_past_confirms_a_yaw_rate_or_replaces_it() {
        let off_road = at(20.0, 8.0, 0.42);
        assert_eq!(yaw_rate(&off_road, &past(&off_road, 0.41, 0.0)), 0.42, "turns off the path, as it did before");
        let noisy = at(20.0, 8.0, 0.42);
        assert!((yaw_rate(&noisy, &past(&noisy, 0.05, 0.0)) - 0.05).abs() < 1e-9, "went on almost straight");
        let short = &past(&noisy, 0.05, 0.0)[8..];
        assert!(yaw_rate(&noisy, short).abs() < YAW_RATE_TOLERANCE, "two states say nothing");
        let turned = State { orientation: std::f64::consts::PI, ..at(20.0, 0.3, f64::NAN) };
        assert!(yaw_rate(&turned, &past(&turned, 0.05, 0.0)).abs() < 0.06, "no jump at pi");
    }

    #[test]
    fn a_missing_acceleration_is_the_slope_of_past_speeds_and_a_stated_one_is_bounded() {
        let vehicle = Vehicle::for_footprint(ParticipantKind::Car, 4.5, 1.8).expect("a car");
        let start = |acceleration: f64, past: &[State]| {
            let stated = State { acceleration, ..at(20.0, 8.0, 0.0) };
            first_state(&stated, past, DT, &path(), None, &vehicle).acceleration
        };
        let braking = past(&at(20.0, 8.0, 0.0), 0.0, -1.5);
        assert!((start(f64::NAN, &braking) + 1.5).abs() < 1e-9, "m/s^2");
        assert_eq!(start(f64::NAN, &[]), 0.0);
        assert_eq!(start(-0.7, &braking), -0.7);
        assert_eq!(start(-40.0, &[]), -3.0);
    }
}
