//! Samples that are steered instead of fitted: a driver follows the path within the steering rate.
//!
//! A quintic joins two states, whatever steering that takes; where the path bends sharply or the wheels stand askew,
//! nearly all of them turn the wheels too fast. A steered sample follows the path and keeps the limits of steering, so
//! nearly all rejections are contacts and the road.

use super::super::PlanRequest;
use super::super::frame::{STRETCH_MIN, Start, Waypoint};
use super::feasibility::Limits;
use super::grid::SampleGrid;
use super::obstacles::Obstacles;
use super::settings::CostWeights;
use super::targets::Targets;
use super::terms::{FrenetMotion, from_tables};
use super::whole::{Whole, Wholes};
use super::{Bar, length};
use crate::geometry::{Point, wrap_angle};

/// How a sample is steered.
#[derive(Debug, Clone, Copy)]
struct Driver {
    /// How far ahead the driver looks at the path [s].
    preview: f64,
    /// The point that is kept on the path, ahead of the rear axle [wheelbases].
    guided: f64,
}

/// One keeps the rear axle on the path, the other one a point behind the front axle, so that the vehicle cuts a bend as
/// much as it swings out of it.
const DRIVERS: [Driver; 2] = [Driver { preview: 0.6, guided: 0.0 }, Driver { preview: 0.2, guided: 0.8 }];
/// Guided points head this far away from the vehicle's axis at most [rad].
const COURSE_MAX: f64 = 1.2;
/// Offset and heading are corrected over the way of this time [s], but no less than this distance [m].
const CORRECTION_TIME: f64 = 0.6;
const CORRECTION_LENGTH: f64 = 2.5;
/// Offsets beyond this [m] are corrected no harder.
const OFFSET_MAX: f64 = 1.5;
/// Share of the vehicle's limits that is used, so that rounding breaks none.
const SHARE: f64 = 0.98;
/// Drivers head within about 84 degrees of the path (cosine).
const COSINE_MIN: f64 = 0.1;
/// The foot of a point is searched this far around the expected place [m].
const SEARCH_WINDOW: f64 = 3.0;

/// In the place of all that is there: the steered samples of some profiles that may beat a plan, where the obstacles
/// are known.
pub(super) fn steer_all(
    (wholes, obstacles): (&mut Wholes, &Obstacles),
    request: &PlanRequest,
    (start, targets, limits): (&Start, &Targets, &Limits),
    samples: &mut SampleGrid,
    weights: &CostWeights,
    bar: Bar,
) {
    wholes.clear();
    for profile in 0..samples.profiles.len() {
        if !samples.is_steered(profile) {
            continue;
        }
        samples.load_motion(profile);
        let speeds = samples.motions(profile).s_dot;
        if speeds[limits.n_points - 1] <= bar.velocity {
            continue;
        }
        // As if the vehicle drove on the path: no bound of the cost, but those far off are spared.
        let missed = speeds[..limits.n_points].iter().map(|speed| (speed - targets.velocity).powi(2)).sum::<f64>();
        if from_tables(weights, missed.sqrt(), 0.0, 0.0, samples.profiles[profile].jerk) >= bar.cost {
            continue;
        }
        for driver in DRIVERS {
            let whole = wholes.push();
            let last = steer(whole, request, (start, targets, limits), samples, profile, driver);
            let is_before_stop = last.is_some_and(|last| last <= targets.s_max.min(targets.gate.0));
            let comes_further = length(whole.points.iter().map(|point| point.center)) > bar.distance;
            if is_before_stop && comes_further && obstacles.cover(&whole.points) {
                whole.sum_up(limits, targets, weights);
            } else {
                wholes.pop();
            }
        }
    }
}

