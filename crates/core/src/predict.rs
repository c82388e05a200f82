//! Native predictors. Each answers for all participants that are present, from present and past alone; the one that
//! looks into the recording is called `GroundTruth` and must be built from the scenario.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;
use crate::scenario::Scenario;
use crate::scene::Scene;
use crate::trajectory::{Predictions, State};

/// Below this speed [m/s] a participant is taken to stand and to stay.
const STANDING: f64 = 0.3;
/// Variance of the position of something that stands [m²].
const STANDING_VARIANCE: f64 = 0.02;

/// How the spread of a moving participant grows: along its heading like an unknown constant acceleration, across it
/// linearly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Standard deviation of the position now [m].
    pub position_sigma: f64,
    /// Standard deviation of the acceleration along the heading [m/s²].
    pub acceleration_sigma: f64,
    /// Growth of the standard deviation across the heading [m/s].
    pub lateral_rate: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { position_sigma: 0.15, acceleration_sigma: 0.8, lateral_rate: 0.15 }
    }
}

impl Spread {
    /// (xx, xy, yy) [m²] for a heading, at a time from now [s]; slow participants spread less (fully from 5 m/s on).
    fn covariance(&self, orientation: f64, velocity: f64, time: f64) -> (f64, f64, f64) {
        let scale = (velocity.abs() / 5.0).min(1.0);
        let along = self.position_sigma.powi(2) + (0.5 * self.acceleration_sigma * scale * time * time).powi(2);
        let across = (self.position_sigma + self.lateral_rate * scale * time).powi(2);
        let (sin, cos) = orientation.sin_cos();
        (along * cos * cos + across * sin * sin, (along - across) * sin * cos, along * sin * sin + across * cos * cos)
    }
}

/// Settings of `lane_following`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneFollowing {
    /// How the spread grows.
    pub spread: Spread,
    /// Number of lanes that are followed at most; each is a mode.
    pub modes_max: usize,
    /// Lateral acceleration up to which a participant does not slow down in curves [m/s²].
    pub lateral_acceleration: f64,
    /// Deceleration before curves [m/s²].
    pub deceleration: f64,
    /// Time in which an offset from the lane's centre is given up [s].
    pub return_time: f64,
}

impl Default for LaneFollowing {
    fn default() -> Self {
        Self { spread: Spread::default(), modes_max: 3, lateral_acceleration: 3.0, deceleration: 2.0, return_time: 4.0 }
    }
}

/// A native predictor with its settings.
#[derive(Debug, Clone)]
pub enum Predictor {
    /// Straight on with the present velocity.
    ConstantVelocity(Spread),
    /// Along every lane that fits, speed kept, slower in curves.
    LaneFollowing(LaneFollowing),
    /// The recorded future of those who replay it; agents follow their lanes. For studies only: no planner in a car
    /// could know it.
    GroundTruth(Arc<Scenario>, LaneFollowing),
}

/// Most modes that `LaneFollowing` may have.
const MODES_LIMIT: usize = 8;

/// Expectations for all present participants over `n_steps` steps.
///
/// # Errors
/// `InvalidInput` for zero steps, zero modes or more than 8.
pub fn predict(predictor: &Predictor, scene: &Scene, road: &RoadNetwork, n_steps: usize) -> Result<Predictions> {
    let n_modes = match predictor {
        Predictor::ConstantVelocity(_) => 1,
        Predictor::LaneFollowing(settings) | Predictor::GroundTruth(_, settings) => settings.modes_max,
    };
    if n_steps == 0 || !(1..=MODES_LIMIT).contains(&n_modes) {
        return Err(Error::invalid(format!(
            "a prediction of {n_steps} steps with {n_modes} modes is impossible (modes: 1 to {MODES_LIMIT})"
        )));
    }
    let ids: Vec<i64> = scene.present.iter().map(|row| scene.participants.ids[*row]).collect();
    let mut out = Predictions::empty(scene.time_step, ids, n_modes, n_steps);
    for (i, row) in scene.present.iter().copied().enumerate() {
        let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
        match predictor {
            Predictor::GroundTruth(scenario, _)
                if !scene.participants.is_agent[row] && !scene.participants.is_static[row] =>
            {
                replay(&mut out, i, scenario, scene.participants.ids[row]);
            }
            _ if scene.participants.is_static[row] || state.velocity.abs() < STANDING => stand(&mut out, i, &state),
            Predictor::ConstantVelocity(spread) => go_straight(&mut out, i, &state, spread, scene.dt),
            Predictor::LaneFollowing(settings) | Predictor::GroundTruth(_, settings) => {
                follow_lanes(&mut out, i, row, &state, settings, scene, road);
            }
        }
    }
    Ok(out)
}

