//! Crosswalks on the way of a vehicle, and who uses them: people on foot, and bicycles that ride across.

use crate::control::Control;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::{Aabb, Point};
use crate::road::{RoadNetwork, Segment};
use crate::trajectory::State;
use crate::vehicle::ParticipantKind;

/// A vehicle needs a strip of this half width [m]; where it meets a crosswalk, that begins.
const STRIP: f64 = 1.1;
/// Steps along and across the strip [m].
const STEP: f64 = 0.1;
const STEP_ACROSS: f64 = 0.55;
/// Crosswalks closer together than this are one [m]: no vehicle stands in between.
const GAP_MIN: f64 = 1.0;
/// Half width of a lane where the map does not tell [m].
const HALF_LANE: f64 = 1.75;
/// People leave the outline of a crosswalk by so much [m].
const BESIDE: f64 = 1.0;
/// A person slower than this stands, or walks along the road [m/s].
const WALKING: f64 = 0.3;
/// People this near to the lane count [m] ...
const NEAR_DISTANCE: f64 = 2.0;
/// ... and people who reach it within this time [s].
const AHEAD: f64 = 3.0;
/// A bicycle uses the crosswalk if so much of its speed leads across the lane.
const ACROSS: f64 = 0.7;

/// Participants of a kind use crosswalks: people on foot, and bicycles that ride across.
pub(crate) fn uses_crosswalks(kind: ParticipantKind) -> bool {
    matches!(kind, ParticipantKind::Pedestrian | ParticipantKind::Bicycle)
}

/// A crosswalk on the way of a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Crosswalk {
    /// Arc length on the path at which the strip of a vehicle meets it first [m].
    pub entry: f64,
    /// Where the strip has left it [m].
    exit: f64,
    /// Outlines, world frame [m].
    outlines: Vec<Vec<Point>>,
    /// Middle of the lane there, its left, and half of its width [m].
    middle: Point,
    left: Point,
    half_lane: f64,
}

impl Crosswalk {
    /// The crosswalks on a path along lanelets, in its order.
    #[cold]
    pub(super) fn along(path: &ReferencePath, lanelets: &[usize], control: &Control, road: &RoadNetwork) -> Vec<Self> {
        let mut found: Vec<Self> = Vec::new();
        for lanelet in control.crosswalks.iter().filter(|lanelet| !lanelets.contains(lanelet)) {
            let outline = &road.lanelets()[*lanelet].polygon;
            for (entry, exit) in stretches(path, outline) {
                let foot = path.at(0.5 * (entry + exit));
                let half_lane = lanelets.iter().find_map(|lane| half_lane(road, *lane, foot.position));
                found.push(Self {
                    entry,
                    exit,
                    outlines: vec![outline.clone()],
                    middle: foot.position,
                    left: foot.tangent().left(),
                    half_lane: half_lane.unwrap_or(HALF_LANE),
                });
            }
        }
        found.sort_by(|a, b| a.entry.total_cmp(&b.entry));
        found.dedup_by(|next, first| {
            let is_one = next.entry < first.exit + GAP_MIN;
            if is_one {
                first.exit = first.exit.max(next.exit);
                first.outlines.append(&mut next.outlines);
            }
            is_one
        });
        found
    }

    /// A vehicle gives way to people here if they are on the lane, have not left it by 2 m, or are about to walk onto it.
    pub fn is_used_by(&self, kind: ParticipantKind, state: &State) -> bool {
        let (position, velocity) = (state.pose().position, Point::from_angle(state.orientation) * state.velocity);
        let aside = (position - self.middle).dot(self.left);
        let outside = (aside.abs() - self.half_lane).max(0.0);
        let towards = -velocity.dot(self.left) * aside.signum();
        let speed = velocity.norm();
        if kind == ParticipantKind::Bicycle && (speed < WALKING || towards.abs() < ACROSS * speed) {
            return false;
        }
        if outside <= 0.0 {
            return self.is_at(position);
        }
        if towards.abs() < WALKING {
            return false;
        }
        // Where they reach the lane, or where they left it.
        let time = outside / towards;
        let is_near = outside <= NEAR_DISTANCE || (time > 0.0 && (time <= AHEAD || self.is_on(position)));
        is_near && self.is_at(position + velocity * time)
    }

    fn is_on(&self, point: Point) -> bool {
        self.outlines.iter().any(|outline| contains(outline, point))
    }

    fn is_at(&self, point: Point) -> bool {
        let is_beside = |segment: Segment| segment.distance(point) <= BESIDE;
        self.is_on(point) || self.outlines.iter().any(|outline| edges(outline).any(is_beside))
    }
}

/// Half the width of a lanelet at a point [m], if it lies there.
fn half_lane(road: &RoadNetwork, lanelet: usize, point: Point) -> Option<f64> {
    let lane = &road.lanelets()[lanelet];
    contains(&lane.polygon, point).then(|| 0.5 * lane.width_at(lane.center.project(point).s))
}

