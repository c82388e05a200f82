//! Between the world and the Frenet frame of the reference path: s along the path, d to the left of it, both of the
//! rear axle. Notation: K = 1 - curvature d, D = heading minus that of the path, a prime is a derivative by s, a dot
//! one by time. Formulas: Werling et al., ICRA 2010, and Werling's thesis, appendix A; tan D = d'/K exactly.

use super::PlanRequest;
use crate::geometry::polyline::{PathPoint, ReferencePath};
use crate::geometry::{Point, Pose, wrap_angle};
use crate::trajectory::State;
use crate::vehicle::Vehicle;
use crate::vehicle::single_track::CREEPING_SPEED;

/// The agent moves along the path only if it heads within about 84 degrees of it (cos D) ...
const COSINE_MIN: f64 = 0.1;
/// ... and is not near the centre of the path's curvature (K).
pub(super) const STRETCH_MIN: f64 = 0.05;
/// The foot is searched within this distance of the last one [m].
const SEARCH_WINDOW: f64 = 15.0;

/// Where the agent starts, in the world and in the Frenet frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Start {
    /// Speed [m/s]; a slightly negative one counts as 0.
    pub(super) velocity: f64,
    /// Acceleration [m/s²].
    pub(super) acceleration: f64,
    /// Curvature of the rear axle's path [1/m].
    pub(super) curvature: f64,
    /// Multiple of 2 pi by which the headings of the path must be raised to continue the agent's.
    pub(super) heading_shift: f64,
    /// Arc length and its derivatives by time.
    pub(super) s: f64,
    pub(super) s_dot: f64,
    pub(super) s_ddot: f64,
    /// Lateral offset and its derivatives by s.
    pub(super) d: f64,
    pub(super) d_prime: f64,
    pub(super) d_prime2: f64,
}

/// Curvature at the rear axle: yaw rate over speed within the limits; `None` when creeping.
pub(super) fn start_curvature(state: &State, vehicle: &Vehicle) -> Option<f64> {
    let limit = vehicle.curvature_max();
    let (velocity, yaw_rate) = (state.velocity, state.yaw_rate);
    (velocity.abs() > CREEPING_SPEED).then(|| (yaw_rate / velocity).clamp(-limit, limit))
}

impl Start {
    /// From the world state alone, so nothing can go stale between plans. `Err` says why the agent cannot be
    /// described in the frame of its path.
    ///
    /// Steering of a creeping or standing agent cannot be observed: it is taken to keep the present direction
    /// relative to the path (d'' = 0), within the limits, where samples do not choose it themselves. The same if the
    /// yaw rate is not to be trusted.
    pub(super) fn new(request: &PlanRequest, yaw_rate_counts: bool) -> Result<Self, String> {
        Self::on(&request.route.path, request.s_hint, &request.state, request.vehicle, yaw_rate_counts)
    }

    /// The same on any path, with an arc length near which the agent is, if one is known (else NaN).
    pub(super) fn on(
        path: &ReferencePath,
        s_hint: f64,
        state: &State,
        vehicle: &Vehicle,
        yaw_rate_counts: bool,
    ) -> Result<Self, String> {
        let velocity = if (-CREEPING_SPEED..0.0).contains(&state.velocity) { 0.0 } else { state.velocity };
        if velocity < 0.0 {
            return Err(format!("drives backwards at {velocity} m/s"));
        }
        let rear_axle = vehicle.rear_axle_from_center(state.pose());
        let (s, d) = project(path, rear_axle, s_hint).ok_or("is not beside its reference path")?;
        let at = path.at(s);
        let offset = wrap_angle(state.orientation - at.theta);
        let (sin, cos) = offset.sin_cos();
        let stretch = 1.0 - at.curvature * d;
        if cos < COSINE_MIN || stretch < STRETCH_MIN {
            return Err("heads away from its reference path".into());
        }
        let tan = sin / cos;
        let d_prime = stretch * tan;
        let turn = at.curvature_rate * d + at.curvature * d_prime;
        let limit = vehicle.curvature_max();
        let parallel = ((at.curvature + turn * tan * cos * cos / stretch) * cos / stretch).clamp(-limit, limit);
        let curvature = start_curvature(state, vehicle).filter(|_| yaw_rate_counts).unwrap_or(parallel);
        let swing = curvature * stretch / cos - at.curvature;
        let s_dot = velocity * cos / stretch;
        let inertia = s_dot * s_dot / cos * (stretch * tan * swing - turn);
        Ok(Self {
            velocity,
            acceleration: state.acceleration,
            curvature,
            heading_shift: state.orientation - (at.theta + offset),
            s,
            s_dot,
            s_ddot: (state.acceleration - inertia) * cos / stretch,
            d,
            d_prime,
            d_prime2: -turn * tan + stretch / (cos * cos) * swing,
        })
    }
}

