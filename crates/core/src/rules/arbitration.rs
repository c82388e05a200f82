//! Who may enter a junction now: one order for all that obey, from their states, the map, and what they remember.
//!
//! Areas are used by one vehicle at a time. Whoever cannot stop before its passage any more, or does not obey, has booked
//! it. The others ask in turn: those first that wait for none of the rest by precedence, equals by their arrival. An agent
//! may enter if nobody else has booked one of its areas meanwhile and there is room behind the passage. Docs: rules.md.

use std::collections::BTreeMap;

use super::RulesSettings;
use super::components::components;
use super::course::{Course, MARGIN, Passage, conflict, reach};
use crate::junctions::{AreaKind, Junctions};

/// Accelerations of an early entry and of a late exit [m/s²], and the share of the speed there.
const EARLY: f64 = 2.0;
const LATE: f64 = 1.2;
const SLOW: f64 = 0.7;
/// An agent that stands needs so long to start [s], below this speed [m/s].
const REACTION: f64 = 0.3;
const REACTING: f64 = 0.5;
/// Whoever must brake harder than this to stop before the passage has entered it [m/s²].
const COMMITTED: f64 = 4.0;
/// They stop this far before a passage [m].
const GAP: f64 = 0.5;
/// Tickets are taken at this distance beyond the braking distance [m], with this deceleration [m/s²].
const TICKET_REACH: f64 = 5.0;
const STICKY_REACH: f64 = 10.0;
const BRAKING: f64 = 3.0;
/// Who was granted passage keeps it with gaps that are smaller by this [s].
const STICKY_LEAD: f64 = 0.3;
const STICKY_LAG: f64 = 0.15;
/// Room that is left behind a passage beside the length of the vehicle [m]; the last vehicle ahead brakes so hard [m/s²].
const ROOM: f64 = 1.0;
const LEADER_BRAKING: f64 = 4.5;
/// Vehicles that merge faster than this follow each other [m/s], entering the merge after this time [s].
const FOLLOWING: f64 = 2.0;
const FOLLOWING_TIME: f64 = 1.0;
/// A vehicle stands below this speed [m/s]; one that moves slower than this blocks its lane [m/s].
const STANDING: f64 = 0.1;
const BLOCKING: f64 = 1.0;
/// Whoever stands this near behind another one waits for it [m].
const NEAR: f64 = 3.0;
/// Width of vehicles that do not obey [m].
const CAR_WIDTH: f64 = 1.8;
/// No second exception in the same circle within this time [s].
const EXCEPTION_TIME: f64 = 10.0;

/// Why an agent has to wait before a passage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum OrderKind {
    /// It may go.
    Go = 0,
    /// Another one is booked for an area.
    Yield = 1,
    /// There is no room behind the passage.
    Exit = 2,
    /// Another one waits ahead in the lane.
    Queue = 3,
}

impl OrderKind {
    /// All kinds; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 4] = [Self::Go, Self::Yield, Self::Exit, Self::Queue];
}

/// What an agent remembers of its next passage.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Memory {
    /// Position of the passage on its way.
    pub passage: usize,
    /// Time step at which it arrived as the first of its lane.
    pub ticket: Option<i64>,
    /// It was allowed to go at the last step.
    pub granted: bool,
    /// Time step since which it may enter although there is no room behind.
    pub exception: Option<i64>,
    /// Steps for which it has stood.
    pub standing: usize,
}

/// What an agent has to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// The agent.
    pub id: i64,
    /// Why.
    pub kind: OrderKind,
    /// Arc length on its reference path that its front must not pass [m] ...
    pub stop: f64,
    /// ... before this time has passed [s]; infinite: until it is told otherwise.
    pub release: f64,
    /// Because of this participant.
    pub by: Option<i64>,
    /// What it remembers.
    pub memory: Memory,
}

/// An agent that obeys.
#[derive(Debug, Clone, Copy)]
pub struct Traveller<'a> {
    /// Its body, as a position in `Meeting::bodies`.
    pub body: usize,
    /// Width [m].
    pub width: f64,
    /// Arc length of its front on its path [m].
    pub front: f64,
    /// Its path.
    pub course: &'a Course,
    /// What it obeys, and its gaps.
    pub settings: &'a RulesSettings,
    /// What it remembers.
    pub memory: Memory,
    /// Arc length of the line that holds it [m]; infinite without one.
    pub line: f64,
}

