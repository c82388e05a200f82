//! Everything about messages that changes from step to step; part of the world.

use std::collections::VecDeque;
use std::sync::Arc;

use super::V2xSettings;
use super::channel::{arrival, reception};
use super::inbox::Inbox;
use super::log::{Agreement, Log, Logged, Row};
use super::message::{Message, Object, Payload, WAY_SPACING, objects_max, plan_point};
use super::trigger::Sent;
use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;
use crate::right_of_way::Memory;
use crate::trajectory::State;
use crate::vehicle::ParticipantKind;

/// What an agent can tell now.
#[derive(Debug)]
pub(crate) struct Speaker<'a> {
    /// Its place among the equipped agents.
    pub(crate) place: usize,
    pub(crate) kind: ParticipantKind,
    pub(crate) state: State,
    /// Length and width [m].
    pub(crate) extent: (f64, f64),
    /// Its plan from now on.
    pub(crate) plan: &'a [State],
    pub(crate) is_emergency: bool,
    /// What it asks for.
    pub(crate) request: Option<Memory>,
    /// Its reference path, and the arc length of its rear end on it [m].
    pub(crate) path: &'a ReferencePath,
    pub(crate) rear_s: f64,
    /// What its sensors see; empty unless that is sent.
    pub(crate) objects: Vec<Object>,
}

/// Messages of all equipped agents.
#[derive(Debug, Clone)]
pub(crate) struct Radio {
    pub(super) settings: V2xSettings,
    seed: u64,
    pub(super) dt: f64,
    /// Ids of the equipped agents, ascending.
    ids: Vec<i64>,
    sent: Vec<Sent>,
    pub(super) inboxes: Vec<Inbox>,
    /// What arrives in one step, in two, and so on: the receiver's place, and the message.
    queue: VecDeque<Vec<(usize, Arc<Message>)>>,
    agreements: Vec<Agreement>,
    log: Log,
    /// Memory: bytes that each agent hears in a step; links of a message; points of a plan.
    heard: Vec<usize>,
    links: Vec<(i64, Option<i64>, f64)>,
    points: Vec<State>,
}

impl Radio {
    pub(crate) fn new(settings: V2xSettings, (seed, dt): (u64, f64), ids: Vec<i64>, level: Logged) -> Self {
        let n = ids.len();
        Self {
            settings,
            seed,
            dt,
            ids,
            sent: vec![Sent::default(); n],
            inboxes: vec![Inbox::new(n); n],
            queue: VecDeque::new(),
            agreements: Vec::new(),
            log: Log { level, ..Log::default() },
            heard: vec![0; n],
            links: Vec::new(),
            points: Vec::new(),
        }
    }

    pub(crate) fn settings(&self) -> &V2xSettings {
        &self.settings
    }

    pub(crate) fn log(&self) -> &Log {
        &self.log
    }

    /// Stretches in which agents held for others.
    pub(crate) fn agreements(&self) -> &[Agreement] {
        &self.agreements
    }

    /// Notes that an agent holds for another at a time step; called in the order of time.
    pub(crate) fn note_agreement(&mut self, new: Agreement) {
        let is_same =
            |old: &&mut Agreement| (old.holding, old.going) == (new.holding, new.going) && old.last == new.first - 1;
        match self.agreements.iter_mut().rev().find(is_same) {
            Some(old) => old.last = new.last,
            None => self.agreements.push(new),
        }
    }

    /// The newest messages with plans that an agent has received, with the places of their senders.
    pub(crate) fn plans(&self, receiver: usize) -> impl Iterator<Item = (usize, &Message)> {
        let heard = self.inboxes[receiver].heard.iter().enumerate().filter(move |(sender, _)| *sender != receiver);
        heard.filter_map(|(sender, [_, plan])| Some((sender, &**plan.as_ref()?)))
    }

    /// Ids of the equipped agents, ascending.
    pub(crate) fn ids(&self) -> &[i64] {
        &self.ids
    }

