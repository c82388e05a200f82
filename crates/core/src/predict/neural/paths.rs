//! Paths on which a vehicle may go on, and path coordinates: arc length `s` from where the vehicle is now, offset `d` to
//! the left.

use super::candidate_path::{BEHIND, CandidatePath};
use crate::geometry::{Point, Pose};
use crate::predict::lane_candidates::LaneCandidates;
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
const PATH_LANELETS_MAX: usize = 256;

/// Distance [m] within which branches of a lane are paths of their own, at a speed [m/s]: what can be driven in 3 s.
fn branch_reach(velocity: f64) -> f64 {
    15.0 + 3.5 * velocity
}

/// Length of a path ahead [m].
fn reach(velocity: f64) -> f64 {
    (20.0 + 5.0 * velocity).max(100.0)
}

/// A lane to make a path of.
struct LaneChain<'a> {
    /// Lanelets one after the other.
    chain: &'a [usize],
    /// Arc length of the vehicle on the first of them [m]; negative if that begins ahead.
    s: f64,
    share: f64,
    /// The lanelet beside or below the vehicle.
    here: usize,
}

/// Memory that is reused.
#[derive(Debug, Default)]
pub(super) struct Memory {
    lanes: LaneCandidates,
    chain: Vec<usize>,
    /// Paths that are not needed any more.
    pub(super) spare: Vec<CandidatePath>,
}

/// All paths of a vehicle with a speed along its heading [m/s]; `on_lanes` is false for vehicles that follow no lane.
pub(super) fn candidates(
    pose: Pose,
    velocity: f64,
    on_lanes: bool,
    road: &RoadNetwork,
    memory: &mut Memory,
) -> [Option<CandidatePath>; N_PATHS] {
    let Memory { lanes, chain: memory, spare } = memory;
    let mut paths = [const { None }; N_PATHS];
    let (speed, reach) = (velocity.max(0.0), reach(velocity.max(0.0)));
    paths[FREE] = Some(CandidatePath::straight(pose, reach, spare.pop()));
    if !on_lanes {
        return paths;
    }
    lanes.find(pose, branch_reach(speed), N_OWN, road);
    let total: f64 = lanes.found.iter().map(|lane| lane.weight).sum();
    for (slot, lane) in lanes.found.iter().enumerate() {
        let chain = lanes.chain(lane);
        let own = LaneChain { chain, s: lane.s, share: lane.weight / total, here: chain[0] };
        paths[slot] = CandidatePath::along(&own, pose, reach, road, (memory, spare.pop()));
    }
    let Some(best) = lanes.found.first() else { return paths };
    let ahead = NEIGHBOUR_AHEAD.max(2.0 * speed);
    for (slot, is_left) in [(LEFT, true), (RIGHT, false)] {
        let Some((neighbour, s)) = neighbour(lanes.chain(best), best.s, ahead, is_left, pose, road) else { continue };
        if !lanes.found.iter().any(|lane| lanes.chain(lane).contains(&neighbour)) {
            let beside = LaneChain { chain: &[neighbour], s, share: 0.0, here: neighbour };
            paths[slot] = CandidatePath::along(&beside, pose, reach, road, (memory, spare.pop()));
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
    fn straight(pose: Pose, reach: f64, spare: Option<Self>) -> Self {
        let mut path = Self::blank(spare);
        let axis = Point::from_angle(pose.orientation);
        path.points.extend([-BEHIND, 0.0, reach].map(|s| pose.position + axis * s));
        path.arc_lengths.extend([-BEHIND, 0.0, reach]);
        path.headings.extend([pose.orientation; 3]);
        path.build_index();
        path
    }

    /// Along a lane, straightest where the chain ends, straight on where the map ends. `None` where a map is so broken
    /// that no path remains.
    fn along(
        lane: &LaneChain<'_>,
        pose: Pose,
        reach: f64,
        road: &RoadNetwork,
        (chain, spare): (&mut Vec<usize>, Option<Self>),
    ) -> Option<Self> {
        let mut path = Self::blank(spare);
        let mut start = extend(lane, reach, road, chain);
        let mut first = f64::NAN;
        for &lanelet in &*chain {
            path.append(lanelet, start, reach, road, &mut first);
            start += road.lanelets()[lanelet].length;
        }
        if path.points.len() < 2 {
            return None;
        }
        path.complete(first, reach);
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

    /// Appends the knots of a lanelet that starts at an arc length [m] as far as they are within reach; `first` becomes the
    /// arc length of the first knot of all.
    fn append(&mut self, lanelet: usize, start: f64, reach: f64, road: &RoadNetwork, first: &mut f64) {
        let (knots, directions, spacing) = road.lane_knots(lanelet);
        let s_at = |k: usize| start + k as f64 * spacing;
        // Guesses that are off by rounding at most; negative numbers become 0.
        let mut k = ((-BEHIND - start) / spacing - 1.0) as usize;
        while k < knots.len() && s_at(k) < -BEHIND {
            k += 1;
        }
        let mut end = (((reach - start) / spacing) as usize).saturating_add(2).min(knots.len());
        while end > k && s_at(end - 1) > reach {
            end -= 1;
        }
        if k >= end {
            return;
        }
        if let Some((last, heading)) = self.points.last().zip(self.headings.last()) {
            let axis = Point::from_angle(*heading);
            let mut skipped = 0;
            while k < end {
                let step = knots[k] - *last;
                let is_ahead = step.dot(axis) >= JOINT_STEP;
                if is_ahead || (skipped >= JOINT_KNOTS && step.norm() >= JOINT_STEP) {
                    break;
                }
                skipped += 1;
                k += 1;
            }
        } else {
            *first = s_at(k);
            self.points.push(knots[k]);
            self.headings.push(directions[k]);
            k += 1;
        }
        let mut last = self.headings[self.headings.len() - 1];
        self.points.extend_from_slice(&knots[k..end]);
        self.headings.extend(directions[k..end].iter().map(|heading| {
            last = continued(last, *heading);
            last
        }));
    }
}

/// Writes the chain with lanelets behind and ahead; the arc length of its start, seen from the vehicle.
fn extend(lane: &LaneChain<'_>, reach: f64, road: &RoadNetwork, chain: &mut Vec<usize>) -> f64 {
    let length = |lanelet: usize| road.lanelets()[lanelet].length;
    chain.clear();
    let mut start = -lane.s;
    let mut at = lane.chain[0];
    while start > -BEHIND && chain.len() < PATH_LANELETS_MAX {
        let Some(&before) = road.predecessors_straightest_first(at).first() else { break };
        chain.push(before);
        start -= length(before);
        at = before;
    }
    chain.reverse();
    chain.extend_from_slice(lane.chain);
    let mut end = start + chain.iter().map(|lanelet| length(*lanelet)).sum::<f64>();
    while end < reach && chain.len() < 2 * PATH_LANELETS_MAX {
        let Some(&next) = road.successors_straightest_first(chain[chain.len() - 1]).first() else { break };
        chain.push(next);
        end += length(next);
    }
    start
}

/// The heading nearest to `last` that is the same direction as `heading` [rad].
fn continued(last: f64, heading: f64) -> f64 {
    last + crate::geometry::wrap_angle(heading - last)
}
