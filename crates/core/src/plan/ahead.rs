//! Who will be on a path, where and when, and how hard to brake for them.
//!
//! Every participant is projected onto the path, now and at every predicted step, for every mode that is likely enough.
//! Where its box lies in the corridor of the vehicle it occupies a stretch of the path. Consecutive steps of one kind
//! make a claim: somebody who moves along the path (or stands) is a leader; somebody who crosses makes the entry of the
//! stretch a standing virtual leader until it has left; somebody who joins later is a virtual leader already now,
//! moved back along the path. Whether the vehicle has to wait for a claim that begins later is decided once per plan.

use super::car_following::{CarFollowing, Motion};
use super::{Other, PlanRequest};
use crate::geometry::polyline::{PathPoint, ReferencePath};
use crate::geometry::shape::{OrientedBox, Shape};
use crate::geometry::{Aabb, Point, Pose, wrap_angle};

/// The corridor is wider than the vehicle by this, on each side [m].
const CORRIDOR_MARGIN: f64 = 0.2;
/// In bends by at most this more, on the outside [m].
const WIDENING_MAX: f64 = 2.0;
/// Somebody slower than this stands, whatever the heading [m/s].
const STANDING: f64 = 0.5;
/// Somebody moves along the path within 60 degrees of it (cosine).
const SAME_DIRECTION: f64 = 0.5;
/// Modes with at least this probability count, and the most probable one.
const MODE_PROBABILITY: f64 = 0.2;
/// From a foot that is off by less than this along the path [m] the last step is made without a look.
const FOOT_TOLERANCE: f64 = 0.3;
/// Structures are looked for every so many metres of the path.
const STRUCTURE_STEP: f64 = 1.0;
/// Between two looks that are nearer in time than this [s], leaders move evenly.
const INTERPOLATED: f64 = 0.5;
/// Where the path turns by less than this [rad], the foot of a point within 20 m of it lies within this distance of where it
/// would be on a straight path [m]: 20 m times the sine, and 6 % of the reach.
const STRAIGHT_TURN: f64 = 0.35;
const STRAIGHT_WINDOW: f64 = 20.0;
/// Who is further behind the rear axle than this, and its size, is not looked at [m].
const BEHIND: f64 = 3.0;
/// Somebody who is further away from the corridor, on one side of it, than this times the time between two looks [m/s] is
/// not in it in between.
const SWERVE: f64 = 0.4;
/// The vehicle goes first if it has left the stretch by this distance [m] when the other comes.
const CLEARANCE: f64 = 1.0;
/// The vehicle comes after the other by this time [s].
const TIME_CLEARANCE: f64 = 0.3;
/// Entries that are nearer in time than this are at the same time [s].
const SAME_TIME: f64 = 0.5;
/// The other can be expected to wait if that takes no more than this deceleration [m/s²].
const COURTESY: f64 = 2.0;
/// A vehicle whose front is further into the stretch than this cannot wait before it any more [m].
const COMMITTED: f64 = 1.0;

/// What somebody occupies of the path at one point of the plan.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Arc lengths of the nearest and the furthest point [m].
    low: f64,
    high: f64,
    /// Speed along the path [m/s], not negative.
    velocity: f64,
    /// Moves along the path, or stands.
    along: bool,
    /// In the corridor.
    inside: bool,
    /// Distance to the corridor [m], negative on its right, zero in it.
    clearance: f64,
}

impl Place {
    /// Moves along the path in the corridor, or stands there.
    fn leads(&self) -> bool {
        self.inside && self.along
    }

    fn towards(&self, other: &Self, share: f64) -> Self {
        let between = |a: f64, b: f64| a + (b - a) * share;
        Self {
            low: between(self.low, other.low),
            high: between(self.high, other.high),
            velocity: between(self.velocity, other.velocity),
            ..*self
        }
    }
}

const OUTSIDE: Place =
    Place { low: f64::NAN, high: f64::NAN, velocity: 0.0, along: true, inside: false, clearance: 0.0 };

/// Consecutive points at which somebody occupies a stretch of the path in one way.
#[derive(Debug, Clone, Copy)]
struct Claim {
    /// First of its places among `places`, that of point 0.
    row: usize,
    first: usize,
    last: usize,
    along: bool,
    /// Still there at the end of the plan.
    stays: bool,
    /// Entry of the stretch [m].
    entry: f64,
    /// Position in the request's `others`.
    other: usize,
    mode: usize,
    counts: bool,
}

