//! The traffic at one time step, from which ledgers are made, and what agents are told.

use super::zones::{Course, Place, Zone};
use crate::barrier::{Barrier, BarrierReason};
use crate::rules::RulesSettings;

/// What an agent is told before a passage, and for which reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum OrderKind {
    /// Enter.
    Go = 0,
    /// Wait: another participant has reserved one of the areas.
    Yield = 1,
    /// Wait: behind the passage there is no room to leave it.
    Exit = 2,
    /// Wait: a vehicle ahead in the lane waits or blocks it.
    Queue = 3,
    /// Enter, but not before another one has left.
    Follow = 4,
    /// Wait before a crosswalk: a person uses it.
    Crosswalk = 5,
    /// Wait: a vehicle may come that the agent does not see.
    Unseen = 6,
}

impl OrderKind {
    /// All kinds; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 7] =
        [Self::Go, Self::Yield, Self::Exit, Self::Queue, Self::Follow, Self::Crosswalk, Self::Unseen];

    /// Why its barrier is there.
    pub(super) fn reason(self) -> BarrierReason {
        match self {
            Self::Go | Self::Yield | Self::Follow => BarrierReason::Yield,
            Self::Exit => BarrierReason::Exit,
            Self::Queue => BarrierReason::Queue,
            Self::Crosswalk => BarrierReason::Crosswalk,
            Self::Unseen => BarrierReason::Unseen,
        }
    }
}

/// What an agent remembers of its next passage.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Memory {
    /// Position of the passage on its way.
    pub passage: usize,
    /// Time step at which it arrived as the first of its lane.
    pub ticket: Option<i64>,
    /// Whether it was allowed to go at the last step; `None`: it did not ask.
    pub granted: Option<bool>,
    /// It cannot stop before it any more.
    pub has_entered: bool,
    /// Time step since which it may enter although there is no room behind.
    pub exception: Option<i64>,
    /// Steps for which it has stood.
    pub standing: usize,
    /// Steps for which it stood or crept because of what it does not see.
    pub peeking: usize,
}

impl Memory {
    /// Its place among equals: one that has not arrived goes last.
    pub(super) fn arrival(&self) -> i64 {
        self.ticket.unwrap_or(i64::MAX)
    }
}

/// What an agent has to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Order {
    /// The agent.
    pub id: i64,
    /// Why.
    pub kind: OrderKind,
    /// On its reference path; `None`: it may enter now.
    pub barrier: Option<Barrier>,
    /// What it remembers.
    pub memory: Memory,
}

/// An agent that obeys.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traveller<'a> {
    /// Its body, as a position in `Traffic::bodies`.
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
    /// Arc length of the stop line that holds it [m]; infinite without one.
    pub line: f64,
    /// Arc length of the crosswalk before which it has to wait [m]; infinite without one.
    pub crosswalk: f64,
    /// It does not obey, or is not seen, and asks by messages. Behind a vehicle that asks for nothing it asks for nothing.
    pub asks_by_message: bool,
    /// It turns right on red: it waits for all others.
    pub turns_on_red: bool,
    /// It sees others up to this distance [m].
    pub sight: f64,
    /// Areas into which a vehicle may come that it does not see, and the earliest time [s].
    pub unseen: &'a [(usize, f64)],
}

/// A participant on the road.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    /// Its id.
    pub id: i64,
    /// Length [m].
    pub length: f64,
    /// Speed [m/s], not negative.
    pub velocity: f64,
    /// Where it is.
    pub places: Vec<Place>,
}

/// When a participant uses a conflict zone [s from now].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reservation {
    /// The zone, as its side sees it.
    pub zone: Zone,
    /// From then on, as others may expect ...
    pub enter: f64,
    /// ... and at the earliest.
    pub earliest: f64,
    /// Until then.
    pub leave: f64,
    /// The participant, as a position in `Traffic::bodies`.
    pub body: usize,
    /// It can still be held back.
    pub is_request: bool,
    /// Whether it waits for those that go first by the map.
    pub yielding: Yielding,
}

/// Whether a participant that does not obey waits for those that go first by the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Yielding {
    /// It does not.
    No,
    /// It should, but to stop now would be hard: only those that trust others count on it.
    IfTrusted,
    /// It can still stop: it counts only for one that turns right on red.
    Yes,
}

/// Everything from which ledgers are made in one time step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traffic<'a> {
    /// Now.
    pub time_step: i64,
    /// Time between steps [s].
    pub dt: f64,
    /// All participants on the road, by ids.
    pub bodies: &'a [Body],
    /// Those that obey, by ids.
    pub travellers: &'a [Traveller<'a>],
    /// What others have reserved.
    pub visits: &'a [Reservation],
}

impl Traveller<'_> {
    /// It goes before another one (`None`: that does not obey): the map says so (`by_map`), unless one turns right on red.
    pub(super) fn goes_first(&self, other: Option<&Self>, by_map: bool) -> bool {
        match (self.turns_on_red, other.is_some_and(|other| other.turns_on_red)) {
            (true, false) => false,
            (false, true) => true,
            _ => by_map,
        }
    }

    /// What it remembers of a passage.
    pub(super) fn memory_of(&self, number: usize) -> Memory {
        let kept = self.memory.passage == number;
        let standing = self.memory.standing;
        if kept { self.memory } else { Memory { passage: number, standing, ..Memory::default() } }
    }
}

impl Traffic<'_> {
    /// The traveller with a body.
    pub fn of_body(&self, body: usize) -> Option<&Traveller<'_>> {
        let place = self.travellers.binary_search_by_key(&body, |other| other.body).ok()?;
        Some(&self.travellers[place])
    }
}
