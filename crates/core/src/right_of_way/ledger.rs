//! The ledger of the use of conflict zones: requests and reservations, as one agent knows of them, and one order.
//!
//! Zones are used by one vehicle at a time. A vehicle that cannot stop before its passage any more, or does not obey, has
//! reserved it. The others ask in turn: those first that wait for none of the rest by the map, equals by their arrival, then
//! by id. An agent may enter if no other has reserved one of its zones meanwhile and there is room behind the passage.
//! Agents that see different things keep different ledgers. Docs: rules.md.

mod circles;
mod components;
mod conditions;
mod gaps;
mod groups;
mod queues;
mod windows;

use crate::barrier::Barrier;
use crate::conduct::{CRAWLING_SPEED, EXPECTED_DECELERATION, FIRM_DECELERATION};
use std::collections::BTreeMap;

use super::traffic::{Memory, Order, OrderKind, Reservation, Traffic, Traveller};
use super::zones::{GAP, MARGIN, PEEK, Passage, SIGN_LEAD, Zone, reach};
use components::components;
use windows::ROOM;

/// Tickets are taken at this distance beyond the braking distance [m].
const TICKET_REACH: f64 = 5.0;
/// An agent that was granted passage and is this near beyond the braking distance [m] keeps it, with gaps that are smaller by
/// this [s].
const STICKY_REACH: f64 = 10.0;
const STICKY_LEAD: f64 = 0.3;
const STICKY_LAG: f64 = 0.15;

/// Zones of a passage for which there is memory at first.
const ZONES_ABOUT: usize = 4;

/// A body on the path of a traveller, its rear not far behind that one's front.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ahead {
    /// Arc lengths of its front and its rear on the path [m].
    front: f64,
    rear: f64,
    /// Position in `Traffic::bodies`.
    body: usize,
}

/// An agent that asks for a passage.
struct Request<'a> {
    /// Position in `Traffic::travellers`.
    traveller: usize,
    passage: &'a Passage,
    /// What the agent remembers of the passage; its ticket may be of now.
    memory: Memory,
    /// Requests of agents ahead in its lane; `None`: a vehicle is ahead that asks for nothing.
    ahead: Option<Vec<usize>>,
    /// The next body ahead.
    leader: Option<usize>,
    is_sticky: bool,
    windows: Vec<Reservation>,
    /// Requests that leave the zones before it, although it could come earlier.
    follows: Vec<usize>,
    decision: Option<Decision>,
}

impl Request<'_> {
    fn is_granted(&self) -> bool {
        self.decision.as_ref().is_some_and(Decision::is_grant)
    }
}

/// Whether a request is granted; if not, why, because of which body, and for how long [s].
#[derive(Debug)]
struct Decision {
    kind: OrderKind,
    by: Option<usize>,
    delay: f64,
    /// Granted requests whose vehicles have to have left before it enters, although it could come earlier ...
    before: Vec<usize>,
    /// ... and those that are held back until it has left.
    after: Vec<usize>,
}

impl Decision {
    fn grant(before: Vec<usize>, after: Vec<usize>) -> Self {
        Self { before, after, ..Self::wait(OrderKind::Go, None, 0.0) }
    }

    fn wait(kind: OrderKind, by: Option<usize>, delay: f64) -> Self {
        Self { kind, by, delay, before: Vec::new(), after: Vec::new() }
    }

    /// For now it is not known for how long.
    fn wait_on(kind: OrderKind, by: Option<usize>) -> Self {
        Self::wait(kind, by, f64::INFINITY)
    }

    fn is_grant(&self) -> bool {
        self.kind == OrderKind::Go
    }
}

/// Requests and reservations, as an agent knows of them.
struct Ledger<'a> {
    traffic: &'a Traffic<'a>,
    /// Bodies of which it knows, ascending.
    known: &'a [usize],
    /// By traveller the bodies on its path, the nearest rear first.
    queues: &'a [Vec<Ahead>],
    requests: Vec<Request<'a>>,
    reservations: Vec<Reservation>,
    /// Room that is reserved behind passages that end on a lanelet [m].
    room: Vec<(usize, f64)>,
}

