//! When to change lanes. Along its route the agent plans in the frame of the lane that it aims at, and aims at the next
//! one as soon as it fits into a gap there. Until then it looks for a gap: it drives at the speed that brings it beside
//! one, and stops before its lane must be left.
//!
//! A gap is large enough if the vehicle behind has to brake with at most 4 m/s² and the agent no harder than is
//! comfortable: the safety criterion of MOBIL (Kesting, Treiber, Helbing, Transportation Research Record 1999, 2007, doi
//! 10.3141/1999-10, eq. 2) with the deceleration that makes the speeds equal before what is to be kept is used up. That
//! is less the sooner the change has to be done. A change that is under way is seen from the previous plan.

use super::super::arrival;
use super::super::conflicts::Ego;
use super::super::frame::Start;
use super::super::lanes::{AIM, Aim, Lanes};
use super::super::neighbours::{Interval, Neighbours, Next, intervals};
use super::super::{Merge, PlanRequest};
use super::settings::{Comfort, FrenetSettings};
use crate::error::Result;
use crate::geometry::polyline::ReferencePath;
use crate::route::Route;
use crate::rules::{Rules, RulesSettings};
use crate::scenario::{Goal, Scenario};

/// The vehicle behind a gap must not have to brake harder than this [m/s²] ...
const SAFE_DECELERATION: f64 = 4.0;
/// ... and once a change is under way, not harder than this: otherwise the agent returns.
const RETURN_DECELERATION: f64 = 6.0;
/// An agent that has found no gap stops this far before the end of the stretch along which both lanes run [m].
const END_MARGIN: f64 = 10.0;
/// Duration of a change [s].
const DURATION: f64 = 4.0;
/// The agent wants to be beside a gap after this time [s]; what the gap lacks then [m] counts against it so many times as
/// much as a change of speed [m/s].
const SEEKING_TIME: f64 = 3.0;
const LACK_WEIGHT: f64 = 2.0;
/// The vehicle behind takes notice after this time [s].
const NOTICED: f64 = 1.0;
/// Kept to the vehicles ahead and behind: at least this [m], and a time [s] at ease ...
const GAP_MIN: f64 = 1.0;
const TIME_GAP: f64 = 0.5;
/// ... which falls to nothing as the time until the change must be done falls from the sum of these to the first [s].
const HURRY: (f64, f64) = (4.0, 8.0);
/// At ease a plan moves at most this far to the side [m].
const GENTLE_STEP: f64 = 1.75;
/// Feet are searched this far around the expected place [m].
const FOOT_WINDOW: f64 = 30.0;

/// The lanes of a route with lane changes, each as a route of its own.
#[derive(Debug, Clone)]
pub struct LaneRoutes {
    lanes: Lanes,
    routes: Vec<Route>,
}

impl LaneRoutes {
    /// # Errors
    /// `InvalidInput` if a lane makes no path.
    pub(in crate::plan) fn along(
        route: &Route,
        goal: &Goal,
        scenario: &Scenario,
        rules: &RulesSettings,
    ) -> Result<Self> {
        let lanes = Lanes::of(route, goal, scenario, rules)?;
        let beside = |path: &ReferencePath, s: f64| {
            let there = (!s.is_nan()).then(|| path.project(route.path.at(s).position)).flatten();
            there.map_or(f64::NAN, |foot| foot.0)
        };
        let routes = lanes.lanes.iter().map(|lane| Route {
            start_s: beside(&lane.path, route.start_s),
            goal_entry_s: beside(&lane.path, route.goal_entry_s),
            goal_exit_s: beside(&lane.path, route.goal_exit_s),
            path: lane.path.clone(),
            ..route.clone()
        });
        Ok(Self { routes: routes.collect(), lanes })
    }

    /// The request in the frame of the lane that the agent aims at; as it is if the agent is on none of them.
    pub(in crate::plan) fn aim<'a>(&'a self, request: &PlanRequest<'a>, settings: &FrenetSettings) -> PlanRequest<'a> {
        let Some(aim) = self.lanes.aimed_at(request, AIM) else { return *request };
        let (aim, merge) = self.choose(request, &settings.comfort, aim);
        PlanRequest { merge, ..self.on(request, aim) }
    }

    fn on<'a>(&'a self, request: &PlanRequest<'a>, aim: Aim) -> PlanRequest<'a> {
        let rules = Rules { way: &self.lanes.lanes[aim.lane].way, ..request.rules };
        PlanRequest { route: &self.routes[aim.lane], s_hint: aim.s, rules, ..*request }
    }

