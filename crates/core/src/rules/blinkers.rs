//! What agents show by their blinkers: turns at forks of the road, and lane changes.

use crate::control::Control;
use crate::road::RoadNetwork;
use crate::route::PathPiece;
use crate::turn::Turn;

/// An agent shows its turn from this distance to the fork on [m], or from so long before it at its present speed [s].
const SHOWN_BEFORE: f64 = 30.0;
/// ... A lane change is shown as long before it begins.
pub(crate) const SHOWN_TIME: f64 = 3.0;
/// ... until its rear has left the lanelet behind the fork, or is so far behind it [m].
const SHOWN_BEHIND: f64 = 50.0;
/// A path begins a lane change so long before it is between both lanes [s].
const CHANGE_HALF: f64 = 2.0;

/// What an agent does at a fork on its way.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Turning {
    /// Indices of the lanelets behind the fork that it does not take.
    pub others: Vec<usize>,
    /// What it shows.
    pub turn: Turn,
    /// Arc length of the fork on the path, and of the place from which on it is shown no more [m].
    start: f64,
    end: f64,
}

impl Turning {
    /// Those on a path, by its pieces, in its order; also that behind which the path begins.
    pub(crate) fn along(pieces: &[PathPiece], control: &Control, road: &RoadNetwork) -> Vec<Self> {
        let is_fork = |before: usize, lanelet: usize| {
            let successors = &road.lanelets()[before].successors;
            successors.len() > 1 && successors.contains(&lanelet)
        };
        let mut before = road.predecessors_straightest_first(pieces[0].lanelet).first().copied();
        let mut forks = Vec::new();
        for (place, &PathPiece { lanelet, .. }) in pieces.iter().enumerate() {
            forks.extend(before.filter(|before| is_fork(*before, lanelet)).map(|before| (place, before)));
            before = Some(lanelet);
        }
        if forks.is_empty() {
            return Vec::new();
        }
        let turning = |(place, before): (usize, usize)| {
            let piece = &pieces[place];
            let others = road.lanelets()[before].successors.iter().copied().filter(|other| *other != piece.lanelet);
            Self {
                others: others.collect(),
                turn: turn(before, piece.lanelet, control, road),
                start: piece.start,
                end: piece.end.min(piece.start + SHOWN_BEHIND),
            }
        };
        forks.into_iter().map(turning).collect()
    }

    /// The one of several that is shown: the next fork, or the one just passed.
    pub(super) fn shown(all: &[Self], front: f64, rear: f64, velocity: f64) -> Option<&Self> {
        let in_reach = || all.iter().filter(|one| one.is_shown(front, rear, velocity));
        in_reach().find(|one| one.start > front).or_else(|| in_reach().next_back())
    }

    /// It is shown by an agent with its front and its rear at these arc lengths [m].
    fn is_shown(&self, front: f64, rear: f64, velocity: f64) -> bool {
        front >= self.start - SHOWN_BEFORE.max(SHOWN_TIME * velocity) && rear <= self.end
    }
}

/// The turn onto a lanelet behind a fork: as the file states it, otherwise by its change of heading. Where the road goes
/// on and another lane leaves it by less, that one shows the side on which it does.
fn turn(before: usize, lanelet: usize, control: &Control, road: &RoadNetwork) -> Turn {
    if let Some(stated) = control.priorities.turns.get(&lanelet) {
        return *stated;
    }
    let center = &road.lanelets()[lanelet].center;
    let angle = |lanelet: usize| {
        let length = road.lanelets()[lanelet].length;
        Turn::of_angle(road.heading_at(lanelet, length) - road.heading_at(lanelet, 0.0))
    };
    let straightest = road.successors_straightest_first(before)[0];
    if angle(lanelet) != Turn::Straight || lanelet == straightest || angle(straightest) != Turn::Straight {
        return angle(lanelet);
    }
    let aside = road.lanelets()[straightest].center.project(center.at(center.length())).d;
    if aside > 0.0 { Turn::Left } else { Turn::Right }
}

/// A lane change of a path.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Change {
    pub side: Turn,
    /// Arc length at which the path is between both lanes [m].
    at: f64,
}

