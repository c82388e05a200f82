//! Conflicts with other participants on a path: where and when they occupy it, and how hard to brake for them.
//!
//! Every participant is projected onto the path, now and at every predicted step, for every mode that is likely enough.
//! Where its box lies in the corridor of the vehicle it occupies a stretch of the path. Consecutive steps of one kind
//! make an occupancy: a participant that moves along the path or is stationary is a leader; one that crosses puts a
//! stationary virtual leader at the entry of the stretch until it has left; one that joins later is a virtual leader now,
//! moved back along the path. Whether the vehicle has to wait for an occupancy that begins later is decided once per plan.

mod path_interval;
mod yielding;

pub(super) use path_interval::Ego;

use super::car_following::PathMotion;
use super::{Other, PlanRequest};
use crate::barrier::Barriers;
use crate::geometry::shape::OrientedBox;
use path_interval::{
    OUTSIDE, PathInterval, Placed, PredictedMode, Projection, Region, foot_of, interval_of, is_box, structure,
};
use yielding::{goes_before_standing, is_joined_ahead, must_wait};

/// Modes with at least this probability count, and the most probable one.
pub(super) const MODE_PROBABILITY: f64 = 0.2;
/// Others are expected to join the path in their most probable mode, and in modes that are as likely as not: otherwise
/// drivers fall behind vehicles beside them that never come.
const JOINING_PROBABILITY: f64 = 0.5;
/// Between two looks that are nearer in time than this [s], leaders move evenly.
const INTERPOLATED: f64 = 0.5;
/// The vehicle comes after the other by this time [s].
const TIME_CLEARANCE: f64 = 0.3;
/// A vehicle whose front is further into the stretch than this cannot wait before it any more [m].
const COMMITTED: f64 = 1.0;

/// Consecutive points at which a participant occupies a stretch of the path in one way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PathOccupancy {
    /// First of its intervals among `intervals`, that of point 0.
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
    /// Deceleration of a participant that leads now [m/s²], not negative.
    braking: f64,
    /// It is expected to join: see `JOINING_PROBABILITY`.
    likely: bool,
    counts: bool,
}

/// How a vehicle gives way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deference {
    /// Kept to the vehicle ahead [m].
    pub(super) minimum_gap: f64,
    /// It waits for crossing participants.
    pub(super) counts_crossing: bool,
    /// It brakes as hard as it can for a standing vehicle that is expected to start and cross its path. A vehicle that does
    /// not, and could not stop comfortably, goes first: agents that stand wait, replayed vehicles may not.
    pub(super) brakes_for_standing: bool,
}

impl Deference {
    /// Behind all that go first, at a distance [m].
    pub(super) fn full(minimum_gap: f64) -> Self {
        Self { minimum_gap, counts_crossing: true, brakes_for_standing: false }
    }

    /// The same, but braking for standing vehicles, too: replayed ones start whoever comes.
    pub(super) fn to_standing(minimum_gap: f64) -> Self {
        Self { brakes_for_standing: true, ..Self::full(minimum_gap) }
    }
}

/// Vehicles stop this far before a stop line [m].
pub(super) const LINE_GAP: f64 = 0.5;

/// All conflicts of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Conflicts {
    intervals: Vec<PathInterval>,
    occupancies: Vec<PathOccupancy>,
    n_points: usize,
    dt: f64,
    barriers: Barriers,
    /// Where participants are beside the path, shape (others, modes, points), as far as the present plan has looked.
    placed: Vec<Placed>,
    plan: u64,
    /// Where the path of the plan lies.
    region: Region,
    /// What the plan found on the way before.
    before: (Vec<PathInterval>, Vec<PathOccupancy>),
}

impl Conflicts {
    /// Projects all participants of the request onto the path, beside its barriers. Claims that begin later do not count
    /// until `decide`.
    pub(super) fn collect(&mut self, request: &PlanRequest, ego: &Ego, n_points: usize, barriers: Barriers) {
        self.plan += 1;
        self.region = Region::of_path(ego);
        let n_places = request.others.len() * request.predictions.n_modes * n_points;
        if self.placed.len() < n_places {
            self.placed.resize(n_places, Placed::NEVER);
        }
        self.collect_again(request, ego, n_points, barriers);
    }

