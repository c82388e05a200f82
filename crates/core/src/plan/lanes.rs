//! The lanes that an agent may use on its way: for each a chain of lanelets, a smooth path along it, and how many lane
//! changes are missing to the goal, and until where they must be done.

use std::collections::VecDeque;

use super::PlanRequest;
use crate::error::Result;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;
use crate::route::{FOOT_WINDOW, PathPiece, Route};
use crate::rules::{RulesSettings, Way};
use crate::scenario::{Goal, Scenario};
use crate::turn::Turn;

/// Lanes begin at least this far before the start [m], where the road does.
const LEAD_IN: f64 = 40.0;
/// On a ring they begin along the bend for this length, in steps [m].
const RING_LEAD_IN: f64 = 6.0;
const RING_STEP: f64 = 1.0;
/// They end this far beyond the goal; without a goal they are this long [m].
const LANE_EXTENSION: f64 = 150.0;
const FREE_LENGTH: f64 = 400.0;
/// Where the map ends, the path goes on straight for this length [m].
const STRAIGHT_ON: f64 = 80.0;
/// Most lanes of an agent.
const LANES_MAX: usize = 8;
/// Most lanelets of a lane: a bound for maps with loops.
const LANE_LANELETS_MAX: usize = 200;
/// A lane change begins this far before the end of the stretch that both lanes share, at the latest [m]: it is the length
/// that a change takes at walking speed.
const CHANGE_RESERVE: f64 = 16.0;

/// The lane that a plan leads to is seen from its last point and its heading there, this far ahead [m].
pub(super) const AIM_DISTANCE: f64 = 5.0;
/// A lane change is done, and the next one may be thought of, this near to the middle of the lane [m].
pub(super) const SETTLED_OFFSET: f64 = 0.4;

/// Where an agent drives on one lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aim {
    /// Position of the lane.
    pub(super) lane: usize,
    /// Arc length of the rear axle on its path [m].
    pub(super) s: f64,
    /// Offset of the rear axle from its path [m], left positive.
    pub(super) d: f64,
}

impl Aim {
    /// The side on which the lane is: an agent to the right of it has a negative offset.
    pub(super) fn side(&self) -> Turn {
        if self.d < 0.0 { Turn::Left } else { Turn::Right }
    }
}

/// One lane, possibly of many lanelets.
#[derive(Debug, Clone)]
pub struct Lane {
    pub(super) path: ReferencePath,
    /// What the rules of the road say about it.
    pub(super) way: Way,
    pieces: Vec<Piece>,
    /// Its last lanelet leads to its first one.
    is_ring: bool,
}

/// A lanelet of a lane.
#[derive(Debug, Clone, Copy)]
struct Piece {
    lanelet: usize,
    /// Arc length on the path at which it ends [m].
    end: f64,
    /// Lane changes that are missing to the goal.
    changes: usize,
    /// Arc length on the path up to which the next of them can be made [m]; infinite if none is missing.
    last_chance: f64,
    /// Arc length at which the last lane beside it with fewer changes missing ends [m]; infinite if none is missing.
    lane_end: f64,
    /// The lane goes on behind that.
    goes_on: bool,
}

/// The remaining task of an agent in a lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Need {
    /// Lane changes that are missing to the goal.
    pub(super) changes: usize,
    /// Arc length on the path of the lane up to which the next of them can be made [m]; infinite if none is missing.
    pub(super) last_chance: f64,
    /// Arc length at which the last lane beside it with fewer changes missing ends, wherever the goal is [m]; infinite if
    /// none is missing.
    pub(super) lane_end: f64,
    /// The lane goes on behind that, and leads elsewhere.
    pub(super) goes_on: bool,
}

/// All lanes of an agent; the first one is that of its start.
#[derive(Debug, Clone)]
pub struct Lanes {
    pub(super) lanes: Vec<Lane>,
}

