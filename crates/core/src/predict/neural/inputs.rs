//! The input of the network for all vehicles of a scene, and what turns path coordinates into positions and back.

use super::candidate_path::CandidatePath;
use super::feature_table::{N_AGENT, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH};
use super::features::{write_agent, write_surroundings};
use super::history::History;
use super::paths::{Memory, N_PATHS, candidates};
use super::surroundings::{PresentBody, Surroundings};
use crate::geometry::Point;
use crate::road::RoadNetwork;
use crate::scene::Scene;
use crate::vehicle::ParticipantKind;

/// Number of instants that the network predicts.
pub const N_KNOTS: usize = 6;
/// Time between them [s]: 0.5, 1.0, ... 3.0 s from now.
pub const KNOT_TIME: f64 = 0.5;

/// Vehicles that reverse faster than this [m/s] are predicted with constant velocity.
const REVERSING_SPEED: f64 = -0.3;
/// A future position farther than this [m] beside a path is not on it.
const OFFSET_MAX: f64 = 20.0;
/// An offset from the path is given up within four seconds, but within no less than this distance [m].
const SETTLING_MIN: f64 = 10.0;
/// Time in which an offset is given up [s].
const SETTLING_TIME: f64 = 4.0;
/// Largest heading error that tells how the offset goes on [rad].
const HEADING_ERROR_MAX: f64 = 0.8;

/// Input of the network, one row per vehicle, row-major.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// Rows of the scene's participants, ascending.
    pub rows: Vec<usize>,
    /// Past and present of the vehicle, (rows, `N_AGENT`).
    pub agent: Vec<f32>,
    /// Its nearest neighbours, nearest first, (rows, `N_NEIGHBOURS`, `N_NEIGHBOUR`); zero where there is none.
    pub neighbours: Vec<f32>,
    /// Its candidate paths, (rows, `N_PATHS`, `N_PATH`); zero where there is none.
    pub paths: Vec<f32>,
    /// Speed along the heading, as observed, not negative [m/s].
    pub velocity: Vec<f64>,
    /// It stands.
    pub standing: Vec<bool>,
    /// The paths themselves; `None` where a slot is empty.
    pub candidates: Vec<[Option<CandidatePath>; N_PATHS]>,
}

impl Inputs {
    /// Rows of the participants that the network predicts: present, on wheels, not driving backwards
    /// and has a state that is a number.
    pub fn rows_of(scene: &Scene) -> Vec<usize> {
        scene.present.iter().copied().filter(|row| Self::has(*row, scene)).collect()
    }

    /// Whether a participant present is one of them.
    pub(super) fn has(row: usize, scene: &Scene) -> bool {
        let participants = &scene.participants;
        !participants.is_static[row]
            && !matches!(
                participants.kind[row],
                ParticipantKind::Pedestrian | ParticipantKind::ConstructionZone | ParticipantKind::Structure
            )
            && scene.state(row).is_finite()
            && scene.observed_velocity(row) >= REVERSING_SPEED
    }

    /// Of all vehicles of a scene.
    pub fn of(scene: &Scene, road: &RoadNetwork) -> Self {
        let mut inputs = Self { rows: Self::rows_of(scene), ..Self::default() };
        inputs.fill(scene, road, &Surroundings::of(scene), &mut Memory::default());
        inputs
    }

    /// Becomes those of other vehicles, some of `rows_of`.
    pub(super) fn become_of(
        &mut self,
        rows: impl Iterator<Item = usize>,
        (scene, road): (&Scene, &RoadNetwork),
        surroundings: &Surroundings,
        memory: &mut Memory,
    ) {
        self.rows.clear();
        self.rows.extend(rows);
        self.fill(scene, road, surroundings, memory);
    }

