//! What the plans of all agents share about the predictions of a step.

use crate::geometry::directions::write_directions;
use crate::geometry::{Aabb, Point};
use crate::trajectory::Predictions;

/// Directions and extents of all modes.
#[derive(Debug, Clone, Default)]
pub struct Outlook {
    /// Unit vectors along the headings, first all x, then all y; (0, 0) where nobody is expected.
    axes: Vec<f64>,
    /// Boxes around the expected positions; shape (participants, modes).
    pub(super) extents: Vec<Aabb>,
}

impl Outlook {
    /// Of some predictions.
    pub fn of(predictions: &Predictions) -> Self {
        let Predictions { orientation, valid, n_steps, n_modes, .. } = predictions;
        let mut axes = vec![0.0; 2 * orientation.len()];
        let (x, y) = axes.split_at_mut(orientation.len());
        write_directions(orientation, valid, x, y);
        let extent = |mode: usize| {
            let steps = mode * n_steps..(mode + 1) * n_steps;
            let valid = steps.filter(|k| valid[*k]);
            Aabb::around(valid.map(|k| Point::new(predictions.x[k], predictions.y[k])))
        };
        Self { axes, extents: (0..predictions.ids.len() * n_modes).map(extent).collect() }
    }

    /// x of the unit vectors; shape (participants, modes, steps) as in the predictions.
    #[inline(always)]
    pub(super) fn axis_x(&self) -> &[f64] {
        &self.axes[..self.axes.len() / 2]
    }

    /// y of the unit vectors.
    #[inline(always)]
    pub(super) fn axis_y(&self) -> &[f64] {
        &self.axes[self.axes.len() / 2..]
    }

    /// Unit vector along the heading of a place in the predictions.
    #[inline(always)]
    pub(super) fn axis(&self, place: usize) -> Point {
        Point::new(self.axis_x()[place], self.axis_y()[place])
    }
}
