//! Which participants are stationary: one rule for every predictor that uses the past.

use super::PREDICTED_STANDING_SPEED;
use crate::scene::Scene;

/// Less than this is no motion [m].
const UNMOVED_DISTANCE: f64 = 0.1;
/// A participant that has not moved for this long [s] is stationary, whatever its stated speed.
const STATIONARY_TIME: f64 = 0.5;

/// How much of the past decides whether a participant stands [s].
const PAST_SPAN: f64 = 1.0;

/// Whether the participant in a row that is present stands: its positions say so for half a second, or all that is known
/// of it does and it is slow.
pub fn is_standing(scene: &Scene, row: usize) -> bool {
    Stillness::of(scene, row, PAST_SPAN).is_standing(scene.observed_velocity(row))
}

/// How long a participant's past is known without a gap, and how long it has not moved until now [s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stillness {
    pub(super) known: f64,
    pub(super) unmoved: f64,
}

impl Stillness {
    /// Of a row of the participants that has a finite state now; the past is examined `span` [s] far back.
    pub(super) fn of(scene: &Scene, row: usize, span: f64) -> Self {
        let here = scene.state(row).pose().position;
        let (mut known, mut unmoved, mut is_unmoved) = (0.0, 0.0, true);
        for steps in 1..=(span / scene.dt + 1e-9).floor() as i64 {
            let Some(state) = scene.past.get(row, scene.time_step - steps).filter(|s| s.is_finite()) else { break };
            known = steps as f64 * scene.dt;
            is_unmoved = is_unmoved && state.pose().position.distance(here) < UNMOVED_DISTANCE;
            if is_unmoved {
                unmoved = known;
            }
        }
        Self { known, unmoved }
    }

    /// It stands: its positions say so for half a second, or all that is known of it does and it is slow.
    pub(super) fn is_standing(&self, velocity: f64) -> bool {
        self.unmoved >= STATIONARY_TIME - 1e-9
            || (self.unmoved >= self.known && velocity.abs() < PREDICTED_STANDING_SPEED)
    }
}
