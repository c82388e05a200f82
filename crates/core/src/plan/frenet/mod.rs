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
mod velocity_keeping_profiles;
mod lateral;
mod grid;
mod cartesian;
mod terms;
mod whole;
mod steered;
mod obstacles;
mod cost_bounds;
mod profile_speeds;
mod cost;
mod search;
mod evaluation;
mod obstruction;
mod candidates;
mod single;
#[cfg(test)]
pub(super) mod tests;

pub use candidates::Candidates;
pub use feasibility::Rejection;
pub(super) use obstacles::part_boxes;
pub use settings::{Comfort, CostWeights, FrenetSettings, N_TERMS};
pub use single::FrenetTarget;

use super::frame::{Start, Waypoint};
use super::{PlanRequest, PlanResult, emergency_braking};
use crate::conduct::STANDSTILL_SPEED;
use crate::geometry::Point;
use crate::trajectory::{PlanStatus, State, Trajectory};
use cost::TableCosts;
use evaluation::{Evaluation, EvaluationMemory, Problem, Tables};
use feasibility::Limits;
use grid::{ARC_MIN, Inputs, SampleGrid};
use obstacles::{Contact, Obstacles};
use targets::Targets;
use whole::Wholes;

/// Worth of one second before a contact [m/s²].
const WORTH_OF_TIME: f64 = 2.0;

/// Memory that plans reuse: after the first few plans nothing but the result is allocated. Holds no state: a plan does
/// not depend on what was planned before with the same memory.
#[derive(Debug, Clone, Default)]
pub struct FrenetMemory {
    samples: SampleGrid,
    costs: TableCosts,
    obstacles: Obstacles,
    wholes: Wholes,
    queue: search::Queue,
    evaluation: EvaluationMemory,
    road: Vec<u32>,
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

impl CostBreakdown {
    fn record(&mut self, evaluation: &Evaluation, sample: usize) {
        self.terms = self.enabled.then(|| evaluation.terms(sample));
    }
}

impl FrenetMemory {
    /// The cost terms of the last plan, if `enabled`.
    pub(crate) fn breakdown(&mut self) -> &mut CostBreakdown {
        &mut self.breakdown
    }

    /// Trajectories that the last plan examined as a whole, in all its attempts.
    pub(crate) fn effort(&self) -> usize {
        self.effort
    }
}

/// What an attempt to plan takes for granted.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Assumptions {
    /// The yaw rate of the present state is that of the vehicle; otherwise it drives parallel to its path.
    yaw_rate_counts: bool,
    /// Factor of the limits of steering rate and lateral acceleration.
    slack: f64,
    /// The agent keeps the margin of its settings from what the road admits.
    keeps_clear: bool,
}

/// Plans that end slower than this [m/s] crawl.
const SLOW_PLAN_SPEED: f64 = 2.0;
/// Samples that end faster by this [m/s] are clearly faster.
const FASTER_BY: f64 = 1.0;

impl Assumptions {
    const NOMINAL: Self = Self { yaw_rate_counts: true, slack: 1.0, keeps_clear: true };
    const NARROW: Self = Self { keeps_clear: false, ..Self::NOMINAL };
    /// For a start that cannot be continued as stated.
    const RELAXED: [Self; 3] = [
        Self { yaw_rate_counts: false, slack: 1.0, keeps_clear: false },
        Self { yaw_rate_counts: true, slack: 2.5, keeps_clear: false },
        Self { yaw_rate_counts: false, slack: 2.5, keeps_clear: false },
    ];

    /// Recorded yaw rates of slow vehicles are mostly noise; the speed divides them by little.
    fn knows_yaw_rate(&self, request: &PlanRequest, settings: &FrenetSettings) -> bool {
        self.yaw_rate_counts && (request.previous.is_some() || request.state.velocity >= settings.low_velocity)
    }
}

