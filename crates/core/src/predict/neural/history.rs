//! What a participant did until now, at fixed instants whatever the time step is.

use crate::geometry::{Point, wrap_angle};
use crate::predict::stillness::Stillness;
use crate::scene::Scene;

/// Instants of the past.
pub const N_INSTANTS: usize = 10;
/// Time between them [s].
pub const INSTANT: f64 = 0.2;
/// The past is examined this far back [s].
const SPAN: f64 = N_INSTANTS as f64 * INSTANT;

/// Past positions of a participant.
#[derive(Debug, Clone, Copy)]
pub struct Instant {
    /// Position [m], world frame.
    pub position: Point,
    /// Speed along the heading as observed [m/s].
    pub velocity: f64,
    /// It is that of a time step, not interpolated.
    pub is_exact: bool,
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
    /// How long the past is known without a gap and how long it has not moved, at most 2 s.
    pub stillness: Stillness,
}

impl History {
    /// Of a row of the participants that has a finite state now.
    pub fn of(scene: &Scene, row: usize) -> Self {
        let now = scene.state(row);
        let velocity = scene.observed_velocity(row);
        let half_second = at(scene, row, 0.5);
        Self {
            instants: std::array::from_fn(|k| at(scene, row, (k + 1) as f64 * INSTANT).map(|found| found.0)),
            velocity,
            change: half_second.map(|(then, _)| velocity - then.velocity),
            acceleration: at(scene, row, 1.0).map(|(then, _)| velocity - then.velocity),
            yaw_rate: half_second.map(|(_, orientation)| wrap_angle(now.orientation - orientation) / 0.5),
            stillness: Stillness::of(scene, row, SPAN),
        }
    }

    /// It stands.
    pub fn is_standing(&self) -> bool {
        self.stillness.is_standing(self.velocity)
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
        Some((Instant { position: state.pose().position, velocity, is_exact: true }, state.orientation))
    };
    let (later, orientation) = state(after)?;
    if fraction.abs() <= ON_STEP {
        return Some((later, orientation));
    }
    let (earlier, turned) = state(after + 1.0)?;
    let instant = Instant {
        position: later.position.lerp(earlier.position, fraction),
        velocity: later.velocity + fraction * (earlier.velocity - later.velocity),
        is_exact: false,
    };
    Some((instant, orientation + fraction * wrap_angle(turned - orientation)))
}
