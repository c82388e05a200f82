//! Can the vehicle drive it? Limits per point, with a way back for a start that violates them.
//!
//! Recorded initial states are noisy: the start itself may exceed a limit. Then the limit begins at the value of the
//! start (and a tenth of the excess more) and shrinks linearly to its true value over 1.5 s.

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use crate::vehicle::Vehicle;

/// Time in which an excess of the start must be gone [s].
const RECOVERY_TIME: f64 = 1.5;
/// Acceleration along the path may exceed that of the vehicle by this factor: on the inside of bends it does.
const PATH_FACTOR: f64 = 1.25;
/// Rounding, and steps of the path's curvature rate: [m/s²], [1/m].
const ACCELERATION_ROUNDING: f64 = 1e-6;
const CURVATURE_ROUNDING: f64 = 1e-3;
/// Heading differences below this [rad] are never too fast.
const HEADING_ROUNDING: f64 = 1e-4;

/// Why a sample is not chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Rejection {
    /// It may be driven.
    Admissible = 0,
    /// More acceleration or deceleration than the vehicle has.
    Acceleration = 1,
    /// More curvature than full steering gives.
    Curvature = 2,
    /// The steering would have to turn too fast.
    SteeringRate = 3,
    /// The heading changes faster than full steering allows at that speed.
    YawRate = 4,
    /// More lateral acceleration than the tyres hold.
    LateralAcceleration = 5,
    /// It goes backwards.
    NegativeSpeed = 6,
    /// It runs past an end of the reference path, or to the centre of its curvature.
    LeftPath = 7,
    /// It hits a participant.
    Collision = 8,
    /// The footprint leaves the road.
    OffRoad = 9,
    /// It passes the line of a red light or a stop sign.
    StopLine = 10,
}

impl Rejection {
    /// In words; empty for an admissible sample. `collision_id` is the participant that is hit.
    pub fn words(self, collision_id: i64) -> String {
        match self {
            Self::Admissible => String::new(),
            Self::Acceleration => "acceleration".into(),
            Self::Curvature => "curvature".into(),
            Self::SteeringRate => "steering rate".into(),
            Self::YawRate => "yaw rate".into(),
            Self::LateralAcceleration => "lateral acceleration".into(),
            Self::NegativeSpeed => "negative speed".into(),
            Self::LeftPath => "left the reference path".into(),
            Self::Collision => format!("collision with {collision_id}"),
            Self::OffRoad => "off the road".into(),
            Self::StopLine => "stop line".into(),
        }
    }

    /// The first reason counts.
    #[inline]
    pub(super) fn or(self, other: Self) -> Self {
        if self == Self::Admissible { other } else { self }
    }
}

/// Limits of the vehicle, prepared for one plan.
#[derive(Debug, Clone)]
pub(super) struct Limits {
    pub(super) n_points: usize,
    pub(super) dt: f64,
    pub(super) acceleration_max: f64,
    pub(super) velocity_max: f64,
    vehicle: Vehicle,
    curvature_max: f64,
    /// Tangent of the steering angle's largest change in one step.
    steering_step: f64,
    /// By how much the start exceeds the limits of deceleration, acceleration and lateral acceleration [m/s²].
    excess: [f64; 3],
    has_excess: bool,
}

impl Limits {
    pub(super) fn new(request: &PlanRequest, n_points: usize, start_curvature: f64) -> Self {
        let vehicle = *request.vehicle;
        let state = &request.state;
        let lateral = (state.velocity * state.velocity * start_curvature).abs();
        let excess = [
            -state.acceleration - vehicle.acceleration_max,
            state.acceleration - vehicle.forward_acceleration_max(state.velocity),
            lateral - vehicle.lateral_acceleration_max,
        ];
        Self {
            n_points,
            dt: request.dt,
            acceleration_max: vehicle.acceleration_max,
            velocity_max: vehicle.velocity_max,
            curvature_max: vehicle.curvature_max(),
            steering_step: vehicle.steering_step(request.dt),
            excess: excess.map(|e| 1.1 * e.max(0.0)),
            has_excess: excess.iter().any(|e| *e > 0.0),
            vehicle,
        }
    }

