//! Entering a junction: what the agents are told, and what they remember of it.

use super::{Drive, World};
use crate::barrier::{Barrier, BarrierReason};
use crate::conduct::{STANDSTILL_SPEED, STATIONARY_SPEED, could_stop, reverses};
use crate::geometry::Pose;
use crate::plan::Planner;
use crate::predict::{ShownWay, Waiting, narrow_in_bends, turn, wait};
use crate::recording::Entry;
use crate::right_of_way::{Body, Course, Memory, Order, Place, Reservation, Traffic, Traveller, Yielding, Zone};
use crate::road::{LaneMatch, RoadNetwork};
use crate::rules::{RulesSettings, Turning, Way};
use crate::scenario::Scenario;
use crate::scene::Scene;
use crate::trajectory::Predictions;
use crate::turn::Turn;
use crate::world::Agent;

/// A body is on lanelets that lead its way within this angle [rad].
const ANGLE_MAX: f64 = 1.0;
/// Vehicles that do not obey are followed along their lanes for this time [s] and in so many ways at most.
const FOLLOWED: f64 = 8.0;
const WAYS_MAX: usize = 4;
/// Stationary vehicles are not expected to enter an area; one that stands in it needs so long to leave [s].
const LEAVING: f64 = 4.0;
/// They may be slower by this factor on their way out.
const SLOWER: f64 = 0.7;
/// A vehicle is not expected to take a bend that takes more than the first [m/s²] across, unless the second suffices to slow
/// down. One that would have to wait after a fork, and is faster than the second pair allows, takes another way.
const BEARABLE: (f64, f64) = (4.0, 3.0);
const COMFORTABLE: (f64, f64) = (3.0, 2.0);
const BEND_STEP: f64 = 3.0;
/// An area that begins no farther than this before a stop line is behind it [m].
const BEFORE_LINE: f64 = 1.0;
/// Past steps from which the speed of a recorded vehicle is observed.
const PAST: usize = 4;

/// The planner of an agent does what the rules say.
fn obeys(planner: &Planner, rules: &RulesSettings) -> bool {
    rules.enabled && rules.precedence && (planner.heeds_barriers() || *planner == Planner::External)
}

/// The conflict zones on the way of an agent; empty if it does not obey.
pub(super) fn course(agent: &Agent, scenario: &Scenario, way: &Way) -> Course {
    if !obeys(&agent.planner, &agent.rules) {
        return Course::default();
    }
    let map = (&*scenario.road, scenario.junctions());
    Course::along(&agent.route, map, &way.limits, &agent.vehicle)
}

impl World {
    /// Orders of the agents that are near a junction now, by ids; a pure function of the present state.
    pub(crate) fn orders(&self) -> &[Order] {
        self.orders.get_or_init(|| if self.has_passages { self.orders_now() } else { Vec::new() })
    }

    /// Ids of the agents that enter junctions when they are told to.
    pub fn obeying(&self) -> Vec<i64> {
        let drives = self.drives.iter().filter(|drive| drive.obeys());
        drives.map(|drive| drive.agent.id).collect()
    }

    /// The barrier of the order that an agent has.
    pub(super) fn ordered(&self, drive: &Drive) -> Option<Barrier> {
        let orders = self.orders();
        let place = orders.binary_search_by_key(&drive.agent.id, |order| order.id).ok()?;
        orders[place].barrier
    }

    /// The speed at which an agent shows something by its blinkers [m/s]; `None` while it reverses.
    fn showing_velocity(&self, drive: &Drive) -> Option<f64> {
        let velocity = self.states[drive.row]?.velocity;
        (!reverses(velocity)).then_some(velocity.max(0.0))
    }

