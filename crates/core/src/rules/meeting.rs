//! What arbitration looks at in one time step, and what it answers.

use super::RulesSettings;
use super::course::Course;
use crate::barrier::{Barrier, BarrierReason};
use crate::junctions::Junctions;

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
    /// Steps for which it stood or crept because of what it does not see.
    pub peeking: usize,
}

/// What an agent has to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
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
    /// Arc length of the stop line that holds it [m]; infinite without one.
    pub line: f64,
    /// Arc length of the crosswalk before which it has to wait [m]; infinite without one.
    pub crosswalk: f64,
    /// It turns right on red: it waits for all others.
    pub turns_on_red: bool,
    /// It sees others up to this distance [m].
    pub sight: f64,
    /// What may come that it does not see.
    pub unseen: &'a [Unseen],
}

/// A vehicle may enter an area that an agent does not see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unseen {
    /// Position in `Junctions::areas`.
    pub area: usize,
    /// At the earliest then [s].
    pub time: f64,
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
pub struct Reservation {
    /// Position in `Junctions::areas`.
    pub area: usize,
    /// The side.
    pub side: usize,
    /// From then on, as others may expect ...
    pub enter: f64,
    /// ... and at the earliest.
    pub earliest: f64,
    /// Until then.
    pub leave: f64,
    /// The participant, as a position in `Meeting::bodies`.
    pub body: usize,
    /// It can still be held back.
    pub is_request: bool,
    /// Whether it waits for those that go first by the map.
    pub yielding: Yielding,
}

/// Whether a participant that does not obey waits for those that go first by the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Yielding {
    /// It does not.
    No,
    /// It should, but to stop now would be hard: only those that trust others count on it.
    IfTrusted,
    /// It can still stop: it counts only for one that turns right on red.
    Yes,
}

impl Reservation {
    /// As soon as it can come.
    pub(super) fn at_the_earliest(&self) -> Self {
        Self { enter: self.earliest, ..*self }
    }

    /// So much later [s].
    pub(super) fn moved(&self, time: f64) -> Self {
        Self { enter: self.enter + time, earliest: self.earliest + time, leave: self.leave + time, ..*self }
    }
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

    /// First passage that its rear has not left.
    pub(super) fn first_passage(&self, length: f64) -> usize {
        self.course.passages.partition_point(|passage| passage.end <= self.front - length)
    }
}

/// A body on the path of a traveller, its rear not far behind that one's front.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ahead {
    /// Arc lengths of its front and its rear on the path [m].
    pub(super) front: f64,
    pub(super) rear: f64,
    /// Position in `Meeting::bodies`.
    pub(super) body: usize,
}

/// The bodies on the paths of travellers, the nearest rear first.
#[derive(Debug)]
pub(super) struct Queues {
    bodies: Vec<Ahead>,
    /// Where those of each traveller begin.
    starts: Vec<usize>,
}

impl Queues {
    pub(super) fn of(&self, traveller: usize) -> &[Ahead] {
        &self.bodies[self.starts[traveller]..self.starts[traveller + 1]]
    }
}

/// The bodies that an agent sees.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    pub(super) bodies: &'a [usize],
    pub(super) queues: &'a Queues,
}

impl Seen<'_> {
    pub(super) fn has(&self, body: usize) -> bool {
        self.bodies.binary_search(&body).is_ok()
    }

    /// Bodies on the path of a traveller whose front is beyond an arc length [m], the nearest one first.
    pub(super) fn ahead(&self, traveller: usize, beyond: f64) -> impl Iterator<Item = &Ahead> {
        self.queues.of(traveller).iter().filter(move |one| one.front > beyond && self.has(one.body))
    }
}

impl Meeting<'_> {
    /// Queues of some travellers; those of the others are empty.
    pub(super) fn queues(&self, is_wanted: &[bool]) -> Queues {
        let numbered = self.bodies.iter().enumerate();
        let mut on: Vec<(usize, usize)> =
            numbered.flat_map(|(body, one)| one.places.iter().map(move |place| (place.lanelet, body))).collect();
        on.sort_unstable();
        let (mut bodies, mut starts, mut near) = (Vec::new(), vec![0], Vec::new());
        for (traveller, is_wanted) in self.travellers.iter().zip(is_wanted) {
            near.clear();
            for piece in if *is_wanted { &*traveller.course.pieces } else { &[] } {
                let from = on.partition_point(|(lanelet, _)| *lanelet < piece.lanelet);
                near.extend(on[from..].iter().take_while(|one| one.0 == piece.lanelet).map(|one| one.1));
            }
            near.sort_unstable();
            near.dedup();
            let start = bodies.len();
            let others = near.iter().copied().filter(|body| *body != traveller.body);
            bodies.extend(others.filter_map(|body| {
                let front = self.front_on(traveller.course, body, traveller.front)?;
                Some(Ahead { front, rear: front - self.bodies[body].length, body })
            }));
            bodies[start..].sort_unstable_by(|a, b| a.rear.total_cmp(&b.rear).then(a.body.cmp(&b.body)));
            starts.push(bodies.len());
        }
        Queues { bodies, starts }
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
}
