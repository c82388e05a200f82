//! Changing lanes with MOBIL ("minimizing overall braking induced by lane changes"), driving with the IDM.
//!
//! Source: Kesting, Treiber, Helbing, "General lane-changing model MOBIL for car-following models", Transportation
//! Research Record 1999, 2007, doi 10.3141/1999-10: safety criterion (eq. 2), incentive (eq. 3). The paper's bias
//! for the right lane is one for the lane that leads to the goal here.
//!
//! A change that is under way is seen from the previous plan, which leads to the lane that it aims at.

use super::car_following::{CarFollowing, integrate, limited};
use super::conflicts::{Conflicts, Deference, Ego};
use super::frame::Start;
use super::idm::IdmSettings;
use super::lanes::{Aim, Lane, Lanes, Need, SETTLED_OFFSET};
use super::neighbours::{Interval, Neighbours, Next, intervals};
use super::path_motion::RETURN_TIME;
use super::{PlanRequest, PlanResult, PlanningMemory, path_motion, refused};
use crate::settings::{between, positive, settings};
use crate::trajectory::State;

/// A change is urgent if less than this time and this length are left for each one that is missing.
const URGENT_TIME: f64 = 15.0;
const URGENT_LENGTH: f64 = 40.0;
/// A change is at least this long [m].
const CHANGE_LENGTH_MIN: f64 = 13.0;
/// Before the place where its lane must be left an agent brakes with this share of the comfortable deceleration.
const END_BRAKING: f64 = 0.7;
/// Shortest time in which the rest of a change is driven [s].
const REST_MIN: f64 = 0.5;

settings! {
    /// Drives with the Intelligent Driver Model, as `Idm`, and changes lanes with MOBIL.
    ///
    /// Kesting, Treiber, Helbing, "General lane-changing model MOBIL for car-following models", Transportation Research
    /// Record 1999, 2007, doi 10.3141/1999-10. A change must be safe: the new follower brakes with at most b_safe (eq. 2).
    /// And it must be worthwhile: own gain + p (gain of the new follower + gain of the old follower) + bias > threshold
    /// (eq. 3), where a gain is the acceleration of the car-following model after the change minus that before. The bias
    /// favours lanes that lead to the goal; it grows by up to b_safe where such a lane has to be reached soon. Defaults
    /// as in the simulations of the source (table 1), politeness from the range studied there (0 to 1). See
    /// docs/reference/planners.md.
    pub struct IdmMobilSettings as IdmMobil(idm: IdmSettings) {
        /// Politeness p: weight of the gains and losses of the followers.
        politeness: f64 = 0.2, between(-10.0, 10.0);
        /// Smallest gain of a lane change.
        changing_threshold: f64 ["m/s²"] = 0.1, between(0.0, 100.0);
        /// Largest deceleration b_safe that a lane change may impose on the new follower.
        safe_deceleration: f64 ["m/s²"] = 4.0, positive(100.0);
        /// Bias for each lane nearer to the lane that leads to the goal.
        bias: f64 ["m/s²"] = 0.3, between(0.0, 100.0);
        /// Duration of a lane change.
        lane_change_duration: f64 ["s"] = 4.0, between(1.0, 60.0);
        /// Time from one look for a better lane to the next; 0: it looks at every step. Who must change soon looks at every
        /// step, too.
        looking_interval: f64 ["s"] = 0.0, between(0.0, 60.0);
    }
}

impl IdmMobilSettings {
    /// The change is worth it (eq. 3): own gain plus p times what the followers gain, above the threshold. Accelerations
    /// before and after the change [m/s²].
    fn is_worth_it(&self, own: (f64, f64), new: (f64, f64), old: (f64, f64), bias: f64) -> bool {
        let others = new.1 - new.0 + old.1 - old.0;
        own.1 - own.0 + self.politeness * others + bias > self.changing_threshold
    }

