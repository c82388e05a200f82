//! Road networks: up to six lanelets that mostly follow each other, of every shape that a file can state.

use std::f64::consts::PI;

use interdrive_core::geometry::{Aabb, Point, Pose};
use interdrive_core::road::{LaneletInput, RoadJudge, RoadNetwork, RoadSettings, Users};

use crate::source::Source;

/// A line from a point on, with its last heading [rad].
pub fn line(source: &mut Source, start: Point, heading: f64) -> (Vec<Point>, f64) {
    let n = 2 + source.below(8);
    let kind = if source.is_odd() { 3 + source.below(6) } else { source.below(3) };
    let mut points = vec![start];
    let mut heading = heading;
    let spacing = source.finite(4.0, 20.0);
    let bend = source.within(-0.2, 0.2);
    for i in 1..=n {
        let last = points[i - 1];
        let ahead = |heading: f64, distance: f64| last + Point::from_angle(heading) * distance;
        points.push(match kind {
            0 => ahead(heading, spacing),
            1 => {
                heading += bend;
                ahead(heading, spacing)
            }
            2 => {
                heading += source.within(-0.6, 0.6);
                ahead(heading, source.within(1.0, 15.0))
            }
            // Turns back and crosses itself.
            3 => {
                heading += source.within(-PI, PI);
                ahead(heading, source.finite(0.5, 30.0))
            }
            // No length.
            4 => last,
            // Next to no length.
            5 => ahead(heading, source.within(1e-7, 1e-3)),
            // Duplicates.
            6 => ahead(heading, if source.chance(128) { 0.0 } else { 8.0 }),
            // Longer than any road.
            7 => ahead(heading, source.finite(1e3, 1e6)),
            _ => Point::new(source.finite(-200.0, 200.0), source.finite(-200.0, 200.0)),
        });
    }
    (points, heading)
}

/// Both bounds beside a line.
fn bounds(source: &mut Source, center: &[Point]) -> (Vec<Point>, Vec<Point>) {
    let width = source.finite(3.0, 4.5);
    let taper = if source.chance(40) { source.finite(-1.0, 1.0) } else { 0.0 };
    let side = |sign: f64| -> Vec<Point> {
        (0..center.len())
            .map(|i| {
                let along = center[(i + 1).min(center.len() - 1)] - center[i.saturating_sub(1)];
                let normal = along.left() * along.norm().max(1e-9).recip();
                center[i] + normal * (sign * 0.5 * (width + taper * i as f64))
            })
            .collect()
    };
    let (mut left, mut right) = (side(1.0), side(-1.0));
    if source.is_odd() {
        match source.below(6) {
            0 => std::mem::swap(&mut left, &mut right),
            1 => right.reverse(),
            2 => drop(left.remove(0)),
            3 => right.truncate(source.below(3)),
            4 => left.push(Point::new(source.any(-50.0, 50.0), source.any(-50.0, 50.0))),
            _ => right = left.clone(),
        }
    }
    (left, right)
}

/// An id that is mostly one of those of `n` lanelets (1 to `n`).
fn id(source: &mut Source, n: usize) -> i64 {
    source.whole(1, n as i64 + 1)
}

fn neighbour(source: &mut Source, n: usize) -> Option<(i64, bool)> {
    source.chance(50).then(|| (id(source, n), source.chance(200)))
}

/// Lanelets as a file could state them, most of them ordinary ones.
pub fn lanelets(source: &mut Source) -> Vec<LaneletInput> {
    let n = 1 + source.below(6);
    let origin = Point::new(source.finite(0.0, 0.0), source.finite(0.0, 0.0));
    let (mut start, mut heading) = (origin, source.finite(0.0, PI));
    let mut lanelets: Vec<LaneletInput> = Vec::with_capacity(n);
    for i in 0..n {
        if let Some(last) = lanelets.last()
            && source.chance(60)
        {
            // Beside the last one.
            let beside = last.left.clone();
            let shift = source.finite(3.0, 4.0);
            let far = beside.iter().map(|point| *point + Point::from_angle(heading).left() * shift).collect();
            let beside = LaneletInput { id: i as i64 + 1, left: far, right: beside, ..last.clone() };
            lanelets.push(LaneletInput { adjacent_right: Some((i as i64, true)), ..beside });
            continue;
        }
        if source.chance(60) {
            (start, heading) =
                (origin + Point::new(source.finite(-60.0, 60.0), source.finite(-60.0, 60.0)), source.finite(-PI, PI));
        }
        let (center, last_heading) = line(source, start, heading);
        let (left, right) = bounds(source, &center);
        (start, heading) = (center[center.len() - 1], last_heading);
        let mut successors = vec![i as i64 + 2];
        let mut predecessors = Vec::new();
        for related in [&mut successors, &mut predecessors] {
            while source.chance(40) && related.len() < 6 {
                related.push(id(source, n));
            }
        }
        lanelets.push(LaneletInput {
            id: if source.is_odd() { id(source, n) } else { i as i64 + 1 },
            left,
            right,
            predecessors,
            successors,
            adjacent_left: neighbour(source, n),
            adjacent_right: neighbour(source, n),
            speed_limit: source.any(8.0, 30.0),
            users: Users::ALL,
        });
    }
    lanelets
}

