//! Where the agent's footprint can get; participants that stay away from there are skipped.

use super::super::grid::SampleGrid;
use super::super::targets::{BULGE, KNOTS};
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Aabb, Point, Pose};
use crate::plan::PlanRequest;
use crate::plan::frame::Start;

/// Numbers in single precision that are worked on at once.
pub(super) const GROUP: usize = 8;
/// How much further than the samples the agent is taken to get along the path [m].
const LEAD: f64 = 2.0;
/// More than boxes of bodies are off by in single precision within 4 km of the origin [m].
pub(super) const ROUNDING: f32 = 2e-3;

/// Boxes of the region that the agent's footprint can reach up to each point, along its present heading; the memory is
/// reused.
#[derive(Debug, Clone)]
pub(super) struct Reach {
    /// Where the agent is: numbers in single precision are relative to it.
    pub(super) origin: Point,
    /// Unit vector along its heading.
    axis: Point,
    /// Up to the last point, ahead and left of the origin.
    whole: Aabb,
    /// Lower and upper end ahead, and to the left; (four, points from 1 on, with padding that holds nothing).
    sides: Vec<f32>,
    n_points: usize,
    stride: usize,
}

impl Default for Reach {
    fn default() -> Self {
        Self {
            origin: Point::default(),
            axis: Point::new(1.0, 0.0),
            whole: Aabb::EMPTY,
            sides: Vec::new(),
            n_points: 0,
            stride: 0,
        }
    }
}

impl Reach {
    /// The path from the start to beyond the furthest arc length of any sample at each point, grown by the lateral range
    /// and the agent's size.
    pub(super) fn find(&mut self, request: &PlanRequest, start: &Start, samples: &SampleGrid) {
        let vehicle = request.vehicle;
        let (half_length, half_width) = (0.5 * vehicle.length, 0.5 * vehicle.width);
        let size = (vehicle.rear_axle_to_center + half_length).hypot(half_width);
        let widest = samples.end_offsets.iter().fold(start.d.abs(), |widest, d| widest.max(d.abs()));
        // A quintic that begins with a slope and a bend overshoots by at most so much, see `SampleGrid::lateral_bounds`.
        let way = (samples.furthest[samples.n_points - 1] - start.s)
            .max(start.s_dot * (samples.n_points - 1) as f64 * request.dt)
            .max(samples.arc_min);
        let sideways = widest + way * (0.2 * start.d_prime.abs() + 0.018 * way * start.d_prime2.abs());
        let path = &request.route.path;
        let (x, y) = (path.x(), path.y());
        let knot = |s: f64| ((s / path.spacing()).max(0.0) as usize).min(x.len() - 1);
        self.begin(request.state.pose(), samples.n_points);
        let (origin, axis) = (self.origin, self.axis);
        let local = |p: Point| Point::new((p - origin).dot(axis), axis.cross(p - origin));
        let mut next = knot(start.s);
        let mut region = Aabb::around([local(path.at(start.s).position), local(Point::new(x[next], y[next]))]);
        for i in 0..samples.n_points {
            let last = (knot(samples.furthest[i] + LEAD) + 1).min(x.len() - 1);
            while next < last {
                next = (next + KNOTS).min(last);
                region = region.including(local(Point::new(x[next], y[next])));
            }
            if i > 0 {
                self.set(i, region.grown(size + sideways + BULGE));
            }
        }
    }

    /// Clears the regions: `n_points` points around a pose.
    pub(super) fn begin(&mut self, pose: Pose, n_points: usize) {
        (self.origin, self.axis, self.whole) = (pose.position, Point::from_angle(pose.orientation), Aabb::EMPTY);
        self.n_points = n_points;
        self.stride = (n_points - 1).next_multiple_of(GROUP);
        self.sides.clear();
        self.sides.resize(4 * self.stride, f32::NAN);
    }

