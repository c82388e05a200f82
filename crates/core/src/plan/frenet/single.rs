//! One sample whose end is given: where to be beside the path, how fast, and when. Learners choose these numbers; nothing
//! but the limits of the vehicle is checked.

use super::super::PlanRequest;
use super::super::emergency_braking::last_resort;
use super::super::frame::{FrenetPoint, Start, Waypoint};
use super::super::polynomial::Polynomial;
use super::feasibility::{Limits, Rejection};
use super::grid::{ARC_MIN, ROUNDING};
use super::knows_yaw_rate;
use super::profiles::ProfilePoint;
use crate::error::{Error, Result};
use crate::settings::{positive, settings};
use crate::trajectory::State;
use crate::vehicle::single_track::Moved;

settings! {
    /// End state of a sample in the Frenet frame, as three numbers from -1 to 1.
    ///
    /// The first is the lateral position, the second the change of the speed, the third the time in which both are
    /// reached. The vehicle drives the first time step of the sample; then the next action counts.
    pub struct FrenetTarget as FrenetTarget {
        /// Lateral position for a first number of 1, to the left of the path.
        d_max: f64 ["m"] = 3.0, positive(15.0);
        /// Change of the present speed for a second number of 1.
        velocity_step: f64 ["m/s"] = 5.0, positive(100.0);
        /// Time for a third number of -1; at most the horizon.
        t_min: f64 ["s"] = 1.1, positive(60.0);
        /// Time for a third number of 1; also how far ahead the vehicle's limits are checked.
        horizon: f64 ["s"] = 3.0, positive(60.0);
        /// Below this speed lateral motion is planned over arc length instead of time.
        low_velocity: f64 ["m/s"] = 2.0, positive(100.0);
    }, ends_within_horizon
}

fn ends_within_horizon(settings: &FrenetTarget) -> Result<()> {
    let FrenetTarget { t_min, horizon, .. } = *settings;
    if t_min <= horizon {
        return Ok(());
    }
    let message = format!("must be positive and at most {horizon}, not {t_min:?}");
    Err(Error::Setting { name: "t_min".into(), message })
}

/// Where a sample ends.
#[derive(Debug, Clone, Copy)]
struct End {
    offset: f64,
    velocity: f64,
    time: f64,
}

/// A motion along the path and one beside it.
struct Sample {
    end: End,
    s: Polynomial,
    d: Polynomial,
    is_over_arc: bool,
    /// Arc length over which the lateral motion extends [m].
    length: f64,
}

impl FrenetTarget {
    /// The next state, one time step on. A sample that the vehicle cannot drive takes the whole horizon instead; if it
    /// cannot drive that either, it brakes as the sampling planner does. Both count as limited. Numbers are clipped.
    pub(crate) fn drive(&self, request: &PlanRequest, numbers: [f64; 3]) -> Moved {
        let [offset, change, time] = numbers.map(|number| number.clamp(-1.0, 1.0));
        let (dt, vehicle) = (request.dt, request.vehicle);
        let n_points = (self.horizon / dt).round().max(1.0) as usize + 1;
        let horizon = (n_points - 1) as f64 * dt;
        if let Ok(start) = Start::new(request, knows_yaw_rate(request, self.low_velocity)) {
            let limits = Limits::new(request, n_points, start.curvature);
            let wanted = self.t_min + 0.5 * (time + 1.0) * (self.horizon - self.t_min);
            let end = End {
                offset: offset * self.d_max,
                velocity: (start.velocity + change * self.velocity_step).clamp(0.0, vehicle.velocity_max),
                time: ((wanted / dt).round().max(1.0) * dt).min(horizon),
            };
            for (attempt, end) in [end, End { time: horizon, ..end }].into_iter().enumerate() {
                if let Some(state) = self.first_state(request, &start, &limits, end) {
                    return Moved { state, limited: attempt > 0 };
                }
            }
        }
        let plan = last_resort(request, n_points, "the sample cannot be driven");
        Moved { state: plan.trajectory.points[1], limited: true }
    }

    /// The first state of a sample, if the vehicle can drive all of it.
    fn first_state(&self, request: &PlanRequest, start: &Start, limits: &Limits, end: End) -> Option<State> {
        let sample = self.sample(start, limits, end);
        let path = &request.route.path;
        let (mut first, mut before) = (None, None);
        for i in 0..limits.n_points {
            let (s, frenet) = sample.at(start, i as f64 * limits.dt)?;
            if !(0.0..=path.length()).contains(&s) {
                return None;
            }
            let point = Waypoint::new(&path.at(s), &frenet, request.vehicle.rear_axle_to_center)?;
            if let Some(before) = before.replace(point)
                && limits.check(&before, &point, i) != Rejection::Admissible
            {
                return None;
            }
            if i == 1 {
                first = Some(point);
            }
        }
        first.map(|point| super::state(&point, start))
    }

    fn sample(&self, start: &Start, limits: &Limits, end: End) -> Sample {
        let s = Polynomial::to_slope([start.s, start.s_dot, start.s_ddot], end.velocity, end.time);
        let slowest = (0..limits.n_points).map(|i| i as f64 * limits.dt).filter(|time| *time <= end.time);
        let slowest = slowest.map(|time| s.at(time)[1]).fold(start.velocity.min(end.velocity), f64::min);
        let is_over_arc = slowest < self.low_velocity;
        let length = (s.at(end.time)[0] - start.s).max(ARC_MIN);
        let d = if !is_over_arc {
            let (rate, curve) = (start.d_prime * start.s_dot, start.s_dot * start.s_dot * start.d_prime2);
            Polynomial::to_rest([start.d, rate, start.s_ddot * start.d_prime + curve], end.offset, end.time)
        } else if start.steers_freely() {
            Polynomial::to_rest_from_free([start.d, start.d_prime], end.offset, length)
        } else {
            Polynomial::to_rest([start.d, start.d_prime, start.d_prime2], end.offset, length)
        };
        Sample { end, s, d, is_over_arc, length }
    }
}

impl Sample {
    /// Arc length and place beside the path at a time; `None` if it goes backwards.
    fn at(&self, start: &Start, time: f64) -> Option<(f64, FrenetPoint)> {
        let is_moving = time < self.end.time + 1e-9;
        let ends = (self.end.time, self.end.velocity);
        let ProfilePoint { s, s_dot, s_ddot, .. } = ProfilePoint::keeping_velocity(&self.s, ends, time);
        if s_dot < -ROUNDING {
            return None;
        }
        let s_dot = s_dot.max(0.0);
        let (at, has_arrived) =
            if self.is_over_arc { (s - start.s, s - start.s >= self.length) } else { (time, !is_moving) };
        let [d, mut d_prime, mut d_prime2, _] =
            if has_arrived { [self.end.offset, 0.0, 0.0, 0.0] } else { self.d.at(at) };
        if !self.is_over_arc {
            d_prime /= s_dot;
            d_prime2 = (d_prime2 - d_prime * s_ddot) / (s_dot * s_dot);
        }
        Some((s, FrenetPoint { s_dot, s_ddot, d, d_prime, d_prime2 }))
    }
}
