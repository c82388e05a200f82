//! Paths on which a vehicle may go on, and path coordinates: arc length `s` from where the vehicle is now, offset `d` to
//! the left.

use super::candidate_path::{BEHIND, CandidatePath};
use crate::geometry::{Point, Pose};
use crate::predict::lanes::Lanes;
use crate::road::RoadNetwork;

/// Slots of candidate paths; each has its fixed meaning, and may be empty.
pub const N_PATHS: usize = 7;
/// Slots of own lanes, the first ones.
pub const N_OWN: usize = 4;
/// Slot of the lane to the left.
pub const LEFT: usize = 4;
/// Slot of the lane to the right.
pub const RIGHT: usize = 5;
/// Slot of the straight line along the heading; never empty.
pub const FREE: usize = 6;
/// Names of the slots.
pub const SLOTS: [&str; N_PATHS] = ["own_1", "own_2", "own_3", "own_4", "left", "right", "free"];

/// A neighbouring lane that begins within this distance [m], or two seconds, is one too.
const NEIGHBOUR_AHEAD: f64 = 15.0;
/// Where one lanelet follows another, knots of the second that are not this far [m] ahead of the first are left out.
const JOINT_STEP: f64 = 0.3;
/// Number of such knots; a lanelet that runs backwards for longer is taken as it is.
const JOINT_KNOTS: usize = 12;
/// Longest chain of lanelets.
const CHAIN_MAX: usize = 256;

/// Distance [m] within which branches of a lane are paths of their own, at a speed [m/s]: what can be driven in 3 s.
fn branch_reach(velocity: f64) -> f64 {
    15.0 + 3.5 * velocity
}

/// Length of a path ahead [m].
fn reach(velocity: f64) -> f64 {
    (20.0 + 5.0 * velocity).max(100.0)
}

/// A lane to make a path of.
struct Lane<'a> {
    /// Lanelets one after the other.
    chain: &'a [usize],
    /// Arc length of the vehicle on the first of them [m]; negative if that begins ahead.
    s: f64,
    share: f64,
    /// The lanelet beside or below the vehicle.
    here: usize,
}

/// All paths of a vehicle with a speed along its heading [m/s]; `on_lanes` is false for who follows none.
pub(super) fn candidates(
    pose: Pose,
    velocity: f64,
    on_lanes: bool,
    road: &RoadNetwork,
    lanes: &mut Lanes,
) -> [Option<CandidatePath>; N_PATHS] {
    let mut paths = [const { None }; N_PATHS];
    let (speed, reach) = (velocity.max(0.0), reach(velocity.max(0.0)));
    paths[FREE] = Some(CandidatePath::straight(pose, reach));
    if !on_lanes {
        return paths;
    }
    lanes.find(pose, branch_reach(speed), N_OWN, road);
    let total: f64 = lanes.found.iter().map(|lane| lane.weight).sum();
    for (slot, lane) in lanes.found.iter().enumerate() {
        let chain = lanes.chain(lane);
        let own = Lane { chain, s: lane.s, share: lane.weight / total, here: chain[0] };
        paths[slot] = CandidatePath::along(&own, pose, reach, road);
    }
    let Some(best) = lanes.found.first() else { return paths };
    let ahead = NEIGHBOUR_AHEAD.max(2.0 * speed);
    for (slot, is_left) in [(LEFT, true), (RIGHT, false)] {
        let Some((neighbour, s)) = neighbour(lanes.chain(best), best.s, ahead, is_left, pose, road) else { continue };
        if !lanes.found.iter().any(|lane| lanes.chain(lane).contains(&neighbour)) {
            let beside = Lane { chain: &[neighbour], s, share: 0.0, here: neighbour };
            paths[slot] = CandidatePath::along(&beside, pose, reach, road);
        }
    }
    paths
}

