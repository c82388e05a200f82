//! Contact between bodies, and departure from the road, during one step. Between two poses a body moves in a straight
//! line at constant speed and turns the shorter way at a constant rate; nothing is missed however fast it is.

use crate::geometry::shape::{ConvexPart, OrientedBox, Placement, Shape};
use crate::geometry::{Aabb, Point, Pose, wrap_angle};
use crate::road::RoadNetwork;
use crate::vehicle::Vehicle;

/// Bodies that come nearer than this during a step are in contact [m].
const CONTACT_DISTANCE: f64 = 1e-4;
/// Number of advances after which the bodies count as in contact; reached only by a body that spins within millimetres
/// of another one for most of a turn.
const ADVANCES_MAX: usize = 2000;
/// Between two looks at the road no point of a footprint moves farther than this [m].
const ROAD_CHECK_SPACING: f64 = 0.25;
/// Most looks at one step: 2.5 km, which no vehicle drives in one.
const ROAD_CHECKS_MAX: f64 = 10_000.0;

/// A body and its poses at the start and the end of a step.
#[derive(Debug, Clone, Copy)]
pub struct Mover<'a> {
    /// Body in its body frame.
    pub shape: &'a Shape,
    /// Pose at fraction 0.
    pub from: Pose,
    /// Pose at fraction 1.
    pub to: Pose,
}

/// The motion of one body during the step.
#[derive(Debug, Clone, Copy)]
struct RigidMotion {
    from: Pose,
    /// Displacement over the whole step [m].
    shift: Point,
    /// Turn over the whole step [rad].
    turn: f64,
}

impl RigidMotion {
    fn new(from: Pose, to: Pose) -> Self {
        Self { from, shift: to.position - from.position, turn: wrap_angle(to.orientation - from.orientation) }
    }

    fn pose_at(&self, fraction: f64) -> Pose {
        Pose {
            position: self.from.position + self.shift * fraction,
            orientation: self.from.orientation + self.turn * fraction,
        }
    }

    fn placement_at(&self, fraction: f64) -> Placement {
        Placement::new(self.pose_at(fraction))
    }
}

/// Earliest fraction of the step, in [0, 1], at which two bodies touch; `None` if they do not. Exact to 1e-4 m: bodies
/// that pass nearer than that may be reported, touching bodies always are.
pub fn first_contact(a: &Shape, a0: Pose, a1: Pose, b: &Shape, b0: Pose, b1: Pose) -> Option<f64> {
    let (motion_a, motion_b) = (RigidMotion::new(a0, a1), RigidMotion::new(b0, b1));
    let shift = motion_b.shift - motion_a.shift;
    if nearest_approach(b0.position - a0.position, shift) > a.bounding_radius() + b.bounding_radius() + CONTACT_DISTANCE
    {
        return None;
    }
    let b_in_a = motion_a.placement_at(0.0).relative(&motion_b.placement_at(0.0));
    let travel = shift.norm();
    let mut earliest = None;
    for part_a in a.parts() {
        for part_b in b.parts() {
            let latest = earliest.unwrap_or(1.0);
            let reach = (travel + swing(part_a, &motion_a) + swing(part_b, &motion_b)) * latest + CONTACT_DISTANCE;
            if part_a.distance_at_least(part_b, &b_in_a) <= reach {
                earliest = first_contact_of_parts(part_a, &motion_a, part_b, &motion_b, latest).or(earliest);
            }
        }
    }
    earliest
}

/// Pose at a fraction of a step.
pub fn pose_between(from: Pose, to: Pose, fraction: f64) -> Pose {
    RigidMotion::new(from, to).pose_at(fraction)
}

