//! Native planners: a closed set, one call for all agents.

mod conflicts;
mod arrival;
mod comfort;
mod car_following;
mod driven_point;
mod driving_line;
mod wavering;
mod emergency_braking;
mod frame;
mod lane_change;
mod lanes;
mod neighbours;
pub mod frenet;
mod idm;
mod lawful;
pub mod learned;
mod mobil;
mod prediction_index;
pub mod external_plan;
mod speed_profile;
mod passing;
mod path_motion;
pub mod pdm;
pub mod policy;
mod polynomial;
mod recorded;
mod recorded_path;
pub(crate) mod reference_driver;
pub mod rollout;
#[cfg(test)]
mod testing;
mod velocity_adjusting;
pub mod weights;

pub use car_following::CarFollowing;
pub use comfort::{Comfort, FrenetComfort};
pub use idm::IdmSettings;
pub use lawful::LawfulSettings;
pub use mobil::IdmMobilSettings;
pub(crate) use passing::narrow_place;
pub use pdm::PdmSettings;
pub use prediction_index::PredictionIndex;
pub use reference_driver::{CcSettings, FsmSettings, R157Settings, ReferenceDriving, RssSettings};
pub use velocity_adjusting::VelocityAdjustingSettings;
pub use wavering::{PlaceInLane, Wavering};

use crate::barrier::{Barrier, BarrierReason, Barriers};
use crate::conduct::STATIONARY_SPEED;
use crate::error::Result;
use crate::geometry::Pose;
use crate::geometry::shape::Shape;
use crate::observation::PathTable;
use crate::reference_drivers::Driver;
use crate::road::RoadNetwork;
use crate::route::Route;
use crate::rules::{Indicator, Rules, RulesSettings, Way};
use crate::scenario::{Goal, Scenario};
use crate::trajectory::{Obstruction, PlanStatus, Predictions, State, Trajectory};
use crate::turn::Turn;
use crate::vehicle::{ParticipantKind, Vehicle};
use car_following::LEADER_HEADING_COSINE;
use driving_line::{DrivingLine, LinePoint};
use lanes::Lanes;
use recorded_path::RecordedPath;

/// The planner of an agent.
#[derive(Debug, Clone, PartialEq)]
pub enum Planner {
    /// Closed-loop roll-outs along the reference path.
    Rollout(Box<rollout::RolloutSettings>),
    /// Sampling in the Frenet frame of the reference path.
    Frenet(Box<frenet::FrenetSettings>),
    /// The recording, state by state.
    Recorded,
    /// The recorded path at the recorded speed, slower behind other participants.
    VelocityAdjusting(VelocityAdjustingSettings),
    /// The reference path with the Intelligent Driver Model.
    Idm(IdmSettings),
    /// The same as fast as is lawful.
    Lawful(LawfulSettings),
    /// The same with lane changes by MOBIL.
    IdmMobil(Box<IdmMobilSettings>),
    /// The best of proposals that are scored, after PDM-Closed.
    Pdm(Box<PdmSettings>),
    /// The reference path as a reference driver.
    Reference(Driver, ReferenceDriving),
    /// A learned policy.
    Policy(policy::SharedPolicy),
    /// A planner outside the core that writes a row of `Plans`.
    External,
}

impl Planner {
    /// It stops before what [`Rules::told`] names.
    pub fn heeds_barriers(&self) -> bool {
        !matches!(self, Self::Recorded | Self::VelocityAdjusting(_) | Self::Policy(_) | Self::External)
    }

    /// It chooses among candidates.
    pub fn chooses(&self) -> bool {
        matches!(self, Self::Rollout(_) | Self::Frenet(_) | Self::Pdm(_))
    }
}

/// Another participant that the planning agent sees.
#[derive(Debug, Clone, Copy)]
pub struct Other<'a> {
    /// Its row in the predictions.
    pub row: usize,
    /// Where it is now (footprint centre).
    pub pose: Pose,
    /// Its speed now [m/s].
    pub velocity: f64,
    /// How hard it has braked of late [m/s²], not negative.
    pub braking: f64,
    /// Its footprint in its body frame.
    pub shape: &'a Shape,
    /// Never moves.
    pub is_static: bool,
    /// Kind.
    pub kind: ParticipantKind,
}

impl Other<'_> {
    /// It moves along a path, to whose direction its heading has this cosine, or reverses towards a vehicle on it.
    fn leads(&self, cos: f64) -> bool {
        cos * self.velocity.signum() > LEADER_HEADING_COSINE || self.velocity < 0.0 && cos > LEADER_HEADING_COSINE
    }

    /// Speed along such a path [m/s]: negative if it reverses; oncoming traffic counts as standing.
    fn velocity_along(&self, cos: f64) -> f64 {
        let along = self.velocity * cos;
        if self.velocity < -STATIONARY_SPEED { along } else { along.max(0.0) }
    }
}

