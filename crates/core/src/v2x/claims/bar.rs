//! Bars before which agents hold, and the record of who held for whom.

use super::{Negotiator, Situation};
use crate::barrier::Barrier;
use crate::columns::table;
use crate::geometry::Pose;

/// Length of a bar, largest width to each side [m].
const BAR_LENGTH: f64 = 0.3;
const BAR_SIDE: f64 = 6.0;
/// A bar is not wider than this share of the radius of the curve before it.
const BAR_CURVE: f64 = 0.8;
/// The stretch of path before a bar whose curvature counts [m].
const BAR_STRETCH: f64 = 15.0;

/// An obstacle across the path of the agent that holds before it, for a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Centre, and heading along the path.
    pub pose: Pose,
    /// Length and width [m].
    pub extent: (f64, f64),
    /// Its near edge on the path, and for whom; for nobody: the way behind the zone is blocked.
    pub barrier: Barrier,
}

table! {
    /// A stretch of time steps in which an agent holds for another.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Agreement {
        /// Id of the agent that holds.
        pub holding as "holding_id": i64,
        /// Id of the agent that goes; `None`: the way behind the zone is blocked.
        pub going as "going_id": Option<i64>,
        /// First time step.
        pub first as "first_time_step": i64,
        /// Last time step.
        pub last as "last_time_step": i64,
        /// Its bar at the first time step.
        pub bar: Pose,
        /// Number of its claim.
        pub claim: i64,
    }
}

/// Adds a time step to the stretch in which an agent holds for the same other.
pub(super) fn note(agreements: &mut Vec<Agreement>, new: Agreement) {
    let same = |old: &&mut Agreement| {
        (old.holding, old.going, old.claim) == (new.holding, new.going, new.claim) && old.last == new.first - 1
    };
    match agreements.iter_mut().rev().find(same) {
        Some(old) => old.last = new.last,
        None => agreements.push(new),
    }
}

/// The bar before a place, never nearer than the distance in which the agent stops [m].
pub(super) fn bar(agent: &Negotiator<'_>, barrier: &Barrier, stopping: f64, situation: &Situation<'_>) -> Bar {
    let near = (barrier.s - situation.settings.hold_margin).max(agent.front + stopping + 0.1);
    let at = agent.path.at(near + 0.5 * BAR_LENGTH);
    let curve = (0..=BAR_STRETCH as usize).map(|k| agent.path.at(near - k as f64).curvature.abs()).fold(0.0, f64::max);
    let most = BAR_SIDE.min(BAR_CURVE / curve.max(1e-6));
    let pose = Pose { position: at.position, orientation: at.theta };
    Bar { pose, extent: (BAR_LENGTH, 2.0 * most), barrier: Barrier { s: near, ..*barrier } }
}
