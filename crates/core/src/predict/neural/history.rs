//! What a participant did until now, at fixed instants whatever the time step is.

use crate::geometry::{Point, wrap_angle};
use crate::scene::Scene;

/// Instants of the past.
pub const N_INSTANTS: usize = 10;
/// Time between them [s].
pub const INSTANT: f64 = 0.2;
/// Who moved less than this [m] stands.
const UNMOVED: f64 = 0.1;
/// Who has not moved for this long [s] stands, whatever speed is stated.
const STANDING_TIME: f64 = 0.5;
/// With a shorter past, who has not moved and is slower than this [m/s] stands.
const STANDING_SPEED: f64 = 0.3;
/// The past is looked at this far back [s].
const SPAN: f64 = N_INSTANTS as f64 * INSTANT;

/// Where somebody was.
#[derive(Debug, Clone, Copy)]
pub struct Instant {
    /// Position [m], world frame.
    pub position: Point,
    /// Speed along the heading as observed [m/s].
    pub velocity: f64,
}

/// The past of a participant.
#[derive(Debug, Clone, Copy)]
pub struct History {
    /// States 0.2, 0.4, ... 2.0 s ago; `None`: unknown.
    pub instants: [Option<Instant>; N_INSTANTS],
    /// Speed along the heading now, as observed [m/s].
    pub velocity: f64,
    /// Change of speed over the last half second [m/s]; `None`: unknown.
    pub change: Option<f64>,
    /// Mean acceleration over the last second [m/s²]; `None`: unknown.
    pub acceleration: Option<f64>,
    /// Mean change of heading over the last half second [rad/s]; `None`: unknown.
    pub yaw_rate: Option<f64>,
    /// Time for which the past is known without a gap, at most 2 s.
    pub known: f64,
    /// Time for which it has not moved, at most 2 s.
    pub unmoved: f64,
}

impl History {
    /// Of a row of the participants that has a finite state now.
    pub fn of(scene: &Scene, row: usize) -> Self {
        let now = scene.state(row);
        let velocity = scene.observed_velocity(row);
        let (mut known, mut unmoved, mut is_unmoved) = (0.0, 0.0, true);
        let here = now.pose().position;
        for steps in 1..=(SPAN / scene.dt + 1e-9).floor() as i64 {
            let Some(state) = scene.past.get(row, scene.time_step - steps).filter(|s| s.is_finite()) else { break };
            known = steps as f64 * scene.dt;
            is_unmoved = is_unmoved && state.pose().position.distance(here) < UNMOVED;
            if is_unmoved {
                unmoved = known;
            }
        }
        let half_second = at(scene, row, 0.5);
        Self {
            instants: std::array::from_fn(|k| at(scene, row, (k + 1) as f64 * INSTANT).map(|found| found.0)),
            velocity,
            change: half_second.map(|(then, _)| velocity - then.velocity),
            acceleration: at(scene, row, 1.0).map(|(then, _)| velocity - then.velocity),
            yaw_rate: half_second.map(|(_, orientation)| wrap_angle(now.orientation - orientation) / 0.5),
            known,
            unmoved,
        }
    }

    /// It stands: its positions say so for half a second, or all that is known of it does.
    pub fn is_standing(&self) -> bool {
        self.unmoved >= STANDING_TIME - 1e-9 || (self.unmoved >= self.known && self.velocity.abs() < STANDING_SPEED)
    }
}

/// Change of the observed speed over the last half second [m/s]; `None`: unknown.
pub fn change_of_speed(scene: &Scene, row: usize, velocity: f64) -> Option<f64> {
    at(scene, row, 0.5).map(|(then, _)| velocity - then.velocity)
}

/// State and orientation some time ago [s], interpolated between time steps; `None` where one of both is unknown.
fn at(scene: &Scene, row: usize, ago: f64) -> Option<(Instant, f64)> {
    /// Instants this close to a time step, in steps, are taken from it.
    const ON_STEP: f64 = 1e-3;
    let steps = ago / scene.dt;
    let after = (steps + ON_STEP).floor();
    let fraction = steps - after;
    let state = |steps: f64| {
        let time_step = scene.time_step - steps as i64;
        let state = scene.past.get(row, time_step).filter(|state| state.is_finite())?;
        let velocity = scene.observed_velocity_at(row, time_step).filter(|v| v.is_finite())?;
        Some((Instant { position: state.pose().position, velocity }, state.orientation))
    };
    let (later, orientation) = state(after)?;
    if fraction.abs() <= ON_STEP {
        return Some((later, orientation));
    }
    let (earlier, turned) = state(after + 1.0)?;
    let instant = Instant {
        position: later.position.lerp(earlier.position, fraction),
        velocity: later.velocity + fraction * (earlier.velocity - later.velocity),
    };
    Some((instant, orientation + fraction * wrap_angle(turned - orientation)))
}