    /// The same for the same request and another target.
    pub(super) fn collect_again(&mut self, request: &PlanRequest, ego: &Ego, n_points: usize, barriers: Barriers) {
        std::mem::swap(&mut self.intervals, &mut self.before.0);
        std::mem::swap(&mut self.occupancies, &mut self.before.1);
        self.intervals.clear();
        self.occupancies.clear();
        (self.n_points, self.dt) = (n_points, request.dt);
        self.barriers = barriers;
        let region = self.region.around(ego);
        let mut placed = std::mem::take(&mut self.placed);
        let n_places = request.predictions.n_modes * n_points;
        for (index, other) in request.others.iter().enumerate() {
            if other.is_static {
                self.add_static(request, index, other, ego, &region);
            } else {
                self.add_moving(request, (index, other), ego, &region, &mut placed[index * n_places..][..n_places]);
            }
        }
        self.placed = placed;
    }

    /// The same occupancies as on the way before, whatever counts.
    pub(super) fn is_as_before(&self) -> bool {
        let (intervals, occupancies) = &self.before;
        let pairs = || self.occupancies.iter().zip(occupancies);
        self.occupancies.len() == occupancies.len()
            && pairs().all(|(own, before)| own.is_like(before))
            && pairs().all(|(own, before)| own.intervals(&self.intervals) == before.intervals(intervals))
    }

    fn add_static(&mut self, request: &PlanRequest, index: usize, other: &Other, ego: &Ego, region: &Region) {
        if !other.shape.aabb(other.pose).overlaps(&region.aabb) {
            return;
        }
        let interval = if is_box(other.shape) {
            let body = other.shape.oriented_box(other.pose);
            let foot = foot_of(ego, region, body.center, None);
            foot.and_then(|foot| interval_of(ego, &body, &foot, 0.0, 0.0)).filter(|interval| interval.inside)
        } else {
            structure(request, other, ego)
        };
        let Some(interval) = interval.filter(|interval| 0.5 * (interval.low + interval.high) > ego.s + ego.middle())
        else {
            return;
        };
        let row = self.intervals.len();
        self.intervals.resize(row + self.n_points, PathInterval { velocity: 0.0, along: true, ..interval });
        self.push_occupancies(ego, row, (index, other), (0, true));
    }

