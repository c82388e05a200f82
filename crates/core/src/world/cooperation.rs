//! Messages between agents: what they send in a step, and what they expect from what they received.

use std::cell::OnceCell;
use std::sync::{Arc, OnceLock};

use super::{Agent, Drive, World};
use crate::barrier::{Barrier, BarrierReason};
use crate::conduct::{EXPECTED_DECELERATION, reverses};
use crate::error::Result;
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, Pose};
use crate::predict::completed;
use crate::right_of_way::{
    Body, Course, MARGIN, Memory, Order, Reservation, Traffic, Traveller, Zone, crossing, reach, strip,
};
use crate::route::Route;
use crate::rules::SpeedLimits;
use crate::scene::{PositionIndex, Scene};
use crate::trajectory::{PlanStatus, Plans, Predictions, State};
use crate::v2x::{
    self, Agreement, Log, Object, Observer, Payload, Radio, SharedPredictions, Speaker, WAY_SPACING, interpolated,
};
use crate::vehicle::Vehicle;

/// Past time steps from which speeds are observed.
const OBSERVED: usize = 3;

/// An agent holds no nearer than it can stop, and this much more [m].
const STOPPING_MARGIN: f64 = 0.1;
/// A told place is found this far around where the way of its sender begins [m].
const WAY_WINDOW: f64 = 60.0;

/// What an agent was told of another one.
struct Told<'a> {
    drive: &'a Drive,
    /// Its position in `Traffic::bodies` if the agent sees it.
    seen: Option<usize>,
    /// Length and width [m].
    extent: (f64, f64),
    /// Arc length of its front on its path [m].
    front: f64,
    velocity: f64,
    request: Option<Memory>,
    /// Where the way that it told ends, as an arc length on its path [m].
    told_up_to: f64,
    /// A zone that is not of the map, as the agent and as the other one sees it.
    crossing: Option<[Zone; 2]>,
}

impl Told<'_> {
    /// The zones on the way that it told.
    fn zones_ahead(&self) -> impl Iterator<Item = &Zone> {
        let rear = self.front - self.extent.0;
        self.drive.course.zones().filter(move |zone| zone.exit > rear && zone.entry < self.told_up_to)
    }
}

/// The strips along the ways that agents told, by place, with the time steps at which they did.
type Strips = Vec<Option<(i64, Vec<OrientedBox>)>>;

impl Drive {
    fn zones_ahead(&self) -> impl Iterator<Item = &Zone> {
        let rear = self.front() - self.agent.vehicle.length;
        self.course.zones().filter(move |zone| zone.exit > rear)
    }

    /// The strip that it needs from its rear on, up to so far ahead of its front [m], a box each metre.
    fn strip(&self, ahead: f64) -> Vec<OrientedBox> {
        let (length, width) = self.agent.shape.extent();
        let rear = self.front() - self.agent.vehicle.length;
        let at = |i: usize| {
            let foot = self.agent.route.path.at(rear + i as f64);
            Pose { position: foot.position, orientation: foot.theta }
        };
        strip(&(0..=(length + ahead).ceil() as usize).map(at).collect::<Vec<_>>(), width)
    }

    pub(super) fn limited_way(&self) -> (&Route, &SpeedLimits, &Vehicle) {
        (&self.agent.route, &self.way.limits, &self.agent.vehicle)
    }
}