impl Change {
    /// Those of a path, by its pieces, in its order.
    pub(super) fn along(pieces: &[PathPiece], road: &RoadNetwork) -> Vec<Self> {
        let change = |pair: &[PathPiece]| {
            let [before, PathPiece { lanelet, from, .. }] = pair else { return None };
            let (left, right) =
                (road.lanelets()[before.lanelet].adjacent_left, road.lanelets()[before.lanelet].adjacent_right);
            let leads = |side: Option<(usize, bool)>| side.is_some_and(|(beside, _)| beside == *lanelet);
            let side = [(left, Turn::Left), (right, Turn::Right)].into_iter().find(|(side, _)| leads(*side))?.1;
            from.is_finite().then_some(Self { side, at: *from })
        };
        pieces.windows(2).filter_map(change).collect()
    }

    /// It is shown by an agent with its front and its rear at these arc lengths [m]: as before a fork, until all of it is in
    /// the new lane.
    pub(super) fn is_shown(&self, front: f64, rear: f64, velocity: f64) -> bool {
        front >= self.at - SHOWN_BEFORE.max((SHOWN_TIME + CHANGE_HALF) * velocity) && rear <= self.at
    }
}

/// The lane change that an agent shows which chooses its lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Indicator(Option<(Turn, i64)>);

impl Indicator {
    /// From a time step on it shows a side; nothing changes if it does so already.
    pub(crate) fn set(&mut self, side: Option<Turn>, time_step: i64) {
        if self.side() != side {
            self.0 = side.map(|side| (side, time_step));
        }
    }

    /// The side that it shows.
    pub(crate) fn side(&self) -> Option<Turn> {
        self.0.map(|(side, _)| side)
    }

    /// For how many time steps it has shown a side.
    pub(crate) fn steps(&self, side: Turn, time_step: i64) -> i64 {
        self.0.filter(|(shown, _)| *shown == side).map_or(0, |(_, since)| time_step - since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Priorities;
    use crate::geometry::Point;
    use crate::geometry::polyline::ReferencePath;
    use crate::road::testing::{arc, fork, lane, open, straight, with_successors};

    fn path(points: &[(f64, f64)]) -> ReferencePath {
        let points: Vec<Point> = points.iter().map(|(x, y)| Point::new(*x, *y)).collect();
        ReferencePath::through(&points).expect("a path")
    }

    /// The turn shown on the way from lanelet 1 (index 0) onto another one.
    fn shown(road: &RoadNetwork, control: &Control, lanelet: usize) -> Turn {
        let center = &road.lanelets()[lanelet].center;
        let way = path(&[(0.0, 0.0), (50.0, 0.0), (center.at(center.length()).x, center.at(center.length()).y)]);
        let found = Turning::along(&PathPiece::chain(&way, &[0, lanelet], road), control, road);
        assert_eq!(found.len(), 1);
        found[0].turn
    }

    #[test]
    fn the_turn_follows_from_the_change_of_heading_unless_the_file_states_it() {
        let road = fork();
        let mut control = Control::default();
        assert_eq!(shown(&road, &control, 1), Turn::Straight);
        assert_eq!(shown(&road, &control, 2), Turn::Left);
        control.priorities = Priorities { turns: [(2, Turn::Right)].into(), ..Priorities::default() };
        assert_eq!(shown(&road, &control, 2), Turn::Right);
    }

    #[test]
    fn a_lane_that_leaves_a_road_shows_its_side() {
        // An exit whose radius of 200 m turns by 0.2 rad, to the right of the road that goes on.
        let half = std::f64::consts::FRAC_PI_2;
        let road = open(vec![
            with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 3]),
            lane(2, &straight((50.0, 0.0), (100.0, 0.0))),
            lane(3, &arc((50.0, -200.0), 200.0, half, half - 0.2)),
        ]);
        assert_eq!(shown(&road, &Control::default(), 1), Turn::Straight);
        assert_eq!(shown(&road, &Control::default(), 2), Turn::Right);
    }

    #[test]
    fn it_is_shown_from_30_m_or_3_s_before_the_fork_until_the_rear_has_left_it() {
        let road = fork();
        let way = path(&[(0.0, 0.0), (50.0, 0.0), (100.0, 0.0)]);
        let found = Turning::along(&PathPiece::chain(&way, &[0, 1], &road), &Control::default(), &road).remove(0);
        // Arc lengths are x and a constant.
        let zero = way.project(Point::new(0.0, 0.0)).expect("a foot").0;
        let is_shown = |x: f64, velocity: f64| found.is_shown(zero + x, zero + x - 4.5, velocity);
        for (x, velocity, expected) in [
            (19.9, 5.0, false),
            (20.1, 5.0, true),
            (4.9, 15.0, false),
            (5.1, 15.0, true),
            (104.4, 5.0, true),
            (104.6, 5.0, false),
        ] {
            assert_eq!(is_shown(x, velocity), expected, "front at {x} m, {velocity} m/s");
        }
    }

