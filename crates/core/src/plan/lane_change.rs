//! When to change lanes. Along its route the agent plans in the frame of the lane that it aims at, and aims at the next
//! one as soon as it fits into a gap there. Until then it looks for a gap: it drives at the speed that brings it beside
//! one, and stops before its lane must be left.
//!
//! A gap is large enough if the vehicle behind has to brake with at most 4 m/s² and the agent no harder than is
//! comfortable: the safety criterion of MOBIL (Kesting, Treiber, Helbing, Transportation Research Record 1999, 2007, doi
//! 10.3141/1999-10, eq. 2), without its incentive, as the route demands the change, and with the deceleration that makes
//! the speeds equal in the room that is left. The sooner the change has to be done, the smaller the gaps that suffice. A
//! change that is under way is seen from the previous plan.
//!
//! It shows a change by its blinkers for 3 s before it begins, unless the change has to be done sooner.
//!
//! Where its lane leads elsewhere and a vehicle follows, an agent without a gap gives up its goal rather than stop in
//! traffic.

use super::arrival;
use super::comfort::Comfort;
use super::conflicts::Ego;
use super::driving_line::DrivingLine;
use super::frame::Start;
use super::lanes::{AIM_DISTANCE, Aim, Lane, Lanes, Need, SETTLED_OFFSET};
use super::neighbours::{Interval, Neighbours, Next, intervals};
use super::{LaneChange, PlanRequest};
use crate::conduct::FIRM_DECELERATION;
use crate::geometry::Pose;
use crate::geometry::polyline::ReferencePath;
use crate::route::Route;
use crate::rules::{Rules, RulesSettings, SHOWN_TIME, Way};
use crate::scenario::{Goal, Scenario};
use crate::turn::Turn;
use crate::vehicle::Vehicle;

/// Once a change is under way, neither the lag vehicle nor the agent must have to brake harder than this [m/s²], otherwise the
/// agent returns; before, the lag vehicle no harder than firmly.
const RETURN_DECELERATION: f64 = 6.0;
/// The lag vehicle begins to brake after this time [s].
const REACTION_TIME: f64 = 1.0;
/// Kept to the vehicles ahead and behind: at least this [m], and a time gap [s] ...
const GAP_MIN: f64 = 1.0;
const TIME_GAP: f64 = 0.5;
/// ... which shrinks to nothing as the time until the change must be done falls from the second to the first [s].
const HURRY: (f64, f64) = (4.0, 12.0);
/// Less time than this makes a change no more urgent [s].
const URGENT_TIME: f64 = 2.0;
/// A gentle change leads to the side at this speed: 3.5 m in 8 s [m/s].
const GENTLE_SPEED: f64 = 0.45;
/// An agent that has found no gap stops this far before the end of the stretch along which both lanes run [m], for each
/// change that is missing.
const END_MARGIN: f64 = 10.0;
/// An agent that seeks a gap is no slower than this share of the flow in its own lane, if a vehicle follows there, and not
/// slower at all as the time gap of that vehicle falls from the second to the first [s]; a flow that is slower than this
/// keeps its speed [m/s].
const FLOW_SHARE: f64 = 0.85;
const FLOW_TIME_GAP: (f64, f64) = (1.0, 2.0);
const FLOW_SPEED_MIN: f64 = 8.0;
/// A vehicle follows if it is where the agent is now within this time [s], at its speed or at this one [m/s]: it may
/// stand behind the agent.
const FOLLOWING_TIME: f64 = 4.0;
const STARTING_SPEED: f64 = 2.0;
/// The agent wants to be beside a gap after this time [s].
const SEEKING_TIME: f64 = 3.0;
/// A gap that is too small by 1 m counts as a change of speed by this [m/s].
const LACK_WEIGHT: f64 = 2.0;
/// So does each vehicle that the agent overtakes, or lets pass, for a gap [m/s].
const PASSING_WEIGHT: f64 = 1.0;
/// Vehicles up to this far away are looked at [m].
const VEHICLE_REACH: f64 = 250.0;
/// The agent is searched on a lane this far around the expected place [m].
const FOOT_WINDOW: f64 = 30.0;
/// A lane runs beside the route up to this distance [m]; it is examined in such steps [m].
const BESIDE_OFFSET: f64 = 8.0;
const BESIDE_STEP: f64 = 2.0;

/// What a gap must leave.
#[derive(Debug, Clone, Copy)]
struct Criterion {
    gap_min: f64,
    time_gap: f64,
    /// Decelerations of the agent and of the lag vehicle [m/s²].
    own: f64,
    lag: f64,
}