impl<'a> Ledger<'a> {
    /// Filled with what others have reserved that do not obey.
    fn new(traffic: &'a Traffic<'a>, known: &'a [usize], queues: &'a [Vec<Ahead>]) -> Self {
        let is_known = |visit: &&Reservation| known.binary_search(&visit.body).is_ok();
        let mut reservations = Vec::with_capacity(ZONES_ABOUT * known.len());
        reservations.extend(traffic.visits.iter().filter(is_known));
        let (requests, room) = (Vec::with_capacity(known.len()), Vec::with_capacity(known.len()));
        Self { traffic, known, queues, requests, reservations, room }
    }

    fn knows(&self, body: usize) -> bool {
        self.known.binary_search(&body).is_ok()
    }

    /// Bodies on the path of a traveller whose front is beyond an arc length [m], the nearest one first.
    fn ahead(&self, traveller: usize, beyond: f64) -> impl Iterator<Item = &'a Ahead> {
        self.queues[traveller].iter().filter(move |one| one.front > beyond && self.knows(one.body))
    }

    fn traveller(&self, request: &Request<'_>) -> &'a Traveller<'a> {
        &self.traffic.travellers[request.traveller]
    }

    fn body(&self, request: &Request<'_>) -> usize {
        self.traveller(request).body
    }

    fn velocity(&self, request: &Request<'_>) -> f64 {
        self.traffic.bodies[self.body(request)].velocity
    }

    /// Orders of a group of travellers; `None` for those that ask for nothing.
    fn decide(mut self, members: &[usize]) -> Vec<Option<Order>> {
        let mut orders: Vec<Option<Order>> = vec![None; members.len()];
        for (place, &index) in members.iter().enumerate() {
            if self.knows(self.traffic.travellers[index].body) {
                orders[place] = self.enter(index);
            }
        }
        self.line_up();
        for equals in self.in_turn() {
            self.hear(equals);
        }
        for (index, request) in self.requests.iter().enumerate() {
            let place = members.iter().position(|member| *member == request.traveller).expect("a member");
            orders[place] = Some(self.order(index));
        }
        orders
    }

    /// Enters a traveller: reserves the passages before which it cannot stop any more, and requests the next one. Its order
    /// if it has reserved one.
    fn enter(&mut self, index: usize) -> Option<Order> {
        let traffic = self.traffic;
        let traveller = &traffic.travellers[index];
        let body = &traffic.bodies[traveller.body];
        let first = traveller.course.first_passage(traveller.front - body.length);
        let mut order = None;
        for passage in &traveller.course.passages[first..] {
            // One that looks around a corner may come as near as the zone.
            let peeks = if traveller.unseen.is_empty() { 0.0 } else { MARGIN };
            let ahead = passage.entry_line + peeks - traveller.front;
            let memory = traveller.memory_of(passage.number);
            // One that must brake harder to stop before it has entered it.
            if body.velocity * body.velocity < 2.0 * FIRM_DECELERATION * ahead {
                let is_near = ahead <= reach(body.velocity);
                // Behind a line or a crosswalk that holds it there is time to ask.
                if is_near && traveller.line > passage.end && traveller.crosswalk > passage.entry_line {
                    self.request(index, passage, memory);
                }
                break;
            }
            let mut windows = self.windows(index, passage, false);
            if memory.exception.is_some() && !self.has_room(index, passage, 0.0).0 {
                windows.iter_mut().for_each(|window| window.leave = f64::INFINITY);
            }
            self.reservations.extend(windows);
            if traveller.front < passage.end {
                self.keep_room(passage, body.length);
            }
            let memory = Memory { granted: Some(true), has_entered: true, ..memory };
            order = Some(Order { id: body.id, kind: OrderKind::Go, barrier: None, memory });
        }
        order
    }

    fn request(&mut self, index: usize, passage: &'a Passage, memory: Memory) {
        let traveller = &self.traffic.travellers[index];
        let velocity = self.traffic.bodies[traveller.body].velocity;
        let to_wait = passage.entry_line - GAP - traveller.front;
        let braking = 0.5 * velocity * velocity / EXPECTED_DECELERATION;
        self.requests.push(Request {
            traveller: index,
            passage,
            memory,
            ahead: Some(Vec::new()),
            leader: None,
            is_sticky: memory.granted == Some(true) && to_wait <= braking + STICKY_REACH,
            windows: self.windows(index, passage, true),
            follows: Vec::new(),
            decision: None,
        });
    }

    /// When a traveller uses the zones of a passage.
    fn windows(&self, index: usize, passage: &Passage, is_request: bool) -> Vec<Reservation> {
        let traveller = &self.traffic.travellers[index];
        let leader = self.ahead(index, traveller.front).next();
        let leader = leader.map(|ahead| (ahead, self.traffic.bodies[ahead.body].velocity));
        traveller.windows(passage, &self.traffic.bodies[traveller.body], is_request, leader)
    }

    /// Finds the bodies ahead of each request in its lane, and gives tickets to the first ones.
    fn line_up(&mut self) {
        let mut requests = std::mem::take(&mut self.requests);
        let by_body: BTreeMap<usize, usize> =
            requests.iter().enumerate().map(|(k, request)| (self.body(request), k)).collect();
        for request in &mut requests {
            let traveller = self.traveller(request);
            let (mut ahead, mut is_blocked, mut nearest) = (Vec::new(), false, (f64::INFINITY, usize::MAX));
            // The entry line of one ahead that takes another way may be further on than the own one.
            let entry_line = request.passage.entry_line;
            for other in self.ahead(request.traveller, traveller.front).take_while(|other| other.rear <= entry_line) {
                match by_body.get(&other.body) {
                    Some(other) => ahead.push(*other),
                    None if traveller.asks_by_message => is_blocked = true,
                    None if other.front > entry_line => continue,
                    None => is_blocked |= self.traffic.bodies[other.body].velocity < CRAWLING_SPEED,
                }
                if (other.front, other.body) < nearest {
                    nearest = (other.front, other.body);
                    request.leader = Some(other.body);
                }
            }
            let velocity = self.velocity(request);
            let is_first = ahead.is_empty() && !is_blocked;
            let to_wait = request.passage.entry_line - GAP - traveller.front;
            if is_first && to_wait <= 0.5 * velocity * velocity / EXPECTED_DECELERATION + TICKET_REACH {
                request.memory.ticket = request.memory.ticket.or(Some(self.traffic.time_step));
            }
            request.ahead = (!is_blocked).then_some(ahead);
        }
        self.requests = requests;
    }

    /// The one order of all requests: by the map; of equals, and of those that wait for each other in a circle, first the
    /// ones that have been granted passage, then by arrival, then by id.
    fn in_turn(&self) -> Vec<Vec<usize>> {
        let waits = |request: &Request<'_>, other: &Request<'_>| {
            let (own, their) = (self.traveller(request), self.traveller(other));
            let meets = |zone: &Zone| {
                other.passage.zones.iter().any(|their| zone.meets(their)) && zone.conflicts(own.width + their.width)
            };
            let goes_first = |zone: &Zone| own.goes_first(Some(their), zone.first == Some(true));
            request.passage.zones.iter().any(|zone| !goes_first(zone) && meets(zone))
        };
        let edges = |(index, request): (usize, &Request<'_>)| {
            let ahead = request.ahead.as_deref().unwrap_or_default();
            let is_edge = |(other, their): &(usize, &Request<'_>)| {
                *other != index && (ahead.contains(other) || waits(request, their))
            };
            self.requests.iter().enumerate().filter(is_edge).map(|(other, _)| other).collect()
        };
        let edges: Vec<Vec<usize>> = self.requests.iter().enumerate().map(edges).collect();
        let mut found = components(&edges);
        for equals in &mut found {
            equals.sort_by_key(|index| {
                let request = &self.requests[*index];
                (!request.is_sticky, request.memory.arrival(), self.traffic.bodies[self.body(request)].id)
            });
        }
        found
    }

    /// Decides about requests that are equals by the map. Those that have to wait are heard again after the others, and
    /// reserve the time after them.
    fn hear(&mut self, mut equals: Vec<usize>) {
        equals.retain(|&index| {
            let decision = self.test(index);
            if decision.is_grant() {
                self.grant(index, decision);
                return false;
            }
            let next = self.next_turn(&self.requests[index], &decision);
            self.reservations.extend(next);
            true
        });
        for index in equals {
            let decision = self.test(index);
            if decision.is_grant() {
                self.grant(index, decision);
                continue;
            }
            if decision.delay.is_finite() {
                let later = self.requests[index].windows.iter().map(|window| window.moved(decision.delay));
                self.reservations.extend(later);
            }
            self.requests[index].decision = Some(decision);
        }
    }

    /// What an agent that has arrived at a narrow street, and has to wait for those inside, reserves before later ones follow
    /// them.
    fn next_turn(&self, request: &Request<'_>, decision: &Decision) -> Vec<Reservation> {
        if decision.kind != OrderKind::Yield || !decision.delay.is_finite() || request.memory.ticket.is_none() {
            return Vec::new();
        }
        let narrow = request.windows.iter().filter(|window| window.zone.is_narrow());
        narrow.map(|window| window.moved(decision.delay)).collect()
    }

    /// Reserves the windows of a request and room behind them; those that it leaves before follow it.
    fn grant(&mut self, index: usize, mut decision: Decision) {
        let (before, after) = (std::mem::take(&mut decision.before), std::mem::take(&mut decision.after));
        let request = &self.requests[index];
        let passage = request.passage;
        let stays = request.memory.exception.is_some() && !self.has_room(request.traveller, passage, 0.0).0;
        let leave = |window: &Reservation| if stays { f64::INFINITY } else { window.leave };
        self.reservations.extend(request.windows.iter().map(|window| Reservation { leave: leave(window), ..*window }));
        self.keep_room(passage, self.traffic.bodies[self.body(&self.requests[index])].length);
        let request = &mut self.requests[index];
        request.decision = Some(decision);
        request.follows.extend(before);
        after.into_iter().for_each(|other| self.requests[other].follows.push(index));
    }

    /// Keeps room for a vehicle of a length behind a passage [m].
    fn keep_room(&mut self, passage: &Passage, length: f64) {
        self.room.push((passage.exit, length + ROOM));
    }

    /// Whether a request can be granted now, and which others depend on it then.
    fn test(&self, index: usize) -> Decision {
        let request = &self.requests[index];
        let traveller = self.traveller(request);
        let settings = traveller.settings;
        if !request.ahead.as_ref().is_some_and(|ahead| ahead.iter().all(|other| self.requests[*other].is_granted())) {
            return Decision::wait_on(OrderKind::Queue, request.leader);
        }
        if settings.keep_clear && request.memory.exception.is_none() {
            let kept = self.room.iter().filter(|(exit, _)| *exit == request.passage.exit).map(|(_, length)| length);
            let (has_room, last) = self.has_room(request.traveller, request.passage, kept.sum());
            if !has_room {
                return Decision::wait_on(OrderKind::Exit, last);
            }
        }
        if !self.sees_through(request) {
            return Decision::wait_on(OrderKind::Yield, None);
        }
        let stood = traveller.memory.standing as f64 * self.traffic.dt;
        let patience = 1.0 - 0.5 * (stood / settings.impatience).min(1.0);
        let extra = if traveller.turns_on_red { SIGN_LEAD } else { request.passage.extra_lead };
        let mut lead = (settings.lead + extra) * patience;
        let mut lag = settings.lag;
        if request.is_sticky {
            (lead, lag) = (lead - STICKY_LEAD, lag - STICKY_LAG);
        }
        match self.fit(index, (lead, lag)) {
            grant if grant.is_grant() && self.may_meet_unseen(request, lead) => {
                Decision::wait_on(OrderKind::Unseen, None)
            }
            found => found,
        }
    }

    /// What an agent is told.
    fn order(&self, index: usize) -> Order {
        let request = &self.requests[index];
        let decision = request.decision.as_ref().expect("every request has been tested");
        let earliest_entry = if decision.is_grant() { self.earliest_entry(index) } else { None };
        let first = request.windows.first().map_or(0.0, |window| window.enter);
        let entry_line = request.passage.entry_line;
        let (kind, barrier) = match (decision.kind, earliest_entry) {
            (OrderKind::Go, None) => (OrderKind::Go, None),
            (OrderKind::Go, Some((until, by))) => (OrderKind::Follow, Some((entry_line, until, Some(by)))),
            (OrderKind::Unseen, _) => (OrderKind::Unseen, Some((entry_line + PEEK, f64::INFINITY, None))),
            (kind, _) => (kind, Some((entry_line, first + decision.delay, decision.by))),
        };
        let id = |body: usize| self.traffic.bodies[body].id;
        let of =
            |(s, until, by): (f64, f64, Option<usize>)| Barrier { s, until, reason: kind.reason(), by: by.map(id) };
        let (granted, peeking) = (Some(decision.is_grant()), self.peeking(request, kind));
        let memory = Memory { granted, has_entered: false, peeking, ..request.memory };
        Order { id: id(self.body(request)), kind, barrier: barrier.map(of), memory }
    }
}
