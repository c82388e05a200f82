//! CommonRoad XML of the versions 2018b and 2020a as arrays.
//!
//! [`read`] takes the text of a document and returns its [`Document`], or a [`Refusal`]: one line that names the element
//! and says what to do, without the name of the file. What it accepts, and what numbers it makes of it, is what
//! commonroad-io does, the reference of the format; tests compare both. What follows from the contents (values that a
//! recording does not state, priorities, notes) is not decided here.
//!
//! Modules from below: `values`, `names`, `limits`, `document`, `tree`, `numbers`, `references`, `structure`, `shapes`,
//! `states`, `roads`, `control`, `traffic`, `problems`, `reading`.

mod control;
pub mod document;
pub mod limits;
mod names;
mod numbers;
mod problems;
mod reading;
mod references;
mod roads;
mod shapes;
mod states;
mod structure;
mod traffic;
mod tree;
mod values;

pub use document::{Document, Refusal};
pub use reading::read;
