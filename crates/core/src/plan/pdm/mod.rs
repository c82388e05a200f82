//! After PDM-Closed: proposals by car following on three paths, each tracked by a model of the vehicle and scored as drives
//! are in the closed-loop benchmark of nuPlan; the best is driven.
//!
//! Dauner, Hallgarten, Geiger, Chitta, "Parting with Misconceptions about Learning-based Vehicle Motion Planning", CoRL 2023,
//! arXiv 2306.07962. Written from the paper and the numbers of its configuration; docs/reference/planner_pdm.md says what
//! differs.

mod settings;
mod forecast;
mod proposals;
mod tracking;
mod comfort;
mod scoring;
mod candidates;

pub(super) use candidates::candidates;
pub use candidates::{PDM_TERMS, PdmCandidates};
pub use settings::{PdmSettings, PdmWeights};

use super::driven_point::DrivenPoint;
use super::frame::Start;
use super::{PlanRequest, PlanResult};
use crate::trajectory::{Obstruction, PlanStatus, Trajectory};
use proposals::Premises;
use scoring::{Judge, Judgement};
use tracking::{Origin, Pace};

/// Memory that plans reuse. Holds no state: a plan does not depend on what was planned before with the same memory.
#[derive(Debug, Clone, Default)]
pub(super) struct PdmMemory {
    premises: Premises,
    judge: Judge,
    speeds: Vec<f64>,
    /// The points of all proposals, one after the other.
    points: Vec<DrivenPoint>,
    one: Vec<DrivenPoint>,
    judged: Vec<Judgement>,
}

impl PdmMemory {
    /// Proposals of the last plan.
    pub(super) fn effort(&self) -> usize {
        self.judged.len()
    }
}

/// How finely proposals are driven.
#[derive(Debug, Clone, Copy)]
struct Grid {
    n_points: usize,
    /// Between two points [s].
    step: f64,
    /// Points per step of the run.
    every: usize,
}

impl Grid {
    fn new(request: &PlanRequest, settings: &PdmSettings) -> Self {
        let every = (request.dt / settings.step - 1e-9).ceil().max(1.0) as usize;
        let steps = (settings.horizon / request.dt).round().max(1.0) as usize;
        Self { n_points: steps * every + 1, step: request.dt / every as f64, every }
    }
}

/// The proposals of a plan: offset of the path [m], and share of the speed limit. The middle of the lane comes first: of
/// equals the first is driven.
fn variants(settings: &PdmSettings) -> impl Iterator<Item = (f64, f64)> {
    let sides: &[f64] = if settings.offset > 0.0 { &[0.0, -1.0, 1.0] } else { &[0.0] };
    let (n, offset) = (settings.speeds, settings.offset);
    let shares = move |side: f64| (1..=n).map(move |i| (side * offset, i as f64 / n as f64));
    sides.iter().flat_map(move |side| shares(*side))
}

/// All proposals of a request are driven and judged; the best one, or why there is none.
fn best(
    request: &PlanRequest,
    settings: &PdmSettings,
    memory: &mut PdmMemory,
) -> Result<(Origin, usize), &'static str> {
    memory.points.clear();
    memory.judged.clear();
    let start = Start::new(request, request.previous.is_some()).map_err(|_| "the agent is not beside its path")?;
    let at = request.route.path.at(start.s);
    // A vehicle that stands turns its wheels like the path.
    let tightest = request.vehicle.curvature_max();
    let along = (at.curvature / at.stretch(start.d).max(0.2)).clamp(-tightest, tightest);
    let origin = Origin {
        s: start.s,
        d: start.d,
        velocity: start.velocity,
        acceleration: start.acceleration,
        curvature: if start.steers_freely() { along } else { start.curvature },
    };
    let grid = Grid::new(request, settings);
    let PdmMemory { premises, judge, speeds, points, one, judged } = memory;
    premises.fill(request, settings, (origin.s, origin.velocity));
    for (offset, share) in variants(settings) {
        let numbers = (grid.n_points, grid.step);
        premises.drive(request, settings, (origin.s, origin.velocity), (offset, share), numbers, speeds);
        tracking::track(request, &origin, (offset, Pace::Speeds(speeds)), numbers, one);
        judged.push(judge.judge(request, &premises.forecast, one, grid.step));
        points.append(one);
    }
    let longest = scoring::longest(judged);
    let scores = judged.iter().map(|one| one.score(&settings.weights, longest)).enumerate();
    let (best, _) = scores.fold((0, f64::NEG_INFINITY), |best, one| if one.1 > best.1 { one } else { best });
    Ok((origin, best))
}

/// The plan for a request; why there is none otherwise.
pub(super) fn plan(
    request: &PlanRequest,
    settings: &PdmSettings,
    memory: &mut PdmMemory,
) -> Result<PlanResult, &'static str> {
    let (origin, best) = best(request, settings, memory)?;
    let grid = Grid::new(request, settings);
    let judged = memory.judged[best];
    if let Some((time, other)) = judged.hit
        && time <= settings.braking_time
        && request.state.velocity <= settings.braking_velocity
    {
        let pace = Pace::Braking(settings.braking.min(request.vehicle.acceleration_max));
        tracking::track(request, &origin, (origin.d, pace), (grid.n_points, grid.step), &mut memory.one);
        let trajectory = Trajectory { points: tracking::states(request, &memory.one, grid.every) };
        let id = request.predictions.ids[request.others[other].row];
        let obstruction = Some(Obstruction::nowhere(&format!("collision with {id}")));
        let status = PlanStatus::EmergencyBraking;
        return Ok(PlanResult { status, obstruction, ..PlanResult::planned(trajectory, 1.0) });
    }
    let points = &memory.points[best * grid.n_points..][..grid.n_points];
    let cost = 1.0 - judged.score(&settings.weights, scoring::longest(&memory.judged));
    Ok(PlanResult::planned(Trajectory { points: tracking::states(request, points, grid.every) }, cost))
}
