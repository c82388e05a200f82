//! Conflict zones: ground that two sides share. On the way of an agent they form passages, between places where it can
//! stand without being in any of them.

use std::sync::Arc;

use crate::junctions::{Area, AreaKind, Junctions};
use crate::road::RoadNetwork;
use crate::route::{FOOT_WINDOW, PathPiece, Route};
use crate::rules::SpeedLimits;
use crate::vehicle::Vehicle;

/// Width of a car [m]: areas are made for it, and vehicles of unknown width are taken to have it.
pub const DESIGN_WIDTH: f64 = 1.8;
/// Vehicles that meet need this more than their widths [m].
const MEETING_MARGIN: f64 = 0.4;
/// Agents ask from this far on: this time at the present speed [s], at least this distance [m].
pub const REACH_TIME: f64 = 8.0;
/// See [`REACH_TIME`].
pub const REACH: f64 = 60.0;
/// Vehicles keep this distance from an area [m], on either side.
pub(crate) const MARGIN: f64 = 0.3;
/// Agents stop this far before a passage [m]; to see more, they come nearer by so much [m].
pub(super) const GAP: f64 = 0.5;
pub(super) const PEEK: f64 = GAP - 0.1;
/// The path runs along a lanelet if it is within this distance of its middle [m].
const ASIDE_MAX: f64 = 1.5;
/// Where no speed limit is known, no vehicle is expected to be faster in a junction than this, unless it is already [m/s].
pub const SPEED_MAX: f64 = 15.0;
/// Lateral acceleration in bends, if the vehicle can [m/s²]: what agents do not exceed, so none arrives earlier than expected.
const LATERAL: f64 = 4.0;
/// More than the usual gaps before areas where a sign says so [s].
pub(super) const SIGN_LEAD: f64 = 0.5;

/// Agents ask for passages up to this far ahead [m].
pub(crate) fn reach(velocity: f64) -> f64 {
    REACH.max(REACH_TIME * velocity)
}

/// A conflict zone as one of its two sides sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Zone {
    /// Position in `Junctions::areas`.
    pub area: usize,
    /// The own side (0 or 1).
    pub side: usize,
    /// Arc length on the way at which it begins [m].
    pub entry: f64,
    /// ... and at which it ends [m].
    pub exit: f64,
    /// How the ways meet.
    pub(super) kind: AreaKind,
    /// By the map the own side goes first; `None`: the first to arrive.
    pub(super) first: Option<bool>,
    /// What two vehicles have beside each other [m].
    width: f64,
    /// By a sign the own side waits.
    has_sign: bool,
    /// Number of the junction.
    junction: usize,
}

impl Zone {
    /// Of a side of an area of the map, from one arc length of a way to another [m].
    pub fn of((index, area): (usize, &Area), side: usize, (entry, exit): (f64, f64)) -> Self {
        let &Area { kind, first, width, junction, .. } = area;
        let (first, has_sign) = (first.map(|first| first == side), area.waits_for_a_sign(side));
        Self { area: index, side, entry, exit, kind, first, width, has_sign, junction }
    }

    /// Of two agents whose ways share ground beyond the areas of the map; the first to arrive goes first.
    pub(crate) fn between(number: usize, side: usize, (entry, exit): (f64, f64)) -> Self {
        let (kind, width) = (AreaKind::Cross, f64::INFINITY);
        Self { area: number, side, entry, exit, kind, first: None, width, has_sign: false, junction: number }
    }

    /// They share ground.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.area == other.area && self.side != other.side
    }

    /// Two vehicles of these widths together [m] can use it only one after the other.
    pub(super) fn conflicts(&self, widths: f64) -> bool {
        self.kind != AreaKind::Opposed || widths + MEETING_MARGIN > self.width
    }
}

/// Width of a vehicle that can meet a car in an area [m]; -inf where vehicles cannot meet.
pub fn meeting_width(area: &Area) -> f64 {
    if area.kind == AreaKind::Opposed { area.width - MEETING_MARGIN - DESIGN_WIDTH } else { f64::NEG_INFINITY }
}

