//! The interval of a path that a participant occupies at one time.

use crate::conduct::STATIONARY_SPEED;
use crate::geometry::polyline::{PathPoint, ReferencePath};
use crate::geometry::shape::{OrientedBox, Shape};
use crate::geometry::{Aabb, Point, Pose};
use crate::plan::car_following::LEADER_HEADING_COSINE;
use crate::plan::{Other, PlanRequest};

/// The corridor is wider than the vehicle by this, on each side [m].
const CORRIDOR_MARGIN: f64 = 0.2;
/// In bends by at most this more, on the outside [m].
const WIDENING_MAX: f64 = 2.0;
/// From a foot that is off by less than this along the path [m] the last step is made without a look.
const FOOT_TOLERANCE: f64 = 0.3;
/// Structures are looked for every so many metres of the path.
const STRUCTURE_STEP: f64 = 1.0;
/// A participant that is further from the corridor, on one side, than this times the time between two samples [m/s] is
/// not in it in between.
const SWERVE: f64 = 0.4;
/// Participants further behind the rear axle than this plus their size are ignored [m].
const BEHIND: f64 = 3.0;
/// Where the path turns by less than this [rad], the foot of a point within 20 m of it lies within this distance of where it
/// would be on a straight path [m]: 20 m times the sine, and 6 % of the reach.
const STRAIGHT_TURN: f64 = 0.35;
const STRAIGHT_WINDOW: f64 = 20.0;

/// What a participant occupies of the path at one point of the plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PathInterval {
    /// Arc lengths of the nearest and the furthest point [m].
    pub(super) low: f64,
    pub(super) high: f64,
    /// Speed along the path [m/s], not negative.
    pub(super) velocity: f64,
    /// Moves along the path, or stands.
    pub(super) along: bool,
    /// In the corridor.
    pub(super) inside: bool,
    /// Distance to the corridor [m], negative on its right, zero in it.
    pub(super) clearance: f64,
}

impl PathInterval {
    /// Moves along the path in the corridor, or stands there.
    pub(super) fn leads(&self) -> bool {
        self.inside && self.along
    }

    pub(super) fn towards(&self, other: &Self, share: f64) -> Self {
        let between = |a: f64, b: f64| a + (b - a) * share;
        Self {
            low: between(self.low, other.low),
            high: between(self.high, other.high),
            velocity: between(self.velocity, other.velocity),
            ..*self
        }
    }
}

pub(super) const OUTSIDE: PathInterval =
    PathInterval { low: f64::NAN, high: f64::NAN, velocity: 0.0, along: true, inside: false, clearance: 0.0 };

/// The vehicle on its path.
#[derive(Debug, Clone, Copy)]
pub(in crate::plan) struct Ego<'a> {
    pub(in crate::plan) path: &'a ReferencePath,
    /// Arc length of the rear axle, its speed, and the lateral offset.
    pub(in crate::plan) s: f64,
    pub(in crate::plan) velocity: f64,
    pub(in crate::plan) d: f64,
    /// The offset that it drives to [m].
    pub(in crate::plan) target: f64,
    /// From the rear axle to the front and the rear of the footprint, along the path [m].
    pub(in crate::plan) to_front: f64,
    pub(in crate::plan) to_rear: f64,
    pub(in crate::plan) half_width: f64,
    /// An offset is given up within this time [s].
    pub(in crate::plan) return_time: f64,
    /// How far to look ahead [m].
    pub(in crate::plan) reach: f64,
}

impl<'a> Ego<'a> {
    pub(in crate::plan) fn new(
        request: &PlanRequest,
        path: &'a ReferencePath,
        (s, velocity, d): (f64, f64, f64),
        return_time: f64,
    ) -> Self {
        let vehicle = request.vehicle;
        Self {
            path,
            s,
            velocity,
            d,
            target: 0.0,
            to_front: vehicle.rear_axle_to_center + 0.5 * vehicle.length,
            to_rear: vehicle.rear_axle_to_center - 0.5 * vehicle.length,
            half_width: 0.5 * vehicle.width,
            return_time,
            reach: 60.0 + 6.0 * velocity,
        }
    }

    /// Right and left edge of the corridor at a time from now [m].
    fn corridor(&self, time: f64) -> (f64, f64) {
        let d = self.target + (self.d - self.target) * (1.0 - time / self.return_time).max(0.0);
        let half = self.half_width + CORRIDOR_MARGIN;
        (d.min(self.target) - half, d.max(self.target) + half)
    }

