//! Where one mode of a participant is at the points of a plan, in single precision.

use super::reach::GROUP;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;
use crate::plan::PlanRequest;
use crate::simd::multiversion;

/// A place in the predictions, and how many there are from there on, one per point from 1 on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PredictedSteps {
    pub(super) first: usize,
    pub(super) n: usize,
}

/// Poses of a box at all points, from 0 on: centre from an origin and axis. Beyond what is known they are not numbers. The
/// memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Poses {
    x: Vec<f32>,
    y: Vec<f32>,
    axis_x: Vec<f32>,
    axis_y: Vec<f32>,
}

/// Centres and axes of one more point than a group has intervals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub(super) x: [f32; GROUP + 1],
    pub(super) y: [f32; GROUP + 1],
    pub(super) axis_x: [f32; GROUP + 1],
    pub(super) axis_y: [f32; GROUP + 1],
}

impl Poses {
    /// Clears all poses and reserves `stride` intervals with padding.
    pub(super) fn begin(&mut self, stride: usize) {
        for column in [&mut self.x, &mut self.y, &mut self.axis_x, &mut self.axis_y] {
            column.clear();
            column.resize(stride + 1, f32::NAN);
        }
    }

    /// The pose at a point.
    #[inline(always)]
    pub(super) fn set(&mut self, point: usize, center: Point, axis: Point) {
        (self.x[point], self.y[point]) = (center.x as f32, center.y as f32);
        (self.axis_x[point], self.axis_y[point]) = (axis.x as f32, axis.y as f32);
    }

    /// A box that never moves.
    pub(super) fn stand(&mut self, stride: usize, body: &OrientedBox, origin: Point) {
        self.begin(stride);
        for point in 0..=stride {
            self.set(point, body.center - origin, body.axis);
        }
    }

    /// The box of a participant from now on, whose middle lies `offset` from its position in its body frame.
    pub(super) fn follow(
        &mut self,
        (stride, origin): (usize, Point),
        now: &OrientedBox,
        steps: PredictedSteps,
        offset: Point,
        request: &PlanRequest,
    ) {
        self.begin(stride);
        self.set(0, now.center - origin, now.axis);
        write_poses(self, steps, offset, origin, request);
        let valid = &request.predictions.valid[steps.first..steps.first + steps.n];
        for (x, _) in self.x[1..].iter_mut().zip(valid).filter(|(_, valid)| !**valid) {
            *x = f32::NAN;
        }
    }

    /// Points `GROUP * group` and the following.
    #[inline(always)]
    pub(super) fn stretch(&self, group: usize) -> Stretch {
        let nothing = [f32::NAN; GROUP + 1];
        let mut stretch = Stretch { x: nothing, y: nothing, axis_x: nothing, axis_y: nothing };
        let columns = [&self.x, &self.y, &self.axis_x, &self.axis_y];
        let out = [&mut stretch.x, &mut stretch.y, &mut stretch.axis_x, &mut stretch.axis_y];
        for (out, column) in out.into_iter().zip(columns) {
            if let [a, b, c, d, e, f, g, h, i] = column[group * GROUP..=(group + 1) * GROUP] {
                *out = [a, b, c, d, e, f, g, h, i];
            }
        }
        stretch
    }
}

multiversion! {
    fn write_poses = poses_at, (
        out: &mut Poses,
        steps: PredictedSteps,
        offset: Point,
        origin: Point,
        request: &PlanRequest,
    )
}

#[inline(always)]
fn poses_at(
    out: &mut Poses,
    PredictedSteps { first, n }: PredictedSteps,
    offset: Point,
    origin: Point,
    request: &PlanRequest,
) {
    let (predictions, prediction_index) = (request.predictions, request.prediction_index);
    let (x, y) = (&predictions.x[first..first + n], &predictions.y[first..first + n]);
    let (axis_x, axis_y) = (&prediction_index.axis_x()[first..first + n], &prediction_index.axis_y()[first..first + n]);
    let (to_x, to_y) = (&mut out.x[1..=n], &mut out.y[1..=n]);
    for k in 0..n {
        to_x[k] = (x[k] - origin.x + (axis_x[k] * offset.x - axis_y[k] * offset.y)) as f32;
        to_y[k] = (y[k] - origin.y + (axis_y[k] * offset.x + axis_x[k] * offset.y)) as f32;
    }
    let (to_x, to_y) = (&mut out.axis_x[1..=n], &mut out.axis_y[1..=n]);
    for k in 0..n {
        (to_x[k], to_y[k]) = (axis_x[k] as f32, axis_y[k] as f32);
    }
}
