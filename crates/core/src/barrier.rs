//! Barriers: how far an agent may go for now, and why. All that holds an agent on its way is told as a barrier: lines,
//! lights, orders at junctions, crosswalks, agreements, ends of lanes.

use std::ops::Deref;

/// An agent need not know yet of a barrier that takes less than this deceleration [m/s²], if there is one before it.
const EASY_DECELERATION: f64 = 1.0;
/// Distances and times in decelerations are at least this [m], [s²].
const DISTANCE_MIN: f64 = 1e-3;
const SQUARE_MIN: f64 = 1e-6;

/// Why there is a barrier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum BarrierReason {
    /// The line of a stop sign.
    Line = 0,
    /// The line of a light that is not green.
    Light = 1,
    /// Another participant goes first at a junction, or leaves it before the agent arrives.
    Yield = 2,
    /// A vehicle ahead in the lane waits at a junction or blocks it.
    Queue = 3,
    /// There is no room behind a junction.
    Exit = 4,
    /// A person uses a crosswalk.
    Crosswalk = 5,
    /// A vehicle may come that the agent does not see.
    Unseen = 6,
    /// The lane ends, or leads elsewhere.
    LaneEnd = 7,
    /// The agent agreed by V2X that another one goes first.
    Agreement = 8,
}

impl BarrierReason {
    /// All reasons; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 9] = [
        Self::Line,
        Self::Light,
        Self::Yield,
        Self::Queue,
        Self::Exit,
        Self::Crosswalk,
        Self::Unseen,
        Self::LaneEnd,
        Self::Agreement,
    ];

    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Light => "light",
            Self::Yield => "yield",
            Self::Queue => "queue",
            Self::Exit => "exit",
            Self::Crosswalk => "crosswalk",
            Self::Unseen => "unseen",
            Self::LaneEnd => "lane_end",
            Self::Agreement => "agreement",
        }
    }
}

/// Not beyond here before then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barrier {
    /// Arc length on a way that the front must not pass [m] ...
    pub s: f64,
    /// ... before this time from now has passed [s]; infinite: until the agent is told otherwise.
    pub until: f64,
    /// Why.
    pub reason: BarrierReason,
    /// The participant to which the agent gives way.
    pub by: Option<i64>,
}

impl Barrier {
    /// Until the agent is told otherwise, because of no participant.
    pub fn lasting(s: f64, reason: BarrierReason) -> Self {
        Self { s, until: f64::INFINITY, reason, by: None }
    }

    /// Deceleration that it takes from a front at an arc length [m] at a speed [m/s], to stand before it or to arrive
    /// when it opens [m/s²].
    pub fn deceleration(&self, front: f64, velocity: f64) -> f64 {
        let distance = self.s - front;
        let standing = 0.5 * velocity * velocity / distance.max(DISTANCE_MIN);
        if velocity * self.until >= 2.0 * distance || self.until.is_infinite() {
            // It stands before the barrier opens.
            return standing;
        }
        let arriving = 2.0 * (velocity * self.until - distance) / (self.until * self.until).max(SQUARE_MIN);
        standing.min(arriving.max(0.0))
    }
}

/// The barriers of an agent on one way, at most one of each source; no memory is allocated for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barriers {
    items: [Barrier; Self::CAPACITY],
    len: usize,
}

impl Barriers {
    /// A stop sign, a light, a crosswalk, an order at a junction, an agreement, the end of the lane, oncoming traffic beside
    /// what stands.
    pub const CAPACITY: usize = 7;

    /// There is none.
    pub const NONE: Self = Self {
        items: [Barrier { s: f64::INFINITY, until: 0.0, reason: BarrierReason::Line, by: None }; Self::CAPACITY],
        len: 0,
    };

    /// Adds one.
    ///
    /// # Panics
    /// If there are as many as there are sources.
    pub fn push(&mut self, barrier: Barrier) {
        self.items[self.len] = barrier;
        self.len += 1;
    }

    /// The barrier that a planner has to heed first, for a front at an arc length [m] at a speed [m/s]: the nearest,
    /// unless another one takes a harder deceleration.
    pub fn hardest(&self, front: f64, velocity: f64) -> Option<&Barrier> {
        let effort = |one: &Barrier| one.deceleration(front, velocity).max(EASY_DECELERATION);
        self.iter().min_by(|a, b| effort(b).total_cmp(&effort(a)).then(a.s.total_cmp(&b.s)))
    }

    /// Arc length of the nearest one [m]; infinite without any.
    pub fn nearest(&self) -> f64 {
        self.iter().map(|one| one.s).fold(f64::INFINITY, f64::min)
    }
}

impl Default for Barriers {
    fn default() -> Self {
        Self::NONE
    }
}

impl Deref for Barriers {
    type Target = [Barrier];

    fn deref(&self) -> &[Barrier] {
        &self.items[..self.len]
    }
}

impl Extend<Barrier> for Barriers {
    fn extend<T: IntoIterator<Item = Barrier>>(&mut self, barriers: T) {
        barriers.into_iter().for_each(|barrier| self.push(barrier));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn barriers(all: &[(f64, f64)]) -> Barriers {
        let mut found = Barriers::NONE;
        found.extend(all.iter().map(|&(s, until)| Barrier { s, until, reason: BarrierReason::Yield, by: None }));
        found
    }

    #[test]
    fn a_barrier_takes_the_deceleration_to_stand_before_it_or_to_arrive_when_it_opens() {
        for (s, until, velocity, expected) in [
            // 10² / (2 * 20)
            (20.0, f64::INFINITY, 10.0, 2.5),
            // It opens in 4 s, when the agent would just stand there; later it does not matter.
            (20.0, 4.0, 10.0, 2.5),
            (20.0, 6.0, 10.0, 2.5),
            (20.0, 30.0, 10.0, 2.5),
            // 2 (30 - 20) / 9
            (20.0, 3.0, 10.0, 20.0 / 9.0),
            (20.0, 2.0, 10.0, 0.0),
            (20.0, f64::INFINITY, 0.0, 0.0),
        ] {
            let found = barriers(&[(100.0 + s, until)])[0].deceleration(100.0, velocity);
            assert!((found - expected).abs() < 1e-12, "{s} {until} {velocity}: {found}");
        }
    }

    #[test]
    fn the_hardest_barrier_is_the_nearest_unless_another_one_takes_a_harder_deceleration() {
        let never = f64::INFINITY;
        for (all, velocity, expected) in [
            (vec![], 10.0, None),
            (vec![(30.0, never), (20.0, never)], 10.0, Some(20.0)),
            (vec![(20.0, never), (30.0, never)], 0.0, Some(20.0)),
            // The nearer one opens before the agent arrives; the line behind it takes 100 / 60.
            (vec![(20.0, 1.0), (30.0, never)], 10.0, Some(30.0)),
            // It opens in 15 s: the agent has to stand before it, not before the line behind it.
            (vec![(20.0, 15.0), (30.0, never)], 10.0, Some(20.0)),
            // Far enough away not to matter yet: 100 / 120.
            (vec![(20.0, 1.0), (60.0, never)], 10.0, Some(20.0)),
        ] {
            let found = barriers(&all).hardest(0.0, velocity).map(|one| one.s);
            assert_eq!(found, expected, "{all:?} at {velocity} m/s");
        }
    }
}