/// Number of lane changes that are missing from every lanelet to the goal; `usize::MAX` if it cannot be reached.
///
/// Without a place as goal, the goal is where the map ends. A goal that `leaves` the map there counts in every lane.
/// Only lanelets that the route's user may use count.
fn missing_changes(road: &RoadNetwork, route: &Route, goal: Option<usize>, leaves: bool) -> Vec<usize> {
    let lanelets = road.lanelets();
    let mut changes = vec![usize::MAX; lanelets.len()];
    let mut queue = VecDeque::new();
    let may_use: Vec<bool> = (0..lanelets.len()).map(|i| route.may_use(road, i)).collect();
    let neighbours = |i: usize| {
        let sides = [lanelets[i].adjacent_left, lanelets[i].adjacent_right];
        sides.into_iter().flatten().filter(|side| side.1 && may_use[side.0]).map(|side| side.0)
    };
    let ends = |i: usize| lanelets[i].successors.iter().all(|next| !may_use[*next]);
    let map_ends = |i: usize| may_use[i] && ends(i) && neighbours(i).all(ends);
    let mut goals = Vec::from_iter(goal);
    let mut at = 0;
    while leaves && at < goals.len() && map_ends(goals[at]) {
        let beside: Vec<usize> = neighbours(goals[at]).filter(|i| !goals.contains(i)).collect();
        goals.extend(beside);
        at += 1;
    }
    for (i, changes) in changes.iter_mut().enumerate() {
        if goal.map_or_else(|| map_ends(i), |_| goals.contains(&i)) {
            *changes = 0;
            queue.push_back(i);
        }
    }
    // Breadth first, those without a change before those with one more.
    while let Some(i) = queue.pop_front() {
        let here = changes[i];
        for &before in &lanelets[i].predecessors {
            if may_use[before] && changes[before] > here {
                changes[before] = here;
                queue.push_front(before);
            }
        }
        for beside in neighbours(i) {
            if changes[beside] > here + 1 {
                changes[beside] = here + 1;
                queue.push_back(beside);
            }
        }
    }
    changes
}

impl Lanes {
    /// The lane of the start, the lanes beside it, those beside them, and so on.
    ///
    /// # Errors
    /// `InvalidInput` if a lane makes no path.
    pub(super) fn along(route: &Route, goal: &Goal, scenario: &Scenario, rules: &RulesSettings) -> Result<Self> {
        let (road, ends) = (&scenario.road, Ends::of(route, goal, scenario));
        let mut chains: Vec<Vec<usize>> = vec![chain(road, route.lanelets[0], (&[], &[]), &ends)];
        let mut at = 0;
        while at < chains.len() {
            for i in 0..chains[at].len() {
                let lanelet = &road.lanelets()[chains[at][i]];
                for (beside, same) in [lanelet.adjacent_left, lanelet.adjacent_right].into_iter().flatten() {
                    let is_new =
                        same && route.may_use(road, beside) && !chains.iter().any(|chain| chain.contains(&beside));
                    let leads_on = !ends.leaves || ends.changes[beside] != usize::MAX;
                    if is_new && leads_on && chains.len() < LANES_MAX {
                        chains.push(chain(road, beside, (&[], &[]), &ends));
                    }
                }
            }
            at += 1;
        }
        Self::through(chains, (scenario, rules), &ends)
    }

    /// The lanes of a route alone, in its order.
    ///
    /// # Errors
    /// As [`Lanes::along`].
    pub(super) fn of(route: &Route, goal: &Goal, scenario: &Scenario, rules: &RulesSettings) -> Result<Self> {
        let (road, ends) = (&scenario.road, Ends::of(route, goal, scenario));
        let goes_on = |pair: &[usize]| road.lanelets()[pair[0]].successors.contains(&pair[1]);
        let changes = route.lanelets.windows(2).filter(|pair| !goes_on(pair)).map(|pair| pair[1]);
        let mut chains = vec![chain(road, route.lanelets[0], (&route.lanelets, &[]), &ends)];
        for first in changes {
            chains.push(chain(road, first, (&route.lanelets, &chains[chains.len() - 1]), &ends));
        }
        Self::through(chains, (scenario, rules), &ends)
    }

