//! What the plans of all agents share about the predictions of a step.

use crate::geometry::{Aabb, Point};
use crate::trajectory::Predictions;

/// Directions and extents of all modes.
#[derive(Debug, Clone, Default)]
pub struct Outlook {
    /// Unit vectors along the headings; shape (participants, modes, steps) as in the predictions, (0, 0) where nobody is
    /// expected.
    pub(super) axes: Vec<Point>,
    /// Boxes around the expected positions; shape (participants, modes).
    pub(super) extents: Vec<Aabb>,
}

impl Outlook {
    /// Of some predictions.
    pub fn of(predictions: &Predictions) -> Self {
        let axis = |(orientation, valid): (&f64, &bool)| {
            if *valid { Point::from_angle(*orientation) } else { Point::default() }
        };
        let n_modes = predictions.ids.len() * predictions.n_modes;
        let extent = |mode: usize| {
            let steps = mode * predictions.n_steps..(mode + 1) * predictions.n_steps;
            let valid = steps.filter(|k| predictions.valid[*k]);
            Aabb::around(valid.map(|k| Point::new(predictions.x[k], predictions.y[k])))
        };
        Self {
            axes: predictions.orientation.iter().zip(&predictions.valid).map(axis).collect(),
            extents: (0..n_modes).map(extent).collect(),
        }
    }
}
