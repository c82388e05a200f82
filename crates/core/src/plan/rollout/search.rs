//! Which proposals are driven, and which of them is the best.

use std::cmp::Ordering;
use std::rc::Rc;

use super::super::PlanRequest;
use super::super::conflicts::Ego;
use super::super::driven_point::DrivenPoint;
use super::super::frame::project;
use super::super::passing::{Obstructions, Place};
use super::contacts::Contact;
use super::settings::{N_TERMS, RolloutSettings};
use super::speeds::{Pace, Speeds, Task, WALKING_SPEED};
use super::start::Start;
use super::steering::{Along, Rollout, Steering};
use super::{DANGER_COST, RolloutMemory};

/// An offset is given up in about this time [s]: the corridor in which others count shrinks so fast.
const RETURN_TIME: f64 = 2.5;
/// Plans that cost more than this in the lane look beside its middle.
const HELD_UP_COST: f64 = 1.0;
/// A plan is better than another one if it costs less by this.
const BETTER_COST: f64 = 1.0;
/// Ways beside the middle of the lane [m].
const ASIDE: [f64; 4] = [0.5, -0.5, 1.0, -1.0];
/// A way that is further from where the agent is may be taken gently or quickly [m].
const STEERING_OFFSET: f64 = 0.5;
/// Plans that cost more where the road is narrow swing out first.
const STUCK_COST: f64 = 3.0;
/// Swinging out costs this from the beginning: the wheels are turned for more than the cost sees.
const SWING_COST: f64 = 0.5;
/// Shares of the tightest curvature, and times for which they are held [s], of vehicles that swing out.
const SWINGS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
const SWING_TIMES: [f64; 2] = [0.8, 2.0];
/// Shares of the vehicle's largest deceleration with which it brakes in an emergency.
const EMERGENCIES: [f64; 3] = [0.9, 0.6, 0.4];
/// How far an agent swerves [m].
const SWERVES: [f64; 6] = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0];
/// Those who stand and whom the footprint misses by this are no leaders [m].
const SPARED: f64 = 0.1;

/// The middle of the lane.
const MIDDLE: (f64, Along) = (0.0, Along::Line);

/// A way to drive, with what its speeds cost.
struct Proposal {
    bound: f64,
    /// Of equal bounds the first is driven first: way, pace and steering.
    order: [usize; 3],
    terms: [f64; 4],
    /// Offset that it drives to [m], and what that is counted from.
    target: (f64, Along),
    pace: Pace,
    steering: Steering,
    speeds: Rc<Speeds>,
    is_emergency: bool,
}

impl Proposal {
    fn is_before(&self, other: &Self) -> Ordering {
        self.bound.total_cmp(&other.bound).then(self.order.cmp(&other.order))
    }
}

/// A pace on a way whose speeds are looked for only where the least that they can cost is less than the best.
struct Postponed {
    bound: f64,
    order: [usize; 3],
    pace: Pace,
    target: (f64, Along),
}

/// A roll-out with its cost.
pub(super) struct Evaluated<'a> {
    pub(super) rollout: &'a Rollout,
    pub(super) terms: [f64; N_TERMS],
    pub(super) cost: f64,
    pub(super) pace: Pace,
    pub(super) contact: Option<Contact>,
}

/// The best that was driven.
#[derive(Debug, Clone)]
pub(super) struct Best {
    pub(super) cost: f64,
    pub(super) is_emergency: bool,
    pub(super) rollout: Rollout,
    pub(super) contact: Option<Contact>,
    /// What it costs without what is near it.
    alone: f64,
    /// What a better plan would touch.
    pub(super) held: Option<Held>,
    /// Desired speed on a free and straight road [m/s].
    pub(super) wish: f64,
    /// How far it comes [m].
    pub(super) way: f64,
}

/// A roll-out that was not taken because of a contact, or because it leaves the road.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    /// What it costs without what is near it.
    alone: f64,
    pub(super) contact: Contact,
    /// Where it is then.
    pub(super) point: DrivenPoint,
}

