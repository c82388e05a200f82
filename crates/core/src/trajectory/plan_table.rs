//! The plans of a whole run, one array per field.

use super::{Obstruction, PlanStatus, Plans};
use crate::turn::Turn;

/// All plans of a run: one row per agent and time step, sorted by time step, then id.
///
/// Plans are most of what a large run holds, so they are there once: a recording hands its table over instead of
/// copying it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanTable {
    /// Time step at which the plan was made.
    pub time_step: Vec<i64>,
    /// Agent of the plan.
    pub agent_id: Vec<i64>,
    /// How the plan came about.
    pub status: Vec<PlanStatus>,
    /// Cost of the chosen trajectory; NaN if the planner has none.
    pub cost: Vec<f64>,
    /// What the agent showed by its blinkers then.
    pub turn: Vec<Option<Turn>>,
    /// Number of points of every row.
    pub n_points: usize,
    /// The fields of the points in the order of [`Self::FIELDS`], (rows, points) each; NaN beyond the end of a plan.
    pub points: [Vec<f64>; 5],
    /// Rows without an ordinary plan, ascending, and why, where the planner says so.
    pub obstructions: Vec<(usize, Obstruction)>,
}

impl PlanTable {
    /// Names of the fields of points: positions are footprint centres [m], heading [rad], [m/s], [m/s²].
    pub const FIELDS: [&str; 5] = ["x", "y", "orientation", "velocity", "acceleration"];

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.agent_id.len()
    }

    /// Becomes a table without rows; memory is reused.
    pub(crate) fn clear(&mut self) {
        let Self { time_step, agent_id, status, cost, turn, n_points, points, obstructions } = self;
        time_step.clear();
        agent_id.clear();
        status.clear();
        cost.clear();
        turn.clear();
        *n_points = 0;
        points.iter_mut().for_each(Vec::clear);
        obstructions.clear();
    }

    /// Adds the plans of a time step with what the agents showed; all rows become longer if these are.
    pub(crate) fn push(&mut self, plans: &Plans, turns: &[Option<Turn>]) {
        if plans.n_points > self.n_points {
            self.widen(plans.n_points);
        }
        let first = self.n_rows();
        self.time_step.resize(first + plans.ids.len(), plans.time_step);
        self.agent_id.extend(&plans.ids);
        self.status.extend(&plans.status);
        self.cost.extend(&plans.cost);
        self.turn.extend_from_slice(turns);
        for row in 0..plans.ids.len() {
            for point in plans.row_points(row) {
                let values = [point.x, point.y, point.orientation, point.velocity, point.acceleration];
                self.points.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
            }
            let n = (first + row + 1) * self.n_points;
            self.points.iter_mut().for_each(|column| column.resize(n, f64::NAN));
        }
        self.obstructions.extend(plans.obstructions.iter().map(|(row, why)| (first + row, why.clone())));
    }

    fn widen(&mut self, n_points: usize) {
        for column in &mut self.points {
            let mut wider = Vec::with_capacity(self.agent_id.len() * n_points);
            for row in 0..self.agent_id.len() {
                wider.extend(&column[row * self.n_points..][..self.n_points]);
                wider.resize((row + 1) * n_points, f64::NAN);
            }
            *column = wider;
        }
        self.n_points = n_points;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::State;

    fn plans(time_step: i64, ids: &[i64], n_points: usize) -> Plans {
        let mut made = Plans::none(time_step, ids.to_vec(), n_points);
        for id in ids {
            let x = |k: usize| *id as f64 + 0.1 * k as f64;
            let points: Vec<State> = (0..n_points).map(|k| State { x: x(k), ..State::default() }).collect();
            made.set_row(*id, &points).expect("it is there");
        }
        made
    }

    #[test]
    fn rows_follow_time_and_id_and_shorter_plans_end_with_nan() {
        let mut table = PlanTable::default();
        table.push(&plans(3, &[1, 2], 2), &[None; 2]);
        table.push(&plans(4, &[2], 3), &[None; 1]);
        table.push(&plans(5, &[2], 1), &[None; 1]);
        assert_eq!(table.time_step, [3, 3, 4, 5]);
        assert_eq!(table.agent_id, [1, 2, 2, 2]);
        assert_eq!((table.n_rows(), table.n_points), (4, 3));
        let x: Vec<String> = table.points[0].iter().map(|x| format!("{x:.1}")).collect();
        assert_eq!(x.join(" "), "1.0 1.1 NaN 2.0 2.1 NaN 2.0 2.1 2.2 2.0 NaN NaN");
    }

    #[test]
    fn why_there_is_no_ordinary_plan_stays_with_its_row() {
        let mut table = PlanTable::default();
        table.push(&plans(0, &[1, 2], 2), &[None; 2]);
        let mut blocked = plans(1, &[1, 2], 2);
        blocked.obstructions.push((1, Obstruction::nowhere("collision with 9")));
        table.push(&blocked, &[Some(Turn::Left), None]);
        assert_eq!(
            table.obstructions.iter().map(|(row, why)| (*row, &*why.rejection)).collect::<Vec<_>>(),
            [(3, "collision with 9")]
        );
        assert_eq!(table.turn, [None, None, Some(Turn::Left), None]);
        table.clear();
        assert_eq!((table.n_rows(), table.obstructions.len()), (0, 0));
    }
}
