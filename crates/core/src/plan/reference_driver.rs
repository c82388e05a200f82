//! Driving the route's reference path as a reference driver: lawful speed, a kept distance, and the delayed braking of the
//! driver in danger. On a straight road this is the case in one dimension, `reference_drivers::cases`.

use super::car_following::{CarFollowing, PathMotion, limited};
use super::conflicts::{Conflicts, Deference, Ego};
use super::frame::Start;
use super::lawful;
use super::path_motion::RETURN_TIME;
use super::{LEADER_HEADING_COSINE, Other, PlanRequest, PlanResult, PlanningMemory, path_motion, refused};
use crate::geometry::Point;
use crate::reference_drivers::cases::REVEALED_ASIDE;
use crate::reference_drivers::{APPROACH, Driver, Encounter, Reaction, Seen};
use crate::settings::{between, positive, settings};

/// Feet of others are searched within this distance of where they are on a straight path [m].
const WINDOW: f64 = 12.0;
/// Gap to a standing vehicle that it follows [m]; the gap of 4.2 at a standstill is 0.
const STANDING_GAP: f64 = 2.0;
/// A slower leader is approached without danger as soon as that takes this deceleration [m/s²], ...
const FOLLOWING_COMFORTABLE: f64 = 1.5;
/// ... and with at most this one [m/s²].
const FOLLOWING_MAX: f64 = 3.0;
/// No vehicle brakes harder than this [m/s²].
const SAME_LEADER: f64 = 15.0;
/// Gains of the kept distance [1/s²] and of the leader's speed [1/s]: Milanés and Shladover, "Modeling cooperative and
/// autonomous adaptive cruise control dynamic responses using experimental data", Transportation Research C 48, 2014.
const GAP_GAIN: f64 = 0.23;
const SPEED_GAIN: f64 = 0.07;

settings! {
    /// What the reference drivers have in common.
    pub struct ReferenceDriving as ReferenceDriving {
        /// Upper bound of the set speed.
        desired_velocity_max: f64 ["m/s"] = f64::INFINITY, positive(f64::INFINITY);
        /// Lateral acceleration in curves, at most three quarters of the vehicle's limit.
        lateral_acceleration: f64 ["m/s²"] = 4.0, positive(100.0);
        /// Time without danger after which a reaction is over; before that the driver keeps its speed.
        calm: f64 ["s"] = 1.0, between(0.0, 60.0);
        /// Whether it keeps its distance to leaders without danger, too. Without, and with a long `calm`, it drives as in
        /// one dimension: at its set speed until it sees danger.
        keep_distance: bool = true;
    }

    /// Drives as the competent and careful human driver of UN R157, Annex 4, Appendix 3.
    ///
    /// See docs/concepts/preventability.md.
    pub struct CcSettings as Cc(driving: ReferenceDriving) {}

    /// Drives with the least reaction that UN R157, paragraph 5.2.5.2, asks of a system.
    ///
    /// See docs/concepts/preventability.md.
    pub struct R157Settings as R157(driving: ReferenceDriving) {}

    /// Drives by Responsibility-Sensitive Safety, arXiv 1708.06374.
    ///
    /// See docs/concepts/preventability.md.
    pub struct RssSettings as Rss(driving: ReferenceDriving) {}

    /// Drives by the fuzzy safety model of Mattas et al., Accident Analysis and Prevention 148, 2020, 105794.
    ///
    /// See docs/concepts/preventability.md.
    pub struct FsmSettings as Fsm(driving: ReferenceDriving) {}
}

/// What a reference driver remembers between plans.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Alertness {
    reaction: Option<Reaction>,
    /// Time without danger [s].
    calm: f64,
    /// Speed at the plan before [m/s].
    velocity: Option<f64>,
    /// Speed of the nearest leader at the plan before [m/s].
    leader_velocity: Option<f64>,
}

