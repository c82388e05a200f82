//! Native planners: a closed set, one call for all agents.

pub mod frenet;
pub mod outside;

use crate::geometry::Pose;
use crate::geometry::shape::Shape;
use crate::road::RoadNetwork;
use crate::route::Route;
use crate::scenario::Goal;
use crate::trajectory::{PlanStatus, Predictions, State, Trajectory};
use crate::vehicle::Vehicle;

/// Who plans for an agent.
#[derive(Debug, Clone, PartialEq)]
pub enum Planner {
    /// Sampling in the Frenet frame of the reference path.
    Frenet(Box<frenet::FrenetSettings>),
    /// Somebody outside the core, who writes a row of `Plans`.
    External,
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
    /// Its footprint in its body frame.
    pub shape: &'a Shape,
    /// Never moves.
    pub is_static: bool,
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
    /// Participants in view, sorted by id.
    pub others: &'a [Other<'a>],
    /// Expectations for everybody; only the rows of `others` may be looked at.
    pub predictions: &'a Predictions,
    /// The plan of the step before, still starting at its own time; `None` at first.
    pub previous: Option<&'a Trajectory>,
    /// How many steps ago `previous` was made.
    pub previous_age: usize,
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
}