/// Writes the motion at the speeds of a profile; the last arc length [m], or `None` if it leaves the path.
fn steer(
    whole: &mut Whole,
    request: &PlanRequest,
    (start, targets, limits): (&Start, &Targets, &Limits),
    samples: &SampleGrid,
    profile: usize,
    driver: Driver,
) -> Option<f64> {
    whole.points.clear();
    whole.motions.clear();
    let (vehicle, path) = (request.vehicle, &request.route.path);
    let motion = samples.motions(profile);
    let mut place = vehicle.rear_axle_from_center(request.state.pose());
    let mut heading = request.state.orientation;
    let (mut s, mut d, mut at) = path.project_from(place, start.s, SEARCH_WINDOW)?;
    let ahead_of_axle = driver.guided * vehicle.wheelbase;
    let mut guided_s = s + ahead_of_axle;
    let mut curvature = start.curvature;
    // The profile holds speeds along the path. Beside it in a bend, or askew, the vehicle is faster or slower than its
    // foot; this excess ends with the horizon, as offset and heading do.
    let excess = at.stretch(d).hypot(start.d_prime) - 1.0;
    let mut before = start.velocity;
    for i in 0..limits.n_points {
        let rest = excess * (1.0 - i as f64 / (limits.n_points - 1) as f64);
        let speed = motion.s_dot[i] * (1.0 + rest);
        let acceleration = motion.s_ddot[i] * (1.0 + rest) - motion.s_dot[i] * excess / limits.horizon();
        if i > 0 {
            let distance = CORRECTION_LENGTH.max(CORRECTION_TIME * before);
            let wanted = if ahead_of_axle > 0.0 {
                let guided = place + Point::from_angle(heading) * ahead_of_axle;
                let (foot, offset, _) = path.project_from(guided, guided_s, SEARCH_WINDOW)?;
                guided_s = foot + before * limits.dt;
                let course = path.at(foot + before * driver.preview).theta - heading;
                guide(course, offset - targets.offset, distance) / ahead_of_axle
            } else {
                let ahead = path.curvature_at(s + before * driver.preview);
                corrected(ahead, d - targets.offset, heading - at.theta, distance)
            };
            let mut next = limits.turned(curvature, wanted, (speed.max(before), acceleration), SHARE);
            if i == 1 && start.steers_freely() {
                // Wheels of a standing vehicle turn before it drives off.
                next = limits.freely_turned(wanted);
                curvature = next;
                whole.points[0].curvature = next;
            }
            let way = 0.5 * (before + speed) * limits.dt;
            let turn = 0.5 * (curvature + next) * way;
            place = place + Point::from_angle(heading + 0.5 * turn) * way;
            heading += turn;
            curvature = next;
            (s, d, at) = path.project_from(place, s + way, SEARCH_WINDOW)?;
        }
        let (sin, cos) = wrap_angle(heading - at.theta).sin_cos();
        let stretch = at.stretch(d);
        if cos < COSINE_MIN || stretch < STRETCH_MIN {
            return None;
        }
        let axis = Point::from_angle(heading);
        whole.points.push(Waypoint {
            center: place + axis * vehicle.rear_axle_to_center,
            axis,
            path_theta: at.theta,
            tan_offset: sin / cos,
            curvature,
            velocity: speed,
            acceleration,
            d,
        });
        before = speed;
        whole.motions.push(FrenetMotion {
            s_dot: speed * cos / stretch,
            d_dot: speed * sin,
            ..FrenetMotion::default()
        });
    }
    Some(s)
}

/// The curvature with which a driver goes on who corrects offset [m] and heading [rad] over a distance [m]: critically
/// damped, in the frame of the path.
fn corrected(ahead: f64, offset: f64, heading: f64, distance: f64) -> f64 {
    ahead - (offset.clamp(-OFFSET_MAX, OFFSET_MAX) / distance + 2.0 * wrap_angle(heading)) / distance
}

/// The tangent of the angle between the axis of the vehicle and the course of a guided point that corrects its offset [m]
/// over a distance [m] and else heads along the path [rad, relative to the axis].
fn guide(course: f64, offset: f64, distance: f64) -> f64 {
    (wrap_angle(course) - offset.clamp(-OFFSET_MAX, OFFSET_MAX) / distance).clamp(-COURSE_MAX, COURSE_MAX).tan()
}

#[cfg(test)]
mod tests {
    use super::guide;

    #[test]
    fn a_guided_point_heads_along_the_path_and_corrects_its_offset_over_a_distance() {
        for (course, offset, distance, angle) in [
            (0.3, 0.0, 2.5, 0.3),
            // 1 m to the left of the path, over 2.5 m
            (0.3, 1.0, 2.5, 0.3 - 0.4),
            // No harder than 1.5 m, and no further than 1.2 rad from the axis
            (0.0, 4.0, 2.5, -0.6),
            (2.0, 0.0, 2.5, 1.2),
        ] {
            assert!((guide(course, offset, distance) - f64::tan(angle)).abs() < 1e-12, "{course} rad, {offset} m");
        }
    }
}