    fn add_moving(
        &mut self,
        request: &PlanRequest,
        (index, other): (usize, &Other),
        ego: &Ego,
        region: &Region,
        placed: &mut [Placed],
    ) {
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
            let predicted = PredictedMode { request, other, ego, region, start, n_known, dt: self.dt, plan: self.plan };
            let placed = &mut placed[mode * self.n_points..][..self.n_points];
            let now = *now.get_or_insert_with(|| predicted.at(0, None, placed));
            if now.interval.is_some_and(|interval| is_follower(ego, &interval)) {
                return;
            }
            let (row, last) = (self.intervals.len(), self.n_points - 1);
            let end = predicted.at(last, now.foot, placed);
            if last > 1 && now.stays_away(&end, last as f64 * self.dt, &predicted.region) {
                continue;
            }
            self.intervals.resize(row + self.n_points, OUTSIDE);
            self.put(row, &now);
            self.put(row + last, &end);
            self.fill(&predicted, row, (0, &now), (last, &end), placed);
            if self.intervals[row..].iter().any(|interval| interval.inside) {
                let likely = *probability >= JOINING_PROBABILITY || *probability >= largest;
                self.push_occupancies(ego, row, (index, other), (mode, likely));
            } else {
                self.intervals.truncate(row);
            }
        }
    }

    fn put(&mut self, at: usize, projection: &Projection) {
        self.intervals[at] = projection.interval.unwrap_or(OUTSIDE);
    }

    /// The points between two, by bisection until the participant stays away from the corridor in between.
    fn fill(
        &mut self,
        predicted: &PredictedMode,
        row: usize,
        (a, before): (usize, &Projection),
        (b, after): (usize, &Projection),
        placed: &mut [Placed],
    ) {
        if b - a < 2 || before.stays_away(after, (b - a) as f64 * self.dt, &predicted.region) {
            return;
        }
        if let (Some(from), Some(to)) = (&before.interval, &after.interval)
            && from.leads()
            && to.leads()
            && (b - a) as f64 * self.dt < INTERPOLATED
        {
            for point in a + 1..b {
                self.intervals[row + point] = from.towards(to, (point - a) as f64 / (b - a) as f64);
            }
            return;
        }
        let middle = usize::midpoint(a, b);
        let projection = predicted.at(middle, before.foot, placed);
        self.put(row + middle, &projection);
        self.fill(predicted, row, (a, before), (middle, &projection), placed);
        self.fill(predicted, row, (middle, &projection), (b, after), placed);
    }

    /// Splits the intervals from `row` on into occupancies.
    fn push_occupancies(
        &mut self,
        ego: &Ego,
        row: usize,
        (index, other): (usize, &Other),
        (mode, likely): (usize, bool),
    ) {
        let intervals = &self.intervals[row..row + self.n_points];
        let mut at = 0;
        while at < intervals.len() {
            let first = at;
            let PathInterval { inside, along, .. } = intervals[first];
            while at < intervals.len() && intervals[at].inside == inside && (!inside || intervals[at].along == along) {
                at += 1;
            }
            if !inside {
                continue;
            }
            let last = at - 1;
            let (front, middle) = (ego.s + ego.to_front, 0.5 * (intervals[first].low + intervals[first].high));
            // What lies beside or behind the vehicle's front cannot be waited for.
            let lows = intervals[first..=last].iter().map(|interval| interval.low);
            let entry = lows.filter(|low| *low >= front - COMMITTED).fold(f64::INFINITY, f64::min);
            let is_passed = if along { first == 0 && middle <= front } else { entry.is_infinite() };
            if is_passed {
                continue;
            }
            let stays = last + 1 == intervals.len();
            self.occupancies.push(PathOccupancy {
                row,
                first,
                last,
                along,
                stays,
                entry,
                other: index,
                mode,
                braking: other.braking,
                likely,
                counts: first == 0,
            });
        }
    }

    /// Decides for which later occupancies the vehicle waits, from the motion that it would have without them.
    pub(super) fn decide(&mut self, request: &PlanRequest, ego: &Ego, deference: Deference, free: &[PathMotion]) {
        for occupancy in &mut self.occupancies {
            if occupancy.first > 0 {
                let intervals = &self.intervals[occupancy.row..occupancy.row + self.n_points];
                occupancy.counts = if occupancy.along {
                    occupancy.likely && is_joined_ahead(ego, occupancy, intervals, free, self.dt)
                } else {
                    (deference.brakes_for_standing || !goes_before_standing(request, ego, occupancy))
                        && must_wait(request, ego, occupancy, intervals, free, self.dt)
                };
            }
        }
    }

    /// The vehicle waits for all occupancies that begin later, except vehicles that join behind it.
    pub(super) fn yield_to_all(&mut self, ego: &Ego) {
        for occupancy in &mut self.occupancies {
            let interval = &self.intervals[occupancy.row + occupancy.first];
            let is_ahead = 0.5 * (interval.low + interval.high) > ego.s + ego.middle();
            occupancy.counts = occupancy.first == 0 || !occupancy.along || is_ahead;
        }
    }

    /// Something crosses the path, or begins to occupy it later.
    pub(super) fn has_later(&self) -> bool {
        self.occupancies.iter().any(PathOccupancy::is_crossing)
    }

    /// With its rear axle at an arc length at the end [m] and a speed [m/s] the vehicle has left all stretches that others
    /// cross, or can stop before them.
    pub(super) fn is_clear(&self, ego: &Ego, s: f64, velocity: f64, deceleration: f64) -> bool {
        self.occupancies.iter().filter(|occupancy| occupancy.is_crossing()).all(|occupancy| {
            let intervals = &self.intervals[occupancy.row + occupancy.first..=occupancy.row + occupancy.last];
            let exit = intervals.iter().map(|interval| interval.high).fold(f64::NEG_INFINITY, f64::max);
            s + ego.to_rear > exit || s + ego.to_front + 0.5 * velocity * velocity / deceleration < occupancy.entry
        })
    }

    /// Drops standing participants that the footprint, grown by a margin [m], does not touch on the way to the target.
    pub(super) fn spare_untouched(&mut self, request: &PlanRequest, ego: &Ego, margin: f64) {
        /// Distance of the places on the path at which footprints are compared [m].
        const STEP: f64 = 0.5;
        let Self { occupancies, intervals, .. } = self;
        occupancies.retain(|occupancy| {
            let first = &intervals[occupancy.row + occupancy.first];
            let last = &intervals[occupancy.row + occupancy.last];
            let stays = (first.low - last.low).abs() < 0.1;
            let stands = occupancy.along && first.velocity == 0.0 && last.velocity == 0.0 && stays;
            let other = &request.others[occupancy.other];
            if !stands || other.shape.parts().len() > 1 || occupancy.first > 0 {
                return true;
            }
            let body = other.shape.oriented_box(other.pose).grown(margin);
            let vehicle = request.vehicle;
            let from = (first.low - ego.to_front).max(ego.s);
            let n = ((first.high - ego.to_rear - from) / STEP).ceil().max(0.0) as usize;
            (0..=n).any(|i| {
                let at = ego.path.at(from + i as f64 * STEP);
                let axis = at.tangent();
                let center = at.position + axis.left() * ego.target + axis * vehicle.rear_axle_to_center;
                let (half_length, half_width) = (0.5 * vehicle.length, 0.5 * vehicle.width);
                OrientedBox { center, axis, half_length, half_width }.overlaps(&body)
            })
        });
    }

    /// Smallest acceleration that the barriers and occupancies allow at a point of the plan [m/s²], for a vehicle at an arc
    /// length [m] with a speed [m/s]; infinite without any. `follow` gives the acceleration for a gap [m] behind a leader of
    /// a speed [m/s] that brakes [m/s²].
    pub(super) fn allowed(
        &self,
        point: usize,
        ego: &Ego,
        (s, velocity): (f64, f64),
        Deference { minimum_gap, counts_crossing, .. }: Deference,
        follow: impl Fn(f64, f64, f64) -> f64,
    ) -> f64 {
        let front = s + ego.to_front;
        let mut least = f64::INFINITY;
        for barrier in self.barriers.iter() {
            let left = barrier.until - point as f64 * self.dt;
            if left <= 0.0 {
                continue;
            }
            let room = barrier.s - LINE_GAP - front;
            let waits = follow(room + minimum_gap, 0.0, 0.0);
            let arrives = if left.is_finite() { not_before(room, velocity, left) } else { f64::NEG_INFINITY };
            least = least.min(waits.max(arrives));
        }
        for occupancy in self.occupancies.iter().filter(|occupancy| occupancy.counts && point <= occupancy.last) {
            if !counts_crossing && occupancy.is_crossing() {
                continue;
            }
            let interval = |at: usize| &self.intervals[occupancy.row + at];
            let acceleration = if !occupancy.along {
                if occupancy.entry < front - COMMITTED {
                    continue;
                }
                let stop = follow(occupancy.entry - front, 0.0, 0.0);
                if occupancy.stays {
                    stop
                } else {
                    let time = (occupancy.last + 1 - point) as f64 * self.dt + TIME_CLEARANCE;
                    stop.max(not_before(occupancy.entry - front - 0.5 * minimum_gap, velocity, time))
                }
            } else if point >= occupancy.first {
                let interval = interval(point);
                if 0.5 * (interval.low + interval.high) <= front {
                    continue;
                }
                follow(interval.low - front, interval.velocity, occupancy.braking)
            } else {
                let joined = interval(occupancy.first);
                let time = (occupancy.first - point) as f64 * self.dt;
                let moved_back = joined.low - joined.velocity * time;
                let keep = follow(moved_back - front, joined.velocity, 0.0);
                let room = joined.low - front - minimum_gap;
                // Slower than the other, too: beside a faster vehicle it would otherwise not brake at all.
                keep.max(not_before(room, velocity, time))
            };
            least = least.min(acceleration);
        }
        least
    }
}