    /// How far the front swings out of the corridor on the right and on the left of an arc length: the rear axle follows
    /// the path, the front is ahead of it on the tangent.
    fn overhang(&self, at: &PathPoint, s: f64) -> (f64, f64) {
        let before = self.path.curvature_at(s - 0.5 * self.to_front);
        let curvature = if before.abs() > at.curvature.abs() { before } else { at.curvature };
        let swing = (0.5 * curvature * self.to_front * self.to_front).clamp(-WIDENING_MAX, WIDENING_MAX);
        (swing.max(0.0), (-swing).max(0.0))
    }

    pub(super) fn middle(&self) -> f64 {
        0.5 * (self.to_front + self.to_rear)
    }
}

/// The part of the world in which the path, or the corridor, ahead lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Region {
    pub(super) aabb: Aabb,
    /// Rear axle and direction of the path there; nothing of the path lies behind it.
    pub(super) behind: Option<(Point, Point)>,
    /// The path hardly bends: rear axle and direction of the path there, from which a foot can be guessed.
    pub(super) straight: Option<(Point, Point)>,
}

impl Default for Region {
    /// Of nothing.
    fn default() -> Self {
        Self { aabb: Aabb::EMPTY, behind: None, straight: None }
    }
}

impl Region {
    /// Of the path.
    pub(super) fn of_path(ego: &Ego) -> Self {
        /// Distance of the places on the path that are looked at [m]; the box is widened by what lies between.
        const SPACING: f64 = 5.0;
        let n = ego.path.steps_from(ego.s, SPACING, (ego.reach / SPACING).ceil());
        let here = ego.path.at(ego.s);
        let (origin, axis) = (here.position, here.tangent());
        let (mut aabb, mut nearest, mut turn) = (Aabb::EMPTY, f64::INFINITY, 0.0_f64);
        for i in 0..=n {
            let at = ego.path.at(ego.s + i as f64 * SPACING);
            aabb = aabb.including(at.position);
            nearest = nearest.min((at.position - origin).dot(axis));
            turn = turn.max((at.theta - here.theta).abs());
        }
        let here = Some((origin, axis));
        Self { aabb, behind: here.filter(|_| nearest >= 0.0), straight: here.filter(|_| turn < STRAIGHT_TURN) }
    }

    /// Of the corridor of the vehicle along the path.
    pub(super) fn around(self, ego: &Ego) -> Self {
        // Between two of the points a bend of 5 m radius bulges by less than 0.7 m.
        let aabb = self.aabb.grown(ego.half_width + ego.d.abs().max(ego.target.abs()) + CORRIDOR_MARGIN + 0.7);
        Self { aabb, ..self }
    }

    /// For a body of a radius [m].
    pub(super) fn grown(self, radius: f64) -> Self {
        let behind = self.behind.map(|(origin, axis)| (origin - axis * (radius + BEHIND), axis));
        Self { aabb: self.aabb.grown(radius), behind, ..self }
    }

    fn contains(&self, point: Point) -> bool {
        self.aabb.contains(point) && self.behind.is_none_or(|(origin, axis)| (point - origin).dot(axis) >= 0.0)
    }

    /// Nothing on the way from one point to another is in it.
    fn misses(&self, a: Point, b: Point) -> bool {
        let is_behind = |point: Point| self.behind.is_some_and(|(origin, axis)| (point - origin).dot(axis) < 0.0);
        is_behind(a) && is_behind(b) || !self.aabb.overlaps(&Aabb::around([a, b]))
    }
}

/// The foot of a participant on the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathFoot {
    /// Arc length and offset [m].
    s: f64,
    d: f64,
    at: PathPoint,
    /// The point.
    point: Point,
}

/// The foot of a point: from a foot of the same body at another time if possible, otherwise by a search.
pub(super) fn foot_of(ego: &Ego, region: &Region, point: Point, known: Option<PathFoot>) -> Option<PathFoot> {
    if let Some(known) = known {
        let mut s = known.s + (point - known.point).dot(known.at.tangent());
        for _ in 0..3 {
            let at = ego.path.at(s);
            let offset = point - at.position;
            let (ahead, d) = (offset.dot(at.tangent()), at.tangent().cross(offset));
            let step = ahead / (1.0 - at.curvature * d).clamp(0.3, 3.0);
            if ahead.abs() < FOOT_TOLERANCE {
                return Some(PathFoot { s: s + step, d, at, point });
            }
            s += step;
        }
    }
    let found = match region.straight {
        Some((origin, axis)) => ego.path.project_near(point, ego.s + (point - origin).dot(axis), STRAIGHT_WINDOW),
        None => ego.path.project_near(point, ego.s + 0.5 * ego.reach, 0.5 * ego.reach + 10.0),
    };
    let (s, d) = found?;
    Some(PathFoot { s, d, at: ego.path.at(s), point })
}

