//! Cooperation by messages: agents with V2X share states, plans, what they see and what they ask for over an imperfect
//! channel.
//!
//! Best read in this order: `settings`, `draw` (numbers of the channel), `channel` (receivers and arrival), `message`,
//! `trigger` (when something is sent), `inbox` (what arrived), `radio` (all of it, state of the world), then `know`
//! (what an agent knows) and `expect` (what was received as predictions). What follows for the right of way:
//! `world/cooperation`.

mod channel;
mod draw;
mod expect;
mod inbox;
mod know;
mod log;
mod message;
mod radio;
mod settings;
#[cfg(test)]
mod tests;
mod trigger;

pub use channel::{reception, steps_to_arrival};
pub use draw::equipped;
pub(crate) use expect::Observer;
pub use expect::{Extra, SharedPredictions};
pub use know::{Known, Via};
pub use log::{Agreement, Log, Logged, Row};
pub use message::Service;
pub(crate) use message::{Object, Payload, WAY_SPACING};
pub(crate) use radio::{Radio, Speaker};
pub use settings::V2xSettings;
pub(crate) use trigger::interpolated;