/// The plan for a request: always a trajectory with a point every dt over the horizon, point 0 the present state.
///
/// If nothing is admissible, or the plan crawls and the road alone forbids a sample that would be cheaper and faster,
/// the agent may come as close to the edge of the road as the judge allows, and looks at lateral positions near its
/// path only, which are closer to each other then. A crawling plan is only replaced by a faster and cheaper plan. If
/// the vehicle cannot drive samples that would be cheaper and faster, or any, samples are steered (`steered`); such a
/// plan must also come further. Recorded initial states are noisy, and some drivers steer faster than the vehicle's
/// parameters allow. If no sample of an agent's first grid is admissible, others count before steered ones: as if the
/// agent drove parallel to its path, then with higher limits of steering rate and lateral acceleration. (All later
/// states come from the planner itself.)
pub fn plan(request: &PlanRequest, settings: &FrenetSettings, memory: &mut FrenetMemory) -> PlanResult {
    memory.effort = 0;
    memory.breakdown.terms = None;
    let mut result = attempt(request, settings, memory, Assumptions::NOMINAL);
    let off_road_cost = memory.evaluation.off_road_cost;
    let undrivable = std::mem::take(&mut memory.evaluation.undrivable);
    if result.status != PlanStatus::Planned {
        if off_road_cost.is_finite() {
            result = attempt(request, settings, memory, Assumptions::NARROW);
        }
    } else if is_held_by_road(&result, memory) {
        result = faster(request, settings, memory, &result).unwrap_or(result);
    }
    let incumbent = Incumbent::of(&result);
    let better =
        if incumbent.is_held_by_limits(&undrivable) { steered(request, settings, memory, incumbent) } else { None };
    memory.evaluation.undrivable = undrivable;
    if result.status != PlanStatus::Planned && request.previous.is_none() && request.state.is_finite() {
        let mut again =
            Assumptions::RELAXED.into_iter().map(|assumptions| attempt(request, settings, memory, assumptions));
        if let Some(again) = again.find(|again| again.status == PlanStatus::Planned) {
            return again;
        }
    }
    better.unwrap_or(result)
}

/// What a better plan must beat.
#[derive(Debug, Clone, Copy)]
struct Incumbent {
    cost: f64,
    /// Speed at the end [m/s].
    velocity: f64,
    /// Length of its way [m].
    distance: f64,
}

impl Incumbent {
    /// Anything is better than no plan.
    const NONE: Self = Self { cost: f64::INFINITY, velocity: f64::NEG_INFINITY, distance: 0.0 };

    fn of(result: &PlanResult) -> Self {
        if result.status == PlanStatus::Planned {
            let centers = result.trajectory.points.iter().map(|point| point.pose().position);
            Self { cost: result.cost, velocity: end_velocity(result), distance: length(centers) }
        } else {
            Self::NONE
        }
    }

    /// One of the samples that the vehicle cannot drive (cost, speed at the end) would be cheaper and clearly faster.
    fn is_held_by_limits(&self, undrivable: &[(f64, f64)]) -> bool {
        undrivable.iter().any(|(cost, velocity)| *cost < self.cost && *velocity > self.velocity + FASTER_BY)
    }

    /// What steered samples take for granted.
    fn assumptions(&self) -> Assumptions {
        if self.velocity > SLOW_PLAN_SPEED { Assumptions::NOMINAL } else { Assumptions::NARROW }
    }
}

/// The plan crawls, and the road alone rejected a sample that would be cheaper and faster.
fn is_held_by_road(result: &PlanResult, memory: &FrenetMemory) -> bool {
    let slow = end_velocity(result);
    let better = |(cost, velocity): &(f64, f64)| *cost < result.cost && *velocity > slow;
    slow < SLOW_PLAN_SPEED && memory.evaluation.off_road.iter().any(better)
}

