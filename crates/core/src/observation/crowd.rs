//! The participants present as bodies, computed once for all observers.

use crate::geometry::{Point, Pose};
use crate::scene::{Participants, Scene, observed_speed};
use crate::trajectory::State;
use crate::vehicle::ParticipantKind;

/// Age of the past positions that the raster shows [s].
const PAST_AGE: f64 = 0.5;

/// A participant as an observer sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedBody {
    /// Its id.
    pub id: i64,
    /// Centre of its footprint, world frame [m].
    pub position: Point,
    /// Unit vector along its heading.
    pub axis: Point,
    /// Speed along its heading as it can be observed [m/s].
    pub velocity: f64,
    /// Length and width of its footprint [m].
    pub size: (f64, f64),
    /// Position among the four classes of an observation.
    pub(super) class: usize,
    /// Its row in the predictions; `None` if nothing is expected of it.
    pub predicted: Option<usize>,
    /// Centre [m] and unit vector along the heading half a second ago; `None` if it was not there or none is needed.
    pub(super) before: Option<(Point, Point)>,
}

impl ObservedBody {
    /// The participant in a row, in a state.
    pub fn new(participants: &Participants, row: usize, state: &State, velocity: f64) -> Self {
        let what = (participants.shape[row].extent(), participants.kind[row], participants.is_static[row]);
        Self::of(participants.ids[row], state.pose(), velocity, what)
    }

    /// Where it is.
    pub fn pose(&self) -> Pose {
        Pose { position: self.position, orientation: self.axis.angle() }
    }

    /// From its size [m], its kind, and whether it never moves.
    pub fn of(
        id: i64,
        pose: Pose,
        velocity: f64,
        (size, kind, is_static): ((f64, f64), ParticipantKind, bool),
    ) -> Self {
        let class = class(kind, is_static);
        Self::along(id, pose.position, Point::from_angle(pose.orientation), velocity, (size, class))
    }

    fn along(id: i64, position: Point, axis: Point, velocity: f64, (size, class): ((f64, f64), usize)) -> Self {
        Self { id, position, axis, velocity, size, class, predicted: None, before: None }
    }
}

/// Writes the bodies of all participants present, in the order of `Scene::present`, which is that of predictions; with
/// what a picture needs, if there is to be one.
pub fn bodies(scene: &Scene, is_drawn: bool, out: &mut Vec<ObservedBody>) {
    let then = scene.time_step - past_steps(scene.dt) as i64;
    out.clear();
    out.extend(scene.present.iter().enumerate().map(|(place, row)| {
        let state = scene.state(*row);
        let before = if is_drawn { scene.past.get(*row, then) } else { None };
        ObservedBody {
            predicted: Some(place),
            before: before.map(|state| (state.pose().position, Point::from_angle(state.orientation))),
            ..ObservedBody::new(&scene.participants, *row, &state, scene.observed_velocity(*row))
        }
    }));
}

/// Writes the bodies of the participants present, and their rows, as [`bodies`] writes those of a scene, but without
/// predictions and pictures. `present` has row and state of each, and an earlier state with the time steps since.
pub(crate) fn present_bodies<'a>(
    participants: &Participants,
    present: impl Iterator<Item = (usize, &'a State, Option<(usize, &'a State)>)>,
    dt: f64,
    rows: &mut Vec<usize>,
    out: &mut Vec<ObservedBody>,
) {
    rows.clear();
    out.clear();
    for (row, state, earlier) in present {
        let axis = Point::from_angle(state.orientation);
        let earlier = earlier.filter(|_| !participants.is_agent[row]);
        let velocity = observed_speed(state, axis, earlier, dt);
        let class = class(participants.kind[row], participants.is_static[row]);
        let what = (participants.shape[row].extent(), class);
        rows.push(row);
        out.push(ObservedBody::along(participants.ids[row], state.pose().position, axis, velocity, what));
    }
}

/// Time steps of the past that a picture needs.
pub fn past_steps(dt: f64) -> usize {
    (PAST_AGE / dt).round() as usize
}

/// Vehicle, two-wheeler, pedestrian, anything else.
fn class(kind: ParticipantKind, is_static: bool) -> usize {
    match kind {
        _ if is_static => 3,
        ParticipantKind::Motorcycle | ParticipantKind::Bicycle => 1,
        ParticipantKind::Pedestrian => 2,
        kind if kind.is_vehicle() => 0,
        _ => 3,
    }
}
