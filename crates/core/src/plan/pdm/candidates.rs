//! What a plan was chosen from, for pictures and studies.

use super::{Grid, PdmMemory, PdmSettings, PlanRequest, best, scoring, variants};

/// Names of the terms: gates, then what is weighted; 1 is best.
pub const PDM_TERMS: [&str; 6] = ["collision", "road", "direction", "progress", "ttc", "comfort"];

/// All proposals of one plan, those on the middle of the lane first, by rising speed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PdmCandidates {
    /// Points of every proposal, dt apart.
    pub n_points: usize,
    /// Footprint centre [m], shape (proposals, points).
    pub x: Vec<f64>,
    /// Footprint centre [m], shape (proposals, points).
    pub y: Vec<f64>,
    /// In the order of [`PDM_TERMS`], shape (proposals, 6).
    pub terms: Vec<f64>,
    /// 1 minus the score, shape (proposals,).
    pub cost: Vec<f64>,
    /// Share of the speed limit, for people.
    pub pace: Vec<String>,
    /// What it would hit or leave, for people; empty for none.
    pub rejection: Vec<String>,
    /// Speed at the end [m/s].
    pub end_velocity: Vec<f64>,
    /// Offset at the end [m].
    pub end_offset: Vec<f64>,
    /// The best proposal; `None` if the agent is not beside its path.
    pub chosen: Option<usize>,
}

/// All proposals of the plan for a request.
pub(in crate::plan) fn candidates(request: &PlanRequest, settings: &PdmSettings) -> PdmCandidates {
    let mut memory = PdmMemory::default();
    let mut found = PdmCandidates::default();
    let Ok((_, chosen)) = best(request, settings, &mut memory) else { return found };
    found.chosen = Some(chosen);
    let grid = Grid::new(request, settings);
    let longest = scoring::longest(&memory.judged);
    found.n_points = (grid.n_points - 1) / grid.every + 1;
    let proposals = memory.points.chunks_exact(grid.n_points).zip(&memory.judged).zip(variants(settings));
    for ((points, judged), (_, share)) in proposals {
        found.x.extend(points.iter().step_by(grid.every).map(|point| point.center.x));
        found.y.extend(points.iter().step_by(grid.every).map(|point| point.center.y));
        let progress = judged.progress(longest);
        found.terms.extend([judged.collision, judged.road, judged.direction, progress, judged.ttc, judged.comfort]);
        found.cost.push(1.0 - judged.score(&settings.weights, longest));
        found.pace.push(format!("{:.0} % of the limit", 100.0 * share));
        found.rejection.push(match judged.hit {
            Some((_, other)) => format!("collision with {}", request.predictions.ids[request.others[other].row]),
            None if judged.road == 0.0 => "off the road".into(),
            None if judged.direction == 0.0 => "against the lanes".into(),
            None => String::new(),
        });
        let last = points[points.len() - 1];
        found.end_velocity.push(last.velocity);
        found.end_offset.push(last.d);
    }
    found
}