/// The cheapest plan where the road is narrow that ends faster than one of the same request and costs less. That
/// plan must be the last that was made with this memory: motions along the path and participants are taken from it.
fn faster(
    request: &PlanRequest,
    settings: &FrenetSettings,
    memory: &mut FrenetMemory,
    than: &PlanResult,
) -> Option<PlanResult> {
    let assumptions = Assumptions::NARROW;
    let n_points = n_points(request, settings);
    let start = Start::new(request, assumptions.knows_yaw_rate(request, settings)).ok()?;
    let limits = Limits::new(request, n_points, start.curvature, assumptions.slack);
    let targets = Targets::new(request, &start, settings);
    let FrenetMemory {
        samples, costs, obstacles, wholes, queue, evaluation: evaluation_memory, effort, breakdown, ..
    } = memory;
    let (start, limits, path, keeps_clear) = (&start, &limits, &request.route.path, assumptions.keeps_clear);
    samples.narrow(&Inputs { start, targets: &targets, limits, settings, path, is_narrow: true });
    costs.prepare(samples, targets.velocity, &settings.weights, path);
    let problem = Problem { request, settings, start, limits, keeps_clear };
    let mut evaluation =
        Evaluation::new(problem, Tables { samples, costs, obstacles, wholes, memory: evaluation_memory });
    search::start(queue, evaluation.entries(end_velocity(than)), than.cost);
    let choice = search(settings, queue, &mut evaluation);
    *effort += evaluation.tables.memory.n_trajectories();
    let (sample, cost) = choice?;
    evaluation.write_if_drivable(sample);
    breakdown.record(&evaluation, sample);
    Some(PlanResult::planned(trajectory(request, start, evaluation.points()), cost))
}

/// The cheapest steered plan that beats one of the same request, whose motions along the path are those in the memory.
fn steered(
    request: &PlanRequest,
    settings: &FrenetSettings,
    memory: &mut FrenetMemory,
    incumbent: Incumbent,
) -> Option<PlanResult> {
    let assumptions = incumbent.assumptions();
    let start = Start::new(request, assumptions.knows_yaw_rate(request, settings)).ok()?;
    let limits = Limits::new(request, n_points(request, settings), start.curvature, assumptions.slack);
    let targets = Targets::new(request, &start, settings);
    let FrenetMemory {
        samples, costs, obstacles, wholes, queue, evaluation: evaluation_memory, effort, breakdown, ..
    } = memory;
    let (start, limits, keeps_clear) = (&start, &limits, assumptions.keeps_clear);
    let state = (start, &targets, limits);
    steered::steer_all((wholes, obstacles), request, state, samples, &settings.weights, incumbent);
    let problem = Problem { request, settings, start, limits, keeps_clear };
    let mut evaluation =
        Evaluation::new(problem, Tables { samples, costs, obstacles, wholes, memory: evaluation_memory });
    search::start(queue, evaluation.whole_entries(incumbent.velocity), incumbent.cost);
    let choice = search(settings, queue, &mut evaluation);
    *effort += evaluation.tables.memory.n_trajectories();
    let (sample, cost) = choice?;
    evaluation.write_if_drivable(sample);
    breakdown.record(&evaluation, sample);
    Some(PlanResult::planned(trajectory(request, start, evaluation.points()), cost))
}

/// Length of a way [m] but for its first step, which leaves the state as it was handed over.
fn length(centers: impl Iterator<Item = Point>) -> f64 {
    let mut centers = centers.skip(1);
    let Some(mut last) = centers.next() else { return 0.0 };
    centers.map(|center| center.distance(std::mem::replace(&mut last, center))).sum()
}

fn search(settings: &FrenetSettings, queue: &mut search::Queue, evaluation: &mut Evaluation) -> Option<(usize, f64)> {
    if settings.lazy { search::best_first(queue, evaluation) } else { search::exhaustive(queue, evaluation) }
}

/// Speed at the end of a plan [m/s].
fn end_velocity(result: &PlanResult) -> f64 {
    result.trajectory.points.last().map_or(0.0, |point| point.velocity)
}