/// The vehicle on its path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ego<'a> {
    pub(super) path: &'a ReferencePath,
    /// Arc length of the rear axle, its derivative, and the lateral offset.
    pub(super) s: f64,
    pub(super) velocity: f64,
    pub(super) d: f64,
    /// From the rear axle to the front and the rear of the footprint, along the path [m].
    pub(super) to_front: f64,
    pub(super) to_rear: f64,
    pub(super) half_width: f64,
    /// An offset is given up within this time [s].
    pub(super) return_time: f64,
    /// How far to look ahead [m].
    pub(super) reach: f64,
}

impl<'a> Ego<'a> {
    pub(super) fn new(
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
            to_front: vehicle.rear_axle_to_center + 0.5 * vehicle.length,
            to_rear: vehicle.rear_axle_to_center - 0.5 * vehicle.length,
            half_width: 0.5 * vehicle.width,
            return_time,
            reach: 60.0 + 6.0 * velocity,
        }
    }

    /// Right and left edge of the corridor at a time from now [m].
    fn corridor(&self, time: f64) -> (f64, f64) {
        let d = self.d * (1.0 - time / self.return_time).max(0.0);
        let half = self.half_width + CORRIDOR_MARGIN;
        (d.min(0.0) - half, d.max(0.0) + half)
    }

    /// How far the front swings out of the corridor on the right and on the left of an arc length: the rear axle follows
    /// the path, the front is ahead of it on the tangent.
    fn overhang(&self, at: &PathPoint, s: f64) -> (f64, f64) {
        let before = self.path.at(s - 0.5 * self.to_front).curvature;
        let curvature = if before.abs() > at.curvature.abs() { before } else { at.curvature };
        let swing = (0.5 * curvature * self.to_front * self.to_front).clamp(-WIDENING_MAX, WIDENING_MAX);
        (swing.max(0.0), (-swing).max(0.0))
    }

    fn middle(&self) -> f64 {
        0.5 * (self.to_front + self.to_rear)
    }
}

/// Everybody who counts for one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Ahead {
    places: Vec<Place>,
    claims: Vec<Claim>,
    n_points: usize,
    dt: f64,
}

impl Ahead {
    /// Projects all participants of the request onto the path. Claims that begin later do not count until `decide`.
    pub(super) fn collect(&mut self, request: &PlanRequest, ego: &Ego, n_points: usize) {
        self.places.clear();
        self.claims.clear();
        (self.n_points, self.dt) = (n_points, request.dt);
        let region = Region::new(ego);
        for (index, other) in request.others.iter().enumerate() {
            if other.is_static {
                self.add_static(request, index, other, ego, &region);
            } else {
                self.add_moving(request, index, other, ego, &region);
            }
        }
    }

    fn add_static(&mut self, request: &PlanRequest, index: usize, other: &Other, ego: &Ego, region: &Region) {
        if !other.shape.aabb(other.pose).overlaps(&region.aabb) {
            return;
        }
        let place = if is_box(other.shape) {
            let body = other.shape.oriented_box(other.pose);
            let foot = foot_of(ego, region, body.center, None);
            foot.and_then(|foot| place(ego, &body, &foot, 0.0, 0.0)).filter(|place| place.inside)
        } else {
            structure(request, other, ego)
        };
        let Some(place) = place.filter(|place| 0.5 * (place.low + place.high) > ego.s + ego.middle()) else { return };
        let row = self.places.len();
        self.places.resize(row + self.n_points, Place { velocity: 0.0, along: true, ..place });
        self.push_claims(ego, row, index, 0);
    }

