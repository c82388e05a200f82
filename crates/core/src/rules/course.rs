//! The areas that an agent drives through on its way, in passages between places where it can stand.

use super::SpeedLimits;
use crate::junctions::{AreaKind, Junctions};
use crate::road::RoadNetwork;
use crate::route::{PathPiece, Route};
use crate::vehicle::Vehicle;

/// The areas are made for vehicles of this width [m].
pub const DESIGN_WIDTH: f64 = 1.8;
/// Vehicles that meet need this more than their widths [m].
pub const MEETING_MARGIN: f64 = 0.4;
/// Agents ask from this far on: this time at the present speed [s], at least this distance [m].
pub const REACH_TIME: f64 = 8.0;
/// See [`REACH_TIME`].
pub const REACH: f64 = 60.0;
/// Vehicles keep this distance from an area [m], on either side.
pub(super) const MARGIN: f64 = 0.3;
/// Agents stop this far before a passage [m]; to see more, they come nearer by so much [m].
pub(super) const GAP: f64 = 0.5;
pub(super) const PEEK: f64 = GAP - 0.1;
/// The path runs along a lanelet if it is within this distance of its middle [m].
const ASIDE_MAX: f64 = 1.5;
/// A lanelet is found this far around where it is expected [m].
const WINDOW: f64 = 25.0;
/// Where no speed limit is known, no vehicle is expected to be faster in a junction than this, unless it is already [m/s].
pub const SPEED_MAX: f64 = 15.0;
/// Lateral acceleration in bends, if the vehicle can [m/s²]: that of the planners' defaults.
const LATERAL: f64 = 4.0;
/// More than the usual gaps before areas where a sign says so [s].
pub(super) const SIGN_LEAD: f64 = 0.5;

/// Agents ask for passages up to this far ahead [m].
pub(crate) fn reach(velocity: f64) -> f64 {
    REACH.max(REACH_TIME * velocity)
}

/// An area on the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossed {
    /// Position in `Junctions::areas`, and the own side.
    pub(super) area: usize,
    pub(super) side: usize,
    /// Arc lengths on the path [m].
    pub(super) entry: f64,
    pub(super) exit: f64,
}

/// Areas between two places where the vehicle can stand without being in any of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Passage {
    pub(super) areas: Vec<Crossed>,
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

/// What arbitration knows about the reference path of an agent.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Course {
    /// The pieces of its path in driving order.
    pub pieces: Vec<PathPiece>,
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
        let lateral = vehicle.cornering(LATERAL);
        let path = &route.path;
        let pieces = &route.pieces;
        let wider = 0.5 * (width - DESIGN_WIDTH).max(0.0);
        let mut areas: Vec<Crossed> = Vec::new();
        for piece in pieces {
            let lanelet = &road.lanelets()[piece.lanelet];
            let scale = (piece.end - piece.start) / lanelet.length;
            for &(index, side) in junctions.of_lanelet(piece.lanelet) {
                let area = &junctions.areas[index];
                let stretch = area.sides[side];
                let is_narrow = conflict(junctions, index, width + DESIGN_WIDTH);
                let middle = 0.5 * (stretch.entry + stretch.exit);
                let foot = path.project_near(lanelet.center.at(middle), piece.start + scale * middle, WINDOW);
                let (first, last) = (piece.start + scale * stretch.entry, piece.start + scale * stretch.exit);
                let is_there = match piece.is_cut() {
                    true => first < piece.to && last > piece.from,
                    false => foot.is_some_and(|(_, d)| d.abs() <= ASIDE_MAX),
                };
                let entry = first - wider;
                // Agents leave the road at their goals; without a place as goal it is not a number.
                let is_beyond_goal = entry > route.goal_exit_s + length;
                if is_there && is_narrow && !is_beyond_goal && !area.is_side_by_side {
                    areas.push(Crossed { area: index, side, entry, exit: last + wider });
                }
            }
        }
        areas.sort_by(|a, b| a.entry.total_cmp(&b.entry).then(a.area.cmp(&b.area)));
        let mut groups: Vec<(f64, Vec<Crossed>)> = Vec::new();
        for crossed in areas {
            match groups.last_mut() {
                Some((end, group)) if crossed.entry - *end < length + 2.0 * MARGIN => {
                    *end = end.max(crossed.exit);
                    group.push(crossed);
                }
                _ => groups.push((crossed.exit, vec![crossed])),
            }
        }
        let passage = |(end, areas): (f64, Vec<Crossed>)| {
            let (entry_line, end) = (areas[0].entry - MARGIN, end + MARGIN);
            let at = |s: f64| limits.at(s).min(SPEED_MAX).min((lateral / path.curvature_at(s).abs()).sqrt());
            let n = (end - entry_line).ceil().max(1.0) as usize;
            let speed = (0..=n)
                .map(|i| at(entry_line + i as f64 * (end - entry_line) / n as f64))
                .fold(f64::INFINITY, f64::min);
            let waits = |crossed: &Crossed| junctions.areas[crossed.area].waits_for_a_sign(crossed.side);
            let mut numbers: Vec<usize> = areas.iter().map(|crossed| junctions.areas[crossed.area].junction).collect();
            numbers.sort_unstable();
            numbers.dedup();
            let there = pieces.iter().find(|piece| end <= piece.end).or(pieces.last());
            Passage {
                entry_line,
                end,
                speed,
                approach: limits.at(entry_line).min(SPEED_MAX),
                exit: there.map_or(usize::MAX, |piece| piece.lanelet),
                extra_lead: if areas.iter().any(waits) { SIGN_LEAD } else { 0.0 },
                junctions: numbers,
                areas,
            }
        };
        Self { passages: groups.into_iter().map(passage).collect(), pieces: pieces.clone() }
    }

    /// All areas in driving order: number and own side, and the arc lengths where they begin and end [m].
    pub fn crossings(&self) -> impl Iterator<Item = (usize, usize, f64, f64)> {
        let all = self.passages.iter().flat_map(|passage| &passage.areas);
        all.map(|crossed| (crossed.area, crossed.side, crossed.entry, crossed.exit))
    }

    /// Areas, and the own side in each, that a front at an arc length [m] has not entered, of passages whose entry line is within
    /// reach [m].
    pub fn areas_ahead(&self, front: f64, reach: f64) -> impl Iterator<Item = (usize, usize)> {
        let near = move |passage: &&Passage| passage.end > front && passage.entry_line - front <= reach;
        let areas = self.passages.iter().filter(near).flat_map(|passage| &passage.areas);
        areas.filter(move |crossed| crossed.entry > front).map(|crossed| (crossed.area, crossed.side))
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

/// Two vehicles can use the area only one after the other.
pub(super) fn conflict(junctions: &Junctions, area: usize, widths: f64) -> bool {
    let area = &junctions.areas[area];
    area.kind != AreaKind::Opposed || widths + MEETING_MARGIN > area.width
}