/// Zones between two places where the vehicle can stand without being in any of them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Passage {
    /// Its place among all passages of the way.
    pub number: usize,
    /// Its zones, by where they begin.
    pub zones: Vec<Zone>,
    /// Arc length that the front does not pass before the vehicle may go [m].
    pub entry_line: f64,
    /// Arc length from which on the rear is in none of the areas [m].
    pub end: f64,
    /// Speed in the passage [m/s], and before it.
    pub(super) speed: f64,
    pub(super) approach: f64,
    /// Lanelet at its end.
    pub(super) exit: usize,
    /// A sign says that it waits: it leaves larger gaps [s].
    pub(super) extra_lead: f64,
    pub(super) junctions: Vec<usize>,
}

/// A place on a lanelet and how far the front is ahead of it [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// Index of the lanelet.
    pub lanelet: usize,
    /// Arc length there [m].
    pub s: f64,
    /// From there to the front [m].
    pub to_front: f64,
}

/// The conflict zones on the reference path of an agent.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Course {
    /// The pieces of its path in driving order.
    pub pieces: Arc<[PathPiece]>,
    /// Its passages in driving order.
    pub passages: Vec<Passage>,
}

impl Course {
    /// Of a route, for a vehicle.
    pub fn along(
        route: &Route,
        (road, junctions): (&RoadNetwork, &Junctions),
        limits: &SpeedLimits,
        vehicle: &Vehicle,
    ) -> Self {
        let &Vehicle { length, width, .. } = vehicle;
        let path = &route.path;
        let pieces = &route.pieces;
        let wider = 0.5 * (width - DESIGN_WIDTH).max(0.0);
        let mut zones: Vec<Zone> = Vec::new();
        for piece in pieces {
            let lanelet = &road.lanelets()[piece.lanelet];
            let scale = (piece.end - piece.start) / lanelet.length;
            for &(index, side) in junctions.of_lanelet(piece.lanelet) {
                let area = &junctions.areas[index];
                let stretch = area.sides[side];
                let middle = 0.5 * (stretch.entry + stretch.exit);
                let foot = path.project_near(lanelet.center.at(middle), piece.start + scale * middle, FOOT_WINDOW);
                let (first, last) = (piece.start + scale * stretch.entry, piece.start + scale * stretch.exit);
                let is_there = match piece.is_cut() {
                    true => first < piece.to && last > piece.from,
                    false => foot.is_some_and(|(_, d)| d.abs() <= ASIDE_MAX),
                };
                let zone = Zone::of((index, area), side, (first - wider, last + wider));
                // Agents leave the road at their goals; without a place as goal it is not a number.
                let is_beyond_goal = zone.entry > route.goal_exit_s + length;
                if is_there && zone.conflicts(width + DESIGN_WIDTH) && !is_beyond_goal && !area.is_side_by_side {
                    zones.push(zone);
                }
            }
        }
        zones.sort_by(|a, b| a.entry.total_cmp(&b.entry).then(a.area.cmp(&b.area)));
        let mut groups: Vec<(f64, Vec<Zone>)> = Vec::new();
        for zone in zones {
            match groups.last_mut() {
                Some((end, group)) if zone.entry - *end < length + 2.0 * MARGIN => {
                    *end = end.max(zone.exit);
                    group.push(zone);
                }
                _ => groups.push((zone.exit, vec![zone])),
            }
        }
        let passage = |(number, (end, zones)): (usize, (f64, Vec<Zone>))| {
            let (entry_line, end) = (zones[0].entry - MARGIN, end + MARGIN);
            let speed = speed((route, limits, vehicle), (entry_line, end));
            let mut numbers: Vec<usize> = zones.iter().map(|zone| zone.junction).collect();
            numbers.sort_unstable();
            numbers.dedup();
            let there = pieces.iter().find(|piece| end <= piece.end).or(pieces.last());
            Passage {
                number,
                entry_line,
                end,
                speed,
                approach: limits.at(entry_line).min(SPEED_MAX),
                exit: there.map_or(usize::MAX, |piece| piece.lanelet),
                extra_lead: if zones.iter().any(|zone| zone.has_sign) { SIGN_LEAD } else { 0.0 },
                junctions: numbers,
                zones,
            }
        };
        Self { passages: groups.into_iter().enumerate().map(passage).collect(), pieces: Arc::from(&**pieces) }
    }

    /// Where a front at an arc length, and the rear behind it, are [m].
    pub(crate) fn places(&self, front: f64, length: f64) -> Vec<Place> {
        let at = |to_front: f64| {
            let (lanelet, s) = self.lanelet_at(front - to_front)?;
            Some(Place { lanelet, s, to_front })
        };
        [at(0.0), at(length)].into_iter().flatten().collect()
    }

