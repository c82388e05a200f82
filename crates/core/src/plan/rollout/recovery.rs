//! Recovery: a vehicle that stands wedged drives back a little with its wheels turned, and on from there.

use super::super::Other;
use super::super::driven_point::DrivenPoint;
use super::super::frame::project;
use super::search::Search;
use super::speeds::{Pace, Speeds};
use super::start::Start;
use super::steering::{Along, Rollout, Steering};
use crate::conduct::{STANDSTILL_SPEED, STATIONARY_SPEED};
use crate::geometry::Point;
use crate::trajectory::State;

/// A plan that comes less far than this is stuck [m], once the agent has stood for so long [s]: whoever stands ahead may be
/// about to drive on.
const STUCK_WAY: f64 = 1.0;
const PATIENCE: f64 = 5.0;
/// With a way back the agent must come further by this than without [m].
const GAIN: f64 = 2.0;
/// No other vehicle moves within this distance [m].
const CLEAR: f64 = 12.0;
/// Ways back [m]; within 3 s, so that a plan shows all of it.
const WAYS: [f64; 3] = [1.0, 2.0, 3.0];
/// Shares of the tightest curvature that are held on the way back. Of ways back that help, the straightest counts, then the
/// shortest.
const SHARES: [f64; 7] = [0.0, -0.2, 0.2, -0.5, 0.5, -1.0, 1.0];
/// Largest speed backwards [m/s], and how it is reached and left [m/s²].
const VELOCITY: f64 = 1.5;
const ACCELERATION: f64 = 1.5;
/// The way on begins so [m/s²] and becomes no faster than this [m/s].
const ONWARDS: (f64, f64) = (1.5, 2.5);
/// A plan of before counts where it passes the present place this closely [m].
const TOLERANCE: f64 = 0.05;

impl Search<'_> {
    /// What a reversal that has begun goes on with, unless something is in its way by now.
    pub(super) fn reverse_on(&mut self) -> Option<Rollout> {
        let request = self.task.request;
        let points = request.previous?.points.get(request.previous_age..)?;
        let is_here = points[0].pose().position.distance(request.state.pose().position) < TOLERANCE;
        if self.task.start.rolling > -STANDSTILL_SPEED || !is_here || points[0].velocity > -STANDSTILL_SPEED {
            return None;
        }
        let rollout = self.shifted(points);
        self.is_free(&rollout).then_some(rollout)
    }

    /// A way back from which the agent comes clearly further than with the best plan, if it has stood for long and waits
    /// neither for another participant nor at a line.
    pub(super) fn reverse(&mut self, best_way: f64) -> Option<Rollout> {
        let request = self.task.request;
        let start = self.task.start;
        if !start.stands || best_way >= STUCK_WAY || request.standing < PATIENCE {
            return None;
        }
        let here = request.state.pose().position;
        let moves =
            |other: &Other| other.velocity.abs() > STATIONARY_SPEED && other.pose.position.distance(here) < CLEAR;
        let front = start.s + request.vehicle.rear_axle_to_center + 0.5 * request.vehicle.length;
        let barriers = request.rules.barriers(request.rules.way, front, 0.0);
        let waits = self.obstructions.wait.is_some() || barriers.iter().any(|barrier| barrier.s < front + GAIN);
        if waits || request.others.iter().any(moves) {
            return None;
        }
        let ego = self.look(0.0);
        let allowed = self.speeds(Pace::Social, &ego)?.s - start.s;
        if allowed < GAIN && self.obstructions.beside.is_empty() {
            return None;
        }
        let mut back = Rollout::default();
        for share in SHARES {
            for length in WAYS {
                let speeds = Speeds::back(length, self.task.n_points, request.dt);
                back.drive(request, &start, (0.0, Along::Path), &speeds, Steering::swinging(share, f64::INFINITY));
                self.memory.effort += 1;
                if !self.is_free(&back) {
                    continue;
                }
                let Some(found) = self.onwards(&back.points[back.points.len() - 1], start.s - length) else { continue };
                if found - start.s > best_way + GAIN {
                    return Some(back);
                }
            }
        }
        None
    }

    /// How far the agent comes from the end of a way back [m, arc length]; `None` if that is not beside its path.
    fn onwards(&mut self, from: &DrivenPoint, near: f64) -> Option<f64> {
        let request = self.task.request;
        let axle = from.center - from.axis * request.vehicle.rear_axle_to_center;
        let (s, d) = project(&request.route.path, axle, near)?;
        let start = Start {
            s,
            d,
            axle,
            theta: from.theta,
            velocity: 0.0,
            rolling: 0.0,
            curvature: from.curvature,
            stands: true,
        };
        let speeds = Speeds::from_rest(ONWARDS, self.task.n_points, request.dt);
        let targets: Vec<f64> = std::iter::once(0.0).chain(self.obstructions.beside.iter().copied()).collect();
        let mut furthest = s;
        let mut rollout = Rollout::default();
        for target in targets {
            for steering in std::iter::once(Steering::FIRM).chain(Steering::CORNERING) {
                rollout.drive(request, &start, (target, Along::Path), &speeds, steering);
                self.memory.effort += 1;
                let end = self.first_fault(&rollout).unwrap_or(rollout.points.len());
                let way: f64 = speeds.velocity[..end].iter().map(|velocity| velocity * request.dt).sum();
                furthest = furthest.max(s + way);
                if end == rollout.points.len() {
                    return Some(furthest);
                }
            }
        }
        Some(furthest)
    }

    /// The rest of a plan; at its end the vehicle stands.
    fn shifted(&self, states: &[State]) -> Rollout {
        let request = self.task.request;
        let mut points: Vec<DrivenPoint> = Vec::with_capacity(self.task.n_points);
        for i in 0..self.task.n_points {
            let state = states[i.min(states.len() - 1)];
            let is_beyond = i >= states.len();
            let velocity = if is_beyond { 0.0 } else { state.velocity };
            let held = points.last().map_or(self.task.start.curvature, |before| before.curvature);
            let is_moving = velocity.abs() > STANDSTILL_SPEED;
            points.push(DrivenPoint {
                center: state.pose().position,
                axis: Point::from_angle(state.orientation),
                theta: state.orientation,
                curvature: if is_moving { state.yaw_rate / velocity } else { held },
                velocity,
                acceleration: states.get(i + 1).map_or(0.0, |next| (next.velocity - velocity) / request.dt),
                // Nothing looks at the place along the path of a way back.
                s: self.task.start.s,
                d: self.task.start.d,
            });
        }
        Rollout { points, ..Rollout::default() }
    }
}