    /// How fast the curvature can change while the wheels point straight ahead [1/(m s)].
    pub(super) fn curvature_rate(&self) -> f64 {
        self.vehicle.steering_rate_max / self.vehicle.wheelbase
    }

    /// Time of the last point [s].
    pub(super) fn horizon(&self) -> f64 {
        (self.n_points - 1) as f64 * self.dt
    }

    /// How much more than the limits of deceleration, acceleration and lateral acceleration is allowed at a point.
    fn recovery(&self, point: usize) -> [f64; 3] {
        if !self.has_excess {
            return [0.0; 3];
        }
        let rest = (1.0 - point as f64 * self.dt / RECOVERY_TIME).max(0.0);
        let [braking, driving, cornering] = self.excess;
        [braking * rest, driving * rest, cornering * rest]
    }

    /// A coarse check of the motion along the path that spares its samples the fine one.
    #[inline]
    pub(super) fn check_along_path(&self, s_dot: f64, s_ddot: f64, point: usize) -> Rejection {
        let [braking, driving, _] = self.recovery(point);
        let limit = if s_ddot > 0.0 {
            self.vehicle.forward_acceleration_max(s_dot / PATH_FACTOR) + driving
        } else {
            self.acceleration_max + braking
        };
        if s_ddot.abs() > PATH_FACTOR * limit { Rejection::Acceleration } else { Rejection::Admissible }
    }

