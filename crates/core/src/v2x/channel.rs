//! Which agents receive a message, and when. Every pair of sender and receiver has numbers of its own, so nothing depends on an
//! order.

use super::V2xSettings;
use super::draw::{JITTER, RECEPTION, uniform};

/// Probability that a message gets over a distance [m]: without fading all or nothing. With fading the power is gamma
/// distributed (Nakagami, m = 3) and its mean falls with the square of the distance: Killat, Hartenstein, EURASIP JWCN
/// 2009, doi 10.1155/2009/914287.
pub fn reception(settings: &V2xSettings, distance: f64) -> f64 {
    let x = distance / settings.range;
    let within = if settings.fading {
        (-3.0 * x * x).exp() * (1.0 + 3.0 * x * x + 4.5 * x.powi(4))
    } else {
        f64::from(u8::from(x <= 1.0))
    };
    (1.0 - settings.loss) * within
}

/// Number of steps of `dt` [s] after which a message arrives; at least one, because all agents plan at the same time.
pub fn steps_to_arrival(delay: f64, dt: f64) -> i64 {
    ((delay / dt - 1e-9).ceil() as i64).max(1)
}

/// The way of a message: time step of sending, ids of sender and receiver, code of the service.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transmission {
    pub(super) time_step: i64,
    pub(super) sender: i64,
    pub(super) receiver: i64,
    pub(super) service: i64,
}

impl Transmission {
    fn drawn(&self, seed: u64, purpose: i64) -> f64 {
        uniform(seed, &[purpose, self.time_step, self.sender, self.receiver, self.service])
    }

    /// Time step of arrival; `None` if it is lost. `probability` is that of [`reception`].
    pub(super) fn arrival(&self, settings: &V2xSettings, seed: u64, probability: f64, dt: f64) -> Option<i64> {
        // A draw is below 1, so certainty needs none.
        if probability <= 0.0 || (probability < 1.0 && self.drawn(seed, RECEPTION) >= probability) {
            return None;
        }
        let jitter = if settings.jitter > 0.0 { settings.jitter * self.drawn(seed, JITTER) } else { 0.0 };
        Some(self.time_step + steps_to_arrival(settings.delay + jitter, dt))
    }
}
