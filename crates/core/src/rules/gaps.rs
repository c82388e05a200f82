//! Gaps between reservations: whether the windows of a request fit in, and who has to leave before whom.

use super::course::{Passage, conflict};
use super::meeting::{Meeting, OrderKind, Reservation, Traveller, Yielding};
use super::requests::{Decision, Request, Reservations};
use super::room::ROOM;
use crate::junctions::AreaKind;

/// Vehicles that merge faster than this follow each other [m/s], entering the merge after this time [s] at least.
const FOLLOWING: f64 = 2.0;
const FOLLOWING_TIME: f64 = 1.0;
/// One that comes second to a merge brakes so gently for a slower one ahead [m/s²].
const CATCHING_UP: f64 = 2.0;
/// Width of vehicles that do not obey [m].
const CAR_WIDTH: f64 = 1.8;

/// Claims that use an area before and after another one only if they are held back.
#[derive(Debug, Default)]
pub(super) struct Links {
    /// The other one is held back until they have left.
    pub(super) before: Vec<usize>,
    /// They are held back until the other one has left.
    pub(super) after: Vec<usize>,
}

impl Meeting<'_> {
    /// Whether the windows of a request fit between the reservations of others, with time before (`lead`) and after those
    /// (`lag`) [s]. Granted requests that follow can be held back, unless they go first or that makes a circle.
    pub(super) fn fit(
        &self,
        requests: &[Request<'_>],
        index: usize,
        reservations: &Reservations,
        gaps: (f64, f64),
    ) -> (Decision, Links) {
        let links = self.links(requests, index, reservations, gaps.1);
        if !is_circular(requests, &links) {
            return (self.fit_with(requests, index, reservations, gaps, true), links);
        }
        (self.fit_with(requests, index, reservations, gaps, false), Links { after: Vec::new(), ..links })
    }

    fn fit_with(
        &self,
        requests: &[Request<'_>],
        index: usize,
        reservations: &Reservations,
        gaps: (f64, f64),
        holds_back: bool,
    ) -> Decision {
        let traveller = &self.travellers[requests[index].traveller];
        let mut decision = Decision::GO;
        for (mine, theirs) in pairs(&requests[index], reservations) {
            let as_expected =
                !self.other_goes_first(traveller, theirs) && (holds_back || granted(requests, theirs).is_none());
            let theirs = if as_expected { *theirs } else { theirs.at_the_earliest() };
            let delay = self.delay(traveller, mine, &theirs, gaps);
            if delay > decision.delay {
                decision = Decision { kind: OrderKind::Yield, by: Some(theirs.body), delay };
            }
        }
        decision
    }

    /// Another one goes first by precedence; no vehicle is held back for one that has to wait for it.
    fn other_goes_first(&self, traveller: &Traveller<'_>, reservation: &Reservation) -> bool {
        let first = self.junctions.areas[reservation.area].first;
        !traveller.goes_first(self.of_body(reservation.body), first != Some(reservation.side))
    }

    fn of_body(&self, body: usize) -> Option<&Traveller<'_>> {
        let place = self.travellers.binary_search_by_key(&body, |other| other.body).ok()?;
        Some(&self.travellers[place])
    }

    /// Granted requests that a request depends on if it fits in.
    fn links(&self, requests: &[Request<'_>], index: usize, reservations: &Reservations, lag: f64) -> Links {
        let traveller = &self.travellers[requests[index].traveller];
        let mut links = Links::default();
        for (mine, theirs) in pairs(&requests[index], reservations) {
            let Some(other) = granted(requests, theirs) else { continue };
            if theirs.enter <= mine.enter {
                if self.delay(traveller, &mine.at_the_earliest(), theirs, (0.0, lag)) > 0.0 {
                    links.before.push(other);
                }
            } else if !self.other_goes_first(traveller, theirs)
                && self.delay(traveller, mine, &theirs.at_the_earliest(), (lag, lag)) > 0.0
            {
                links.after.push(other);
            }
        }
        links
    }

    /// How much later an agent has to come because of a reservation [s].
    fn delay(
        &self,
        traveller: &Traveller<'_>,
        mine: &Reservation,
        theirs: &Reservation,
        (lead, lag): (f64, f64),
    ) -> f64 {
        let area = &self.junctions.areas[mine.area];
        let other = self.of_body(theirs.body);
        let width = other.map_or(CAR_WIDTH, |other| other.width);
        if area.kind == AreaKind::Opposed && !conflict(self.junctions, mine.area, traveller.width + width) {
            return 0.0;
        }
        let [velocity, their_velocity] = [mine, theirs].map(|reservation| self.bodies[reservation.body].velocity);
        let merges = area.kind == AreaKind::Merge;
        let lead =
            if merges { lead + catching_up(slowed(traveller, mine.area, velocity), their_velocity) } else { lead };
        if mine.leave + lead <= theirs.enter || mine.enter >= theirs.leave + lag {
            return 0.0;
        }
        if merges && velocity > FOLLOWING && their_velocity > FOLLOWING {
            let speed = other.map_or(their_velocity, |other| slowed(other, mine.area, their_velocity));
            let headway = FOLLOWING_TIME.max((self.bodies[theirs.body].length + ROOM) / speed);
            return (theirs.enter + headway - mine.enter).max(0.0);
        }
        theirs.leave + lag - mine.enter
    }

    /// When a granted request may pass its entry line, because those that go before it have left then [s], and the last of these.
    pub(super) fn earliest_entry(
        &self,
        requests: &[Request<'_>],
        index: usize,
        reservations: &Reservations,
    ) -> Option<(f64, usize)> {
        let request = &requests[index];
        let traveller = &self.travellers[request.traveller];
        let arrival = traveller.arrival(request.passage, &self.bodies[request.body]);
        let mut earliest_entry: Option<(f64, usize)> = None;
        for (mine, theirs) in pairs(request, reservations).filter(|(mine, theirs)| theirs.enter <= mine.enter) {
            if theirs.is_request && !request.follows.iter().any(|other| requests[*other].body == theirs.body) {
                continue;
            }
            let delay = self.delay(traveller, &mine.at_the_earliest(), theirs, (0.0, traveller.settings.lag));
            if delay > 0.0 && earliest_entry.is_none_or(|(release, _)| arrival + delay > release) {
                earliest_entry = Some((arrival + delay, theirs.body));
            }
        }
        earliest_entry
    }
}

/// The speed of a traveller [m/s], or that of its passage through an area if that is less.
pub(super) fn slowed(traveller: &Traveller<'_>, area: usize, velocity: f64) -> f64 {
    let leads_over = |passage: &&Passage| passage.areas.iter().any(|crossed| crossed.area == area);
    traveller.course.passages.iter().find(leads_over).map_or(velocity, |passage| velocity.min(passage.speed))
}

/// Time that a vehicle loses [s] by braking from its speed to that of a slower one ahead [m/s].
pub(super) fn catching_up(ahead: f64, velocity: f64) -> f64 {
    if velocity > ahead { 0.5 * (velocity - ahead).powi(2) / (CATCHING_UP * velocity) } else { 0.0 }
}

/// Windows of a request, and reservations of others on the other side of the same areas.
fn pairs<'a>(
    request: &'a Request<'_>,
    reservations: &'a Reservations,
) -> impl Iterator<Item = (&'a Reservation, &'a Reservation)> {
    let with_others = |mine: &'a Reservation| {
        let counts = |theirs: &&Reservation| theirs.side != mine.side && theirs.body != mine.body;
        let waits = |theirs: &Reservation| match theirs.yielding {
            Yielding::No => false,
            Yielding::IfTrusted => request.trusts && !request.turns_on_red,
            Yielding::Yes => !request.turns_on_red,
        };
        let others = reservations.of(mine.area).filter(counts).filter(move |theirs| !waits(theirs));
        others.map(move |theirs| (mine, theirs))
    };
    request.windows.iter().flat_map(with_others)
}

/// The granted request whose reservation it is.
fn granted(requests: &[Request<'_>], reservation: &Reservation) -> Option<usize> {
    let place = || requests.iter().position(|request| request.body == reservation.body && request.is_granted());
    if reservation.is_request { place() } else { None }
}

/// One that would be held back until a request has left would have to leave before it.
fn is_circular(requests: &[Request<'_>], links: &Links) -> bool {
    let mut reached = links.before.clone();
    let mut next = 0;
    while next < reached.len() {
        for &other in &requests[reached[next]].follows {
            if !reached.contains(&other) {
                reached.push(other);
            }
        }
        next += 1;
    }
    reached.iter().any(|request| links.after.contains(request))
}