impl PathOccupancy {
    /// It crosses the path, or begins to occupy it later.
    fn is_crossing(&self) -> bool {
        self.first > 0 || !self.along
    }

    /// Equal to another one but for its place among the intervals, and for whether it counts.
    fn is_like(&self, other: &Self) -> bool {
        *self == Self { row: self.row, counts: self.counts, ..*other }
    }

    fn intervals<'a>(&self, all: &'a [PathInterval]) -> &'a [PathInterval] {
        &all[self.row + self.first..=self.row + self.last]
    }
}

/// Constant acceleration with which a distance is not used up before a time is over [m/s²]; infinite if it is not anyway.
fn not_before(distance: f64, velocity: f64, time: f64) -> f64 {
    if velocity * time <= distance {
        return f64::INFINITY;
    }
    if distance <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let constant = 2.0 * (distance - velocity * time) / (time * time);
    // It would drive backwards at the end: it brakes to rest within the distance.
    if velocity + constant * time >= 0.0 { constant } else { -velocity * velocity / (2.0 * distance) }
}

/// A participant behind the vehicle in its corridor with the same heading keeps the distance itself.
fn is_follower(ego: &Ego, interval: &PathInterval) -> bool {
    interval.inside && interval.along && 0.5 * (interval.low + interval.high) <= ego.s + ego.middle()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::car_following::integrate;
    use crate::plan::prediction_index::PredictionIndex;
    use crate::plan::testing::{Car, Drive};
    use crate::trajectory::Predictions;

    /// What a vehicle with 20 m/s may accelerate at most now [m/s²] beside a vehicle with 12 m/s, 12 m ahead in the next
    /// lane, that joins its lane in 2 s with a probability and stays where it is otherwise.
    fn allowed_beside(probability: f64) -> f64 {
        let beside = Car::at(42.0, 3.5, 0.0, 12.0);
        let drive = Drive::on_three_lanes(30.0, 20.0).with_cars(vec![beside]);
        drive.with_request(|request| {
            let known = request.predictions;
            let mut two = Predictions::empty(known.time_step, known.ids.clone(), 2, known.n_steps);
            (two.probability[0], two.probability[1]) = (1.0 - probability, probability);
            for mode in 0..2 {
                for k in 0..known.n_steps {
                    let to = two.offset(0, mode) + k;
                    let joined = mode as f64 * (0.05 * (k + 1) as f64).min(1.0);
                    (two.x[to], two.y[to], two.valid[to]) = (known.x[k], known.y[k] - 3.5 * joined, true);
                    (two.orientation[to], two.velocity[to]) = (known.orientation[k], known.velocity[k]);
                }
            }
            let prediction_index = PredictionIndex::of(&two, &drive.positions());
            let request = &PlanRequest { predictions: &two, prediction_index: &prediction_index, ..*request };
            let ego = Ego::new(request, &request.route.path, (30.0, 20.0, 0.0), 2.5);
            let (mut conflicts, mut free) = (Conflicts::default(), Vec::new());
            let n_points = two.n_steps + 1;
            conflicts.collect(request, &ego, n_points, Barriers::NONE);
            integrate((30.0, 20.0), n_points, request.dt, &mut free, |_, _, _| 0.0);
            conflicts.decide(request, &ego, Deference::full(2.0), &free);
            let follow = |room: f64, leader: f64, _: f64| (leader - 20.0) / room;
            conflicts.allowed(0, &ego, (30.0, 20.0), Deference::full(2.0), follow)
        })
    }

    #[test]
    fn a_vehicle_falls_behind_who_joins_ahead_of_it_where_that_is_as_likely_as_not() {
        assert_eq!(allowed_beside(0.4), f64::INFINITY);
        assert!(allowed_beside(0.6) < -0.5, "{} m/s²", allowed_beside(0.6));
    }

    /// A leader, a vehicle that crosses, and one in the next lane.
    fn among_three(s: f64) -> Drive {
        let crossing = Car::at(s + 50.0, -25.0, std::f64::consts::FRAC_PI_2, 9.0);
        let cars = vec![Car::at(s + 40.0, 0.4, 0.02, 15.0), crossing, Car::at(s + 15.0, 3.5, 0.0, 12.0)];
        Drive::on_three_lanes(s, 20.0).with_cars(cars)
    }

    fn collected(conflicts: &Conflicts) -> String {
        let Conflicts { intervals, occupancies, .. } = conflicts;
        format!("{intervals:?} {occupancies:?}")
    }

    #[test]
    fn a_plan_finds_on_each_way_what_it_would_find_there_first() {
        let mut used = Conflicts::default();
        // The plans before looked from elsewhere, and from here while others were elsewhere.
        for (s, from) in [(10.0, 10.0), (33.0, 30.0), (30.0, 30.0)] {
            among_three(s).with_request(|request| {
                let ego = |target: f64| {
                    let ego = Ego::new(request, &request.route.path, (from, 20.0, 0.0), 2.5);
                    Ego { target, ..ego }
                };
                let n_points = request.predictions.n_steps + 1;
                let first = |target: f64| {
                    let mut conflicts = Conflicts::default();
                    conflicts.collect(request, &ego(target), n_points, Barriers::NONE);
                    conflicts
                };
                used.collect(request, &ego(0.0), n_points, Barriers::NONE);
                assert_eq!(collected(&used), collected(&first(0.0)));
                for (target, is_as_before) in [(0.1, true), (3.5, false), (3.5, true), (-3.5, false), (0.0, false)] {
                    used.yield_to_all(&ego(target));
                    used.collect_again(request, &ego(target), n_points, Barriers::NONE);
                    assert_eq!(collected(&used), collected(&first(target)), "{target} m aside, from {s} m");
                    assert_eq!(used.is_as_before(), is_as_before, "{target} m aside, from {s} m");
                }
            });
        }
    }

    #[test]
    fn waiting_takes_no_more_braking_than_is_necessary() {
        for (distance, velocity, time, predicted) in [
            // It would arrive after 2 s anyway.
            (20.0, 10.0, 2.0, f64::INFINITY),
            // 10 * 3 - 0.5 * 2.222 * 9 = 20
            (20.0, 10.0, 3.0, -20.0 / 9.0),
            // Longer than it takes to stop: brake to rest, 10² / (2 * 20).
            (20.0, 10.0, 10.0, -2.5),
            (-1.0, 10.0, 1.0, f64::NEG_INFINITY),
        ] {
            let found = not_before(distance, velocity, time);
            assert!(found == predicted || (found - predicted).abs() < 1e-9, "{found} for {predicted}");
        }
    }
}
