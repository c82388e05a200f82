//! The points of a path: lane centres, joined by blends where the lane changes.

use super::search::{GoalPlace, Step};
use super::{FOOT_WINDOW, RoadNetwork, RouteSettings};
use crate::geometry::Point;
use crate::geometry::polyline::Polyline;
use crate::limits::LANELET_CHAIN_MAX;

/// Spacing of the points of a blend [m].
const BLEND_SPACING: f64 = 1.0;
/// Blends shorter than this [m] are too abrupt: rather leave the shared stretch a little late.
const BLEND_LENGTH_MIN: f64 = 8.0;

/// Points of a path, and where on it start and goal are.
#[derive(Debug)]
pub(super) struct Corridor {
    pub(super) points: Vec<Point>,
    /// The lanelets in which the points lie, in their order.
    pub(super) lanelets: Vec<Stretch>,
    /// Arc length of the start along the points [m].
    pub(super) start_hint: f64,
    /// Arc length of the end of the goal area along the points [m]; that of the last lanelet without a goal.
    pub(super) goal_hint: f64,
}

/// A lanelet in which the points of a corridor lie.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub(super) lanelet: usize,
    /// Arc length of its start along the points, or beside them [m].
    pub(super) start: f64,
    /// Where the lane changes into it: the place, and its arc length along the points [m].
    pub(super) changed: Option<(Point, f64)>,
}

/// A stretch along one lane: lanelets that follow each other, with the station of each. Lanelets side by side have the
/// same station.
struct Leg {
    first_station: usize,
    lanelets: Vec<usize>,
}

/// A leg's centre line with the arc length at which each lanelet starts, and the end.
struct LegLine {
    line: Polyline,
    offsets: Vec<f64>,
}

impl Leg {
    fn end_station(&self) -> usize {
        self.first_station + self.lanelets.len()
    }

    fn at(&self, station: usize) -> Option<usize> {
        station.checked_sub(self.first_station).and_then(|i| self.lanelets.get(i).copied())
    }

    fn line(&self, road: &RoadNetwork) -> LegLine {
        let mut points: Vec<Point> = Vec::new();
        let mut offsets = Vec::with_capacity(self.lanelets.len() + 1);
        let mut length = 0.0;
        for &lanelet in &self.lanelets {
            let center = &road.lanelets()[lanelet].center;
            length += points.last().map_or(0.0, |last| last.distance(center.points()[0]));
            offsets.push(length);
            length += center.length();
            points.extend_from_slice(center.points());
        }
        offsets.push(length);
        LegLine { line: Polyline::new(&points).expect("a lanelet's centre line has a length"), offsets }
    }
}

impl LegLine {
    /// The lanelets of a leg between two arc lengths [m], the first one with where the lane changed into it; the leg begins
    /// at an arc length `base` of the corridor's points [m].
    fn between(
        &self,
        leg: &Leg,
        (from, to): (f64, f64),
        base: f64,
        changed: Option<(Point, f64)>,
    ) -> impl Iterator<Item = Stretch> {
        let at = |s: f64| self.offsets[1..leg.lanelets.len()].partition_point(|end| *end <= s);
        let first = at(from);
        (first..=at(to.max(from))).map(move |i| Stretch {
            lanelet: leg.lanelets[i],
            start: base + self.offsets[i],
            changed: changed.filter(|_| i == first),
        })
    }
}

/// Lanelets beside each other in the same direction.
fn are_neighbours(road: &RoadNetwork, a: usize, b: usize) -> bool {
    let lanelet = &road.lanelets()[a];
    [lanelet.adjacent_left, lanelet.adjacent_right].contains(&Some((b, true)))
}