/// The lanes of a route with lane changes, each as a route of its own.
#[derive(Debug, Clone)]
pub struct LaneRoutes {
    lanes: Lanes,
    routes: Vec<Route>,
    /// The line in each, for an agent that does not keep to its middle.
    lines: Vec<Option<DrivingLine>>,
}

impl LaneRoutes {
    /// `None` if the route has no lane changes, passes a lanelet twice, or one of its lanes makes no path: then the agent
    /// drives along the reference path.
    pub(in crate::plan) fn along(
        (route, goal): (&Route, &Goal),
        line_of: Option<&Vehicle>,
        scenario: &Scenario,
        rules: &RulesSettings,
    ) -> Option<Self> {
        let passes_twice = (1..route.lanelets.len()).any(|i| route.lanelets[..i].contains(&route.lanelets[i]));
        if route.lane_changes == 0 || passes_twice {
            return None;
        }
        let lanes = Lanes::of(route, goal, scenario, rules).ok()?;
        let routes = lanes.lanes.iter().map(|lane| {
            let shift = shift(route, &lane.path);
            Route {
                start_s: route.start_s + shift,
                goal_entry_s: route.goal_entry_s + shift,
                goal_exit_s: route.goal_exit_s + shift,
                path: lane.path.clone(),
                ..route.clone()
            }
        });
        let line =
            |lane: &Lane, vehicle| DrivingLine::within(&lane.path, vehicle, |s| Some(lane.bounds(s, &scenario.road)));
        let lines = lanes.lanes.iter().map(|lane| line_of.map(|vehicle| line(lane, vehicle)));
        Some(Self { routes: routes.collect(), lines: lines.collect(), lanes })
    }

    /// The request in the frame of the lane that the agent aims at; as it is if it cannot plan along it, or begins in a lane
    /// that does not lead to the goal.
    pub(in crate::plan) fn aim<'a>(&'a self, request: &PlanRequest<'a>, comfort: &Comfort) -> PlanRequest<'a> {
        let leads_on = |aim: &Aim| {
            // Beyond the last chance an agent stays in its lane.
            let leads_on = request.previous.is_some() || self.lanes.lanes[aim.lane].need(aim.s).is_some();
            leads_on && self.is_along(request, aim)
        };
        let Some(aim) = self.lanes.aimed_at(request, AIM_DISTANCE).filter(leads_on) else { return *request };
        let (aim, lane_change) = self.choose(request, comfort, aim);
        PlanRequest { lane_change, ..self.on(request, aim) }
    }

    /// As `Lanes::way_below`.
    pub(in crate::plan) fn way_below(&self, rear_axle: Pose) -> Option<(&Way, f64)> {
        self.lanes.way_below(rear_axle)
    }

    fn on<'a>(&'a self, request: &PlanRequest<'a>, aim: Aim) -> PlanRequest<'a> {
        let rules = Rules { way: &self.lanes.lanes[aim.lane].way, ..request.rules };
        PlanRequest {
            route: &self.routes[aim.lane],
            line: self.lines[aim.lane].as_ref(),
            s_hint: aim.s,
            rules,
            ..*request
        }
    }

