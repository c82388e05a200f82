//! Oncoming vehicles on the lane over which the agent would pass, and which of two goes first that have to pass something.

use super::super::car_following::LEADER_HEADING_COSINE;
use super::super::{Other, PlanRequest};
use super::{LEAD, QUEUE_OFFSET, is_parked, is_person};
use crate::conduct::STATIONARY_SPEED;
use crate::geometry::Point;

/// Modes that are less probable do not count.
const PROBABILITY_MIN: f64 = 0.2;
/// Largest offset of an oncoming vehicle from its lane while it passes something itself [m].
const PASSING_OFFSET: f64 = 2.0;
/// Two agents have to agree which of them goes first if what they pass is less than this apart [m].
const OBSTRUCTION_DISTANCE: f64 = 50.0;
/// Something blocks a lane if it leaves a vehicle less than this on one side of the middle [m].
const BLOCKING_MARGIN: f64 = 0.3;
/// Offset towards the opposing lane from which a vehicle goes first [m].
const COMMITTED_OFFSET: f64 = 0.5;
/// Differences of distances that are less than this [m] do not decide.
const DISTANCE_TIE: f64 = 0.5;
/// While the first one stands, the other one goes first in every second interval of this length [s]: the first one may
/// have reasons to stay that the other one cannot see.
const TURN_TIME: f64 = 10.0;
/// A vehicle that is no faster than this [m/s] and can stop before what blocks its lane is trusted to wait.
const TRUSTED_SPEED: f64 = 3.0;

/// Which of two goes first, as both see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Priority {
    /// The other vehicle, which passes something that ends this far before the stretch [m].
    First(f64),
    /// The agent, and the other one is parked or slow enough to wait.
    Waits,
    /// There is nothing to agree on, or the other one is too fast to rely on it.
    None,
}

/// One of two vehicles that have to pass something over the lane of the other one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passer {
    /// From its front to what it passes [m], negative beside it.
    gap: f64,
    /// How far it has moved over [m].
    moved: f64,
    velocity: f64,
    position: Point,
}

impl Passer {
    /// The agent, which passes on a side (1: left).
    pub(super) fn agent(request: &PlanRequest, side: f64, gap: f64) -> Self {
        let position = request.state.pose().position;
        let d = request.route.path.project(position).map_or(0.0, |(_, d)| d);
        Self { gap, moved: side * d, velocity: request.state.velocity, position }
    }

    /// Both vehicles find the same answer: the vehicle that has begun goes first, then the nearer one, then the vehicle
    /// with the smaller coordinates, which is arbitrary but never the same for both.
    fn passes_first(&self, other: &Self, seconds: f64) -> bool {
        let is_over = |passer: &Self| passer.moved > COMMITTED_OFFSET;
        if is_over(self) != is_over(other) {
            return is_over(self);
        }
        let is_nearer = if (self.gap - other.gap).abs() > DISTANCE_TIE {
            self.gap < other.gap
        } else {
            (self.position.x, self.position.y) < (other.position.x, other.position.y)
        };
        let first = if is_nearer { self } else { other };
        let is_swapped = first.velocity.abs() < STATIONARY_SPEED && (seconds / TURN_TIME).rem_euclid(2.0) >= 1.0;
        is_nearer != is_swapped
    }
}

/// The lane of the other direction.
pub(super) struct OpposingLane<'a> {
    pub(super) request: &'a PlanRequest<'a>,
    /// Its lanelets, and where on each the stretch begins that the agent uses [m].
    pub(super) entries: &'a [(usize, f64)],
    /// What the agent passes lies between these distances before that [m], which are negative.
    pub(super) own: (f64, f64),
    /// A comfortable one [m/s²].
    pub(super) deceleration: f64,
}

