//! From a start pose to a goal: which lanelets, and the reference path along them.

mod along;
mod corridor;
mod search;
#[cfg(test)]
mod tests;

use crate::error::{Error, Result};
use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::PlacedShape;
use crate::geometry::{Point, Pose};
use crate::road::{LaneMatch, RoadNetwork};
use crate::vehicle::ParticipantKind;
pub use along::{route_along, route_through};
use corridor::{Corridor, Stretch};
use search::{GoalPlace, Step};

/// Spacing [m] at which a path is tested for being inside a goal area.
const GOAL_SAMPLING: f64 = 0.1;
/// The path is tested this far [m] beyond the goal area's place on the lanelet.
const GOAL_MARGIN: f64 = 30.0;
/// A piece is at least this long [m].
const LENGTH_MIN: f64 = 1e-3;
/// The foot of a place of the map on a path is searched this far around where it is expected [m]: smoothing and blends
/// between lanes shift arc lengths.
pub(crate) const FOOT_WINDOW: f64 = 25.0;
/// How far [m] an arc length on the smooth path may differ from that on the centre lines.
const HINT_WINDOW: f64 = 20.0;

/// How routes and paths are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RouteSettings {
    /// A lane change takes this long at the start velocity [s] ...
    pub lane_change_time: f64,
    /// ... but no less than this length [m], where there is room.
    pub lane_change_length_min: f64,
    /// The path goes on this far beyond the goal [m].
    pub extension: f64,
    /// The path begins at least this far before the start [m].
    pub lead_in: f64,
    /// The start may lie outside its lanelet by this much [m].
    pub start_tolerance: f64,
    /// Without a goal position the route is this long [m], if the road is.
    pub free_length: f64,
    /// Whose way it is: lanelets that are no lane for it are used only where nothing else leads to the goal.
    pub user: ParticipantKind,
}

impl Default for RouteSettings {
    fn default() -> Self {
        Self {
            lane_change_time: 4.0,
            lane_change_length_min: 30.0,
            extension: 150.0,
            lead_in: 35.0,
            start_tolerance: 1.5,
            free_length: 400.0,
            user: ParticipantKind::Car,
        }
    }
}

/// A stretch of a path within one lanelet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPiece {
    /// Index of the lanelet.
    pub lanelet: usize,
    /// Arc length of the lanelet's start on the path, or beside it [m].
    pub start: f64,
    /// ... and of its end [m].
    pub end: f64,
    /// Arc length at which the path changes into this lane [m]; minus infinity where it comes from the lanelet before.
    pub from: f64,
    /// Arc length at which it leaves this lane for the one beside [m]; infinity where it goes on to the lanelet behind.
    pub to: f64,
}

impl PathPiece {
    /// From the start of a lanelet to its end, at arc lengths of a path [m].
    pub fn whole(lanelet: usize, start: f64, end: f64) -> Self {
        Self { lanelet, start, end: end.max(start + LENGTH_MIN), from: f64::NEG_INFINITY, to: f64::INFINITY }
    }

    /// Those of a path along a chain of lanelets without lane changes.
    pub fn chain(path: &ReferencePath, lanelets: &[usize], road: &RoadNetwork) -> Vec<Self> {
        let mut expected = None;
        let piece = |lanelet: &usize| {
            let center = &road.lanelets()[*lanelet].center;
            let start = match expected {
                Some(expected) => near_hint(path, center.at(0.0), expected),
                None => path.project(center.at(0.0)).map_or(0.0, |foot| foot.0),
            };
            let end = near_hint(path, center.at(center.length()), start + center.length());
            expected = Some(end);
            Self::whole(*lanelet, start, end)
        };
        lanelets.iter().map(piece).collect()
    }

    /// Distance of an arc length from the lanelet [m]; 0 within it.
    pub fn distance(&self, s: f64) -> f64 {
        (self.start - s).max(s - self.end).max(0.0)
    }

