//! Rules of the road along the path of an agent: speed limits, traffic lights, stop signs, crosswalks, blinkers. They follow
//! from the map and the lights as they are now; what an agent remembers (of a stop sign, a light, a crosswalk) is part of the
//! world. Right of way at junctions: `right_of_way`.

mod blinkers;
mod crosswalks;
mod line_memory;

pub(crate) use crate::conduct::{EARLY_ACCELERATION, travel_time};
use blinkers::Change;
pub use blinkers::Indicator;
pub(crate) use blinkers::{SHOWN_TIME, Turning};
pub(crate) use crosswalks::{Crosswalk, uses_crosswalks};
pub(crate) use line_memory::LineMemory;
use line_memory::is_near;

use crate::conduct::could_stop;
use std::sync::LazyLock;

use crate::barrier::{Barrier, BarrierReason, Barriers};
use crate::control::{Control, Signal};
use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;
use crate::road::RoadNetwork;
use crate::route::PathPiece;
use crate::scenario::Scenario;
use crate::settings::{between, positive, settings};
use crate::turn::Turn;

/// Spacing of the grid of speed limits [m].
const SPACING: f64 = 2.0;
/// Lanelets that the path leaves or enters overlap with those beside and behind them up to this far from their ends [m].
const OVERLAP_MAX: f64 = 25.0;
/// Stop lines reach beyond their ends by this [m]: paths do not keep to the middle of a lane.
const LINE_MARGIN: f64 = 1.0;
/// An agent that has turned right on red goes last until its front is so far behind the line [m].
const BEHIND_LINE: f64 = 15.0;
/// A stop counts at most so far before the line [m].
pub const STOP_REACH: f64 = 2.0;

settings! {
    /// Rules of the road that an agent obeys; with planners `recorded` and `velocity_adjusting` it obeys none.
    pub struct RulesSettings as RulesSettings {
        /// Whether an agent obeys any rule of the road.
        enabled: bool = true;
        /// Keep to speed limits.
        speed: bool = true;
        /// Stop for traffic lights.
        lights: bool = true;
        /// Stop at stop signs.
        stop_signs: bool = true;
        /// Turn right on red after standing before the line, where the country or a sign allows it.
        right_on_red: bool = true;
        /// Give way to people on crosswalks.
        crossings: bool = true;
        /// Give way at junctions: enter only when no other vehicle will use the way across, provided that others keep
        /// to the same order.
        precedence: bool = true;
        /// Do not enter a junction without room to leave it.
        keep_clear: bool = true;
        /// Be careful at junctions where buildings or parked vehicles hide a road with priority, if `view.occlusion`.
        unseen: bool = true;
        /// Pass standing vehicles and obstacles over the oncoming lane where the line between the lanes may be crossed
        /// and no vehicle is oncoming; planner `rollout` only.
        passing: bool = true;
        /// Rely on vehicles that do not obey to give way at junctions where they should, even if they would have to
        /// brake hard.
        trust_others: bool = false;
        /// Show lane changes by blinkers, and which way the agent takes at a fork, with any planner. `rollout` shows a
        /// change for 3 s before it begins. Predictions take the way at a fork, with less spread along bends.
        blinkers: bool = true;
        /// Factor applied to posted speed limits.
        speed_factor: f64 = 1.0, positive(3.0);
        /// Standing time at a stop sign, and before turning right on red.
        stop_duration: f64 ["s"] = 1.0, between(0.0, 60.0);
        /// Least time between leaving a conflict zone and the next vehicle's arrival.
        lead: f64 ["s"] = 1.0, between(0.0, 60.0);
        /// Least time between the previous vehicle's leaving a conflict zone and entering it.
        lag: f64 ["s"] = 0.3, between(0.0, 60.0);
        /// Standing time after which half of `lead` suffices.
        impatience: f64 ["s"] = 10.0, positive(f64::INFINITY);
        /// Standing time after which one of several agents that wait for each other in a circle may enter a junction
        /// without room to leave it.
        circle_after: f64 ["s"] = 5.0, positive(f64::INFINITY);
    }
}

/// Speed limits along a path.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct SpeedLimits {
    /// Limit [m/s] from a multiple of the spacing on, where it changes; infinite where there is none.
    changes: Vec<(usize, f64)>,
}