/// A place on a lanelet and how far the front is ahead of it [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the lanelet.
    pub lanelet: usize,
    /// Arc length there [m].
    pub s: f64,
    /// From there to the front [m].
    pub to_front: f64,
}

/// A participant on the road.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its id.
    pub id: i64,
    /// Length [m].
    pub length: f64,
    /// Speed [m/s], not negative.
    pub velocity: f64,
    /// Where it is.
    pub places: Vec<Place>,
}

/// When a participant uses a side of an area [s from now].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Booking {
    /// Position in `Junctions::areas`.
    pub area: usize,
    /// The side.
    pub side: usize,
    /// From then on.
    pub enter: f64,
    /// Until then.
    pub leave: f64,
    /// The participant, as a position in `Meeting::bodies`.
    pub body: usize,
}

/// Everything that arbitration looks at in one time step.
#[derive(Debug, Clone, Copy)]
pub struct Meeting<'a> {
    /// Now.
    pub time_step: i64,
    /// Time between steps [s].
    pub dt: f64,
    /// The areas.
    pub junctions: &'a Junctions,
    /// All participants on the road, by ids.
    pub bodies: &'a [Body],
    /// Those that obey, by ids.
    pub travellers: &'a [Traveller<'a>],
    /// What others have booked.
    pub visits: &'a [Booking],
}

/// An agent that asks for a passage.
struct Claim<'a> {
    traveller: usize,
    passage: &'a Passage,
    /// Position of the passage on its way.
    number: usize,
    /// Claims of agents ahead in its lane; `None`: somebody is ahead that asks for nothing.
    ahead: Option<Vec<usize>>,
    /// Who is next ahead.
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

/// Time for a distance [m] from a speed [m/s], with an acceleration [m/s²] up to a largest speed [m/s].
fn travel_time(distance: f64, velocity: f64, largest: f64, acceleration: f64) -> f64 {
    if distance <= 0.0 {
        return 0.0;
    }
    let reaction = if velocity < REACTING { REACTION } else { 0.0 };
    if velocity >= largest {
        return reaction + distance / velocity;
    }
    let ramp = 0.5 * (largest * largest - velocity * velocity) / acceleration;
    if distance <= ramp {
        return reaction + ((velocity * velocity + 2.0 * acceleration * distance).sqrt() - velocity) / acceleration;
    }
    reaction + (largest - velocity) / acceleration + (distance - ramp) / largest
}

