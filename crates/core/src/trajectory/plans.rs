//! Plans of all agents, and how they came about.

use super::State;
use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::turn::Turn;

/// How a plan came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum PlanStatus {
    /// No plan yet.
    None = 0,
    /// A trajectory was chosen by the planner.
    Planned = 1,
    /// Nothing was free of collision: emergency braking.
    EmergencyBraking = 2,
    /// Not even emergency braking was possible.
    Infeasible = 3,
    /// The planner raised or returned garbage.
    Error = 4,
}

impl PlanStatus {
    /// All; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 5] = [Self::None, Self::Planned, Self::EmergencyBraking, Self::Infeasible, Self::Error];
}

/// Why a planner found no ordinary plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstruction {
    /// What rejected most of the samples that the vehicle can drive, in words.
    pub rejection: String,
    /// Where the agent's centre would be in the first contact, or at its largest overhang [m]; NaN: nowhere.
    pub at: Point,
    /// How far the cheapest of the samples that leave the road reaches beyond the lanelets [m]; NaN for other reasons.
    pub overhang: f64,
}

impl Obstruction {
    /// A rejection without a place.
    pub fn nowhere(rejection: &str) -> Self {
        Self { rejection: rejection.into(), at: Point::new(f64::NAN, f64::NAN), overhang: f64::NAN }
    }
}

/// One trajectory: point 0 is the state at planning time, point `i` is `i * dt` later. Positions are footprint centres.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// Points, dt apart.
    pub points: Vec<State>,
}

/// The plans of all agents that are being driven, one row per agent, sorted by id.
///
/// Every field of the points has shape (agents, points), row-major; point 0 is the state at planning time. Rows whose
/// plan is shorter are filled with NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct Plans {
    /// Time step at which the plans were made.
    pub time_step: i64,
    /// Agent ids, ascending.
    pub ids: Vec<i64>,
    /// Number of points of every row.
    pub n_points: usize,
    /// Points, (agents, points); NaN beyond the end of a shorter plan.
    pub points: Vec<State>,
    /// How each plan came about.
    pub status: Vec<PlanStatus>,
    /// Cost of the chosen trajectory; NaN if the planner has none.
    pub cost: Vec<f64>,
    /// Text for rows with status `Error`.
    pub message: Vec<String>,
    /// Rows without an ordinary plan, ascending, and why, where the planner says so.
    pub obstructions: Vec<(usize, Obstruction)>,
    /// The side to which each agent that chooses its lanes changes, or wants to; `None`: to no side.
    pub lane_change: Vec<Option<Turn>>,
    /// How long each row was planned by the core [ns]; empty unless the world has a clock.
    pub nanoseconds: Vec<u64>,
}

impl Plans {
    /// Rows without a plan.
    pub fn none(time_step: i64, ids: Vec<i64>, n_points: usize) -> Self {
        let n = ids.len();
        Self {
            time_step,
            ids,
            n_points,
            points: vec![Self::NO_POINT; n * n_points],
            status: vec![PlanStatus::None; n],
            cost: vec![f64::NAN; n],
            message: vec![String::new(); n],
            obstructions: Vec::new(),
            lane_change: vec![None; n],
            nanoseconds: Vec::new(),
        }
    }

    /// Becomes a table of rows without a plan; memory is reused.
    pub(crate) fn clear(&mut self, time_step: i64, ids: impl Iterator<Item = i64>, n_points: usize) {
        self.ids.clear();
        self.ids.extend(ids);
        (self.time_step, self.n_points) = (time_step, n_points);
        let n = self.ids.len();
        self.points.clear();
        self.points.resize(n * n_points, Self::NO_POINT);
        self.status.clear();
        self.status.resize(n, PlanStatus::None);
        self.cost.clear();
        self.cost.resize(n, f64::NAN);
        self.message.clear();
        self.message.resize(n, String::new());
        self.obstructions.clear();
        self.lane_change.clear();
        self.lane_change.resize(n, None);
        self.nanoseconds.clear();
    }

    /// A point that is not there.
    pub const NO_POINT: State = State {
        x: f64::NAN,
        y: f64::NAN,
        orientation: f64::NAN,
        velocity: f64::NAN,
        acceleration: f64::NAN,
        yaw_rate: f64::NAN,
    };

    /// Writes the plan of an agent; the table grows if the plan is longer than any before.
    ///
    /// # Errors
    /// `UnknownId` if the agent does not drive now.
    pub fn set_row(&mut self, id: i64, points: &[State]) -> Result<()> {
        let row = self.row(id).ok_or(Error::UnknownId { what: "driving agent", id })?;
        if points.len() > self.n_points {
            let mut wider = vec![Self::NO_POINT; self.ids.len() * points.len()];
            for other in 0..self.ids.len() {
                wider[other * points.len()..][..self.n_points].copy_from_slice(self.row_points(other));
            }
            (self.points, self.n_points) = (wider, points.len());
        }
        let range = row * self.n_points..(row + 1) * self.n_points;
        self.points[range.clone()].fill(Self::NO_POINT);
        self.points[range.start..range.start + points.len()].copy_from_slice(points);
        self.status[row] = PlanStatus::Planned;
        self.cost[row] = f64::NAN;
        Ok(())
    }

    /// Notes that an agent's planner failed.
    ///
    /// # Errors
    /// `UnknownId` if the agent does not drive now.
    pub fn fail_row(&mut self, id: i64, message: String) -> Result<()> {
        let row = self.row(id).ok_or(Error::UnknownId { what: "driving agent", id })?;
        self.status[row] = PlanStatus::Error;
        self.message[row] = message;
        Ok(())
    }

    /// Points of a row.
    pub fn row_points(&self, row: usize) -> &[State] {
        &self.points[row * self.n_points..(row + 1) * self.n_points]
    }

    /// Row of an agent.
    pub fn row(&self, id: i64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }
}
