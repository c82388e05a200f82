//! The cost terms that follow from the grid of samples alone, for all samples of a profile at once.

use super::cost_bounds::FirstBounds;
use super::grid::SampleGrid;
use super::profile_speeds::{ProfileSpeeds, WIDTH, summed_gaps, summed_squares};
use super::settings::CostWeights;
use super::terms::from_tables;
use crate::geometry::polyline::ReferencePath;

/// Terms that follow from the tables. At first every profile has only a lower bound; a better bound, and then the costs
/// of its samples, are computed on demand.
#[derive(Debug, Clone, Default)]
pub(super) struct TableCosts {
    /// One entry per sample, of this plan once `compute_profile` has seen its profile.
    pub(super) velocity_offset: Vec<f64>,
    /// Weighted sum of the terms from the tables, likewise.
    pub(super) total: Vec<f64>,
    /// No sample of the profile has a smaller total; infinite for rejected profiles.
    pub(super) bounds: Vec<f64>,
    /// The bound is as good as it gets.
    is_tight: Vec<bool>,
    desired_velocity: f64,
    speeds: ProfileSpeeds,
    /// The smallest weighted sum of the lateral terms, by lateral table of time.
    lateral: Vec<f64>,
    first: FirstBounds,
    /// 1 for points, 0 for padding.
    counts: Vec<f64>,
}

/// Bounds are lowered by this fraction: the sums that they bound are rounded.
const ROUNDING: f64 = 1e-9;

impl TableCosts {
    /// First bounds of all profiles.
    pub(super) fn prepare(
        &mut self,
        samples: &SampleGrid,
        desired_velocity: f64,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        self.desired_velocity = desired_velocity;
        self.speeds.profile = None;
        self.velocity_offset.resize(samples.len(), f64::INFINITY);
        self.total.resize(samples.len(), f64::INFINITY);
        self.is_tight.clear();
        self.is_tight.resize(samples.profiles.len(), false);
        self.counts.clear();
        self.counts.extend((0..samples.stride).map(|i| if i < samples.n_points { 1.0 } else { 0.0 }));
        self.lateral.clear();
        for table in 0..samples.lateral.len() {
            self.lateral.push(least_lateral(samples, table, weights));
        }
        self.first.prepare(samples, path);
        self.bounds.clear();
        for index in 0..samples.profiles.len() {
            let bound = self.first_bound(samples, index, weights);
            self.bounds.push(bound);
        }
    }

    fn first_bound(&mut self, samples: &SampleGrid, index: usize, weights: &CostWeights) -> f64 {
        let profile = &samples.profiles[index];
        if profile.rejection != super::Rejection::Admissible {
            return f64::INFINITY;
        }
        let gaps = self.first.gaps(samples, index, self.desired_velocity);
        let lateral = profile.table.map_or(0.0, |table| self.lateral[table]);
        (from_tables(weights, gaps.sqrt(), 0.0, 0.0, profile.jerk) + lateral) * (1.0 - ROUNDING)
    }

    /// A better bound of an admissible profile, once.
    pub(super) fn tighten(
        &mut self,
        samples: &mut SampleGrid,
        index: usize,
        weights: &CostWeights,
        path: &ReferencePath,
    ) -> Option<f64> {
        if std::mem::replace(&mut self.is_tight[index], true) {
            return None;
        }
        samples.load_motion(index);
        let table = samples.lateral_table(index);
        self.speeds.find(samples, index, path);
        let outer = [samples.end_offsets[0], samples.end_offsets[samples.end_offsets.len() - 1]];
        let gaps = summed_gaps(&self.speeds, &self.counts, outer, self.desired_velocity);
        let lateral = self.lateral.get(table).copied().unwrap_or_else(|| least_lateral(samples, table, weights));
        let total = from_tables(weights, gaps.sqrt(), 0.0, 0.0, samples.profiles[index].jerk) + lateral;
        Some((total * (1.0 - ROUNDING)).max(self.bounds[index]))
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