impl Speeds {
    /// Backwards over a way [m], from rest to rest.
    fn back(way: f64, n_points: usize, dt: f64) -> Self {
        let fastest = VELOCITY.min((ACCELERATION * way).sqrt());
        let ramp = fastest / ACCELERATION;
        let end = way / fastest + ramp;
        let at = |time: f64| -(ACCELERATION * time).min(ACCELERATION * (end - time)).clamp(0.0, fastest);
        Self::sampled(at, n_points, dt)
    }

    /// From rest with an acceleration [m/s²] up to a speed [m/s].
    fn from_rest((acceleration, fastest): (f64, f64), n_points: usize, dt: f64) -> Self {
        Self::sampled(|time| (acceleration * time).min(fastest), n_points, dt)
    }

    fn sampled(at: impl Fn(f64) -> f64, n_points: usize, dt: f64) -> Self {
        let velocity: Vec<f64> = (0..n_points).map(|i| at(i as f64 * dt)).collect();
        let next = |i: usize| if i + 1 < n_points { velocity[i + 1] } else { velocity[i] };
        let acceleration = (0..n_points).map(|i| (next(i) - velocity[i]) / dt).collect();
        Self { velocity, acceleration, s: f64::NAN }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_back_is_driven_from_rest_to_rest_within_its_speed() {
        for way in WAYS {
            let speeds = Speeds::back(way, 31, 0.1);
            let driven: f64 = speeds.velocity.windows(2).map(|pair| -0.05 * (pair[0] + pair[1])).sum();
            assert!((driven - way).abs() < 0.02, "{driven} m");
            assert!(speeds.velocity.iter().all(|v| (-VELOCITY..=0.0).contains(v)));
            assert_eq!((speeds.velocity[0], speeds.velocity[30]), (0.0, 0.0));
        }
    }
}