impl Traveller<'_> {
    /// When it uses the areas of a passage that its rear has not left.
    fn windows(&self, passage: &Passage, body: &Body) -> Vec<Booking> {
        let (velocity, front) = (body.velocity, self.front);
        let early = passage.approach.min(passage.speed.max(velocity));
        let late = (SLOW * passage.speed).max(velocity);
        let window = |crossed: &super::course::Crossed| {
            let leaves = crossed.exit + MARGIN + body.length - front;
            (leaves > 0.0).then(|| Booking {
                area: crossed.area,
                side: crossed.side,
                enter: travel_time(crossed.entry - MARGIN - front, velocity, early, EARLY),
                leave: travel_time(leaves, velocity, late, LATE),
                body: self.body,
            })
        };
        passage.areas.iter().filter_map(window).collect()
    }

    /// What it remembers of a passage.
    fn memory_of(&self, number: usize) -> Memory {
        let kept = self.memory.passage == number;
        let standing = self.memory.standing;
        if kept { self.memory } else { Memory { passage: number, standing, ..Memory::default() } }
    }

    /// First passage that its rear has not left.
    fn first_passage(&self, length: f64) -> usize {
        self.course.passages.partition_point(|passage| passage.end <= self.front - length)
    }
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
                // Who sees the same comes to the same orders.
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

    /// Orders of a group of travellers, as seen by who sees these bodies; `None` for those that are asked nothing.
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

    /// Finds who is ahead of each claim in its lane, and gives tickets to the first ones.
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

    /// Arc length of the front of a body on a path [m], if it is on one of its lanelets.
    fn front_on(&self, course: &Course, body: usize, from: f64) -> Option<f64> {
        let length = self.bodies[body].length;
        let on = |place: &Place| {
            let at = course.place(place.lanelet, place.s, from - length)?;
            Some(at + place.to_front)
        };
        self.bodies[body].places.iter().find_map(on)
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
        if mine.leave + lead <= theirs.enter || mine.enter >= theirs.leave + lag {
            return 0.0;
        }
        let velocity = |booking: &Booking| self.bodies[booking.body].velocity;
        if area.kind == AreaKind::Merge && velocity(mine) > FOLLOWING && velocity(theirs) > FOLLOWING {
            return (theirs.enter + FOLLOWING_TIME - mine.enter).max(0.0);
        }
        theirs.leave + lag - mine.enter
    }

    /// There is room for an agent behind a passage, and who is the last one there.
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

    /// In every circle of agents that wait for each other one may enter although there is no room behind.
    fn break_circles(&self, orders: &mut [Order]) {
        let stands = |traveller: &Traveller<'_>| {
            let needed = traveller.settings.circle_after / self.dt;
            self.bodies[traveller.body].velocity < STANDING && traveller.memory.standing as f64 >= needed
        };
        let stuck: Vec<usize> = (0..self.travellers.len()).filter(|index| stands(&self.travellers[*index])).collect();
        if stuck.len() < 2 {
            return;
        }
        let node = |id: i64| stuck.iter().position(|index| self.bodies[self.travellers[*index].body].id == id);
        let order_of = |orders: &[Order], index: usize| {
            let id = self.bodies[self.travellers[index].body].id;
            orders.iter().position(|order| order.id == id)
        };
        let edges: Vec<Vec<usize>> = stuck
            .iter()
            .map(|&index| {
                let by = order_of(orders, index).and_then(|place| orders[place].by).and_then(node);
                let leader = self.leader(index).and_then(|body| node(self.bodies[body].id));
                by.into_iter().chain(leader).collect()
            })
            .collect();
        for component in components(&edges).into_iter().filter(|component| component.len() > 1) {
            let members: Vec<usize> = component.iter().filter_map(|node| order_of(orders, stuck[*node])).collect();
            let recent = |place: &&usize| {
                let since = orders[**place].memory.exception;
                since.is_some_and(|since| ((self.time_step - since) as f64) * self.dt < EXCEPTION_TIME)
            };
            if members.iter().any(|place| recent(&place)) {
                continue;
            }
            let held = members
                .iter()
                .filter(|place| orders[**place].kind == OrderKind::Exit && orders[**place].memory.exception.is_none());
            let first =
                held.min_by_key(|place| (orders[**place].memory.ticket.unwrap_or(i64::MAX), orders[**place].id));
            if let Some(&place) = first {
                orders[place].memory.exception = Some(self.time_step);
            }
        }
    }

    /// The nearest body ahead on the path of a traveller, if it is near.
    fn leader(&self, index: usize) -> Option<usize> {
        let traveller = &self.travellers[index];
        let gap = |body: usize| {
            let front = self.front_on(traveller.course, body, traveller.front)?;
            let gap = front - self.bodies[body].length - traveller.front;
            (front > traveller.front && gap < NEAR).then_some((gap, body))
        };
        let others = (0..self.bodies.len()).filter(|body| *body != traveller.body);
        others.filter_map(gap).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, body)| body)
    }
}

/// Books windows, moved by so much at both ends [s].
fn book(booked: &mut BTreeMap<usize, Vec<Booking>>, windows: &[Booking], (enter, leave): (f64, f64)) {
    for window in windows {
        let moved = Booking { enter: window.enter + enter, leave: window.leave + leave, ..*window };
        booked.entry(window.area).or_default().push(moved);
    }
}

#[cfg(test)]
mod tests {
    use super::travel_time;

    #[test]
    fn the_time_for_a_distance_follows_from_speed_and_acceleration() {
        for (distance, velocity, largest, acceleration, expected) in [
            (20.0, 10.0, 10.0, 2.0, 2.0),
            (27.8, 10.0, 10.0, 1.2, 2.78),
            (-1.0, 0.0, 10.0, 2.0, 0.0),
            // 0.3 s to react, sqrt(2 · 8.4 / 1.2)
            (8.4, 0.0, 7.0, 1.2, 0.3 + 3.741_657_386_773_941),
            // 4 to 8 m/s in 2 s over 12 m, then 8 m more.
            (20.0, 4.0, 8.0, 2.0, 3.0),
        ] {
            assert!((travel_time(distance, velocity, largest, acceleration) - expected).abs() < 1e-9);
        }
    }
}