    fn through(chains: Vec<Vec<usize>>, scenario: (&Scenario, &RulesSettings), ends: &Ends) -> Result<Self> {
        let lane = |chain| Lane::new(scenario, chain, &ends.changes, ends.goal_place);
        Ok(Self { lanes: chains.into_iter().map(lane).collect::<Result<_>>()? })
    }
}

/// What decides where lanes begin and end.
struct Ends {
    /// Lane changes that are missing from every lanelet.
    changes: Vec<usize>,
    start: Point,
    goal_place: Option<Point>,
    /// From the start on [m].
    length: f64,
    /// The goal is to leave the map: lanes that lead elsewhere do not count.
    leaves: bool,
}

impl Ends {
    fn of(route: &Route, goal: &Goal, scenario: &Scenario) -> Self {
        // As for the desired speed, the alternative that may be met last counts.
        let last = goal.states.iter().max_by_key(|state| state.time_step.1);
        let has_place = last.is_some_and(|state| !state.areas.is_empty());
        let goal_lanelet = route.lanelets.last().copied().filter(|_| has_place);
        let leaves = has_place && goal.pace.is_some();
        Self {
            changes: missing_changes(&scenario.road, route, goal_lanelet, leaves),
            start: route.path.at(route.start_s).position,
            goal_place: has_place.then(|| route.path.at(route.goal_entry_s.max(0.0)).position),
            length: match goal.pace {
                _ if has_place => route.path.length() + LANE_EXTENSION,
                Some(_) => route.path.length(),
                None => FREE_LENGTH,
            },
            leaves,
        }
    }
}

/// Lanelets of the lane through one of them: ahead the way with the fewest changes, of equals that of a route, of others the
/// straightest; behind the one beside another lane, of others the straightest.
fn chain(road: &RoadNetwork, through: usize, (route, lane): (&[usize], &[usize]), ends: &Ends) -> Vec<usize> {
    let Ends { changes, start, length, .. } = ends;
    let lanelets = road.lanelets();
    let mut chain = VecDeque::from([through]);
    let foot = lanelets[through].center.project(*start).s;
    // A ring has no lanelets left behind.
    let mut ahead = lanelets[through].length - foot;
    while ahead < *length && chain.len() < LANE_LANELETS_MAX {
        let next = road.successors_straightest_first(chain[chain.len() - 1]);
        // The first of equals is the straightest.
        let next = next
            .iter()
            .copied()
            .filter(|next| !chain.contains(next))
            .min_by_key(|next| (changes[*next], !route.contains(next)));
        let Some(next) = next else { break };
        ahead += lanelets[next].length;
        chain.push_back(next);
    }
    let mut behind = foot;
    let is_beside = |before: &usize| {
        let sides = [lanelets[*before].adjacent_left, lanelets[*before].adjacent_right];
        sides.into_iter().flatten().any(|(beside, same)| same && lane.contains(&beside))
    };
    while chain.len() < LANE_LANELETS_MAX {
        let before = road.predecessors_straightest_first(chain[0]);
        let mut before = before.iter().copied().filter(|before| !chain.contains(before));
        let first = before.next();
        let beside = first.into_iter().chain(before).find(is_beside);
        let Some(before) = beside.or(first.filter(|_| behind < LEAD_IN)) else { break };
        behind += lanelets[before].length;
        chain.push_front(before);
    }
    chain.into()
}

