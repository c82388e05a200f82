//! All samples of one plan with everything that can be said about them, for pictures and studies.

use super::evaluation::Evaluation;
use super::feasibility::Rejection;
use super::search::SearchSpace;
use super::settings::N_TERMS;
use super::{Incumbent, length};
use crate::geometry::Point;

/// Samples of one plan, one row per sample: first the grid (end time by end time, speed by speed, lateral position by
/// lateral position), then stops, then braking, then the shifted previous plan, if there is one, then steered samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Candidates {
    /// Points of every sample, dt apart.
    pub n_points: usize,
    /// Footprint centre [m], shape (samples, points).
    pub x: Vec<f64>,
    /// Footprint centre [m], shape (samples, points).
    pub y: Vec<f64>,
    /// Unweighted cost terms in the order of [`super::CostWeights::NAMES`], shape (samples, 13). NaN for samples that
    /// no vehicle could drive.
    pub terms: Vec<f64>,
    /// Weighted sum of the terms; NaN likewise, shape (samples,).
    pub cost: Vec<f64>,
    /// Why a sample was rejected.
    pub rejection: Vec<Rejection>,
    /// Id of the participant that is hit; -1 for none. (Rejection `Collision`.)
    pub collision_id: Vec<i64>,
    /// When the manoeuvre ends [s].
    pub end_time: Vec<f64>,
    /// Speed along the path at its end [m/s].
    pub end_velocity: Vec<f64>,
    /// Lateral position at its end [m].
    pub end_offset: Vec<f64>,
    /// Speed at the end of the horizon [m/s].
    pub last_velocity: Vec<f64>,
    /// How many of them are steered, the last ones.
    pub n_steered: usize,
    /// The chosen sample; `None` if none is admissible.
    pub chosen: Option<usize>,
    /// Desired speed [m/s].
    pub desired_velocity: f64,
    /// As in `EvaluationMemory`.
    pub(super) undrivable: Vec<(f64, f64)>,
}

impl Candidates {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.cost.len()
    }

    /// There are none: the agent cannot be described in the frame of its path.
    pub fn is_empty(&self) -> bool {
        self.cost.is_empty()
    }

    /// A sample that would be cheaper and faster than the chosen one was rejected for the road alone.
    pub(super) fn is_held_by_road(&self, chosen: usize) -> bool {
        (0..self.len()).any(|i| {
            self.rejection[i] == Rejection::OffRoad
                && self.cost[i] < self.cost[chosen]
                && self.last_velocity[i] > self.last_velocity[chosen]
        })
    }

    /// Chooses among the samples that end faster than a speed [m/s] and cost less than a limit.
    pub(super) fn choose(&mut self, slowest: f64, limit: f64) {
        let counts = |i: &usize| self.end_velocity[*i] > slowest && self.cost[*i] < limit;
        let admissible = (0..self.len()).filter(|i| self.rejection[*i] == Rejection::Admissible).filter(counts);
        // The first of equals.
        self.chosen = admissible.min_by(|a, b| self.cost[*a].total_cmp(&self.cost[*b]));
    }

    /// What a plan must beat that replaces a sample.
    pub(super) fn incumbent(&self, sample: usize) -> Incumbent {
        let points = sample * self.n_points..(sample + 1) * self.n_points;
        let centers = points.map(|i| Point { x: self.x[i], y: self.y[i] });
        Incumbent { cost: self.cost[sample], velocity: self.last_velocity[sample], distance: length(centers) }
    }

    /// Evaluates all samples to the end.
    pub(super) fn of(evaluation: &mut Evaluation, desired_velocity: f64) -> Self {
        let n_points = evaluation.problem.limits.n_points;
        let mut out = Self { n_points, desired_velocity, ..Self::default() };
        for profile in 0..evaluation.tables.samples.profiles.len() {
            if evaluation.tables.samples.profiles[profile].rejection == Rejection::Admissible {
                evaluation.open(profile).for_each(drop);
            }
        }
        for sample in 0..evaluation.len() {
            out.push(evaluation, sample);
        }
        out.choose(f64::NEG_INFINITY, f64::INFINITY);
        out.undrivable.clone_from(&evaluation.tables.memory.undrivable);
        out
    }

    /// Evaluates all whole trajectories; one is chosen if it ends faster than a speed [m/s] and costs less than a limit.
    pub(super) fn of_wholes(evaluation: &mut Evaluation, (slowest, limit): (f64, f64)) -> Self {
        let mut out = Self { n_points: evaluation.problem.limits.n_points, ..Self::default() };
        for sample in evaluation.tables.samples.len()..evaluation.len() {
            out.push(evaluation, sample);
        }
        out.choose(slowest, limit);
        out
    }

    /// Adds the steered samples of the same request; their choice counts if there is one.
    pub(super) fn add_steered(&mut self, mut others: Self) {
        self.n_steered = others.len();
        self.chosen = others.chosen.map(|i| self.len() + i).or(self.chosen);
        let pairs = [
            (&mut self.x, &mut others.x),
            (&mut self.y, &mut others.y),
            (&mut self.terms, &mut others.terms),
            (&mut self.cost, &mut others.cost),
            (&mut self.end_time, &mut others.end_time),
            (&mut self.end_velocity, &mut others.end_velocity),
            (&mut self.end_offset, &mut others.end_offset),
            (&mut self.last_velocity, &mut others.last_velocity),
        ];
        for (mine, more) in pairs {
            mine.append(more);
        }
        self.rejection.append(&mut others.rejection);
        self.collision_id.append(&mut others.collision_id);
    }

    fn push(&mut self, evaluation: &mut Evaluation, sample: usize) {
        let mut rejection = evaluation.write_points(sample);
        let mut collision_id = -1;
        let can_be_driven = rejection == Rejection::Admissible;
        if !can_be_driven {
            evaluation.note_undrivable(sample);
        } else {
            if let Some(contact) = evaluation.contact() {
                let request = evaluation.problem.request;
                collision_id = request.predictions.ids[request.others[contact.other].row];
                rejection = Rejection::Collision;
            } else if !evaluation.stays_on_road() {
                rejection = Rejection::OffRoad;
            }
        }
        let terms = if can_be_driven { evaluation.terms(sample) } else { [f64::NAN; N_TERMS] };
        let weights = evaluation.problem.settings.weights.as_array();
        self.cost.push(terms.iter().zip(weights).map(|(term, weight)| term * weight).sum());
        self.terms.extend(terms);
        self.rejection.push(rejection);
        self.collision_id.push(collision_id);
        self.x.extend(evaluation.points().iter().map(|point| point.center.x));
        self.y.extend(evaluation.points().iter().map(|point| point.center.y));
        let last = evaluation.points()[self.n_points - 1];
        self.last_velocity.push(last.velocity);
        let (end_time, end_velocity, end_offset) = match evaluation.cell(sample) {
            Some((profile, end_offset)) => {
                let profile = &evaluation.tables.samples.profiles[profile];
                (profile.end_time, profile.end_velocity, evaluation.tables.samples.end_offsets[end_offset])
            }
            None => (evaluation.problem.limits.horizon(), last.velocity, last.d),
        };
        self.end_time.push(end_time);
        self.end_velocity.push(end_velocity);
        self.end_offset.push(end_offset);
    }
}
