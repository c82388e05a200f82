//! Messages between agents: what they send in a step, and what they expect from what they received.

use std::sync::{Arc, OnceLock};

use super::{Agent, Drive, World};
use crate::barrier::{Barrier, BarrierReason};
use crate::conduct::COMFORTABLE_DECELERATION;
use crate::error::Result;
use crate::geometry::{Point, Pose};
use crate::predict::completed;
use crate::right_of_way::{
    Body, Course, MARGIN, Memory, Order, Place, Reservation, Traffic, Traveller, Zone, crossing, reach, strip,
};
use crate::route::Route;
use crate::rules::SpeedLimits;
use crate::scene::Scene;
use crate::trajectory::{PlanStatus, Plans, Predictions, State};
use crate::v2x::{
    self, Agreement, Log, Message, Network, Object, Observer, Payload, SharedPredictions, Speaker, WAY_SPACING,
    interpolated,
};
use crate::vehicle::Vehicle;

/// Past time steps from which speeds are observed.
const OBSERVED: usize = 3;

/// An agent holds no nearer than it can stop, and this much more [m].
const STOPPING_MARGIN: f64 = 0.1;
/// A told place is found this far around where the other one is [m].
const WAY_WINDOW: f64 = 60.0;

/// What an agent was told of another one.
struct Told<'a> {
    drive: &'a Drive,
    /// Position in `Traffic::bodies`.
    body: usize,
    /// Length and width [m].
    extent: (f64, f64),
    /// Arc length of its front on its path [m].
    front: f64,
    request: Option<Memory>,
    /// The way that it told, and the arc length on its path at which that begins [m].
    way: (f64, &'a [State]),
    /// The zones on it.
    course: Course,
}

impl Told<'_> {
    fn zones_ahead(&self) -> impl Iterator<Item = &Zone> {
        let rear = self.front - self.extent.0;
        self.course.zones().filter(move |zone| zone.exit > rear)
    }
}

impl Drive {
    fn zones_ahead(&self) -> impl Iterator<Item = &Zone> {
        let rear = self.front() - self.agent.vehicle.length;
        self.course.zones().filter(move |zone| zone.exit > rear)
    }

    fn limited_way(&self) -> (&Route, &SpeedLimits, &Vehicle) {
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
    /// Equips the agents before the first step; without an equipped agent there is no network.
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
            self.network = Some(Box::new(Network::new(settings, (seed, self.scenario.dt), equipped, level)));
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
        self.network.as_deref().is_some_and(|network| network.settings().negotiate)
    }

    /// Ids of the agents with V2X, ascending.
    pub fn equipped(&self) -> &[i64] {
        self.network.as_deref().map_or(&[], Network::ids)
    }

    /// What was sent and received until now; `None` if no agent has V2X.
    pub fn messages(&self) -> Option<&Log> {
        self.network.as_deref().map(Network::log)
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
        let Some(network) = &self.network else { return Ok(None) };
        let found: Vec<(usize, &Drive)> = self.talking().collect();
        let mut observers = Vec::with_capacity(found.len());
        for &(place, drive) in &found {
            let Agent { id, view, planner, .. } = &*drive.agent;
            let barrier = if planner.heeds_barriers() { None } else { self.agreed(drive) };
            let bar = barrier.map(|barrier| (&drive.agent.route.path, barrier));
            observers.push(Observer { id: *id, place, row: drive.row, view, bar });
        }
        let table = completed(predictions, scene);
        let positions = scene.positions();
        let look = |i: usize| _ = self.sight(found[i].1, scene, &positions);
        if observers.iter().any(|observer| observer.view.occlusion) {
            self.threads.each(found.len(), |_, i| look(i));
        }
        let visible: Vec<&[usize]> = found.iter().map(|(_, drive)| self.sight(drive, scene, &positions)).collect();
        Ok(Some(network.expect((scene, &*self.scenario.road), &table, &observers, &visible)))
    }

