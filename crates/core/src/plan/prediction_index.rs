//! What the plans of all agents share about the predictions of a step.

use crate::geometry::Point;
use crate::geometry::directions::write_directions;
use crate::geometry::shape::OrientedBox;
use crate::simd::multiversion;
use crate::trajectory::Predictions;

/// Directions and regions of all modes.
#[derive(Debug, Clone, Default)]
pub struct PredictionIndex {
    /// Unit vectors along the headings, first all x, then all y; (0, 0) where there is no prediction.
    axes: Vec<f64>,
    /// Boxes around the positions, now and expected, along the way; shape (participants, modes).
    pub(super) regions: Vec<OrientedBox>,
}

impl PredictionIndex {
    /// Of some predictions, and of where their participants are now: world frame [m], one per row of the predictions.
    ///
    /// # Panics
    /// If there are fewer positions than rows.
    pub fn of(predictions: &Predictions, positions: &[Point]) -> Self {
        let Predictions { orientation, valid, n_steps, n_modes, .. } = predictions;
        let mut axes = vec![0.0; 2 * orientation.len()];
        let (x, y) = axes.split_at_mut(orientation.len());
        write_directions(orientation, valid, x, y);
        let region = |mode: usize| {
            let steps = mode * n_steps..(mode + 1) * n_steps;
            let way = ModePositions {
                x: &predictions.x[steps.clone()],
                y: &predictions.y[steps.clone()],
                valid: &valid[steps],
            };
            around(positions[mode / n_modes], way)
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

/// Positions of one mode, as far as they are known.
#[derive(Debug, Clone, Copy)]
struct ModePositions<'a> {
    x: &'a [f64],
    y: &'a [f64],
    valid: &'a [bool],
}

/// A box around a position and the following positions, along the way from the first to the last.
fn around(now: Point, way: ModePositions) -> OrientedBox {
    let Some(last) = way.valid.iter().rposition(|valid| *valid) else {
        return OrientedBox { center: now, axis: Point::new(1.0, 0.0), half_length: 0.0, half_width: 0.0 };
    };
    let ahead = Point::new(way.x[last], way.y[last]) - now;
    let length = ahead.norm();
    let axis = if length > 0.0 { ahead * (1.0 / length) } else { Point::new(1.0, 0.0) };
    let [rear, front, right, left] = spread(now, axis, way);
    OrientedBox {
        center: now + axis * (0.5 * (rear + front)) + axis.left() * (0.5 * (right + left)),
        axis,
        half_length: 0.5 * (front - rear),
        half_width: 0.5 * (left - right),
    }
}

multiversion! {
    /// How far the positions are behind, ahead, right and left of a place.
    fn spread = spread_at, (from: Point, axis: Point, way: ModePositions) -> [f64; 4]
}

#[inline(always)]
fn spread_at(from: Point, axis: Point, ModePositions { x, y, valid }: ModePositions) -> [f64; 4] {
    const LANES: usize = 4;
    let n = x.len();
    let (y, valid) = (&y[..n], &valid[..n]);
    let mut ends = [[0.0; LANES]; 4];
    for first in (0..n).step_by(LANES) {
        let (mut ahead, mut aside) = ([0.0; LANES], [0.0; LANES]);
        if let ([x0, x1, x2, x3, ..], [y0, y1, y2, y3, ..]) = (&x[first..], &y[first..]) {
            let (x, y) = ([*x0, *x1, *x2, *x3], [*y0, *y1, *y2, *y3]);
            for k in 0..LANES {
                ahead[k] = (x[k] - from.x) * axis.x + (y[k] - from.y) * axis.y;
                aside[k] = (y[k] - from.y) * axis.x - (x[k] - from.x) * axis.y;
            }
        } else {
            for k in 0..n - first {
                let (x, y) = (x[first + k] - from.x, y[first + k] - from.y);
                (ahead[k], aside[k]) = (x * axis.x + y * axis.y, y * axis.x - x * axis.y);
            }
        }
        for k in 0..LANES.min(n - first) {
            if !valid[first + k] {
                (ahead[k], aside[k]) = (0.0, 0.0);
            }
        }
        for k in 0..LANES {
            ends[0][k] = if ahead[k] < ends[0][k] { ahead[k] } else { ends[0][k] };
            ends[1][k] = if ahead[k] > ends[1][k] { ahead[k] } else { ends[1][k] };
            ends[2][k] = if aside[k] < ends[2][k] { aside[k] } else { ends[2][k] };
            ends[3][k] = if aside[k] > ends[3][k] { aside[k] } else { ends[3][k] };
        }
    }
    let smaller = |a: f64, b: f64| if a < b { a } else { b };
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    let least = |[a, b, c, d]: [f64; LANES]| smaller(smaller(a, b), smaller(c, d));
    let most = |[a, b, c, d]: [f64; LANES]| larger(larger(a, b), larger(c, d));
    [least(ends[0]), most(ends[1]), least(ends[2]), most(ends[3])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    #[test]
    fn a_region_holds_the_positions_now_and_expected_and_is_as_narrow_as_the_way() {
        // Northeast, with a bend of half a metre.
        let at = |i: f64| Point::new(5.0 + i, 7.0 + i) + Point::new(-0.5, 0.5) * (i * (8.0 - i) / 16.0);
        let (x, y): (Vec<f64>, Vec<f64>) = (1..=9).map(|i| at(f64::from(i.min(8)))).map(|p| (p.x, p.y)).unzip();
        let mut valid = [true; 9];
        let way = ModePositions { x: &x, y: &y, valid: &valid };
        let region = around(at(0.0), way);
        assert_eq!(spread(at(0.0), region.axis, way), spread_at(at(0.0), region.axis, way));
        assert!((0..=8).all(|i| region.contains(at(f64::from(i)))));
        assert!((2.0 * region.half_length - 8.0 * 2.0_f64.sqrt()).abs() < 1e-9, "{region:?}");
        assert!((2.0 * region.half_width - 0.5_f64.sqrt()).abs() < 1e-9, "{region:?}");
        valid = [false; 9];
        let alone = around(Point::new(3.0, 4.0), ModePositions { x: &x, y: &y, valid: &valid });
        assert_eq!((alone.center, alone.half_length, alone.half_width), (Point::new(3.0, 4.0), 0.0, 0.0));
    }
    #[test]
    fn places_that_are_not_valid_do_not_count_on_wide_machines_and_others() {
        let mut random = Lcg::new(5);
        for n in 0..14 {
            let valid: Vec<bool> = (0..n).map(|_| random.within(0.0, 1.0) < 0.7).collect();
            let number = |valid: bool, random: &mut Lcg| if valid { random.within(-30.0, 30.0) } else { f64::NAN };
            let x: Vec<f64> = valid.iter().map(|valid| number(*valid, &mut random)).collect();
            let y: Vec<f64> = valid.iter().map(|valid| number(*valid, &mut random)).collect();
            let way = ModePositions { x: &x, y: &y, valid: &valid };
            let region = around(Point::new(1.0, 2.0), way);
            assert!(region.contains(Point::new(1.0, 2.0)));
            assert!((0..n).filter(|k| valid[*k]).all(|k| region.contains(Point::new(x[k], y[k]))), "{n}");
            let axis = Point::from_angle(0.3);
            assert_eq!(spread(Point::default(), axis, way), spread_at(Point::default(), axis, way));
        }
    }
}
