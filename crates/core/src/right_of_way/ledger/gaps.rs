//! Gaps between reservations: whether the windows of a request fit in, and which vehicle has to leave before which.

use super::windows::ROOM;
use super::{Decision, Ledger, Request};
use crate::junctions::AreaKind;
use crate::right_of_way::traffic::{OrderKind, Reservation, Traveller, Yielding};
use crate::right_of_way::zones::{DESIGN_WIDTH, Passage, Zone};

/// Vehicles that merge faster than this follow each other [m/s], entering the merge after this time [s] at least.
const FOLLOWING: f64 = 2.0;
const FOLLOWING_TIME: f64 = 1.0;
/// One that comes second to a merge brakes so gently for a slower one ahead [m/s²].
const CATCHING_UP: f64 = 2.0;

impl Ledger<'_> {
    /// Whether the windows of a request fit between the reservations of others, with time before (`lead`) and after those
    /// (`lag`) [s]. Granted requests that follow can be held back, unless they go first or that makes a circle.
    pub(super) fn fit(&self, index: usize, gaps: (f64, f64)) -> Decision {
        let (before, after) = self.links(index, gaps.1);
        let holds_back = !self.is_circular(&before, &after);
        let traveller = self.traveller(&self.requests[index]);
        let mut decision = Decision::grant(before, if holds_back { after } else { Vec::new() });
        let mut longest = 0.0;
        for (mine, theirs) in self.pairs(&self.requests[index]) {
            let as_expected =
                !self.other_goes_first(traveller, theirs) && (holds_back || self.granted(theirs).is_none());
            let theirs = if as_expected { *theirs } else { theirs.at_the_earliest() };
            let delay = self.delay(traveller, mine, &theirs, gaps);
            if delay > longest {
                longest = delay;
                decision = Decision::wait(OrderKind::Yield, Some(theirs.body), delay);
            }
        }
        decision
    }

    /// Another one goes first by the map; no vehicle is held back for one that has to wait for it.
    fn other_goes_first(&self, traveller: &Traveller<'_>, theirs: &Reservation) -> bool {
        !traveller.goes_first(self.traffic.of_body(theirs.body), theirs.zone.first != Some(true))
    }

    /// Granted requests that a request depends on if it fits in: those that use a zone before it only if it is held back, and
    /// those that are held back until it has left.
    fn links(&self, index: usize, lag: f64) -> (Vec<usize>, Vec<usize>) {
        let traveller = self.traveller(&self.requests[index]);
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (mine, theirs) in self.pairs(&self.requests[index]) {
            let Some(other) = self.granted(theirs) else { continue };
            if theirs.enter <= mine.enter {
                if self.delay(traveller, &mine.at_the_earliest(), theirs, (0.0, lag)) > 0.0 {
                    before.push(other);
                }
            } else if !self.other_goes_first(traveller, theirs)
                && self.delay(traveller, mine, &theirs.at_the_earliest(), (lag, lag)) > 0.0
            {
                after.push(other);
            }
        }
        (before, after)
    }

    /// How much later an agent has to come because of a reservation [s].
    fn delay(
        &self,
        traveller: &Traveller<'_>,
        mine: &Reservation,
        theirs: &Reservation,
        (lead, lag): (f64, f64),
    ) -> f64 {
        let other = self.traffic.of_body(theirs.body);
        let Zone { area, kind, .. } = mine.zone;
        if !mine.zone.conflicts(traveller.width + other.map_or(DESIGN_WIDTH, |other| other.width)) {
            return 0.0;
        }
        let [velocity, their_velocity] = [mine, theirs].map(|one| self.traffic.bodies[one.body].velocity);
        let merges = kind == AreaKind::Merge;
        let lead = if merges { lead + catching_up(slowed(traveller, area, velocity), their_velocity) } else { lead };
        if mine.leave + lead <= theirs.enter || mine.enter >= theirs.leave + lag {
            return 0.0;
        }
        if merges && velocity > FOLLOWING && their_velocity > FOLLOWING {
            let speed = other.map_or(their_velocity, |other| slowed(other, area, their_velocity));
            let headway = FOLLOWING_TIME.max((self.traffic.bodies[theirs.body].length + ROOM) / speed);
            return (theirs.enter + headway - mine.enter).max(0.0);
        }
        theirs.leave + lag - mine.enter
    }

    /// When a granted request may pass its entry line, because those that go before it have left then [s], and the last of
    /// these.
    pub(super) fn earliest_entry(&self, index: usize) -> Option<(f64, usize)> {
        let request = &self.requests[index];
        let traveller = self.traveller(request);
        let arrival = traveller.arrival(request.passage, &self.traffic.bodies[traveller.body]);
        let mut earliest_entry: Option<(f64, usize)> = None;
        for (mine, theirs) in self.pairs(request).filter(|(mine, theirs)| theirs.enter <= mine.enter) {
            let is_followed = |other: &usize| self.body(&self.requests[*other]) == theirs.body;
            if theirs.is_request && !request.follows.iter().any(is_followed) {
                continue;
            }
            let delay = self.delay(traveller, &mine.at_the_earliest(), theirs, (0.0, traveller.settings.lag));
            if delay > 0.0 && earliest_entry.is_none_or(|(release, _)| arrival + delay > release) {
                earliest_entry = Some((arrival + delay, theirs.body));
            }
        }
        earliest_entry
    }

    /// Windows of a request, and reservations of others on the other side of the same zones.
    fn pairs<'b>(&'b self, request: &'b Request<'_>) -> impl Iterator<Item = (&'b Reservation, &'b Reservation)> {
        let &Traveller { turns_on_red, settings, .. } = self.traveller(request);
        let counts = move |theirs: &Reservation| match theirs.yielding {
            Yielding::No => true,
            Yielding::IfTrusted => turns_on_red || !settings.trust_others,
            Yielding::Yes => turns_on_red,
        };
        let with_others = move |mine: &'b Reservation| {
            let is_other = |theirs: &Reservation| theirs.zone.side != mine.zone.side && theirs.body != mine.body;
            let meets =
                move |theirs: &&Reservation| theirs.zone.area == mine.zone.area && is_other(theirs) && counts(theirs);
            self.reservations.iter().filter(meets).map(move |theirs| (mine, theirs))
        };
        request.windows.iter().flat_map(with_others)
    }

    /// The granted request whose reservation it is.
    fn granted(&self, theirs: &Reservation) -> Option<usize> {
        let is_its = |request: &Request<'_>| self.body(request) == theirs.body && request.is_granted();
        if theirs.is_request { self.requests.iter().position(is_its) } else { None }
    }

    /// One that would be held back until a request has left would have to leave before it.
    fn is_circular(&self, before: &[usize], after: &[usize]) -> bool {
        let mut reached = before.to_vec();
        let mut next = 0;
        while next < reached.len() {
            for &other in &self.requests[reached[next]].follows {
                if !reached.contains(&other) {
                    reached.push(other);
                }
            }
            next += 1;
        }
        reached.iter().any(|request| after.contains(request))
    }
}

/// The speed of a traveller [m/s], or that of its passage through an area if that is less.
pub(super) fn slowed(traveller: &Traveller<'_>, area: usize, velocity: f64) -> f64 {
    let leads_over = |passage: &&Passage| passage.zones.iter().any(|zone| zone.area == area);
    traveller.course.passages.iter().find(leads_over).map_or(velocity, |passage| velocity.min(passage.speed))
}

/// Time that a vehicle loses [s] by braking from its speed to that of a slower one ahead [m/s].
pub(super) fn catching_up(ahead: f64, velocity: f64) -> f64 {
    if velocity > ahead { 0.5 * (velocity - ahead).powi(2) / (CATCHING_UP * velocity) } else { 0.0 }
}