fn attempt(
    request: &PlanRequest,
    settings: &FrenetSettings,
    memory: &mut FrenetMemory,
    assumptions: Assumptions,
) -> PlanResult {
    let n_points = n_points(request, settings);
    memory.evaluation.off_road_cost = f64::INFINITY;
    if !request.state.is_finite() {
        return emergency_braking::refuse(request, n_points, "the present state is not a number".into());
    }
    let start = match Start::new(request, assumptions.knows_yaw_rate(request, settings)) {
        Ok(start) => start,
        Err(reason) => {
            return emergency_braking::without_plan(
                request,
                n_points,
                &mut memory.road,
                &format!("the agent {reason}"),
            );
        }
    };
    let limits = Limits::new(request, n_points, start.curvature, assumptions.slack);
    let targets = Targets::new(request, &start, settings);
    let FrenetMemory {
        samples,
        costs,
        obstacles,
        wholes,
        queue,
        evaluation: evaluation_memory,
        road,
        effort,
        breakdown,
    } = memory;
    prepare(
        request,
        settings,
        (&start, &targets, &limits, !assumptions.keeps_clear),
        (samples, costs, obstacles, wholes),
    );
    let (start, limits, keeps_clear) = (&start, &limits, assumptions.keeps_clear);
    let problem = Problem { request, settings, start, limits, keeps_clear };
    let mut evaluation =
        Evaluation::new(problem, Tables { samples, costs, obstacles, wholes, memory: evaluation_memory });
    search::start(queue, evaluation.entries(f64::NEG_INFINITY), f64::INFINITY);
    let choice = search(settings, queue, &mut evaluation);
    *effort += evaluation.tables.memory.n_trajectories();
    if let Some((sample, cost)) = choice {
        evaluation.write_if_drivable(sample);
        breakdown.record(&evaluation, sample);
        let trajectory = trajectory(request, start, evaluation.points());
        return PlanResult::planned(trajectory, cost);
    }
    let obstruction = Some(obstruction::find(&mut evaluation));
    let is_moving = start.velocity > STANDSTILL_SPEED;
    let result = match is_moving.then(|| least_bad(&mut evaluation)).flatten() {
        Some(trajectory) => PlanResult::braking(trajectory),
        None => emergency_braking::last_resort(request, n_points, road, "no sample can be driven"),
    };
    PlanResult { obstruction, ..result }
}

/// Points of a plan.
fn n_points(request: &PlanRequest, settings: &FrenetSettings) -> usize {
    (settings.horizon / request.dt).round().max(1.0) as usize + 1
}

/// All samples for a request with their costs and the reasons of rejection. The choice is that of `plan`.
pub fn candidates(request: &PlanRequest, settings: &FrenetSettings) -> Candidates {
    let all = sample_all(request, settings, Assumptions::NOMINAL, None);
    if !request.state.is_finite() {
        return all;
    }
    let undrivable = all.undrivable.clone();
    let mut found = match all.chosen {
        Some(chosen) if all.last_velocity[chosen] < SLOW_PLAN_SPEED && all.is_held_by_road(chosen) => {
            let mut narrow = sample_all(request, settings, Assumptions::NARROW, None);
            narrow.choose(all.last_velocity[chosen], all.cost[chosen]);
            if narrow.chosen.is_some() { narrow } else { all }
        }
        Some(_) => all,
        None => Some(sample_all(request, settings, Assumptions::NARROW, None))
            .filter(|it| it.chosen.is_some())
            .unwrap_or(all),
    };
    if found.chosen.is_none() && request.previous.is_none() {
        let mut again =
            Assumptions::RELAXED.iter().map(|assumptions| sample_all(request, settings, *assumptions, None));
        if let Some(again) = again.find(|again| again.chosen.is_some()) {
            return again;
        }
    }
    let incumbent = found.chosen.map_or(Incumbent::NONE, |i| found.incumbent(i));
    if incumbent.is_held_by_limits(&undrivable) {
        found.add_steered(sample_all(request, settings, incumbent.assumptions(), Some(incumbent)));
    }
    found
}