    /// What an equipped agent sees now, as places among those present. It looks once per time step.
    fn sight(&self, drive: &Drive, scene: &Scene, positions: &[Point]) -> &[usize] {
        let place = drive.place.expect("an equipped agent");
        self.sights[place].get_or_init(|| {
            let mut seen = Vec::new();
            scene.see(drive.row, &drive.agent.view, positions, &mut seen);
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
        let Some(mut network) = self.network.take() else { return };
        if network.settings().negotiate {
            self.agreements_now(orders).for_each(|agreement| network.note_agreement(agreement));
        }
        let scene = network.settings().cpm.then(|| self.scene_with_past(OBSERVED));
        let request = |drive: &Drive| {
            let place = orders.binary_search_by_key(&drive.agent.id, |order| order.id).ok()?;
            network.settings().negotiate.then(|| orders[place].memory)
        };
        let speaker = |(place, drive): (usize, _)| self.speaker((place, drive), plans, request(drive), scene.as_ref());
        let speakers = self.talking().map(speaker).collect();
        let present = |drive: &Drive| Some((drive.place?, self.states[drive.row]?.pose().position));
        let listeners: Vec<(usize, Point)> = self.drives.iter().filter_map(present).collect();
        network.send(self.time_step, speakers, &listeners);
        self.network = Some(network);
    }

    fn speaker<'a>(
        &'a self,
        (place, drive): (usize, &'a Drive),
        plans: &Plans,
        request: Option<Memory>,
        scene: Option<&Scene>,
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
            objects: scene.map_or_else(Vec::new, |scene| self.objects(scene, drive)),
        }
    }

    /// Files the messages that arrive now.
    pub(super) fn file_messages(&mut self) {
        let now = self.time_step;
        let Some(mut network) = self.network.take() else { return };
        self.sights.iter_mut().for_each(|sight| *sight = OnceLock::new());
        network.file(now);
        self.network = Some(network);
    }

    /// Stretches in which agents have held for others.
    pub fn agreements(&self) -> &[Agreement] {
        self.network.as_deref().map_or(&[], Network::agreements)
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
        let Some(network) = self.network.as_deref().filter(|network| network.settings().negotiate) else { return };
        let positions = scene.positions();
        for (place, drive) in self.talking() {
            let sight = self.sight(drive, scene, &positions);
            let sees = |body: usize| {
                scene.present.binary_search(&rows[body]).is_ok_and(|place| sight.binary_search(&place).is_ok())
            };
            if let Some(order) = self.agreed_order(network, (place, drive), traffic, rows, &sees) {
                match orders.binary_search_by_key(&order.id, |order| order.id) {
                    Ok(known) => orders[known] = order,
                    Err(new) => orders.insert(new, order),
                }
            }
        }
    }

    /// The order of an agent by its own ledger; `None` if it was told of nobody who needs the same zones and about whom it
    /// would not know otherwise.
    fn agreed_order(
        &self,
        network: &Network,
        (place, drive): (usize, &Drive),
        traffic: &Traffic<'_>,
        rows: &[usize],
        sees: &dyn Fn(usize) -> bool,
    ) -> Option<Order> {
        let own = rows.binary_search(&drive.row).ok()?;
        let (mut bodies, mut told) = (traffic.bodies.to_vec(), Vec::new());
        let mut course = (*drive.course).clone();
        let n_areas = self.scenario.junctions().areas.len();
        for (sender, message) in network.plans(place) {
            let other = &self.drives[self.drive_index(message.sender).expect("senders are agents")];
            let seen = rows.binary_search(&other.row).ok().filter(|body| sees(*body));
            let Some(mut one) = self.told(other, message, seen, &mut bodies) else { continue };
            let meets = |zone: &Zone| one.zones_ahead().any(|their| their.meets(zone));
            let is_public = seen.is_some() && drive.obeys() && other.obeys();
            if !drive.zones_ahead().any(meets)
                && let Some([own, theirs]) = self.crossing(drive, &one)
            {
                let (area, side) = (n_areas + sender, usize::from(drive.agent.id > other.agent.id));
                course.add(Zone::told(area, side, own), usize::MAX - sender, drive.limited_way());
                one.course.add(Zone::told(area, 1 - side, theirs), usize::MAX - place, other.limited_way());
            } else if is_public {
                // It obeys the same order in sight of the agent.
                continue;
            }
            told.push(one);
        }
        let is_shared = |zone: &Zone| told.iter().any(|one| one.course.zones().any(|their| their.meets(zone)));
        let left = drive.front() - bodies[own].length;
        if !course.zones().any(|zone| zone.exit > left && is_shared(zone)) {
            return None;
        }
        let is_told = |body: usize| told.iter().any(|one| one.body == body);
        let mut travellers: Vec<Traveller<'_>> = if drive.obeys() {
            let seen = traffic.travellers.iter().filter(|traveller| !is_told(traveller.body));
            seen.map(
                |traveller| {
                    if traveller.body == own { Traveller { course: &course, ..*traveller } } else { *traveller }
                },
            )
            .collect()
        } else {
            course = course.filtered(is_shared);
            let crosswalk = self.crosswalk_ahead(drive).map_or(f64::INFINITY, |barrier| barrier.s);
            let (line, width) = (self.line(drive), drive.agent.vehicle.width);
            vec![Traveller { line, crosswalk, ..asking(own, width, drive, (&course, drive.memory)) }]
        };
        travellers.extend(told.iter().map(|one| {
            if let Some(public) = traffic.of_body(one.body).filter(|_| drive.obeys()) {
                return Traveller { course: &one.course, ..*public };
            }
            let memory = one.request.unwrap_or_default();
            let line = if one.request.is_some() { f64::INFINITY } else { f64::NEG_INFINITY };
            Traveller { front: one.front, line, ..asking(one.body, one.extent.1, one.drive, (&one.course, memory)) }
        }));
        travellers.sort_by_key(|traveller| traveller.body);
        let visits = traffic.visits.iter().filter(|visit| drive.obeys() && !is_told(visit.body)).copied();
        let visits: Vec<Reservation> = visits.collect();
        let knows = |body: usize| body == own || body >= rows.len() || sees(body);
        let traffic = Traffic { bodies: &bodies, travellers: &travellers, visits: &visits, ..*traffic };
        let viewer = travellers.binary_search_by_key(&own, |traveller| traveller.body).expect("it is one of them");
        let mut order = traffic.order_of(viewer, &knows)?;
        if let Some(barrier) = &mut order.barrier {
            let by = barrier.by.filter(|by| told.iter().any(|one| one.drive.agent.id == *by));
            if by.is_some() || !drive.obeys() {
                let margin = network.settings().hold_margin - MARGIN;
                let velocity = bodies[own].velocity;
                let stopping = drive.front() + 0.5 * velocity * velocity / COMFORTABLE_DECELERATION + STOPPING_MARGIN;
                let s = (barrier.s - margin).max(stopping.min(barrier.s));
                *barrier = Barrier { s, by, reason: BarrierReason::Agreement, ..*barrier };
            }
        }
        Some(order)
    }

