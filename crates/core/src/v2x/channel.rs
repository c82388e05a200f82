//! Which agents receive a message, and when. Every pair of sender and receiver has numbers of its own, so nothing depends on an
//! order.

use super::V2xSettings;
use super::draw::{JITTER, RECEPTION};
use crate::draws::uniform;

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

/// Time step at which a message arrives; `None` if it is lost. `way` is the time step of sending, the ids of sender and
/// receiver, and the code of the service; `probability` is that of [`reception`].
pub(super) fn arrival(settings: &V2xSettings, seed: u64, way: [i64; 4], probability: f64, dt: f64) -> Option<i64> {
    let [time_step, sender, receiver, service] = way;
    let drawn = |purpose: i64| uniform(seed, &[purpose, time_step, sender, receiver, service]);
    // A draw is below 1, so certainty needs none.
    if probability <= 0.0 || (probability < 1.0 && drawn(RECEPTION) >= probability) {
        return None;
    }
    let jitter = if settings.jitter > 0.0 { settings.jitter * drawn(JITTER) } else { 0.0 };
    Some(time_step + steps_to_arrival(settings.delay + jitter, dt))
}