/// What a box at a foot occupies of the path.
pub(super) fn interval_of(
    ego: &Ego,
    body: &OrientedBox,
    foot: &PathFoot,
    velocity: f64,
    time: f64,
) -> Option<PathInterval> {
    let PathFoot { s, d, at, .. } = *foot;
    let tangent = at.tangent();
    let (cos, sin) = (tangent.dot(body.axis), tangent.cross(body.axis));
    let half_s = body.half_length * cos.abs() + body.half_width * sin.abs();
    let half_d = body.half_length * sin.abs() + body.half_width * cos.abs();
    let (right, left) = ego.corridor(time);
    let (right, left) = if d - half_d < left + WIDENING_MAX && d + half_d > right - WIDENING_MAX {
        let (wider_right, wider_left) = ego.overhang(&at, s);
        (right - wider_right, left + wider_left)
    } else {
        (right, left)
    };
    let along = velocity.abs() < STATIONARY_SPEED || cos * velocity.signum() > LEADER_HEADING_COSINE;
    let velocity = if velocity.abs() < STATIONARY_SPEED { 0.0 } else { (velocity * cos).max(0.0) };
    let clearance = (d - half_d - left).max(0.0) + (d + half_d - right).min(0.0);
    let inside = clearance == 0.0;
    let crosses = inside && !along;
    let (low, high) = if crosses { stretch(body, (cos, sin), (right - d, left - d))? } else { (-half_s, half_s) };
    Some(PathInterval { low: s + low, high: s + high, velocity, along, inside, clearance })
}

/// One predicted mode of a participant.
pub(super) struct PredictedMode<'a> {
    pub(super) request: &'a PlanRequest<'a>,
    pub(super) other: &'a Other<'a>,
    pub(super) ego: &'a Ego<'a>,
    pub(super) region: Region,
    /// Position of point 1 of the plan in the predictions, and how many points from there on are known.
    pub(super) start: usize,
    pub(super) n_known: usize,
    pub(super) dt: f64,
    /// The plan for which places are kept.
    pub(super) plan: u64,
}

/// Where a predicted participant is beside the path: the same on every way that a plan looks at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    /// The plan that it was found for, from 1 on.
    plan: u64,
    /// Arc length from which the foot was looked for [m].
    near: Option<f64>,
    body: OrientedBox,
    foot: Option<PathFoot>,
}

impl Placed {
    pub(super) const NEVER: Self = Self {
        plan: 0,
        near: None,
        body: OrientedBox {
            center: Point { x: 0.0, y: 0.0 },
            axis: Point { x: 1.0, y: 0.0 },
            half_length: 0.0,
            half_width: 0.0,
        },
        foot: None,
    };
}

/// A participant at one point of the plan, projected onto the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projection {
    /// Centre of the box; NaN if unknown.
    pub(super) center: Point,
    pub(super) foot: Option<PathFoot>,
    pub(super) interval: Option<PathInterval>,
}

impl PredictedMode<'_> {
    /// At a point of the plan; `near` is a foot at another point, `placed` what the plan knows of the points already.
    pub(super) fn at(&self, point: usize, near: Option<PathFoot>, placed: &mut [Placed]) -> Projection {
        let predictions = self.request.predictions;
        let (pose, velocity) = match point.checked_sub(1) {
            None => (self.other.pose, self.other.velocity),
            Some(i) if i < self.n_known && predictions.valid[self.start + i] => {
                let k = self.start + i;
                let pose = Pose::new(predictions.x[k], predictions.y[k], predictions.orientation[k]);
                (pose, predictions.velocity[k])
            }
            Some(_) => {
                return Projection { center: Point::new(f64::NAN, f64::NAN), foot: None, interval: None };
            }
        };
        if !self.region.contains(pose.position) {
            return Projection { center: pose.position, foot: None, interval: None };
        }
        let (plan, from) = (self.plan, near.map(|near| near.s));
        if placed[point].plan != plan || placed[point].near != from {
            let body = self.other.shape.oriented_box(pose);
            let foot = foot_of(self.ego, &self.region, body.center, near);
            placed[point] = Placed { plan, near: from, body, foot };
        }
        let Placed { body, foot, .. } = &placed[point];
        let time = point as f64 * self.dt;
        let interval = foot.and_then(|foot| interval_of(self.ego, body, &foot, velocity, time));
        Projection { center: pose.position, foot: *foot, interval }
    }
}