impl Start {
    /// The agent (almost) stands, so it may choose its steering.
    pub(super) fn steers_freely(&self) -> bool {
        self.velocity <= CREEPING_SPEED
    }
}

/// Foot of a point near the hint, or anywhere.
pub(super) fn project(path: &ReferencePath, point: Point, s_hint: f64) -> Option<(f64, f64)> {
    let near = if s_hint.is_finite() { path.project_near(point, s_hint, SEARCH_WINDOW) } else { None };
    near.or_else(|| path.project(point))
}

/// Where the rear axle is in the Frenet frame at one time, lateral derivatives by s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrenetPoint {
    pub(super) s_dot: f64,
    pub(super) s_ddot: f64,
    pub(super) d: f64,
    pub(super) d_prime: f64,
    pub(super) d_prime2: f64,
}

/// One point of a trajectory in the world.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Waypoint {
    /// Centre of the footprint [m].
    pub(super) center: Point,
    /// Unit vector along the heading.
    pub(super) axis: Point,
    /// Heading of the path [rad].
    pub(super) path_theta: f64,
    /// Tangent of the heading relative to the path.
    pub(super) tan_offset: f64,
    /// Curvature of the rear axle's path [1/m].
    pub(super) curvature: f64,
    /// Speed [m/s].
    pub(super) velocity: f64,
    /// Acceleration along the heading [m/s²].
    pub(super) acceleration: f64,
    /// Lateral offset of the rear axle [m].
    pub(super) d: f64,
}

impl Waypoint {
    /// World point of a Frenet point, with exact derivatives; `None` near the centre of the path's curvature.
    #[inline]
    pub(super) fn new(at: &PathPoint, frenet: &FrenetPoint, rear_axle_to_center: f64) -> Option<Self> {
        (at.stretch(frenet.d) >= STRETCH_MIN).then(|| Self::beside(at, frenet, rear_axle_to_center))
    }

    /// The same where it is known not to be near the centre of the path's curvature.
    #[inline(always)]
    pub(super) fn beside(at: &PathPoint, frenet: &FrenetPoint, rear_axle_to_center: f64) -> Self {
        let FrenetPoint { s_dot, s_ddot, d, d_prime, d_prime2 } = *frenet;
        let stretch = at.stretch(d);
        let hypotenuse = (stretch * stretch + d_prime * d_prime).sqrt();
        // Divisions take long.
        let (inverse, per_stretch) = (1.0 / hypotenuse, 1.0 / stretch);
        let cos = stretch * inverse;
        let sin = d_prime * inverse;
        let tan = d_prime * per_stretch;
        let turn = at.curvature_rate * d + at.curvature * d_prime;
        let curvature = ((d_prime2 + turn * tan) * cos * inverse + at.curvature) * inverse;
        let swing = curvature * hypotenuse - at.curvature;
        let axis = Point::new(at.cos * cos - at.sin * sin, at.sin * cos + at.cos * sin);
        Self {
            center: at.offset(d) + axis * rear_axle_to_center,
            axis,
            path_theta: at.theta,
            tan_offset: tan,
            curvature,
            velocity: s_dot * hypotenuse,
            acceleration: s_ddot * hypotenuse + s_dot * s_dot * (hypotenuse * per_stretch) * (d_prime * swing - turn),
            d,
        }
    }

    /// Heading [rad], continuous along a trajectory.
    #[inline]
    pub(super) fn theta(&self) -> f64 {
        self.path_theta + self.tan_offset.atan()
    }

    /// Pose of the footprint centre.
    pub(super) fn pose(&self) -> Pose {
        Pose { position: self.center, orientation: self.theta() }
    }
}
