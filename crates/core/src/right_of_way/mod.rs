//! Right of way: when a vehicle may use ground that ways share. It follows from the map, the motion of those that an
//! agent sees, and what it remembers (its arrival, its grant), which is part of the world.
//!
//! Best read in this order: `zones` (conflict zones along a way), `traffic` (what a step looks at, what agents are told),
//! `ledger` (requests, reservations, the one order), and below it `windows` (when a vehicle is where), `gaps` (what fits
//! between reservations), `conditions` (room, sight), `circles` of waits.

mod ledger;
#[cfg(test)]
mod rail_tests;
mod traffic;
mod ways;
mod zones;

pub use traffic::OrderKind;
pub(crate) use traffic::{Body, Reservation, Traffic, Traveller, Yielding};
pub(crate) use traffic::{Memory, Order};
pub(crate) use ways::{crossing, strip};
pub(crate) use zones::{Course, MARGIN, Place, SPEED_MAX, Zone, reach};
pub use zones::{DESIGN_WIDTH, REACH, REACH_TIME, meeting_width};