    /// What an agent was told of another one by its newest message; those that it does not see become new bodies.
    fn told<'a>(
        &self,
        other: &'a Drive,
        message: &'a Message,
        seen: Option<usize>,
        bodies: &mut Vec<Body>,
    ) -> Option<Told<'a>> {
        let Payload::Mcm { status, spacing, points, way, request, .. } = &message.payload else { return None };
        let (path, hint) = (&other.agent.route.path, other.s + other.agent.vehicle.rear_axle_to_center);
        let along = |x: f64, y: f64| path.project_near(Point::new(x, y), hint, WAY_WINDOW).map(|(s, _)| s);
        if points.is_empty() {
            return None;
        }
        let begin = along(status.state.x, status.state.y)? - 0.5 * status.length;
        let told_up_to = begin + WAY_SPACING * (way.len() as f64 - 1.0);
        let course = other.course.filtered(|zone| zone.entry < told_up_to);
        let (front, body) = match seen {
            // Its sensors know better than a message.
            Some(body) => (other.front(), body),
            None => {
                let age = (self.time_step - message.time_step) as f64 * self.scenario.dt;
                let now = interpolated(points, *spacing, age);
                let front = along(now.x, now.y)? + 0.5 * status.length;
                let at = |to_front: f64| {
                    let (lanelet, s) = course.lanelet_at(front - to_front)?;
                    Some(Place { lanelet, s, to_front })
                };
                let places = [at(0.0), at(status.length)].into_iter().flatten().collect();
                let velocity = now.velocity.max(0.0);
                bodies.push(Body { id: message.sender, length: status.length, velocity, places });
                (front, bodies.len() - 1)
            }
        };
        let (length, width) = (status.length, status.width);
        Some(Told { drive: other, body, extent: (length, width), front, request: *request, way: (begin, way), course })
    }

    /// Where the way of an agent and one that it was told of cross, as arc lengths on the paths of both [m].
    fn crossing(&self, drive: &Drive, told: &Told<'_>) -> Option<[(f64, f64); 2]> {
        let state = self.states[drive.row]?;
        let (length, width) = drive.agent.shape.extent();
        let path = &drive.agent.route.path;
        let rear = drive.front() - length;
        let n = (length + reach(state.velocity)).ceil() as usize;
        let at = |i: usize| {
            let foot = path.at(rear + i as f64);
            Pose { position: foot.position, orientation: foot.theta }
        };
        let (begin, way) = told.way;
        let gone = ((told.front - told.extent.0 - begin) / WAY_SPACING).max(0.0) as usize;
        let way: Vec<Pose> = way.iter().skip(gone).map(|at| Pose::new(at.x, at.y, at.orientation)).collect();
        let ours = strip(&(0..=n).map(at).collect::<Vec<_>>(), width);
        let theirs = strip(&way, told.extent.1);
        let are_apart = |one, other| self.participants.storeys.are_apart(one, other);
        let [(first, last), (enters, leaves)] = crossing(&ours, &theirs, &are_apart)?;
        let there = |i: usize| begin + WAY_SPACING * (gone + i) as f64;
        Some([(rear + first as f64, rear + last as f64), (there(enters), there(leaves))])
    }

    /// What an agent's sensors see, as it tells others.
    fn objects(&self, scene: &Scene, drive: &Drive) -> Vec<Object> {
        let participants = &scene.participants;
        let object = |place: &usize| {
            let row = scene.present[*place];
            let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
            let extent = participants.shape[row].extent();
            Object::rounded(participants.ids[row], participants.kind[row], &state, extent, participants.is_static[row])
        };
        self.sight(drive, scene, &scene.positions()).iter().map(object).collect()
    }
}
