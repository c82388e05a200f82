//! All participants present at one time step, with their past. Neither the recorded future nor
//! any plan is here.

mod contact;
pub use contact::PlacedBody;
pub mod line_of_sight;
mod perception;
pub use perception::Perceived;
mod position_index;
pub(crate) use position_index::PositionIndex;

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;
use crate::scenario::Scenario;
use crate::settings::{between, positive, settings};
use crate::trajectory::{State, States};
use crate::turn::Turn;
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
    /// Where ways cross one above the other.
    pub storeys: Storeys,
}

impl Participants {
    /// The participant in a row is near enough to be seen, at its position, from a place.
    #[inline]
    pub(crate) fn is_near(&self, row: usize, position: Point, eye: Point, limits: &ViewLimits) -> bool {
        let distance = position.distance(eye);
        distance <= limits.sensor_radius
            || self.is_static[row] && distance <= limits.sensor_radius + self.shape[row].bounding_radius()
    }
}

/// The road, if it states heights: participants one above the other do not see each other.
#[derive(Debug, Clone, Default)]
pub struct Storeys(Option<Arc<RoadNetwork>>);

impl PartialEq for Storeys {
    fn eq(&self, other: &Self) -> bool {
        self.0.as_ref().map(Arc::as_ptr) == other.0.as_ref().map(Arc::as_ptr)
    }
}

impl Storeys {
    /// Of a road.
    pub fn of(road: &Arc<RoadNetwork>) -> Self {
        Self(road.has_heights().then(|| Arc::clone(road)))
    }

    /// No ways cross one above the other.
    pub(crate) fn is_flat(&self) -> bool {
        self.0.is_none()
    }

    /// Whether one pose is above the other.
    pub fn are_apart(&self, one: Pose, other: Pose) -> bool {
        self.are_apart_at(|| (one, other))
    }

    /// The same for poses that are not at hand: they are made only where ways lie one above the other.
    pub fn are_apart_at(&self, poses: impl FnOnce() -> (Pose, Pose)) -> bool {
        self.0.as_ref().is_some_and(|road| {
            let (one, other) = poses();
            road.are_apart(one, other)
        })
    }
}

settings! {
    /// View of an agent.
    pub struct ViewLimits as ViewSettings {
        /// Distance beyond which participants are not seen, centre to centre; for static obstacles, to the nearest
        /// point of a circle around them.
        sensor_radius: f64 ["m"] = 80.0, positive(f64::INFINITY);
        /// Agents do not see participants whose footprints are completely covered by nearer ones, seen from the centre
        /// of the agent's own footprint. Everything but pedestrians, bicycles and motorcycles covers. Agents are
        /// careful at junctions where something is hidden (`rules.unseen`).
        occlusion: bool = false;
        /// Delay with which it perceives others, at most the past that is kept (`step.history_steps`). A participant
        /// that has just come is perceived as if it had come before, at the speed that it came with.
        delay: f64 ["s"] = 0.0, between(0.0, 10.0);
        /// Standard deviation of the errors of the positions of others that it perceives, in x and in y. Errors change
        /// within a second.
        position_error: f64 ["m"] = 0.0, between(0.0, 100.0);
        /// Standard deviation of the errors of their speeds, as a share of the speed.
        speed_error: f64 = 0.0, between(0.0, 10.0);
        /// Share of the time steps at which it does not perceive a participant that it sees.
        missed: f64 = 0.0, between(0.0, 1.0);
        /// Seed of the errors of perception, besides the seed of the run.
        error_seed: usize = 0, between(0.0, u32::MAX as f64);
        /// Time after its start from which it does not look.
        inattentive_from: f64 ["s"] = 0.0, between(0.0, 1e5);
        /// For how long it does not look at all: it goes on with the plan that it has, at most to its end.
        inattentive_for: f64 ["s"] = 0.0, between(0.0, 1e5);
    }
}

impl ViewLimits {
    /// It does not look, so long after its start [s].
    pub(crate) fn looks_away(&self, elapsed: f64) -> bool {
        /// Time steps begin at whole multiples of their length, but for rounding [s].
        const ROUNDING: f64 = 1e-6;
        let since = elapsed + ROUNDING - self.inattentive_from;
        0.0 <= since && since < self.inattentive_for
    }
}

/// Time steps of the past by which a stated speed is judged, if they are known.
pub(crate) const OBSERVED_STEPS: usize = 3;

