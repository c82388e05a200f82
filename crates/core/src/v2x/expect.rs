//! What was received as predictions: a row of its own for every message that says more than the predictor knows.
//!
//! A predictor answers once for all agents, but every agent has received something else. So rows are added behind those of
//! the predictor, and every agent knows which of them are its own.

use crate::conduct::STANDSTILL_SPEED;
use std::collections::BTreeMap;
use std::sync::Arc;

use super::know::{Known, Via, moved};
use super::message::{Message, Object, Payload};
use super::radio::Radio;
use super::trigger::interpolated;
use crate::barrier::Barrier;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose};
use crate::predict::{STATIONARY_VARIANCE, told as write_told, write};
use crate::road::RoadNetwork;
use crate::scene::{Scene, ViewLimits};
use crate::trajectory::{Predictions, State};
use crate::vehicle::ParticipantKind;

/// Id of the bar before which an agent holds.
const BAR: i64 = -1;
/// Its length, and its largest width to each side [m]; it is not wider than this share of the radius of the curve on a
/// stretch of path before it [m].
const BAR_LENGTH: f64 = 0.3;
const BAR_SIDE: f64 = 6.0;
const BAR_CURVE: f64 = 0.8;
const BAR_STRETCH: f64 = 15.0;
/// A plan that ends earlier is not used [s].
const SHORTEST_PLAN: f64 = 1.0;
/// An agent this much faster or slower than planned [m/s] does not follow its plan.
const SPEED_DEVIATION: f64 = 2.0;
/// The distance between an agent in sight and its plan fades within this time [s].
const FADING_TIME: f64 = 1.0;

/// A participant as an additional row describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Extra {
    /// Its id.
    pub id: i64,
    /// Kind.
    pub kind: ParticipantKind,
    /// Where it is now, as far as the agent was told.
    pub state: State,
    /// Footprint in its body frame: a rectangle; that of a participant in sight is known better.
    pub shape: Shape,
    /// Never moves.
    pub is_static: bool,
    /// The agent that told it, or that holds before it.
    pub sender: i64,
    /// Age of what was told [s].
    pub age: f64,
}

/// What all agents expect and know at a time step.
#[derive(Debug, Clone)]
pub struct SharedPredictions {
    /// One row for each participant present, as the predictor says, then one for each of `extras`.
    pub table: Arc<Predictions>,
    /// Additional rows.
    pub extras: Vec<Extra>,
    /// What every equipped agent knows, by its id, sorted by id; all others know what their sensors see.
    pub known: BTreeMap<i64, Vec<Known>>,
}

impl SharedPredictions {
    /// Number of participants present.
    pub fn n_present(&self) -> usize {
        self.table.ids.len() - self.extras.len()
    }

    /// What describes an additional row; `None` for a participant present.
    pub fn extra(&self, row: usize) -> Option<&Extra> {
        self.extras.get(row.checked_sub(self.n_present())?)
    }

    /// Ages of all received plans that are used instead of a prediction [s].
    pub fn ages(&self) -> impl Iterator<Item = f64> {
        let uses = |known: &&Known| known.via != Via::Cpm && known.age > 0.0;
        self.known.values().flatten().filter(uses).map(|known| known.age)
    }
}

/// An equipped agent that drives now.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observer<'a> {
    pub(crate) id: i64,
    /// Its place among the equipped agents, and its row among the participants.
    pub(crate) place: usize,
    pub(crate) row: usize,
    pub(crate) view: &'a ViewLimits,
    /// Its planner knows of no place where to hold, so it needs to see a bar there: its path and the barrier.
    pub(crate) bar: Option<(&'a ReferencePath, Barrier)>,
}

/// The table with its additional rows.
#[derive(Debug)]
struct Additional {
    table: Predictions,
    extras: Vec<Extra>,
    /// By sender: time step of the plan, whether the sender is in sight, and the row if the plan can be used.
    plans: Vec<Vec<(i64, bool, Option<usize>)>>,
    /// By id, and time step and sender of what was told.
    told: BTreeMap<(i64, i64, i64), usize>,
}

impl Additional {
    /// Adds a row, which is still to be written.
    fn push(&mut self, extra: Extra) -> usize {
        let row = self.table.push_row(extra.id);
        self.extras.push(extra);
        row
    }

    fn extra(&self, row: usize) -> &Extra {
        &self.extras[row + self.extras.len() - self.table.ids.len()]
    }
}

