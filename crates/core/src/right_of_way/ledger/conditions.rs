//! What an agent needs to enter besides gaps: room behind its passage, sight through a narrow street, and caution before
//! what it does not see.

use super::Ahead;
use super::gaps::{catching_up, slowed};
use super::windows::ROOM;
use super::{Ledger, Request};
use crate::conduct::{FIRM_DECELERATION, STANDSTILL_SPEED, STATIONARY_SPEED};
use crate::junctions::AreaKind;
use crate::right_of_way::traffic::{Body, OrderKind};
use crate::right_of_way::zones::{GAP, MARGIN, Passage, Zone};

/// Vehicles ahead brake so hard at most [m/s²]: they rarely stop where they have just begun to move.
const BRAKING: f64 = 0.5;
/// An agent that has stood this long because of what it does not see [s], at most this far before the entry line [m], goes,
/// and is not stopped until it is faster than this [m/s]. If it stands farther away, it goes later [s].
const PEEKED_TIME: f64 = 2.0;
const NEAR_DISTANCE: f64 = 1.0;
const STARTED_SPEED: f64 = 3.0;
const STOOD_FAR_AWAY: f64 = 6.0;

impl Ledger<'_> {
    /// Whether there is room for an agent behind a passage beside what is reserved [m], and the last body there. Each body
    /// ahead may come to rest, with all that are between, and so do those before a crosswalk that holds the agent.
    pub(super) fn has_room(&self, index: usize, passage: &Passage, reserved: f64) -> (bool, Option<usize>) {
        let traveller = &self.traffic.travellers[index];
        let mut needed = reserved + self.traffic.bodies[traveller.body].length + ROOM;
        let (mut fits, mut before_crosswalk, mut nearest) = (true, needed, None);
        for &Ahead { rear, body, .. } in self.ahead(index, passage.end) {
            let Body { length, velocity, .. } = self.traffic.bodies[body];
            nearest = nearest.or(Some(body));
            let braking = 0.5 * velocity.powi(2) / BRAKING;
            fits &= rear + braking - passage.end >= needed;
            needed += length + ROOM;
            if rear + length <= traveller.crosswalk {
                before_crosswalk = needed;
            }
        }
        fits &= traveller.crosswalk - passage.end >= before_crosswalk;
        (fits, nearest)
    }

    /// An agent sees all that could not stop at the other end of a narrow street any more. Where that is never so, it need
    /// not. One that stands further from the entry line than agents usually do may come nearer.
    pub(super) fn sees_through(&self, request: &Request<'_>) -> bool {
        let (traveller, passage) = (self.traveller(request), request.passage);
        let narrow = passage.zones.iter().filter(|zone| zone.is_narrow());
        let Some(end) = narrow.map(|zone| zone.exit + MARGIN).reduce(f64::max) else { return true };
        // From centre to centre: half of this vehicle and half of one like it.
        let reach = traveller.sight - self.traffic.bodies[traveller.body].length;
        let needed = 0.5 * passage.approach * passage.approach / FIRM_DECELERATION;
        let sees_from = |front: f64| reach - (end - front) >= needed;
        let stands = self.velocity(request) < STANDSTILL_SPEED;
        stands || sees_from(traveller.front) || !sees_from(passage.entry_line - GAP - MARGIN)
    }

    /// Not all windows of a request end long enough (`lead`, s) before a vehicle may come that goes first and is not seen.
    pub(super) fn may_meet_unseen(&self, request: &Request<'_>, lead: f64) -> bool {
        let (traveller, velocity) = (self.traveller(request), self.velocity(request));
        let stood = request.memory.peeking as f64 * self.traffic.dt;
        let is_near = request.passage.entry_line - traveller.front <= NEAR_DISTANCE;
        let goes_on = request.is_sticky && velocity < STARTED_SPEED;
        if is_near && (stood >= PEEKED_TIME || goes_on) || stood >= STOOD_FAR_AWAY {
            return false;
        }
        request.windows.iter().any(|mine| {
            let unseen = traveller.unseen.iter().find(|(area, _)| *area == mine.zone.area);
            let slower = slowed(traveller, mine.zone.area, velocity);
            let merges = mine.zone.kind == AreaKind::Merge;
            let losing = if merges { catching_up(slower, request.passage.approach) } else { 0.0 };
            unseen.is_some_and(|(_, time)| mine.leave + lead + losing > *time)
        })
    }

    /// Steps for which an agent has stood because of what it does not see, with its order of now.
    pub(super) fn peeking(&self, request: &Request<'_>, kind: OrderKind) -> usize {
        let before = request.memory.peeking;
        match kind {
            OrderKind::Unseen => before + usize::from(self.velocity(request) < STATIONARY_SPEED),
            _ if request.is_granted() => before,
            _ => 0,
        }
    }
}

impl Zone {
    /// Vehicles cannot meet in it.
    pub(super) fn is_narrow(&self) -> bool {
        self.kind == AreaKind::Opposed
    }
}
