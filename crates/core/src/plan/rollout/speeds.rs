//! Speeds along a path: Gipps' safe speed behind leaders and before barriers, below a profile of curves, limits and what the
//! steering can follow.

use super::super::arrival;
use super::super::car_following::{PathMotion, safe_velocity};
use super::super::comfort::Comfort;
use super::super::conflicts::{Conflicts, Deference, Ego};
use super::super::speed_profile::SpeedProfile;
use super::super::{Other, PlanRequest};
use super::settings::RolloutWeights;
use super::start::Start;
use crate::conduct::{EXPECTED_DECELERATION, FIRM_DECELERATION, FOLLOWER_COSINE, STATIONARY_SPEED};
use crate::geometry::Point;

/// A desired speed is reached with this time constant [s].
const LAG: f64 = 0.7;
/// Towards a lower desired speed an agent brakes with at most this multiple of the comfortable deceleration.
const BRAKING_SHARE: f64 = 1.3;
/// A vehicle that is faster than it wishes by this and the comfortable deceleration in a second brakes harder [m/s].
const EXCESS: f64 = 1.0;
/// The jerk of braking that is harder than this is not limited [m/s²]: barriers are told as long as the braking that
/// is expected suffices.
const NEEDED_BRAKING: f64 = 2.5;
const _: () = assert!(NEEDED_BRAKING < EXPECTED_DECELERATION);
/// An agent whose centre exceeds the speed limit by more than this [m/s] brakes at once, with at least this [m/s²]. The
/// monitor counts it as speeding otherwise.
const SPEEDING: (f64, f64) = (0.5, 1.2);
/// `Comfort::jerk_low` counts up to the first of these speeds, `Comfort::jerk` from the second on [m/s].
const JERK_SPEEDS: (f64, f64) = (3.0, 9.0);
/// Who is much too fast brakes towards the desired speed with at most `BRAKING_SHARE` times this, 3 m/s² [m/s²].
const SLOWING: f64 = 2.3;
/// An agent that needs more than this share of the comfortable deceleration brakes with what it needs.
const NEEDED_SHARE: f64 = 0.6;
/// Curves and limits are looked at so far ahead [s].
const PREVIEW: f64 = 0.65;
/// Lateral acceleration that firm braking keeps to in bends, unless more is comfortable [m/s²].
const FIRM_LATERAL: f64 = 4.0;
/// Share of the vehicle's steering rate at which bends are entered.
const STEERING_SHARE: f64 = 0.8;
/// Deceleration with which a gap is opened that is smaller than comfortable [m/s²].
const OPENING: f64 = 0.7;
/// A vehicle follows if it is within this distance [m], heads along and drives at this share of the agent's speed at least:
/// slower ones, such as bicycles, stay behind.
const FOLLOWER_REACH: f64 = 50.0;
const FOLLOWER_SHARE: f64 = 0.7;
/// As its time gap falls from the second to the first [s], the agent opens the gap ahead no further: where vehicles further
/// behind counted, dense rows of agents that stopped braked as in emergencies.
const FOLLOWER_TIME_GAP: (f64, f64) = (0.25, 0.5);
/// A leader that is seen to brake with less than the first of these may as well not [m/s²], as recorded speeds are noisy; from
/// the second on it is believed.
const BRAKING: (f64, f64) = (1.5, 2.5);
/// An agent that closes in keeps at least this share of the gap to a standing leader, and some room [m].
const CLOSEST: f64 = 0.5;
const ROOM_MIN: f64 = 0.1;
/// An agent aims this far inside the goal's interval of speeds, as it reaches its desired speed late [m/s].
const SPEED_RESERVE: f64 = 0.7;
/// More than any rounding of a speed [m/s].
const ROUNDING: f64 = 1e-9;
/// Deceleration with which a vehicle that rolls backwards comes to a stop [m/s²].
const ROLLING_BRAKING: f64 = 3.0;
/// Walking pace [m/s].
pub(super) const WALKING_SPEED: f64 = 1.5;
/// How far ahead curves and limits count [m], and for how long [s].
const REACH: (f64, f64) = (20.0, 6.0);

/// How a proposal chooses its speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pace {
    /// As fast as the road allows, behind those that go first.
    Social,
    /// Behind leaders only, if it has crossed the ways of others at its end.
    Bold,
    /// At half of the speed, behind all that cross or join.
    Half,
    /// At walking pace, behind all that cross or join.
    Walking,
    /// Stops comfortably.
    Stopping,
    /// Stops quickly.
    Braking,
    /// Stops with a share of the vehicle's largest deceleration.
    Emergency(f64),
    /// Drives back.
    Reversing,
}