/// Splits the steps at the lane changes and lengthens each leg as far as its lane runs beside the next (or last) one,
/// so that a blend may use all of the stretch that both lanes share.
fn legs(road: &RoadNetwork, steps: &[Step]) -> Vec<Leg> {
    let mut legs: Vec<Leg> = Vec::new();
    for step in steps {
        match legs.last_mut() {
            Some(leg) if !step.is_change => leg.lanelets.push(step.lanelet),
            last => {
                let first_station = last.map_or(0, |leg| leg.end_station() - 1);
                legs.push(Leg { first_station, lanelets: vec![step.lanelet] });
            }
        }
    }
    for i in (0..legs.len().saturating_sub(1)).rev() {
        while let Some(beside) = legs[i + 1].at(legs[i].end_station()) {
            let last = legs[i].lanelets[legs[i].lanelets.len() - 1];
            let next =
                road.successors_straightest_first(last).iter().copied().find(|j| are_neighbours(road, *j, beside));
            match next {
                Some(next) => legs[i].lanelets.push(next),
                None => break,
            }
        }
    }
    for i in 1..legs.len() {
        while legs[i].first_station > legs[i - 1].first_station {
            let Some(beside) = legs[i - 1].at(legs[i].first_station - 1) else { break };
            let before = road.predecessors_straightest_first(legs[i].lanelets[0]);
            match before.iter().copied().find(|j| are_neighbours(road, *j, beside)) {
                Some(before) => {
                    legs[i].lanelets.insert(0, before);
                    legs[i].first_station -= 1;
                }
                None => break,
            }
        }
    }
    legs
}

impl Corridor {
    /// Points along the steps, from `lead_in` before the start to `extension` beyond the goal.
    pub(super) fn along(
        road: &RoadNetwork,
        steps: &[Step],
        start_s: f64,
        goal: Option<&GoalPlace>,
        blend_length: f64,
        settings: &RouteSettings,
    ) -> Self {
        let legs = legs(road, steps);
        let lines: Vec<LegLine> = legs.iter().map(|leg| leg.line(road)).collect();
        let last = legs.len() - 1;
        // Station of the goal: that of the last step. Backward lengthening does not move it.
        let goal_station = legs[last].end_station() - 1;
        let goal_start = lines[last].offsets[goal_station - legs[last].first_station];
        let goal_length = road.lanelets()[legs[last].lanelets[legs[last].lanelets.len() - 1]].length;
        let (goal_entry, goal_exit) = goal.map_or((goal_length, goal_length), |goal| (goal.entry, goal.exit));

        let mut points = lead_in(road, steps[0].lanelet, start_s, settings.lead_in);
        let start_hint = length_of(&points) + start_s;
        let mut at = 0.0;
        let mut earliest = start_s;
        let (mut lanelets, mut entry, mut base, mut changed) = (Vec::new(), 0.0, length_of(&points), None);
        for i in 0..last {
            let place = ChangePlace::new(&legs, &lines, i, earliest, goal_start + goal_entry);
            let length = blend_length.min(place.room).max(BLEND_LENGTH_MIN);
            let from = place.start;
            points.extend(cut(&lines[i].line, at, from));
            let before = length_of(&points);
            at = blend(&lines[i].line, &lines[i + 1].line, from, length, place.expected, &mut points);
            earliest = at;
            // In the middle of the blend the path is half-way between both lanes.
            let middle = beyond(&lines[i].line, from + 0.5 * length);
            let foot = lines[i + 1].line.project_between(middle, place.expected, at).s;
            lanelets.extend(lines[i].between(&legs[i], (entry, from + 0.5 * length), base, changed));
            changed = Some((middle.lerp(lines[i + 1].line.at(foot), 0.5), before + 0.5 * length));
            (entry, base) = (foot, before + 0.5 * length - foot);
        }
        let end = lines[last].line.length();
        lanelets.extend(lines[last].between(&legs[last], (entry, end), base, changed));
        points.extend(cut(&lines[last].line, at.min(end), end));
        let rest_after_goal = goal_length - goal_exit;
        let goal_hint = length_of(&points) - rest_after_goal;
        extend(
            road,
            legs[last].lanelets[legs[last].lanelets.len() - 1],
            settings.extension - rest_after_goal,
            &mut points,
        );
        Self { points, lanelets, start_hint, goal_hint }
    }
}

/// Where a lane change may take place.
struct ChangePlace {
    /// Arc length on the leg at which the blend starts [m].
    start: f64,
    /// Length that this change may take, so that those after it have as much [m].
    room: f64,
    /// Arc length on the next leg beside the start [m].
    expected: f64,
}

