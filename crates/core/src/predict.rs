//! Native predictors. Each predicts all present participants from present and past alone, except `GroundTruth`, which
//! looks into the recording and must be built from the scenario.

mod bending;
mod lane_candidates;
pub mod neural;
mod stillness;
#[cfg(test)]
mod tests;
mod turning;
mod waiting;

use std::borrow::Cow;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;
use crate::scenario::Scenario;
use crate::scene::Scene;
use crate::settings::{between, positive, settings};
use crate::trajectory::{Predictions, State};
use crate::vehicle::ParticipantKind;
pub(crate) use bending::narrow_in_bends;
use lane_candidates::LaneCandidates;
pub use stillness::is_standing;
pub(crate) use turning::{ShownWay, turn};
pub(crate) use waiting::{Waiting, wait};

/// Below this speed [m/s] a participant is taken to stand and to stay.
const PREDICTED_STANDING_SPEED: f64 = 0.3;
/// Variance of the position of something that stands [m²].
pub(crate) const STATIONARY_VARIANCE: f64 = 0.02;

settings! {
    /// Spread of a moving participant.
    ///
    /// Along its heading it grows like an unknown constant acceleration, across it linearly.
    pub struct Spread as Spread {
        /// Standard deviation of the present position.
        position_sigma: f64 ["m"] = 0.15, positive(f64::MAX);
        /// Standard deviation of the acceleration along the heading; the spread along the heading grows with the square of
        /// time.
        acceleration_sigma: f64 ["m/s²"] = 0.8, positive(f64::MAX);
        /// Growth of the standard deviation across the heading.
        lateral_rate: f64 ["m/s"] = 0.15, positive(f64::MAX);
    }

    /// Straight on with the present velocity; stationary participants remain stationary.
    pub struct ConstantVelocity as ConstantVelocity(spread: Spread = STRAIGHT) {}

    /// Along every lane that fits the pose (one mode each), at constant speed, slower in curves; otherwise straight.
    pub struct LaneFollowing as LaneFollowing(spread: Spread) {
        /// Largest number of lanes followed.
        modes_max: usize = 3, between(1.0, MODES_LIMIT as f64);
        /// Lateral acceleration in curves up to which vehicles do not slow down.
        lateral_acceleration: f64 ["m/s²"] = 3.0, positive(f64::MAX);
        /// Deceleration before curves.
        deceleration: f64 ["m/s²"] = 2.0, positive(f64::MAX);
        /// Time in which an offset from the lane's centre decays.
        return_time: f64 ["s"] = 4.0, positive(f64::MAX);
    }
}

/// Of participants that go straight on because no other predictor answers: that of `constant_velocity`.
const STRAIGHT: Spread = Spread { position_sigma: 0.15, acceleration_sigma: 0.8, lateral_rate: 0.25 };

impl Spread {
    /// (xx, xy, yy) [m²] for a unit vector along the heading, at a time from now [s]; slow participants spread less (fully
    /// from 5 m/s on).
    fn covariance(&self, axis: Point, velocity: f64, time: f64) -> (f64, f64, f64) {
        let scale = (velocity.abs() / 5.0).min(1.0);
        let along = self.position_sigma.powi(2) + (0.5 * self.acceleration_sigma * scale * time * time).powi(2);
        let across = (self.position_sigma + self.lateral_rate * scale * time).powi(2);
        let Point { x: cos, y: sin } = axis;
        (along * cos * cos + across * sin * sin, (along - across) * sin * cos, along * sin * sin + across * cos * cos)
    }
}

/// A native predictor with its settings.
#[derive(Debug, Clone)]
pub enum Predictor {
    /// Straight on with the present velocity.
    ConstantVelocity(Spread),
    /// Along every lane that fits, speed kept, slower in curves.
    LaneFollowing(LaneFollowing),
    /// The recorded future of recorded participants; agents follow their lanes. For studies only: no planner in a car
    /// could know it.
    GroundTruth(Arc<Scenario>, LaneFollowing),
    /// A network that was trained on recorded traffic.
    Neural(neural::Neural),
}

/// Participants that one thread answers for before it looks for more work.
const CHUNK: usize = 4;
/// Most modes that a predictor may be asked for; the wide one of `neural` comes on top.
const MODES_LIMIT: usize = 8;

/// Memory that predictions reuse: after the first few nothing but the table is allocated. Holds no state: a prediction
/// does not depend on what was predicted before with the same memory.
#[derive(Debug, Default)]
pub struct Memory(Mutex<Vec<PredictionMemory>>);