    /// Checks point number `point` and the step to it from `before`; the first limit that is broken counts.
    ///
    /// The change of the steering angle atan(L k) is exact: its tangent is L (k2 - k1) / (1 + L² k1 k2).
    pub(super) fn check(&self, before: &Waypoint, now: &Waypoint, point: usize) -> Rejection {
        let [braking, driving, cornering] = self.recovery(point);
        let forward = self.vehicle.forward_acceleration_max(now.velocity) + driving;
        let available = if now.acceleration > 0.0 { forward } else { self.acceleration_max + braking };
        let limit = self.curvature_max + CURVATURE_ROUNDING;
        let lateral = now.velocity * now.velocity * now.curvature.abs();
        let held = self.vehicle.lateral_acceleration_max + cornering + ACCELERATION_ROUNDING;
        let l = self.vehicle.wheelbase;
        let step = l * ((now.curvature - before.curvature).abs() - CURVATURE_ROUNDING);
        let step_max = self.steering_step * (1.0 + l * l * now.curvature * before.curvature).max(0.0);
        let turn = before.axis.cross(now.axis).abs();
        let turn_max = limit * before.velocity.max(now.velocity) * self.dt + HEADING_ROUNDING;
        if now.acceleration.abs() > available + ACCELERATION_ROUNDING {
            Rejection::Acceleration
        } else if now.curvature.abs() > limit {
            Rejection::Curvature
        } else if lateral > held {
            Rejection::LateralAcceleration
        } else if step > step_max {
            Rejection::SteeringRate
        } else if turn > turn_max {
            Rejection::YawRate
        } else {
            Rejection::Admissible
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::plan::testing::Drive;
    use crate::trajectory::State;

    /// A vehicle of round numbers: 0.2 /m of curvature, 8 m/s² up to 10 m/s, then less; 6 m/s² to the side.
    fn vehicle() -> Vehicle {
        Vehicle {
            wheelbase: 2.5,
            steering_angle_max: 0.5_f64.atan(),
            steering_rate_max: 0.4,
            acceleration_max: 8.0,
            velocity_switch: 10.0,
            lateral_acceleration_max: 6.0,
            ..Vehicle::BMW_320I
        }
    }

    /// Its limits for 31 points, 0.1 s apart, from a start with a speed, an acceleration and a curvature.
    fn limits_from(vehicle: &Vehicle, velocity: f64, acceleration: f64, curvature: f64) -> Limits {
        Drive::on_three_lanes(50.0, velocity).with_request(|request| {
            let state = State { velocity, acceleration, ..State::default() };
            Limits::new(&PlanRequest { vehicle, state, ..*request }, 31, curvature)
        })
    }

    fn limits() -> Limits {
        limits_from(&vehicle(), 5.0, 0.0, 0.0)
    }

    fn point(velocity: f64, acceleration: f64, curvature: f64, heading: f64) -> Waypoint {
        Waypoint { velocity, acceleration, curvature, axis: Point::from_angle(heading), ..Waypoint::default() }
    }

    #[test]
    fn each_limit_is_broken_just_beyond_its_value() {
        use Rejection::{Acceleration, Admissible, Curvature, LateralAcceleration, SteeringRate, YawRate};
        let steady = |velocity: f64, acceleration: f64, curvature: f64| {
            let now = point(velocity, acceleration, curvature, 0.0);
            (now, now)
        };
        let steered = |before: f64, now: f64| (point(1.0, 0.0, before, 0.0), point(1.0, 0.0, now, 0.0));
        let turned =
            |before: f64, now: f64, sine: f64| (point(before, 0.0, 0.0, 0.0), point(now, 0.0, 0.0, f64::asin(sine)));
        for ((before, now), expected) in [
            (steady(5.0, 8.0 + 5e-7, 0.0), Admissible),
            (steady(5.0, 8.0 + 2e-6, 0.0), Acceleration),
            (steady(5.0, -8.0 - 5e-7, 0.0), Admissible),
            (steady(5.0, -8.0 - 2e-6, 0.0), Acceleration),
            // The engine's limit at 20 m/s is 8 * 10 / 20; the brakes have none.
            (steady(20.0, 4.0 + 5e-7, 0.0), Admissible),
            (steady(20.0, 4.0 + 2e-6, 0.0), Acceleration),
            (steady(20.0, -8.0, 0.0), Admissible),
            (steady(1.0, 0.0, 0.2009), Admissible),
            (steady(1.0, 0.0, 0.2011), Curvature),
            // 10² * 0.06 = 6
            (steady(10.0, 0.0, 0.06), Admissible),
            (steady(10.0, 0.0, 0.060001), LateralAcceleration),
            // atan(2.5 k) by 0.04 rad: from straight ahead to tan(0.04) / 2.5 = 0.016009 and 0.001 of rounding; from 0.1
            // the change d holds 2.5 (d - 0.001) = tan(0.04) (1 + 6.25 * 0.1 (0.1 + d)).
            (steered(0.0, 0.01700), Admissible),
            (steered(0.0, 0.01702), SteeringRate),
            (steered(0.01700, 0.0), Admissible),
            (steered(0.01702, 0.0), SteeringRate),
            (steered(0.1, 0.11818), Admissible),
            (steered(0.1, 0.11820), SteeringRate),
            (steered(-0.0085, 0.0085), Admissible),
            // At the higher speed, the sine of the turn is at most 0.201 /m * 2 m/s * 0.1 s + 0.0001 = 0.0403.
            (turned(2.0, 1.0, 0.0402), Admissible),
            (turned(2.0, 1.0, 0.0404), YawRate),
            (turned(1.0, 2.0, 0.0402), Admissible),
            (turned(1.0, 2.0, 0.0404), YawRate),
            // The first reason counts.
            (steady(10.0, 9.0, 0.3), Acceleration),
        ] {
            assert_eq!(limits().check(&before, &now, 1), expected, "{before:?} to {now:?}");
            let mirrored =
                |p: Waypoint| Waypoint { curvature: -p.curvature, axis: Point::new(p.axis.x, -p.axis.y), ..p };
            assert_eq!(limits().check(&mirrored(before), &mirrored(now), 1), expected, "to the other side");
        }
        for (first, second, expected) in
            [(Admissible, YawRate, YawRate), (Curvature, YawRate, Curvature), (Curvature, Admissible, Curvature)]
        {
            assert_eq!(first.or(second), expected);
        }
    }

    #[test]
    fn a_start_beyond_a_limit_gets_its_excess_and_a_tenth_more_which_is_gone_after_1500_ms() {
        // 2 m/s² too much: 2.2 at the start, 2.2 * (1 - 0.5 / 1.5) at point 5, nothing from point 15 on.
        let driving = limits_from(&vehicle(), 5.0, 10.0, 0.0);
        let braking = limits_from(&vehicle(), 20.0, -10.0, 0.0);
        let cornering = limits_from(&vehicle(), 10.0, 0.0, -0.08);
        for (number, more) in [(0, 2.2), (5, 4.4 / 3.0), (15, 0.0), (30, 0.0)] {
            for (limits, expected) in
                [(&driving, [0.0, more, 0.0]), (&braking, [more, 0.0, 0.0]), (&cornering, [0.0, 0.0, more])]
            {
                let found = limits.recovery(number);
                assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{number}: {found:?}");
            }
            for (beyond, expected) in [(-1e-4, Rejection::Admissible), (1e-4, Rejection::Acceleration)] {
                let faster = point(5.0, 8.0 + more + beyond, 0.0, 0.0);
                assert_eq!(driving.check(&faster, &faster, number), expected, "{number}");
                let slower = point(5.0, -8.0 - more - beyond, 0.0, 0.0);
                assert_eq!(braking.check(&slower, &slower, number), expected, "{number}");
                let bent = point(10.0, 0.0, 0.01 * (6.0 + more + beyond), 0.0);
                let is_lateral = cornering.check(&bent, &bent, number) == Rejection::LateralAcceleration;
                assert_eq!(is_lateral, beyond > 0.0, "{number}");
                // Along the path a quarter more is allowed.
                assert_eq!(driving.check_along_path(5.0, 1.25 * (8.0 + more + beyond), number), expected);
                assert_eq!(braking.check_along_path(20.0, -1.25 * (8.0 + more + beyond), number), expected);
            }
        }
        // The engine's limit at 20 m/s is 4 m/s².
        assert!((limits_from(&vehicle(), 20.0, 5.0, 0.0).recovery(0)[1] - 1.1).abs() < 1e-12);
        assert_eq!(limits_from(&vehicle(), 5.0, 8.0, 0.2).recovery(0), [0.0; 3], "at the limits, not beyond");
    }

    #[test]
    fn steering_from_side_to_side_within_a_step_has_no_limit() {
        let swift = Vehicle { steering_rate_max: 20.0, ..vehicle() };
        let free = limits_from(&swift, 5.0, 0.0, 0.0);
        assert_eq!(free.check(&point(1.0, 0.0, -0.2, 0.0), &point(1.0, 0.0, 0.2, 0.0), 1), Rejection::Admissible);
        assert!((free.horizon() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn along_the_path_a_quarter_more_is_allowed_as_on_the_inside_of_a_bend() {
        for (s_dot, s_ddot, expected) in [
            (5.0, 9.999, Rejection::Admissible),
            (5.0, 10.001, Rejection::Acceleration),
            (5.0, -9.999, Rejection::Admissible),
            (5.0, -10.001, Rejection::Acceleration),
            // 25 / 1.25 = 20 m/s, where the engine gives 4 m/s².
            (25.0, 4.999, Rejection::Admissible),
            (25.0, 5.001, Rejection::Acceleration),
            (25.0, -9.999, Rejection::Admissible),
            (25.0, 0.0, Rejection::Admissible),
        ] {
            assert_eq!(limits().check_along_path(s_dot, s_ddot, 3), expected, "{s_ddot} m/s² at {s_dot} m/s");
        }
    }
}
