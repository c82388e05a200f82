//! The road that an agent needs together with another one, and when both are there.

use super::lane::Neighbour;
use super::order::common;
use super::overlap::{Overlap, Own, Theirs};
use super::{CLAIM_DISTANCE, Negotiator, ROOM, Situation, plans};
use crate::barrier::{Barrier, BarrierReason};
use crate::conduct::COMFORTABLE_DECELERATION;
use crate::conduct::{EARLY_ACCELERATION, LATE_ACCELERATION, travel_time};
use crate::geometry::Point;
use crate::right_of_way::{STICKY_LAG, STICKY_LEAD};
use crate::v2x::inbox::Inbox;
use crate::v2x::message::{Claim, Payload, PlanPoint};
use crate::v2x::trigger::interpolated;

/// Slower vehicles accelerate to this speed [m/s] on their way through a zone.
const PASSING: f64 = 6.0;
/// An agent that has left a zone so long before another one can enter it [s] need not hold for it ...
const LEAD: f64 = 0.5;
/// ... and neither need one that enters it so long after the other one has left it [s].
const LAG: f64 = 0.3;

/// A stretch of an agent's path that another one needs, too [m].
#[derive(Debug, Clone, Copy)]
pub(super) struct Zone {
    /// The other one.
    pub(super) id: i64,
    pub(super) begin: f64,
    pub(super) end: f64,
    /// Begin and end of the passage that it belongs to.
    pub(super) passage: (f64, f64),
    /// When both are in it if they do not stop.
    pub(super) ours: Window,
    pub(super) theirs: Window,
    /// What the other one claims.
    pub(super) claim: Option<Claim>,
    /// The other one can no longer stop before it.
    pub(super) is_passed: bool,
}

impl Zone {
    /// Both would be in it at the same time, or nearly. An agent that has not held goes on with smaller gaps.
    pub(super) fn is_contested(&self, has_held: bool) -> bool {
        let (lead, lag) = if has_held { (LEAD, LAG) } else { (LEAD - STICKY_LEAD, LAG - STICKY_LAG) };
        self.ours.enter < self.theirs.leave + lag && self.theirs.enter < self.ours.leave + lead
    }

    /// How much later the agent has to come [s]; infinite if it is open when the other one goes.
    fn delay(&self) -> f64 {
        if self.is_passed { self.theirs.leave + LAG - self.ours.enter } else { f64::INFINITY }
    }
}

impl Zone {
    /// Before the nearest passage with one of these zones, until the agent comes too late for all of them.
    pub(super) fn barrier<'a>(agent: &Negotiator<'_>, zones: impl Iterator<Item = &'a Self>) -> Option<Barrier> {
        let later = |a: &&Self, b: &&Self| {
            b.passage.0.total_cmp(&a.passage.0).then(a.delay().total_cmp(&b.delay())).then(b.id.cmp(&a.id))
        };
        let zone = zones.max_by(later)?;
        let s = zone.passage.0;
        let enter = Window::of((s - agent.front, 0.0), agent.velocity).enter;
        Some(Barrier { s, until: enter + zone.delay(), reason: BarrierReason::Agreement, by: Some(zone.id) })
    }
}

/// When a vehicle is in a zone: from the earliest time at which its front enters it to the latest one at which its rear end
/// leaves it, if it does not stop [s from now].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    pub(super) enter: f64,
    pub(super) leave: f64,
}

impl Window {
    /// Of a vehicle whose front is so far before the zone, and its rear end so far before the end of it [m], at its speed
    /// [m/s].
    pub(super) fn of((to_enter, to_leave): (f64, f64), velocity: f64) -> Self {
        let time = |distance, acceleration| travel_time(distance, velocity, PASSING.max(velocity), acceleration);
        Self { enter: time(to_enter, EARLY_ACCELERATION), leave: time(to_leave, LATE_ACCELERATION) }
    }
}

