//! What an agent remembers of the lines ahead, whichever lane it drives in: how far away they were, not which they are.

use super::{Crossing, Rules, RulesSettings, STOP_REACH, Way};
use crate::conduct::STANDSTILL_SPEED;

/// An agent that has moved farther than this stands anew [m].
const SHIFT_MAX: f64 = 0.5;

/// What an agent remembers of the lines ahead.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LineMemory {
    /// Steps for which it has stood, now or the last time.
    stood: usize,
    /// Way since then [m]; negative if it has reversed.
    moved: f64,
    /// Distance to the line that it was too near to stop at when its light changed [m].
    passing: Option<f64>,
}

impl LineMemory {
    /// One time step later, at its speed then [m/s].
    #[must_use]
    pub fn after(self, velocity: f64, dt: f64) -> Self {
        let way = velocity * dt;
        let passing = self.passing.map(|distance| distance - way);
        if velocity.abs() <= STANDSTILL_SPEED {
            let stood = if self.moved.abs() > SHIFT_MAX { 0 } else { self.stood };
            return Self { stood: stood + 1, moved: 0.0, passing };
        }
        let moved = self.moved + way;
        Self { stood: if moved.abs() > STOP_REACH { 0 } else { self.stood }, moved, passing }
    }

    /// The same, having looked at the next light of a way under the rules of now. That the agent is too near is found when
    /// the light changes or the agent enters; later it may have become faster.
    #[must_use]
    pub fn looking(self, rules: &Rules, way: &Way, front: f64, velocity: f64) -> Self {
        let next = way.crossings.iter().find(|one| one.s > front && !one.lights.is_empty());
        let begins = |one: &Crossing| rules.time_step <= rules.entered || rules.may_pass(one, 1);
        let goes_on = |one: &&Crossing| {
            let is_lit = rules.settings.lights && !rules.may_pass(one, 0);
            let is_known = self.passing.is_some_and(|distance| is_near(one.s - front, distance));
            is_lit && (begins(one) || is_known) && !rules.holds(one, front, velocity)
        };
        Self { passing: next.filter(goes_on).map(|one| one.s - front), ..self }
    }

    /// Distance to the line that it was too near to stop at when its light changed [m].
    pub fn passing(self) -> Option<f64> {
        self.passing
    }

    /// Way since it stood long enough to pass a line after stopping [m].
    pub fn served(self, settings: &RulesSettings, dt: f64) -> Option<f64> {
        (self.stood > 0 && self.stood as f64 * dt >= settings.stop_duration).then_some(self.moved)
    }
}

/// Two distances may be to lines side by side, or to the same one along another lane [m].
pub(super) fn is_near(distance: f64, other: f64) -> bool {
    (distance - other).abs() <= STOP_REACH
}