    fn add_moving(&mut self, request: &PlanRequest, index: usize, other: &Other, ego: &Ego, region: &Region) {
        let predictions = request.predictions;
        let Ok(shift) = usize::try_from(request.time_step - predictions.time_step) else { return };
        let region = region.grown(other.shape.bounding_radius());
        let probabilities = &predictions.probability[other.row * predictions.n_modes..][..predictions.n_modes];
        let largest = probabilities.iter().copied().fold(0.0, f64::max);
        let mut now = None;
        for (mode, probability) in probabilities.iter().enumerate() {
            if *probability < largest && *probability < MODE_PROBABILITY || *probability <= 0.0 {
                continue;
            }
            let start = predictions.offset(other.row, mode) + shift;
            let n_known = predictions.n_steps.saturating_sub(shift);
            let expected = Expected { request, other, ego, region, start, n_known, dt: self.dt };
            let now = *now.get_or_insert_with(|| expected.at(0, None));
            if now.place.is_some_and(|place| is_follower(ego, &place)) {
                return;
            }
            let (row, last) = (self.places.len(), self.n_points - 1);
            self.places.resize(row + self.n_points, OUTSIDE);
            self.put(row, &now);
            let end = expected.at(last, now.foot);
            self.put(row + last, &end);
            self.fill(&expected, row, (0, now), (last, end));
            if self.places[row..].iter().any(|place| place.inside) {
                self.push_claims(ego, row, index, mode);
            } else {
                self.places.truncate(row);
            }
        }
    }

    fn put(&mut self, at: usize, sample: &Sample) {
        self.places[at] = sample.place.unwrap_or(OUTSIDE);
    }

    /// The points between two, halving until somebody is away from the corridor in between.
    fn fill(&mut self, expected: &Expected, row: usize, (a, before): (usize, Sample), (b, after): (usize, Sample)) {
        if b - a < 2 || before.stays_away(&after, (b - a) as f64 * self.dt, &expected.region) {
            return;
        }
        if let (Some(from), Some(to)) = (&before.place, &after.place)
            && from.leads()
            && to.leads()
            && (b - a) as f64 * self.dt < INTERPOLATED
        {
            for point in a + 1..b {
                self.places[row + point] = from.towards(to, (point - a) as f64 / (b - a) as f64);
            }
            return;
        }
        let middle = usize::midpoint(a, b);
        let sample = expected.at(middle, before.foot);
        self.put(row + middle, &sample);
        self.fill(expected, row, (a, before), (middle, sample));
        self.fill(expected, row, (middle, sample), (b, after));
    }

    /// Splits the places from `row` on into claims.
    fn push_claims(&mut self, ego: &Ego, row: usize, other: usize, mode: usize) {
        let places = &self.places[row..row + self.n_points];
        let mut at = 0;
        while at < places.len() {
            let first = at;
            let Place { inside, along, .. } = places[first];
            while at < places.len() && places[at].inside == inside && (!inside || places[at].along == along) {
                at += 1;
            }
            if !inside {
                continue;
            }
            let last = at - 1;
            let (front, middle) = (ego.s + ego.to_front, 0.5 * (places[first].low + places[first].high));
            // What lies beside or behind the vehicle's front cannot be waited for.
            let lows = places[first..=last].iter().map(|place| place.low);
            let entry = lows.filter(|low| *low >= front - COMMITTED).fold(f64::INFINITY, f64::min);
            let is_passed = if along { first == 0 && middle <= front } else { entry.is_infinite() };
            if is_passed {
                continue;
            }
            let stays = last + 1 == places.len();
            self.claims.push(Claim { row, first, last, along, stays, entry, other, mode, counts: first == 0 });
        }
    }

    /// Decides for whom among those who come later the vehicle waits, from the motion that it would have without them.
    pub(super) fn decide(&mut self, request: &PlanRequest, ego: &Ego, free: &[Motion]) {
        for claim in &mut self.claims {
            if claim.first > 0 {
                let places = &self.places[claim.row..claim.row + self.n_points];
                claim.counts = if claim.along {
                    is_joined_ahead(ego, claim, places, free, self.dt)
                } else {
                    must_wait(request, ego, claim, places, free, self.dt)
                };
            }
        }
    }

    /// Least of the accelerations that those who count allow at a point of the plan [m/s²]; infinite if nobody counts.
    pub(super) fn allowed(&self, point: usize, ego: &Ego, s: f64, velocity: f64, law: &CarFollowing) -> f64 {
        let front = s + ego.to_front;
        let mut least = f64::INFINITY;
        for claim in self.claims.iter().filter(|claim| claim.counts && point <= claim.last) {
            let place = |at: usize| &self.places[claim.row + at];
            let acceleration = if !claim.along {
                if claim.entry < front - COMMITTED {
                    continue;
                }
                let stop = following(law, velocity, claim.entry - front, 0.0);
                if claim.stays {
                    stop
                } else {
                    let time = (claim.last + 1 - point) as f64 * self.dt + TIME_CLEARANCE;
                    stop.max(not_before(claim.entry - front - 0.5 * law.minimum_gap, velocity, 0.0, time))
                }
            } else if point >= claim.first {
                let place = place(point);
                if 0.5 * (place.low + place.high) <= front {
                    continue;
                }
                following(law, velocity, place.low - front, place.velocity)
            } else {
                let joined = place(claim.first);
                let time = (claim.first - point) as f64 * self.dt;
                let moved_back = joined.low - joined.velocity * time;
                let keep = following(law, velocity, moved_back - front, joined.velocity);
                let room = joined.low - front - law.minimum_gap;
                keep.max(not_before(room, velocity, joined.velocity, time))
            };
            least = least.min(acceleration);
        }
        least
    }
}

