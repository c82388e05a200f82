//! What an observer needs to know about its route and does not change: road edges beside the path, centre of the goal.

use crate::geometry::{Aabb, Point};
use crate::road::RoadNetwork;
use crate::route::Route;
use crate::scenario::{Goal, GoalState};

/// Spacing of the table [m].
const SPACING: f64 = 2.0;
/// Lateral distance within which road edges are sought beside the path [m].
const EDGE_REACH: f64 = 20.0;

/// Road edges beside a path, and the alternative of the goal that is observed.
#[derive(Debug, Clone, PartialEq)]
pub struct PathTable {
    /// Distance from the path to the first road edge on its left and right at every multiple of the spacing [m].
    sides: Vec<[f64; 2]>,
    /// Position of the alternative among those of the goal.
    pub(super) alternative: usize,
    /// Centre of its areas, world frame [m]; `None` without a position.
    pub(super) goal_center: Option<Point>,
}

impl PathTable {
    /// For a route and a goal with at least one alternative. Of several alternatives the one with the latest end is
    /// observed, the first of equals.
    pub fn new(route: &Route, goal: &Goal, road: &RoadNetwork) -> Self {
        let path = &route.path;
        let n = (path.length() / SPACING) as usize + 2;
        let mut near = Vec::new();
        let mut side = |from: Point, direction: Point| {
            let to = from + direction * EDGE_REACH;
            road.edges_near(&Aabb::around([from, to]), &mut near);
            let hits = near.iter().filter_map(|i| {
                let edge = &road.road_edges()[*i as usize];
                crossing(from, direction, edge.a, edge.b)
            });
            hits.fold(EDGE_REACH, f64::min)
        };
        let sides = (0..n)
            .map(|i| {
                let at = path.at(i as f64 * SPACING);
                let left = at.tangent().left();
                [side(at.position, left), side(at.position, -left)]
            })
            .collect();
        let later = |best: usize, i: usize| if end(&goal.states[i]) > end(&goal.states[best]) { i } else { best };
        let alternative = (1..goal.states.len()).fold(0, later);
        let areas = goal.states.get(alternative).map_or(&[][..], |state| &state.areas);
        let sum = areas.iter().fold(Point::default(), |sum, area| sum + area.center());
        let goal_center = (!areas.is_empty()).then(|| sum * (areas.len() as f64).recip());
        Self { sides, alternative, goal_center }
    }

    /// Distances from the path to the road edges on its left and right [m] at an arc length [m], interpolated.
    #[inline]
    pub fn at(&self, s: f64) -> [f64; 2] {
        let place = (s * (1.0 / SPACING)).clamp(0.0, (self.sides.len() - 1) as f64);
        let i = (place as usize).min(self.sides.len() - 2);
        let (a, b, fraction) = (self.sides[i], self.sides[i + 1], place - i as f64);
        [a[0] + (b[0] - a[0]) * fraction, a[1] + (b[1] - a[1]) * fraction]
    }
}

fn end(state: &GoalState) -> i64 {
    state.time_step.1
}

/// How far along a direction [m] a line from a point crosses a segment; `None` if it does not.
fn crossing(from: Point, direction: Point, a: Point, b: Point) -> Option<f64> {
    let (along, to_a) = (b - a, a - from);
    let determinant = direction.cross(along);
    if determinant.abs() < 1e-12 {
        return None;
    }
    let (distance, fraction) = (to_a.cross(along) / determinant, to_a.cross(direction) / determinant);
    (distance >= 0.0 && (0.0..=1.0).contains(&fraction)).then_some(distance)
}