/// The memory of an agent: what it remembered before and after the plan of a time step, so that planning twice at the same
/// step gives the same plan.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct AlertnessLog {
    time_step: Option<i64>,
    before: Alertness,
    after: Alertness,
}

impl AlertnessLog {
    /// What it remembers when it plans at a time step.
    pub(crate) fn at(&self, time_step: i64) -> Alertness {
        if self.time_step == Some(time_step) { self.before } else { self.after }
    }

    /// Notes what it remembers after that plan.
    pub(crate) fn note(&mut self, time_step: i64, after: Alertness) {
        *self = Self { before: self.at(time_step), time_step: Some(time_step), after };
    }
}

/// Another vehicle that drives or stands along the path.
#[derive(Debug, Clone, Copy)]
struct Along {
    seen: Seen,
    /// Distance of its centre to the agent's way [m].
    aside: f64,
}

impl Along {
    /// `None` if it is not along the path, or cannot be told.
    fn of(request: &PlanRequest, ego: &Ego, other: &Other, velocity: f64, acceleration: f64) -> Option<Self> {
        if other.shape.parts().len() > 1 {
            return None;
        }
        let body = other.shape.oriented_box(other.pose);
        let here = request.state.pose().position;
        let axis = Point::from_angle(request.state.orientation);
        let expected = ego.s + (body.center - here).dot(axis);
        let (s, d) = ego
            .path
            .project_near(body.center, expected, WINDOW)
            .or_else(|| ego.path.project_near(body.center, ego.s, body.center.distance(here) + WINDOW))?;
        let tangent = ego.path.at(s).tangent();
        let heading = Point::from_angle(other.pose.orientation);
        let (cos, sin) = (tangent.dot(heading), tangent.cross(heading));
        if cos < LEADER_HEADING_COSINE || other.velocity < 0.0 {
            return None;
        }
        let (along, across) = (tangent.dot(body.axis).abs(), tangent.cross(body.axis).abs());
        let half_s = body.half_length * along + body.half_width * across;
        let half_d = body.half_length * across + body.half_width * along;
        // The way leads from the present offset back to the path.
        let (right, left) = (ego.d.min(ego.target), ego.d.max(ego.target));
        let aside = (right - d).max(d - left).max(0.0);
        let offset = s - (ego.s + 0.5 * (ego.to_front + ego.to_rear));
        let length = ego.to_front - ego.to_rear;
        let seen = Seen {
            velocity,
            acceleration,
            other_velocity: other.velocity * cos,
            gap: offset.abs() - half_s - 0.5 * length,
            side: aside - half_d - ego.half_width,
            toward: -other.velocity * sin * (d - 0.5 * (right + left)).signum(),
            is_ahead: offset >= 0.0,
            lengths: 2.0 * half_s + length,
        };
        Some(Self { seen, aside })
    }

    fn is_in_way(&self) -> bool {
        self.seen.side <= 0.0 && self.seen.is_ahead
    }
}

/// `Cc` takes a leader for a danger that brakes harder than is comfortable, from nearer than the distance it keeps.
fn brakes_ahead(driver: Driver, leader: &Seen, before: f64, dt: f64) -> bool {
    let braking = (before - leader.other_velocity) / dt;
    // The jump of another vehicle's speed is no braking.
    let is_same = braking < SAME_LEADER;
    let is_near = leader.gap <= driver.kept_distance(leader.velocity) + STANDING_GAP;
    driver == Driver::Cc
        && is_same
        && braking > FOLLOWING_COMFORTABLE
        && is_near
        && leader.other_velocity < leader.velocity
}

/// Acceleration without danger behind the nearest leader [m/s²]; infinite without one.
fn following(driver: Driver, leader: Option<&Seen>) -> f64 {
    let Some(&Seen { velocity, other_velocity, gap, .. }) = leader else { return f64::INFINITY };
    let kept = |speed: f64| driver.kept_distance(speed).max(STANDING_GAP);
    let keeping = GAP_GAIN * (gap - kept(velocity)) + SPEED_GAIN * (other_velocity - velocity);
    let faster = (velocity - other_velocity).max(0.0);
    let needed = faster * faster / (2.0 * (gap - kept(other_velocity)).max(0.1));
    let approaching = if needed > FOLLOWING_COMFORTABLE { -needed } else { f64::INFINITY };
    keeping.max(-FOLLOWING_COMFORTABLE).min(approaching).max(-FOLLOWING_MAX)
}

