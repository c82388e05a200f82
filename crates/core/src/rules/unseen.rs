//! Caution before what an agent does not see: it creeps forward until it sees enough, and in the end it goes.

use super::gaps::{catching_up, slowed};
use super::meeting::{Meeting, OrderKind};
use super::requests::Request;
use crate::conduct::STATIONARY_SPEED;
use crate::junctions::AreaKind;

/// An agent that has stood this long because of what it does not see [s], at most this far before the entry line [m], goes,
/// and is not stopped until it is faster than this [m/s]. If it stands farther away, it goes later [s].
const PEEKED_TIME: f64 = 2.0;
const NEAR_DISTANCE: f64 = 1.0;
const STARTED_SPEED: f64 = 3.0;
const STOOD_FAR_AWAY: f64 = 6.0;

impl Meeting<'_> {
    /// Not all windows of a request end long enough (`lead`, s) before a vehicle may come that goes first and is not seen.
    pub(super) fn may_meet_unseen(&self, request: &Request<'_>, lead: f64) -> bool {
        let traveller = &self.travellers[request.traveller];
        let velocity = self.bodies[request.body].velocity;
        let stood = traveller.memory_of(request.number).peeking as f64 * self.dt;
        let is_near = request.passage.entry_line - traveller.front <= NEAR_DISTANCE;
        let goes_on = request.is_sticky && velocity < STARTED_SPEED;
        if is_near && (stood >= PEEKED_TIME || goes_on) || stood >= STOOD_FAR_AWAY {
            return false;
        }
        request.windows.iter().any(|mine| {
            let unseen = traveller.unseen.iter().find(|unseen| unseen.area == mine.area);
            let merges = self.junctions.areas[mine.area].kind == AreaKind::Merge;
            let slower = slowed(traveller, mine.area, velocity);
            let losing = if merges { catching_up(slower, request.passage.approach) } else { 0.0 };
            unseen.is_some_and(|unseen| mine.leave + lead + losing > unseen.time)
        })
    }

    /// Steps for which an agent has stood because of what it does not see, with its order of now.
    pub(super) fn peeking(&self, request: &Request<'_>, kind: OrderKind) -> usize {
        let before = self.travellers[request.traveller].memory_of(request.number).peeking;
        match kind {
            OrderKind::Unseen => before + usize::from(self.bodies[request.body].velocity < STATIONARY_SPEED),
            _ if request.is_granted() => before,
            _ => 0,
        }
    }
}