    /// What an agent shows of the way that it takes at a fork.
    fn turning<'a>(&self, drive: &'a Drive) -> Option<&'a Turning> {
        let (velocity, front) = (self.showing_velocity(drive)?, drive.front());
        drive.way.turning(front, front - drive.agent.vehicle.length, velocity)
    }

    /// What an agent shows by its blinkers: a lane change, otherwise its way at a fork.
    fn shown(&self, drive: &Drive) -> Option<Turn> {
        self.lane_change(drive).or_else(|| self.turning(drive).map(|turning| turning.turn))
    }

    /// The side of the lane change that an agent shows: its own, or that of its path.
    fn lane_change(&self, drive: &Drive) -> Option<Turn> {
        if !(drive.agent.rules.enabled && drive.agent.rules.blinkers) {
            return None;
        }
        let (velocity, front) = (self.showing_velocity(drive)?, drive.front());
        if drive.prepared(&self.scenario).chooses_lanes() {
            return drive.indicator.side();
        }
        drive.way.lane_change(front, front - drive.agent.vehicle.length, velocity)
    }

    /// What agents show, by their ids.
    pub(super) fn shown_by(&self, ids: &[i64]) -> Vec<Option<Turn>> {
        ids.iter().map(|id| self.drive_index(*id).ok().and_then(|index| self.shown(&self.drives[index]))).collect()
    }

    /// Writes what the participants in these rows show.
    pub(super) fn write_turns(&self, present: &[usize], turns: &mut Vec<Option<Turn>>) {
        turns.clear();
        turns.resize(present.len(), None);
        for drive in self.drives.iter().filter(|drive| drive.is_driving(self.time_step)) {
            if let (Some(turn), Ok(place)) = (self.shown(drive), present.binary_search(&drive.row)) {
                turns[place] = Some(turn);
            }
        }
    }

    /// Predictions in which agents take the ways that they show and keep to their lanes there, and those that were told to
    /// wait before a junction do so; `None` if no agent does either. Blinkers and right of way are public: no agent
    /// needs another one's plan to go by them. Agreements are known to the agents that hear of them.
    pub(super) fn with_rules(&self, predictions: &Predictions) -> Option<Predictions> {
        let mut found: Option<Predictions> = None;
        for drive in self.drives.iter().filter(|drive| drive.is_driving(self.time_step)) {
            let (Some(turning), Some(row)) = (self.turning(drive), predictions.row(drive.agent.id)) else { continue };
            let Some(state) = self.states[drive.row] else { continue };
            let s = drive.s + drive.agent.vehicle.rear_axle_to_center;
            let way = ShownWay { turning, path: &drive.agent.route.path, from: (state.pose().position, s) };
            let (road, dt) = (&self.scenario.road, self.scenario.dt);
            if let Some(probability) = turn(predictions, row, &way, road, dt) {
                let n = predictions.n_modes;
                let table = found.get_or_insert_with(|| predictions.clone());
                table.probability[row * n..(row + 1) * n].copy_from_slice(&probability);
            }
            if turning.turn != Turn::Straight {
                narrow_in_bends(found.get_or_insert_with(|| predictions.clone()), row, dt);
            }
        }
        let told = self.orders().iter().filter_map(|order| Some((order, order.barrier?)));
        for (order, barrier) in told.filter(|(_, barrier)| barrier.reason != BarrierReason::Agreement) {
            let drive = &self.drives[self.drive_index(order.id).expect("orders are for agents")];
            let (Some(row), Some(state)) = (predictions.row(order.id), &self.states[drive.row]) else { continue };
            let entry_line = drive.agent.route.path.at(barrier.s);
            let waiting = Waiting {
                line: Pose { position: entry_line.position, orientation: entry_line.theta },
                release: barrier.until,
                to_front: 0.5 * drive.agent.vehicle.length,
            };
            wait(found.get_or_insert_with(|| predictions.clone()), row, state, &waiting, self.scenario.dt);
        }
        found
    }

    fn orders_now(&self) -> Vec<Order> {
        let driving = || self.drives.iter().filter(|drive| drive.is_driving(self.time_step));
        let is_near = |drive: &Drive| {
            let velocity = self.states[drive.row].map_or(0.0, |state| state.velocity);
            drive.course.is_near(drive.front(), velocity, drive.agent.vehicle.length)
        };
        if !self.agrees() && !driving().any(is_near) && !self.may_pass_from_both_ends() {
            return Vec::new();
        }
        let scene = self.scene_with_past(PAST);
        let is_vehicle = |row: &&usize| self.participants.kind[**row].is_on_the_road();
        let rows: Vec<usize> = scene.present.iter().filter(is_vehicle).copied().collect();
        let mut obeying: Vec<Option<&Drive>> = vec![None; rows.len()];
        // An agent that reverses asks for no zone; it reserves those that it is in, like vehicles that do not obey.
        let asks = |drive: &&Drive| drive.obeys() && !self.reverses(drive);
        for drive in driving().filter(asks) {
            if let Ok(place) = rows.binary_search(&drive.row) {
                obeying[place] = Some(drive);
            }
        }
        let (mut bodies, mut visits) = (Vec::with_capacity(rows.len()), Vec::new());
        for (place, &row) in rows.iter().enumerate() {
            let velocity = scene.observed_velocity(row).max(0.0);
            let (length, _) = self.participants.shape[row].extent();
            let own = obeying[place].filter(|drive| drive.keeps_to_its_path());
            let matches = if own.is_some() { Vec::new() } else { self.matching(&scene, row) };
            let places =
                own.map_or_else(|| places_of(&matches, length), |drive| drive.course.places(drive.front(), length));
            if obeying[place].is_none()
                && let Some(found) = matches.first()
                && !self.participants.is_static[row]
            {
                let drive = self.drive_index(self.participants.ids[row]).ok().map(|index| &self.drives[index]);
                let turning = drive.and_then(|drive| self.turning(drive));
                self.visit(found, (velocity, length), (place, turning), &mut visits);
            }
            bodies.push(Body { id: self.participants.ids[row], length, velocity, places });
        }
        let index = scene.position_index(driving().count());
        let mut seen = vec![Vec::new(); rows.len()];
        let place_of: Vec<usize> =
            rows.iter().map(|row| scene.present.binary_search(row).expect("it is present")).collect();
        let (mut unseen, mut goes_last) = (vec![Vec::new(); rows.len()], vec![false; rows.len()]);
        for (place, drive) in obeying.iter().enumerate().filter_map(|(place, drive)| Some((place, (*drive)?))) {
            seen[place].reserve(scene.present.len());
            scene.see(drive.row, &drive.agent.view, &index, &mut seen[place]);
            let (way, front) = self.states[drive.row]
                .map_or((&*drive.way, drive.front()), |state| drive.way_below(&state, &self.scenario));
            goes_last[place] = self.lines(drive).turns_on_red(way, front);
            let sees = |body: usize| seen[place].binary_search(&place_of[body]).is_ok();
            unseen[place] = self.unseen(&scene, drive, goes_last[place], &sees, (&bodies, &rows));
        }
        let narrow = self.narrow_courses(&scene, &obeying, &seen);
        let travellers: Vec<Traveller<'_>> = obeying
            .iter()
            .enumerate()
            .filter_map(|(place, drive)| {
                let drive = (*drive)?;
                Some(Traveller {
                    body: place,
                    width: drive.agent.vehicle.width,
                    front: drive.front(),
                    course: narrow.get(&place).unwrap_or(&drive.course),
                    settings: &drive.agent.rules,
                    memory: drive.memory,
                    line: self.line(drive),
                    crosswalk: self.crosswalk_ahead(drive).map_or(f64::INFINITY, |barrier| barrier.s),
                    asks_by_message: false,
                    turns_on_red: goes_last[place],
                    sight: drive.agent.view.sensor_radius,
                    unseen: &unseen[place],
                })
            })
            .collect();
        let (time_step, dt) = (self.time_step, self.scenario.dt);
        let traffic = Traffic { time_step, dt, bodies: &bodies, travellers: &travellers, visits: &visits };
        let mut orders = traffic.orders(&|viewer, body| seen[viewer].binary_search(&place_of[body]).is_ok());
        self.agree(&traffic, &rows, &scene, &mut orders);
        orders
    }

    pub(super) fn reverses(&self, drive: &Drive) -> bool {
        self.states[drive.row].is_some_and(|state| reverses(state.velocity))
    }

    /// Arc length of the stop line that holds an agent [m].
    pub(super) fn line(&self, drive: &Drive) -> f64 {
        let velocity = self.states[drive.row].map_or(0.0, |state| state.velocity.max(0.0));
        self.lines(drive).barriers(&drive.way, drive.front(), velocity).nearest()
    }

    fn matching(&self, scene: &Scene, row: usize) -> Vec<LaneMatch> {
        self.scenario.road.matching(scene.state(row).pose(), 0.0, ANGLE_MAX)
    }

    /// Books what a vehicle that does not obey may use, at its present speed on all ways that it can still take, but not
    /// on others than the one that it shows.
    fn visit(
        &self,
        start: &LaneMatch,
        (velocity, length): (f64, f64),
        (body, turning): (usize, Option<&Turning>),
        visits: &mut Vec<Reservation>,
    ) {
        let junctions = self.scenario.junctions();
        let road = &self.scenario.road;
        let front = start.s + 0.5 * length;
        let reach = velocity * FOLLOWED + length;
        let mut ways = road.paths_from(start.lanelet, start.s, reach, WAYS_MAX);
        if let Some(turning) = turning {
            let is_shown = |way: &Vec<usize>| !way.iter().any(|lanelet| turning.others.contains(lanelet));
            // Where lanelets overlap, its own may be one of the others.
            if ways.iter().any(is_shown) {
                ways.retain(is_shown);
            }
        }
        let too_fast = |way: &[usize], limits| bends_too_much(road, way, start.s, (velocity, reach), limits);
        let likely = |way: &&Vec<usize>| !too_fast(way, COMFORTABLE);
        for way in ways.iter().filter(|way| !too_fast(way, BEARABLE)) {
            let is_likely = likely(&way);
            let held_at = self.held_by_light(way, front, velocity);
            let mut base = 0.0;
            for lanelet in way {
                let goes_elsewhere = || !is_likely && ways.iter().filter(likely).any(|other| !other.contains(lanelet));
                for &(index, side) in junctions.of_lanelet(*lanelet) {
                    let area = &junctions.areas[index];
                    let (entry, exit) = (base + area.sides[side].entry - front, base + area.sides[side].exit - front);
                    let is_inside = entry <= 0.0;
                    if exit + length <= 0.0 || area.is_side_by_side || (velocity < STATIONARY_SPEED && !is_inside) {
                        continue;
                    }
                    let should_wait = area.first == Some(1 - side) && !is_inside;
                    let yielding = match should_wait {
                        _ if entry + BEFORE_LINE >= held_at => Yielding::Yes,
                        true if could_stop(velocity, entry) || goes_elsewhere() => Yielding::Yes,
                        true => Yielding::IfTrusted,
                        false => Yielding::No,
                    };
                    let known = visits.iter().position(|known| (known.body, known.zone.area) == (body, index));
                    if known.is_some_and(|known| yielding >= visits[known].yielding) {
                        continue;
                    }
                    let enter = if is_inside { 0.0 } else { entry / velocity };
                    let leave =
                        if velocity < STATIONARY_SPEED { LEAVING } else { (exit + length) / (SLOWER * velocity) };
                    let zone = Zone::of((index, area), side, (entry, exit));
                    let visit = Reservation { zone, enter, earliest: enter, leave, body, is_request: false, yielding };
                    match known {
                        Some(known) => visits[known] = visit,
                        None => visits.push(visit),
                    }
                }
                base += road.lanelets()[*lanelet].length;
            }
        }
    }

    /// How far a vehicle that does not obey orders may go before a light that is yellow or red on a way [m], if it can still
    /// stop there; infinite if there is none. `front` is its arc length on the first lanelet of the way [m].
    fn held_by_light(&self, way: &[usize], front: f64, velocity: f64) -> f64 {
        let control = &self.scenario.control;
        let mut base = 0.0;
        for (lanelet, following) in way.iter().zip(way.iter().skip(1)) {
            if control.lights.is_empty() {
                break;
            }
            let (center, length) = (&self.scenario.road.lanelets()[*lanelet].center, base);
            base += self.scenario.road.lanelets()[*lanelet].length;
            for line in control.lines.iter().filter(|line| line.lanelet == *lanelet) {
                let Some((_, lights)) = line.lights.iter().find(|(next, _)| next == following) else { continue };
                if control.signal(lights, self.time_step).lets_go() || line.turns_on_red.contains(following) {
                    continue;
                }
                let distance = length + center.project(line.ends[0].lerp(line.ends[1], 0.5)).s - front;
                if distance > 0.0 && could_stop(velocity, distance) {
                    return distance;
                }
            }
        }
        f64::INFINITY
    }

    /// Agents remember the orders that they had, and how long they have stood; what they entered is recorded.
    pub(super) fn remember(&mut self, orders: &[Order]) {
        for drive in &mut self.drives {
            let order = orders.binary_search_by_key(&drive.agent.id, |order| order.id).ok();
            let Some(state) = self.states[drive.row] else { continue };
            let kept = order.map_or_else(Memory::default, |place| orders[place].memory);
            if self.settings.keep_recording && kept.has_entered && drive.obeys() {
                self.recording.push_entries(drive.entries(&kept, self.time_step));
            }
            let standing = if state.velocity.abs() < STANDSTILL_SPEED { drive.memory.standing + 1 } else { 0 };
            drive.memory = Memory { standing, ..kept };
        }
    }
}

