//! One step: all participants move at once; then contacts, road departure and goals; then participants enter and leave.

use crate::barrier::Barrier;
use std::collections::BTreeSet;

use super::{Drive, Outside, StepMemory, StepSettings, World};
use crate::collision::{Mover, departure, find_contacts, stays_inside};
use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::recording::{Outcome, OutcomeKind, Wait};
use crate::scenario::GoalState;
use crate::trajectory::{Plans, State, States};

/// Beyond the end of the goal's areas by this much [m], the goal is missed.
const MISSED_MARGIN: f64 = 1.0;

impl World {
    /// Moves all agents to point 1 of their plans and all others along their recording, judges, and records.
    ///
    /// An agent leaves with outcome `planner_error` if its plan has status `Error`, contains NaN, starts elsewhere or
    /// jumps; with outcome `infeasible` if its plan has that status; both at their present state.
    ///
    /// # Errors
    /// `WrongTimeStep`; `InvalidInput` if the plans' rows are not exactly the agents that drive now.
    pub fn step(&mut self, plans: &Plans) -> Result<()> {
        self.step_marked(plans, || ())
    }

    /// As [`World::step`]; `mark` is called right before and right after the search for contacts and road departures, so
    /// that a caller with a clock can time them.
    ///
    /// # Errors
    /// As [`World::step`].
    pub fn step_marked(&mut self, plans: &Plans, mark: impl FnMut()) -> Result<()> {
        self.step_among(plans, &Outside::default(), mark)
    }

    /// The same among participants that are driven from outside, with their states one step later.
    ///
    /// # Errors
    /// As [`World::step`]; `InvalidInput` for states that are not numbers, or for new ids that do not ascend from the
    /// largest one; `UnknownId` for the state of a participant that was never listed as new. The world stays as it was.
    pub fn step_among(&mut self, plans: &Plans, outside: &Outside, mut mark: impl FnMut()) -> Result<()> {
        self.check_time_step("plans", plans.time_step)?;
        self.check_outside(outside)?;
        if !self.driving_ids().eq(plans.ids.iter().copied()) {
            return Err(Error::invalid(format!(
                "plans for agents {:?}, but {:?} are driving",
                plans.ids,
                self.driving()
            )));
        }
        if self.settings.record_views {
            self.note_sightings();
        }
        self.orders();
        let orders = self.orders.take().unwrap_or_default();
        self.remember_crosswalks();
        self.adopt(plans);
        self.send_messages(plans, &orders);
        let shown = if self.settings.keep_recording { self.shown_by(&plans.ids) } else { Vec::new() };
        let mut memory = std::mem::take(&mut self.step_memory);
        if !(outside.new.is_empty() && outside.states.is_empty()) {
            self.append_outside(outside);
        }
        self.write_next_states(&mut memory.next);
        let placed = self.outside_rows(outside);
        placed.iter().for_each(|(row, state)| memory.next[*row] = Some(*state));
        let entered: Vec<usize> =
            placed.iter().map(|(row, _)| *row).filter(|row| self.states[*row].is_none()).collect();
        mark();
        self.judge_contacts(&mut memory, &outside.jumped);
        self.judge_road(&memory.next, &mut memory.edges);
        mark();
        std::mem::swap(&mut self.states, &mut memory.next);
        self.step_memory = memory;
        self.time_step += 1;
        self.judge_goals();
        self.judge_length();
        self.judge_standstill();
        self.remember(&orders);
        if self.settings.keep_recording {
            for (order, barrier) in orders.iter().filter_map(|order| Some((order, order.barrier?))) {
                let (first, last) = (self.time_step - 1, self.time_step - 1);
                let drive = &self.drives[self.drive_index(order.id)?];
                if !drive.obeys() {
                    continue;
                }
                let (agent, kind, Barrier { by, s: stop, .. }) = (order.id, order.kind as u8, barrier);
                self.recording.push_wait(Wait { agent, first, last, kind, by, stop });
            }
            self.recording.push_plans(plans, &shown);
        }
        // The final state of an agent that ends now is recorded; from the next step on it is gone.
        self.enter(self.time_step);
        entered.into_iter().for_each(|row| self.note_contacts_of(row));
        self.look_at_lights();
        self.recording.push(&self.states);
        for drive in &mut self.drives {
            if drive.outcome.kind != OutcomeKind::Running {
                self.states[drive.row] = None;
                // An agent that has just ended may drive on.
                if drive.outcome.time_step + 1 < self.time_step {
                    drive.forget();
                }
            }
        }
        self.file_messages();
        Ok(())
    }

