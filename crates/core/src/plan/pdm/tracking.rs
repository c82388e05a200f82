//! A proposal is followed by a linear-quadratic tracker on a kinematic single-track model with lags, as in the published
//! planner, within the limits of the vehicle.

use super::super::PlanRequest;
use super::super::driven_point::DrivenPoint;
use super::super::path_motion::point_at;
use crate::geometry::{Point, wrap_angle};
use crate::trajectory::State;

/// Look-ahead of the tracker in steps, and their length [s].
const STEPS: usize = 10;
const STEP: f64 = 0.1;
/// Weights: of the speed; of the offset and the heading; those of the acceleration and the steering rate are 1.
const SPEED_WEIGHT: f64 = 10.0;
const OFFSET_WEIGHT: f64 = 1.0;
const HEADING_WEIGHT: f64 = 10.0;
/// A vehicle and a proposal that are slower than this [m/s] come to rest with this gain [1/s], the wheels as they are.
const STOPPING_SPEED: f64 = 0.2;
const STOPPING_GAIN: f64 = 0.5;
/// Lags of the acceleration and of the steering angle [s].
const ACCELERATION_LAG: f64 = 0.2;
const STEERING_LAG: f64 = 0.05;
/// Share of the vehicle's limits that is used: rounding must not exceed them.
const LIMIT_SHARE: f64 = 0.98;
/// The arc length of the foot follows where the path bends around the vehicle by at least this stretch.
const STRETCH_MIN: f64 = 0.2;

/// Where a proposal starts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    pub(super) s: f64,
    pub(super) d: f64,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    pub(super) curvature: f64,
}

/// What the tracker follows.
#[derive(Debug, Clone, Copy)]
pub(super) enum Pace<'a> {
    /// Speeds at the points [m/s].
    Speeds(&'a [f64]),
    /// Braking [m/s²].
    Braking(f64),
}

impl Pace<'_> {
    /// Acceleration that the tracker asks for at a point [m/s²].
    fn acceleration(self, point: usize, ahead: usize, velocity: f64) -> f64 {
        match self {
            Self::Braking(deceleration) => -deceleration,
            Self::Speeds(speeds) => {
                let target = speeds[(point + ahead).min(speeds.len() - 1)];
                if velocity <= STOPPING_SPEED && target <= STOPPING_SPEED {
                    return -STOPPING_GAIN * (velocity - target);
                }
                // Least squares over the look-ahead with one acceleration.
                let time = STEPS as f64 * STEP;
                SPEED_WEIGHT * time * (target - velocity) / (SPEED_WEIGHT * time * time + 1.0)
            }
        }
    }
}

/// The steering rate [rad/s] that brings offset [m] and heading [rad] back to those of a path within the look-ahead, for a
/// steering angle [rad], a wheelbase [m], and the speed [m/s] and the path's curvature [1/m] at each step.
fn steering_rate(
    (offset, heading, angle): (f64, f64, f64),
    wheelbase: f64,
    ahead: impl Iterator<Item = (f64, f64)>,
) -> f64 {
    // What becomes of the errors without steering, and what a steering rate of 1 adds.
    let mut free = [offset, heading, angle];
    let mut gain = [0.0; 3];
    for (velocity, curvature) in ahead.take(STEPS) {
        let way = velocity * STEP;
        free = [free[0] + way * free[1], free[1] + way * (free[2] / wheelbase - curvature), free[2]];
        gain = [gain[0] + way * gain[1], gain[1] + way * gain[2] / wheelbase, gain[2] + STEP];
    }
    let pull = OFFSET_WEIGHT * gain[0] * free[0] + HEADING_WEIGHT * gain[1] * free[1];
    let stiffness = OFFSET_WEIGHT * gain[0] * gain[0] + HEADING_WEIGHT * gain[1] * gain[1] + 1.0;
    -pull / stiffness
}

