//! Narrow streets, in which vehicles cannot meet: who looks through before entering, and who waits at the other end.

use super::arbitration::COMMITTED;
use super::course::{Crossed, GAP, MARGIN};
use super::meeting::{Meeting, OrderKind, Reservation};
use super::requests::{Decision, Request};
use crate::conduct::STANDSTILL_SPEED;
use crate::junctions::AreaKind;

impl Meeting<'_> {
    /// An agent sees all that could not stop at the other end any more. Where that is never so, it need not. One that stands
    /// further from the entry line than agents usually do may come nearer.
    pub(super) fn sees_through(&self, request: &Request<'_>) -> bool {
        let traveller = &self.travellers[request.traveller];
        let passage = request.passage;
        let narrow = passage.areas.iter().filter(|crossed| self.is_narrow(crossed));
        let Some(end) = narrow.map(|crossed| crossed.exit + MARGIN).reduce(f64::max) else { return true };
        // From centre to centre: half of this vehicle and half of one like it.
        let reach = traveller.sight - self.bodies[request.body].length;
        let needed = 0.5 * passage.approach * passage.approach / COMMITTED;
        let sees_from = |front: f64| reach - (end - front) >= needed;
        let stands = self.bodies[request.body].velocity < STANDSTILL_SPEED;
        stands || sees_from(traveller.front) || !sees_from(passage.entry_line - GAP - MARGIN)
    }

    /// What an agent that has arrived at a narrow street, and has to wait for those inside, reserves before later ones follow
    /// them.
    pub(super) fn next_turn(&self, request: &Request<'_>, decision: Decision) -> Vec<Reservation> {
        if decision.kind != OrderKind::Yield || !decision.delay.is_finite() || request.ticket.is_none() {
            return Vec::new();
        }
        let crossed = |area: usize| request.passage.areas.iter().find(|crossed| crossed.area == area);
        let is_narrow = |window: &&Reservation| crossed(window.area).is_some_and(|crossed| self.is_narrow(crossed));
        request.windows.iter().filter(is_narrow).map(|window| window.moved(decision.delay)).collect()
    }

    fn is_narrow(&self, crossed: &Crossed) -> bool {
        self.junctions.areas[crossed.area].kind == AreaKind::Opposed
    }
}
