//! Which part of an agent's path another one needs, too.

use super::{Negotiator, pose};
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, wrap_angle};
use crate::v2x::message::{PlanPoint, WAY_SPACING};

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

/// A stretch that two ways share.
pub(super) struct Overlap {
    /// Arc lengths on the agent's path [m].
    pub(super) ours: (f64, f64),
    /// How far the other one's front is before it, and its rear end before the end of it [m].
    pub(super) theirs: (f64, f64),
}

/// Another one and the way that is still before it.
pub(super) struct Theirs<'a> {
    way: &'a [PlanPoint],
    /// How far its rear end has come on this way [m].
    rear: f64,
    length: f64,
    width: f64,
    at: PlanPoint,
}

impl<'a> Theirs<'a> {
    /// Of the way that it sent, its length and width [m], and where it is now.
    pub(super) fn new(way: &'a [PlanPoint], (length, width): (f64, f64), at: PlanPoint) -> Self {
        let position = pose(&at).position;
        let foot = |(i, pair): (usize, &[PlanPoint])| {
            let along = between(&pair[0], &pair[1], 0.0);
            let s = (position - along.center).dot(along.axis).clamp(-along.half_length, along.half_length);
            (position.distance(along.center + along.axis * s), i as f64 * WAY_SPACING + along.half_length + s)
        };
        let nearest = way.windows(2).enumerate().map(foot).min_by(|a, b| a.0.total_cmp(&b.0));
        let rear = (nearest.map_or(0.0, |(_, s)| s) - 0.5 * length).max(0.0);
        let gone = ((rear / WAY_SPACING) as usize).min(way.len() - 1);
        Self { way: &way[gone..], rear: rear - gone as f64 * WAY_SPACING, length, width, at }
    }
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
    pub(super) fn only_merges(&self, agent: &Negotiator<'_>, way: &[PlanPoint], velocity: f64) -> bool {
        agent.velocity.min(velocity) > MERGING && {
            let (low, high) = range(way.iter().map(|point| point.orientation), agent.pose.orientation);
            high - self.headings.0 < SAME_HEADING - ROUNDING && self.headings.1 - low < SAME_HEADING - ROUNDING
        }
    }

    /// The stretch that both need; `None` if there is none, or one follows the other.
    pub(super) fn overlap(&self, agent: &Negotiator<'_>, theirs: &Theirs<'_>) -> Option<Overlap> {
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
            let meets =
                |other: &OrientedBox| other.overlaps(own) && !agent.storeys.are_apart_at(|| (other.pose(), own.pose()));
            if let Some(first) = boxes.iter().position(meets) {
                let other = &boxes[first];
                match &mut run {
                    None => run = Some((k, k)),
                    Some((_, last)) if (k - *last) as f64 * STATION <= GAP + STATION => *last = k,
                    Some(_) => break,
                }
                enters = enters.min(first);
                leaves = boxes.iter().rposition(meets).unwrap_or(first).max(leaves);
                is_same &= wrap_angle(other.axis.angle() - own.axis.angle()).abs() <= SAME_HEADING;
            }
            k += 1;
        }
        let (first, last) = run?;
        let begin = agent.rear + first as f64 * STATION;
        let from_rear = |boxes: usize| boxes as f64 * WAY_SPACING - theirs.rear;
        let enters = from_rear(enters);
        if !is_same {
            let end = agent.rear + (last + 1) as f64 * STATION;
            return Some(Overlap { ours: (begin, end), theirs: (enters - theirs.length, from_rear(leaves + 1)) });
        }
        // Those that drive merge by their plans, which both know; holding would only slow them down.
        let drives = agent.velocity.min(theirs.at.velocity) > MERGING;
        // The agent may follow once the other one is ahead of it, but leaves more road to one that follows.
        let merge = Overlap { ours: (begin, begin + MERGE), theirs: (enters - theirs.length, enters) };
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