    /// Of the vehicles in `rows`.
    fn fill(&mut self, scene: &Scene, road: &RoadNetwork, surroundings: &Surroundings, memory: &mut Memory) {
        memory.spare.extend(self.candidates.drain(..).flatten().flatten());
        let n = self.rows.len();
        self.velocity.clear();
        self.standing.clear();
        for (table, width) in [
            (&mut self.agent, N_AGENT),
            (&mut self.neighbours, N_NEIGHBOURS * N_NEIGHBOUR),
            (&mut self.paths, N_PATHS * N_PATH),
        ] {
            table.clear();
            table.resize(n * width, 0.0);
        }
        for (i, row) in self.rows.iter().copied().enumerate() {
            let history = History::of(scene, row);
            let body: &PresentBody = surroundings.body(row).expect("vehicles have a body");
            let pose = scene.state(row).pose();
            let on_lanes = scene.participants.kind[row] != ParticipantKind::Train;
            let found = candidates(pose, history.velocity, on_lanes, road, memory);
            write_agent(&mut self.agent[i * N_AGENT..(i + 1) * N_AGENT], scene, body, &history);
            write_surroundings(
                &mut self.neighbours[i * N_NEIGHBOURS * N_NEIGHBOUR..(i + 1) * N_NEIGHBOURS * N_NEIGHBOUR],
                &mut self.paths[i * N_PATHS * N_PATH..(i + 1) * N_PATHS * N_PATH],
                body,
                history.velocity,
                &found,
                surroundings,
            );
            self.velocity.push(history.velocity.max(0.0));
            self.standing.push(history.is_standing());
            self.candidates.push(found);
        }
    }

    /// Whether each path is there, (rows, `N_PATHS`).
    pub fn path_valid(&self) -> Vec<bool> {
        self.candidates.iter().flatten().map(Option::is_some).collect()
    }

    /// How an offset from a path of a row is given up; `None` where the slot is empty.
    pub fn settling(&self, i: usize, slot: usize) -> Option<Settling> {
        let path = self.candidates[i][slot].as_ref()?;
        Some(Settling {
            offset: path.offset,
            slope: path.heading_error.clamp(-HEADING_ERROR_MAX, HEADING_ERROR_MAX).tan(),
            length: (SETTLING_TIME * self.velocity[i]).max(SETTLING_MIN),
        })
    }

    /// Path coordinates (s, d) [m] of the positions of a vehicle 0.5, 1.0, ... 3.0 s from now on all of its paths; NaN
    /// where a position is not a number, more than 20 m beside the path, or has no foot on it.
    pub fn targets(&self, i: usize, future: &[Point; N_KNOTS]) -> [[(f64, f64); N_KNOTS]; N_PATHS] {
        /// A vehicle is not expected to be faster [m/s].
        const SPEED_MAX: f64 = 70.0;
        /// Nor to go back farther than this [m].
        const BACK_MAX: f64 = 5.0;
        let mut targets = [[(f64::NAN, f64::NAN); N_KNOTS]; N_PATHS];
        for (targets, path) in targets.iter_mut().zip(&self.candidates[i]) {
            let Some(path) = path else { continue };
            let (mut before, mut elapsed) = (0.0, 0.0);
            for (target, position) in targets.iter_mut().zip(future) {
                elapsed += KNOT_TIME;
                let (from, to) = (before - BACK_MAX, before + SPEED_MAX * elapsed);
                let found = path.foot(*position, from, to).filter(|(_, d)| d.abs() <= OFFSET_MAX);
                if let Some((s, d)) = found {
                    *target = (s, d);
                    (before, elapsed) = (s, 0.0);
                }
            }
        }
        targets
    }
}

/// How an offset from a path is given up while driving along it: a cubic from the offset and direction now to the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settling {
    /// Offset now [m].
    pub offset: f64,
    /// Tangent of the heading error now.
    pub slope: f64,
    /// Distance within which the offset is given up [m].
    pub length: f64,
}

impl Settling {
    /// Offset after a distance `s` [m], and its slope.
    pub fn at(&self, s: f64) -> (f64, f64) {
        let u = (s / self.length).clamp(0.0, 1.0);
        let v = 1.0 - u;
        let offset = (1.0 + 2.0 * u) * v * v * self.offset + self.length * u * v * v * self.slope;
        let slope = -6.0 * u * v * self.offset / self.length + v * (1.0 - 3.0 * u) * self.slope;
        (offset, slope)
    }
}
