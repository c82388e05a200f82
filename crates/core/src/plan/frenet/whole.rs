//! Trajectories that are samples as a whole, beside the grid, and are tested like all others. One is the plan of before:
//! what was found good a moment ago should not be lost because the grid has moved on. Others are steered (`steered`).

use super::super::PlanRequest;
use super::super::frame::{STRETCH_MIN, Start, Waypoint};
use super::feasibility::Limits;
use super::settings::{CostWeights, N_TABLE_TERMS};
use super::targets::Targets;
use super::terms::{FrenetMotion, from_tables};
use crate::geometry::{Point, wrap_angle};
use crate::trajectory::State;

/// The old plan must pass the present state this closely: position [m], heading [rad], speed [m/s].
const POSITION_TOLERANCE: f64 = 0.05;
const HEADING_TOLERANCE: f64 = 0.01;
const VELOCITY_TOLERANCE: f64 = 0.1;
/// The foot of a point is searched this far around the expected place [m].
const SEARCH_WINDOW: f64 = 3.0;

/// A trajectory that is a sample of its own; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Whole {
    pub(super) points: Vec<Waypoint>,
    pub(super) motions: Vec<FrenetMotion>,
    /// Terms of the cost: velocity offset, lateral offset, lateral and longitudinal jerk.
    pub(super) terms: [f64; N_TABLE_TERMS],
    /// Weighted sum of the terms.
    pub(super) total: f64,
}

/// All of them; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Wholes {
    wholes: Vec<Whole>,
    len: usize,
}

impl std::ops::Deref for Wholes {
    type Target = [Whole];

    fn deref(&self) -> &[Whole] {
        &self.wholes[..self.len]
    }
}

impl Wholes {
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// One more, which holds what was there before.
    pub(super) fn push(&mut self) -> &mut Whole {
        if self.len == self.wholes.len() {
            self.wholes.push(Whole::default());
        }
        self.len += 1;
        &mut self.wholes[self.len - 1]
    }

    pub(super) fn pop(&mut self) {
        self.len -= 1;
    }

    /// Begins anew with the request's previous plan, shifted to now, unless it passes a stop line or cannot be driven on
    /// from here. Beyond its end it goes on with its last speed and curvature.
    pub(super) fn shift(
        &mut self,
        request: &PlanRequest,
        start: &Start,
        limits: &Limits,
        targets: &Targets,
        weights: &CostWeights,
    ) {
        self.clear();
        let whole = self.push();
        if whole.convert(request, start, limits).is_some_and(|s| s <= targets.barriers.nearest()) {
            whole.sum_up(limits, targets, weights);
        } else {
            self.pop();
        }
    }
}

impl Whole {
    fn convert(&mut self, request: &PlanRequest, start: &Start, limits: &Limits) -> Option<f64> {
        self.points.clear();
        self.motions.clear();
        let old = &request.previous?.points;
        let now = old.get(request.previous_age)?;
        let same_place = now.pose().position.distance(request.state.pose().position) < POSITION_TOLERANCE
            && wrap_angle(now.orientation - request.state.orientation).abs() < HEADING_TOLERANCE
            && (now.velocity - request.state.velocity).abs() < VELOCITY_TOLERANCE;
        if !same_place {
            return None;
        }
        let vehicle = request.vehicle;
        let mut s = start.s;
        let mut last = request.state;
        for i in 0..limits.n_points {
            let state = match old.get(request.previous_age + i) {
                _ if i == 0 => request.state,
                Some(state) => *state,
                None => onwards(&last, vehicle.rear_axle_to_center, limits.dt),
            };
            if !state.is_finite() || state.velocity < 0.0 {
                return None;
            }
            let rear_axle = vehicle.rear_axle_from_center(state.pose());
            let expected = s + state.velocity * limits.dt;
            let (foot, d, at) = request.route.path.project_from(rear_axle, expected, SEARCH_WINDOW)?;
            s = foot;
            let offset = wrap_angle(state.orientation - at.theta);
            let stretch = 1.0 - at.curvature * d;
            let (sin, cos) = offset.sin_cos();
            if cos < 0.1 || stretch < STRETCH_MIN {
                return None;
            }
            let curvature = if state.velocity > 1e-3 {
                state.yaw_rate / state.velocity
            } else {
                self.points.last().map_or(start.curvature, |point| point.curvature)
            };
            self.points.push(Waypoint {
                center: state.pose().position,
                axis: Point::from_angle(state.orientation),
                path_theta: at.theta,
                tan_offset: sin / cos,
                curvature: if i == 0 { start.curvature } else { curvature },
                velocity: state.velocity,
                acceleration: state.acceleration,
                d,
            });
            let (s_dot, d_dot) = (state.velocity * cos / stretch, state.velocity * sin);
            self.motions.push(FrenetMotion { s_dot, d_dot, ..FrenetMotion::default() });
            last = state;
        }
        Some(s)
    }

    /// Accelerations and jerks are differences of the speeds.
    pub(super) fn sum_up(&mut self, limits: &Limits, targets: &Targets, weights: &CostWeights) {
        let n = self.points.len();
        for i in 0..n {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            let time = (b - a) as f64 * limits.dt;
            self.motions[i].s_ddot = (self.motions[b].s_dot - self.motions[a].s_dot) / time;
            self.motions[i].d_ddot = (self.motions[b].d_dot - self.motions[a].d_dot) / time;
        }
        let jerk = |speed: fn(&FrenetMotion) -> f64| {
            let second = |w: &[FrenetMotion]| speed(&w[2]) - 2.0 * speed(&w[1]) + speed(&w[0]);
            let squares: f64 = self.motions.windows(3).map(|w| (second(w) / limits.dt.powi(2)).powi(2)).sum();
            (squares * limits.dt).sqrt()
        };
        let velocity: f64 = self.points.iter().map(|p| (p.velocity - targets.velocity).powi(2)).sum();
        let offset: f64 = self.points[n - n / 2..].iter().map(|p| (p.d - targets.offset).powi(2)).sum();
        self.terms = [velocity.sqrt(), offset.sqrt(), jerk(|m| m.d_dot), jerk(|m| m.s_dot)];
        let [velocity, offset, lateral, longitudinal] = self.terms;
        self.total = from_tables(weights, velocity, offset, lateral, longitudinal);
    }
}

/// One time step further with the same speed and yaw rate.
fn onwards(state: &State, rear_axle_to_center: f64, dt: f64) -> State {
    let before = Point::from_angle(state.orientation);
    let orientation = state.orientation + state.yaw_rate * dt;
    let after = Point::from_angle(orientation);
    let chord = Point::from_angle(state.orientation + 0.5 * state.yaw_rate * dt) * (state.velocity * dt);
    let center = state.pose().position + chord + (after - before) * rear_axle_to_center;
    State { x: center.x, y: center.y, orientation, acceleration: 0.0, ..*state }
}