    /// Records what each driving agent sees.
    fn note_sightings(&mut self) {
        let scene = self.scene_with_past(0);
        let ids = &self.participants.ids;
        for drive in self.drives.iter().filter(|drive| drive.is_driving(self.time_step)) {
            let seen = scene.visible_from(drive.row, &drive.agent.view);
            self.recording.push_sightings(self.time_step, drive.agent.id, seen.into_iter().map(|row| ids[row]));
        }
    }

    /// Adopts the plans; agents without one end.
    fn adopt(&mut self, plans: &Plans) {
        let time_step = self.time_step;
        for (row, id) in plans.ids.iter().enumerate() {
            let index = self.drive_index(*id).expect("checked against the driving agents");
            match self.adoption(&self.drives[index], plans, row) {
                Ok(Some(length)) => {
                    let (kept, made) = self.drives[index].plan.get_or_insert_default();
                    kept.points.clear();
                    kept.points.extend_from_slice(&plans.row_points(row)[..length]);
                    *made = time_step;
                    self.drives[index].indicator.set(plans.lane_change[row], time_step);
                }
                // The rest of the plan that it follows already.
                Ok(None) => {}
                Err((kind, message)) => {
                    let outcome = &mut self.drives[index].outcome;
                    *outcome = Outcome { kind, time_step, message, ..outcome.clone() };
                }
            }
        }
    }

    /// Writes the states one step later; `None` for participants that have left.
    fn write_next_states(&self, next: &mut Vec<Option<State>>) {
        next.clear();
        next.extend(
            self.recorded_row.iter().map(|row| row.and_then(|row| self.recorded_state(row, self.time_step + 1))),
        );
        for drive in &self.drives {
            if let Some(recorded) = drive.replayed.filter(|_| self.time_step + 1 < drive.agent.start_time_step) {
                next[drive.row] = self.recorded_state(recorded, self.time_step + 1);
            }
        }
        for drive in self.drives.iter().filter(|drive| drive.is_driving(self.time_step)) {
            next[drive.row] = drive.next_state(self.time_step);
        }
    }

    fn recorded_state(&self, row: usize, time_step: i64) -> Option<State> {
        let (states, time_step) = self.recorded_at(row, time_step);
        states.get(row, time_step)
    }

    fn is_recorded(&self, row: usize, time_step: i64) -> bool {
        let (states, time_step) = self.recorded_at(row, time_step);
        states.has(row, time_step)
    }

    /// The recording, and where the state of a row at a time step is in it.
    fn recorded_at(&self, row: usize, time_step: i64) -> (&States, i64) {
        let obstacles = &self.scenario.obstacles;
        (&obstacles.states, if obstacles.is_static[row] { obstacles.states.first_time_step } else { time_step })
    }

    fn judge_contacts(&mut self, StepMemory { next, moving, contacts, .. }: &mut StepMemory, jumped: &[i64]) {
        moving.clear();
        moving.extend((0..next.len()).filter(|row| self.states[*row].is_some() && next[*row].is_some()));
        let mover = |i: usize| {
            let row = moving[i];
            let (from, to) = (self.states[row].expect("filtered").pose(), next[row].expect("filtered").pose());
            let jumps = jumped.contains(&self.participants.ids[row]);
            Mover { shape: &self.participants.shape[row], from: if jumps { to } else { from }, to }
        };
        find_contacts(moving.len(), mover, |i| self.participants.is_agent[moving[i]], contacts);
        let mut still_touching = BTreeSet::new();
        for (i, j, fraction) in contacts.found.iter().copied() {
            let pair = (moving[i], moving[j]);
            if self.entered_in_contact.contains(&pair) {
                still_touching.insert(pair);
                continue;
            }
            let place = |row: usize| next[row].expect("filtered").pose();
            if self.participants.storeys.are_apart(place(pair.0), place(pair.1)) {
                continue;
            }
            let ids = &self.participants.ids;
            if self.scenario.overlaps.contains(&(ids[pair.0].min(ids[pair.1]), ids[pair.0].max(ids[pair.1]))) {
                continue;
            }
            let velocity = |row: usize| velocity_between(self.states[row].as_ref(), next[row].as_ref(), fraction);
            let impact_speed = (velocity(pair.0) - velocity(pair.1)).norm();
            self.collide(pair.0, Some(pair.1), impact_speed, fraction);
            self.collide(pair.1, Some(pair.0), impact_speed, fraction);
        }
        self.entered_in_contact = still_touching;
    }

