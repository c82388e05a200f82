//! The trajectory of one sample in the world, all points at once.

use super::super::frame::{FrenetPoint, STRETCH_MIN, Waypoint};
use super::feasibility::{Limits, Turning};
use super::lateral::LateralPoints;
use super::profiles::{PathPoints, ProfilePoints};
use crate::geometry::Point;
use crate::geometry::polyline::PathPoint;
use crate::simd::multiversion;

/// A sample in the frame of the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrenetTrajectory<'a> {
    pub(super) motion: ProfilePoints<'a>,
    pub(super) path: PathPoints<'a>,
    pub(super) lateral: LateralPoints<'a>,
    pub(super) end_offset: f64,
    pub(super) is_over_arc: bool,
}

impl FrenetTrajectory<'_> {
    /// Path and place beside it at one point.
    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> (PathPoint, FrenetPoint) {
        let path = &self.path;
        let at = PathPoint {
            position: Point::new(path.x[i], path.y[i]),
            theta: path.theta[i],
            cos: path.cos[i],
            sin: path.sin[i],
            curvature: path.curvature[i],
            curvature_rate: path.curvature_rate[i],
        };
        let (s_dot, s_ddot) = (self.motion.s_dot[i], self.motion.s_ddot[i]);
        let [d, mut d_prime, mut d_prime2] = self.lateral.at(i, self.end_offset);
        if !self.is_over_arc {
            let per_speed = 1.0 / s_dot;
            d_prime *= per_speed;
            d_prime2 = (d_prime2 - d_prime * s_ddot) * (per_speed * per_speed);
        }
        (at, FrenetPoint { s_dot, s_ddot, d, d_prime, d_prime2 })
    }

    /// Some points, in slices of one length, so that no bounds are checked point by point.
    #[inline(always)]
    fn cut(&self, first: usize, n: usize) -> Self {
        let range = first..first + n;
        let ProfilePoints { s, s_dot, s_ddot } = self.motion;
        let PathPoints { x, y, theta, cos, sin, curvature, curvature_rate } = self.path;
        Self {
            motion: ProfilePoints {
                s: &s[range.clone()],
                s_dot: &s_dot[range.clone()],
                s_ddot: &s_ddot[range.clone()],
            },
            path: PathPoints {
                x: &x[range.clone()],
                y: &y[range.clone()],
                theta: &theta[range.clone()],
                cos: &cos[range.clone()],
                sin: &sin[range.clone()],
                curvature: &curvature[range.clone()],
                curvature_rate: &curvature_rate[range.clone()],
            },
            lateral: self.lateral.cut(range),
            ..*self
        }
    }
}

/// Points that are worked on at once.
const BLOCK_POINTS: usize = 32;

/// Some points of a trajectory, one array per field.
struct Block {
    x: [f64; BLOCK_POINTS],
    y: [f64; BLOCK_POINTS],
    axis_x: [f64; BLOCK_POINTS],
    axis_y: [f64; BLOCK_POINTS],
    tan_offset: [f64; BLOCK_POINTS],
    curvature: [f64; BLOCK_POINTS],
    velocity: [f64; BLOCK_POINTS],
    acceleration: [f64; BLOCK_POINTS],
    d: [f64; BLOCK_POINTS],
}

multiversion! {
    /// Writes the trajectory of a sample; false if it is undefined somewhere or breaks a limit, and then what is written
    /// is of no use.
    pub(super) fn write = write_blocks, (
        sample: &FrenetTrajectory,
        limits: &Limits,
        center: f64,
        out: &mut Vec<Waypoint>,
    ) -> bool
}

#[inline(always)]
fn write_blocks(sample: &FrenetTrajectory, limits: &Limits, center: f64, out: &mut Vec<Waypoint>) -> bool {
    out.resize(limits.n_points, Waypoint::default());
    let out = &mut out[..limits.n_points];
    // Neighbouring blocks share a point, so that every step lies in one of them.
    let mut first = 0;
    loop {
        let n = BLOCK_POINTS.min(limits.n_points - first);
        let fits = if sample.is_over_arc {
            write_block::<true>(sample, first, limits, center, &mut out[first..first + n])
        } else {
            write_block::<false>(sample, first, limits, center, &mut out[first..first + n])
        };
        if !fits || first + n == limits.n_points {
            return fits;
        }
        first += n - 1;
    }
}

#[inline(always)]
fn write_block<const IS_OVER_ARC: bool>(
    sample: &FrenetTrajectory,
    first: usize,
    limits: &Limits,
    center: f64,
    out: &mut [Waypoint],
) -> bool {
    // The arrays are local, so the compiler knows that nothing else writes to them.
    let zeros = [0.0; BLOCK_POINTS];
    let mut block = Block {
        x: zeros,
        y: zeros,
        axis_x: zeros,
        axis_y: zeros,
        tan_offset: zeros,
        curvature: zeros,
        velocity: zeros,
        acceleration: zeros,
        d: zeros,
    };
    let n = out.len().min(BLOCK_POINTS);
    let sample = FrenetTrajectory { is_over_arc: IS_OVER_ARC, ..sample.cut(first, n) };
    let mut undefined = 0_u64;
    for i in 0..n {
        let (at, frenet) = sample.at(i);
        undefined |= u64::from(at.stretch(frenet.d) < STRETCH_MIN);
        let point = Waypoint::beside(&at, &frenet, center);
        block.x[i] = point.center.x;
        block.y[i] = point.center.y;
        block.axis_x[i] = point.axis.x;
        block.axis_y[i] = point.axis.y;
        block.tan_offset[i] = point.tan_offset;
        block.curvature[i] = point.curvature;
        block.velocity[i] = point.velocity;
        block.acceleration[i] = point.acceleration;
        block.d[i] = point.d;
    }
    let mut broken = 0_u64;
    for i in 1..n {
        let before = block.turning(i - 1);
        let [a, b, c, d, e] = limits.broken(&before, &block.turning(i), block.acceleration[i], first + i);
        broken |= u64::from(a | b | c | d | e);
    }
    for (i, out) in out.iter_mut().enumerate() {
        *out = Waypoint {
            center: Point::new(block.x[i], block.y[i]),
            axis: Point::new(block.axis_x[i], block.axis_y[i]),
            path_theta: sample.path.theta[i],
            tan_offset: block.tan_offset[i],
            curvature: block.curvature[i],
            velocity: block.velocity[i],
            acceleration: block.acceleration[i],
            d: block.d[i],
        };
    }
    undefined | broken == 0
}

impl Block {
    #[inline(always)]
    fn turning(&self, i: usize) -> Turning {
        Turning {
            axis: Point::new(self.axis_x[i], self.axis_y[i]),
            curvature: self.curvature[i],
            velocity: self.velocity[i],
        }
    }
}