    /// The lane to drive in, and what the change asks of the agent.
    fn choose(&self, request: &PlanRequest, comfort: &Comfort, aim: Aim) -> (Aim, Merge) {
        let lanes = &self.lanes.lanes;
        let beside = self.lanes.beside(aim.lane, aim.s, request.road);
        let half = 0.5 * lanes[aim.lane].width(aim.s, request.road);
        let velocity = request.state.velocity.max(0.0);
        let front = |s: f64| s + request.vehicle.rear_axle_to_center + 0.5 * request.vehicle.length;
        // Until the change must be done, for an agent in a lane [s].
        let time = |Aim { lane, s, .. }: Aim| {
            let last_chance = lanes[lane].need(s).map_or(f64::INFINITY, |need| need.last_chance);
            (last_chance - front(s)) / velocity.max(1.0)
        };
        let into_gap = |time: f64| Merge { step: Some(step(time)), ..Merge::default() };
        if aim.d.abs() > half {
            // Under way. Back only if it has become unsafe.
            let origin = beside[usize::from(aim.d < 0.0)].and_then(|(lane, s)| self.in_lane(request, lane, s));
            let Some(origin) = origin else { return (aim, Merge::default()) };
            let is_safe = self.fits(request, 0.0, aim, (comfort.deceleration, RETURN_DECELERATION));
            return if is_safe { (aim, into_gap(time(origin))) } else { (origin, Merge::default()) };
        }
        let Some(need) = lanes[aim.lane].need(aim.s).filter(|need| need.changes > 0) else {
            return (aim, Merge::default());
        };
        let waiting = Merge { end: need.lane_end - END_MARGIN, ..Merge::default() };
        let nearer = |(lane, s): &(usize, f64)| lanes[*lane].need(*s).is_some_and(|there| there.changes < need.changes);
        let next = beside.into_iter().flatten().find(nearer);
        let Some(there) = next.and_then(|(lane, s)| self.in_lane(request, lane, s)) else { return (aim, waiting) };
        // Too late to wait.
        let is_last = front(aim.s) + 0.5 * velocity * velocity / comfort.deceleration > need.lane_end;
        let (time, into_gap) = (time(aim), into_gap(time(aim)));
        let time_gap = time_gap(time);
        if is_last || self.fits(request, time_gap, there, (comfort.deceleration, SAFE_DECELERATION)) {
            return (there, into_gap);
        }
        (aim, Merge { velocity: self.seek(request, comfort, time_gap, (aim, there), waiting.end), ..waiting })
    }

    /// The place of the agent on a lane, near an arc length [m].
    fn in_lane(&self, request: &PlanRequest, lane: usize, s: f64) -> Option<Aim> {
        let axle = request.vehicle.rear_axle_from_center(request.state.pose());
        let (s, d) = self.lanes.lanes[lane].path.project_near(axle, s, FOOT_WINDOW)?;
        Some(Aim { lane, s, d })
    }

    /// There is room beside the agent, and neither the agent nor the vehicle behind has to brake harder than [m/s²].
    fn fits(&self, request: &PlanRequest, time_gap: f64, there: Aim, (own, behind): (f64, f64)) -> bool {
        let velocity = request.state.velocity.max(0.0);
        let Neighbours { leader, follower } =
            Neighbours::of(request, &self.lanes.lanes[there.lane], &self.ego(request, there));
        let ahead_is_safe = leader.is_none_or(|Next { gap, velocity: ahead }| {
            braking(gap - kept(velocity, time_gap), velocity - ahead, 0.0) <= own
        });
        let behind_is_safe =
            |Next { gap, velocity: other }| braking(gap - kept(other, time_gap), other - velocity, NOTICED) <= behind;
        ahead_is_safe && follower.is_none_or(behind_is_safe)
    }