/// The way to the beginning of a lane: straight, but on a ring along the bend at first, where a vehicle that enters the lane
/// may still be.
fn lead_in(road: &RoadNetwork, chain: &[usize]) -> Vec<Point> {
    let lanelets = road.lanelets();
    let behind = road.predecessors_straightest_first(chain[0]).first().filter(|before| chain.contains(before));
    let (lanelet, end, bend) = match behind {
        Some(&before) => (before, lanelets[before].length, RING_LEAD_IN.min(lanelets[before].length)),
        None => (chain[0], 0.0, 0.0),
    };
    let n = (bend / RING_STEP) as usize;
    let along = (1..=n).rev().map(|i| lanelets[lanelet].center.at(end - i as f64 * RING_STEP));
    let from = lanelets[lanelet].center.at(end - n as f64 * RING_STEP);
    let heading = road.heading_at(lanelet, end - n as f64 * RING_STEP);
    let start = from - Point::from_angle(heading) * (LEAD_IN - n as f64 * RING_STEP);
    std::iter::once(start).chain(along).collect()
}

impl Lane {
    fn new(
        (scenario, rules): (&Scenario, &RulesSettings),
        chain: Vec<usize>,
        changes: &[usize],
        goal_place: Option<Point>,
    ) -> Result<Self> {
        let road = &scenario.road;
        let lanelets = road.lanelets();
        let mut points: Vec<Point> = Vec::new();
        for &lanelet in &chain {
            points.extend_from_slice(lanelets[lanelet].center.points());
        }
        let last = chain[chain.len() - 1];
        points.splice(0..0, lead_in(road, &chain));
        let heading = road.heading_at(last, lanelets[last].length);
        points.push(points[points.len() - 1] + Point::from_angle(heading) * STRAIGHT_ON);
        let path = ReferencePath::through(&points)?;
        let mut expected = LEAD_IN;
        let mut pieces: Vec<Piece> = Vec::with_capacity(chain.len());
        for &lanelet in &chain {
            expected += lanelets[lanelet].length;
            let end = lanelets[lanelet].center.at(lanelets[lanelet].length);
            expected = path.project_near(end, expected, FOOT_WINDOW).map_or(expected, |foot| foot.0);
            let (changes, never) = (changes[lanelet], f64::INFINITY);
            pieces.push(Piece { lanelet, end: expected, changes, last_chance: never, lane_end: never, goes_on: true });
        }
        // No lane change is needed beyond the goal.
        let goal_s = goal_place.and_then(|place| path.project(place)).map_or(f64::INFINITY, |foot| foot.0);
        for i in 0..pieces.len() {
            if pieces[i].changes == 0 {
                continue;
            }
            let helping = |piece: &Piece| {
                let lanelet = &lanelets[piece.lanelet];
                let mut sides = [lanelet.adjacent_left, lanelet.adjacent_right].into_iter().flatten();
                sides.find(|(beside, same)| *same && changes[*beside] < pieces[i].changes).map(|(beside, _)| beside)
            };
            let found = pieces[i..].iter().rev().find_map(|piece| Some((piece.end, helping(piece)?)));
            let (last, beside) = found.map_or((pieces[i].end, None), |(end, beside)| (end, Some(beside)));
            // Where both end, so does the map, and not the road.
            let map_ends = beside.is_some_and(|beside| lanelets[beside].successors.is_empty());
            pieces[i].goes_on = map_ends
                || pieces[pieces.len() - 1].end > last
                || !lanelets[chain[chain.len() - 1]].successors.is_empty();
            pieces[i].last_chance = last.min(goal_s) - CHANGE_RESERVE;
            pieces[i].lane_end = last;
        }
        let whole = PathPiece::chain(&path, &chain, road);
        let is_ring = lanelets[last].successors.contains(&chain[0]);
        Ok(Self { way: Way::without_crosswalks(&path, &whole, scenario, rules), path, pieces, is_ring })
    }

    /// Arc length and offset of the nearest foot of a point [m]. What goes on straight behind a ring lies across its
    /// beginning, and is no lane there.
    fn project(&self, point: Point) -> Option<(f64, f64)> {
        let half = 0.5 * self.pieces[self.pieces.len() - 1].end;
        let on_ring = self.is_ring.then(|| self.path.project_near(point, half, half)).flatten();
        on_ring.or_else(|| self.path.project(point))
    }

