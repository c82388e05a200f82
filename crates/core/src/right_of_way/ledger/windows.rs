//! When a vehicle uses the zones of its passage.

use super::Ahead;
use crate::conduct::{EARLY_ACCELERATION, LATE_ACCELERATION, STANDSTILL_SPEED, travel_time};
use crate::right_of_way::traffic::{Body, Reservation, Traveller, Yielding};
use crate::right_of_way::zones::{MARGIN, Passage, Zone};

/// Room that is left behind a passage and between vehicles beside their lengths [m].
pub(super) const ROOM: f64 = 1.0;
/// Others expect that it keeps its speed, or accelerates so [m/s²] up to this speed [m/s]; if it is faster, it is told not
/// to arrive before they have left. One that goes first is not held back, so it may become faster, by so much [m/s].
const EXPECTED_ACCELERATION: f64 = 1.0;
const EXPECTED_SPEED: f64 = 3.0;
const EXPECTED_GAIN: f64 = 2.0;
/// The share of the speed in a passage of a late exit.
const SLOW: f64 = 0.9;
/// Leaders are expected to be at least this fast [m/s].
const LEADER_SPEED: f64 = 1.0;

impl Traveller<'_> {
    /// When it uses the zones of a passage that its rear has not left. One that can still stop before them requests them. It
    /// does not leave them before the body ahead, with its speed [m/s], has made room.
    pub(super) fn windows(
        &self,
        passage: &Passage,
        body: &Body,
        is_request: bool,
        leader: Option<(&Ahead, f64)>,
    ) -> Vec<Reservation> {
        let (velocity, front) = (body.velocity, self.front);
        let early = largest(passage, velocity);
        let expected = velocity.max(early.min(EXPECTED_SPEED));
        let late = (SLOW * passage.speed).max(velocity);
        let behind = if velocity < STANDSTILL_SPEED { 0.0 } else { MARGIN };
        let window = |zone: &Zone| {
            let (ahead, leaves) = (zone.entry - MARGIN - front, zone.exit + behind + body.length - front);
            let goes_first = is_request && !self.turns_on_red && zone.first == Some(true);
            let earliest = if goes_first {
                // One that starts or creeps will become faster.
                let most = if velocity > EXPECTED_SPEED { velocity + EXPECTED_GAIN } else { f64::INFINITY };
                travel_time(ahead, velocity, early.min(most), EXPECTED_ACCELERATION)
            } else {
                travel_time(ahead, velocity, early, EARLY_ACCELERATION)
            };
            let enter = match is_request {
                true => travel_time(ahead, velocity, expected, EXPECTED_ACCELERATION),
                false => earliest,
            };
            let leave = travel_time(leaves, velocity, late, LATE_ACCELERATION);
            let leave = leader.map_or(leave, |(Ahead { rear, .. }, speed)| {
                leave.max((zone.exit + MARGIN + body.length + ROOM - rear) / speed.max(LEADER_SPEED))
            });
            let yielding = Yielding::No;
            (leaves > 0.0).then_some(Reservation {
                zone: *zone,
                enter,
                earliest,
                leave,
                body: self.body,
                is_request,
                yielding,
            })
        };
        let mut windows = Vec::with_capacity(passage.zones.len());
        windows.extend(passage.zones.iter().filter_map(window));
        windows
    }

    /// Time until it can be at the entry line [s].
    pub(super) fn arrival(&self, passage: &Passage, body: &Body) -> f64 {
        travel_time(passage.entry_line - self.front, body.velocity, largest(passage, body.velocity), EARLY_ACCELERATION)
    }
}

/// Largest speed on the way to a passage [m/s].
fn largest(passage: &Passage, velocity: f64) -> f64 {
    passage.approach.min(passage.speed.max(velocity))
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