    /// The lane to drive in, and what the change asks of the agent.
    fn choose(&self, request: &PlanRequest, comfort: &Comfort, aim: Aim) -> (Aim, LaneChange) {
        let lanes = &self.lanes.lanes;
        let beside = self.lanes.beside(aim.lane, aim.s, request.road);
        let velocity = request.state.velocity.max(0.0);
        let front = |s: f64| s + request.vehicle.rear_axle_to_center + 0.5 * request.vehicle.length;
        let missing = |lane: usize, s: f64| lanes[lane].need(s).map_or(usize::MAX, |need| need.changes);
        let end = |need: &Need| need.lane_end - END_MARGIN * need.changes as f64;
        let way_to_stop = 0.5 * velocity * velocity / comfort.deceleration;
        let can_stop = |s: f64, need: &Need| front(s) + way_to_stop <= need.lane_end;
        let here = missing(aim.lane, aim.s);
        // A change is over on the line of the new lane.
        let offset = aim.d - self.lines[aim.lane].as_ref().map_or(0.0, |line| line.at(aim.s).offset);
        let origin = beside[usize::from(offset < 0.0)]
            .filter(|(lane, s)| offset.abs() > SETTLED_OFFSET && missing(*lane, *s) > here)
            .and_then(|(lane, s)| self.in_lane(request, lane, s));
        if let Some(origin) = origin {
            let need = lanes[origin.lane].need(origin.s);
            let half = 0.5 * lanes[aim.lane].width(aim.s, request.road);
            let (own, lag) = (RETURN_DECELERATION, RETURN_DECELERATION);
            let is_safe = self.fits(request, Criterion { gap_min: 0.0, time_gap: 0.0, own, lag }, aim);
            // Back only while it is mostly in the lane that it leaves, and can still stop there.
            if let Some(need) = need.filter(|need| aim.d.abs() > half && !is_safe && can_stop(origin.s, need)) {
                return (origin, LaneChange { end: end(&need), ..LaneChange::default() });
            }
            let time = need.map_or(0.0, |need| (need.last_chance - front(origin.s)) / velocity.max(1.0));
            let change = LaneChange {
                is_accepted: is_safe,
                urgency: urgency(offset, time),
                side: request.change_to(&aim, half),
                ..LaneChange::default()
            };
            return (aim, change);
        }
        let Some(need) = lanes[aim.lane].need(aim.s) else {
            // Its goal is elsewhere: it drives on with the traffic.
            let limit = Some(lanes[aim.lane].way.limits.at(aim.s)).filter(|limit| limit.is_finite());
            let velocity = limit.unwrap_or(request.entry.velocity.max(comfort.cruise_velocity_min));
            return (aim, LaneChange { velocity: Some(velocity), ..LaneChange::default() });
        };
        if need.changes == 0 {
            // The lane that it has left may end beside it before the change is over.
            let half = 0.5 * lanes[aim.lane].width(aim.s, request.road);
            let side = request.change_to(&aim, half).filter(|_| offset.abs() > SETTLED_OFFSET);
            return (aim, LaneChange { side, ..LaneChange::default() });
        }
        let follower = self.follower(request, aim);
        // Once it cannot stop comfortably any more, it does not stop because the vehicle behind has fallen back.
        let gives_up = need.goes_on && (follower.is_some() || front(aim.s) + way_to_stop > end(&need));
        let waiting = LaneChange { end: if gives_up { f64::INFINITY } else { end(&need) }, ..LaneChange::default() };
        let next = beside.into_iter().flatten().find(|(lane, s)| missing(*lane, *s) < need.changes);
        let there = next.and_then(|(lane, s)| self.in_lane(request, lane, s));
        let Some(there) = there.filter(|there| self.is_along(request, there)) else { return (aim, waiting) };
        let time = (need.last_chance - front(aim.s)) / velocity.max(1.0) / need.changes as f64;
        let time_gap = time_gap(time);
        let (own, lag) = (comfort.deceleration, FIRM_DECELERATION);
        let side = there.side();
        let is_shown = time < HURRY.0 || has_shown(request, side) || self.enters_changing(request, &aim, side);
        let is_accepted = is_shown && self.fits(request, Criterion { gap_min: GAP_MIN, time_gap, own, lag }, there);
        // Too late to wait: it changes as far as contacts allow.
        if is_accepted || !gives_up && !can_stop(aim.s, &need) {
            let change =
                LaneChange { is_accepted, urgency: urgency(there.d, time), side: Some(side), ..LaneChange::default() };
            return (there, change);
        }
        let velocity = self.seek(request, comfort, (aim, there), (follower, waiting.end));
        (aim, LaneChange { velocity, side: Some(side), ..waiting })
    }

    /// The agent enters in the middle of a change to a side: beside its lane's middle, and moving on as fast as it would in a
    /// gentle one.
    fn enters_changing(&self, request: &PlanRequest, aim: &Aim, side: Turn) -> bool {
        let sign = if side == Turn::Left { 1.0 } else { -1.0 };
        let along = self.lanes.lanes[aim.lane].path.at(aim.s).theta;
        let aside = request.state.velocity * (request.state.orientation - along).sin();
        request.previous.is_none() && sign * aim.d > SETTLED_OFFSET && sign * aside > GENTLE_SPEED
    }

    /// The agent can plan in the frame of the lane: it does not head across it, as before a turn into it.
    fn is_along(&self, request: &PlanRequest, aim: &Aim) -> bool {
        Start::on(&self.lanes.lanes[aim.lane].path, aim.s, &request.state, request.vehicle, false).is_ok()
    }

    /// The place of the agent on a lane, near an arc length [m].
    fn in_lane(&self, request: &PlanRequest, lane: usize, s: f64) -> Option<Aim> {
        let axle = request.vehicle.rear_axle_from_center(request.state.pose());
        let (s, d) = self.lanes.lanes[lane].path.project_near(axle, s, FOOT_WINDOW)?;
        Some(Aim { lane, s, d })
    }

