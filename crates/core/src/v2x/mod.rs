//! Cooperation by messages: agents with V2X share states, plans, what they see and claims over an imperfect channel.
//!
//! Best read in this order: `settings`, `draw` (numbers of the channel), `channel` (receivers and arrival), `message`,
//! `trigger` (when something is sent), `inbox` (what arrived), `network` (all of it, state of the world), then `know`
//! (what an agent knows), `expect` (what was received as predictions) and `claims` (negotiation).

mod channel;
mod claims;
mod draw;
mod expect;
mod inbox;
mod know;
mod log;
mod message;
mod network;
mod settings;
#[cfg(test)]
mod tests;
mod trigger;

pub use channel::{reception, steps_to_arrival};
pub use claims::{Agreement, Bar};
pub(crate) use claims::{Crossing, Negotiator, Neighbour};
pub use draw::{equipped, uniform};
pub(crate) use expect::Observer;
pub use expect::{Extra, SharedPredictions};
pub use know::{Known, Via};
pub use log::{Log, Logged, Row};
pub use message::{Claim, Message, Object, Payload, PlanPoint, Service, Status};
pub(crate) use network::{Network, Speaker};
pub use settings::V2xSettings;
