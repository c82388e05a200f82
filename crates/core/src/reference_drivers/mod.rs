//! Drivers against whom automated driving is measured: the competent and careful human of UN R157, the minimum of its
//! paragraph 5.2.5.2, Responsibility-Sensitive Safety, and the fuzzy safety model of the Joint Research Centre. In one
//! dimension: they keep their path and brake. Definitions and sources: docs/concepts/preventability.md.

pub mod cases;
mod drivers;
pub mod rss;

pub use drivers::{APPROACH, Driver, Encounter, Reaction, Seen};