impl Clone for Memory {
    /// Memory of its own: it holds nothing that lasts.
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// Memory of a thread.
#[derive(Debug, Default)]
struct PredictionMemory {
    /// Some rows of the result.
    table: Predictions,
    lanes: LaneCandidates,
    neural: neural::NeuralMemory,
}

impl Memory {
    /// Calls a function with memory of its own.
    fn with<T>(&self, work: impl FnOnce(&mut PredictionMemory) -> T) -> T {
        // What is inside holds no state, so a panic in between spoils nothing.
        let all = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = all().pop().unwrap_or_default();
        let done = work(&mut scratch);
        all().push(scratch);
        done
    }
}

/// Calls `work(i)` once for every i below `n`, in any order, on any threads: `each(n, work)`.
pub type Each<'a> = &'a dyn Fn(usize, &(dyn Fn(usize) + Sync));

/// The calling thread alone.
pub fn one_by_one(n: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..n).for_each(work);
}

/// SharedPredictions for all present participants over `n_steps` steps, on the threads of the rayon pool in which it is
/// called; outside of one, on the calling thread.
///
/// # Errors
/// `InvalidInput` for zero steps, and for zero modes or more than 8.
pub fn predict(predictor: &Predictor, scene: &Scene, road: &RoadNetwork, n_steps: usize) -> Result<Predictions> {
    // The global thread pool is left alone.
    let is_shared = rayon::current_thread_index().is_some();
    let shared: Each<'_> = &|n, work| (0..n).into_par_iter().for_each(work);
    predict_with(predictor, scene, road, n_steps, &Memory::default(), if is_shared { shared } else { &one_by_one })
}

/// The same with memory that is reused, on threads that are given.
///
/// # Errors
/// As [`predict`].
pub fn predict_with(
    predictor: &Predictor,
    scene: &Scene,
    road: &RoadNetwork,
    n_steps: usize,
    memory: &Memory,
    each: Each<'_>,
) -> Result<Predictions> {
    let n_modes = match predictor {
        Predictor::ConstantVelocity(_) => 1,
        Predictor::LaneFollowing(settings) | Predictor::GroundTruth(_, settings) => settings.modes_max,
        Predictor::Neural(settings) => settings.modes_max,
    };
    if n_steps == 0 || !(1..=MODES_LIMIT).contains(&n_modes) {
        return Err(Error::invalid(format!(
            "a prediction of {n_steps} steps with {n_modes} modes is impossible (modes: 1 to {MODES_LIMIT})"
        )));
    }
    if let Predictor::Neural(settings) = predictor {
        return Ok(neural::predict(settings, scene, road, n_steps, (memory, each)));
    }
    let ids = scene.present.iter().map(|row| scene.participants.ids[*row]).collect();
    let mut out = Predictions::zeros(scene.time_step, ids, n_modes, n_steps);
    let parts = out.parts(CHUNK);
    each(parts.len(), &|part| {
        memory.with(|PredictionMemory { table, lanes, .. }| {
            let rows = rows_of(scene, part, CHUNK);
            table.clear(scene.time_step, rows.len(), n_modes, n_steps);
            for (i, row) in rows.iter().copied().enumerate() {
                predict_one(predictor, (scene, road), row, table, i, lanes);
            }
            parts.copy_from(part, table);
        });
    });
    drop(parts);
    Ok(out)
}

/// Those present in the rows of one of the parts of a table, `n` rows each.
fn rows_of(scene: &Scene, part: usize, n: usize) -> &[usize] {
    &scene.present[part * n..scene.present.len().min((part + 1) * n)]
}

/// For the participant in a row of the scene, into row `i` of the table.
fn predict_one(
    predictor: &Predictor,
    (scene, road): (&Scene, &RoadNetwork),
    row: usize,
    out: &mut Predictions,
    i: usize,
    lanes: &mut LaneCandidates,
) {
    let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
    match predictor {
        Predictor::GroundTruth(scenario, _)
            if !scene.participants.is_agent[row] && !scene.participants.is_static[row] =>
        {
            replay(out, i, scenario, scene.participants.ids[row]);
        }
        _ if scene.participants.is_static[row] || state.velocity.abs() < PREDICTED_STANDING_SPEED => {
            stand(out, i, &state)
        }
        Predictor::ConstantVelocity(spread) => go_straight(out, i, (&state, 0.0), spread, scene.dt),
        Predictor::Neural(_) => unreachable!("the network predicts all vehicles at once"),
        Predictor::LaneFollowing(settings) | Predictor::GroundTruth(_, settings) => {
            let moving = (scene.participants.kind[row], &state, 0.0);
            lane_candidates::follow_lanes(out, i, moving, settings, (scene.dt, road), lanes);
        }
    }
}

