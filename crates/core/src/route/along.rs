//! The route of a vehicle that is told its turns: along its lane, at forks as a track goes.

use super::search::{GoalPlace, Step, best_starts};
use super::{Route, RouteSettings, over};
use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::geometry::Pose;
use crate::geometry::polyline::Polyline;
use crate::geometry::shape::PlacedShape;
use crate::limits::LANELET_CHAIN_MAX;
use crate::road::RoadNetwork;

/// A track that goes on for less than this beyond a fork [m] does not tell the turn.
const BEYOND_FORK_MIN: f64 = 3.0;
/// Points of a track that are nearer than this to a fork's branches in length tell which one is taken [m].
const COMPARED_LENGTH: f64 = 40.0;
/// The goal at the end of a route is so long where the path is extended beyond it [m].
const GOAL_LENGTH: f64 = 10.0;

/// The route along the lane of the start, `settings.free_length` long if the road is. At a fork it takes the branch that is
/// nearest to the track, or the straightest one where the track ends before. It changes lanes as the track does, or, if it
/// keeps to its lane, only where that ends, to the lane beside it that is nearer to the track. The route has no goal.
///
/// # Errors
/// `NoRoute` if the start lies on no lanelet.
pub fn route_along(
    road: &RoadNetwork,
    start: Pose,
    velocity: f64,
    track: &[Point],
    keeps_lane: bool,
    settings: &RouteSettings,
) -> Result<Route> {
    let starts = road.matching(start, settings.start_tolerance, std::f64::consts::FRAC_PI_2);
    if starts.is_empty() {
        return Err(Error::NoRoute(format!(
            "no lanelet within {} m of the start ({:.2}, {:.2}) leads in its direction",
            settings.start_tolerance, start.position.x, start.position.y
        )));
    }
    let best = best_starts(road, &starts, start.position);
    let lanes: Vec<usize> = best.iter().map(|found| found.lanelet).filter(|i| admits(road, *i, settings)).collect();
    let candidates = if lanes.is_empty() { best.iter().map(|found| found.lanelet).collect() } else { lanes };
    let first = chosen(road, &candidates, track, 0);
    let start_s = best.iter().find(|found| found.lanelet == first).map_or(0.0, |found| found.s);
    let steps = steps_from(road, (first, start_s), track, keeps_lane, settings);
    without_goal(road, (start, velocity), start_s, steps, settings)
}

/// The route over given lanelets, each a successor of the one before or beside it, from a pose on the first one to the end
/// of the last one, where its goal is if there are areas.
///
/// # Errors
/// `NoRoute` without lanelets, or if one leads on from none before it.
pub fn route_through(
    road: &RoadNetwork,
    start: Pose,
    velocity: f64,
    lanelets: &[usize],
    goal_areas: &[PlacedShape],
    settings: &RouteSettings,
) -> Result<Route> {
    let Some(first) = lanelets.first() else { return Err(Error::NoRoute("a route needs a lanelet".into())) };
    let mut steps = vec![Step::ahead(*first)];
    for pair in lanelets.windows(2) {
        let own = &road.lanelets()[pair[0]];
        let is_ahead = road.successors_straightest_first(pair[0]).contains(&pair[1]);
        if !is_ahead && ![own.adjacent_left, own.adjacent_right].contains(&Some((pair[1], true))) {
            let [from, to] = [pair[0], pair[1]].map(|lanelet| road.lanelets()[lanelet].id);
            return Err(Error::NoRoute(format!("lanelet {from} does not lead to lanelet {to}")));
        }
        steps.push(Step { lanelet: pair[1], is_change: !is_ahead });
    }
    let center = &road.lanelets()[*first].center;
    let start_s = center.project_between(start.position, 0.0, center.length()).s;
    let last = lanelets[lanelets.len() - 1];
    let exit = road.lanelets()[last].length;
    let entry = (exit - GOAL_LENGTH).max(0.0);
    let goal = GoalPlace { lanelet: last, entry, exit, offset: 0.0, is_aside: false };
    if goal_areas.is_empty() {
        return without_goal(road, (start, velocity), start_s, steps, settings);
    }
    over(road, (start, velocity), start_s, steps, (Some(goal), goal_areas), settings)
}

/// The route over steps from a pose at an arc length of the first one [m].
fn without_goal(
    road: &RoadNetwork,
    (start, velocity): (Pose, f64),
    start_s: f64,
    steps: Vec<Step>,
    settings: &RouteSettings,
) -> Result<Route> {
    over(road, (start, velocity), start_s, steps, (None, &[]), settings)
}

fn admits(road: &RoadNetwork, lanelet: usize, settings: &RouteSettings) -> bool {
    road.lanelets()[lanelet].users.admits(settings.user)
}

