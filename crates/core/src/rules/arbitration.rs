//! Entering a junction: one order for all that obey, from their states, the map, and what they remember.
//!
//! Areas are used by one vehicle at a time. A vehicle that cannot stop before its passage any more, or does not obey, has
//! reserved it. The others ask in turn: those first that wait for none of the rest by precedence, equals by their arrival. An
//! agent may enter if no other has reserved one of its areas meanwhile and there is room behind the passage. Docs: rules.md.
//! What all of this looks at is in `meeting`, when a vehicle is where in `windows`, what fits between reservations in `gaps`,
//! how circles of waits are broken in `circles`.

use crate::barrier::Barrier;
use crate::conduct::{COMFORTABLE_DECELERATION, CRAWLING_SPEED};
use std::collections::BTreeMap;

use super::components::components;
use super::course::{Crossed, GAP, MARGIN, PEEK, SIGN_LEAD, conflict, reach};
use super::gaps::Links;
use super::meeting::{Meeting, Memory, Order, OrderKind, Queues, Reservation, Seen};
use super::requests::{Decision, Request, Reservations};

/// A vehicle that must brake harder than this to stop before the passage has entered it [m/s²].
pub const COMMITTED: f64 = 4.0;
/// Tickets are taken at this distance beyond the braking distance [m], with this deceleration [m/s²].
const TICKET_REACH: f64 = 5.0;
const STICKY_REACH: f64 = 10.0;
/// An agent that was granted passage keeps it with gaps that are smaller by this [s].
pub(crate) const STICKY_LEAD: f64 = 0.3;
pub(crate) const STICKY_LAG: f64 = 0.15;