    /// The path lies in this lanelet at an arc length [m].
    pub fn holds(&self, s: f64) -> bool {
        self.has(s) && self.distance(s) <= 0.0
    }

    /// A lane change leads into it or out of it.
    pub fn is_cut(&self) -> bool {
        self.from.is_finite() || self.to.is_finite()
    }

    /// No lane change leads past this lanelet at an arc length [m].
    pub fn has(&self, s: f64) -> bool {
        (self.from..self.to).contains(&s)
    }
}

/// Lanelets from start to goal and a smooth path along their middle.
#[derive(Debug, Clone)]
pub struct Route {
    /// Indices of the lanelets in driving order; both lanelets of a lane change are in it.
    pub lanelets: Vec<usize>,
    /// The lanelets in which the path lies, in its order. Where the lane changes they are not those of the route: between
    /// two lanes that run side by side for several lanelets, the path crosses over anywhere.
    pub pieces: Vec<PathPiece>,
    /// Along the lane centres, with blends where the lane changes, from before the start to beyond the goal.
    pub path: ReferencePath,
    /// Arc length of the start on the path [m].
    pub start_s: f64,
    /// Arc length where the path first enters a goal area [m]; NaN if the goal has no position. If the path only passes
    /// beside the areas, both goal arc lengths are those of the nearest area's centre.
    pub goal_entry_s: f64,
    /// Arc length where the path leaves the goal areas for the last time [m]; NaN if the goal has no position.
    pub goal_exit_s: f64,
    /// Number of lane changes.
    pub lane_changes: usize,
    /// Whose way it is.
    pub user: ParticipantKind,
}

impl Route {
    /// Whether a lanelet is a lane for the user, or the route cannot do without it.
    pub fn may_use(&self, road: &RoadNetwork, lanelet: usize) -> bool {
        road.lanelets()[lanelet].users.admits(self.user) || self.lanelets.contains(&lanelet)
    }
}

/// The route over the fewest lanelets that are no lane for its user; among those with the fewest lane changes; among
/// those the shortest; among those by lanelet ids.
///
/// It starts on a lanelet that the start pose fits (within `start_tolerance` and 90 degrees) and ends on one whose
/// centre line crosses a goal area or that contains an area's centre. Where several overlap at the start, those count
/// whose direction is within 10 degrees of the best and whose offset is within 1 m of the least; others only if none of
/// these leads to the goal. A lateral offset of 1 m at start or goal counts like 5 m of length. Without goal areas it
/// follows the lane straight on.
///
/// # Errors
/// `NoRoute` if start or goal lie on no lanelet or are not connected; the text names the lanelets.
pub fn find_route(
    road: &RoadNetwork,
    start: Pose,
    velocity: f64,
    goal_areas: &[PlacedShape],
    settings: &RouteSettings,
) -> Result<Route> {
    let starts = road.matching(start, settings.start_tolerance, std::f64::consts::FRAC_PI_2);
    if starts.is_empty() {
        return Err(Error::NoRoute(format!(
            "no lanelet within {} m of the start ({:.2}, {:.2}) leads in its direction",
            settings.start_tolerance, start.position.x, start.position.y
        )));
    }
    let (steps, start_s, goal) = if goal_areas.is_empty() {
        let is_lane = |start: &&LaneMatch| road.lanelets()[start.lanelet].users.admits(settings.user);
        let first = *starts.iter().find(is_lane).unwrap_or(&starts[0]);
        let chain = road.paths_from(first.lanelet, first.s, settings.free_length, 1).remove(0);
        (chain.into_iter().map(Step::ahead).collect(), first.s, None)
    } else {
        let goals = search::goal_places(road, goal_areas)?;
        let best = search::best_starts(road, &starts, start.position);
        let search = |starts: &[LaneMatch]| search::search(road, settings.user, starts, start.position, &goals);
        let found =
            search(&best).or_else(|error| if best.len() < starts.len() { search(&starts) } else { Err(error) })?;
        (found.steps, found.start_s, Some(found.goal))
    };
    over(road, (start, velocity), start_s, steps, (goal, goal_areas), settings)
}