/// An agent that asks by messages.
fn asking<'a>(body: usize, width: f64, drive: &'a Drive, (course, memory): (&'a Course, Memory)) -> Traveller<'a> {
    Traveller {
        body,
        width,
        front: drive.front(),
        course,
        settings: &drive.agent.rules,
        memory,
        line: f64::INFINITY,
        crosswalk: f64::INFINITY,
        asks_by_message: true,
        turns_on_red: false,
        sight: f64::INFINITY,
        unseen: &[],
    }
}

impl World {
    /// Equips the agents before the first step; without an equipped agent nobody sends.
    pub(super) fn equip(&mut self) {
        let (settings, seed, level) = (self.settings.v2x, self.settings.seed, self.settings.record_messages);
        let ids: Vec<i64> = self.drives.iter().map(|drive| drive.agent.id).collect();
        let drawn = v2x::equipped(seed, settings.penetration, &ids);
        let mut equipped = Vec::new();
        for (drive, drawn) in self.drives.iter_mut().zip(drawn) {
            if drive.agent.v2x.unwrap_or(drawn) {
                drive.place = Some(equipped.len());
                equipped.push(drive.agent.id);
            }
        }
        self.sights.clear();
        self.sights.resize_with(equipped.len(), OnceLock::new);
        if !equipped.is_empty() {
            if settings.negotiate {
                self.find_zones();
            }
            self.radio = Some(Box::new(Radio::new(settings, (seed, self.scenario.dt), equipped, level)));
        }
    }

    /// Finds the conflict zones on the ways of equipped agents that do not obey orders.
    fn find_zones(&mut self) {
        let map = (&*self.scenario.road, self.scenario.junctions());
        for drive in self.drives.iter_mut().filter(|drive| drive.place.is_some() && !drive.obeys()) {
            let Agent { route, vehicle, .. } = &*drive.agent;
            drive.course = Arc::new(Course::along(route, map, &drive.way.limits, vehicle));
        }
    }

    /// Agents may agree by V2X.
    pub(super) fn agrees(&self) -> bool {
        self.radio.as_deref().is_some_and(|radio| radio.settings().negotiate)
    }

    /// Ids of the agents with V2X, ascending.
    pub fn equipped(&self) -> &[i64] {
        self.radio.as_deref().map_or(&[], Radio::ids)
    }

    /// What was sent and received until now; `None` if no agent has V2X.
    pub fn messages(&self) -> Option<&Log> {
        self.radio.as_deref().map(Radio::log)
    }

    /// What the agents expect: predictions for all participants present, completed by what each agent was told; `None`
    /// if no agent has V2X, then the predictions are all there is. Changes nothing.
    ///
    /// # Errors
    /// `WrongTimeStep` if scene or predictions are not of now.
    pub(super) fn with_messages(&self, scene: &Scene, predictions: &Predictions) -> Result<Option<SharedPredictions>> {
        self.check_time_step("scene", scene.time_step)?;
        self.check_scene(scene)?;
        self.check_time_step("predictions", predictions.time_step)?;
        let Some(radio) = &self.radio else { return Ok(None) };
        let found: Vec<(usize, &Drive)> = self.talking().collect();
        let mut observers = Vec::with_capacity(found.len());
        for &(place, drive) in &found {
            let Agent { id, view, planner, .. } = &*drive.agent;
            let barrier = if planner.heeds_barriers() { None } else { self.agreed(drive) };
            let bar = barrier.map(|barrier| (&drive.agent.route.path, barrier));
            observers.push(Observer { id: *id, place, row: drive.row, view, bar });
        }
        let table = completed(predictions, scene);
        let index = scene.position_index(self.drives.len());
        let look = |i: usize| _ = self.sight(found[i].1, scene, &index);
        if observers.iter().any(|observer| observer.view.occlusion) {
            self.threads.each(found.len(), |_, i| look(i));
        }
        let visible: Vec<&[usize]> = found.iter().map(|(_, drive)| self.sight(drive, scene, &index)).collect();
        Ok(Some(radio.expect((scene, &*self.scenario.road), &table, &observers, &visible)))
    }

    /// What an equipped agent sees now, as places among those present. It looks once per time step.
    fn sight(&self, drive: &Drive, scene: &Scene, index: &PositionIndex) -> &[usize] {
        let place = drive.place.expect("an equipped agent");
        self.sights[place].get_or_init(|| {
            let mut seen = Vec::new();
            scene.see(drive.row, &drive.agent.view, index, &mut seen);
            seen
        })
    }

    /// Equipped agents that drive now, with their places among the equipped ones.
    fn talking(&self) -> impl Iterator<Item = (usize, &Drive)> {
        let drives = self.drives.iter().filter(|drive| drive.is_driving(self.time_step));
        drives.filter_map(|drive| Some((drive.place?, drive)))
    }

    /// Sends messages about now; plans are adopted.
    pub(super) fn send_messages(&mut self, plans: &Plans, orders: &[Order]) {
        let Some(mut radio) = self.radio.take() else { return };
        if radio.settings().negotiate {
            self.agreements_now(orders).for_each(|agreement| radio.note_agreement(agreement));
        }
        let scene = radio.settings().cpm.then(|| {
            let scene = self.scene_with_past(OBSERVED);
            let index = scene.position_index(self.drives.len());
            (scene, index)
        });
        let request = |drive: &Drive| {
            let place = orders.binary_search_by_key(&drive.agent.id, |order| order.id).ok()?;
            radio.settings().negotiate.then(|| orders[place].memory)
        };
        let speaker = |(place, drive): (usize, _)| self.speaker((place, drive), plans, request(drive), scene.as_ref());
        let speakers = self.talking().map(speaker).collect();
        let present = |drive: &Drive| Some((drive.place?, self.states[drive.row]?.pose().position));
        let listeners: Vec<(usize, Point)> = self.drives.iter().filter_map(present).collect();
        radio.send(self.time_step, speakers, &listeners);
        self.radio = Some(radio);
    }

    fn speaker<'a>(
        &'a self,
        (place, drive): (usize, &'a Drive),
        plans: &Plans,
        request: Option<Memory>,
        seen_in: Option<&(Scene, PositionIndex)>,
    ) -> Speaker<'a> {
        let (plan, made) = drive.plan.as_ref().expect("a driving agent has a plan");
        let from = ((self.time_step - made) as usize).min(plan.points.len() - 1);
        let row = plans.ids.binary_search(&drive.agent.id).expect("checked against the driving agents");
        Speaker {
            place,
            kind: drive.agent.kind,
            state: self.states[drive.row].expect("a driving agent has a state"),
            extent: drive.agent.shape.extent(),
            plan: &plan.points[from..],
            is_emergency: plans.status[row] == PlanStatus::EmergencyBraking,
            request,
            path: &drive.agent.route.path,
            rear_s: drive.s + drive.agent.vehicle.rear_axle_to_center - 0.5 * drive.agent.vehicle.length,
            objects: seen_in.map_or_else(Vec::new, |(scene, index)| self.objects(scene, index, drive)),
        }
    }

    /// Files the messages that arrive now.
    pub(super) fn file_messages(&mut self) {
        let now = self.time_step;
        let Some(mut radio) = self.radio.take() else { return };
        self.sights.iter_mut().for_each(|sight| *sight = OnceLock::new());
        radio.file(now);
        self.radio = Some(radio);
    }

    /// Stretches in which agents have held for others.
    pub fn agreements(&self) -> &[Agreement] {
        self.radio.as_deref().map_or(&[], Radio::agreements)
    }

    /// The barrier before which an agent holds because of an agreement.
    fn agreed(&self, drive: &Drive) -> Option<Barrier> {
        self.ordered(drive).filter(|barrier| barrier.reason == BarrierReason::Agreement)
    }

    /// Agreements to hold among the orders of now.
    fn agreements_now(&self, orders: &[Order]) -> impl Iterator<Item = Agreement> {
        let now = self.time_step;
        let agreed = orders.iter().filter_map(|order| Some((order, order.barrier?)));
        let agreed = agreed.filter(|(_, barrier)| barrier.reason == BarrierReason::Agreement);
        agreed.map(move |(order, barrier)| {
            let at =
                self.drives[self.drive_index(order.id).expect("orders are for agents")].agent.route.path.at(barrier.s);
            let bar = Pose { position: at.position, orientation: at.theta };
            Agreement { holding: order.id, going: barrier.by, first: now, last: now, bar }
        })
    }

    /// Puts the orders of agents that agree by V2X in the place of those that they would have without messages: their
    /// ledgers are filled with what they see and what they were told.
    pub(super) fn agree(&self, traffic: &Traffic<'_>, rows: &[usize], scene: &Scene, orders: &mut Vec<Order>) {
        let Some(radio) = self.radio.as_deref().filter(|radio| radio.settings().negotiate) else { return };
        let index = scene.position_index(self.drives.len());
        let mut strips: Strips = vec![None; radio.ids().len()];
        for (place, drive) in self.talking().filter(|(_, drive)| !self.reverses(drive)) {
            let body = |row: usize| rows.binary_search(&row).ok();
            let Some(own) = body(drive.row) else { continue };
            let sight = self.sight(drive, scene, &index).iter();
            let mut known: Vec<usize> = sight.filter_map(|place| body(scene.present[*place])).chain([own]).collect();
            known.sort_unstable();
            known.dedup();
            let told = self.told(radio, (place, drive), rows, &known, &mut strips);
            let Some(order) = self.agreed_order(drive, own, &known, &told, traffic) else { continue };
            match orders.binary_search_by_key(&order.id, |order| order.id) {
                Ok(known) => orders[known] = order,
                Err(new) => orders.insert(new, order),
            }
        }
    }

    /// What an agent was told of others that it would not know otherwise; nothing if none of them needs the same zones.
    fn told<'a>(
        &'a self,
        radio: &Radio,
        (place, drive): (usize, &Drive),
        rows: &[usize],
        known: &[usize],
        strips: &mut Strips,
    ) -> Vec<Told<'a>> {
        let Some(state) = self.states[drive.row] else { return Vec::new() };
        let far = reach(state.velocity) + radio.settings().way_ahead;
        let ours = OnceCell::new();
        let (mut found, mut is_shared) = (Vec::new(), false);
        for (sender, message) in radio.plans(place) {
            let Payload::Mcm { status, spacing, points, way, way_from, request, .. } = &message.payload else {
                continue;
            };
            let age = (self.time_step - message.time_step) as f64 * self.scenario.dt;
            let now = points.first().map(|_| interpolated(points, *spacing, age));
            let Some(now) = now.filter(|now| now.pose().position.distance(state.pose().position) <= far) else {
                continue;
            };
            let other = &self.drives[self.drive_index(message.sender).expect("senders are agents")];
            let seen = rows.binary_search(&other.row).ok().filter(|body| known.binary_search(body).is_ok());
            // Its sensors know better than a message.
            let (front, velocity) = match (seen, self.states[other.row]) {
                (Some(_), Some(state)) => (other.front(), state.velocity),
                _ => {
                    let (path, half) = (&other.agent.route.path, 0.5 * status.length);
                    let foot = path.project_near(now.pose().position, way_from + half, WAY_WINDOW);
                    let Some((s, _)) = foot else { continue };
                    (s + half, now.velocity)
                }
            };
            if reverses(velocity) {
                continue;
            }
            let velocity = velocity.max(0.0);
            let told_up_to = way_from + WAY_SPACING * (way.len() as f64 - 1.0);
            let extent = (status.length, status.width);
            let mut one =
                Told { drive: other, seen, extent, front, velocity, request: *request, told_up_to, crossing: None };
            let meets = drive.zones_ahead().any(|zone| one.zones_ahead().any(|their| their.meets(zone)));
            let is_public = seen.is_some() && drive.obeys() && other.obeys();
            if !meets {
                let ours: &Vec<OrientedBox> = ours.get_or_init(|| drive.strip(reach(state.velocity)));
                let known = &mut strips[sender];
                if known.as_ref().is_none_or(|(time_step, _)| *time_step != message.time_step) {
                    let way: Vec<Pose> = way.iter().map(State::pose).collect();
                    *known = Some((message.time_step, strip(&way, status.width)));
                }
                let theirs = known.as_ref().map_or(&[][..], |(_, strip)| strip);
                let gone = ((front - extent.0 - way_from) / WAY_SPACING).max(0.0) as usize;
                let are_apart = |one, other| self.participants.storeys.are_apart(one, other);
                let crossed = crossing(ours, theirs.get(gone..).unwrap_or_default(), &are_apart);
                let rear = drive.front() - drive.agent.vehicle.length;
                let there = |i: usize| way_from + WAY_SPACING * (gone + i) as f64;
                let (area, side) =
                    (self.scenario.junctions().areas.len() + sender, usize::from(drive.agent.id > other.agent.id));
                one.crossing = crossed.map(|[(first, last), (enters, leaves)]| {
                    let own = Zone::between(area, side, (rear + first as f64, rear + last as f64));
                    [own, Zone::between(area, 1 - side, (there(enters), there(leaves)))]
                });
            }
            if is_public && one.crossing.is_none() {
                // Both obey the same order in sight of each other.
                continue;
            }
            is_shared |= meets || one.crossing.is_some();
            found.push(one);
        }
        if is_shared { found } else { Vec::new() }
    }

    /// The order of an agent by its own ledger; `None` if it was told nothing.
    fn agreed_order(
        &self,
        drive: &Drive,
        own: usize,
        known: &[usize],
        told: &[Told<'_>],
        traffic: &Traffic<'_>,
    ) -> Option<Order> {
        if told.is_empty() {
            return None;
        }
        let place_of = |body: usize| known.binary_search(&body).ok();
        let mut bodies: Vec<Body> = known.iter().map(|body| traffic.bodies[*body].clone()).collect();
        let mut course = (*drive.course).clone();
        // Numbers of passages beyond those of the map, and courses of the others.
        let number = |other: &Drive| usize::MAX - other.place.unwrap_or_default();
        let mut others = Vec::with_capacity(told.len());
        for one in told {
            let mut theirs = one.drive.course.filtered(|zone| zone.entry < one.told_up_to);
            if let Some([here, there]) = one.crossing {
                course.add(here, number(one.drive), drive.limited_way());
                theirs.add(there, number(drive), one.drive.limited_way());
            }
            let body = one.seen.and_then(place_of).unwrap_or_else(|| {
                let places = theirs.places(one.front, one.extent.0);
                bodies.push(Body { id: one.drive.agent.id, length: one.extent.0, velocity: one.velocity, places });
                bodies.len() - 1
            });
            others.push((body, theirs));
        }
        let is_told = |body: usize| others.iter().any(|(other, _)| *other == body);
        let own = place_of(own)?;
        let mut travellers: Vec<Traveller<'_>> = Vec::new();
        if drive.obeys() {
            let seen =
                traffic.travellers.iter().filter_map(|one| Some(Traveller { body: place_of(one.body)?, ..*one }));
            travellers.extend(seen.filter(|one| !is_told(one.body)));
            travellers.iter_mut().filter(|one| one.body == own).for_each(|one| one.course = &course);
        } else {
            course = course.filtered(|zone| others.iter().any(|(_, theirs)| theirs.zones().any(|one| one.meets(zone))));
            let crosswalk = self.crosswalk_ahead(drive).map_or(f64::INFINITY, |barrier| barrier.s);
            let (line, width) = (self.line(drive), drive.agent.vehicle.width);
            travellers.push(Traveller { line, crosswalk, ..asking(own, width, drive, (&course, drive.memory)) });
        }
        travellers.extend(told.iter().zip(&others).map(|(one, (body, theirs))| {
            let public = one.seen.filter(|_| drive.obeys()).and_then(|body| traffic.of_body(body));
            if let Some(public) = public {
                return Traveller { body: *body, course: theirs, ..*public };
            }
            let memory = one.request.unwrap_or_default();
            let line = if one.request.is_some() { f64::INFINITY } else { f64::NEG_INFINITY };
            Traveller { front: one.front, line, ..asking(*body, one.extent.1, one.drive, (theirs, memory)) }
        }));
        travellers.sort_by_key(|traveller| traveller.body);
        let visits = traffic.visits.iter().filter(|_| drive.obeys());
        let visits = visits.filter_map(|visit| Some(Reservation { body: place_of(visit.body)?, ..*visit }));
        let visits: Vec<Reservation> = visits.filter(|visit| !is_told(visit.body)).collect();
        let traffic = Traffic { bodies: &bodies, travellers: &travellers, visits: &visits, ..*traffic };
        let viewer = travellers.binary_search_by_key(&own, |traveller| traveller.body).ok()?;
        let mut order = traffic.order_of(viewer)?;
        if let Some(barrier) = &mut order.barrier {
            let by = barrier.by.filter(|by| told.iter().any(|one| one.drive.agent.id == *by));
            if by.is_some() || !drive.obeys() {
                let margin = self.settings.v2x.hold_margin - MARGIN;
                let stopping = 0.5 * bodies[own].velocity.powi(2) / EXPECTED_DECELERATION + STOPPING_MARGIN;
                let s = (barrier.s - margin).max((drive.front() + stopping).min(barrier.s));
                *barrier = Barrier { s, by, reason: BarrierReason::Agreement, ..*barrier };
            }
        }
        Some(order)
    }

    /// What an agent's sensors see, as it tells others.
    fn objects(&self, scene: &Scene, index: &PositionIndex, drive: &Drive) -> Vec<Object> {
        let participants = &scene.participants;
        let object = |place: &usize| {
            let row = scene.present[*place];
            let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
            let extent = participants.shape[row].extent();
            Object::rounded(participants.ids[row], participants.kind[row], &state, extent, participants.is_static[row])
        };
        self.sight(drive, scene, index).iter().map(object).collect()
    }
}