    /// Adds a zone, to the passage that it belongs to or as one of its own with a number.
    pub(crate) fn add(&mut self, zone: Zone, number: usize, way: (&Route, &SpeedLimits, &Vehicle)) {
        let (entry_line, end) = (zone.entry - MARGIN, zone.exit + MARGIN);
        let (approach, speed) = (way.1.at(entry_line).min(SPEED_MAX), speed(way, (entry_line, end)));
        let room = way.2.length;
        let is_near = |one: &&mut Passage| entry_line < one.end + room && one.entry_line < end + room;
        if let Some(passage) = self.passages.iter_mut().find(is_near) {
            (passage.entry_line, passage.end) = (passage.entry_line.min(entry_line), passage.end.max(end));
            passage.speed = passage.speed.min(speed);
            passage.zones.push(zone);
            passage.junctions.push(zone.junction);
            return;
        }
        let exit = self.lanelet_at(end).map_or(usize::MAX, |(lanelet, _)| lanelet);
        let (junctions, zones) = (vec![zone.junction], vec![zone]);
        let place = self.passages.partition_point(|passage| passage.entry_line < entry_line);
        let passage = Passage { number, zones, entry_line, end, speed, approach, exit, extra_lead: 0.0, junctions };
        self.passages.insert(place, passage);
    }

    /// The same with some of its zones only, and the passages that have any of these.
    pub fn filtered(&self, is_wanted: impl Fn(&Zone) -> bool) -> Self {
        let of = |passage: &Passage| {
            let zones: Vec<Zone> = passage.zones.iter().filter(|zone| is_wanted(zone)).copied().collect();
            let junctions = zones.iter().map(|zone| zone.junction).collect();
            (!zones.is_empty()).then(|| Passage { zones, junctions, ..passage.clone() })
        };
        Self { passages: self.passages.iter().filter_map(of).collect(), pieces: Arc::clone(&self.pieces) }
    }

    /// First passage that a rear at an arc length [m] has not left.
    pub fn first_passage(&self, rear: f64) -> usize {
        self.passages.partition_point(|passage| passage.end <= rear)
    }

    /// All zones in driving order.
    pub fn zones(&self) -> impl Iterator<Item = &Zone> {
        self.passages.iter().flat_map(|passage| &passage.zones)
    }

    /// Zones that a front at an arc length [m] has not entered, of passages whose entry line is within reach [m].
    pub fn zones_ahead(&self, front: f64, reach: f64) -> impl Iterator<Item = &Zone> {
        let near = move |passage: &&Passage| passage.end > front && passage.entry_line - front <= reach;
        let zones = self.passages.iter().filter(near).flat_map(|passage| &passage.zones);
        zones.filter(move |zone| zone.entry > front)
    }

    /// An agent with its front at an arc length [m] is near or in one of the passages, at its speed [m/s].
    pub fn is_near(&self, front: f64, velocity: f64, length: f64) -> bool {
        let reach = reach(velocity);
        self.passages.iter().any(|passage| passage.end > front - length && passage.entry_line - front <= reach)
    }

    /// Arc length on the path of a place on a lanelet [m], if the path leads over it, the first one from `from` on.
    pub(super) fn place(&self, lanelet: usize, s: f64, from: f64) -> Option<f64> {
        let on = self.pieces.iter().filter(|piece| piece.lanelet == lanelet);
        on.map(|piece| (piece, piece.start + s)).find(|(piece, at)| *at >= from && piece.has(*at)).map(|found| found.1)
    }

    /// The lanelet at an arc length of the path, and the arc length there [m].
    pub fn lanelet_at(&self, s: f64) -> Option<(usize, f64)> {
        let piece = self.pieces.iter().rev().find(|piece| piece.start <= s && piece.has(s))?;
        Some((piece.lanelet, s - piece.start))
    }
}

/// The speed that a vehicle can have on a stretch of its path [m/s].
fn speed((route, limits, vehicle): (&Route, &SpeedLimits, &Vehicle), (from, to): (f64, f64)) -> f64 {
    let lateral = vehicle.cornering(LATERAL);
    let at = |s: f64| limits.at(s).min(SPEED_MAX).min((lateral / route.path.curvature_at(s).abs()).sqrt());
    let n = (to - from).ceil().max(1.0) as usize;
    (0..=n).map(|i| at(from + i as f64 * (to - from) / n as f64)).fold(f64::INFINITY, f64::min)
}