    /// The region up to a point from 1 on, ahead and left of the origin; it becomes the whole.
    pub(super) fn set(&mut self, point: usize, reached: Aabb) {
        let (low, high) = (reached.min, reached.max);
        let rounding = f64::from(ROUNDING);
        let sides = [low.x - rounding, high.x + rounding, low.y - rounding, high.y + rounding];
        for (k, side) in sides.into_iter().enumerate() {
            self.sides[k * self.stride + point - 1] = side as f32;
        }
        self.whole = reached;
    }

    /// The region up to the last point, world frame.
    pub(super) fn whole(&self) -> OrientedBox {
        let (middle, half) = (self.whole.min.lerp(self.whole.max, 0.5), (self.whole.max - self.whole.min) * 0.5);
        let center = self.origin + self.axis * middle.x + self.axis.left() * middle.y;
        OrientedBox { center, axis: self.axis, half_length: half.x, half_width: half.y }
    }

    /// Unit vector along the agent's heading.
    #[inline(always)]
    pub(super) fn axis(&self) -> [f32; 2] {
        [self.axis.x as f32, self.axis.y as f32]
    }

    /// Points of a plan, 0 among them.
    pub(super) fn n_points(&self) -> usize {
        self.n_points
    }

    /// Points from 1 on, with padding; as many as intervals.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Lower and upper end ahead, and to the left, of a group of points: `GROUP * group + 1` and the following. Padding is not
    /// a number.
    #[inline(always)]
    pub(super) fn sides(&self, group: usize) -> [[f32; GROUP]; 4] {
        let mut sides = [[f32::NAN; GROUP]; 4];
        for (k, side) in sides.iter_mut().enumerate() {
            let first = k * self.stride + group * GROUP;
            if let [a, b, c, d, e, f, g, h] = self.sides[first..first + GROUP] {
                *side = [a, b, c, d, e, f, g, h];
            }
        }
        sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;
    use crate::plan::frenet::feasibility::Limits;
    use crate::plan::frenet::targets::Targets;
    use crate::plan::frenet::tests::choice::random_drive;
    use crate::plan::frenet::{FrenetSettings, Rejection, candidates, n_points};

    #[test]
    fn no_footprint_of_a_sample_is_out_of_reach() {
        let (mut random, mut reach, mut n_samples) = (Lcg::new(31), Reach::default(), 0);
        for _ in 0..40 {
            let drive = random_drive(&mut random);
            let settings = FrenetSettings { d_max: random.within(0.5, 8.0), ..FrenetSettings::default() };
            drive.with_request(|request| {
                let Ok(start) = Start::new(request, true) else { return };
                let n_points = n_points(request, &settings);
                let limits = Limits::new(request, n_points, start.curvature);
                let targets = Targets::new(request, &start, &settings);
                let mut samples = SampleGrid::default();
                let path = &request.route.path;
                let inputs = crate::plan::frenet::grid::Inputs {
                    start: &start,
                    targets: &targets,
                    limits: &limits,
                    settings: &settings,
                    path,
                };
                samples.generate(&inputs);
                reach.find(request, &start, &samples);
                let all = candidates(request, &settings);
                let pose = request.state.pose();
                let half = Point::new(0.5 * request.vehicle.length, 0.5 * request.vehicle.width);
                for sample in (0..all.len()).filter(|i| all.rejection[*i] == Rejection::Admissible) {
                    n_samples += 1;
                    for i in 1..n_points {
                        let k = sample * n_points + i;
                        let center = Point::new(all.x[k], all.y[k]);
                        let way = center - Point::new(all.x[k - 1], all.y[k - 1]);
                        let axis = if way.norm() > 0.05 {
                            way * (1.0 / way.norm())
                        } else {
                            Point::from_angle(pose.orientation)
                        };
                        let body = OrientedBox { center, axis, half_length: half.x, half_width: half.y };
                        let [rear, front, right, left] = reach.sides((i - 1) / GROUP).map(|side| side[(i - 1) % GROUP]);
                        for corner in body.corners().map(|corner| pose.body_from_world(corner)) {
                            let (x, y) = (corner.x as f32, corner.y as f32);
                            assert!(rear <= x && x <= front && right <= y && y <= left, "{corner:?} at {i}");
                        }
                    }
                }
            });
        }
        assert!(n_samples > 5000, "{n_samples}");
    }
}
