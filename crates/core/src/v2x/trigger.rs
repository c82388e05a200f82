//! When messages are sent: the rules of ETSI for states and objects; plans at intervals and when they change.

use std::collections::BTreeMap;

use super::message::Object;
use crate::geometry::wrap_angle;
use crate::right_of_way::Memory;
use crate::trajectory::State;

/// A state that differs by more from the last one sent is sent: heading [rad], position [m], speed [m/s].
const HEADING_CHANGE: f64 = 4.0 * std::f64::consts::PI / 180.0;
const POSITION_CHANGE: f64 = 4.0;
const SPEED_CHANGE: f64 = 0.5;
/// Shortest and longest time between states [s].
const INTERVAL_MIN: f64 = 0.1;
const INTERVAL_MAX: f64 = 1.0;
/// Number of states for which the interval of the last change is kept.
const INTERVAL_REPEATS: u32 = 3;
/// Distance of a planned point from the point sent for the same time that triggers a message [m].
const PLAN_CHANGE: f64 = 0.5;

fn has_changed(now: &State, then: &State) -> bool {
    wrap_angle(now.orientation - then.orientation).abs() > HEADING_CHANGE
        || now.pose().position.distance(then.pose().position) > POSITION_CHANGE
        || (now.velocity - then.velocity).abs() > SPEED_CHANGE
}

/// Which time step is at least this long [s] after another.
fn is_due(now: i64, then: i64, interval: f64, dt: f64) -> bool {
    (now - then) as f64 * dt >= interval - 1e-9
}

/// What an agent remembers of the messages that it sent.
#[derive(Debug, Clone, Default)]
pub(super) struct Sent {
    cam: Option<(i64, State)>,
    /// Interval until the next state without a change [s], and how often it was used.
    interval: f64,
    repeats: u32,
    mcm: Option<(i64, f64, Vec<State>)>,
    cpm: Option<i64>,
    request: Option<Memory>,
    objects: BTreeMap<i64, (i64, State)>,
}

impl Sent {
    /// A state is to be sent; notes that it is.
    pub(super) fn cam(&mut self, now: i64, state: &State, dt: f64) -> bool {
        let Some((then, sent)) = self.cam else {
            (self.cam, self.interval) = (Some((now, *state)), INTERVAL_MAX);
            return true;
        };
        let passed = (now - then) as f64 * dt;
        if passed < INTERVAL_MIN - 1e-9 {
            return false;
        }
        if has_changed(state, &sent) {
            (self.interval, self.repeats) = (passed.clamp(INTERVAL_MIN, INTERVAL_MAX), 0);
        } else if is_due(now, then, self.interval, dt) {
            self.repeats += 1;
            if self.repeats >= INTERVAL_REPEATS {
                self.interval = INTERVAL_MAX;
            }
        } else {
            return false;
        }
        self.cam = Some((now, *state));
        true
    }

    /// A plan with these points is to be sent.
    pub(super) fn is_plan_due(&self, now: i64, points: &[State], (interval, spacing, dt): (f64, f64, f64)) -> bool {
        let Some((then, _, sent)) = &self.mcm else { return true };
        if is_due(now, *then, interval, dt) {
            return true;
        }
        let age = (now - then) as f64 * dt;
        points.iter().enumerate().any(|(i, point)| {
            // Where it was going to be at this time, for as long as the last message says it.
            let at = age + i as f64 * spacing;
            at <= (sent.len().max(1) - 1) as f64 * spacing && {
                let before = interpolated(sent, spacing, at);
                (before.x - point.x).hypot(before.y - point.y) > PLAN_CHANGE
            }
        })
    }

    /// What the sender asks for differs from what was sent.
    pub(super) fn is_request_news(&self, request: Option<&Memory>) -> bool {
        let told = |memory: &Memory| (memory.passage, memory.ticket, memory.granted, memory.has_entered);
        self.request.as_ref().map(told) != request.map(told)
    }

    /// Notes that a plan is sent, and a request.
    pub(super) fn note_plan(&mut self, now: i64, points: &[State], spacing: f64, request: Option<Memory>) {
        self.request = request;
        let (time_step, old_spacing, kept) = self.mcm.get_or_insert_default();
        (*time_step, *old_spacing) = (now, spacing);
        kept.clear();
        kept.extend_from_slice(points);
    }

    /// Objects are looked at now.
    pub(super) fn is_list_due(&self, now: i64, dt: f64) -> bool {
        self.cpm.is_none_or(|then| is_due(now, then, INTERVAL_MIN, dt))
    }

    /// The visible objects to send, at most `n_max`: by the longest time since they were sent, then by distance to the
    /// sender, then by id. Marks them as sent.
    pub(super) fn objects(&mut self, now: i64, own: &State, seen: Vec<Object>, n_max: usize, dt: f64) -> Vec<Object> {
        let sent = &self.objects;
        let is_due = |object: &Object| {
            sent.get(&object.id)
                .is_none_or(|(then, state)| has_changed(&object.state, state) || is_due(now, *then, INTERVAL_MAX, dt))
        };
        let mut due: Vec<Object> = seen.into_iter().filter(is_due).collect();
        if due.len() > n_max {
            let key = |object: &Object| {
                let then = sent.get(&object.id).map_or(i64::MIN, |(then, _)| *then);
                (then, object.state.pose().position.distance(own.pose().position), object.id)
            };
            due.sort_by(|a, b| {
                let (a, b) = (key(a), key(b));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
            });
            due.truncate(n_max);
            due.sort_by_key(|object| object.id);
        }
        if !due.is_empty() {
            self.cpm = Some(now);
            due.iter().for_each(|object| _ = self.objects.insert(object.id, (now, object.state)));
        }
        due
    }
}

/// A plan at a time after its first point [s]; behind its end straight on at its last speed.
pub(crate) fn interpolated(points: &[State], spacing: f64, time: f64) -> State {
    let last = points.len() - 1;
    let place = (time / spacing).max(0.0);
    let i = (place as usize).min(last);
    let from = points[i];
    if i == last {
        let way = from.velocity * (time - last as f64 * spacing);
        let (sin, cos) = from.orientation.sin_cos();
        return State { x: from.x + way * cos, y: from.y + way * sin, ..from };
    }
    let (to, share) = (points[i + 1], place - i as f64);
    State {
        x: from.x + (to.x - from.x) * share,
        y: from.y + (to.y - from.y) * share,
        orientation: from.orientation + wrap_angle(to.orientation - from.orientation) * share,
        velocity: from.velocity + (to.velocity - from.velocity) * share,
        ..State::default()
    }
}