impl ChangePlace {
    /// For the change from leg `i` to the next, not before `earliest` on leg `i`, with all changes done at
    /// `goal_entry` of the last leg.
    fn new(legs: &[Leg], lines: &[LegLine], i: usize, earliest: f64, goal_entry: f64) -> Self {
        let first_shared = legs[i].first_station.max(legs[i + 1].first_station);
        let start = earliest.max(lines[i].offsets[first_shared - legs[i].first_station]);
        let here = lines[i].line.at(start);
        // The same place on all legs from here on.
        let along: Vec<f64> =
            lines[i..].iter().map(|leg| leg.line.project_between(here, 0.0, leg.line.length()).s).collect();
        let mut room = f64::INFINITY;
        for (changes, j) in (i..lines.len() - 1).enumerate() {
            let end_station = legs[j].end_station().min(legs[j + 1].end_station());
            let shared_end = lines[j].offsets[end_station - legs[j].first_station];
            room = room.min((shared_end - along[changes]) / (changes + 1) as f64);
        }
        let changes_left = (lines.len() - 1 - i) as f64;
        room = room.min((goal_entry - along[along.len() - 1]) / changes_left);
        Self { start, room, expected: along[1] }
    }
}

/// Points of the way from one lane to the other; returns the arc length on `to` at the end.
fn blend(from: &Polyline, to: &Polyline, start: f64, length: f64, expected: f64, points: &mut Vec<Point>) -> f64 {
    let n = (length / BLEND_SPACING).ceil().max(4.0) as usize;
    let mut foot = expected;
    for k in 0..=n {
        let u = k as f64 / n as f64;
        let on_from = beyond(from, start + u * length);
        foot = to.project_between(on_from, foot, foot + if k == 0 { FOOT_WINDOW } else { 5.0 * BLEND_SPACING }).s;
        let weight = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        points.push(on_from.lerp(to.at(foot), weight));
    }
    foot
}

/// Point of a polyline that goes on straight at its end.
fn beyond(line: &Polyline, s: f64) -> Point {
    let over = (s - line.length()).max(0.0);
    line.at(s) + line.direction_at(s) * over
}

/// Vertices between two arc lengths, both included as points.
fn cut(line: &Polyline, from: f64, to: f64) -> Vec<Point> {
    let inner = line.points().iter().zip(line.arc_lengths()).filter(|(_, s)| **s > from && **s < to).map(|(p, _)| *p);
    std::iter::once(line.at(from)).chain(inner).chain(std::iter::once(line.at(to))).collect()
}

fn length_of(points: &[Point]) -> f64 {
    points.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// Points from at least `length` before arc length `s` of a lanelet up to its start: along predecessors, then straight.
fn lead_in(road: &RoadNetwork, lanelet: usize, s: f64, length: f64) -> Vec<Point> {
    let mut missing = length - s;
    let mut at = lanelet;
    let mut pieces: Vec<&[Point]> = Vec::new();
    while missing > 0.0 && pieces.len() < LANELET_CHAIN_MAX {
        let Some(&before) = road.predecessors_straightest_first(at).first() else { break };
        pieces.push(road.lanelets()[before].center.points());
        missing -= road.lanelets()[before].length;
        at = before;
    }
    let mut points = Vec::new();
    let line = &road.lanelets()[at].center;
    if missing > 0.0 {
        points.push(line.at(0.0) - Point::from_angle(road.heading_at(at, 0.0)) * missing);
    }
    points.extend(pieces.into_iter().rev().flatten());
    points.push(road.lanelets()[lanelet].center.at(0.0));
    points
}

/// Goes on for `length` behind a lanelet: along successors, then straight.
fn extend(road: &RoadNetwork, lanelet: usize, length: f64, points: &mut Vec<Point>) {
    let mut missing = length;
    let mut at = lanelet;
    for _ in 0..LANELET_CHAIN_MAX {
        if missing <= 0.0 {
            break;
        }
        let Some(&next) = road.successors_straightest_first(at).first() else { break };
        let line = &road.lanelets()[next].center;
        points.extend(cut(line, 0.0, missing.min(line.length())));
        missing -= line.length();
        at = next;
    }
    if missing > 0.0 {
        let end = &road.lanelets()[at];
        points.push(end.center.at(end.length) + Point::from_angle(road.heading_at(at, end.length)) * missing);
    }
}