/// All that a native planner may know for one plan.
#[derive(Debug, Clone, Copy)]
pub struct PlanRequest<'a> {
    /// Time step of the plan's point 0.
    pub time_step: i64,
    /// Time between points [s].
    pub dt: f64,
    /// The agent's state now (footprint centre).
    pub state: State,
    /// Its state when it entered, or began to plan.
    pub entry: State,
    /// Its parameters and limits.
    pub vehicle: &'a Vehicle,
    /// Its footprint.
    pub shape: &'a Shape,
    /// Its route with the reference path.
    pub route: &'a Route,
    /// Arc length of the rear axle on the reference path at the last step [m]; NaN at first.
    pub s_hint: f64,
    /// Where it wants to be, and when.
    pub goal: &'a Goal,
    /// The roads.
    pub road: &'a RoadNetwork,
    /// Its footprint has been fully on the road; before that, leaving it is not counted.
    pub was_on_road: bool,
    /// Participants in view, sorted by id.
    pub others: &'a [Other<'a>],
    /// Predictions for all participants; only the rows of `others` may be read.
    pub predictions: &'a Predictions,
    /// What all plans share about them.
    pub prediction_index: &'a PredictionIndex,
    /// The plan of the step before, still starting at its own time; `None` at first.
    pub previous: Option<&'a Trajectory>,
    /// How many steps ago `previous` was made.
    pub previous_age: usize,
    /// For how long it has stood [s].
    pub standing: f64,
    /// The rules of the road that it obeys.
    pub rules: Rules<'a>,
    /// Last time step of the grace period; `None` if the goal has no end.
    pub last_time_step: Option<i64>,
    /// What a lane change asks of it.
    pub lane_change: LaneChange,
    /// The lane change that it has shown by its blinkers, and since when.
    pub indicator: Indicator,
    /// The line that it takes within its lane; `None`: the path.
    pub line: Option<&'a driving_line::DrivingLine>,
}

/// What a lane change asks of an agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneChange {
    /// It changes into a gap that is large enough: vehicles behind it keep the distance.
    pub is_accepted: bool,
    /// Desired speed that brings it beside a gap [m/s].
    pub velocity: Option<f64>,
    /// Arc length on the path that its front must not pass in this lane [m]; infinite without one.
    pub end: f64,
    /// How much more an offset from the lane counts, the sooner the change has to be done.
    pub urgency: f64,
    /// The side to which it changes, or wants to.
    pub side: Option<Turn>,
}

impl Default for LaneChange {
    /// There is none.
    fn default() -> Self {
        Self { is_accepted: false, velocity: None, end: f64::INFINITY, urgency: 1.0, side: None }
    }
}

impl PlanRequest<'_> {
    /// The line that the agent takes within its lane, at an arc length [m].
    fn line_at(&self, s: f64) -> LinePoint {
        let middle = || LinePoint { curvature: self.route.path.curvature_at(s), ..LinePoint::default() };
        self.line.map_or_else(middle, |line| line.at(s))
    }

    /// Curvature of the line that the agent takes, or of the path, at an arc length [1/m].
    fn line_curvature_at(&self, s: f64) -> f64 {
        self.line.map_or_else(|| self.route.path.curvature_at(s), |line| line.curvature_at(s))
    }

    /// The side of a change to a lane with half a width [m] that is under way: from when the agent is mostly outside of the
    /// lane, or shows it, until it has settled there.
    fn change_to(&self, aim: &lanes::Aim, half: f64) -> Option<Turn> {
        Some(aim.side()).filter(|side| aim.d.abs() > half || self.indicator.side() == Some(*side))
    }

    /// All barriers of a way, if the rear axle is at an arc length [m].
    fn barriers(&self, way: &Way, s: f64) -> Barriers {
        let front = s + self.vehicle.rear_axle_to_center + 0.5 * self.vehicle.length;
        let mut found = self.rules.barriers(way, front, self.state.velocity.max(0.0));
        let end = self.lane_change.end;
        found.extend(end.is_finite().then(|| Barrier::lasting(end, BarrierReason::LaneEnd)));
        found
    }
}

/// What a native planner returns.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanResult {
    /// The chosen trajectory; point 0 is the present state.
    pub trajectory: Trajectory,
    /// How it came about.
    pub status: PlanStatus,
    /// Its cost; NaN if none was computed.
    pub cost: f64,
    /// Why there is no plan, for people; empty otherwise.
    pub message: String,
    /// Why there is no ordinary plan; `None` if there is one.
    pub obstruction: Option<Obstruction>,
    /// The side to which an agent that chooses its lanes changes, or wants to.
    pub lane_change: Option<Turn>,
}