/// The search for one plan.
pub(super) struct Search<'a> {
    pub(super) task: Task<'a>,
    settings: &'a RolloutSettings,
    pub(super) memory: &'a mut RolloutMemory,
    free: Speeds,
    pub(super) obstructions: Obstructions,
    /// The offset for which the conflicts were looked for last [m].
    looked: Option<f64>,
    /// Speeds at the paces that were asked for among the present conflicts.
    known: Vec<(Pace, Option<Rc<Speeds>>)>,
    /// Where the plan before ends, across the path [m].
    before: Option<f64>,
    /// A roll-out left the road.
    is_narrow: bool,
    best: Option<Best>,
    /// Of the roll-outs that touch something, or leave the road, the one that would cost least otherwise.
    held: Option<Held>,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        request: &'a PlanRequest<'a>,
        settings: &'a RolloutSettings,
        start: Start,
        memory: &'a mut RolloutMemory,
    ) -> Self {
        let n_points = (settings.horizon / request.dt).round().max(1.0) as usize + 1;
        let task = Task::new(request, &settings.comfort, start, n_points);
        memory.road_speeds.fill(&task);
        memory.surroundings.prepare(request, settings, &start, n_points);
        let free = Speeds::free(&task, &memory.road_speeds);
        let obstructions = Obstructions::ahead(
            request,
            &Place { s: start.s, d: start.d, velocity: start.velocity },
            (settings.comfort.deceleration, settings.comfort.standstill_gap),
        );
        let before = previous_offset(request);
        Self {
            task,
            settings,
            memory,
            free,
            obstructions,
            looked: None,
            known: Vec::new(),
            before,
            is_narrow: false,
            best: None,
            held: None,
        }
    }

    /// The lane first; beside its middle if something is in the way; swinging out where the road is narrow; emergencies.
    pub(super) fn run(mut self) -> Best {
        if let Some(rollout) = self.reverse_on() {
            self.recover(rollout);
            return self.end();
        }
        self.drive_beside(&[MIDDLE]);
        if self.cost() > HELD_UP_COST {
            let aside = ASIDE.iter().map(|aside| (*aside, Along::Line));
            let around = self.obstructions.beside.iter().map(|offset| (*offset, Along::Path));
            let ways: Vec<(f64, Along)> = aside.chain(around).collect();
            self.drive_beside(&ways);
        }
        if self.is_narrow && self.cost() > STUCK_COST {
            self.swing_out();
        }
        if self.is_in_danger() {
            self.evade();
        }
        let comes = self.best.as_ref().map_or(0.0, |best| best.way);
        if let Some(rollout) = self.settings.reverse.then(|| self.reverse(comes)).flatten() {
            self.recover(rollout);
        }
        self.end()
    }

    fn end(self) -> Best {
        let best = self.best.expect("an agent can always brake");
        Best { held: self.held.filter(|held| held.alone + BETTER_COST < best.alone), ..best }
    }

    /// Drives back, whatever else was better.
    fn recover(&mut self, rollout: Rollout) {
        let request = self.task.request;
        let (velocity, acceleration) = rollout.points.iter().map(|point| (point.velocity, point.acceleration)).unzip();
        let speeds = Speeds { velocity, acceleration, s: self.task.start.s };
        let mut terms = [0.0; N_TERMS];
        terms[..4].copy_from_slice(&speeds.terms(&self.free, (self.task.acceleration(), request.dt)));
        let cost = self.settings.weights.as_array().iter().zip(&terms).map(|(weight, term)| weight * term).sum();
        self.memory
            .log
            .record(request, &Evaluated { rollout: &rollout, terms, cost, pace: Pace::Reversing, contact: None });
        self.best = Some(Best {
            cost,
            is_emergency: false,
            rollout,
            contact: None,
            alone: cost,
            held: None,
            wish: self.task.wish,
            way: 0.0,
        });
    }

    /// It stays on the road and keeps its margins.
    pub(super) fn is_free(&mut self, rollout: &Rollout) -> bool {
        let request = self.task.request;
        leaves_road(request, rollout, 0.0).is_none()
            && self.memory.surroundings.first_contact(request, &rollout.points, 1.0).is_none()
    }

    /// The point at which it comes too near to the edge of the road or to another participant.
    pub(super) fn first_fault(&mut self, rollout: &Rollout) -> Option<usize> {
        let request = self.task.request;
        let off_road = leaves_road(request, rollout, self.settings.road_margin);
        let contact = self.memory.surroundings.first_contact(request, &rollout.points, 1.0);
        off_road.into_iter().chain(contact).map(|found| found.point).min()
    }

    fn cost(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |best| best.cost)
    }

    fn is_in_danger(&self) -> bool {
        self.best.as_ref().is_none_or(|best| best.contact.is_some() && best.cost > DANGER_COST)
    }

    /// The vehicle on a way; `conflicts` are those there.
    pub(super) fn look(&mut self, target: f64) -> Ego<'a> {
        let Start { s, d, velocity, .. } = self.task.start;
        let request = self.task.request;
        let ego = Ego { target, ..Ego::new(request, &request.route.path, (s, velocity, d), RETURN_TIME) };
        let looked = self.looked.replace(target);
        if looked == Some(target) {
            return ego;
        }
        let mut barriers = request.barriers(request.rules.way, s);
        barriers.extend(self.obstructions.wait);
        let conflicts = &mut self.memory.conflicts;
        match looked {
            None => conflicts.collect(request, &ego, self.task.n_points, barriers),
            Some(_) => conflicts.collect_again(request, &ego, self.task.n_points, barriers),
        }
        conflicts.spare_untouched(request, &ego, SPARED);
        if looked.is_none() || !conflicts.is_as_before() {
            self.known.clear();
        }
        ego
    }

    /// Speeds at a pace among the present conflicts.
    pub(super) fn speeds(&mut self, pace: Pace, ego: &Ego) -> Option<Rc<Speeds>> {
        if let Some((_, speeds)) = self.known.iter().find(|(known, _)| *known == pace) {
            return speeds.clone();
        }
        let RolloutMemory { conflicts, road_speeds, .. } = &mut *self.memory;
        let speeds = Speeds::at(&self.task, (pace, ego), (conflicts, road_speeds), &self.free).map(Rc::new);
        self.known.push((pace, speeds.clone()));
        speeds
    }

    fn proposal(&self, pace: Pace, (target, steering): ((f64, Along), Steering), speeds: Rc<Speeds>) -> Proposal {
        let terms = speeds.terms(&self.free, (self.task.acceleration(), self.task.request.dt));
        let bound = Speeds::cost(terms, &self.settings.weights);
        Proposal { bound, order: [0; 3], terms, target, pace, steering, speeds, is_emergency: false }
    }

    /// Drives ways along the path.
    fn drive_beside(&mut self, targets: &[(f64, Along)]) {
        let (mut proposals, mut postponed) = (Vec::new(), Vec::new());
        for (way, &target) in targets.iter().enumerate() {
            let ego = self.look(self.offset_of(target));
            let mut paces = vec![Pace::Social];
            if self.memory.conflicts.has_later() {
                paces.push(Pace::Bold);
            }
            paces.extend([Pace::Stopping, Pace::Braking]);
            if self.task.start.velocity < WALKING_SPEED {
                paces.push(Pace::Walking);
            }
            for (place, pace) in paces.into_iter().enumerate() {
                let one = Postponed { bound: self.least_cost(pace), order: [way, place, 0], pace, target };
                if one.bound > 0.0 {
                    postponed.push(one);
                } else {
                    self.propose(&one, &ego, &mut proposals);
                }
            }
        }
        self.choose(proposals, postponed);
    }

    /// What the speeds of a pace cost at least.
    fn least_cost(&self, pace: Pace) -> f64 {
        /// Rounding.
        const SAFETY: f64 = 1.0 - 1e-9;
        let terms = pace.least_terms(&self.task, &self.free);
        SAFETY * Speeds::cost(terms, &self.settings.weights)
    }

    /// Distance from the reference path [m].
    fn offset_of(&self, (target, along): (f64, Along)) -> f64 {
        match along {
            Along::Line => target + self.task.request.line_at(self.task.start.s).offset,
            Along::Path => target,
        }
    }

    /// Adds what can be driven at a pace on a way. Of equal speeds there the first pace is kept.
    fn propose(&mut self, one: &Postponed, ego: &Ego, proposals: &mut Vec<Proposal>) {
        let Postponed { order: [way, place, _], pace, target, .. } = *one;
        let Some(speeds) = self.speeds(pace, ego) else { return };
        let is_equal = |known: &Proposal| known.order[0] == way && known.speeds == speeds;
        if proposals.iter().any(|known| known.order[1] < place && is_equal(known)) {
            return;
        }
        proposals.retain(|known| !is_equal(known));
        let is_far = (self.task.start.d - ego.target).abs() > STEERING_OFFSET;
        let steerings = [Steering::GENTLE, Steering::BRISK, Steering::QUICK, Steering::FIRM];
        for (i, steering) in steerings.into_iter().enumerate().skip(if is_far { 0 } else { 3 }) {
            let proposal = self.proposal(pace, (target, steering), speeds.clone());
            proposals.push(Proposal { order: [way, place, i], ..proposal });
        }
    }

    /// Turns the wheels first, where the road is too narrow to follow the path.
    fn swing_out(&mut self) {
        let ego = self.look(0.0);
        let mut proposals = Vec::new();
        for pace in [Pace::Social, Pace::Half, Pace::Walking] {
            let Some(speeds) = self.speeds(pace, &ego) else { continue };
            proposals.push(self.proposal(pace, (MIDDLE, Steering::FIRM), speeds.clone()));
            for share in SWINGS {
                for time in SWING_TIMES {
                    let one = self.proposal(pace, (MIDDLE, Steering::swinging(share, time)), speeds.clone());
                    proposals.push(Proposal { bound: one.bound + SWING_COST, ..one });
                }
            }
        }
        self.choose(in_turn(proposals), Vec::new());
    }

    /// Swerves and brakes as hard as the vehicle can.
    fn evade(&mut self) {
        let ego = self.look(0.0);
        let d = self.task.start.d;
        let mut proposals = Vec::new();
        let slowing = self.speeds(Pace::Braking, &ego).expect("an agent can always brake");
        for (pace, speeds) in [(Pace::Social, Rc::new(self.free.clone())), (Pace::Braking, slowing)] {
            for swerve in SWERVES {
                proposals.push(self.proposal(pace, ((d + swerve, Along::Path), Steering::QUICK), speeds.clone()));
            }
        }
        for pace in EMERGENCIES.map(Pace::Emergency) {
            let speeds = self.speeds(pace, &ego).expect("an agent can always brake");
            for offset in [0.0, d] {
                proposals.push(self.proposal(pace, ((offset, Along::Path), Steering::FIRM), speeds.clone()));
            }
        }
        proposals.iter_mut().for_each(|one| one.is_emergency = true);
        self.choose(in_turn(proposals), Vec::new());
    }

    /// Drives what may be better than the best, by increasing bounds.
    fn choose(&mut self, mut proposals: Vec<Proposal>, mut postponed: Vec<Postponed>) {
        // The next one is the last one.
        proposals.sort_by(|a, b| b.is_before(a));
        postponed.sort_by(|a, b| b.bound.total_cmp(&a.bound).then(b.order.cmp(&a.order)));
        loop {
            let next = proposals.last().map_or(f64::INFINITY, |one| one.bound);
            if let Some(one) = postponed.pop_if(|one| one.bound <= next) {
                if self.cost() <= one.bound {
                    break;
                }
                let ego = self.look(self.offset_of(one.target));
                self.propose(&one, &ego, &mut proposals);
                proposals.sort_by(|a, b| b.is_before(a));
                continue;
            }
            let Some(proposal) = proposals.pop() else { break };
            if self.cost() <= proposal.bound {
                break;
            }
            if !self.drive(&proposal, proposal.target.1, proposal.steering) || proposal.steering != Steering::FIRM {
                continue;
            }
            // Where the road is narrow, its middle is better than the line.
            for steering in Steering::CORNERING {
                if !self.drive(&proposal, Along::Path, steering) {
                    break;
                }
            }
        }
    }

    /// Drives one proposal; says whether it leaves the road.
    fn drive(&mut self, proposal: &Proposal, along: Along, steering: Steering) -> bool {
        let request = self.task.request;
        let weights = &self.settings.weights;
        let mut rollout = std::mem::take(&mut self.memory.rollout);
        self.memory.effort += 1;
        let mut terms = [0.0; N_TERMS];
        terms[..4].copy_from_slice(&proposal.terms);
        let price = |terms: &[f64; N_TERMS]| {
            // What the proposal costs beyond its speeds.
            let extra = proposal.bound - Speeds::cost(proposal.terms, weights);
            extra + weights.as_array().iter().zip(terms).map(|(weight, term)| weight * term).sum::<f64>()
        };
        let best = self.cost();
        let steered = |rollout: &Rollout| [rollout.lateral, request.lane_change.urgency * rollout.offset];
        // The integrals only grow, and so does their price, rounding included.
        let is_too_dear = |rollout: &Rollout| {
            let mut terms = terms;
            terms[4..6].copy_from_slice(&steered(rollout));
            best <= price(&terms)
        };
        let way = (proposal.target.0, along);
        if !rollout.drive_unless(request, &self.task.start, way, &proposal.speeds, steering, is_too_dear) {
            self.memory.rollout = rollout;
            return true;
        }
        terms[4..6].copy_from_slice(&steered(&rollout));
        terms[6] = self.before.map_or(0.0, |d| (rollout.beside - d).abs());
        if best <= price(&terms) {
            self.memory.rollout = rollout;
            return true;
        }
        let dt = request.dt;
        let mut off_road = leaves_road(request, &rollout, self.settings.road_margin);
        terms[8] = f64::from(off_road.is_some());
        // A footprint with its margin may never be on the road where the footprint itself is, and leaves again.
        if off_road.is_some() || !request.was_on_road {
            off_road = leaves_road(request, &rollout, 0.0);
        }
        let surroundings = &self.memory.surroundings;
        let mut contact = surroundings.first_contact(request, &rollout.points, 1.0);
        if contact.is_some() {
            contact = surroundings.first_contact(request, &rollout.points, 0.0);
            terms[9] = match contact {
                Some(_) => 1.0,
                None => surroundings.missing_margin(request, &rollout.points, self.settings),
            };
        }
        terms[10] = contact.map_or(0.0, |contact| contact.severity(dt));
        terms[11] = off_road.map_or(0.0, |contact| contact.severity(dt));
        let first = contact.or(off_road);
        if first.is_none() {
            terms[7] = surroundings.nearness(request, &rollout.points);
        }
        let cost = price(&terms);
        let evaluated = Evaluated { rollout: &rollout, terms, cost, pace: proposal.pace, contact: first };
        self.memory.log.record(request, &evaluated);
        self.is_narrow |= off_road.is_some();
        // What is near counts from the nearness on.
        terms[7..].fill(0.0);
        let alone = price(&terms);
        if let Some(contact) = first.filter(|_| self.held.is_none_or(|held| alone < held.alone)) {
            self.held = Some(Held { alone, contact, point: rollout.points[contact.point] });
        }
        if cost < self.cost() {
            let is_emergency = proposal.is_emergency;
            let way = proposal.speeds.s - self.task.start.s;
            let (rollout, wish) = (rollout.clone(), self.task.wish);
            let best = Best { cost, is_emergency, rollout, contact: first, alone, held: None, wish, way };
            self.best = Some(best);
        }
        self.memory.rollout = rollout;
        off_road.is_some()
    }
}

