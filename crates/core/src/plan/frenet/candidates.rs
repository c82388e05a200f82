//! All samples of one plan with everything that can be said about them, for pictures and studies.

use super::feasibility::Rejection;
use super::profiles::LongitudinalProfile;
use super::search::Evaluation;
use super::settings::N_TERMS;

/// Samples of one plan, one row per sample: first the grid (end time by end time, speed by speed, lateral position by
/// lateral position), then stops, then braking.
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
    /// The chosen sample; `None` if none is admissible.
    pub chosen: Option<usize>,
    /// Desired speed [m/s].
    pub desired_velocity: f64,
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

    /// Evaluates all samples to the end.
    pub(super) fn of(evaluation: &mut Evaluation) -> Self {
        let n_points = evaluation.samples().n_points;
        let mut out = Self { n_points, desired_velocity: evaluation.problem.targets.velocity, ..Self::default() };
        for sample in 0..evaluation.samples().len() {
            out.push(evaluation, sample);
        }
        let admissible = (0..out.len()).filter(|i| out.rejection[*i] == Rejection::Admissible);
        // The first of equals.
        out.chosen = admissible.min_by(|a, b| out.cost[*a].total_cmp(&out.cost[*b]));
        out
    }

    fn push(&mut self, evaluation: &mut Evaluation, sample: usize) {
        let (rejection, contact) = evaluation.examine(sample);
        let (request, settings) = (evaluation.problem.request, evaluation.problem.settings);
        let can_be_driven = [Rejection::Admissible, Rejection::Collision, Rejection::OffRoad].contains(&rejection);
        let terms = if can_be_driven { evaluation.terms(sample) } else { [f64::NAN; N_TERMS] };
        let weights = settings.weights.as_array();
        self.cost.push(terms.iter().zip(weights).map(|(term, weight)| term * weight).sum());
        self.terms.extend(terms);
        self.rejection.push(rejection);
        self.collision_id.push(contact.map_or(-1, |one| request.predictions.ids[request.others[one.other].row]));
        self.x.extend(evaluation.points().iter().map(|point| point.center.x));
        self.y.extend(evaluation.points().iter().map(|point| point.center.y));
        let last = evaluation.points()[self.n_points - 1];
        self.last_velocity.push(last.velocity);
        let (profile, end_offset) = evaluation.samples().cell(sample);
        let LongitudinalProfile { end_time, end_velocity, .. } = evaluation.samples().profiles[profile];
        self.end_time.push(end_time);
        self.end_velocity.push(end_velocity);
        self.end_offset.push(end_offset);
    }
}