impl Meeting<'_> {
    /// The orders of all travellers that are near a passage, by ids. `sees` says whether the body at the first position
    /// sees that at the second one.
    pub fn orders(&self, sees: &dyn Fn(usize, usize) -> bool) -> Vec<Order> {
        let clusters = self.clusters();
        let mut is_wanted: Vec<bool> = self.travellers.iter().map(|traveller| self.is_stuck(traveller)).collect();
        clusters.iter().flatten().for_each(|member| is_wanted[*member] = true);
        let queues = self.queues(&is_wanted);
        let mut orders = Vec::new();
        for members in clusters {
            let concerned = self.concerned(&members, &queues);
            let mut known: Vec<(Vec<usize>, Vec<Option<Order>>)> = Vec::new();
            let mut bodies: Vec<usize> = Vec::with_capacity(concerned.len());
            for (place, &member) in members.iter().enumerate() {
                let viewer = self.travellers[member].body;
                let is_seen = |body: &usize| *body == viewer || sees(viewer, *body);
                bodies.clear();
                bodies.extend(concerned.iter().copied().filter(is_seen));
                // Agents that see the same bodies come to the same orders.
                let order = if let Some((_, found)) = known.iter().find(|(same, _)| *same == bodies) {
                    found[place]
                } else {
                    let found = self.arbitrate(&members, &Seen { bodies: &bodies, queues: &queues });
                    let order = found[place];
                    known.push((bodies.clone(), found));
                    order
                };
                orders.extend(order);
            }
        }
        orders.sort_by_key(|order| order.id);
        self.break_circles(&mut orders, &queues);
        orders
    }

    /// Bodies that may change the orders of a group of travellers.
    fn concerned(&self, members: &[usize], queues: &Queues) -> Vec<usize> {
        let own = members.iter().map(|index| self.travellers[*index].body);
        let ahead = members.iter().flat_map(|index| queues.of(*index).iter().map(|one| one.body));
        let passages = members.iter().flat_map(|index| &self.travellers[*index].course.passages);
        let mut crossed: Vec<usize> = passages.flat_map(|passage| passage.areas.iter().map(|one| one.area)).collect();
        crossed.sort_unstable();
        let is_crossed = |area: usize| crossed.binary_search(&area).is_ok();
        let visiting = self.visits.iter().filter(|visit| is_crossed(visit.area)).map(|visit| visit.body);
        let mut is_concerned = vec![false; self.bodies.len()];
        own.chain(ahead).chain(visiting).for_each(|body| is_concerned[body] = true);
        (0..self.bodies.len()).filter(|body| is_concerned[*body]).collect()
    }

    /// Travellers near a passage, in groups whose passages belong to the same junctions.
    fn clusters(&self) -> Vec<Vec<usize>> {
        let mut clusters: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for (index, traveller) in self.travellers.iter().enumerate() {
            let body = &self.bodies[traveller.body];
            let reach = reach(body.velocity);
            let passages = &traveller.course.passages[traveller.first_passage(body.length)..];
            let near = passages.iter().take_while(|passage| passage.entry_line - traveller.front <= reach);
            let mut numbers: Vec<usize> = near.flat_map(|passage| passage.junctions.iter().copied()).collect();
            if numbers.is_empty() {
                continue;
            }
            let mut members = vec![index];
            clusters.retain_mut(|(others, theirs)| {
                let is_apart = !theirs.iter().any(|number| numbers.contains(number));
                if !is_apart {
                    members.append(others);
                    numbers.append(theirs);
                }
                is_apart
            });
            members.sort_unstable();
            clusters.push((members, numbers));
        }
        clusters.into_iter().map(|(members, _)| members).collect()
    }

    /// Orders of a group of travellers, as seen by an agent that sees these bodies; `None` for those that are asked nothing.
    fn arbitrate(&self, members: &[usize], seen: &Seen<'_>) -> Vec<Option<Order>> {
        let mut reservations = Reservations::default();
        let mut requests: Vec<Request<'_>> = Vec::new();
        reservations.add(self.visits.iter().filter(|visit| seen.has(visit.body)).copied());
        let mut orders: Vec<Option<Order>> = vec![None; members.len()];
        let present = || members.iter().enumerate().filter(|(_, index)| seen.has(self.travellers[**index].body));
        for (place, &index) in present() {
            let traveller = &self.travellers[index];
            let body = &self.bodies[traveller.body];
            let first = traveller.first_passage(body.length);
            for (number, passage) in traveller.course.passages.iter().enumerate().skip(first) {
                // One that looks around a corner may come as near as the area.
                let peeks = if traveller.unseen.is_empty() { 0.0 } else { MARGIN };
                let ahead = passage.entry_line + peeks - traveller.front;
                if body.velocity * body.velocity < 2.0 * COMMITTED * ahead {
                    let is_near = ahead <= reach(body.velocity);
                    // Behind a line or a crosswalk that holds it there is time to ask.
                    if is_near && traveller.line > passage.end && traveller.crosswalk > passage.entry_line {
                        requests.push(self.request(index, number, seen));
                    }
                    break;
                }
                let memory = traveller.memory_of(number);
                let mut windows = self.windows(index, passage, false, seen);
                if memory.exception.is_some() && !self.has_room(index, passage, 0.0, seen).0 {
                    windows.iter_mut().for_each(|window| window.leave = f64::INFINITY);
                }
                reservations.add(windows);
                if traveller.front < passage.end {
                    reservations.reserve(passage, body.length);
                }
                orders[place] = Some(Order {
                    id: body.id,
                    kind: OrderKind::Go,
                    barrier: None,
                    memory: Memory { granted: true, ..memory },
                });
            }
        }
        self.line_up(&mut requests, seen);
        let edges = self.edges(&requests);
        for mut component in components(&edges) {
            component.sort_by_key(|index| {
                let request = &requests[*index];
                let id = self.bodies[request.body].id;
                (!request.is_sticky, request.ticket.unwrap_or(i64::MAX), id)
            });
            component.retain(|&index| {
                let (decision, links) = self.test(&requests, index, &reservations, seen);
                let is_granted = decision == Decision::GO;
                if is_granted {
                    self.grant(&mut requests, index, links, &mut reservations, seen);
                } else {
                    reservations.add(self.next_turn(&requests[index], decision));
                }
                !is_granted
            });
            for index in component {
                match self.test(&requests, index, &reservations, seen) {
                    (Decision::GO, links) => self.grant(&mut requests, index, links, &mut reservations, seen),
                    (decision, _) => {
                        if decision.delay.is_finite() {
                            reservations.add(requests[index].windows.iter().map(|window| window.moved(decision.delay)));
                        }
                        requests[index].decision = Some(decision);
                    }
                }
            }
        }
        for (index, request) in requests.iter().enumerate() {
            let place = members.iter().position(|member| *member == request.traveller).expect("a member");
            orders[place] = Some(self.order(&requests, index, &reservations));
        }
        orders
    }

    /// Books the windows of a request and room behind them; those that it leaves before follow it.
    fn grant(
        &self,
        requests: &mut [Request<'_>],
        index: usize,
        links: Links,
        reservations: &mut Reservations,
        seen: &Seen<'_>,
    ) {
        let request = &mut requests[index];
        let stays = request.has_exception && !self.has_room(request.traveller, request.passage, 0.0, seen).0;
        let leave = |window: &Reservation| if stays { f64::INFINITY } else { window.leave };
        reservations.add(request.windows.iter().map(|window| Reservation { leave: leave(window), ..*window }));
        reservations.reserve(request.passage, self.bodies[request.body].length);
        request.decision = Some(Decision::GO);
        request.follows.extend(links.before);
        links.after.into_iter().for_each(|other| requests[other].follows.push(index));
    }

    fn request(&self, index: usize, number: usize, seen: &Seen<'_>) -> Request<'_> {
        let traveller = &self.travellers[index];
        let body = &self.bodies[traveller.body];
        let passage = &traveller.course.passages[number];
        let memory = traveller.memory_of(number);
        let to_wait = passage.entry_line - GAP - traveller.front;
        let braking = 0.5 * body.velocity * body.velocity / COMFORTABLE_DECELERATION;
        Request {
            traveller: index,
            body: traveller.body,
            passage,
            number,
            ahead: Some(Vec::new()),
            leader: None,
            ticket: memory.ticket,
            has_exception: memory.exception.is_some(),
            turns_on_red: traveller.turns_on_red,
            trusts: traveller.settings.trust_others,
            is_sticky: memory.granted && to_wait <= braking + STICKY_REACH,
            windows: self.windows(index, passage, true, seen),
            follows: Vec::new(),
            decision: None,
        }
    }

    /// Finds the bodies ahead of each request in its lane, and gives tickets to the first ones.
    fn line_up(&self, requests: &mut [Request<'_>], seen: &Seen<'_>) {
        let by_body: BTreeMap<usize, usize> =
            requests.iter().enumerate().map(|(k, request)| (request.body, k)).collect();
        for request in requests.iter_mut() {
            let traveller = &self.travellers[request.traveller];
            let (mut ahead, mut is_blocked, mut nearest) = (Vec::new(), false, (f64::INFINITY, usize::MAX));
            // The entry line of one ahead that takes another way may be further on than the own one.
            let entry_line = request.passage.entry_line;
            for other in seen.ahead(request.traveller, traveller.front).take_while(|other| other.rear <= entry_line) {
                match by_body.get(&other.body) {
                    Some(other) => ahead.push(*other),
                    None if other.front > entry_line => continue,
                    None => is_blocked |= self.bodies[other.body].velocity < CRAWLING_SPEED,
                }
                if (other.front, other.body) < nearest {
                    nearest = (other.front, other.body);
                    request.leader = Some(other.body);
                }
            }
            let velocity = self.bodies[traveller.body].velocity;
            let is_first = ahead.is_empty() && !is_blocked;
            let to_wait = request.passage.entry_line - GAP - traveller.front;
            if is_first && to_wait <= 0.5 * velocity * velocity / COMFORTABLE_DECELERATION + TICKET_REACH {
                request.ticket = request.ticket.or(Some(self.time_step));
            }
            request.ahead = (!is_blocked).then_some(ahead);
        }
    }

    /// For every request those that it waits for by precedence, and the last one ahead in its lane.
    fn edges(&self, requests: &[Request<'_>]) -> Vec<Vec<usize>> {
        let waits = |request: &Request<'_>, other: &Request<'_>| {
            let own = &self.travellers[request.traveller];
            let widths = own.width + self.travellers[other.traveller].width;
            request.passage.areas.iter().any(|crossed| {
                let first = self.junctions.areas[crossed.area].first;
                let goes_first = own.goes_first(Some(&self.travellers[other.traveller]), first == Some(crossed.side));
                let meets = |their: &Crossed| their.area == crossed.area && their.side != crossed.side;
                !goes_first && other.passage.areas.iter().any(meets) && conflict(self.junctions, crossed.area, widths)
            })
        };
        let of = |(index, request): (usize, &Request<'_>)| {
            let ahead = request.ahead.as_deref().unwrap_or_default();
            let others = requests.iter().enumerate();
            let is_edge = |(other, their): &(usize, &Request<'_>)| {
                *other != index && (ahead.contains(other) || waits(request, their))
            };
            others.filter(is_edge).map(|(other, _)| other).collect()
        };
        requests.iter().enumerate().map(of).collect()
    }

    /// Whether a request can be granted now, and which others depend on it then.
    fn test(
        &self,
        requests: &[Request<'_>],
        index: usize,
        reservations: &Reservations,
        seen: &Seen<'_>,
    ) -> (Decision, Links) {
        let request = &requests[index];
        let traveller = &self.travellers[request.traveller];
        let settings = traveller.settings;
        if !request.ahead.as_ref().is_some_and(|ahead| ahead.iter().all(|other| requests[*other].is_granted())) {
            return (Decision::wait(OrderKind::Queue, request.leader), Links::default());
        }
        if settings.keep_clear && !request.has_exception {
            let (has_room, last) =
                self.has_room(request.traveller, request.passage, reservations.reserved(request.passage), seen);
            if !has_room {
                return (Decision::wait(OrderKind::Exit, last), Links::default());
            }
        }
        if !self.sees_through(request) {
            return (Decision::wait(OrderKind::Yield, None), Links::default());
        }
        let stood = traveller.memory.standing as f64 * self.dt;
        let patience = 1.0 - 0.5 * (stood / settings.impatience).min(1.0);
        let extra = if traveller.turns_on_red { SIGN_LEAD } else { request.passage.extra_lead };
        let mut lead = (settings.lead + extra) * patience;
        let mut lag = settings.lag;
        if request.is_sticky {
            (lead, lag) = (lead - STICKY_LEAD, lag - STICKY_LAG);
        }
        match self.fit(requests, index, reservations, (lead, lag)) {
            (Decision::GO, _) if self.may_meet_unseen(request, lead) => {
                (Decision::wait(OrderKind::Unseen, None), Links::default())
            }
            found => found,
        }
    }

    fn order(&self, requests: &[Request<'_>], index: usize, reservations: &Reservations) -> Order {
        let request = &requests[index];
        let traveller = &self.travellers[request.traveller];
        let decision = request.decision.expect("every request has been tested");
        let earliest_entry =
            if request.is_granted() { self.earliest_entry(requests, index, reservations) } else { None };
        let first = request.windows.first().map_or(0.0, |window| window.enter);
        let entry_line = request.passage.entry_line;
        let (kind, barrier) = match (decision, earliest_entry) {
            (Decision::GO, None) => (OrderKind::Go, None),
            (Decision::GO, Some((until, by))) => (OrderKind::Follow, Some((entry_line, until, Some(by)))),
            (Decision { kind: OrderKind::Unseen, .. }, _) => {
                (OrderKind::Unseen, Some((entry_line + PEEK, f64::INFINITY, None)))
            }
            (Decision { kind, by, delay }, _) => (kind, Some((entry_line, first + delay, by))),
        };
        let of = |(s, until, by): (f64, f64, Option<usize>)| Barrier {
            s,
            until,
            reason: kind.reason(),
            by: by.map(|body| self.bodies[body].id),
        };
        Order {
            id: self.bodies[request.body].id,
            kind,
            barrier: barrier.map(of),
            memory: Memory {
                ticket: request.ticket,
                granted: request.is_granted(),
                peeking: self.peeking(request, kind),
                ..traveller.memory_of(request.number)
            },
        }
    }
}
