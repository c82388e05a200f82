//! Messages between agents: what they send in a step, and what they expect from what they received.

use std::cell::OnceCell;
use std::sync::OnceLock;

use super::{Agent, Drive, World};
use crate::barrier::Barrier;
use crate::error::Result;
use crate::geometry::Point;
use crate::predict::completed;
use crate::right_of_way::{Course, Zone};
use crate::scene::Scene;
use crate::trajectory::{PlanStatus, Plans, Predictions, State};
use crate::v2x::{
    self, Agreement, Crossing, Log, Negotiator, Neighbour, Network, Object, Observer, SharedPredictions, Speaker,
};

/// Past time steps from which speeds are observed.
const OBSERVED: usize = 3;

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
            let first = if settings.negotiate { self.note_crossings() } else { Vec::new() };
            let draws = (seed, self.scenario.dt);
            self.network = Some(Box::new(Network::new(settings, draws, equipped, first, level)));
        }
    }

    /// Notes the junction areas on the ways of the equipped agents; returns the side of each area that goes first by the
    /// rules of the road.
    fn note_crossings(&mut self) -> Vec<Option<usize>> {
        let junctions = self.scenario.junctions();
        for drive in self.drives.iter_mut().filter(|drive| drive.place.is_some()) {
            let Agent { route, vehicle, .. } = &*drive.agent;
            let map = (&*self.scenario.road, junctions);
            let course = Course::along(route, map, &drive.way.limits, vehicle);
            drive.crossings = course
                .zones()
                .map(|&Zone { area, side, entry, exit, .. }| Crossing { area, side, entry, exit })
                .collect();
            drive.crossings.sort_by_key(|crossing| (crossing.area, crossing.side));
            drive.crossings.dedup_by_key(|crossing| crossing.area);
        }
        junctions.areas.iter().map(|area| area.first).collect()
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
            let needs_bar = !planner.heeds_barriers();
            observers.push(Observer { id: *id, place, row: drive.row, view, needs_bar });
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
    pub(super) fn send_messages(&mut self, plans: &Plans) {
        let Some(mut network) = self.network.take() else { return };
        let scene = network.settings().cpm.then(|| self.scene_with_past(OBSERVED));
        let speakers = self.talking().map(|(place, drive)| self.speaker(place, drive, plans, scene.as_ref())).collect();
        let present = |drive: &Drive| Some((drive.place?, self.states[drive.row]?.pose().position));
        let listeners: Vec<(usize, Point)> = self.drives.iter().filter_map(present).collect();
        network.send(self.time_step, speakers, &listeners);
        self.network = Some(network);
    }

    fn speaker<'a>(&'a self, place: usize, drive: &'a Drive, plans: &Plans, scene: Option<&Scene>) -> Speaker<'a> {
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
        if network.settings().negotiate {
            self.negotiate(&mut network);
        }
        self.network = Some(network);
    }

    /// Stretches in which agents have held for others.
    pub fn agreements(&self) -> &[Agreement] {
        self.network.as_deref().map_or(&[], Network::agreements)
    }

    /// Where an agent waits because of an agreement.
    pub(super) fn agreed(&self, drive: &Drive) -> Option<Barrier> {
        Some(self.network.as_deref()?.bar(drive.place?)?.barrier)
    }

    /// Agents renew their claims from what has arrived and what they see.
    fn negotiate(&self, network: &mut Network) {
        let scene = OnceCell::new();
        let drives: Vec<(usize, &Drive)> = self.talking().collect();
        let agents: Vec<Negotiator<'_>> = drives.iter().map(|(place, drive)| self.negotiator(*place, drive)).collect();
        let mut places = vec![None; self.states.len()];
        self.drives.iter().for_each(|drive| places[drive.row] = drive.place);
        let around = |i: usize| {
            let (_, drive) = drives[i];
            // Most of the time there is nothing to agree about.
            let scene: &Scene = scene.get_or_init(|| self.scene_with_past(OBSERVED));
            let neighbour = |row: usize| {
                let place = places[row];
                let half_width = 0.5 * scene.participants.shape[row].extent().1;
                Neighbour { pose: scene.state(row).pose(), velocity: scene.observed_velocity(row), half_width, place }
            };
            self.sight(drive, scene, &scene.positions()).iter().map(|place| neighbour(scene.present[*place])).collect()
        };
        network.negotiate(self.time_step, &agents, &around);
    }

    fn negotiator<'a>(&'a self, place: usize, drive: &'a Drive) -> Negotiator<'a> {
        let state = self.states[drive.row].expect("a driving agent has a state");
        let vehicle = &drive.agent.vehicle;
        let (path, center) = (&drive.agent.route.path, drive.s + vehicle.rear_axle_to_center);
        let rear_axle = vehicle.rear_axle_from_center(state.pose());
        let offset = path.project_near(rear_axle, drive.s, 5.0).map_or(f64::INFINITY, |(_, d)| d);
        let told = [self.ordered(drive), self.crosswalk_ahead(drive)].into_iter().flatten();
        Negotiator {
            place,
            id: drive.agent.id,
            path,
            rear: center - 0.5 * vehicle.length,
            front: center + 0.5 * vehicle.length,
            offset,
            pose: state.pose(),
            velocity: state.velocity,
            extent: drive.agent.shape.extent(),
            storeys: &self.participants.storeys,
            crossings: &drive.crossings,
            is_ordered: !drive.course.pieces.is_empty(),
            line: told.map(|barrier| barrier.s).fold(self.line(drive), f64::min),
        }
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