/// The acceleration behind a leader without a desired speed: what is left of the model if the road ahead of it were free.
fn following(law: &CarFollowing, velocity: f64, gap: f64, leader_velocity: f64) -> f64 {
    law.acceleration + law.interaction(velocity, gap, leader_velocity)
}

/// Constant acceleration with which a distance is not used up before a time is over [m/s²]; infinite if it is not anyway.
/// Towards the end the vehicle need not be slower than `end_velocity`.
fn not_before(distance: f64, velocity: f64, end_velocity: f64, time: f64) -> f64 {
    if velocity * time <= distance {
        return f64::INFINITY;
    }
    if distance <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let constant = 2.0 * (distance - velocity * time) / (time * time);
    if velocity + constant * time >= end_velocity {
        constant
    } else {
        // It would be slower than necessary at the end, or stand: brake to that speed within the distance.
        (end_velocity * end_velocity - velocity * velocity) / (2.0 * distance)
    }
}

/// The part of the world in which the corridor ahead lies.
#[derive(Debug, Clone, Copy)]
struct Region {
    aabb: Aabb,
    /// Rear axle and direction of the path there; nothing of the path lies behind it.
    behind: Option<(Point, Point)>,
    /// The path hardly bends: rear axle and direction of the path there, from which a foot can be guessed.
    straight: Option<(Point, Point)>,
}

impl Region {
    fn new(ego: &Ego) -> Self {
        const SPACING: f64 = 5.0;
        let n = (ego.reach / SPACING).ceil() as usize;
        let here = ego.path.at(ego.s);
        let (origin, axis) = (here.position, here.tangent());
        let (mut aabb, mut nearest, mut turn) = (Aabb::EMPTY, f64::INFINITY, 0.0_f64);
        for i in 0..=n {
            let at = ego.path.at(ego.s + i as f64 * SPACING);
            aabb = aabb.including(at.position);
            nearest = nearest.min((at.position - origin).dot(axis));
            turn = turn.max((at.theta - here.theta).abs());
        }
        // Between two of the points a bend of 5 m radius bulges by less than 0.7 m.
        let aabb = aabb.grown(ego.half_width + ego.d.abs() + CORRIDOR_MARGIN + 0.7);
        let here = Some((origin, axis));
        Self { aabb, behind: here.filter(|_| nearest >= 0.0), straight: here.filter(|_| turn < STRAIGHT_TURN) }
    }

