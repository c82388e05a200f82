//! What an observation consists of.

use crate::settings::{between, choice, settings};

/// Distances at which the path ahead is observed [m].
pub const AHEAD: [f64; 16] =
    [2.0, 4.0, 6.0, 9.0, 12.0, 16.0, 20.0, 25.0, 30.0, 36.0, 42.0, 50.0, 60.0, 72.0, 86.0, 100.0];
/// Most participants.
const ROWS_MAX: f64 = 256.0;

choice! {
    /// How an observation is handed out.
    pub enum Form {
        /// One vector.
        Flat = "flat",
        /// Blocks by name.
        Dict = "dict",
    }
}

settings! {
    /// What learners and learned planners observe.
    ///
    /// An observer knows its own state, path and goal, and the participants that it sees.
    pub struct ObservationSettings as ObservationSettings {
        /// "flat": one vector. "dict": blocks by name.
        form: Form = Form::Flat;
        /// Number of points on the path ahead.
        route: usize = 16, between(0.0, 16.0);
        /// Number of other participants: the nearest visible ones.
        partners: usize = 12, between(0.0, ROWS_MAX);
        /// Number of pieces of road edge: the nearest within 50 m.
        edges: usize = 0, between(0.0, ROWS_MAX);
        /// Whether to add the predicted positions of other participants in 1, 2 and 3 s.
        predictions: bool = false;
        /// Whether to add a raster image from above.
        raster: bool = false;
    }
}

impl ObservationSettings {
    /// Number of participants whose predictions are observed.
    pub(super) fn predicted(&self) -> usize {
        if self.predictions { self.partners } else { 0 }
    }
}
