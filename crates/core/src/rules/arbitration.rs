//! Entering a junction: one order for all that obey, from their states, the map, and what they remember.
//!
//! Areas are used by one vehicle at a time. A vehicle that cannot stop before its passage any more, or does not obey, has
//! booked it. The others ask in turn: those first that wait for none of the rest by precedence, equals by their arrival. An
//! agent may enter if no other has booked one of its areas meanwhile and there is room behind the passage. Docs: rules.md.
//! What all of this looks at is in `meeting`, how circles of waits are broken in `circles`.

use std::collections::BTreeMap;

use super::components::components;
use super::course::{Passage, conflict, reach};
use super::meeting::{Booking, Meeting, Memory, Order, OrderKind, Traveller};
use crate::junctions::AreaKind;

/// A vehicle that must brake harder than this to stop before the passage has entered it [m/s²].
const COMMITTED: f64 = 4.0;
/// Agents stop this far before a passage [m].
const GAP: f64 = 0.5;
/// Tickets are taken at this distance beyond the braking distance [m], with this deceleration [m/s²].
const TICKET_REACH: f64 = 5.0;
const STICKY_REACH: f64 = 10.0;
const BRAKING: f64 = 3.0;
/// An agent that was granted passage keeps it with gaps that are smaller by this [s].
pub(crate) const STICKY_LEAD: f64 = 0.3;
pub(crate) const STICKY_LAG: f64 = 0.15;
/// Room that is left behind a passage beside the length of the vehicle [m]; the last vehicle ahead brakes so hard [m/s²].
const ROOM: f64 = 1.0;
const LEADER_BRAKING: f64 = 2.0;
/// Vehicles that merge faster than this follow each other [m/s], entering the merge after this time [s].
const FOLLOWING: f64 = 2.0;
const FOLLOWING_TIME: f64 = 1.0;
/// One that comes second to a merge brakes so gently for a slower one ahead [m/s²].
const CATCHING_UP: f64 = 2.0;
/// One that moves slower than this blocks its lane [m/s].
const BLOCKING: f64 = 1.0;
/// Width of vehicles that do not obey [m].
const CAR_WIDTH: f64 = 1.8;

/// An agent that asks for a passage.
struct Claim<'a> {
    traveller: usize,
    passage: &'a Passage,
    /// Position of the passage on its way.
    number: usize,
    /// Claims of agents ahead in its lane; `None`: a vehicle is ahead that asks for nothing.
    ahead: Option<Vec<usize>>,
    /// The next body ahead.
    leader: Option<usize>,
    ticket: Option<i64>,
    has_exception: bool,
    is_sticky: bool,
    windows: Vec<Booking>,
    answer: Option<Answer>,
}

#[derive(Clone, Copy, PartialEq)]
struct Answer {
    kind: OrderKind,
    by: Option<usize>,
    delay: f64,
}

impl Answer {
    const GO: Self = Self { kind: OrderKind::Go, by: None, delay: 0.0 };
}

/// The speed of a traveller [m/s], or that of its passage through an area if that is less.
fn slowed(traveller: &Traveller<'_>, area: usize, velocity: f64) -> f64 {
    let leads_over = |passage: &&Passage| passage.areas.iter().any(|crossed| crossed.area == area);
    traveller.course.passages.iter().find(leads_over).map_or(velocity, |passage| velocity.min(passage.speed))
}

/// Time that a vehicle loses [s] by braking from its speed to that of a slower one ahead [m/s].
fn catching_up(ahead: f64, velocity: f64) -> f64 {
    if velocity > ahead { 0.5 * (velocity - ahead).powi(2) / (CATCHING_UP * velocity) } else { 0.0 }
}