/// The route over steps from a pose at an arc length of the first one [m] to a place, if there is one, with these areas.
fn over(
    road: &RoadNetwork,
    (start, velocity): (Pose, f64),
    start_s: f64,
    steps: Vec<Step>,
    (goal, goal_areas): (Option<GoalPlace>, &[PlacedShape]),
    settings: &RouteSettings,
) -> Result<Route> {
    let blend_length = (settings.lane_change_time * velocity.max(0.0)).max(settings.lane_change_length_min);
    let corridor = Corridor::along(road, &steps, start_s, goal.as_ref(), blend_length, settings);
    let path = ReferencePath::through(&corridor.points)?;
    let start_s = near_hint(&path, start.position, corridor.start_hint);
    let (goal_entry_s, goal_exit_s) = match goal {
        Some(_) => goal_interval(&path, goal_areas, start_s, corridor.goal_hint),
        None => (f64::NAN, f64::NAN),
    };
    Ok(Route {
        pieces: pieces(&path, &corridor, road),
        lane_changes: steps.iter().filter(|step| step.is_change).count(),
        lanelets: steps.into_iter().map(|step| step.lanelet).collect(),
        path,
        start_s,
        goal_entry_s,
        goal_exit_s,
        user: settings.user,
    })
}

/// The lanelets of a corridor with where they are on its smooth path, and where the lane changes.
fn pieces(path: &ReferencePath, corridor: &Corridor, road: &RoadNetwork) -> Vec<PathPiece> {
    let mut pieces: Vec<PathPiece> = Vec::with_capacity(corridor.lanelets.len());
    for Stretch { lanelet, start, changed } in &corridor.lanelets {
        let center = &road.lanelets()[*lanelet].center;
        let start = near_hint(path, center.at(0.0), *start);
        let end = near_hint(path, center.at(center.length()), start + center.length());
        let from = changed.map(|(point, hint)| near_hint(path, point, hint));
        if let (Some(from), Some(before)) = (from, pieces.last_mut()) {
            before.to = from;
        }
        pieces.push(PathPiece { from: from.unwrap_or(f64::NEG_INFINITY), ..PathPiece::whole(*lanelet, start, end) });
    }
    pieces
}

/// Arc length of a point on the path, near where it is on the centre lines.
fn near_hint(path: &ReferencePath, point: Point, hint: f64) -> f64 {
    path.project_near(point, hint, HINT_WINDOW).map_or(hint.clamp(0.0, path.length()), |foot| foot.0)
}

/// Where the path is inside a goal area, from the start to a little beyond the goal.
fn goal_interval(path: &ReferencePath, areas: &[PlacedShape], start_s: f64, goal_hint: f64) -> (f64, f64) {
    let last = (goal_hint + GOAL_MARGIN).max(start_s + GOAL_MARGIN).min(path.length());
    let n = ((last - start_s) / GOAL_SAMPLING).floor().max(0.0) as usize;
    let arc_lengths = (0..=n).map(|i| start_s + i as f64 * GOAL_SAMPLING);
    let inside = arc_lengths.filter(|s| {
        let position = path.at(*s).position;
        areas.iter().any(|area| area.contains(position))
    });
    let interval = inside.fold((f64::NAN, f64::NAN), |(entry, _), s| (if entry.is_nan() { s } else { entry }, s));
    if !interval.0.is_nan() {
        return interval;
    }
    let beside = areas
        .iter()
        .filter_map(|area| path.project_near(area.center(), goal_hint, HINT_WINDOW + GOAL_MARGIN))
        .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let s = beside.map_or(goal_hint, |foot| foot.0).max(start_s);
    (s, s)
}