/// Where the strip along a path lies on an outline [m].
fn stretches(path: &ReferencePath, outline: &[Point]) -> Vec<(f64, f64)> {
    let region = Aabb::around(outline.iter().copied()).grown(STRIP);
    let n_across = (2.0 * STRIP / STEP_ACROSS).round() as usize;
    let is_on = |s: f64| {
        let foot = path.at(s);
        let offset = |i: usize| foot.offset(i as f64 * STEP_ACROSS - STRIP);
        region.contains(foot.position) && (0..=n_across).any(|i| contains(outline, offset(i)))
    };
    // Only where the path is near: between the first and the last of its points there.
    let around = region.grown(path.spacing());
    let is_near = |i: &usize| around.contains(Point::new(path.x()[*i], path.y()[*i]));
    let n = path.x().len();
    let (Some(first), Some(last)) = ((0..n).find(is_near), (0..n).rfind(is_near)) else { return Vec::new() };
    let step_at = |knot: usize| (knot as f64 * path.spacing() / STEP) as usize;
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut was_on = false;
    for i in step_at(first.saturating_sub(1))..=step_at(last + 1).min((path.length() / STEP) as usize) {
        let s = i as f64 * STEP;
        let on = is_on(s);
        match found.last_mut() {
            Some(last) if on && was_on => last.1 = s,
            _ if on => found.push((s, s)),
            _ => {}
        }
        was_on = on;
    }
    found
}

/// A point lies inside an outline (even-odd rule).
fn contains(outline: &[Point], point: Point) -> bool {
    let crosses = |edge: &Segment| {
        let Segment { a, b } = *edge;
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) * (b.x - a.x) / (b.y - a.y)
    };
    edges(outline).filter(crosses).count() % 2 == 1
}

fn edges(outline: &[Point]) -> impl Iterator<Item = Segment> {
    let n = outline.len();
    (0..n).map(move |i| Segment { a: outline[i], b: outline[(i + 1) % n] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::testing::{lane, open, straight};

    /// A lane of 3.5 m along x, and a crosswalk of 3.5 m at x = 50 m from y = -5 to 5 m.
    fn crosswalk() -> Crosswalk {
        let across = lane(2, &straight((50.0, -5.0), (50.0, 5.0)));
        let road = open(vec![lane(1, &straight((0.0, 0.0), (100.0, 0.0))), across]);
        let control = Control { crosswalks: vec![1], ..Control::default() };
        let path = ReferencePath::through(&[Point::new(0.0, 0.0), Point::new(100.0, 0.0)]).expect("a path");
        let found = Crosswalk::along(&path, &[0], &control, &road);
        assert_eq!(found.len(), 1);
        found[0].clone()
    }

    fn is_used_by((x, y): (f64, f64), (vx, vy): (f64, f64), rides: bool) -> bool {
        let state = State { x, y, orientation: vy.atan2(vx), velocity: vx.hypot(vy), ..State::default() };
        crosswalk().is_used_by(if rides { ParticipantKind::Bicycle } else { ParticipantKind::Pedestrian }, &state)
    }

    #[test]
    fn it_begins_where_the_strip_of_a_vehicle_meets_it() {
        let found = crosswalk();
        assert!((found.entry - 48.25).abs() <= STEP, "{}", found.entry);
        assert!((found.half_lane - 1.75).abs() < 1e-9);
    }

    #[test]
    fn a_path_that_leads_over_a_crosswalk_twice_meets_it_twice() {
        let outline = [(48.25, -5.0), (51.75, -5.0), (51.75, 5.0), (48.25, 5.0)].map(|(x, y)| Point::new(x, y));
        let turn = [(0.0, 0.0), (80.0, 0.0), (80.0, 4.0), (0.0, 4.0)].map(|(x, y)| Point::new(x, y));
        let path = ReferencePath::through(&turn).expect("a path");
        let found = stretches(&path, &outline);
        assert_eq!(found.len(), 2, "{found:?}");
        let there = |s: f64| path.at(s).position.x;
        assert!((there(found[0].0) - 48.25).abs() < 0.2 && (there(found[1].0) - 51.75).abs() < 0.2, "{found:?}");
        assert!(stretches(&path, &outline.map(|point| point + Point::new(0.0, 20.0))).is_empty());
    }

    #[test]
    fn people_on_the_lane_or_about_to_walk_onto_it_go_first() {
        for (y, vy, expected) in [
            (0.0, 0.0, true),   // stands on the lane
            (-3.0, 1.3, true),  // 1.25 m beside it, walking there
            (-3.0, 0.0, false), // stands there
            (-6.0, 2.0, true),  // reaches it in 2.1 s
            (-6.0, 1.0, false), // in 4.3 s
            (-4.9, 0.5, true),  // in 6.3 s, but already on the crosswalk
            (3.0, 1.3, true),   // has left it by 1.25 m
            (3.8, 1.3, false),  // by 2.05 m
        ] {
            assert_eq!(is_used_by((50.0, y), (0.0, vy), false), expected, "y {y} m, {vy} m/s");
        }
    }

    #[test]
    fn people_elsewhere_or_along_the_road_do_not_count() {
        assert!(!is_used_by((40.0, -3.0), (0.0, 1.3), false), "10 m before the crosswalk");
        assert!(!is_used_by((40.0, 0.0), (1.3, 0.0), false), "on the lane before it");
        assert!(!is_used_by((50.0, -3.0), (1.3, 0.0), false), "along the pavement");
        assert!(is_used_by((48.0, -4.0), (0.9, 0.9), false), "at an angle");
    }

    #[test]
    fn a_bicycle_counts_where_it_rides_across() {
        assert!(is_used_by((50.0, -6.0), (0.0, 4.0), true));
        assert!(!is_used_by((50.0, 0.0), (4.0, 0.0), true), "along the lane");
        assert!(!is_used_by((50.0, 0.0), (0.0, 0.0), true), "it stands");
    }
}
