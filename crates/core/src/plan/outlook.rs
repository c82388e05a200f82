//! What the plans of all agents share about the predictions of a step.

use crate::geometry::Point;
use crate::geometry::directions::write_directions;
use crate::geometry::shape::OrientedBox;
use crate::trajectory::Predictions;

/// Directions and regions of all modes.
#[derive(Debug, Clone, Default)]
pub struct Outlook {
    /// Unit vectors along the headings, first all x, then all y; (0, 0) where nobody is expected.
    axes: Vec<f64>,
    /// Boxes around the positions, now and expected, along the way; shape (participants, modes).
    pub(super) regions: Vec<OrientedBox>,
}

impl Outlook {
    /// Of some predictions, and of where the participants are now.
    pub fn of(predictions: &Predictions, positions: &[Point]) -> Self {
        let Predictions { orientation, valid, n_steps, n_modes, .. } = predictions;
        let mut axes = vec![0.0; 2 * orientation.len()];
        let (x, y) = axes.split_at_mut(orientation.len());
        write_directions(orientation, valid, x, y);
        let region = |mode: usize| {
            let steps = mode * n_steps..(mode + 1) * n_steps;
            let valid = steps.filter(|k| valid[*k]);
            around(positions[mode / n_modes], valid.map(|k| Point::new(predictions.x[k], predictions.y[k])))
        };
        Self { axes, regions: (0..predictions.ids.len() * n_modes).map(region).collect() }
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

/// A box around a position and those that follow, along the way from the first to the last.
fn around(now: Point, others: impl DoubleEndedIterator<Item = Point> + Clone) -> OrientedBox {
    let way = others.clone().next_back().map_or(Point::default(), |last| last - now);
    let length = way.norm();
    let axis = if length > 0.0 { way * (1.0 / length) } else { Point::new(1.0, 0.0) };
    let (mut rear, mut front, mut right, mut left) = (0.0, 0.0, 0.0, 0.0);
    for position in others {
        let (ahead, aside) = ((position - now).dot(axis), axis.cross(position - now));
        rear = if ahead < rear { ahead } else { rear };
        front = if ahead > front { ahead } else { front };
        right = if aside < right { aside } else { right };
        left = if aside > left { aside } else { left };
    }
    OrientedBox {
        center: now + axis * (0.5 * (rear + front)) + axis.left() * (0.5 * (right + left)),
        axis,
        half_length: 0.5 * (front - rear),
        half_width: 0.5 * (left - right),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_holds_the_positions_now_and_expected_and_is_as_narrow_as_the_way() {
        // Northeast, with a bend of half a metre.
        let at = |i: f64| Point::new(5.0 + i, 7.0 + i) + Point::new(-0.5, 0.5) * (i * (8.0 - i) / 16.0);
        let region = around(at(0.0), (1..=8).map(|i| at(f64::from(i))));
        assert!((0..=8).all(|i| region.contains(at(f64::from(i)))));
        assert!((2.0 * region.half_length - 8.0 * 2.0_f64.sqrt()).abs() < 1e-9, "{region:?}");
        assert!((2.0 * region.half_width - 0.5_f64.sqrt()).abs() < 1e-9, "{region:?}");
        let alone = around(Point::new(3.0, 4.0), std::iter::empty());
        assert_eq!((alone.center, alone.half_length, alone.half_width), (Point::new(3.0, 4.0), 0.0, 0.0));
    }
}