/// The speed of a recorded participant as it can be observed, from its state, the unit vector along its heading, and an
/// earlier state with the number of time steps since.
pub(crate) fn observed_speed(then: &State, axis: Point, earlier: Option<(usize, &State)>, dt: f64) -> f64 {
    /// A stated speed that differs by more from the observed motion is not believed [m/s].
    const CONTRADICTION: f64 = 1.0;
    let Some((steps, before)) = earlier else { return then.velocity };
    let moved = ((then.x - before.x) * axis.x + (then.y - before.y) * axis.y) / (steps as f64 * dt);
    let stated = 0.5 * (then.velocity + before.velocity);
    if (moved - stated).abs() > CONTRADICTION { moved } else { then.velocity }
}

/// All participants at one time step.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Now.
    pub time_step: i64,
    /// Time between steps [s].
    pub dt: f64,
    /// The participants of the world, present or not.
    pub participants: Arc<Participants>,
    /// Rows of `participants` that are present now, ascending.
    pub present: Vec<usize>,
    /// For each of them the turn that it shows by its blinkers; `None`: unknown. Empty in scenes that the world makes for
    /// itself.
    pub turns: Vec<Option<Turn>>,
    /// Present and past of all participants; the last column is now. A row is cut where the participant left, so
    /// a participant that has left has no past either.
    pub past: States,
}

impl Scene {
    /// The recorded traffic of a scenario as a scene, without any agent, with `history_steps` steps of the past.
    ///
    /// # Errors
    /// `InvalidInput` if the recording does not have the time step.
    pub fn recorded(scenario: &Scenario, time_step: i64, history_steps: usize) -> Result<Self> {
        let obstacles = &scenario.obstacles;
        let (from, last) = (&obstacles.states, obstacles.states.first_time_step + obstacles.states.n_steps as i64 - 1);
        if !(from.first_time_step..=last).contains(&time_step) {
            return Err(Error::invalid(format!(
                "time step {time_step} is not recorded: the recording has {} to {last}",
                from.first_time_step
            )));
        }
        let n = from.ids.len();
        let participants = Participants {
            ids: from.ids.clone(),
            kind: obstacles.kind.clone(),
            shape: obstacles.shape.clone(),
            is_static: obstacles.is_static.clone(),
            is_agent: vec![false; n],
            storeys: Storeys::of(&scenario.road),
        };
        let first = time_step - history_steps as i64;
        let mut past = States::absent(from.ids.clone(), first, history_steps + 1);
        for row in 0..n {
            for column in 0..=history_steps {
                if let Some(state) = from.get(row, first + column as i64) {
                    past.set(row, column, &state);
                }
            }
        }
        let present: Vec<usize> = (0..n).filter(|row| from.get(*row, time_step).is_some()).collect();
        let turns = vec![None; present.len()];
        Ok(Self { time_step, dt: scenario.dt, participants: Arc::new(participants), present, turns, past })
    }

    /// State now of a row of `participants` that is present.
    pub fn state(&self, row: usize) -> State {
        self.past.get(row, self.time_step).expect("rows in `present` have a state now")
    }

    /// Speed along the heading [m/s] as it can be observed: the stated one, unless a recorded participant's last positions
    /// contradict the speeds stated for them by more than 1 m/s (they do in some data sets).
    pub fn observed_velocity(&self, row: usize) -> f64 {
        self.observed_velocity_at(row, self.time_step).expect("rows in `present` have a state now")
    }

    /// Deceleration along the heading [m/s²] as it can be observed, not negative: the lesser of those over the last 0.3 and
    /// 0.6 s, so that neither noise nor a dab of the brakes counts for much. 0 for a participant that was absent then, or
    /// whose stated speed is contradicted by its motion.
    pub fn observed_braking(&self, row: usize) -> f64 {
        self.observed_braking_at(row, self.time_step).expect("rows in `present` have a state now")
    }

    /// The same as it could be observed at a time step of the past; `None` where the participant was absent.
    fn observed_braking_at(&self, row: usize, time_step: i64) -> Option<f64> {
        const WINDOWS: [f64; 2] = [0.3, 0.6];
        let then = self.past.get(row, time_step)?.velocity;
        if self.observed_velocity_at(row, time_step)?.to_bits() != then.to_bits() {
            return Some(0.0);
        }
        let over = |window: &f64| {
            let steps = (window / self.dt).round().max(1.0);
            let before = self.past.get(row, time_step - steps as i64)?;
            Some((before.velocity - then) / (steps * self.dt))
        };
        Some(WINDOWS.iter().filter_map(over).reduce(f64::min).map_or(0.0, |braking| braking.max(0.0)))
    }

