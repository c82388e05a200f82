//! What the plans of all agents share about the predictions of a step.

use crate::geometry::{Aabb, Point};
use crate::trajectory::Predictions;

/// Directions and extents of all modes.
#[derive(Debug, Clone, Default)]
pub struct Outlook {
    /// Unit vectors along the headings, x and y; shape (participants, modes, steps) as in the predictions, 0 where nobody
    /// is expected.
    pub(super) axis_x: Vec<f64>,
    pub(super) axis_y: Vec<f64>,
    /// Boxes around the expected positions; shape (participants, modes).
    pub(super) extents: Vec<Aabb>,
}

impl Outlook {
    /// Of some predictions.
    pub fn of(predictions: &Predictions) -> Self {
        let n = predictions.orientation.len();
        let mut outlook = Self { axis_x: vec![0.0; n], axis_y: vec![0.0; n], extents: Vec::new() };
        for k in (0..n).filter(|k| predictions.valid[*k]) {
            let axis = Point::from_angle(predictions.orientation[k]);
            (outlook.axis_x[k], outlook.axis_y[k]) = (axis.x, axis.y);
        }
        let extent = |mode: usize| {
            let steps = mode * predictions.n_steps..(mode + 1) * predictions.n_steps;
            let valid = steps.filter(|k| predictions.valid[*k]);
            Aabb::around(valid.map(|k| Point::new(predictions.x[k], predictions.y[k])))
        };
        outlook.extents.extend((0..predictions.ids.len() * predictions.n_modes).map(extent));
        outlook
    }

    /// Unit vector along the heading of a place in the predictions.
    #[inline(always)]
    pub(super) fn axis(&self, place: usize) -> Point {
        Point::new(self.axis_x[place], self.axis_y[place])
    }
}
