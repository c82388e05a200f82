//! Participants that something outside the simulation drives, such as a traffic simulator: it states at every step which
//! participants are there and how they move.

use std::sync::Arc;

use super::World;
use crate::error::{Error, Result};
use crate::geometry::shape::Shape;
use crate::recording::OutcomeKind;
use crate::trajectory::{PlanStatus, Plans, State};
use crate::vehicle::ParticipantKind;

/// What is driven from outside at one time step.
#[derive(Debug, Clone, Default)]
pub struct Outside {
    /// Participants that were never there before: id, kind and footprint. Ids ascend and are larger than all before.
    pub new: Vec<(i64, ParticipantKind, Shape)>,
    /// States of all that are there, by ascending id; those that are not listed have left.
    pub states: Vec<(i64, State)>,
    /// Ids of participants that jumped there: their contacts count where they are now, not on the way.
    pub jumped: Vec<i64>,
}

impl World {
    /// Adds participants that are driven from outside and are there at the first time step.
    ///
    /// # Errors
    /// `InvalidInput` after the first step, or for participants as in [`World::step_among`].
    pub fn place_outside(&mut self, outside: &Outside) -> Result<()> {
        if self.time_step != self.first_time_step {
            return Err(Error::invalid("participants from outside are placed before the first step"));
        }
        self.check_outside(outside)?;
        self.append_outside(outside);
        for (row, state) in self.outside_rows(outside) {
            self.states[row] = Some(state);
            self.note_contacts_of(row);
        }
        self.recording.replace_last(&self.states);
        Ok(())
    }

    /// States of all agents after a step with these plans, by ascending id; nothing changes. An agent that ends by its plan
    /// is not there.
    ///
    /// # Errors
    /// `WrongTimeStep`.
    pub fn next_of(&self, plans: &Plans) -> Result<Vec<(i64, State)>> {
        self.check_time_step("plans", plans.time_step)?;
        let next = |(row, id): (usize, &i64)| {
            let drive = &self.drives[self.drive_index(*id).ok()?];
            match self.adoption(drive, plans, row) {
                Ok(Some(_)) => Some((*id, plans.row_points(row)[1])),
                Ok(None) => drive.next_state(self.time_step).map(|state| (*id, state)),
                Err(_) => None,
            }
        };
        Ok(plans.ids.iter().enumerate().filter_map(next).collect())
    }

    /// # Errors
    /// `InvalidInput` naming the participant.
    pub(super) fn check_outside(&self, outside: &Outside) -> Result<()> {
        let mut last = self.participants.ids.last().copied().unwrap_or(i64::MIN);
        for (id, _, shape) in &outside.new {
            if *id <= last {
                return Err(Error::invalid(format!("participant {id} from outside needs an id above {last}")));
            }
            shape.check_numbers().map_err(|error| Error::invalid(format!("participant {id}: {error}")))?;
            last = *id;
        }
        if !outside.states.is_sorted_by(|(a, _), (b, _)| a < b) {
            return Err(Error::invalid("states from outside need unique, ascending ids"));
        }
        for (id, state) in &outside.states {
            let is_new = outside.new.binary_search_by_key(id, |new| new.0).is_ok();
            if !is_new && self.participants.ids[self.n_own..].binary_search(id).is_err() {
                return Err(Error::UnknownId { what: "participant from outside", id: *id });
            }
            if !state.is_possible() {
                return Err(Error::invalid(format!("participant {id}: its state from outside is not a number")));
            }
        }
        Ok(())
    }

    /// Adds rows for the new ones; earlier rows stay.
    pub(super) fn append_outside(&mut self, outside: &Outside) {
        // From now on, what stands may be moved from outside at any time.
        self.recording_end = i64::MAX;
        if outside.new.is_empty() {
            return;
        }
        let participants = Arc::make_mut(&mut self.participants);
        for (id, kind, shape) in &outside.new {
            participants.ids.push(*id);
            participants.kind.push(*kind);
            participants.shape.push(shape.clone());
            participants.is_static.push(false);
            participants.is_agent.push(false);
        }
        self.has_crosswalks = super::people::any_people(&self.participants)
            && self.drives.iter().any(|drive| !drive.way.crosswalks().is_empty());
        let n = self.participants.ids.len();
        self.states.resize(n, None);
        self.recorded_row.resize(n, None);
        self.recording.append_ids(outside.new.iter().map(|new| new.0));
    }

    /// Rows and states of the participants that are there, without those sent away after a contact.
    pub(super) fn outside_rows(&self, outside: &Outside) -> Vec<(usize, State)> {
        let row_of = |(id, state): &(i64, State)| {
            let row = self.participants.ids.binary_search(id).ok()?;
            (!self.sent_away.contains(&row)).then_some((row, *state))
        };
        outside.states.iter().filter_map(row_of).collect()
    }

    /// The first points of the plan of a row, if the agent adopts it; `None` if it goes on with the plan that it follows.
    ///
    /// # Errors
    /// How the agent ends by this plan.
    pub(super) fn adoption(
        &self,
        drive: &super::Drive,
        plans: &Plans,
        row: usize,
    ) -> std::result::Result<Option<usize>, (OutcomeKind, String)> {
        let points = plans.row_points(row);
        let length = points.iter().position(|point| !point.is_finite()).unwrap_or(points.len());
        match plans.status[row] {
            PlanStatus::Infeasible => return Err((OutcomeKind::Infeasible, plans.message[row].clone())),
            PlanStatus::Error => return Err((OutcomeKind::PlannerError, plans.message[row].clone())),
            PlanStatus::None => return Err((OutcomeKind::PlannerError, "the planner returned no plan".into())),
            PlanStatus::Planned | PlanStatus::EmergencyBraking => {}
        }
        if length < 2 {
            return Err((OutcomeKind::PlannerError, "the plan has values that are not numbers".into()));
        }
        if drive.keeps_plan(self.time_step, self.settings.step.replan_every, self.scenario.dt) {
            return Ok(None);
        }
        let now = self.states[drive.row].expect("a driving agent has a state");
        crate::plan::external_plan::check_plan(&points[..length], &now, &drive.agent.vehicle, self.scenario.dt)
            .map_err(|error| (OutcomeKind::PlannerError, error.to_string()))?;
        Ok(Some(length))
    }
}