    fn piece_at(&self, s: f64) -> &Piece {
        let i = self.pieces.partition_point(|piece| piece.end <= s);
        &self.pieces[i.min(self.pieces.len() - 1)]
    }

    /// The remaining task at an arc length; `None` if the goal cannot be reached from there.
    pub(super) fn need(&self, s: f64) -> Option<Need> {
        let Piece { changes, last_chance, lane_end, goes_on, .. } = *self.piece_at(s);
        (changes != usize::MAX).then_some(Need { changes, last_chance, lane_end, goes_on })
    }

    /// Left and right bound at an arc length of the path.
    pub(super) fn bounds(&self, s: f64, road: &RoadNetwork) -> (Point, Point) {
        let piece = self.piece_at(s);
        let lanelet = &road.lanelets()[piece.lanelet];
        lanelet.bounds_at((lanelet.length - (piece.end - s)).clamp(0.0, lanelet.length))
    }

    /// Width at an arc length of the path [m].
    pub(super) fn width(&self, s: f64, road: &RoadNetwork) -> f64 {
        let piece = self.piece_at(s);
        let lanelet = &road.lanelets()[piece.lanelet];
        lanelet.width_at((lanelet.length - (piece.end - s)).clamp(0.0, lanelet.length))
    }

    fn holds(&self, lanelet: usize, s: f64) -> bool {
        /// The same place may be this much further on one path than on the other [m].
        const SLACK: f64 = 5.0;
        [s - SLACK, s, s + SLACK].iter().any(|s| self.piece_at(*s).lanelet == lanelet)
    }
}

impl Lanes {
    /// The lanes to the left and to the right of one, with the arc lengths beside `s` on it.
    pub(super) fn beside(&self, lane: usize, s: f64, road: &RoadNetwork) -> [Option<(usize, f64)>; 2] {
        let here = self.lanes[lane].path.at(s).position;
        let lanelet = &road.lanelets()[self.lanes[lane].piece_at(s).lanelet];
        [lanelet.adjacent_left, lanelet.adjacent_right].map(|side| {
            let (beside, _) = side.filter(|side| side.1)?;
            self.lanes.iter().enumerate().find_map(|(index, other)| {
                if !other.pieces.iter().any(|piece| piece.lanelet == beside) {
                    return None;
                }
                let (foot, _) = other.project(here)?;
                (index != lane && other.holds(beside, foot)).then_some((index, foot))
            })
        })
    }

    /// The lane that the previous plan leads to; without a plan, the nearest lane at `ahead` [m].
    pub(super) fn aimed_at(&self, request: &PlanRequest, ahead: f64) -> Option<Aim> {
        let rear_axle = |pose: Pose| Pose { position: request.vehicle.rear_axle_from_center(pose), ..pose };
        let here = rear_axle(request.state.pose());
        let last = request.previous.and_then(|plan| plan.points.last()).filter(|point| point.is_finite());
        let towards = last.and_then(|last| self.nearest(rear_axle(last.pose()), AIM_DISTANCE)).map(|(lane, ..)| lane);
        let on = |lane: usize| self.lanes[lane].project(here.position).map(|(s, d)| Aim { lane, s, d });
        towards.and_then(on).or_else(|| self.nearest(here, ahead).map(|(lane, s, d)| Aim { lane, s, d }))
    }

    /// The way of the lane in which a vehicle is, with the arc length of its rear axle there [m].
    pub(super) fn way_below(&self, rear_axle: Pose) -> Option<(&Way, f64)> {
        self.nearest(rear_axle, 0.0).map(|(lane, s, _)| (&self.lanes[lane].way, s))
    }