impl Pace {
    /// At least what [`Speeds::terms`] are of speeds at this pace: those of a vehicle that brakes as late as the jerk lets it,
    /// and then as hard as this pace does.
    pub(super) fn least_terms(self, task: &Task, free: &Speeds) -> [f64; 4] {
        let Task { request, comfort, start, n_points, .. } = task;
        let Some(braking) = self.stopping(comfort) else { return [0.0; 4] };
        let braking = braking.min(request.vehicle.acceleration_max);
        let mut velocity = start.velocity + start.rolling;
        if velocity < 0.0 {
            return [0.0; 4];
        }
        let jerk = comfort.jerk.min(comfort.jerk_low);
        let (mut acceleration, mut lost) = (task.acceleration(), 0.0);
        for point in 0..*n_points {
            lost += (free.velocity[point] - velocity).max(0.0);
            if point + 1 < *n_points {
                acceleration = (acceleration - jerk * request.dt).max(-braking);
                velocity = (velocity + acceleration * request.dt).max(0.0);
            }
        }
        [lost * request.dt, (free.velocity[n_points - 1] - velocity).max(0.0), 0.0, 0.0]
    }

    /// Deceleration of a pace that stops, however free the road is [m/s²].
    fn stopping(self, comfort: &Comfort) -> Option<f64> {
        match self {
            Self::Stopping => Some(comfort.deceleration),
            Self::Braking => Some(2.0 * comfort.deceleration),
            _ => None,
        }
    }

    /// Name, for people.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Social => "social",
            Self::Bold => "bold",
            Self::Half => "slower",
            Self::Walking => "walking",
            Self::Stopping => "stopping",
            Self::Braking => "braking",
            Self::Emergency(_) => "emergency",
            Self::Reversing => "reversing",
        }
    }
}

/// Speed and acceleration at every point.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Speeds {
    pub(super) velocity: Vec<f64>,
    /// Constant up to the next point.
    pub(super) acceleration: Vec<f64>,
    /// Arc length at the end [m].
    pub(super) s: f64,
}

/// What every proposal of a plan shares.
#[derive(Debug, Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) request: &'a PlanRequest<'a>,
    pub(super) comfort: &'a Comfort,
    pub(super) start: Start,
    pub(super) n_points: usize,
    /// Desired speed on a free and straight road [m/s].
    pub(super) wish: f64,
    /// The vehicle that follows, if there is one.
    follower: Option<Follower>,
}

/// A vehicle behind the agent that drives as it does.
#[derive(Debug, Clone, Copy)]
struct Follower {
    /// Room up to the agent [m].
    room: f64,
    /// Speed [m/s].
    velocity: f64,
}

impl Follower {
    fn of(request: &PlanRequest, s: f64) -> Option<Self> {
        let (pose, path) = (request.state.pose(), &request.route.path);
        let axis = Point::from_angle(pose.orientation);
        let behind = |other: &Other| {
            let body = other.shape.oriented_box(other.pose);
            let offset = body.center - pose.position;
            let room = -axis.dot(offset) - body.half_length - 0.5 * request.vehicle.length;
            let is_near = (0.0..FOLLOWER_REACH).contains(&room) && body.axis.dot(axis) > FOLLOWER_COSINE;
            let slowest = (FOLLOWER_SHARE * request.state.velocity).max(STATIONARY_SPEED);
            if !is_near || other.velocity < slowest {
                return None;
            }
            // In its own lane, or in the lane that it changes to.
            let beside = 0.5 * request.vehicle.width + body.half_width;
            let way = offset.norm();
            let is_on_path = || path.project_near(body.center, s - way, way).is_some_and(|(_, d)| d.abs() < beside);
            let follows = axis.cross(offset).abs() < beside || is_on_path();
            follows.then_some(Self { room, velocity: other.velocity })
        };
        request.others.iter().filter_map(behind).min_by(|a, b| a.room.total_cmp(&b.room))
    }
}

impl<'a> Task<'a> {
    pub(super) fn new(request: &'a PlanRequest<'a>, comfort: &'a Comfort, start: Start, n_points: usize) -> Self {
        let at = (start.s, start.velocity);
        let (velocity, _) =
            arrival::desired(request, at, comfort.deceleration, comfort.cruise_velocity_min, Some(SPEED_RESERVE));
        let wish = request.lane_change.velocity.unwrap_or(velocity).min(request.vehicle.velocity_max).max(0.0);
        Self { request, comfort, start, n_points, wish, follower: Follower::of(request, start.s) }
    }