    /// Place of an agent among the equipped ones.
    pub(crate) fn place(&self, id: i64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    /// Sends the messages due at a time step. Speakers by ascending id; `listeners` are places and positions of the
    /// equipped agents that are present.
    pub(crate) fn send(&mut self, now: i64, speakers: Vec<Speaker<'_>>, listeners: &[(usize, Point)]) {
        for mut speaker in speakers {
            let from = speaker.state.pose().position;
            let id = self.ids[speaker.place];
            let status = Object::rounded(id, speaker.kind, &speaker.state, speaker.extent, false);
            if self.settings.cam && self.sent[speaker.place].cam(now, &speaker.state, self.dt) {
                self.broadcast(now, speaker.place, from, Payload::Cam(status), listeners);
            }
            if self.settings.mcm
                && let Some(payload) = self.maneuver(now, &speaker, status)
            {
                self.broadcast(now, speaker.place, from, payload, listeners);
            }
            let sent = &mut self.sent[speaker.place];
            if self.settings.cpm && sent.is_list_due(now, self.dt) {
                let n_max = objects_max(self.settings.max_bytes);
                let seen = std::mem::take(&mut speaker.objects);
                let objects = sent.objects(now, &speaker.state, seen, n_max, self.dt);
                if !objects.is_empty() {
                    self.broadcast(now, speaker.place, from, Payload::Cpm(objects), listeners);
                }
            }
        }
    }

    /// The message with a speaker's plan, if it is due.
    fn maneuver(&mut self, now: i64, speaker: &Speaker<'_>, status: Object) -> Option<Payload> {
        let V2xSettings { plan_spacing: spacing, plan_horizon, mcm_interval, way_ahead, .. } = self.settings;
        let points = &mut self.points;
        sample(speaker.plan, self.dt, (spacing, plan_horizon), points);
        let sent = &mut self.sent[speaker.place];
        let request = speaker.request;
        if !sent.is_request_news(request.as_ref()) && !sent.is_plan_due(now, points, (mcm_interval, spacing, self.dt)) {
            return None;
        }
        sent.note_plan(now, points, spacing, request);
        let n_way = (way_ahead / WAY_SPACING) as usize + 1;
        let way = (0..n_way).map(|i| {
            let at = speaker.path.at(speaker.rear_s + i as f64 * WAY_SPACING);
            let state = State { x: at.position.x, y: at.position.y, orientation: at.theta, ..State::default() };
            plan_point(&state)
        });
        let (way, points, is_emergency) = (way.collect(), points.clone(), speaker.is_emergency);
        Some(Payload::Mcm { status, is_emergency, spacing, points, way, way_from: speaker.rear_s, request })
    }

    fn broadcast(&mut self, now: i64, sender: usize, from: Point, payload: Payload, listeners: &[(usize, Point)]) {
        let mut message = Message { time_step: now, sender: self.ids[sender], payload };
        message.cut(self.settings.max_bytes);
        let (service, message) = (message.service(), Arc::new(message));
        let (mut in_range, mut received) = (0, 0);
        self.links.clear();
        for (receiver, position) in listeners.iter().copied().filter(|(receiver, _)| *receiver != sender) {
            let distance = position.distance(from);
            let is_near = distance <= self.settings.range;
            let probability = reception(&self.settings, distance);
            let way = [now, self.ids[sender], self.ids[receiver], service as i64];
            let arrival = arrival(&self.settings, self.seed, way, probability, self.dt);
            if is_near || arrival.is_some() {
                in_range += 1;
                self.links.push((self.ids[receiver], arrival, distance));
            }
            let Some(arrival) = arrival else { continue };
            received += 1;
            let ahead = (arrival - now - 1) as usize;
            if self.queue.len() <= ahead {
                self.queue.resize(ahead + 1, Vec::new());
            }
            self.queue[ahead].push((receiver, Arc::clone(&message)));
        }
        let (objects, points) = match &message.payload {
            Payload::Cam(_) => (0, 0),
            Payload::Mcm { points, .. } => (0, points.len()),
            Payload::Cpm(objects) => (objects.len(), 0),
        };
        let (sender, bytes) = (self.ids[sender], message.bytes());
        let row = Row {
            time_step: now,
            sender,
            service,
            bytes,
            objects,
            points,
            in_range,
            received,
            receiver: None,
            arrived: None,
            distance: f64::NAN,
        };
        self.log.note(row, &self.links);
    }

    /// Files messages that arrive at a time step, and discards messages that are too old.
    pub(crate) fn file(&mut self, now: i64) {
        self.heard.fill(0);
        let mut arrived = self.queue.pop_front().unwrap_or_default();
        for (receiver, message) in arrived.drain(..) {
            let sender = self.place(message.sender).expect("senders are equipped");
            self.heard[receiver] += message.bytes();
            self.inboxes[receiver].file(sender, &message);
        }
        self.log.peak_bytes = self.heard.iter().copied().fold(self.log.peak_bytes, usize::max);
        let before = now - (self.settings.age_max / self.dt + 1e-9) as i64;
        self.inboxes.iter_mut().for_each(|inbox| inbox.forget(before));
        // The memory is used again.
        self.queue.push_back(arrived);
    }
}

/// The points of a plan every `spacing` [s], up to `horizon` or its end.
fn sample(plan: &[State], dt: f64, (spacing, horizon): (f64, f64), points: &mut Vec<State>) {
    let duration = (plan.len().max(1) - 1) as f64 * dt;
    let n = (horizon.min(duration) / spacing + 1e-9) as usize + 1;
    points.clear();
    points.extend((0..n).map(|i| {
        let place = i as f64 * spacing / dt;
        let at = ((place + 1e-9) as usize).min(plan.len() - 1);
        let (from, to) = (&plan[at], &plan[(at + 1).min(plan.len() - 1)]);
        let share = (place - at as f64).max(0.0);
        let between = |from: f64, to: f64| if share > 1e-9 { from + (to - from) * share } else { from };
        let turn = crate::geometry::wrap_angle(to.orientation - from.orientation);
        plan_point(&State {
            x: between(from.x, to.x),
            y: between(from.y, to.y),
            orientation: between(from.orientation, from.orientation + turn),
            velocity: between(from.velocity, to.velocity),
            ..State::default()
        })
    }));
}
