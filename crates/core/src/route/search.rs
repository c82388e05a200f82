//! The sequence of lanelets: Dijkstra over lanelets with lane changes first, length second.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::{LaneMatch, RoadNetwork};
use crate::error::{Error, Result};
use crate::geometry::shape::PlacedShape;
use crate::geometry::{Aabb, Point};
use crate::vehicle::ParticipantKind;

/// One metre beside the centre line counts like this length [m].
const OFFSET_COST: f64 = 5.0;
/// Spacing [m] at which a centre line is tested for crossing a goal area.
const CROSSING_SAMPLING: f64 = 0.25;
/// A goal area on no lanelet belongs to those this near [m] to its centre.
const GOAL_TOLERANCE: f64 = 3.0;
/// A goal area whose bounds are those of a lanelet up to this [m] is that lanelet.
const SAME_OUTLINE: f64 = 1e-3;
/// Starts whose direction differs from that of the best one by more than this [rad] count only if nothing else leads to the
/// goal; the same for offsets [m].
const START_ANGLE: f64 = 10.0 * std::f64::consts::PI / 180.0;
const START_OFFSET: f64 = 1.0;
/// The start may be this far [m] beyond the end of a goal area and still count as being there.
const PASSED_TOLERANCE: f64 = 0.1;

/// One lanelet of a route.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) lanelet: usize,
    /// It is reached from the step before by a lane change, not over its start.
    pub(super) is_change: bool,
}

impl Step {
    pub(super) fn ahead(lanelet: usize) -> Self {
        Self { lanelet, is_change: false }
    }
}

/// Where a goal area is on a lanelet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GoalPlace {
    pub(super) lanelet: usize,
    /// Arc lengths of the centre line [m] between which the area is.
    pub(super) entry: f64,
    pub(super) exit: f64,
    /// Distance of the area's centre from the centre line [m].
    pub(super) offset: f64,
    /// The area is another lanelet, which this one overlaps.
    pub(super) is_aside: bool,
}

/// What the search finds.
#[derive(Debug)]
pub(super) struct FoundRoute {
    pub(super) steps: Vec<Step>,
    /// Arc length of the start on the first lanelet [m].
    pub(super) start_s: f64,
    /// On the last lanelet.
    pub(super) goal: GoalPlace,
}

/// Places of the goal areas on all lanelets whose centre line crosses one or that contain the centre of one.
pub(super) fn goal_places(road: &RoadNetwork, areas: &[PlacedShape]) -> Result<Vec<GoalPlace>> {
    let mut places = Vec::new();
    for area in areas {
        let center = area.center();
        let reach = 0.5 * (area.aabb().max - area.aabb().min).norm();
        let containing = road.lanelets_at(center);
        let before = places.len();
        for lanelet in road.lanelets_near((area.aabb().min + area.aabb().max) * 0.5, reach) {
            places.extend(crossing(road, lanelet, area));
        }
        let beside = |lanelet: usize| {
            let foot = road.lanelets()[lanelet].center.project(center);
            GoalPlace { lanelet, entry: foot.s, exit: foot.s, offset: foot.distance, is_aside: false }
        };
        for lanelet in containing {
            if !places[before..].iter().any(|place| place.lanelet == lanelet) {
                places.push(beside(lanelet));
            }
        }
        let is_area = |place: &GoalPlace| is_outline(road, place.lanelet, area);
        if places[before..].iter().any(is_area) {
            for place in &mut places[before..] {
                place.is_aside = !is_outline(road, place.lanelet, area);
            }
        }
        if places.len() == before {
            places.extend(road.lanelets_near(center, GOAL_TOLERANCE).into_iter().map(beside));
        }
    }
    if places.is_empty() {
        let center = areas.first().map(PlacedShape::center).unwrap_or_default();
        return Err(Error::NoRoute(format!("the goal at ({:.2}, {:.2}) lies on no lanelet", center.x, center.y)));
    }
    Ok(places)
}