    /// How far a gap [m] may be opened that is smaller than comfortable, from 0 to 1, at a point and an arc length [m]: not
    /// at all for a vehicle behind that is nearer than the leader and would hit the agent if it did not react.
    fn opening(&self, (point, s): (usize, f64), room: f64) -> f64 {
        let Some(Follower { room: behind, velocity }) = self.follower else { return 1.0 };
        let behind = behind + s - self.start.s - velocity * point as f64 * self.request.dt;
        let (least, most) = FOLLOWER_TIME_GAP;
        let time_gap = (behind / velocity - least) / (most - least);
        ((behind - room) / room.max(ROOM_MIN)).max(time_gap).clamp(0.0, 1.0)
    }

    /// The present acceleration from which comfortable motions go on [m/s²]: harder braking than is comfortable may end at
    /// once.
    pub(super) fn acceleration(&self) -> f64 {
        self.request.state.acceleration.clamp(-self.comfort.deceleration, self.comfort.acceleration)
    }
}

/// How fast the road may be driven.
#[derive(Debug, Clone, Default)]
pub(super) struct RoadSpeeds {
    /// Limits, and bends at comfortable speeds.
    comfortable: SpeedProfile,
    /// Bends at the highest accepted speed, with firm braking before them; filled only for agents that are too fast.
    firm: SpeedProfile,
    is_too_fast: bool,
}

impl RoadSpeeds {
    /// Those of a free road.
    pub(super) fn fill(&mut self, task: &Task) {
        let Task { request, comfort, start, .. } = task;
        let (path, vehicle) = (&request.route.path, request.vehicle);
        let curvature = |s: f64| request.line_curvature_at(s);
        let way = (start.s, REACH.0 + REACH.1 * start.velocity);
        let bend = |lateral: f64, s: f64| {
            let cornering = vehicle.cornering(lateral) / curvature(s).abs().max(1e-9);
            if s > path.length() { f64::INFINITY } else { cornering.sqrt() }
        };
        // Limits count at the vehicle's centre.
        let limits = &request.rules.way.limits;
        let limit = |s: f64| bend(comfort.lateral_acceleration, s).min(limits.at(s + vehicle.rear_axle_to_center));
        let Self { comfortable, firm, .. } = self;
        comfortable.fill_below(path, limit, way, f64::INFINITY, comfort.deceleration);
        let steering = (STEERING_SHARE * vehicle.steering_rate_max, vehicle.wheelbase);
        comfortable.steer(curvature, steering, comfort.deceleration);
        // Whoever is not above the comfortable profile is far below the firm one.
        self.is_too_fast = start.velocity > comfortable.at(start.s);
        if self.is_too_fast {
            let lateral = FIRM_LATERAL.max(comfort.lateral_acceleration);
            firm.fill_below(path, |s| bend(lateral, s), way, f64::INFINITY, FIRM_DECELERATION);
        }
    }

    /// Acceleration at an arc length towards a share of a desired speed, or less where the road asks for it [m/s²].
    fn towards(&self, (wish, share): (f64, f64), (s, velocity): (f64, f64), comfort: &Comfort) -> f64 {
        let wish = self.comfortable.at(s + PREVIEW * velocity).min(wish) * share;
        // Who is much too fast brakes harder.
        let hardest = comfort.deceleration.max(velocity - wish - EXCESS).min(SLOWING);
        let wanted = ((wish - velocity) / LAG).clamp(-BRAKING_SHARE * hardest, comfort.acceleration);
        if self.is_too_fast { wanted.min(self.firm.braking(s, velocity, FIRM_DECELERATION)) } else { wanted }
    }
}

impl Speeds {
    /// On a free road.
    pub(super) fn free(task: &Task, road: &RoadSpeeds) -> Self {
        integrate(task, |_, s, velocity| road.towards((task.wish, 1.0), (s, velocity), task.comfort))
    }