    /// The speed as it could be observed at a time step of the past; `None` where the participant was absent.
    pub fn observed_velocity_at(&self, row: usize, time_step: i64) -> Option<f64> {
        let then = self.past.get(row, time_step)?;
        if self.participants.is_agent[row] {
            return Some(then.velocity);
        }
        let before = |ago: usize| Some((ago, self.past.get(row, time_step - ago as i64)?));
        let earlier = (1..=OBSERVED_STEPS).rev().find_map(before);
        let axis = Point::from_angle(then.orientation);
        Some(observed_speed(&then, axis, earlier.as_ref().map(|(ago, state)| (*ago, state)), self.dt))
    }

    /// Rows that the participant in a row sees, ascending, without that row.
    pub fn visible_from(&self, row: usize, limits: &ViewLimits) -> Vec<usize> {
        let mut visible = Vec::new();
        self.see(row, limits, &self.position_index(1), &mut visible);
        visible.into_iter().map(|place| self.present[place]).collect()
    }

    /// Writes which participants the one in a row sees, as indices into `present`, ascending, without itself. The index is of this
    /// scene. The one place that decides about visibility.
    pub(crate) fn see(&self, row: usize, limits: &ViewLimits, index: &PositionIndex, visible: &mut Vec<usize>) {
        let participants = &self.participants;
        let pose = self.state(row).pose();
        let eye = pose.position;
        let is_near = |place: usize| participants.is_near(self.present[place], index.positions[place], eye, limits);
        let is_level =
            |place: usize| !participants.storeys.are_apart_at(|| (pose, self.state(self.present[place]).pose()));
        let is_other = |place: usize| self.present[place] != row && is_level(place);
        let ids = &participants.ids;
        let misses = |place: &usize| limits.misses([ids[row], ids[self.present[*place]]], self.time_step);
        if !limits.occlusion {
            index.around(eye, limits.sensor_radius, visible);
            visible.retain(|place| is_near(*place) && is_other(*place) && !misses(place));
            return;
        }
        visible.clear();
        visible.extend((0..self.present.len()).filter(|place| is_other(*place)));
        let bodies: Vec<line_of_sight::SightBody<'_>> = visible
            .iter()
            .map(|place| {
                let other = self.present[*place];
                line_of_sight::SightBody {
                    shape: &participants.shape[other],
                    pose: self.state(other).pose(),
                    hides: participants.is_static[other] || participants.kind[other].blocks_sight(),
                    is_wanted: is_near(*place),
                }
            })
            .collect();
        let mut seen = line_of_sight::seen_from(eye, &bodies).into_iter();
        visible.retain(|place| seen.next() == Some(true) && !misses(place));
    }

