//! Agents that ask for a passage, and what is reserved.

use super::course::Passage;
use super::meeting::{OrderKind, Reservation};
use super::room::ROOM;

/// An agent that asks for a passage.
pub(super) struct Request<'a> {
    pub(super) traveller: usize,
    pub(super) body: usize,
    pub(super) passage: &'a Passage,
    /// Position of the passage on its way.
    pub(super) number: usize,
    /// Claims of agents ahead in its lane; `None`: a vehicle is ahead that asks for nothing.
    pub(super) ahead: Option<Vec<usize>>,
    /// The next body ahead.
    pub(super) leader: Option<usize>,
    pub(super) ticket: Option<i64>,
    pub(super) has_exception: bool,
    pub(super) is_sticky: bool,
    pub(super) turns_on_red: bool,
    /// It counts on it that others give way.
    pub(super) trusts: bool,
    pub(super) windows: Vec<Reservation>,
    /// Claims that leave the areas before it, although it could come earlier.
    pub(super) follows: Vec<usize>,
    pub(super) decision: Option<Decision>,
}

impl Request<'_> {
    pub(super) fn is_granted(&self) -> bool {
        self.decision == Some(Decision::GO)
    }
}

/// Whether a request is granted; if not, why, because of which body, and for how long [s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Decision {
    pub(super) kind: OrderKind,
    pub(super) by: Option<usize>,
    pub(super) delay: f64,
}

impl Decision {
    pub(super) const GO: Self = Self { kind: OrderKind::Go, by: None, delay: 0.0 };

    /// For now it is not known for how long.
    pub(super) fn wait(kind: OrderKind, by: Option<usize>) -> Self {
        Self { kind, by, delay: f64::INFINITY }
    }
}

/// What has been reserved so far.
#[derive(Debug, Default)]
pub(super) struct Reservations {
    reservations: Vec<Reservation>,
    /// Room behind passages that end on a lanelet [m].
    reserved: Vec<(usize, f64)>,
}

impl Reservations {
    pub(super) fn of(&self, area: usize) -> impl Iterator<Item = &Reservation> {
        self.reservations.iter().filter(move |reservation| reservation.area == area)
    }

    pub(super) fn reserved(&self, passage: &Passage) -> f64 {
        self.reserved.iter().filter(|(exit, _)| *exit == passage.exit).map(|(_, length)| length).sum()
    }

    pub(super) fn add(&mut self, windows: impl IntoIterator<Item = Reservation>) {
        self.reservations.extend(windows);
    }

    /// Keeps room for a vehicle of a length behind a passage.
    pub(super) fn reserve(&mut self, passage: &Passage, length: f64) {
        self.reserved.push((passage.exit, length + ROOM));
    }
}
