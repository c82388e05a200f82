//! What a plan was chosen from, for pictures and studies.

use super::search::Evaluated;
use super::{N_TERMS, PlanRequest, RolloutMemory, RolloutSettings, best};

/// Roll-outs of one plan, in the order in which they were driven. Proposals that could not be better any more are not among
/// them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RolloutCandidates {
    /// Points of every roll-out, dt apart.
    pub n_points: usize,
    /// Footprint centre [m], shape (roll-outs, points).
    pub x: Vec<f64>,
    /// Footprint centre [m], shape (roll-outs, points).
    pub y: Vec<f64>,
    /// Unweighted cost terms in the order of [`super::RolloutWeights::NAMES`], shape (roll-outs, 12).
    pub terms: Vec<f64>,
    /// Weighted sum of the terms, shape (roll-outs,).
    pub cost: Vec<f64>,
    /// Pace, for people.
    pub pace: Vec<&'static str>,
    /// What it would hit or leave, for people; empty for none.
    pub rejection: Vec<String>,
    /// Speed at the end [m/s].
    pub end_velocity: Vec<f64>,
    /// Offset at the end [m].
    pub end_offset: Vec<f64>,
    /// The chosen roll-out; `None` if the agent is not beside its path.
    pub chosen: Option<usize>,
    /// Desired speed on a free and straight road [m/s].
    pub desired_velocity: f64,
}

/// Roll-outs of a plan, if they are wanted.
#[derive(Debug, Clone, Default)]
pub(super) struct Log(pub(super) Option<RolloutCandidates>);

impl Log {
    pub(super) fn record(&mut self, request: &PlanRequest, evaluated: &Evaluated) {
        let Some(found) = &mut self.0 else { return };
        let points = &evaluated.rollout.points;
        found.n_points = points.len();
        found.x.extend(points.iter().map(|point| point.center.x));
        found.y.extend(points.iter().map(|point| point.center.y));
        found.terms.extend(evaluated.terms);
        found.cost.push(evaluated.cost);
        found.pace.push(evaluated.pace.name());
        found.rejection.push(evaluated.contact.map_or_else(String::new, |contact| match contact.other {
            Some(other) => format!("collision with {}", request.predictions.ids[request.others[other].row]),
            None => "off the road".into(),
        }));
        let last = points[points.len() - 1];
        found.end_velocity.push(last.velocity);
        found.end_offset.push(last.d);
    }
}

/// All roll-outs of the plan for a request.
pub(in crate::plan) fn candidates(request: &PlanRequest, settings: &RolloutSettings) -> RolloutCandidates {
    let mut memory = RolloutMemory { log: Log(Some(RolloutCandidates::default())), ..RolloutMemory::default() };
    let best = best(request, settings, &mut memory);
    let mut found = memory.log.0.take().expect("it was wanted");
    debug_assert_eq!(found.terms.len(), found.cost.len() * N_TERMS);
    if let Some(best) = best {
        found.chosen = found.cost.iter().position(|cost| cost.to_bits() == best.cost.to_bits());
        found.desired_velocity = best.wish;
    }
    found
}
