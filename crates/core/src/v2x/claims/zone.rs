//! Which part of an agent's path another one needs, too.

use super::{Negotiator, pose};
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, wrap_angle};
use crate::rules::{EARLY, LATE, travel_time};
use crate::v2x::message::{Claim, PlanPoint, WAY_SPACING};

/// Distance of the stations of an agent's own path [m].
const STATION: f64 = 1.0;
/// Room beside both vehicles [m].
const ROOM: f64 = 0.5;
/// Shorter gaps between shared stations are closed [m].
const GAP: f64 = 3.0;
/// Smaller angles are the same direction [rad].
const SAME_HEADING: f64 = std::f64::consts::PI / 3.0;
/// Headings of a way and directions between its points differ by less [rad].
const ROUNDING: f64 = 0.2;
/// Faster vehicles [m/s] need no agreement to merge.
const MERGING: f64 = 3.0;
/// Vehicles that merge share this much road [m].
const MERGE: f64 = 12.0;
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
    /// When both are in it if they do not stop.
    pub(super) ours: Window,
    pub(super) theirs: Window,
    /// What the other one claims.
    pub(super) claim: Option<Claim>,
}

impl Zone {
    /// Both would be in it at the same time, or nearly.
    pub(super) fn is_contested(&self) -> bool {
        self.ours.enter < self.theirs.leave + LAG && self.theirs.enter < self.ours.leave + LEAD
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
        Self { enter: time(to_enter, EARLY), leave: time(to_leave, LATE) }
    }
}

/// A stretch that two ways share [m].
pub(super) struct Shared {
    /// Arc lengths on the agent's path.
    pub(super) ours: (f64, f64),
    /// Arc lengths on the other one's way, from where its rear end was.
    pub(super) theirs: (f64, f64),
}

/// Way and width of another one, and where it is now.
pub(super) struct Theirs<'a> {
    pub(super) way: &'a [PlanPoint],
    pub(super) width: f64,
    pub(super) at: PlanPoint,
}

/// Stations of an agent's own path, from its rear end on.
pub(super) struct Own {
    stations: Vec<OrientedBox>,
    /// Least and largest heading of the path, relative to the agent's own [rad].
    headings: (f64, f64),
}

impl Own {
    pub(super) fn along(agent: &Negotiator<'_>, reach: f64) -> Self {
        let n = ((agent.front + reach - agent.rear) / STATION).ceil().max(1.0) as usize;
        let station = |k: usize| {
            let at = agent.path.at(agent.rear + (k as f64 + 0.5) * STATION);
            let half_width = 0.5 * (agent.extent.1 + ROOM);
            OrientedBox { center: at.position, axis: at.tangent(), half_length: 0.5 * STATION, half_width }
        };
        let thetas = (0..n.div_ceil(4) + 1).map(|k| agent.path.at(agent.rear + (4 * k) as f64 * STATION).theta);
        let headings = range(thetas, agent.pose.orientation);
        Self { stations: (0..n).map(station).collect(), headings }
    }

    /// Both drive, and neither path turns so far that they could meet but side by side.
    pub(super) fn only_merges(&self, agent: &Negotiator<'_>, theirs: &Theirs<'_>) -> bool {
        let drives = agent.velocity.min(theirs.at.velocity) > MERGING;
        drives && {
            let (low, high) = range(theirs.way.iter().map(|point| point.orientation), agent.pose.orientation);
            high - self.headings.0 < SAME_HEADING - ROUNDING && self.headings.1 - low < SAME_HEADING - ROUNDING
        }
    }

