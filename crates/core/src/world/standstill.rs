//! The end of a world in which nothing moves any more.

use super::{Drive, World};
use crate::conduct::REST_SPEED;
use crate::geometry::Point;
use crate::recording::OutcomeKind;
use crate::scenario::Scenario;

/// An agent stands while it is at rest and no further than this from where it came to stand [m]: an agent that creeps to its
/// goal does not stand.
const STANDING_DISTANCE: f64 = 0.1;

/// Where an agent stands, and since which time step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stand {
    at: Point,
    since: i64,
}

impl World {
    /// Ends all agents once nothing has moved for `step.standstill_s` and nothing else can set one of them in motion.
    ///
    /// The time begins when the last agent has come to stand, entered or ended, the last goal has become admissible (an
    /// agent may be waiting for that), and the recording is over: until then replayed participants may move, enter or
    /// leave, and agents may follow their own recordings. The longest cycle of a traffic light comes on top, so that
    /// each has shown everything. An agent that stands where only time is missing will reach its goal, early or late.
    pub(super) fn judge_standstill(&mut self) {
        let time_step = self.time_step;
        if time_step < self.recording_end || self.settings.step.standstill_s.is_infinite() {
            return;
        }
        let mut begin = self.recording_end;
        for drive in &mut self.drives {
            if drive.outcome.kind != OutcomeKind::Running {
                begin = begin.max(drive.outcome.time_step);
                continue;
            }
            let is_here = time_step >= drive.agent.start_time_step;
            let Some(state) = self.states[drive.row].filter(|_| is_here) else {
                // It is still to enter.
                begin = time_step;
                continue;
            };
            let at = state.pose().position;
            let stands =
                |stand: &Stand| stand.at.distance(at) <= STANDING_DISTANCE && state.velocity.abs() < REST_SPEED;
            let stand = drive.stand.filter(stands).unwrap_or(Stand { at, since: time_step });
            drive.stand = Some(stand);
            let goal = &drive.agent.goal;
            let admissible = goal.states.iter().map(|alternative| alternative.time_step.0).max();
            let waits = goal.is_met_at_any_time(&state);
            begin = begin.max(if waits { time_step } else { stand.since }).max(admissible.unwrap_or(begin));
        }
        if (time_step - begin) as f64 * self.scenario.dt < self.standstill_s() - 1e-9 {
            return;
        }
        let ends: Vec<String> = self.drives.iter().map(|drive| self.told_standstill(drive)).collect();
        for (drive, message) in self.drives.iter_mut().zip(ends) {
            if drive.outcome.kind == OutcomeKind::Running {
                (drive.outcome.kind, drive.outcome.message) = (OutcomeKind::TimeLimit, message);
            }
        }
    }

    /// For how long nothing must have moved [s].
    fn standstill_s(&self) -> f64 {
        let longest = self.scenario.control.lights.iter().map(|light| light.changing_cycle()).max();
        self.settings.step.standstill_s + longest.unwrap_or(0) as f64 * self.scenario.dt
    }

    /// Where an agent stood for how long, and how long it would have gone on standing.
    fn told_standstill(&self, drive: &Drive) -> String {
        let seconds = |steps: i64| format!("{:?}", (steps as f64 * self.scenario.dt * 1e3).round() / 1e3);
        let Some(Stand { at, since }) = drive.stand else { return String::new() };
        let own = drive.last_time_step(&self.settings.step).unwrap_or(i64::MAX);
        let rest = match self.final_time_step() {
            last if last < own => format!("the run would have ended at {} s", seconds(last)),
            _ => format!("its time would have been up at {} s", seconds(own)),
        };
        let stood = seconds(self.time_step - since);
        // Without "-0.0".
        let [x, y] = [at.x, at.y].map(|coordinate| (coordinate * 10.0).round() / 10.0 + 0.0);
        format!("nothing moved any more: it had stood at ({x:.1}, {y:.1}) for {stood} s; {rest}")
    }
}

/// The first time step from which on replayed participants neither move nor leave, whichever of them are agents.
pub(super) fn recording_end(scenario: &Scenario) -> i64 {
    let obstacles = &scenario.obstacles;
    let states = &obstacles.states;
    let is_there = |column: usize| {
        let mut moving = (0..states.ids.len()).filter(|row| !obstacles.is_static[*row]);
        moving.any(|row| states.valid[row * states.n_steps + column])
    };
    let columns = (0..states.n_steps).rev().find(|column| is_there(*column)).map_or(0, |column| column + 1);
    states.first_time_step + columns as i64
}