    fn ego(&self, request: &PlanRequest, aim: Aim) -> Ego<'_> {
        Ego::new(request, &self.lanes.lanes[aim.lane].path, (aim.s, request.state.velocity.max(0.0), 0.0), DURATION)
    }

    /// The speed with which the agent comes beside the gap that takes the smallest change of its speed, or that lacks the
    /// least [m/s]; `None` if it can reach none.
    fn seek(
        &self,
        request: &PlanRequest,
        comfort: &Comfort,
        time_gap: f64,
        (here, there): (Aim, Aim),
        end: f64,
    ) -> Option<f64> {
        let (along, time) = (self.on(request, here), SEEKING_TIME);
        let start = Start::on(&along.route.path, here.s, &request.state, request.vehicle, false).ok()?;
        let (wish, _) = arrival::desired(&along, &start, comfort.deceleration, comfort.cruise_velocity_min, true);
        let (velocity, step) = (start.velocity, comfort.velocity_step);
        let wish = wish.clamp((velocity - step).max(0.0), velocity + step);
        let half = 0.5 * request.vehicle.length;
        let room = |other: &Interval| half + kept(other.velocity, time_gap);
        let behind = |other: &Interval| other.rear + other.velocity * time - room(other);
        let ahead = |other: &Interval| other.front + other.velocity * time + room(other);
        // Everything relative to the agent's centre.
        let mut others = intervals(request, &self.lanes.lanes[there.lane], &self.ego(request, there));
        others.sort_by(|a, b| a.middle().total_cmp(&b.middle()));
        let leaders = intervals(request, &self.lanes.lanes[here.lane], &self.ego(request, here));
        let leaders = leaders.iter().filter(|other| other.middle() > 0.0).map(behind);
        let lane_end = end - (here.s + request.vehicle.rear_axle_to_center + half);
        let furthest = leaders.fold(lane_end, f64::min);
        let free = 0.5 * (velocity + wish) * time;
        let mut best: Option<(f64, f64)> = None;
        for i in 0..=others.len() {
            let low = i.checked_sub(1).map_or(f64::NEG_INFINITY, |k| ahead(&others[k]));
            let high = others.get(i).map_or(f64::INFINITY, behind).min(furthest);
            let lack = (low - high).max(0.0);
            let way = if lack > 0.0 { 0.5 * (low + high) } else { free.clamp(low, high) };
            let speed = 2.0 * way / time - velocity;
            let cost = (speed - wish).abs() + LACK_WEIGHT * lack;
            if (-0.5 * velocity..=velocity + step).contains(&speed) && best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, speed.max(0.0)));
            }
        }
        best.map(|(_, speed)| speed)
    }
}

/// Time gap that is kept if the change must be done within a time [s].
fn time_gap(time: f64) -> f64 {
    TIME_GAP * ((time - HURRY.0) / HURRY.1).clamp(0.0, 1.0)
}

/// How far a plan moves to the side at most if the change must be done within a time [s]; as far as it takes if that is
/// soon [m].
fn step(time: f64) -> f64 {
    if time > HURRY.0 { GENTLE_STEP } else { f64::INFINITY }
}

/// Distance that a vehicle keeps to the one ahead after a change [m].
fn kept(velocity: f64, time_gap: f64) -> f64 {
    GAP_MIN + time_gap * velocity
}

/// Deceleration with which a vehicle that is faster than the one ahead by some speed [m/s] has its speed when it has used
/// up some room, and does nothing for some time [m/s²].
fn braking(room: f64, faster: f64, idle: f64) -> f64 {
    let faster = faster.max(0.0);
    let room = room - idle * faster;
    if room <= 0.0 { f64::INFINITY } else { 0.5 * faster * faster / room }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_of_a_gap_decides_how_hard_the_one_behind_brakes() {
        for (room, faster, idle, expected) in [
            (10.0, -3.0, 1.0, 0.0),
            (10.0, 0.0, 1.0, 0.0),
            // 4² / (2 2)
            (2.0, 4.0, 0.0, 4.0),
            // 8² / (2 (16 - 8))
            (16.0, 8.0, 1.0, 4.0),
            (8.0, 8.0, 1.0, f64::INFINITY),
            (0.0, -1.0, 0.0, f64::INFINITY),
        ] {
            assert_eq!(braking(room, faster, idle), expected, "{room} m, {faster} m/s, {idle} s");
        }
    }

    #[test]
    fn the_time_gap_that_is_kept_shrinks_with_the_time_that_is_left() {
        for (time, expected) in [(20.0, 0.5), (12.0, 0.5), (8.0, 0.25), (4.0, 0.0), (-1.0, 0.0)] {
            assert!((time_gap(time) - expected).abs() < 1e-12, "{time} s");
        }
        assert_eq!(kept(12.0, time_gap(12.0)), 7.0);
    }
}