/// The first lanelet beside a chain within a distance [m] that runs in its direction, and where the vehicle is on it.
fn neighbour(
    chain: &[usize],
    s: f64,
    ahead: f64,
    is_left: bool,
    pose: Pose,
    road: &RoadNetwork,
) -> Option<(usize, f64)> {
    let mut start = -s;
    for &lanelet in chain {
        let lane = &road.lanelets()[lanelet];
        let beside = if is_left { lane.adjacent_left } else { lane.adjacent_right };
        if let Some((neighbour, true)) = beside {
            let s = if start > 0.0 { -start } else { road.lanelets()[neighbour].center.project(pose.position).s };
            return Some((neighbour, s));
        }
        start += lane.length;
        if start > ahead {
            return None;
        }
    }
    None
}

impl CandidatePath {
    /// Straight on along the heading.
    fn straight(pose: Pose, reach: f64) -> Self {
        let axis = Point::from_angle(pose.orientation);
        let points = [-BEHIND, 0.0, reach].map(|s| pose.position + axis * s).to_vec();
        Self::of(points, vec![-BEHIND, 0.0, reach], vec![pose.orientation; 3])
    }

    /// Along a lane, straightest where the chain ends, straight on where the map ends. `None` where a map is so broken
    /// that no path remains.
    fn along(lane: &Lane<'_>, pose: Pose, reach: f64, road: &RoadNetwork) -> Option<Self> {
        let (chain, first_start) = extended(lane, reach, road);
        let n = (reach + BEHIND) as usize + 16;
        let (mut points, mut headings): (Vec<Point>, Vec<f64>) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut start = first_start;
        let mut first = f64::NAN;
        for &lanelet in &chain {
            let mut skipped = 0;
            let mut is_joint = !points.is_empty();
            for knot in road.lane_knots(lanelet) {
                let s = start + knot.s;
                if s < -BEHIND {
                    continue;
                }
                if s > reach {
                    break;
                }
                let Some((last, heading)) = points.last().zip(headings.last()) else {
                    first = s;
                    points.push(knot.position);
                    headings.push(knot.heading);
                    continue;
                };
                if is_joint {
                    let step = knot.position - *last;
                    let is_ahead = step.dot(Point::from_angle(*heading)) >= JOINT_STEP;
                    if !is_ahead && (skipped < JOINT_KNOTS || step.norm() < JOINT_STEP) {
                        skipped += 1;
                        continue;
                    }
                    is_joint = false;
                }
                headings.push(continued(*heading, knot.heading));
                points.push(knot.position);
            }
            start += road.lanelets()[lanelet].length;
        }
        if points.len() < 2 {
            return None;
        }
        let mut path = Self::through(points, headings, first, reach);
        let foot = path.foot(pose.position, -30.0, 30.0)?;
        path.arc_lengths.iter_mut().for_each(|s| *s -= foot.0);
        let here = &road.lanelets()[lane.here];
        let (_, heading) = path.pose_at(0.0);
        path.offset = foot.1;
        path.heading_error = crate::geometry::wrap_angle(pose.orientation - heading);
        path.share = lane.share;
        path.width = here.width_at(lane.s.max(0.0));
        path.speed_limit = here.speed_limit;
        path.end = start - foot.0;
        Some(path)
    }
}

/// The chain with lanelets behind and ahead, and the arc length of its start, seen from the vehicle.
fn extended(lane: &Lane<'_>, reach: f64, road: &RoadNetwork) -> (Vec<usize>, f64) {
    let length = |lanelet: usize| road.lanelets()[lanelet].length;
    let mut chain = Vec::with_capacity(lane.chain.len() + 8);
    let mut start = -lane.s;
    let mut at = lane.chain[0];
    while start > -BEHIND && chain.len() < CHAIN_MAX {
        let Some(&before) = road.predecessors_straightest_first(at).first() else { break };
        chain.push(before);
        start -= length(before);
        at = before;
    }
    chain.reverse();
    chain.extend_from_slice(lane.chain);
    let mut end = start + chain.iter().map(|lanelet| length(*lanelet)).sum::<f64>();
    while end < reach && chain.len() < 2 * CHAIN_MAX {
        let Some(&next) = road.successors_straightest_first(chain[chain.len() - 1]).first() else { break };
        chain.push(next);
        end += length(next);
    }
    (chain, start)
}

/// The heading nearest to `last` that is the same direction as `heading` [rad].
fn continued(last: f64, heading: f64) -> f64 {
    last + crate::geometry::wrap_angle(heading - last)
}