    /// No vehicle is beside the agent on a lane, and the gap there leaves the required distances.
    fn fits(&self, request: &PlanRequest, criterion: Criterion, there: Aim) -> bool {
        let velocity = request.state.velocity.max(0.0);
        let Neighbours { leader, follower } =
            Neighbours::of(request, &self.lanes.lanes[there.lane], &self.ego(request, there));
        let Criterion { gap_min, time_gap, own, lag } = criterion;
        let lead_is_safe = |Next { gap, velocity: lead }| {
            required_deceleration(gap - gap_min - time_gap * velocity, velocity - lead, 0.0) <= own
        };
        let lag_is_safe = |Next { gap, velocity: behind }| {
            required_deceleration(gap - gap_min - time_gap * behind.max(0.0), behind - velocity, REACTION_TIME) <= lag
        };
        leader.is_none_or(lead_is_safe) && follower.is_none_or(lag_is_safe)
    }

    /// Speed of the vehicle behind the agent in its lane [m/s] that a stop would hold up, or does, and the room between
    /// them [m].
    fn follower(&self, request: &PlanRequest, aim: Aim) -> Option<(f64, f64)> {
        let rear = -0.5 * request.vehicle.length;
        let behind = intervals(request, &self.lanes.lanes[aim.lane], &self.ego(request, aim))
            .filter(|other| other.is_traffic && other.middle() < 0.0)
            .max_by(|a, b| a.front.total_cmp(&b.front))?;
        let reach = FOLLOWING_TIME * behind.velocity.max(STARTING_SPEED);
        (rear - behind.front < reach).then_some((behind.velocity.max(0.0), rear - behind.front))
    }

    fn ego(&self, request: &PlanRequest, aim: Aim) -> Ego<'_> {
        let path = &self.lanes.lanes[aim.lane].path;
        Ego { reach: VEHICLE_REACH, ..Ego::new(request, path, (aim.s, request.state.velocity.max(0.0), 0.0), 1.0) }
    }

    /// The speed with which the agent comes beside the gap that takes the smallest change of its speed [m/s], where a gap
    /// that is too small counts for less, and one beyond the vehicle ahead not at all. It is the mean speed on the way
    /// there, so that the agent keeps pace with the gap once it is beside it, and leaves the whole time gap whatever the
    /// hurry. `None` if the agent heads across its lane.
    fn seek(
        &self,
        request: &PlanRequest,
        comfort: &Comfort,
        (here, there): (Aim, Aim),
        (follower, end): (Option<(f64, f64)>, f64),
    ) -> Option<f64> {
        let (along, time) = (self.on(request, here), SEEKING_TIME);
        let start = Start::on(&along.route.path, here.s, &request.state, request.vehicle, false).ok()?;
        let (wish, _) = arrival::desired(
            &along,
            (start.s, start.velocity),
            comfort.deceleration,
            comfort.cruise_velocity_min,
            Some(0.0),
        );
        let (velocity, step) = (start.velocity, comfort.velocity_step);
        let wish = wish.clamp((velocity - step).max(0.0), velocity + step);
        let half = 0.5 * request.vehicle.length;
        let room = |other: &Interval| half + GAP_MIN + TIME_GAP * other.velocity.max(0.0);
        let behind = |other: &Interval| other.rear + other.velocity * time - room(other);
        let ahead = |other: &Interval| other.front + other.velocity * time + room(other);
        // Everything relative to the agent's centre.
        let mut others: Vec<Interval> =
            intervals(request, &self.lanes.lanes[there.lane], &self.ego(request, there)).collect();
        others.sort_by(|a, b| a.middle().total_cmp(&b.middle()));
        let ego = self.ego(request, here);
        let leaders = intervals(request, &self.lanes.lanes[here.lane], &ego);
        let leaders = leaders.filter(|other| other.middle() > 0.0).map(|other| behind(&other));
        let lane_end = end - (here.s + request.vehicle.rear_axle_to_center + half);
        let behind_leader = leaders.fold(f64::INFINITY, f64::min);
        let furthest = behind_leader.min(lane_end);
        let flow = follower.map_or(0.0, |(velocity, _)| velocity.min(wish));
        // Shortly before the end of its lane a gap counts more than the vehicle behind.
        let near = follower.filter(|_| lane_end > HURRY.1 * velocity).map_or(0.0, |(velocity, room)| {
            let (least, most) = FLOW_TIME_GAP;
            ((most - room / velocity.max(STARTING_SPEED)) / (most - least)).clamp(0.0, 1.0)
        });
        let slowest = ((FLOW_SHARE + near * (1.0 - FLOW_SHARE)) * flow).max(flow.min(FLOW_SPEED_MIN));
        let to_the_left = there.d < 0.0;
        let place = others.iter().filter(|other| !other.is_ahead(to_the_left)).count();
        let (mut least, mut best) = (f64::INFINITY, wish);
        for i in 0..=others.len() {
            let low = i.checked_sub(1).map_or(f64::NEG_INFINITY, |k| ahead(&others[k]));
            let high = others.get(i).map_or(f64::INFINITY, behind).min(furthest);
            // What leads in its own lane would keep it from there, and beside the vehicle that it wants to pass.
            if low > behind_leader {
                continue;
            }
            let lack = (low - high).max(0.0);
            let way = if lack > 0.0 { 0.5 * (low + high) } else { (wish * time).clamp(low, high) };
            let speed = way / time;
            let passed = i.abs_diff(place) as f64;
            let cost = (speed - wish).abs() + LACK_WEIGHT * lack + PASSING_WEIGHT * passed;
            if cost < least {
                (least, best) = (cost, speed.max(slowest).clamp(0.0, velocity + step));
            }
        }
        Some(best)
    }
}