impl Projection {
    /// Between this and a later projection the participant does not enter the corridor unless it swerves.
    pub(super) fn stays_away(&self, later: &Self, time: f64, region: &Region) -> bool {
        match (&self.interval, &later.interval) {
            (Some(a), Some(b)) => {
                a.clearance * b.clearance > 0.0 && a.clearance.abs().min(b.clearance.abs()) > SWERVE * time
            }
            // Outside of the region, or too far from the path.
            (None, None) => {
                let (a, b) = (self.center, later.center);
                region.contains(a) && region.contains(b) || region.misses(a, b)
            }
            _ => false,
        }
    }
}

/// The part of a box within the corridor, along the path, relative to the box's centre [m]. `cos` and `sin` are those of
/// the box's axis in the frame of the path, the edges of the corridor are relative to the centre.
fn stretch(body: &OrientedBox, (cos, sin): (f64, f64), (right, left): (f64, f64)) -> Option<(f64, f64)> {
    let corner = |ahead: f64, beside: f64| Point::new(ahead * cos - beside * sin, ahead * sin + beside * cos);
    let (l, w) = (body.half_length, body.half_width);
    let corners = [corner(l, w), corner(-l, w), corner(-l, -w), corner(l, -w)];
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut include = |s: f64| (low, high) = (low.min(s), high.max(s));
    for (i, a) in corners.iter().enumerate() {
        if (right..=left).contains(&a.y) {
            include(a.x);
        }
        let b = corners[(i + 1) % 4];
        for edge in [right, left] {
            if (a.y - edge) * (b.y - edge) < 0.0 {
                include(a.x + (b.x - a.x) * (edge - a.y) / (b.y - a.y));
            }
        }
    }
    (low <= high).then_some((low, high))
}

/// One rectangle, or something that a box around it describes well enough.
pub(super) fn is_box(shape: &Shape) -> bool {
    let [part] = shape.parts() else { return false };
    let (length, width) = shape.extent();
    let area: f64 = (1..part.vertices.len().max(1) - 1)
        .map(|i| 0.5 * (part.vertices[i] - part.vertices[0]).cross(part.vertices[i + 1] - part.vertices[0]))
        .sum();
    part.vertices.len() < 3 || area > 0.98 * length * width
}

/// Where the footprint, driven along the path, would first touch a structure.
pub(super) fn structure(request: &PlanRequest, other: &Other, ego: &Ego) -> Option<PathInterval> {
    let reach = ego.reach.min(100.0 + ego.velocity * 2.0);
    let n = ego.path.steps_from(ego.s, STRUCTURE_STEP, reach / STRUCTURE_STEP);
    let touches = |i: usize| {
        let at = ego.path.at(ego.s + i as f64 * STRUCTURE_STEP);
        let position = at.position + at.tangent() * request.vehicle.rear_axle_to_center;
        other.shape.overlaps(other.pose, request.shape, Pose { position, orientation: at.theta })
    };
    // What touches already is beside the vehicle.
    if touches(0) {
        return None;
    }
    let low = (1..=n).find(|i| touches(*i)).map(|i| ego.s + ego.to_front + (i as f64 - 1.0) * STRUCTURE_STEP)?;
    Some(PathInterval { low, high: low + 2.0 * ego.to_front, velocity: 0.0, along: true, inside: true, clearance: 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_a_box_in_the_corridor_is_what_counts() {
        let body = |half_length, half_width| OrientedBox {
            center: Point::default(),
            axis: Point::new(1.0, 0.0),
            half_length,
            half_width,
        };
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        for (body, (cos, sin), (right, left), predicted) in [
            // Across the corridor: as wide as the box.
            (body(2.0, 1.0), (0.0, 1.0), (-0.5, 0.5), Some((-1.0, 1.0))),
            // Along it: as long as the box.
            (body(2.0, 1.0), (1.0, 0.0), (-0.5, 0.5), Some((-2.0, 2.0))),
            // A thin diagonal of which the corridor sees from 0.5 m to 1 m beside the centre.
            (body(2.0, 0.0), (diagonal, diagonal), (0.5, 1.0), Some((0.5, 1.0))),
            (body(2.0, 1.0), (1.0, 0.0), (1.5, 2.0), None),
        ] {
            match (stretch(&body, (cos, sin), (right, left)), predicted) {
                (Some((low, high)), Some((a, b))) => {
                    assert!((low - a).abs() < 1e-9 && (high - b).abs() < 1e-9, "{low} {high}");
                }
                (found, predicted) => assert_eq!(found, predicted),
            }
        }
    }
}
