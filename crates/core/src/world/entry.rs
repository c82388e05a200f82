//! Agents that enter a world in which others have not driven as recorded: they wait for room.

use std::sync::Arc;

use super::World;
use crate::conduct::FIRM_DECELERATION;
use crate::geometry::wrap_angle;
use crate::recording::OutcomeKind;
use crate::trajectory::State;

/// A vehicle ahead leads if it is at most this far beside the way of the agent, of the sum of both widths, ...
const LEADER_WIDTHS: f64 = 0.4;
/// ... heads elsewhere by at most this [rad] ...
const LEADER_ANGLE: f64 = 0.6;
/// ... and is nearer than this [m].
const LEADER_DISTANCE: f64 = 100.0;

impl World {
    /// Agents that would enter at this time step, but find no room, enter one time step later, or not at all once they have
    /// waited for too long. Those whose recording was replayed until now have their room.
    pub(super) fn let_wait(&mut self, time_step: i64) {
        let most = self.settings.step.entry_wait;
        if most <= 0.0 || time_step == self.first_time_step {
            return;
        }
        for index in 0..self.drives.len() {
            let drive = &self.drives[index];
            let enters = drive.agent.start_time_step == time_step && drive.outcome.kind == OutcomeKind::Running;
            let was_there = drive.replayed.is_some() && self.states[drive.row].is_some();
            if !enters || was_there || self.has_room(index) {
                continue;
            }
            let waits = (drive.waited + 1) as f64 * self.scenario.dt <= most;
            let drive = &mut self.drives[index];
            if waits {
                drive.waited += 1;
                Arc::make_mut(&mut drive.agent).start_time_step += 1;
            } else {
                drive.outcome.kind = OutcomeKind::TimeLimit;
                drive.outcome.time_step = time_step;
                drive.outcome.message = format!("found no room to enter within {most} s");
            }
        }
    }

    /// The agent overlaps no participant in its first state, and can follow the vehicle ahead.
    fn has_room(&self, index: usize) -> bool {
        let agent = &self.drives[index].agent;
        let own = agent.initial_state;
        let pose = own.pose();
        let half = 0.5 * agent.vehicle.length;
        self.states.iter().enumerate().filter(|(row, _)| *row != self.drives[index].row).all(|(row, state)| {
            let Some(other) = state else { return true };
            let (shape, place) = (&self.participants.shape[row], other.pose());
            if self.participants.storeys.are_apart(pose, place) {
                return true;
            }
            if agent.shape.overlaps(pose, shape, place) {
                return false;
            }
            let extent = shape.aabb(crate::geometry::Pose::default());
            let (length, width) = (extent.max.x - extent.min.x, extent.max.y - extent.min.y);
            let Some(distance) = leading(&own, other, agent.vehicle.width + width) else { return true };
            let closing = own.velocity - other.velocity * (other.orientation - own.orientation).cos();
            let gap = distance - half - 0.5 * length;
            closing <= 0.0 || gap > 0.0 && closing * closing <= 2.0 * FIRM_DECELERATION * gap
        })
    }
}

/// How far a vehicle is ahead along the way of another one [m], if it leads; `widths` is the sum of both [m].
fn leading(own: &State, other: &State, widths: f64) -> Option<f64> {
    let (dx, dy) = (other.x - own.x, other.y - own.y);
    let (sin, cos) = own.orientation.sin_cos();
    let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
    let turn = wrap_angle(other.orientation - own.orientation);
    // On an arc the way bends aside by half the angle.
    let beside = (across - 0.5 * along * turn).abs();
    let leads = along > 0.0 && along < LEADER_DISTANCE && turn.abs() < LEADER_ANGLE && beside < LEADER_WIDTHS * widths;
    leads.then_some(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, orientation: f64) -> State {
        State { x, y, orientation, velocity: 10.0, ..State::default() }
    }

    #[test]
    fn a_vehicle_ahead_on_a_bend_leads_and_one_in_the_next_lane_does_not() {
        let angle: f64 = 40.0 / 200.0;
        let on_arc = at(200.0 * angle.sin(), 200.0 * (1.0 - angle.cos()), angle);
        assert!(leading(&at(0.0, 0.0, 0.0), &on_arc, 3.6).is_some());
        let beside = at((200.0 - 3.5) * angle.sin(), 200.0 - (200.0 - 3.5) * angle.cos(), angle);
        assert!(leading(&at(0.0, 0.0, 0.0), &beside, 3.6).is_none());
        assert!(leading(&at(0.0, 0.0, 0.0), &at(-10.0, 0.0, 0.0), 3.6).is_none());
    }
}