/// How much further a place beside a route is on a lane than on the route [m]: where the lane runs beside it for the last
/// time before the goal.
fn shift(route: &Route, lane: &ReferencePath) -> f64 {
    let last = if route.goal_entry_s.is_nan() { route.path.length() } else { route.goal_entry_s };
    let n = ((last - route.start_s) / BESIDE_STEP).max(0.0) as usize;
    let mut found: Option<f64> = None;
    for s in (0..=n).map(|i| route.start_s + i as f64 * BESIDE_STEP) {
        let place = route.path.at(s).position;
        let foot = match found {
            Some(shift) => lane.project_near(place, s + shift, FOOT_WINDOW),
            None => lane.project(place),
        };
        if let Some((there, _)) = foot.filter(|(_, d)| d.abs() < BESIDE_OFFSET) {
            found = Some(there - s);
        }
    }
    found.unwrap_or(0.0)
}

/// The agent has shown a change to a side for long enough, or shows none.
fn has_shown(request: &PlanRequest, side: Turn) -> bool {
    let shows = request.rules.settings.enabled && request.rules.settings.blinkers;
    !shows || request.indicator.steps(side, request.time_step) as f64 * request.dt >= SHOWN_TIME
}

/// Time gap that is kept if the change must be done within a time [s].
fn time_gap(time: f64) -> f64 {
    TIME_GAP * ((time - HURRY.0) / (HURRY.1 - HURRY.0)).clamp(0.0, 1.0)
}

/// How much more an offset counts [m] if it must be given up within a time [s]: as much as a gentle change takes longer.
fn urgency(offset: f64, time: f64) -> f64 {
    (offset.abs() / GENTLE_SPEED / time.max(URGENT_TIME)).max(1.0)
}

/// The constant deceleration with which a vehicle that is faster than the one ahead by some speed [m/s] comes down to its
/// speed within some room [m], if it begins after a reaction time [s]; infinite if there is no room [m/s²].
pub(super) fn required_deceleration(room: f64, faster: f64, reaction: f64) -> f64 {
    let faster = faster.max(0.0);
    let room = room - reaction * faster;
    if room <= 0.0 { f64::INFINITY } else { 0.5 * faster * faster / room }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_of_a_gap_decides_how_hard_the_one_behind_brakes() {
        for (room, faster, reaction, expected) in [
            (10.0, -3.0, 1.0, 0.0),
            (10.0, 0.0, 1.0, 0.0),
            // 4² / (2 2)
            (2.0, 4.0, 0.0, 4.0),
            // 8² / (2 (16 - 8))
            (16.0, 8.0, 1.0, 4.0),
            (8.0, 8.0, 1.0, f64::INFINITY),
            (0.0, -1.0, 0.0, f64::INFINITY),
        ] {
            assert_eq!(required_deceleration(room, faster, reaction), expected, "{room} m, {faster} m/s, {reaction} s");
        }
    }

    #[test]
    fn the_time_gap_that_is_kept_shrinks_with_the_time_that_is_left() {
        for (time, expected) in [(20.0, 0.5), (12.0, 0.5), (8.0, 0.25), (4.0, 0.0), (-1.0, 0.0)] {
            assert!((time_gap(time) - expected).abs() < 1e-12, "{time} s");
        }
    }

    #[test]
    fn a_change_is_urgent_where_a_gentle_one_takes_longer_than_there_is_time() {
        // 3.5 m take 7.8 s.
        for (offset, time, expected) in [(3.5, 10.0, 1.0), (-3.5, 5.0, 1.556), (1.75, 5.0, 1.0), (3.5, 0.0, 3.889)] {
            assert!((urgency(offset, time) - expected).abs() < 1e-3, "{offset} m, {time} s");
        }
    }
}