/// Follows a proposal along the path at an offset [m], over points this far apart [s].
pub(super) fn track(
    request: &PlanRequest,
    origin: &Origin,
    (target, pace): (f64, Pace<'_>),
    (n_points, step): (usize, f64),
    out: &mut Vec<DrivenPoint>,
) {
    let (vehicle, path) = (request.vehicle, &request.route.path);
    let (tightest, turn) = (vehicle.curvature_max(), LIMIT_SHARE * vehicle.steering_step(step));
    let ahead = (STEPS as f64 * STEP / step).round() as usize;
    let mut axle = vehicle.rear_axle_from_center(request.state.pose());
    let mut theta = request.state.orientation;
    let Origin { mut s, mut d, mut velocity, mut acceleration, mut curvature } = *origin;
    let mut at = point_at(path, s);
    out.clear();
    for point in 0..n_points {
        let axis = Point::from_angle(theta);
        let center = axle + axis * vehicle.rear_axle_to_center;
        out.push(DrivenPoint { center, axis, theta, curvature, velocity, acceleration, s, d });
        let wanted = pace.acceleration(point, ahead, velocity);
        let lag = if matches!(pace, Pace::Braking(_)) { 0.0 } else { ACCELERATION_LAG };
        acceleration += step / (step + lag) * (wanted - acceleration);
        acceleration = acceleration.clamp(-vehicle.acceleration_max, vehicle.forward_acceleration_max(velocity));
        let angle = (vehicle.wheelbase * curvature).atan();
        let comes_to_rest = velocity <= STOPPING_SPEED && wanted <= 0.0;
        let rate = if comes_to_rest {
            0.0
        } else {
            let mut way = 0.0;
            let profile = (0..STEPS).map(|i| {
                let speed = (velocity + wanted * i as f64 * STEP).max(0.0);
                let here = path.curvature_at(s + way);
                way += speed * STEP;
                (speed, here / (1.0 - here * target).max(STRETCH_MIN))
            });
            steering_rate((d - target, wrap_angle(theta - at.theta), angle), vehicle.wheelbase, profile)
        };
        let turned = angle + step / (step + STEERING_LAG) * rate * step;
        let before = velocity;
        velocity = (velocity + acceleration * step).max(0.0);
        let fastest = velocity.max(before);
        let held = LIMIT_SHARE * vehicle.lateral_acceleration_beside(acceleration) / fastest.powi(2).max(1e-6);
        let wheels = turned.clamp(-1.5, 1.5).tan() / vehicle.wheelbase;
        let next = vehicle.turned(curvature, wheels, turn, tightest.min(held));
        let way = 0.5 * (before + velocity) * step;
        let bend = 0.5 * (curvature + next) * way;
        axle = axle + Point::from_angle(theta + 0.5 * bend) * way;
        theta += bend;
        curvature = next;
        // One step of Newton's method to the foot.
        at = point_at(path, s + way);
        let offset = axle - at.position;
        d = at.tangent().cross(offset);
        let further = offset.dot(at.tangent()) / at.stretch(d).max(STRETCH_MIN);
        s += way + further.clamp(-2.0 * way - 0.1, 2.0 * way + 0.1);
    }
}

/// States of the footprint centre at every so many points; the first is that of the request.
pub(super) fn states(request: &PlanRequest, points: &[DrivenPoint], every: usize) -> Vec<State> {
    let mut states: Vec<State> = Vec::with_capacity(points.len() / every + 1);
    for point in points.iter().step_by(every) {
        let before = states.last().map_or(request.state.velocity, |state: &State| state.velocity);
        states.push(State {
            x: point.center.x,
            y: point.center.y,
            orientation: point.theta,
            velocity: point.velocity,
            acceleration: (point.velocity - before) / request.dt,
            yaw_rate: point.curvature * point.velocity,
        });
    }
    states[0] = request.state;
    states
}

#[cfg(test)]
mod tests {
    use super::{Pace, steering_rate};

    #[test]
    fn on_the_path_the_wheels_stay_as_they_are() {
        // A bend of 20 m: the tangent of the steering angle is the wheelbase over the radius.
        let angle = (2.5_f64 / 20.0).atan();
        let rate = steering_rate((0.0, 0.0, angle), 2.5, (0..10).map(|_| (8.0, angle / 2.5)));
        assert!(rate.abs() < 1e-12, "{rate} rad/s");
    }

    #[test]
    fn it_steers_back_to_the_path_from_either_side() {
        let rate = |offset: f64, heading: f64| steering_rate((offset, heading, 0.0), 2.5, (0..10).map(|_| (8.0, 0.0)));
        assert!(rate(0.5, 0.0) < 0.0 && rate(0.0, 0.1) < 0.0);
        assert!((rate(0.5, 0.1) + rate(-0.5, -0.1)).abs() < 1e-12);
        // Where nothing moves, steering helps nothing.
        assert_eq!(steering_rate((1.0, 0.0, 0.0), 2.5, std::iter::repeat_n((0.0, 0.0), 10)), 0.0);
    }

    #[test]
    fn the_acceleration_closes_ten_elevenths_of_a_difference_of_speeds_in_a_second() {
        let speeds = vec![11.0; 41];
        assert!((Pace::Speeds(&speeds).acceleration(0, 10, 0.0) - 10.0).abs() < 1e-12);
        // Nearly at rest: half of the speed per second.
        let stops = vec![0.0; 41];
        assert!((Pace::Speeds(&stops).acceleration(0, 10, 0.1) + 0.05).abs() < 1e-12);
        assert_eq!(Pace::Braking(4.05).acceleration(3, 10, 9.0), -4.05);
    }
}