impl Drive {
    /// It enters junctions when it is told to.
    pub(super) fn obeys(&self) -> bool {
        obeys(&self.agent.planner, &self.agent.rules)
    }

    /// Its lanelets are those of its route.
    fn keeps_to_its_path(&self) -> bool {
        !matches!(self.agent.planner, Planner::IdmMobil(_))
    }

    /// What it has just entered, as it remembers now.
    fn entries<'a>(&'a self, now: &Memory, time_step: i64) -> impl Iterator<Item = Entry> + use<'a> {
        let before = self.memory;
        let first = self.course.first_passage(self.front() - self.agent.vehicle.length);
        // Those that are not of the map have numbers beyond.
        let known = if before.passage < self.course.passages.len() { before.passage } else { 0 };
        let first = first.max(known + usize::from(before.has_entered));
        let last = if now.passage < self.course.passages.len() { now.passage + 1 } else { 0 };
        let new = self.course.passages.iter().enumerate().take(last).skip(first);
        new.flat_map(move |(number, passage)| {
            let granted = number != before.passage || before.granted != Some(false);
            let areas = passage.zones.iter().map(|zone| zone.area as i64);
            areas.map(move |area| Entry { agent: self.agent.id, area, time_step, granted })
        })
    }
}

fn places_of(matches: &[LaneMatch], length: f64) -> Vec<Place> {
    let place = |found: &LaneMatch| Place { lanelet: found.lanelet, s: found.s, to_front: 0.5 * length };
    matches.iter().map(place).collect()
}

/// A vehicle is too fast for the lateral acceleration [m/s²] in a bend of a chain of lanelets, and too near to slow down
/// with the deceleration [m/s²].
fn bends_too_much(
    road: &RoadNetwork,
    chain: &[usize],
    s: f64,
    (velocity, reach): (f64, f64),
    (lateral, slowing): (f64, f64),
) -> bool {
    let n = (reach / BEND_STEP) as usize;
    (1..=n).any(|i| {
        let distance = i as f64 * BEND_STEP;
        let bearable = lateral / road.chain_curvature(chain, s, distance).abs().max(1e-6);
        velocity * velocity > bearable + 2.0 * slowing * distance
    })
}