impl SpeedLimits {
    /// Of the lanelets that the path lies on; the highest where several overlap.
    pub fn along(path: &ReferencePath, pieces: &[PathPiece], road: &RoadNetwork, factor: f64) -> Self {
        let limit_of = |lanelet: usize| {
            let limit = road.lanelets()[lanelet].speed_limit;
            if limit.is_nan() { f64::INFINITY } else { factor * limit }
        };
        if pieces.iter().all(|piece| limit_of(piece.lanelet).is_infinite()) {
            return Self::default();
        }
        let limit_at = |i: usize| {
            let s = i as f64 * SPACING;
            let here = road.lanelets_at(path.at(s).position);
            let near = || pieces.iter().filter(|piece| piece.distance(s) <= OVERLAP_MAX);
            let below = near().filter(|piece| here.contains(&piece.lanelet));
            let highest = below.map(|piece| limit_of(piece.lanelet)).reduce(f64::max);
            // Between lanes of different widths the path may lie in a lanelet of neither.
            highest.or_else(|| near().find(|piece| piece.holds(s)).map(|piece| limit_of(piece.lanelet)))
        };
        let n = (path.length() / SPACING) as usize + 1;
        let mut changes: Vec<(usize, f64)> = Vec::new();
        for i in 0..n {
            let limit = limit_at(i).unwrap_or(f64::INFINITY);
            if changes.last().is_none_or(|(_, before)| *before != limit) {
                changes.push((i, limit));
            }
        }
        changes.shrink_to_fit();
        Self { changes }
    }

    /// The same limit everywhere [m/s].
    #[cfg(test)]
    pub(crate) fn uniform(limit: f64) -> Self {
        Self { changes: vec![(0, limit)] }
    }

    /// There is a limit somewhere.
    pub fn any(&self) -> bool {
        !self.changes.is_empty()
    }

    /// The limit at an arc length [m/s].
    pub fn at(&self, s: f64) -> f64 {
        let index = (s / SPACING).max(0.0) as usize;
        let behind = match self.changes[..] {
            [] => return f64::INFINITY,
            [(_, limit)] => return limit,
            _ => self.changes.partition_point(|(first, _)| *first <= index),
        };
        self.changes[behind - 1].1
    }

    /// The limit at an arc length [m], or the nearest one that is stated within a distance [m/s].
    pub fn nearest(&self, s: f64, within: f64) -> Option<f64> {
        if !self.any() {
            return None;
        }
        let steps = (within / SPACING) as usize;
        let ways = (0..=steps).map(|i| i as f64 * SPACING);
        let around = ways.flat_map(|way| [self.at(s + way), self.at(s - way)]);
        around.into_iter().find(|limit| limit.is_finite())
    }
}

/// Where a path crosses a stop line.
#[derive(Debug, Clone, PartialEq)]
struct Crossing {
    /// Arc length on the path [m].
    s: f64,
    /// Position of the line in `Control::lines`.
    line: usize,
    /// Positions in `Control::lights` of the lights that count for the way behind the line.
    lights: Vec<usize>,
    /// It may be passed on red after stopping.
    turns_on_red: bool,
}

/// What the rules of the road say about a path, worked out once.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Way {
    /// Its speed limits.
    pub limits: SpeedLimits,
    crossings: Vec<Crossing>,
    crosswalks: Vec<Crosswalk>,
    turnings: Vec<Turning>,
    lane_changes: Vec<Change>,
}

impl Way {
    /// Of a path with its pieces, as far as these settings obey it.
    pub fn along(path: &ReferencePath, pieces: &[PathPiece], scenario: &Scenario, settings: &RulesSettings) -> Self {
        let mut way = Self::without_crosswalks(path, pieces, scenario, settings);
        let lanelets: &[usize] = &pieces.iter().map(|piece| piece.lanelet).collect::<Vec<_>>();
        if settings.enabled && settings.crossings && !scenario.control.crosswalks.is_empty() {
            way.crosswalks = Crosswalk::along(path, lanelets, &scenario.control, &scenario.road);
        }
        if settings.enabled && settings.blinkers {
            way.turnings = Turning::along(pieces, &scenario.control, &scenario.road);
            way.lane_changes = Change::along(pieces, &scenario.road);
        }
        way
    }