/// Completes a table so that it has a row for everybody who is present: who is missing or has no valid mode goes
/// straight on, or stays if standing.
pub fn completed(predictions: &Predictions, scene: &Scene) -> Predictions {
    let ids: Vec<i64> = scene.present.iter().map(|row| scene.participants.ids[*row]).collect();
    let mut out = Predictions::empty(predictions.time_step, ids, predictions.n_modes, predictions.n_steps);
    for (i, row) in scene.present.iter().copied().enumerate() {
        let from = predictions.row(scene.participants.ids[row]).filter(|r| {
            let start = predictions.offset(*r, 0);
            predictions.valid[start..start + predictions.n_modes * predictions.n_steps].iter().any(|v| *v)
        });
        if let Some(from) = from {
            out.copy_row(i, predictions, from);
            continue;
        }
        let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
        if scene.participants.is_static[row] || state.velocity.abs() < STANDING {
            stand(&mut out, i, &state);
        } else {
            go_straight(&mut out, i, &state, &Spread::default(), scene.dt);
        }
    }
    out
}

fn write(out: &mut Predictions, i: usize, pose: Pose, velocity: f64, covariance: (f64, f64, f64)) {
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
        write(out, start + k, state.pose(), 0.0, (STANDING_VARIANCE, 0.0, STANDING_VARIANCE));
    }
}

fn go_straight(out: &mut Predictions, row: usize, state: &State, spread: &Spread, dt: f64) {
    out.probability[row * out.n_modes] = 1.0;
    let start = out.offset(row, 0);
    let step = Point::from_angle(state.orientation) * (state.velocity * dt);
    for k in 0..out.n_steps {
        let position = state.pose().position + step * (k + 1) as f64;
        let covariance = spread.covariance(state.orientation, state.velocity, (k + 1) as f64 * dt);
        write(out, start + k, Pose { position, orientation: state.orientation }, state.velocity, covariance);
    }
}

fn replay(out: &mut Predictions, row: usize, scenario: &Scenario, id: i64) {
    let Some(recorded) = scenario.obstacles.states.row(id) else { return };
    out.probability[row * out.n_modes] = 1.0;
    let start = out.offset(row, 0);
    for k in 0..out.n_steps {
        // Who leaves the recording is not expected anywhere afterwards.
        if let Some(state) = scenario.obstacles.states.get(recorded, out.time_step + 1 + k as i64) {
            write(out, start + k, state.pose(), state.velocity, (STANDING_VARIANCE, 0.0, STANDING_VARIANCE));
        }
    }
}

/// One lane to follow: a chain of lanelets, where on it, and how well it fits.
struct Lane {
    chain: Vec<usize>,
    s: f64,
    d: f64,
    heading_error: f64,
    weight: f64,
}

fn lanes_of(state: &State, reach: f64, settings: &LaneFollowing, road: &RoadNetwork) -> Vec<Lane> {
    const OFFSET_MAX: f64 = 1.0;
    const HEADING_MAX: f64 = 0.7;
    const OFFSET_SCALE: f64 = 0.8;
    const HEADING_SCALE: f64 = 0.25;
    let mut lanes: Vec<Lane> = Vec::new();
    for found in road.matching(state.pose(), OFFSET_MAX, HEADING_MAX) {
        let fit = (-(found.d / OFFSET_SCALE).powi(2) - (found.heading_error / HEADING_SCALE).powi(2)).exp().max(1e-12);
        let chains = road.paths_from(found.lanelet, found.s, reach, settings.modes_max);
        let weight = fit / chains.len().max(1) as f64;
        lanes.extend(chains.into_iter().map(|chain| Lane {
            chain,
            s: found.s,
            d: found.d,
            heading_error: found.heading_error,
            weight,
        }));
    }
    // Best first; equal weights keep the order in which the road network lists them.
    lanes.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    lanes.truncate(settings.modes_max);
    let best = lanes.first().map_or(0.0, |lane| lane.weight);
    lanes.retain(|lane| lane.weight >= 0.05 * best);
    lanes
}