/// Whether the area is that of the lanelet, as goals have it that name lanelets.
fn is_outline(road: &RoadNetwork, lanelet: usize, area: &PlacedShape) -> bool {
    let (outline, bounds) = (Aabb::around(road.lanelets()[lanelet].polygon.iter().copied()), area.aabb());
    outline.min.distance(bounds.min).max(outline.max.distance(bounds.max)) < SAME_OUTLINE
}

/// The centre line of the lanelet inside the area, from first to last.
fn crossing(road: &RoadNetwork, lanelet: usize, area: &PlacedShape) -> Option<GoalPlace> {
    let line = &road.lanelets()[lanelet].center;
    let n = (line.length() / CROSSING_SAMPLING).ceil().max(1.0) as usize;
    let arc_lengths = (0..=n).map(|i| line.length() * i as f64 / n as f64);
    let mut inside = arc_lengths.filter(|s| area.contains(line.at(*s)));
    let entry = inside.next()?;
    let exit = inside.next_back().unwrap_or(entry);
    Some(GoalPlace { lanelet, entry, exit, offset: line.project(area.center()).distance, is_aside: false })
}

/// Lanelets that are no lane for the user first, then lane changes, then length [m].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cost {
    off_lanes: usize,
    lane_changes: usize,
    length: f64,
}

impl Cost {
    const UNREACHED: Self = Self { off_lanes: usize::MAX, lane_changes: usize::MAX, length: f64::INFINITY };

    fn plus(self, lane_changes: usize, length: f64) -> Self {
        Self { lane_changes: self.lane_changes + lane_changes, length: self.length + length, ..self }
    }

    fn order(&self, other: &Self) -> Ordering {
        let changes = self.off_lanes.cmp(&other.off_lanes).then(self.lane_changes.cmp(&other.lane_changes));
        changes.then(self.length.total_cmp(&other.length))
    }
}

/// A node to look at; the heap gives the cheapest first, equal ones by number.
#[derive(Debug, PartialEq)]
struct Entry {
    cost: Cost,
    node: usize,
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.order(&self.cost).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Every lanelet is two nodes: beside the start (reached without passing its start, so what lies behind the start
/// position is not ahead), and entered over its start.
struct Search<'a> {
    road: &'a RoadNetwork,
    user: ParticipantKind,
    /// Cost up to the start of the lanelet.
    costs: Vec<Cost>,
    /// The node before, and whether a lane change leads from it.
    from: Vec<Option<(usize, bool)>>,
    heap: BinaryHeap<Entry>,
}

impl Search<'_> {
    fn relax(&mut self, node: usize, mut cost: Cost, from: Option<(usize, bool)>) {
        cost.off_lanes += usize::from(!self.road.lanelets()[self.lanelet(node)].users.admits(self.user));
        if cost.order(&self.costs[node]) == Ordering::Less {
            self.costs[node] = cost;
            self.from[node] = from;
            self.heap.push(Entry { cost, node });
        }
    }

    fn lanelet(&self, node: usize) -> usize {
        node % self.road.lanelets().len()
    }

    fn is_beside_start(&self, node: usize) -> bool {
        node < self.road.lanelets().len()
    }
}

/// The starts that fit best: among starts that contain the position, if any does, by heading, then by offset. Lanelets
/// beside the position are left to the search, which counts a lane change for them.
pub(super) fn best_starts(road: &RoadNetwork, starts: &[LaneMatch], position: Point) -> Vec<LaneMatch> {
    let inside = road.lanelets_at(position);
    let contains = |start: &&LaneMatch| inside.is_empty() || inside.contains(&start.lanelet);
    let error = |start: &LaneMatch| start.heading_error.abs();
    let angle = starts.iter().filter(contains).map(error).fold(f64::INFINITY, f64::min) + START_ANGLE;
    let straight = starts.iter().filter(|start| error(start) <= angle);
    let offset = straight.clone().filter(contains).map(|start| start.d.abs()).fold(f64::INFINITY, f64::min);
    straight.filter(|start| !contains(start) || start.d.abs() <= offset + START_OFFSET).copied().collect()
}

