//! What can be seen: everybody who is present at one time step, with their past. Neither the recorded future nor
//! anybody's plan is here.

mod contact;
pub mod sight;

use std::sync::Arc;

use crate::geometry::Point;
use crate::geometry::shape::Shape;
use crate::trajectory::{State, States};
use crate::vehicle::ParticipantKind;

/// What does not change about the participants of a world; rows sorted by id.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Participants {
    /// Ids, ascending.
    pub ids: Vec<i64>,
    /// Kinds.
    pub kind: Vec<ParticipantKind>,
    /// Footprints in their body frames.
    pub shape: Vec<Shape>,
    /// Never moves, never leaves.
    pub is_static: Vec<bool>,
    /// Driven by a planner; the others replay their recording.
    pub is_agent: Vec<bool>,
}

/// What an agent can see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewLimits {
    /// Who is further away [m] is not seen: centre to centre, to the nearest point of a circle around static obstacles.
    pub sensor_radius: f64,
    /// Who is hidden behind others is not seen; see [`sight::seen_from`]. The eye is the centre of the own footprint.
    /// Everything hides but pedestrians, bicycles and motorcycles, past which one can look.
    pub occlusion: bool,
}

impl Default for ViewLimits {
    fn default() -> Self {
        Self { sensor_radius: 80.0, occlusion: false }
    }
}

/// All participants at one time step.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Now.
    pub time_step: i64,
    /// Time between steps [s].
    pub dt: f64,
    /// Who takes part in the world, present or not.
    pub participants: Arc<Participants>,
    /// Rows of `participants` that are present now, ascending.
    pub present: Vec<usize>,
    /// Present and past of all participants; the last column is now. A row is cut where the participant left, so
    /// somebody who is gone has no past either.
    pub past: States,
}

impl Scene {
    /// State now of a row of `participants` that is present.
    pub fn state(&self, row: usize) -> State {
        self.past.get(row, self.time_step).expect("rows in `present` have a state now")
    }

    /// Speed along the heading [m/s] as it can be observed: the stated one, unless a recorded participant's last positions
    /// contradict the speeds stated for them by more than 1 m/s (they do in some data sets).
    pub fn observed_velocity(&self, row: usize) -> f64 {
        const CONTRADICTION: f64 = 1.0;
        const WINDOW: i64 = 3;
        let now = self.state(row);
        if self.participants.is_agent[row] {
            return now.velocity;
        }
        let Some((steps, before)) =
            (1..=WINDOW).rev().find_map(|steps| Some((steps, self.past.get(row, self.time_step - steps)?)))
        else {
            return now.velocity;
        };
        let (sin, cos) = now.orientation.sin_cos();
        let moved = ((now.x - before.x) * cos + (now.y - before.y) * sin) / (steps as f64 * self.dt);
        let stated = 0.5 * (now.velocity + before.velocity);
        if (moved - stated).abs() > CONTRADICTION { moved } else { now.velocity }
    }

    /// Rows that the participant in a row sees, ascending, without that row. The one place that decides who is seen.
    pub fn visible_from(&self, row: usize, limits: &ViewLimits) -> Vec<usize> {
        let participants = &self.participants;
        let eye = self.state(row).pose().position;
        let others = self.present.iter().copied().filter(|other| *other != row);
        let is_near = |other: usize, position: Point| {
            let size = if participants.is_static[other] { participants.shape[other].bounding_radius() } else { 0.0 };
            position.distance(eye) <= limits.sensor_radius + size
        };
        if !limits.occlusion {
            return others.filter(|other| is_near(*other, self.state(*other).pose().position)).collect();
        }
        let others: Vec<usize> = others.collect();
        let bodies: Vec<sight::Body<'_>> = others
            .iter()
            .map(|other| {
                let pose = self.state(*other).pose();
                sight::Body {
                    shape: &participants.shape[*other],
                    pose,
                    hides: participants.is_static[*other] || participants.kind[*other].blocks_sight(),
                    is_wanted: is_near(*other, pose.position),
                }
            })
            .collect();
        let seen = sight::seen_from(eye, &bodies);
        others.into_iter().zip(seen).filter_map(|(other, is_seen)| is_seen.then_some(other)).collect()
    }
}