impl PlanResult {
    /// An ordinary plan; its cost is NaN if none was computed.
    pub(crate) fn planned(trajectory: Trajectory, cost: f64) -> Self {
        let (message, obstruction, lane_change) = (String::new(), None, None);
        Self { trajectory, status: PlanStatus::Planned, cost, message, obstruction, lane_change }
    }

    /// Emergency braking.
    fn braking(trajectory: Trajectory) -> Self {
        Self { status: PlanStatus::EmergencyBraking, ..Self::planned(trajectory, f64::NAN) }
    }

    /// Not even emergency braking.
    fn infeasible(trajectory: Trajectory, message: String) -> Self {
        Self { status: PlanStatus::Infeasible, message, ..Self::planned(trajectory, f64::NAN) }
    }
}

/// What a planner works out once for an agent, before the first step; planners keep no other memory, but for reference drivers, which count how
/// long they have been reacting (`Alertness`).
#[derive(Debug, Clone)]
pub enum Prepared {
    /// Nothing.
    Nothing,
    /// The agent's recording.
    RecordedPath(Box<RecordedPath>),
    /// The lanes that lead to the goal.
    Lanes(Lanes),
    /// The lanes of a route with lane changes.
    LaneRoutes(Box<lane_change::LaneRoutes>),
    /// The line on a route without.
    DrivingLine(DrivingLine),
    /// What is known about the route of an observer.
    PathTable(Box<PathTable>),
}

impl Prepared {
    /// For an agent that enters at a time step.
    ///
    /// # Errors
    /// `InvalidInput` if the planner needs a recording and there is none.
    pub fn new(
        planner: &Planner,
        (id, first_time_step): (i64, i64),
        vehicle: &Vehicle,
        (route, goal): (&Route, &Goal),
        (scenario, rules): (&Scenario, &RulesSettings),
    ) -> Result<Self> {
        let recorded_path =
            |name| Ok(Self::RecordedPath(Box::new(RecordedPath::new(scenario, id, first_time_step, vehicle, name)?)));
        match planner {
            Planner::Rollout(settings) => {
                let line = settings.cut_bends.then_some(vehicle);
                let lanes = lane_change::LaneRoutes::along((route, goal), line, scenario, rules);
                Ok(match (lanes, line) {
                    (Some(lanes), _) => Self::LaneRoutes(Box::new(lanes)),
                    (None, Some(vehicle)) => Self::DrivingLine(DrivingLine::of(route, vehicle, &scenario.road)),
                    (None, None) => Self::Nothing,
                })
            }
            Planner::Frenet(_)
            | Planner::Idm(_)
            | Planner::Lawful(_)
            | Planner::Pdm(_)
            | Planner::Reference(..)
            | Planner::External => Ok(Self::Nothing),
            Planner::Recorded => recorded_path("recorded"),
            Planner::VelocityAdjusting(_) => recorded_path("velocity_adjusting"),
            Planner::Policy(_) => Ok(Self::PathTable(Box::new(PathTable::new(route, goal, &scenario.road)))),
            Planner::IdmMobil(_) => Ok(Self::Lanes(Lanes::along(route, goal, scenario, rules)?)),
        }
    }
}

impl Prepared {
    /// The way of the lane in which a vehicle is, with the arc length of its rear axle there [m]; `None` for a planner that
    /// keeps to the reference path, or in none of its lanes.
    pub(crate) fn way_below(&self, rear_axle: Pose) -> Option<(&Way, f64)> {
        match self {
            Self::Lanes(lanes) => lanes.way_below(rear_axle),
            Self::LaneRoutes(lanes) => lanes.way_below(rear_axle),
            _ => None,
        }
    }

    /// The agent chooses its lanes, whatever its reference path does.
    pub(crate) fn chooses_lanes(&self) -> bool {
        matches!(self, Self::Lanes(_) | Self::LaneRoutes(_))
    }

    /// The request in the frame of the lane in which the agent drives.
    fn aim<'a>(&'a self, request: &PlanRequest<'a>, comfort: &Comfort) -> PlanRequest<'a> {
        match self {
            Self::LaneRoutes(lanes) => lanes.aim(request, comfort),
            Self::DrivingLine(line) => PlanRequest { line: Some(line), ..*request },
            _ => *request,
        }
    }
}

/// What a plan was chosen from.
#[derive(Debug, Clone, PartialEq)]
pub enum Candidates {
    /// Samples of `frenet`.
    Frenet(frenet::Candidates),
    /// Roll-outs of `rollout`.
    Rollout(rollout::RolloutCandidates),
    /// Proposals of `pdm`.
    Pdm(pdm::PdmCandidates),
}