/// Writes the prediction of a participant that an agent was told of into row `i`: `state` is moved to now, `age` is
/// that of what was told [s]. Vehicles follow their lanes, with the default settings of `lane_following`.
pub(crate) fn told(
    out: &mut Predictions,
    i: usize,
    (kind, is_static): (ParticipantKind, bool),
    state: &State,
    age: f64,
    (dt, road): (f64, &RoadNetwork),
) {
    if is_static || state.velocity.abs() < PREDICTED_STANDING_SPEED {
        return stand(out, i, state);
    }
    let settings = LaneFollowing::default();
    let settings = LaneFollowing { modes_max: settings.modes_max.min(out.n_modes), ..settings };
    lane_candidates::follow_lanes(out, i, (kind, state, age), &settings, (dt, road), &mut LaneCandidates::default());
}

/// Completes a table to a row for every present participant: without a row or a valid mode it goes straight on, or
/// stays if standing.
pub fn completed<'a>(predictions: &'a Predictions, scene: &Scene) -> Cow<'a, Predictions> {
    let ids = || scene.present.iter().map(|row| scene.participants.ids[*row]);
    let is_known = |row: usize| {
        let start = predictions.offset(row, 0);
        predictions.valid[start..start + predictions.n_modes * predictions.n_steps].iter().any(|v| *v)
    };
    if ids().eq(predictions.ids.iter().copied()) && (0..predictions.ids.len()).all(is_known) {
        return Cow::Borrowed(predictions);
    }
    let mut out = Predictions::empty(predictions.time_step, ids().collect(), predictions.n_modes, predictions.n_steps);
    for (i, row) in scene.present.iter().copied().enumerate() {
        let from = predictions.row(scene.participants.ids[row]).filter(|row| is_known(*row));
        if let Some(from) = from {
            out.copy_row(i, predictions, from);
            continue;
        }
        let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
        if scene.participants.is_static[row] || state.velocity.abs() < PREDICTED_STANDING_SPEED {
            stand(&mut out, i, &state);
        } else {
            go_straight(&mut out, i, (&state, 0.0), &STRAIGHT, scene.dt);
        }
    }
    Cow::Owned(out)
}

/// Writes the mean, the speed and the covariance of one step of one mode.
pub(crate) fn write(out: &mut Predictions, i: usize, pose: Pose, velocity: f64, covariance: (f64, f64, f64)) {
    out.x[i] = pose.position.x;
    out.y[i] = pose.position.y;
    out.orientation[i] = pose.orientation;
    out.velocity[i] = velocity;
    (out.covariance_xx[i], out.covariance_xy[i], out.covariance_yy[i]) = covariance;
    out.valid[i] = true;
}

fn stand(out: &mut Predictions, row: usize, state: &State) {
    out.probability[row * out.n_modes] = 1.0;
    let start = out.offset(row, 0);
    for k in 0..out.n_steps {
        write(out, start + k, state.pose(), 0.0, (STATIONARY_VARIANCE, 0.0, STATIONARY_VARIANCE));
    }
}

/// `age` is that of the state [s]: it is moved to now already, but its spread is older.
fn go_straight(out: &mut Predictions, row: usize, (state, age): (&State, f64), spread: &Spread, dt: f64) {
    out.probability[row * out.n_modes] = 1.0;
    let start = out.offset(row, 0);
    let axis = Point::from_angle(state.orientation);
    let step = axis * (state.velocity * dt);
    for k in 0..out.n_steps {
        let position = state.pose().position + step * (k + 1) as f64;
        let covariance = spread.covariance(axis, state.velocity, age + (k + 1) as f64 * dt);
        write(out, start + k, Pose { position, orientation: state.orientation }, state.velocity, covariance);
    }
}

fn replay(out: &mut Predictions, row: usize, scenario: &Scenario, id: i64) {
    let Some(recorded) = scenario.obstacles.states.row(id) else { return };
    out.probability[row * out.n_modes] = 1.0;
    let start = out.offset(row, 0);
    for k in 0..out.n_steps {
        // A participant that leaves the recording has no prediction afterwards.
        if let Some(state) = scenario.obstacles.states.get(recorded, out.time_step + 1 + k as i64) {
            write(out, start + k, state.pose(), state.velocity, (STATIONARY_VARIANCE, 0.0, STATIONARY_VARIANCE));
        }
    }
}