    /// Lanes along x: 1 to 50 m, 2 to 60 m beside 20, which bends away, then 3 straight on and 4 in a quarter circle.
    fn two_forks() -> RoadNetwork {
        let half = std::f64::consts::FRAC_PI_2;
        open(vec![
            with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 20]),
            with_successors(lane(2, &straight((50.0, 0.0), (60.0, 0.0))), &[3, 4]),
            lane(3, &straight((60.0, 0.0), (100.0, 0.0))),
            lane(4, &arc((60.0, -20.0), 20.0, half, 0.0)),
            lane(20, &arc((50.0, 20.0), 20.0, -half, 0.0)),
        ])
    }

    #[test]
    fn the_next_of_two_forks_is_shown() {
        let road = two_forks();
        let control = Control::default();
        let way = path(&[(0.0, 0.0), (60.0, 0.0), (80.0, -20.0)]);
        let found = Turning::along(&PathPiece::chain(&way, &[0, 1, 3], &road), &control, &road);
        let zero = way.project(Point::new(0.0, 0.0)).expect("a foot").0;
        let shown = |x: f64| Turning::shown(&found, zero + x, zero + x - 4.5, 5.0).map(|one| one.turn);
        for (x, expected) in [
            (19.0, None),
            (25.0, Some(Turn::Straight)),
            (49.0, Some(Turn::Straight)),
            (51.0, Some(Turn::Right)),
            (62.0, Some(Turn::Right)),
        ] {
            assert_eq!(shown(x), expected, "front at {x} m");
        }
    }

    #[test]
    fn an_agent_that_starts_behind_a_fork_shows_its_way_there() {
        let road = fork();
        let way = path(&[(50.0, 0.0), (64.0, 6.0), (70.0, 20.0)]);
        let found = Turning::along(&PathPiece::chain(&way, &[2], &road), &Control::default(), &road);
        assert_eq!((found.len(), found[0].turn, found[0].others.as_slice()), (1, Turn::Left, [1].as_slice()));
    }

    #[test]
    fn a_loop_by_more_than_half_a_turn_keeps_its_side() {
        let half = std::f64::consts::FRAC_PI_2;
        let road = open(vec![
            with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 3]),
            lane(2, &straight((50.0, 0.0), (100.0, 0.0))),
            lane(3, &arc((50.0, -20.0), 20.0, half, half - 3.5)),
        ]);
        assert_eq!(turn(0, 2, &Control::default(), &road), Turn::Right);
    }

    #[test]
    fn a_road_without_a_fork_has_no_turns() {
        let road = open(vec![
            with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]),
            lane(2, &arc((50.0, 20.0), 20.0, -std::f64::consts::FRAC_PI_2, 0.0)),
        ]);
        let way = path(&[(0.0, 0.0), (50.0, 0.0), (70.0, 20.0)]);
        assert_eq!(Turning::along(&PathPiece::chain(&way, &[0, 1], &road), &Control::default(), &road), []);
    }

    #[test]
    fn a_lane_change_of_a_path_is_shown_from_30_m_or_5_s_before_until_the_rear_is_in_the_new_lane() {
        let side = Turn::Left;
        let change = Change { side, at: 100.0 };
        for (front, velocity, expected) in [
            (69.9, 5.0, false),
            (70.1, 5.0, true),
            (24.9, 15.0, false),
            (25.1, 15.0, true),
            (104.4, 15.0, true),
            (104.6, 15.0, false),
        ] {
            assert_eq!(change.is_shown(front, front - 4.5, velocity), expected, "front at {front} m, {velocity} m/s");
        }
    }

    #[test]
    fn an_indicator_counts_from_when_it_shows_its_side() {
        let mut indicator = Indicator::default();
        assert_eq!((indicator.side(), indicator.steps(Turn::Left, 3)), (None, 0));
        indicator.set(Some(Turn::Left), 4);
        indicator.set(Some(Turn::Left), 9);
        assert_eq!((indicator.steps(Turn::Left, 14), indicator.steps(Turn::Right, 14)), (10, 0));
        indicator.set(Some(Turn::Right), 15);
        assert_eq!((indicator.side(), indicator.steps(Turn::Right, 17)), (Some(Turn::Right), 2));
        indicator.set(None, 18);
        assert_eq!(indicator, Indicator::default());
    }
}