/// All samples of the grid with the previous plan, or the samples that are steered to beat a plan.
fn sample_all(
    request: &PlanRequest,
    settings: &FrenetSettings,
    assumptions: Assumptions,
    steered: Option<Incumbent>,
) -> Candidates {
    let n_points = n_points(request, settings);
    let is_known = request.state.is_finite();
    let Some(start) =
        is_known.then(|| Start::new(request, assumptions.knows_yaw_rate(request, settings)).ok()).flatten()
    else {
        return Candidates { n_points, desired_velocity: f64::NAN, ..Candidates::default() };
    };
    let limits = Limits::new(request, n_points, start.curvature, assumptions.slack);
    let targets = Targets::new(request, &start, settings);
    let mut memory = FrenetMemory::default();
    let FrenetMemory { samples, costs, obstacles, wholes, evaluation: evaluation_memory, .. } = &mut memory;
    prepare(
        request,
        settings,
        (&start, &targets, &limits, !assumptions.keeps_clear),
        (samples, costs, obstacles, wholes),
    );
    if let Some(incumbent) = steered {
        let state = (&start, &targets, &limits);
        steered::steer_all((wholes, obstacles), request, state, samples, &settings.weights, incumbent);
    }
    let (start, limits, keeps_clear) = (&start, &limits, assumptions.keeps_clear);
    let problem = Problem { request, settings, start, limits, keeps_clear };
    let mut evaluation =
        Evaluation::new(problem, Tables { samples, costs, obstacles, wholes, memory: evaluation_memory });
    match steered {
        Some(incumbent) => Candidates::of_wholes(&mut evaluation, (incumbent.velocity, incumbent.cost)),
        None => Candidates::of(&mut evaluation, targets.velocity),
    }
}

/// Everything that is shared by the samples.
fn prepare(
    request: &PlanRequest,
    settings: &FrenetSettings,
    (start, targets, limits, is_narrow): (&Start, &Targets, &Limits, bool),
    (samples, costs, obstacles, wholes): (&mut SampleGrid, &mut TableCosts, &mut Obstacles, &mut Wholes),
) {
    let path = &request.route.path;
    samples.generate(&Inputs { start, targets, limits, settings, path, is_narrow });
    costs.prepare(samples, targets.velocity, &settings.weights, path);
    wholes.shift(request, start, limits, targets, &settings.weights);
    obstacles.prepare(request, (start, wholes), samples, settings);
}

/// Full braking, or the least bad of the samples that collide with no more energy than it does; `None` if neither
/// stays on the road. The smallest difference of velocities is least bad, where one second more counts like 2 m/s less.
fn least_bad(evaluation: &mut Evaluation) -> Option<Trajectory> {
    let Problem { request, start, limits, .. } = evaluation.problem;
    // The least is best.
    let severity = |contact: &Contact| contact.closing_speed - WORTH_OF_TIME * contact.interval as f64 * limits.dt;
    let mut braking: Option<(Contact, Vec<State>)> = None;
    for points in emergency_braking::full_braking(request, limits.n_points, &mut evaluation.tables.memory.road) {
        let waypoints = waypoints(&points, start.d);
        let Some(contact) = evaluation.tables.obstacles.first_contact(&waypoints, limits.dt, request) else {
            return Some(Trajectory { points });
        };
        if braking.as_ref().is_none_or(|(least, _)| severity(&contact) < severity(least)) {
            braking = Some((contact, points));
        }
    }
    let mut contacts = std::mem::take(&mut evaluation.tables.memory.contacts);
    if let Some((bound, _)) = &braking {
        contacts.retain(|(_, contact)| severity(contact) < severity(bound) && contact.is_no_harder_than(bound));
    }
    contacts.sort_by(|a, b| severity(&a.1).total_cmp(&severity(&b.1)).then(a.0.cmp(&b.0)));
    let found = contacts.iter().find(|(sample, _)| {
        evaluation.write_if_drivable(*sample as usize);
        evaluation.stays_on_road()
    });
    let trajectory = found.map(|_| trajectory(request, start, evaluation.points()));
    evaluation.tables.memory.contacts = contacts;
    trajectory.or(braking.map(|(_, points)| Trajectory { points }))
}

/// A trajectory for the search for contacts, which takes it to keep its offset from the path.
fn waypoints(points: &[State], d: f64) -> Vec<Waypoint> {
    let waypoint = |point: &State| Waypoint {
        center: point.pose().position,
        axis: Point::from_angle(point.orientation),
        velocity: point.velocity,
        acceleration: point.acceleration,
        d,
        ..Waypoint::default()
    };
    points.iter().map(waypoint).collect()
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