    /// The stretch that both need; `None` if there is none, or one follows the other.
    pub(super) fn shared(&self, agent: &Negotiator<'_>, theirs: &Theirs<'_>) -> Option<Shared> {
        let half_width = 0.5 * (theirs.width + ROOM);
        let boxes: Vec<OrientedBox> =
            theirs.way.windows(2).map(|pair| between(&pair[0], &pair[1], half_width)).collect();
        let reach = 0.5 * STATION + 2.0 + half_width + self.stations[0].half_width + 2.0;
        let mut run: Option<(usize, usize)> = None;
        let (mut is_same, mut enters, mut leaves) = (true, usize::MAX, 0);
        let mut k = 0;
        while k < self.stations.len() {
            let own = &self.stations[k];
            let nearest = boxes.iter().map(|other| other.center.distance(own.center)).fold(f64::INFINITY, f64::min);
            if nearest > reach + 2.0 * STATION {
                // Neither this station nor any that lies nearer than the difference.
                k += ((nearest - reach) / STATION) as usize;
                continue;
            }
            if let Some(first) = boxes.iter().position(|other| other.overlaps(own)) {
                let other = &boxes[first];
                match &mut run {
                    None => run = Some((k, k)),
                    Some((_, last)) if (k - *last) as f64 * STATION <= GAP + STATION => *last = k,
                    Some(_) => break,
                }
                enters = enters.min(first);
                leaves = boxes.iter().rposition(|other| other.overlaps(own)).unwrap_or(first).max(leaves);
                is_same &= wrap_angle(other.axis.angle() - own.axis.angle()).abs() <= SAME_HEADING;
            }
            k += 1;
        }
        let (first, last) = run?;
        let begin = agent.rear + first as f64 * STATION;
        let enters = enters as f64 * WAY_SPACING;
        if !is_same {
            let end = agent.rear + (last + 1) as f64 * STATION;
            return Some(Shared { ours: (begin, end), theirs: (enters, (leaves + 1) as f64 * WAY_SPACING) });
        }
        // Those that drive merge by their plans, which both know; holding would only slow them down.
        let drives = agent.velocity.min(theirs.at.velocity) > MERGING;
        let merge = Shared { ours: (begin, begin + MERGE), theirs: (enters, enters + MERGE) };
        (!drives && !self.follows(agent, theirs, half_width)).then_some(merge)
    }

    /// One of the two is already in the other's corridor, ahead of it.
    fn follows(&self, agent: &Negotiator<'_>, theirs: &Theirs<'_>, half_width: f64) -> bool {
        let wide = half_width + self.stations[0].half_width - ROOM;
        let other = pose(&theirs.at).position;
        let is_within = |corridor: &OrientedBox, point: Point, half_length: f64| {
            let offset = point - corridor.center;
            offset.dot(corridor.axis).abs() <= half_length && corridor.axis.cross(offset).abs() < wide
        };
        let heads_alike = wrap_angle(theirs.at.orientation - agent.pose.orientation).abs() <= SAME_HEADING;
        heads_alike
            && (self.stations.iter().any(|station| is_within(station, other, STATION))
                || theirs
                    .way
                    .windows(2)
                    .any(|pair| is_within(&between(&pair[0], &pair[1], half_width), agent.pose.position, 2.5)))
    }
}

/// Least and largest angle, relative to another one [rad].
fn range(angles: impl Iterator<Item = f64>, from: f64) -> (f64, f64) {
    angles
        .map(|angle| wrap_angle(angle - from))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), angle| (low.min(angle), high.max(angle)))
}

/// The box from a point of a way to the next one.
fn between(from: &PlanPoint, to: &PlanPoint, half_width: f64) -> OrientedBox {
    let (a, b) = (Point::new(from.x, from.y), Point::new(to.x, to.y));
    let (way, length) = (b - a, a.distance(b));
    let axis = if length > 1e-6 { way * (1.0 / length) } else { Point::from_angle(from.orientation) };
    OrientedBox { center: (a + b) * 0.5, axis, half_length: 0.5 * length, half_width }
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
    fn a_zone_is_contested_unless_one_leaves_it_before_the_other_enters() {
        let ours = Window { enter: 2.0, leave: 3.0 };
        let contested = |enter, leave| {
            let theirs = Window { enter, leave };
            Zone { id: 1, begin: 0.0, end: 1.0, ours, theirs, claim: None }.is_contested()
        };
        assert!(contested(2.5, 4.0) && contested(0.0, 9.0));
        assert!(contested(3.4, 5.0) && !contested(3.6, 5.0), "it has left so long before");
        assert!(contested(0.0, 1.8) && !contested(0.0, 1.6), "it arrives so long after");
    }
}