impl Radio {
    /// What all agents expect: `table` is that of a predictor, with a row for each participant present. `visible` are the
    /// places among those present that each observer sees.
    pub(crate) fn expect(
        &self,
        (scene, road): (&Scene, &RoadNetwork),
        table: &Predictions,
        observers: &[Observer<'_>],
        visible: &[&[usize]],
    ) -> SharedPredictions {
        let ids: Vec<i64> = scene.present.iter().map(|row| scene.participants.ids[*row]).collect();
        let senders: Vec<Option<usize>> = ids.iter().map(|id| self.place(*id)).collect();
        let (extras, plans) = (Vec::new(), vec![Vec::new(); self.ids().len()]);
        let mut more = Additional { table: table.clone(), extras, plans, told: BTreeMap::new() };
        let mut known = BTreeMap::new();
        for (observer, visible) in observers.iter().zip(visible) {
            let found = self.knowledge((scene, road), observer, (visible, &ids, &senders), &mut more);
            known.insert(observer.id, found);
        }
        SharedPredictions { table: Arc::new(more.table), extras: more.extras, known }
    }

    /// What an agent knows, sorted by id. `visible` are places among those present, `ids` their ids, `senders` their
    /// places among the equipped agents.
    fn knowledge(
        &self,
        (scene, road): (&Scene, &RoadNetwork),
        observer: &Observer<'_>,
        (visible, ids, senders): (&[usize], &[i64], &[Option<usize>]),
        more: &mut Additional,
    ) -> Vec<Known> {
        let inbox = &self.inboxes[observer.place];
        let age = |message: &Message| (scene.time_step - message.time_step) as f64 * self.dt;
        let mut known = Vec::with_capacity(visible.len());
        for place in visible.iter().copied() {
            let plan = senders[place].and_then(|sender| inbox.heard[sender][1].as_ref().map(|plan| (sender, plan)));
            let row = plan.and_then(|(sender, plan)| self.plan_row(scene, sender, plan, Some(place), more));
            let age = row.and(plan).map_or(0.0, |(_, plan)| age(plan));
            let row = row.unwrap_or(place);
            known.push(Known { id: ids[place], via: Via::Sensors, age, row, seen: Some(place) });
        }
        let is_seen = |known: &[Known], id: i64| known[..visible.len()].binary_search_by_key(&id, |k| k.id).is_ok();
        let mut told: Vec<Known> = Vec::new();
        for (sender, [cam, mcm]) in inbox.heard.iter().enumerate() {
            let id = self.ids()[sender];
            let newest = match (cam, mcm) {
                (Some(cam), Some(mcm)) if cam.time_step > mcm.time_step => cam,
                (_, Some(message)) | (Some(message), None) => message,
                (None, None) => continue,
            };
            if sender == observer.place || is_seen(&known, id) {
                continue;
            }
            let status = *newest.status().expect("these messages say it");
            let plan = mcm.as_ref();
            let planned = plan.and_then(|plan| Some((plan, self.plan_row(scene, sender, plan, None, more)?)));
            let (row, age) = match planned {
                Some((plan, row)) => (row, age(plan)),
                None => (self.told_row(&status, newest.time_step, id, (scene, road), more), age(newest)),
            };
            told.push(Known { id, via: Via::Cam, age, row, seen: None });
        }
        keep_unseen(scene, observer, &mut told, more);
        known.append(&mut told);
        let n_heard = known.len();
        for (&id, (time_step, sender, object)) in &inbox.objects {
            let is_heard = known[visible.len()..n_heard].binary_search_by_key(&id, |k| k.id).is_ok();
            if id == observer.id || is_seen(&known, id) || is_heard {
                continue;
            }
            let row = self.told_row(object, *time_step, self.ids()[*sender], (scene, road), more);
            let age = (scene.time_step - time_step) as f64 * self.dt;
            told.push(Known { id, via: Via::Cpm, age, row, seen: None });
        }
        keep_unseen(scene, observer, &mut told, more);
        known.append(&mut told);
        if let Some((path, barrier)) = observer.bar {
            let (state, shape) = bar(path, barrier.s);
            let (kind, is_static) = (ParticipantKind::ConstructionZone, barrier.until.is_infinite());
            let row = more.push(Extra { id: BAR, kind, state, shape, is_static, sender: observer.id, age: 0.0 });
            let table = &mut more.table;
            write_told(table, row, (kind, true), &state, 0.0, (self.dt, road));
            let closed = (barrier.until / self.dt).ceil().max(1.0) as usize;
            let start = table.offset(row, 0);
            table.valid[start..start + table.n_steps].iter_mut().skip(closed).for_each(|valid| *valid = false);
            known.push(Known { id: BAR, via: Via::Hold, age: 0.0, row, seen: None });
        }
        known.sort_by_key(|known| known.id);
        known
    }

    /// The additional row of a received plan; `None` if it cannot be used. `seen` is the place of its sender among those
    /// present if it is in sight.
    fn plan_row(
        &self,
        scene: &Scene,
        sender: usize,
        message: &Arc<Message>,
        seen: Option<usize>,
        more: &mut Additional,
    ) -> Option<usize> {
        let key =
            |(time_step, in_sight, _): &&(i64, bool, _)| *time_step == message.time_step && *in_sight == seen.is_some();
        if let Some((.., row)) = more.plans[sender].iter().find(key) {
            return *row;
        }
        let row = self.planned(scene, message, seen).map(|(extra, off)| {
            let age = extra.age;
            let row = more.push(extra);
            self.write_plan(&mut more.table, row, message, age, off);
            row
        });
        more.plans[sender].push((message.time_step, seen.is_some(), row));
        row
    }

    /// The sender of a plan where it is now, and how far it is from its plan [m].
    fn planned(&self, scene: &Scene, message: &Message, seen: Option<usize>) -> Option<(Extra, Point)> {
        let Payload::Mcm { status, is_emergency, spacing, points, .. } = &message.payload else { return None };
        // The next plan of an emergency is another one: it says no more than a short plan.
        if *is_emergency || ((points.len().max(1) - 1) as f64) * spacing < SHORTEST_PLAN - 1e-9 {
            return None;
        }
        let age = (scene.time_step - message.time_step) as f64 * self.dt;
        let planned = interpolated(points, *spacing, age);
        let (mut state, mut off) = (planned, Point::default());
        if let Some(place) = seen {
            let row = scene.present[place];
            let (now, velocity) = (scene.state(row), scene.observed_velocity(row));
            off = now.pose().position - state.pose().position;
            if off.norm() > self.settings.deviation || (velocity - planned.velocity).abs() > SPEED_DEVIATION {
                return None;
            }
            state = now;
        }
        let shape = Shape::rectangle(status.length, status.width);
        let (id, kind) = (message.sender, status.kind);
        Some((Extra { id, kind, state, shape, is_static: false, sender: id, age }, off))
    }

    /// The additional row of a participant whose state was told by a sender.
    fn told_row(
        &self,
        object: &Object,
        time_step: i64,
        sender: i64,
        (scene, road): (&Scene, &RoadNetwork),
        more: &mut Additional,
    ) -> usize {
        let key = (object.id, time_step, sender);
        if let Some(row) = more.told.get(&key) {
            return *row;
        }
        let age = (scene.time_step - time_step) as f64 * self.dt;
        let Object { id, kind, is_static, .. } = *object;
        let state = if is_static { object.state } else { moved(object, age) };
        let shape = Shape::rectangle(object.length, object.width);
        let row = more.push(Extra { id, kind, state, shape, is_static, sender, age });
        write_told(&mut more.table, row, (kind, is_static), &state, age, (self.dt, road));
        more.told.insert(key, row);
        row
    }

    fn write_plan(&self, out: &mut Predictions, row: usize, message: &Message, age: f64, off: Point) {
        let Payload::Mcm { spacing, points, .. } = &message.payload else { unreachable!("only plans are written") };
        let settings = &self.settings;
        out.probability[row * out.n_modes] = 1.0;
        let start = out.offset(row, 0);
        let mut has_stood = true;
        for j in 0..out.n_steps {
            let ahead = (j + 1) as f64 * self.dt;
            let t = age + ahead;
            let State { x, y, orientation, velocity, .. } = interpolated(points, *spacing, t);
            has_stood &= velocity.abs() < STANDSTILL_SPEED;
            let left = (1.0 - ahead / FADING_TIME).max(0.0);
            let (along, across) = if has_stood {
                (STATIONARY_VARIANCE, STATIONARY_VARIANCE)
            } else {
                let variance = |rate: f64| settings.plan_sigma.powi(2) + (rate * t).powi(2);
                (variance(settings.plan_along), variance(settings.plan_across))
            };
            let (sin, cos) = orientation.sin_cos();
            let covariance = (
                along * cos * cos + across * sin * sin,
                (along - across) * sin * cos,
                along * sin * sin + across * cos * cos,
            );
            let position = Point::new(x, y) + off * left;
            let pose = Pose { position, orientation };
            write(out, start + j, pose, velocity, covariance);
        }
    }
}

/// A bar across a path whose near edge is at an arc length [m].
fn bar(path: &ReferencePath, s: f64) -> (State, Shape) {
    let at = path.at(s + 0.5 * BAR_LENGTH);
    let curve = (0..=BAR_STRETCH as usize).map(|k| path.at(s - k as f64).curvature.abs()).fold(0.0, f64::max);
    let side = BAR_SIDE.min(BAR_CURVE / curve.max(1e-6));
    let state = State { x: at.position.x, y: at.position.y, orientation: at.theta, ..State::default() };
    (state, Shape::rectangle(BAR_LENGTH, 2.0 * side))
}

/// Drops what the agent's sensors would see where it was told to be, unless they miss it now, and what drives above or
/// below it.
fn keep_unseen(scene: &Scene, observer: &Observer<'_>, told: &mut Vec<Known>, more: &Additional) {
    if told.is_empty() {
        return;
    }
    let body = |known: &Known| {
        let extra = more.extra(known.row);
        (&extra.shape, extra.state.pose(), extra.is_static)
    };
    let bodies: Vec<_> = told.iter().map(body).collect();
    let mut seen = scene.would_see(observer.row, observer.view, &bodies, &|_| true).into_iter();
    let (pose, storeys) = (scene.state(observer.row).pose(), &scene.participants.storeys);
    let misses = |known: &Known| observer.view.misses([observer.id, known.id], scene.time_step);
    told.retain(|known| {
        let is_seen = seen.next() == Some(true) && !misses(known);
        !is_seen && !storeys.are_apart(pose, more.extra(known.row).state.pose())
    });
}