fn steps_from(
    road: &RoadNetwork,
    (first, start_s): (usize, f64),
    track: &[Point],
    keeps_lane: bool,
    settings: &RouteSettings,
) -> Vec<Step> {
    let mut steps = vec![Step::ahead(first)];
    let mut left = settings.free_length + start_s - road.lanelets()[first].length;
    let mut at = 0;
    while left > 0.0 && steps.len() < LANELET_CHAIN_MAX {
        let mut lanelet = steps[steps.len() - 1].lanelet;
        let center = &road.lanelets()[lanelet].center;
        at = nearest(track, center.at(center.length()), at);
        while let Some(beside) =
            track.get(at).filter(|_| !keeps_lane).and_then(|point| nearer_lane(road, lanelet, *point, settings))
        {
            steps.push(Step { lanelet: beside, is_change: true });
            lanelet = beside;
        }
        let ahead = road.successors_straightest_first(lanelet);
        let lanes: Vec<usize> = ahead.iter().copied().filter(|i| admits(road, *i, settings)).collect();
        let branches = if lanes.is_empty() { ahead } else { &lanes[..] };
        let next = match branches {
            [] => {
                let Some(beside) = beside_end(road, lanelet, track, at, settings) else { break };
                Step { lanelet: beside, is_change: true }
            }
            [only] => Step::ahead(*only),
            _ => Step::ahead(chosen(road, branches, track, at)),
        };
        if steps.contains(&next) && next.is_change {
            break;
        }
        if !next.is_change {
            left -= road.lanelets()[next.lanelet].length;
        }
        steps.push(next);
    }
    steps
}

/// The lanelet, of several that begin at one place, along which a track goes from point `at` on; the first one where it
/// ends there.
fn chosen(road: &RoadNetwork, branches: &[usize], track: &[Point], at: usize) -> usize {
    let mut length = 0.0;
    let ahead: Vec<Point> = track[at.min(track.len())..]
        .windows(2)
        .map_while(|pair| {
            length += pair[0].distance(pair[1]);
            (length <= COMPARED_LENGTH).then_some(pair[1])
        })
        .collect();
    if branches.len() < 2 || length < BEYOND_FORK_MIN || ahead.is_empty() {
        return branches[0];
    }
    let distance = |branch: &usize| {
        let center = &road.lanelets()[*branch].center;
        let line = lengthened(road, *branch, center);
        ahead
            .iter()
            .map(|point| point.distance(line.at(line.project_between(*point, 0.0, line.length()).s)))
            .sum::<f64>()
    };
    let costs: Vec<f64> = branches.iter().map(distance).collect();
    let best = (0..branches.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]));
    best.map_or(branches[0], |best| branches[best])
}

/// A centre line, lengthened straight on so that short branches can be told apart from long ones.
fn lengthened(road: &RoadNetwork, lanelet: usize, center: &Polyline) -> Polyline {
    let (length, mut points) = (center.length(), center.points().to_vec());
    let mut at = lanelet;
    let mut missing = COMPARED_LENGTH - length;
    while missing > 0.0 {
        let Some(next) = road.successors_straightest_first(at).first().copied() else { break };
        let line = &road.lanelets()[next].center;
        points.extend_from_slice(&line.points()[1..]);
        missing -= line.length().max(1e-3);
        at = next;
    }
    Polyline::new(&points).unwrap_or_else(|_| center.clone())
}

/// The lane beside a lane whose centre is nearer to a point.
fn nearer_lane(road: &RoadNetwork, lanelet: usize, point: Point, settings: &RouteSettings) -> Option<usize> {
    let distance = |i: usize| {
        let center = &road.lanelets()[i].center;
        point.distance(center.at(center.project_between(point, 0.0, center.length()).s))
    };
    let own = &road.lanelets()[lanelet];
    let beside = [own.adjacent_left, own.adjacent_right].into_iter().flatten().filter(|(_, same)| *same);
    let lanes = beside.map(|(index, _)| index).filter(|i| admits(road, *i, settings));
    lanes.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).filter(|i| distance(*i) < distance(lanelet))
}

/// The lane beside one that ends: the one nearer to the track, of those that go on.
fn beside_end(
    road: &RoadNetwork,
    lanelet: usize,
    track: &[Point],
    at: usize,
    settings: &RouteSettings,
) -> Option<usize> {
    let own = &road.lanelets()[lanelet];
    let end = own.center.at(own.center.length());
    let target = track.get(at).copied().unwrap_or(end);
    let beside = [own.adjacent_left, own.adjacent_right].into_iter().flatten().filter(|(_, same)| *same);
    beside
        .map(|(index, _)| index)
        .filter(|i| admits(road, *i, settings) && !road.successors_straightest_first(*i).is_empty())
        .min_by(|a, b| {
            let distance = |i: &usize| {
                let center = &road.lanelets()[*i].center;
                center.at(center.length()).distance(target)
            };
            distance(a).total_cmp(&distance(b))
        })
}

/// The point of a track from `from` on that is nearest to a place.
fn nearest(track: &[Point], place: Point, from: usize) -> usize {
    (from..track.len())
        .min_by(|a, b| track[*a].distance(place).total_cmp(&track[*b].distance(place)))
        .unwrap_or(track.len())
}