    /// For a body of a radius [m].
    fn grown(self, radius: f64) -> Self {
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

/// Where on the path somebody is.
#[derive(Debug, Clone, Copy)]
struct Foot {
    /// Arc length and offset [m].
    s: f64,
    d: f64,
    at: PathPoint,
    /// The point.
    point: Point,
}

/// The foot of a point: from a foot of the same body at another time if possible, otherwise by a search.
fn foot_of(ego: &Ego, region: &Region, point: Point, known: Option<Foot>) -> Option<Foot> {
    if let Some(known) = known {
        let mut s = known.s + (point - known.point).dot(known.at.tangent());
        for _ in 0..3 {
            let at = ego.path.at(s);
            let offset = point - at.position;
            let (ahead, d) = (offset.dot(at.tangent()), at.tangent().cross(offset));
            let step = ahead / (1.0 - at.curvature * d).clamp(0.3, 3.0);
            if ahead.abs() < FOOT_TOLERANCE {
                return Some(Foot { s: s + step, d, at, point });
            }
            s += step;
        }
    }
    let found = match region.straight {
        Some((origin, axis)) => ego.path.project_near(point, ego.s + (point - origin).dot(axis), STRAIGHT_WINDOW),
        None => ego.path.project_near(point, ego.s + 0.5 * ego.reach, 0.5 * ego.reach + 10.0),
    };
    let (s, d) = found?;
    Some(Foot { s, d, at: ego.path.at(s), point })
}

/// What a box at a foot occupies of the path.
fn place(ego: &Ego, body: &OrientedBox, foot: &Foot, velocity: f64, time: f64) -> Option<Place> {
    let Foot { s, d, at, .. } = *foot;
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
    let along = velocity.abs() < STANDING || cos * velocity.signum() > SAME_DIRECTION;
    let velocity = if velocity.abs() < STANDING { 0.0 } else { (velocity * cos).max(0.0) };
    let clearance = (d - half_d - left).max(0.0) + (d + half_d - right).min(0.0);
    let inside = clearance == 0.0;
    let crosses = inside && !along;
    let (low, high) = if crosses { stretch(body, (cos, sin), (right - d, left - d))? } else { (-half_s, half_s) };
    Some(Place { low: s + low, high: s + high, velocity, along, inside, clearance })
}

/// Where one mode of somebody is expected.
struct Expected<'a> {
    request: &'a PlanRequest<'a>,
    other: &'a Other<'a>,
    ego: &'a Ego<'a>,
    region: Region,
    /// Position of point 1 of the plan in the predictions, and how many points from there on are known.
    start: usize,
    n_known: usize,
    dt: f64,
}

/// Somebody at one point of the plan.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Centre of the box; NaN if unknown.
    center: Point,
    foot: Option<Foot>,
    place: Option<Place>,
}

impl Expected<'_> {
    /// At a point of the plan; `near` is a foot at another point.
    fn at(&self, point: usize, near: Option<Foot>) -> Sample {
        let predictions = self.request.predictions;
        let (pose, velocity) = match point.checked_sub(1) {
            None => (self.other.pose, self.other.velocity),
            Some(i) if i < self.n_known && predictions.valid[self.start + i] => {
                let k = self.start + i;
                let pose = Pose::new(predictions.x[k], predictions.y[k], predictions.orientation[k]);
                (pose, predictions.velocity[k])
            }
            Some(_) => {
                return Sample { center: Point::new(f64::NAN, f64::NAN), foot: None, place: None };
            }
        };
        if !self.region.contains(pose.position) {
            return Sample { center: pose.position, foot: None, place: None };
        }
        let body = self.other.shape.oriented_box(pose);
        let foot = foot_of(self.ego, &self.region, body.center, near);
        let time = point as f64 * self.dt;
        let place = foot.and_then(|foot| place(self.ego, &body, &foot, velocity, time));
        Sample { center: pose.position, foot, place }
    }
}