    /// At a pace, among others; `None` if the pace is not possible.
    pub(super) fn at(
        task: &Task,
        (pace, ego): (Pace, &Ego),
        (conflicts, road): (&mut Conflicts, &RoadSpeeds),
        free: &Self,
    ) -> Option<Self> {
        let (comfort, vehicle) = (task.comfort, task.request.vehicle);
        let gap = comfort.standstill_gap;
        let counts_crossing = pace != Pace::Bold;
        let deference = Deference { counts_crossing, ..Deference::to_standing(gap) };
        match pace {
            Pace::Reversing => return None,
            Pace::Emergency(share) => return Some(integrate(task, |_, _, _| -share * vehicle.acceleration_max)),
            Pace::Social | Pace::Bold => conflicts.decide(task.request, ego, deference, &free.motions(task)),
            Pace::Half | Pace::Walking | Pace::Stopping | Pace::Braking => conflicts.yield_to_all(ego),
        }
        let (share, most) = match pace {
            Pace::Half => (0.5, f64::INFINITY),
            Pace::Walking => (1.0, WALKING_SPEED),
            _ => (1.0, f64::INFINITY),
        };
        // Who stops brakes no later than the road asks for.
        let stopping = pace.stopping(comfort).map_or(f64::INFINITY, |braking| -braking);
        let found = integrate(task, |point, s, velocity| {
            let free = road.towards((task.wish.min(most), share), (s, velocity), comfort).min(stopping);
            let follow = |room: f64, leader: f64, braking: f64| {
                following((room, gap), (velocity, leader, braking), comfort, task.opening((point, s), room))
            };
            let allowed = conflicts.allowed(point, ego, (s, velocity), deference, follow);
            free.min(allowed)
        });
        let last = found.velocity[task.n_points - 1];
        (counts_crossing || conflicts.is_clear(ego, found.s, last, comfort.deceleration)).then_some(found)
    }

    /// As motions along the path.
    fn motions(&self, task: &Task) -> Vec<PathMotion> {
        let mut s = task.start.s;
        let motion = |(velocity, acceleration): (&f64, &f64)| {
            let here = PathMotion { s, velocity: *velocity, acceleration: *acceleration };
            s += velocity * task.request.dt;
            here
        };
        self.velocity.iter().zip(&self.acceleration).map(motion).collect()
    }

    /// The terms of the cost that follow from speeds alone: progress, end velocity, acceleration, jerk from
    /// the present acceleration on [m/s²].
    pub(super) fn terms(&self, free: &Self, (now, dt): (f64, f64)) -> [f64; 4] {
        let n = self.velocity.len();
        let lost: f64 = free.velocity.iter().zip(&self.velocity).map(|(free, own)| (free - own).max(0.0)).sum();
        let end = (free.velocity[n - 1] - self.velocity[n - 1]).max(0.0);
        let acceleration: f64 = self.acceleration.iter().map(|a| a * a).sum();
        let before = std::iter::once(&now).chain(&self.acceleration);
        let jerk: f64 = before.zip(&self.acceleration).map(|(a, b)| ((b - a) / dt).powi(2)).sum();
        [lost * dt, end, acceleration * dt, jerk * dt]
    }

    /// What these terms cost.
    pub(super) fn cost(terms: [f64; 4], weights: &RolloutWeights) -> f64 {
        weights.as_array().iter().zip(terms).map(|(weight, term)| weight * term).sum()
    }
}

/// Acceleration towards the safe speed behind a leader [m/s²] for the room up to it and the part of it that is kept [m]. An
/// agent that is too near but hardly closes in opens the gap gently instead: so traffic that is denser than comfortable
/// does not come to a stop (the constant-acceleration heuristic of Treiber, Kesting, "Traffic Flow Dynamics", 2013, 11.4).
fn following(
    (room, gap): (f64, f64),
    (velocity, leader, braking): (f64, f64, f64),
    comfort: &Comfort,
    opening: f64,
) -> f64 {
    let safe = safe_velocity(room - gap, leader, (comfort.time_gap, comfort.deceleration));
    let closing = (velocity - leader).max(0.0);
    // A leader that brakes comes to rest at the end of its own way.
    let believed = ((braking - BRAKING.0) / (BRAKING.1 - BRAKING.0)).clamp(0.0, 1.0);
    let (rest, believed) = match (leader > 0.0, believed > 0.0) {
        (false, _) => (Some(room), 1.0),
        (true, true) => (Some(room + 0.5 * leader * leader / braking), believed),
        (true, false) => (None, 0.0),
    };
    // Before what comes to rest as much of the gap is kept as comfortable braking leaves.
    let comfortable = 0.5 * velocity * velocity / (BRAKING_SHARE * comfort.deceleration);
    let kept = rest.map_or(CLOSEST * gap, |rest| (rest - comfortable).clamp(CLOSEST * gap, gap));
    let needed = |room: f64, closing: f64| 0.5 * closing * closing / (room - kept).max(ROOM_MIN);
    let moving = needed(room, closing);
    let stopping = rest.map_or(0.0, |rest| believed * needed(rest, velocity));
    let needed = moving.max(stopping);
    let wanted = ((safe - velocity) / comfort.time_gap).max(-needed - opening * OPENING);
    // Where the gap may not be opened, it is at least kept.
    let keeping = ((leader - velocity) / LAG - wanted).max(0.0);
    let wanted = if leader > velocity { wanted + (1.0 - opening) * keeping } else { wanted };
    // Towards the end the safe speed is approached with a lag, which would lead beyond what stands.
    let hard = if leader == 0.0 { NEEDED_SHARE * comfort.deceleration } else { comfort.deceleration };
    if (leader == 0.0 || needed == stopping) && needed > hard { wanted.min(-needed) } else { wanted }
}