/// Smallest distance of two points during the step [m], from their offset at the start and its change.
fn nearest_approach(offset: Point, shift: Point) -> f64 {
    let length_squared = shift.norm_squared();
    let fraction = if length_squared > 0.0 { (-offset.dot(shift) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (offset + shift * fraction).norm()
}

/// Upper bound of the way that turning alone moves a point of the part over the whole step [m].
fn swing(part: &ConvexPart, motion: &RigidMotion) -> f64 {
    part.lever() * motion.turn.abs()
}

/// Conservative advancement: the gap is a strip with one body on each side of it. Until the bodies have crossed it in
/// its own direction, at the speed they have in that direction plus all that turning can add, they cannot touch.
fn first_contact_of_parts(
    a: &ConvexPart,
    motion_a: &RigidMotion,
    b: &ConvexPart,
    motion_b: &RigidMotion,
    latest: f64,
) -> Option<f64> {
    let shift = motion_b.shift - motion_a.shift;
    let swing = swing(a, motion_a) + swing(b, motion_b);
    let mut fraction = 0.0;
    for _ in 0..ADVANCES_MAX {
        let placement_a = motion_a.placement_at(fraction);
        let gap = match a.gap(b, &placement_a.relative(&motion_b.placement_at(fraction))) {
            Some(gap) if gap.distance > CONTACT_DISTANCE => gap,
            _ => return Some(fraction),
        };
        let closing = swing - shift.dot(placement_a.turn(gap.direction));
        // Half of the tolerance is left over, so that the last advance ends in contact and not just before it.
        let advance = gap.distance - 0.5 * CONTACT_DISTANCE;
        if advance > closing * (latest - fraction) {
            return None;
        }
        fraction += advance / closing;
    }
    Some(fraction)
}

/// All pairs that touch during the step and of which one is wanted, each with the earliest fraction: (i, j, fraction) with
/// i < j, ascending.
pub fn contacts(movers: &[Mover<'_>], is_wanted: impl Fn(usize) -> bool) -> Vec<(usize, usize, f64)> {
    let mut memory = ContactMemory::default();
    find_contacts(movers.len(), |i| movers[i], is_wanted, &mut memory);
    memory.found
}

/// Memory of the search for contacts; only `found` has a meaning.
#[derive(Debug, Clone, Default)]
pub struct ContactMemory {
    boxes: Vec<Aabb>,
    wanted: Vec<usize>,
    order: Vec<(f64, f64, usize)>,
    /// The contacts, as [`contacts`] returns them.
    pub found: Vec<(usize, usize, f64)>,
}

/// As [`contacts`] among `n` bodies, into memory that is reused.
pub fn find_contacts<'a>(
    n: usize,
    mover: impl Fn(usize) -> Mover<'a>,
    is_wanted: impl Fn(usize) -> bool,
    memory: &mut ContactMemory,
) {
    /// Up to so many pairs are tried one by one.
    const PAIRS_MAX: usize = 2048;
    let ContactMemory { boxes, wanted, order, found } = memory;
    found.clear();
    wanted.clear();
    wanted.extend((0..n).filter(|i| is_wanted(*i)));
    if wanted.is_empty() {
        return;
    }
    let are_few = wanted.len() * n <= PAIRS_MAX;
    // Where every pair is tried anyway, a wide box that is made at once is worth more than a narrow one.
    let swept = if are_few { wide_box } else { narrow_box };
    boxes.clear();
    boxes.extend((0..n).map(|i| swept(&mover(i))));
    let mut look = |i: usize, j: usize| {
        if boxes[i].overlaps(&boxes[j]) {
            let (a, b) = (mover(i), mover(j));
            found.extend(first_contact(a.shape, a.from, a.to, b.shape, b.from, b.to).map(|fraction| (i, j, fraction)));
        }
    };
    if are_few {
        for &i in wanted.iter() {
            (0..i).filter(|j| !is_wanted(*j)).for_each(|j| look(j, i));
            (i + 1..n).for_each(|j| look(i, j));
        }
    } else {
        // Sort and sweep along the longer side of the crowd: roads rarely run along both axes.
        let centers = Aabb::around(boxes.iter().map(|aabb| aabb.min.lerp(aabb.max, 0.5)));
        let size = centers.max - centers.min;
        let along = |point: Point| if size.y > size.x { point.y } else { point.x };
        order.clear();
        order.extend(boxes.iter().enumerate().map(|(i, aabb)| (along(aabb.min), along(aabb.max), i)));
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        for (position, (_, high, first)) in order.iter().enumerate() {
            for (_, _, second) in order[position + 1..].iter().take_while(|(low, ..)| low <= high) {
                if is_wanted(*first) || is_wanted(*second) {
                    look(*first.min(second), *first.max(second));
                }
            }
        }
    }
    found.sort_unstable_by_key(|(i, j, _)| (*i, *j));
}

/// Axis-aligned box around everything the body covers during the step, however it turns.
fn wide_box(mover: &Mover<'_>) -> Aabb {
    // What stands may be long, such as a wall.
    if mover.from == mover.to {
        return mover.shape.aabb(mover.from).grown(CONTACT_DISTANCE);
    }
    Aabb::around([mover.from.position, mover.to.position]).grown(mover.shape.bounding_radius() + CONTACT_DISTANCE)
}

/// Axis-aligned box around the body at both ends of the step and everything it covers in between.
fn narrow_box(mover: &Mover<'_>) -> Aabb {
    let start = mover.shape.aabb(mover.from);
    if mover.from == mover.to {
        return start.grown(CONTACT_DISTANCE);
    }
    // Seen from the straight motion of the body origin, a turning point leaves its chord by the height of the arc.
    let turn = wrap_angle(mover.to.orientation - mover.from.orientation);
    let bulge = if turn == 0.0 { 0.0 } else { mover.shape.bounding_radius() * (1.0 - (0.5 * turn).cos()) };
    start.union(mover.shape.aabb(mover.to)).grown(bulge + CONTACT_DISTANCE)
}

/// Earliest fraction of the step at which the road does not admit the vehicle, examined every 0.25 m of motion and at
/// both ends; `None` if it stays on the road.
pub fn departs_road(road: &RoadNetwork, shape: &Shape, vehicle: &Vehicle, from: Pose, to: Pose) -> Option<f64> {
    departure(road, shape, vehicle, (from, to), &mut Vec::new())
}

/// The same with memory that is overwritten.
pub(crate) fn departure(
    road: &RoadNetwork,
    shape: &Shape,
    vehicle: &Vehicle,
    (from, to): (Pose, Pose),
    scratch: &mut Vec<u32>,
) -> Option<f64> {
    let motion = RigidMotion::new(from, to);
    let looks = road_looks(shape, &motion);
    let mut fractions = (0..=looks).map(|look| look as f64 / looks as f64);
    fractions.find(|fraction| !road.admits(shape, vehicle, motion.pose_at(*fraction), scratch))
}

/// One look shows that a body moves above lanelets only: there is no departure, and nothing overhangs.
pub(crate) fn stays_inside(road: &RoadNetwork, shape: &Shape, (from, to): (Pose, Pose)) -> bool {
    road.surrounds(shape, from, to, road_looks(shape, &RigidMotion::new(from, to)))
}

/// Number of looks at the road after the first one.
fn road_looks(shape: &Shape, motion: &RigidMotion) -> usize {
    let travel = motion.shift.norm() + shape.bounding_radius() * motion.turn.abs();
    (travel / ROAD_CHECK_SPACING).ceil().clamp(1.0, ROAD_CHECKS_MAX) as usize
}

/// A vehicle that follows poses, one per step, leaves the road after having been on it.
pub fn leaves_road(road: &RoadNetwork, shape: &Shape, vehicle: &Vehicle, poses: &[Pose]) -> bool {
    let mut was_on_road = poses.first().is_some_and(|pose| road.covers(shape, *pose));
    for pair in poses.windows(2) {
        if was_on_road && departs_road(road, shape, vehicle, pair[0], pair[1]).is_some() {
            return true;
        }
        was_on_road |= road.covers(shape, pair[1]);
    }
    false
}

/// One box per interval between consecutive poses, each around a footprint (length, width [m], centred on the pose) at
/// both ends of its interval.
pub fn swept_boxes(poses: &[Pose], length: f64, width: f64) -> Vec<OrientedBox> {
    let footprint = |pose: Pose| OrientedBox::new(pose, length, width);
    poses.windows(2).map(|pair| OrientedBox::spanning(&footprint(pair[0]), &footprint(pair[1]))).collect()
}

#[cfg(test)]
mod tests;
