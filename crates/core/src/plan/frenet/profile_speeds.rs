//! Speeds in the world of all samples of a profile: linear in the end offset.

use super::cost_bounds::{largest_magnitude, smallest_magnitude};
use super::grid::SampleGrid;
use super::lateral::LateralPoints;
use crate::geometry::polyline::ReferencePath;
use crate::simd::multiversion;

/// Samples that are worked on at once.
pub(super) const WIDTH: usize = 4;

/// Both components of the velocity of a profile's samples at all points, along the path and sideways; they are linear in the
/// end offset.
#[derive(Debug, Clone, Default)]
pub(super) struct ProfileSpeeds {
    pub(super) profile: Option<usize>,
    n_points: usize,
    curvature: Vec<f64>,
    along: Vec<f64>,
    along_by_offset: Vec<f64>,
    sideways: Vec<f64>,
    sideways_by_offset: Vec<f64>,
}

impl ProfileSpeeds {
    /// Speeds of the samples of a profile.
    pub(super) fn find(&mut self, samples: &SampleGrid, index: usize, path: &ReferencePath) {
        if self.profile.replace(index) == Some(index) {
            return;
        }
        let (motion, lateral) = (samples.motions(index), samples.lateral_points(index));
        self.n_points = samples.n_points;
        let Self { curvature, along, along_by_offset, sideways, sideways_by_offset, .. } = self;
        for buffer in [&mut *curvature, along, along_by_offset, sideways, sideways_by_offset] {
            buffer.resize(samples.stride, 0.0);
        }
        for (curvature, s) in curvature.iter_mut().zip(motion.s) {
            *curvature = path.curvature_at(*s);
        }
        write_speeds(self, motion.s_dot, &lateral, samples.profiles[index].is_over_arc);
    }
}

multiversion! {
    fn write_speeds = speeds_at, (out: &mut ProfileSpeeds, s_dot: &[f64], lateral: &LateralPoints, is_over_arc: bool)
}

#[inline(always)]
fn speeds_at(out: &mut ProfileSpeeds, s_dot: &[f64], lateral: &LateralPoints, is_over_arc: bool) {
    let n = s_dot.len();
    let (curvature, LateralPoints { home, step }) = (&out.curvature[..n], lateral.cut(0..n));
    let (along, along_by_offset) = (&mut out.along[..n], &mut out.along_by_offset[..n]);
    let (sideways, sideways_by_offset) = (&mut out.sideways[..n], &mut out.sideways_by_offset[..n]);
    for i in 0..n {
        // d' s_dot = d_dot
        let factor = if is_over_arc { s_dot[i] } else { 1.0 };
        along[i] = s_dot[i] * (1.0 - curvature[i] * home[0][i]);
        along_by_offset[i] = -s_dot[i] * curvature[i] * step[0][i];
        sideways[i] = factor * home[1][i];
        sideways_by_offset[i] = factor * step[1][i];
    }
}

multiversion! {
    /// Summed squares of speed minus desired speed over the points, for up to four end offsets.
    pub(super) fn summed_squares = squares_of, (speeds: &ProfileSpeeds, end_offsets: &[f64], desired: f64) -> [f64; WIDTH]
}

#[inline(always)]
fn squares_of(speeds: &ProfileSpeeds, end_offsets: &[f64], desired: f64) -> [f64; WIDTH] {
    let mut end_offset = [0.0; WIDTH];
    end_offset[..end_offsets.len()].copy_from_slice(end_offsets);
    let mut sums = [0.0; WIDTH];
    let n = speeds.n_points;
    let (along, along_by_offset) = (&speeds.along[..n], &speeds.along_by_offset[..n]);
    let (sideways, sideways_by_offset) = (&speeds.sideways[..n], &speeds.sideways_by_offset[..n]);
    for i in 0..n {
        for k in 0..WIDTH {
            let along = along[i] + end_offset[k] * along_by_offset[i];
            let sideways = sideways[i] + end_offset[k] * sideways_by_offset[i];
            let offset = (along * along + sideways * sideways).sqrt() - desired;
            sums[k] += offset * offset;
        }
    }
    sums
}

/// Sum over all points with padding in an order that suits wide machines.
#[inline(always)]
fn summed(n: usize, value: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0; WIDTH];
    for i in (0..n).step_by(WIDTH) {
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += value(i + k);
        }
    }
    sums.iter().sum()
}

multiversion! {
    /// Summed squares of what speed and desired speed differ by at least, whatever the end offset between the outer ones.
    pub(super) fn summed_gaps = gaps_of, (speeds: &ProfileSpeeds, counts: &[f64], outer: [f64; 2], desired: f64) -> f64
}

#[inline(always)]
fn gaps_of(speeds: &ProfileSpeeds, counts: &[f64], [first, last]: [f64; 2], desired: f64) -> f64 {
    let n = counts.len();
    let (along, along_by_offset) = (&speeds.along[..n], &speeds.along_by_offset[..n]);
    let (sideways, sideways_by_offset) = (&speeds.sideways[..n], &speeds.sideways_by_offset[..n]);
    summed(n, |i| {
        // Each component is between its values at the outer end offsets.
        let ahead = (along[i] + first * along_by_offset[i], along[i] + last * along_by_offset[i]);
        let aside = (sideways[i] + first * sideways_by_offset[i], sideways[i] + last * sideways_by_offset[i]);
        let (low, low_aside) = (smallest_magnitude(ahead.0, ahead.1), smallest_magnitude(aside.0, aside.1));
        let (high, high_aside) = (largest_magnitude(ahead.0, ahead.1), largest_magnitude(aside.0, aside.1));
        let (low, high) = (low * low + low_aside * low_aside, high * high + high_aside * high_aside);
        // The speed between both that is nearest to the desired one.
        let (square, near) = (desired * desired, if high < desired * desired { high } else { desired * desired });
        let gap = (if low > square { low } else { near }).sqrt() - desired;
        counts[i] * (gap * gap)
    })
}
