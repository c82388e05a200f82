//! Sampling-based planning in the Frenet frame of the reference path.
//!
//! One plan: the present state is expressed in the frame of the path; samples join it to a grid of end conditions;
//! the cheapest sample wins that is feasible, free of collisions, and on the road. Only as much is evaluated as the
//! choice needs (`search`). If there is none, see `emergency_braking`.
//!
//! Sources: Werling, Ziegler, Kammel, Thrun, ICRA 2010, doi 10.1109/ROBOT.2010.5509799 (samples); Trauth, Moller,
//! Wuersching, Betz, FRENETIX, IEEE Access 2024, doi 10.1109/ACCESS.2024.3436835 (grid, cost, selection). Unlike the
//! published planner, derivatives are complete, headings are continuous, end samples are not lost, jerk costs cover the
//! whole plan, the state is converted afresh at every plan, corners of predicted participants count equally, and limits
//! include steering rate and lateral acceleration.

// Each uses only those above it.
mod settings;
mod targets;
mod feasibility;
mod profiles;
mod lateral;
mod grid;
mod obstacles;
mod cost;
mod search;
mod candidates;
mod single;
#[cfg(test)]
mod tests;

pub use candidates::Candidates;
pub use feasibility::Rejection;
pub use settings::{CostWeights, FrenetSettings, N_TERMS};
pub use single::FrenetTarget;

use super::frame::{Start, Waypoint};
use super::{PlanRequest, PlanResult, emergency_braking};
use crate::trajectory::{State, Trajectory};
use feasibility::Limits;
use search::{Evaluation, EvaluationMemory};
use targets::Targets;

/// Memory that plans reuse. Holds no state: a plan does not depend on what was planned before with the same memory.
#[derive(Debug, Clone, Default)]
pub struct FrenetMemory {
    evaluation: EvaluationMemory,
    effort: usize,
    breakdown: CostBreakdown,
}

/// The cost terms of the chosen sample, recorded only on request.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CostBreakdown {
    /// Whether terms are recorded.
    pub(crate) enabled: bool,
    /// Without weights; `None` if no sample was chosen.
    pub(crate) terms: Option<[f64; N_TERMS]>,
}

impl FrenetMemory {
    /// The cost terms of the last plan, if `enabled`.
    pub(crate) fn breakdown(&mut self) -> &mut CostBreakdown {
        &mut self.breakdown
    }

    /// Trajectories that the last plan examined to the end.
    pub(crate) fn effort(&self) -> usize {
        self.effort
    }
}

/// What is to be planned.
struct Problem<'a> {
    request: &'a PlanRequest<'a>,
    settings: &'a FrenetSettings,
    start: Start,
    limits: Limits,
    targets: Targets,
}

impl<'a> Problem<'a> {
    /// `Err` says why the agent cannot be described in the frame of its path.
    fn new(request: &'a PlanRequest, settings: &'a FrenetSettings) -> Result<Self, String> {
        let start = Start::new(request, knows_yaw_rate(request, settings.low_velocity))?;
        let limits = Limits::new(request, n_points(request, settings), start.curvature);
        let targets = Targets::new(request, &start, settings);
        Ok(Self { request, settings, start, limits, targets })
    }
}

/// The plan for a request: always a trajectory with a point every dt over the horizon, point 0 the present state. If no
/// sample is admissible, the agent brakes (`emergency_braking`).
pub fn plan(request: &PlanRequest, settings: &FrenetSettings, memory: &mut FrenetMemory) -> PlanResult {
    memory.effort = 0;
    memory.breakdown.terms = None;
    let n_points = n_points(request, settings);
    if !request.state.is_finite() {
        return emergency_braking::refuse(request, n_points, "the present state is not a number".into());
    }
    let problem = match Problem::new(request, settings) {
        Ok(problem) => problem,
        Err(reason) => {
            let reason = format!("the agent {reason}");
            return emergency_braking::without_plan(request, n_points, &reason);
        }
    };
    let mut evaluation = Evaluation::new(&problem, &mut memory.evaluation);
    let choice = if settings.lazy { evaluation.best_first() } else { evaluation.exhaustive() };
    memory.effort = evaluation.n_trajectories();
    let Some((sample, cost)) = choice else {
        let obstruction = Some(evaluation.obstruction());
        let braking = emergency_braking::last_resort(request, n_points, "no sample can be driven");
        return PlanResult { obstruction, ..braking };
    };
    evaluation.write(sample);
    memory.breakdown.terms = memory.breakdown.enabled.then(|| evaluation.terms(sample));
    PlanResult::planned(trajectory(request, &problem.start, evaluation.points()), cost)
}

/// The yaw rate of the present state is that of the vehicle. Recorded yaw rates of slow vehicles are mostly noise; the
/// speed divides them by little.
fn knows_yaw_rate(request: &PlanRequest, low_velocity: f64) -> bool {
    request.previous.is_some() || request.state.velocity >= low_velocity
}

/// Points of a plan.
fn n_points(request: &PlanRequest, settings: &FrenetSettings) -> usize {
    (settings.horizon / request.dt).round().max(1.0) as usize + 1
}

/// All samples for a request with their costs and the reasons of rejection. The choice is that of `plan`.
pub fn candidates(request: &PlanRequest, settings: &FrenetSettings) -> Candidates {
    let problem = request.state.is_finite().then(|| Problem::new(request, settings).ok()).flatten();
    let Some(problem) = problem else {
        let n_points = n_points(request, settings);
        return Candidates { n_points, desired_velocity: f64::NAN, ..Candidates::default() };
    };
    Candidates::of(&mut Evaluation::new(&problem, &mut EvaluationMemory::default()))
}

/// States of the footprint centre; headings continue that of the present state without jumps.
fn trajectory(request: &PlanRequest, start: &Start, points: &[Waypoint]) -> Trajectory {
    let mut points: Vec<State> = points.iter().map(|point| state(point, start)).collect();
    points[0] = request.state;
    Trajectory { points }
}

/// State of the footprint centre.
fn state(point: &Waypoint, start: &Start) -> State {
    State {
        x: point.center.x,
        y: point.center.y,
        orientation: point.theta() + start.heading_shift,
        velocity: point.velocity,
        acceleration: point.acceleration,
        yaw_rate: point.curvature * point.velocity,
    }
}