/// The plan for a request.
pub(super) fn plan(
    request: &PlanRequest,
    (driver, settings): (Driver, &ReferenceDriving),
    memory: &mut PlanningMemory,
) -> PlanResult {
    let start = match Start::new(request, request.previous.is_some()) {
        Ok(start) => start,
        Err(reason) => return refused(request, &format!("the agent {reason}")),
    };
    let (path, dt) = (&request.route.path, request.dt);
    let n_points = request.predictions.n_steps + 1;
    let ego = Ego::new(request, path, (start.s, start.velocity, start.d), RETURN_TIME);
    let velocity = start.velocity;
    let alertness = &mut memory.alertness;
    let acceleration = alertness.velocity.map_or(0.0, |before| (velocity - before) / dt);
    let (mut along, mut others) = (Vec::new(), Vec::new());
    for other in request.others {
        match Along::of(request, &ego, other, velocity, acceleration) {
            Some(found) => along.push(found),
            // These drivers are not defined for what crosses or comes towards them; there it drives as `lawful`.
            None => others.push(*other),
        }
    }
    along.sort_by(|a, b| a.seen.gap.total_cmp(&b.seen.gap));
    let ahead: Vec<Along> = along.iter().filter(|one| one.is_in_way()).copied().collect();
    // What is behind a leader is not seen until the leader has moved aside.
    let is_hidden = |one: &Along| {
        one.is_in_way() && ahead.iter().any(|near| near.seen.gap < one.seen.gap && near.aside < REVEALED_ASIDE)
    };
    let visible: Vec<Seen> = along.iter().filter(|one| !is_hidden(one)).map(|one| one.seen).collect();
    let mut danger: Option<Seen> = None;
    for seen in visible.iter().filter(|seen| driver.sees_danger(seen, Encounter::Traffic)) {
        // Of equal ones the nearest, which comes first.
        if danger.is_none_or(|most| driver.urgency(seen) > driver.urgency(&most)) {
            danger = Some(*seen);
        }
    }
    let leader = visible.iter().find(|seen| seen.side <= 0.0 && seen.is_ahead).copied();
    let danger =
        danger.or_else(|| brakes_ahead(driver, leader.as_ref()?, alertness.leader_velocity?, dt).then_some(leader?));
    alertness.velocity = Some(velocity);
    alertness.leader_velocity = leader.map(|seen| seen.other_velocity);
    alertness.calm = if danger.is_some() { 0.0 } else { alertness.calm + dt };
    let mut reaction = alertness.reaction.unwrap_or_else(|| Reaction::new(driver));
    if reaction.has_begun() && alertness.calm >= settings.calm {
        reaction = Reaction::new(driver);
    }
    let is_waiting = reaction.is_waiting();
    let first = danger.map(|seen| reaction.brake(&seen, dt));
    alertness.reaction = Some(reaction);

    let lawful = lawful::lawful_velocity(request);
    let request = &PlanRequest { others: &others, ..*request };
    let PlanningMemory { conflicts, speed_profile, motions, free, .. } = memory;
    conflicts.collect(request, &ego, n_points, request.barriers(request.rules.way, start.s));
    let cornering = request.vehicle.cornering(settings.lateral_acceleration);
    let law = CarFollowing { acceleration: 1.5, deceleration: 2.0, ..CarFollowing::default() };
    speed_profile.fill_below(path, lawful, (start.s, ego.reach), cornering, law.deceleration);
    let most = settings.desired_velocity_max.min(request.vehicle.velocity_max);
    let deference = Deference::to_standing(law.minimum_gap);
    let drive = |conflicts: &Conflicts, point: usize, s: f64, v: f64, driven: f64| {
        let desired = |s: f64| speed_profile.at(s).min(most);
        let slowing = (desired(s + v * lawful::SLOWING_TIME) - v) / lawful::SLOWING_TIME;
        let wish = ((desired(s) - v) / dt).min(APPROACH).min(slowing).max(-lawful::SLOWING_MAX);
        let follow = |gap: f64, leader: f64, _: f64| law.following(v, gap, leader);
        let taken = conflicts.allowed(point, &ego, (s, v), deference, follow) - law.acceleration;
        // A driver that reacts keeps its speed or brakes, whatever it wishes.
        wish.min(driven) + taken.min(0.0)
    };
    let run = |conflicts: &Conflicts, motions: &mut Vec<PathMotion>| {
        motions.clear();
        let (mut s, mut v) = (start.s, velocity);
        let mut reaction = reaction;
        let now = |seen: &Seen, v: f64, s: f64, point: usize| {
            let moved = seen.other_velocity * point as f64 * dt;
            Seen { velocity: v, gap: seen.gap + moved - (s - start.s), ..*seen }
        };
        for point in 0..n_points {
            let driven = match (&danger, point) {
                // While it reacts it goes on with what it did before.
                (Some(_), 0) => (-first.unwrap_or(0.0)).min(if is_waiting { acceleration.min(0.0) } else { 0.0 }),
                (Some(seen), _) => -reaction.brake(&now(seen, v, s, point), dt),
                (None, _) if reaction.has_begun() => 0.0,
                (None, _) if settings.keep_distance => {
                    following(driver, leader.map(|seen| now(&seen, v, s, point)).as_ref())
                }
                (None, _) => f64::INFINITY,
            };
            let a = limited(drive(conflicts, point, s, v, driven), v, request.vehicle).max(-v / dt);
            motions.push(PathMotion { s, velocity: v, acceleration: a });
            // First the new speed, then the way: the order of the cases in one dimension.
            v = (v + a * dt).max(0.0);
            s += v * dt;
        }
    };
    run(conflicts, free);
    conflicts.decide(request, &ego, deference, free);
    run(conflicts, motions);
    match path_motion::trajectory_on_road(request, path, &start, motions, (0.0, RETURN_TIME)) {
        Some(trajectory) => PlanResult::planned(trajectory, f64::NAN),
        None => refused(request, "its path bends too tightly where it is"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planning_twice_at_a_time_step_starts_from_the_same_memory() {
        let (first, second) =
            (Alertness { calm: 1.0, ..Alertness::default() }, Alertness { calm: 2.0, ..Alertness::default() });
        let mut log = AlertnessLog::default();
        assert_eq!(log.at(4), Alertness::default());
        log.note(4, first);
        assert_eq!((log.at(4), log.at(5)), (Alertness::default(), first));
        log.note(5, second);
        log.note(5, second);
        assert_eq!((log.at(5), log.at(6)), (first, second));
    }

    #[test]
    fn at_its_kept_distance_a_driver_follows_without_braking() {
        let seen = Seen {
            velocity: 20.0,
            acceleration: 0.0,
            other_velocity: 20.0,
            gap: 40.0,
            side: -1.8,
            toward: 0.0,
            is_ahead: true,
            lengths: 9.0,
        };
        assert!(following(Driver::Cc, Some(&seen)).abs() < 1e-12);
        assert_eq!(following(Driver::Cc, None), f64::INFINITY);
        // 10² / (2 (40 - 20)) = 2.5
        let slower = Seen { other_velocity: 10.0, ..seen };
        assert!((following(Driver::Cc, Some(&slower)) + 2.5).abs() < 1e-12);
        assert_eq!(following(Driver::Cc, Some(&Seen { gap: 21.0, ..slower })), -FOLLOWING_MAX);
    }
}
