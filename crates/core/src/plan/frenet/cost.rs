//! The cost terms that follow from the grid of samples alone, for all samples of a profile at once.

use super::cost_bounds::FirstBounds;
use super::grid::SampleGrid;
use super::lateral::LateralPoints;
use super::settings::CostWeights;
use super::terms::from_tables;
use crate::geometry::polyline::ReferencePath;
use crate::simd::multiversion;

/// Terms that follow from the tables. At first every profile has only a lower bound; the costs of its samples are computed
/// on demand.
#[derive(Debug, Clone, Default)]
pub(super) struct TableCosts {
    /// One entry per sample, of this plan once `compute_profile` has seen its profile.
    pub(super) velocity_offset: Vec<f64>,
    /// Weighted sum of the terms from the tables, likewise.
    pub(super) total: Vec<f64>,
    /// No sample of the profile has a smaller total; infinite for rejected profiles.
    pub(super) bounds: Vec<f64>,
    desired_velocity: f64,
    speeds: ProfileSpeeds,
    /// The smallest weighted sum of the lateral terms, by lateral table of time.
    lateral: Vec<f64>,
    first: FirstBounds,
}

/// Bounds are lowered by this fraction: the sums that they bound are rounded.
const ROUNDING: f64 = 1e-9;

impl TableCosts {
    /// Bounds of all profiles.
    pub(super) fn prepare(
        &mut self,
        samples: &SampleGrid,
        desired_velocity: f64,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        self.desired_velocity = desired_velocity;
        self.velocity_offset.resize(samples.len(), f64::INFINITY);
        self.total.resize(samples.len(), f64::INFINITY);
        self.lateral.clear();
        for table in 0..samples.lateral.len() {
            self.lateral.push(least_lateral(samples, table, weights));
        }
        self.first.prepare(samples, path);
        self.bounds.clear();
        for index in 0..samples.profiles.len() {
            let bound = self.bound(samples, index, weights);
            self.bounds.push(bound);
        }
    }

    fn bound(&mut self, samples: &SampleGrid, index: usize, weights: &CostWeights) -> f64 {
        let profile = &samples.profiles[index];
        if profile.rejection != super::Rejection::Admissible {
            return f64::INFINITY;
        }
        let gaps = self.first.gaps(samples, index, self.desired_velocity);
        let lateral = profile.table.map_or(0.0, |table| self.lateral[table]);
        (from_tables(weights, gaps.sqrt(), 0.0, 0.0, profile.jerk) + lateral) * (1.0 - ROUNDING)
    }

    /// Terms and totals of the samples of an admissible profile. The first is the root of the summed squares of
    /// v - v_desired, with v² = (s_dot K)² + d_dot².
    pub(super) fn compute_profile(
        &mut self,
        samples: &mut SampleGrid,
        index: usize,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        samples.load_motion(index);
        let table = samples.lateral_table(index);
        self.speeds.find(samples, index, path);
        let n_offsets = samples.end_offsets.len();
        let profile = &samples.profiles[index];
        let end_offsets = index * n_offsets..(index + 1) * n_offsets;
        let sums = &mut self.velocity_offset[end_offsets.clone()];
        for (sums, end_offsets) in sums.chunks_mut(WIDTH).zip(samples.end_offsets.chunks(WIDTH)) {
            let squares = summed_squares(&self.speeds, end_offsets, self.desired_velocity);
            sums.copy_from_slice(&squares[..sums.len()]);
        }
        let per_offset = table * n_offsets..(table + 1) * n_offsets;
        let parts = samples.lateral.offset[per_offset.clone()].iter().zip(&samples.lateral.jerk[per_offset]);
        for ((velocity_offset, total), (offset, jerk)) in sums.iter_mut().zip(&mut self.total[end_offsets]).zip(parts) {
            *velocity_offset = velocity_offset.sqrt();
            *total = from_tables(weights, *velocity_offset, *offset, *jerk, profile.jerk);
        }
    }
}

/// The smallest weighted sum of the lateral terms of a table.
fn least_lateral(samples: &SampleGrid, table: usize, weights: &CostWeights) -> f64 {
    let end_offsets = table * samples.end_offsets.len()..(table + 1) * samples.end_offsets.len();
    let terms = samples.lateral.offset[end_offsets.clone()].iter().zip(&samples.lateral.jerk[end_offsets]);
    let sums = terms.map(|(offset, jerk)| from_tables(weights, 0.0, *offset, *jerk, 0.0));
    sums.fold(f64::INFINITY, f64::min)
}

/// Samples that are worked on at once.
const WIDTH: usize = 4;

/// Both components of the velocity of a profile's samples at all points, along the path and sideways; they are linear in the
/// end offset.
#[derive(Debug, Clone, Default)]
struct ProfileSpeeds {
    n_points: usize,
    curvature: Vec<f64>,
    along: Vec<f64>,
    along_by_offset: Vec<f64>,
    sideways: Vec<f64>,
    sideways_by_offset: Vec<f64>,
}

impl ProfileSpeeds {
    /// Speeds of the samples of a profile.
    fn find(&mut self, samples: &SampleGrid, index: usize, path: &ReferencePath) {
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
    fn summed_squares = squares_of, (speeds: &ProfileSpeeds, end_offsets: &[f64], desired: f64) -> [f64; WIDTH]
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
