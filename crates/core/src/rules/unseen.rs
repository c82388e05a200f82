//! Caution before what an agent does not see: it creeps forward until it sees enough, and in the end it goes.

use super::arbitration::GAP;
use super::claims::Claim;
use super::gaps::{catching_up, slowed};
use super::meeting::Meeting;
use crate::junctions::AreaKind;

/// To see more, an agent comes nearer by this than it otherwise would [m].
pub(super) const PEEK: f64 = GAP - 0.1;
/// One that has stood there for so long [s], at most this far before the mouth [m], goes, and goes on until it is faster
/// than this [m/s].
const STOOD: f64 = 2.0;
const NEAR: f64 = 1.0;
const STARTING: f64 = 3.0;

impl Meeting<'_> {
    /// Not all windows of a claim end long enough (`lead`, s) before a vehicle may come that goes first and is not seen.
    pub(super) fn may_meet_unseen(&self, claim: &Claim<'_>, lead: f64) -> bool {
        let traveller = &self.travellers[claim.traveller];
        let velocity = self.bodies[claim.body].velocity;
        let has_stood = traveller.memory.standing as f64 * self.dt >= STOOD;
        let goes_on = claim.is_sticky && velocity < STARTING;
        if (has_stood || goes_on) && claim.passage.mouth - traveller.front <= NEAR {
            return false;
        }
        claim.windows.iter().any(|mine| {
            let unseen = traveller.unseen.iter().find(|unseen| unseen.area == mine.area);
            let merges = self.junctions.areas[mine.area].kind == AreaKind::Merge;
            let losing =
                if merges { catching_up(slowed(traveller, mine.area, velocity), claim.passage.approach) } else { 0.0 };
            unseen.is_some_and(|unseen| mine.leave + lead + losing > unseen.time)
        })
    }
}