impl Meeting<'_> {
    /// The orders of all travellers that are near a passage, by ids. `sees` says whether the body at the first position
    /// sees that at the second one.
    pub fn orders(&self, sees: &dyn Fn(usize, usize) -> bool) -> Vec<Order> {
        let mut orders = Vec::new();
        for members in self.clusters() {
            let mut known: Vec<(Vec<usize>, Vec<Option<Order>>)> = Vec::new();
            for &member in &members {
                let viewer = self.travellers[member].body;
                let seen: Vec<usize> =
                    (0..self.bodies.len()).filter(|body| *body == viewer || sees(viewer, *body)).collect();
                let own = |found: &[Option<Order>]| {
                    let place = members.iter().position(|one| *one == member).expect("it is a member");
                    found[place]
                };
                // Agents that see the same bodies come to the same orders.
                let order = if let Some((_, found)) = known.iter().find(|(same, _)| *same == seen) {
                    own(found)
                } else {
                    let found = self.arbitrate(&members, &seen);
                    let order = own(&found);
                    known.push((seen, found));
                    order
                };
                orders.extend(order);
            }
        }
        orders.sort_by_key(|order| order.id);
        self.break_circles(&mut orders);
        orders
    }

    /// Travellers near a passage, in groups whose passages belong to the same junctions.
    fn clusters(&self) -> Vec<Vec<usize>> {
        let mut clusters: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for (index, traveller) in self.travellers.iter().enumerate() {
            let body = &self.bodies[traveller.body];
            let reach = reach(body.velocity);
            let passages = &traveller.course.passages[traveller.first_passage(body.length)..];
            let near = passages.iter().take_while(|passage| passage.mouth - traveller.front <= reach);
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
    fn arbitrate(&self, members: &[usize], seen: &[usize]) -> Vec<Option<Order>> {
        let is_seen = |body: &usize| seen.binary_search(body).is_ok();
        let mut booked: BTreeMap<usize, Vec<Booking>> = BTreeMap::new();
        let mut reserved: BTreeMap<usize, f64> = BTreeMap::new();
        let mut claims: Vec<Claim<'_>> = Vec::new();
        for visit in self.visits.iter().filter(|visit| is_seen(&visit.body)) {
            booked.entry(visit.area).or_default().push(*visit);
        }
        let mut orders: Vec<Option<Order>> = vec![None; members.len()];
        let present = || members.iter().enumerate().filter(|(_, index)| is_seen(&self.travellers[**index].body));
        for (place, &index) in present() {
            let traveller = &self.travellers[index];
            let body = &self.bodies[traveller.body];
            let first = traveller.first_passage(body.length);
            for (number, passage) in traveller.course.passages.iter().enumerate().skip(first) {
                let ahead = passage.mouth - traveller.front;
                if body.velocity * body.velocity < 2.0 * COMMITTED * ahead {
                    let is_near = ahead <= reach(body.velocity);
                    if is_near && traveller.line > passage.end {
                        claims.push(self.claim(index, number));
                    }
                    break;
                }
                let memory = traveller.memory_of(number);
                let mut windows = traveller.windows(passage, body);
                if memory.exception.is_some() && !self.has_room(index, passage, 0.0, seen).0 {
                    windows.iter_mut().for_each(|window| window.leave = f64::INFINITY);
                }
                windows.into_iter().for_each(|window| booked.entry(window.area).or_default().push(window));
                if traveller.front < passage.end {
                    *reserved.entry(passage.exit).or_default() += body.length + ROOM;
                }
                orders[place] = Some(Order {
                    id: body.id,
                    kind: OrderKind::Go,
                    stop: f64::INFINITY,
                    release: 0.0,
                    by: None,
                    memory: Memory { granted: true, ..memory },
                });
            }
        }
        self.line_up(&mut claims, seen);
        let edges = self.edges(&claims);
        for mut component in components(&edges) {
            component.sort_by_key(|index| {
                let claim = &claims[*index];
                let id = self.bodies[self.travellers[claim.traveller].body].id;
                (!claim.is_sticky, claim.ticket.unwrap_or(i64::MAX), id)
            });
            let mut late = Vec::new();
            for &index in &component {
                let answer = self.test(&claims, index, &booked, &reserved, seen);
                if answer.kind == OrderKind::Go {
                    let has_room = !claims[index].has_exception || {
                        let claim = &claims[index];
                        self.has_room(claim.traveller, claim.passage, 0.0, seen).0
                    };
                    let stays = if has_room { 0.0 } else { f64::INFINITY };
                    book(&mut booked, &claims[index].windows, (0.0, stays));
                    let length = self.bodies[self.travellers[claims[index].traveller].body].length;
                    *reserved.entry(claims[index].passage.exit).or_default() += length + ROOM;
                    claims[index].answer = Some(answer);
                } else {
                    late.push(index);
                }
            }
            for index in late {
                let answer = self.test(&claims, index, &booked, &reserved, seen);
                if answer.delay.is_finite() {
                    book(&mut booked, &claims[index].windows, (answer.delay, answer.delay));
                }
                claims[index].answer = Some(answer);
            }
        }
        for claim in &claims {
            let place = members.iter().position(|member| *member == claim.traveller).expect("a member");
            orders[place] = Some(self.order(claim));
        }
        orders
    }

    fn claim(&self, index: usize, number: usize) -> Claim<'_> {
        let traveller = &self.travellers[index];
        let body = &self.bodies[traveller.body];
        let passage = &traveller.course.passages[number];
        let memory = traveller.memory_of(number);
        let to_wait = passage.mouth - GAP - traveller.front;
        let braking = 0.5 * body.velocity * body.velocity / BRAKING;
        Claim {
            traveller: index,
            passage,
            number,
            ahead: Some(Vec::new()),
            leader: None,
            ticket: memory.ticket,
            has_exception: memory.exception.is_some(),
            is_sticky: memory.granted && to_wait <= braking + STICKY_REACH,
            windows: traveller.windows(passage, body),
            answer: None,
        }
    }

    /// Finds the bodies ahead of each claim in its lane, and gives tickets to the first ones.
    fn line_up(&self, claims: &mut [Claim<'_>], seen: &[usize]) {
        let by_body: BTreeMap<usize, usize> =
            claims.iter().enumerate().map(|(k, claim)| (self.travellers[claim.traveller].body, k)).collect();
        for claim in claims.iter_mut() {
            let traveller = &self.travellers[claim.traveller];
            let (mut ahead, mut is_blocked, mut nearest) = (Vec::new(), false, f64::INFINITY);
            for &other in seen.iter().filter(|other| **other != traveller.body) {
                let Some(front) = self.front_on(traveller.course, other, traveller.front) else { continue };
                if front <= traveller.front || front > claim.passage.mouth {
                    continue;
                }
                match by_body.get(&other) {
                    Some(other) => ahead.push(*other),
                    None => is_blocked |= self.bodies[other].velocity < BLOCKING,
                }
                if front < nearest {
                    (nearest, claim.leader) = (front, Some(other));
                }
            }
            let velocity = self.bodies[traveller.body].velocity;
            let is_first = ahead.is_empty() && !is_blocked;
            let to_wait = claim.passage.mouth - GAP - traveller.front;
            if is_first && to_wait <= 0.5 * velocity * velocity / BRAKING + TICKET_REACH {
                claim.ticket = claim.ticket.or(Some(self.time_step));
            }
            claim.ahead = (!is_blocked).then_some(ahead);
        }
    }

    /// For every claim those that it waits for by precedence, and the last one ahead in its lane.
    fn edges(&self, claims: &[Claim<'_>]) -> Vec<Vec<usize>> {
        let waits = |claim: &Claim<'_>, other: &Claim<'_>| {
            let widths = self.travellers[claim.traveller].width + self.travellers[other.traveller].width;
            claim.passage.areas.iter().any(|crossed| {
                let goes_first = self.junctions.areas[crossed.area].first == Some(crossed.side);
                let meets = |their: &super::course::Crossed| their.area == crossed.area && their.side != crossed.side;
                !goes_first && other.passage.areas.iter().any(meets) && conflict(self.junctions, crossed.area, widths)
            })
        };
        let of = |(index, claim): (usize, &Claim<'_>)| {
            let ahead = claim.ahead.as_deref().unwrap_or_default();
            let others = claims.iter().enumerate();
            let is_edge = |(other, their): &(usize, &Claim<'_>)| {
                *other != index && (ahead.contains(other) || waits(claim, their))
            };
            others.filter(is_edge).map(|(other, _)| other).collect()
        };
        claims.iter().enumerate().map(of).collect()
    }

    /// Whether a claim can be granted now.
    fn test(
        &self,
        claims: &[Claim<'_>],
        index: usize,
        booked: &BTreeMap<usize, Vec<Booking>>,
        reserved: &BTreeMap<usize, f64>,
        seen: &[usize],
    ) -> Answer {
        let claim = &claims[index];
        let traveller = &self.travellers[claim.traveller];
        let settings = traveller.settings;
        let is_granted = |other: &usize| claims[*other].answer == Some(Answer::GO);
        if !claim.ahead.as_ref().is_some_and(|ahead| ahead.iter().all(is_granted)) {
            return Answer { kind: OrderKind::Queue, by: claim.leader, delay: f64::INFINITY };
        }
        let reservation = reserved.get(&claim.passage.exit).copied().unwrap_or(0.0);
        if settings.keep_clear && !claim.has_exception {
            let (has_room, last) = self.has_room(claim.traveller, claim.passage, reservation, seen);
            if !has_room {
                return Answer { kind: OrderKind::Exit, by: last, delay: f64::INFINITY };
            }
        }
        let stood = traveller.memory.standing as f64 * self.dt;
        let patience = 1.0 - 0.5 * (stood / settings.impatience).min(1.0);
        let mut lead = (settings.lead + claim.passage.extra_lead) * patience;
        let mut lag = settings.lag;
        if claim.is_sticky {
            (lead, lag) = (lead - STICKY_LEAD, lag - STICKY_LAG);
        }
        let (mut delay, mut by) = (0.0, None);
        for mine in &claim.windows {
            for theirs in booked.get(&mine.area).into_iter().flatten() {
                let wanted = self.delay(traveller, mine, theirs, (lead, lag));
                if theirs.side != mine.side && theirs.body != mine.body && wanted > delay {
                    (delay, by) = (wanted, Some(theirs.body));
                }
            }
        }
        if delay > 0.0 { Answer { kind: OrderKind::Yield, by, delay } } else { Answer::GO }
    }

    /// How much later an agent has to come because of a booking [s].
    fn delay(&self, traveller: &Traveller<'_>, mine: &Booking, theirs: &Booking, (lead, lag): (f64, f64)) -> f64 {
        let area = &self.junctions.areas[mine.area];
        let other = self.travellers.iter().find(|other| other.body == theirs.body);
        let width = other.map_or(CAR_WIDTH, |other| other.width);
        if area.kind == AreaKind::Opposed && !conflict(self.junctions, mine.area, traveller.width + width) {
            return 0.0;
        }
        let [velocity, their_velocity] = [mine, theirs].map(|booking| self.bodies[booking.body].velocity);
        let merges = area.kind == AreaKind::Merge;
        let lead =
            if merges { lead + catching_up(slowed(traveller, mine.area, velocity), their_velocity) } else { lead };
        if mine.leave + lead <= theirs.enter || mine.enter >= theirs.leave + lag {
            return 0.0;
        }
        if merges && velocity > FOLLOWING && their_velocity > FOLLOWING {
            return (theirs.enter + FOLLOWING_TIME - mine.enter).max(0.0);
        }
        theirs.leave + lag - mine.enter
    }

    /// Whether there is room for an agent behind a passage, and the last body there.
    fn has_room(&self, index: usize, passage: &Passage, reserved: f64, seen: &[usize]) -> (bool, Option<usize>) {
        let traveller = &self.travellers[index];
        let length = self.bodies[traveller.body].length;
        let mut last: Option<(f64, usize)> = None;
        for &other in seen.iter().filter(|other| **other != traveller.body) {
            let Some(front) = self.front_on(traveller.course, other, traveller.front) else { continue };
            let rear = front - self.bodies[other].length;
            if front > passage.end && last.is_none_or(|(least, _)| rear < least) {
                last = Some((rear, other));
            }
        }
        let Some((rear, other)) = last else { return (true, None) };
        let braking = 0.5 * self.bodies[other].velocity.powi(2) / LEADER_BRAKING;
        (rear - passage.end + braking - reserved >= length + ROOM, Some(other))
    }

    fn order(&self, claim: &Claim<'_>) -> Order {
        let traveller = &self.travellers[claim.traveller];
        let answer = claim.answer.expect("every claim has been tested");
        let first = claim.windows.first().map_or(0.0, |window| window.enter);
        let is_granted = answer.kind == OrderKind::Go;
        Order {
            id: self.bodies[traveller.body].id,
            kind: answer.kind,
            stop: if is_granted { f64::INFINITY } else { claim.passage.mouth },
            release: if is_granted { 0.0 } else { first + answer.delay },
            by: answer.by.map(|body| self.bodies[body].id),
            memory: Memory { ticket: claim.ticket, granted: is_granted, ..traveller.memory_of(claim.number) },
        }
    }
}

/// Books windows, moved by so much at both ends [s].
fn book(booked: &mut BTreeMap<usize, Vec<Booking>>, windows: &[Booking], (enter, leave): (f64, f64)) {
    for window in windows {
        let moved = Booking { enter: window.enter + enter, leave: window.leave + leave, ..*window };
        booked.entry(window.area).or_default().push(moved);
    }
}
