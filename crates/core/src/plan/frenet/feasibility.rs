//! Can the vehicle drive it? Limits per point, with a way back for a start that violates them.
//!
//! Recorded initial states are noisy: the start itself may exceed a limit. Then the limit begins at the value of the
//! start (and a tenth of the excess more) and shrinks linearly to its true value over 1.5 s.

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use crate::geometry::Point;
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
}

impl Rejection {
    /// The first reason counts.
    #[inline]
    pub(super) fn or(self, other: Self) -> Self {
        if self == Self::Admissible { other } else { self }
    }
}

/// Conditions under which a motion along the path surely breaks no limit of the vehicle.
#[derive(Debug, Clone, Copy)]
pub(super) struct AlongPath {
    /// Speed that still counts as 0 [m/s].
    lowest: f32,
    /// [m/s²]
    acceleration: f32,
    /// Acceleration times speed [m²/s³].
    power: f32,
    /// Lateral polynomials of time are for speeds from this on [m/s].
    pub(super) low_velocity: f32,
}

impl AlongPath {
    #[inline(always)]
    pub(super) fn surely_holds(&self, s_dot: f32, s_ddot: f32) -> bool {
        (s_dot >= self.lowest) & (s_ddot.abs() <= self.acceleration) & (s_ddot * s_dot <= self.power)
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
    /// `slack` is a factor of the steering rate and the lateral acceleration.
    pub(super) fn new(request: &PlanRequest, n_points: usize, start_curvature: f64, slack: f64) -> Self {
        let mut vehicle = *request.vehicle;
        vehicle.steering_rate_max *= slack;
        vehicle.lateral_acceleration_max *= slack;
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
            steering_step: (vehicle.steering_rate_max * request.dt).min(1.5).tan(),
            excess: excess.map(|e| 1.1 * e.max(0.0)),
            has_excess: excess.iter().any(|e| *e > 0.0),
            vehicle,
        }
    }

    /// Time of the last point [s].
    pub(super) fn horizon(&self) -> f64 {
        (self.n_points - 1) as f64 * self.dt
    }

    /// How much more than the limits of deceleration, acceleration and lateral acceleration is allowed at a point.
    #[inline(always)]
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

    /// A quick form of `check_along_path`.
    pub(super) fn along_path(&self, rounding: f64, low_velocity: f64) -> AlongPath {
        /// A little less than the limits, so that single precision makes doubt and not certainty.
        const SAFETY: f64 = 1.0 - 1e-3;
        let acceleration = SAFETY * PATH_FACTOR * self.acceleration_max;
        let power = acceleration * PATH_FACTOR * self.vehicle.velocity_switch;
        AlongPath {
            lowest: (-0.5 * rounding) as f32,
            acceleration: acceleration as f32,
            power: power as f32,
            low_velocity: low_velocity as f32,
        }
    }

    /// Checks point number `point` and the step to it from `before`.
    #[inline]
    pub(super) fn check(&self, before: &Waypoint, now: &Waypoint, point: usize) -> Rejection {
        const REASONS: [Rejection; 5] = [
            Rejection::Acceleration,
            Rejection::Curvature,
            Rejection::LateralAcceleration,
            Rejection::SteeringRate,
            Rejection::YawRate,
        ];
        let broken = self.broken(&Turning::of(before), &Turning::of(now), now.acceleration, point);
        broken.iter().position(|is_broken| *is_broken).map_or(Rejection::Admissible, |i| REASONS[i])
    }

    /// Which limits are broken: acceleration, curvature, lateral acceleration, steering rate, yaw rate.
    ///
    /// The change of the steering angle atan(L k) is exact: its tangent is L (k2 - k1) / (1 + L² k1 k2).
    #[inline(always)]
    pub(super) fn broken(&self, before: &Turning, now: &Turning, acceleration: f64, point: usize) -> [bool; 5] {
        let [braking, driving, cornering] = self.recovery(point);
        let forward = self.vehicle.forward_acceleration_max(now.velocity) + driving;
        let available = if acceleration > 0.0 { forward } else { self.acceleration_max + braking };
        let limit = self.curvature_max + CURVATURE_ROUNDING;
        let lateral = now.velocity * now.velocity * now.curvature.abs();
        let l = self.vehicle.wheelbase;
        let step = (now.curvature - before.curvature).abs() - CURVATURE_ROUNDING;
        let turn = before.axis.cross(now.axis).abs();
        [
            acceleration.abs() > available + ACCELERATION_ROUNDING,
            now.curvature.abs() > limit,
            lateral > self.vehicle.lateral_acceleration_max + cornering + ACCELERATION_ROUNDING,
            l * step > self.steering_step * (1.0 + l * l * now.curvature * before.curvature).max(0.0),
            turn > limit * before.velocity.max(now.velocity) * self.dt + HEADING_ROUNDING,
        ]
    }
}

/// What limits of turning look at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turning {
    pub(super) axis: Point,
    pub(super) curvature: f64,
    pub(super) velocity: f64,
}

impl Turning {
    #[inline(always)]
    fn of(point: &Waypoint) -> Self {
        Self { axis: point.axis, curvature: point.curvature, velocity: point.velocity }
    }
}