fn settings(source: &mut Source) -> RoadSettings {
    let default = RoadSettings::default();
    if !source.is_odd() {
        return default;
    }
    let judge = if source.chance(2) { RoadJudge::Wheels } else { RoadJudge::Body };
    RoadSettings {
        gap_tolerance: source.any(0.0, 0.5),
        open_end_length: source.any(0.0, 200.0),
        judge,
        ..RoadSettings::default()
    }
}

/// A network, if the lanelets make one; otherwise the reason was text.
pub fn network(source: &mut Source) -> Option<RoadNetwork> {
    let (lanelets, settings) = (lanelets(source), settings(source));
    match RoadNetwork::new(lanelets, settings) {
        Ok(road) => Some(road),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            None
        }
    }
}

/// A pose on a lanelet, at a lateral offset; rarely any.
pub fn pose(source: &mut Source, road: &RoadNetwork) -> Pose {
    if source.is_odd() {
        return Pose::new(source.finite(-100.0, 100.0), source.finite(-100.0, 100.0), source.finite(-PI, PI));
    }
    let i = source.below(road.lanelets().len());
    let lanelet = &road.lanelets()[i];
    let s = source.within(0.0, 1.0) * lanelet.length;
    let orientation = road.heading_at(i, s);
    let position = lanelet.center.at(s) + Point::from_angle(orientation).left() * source.finite(-1.0, 1.0);
    Pose { position, orientation: orientation + source.finite(-0.3, 0.3) }
}

/// Any road is one or a reason in words; what is asked of it has an answer.
pub fn check(source: &mut Source) {
    let Some(road) = network(source) else { return };
    for (i, lanelet) in road.lanelets().iter().enumerate() {
        assert!(lanelet.length.is_finite() && lanelet.length > 0.0);
        assert!(road.lane_knots(i).0.iter().all(|knot| knot.is_finite()));
        assert!([0.0, 0.3 * lanelet.length, 2.0 * lanelet.length].iter().all(|s| road.heading_at(i, *s).is_finite()));
        assert!(road.index_of(lanelet.id) == Some(i));
        let reach = source.finite(0.0, 100.0);
        for polygon in road.lane_stretch(i, source.finite(0.0, 50.0), reach, reach) {
            assert!(polygon.iter().all(|point| point.is_finite()));
        }
        for chain in road.paths_from(i, source.finite(0.0, 50.0), source.finite(10.0, 300.0), 1 + source.below(8)) {
            assert_eq!(chain[0], i);
        }
    }
    assert!(road.road_edges().iter().all(|edge| edge.a.is_finite() && edge.b.is_finite()));
    for _ in 0..4 {
        let pose = pose(source, &road);
        for found in road.matching(pose, source.any(0.0, 5.0), source.any(0.0, PI)) {
            assert!(found.s.is_finite() && found.d.is_finite() && found.heading_error.abs() <= PI);
        }
        road.is_on_road(pose.position);
        road.lanelets_near(pose.position, source.any(0.0, 50.0));
        let mut near = Vec::new();
        let shape = crate::shapes::shape(source);
        road.edges_near(&shape.aabb(pose), &mut near);
        road.edges_near(&Aabb { min: pose.position, max: pose.position }.grown(source.finite(0.0, 10.0)), &mut near);
        road.covers(&shape, pose);
        road.box_is_covered(&shape.oriented_box(pose));
    }
}
