//! Agents that enter at a time at which others may not have driven as recorded: they wait for room.

use std::sync::Arc;

use super::encounter::{Moving, leading, size};
use super::{Drive, World};
use crate::conduct::FIRM_DECELERATION;
use crate::geometry::shape::Shape;
use crate::recording::OutcomeKind;

/// Whoever is nearer ahead than this leads [m].
const LEADER_DISTANCE: f64 = 100.0;
/// Who enters keeps this far from others, ahead and behind, and at its sides [m], ...
const ROOM: (f64, f64) = (1.0, 0.3);
/// ... and enters beside nobody whom it would touch within this time [s], looked at so many times, if both went on along
/// the lane at their speed.
const GOING_ON: f64 = 1.0;
const LOOKS: u32 = 10;

impl World {
    /// Agents that would enter at this time step, but find no room, enter one time step later, and so does the time at
    /// which they are to be somewhere; or not at all once they have waited for too long. Those whose recording was
    /// replayed until now have their room, and whoever enters takes it from those that come after.
    pub(super) fn let_wait(&mut self, time_step: i64) {
        let most = self.settings.step.entry_wait;
        if most <= 0.0 || time_step == self.first_time_step {
            return;
        }
        for index in 0..self.drives.len() {
            let drive = &self.drives[index];
            let enters = drive.agent.start_time_step == time_step
                && drive.outcome.kind == OutcomeKind::Running
                && drive.agent.queue.is_none();
            let was_there = drive.replayed.is_some() && self.states[drive.row].is_some();
            if !enters {
                continue;
            }
            if was_there || self.has_room(index) {
                let drive = &self.drives[index];
                self.states[drive.row] = Some(drive.agent.initial_state);
                continue;
            }
            let waits = (drive.waited + 1) as f64 * self.scenario.dt <= most;
            let drive = &mut self.drives[index];
            if waits {
                drive.waited += 1;
                let agent = Arc::make_mut(&mut drive.agent);
                agent.start_time_step += 1;
                // An agent without a place to be at is done when the recording is over.
                for goal in agent.goal.states.iter_mut().filter(|goal| !goal.areas.is_empty()) {
                    goal.time_step = (goal.time_step.0 + 1, goal.time_step.1 + 1);
                }
            } else {
                drive.outcome.kind = OutcomeKind::TimeLimit;
                drive.outcome.time_step = time_step;
                drive.outcome.message = format!("found no room to enter within {most} s");
            }
        }
    }

    /// The agent touches no participant in its first state or right afterwards, and can follow the vehicle ahead.
    fn has_room(&self, index: usize) -> bool {
        let Drive { agent, row: own_row, s, .. } = &self.drives[index];
        let own = agent.initial_state;
        let (path, center) = (&agent.route.path, s + agent.vehicle.rear_axle_to_center);
        let pose = own.pose();
        let half = 0.5 * agent.vehicle.length;
        let room = Shape::rectangle(agent.vehicle.length + 2.0 * ROOM.0, agent.vehicle.width + 2.0 * ROOM.1);
        let ours = Moving::along(path, center, &own, &agent.shape);
        self.states.iter().enumerate().filter(|(row, _)| row != own_row).all(|(row, state)| {
            let Some(other) = state else { return true };
            let (shape, place) = (&self.participants.shape[row], other.pose());
            if self.participants.storeys.are_apart(pose, place) {
                return true;
            }
            let theirs = Moving::along(path, center, other, shape);
            if room.overlaps(pose, shape, place) || ours.touches(&theirs, GOING_ON, LOOKS) {
                return false;
            }
            let (length, width) = size(shape);
            let Some(distance) = leading(&own, other, agent.vehicle.width + width, LEADER_DISTANCE) else {
                return true;
            };
            let closing = own.velocity - other.velocity * (other.orientation - own.orientation).cos();
            let gap = distance - half - 0.5 * length;
            closing <= 0.0 || gap > 0.0 && closing * closing <= 2.0 * FIRM_DECELERATION * gap
        })
    }
}