/// The best sequence from one of the starts to one of the goals.
pub(super) fn search(
    road: &RoadNetwork,
    user: ParticipantKind,
    starts: &[LaneMatch],
    position: Point,
    goals: &[GoalPlace],
) -> Result<FoundRoute> {
    let n = road.lanelets().len();
    let mut search =
        Search { road, user, costs: vec![Cost::UNREACHED; 2 * n], from: vec![None; 2 * n], heap: BinaryHeap::new() };
    let inside = road.lanelets_at(position);
    for start in starts {
        // Beginning in a lanelet beside the one with the start is a lane change in all but name.
        let lane_changes = usize::from(!inside.is_empty() && !inside.contains(&start.lanelet));
        let length = OFFSET_COST * start.d.abs() - start.s;
        search.relax(start.lanelet, Cost { off_lanes: 0, lane_changes, length }, None);
    }
    let start_on = |lanelet: usize| road.lanelets()[lanelet].center.project(position).s;
    while let Some(Entry { cost, node }) = search.heap.pop() {
        if cost.order(&search.costs[node]) == Ordering::Greater {
            continue;
        }
        let here = search.lanelet(node);
        let lanelet = &road.lanelets()[here];
        for &next in &lanelet.successors {
            search.relax(n + next, cost.plus(0, lanelet.length), Some((node, false)));
        }
        for (beside, _) in [lanelet.adjacent_left, lanelet.adjacent_right].into_iter().flatten().filter(|side| side.1) {
            if search.is_beside_start(node) {
                search.relax(beside, cost.plus(1, start_on(here) - start_on(beside)), Some((node, true)));
            } else {
                search.relax(n + beside, cost.plus(1, 0.0), Some((node, true)));
            }
        }
    }
    let reached =
        goals.iter().flat_map(|goal| [(goal.lanelet, goal), (n + goal.lanelet, goal)]).filter_map(|(node, goal)| {
            let passed = search.is_beside_start(node) && start_on(goal.lanelet) > goal.exit + PASSED_TOLERANCE;
            let cost = search.costs[node];
            (cost.lane_changes != usize::MAX && !passed)
                .then(|| (cost.plus(0, 0.5 * (goal.entry + goal.exit) + OFFSET_COST * goal.offset), node, goal))
        });
    let best = reached.min_by(|a, b| a.2.is_aside.cmp(&b.2.is_aside).then(a.0.order(&b.0)).then(a.1.cmp(&b.1)));
    let Some((_, node, goal)) = best else {
        let behind = |goal: &GoalPlace| starts.iter().any(|start| start.lanelet == goal.lanelet);
        if let Some(goal) = goals.iter().find(|goal| behind(goal)) {
            let distance = start_on(goal.lanelet) - 0.5 * (goal.entry + goal.exit);
            return Err(Error::NoRoute(format!("the goal lies {distance:.0} m behind the start in the same lanelet")));
        }
        let id = |lanelet: usize| road.lanelets()[lanelet].id;
        return Err(Error::NoRoute(format!(
            "no way leads from lanelet {} to lanelet {}",
            id(starts[0].lanelet),
            id(goals[0].lanelet)
        )));
    };
    Ok(trace(&search, starts, node, goal))
}

/// Walks back from the goal's node.
fn trace(search: &Search, starts: &[LaneMatch], node: usize, goal: &GoalPlace) -> FoundRoute {
    let mut steps = Vec::new();
    let mut at = node;
    while let Some((before, is_change)) = search.from[at] {
        steps.push(Step { lanelet: search.lanelet(at), is_change });
        at = before;
    }
    steps.push(Step::ahead(search.lanelet(at)));
    steps.reverse();
    let first = steps[0].lanelet;
    let start_s = starts.iter().find(|start| start.lanelet == first).map_or(0.0, |start| start.s);
    FoundRoute { steps, start_s, goal: *goal }
}