/// Largest comfortable jerk at a speed [m/s³].
fn jerk(velocity: f64, comfort: &Comfort) -> f64 {
    let fast = ((velocity - JERK_SPEEDS.0) / (JERK_SPEEDS.1 - JERK_SPEEDS.0)).clamp(0.0, 1.0);
    comfort.jerk_low + fast * (comfort.jerk - comfort.jerk_low)
}

/// Constant acceleration between points, within the vehicle's limits and those of jerk.
fn integrate(task: &Task, mut law: impl FnMut(usize, f64, f64) -> f64) -> Speeds {
    let Task { request, comfort, start, n_points, .. } = *task;
    let (vehicle, dt, limits) = (request.vehicle, request.dt, &request.rules.way.limits);
    let (mut s, mut velocity) = (start.s, start.velocity + start.rolling);
    let mut before = task.acceleration();
    let (mut velocities, mut accelerations) = (Vec::with_capacity(n_points), Vec::with_capacity(n_points));
    for point in 0..n_points {
        if velocity < 0.0 {
            let acceleration = ROLLING_BRAKING.min(vehicle.acceleration_max).min(-velocity / dt);
            velocities.push(velocity);
            accelerations.push(acceleration);
            s += (velocity + 0.5 * acceleration * dt) * dt;
            velocity = if velocity + acceleration * dt > -ROUNDING { 0.0 } else { velocity + acceleration * dt };
            before = 0.0;
            continue;
        }
        let is_speeding = velocity > limits.at(s + vehicle.rear_axle_to_center) + SPEEDING.0;
        let wanted = law(point, s, velocity).min(if is_speeding { -SPEEDING.1 } else { f64::INFINITY });
        let jerk = jerk(velocity, comfort);
        let lowest = if is_speeding || wanted < -NEEDED_BRAKING { f64::NEG_INFINITY } else { before - jerk * dt };
        let highest = before.max(-comfort.deceleration) + jerk * dt;
        let wanted = wanted.clamp(lowest, highest.max(lowest));
        let wanted = wanted.clamp(-vehicle.acceleration_max, vehicle.forward_acceleration_max(velocity));
        let acceleration = wanted.max(-velocity / dt);
        velocities.push(velocity);
        accelerations.push(acceleration);
        s += (velocity + 0.5 * acceleration * dt) * dt;
        velocity += acceleration * dt;
        if velocity < ROUNDING {
            velocity = 0.0;
        }
        before = acceleration;
    }
    Speeds { velocity: velocities, acceleration: accelerations, s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_follower_brakes_as_hard_as_it_takes_to_stop_behind_a_leader_that_brakes() {
        // Comfort: 0.85 s, 2 m, 2 m/s². Gipps' safe speed is sqrt(1.7² + v_leader² + 4 (room - 2)) - 1.7.
        for (room, velocity, leader, braking, expected) in [
            // It brakes too little to count: the gap is opened with 0.7 m/s².
            (9.0, 15.0, 15.0, 1.5, -0.7),
            // It stands after 15²/16 = 14.1 m; half of the 2 m is kept: 15² / (2 (9 + 14.1 - 1)).
            (9.0, 15.0, 15.0, 8.0, -5.099_150),
            // It stands, and comfortable braking leaves the whole gap: the safe speed decides, (4.207 - 4) / 0.85.
            (10.0, 4.0, 0.0, 0.0, 0.243_266),
            // With 2.6 m/s², 4.9 - 4.5²/5.2 = 1.006 m could be kept; the safe speed asks for (2.107 - 4.5) / 0.85.
            (4.9, 4.5, 0.0, 0.0, -2.815_796),
            // 3.2 - 3.8²/5.2 = 0.42 m is less than half of the gap: 3.8² / (2 (3.2 - 1)).
            (3.2, 3.8, 0.0, 0.0, -3.281_818),
        ] {
            let found = following((room, 2.0), (velocity, leader, braking), &Comfort::default(), 1.0);
            assert!((found - expected).abs() < 1e-5, "{room} m, {velocity}, {leader} m/s, {braking} m/s²: {found}");
        }
    }
}