    /// It looks for a better lane at this step. Each agent has steps of its own, which follow from where it entered; a look
    /// that was due since the last plan is made now.
    fn looks(&self, request: &PlanRequest) -> bool {
        let steps = (self.looking_interval / request.dt).round() as i64;
        if steps <= 1 {
            return true;
        }
        let State { x, y, .. } = request.entry;
        let mixed = (x.to_bits() ^ y.to_bits().rotate_left(32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let own = ((mixed >> 33) as i64).wrapping_add(self.idm.place.wavering.noise_seed as i64);
        (request.time_step + own).rem_euclid(steps) < request.previous_age.max(1) as i64
    }

    /// It has to change soon in a lane with this need.
    fn is_urgent(&self, need: &Need, s: f64, velocity: f64) -> bool {
        self.burden(need, s, velocity) > need.changes as f64 * self.bias
    }

    /// What speaks against a lane [m/s²]: the bias for every change that is missing there, up to b_safe more when it
    /// becomes urgent.
    fn burden(&self, need: &Need, s: f64, velocity: f64) -> f64 {
        if need.changes == 0 {
            return 0.0;
        }
        let changes = need.changes as f64;
        let left = (need.last_chance - s).max(0.0) / changes;
        let urgency = (1.0 - left / (URGENT_TIME * velocity + URGENT_LENGTH)).max(0.0);
        changes * self.bias + urgency * self.safe_deceleration
    }
}

/// The plan for a request.
pub(super) fn plan(
    request: &PlanRequest,
    settings: &IdmMobilSettings,
    lanes: &Lanes,
    memory: &mut PlanningMemory,
) -> PlanResult {
    let trusted = request.previous.is_some();
    let wish = match Start::new(request, trusted) {
        Ok(start) => settings.idm.goal_velocity(request, &start),
        Err(_) => request.state.velocity.max(0.0).min(settings.idm.desired_velocity_max),
    };
    let Some(aim) = lanes.aimed_at(request, 0.0) else {
        return refused(request, "the agent is on none of its lanes");
    };
    let chosen = choose(request, settings, lanes, aim, wish);
    let yields_to = leader_beside(request, settings, lanes, chosen);
    let lane = &lanes.lanes[chosen.lane];
    let start = match Start::on(&lane.path, chosen.s, &request.state, request.vehicle, trusted) {
        Ok(start) => start,
        Err(reason) => return refused(request, &format!("the agent {reason}")),
    };
    let aside = settings.idm.place.aside(request, start.s, || lane.width(start.s, request.road));
    let time = time_left(request, settings, lane, &start);
    let n_points = request.predictions.n_steps + 1;
    let law = &settings.idm.law;
    let place = (aside, settings.idm.place.time_to_reach(start.d - aside, start.velocity, time));
    let ego = Ego { target: place.0, ..Ego::new(request, &lane.path, (start.s, start.velocity, start.d), place.1) };
    let PlanningMemory { conflicts, speed_profile, motions, free, .. } = memory;
    conflicts.collect(request, &ego, n_points, request.barriers(&lane.way, start.s));
    let cornering = request.vehicle.cornering(settings.idm.lateral_acceleration);
    speed_profile.fill(&lane.path, (&lane.way.limits, 0.0), (start.s, ego.reach), cornering, law.deceleration);
    let (need, noise) = (lane.need(start.s), settings.idm.place.wavering.noise());
    let has_pace = request.goal.pace.is_some();
    let deference = Deference::full(law.minimum_gap);
    let drive = |conflicts: &Conflicts, point: usize, s: f64, velocity: f64| {
        let free = law.free(velocity, wish.min(speed_profile.at(s)).min(end_velocity(law, need, s + ego.to_front)));
        let braking = if has_pace { speed_profile.braking(s, velocity, law.deceleration) } else { f64::INFINITY };
        let free = free.min(braking);
        let follow = |gap: f64, leader: f64, _: f64| law.following(velocity, gap, leader);
        let allowed = conflicts.allowed(point, &ego, (s, velocity), deference, follow);
        let wanted = law.combined(free, allowed, settings.idm.improved);
        let time = (request.time_step + point as i64) as f64 * request.dt;
        let wanted = noise.as_ref().map_or(wanted, |noise| noise.added(wanted, time, velocity));
        let beside = yields_to.map_or(f64::INFINITY, |leader| {
            let gap = leader.gap + leader.velocity * point as f64 * request.dt - (s - start.s);
            law.following(velocity, gap, leader.velocity).max(-law.deceleration)
        });
        limited(wanted.min(beside), velocity, request.vehicle)
    };
    let from = (start.s, start.velocity);
    integrate(from, n_points, request.dt, free, |point, s, velocity| drive(conflicts, point, s, velocity));
    conflicts.decide(request, &ego, deference, free);
    integrate(from, n_points, request.dt, motions, |point, s, velocity| drive(conflicts, point, s, velocity));
    match path_motion::trajectory_on_road(request, &lane.path, &start, motions, place) {
        Some(trajectory) => {
            let changes = (chosen.d - aside).abs() > SETTLED_OFFSET;
            let half = 0.5 * lane.width(start.s, request.road);
            let lane_change = request.change_to(&chosen, half).filter(|_| changes);
            PlanResult { lane_change, ..PlanResult::planned(trajectory, f64::NAN) }
        }
        None => refused(request, "its lane bends too tightly where it is"),
    }
}

/// The lane to drive to: the one aimed at, another one if MOBIL says so, or back if a change has become unsafe.
fn choose(request: &PlanRequest, settings: &IdmMobilSettings, lanes: &Lanes, aim: Aim, wish: f64) -> Aim {
    let velocity = request.state.velocity.max(0.0);
    let law = &settings.idm.law;
    let on = |lane: usize, s: f64| {
        let ego = Ego::new(request, &lanes.lanes[lane].path, (s, velocity, 0.0), RETURN_TIME);
        (ego, Neighbours::of(request, &lanes.lanes[lane], &ego))
    };
    let is_safe = |neighbours: &Neighbours| {
        let new = neighbours.behind(law, velocity, request.vehicle.length);
        neighbours.is_free() && new.is_none_or(|(with, _)| with >= -settings.safe_deceleration)
    };
    let beside = lanes.beside(aim.lane, aim.s, request.road);
    let aside = settings.idm.place.aside(request, aim.s, || lanes.lanes[aim.lane].width(aim.s, request.road));
    if (aim.d - aside).abs() > SETTLED_OFFSET {
        // Under way. Back only while the agent is mostly in the lane that it leaves.
        let half = 0.5 * lanes.lanes[aim.lane].width(aim.s, request.road);
        let origin = beside[usize::from(aim.d < 0.0)];
        if let Some((lane, s)) = origin.filter(|_| aim.d.abs() > half)
            && !is_safe(&on(aim.lane, aim.s).1)
            && let Some((s, d)) = lanes.lanes[lane].path.project_near(
                request.vehicle.rear_axle_from_center(request.state.pose()),
                s,
                10.0,
            )
        {
            return Aim { lane, s, d };
        }
        return aim;
    }
    let (_, here) = on(aim.lane, aim.s);
    let own_now = own(settings, &lanes.lanes[aim.lane], &here, aim.s, velocity, wish, request);
    let Some(need) = lanes.lanes[aim.lane].need(aim.s) else { return aim };
    if !settings.looks(request) && !settings.is_urgent(&need, aim.s, velocity) {
        return aim;
    }
    // Both lanes must still be side by side at the end of the change.
    let length = (velocity * settings.lane_change_duration).max(CHANGE_LENGTH_MIN);
    let beside_then = lanes.beside(aim.lane, aim.s + length, request.road);
    let mut best: Option<(f64, Aim)> = None;
    for ((lane, s), then) in beside.into_iter().zip(beside_then).filter_map(|(now, then)| Some((now?, then?))) {
        if lane != then.0 {
            continue;
        }
        let Some(need_there) = lanes.lanes[lane].need(s) else { continue };
        let (_, there) = on(lane, s);
        let own_then = own(settings, &lanes.lanes[lane], &there, s, velocity, wish, request);
        if !is_safe(&there) || own_then < -settings.safe_deceleration {
            continue;
        }
        let length = request.vehicle.length;
        let (new_after, new_before) = there.behind(law, velocity, length).unwrap_or_default();
        let (old_before, old_after) = here.behind(law, velocity, length).unwrap_or_default();
        let bias = settings.burden(&need, aim.s, velocity) - settings.burden(&need_there, s, velocity);
        let (new, old) = ((new_before, new_after), (old_before, old_after));
        let gain = own_then - own_now + bias;
        if settings.is_worth_it((own_now, own_then), new, old, bias) && best.is_none_or(|(most, _)| gain > most) {
            let rear_axle = request.vehicle.rear_axle_from_center(request.state.pose());
            let d = lanes.lanes[lane].path.project_near(rear_axle, s, 10.0).map_or(0.0, |foot| foot.1);
            best = Some((gain, Aim { lane, s, d }));
        }
    }
    best.map_or(aim, |(_, aim)| aim)
}

/// The vehicle that the agent lets go ahead in the lane to which it must change soon: the agent falls in with the speed
/// of that lane, braking no harder than is comfortable, so that a change becomes possible.
fn leader_beside(request: &PlanRequest, settings: &IdmMobilSettings, lanes: &Lanes, aim: Aim) -> Option<Next> {
    let velocity = request.state.velocity.max(0.0);
    let need = lanes.lanes[aim.lane].need(aim.s).filter(|need| need.changes > 0)?;
    let is_urgent = settings.is_urgent(&need, aim.s, velocity);
    let aside = settings.idm.place.aside(request, aim.s, || lanes.lanes[aim.lane].width(aim.s, request.road));
    if !is_urgent || (aim.d - aside).abs() > SETTLED_OFFSET {
        return None;
    }
    let nearer =
        |(lane, s): &(usize, f64)| lanes.lanes[*lane].need(*s).is_some_and(|there| there.changes < need.changes);
    let beside = lanes.beside(aim.lane, aim.s, request.road);
    let (place, (lane, s)) = beside.into_iter().enumerate().find_map(|(i, one)| Some((i, one.filter(nearer)?)))?;
    let ego = Ego::new(request, &lanes.lanes[lane].path, (s, velocity, 0.0), RETURN_TIME);
    let ahead = intervals(request, &lanes.lanes[lane], &ego).filter(|other| other.is_ahead(place == 0));
    let next = |other: Interval| Next { gap: other.rear - 0.5 * request.vehicle.length, velocity: other.velocity };
    ahead.map(next).min_by(|a, b| a.gap.total_cmp(&b.gap))
}

/// The agent's acceleration in a lane, with speed limits, curves and the place where the lane must be left [m/s²].
fn own(
    settings: &IdmMobilSettings,
    lane: &Lane,
    neighbours: &Neighbours,
    s: f64,
    velocity: f64,
    wish: f64,
    request: &PlanRequest,
) -> f64 {
    let law = &settings.idm.law;
    let front = s + request.vehicle.rear_axle_to_center + 0.5 * request.vehicle.length;
    let end = end_velocity(law, lane.need(s), front);
    neighbours.own(law, velocity, wish.min(lane.way.limits.at(s)).min(end))
}

/// Speed from which the agent still stops comfortably, with a reserve, before the place where its lane must be left [m/s].
fn end_velocity(law: &CarFollowing, need: Option<Need>, front: f64) -> f64 {
    let Some(need) = need.filter(|need| need.changes > 0) else { return f64::INFINITY };
    (2.0 * END_BRAKING * law.deceleration * (need.last_chance - front).max(0.0)).sqrt()
}

/// Time for giving up the offset from the lane [s]: the rest of the change if one is under way, otherwise as gently as
/// a change.
fn time_left(request: &PlanRequest, settings: &IdmMobilSettings, lane: &Lane, start: &Start) -> f64 {
    let duration = settings.lane_change_duration;
    let width = lane.width(start.s, request.road).max(start.d.abs()).max(1.0);
    let share = start.d.abs() / width;
    let passed = passed_share(share);
    // Of a change by `width` within `duration` at the present speed, at this place.
    let slope = 30.0 * (passed * (1.0 - passed)).powi(2) * width / (duration * start.velocity.max(1.0));
    let under_way = start.d_prime * -start.d.signum() > 0.5 * slope && slope > 0.0;
    if under_way { (duration * (1.0 - passed)).max(REST_MIN) } else { (duration * share.sqrt()).max(2.0) }
}

/// Share of the time of a change that has passed when this share of the way is left: inverse of
/// 1 - 10 u³ + 15 u⁴ - 6 u⁵.
fn passed_share(left: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..30 {
        let u: f64 = 0.5 * (low + high);
        if 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0)) > left { low = u } else { high = u }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> IdmMobilSettings {
        IdmMobilSettings { politeness: 0.5, changing_threshold: 0.2, ..IdmMobilSettings::default() }
    }

    #[test]
    fn the_incentive_is_that_of_the_formula() {
        // own gain + 0.5 (gain of the new follower + gain of the old one) + bias > 0.2
        for (own, new, old, bias, expected) in [
            ((-0.5, 0.5), (0.0, 0.0), (0.0, 0.0), 0.0, true),
            ((0.0, 0.2), (0.0, 0.0), (0.0, 0.0), 0.0, false),
            ((0.0, 1.0), (0.0, -1.8), (0.0, 0.0), 0.0, false),
            ((0.0, 1.0), (0.0, -1.8), (-0.5, 0.0), 0.0, true),
            ((0.0, 0.0), (0.0, -0.2), (0.0, 0.0), 0.31, true),
            ((0.3, 0.0), (0.0, 0.0), (0.0, 0.0), 0.4, false),
        ] {
            assert_eq!(settings().is_worth_it(own, new, old, bias), expected, "{own:?} {new:?} {old:?} {bias}");
        }
    }

    #[test]
    fn the_burden_of_a_lane_grows_towards_the_place_where_it_must_be_left() {
        let settings = IdmMobilSettings::default();
        let need = |changes| Need { changes, last_chance: 340.0, lane_end: 340.0, goes_on: false };
        let none = Need { last_chance: f64::INFINITY, lane_end: f64::INFINITY, ..need(0) };
        assert_eq!(settings.burden(&none, 0.0, 10.0), 0.0);
        // Urgent from 15 s and 40 m on: 190 m.
        assert!((settings.burden(&need(1), 100.0, 10.0) - 0.3).abs() < 1e-12);
        assert!((settings.burden(&need(1), 245.0, 10.0) - 2.3).abs() < 1e-12);
        // Two changes: 95 m for each.
        assert!((settings.burden(&need(2), 150.0, 10.0) - 2.6).abs() < 1e-12);
        assert!((settings.burden(&need(1), 400.0, 10.0) - 4.3).abs() < 1e-12);
    }

    #[test]
    fn the_share_of_a_change_that_has_passed_follows_from_what_is_left() {
        for (left, passed) in [(1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (1.0 - 0.103_515_625, 0.25)] {
            assert!((passed_share(left) - passed).abs() < 2e-3, "{left}: {}", passed_share(left));
        }
    }

    #[test]
    fn an_impossible_setting_is_named() {
        let check = |change: fn(&mut IdmMobilSettings), name: &str| {
            let mut settings = IdmMobilSettings::default();
            settings.validate().expect("valid");
            change(&mut settings);
            assert!(settings.validate().expect_err(name).to_string().starts_with(name));
        };
        check(|s| s.politeness = f64::NAN, "politeness");
        check(|s| s.changing_threshold = -0.1, "changing_threshold");
        check(|s| s.safe_deceleration = 0.0, "safe_deceleration");
        check(|s| s.bias = -1.0, "bias");
        check(|s| s.lane_change_duration = 0.5, "lane_change_duration");
        check(|s| s.idm.law.time_gap = 0.0, "time_gap");
    }
}