    fn judge_road(&mut self, next: &[Option<State>], scratch: &mut Vec<u32>) {
        let road = std::sync::Arc::clone(&self.scenario.road);
        let mut departures = Vec::new();
        for drive in self.drives.iter_mut().filter(|drive| drive.is_driving(self.time_step)) {
            let (from, to) =
                (self.states[drive.row].expect("driving").pose(), next[drive.row].expect("driving").pose());
            if drive.was_on_road && stays_inside(&road, &drive.agent.shape, (from, to)) {
                continue;
            }
            if drive.was_on_road {
                if let Some(fraction) = departure(&road, &drive.agent.shape, &drive.agent.vehicle, (from, to), scratch)
                {
                    let speed = next[drive.row].expect("driving").velocity.abs();
                    departures.push((drive.row, speed, fraction));
                }
            } else {
                drive.was_on_road = road.covers_with(&drive.agent.shape, to, scratch);
            }
            if drive.was_on_road {
                let overhang = road.overhang(&drive.agent.shape, to, scratch);
                drive.outcome.off_lanelets = drive.outcome.off_lanelets.max(overhang);
                if overhang > road.settings().gap_tolerance {
                    drive.outcome.off_lanelets_s += self.scenario.dt;
                }
            }
        }
        for (row, speed, fraction) in departures {
            self.collide(row, None, speed, fraction);
        }
    }

    /// Ends an agent by a collision during this step; the earliest contact counts.
    fn collide(&mut self, row: usize, partner: Option<usize>, impact_speed: f64, fraction: f64) {
        let time_step = self.time_step + 1;
        let partner = partner.map(|partner| self.participants.ids[partner]);
        let Some(drive) = self.drives.iter_mut().find(|drive| drive.row == row) else { return };
        let message = format!("contact at {:.3} s", (self.time_step as f64 + fraction) * self.scenario.dt);
        let earlier = drive.outcome.kind == OutcomeKind::Collision && drive.contact_fraction <= fraction;
        let is_to_come = self.time_step < drive.agent.start_time_step;
        if earlier || is_to_come || !matches!(drive.outcome.kind, OutcomeKind::Running | OutcomeKind::Collision) {
            return;
        }
        drive.contact_fraction = fraction;
        drive.outcome = Outcome {
            kind: OutcomeKind::Collision,
            time_step,
            partner,
            off_road: partner.is_none(),
            impact_speed,
            message,
            ..drive.outcome
        };
    }

    fn judge_goals(&mut self) {
        let (time_step, settings, dt) = (self.time_step, self.settings.step, self.scenario.dt);
        for drive in self.drives.iter_mut().filter(|drive| drive.is_driving(time_step - 1)) {
            let state = self.states[drive.row].expect("a driving agent has a state");
            drive.arrive(&state, time_step, &settings, dt);
        }
    }

