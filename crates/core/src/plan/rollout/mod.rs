//! Planning by closed-loop roll-outs: a few ways to drive, each driven ahead by a model of the vehicle, judged by one cost.
//!
//! A proposal is a way (the path at an offset), a pace and a steering law. The pace makes a motion along the way
//! (`speeds`), the steering law a motion of the vehicle (`steering`), which it can drive by construction, from any state.
//! Contacts and leaving the road cost more than anything else (`contacts`), so emergency braking is a proposal like
//! others. What the speeds of a proposal cost bounds its cost from below: proposals are driven in that order
//! until none can be better than the best (`search`).

mod settings;
mod start;
mod speeds;
mod steering;
mod contacts;
mod search;
mod recovery;
mod candidates;
#[cfg(test)]
mod tests;

pub use candidates::RolloutCandidates;
pub(super) use candidates::candidates;
pub use settings::{N_TERMS, RolloutSettings, RolloutWeights};
pub(in crate::plan) use start::Start;

use super::conflicts::Conflicts;
use super::driven_point::DrivenPoint;
use super::{PlanRequest, PlanResult};
use crate::geometry::Pose;
use crate::trajectory::{Obstruction, PlanStatus, Trajectory};
use contacts::{Contact, Surroundings};
use search::{Best, Search};
use speeds::RoadSpeeds;
use steering::Rollout;

/// Plans that cost more make the yaw rate of a recorded state doubtful.
const DOUBTFUL_COST: f64 = 5.0;
/// Plans with a contact or off the road that cost more are emergencies.
const DANGER_COST: f64 = 60.0;

/// Memory that plans reuse. Holds no state: a plan does not depend on what was planned before with the same memory.
#[derive(Debug, Clone, Default)]
pub struct RolloutMemory {
    conflicts: Conflicts,
    road_speeds: RoadSpeeds,
    surroundings: Surroundings,
    rollout: Rollout,
    effort: usize,
    log: candidates::Log,
}

impl RolloutMemory {
    /// Roll-outs of the last plan.
    pub(crate) fn effort(&self) -> usize {
        self.effort
    }
}

/// The plan for a request: a trajectory with a point every dt over the horizon, point 0 the present state; `None` if the agent
/// is not beside its path.
pub(super) fn plan(
    request: &PlanRequest,
    settings: &RolloutSettings,
    memory: &mut RolloutMemory,
) -> Option<PlanResult> {
    memory.effort = 0;
    let best = best(request, settings, memory)?;
    let is_emergency = best.is_emergency || best.contact.is_some() && best.cost > DANGER_COST;
    let trajectory = Trajectory { points: best.rollout.states(request) };
    if !is_emergency {
        let obstruction = best.held.map(|held| obstruction(request, &held.point, &held.contact));
        return Some(PlanResult { obstruction, ..PlanResult::planned(trajectory, best.cost) });
    }
    let obstruction = Some(best.contact.map_or_else(
        || Obstruction::nowhere("collision"),
        |contact| obstruction(request, &best.rollout.points[contact.point], &contact),
    ));
    Some(PlanResult { status: PlanStatus::EmergencyBraking, obstruction, ..PlanResult::planned(trajectory, best.cost) })
}

/// The best roll-out for a request.
fn best(request: &PlanRequest, settings: &RolloutSettings, memory: &mut RolloutMemory) -> Option<Best> {
    let best = Search::new(request, settings, Start::new(request, true)?, memory).run();
    if request.previous.is_some() || best.cost <= DOUBTFUL_COST {
        return Some(best);
    }
    // Recorded yaw rates are noisy; all later ones come from a plan.
    let other = Search::new(request, settings, Start::new(request, false)?, memory).run();
    Some(if other.cost < best.cost { other } else { best })
}

/// What is in the way of a roll-out that is at a point in its first contact.
fn obstruction(request: &PlanRequest, point: &DrivenPoint, contact: &Contact) -> Obstruction {
    match contact.other {
        Some(other) => {
            let id = request.predictions.ids[request.others[other].row];
            Obstruction { at: point.center, ..Obstruction::nowhere(&format!("collision with {id}")) }
        }
        None => {
            let pose = Pose { position: point.center, orientation: point.theta };
            let overhang = request.road.overhang(request.shape, pose, &mut Vec::new());
            Obstruction { at: point.center, overhang, ..Obstruction::nowhere("off the road") }
        }
    }
}
