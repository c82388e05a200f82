//! Where a footprint stands among lanelets: within one lane or across several, along a lane or against it.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;

/// A lane is followed over this many lanelets in each direction: footprints reach across the ends of lanelets.
const LANELETS_ON: usize = 2;

/// Corners of the box around a footprint, in the world.
fn corners(shape: &Shape, pose: Pose) -> Vec<Point> {
    shape.oriented_box(pose).corners().to_vec()
}

/// All of the footprint is in the lane of its centre, or in one of them where lanelets overlap.
pub fn is_within_one_lane(road: &RoadNetwork, shape: &Shape, pose: Pose) -> bool {
    let center = road.lanelets_at(pose.position);
    if center.is_empty() {
        return false;
    }
    let below: Vec<Vec<usize>> = corners(shape, pose).into_iter().map(|corner| road.lanelets_at(corner)).collect();
    center.into_iter().any(|lanelet| {
        let lane = lane_of(road, lanelet);
        below.iter().all(|here| here.iter().any(|lanelet| lane.contains(lanelet)))
    })
}

/// All of the footprint is in one lane, and nothing of it on lanelets given by index.
pub fn is_within_another_lane(road: &RoadNetwork, shape: &Shape, pose: Pose, than: &[usize]) -> bool {
    let is_apart = |position: Point| road.lanelets_at(position).iter().all(|lanelet| !than.contains(lanelet));
    is_apart(pose.position) && corners(shape, pose).into_iter().all(is_apart) && is_within_one_lane(road, shape, pose)
}

/// A lanelet below the centre leads its way within 45 degrees.
pub fn is_along_a_lane(road: &RoadNetwork, pose: Pose) -> bool {
    road.lane_rules(pose).1 <= FRAC_PI_4
}

/// The lanelets below a position, with those before and behind them.
pub fn lanes_at(road: &RoadNetwork, position: Point) -> Vec<usize> {
    road.lanelets_at(position).into_iter().flat_map(|lanelet| lane_of(road, lanelet)).collect()
}

/// A lanelet with those before and behind it.
fn lane_of(road: &RoadNetwork, lanelet: usize) -> Vec<usize> {
    let (mut lane, mut ends) = (vec![lanelet], vec![(lanelet, true), (lanelet, false)]);
    for _ in 0..LANELETS_ON {
        let mut next = Vec::new();
        for (end, is_ahead) in ends {
            let here = &road.lanelets()[end];
            next.extend((if is_ahead { &here.successors } else { &here.predecessors }).iter().map(|l| (*l, is_ahead)));
        }
        lane.extend(next.iter().map(|(lanelet, _)| *lanelet));
        ends = next;
    }
    lane
}

/// A corner of the footprint is on a lanelet, and no lanelet there leads its way within 90 degrees.
pub fn is_against_the_lane(road: &RoadNetwork, shape: &Shape, pose: Pose) -> bool {
    let mut points = corners(shape, pose);
    points.push(pose.position);
    points.into_iter().any(|position| road.lane_rules(Pose { position, ..pose }).1 > FRAC_PI_2)
}