    /// The same without crosswalks and turns: agents look for people, and show their turns, on their reference paths only.
    pub fn without_crosswalks(
        path: &ReferencePath,
        pieces: &[PathPiece],
        scenario: &Scenario,
        settings: &RulesSettings,
    ) -> Self {
        if !settings.enabled {
            return Self::default();
        }
        let limits = if settings.speed {
            SpeedLimits::along(path, pieces, &scenario.road, settings.speed_factor)
        } else {
            SpeedLimits::default()
        };
        let mut crossings = Vec::new();
        for (index, line) in scenario.control.lines.iter().enumerate() {
            if !pieces.iter().any(|piece| piece.lanelet == line.lanelet) {
                continue;
            }
            for s in arc_lengths_at(path, line.ends) {
                // The path may lie in a lanelet more than once, and a lane change before or behind the line leads past it.
                let there = (0..pieces.len()).filter(|i| pieces[*i].lanelet == line.lanelet);
                let nearest = there.min_by(|a, b| pieces[*a].distance(s).total_cmp(&pieces[*b].distance(s)));
                let Some(place) = nearest.filter(|place| pieces[*place].has(s)) else { continue };
                let lights_to = |piece: &PathPiece| line.lights.iter().find(|(next, _)| *next == piece.lanelet);
                let taken = pieces[place..].iter().find_map(lights_to);
                let lights = taken.map_or_else(
                    || line.lights.iter().flat_map(|(_, lights)| lights.iter().copied()).collect(),
                    |(_, lights)| lights.clone(),
                );
                let turns_on_red =
                    settings.right_on_red && taken.is_some_and(|(next, _)| line.turns_on_red.contains(next));
                crossings.push(Crossing { s, line: index, lights, turns_on_red });
            }
        }
        crossings.sort_by(|a, b| a.s.total_cmp(&b.s));
        Self { limits, crossings, ..Self::default() }
    }

    /// The crosswalks on the path, in its order, if they are obeyed.
    pub fn crosswalks(&self) -> &[Crosswalk] {
        &self.crosswalks
    }

    /// What an agent with its front and its rear at these arc lengths [m] shows of the way that it takes.
    pub fn turning(&self, front: f64, rear: f64, velocity: f64) -> Option<&Turning> {
        Turning::shown(&self.turnings, front, rear, velocity)
    }

    /// The side of the lane change of the path that it shows.
    pub fn lane_change(&self, front: f64, rear: f64, velocity: f64) -> Option<Turn> {
        self.lane_changes.iter().find(|change| change.is_shown(front, rear, velocity)).map(|change| change.side)
    }

    /// Arc lengths of the stop lines on the path [m], ascending, and their positions in `Control::lines`.
    pub fn lines(&self) -> impl Iterator<Item = (f64, usize)> {
        self.crossings.iter().map(|crossing| (crossing.s, crossing.line))
    }
}

/// Arc lengths at which a path crosses a line [m].
fn arc_lengths_at(path: &ReferencePath, [a, b]: [Point; 2]) -> impl Iterator<Item = f64> {
    let length = a.distance(b).max(1e-6);
    let beyond = (b - a) * (LINE_MARGIN / length);
    let (from, along) = (a - beyond, b - a + beyond * 2.0);
    let knot = |i: usize| Point::new(path.x()[i], path.y()[i]);
    (1..path.x().len()).filter_map(move |i| {
        let (start, step) = (knot(i - 1), knot(i) - knot(i - 1));
        let cross = step.cross(along);
        let (t, u) = ((from - start).cross(along) / cross, (from - start).cross(step) / cross);
        // Not a number if they are parallel: no crossing.
        ((0.0..1.0).contains(&t) && (0.0..=1.0).contains(&u)).then(|| (i as f64 - 1.0 + t) * path.spacing())
    })
}

/// The rules of the road for an agent at one time step.
#[derive(Debug, Clone, Copy)]
pub struct Rules<'a> {
    /// Lights and lines.
    pub control: &'a Control,
    /// What the agent obeys.
    pub settings: &'a RulesSettings,
    /// What they say about its reference path.
    pub(crate) way: &'a Way,
    /// Now.
    pub time_step: i64,
    /// When the agent entered.
    pub entered: i64,
    /// Time between steps [s].
    pub dt: f64,
    /// Way since the agent stood long enough to pass a line after stopping [m].
    pub served: Option<f64>,
    /// Distance to the line that it was too near to stop at when its light changed [m].
    pub passing: Option<f64>,
    /// Arc length of its front on its reference path [m].
    pub front: f64,
    /// What it was told there: crosswalks in use, orders at junctions, agreements.
    pub told: Barriers,
}

static NO_CONTROL: LazyLock<Control> = LazyLock::new(Control::default);
static NO_WAY: Way = Way {
    limits: SpeedLimits { changes: Vec::new() },
    crossings: Vec::new(),
    crosswalks: Vec::new(),
    turnings: Vec::new(),
    lane_changes: Vec::new(),
};
static NO_SETTINGS: RulesSettings = RulesSettings {
    enabled: false,
    speed: false,
    lights: false,
    stop_signs: false,
    right_on_red: false,
    crossings: false,
    precedence: false,
    keep_clear: false,
    unseen: false,
    passing: false,
    trust_others: false,
    blinkers: false,
    speed_factor: 1.0,
    stop_duration: 0.0,
    lead: 0.0,
    lag: 0.0,
    impatience: f64::INFINITY,
    circle_after: f64::INFINITY,
};

