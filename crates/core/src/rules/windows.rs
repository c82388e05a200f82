//! When a vehicle uses the areas of its passage.

use super::course::{Crossed, MARGIN, Passage};
use super::meeting::{Ahead, Body, Meeting, Reservation, Seen, Traveller, Yielding};
use super::room::ROOM;
use crate::conduct::STANDSTILL_SPEED;
use crate::junctions::Junctions;

/// Acceleration of the earliest entry that a vehicle is capable of in traffic [m/s²].
pub(crate) const EARLY_ACCELERATION: f64 = 2.0;
/// Others expect that it keeps its speed, or accelerates so [m/s²] up to this speed [m/s]; if it is faster, it is told not
/// to arrive before they have left. One that goes first is not held back, so it may become faster, by so much [m/s].
const EXPECTED_ACCELERATION: f64 = 1.0;
const EXPECTED_SPEED: f64 = 3.0;
const EXPECTED_GAIN: f64 = 2.0;
/// Acceleration of a late exit [m/s²], and the share of the speed there.
pub(crate) const LATE_ACCELERATION: f64 = 1.5;
const SLOW: f64 = 0.9;
/// A vehicle that stands needs so long to start [s], below this speed [m/s].
const REACTION: f64 = 0.3;
const REACTING: f64 = 0.5;
/// Leaders are expected to be at least this fast [m/s].
const LEADER_SPEED: f64 = 1.0;

/// Time for a distance [m] from a speed [m/s], with an acceleration [m/s²] up to a largest speed [m/s].
pub(crate) fn travel_time(distance: f64, velocity: f64, largest: f64, acceleration: f64) -> f64 {
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
    /// When it uses the areas of a passage that its rear has not left. One that can still stop before them requests them.
    fn windows(&self, passage: &Passage, body: &Body, is_request: bool, junctions: &Junctions) -> Vec<Reservation> {
        let (velocity, front) = (body.velocity, self.front);
        let early = largest(passage, velocity);
        let expected = velocity.max(early.min(EXPECTED_SPEED));
        let late = (SLOW * passage.speed).max(velocity);
        let behind = if velocity < STANDSTILL_SPEED { 0.0 } else { MARGIN };
        let window = |crossed: &Crossed| {
            let (ahead, leaves) = (crossed.entry - MARGIN - front, crossed.exit + behind + body.length - front);
            let goes_first =
                is_request && !self.turns_on_red && junctions.areas[crossed.area].first == Some(crossed.side);
            let earliest = if goes_first {
                // One that starts or creeps will become faster.
                let most = if velocity > EXPECTED_SPEED { velocity + EXPECTED_GAIN } else { f64::INFINITY };
                travel_time(ahead, velocity, early.min(most), EXPECTED_ACCELERATION)
            } else {
                travel_time(ahead, velocity, early, EARLY_ACCELERATION)
            };
            (leaves > 0.0).then(|| Reservation {
                area: crossed.area,
                side: crossed.side,
                enter: if is_request {
                    travel_time(ahead, velocity, expected, EXPECTED_ACCELERATION)
                } else {
                    earliest
                },
                earliest,
                leave: travel_time(leaves, velocity, late, LATE_ACCELERATION),
                body: self.body,
                is_request,
                yielding: Yielding::No,
            })
        };
        passage.areas.iter().filter_map(window).collect()
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

impl Meeting<'_> {
    /// When a traveller uses the areas of a passage, as seen by an agent that sees these bodies. It does not leave them
    /// before the one ahead has made room.
    pub(super) fn windows(
        &self,
        index: usize,
        passage: &Passage,
        is_request: bool,
        seen: &Seen<'_>,
    ) -> Vec<Reservation> {
        let traveller = &self.travellers[index];
        let body = &self.bodies[traveller.body];
        let mut windows = traveller.windows(passage, body, is_request, self.junctions);
        let Some(&Ahead { rear, body: leader, .. }) = seen.ahead(index, traveller.front).next() else { return windows };
        let speed = self.bodies[leader].velocity.max(LEADER_SPEED);
        for window in &mut windows {
            let is_its = |crossed: &&Crossed| (crossed.area, crossed.side) == (window.area, window.side);
            let exit = passage.areas.iter().find(is_its).map_or(f64::NEG_INFINITY, |crossed| crossed.exit);
            window.leave = window.leave.max((exit + MARGIN + body.length + ROOM - rear) / speed);
        }
        windows
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