/// Of equal bounds the one that was made first is driven first.
fn in_turn(mut proposals: Vec<Proposal>) -> Vec<Proposal> {
    proposals.iter_mut().enumerate().for_each(|(i, one)| one.order[0] = i);
    proposals
}

/// Offset at which the plan before ends [m].
fn previous_offset(request: &PlanRequest) -> Option<f64> {
    let last = request.previous?.points.last().filter(|point| point.is_finite())?;
    let axle = request.vehicle.rear_axle_from_center(last.pose());
    project(&request.route.path, axle, request.s_hint + 3.0 * request.state.velocity)
        .map(|(s, d)| d - request.line_at(s).offset)
}

/// Where the footprint, larger by a margin [m], leaves the road once it is fully on it.
fn leaves_road(request: &PlanRequest, rollout: &Rollout, margin: f64) -> Option<Contact> {
    let mut was_on_road = request.was_on_road;
    let mut before = rollout.points[0].footprint(request).grown(margin);
    for (i, point) in rollout.points.iter().enumerate().skip(1) {
        let footprint = point.footprint(request).grown(margin);
        if was_on_road && !request.road.admits_motion(request.vehicle, &before, &footprint) {
            return Some(Contact { point: i, speed: point.velocity, other: None });
        }
        was_on_road = was_on_road || request.road.box_is_covered(&footprint);
        before = footprint;
    }
    None
}