impl OpposingLane<'_> {
    /// Whether an oncoming vehicle goes before the agent because something stands on its lane, too.
    pub(super) fn order(&self, other: &Other, agent: &Passer) -> Priority {
        let Some((ahead, d, lanelet)) = self.place(other.pose.position) else { return Priority::None };
        let side = self.request.road.lanelets()[lanelet].center.project(agent.position).d.signum();
        let stands = other.velocity.abs() < STATIONARY_SPEED;
        // A vehicle that stands on the far side of its lane is parked.
        if is_parked(other) || stands && side * d <= -QUEUE_OFFSET {
            return Priority::Waits;
        }
        let Some((passer, end)) = self.passer(other, ahead, side * d) else { return Priority::None };
        let seconds = self.request.time_step as f64 * self.request.dt;
        if passer.passes_first(agent, seconds) {
            return Priority::First(end);
        }
        let can_stop = 0.5 * passer.velocity.powi(2) / self.deceleration < passer.gap - LEAD;
        if passer.velocity.abs() <= TRUSTED_SPEED && can_stop { Priority::Waits } else { Priority::None }
    }

    /// An oncoming vehicle `ahead` of the stretch and `moved` over [m] that has to pass something near what the agent
    /// passes, and the distance before the stretch at which that ends [m].
    fn passer(&self, other: &Other, ahead: f64, moved: f64) -> Option<(Passer, f64)> {
        if is_person(other) {
            return None;
        }
        let body = other.shape.oriented_box(other.pose);
        let gap = |block: &Other| self.gap(block, ahead, body.half_length, body.half_width);
        let gap = self.request.others.iter().filter(|block| block.row != other.row).filter_map(gap);
        let (gap, end) = gap.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((Passer { gap, moved, velocity: other.velocity, position: other.pose.position }, end))
    }

    /// From the front of a vehicle to something that stands on its lane [m], and how far before the stretch that ends
    /// [m], unless the vehicle has passed it or it is far from what the agent passes.
    fn gap(&self, block: &Other, ahead: f64, half_length: f64, half_width: f64) -> Option<(f64, f64)> {
        let stands = block.is_static || block.velocity.abs() < STATIONARY_SPEED;
        if !stands || is_person(block) {
            return None;
        }
        let body = block.shape.oriented_box(block.pose);
        let (middle, d, lanelet) = self.place(body.center)?;
        let road = self.request.road;
        let foot = road.lanelets()[lanelet].center.project(body.center).s;
        let axis = Point::from_angle(road.heading_at(lanelet, foot));
        let (cos, sin) = (axis.dot(body.axis).abs(), axis.cross(body.axis).abs());
        let half_s = body.half_length * cos + body.half_width * sin;
        let half_d = body.half_length * sin + body.half_width * cos;
        let stays = is_parked(block) || d.abs() >= QUEUE_OFFSET;
        let is_in_the_way = stays && d.abs() - half_d < half_width + BLOCKING_MARGIN;
        let is_near =
            middle - half_s < self.own.1 + OBSTRUCTION_DISTANCE && middle + half_s > self.own.0 - OBSTRUCTION_DISTANCE;
        let is_behind = middle - half_s > ahead + half_length;
        let gap = ahead - middle - half_s - half_length;
        (is_in_the_way && is_near && !is_behind).then_some((gap, middle - half_s))
    }

    /// How far a place lies before the stretch along the lane, its offset to the lane's left [m], and the lanelet.
    fn place(&self, place: Point) -> Option<(f64, f64, usize)> {
        let road = self.request.road;
        let here = road.lanelets_near(place, PASSING_OFFSET);
        let entries = self.entries.iter().filter(|(lanelet, _)| here.binary_search(lanelet).is_ok());
        let along = entries.map(|(lanelet, entry)| {
            let foot = road.lanelets()[*lanelet].center.project(place);
            (entry - foot.s, foot.d, *lanelet)
        });
        along.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// How far the middle of an oncoming vehicle has to go to a stretch of its lane [m], negative behind its beginning.
pub(super) fn distance(other: &Other, request: &PlanRequest, entries: &[(usize, f64)]) -> Option<f64> {
    let road = request.road;
    let axis = Point::from_angle(other.pose.orientation) * if other.velocity < 0.0 { -1.0 } else { 1.0 };
    let here = road.lanelets_near(other.pose.position, PASSING_OFFSET);
    let entries = entries.iter().filter(|(lanelet, _)| here.binary_search(lanelet).is_ok());
    let along = entries.filter_map(|(lanelet, entry)| {
        let foot = road.lanelets()[*lanelet].center.project(other.pose.position).s;
        let leads = Point::from_angle(road.heading_at(*lanelet, foot)).dot(axis) > LEADER_HEADING_COSINE;
        leads.then_some(entry - foot)
    });
    along.reduce(f64::min)
}

/// Its speed now, and in the mean over each of its predicted modes [m/s].
pub(super) fn speeds(other: &Other, request: &PlanRequest) -> impl Iterator<Item = f64> {
    let predictions = request.predictions;
    let (row, now) = (other.row, other.pose.position);
    let mean = move |mode: usize| {
        if predictions.probability[row * predictions.n_modes + mode] < PROBABILITY_MIN {
            return None;
        }
        let first = predictions.offset(row, mode);
        let last = (0..predictions.n_steps).rev().find(|step| predictions.valid[first + step])?;
        let place = Point::new(predictions.x[first + last], predictions.y[first + last]);
        let steps = predictions.time_step + last as i64 + 1 - request.time_step;
        (steps > 0).then(|| now.distance(place) / (steps as f64 * request.dt))
    };
    std::iter::once(other.velocity.abs()).chain((0..predictions.n_modes).filter_map(mean))
}