    /// Which of some bodies that are not present the participant in a row would see if they were: footprint, pose, and
    /// whether it never moves. None of them hides another one; of the participants those do whose rows `may_hide`.
    pub(crate) fn would_see(
        &self,
        row: usize,
        limits: &ViewLimits,
        all: &[(&Shape, Pose, bool)],
        may_hide: &dyn Fn(usize) -> bool,
    ) -> Vec<bool> {
        let participants = &self.participants;
        let pose = self.state(row).pose();
        let eye = pose.position;
        let is_near = |(shape, pose, is_static): &(&Shape, Pose, bool)| {
            let size = if *is_static { shape.bounding_radius() } else { 0.0 };
            pose.position.distance(eye) <= limits.sensor_radius + size
        };
        let is_level = |other: Pose| !participants.storeys.are_apart(pose, other);
        let near: Vec<bool> = all.iter().map(|body| is_near(body) && is_level(body.1)).collect();
        if !limits.occlusion || !near.contains(&true) {
            return near;
        }
        let others = self.present.iter().copied().filter(|other| *other != row && may_hide(*other));
        let others = others.filter(|other| is_level(self.state(*other).pose()));
        let body = |other: usize| line_of_sight::SightBody {
            shape: &participants.shape[other],
            pose: self.state(other).pose(),
            hides: participants.is_static[other] || participants.kind[other].blocks_sight(),
            is_wanted: false,
        };
        let wanted = all.iter().zip(&near).map(|((shape, pose, _), is_near)| line_of_sight::SightBody {
            shape,
            pose: *pose,
            hides: false,
            is_wanted: *is_near,
        });
        let bodies: Vec<_> = wanted.chain(others.map(body)).collect();
        let mut seen = line_of_sight::seen_from(eye, &bodies);
        seen.truncate(all.len());
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All participants stand at (x, 0), ids are 0, 1, ...; an entry is (kind, is_static, footprint, x).
    fn scene(all: &[(ParticipantKind, bool, Shape, f64)]) -> Scene {
        let ids: Vec<i64> = (0..all.len() as i64).collect();
        let mut past = States::absent(ids.clone(), 0, 1);
        for (row, (.., x)) in all.iter().enumerate() {
            past.set(row, 0, &State { x: *x, ..State::default() });
        }
        let participants = Participants {
            ids,
            kind: all.iter().map(|(kind, ..)| *kind).collect(),
            shape: all.iter().map(|(_, _, shape, _)| shape.clone()).collect(),
            is_static: all.iter().map(|(_, is_static, ..)| *is_static).collect(),
            is_agent: vec![false; all.len()],
            storeys: Storeys::default(),
        };
        Scene {
            time_step: 0,
            dt: 0.1,
            participants: Arc::new(participants),
            present: (0..all.len()).collect(),
            turns: vec![None; all.len()],
            past,
        }
    }

    #[test]
    fn distance_counts_to_centres_and_to_the_edge_of_static_obstacles() {
        let (car, wall) = (Shape::rectangle(4.0, 2.0), Shape::rectangle(30.0, 1.0));
        let scene = scene(&[
            (ParticipantKind::Car, false, car.clone(), 0.0),
            (ParticipantKind::Car, false, car.clone(), 20.0),
            (ParticipantKind::Car, false, car, 20.1),
            (ParticipantKind::Structure, true, wall.clone(), 34.9),
            (ParticipantKind::Structure, true, wall, 35.1),
        ]);
        let limits = ViewLimits { sensor_radius: 20.0, ..ViewLimits::default() };
        assert_eq!(scene.visible_from(0, &limits), [1, 3]);
        assert_eq!(scene.visible_from(2, &limits), [1, 3, 4]);
    }

    #[test]
    fn one_looks_past_pedestrians_and_two_wheelers_but_not_past_anything_else() {
        for (kind, is_static, hides) in [
            (ParticipantKind::Truck, false, true),
            (ParticipantKind::ParkedVehicle, true, true),
            (ParticipantKind::Unknown, false, true),
            (ParticipantKind::Pedestrian, false, false),
            (ParticipantKind::Bicycle, false, false),
            (ParticipantKind::Motorcycle, false, false),
            (ParticipantKind::Pedestrian, true, true), // a statue
        ] {
            let wide = Shape::rectangle(1.0, 3.0);
            let scene = scene(&[
                (ParticipantKind::Car, false, wide.clone(), 0.0),
                (kind, is_static, wide.clone(), 10.0),
                (ParticipantKind::Car, false, wide, 20.0),
            ]);
            let seen = scene.visible_from(0, &ViewLimits { occlusion: true, ..ViewLimits::default() });
            assert_eq!(seen, if hides { vec![1] } else { vec![1, 2] }, "{kind:?} {is_static}");
        }
    }

    #[test]
    fn who_is_too_far_away_to_be_seen_can_hide_others() {
        // The body origin of the train is 70 m away, its side 40 m; the car behind it is 57 m away.
        let across = Shape::rectangle_at(3.0, 100.0, Point::new(-30.0, 0.0), 0.0);
        let scene = scene(&[
            (ParticipantKind::Car, false, Shape::rectangle(4.0, 2.0), 0.0),
            (ParticipantKind::Train, false, across, 70.0),
            (ParticipantKind::Car, false, Shape::rectangle(4.0, 2.0), 57.0),
        ]);
        let seen =
            |occlusion| scene.visible_from(0, &ViewLimits { sensor_radius: 60.0, occlusion, ..ViewLimits::default() });
        assert_eq!(seen(false), [2]);
        assert_eq!(seen(true), Vec::<usize>::new());
    }
}
