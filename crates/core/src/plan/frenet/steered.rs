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
use super::{Incumbent, length};
use crate::geometry::{Point, wrap_angle};

/// How the drivers differ.
struct Driver {
    /// How far ahead it looks at the path [s].
    preview: f64,
    /// How far inside bends it aims [m], in full from `BEND` [1/m] on: a vehicle that keeps its rear axle on the path until
    /// the bend cannot turn its wheels fast enough, and ends outside.
    inside: f64,
}

const DRIVERS: [Driver; 2] = [Driver { preview: 0.6, inside: 0.0 }, Driver { preview: 0.3, inside: 0.5 }];
const BEND: f64 = 0.1;
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
    incumbent: Incumbent,
) {
    wholes.clear();
    for profile in 0..samples.profiles.len() {
        if !samples.is_steered(profile) {
            continue;
        }
        samples.load_motion(profile);
        let speeds = samples.motions(profile).s_dot;
        if speeds[limits.n_points - 1] <= incumbent.velocity {
            continue;
        }
        // As if the vehicle drove on the path: no bound of the cost, but those far off are spared.
        let missed = speeds[..limits.n_points].iter().map(|speed| (speed - targets.velocity).powi(2)).sum::<f64>();
        if from_tables(weights, missed.sqrt(), 0.0, 0.0, samples.profiles[profile].jerk) >= incumbent.cost {
            continue;
        }
        for driver in &DRIVERS {
            let whole = wholes.push();
            let last = steer(whole, request, (start, targets, limits), samples, profile, driver);
            let is_before_stop = last.is_some_and(|last| last <= targets.barriers.nearest());
            let comes_further = length(whole.points.iter().map(|point| point.center)) > incumbent.distance;
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
    driver: &Driver,
) -> Option<f64> {
    whole.points.clear();
    whole.motions.clear();
    let (vehicle, path) = (request.vehicle, &request.route.path);
    let motion = samples.motions(profile);
    let mut place = vehicle.rear_axle_from_center(request.state.pose());
    let mut heading = request.state.orientation;
    let (mut s, mut d, mut at) = path.project_from(place, start.s, SEARCH_WINDOW)?;
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
            let ahead = path.curvature_at(s + before * driver.preview);
            let offset = targets.offset + driver.inside * (ahead / BEND).clamp(-1.0, 1.0);
            let distance = CORRECTION_LENGTH.max(CORRECTION_TIME * before);
            let wanted = corrected(ahead, d - offset, heading - at.theta, distance);
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
