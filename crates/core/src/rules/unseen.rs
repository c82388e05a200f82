//! Caution before what an agent does not see: it creeps forward until it sees enough, and in the end it goes.

use super::claims::Claim;
use super::gaps::{catching_up, slowed};
use super::meeting::{Meeting, OrderKind};
use crate::conduct::STATIONARY_SPEED;
use crate::junctions::AreaKind;

/// One that has stood for so long because of what it does not see [s], at most this far before the mouth [m], goes, and
/// goes on until it is faster than this [m/s]. One that stands farther away goes later [s].
const STOOD: f64 = 2.0;
const NEAR: f64 = 1.0;
const STARTING: f64 = 3.0;
const STOOD_FAR_AWAY: f64 = 6.0;

impl Meeting<'_> {
    /// Not all windows of a claim end long enough (`lead`, s) before a vehicle may come that goes first and is not seen.
    pub(super) fn may_meet_unseen(&self, claim: &Claim<'_>, lead: f64) -> bool {
        let traveller = &self.travellers[claim.traveller];
        let velocity = self.bodies[claim.body].velocity;
        let stood = traveller.memory_of(claim.number).peeking as f64 * self.dt;
        let is_near = claim.passage.mouth - traveller.front <= NEAR;
        let goes_on = claim.is_sticky && velocity < STARTING;
        if is_near && (stood >= STOOD || goes_on) || stood >= STOOD_FAR_AWAY {
            return false;
        }
        claim.windows.iter().any(|mine| {
            let unseen = traveller.unseen.iter().find(|unseen| unseen.area == mine.area);
            let merges = self.junctions.areas[mine.area].kind == AreaKind::Merge;
            let slower = slowed(traveller, mine.area, velocity);
            let losing = if merges { catching_up(slower, claim.passage.approach) } else { 0.0 };
            unseen.is_some_and(|unseen| mine.leave + lead + losing > unseen.time)
        })
    }

    /// Steps for which an agent has stood because of what it does not see, with its order of now.
    pub(super) fn peeking(&self, claim: &Claim<'_>, kind: OrderKind) -> usize {
        let before = self.travellers[claim.traveller].memory_of(claim.number).peeking;
        match kind {
            OrderKind::Unseen => before + usize::from(self.bodies[claim.body].velocity < STATIONARY_SPEED),
            _ if claim.is_granted() => before,
            _ => 0,
        }
    }
}
