//! Messages: values, rounded as ETSI TS 102 894-2 rounds them, and never more than what the sender knows.

use std::f64::consts::PI;

use crate::columns::coded;
use crate::right_of_way::Memory;
use crate::trajectory::State;
use crate::vehicle::ParticipantKind;

/// Spacing of the way in a message [m].
pub(crate) const WAY_SPACING: f64 = 4.0;

/// What a message is for; the discriminant is its code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Service {
    /// State of the sender (ETSI EN 302 637-2).
    Cam = 0,
    /// Plan of the sender (ETSI TR 103 578).
    Mcm = 1,
    /// What the sender's sensors see (ETSI TS 103 324).
    Cpm = 2,
}

coded!(Service);

impl Service {
    /// All; the position is the code.
    pub const ALL: [Self; 3] = [Self::Cam, Self::Mcm, Self::Cpm];
}

/// A participant as a message states it: the sender itself, or one that it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Object {
    /// Its id.
    pub id: i64,
    /// Kind.
    pub kind: ParticipantKind,
    /// Centre of the footprint and motion.
    pub state: State,
    /// Length of the bounding box [m].
    pub length: f64,
    /// Width of the bounding box [m].
    pub width: f64,
    /// Never moves.
    pub is_static: bool,
}

/// What a message says besides its sender.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Payload {
    /// State.
    Cam(Object),
    /// State and plan: points `spacing` [s] apart, the first one at the time of sending.
    Mcm {
        /// State.
        status: Object,
        /// The plan is emergency braking.
        is_emergency: bool,
        /// Time between points [s].
        spacing: f64,
        /// The plan: positions, headings and speeds.
        points: Vec<State>,
        /// The reference path from the sender's rear end on, one point every 4 m.
        way: Vec<State>,
        /// Arc length on the reference path at which that begins [m].
        way_from: f64,
        /// What the sender asks for: the passage before which it is or that it is in, since when, and whether it has been
        /// granted; `None`: nothing.
        request: Option<Memory>,
    },
    /// Objects.
    Cpm(Vec<Object>),
}

/// A message as it is sent and received.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    /// Time step of sending.
    pub time_step: i64,
    /// Id of the sender.
    pub sender: i64,
    /// What it says.
    pub payload: Payload,
}

/// Bytes of a CAM.
const CAM_BYTES: usize = 350;
/// Bytes of an MCM without points, of a point of the plan and of one of the way.
const MCM_BYTES: [usize; 3] = [150, 10, 8];
/// Bytes of a request: passage and flags (2), time of arrival (6, as TimestampIts).
const REQUEST_BYTES: usize = 8;
/// Bytes of a CPM without objects, and of an object.
const CPM_BYTES: [usize; 2] = [121, 35];

impl Message {
    /// Its service.
    pub fn service(&self) -> Service {
        match self.payload {
            Payload::Cam(_) => Service::Cam,
            Payload::Mcm { .. } => Service::Mcm,
            Payload::Cpm(_) => Service::Cpm,
        }
    }

    /// Its size [B]. There is no standard for plans, so the sizes of an MCM are assumptions: 150 for head, state and
    /// flags, 10 a point of the plan, 8 a point of the way, 8 the request.
    pub fn bytes(&self) -> usize {
        match &self.payload {
            Payload::Cam(_) => CAM_BYTES,
            Payload::Mcm { points, way, request, .. } => {
                let plan = MCM_BYTES[0] + MCM_BYTES[1] * points.len() + MCM_BYTES[2] * way.len();
                plan + REQUEST_BYTES * usize::from(request.is_some())
            }
            Payload::Cpm(objects) => CPM_BYTES[0] + CPM_BYTES[1] * objects.len(),
        }
    }

    /// State of the sender; `None` if the message does not say it.
    pub fn status(&self) -> Option<&Object> {
        match &self.payload {
            Payload::Cam(status) | Payload::Mcm { status, .. } => Some(status),
            Payload::Cpm(_) => None,
        }
    }

    /// Cuts a plan that is too long, from the far end: the way, then the plan.
    pub(super) fn cut(&mut self, max_bytes: usize) {
        let mut over = self.bytes().saturating_sub(max_bytes);
        if let Payload::Mcm { points, way, .. } = &mut self.payload {
            shorten(way, MCM_BYTES[2], &mut over);
            shorten(points, MCM_BYTES[1], &mut over);
        }
    }
}

/// Drops the last entries, of `bytes` bytes each, until a message is no longer `over` its size, or none is left.
fn shorten<T>(entries: &mut Vec<T>, bytes: usize, over: &mut usize) {
    let dropped = over.div_ceil(bytes).min(entries.len());
    entries.truncate(entries.len() - dropped);
    *over = over.saturating_sub(dropped * bytes);
}

/// Largest number of objects in a CPM.
pub(super) fn objects_max(max_bytes: usize) -> usize {
    ((max_bytes - CPM_BYTES[0]) / CPM_BYTES[1]).min(255)
}

fn rounded(value: f64, unit: f64) -> f64 {
    (value / unit).round() * unit
}

/// A size [m], rounded up.
fn size(value: f64) -> f64 {
    (value / 0.1 - 1e-9).ceil() * 0.1
}

impl Object {
    /// As it is sent.
    pub(crate) fn rounded(
        id: i64,
        kind: ParticipantKind,
        state: &State,
        (length, width): (f64, f64),
        is_static: bool,
    ) -> Self {
        let state = State {
            x: rounded(state.x, 0.01),
            y: rounded(state.y, 0.01),
            orientation: rounded(state.orientation, PI / 1800.0),
            velocity: rounded(state.velocity, 0.01),
            acceleration: rounded(state.acceleration, 0.1),
            yaw_rate: rounded(state.yaw_rate, PI / 18_000.0),
        };
        Self { id, kind, state, length: size(length), width: size(width), is_static }
    }
}

/// A point of a plan as it is sent: position, heading and speed.
pub(super) fn plan_point(state: &State) -> State {
    State {
        x: rounded(state.x, 0.01),
        y: rounded(state.y, 0.01),
        orientation: rounded(state.orientation, PI / 1800.0),
        velocity: rounded(state.velocity, 0.01),
        ..State::default()
    }
}