/// The zones that an agent shares with others whose plans it received, by sender. `ours` are the areas on its way, `around`
/// are the participants that it sees.
pub(super) fn zones<'a>(
    agent: &Negotiator<'_>,
    ours: &[(usize, usize)],
    inbox: &Inbox,
    situation: &Situation<'_>,
    around: &dyn Fn() -> &'a [Neighbour],
) -> Vec<Zone> {
    let mut own: Option<Own> = None;
    let reach = CLAIM_DISTANCE + agent.velocity.powi(2) / (2.0 * COMFORTABLE_DECELERATION);
    let mut found = Vec::new();
    for (place, message) in plans(inbox, agent.place) {
        let Payload::Mcm { status, way, claim, spacing, points, passes, areas, is_ordered, .. } = &message.payload
        else {
            continue;
        };
        if agent.is_ordered && *is_ordered && common(ours, areas).next().is_some() {
            // The order of the rules decides about both.
            continue;
        }
        let far = reach + situation.settings.way_ahead;
        if points.is_empty() || way.len() < 2 {
            continue;
        }
        let age = (situation.now - message.time_step) as f64 * situation.dt;
        let planned = interpolated(points, *spacing, age);
        if agent.pose.position.distance(Point::new(planned.x, planned.y)) > far {
            continue;
        }
        let own = own.get_or_insert_with(|| Own::along(agent, reach));
        if own.only_merges(agent, way, planned.velocity) {
            continue;
        }
        // Its sensors know better than a message.
        let seen = around().iter().find(|other| other.place == Some(place));
        let at = seen.map_or(planned, |other| PlanPoint {
            x: other.pose.position.x,
            y: other.pose.position.y,
            orientation: other.pose.orientation,
            velocity: other.velocity,
        });
        if let Some(Overlap { ours: (begin, end), theirs }) =
            own.overlap(agent, &Theirs::new(way, (status.length, status.width), at))
        {
            let ours = Window::of((begin - agent.front, end - agent.rear), agent.velocity);
            let is_passed = theirs.0 <= 0.0 || passes.contains(&agent.id);
            let theirs = Window::of(theirs, at.velocity);
            let (id, passage) = (message.sender, (begin, end));
            found.push(Zone { id, begin, end, passage, ours, theirs, claim: *claim, is_passed });
        }
    }
    join(&mut found, agent.extent.0 + ROOM);
    found
}

/// Joins zones to passages: between two of these there is room to stand [m].
fn join(zones: &mut [Zone], room: f64) {
    let mut order: Vec<usize> = (0..zones.len()).collect();
    order.sort_by(|a, b| zones[*a].begin.total_cmp(&zones[*b].begin));
    let mut passages: Vec<(f64, f64)> = Vec::new();
    for zone in order.iter().map(|i| &zones[*i]) {
        match passages.last_mut() {
            Some((_, end)) if zone.begin < *end + room => *end = end.max(zone.end),
            _ => passages.push((zone.begin, zone.end)),
        }
    }
    for zone in zones {
        let within = passages.iter().rfind(|(begin, _)| *begin <= zone.begin);
        zone.passage = *within.expect("every zone is in a passage");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_lasts_from_the_earliest_entry_to_the_latest_exit() {
        // At 10 m/s the speed stays; from 2 to 6 m/s it needs 2 s and 8 m, or 2.67 s and 10.67 m.
        assert_eq!(Window::of((20.0, 35.0), 10.0), Window { enter: 2.0, leave: 3.5 });
        let slow = Window::of((8.0, 20.0), 2.0);
        assert!((slow.enter - 2.0).abs() < 1e-9 && (slow.leave - (8.0 / 3.0 + 28.0 / 3.0 / 6.0)).abs() < 1e-9);
        assert_eq!(Window::of((-1.0, -0.5), 10.0), Window { enter: 0.0, leave: 0.0 }, "it has left");
    }

    #[test]
    fn zones_between_which_there_is_no_room_to_stand_are_one_passage() {
        let nowhere = Window { enter: 0.0, leave: 0.0 };
        let zone = |(begin, end)| Zone {
            id: 1,
            begin,
            end,
            passage: (begin, end),
            ours: nowhere,
            theirs: nowhere,
            claim: None,
            is_passed: false,
        };
        let mut zones = [(20.0, 24.0), (50.0, 55.0), (10.0, 22.0), (30.0, 32.0)].map(zone);
        join(&mut zones, 7.0);
        assert_eq!(zones.map(|zone| zone.passage), [(10.0, 32.0), (50.0, 55.0), (10.0, 32.0), (10.0, 32.0)]);
    }

    #[test]
    fn a_zone_is_contested_unless_one_leaves_it_before_the_other_enters() {
        let ours = Window { enter: 2.0, leave: 3.0 };
        let contested = |enter, leave, has_held| {
            let theirs = Window { enter, leave };
            let passage = (0.0, 1.0);
            Zone { id: 1, begin: 0.0, end: 1.0, passage, ours, theirs, claim: None, is_passed: false }
                .is_contested(has_held)
        };
        assert!(contested(2.5, 4.0, true) && contested(0.0, 9.0, true));
        assert!(contested(3.4, 5.0, true) && !contested(3.6, 5.0, true), "it has left so long before");
        assert!(contested(0.0, 1.8, true) && !contested(0.0, 1.6, true), "it arrives so long after");
        assert!(!contested(3.4, 5.0, false) && !contested(0.0, 1.8, false), "it goes on");
    }
}