impl Default for Rules<'_> {
    /// No rules.
    fn default() -> Self {
        Self {
            control: &NO_CONTROL,
            settings: &NO_SETTINGS,
            way: &NO_WAY,
            time_step: 0,
            entered: 0,
            dt: 0.1,
            served: None,
            passing: None,
            front: 0.0,
            told: Barriers::NONE,
        }
    }
}

impl Rules<'_> {
    /// The barriers of a way for an agent with its front at an arc length of it [m]: the nearest stop sign and the
    /// nearest light that hold the agent, and what it was told, as far ahead as on its reference path.
    ///
    /// A light that is not green holds the agent unless it was too near when the light changed: stopping took more than
    /// `EXPECTED_DECELERATION` at its present speed. One that has slowed down since remembers that it was (`passing`), as
    /// long as it still cannot stop.
    pub(crate) fn barriers(&self, way: &Way, front: f64, velocity: f64) -> Barriers {
        let mut found = Barriers::NONE;
        let mut ahead = way.crossings.iter().filter(|crossing| crossing.s > front);
        let sign = ahead.clone().find(|crossing| self.is_held_by_sign(crossing, front, velocity));
        found.extend(sign.map(|crossing| Barrier::lasting(crossing.s, BarrierReason::Line)));
        let light = ahead.find(|crossing| self.is_held_by_light(crossing, front, velocity));
        found.extend(light.map(|crossing| Barrier::lasting(crossing.s, BarrierReason::Light)));
        found.extend(self.told.iter().map(|told| Barrier { s: front + (told.s - self.front), ..*told }));
        found
    }

    /// An agent with its front at an arc length of a way [m] is about to turn right on red, or has just passed the line: it
    /// goes last.
    pub(crate) fn turns_on_red(&self, way: &Way, front: f64) -> bool {
        let is_next = |one: &&Crossing| one.s > front - BEHIND_LINE && (one.s <= front || self.is_served(one, front));
        self.settings.lights && way.crossings.iter().filter(is_next).any(|one| self.is_turn_on_red(one))
    }

    fn is_turn_on_red(&self, crossing: &Crossing) -> bool {
        crossing.turns_on_red && self.control.signal(&crossing.lights, self.time_step) == Signal::Red
    }

    /// Its lights were green or dark so many time steps ago.
    fn may_pass(&self, crossing: &Crossing, steps: i64) -> bool {
        self.control.signal(&crossing.lights, self.time_step - steps).lets_go()
    }

    /// The agent has stood long enough before a line, no farther away than counts.
    fn is_served(&self, crossing: &Crossing, front: f64) -> bool {
        self.served.is_some_and(|moved| crossing.s - front + moved <= STOP_REACH)
    }

    fn holds(&self, crossing: &Crossing, front: f64, velocity: f64) -> bool {
        self.is_held_by_sign(crossing, front, velocity) || self.is_held_by_light(crossing, front, velocity)
    }

    /// So many time steps ago the agent could have stopped before a line, at its present speed.
    fn could_stop(&self, crossing: &Crossing, front: f64, velocity: f64, steps: i64) -> bool {
        could_stop(velocity, crossing.s - front + velocity * steps as f64 * self.dt)
    }

    fn since_entry(&self) -> i64 {
        (self.time_step - self.entered).max(0)
    }

    fn is_held_by_sign(&self, crossing: &Crossing, front: f64, velocity: f64) -> bool {
        self.settings.stop_signs
            && self.control.lines[crossing.line].has_stop_sign
            && !self.is_served(crossing, front)
            && self.could_stop(crossing, front, velocity, self.since_entry())
    }

    fn is_held_by_light(&self, crossing: &Crossing, front: f64, velocity: f64) -> bool {
        if !self.settings.lights || crossing.lights.is_empty() || self.may_pass(crossing, 0) {
            return false;
        }
        if self.is_served(crossing, front) && self.is_turn_on_red(crossing) {
            return false;
        }
        let could_stop = |steps: i64| self.could_stop(crossing, front, velocity, steps);
        let is_passing = self.passing.is_some_and(|distance| is_near(crossing.s - front, distance));
        if is_passing && !could_stop(0) {
            return false;
        }
        // Either it could have stopped when the light changed, or it is found too near for that.
        let is_new = |steps: &i64| !self.may_pass(crossing, *steps) && !could_stop(*steps - 1);
        could_stop((1..=self.since_entry()).take_while(is_new).count() as i64)
    }
}

#[cfg(test)]
mod tests;