/// All that a plan was chosen from, with costs and the reasons of rejection; `None` for a planner that does not choose.
pub fn candidates(planner: &Planner, prepared: &Prepared, request: &PlanRequest) -> Option<Candidates> {
    match planner {
        Planner::Frenet(settings) => Some(Candidates::Frenet(frenet::candidates(request, settings))),
        Planner::Rollout(settings) => {
            let aimed = prepared.aim(request, &settings.comfort);
            Some(Candidates::Rollout(rollout::candidates(&aimed, settings)))
        }
        Planner::Pdm(settings) => Some(Candidates::Pdm(pdm::candidates(request, settings))),
        _ => None,
    }
}

/// Memory that plans reuse: after the first few plans nothing but the result is allocated. Holds no state: a plan does
/// not depend on what was planned before with the same memory.
#[derive(Debug, Clone, Default)]
pub struct PlanningMemory {
    /// The participants that the agent sees, as positions among those present.
    pub(crate) visible: Vec<usize>,
    /// Always empty between plans.
    pub(crate) others: Vec<Other<'static>>,
    frenet: frenet::FrenetMemory,
    rollout: rollout::RolloutMemory,
    pdm: pdm::PdmMemory,
    policy: policy::PolicyMemory,
    conflicts: conflicts::Conflicts,
    speed_profile: speed_profile::SpeedProfile,
    /// Motions of the plan, and of a plan that ignores later occupancies.
    motions: Vec<car_following::PathMotion>,
    free: Vec<car_following::PathMotion>,
    effort: usize,
    /// What a reference driver remembers; the world hands it in and takes it back.
    pub(crate) alertness: reference_driver::Alertness,
}

impl PlanningMemory {
    /// Roughly how much work the last plan was, to compare plans with: 0 where it was little.
    pub(crate) fn effort(&self) -> usize {
        self.effort
    }

    /// The cost terms of the last choice of the sampling planner.
    pub(crate) fn cost_breakdown(&mut self) -> &mut frenet::CostBreakdown {
        self.frenet.breakdown()
    }
}

/// The plan of a native planner; `None` for one outside the core.
///
/// # Panics
/// If `prepared` was made for another planner.
pub fn plan(
    planner: &Planner,
    prepared: &Prepared,
    request: &PlanRequest,
    memory: &mut PlanningMemory,
) -> Option<PlanResult> {
    memory.effort = 0;
    if !request.state.is_finite() && !matches!(planner, Planner::External) {
        return Some(refused(request, "the present state is not a number"));
    }
    Some(match (planner, prepared) {
        (Planner::External, _) => return None,
        (Planner::Frenet(settings), _) => {
            let found = frenet::plan(request, settings, &mut memory.frenet);
            memory.effort = memory.frenet.effort();
            found
        }
        (Planner::Rollout(settings), _) => {
            let aimed = prepared.aim(request, &settings.comfort);
            let found = rollout::plan(&aimed, settings, &mut memory.rollout);
            memory.effort = memory.rollout.effort();
            let found = found.unwrap_or_else(|| refused(request, "the agent is not beside its path"));
            PlanResult { lane_change: aimed.lane_change.side, ..found }
        }
        (Planner::Recorded, Prepared::RecordedPath(recorded_path)) => recorded::plan(request, recorded_path, memory),
        (Planner::VelocityAdjusting(settings), Prepared::RecordedPath(recorded_path)) => {
            velocity_adjusting::plan(request, settings, recorded_path, memory)
        }
        (Planner::Idm(settings), _) => idm::plan(request, settings, memory),
        (Planner::Lawful(settings), _) => lawful::plan(request, settings, memory),
        (Planner::Pdm(settings), _) => {
            let found = pdm::plan(request, settings, &mut memory.pdm);
            memory.effort = memory.pdm.effort();
            found.unwrap_or_else(|reason| refused(request, reason))
        }
        (Planner::Reference(driver, settings), _) => reference_driver::plan(request, (*driver, settings), memory),
        (Planner::IdmMobil(settings), Prepared::Lanes(lanes)) => mobil::plan(request, settings, lanes, memory),
        (Planner::IdmMobil(_), Prepared::Nothing) => refused(request, "its lanes make no path"),
        (Planner::Policy(found), Prepared::PathTable(table)) => policy::plan(request, found, table, &mut memory.policy),
        _ => unreachable!("prepared for another planner"),
    })
}

/// What an agent does that its planner cannot help: it stays if it stands, and otherwise brakes as hard as it can.
fn refused(request: &PlanRequest, reason: &str) -> PlanResult {
    emergency_braking::without_plan(request, request.predictions.n_steps + 1, reason)
}