    /// The lane to which a pose fits best, with the arc length and the offset of its position; ties by number.
    pub(super) fn nearest(&self, pose: Pose, ahead: f64) -> Option<(usize, f64, f64)> {
        let tip = pose.position + Point::from_angle(pose.orientation) * ahead;
        let mut best: Option<(usize, f64, f64, f64)> = None;
        for (index, lane) in self.lanes.iter().enumerate() {
            let Some((s, d)) = lane.project(pose.position) else { continue };
            let Some((_, d_ahead)) = lane.path.project_near(tip, s + ahead, 10.0) else { continue };
            if Point::from_angle(pose.orientation).dot(lane.path.at(s).tangent()) < 0.5 {
                continue;
            }
            if best.is_none_or(|(.., least)| d_ahead.abs() < least - 1e-6) {
                best = Some((index, s, d, d_ahead.abs()));
            }
        }
        best.map(|(index, s, d, _)| (index, s, d))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::{PlacedShape, Shape};
    use crate::road::testing::{LANE_WIDTH, straight_road};
    use crate::route::{RouteSettings, find_route};
    use crate::scenario::{GoalState, Obstacles};
    use std::sync::Arc;

    /// Three lanes of 200 m; from the right one at 20 m to a goal at 150 m in a lane (0: right).
    fn lanes(goal_lane: usize) -> (Arc<RoadNetwork>, Lanes) {
        let road = straight_road(3);
        let pose = Pose::new(150.0, goal_lane as f64 * LANE_WIDTH, 0.0);
        let areas: Arc<[PlacedShape]> = [PlacedShape { shape: Shape::rectangle(10.0, 3.0), pose }].into();
        let route =
            find_route(&road, Pose::new(20.0, 0.0, 0.0), 10.0, &areas, &RouteSettings::default()).expect("a route");
        let goal = Goal {
            states: vec![GoalState { areas, time_step: (0, 100), velocity: None, orientation: None }],
            pace: None,
        };
        let scenario = Scenario::new(0.1, Arc::new(road), Obstacles::default()).expect("a scenario");
        let lanes = Lanes::along(&route, &goal, &scenario, &RulesSettings::default()).expect("lanes");
        (scenario.road, lanes)
    }

    #[test]
    fn every_lane_knows_how_many_changes_are_missing_and_until_where() {
        let (_, lanes) = lanes(2);
        let at = |lane: usize| lanes.lanes[lane].path.project(Point::new(30.0, 0.0)).expect("beside").0;
        let needs: Vec<Need> = (0..3).map(|lane| lanes.lanes[lane].need(at(lane)).expect("leads there")).collect();
        assert_eq!(needs.iter().map(|need| need.changes).collect::<Vec<_>>(), [2, 1, 0]);
        // The goal begins at 145 m.
        assert!((needs[0].last_chance - at(0) - (145.0 - 30.0 - CHANGE_RESERVE)).abs() < 0.5, "{needs:?}");
        assert_eq!(needs[2].last_chance, f64::INFINITY);
    }

    #[test]
    fn lanes_beside_are_found_on_both_sides() {
        let (road, lanes) = lanes(0);
        let s = lanes.lanes[1].path.project(Point::new(60.0, LANE_WIDTH)).expect("beside").0;
        let beside = lanes.beside(1, s, &road).map(|side| side.map(|(lane, _)| lane));
        assert_eq!(beside, [Some(2), Some(0)]);
        assert_eq!(lanes.beside(0, s, &road)[1], None);
        assert!((lanes.lanes[1].width(s, &road) - LANE_WIDTH).abs() < 1e-6);
    }

    #[test]
    fn a_pose_on_its_way_to_a_lane_fits_that_lane() {
        let (_, lanes) = lanes(0);
        let lane =
            |y: f64, theta: f64, ahead: f64| lanes.nearest(Pose::new(60.0, y, theta), ahead).map(|found| found.0);
        assert_eq!(lane(0.4, 0.0, 5.0), Some(0));
        assert_eq!(lane(2.0, 0.0, 5.0), Some(1));
        // 1.5 m beside the first lane, but heading for the second.
        assert_eq!((lane(1.5, 0.15, 5.0), lane(1.5, 0.15, 0.0)), (Some(1), Some(0)));
        assert_eq!(lane(0.0, 3.0, 5.0), None);
    }
}