fn follow_lanes(
    out: &mut Predictions,
    i: usize,
    row: usize,
    state: &State,
    settings: &LaneFollowing,
    scene: &Scene,
    road: &RoadNetwork,
) {
    let horizon = out.n_steps as f64 * scene.dt;
    let lanes = if scene.participants.kind[row].is_vehicle() && state.velocity > 0.0 {
        lanes_of(state, state.velocity * horizon + 10.0, settings, road)
    } else {
        Vec::new()
    };
    if lanes.is_empty() {
        go_straight(out, i, state, &settings.spread, scene.dt);
        return;
    }
    let total: f64 = lanes.iter().map(|lane| lane.weight).sum();
    for (mode, lane) in lanes.iter().enumerate() {
        out.probability[i * out.n_modes + mode] = lane.weight / total;
        follow_lane(out, i, mode, state, lane, settings, scene.dt, road);
    }
}

#[expect(clippy::too_many_arguments, reason = "private; the parts of one mode")]
fn follow_lane(
    out: &mut Predictions,
    i: usize,
    mode: usize,
    state: &State,
    lane: &Lane,
    settings: &LaneFollowing,
    dt: f64,
    road: &RoadNetwork,
) {
    let caps = SpeedCaps::along(lane, state.velocity * out.n_steps as f64 * dt, settings, road);
    let start = out.offset(i, mode);
    // The pose now, seen from the lane: the prediction starts exactly at the participant.
    let (now, _) = road.chain_pose(&lane.chain, lane.s, 0.0, lane.d);
    let shift = state.pose().position - now.position;
    let drift = state.velocity * lane.heading_error.sin();
    let (mut distance, mut velocity) = (0.0, state.velocity);
    for k in 0..out.n_steps {
        let time = (k + 1) as f64 * dt;
        let allowed = caps.at(distance + velocity * dt);
        velocity = if velocity > allowed {
            (velocity - settings.deceleration * dt * 1.5).max(allowed)
        } else {
            (velocity + dt).min(allowed).min(state.velocity)
        };
        distance += velocity * dt;
        let d = returning(lane.d, drift, time, settings.return_time);
        let (pose, _) = road.chain_pose(&lane.chain, lane.s, distance, d);
        let fade = (1.0 - time / settings.return_time).max(0.0);
        let ahead = returning(lane.d, drift, time + dt, settings.return_time);
        let pose = Pose {
            position: pose.position + shift * fade,
            orientation: pose.orientation + (ahead - d).atan2((velocity * dt).max(0.05)),
        };
        write(out, start + k, pose, velocity, settings.spread.covariance(pose.orientation, velocity, time));
    }
}

/// Cubic from (offset, drift) to (0, 0) within `duration`: the lateral offset at `time`.
fn returning(offset: f64, drift: f64, time: f64, duration: f64) -> f64 {
    if time >= duration {
        return 0.0;
    }
    let u = time / duration;
    let h00 = (1.0 + 2.0 * u) * (1.0 - u) * (1.0 - u);
    let h10 = u * (1.0 - u) * (1.0 - u);
    h00 * offset + h10 * duration * drift
}

/// Speed up to which curves ahead can be driven, on a grid along the lane.
struct SpeedCaps {
    spacing: f64,
    values: [f64; Self::COUNT],
}

impl SpeedCaps {
    const COUNT: usize = 33;

    fn along(lane: &Lane, reach: f64, settings: &LaneFollowing, road: &RoadNetwork) -> Self {
        let spacing = (reach.max(10.0)) / (Self::COUNT - 1) as f64;
        let mut values = [f64::INFINITY; Self::COUNT];
        for (j, value) in values.iter_mut().enumerate() {
            let (_, curvature) = road.chain_pose(&lane.chain, lane.s, j as f64 * spacing, 0.0);
            *value = (settings.lateral_acceleration / curvature.abs().max(1e-6)).sqrt();
        }
        for j in (0..Self::COUNT - 1).rev() {
            values[j] = values[j].min((values[j + 1].powi(2) + 2.0 * settings.deceleration * spacing).sqrt());
        }
        Self { spacing, values }
    }

    fn at(&self, distance: f64) -> f64 {
        self.values[((distance / self.spacing) as usize).min(Self::COUNT - 1)]
    }
}