    /// Lets an agent that has just ended by a contact with another participant drive on as if it were untouched. The other
    /// one leaves: this time step is its last.
    ///
    /// # Errors
    /// `UnknownId` without such an agent; `InvalidInput` if the last step did not end it by a contact.
    pub fn drive_on(&mut self, id: i64) -> Result<()> {
        let unknown = || Error::UnknownId { what: "agent", id };
        let index = self.drives.iter().position(|drive| drive.agent.id == id).ok_or_else(unknown)?;
        let (time_step, settings, dt) = (self.time_step, self.settings.step, self.scenario.dt);
        let is_driving = |number| {
            self.drives.iter().any(|drive| drive.agent.id == number && drive.outcome.kind == OutcomeKind::Running)
        };
        let outcome = &self.drives[index].outcome;
        let (OutcomeKind::Collision, Some(partner)) = (outcome.kind, outcome.partner) else {
            return Err(Error::invalid(format!("agent {id} was not ended by a contact")));
        };
        if is_driving(partner) {
            return Err(Error::invalid(format!("agent {partner}, which would leave for {id}, drives on itself")));
        }
        let drive = &mut self.drives[index];
        let state = self.recording.last_state(drive.row);
        let (true, Some(state)) = (drive.outcome.time_step == time_step, state) else {
            return Err(Error::invalid(format!("agent {id} was not ended by a contact in the last step")));
        };
        let Outcome { off_lanelets, off_lanelets_s, .. } = drive.outcome;
        drive.outcome = Outcome { off_lanelets, off_lanelets_s, ..Outcome::running(time_step) };
        drive.arrive(&state, time_step, &settings, dt);
        let gone = self.participants.ids.iter().position(|participant| *participant == partner).ok_or_else(unknown)?;
        self.recorded_row[gone] = None;
        self.states[gone] = None;
        if gone >= self.n_own {
            self.sent_away.insert(gone);
        }
        self.entered_in_contact.retain(|(a, b)| *a != gone && *b != gone);
        self.judge_length();
        if self.drives[index].outcome.kind == OutcomeKind::Running {
            self.states[self.drives[index].row] = Some(state);
            self.look_at_lights_ahead_of(index);
        }
        Ok(())
    }

    /// Ends all agents at the largest number of time steps.
    fn judge_length(&mut self) {
        if self.time_step < self.final_time_step() {
            return;
        }
        let max_steps = self.time_step - self.scenario.obstacles.states.first_time_step;
        for drive in self.drives.iter_mut().filter(|drive| drive.outcome.kind == OutcomeKind::Running) {
            drive.outcome.kind = OutcomeKind::TimeLimit;
            drive.outcome.message = format!("the run ended after {max_steps} time steps");
        }
    }

    /// Lets agents enter that start at this time step, and notes which participants they touch.
    pub(super) fn enter(&mut self, time_step: i64) {
        let mut entered = Vec::new();
        for row in 0..self.states.len() {
            let Some(recorded) = self.recorded_row[row] else { continue };
            let is_first = time_step == self.first_time_step;
            if is_first {
                self.states[row] = self.recorded_state(recorded, time_step);
            }
            if self.states[row].is_some() && (is_first || !self.is_recorded(recorded, time_step - 1)) {
                entered.push(row);
            }
        }
        self.let_wait(time_step);
        for index in 0..self.drives.len() {
            let drive = &self.drives[index];
            if let Some(recorded) = drive.replayed.filter(|_| time_step < drive.agent.start_time_step) {
                let was_absent =
                    time_step == self.first_time_step || self.recorded_state(recorded, time_step - 1).is_none();
                let (row, state) = (drive.row, self.recorded_state(recorded, time_step));
                self.states[row] = state;
                if was_absent && state.is_some() {
                    entered.push(row);
                }
            }
        }
        for drive in &mut self.drives {
            if drive.agent.start_time_step == time_step
                && drive.outcome.kind == OutcomeKind::Running
                && drive.agent.queue.is_none()
            {
                self.states[drive.row] = Some(drive.agent.initial_state);
                drive.was_on_road = self.scenario.road.covers(&drive.agent.shape, drive.agent.initial_state.pose());
                entered.push(drive.row);
            }
        }
        self.enter_from_queues(time_step, &mut entered);
        for row in entered {
            self.note_contacts_of(row);
        }
    }

    /// Agents that are too near to stop for a light that has changed remember it.
    pub(super) fn look_at_lights(&mut self) {
        if self.scenario.control.lights.is_empty() {
            return;
        }
        for index in 0..self.drives.len() {
            self.look_at_lights_ahead_of(index);
        }
    }

    fn look_at_lights_ahead_of(&mut self, index: usize) {
        let drive = &self.drives[index];
        if let Some(state) = self.states[drive.row].filter(|_| drive.is_driving(self.time_step)) {
            let (way, front) = drive.way_below(&state, &self.scenario);
            let lines = drive.lines.looking(&self.lines(drive), way, front, state.velocity.max(0.0));
            self.drives[index].lines = lines;
        }
    }