impl Sample {
    /// Between this and a later sample nobody gets into the corridor, unless they swerve.
    fn stays_away(&self, later: &Self, time: f64, region: &Region) -> bool {
        match (&self.place, &later.place) {
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

/// Somebody in the corridor behind the vehicle who drives the same way: keeping the distance is up to them.
fn is_follower(ego: &Ego, place: &Place) -> bool {
    place.inside && place.along && 0.5 * (place.low + place.high) <= ego.s + ego.middle()
}

/// One rectangle, or something that a box around it describes well enough.
fn is_box(shape: &Shape) -> bool {
    let [part] = shape.parts() else { return false };
    let (length, width) = shape.extent();
    let area: f64 = (1..part.vertices.len().max(1) - 1)
        .map(|i| 0.5 * (part.vertices[i] - part.vertices[0]).cross(part.vertices[i + 1] - part.vertices[0]))
        .sum();
    part.vertices.len() < 3 || area > 0.98 * length * width
}

/// Where the footprint, driven along the path, would first touch a structure.
fn structure(request: &PlanRequest, other: &Other, ego: &Ego) -> Option<Place> {
    let n = (ego.reach.min(100.0 + ego.velocity * 2.0) / STRUCTURE_STEP) as usize;
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
    Some(Place { low, high: low + 2.0 * ego.to_front, velocity: 0.0, along: true, inside: true, clearance: 0.0 })
}

/// Somebody who will join the path does so ahead of the vehicle, as far as one can tell from both present speeds.
fn is_joined_ahead(ego: &Ego, claim: &Claim, places: &[Place], free: &[Motion], dt: f64) -> bool {
    let place = &places[claim.first];
    let middle = 0.5 * (place.low + place.high);
    let clear = free[claim.first].s + ego.to_rear > place.high + CLEARANCE;
    let at_present_speed = ego.s + ego.middle() + ego.velocity * claim.first as f64 * dt;
    !clear && middle >= at_present_speed
}

/// The vehicle waits for somebody who will cross, unless it will have passed by then, or can wait no more, or the other
/// has to wait.
fn must_wait(request: &PlanRequest, ego: &Ego, claim: &Claim, places: &[Place], free: &[Motion], dt: f64) -> bool {
    let passes_first =
        (claim.first..=claim.last).all(|point| free[point].s + ego.to_rear > places[point].high + CLEARANCE);
    let distance = claim.entry - ego.s - ego.to_front;
    // False for a stretch that the front has entered, too.
    let can_stop = ego.velocity * ego.velocity <= 2.0 * request.vehicle.acceleration_max * distance;
    if passes_first || !can_stop {
        return false;
    }
    let other = &request.others[claim.other];
    // Both at their present speeds, as others see it: so two who meet agree about who is first.
    let (own_time, other_time) = (distance / ego.velocity.max(1e-3), claim.first as f64 * dt);
    if other.velocity.abs() > 2.0 * COURTESY * other_time {
        return true;
    }
    if (own_time - other_time).abs() > SAME_TIME {
        return own_time > other_time;
    }
    !has_priority(request, ego, claim)
}

/// Who comes at the same time: who goes straight on before who turns, otherwise who comes from the right.
fn has_priority(request: &PlanRequest, ego: &Ego, claim: &Claim) -> bool {
    const SAME_TURN: f64 = 0.2;
    let (other, predictions) = (&request.others[claim.other], request.predictions);
    let k = predictions.offset(other.row, claim.mode) + claim.first - 1;
    let (here, there) = (ego.path.at(ego.s), ego.path.at(claim.entry));
    let own_turn = (there.theta - here.theta).abs();
    let other_turn = wrap_angle(predictions.orientation[k] - other.pose.orientation).abs();
    if (own_turn - other_turn).abs() > SAME_TURN {
        return own_turn < other_turn;
    }
    // It comes from the left if it heads to the right across the path.
    there.tangent().cross(Point::from_angle(predictions.orientation[k])) < 0.0
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
        for (body, (cos, sin), (right, left), expected) in [
            // Across the corridor: as wide as the box.
            (body(2.0, 1.0), (0.0, 1.0), (-0.5, 0.5), Some((-1.0, 1.0))),
            // Along it: as long as the box.
            (body(2.0, 1.0), (1.0, 0.0), (-0.5, 0.5), Some((-2.0, 2.0))),
            // A thin diagonal of which the corridor sees from 0.5 m to 1 m beside the centre.
            (body(2.0, 0.0), (diagonal, diagonal), (0.5, 1.0), Some((0.5, 1.0))),
            (body(2.0, 1.0), (1.0, 0.0), (1.5, 2.0), None),
        ] {
            match (stretch(&body, (cos, sin), (right, left)), expected) {
                (Some((low, high)), Some((a, b))) => {
                    assert!((low - a).abs() < 1e-9 && (high - b).abs() < 1e-9, "{low} {high}");
                }
                (found, expected) => assert_eq!(found, expected),
            }
        }
    }

    #[test]
    fn waiting_takes_no_more_braking_than_is_necessary() {
        for (distance, velocity, end_velocity, time, expected) in [
            // It would arrive after 2 s anyway.
            (20.0, 10.0, 0.0, 2.0, f64::INFINITY),
            // 10 * 3 - 0.5 * 2.222 * 9 = 20
            (20.0, 10.0, 0.0, 3.0, -20.0 / 9.0),
            // Longer than it takes to stop: brake to rest, 10² / (2 * 20).
            (20.0, 10.0, 0.0, 10.0, -2.5),
            // Behind somebody with 6 m/s: (36 - 100) / 40.
            (20.0, 10.0, 6.0, 10.0, -1.6),
            (-1.0, 10.0, 0.0, 1.0, f64::NEG_INFINITY),
        ] {
            let found = not_before(distance, velocity, end_velocity, time);
            assert!(found == expected || (found - expected).abs() < 1e-9, "{found} for {expected}");
        }
    }
}
