//! Small invented roads for tests. Lanes are 3.5 m wide.

use super::{LaneletInput, RoadJudge, RoadNetwork, RoadSettings};
use crate::geometry::Point;
use crate::geometry::polyline::Polyline;

/// Width of every lane [m].
pub(crate) const LANE_WIDTH: f64 = 3.5;

/// A lanelet around a centre line, without relations.
pub(crate) fn lane(id: i64, center: &[Point]) -> LaneletInput {
    tapered_lane(id, center, LANE_WIDTH, LANE_WIDTH)
}

/// A lanelet whose width changes linearly from vertex to vertex.
pub(crate) fn tapered_lane(id: i64, center: &[Point], first_width: f64, last_width: f64) -> LaneletInput {
    let line = Polyline::new(center).expect("a test's centre line");
    let n = line.points().len();
    let side = |sign: f64| {
        (0..n)
            .map(|i| {
                let (before, after) = (line.points()[i.saturating_sub(1)], line.points()[(i + 1).min(n - 1)]);
                let along = after - before;
                let width = first_width + (last_width - first_width) * i as f64 / (n - 1) as f64;
                line.points()[i] + along.left() * (sign * 0.5 * width / along.norm())
            })
            .collect()
    };
    LaneletInput::between(id, side(1.0), side(-1.0))
}

/// Points every metre from one point to another.
pub(crate) fn straight(from: (f64, f64), to: (f64, f64)) -> Vec<Point> {
    let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
    Polyline::new(&[from, to]).expect("different points").resampled(1.0)
}

/// Points about every metre on an arc, from one polar angle [rad] to another.
pub(crate) fn arc(center: (f64, f64), radius: f64, from: f64, to: f64) -> Vec<Point> {
    let n = ((to - from).abs() * radius).ceil();
    (0..=n as usize)
        .map(|i| Point::new(center.0, center.1) + Point::from_angle(from + (to - from) * i as f64 / n) * radius)
        .collect()
}

pub(crate) fn with_successors(mut lanelet: LaneletInput, successors: &[i64]) -> LaneletInput {
    lanelet.successors = successors.to_vec();
    lanelet
}

/// Lanes along x from 0 to `length`, side by side in one direction: id 1 at y = 0, id 2 to its left, and so on.
pub(crate) fn parallel_lanes(n: i64, length: f64) -> Vec<LaneletInput> {
    (1..=n)
        .map(|id| {
            let y = (id - 1) as f64 * LANE_WIDTH;
            lane(id, &straight((0.0, y), (length, y)))
        })
        .collect()
}

/// A network without continuations beyond its ends, so that its edges are those of the lanelets.
pub(crate) fn closed(lanelets: Vec<LaneletInput>) -> RoadNetwork {
    let settings = RoadSettings { open_end_length: 0.0, judge: RoadJudge::Body, ..RoadSettings::default() };
    RoadNetwork::new(lanelets, settings).expect("a test's road")
}

/// A network with continuations.
pub(crate) fn open(lanelets: Vec<LaneletInput>) -> RoadNetwork {
    RoadNetwork::new(lanelets, RoadSettings::default()).expect("a test's road")
}

/// Straight road of `n` lanes and 200 m: ids 1 (right, y = 0) to n (left).
pub(crate) fn straight_road(n: i64) -> RoadNetwork {
    open(parallel_lanes(n, 200.0))
}

/// Lane 1 along x to (50, 0), then 2 straight on to (100, 0) and 3 in a quarter circle to the left, to (70, 20).
pub(crate) fn fork() -> RoadNetwork {
    open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 3]),
        lane(2, &straight((50.0, 0.0), (100.0, 0.0))),
        lane(3, &arc((50.0, 20.0), 20.0, -std::f64::consts::FRAC_PI_2, 0.0)),
    ])
}

/// Lanes 1 along x from (0, 0) and 2 in a quarter circle from (30, -20) lead into 3 from (50, 0) to (100, 0).
pub(crate) fn merge() -> RoadNetwork {
    open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[3]),
        with_successors(lane(2, &arc((50.0, -20.0), 20.0, std::f64::consts::PI, std::f64::consts::FRAC_PI_2)), &[3]),
        lane(3, &straight((50.0, 0.0), (100.0, 0.0))),
    ])
}

/// Lane 1 along x and lane 2 along y, 100 m each, crossing in the origin.
pub(crate) fn crossing() -> RoadNetwork {
    open(vec![lane(1, &straight((-50.0, 0.0), (50.0, 0.0))), lane(2, &straight((0.0, -50.0), (0.0, 50.0)))])
}

/// A ring of four quarter circles of 20 m radius, counter-clockwise: ids 1 to 4, 1 starts at (20, 0).
pub(crate) fn ring() -> RoadNetwork {
    let quarter = std::f64::consts::FRAC_PI_2;
    open(
        (0..4_i64)
            .map(|i| {
                let from = i as f64 * quarter;
                with_successors(lane(i + 1, &arc((0.0, 0.0), 20.0, from, from + quarter)), &[(i + 1) % 4 + 1])
            })
            .collect(),
    )
}