    pub(super) fn note_contacts_of(&mut self, row: usize) {
        let participants = &self.participants;
        let pose = self.states[row].expect("entered").pose();
        for other in (0..self.states.len()).filter(|other| *other != row) {
            let Some(state) = self.states[other] else { continue };
            if (participants.is_agent[row] || participants.is_agent[other])
                && !participants.storeys.are_apart(pose, state.pose())
                && participants.shape[row].overlaps(pose, &participants.shape[other], state.pose())
            {
                self.entered_in_contact.insert((row.min(other), row.max(other)));
            }
        }
    }
}

impl Drive {
    /// Its state one step later by the plan that it follows.
    pub(super) fn next_state(&self, time_step: i64) -> Option<State> {
        let (plan, made) = self.plan.as_ref()?;
        let index = (time_step + 1 - made) as usize;
        Some(plan.points[index.min(plan.points.len() - 1)])
    }

    /// It is not yet time for a new plan, or it is inattentive, and the last one still has points to follow.
    pub(super) fn keeps_plan(&self, time_step: i64, replan_every: usize, dt: f64) -> bool {
        self.plan.as_ref().is_some_and(|(plan, made)| {
            let age = (time_step - made) as usize;
            let elapsed = (time_step - self.agent.start_time_step) as f64 * dt;
            (age < replan_every || self.agent.view.looks_away(elapsed)) && plan.points.len() > age + 1
        })
    }

    /// Updates how it stands from its state at a time step.
    fn arrive(&mut self, state: &State, time_step: i64, settings: &StepSettings, dt: f64) {
        self.outcome.time_step = time_step;
        self.follow_path(state, dt);
        self.lines = self.lines.after(state.velocity, dt);
        if let Some(kind) = self.judge(state, time_step, settings) {
            self.outcome.kind = kind;
        }
    }

    /// Updates where it is on the reference path.
    fn follow_path(&mut self, state: &State, dt: f64) {
        /// The foot is searched within this distance of the last one [m], or two steps.
        const WINDOW: f64 = 15.0;
        let rear_axle = self.agent.vehicle.rear_axle_from_center(state.pose());
        let path = &self.agent.route.path;
        let window = WINDOW.max(2.0 * state.velocity.abs() * dt);
        let foot = path.project_near(rear_axle, self.s, window).or_else(|| path.project(rear_axle));
        self.has_left_path = foot.is_none();
        self.s = foot.map_or(self.s, |(s, _)| s);
    }

    fn judge(&self, state: &State, time_step: i64, settings: &StepSettings) -> Option<OutcomeKind> {
        if self.outcome.kind != OutcomeKind::Running {
            return None;
        }
        let goal = &self.agent.goal;
        if goal.is_met(state, time_step) {
            return Some(OutcomeKind::GoalReached);
        }
        let is_late = goal.latest_time_step().is_some_and(|latest| time_step > latest);
        let late = |alternative: &GoalState| is_late && alternative.is_met_at_any_time(state);
        if goal.states.iter().any(late) {
            return Some(OutcomeKind::GoalReachedLate);
        }
        let center = self.s + self.agent.vehicle.rear_axle_to_center;
        let is_inside = || goal.states.iter().any(|alternative| alternative.contains(state));
        // NaN (a goal without position) compares false.
        let goal_exit = self.agent.route.goal_exit_s;
        if (center > goal_exit + MISSED_MARGIN || self.has_left_path && goal_exit.is_finite()) && !is_inside() {
            return Some(OutcomeKind::GoalMissed);
        }
        (self.last_time_step(settings).is_some_and(|last| time_step >= last)).then_some(OutcomeKind::TimeLimit)
    }
}

fn velocity_between(from: Option<&State>, to: Option<&State>, fraction: f64) -> Point {
    let (Some(from), Some(to)) = (from, to) else { return Point::default() };
    let vector = |state: &State| Point::from_angle(state.orientation) * state.velocity;
    vector(from).lerp(vector(to), fraction)
}
